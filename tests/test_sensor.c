/// Sensors against MuJoCo's on a model with every kind of them and on shared models, in random states with contacts and
/// limits active; and identities that need no peer: forces of actuators come back, an accelerometer is the difference
/// of a velocimeter, a scale under a standing box reads its weight. MuJoCo reads everything at (q, v, a); ours reads
/// velocities at v_next, so each state is evaluated twice: for a step from v by a, and for a step that keeps v. Under a
/// weld MuJoCo 2.2.2's torque sensors differ from ours (by up to 6 N m on this model); ours balance u, which is tested
/// instead.
#include "scene.h"

// a box of 3 kg on the floor, with a lid of half a kilogram
static const char scale_text[] =
    "<mujoco><option timestep='.002'/><worldbody><geom type='plane' size='1 1 1'/>"
    "<body name='box' pos='0 0 .1'><freejoint/><geom type='box' size='.1 .1 .1' mass='3'/>"
    "<site name='under' type='box' size='.11 .11 .02' pos='0 0 -.1'/><site name='above' type='box' size='.1 .1 .02' "
    "pos='0 0 .1'/><body name='lid' pos='0 0 .1'><geom type='box' size='.05 .05 .01' mass='.5' contype='0' "
    "conaffinity='0'/><site name='lid' euler='180 0 0'/></body></body></worldbody><sensor><touch site='under'/><touch "
    "site='above'/><force site='lid'/><accelerometer site='lid'/></sensor></mujoco>";

// two bodies on nothing but a weld, a connect, a distance and the floor
static const char tied_text[] =
    "<mujoco><worldbody><geom type='plane' size='1 1 1'/><body name='a' pos='0 0 .1'><freejoint/><geom name='ga' "
    "type='box' size='.1 .1 .12' mass='3'/><site name='a'/></body><body name='b' pos='.15 0 .1' euler='10 20 30'>"
    "<freejoint/><geom name='gb' type='box' size='.1 .1 .12' mass='2'/><site name='b'/></body></worldbody><equality>"
    "<weld body1='a' body2='b' torquescale='.3'/><connect body1='b' body2='a' anchor='.1 .1 0'/></equality><sensor>"
    "<force site='a'/><torque site='a'/><force site='b'/><torque site='b'/></sensor></mujoco>";

static void read_all(const cav_model *m, cav_state *state, double *out) {
  for (int i = 0; i < m->nsensor; i++) cav_sensor_read(m, state, &m->sensor[i], out + m->sensor[i].adr);
}

// what a forward step with no force leaves: weight on the floor, weight of the lid on the box
static void test_scale(void) {
  cav_model *m = scene_load(scale_text);
  if (!CHECK(m != NULL)) return;
  cav_state *state = cav_state_new(m);
  double q[7], v[6] = {0}, u[6] = {0}, reading[8];
  cav_configuration_reset(m, q);
  for (int i = 0; i < 2000; i++) {
    CHECK(cav_forward(m, state, q, v, u, v) == CAV_OK);
    cav_integrate(m, q, v, m->timestep, q);
  }
  read_all(m, state, reading);
  // bound: what is left of the motion after 4 s; seen 4e-10 N
  CHECK_NEAR(reading[0], 3.5 * 9.81, 1e-6);
  CHECK_NEAR(reading[1], 0, 0);
  const double lid[3] = {0, 0, -0.5 * 9.81}, up[3] = {0, 0, -9.81};
  CHECK_NEAR_ALL(reading + 2, lid, 3, 1e-6);
  CHECK_NEAR_ALL(reading + 5, up, 3, 1e-6);
  cav_state_free(state);
  cav_model_free(m);
}

// what holds a free body to the world is u: force in world axes, moment in its own
static void test_balance(void) {
  cav_model *m = scene_load(tied_text);
  if (!CHECK(m != NULL)) return;
  cav_state *state = cav_state_new(m);
  double q[14], v[12], x[12], u[12], reading[12], worst = 0, most = 0;
  for (int trial = 0; trial < 100; trial++) {
    scene_posture(m, q, x, 0.2);
    scene_normals(v, 12, 0.5);
    scene_normals(x, 12, 0.5);
    CHECK(cav_inverse(m, state, q, v, x, u) == CAV_OK);
    read_all(m, state, reading);
    for (int b = 0; b < 2; b++) {
      const double *R = state->link[1 + b].rotation, *f = u + 6 * b, *r = reading + 6 * b;
      for (int k = 0; k < 3; k++) {
        double turned = R[k] * f[0] + R[3 + k] * f[1] + R[6 + k] * f[2];
        worst = fmax(worst, fmax(fabs(r[k] - turned), fabs(r[3 + k] - f[3 + k])));
        most = fmax(most, fabs(f[k]));
      }
    }
  }
  printf("balance: %.1e of %.0f N\n", worst, most);
  // bound: rounding; seen 6e-14
  CHECK_NEAR(worst / most, 0, 1e-11);
  cav_state_free(state);
  cav_model_free(m);
}

// forces of independent actuators, through u and back
static void test_actuators(const cav_model *m) {
  cav_state *state = cav_state_new(m);
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *u = scene_vector(m->nv), *x = scene_vector(m->nv);
  double *found = scene_vector(m->nu), *residual = scene_vector(m->nv);
  scene_posture(m, q, x, 0.3);
  scene_normals(v, m->nv, 0.5);
  scene_normals(x, m->nv, 0.5);
  CHECK(cav_inverse(m, state, q, v, x, u) == CAV_OK);
  cav_actuation(m, state, u, residual, found);
  double worst = 0;
  for (int i = 0; i < m->nsensor; i++) {
    const cav_sensor *s = &m->sensor[i];
    double reading;
    if (s->type != CAV_SENSOR_ACTUATORFRC) continue;
    cav_sensor_read(m, state, s, &reading);
    worst = fmax(worst, fabs(reading - found[s->object]) / (1 + fabs(reading)));
  }
  // bound: the same arithmetic; seen 0
  CHECK_NEAR(worst, 0, 1e-14);
  // along a joint: what of u is not left over
  for (int i = 0; i < m->njoint; i++) {
    const cav_joint *joint = &m->joint[i];
    if (joint->type != CAV_JOINT_HINGE && joint->type != CAV_JOINT_SLIDE) continue;
    const cav_sensor along = {.name = "", .type = CAV_SENSOR_JOINTACTUATORFRC, .object = i, .dim = 1};
    double reading, given = u[joint->dof] - residual[joint->dof];
    cav_sensor_read(m, state, &along, &reading);
    worst = fmax(worst, fabs(reading - given) / (1 + fabs(u[joint->dof])));
  }
  // bound: rounding of a sum; seen 3e-16
  CHECK_NEAR(worst, 0, 1e-13);
  // a clock reads what it is told
  const cav_sensor clock = {.name = "", .type = CAV_SENSOR_CLOCK, .dim = 1};
  double time;
  state->time = 1.5;
  cav_sensor_read(m, state, &clock, &time);
  CHECK(time == 1.5);
  free(q), free(v), free(u), free(x), free(found), free(residual);
  cav_state_free(state);
}

// accelerometer and frame accelerations against differences of velocities along the motion, gravity taken out
static void test_accelerations(const cav_model *m) {
  cav_state *state = cav_state_new(m);
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *u = scene_vector(m->nv), *x = scene_vector(m->nv);
  double *a = scene_vector(m->nv), *moved = scene_vector(m->nq), worst = 0;
  const double e = 1e-5;
  scene_posture(m, q, x, 0.3);
  scene_normals(v, m->nv, 1);
  scene_normals(a, m->nv, 5);
  for (int i = 0; i < m->nsite; i++) {
    const cav_sensor acc = {.name = "", .type = CAV_SENSOR_FRAMELINACC, .object_type = CAV_OBJECT_SITE, .object = i};
    const cav_sensor vel = {.name = "", .type = CAV_SENSOR_FRAMELINVEL, .object_type = CAV_OBJECT_SITE, .object = i};
    double reading[3], speed[2][3];
    for (int k = 0; k < m->nv; k++) x[k] = v[k] + m->timestep * a[k];
    CHECK(cav_inverse(m, state, q, v, x, u) == CAV_OK);
    cav_sensor_read(m, state, &acc, reading);
    for (int side = 0; side < 2; side++) {
      double t = side ? e : -e;
      for (int k = 0; k < m->nv; k++) x[k] = v[k] + 0.5 * t * a[k];
      cav_integrate(m, q, x, t, moved);
      for (int k = 0; k < m->nv; k++) x[k] = v[k] + t * a[k];
      CHECK(cav_inverse(m, state, moved, x, x, u) == CAV_OK);
      cav_sensor_read(m, state, &vel, speed[side]);
    }
    for (int k = 0; k < 3; k++)
      worst = fmax(worst, fabs(reading[k] + m->gravity[k] - (speed[1][k] - speed[0][k]) / (2 * e)));
  }
  // bound: square of the step times third derivatives about 1e3, rounding 1e-16/e; seen 2e-8
  CHECK_NEAR(worst, 0, 1e-6);
  free(q), free(v), free(u), free(x), free(a), free(moved);
  cav_state_free(state);
}

#ifdef CAVORT_HAVE_MUJOCO
#include "peer.h"

enum { STATES = CHECK_CASES(1000) };

typedef struct peers {
  mjModel *theirs;
  mjData *data;
  cav_model *ours;
  cav_state *state;
  double worst[CAV_SENSOR_TYPES]; ///< largest difference over the size of the reading
  int active[CAV_SENSOR_TYPES];   ///< readings that were not 0
} peers;

static void draw(const mjModel *m, mjData *d) {
  mj_resetData(m, d);
  for (int i = 0; i < m->njnt; i++) {
    double *q = d->qpos + m->jnt_qposadr[i], *quat = m->jnt_type[i] == mjJNT_FREE ? q + 3 : q;
    const double *range = m->jnt_range + 2 * i;
    if (m->jnt_type[i] == mjJNT_FREE || m->jnt_type[i] == mjJNT_BALL) {
      if (m->jnt_type[i] == mjJNT_FREE)
        for (int k = 0; k < 3; k++) q[k] += 0.5 * scene_uniform();
      for (int k = 0; k < 4; k++) quat[k] = scene_normal();
      mju_normalize4(quat);
    } else if (m->jnt_limited[i]) {
      *q = 0.5 * (range[0] + range[1]) + 0.6 * (range[1] - range[0]) * scene_uniform();
    } else {
      *q = (m->jnt_type[i] == mjJNT_HINGE ? 3 : 0.3) * scene_uniform();
    }
  }
  for (int i = 0; i < m->nv; i++) {
    d->qvel[i] = 2 * scene_normal();
    d->qacc[i] = 20 * scene_normal();
  }
}

// readings of one stage; a quaternion may have either sign
static void compare_stage(peers *p, int acceleration) {
  for (int i = 0, k = 0; i < p->ours->nsensor; i++, k++) {
    const cav_sensor *s = &p->ours->sensor[i];
    while (p->theirs->sensor_type[k] != peer_sensor[s->type]) k++;
    int late = cav_sensor_rule_of(s->type)->stage == CAV_READS_ACCELERATION;
    if (late != acceleration || s->type == CAV_SENSOR_ACTUATORFRC) continue;
    const double *theirs = p->data->sensordata + p->theirs->sensor_adr[k];
    double ours[4], size = 0, far = 0, other = 0;
    cav_sensor_read(p->ours, p->state, s, ours);
    for (int c = 0; c < s->dim; c++) {
      size = fmax(size, fabs(theirs[c]));
      far = fmax(far, fabs(theirs[c] - ours[c]));
      other = fmax(other, fabs(theirs[c] + ours[c]));
    }
    if (s->dim == 4) far = fmin(far, other);
    p->active[s->type] += size > 0;
    p->worst[s->type] = fmax(p->worst[s->type], far / (1 + size));
  }
}

// one state; 0 if the two see different contacts, which test_peer explains
static int compare_state(peers *p, double *v_next, double *u, double *expected) {
  const mjModel *m = p->theirs;
  mjData *d = p->data;
  mj_inverse(m, d);
  peer_hold(m, d);
  for (int i = 0; i < m->nv; i++) {
    v_next[i] = d->qvel[i] + m->opt.timestep * d->qacc[i];
    double a = (v_next[i] - d->qvel[i]) / m->opt.timestep;
    expected[i] = d->qfrc_inverse[i] + m->dof_damping[i] * m->opt.timestep * a;
  }
  CHECK(cav_inverse(p->ours, p->state, d->qpos, d->qvel, v_next, u) == CAV_OK);
  if (scene_error(u, expected, m->nv) > 1e-9) return 0;
  compare_stage(p, 1);
  CHECK(cav_inverse(p->ours, p->state, d->qpos, d->qvel, d->qvel, u) == CAV_OK);
  compare_stage(p, 0);
  return 1;
}

// every reading of a model's sensors in random states; all: the model has sensors of every type
static void compare_model(const char *path, int all) {
  cav_error error = {0};
  char text[1000];
  static peers p;
  p = (peers){.ours = cav_model_load(path, &error), .theirs = mj_loadXML(path, NULL, text, sizeof text)};
  if (!CHECK(p.ours && p.theirs)) {
    fprintf(stderr, "    %s: %s %s\n", path, error.text, p.theirs ? "" : text);
    return;
  }
  p.theirs->opt.cone = mjCONE_ELLIPTIC;
  p.data = mj_makeData(p.theirs);
  p.state = cav_state_new(p.ours);
  double *v_next = scene_vector(p.ours->nv), *u = scene_vector(p.ours->nv), *expected = scene_vector(p.ours->nv);
  int same = 0;
  for (int k = 0; k < STATES; k++) {
    draw(p.theirs, p.data);
    same += compare_state(&p, v_next, u, expected);
  }
  printf("%s: %d sensors, %d of %d states with the same contacts\n", path, p.ours->nsensor, same, STATES);
  for (int i = 0; i < CAV_SENSOR_TYPES; i++) {
    const char *name = cav_sensor_rule_of((cav_sensor_type)i)->name;
    if (p.active[i]) printf("  %-15s largest difference %.1e in %d readings\n", name, p.worst[i], p.active[i]);
    // bound: rounding of forces and accelerations about 1e4, relative to 1 + the reading; seen 4e-10 (touch)
    CHECK_NEAR(p.worst[i], 0, 1e-8);
    // not everything reads 0; a clock does, at time 0
    if (all && i != CAV_SENSOR_CLOCK && i != CAV_SENSOR_ACTUATORFRC && i != CAV_SENSOR_JOINTACTUATORFRC)
      CHECK(p.active[i] > STATES / 20);
  }
  // the quadruped's ellipsoids go through MuJoCo's iterative collision, which repeats itself to 3e-4 only: seen 289
  CHECK(same > STATES / 5);
  free(v_next), free(u), free(expected);
  mj_deleteData(p.data);
  mj_deleteModel(p.theirs);
  cav_state_free(p.state);
  cav_model_free(p.ours);
}

static void compare_models(void) {
  static const char *const names[] = {
      "dm_control/humanoid.xml", "dm_control/cheetah.xml",     "dm_control/finger.xml",
      "dm_control/fish.xml",     "dm_control/hopper.xml",      "dm_control/walker.xml",
      "dm_control/swimmer.xml",  "dm_control/manipulator.xml", "dm_control/quadruped.xml"};
  compare_model(CAVORT_SOURCE_ROOT "/tests/sensors.xml", 1);
  const char *folder = check_shared_models();
  for (unsigned i = 0; folder && i < sizeof names / sizeof *names; i++) {
    char path[4200];
    snprintf(path, sizeof path, "%s/%s", folder, names[i]);
    compare_model(path, 0);
  }
}
#endif

/// What presses on a body, on what is fixed to it and on a geom: the floor on a trunk, and a crate on an arm, but not the other
/// arm, which is of its tree.
static void test_touch(void) {
  cav_model *m = scene_load(
      "<mujoco><worldbody><geom type='plane' size='2 2 .1'/><body name='trunk' pos='0 0 .0995'><freejoint/>"
      "<geom name='ball' type='sphere' size='.1'/><body name='arm' pos='0 .3 .2'><joint axis='1 0 0'/>"
      "<geom name='upper' type='sphere' size='.05' mass='1'/><body name='hand' pos='.2 0 0'>"
      "<geom name='palm' type='sphere' size='.05' mass='1'/></body></body>"
      "<body name='other' pos='0 .3 .2985'><joint axis='1 0 0'/><geom type='sphere' size='.05' mass='1'/></body></body>"
      "<body name='crate' pos='.2 .3 .3985'><freejoint/><geom type='sphere' size='.05' "
      "mass='1'/></body></worldbody></mujoco>");
  cav_state *state = m ? cav_state_new(m) : NULL;
  if (!CHECK(state != NULL)) return;
  double *zero = scene_vector(m->nv), *u = scene_vector(m->nv);
  CHECK(cav_inverse(m, state, m->q0, zero, zero, u) == CAV_OK);
  double floor = 0, crate = 0, arms = 0;
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    const int one = m->link[c->link1].root, two = m->link[c->link2].root;
    *(c->link1 == 0 || c->link2 == 0 ? &floor : one == two ? &arms : &crate) += c->impulse[0] / m->timestep;
  }
  CHECK(floor > 0 && arms > 0 && crate > 0);
  const struct {
    const char *name;
    cav_object_type type;
    double force;
  } felt[] = {{"trunk", CAV_OBJECT_BODY, floor}, {"arm", CAV_OBJECT_BODY, crate}, {"hand", CAV_OBJECT_BODY, crate},
              {"palm", CAV_OBJECT_GEOM, crate},  {"upper", CAV_OBJECT_GEOM, 0},   {"other", CAV_OBJECT_BODY, 0},
              {"crate", CAV_OBJECT_BODY, crate}, {"ball", CAV_OBJECT_GEOM, floor}};
  for (size_t i = 0; i < sizeof felt / sizeof *felt; i++) {
    double reading;
    const int object = cav_object_find(m, felt[i].type, felt[i].name);
    const cav_sensor s = {.type = CAV_SENSOR_TOUCH, .dim = 1, .object_type = felt[i].type, .object = object};
    if (!CHECK(object >= 0)) continue;
    cav_sensor_read(m, state, &s, &reading);
    CHECK_NEAR(reading, felt[i].force, 1e-12 * (1 + felt[i].force));
  }
  free(zero), free(u);
  cav_state_free(state);
  cav_model_free(m);
}

int main(void) {
  cav_error error = {0};
  cav_model *m = cav_model_load(CAVORT_SOURCE_ROOT "/tests/sensors.xml", &error);
  if (!CHECK(m != NULL)) {
    fprintf(stderr, "    %s\n", error.text);
    return check_result();
  }
  test_touch();
  test_scale();
  test_balance();
  test_actuators(m);
  test_accelerations(m);
  cav_model_free(m);
#ifdef CAVORT_HAVE_MUJOCO
  compare_models();
#endif
  return check_result();
}
