/// Charts and verdict lines of a result's page; view.c draws them. Efforts are fractions of an actuator's own limit,
/// contact forces and unactuated forces fractions of the weight.
#include "page.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "certificate.h"
#include "file.h"
#include "view.h"

// charts on their way: series, and the numbers that they point at
typedef struct charts {
  int n, nknot;
  cav_view_series *series;
  double *value;
} charts;

// a new chart; returns where its values go
static double *add(charts *c, const char *group, const char *name, const char *unit, double lower, double upper) {
  double *value = c->value + (size_t)c->n * (size_t)c->nknot;
  c->series[c->n++] = (cav_view_series){group, name, unit, value, lower, upper};
  return value;
}

static void add_whole(charts *c, const cav_model *model, const cav_trajectory *trajectory, const cav_forces *forces,
                      double weight) {
  double *height = add(c, "Motion", "height of the centre of mass", "m", NAN, NAN);
  double *press = add(c, "Motion", "contact forces, vertical", "weight", NAN, NAN);
  double *effort = add(c, "Motion", "largest effort", "of its limit", -INFINITY, 1);
  double *helper = add(c, "Motion", "unactuated force", "weight", NAN, NAN);
  double *depth = add(c, "Motion", "penetration", "mm", NAN, NAN);
  for (int t = 0, i = 0; t < c->nknot; t++) {
    height[t] = forces->com[3 * t + 2];
    press[t] = t + 1 < c->nknot || isfinite(forces->unactuated[t]) ? 0 : NAN;
    for (; i < forces->nforce && forces->force[i].knot == t; i++) {
      // forces between limbs cancel: only those from what does not move count
      int from_world = model->geom[forces->force[i].geom1].link == 0,
          on_world = model->geom[forces->force[i].geom2].link == 0;
      press[t] += (from_world - on_world) * forces->force[i].force[2] / weight;
    }
    effort[t] = model->nu && isfinite(forces->control[t * model->nu]) ? 0 : NAN;
    for (int a = 0; a < model->nu; a++) {
      double range[2], u = forces->control[t * model->nu + a];
      cav_actuator_effort_range(model, a, range);
      double fraction = u > 0 ? u / range[1] : u / range[0];
      if (isfinite(fraction)) effort[t] = fmax(effort[t], fraction);
    }
    helper[t] = forces->unactuated[t] / weight;
    depth[t] = 1e3 * forces->depth[t];
  }
  (void)trajectory;
}

static void add_each(charts *c, const cav_model *model, const cav_trajectory *trajectory, const cav_forces *forces) {
  for (int a = 0; a < model->nu; a++) {
    double range[2];
    cav_actuator_effort_range(model, a, range);
    double *value = add(c, "Controls", model->actuator[a].name, "", range[0], range[1]);
    for (int t = 0; t < c->nknot; t++) value[t] = forces->control[t * model->nu + a];
  }
  for (int j = 0; j < model->njoint; j++) {
    const cav_joint *joint = &model->joint[j];
    if (joint->type != CAV_JOINT_HINGE && joint->type != CAV_JOINT_SLIDE) continue;
    double scale = joint->type == CAV_JOINT_HINGE ? 180 / M_PI : 1;
    double *value = add(c, "Joints", joint->name, joint->type == CAV_JOINT_HINGE ? "deg" : "m",
                        joint->limited ? scale * joint->range[0] : NAN, joint->limited ? scale * joint->range[1] : NAN);
    for (int t = 0; t < c->nknot; t++) value[t] = scale * trajectory->q[t * model->nq + joint->q];
  }
}

// lines of the certificate, and the solver's time
static int verdict_lines(const cav_verdict *verdict, cav_certificate_line *told, cav_view_line *line,
                         char seconds[64]) {
  int n = 0, count = cav_certificate_lines(verdict, told);
  if (!verdict->certified) line[n++] = (cav_view_line){"not certified", verdict->reason, -1};
  if (!verdict->achieved) line[n++] = (cav_view_line){"misses", verdict->missed, -1};
  for (int i = 0; i < count; i++) line[n++] = (cav_view_line){told[i].label, told[i].value, told[i].passed};
  if (isnan(verdict->solve_seconds)) return n;
  snprintf(seconds, 64, "%.1f s, %d iterations", verdict->solve_seconds, verdict->iterations);
  line[n++] = (cav_view_line){"solved in", seconds, -1};
  return n;
}

cav_status cav_page_write(const char *path, const cav_problem *problem, const cav_trajectory *trajectory,
                          const cav_forces *forces, const cav_verdict *verdict, cav_error *error) {
  const cav_model *model = problem->model;
  const double *g = model->gravity;
  double weight = model->mass * sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
  size_t most = (size_t)(5 + model->nu + model->njoint), nknot = (size_t)trajectory->nknot;
  charts c = {0, trajectory->nknot, calloc(most, sizeof *c.series), calloc(most * nknot, sizeof *c.value)};
  cav_view_force *force = calloc((size_t)forces->nforce + 1, sizeof *force);
  if (!c.series || !c.value || !force) {
    free(c.series);
    free(c.value);
    free(force);
    return cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory for the page", path);
  }
  add_whole(&c, model, trajectory, forces, weight > 0 ? weight : 1);
  add_each(&c, model, trajectory, forces);
  for (int i = 0; i < forces->nforce; i++) {
    memcpy(force[i].pos, forces->force[i].pos, sizeof force[i].pos);
    memcpy(force[i].force, forces->force[i].force, sizeof force[i].force);
  }
  cav_certificate_line told[CAV_CERTIFICATE_LINES];
  cav_view_line line[CAV_CERTIFICATE_LINES + 3];
  char seconds[64], title[300];
  snprintf(title, sizeof title, "%.140s on %.140s", problem->name, model->name);
  cav_view_input input = {.title = title,
                          .nknot = trajectory->nknot,
                          .timestep = trajectory->timestep,
                          .q = trajectory->q,
                          .nforce = forces->count,
                          .force = force,
                          .nseries = c.n,
                          .series = c.series,
                          .nline = verdict ? verdict_lines(verdict, told, line, seconds) : 0,
                          .line = line};
  cav_status status = cav_view_write(path, model, &input, error);
  free(c.series);
  free(c.value);
  free(force);
  return status;
}
