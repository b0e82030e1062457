/// Options declared in tables: what is outside a table is refused everywhere by name, a change of any option is seen,
/// and what is written of a law or a stage reads back to the same bits, field by field.
#include "cavort/solve.h"
#include "check.h"
#include "options.h"
#include "problem_file.h"
#include "scene.h"

static void set(void *values, const cav_field *field, double value) {
  char *at = (char *)values + field->offset;
  if (field->type == CAV_FIELD_REAL)
    memcpy(at, &value, sizeof value);
  else
    memcpy(at, &(int){(int)value}, sizeof(int));
}

static double get(const void *values, const cav_field *field) {
  const char *at = (const char *)values + field->offset;
  double value;
  int whole;
  memcpy(&whole, at, sizeof whole);
  if (field->type != CAV_FIELD_REAL) return whole;
  memcpy(&value, at, sizeof value);
  return value;
}

/// Values just outside a field's range; returns their number.
static int outside(const cav_field *field, double out[4]) {
  int n = 0;
  if (field->type == CAV_FIELD_FLAG) return 0;
  out[n++] = field->least == DBL_MIN ? 0 : field->least - 1;
  if (field->type != CAV_FIELD_WHOLE) out[n++] = field->most < 1e300 ? field->most + 1 : INFINITY;
  if (field->type == CAV_FIELD_REAL) out[n++] = NAN;
  if (field->type == CAV_FIELD_WORD) out[n++] = 99;
  return n;
}

/// A value inside, told apart from the last one by k.
static double inside(const cav_field *field, int k) {
  if (field->type == CAV_FIELD_WORD) return k % ((int)field->most + 1);
  if (field->type == CAV_FIELD_FLAG) return k % 2;
  if (field->type == CAV_FIELD_WHOLE) return field->least + k;
  return (field->most < 1e300 ? field->most : 3) * (k + 1) / (k + 3.7);
}

/// The tables speak of every byte that options have, and of every word.
static void test_tables(void) {
  int n, nstage;
  const cav_field *field = cav_option_fields(&n), *stage = cav_stage_fields(&nstage);
  size_t size = 0, stage_size = 0;
  for (int i = 0; i < n; i++) size += field[i].type == CAV_FIELD_REAL ? sizeof(double) : sizeof(int);
  for (int i = 0; i < nstage; i++) stage_size += stage[i].type == CAV_FIELD_REAL ? sizeof(double) : sizeof(int);
  // but for what aligns doubles
  CHECK(sizeof(cav_options) - size < (size_t)n * sizeof(int) &&
        sizeof(cav_stage_options) - stage_size < sizeof(double));
  for (int i = 0; i < n + nstage; i++) {
    const cav_field *f = i < n ? field + i : stage + (i - n);
    CHECK(*f->name && *f->text);
    int words = 0;
    while (f->words && f->words[words]) words++;
    CHECK(words == (f->type == CAV_FIELD_WORD ? (int)f->most + 1 : 0));
  }
}

/// Evaluations, forward steps and cav_options_check refuse the same options, and take the state up again after them.
static void test_refused(void) {
  cav_model *m = scene_load(scene_joints);
  if (!CHECK(m != NULL)) return;
  cav_state *state = cav_state_new(m);
  double *v = scene_vector(m->nv), *u = scene_vector(m->nv), *same = scene_vector(m->nv);
  int n, refused = 0, flags = 0;
  const cav_field *field = cav_option_fields(&n);
  for (int i = 0; i < n; i++) flags += field[i].type == CAV_FIELD_FLAG;
  const cav_options own = state->options;
  CHECK(own.timestep == m->timestep && cav_options_check(&own, NULL) == CAV_OK);
  CHECK(cav_inverse(m, state, m->q0, v, v, same) == CAV_OK);
  for (int i = 0; i < n; i++) {
    double bad[4];
    for (int k = outside(&field[i], bad) - 1; k >= 0; k--, refused++) {
      cav_error error = {0};
      set(&state->options, &field[i], bad[k]);
      CHECK(cav_options_check(&state->options, &error) == CAV_BAD_INPUT && error.status == CAV_BAD_INPUT);
      CHECK(strstr(error.text, field[i].name) && strstr(error.text, "expected"));
      u[0] = 7;
      CHECK(cav_inverse(m, state, m->q0, v, v, u) == CAV_BAD_INPUT && u[0] == 7);
      CHECK(cav_inverse_from(m, state, CAV_STAGE_VELOCITY, m->q0, v, v, u) == CAV_BAD_INPUT && u[0] == 7);
      CHECK(cav_forward(m, state, m->q0, v, same, u) == CAV_BAD_INPUT && u[0] == 7);
      state->options = own;
      CHECK(cav_inverse(m, state, m->q0, v, v, u) == CAV_OK && !memcmp(u, same, (size_t)m->nv * sizeof *u));
    }
  }
  printf("%d options outside their table, all refused\n", refused);
  CHECK(refused == 3 * (n - flags));
  cav_state_free(state);
  cav_model_free(m);
  free(v), free(u), free(same);
}

/// A change of any one option is told from none.
static void test_same(void) {
  static const char *const velocity_options[] = {"order", "sliding", "next_gap", "next_slip", "gravity", "passive"};
  enum { LATE = sizeof velocity_options / sizeof *velocity_options };
  int n;
  const cav_field *field = cav_option_fields(&n);
  cav_options a = {0};
  for (int i = 0; i < n; i++) set(&a, &field[i], inside(&field[i], 0));
  CHECK(cav_options_check(&a, NULL) == CAV_OK);
  for (int i = 0; i < n; i++) {
    cav_options b = a;
    CHECK(cav_options_same(&a, &b, CAV_STAGE_VELOCITY));
    set(&b, &field[i], inside(&field[i], 1));
    CHECK(!cav_options_same(&a, &b, CAV_STAGE_VELOCITY));
    int late = 0;
    for (int k = 0; k < LATE; k++) late |= !strcmp(field[i].name, velocity_options[k]);
    CHECK(cav_options_same(&a, &b, CAV_STAGE_POSITION) == late);
  }
}

/// Law and stages as written and read.
static void test_file(void) {
  char folder[] = "/tmp/cavort-options-XXXXXX", path[64];
  if (!CHECK(mkdtemp(folder) != NULL)) return;
  scene_write(folder, "body.xml",
              "<mujoco><worldbody><body name='ball'><joint name='x' type='slide'/><geom size='.1'/></body></worldbody>"
              "</mujoco>");
  snprintf(path, sizeof path, "%s/body.xml", folder);
  cav_error error = {0};
  cav_model *m = cav_model_load(path, &error);
  if (!CHECK(m != NULL)) return;
  int n, nstage;
  const cav_field *field = cav_option_fields(&n), *stage = cav_stage_fields(&nstage);
  double zero[1] = {0};
  for (int k = 0; k < 6; k++) {
    cav_problem p = cav_problem_default(m), *back;
    p.q_start = p.v_start = p.q_goal = zero;
    p.model_path = path;
    p.solved = 1;
    for (int i = 0; i < n; i++) set(&p.contact, &field[i], inside(&field[i], k));
    for (int i = 0; i < nstage; i++) set(&p.schedule.first, &stage[i], inside(&stage[i], k));
    for (int i = 0; i < nstage; i++) set(&p.schedule.last, &stage[i], inside(&stage[i], k + 1));
    p.timestep = p.contact.timestep, p.duration = 10 * p.timestep;
    char file[64];
    snprintf(file, sizeof file, "%s/problem.xml", folder);
    CHECK(cav_problem_write(file, &p, path, &error) == CAV_OK);
    back = cav_problem_load(file, NULL, &error);
    if (!CHECK(back != NULL)) {
      fprintf(stderr, "    %s\n", error.text);
      continue;
    }
    for (int i = 0; i < n; i++) CHECK(get(&back->contact, &field[i]) == get(&p.contact, &field[i]));
    for (int i = 0; i < nstage; i++) CHECK(get(&back->schedule.first, &stage[i]) == get(&p.schedule.first, &stage[i]));
    for (int i = 0; i < nstage; i++) CHECK(get(&back->schedule.last, &stage[i]) == get(&p.schedule.last, &stage[i]));
    cav_problem_free(back);
    remove(file);
  }
  cav_model_free(m);
  remove(path);
  rmdir(folder);
}

/// A solve refuses stages outside their table, by name.
static void test_schedule(void) {
  cav_model *m = scene_load(scene_joints);
  if (!CHECK(m != NULL)) return;
  int n;
  const cav_field *field = cav_stage_fields(&n);
  cav_problem p = cav_problem_default(m);
  double *v = scene_vector(m->nv), *q = scene_vector(m->nq);
  memcpy(q, m->q0, (size_t)m->nq * sizeof *q);
  p.q_start = p.q_goal = q;
  p.v_start = v;
  for (int i = 0; i < n; i++) {
    double bad[4];
    for (int k = outside(&field[i], bad) - 1; k >= 0; k--) {
      cav_problem broken = p;
      cav_solution *solution = NULL;
      cav_error error = {0};
      set(k % 2 ? &broken.schedule.first : &broken.schedule.last, &field[i], bad[k]);
      CHECK(cav_solve(&broken, NULL, NULL, &solution, &error) == CAV_BAD_INPUT && !solution);
      CHECK(strstr(error.text, field[i].name) != NULL);
    }
  }
  cav_model_free(m);
  free(v), free(q);
}

int main(void) {
  test_tables();
  test_refused();
  test_same();
  test_file();
  test_schedule();
  return check_result();
}
