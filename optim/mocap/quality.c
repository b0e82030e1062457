/// How good a motion is, from its configurations alone: depth, slides of contacts, floating, jerk, and what efforts and what
/// force from nowhere it takes (support.c).
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "manner.h"
#include "math3.h"
#include "slide.h"
#include "support.h"

static const double deep = 0.01, touching = 0.005, afloat = 0.02; // m
static const double look = 0.05;                                  // m: contacts are listed up to this gap
static const double sliding = 0.01;                               // m/s
static const double frame = 1.0 / 30;                             // s: over which motions are seen to skate
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
  cav_state *state; // lists contacts up to the look
  cav_slide *slide;
  double *com, *links; // [nknot*3] of all; [nknot*nlink*3]
  double *lowest;      // [nknot] least gap to what is external, at most the look
} measure;

static const double *row(const double *rows, int t, int n) { return rows + (size_t)t * (size_t)n; }

static cav_status measure_knot(measure *m, int t) {
  cav_quality *q = m->quality;
  double depth = 0, least = look;
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
  double *com = m->com + 3 * t;
  cav_momentum(m->model, m->state, row(m->motion->v, t, m->motion->nv), com, NULL, NULL);
  memcpy(m->links + 3 * (size_t)t * (size_t)m->model->nlink, m->state->com,
         3 * (size_t)m->model->nlink * sizeof *m->links);
  return cav_slide_add(m->slide, m->state);
}

// fastest slide over so many steps, cm/s, and how many of them, of those that something touches through, slide, %
static void measure_skating(const measure *m, int steps, double *fastest, double *fraction) {
  double time = steps * m->motion->timestep;
  int touched = 0, slid = 0;
  for (int t = 0; t + steps < m->motion->nknot; t++) {
    double way;
    if (!cav_slide_over(m->slide, t, steps, &way)) continue;
    touched++;
    slid += way > sliding * time;
    *fastest = fmax(*fastest, 100 * way / time);
  }
  *fraction = touched ? 100.0 * slid / touched : 0;
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
    double residual, excess, effort;
    cav_status status =
        cav_support_find(m->support, m->state, touching, row(motion->q, t, motion->nq), row(motion->v, t, motion->nv),
                         row(motion->v, t + 1, motion->nv), &residual, &excess, &effort);
    if (status) return status;
    q->residual += residual * residual / n;
    q->effort += effort / n;
    q->residual_worst = fmax(q->residual_worst, 100 * residual);
    q->torque_excess = fmax(q->torque_excess, 100 * excess), q->torque_excess_fraction += 100.0 * (excess > 1e-3) / n;
  }
  q->residual = 100 * sqrt(q->residual), q->effort = 100 * sqrt(q->effort);
  return CAV_OK;
}

static cav_status run(measure *m) {
  int n = m->motion->nknot;
  cav_status status = CAV_OK;
  for (int t = 0; t < n && !status; t++) status = measure_knot(m, t);
  if (status) return status;
  cav_quality *q = m->quality;
  q->penetration_fraction *= 100.0 / n;
  // of as many steps as make a frame, and of one
  measure_skating(m, (int)fmax(1, fmin(n - 1, ceil(frame / m->motion->timestep - 1e-6))), &q->skating,
                  &q->skating_fraction);
  measure_skating(m, 1, &q->skating_step, &q->skating_step_fraction);
  q->jerk = jerk(m);
  measure_floating(m);
  status = cav_manner_measure(m->model, m->motion, m->com, m->state, q);
  if (status) return status;
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
  m.slide = cav_slide_new(model, motion->nknot);
  m.com = malloc(n * (4 + 3 * (size_t)model->nlink) * sizeof *m.com);
  cav_status status = copy && m.state && m.support && m.slide && m.com ? CAV_OK : CAV_NO_MEMORY;
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
  cav_slide_free(m.slide);
  free(m.com);
  return status;
}
