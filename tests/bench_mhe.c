/// Moving-horizon estimation of our humanoid on its feet: simulated at 1 ms in the contacts of its model's file, controlled by
/// problems/mpc/stand.xml, pushed; joint encoders, an accelerometer and a gyro in the torso and the motors' torques at 100 Hz
/// with noise, no sensor of place. Rows of tests/results/mhe.md: errors of estimates against the simulation, and processor
/// time, by length of the window. Usage: bench_mhe [--record DIR] (the records of problems/mhe), from the project's folder
#include <time.h>

#include "bench.h"
#include "cavort/cavort.h"

enum {
  RATE = 100,
  SUB = 10,
  SECONDS = 3,
  SAMPLES = RATE * SECONDS,
  JOINTS = 21,
  IMU = 6,
  FEET = 2,
  MOST_V = 27,
  MOST_Q = 28
};
static const double fine = 0.001, noise_joint = 0.001, noise_acc = 0.1, noise_gyro = 0.01, noise_torque = 1;
static const char *const foot_name[FEET] = {"foot_right", "foot_left"};

/// What the body does, and what is measured of it.
typedef struct truth {
  cav_model *model;
  double impulse;                                     ///< N s
  double q[SAMPLES][MOST_Q], mean_v[SAMPLES][MOST_V]; ///< at knots; over the step before
  double foot[SAMPLES][FEET];                         ///< N, normal force on each foot over the step about a knot
  double push[SAMPLES];                               ///< N
  double joint[SAMPLES][JOINTS], imu[SAMPLES][IMU + JOINTS]; ///< readings: at knots; over the step after
} truth;

static double seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int foot_of(const cav_model *m, const cav_contact *contact) {
  const cav_pair *pair = &m->pair[contact->pair];
  for (int f = 0; f < FEET; f++) {
    const int link = m->body[cav_object_find(m, CAV_OBJECT_BODY, foot_name[f])].link;
    if (m->geom[pair->geom1].link == link || m->geom[pair->geom2].link == link) return f;
  }
  return -1;
}

/// Normal forces on the feet at an evaluated state.
static void feet(const cav_state *s, double force[FEET]) {
  force[0] = force[1] = 0;
  for (int i = 0; i < s->ncontact; i++) {
    const int f = foot_of(s->model, &s->contact[i]);
    if (f >= 0) force[f] += s->contact[i].impulse[0] / s->options.timestep;
  }
}

static void simulate(truth *w, double push) {
  cav_error error = {0};
  cav_problem *p = cav_problem_load("problems/mpc/stand.xml", NULL, &error);
  cav_mpc_options o = cav_mpc_options_default();
  o.delay = 0.01, o.stiffness = 10;
  cav_mpc *mpc = p ? cav_mpc_new(p, &o, NULL, &error) : NULL;
  if (!CHECK(mpc != NULL)) exit(check_result());
  const cav_model *m = p->model;
  cav_state *s = cav_state_new(m);
  cav_sensor acc = {.type = CAV_SENSOR_ACCELEROMETER}, gyro = {.type = CAV_SENSOR_GYRO};
  const int site = cav_object_find(m, CAV_OBJECT_SITE, "imu");
  CHECK(cav_sensor_of(m, CAV_SENSOR_ACCELEROMETER, CAV_OBJECT_SITE, site, &acc, &error) == CAV_OK);
  CHECK(cav_sensor_of(m, CAV_SENSOR_GYRO, CAV_OBJECT_SITE, site, &gyro, &error) == CAV_OK);
  double q[MOST_Q], v[MOST_V], u[MOST_V], r[MOST_V], next[MOST_V], mean[MOST_V] = {0}, out[4], foot[FEET];
  memcpy(q, p->q_start, sizeof q), memcpy(v, p->v_start, sizeof v);
  s->options.timestep = fine;
  cav_model *model = w->model;
  *w = (truth){.model = model, .impulse = push};
  // let it settle
  for (int i = -300; i < SAMPLES * SUB; i++) {
    const int k = i / SUB, part = i % SUB;
    if (i % 10 == 0) CHECK(cav_mpc_plan(mpc, (i + 300) * fine, q, v, NULL) == CAV_OK);
    CHECK(cav_mpc_command(mpc, (i + 300) * fine, q, v, NULL, u) == CAV_OK);
    if (i >= 0 && part == 0) {
      memcpy(w->q[k], q, sizeof q), memcpy(w->mean_v[k], mean, sizeof mean);
      for (int j = 0; j < JOINTS; j++) w->joint[k][j] = q[7 + j] + noise_joint * scene_normal();
    }
    if (part == 0) memset(mean, 0, sizeof mean);
    const double f = i >= 1000 && i < 1100 ? push / 0.1 : 0;
    for (int j = 0; i >= 0 && j < JOINTS; j++) w->imu[k][IMU + j] += u[6 + j] / SUB;
    u[1] += f;
    if (!CHECK(cav_forward(m, s, q, v, u, next) == CAV_OK)) break;
    CHECK(cav_inverse(m, s, q, v, next, r) == CAV_OK);
    feet(s, foot);
    const int near = (i + SUB / 2) / SUB;
    if (i >= 0 && near < SAMPLES)
      for (int n = 0; n < FEET; n++) w->foot[near][n] += foot[n] / SUB;
    if (i >= 0) {
      w->push[k] += f / SUB;
      cav_sensor_read(m, s, &acc, out);
      for (int c = 0; c < 3; c++) w->imu[k][c] += out[c] / SUB;
      cav_sensor_read(m, s, &gyro, out);
      for (int c = 0; c < 3; c++) w->imu[k][3 + c] += out[c] / SUB;
    }
    memcpy(v, next, sizeof v);
    for (int d = 0; d < m->nv; d++) mean[d] += v[d] / SUB;
    cav_integrate(m, q, v, fine, q);
  }
  for (int k = 0; k < SAMPLES; k++)
    for (int c = 0; c < IMU + JOINTS; c++)
      w->imu[k][c] += (c < 3 ? noise_acc : c < IMU ? noise_gyro : noise_torque) * scene_normal();
  cav_mpc_free(mpc);
  cav_state_free(s);
  cav_problem_free(p);
}

static int missing(double part) { return scene_uniform() < 2 * part - 1; }

/// The reading of a channel at sample k, its first number.
static const double *reading(const truth *w, const cav_model *m, const cav_channel *channel, int k) {
  if (channel->kind == CAV_CHANNEL_COORDINATE) return &w->joint[k][m->joint[channel->object].q - 7];
  if (channel->sensor.type == CAV_SENSOR_ACCELEROMETER) return w->imu[k - 1];
  if (channel->sensor.type == CAV_SENSOR_GYRO) return w->imu[k - 1] + 3;
  return &w->imu[k - 1][IMU + m->joint[channel->sensor.object].q - 7];
}

/// What a record has between samples k - 1 and k.
static void measure(cav_mhe *mhe, const truth *w, const cav_track *track, int term, int k, double gone) {
  const int places = track->channel->kind == CAV_CHANNEL_COORDINATE;
  const cav_model *m = w->model;
  double value[IMU + JOINTS];
  if (!places && k == 0) return;
  for (int i = 0; i < track->nchannel; i++) {
    const cav_channel *channel = &track->channel[i];
    const int hidden = missing(gone);
    for (int c = 0; c < channel->ncolumn; c++) value[channel->column + c] = hidden ? NAN : reading(w, m, channel, k)[c];
  }
  CHECK(cav_mhe_measure(mhe, term, places ? (double)k / RATE : (k - 0.5) / RATE, value) == CAV_OK);
}

/// Errors and time of an estimate with a window of so many knots.
static void estimate(const truth *w, int knots, int iterations, double gone) {
  cav_error error = {0};
  cav_problem *p = cav_problem_load("problems/mhe/stand.xml", NULL, &error);
  cav_mhe_options o = cav_mhe_options_default();
  o.knots = knots, o.iterations = iterations;
  cav_mhe *mhe = p ? cav_mhe_new(p, &o, &error) : NULL;
  if (!CHECK(mhe != NULL)) {
    fprintf(stderr, "%s\n", error.text);
    exit(check_result());
  }
  const int nv = p->model->nv;
  double took[SAMPLES], square[6] = {0}, told[4] = {0}, chi = 0, most = 0;
  int late = 0, wrong = 0, n = 0, counted = 0;
  for (int k = 0; k < SAMPLES; k++) {
    for (int i = 0; i < p->nterm; i++)
      if (p->term[i].track) measure(mhe, w, p->term[i].track, i, k, gone);
    cav_progress at = {0};
    const double begin = seconds();
    if (!CHECK(cav_mhe_update(mhe, &at) == CAV_OK)) break;
    const double spent = seconds() - begin;
    if (k >= knots) took[counted++] = spent, late += spent > 1. / RATE;
    cav_knot_view view;
    double foot[FEET], off[MOST_V];
    const double *C = cav_mhe_covariance(mhe);
    int readings;
    const double ratio = cav_mhe_chi_square(mhe, &readings) / readings;
    if (readings > 0) chi += ratio / SAMPLES, most = fmax(most, ratio);
    if (k < 2) continue;
    CHECK(cav_mhe_view(mhe, 1, &view) == CAV_OK);
    feet(view.state, foot);
    const double felt = view.u[1];
    for (int f = 0; f < FEET; f++) {
      wrong += (foot[f] > 20) != (w->foot[k - 1][f] > 20);
      square[3] += pow(foot[f] - w->foot[k - 1][f], 2) / FEET;
    }
    CHECK(cav_mhe_view(mhe, 0, &view) == CAV_OK);
    cav_difference(p->model, w->q[k], view.q, 1, off);
    for (int d = 0; d < 3; d++)
      square[0] += pow(view.v[d] - w->mean_v[k][d], 2), told[0] += C[(nv + d) * 2 * nv + nv + d];
    for (int d = 3; d < 5; d++) square[1] += off[d] * off[d], told[1] += C[d * 2 * nv + d];
    for (int d = 0; d < 3; d++) square[2] += off[d] * off[d], told[2] += C[d * 2 * nv + d];
    square[4] += pow(felt - w->push[k - 1], 2);
    n++;
  }
  qsort(took, (size_t)counted, sizeof *took, bench_ascending);
  printf(
      "| %.0f | %d | %d | %.0f | %.1f (%.1f) | %.2f (%.2f) | %.0f (%.0f) | %.0f | %.1f | %.0f | %.2g (%.2g) | %.1f | "
      "%.1f | %.0f | "
      "%d |\n",
      w->impulse, knots, iterations, 100 * gone, 100 * sqrt(square[0] / n), 100 * sqrt(told[0] / n),
      sqrt(square[1] / n) * 180 / M_PI, sqrt(told[1] / n) * 180 / M_PI, 1e3 * sqrt(square[2] / n),
      1e3 * sqrt(told[2] / n), sqrt(square[3] / n), 100. * wrong / (FEET * n), sqrt(square[4] / n), chi, most,
      1e3 * took[counted / 2], 1e3 * took[counted * 99 / 100], 1 / took[counted / 2], late);
  cav_mhe_free(mhe);
  cav_problem_free(p);
}

static void record(const truth *w, const char *folder) {
  char path[300];
  const cav_model *m = w->model;
  snprintf(path, sizeof path, "%s/stand_joints.csv", folder);
  FILE *joints = fopen(path, "w");
  snprintf(path, sizeof path, "%s/stand_imu.csv", folder);
  FILE *imu = fopen(path, "w");
  if (!CHECK(joints && imu && m)) return;
  fputs("time", joints), fputs("time,acc_x,acc_y,acc_z,gyro_x,gyro_y,gyro_z", imu);
  for (int j = 0; j < JOINTS; j++)
    fprintf(joints, ",%s", m->joint[1 + j].name), fprintf(imu, ",%s", m->joint[1 + j].name);
  for (int k = 50; k < 200; k++) {
    fprintf(joints, "\n%.2f", (k - 50.) / RATE), fprintf(imu, "\n%.3f", (k - 49.5) / RATE);
    for (int j = 0; j < JOINTS; j++) fprintf(joints, ",%.4f", w->joint[k][j]);
    for (int c = 0; c < IMU + JOINTS; c++) fprintf(imu, c < 6 ? ",%.3f" : ",%.1f", w->imu[k][c]);
  }
  fputc('\n', joints), fputc('\n', imu);
  fclose(joints), fclose(imu);
}

int main(int argc, char **argv) {
  static truth w;
  cav_error error = {0};
  w.model = cav_model_load("problems/models/humanoid.xml", &error);
  if (!CHECK(w.model != NULL)) return check_result();
  simulate(&w, 20);
  if (argc > 2 && !strcmp(argv[1], "--record")) {
    record(&w, argv[2]);
  } else {
    static const int window[] = {3, 5, 10, 20, 40};
    for (int i = 0; i < 5; i++) estimate(&w, window[i], 1, 0);
    estimate(&w, 10, 2, 0);
    estimate(&w, 10, 1, 0.3);
    simulate(&w, 0);
    estimate(&w, 10, 1, 0);
    simulate(&w, 40);
    estimate(&w, 10, 1, 0);
    estimate(&w, 10, 1, 0.3);
  }
  cav_model_free(w.model);
  return check_result();
}
