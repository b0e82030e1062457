/// A free start: q_0 and v_0 found with the motion. A point mass that follows noisy positions is the linear smoother: least
/// squares over its start and forces solved densely here, and with a prior on the start the smoother of Rauch, Tung and
/// Striebel, both written here. A body that flies is found from where it was seen, spinning, with its velocity at the start,
/// which nothing else tells. Ranges and targets hold at the start as at other knots; files, checkpoints, proofs before a
/// solve and certificates know it.
#include "cavort/cavort.h"
#include "normal_equations.h"
#include "scene.h"
#include "schedule.h"
#include "solvers.h"

enum { STEPS = 40, STATES = 2 };
static const double mass = 1.7, step = 0.025, of_force = 0.3, of_place = 400;

static const char cart[] =
    "<mujoco model='cart'><option gravity='0 0 0'/><worldbody><body name='cart'>"
    "<joint name='x' type='slide' axis='1 0 0'/><geom type='sphere' size='.1' mass='1.7'/></body>"
    "</worldbody><actuator><motor joint='x'/></actuator></mujoco>";

/// What was seen, weights of a prior on the start (0: none) and what it says.
typedef struct record {
  double seen[STEPS + 1], time[STEPS + 1], prior[STATES], weight[STATES];
} record;

static record make_record(int with_prior) {
  record r = {.prior = {0.1, -0.4}};
  for (int t = 0; t <= STEPS; t++) {
    r.time[t] = t * step;
    r.seen[t] = 0.7 + 0.9 * r.time[t] + 0.2 * sin(5 * r.time[t]) + 0.05 * scene_uniform();
  }
  if (with_prior) r.weight[0] = 30, r.weight[1] = 3;
  return r;
}

// ---------------------------------------------------------------- the smoother, written twice

/// Least squares over (q_0, v_0, u_0 .. u_{T-1}) by the normal equations: states [(STEPS+1)*2].
static void smooth_densely(const record *r, double *state) {
  enum { N = STATES + STEPS };
  static double A[N][N + 1], row[STEPS + 1][STATES][N];
  memset(A, 0, sizeof A);
  memset(row, 0, sizeof row);
  row[0][0][0] = row[0][1][1] = 1;
  for (int t = 0; t < STEPS; t++) {
    for (int j = 0; j < N; j++) row[t + 1][1][j] = row[t][1][j];
    row[t + 1][1][STATES + t] += step / mass;
    for (int j = 0; j < N; j++) row[t + 1][0][j] = row[t][0][j] + step * row[t + 1][1][j];
    A[STATES + t][STATES + t] += step * of_force;
  }
  for (int t = 0; t <= STEPS; t++)
    for (int i = 0; i < N; i++) {
      for (int j = 0; j < N; j++) A[i][j] += step * of_place * row[t][0][i] * row[t][0][j];
      A[i][N] += step * of_place * row[t][0][i] * r->seen[t];
    }
  for (int k = 0; k < STATES; k++) A[k][k] += r->weight[k], A[k][N] += r->weight[k] * r->prior[k];
  // elimination; the matrix is positive definite
  for (int c = 0; c < N; c++)
    for (int i = 0; i < N; i++) {
      double f = i != c ? A[i][c] / A[c][c] : 0;
      for (int j = c; j <= N && f != 0; j++) A[i][j] -= f * A[c][j];
    }
  for (int t = 0; t <= STEPS; t++)
    for (int k = 0; k < STATES; k++) {
      state[t * STATES + k] = 0;
      for (int j = 0; j < N; j++) state[t * STATES + k] += row[t][k][j] * A[j][N] / A[j][j];
    }
}

typedef struct gauss {
  double x[2], P[2][2];
} gauss;

static void see(gauss *g, double seen) {
  double S = g->P[0][0] + 1 / (step * of_place), K[2] = {g->P[0][0] / S, g->P[1][0] / S}, off = seen - g->x[0];
  double row[2] = {g->P[0][0], g->P[0][1]};
  for (int i = 0; i < 2; i++) {
    g->x[i] += K[i] * off;
    for (int j = 0; j < 2; j++) g->P[i][j] -= K[i] * row[j];
  }
}

static const double F[2][2] = {{1, 0.025}, {0, 1}};

static gauss go(const gauss *g) {
  gauss next = {0};
  double G[2] = {step * step / mass, step / mass}, FP[2][2] = {0};
  for (int i = 0; i < 2; i++)
    for (int k = 0; k < 2; k++) {
      next.x[i] += F[i][k] * g->x[k];
      for (int j = 0; j < 2; j++) FP[i][j] += F[i][k] * g->P[k][j];
    }
  for (int i = 0; i < 2; i++)
    for (int j = 0; j < 2; j++) {
      for (int k = 0; k < 2; k++) next.P[i][j] += FP[i][k] * F[j][k];
      next.P[i][j] += G[i] * G[j] / (step * of_force);
    }
  return next;
}

/// Kalman's filter forwards, Rauch's, Tung's and Striebel's recursion back; needs a prior.
static void smooth_by_recursion(const record *r, double *state) {
  gauss after[STEPS + 1], before[STEPS + 1], is;
  before[0] = (gauss){.x = {r->prior[0], r->prior[1]}, .P = {{1 / r->weight[0], 0}, {0, 1 / r->weight[1]}}};
  for (int t = 0; t <= STEPS; t++) {
    if (t > 0) before[t] = go(&after[t - 1]);
    after[t] = before[t];
    see(&after[t], r->seen[t]);
  }
  is = after[STEPS];
  for (int t = STEPS; t >= 0; t--) {
    if (t < STEPS) {
      double(*P)[2] = before[t + 1].P;
      double det = P[0][0] * P[1][1] - P[0][1] * P[1][0], off[2], PF[2][2] = {0};
      double inverse[2][2] = {{P[1][1] / det, -P[0][1] / det}, {-P[1][0] / det, P[0][0] / det}};
      for (int i = 0; i < 2; i++) off[i] = is.x[i] - before[t + 1].x[i];
      is = after[t];
      for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
          for (int k = 0; k < 2; k++) PF[i][j] += after[t].P[i][k] * F[j][k];
      for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
          for (int k = 0; k < 2; k++) is.x[i] += PF[i][j] * inverse[j][k] * off[k];
    }
    memcpy(state + (size_t)t * STATES, is.x, sizeof is.x);
  }
}

// ---------------------------------------------------------------- the same as a problem

/// A problem with its storage.
typedef struct bench {
  cav_model *model;
  cav_problem problem;
  cav_term term[8];
  double q_start[8], v_start[8];
} bench;

static cav_term *add(bench *b, cav_term term) {
  term.dofs = CAV_DOFS_ALL;
  b->term[b->problem.nterm] = term;
  return &b->term[b->problem.nterm++];
}

static int bench_make(bench *b, const char *text, double duration) {
  *b = (bench){.model = scene_load(text)};
  if (!CHECK(b->model != NULL)) return 0;
  b->problem = cav_problem_default(b->model);
  memcpy(b->q_start, b->model->q0, (size_t)b->model->nq * sizeof(double));
  b->problem.duration = duration;
  b->problem.timestep = step;
  b->problem.close_at_rest = 0;
  b->problem.free_start = 1;
  b->problem.q_start = b->problem.q_goal = b->q_start, b->problem.v_start = b->v_start;
  b->problem.term = b->term;
  return 1;
}

static int bench_smoother(bench *b, const record *r) {
  if (!bench_make(b, cart, STEPS * step)) return 0;
  add(b, cav_term_cost(CAV_QUANTITY_EFFORT, of_force));
  cav_term *term = add(b, cav_term_cost(CAV_QUANTITY_CONFIGURATION, of_place));
  term->target = r->seen, term->nwaypoint = STEPS + 1, term->waypoint_time = r->time;
  for (int k = 0; k < STATES && r->weight[k] > 0; k++) {
    term = add(b, cav_term_cost(k ? CAV_QUANTITY_VELOCITY : CAV_QUANTITY_CONFIGURATION, r->weight[k]));
    term->target = &r->prior[k], term->to = 0;
  }
  return 1;
}

/// Solves, and certifies with the cost that the solver says; NULL: a check failed.
static cav_solution *solve(const cav_problem *p, cav_solver solver) {
  cav_solve_options options = cav_solve_options_default();
  cav_error error = {0};
  cav_solution *s = NULL;
  options.solver = solver;
  options.gains = 0;
  cav_status status = cav_solve(p, &options, NULL, &s, &error);
  if (!CHECK(status == CAV_OK && s)) fprintf(stderr, "    %s\n", error.text);
  cav_verdict verdict;
  if (s && CHECK(!cav_verify(p, s->trajectory, &s->contact, NULL, NULL, &verdict, &error))) {
    if (!CHECK(cav_verdict_feasible(&verdict))) fprintf(stderr, "    %s\n", verdict.reason);
    CHECK_NEAR(verdict.cost, s->cost, 1e-9 * s->cost + 1e-12);
    CHECK(!cav_verify_optimality(p, s->trajectory, &s->contact, s->nrow, s->row, &verdict, &error));
    CHECK(verdict.optimality < 1e-4);
  }
  return s;
}

/// One Newton step from where a solver ends, whose tolerance is of the cost.
static void refine(const cav_problem *p, cav_trajectory *at) {
  cav_transcription *tr = cav_transcription_new(p, 1, NULL);
  cav_normal *normal = tr ? cav_normal_new(tr) : NULL;
  cav_trajectory *moved = cav_trajectory_copy(at);
  if (!CHECK(tr && normal && moved)) return;
  double *x = calloc((size_t)normal->size, sizeof *x);
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  cav_normal_gather(normal, tr);
  for (int i = 0; i < normal->size; i++) x[i] = -normal->gradient[i];
  CHECK(cav_normal_factor(normal, 0) == CAV_OK);
  cav_normal_solve(normal, x, x);
  cav_transcription_move(tr, at, x, moved);
  memcpy(at->q, moved->q, (size_t)at->nknot * (size_t)at->nq * sizeof(double));
  memcpy(at->v, moved->v, (size_t)at->nknot * (size_t)at->nv * sizeof(double));
  free(x);
  cav_trajectory_free(moved);
  cav_normal_free(normal);
  cav_transcription_free(tr);
}

static void check_states(const cav_solution *s, const double *state, double most) {
  double off = 0;
  for (int t = 0; s && t <= STEPS; t++)
    off = fmax(off,
               fmax(fabs(s->trajectory->q[t] - state[STATES * t]), fabs(s->trajectory->v[t] - state[STATES * t + 1])));
  printf("states off by %.2g\n", off);
  CHECK(off <= most);
}

static void test_smoother(int with_prior, cav_solver solver, double most) {
  double dense[STATES * (STEPS + 1)], recursive[STATES * (STEPS + 1)];
  record r = make_record(with_prior);
  bench b;
  if (!bench_smoother(&b, &r)) return;
  smooth_densely(&r, dense);
  if (with_prior) {
    smooth_by_recursion(&r, recursive);
    CHECK_NEAR_ALL(dense, recursive, STATES * (STEPS + 1), 1e-10);
  }
  cav_solution *s = solve(&b.problem, solver);
  check_states(s, dense, most);
  if (s) refine(&b.problem, s->trajectory);
  check_states(s, dense, 1e-11);
  // a control: with the start given it is another motion
  cav_solution_free(s);
  b.problem.free_start = 0;
  s = solve(&b.problem, solver);
  CHECK(s && fabs(s->trajectory->q[0] - dense[0]) > 0.1);
  cav_solution_free(s);
  cav_model_free(b.model);
}

// ---------------------------------------------------------------- a body that flies

static const char stone[] =
    "<mujoco model='stone'><worldbody><body name='stone' pos='0 0 2'><freejoint/>"
    "<geom type='box' size='.1 .2 .3' mass='2' contype='0' conaffinity='0'/></body></worldbody>"
    "</mujoco>";

/// Seen from a third of its way on, where it was and how it was turned: its start, before that, follows from the laws of
/// motion. The truth is a simulation.
static void test_flight(double duration_slack) {
  enum { KNOTS = 13, FIRST = 4 };
  const double v_true[6] = {1.5, -0.4, 2, 3, -5, 2};
  double v[6], rest[6] = {0}, time[KNOTS];
  bench b;
  if (!bench_make(&b, stone, (KNOTS - 1) * step)) return;
  cav_trajectory *truth = cav_trajectory_new(b.model, KNOTS, step);
  cav_state *state = cav_state_new(b.model);
  state->options.timestep = step;
  state->options.order = b.problem.order;
  memcpy(truth->v, v_true, sizeof v_true);
  for (int t = 0; t + 1 < KNOTS; t++) {
    CHECK(cav_forward(b.model, state, truth->q + 7 * t, truth->v + 6 * t, rest, v) == CAV_OK);
    memcpy(truth->v + 6 * (t + 1), v, sizeof v);
    cav_integrate(b.model, truth->q + 7 * t, v, step, truth->q + 7 * (t + 1));
  }
  for (int t = 0; t < KNOTS; t++) time[t] = t * step;
  cav_term *term = add(&b, cav_term_cost(CAV_QUANTITY_CONFIGURATION, 100));
  term->target = truth->q, term->nwaypoint = KNOTS, term->waypoint_time = time, term->from = time[FIRST];
  // where the guess starts: elsewhere, at rest; and a duration that is free has to stay what it was
  b.q_start[0] = 0.3, b.q_start[2] = 1.5;
  if (duration_slack > 0) {
    b.problem.duration_least = b.problem.duration * (1 - duration_slack);
    b.problem.duration_most = b.problem.duration * (1 + duration_slack);
  }
  cav_solution *s = solve(&b.problem, CAV_SOLVER_GAUSS_NEWTON);
  double off[6], most = 0;
  if (s) cav_difference(b.model, truth->q, s->trajectory->q, 1, off);
  for (int d = 0; s && d < 6; d++) most = fmax(most, fmax(fabs(off[d]), fabs(s->trajectory->v[d] - v_true[d])));
  printf("flight: start off by %.2g\n", most);
  CHECK(s && most < 1e-9);
  if (s) CHECK_NEAR(s->trajectory->timestep, step, 1e-9);
  cav_solution_free(s);
  cav_trajectory_free(truth);
  cav_state_free(state);
  cav_model_free(b.model);
}

// ---------------------------------------------------------------- what else holds at the start

/// A range, a hard term and an effort at the start; the first as a bound that a target pulls at.
static void test_bounds(void) {
  static const char limited[] =
      "<mujoco model='cart'><option gravity='0 0 0'/><worldbody><body name='cart'>"
      "<joint name='x' type='slide' axis='1 0 0' limited='true' range='-1 1'/><geom type='sphere' size='.1' "
      "mass='1'/></body>"
      "</worldbody><actuator><motor joint='x' gear='5' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";
  const double beyond = 1.5, speed = -0.25;
  bench b;
  if (!bench_make(&b, limited, 0.5)) return;
  b.problem.limit_margin = 0.01;
  add(&b, cav_term_cost(CAV_QUANTITY_EFFORT, 1));
  cav_term *term = add(&b, cav_term_cost(CAV_QUANTITY_CONFIGURATION, 100));
  term->target = &beyond, term->to = 0, term->within = INFINITY;
  term = add(&b, cav_term_equal(CAV_QUANTITY_VELOCITY, &speed));
  term->to = 0;
  term = add(&b, cav_term_cost(CAV_QUANTITY_CONFIGURATION, 10));
  term->from = 0.5;
  cav_solution *s = solve(&b.problem, CAV_SOLVER_GAUSS_NEWTON);
  if (s) {
    // half of the margin may be used
    CHECK(s->trajectory->q[0] >= 0.99 - 1e-6 && s->trajectory->q[0] <= 0.995 + 1e-6);
    CHECK_NEAR(s->trajectory->v[0], speed, 1e-6);
    int held = 0;
    for (int i = 0; i < s->nrow; i++)
      held |= s->row[i].knot == 0 && s->row[i].kind == CAV_BINDING_JOINT && s->row[i].multiplier > 0;
    CHECK(held);
  }
  cav_solution_free(s);
  cav_model_free(b.model);
}

/// One problem file, with or without the word.
static cav_problem *load(const char *folder, const char *free_start, const char *more, cav_error *error) {
  char text[1000], path[300];
  snprintf(
      text, sizeof text,
      "<problem model='model.xml'>\n<horizon duration='.5' timestep='.025' close='open'/>\n<start %s/>\n%s</problem>",
      free_start, more);
  scene_write(folder, "model.xml", cart);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%.250s/problem.xml", folder);
  return cav_problem_load(path, NULL, error);
}

static int keep(void *context, const cav_checkpoint *c) {
  const char *folder = context;
  char path[300];
  snprintf(path, sizeof path, "%.250s/checkpoint.csv", folder);
  if (c->place != CAV_PLACE_CONTINUATION || c->stage != 1) return 0;
  CHECK(cav_checkpoint_write(path, c, NULL) == CAV_OK);
  return 0;
}

/// Files, proofs before a solve, and a checkpoint, from which a solve goes on to the same bits.
static void test_files(void) {
  static const char wish[] = "<cost><posture dofs='all' qpos='.4' at='0' weight='100' within='.01'/></cost>";
  char folder[] = "/tmp/cavort-free-start-XXXXXX", path[300];
  cav_error error = {0};
  cav_impossibility found[4];
  int n = 0;
  if (!CHECK(mkdtemp(folder) != NULL)) return;
  for (int is_free = 0; is_free < 2; is_free++) {
    cav_problem *p = load(folder, is_free ? "free='true' qvel='.5'" : "free='false' qvel='.5'", wish, &error);
    if (!CHECK(p != NULL)) fprintf(stderr, "    %s\n", error.text);
    if (!p) continue;
    CHECK(p->free_start == is_free);
    CHECK(cav_problem_impossible(p, found, 4, &n, &error) == CAV_OK && n == !is_free);
    snprintf(path, sizeof path, "%.250s/written.xml", folder);
    CHECK(cav_problem_write(path, p, NULL, &error) == CAV_OK);
    cav_problem *again = cav_problem_load(path, NULL, &error);
    CHECK(again && again->free_start == is_free && again->v_start[0] == 0.5);
    cav_problem_free(again);
    cav_solution *whole = NULL, *rest = NULL;
    cav_solve_options options = cav_solve_options_default();
    options.keeper = keep, options.keeper_context = folder;
    CHECK(cav_solve(p, &options, NULL, &whole, &error) == CAV_OK);
    snprintf(path, sizeof path, "%.250s/checkpoint.csv", folder);
    cav_checkpoint *c = cav_checkpoint_read(path, p->model, &error);
    options.keeper = NULL, options.resume = c;
    CHECK(c && cav_solve(p, &options, NULL, &rest, &error) == CAV_OK);
    if (CHECK(whole && rest)) {
      CHECK(!memcmp(whole->trajectory->q, rest->trajectory->q, 21 * sizeof(double)));
      CHECK(!memcmp(whole->trajectory->v, rest->trajectory->v, 21 * sizeof(double)));
      CHECK((fabs(whole->trajectory->q[0] - 0.4) < 0.01) == is_free);
      // and from where it ended: there it stays
      cav_solution *warm = NULL;
      options.resume = NULL, options.first_stage = 1000;
      CHECK(cav_solve(p, &options, whole->trajectory, &warm, &error) == CAV_OK);
      if (warm) CHECK_NEAR(warm->trajectory->v[0], whole->trajectory->v[0], 1e-5);
      cav_solution_free(warm);
    }
    cav_checkpoint_free(c);
    cav_solution_free(whole), cav_solution_free(rest);
    cav_problem_free(p);
  }
  CHECK(!load(folder, "free='true'", "<cycle translation='1 0 0'/>", &error));
  CHECK(strstr(error.text, "close") || strstr(error.text, "free"));
  static const char *const left[] = {"model.xml", "problem.xml", "written.xml", "checkpoint.csv"};
  for (int i = 0; i < 4; i++) {
    snprintf(path, sizeof path, "%.250s/%s", folder, left[i]);
    unlink(path);
  }
  CHECK(rmdir(folder) == 0);
}

int main(void) {
  test_files();
  test_bounds();
  test_flight(0);
  test_flight(0.2);
  for (int prior = 0; prior < 2; prior++) test_smoother(prior, CAV_SOLVER_GAUSS_NEWTON, 1e-5);
  if (cav_solver_load(CAV_SOLVER_IPOPT, NULL) == CAV_OK)
    for (int prior = 0; prior < 2; prior++) test_smoother(prior, CAV_SOLVER_IPOPT, 1e-6);
  return check_result();
}
