/// Contact forces of a motion: inverse dynamics at every knot, impulses over the step, in world axes. Contacts that the
/// smoothed law sees from afar press with next to nothing; those below a millionth of the weight are not listed.
#include "forces.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "file.h"

static const double loaded = 1e-6; // fraction of weight

void cav_forces_free(cav_forces *forces) {
  if (!forces) return;
  free(forces->count);
  free(forces->force);
  free(forces->u);
  free(forces->control);
  free(forces->input);
  free(forces->unactuated);
  free(forces->com);
  free(forces->depth);
  free(forces);
}

static cav_forces *make(const cav_model *model, int nknot) {
  cav_forces *f = calloc(1, sizeof *f);
  if (!f) return NULL;
  size_t n = (size_t)nknot;
  f->nknot = nknot;
  f->nu = model->nu;
  f->count = calloc(n, sizeof *f->count);
  f->u = calloc(n * (size_t)model->nv + 1, sizeof *f->u);
  f->control = calloc(n * (size_t)model->nu + 1, sizeof *f->control);
  f->input = calloc(n * (size_t)model->nu + 1, sizeof *f->input);
  f->unactuated = calloc(n, sizeof *f->unactuated);
  f->com = calloc(3 * n, sizeof *f->com);
  f->depth = calloc(n, sizeof *f->depth);
  if (f->count && f->u && f->control && f->input && f->unactuated && f->com && f->depth) return f;
  cav_forces_free(f);
  return NULL;
}

// loaded contacts of the state's last evaluation; 0 if memory runs out
static int note_contacts(cav_forces *f, const cav_model *model, const cav_state *state, int knot, double least) {
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    double h = state->options.timestep;
    if (-c->dist > f->depth[knot]) f->depth[knot] = -c->dist;
    if (!(c->impulse[0] / h > least)) continue;
    // room doubles: a power of two is full
    if ((f->nforce & (f->nforce - 1)) == 0) {
      cav_contact_force *more = realloc(f->force, 2 * ((size_t)f->nforce + 1) * sizeof *more);
      if (!more) return 0;
      f->force = more;
    }
    cav_contact_force *at = &f->force[f->nforce++];
    *at = (cav_contact_force){
        .knot = knot, .geom1 = model->pair[c->pair].geom1, .geom2 = model->pair[c->pair].geom2, .gap = c->dist};
    memcpy(at->pos, c->pos, sizeof at->pos);
    memcpy(at->normal, c->frame, sizeof at->normal);
    at->friction = c->dim >= 3 ? c->friction[0] : 0;
    for (int k = 0; k < 3; k++) {
      for (int r = 0; r < (c->dim < 3 ? c->dim : 3); r++) at->force[k] += c->frame[3 * r + k] * c->impulse[r] / h;
    }
    f->count[knot]++;
  }
  return 1;
}

// one knot that has a next velocity
static cav_status note_knot(cav_forces *f, const cav_model *model, cav_state *state, const cav_trajectory *trajectory,
                            int t, const double *next, double *residual, double least) {
  double *u = f->u + t * model->nv;
  cav_status status = cav_inverse(model, state, trajectory->q + t * model->nq, trajectory->v + t * model->nv, next, u);
  if (status) return status;
  cav_actuation(model, state, u, residual, f->control + t * model->nu);
  cav_actuation_inputs(model, state, trajectory->v + t * model->nv, f->control + t * model->nu,
                       f->input + t * model->nu);
  for (int d = 0; d < model->nv; d++) f->unactuated[t] = fmax(f->unactuated[t], fabs(residual[d]));
  return note_contacts(f, model, state, t, least) ? CAV_OK : CAV_NO_MEMORY;
}

cav_forces *cav_forces_new(const cav_model *model, const cav_trajectory *trajectory, const cav_options *contact,
                           int at_rest, cav_error *error) {
  int n = trajectory->nknot, nv = model->nv;
  cav_state *state = cav_state_new(model);
  cav_forces *f = make(model, n);
  double *rest = calloc((size_t)(2 * nv) + 1, sizeof *rest);
  cav_status status = state && f && rest ? CAV_OK : CAV_NO_MEMORY;
  if (!status) state->options = *contact;
  const double *g = model->gravity;
  double least = loaded * model->mass * sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
  int t = 0;
  for (; t < n && !status; t++) {
    const double *next = t + 1 < n ? trajectory->v + (t + 1) * nv : rest;
    if (!status) state->options.stops = contact->stops && t + 1 == n && at_rest;
    if (t + 1 < n || at_rest) {
      status = note_knot(f, model, state, trajectory, t, next, rest + nv, least);
    } else {
      status = cav_position(model, state, trajectory->q + t * model->nq);
      for (int d = 0; d < nv; d++) f->u[t * nv + d] = NAN;
      for (int a = 0; a < model->nu; a++) f->control[t * model->nu + a] = f->input[t * model->nu + a] = NAN;
      f->unactuated[t] = NAN;
    }
    if (!status) cav_momentum(model, state, trajectory->v + t * nv, f->com + 3 * t, NULL, NULL);
  }
  free(rest);
  cav_state_free(state);
  if (!status) return f;
  cav_file_fail(
      error, status, 0,
      status == CAV_NO_MEMORY ? "no memory for the contact forces" : "contact forces cannot be evaluated at knot %d",
      t - 1);
  cav_forces_free(f);
  return NULL;
}

static void write_geom(FILE *out, const cav_model *model, int geom) {
  char label[CAV_GEOM_LABEL];
  cav_table_write_text(out, cav_geom_label(model, geom, label));
}

cav_status cav_forces_write(const char *path, const cav_model *model, const cav_trajectory *trajectory,
                            const cav_forces *forces, cav_error *error) {
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  FILE *out = file.stream;
  fputs("knot,time,geom1,geom2,pos_x,pos_y,pos_z,force_x,force_y,force_z,gap\n", out);
  for (int i = 0; i < forces->nforce; i++) {
    const cav_contact_force *f = &forces->force[i];
    const double value[7] = {f->pos[0], f->pos[1], f->pos[2], f->force[0], f->force[1], f->force[2], f->gap};
    fprintf(out, "%d,", f->knot);
    cav_table_write_number(out, f->knot * trajectory->timestep);
    fputc(',', out);
    write_geom(out, model, f->geom1);
    fputc(',', out);
    write_geom(out, model, f->geom2);
    for (int k = 0; k < 7; k++) {
      fputc(',', out);
      cav_table_write_number(out, value[k]);
    }
    fputc('\n', out);
  }
  return cav_file_end(&file, error);
}

// a column of an actuator, by its number where it has no name
static void write_column(FILE *out, const cav_model *model, const char *what, int actuator) {
  char name[300];
  const char *own = model->actuator[actuator].name;
  if (*own)
    snprintf(name, sizeof name, "%s_%.256s", what, own);
  else
    snprintf(name, sizeof name, "%s_#%d", what, actuator);
  fputc(',', out);
  cav_table_write_text(out, name);
}

cav_status cav_controls_write(const char *path, const cav_model *model, const cav_trajectory *trajectory,
                              const cav_forces *forces, cav_error *error) {
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  FILE *out = file.stream;
  fputs("time", out);
  for (int a = 0; a < model->nu; a++)
    write_column(out, model, model->actuator[a].activation == CAV_ACTIVATION_NONE ? "ctrl" : "act", a);
  for (int a = 0; a < model->nu; a++) write_column(out, model, "force", a);
  fputc('\n', out);
  // the last knot of a motion that goes on after it has no forces
  for (int t = 0; t < forces->nknot && (model->nv == 0 || isfinite(forces->u[t * model->nv])); t++) {
    cav_table_write_number(out, t * trajectory->timestep);
    for (int k = 0; k < 2 * model->nu; k++) {
      int a = t * model->nu + k % model->nu;
      fputc(',', out);
      cav_table_write_number(
          out, k < model->nu ? forces->input[a] : model->actuator[k % model->nu].unit * forces->control[a]);
    }
    fputc('\n', out);
  }
  return cav_file_end(&file, error);
}

// the dofs of roots that the problem penalises forces on: no actuator moves them; dof [nv]. Returns their number, -1 if memory
// runs out
static int penalised_dofs(const cav_problem *problem, int *dof) {
  const cav_model *m = problem->model;
  cav_state *state = cav_state_new(m);
  double *unit = calloc(2 * (size_t)m->nv + 1, sizeof *unit), *left = unit ? unit + m->nv : NULL;
  int n = state && unit && cav_position(m, state, problem->q_start) == CAV_OK ? 0 : -1;
  for (int d = 0; n >= 0 && d < m->nv; d++) {
    const cav_joint *joint = &m->joint[m->dof[d].joint];
    int line = joint->type == CAV_JOINT_SLIDE || (joint->type == CAV_JOINT_FREE && d - joint->dof < 3);
    if (m->link[joint->link].parent != 0 || (line ? problem->residual.force : problem->residual.torque) == 0) continue;
    unit[d] = 1;
    cav_actuation(m, state, unit, left, NULL);
    unit[d] = 0;
    if (left[d] > 1 - 1e-9) dof[n++] = d;
  }
  free(unit);
  cav_state_free(state);
  return n;
}

static void write_residual_name(FILE *out, const cav_model *model, int d) {
  const cav_joint *joint = &model->joint[model->dof[d].joint];
  char name[300];
  int n = *joint->name ? snprintf(name, sizeof name, "residual_%.256s", joint->name)
                       : snprintf(name, sizeof name, "residual_#%d", model->dof[d].joint);
  int several = joint->type == CAV_JOINT_FREE || joint->type == CAV_JOINT_BALL;
  if (several) snprintf(name + n, sizeof name - (size_t)n, "_%d", d - joint->dof);
  fputc(',', out);
  cav_table_write_text(out, name);
}

cav_status cav_residual_write(const char *path, const cav_problem *problem, const cav_trajectory *trajectory,
                              const cav_forces *forces, cav_error *error) {
  const cav_model *model = problem->model;
  cav_file file;
  int *dof = malloc(((size_t)model->nv + 1) * sizeof *dof), n = dof ? penalised_dofs(problem, dof) : -1;
  cav_status status = n < 0 ? cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the residual forces")
                            : cav_file_begin(&file, path, error);
  if (!status) {
    fputs("time", file.stream);
    for (int k = 0; k < n; k++) write_residual_name(file.stream, model, dof[k]);
    fputc('\n', file.stream);
    for (int t = 0; t < forces->nknot && isfinite(forces->u[t * model->nv]); t++) {
      cav_table_write_number(file.stream, t * trajectory->timestep);
      for (int k = 0; k < n; k++) {
        fputc(',', file.stream);
        cav_table_write_number(file.stream, forces->u[t * model->nv + dof[k]]);
      }
      fputc('\n', file.stream);
    }
    status = cav_file_end(&file, error);
  }
  free(dof);
  return status;
}
