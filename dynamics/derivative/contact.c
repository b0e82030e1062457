/// Derivatives of one contact: how its distance, position and axes, velocities, impulse and wrench change when one of
/// its two links moves by a small twist. The geometry depends on the relative pose of two geoms only: in closed form
/// for balls, capsules and corners on a plane, and for the nearest points of meshes against anything without a curve but
/// its radius and points over a face of such a pair; otherwise by centred differences of the narrow phase in six
/// directions, for all points of a pair at once.
/// Everything after the geometry is exact: the frame turns with the normal, and about it with the tangent it is aligned
/// to; the law has its own derivative (contact_law.c, coulomb.c), and of R and K by the distance where the impedance
/// varies.
///
/// In the law f(z, r, s) = F(z, s)/r with z = v* - v_next, r the common scale of R and s = h K delta, F is homogeneous
/// of degree one in (z, s) together; so df = H dz - (dr/r) f + (ds/s)(f - H z), whatever the law's smoothing. At kinks
/// of the exact law one element of the generalised derivative is taken, always the same.
#include "derivative.h"
#include "gjk.h"

#include "math3.h"
#include "vectors.h"

/// Geometry of a contact by unit twists of the second geom against the first, about the contact's position.
typedef struct geometry {
  double dist[6], pos[6][3], normal[6][3], tangent[6][3];
  double align[3]; ///< direction that the second axis is made from
  int carried;     ///< it moves with the geoms; otherwise it is an axis of the world
} geometry;

// fraction of the size of the smaller geom below which corners are one and parts have no length; sine below which parts
// are parallel
static const double THIN = 1e-7;
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

// r = axis k of the world x v
static inline void turn(double r[3], int k, const double v[3]) {
  const int next = (k + 1) % 3, last = (k + 2) % 3;
  r[k] = 0;
  r[next] = -v[last];
  r[last] = v[next];
}

// velocity at an arm from the centre of unit twist k
static inline void unit_velocity(double r[3], int k, const double arm[3]) {
  if (k < 3) {
    turn(r, k, arm);
  } else {
    for (int i = 0; i < 3; i++) r[i] = i == k - 3;
  }
}

// whether points of a shape on a plane are balls about points that move with the shape: ends, or corners of no radius
static int has_fixed_points(const cav_shape *s) {
  return s->type == CAV_GEOM_SPHERE || s->type == CAV_GEOM_CAPSULE || s->type == CAV_GEOM_BOX ||
         s->type == CAV_GEOM_MESH;
}

// the radius about such points, and the direction of a capsule, which aligns the axes of its contacts
static double end_radius(const cav_shape *s, double axis[3]) {
  zero3(axis);
  if (s->type == CAV_GEOM_CAPSULE) column3(axis, s->rotation, 2);
  return s->type == CAV_GEOM_SPHERE || s->type == CAV_GEOM_CAPSULE ? s->size[0] : 0;
}

// a ball about a point that moves with the second geom, on a plane of the first
static void ball_on_plane(const cav_contact *c, double radius, const double axis[3], geometry *g) {
  const double *n = c->frame;
  double reach = radius + 0.5 * c->dist, arm[3];
  scale3(arm, reach, n);
  copy3(g->align, axis);
  for (int k = 0; k < 6; k++) {
    unit_velocity(g->pos[k], k, arm);
    g->dist[k] = dot3(n, g->pos[k]);
    axpy3(g->pos[k], g->pos[k], -0.5 * g->dist[k], n);
    zero3(g->normal[k]);
    if (k < 3)
      turn(g->tangent[k], k, axis);
    else
      zero3(g->tangent[k]);
  }
}

// the same on a plane of the second geom, which carries what is found from it
static void ball_on_second(const cav_contact *c, double radius, const double axis[3], geometry *g) {
  double up[3], arm[3];
  scale3(up, -1, c->frame);
  scale3(arm, radius + 0.5 * c->dist, up);
  copy3(g->align, axis);
  memset(g->tangent, 0, sizeof g->tangent);
  for (int k = 0; k < 6; k++) {
    double move[3], twist[6];
    unit(twist, k);
    unit_velocity(move, k, arm);
    g->dist[k] = -dot3(up, move);
    for (int i = 0; i < 3; i++) g->pos[k][i] = twist[3 + i] - move[i] - 0.5 * g->dist[k] * up[i];
    cross3(g->normal[k], twist, c->frame);
  }
}

// by differences of the narrow phase, those of the pair's points shared; 0 where the point comes and goes
static int difference(const cav_contact *c, cav_pair_manifolds *m, geometry *g) {
  cav_touch here, rate[6];
  if (!cav_touch_rates(m, c->pos, c->feature, &here, rate)) return 0;
  copy3(g->align, here.tangent);
  for (int k = 0; k < 6; k++) {
    g->dist[k] = rate[k].dist;
    copy3(g->pos[k], rate[k].pos);
    copy3(g->normal[k], rate[k].normal);
    copy3(g->tangent[k], rate[k].tangent);
  }
  return 1;
}

// --- nearest points of polyhedra ---

/// Parts of two bodies that are nearest: directions that each part contains, unit, square to the normal; in all at most
/// two, not parallel.
typedef struct parts {
  int n, of_b[2];
  double along[2][3];
} parts;

// adds the directions between corners of one body; 0 if there are too many
static int add_part(parts *p, double corner[3][3], int corners, int of_b, double size) {
  int first = p->n;
  for (int i = 1; i < corners; i++) {
    double e[3];
    sub3(e, corner[i], corner[0]);
    for (int k = first; k < p->n; k++) axpy3(e, e, -dot3(e, p->along[k]), p->along[k]);
    if (normalise3(e) < THIN * size) continue;
    if (p->n == 2) return 0;
    copy3(p->along[p->n], e);
    p->of_b[p->n++] = of_b;
  }
  return 1;
}

// x with a0 x0 + b0 x1 = r0, a1 x0 + b1 x1 = r1; 0 if the rows are dependent
static int solve_two(const double a[2], const double b[2], const double r[2], double x[2]) {
  double det = a[0] * b[1] - a[1] * b[0];
  if (!(fabs(det) > THIN)) return 0;
  x[0] = (r[0] * b[1] - r[1] * b[0]) / det;
  x[1] = (a[0] * r[1] - a[1] * r[0]) / det;
  return 1;
}

// the separation of two shapes and what of both meets; 0 where that is not known. A curved shape is the first
static int find_parts(const cav_contact *c, const cav_shape *a, const cav_shape *b, double size, cav_hint *hint,
                      cav_separation *s, parts *p) {
  cav_core ca = cav_core_of(a), cb = cav_core_of(b);
  int curved = cav_shape_is_curved(a);
  *p = (parts){.n = 0};
  if (!curved) {
    double most = c->dist + ca.radius + cb.radius + size;
    const double large = fmax(cav_shape_size(a), cav_shape_size(b));
    const int found =
        hint ? cav_separation_again(&ca, &cb, large, most, hint, s) : cav_separation_find(&ca, &cb, large, most, s);
    return found && s->corners && add_part(p, s->corner_a, s->corners, 0, size) &&
           add_part(p, s->corner_b, s->corners, 1, size);
  }
  if (!cav_separation_solve(a, b, c->dist + size, hint, s) || !s->corners || s->straight == 2) return 0;
  if (s->straight) column3(p->along[p->n++], a->rotation, 2);
  return add_part(p, s->corner_b, s->corners, 1, size);
}

// how the normal turns, in two directions square to it, and how far the points slide along their parts until the line
// between them is the normal again: G (turn) + slides = rest, and as many rows say how far the normal turns along a
// part. t[0] is along the first part. 0 if they do not say how
static int turn_and_slide(const parts *p, double row[2][2], double G[2][2], const double right[2], const double rest[2],
                          double least, double turn[2], double slide[2]) {
  slide[0] = slide[1] = 0;
  if (p->n == 2) {
    double left[2];
    if (!solve_two((double[]){row[0][0], row[1][0]}, (double[]){row[0][1], row[1][1]}, right, turn)) return 0;
    for (int k = 0; k < 2; k++) left[k] = rest[k] - G[k][0] * turn[0] - G[k][1] * turn[1];
    return solve_two(row[0], row[1], left, slide);
  }
  if (p->n == 1) {
    if (!(fabs(G[1][1]) > least)) return 0;
    turn[0] = right[0] / row[0][0];
    turn[1] = (rest[1] - G[1][0] * turn[0]) / G[1][1];
    slide[0] = (rest[0] - G[0][0] * turn[0] - G[0][1] * turn[1]) / row[0][0];
    return 1;
  }
  double det = G[0][0] * G[1][1] - G[0][1] * G[1][0];
  if (!(fabs(det) > least * least)) return 0;
  turn[0] = (rest[0] * G[1][1] - rest[1] * G[0][1]) / det;
  turn[1] = (G[0][0] * rest[1] - G[1][0] * rest[0]) / det;
  return 1;
}

// the nearest points of two bodies: the normal stays square to what both parts contain, and where they contain less
// than a plane it turns with the line between the points, which on a curved body move with the normal. 0 if the parts do
// not say how
static int nearest_points(const cav_contact *c, const cav_shape *a, const cav_shape *b, double size, cav_hint *hint,
                          geometry *g) {
  cav_separation s;
  parts p;
  if (!find_parts(c, a, b, size, hint, &s, &p)) return 0;
  double radius_a = cav_core_of(a).radius, radius_b = cav_core_of(b).radius;
  // two directions square to the normal: the first part and the one across it
  double t[2][3], row[2][2], H[2][2] = {{0}}, G[2][2];
  if (p.n) {
    copy3(t[0], p.along[0]);
    axpy3(t[0], t[0], -dot3(t[0], s.n), s.n);
  } else {
    const double e[3] = {fabs(s.n[0]) < 0.5, fabs(s.n[0]) >= 0.5, 0};
    cross3(t[0], s.n, e);
  }
  normalise3(t[0]);
  cross3(t[1], s.n, t[0]);
  for (int i = 0; i < p.n; i++) {
    for (int k = 0; k < 2; k++) row[i][k] = dot3(p.along[i], t[k]);
  }
  if (cav_shape_is_curved(a)) cav_shape_bend(a, s.n, t, H);
  for (int i = 0; i < 2; i++) {
    for (int k = 0; k < 2; k++) G[i][k] = H[i][k] + (i == k) * s.gap;
  }
  memset(g, 0, sizeof *g);
  for (int k = 0; k < 6; k++) {
    double arm[3], move[3], twist[6], right[2], turn[2], slide[2];
    unit(twist, k);
    sub3(arm, s.y, c->pos);
    copy3(move, twist + 3);
    cross_add3(move, twist, arm);
    g->dist[k] = dot3(s.n, move);
    // the normal stays square to the parts of the second body as they turn
    for (int i = 0; i < p.n; i++) {
      double turned[3];
      cross3(turned, twist, p.along[i]);
      right[i] = p.of_b[i] ? -dot3(s.n, turned) : 0;
    }
    const double rest[2] = {dot3(move, t[0]), dot3(move, t[1])};
    if (!turn_and_slide(&p, row, G, right, rest, THIN * size, turn, slide)) return 0;
    copy3(g->pos[k], move);
    for (int i = 0; i < 2; i++) {
      axpy3(g->normal[k], g->normal[k], turn[i], t[i]);
      axpy3(g->pos[k], g->pos[k], H[i][0] * turn[0] + H[i][1] * turn[1], t[i]);
    }
    // x + slide a = y + move + slide b: of b the other way
    for (int i = 0; i < p.n; i++) axpy3(g->pos[k], g->pos[k], p.of_b[i] ? -slide[i] : slide[i], p.along[i]);
    axpy3(g->pos[k], g->pos[k], radius_a - radius_b, g->normal[k]);
    scale3(g->pos[k], 0.5, g->pos[k]);
  }
  return 1;
}

// points over a face of one of two polyhedra: those of the other move against it, the direction with it
static int face_point(const cav_contact *c, int feature, const cav_pair_manifolds *m, geometry *g) {
  const cav_face_point *p = NULL;
  for (int i = 0; i < m->faces && !p; i++)
    if (m->face[i].feature == feature) p = &m->face[i];
  if (!p) return 0;
  double arm[3], back = p->on_b ? -1 : 1;
  sub3(arm, p->place, c->pos);
  memset(g, 0, sizeof *g);
  for (int k = 0; k < 6; k++) {
    double twist[6], other[6], move[3];
    unit(twist, k);
    scale6(other, back, twist);
    cav_face_point_move(p, other, arm, move);
    g->dist[k] = dot3(p->normal, move);
    axpy3(g->pos[k], move, -g->dist[k] / 2, p->normal);
    if (!p->on_b) continue;
    // the face moves, and carries what was found from it
    add3(g->pos[k], g->pos[k], twist + 3);
    cross3(g->normal[k], twist, p->normal);
    scale3(g->normal[k], -1, g->normal[k]);
  }
  return 1;
}

// whether a contact is the one between the nearest points that gjk.c or convex.c finds
static int is_nearest(const cav_contact *c, const cav_shape *a, const cav_shape *b) {
  return b->type == CAV_GEOM_MESH && a->type != CAV_GEOM_PLANE && c->feature == 0;
}

// a contact with a prism of a height field as one with that mesh; 0: it is with none
static int on_prism(const cav_contact *c, cav_pair_manifolds *m, geometry *g) {
  cav_prism prism;
  const int feature = cav_hfield_prism(&m->b, c->feature, &prism);
  if (feature == 0) return nearest_points(c, &m->a, &prism.shape, m->size, NULL, g);
  if (feature < 0) return 0;
  m->faces = cav_face_points(&m->a, &prism.shape, m->margin, NULL, m->face);
  return m->faces > 0 && face_point(c, feature, m, g);
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

// where the last search of a pair ended
static cav_hint *hint_of(const cav_model *model, cav_state *state, int pair) {
  cav_hint **hints = cav_contacts_hints(state);
  return hints && cav_pair_keeps_hint(model, &model->pair[pair]) ? *hints + pair : NULL;
}

static void contact_geometry(const cav_model *model, cav_state *state, const cav_contact *c, cav_pair_manifolds *m,
                             geometry *g) {
  const cav_pair *pair = &model->pair[c->pair];
  const cav_geom *first = &model->geom[pair->geom1], *second = &model->geom[pair->geom2];
  if (m->pair != c->pair) {
    cav_manifolds_start(m, c->pair, fmin(1, fmin(first->bound, second->bound)), cav_contact_activation(state, pair),
                        hint_of(model, state, c->pair));
    place(model, state, pair->geom1, &m->a);
    place(model, state, pair->geom2, &m->b);
  }
  double axis[3] = {0, 0, 0};
  if (first->type == CAV_GEOM_PLANE && has_fixed_points(&m->b)) {
    double radius = end_radius(&m->b, axis);
    ball_on_plane(c, radius, axis, g);
    find_alignment(c, g);
    return;
  }
  if (second->type == CAV_GEOM_HFIELD && c->feature < CAV_LEVEL_FEATURES && has_fixed_points(&m->a)) {
    double radius = end_radius(&m->a, axis);
    ball_on_second(c, radius, axis, g);
    find_alignment(c, g);
    return;
  }
  if (second->type == CAV_GEOM_MESH && c->feature > 0 && m->faces < 0)
    m->faces = cav_face_points(&m->a, &m->b, m->margin, m->hint, m->face);
  int known = second->type == CAV_GEOM_HFIELD ? on_prism(c, m, g)
              : c->feature > 0                ? m->faces > 0 && face_point(c, c->feature, m, g)
                               : is_nearest(c, &m->a, &m->b) && nearest_points(c, &m->a, &m->b, m->size, m->hint, g);
  if (!known) {
    // where the points of a pair come and go there is no derivative: one that moves with the second geom over a plane of
    // the first has the right rate of the gap
    if (!difference(c, m, g)) ball_on_plane(c, 0, axis, g);
  }
  find_alignment(c, g);
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

/// How a contact is placed after three unit twists of one of its links, turns or shifts about the axes of the world (the
/// fourth number is none): gap, position and rotation of the frame.
typedef struct placement {
  cav_four dist, pos[3], rotation[3];
} placement;

#define FOUR_DOT3(a, b) ((a)[0] * (b)[0] + (a)[1] * (b)[1] + (a)[2] * (b)[2])

// r += a x b
#define FOUR_CROSS_ADD3(r, a, b)                         \
  do {                                                   \
    (r)[0] = (r)[0] + (a)[1] * (b)[2] - (a)[2] * (b)[1]; \
    (r)[1] = (r)[1] + (a)[2] * (b)[0] - (a)[0] * (b)[2]; \
    (r)[2] = (r)[2] + (a)[0] * (b)[1] - (a)[1] * (b)[0]; \
  } while (0)

// e_k x v for the axes k of the world
static inline __attribute__((always_inline)) void turns(cav_four r[3], const double v[3]) {
  r[0] = (cav_four){0, v[2], -v[1], 0};
  r[1] = (cav_four){-v[2], 0, v[0], 0};
  r[2] = (cav_four){v[1], -v[0], 0, 0};
}

// numbers of three twists
static inline __attribute__((always_inline)) void take_three(cav_four *r, double x, double y, double z) {
  const cav_four none = {0};
  *r = none;
  (*r)[0] = x, (*r)[1] = y, (*r)[2] = z;
}

static inline __attribute__((always_inline)) void take_vectors(cav_four r[3], const double v[][3]) {
  for (int i = 0; i < 3; i++) take_three(&r[i], v[0][i], v[1][i], v[2][i]);
}

// along, across: parts of the direction that the second axis is aligned with
static inline __attribute__((always_inline)) void displace(const cav_contact *c, const geometry *g, int side, int shift,
                                                           double along, double across, placement *p) {
  const double *n = c->frame, *t = c->frame + 6;
  const int k = 3 * shift;
  cav_four normal[3], tangent[3], none = {0};
  take_three(&p->dist, g->dist[k], g->dist[k + 1], g->dist[k + 2]);
  take_vectors(p->pos, g->pos + k);
  take_vectors(normal, g->normal + k);
  take_vectors(tangent, g->tangent + k);
  if (side == 0) {
    // both links move by the twist, then the second moves back
    cav_four turned[3] = {none, none, none};
    p->dist = -p->dist;
    for (int i = 0; i < 3; i++)
      p->pos[i] = (cav_four){i == 0 && shift, i == 1 && shift, i == 2 && shift, 0} - p->pos[i];
    if (!shift) turns(turned, n);
    for (int i = 0; i < 3; i++) normal[i] = turned[i] - normal[i];
    for (int i = 0; i < 3; i++) turned[i] = none;
    if (g->carried && !shift) turns(turned, g->align);
    for (int i = 0; i < 3; i++) tangent[i] = turned[i] - tangent[i];
  }
  // frame: its normal, and about it its second axis, the part of align across the normal
  cav_four about = (FOUR_DOT3(t, tangent) - FOUR_DOT3(t, normal) * along) / across;
  p->rotation[0] = n[1] * normal[2] - n[2] * normal[1];
  p->rotation[1] = n[2] * normal[0] - n[0] * normal[2];
  p->rotation[2] = n[0] * normal[1] - n[1] * normal[0];
  for (int i = 0; i < 3; i++) p->rotation[i] = p->rotation[i] + about * n[i];
}

// rate of the relative velocity along the axes of the frame, out [dim]
static inline __attribute__((always_inline)) void velocity_rate(const cav_contact *c, int dim, const motion *m,
                                                                const placement *p, int side, int shift,
                                                                cav_four *out) {
  const double *own = m->own[side], *relative = m->relative;
  cav_four linear[3], angular[3] = {{0}};

  // the link's motion does not turn with it; the point of the body does
  turns(linear, shift ? own : own + 3);
  for (int i = 0; i < 3 && side == 0; i++) linear[i] = -linear[i];
  FOUR_CROSS_ADD3(linear, relative, p->pos);

  // and the axes turn
  FOUR_CROSS_ADD3(linear, relative + 3, p->rotation);
  for (int i = 0; i < dim && i < 3; i++) out[i] = FOUR_DOT3(c->frame + 3 * i, linear);
  if (dim <= 3) return;
  if (!shift) turns(angular, own);
  for (int i = 0; i < 3 && side == 0; i++) angular[i] = -angular[i];
  FOUR_CROSS_ADD3(angular, relative, p->rotation);
  for (int i = 3; i < dim; i++) out[i] = FOUR_DOT3(c->frame + 3 * (i - 3), angular);
}

// rate of the way of the point over the step along the tangents, out [2], links held after the step
static inline __attribute__((always_inline)) void way_rate(const cav_contact *c, const cav_next_contact *next,
                                                           const placement *p, int side, int shift, cav_four *out) {
  const cav_four none = {0};
  cav_four own[3] = {none, none, none}, from[3], way[3];
  if (shift)
    for (int i = 0; i < 3; i++) own[i] = (cav_four){i == 0, i == 1, i == 2, 0};
  // the point is another one of the second link where that link moves and it does not
  for (int i = 0; i < 3; i++) {
    from[i] = p->pos[i];
    if (side) from[i] = from[i] - own[i];
  }
  for (int i = 0; i < 3; i++) way[i] = FOUR_DOT3(next->turn + 3 * i, from) - p->pos[i];
  // the first link takes along what it sees
  if (side == 0 && !shift) turns(own, next->way);
  for (int i = 0; i < 3 && side == 0; i++) way[i] = way[i] + own[i];
  FOUR_CROSS_ADD3(way, next->way, p->rotation);
  for (int i = 0; i < 2; i++) out[i] = FOUR_DOT3(c->frame + 3 * (1 + i), way);
}

/// The law of a contact at its state.
typedef struct law_derivative {
  double by_dist[6]; ///< df by the distance, velocities fixed
} law_derivative;

// the law's derivative as it was found with the contact's impulse, 0 where it was not
static int take_law(const cav_state *state, const cav_contact *c, double *H) {
  const cav_workspace *w = state->work;
  const ptrdiff_t i = c - state->contact;
  if (c->dim > 3 || i >= w->law_room || !(w->law[CAV_LAW_NUMBERS * i] >= 0)) return 0;
  memcpy(H, w->law + CAV_LAW_NUMBERS * i, (size_t)(c->dim * c->dim) * sizeof *H);
  return 1;
}

static void differentiate_law(const cav_model *model, const cav_state *state, const cav_contact *c, double *H,
                              law_derivative *law) {
  double z[6], g[6], f[6], reaction[6], regulariser, stiffness, fraction;
  for (int k = 0; k < c->dim; k++) {
    // with the operations of cav_contact_impulse
    double target = (1 - c->damping[k]) * c->velocity[k];
    if (k == 0) target -= c->stiffness * (c->dist - c->margin);
    z[k] = target - c->velocity_next[k] - (k == 0 ? cav_contact_excess(state, c) : 0);
    g[k] = z[k] / c->regulariser[k];
  }
  if (take_law(state, c, H))
    memcpy(f, c->impulse, (size_t)c->dim * sizeof *f);
  else
    cav_law_contact(state, c, g, f, H);
  cav_law_rates(state, &model->pair[c->pair].softness, c->dist - c->margin, c->regulariser[0], &regulariser,
                &stiffness);
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

// three of six numbers
static inline __attribute__((always_inline)) void put_three(double *to, const cav_four *from) {
  for (int k = 0; k < 3; k++) to[k] = (*from)[k];
}

CAV_VECTOR_BODY void fill_rows(const cav_contact *c, int dim, const geometry *g, const motion *now, const motion *next,
                               const law_derivative *law, const cav_next_contact *ahead, const double *H, int side,
                               cav_contact_jacobian *derivative) {
  double whole[6] = {0}, along = dot3(c->frame, g->align);
  double across = sqrt(fmax(dot3(g->align, g->align) - along * along, 1e-12));
  add_wrench(c, c->impulse, whole);
  for (int shift = 0; shift < 2; shift++) {
    placement p;
    cav_four before[6], after[6], kept[6], wrench[6];
    displace(c, g, side, shift, along, across, &p);
    velocity_rate(c, dim, now, &p, side, shift, before);
    velocity_rate(c, dim, next, &p, side, shift, after);
    put_three(derivative->dist[side] + 3 * shift, &p.dist);
    for (int i = 0; i < 3; i++) put_three(derivative->pos[side][i] + 3 * shift, &p.pos[i]);
    if (ahead) {
      cav_four way[2];
      way_rate(c, ahead, &p, side, shift, way);
      for (int i = 0; i < 2; i++) put_three(derivative->way[side][i] + 3 * shift, &way[i]);
    }
    for (int j = 0; j < dim; j++) kept[j] = (1 - c->damping[j]) * before[j] - after[j];
    // the impulse turns with the frame and acts at the displaced position
    for (int i = 0; i < 3; i++) wrench[i] = wrench[3 + i] = (cav_four){0};
    FOUR_CROSS_ADD3(wrench, p.rotation, whole);
    FOUR_CROSS_ADD3(wrench, p.pos, whole + 3);
    FOUR_CROSS_ADD3(wrench + 3, p.rotation, whole + 3);
    for (int i = 0; i < dim; i++) {
      const double *e = c->frame + 3 * (i % 3);
      cav_four rate = law->by_dist[i] * p.dist, *part = i < 3 ? wrench + 3 : wrench;
      for (int j = 0; j < dim; j++) rate += H[i * dim + j] * kept[j];
      put_three(derivative->velocity[side][i] + 3 * shift, &after[i]);
      put_three(derivative->impulse[side][i] + 3 * shift, &rate);
      for (int r = 0; r < 3; r++) part[r] = part[r] + rate * e[r];
    }
    for (int r = 0; r < 6; r++)
      for (int k = 0; k < 3; k++) derivative->wrench[side][3 * shift + k][r] = wrench[r][k];
  }
}
// most contacts have three rows: known where it is compiled, that leaves loops out
CAV_VECTOR_BODY void fill_side_body(const cav_contact *c, const geometry *g, const motion *now, const motion *next,
                                    const law_derivative *law, const cav_next_contact *ahead, const double *H, int side,
                                    cav_contact_jacobian *derivative) {
  if (c->dim == 3 && !ahead)
    fill_rows(c, 3, g, now, next, law, NULL, H, side, derivative);
  else
    fill_rows(c, c->dim, g, now, next, law, ahead, H, side, derivative);
}
CAV_BY_VECTORS(fill_side,
               (const cav_contact *c, const geometry *g, const motion *now, const motion *next,
                const law_derivative *law, const cav_next_contact *ahead, const double *H, int side,
                cav_contact_jacobian *derivative),
               (c, g, now, next, law, ahead, H, side, derivative))

// whether the law is flat: no curvature beside that of a contact that pushes, which is 1/R
static int is_flat(const cav_contact *c, const double *H) {
  double fraction = 0;
  for (int i = 0; i < c->dim; i++) fraction += H[i * c->dim + i] * c->regulariser[i];
  return fraction < FLAT;
}

// the curvature in the frame and in world axes, of rows along the axes of the contact alone
CAV_VECTOR_BODY void curve_lines_body(const cav_contact *c, const double *H, cav_contact_jacobian *derivative) {
  cav_four sum[3] = {{0}}, axis[3];
  for (int j = 0; j < c->dim; j++) axis[j] = (cav_four){c->frame[3 * j], c->frame[3 * j + 1], c->frame[3 * j + 2], 0};
  for (int i = 0; i < c->dim; i++) {
    const double *x = c->frame + 3 * i;
    for (int j = 0; j < c->dim; j++) {
      const double h = derivative->hessian[i][j] = H[i * c->dim + j];
      for (int r = 0; r < 3; r++) sum[r] = sum[r] + h * x[r] * axis[j];
    }
  }
  for (int r = 0; r < 3; r++) put_three(&derivative->by_velocity[3 + r][3], &sum[r]);
}
CAV_BY_VECTORS(curve_lines, (const cav_contact *c, const double *H, cav_contact_jacobian *derivative),
               (c, H, derivative))

// a matrix of a contact's rows in world axes
static void turn_rows(const cav_contact *c, const double *H, double out[6][6]) {
  memset(out, 0, 36 * sizeof out[0][0]);
  for (int i = 0; i < c->dim; i++) {
    for (int j = 0; j < c->dim; j++) {
      const double h = H[i * c->dim + j], *x = c->frame + 3 * (i % 3), *y = c->frame + 3 * (j % 3);
      const int row = i < 3 ? 3 : 0, column = j < 3 ? 3 : 0;
      for (int r = 0; r < 3; r++) {
        for (int s = 0; s < 3; s++) out[row + r][column + s] += h * x[r] * y[s];
      }
    }
  }
}

// the curvature of all rows
static void curve(const cav_contact *c, const double *H, cav_contact_jacobian *derivative) {
  if (c->dim <= 3) {
    memset(derivative->by_velocity, 0, sizeof derivative->by_velocity);
    curve_lines(c, H, derivative);
    return;
  }
  for (int i = 0; i < c->dim; i++)
    for (int j = 0; j < c->dim; j++) derivative->hessian[i][j] = H[i * c->dim + j];
  turn_rows(c, H, derivative->by_velocity);
}

// the same by the velocity before the step, whatever part of it each row takes
static void curve_before(const cav_contact *c, const double *H, cav_contact_jacobian *derivative) {
  double kept[36];
  for (int i = 0; i < c->dim * c->dim; i++) kept[i] = (1 - c->damping[i % c->dim]) * H[i];
  turn_rows(c, kept, derivative->by_before);
}

void cav_contact_differentiate(const cav_model *model, cav_state *state, const cav_contact *c, int whole,
                               cav_pair_manifolds *manifolds, cav_contact_jacobian *derivative) {
  law_derivative law;
  double H[36];
  differentiate_law(model, state, c, H, &law);
  derivative->idle = !whole && is_flat(c, H);
  if (derivative->idle) return;
  geometry g;
  contact_geometry(model, state, c, manifolds, &g);
  motion now, next;
  move(state, c, state->velocity, cav_takes_mean(state) ? state->velocity_next : NULL, &now);
  move(state, c, state->velocity_next, NULL, &next);
  const int slip = c->dim > 1 && state->options.next_slip == CAV_NEXT_SLIP_EXACT;
  const cav_next_contact *ahead = slip ? cav_contact_next(state, c) : NULL;
  for (int side = 0; side < 2; side++) {
    if ((side ? c->link2 : c->link1) > 0) fill_side(c, &g, &now, &next, &law, ahead, H, side, derivative);
  }

  curve(c, H, derivative);
  if (state->options.stops) curve_before(c, H, derivative);
}
