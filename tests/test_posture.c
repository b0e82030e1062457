/// Postures by name: humanoids and quadrupeds, most by others, kneel, sit and lie as the words say, by arithmetic of its own:
/// what is upright, what is low, what is on the ground and over what the centre of mass is. Names in problem files.
#include "cavort/cavort.h"
#include "check.h"
#include "extent.h"
#include "math3.h"
#include "posture.h"
#include "role.h"
#include "scene.h"
#include "shipped.h"

/// What a posture shows.
typedef struct sight {
  double up, front, left; // height of the torso's long axis, of its front and its left, of unit vectors
  double torso, knee, hands, foot[2], deep; // lowest points, m; deep: links inside each other
  double least, com[2], from[2], to[2];     // the box of all that is within 1 cm of the ground
} sight;

static double lowest(const cav_model *m, const cav_state *state, int body) {
  double least = INFINITY;
  cav_pose at;
  for (int g = m->body[body].geom; g < m->body[body].geom + m->body[body].ngeom; g++) {
    if (!m->geom[g].contype && !m->geom[g].conaffinity) continue;
    cav_object_pose(m, state, CAV_OBJECT_GEOM, g, &at);
    least = fmin(least, cav_geom_bottom(m, g, &at));
  }
  return least;
}

// the lowest point of a limb, with its end or without
static double limb_low(const cav_model *m, const cav_state *state, const cav_roles *roles, cav_role role, int whole) {
  double least = INFINITY;
  for (int i = roles->body[role]; i > 0; i = m->body[i].parent) {
    if (whole || i != roles->body[role]) least = fmin(least, lowest(m, state, i));
    if (i == roles->limb[role]) break;
  }
  return least;
}

// height of a vector that is v in the world at the model's own configuration and turns with the torso
static double turned(const cav_pose *own, const cav_pose *now, const double v[3]) {
  double z = 0;
  for (int k = 0; k < 3; k++) {
    double inside = own->rotation[k] * v[0] + own->rotation[3 + k] * v[1] + own->rotation[6 + k] * v[2];
    z += now->rotation[6 + k] * inside;
  }
  return z;
}

static void look(const cav_model *m, cav_state *state, const cav_roles *roles, const double *q, sight *s) {
  int torso = roles->body[CAV_ROLE_TORSO], root = torso;
  const double *l = roles->left, front[3] = {l[1], -l[0], 0}, left[3] = {l[0], l[1], 0};
  cav_pose own, now, at;
  CHECK(cav_position(m, state, m->q0) == CAV_OK);
  cav_object_pose(m, state, CAV_OBJECT_XBODY, torso, &own);
  CHECK(cav_position(m, state, q) == CAV_OK);
  cav_object_pose(m, state, CAV_OBJECT_XBODY, torso, &now);
  *s = (sight){.up = turned(&own, &now, (double[]){0, 0, 1}),
               .front = turned(&own, &now, front),
               .left = turned(&own, &now, left),
               .torso = lowest(m, state, torso),
               .least = INFINITY,
               .from = {INFINITY, INFINITY},
               .to = {-INFINITY, -INFINITY}};
  for (int i = 0; i < state->ncontact; i++)
    if (!m->pair[state->contact[i].pair].external) s->deep = fmax(s->deep, -state->contact[i].dist);
  while (m->body[root].parent > 0) root = m->body[root].parent;
  for (int g = 0; g < m->ngeom; g++) {
    int top = m->geom[g].body;
    while (m->body[top].parent > 0) top = m->body[top].parent;
    if (top != root || (!m->geom[g].contype && !m->geom[g].conaffinity)) continue;
    cav_object_pose(m, state, CAV_OBJECT_GEOM, g, &at);
    double low = cav_geom_bottom(m, g, &at);
    s->least = fmin(s->least, low);
    for (int k = 0; k < 2 && low < 0.01; k++) {
      const double n[3] = {k == 0, k == 1, 0}, back[3] = {-n[0], -n[1], 0};
      s->from[k] = fmin(s->from[k], at.pos[k] - cav_geom_reach(m, g, &at, back));
      s->to[k] = fmax(s->to[k], at.pos[k] + cav_geom_reach(m, g, &at, n));
    }
  }
  const cav_sensor sensor = {
      .name = "", .type = CAV_SENSOR_SUBTREECOM, .object_type = CAV_OBJECT_BODY, .object = root, .dim = 3};
  double com[3];
  cav_sensor_read(m, state, &sensor, com);
  memcpy(s->com, com, sizeof s->com);
}

// whether a joint of a leg, the knee, is well above the hip
static int is_raised(const cav_model *m, const cav_state *state, const cav_roles *roles, int role) {
  cav_pose hip, at;
  double highest = -INFINITY;
  cav_object_pose(m, state, CAV_OBJECT_XBODY, roles->limb[role], &hip);
  for (int i = roles->body[role]; i > 0 && i != roles->limb[role]; i = m->body[i].parent) {
    cav_object_pose(m, state, CAV_OBJECT_XBODY, i, &at);
    highest = fmax(highest, at.pos[2]);
  }
  return highest > hip.pos[2] + 0.1;
}

// what the word says
static void check_meaning(const cav_model *m, cav_state *state, const cav_roles *roles, const char *name,
                          const double *q) {
  sight s;
  look(m, state, roles, q, &s);
  const int feet[2] = {CAV_ROLE_RIGHT_FOOT, CAV_ROLE_LEFT_FOOT}, hands[2] = {CAV_ROLE_RIGHT_HAND, CAV_ROLE_LEFT_HAND};
  double foot[2], knee[2], hand[2];
  for (int k = 0; k < 2 && roles->build == CAV_BUILD_BIPED; k++) {
    foot[k] = lowest(m, state, roles->body[feet[k]]);
    knee[k] = limb_low(m, state, roles, feet[k], 0);
    hand[k] = limb_low(m, state, roles, hands[k], 1);
  }
  CHECK(fabs(s.least) < 5e-3 && s.deep < 6e-3);
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    if (!joint->limited || (joint->type != CAV_JOINT_HINGE && joint->type != CAV_JOINT_SLIDE)) continue;
    CHECK(q[joint->q] >= joint->range[0] && q[joint->q] <= joint->range[1]);
  }
  const int hook = !strcmp(name, "hook-lying"), lying = hook || !strncmp(name, "lie-", 4);
  int over = 1;
  if (!strcmp(name, "lie")) {
    CHECK(s.up > 0.99 && s.torso < 5e-3);
  } else if (lying || !strcmp(name, "all-fours")) {
    CHECK(fabs(s.up) < 0.4);
    if (hook || !strcmp(name, "lie-back")) CHECK(s.front > 0.9);
    for (int k = 0; hook && k < 2; k++) CHECK(foot[k] < 5e-3 && is_raised(m, state, roles, feet[k]));
    if (!strcmp(name, "lie-front")) CHECK(s.front < -0.9);
    if (!strcmp(name, "lie-side")) CHECK(s.left > 0.9);
    if (!lying) CHECK(s.front < -0.9 && knee[0] < 5e-3 && knee[1] < 5e-3 && hand[0] < 5e-3 && hand[1] < 5e-3);
  } else {
    CHECK(s.up > (strcmp(name, "squat") ? 0.85 : 0.5) && s.torso > 0.1);
    const int kneels = strstr(name, "kneel") != NULL, both = !strcmp(name, "kneel"), floor = !strcmp(name, "sit-floor");
    if (kneels) CHECK(knee[0] < 5e-3 && (both ? knee[1] : foot[1]) < 5e-3 && (both || knee[1] > 0.01));
    if (!kneels && !floor) CHECK(foot[0] < 5e-3 && foot[1] < 5e-3);
    over = strcmp(name, "sit") != 0;
  }
  for (int k = 0; k < 2 && over; k++) CHECK(s.com[k] > s.from[k] - 1e-3 && s.com[k] < s.to[k] + 1e-3);
}

static void check_model(const char *path, int floating, const char *refused) {
  cav_model *m = shipped_load(path, floating);
  if (!m) return;
  cav_error error = {0};
  cav_state *state = cav_state_new(m);
  cav_roles roles;
  CHECK(cav_roles_find(m, state, &roles) == CAV_OK);
  double *q = scene_vector(m->nq), *again = scene_vector(m->nq);
  for (int i = 0; cav_posture_names[i]; i++) {
    const char *name = cav_posture_names[i];
    int own = roles.build == (strcmp(name, "lie") ? CAV_BUILD_BIPED : CAV_BUILD_QUADRUPED);
    error = (cav_error){0};
    cav_status status = cav_configuration_posture(m, state, name, q, &error);
    if (!CHECK((status == CAV_OK) == (own && strcmp(refused, name) != 0)))
      fprintf(stderr, "    %s, %s: %s\n", path, name, error.text);
    if (status) CHECK(status == CAV_BAD_INPUT && strlen(error.text) > 40);
    if (status) continue;
    check_meaning(m, state, &roles, name, q);
    CHECK(cav_configuration_posture(m, state, name, again, NULL) == CAV_OK &&
          !memcmp(q, again, (size_t)m->nq * sizeof *q));
  }
  CHECK(cav_configuration_posture(m, state, "kneal", q, &error) == CAV_BAD_INPUT && strstr(error.text, "'kneal'"));
  if (roles.build) CHECK(cav_configuration_posture(m, state, "stand", q, &error) == CAV_OK);
  free(q), free(again);
  cav_state_free(state);
  cav_model_free(m);
}

// how far a box reaches, and where a ray leaves it, is the same of a mesh of its corners; of a pyramid it is not that of a box
// about it: over its base, 0.3 below its centre of mass, the tip is three times as high
static void check_extents(void) {
  static const char text[] =
      "<mujoco><asset><mesh name='m' vertex='-.1 -.2 -.3 .1 -.2 -.3 -.1 .2 -.3 .1 .2 -.3 -.1 -.2 .3 .1 -.2 .3 -.1 .2 "
      ".3 .1 "
      ".2 .3'/><mesh name='p' vertex='-.5 -.5 0 .5 -.5 0 -.5 .5 0 .5 .5 0 0 0 "
      "1.2'/></asset><worldbody><body><freejoint/>"
      "<geom type='mesh' mesh='m' euler='20 30 40'/></body><body><freejoint/><geom type='box' size='.1 .2 .3' "
      "euler='20 30 "
      "40'/></body><body><freejoint/><geom type='mesh' mesh='p'/></body></worldbody></mujoco>";
  cav_model *m = scene_load(text);
  if (!CHECK(m != NULL)) return;
  cav_state *state = cav_state_new(m);
  cav_pose at[3];
  CHECK(cav_position(m, state, m->q0) == CAV_OK);
  for (int g = 0; g < 3; g++) cav_object_pose(m, state, CAV_OBJECT_GEOM, g, &at[g]);
  for (int k = 0; k < 100; k++) {
    double n[3] = {scene_uniform(), scene_uniform(), scene_uniform()};
    normalise3(n);
    CHECK_NEAR(cav_geom_reach(m, 0, &at[0], n), cav_geom_reach(m, 1, &at[1], n), 1e-9);
    CHECK_NEAR(cav_geom_exit(m, 0, &at[0], n), cav_geom_exit(m, 1, &at[1], n), 1e-9);
  }
  CHECK_NEAR(cav_geom_reach(m, 2, &at[2], (const double[3]){0, 0, 1}), 0.9, 1e-9);
  CHECK_NEAR(cav_geom_reach(m, 2, &at[2], (const double[3]){0, 0, -1}), 0.3, 1e-9);
  CHECK_NEAR(cav_geom_exit(m, 2, &at[2], (const double[3]){0, 0, -1}), 0.3, 1e-9);
  CHECK_NEAR(at[2].pos[2] - cav_geom_bottom(m, 2, &at[2]), 0.3, 1e-9);
  cav_state_free(state);
  cav_model_free(m);
}

// a robot of meshes is on the floor where collisions see it there, and lies on its back, not on what a box about it would reach
static void check_meshes(const char *path) {
  static const char *const posture[] = {"lie-back", "lie-front", "kneel", "all-fours", "squat"};
  cav_model *m = shipped_load(path, 0);
  if (!m) return;
  cav_state *state = cav_state_new(m);
  double *q = scene_vector(m->nq);
  for (size_t i = 0; i < sizeof posture / sizeof *posture; i++) {
    cav_error error = {0};
    double least = INFINITY;
    CHECK(cav_configuration_posture(m, state, posture[i], q, &error) == CAV_OK);
    CHECK(cav_configuration_to_floor(m, state, NULL, q, &error) == CAV_OK);
    state->options.smoothing = 0.1;
    CHECK(cav_position(m, state, q) == CAV_OK);
    for (int k = 0; k < state->ncontact; k++)
      if (state->contact[k].link1 == 0 || state->contact[k].link2 == 0) least = fmin(least, state->contact[k].dist);
    CHECK_NEAR(least, 0, 1e-9);
  }
  free(q);
  cav_state_free(state);
  cav_model_free(m);
}

static cav_problem *load(const char *folder, const char *start, cav_error *error) {
  char text[1000];
  snprintf(
      text, sizeof text,
      "<problem name='p' model='%s/problems/models/humanoid.xml'><horizon duration='.2' timestep='.05'/>%s</problem>",
      CAVORT_SOURCE_ROOT, start);
  return scene_problem(folder, text, error);
}

// after the model's keyframes and the file's poses, by the last name of a list
static void check_files(const char *folder) {
  cav_error error = {0};
  cav_problem *found = load(folder, "<start key='kneel' height='floor'/>", &error),
              *last = load(folder, "<start key='mine | kneel ' height='floor'/>", &error),
              *own = load(folder, "<pose name='kneel'/><start key='kneel' height='floor'/>", &error);
  if (CHECK(found && last && own)) {
    size_t bytes = (size_t)found->model->nq * sizeof(double);
    CHECK(!memcmp(found->q_start, last->q_start, bytes) && memcmp(found->q_start, own->q_start, bytes) != 0);
  }
  CHECK(!load(folder, "<start key='kneal'/>", &error) && strstr(error.text, "did you mean 'kneel'?"));
  CHECK(!load(folder, "<start key='lie'/>", &error) && strstr(error.text, "for quadrupeds"));
  cav_problem_free(found), cav_problem_free(last), cav_problem_free(own);
}

// a posture turned is that posture seen from elsewhere: z of its root's axes and the height as before, the rest by the angle
static void check_turn(const char *folder) {
  cav_error error = {0};
  cav_problem *as_it_is = load(folder, "<start key='all-fours' height='floor'/>", &error),
              *turned =
                  load(folder, "<start key='all-fours' height='floor'><root pos='.5 .2' turn='90'/></start>", &error);
  if (CHECK(as_it_is && turned)) {
    const double *p = as_it_is->q_start, *q = turned->q_start;
    double there[9], here[9];
    quat_matrix(there, p + 3), quat_matrix(here, q + 3);
    CHECK_NEAR(q[0], 0.5, 0), CHECK_NEAR(q[1], 0.2, 0), CHECK_NEAR(q[2], p[2], 1e-12);
    for (int k = 0; k < 3; k++) {
      CHECK_NEAR(here[k], -there[3 + k], 1e-12), CHECK_NEAR(here[3 + k], there[k], 1e-12);
      CHECK_NEAR(here[6 + k], there[6 + k], 1e-12);
    }
    // it does not stand upright, so that its whole orientation could not be stated as easily
    CHECK(fabs(there[8]) < 0.5);
    CHECK(!memcmp(p + 7, q + 7, (size_t)(as_it_is->model->nq - 7) * sizeof *p));
  }
  cav_problem_free(as_it_is), cav_problem_free(turned);
}

int main(void) {
  static const struct {
    const char *name;
    int shared, floating;
    const char *refused;
  } model[] = {{"humanoid.xml", 0, 0, ""},
               {"robot.xml", 0, 0, "half-kneel"}, // its hips do not part so far
               {"quadruped.xml", 0, 0, ""},
               {"cheetah.xml", 0, 0, ""},
               {"mujoco/humanoid.xml", 1, 0, ""},
               {"dm_control/humanoid.xml", 1, 0, ""},
               {"dm_control/quadruped.xml", 1, 0, ""},
               {"unitree/g1/g1_29dof.xml", 1, 0, ""},
               {"menagerie/unitree_go1/scene.xml", 1, 0, ""}};
  char folder[] = "/tmp/cavort_posture_XXXXXX", path[SHIPPED_PATH];
  for (size_t i = 0; i < sizeof model / sizeof *model; i++)
    if (shipped_path(model[i].name, model[i].shared, path))
      check_model(path, model[i].floating, model[i].refused);
    else
      CHECK(model[i].shared);
  check_extents();
  if (shipped_path("unitree/g1/scene_29dof.xml", 1, path)) check_meshes(path);
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  check_files(folder);
  check_turn(folder);
  scene_remove(folder);
  return check_result();
}
