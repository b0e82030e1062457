/// Contacts after the step (METHOD.md, 10). The normal row of the paper looks ahead along a line, gap + h n.v_next; where
/// links turn that is off by h^2 times curvature and centripetal acceleration, 19 mm for a foot 0.15 m from the joint at
/// 20 rad/s and h = 25 ms, and a plan stands on what is not there. Here links are placed at q (+) h v_next and the
/// narrow phase finds the gap x' of the same point of the same pair, so that the row sees (x' - x)/h for n.v_next. In
/// the inverse v_next is known: it stays closed. The derivative of a distance by its geoms' twists is exact whatever
/// they touch with, so no geometry is differenced.
///
/// A distance tells no side once a geom is through the other, nor through its edge: from a tenth of the geoms' thickness
/// deep on, by the linear gap, which does, the linear gap takes over, all of it at 0.35 of the thickness. Planes and
/// height fields have no other side; a mesh is given no thickness of its own. Where the point is gone after the step
/// (edges, faces and manifolds have points that come and go), the linear gap stands too. Between links of one tree, which nothing
/// stands on, a mesh has the linear gap alone: points that come and go within a step gave steps several solutions, or none.
#include <math.h>

#include "constraint.h"
#include "math3.h"

// fractions of the thickness between which the linear gap takes over
static const double SHELL = 0.1, CORE = 0.35;

// least half width, infinite where there is no other side
static double inner_radius(const cav_geom *geom) {
  const double *size = geom->size;
  switch (geom->type) {
    case CAV_GEOM_PLANE:
    case CAV_GEOM_HFIELD:
      return INFINITY;
    case CAV_GEOM_SPHERE:
    case CAV_GEOM_CAPSULE:
      return size[0];
    case CAV_GEOM_CYLINDER:
      return fmin(size[0], size[1]);
    case CAV_GEOM_ELLIPSOID:
    case CAV_GEOM_BOX:
      return fmin(size[0], fmin(size[1], size[2]));
    case CAV_GEOM_MESH:
    case CAV_GEOM_TYPES:
      break;
  }
  return 0;
}

int cav_sees_next_gap(const cav_model *model, const cav_pair *pair) {
  return pair->external || !cav_pair_has_mesh(model, pair);
}

// how far the linear gap leaves the other one its say, 0 to 1, and the derivative
static double trust(double linear, double thickness, double *derivative) {
  *derivative = 0;
  if (!(thickness < INFINITY)) return 1;
  if (!(thickness > 0)) return linear >= 0;
  double x = (linear / thickness + CORE) / (CORE - SHELL);
  if (x <= 0 || x >= 1) return x >= 1;
  *derivative = 6 * x * (1 - x) / ((CORE - SHELL) * thickness);
  return x * x * (3 - 2 * x);
}

static void place(const cav_model *model, const cav_pose *link, const cav_geom *geom, cav_shape *shape) {
  *shape = cav_shape_of(model, geom);
  transform(shape->pos, link[geom->link].pos, link[geom->link].rotation, geom->pos);
  matmul3(shape->rotation, link[geom->link].rotation, geom->rotation);
}

// at most how far the points of a geom move that may touch: its own, or those that are at most size away from it
static double travel(const cav_state *state, const cav_geom *geom, const double point[3]) {
  const cav_next_knot *next = state->work->next;
  const cav_pose *from = &state->link[geom->link], *to = &next->link[geom->link];
  double moved[3], there[3], arm[3], back[3];
  sub3(arm, point, from->pos);
  rotate_back(back, from->rotation, arm);
  transform(there, to->pos, to->rotation, back);
  sub3(moved, there, point);
  // chord of the rotation between the two, over what of the geom is further away
  double square = 0;
  for (int i = 0; i < 9; i++) square += (to->rotation[i] - from->rotation[i]) * (to->rotation[i] - from->rotation[i]);
  double bound = geom->type == CAV_GEOM_PLANE ? 0 : 2 * geom->bound;
  return norm3(moved) + sqrt(square) * bound;
}

// Points of a pair after the step, within a margin; of a pair with a mesh those of all its contacts are sought once.
typedef struct sought {
  int pair, count;
  double margin;
  cav_touch touch[CAV_TOUCH_MAX];
} sought;

// no point of the pair of contact c can be further away then
static double margin_of(const cav_model *model, const cav_state *state, const cav_contact *c) {
  const cav_pair *pair = &model->pair[c->pair];
  return fabs(c->dist) + travel(state, &model->geom[pair->geom1], c->pos) +
         travel(state, &model->geom[pair->geom2], c->pos) + 1e-3;
}

// Where the search of a mesh found so many points that it may have left some out, and for all others, each contact has
// a search within its own margin
static void seek(const cav_model *model, cav_state *state, const cav_contact *c, double margin, sought *s) {
  cav_next_knot *next = state->work->next;
  const cav_pair *pair = &model->pair[c->pair];
  const cav_geom *first = &model->geom[pair->geom1], *second = &model->geom[pair->geom2];
  const int mesh = cav_pair_has_mesh(model, pair);
  if (mesh && s->pair == c->pair && s->margin >= margin && s->count < CAV_TOUCH_MAX) return;
  s->margin = margin;
  for (int i = 1; mesh && s->pair != c->pair && c + i < state->contact + state->ncontact && c[i].pair == c->pair; i++)
    s->margin = fmax(s->margin, margin_of(model, state, c + i));
  s->pair = c->pair;
  cav_shape a, b;
  place(model, next->link, first, &a);
  place(model, next->link, second, &b);
  s->count = cav_pair_keeps_hint(model, pair) ? cav_collide_again(&a, &b, s->margin, &next->hint[c->pair], s->touch)
                                              : cav_collide_shapes(&a, &b, s->margin, s->touch);
}

static void look(const cav_model *model, cav_state *state, const cav_contact *c, sought *s, cav_next_contact *out) {
  const cav_pair *pair = &model->pair[c->pair];
  const cav_geom *first = &model->geom[pair->geom1], *second = &model->geom[pair->geom2];
  const double h = state->options.timestep, linear = c->dist + h * c->velocity_next[0];
  double derivative, weight = trust(linear, inner_radius(first) + inner_radius(second), &derivative);
  if (weight == 0 || !cav_sees_next_gap(model, pair)) return;
  double margin = margin_of(model, state, c);
  seek(model, state, c, margin, s);
  int k = 0;
  while (k < s->count && s->touch[k].feature != c->feature) k++;
  if (k == s->count || !(s->touch[k].dist < margin)) return;
  double beyond = s->touch[k].dist - linear;
  out->excess[0] = weight * beyond / h;
  out->by_next = weight;
  out->by_linear = derivative * beyond - weight;
  out->margin = margin;
  copy3(out->pos, s->touch[k].pos);
  copy3(out->normal, s->touch[k].normal);
}

void cav_next_gaps_find(const cav_model *model, cav_state *state) {
  sought s = {.pair = -1};
  for (int i = 0; i < state->ncontact; i++) look(model, state, &state->contact[i], &s, &state->work->next->contact[i]);
}

// whether the gap of a point is a distance: then its rate is the velocity along the normal. It is not where points are
// corners of a cut
static int is_distance(const cav_geom *first, const cav_geom *second, int feature) {
  switch (first->type) {
    case CAV_GEOM_PLANE:
      return second->type != CAV_GEOM_CYLINDER;
    case CAV_GEOM_SPHERE:
      return second->type != CAV_GEOM_HFIELD;
    case CAV_GEOM_CAPSULE:
      return (second->type == CAV_GEOM_CAPSULE || second->type == CAV_GEOM_MESH) && feature == 0;
    case CAV_GEOM_BOX:
    case CAV_GEOM_MESH:
    case CAV_GEOM_CYLINDER:
    case CAV_GEOM_ELLIPSOID:
      return second->type == CAV_GEOM_MESH && feature == 0;
    default:
      return 0;
  }
}

// the same of a point over a face of one of two bodies; 0: it is none
static int over_face(const cav_contact *c, cav_pair_manifolds *m, cav_next_contact *out) {
  if (m->faces < 0) m->faces = cav_face_points(&m->a, &m->b, out->margin, m->hint, m->face);
  int i = 0;
  while (i < m->faces && m->face[i].feature != c->feature) i++;
  if (i == m->faces) return 0;
  const cav_face_point *p = &m->face[i];
  double arm[3];
  sub3(arm, p->place, out->pos);
  for (int k = 0; k < 6; k++) {
    double twist[6] = {0}, move[3];
    twist[k] = p->on_b ? -1 : 1;
    cav_face_point_move(p, twist, arm, move);
    out->gradient[k] = dot3(p->normal, move);
  }
  return 1;
}

// whether a contact bears nothing, and nothing near where it is either: beyond where the law of meshes ends
static int is_idle(const cav_state *state, const cav_contact *c) {
  int idle = state->options.smoothing > 0 && c->impulse[0] == 0;
  for (int k = 1; k < c->dim; k++) idle &= c->impulse[k] == 0;
  return idle;
}

// the gradient of the gap there. Where points come and go that of one that moves with the second geom
static void fill_gradient(const cav_model *model, const cav_state *state, const cav_contact *c, cav_pair_manifolds *m,
                          cav_next_contact *out) {
  const cav_pair *pair = &model->pair[c->pair];
  const cav_geom *first = &model->geom[pair->geom1], *second = &model->geom[pair->geom2];
  zero3(out->gradient);
  copy3(out->gradient + 3, out->normal);
  if (out->by_next == 0 || is_distance(first, second, c->feature)) return;
  if (cav_pair_has_mesh(model, pair) && is_idle(state, c)) return;
  if (m->pair != c->pair || m->margin < out->margin) {
    cav_manifolds_start(m, c->pair, fmin(1, fmin(first->bound, second->bound)), out->margin,
                        cav_pair_keeps_hint(model, pair) ? &state->work->next->hint[c->pair] : NULL);
    place(model, state->work->next->link, first, &m->a);
    place(model, state->work->next->link, second, &m->b);
  }
  if (cav_pair_has_mesh(model, pair) && first->type != CAV_GEOM_PLANE && over_face(c, m, out)) return;
  cav_touch here, rate[6];
  if (!cav_touch_rates(m, out->pos, c->feature, &here, rate)) return;
  for (int k = 0; k < 6; k++) out->gradient[k] = rate[k].dist;
}

void cav_next_gaps_differentiate(const cav_model *model, cav_state *state) {
  cav_pair_manifolds manifolds;
  manifolds.pair = -1;
  for (int i = 0; i < state->ncontact; i++)
    fill_gradient(model, state, &state->contact[i], &manifolds, &state->work->next->contact[i]);
}
