/// How good a motion is, from its configurations alone: depth, slides of contacts, floating, jerk, and what efforts and what
/// force from nowhere it takes (support.c).
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "math3.h"
#include "support.h"

static const double deep = 0.01, touching = 0.005, afloat = 0.02; // m
static const double look = 0.05;                                  // m: contacts are listed up to this gap
static const double sliding = 0.01;                               // m/s
static const double borne = 0.5;                                  // of gravity

static const cav_quality_rule rules[] = {
#define QUALITY_RULE(name, unit, bar, text) {#name, unit, bar, text, offsetof(cav_quality, name)},
    CAV_QUALITIES(QUALITY_RULE)
#undef QUALITY_RULE
};

const cav_quality_rule *cav_quality_rules(int *n) {
  *n = (int)(sizeof rules / sizeof *rules);
  return rules;
}

typedef struct measure {
  const cav_model *model;
  const cav_trajectory *motion;
  cav_quality *quality;
  cav_support *support;
  cav_state *state;    // lists contacts up to the look
  cav_contact *before; // contacts of the knot before
  cav_pose *pose;      // [nlink] links at it
  int nbefore, room;
  double *com, *links; // [nknot*3] of all; [nknot*nlink*3]
  double *lowest;      // [nknot] least gap to what is external, at most the look
  int steps_in_contact;
} measure;

static const double *row(const double *rows, int t, int n) { return rows + (size_t)t * (size_t)n; }

// fastest slide of the contacts of the knot before that are still there; *any: there is one
static double slide(const measure *m, int *any) {
  double most = 0;
  for (int i = 0; i < m->nbefore; i++) {
    const cav_contact *c = &m->before[i];
    double at[2][3], way[3], local[3];
    if (c->dist > touching || !m->model->pair[c->pair].external) continue;
    for (int k = 0; k < 2; k++) {
      int link = k ? c->link2 : c->link1;
      sub3(way, c->pos, m->pose[link].pos);
      rotate_back(local, m->pose[link].rotation, way);
      transform(at[k], m->state->link[link].pos, m->state->link[link].rotation, local);
    }
    sub3(way, at[1], at[0]);
    // the normal of the knot before: what it moves along that opens or closes
    double normal = dot3(c->frame, way);
    if (c->dist + normal > touching) continue;
    *any = 1;
    axpy3(way, way, -normal, c->frame);
    most = fmax(most, norm3(way) / m->motion->timestep);
  }
  return most;
}

static cav_status keep_contacts(measure *m) {
  if (m->state->ncontact > m->room) {
    cav_contact *larger = realloc(m->before, 2 * (size_t)m->state->ncontact * sizeof *larger);
    if (!larger) return CAV_NO_MEMORY;
    m->before = larger, m->room = 2 * m->state->ncontact;
  }
  m->nbefore = m->state->ncontact;
  if (m->nbefore) memcpy(m->before, m->state->contact, (size_t)m->nbefore * sizeof *m->before);
  memcpy(m->pose, m->state->link, (size_t)m->model->nlink * sizeof *m->pose);
  return CAV_OK;
}

static cav_status measure_knot(measure *m, int t) {
  cav_quality *q = m->quality;
  double depth = 0, least = look;
  int any = 0;
  cav_status status = cav_position(m->model, m->state, row(m->motion->q, t, m->motion->nq));
  if (status) return status;
  for (int i = 0; i < m->state->ncontact; i++) {
    const cav_contact *c = &m->state->contact[i];
    if (m->model->pair[c->pair].external)
      depth = fmax(depth, -c->dist), least = fmin(least, c->dist);
    else
      q->self_penetration = fmax(q->self_penetration, -1e3 * c->dist);
  }
  m->lowest[t] = least;
  q->penetration = fmax(q->penetration, 1e3 * depth);
  q->penetration_fraction += depth > deep;
  if (t > 0) {
    double speed = slide(m, &any);
    m->steps_in_contact += any;
    q->skating = fmax(q->skating, 100 * speed), q->skating_fraction += speed > sliding;
  }
  double *com = m->com + 3 * t;
  cav_momentum(m->model, m->state, row(m->motion->v, t, m->motion->nv), com, NULL, NULL);
  memcpy(m->links + 3 * (size_t)t * (size_t)m->model->nlink, m->state->com,
         3 * (size_t)m->model->nlink * sizeof *m->links);
  return keep_contacts(m);
}

// third differences of places
static double jerk(const measure *m) {
  size_t n = 3 * (size_t)m->model->nlink;
  double sum = 0, h3 = pow(m->motion->timestep, 3);
  for (int t = 3; t < m->motion->nknot; t++)
    for (size_t i = 3; i < n; i++) {
      const double *x = m->links + (size_t)(t - 3) * n + i;
      sum += pow((x[3 * n] - 3 * x[2 * n] + 3 * x[n] - x[0]) / h3, 2);
    }
  return m->model->nlink > 1 ? sqrt(sum / ((m->motion->nknot - 3) * (m->model->nlink - 1.0))) : 0;
}

static void measure_floating(const measure *m) {
  const double *g = m->model->gravity;
  double h2 = m->motion->timestep * m->motion->timestep, pull = norm3(g);
  for (int t = 1; t + 1 < m->motion->nknot; t++) {
    const double *c = m->com + 3 * t;
    double a[3];
    for (int k = 0; k < 3; k++) a[k] = (c[k + 3] - 2 * c[k] + c[k - 3]) / h2 - g[k];
    if (!(norm3(a) > borne * pull)) continue;
    // what is higher than the look counts as that
    m->quality->floating = fmax(m->quality->floating, 1e3 * m->lowest[t]);
    m->quality->floating_fraction += m->lowest[t] > afloat;
  }
}

// what is borne and what is not, of all steps
static cav_status measure_forces(const measure *m) {
  cav_quality *q = m->quality;
  const cav_trajectory *motion = m->motion;
  int n = motion->nknot - 2;
  for (int t = 1; t <= n; t++) {
    double residual, excess;
    cav_status status =
        cav_support_find(m->support, m->state, touching, row(motion->q, t, motion->nq), row(motion->v, t, motion->nv),
                         row(motion->v, t + 1, motion->nv), &residual, &excess);
    if (status) return status;
    q->residual += residual * residual / n;
    q->residual_worst = fmax(q->residual_worst, 100 * residual);
    q->torque_excess = fmax(q->torque_excess, 100 * excess), q->torque_excess_fraction += 100.0 * (excess > 1e-3) / n;
  }
  q->residual = 100 * sqrt(q->residual);
  return CAV_OK;
}

static cav_status run(measure *m) {
  int n = m->motion->nknot;
  cav_status status = CAV_OK;
  for (int t = 0; t < n && !status; t++) status = measure_knot(m, t);
  if (status) return status;
  cav_quality *q = m->quality;
  q->penetration_fraction *= 100.0 / n;
  q->skating_fraction *= m->steps_in_contact ? 100.0 / m->steps_in_contact : 0;
  q->jerk = jerk(m);
  measure_floating(m);
  q->floating_fraction *= 100.0 / (n - 2);
  return measure_forces(m);
}

cav_status cav_quality_measure(const cav_model *model, const cav_trajectory *motion, const cav_options *law,
                               cav_quality *quality, cav_error *error) {
  *quality = (cav_quality){0};
  if (motion->nq != model->nq || motion->nv != model->nv || motion->nknot < 4)
    return cav_file_fail(error, CAV_BAD_INPUT, 0,
                         "expected four knots or more of the model's %d coordinates, got %d of %d", model->nq,
                         motion->nknot, motion->nq);
  cav_trajectory *copy = cav_trajectory_copy(motion);
  measure m = {.model = model, .motion = copy, .quality = quality};
  size_t n = (size_t)motion->nknot;
  m.state = cav_state_new(model);
  m.support = cav_support_new(model, law, motion->timestep);
  m.pose = malloc((size_t)model->nlink * sizeof *m.pose);
  m.com = malloc(n * (4 + 3 * (size_t)model->nlink) * sizeof *m.com);
  cav_status status = copy && m.state && m.support && m.pose && m.com ? CAV_OK : CAV_NO_MEMORY;
  if (!status) {
    m.lowest = m.com + 3 * n, m.links = m.lowest + n;
    cav_trajectory_velocities(model, copy);
    cav_state_look(m.state, look);
    status = run(&m);
  }
  if (status) cav_file_fail(error, status, 0, "the motion cannot be measured: %s", cav_status_name(status));
  cav_trajectory_free(copy);
  cav_state_free(m.state);
  cav_support_free(m.support);
  free(m.pose), free(m.before), free(m.com);
  return status;
}
