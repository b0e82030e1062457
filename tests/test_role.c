/// Roles by structure, and postures that stand: shipped models and those that no one here wrote by a table of what is what;
/// bodies of odd shapes, whose names say nothing, turned, uneven by millimetres and by more; what a posture that stands is
/// checked by arithmetic of its own; what problem files say of names that are none.
#include <unistd.h>

#include "cavort/cavort.h"
#include "check.h"
#include "extent.h"
#include "role.h"
#include "scene.h"
#include "shipped.h"
#include "stand.h"

static char folder[] = "/tmp/cavort_role_XXXXXX";

typedef struct expectation {
  const char *model;
  int floating;
  cav_build build;
  const char *role[CAV_ROLE_TYPES]; // names of bodies; NULL: it has none
} expectation;

#define BIPED(pelvis, torso, head, rf, lf, rh, lh)                                                            \
  {                                                                                                           \
    [CAV_ROLE_PELVIS] = pelvis, [CAV_ROLE_TORSO] = torso, [CAV_ROLE_HEAD] = head, [CAV_ROLE_RIGHT_FOOT] = rf, \
    [CAV_ROLE_LEFT_FOOT] = lf, [CAV_ROLE_RIGHT_HAND] = rh, [CAV_ROLE_LEFT_HAND] = lh                          \
  }
#define QUADRUPED(trunk, fr, fl, br, bl)                                                             \
  {                                                                                                  \
    [CAV_ROLE_PELVIS] = trunk, [CAV_ROLE_TORSO] = trunk, [CAV_ROLE_FRONT_RIGHT_FOOT] = fr,           \
    [CAV_ROLE_FRONT_LEFT_FOOT] = fl, [CAV_ROLE_BACK_RIGHT_FOOT] = br, [CAV_ROLE_BACK_LEFT_FOOT] = bl \
  }

static const expectation own_models[] = {
    {"humanoid.xml", 0, CAV_BUILD_BIPED,
     BIPED("pelvis", "torso", "head", "foot_right", "foot_left", "hand_right", "hand_left")},
    {"robot.xml", 0, CAV_BUILD_BIPED,
     BIPED("pelvis", "chest", "skull", "foot_right", "foot_left", "hand_right", "hand_left")},
    {"walker.xml", 0, CAV_BUILD_BIPED, BIPED("torso", "torso", NULL, "foot_right", "foot_left", NULL, NULL)},
    {"quadruped.xml", 0, CAV_BUILD_QUADRUPED,
     QUADRUPED("trunk", "shank_front_right", "shank_front_left", "shank_back_right", "shank_back_left")},
    {"arm.xml", 0, CAV_BUILD_ARMS, {[CAV_ROLE_HAND] = "flange"}},
    {"cheetah.xml", 0, CAV_BUILD_NONE, {NULL}},
    {"hopper.xml", 0, CAV_BUILD_NONE, {NULL}},
};

static const expectation shared_models[] = {
    {"dm_control/humanoid.xml", 0, CAV_BUILD_BIPED,
     BIPED("pelvis", "torso", "head", "right_foot", "left_foot", "right_hand", "left_hand")},
    {"mujoco/humanoid.xml", 0, CAV_BUILD_BIPED,
     BIPED("pelvis", "torso", "head", "foot_right", "foot_left", "hand_right", "hand_left")},
    {"unitree/g1/scene_29dof.xml", 0, CAV_BUILD_BIPED,
     BIPED("pelvis", "torso_link", NULL, "right_ankle_roll_link", "left_ankle_roll_link", "right_wrist_yaw_link",
           "left_wrist_yaw_link")},
    {"urdf/simple_humanoid.urdf", 1, CAV_BUILD_BIPED,
     BIPED("WAIST_LINK0", "WAIST_LINK3", NULL, "RLEG_LINK6", "LLEG_LINK6", "RARM_LINK7", "LARM_LINK7")},
    {"dm_control/walker.xml", 0, CAV_BUILD_BIPED, BIPED("torso", "torso", NULL, "right_foot", "left_foot", NULL, NULL)},
    {"dm_control/quadruped.xml", 0, CAV_BUILD_QUADRUPED,
     QUADRUPED("torso", "toe_front_right", "toe_front_left", "toe_back_right", "toe_back_left")},
    {"menagerie/unitree_go1/scene.xml", 0, CAV_BUILD_QUADRUPED,
     QUADRUPED("trunk", "FR_calf", "FL_calf", "RR_calf", "RL_calf")},
    {"urdf/solo12.urdf", 1, CAV_BUILD_QUADRUPED, QUADRUPED("base_link", "FR_FOOT", "FL_FOOT", "HR_FOOT", "HL_FOOT")},
    {"menagerie/ufactory_xarm7/xarm7.xml", 0, CAV_BUILD_ARMS, {[CAV_ROLE_HAND] = "xarm_gripper_base_link"}},
    {"dm_control/manipulator.xml", 0, CAV_BUILD_ARMS, {[CAV_ROLE_HAND] = "hand"}},
    {"dm_control/cheetah.xml", 0, CAV_BUILD_NONE, {NULL}},
    {"dm_control/fish.xml", 0, CAV_BUILD_NONE, {NULL}},
};

static void check_roles(const cav_model *m, cav_state *state, const expectation *e) {
  cav_roles roles;
  if (!CHECK(cav_roles_find(m, state, &roles) == CAV_OK)) return;
  CHECK(roles.build == e->build);
  CHECK(!*roles.why == (e->build != CAV_BUILD_NONE));
  for (int r = 0; r < CAV_ROLE_TYPES; r++) {
    const char *name = roles.body[r] < 0 ? NULL : m->body[roles.body[r]].name;
    if (CHECK(!name == !e->role[r] && (!name || !strcmp(name, e->role[r])))) continue;
    fprintf(stderr, "    %s: %s is %s, not %s\n", e->model, cav_role_name((cav_role)r), name ? name : "none",
            e->role[r] ? e->role[r] : "none");
  }
}

// centre of mass of the tree of a body, by its bodies
static void centre(const cav_model *m, const cav_state *state, int root, double *com) {
  double mass = 0;
  memset(com, 0, 3 * sizeof *com);
  for (int i = 1; i < m->nbody; i++) {
    int top = i;
    while (m->body[top].parent > 0) top = m->body[top].parent;
    if (top != root) continue;
    cav_pose at;
    cav_object_pose(m, state, CAV_OBJECT_BODY, i, &at);
    mass += m->body[i].mass;
    for (int k = 0; k < 3; k++) com[k] += m->body[i].mass * at.pos[k];
  }
  for (int k = 0; k < 3; k++) com[k] /= mass;
}

// straight legs of a quadruped are lowered by their knees: soles are where they were seen from the hips, none splays or leans
static void check_under(const cav_model *m, cav_state *state, const cav_roles *roles, const double *q) {
  double way[CAV_ROLE_TYPES][2];
  cav_pose hip, foot;
  for (int pass = 0; pass < 2; pass++) {
    CHECK(cav_position(m, state, pass ? q : m->q0) == CAV_OK);
    for (int r = CAV_ROLE_FRONT_RIGHT_FOOT; r <= CAV_ROLE_BACK_LEFT_FOOT; r++) {
      if (roles->body[r] < 0) continue;
      cav_object_pose(m, state, CAV_OBJECT_XBODY, roles->limb[r], &hip);
      cav_object_pose(m, state, CAV_OBJECT_XBODY, roles->body[r], &foot);
      for (int k = 0; k < 2; k++) {
        double now = foot.pos[k] - hip.pos[k];
        if (pass) CHECK_NEAR(now, way[r][k], 0.02);
        way[r][k] = now;
      }
    }
  }
}

// from the right to the left foot of a biped
static void between(const cav_model *m, const cav_state *state, const cav_roles *roles, double way[2]) {
  cav_pose right, left;
  cav_object_pose(m, state, CAV_OBJECT_BODY, roles->body[CAV_ROLE_RIGHT_FOOT], &right);
  cav_object_pose(m, state, CAV_OBJECT_BODY, roles->body[CAV_ROLE_LEFT_FOOT], &left);
  for (int k = 0; k < 2; k++) way[k] = left.pos[k] - right.pos[k];
}

// whether links of the model are inside each other
static int is_inside(const cav_model *m, const cav_state *state) {
  int inside = 0;
  for (int i = 0; i < state->ncontact; i++)
    inside |= !m->pair[state->contact[i].pair].external && state->contact[i].dist < -1e-3;
  return inside;
}

// the posture stands: the sole's vertical is that of the model's own configuration, feet are level, the centre of mass lies
// within their box, joints lie in their ranges, links of two legs are not inside each other; a biped's feet stand no wider than
// there, side by side
static void check_stand(const cav_model *m, cav_state *state, const char *name) {
  double *q = scene_vector(m->nq), com[3], least[2] = {INFINITY, INFINITY}, most[2] = {-INFINITY, -INFINITY};
  double lowest = INFINITY, highest = -INFINITY, up[CAV_ROLE_TYPES][9];
  cav_stand stand;
  cav_roles roles;
  CHECK(cav_roles_find(m, state, &roles) == CAV_OK);
  cav_pose at;
  double own[2] = {0}, way[2] = {0};
  CHECK(cav_position(m, state, m->q0) == CAV_OK);
  const int inside = is_inside(m, state);
  if (roles.build == CAV_BUILD_BIPED) between(m, state, &roles, own);
  for (int r = 0; r < CAV_ROLE_TYPES; r++) {
    if (roles.limb[r] < 0) continue;
    cav_object_pose(m, state, CAV_OBJECT_XBODY, roles.body[r], &at);
    memcpy(up[r], at.rotation, sizeof up[r]);
  }
  if (CHECK(cav_stand_find(m, state, q, &stand) == CAV_OK)) {
    CHECK(cav_position(m, state, q) == CAV_OK);
    if (!stand.key && roles.build == CAV_BUILD_BIPED) {
      CHECK(!is_inside(m, state));
      between(m, state, &roles, way);
      // feet without a shape are points of links that nothing says how to put down
      const int shaped = m->body[roles.body[CAV_ROLE_RIGHT_FOOT]].ngeom > 0;
      for (int k = 0; k < 2 && shaped && !inside; k++) CHECK_NEAR(way[k], own[k], 0.02);
    }
    for (int r = CAV_ROLE_RIGHT_FOOT; r <= CAV_ROLE_BACK_LEFT_FOOT; r++) {
      if (roles.body[r] < 0) continue;
      cav_object_pose(m, state, CAV_OBJECT_XBODY, roles.body[r], &at);
      double upright = 0;
      for (int k = 0; k < 3; k++) upright += at.rotation[6 + k] * up[r][6 + k];
      if (roles.build == CAV_BUILD_BIPED && !stand.key) CHECK_NEAR(upright, 1, 1e-5);
      // seen 3e-6 rad; the lowest point of the foot's geoms
      double low = INFINITY;
      const cav_body *foot = &m->body[roles.body[r]];
      for (int g = foot->geom; g < foot->geom + foot->ngeom; g++) {
        cav_object_pose(m, state, CAV_OBJECT_GEOM, g, &at);
        low = fmin(low, cav_geom_bottom(m, g, &at));
        for (int k = 0; k < 2; k++) {
          const double n[3] = {k == 0, k == 1, 0}, back[3] = {-n[0], -n[1], 0};
          least[k] = fmin(least[k], at.pos[k] - cav_geom_reach(m, g, &at, back));
          most[k] = fmax(most[k], at.pos[k] + cav_geom_reach(m, g, &at, n));
        }
      }
      // blocks at the ends of four legs tilt with the shanks
      int flat = roles.build == CAV_BUILD_BIPED || m->geom[foot->geom + foot->ngeom - 1].type == CAV_GEOM_SPHERE;
      if (foot->ngeom && flat) lowest = fmin(lowest, low), highest = fmax(highest, low);
    }
    int root = roles.body[CAV_ROLE_PELVIS];
    while (m->body[root].parent > 0) root = m->body[root].parent;
    centre(m, state, root, com);
    for (int k = 0; k < 2 && most[0] > least[0]; k++) CHECK(com[k] > least[k] && com[k] < most[k]);
    // balls at the ends of shanks roll: seen 0.1 mm
    if (highest > lowest) CHECK(highest - lowest < 2e-3);
    for (int j = 0; j < m->njoint; j++) {
      const cav_joint *joint = &m->joint[j];
      if (!joint->limited || (joint->type != CAV_JOINT_HINGE && joint->type != CAV_JOINT_SLIDE)) continue;
      CHECK(q[joint->q] >= joint->range[0] && q[joint->q] <= joint->range[1]);
    }
    if (strstr(name, "solo12")) check_under(m, state, &roles, q);
    if (!stand.key) printf("%-32s stands, centre of mass %.2g m from the middle of its feet\n", name, stand.aside);
  } else {
    fprintf(stderr, "    %s: %s\n", name, stand.why);
  }
  free(q);
}

static void check_model(const char *path, const expectation *e) {
  cav_model *m = shipped_load(path, e->floating);
  if (!m) return;
  cav_state *state = cav_state_new(m);
  check_roles(m, state, e);
  if (e->build == CAV_BUILD_BIPED || e->build == CAV_BUILD_QUADRUPED) check_stand(m, state, e->model);
  cav_state_free(state);
  cav_model_free(m);
}

// ---------------------------------------------------------------- odd shapes

enum { ROOM = 16000 };

/// A body of pairs of limbs with names that say nothing: legs of three hinges and a foot that points forward, turned about
/// the vertical by degrees, the left limbs shifted along by uneven.
typedef struct oddity {
  int pairs;     // of legs
  int arms;      // pairs above
  double turned; // degrees
  double uneven; // m
  double hips;   // m, half of the way between the legs, which then go sideways, too; 0: 0.1, and they do not
} oddity;

static int add_limb(char *text, int at, const char *name, double x, double y, double z, double length, double foot,
                    const char *sideways) {
  return at + snprintf(text + at, (size_t)(ROOM - at),
                       "<body name='%s0' pos='%g %g %g'>%s<joint axis='0 1 0' range='-100 100'/>"
                       "<geom type='capsule' size='.03' fromto='0 0 0 0 0 %g'/>"
                       "<body name='%s1' pos='0 0 %g'><joint axis='0 1 0' range='-5 120'/>"
                       "<geom type='capsule' size='.03' fromto='0 0 0 0 0 %g'/>"
                       "<body name='%s2' pos='0 0 %g'>%s<joint axis='0 1 0' range='-60 60'/>"
                       "<geom type='box' pos='%g 0 -.02' size='.08 %g .01'/></body></body></body>",
                       name, x, y, z, sideways, -length, name, -length, -length, name, -length, sideways, foot,
                       *sideways ? .05 : .03);
}

static void write_odd(char *text, const oddity *o) {
  double half = o->turned * M_PI / 360;
  int at = snprintf(text, ROOM,
                    "<mujoco><compiler angle='degree' autolimits='true'/><worldbody><geom type='plane' size='1 1 1'/>"
                    "<body name='x' pos='3 -2 0.9' quat='%g 0 0 %g'><freejoint/>"
                    "<geom type='box' size='%g .08 .06' mass='10'/>",
                    cos(half), sin(half), o->pairs > 1 ? .3 : .06);
  for (int p = 0; p < o->pairs; p++) {
    char name[8];
    double x = o->pairs > 1 ? .25 - .5 * p / (o->pairs - 1) : 0;
    snprintf(name, sizeof name, "a%d", p % 10);
    double y = o->hips > 0 ? o->hips : .1;
    const char *sideways = o->hips > 0 ? "<joint axis='1 0 0' range='-40 40'/>" : "";
    at = add_limb(text, at, name, x, y, -.02, .4, .04, sideways);
    *name = 'b';
    at = add_limb(text, at, name, x + o->uneven, -y, -.02, .4, .04, sideways);
  }
  if (o->arms) {
    at += snprintf(text + at, (size_t)(ROOM - at),
                   "<body name='y' pos='0 0 .3'><joint axis='0 0 1' range='-50 50'/>"
                   "<geom type='box' size='.05 .1 .15' mass='8'/>");
    at = add_limb(text, at, "c", 0, .16, .12, .2, 0, "");
    at = add_limb(text, at, "d", 0, -.16, .12, .2, 0, "");
    at += snprintf(text + at, (size_t)(ROOM - at),
                   "<body name='e' pos='0 0 .25'><geom type='sphere' size='.08'/></body></body>");
  }
  snprintf(text + at, (size_t)(ROOM - at), "</body></worldbody></mujoco>");
}

static void check_odd(const oddity *o, const expectation *e, const char *why) {
  char *text = malloc(ROOM);
  write_odd(text, o);
  cav_model *m = scene_load(text);
  cav_state *state = m ? cav_state_new(m) : NULL;
  if (CHECK(state != NULL)) {
    check_roles(m, state, e);
    cav_roles roles;
    CHECK(cav_roles_find(m, state, &roles) == CAV_OK);
    if (why && !CHECK(strstr(roles.why, why) != NULL)) fprintf(stderr, "    '%s'\n", roles.why);
    if (e->build == CAV_BUILD_BIPED || e->build == CAV_BUILD_QUADRUPED) {
      // their own left: to the left of where the body looks
      double left[2] = {-sin(o->turned * M_PI / 180), cos(o->turned * M_PI / 180)};
      CHECK_NEAR(roles.left[0] * left[0] + roles.left[1] * left[1], 1, 1e-12);
      check_stand(m, state, e->model);
    }
  }
  cav_state_free(state);
  cav_model_free(m);
  free(text);
}

static void check_oddities(void) {
  static const expectation man = {"two legs, two arms", 0, CAV_BUILD_BIPED,
                                  BIPED("x", "y", "e", "b02", "a02", "d2", "c2")};
  static const expectation legs = {"two legs", 0, CAV_BUILD_BIPED, BIPED("x", "x", NULL, "b02", "a02", NULL, NULL)};
  static const expectation four = {"four legs", 0, CAV_BUILD_QUADRUPED, QUADRUPED("x", "b02", "a02", "b12", "a12")};
  static const expectation none = {"none", 0, CAV_BUILD_NONE, {NULL}};
  for (int turn = 0; turn < 4; turn++) check_odd(&(oddity){1, 1, 90 * turn, 0, 0}, &man, NULL);
  // feet inside each other: they stand apart
  check_odd(&(oddity){1, 1, 90, 0, 0.04}, &man, NULL);
  check_odd(&(oddity){1, 0, 0, 0, 0}, &legs, NULL);
  check_odd(&(oddity){2, 0, 0, 0, 0}, &four, NULL);
  // real robots are uneven by millimetres; what is off by more than a twentieth of its size is no image
  check_odd(&(oddity){1, 1, 0, 0.004, 0}, &man, NULL);
  check_odd(&(oddity){2, 0, 0, 0.004, 0}, &four, NULL);
  check_odd(&(oddity){1, 0, 0, 0.1, 0}, &none, "no limbs in pairs");
  check_odd(&(oddity){3, 0, 0, 0, 0}, &none, "6 limbs reach the ground");
}

// ---------------------------------------------------------------- problem files

static cav_problem *load(const char *model, const char *body, cav_error *error) {
  static const char pattern[] =
      "<problem name='p' model='%s/problems/models/%s.xml'><horizon duration='.2' timestep='.05'/>"
      "<start key='stand' height='floor'/><cost><sensor type='framepos' %s target='0 0 1' weight='1'/></cost>"
      "</problem>";
  char text[5000];
  snprintf(text, sizeof text, pattern, CAVORT_SOURCE_ROOT, model, body);
  return scene_problem(folder, text, error);
}

static void refuse(const char *model, const char *body, const char *first, const char *second) {
  cav_error error = {0};
  cav_problem *p = load(model, body, &error);
  if (!CHECK(!p && error.status == CAV_BAD_INPUT && strstr(error.text, first) && strstr(error.text, second)))
    fprintf(stderr, "    '%s'\n", error.text);
  cav_problem_free(p);
}

static void check_files(void) {
  cav_error error = {0};
  // a role stands for a body, after the model's own names, or for the ball at the end of a shank
  cav_problem *p = load("humanoid", "xbody='nothing|right hand'", &error);
  if (CHECK(p != NULL)) {
    const cav_sensor *s = &p->term[p->nterm - 1].sensor;
    CHECK(s->object_type == CAV_OBJECT_XBODY && !strcmp(p->model->body[s->object].name, "hand_right"));
  }
  cav_problem_free(p);
  p = load("quadruped", "body='back left foot'", &error);
  if (CHECK(p != NULL)) {
    const cav_sensor *s = &p->term[p->nterm - 1].sensor;
    CHECK(s->object_type == CAV_OBJECT_GEOM && !strcmp(p->model->geom[s->object].name, "foot_back_left"));
  }
  cav_problem_free(p);
  refuse("humanoid", "body='right foott'", "did you mean 'right foot'?",
         "roles found (biped): pelvis, torso, head, right foot, left foot, right hand, left hand");
  refuse("quadruped", "body='left hand'", "no body of that name, got 'left hand'",
         "roles found (quadruped): pelvis, torso, front right foot");
  refuse("hopper", "body='left foot'", "'stand', and no feet were found to stand on", "no limbs in pairs");
  // it stands on the floor, where its keyframe or what was found puts it
  p = load("robot", "body='head'", &error);
  if (CHECK(p != NULL)) {
    cav_state *state = cav_state_new(p->model);
    state->options.smoothing = 0.001;
    CHECK(cav_position(p->model, state, p->q_start) == CAV_OK && state->ncontact >= 8);
    cav_state_free(state);
  }
  cav_problem_free(p);
  scene_remove(folder);
}

int main(void) {
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  char path[SHIPPED_PATH];
  for (size_t i = 0; i < sizeof own_models / sizeof *own_models; i++)
    if (CHECK(shipped_path(own_models[i].model, 0, path))) check_model(path, &own_models[i]);
  for (size_t i = 0; i < sizeof shared_models / sizeof *shared_models; i++)
    if (shipped_path(shared_models[i].model, 1, path)) check_model(path, &shared_models[i]);
  if (!check_shared_models()) printf("the shared models are absent: roles are not tried on them\n");
  check_oddities();
  check_files();
  return check_result();
}
