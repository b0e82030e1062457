/// How far apart two points of a tree can be, and targets beyond that.
///
/// The way from one point to the other passes the anchors of hinges and balls. Between two anchors that follow each
/// other the distance is given (slides between them add what their ranges allow); across a hinge it is
/// sqrt(a^2 + b^2 - 2 a b cos(angle) + c^2), a and b the distances from its axis, c that along it, with the angle in its
/// range. From these the triangle inequality bounds all others, shortest paths through anchors (Floyd 1962) from above,
/// and from below by what is left of a long distance after a short one. Bounds are exact for a chain of two segments, and
/// on the safe side for all others: the order of axes is not looked at.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "feasibility.h"
#include "math3.h"

enum { NODES = 48, SLIDES = 6 };

static const double slack = 1e-3; // m: rounding, and what limits give way

/// One way up from a point: nodes are the point and the anchors that it turns about.
typedef struct chain {
  int n, open;             ///< open 1: passes a free joint, or more than there is room for
  double tail[3];          ///< the last node, in the present frame
  int nslide;              ///< since the last node
  double slide[SLIDES][3]; ///< their axes, in the present frame
  double range[SLIDES][2];
  cav_distance_range segment[NODES]; ///< from node i to i + 1
  cav_distance_range across[NODES];  ///< from node i - 1 to i + 1
  // of the last node, if it is a hinge behind a segment without slides: the node before it from here, its axis, angles
  int hinged;
  double arm[3], axis[3], angle[2];
} chain;

void cav_body_centre(const cav_body *body, double centre[3]) {
  quat_rotate(centre, body->quat, body->com);
  add3(centre, centre, body->pos);
}

int cav_body_within(const cav_model *model, int body, int ancestor) {
  while (body > ancestor) body = model->body[body].parent;
  return body == ancestor;
}

/// Length of v plus slides within their ranges.
static cav_distance_range length_of(const chain *c, const double v[3]) {
  cav_distance_range r = {norm3(v), norm3(v)};
  if (c->nslide == 0) return r;
  r = (cav_distance_range){0, 0};
  for (int corner = 0; corner < 1 << c->nslide; corner++) {
    double w[3];
    copy3(w, v);
    for (int i = 0; i < c->nslide; i++) {
      double s = c->range[i][corner >> i & 1];
      if (isinf(s)) return (cav_distance_range){0, INFINITY};
      axpy3(w, w, s, c->slide[i]);
    }
    r.largest = fmax(r.largest, norm3(w));
  }
  return r;
}

/// Distance of the node before the last from a point u [3] from the last, over the angles of the last.
static cav_distance_range across_hinge(const chain *c, const double u[3]) {
  double along = dot3(u, c->axis) - dot3(c->arm, c->axis), a[3], b[3], side[3];
  axpy3(a, c->arm, -dot3(c->arm, c->axis), c->axis);
  axpy3(b, u, -dot3(u, c->axis), c->axis);
  double la = norm3(a), lb = norm3(b), at = 0, low = -1, high = 1;
  if (la > 0 && lb > 0) {
    cross3(side, a, b);
    at = atan2(dot3(side, c->axis), dot3(a, b));
  }
  if (c->angle[1] - c->angle[0] < 2 * M_PI) {
    // cosine of angle - at over the range: at its ends, and where a multiple of pi lies between them
    double from = c->angle[0] - at, to = c->angle[1] - at;
    low = fmin(cos(from), cos(to)), high = fmax(cos(from), cos(to));
    if (floor(to / (2 * M_PI)) >= ceil(from / (2 * M_PI))) high = 1;
    if (floor(to / (2 * M_PI) - 0.5) >= ceil(from / (2 * M_PI) - 0.5)) low = -1;
  }
  double base = la * la + lb * lb + along * along;
  return (cav_distance_range){sqrt(fmax(base - 2 * la * lb * high, 0)), sqrt(fmax(base - 2 * la * lb * low, 0))};
}

/// Ends the segment from the last node at a point of the present frame.
static void end_segment(chain *c, const double point[3]) {
  double u[3];
  sub3(u, point, c->tail);
  c->segment[c->n - 1] = length_of(c, u);
  c->across[c->n - 1] = (cav_distance_range){0, INFINITY};
  if (c->hinged && c->nslide == 0) c->across[c->n - 1] = across_hinge(c, u);
}

static void pass_hinge(chain *c, const cav_joint *joint) {
  if (c->n + 2 > NODES) {
    c->open = 1;
    return;
  }
  end_segment(c, joint->pos);
  c->hinged = joint->type == CAV_JOINT_HINGE && c->nslide == 0;
  sub3(c->arm, c->tail, joint->pos);
  copy3(c->axis, joint->axis);
  const double stop = cav_joint_stop(joint);
  c->angle[0] = joint->limited ? joint->range[0] - stop - joint->ref : -INFINITY;
  c->angle[1] = joint->limited ? joint->range[1] + stop - joint->ref : INFINITY;
  copy3(c->tail, joint->pos);
  c->nslide = 0;
  c->n++;
}

static void pass_slide(chain *c, const cav_joint *joint) {
  if (c->nslide == SLIDES) {
    c->open = 1;
    return;
  }
  copy3(c->slide[c->nslide], joint->axis);
  // seen from the node, what lies above it moves the other way
  const double stop = cav_joint_stop(joint);
  c->range[c->nslide][0] = joint->limited ? -(joint->range[1] + stop - joint->ref) : -INFINITY;
  c->range[c->nslide][1] = joint->limited ? -(joint->range[0] - stop - joint->ref) : INFINITY;
  c->nslide++;
}

/// From the frame of a link to that of its parent.
static void pass_link(chain *c, const cav_link *link) {
  double R[9];
  quat_matrix(R, link->quat);
  transform(c->tail, link->pos, R, c->tail);
  rotate(c->arm, R, c->arm);
  rotate(c->axis, R, c->axis);
  for (int i = 0; i < c->nslide; i++) rotate(c->slide[i], R, c->slide[i]);
}

/// The way from a point of a link up to the frame of another one above it.
static void climb(const cav_model *m, int link, const double point[3], int top, chain *c) {
  *c = (chain){.n = 1};
  copy3(c->tail, point);
  for (; link != top && !c->open; link = m->link[link].parent) {
    const cav_link *l = &m->link[link];
    for (int j = l->joint + l->njoint - 1; j >= l->joint && !c->open; j--) {
      const cav_joint *joint = &m->joint[j];
      if (joint->type == CAV_JOINT_FREE) c->open = 1;
      if (joint->type == CAV_JOINT_SLIDE) pass_slide(c, joint);
      if (joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_BALL) pass_hinge(c, joint);
    }
    pass_link(c, l);
  }
}

/// Joins a second way, from the other point up to the same frame, end to end.
static void join(chain *a, const chain *b) {
  if (a->open || b->open || a->n + b->n > NODES || a->nslide + b->nslide > SLIDES) {
    a->open = 1;
    return;
  }
  // the segment between the two tails, with the slides of both: from here, those of b move the other way
  chain both = *a;
  for (int i = 0; i < b->nslide; i++, both.nslide++) {
    copy3(both.slide[both.nslide], b->slide[i]);
    both.range[both.nslide][0] = -b->range[i][1], both.range[both.nslide][1] = -b->range[i][0];
  }
  end_segment(&both, b->tail);
  memcpy(a->segment, both.segment, sizeof a->segment);
  memcpy(a->across, both.across, sizeof a->across);
  double u[3];
  sub3(u, a->tail, b->tail);
  cav_distance_range last = {0, INFINITY};
  if (b->hinged && both.nslide == 0) last = across_hinge(b, u);
  // b's nodes follow in the reverse order
  for (int i = 0; i < b->n; i++) {
    int k = a->n + i, from = b->n - 1 - i;
    if (from > 0) a->segment[k] = b->segment[from - 1];
    a->across[k] = i == 0 ? last : b->across[from];
  }
  a->n += b->n;
}

/// Bounds of the distance of the first and the last node, from those of neighbours.
static cav_distance_range span(const chain *c) {
  static const cav_distance_range any = {0, INFINITY};
  if (c->open) return any;
  int n = c->n;
  cav_distance_range d[NODES][NODES];
  for (int i = 0; i < n; i++)
    for (int k = 0; k < n; k++) d[i][k] = i == k ? (cav_distance_range){0, 0} : any;
  for (int i = 0; i + 1 < n; i++) d[i][i + 1] = d[i + 1][i] = c->segment[i];
  for (int i = 1; i + 1 < n; i++) d[i - 1][i + 1] = d[i + 1][i - 1] = c->across[i];
  for (int m = 0; m < n; m++)
    for (int i = 0; i < n; i++)
      for (int k = 0; k < n; k++) d[i][k].largest = fmin(d[i][k].largest, d[i][m].largest + d[m][k].largest);
  for (int pass = 0; pass < 2; pass++)
    for (int m = 0; m < n; m++)
      for (int i = 0; i < n; i++)
        for (int k = 0; k < n; k++)
          d[i][k].least = fmax(d[i][k].least, fmax(isinf(d[m][k].largest) ? 0 : d[i][m].least - d[m][k].largest,
                                                   isinf(d[i][m].largest) ? 0 : d[m][k].least - d[i][m].largest));
  return d[0][n - 1];
}

/// Coordinates of the last node of a way up to the world, as slides above it allow.
static void anchor_box(const chain *c, double box[6]) {
  for (int k = 0; k < 3; k++) {
    box[k] = box[3 + k] = c->tail[k];
    for (int i = 0; i < c->nslide; i++) {
      // the node moves against what is seen from it
      double a = -c->slide[i][k], low = c->range[i][0], high = c->range[i][1];
      if (fabs(a) < 1e-12) continue;
      box[k] += a > 0 ? a * low : a * high;
      box[3 + k] += a > 0 ? a * high : a * low;
    }
  }
}

/// The link above both.
static int common_link(const cav_model *m, int a, int b) {
  while (a != b) {
    if (a > b) {
      a = m->link[a].parent;
    } else {
      b = m->link[b].parent;
    }
  }
  return a;
}

int cav_distance_between(const cav_model *model, int link, const double point[3], int other,
                         const double other_point[3], double anchor[6], cav_distance_range *range) {
  chain a, b;
  int top = common_link(model, link, other);
  *range = (cav_distance_range){0, INFINITY};
  climb(model, link, point, top, &a);
  if (other == 0) {
    if (a.open) return 0;
    anchor_box(&a, anchor);
    *range = span(&a);
    return 1;
  }
  if (top == 0) return 0;
  climb(model, other, other_point, top, &b);
  join(&a, &b);
  *range = span(&a);
  return 1;
}

double cav_distance_to_centre(const cav_model *model, int body, int link, const double point[3]) {
  double sum = 0, mass = 0, centre[3], anchor[6];
  int root = model->link[link].root;
  for (int i = 1; i < model->nbody; i++) {
    const cav_body *b = &model->body[i];
    cav_distance_range d;
    if (b->mass <= 0 || !(body ? cav_body_within(model, i, body) : model->link[b->link].root == root && b->link))
      continue;
    cav_body_centre(b, centre);
    if (!cav_distance_between(model, b->link, centre, link, point, anchor, &d)) return INFINITY;
    sum += b->mass * d.largest;
    mass += b->mass;
  }
  return mass > 0 ? sum / mass : INFINITY;
}

// ---------------------------------------------------------------- targets out of reach

/// Least and largest distance of two boxes, coordinates least and largest each.
static cav_distance_range between_boxes(const double a[6], const double b[6]) {
  double near = 0, far = 0;
  for (int k = 0; k < 3; k++) {
    double gap = fmax(fmax(a[k] - b[3 + k], b[k] - a[3 + k]), 0);
    double wide = fmax(fabs(a[3 + k] - b[k]), fabs(b[3 + k] - a[k]));
    near += gap * gap;
    far += wide * wide;
  }
  return (cav_distance_range){sqrt(near), sqrt(far)};
}

static void box_of(const cav_requirement *r, double box[6]) {
  memcpy(box, r->low, sizeof r->low);
  memcpy(box + 3, r->high, sizeof r->high);
}

/// Bounds of the distance of what is required from the highest anchor of its tree in the world; 0: none.
static int span_to_world(const cav_model *m, const cav_requirement *r, double anchor[6], cav_distance_range *range) {
  static const double zero[3] = {0};
  if (r->kind == CAV_REQUIRE_POINT) return cav_distance_between(m, r->object, r->point, 0, zero, anchor, range);
  double sum = 0, mass = 0, centre[3], other[6];
  for (int i = r->object; i < m->nbody; i++) {
    const cav_body *b = &m->body[i];
    cav_distance_range d;
    if (b->mass <= 0 || !cav_body_within(m, i, r->object)) continue;
    cav_body_centre(b, centre);
    if (!cav_distance_between(m, b->link, centre, 0, zero, mass > 0 ? other : anchor, &d)) return 0;
    // all about one anchor, or nothing is said
    if (mass > 0 && memcmp(other, anchor, sizeof other)) return 0;
    sum += b->mass * d.largest;
    mass += b->mass;
  }
  *range = (cav_distance_range){0, mass > 0 ? sum / mass : INFINITY};
  return mass > 0;
}

static void examine_base(cav_examination *e, const cav_requirement *r) {
  double anchor[6], box[6];
  cav_distance_range can;
  char what[160];
  if (!span_to_world(e->model, r, anchor, &can)) return;
  box_of(r, box);
  cav_distance_range needs = between_boxes(anchor, box);
  if (needs.least <= can.largest + slack && needs.largest >= can.least - slack) return;
  cav_requirement_words(e, r, what, sizeof what);
  if (can.largest < slack && r->kind == CAV_REQUIRE_POINT && r->object == 0)
    cav_impossible(e, CAV_CONDITION_DISTANCE, r,
                   "Give its <body> a <freejoint/>, or a joint, if it is to be moved; or ask it of another body.",
                   "%s, but it is fixed to the world, %.3g m off", what, needs.least);
  else if (can.largest < slack)
    cav_impossible(e, CAV_CONDITION_DISTANCE, r, "Move the target, or check the ranges of its joints.",
                   "%s, but it only slides, and the way ends %.3g m before", what, needs.least);
  else if (needs.least > can.largest)
    cav_impossible(
        e, CAV_CONDITION_DISTANCE, r, "Move the target nearer, or the base.",
        "%s, out of reach by %.3g m: it can be %.4g m from where its base turns, the target is %.4g m from it", what,
        needs.least - can.largest, can.largest, needs.least);
  else
    cav_impossible(e, CAV_CONDITION_DISTANCE, r, "Move the target away, or widen the ranges of the joints between.",
                   "%s, too near by %.3g m: ranges of joints keep it %.4g m from where its base turns", what,
                   can.least - needs.largest, can.least);
}

static void examine_two(cav_examination *e, const cav_requirement *a, const cav_requirement *b) {
  double anchor[6], one[6], other[6];
  char first[160], second[160];
  cav_distance_range can = {0, INFINITY};
  const cav_model *m = e->model;
  if (a->kind == CAV_REQUIRE_CENTRE) {
    const cav_requirement *swap = a;
    a = b, b = swap;
  }
  if (a->kind != CAV_REQUIRE_POINT || a->object == 0 || b->kind == CAV_REQUIRE_COORDINATE) return;
  if (b->kind == CAV_REQUIRE_CENTRE) {
    can.largest = cav_distance_to_centre(m, b->object, a->object, a->point);
  } else if (b->object == 0 || !cav_distance_between(m, a->object, a->point, b->object, b->point, anchor, &can)) {
    return;
  }
  box_of(a, one);
  box_of(b, other);
  cav_distance_range needs = between_boxes(one, other);
  if (needs.least <= can.largest + slack && needs.largest >= can.least - slack) return;
  cav_requirement_words(e, a, first, sizeof first);
  cav_requirement_words(e, b, second, sizeof second);
  double off = fmax(needs.least - can.largest, can.least - needs.largest);
  cav_impossible(e, CAV_CONDITION_DISTANCE, a, "Move one of the targets, or set them apart in time.",
                 "%s, and %s: they cannot be %s, by %.3g m", first, second,
                 needs.least > can.largest ? "so far apart" : "so near", off);
}

cav_status cav_examine_distances(cav_examination *e) {
  for (int i = 0; i < e->n; i++) {
    const cav_requirement *r = &e->requirement[i];
    int before = e->nfound;
    // the same term at the knot before has been looked at where its target stands still
    if (r->kind == CAV_REQUIRE_COORDINATE) continue;
    examine_base(e, r);
    for (int k = i - 1; k >= 0 && e->requirement[k].knot == r->knot && e->nfound == before; k--)
      examine_two(e, &e->requirement[k], r);
    if (e->nfound > before) return CAV_OK;
  }
  return CAV_OK;
}
