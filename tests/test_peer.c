/// The inverse against MuJoCo's mj_inverse on models no one here wrote, through its library: 1,000 random states each,
/// joints past their limits, bodies in the floor and in each other. MuJoCo's inverse leaves implicit damping out, so
/// B h a is added to it. A state may differ only if contacts do, and each that does is explained twice:
///  - given our contacts in the place of its own, MuJoCo computes the same u;
///  - of each pair of geoms whose contacts differ, ours carries its proof and beats every other direction tried
///    (proof.h), and the deepest of MuJoCo's misses its own by more than rounding; where we have none the two are
///    apart. Only a capsule on a box may differ in its second point alone.
/// A level height field is proven as the plane that it is. Skipped without MuJoCo or without the models.
#include "proof.h"
#include "scene.h"

#ifndef CAVORT_HAVE_MUJOCO
int main(void) {
  printf("skipped: built without MuJoCo\n");
  return CHECK_SKIPPED;
}
#else
#include <mujoco/mujoco.h>

enum { STATES = 1000, TYPES = CAV_GEOM_HFIELD + 1 };
static const double SAME = 1e-9;      ///< relative error of u that counts as equal
static const double GEOMETRY = 1e-10; ///< m or 1: difference of contacts that counts
static const double PROVEN = 1e-12;   ///< m: residual of a proof, ours; seen: 7e-14
static const double MISSED = 1e-9;    ///< m: residual of MuJoCo's from which on ours is the better one
/// A model and the fraction of states that must agree; less than 0.99 where MuJoCo's contacts are made by iteration or
/// miss the least depth: box against box (double_pendulum), capsule on cylinder (slider_crank), ellipsoid and height
/// field (quadruped).
typedef struct subject {
  const char *name;
  double fraction;
} subject;
static const char *const kinds[TYPES] = {"plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "field"};

/// One model in both libraries.
typedef struct pair_of_models {
  mjModel *theirs;
  mjData *data;
  cav_model *ours;
  cav_state *state;
} pair_of_models;

// coordinate that lifts the root: of a free joint, or a slide along z of a top body; -1 if there is none
static int height_of(const mjModel *m) {
  for (int i = 0; i < m->njnt; i++) {
    if (m->body_parentid[m->jnt_bodyid[i]] != 0) continue;
    if (m->jnt_type[i] == mjJNT_FREE) return m->jnt_qposadr[i] + 2;
    if (m->jnt_type[i] == mjJNT_SLIDE && fabs(m->jnt_axis[3 * i + 2]) > 0.99) return m->jnt_qposadr[i];
  }
  return -1;
}

// joints over their ranges and a tenth beyond either end, free roots any way up, lowest geom about the floor
static void draw_state(const mjModel *m, mjData *d) {
  mj_resetData(m, d);
  for (int i = 0; i < m->njnt; i++) {
    double *q = d->qpos + m->jnt_qposadr[i];
    const double *range = m->jnt_range + 2 * i;
    if (m->jnt_type[i] == mjJNT_FREE || m->jnt_type[i] == mjJNT_BALL) {
      double *quat = m->jnt_type[i] == mjJNT_FREE ? q + 3 : q;
      for (int k = 0; k < 4; k++) quat[k] = scene_normal();
      mju_normalize4(quat);
    } else if (m->jnt_limited[i]) {
      *q = 0.5 * (range[0] + range[1]) + 0.6 * (range[1] - range[0]) * scene_uniform();
    } else {
      *q = (m->jnt_type[i] == mjJNT_HINGE ? 3 : 0.3) * scene_uniform();
    }
  }
  int height = height_of(m);
  if (height >= 0) {
    mj_kinematics(m, d);
    double lowest = INFINITY;
    for (int i = 0; i < m->ngeom; i++) {
      if (m->geom_bodyid[i] > 0) lowest = fmin(lowest, d->geom_xpos[3 * i + 2] - m->geom_size[3 * i]);
    }
    d->qpos[height] -= lowest + 0.1 * scene_uniform();
  }
  for (int i = 0; i < m->nv; i++) {
    d->qvel[i] = 2 * scene_normal();
    d->qacc[i] = 20 * scene_normal();
  }
}

// largest difference of n numbers
static double apart(const double *a, const double *b, int n) {
  double worst = 0;
  for (int i = 0; i < n; i++) worst = fmax(worst, fabs(a[i] - b[i]));
  return worst;
}

/// Contacts of one pair of geoms by one library.
typedef struct contacts {
  int n;
  cav_touch at[CAV_TOUCH_MAX];
} contacts;

static contacts ours_of(const pair_of_models *p, int pair) {
  contacts c = {0};
  for (int i = 0; i < p->state->ncontact && c.n < CAV_TOUCH_MAX; i++) {
    const cav_contact *from = &p->state->contact[i];
    if (from->pair != pair) continue;
    cav_touch *to = &c.at[c.n++];
    copy3(to->pos, from->pos);
    copy3(to->normal, from->frame);
    to->dist = from->dist;
  }
  return c;
}

static contacts theirs_of(const pair_of_models *p, int pair) {
  const cav_pair *of = &p->ours->pair[pair];
  contacts c = {0};
  for (int i = 0; i < p->data->ncon && c.n < CAV_TOUCH_MAX; i++) {
    const mjContact *from = &p->data->contact[i];
    int straight = from->geom1 == of->geom1 && from->geom2 == of->geom2;
    if (from->exclude || (!straight && !(from->geom1 == of->geom2 && from->geom2 == of->geom1))) continue;
    cav_touch *to = &c.at[c.n++];
    copy3(to->pos, from->pos);
    scale3(to->normal, straight ? 1 : -1, from->frame);
    to->dist = from->dist;
  }
  return c;
}

// 1 if some contact of the one has no equal in the other
static int differ(const contacts *a, const contacts *b) {
  if (a->n != b->n) return 1;
  for (int i = 0; i < a->n; i++) {
    double least = INFINITY;
    for (int j = 0; j < b->n; j++) {
      const cav_touch *s = &a->at[i], *t = &b->at[j];
      double off = fmax(fabs(s->dist - t->dist), fmax(apart(s->pos, t->pos, 3), apart(s->normal, t->normal, 3)));
      least = fmin(least, off);
    }
    if (!(least < GEOMETRY)) return 1;
  }
  return 0;
}

static cav_shape shape_of(const pair_of_models *p, int geom) {
  cav_shape s = cav_shape_of(p->ours, &p->ours->geom[geom]);
  cav_pose pose;
  cav_object_pose(p->ours, p->state, CAV_OBJECT_GEOM, geom, &pose);
  copy3(s.pos, pose.pos);
  memcpy(s.rotation, pose.rotation, sizeof s.rotation);
  return s;
}

/// What is known of the disputed pairs of two types of geoms.
typedef struct dispute {
  int pairs, unproven, further; ///< further: both deepest are proven, the points beside them differ
  double ours, least, most;     ///< largest residual of ours; smallest and largest of MuJoCo's, m
} dispute;

// residual of the deepest of some contacts, best: the largest gap of any direction; where there is none, what is missed
static double residual_of(const cav_shape *a, const cav_shape *b, const contacts *c, double margin, double best) {
  if (!c->n) return fmax(margin - best, 0);
  const cav_touch *deepest = &c->at[proof_nearest(c->at, c->n)];
  proof is = proof_of(a, b, deepest);
  return fmax(fmax(is.surface, is.gap), best - deepest->dist);
}

static void flip(contacts *c) {
  for (int i = 0; i < c->n; i++) scale3(c->at[i].normal, -1, c->at[i].normal);
}

// one disputed pair
static void decide(const pair_of_models *p, int pair, contacts *ours, contacts *theirs,
                   dispute disputes[TYPES][TYPES]) {
  const cav_pair *of = &p->ours->pair[pair];
  cav_shape a = shape_of(p, of->geom1), b = shape_of(p, of->geom2);
  dispute *d = &disputes[a.type][b.type];
  if (b.type == CAV_GEOM_HFIELD) {
    // level: the plane, which comes first of the two
    const cav_hfield *h = b.hfield;
    int level = 1;
    for (int i = 0; i < h->nrow * h->ncol; i++) level &= h->height[i] == 0;
    CHECK(level);
    cav_shape plane = b;
    plane.type = CAV_GEOM_PLANE;
    b = a;
    a = plane;
    flip(ours), flip(theirs);
  }
  double best = a.type == CAV_GEOM_PLANE ? proof_height_of(&b, &a) : proof_distance(&a, &b);
  double margin = of->margin, we = residual_of(&a, &b, ours, margin, best);
  double they = residual_of(&a, &b, theirs, margin, best);
  // all other points of ours are of both bodies
  for (int i = 0; i < ours->n; i++) {
    double x[3], y[3];
    axpy3(x, ours->at[i].pos, -ours->at[i].dist / 2, ours->at[i].normal);
    axpy3(y, ours->at[i].pos, ours->at[i].dist / 2, ours->at[i].normal);
    we = fmax(we, fmax(proof_height(&a, x), proof_height(&b, y)));
  }
  d->unproven += !(we <= PROVEN);
  d->further += !(they > MISSED);
  d->ours = fmax(d->ours, we);
  d->least = d->pairs ? fmin(d->least, they) : they;
  d->most = fmax(d->most, they);
  d->pairs++;
}

// all pairs of a state whose contacts differ; their number
static int settle(const pair_of_models *p, dispute disputes[TYPES][TYPES]) {
  int disputed = 0;
  for (int i = 0; i < p->ours->npair; i++) {
    contacts ours = ours_of(p, i), theirs = theirs_of(p, i);
    if (!differ(&ours, &theirs)) continue;
    decide(p, i, &ours, &theirs, disputes);
    disputed++;
  }
  return disputed;
}

// u of one state by both; relative error
static double compare(const pair_of_models *p, double *v_next, double *u, double *expected) {
  const mjModel *m = p->theirs;
  mjData *d = p->data;
  mj_inverse(m, d);
  for (int i = 0; i < m->nv; i++) {
    v_next[i] = d->qvel[i] + m->opt.timestep * d->qacc[i];
    // what v_next has left of the acceleration
    double a = (v_next[i] - d->qvel[i]) / m->opt.timestep;
    expected[i] = d->qfrc_inverse[i] + m->dof_damping[i] * m->opt.timestep * a;
  }
  CHECK(cav_inverse(p->ours, p->state, d->qpos, d->qvel, v_next, u) == CAV_OK);
  return scene_error(u, expected, m->nv);
}

// MuJoCo's inverse of the same state with our contacts in the place of its own; relative error
static double compare_fed(const pair_of_models *p, const double *v_next, const double *u, double *expected) {
  const mjModel *m = p->theirs;
  mjData *d = p->data;
  d->ncon = 0;
  for (int i = 0; i < p->state->ncontact; i++) {
    const cav_contact *c = &p->state->contact[i];
    const cav_pair *pair = &p->ours->pair[c->pair];
    mjContact fed = {.dist = c->dist,
                     .includemargin = c->margin,
                     .dim = c->dim,
                     .geom1 = pair->geom1,
                     .geom2 = pair->geom2,
                     .efc_address = -1};
    copy3(fed.pos, c->pos);
    memcpy(fed.frame, c->frame, sizeof fed.frame);
    memcpy(fed.friction, c->friction, sizeof fed.friction);
    memcpy(fed.solref, pair->softness.solref, sizeof fed.solref);
    memcpy(fed.solimp, pair->softness.solimp, sizeof fed.solimp);
    CHECK(mj_addContact(m, d, &fed) == 0);
  }
  mj_makeConstraint(m, d);
  mj_inverseSkip(m, d, mjSTAGE_POS, 1);
  for (int i = 0; i < m->nv; i++) {
    double a = (v_next[i] - d->qvel[i]) / m->opt.timestep;
    expected[i] = d->qfrc_inverse[i] + m->dof_damping[i] * m->opt.timestep * a;
  }
  return scene_error(u, expected, m->nv);
}

static void read_sensor(const pair_of_models *p, cav_sensor_type type, cav_object_type kind, int object, double *out) {
  cav_sensor sensor = {.name = "", .type = type, .object_type = kind, .object = object};
  cav_sensor_read(p->ours, p->state, &sensor, out);
}

// frames, their velocities and subtrees of every body at the state of the last comparison, v_next = v
static double compare_readings(const pair_of_models *p) {
  const mjModel *m = p->theirs;
  mjData *d = p->data;
  double worst = 0, out[4], motion[6], *u = scene_vector(m->nv);
  CHECK(cav_inverse(p->ours, p->state, d->qpos, d->qvel, d->qvel, u) == CAV_OK);
  mj_subtreeVel(m, d);
  for (int i = 0; i < m->nbody; i++) {
    // MuJoCo's bodies of a URDF are the links that move: centres of mass are those of what it merged
    int b = i && p->ours->fused ? cav_object_find(p->ours, CAV_OBJECT_XBODY, m->names + m->name_bodyadr[i]) : i;
    if (!p->ours->fused) {
      read_sensor(p, CAV_SENSOR_FRAMEPOS, CAV_OBJECT_BODY, b, out);
      worst = fmax(worst, apart(out, d->xipos + 3 * i, 3));
    }
    read_sensor(p, CAV_SENSOR_FRAMEPOS, CAV_OBJECT_XBODY, b, out);
    worst = fmax(worst, apart(out, d->xpos + 3 * i, 3));
    for (int k = 0; k < 3; k++) {
      double axis[3] = {d->xmat[9 * i + k], d->xmat[9 * i + 3 + k], d->xmat[9 * i + 6 + k]};
      read_sensor(p, (cav_sensor_type)(CAV_SENSOR_FRAMEXAXIS + k), CAV_OBJECT_XBODY, b, out);
      worst = fmax(worst, apart(out, axis, 3));
    }
    mj_objectVelocity(m, d, mjOBJ_XBODY, i, motion, 0);
    read_sensor(p, CAV_SENSOR_FRAMEANGVEL, CAV_OBJECT_XBODY, b, out);
    worst = fmax(worst, apart(out, motion, 3));
    read_sensor(p, CAV_SENSOR_FRAMELINVEL, CAV_OBJECT_XBODY, b, out);
    worst = fmax(worst, apart(out, motion + 3, 3));
    // what stands still has a mass in MuJoCo's subtree of the world and none in ours
    if (m->body_weldid[i] == 0) continue;
    read_sensor(p, CAV_SENSOR_SUBTREECOM, CAV_OBJECT_BODY, b, out);
    worst = fmax(worst, apart(out, d->subtree_com + 3 * i, 3));
    read_sensor(p, CAV_SENSOR_SUBTREELINVEL, CAV_OBJECT_BODY, b, out);
    worst = fmax(worst, apart(out, d->subtree_linvel + 3 * i, 3));
    read_sensor(p, CAV_SENSOR_SUBTREEANGMOM, CAV_OBJECT_BODY, b, out);
    worst = fmax(worst, apart(out, d->subtree_angmom + 3 * i, 3));
  }
  for (int i = 0; i < m->ngeom && !p->ours->fused; i++) {
    read_sensor(p, CAV_SENSOR_FRAMEPOS, CAV_OBJECT_GEOM, i, out);
    worst = fmax(worst, apart(out, d->geom_xpos + 3 * i, 3));
    cav_pose pose;
    cav_object_pose(p->ours, p->state, CAV_OBJECT_GEOM, i, &pose);
    worst = fmax(worst, apart(pose.rotation, d->geom_xmat + 9 * i, 9));
  }
  free(u);
  return worst;
}

static int ascending(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static void print_disputes(dispute disputes[TYPES][TYPES]) {
  for (int i = 0; i < TYPES; i++) {
    for (int j = 0; j < TYPES; j++) {
      const dispute *d = &disputes[i][j];
      if (!d->pairs) continue;
      printf(
          "    %4d disputed pairs of %s and %s: ours misses its proof by %.1e m at most, MuJoCo's by %.1e to %.1e; %d "
          "differ in further points alone\n",
          d->pairs, kinds[i], kinds[j], d->ours, d->least, d->most, d->further);
      CHECK(d->unproven == 0);
      // a capsule's second point on a box is chosen to move with the pose (segment.c)
      CHECK(d->further == 0 || (i == CAV_GEOM_CAPSULE && j == CAV_GEOM_BOX));
    }
  }
}

static void compare_states(const char *name, double fraction, const pair_of_models *p) {
  static double error[STATES];
  double *v_next = scene_vector(p->ours->nv), *u = scene_vector(p->ours->nv), *expected = scene_vector(p->ours->nv);
  dispute disputes[TYPES][TYPES] = {{{0}}};
  int same = 0, unexplained = 0, most = 0, rows = 0, touching = 0, limited = 0;
  double readings = 0, fed = 0;
  for (int k = 0; k < STATES; k++) {
    draw_state(p->theirs, p->data);
    error[k] = compare(p, v_next, u, expected);
    most = p->state->ncontact > most ? p->state->ncontact : most;
    rows = p->data->nefc > rows ? p->data->nefc : rows;
    touching += p->state->ncontact > 0;
    limited += p->state->nrow > 0;
    if (error[k] <= SAME) {
      same++;
      if (k % 10 == 0) readings = fmax(readings, compare_readings(p));
      continue;
    }
    unexplained += !settle(p, disputes);
    fed = fmax(fed, compare_fed(p, v_next, u, expected));
  }
  CHECK(p->data->warning[mjWARN_CONTACTFULL].number == 0 && p->data->warning[mjWARN_CNSTRFULL].number == 0);
  qsort(error, STATES, sizeof *error, ascending);
  printf("%-26s %3d %9d %5d %9d %8d   %.1e  %.1e  %.1e  %.1e %7.1f%%  %.1e  %.1e\n", name, p->ours->nv, most, rows,
         touching, limited, error[STATES / 2], error[STATES * 9 / 10], error[STATES * 99 / 100], error[STATES - 1],
         100.0 * same / STATES, fed, readings);
  print_disputes(disputes);
  CHECK(same >= STATES * fraction);
  CHECK(unexplained == 0);
  // every state, the disputed ones with the same contacts
  CHECK(fed <= SAME);
  // bound: rounding of velocities about 20 m/s and angular momenta about 100; seen 4e-14
  CHECK(readings <= 1e-11);
  free(v_next), free(u), free(expected);
}

// copies a URDF without the collision elements whose meshes are not there: MuJoCo does not read the file with them
static int without_meshes(const char *path, char *copy) {
  static char text[200000];
  FILE *file = fopen(path, "r");
  if (!file) return 0;
  size_t length = fread(text, 1, sizeof text - 1, file);
  fclose(file);
  text[length] = 0;
  for (char *from = text, *end; (from = strstr(from, "<collision")); from++) {
    end = strstr(from, "</collision>");
    char *mesh = strstr(from, "<mesh");
    if (from[10] == '_' || !end || !mesh || mesh > end) continue;
    memmove(from, end + 12, strlen(end + 12) + 1);
    from--;
  }
  int out = mkstemps(copy, 5);
  if (out < 0) return 0;
  int whole = write(out, text, strlen(text)) == (ssize_t)strlen(text);
  close(out);
  return whole;
}

static void compare_model(const char *folder, const subject *model) {
  const char *name = model->name;
  char path[4200], text[1000], copy[] = "/tmp/cavort-peer-XXXXXX.urdf";
  snprintf(path, sizeof path, "%s/%s", folder, name);
  cav_error error = {0};
  pair_of_models p = {.ours = cav_model_load(path, &error)};
  int urdf = strstr(name, ".urdf") != NULL;
  if (urdf) CHECK(without_meshes(path, copy));
  p.theirs = mj_loadXML(urdf ? copy : path, NULL, text, sizeof text);
  if (urdf) unlink(copy);
  CHECK(p.ours != NULL);
  CHECK(p.theirs != NULL);
  if (!p.ours) fprintf(stderr, "    %s\n", error.text);
  if (p.ours && p.theirs) {
    p.theirs->opt.cone = mjCONE_ELLIPTIC;
    p.data = mj_makeData(p.theirs);
    p.state = cav_state_new(p.ours);
    CHECK(p.ours->nq == p.theirs->nq && p.ours->nv == p.theirs->nv);
    compare_states(name, model->fraction, &p);
    mj_deleteData(p.data);
    cav_state_free(p.state);
  }
  if (p.theirs) mj_deleteModel(p.theirs);
  cav_model_free(p.ours);
}

int main(void) {
  static const subject models[] = {
      {"mujoco/humanoid.xml", 0.99},        {"dm_control/acrobot.xml", 0.99},    {"dm_control/cartpole.xml", 0.99},
      {"dm_control/pendulum.xml", 0.99},    {"dm_control/hopper.xml", 0.99},     {"dm_control/walker.xml", 0.99},
      {"dm_control/cheetah.xml", 0.99},     {"dm_control/humanoid.xml", 0.99},   {"dm_control/reacher.xml", 0.99},
      {"urdf/double_pendulum.urdf", 0.7},   {"urdf/simple_humanoid.urdf", 0.99}, {"urdf/solo12.urdf", 0.99},
      {"dm_control/ball_in_cup.xml", 0.99}, {"dm_control/point_mass.xml", 0.99}, {"dm_control/finger.xml", 0.99},
      {"dm_control/manipulator.xml", 0.99}, {"mujoco/arm26.xml", 0.99},          {"mujoco/slider_crank.xml", 0.93},
      {"dm_control/fish.xml", 0.99},        {"dm_control/swimmer.xml", 0.99},    {"dm_control/quadruped.xml", 0.3}};
  const char *folder = check_shared_models();
  if (!folder) {
    printf("skipped: set CAVORT_SHARED_MODELS to the folder of the models\n");
    return CHECK_SKIPPED;
  }
  char kept[4096];
  snprintf(kept, sizeof kept, "%s", folder);
  printf("relative error of u in %d random states\n", STATES);
  printf("%-26s %3s %9s %5s %9s %8s   %-8s %-8s %-8s %-8s %s %-8s %s\n", "model", "nv", "contacts", "rows", "touching",
         "limited", "median", "90%", "99%", "most", "within 1e-9", "fed", "readings");
  for (unsigned i = 0; i < sizeof models / sizeof *models; i++) compare_model(kept, &models[i]);
  return check_result();
}
#endif
