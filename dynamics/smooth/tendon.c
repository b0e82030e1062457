/// Lengths of tendons and their gradients, the moment arms. A fixed tendon is a sum of joint coordinates with constant
/// arms, written once. A spatial tendon is a string through sites and around geoms (wrap.c); a pulley divides the
/// length of the branch behind it. Its arms are exact: of each straight piece between two links, the direction dotted
/// with the velocity that a dof gives its ends relative to each other. Only dofs that move a piece's ends apart are
/// listed (model->tendon_dof). A piece of no length has no direction and no arm.
#include "math3.h"
#include "smooth.h"
#include "wrap.h"

void cav_tendon_compile(const cav_model *model, cav_state *state) {
  cav_workspace *w = state->work;
  for (int i = 0; i < model->ntendon; i++) {
    const cav_tendon *t = &model->tendon[i];
    if (t->npath > 0) { w->string[w->nstring++] = i; }
    for (int k = 0; k < t->npart; k++) {
      const cav_tendon_part *part = &model->tendon_part[t->part + k];
      for (int e = t->dof; e < t->dof + t->ndof; e++) {
        if (model->tendon_dof[e] == model->joint[part->joint].dof) { state->tendon_arm[e] += part->coef; }
      }
    }
  }
}

/// A point of the string, fixed in a link.
typedef struct knot {
  int link;
  double pos[3]; ///< world
} knot;

// row += scale times what a unit velocity of the dof moves a point along a direction
static void add_arm(const cav_state *state, int dof, const double point[3], const double direction[3], double scale,
                    double *row) {
  double velocity[3];
  velocity_at(velocity, state->axis + 6 * dof, state->reference + 3 * state->model->dof[dof].link, point);
  row[dof] += scale * dot3(direction, velocity);
}

// length of a straight piece; its gradient is added to row
static double add_piece(const cav_state *state, const knot *a, const knot *b, double scale, double *row) {
  const cav_model *model = state->model;
  double direction[3];
  sub3(direction, b->pos, a->pos);
  double length = norm3(direction);
  if (a->link == b->link || length == 0) { return scale * length; }
  scale3(direction, 1 / length, direction);
  int i = cav_last_dof(model, a->link), j = cav_last_dof(model, b->link);
  while (i != j) {
    // the higher index cannot be an ancestor of the other
    if (i > j) {
      add_arm(state, i, a->pos, direction, -scale, row);
      i = model->dof[i].parent;
    } else {
      add_arm(state, j, b->pos, direction, scale, row);
      j = model->dof[j].parent;
    }
  }
  return scale * length;
}

static knot at_site(const cav_state *state, int index) {
  const cav_site *site = &state->model->site[index];
  const cav_pose *link = &state->link[site->link];
  knot k = {.link = site->link};
  transform(k.pos, link->pos, link->rotation, site->pos);
  return k;
}

// world point into the frame of a geom
static void into_geom(const double origin[3], const double R[9], const double point[3], double out[3]) {
  double arm[3];
  sub3(arm, point, origin);
  rotate_back(out, R, arm);
}

// from site to site around a geom
static double add_wrapped(const cav_state *state, const cav_tendon_path_point *via, const knot *a, const knot *b,
                          double scale, double *row) {
  const cav_geom *geom = &state->model->geom[via->object];
  const cav_pose *link = &state->link[geom->link];
  double origin[3], R[9], from[3], to[3], side[3], touch[2][3];
  transform(origin, link->pos, link->rotation, geom->pos);
  matmul3(R, link->rotation, geom->rotation);
  into_geom(origin, R, a->pos, from);
  into_geom(origin, R, b->pos, to);
  if (via->side >= 0) {
    knot beside = at_site(state, via->side);
    into_geom(origin, R, beside.pos, side);
  }
  double arc = (via->type == CAV_TENDON_PATH_SPHERE ? cav_wrap_sphere : cav_wrap_cylinder)(
      geom->size[0], from, to, via->side >= 0 ? side : NULL, touch);
  if (arc < 0) { return add_piece(state, a, b, scale, row); }
  knot on = {.link = geom->link}, off = {.link = geom->link};
  transform(on.pos, origin, R, touch[0]);
  transform(off.pos, origin, R, touch[1]);
  return add_piece(state, a, &on, scale, row) + scale * arc + add_piece(state, &off, b, scale, row);
}

// length of one string; row [nv] is scratch
static double tendon_path_length(const cav_model *model, cav_state *state, const cav_tendon *t, double *row) {
  const cav_tendon_path_point *path = &model->tendon_path[t->path];
  double length = 0, scale = 1;
  for (int e = t->dof; e < t->dof + t->ndof; e++) { row[model->tendon_dof[e]] = 0; }
  for (int i = 0; i < t->npath; i++) {
    if (path[i].type == CAV_TENDON_PATH_PULLEY) { scale = 1 / path[i].divisor; }
    // a piece starts at a site, and ends at the next one, with or without a geom between
    if (path[i].type != CAV_TENDON_PATH_SITE || i + 1 == t->npath || path[i + 1].type == CAV_TENDON_PATH_PULLEY) {
      continue;
    }
    knot a = at_site(state, path[i].object);
    int direct = path[i + 1].type == CAV_TENDON_PATH_SITE;
    knot b = at_site(state, path[i + 2 - direct].object);
    length += direct ? add_piece(state, &a, &b, scale, row) : add_wrapped(state, &path[i + 1], &a, &b, scale, row);
  }
  for (int e = t->dof; e < t->dof + t->ndof; e++) { state->tendon_arm[e] = row[model->tendon_dof[e]]; }
  return length;
}

void cav_tendon_lengths(const cav_model *model, cav_state *state) {
  const cav_workspace *w = state->work;
  for (int i = 0; i < model->ntendon; i++) {
    const cav_tendon *t = &model->tendon[i];
    double length = 0;
    for (int k = t->part; k < t->part + t->npart; k++) {
      length += model->tendon_part[k].coef * w->q[model->joint[model->tendon_part[k].joint].q];
    }
    state->tendon_length[i] = length;
  }
  for (int i = 0; i < w->nstring; i++) {
    state->tendon_length[w->string[i]] = tendon_path_length(model, state, &model->tendon[w->string[i]], w->scratch);
  }
}

double cav_tendon_velocity(const cav_state *state, int tendon, const double *v) {
  const cav_tendon *t = &state->model->tendon[tendon];
  const int *dof = state->model->tendon_dof;
  double sum = 0;
  for (int e = t->dof; e < t->dof + t->ndof; e++) { sum += state->tendon_arm[e] * v[dof[e]]; }
  return sum;
}

void cav_tendon_pull(const cav_state *state, int tendon, double force, double *u) {
  const cav_tendon *t = &state->model->tendon[tendon];
  const int *dof = state->model->tendon_dof;
  for (int e = t->dof; e < t->dof + t->ndof; e++) { u[dof[e]] += state->tendon_arm[e] * force; }
}
