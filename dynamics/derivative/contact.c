/// Derivatives of one contact: how its distance, position and axes, velocities, impulse and wrench change when one of
/// its two links moves by a small twist. The geometry depends on the relative pose of two geoms only: in closed form
/// for a ball or a capsule on a plane, by centred differences of the narrow phase of that one pair in six directions
/// otherwise. Everything after the geometry is exact: the frame turns with the normal, and about it with the tangent it
/// is aligned to; the law has its own derivative (contact_law.c, coulomb.c), and of R and K by the distance where the
/// impedance varies.
///
/// In the law f(z, r, s) = F(z, s)/r with z = v* - v_next, r the common scale of R and s = h K delta, F is homogeneous
/// of degree one in (z, s) together; so df = H dz - (dr/r) f + (ds/s)(f - H z), whatever the law's smoothing. At kinks
/// of the exact law one element of the generalised derivative is taken, always the same.
#include "derivative.h"

#include "math3.h"

/// Geometry of a contact by unit twists of the second geom against the first, about the contact's position.
typedef struct geometry {
  double dist[6], pos[6][3], normal[6][3], tangent[6][3];
  double align[3]; ///< direction that the second axis is made from
  int carried;     ///< it moves with the geoms; otherwise it is an axis of the world
} geometry;

// steps of differences of the narrow phase: rad, and fraction of the size of the smaller geom
static const double ROTATION_STEP = 1e-5, SHIFT_STEP = 1e-5;
// fraction of the curvature of a contact that pushes below which there is none
static const double FLAT = 1e-13;

static void place(const cav_model *model, const cav_state *state, int index, cav_shape *shape) {
  const cav_geom *geom = &model->geom[index];
  const cav_pose *link = &state->link[geom->link];
  *shape = cav_shape_of(model, geom);
  transform(shape->pos, link->pos, link->rotation, geom->pos);
  matmul3(shape->rotation, link->rotation, geom->rotation);
}

// unit twist k
static void unit(double twist[6], int k) {
  for (int i = 0; i < 6; i++) twist[i] = i == k;
}

// a ball about a point that moves with the second geom, on a plane
static void ball_on_plane(const cav_contact *c, const cav_shape *ball, geometry *g) {
  const double *n = c->frame;
  double reach = ball->size[0] + 0.5 * c->dist, arm[3], axis[3] = {0, 0, 0};
  scale3(arm, reach, n);
  if (ball->type == CAV_GEOM_CAPSULE) column3(axis, ball->rotation, 2);
  copy3(g->align, axis);
  for (int k = 0; k < 6; k++) {
    double twist[6];
    unit(twist, k);
    copy3(g->pos[k], twist + 3);
    cross_add3(g->pos[k], twist, arm);
    g->dist[k] = dot3(n, g->pos[k]);
    axpy3(g->pos[k], g->pos[k], -0.5 * g->dist[k], n);
    zero3(g->normal[k]);
    cross3(g->tangent[k], twist, axis);
  }
}

// moves a shape by a fraction of a unit twist about a point
static void twist_shape(const cav_shape *from, const double point[3], int k, double step, cav_shape *to) {
  *to = *from;
  if (k >= 3) {
    to->pos[k - 3] += step;
    return;
  }
  double w[3] = {0, 0, 0}, quat[4], R[9], arm[3];
  w[k] = step;
  quat_exp(quat, w);
  quat_matrix(R, quat);
  matmul3(to->rotation, R, from->rotation);
  sub3(arm, from->pos, point);
  rotate(arm, R, arm);
  add3(to->pos, point, arm);
}

// the point of a manifold with that feature, NULL if it is not there
static const cav_touch *find(const cav_touch *touch, int count, int feature) {
  for (int i = 0; i < count; i++) {
    if (touch[i].feature == feature) return &touch[i];
  }
  return NULL;
}

// the narrow phase differenced in six directions; one-sided where the point is gone on one side
static cav_status difference(const cav_contact *c, const cav_shape *a, const cav_shape *b, double size, double margin,
                             geometry *g) {
  cav_touch touch[3][CAV_TOUCH_MAX];
  double shift = SHIFT_STEP * size;
  // every routine keeps to CAV_TOUCH_MAX: collide.c asserts it for the same shapes
  const cav_touch *here = find(touch[2], cav_collide_shapes(a, b, margin + 4 * shift, touch[2]), c->feature);
  if (!here) return CAV_NOT_SUPPORTED;
  copy3(g->align, here->tangent);
  for (int k = 0; k < 6; k++) {
    double step = k < 3 ? ROTATION_STEP : shift;
    const cav_touch *at[2];
    for (int side = 0; side < 2; side++) {
      cav_shape moved;
      twist_shape(b, c->pos, k, side ? step : -step, &moved);
      at[side] = find(touch[side], cav_collide_shapes(a, &moved, margin + 4 * shift, touch[side]), c->feature);
    }
    if (!at[0] && !at[1]) return CAV_NOT_SUPPORTED;
    double inverse = 1 / (at[0] && at[1] ? 2 * step : step);
    const cav_touch *low = at[0] ? at[0] : here, *high = at[1] ? at[1] : here;
    g->dist[k] = (high->dist - low->dist) * inverse;
    for (int i = 0; i < 3; i++) {
      g->pos[k][i] = (high->pos[i] - low->pos[i]) * inverse;
      g->normal[k][i] = (high->normal[i] - low->normal[i]) * inverse;
      g->tangent[k][i] = (high->tangent[i] - low->tangent[i]) * inverse;
    }
  }
  return CAV_OK;
}

// what the second contact axis is aligned with, by the rule of collide.c
static void find_alignment(const cav_contact *c, geometry *g) {
  double along[3];
  axpy3(along, g->align, -dot3(c->frame, g->align), c->frame);
  g->carried = dot3(along, along) >= 1e-12;
  if (g->carried) return;
  int y = fabs(c->frame[1]) < 0.5;
  set3(g->align, 0, y, !y);
  memset(g->tangent, 0, sizeof g->tangent);
}

static cav_status contact_geometry(const cav_model *model, const cav_state *state, const cav_contact *c, geometry *g) {
  const cav_pair *pair = &model->pair[c->pair];
  const cav_geom *first = &model->geom[pair->geom1], *second = &model->geom[pair->geom2];
  cav_status status = CAV_OK;
  cav_shape a, b;
  place(model, state, pair->geom2, &b);
  if (first->type == CAV_GEOM_PLANE && (second->type == CAV_GEOM_SPHERE || second->type == CAV_GEOM_CAPSULE)) {
    ball_on_plane(c, &b, g);
  } else {
    place(model, state, pair->geom1, &a);
    status = difference(c, &a, &b, fmin(1, fmin(first->bound, second->bound)), cav_contact_activation(state, pair), g);
  }
  if (status == CAV_OK) find_alignment(c, g);
  return status;
}

/// Velocities of the two links at a contact's position, and of the second against the first.
typedef struct motion {
  double own[2][6], relative[6];
} motion;

static void move(const cav_state *state, const cav_contact *c, const double *velocity, const double *other, motion *m) {
  int link[2] = {c->link1, c->link2};
  for (int side = 0; side < 2; side++) {
    // at v where the state keeps only the mean: twice the mean minus the other
    double V[6];
    copy6(V, velocity + 6 * link[side]);
    if (other) {
      scale6(V, 2, V);
      axpy6(V, V, -1, other + 6 * link[side]);
    }
    motion_at(m->own[side], V, state->reference + 3 * link[side], c->pos);
  }
  axpy6(m->relative, m->own[1], -1, m->own[0]);
}

/// How a contact is placed after a unit twist of one of its links: gap, position and rotation of the frame.
typedef struct placement {
  double dist, pos[3], rotation[3];
} placement;

static void displace(const cav_contact *c, const geometry *g, int side, int k, placement *p) {
  const double *n = c->frame, *t = c->frame + 6;
  double twist[6], normal[3], tangent[3];
  unit(twist, k);
  p->dist = g->dist[k];
  copy3(p->pos, g->pos[k]);
  copy3(normal, g->normal[k]);
  copy3(tangent, g->tangent[k]);
  if (side == 0) {
    // both links move by the twist, then the second moves back
    p->dist = -p->dist;
    sub3(p->pos, twist + 3, p->pos);
    scale3(normal, -1, normal);
    cross_add3(normal, twist, n);
    scale3(tangent, -1, tangent);
    if (g->carried) cross_add3(tangent, twist, g->align);
  }
  // frame: its normal, and about it its second axis, the part of align across the normal
  double along = dot3(n, g->align), across = sqrt(fmax(dot3(g->align, g->align) - along * along, 1e-12));
  cross3(p->rotation, n, normal);
  axpy3(p->rotation, p->rotation, (dot3(t, tangent) - dot3(t, normal) * along) / across, n);
}

// rate of the relative velocity along the axes of the frame, out [dim]
static void velocity_rate(const cav_contact *c, const motion *m, const placement *p, int side, int k, double *out) {
  double twist[6], linear[3] = {0, 0, 0}, angular[3] = {0, 0, 0};
  unit(twist, k);
  const double *own = m->own[side];

  // the link's motion does not turn with it; the point of the body does
  cross_add3(angular, twist, own);
  cross_add3(linear, twist + 3, own);
  cross_add3(linear, twist, own + 3);
  if (side == 0) {
    scale3(angular, -1, angular);
    scale3(linear, -1, linear);
  }
  cross_add3(linear, m->relative, p->pos);

  // and the axes turn
  cross_add3(linear, m->relative + 3, p->rotation);
  cross_add3(angular, m->relative, p->rotation);
  for (int i = 0; i < c->dim; i++) {
    out[i] = i < 3 ? dot3(c->frame + 3 * i, linear) : dot3(c->frame + 3 * (i - 3), angular);
  }
}

/// The law of a contact at its state.
typedef struct law_derivative {
  double by_dist[6]; ///< df by the distance, velocities fixed
} law_derivative;

static void differentiate_law(const cav_model *model, const cav_state *state, const cav_contact *c, double *H,
                              law_derivative *law) {
  double z[6], g[6], f[6], reaction[6], regulariser, stiffness, fraction;
  for (int k = 0; k < c->dim; k++) {
    z[k] = (1 - c->damping[k]) * c->velocity[k] - c->velocity_next[k];
    if (k == 0) z[k] -= c->stiffness * (c->dist - c->margin);
    g[k] = z[k] / c->regulariser[k];
  }
  cav_law_contact(state, c, g, f, H);
  cav_law_rates(state, &model->pair[c->pair].softness, c->dist - c->margin, &regulariser, &stiffness);
  cav_contact_stiffness_ratio(state, c, &fraction);
  regulariser -= fraction;
  double target = -c->stiffness * (1 + stiffness * (c->dist - c->margin));
  for (int i = 0; i < c->dim; i++) {
    reaction[i] = 0;
    for (int k = 0; k < c->dim; k++) reaction[i] += H[i * c->dim + k] * z[k];
    law->by_dist[i] = H[i * c->dim] * target - regulariser * f[i] + stiffness * (f[i] - reaction[i]);
  }
}

// wrench about the position of an impulse along the axes of the frame
static void add_wrench(const cav_contact *c, const double *impulse, double wrench[6]) {
  for (int i = 0; i < c->dim; i++) {
    double *part = i < 3 ? wrench + 3 : wrench;
    axpy3(part, part, impulse[i], c->frame + 3 * (i % 3));
  }
}

static void fill_side(const cav_contact *c, const geometry *g, const motion *now, const motion *next,
                      const law_derivative *law, const double *H, int side, cav_contact_jacobian *derivative) {
  double whole[6] = {0};
  add_wrench(c, c->impulse, whole);
  for (int k = 0; k < 6; k++) {
    placement p;
    double before[6], after[6], rate[6];
    displace(c, g, side, k, &p);
    velocity_rate(c, now, &p, side, k, before);
    velocity_rate(c, next, &p, side, k, after);
    derivative->dist[side][k] = p.dist;
    for (int i = 0; i < c->dim; i++) {
      rate[i] = law->by_dist[i] * p.dist;
      for (int j = 0; j < c->dim; j++) rate[i] += H[i * c->dim + j] * ((1 - c->damping[j]) * before[j] - after[j]);
      derivative->velocity[side][i][k] = after[i];
      derivative->impulse[side][i][k] = rate[i];
    }
    // the impulse turns with the frame and acts at the displaced position
    double *wrench = derivative->wrench[side][k];
    cross3(wrench, p.rotation, whole);
    cross_add3(wrench, p.pos, whole + 3);
    cross3(wrench + 3, p.rotation, whole + 3);
    add_wrench(c, rate, wrench);
  }
}

// whether the law is flat: no curvature beside that of a contact that pushes, which is 1/R
static int is_flat(const cav_contact *c, const double *H) {
  double fraction = 0;
  for (int i = 0; i < c->dim; i++) fraction += H[i * c->dim + i] * c->regulariser[i];
  return fraction < FLAT;
}

cav_status cav_contact_differentiate(const cav_model *model, const cav_state *state, const cav_contact *c, int whole,
                                     cav_contact_jacobian *derivative) {
  law_derivative law;
  double H[36];
  differentiate_law(model, state, c, H, &law);
  derivative->idle = !whole && is_flat(c, H);
  if (derivative->idle) return CAV_OK;
  geometry g;
  cav_status status = contact_geometry(model, state, c, &g);
  if (status != CAV_OK) return status;
  motion now, next;
  move(state, c, state->velocity, cav_takes_mean(state) ? state->velocity_next : NULL, &now);
  move(state, c, state->velocity_next, NULL, &next);
  for (int side = 0; side < 2; side++) {
    if ((side ? c->link2 : c->link1) > 0) fill_side(c, &g, &now, &next, &law, H, side, derivative);
  }

  // the curvature in the frame and in world axes
  memset(derivative->by_velocity, 0, sizeof derivative->by_velocity);
  for (int i = 0; i < c->dim; i++) {
    for (int j = 0; j < c->dim; j++) {
      double h = derivative->hessian[i][j] = H[i * c->dim + j];
      const double *x = c->frame + 3 * (i % 3), *y = c->frame + 3 * (j % 3);
      int row = i < 3 ? 3 : 0, column = j < 3 ? 3 : 0;
      for (int r = 0; r < 3; r++) {
        for (int s = 0; s < 3; s++) derivative->by_velocity[row + r][column + s] += h * x[r] * y[s];
      }
    }
  }
  return CAV_OK;
}
