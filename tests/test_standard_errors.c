/// Standard errors: of a point mass that follows noisy positions those of the linear smoother, densely and by recursion; of a
/// body in flight, whose dynamics hold exactly, those of its start carried along by simulations beside it; of what a bound
/// holds, none. Columns of stderr.csv; what is refused.
#include <unistd.h>

#include "cavort/result.h"
#include "row_factor.h"
#include "smoother.h"

static cav_standard_errors *find(const cav_problem *p, const cav_solution *s) {
  cav_standard_errors *e = NULL;
  cav_error error = {0};
  if (!CHECK(!cav_standard_errors_find(p, s->trajectory, &s->contact, s->nrow, s->row, &e, &error)))
    fprintf(stderr, "    %s\n", error.text);
  return e;
}

static cav_solution *solve(const cav_problem *p) {
  cav_solve_options options = cav_solve_options_default();
  cav_error error = {0};
  cav_solution *s = NULL;
  options.gains = 0;
  CHECK(cav_solve(p, &options, NULL, &s, &error) == CAV_OK && s);
  return s;
}

static void test_smoother(int with_prior) {
  double state[STATES * (STEPS + 1)], cov[4 * (STEPS + 1)], force[STEPS], recursive[4 * (STEPS + 1)];
  record r = make_record(with_prior);
  bench b;
  if (!bench_smoother(&b, &r)) return;
  smooth_densely(&r, state, cov, force);
  if (with_prior) {
    smooth_by_recursion(&r, state, recursive);
    CHECK_NEAR_ALL(cov, recursive, 4 * (STEPS + 1), 1e-12);
  }
  cav_solution *s = solve(&b.problem);
  cav_standard_errors *e = s ? find(&b.problem, s) : NULL;
  double worst = 0;
  for (int t = 0; t <= STEPS && e; t++) {
    worst = fmax(worst, fabs(e->q[t] / sqrt(cov[4 * t]) - 1));
    worst = fmax(worst, fabs(e->v[t] / sqrt(cov[4 * t + 3]) - 1));
    worst = fmax(worst, fabs(e->covariance[t] / cov[4 * t] - 1));
    if (t < STEPS) worst = fmax(worst, fabs(e->u[t] / force[t] - 1));
    if (t < STEPS) worst = fmax(worst, fabs(e->force[t] / force[t] - 1));
  }
  CHECK(e && isnan(e->u[STEPS]) && isnan(e->force[STEPS]));
  printf("smoother: errors off by %.2g of themselves\n", worst);
  CHECK(worst < 1e-9);
  cav_standard_errors_free(e);
  cav_solution_free(s);
  cav_model_free(b.model);
}

// ---------------------------------------------------------------- dynamics that hold

static const char stone[] =
    "<mujoco model='stone'><worldbody><body name='stone' pos='0 0 2'><freejoint/>"
    "<geom type='box' size='.1 .2 .3' mass='2' contype='0' conaffinity='0'/></body></worldbody>"
    "</mujoco>";
enum { KNOTS = 13 };

// a flight from a start moved by x [12], of q_0 and of v_0
static void fly(const cav_model *m, cav_state *state, const cav_trajectory *from, const double *x, cav_trajectory *to) {
  double rest[6] = {0}, v[6];
  cav_integrate(m, from->q, x, 1, to->q);
  for (int d = 0; d < 6; d++) to->v[d] = from->v[d] + x[6 + d];
  for (int t = 0; t + 1 < KNOTS; t++) {
    CHECK(cav_forward(m, state, to->q + 7 * t, to->v + 6 * t, rest, v) == CAV_OK);
    memcpy(to->v + 6 * (t + 1), v, sizeof v);
    cav_integrate(m, to->q + 7 * t, v, step, to->q + 7 * (t + 1));
  }
}

// inverse of a symmetric positive matrix of 12, by elimination
static void invert(double A[12][24]) {
  for (int i = 0; i < 12; i++)
    for (int j = 0; j < 12; j++) A[i][12 + j] = i == j;
  for (int c = 0; c < 12; c++)
    for (int i = 0; i < 12; i++) {
      double f = i != c ? A[i][c] / A[c][c] : 0;
      for (int j = 0; j < 24 && f != 0; j++) A[i][j] -= f * A[c][j];
    }
  for (int i = 0; i < 12; i++)
    for (int j = 12; j < 24; j++) A[i][j] /= A[i][i];
}

/// Seen at every knot: the start has twelve unknowns, and everything else follows it.
static void test_flight(void) {
  const double weight = 100, move = 1e-5;
  double x[12] = {0}, time[KNOTS], J[KNOTS][12][12], A[12][24] = {{0}}, worst = 0;
  bench b;
  if (!bench_make(&b, stone, (KNOTS - 1) * step)) return;
  const cav_model *m = b.model;
  cav_trajectory *truth = cav_trajectory_new(m, KNOTS, step), *start = cav_trajectory_copy(truth);
  cav_trajectory *side[2] = {cav_trajectory_copy(truth), cav_trajectory_copy(truth)};
  cav_state *state = cav_state_new(m);
  state->options.timestep = step;
  state->options.order = b.problem.order;
  memcpy(start->v, (const double[]){1.5, -0.4, 2, 3, -5, 2}, 6 * sizeof(double));
  fly(m, state, start, x, truth);
  for (int c = 0; c < 12; c++) {
    for (int k = 0; k < 2; k++) x[c] = k ? move : -move, fly(m, state, start, x, side[k]);
    x[c] = 0;
    for (int t = 0; t < KNOTS; t++) {
      double d[6];
      cav_difference(m, side[0]->q + 7 * t, side[1]->q + 7 * t, 2 * move, d);
      for (int i = 0; i < 6; i++) {
        J[t][i][c] = d[i];
        J[t][6 + i][c] = (side[1]->v[6 * t + i] - side[0]->v[6 * t + i]) / (2 * move);
      }
    }
  }
  for (int t = 0; t < KNOTS; t++) time[t] = t * step;
  for (int t = 0; t < KNOTS; t++)
    for (int i = 0; i < 12; i++)
      for (int j = 0; j < 12; j++)
        for (int k = 0; k < 6; k++) A[i][j] += step * weight * J[t][k][i] * J[t][k][j];
  invert(A);
  cav_term *term = add(&b, cav_term_cost(CAV_QUANTITY_CONFIGURATION, weight));
  term->target = truth->q, term->nwaypoint = KNOTS, term->waypoint_time = time;
  cav_solution *s = solve(&b.problem);
  cav_standard_errors *e = s ? find(&b.problem, s) : NULL;
  for (int t = 0; t < KNOTS && e; t++)
    for (int i = 0; i < 12; i++) {
      double variance = 0, got = i < 6 ? e->q[6 * t + i] : e->v[6 * t + i - 6];
      for (int k = 0; k < 12; k++)
        for (int l = 0; l < 12; l++) variance += J[t][i][k] * A[k][12 + l] * J[t][i][l];
      worst = fmax(worst, fabs(got / sqrt(variance) - 1));
    }
  // what has to be zero is known to be
  double force = 0;
  for (int i = 0; i < 6 * (KNOTS - 1) && e; i++) force = fmax(force, e->u[i]);
  printf("flight: errors off by %.2g of themselves, forces known to %.2g N\n", worst, force);
  CHECK(worst < 1e-6);
  CHECK(force < 1e-3);
  cav_standard_errors_free(e);
  cav_solution_free(s);
  cav_trajectory_free(truth), cav_trajectory_free(start), cav_trajectory_free(side[0]), cav_trajectory_free(side[1]);
  cav_state_free(state);
  cav_model_free(b.model);
}

// ---------------------------------------------------------------- factor and inverse

/// Rows at random over a band with a border: the inverse of their squares where the band has entries, against the dense one.
static void test_inverse(int border) {
  enum { N = 4, BLOCKS = 6, ROWS = 9, MOST = N * BLOCKS + 5 };
  int core = N * BLOCKS, size = core + border;
  double A[MOST][2 * MOST] = {{0}}, worst = 0;
  cav_row_factor f;
  CHECK(cav_row_factor_begin(&f, N, BLOCKS, border) == CAV_OK);
  for (int b = 0; b <= BLOCKS; b++) {
    double *rows = cav_row_factor_add(&f, ROWS);
    if (!CHECK(rows != NULL)) break;
    for (int i = 0; i < ROWS; i++, rows += 3 * N + border) {
      double row[MOST] = {0};
      for (int c = 0; c < 3 * N + border; c++) {
        int k = c < 3 * N ? b * N + c : core + c - 3 * N;
        if ((c < 3 * N && k >= core) || (b == BLOCKS && c < 3 * N)) continue;
        row[k] = rows[c] = scene_uniform();
      }
      for (int r = 0; r < size; r++)
        for (int c = 0; c < size; c++) A[r][c] += row[r] * row[c];
    }
    cav_row_factor_advance(&f);
  }
  for (int i = 0; i < size; i++) A[i][size + i] = 1;
  for (int c = 0; c < size; c++)
    for (int i = 0; i < size; i++) {
      double factor = i != c ? A[i][c] / A[c][c] : 0;
      for (int j = 0; j < 2 * size && factor != 0; j++) A[i][j] -= factor * A[c][j];
    }
  for (int b = BLOCKS - 1; b >= 0; b--) {
    cav_row_factor_back(&f, b);
    int across = 3 * N + border;
    for (int i = 0; i < across; i++)
      for (int j = 0; j < across; j++) {
        int r = i < 3 * N ? b * N + i : core + i - 3 * N, c = j < 3 * N ? b * N + j : core + j - 3 * N;
        if ((i < 3 * N && r >= core) || (j < 3 * N && c >= core)) continue;
        double is = 0;
        for (int k = 0; k < across; k++) is += f.spread[i * across + k] * f.spread[j * across + k];
        worst = fmax(worst, fabs(is - A[r][size + c] / A[r][r]));
      }
  }
  printf("inverse with a border of %d: off by %.2g\n", border, worst);
  CHECK(worst < 1e-12);
  cav_row_factor_clear(&f);
}

// ---------------------------------------------------------------- bounds, files, refusals

/// At a bound that holds it back a position is known; without a cost nothing is; a free duration is refused.
static void test_ends(void) {
  static const char limited[] =
      "<mujoco model='cart'><option gravity='0 0 0'/><worldbody><body name='cart'><joint name='x' type='slide' "
      "axis='1 0 0' limited='true' range='-1 1'/><geom type='sphere' size='.1' mass='1'/></body></worldbody>"
      "<actuator><motor name='push' joint='x' gear='5' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";
  const double beyond = 1.5;
  char folder[] = "/tmp/cavort-errors-XXXXXX", path[300], head[200] = "";
  cav_error error = {0};
  cav_standard_errors *none = NULL;
  bench b;
  if (!CHECK(mkdtemp(folder) != NULL) || !bench_make(&b, limited, 0.5)) return;
  add(&b, cav_term_cost(CAV_QUANTITY_EFFORT, 1));
  cav_term *term = add(&b, cav_term_cost(CAV_QUANTITY_CONFIGURATION, 100));
  term->target = &beyond, term->to = 0;
  term = add(&b, cav_term_cost(CAV_QUANTITY_CONFIGURATION, 10));
  term->from = 0.5;
  cav_solution *s = solve(&b.problem);
  cav_standard_errors *e = s ? find(&b.problem, s) : NULL;
  CHECK(e && e->q[0] < 1e-6 && e->q[10] > 1e-3 && e->v[0] > 1e-3);
  CHECK(e && cav_result_write_errors(folder, b.model, s->trajectory, e, &error) == CAV_OK);
  snprintf(path, sizeof path, "%s/stderr.csv", folder);
  FILE *file = fopen(path, "r");
  CHECK(file && fgets(head, sizeof head, file));
  CHECK_TEXT(head, "time,q_x,qvel_x,u_x,force_push\n");
  double x[5] = {0};
  CHECK(file && fscanf(file, "%lf,%lf,%lf,%lf,%lf", x, x + 1, x + 2, x + 3, x + 4) == 5);
  if (e) CHECK(x[2] == e->v[0] && x[4] == e->force[0] && fabs(x[3] - x[4] * 5) < 1e-9 * x[3]);
  if (file) fclose(file);
  cav_standard_errors_free(e);
  // no cost tells of the start but efforts, which are alike wherever it is
  b.problem.nterm = 1;
  CHECK(s &&
        cav_standard_errors_find(&b.problem, s->trajectory, &s->contact, 0, NULL, &none, &error) == CAV_NOT_CONVERGED);
  CHECK(!none && strstr(error.text, "tell anything"));
  b.problem.duration_least = 0.4, b.problem.duration_most = 0.6;
  CHECK(s &&
        cav_standard_errors_find(&b.problem, s->trajectory, &s->contact, 0, NULL, &none, &error) == CAV_NOT_SUPPORTED);
  unlink(path);
  CHECK(rmdir(folder) == 0);
  cav_solution_free(s);
  cav_model_free(b.model);
}

int main(void) {
  for (int border = 0; border < 6; border++) test_inverse(border);
  test_ends();
  for (int prior = 0; prior < 2; prior++) test_smoother(prior);
  test_flight();
  return check_result();
}
