/// The broad phase against the narrow phase of every pair, cav_contact_activation, the options that switch contacts
/// off, contact axes, and MuJoCo's contacts on models no one here wrote; what stands
/// far away is left out, and what is near never.
#include "check.h"
#include "math3.h"
#include "step.h"

#ifdef CAVORT_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

// xorshift: the same numbers on every machine
static unsigned long long seed = 88172645463325252ULL;
static double uniform(double low, double high) {
  seed ^= seed << 13;
  seed ^= seed >> 7;
  seed ^= seed << 17;
  return low + (high - low) * (double)(seed >> 11) / 9007199254740992.0;
}

static void random_quat(double q[4]) {
  for (int i = 0; i < 4; i++) q[i] = uniform(-1, 1);
  quat_normalise(q);
}

enum { LINKS = 12, GEOMS = 30, PAIRS = GEOMS * (GEOMS - 1) / 2 };

/// A model of loose links with several geoms each: no joints, poses are written into the state.
typedef struct heap {
  cav_body body[LINKS];
  cav_link link[LINKS];
  cav_geom geom[GEOMS];
  cav_pair pair[PAIRS];
  cav_model model;
} heap;

static void random_geom(cav_geom *g, cav_geom_type type) {
  *g = (cav_geom){.name = "", .type = type};
  for (int i = 0; i < 3; i++) {
    g->pos[i] = uniform(-0.2, 0.2);
    g->size[i] = uniform(0.05, 0.2);
  }
  random_quat(g->quat);
  quat_matrix(g->rotation, g->quat);
  g->bound = type == CAV_GEOM_PLANE     ? INFINITY
             : type == CAV_GEOM_SPHERE  ? g->size[0]
             : type == CAV_GEOM_CAPSULE ? g->size[0] + g->size[1]
                                        : norm3(g->size);
}

static void add_pairs(heap *h) {
  cav_model *m = &h->model;
  for (int a = 0; a < GEOMS; a++) {
    for (int b = a + 1; b < GEOMS; b++) {
      int swap = h->geom[a].type > h->geom[b].type;
      if (h->geom[a].link == h->geom[b].link) continue;
      cav_pair *p = h->pair + m->npair++;
      *p = (cav_pair){.geom1 = swap ? b : a, .geom2 = swap ? a : b, .dim = 3, .friction = {1, 1, 0.1, 0.2, 0.3}};
      p->external = !h->geom[a].link || !h->geom[b].link;
      p->margin = uniform(0, 0.1);
    }
  }
}

static void fill(heap *h) {
  *h = (heap){.model = {.name = "heap", .nbody = LINKS, .nlink = LINKS, .ngeom = GEOMS}};
  cav_model *m = &h->model;
  m->body = h->body;
  m->link = h->link;
  m->geom = h->geom;
  m->pair = h->pair;
  m->options = (cav_options){.timestep = 0.01, .contact = 1, .constraint = 1, .impratio = 1};
  for (int l = 0; l < LINKS; l++) {
    h->link[l] = (cav_link){.body = l, .parent = l ? 0 : -1, .root = l, .quat = {1, 0, 0, 0}, .mass = 1};
    h->body[l] = (cav_body){.name = "", .parent = l ? 0 : -1, .link = l};
  }
  // 2 planes, one fixed and one that moves, then all types in turn; the first ones are fixed to the world
  for (int g = 0; g < GEOMS; g++) {
    random_geom(h->geom + g, g < 2 ? CAV_GEOM_PLANE : (cav_geom_type)(1 + g % CAV_GEOM_BOX));
    h->geom[g].link = h->geom[g].body = g == 1 ? 3 : g * LINKS / GEOMS;
  }
  add_pairs(h);
}

static void scatter(cav_state *state) {
  for (int l = 1; l < state->model->nlink; l++) {
    cav_pose *pose = state->link + l;
    for (int i = 0; i < 3; i++) pose->pos[i] = uniform(-0.6, 0.6);
    random_quat(pose->quat);
    quat_matrix(pose->rotation, pose->quat);
  }
}

// the geom in the world, placed without the cache
static cav_shape shape_of(const cav_state *state, int g) {
  const cav_geom *geom = state->model->geom + g;
  const cav_pose *pose = state->link + geom->link;
  cav_shape s = {.type = geom->type, .size = geom->size};
  transform(s.pos, pose->pos, pose->rotation, geom->pos);
  matmul3(s.rotation, pose->rotation, geom->rotation);
  return s;
}

// every contact that brute force finds is there, in the same order, and no other
static void compare(const cav_state *state) {
  const cav_model *m = state->model;
  int k = 0;
  for (int p = 0; p < m->npair; p++) {
    const cav_pair *pair = m->pair + p;
    cav_shape a = shape_of(state, pair->geom1), b = shape_of(state, pair->geom2);
    cav_touch touch[CAV_TOUCH_MAX];
    int n = cav_collide_shapes(&a, &b, cav_contact_activation(state, pair), touch);
    for (int j = 0; j < n; j++, k++) {
      if (!CHECK(k < state->ncontact)) return;
      const cav_contact *c = state->contact + k;
      CHECK(c->pair == p && c->feature == touch[j].feature && c->dim == pair->dim);
      CHECK(c->link1 == m->geom[pair->geom1].link && c->link2 == m->geom[pair->geom2].link);
      CHECK(c->dist < cav_contact_activation(state, pair));
      // same arithmetic: the same bits
      CHECK(c->dist == touch[j].dist && !memcmp(c->pos, touch[j].pos, sizeof c->pos));
      CHECK(!memcmp(c->friction, pair->friction, sizeof c->friction));
      CHECK_NEAR(c->margin, pair->margin, 0);
      double product[9], transposed[9];
      for (int i = 0; i < 9; i++) transposed[i] = c->frame[3 * (i % 3) + i / 3];
      matmul3(product, c->frame, transposed);
      static const double unit[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
      CHECK_NEAR_ALL(product, unit, 9, 1e-12); // seen: 1e-15
      cross3(product, c->frame, c->frame + 3);
      CHECK_NEAR_ALL(product, c->frame + 6, 3, 1e-12);
    }
  }
  CHECK(k == state->ncontact);
}

// the broad phase that looks at all pairs, or the one that sweeps
static void test_heap(int sweep_from) {
  static heap h;
  fill(&h);
  // two pairs of the same geoms
  cav_pair *twin = h.pair + 200;
  twin->geom1 = twin[-1].geom1, twin->geom2 = twin[-1].geom2, twin->external = twin[-1].external;
  cav_state *state = cav_state_new(&h.model);
  if (!CHECK(state != NULL)) return;
  cav_geom_cache_free(state->work->geom);
  state->work->geom = cav_geom_cache_new(&h.model, sweep_from);
  if (!CHECK(state->work->geom != NULL)) return;
  int contacts = 0;
  for (int pose = 0; pose < 300; pose++) {
    scatter(state);
    state->options.smoothing = pose % 3 == 1 ? 0.01 : 0;
    state->options.smoothing_self = pose % 3 == 1 ? 0.001 : 0;
    state->options.stabilisation = pose % 3 == 2 ? CAV_STABILISATION_DISCRETE : CAV_STABILISATION_SOLREF;
    CHECK(cav_contacts_find(&h.model, state) == CAV_OK);
    compare(state);
    contacts += state->ncontact;
  }
  printf("%d pairs, %s: %.1f contacts a pose\n", h.model.npair, sweep_from ? "all looked at" : "swept",
         contacts / 300.0);
  CHECK(contacts > 300 * 10);

  // switched off
  state->options.contact = 0;
  CHECK(cav_contacts_find(&h.model, state) == CAV_OK && state->ncontact == 0);
  state->options.contact = 1;
  state->options.constraint = 0;
  CHECK(cav_contacts_find(&h.model, state) == CAV_OK && state->ncontact == 0);
  cav_state_free(state);
}

// half of the geoms stand in the world, spread over some metres, and the links wander there as so many trees: what is left out
// by blocks is missed nowhere
static void test_standing(int trees) {
  static heap h;
  fill(&h);
  h.model.npair = 0;
  for (int g = 2; g < GEOMS; g++) {
    h.geom[g].link = h.geom[g].body = g % 2 ? 0 : 1 + g / 2 % (LINKS - 1);
    for (int i = 0; i < 3 && g % 2; i++) h.geom[g].pos[i] = uniform(-3, 3);
  }
  for (int l = 1; l < LINKS; l++) h.link[l].root = 1 + l % trees;
  add_pairs(&h);
  cav_state *state = cav_state_new(&h.model);
  if (!CHECK(state != NULL)) return;
  int contacts = 0;
  for (int pose = 0; pose < 500; pose++) {
    scatter(state);
    for (int l = 1; l < LINKS; l++)
      for (int i = 0; i < 3; i++) state->link[l].pos[i] += uniform(-3, 3) * (pose % 4 > 0);
    CHECK(cav_contacts_find(&h.model, state) == CAV_OK);
    compare(state);
    contacts += state->ncontact;
  }
  CHECK(contacts > 500);
  cav_state_free(state);
}

static void test_reach(void) {
  static heap h;
  fill(&h);
  cav_state *state = cav_state_new(&h.model);
  if (!CHECK(state != NULL)) return;
  cav_pair moving = {.margin = 0.02}, grounded = {.margin = 0.02, .external = 1};
  CHECK_NEAR(cav_contact_activation(state, &moving), 0.02, 0);
  state->options.smoothing = 0.03;
  state->options.smoothing_self = 0.01;
  CHECK_NEAR(cav_contact_activation(state, &moving), 0.02 + 0.12, 1e-15);
  CHECK_NEAR(cav_contact_activation(state, &grounded), 0.02 + 0.36, 1e-15);
  // the discrete law: and what an approach of 5 m/s covers in a step of 0.01 s
  state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  CHECK_NEAR(cav_contact_activation(state, &grounded), 0.02 + 0.36 + 0.05, 1e-15);
  state->options.smoothing = 0;
  CHECK_NEAR(cav_contact_activation(state, &moving), 0.02 + 0.05, 1e-15);
  cav_state_free(state);
}

#ifdef CAVORT_HAVE_MUJOCO

/// What one model showed.
typedef struct tally {
  int poses, contacts, most, missing, more, unlike, across;
  double worst;
} tally;

// capsules whose axes cross, as in planar models: in MuJoCo rounding chooses the side of the normal, in some poses all
// of its direction, and with it the point, which lies off the middle if the radii differ; only the gap is compared
static int crossing(const cav_model *model, const cav_contact *c) {
  const cav_geom *a = model->geom + model->pair[c->pair].geom1, *b = model->geom + model->pair[c->pair].geom2;
  return a->type == CAV_GEOM_CAPSULE && b->type == CAV_GEOM_CAPSULE && c->dist < 1e-12 - a->size[0] - b->size[0];
}

// contacts of one pose matched by geoms and nearness
static void match(const cav_state *state, const mjData *d, tally *t) {
  t->poses++;
  t->contacts += d->ncon;
  t->most = d->ncon > t->most ? d->ncon : t->most;
  t->missing += d->ncon > state->ncontact ? d->ncon - state->ncontact : 0;
  t->more += state->ncontact > d->ncon ? state->ncontact - d->ncon : 0;
  for (int j = 0; j < d->ncon; j++) {
    const mjContact *theirs = d->contact + j;
    double best = INFINITY;
    int across = 0;
    for (int k = 0; k < state->ncontact; k++) {
      const cav_contact *ours = state->contact + k;
      const cav_pair *pair = state->model->pair + ours->pair;
      int same = pair->geom1 == theirs->geom1 && pair->geom2 == theirs->geom2;
      if (!same || ours->dim != theirs->dim) continue;
      double x[3], error = fabs(ours->dist - theirs->dist);
      sub3(x, ours->pos, theirs->pos);
      error = fmax(error, fabs(ours->margin - theirs->includemargin));
      if (crossing(state->model, ours)) {
        across = 1;
      } else {
        for (int i = 0; i < 9; i++) error = fmax(error, fabs(ours->frame[i] - theirs->frame[i]));
        error = fmax(error, norm3(x));
      }
      for (int i = 0; i < 5; i++) error = fmax(error, fabs(ours->friction[i] - theirs->friction[i]));
      best = fmin(best, error);
    }
    t->across += across;
    if (best < 1e-9) {
      t->worst = fmax(t->worst, best);
    } else {
      t->unlike++;
    }
  }
}

// random posture near the ground, so that floor and self contacts occur
static void random_posture(const mjModel *m, double *q) {
  memcpy(q, m->qpos0, sizeof *q * (size_t)m->nq);
  for (int j = 0; j < m->njnt; j++) {
    double *x = q + m->jnt_qposadr[j];
    if (m->jnt_type[j] == mjJNT_FREE) {
      x[2] = uniform(0, 0.6);
      random_quat(x + 3);
    } else if (m->jnt_type[j] == mjJNT_BALL) {
      random_quat(x);
    } else {
      *x = m->jnt_type[j] == mjJNT_HINGE ? uniform(-2, 2) : uniform(-1, 0.5);
    }
  }
}

static void test_model(const char *folder, const char *name) {
  char path[4200], text[300] = "";
  snprintf(path, sizeof path, "%s/%s", folder, name);
  cav_error error;
  cav_model *model = cav_model_load(path, &error);
  mjModel *m = mj_loadXML(path, NULL, text, sizeof text);
  cav_state *state = model ? cav_state_new(model) : NULL;
  mjData *d = m ? mj_makeData(m) : NULL;
  if (!CHECK(state && d)) {
    fprintf(stderr, "    %s: %s %s\n", path, model ? "" : error.text, text);
  } else {
    tally t = {0};
    for (int pose = 0; pose < 300; pose++) {
      random_posture(m, d->qpos);
      mj_kinematics(m, d);
      mj_collision(m, d);
      CHECK(cav_position(model, state, d->qpos) == CAV_OK);
      match(state, d, &t);
    }
    printf(
        "%-24s %3d pairs, %5d contacts in %d poses, at most %2d: %d missing, %d more, %d unlike, difference %.1e; "
        "%d of crossing axes\n",
        name, model->npair, t.contacts, t.poses, t.most, t.missing, t.more, t.unlike, t.worst, t.across);
    // bound 1e-9, seen 3e-13
    CHECK(t.missing == 0 && t.more == 0 && t.unlike == 0);
  }
  mj_deleteData(d);
  mj_deleteModel(m);
  cav_state_free(state);
  cav_model_free(model);
}
#endif

int main(void) {
  test_heap(CAV_SWEEP_FROM);
  test_heap(0);
  test_standing(LINKS - 1);
  test_standing(3);
  test_reach();
#ifdef CAVORT_HAVE_MUJOCO
  static const char *const models[] = {"mujoco/humanoid.xml",     "dm_control/acrobot.xml",  "dm_control/cartpole.xml",
                                       "dm_control/pendulum.xml", "dm_control/hopper.xml",   "dm_control/walker.xml",
                                       "dm_control/cheetah.xml",  "dm_control/humanoid.xml", "dm_control/reacher.xml"};
  const char *folder = check_shared_models();
  if (!folder) printf("shared models absent: not compared with MuJoCo\n");
  for (size_t k = 0; folder && k < sizeof models / sizeof *models; k++) test_model(folder, models[k]);
#else
  printf("built without MuJoCo: not compared\n");
#endif
  return check_result();
}
