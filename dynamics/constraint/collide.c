/// Which geoms touch: broad phase by bounding spheres over the list of pairs that the model was compiled to, then the
/// narrow phase of pairs.c. Geoms in no pair are never placed; a geom's rotation is formed only if a narrow phase asks
/// for it, once per call, and that of a geom fixed to the world once for all. Pairs with
/// what stands in the world out of reach are left out by trees and blocks (fixed.c); where CAV_SWEEP_FROM pairs and more are left
/// they are pruned along an axis (sweep.c); bench_sweep measures where that begins to pay. Where v and v_next are known
/// pairs with a mesh are sought only as far as something pushes at them.
#include <assert.h>
#include <stdlib.h>

#include "broad.h"
#include "cavort/dynamics.h"
#include "four_states.h"
#include "math3.h"

// fastest approach that the discrete law meets without a jump, m/s (a fall from 1.3 m)
static const double APPROACH_SPEED = 5;

// places a geom fixed to the world, or prepares one that moves
static void open_slot(const cav_model *model, const cav_geom *geom, slot *s, double centre[3]) {
  s->geom = geom;
  s->fixed = geom->link == 0;
  s->shape = cav_shape_of(model, geom);
  if (!s->fixed) return;
  // link 0 is the world: its frame is the world's
  copy3(centre, geom->pos);
  copy3(s->shape.pos, geom->pos);
  memcpy(s->shape.rotation, geom->rotation, sizeof s->shape.rotation);
  s->turned = 1;
}

// gives each geom in a pair a slot; whether some pair keeps a hint
static int open_slots(const cav_model *model, struct cav_geom_cache *cache, int *slot_of) {
  int hinted = 0;
  for (int g = 0; g < model->ngeom; g++) { slot_of[g] = -1; }
  for (int p = 0; p < model->npair; p++) {
    const cav_pair *pair = model->pair + p;
    int geoms[2] = {pair->geom1, pair->geom2};
    for (int k = 0; k < 2; k++) {
      if (slot_of[geoms[k]] >= 0) continue;
      slot_of[geoms[k]] = cache->nslot;
      open_slot(model, model->geom + geoms[k], cache->slot + cache->nslot, cache->centre[cache->nslot]);
      if (!cache->slot[cache->nslot].fixed) cache->moving[cache->nmoving++] = cache->nslot;
      cache->nslot++;
    }
    const cav_geom *a = model->geom + pair->geom1, *b = model->geom + pair->geom2;
    candidate *c = cache->candidate + p;
    c->pair = p;
    c->first = slot_of[pair->geom1];
    c->second = slot_of[pair->geom2];
    c->external = (signed char)pair->external;
    c->margin = pair->margin;
    c->plane = a->type == CAV_GEOM_PLANE;
    c->sought = (signed char)cav_pair_is_sought(model, pair);
    c->hinted = (signed char)cav_pair_keeps_hint(model, pair);
    cache->sought |= c->sought;
    cache->meshes |= cav_pair_has_mesh(model, pair);
    hinted |= c->hinted;
    c->bound = b->bound + (c->plane ? 0 : a->bound);
  }
  return hinted;
}

// which candidates the broad phase may take together with three more
static void find_fours(struct cav_geom_cache *cache) {
  for (int p = 0; p < cache->ncandidate; p++) {
    candidate *c = cache->candidate + p;
    c->four = p + CAV_LANES <= cache->ncandidate;
    for (int k = 1; k < CAV_LANES && c->four; k++)
      c->four = c->plane == c[k].plane && (!c->plane || c->first == c[k].first);
  }
}

// trees of the geoms, numbered from 0; -1: of the world
static void number_trees(const cav_model *model, struct cav_geom_cache *cache, int *tree) {
  int *number = tree + cache->nslot;
  for (int l = 0; l < model->nlink; l++) number[l] = -1;
  for (int i = 0; i < cache->nslot; i++) {
    int root = model->link[cache->slot[i].geom->link].root;
    if (!cache->slot[i].fixed && number[root] < 0) {
      cache->tree[cache->ntree] = root;
      number[root] = cache->ntree++;
    }
    tree[i] = cache->slot[i].fixed ? -1 : number[root];
  }
}

// farthest that a link's origin comes from its parent's: from there to the anchor of its first joint, on to that of the next and
// from the last one to the origin is as far in every posture, unless one of them slides
static double arm_of(const cav_model *model, const cav_link *link) {
  double at[3] = {0, 0, 0}, length = 0;
  for (int j = link->joint; j < link->joint + link->njoint; j++) {
    const cav_joint *joint = model->joint + j;
    double d[3];
    if (joint->type == CAV_JOINT_SLIDE || joint->type == CAV_JOINT_FREE) return INFINITY;
    if (j == link->joint) {
      quat_rotate(d, link->quat, joint->pos);
      add3(d, d, link->pos);
    } else {
      sub3(d, joint->pos, at);
    }
    length += norm3(d);
    copy3(at, joint->pos);
  }
  return length + norm3(link->njoint ? at : link->pos);
}

// farthest that any point of a ball about a slot comes from the root of its tree; reach [ntree], room [nlink] for the
// distances of the links' origins
static void find_reaches(const cav_model *model, const struct cav_geom_cache *cache, double *reach, double *origin) {
  // in no tree
  origin[0] = INFINITY;
  for (int l = 1; l < model->nlink; l++) {
    const cav_link *link = model->link + l;
    origin[l] = link->root == l ? 0 : origin[link->parent] + arm_of(model, link);
  }
  for (int t = 0; t < cache->ntree; t++) {
    reach[t] = 0;
    for (int i = 0; i < cache->nslot; i++) {
      const cav_geom *geom = cache->slot[i].geom;
      if (cache->slot[i].fixed || model->link[geom->link].root != cache->tree[t] || !isfinite(geom->bound)) continue;
      reach[t] = fmax(reach[t], origin[geom->link] + norm3(geom->pos) + geom->bound);
    }
  }
}

// what prunes the pairs by blocks and along an axis; 0 if memory runs out
static int open_pruning(const cav_model *model, struct cav_geom_cache *cache, int sweep_from) {
  size_t slots = (size_t)cache->nslot + 1, links = (size_t)model->nlink;
  double *radius = malloc(sizeof *radius * slots), *reach = malloc(sizeof *reach * 2 * links);
  cav_sweep_pair *pair = malloc(sizeof *pair * ((size_t)model->npair + 1));
  int *tree = malloc(sizeof *tree * (slots + links)), ok = radius && reach && pair && tree;
  if (ok) {
    for (int i = 0; i < cache->nslot; i++) radius[i] = cache->slot[i].geom->bound;
    for (int p = 0; p < model->npair; p++) {
      const candidate *c = cache->candidate + p;
      pair[p] = (cav_sweep_pair){c->plane ? -1 : c->first, c->second};
      cache->margin = fmax(cache->margin, c->margin);
    }
    number_trees(model, cache, tree);
    find_reaches(model, cache, reach, reach + links);
    cache->fixed =
        cav_fixed_new(cache->nslot, (const double(*)[3])cache->centre, radius, tree, reach, model->npair, pair);
    cache->sweep_from = sweep_from;
    if (model->npair >= sweep_from) cache->sweep = cav_sweep_new(cache->nslot, radius, model->npair, pair);
    ok = cache->fixed && (cache->sweep || model->npair < sweep_from);
  }
  if (ok && !cav_fixed_pays(cache->fixed)) {
    cav_fixed_free(cache->fixed);
    cache->fixed = NULL;
  }
  if (ok && cache->fixed) {
    int count;
    const int *always = cav_fixed_always(cache->fixed, &count);
    for (int i = 0; i < count; i++) cache->candidate[model->npair + i] = cache->candidate[always[i]];
    cache->ncandidate += count;
  }
  free(radius);
  free(reach);
  free(pair);
  free(tree);
  return ok;
}

struct cav_geom_cache *cav_geom_cache_new(const cav_model *model, int sweep_from) {
  // one spare of each, so that no size is zero
  struct cav_geom_cache *cache = calloc(1, sizeof *cache);
  int *slot_of = malloc(sizeof *slot_of * (size_t)(model->ngeom + 1));
  if (cache) {
    cache->slot = calloc((size_t)model->ngeom + 1, sizeof *cache->slot);
    cache->moving = calloc((size_t)model->ngeom + 1, sizeof *cache->moving);
    cache->centre = calloc((size_t)model->ngeom + 1, sizeof *cache->centre);
    cache->candidate = calloc(2 * (size_t)model->npair + 1, sizeof *cache->candidate);
    cache->limit = calloc(2 * (size_t)model->npair + 1, sizeof *cache->limit);
    cache->near = calloc(2 * (size_t)model->npair + 1, sizeof *cache->near);
    cache->tree = calloc((size_t)model->nlink, sizeof *cache->tree);
    cache->root = calloc((size_t)model->nlink, sizeof *cache->root);
  }
  if (!cache || !slot_of || !cache->slot || !cache->moving || !cache->centre || !cache->candidate || !cache->limit ||
      !cache->near || !cache->tree || !cache->root) {
    free(slot_of);
    cav_geom_cache_free(cache);
    return NULL;
  }
  const int hinted = open_slots(model, cache, slot_of);
  cache->ncandidate = model->npair;
  cache->activation[0] = cache->activation[1] = NAN;
  free(slot_of);
  if (hinted) cache->hint = calloc((size_t)model->npair, sizeof *cache->hint);
  if ((hinted && !cache->hint) || !open_pruning(model, cache, sweep_from)) {
    cav_geom_cache_free(cache);
    return NULL;
  }
  find_fours(cache);
  cache->bytes = cav_sweep_bytes(cache->sweep) + cav_fixed_bytes(cache->fixed) + sizeof *cache +
                 ((size_t)model->ngeom + 1) * (sizeof *cache->slot + sizeof *cache->moving + sizeof *cache->centre);
  cache->bytes +=
      (2 * (size_t)model->npair + 1) * (sizeof *cache->candidate + sizeof *cache->limit + sizeof *cache->near);
  if (cache->hint) cache->bytes += (size_t)model->npair * sizeof *cache->hint;
  cache->bytes += (size_t)model->nlink * (sizeof *cache->tree + sizeof *cache->root);
  return cache;
}

size_t cav_geom_cache_bytes(const struct cav_geom_cache *cache) { return cache ? cache->bytes : 0; }

void cav_geom_cache_free(struct cav_geom_cache *cache) {
  if (!cache) return;
  cav_sweep_free(cache->sweep);
  cav_fixed_free(cache->fixed);
  free(cache->slot);
  free(cache->moving);
  free(cache->centre);
  free(cache->candidate);
  free(cache->limit);
  free(cache->near);
  free(cache->hint);
  free(cache->tree);
  free(cache->root);
  free(cache);
}

double cav_contact_activation(const cav_state *state, const cav_pair *pair) {
  const cav_options *o = &state->options;
  double delta = o->smoothing > 0 ? (pair->external ? o->smoothing : o->smoothing_self) : 0;
  return pair->margin + cav_law_activation(state, delta, APPROACH_SPEED);
}

// a geom that moves as a shape, once it is placed
static void refresh_rotation(const cav_state *state, struct cav_geom_cache *cache, int i) {
  slot *s = cache->slot + i;
  copy3(s->shape.pos, cache->centre[i]);
  matmul3(s->shape.rotation, state->link[s->geom->link].rotation, s->geom->rotation);
  s->turned = 1;
}

// centres of all geoms that move, and rotations of planes that do
static void place(const cav_state *state, struct cav_geom_cache *cache) {
  for (int k = 0; k < cache->nmoving; k++) {
    int i = cache->moving[k];
    slot *s = cache->slot + i;
    const cav_pose *link = state->link + s->geom->link;
    find_centre(s->geom, link->pos, link->rotation, cache->centre[i]);
    s->turned = 0;
    if (s->geom->type == CAV_GEOM_PLANE) refresh_rotation(state, cache, i);
  }
}

// bounding spheres, or a plane and a sphere, closer than margin; inline: most of the search is this
static inline int near(const struct cav_geom_cache *cache, const candidate *c, double margin) {
  double normal[3];
  if (c->plane) column3(normal, cache->slot[c->first].shape.rotation, 2);
  return separation(c, cache->centre[c->first], cache->centre[c->second], normal) < limit_between(c, margin);
}

// how fast a point within radius of a place can move between two links, m/s; turn: the same of their rotation, rad/s
static double speed_between(const cav_state *state, const double *velocity, int one, int other, const double place[3],
                            double radius, double *turn) {
  double linear[3] = {0, 0, 0}, angular[3] = {0, 0, 0}, at[3];
  for (int k = 0; k < 2; k++) {
    int link = k ? other : one;
    if (link == 0) continue;
    const double *V = velocity + 6 * link;
    velocity_at(at, V, state->reference + 3 * link, place);
    axpy3(linear, linear, k ? 1 : -1, at);
    axpy3(angular, angular, k ? 1 : -1, V);
  }
  *turn = norm3(angular);
  return norm3(linear) + *turn * radius;
}

// a geom's place as another link sees it: origin, then the three axes of its link
static void seen_from(const cav_pose *other, const cav_pose *link, const cav_geom *geom, double out[4][3]) {
  double d[3];
  transform(d, link->pos, link->rotation, geom->pos);
  sub3(d, d, other->pos);
  rotate_back(out[0], other->rotation, d);
  for (int k = 0; k < 3; k++) {
    column3(d, link->rotation, k);
    rotate_back(out[k + 1], other->rotation, d);
  }
}

// how far a point of the smaller of two geoms, or one so far beyond it, can come against the other in the step to the next
// knot: the way of its middle, and of what is a radius away from that at most 2 sin(angle/2) of the radius, the norm of the
// change of its rotation
static double way_between(const cav_state *state, const cav_geom *first, const cav_geom *second, double beyond) {
  const cav_pose *next = state->work->next->link;
  const cav_geom *small = first->bound < second->bound ? first : second, *large = small == first ? second : first;
  double now[4][3], then[4][3], d[3], square = 0;
  seen_from(&state->link[large->link], &state->link[small->link], small, now);
  seen_from(&next[large->link], &next[small->link], small, then);
  for (int k = 1; k < 4; k++) {
    sub3(d, then[k], now[k]);
    square += dot3(d, d);
  }
  sub3(d, then[0], now[0]);
  return norm3(d) + sqrt(square / 2) * (small->bound + beyond);
}

// the distance below which a contact bears anything at v and v_next, or what the margin is: under the discrete law
// v* - v_next, friction included, is what both velocities make up, less h K times the gap; the smoothed law of such pairs ends
// CAV_LAW_END delta below that. Where the normal row sees (x' - x)/h in place of the second, x' is at least the distance of
// the two less their way, which point of theirs it may be of, and h K x takes up x/h, or all but what is left of it at the
// margin
static double reach(const cav_model *model, const cav_state *state, int p, double margin) {
  static const double SLACK = 0.05; // m/s, for velocities a little off those
  const struct cav_geom_cache *cache = state->work->geom;
  const cav_workspace *w = state->work;
  const candidate *c = cache->candidate + p;
  const cav_pair *pair = model->pair + p;
  const slot *a = cache->slot + c->first, *b = cache->slot + c->second;
  const cav_geom *ground = c->plane ? a->geom : b->geom;
  // the point lies midway between the surfaces
  double radius = b->geom->bound + 0.5 * fmax(margin, 0), turn[2], mu = 0, roll = 0;
  const double *place = cache->centre[c->second];
  double now = speed_between(state, w->velocity_now, a->geom->link, b->geom->link, place, radius, &turn[0]);
  double next = speed_between(state, state->velocity_next, a->geom->link, b->geom->link, place, radius, &turn[1]);
  int after = state->options.next_gap == CAV_NEXT_GAP_EXACT && cav_sees_next_gap(model, pair);
  int slips = state->options.next_slip == CAV_NEXT_SLIP_EXACT;
  double h = state->options.timestep, stiff = w->discrete_stiffness, kept_gap = after ? fmax(0, 1 / h - stiff) : 0;
  if (after || slips) next = fmax(next, way_between(state, a->geom, b->geom, slips ? 0.5 * fmax(margin, 0) : 0) / h);
  // under Coulomb's law the normal row is alone, and where it bears nothing neither does friction
  for (int k = 0; k + 1 < pair->dim && state->options.sliding == CAV_SLIDING_CONVEX; k++)
    *(k < 2 ? &mu : &roll) = fmax(k < 2 ? mu : roll, pair->friction[k]);
  double kept = fabs(1 - w->discrete_damping), rubs = fabs(1 - w->discrete_damping - cav_friction_stops(state));
  double most = kept * now + next + SLACK + mu * (rubs * now + next + SLACK) + roll * (rubs * turn[0] + turn[1]);
  double delta =
      state->options.smoothing > 0 ? c->external ? state->options.smoothing : state->options.smoothing_self : 0;
  double far = c->margin + fmax(most / stiff, (most + kept_gap * margin) / fmax(stiff, 1 / h)) + CAV_LAW_END * delta;
  // what passes over the ground is listed for its clearance, too
  if (c->plane && !ground->link) far = fmax(far, CAV_CLEARANCE);
  return far < margin ? far : margin;
}

int cav_contacts_narrow(const cav_state *state) {
  const cav_options *o = &state->options;
  const struct cav_geom_cache *cache = state->work->geom;
  return cache && cache->sought && o->contact && o->constraint && o->stabilisation == CAV_STABILISATION_DISCRETE &&
         !o->coupled;
}

int cav_contacts_have_meshes(const cav_state *state) { return state->work->geom && state->work->geom->meshes; }

cav_hint **cav_contacts_hints(cav_state *state) {
  return state->work->geom && state->work->geom->hint ? &state->work->geom->hint : NULL;
}

// the geom as a shape, its rotation formed at the first request
static const cav_shape *shape_of(const cav_state *state, struct cav_geom_cache *cache, int i) {
  if (!cache->slot[i].turned) refresh_rotation(state, cache, i);
  return &cache->slot[i].shape;
}

// contact axes: the normal, then the tangent that follows it or, where none is given, the world's y or z, made square to it. No
// choice is smooth over all normals: this one jumps where the normal's y crosses 1/2, with no effect on isotropic friction
static void make_frame(double frame[9]) {
  double *n = frame, *s = frame + 3;
  axpy3(s, s, -dot3(n, s), n);
  if (dot3(s, s) < 1e-12) {
    int y = fabs(n[1]) < 0.5;
    set3(s, 0, y, !y);
    axpy3(s, s, -dot3(n, s), n);
  }
  normalise3(s);
  cross3(frame + 6, n, s);
}

// axes of all contacts, from normal and tangent in their place
static void make_frames(cav_state *state) {
  int i = 0;
  for (; cav_lanes_pay() && i + CAV_LANES <= state->ncontact; i += CAV_LANES) cav_frames_four(state->contact + i);
  for (; i < state->ncontact; i++) make_frame(state->contact[i].frame);
}

// one contact of the state, without its axes
static cav_status push(const cav_model *model, cav_state *state, int p, const cav_touch *touch) {
  const cav_pair *pair = model->pair + p;
  cav_contact *contact = cav_contact_push(state);
  if (!contact) return CAV_NO_MEMORY;
  // whoever reads contacts of two states side by side walks them in this order
  assert(state->ncontact < 2 || contact[-1].pair < p ||
         (contact[-1].pair == p && contact[-1].feature <= touch->feature));
  assert(pair->dim >= 1 && pair->dim <= CAV_IMPULSE_DIM);
  contact->pair = p;
  contact->feature = touch->feature;
  contact->dim = pair->dim;
  contact->link1 = model->geom[pair->geom1].link;
  contact->link2 = model->geom[pair->geom2].link;
  copy3(contact->pos, touch->pos);
  copy3(contact->frame, touch->normal);
  copy3(contact->frame + 3, touch->tangent);
  contact->dist = touch->dist;
  contact->margin = pair->margin;
  memcpy(contact->friction, pair->friction, sizeof contact->friction);
  return CAV_OK;
}

// contacts of one pair whose bounds are near, where the pair is nearer than far
static inline cav_status collide_pair(const cav_model *model, cav_state *state, const candidate *c, double far,
                                      double margin) {
  struct cav_geom_cache *cache = state->work->geom;
  if (c->sought && !near(cache, c, far)) return CAV_OK;
  cav_touch touch[CAV_TOUCH_MAX];
  const cav_shape *a = shape_of(state, cache, c->first), *b = shape_of(state, cache, c->second);
  if (cav_shapes_apart(a, b, far)) return CAV_OK;
  // of the points over a height field those are taken that are found: all of them, of a pair that is near
  const int chosen = a->type == CAV_GEOM_HFIELD || b->type == CAV_GEOM_HFIELD;
  if (chosen && far < margin && !cav_collide_shapes(a, b, far, touch)) return CAV_OK;
  // by the gap after the step all points of a near pair may bear, those that come nearer by a turn, too
  if (state->options.next_gap != CAV_NEXT_GAP_EXACT && !chosen) margin = far;
  int count = c->hinted ? cav_collide_again(a, b, margin, &cache->hint[c->pair], touch)
                        : cav_collide_shapes(a, b, margin, touch);
  assert(count <= CAV_TOUCH_MAX);
  cav_status status = CAV_OK;
  for (int k = 0; k < count && status == CAV_OK; k++) status = push(model, state, c->pair, touch + k);
  return status;
}

// how far a pair is sought, of its margin
static inline double far_of(const cav_model *model, const cav_state *state, const candidate *c, double margin) {
  return c->sought && state->work->narrowed ? reach(model, state, c->pair, margin) : margin;
}

// contacts of the pairs that a sweep leaves
static cav_status collide_swept(const cav_model *model, cav_state *state, const double activation[2], double most) {
  struct cav_geom_cache *cache = state->work->geom;
  const int *found;
  int count = cav_sweep_find(cache->sweep, (const double(*)[3])cache->centre, most, &found);
  for (int i = 0; i < count; i++) {
    const candidate *c = cache->candidate + found[i];
    double margin = c->margin + activation[c->external];
    if (!near(cache, c, margin)) continue;
    cav_status status = collide_pair(model, state, c, far_of(model, state, c, margin), margin);
    if (status) return status;
  }
  return CAV_OK;
}

// contacts of a pair whose bounds are near
static inline cav_status collide_near(const cav_model *model, cav_state *state, const candidate *c,
                                      const double activation[2]) {
  double margin = c->margin + activation[c->external];
  return collide_pair(model, state, c, far_of(model, state, c, margin), margin);
}

// contacts of consecutive pairs
static inline cav_status collide_run(const cav_model *model, cav_state *state, cav_run run,
                                     const double activation[2]) {
  const struct cav_geom_cache *cache = state->work->geom;
  cav_status status = CAV_OK;
  if (cav_lanes_pay()) {
    const int n = cav_near_run(cache, run.first, run.end, cache->near);
    for (int i = 0; i < n && !status; i++)
      status = collide_near(model, state, cache->candidate + cache->near[i], activation);
    return status;
  }
  for (int p = run.first; p < run.end && !status; p++) {
    const candidate *c = cache->candidate + p;
    if (near(cache, c, c->margin + activation[c->external])) status = collide_near(model, state, c, activation);
  }
  return status;
}

// the pairs that what stands out of reach leaves
static int leave_out(const cav_state *state, struct cav_geom_cache *cache, double most, const cav_run **run,
                     int *nrun) {
  for (int t = 0; t < cache->ntree; t++) copy3(cache->root[t], state->link[cache->tree[t]].pos);
  return cav_fixed_find(cache->fixed, (const double(*)[3])cache->centre, (const double(*)[3])cache->root, most, run,
                        nrun);
}

// reach is the margin plus one of two distances: found once, not per pair
static void find_activations(const cav_state *state, double activation[2]) {
  const cav_pair alone[2] = {{.external = 0}, {.external = 1}};
  for (int k = 0; k < 2; k++) activation[k] = cav_contact_activation(state, alone + k);
}

static int seeks_contacts(const cav_model *model, const cav_state *state) {
  return model->npair && state->options.contact && state->options.constraint;
}

static cav_status collide_all(const cav_model *model, cav_state *state) {
  struct cav_geom_cache *cache = state->work->geom;
  place(state, cache);
  double activation[2];
  find_activations(state, activation);
  double most = cache->margin + fmax(activation[0], activation[1]);
  cav_run all = {0, model->npair};
  const cav_run *run = &all;
  int nrun = 1, count = model->npair;
  if (cache->fixed) count = leave_out(state, cache, most, &run, &nrun);
  cav_limits_prepare(cache, activation);
  if (cache->sweep && count >= cache->sweep_from) return collide_swept(model, state, activation, most);
  for (int r = 0; r < nrun; r++) {
    cav_status status = collide_run(model, state, run[r], activation);
    if (status) return status;
  }
  return CAV_OK;
}

cav_status cav_contacts_find(const cav_model *model, cav_state *state) {
  state->ncontact = 0;
  cav_status status = seeks_contacts(model, state) ? collide_all(model, state) : CAV_OK;
  make_frames(state);
  return status;
}

int cav_contacts_listed(const cav_model *model, const cav_state *state) {
  const struct cav_geom_cache *cache = state->work->geom;
  if (!seeks_contacts(model, state)) return 1;
  if (cache->meshes || cache->fixed || cache->sweep) return 0;
  for (int k = 0; k < cache->nmoving; k++) {
    if (cache->slot[cache->moving[k]].geom->type == CAV_GEOM_PLANE) return 0;
  }
  return 1;
}

void cav_contacts_near(const cav_model *model, cav_lanes *lanes, cav_state *state) {
  double activation[2];
  lanes->nnear = 0;
  if (!seeks_contacts(model, state)) return;
  find_activations(state, activation);
  cav_lanes_near(model, lanes, state, activation);
}

void cav_contacts_place_near(const cav_lanes *lanes, cav_state *const state[CAV_LANES]) {
  const struct cav_geom_cache *cache = state[0]->work->geom;
  if (!lanes->nnear) return;
  for (int k = 0; k < cache->nmoving; k++) {
    for (int lane = 0; lane < CAV_LANES; lane++) state[lane]->work->geom->slot[cache->moving[k]].turned = 0;
  }
  cav_lanes_place_near(lanes, state);
}

cav_status cav_contacts_of_near(const cav_model *model, cav_state *state, const cav_lanes *lanes, int lane) {
  double activation[2];
  state->ncontact = 0;
  find_activations(state, activation);
  for (int i = 0; i < lanes->nnear; i++) {
    if (!(lanes->near[i] >> lane & 1)) continue;
    const candidate *c = state->work->geom->candidate + lanes->near[i] / CAV_LANE_BITS;
    const double margin = c->margin + activation[c->external];
    cav_status status = collide_pair(model, state, c, margin, margin);
    if (status) return status;
  }
  make_frames(state);
  return CAV_OK;
}
