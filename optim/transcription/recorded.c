/// Terms over a record (cav_track): markers from the pose of their body and their place on it, joints from q, sensors. All
/// derivatives are exact where those of sensors are; that of a marker is the velocity of the point for each dof on the way
/// to its body, and an orientation's is that of the rotation vector from the record to it.
#include "recorded.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "math3.h"
#include "quantity.h"
#include "rotation.h"

int cav_recorded_dim(const cav_track *track) {
  int n = 0;
  for (int i = 0; i < track->nchannel; i++) n += cav_channel_dim(&track->channel[i]);
  return n;
}

// component that column c of a channel of a sensor has
static int component_of(const cav_channel *channel, int c) { return channel->component >= 0 ? channel->component : c; }

static void place_of(const cav_model *m, const cav_state *state, const cav_channel *channel, double place[3]) {
  cav_pose pose;
  cav_object_pose(m, state, CAV_OBJECT_XBODY, channel->object, &pose);
  transform(place, pose.pos, pose.rotation, channel->place);
}

// what the motion has in the place of a channel's columns
static void measure(const cav_model *m, cav_state *state, const cav_channel *channel, double *value) {
  const double *q;
  double reading[CAV_SENSOR_DIM_MAX];
  const cav_joint *joint = channel->kind == CAV_CHANNEL_SENSOR ? NULL : &m->joint[channel->object];
  switch (channel->kind) {
    case CAV_CHANNEL_MARKER:
      place_of(m, state, channel, value);
      break;
    case CAV_CHANNEL_COORDINATE:
    case CAV_CHANNEL_TRANSLATION:
    case CAV_CHANNEL_ROTATION:
      cav_state_point(state, &q, NULL, NULL);
      q += joint->q + (channel->kind == CAV_CHANNEL_ROTATION && joint->type == CAV_JOINT_FREE ? 3 : 0);
      memcpy(value, q, (size_t)channel->ncolumn * sizeof *value);
      break;
    case CAV_CHANNEL_SENSOR:
      cav_sensor_read(m, state, &channel->sensor, reading);
      for (int c = 0; c < channel->ncolumn; c++) value[c] = reading[component_of(channel, c)];
      break;
    case CAV_CHANNEL_KINDS:
      break;
  }
}

void cav_recorded_read(const cav_transcription *tr, cav_state *state, const cav_term *term, int t, double *y) {
  const cav_track *track = term->track;
  for (int i = 0; i < track->nchannel; i++) {
    const cav_channel *channel = &track->channel[i];
    double record[CAV_SENSOR_DIM_MAX], value[CAV_SENSOR_DIM_MAX], off[CAV_SENSOR_DIM_MAX] = {0};
    double unit = 1 / (channel->sd * term->scale);
    if (cav_track_sample(track, channel, cav_knot_time(tr, t), tr->problem->timestep, record)) {
      measure(tr->model, state, channel, value);
      for (int c = 0; c < channel->ncolumn; c++) off[c] = isnan(record[c]) ? 0 : value[c] - record[c];
      if (cav_channel_rotates(channel)) cav_rotation_between(record, value, off);
    }
    for (int c = 0; c < cav_channel_dim(channel); c++) *y++ = unit * off[c];
  }
}

static void marker_rows(const cav_model *m, const cav_state *state, const cav_channel *channel, double *dq) {
  int nv = m->nv, link = m->body[channel->object].link;
  double place[3], column[3];
  place_of(m, state, channel, place);
  while (link > 0 && m->link[link].ndof == 0) link = m->link[link].parent;
  for (int d = link > 0 ? m->link[link].dof + m->link[link].ndof - 1 : -1; d >= 0; d = m->dof[d].parent) {
    velocity_at(column, state->axis + 6 * (size_t)d, state->reference + 3 * (size_t)m->dof[d].link, place);
    for (int k = 0; k < 3; k++) dq[k * nv + d] = column[k];
  }
}

static void joint_rows(const cav_model *m, const cav_state *state, const cav_channel *channel, const double *record,
                       double *dq) {
  const double *q;
  const cav_joint *joint = &m->joint[channel->object];
  int nv = m->nv, d = joint->dof, at = joint->q;
  if (channel->kind != CAV_CHANNEL_ROTATION) {
    for (int k = 0; k < channel->ncolumn; k++) dq[k * nv + d + k] = 1;
    return;
  }
  if (joint->type == CAV_JOINT_FREE) d += 3, at += 3;
  double phi[3], J[9];
  cav_state_point(state, &q, NULL, NULL);
  cav_rotation_between(record, q + at, phi);
  cav_rotation_jacobian_inverse(phi, J);
  for (int k = 0; k < 3; k++) memcpy(dq + k * nv + d, J + 3 * k, 3 * sizeof *dq);
}

static cav_status sensor_rows(const cav_model *m, cav_scratch *s, const cav_channel *channel, const double *record,
                              double *dq, double *dn) {
  const cav_sensor *sensor = &channel->sensor;
  size_t nv = (size_t)m->nv, all = (size_t)sensor->dim * nv;
  double *by_q = s->derivative, *by_next = by_q + all, value[CAV_SENSOR_DIM_MAX];
  cav_status status = cav_sensor_derivatives(m, s->state, sensor, by_q, by_next);
  if (status) return status;
  if (cav_channel_rotates(channel)) {
    // a quaternion depends on q alone
    cav_sensor_read(m, s->state, sensor, value);
    cav_rotation_rows(m->nv, record, value, by_q, dq);
    return CAV_OK;
  }
  for (int c = 0; c < channel->ncolumn; c++) {
    memcpy(dq + (size_t)c * nv, by_q + (size_t)component_of(channel, c) * nv, nv * sizeof *dq);
    memcpy(dn + (size_t)c * nv, by_next + (size_t)component_of(channel, c) * nv, nv * sizeof *dn);
  }
  return CAV_OK;
}

cav_status cav_recorded_derivatives(const cav_transcription *tr, cav_scratch *s, const cav_term *term, int t,
                                    double *dq, double *dn) {
  const cav_track *track = term->track;
  const cav_model *m = tr->model;
  size_t nv = (size_t)m->nv, all = (size_t)cav_recorded_dim(track) * nv;
  memset(dq, 0, all * sizeof *dq);
  memset(dn, 0, all * sizeof *dn);
  for (int i = 0; i < track->nchannel; i++) {
    const cav_channel *channel = &track->channel[i];
    size_t dim = (size_t)cav_channel_dim(channel);
    double record[CAV_SENSOR_DIM_MAX], unit = 1 / (channel->sd * term->scale);
    int seen = cav_track_sample(track, channel, cav_knot_time(tr, t), tr->problem->timestep, record);
    cav_status status = CAV_OK;
    if (seen && channel->kind == CAV_CHANNEL_MARKER) marker_rows(m, s->state, channel, dq);
    if (seen && channel->kind == CAV_CHANNEL_SENSOR) status = sensor_rows(m, s, channel, record, dq, dn);
    if (seen && channel->kind != CAV_CHANNEL_MARKER && channel->kind != CAV_CHANNEL_SENSOR)
      joint_rows(m, s->state, channel, record, dq);
    if (status) return status;
    for (size_t k = 0; k < dim * nv; k++) {
      int gap = !seen || isnan(record[cav_channel_rotates(channel) ? 0 : k / nv]);
      dq[k] *= gap ? 0 : unit;
      dn[k] *= gap ? 0 : unit;
    }
    dq += dim * nv;
    dn += dim * nv;
  }
  return CAV_OK;
}
