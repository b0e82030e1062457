/// A free start: q_0 and v_0 found with the motion. A point mass that follows noisy positions is the linear smoother: least
/// squares over its start and forces solved densely here, and with a prior on the start the smoother of Rauch, Tung and
/// Striebel, both written here. A body that flies is found from where it was seen, spinning, with its velocity at the start,
/// which nothing else tells. Ranges and targets hold at the start as at other knots; files, checkpoints, proofs before a
/// solve and certificates know it.
#include "normal_equations.h"
#include "schedule.h"
#include "smoother.h"
#include "solvers.h"

// ---------------------------------------------------------------- the same as a problem

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
  smooth_densely(&r, dense, NULL, NULL);
  if (with_prior) {
    smooth_by_recursion(&r, recursive, NULL);
    CHECK_NEAR_ALL(dense, recursive, STATES * (STEPS + 1), 1e-10);
  }
  cav_solution *s = solve(&b.problem, solver);
  check_states(s, dense, most);
  if (s) refine(&b.problem, s->trajectory);
  check_states(s, dense, 1e-11);
  // the solver that keeps its memory, from elsewhere
  cav_optimiser *o = cav_optimiser_new(&b.problem, NULL, NULL, NULL);
  if (CHECK(o && cav_optimiser_iterate(o, 10, NULL) == CAV_OK)) {
    const cav_trajectory *at = cav_optimiser_trajectory(o);
    CHECK(fabs(at->q[0] - dense[0]) < 1e-5 && fabs(at->v[0] - dense[1]) < 1e-4);
  }
  cav_optimiser_free(o);
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
