/// Which geoms may touch, and with what parameters: decided once, before anything moves.
///
/// MJCF's rules: contype and conaffinity masks; never two geoms that move as one, nor parent and child unless one of
/// them is fixed to the world or the flag filterparent is off; excluded bodies; explicit pairs come before all of these
/// and replace the same two geoms. Mixing: the geom of higher priority decides; at equal priority condim and friction
/// take the larger value, solref and solimp are averaged by solmix (direct solref: the smaller). Margins add, and a
/// contact pushes below their sum, as since MuJoCo 3.9; gap, by which it only lists contacts sooner, is not read. Not
/// done: two planes.

#include <stdlib.h>

#include "compile.h"
#include "math3.h"
#include "spec.h"
#include "step.h"

// pairs under construction
typedef struct list {
  cav_pair *at;
  int n, room;
} list;

// two bodies by their weld groups, or two geoms, in one number
typedef struct keyed {
  unsigned key;
  unsigned other;
} keyed;

typedef struct keys {
  keyed *at;
  int n;
} keys;

static int compare_keys(const void *a, const void *b) {
  const keyed *x = a, *y = b;
  if (x->key != y->key) return x->key < y->key ? -1 : 1;
  return x->other == y->other ? 0 : x->other < y->other ? -1 : 1;
}

static keyed make_key(int a, int b) {
  return a < b ? (keyed){(unsigned)a, (unsigned)b} : (keyed){(unsigned)b, (unsigned)a};
}

static int has_key(const keys *k, int a, int b) {
  keyed key = make_key(a, b);
  return k->n && bsearch(&key, k->at, (size_t)k->n, sizeof key, compare_keys);
}

// --- parameters ---

static double larger(double a, double b) { return a > b ? a : b; }

// fraction of the first geom in solref and solimp
static double fraction(const cav_geom *a, const cav_geom *b) {
  const double least = 1e-15;
  if (a->priority != b->priority) return a->priority > b->priority ? 1 : 0;
  if (a->solmix >= least && b->solmix >= least) return a->solmix / (a->solmix + b->solmix);
  if (a->solmix < least && b->solmix < least) return 0.5;
  return a->solmix < least ? 0 : 1;
}

static cav_softness mix_softness(const cav_geom *a, const cav_geom *b) {
  const cav_softness *x = &a->softness, *y = &b->softness;
  double s = fraction(a, b);
  if (s == 1) return *x;
  if (s == 0) return *y;
  cav_softness mixed;
  int direct = x->solref[0] <= 0 || y->solref[0] <= 0;
  for (int i = 0; i < 2; i++)
    mixed.solref[i] = direct ? fmin(x->solref[i], y->solref[i]) : s * x->solref[i] + (1 - s) * y->solref[i];
  for (int i = 0; i < 5; i++) mixed.solimp[i] = s * x->solimp[i] + (1 - s) * y->solimp[i];
  return mixed;
}

static void mix(const cav_geom *a, const cav_geom *b, cav_pair *pair) {
  double friction[3];
  for (int i = 0; i < 3; i++) friction[i] = larger(a->friction[i], b->friction[i]);
  pair->dim = a->condim > b->condim ? a->condim : b->condim;
  if (a->priority != b->priority) {
    const cav_geom *decides = a->priority > b->priority ? a : b;
    copy3(friction, decides->friction);
    pair->dim = decides->condim;
  }
  const double five[5] = {friction[0], friction[0], friction[1], friction[2], friction[2]};
  memcpy(pair->friction, five, sizeof five);
  pair->margin = a->margin + b->margin;
  pair->softness = mix_softness(a, b);
}

// --- the list ---

static cav_pair *push(cav_spec *spec, list *l, const cav_geom *geom, int g1, int g2) {
  if (l->n == CAV_SPEC_PAIRS) {
    cav_spec_fail(spec, spec->body.at[0].node, NULL,
                  "more than %d pairs of geoms may touch; leave some out by contype and conaffinity", CAV_SPEC_PAIRS);
    return NULL;
  }
  if (l->n == l->room) {
    int room = l->room ? 2 * l->room : 64;
    cav_pair *moved = realloc(l->at, (size_t)room * sizeof *moved);
    if (!moved) {
      cav_spec_no_memory(spec);
      return NULL;
    }
    l->at = moved;
    l->room = room;
  }
  // the simpler type first: collision routines expect it
  int swap = geom[g1].type > geom[g2].type;
  cav_pair *pair = &l->at[l->n++];
  *pair = (cav_pair){.geom1 = swap ? g2 : g1, .geom2 = swap ? g1 : g2};
  mix(&geom[pair->geom1], &geom[pair->geom2], pair);
  return pair;
}

// the values that the flag override gives all contacts; then friction, which below this would make the cone's shape
// degenerate; MuJoCo's bound too
static void bound_friction(const cav_spec *spec, cav_pair *pair) {
  const cav_spec_option *o = &spec->option;
  if (o->override) {
    memcpy(pair->friction, o->o_friction, sizeof pair->friction);
    pair->softness = o->o_softness;
    pair->margin = o->o_margin;
  }
  for (int i = 0; i < 5; i++) pair->friction[i] = larger(pair->friction[i], 1e-5);
}

// planes and height fields do not meet each other
static int is_ground(const cav_geom *g) { return g->type == CAV_GEOM_PLANE || g->type == CAV_GEOM_HFIELD; }

// collisions of two bodies' geoms by their masks
static void add_bodies(cav_spec *spec, list *l, const cav_geom *geom, int b1, int b2, const keys *explicit_pairs) {
  const cav_spec_body *x = &spec->body.at[b1], *y = &spec->body.at[b2];
  for (int i = x->geom; i < x->geom + x->ngeom; i++) {
    for (int j = y->geom; j < y->geom + y->ngeom; j++) {
      if (!(geom[i].contype & geom[j].conaffinity) && !(geom[j].contype & geom[i].conaffinity)) continue;
      if (is_ground(&geom[i]) && is_ground(&geom[j])) continue;
      if (has_key(explicit_pairs, i, j)) continue;
      cav_pair *pair = push(spec, l, geom, i, j);
      if (!pair) return;
      bound_friction(spec, pair);
    }
  }
}

// bodies with at least one geom that any mask could meet
static int can_touch(const cav_spec *spec, int body, const cav_geom *geom) {
  const cav_spec_body *b = &spec->body.at[body];
  for (int i = b->geom; i < b->geom + b->ngeom; i++) {
    if (geom[i].contype || geom[i].conaffinity) return 1;
  }
  return 0;
}

// neither the same rigid piece, nor neighbours across a joint (the world is nobody's neighbour), nor excluded
static int bodies_may(const cav_spec *spec, const int *weld, int b1, int b2, const keys *excluded) {
  int w1 = weld[b1], w2 = weld[b2];
  if (w1 == w2 || has_key(excluded, b1, b2)) return 0;
  if (!spec->option.filter_parent || !w1 || !w2) return 1;
  return weld[spec->body.at[w1].parent] != w2 && weld[spec->body.at[w2].parent] != w1;
}

static void add_masked(cav_spec *spec, list *l, const cav_geom *geom, const int *weld, const keys *explicit_pairs,
                       const keys *excluded) {
  for (int i = 0; i < spec->body.n; i++) {
    if (!can_touch(spec, i, geom)) continue;
    for (int j = i + 1; j < spec->body.n && spec->status == CAV_OK; j++) {
      if (spec->body.at[j].ngeom && bodies_may(spec, weld, i, j, excluded))
        add_bodies(spec, l, geom, i, j, explicit_pairs);
    }
  }
}

static void check_pairs(cav_spec *spec) {
  for (int i = 0; i < spec->pair.n; i++) {
    const cav_spec_pair *p = &spec->pair.at[i];
    cav_check_condim(spec, p->node, p->condim);
    for (int k = 0; k < 5; k++) cav_check_not_negative(spec, p->node, "friction", p->friction[k]);
    cav_check_softness(spec, p->node, "", &p->softness);
  }
}

static int find_geom(cav_spec *spec, const cav_spec_pair *p, const char *attribute, const char *name) {
  int i = cav_name_find(spec->geom.at, spec->geom.n, sizeof *spec->geom.at, name);
  if (i < 0)
    cav_spec_unknown(spec, p->node, attribute, "geom", name, spec->geom.at, spec->geom.n, sizeof *spec->geom.at);
  return i;
}

// an explicit pair says all itself, by MJCF's defaults where the file is silent
static void replace(const cav_spec_pair *p, cav_pair *pair) {
  pair->dim = p->condim;
  memcpy(pair->friction, p->friction, sizeof pair->friction);
  pair->softness = p->softness;
  pair->margin = p->margin;
}

static void add_explicit(cav_spec *spec, list *l, const cav_geom *geom, const int *weld, keys *explicit_pairs) {
  for (int i = 0; i < spec->pair.n && spec->status == CAV_OK; i++) {
    const cav_spec_pair *p = &spec->pair.at[i];
    int g1 = find_geom(spec, p, "geom1", p->geom1), g2 = find_geom(spec, p, "geom2", p->geom2);
    if (g1 < 0 || g2 < 0) return;
    explicit_pairs->at[explicit_pairs->n++] = make_key(g1, g2);
    if (is_ground(&geom[g1]) && is_ground(&geom[g2])) {
      cav_spec_fail(spec, p->node, NULL, "two planes or height fields cannot touch; remove the pair");
    } else if (weld[geom[g1].body] == weld[geom[g2].body]) {
      cav_spec_warn(spec, p->node, NULL, "left out: the two geoms move as one");
    } else {
      cav_pair *pair = push(spec, l, geom, g1, g2);
      if (!pair) return;
      replace(p, pair);
      pair->listed = 1;
      bound_friction(spec, pair);
    }
  }
  if (explicit_pairs->n) qsort(explicit_pairs->at, (size_t)explicit_pairs->n, sizeof(keyed), compare_keys);
}

static void find_excluded(cav_spec *spec, keys *excluded) {
  for (int i = 0; i < spec->exclude.n; i++) {
    const cav_spec_exclude *e = &spec->exclude.at[i];
    const char *const names[2] = {e->body1, e->body2};
    int found[2];
    for (int k = 0; k < 2; k++) {
      found[k] = cav_name_find(spec->body.at, spec->body.n, sizeof *spec->body.at, names[k]);
      if (found[k] < 0)
        cav_spec_unknown(spec, e->node, k ? "body2" : "body1", "body", names[k], spec->body.at, spec->body.n,
                         sizeof *spec->body.at);
    }
    if (spec->status != CAV_OK) return;
    excluded->at[excluded->n++] = make_key(found[0], found[1]);
  }
  if (excluded->n) qsort(excluded->at, (size_t)excluded->n, sizeof(keyed), compare_keys);
}

// all pairs of the scene into the list
static void filter(cav_spec *spec, const cav_geom *geom, const int *weld, list *l) {
  keys explicit_pairs = {calloc((size_t)spec->pair.n + 1, sizeof(keyed)), 0};
  keys excluded = {calloc((size_t)spec->exclude.n + 1, sizeof(keyed)), 0};
  if (!explicit_pairs.at || !excluded.at) {
    cav_spec_no_memory(spec);
  } else {
    check_pairs(spec);
    find_excluded(spec, &excluded);
    add_explicit(spec, l, geom, weld, &explicit_pairs);
    if (spec->option.collision == CAV_COLLISION_GEOMS) l->n = 0, explicit_pairs.n = 0;
    if (spec->option.collision != CAV_COLLISION_PAIRS) add_masked(spec, l, geom, weld, &explicit_pairs, &excluded);
    // nothing touches where contacts are off; names were checked all the same
    if (!spec->option.contact) l->n = 0;
  }
  free(explicit_pairs.at);
  free(excluded.at);
}

// geoms as mixing needs them, before there is a model to hold them
static cav_geom *mixed_geoms(const cav_spec *spec, const int *link_of) {
  cav_geom *geom = calloc((size_t)spec->geom.n + 1, sizeof *geom);
  for (int i = 0; geom && i < spec->geom.n; i++) {
    const cav_spec_geom *s = &spec->geom.at[i];
    geom[i] = (cav_geom){.type = (cav_geom_type)s->type,
                         .body = s->body,
                         .link = link_of[s->body],
                         .contype = s->contype,
                         .conaffinity = s->conaffinity,
                         .condim = s->condim,
                         .priority = s->priority,
                         .margin = s->margin,
                         .solmix = s->solmix,
                         .softness = s->softness};
    copy3(geom[i].friction, s->friction);
  }
  return geom;
}

cav_pair *cav_filter_pairs(cav_spec *spec, const int *weld, const int *link_of, int *npair) {
  list l = {NULL, 0, 0};
  cav_geom *geom = mixed_geoms(spec, link_of);
  if (geom)
    filter(spec, geom, weld, &l);
  else
    cav_spec_no_memory(spec);
  free(geom);
  *npair = spec->status == CAV_OK ? l.n : 0;
  return l.at;
}
