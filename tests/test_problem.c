/// optim/problem*.c: defaults, what files say, postures and their heights, terms, and the way back to a file.
#include "cavort/problem.h"

#include "check.h"
#include "problem_file.h"
#include "problem_folder.h"
#include "verification.h"

static char copy_path[128], csv_path[128];

static const char turntable[] =
    "<robot name='r'><link name='base'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' "
    "iyz='0'/></inertial></link><link name='arm'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' "
    "ixz='0' iyz='0'/></inertial></link><joint name='turn' type='continuous'><parent link='base'/><child link='arm'/>"
    "</joint></robot>";

static cav_problem *load_as(const char *text, const char *model) {
  cav_error error = {0};
  write_in("problem.xml", text);
  cav_problem *problem = cav_problem_load(path, model, &error);
  CHECK(problem != NULL);
  if (!problem) fprintf(stderr, "    %s\n", error.text);
  return problem;
}

static cav_problem *load(const char *text) { return load_as(text, NULL); }

static int count(const cav_problem *p, cav_quantity quantity) {
  int n = 0;
  for (int i = 0; i < p->nterm; i++) n += p->term[i].quantity == quantity;
  return n;
}

static const cav_term *find(const cav_problem *p, const char *name) {
  for (int i = 0; i < p->nterm; i++) {
    if (!strcmp(p->term[i].name, name)) return &p->term[i];
  }
  int term_is_there = 0;
  CHECK(term_is_there);
  fprintf(stderr, "    %s\n", name);
  return NULL;
}

static void check_defaults(void) {
  cav_problem *p = load(HEAD TAIL);
  if (!p) return;
  CHECK_TEXT(p->name, "p");
  CHECK(p->duration == 1 && p->timestep == .05 && p->order == CAV_ORDER_MIDPOINT && p->close_at_rest == 1 &&
        !p->solved);
  CHECK(p->nterm == cav_problem_default_terms(NULL, 0));
  for (int i = 0; i < p->nterm; i++) {
    CHECK(p->term[i].use == CAV_USE_COST && p->term[i].weight > 0 && p->term[i].scale == 1 && p->term[i].from == 0 &&
          p->term[i].to < 0);
  }
  // no goal: the start; no guess: from start to goal without an arc
  CHECK_NEAR_ALL(p->q_goal, p->q_start, p->model->nq, 0);
  CHECK(p->q_start[3] == -.5 && p->guess == CAV_GUESS_INTERPOLATE && p->guess_height == 0);
  cav_problem given = cav_problem_default(p->model);
  CHECK(given.effort_limit == p->effort_limit && given.schedule.stages == p->schedule.stages && given.nterm == 0);
  cav_problem_free(p);
  cav_problem_free(NULL);
}

// velocities of the start, joint by joint: what floats along and about the axes of the world, into qvel's own
static void check_start_velocity(void) {
  write_in(
      "ball.xml",
      "<mujoco><worldbody><body name='ball' pos='0 0 1'><freejoint name='ball'/><geom size='.1'/></body><body pos='1 0 "
      "1'>"
      "<joint name='turn' axis='0 1 0'/><geom size='.1' pos='0 0 .3'/></body><body pos='2 0 1'><joint name='swing' "
      "type='ball'/><geom size='.1' pos='0 0 .3'/></body></worldbody></mujoco>");
  static const char head[] = "<problem model='ball.xml'><horizon duration='1'/><start%s>%s</start></problem>";
  static const char *const more[2] = {"", " qvel='9 9 9 9 9 9 7 0 0 0'"};
  static const char *const inside[2] = {
      "<root euler='0 90 0' linvel='1 2 3' angvel='0 0 5'/><joint name='turn' vel='-2'/>",
      "<root linvel='1 2 3'/><joint name='turn' degrees='90'/>"};
  static const double wanted[2][7] = {{1, 2, 3, -5, 0, 0, -2}, {1, 2, 3, 9, 9, 9, 7}};
  for (int k = 0; k < 2; k++) {
    char text[600];
    snprintf(text, sizeof text, head, more[k], inside[k]);
    cav_problem *p = load(text);
    if (!CHECK(p != NULL)) continue;
    for (int i = 0; i < 7; i++) CHECK_NEAR(p->v_start[i], wanted[k][i], 1e-14);
    cav_problem_free(p);
  }
}

// dofs="driven": a hinge that a motor moves and what hangs on it, no door, and nothing that floats
static void check_driven(void) {
  write_in("ball.xml",
           "<mujoco><worldbody><body><joint name='motor' axis='0 1 0'/><geom size='.1'/><body pos='.3 0 0'>"
           "<joint name='loose' axis='0 1 0'/><geom size='.1'/></body></body><body pos='2 0 0'><joint name='door' "
           "axis='0 0 1'/><geom size='.1' pos='.3 0 0'/></body><body pos='4 0 1'><freejoint/><geom size='.1'/></body>"
           "</worldbody><actuator><motor joint='motor'/></actuator></mujoco>");
  cav_problem *p = load(
      "<problem model='ball.xml'><horizon duration='1'/><start/><cost>"
      "<posture name='of it' dofs='driven' at='end' weight='9'/></cost></problem>");
  const cav_term *term = p ? find(p, "of it") : NULL;
  if (CHECK(term && p->model->nv == 9))
    for (int d = 0; d < 9; d++) {
      CHECK(cav_problem_selects(p->model, term, d) == (d < 2));
      CHECK(cav_verification_selects(p->model, term, d) == (d < 2));
    }
  cav_problem_free(p);
}

/// The default posture holds no wheel at an angle: an unlimited hinge through the centre of mass of what it turns. It does hold
/// other joints, and a wheel where the file says so.
static void check_wheels(void) {
  write_in(
      "cart.xml",
      "<mujoco><worldbody><body name='cart' pos='0 0 .2'><freejoint/><geom type='box' size='.2 .1 .05'/>"
      "<body name='wheel'><joint name='wheel' axis='0 1 0'/><geom type='cylinder' size='.1 .02' euler='90 0 0'/></body>"
      "<body name='crank'><joint name='crank' axis='0 1 0'/><geom type='sphere' size='.05' pos='.1 0 0'/></body>"
      "<body name='arm'><joint name='arm' axis='0 1 0' limited='true' range='-90 90'/><geom type='sphere' "
      "size='.05'/></body></body></worldbody><actuator><motor joint='arm'/></actuator></mujoco>");
  static const char *const cost[] = {"", "<cost><posture weight='.2'/></cost>"};
  for (int given = 0; given < 2; given++) {
    char text[400];
    int n = 0, wheels = 0;
    snprintf(text, sizeof text, "<problem model='cart.xml'><horizon duration='1'/><start/>%s</problem>", cost[given]);
    cav_problem *p = load(text), *back = NULL;
    if (p && CHECK(cav_problem_write(copy_path, p, NULL, NULL) == CAV_OK))
      back = cav_problem_load(copy_path, NULL, NULL);
    if (!CHECK(p && back)) return;
    CHECK(back->nterm == p->nterm);
    for (int i = 0; i < p->nterm; i++) {
      if (p->term[i].quantity != CAV_QUANTITY_CONFIGURATION) continue;
      n++;
      wheels += (p->term[i].dofs == CAV_DOFS_JOINTS || p->term[i].joint == 1);
    }
    CHECK(n == (given ? 1 : 2) && wheels == given);
    cav_problem_free(p), cav_problem_free(back);
  }
}

/// Every quantity is a cost by its element, and a constraint where the table says so and nowhere else; read, written
/// and read. One's own is none of files.
static void check_quantities(void) {
  cav_error own = {0};
  write_in("problem.xml", HEAD "<cost><user name='it' weight='2'/></cost>" TAIL);
  CHECK(!cav_problem_load(path, NULL, &own) && own.status == CAV_BAD_INPUT && strstr(own.text, "<user>"));
  for (cav_quantity k = 0; k < CAV_QUANTITY_USER; k++) {
    const cav_quantity_rule *rule = cav_quantity_rule_of(k);
    const char *what = k == CAV_QUANTITY_SENSOR  ? " type='framepos' site='eye' reftype='body' refname='trunk'"
                       : k == CAV_QUANTITY_TRACK ? " file='record.csv' joints='knee'"
                                                 : "";
    write_in("record.csv", "time,knee\n0,0\n.5,.1\n1,\n");
    char text[600];
    snprintf(text, sizeof text,
             HEAD "<cost><%s name='it' weight='2' scale='3' norm='absolute' from='.2' to='.4'%s/></cost>" TAIL,
             rule->name, what);
    cav_problem *p = load(text), *back = NULL;
    if (p && CHECK(cav_problem_write(copy_path, p, NULL, NULL) == CAV_OK))
      back = cav_problem_load(copy_path, NULL, NULL);
    for (int i = 0; p && CHECK(back != NULL) && i < 2; i++) {
      const cav_term *term = find(i ? back : p, "it");
      CHECK(term && term->quantity == k && term->weight == 2 && term->scale == 3 && term->from == .2 && term->to == .4);
      CHECK(term && term->norm == CAV_NORM_ABSOLUTE && term->use == CAV_USE_COST);
    }
    cav_problem_free(p), cav_problem_free(back);
    snprintf(text, sizeof text, HEAD "<constraint><%s name='it' lower='1'%s/></constraint>" TAIL, rule->name, what);
    write_in("problem.xml", text);
    cav_error error = {0};
    p = cav_problem_load(path, NULL, &error);
    CHECK((p != NULL) == rule->hard);
    if (p) CHECK(find(p, "it")->quantity == k && find(p, "it")->use == CAV_USE_RANGE);
    if (!p) CHECK(error.status == CAV_BAD_INPUT && strstr(error.text, rule->name));
    cav_problem_free(p);
  }
}

static void check_words(void) {
  cav_problem *p = load(
      "<problem name='&lt;q&gt;' model='leg.xml'>\n"
      "<horizon duration='2' timestep='.1' order='euler' close='open'/>\n"
      "<start qpos='1 2 3 -.1' qvel='1 2 3 4'/>\n<goal key='nothing | bent'/>\n"
      "<guess type='hold' apex='.3' bow='.2 -.1' from='.5' to='1.5'/>\n<limits effort='.5' margin='.01'/>\n"
      "<schedule stages='3'><first softness='2' time_constant='1' smoothing='.2' smoothing_self='.1' penalty='10' "
      "iterations='5' "
      "tolerance='.1'/><last iterations='7'/></schedule>\n" TAIL);
  if (!p) return;
  CHECK_TEXT(p->name, "<q>");
  CHECK(p->order == CAV_ORDER_EULER && p->close_at_rest == 0 && p->guess == CAV_GUESS_HOLD);
  CHECK(p->guess_height == .3 && p->guess_from == .5 && p->guess_to == 1.5);
  CHECK(p->guess_bow[0] == .2 && p->guess_bow[1] == -.1);
  CHECK_NEAR_ALL(p->q_start, ((double[]){1, 2, 3, -.1}), 4, 0);
  CHECK_NEAR_ALL(p->v_start, ((double[]){1, 2, 3, 4}), 4, 0);
  CHECK(p->q_goal[3] == -.5 && p->effort_limit == .5 && p->limit_margin == .01);
  const cav_stage_options *a = &p->schedule.first, *b = &p->schedule.last;
  CHECK(p->schedule.stages == 3 && a->softness == 2 && a->time_constant == 1 && a->smoothing == .2 &&
        a->smoothing_self == .1);
  CHECK(a->penalty == 10 && a->iterations == 5 && a->tolerance == .1 && b->iterations == 7);
  CHECK(b->softness == cav_problem_default(p->model).schedule.last.softness);
  cav_problem_free(p);
}

// lowest point of the model over its floor, by the collision routine: seen from afar through the smoothed law's reach
static double lowest(const cav_model *model, const double *q) {
  cav_state *state = cav_state_new(model);
  double least = INFINITY;
  if (!state) return least;
  state->options.smoothing = state->options.smoothing_self = 1;
  if (cav_position(model, state, q) == CAV_OK) {
    for (int i = 0; i < state->ncontact; i++) {
      if (model->pair[state->contact[i].pair].external) least = fmin(least, state->contact[i].dist);
    }
  }
  cav_state_free(state);
  return least;
}

static void check_postures(void) {
  // a pose of the file, joints by alternatives and in degrees, lowered to the floor along a slide that points down
  cav_problem *p = load(
      "<problem name='p' model='leg.xml'>\n<horizon duration='1' timestep='.05'/>\n"
      "<pose name='up'><joint name='knie|knee' degrees='-45'/></pose>\n"
      "<pose name='bent'><joint name='knee' pos='-.1'/></pose>\n"
      "<start key='up' height='floor'/>\n<goal key='bent'><joint name='x' pos='.7'/></goal>\n" TAIL);
  if (p) {
    CHECK_NEAR(p->q_start[3], -M_PI / 4, 1e-15);
    // exact up to rounding, seen 1e-16
    CHECK_NEAR(lowest(p->model, p->q_start), 0, 1e-12);
    // the model's own keyframe comes before the pose of that name
    CHECK(p->q_goal[3] == -.5 && p->q_goal[0] == .7 && p->q_goal[1] == 0);
    cav_problem_free(p);
  }
  // a free root on a raised floor; Euler angles in degrees; a ball joint
  char model[160];
  snprintf(model, sizeof model, "%s/flyer.xml", folder);
  p = load_as(
      "<problem name='p' model='leg.xml'>\n<horizon duration='1' timestep='.05'/>\n"
      "<start height='floor'><root pos='1 2 9' euler='30 40 50'/><joint name='shoulder' quat='2 0 2 "
      "0'/></start>\n" TAIL,
      model);
  if (!p) return;
  CHECK_TEXT(p->model->name, "flyer");
  CHECK(p->q_start[0] == 1 && p->q_start[1] == 2);
  CHECK_NEAR(p->q_start[7], sqrt(.5), 1e-15);
  // convex routine: its tolerance 1e-6, seen 2e-7
  CHECK_NEAR(lowest(p->model, p->q_start), 0, 1e-5);
  // x, then new y, then new z: the rotated z axis is Rx Ry e_z
  double w = p->q_start[3], x = p->q_start[4], y = p->q_start[5], z = p->q_start[6], a = M_PI / 6, b = 2 * M_PI / 9;
  CHECK_NEAR(2 * (x * z + w * y), sin(b), 1e-14);
  CHECK_NEAR(2 * (y * z - w * x), -sin(a) * cos(b), 1e-14);
  CHECK_NEAR(w * w + x * x + y * y + z * z, 1, 1e-15);
  cav_problem_free(p);
}

static void check_same(const cav_problem *a, const cav_problem *b);

// height='floor' leaves a box on a table, one too that lies in it by rounding, lets one fall that stands on nothing, and by rise
// counts from the plane alone
static void check_table(void) {
  static const double place[4][2] = {{.5, .9}, {3, 1.1}, {.5, 0.25}, {.5, .4999999995}};
  static const char *const rise[4] = {"", "", " rise='.15'", ""};
  static const double wanted[4] = {.5, .1, .25, .5};
  for (int i = 0; i < 4; i++) {
    char text[2000];
    snprintf(
        text, sizeof text,
        "<problem name='p' model='leg.xml'>\n<scene><geom name='table' type='box' pos='.5 0 .2' size='.4 .4 .2'/>"
        "<body name='crate' pos='0 0 5'><freejoint name='crate'/><geom type='box' size='.1 .1 .1' mass='1'/></body>"
        "</scene><horizon duration='1' timestep='.05'/>\n<start key='bent' height='floor'%s><joint name='x' pos='-3'/>"
        "<root joint='crate' pos='%g 0 %.12g'/></start>\n" TAIL,
        rise[i], place[i][0], place[i][1]);
    cav_problem *p = load(text);
    if (!p) continue;
    CHECK_NEAR(p->q_start[6], wanted[i], 1e-9); // bisection; seen 1e-12
    cav_problem_free(p);
  }
}

// one joint over time, without the rest of the posture
static void check_one_joint(void) {
  cav_problem *p = load(HEAD
                        "<cost><posture name='bend' joint='knee' weight='1'><waypoint time='0' qpos='-.1'/>"
                        "<waypoint time='1' qpos='-.9'/></posture></cost>\n" TAIL);
  if (!p) return;
  const cav_term *bend = find(p, "bend");
  CHECK(bend && bend->nwaypoint == 2 && bend->target[3] == -.1 && bend->target[7] == -.9);
  cav_problem_free(p);
}

// an angle in degrees is the one in radians, of a cost, a constraint and a waypoint; the rest is the goal's posture
static void check_degrees(void) {
  cav_problem *p = load(HEAD
                        "<goal key='bent'/><cost><posture name='soft' joint='knee' degrees='-30' weight='1'/>"
                        "<posture name='way' joint='knee' weight='1'><waypoint time='0' degrees='-6'/>"
                        "<waypoint time='1' qpos='-.9'/></posture></cost>\n"
                        "<constraint><posture name='hard' joint='pitch' degrees='90' at='end'/></constraint>\n" TAIL);
  if (!p) return;
  const cav_term *soft = find(p, "soft"), *way = find(p, "way"), *hard = find(p, "hard");
  double wanted[4];
  memcpy(wanted, p->q_goal, sizeof wanted);
  wanted[3] = -M_PI / 6;
  CHECK(soft && way && hard && way->nwaypoint == 2 && way->target[7] == -.9);
  if (soft) CHECK_NEAR_ALL(soft->target, wanted, 4, 1e-15);
  if (way) CHECK_NEAR(way->target[3], -M_PI / 30, 1e-15);
  if (hard) CHECK_NEAR(hard->target[2], M_PI / 2, 1e-15);
  cav_problem_free(p);
}

// bodies and geoms that the file puts into the model's world, after the model's own
static void check_scene(void) {
  cav_problem *p =
      load(SCENE_HEAD
           "<goal key='bent' height='floor' rise='.2'><root joint='crate' pos='3 4 5' euler='0 0 0'/></goal>\n" TAIL);
  if (!p) return;
  const cav_model *m = p->model;
  CHECK(m->nbody == 5 && m->nq == 12 && m->nv == 11 && m->nkey == 1);
  CHECK(cav_object_find(m, CAV_OBJECT_BODY, "crate") == 3 && cav_object_find(m, CAV_OBJECT_GEOM, "step") == 1);
  CHECK(m->geom[1].link == 0 && m->npair > 4);
  // the model's keyframe, and the scene where it stands; angles are degrees although the model's are radians
  double start[12] = {0, 0, 0, -.5, 1, 0, 1, sqrt(.5), 0, 0, sqrt(.5), 0};
  CHECK_NEAR_ALL(p->q_start, start, 12, 1e-15);
  CHECK_NEAR(m->joint[cav_object_find(m, CAV_OBJECT_JOINT, "door")].range[1], M_PI / 2, 1e-15);
  // what stands on the floor rises: lowest points .2 above it
  CHECK_NEAR(lowest(m, p->q_goal), .2, 1e-12);
  double crate[7] = {3, 4, .3, 1, 0, 0, 0};
  CHECK_NEAR_ALL(p->q_goal + 4, crate, 7, 1e-15);
  // a total mass is of the model's own bodies
  CHECK_NEAR(m->mass - m->body[4].mass, 7 + 2, 1e-12);

  cav_error error = {0};
  CHECK(cav_problem_write(copy_path, p, NULL, &error) == CAV_OK);
  cav_problem *q = cav_problem_load(copy_path, NULL, &error);
  CHECK(q != NULL);
  if (q) {
    CHECK_TEXT(q->scene, p->scene);
    CHECK(q->model->nq == 12 && q->model->npair == m->npair);
    CHECK_NEAR_ALL(q->model->q0, m->q0, 12, 0);
    check_same(p, q);
  } else {
    fprintf(stderr, "    %s\n", error.text);
  }
  cav_problem_free(q);
  cav_problem_free(p);

  // the same things in the world of a robot from URDF
  char robot[160];
  snprintf(robot, sizeof robot, "%s/robot.urdf", folder);
  p = load_as("<problem name='p'>\n" SCENE "<horizon duration='1' timestep='.05'/>\n<start/>\n" TAIL, robot);
  if (!p) return;
  CHECK(p->model->nbody == 5 && p->model->nq == 1 + 7 + 1 && cav_object_find(p->model, CAV_OBJECT_GEOM, "step") == 0);
  CHECK_NEAR_ALL(p->q_start + 1, start + 4, 7, 1e-15);
  cav_problem_free(p);

  // its base freed, and still so once written and read back
  p = load_as(
      "<problem name='p' model='robot.urdf' floating='true'><horizon duration='1' timestep='.05'/><start/>" TAIL, NULL);
  if (!p) return;
  CHECK(p->floating && p->model->nq == 8);
  CHECK(cav_problem_write(copy_path, p, NULL, &error) == CAV_OK);
  q = cav_problem_load(copy_path, NULL, &error);
  CHECK(q && q->floating && q->model->nq == 8);
  cav_problem_free(q);
  cav_problem_free(p);
}

static void check_trajectory_ends(void) {
  cav_problem *p = load(HEAD TAIL);
  if (!p) return;
  cav_trajectory *trajectory = cav_trajectory_new(p->model, 3, .1);
  for (int i = 0; i < 12; i++) trajectory->q[i] = -.01 * i, trajectory->v[i] = .1 * i;
  cav_error error;
  CHECK(cav_trajectory_write(csv_path, p->model, trajectory, &error) == CAV_OK);
  cav_problem *q = load(
      "<problem name='p' model='leg.xml'>\n<horizon duration='1' timestep='.05'/>\n<start file='motion.csv' "
      "knot='first'/>\n"
      "<goal file='motion.csv'/>\n" TAIL);
  if (q) {
    CHECK_NEAR_ALL(q->q_start, trajectory->q, 4, 0);
    CHECK_NEAR_ALL(q->q_goal, trajectory->q + 8, 4, 0);
    static const double rest[4] = {0};
    CHECK_NEAR_ALL(q->v_start, rest, 4, 0);
  }
  cav_problem_free(q);
  // a motion goes on where another one ended, as fast
  q = load(
      "<problem name='p' model='leg.xml'>\n<horizon duration='1' timestep='.05'/>\n<start file='motion.csv' "
      "velocity='file'/>\n" TAIL);
  if (q) CHECK_NEAR_ALL(q->q_start, trajectory->q + 8, 4, 0);
  if (q) CHECK_NEAR_ALL(q->v_start, trajectory->v + 8, 4, 0);
  cav_problem_free(q);
  cav_trajectory_free(trajectory);
  cav_problem_free(p);
}

static void check_costs(void) {
  cav_problem *p = load(HEAD
                        "<cost>\n<effort weight='3'/>\n<slip weight='0'/>\n<gap weight='5' from='.5'/>\n"
                        "<velocity name='one' joint='knee' weight='2' target='.5' at='end'/>\n"
                        "<velocity name='two' dofs='all' weight='2' target='1 2 3 4' to='.5'/>\n"
                        "<posture name='key' key='bent' weight='1' dofs='all' at='.52'/>\n"
                        "<posture name='way' weight='1' from='0' to='end'><waypoint time='0' key='bent'/><waypoint "
                        "time='.5' qpos='0 0 0 0'/></posture>\n"
                        "<sensor name='eye' weight='1' component='z' target='1.5' scale='.1' at='.5'/>\n"
                        "<sensor name='up' type='subtreecom' body='body|trunk' component='z' relative='start' "
                        "target='.3' weight='9' at='.5'/>\n"
                        "<sensor name='turn' type='framequat' xbody='trunk' relative='goal' weight='9'/>\n"
                        "<sensor name='path' type='framepos' site='eye' weight='9'><waypoint time='.1' target='1 2 3'/>"
                        "<waypoint time='.9' target='4 5 6'/></sensor>\n"
                        "</cost>\n" TAIL);
  if (!p) return;
  // one running cost takes its default's place, weight 0 removes it, a window adds
  CHECK(count(p, CAV_QUANTITY_EFFORT) == 1 && find(p, "effort")->weight == 3);
  CHECK(count(p, CAV_QUANTITY_SLIP) == 0 && count(p, CAV_QUANTITY_GAP) == 2);
  CHECK(count(p, CAV_QUANTITY_VELOCITY) == 4 && count(p, CAV_QUANTITY_IMPACT) == 1);
  const cav_term *one = find(p, "one"), *two = find(p, "two"), *key = find(p, "key"), *way = find(p, "way");
  CHECK(one && one->dofs == CAV_DOFS_ONE && one->joint == 3 && one->target[3] == .5 && one->from == 1 && one->to == 1);
  CHECK(two && two->dofs == CAV_DOFS_ALL && two->target[2] == 3 && two->from == 0 && two->to == .5);
  CHECK(key && key->target[3] == -.5 && key->from == .52 && key->to == .52 && key->nwaypoint == 0);
  CHECK(way && way->nwaypoint == 2 && way->waypoint_time[1] == .5 && way->target[3] == -.5 && way->target[7] == 0);
  const cav_term *eye = find(p, "eye"), *up = find(p, "up"), *turn = find(p, "turn"), *along = find(p, "path");
  CHECK(eye && eye->sensor.type == CAV_SENSOR_FRAMEPOS && eye->component == 2 && eye->target[2] == 1.5 &&
        eye->scale == .1);
  CHECK(up && up->sensor.object == 1 && up->sensor.adr == -1 && up->sensor.dim == 3);
  // .3 above where the centre of mass of the start is, computed apart
  cav_state *state = cav_state_new(p->model);
  double com[3];
  CHECK(cav_position(p->model, state, p->q_start) == CAV_OK);
  cav_momentum(p->model, state, p->v_start, com, NULL, NULL);
  if (up) CHECK_NEAR(up->target[2], com[2] + .3, 1e-12);
  cav_state_free(state);
  CHECK(turn && turn->component == -1);
  if (turn) CHECK_NEAR_ALL(turn->target, ((double[]){1, 0, 0, 0}), 4, 1e-15);
  CHECK(along && along->nwaypoint == 2);
  if (along) CHECK_NEAR_ALL(along->target, ((double[]){1, 2, 3, 4, 5, 6}), 6, 0);
  cav_problem_free(p);
}

// a style changes weights of defaults and adds costs; what the file says comes before it, and what is written holds all of it
static void check_styles(void) {
  cav_problem *p = load(HEAD "<cost>\n<style name='careful'/>\n<impact weight='7'/>\n</cost>\n" TAIL), *again;
  cav_error error = {0};
  if (!p) return;
  CHECK(find(p, "acceleration")->weight == 4e-4 && find(p, "root acceleration")->weight == 0.08);
  CHECK(find(p, "impact")->weight == 7 && count(p, CAV_QUANTITY_IMPACT) == 1);
  CHECK(find(p, "force") && find(p, "force")->weight == 0.3 && find(p, "effort")->weight == 1);
  CHECK(cav_problem_write(path, p, NULL, &error) == CAV_OK);
  again = cav_problem_load(path, NULL, &error);
  CHECK(again && again->nterm == p->nterm);
  for (int i = 0; again && i < p->nterm; i++) CHECK(again->term[i].weight == p->term[i].weight);
  cav_problem_free(again);
  cav_problem_free(p);
  p = load(HEAD "<cost>\n<posture weight='3'/>\n<style name='athletic'/>\n</cost>\n" TAIL);
  if (!p) return;
  CHECK(find(p, "joint velocity")->weight == 0.0125 && find(p, "posture")->weight == 3);
  CHECK(find(p, "acceleration")->weight == 1e-4 && count(p, CAV_QUANTITY_FORCE) == 0);
  cav_problem_free(p);
}

static void check_constraints(void) {
  cav_problem *p =
      load(HEAD
           "<constraint>\n<sensor name='low' type='framepos' site='eye' component='z' lower='.2' relative='start'/>\n"
           "<posture name='end' dofs='all' at='end'/>\n<velocity name='slow' joint='x' lower='-1' upper='1'/>\n"
           "</constraint>\n" TAIL);
  if (!p) return;
  const cav_term *low = find(p, "low"), *end = find(p, "end"), *slow = find(p, "slow");
  // the eye stands .1 over the trunk's frame, which is at 1
  CHECK(low && low->use == CAV_USE_RANGE && low->upper == INFINITY && low->target == NULL);
  if (low) CHECK_NEAR(low->lower, 1.1 + .2, 1e-12);
  CHECK(end && end->use == CAV_USE_EQUAL && end->from == 1 && end->target == NULL);
  CHECK(slow && slow->use == CAV_USE_RANGE && slow->lower == -1 && slow->upper == 1);
  CHECK(p->nterm == 3 + cav_problem_default_terms(NULL, 0));
  cav_problem_free(p);
}

// a tolerance of what has to hold is a band about the target, of a sensor as of a posture, and so it is read again
static void check_bands(void) {
  cav_problem *p = load(
      HEAD
      "<constraint>\n<sensor name='stays' type='framepos' site='eye' relative='start' target='0 0 0' within='.03'/>\n"
      "<sensor name='near' type='framepos' site='eye' relative='start' lower='-.01' upper='.02'/>\n"
      "<sensor name='about' type='framepos' site='eye' component='z' target='1' lower='-.01' upper='.02'/>\n"
      "<posture name='held' dofs='all' within='.1'/>\n<velocity name='slow' joint='x' within='1'/>\n"
      "<sensor name='exact' type='framepos' site='eye' relative='start' target='0 0 0'/>\n</constraint>\n" TAIL);
  for (int again = 0; p && again < 2; again++) {
    const cav_term *stays = find(p, "stays"), *near = find(p, "near"), *about = find(p, "about");
    const cav_term *held = find(p, "held"), *slow = find(p, "slow"), *exact = find(p, "exact");
    if (!CHECK(stays && near && about && held && slow && exact)) break;
    CHECK(stays->use == CAV_USE_RANGE && stays->lower == -.03 && stays->upper == .03 && stays->within == 0);
    CHECK(near->use == CAV_USE_RANGE && near->lower == -.01 && near->upper == .02);
    CHECK(stays->target && near->target && !memcmp(stays->target, near->target, 3 * sizeof(double)));
    if (stays->target) CHECK_NEAR(stays->target[2], 1.1, 1e-12);
    CHECK(about->use == CAV_USE_RANGE && about->target && about->target[2] == 1 && about->lower == -.01);
    CHECK(held->use == CAV_USE_RANGE && held->lower == -.1 && held->upper == .1);
    CHECK(slow->use == CAV_USE_RANGE && slow->lower == -1 && slow->upper == 1);
    CHECK(exact->use == CAV_USE_EQUAL);
    CHECK(cav_term_is_band(stays) && cav_term_is_band(held) && cav_term_is_band(slow));
    CHECK(!cav_term_is_band(near) && !cav_term_is_band(about) && !cav_term_is_band(exact));
    cav_error error = {0};
    if (again || !CHECK(cav_problem_write(copy_path, p, NULL, &error) == CAV_OK)) break;
    cav_problem_free(p);
    p = cav_problem_load(copy_path, NULL, &error);
    CHECK_TEXT(error.text, "");
  }
  cav_problem_free(p);
}

static void check_same_stage(const cav_stage_options *a, const cav_stage_options *b) {
  CHECK(a->softness == b->softness && a->time_constant == b->time_constant && a->smoothing == b->smoothing);
  CHECK(a->smoothing_self == b->smoothing_self && a->penalty == b->penalty && a->iterations == b->iterations &&
        a->tolerance == b->tolerance);
}

// same numbers in both
static void check_same(const cav_problem *a, const cav_problem *b) {
  int nq = a->model->nq;
  CHECK_TEXT(a->name, b->name);
  CHECK(a->duration == b->duration && a->timestep == b->timestep && a->order == b->order &&
        a->close_at_rest == b->close_at_rest);
  CHECK_NEAR_ALL(a->q_start, b->q_start, nq, 0);
  CHECK_NEAR_ALL(a->q_goal, b->q_goal, nq, 0);
  CHECK_NEAR_ALL(a->v_start, b->v_start, a->model->nv, 0);
  CHECK(a->guess == b->guess && a->guess_height == b->guess_height && a->guess_bow[0] == b->guess_bow[0] &&
        a->guess_bow[1] == b->guess_bow[1] && a->effort_limit == b->effort_limit && a->limit_margin == b->limit_margin);
  CHECK(a->schedule.stages == b->schedule.stages);
  check_same_stage(&a->schedule.first, &b->schedule.first);
  check_same_stage(&a->schedule.last, &b->schedule.last);
  CHECK(a->nterm == b->nterm);
  for (int i = 0; i < a->nterm && i < b->nterm; i++) {
    const cav_term *s = &a->term[i], *t = find(b, s->name);
    if (!t) continue;
    CHECK(s->quantity == t->quantity && s->use == t->use && s->component == t->component && s->dofs == t->dofs);
    CHECK(s->joint == t->joint && s->from == t->from && s->to == t->to && s->weight == t->weight &&
          s->scale == t->scale);
    CHECK(s->lower == t->lower && s->upper == t->upper && s->nwaypoint == t->nwaypoint && !s->target == !t->target);
    CHECK(s->sensor.type == t->sensor.type && s->sensor.object_type == t->sensor.object_type &&
          s->sensor.object == t->sensor.object);
    CHECK(s->sensor.referred == t->sensor.referred && s->sensor.reference_type == t->sensor.reference_type &&
          s->sensor.reference == t->sensor.reference && s->sensor.cutoff == t->sensor.cutoff);
    int dim = s->quantity == CAV_QUANTITY_CONFIGURATION ? nq
              : s->quantity == CAV_QUANTITY_SENSOR      ? s->sensor.dim
                                                        : a->model->nv;
    int n = s->nwaypoint ? s->nwaypoint : 1;
    if (s->target && t->target) CHECK_NEAR_ALL(s->target, t->target, n * dim, 0);
    if (s->nwaypoint && t->nwaypoint) CHECK_NEAR_ALL(s->waypoint_time, t->waypoint_time, n, 0);
  }
}

static void check_round_trip(void) {
  cav_problem *p = load(
      "<problem name='a &amp; b \"c\"' model='leg.xml'>\n<horizon duration='1' timestep='.05' order='euler' "
      "close='open'/>\n"
      "<start key='bent' height='floor' qvel='.1 .2 .3 .4'/>\n<goal qpos='.1 .2 .3 -.4'/>\n<guess apex='.3' from='.1' "
      "to='.9'/>\n"
      "<limits effort='.7' margin='.002'/>\n<schedule stages='5'><last penalty='123456'/></schedule>\n"
      "<ipopt max_iter='30' hessian_approximation='limited-memory'/>\n"
      "<cost>\n<effort weight='3'/>\n<slip weight='0'/>\n<impact name='hit' weight='7' from='.5'/>\n<velocity "
      "name='one' joint='knee' weight='2' target='.5' at='end'/>\n"
      "<acceleration name='late' weight='.1' from='.3' to='.6'/>\n"
      "<posture name='way' weight='1' from='.1' to='end'><waypoint time='0' key='bent'/><waypoint time='.5' qpos='0 0 "
      "0 0'/></posture>\n"
      "<sensor name='eye' weight='1' component='z' target='1.5' scale='.1' at='.5'/>\n"
      "<sensor name='path' type='framelinvel' geom='shin' weight='9'><waypoint time='.1' target='1 2 3'/><waypoint "
      "time='.9' target='4 5 6'/></sensor>\n"
      "<sensor name='feel' type='touch' site='eye' weight='1'/>\n<sensor name='tap' weight='2'/>\n"
      "<sensor name='pull' type='actuatorfrc' actuator='knee' weight='1' target='3'/>\n"
      "<sensor name='near' type='framepos' body='shin' reftype='site' refname='eye' weight='1'/>\n"
      "<sensor name='stop' type='jointlimitfrc' joint='knee' weight='1'/>\n"
      "</cost>\n<constraint>\n<sensor name='low' type='framepos' site='eye' component='z' lower='.2' "
      "relative='start'/>\n"
      "<sensor name='bend' type='jointpos' joint='knee' target='-.2' at='.35'/>\n<posture name='last' dofs='all' "
      "at='end'/>\n</constraint>\n" TAIL);
  if (!p) return;
  cav_error error = {0};
  // as a result folder records it, with the law of the motion
  p->solved = 1;
  p->contact.softness = 0.1 / 3;
  p->contact.stabilisation = CAV_STABILISATION_DISCRETE;
  p->contact.timestep = .05;
  p->contact.gravity = 0;
  CHECK(cav_problem_write(copy_path, p, NULL, &error) == CAV_OK);
  cav_problem *q = cav_problem_load(copy_path, NULL, &error);
  CHECK(q != NULL);
  if (q) {
    check_same(p, q);
    check_same(q, p);
    CHECK(q->solved && q->contact.softness == p->contact.softness && q->contact.timestep == .05 &&
          q->contact.gravity == 0);
    CHECK(q->contact.stabilisation == CAV_STABILISATION_DISCRETE && q->contact.passive == p->contact.passive);
    CHECK(p->nipopt == 2 && q->nipopt == 2);
    for (int i = 0; i < 2 && q->nipopt == 2; i++) {
      CHECK_TEXT(q->ipopt[i].name, i ? "max_iter" : "hessian_approximation");
      CHECK_TEXT(q->ipopt[i].value, i ? "30" : "limited-memory");
    }
  } else {
    fprintf(stderr, "    %s\n", error.text);
  }
  cav_problem_free(q);
  CHECK(cav_problem_write("/nowhere/at/all.xml", p, NULL, &error) == CAV_BAD_INPUT);
  p->model_path = NULL;
  CHECK(cav_problem_write(copy_path, p, NULL, &error) == CAV_BAD_INPUT);
  cav_problem_free(p);
}

// the motions that the project ships load on the models they were written for
static void check_motions(void) {
  static const struct {
    const char *motion, *model;
  } motion[] = {{"squat-jump", "mujoco/humanoid.xml"},
                {"squat-jump", "dm_control/humanoid.xml"},
                {"hopper-hop", "dm_control/hopper.xml"},
                {"walker-jump", "dm_control/walker.xml"},
                {"cheetah-jump", "dm_control/cheetah.xml"}};
  const char *shared = check_shared_models();
  if (!shared) {
    printf("the shared models are absent: motions are not tried on them\n");
    return;
  }
  for (int i = 0; i < 5; i++) {
    char file[5000], model[5000];
    cav_error error = {0};
    snprintf(file, sizeof file, "%s/problems/motions/%s/problem.xml", CAVORT_SOURCE_ROOT, motion[i].motion);
    snprintf(model, sizeof model, "%s/%s", shared, motion[i].model);
    cav_problem *p = cav_problem_load(file, model, &error);
    CHECK(p != NULL);
    if (!p) {
      fprintf(stderr, "    %s\n", error.text);
      continue;
    }
    // start and goal stand on the floor
    CHECK_NEAR(lowest(p->model, p->q_start), 0, 1e-9);
    CHECK_NEAR(lowest(p->model, p->q_goal), 0, 1e-9);
    cav_problem_free(p);
  }
}

int main(void) {
  begin_folder();
  snprintf(copy_path, sizeof copy_path, "%s/copy.xml", folder);
  snprintf(csv_path, sizeof csv_path, "%s/motion.csv", folder);
  write_in("robot.urdf", turntable);
  check_defaults();
  check_start_velocity();
  check_driven();
  check_wheels();
  check_words();
  check_quantities();
  check_postures();
  check_scene();
  check_table();
  check_one_joint();
  check_degrees();
  check_trajectory_ends();
  check_costs();
  check_styles();
  check_constraints();
  check_bands();
  check_round_trip();
  check_motions();
  const char *made[] = {"copy.xml", "motion.csv", "cart.xml", "robot.urdf", "record.csv", "ball.xml"};
  end_folder(made, sizeof made / sizeof *made);
  return check_result();
}
