/// How far bodies slide on each other: of a place of contact that goes on from one knot to the next, the path it takes over the
/// one surface less that over the other. Both are as long where a body rolls, so that a wheel does not slide, however fast
/// it turns, nor a foot that turns on its edge; of a corner the second is none, and the first is what it moves.
///
/// Between knots each body turns about one axis: the chord between two places on it is seen half way, and on a curved surface
/// taken for the arc over which the normal turns as far.
#include "slide.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/dynamics.h"
#include "math3.h"

static const double touching = 0.005, level = 0.001; // m: gap of what touches; above the lowest point of its link

/// A place where two bodies touch, and how far they slide from there to the next knot.
typedef struct place {
  int pair, feature, next; ///< index at the next knot; -1: it is not there
  double on[2][3];         ///< on the surface of either link, in its frame
  double normal[2][3];     ///< in those frames
  double world[3], way[3]; ///< the normal, and the slide
} place;

typedef struct knot {
  int n;
  place *place; ///< [n]
} knot;

struct cav_slide {
  const cav_model *model;
  knot *knot; ///< [nknot]
  int nknot, room;
  cav_pose *pose; ///< [nlink] at the last knot
};

cav_slide *cav_slide_new(const cav_model *model, int nknot) {
  cav_slide *s = calloc(1, sizeof *s);
  if (!s) return NULL;
  s->model = model;
  s->room = nknot;
  s->knot = calloc((size_t)nknot, sizeof *s->knot);
  s->pose = malloc((size_t)model->nlink * sizeof *s->pose);
  if (s->knot && s->pose) return s;
  cav_slide_free(s);
  return NULL;
}

void cav_slide_free(cav_slide *s) {
  if (!s) return;
  for (int t = 0; s->knot && t < s->nknot; t++) free(s->knot[t].place);
  free(s->knot), free(s->pose), free(s);
}

// whether a contact is one that its link stands on: near enough, and no lower point of the same two links bears it
static int touches(const cav_model *model, const cav_state *state, const cav_contact *c) {
  double least = c->dist;
  if (c->dist > touching || !model->pair[c->pair].external) return 0;
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *other = &state->contact[i];
    if (other->link1 == c->link1 && other->link2 == c->link2) least = fmin(least, other->dist);
  }
  return c->dist <= fmax(least + level, 0);
}

static void take_place(const cav_state *state, const cav_contact *c, place *p) {
  p->pair = c->pair, p->feature = c->feature, p->next = -1;
  copy3(p->world, c->frame);
  zero3(p->way);
  for (int k = 0; k < 2; k++) {
    const cav_pose *pose = &state->link[k ? c->link2 : c->link1];
    double at[3];
    axpy3(at, c->pos, k ? 0.5 * c->dist : -0.5 * c->dist, c->frame);
    sub3(at, at, pose->pos);
    rotate_back(p->on[k], pose->rotation, at);
    rotate_back(p->normal[k], pose->rotation, c->frame);
  }
}

// the rotation half way between two
static void half_way(const double from[9], const double to[9], double mid[9]) {
  double turn[9], half[3], quat[4];
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) turn[3 * i + j] = dot3(to + 3 * i, from + 3 * j);
  set3(half, turn[7] - turn[5], turn[2] - turn[6], turn[3] - turn[1]);
  double sine = norm3(half) / 2, angle = atan2(sine, (turn[0] + turn[4] + turn[8] - 1) / 2);
  scale3(half, sine > 0 ? angle / (4 * sine) : 0, half);
  quat_exp(quat, half);
  quat_matrix(turn, quat);
  matmul3(mid, turn, from);
}

static int is_curved(const cav_geom *geom) {
  return geom->type == CAV_GEOM_SPHERE || geom->type == CAV_GEOM_CAPSULE || geom->type == CAV_GEOM_CYLINDER ||
         geom->type == CAV_GEOM_ELLIPSOID;
}

// path of a place over the surface of side k of its pair, as it is seen half way between two knots
static void path_over(const cav_slide *s, const cav_state *state, const place *a, const place *b, int k,
                      double path[3]) {
  const cav_geom *geom = &s->model->geom[k ? s->model->pair[a->pair].geom2 : s->model->pair[a->pair].geom1];
  double mid[9], chord[3], across[3];
  half_way(s->pose[geom->link].rotation, state->link[geom->link].rotation, mid);
  sub3(chord, b->on[k], a->on[k]);
  cross3(across, a->normal[k], b->normal[k]);
  double half = atan2(norm3(across), dot3(a->normal[k], b->normal[k])) / 2;
  if (is_curved(geom) && half > 0) scale3(chord, half / sin(half), chord);
  rotate(path, mid, chord);
}

// where a place is at the next knot: the same point of the pair, or where a pair no longer has that, the nearest
static int find_next(const cav_state *state, const place *a, const knot *next) {
  int found = -1;
  double least = INFINITY;
  for (int i = 0; i < next->n; i++)
    if (next->place[i].pair == a->pair && next->place[i].feature == a->feature) return i;
  for (int i = 0; i < state->ncontact; i++)
    if (state->contact[i].pair == a->pair && state->contact[i].feature == a->feature) return -1;
  for (int i = 0; i < next->n; i++) {
    double away[3];
    if (next->place[i].pair != a->pair) continue;
    sub3(away, next->place[i].on[1], a->on[1]);
    if (norm3(away) < least) least = norm3(away), found = i;
  }
  return found;
}

static void join(const cav_slide *s, const cav_state *state, place *a, const knot *next) {
  double path[2][3], normal[3];
  a->next = find_next(state, a, next);
  if (a->next < 0) return;
  const place *b = &next->place[a->next];
  for (int k = 0; k < 2; k++) path_over(s, state, a, b, k, path[k]);
  sub3(a->way, path[0], path[1]);
  // what opens or closes is no slide
  add3(normal, a->world, b->world);
  normalise3(normal);
  axpy3(a->way, a->way, -dot3(normal, a->way), normal);
}

cav_status cav_slide_add(cav_slide *s, const cav_state *state) {
  if (s->nknot == s->room) return CAV_BAD_INPUT;
  knot *at = &s->knot[s->nknot];
  at->place = malloc(((size_t)state->ncontact + 1) * sizeof *at->place);
  if (!at->place) return CAV_NO_MEMORY;
  for (int i = 0; i < state->ncontact; i++)
    if (touches(s->model, state, &state->contact[i])) take_place(state, &state->contact[i], &at->place[at->n++]);
  knot *before = s->nknot > 0 ? at - 1 : NULL;
  for (int i = 0; before && i < before->n; i++) join(s, state, &before->place[i], at);
  memcpy(s->pose, state->link, (size_t)s->model->nlink * sizeof *s->pose);
  s->nknot++;
  return CAV_OK;
}

int cav_slide_over(const cav_slide *s, int from, int steps, double *longest) {
  int any = 0;
  *longest = 0;
  for (int i = 0; i < s->knot[from].n; i++) {
    double way[3] = {0};
    int at = i, k = 0;
    for (; k < steps && s->knot[from + k].place[at].next >= 0; k++) {
      const place *p = &s->knot[from + k].place[at];
      add3(way, way, p->way);
      at = p->next;
    }
    if (k < steps) continue;
    any = 1;
    *longest = fmax(*longest, norm3(way));
  }
  return any;
}
