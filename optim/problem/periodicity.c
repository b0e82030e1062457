/// From one period of a cyclic motion to the next: reflect, turn about the vertical through the start's first free
/// joint, translate. Dynamics and ground must be blind to it: checked on the planes of the world and on gravity with
/// words of their own, and as a whole by the inverse dynamics at a few states, u(G q, P v, P v') = P u(q, v, v'), where
/// P is the tangent map. P is constant: free joints move linearly in world axes and turn in their own. Which joint is
/// whose image is mirror.c's.
#include "periodicity.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/dynamics.h"
#include "file.h"
#include "math3.h"

static const double near = 1e-6;       // m and fractions: what files leave open
static const double alike = 1e-6;      // fraction of the largest force by which two images may differ
static const double likeness = 0.05;   // the same of a model that is its image but for some millimetres
static const double golden = 0.618034; // states are drawn by its multiples
static const double inside = 0.02;     // rad or m from a limit, where it does not act
enum { STATES = 3 };

struct cav_periodicity {
  const cav_model *model;
  double world[9];    ///< what turns (or reflects) directions
  double rotation[4]; ///< the rotation alone, as a quaternion
  double centre[3], shift[3];
  int mirror;        ///< 1: images are not the identity
  double asymmetry;  ///< m, of the model beside its mirror image
  double forces;     ///< fraction of the largest by which forces of images differ
  cav_image *image;  ///< [njoint]
  double *along;     ///< [njoint] what the shift adds to slides
  int *link;         ///< [nlink]
  int entries;       ///< of P
  int *row, *column; ///< [entries]
  double *value;     ///< [entries]
};

// ---------------------------------------------------------------- applying

/// out := q0_image n^-1 q0^-1 q n
static void mirror_rotation(const double *q0_image, const double *n, const double *q0, const double *q, double *out) {
  double back[4], x[4];
  quat_conjugate(back, q0);
  quat_mul(x, back, q);
  quat_mul(x, x, n);
  quat_conjugate(back, n);
  quat_mul(x, back, x);
  quat_mul(out, q0_image, x);
}

/// World direction: way 1 by the map, -1 by its inverse, which is its transpose.
static void direction(const cav_periodicity *w, int way, const double *x, double *out) {
  for (int i = 0; i < 3; i++) {
    out[i] = 0;
    for (int k = 0; k < 3; k++) out[i] += (way > 0 ? w->world[3 * i + k] : w->world[3 * k + i]) * x[k];
  }
}

static void point(const cav_periodicity *w, int way, const double *p, double *out) {
  double arm[3];
  for (int k = 0; k < 3; k++) arm[k] = p[k] - w->centre[k] - (way < 0 ? w->shift[k] : 0);
  direction(w, way, arm, out);
  for (int k = 0; k < 3; k++) out[k] += w->centre[k] + (way > 0 ? w->shift[k] : 0);
}

void cav_periodicity_point(const cav_periodicity *periodicity, const double p[3], double out[3]) {
  point(periodicity, 1, p, out);
}

int cav_periodicity_link(const cav_periodicity *periodicity, int link) { return periodicity->link[link]; }

/// Orientation of a free or ball joint j with quaternion quat, to that of its image.
static void orientation(const cav_periodicity *w, int way, int j, const double *quat, double *out) {
  const cav_model *m = w->model;
  const cav_image *image = &w->image[j];
  int free = m->joint[j].type == CAV_JOINT_FREE ? 3 : 0;
  if (w->mirror) {
    const double *q0 = m->q0 + m->joint[j].q + free, *q0_image = m->q0 + m->joint[image->joint].q + free;
    // the image's image is the joint itself, by the inverse of its turn
    mirror_rotation(q0_image, image->rotation, q0, quat, out);
  } else if (free) {
    double rotation[4] = {w->rotation[0], way * w->rotation[1], way * w->rotation[2], way * w->rotation[3]};
    quat_mul(out, rotation, quat);
  } else {
    memcpy(out, quat, 4 * sizeof(double));
  }
}

void cav_periodicity_configuration(const cav_periodicity *periodicity, int way, const double *q, double *out) {
  const cav_model *m = periodicity->model;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    int other = periodicity->image[j].joint;
    const double *from = q + joint->q;
    double *to = out + m->joint[other].q;
    if (joint->type == CAV_JOINT_FREE) {
      point(periodicity, way, from, to);
      orientation(periodicity, way, j, from + 3, to + 3);
    } else if (joint->type == CAV_JOINT_BALL) {
      orientation(periodicity, way, j, from, to);
    } else {
      // the shift is that of the joint it lands on, or leaves
      double before = way < 0 ? periodicity->along[j] : 0, after = way > 0 ? periodicity->along[other] : 0;
      *to = m->q0[m->joint[other].q] + periodicity->image[j].sign * (*from - before - m->q0[joint->q]) + after;
    }
  }
}

void cav_periodicity_tangent(const cav_periodicity *periodicity, int way, const double *v, double *out) {
  memset(out, 0, (size_t)periodicity->model->nv * sizeof *out);
  for (int k = 0; k < periodicity->entries; k++) {
    int i = way > 0 ? periodicity->row[k] : periodicity->column[k],
        j = way > 0 ? periodicity->column[k] : periodicity->row[k];
    out[i] += periodicity->value[k] * v[j];
  }
}

void cav_periodicity_pattern(const cav_periodicity *periodicity, int way, const char *seen, char *out) {
  memset(out, 0, (size_t)periodicity->model->nv);
  for (int k = 0; k < periodicity->entries; k++) {
    int i = way > 0 ? periodicity->row[k] : periodicity->column[k],
        j = way > 0 ? periodicity->column[k] : periodicity->row[k];
    out[i] |= seen[j];
  }
}

void cav_periodicity_range(const cav_periodicity *periodicity, int joint, double range[2]) {
  const cav_model *m = periodicity->model;
  const cav_image *image = &periodicity->image[joint];
  const cav_joint *a = &m->joint[joint], *b = &m->joint[image->joint];
  int scalar = a->type == CAV_JOINT_HINGE || a->type == CAV_JOINT_SLIDE;
  for (int k = 0; k < 2; k++) {
    double other = b->range[scalar && image->sign < 0 ? 1 - k : k];
    if (scalar) other = m->q0[a->q] + image->sign * (other - m->q0[b->q]);
    range[k] = k ? fmin(a->range[k], other) : fmax(a->range[k], other);
  }
}

cav_trajectory *cav_periodicity_unroll(const cav_periodicity *periodicity, const cav_trajectory *period, int periods) {
  int last = period->nknot - 1, nq = period->nq, nv = period->nv;
  cav_trajectory *all = cav_trajectory_new(periodicity->model, periods * last + 1, period->timestep);
  if (!all) return NULL;
  memcpy(all->q, period->q, sizeof(double) * (size_t)last * (size_t)nq);
  memcpy(all->u, period->u, sizeof(double) * (size_t)last * (size_t)nv);
  memcpy(all->v, period->v, sizeof(double) * (size_t)nv);
  for (int t = last; t < all->nknot; t++) {
    cav_periodicity_configuration(periodicity, 1, all->q + (t - last) * nq, all->q + t * nq);
    cav_periodicity_tangent(periodicity, 1, all->u + (t - last) * nv, all->u + t * nv);
  }
  cav_trajectory_velocities(periodicity->model, all);
  return all;
}

// ---------------------------------------------------------------- making

static void add_entry(cav_periodicity *w, int row, int column, double value) {
  if (value == 0) return;
  w->row[w->entries] = row;
  w->column[w->entries] = column;
  w->value[w->entries++] = value;
}

/// Tangent of rotations: N^ transposed, with n its quaternion; without a mirror the identity.
static void add_rotation(cav_periodicity *w, int row, int column, const double n[4]) {
  double a = n[0], b = n[1], c = n[2], d = n[3];
  double R[9] = {1 - 2 * (c * c + d * d), 2 * (b * c - a * d),     2 * (b * d + a * c),
                 2 * (b * c + a * d),     1 - 2 * (b * b + d * d), 2 * (c * d - a * b),
                 2 * (b * d - a * c),     2 * (c * d + a * b),     1 - 2 * (b * b + c * c)};
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 3; k++) add_entry(w, row + i, column + k, R[3 * k + i]);
}

static void list_entries(cav_periodicity *w) {
  const cav_model *m = w->model;
  for (int j = 0; j < m->njoint; j++) {
    const cav_image *image = &w->image[j];
    int from = m->joint[j].dof, to = m->joint[image->joint].dof;
    switch (m->joint[j].type) {
      case CAV_JOINT_FREE:
        for (int i = 0; i < 3; i++)
          for (int k = 0; k < 3; k++) add_entry(w, to + i, from + k, w->world[3 * i + k]);
        add_rotation(w, to + 3, from + 3, image->rotation);
        break;
      case CAV_JOINT_BALL:
        add_rotation(w, to, from, image->rotation);
        break;
      case CAV_JOINT_SLIDE:
      case CAV_JOINT_HINGE:
        add_entry(w, to, from, image->sign);
        break;
    }
  }
}

/// What the shift adds to the slides of roots that do not float; every root must be able to follow.
static cav_status fit_shift(cav_periodicity *w, const cav_state *state, cav_error *error) {
  const cav_model *m = w->model;
  for (int l = 1; l < m->nlink; l++) {
    const cav_link *link = &m->link[l];
    if (link->parent != 0 || m->joint[link->joint].type == CAV_JOINT_FREE) continue;
    const char *name = m->body[link->body].name;
    if (w->rotation[0] < 1)
      return cav_file_fail(error, CAV_BAD_INPUT, 0,
                           "body '%.60s' cannot turn with the cycle: its root is no free joint", name);
    double left[3] = {w->shift[0], w->shift[1], w->shift[2]};
    for (int j = link->joint; j < link->joint + link->njoint; j++) {
      if (m->joint[j].type != CAV_JOINT_SLIDE) continue;
      const double *axis = state->axis + 6 * m->joint[j].dof + 3;
      w->along[j] = axis[0] * left[0] + axis[1] * left[1] + axis[2] * left[2];
      for (int k = 0; k < 3; k++) left[k] -= w->along[j] * axis[k];
    }
    if (fabs(left[0]) + fabs(left[1]) + fabs(left[2]) > near)
      return cav_file_fail(
          error, CAV_BAD_INPUT, 0,
          "body '%.60s' cannot follow the cycle's translation: its root neither floats nor slides that "
          "way (%.3g %.3g %.3g m are left)",
          name, left[0], left[1], left[2]);
  }
  return CAV_OK;
}

/// Gravity and every plane that something may touch are the same a period on; other solids of the world are refused.
static cav_status fit_world(const cav_periodicity *w, const cav_state *state, cav_error *error) {
  const cav_model *m = w->model;
  double g[3], size = 0, off = 0;
  direction(w, 1, m->gravity, g);
  for (int k = 0; k < 3; k++) size += fabs(m->gravity[k]), off += fabs(g[k] - m->gravity[k]);
  if (off > near * size)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "gravity is not the same a period on: the cycle turns or mirrors it");
  for (int p = 0; p < m->npair; p++) {
    for (int side = 0; side < 2; side++) {
      int i = side ? m->pair[p].geom2 : m->pair[p].geom1;
      const cav_geom *geom = &m->geom[i];
      if (geom->link != 0) continue;
      cav_pose pose;
      cav_object_pose(m, state, CAV_OBJECT_GEOM, i, &pose);
      double n[3] = {pose.rotation[2], pose.rotation[5], pose.rotation[8]}, turned[3], at[3], miss = 0;
      direction(w, 1, n, turned);
      point(w, 1, pose.pos, at);
      for (int k = 0; k < 3; k++) miss += n[k] * (at[k] - pose.pos[k]), turned[k] -= n[k];
      double bent = fabs(turned[0]) + fabs(turned[1]) + fabs(turned[2]);
      if (geom->type == CAV_GEOM_PLANE && fabs(miss) <= near && bent <= near) continue;
      return cav_file_fail(
          error, CAV_BAD_INPUT, 0, "the ground is not the same a period on: geom %d ('%.60s') of the world %s", i,
          geom->name,
          geom->type == CAV_GEOM_PLANE ? "is a plane that the cycle moves" : "is not a plane; cycles need flat ground");
    }
  }
  return CAV_OK;
}

/// Every actuator has a counterpart with the image of its moments and of its range.
static cav_status fit_actuators(const cav_periodicity *w, cav_state *state, double *work, cav_error *error) {
  const cav_model *m = w->model;
  int nv = m->nv;
  double *moment = work, *mirrored = work + nv, *other = work + 2 * nv, range[2], found[2];
  for (int a = 0; a < m->nu && w->mirror; a++) {
    cav_actuator_length(m, state, a, moment);
    cav_periodicity_tangent(w, 1, moment, mirrored);
    cav_actuator_effort_range(m, a, range);
    int good = 0;
    for (int b = 0; b < m->nu && !good; b++) {
      cav_actuator_length(m, state, b, other);
      cav_actuator_effort_range(m, b, found);
      double plus = 0, minus = 0, size = 0;
      for (int d = 0; d < nv; d++) {
        plus = fmax(plus, fabs(mirrored[d] - other[d])), minus = fmax(minus, fabs(mirrored[d] + other[d]));
        size = fmax(size, fabs(mirrored[d]));
      }
      int turned = plus > near * size;
      if (turned && minus > near * size) continue;
      good = 1;
      for (int k = 0; k < 2; k++) {
        double wanted = turned ? -range[1 - k] : range[k];
        good = good && (wanted == found[k] || fabs(wanted - found[k]) <= near * (1 + fabs(wanted)));
      }
    }
    if (!good)
      return cav_file_fail(
          error, CAV_BAD_INPUT, 0,
          "the model is not its own mirror image: actuator '%.60s' (%d) has no counterpart of the same "
          "strength on the other side",
          m->actuator[a].name, a);
  }
  return CAV_OK;
}

/// A number in -1 .. 1, by a fixed sequence.
static double number_draw(int *count) { return 2 * fmod(++*count * golden, 1) - 1; }

/// Brings joints into the ranges of themselves and their images, whose limits may differ.
static void clip(const cav_periodicity *w, double *q) {
  const cav_model *m = w->model;
  for (int j = 0; j < m->njoint && w->mirror; j++) {
    const cav_joint *joint = &m->joint[j];
    double range[2], *x = q + joint->q;
    if (!joint->limited || joint->type == CAV_JOINT_BALL || joint->type == CAV_JOINT_FREE) continue;
    cav_periodicity_range(w, j, range);
    *x = fmin(fmax(*x, range[0] + inside), range[1] - inside);
  }
}

/// The forces of images are images of forces.
static cav_status fit_forces(cav_periodicity *w, const cav_problem *problem, cav_state *state, double *work,
                             cav_error *error) {
  const cav_model *m = w->model;
  int nv = m->nv, count = 0;
  double *q = work, *moved = q + m->nq, *v = moved + m->nq, *next = v + nv, *u = next + nv, *pv = u + nv, *pn = pv + nv,
         *pu = pn + nv, *found = pu + nv;
  // millimetres are much to a contact: geoms have been compared
  if (w->asymmetry > 0) state->options.contact = 0;
  for (int s = 0; s < STATES; s++) {
    for (int d = 0; d < nv; d++) v[d] = 0.3 * number_draw(&count);
    cav_integrate(m, problem->q_start, v, s ? 1 : 0.05, q);
    clip(w, q);
    for (int d = 0; d < nv; d++) v[d] = number_draw(&count), next[d] = v[d] + 0.1 * number_draw(&count);
    cav_periodicity_configuration(w, 1, q, moved);
    cav_periodicity_tangent(w, 1, v, pv);
    cav_periodicity_tangent(w, 1, next, pn);
    cav_status status = cav_inverse(m, state, q, v, next, u);
    cav_periodicity_tangent(w, 1, u, pu);
    if (status == CAV_OK) status = cav_inverse(m, state, moved, pv, pn, found);
    if (status != CAV_OK) return cav_file_fail(error, status, 0, "the start cannot be evaluated a period on");
    double largest = 0, worst = 0;
    int where = 0;
    for (int d = 0; d < nv; d++) {
      largest = fmax(largest, fabs(pu[d]));
      if (fabs(pu[d] - found[d]) > worst) worst = fabs(pu[d] - found[d]), where = d;
    }
    if (w->asymmetry > 0) w->forces = fmax(w->forces, worst / largest);
    if (worst <= (w->asymmetry > 0 ? likeness : alike) * largest) continue;
    return cav_file_fail(error, CAV_BAD_INPUT, 0,
                         "the dynamics are not the same a period on: the force on joint '%.60s' differs by %.2g of the "
                         "largest; %s",
                         m->joint[m->dof[where].joint].name, worst / largest,
                         w->mirror
                             ? "the model is not its own mirror image (contacts, springs or tendons), or a pair is "
                               "missing"
                             : "something fixes the body to the world");
  }
  return CAV_OK;
}

static void set_world(cav_periodicity *w, const cav_problem *problem) {
  const cav_cycle *cycle = &problem->cycle;
  const cav_model *m = w->model;
  double c = cos(cycle->rotation), s = sin(cycle->rotation);
  double rotation[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
  memcpy(w->world, rotation, sizeof rotation);
  w->mirror = cycle->mirror != CAV_MIRROR_NONE;
  if (w->mirror) w->world[cycle->mirror == CAV_MIRROR_X ? 0 : 4] = -1;
  w->rotation[0] = cos(cycle->rotation / 2);
  w->rotation[3] = sin(cycle->rotation / 2);
  memcpy(w->shift, cycle->translation, sizeof w->shift);
  // the mirror stands in the origin, a turn goes about the start
  for (int j = 0; j < m->njoint && !w->mirror; j++) {
    if (m->joint[j].type != CAV_JOINT_FREE) continue;
    for (int k = 0; k < 2; k++) w->centre[k] = problem->q_start[m->joint[j].q + k];
    break;
  }
}

/// What numbers alone can get wrong.
static cav_status check(const cav_cycle *cycle, cav_error *error) {
  const double *d = cycle->translation;
  if (!isfinite(d[0]) || !isfinite(d[1]) || !isfinite(d[2]) || !isfinite(cycle->rotation))
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "the cycle's translation and turn must be finite");
  if (cycle->mirror == CAV_MIRROR_NONE) return CAV_OK;
  if (cycle->rotation != 0)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "a mirrored cycle cannot turn: give the whole period without mirror");
  if (d[cycle->mirror == CAV_MIRROR_X ? 0 : 1] != 0)
    return cav_file_fail(
        error, CAV_BAD_INPUT, 0,
        "a mirrored cycle cannot move along the axis that is reflected: its translation there must be 0");
  return CAV_OK;
}

static int wrap_rooms(cav_periodicity *w) {
  const cav_model *m = w->model;
  size_t n = (size_t)m->njoint + 1, entries = 3 * (size_t)m->nv + 1;
  w->image = calloc(n, sizeof *w->image);
  w->along = calloc(n, sizeof *w->along);
  w->link = calloc((size_t)m->nlink, sizeof *w->link);
  w->row = calloc(entries, sizeof *w->row);
  w->column = calloc(entries, sizeof *w->column);
  w->value = calloc(entries, sizeof *w->value);
  return w->image && w->along && w->link && w->row && w->column && w->value;
}

cav_periodicity *cav_periodicity_new(const cav_problem *problem, cav_error *error) {
  const cav_model *m = problem->model;
  cav_status status = check(&problem->cycle, error);
  if (status != CAV_OK) return NULL;
  cav_periodicity *w = calloc(1, sizeof *w);
  cav_state *state = cav_state_new(m);
  double *work = malloc((2 * (size_t)m->nq + 7 * (size_t)m->nv + 1) * sizeof *work);
  if (w) w->model = m;
  if (!w || !state || !work || !wrap_rooms(w)) {
    status = cav_file_fail(error, CAV_NO_MEMORY, 0, "not enough memory for the cycle");
    goto end;
  }
  set_world(w, problem);
  for (int j = 0; j < m->njoint; j++) w->image[j] = (cav_image){.joint = j, .sign = 1, .rotation = {1, 0, 0, 0}};
  for (int l = 0; l < m->nlink; l++) w->link[l] = l;
  if (w->mirror)
    status = cav_mirror_find(problem, problem->cycle.mirror == CAV_MIRROR_X ? 0 : 1, w->image, w->link, &w->asymmetry,
                             error);
  if (status == CAV_OK) list_entries(w);
  if (status == CAV_OK) status = cav_position(m, state, m->q0);
  if (status == CAV_OK) status = fit_shift(w, state, error);
  if (status == CAV_OK) status = fit_world(w, state, error);
  if (status == CAV_OK) status = fit_actuators(w, state, work, error);
  if (status == CAV_OK) status = fit_forces(w, problem, state, work, error);
end:
  cav_state_free(state);
  free(work);
  if (status == CAV_OK) return w;
  cav_periodicity_free(w);
  return NULL;
}

void cav_periodicity_asymmetry(const cav_periodicity *periodicity, double *length, double *force) {
  *length = periodicity->asymmetry;
  *force = periodicity->forces;
}

void cav_periodicity_free(cav_periodicity *periodicity) {
  if (!periodicity) return;
  free(periodicity->image), free(periodicity->along), free(periodicity->link);
  free(periodicity->row), free(periodicity->column), free(periodicity->value);
  free(periodicity);
}
