/// Moving-horizon estimation against what is known: of a linear system with Gaussian noise its state and covariance are the
/// Kalman filter's at every sample, however short the window; readings that are missing say nothing; of a body that falls on its
/// leg and tumbles errors are at the Cramer-Rao bound, by differences of simulations, and told; what is refused.
#include "cavort/cavort.h"
#include "linear_step.h"
#include "scene.h"

enum { N = 2, S = 2 * N, SAMPLES = 200 };
static const double step = 0.02, force_sd = 3, place_sd = 0.01, start_q = 0.3, start_v = 0.7;
static double begin[S] = {0.4, -0.7, 1.1, 0.3};

/// x, P one step on.
static void predict(double A[S][S], double B[S][N], double x[S], double P[S][S]) {
  double y[S] = {0}, AP[S][S] = {{0}}, Q[S][S] = {{0}};
  for (int i = 0; i < S; i++)
    for (int k = 0; k < S; k++) {
      y[i] += A[i][k] * x[k];
      for (int j = 0; j < S; j++) AP[i][j] += A[i][k] * P[k][j];
    }
  for (int i = 0; i < S; i++)
    for (int j = 0; j < S; j++) {
      for (int k = 0; k < S; k++) Q[i][j] += AP[i][k] * A[j][k];
      for (int k = 0; k < N; k++) Q[i][j] += force_sd * force_sd * B[i][k] * B[j][k];
    }
  memcpy(x, y, sizeof y), memcpy(P, Q, sizeof Q);
}

/// x, P with a reading of the first place; the square of its innovation in its own deviations.
static double correct(double z, double x[S], double P[S][S]) {
  double gain[S], over = P[0][0] + place_sd * place_sd, off = z - x[0], row[S];
  memcpy(row, P[0], sizeof row);
  for (int i = 0; i < S; i++) gain[i] = P[i][0] / over;
  for (int i = 0; i < S; i++) {
    x[i] += gain[i] * off;
    for (int j = 0; j < S; j++) P[i][j] -= gain[i] * row[j];
  }
  return off * off / over;
}

/// A problem of that model: forces of known variance, a start that is known so well, and a record of the first place.
static cav_problem problem_of(const cav_model *m, cav_term term[4], cav_track *track, cav_channel *channel,
                              double duration) {
  static double zero[S], time[2] = {0, 1}, value[2];
  cav_problem p = cav_problem_default(m);
  *channel = (cav_channel){
      .name = "a", .kind = CAV_CHANNEL_COORDINATE, .object = 0, .component = -1, .ncolumn = 1, .sd = place_sd};
  *track = (cav_track){
      .nchannel = 1, .channel = channel, .nframe = 2, .ncolumn = 1, .time = time, .value = value, .interval = step};
  term[0] = cav_term_cost(CAV_QUANTITY_EFFORT, 1 / (force_sd * force_sd * step));
  term[1] = cav_term_cost(CAV_QUANTITY_TRACK, 1 / step);
  term[1].track = track;
  term[2] = cav_term_cost(CAV_QUANTITY_CONFIGURATION, 1);
  term[2].scale = start_q, term[2].target = begin;
  term[3] = cav_term_cost(CAV_QUANTITY_VELOCITY, 1);
  term[3].scale = start_v, term[3].target = begin + N;
  for (int i = 2; i < 4; i++) term[i].from = term[i].to = 0, term[i].dofs = CAV_DOFS_ALL;
  p.name = "masses";
  p.duration = duration, p.timestep = step;
  p.free_start = 1, p.close_at_rest = 0, p.effort_limit = 1;
  p.q_start = p.q_goal = zero, p.v_start = zero + N;
  p.term = term, p.nterm = 4;
  return p;
}

/// Largest difference of states and covariances from the filter's, in standard errors and in variances.
static void run(const cav_model *m, cav_order order, int knots, double missing) {
  cav_term term[4];
  cav_track track;
  cav_channel channel;
  cav_error error = {0};
  cav_problem p = problem_of(m, term, &track, &channel, 20 * step);
  cav_state *s = cav_state_new(m);
  p.order = order;
  s->options.timestep = step, s->options.order = order;
  double A[S][S], B[S][N], x[S], truth[S], P[S][S] = {{0}}, most = 0, wide = 0, innovation[SAMPLES] = {0}, odd = 0;
  int read[SAMPLES] = {0}, readings;
  linear_map(m, s, step, &A[0][0], &B[0][0]);
  memcpy(x, begin, sizeof x);
  for (int i = 0; i < S; i++) {
    const double sd = i < N ? start_q : start_v;
    P[i][i] = sd * sd, truth[i] = begin[i] + sd * scene_normal();
  }
  cav_mhe_options o = cav_mhe_options_default();
  o.knots = knots;
  cav_mhe *mhe = cav_mhe_new(&p, &o, &error);
  if (!CHECK(mhe != NULL)) fprintf(stderr, "    %s\n", error.text);
  for (int t = 0; t < SAMPLES && mhe; t++) {
    double u[N], next[S], z = truth[0] + place_sd * scene_normal();
    if (scene_uniform() < 2 * missing - 1) z = NAN;
    if (t > 0) predict(A, B, x, P);
    if (!isnan(z)) innovation[t] = correct(z, x, P), read[t] = 1;
    CHECK(cav_mhe_measure(mhe, 1, t * step, &z) == CAV_OK);
    CHECK(cav_mhe_update(mhe, NULL) == CAV_OK);
    cav_knot_view view;
    if (!CHECK(cav_mhe_view(mhe, 0, &view) == CAV_OK)) break;
    CHECK_NEAR(view.time, t * step, 1e-9);
    // twice the costs of a window are the innovations of its readings, given all before it
    double chi = cav_mhe_chi_square(mhe, &readings);
    for (int i = t; i >= 0 && i > t - knots; i--) chi -= innovation[i], readings -= read[i];
    CHECK(readings == 0);
    odd = fmax(odd, fabs(chi));
    const double *C = cav_mhe_covariance(mhe);
    for (int i = 0; i < S; i++) {
      most = fmax(most, fabs((i < N ? view.q[i] : view.v[i - N]) - x[i]) / sqrt(P[i][i]));
      for (int j = 0; j < S; j++) wide = fmax(wide, fabs(C[i * S + j] - P[i][j]) / sqrt(P[i][i] * P[j][j]));
    }
    for (int i = 0; i < N; i++) u[i] = force_sd * scene_normal();
    linear_step(m, s, step, truth, u, next);
    memcpy(truth, next, sizeof next);
  }
  printf("order %d, %d knots, %.0f %% missing: states %.1e standard errors, covariances %.1e off the Kalman filter's\n",
         (int)order, knots, 100 * missing, most, wide);
  CHECK(most < 1e-8 && wide < 1e-9);
  printf("    chi-square of a window off the innovations' by %.1e\n", odd);
  CHECK(odd < 1e-8);
  cav_mhe_free(mhe);
  cav_state_free(s);
}

static void test_refusals(const cav_model *m) {
  cav_term term[4];
  cav_track track;
  cav_channel channel;
  cav_error error = {0};
  cav_problem good = problem_of(m, term, &track, &channel, 20 * step), p = good;
  cav_mhe_options bad[5];
  for (int i = 0; i < 5; i++) bad[i] = cav_mhe_options_default();
  bad[0].knots = 2, bad[1].knots = 22, bad[2].threads = 0, bad[3].iterations = 0, bad[4].deadline = NAN;
  for (int i = 0; i < 5; i++) {
    error = (cav_error){0};
    CHECK(!cav_mhe_new(&good, &bad[i], &error) && error.status == CAV_BAD_INPUT && *error.text);
  }
  p.free_start = 0;
  CHECK(!cav_mhe_new(&p, NULL, &error) && error.status == CAV_NOT_SUPPORTED);
  p = good, p.close_at_rest = 1;
  CHECK(!cav_mhe_new(&p, NULL, &error) && error.status == CAV_NOT_SUPPORTED);
  term[0].to = 3 * step;
  CHECK(!cav_mhe_new(&good, NULL, &error) && error.status == CAV_NOT_SUPPORTED);
  term[0].to = -1;
  p = good, p.nterm = 1;
  CHECK(!cav_mhe_new(&p, NULL, &error) && error.status == CAV_BAD_INPUT);
  // nothing is known of the start, nor of the second place
  p = good, p.nterm = 2;
  cav_mhe *mhe = cav_mhe_new(&p, NULL, &error);
  cav_knot_view view;
  double z = 0.4, nothing = NAN, bent = INFINITY;
  if (!CHECK(mhe != NULL)) return;
  CHECK(!cav_mhe_covariance(mhe) && cav_mhe_view(mhe, 0, &view) == CAV_BAD_INPUT);
  CHECK(cav_mhe_measure(mhe, 1, 0, &z) == CAV_OK && cav_mhe_update(mhe, NULL) == CAV_NOT_CONVERGED);
  CHECK(cav_mhe_measure(mhe, 0, 1, &z) == CAV_BAD_INPUT && cav_mhe_measure(mhe, 4, 1, &z) == CAV_BAD_INPUT);
  CHECK(cav_mhe_measure(mhe, 1, 0, &z) == CAV_BAD_INPUT && cav_mhe_measure(mhe, 1, step, &bent) == CAV_BAD_INPUT);
  CHECK(cav_mhe_measure(mhe, 1, step, &nothing) == CAV_OK && cav_mhe_view(mhe, 1, &view) == CAV_BAD_INPUT);
  cav_mhe_free(mhe);
}

// ---------------------------------------------------------------- a body that falls on its leg

/// A box with a leg, thrown to the floor: pushed about by forces of known variance, seen by a gyro and an encoder.
static const char leg_text[] =
    "<mujoco model='leg'><worldbody><geom name='floor' type='plane' size='9 9 1' friction='.8'/>"
    "<body name='box' pos='0 0 .6'><freejoint name='root'/><site name='imu'/>"
    "<geom type='box' size='.12 .1 .08' mass='4'/><body name='leg' pos='.03 0 -.08'>"
    "<joint name='hip' axis='0 1 0' damping='.3' stiffness='20'/>"
    "<geom type='capsule' size='.03' fromto='0 0 0 0 0 -.3' mass='.8'/></body></body></worldbody>"
    "<actuator><motor joint='hip'/></actuator></mujoco>";

enum { D = 7, X = 2 * D, Q = D + 1, STEPS = 60, RUNS = 16 };
static const double beat = 0.01, push_sd = 20, twist_sd = 1, motor_sd = 2, gyro_sd = 0.02, hip_sd = 0.002;

/// What is known at the start, and what each step adds, by dof.
static double start_sd(int i) { return i < 3 ? 0.02 : i < D ? 0.03 : i < D + 3 ? 0.1 : 0.2; }
static double noise_sd(int d) { return d < 3 ? push_sd : d < 6 ? twist_sd : motor_sd; }

static cav_problem leg_problem(const cav_model *m, double *start, cav_term term[9], cav_track track[2],
                               cav_channel channel[2], cav_sensor *gyro) {
  static double time[2] = {0, 1}, value[2 * 3];
  cav_problem p = cav_problem_default(m);
  channel[0] = (cav_channel){
      .name = "gyro", .kind = CAV_CHANNEL_SENSOR, .sensor = *gyro, .component = -1, .ncolumn = 3, .sd = gyro_sd};
  channel[1] = (cav_channel){
      .name = "hip", .kind = CAV_CHANNEL_COORDINATE, .object = 1, .component = -1, .ncolumn = 1, .sd = hip_sd};
  for (int i = 0; i < 2; i++) {
    track[i] = (cav_track){.nchannel = 1,
                           .channel = &channel[i],
                           .nframe = 2,
                           .ncolumn = channel[i].ncolumn,
                           .time = time,
                           .value = value,
                           .interval = beat};
    term[i] = cav_term_cost(CAV_QUANTITY_TRACK, 1 / beat);
    term[i].track = &track[i];
  }
  // deviations are those of white noise, per root of 1/s
  p.residual = (cav_residual){.force = push_sd * sqrt(beat), .torque = twist_sd * sqrt(beat), .within = 1};
  term[2] = cav_term_cost(CAV_QUANTITY_EFFORT, 1 / (motor_sd * motor_sd * beat));
  static const cav_dof_set set[3] = {CAV_DOFS_ROOT_LINEAR, CAV_DOFS_ROOT_ANGULAR, CAV_DOFS_JOINTS};
  for (int i = 0; i < 3; i++) {
    term[3 + i] = cav_term_cost(CAV_QUANTITY_CONFIGURATION, 1);
    term[3 + i].scale = start_sd(3 * i), term[3 + i].target = start;
    term[3 + i].dofs = set[i];
  }
  for (int i = 0; i < 3; i++) {
    term[6 + i] = cav_term_cost(CAV_QUANTITY_VELOCITY, 1);
    term[6 + i].scale = start_sd(D + 3 * i), term[6 + i].target = start + Q;
    term[6 + i].dofs = set[i];
  }
  for (int i = 3; i < 9; i++) term[i].from = term[i].to = 0;
  p.name = "leg";
  p.duration = 12 * beat, p.timestep = beat;
  p.free_start = 1, p.close_at_rest = 0, p.effort_limit = 1;
  p.q_start = p.q_goal = start, p.v_start = start + Q;
  p.term = term, p.nterm = 9;
  p.schedule.last.softness = 0.3, p.schedule.last.smoothing = 0.005, p.schedule.last.time_constant = 2;
  return p;
}

/// y (X) of a state near x [Q+D]; back: the tangent from one to the other.
static void move_state(const cav_model *m, const double *x, const double *y, double *out) {
  cav_integrate(m, x, y, 1, out);
  for (int d = 0; d < D; d++) out[Q + d] = x[Q + d] + y[D + d];
}

static void tangent(const cav_model *m, const double *from, const double *to, double *y) {
  cav_difference(m, from, to, 1, y);
  for (int d = 0; d < D; d++) y[D + d] = to[Q + d] - from[Q + d];
}

static void leg_step(const cav_model *m, cav_state *s, const double *x, const double *u, double *next) {
  CHECK(cav_forward(m, s, x, x + Q, u, next + Q) == CAV_OK);
  cav_integrate(m, x, next + Q, beat, next);
}

/// P one step on from x under u and with that step's readings: information at the truth, by differences of simulations.
static void bound_step(const cav_model *m, cav_state *s, const double *x, const double *u, double P[X][X]) {
  static double A[X][X + D], W[X][X + D], after[X][X];
  double at[Q + D], moved[Q + D], end[2][Q + D], v[D], y[X], column[X];
  leg_step(m, s, x, u, at);
  for (int k = 0; k < X + D; k++) {
    const double h = k < X ? 1e-6 : 1e-4;
    for (int side = 0; side < 2; side++) {
      const double by = side ? -h : h;
      memset(y, 0, sizeof y), memcpy(v, u, sizeof v);
      if (k < X) y[k] = by;
      if (k >= X) v[k - X] += by;
      move_state(m, x, y, moved);
      leg_step(m, s, moved, v, end[side]);
    }
    tangent(m, end[1], end[0], column);
    for (int i = 0; i < X; i++) A[i][k] = column[i] / (2 * h);
  }
  for (int i = 0; i < X; i++)
    for (int j = 0; j < X + D; j++) {
      W[i][j] = j < X ? 0 : A[i][j] * pow(noise_sd(j - X), 2);
      for (int k = 0; k < X && j < X; k++) W[i][j] += A[i][k] * P[k][j];
    }
  for (int i = 0; i < X; i++)
    for (int j = 0; j < X; j++) {
      after[i][j] = 0;
      for (int k = 0; k < X + D; k++) after[i][j] += W[i][k] * A[j][k];
    }
  // one reading after another: the hip, and the three of the gyro
  for (int r = 0; r < 4; r++) {
    const int at_row = r ? D + 2 + r : 6;
    const double sd = r ? gyro_sd : hip_sd, over = after[at_row][at_row] + sd * sd;
    double row[X];
    memcpy(row, after[at_row], sizeof row);
    for (int i = 0; i < X; i++)
      for (int j = 0; j < X; j++) after[i][j] -= row[i] * row[j] / over;
  }
  memcpy(P, after, sizeof after);
}

/// Squares of errors, of the bound and of what is told, by state.
typedef struct tally {
  double error[X], bound[X], told[X];
  int n;
} tally;

static void run_leg(const cav_problem *p, cav_state *s, int knots, tally *t) {
  const cav_model *m = p->model;
  cav_error error = {0};
  cav_mhe_options o = cav_mhe_options_default();
  o.knots = knots;
  cav_mhe *mhe = cav_mhe_new(p, &o, &error);
  double x[Q + D], next[Q + D], start[Q + D], y[X], P[X][X] = {{0}}, u[D];
  memcpy(start, p->q_start, Q * sizeof *start), memcpy(start + Q, p->v_start, D * sizeof *start);
  for (int i = 0; i < X; i++) y[i] = start_sd(i) * scene_normal(), P[i][i] = start_sd(i) * start_sd(i);
  move_state(m, start, y, x);
  for (int k = 0; k < STEPS && CHECK(mhe != NULL); k++) {
    double hip = x[7] + hip_sd * scene_normal(), turn[3];
    for (int c = 0; c < 3; c++) turn[c] = x[Q + 3 + c] + gyro_sd * scene_normal();
    CHECK(cav_mhe_measure(mhe, 1, k * beat, &hip) == CAV_OK);
    if (k) CHECK(cav_mhe_measure(mhe, 0, (k - 0.5) * beat, turn) == CAV_OK);
    if (!CHECK(cav_mhe_update(mhe, NULL) == CAV_OK)) break;
    cav_knot_view view;
    double off[Q + D];
    CHECK(cav_mhe_view(mhe, 0, &view) == CAV_OK);
    memcpy(off, view.q, Q * sizeof *off), memcpy(off + Q, view.v, D * sizeof *off);
    tangent(m, x, off, y);
    // the law that it is simulated with is the estimator's
    s->options = view.state->options;
    if (k > 0) t->n++;
    for (int i = 0; i < X && k > 0; i++) {
      t->error[i] += y[i] * y[i], t->bound[i] += P[i][i];
      t->told[i] += cav_mhe_covariance(mhe)[i * X + i];
    }
    for (int d = 0; d < D; d++) u[d] = noise_sd(d) * scene_normal();
    leg_step(m, s, x, u, next);
    bound_step(m, s, x, u, P);
    memcpy(x, next, sizeof x);
  }
  cav_mhe_free(mhe);
}

static void test_leg(int knots) {
  cav_error error = {0};
  cav_model *m = scene_load(leg_text);
  cav_state *s = m ? cav_state_new(m) : NULL;
  if (!CHECK(s != NULL)) return;
  double start[Q + D] = {0, 0, 0.5, cos(0.05), 0, sin(0.05), 0, 0.1, 0.8, 0.2, -0.5, 0.3, 1, 0.2, 0};
  cav_term term[9];
  cav_track track[2];
  cav_channel channel[2];
  cav_sensor gyro;
  CHECK(cav_sensor_of(m, CAV_SENSOR_GYRO, CAV_OBJECT_SITE, 0, &gyro, &error) == CAV_OK);
  cav_problem p = leg_problem(m, start, term, track, channel, &gyro);
  tally t = {.n = 0};
  for (int r = 0; r < RUNS; r++) run_leg(&p, s, knots, &t);
  double all = 0, told = 0;
  printf("a leg, %d knots: errors over the Cramer-Rao bound (bound)", knots);
  for (int i = 0; i < X; i++) {
    const double ratio = sqrt(t.error[i] / t.bound[i]);
    printf("%s %.2f (%.2g)", i == D ? ";" : "", ratio, sqrt(t.bound[i] / t.n));
    CHECK(ratio < 2);
    all += t.error[i] / t.bound[i] / X, told += t.told[i] / t.bound[i] / X;
  }
  printf("; all %.3f, told %.3f\n", sqrt(all), sqrt(told));
  // fourteen numbers over sixteen throws: their rms is within a tenth or so of its mean
  CHECK(sqrt(all) > 0.85 && sqrt(all) < 1.3);
  CHECK_NEAR(sqrt(told), 1, 0.05);
  cav_state_free(s);
  cav_model_free(m);
}

int main(void) {
  cav_model *m = scene_load(two_masses);
  if (CHECK(m != NULL)) {
    run(m, CAV_ORDER_EULER, 3, 0);
    run(m, CAV_ORDER_EULER, 8, 0);
    run(m, CAV_ORDER_MIDPOINT, 8, 0);
    run(m, CAV_ORDER_MOMENTUM, 20, 0.3);
    test_refusals(m);
  }
  cav_model_free(m);
  test_leg(4);
  test_leg(10);
  return check_result();
}
