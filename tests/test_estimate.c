/// Estimation of a motion whose truth is known: an arm of two joints, pushed about by torques of known variance, seen by an
/// accelerometer, a gyro and a marker with noise, 30 % of the readings of each missing. The error of postures and of
/// torques, rms over knots and records, and what standard errors make of it, against the Cramer-Rao bound: the inverse
/// of the information at the truth, the torques' prior with it, by differences of simulations that share nothing with the
/// solver but a forward step.
#include "cavort/cavort.h"
#include "scene.h"

enum { STEPS = 40, DOFS = 2, PARAMETERS = DOFS * (2 + STEPS), RECORDS = 12, CHANNELS = 9 };

static const double step = 0.02, torque_sd = 0.6, limit = 40, missing = 0.3;
static const double sd[CHANNELS] = {.5, .5, .5, .05, .05, .05, .01, .01, .01}; // m/s^2, rad/s, m

static char folder[] = "/tmp/cavort-estimate-XXXXXX";

static const char arm[] =
    "<mujoco><worldbody><body name='upper' pos='0 0 1'><joint name='a' axis='0 1 0' damping='.1' armature='.01'/><geom "
    "type='capsule' size='.04' fromto='0 0 0 0 0 -.3' mass='1'/><body name='lower' pos='0 0 -.3'><joint name='b' "
    "axis='0 1 0' damping='.1' armature='.01'/><geom type='capsule' size='.03' fromto='0 0 0 0 0 -.3' mass='.5'/>"
    "<site name='imu' pos='.02 0 -.2' euler='0 20 0'/></body></body></worldbody><actuator>"
    "<motor joint='a' gear='40' ctrllimited='true' ctrlrange='-1 1'/>"
    "<motor joint='b' gear='40' ctrllimited='true' ctrlrange='-1 1'/></actuator>"
    "<sensor><accelerometer name='acc' site='imu'/><gyro name='turn' site='imu'/></sensor></mujoco>";

typedef struct simulation {
  cav_model *model;
  cav_state *state;
  double q[STEPS + 1][DOFS];
  double reading[STEPS + 1]
                [CHANNELS]; // accelerometer, gyro half a step later, marker; of the last knot the marker alone
} simulation;

/// From parameters: posture and velocity at the start, torques of every step.
static void simulate(simulation *s, const double *x) {
  double v[DOFS], next[DOFS], u[DOFS];
  const double place[3] = {0, .03, -.3};
  const cav_model *m = s->model;
  memcpy(s->q[0], x, sizeof s->q[0]);
  memcpy(v, x + DOFS, sizeof v);
  int body = cav_object_find(m, CAV_OBJECT_BODY, "lower");
  for (int t = 0; t <= STEPS; t++) {
    if (t < STEPS) {
      CHECK(cav_forward(m, s->state, s->q[t], v, x + DOFS * (2 + t), next) == CAV_OK);
      CHECK(cav_inverse(m, s->state, s->q[t], v, next, u) == CAV_OK);
      for (int d = 0; d < DOFS; d++) CHECK_NEAR(u[d], x[DOFS * (2 + t) + d], 1e-9);
      for (int k = 0; k < 2; k++) cav_sensor_read(m, s->state, &m->sensor[k], s->reading[t] + 3 * k);
      cav_integrate(m, s->q[t], next, step, s->q[t + 1]);
      memcpy(v, next, sizeof v);
    } else {
      CHECK(cav_position(m, s->state, s->q[t]) == CAV_OK);
    }
    cav_pose pose;
    cav_object_pose(m, s->state, CAV_OBJECT_XBODY, body, &pose);
    for (int i = 0; i < 3; i++) {
      s->reading[t][6 + i] = pose.pos[i];
      for (int k = 0; k < 3; k++) s->reading[t][6 + i] += pose.rotation[3 * i + k] * place[k];
    }
  }
}

/// Inverse of a symmetric positive definite A [n*n] in place, by Gauss-Jordan.
static void invert(int n, double *A) {
  for (int k = 0; k < n; k++) {
    double pivot = A[k * n + k];
    A[k * n + k] = 1;
    for (int j = 0; j < n; j++) A[k * n + j] /= pivot;
    for (int i = 0; i < n; i++) {
      double f = A[i * n + k];
      if (i == k) continue;
      A[i * n + k] = 0;
      for (int j = 0; j < n; j++) A[i * n + j] -= f * A[k * n + j];
    }
  }
}

/// Mean variances of postures over knots, and of torques over steps, that no unbiased estimate of the truth x goes below.
static void bound(simulation *s, const double *x, char seen[STEPS + 1][3], double *postures, double *torques) {
  static double dq[PARAMETERS][STEPS + 1][DOFS], dy[PARAMETERS][STEPS + 1][CHANNELS], A[PARAMETERS * PARAMETERS];
  double moved[PARAMETERS];
  memcpy(moved, x, sizeof moved);
  for (int i = 0; i < PARAMETERS; i++) {
    const double size = 1e-5;
    for (int side = 0; side < 2; side++) {
      moved[i] = x[i] + (side ? -size : size);
      simulate(s, moved);
      double sign = (side ? -1 : 1) / (2 * size);
      for (int t = 0; t <= STEPS; t++) {
        for (int d = 0; d < DOFS; d++) dq[i][t][d] = (side ? dq[i][t][d] : 0) + sign * s->q[t][d];
        for (int c = 0; c < CHANNELS; c++) dy[i][t][c] = (side ? dy[i][t][c] : 0) + sign * s->reading[t][c];
      }
    }
    moved[i] = x[i];
  }
  memset(A, 0, sizeof A);
  for (int i = 0; i < PARAMETERS; i++) {
    if (i >= 2 * DOFS) A[i * PARAMETERS + i] = 1 / (torque_sd * torque_sd);
    for (int j = 0; j < PARAMETERS; j++)
      for (int t = 0; t <= STEPS; t++)
        for (int c = t < STEPS ? 0 : 6; c < CHANNELS; c++)
          if (seen[t][c / 3]) A[i * PARAMETERS + j] += dy[i][t][c] * dy[j][t][c] / (sd[c] * sd[c]);
  }
  invert(PARAMETERS, A);
  *postures = *torques = 0;
  for (int i = 0; i < PARAMETERS; i++) {
    if (i >= 2 * DOFS) *torques += A[i * PARAMETERS + i] / (DOFS * STEPS);
    for (int j = 0; j < PARAMETERS; j++)
      for (int t = 0; t <= STEPS; t++)
        for (int d = 0; d < DOFS; d++)
          *postures += dq[i][t][d] * A[i * PARAMETERS + j] * dq[j][t][d] / (DOFS * (STEPS + 1));
  }
}

/// The record of a truth as files: accelerometer and marker at knots, the gyro between them.
static void write_record(const simulation *s, char seen[STEPS + 1][3]) {
  static char text[2][40000];
  int n[2] = {snprintf(text[0], sizeof text[0], "time,acc_x,acc_y,acc_z,tip_x,tip_y,tip_z"),
              snprintf(text[1], sizeof text[1], "time,turn_x,turn_y,turn_z")};
  for (int t = 0; t <= STEPS; t++)
    for (int file = 0; file < 2 && (file == 0 || t < STEPS); file++) {
      char *to = text[file];
      n[file] += snprintf(to + n[file], sizeof text[0] - (size_t)n[file], "\n%.17g", 5 + (t + file / 2.) * step);
      for (int c = 0; c < CHANNELS; c++) {
        if ((c / 3 == 1) != file) continue;
        double value = s->reading[t][c] + sd[c] * scene_normal();
        int there = seen[t][c / 3] && (t < STEPS || c >= 6);
        n[file] += snprintf(to + n[file], sizeof text[0] - (size_t)n[file], there ? ",%.17g" : ",", value);
      }
    }
  scene_write(folder, "record.csv", text[0]);
  scene_write(folder, "gyro.csv", text[1]);
}

/// Mean variances of postures and torques as standard errors tell them, at an estimate.
static void told(const cav_problem *p, const cav_solution *s, double *postures, double *torques) {
  cav_standard_errors *e = NULL;
  cav_error error = {0};
  if (!CHECK(s && cav_standard_errors_find(p, s->trajectory, &s->contact, s->nrow, s->row, &e, &error) == CAV_OK)) {
    fprintf(stderr, "    %s\n", error.text);
    return;
  }
  for (int i = 0; i < DOFS * (STEPS + 1); i++) *postures += e->q[i] * e->q[i] / (DOFS * (STEPS + 1));
  for (int i = 0; i < DOFS * STEPS; i++) *torques += e->u[i] * e->u[i] / (DOFS * STEPS);
  cav_standard_errors_free(e);
}

static cav_solution *estimate(const double *x, double variance[2]) {
  char path[300], text[2000];
  cav_error error = {0};
  snprintf(
      text, sizeof text,
      "<problem model='m.xml'><horizon duration='%g' timestep='%g' close='open'/><start free='true' qpos='%g %g'/>"
      "<limits effort='1'/><cost><effort weight='%.17g'/><velocity weight='0'/><acceleration weight='0'/>"
      "<posture weight='0'/>"
      "<track file='record.csv' offset='5' gap='0'><marker name='tip' body='lower' pos='0 .03 -.3' sd='%g'/>"
      "<sensor name='acc' sd='%g'/></track><track file='gyro.csv' offset='5' gap='0' sensors='turn' sd='%g'/></cost>"
      "</problem>",
      STEPS * step, step, x[0] + .1, x[1] - .1, limit * limit / (torque_sd * torque_sd * step), sd[6], sd[0], sd[3]);
  scene_write(folder, "m.xml", arm);
  scene_write(folder, "p.xml", text);
  snprintf(path, sizeof path, "%s/p.xml", folder);
  cav_problem *p = cav_problem_load(path, NULL, &error);
  cav_solve_options options = cav_solve_options_default();
  cav_solution *s = NULL;
  options.gains = 0;
  if (!CHECK(p && cav_solve(p, &options, NULL, &s, &error) == CAV_OK)) fprintf(stderr, "    %s\n", error.text);
  told(p, s, &variance[0], &variance[1]);
  cav_problem_free(p);
  return s;
}

int main(void) {
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  simulation s = {.model = scene_load(arm)};
  s.state = s.model ? cav_state_new(s.model) : NULL;
  if (!CHECK(s.state != NULL)) return check_result();
  s.state->options.timestep = step;
  s.state->options.order = CAV_ORDER_MIDPOINT;
  double square[2] = {0}, least[2] = {0}, variance[2] = {0};
  int hidden = 0;
  for (int r = 0; r < RECORDS; r++) {
    double x[PARAMETERS] = {.6, -.3, 1, -2}, postures, torques;
    char seen[STEPS + 1][3];
    for (int i = 2 * DOFS; i < PARAMETERS; i++) x[i] = torque_sd * scene_normal();
    for (int t = 0; t <= STEPS; t++)
      for (int c = 0; c < 3; c++) {
        seen[t][c] = scene_uniform() > 2 * missing - 1;
        hidden += !seen[t][c];
      }
    bound(&s, x, seen, &postures, &torques);
    simulate(&s, x);
    write_record(&s, seen);
    cav_solution *e = estimate(x, variance);
    for (int t = 0; t <= STEPS && e; t++)
      for (int d = 0; d < DOFS; d++) {
        square[0] += pow(e->trajectory->q[DOFS * t + d] - s.q[t][d], 2) / (DOFS * (STEPS + 1));
        if (t < STEPS) square[1] += pow(e->trajectory->u[DOFS * t + d] - x[DOFS * (2 + t) + d], 2) / (DOFS * STEPS);
      }
    least[0] += postures, least[1] += torques;
    cav_solution_free(e);
  }
  for (int k = 0; k < 2; k++)
    printf("%s: rms error %.4g %s, standard errors %.4g, Cramer-Rao bound %.4g, ratio %.3f\n",
           k ? "torques" : "postures", sqrt(square[k] / RECORDS), k ? "N m" : "rad", sqrt(variance[k] / RECORDS),
           sqrt(least[k] / RECORDS), sqrt(square[k] / least[k]));
  // twelve records: the rms of that many errors is within a fifth or so of its mean; nothing can be far below the bound
  for (int k = 0; k < 2; k++) CHECK(square[k] < 1.25 * 1.25 * least[k] && square[k] > .75 * .75 * least[k]);
  // seen 3 % apart: standard errors are of the information at the estimate instead of the truth
  for (int k = 0; k < 2; k++) CHECK_NEAR(sqrt(variance[k] / least[k]), 1, .05);
  CHECK(fabs(hidden / (3. * RECORDS * (STEPS + 1)) - missing) < .03);
  // the bound is of the noise, not of what the marker alone or the prior alone would say
  CHECK(sqrt(least[1] / RECORDS) < .9 * torque_sd && sqrt(least[0] / RECORDS) < sd[6] / .3);
  const char *files[] = {"m.xml", "p.xml", "record.csv", "gyro.csv"};
  for (int i = 0; i < 4; i++) {
    char path[300];
    snprintf(path, sizeof path, "%s/%s", folder, files[i]);
    unlink(path);
  }
  CHECK(rmdir(folder) == 0);
  cav_state_free(s.state);
  cav_model_free(s.model);
  return check_result();
}
