/// A motion as arrays of NumPy: what MuJoCo and Isaac users load. Rows are samples; contacts are those of every knot's
/// step, contact_start[i] .. contact_start[i + 1] of sample i.
#include <stdlib.h>
#include <string.h>

#include "archive.h"
#include "exchange.h"
#include "file.h"

// numbers of a sample, [n][width], from a row each
static double *rows(const cav_recording *r, const double *from, int width, int by_knot) {
  double *x = malloc(((size_t)r->n * (size_t)width + 1) * sizeof *x);
  for (int i = 0; i < r->n && x; i++)
    memcpy(x + i * width, from + (by_knot ? r->knot[i] : i) * width, (size_t)width * sizeof *x);
  return x;
}

static void add_rows(cav_archive *a, const cav_recording *r, const char *name, const double *from, int width,
                     int by_knot) {
  double *x = rows(r, from, width, by_knot);
  if (x)
    cav_archive_doubles(a, name, 2, (int[]){r->n, width}, x);
  else
    a->failed = 1;
  free(x);
}

static void add_motion(cav_archive *a, const cav_recording *r) {
  const cav_model *m = r->model;
  double *time = malloc(((size_t)r->n + 1) * sizeof *time), *effort = rows(r, r->forces->control, m->nu, 1);
  if (!time || !effort) {
    a->failed = 1;
  } else {
    for (int i = 0; i < r->n; i++) {
      time[i] = i * r->timestep;
      for (int k = 0; k < m->nu; k++) effort[i * m->nu + k] *= m->actuator[k].unit;
    }
    cav_archive_doubles(a, "time", 1, &r->n, time);
    cav_archive_doubles(a, "actuator_force", 2, (int[]){r->n, m->nu}, effort);
  }
  free(time);
  free(effort);
  add_rows(a, r, "qpos", r->motion->q, m->nq, 0);
  add_rows(a, r, "qvel", r->motion->v, m->nv, 0);
  add_rows(a, r, "ctrl", r->forces->input, m->nu, 1);
  add_rows(a, r, "qfrc", r->motion->u, m->nv, 0);
}

// world poses of bodies: MuJoCo's xpos and xquat
static void add_poses(cav_archive *a, const cav_recording *r, const cav_pose *pose) {
  int n = r->model->nbody;
  double *pos = malloc((size_t)r->n * (size_t)n * 3 * sizeof *pos),
         *quat = malloc((size_t)r->n * (size_t)n * 4 * sizeof *quat);
  if (!pos || !quat) a->failed = 1;
  for (int i = 0; i < r->n && pos && quat; i++) {
    for (int b = 0; b < n; b++) {
      const cav_body *body = &r->model->body[b];
      const cav_pose *link = &pose[i * r->model->nlink + body->link];
      double *p = pos + 3 * (i * n + b), *o = quat + 4 * (i * n + b);
      const double *w = link->quat, *x = body->quat, *R = link->rotation;
      for (int k = 0; k < 3; k++)
        p[k] = link->pos[k] + R[3 * k] * body->pos[0] + R[3 * k + 1] * body->pos[1] + R[3 * k + 2] * body->pos[2];
      o[0] = w[0] * x[0] - w[1] * x[1] - w[2] * x[2] - w[3] * x[3];
      o[1] = w[0] * x[1] + w[1] * x[0] + w[2] * x[3] - w[3] * x[2];
      o[2] = w[0] * x[2] - w[1] * x[3] + w[2] * x[0] + w[3] * x[1];
      o[3] = w[0] * x[3] + w[1] * x[2] - w[2] * x[1] + w[3] * x[0];
    }
  }
  if (pos && quat) {
    cav_archive_doubles(a, "xpos", 3, (int[]){r->n, n, 3}, pos);
    cav_archive_doubles(a, "xquat", 3, (int[]){r->n, n, 4}, quat);
  }
  free(pos);
  free(quat);
}

static void add_contacts(cav_archive *a, const cav_recording *r) {
  const cav_forces *f = r->forces;
  int *first = calloc((size_t)f->nknot + 1, sizeof *first), *start = calloc((size_t)r->n + 1, sizeof *start), n = 0;
  for (int t = 0; t < f->nknot && first; t++) first[t + 1] = first[t] + f->count[t];
  for (int i = 0; i < r->n && start; i++) start[i] = n, n += f->count[r->knot[i]];
  int *geom = malloc(((size_t)n * 2 + 1) * sizeof *geom);
  double *x = malloc(((size_t)n * 7 + 1) * sizeof *x);
  if (!first || !start || !geom || !x) {
    a->failed = 1;
  } else {
    start[r->n] = n;
    double *pos = x, *force = x + 3 * (size_t)n, *gap = x + 6 * (size_t)n;
    for (int i = 0; i < r->n; i++) {
      for (int k = start[i]; k < start[i + 1]; k++) {
        const cav_contact_force *c = &f->force[first[r->knot[i]] + k - start[i]];
        geom[2 * k] = c->geom1, geom[2 * k + 1] = c->geom2;
        memcpy(pos + 3 * k, c->pos, sizeof c->pos);
        memcpy(force + 3 * k, c->force, sizeof c->force);
        gap[k] = c->gap;
      }
    }
    cav_archive_ints(a, "contact_start", 1, (int[]){r->n + 1}, start);
    cav_archive_ints(a, "contact_geom", 2, (int[]){n, 2}, geom);
    cav_archive_doubles(a, "contact_pos", 2, (int[]){n, 3}, pos);
    cav_archive_doubles(a, "contact_force", 2, (int[]){n, 3}, force);
    cav_archive_doubles(a, "contact_dist", 1, &n, gap);
  }
  free(first), free(start), free(geom), free(x);
}

static void add_names(cav_archive *a, const cav_model *m) {
  int most = m->nbody + m->ngeom + m->njoint + m->nu + 1;
  const char **name = malloc((size_t)most * sizeof *name);
  char(*label)[CAV_GEOM_LABEL] = malloc((size_t)m->ngeom * sizeof *label + 1);
  int *qpos = malloc((2 * (size_t)m->njoint + 1) * sizeof *qpos);
  if (!name || !label || !qpos) {
    a->failed = 1;
  } else {
    static const char *const types[] = {"free", "ball", "slide", "hinge"};
    for (int i = 0; i < m->nbody; i++) name[i] = i || *m->body[i].name ? m->body[i].name : "world";
    cav_archive_texts(a, "body_names", m->nbody, name);
    for (int i = 0; i < m->ngeom; i++) name[i] = cav_geom_label(m, i, label[i]);
    cav_archive_texts(a, "geom_names", m->ngeom, name);
    for (int i = 0; i < m->nu; i++) name[i] = m->actuator[i].name;
    cav_archive_texts(a, "actuator_names", m->nu, name);
    for (int i = 0; i < m->njoint; i++) name[i] = m->joint[i].name;
    cav_archive_texts(a, "joint_names", m->njoint, name);
    for (int i = 0; i < m->njoint; i++)
      name[i] = types[m->joint[i].type], qpos[i] = m->joint[i].q, qpos[m->njoint + i] = m->joint[i].dof;
    cav_archive_texts(a, "joint_types", m->njoint, name);
    cav_archive_ints(a, "joint_qposadr", 1, &m->njoint, qpos);
    cav_archive_ints(a, "joint_dofadr", 1, &m->njoint, qpos + m->njoint);
  }
  free(name), free(label), free(qpos);
}

cav_status cav_exchange_write_npz(const cav_recording *r, const char *path, char note[CAV_EXCHANGE_NOTE],
                                  cav_error *error) {
  cav_pose *pose = cav_recording_poses(r, error);
  if (!pose) return error->status;
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (!status) {
    cav_archive *a = calloc(1, sizeof *a);
    if (a) {
      a->out = file.stream;
      add_motion(a, r);
      add_poses(a, r, pose);
      add_contacts(a, r);
      add_names(a, r->model);
      cav_archive_end(a);
    }
    if (!a || a->failed) {
      cav_file_abandon(&file);
      status = a && a->failed == 2
                   ? cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: more than 2 GB; ask for a lower --rate", path)
                   : cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory to write the file", path);
    } else {
      status = cav_file_end(&file, error);
    }
    free(a);
  }
  *note = 0;
  free(pose);
  return status;
}
