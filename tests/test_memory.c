/// Memory: hot functions allocate nothing after their first call; what a scene does not have takes no byte; and where
/// the n-th allocation fails, for every n, loading, states, inverse, forward and solving say CAV_NO_MEMORY, leave
/// nothing behind and work the next time, to the same bits. The allocator is counted by taking its place (glibc);
/// skipped under sanitizers, which take it themselves.
#include <errno.h>
#include <malloc.h>

#include "cavort/mpc.h"
#include "scene.h"
#include "step.h"

#if !defined(SANITIZED) && !defined(__GLIBC__)
#define SANITIZED 1
#endif

#ifdef SANITIZED
int main(void) {
  printf("skipped: a sanitizer or another C library owns malloc\n");
  return CHECK_SKIPPED;
}
#else

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t n, size_t size);
void *__libc_realloc(void *at, size_t size);
void *__libc_memalign(size_t alignment, size_t size);
void __libc_free(void *at);

static long calls;     // allocations so far
static long live;      // pieces not yet freed
static long left = -1; // allocations before the one that fails; negative: none does

// sizes asked for, of the pieces made while a ledger is kept
enum { LEDGER = 256 };
static struct {
  void *at;
  size_t size;
} ledger[LEDGER];
static int entries, keeps_ledger;

static void note_piece(void *at, size_t size) {
  if (!at || !keeps_ledger) return;
  if (entries == LEDGER) abort();
  ledger[entries].at = at;
  ledger[entries++].size = size;
}

static void strike_piece(const void *at) {
  for (int i = 0; i < entries; i++)
    if (ledger[i].at == at) ledger[i--] = ledger[--entries];
}

static size_t ledger_bytes(void) {
  size_t sum = 0;
  for (int i = 0; i < entries; i++) sum += ledger[i].size;
  return sum;
}

static int fails(void) {
  calls++;
  if (left < 0 || left-- > 0) return 0;
  errno = ENOMEM;
  return 1;
}

static void *counted(void *piece, size_t size) {
  live += piece != NULL;
  note_piece(piece, size);
  return piece;
}

void *malloc(size_t size) { return fails() ? NULL : counted(__libc_malloc(size), size); }
void *calloc(size_t n, size_t size) { return fails() ? NULL : counted(__libc_calloc(n, size), n * size); }
void *aligned_alloc(size_t alignment, size_t size) {
  return fails() ? NULL : counted(__libc_memalign(alignment, size), size);
}
void *realloc(void *at, size_t size) {
  if (!at) return malloc(size);
  if (fails()) return NULL;
  void *moved = __libc_realloc(at, size);
  if (!moved) return NULL;
  strike_piece(at);
  note_piece(moved, size);
  return moved;
}
void free(void *at) {
  live -= at != NULL;
  strike_piece(at);
  __libc_free(at);
}

static const char humanoid[] = CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml";
static const char features[] = CAVORT_SOURCE_ROOT "/tests/features.xml";
static const char sensors[] = CAVORT_SOURCE_ROOT "/tests/sensors.xml";

// --- nothing is allocated after the first call ---

enum { POSES = 20 };

/// One model and random points at which everything is called.
typedef struct bed {
  cav_model *model;
  cav_state *state;
  double *q, *v, *v_next, *u, *scratch, *J, *reading;
} bed;

static void bed_new(bed *b, const char *path) {
  cav_error error = {0};
  *b = (bed){.model = cav_model_load(path, &error)};
  if (!CHECK(b->model != NULL)) return;
  const cav_model *m = b->model;
  b->state = cav_state_new(m);
  b->q = scene_vector(m->nq * POSES), b->v = scene_vector(m->nv * POSES), b->v_next = scene_vector(m->nv * POSES);
  b->u = scene_vector(m->nv), b->scratch = scene_vector(m->nv + m->nu), b->J = scene_vector(3 * m->nv * m->nv);
  b->reading = scene_vector(m->nsensordata);
  for (int k = 0; k < POSES; k++) {
    scene_posture(m, b->q + k * m->nq, b->scratch, 0.3);
    // about the floor, so that contacts come and go
    if (m->joint[0].type == CAV_JOINT_FREE) b->q[k * m->nq + 2] *= 0.5 + 0.3 * scene_uniform();
    scene_normals(b->v + k * m->nv, m->nv, 0.3);
    scene_normals(b->v_next + k * m->nv, m->nv, 0.3);
  }
}

static void bed_free(bed *b) {
  cav_state_free(b->state);
  cav_model_free(b->model);
  free(b->q), free(b->v), free(b->v_next), free(b->u), free(b->scratch), free(b->J), free(b->reading);
}

static void call_inverse(bed *b, const double *q, const double *v, const double *x) {
  CHECK(cav_inverse(b->model, b->state, q, v, x, b->u) == CAV_OK);
  CHECK(cav_inverse_from(b->model, b->state, CAV_STAGE_POSITION, q, v, x, b->u) == CAV_OK);
}

static void call_forward(bed *b, const double *q, const double *v, const double *x) {
  (void)x;
  memset(b->u, 0, (size_t)b->model->nv * sizeof *b->u);
  cav_status status = cav_forward(b->model, b->state, q, v, b->u, b->scratch);
  CHECK(status == CAV_OK || status == CAV_NOT_CONVERGED);
}

static void call_gpgs(bed *b, const double *q, const double *v, const double *x) {
  (void)x;
  memset(b->u, 0, (size_t)b->model->nv * sizeof *b->u);
  cav_status status = cav_forward_gpgs(b->model, b->state, q, v, b->u, 20, 1e-9, b->scratch, NULL);
  CHECK(status == CAV_OK || status == CAV_NOT_CONVERGED);
}

static void call_jacobian(bed *b, const double *q, const double *v, const double *x) {
  size_t n = (size_t)b->model->nv * b->model->nv;
  CHECK(cav_inverse_jacobian(b->model, b->state, q, v, x, b->J, b->J + n, b->J + 2 * n) == CAV_OK);
}

// analytic, where they are offered for the model and the point
static void call_analytic(bed *b, const double *q, const double *v, const double *x) {
  size_t n = (size_t)b->model->nv * b->model->nv;
  cav_status status =
      cav_inverse_jacobian_by(b->model, b->state, CAV_DERIVATIVE_ANALYTIC, q, v, x, b->J, b->J + n, b->J + 2 * n);
  CHECK(status == CAV_OK || status == CAV_NOT_SUPPORTED);
}

static void call_momentum(bed *b, const double *q, const double *v, const double *x) {
  b->state->options.order = CAV_ORDER_MOMENTUM;
  call_inverse(b, q, v, x);
  call_forward(b, q, v, x);
  call_analytic(b, q, v, x);
  b->state->options.order = CAV_ORDER_EULER;
}

static void call_readings(bed *b, const double *q, const double *v, const double *x) {
  const cav_model *m = b->model;
  double com[3], speed[3], spin[3];
  cav_pose pose;
  CHECK(cav_inverse(m, b->state, q, v, x, b->u) == CAV_OK);
  for (int i = 0; i < m->nsensor; i++) cav_sensor_read(m, b->state, &m->sensor[i], b->reading + m->sensor[i].adr);
  for (int i = 0; i < m->nbody; i++) cav_object_pose(m, b->state, CAV_OBJECT_BODY, i, &pose);
  cav_momentum(m, b->state, v, com, speed, spin);
  cav_actuation(m, b->state, b->u, b->scratch, b->scratch + m->nv);
  CHECK(cav_inertia(m, b->state, q, b->J) == CAV_OK);
}

static const struct {
  const char *name;
  void (*call)(bed *, const double *, const double *, const double *);
} hot[] = {{"inverse", call_inverse},   {"forward", call_forward},   {"gpgs", call_gpgs},
           {"jacobian", call_jacobian}, {"analytic", call_analytic}, {"momentum", call_momentum},
           {"readings", call_readings}};

// all points once to make room, then again with the count held
static void test_hot(const char *path) {
  bed b;
  bed_new(&b, path);
  int nq = b.model ? b.model->nq : 0, nv = b.model ? b.model->nv : 0;
  for (size_t f = 0; b.model && f < sizeof hot / sizeof *hot; f++) {
    for (int smooth = 0; smooth < (f == 2 ? 1 : 2); smooth++) {
      b.state->options.smoothing = smooth ? 0.01 : 0;
      b.state->options.stabilisation = smooth ? CAV_STABILISATION_DISCRETE : CAV_STABILISATION_SOLREF;
      long before = 0, first = calls;
      for (int k = 0; k < 2 * POSES; k++) {
        if (k == POSES) before = calls;
        int i = k % POSES;
        hot[f].call(&b, b.q + i * nq, b.v + i * nv, b.v_next + i * nv);
      }
      printf("%-9s %s law: %ld allocations at first, %ld again\n", hot[f].name, smooth ? "smoothed" : "exact   ",
             before - first, calls - before);
      CHECK(calls == before);
    }
  }
  bed_free(&b);
}

// --- a state tells of all its memory ---

static size_t told_bytes(const cav_state *state) {
  size_t bytes[CAV_MEMORY_USES], sum = 0;
  cav_state_bytes(state, bytes);
  for (int k = 0; k < CAV_MEMORY_USES; k++) sum += bytes[k];
  return sum;
}

// with contacts and rows felt from afar, so that there are many
static void call_coupled(bed *b, const double *q, const double *v, const double *x) {
  b->state->options.regulariser = CAV_REGULARISER_EXACT;
  b->state->options.coupled = 1;
  call_inverse(b, q, v, x);
  call_forward(b, q, v, x);
}

/// The bytes that a state tells of are those it asked for: fresh, and after each of the functions that make room.
static void test_account(const char *path) {
  bed b;
  bed_new(&b, path);
  if (!b.model) return;
  printf("%s: %d pairs\n", path, b.model->npair);
  entries = 0, keeps_ledger = 1;
  cav_state *state = cav_state_new(b.model);
  CHECK(told_bytes(state) == ledger_bytes());
  cav_state *own = b.state;
  b.state = state;
  for (size_t f = 0; f <= sizeof hot / sizeof *hot; f++) {
    int last = f == sizeof hot / sizeof *hot;
    size_t before = ledger_bytes();
    for (int k = 0; k < POSES; k++)
      (last ? call_coupled : hot[f].call)(&b, b.q + k * b.model->nq, b.v + k * b.model->nv, b.v_next + k * b.model->nv);
    printf("%-9s %zu bytes more, %zu in all, %zu told\n", last ? "coupled" : hot[f].name, ledger_bytes() - before,
           ledger_bytes(), told_bytes(state));
    CHECK(told_bytes(state) == ledger_bytes());
  }
  // a control: derivatives have made room
  CHECK(ledger_bytes() > 10000);
  cav_state_free(state);
  CHECK(entries == 0);
  keeps_ledger = 0;
  b.state = own;
  bed_free(&b);
}

// so many pairs that a sweep prunes them
static void test_account_of_many(void) {
  static char text[16000] = "<mujoco><worldbody>", path[] = "/tmp/cavort-test-XXXXXX";
  for (int i = 0; i < 50; i++)
    snprintf(text + strlen(text), sizeof text - strlen(text),
             "<body pos='%g %g 0'><joint axis='0 1 0'/><geom size='.1' pos='.2 0 0'/></body>", 0.21 * (i % 7),
             0.21 * (i / 7));
  snprintf(text + strlen(text), sizeof text - strlen(text), "</worldbody></mujoco>");
  int file = mkstemp(path);
  if (!CHECK(file >= 0 && write(file, text, strlen(text)) == (ssize_t)strlen(text))) return;
  close(file);
  test_account(path);
  unlink(path);
}

// --- what a scene does not have holds no memory ---

static const char bare_text[] =
    "<mujoco><worldbody><body><joint axis='0 1 0'/><geom type='capsule' size='.03' fromto='0 0 0 .3 0 0'/>"
    "<body pos='.3 0 0'><joint axis='0 1 0'/><geom type='capsule' size='.03' fromto='0 0 0 .3 0 0'/></body></body>"
    "</worldbody></mujoco>";

static void test_absent(void) {
  cav_error error = {0};
  cav_model *bare = scene_load(bare_text), *full = cav_model_load(sensors, &error);
  if (!CHECK(bare && full)) return;
  size_t none[CAV_MEMORY_USES], some[CAV_MEMORY_USES];
  cav_state *a = cav_state_new(bare), *b = cav_state_new(full);
  cav_state_bytes(a, none);
  cav_state_bytes(b, some);
  static const cav_memory_use parts[] = {CAV_MEMORY_TENDONS,  CAV_MEMORY_EQUALITY,  CAV_MEMORY_ROWS,
                                         CAV_MEMORY_CONTACTS, CAV_MEMORY_ACTUATION, CAV_MEMORY_SOLVERS};
  for (int i = 0; i < 6; i++) {
    CHECK(none[parts[i]] == 0);
    // the control: where there are some they are counted
    CHECK(some[parts[i]] > 0 || parts[i] == CAV_MEMORY_SOLVERS);
  }
  cav_state_free(a), cav_state_free(b);
  cav_model_free(bare), cav_model_free(full);
}

// --- the n-th allocation fails ---

/// Something that may run out of memory: returns its status and writes up to 8 numbers that tell its result.
typedef cav_status (*attempt)(void *context, double *result);

// every n until it succeeds; excused: failures after which a library we use keeps its own
static void fail_each(const char *name, attempt try, void *context, long most, long excused) {
  double whole[8] = {0}, result[8];
  CHECK(try(context, whole) == CAV_OK);
  long n = 0, wrong = 0, lost = 0;
  for (; n < most; n++) {
    long before = live;
    memset(result, 0, sizeof result);
    left = n;
    cav_status status = try(context, result);
    int reached = left < 0;
    left = -1;
    lost += live != before;
    if (status == CAV_OK) {
      // one that a library does without is no failure of ours, but the result stays
      CHECK(!memcmp(whole, result, sizeof result));
      if (!reached) break;
    } else {
      wrong += status != CAV_NO_MEMORY;
    }
  }
  printf("%-9s %ld allocations, each failed once: %ld with another status, %ld left something behind\n", name, n, wrong,
         lost);
  CHECK(n > 0 && n < most && wrong == 0 && lost <= excused);
}

static cav_status try_load(void *context, double *result) {
  cav_error error = {0};
  cav_model *model = cav_model_load(context, &error);
  if (model) result[0] = model->mass, result[1] = model->nv;
  cav_model_free(model);
  return model ? CAV_OK : error.status;
}

static cav_status try_state(void *context, double *result) {
  const bed *b = context;
  cav_state *state = cav_state_new(b->model);
  result[0] = state != NULL;
  cav_state_free(state);
  return state ? CAV_OK : CAV_NO_MEMORY;
}

// one evaluation by a state that has never been used; it fails cleanly and then works
static cav_status with_state(bed *b, cav_status (*evaluate)(bed *, cav_state *), double *result) {
  long kept = left;
  left = -1;
  cav_state *state = cav_state_new(b->model);
  left = kept;
  cav_status status = evaluate(b, state);
  long rest = left;
  if (status == CAV_NO_MEMORY) {
    left = -1;
    CHECK(evaluate(b, state) == CAV_OK);
    left = rest;
  }
  cav_state_free(state);
  memcpy(result, b->scratch, 6 * sizeof *result);
  return status;
}

static cav_status inverse(bed *b, cav_state *state) {
  return cav_inverse(b->model, state, b->q, b->v, b->v_next, b->scratch);
}

static cav_status momentum(bed *b, cav_state *state) {
  state->options.order = CAV_ORDER_MOMENTUM;
  return cav_inverse(b->model, state, b->q, b->v, b->v_next, b->scratch);
}

static cav_status forward(bed *b, cav_state *state) {
  return cav_forward(b->model, state, b->q, b->v, b->u, b->scratch);
}

static cav_status gpgs(bed *b, cav_state *state) {
  // how far it gets is not the question
  cav_status status = cav_forward_gpgs(b->model, state, b->q, b->v, b->u, 100, 1e-6, b->scratch, NULL);
  return status == CAV_NOT_CONVERGED ? CAV_OK : status;
}

static cav_status jacobian(bed *b, cav_state *state) {
  size_t n = (size_t)b->model->nv * b->model->nv;
  return cav_inverse_jacobian(b->model, state, b->q, b->v, b->v_next, b->J, b->J + n, b->J + 2 * n);
}

static cav_status try_inverse(void *context, double *result) { return with_state(context, inverse, result); }
static cav_status try_momentum(void *context, double *result) { return with_state(context, momentum, result); }
static cav_status try_forward(void *context, double *result) { return with_state(context, forward, result); }
static cav_status try_gpgs(void *context, double *result) { return with_state(context, gpgs, result); }
static cav_status try_jacobian(void *context, double *result) { return with_state(context, jacobian, result); }

static void test_states(void) {
  bed b;
  bed_new(&b, humanoid);
  if (!b.model) return;
  // lying in the floor: more contacts than a new state has room for
  b.q[2] = 0.05;
  fail_each("state", try_state, &b, 100, 0);
  fail_each("inverse", try_inverse, &b, 100, 0);
  fail_each("momentum", try_momentum, &b, 100, 0);
  memset(b.u, 0, (size_t)b.model->nv * sizeof *b.u);
  fail_each("forward", try_forward, &b, 100, 0);
  fail_each("gpgs", try_gpgs, &b, 100, 0);
  fail_each("jacobian", try_jacobian, &b, 100, 0);
  bed_free(&b);
}

// --- problems ---

static const char leg_text[] =
    "<mujoco model='leg'><option timestep='.02'/><worldbody><geom name='floor' type='plane' size='1 1 1'/>"
    "<body name='trunk' pos='0 0 .45'><joint name='x' type='slide' axis='1 0 0'/><joint name='z' type='slide' axis='0 "
    "0 1'/><joint name='pitch' axis='0 1 0'/><geom type='box' size='.1 .1 .05'/><body name='shin'><joint name='knee' "
    "axis='0 1 0' limited='true' range='-90 90'/><geom type='capsule' fromto='0 0 0 0 0 -.4' size='.05'/></body></body>"
    "</worldbody><actuator><motor name='knee' joint='knee' ctrllimited='true' ctrlrange='-50 50'/></actuator></mujoco>";

static const char fall_text[] =
    "<problem name='fall' model='leg.xml'><horizon duration='.2' timestep='.04' close='open'/><start/><schedule "
    "stages='2'><first iterations='3'/><last iterations='3'/></schedule><constraint><sensor name='push' "
    "type='jointpos' "
    "joint='knee' upper='.5'/></constraint></problem>";

static char folder[] = "/tmp/cavort-memory-XXXXXX", problem_path[64], model_path[64];

static void write_text(const char *path, const char *text) {
  FILE *file = fopen(path, "w");
  if (!CHECK(file != NULL)) return;
  fputs(text, file);
  fclose(file);
}

static cav_status try_problem(void *context, double *result) {
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(context, NULL, &error);
  if (problem) result[0] = problem->nterm;
  cav_problem_free(problem);
  return problem ? CAV_OK : error.status;
}

static cav_status try_solve(void *context, double *result) {
  cav_error error = {0};
  cav_solution *solution = NULL;
  cav_solve_options options = cav_solve_options_default();
  cav_status status = cav_solve(context, &options, NULL, &solution, &error);
  // too short a schedule to converge: what counts is that it ran
  if (status == CAV_NOT_CONVERGED) status = CAV_OK;
  if (status == CAV_OK) result[0] = solution->cost, result[1] = solution->iterations;
  if (status != CAV_OK) CHECK(error.status == status && error.text[0]);
  cav_solution_free(solution);
  return status;
}

static cav_status try_impossible(void *context, double *result) {
  cav_error error = {0};
  cav_impossibility found[4];
  int n = 0;
  cav_status status = cav_problem_impossible(context, found, 4, &n, &error);
  if (status == CAV_OK) result[0] = n;
  if (status != CAV_OK) CHECK(error.status == status && error.text[0]);
  return status;
}

static cav_status try_guess(void *context, double *result) {
  cav_error error = {0};
  cav_trajectory *guess = cav_problem_guess(context, &error);
  if (guess) result[0] = guess->nknot;
  cav_trajectory_free(guess);
  return guess ? CAV_OK : error.status;
}

static void test_problems(void) {
  if (!CHECK(mkdtemp(folder) != NULL)) return;
  snprintf(problem_path, sizeof problem_path, "%s/fall.xml", folder);
  snprintf(model_path, sizeof model_path, "%s/leg.xml", folder);
  write_text(problem_path, fall_text);
  write_text(model_path, leg_text);
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(problem_path, NULL, &error);
  if (CHECK(problem != NULL)) {
    fail_each("problem", try_problem, problem_path, 20000, 0);
    fail_each("impossible", try_impossible, problem, 20000, 0);
    fail_each("guess", try_guess, problem, 20000, 0);
    fail_each("solve", try_solve, problem, 20000, 0);
  } else {
    fprintf(stderr, "    %s\n", error.text);
  }
  cav_problem_free(problem);
  remove(problem_path), remove(model_path), remove(folder);
}

// --- what is made in code ---

/// Power of the knee, with its derivatives by what it is made of, and without.
static int power_value(void *context, const cav_knot_view *view, double *value) {
  (void)context;
  value[0] = view->u[3] * view->v_next[3];
  return 0;
}

static int power_jacobian(void *context, const cav_knot_view *view, const cav_view_jacobian *jacobian) {
  (void)context;
  jacobian->du[3] = view->v_next[3];
  jacobian->dv_next[3] = view->u[3];
  return 0;
}

static cav_status try_draft(void *context, double *result) {
  cav_error error = {0};
  cav_draft *draft = cav_draft_new("made");
  if (!draft) return CAV_NO_MEMORY;
  int body = cav_draft_add(draft, CAV_DRAFT_WORLD, "body"), geom = cav_draft_add(draft, body, "geom");
  cav_draft_add(draft, body, "freejoint");
  cav_draft_numbers(draft, geom, "size", context, 1);
  cav_draft_text(draft, geom, "name", "ball");
  cav_model *model = cav_draft_compile(draft, NULL, NULL, &error);
  if (model) result[0] = model->mass, result[1] = model->nv;
  if (!model) CHECK(error.text[0]);
  cav_model_free(model);
  cav_draft_free(draft);
  return model ? CAV_OK : error.status;
}

static cav_status try_check(void *context, double *result) {
  const cav_problem *p = context;
  cav_error error = {0};
  cav_state *state = cav_state_new(p->model);
  if (!state) return CAV_NO_MEMORY;
  cav_status status = cav_user_quantity_check(p->term[p->nterm - 1].user, state, p->q_start, p->v_start, p->v_start,
                                              result, NULL, &error);
  if (status != CAV_OK) CHECK(error.status == status && error.text[0]);
  cav_state_free(state);
  return status;
}

static cav_status try_verdict(void *context, double *result) {
  const cav_problem *p = context;
  cav_error error = {0};
  cav_verdict verdict = {0};
  cav_options law = p->model->options;
  long kept = left;
  left = -1;
  cav_trajectory *at = cav_trajectory_new(p->model, 6, p->timestep);
  left = kept;
  law.timestep = p->timestep;
  cav_status status = cav_verify(p, at, &law, NULL, NULL, &verdict, &error);
  result[0] = verdict.cost;
  cav_trajectory_free(at);
  return status;
}

static void test_made(void) {
  double size = 0.1;
  fail_each("draft", try_draft, &size, 20000, 0);
  cav_error error = {0};
  cav_model *model = cav_model_parse(leg_text, NULL, NULL, &error);
  if (!CHECK(model != NULL)) return;
  double rest[4] = {0, 0.1, 0, 0}, still[4] = {0};
  cav_user_quantity power = {"power", "W", 1, CAV_READS_ACCELERATION, power_value, power_jacobian, NULL, 0};
  cav_term term[16];
  int n = cav_problem_default_terms(term, 15);
  term[n] = cav_term_range(CAV_QUANTITY_USER, -500, 500);
  term[n].user = &power;
  cav_problem problem = cav_problem_default(model);
  problem.name = "made", problem.duration = 0.2, problem.timestep = 0.04;
  problem.q_start = problem.q_goal = rest, problem.v_start = still;
  problem.schedule.stages = 2, problem.schedule.first.iterations = problem.schedule.last.iterations = 2;
  problem.term = term, problem.nterm = n + 1;
  fail_each("check", try_check, &problem, 20000, 0);
  for (int way = 0; way < 2; way++) {
    power.jacobian = way ? NULL : power_jacobian;
    fail_each(way ? "own term" : "own term, Jacobian", try_solve, &problem, 20000, 0);
  }
  fail_each("verdict", try_verdict, &problem, 20000, 0);
  cav_model_free(model);
}

// iterations and shifts of a solver that has its memory allocate nothing
static void test_optimiser(void) {
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(CAVORT_SOURCE_ROOT "/problems/motions/kick/problem.xml", NULL, &error);
  cav_optimiser *o = problem ? cav_optimiser_new(problem, NULL, NULL, &error) : NULL;
  if (!CHECK(o != NULL)) return;
  long before = calls;
  // as soft as nothing is: what touches first makes room
  for (int i = 0; i < 8; i++) CHECK(cav_optimiser_iterate(o, 1, NULL) == CAV_OK);
  long first = calls - before;
  before = calls;
  for (int i = 0; i < 4; i++) {
    CHECK(cav_optimiser_iterate(o, 1, NULL) == CAV_OK);
    CHECK(cav_optimiser_shift(o, 0, NULL, NULL) == CAV_OK);
  }
  printf("optimiser: %ld allocations at first, %ld again\n", first, calls - before);
  CHECK(calls == before && first > 0);
  cav_optimiser_free(o);
  cav_problem_free(problem);
}

// plans and commands of a controller that has its memory allocate nothing
static void test_mpc(void) {
  enum { KNOTS = 12 };
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(CAVORT_SOURCE_ROOT "/problems/mpc/stand.xml", NULL, &error);
  cav_trajectory *guess = problem ? cav_problem_guess(problem, &error) : NULL;
  cav_mpc_options options = cav_mpc_options_default();
  options.knots = KNOTS;
  options.delay = 0.01;
  if (guess) guess->nknot = KNOTS;
  cav_mpc *mpc = guess ? cav_mpc_new(problem, &options, guess, &error) : NULL;
  if (!CHECK(mpc != NULL)) return;
  double u[64], input[64];
  const double *q = problem->q_start, *v = problem->v_start;
  CHECK(problem->model->nv <= 64 && problem->model->nu <= 64);
  long before = 0;
  for (int i = 0; i < 12; i++) {
    if (i == 6) before = calls;
    CHECK(cav_mpc_plan(mpc, 0.01 * i, q, v, NULL) == CAV_OK);
    for (int k = 0; k < 10; k++) CHECK(cav_mpc_command(mpc, 0.01 * i + 0.001 * k, q, v, input, u) == CAV_OK);
  }
  printf("controller: %ld allocations while it runs\n", calls - before);
  CHECK(calls == before);
  cav_mpc_free(mpc);
  cav_trajectory_free(guess);
  cav_problem_free(problem);
}

int main(void) {
  // what printf and the XML library keep for themselves
  printf("allocations are counted\n");
  test_hot(humanoid);
  test_hot(sensors);
  test_hot(features);
  test_account(humanoid);
  test_account(features);
  test_account(sensors);
  test_account(CAVORT_SOURCE_ROOT "/tests/fluid.xml");
  test_account_of_many();
  test_absent();
  // libxml2 2.9 loses its input buffer where that cannot grow (xmlParserInputBufferCreateMem)
  fail_each("load", try_load, (void *)humanoid, 100000, 1);
  test_states();
  test_problems();
  test_made();
  test_optimiser();
  test_mpc();
  return check_result();
}
#endif
