/// optim/feasibility: impossible problems, each proven so with its cause, and a twin of each just inside the limit that is
/// not refused, is solved and certified; no proof against any motion of problems/motions, nor against what simulations
/// under full effort come to.
#include <dirent.h>

#include "impossible.h"

// an arm of two links in the vertical plane, reach 1 m, on the world; each link 1 kg: held level it needs 9.81 N m
#define ARM(TORQUE, ELBOW)                                                                                            \
  "<mujoco><worldbody><body name='upper' pos='0 0 2'><joint name='shoulder' axis='0 1 0' limited='true' range='-170 " \
  "170'/><geom name='upper' type='capsule' fromto='0 0 0 .5 0 0' size='.03' mass='1'/>"                               \
  "<body name='lower' pos='.5 0 0'><joint name='elbow' axis='0 1 0' limited='true' range='" ELBOW                     \
  "'/>"                                                                                                               \
  "<geom name='lower' type='capsule' fromto='0 0 0 .5 0 0' size='.03' mass='1'/><site name='tip' pos='.5 0 0'/>"      \
  "</body></body><geom name='wall' type='box' pos='.9 0 1.5' size='.2 .5 .2'/></worldbody><actuator>"                 \
  "<motor name='shoulder' joint='shoulder' gear='" TORQUE                                                             \
  "' ctrllimited='true' ctrlrange='-1 1'/>"                                                                           \
  "<motor name='elbow' joint='elbow' gear='40' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>"

// a mass on a slide, along x without gravity's part, or upright
#define SLIDE(AXIS, MASS, FORCE)                                                                                \
  "<mujoco><worldbody><body name='block'><joint name='slide' type='slide' axis='" AXIS                          \
  "'/><geom type='box' "                                                                                        \
  "size='.1 .1 .1' mass='" MASS "'/></body></worldbody><actuator><motor name='push' joint='slide' gear='" FORCE \
  "' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>"

// a pendulum of 1 kg at 1 m with a motor of 1 N m; it hangs at 0
#define PENDULUM                                                                                           \
  "<mujoco><worldbody><body name='rod'><joint name='pivot' axis='0 1 0'/><inertial pos='0 0 -1' mass='1' " \
  "diaginertia='1e-6 1e-6 1e-6'/></body></worldbody><actuator><motor name='motor' joint='pivot' gear='1' " \
  "ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>"

// a crawler on a floor with friction: a trunk and a mass that slides in it
#define FLOOR(FRICTION) "<geom name='floor' type='plane' size='9 9 1' friction='" FRICTION " 0 0'/>"
#define CRAWLER_ON(FLOOR, FRICTION)                                                                                  \
  "<mujoco><worldbody>" FLOOR                                                                                        \
  "<body name='trunk' "                                                                                              \
  "pos='0 0 .1'><freejoint/><geom name='belly' type='box' size='.2 .2 .1' mass='4' friction='" FRICTION              \
  " 0 0'/>"                                                                                                          \
  "<body name='weight' pos='0 0 .2'><joint name='along' type='slide' axis='1 0 0' limited='true' range='-.2 .2'/>"   \
  "<geom type='sphere' size='.05' mass='2' contype='0' conaffinity='0'/></body></body></worldbody><actuator><motor " \
  "joint='along' gear='200' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>"
#define CRAWLER(FRICTION) CRAWLER_ON(FLOOR(FRICTION), FRICTION)

// a table that is lifted by a motor, with a box fixed on it
#define TABLE(MASS)                                                                                                 \
  "<mujoco><worldbody><body name='table'><joint name='lift' type='slide' axis='0 0 1' limited='true' range='0 1'/>" \
  "<geom type='box' size='.4 .4 .02' mass='5'/><body name='box' pos='0 0 .3'><geom type='box' size='.2 .2 .2' "     \
  "mass='" MASS                                                                                                     \
  "'/></body></body></worldbody><actuator><motor name='jack' joint='lift' gear='300' "                              \
  "ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>"

// a hand on a base that stands in the world
#define BASE                                                                                                           \
  "<mujoco><worldbody><body name='base' pos='0 0 1'><geom type='box' size='.1 .1 .1'/><body name='hand' pos='.2 0 0'>" \
  "<joint name='wrist' axis='0 0 1'/><geom type='sphere' size='.05'/></body></body></worldbody><actuator><motor "      \
  "joint='wrist'/></actuator></mujoco>"

// a body in the vertical plane x, z: two slides and a hinge about y
#define PLANAR                                                                                                       \
  "<mujoco><worldbody><body name='body' pos='0 0 1'><joint name='x' type='slide' axis='1 0 0'/><joint name='z' "     \
  "type='slide' axis='0 0 1'/><joint name='pitch' axis='0 1 0'/><geom type='box' size='.1 .1 .1' mass='1'/><site "   \
  "name='nose' pos='.2 .1 0'/></body></worldbody><actuator><motor joint='x' gear='30'/><motor joint='z' gear='30'/>" \
  "<motor joint='pitch' gear='5'/></actuator></mujoco>"

// a ball that slides three ways over a floor, and a cell with walls; its door closed or open
#define CELL(DOOR)                                                                                                     \
  "<mujoco><worldbody><body name='ball' pos='0 0 .1'><joint name='x' type='slide' axis='1 0 0'/><joint name='y' "      \
  "type='slide' axis='0 1 0'/><joint name='z' type='slide' axis='0 0 1'/><geom name='ball' type='sphere' size='.08'/>" \
  "</body><geom type='box' pos='.5 0 .1' size='.02 .3 .3'/><geom type='box' pos='1.1 0 .1' size='.02 .3 .3'/>"         \
  "<geom type='box' pos='.8 .3 .1' size='.3 .02 .3'/>" DOOR                                                            \
  "<geom type='box' pos='.8 0 .4' size='.3 .3 .02'/>"                                                                  \
  "<geom type='box' pos='.8 0 -.2' size='.3 .3 .02'/></worldbody><actuator><motor joint='x' gear='300'/><motor "       \
  "joint='y' gear='300'/><motor joint='z' gear='300'/></actuator></mujoco>"

// a trunk of 4 kg that a leg pushes from the ground, and the foot it takes with it: upright
#define HOPPER                                                                                                    \
  "<mujoco><worldbody><geom type='plane' size='9 9 1' friction='0 0 0'/><body name='trunk' pos='0 0 .45'><joint " \
  "name='z' type='slide' axis='0 0 1'/><inertial pos='0 0 0' mass='4' diaginertia='.1 .1 .1'/><body name='foot' " \
  "pos='0 0 -.4'><joint name='leg' type='slide' axis='0 0 -1' limited='true' range='0 .4'/><geom type='sphere' "  \
  "size='.05' mass='.1' friction='0 0 0'/></body></body></worldbody><actuator><motor joint='leg' gear='400' "     \
  "ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>"
#define RISE(HEIGHT, TIME)                                                                                        \
  "<guess apex='1.5' from='.3' to='1.3'/><cost><sensor name='apex' type='subtreecom' body='trunk' component='z' " \
  "target='" HEIGHT "' at='" TIME "' weight='900' within='.05'/></cost>"

typedef struct pair {
  const char *name, *model, *twin_model;            ///< twin_model NULL: the same
  const char *horizon, *start, *terms, *twin_terms; ///< twin_terms NULL: the same
  cav_condition condition;
  const char *cause; ///< in the text
} pair;

#define SECOND "duration='1' timestep='.05'"
#define TIP(TARGET) CONSTRAINT("<sensor name='grasp' type='framepos' site='tip' target='" TARGET "' at='.8'/>")

static const pair pairs[] = {
    {"out of reach", ARM("60", "-150 150"), NULL, SECOND, "", TIP("0 0 3.01"), TIP("0 0 2.99"), CAV_CONDITION_DISTANCE,
     "out of reach by 0.01 m"},
    {"too near for the elbow", ARM("60", "-90 90"), NULL, SECOND, "", TIP("0 0 2.69"), TIP("0 0 2.72"),
     CAV_CONDITION_DISTANCE, "too near by 0.0171 m"},
    {"too weak", ARM("9.7", "-150 150"), ARM("9.9", "-150 150"), SECOND, "",
     CONSTRAINT("<posture name='level' dofs='joints' from='.5' to='1'/>"), NULL, CAV_CONDITION_STRENGTH,
     "'shoulder' needs -9.81 N m"},
    {"too high to pump in the time", PENDULUM, NULL, "duration='3' timestep='.05' close='open'", "",
     CONSTRAINT("<posture name='up' joint='pivot' qpos='3.1416' at='3'/>"),
     CONSTRAINT("<posture name='up' joint='pivot' qpos='.4' at='3'/>"), CAV_CONDITION_ENERGY, "it takes at least"},
    {"too fast", SLIDE("1 0 0", "2", "4"), NULL, "duration='1' timestep='.01' close='open'", "",
     CONSTRAINT("<posture name='far' joint='slide' qpos='8' at='1'/>"),
     CONSTRAINT("<posture name='far' joint='slide' qpos='.99' at='1'/>"), CAV_CONDITION_ENERGY,
     "at full effort it comes"},
    {"contradicting", ARM("60", "-150 150"), NULL, SECOND, "",
     CONSTRAINT("<sensor name='high' type='framepos' site='tip' component='z' target='2.2' at='.5'/>"
                "<sensor name='low' type='framepos' site='tip' component='z' target='2' at='.5'/>"),
     CONSTRAINT("<sensor name='high' type='framepos' site='tip' component='z' target='2.2' at='.5'/>"
                "<sensor name='low' type='framepos' site='tip' component='z' target='2' at='.65'/>"),
     CAV_CONDITION_CONTRADICTION, "'high'"},
    {"inside a wall", ARM("60", "-150 150"), NULL, SECOND, "", TIP(".75 0 1.6"), TIP(".65 0 1.6"), CAV_CONDITION_SOLID,
     "inside 'wall'"},
    {"no friction", CRAWLER("0"), CRAWLER("1"), SECOND, "",
     "<cost><sensor name='forth' type='subtreecom' body='trunk' component='x' target='.065' at='end' weight='900' "
     "within='.01'/></cost>",
     NULL, CAV_CONDITION_MOMENTUM, "there is no friction"},
    {"no floor", CRAWLER_ON("", "1"), CRAWLER("1"), SECOND, "", "", NULL, CAV_CONDITION_MOMENTUM, "falls at 9.81 m/s"},
    {"a range that ends before", ARM("60", "-90 90"), NULL, SECOND, "",
     CONSTRAINT("<sensor name='bend' type='jointpos' joint='elbow' target='1.6' at='end'/>"),
     CONSTRAINT("<sensor name='bend' type='jointpos' joint='elbow' target='1.57' at='end'/>"), CAV_CONDITION_RANGE,
     "its range is -1.571 to 1.571"},
    {"a base that is fixed", BASE, NULL, SECOND, "",
     CONSTRAINT("<sensor name='go' type='framepos' body='base' target='1 0 1' at='end'/>"),
     CONSTRAINT("<sensor name='go' type='framepos' body='base' target='0 0 1' at='end'/>"), CAV_CONDITION_DISTANCE,
     "fixed to the world"},
    {"sideways in a plane", PLANAR, NULL, SECOND, "",
     CONSTRAINT("<sensor name='aside' type='framepos' site='nose' target='.3 .2 1.1' at='end'/>"),
     CONSTRAINT("<sensor name='along' type='framepos' site='nose' target='.3 .1 1.1' at='end'/>"),
     CAV_CONDITION_DISTANCE, "no joint moves it along y: it stays at 0.1, 0.1 m off"},
    {"a turn out of its plane", PLANAR, NULL, SECOND, "",
     CONSTRAINT("<sensor name='roll' type='framezaxis' site='nose' component='y' target='.5' at='end'/>"),
     CONSTRAINT("<sensor name='pitch' type='framezaxis' site='nose' component='x' target='.5' at='end'/>"),
     CAV_CONDITION_DISTANCE, "with y 0.5 off, but no joint turns it that way"},
    // 4 N on 2 kg for a second and a step, a tenth more for what bounds leave
    {"too great a speed", SLIDE("1 0 0", "2", "4"), NULL, "duration='1' timestep='.01' close='open'", "",
     CONSTRAINT("<sensor name='dash' type='jointvel' joint='slide' target='2.4' at='1'/>"),
     CONSTRAINT("<sensor name='dash' type='jointvel' joint='slide' target='1.9' at='.98'/>"), CAV_CONDITION_ENERGY,
     "too fast for the time: 2.4 m/s are asked for"},
    {"a box that is too heavy", TABLE("26"), TABLE("25"), SECOND, "<joint name='lift' pos='.5'/>",
     CONSTRAINT("<posture name='lifted' dofs='joints' qpos='.505' from='.5' to='1'/>"), NULL, CAV_CONDITION_STRENGTH,
     "'jack' at its limit"},
    {"a target that is enclosed", CELL("<geom type='box' pos='.8 -.3 .1' size='.3 .02 .3'/>"), CELL(""), SECOND, "",
     "<goal><joint name='x' pos='.8'/></goal><guess><waypoint time='.5'><joint name='x' pos='.8'/><joint name='y' "
     "pos='-.8'/></waypoint></guess>" CONSTRAINT(
         "<sensor name='in' type='framepos' geom='ball' target='.8 0 .1' at='end'/>"),
     NULL, CAV_CONDITION_SOLID, "enclose it"},
    {"too high to jump", HOPPER, NULL, "duration='1.6' timestep='.02' close='open'", "", RISE("7", ".8"),
     RISE("2", ".8"), CAV_CONDITION_ENERGY, "too high to jump"},
    {"too heavy to hold within a tolerance", TABLE("30"), TABLE("25"), "duration='3' timestep='.05'",
     "<joint name='lift' pos='.5'/>",
     "<cost><posture name='lifted' joint='lift' qpos='.51' from='.5' to='2.5' weight='900'/></cost>", NULL,
     CAV_CONDITION_STRENGTH, "'lift' needs at least 3"},
    {"too far for a limit of speed", SLIDE("1 0 0", "2", "9"), NULL, SECOND, "",
     CONSTRAINT("<velocity name='slow' joint='slide' lower='-.5' upper='.5'/>"
                "<posture name='far' joint='slide' qpos='.6' at='end'/>"),
     CONSTRAINT("<velocity name='slow' joint='slide' lower='-.5' upper='.5'/>"
                "<posture name='far' joint='slide' qpos='.4' at='end'/>"),
     CAV_CONDITION_ENERGY, "too far for its speed: limits of speed leave -0.5 to 0.5 m"},
    {"too far for the speeds of joints", ARM("60", "-150 150"), NULL, SECOND, "",
     CONSTRAINT("<velocity name='slow' dofs='joints' lower='-.5' upper='.5'/><sensor name='grasp' type='framepos' "
                "site='tip' target='.3 0 2.6' at='.8'/>"),
     CONSTRAINT("<velocity name='slow' dofs='joints' lower='-5' upper='5'/><sensor name='grasp' type='framepos' "
                "site='tip' target='.3 0 2.6' at='.8'/>"),
     CAV_CONDITION_ENERGY, "too far for its speed: 0.922 m away"},
    {"more than a range in a step", ARM("60", "-150 150"), NULL, SECOND, "",
     CONSTRAINT("<velocity name='whip' joint='elbow' target='2000' at='.5'/>"),
     CONSTRAINT("<velocity name='whip' joint='elbow' target='4' at='.5'/>"), CAV_CONDITION_RANGE,
     "in one step of 0.05 s its range of 5.24 allows 105 rad/s"},
    {"a speed beyond its limit", SLIDE("1 0 0", "2", "9"), NULL, SECOND, "",
     CONSTRAINT("<velocity name='slow' joint='slide' lower='-.5' upper='.5'/>"
                "<velocity name='dash' joint='slide' target='.6' at='.5'/>"),
     CONSTRAINT("<velocity name='slow' joint='slide' lower='-.5' upper='.5'/>"
                "<velocity name='dash' joint='slide' target='.4' at='.5'/>"),
     CAV_CONDITION_CONTRADICTION, "'slow' bounds it by 0.5 m/s"},
    {"a start that is elsewhere, seen from another body", ARM("60", "-150 150"), NULL, SECOND, "",
     "<cost><sensor name='folded' type='framepos' site='tip' reftype='xbody' refname='upper' target='.8 0 -.3' "
     "from='0' "
     "to='1' weight='900' within='.02'/></cost>",
     "<cost><sensor name='folded' type='framepos' site='tip' reftype='xbody' refname='upper' target='.8 0 -.3' "
     "from='.5' "
     "to='1' weight='900' within='.1'/></cost>",
     CAV_CONDITION_CONTRADICTION, "at the start it reads 1 0 0, 0.28 m beyond"},
    {"a start that is turned", ARM("60", "-150 150"), NULL, SECOND, "",
     "<cost><sensor name='along' type='framequat' xbody='lower' target='.9238795 0 .3826834 0' from='0' to='1' "
     "weight='900' within='.1'/></cost>",
     "<cost><sensor name='along' type='framequat' xbody='lower' target='.9238795 0 .3826834 0' at='1' weight='900' "
     "within='.1'/></cost>",
     CAV_CONDITION_CONTRADICTION, "the start is turned 0.6854 rad beyond"},
    {"a start inside a solid", ARM("60", "-150 150"), NULL, SECOND, "<joint name='shoulder' degrees='30'/>",
     TIP("0 0 2.9"), NULL, CAV_CONDITION_SOLID, "the start: geom"},
};

static cav_problem *load(const char *model, const char *horizon, const char *start, const char *terms) {
  char path[160], text[4000];
  cav_error error = {0};
  scene_write(folder, "model.xml", model);
  snprintf(text, sizeof text,
           "<problem name='p' model='model.xml'>\n<horizon %s/>\n<start>%s</start>\n<limits effort='1'/>%s</problem>\n",
           horizon, start, terms);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *p = cav_problem_load(path, NULL, &error);
  CHECK(p != NULL);
  if (!p) fprintf(stderr, "    %s\n", error.text);
  return p;
}

static void check_pair(const pair *c) {
  cav_impossibility found[4];
  cav_problem *p = load(c->model, c->horizon, c->start, c->terms);
  if (p) {
    int n = proofs(c->name, p, found, 4, 1);
    CHECK(n > 0 && found[0].condition == c->condition && strstr(found[0].what, c->cause) && *found[0].cure);
    if (n > 0 && !strstr(found[0].what, c->cause)) fprintf(stderr, "    %s: %s\n", c->name, found[0].what);
  }
  cav_problem_free(p);
  int same = !c->twin_model && !c->twin_terms; // only the start is what cannot be
  p = load(c->twin_model ? c->twin_model : c->model, c->horizon, same ? "" : c->start,
           c->twin_terms ? c->twin_terms : c->terms);
  if (p) CHECK(proofs(c->name, p, found, 4, 0) == 0);
  if (p) check_possible(c->name, p);
  cav_problem_free(p);
}

// ---------------------------------------------------------------- what is possible

// a problem file on a model; 0: does not load
static int check_file(const char *path, const char *model) {
  cav_error error = {0};
  cav_impossibility found[1];
  cav_problem *p = cav_problem_load(path, model, &error);
  if (p) CHECK(proofs(path, p, found, 1, 0) == 0);
  cav_problem_free(p);
  return p != NULL;
}

static void check_motions(void) {
  static const char *const models[] = {"mujoco/humanoid.xml",   "dm_control/humanoid.xml", "dm_control/hopper.xml",
                                       "dm_control/walker.xml", "dm_control/cheetah.xml",  "dm_control/quadruped.xml"};
  const char *shared = check_shared_models();
  DIR *all = opendir(CAVORT_SOURCE_ROOT "/problems/motions");
  int n = 0, others = 0;
  CHECK(all != NULL);
  for (struct dirent *entry; all && (entry = readdir(all));) {
    char path[600], model[5000];
    snprintf(path, sizeof path, "%s/problems/motions/%.200s/problem.xml", CAVORT_SOURCE_ROOT, entry->d_name);
    if (entry->d_name[0] == '.' || access(path, R_OK)) continue;
    n += check_file(path, NULL);
    for (size_t i = 0; shared && i < sizeof models / sizeof *models; i += (size_t)check_every(3)) {
      snprintf(model, sizeof model, "%s/%s", shared, models[i]);
      others += check_file(path, model);
    }
  }
  if (all) closedir(all);
  n += check_file(CAVORT_SOURCE_ROOT "/tests/sliding/bowl.xml", NULL);
  n += check_file(CAVORT_SOURCE_ROOT "/tests/sliding/push.xml", NULL);
  CHECK(n >= 17);
  CHECK(!shared || others >= 30 / check_every(3));
  printf("%d problems on their models, %d on others\n", n, others);
}

// ---------------------------------------------------------------- what has happened is possible

enum { STEPS = 60, ROLLOUTS = 12 };

// full effort of every actuator, this way or that, changed now and then; the knots reached [STEPS*nq], the last in q
static int simulate(const cav_model *m, cav_state *state, int rollout, double *q, double *v) {
  double *u = scene_vector(4 * m->nv + m->nu), *next = u + m->nv, *moment = next + m->nv, *effort = moment + m->nv;
  int ok = u != NULL;
  for (int t = 0; t < STEPS && ok; t++) {
    memset(u, 0, sizeof(double) * (size_t)m->nv);
    ok = cav_position(m, state, q) == CAV_OK;
    for (int i = 0; i < m->nu && ok; i++) {
      double range[2];
      // rollouts start with a constant push, which is what goes farthest
      if (t % 15 == 0 && (t == 0 || rollout > 3))
        effort[i] = rollout == 0 ? 1 : rollout == 1 ? -1 : scene_uniform() > 0 ? 1 : -1;
      cav_actuator_effort_range(m, i, range);
      double force = effort[i] > 0 ? range[1] : range[0];
      if (!isfinite(force)) force = 0;
      cav_actuator_length(m, state, i, moment);
      for (int d = 0; d < m->nv; d++) u[d] += force * m->actuator[i].unit * moment[d];
    }
    ok = ok && cav_forward(m, state, q, v, u, next) == CAV_OK;
    if (!ok) break;
    memcpy(v, next, sizeof(double) * (size_t)m->nv);
    cav_integrate(m, q, v, state->options.timestep, q);
  }
  free(u);
  return ok;
}

static int strict; // rollouts that end within all ranges

static int is_inside(const cav_model *m, const double *q) {
  int inside = 1;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    if (joint->limited && joint->type >= CAV_JOINT_SLIDE)
      inside &= q[joint->q] >= joint->range[0] - 1e-6 && q[joint->q] <= joint->range[1] + 1e-6;
  }
  return inside;
}

// a problem that asks for what a simulation came to, at its end
static void check_reached(const char *name, const cav_model *m, const double *q0, const double *v0, const double *q) {
  enum { TERMS = 40 };
  cav_term term[TERMS];
  double target[TERMS][3];
  cav_impossibility found[8];
  cav_error error = {0};
  cav_state *state = cav_state_new(m);
  double *ends = scene_vector(2 * m->nq + m->nv);
  cav_problem p = cav_problem_default(m);
  int n = 0, proofs = -1;
  p.timestep = m->timestep, p.duration = STEPS * m->timestep, p.close_at_rest = 0;
  p.q_start = ends, p.v_start = ends + m->nq, p.q_goal = p.v_start + m->nv;
  memcpy(p.q_start, q0, sizeof(double) * (size_t)m->nq);
  memcpy(p.v_start, v0, sizeof(double) * (size_t)m->nv);
  memcpy(p.q_goal, q, sizeof(double) * (size_t)m->nq);
  CHECK(cav_position(m, state, q) == CAV_OK);
  const cav_term any = {
      .name = "", .use = CAV_USE_EQUAL, .component = -1, .from = p.duration, .to = p.duration, .scale = 1};
  term[n] = any;
  term[n].quantity = CAV_QUANTITY_CONFIGURATION;
  n++;
  for (int b = 1; b < m->nbody && n + 2 < TERMS; b++) {
    for (int kind = 0; kind < 2; kind++, n++) {
      cav_sensor s = {.name = "", .object_type = CAV_OBJECT_BODY, .object = b, .dim = 3};
      s.type = kind ? CAV_SENSOR_SUBTREECOM : CAV_SENSOR_FRAMEPOS;
      cav_sensor_read(m, state, &s, target[n]);
      term[n] = any;
      term[n].sensor = s;
      term[n].target = target[n];
    }
  }
  p.term = term, p.nterm = n;
  CHECK(cav_problem_impossible(&p, found, 8, &proofs, &error) == CAV_OK && proofs >= 0);
  // a simulation may start or end deep in a solid; what its soft limits let pass is no posture within the ranges
  int inside = is_inside(m, q);
  strict += inside;
  for (int i = 0; i < proofs; i++) {
    cav_condition c = found[i].condition;
    int lengths = c == CAV_CONDITION_RANGE || c == CAV_CONDITION_DISTANCE || c == CAV_CONDITION_MOMENTUM;
    int excused = c == CAV_CONDITION_SOLID || (lengths && !inside);
    CHECK(excused);
    if (!excused) fprintf(stderr, "    %s: %s\n", name, found[i].what);
  }
  cav_state_free(state);
  free(ends);
}

static void check_simulated(const char *name, const cav_model *m) {
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *v0 = scene_vector(m->nv);
  cav_state *state = cav_state_new(m);
  int done = 0;
  for (int i = 0; i < ROLLOUTS; i++) {
    if (i % 2) scene_normals(v0, m->nv, 0.3);
    memcpy(q, m->q0, sizeof(double) * (size_t)m->nq);
    memcpy(v, v0, sizeof(double) * (size_t)m->nv);
    if (!simulate(m, state, i, q, v)) continue;
    check_reached(name, m, m->q0, v0, q);
    done++;
  }
  CHECK(done > 0);
  cav_state_free(state);
  free(q), free(v), free(v0);
}

static void check_histories(void) {
  static const char *const own[] = {
      SLIDE("1 0 0", "2", "4"), SLIDE("0 0 1", "2", "40"), PENDULUM, CRAWLER("0"), CRAWLER("1"), TABLE("26"),
      ARM("60", "-150 150"),    ARM("5", "-90 90")};
  static const char *const others[] = {
      "mujoco/humanoid.xml",     "dm_control/hopper.xml",  "dm_control/walker.xml",
      "dm_control/cheetah.xml",  "dm_control/acrobot.xml", "dm_control/cartpole.xml",
      "dm_control/pendulum.xml", "dm_control/reacher.xml", "dm_control/point_mass.xml"};
  const char *shared = check_shared_models();
  for (size_t i = 0; i < sizeof own / sizeof *own; i++) {
    cav_model *m = scene_load(own[i]);
    CHECK(m != NULL);
    if (m) check_simulated("own", m);
    cav_model_free(m);
  }
  for (size_t i = 0; shared && i < sizeof others / sizeof *others; i++) {
    char path[5000];
    snprintf(path, sizeof path, "%s/%s", shared, others[i]);
    cav_model *m = cav_model_load(path, NULL);
    if (m) check_simulated(others[i], m);
    cav_model_free(m);
  }
  CHECK(strict >= 30);
  printf("%d rollouts within their ranges\n", strict);
}

// a hinge without gravity goes d rad to a speed of w, that of one step of its torque a, in (2 v - w)/a with v² = a d + w²/2:
// the proof by extremals holds up to a step less, no longer
static void check_shortest(void) {
  double h = 0.02, a = 1 / 1.000001, way = 2, w = h * a, v = sqrt(a * way + w * w / 2), time = (2 * v - w) / a - h;
  for (int longer = 0; longer < 2; longer++) {
    char horizon[80];
    // a hundredth of a second and a part of a step are left
    int steps = (int)(time / h) + (longer ? 1 : -1), n = 0;
    snprintf(horizon, sizeof horizon, "duration='%.17g' timestep='%.17g'", h * steps, h);
    cav_problem *p = load(
        "<mujoco><option gravity='0 0 0'/><worldbody><body name='rod'><joint name='pivot' axis='0 1 0'/><inertial "
        "pos='0 0 -1' mass='1' diaginertia='1e-6 1e-6 1e-6'/></body></worldbody><actuator><motor name='motor' "
        "joint='pivot' gear='1' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>",
        horizon, "", CONSTRAINT("<posture name='there' joint='pivot' qpos='2' at='end'/>"));
    if (!p) return;
    cav_impossibility found;
    CHECK(cav_problem_impossible(p, &found, 1, &n, NULL) == CAV_OK);
    CHECK(n == !longer);
    if (n) printf("%s\n", found.what);
    cav_problem_free(p);
  }
}

// the problem is proven impossible at a value, and not at the other
static void check_threshold(const char *name, const char *model, const char *horizon, const char *start,
                            const char *terms, int wanted) {
  cav_impossibility found[4];
  cav_problem *p = load(model, horizon, start, terms);
  if (p) CHECK((proofs(name, p, found, 4, wanted) > 0) == wanted);
  cav_problem_free(p);
}

// 1.25 F s = m g H: H above the highest that the centre of mass can be at a take-off, a foot's radius and the leg's length
// above the ground. And a time that is too short to get there: m v²/2 with v = H/t + g t/2
static void check_takeoff(void) {
  double g = 9.81, mass = 4.1, work = 1.25 * 400 * .4, top = .05 + 4 / 4.1 * .8, high = work / (mass * g), t = .4;
  double v = sqrt(2 * work / mass), soon = (v - g * t / 2) * t;
  for (int beyond = 0; beyond < 2; beyond++) {
    char terms[600];
    for (int hasty = 0; hasty < 2; hasty++) {
      // a step is allowed more than is asked; bounds are told apart to a hundredth
      double z = top + (hasty ? soon : high) * (beyond ? 1.01 : 0.99) + 0.05;
      snprintf(terms, sizeof terms,
               CONSTRAINT("<sensor name='apex' type='subtreecom' body='trunk' component='z' lower='%.6f' at='%g'/>"),
               z - 0.05, hasty ? t - .002 : 2.);
      check_threshold(
          hasty ? "takeoff in a hurry" : "takeoff", HOPPER,
          hasty ? "duration='.398' timestep='.002' close='open'" : "duration='2' timestep='.01' close='open'", "",
          terms, beyond);
    }
  }
}

// mu g T²/2 from rest, a half of that to rest: friction alone, but for the little that the weight can be thrown up, and
// with a force of 0.005 g root mean square that certificates leave unexplained, along and (times mu) upwards
static void check_travel(void) {
  double mu = 0.1, way = (mu / 2 + (1 + mu) * 0.005 / sqrt(3)) * 9.81 * 10 * 10;
  for (int rest = 0; rest < 2; rest++) {
    for (int beyond = 0; beyond < 2; beyond++) {
      char terms[300];
      snprintf(terms, sizeof terms,
               CONSTRAINT("<sensor name='there' type='subtreecom' body='trunk' component='x' lower='%.6f' at='end'/>"),
               way / (rest ? 2 : 1) * (beyond ? 1.05 : 0.99));
      check_threshold(rest ? "travel to rest" : "travel", CRAWLER("0.1"),
                      rest ? "duration='10' timestep='.05'" : "duration='10' timestep='.05' close='open'", "", terms,
                      beyond);
    }
  }
}

// M (g - 16 w/T²) - 16 a w/T² = 1.02 F: a window of T within w of a slide, with an armature a
static void check_held(void) {
  for (int geared = 0; geared < 2; geared++) {
    double left = 16 * 0.03 / (2 * 2), armature = geared ? 40 : 0;
    double mass = (1.02 * 300 + armature * left) / (9.81 - left) - 5;
    for (int beyond = 0; beyond < 2; beyond++) {
      char model[2000];
      snprintf(model, sizeof model,
               "<mujoco><worldbody><body name='table'><joint name='lift' type='slide' axis='0 0 1' armature='%g'/>"
               "<geom type='box' size='.4 .4 .02' mass='5'/><body name='box' pos='0 0 .3'><geom type='box' "
               "size='.2 .2 .2' mass='%.6f'/></body></body></worldbody><actuator><motor joint='lift' gear='300' "
               "ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>",
               armature, mass * (beyond ? 1.001 : 0.999));
      check_threshold("held", model, "duration='3' timestep='.05'", "<joint name='lift' pos='.5'/>",
                      "<cost><posture joint='lift' qpos='.5' from='.5' to='2.5' weight='900'/></cost>", beyond);
    }
  }
}

// a rod with damping d that is pumped by a torque F: I v' = 1.1 (F - d v) up to the speed of the largest power, F/2d,
// from there on 1.1 F²/4d of power. The horizon from which on there is no proof is that time, less a step
static void check_damped(void) {
  double inertia = 1 + 1e-6, d = 0.1, energy = 2 * 9.81, most = 1 / (4 * d), below = inertia / (8 * d * d);
  double time = inertia / d * log(2) / 1.1 + (energy - below) / (1.1 * most);
  for (int longer = 0; longer < 2; longer++) {
    char horizon[80], up[120];
    double duration = time - 0.05 + (longer ? 0.05 : -0.1);
    int steps = (int)lround(duration / 0.05), n = 0;
    snprintf(horizon, sizeof horizon, "duration='%.17g' timestep='.05' close='open'", 0.05 * steps);
    snprintf(up, sizeof up, CONSTRAINT("<posture name='up' joint='pivot' qpos='3.14159' at='end'/>"));
    cav_problem *p = load(
        "<mujoco><worldbody><body name='rod'><joint name='pivot' axis='0 1 0' damping='.1' "
        "limited='true' range='-999 999'/><inertial pos='0 0 -1' mass='1' diaginertia='1e-6 1e-6 "
        "1e-6'/></body></worldbody><actuator><motor name='motor' joint='pivot' "
        "gear='1' "
        "ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>",
        horizon, "", up);
    if (!p) return;
    cav_impossibility found;
    CHECK(cav_problem_impossible(p, &found, 1, &n, NULL) == CAV_OK);
    CHECK(n == !longer);
    if (n) printf("%s\n", found.what);
    cav_problem_free(p);
  }
}

// the same of what slides move: a geom on one of them, and on two that are askew, the centre of mass of both
static void check_slid(void) {
  static const char *const model =
      "<mujoco><worldbody><body name='car'><joint name='x' type='slide' axis='1 0 0'/><geom size='.1' mass='3'/><body "
      "name='load' pos='0 0 .5'><joint name='y' type='slide' axis='0 1 0'/><geom name='load' size='.1' mass='1' "
      "contype='0' conaffinity='0'/></body></body></worldbody><actuator><motor joint='x' gear='-40' ctrllimited='true' "
      "ctrlrange='-1 1'/><motor joint='y' gear='8' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";
  static const struct {
    const char *name, *what, *axis;
    double force_over_mass;
  } wish[] = {{"a geom on two slides, along the first", "type='framepos' geom='load'", "x", 10},
              {"a geom on two slides, along the second", "type='framepos' geom='load'", "y", 8},
              {"a centre of mass on a slide", "type='subtreecom' body='car'", "x", 10},
              {"a centre of mass of which one slides", "type='subtreecom' body='car'", "y", 2}};
  const double h = 0.01, time = 1 + h;
  for (size_t k = 0; k < 2 * sizeof wish / sizeof *wish; k++) {
    const double way = (k & 1 ? -1 : 1) * wish[k / 2].force_over_mass * time * time / 4;
    for (int beyond = 0; beyond < 2; beyond++) {
      char terms[400];
      snprintf(terms, sizeof terms,
               CONSTRAINT("<sensor name='far' %s component='%s' relative='start' target='%.9f' at='end'/>"),
               wish[k / 2].what, wish[k / 2].axis, way * (beyond ? 1.001 : 0.97));
      check_threshold(wish[k / 2].name, model, "duration='1' timestep='.01'", "", terms, beyond);
    }
  }
}

// F T²/2m to an open end, a half of that to rest, by a hard speed or by the way it closes; T a step longer. Against gravity
// (F/m - g) T²/2
static void check_slides(void) {
  static const char *const body =
      "<mujoco><worldbody><body><joint name='x' type='slide' axis='%s'/><geom size='.1' mass='1'/>"
      "</body></worldbody><actuator><motor joint='x' gear='%g' ctrllimited='true' "
      "ctrlrange='-1 1'/></actuator></mujoco>";
  static const char *const stop = "<velocity dofs='all' at='end'/>";
  const double h = 0.01, time = 1 + h;
  for (int k = 0; k < 4; k++) {
    const double way = (k == 3 ? 20 - 9.81 : 10) * time * time / (k == 1 || k == 2 ? 4 : 2);
    for (int beyond = 0; beyond < 2; beyond++) {
      char model[500], terms[600];
      snprintf(model, sizeof model, body, k == 3 ? "0 0 1" : "1 0 0", k == 3 ? 20. : 10.);
      snprintf(terms, sizeof terms, CONSTRAINT("<posture name='far' joint='x' qpos='%.9f' at='end'/>%s"),
               way * (beyond ? 1.001 : 0.97), k == 2 ? stop : "");
      static const char *const name[] = {"slide", "slide to rest", "slide to a hard rest", "slide up"};
      check_threshold(name[k], model,
                      k == 1 ? "duration='1' timestep='.01'" : "duration='1' timestep='.01' close='open'", "", terms,
                      beyond);
    }
  }
}

int main(void) {
  if (!mkdtemp(folder)) return EXIT_FAILURE;
  for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++) check_pair(&pairs[i]);
  check_motions();
  check_damped();
  check_shortest();
  check_takeoff();
  check_travel();
  check_held();
  check_slides();
  check_slid();
  check_histories();
  scene_remove(folder);
  return check_result();
}
