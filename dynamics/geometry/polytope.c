/// Contact points of convex bodies by one way: a mesh, a prism of a height field, an ellipsoid or a cylinder against
/// anything convex, but a sphere or a capsule outside a solid, which have routines of their own.
///
/// convex.c gives the exact direction in which the two bodies are furthest apart or least inside each other. Where it
/// is the normal of a face, the points of the other body over that face touch too, each with its own height: the
/// opposite face cut to the prism above it, both ends of a segment, three points of a rim. At most 8: the deepest, then
/// those furthest from the ones taken. Else one point, at the middle of what meets.
/// Round edges (spheres, capsules) are the core grown by a radius, margins likewise: no case of their own.
/// Not done: choosing between two ways out of an overlap by history; ways of equal depth may jump.
#include "gjk.h"
#include "math3.h"
#include "pairs.h"

// cosine beyond which the direction is a face's normal (1.4e-5 rad)
static const double ON_NORMAL = 1 - 1e-10;
// tangent of the angle by which a mesh on a plane leans to find what else could touch: a smaller one misses the far end
// of a limb that lies down, a larger one finds the outer edges of a rounded sole instead of the sole
static const double LEAN = 0.5;
// cosine to a face's normal beyond which a cylinder stands on its cap; corners of a regular triangle in a circle
static const double UPRIGHT = 0.9,
                    TRIANGLE[3][2] = {{1, 0}, {-0.5, 0.86602540378443864676}, {-0.5, -0.86602540378443864676}};

// --- polyhedra: meshes, boxes, and the segments and points that are cores ---

int cav_shape_corners(const cav_shape *s) {
  return s->type == CAV_GEOM_MESH      ? s->mesh->nvertex
         : s->type == CAV_GEOM_BOX     ? 8
         : s->type == CAV_GEOM_CAPSULE ? 2
                                       : 1;
}

void cav_shape_corner(const cav_shape *s, int v, double x[3]) {
  double local[3] = {0, 0, 0};
  if (s->type == CAV_GEOM_MESH) copy3(local, s->mesh->vertex + 3 * v);
  if (s->type == CAV_GEOM_CAPSULE) local[2] = v ? s->size[1] : -s->size[1];
  for (int k = 0; k < 3 && s->type == CAV_GEOM_BOX; k++) local[k] = v >> k & 1 ? s->size[k] : -s->size[k];
  transform(x, s->pos, s->rotation, local);
}

int cav_shape_neighbours(const cav_shape *s, int v, int w) {
  if (s->type != CAV_GEOM_MESH) return ((v ^ w) & ((v ^ w) - 1)) == 0;
  const cav_mesh *m = s->mesh;
  for (int k = m->neighbour_start[v]; k < m->neighbour_start[v + 1]; k++) {
    if (m->neighbour[k] == w) return 1;
  }
  return 0;
}

int cav_shape_faces(const cav_shape *s) {
  return s->type == CAV_GEOM_MESH ? s->mesh->nface : s->type == CAV_GEOM_BOX ? 6 : 0;
}

void cav_shape_normal(const cav_shape *s, int face, double n[3]) {
  if (s->type == CAV_GEOM_MESH) {
    rotate(n, s->rotation, s->mesh->plane + 4 * face);
    return;
  }
  column3(n, s->rotation, face / 2);
  if (face & 1) scale3(n, -1, n);
}

static void push_point(cav_outline *o, const double x[3], int from, int to) {
  if (o->n == CAV_OUTLINE_MAX) return;
  copy3(o->x[o->n], x);
  o->line[o->n][0] = from;
  o->line[o->n++][1] = to;
}

static void push_corner(cav_outline *o, const double x[3]) { push_point(o, x, o->n - 1, o->n); }

void cav_outline_push(const cav_shape *s, int face, cav_outline *o) {
  double x[3];
  if (s->type == CAV_GEOM_BOX) {
    // counterclockwise from outside
    int k0 = face / 2, k1 = 1 << (k0 + 1) % 3, k2 = 1 << (k0 + 2) % 3, side = face & 1 ? 0 : 1 << k0;
    const int corner[4] = {0, k1, k1 | k2, k2};
    for (int i = 0; i < 4; i++) {
      cav_shape_corner(s, side | corner[face & 1 ? 3 - i : i], x);
      push_corner(o, x);
    }
    return;
  }
  const cav_mesh *m = s->mesh;
  // of very many every second, third, ...
  int first = m->face[face], corners = m->face[face + 1] - first;
  int step = (corners + CAV_OUTLINE_MAX - 1) / CAV_OUTLINE_MAX;
  for (int k = 0; k < corners; k += step) {
    cav_shape_corner(s, m->corner[first + k], x);
    push_corner(o, x);
  }
}

typedef struct contact_pair {
  const cav_shape *a, *b;
  int near_a, near_b; ///< corners of meshes about which they meet, -1: not known
  double radius_a, radius_b, size, margin;
  cav_separation separation;
} contact_pair;

double cav_shape_size(const cav_shape *s) {
  if (s->type == CAV_GEOM_SPHERE) return s->size[0];
  if (s->type == CAV_GEOM_CAPSULE || s->type == CAV_GEOM_CYLINDER) return s->size[0] + s->size[1];
  return s->size[0] + s->size[1] + s->size[2];
}

// --- faces ---

// of the faces of a mesh that meet at its furthest corner along a direction in its axes the one that looks most along
// it; -1 if there is none
static int mesh_face_along(const cav_mesh *m, int corner, const double local[3]) {
  double most = -1;
  int best = -1, first = m->meeting ? m->meeting_start[corner] : 0;
  int end = m->meeting ? m->meeting_start[corner + 1] : m->nface;
  for (int k = first; k < end; k++) {
    int f = m->meeting ? m->meeting[k] : k;
    double c = dot3(m->plane + 4 * f, local);
    if (c > most) most = c, best = f;
  }
  return best;
}

// that face, or where there is none the corner alone; near: a corner about there, -1: not known
static void lowest_face(const cav_shape *s, const double n[3], int near, cav_outline *o) {
  double local[3];
  rotate_back(local, s->rotation, n);
  int corner = cav_mesh_summit_from(s->mesh, local, near), face = mesh_face_along(s->mesh, corner, local);
  o->n = 0;
  if (face >= 0) {
    cav_outline_push(s, face, o);
    return;
  }
  double x[3];
  cav_shape_corner(s, corner, x);
  push_corner(o, x);
}

// the face of a box that looks most along n
static int box_face_along(const cav_shape *s, const double n[3]) {
  double local[3];
  rotate_back(local, s->rotation, n);
  int axis = fabs(local[1]) > fabs(local[0]) ? 1 : 0;
  if (fabs(local[2]) > fabs(local[axis])) axis = 2;
  return 2 * axis + (local[axis] < 0);
}

// the face of a body that looks most along n: outline, normal out of it; returns the cosine, -1 where there is none. near:
// a corner furthest along n, -1: not known. A cylinder's cap has a normal but no outline
static double face_along(const cav_shape *s, const double n[3], int near, cav_outline *o, double normal[3]) {
  int best = -1;
  o->n = 0;
  if (s->type == CAV_GEOM_CYLINDER) {
    column3(normal, s->rotation, 2);
    if (dot3(normal, n) < 0) scale3(normal, -1, normal);
    return dot3(normal, n);
  }
  if (s->type == CAV_GEOM_BOX) best = box_face_along(s, n);
  if (s->type == CAV_GEOM_MESH) {
    double local[3];
    rotate_back(local, s->rotation, n);
    best = mesh_face_along(s->mesh, near >= 0 ? near : cav_mesh_summit(s->mesh, local), local);
  }
  if (best < 0) return -1;
  cav_shape_normal(s, best, normal);
  double most = dot3(normal, n);
  // the outline is of use only where the normal is met
  if (most >= ON_NORMAL) cav_outline_push(s, best, o);
  return most;
}

// of a capsule or a cylinder the axis u and the direction across it that looks most along back; returns how far that turns
// back, and how far back looks along the axis
static double lowest_across(const cav_shape *s, const double back[3], double u[3], double out[3], double *along) {
  column3(u, s->rotation, 2);
  *along = dot3(u, back);
  axpy3(out, back, -*along, u);
  return normalise3(out);
}

// what of a body could lie on a face whose normal is m: a face, a segment, three points of a rim, or nothing
static void lying_on(const cav_shape *s, const double m[3], int near, cav_outline *o) {
  double back[3], normal[3], u[3], x[3];
  scale3(back, -1, m);
  o->n = 0;
  if (s->type == CAV_GEOM_MESH) {
    lowest_face(s, back, near, o);
    return;
  }
  if (s->type == CAV_GEOM_BOX) {
    face_along(s, back, near, o, normal);
    return;
  }
  if (s->type != CAV_GEOM_CAPSULE && s->type != CAV_GEOM_CYLINDER) return;
  double radius = s->size[0], half = s->size[1], out[3], along;
  if (lowest_across(s, back, u, out, &along) < 1e-9) column3(out, s->rotation, 0);
  if (s->type == CAV_GEOM_CYLINDER && fabs(along) > UPRIGHT) {
    // as on a plane: a regular triangle with one corner at the lowest point
    double w[3], cap[3];
    cross3(w, u, out);
    axpy3(cap, s->pos, along < 0 ? -half : half, u);
    for (int k = 0; k < 3; k++) {
      axpy3(x, cap, TRIANGLE[k][0] * radius, out);
      axpy3(x, x, TRIANGLE[k][1] * radius, w);
      push_corner(o, x);
    }
    return;
  }
  for (int end = 0; end < 2; end++) {
    axpy3(x, s->pos, end ? half : -half, u);
    // a capsule's round edge is lowest straight below its core, a cylinder's on its side
    if (s->type == CAV_GEOM_CAPSULE)
      axpy3(x, x, radius, back);
    else
      axpy3(x, x, radius, out);
    push_corner(o, x);
  }
}

// of an outline what is not cut away, where direction . x > bound, by the plane over side of a face; 0: all of it is left
static int cut(const cav_outline *o, const double direction[3], double bound, int side, cav_outline *kept) {
  double h[CAV_OUTLINE_MAX], most = -INFINITY;
  int closed = o->n > 2;
  for (int k = 0; k < o->n; k++) {
    h[k] = dot3(direction, o->x[k]) - bound;
    most = h[k] > most ? h[k] : most;
  }
  if (most <= 0) return 0;
  kept->n = 0;
  for (int k = 0; k < o->n; k++) {
    const double *x = o->x[k], *y = o->x[(k + 1) % o->n];
    double hx = h[k], hy = h[(k + 1) % o->n];
    int line = o->line[k][1];
    if (hx <= 0) push_point(kept, x, o->line[k][0], line);
    if ((hx <= 0) == (hy <= 0) || (!closed && k == o->n - 1)) continue;
    double d[3], p[3];
    sub3(d, y, x);
    axpy3(p, x, hx / (hx - hy), d);
    push_point(kept, p, hx <= 0 ? line : CAV_OUTLINE_CUT + side, hx <= 0 ? CAV_OUTLINE_CUT + side : line);
  }
  return 1;
}

// outward normal of the plane over a side of a face; its length, 0: none
static double over_side(const cav_outline *face, int k, const double normal[3], double out[3]) {
  double e[3];
  sub3(e, face->x[(k + 1) % face->n], face->x[k]);
  cross3(out, e, normal);
  return normalise3(out);
}

// cuts to the prism over a face, or to the disk of a cylinder's cap by dropping what is outside
static void cut_to_face(cav_outline *o, const cav_outline *face, const double normal[3], const cav_shape *ground) {
  cav_outline spare, *from = o, *to = &spare;
  for (int k = 0; k < face->n && from->n; k++) {
    double out[3], length = over_side(face, k, normal, out);
    if (!(length > 0)) continue;
    if (!cut(from, out, dot3(out, face->x[k]) + 1e-12 * length, k, to)) continue;
    cav_outline *swap = from;
    from = to;
    to = swap;
  }
  if (from != o) {
    o->n = from->n;
    memcpy(o->x, from->x, (size_t)from->n * sizeof *from->x);
    memcpy(o->line, from->line, (size_t)from->n * sizeof *from->line);
  }
  if (face->n) return;
  int kept = 0;
  for (int k = 0; k < o->n; k++) {
    double d[3];
    sub3(d, o->x[k], ground->pos);
    double along = dot3(d, normal), radius2 = dot3(d, d) - along * along;
    if (radius2 > ground->size[0] * ground->size[0]) continue;
    memmove(o->line[kept], o->line[k], sizeof *o->line);
    copy3(o->x[kept++], o->x[k]);
  }
  o->n = kept;
}

// the deepest; of several as deep the one furthest from the middle of all, thus a corner
static int first_kept(const cav_touch *touch, int n) {
  double middle[3] = {0, 0, 0}, d[3], spread = 0, deepest = INFINITY, far = -1;
  int best = 0;
  for (int i = 0; i < n; i++) {
    axpy3(middle, middle, 1.0 / n, touch[i].pos);
    deepest = fmin(deepest, touch[i].dist);
  }
  for (int pass = 0; pass < 2; pass++) {
    for (int i = 0; i < n; i++) {
      sub3(d, touch[i].pos, middle);
      double length = norm3(d);
      if (pass == 0) spread = fmax(spread, length);
      if (pass == 1 && touch[i].dist <= deepest + 1e-6 * spread && length > far) far = length, best = i;
    }
  }
  return best;
}

// how much a contact adds to those taken: distance from the first; from the line of two; from that line on the side
// where the third is not; then from the nearest
static double worth(const cav_touch *touch, int taken, const cav_touch *t) {
  double e[3], d[3], third[3], least = INFINITY;
  sub3(e, touch[taken > 1].pos, touch[0].pos);
  sub3(d, t->pos, touch[0].pos);
  if (taken == 2 || taken == 3) {
    double e2 = dot3(e, e);
    if (e2 > 0) axpy3(d, d, -dot3(d, e) / e2, e);
    if (taken == 2) return norm3(d);
    sub3(third, touch[2].pos, touch[0].pos);
    return -dot3(d, third);
  }
  for (int j = 0; j < taken; j++) {
    sub3(d, t->pos, touch[j].pos);
    double length2 = dot3(d, d);
    if (length2 < least) least = length2;
  }
  return least;
}

int cav_thin_out(cav_touch *touch, int n, int most) {
  if (n <= most) return n;
  for (int taken = 0; taken < most; taken++) {
    int best = taken ? taken : first_kept(touch, n);
    double far = -INFINITY;
    for (int i = taken; i < n && taken; i++) {
      double score = worth(touch, taken, &touch[i]);
      if (score > far) far = score, best = i;
    }
    cav_touch swap = touch[taken];
    touch[taken] = touch[best];
    touch[best] = swap;
  }
  return most;
}

// distance of the corners of a body's face, or of a cap's rim, from its axis through the middle
static double width_of(const cav_shape *s, const cav_outline *face, const double m[3]) {
  double most = 0;
  for (int k = 0; k < face->n; k++) {
    double d[3];
    sub3(d, face->x[k], s->pos);
    axpy3(d, d, -dot3(d, m), m);
    most = fmax(most, norm3(d));
  }
  return face->n ? most : s->size[0];
}

/// What stands over a face that the direction is square to.
typedef struct standing {
  const cav_shape *ground, *other;
  int on_b;
  double m[3], top; ///< normal out of the face, and its height along that
  cav_outline face, lying;
} standing;

// finds it; 0 if the direction is no face's normal
static int stand(const contact_pair *g, standing *s) {
  cav_outline face_b;
  double normal_a[3], normal_b[3], back[3], x[3];
  scale3(back, -1, g->separation.n);
  double ca = face_along(g->a, g->separation.n, g->near_a, &s->face, normal_a),
         cb = face_along(g->b, back, g->near_b, &face_b, normal_b);
  s->on_b = cb >= ca - 1e-9;
  if (fmax(ca, cb) < ON_NORMAL) return 0;
  // face on face: whatever is narrower than a cap stands on it
  if (s->on_b && ca >= ON_NORMAL && g->a->type == CAV_GEOM_CYLINDER)
    s->on_b = width_of(g->a, &s->face, normal_a) < width_of(g->b, &face_b, normal_b);
  s->ground = s->on_b ? g->b : g->a;
  s->other = s->on_b ? g->a : g->b;
  copy3(s->m, s->on_b ? normal_b : normal_a);
  if (s->on_b) s->face = face_b;
  cav_shape_support(s->ground, s->m, x);
  s->top = dot3(s->m, x);
  lying_on(s->other, s->m, s->on_b ? g->near_a : g->near_b, &s->lying);
  cut_to_face(&s->lying, &s->face, s->m, s->ground);
  return 1;
}

// points over a face that the direction stands square on, of all heights: which are taken does not depend on how far points
// are sought; 0 if none
static int touch_face(const contact_pair *g, cav_touch *touch) {
  standing s;
  if (!stand(g, &s)) return 0;
  cav_touch found[CAV_OUTLINE_MAX];
  for (int k = 0; k < s.lying.n; k++) {
    double height = dot3(s.m, s.lying.x[k]) - s.top;
    cav_touch *t = &found[k];
    axpy3(t->pos, s.lying.x[k], -height / 2, s.m);
    scale3(t->normal, s.on_b ? -1 : 1, s.m);
    zero3(t->tangent);
    t->dist = height;
    t->feature = 1 + k;
  }
  int count = cav_thin_out(found, s.lying.n, CAV_TOUCH_MAX);
  for (int k = 0; k < count; k++) touch[k] = found[k];
  return count;
}

// normal of a plane polygon
static void normal_of(const cav_outline *o, double n[3]) {
  zero3(n);
  for (int k = 2; k < o->n; k++) {
    double u[3], w[3], c[3];
    sub3(u, o->x[k - 1], o->x[0]);
    sub3(w, o->x[k], o->x[0]);
    cross3(c, u, w);
    add3(n, n, c);
  }
  normalise3(n);
}

_Static_assert((int)CAV_FACE_POINTS == (int)CAV_OUTLINE_MAX, "a point for each corner of an outline");

// how the corners of what of a cylinder lies on a face whose normal is m roll on it; 0: it stands upright on it
static int rolling(const cav_shape *s, const double m[3], double roll[3][3], double turning[3]) {
  double back[3], u[3], out[3], w[3], along;
  scale3(back, -1, m);
  double across = lowest_across(s, back, u, out, &along);
  if (across < 1e-9) return 0;
  cross3(w, u, out);
  cross3(turning, w, back);
  scale3(turning, 1 / across, turning);
  for (int k = 0; k < 3; k++) {
    const double *c = TRIANGLE[fabs(along) > UPRIGHT ? k : 0];
    scale3(roll[k], s->size[0] * c[0], w);
    axpy3(roll[k], roll[k], -s->size[0] * c[1], out);
  }
  return 1;
}

// how far x is between two points
static double fraction_of(const double x[3], const double from[3], const double to[3]) {
  double d[3], e[3];
  sub3(d, x, from);
  sub3(e, to, from);
  double length2 = dot3(e, e);
  return length2 > 0 ? dot3(d, e) / length2 : 0;
}

int cav_face_points(const cav_shape *a, const cav_shape *b, double margin, cav_hint *hint,
                    cav_face_point point[CAV_FACE_POINTS]) {
  contact_pair g = {a, b, -1, -1, .size = fmax(cav_shape_size(a), cav_shape_size(b)), .margin = margin};
  standing s;
  cav_outline whole;
  if (!cav_separation_solve(a, b, margin, hint, &g.separation) || !stand(&g, &s)) return 0;
  double roll[3][3] = {{0}}, turning[3] = {0};
  if (s.other->type == CAV_GEOM_CYLINDER && !rolling(s.other, s.m, roll, turning)) return 0;
  lying_on(s.other, s.m, -1, &whole);
  for (int k = 0; k < s.lying.n; k++) {
    cav_face_point *p = &point[k];
    const int *line = s.lying.line[k], cuts = (line[0] >= CAV_OUTLINE_CUT) + (line[1] >= CAV_OUTLINE_CUT);
    *p = (cav_face_point){.feature = 1 + k, .on_b = s.on_b};
    copy3(p->normal, s.m);
    copy3(p->turning, turning);
    axpy3(p->place, s.lying.x[k], cav_core_of(s.other).radius, s.m);
    if (cuts == 0 && s.other->type == CAV_GEOM_CYLINDER) copy3(p->roll, roll[line[1]]);
    if (cuts == 2) normal_of(&whole, p->face);
    if (cuts != 1) continue;
    int cut_by = line[line[1] >= CAV_OUTLINE_CUT], own = line[line[0] >= CAV_OUTLINE_CUT];
    int to = (own + 1) % whole.n;
    over_side(&s.face, cut_by - CAV_OUTLINE_CUT, s.m, p->over);
    sub3(p->side, whole.x[to], whole.x[own]);
    normalise3(p->side);
    if (s.other->type != CAV_GEOM_CYLINDER) continue;
    double part = fraction_of(s.lying.x[k], whole.x[own], whole.x[to]);
    scale3(p->roll, 1 - part, roll[own]);
    axpy3(p->roll, p->roll, part, roll[to]);
  }
  return s.lying.n;
}

void cav_face_point_move(const cav_face_point *p, const double twist[6], const double arm[3], double move[3]) {
  copy3(move, twist + 3);
  cross_add3(move, twist, arm);
  axpy3(move, move, dot3(p->turning, twist), p->roll);
  // over a side of the face it slides along the other body's side, over a corner it only rises
  double along = dot3(p->side, p->over), square = dot3(p->face, p->normal);
  if (along != 0) axpy3(move, move, -dot3(p->over, move) / along, p->side);
  if (square != 0) scale3(move, dot3(p->face, move) / square, p->normal);
}

static int touch_single(const contact_pair *g, double dist, cav_touch *touch) {
  double x[3], y[3];
  axpy3(x, g->separation.x, g->radius_a, g->separation.n);
  axpy3(y, g->separation.y, -g->radius_b, g->separation.n);
  add3(touch->pos, x, y);
  scale3(touch->pos, 0.5, touch->pos);
  copy3(touch->normal, g->separation.n);
  zero3(touch->tangent);
  touch->dist = dist;
  touch->feature = 0;
  return 1;
}

static int meet(contact_pair *g, cav_touch *touch) {
  double dist = g->separation.gap - g->radius_a - g->radius_b;
  if (!(dist < g->margin)) return 0;
  int count = touch_face(g, touch);
  double lowest = INFINITY;
  for (int k = 0; k < count; k++) lowest = fmin(lowest, touch[k].dist);
  // a face whose points all stand higher than what was found is not what meets: a rim, a slanting side
  if (!(lowest < dist + 1e-6 * g->size)) {
    if (count == CAV_TOUCH_MAX) count--;
    touch_single(g, dist, &touch[count++]);
  }
  int kept = 0;
  for (int k = 0; k < count; k++)
    if (touch[k].dist < g->margin) touch[kept++] = touch[k];
  return kept;
}

int cav_points_over(const cav_shape *s, double corner[3][3], const double normal[3], double point[][3]) {
  cav_outline face = {.n = 3}, lying;
  double back[3];
  for (int k = 0; k < 3; k++) copy3(face.x[k], corner[k]);
  lying_on(s, normal, -1, &lying);
  if (!lying.n) {
    // a sphere or an ellipsoid: its lowest point
    scale3(back, -1, normal);
    cav_shape_support(s, back, lying.x[0]);
    lying.n = 1;
  }
  cut_to_face(&lying, &face, normal, NULL);
  int count = lying.n < CAV_LYING_MAX ? lying.n : CAV_LYING_MAX;
  for (int k = 0; k < count; k++) copy3(point[k], lying.x[k]);
  return count;
}

// the same from where the last search of the pair ended
static int collide_again(const cav_shape *a, const cav_shape *b, double margin, cav_hint *hint, cav_touch *touch) {
  contact_pair g = {a, b, -1, -1, .size = fmax(cav_shape_size(a), cav_shape_size(b)), .margin = margin};
  g.radius_a = cav_core_of(a).radius;
  g.radius_b = cav_core_of(b).radius;
  if (!cav_separation_solve(a, b, margin, hint, &g.separation)) return 0;
  if (hint && hint->na && a->type == CAV_GEOM_MESH) g.near_a = hint->a[0];
  if (hint && hint->na) g.near_b = hint->b[0];
  return meet(&g, touch);
}

int cav_collide_convex(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  return collide_again(a, b, margin, NULL, touch);
}

// half lengths of a box about a shape's centre, in its axes
static void box_of(const cav_shape *s, double half[3]) {
  copy3(half, s->size);
  if (s->type == CAV_GEOM_SPHERE) set3(half, s->size[0], s->size[0], s->size[0]);
  if (s->type == CAV_GEOM_CAPSULE) set3(half, s->size[0], s->size[0], s->size[0] + s->size[1]);
  if (s->type == CAV_GEOM_CYLINDER) set3(half, s->size[0], s->size[0], s->size[1]);
}

// whether boxes about two shapes are further apart than a margin along an axis of one of them
static int boxes_apart(const cav_shape *a, const cav_shape *b, double margin) {
  double half[2][3], R[9], d[3], between[2][3];
  box_of(a, half[0]);
  box_of(b, half[1]);
  sub3(d, b->pos, a->pos);
  rotate_back(between[0], a->rotation, d);
  rotate_back(between[1], b->rotation, d);
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 3; k++)
      R[3 * i + k] = fabs(a->rotation[i] * b->rotation[k] + a->rotation[3 + i] * b->rotation[3 + k] +
                          a->rotation[6 + i] * b->rotation[6 + k]);
  for (int i = 0; i < 3; i++) {
    double one = half[0][i] + dot3(R + 3 * i, half[1]);
    double other = half[1][i] + R[i] * half[0][0] + R[3 + i] * half[0][1] + R[6 + i] * half[0][2];
    if (fabs(between[0][i]) - one > margin || fabs(between[1][i]) - other > margin) return 1;
  }
  return 0;
}

int cav_collide_hinted(const cav_shape *a, const cav_shape *b, double margin, cav_hint *hint, cav_touch *touch) {
  return boxes_apart(a, b, margin) ? 0 : collide_again(a, b, margin, hint, touch);
}

int cav_collide_plane_mesh(const cav_shape *a, const cav_shape *b, double margin, cav_touch *touch) {
  enum { SIDES = 4 };
  const cav_mesh *m = b->mesh;
  double n[3], local[3], d[3], side[2][3], axis[3] = {0, 0, 0};
  column3(n, a->rotation, 2);
  rotate_back(local, b->rotation, n);
  sub3(d, b->pos, a->pos);
  double base = dot3(d, n);
  // sides: the diagonals of two of the mesh's axes, its principal ones, seen along the plane's normal
  int most = fabs(local[1]) > fabs(local[0]) ? 1 : 0;
  if (fabs(local[2]) > fabs(local[most])) most = 2;
  axis[(most + 1) % 3] = axis[(most + 2) % 3] = 1;
  axpy3(side[0], axis, -dot3(axis, local), local);
  normalise3(side[0]);
  cross3(side[1], local, side[0]);
  int count = 0;
  for (int k = 0; k <= SIDES; k++) {
    double down[3];
    scale3(down, -1, local);
    if (k) axpy3(down, down, k % 2 ? LEAN : -LEAN, side[(k - 1) / 2]);
    int v = cav_mesh_summit(m, down), known = 0;
    double height = base + dot3(local, m->vertex + 3 * v), x[3];
    if (!k && !(height < margin)) return 0;
    for (int i = 0; i < count; i++) known |= touch[i].feature == v;
    if (known || !(height < margin)) continue;
    cav_touch *t = &touch[count++];
    cav_shape_corner(b, v, x);
    axpy3(t->pos, x, -height / 2, n);
    copy3(t->normal, n);
    zero3(t->tangent);
    t->dist = height;
    t->feature = v;
  }
  return count;
}
