/// Rows of a knot: k equal costs of weight w are one of weight k w, for every cost of contacts and of efforts, k from 1
/// to 40, with windows, bodies and norms, with a fixed and a free step, over a horizon and around a cycle; problem
/// files that repeat costs or mix windows are solved as any other. Most of its worth is under a sanitizer: the rows of
/// repeated costs once left the space that was counted for them. And the units of forces from nowhere. Seen: merits,
/// gradients and Hessians equal to 1.2e-14 of their largest, what the step does to 2e-10 (bounds 1e-13 and 1e-7: a
/// difference of residuals over two millionths of a step).
#include "readings.h"

#include "scene.h"

/// A body on four feet of which two overlap at first, an unactuated joint, and an actuator over two joints.
static const char beast[] =
    "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/>"
    "<body name='trunk' pos='0 0 .29'><freejoint name='root'/><geom type='sphere' size='.1' mass='3'/>"
    "<body name='left' pos='.1 0 -.05'><joint name='hip' axis='0 1 0' limited='true' range='-30 30'/>"
    "<geom type='capsule' size='.03' fromto='0 0 0 .02 .02 -.22' mass='.5'/>"
    "<body name='foot' pos='0 0 -.2'><joint name='ankle' axis='0 1 0'/>"
    "<geom type='capsule' size='.03' fromto='-.05 0 -.01 .1 0 -.01' mass='.2'/></body></body>"
    "<body name='right' pos='.1 .05 -.05'><joint name='hip2' axis='0 1 0'/>"
    "<geom type='capsule' size='.03' fromto='0 0 0 0 0 -.22' mass='.5'/></body>"
    "<body name='tail' pos='-.1 0 0'><joint name='tail' type='ball'/>"
    "<geom type='capsule' size='.03' fromto='0 0 0 -.1 0 -.27' mass='.4'/></body></body></worldbody>"
    "<tendon><fixed name='string'><joint joint='hip' coef='.5'/><joint joint='ankle' coef='.5'/></fixed></tendon>"
    "<actuator><motor joint='hip' gear='20' ctrllimited='true' ctrlrange='-1 1'/>"
    "<motor tendon='string' gear='5' ctrllimited='true' ctrlrange='-.5 1'/></actuator></mujoco>";

enum { COPIES = 40, KINDS = 7, TERMS = KINDS * COPIES };
static const cav_quantity kinds[KINDS] = {
    CAV_QUANTITY_GAP,    CAV_QUANTITY_SLIP,      CAV_QUANTITY_IMPACT, CAV_QUANTITY_FORCE, CAV_QUANTITY_SELF_PENETRATION,
    CAV_QUANTITY_EFFORT, CAV_QUANTITY_SELF_FORCE};

/// Which windows, bodies and norms the costs have, and how the motion is closed.
typedef struct scene_case {
  int windowed, body, absolute, free_step, cycle;
} scene_case;

/// Terms of every kind: copies of each of weight w, or one each of weight copies*w.
static int fill(const cav_model *m, const scene_case *c, int copies, int joined, cav_term *term) {
  int n = 0;
  for (int k = 0; k < KINDS; k++) {
    for (int i = 0; i < (joined ? 1 : copies); i++) {
      cav_term *t = &term[n++];
      *t =
          (cav_term){.name = "copy", .quantity = kinds[k], .use = CAV_USE_COST, .component = -1, .joint = -1, .to = -1};
      t->weight = (0.5 + 0.25 * k) * (joined ? copies : 1);
      t->scale = 0.7;
      t->norm = c->absolute ? CAV_NORM_ABSOLUTE : CAV_NORM_SQUARE;
      if (c->windowed) t->from = 0.025 * (k % 3), t->to = k == 1 ? t->from : 0.05 + 0.025 * (k % 2);
      if (c->body && kinds[k] != CAV_QUANTITY_EFFORT) t->body = cav_object_find(m, CAV_OBJECT_BODY, "foot");
    }
  }
  return n;
}

/// A transcription of terms under a soft law, by which many contacts bear.
static cav_transcription *transcribe(cav_problem *p) {
  cav_transcription *tr = cav_transcription_new(p, 1, NULL);
  if (!CHECK(tr != NULL)) return NULL;
  tr->options.stabilisation = CAV_STABILISATION_DISCRETE;
  tr->options.softness = 0.5;
  tr->options.smoothing = tr->options.smoothing_self = 0.03;
  return tr;
}

/// A trajectory near the start, with some of all velocities.
static cav_trajectory *wander(const cav_model *m, const cav_transcription *tr) {
  cav_trajectory *at = cav_trajectory_new(m, tr->nknot, tr->problem->timestep);
  double step[64], *x = scene_vector(cav_transcription_unknowns(tr));
  memcpy(at->q, m->q0, (size_t)m->nq * sizeof(double));
  for (int t = 1; t < at->nknot; t++) {
    scene_normals(step, m->nv, 0.005);
    cav_integrate(m, at->q + (t - 1) * at->nq, step, 1, at->q + t * at->nq);
  }
  cav_trajectory_velocities(m, at);
  cav_trajectory *from = cav_trajectory_copy(at);
  cav_transcription_move(tr, from, x, at);
  cav_trajectory_free(from);
  free(x);
  return at;
}

/// Largest difference of two arrays over the largest entry of the second.
static double apart(const double *a, const double *b, size_t n) {
  double worst = 0, largest = 1e-300;
  for (size_t i = 0; i < n; i++) worst = fmax(worst, fabs(a[i] - b[i])), largest = fmax(largest, fabs(b[i]));
  return worst / largest;
}

static double worst_seen, worst_step_seen;

static void compare(const cav_transcription *many, const cav_transcription *one) {
  size_t n = 3 * (size_t)one->nv;
  double worst = 0, step = 0;
  for (int t = 0; t < one->nknot; t++) {
    const cav_knot *a = &many->knot[t], *b = &one->knot[t];
    worst = fmax(worst, apart(&a->merit, &b->merit, 1));
    worst = fmax(worst, apart(a->gradient, b->gradient, n));
    worst = fmax(worst, apart(a->hessian, b->hessian, n * n));
    if (!one->free_step) continue;
    step = fmax(step, apart(a->step_row, b->step_row, n));
    step = fmax(step, apart(&a->step_derivative, &b->step_derivative, 1));
    step = fmax(step, apart(&a->step_square, &b->step_square, 1));
  }
  worst_seen = fmax(worst_seen, worst);
  worst_step_seen = fmax(worst_step_seen, step);
  CHECK_NEAR(worst, 0, 1e-13);
  CHECK_NEAR(step, 0, 1e-7);
}

static void test_copies(const scene_case *c) {
  static cav_term many[TERMS], joined[KINDS];
  cav_model *m = scene_load(beast);
  if (!CHECK(m != NULL)) return;
  double v_start[64] = {0};
  cav_problem p = cav_problem_default(m);
  p.duration = 0.1;
  p.close_at_rest = !c->cycle;
  p.cycle.on = c->cycle;
  double q0[64];
  memcpy(q0, m->q0, (size_t)m->nq * sizeof(double));
  p.q_start = p.q_goal = q0, p.v_start = v_start;
  if (c->free_step) p.duration_least = 0.05, p.duration_most = 0.2;
  for (int copies = 1; copies <= COPIES; copies += copies < 4 ? 1 : 12) {
    cav_problem p_one = p, p_many = p;
    p_one.term = joined, p_one.nterm = fill(m, c, copies, 1, joined);
    p_many.term = many, p_many.nterm = fill(m, c, copies, 0, many);
    cav_transcription *one = transcribe(&p_one);
    cav_transcription *two = transcribe(&p_many);
    if (!one || !two) return;
    cav_trajectory *at = wander(m, one);
    CHECK(cav_transcription_linearise(one, at) == CAV_OK);
    CHECK(cav_transcription_values(two, at) == CAV_OK && cav_transcription_linearise(two, at) == CAV_OK);
    compare(two, one);
    // a control: there are contacts of both kinds, and what is compared is not zero
    int self = 0, external = 0;
    for (int i = 0; i < one->knot[1].ncontact; i++) self += one->knot[1].moving[i], external += !one->knot[1].moving[i];
    CHECK(self > 0 && external > 1 && one->knot[1].merit > 0);
    cav_trajectory_free(at);
    cav_transcription_free(one);
    cav_transcription_free(two);
  }
  cav_model_free(m);
}

/// Forces between links of one tree as a knot reads them, y, at a motion with one coordinate moved; NULL: none is told.
static int self_force(cav_transcription *tr, const cav_trajectory *at, int t, int knot, int dof, double by, double *y) {
  cav_trajectory *moved = cav_trajectory_copy(at);
  double step[64] = {0};
  step[dof] = by;
  cav_integrate(tr->model, at->q + knot * at->nq, step, 1, moved->q + knot * at->nq);
  cav_trajectory_velocities(tr->model, moved);
  CHECK(cav_transcription_values(tr, moved) == CAV_OK);
  const cav_knot *k = &tr->knot[t];
  int n = 0;
  for (int c = 0; c < k->ncontact; c++)
    if (k->moving[c]) y[n++] = k->y[CAV_CONTACT_READINGS * c + 4];
  cav_trajectory_free(moved);
  return n;
}

/// What it costs to lean on one's own links: derivatives against differences, where some bear and some only come near.
static void test_self_force(void) {
  enum { T = 2, MOST = 64 };
  cav_model *m = scene_load(beast);
  if (!CHECK(m != NULL)) return;
  double q0[64], zero[64] = {0}, up[MOST], down[MOST];
  memcpy(q0, m->q0, (size_t)m->nq * sizeof(double));
  cav_problem p = cav_problem_default(m);
  cav_term term = cav_term_cost(CAV_QUANTITY_SELF_FORCE, 3);
  p.duration = 0.1;
  p.q_start = p.q_goal = q0, p.v_start = zero;
  p.term = &term, p.nterm = 1;
  cav_transcription *tr = transcribe(&p);
  if (!tr) return;
  cav_trajectory *at = wander(m, tr);
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  cav_knot *knot = &tr->knot[T];
  size_t nv = (size_t)m->nv, width = 3 * nv;
  double *dy = scene_vector((int)(MOST * width)), worst = 0, largest = 0, bears = 0;
  const double root = sqrt(p.timestep * term.weight) / term.scale;
  int n = 0, open = 0;
  for (int c = 0; c < knot->ncontact && n < MOST; c++) {
    if (!knot->moving[c]) continue;
    bears += knot->y[CAV_CONTACT_READINGS * c + 4];
    open += knot->y[CAV_CONTACT_READINGS * c] == 0;
    // the rows of the only cost stand first
    for (size_t k = 0; k < width; k++) dy[width * (size_t)n + k] = knot->dense[width * (size_t)n + k] / root;
    n++;
  }
  // of those that touch and those whose force is there before
  CHECK(n > 1 && open > 0 && open < n && bears > 0.01);
  for (int b = 0; b < 3; b++)
    for (int d = 0; d < m->nv; d++) {
      const double e = 1e-6;
      if (!CHECK(self_force(tr, at, T, T - 1 + b, d, e, up) == n)) continue;
      if (!CHECK(self_force(tr, at, T, T - 1 + b, d, -e, down) == n)) continue;
      for (int i = 0; i < n; i++) {
        double analytic = dy[width * (size_t)i + (size_t)b * nv + (size_t)d];
        largest = fmax(largest, fabs(analytic));
        worst = fmax(worst, fabs(analytic - (up[i] - down[i]) / (2 * e)));
      }
    }
  printf("%d contacts between links bear %.3g of the weight, derivatives off by %.1e of the largest\n", n, bears,
         worst / largest);
  CHECK(largest > 0 && worst < 1e-6 * largest);
  free(dy);
  cav_trajectory_free(at), cav_transcription_free(tr), cav_model_free(m);
}

/// The squat-jump's file with more costs: read, and linearised at its start.
static void test_file(const char *costs) {
  char path[4200], model[4200], at_path[] = "/tmp/cavort-test-XXXXXX";
  snprintf(path, sizeof path, "%.4000s/problems/motions/squat-jump/problem.xml", CAVORT_SOURCE_ROOT);
  snprintf(model, sizeof model, "%.4000s/problems/models/humanoid.xml", CAVORT_SOURCE_ROOT);
  static char text[10000], more[12000];
  FILE *in = fopen(path, "r");
  size_t n = in ? fread(text, 1, sizeof text - 1, in) : 0;
  if (in) fclose(in);
  text[n] = 0;
  char *end = strstr(text, "</cost>");
  int file = mkstemp(at_path);
  if (!CHECK(end && file >= 0)) return;
  int length = snprintf(more, sizeof more, "%.*s%s%s", (int)(end - text), text, costs, end);
  CHECK(write(file, more, (size_t)length) == length);
  close(file);
  cav_error error = {0};
  cav_problem *p = cav_problem_load(at_path, model, &error);
  unlink(at_path);
  if (!CHECK(p != NULL)) fprintf(stderr, "    %s\n", error.text);
  if (!p) return;
  cav_transcription *tr = transcribe(p);
  if (!tr) return;
  cav_trajectory *at = cav_trajectory_new(p->model, tr->nknot, p->timestep);
  for (int t = 0; t < at->nknot; t++) memcpy(at->q + t * at->nq, p->q_start, (size_t)at->nq * sizeof(double));
  cav_trajectory_velocities(p->model, at);
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  cav_trajectory_free(at);
  cav_transcription_free(tr);
  cav_problem_free(p);
}

/// A cylinder and a box on a floor and a box on that: several points a pair.
static const char heap[] =
    "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/>"
    "<body pos='0 0 .12'><freejoint/><geom type='cylinder' size='.1 .1' euler='170 8 20'/></body>"
    "<body pos='.5 0 .1'><freejoint/><geom type='box' size='.1 .1 .1' euler='2 1 30'/></body>"
    "<body pos='.5 0 .3'><freejoint/><geom type='box' size='.08 .09 .1' euler='3 -2 75'/></body></worldbody></mujoco>";

/// Every point of a pair is read: the forces that a knot reads are those of the contacts of its state, in whose order
/// it walks.
static void test_every_point_is_read(void) {
  cav_model *m = scene_load(heap);
  if (!CHECK(m != NULL)) return;
  double q0[64], zero[64] = {0};
  memcpy(q0, m->q0, (size_t)m->nq * sizeof(double));
  cav_problem p = cav_problem_default(m);
  p.duration = 0.1;
  p.q_start = p.q_goal = q0, p.v_start = zero;
  cav_transcription *tr = transcribe(&p);
  cav_trajectory *at = cav_trajectory_new(m, tr->nknot, p.timestep);
  cav_state *state = cav_state_new(m);
  for (int t = 0; t < at->nknot; t++) memcpy(at->q + t * at->nq, q0, (size_t)at->nq * sizeof(double));
  cav_trajectory_velocities(m, at);
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  state->options = tr->options;
  double *u = scene_vector(m->nv);
  CHECK(cav_inverse(m, state, q0, zero, zero, u) == CAV_OK);
  const cav_knot *knot = &tr->knot[1];
  double read = 0, borne = 0;
  int several = 0;
  for (int k = 0; k < knot->ncontact; k++) read += knot->y[CAV_CONTACT_READINGS * k + 4];
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    borne += c->impulse[0] / (tr->options.timestep * tr->weight);
    // several points of some pairs, in the order of pairs and features
    if (i > 0) CHECK(c->pair > c[-1].pair || (c->pair == c[-1].pair && c->feature > c[-1].feature));
    several += i > 0 && c->pair == c[-1].pair;
  }
  printf("%d contacts, which bear %.6f of the weight; %.6f is read\n", state->ncontact, borne, read);
  CHECK(several > 3 && borne > 0.1);
  // contacts that push with less than a millionth of the weight are not read
  CHECK_NEAR(read, borne, 1e-6 * state->ncontact);
  free(u);
  cav_state_free(state);
  cav_trajectory_free(at);
  cav_transcription_free(tr);
  cav_model_free(m);
}

/// Forces from nowhere on what no actuator moves: what turns on a hinge in the torque of 2 rad/s^2, here of a rod 0.4 m
/// long about its end beside a body that floats; a light body in its own weight; what is driven in the scene's.
static void test_units(void) {
  cav_model *m = scene_load(
      "<mujoco><worldbody><body pos='0 0 1'><freejoint/><geom type='box' size='.1 .1 .1' mass='50'/>"
      "<body><joint name='arm'/><geom type='box' size='.1 .1 .1' mass='5'/></body></body>"
      "<body pos='3 0 1'><joint name='lid' axis='0 0 1' armature='.5'/><geom type='box' size='.2 .001 .01' pos='.2 0 "
      "0' mass='3'/></body>"
      "<body pos='5 0 1'><freejoint name='ball'/><geom size='.1' mass='2'/></body></worldbody>"
      "<actuator><motor joint='arm'/></actuator></mujoco>");
  if (!CHECK(m != NULL)) return;
  const int arm = cav_object_find(m, CAV_OBJECT_JOINT, "arm"), lid = cav_object_find(m, CAV_OBJECT_JOINT, "lid"),
            ball = cav_object_find(m, CAV_OBJECT_JOINT, "ball");
  CHECK(cav_force_fraction(m, m->joint[arm].dof) == 1);
  CHECK_NEAR(cav_force_fraction(m, m->joint[lid].dof) * CAV_MOMENT_ARM * 60 * 9.81,
             2 * (0.5 + 3 * (0.4 * 0.4 + 0.002 * 0.002) / 12 + 3 * 0.04), 1e-9);
  CHECK_NEAR(cav_force_fraction(m, m->joint[ball].dof), 2. / 60, 1e-15);
  cav_model_free(m);
}

int main(void) {
  test_self_force();
  test_units();
  test_every_point_is_read();
  test_file("<slip from='0' to='end' weight='1'/><slip from='0' to='end' weight='1'/>");
  test_file("<force from='0.1' to='0.5' weight='1'/><slip from='0.1' to='0.7' weight='1'/>");
  static const scene_case cases[] = {{0},
                                     {.windowed = 1},
                                     {.body = 1},
                                     {.windowed = 1, .body = 1},
                                     {.absolute = 1},
                                     {.free_step = 1},
                                     {.free_step = 1, .windowed = 1, .absolute = 1},
                                     {.cycle = 1},
                                     {.cycle = 1, .free_step = 1}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) test_copies(&cases[i]);
  printf("sums differ by %.2g of their largest, the step's by %.2g\n", worst_seen, worst_step_seen);
  return check_result();
}
