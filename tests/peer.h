/// MuJoCo 2.2.2 beside ours: its enumerators of what both libraries have, and what later versions do otherwise.
#ifndef CAVORT_TESTS_PEER_H
#define CAVORT_TESTS_PEER_H

#include <mujoco/mujoco.h>
#include <stdlib.h>

#include "cavort/model.h"

/// MuJoCo's type of each of our sensors.
static const int peer_sensor[CAV_SENSOR_TYPES] = {
    [CAV_SENSOR_JOINTPOS] = mjSENS_JOINTPOS,
    [CAV_SENSOR_JOINTVEL] = mjSENS_JOINTVEL,
    [CAV_SENSOR_FRAMEPOS] = mjSENS_FRAMEPOS,
    [CAV_SENSOR_FRAMEQUAT] = mjSENS_FRAMEQUAT,
    [CAV_SENSOR_FRAMEXAXIS] = mjSENS_FRAMEXAXIS,
    [CAV_SENSOR_FRAMEYAXIS] = mjSENS_FRAMEYAXIS,
    [CAV_SENSOR_FRAMEZAXIS] = mjSENS_FRAMEZAXIS,
    [CAV_SENSOR_FRAMELINVEL] = mjSENS_FRAMELINVEL,
    [CAV_SENSOR_FRAMEANGVEL] = mjSENS_FRAMEANGVEL,
    [CAV_SENSOR_SUBTREECOM] = mjSENS_SUBTREECOM,
    [CAV_SENSOR_SUBTREELINVEL] = mjSENS_SUBTREELINVEL,
    [CAV_SENSOR_SUBTREEANGMOM] = mjSENS_SUBTREEANGMOM,
    [CAV_SENSOR_TOUCH] = mjSENS_TOUCH,
    [CAV_SENSOR_ACCELEROMETER] = mjSENS_ACCELEROMETER,
    [CAV_SENSOR_VELOCIMETER] = mjSENS_VELOCIMETER,
    [CAV_SENSOR_GYRO] = mjSENS_GYRO,
    [CAV_SENSOR_FORCE] = mjSENS_FORCE,
    [CAV_SENSOR_TORQUE] = mjSENS_TORQUE,
    [CAV_SENSOR_MAGNETOMETER] = mjSENS_MAGNETOMETER,
    [CAV_SENSOR_RANGEFINDER] = mjSENS_RANGEFINDER,
    [CAV_SENSOR_TENDONPOS] = mjSENS_TENDONPOS,
    [CAV_SENSOR_TENDONVEL] = mjSENS_TENDONVEL,
    [CAV_SENSOR_ACTUATORPOS] = mjSENS_ACTUATORPOS,
    [CAV_SENSOR_ACTUATORVEL] = mjSENS_ACTUATORVEL,
    [CAV_SENSOR_ACTUATORFRC] = mjSENS_ACTUATORFRC,
    [CAV_SENSOR_BALLQUAT] = mjSENS_BALLQUAT,
    [CAV_SENSOR_BALLANGVEL] = mjSENS_BALLANGVEL,
    [CAV_SENSOR_JOINTLIMITPOS] = mjSENS_JOINTLIMITPOS,
    [CAV_SENSOR_JOINTLIMITVEL] = mjSENS_JOINTLIMITVEL,
    [CAV_SENSOR_JOINTLIMITFRC] = mjSENS_JOINTLIMITFRC,
    [CAV_SENSOR_TENDONLIMITPOS] = mjSENS_TENDONLIMITPOS,
    [CAV_SENSOR_TENDONLIMITVEL] = mjSENS_TENDONLIMITVEL,
    [CAV_SENSOR_TENDONLIMITFRC] = mjSENS_TENDONLIMITFRC,
    [CAV_SENSOR_FRAMELINACC] = mjSENS_FRAMELINACC,
    [CAV_SENSOR_FRAMEANGACC] = mjSENS_FRAMEANGACC,
    [CAV_SENSOR_CLOCK] = mjSENS_CLOCK,
};

// J'v of all rows, J' by differences of the fourth order along v
static inline void peer_row_biases(const mjModel *m, const mjData *d, double *out) {
  static const double step = 1e-3, at[4] = {-2, -1, 1, 2}, weight[4] = {1, -8, 8, -1};
  mjData *beside = mj_makeData(m);
  double *rate = calloc((size_t)d->nefc + 1, sizeof *rate);
  for (int i = 0; i < d->ne; i++) out[i] = 0;
  for (int k = 0; k < 4; k++) {
    mju_copy(beside->qpos, d->qpos, m->nq);
    mj_integratePos(m, beside->qpos, d->qvel, at[k] * step);
    mj_fwdPosition(m, beside);
    rate = realloc(rate, ((size_t)beside->nefc + 1) * sizeof *rate);
    mj_mulJacVec(m, beside, rate, d->qvel);
    for (int i = 0; i < d->ne; i++) out[i] += weight[k] * rate[i] / (12 * step);
  }
  free(rate);
  mj_deleteData(beside);
}

/// After mj_inverse: connects and welds by the law that version 3 and ours have. J'v is taken from their reference, and
/// rotations have the weight of rotations. Forces, qfrc_inverse and readings of accelerations follow.
static inline void peer_hold(const mjModel *m, mjData *d) {
  size_t n = (size_t)d->nefc + 1;
  double *bias = calloc(n, sizeof *bias), *Ja = calloc(n, sizeof *Ja), *change = calloc(n, sizeof *change);
  double *push = calloc((size_t)m->nv + 1, sizeof *push);
  peer_row_biases(m, d, bias);
  mj_mulJacVec(m, d, Ja, d->qacc);
  for (int i = 0, k = 0; i < d->ne; i++) {
    int id = d->efc_id[i];
    k = i > 0 && d->efc_id[i - 1] == id ? k + 1 : 0;
    if (m->eq_type[id] > mjEQ_WELD) continue;
    const double *a = m->body_invweight0 + 2 * m->eq_obj1id[id], *b = m->body_invweight0 + 2 * m->eq_obj2id[id];
    double D = d->efc_D[i] * (k < 3 ? 1 : (a[0] + b[0]) / (a[1] + b[1]));
    change[i] = D * (d->efc_aref[i] - bias[i] - Ja[i]) - d->efc_force[i];
    d->efc_force[i] += change[i];
  }
  mj_mulJacTVec(m, d, push, change);
  mju_subFrom(d->qfrc_inverse, push, m->nv);
  mj_rnePostConstraint(m, d);
  mj_sensorAcc(m, d);
  free(bias), free(Ja), free(change), free(push);
}

#endif
