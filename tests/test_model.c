/// Loaded models against what MuJoCo makes of the same files: sizes, masses, frames, joints, tendons, actuators,
/// sensors, keyframes, inverse weights, and the list of pairs with their mixed parameters. Plus what needs no peer:
/// names, lookup, constancy, own extensions (frame). Peer checks are left out, visibly, without MuJoCo.

#include <unistd.h>

#include "cavort/dynamics.h"
#include "check.h"

#ifndef CAVORT_SOURCE_ROOT
#define CAVORT_SOURCE_ROOT "."
#endif

// writes text to a file of its own and returns the path; the caller removes it
static const char *write_file(const char *text) {
  static char path[200];
  const char *folder = getenv("TMPDIR");
  snprintf(path, sizeof path, "%.150s/cavort-model-%ld.xml", folder ? folder : "/tmp", (long)getpid());
  FILE *file = fopen(path, "w");
  if (file) {
    fputs(text, file);
    fclose(file);
  }
  return path;
}

static cav_model *load(const char *path) {
  cav_error error;
  cav_model *model = cav_model_load(path, &error);
  if (!CHECK(model != NULL)) fprintf(stderr, "    %s\n", error.text);
  return model;
}

static cav_model *load_text(const char *text) {
  const char *path = write_file(text);
  cav_model *model = load(path);
  remove(path);
  return model;
}

// as many features as one file can hold
static const char features[] = CAVORT_SOURCE_ROOT "/tests/features.xml";

#ifdef CAVORT_HAVE_MUJOCO
#include <mujoco/mujoco.h>

#include "peer.h"

// rounding of a short chain of operations; largest residual seen 3.1e-15 relative
static const double rounding = 1e-11;
// MuJoCo's eigenvalue routine (mju_eig3) stops at an error up to 1e-6: where a body has general inertia (only in the
// file of features) its inertia and what depends on it agree to that; largest residual seen 9.1e-9. Ours is held to
// 1e-14 below
static double slack = 1e-11;

static double worst, worst_slack;

static double relative(double a, double b) { return fabs(a - b) / fmax(1, fmax(fabs(a), fabs(b))); }

static void near(double a, double b, const char *what, const char *name) {
  worst = fmax(worst, relative(a, b));
  check_near(a, b, rounding * fmax(1, fmax(fabs(a), fabs(b))), what, 0, name);
}

static void near_slack(double a, double b, const char *what, const char *name) {
  worst_slack = fmax(worst_slack, relative(a, b));
  check_near(a, b, slack * fmax(1, fmax(fabs(a), fabs(b))), what, 0, name);
}

static void all_near(const double *a, const mjtNum *b, int n, const char *what, const char *name) {
  for (int i = 0; i < n; i++) near(a[i], b[i], what, name);
}

static void same(int a, int b, const char *what, const char *name) {
  if (!check_note(a == b, what, 0, name)) fprintf(stderr, "    %d against %d\n", a, b);
}

static void compare_softness(const cav_softness *s, const mjtNum *solref, const mjtNum *solimp, const char *name) {
  all_near(s->solref, solref, 2, "solref", name);
  all_near(s->solimp, solimp, 5, "solimp", name);
}

static void compare_bodies(const cav_model *m, const mjModel *p) {
  for (int i = 0; i < m->nbody && i < p->nbody; i++) {
    const cav_body *b = &m->body[i];
    if (i) CHECK_TEXT(b->name, p->names + p->name_bodyadr[i]);
    if (i) same(b->parent, p->body_parentid[i], "body parent", b->name);
    same(b->ngeom, p->body_geomnum[i], "body geoms", b->name);
    near(b->mass, p->body_mass[i], "mass", b->name);
    all_near(b->com, p->body_ipos + 3 * i, 3, "com", b->name);
    // moments in any order: axes may be named differently
    double a[3] = {b->inertia[0], b->inertia[1], b->inertia[2]}, c[3];
    memcpy(c, p->body_inertia + 3 * i, sizeof c);
    near_slack(a[0] + a[1] + a[2], c[0] + c[1] + c[2], "inertia trace", b->name);
    near_slack(fmax(a[0], fmax(a[1], a[2])), fmax(c[0], fmax(c[1], c[2])), "largest moment", b->name);
    near_slack(fmin(a[0], fmin(a[1], a[2])), fmin(c[0], fmin(c[1], c[2])), "least moment", b->name);
    for (int k = 0; k < 2; k++)
      near_slack(b->inverse_weight[k], p->body_invweight0[2 * i + k], "body inverse weight", b->name);
  }
}

static void compare_joints(const cav_model *m, const mjModel *p) {
  for (int i = 0; i < m->njoint && i < p->njnt; i++) {
    const cav_joint *j = &m->joint[i];
    CHECK_TEXT(j->name, p->names + p->name_jntadr[i]);
    same((int)j->type, p->jnt_type[i], "joint type", j->name);
    same(j->body, p->jnt_bodyid[i], "joint body", j->name);
    same(j->q, p->jnt_qposadr[i], "joint q", j->name);
    same(j->dof, p->jnt_dofadr[i], "joint dof", j->name);
    same(j->limited, p->jnt_limited[i], "joint limited", j->name);
    if (j->limited) all_near(j->range, p->jnt_range + 2 * i, 2, "range", j->name);
    if (j->type != CAV_JOINT_FREE) all_near(j->pos, p->jnt_pos + 3 * i, 3, "joint pos", j->name);
    if (j->type > CAV_JOINT_BALL) {
      all_near(j->axis, p->jnt_axis + 3 * i, 3, "axis", j->name);
      near(j->ref, p->qpos0[j->q], "ref", j->name);
      near(j->springref, p->qpos_spring[j->q], "springref", j->name);
    }
    near(j->stiffness, p->jnt_stiffness[i], "stiffness", j->name);
    near(j->margin, p->jnt_margin[i], "margin", j->name);
    compare_softness(&j->limit, p->jnt_solref + 2 * i, p->jnt_solimp + 5 * i, j->name);
  }
  for (int i = 0; i < m->nv && i < p->nv; i++) {
    const cav_dof *d = &m->dof[i];
    const char *name = m->joint[d->joint].name;
    same(d->parent, p->dof_parentid[i], "dof parent", name);
    same(d->joint, p->dof_jntid[i], "dof joint", name);
    near(d->damping, p->dof_damping[i], "damping", name);
    near(d->armature, p->dof_armature[i], "armature", name);
    near(d->frictionloss, p->dof_frictionloss[i], "frictionloss", name);
    near_slack(d->inverse_weight, p->dof_invweight0[i], "dof inverse weight", name);
    compare_softness(&d->friction, p->dof_solref + 2 * i, p->dof_solimp + 5 * i, name);
  }
}

static const int peer_type[CAV_GEOM_TYPES] = {mjGEOM_PLANE,     mjGEOM_SPHERE,   mjGEOM_CAPSULE,
                                              mjGEOM_ELLIPSOID, mjGEOM_CYLINDER, mjGEOM_BOX};

static void compare_geoms(const cav_model *m, const mjModel *p) {
  for (int i = 0; i < m->ngeom && i < p->ngeom; i++) {
    const cav_geom *g = &m->geom[i];
    CHECK_TEXT(g->name, p->names + p->name_geomadr[i]);
    same(peer_type[g->type], p->geom_type[i], "geom type", g->name);
    same(g->body, p->geom_bodyid[i], "geom body", g->name);
    same(g->contype, p->geom_contype[i], "contype", g->name);
    same(g->conaffinity, p->geom_conaffinity[i], "conaffinity", g->name);
    same(g->condim, p->geom_condim[i], "condim", g->name);
    same(g->priority, p->geom_priority[i], "priority", g->name);
    int sizes = g->type == CAV_GEOM_PLANE                                  ? 0
                : g->type == CAV_GEOM_SPHERE                               ? 1
                : g->type == CAV_GEOM_BOX || g->type == CAV_GEOM_ELLIPSOID ? 3
                                                                           : 2;
    all_near(g->size, p->geom_size + 3 * i, sizes, "size", g->name);
    all_near(g->friction, p->geom_friction + 3 * i, 3, "friction", g->name);
    near(g->margin, p->geom_margin[i], "margin", g->name);
    near(g->solmix, p->geom_solmix[i], "solmix", g->name);
    compare_softness(&g->softness, p->geom_solref + 2 * i, p->geom_solimp + 5 * i, g->name);
    if (g->type != CAV_GEOM_PLANE) near(g->bound, p->geom_rbound[i], "bounding radius", g->name);
    const float *rgba = p->geom_matid[i] >= 0 ? p->mat_rgba + 4 * p->geom_matid[i] : p->geom_rgba + 4 * i;
    const float plain[4] = {0.5f, 0.5f, 0.5f, 1};
    if (memcmp(p->geom_rgba + 4 * i, plain, sizeof plain)) rgba = p->geom_rgba + 4 * i;
    for (int k = 0; k < 4; k++) near((double)g->rgba[k], (double)rgba[k], "rgba", g->name);
  }
}

static void compare_path(const cav_model *m, const mjModel *p, int tendon) {
  static const int kinds[] = {[CAV_TENDON_PATH_SITE] = mjWRAP_SITE,
                              [CAV_TENDON_PATH_SPHERE] = mjWRAP_SPHERE,
                              [CAV_TENDON_PATH_CYLINDER] = mjWRAP_CYLINDER,
                              [CAV_TENDON_PATH_PULLEY] = mjWRAP_PULLEY};
  const cav_tendon *t = &m->tendon[tendon];
  for (int k = 0; k < t->npath; k++) {
    const cav_tendon_path_point *x = &m->tendon_path[t->path + k];
    int w = p->tendon_adr[tendon] + k;
    same(kinds[x->type], p->wrap_type[w], "path element", t->name);
    if (x->type != CAV_TENDON_PATH_PULLEY) same(x->object, p->wrap_objid[w], "path object", t->name);
    if (x->type == CAV_TENDON_PATH_PULLEY) near(x->divisor, p->wrap_prm[w], "path divisor", t->name);
    if (x->type == CAV_TENDON_PATH_SPHERE || x->type == CAV_TENDON_PATH_CYLINDER)
      same(x->side, (int)lround(p->wrap_prm[w]), "path side", t->name);
  }
}

static void compare_tendons(const cav_model *m, const mjModel *p) {
  for (int i = 0; i < m->ntendon && i < p->ntendon; i++) {
    const cav_tendon *t = &m->tendon[i];
    CHECK_TEXT(t->name, p->names + p->name_tendonadr[i]);
    same(t->npart + t->npath, p->tendon_num[i], "tendon parts", t->name);
    compare_path(m, p, i);
    for (int k = 0; k < t->npart; k++) {
      int w = p->tendon_adr[i] + k;
      same(m->tendon_part[t->part + k].joint, p->wrap_objid[w], "tendon joint", t->name);
      near(m->tendon_part[t->part + k].coef, p->wrap_prm[w], "tendon coef", t->name);
    }
    same(t->limited, p->tendon_limited[i], "tendon limited", t->name);
    all_near(t->range, p->tendon_range + 2 * i, 2, "tendon range", t->name);
    near(t->margin, p->tendon_margin[i], "tendon margin", t->name);
    near(t->stiffness, p->tendon_stiffness[i], "tendon stiffness", t->name);
    near(t->damping, p->tendon_damping[i], "tendon damping", t->name);
    near(t->frictionloss, p->tendon_frictionloss[i], "tendon frictionloss", t->name);
    near(t->springlength[0], p->tendon_lengthspring[i], "tendon springlength", t->name);
    near_slack(t->inverse_weight, p->tendon_invweight0[i], "tendon inverse weight", t->name);
    compare_softness(&t->limit, p->tendon_solref_lim + 2 * i, p->tendon_solimp_lim + 5 * i, t->name);
    compare_softness(&t->friction, p->tendon_solref_fri + 2 * i, p->tendon_solimp_fri + 5 * i, t->name);
  }
}

static void compare_actuators(const cav_model *m, const mjModel *p) {
  for (int i = 0; i < m->nu && i < p->nu; i++) {
    const cav_actuator *a = &m->actuator[i];
    CHECK_TEXT(a->name, p->names + p->name_actuatoradr[i]);
    static const int kinds[] = {[CAV_TRANSMISSION_JOINT] = mjTRN_JOINT,
                                [CAV_TRANSMISSION_JOINT_IN_PARENT] = mjTRN_JOINTINPARENT,
                                [CAV_TRANSMISSION_TENDON] = mjTRN_TENDON,
                                [CAV_TRANSMISSION_SITE] = mjTRN_SITE,
                                [CAV_TRANSMISSION_CRANK] = mjTRN_SLIDERCRANK};
    same(kinds[a->transmission], p->actuator_trntype[i], "transmission", a->name);
    same(a->target, p->actuator_trnid[2 * i], "target", a->name);
    if (a->reference >= 0) same(a->reference, p->actuator_trnid[2 * i + 1], "reference", a->name);
    for (int k = 0; k < 6; k++) near(a->gear[k], p->actuator_gear[6 * i + k], "gear", a->name);
    int motor = a->gain == CAV_GAIN_FIXED && a->bias == CAV_BIAS_NONE;
    double gain = motor ? p->actuator_gainprm[i * mjNGAIN] : 1;
    near(a->unit, gain, "unit", a->name);
    same(a->ctrllimited, p->actuator_ctrllimited[i], "ctrllimited", a->name);
    same(a->forcelimited, p->actuator_forcelimited[i], "forcelimited", a->name);
    all_near(a->ctrlrange, p->actuator_ctrlrange + 2 * i, 2, "ctrlrange", a->name);
    if (a->forcelimited) near(a->forcerange[0] * gain, p->actuator_forcerange[2 * i], "forcerange", a->name);
  }
}

// sensors, in order; MuJoCo also has those of cameras
static void compare_sensors(const cav_model *m, const mjModel *p) {
  int k = 0, adr = 0;
  for (int i = 0; i < m->nsensor; i++, k++) {
    const cav_sensor *s = &m->sensor[i];
    while (k < p->nsensor && p->sensor_type[k] != peer_sensor[s->type]) k++;
    if (!CHECK(k < p->nsensor)) return;
    CHECK_TEXT(s->name, p->names + p->name_sensoradr[k]);
    if (s->type != CAV_SENSOR_CLOCK) same(s->object, p->sensor_objid[k], "sensor object", s->name);
    same(s->dim, p->sensor_dim[k], "sensor dim", s->name);
    same(s->adr, adr, "sensor adr", s->name);
    same(s->referred, p->sensor_reftype[k] != mjOBJ_UNKNOWN, "sensor reference", s->name);
    if (s->referred) same(s->reference, p->sensor_refid[k], "sensor reference", s->name);
    near(s->cutoff, p->sensor_cutoff[k], "sensor cutoff", s->name);
    adr += s->dim;
  }
  same(m->nsensordata, adr, "sensor data", m->name);
}

static void compare_keys(const cav_model *m, const mjModel *p) {
  same(m->nkey, p->nkey, "keyframes", m->name);
  for (int i = 0; i < m->nkey && i < p->nkey; i++) {
    CHECK_TEXT(m->key[i].name, p->names + p->name_keyadr[i]);
    near(m->key[i].time, p->key_time[i], "key time", m->key[i].name);
    all_near(m->key[i].q, p->key_qpos + m->nq * i, m->nq, "key qpos", m->key[i].name);
    all_near(m->key[i].v, p->key_qvel + m->nv * i, m->nv, "key qvel", m->key[i].name);
  }
}

static double uniform(unsigned *seed) {
  *seed = *seed * 1664525u + 1013904223u;
  return (double)(*seed >> 8) / (double)(1u << 24) * 2 - 1;
}

// world frames of everything at the file's posture and at others
static void compare_frames(const cav_model *m, mjModel *p) {
  static const cav_object_type kinds[] = {CAV_OBJECT_XBODY, CAV_OBJECT_BODY, CAV_OBJECT_GEOM, CAV_OBJECT_SITE};
  cav_state *state = cav_state_new(m);
  mjData *d = mj_makeData(p);
  unsigned seed = 7;
  if (!CHECK(state && d)) return;
  for (int trial = 0; trial < 5; trial++) {
    double *q = d->qpos;
    for (int i = 0; i < m->nq; i++) q[i] = p->qpos0[i] + (trial ? uniform(&seed) : 0);
    cav_configuration_normalise(m, q);
    CHECK(cav_position(m, state, q) == CAV_OK);
    mj_kinematics(p, d);
    const int counts[] = {m->nbody, m->nbody, m->ngeom, m->nsite};
    const mjtNum *const pos[] = {d->xpos, d->xipos, d->geom_xpos, d->site_xpos};
    const mjtNum *const mat[] = {d->xmat, d->ximat, d->geom_xmat, d->site_xmat};
    for (int k = 0; k < 4; k++) {
      for (int i = k < 2; i < counts[k]; i++) {
        cav_pose pose;
        cav_object_pose(m, state, kinds[k], i, &pose);
        all_near(pose.pos, pos[k] + 3 * i, 3, "world position", m->name);
        // principal axes are only known up to order and sign
        if (k != 1) all_near(pose.rotation, mat[k] + 9 * i, 9, "world rotation", m->name);
        if (k != 1) continue;
        const double *I = m->body[i].inertia, *J = p->body_inertia + 3 * i, *R = pose.rotation, *S = mat[k] + 9 * i;
        for (int a = 0; a < 3; a++) {
          for (int b = 0; b < 3; b++) {
            double x = 0, y = 0;
            for (int c = 0; c < 3; c++) {
              x += R[3 * a + c] * I[c] * R[3 * b + c];
              y += S[3 * a + c] * J[c] * S[3 * b + c];
            }
            near_slack(x, y, "world inertia", m->body[i].name);
          }
        }
      }
    }
  }
  mj_deleteData(d);
  cav_state_free(state);
}

// every pair that MuJoCo would test, found by margins so wide that all of them touch; parameters of each
static void compare_pairs(const cav_model *m, mjModel *p) {
  char *found = calloc((size_t)m->npair + 1, 1);
  p->nconmax = 20000;
  p->opt.disableflags &= ~mjDSBL_CONSTRAINT; // pairs stay listed: the options of a state can switch constraints back on
  for (int i = 0; i < p->ngeom; i++) p->geom_margin[i] = 50;
  for (int i = 0; i < p->npair; i++) p->pair_margin[i] = 50;
  mjData *d = mj_makeData(p);
  mj_kinematics(p, d);
  mj_comPos(p, d);
  mj_collision(p, d);
  for (int i = 0; i < d->ncon; i++) {
    const mjContact *c = &d->contact[i];
    int k = 0;
    while (k < m->npair && (m->pair[k].geom1 != c->geom1 || m->pair[k].geom2 != c->geom2)) k++;
    if (!check_note(k < m->npair, "pair missing", 0, m->geom[c->geom1].name)) {
      fprintf(stderr, "    %s and %s\n", m->geom[c->geom1].name, m->geom[c->geom2].name);
      continue;
    }
    const cav_pair *pair = &m->pair[k];
    const char *name = m->geom[pair->geom1].name;
    found[k] = 1;
    same(pair->dim, c->dim, "pair dim", name);
    all_near(pair->friction, c->friction, 5, "pair friction", name);
    compare_softness(&pair->softness, c->solref, c->solimp, name);
    near_slack(pair->weight[0],
               p->body_invweight0[2 * p->geom_bodyid[c->geom1]] + p->body_invweight0[2 * p->geom_bodyid[c->geom2]],
               "pair weight", name);
  }
  for (int k = 0; k < m->npair; k++) {
    if (!check_note(found[k], "pair too many", 0, m->geom[m->pair[k].geom1].name))
      fprintf(stderr, "    %s and %s\n", m->geom[m->pair[k].geom1].name, m->geom[m->pair[k].geom2].name);
  }
  printf("%-18s %3d pairs, all met by MuJoCo\n", m->name, m->npair);
  mj_deleteData(d);
  free(found);
}

static void compare_options(const cav_model *m, const mjModel *p) {
  near(m->timestep, p->opt.timestep, "timestep", m->name);
  all_near(m->gravity, p->opt.gravity, 3, "gravity", m->name);
  near(m->options.impratio, p->opt.impratio, "impratio", m->name);
  same(!m->options.constraint, !!(p->opt.disableflags & mjDSBL_CONSTRAINT), "constraint", m->name);
  same(!m->options.contact, !!(p->opt.disableflags & mjDSBL_CONTACT), "contact", m->name);
  same(!m->options.gravity, !!(p->opt.disableflags & mjDSBL_GRAVITY), "gravity flag", m->name);
  same(!m->options.passive, !!(p->opt.disableflags & mjDSBL_PASSIVE), "passive", m->name);
  same(!m->options.refsafe, !!(p->opt.disableflags & mjDSBL_REFSAFE), "refsafe", m->name);
}

static void compare(const char *path) {
  char text[1000] = "";
  cav_model *m = load(path);
  mjModel *p = mj_loadXML(path, NULL, text, sizeof text);
  if (!CHECK(p != NULL)) fprintf(stderr, "    %s\n", text);
  if (m && p) {
    CHECK(m->nq == p->nq && m->nv == p->nv && m->nu == p->nu && m->nbody == p->nbody && m->njoint == p->njnt);
    CHECK(m->ngeom == p->ngeom && m->nsite == p->nsite && m->ntendon == p->ntendon);
    all_near(m->q0, p->qpos0, m->nq, "qpos0", m->name);
    compare_options(m, p);
    compare_bodies(m, p);
    compare_joints(m, p);
    compare_geoms(m, p);
    compare_tendons(m, p);
    compare_actuators(m, p);
    compare_sensors(m, p);
    compare_keys(m, p);
    compare_frames(m, p);
    compare_pairs(m, p);
  }
  mj_deleteModel(p);
  cav_model_free(m);
}

static void test_peer(void) {
  static const char *const files[] = {
      "mujoco/humanoid.xml",    "dm_control/acrobot.xml",    "dm_control/cartpole.xml",    "dm_control/pendulum.xml",
      "dm_control/hopper.xml",  "dm_control/walker.xml",     "dm_control/cheetah.xml",     "dm_control/humanoid.xml",
      "dm_control/reacher.xml", "dm_control/point_mass.xml", "dm_control/ball_in_cup.xml", "dm_control/swimmer.xml",
      "dm_control/finger.xml",  "dm_control/fish.xml",       "mujoco/arm26.xml",           "mujoco/slider_crank.xml"};
  slack = 2e-6;
  compare(features);
  slack = rounding;
  printf("largest relative difference %.1e, where a general inertia matters %.1e\n", worst, worst_slack);
  worst_slack = 0;
  compare(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml");
  const char *folder = check_shared_models();
  if (!folder) printf("SKIPPED: the shared models are absent\n");
  for (size_t i = 0; folder && i < sizeof files / sizeof *files; i++) {
    char file[5000];
    snprintf(file, sizeof file, "%s/%s", folder, files[i]);
    compare(file);
  }
  printf("largest relative difference %.1e, in inertias and inverse weights %.1e\n", worst, worst_slack);
}
#else
static void test_peer(void) { printf("SKIPPED: built without MuJoCo\n"); }
#endif

static void test_find(void) {
  cav_model *m = load(features);
  if (!m) return;
  CHECK(cav_object_find(m, CAV_OBJECT_BODY, "world") == 0 &&
        cav_object_find(m, CAV_OBJECT_XBODY, "tip") == m->nbody - 3);
  CHECK(cav_object_find(m, CAV_OBJECT_JOINT, "j5") == 5 && cav_object_find(m, CAV_OBJECT_GEOM, "floor") == 0);
  CHECK(cav_object_find(m, CAV_OBJECT_SITE, "s1") == 1 && cav_object_find(m, CAV_OBJECT_TENDON, "t2") == 1);
  CHECK(cav_object_find(m, CAV_OBJECT_ACTUATOR, "a4") == 3 && cav_object_find(m, CAV_OBJECT_KEY, "first") == 0);
  CHECK(cav_object_find(m, CAV_OBJECT_SENSOR, "jv") == 1 && cav_object_find(m, CAV_OBJECT_JOINT, "none") == -1);
  // the name of what has none finds nothing
  CHECK(cav_object_find(m, CAV_OBJECT_KEY, "") == -1 && cav_object_find(m, CAV_OBJECT_KEY, NULL) == -1);
  CHECK(cav_object_find(m, CAV_OBJECT_TYPES, "j5") == -1);
  cav_model_free(m);
  cav_model_free(NULL);
}

static void test_names(void) {
  CHECK_TEXT(cav_status_name(CAV_OK), "ok");
  for (int s = CAV_OK; s <= CAV_INTERNAL; s++) CHECK(*cav_status_name((cav_status)s));
  CHECK_TEXT(cav_status_name((cav_status)99), "unknown status");
  CHECK(strchr(cav_version(), '.') != NULL);
}

// two files that must give the same model, to rounding, though MuJoCo 2.2.2 reads only the second
static void test_frame(void) {
  cav_model *a = load_text(
      "<mujoco><worldbody><body><frame pos='1 2 3' euler='0 0 90'><joint axis='1 0 0' pos='.1 0 0'/>"
      "<geom size='.1' pos='.2 0 0'/><frame pos='0 0 1'><body name='in' pos='1 0 0'><joint/>"
      "<geom size='.1'/></body></frame></frame></body></worldbody></mujoco>");
  cav_model *b = load_text(
      "<mujoco><worldbody><body><joint axis='0 1 0' pos='1 2.1 3'/><geom size='.1' pos='1 2.2 3'/>"
      "<body name='in' pos='1 3 4' euler='0 0 90'><joint/><geom size='.1'/></body></body></worldbody></mujoco>");
  if (a && b) {
    // bound: rounding; largest residual seen 5e-16
    CHECK_NEAR_ALL(a->joint[0].axis, b->joint[0].axis, 3, 1e-14);
    CHECK_NEAR_ALL(a->joint[0].pos, b->joint[0].pos, 3, 1e-14);
    CHECK_NEAR_ALL(a->geom[0].pos, b->geom[0].pos, 3, 1e-14);
    CHECK_NEAR_ALL(a->link[2].pos, b->link[2].pos, 3, 1e-14);
    CHECK_NEAR_ALL(a->link[2].quat, b->link[2].quat, 4, 1e-14);
  }
  cav_model_free(a);
  cav_model_free(b);
}

// bodies without joints fuse: one link whose mass properties are those of the bodies taken together
static void test_fused(void) {
  cav_model *a = load_text(
      "<mujoco><worldbody><body><joint axis='1 1 1'/><geom size='.1' pos='1 0 0'/>"
      "<body pos='0 2 0' euler='10 20 30'><geom type='box' size='.1 .2 .3'/></body></body></worldbody></mujoco>");
  cav_model *b = load_text(
      "<mujoco><worldbody><body><joint axis='1 1 1'/><geom size='.1' pos='1 0 0'/>"
      "<geom pos='0 2 0' euler='10 20 30' type='box' size='.1 .2 .3'/></body></worldbody></mujoco>");
  if (a && b) {
    CHECK(a->nlink == 2 && a->nbody == 3 && a->geom[1].link == 1);
    // bound: rounding of sums near 200; largest residual seen 6e-14
    CHECK_NEAR(a->link[1].mass, b->link[1].mass, 1e-12);
    CHECK_NEAR_ALL(a->link[1].com, b->link[1].com, 3, 1e-14);
    CHECK_NEAR_ALL(a->link[1].inertia, b->link[1].inertia, 6, 1e-11);
    CHECK_NEAR_ALL(a->geom[1].pos, b->geom[1].pos, 3, 1e-14);
    CHECK_NEAR_ALL(a->geom[1].quat, b->geom[1].quat, 4, 1e-14);
  }
  cav_model_free(a);
  cav_model_free(b);
}

// our humanoid: weight, names and order of MuJoCo's, keyframes that rest on the floor and touch nothing else
static void test_humanoid(void) {
  cav_model *m = load(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml");
  cav_state *state = m ? cav_state_new(m) : NULL;
  if (!CHECK(state != NULL)) return;
  // bound: rounding of the scaling to 65 kg; residual seen 1.4e-14
  CHECK_NEAR(m->mass, 65, 1e-12);
  CHECK(m->nv == 27 && m->nu == 21 && m->nwarning == 0);
  static const char *const keys[] = {"stand", "squat", "prone", "supine"};
  for (int i = 0; i < 4; i++) {
    int key = cav_object_find(m, CAV_OBJECT_KEY, keys[i]);
    if (!CHECK(key >= 0)) continue;
    const double *q = m->key[key].q;
    CHECK(cav_position(m, state, q) == CAV_OK);
    double deepest = 1, inner = 1, com[3], still[27] = {0};
    for (int k = 0; k < state->ncontact; k++) {
      const cav_contact *c = &state->contact[k];
      double *least = m->pair[c->pair].external ? &deepest : &inner;
      *least = fmin(*least, c->dist);
    }
    // penetration 0.5 mm by design, to the six digits that the file gives
    CHECK_NEAR(deepest, -5e-4, 2e-6);
    CHECK(inner > 0);
    for (int k = 0; k < m->njoint; k++) {
      const cav_joint *j = &m->joint[k];
      CHECK(!j->limited || (q[j->q] >= j->range[0] && q[j->q] <= j->range[1]));
    }
    if (i > 1) continue;
    // standing and squatting balance: the centre of mass is over the feet, which reach from -62 to 191 mm
    cav_pose foot;
    cav_momentum(m, state, still, com, NULL, NULL);
    cav_object_pose(m, state, CAV_OBJECT_XBODY, cav_object_find(m, CAV_OBJECT_BODY, "foot_right"), &foot);
    CHECK(com[0] - foot.pos[0] > 0.04 && com[0] - foot.pos[0] < 0.065);
    CHECK_NEAR(com[1], 0, 1e-12); // symmetric; residual seen 1e-17
  }
  cav_state_free(state);
  cav_model_free(m);
}

// one problem file serves both humanoids: bodies, joints and actuators of the same names in the same order
static void test_same_names(void) {
  char file[5000];
  const char *folder = check_shared_models();
  if (!folder) return;
  snprintf(file, sizeof file, "%s/mujoco/humanoid.xml", folder);
  cav_model *a = load(file), *b = load(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml");
  if (a && b && CHECK(a->nbody == b->nbody && a->njoint == b->njoint && a->nu == b->nu)) {
    for (int i = 0; i < a->nbody; i++) CHECK_TEXT(a->body[i].name, b->body[i].name);
    for (int i = 0; i < a->njoint; i++) CHECK_TEXT(a->joint[i].name, b->joint[i].name);
    for (int i = 0; i < a->nu; i++) CHECK_TEXT(a->actuator[i].name, b->actuator[i].name);
    for (int i = 0; i < a->nu; i++) CHECK(a->actuator[i].target == b->actuator[i].target);
  }
  cav_model_free(a);
  cav_model_free(b);
}

// principal axes give the inertia back that the file wrote
static void test_principal(void) {
  cav_model *m = load_text(
      "<mujoco><worldbody><body><joint/><inertial pos='0 0 0' mass='1' "
      "fullinertia='2 3 2.5 .4 -.3 .2'/></body></worldbody></mujoco>");
  if (m) {
    const double full[6] = {2, 3, 2.5, 0.4, -0.3, 0.2}, *I = m->body[1].inertia;
    // bound: rounding; largest residual seen 9e-16
    CHECK_NEAR_ALL(m->link[1].inertia, full, 6, 1e-14);
    CHECK(I[0] >= I[1] && I[1] >= I[2]);
  }
  cav_model_free(m);
}

int main(void) {
  test_find();
  test_principal();
  test_humanoid();
  test_same_names();
  test_names();
  test_frame();
  test_fused();
  test_peer();
  return check_result();
}
