/// Reader of URDF: a robot with every kind of joint and shape, faults by line, damage, and what is left aside. Models
/// no one here wrote are compared with MuJoCo in test_peer.c.

#include "scene.h"

#ifdef CAVORT_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

#define MASS(m)                                                       \
  "<inertial><origin xyz='.1 .2 .3' rpy='.3 -.2 .5'/><mass value='" m \
  "'/>"                                                               \
  "<inertia ixx='.2' ixy='.01' ixz='-.02' iyy='.3' iyz='.03' izz='.25'/></inertial>"

// floats, with every joint, a fixed link at the end, and shapes that touch
static const char robot[] =
    "<?xml version='1.0'?>\n<robot name='r' xmlns:xacro='http://x'>\n"
    "<material name='red'><color rgba='1 0 0 1'/></material>\n"
    "<link name='ground'><collision name='floor'><origin xyz='0 0 -1'/><geometry><box size='20 20 2'/></geometry></collision></link>\n"
    "<link name='base'>" MASS("3") "<collision name='hull'><geometry><sphere radius='.3'/></geometry></collision></link>\n"
    "<link name='arm'>" MASS("1") "<visual><geometry><mesh filename='absent.stl'/></geometry></visual></link>\n"
    "<link name='rod'>" MASS("1") "<collision><origin xyz='0 .1 .2' rpy='.4 .5 .6'/><geometry><sphere radius='.1'/></geometry>"
    "<material name='red'/></collision></link>\n"
    "<link name='wheel'>" MASS("2") "<collision><origin xyz='.5 0 0'/><geometry><sphere radius='.2'/></geometry></collision></link>\n"
    "<link name='sled'>" MASS("1.5") "</link>\n"
    "<link name='tip'>" MASS("0.5") "<collision><geometry><sphere radius='.15'/></geometry></collision></link>\n"
    "<joint name='float' type='floating'><origin xyz='0 0 1' rpy='.1 .2 .3'/><parent link='ground'/><child link='base'/></joint>\n"
    "<joint name='turn' type='revolute'><origin xyz='.1 .2 .3' rpy='1 2 3'/><parent link='base'/><child link='arm'/>"
    "<axis xyz='0 1 1'/><limit lower='-1' upper='.5' effort='7' velocity='2'/><dynamics damping='.3' friction='.2'/></joint>\n"
    "<joint name='push' type='prismatic'><origin xyz='.1 .2 .3'/><parent link='arm'/><child link='rod'/>"
    "<limit lower='-.1' upper='.2' effort='9' velocity='1'/></joint>\n"
    "<joint name='spin' type='continuous'><parent link='base'/><child link='wheel'/><axis xyz='0 0 1'/>"
    "<mimic joint='turn' multiplier='2' offset='.1'/></joint>\n"
    "<joint name='slide' type='planar'><origin xyz='1 0 0'/><parent link='base'/><child link='sled'/><axis xyz='0 0 1'/></joint>\n"
    "<joint name='glue' type='fixed'><origin xyz='0 0 .4' rpy='0 1 0'/><parent link='rod'/><child link='tip'/></joint>\n"
    "<gazebo reference='tip'><anything>text</anything></gazebo><oddity/>\n</robot>\n";

static cav_model *load_with(const char *text, const cav_load_options *options, cav_error *error) {
  char path[] = "/tmp/cavort-urdf-XXXXXX";
  int file = mkstemp(path);
  if (file < 0) return NULL;
  size_t length = strlen(text);
  int written = write(file, text, length) == (ssize_t)length;
  close(file);
  cav_model *model = written ? cav_model_load_with(path, options, error) : NULL;
  unlink(path);
  return model;
}

static cav_model *load(const char *text, cav_error *error) {
  cav_load_options options = cav_load_options_default();
  return load_with(text, &options, error);
}

static int warns(const cav_model *m, const char *part) {
  int count = 0;
  for (int i = 0; i < m->nwarning; i++) count += strstr(m->warning[i], part) != NULL;
  return count;
}

static void test_robot(void) {
  cav_error error = {0};
  cav_model *m = load(robot, &error);
  if (!CHECK(m != NULL)) {
    fprintf(stderr, "    %s\n", error.text);
    return;
  }
  CHECK_TEXT(m->name, "r");
  CHECK(m->nbody == 8 && m->nlink == 6 && m->nq == 13 && m->nv == 12 && m->nu == 2);
  // a floating joint on what stands in the world: free, named, under the world
  int f = cav_object_find(m, CAV_OBJECT_JOINT, "float"), base = cav_object_find(m, CAV_OBJECT_BODY, "base");
  CHECK(f >= 0 && m->joint[f].type == CAV_JOINT_FREE && m->body[base].parent == 0);
  // fixed: one link, name kept, mass of both
  int tip = cav_object_find(m, CAV_OBJECT_BODY, "tip"), rod = cav_object_find(m, CAV_OBJECT_BODY, "rod");
  CHECK(tip >= 0 && m->body[tip].link == m->body[rod].link);
  CHECK_NEAR(m->link[m->body[rod].link].mass, 1.5, 0);
  CHECK_NEAR(m->body[tip].inverse_weight[0], m->body[rod].inverse_weight[0], 0);
  int t = cav_object_find(m, CAV_OBJECT_JOINT, "turn"), spin = cav_object_find(m, CAV_OBJECT_JOINT, "spin");
  CHECK(m->joint[t].limited && !m->joint[spin].limited);
  CHECK_NEAR(m->joint[t].range[1], 0.5, 0);
  CHECK_NEAR(m->dof[m->joint[t].dof].damping, 0.3, 0);
  CHECK_NEAR(m->dof[m->joint[t].dof].frictionloss, 0.2, 0);
  // motors as strong as the limits
  int motor = cav_object_find(m, CAV_OBJECT_ACTUATOR, "push");
  CHECK(motor >= 0 && m->actuator[motor].ctrllimited);
  CHECK_NEAR(m->actuator[motor].ctrlrange[1], 9, 0);
  CHECK(cav_object_find(m, CAV_OBJECT_JOINT, "slide_RZ") >= 0 && cav_object_find(m, CAV_OBJECT_GEOM, "hull") >= 0);
  // follows another joint
  CHECK(m->nequality == 1 && m->equality[0].type == CAV_EQUALITY_JOINT && m->equality[0].object[0] == spin);
  CHECK(m->equality[0].object[1] == t && m->equality[0].coef[0] == 0.1 && m->equality[0].coef[1] == 2);
  // seen only, thus not read; said: velocities, strangers
  CHECK(m->ngeom == 5 && warns(m, "absent.stl") == 0);
  CHECK(m->joint[t].speed == 2 && m->joint[spin].speed == 0);
  CHECK(warns(m, "velocity limits of 2 joints") == 1 && warns(m, "<oddity>") == 1);
  for (int i = 0; i < m->ngeom; i++) CHECK(m->geom[i].rgba[1] < 0.4f || m->geom[i].rgba[1] > 0.4f);
  cav_model_free(m);
}

static void test_options(void) {
  cav_error error = {0};
  cav_load_options options = {.visual = 1};
  cav_model *m = load_with(robot, &options, &error);
  if (CHECK(m != NULL)) CHECK(warns(m, ":6: <mesh>: attribute 'filename': 'absent.stl': the file is not found") == 1);
  cav_model_free(m);
  static const char two[] = "<robot name='two'><link name='a'>" MASS(
      "1") "<visual><geometry><box size='1 1 1'/></geometry></visual></link></robot>";
  options = (cav_load_options){.visual = 1, .floating = 1};
  m = load_with(two, &options, &error);
  if (CHECK(m != NULL)) {
    CHECK(m->nq == 7 && m->ngeom == 1 && m->npair == 0 && cav_object_find(m, CAV_OBJECT_JOINT, "root") == 0);
    CHECK_NEAR(m->mass, 1, 0);
  }
  cav_model_free(m);
  // only a URDF has no way to say it itself
  char path[] = "/tmp/cavort-float-XXXXXX";
  int file = mkstemp(path);
  static const char mjcf[] = "<mujoco><worldbody/></mujoco>";
  CHECK(file >= 0 && write(file, mjcf, sizeof mjcf - 1) > 0);
  close(file);
  m = cav_model_load_with(path, &(cav_load_options){.floating = 1}, &error);
  CHECK(!m && strstr(error.text, "floating is for URDF files"));
  unlink(path);
  // a floating base as such: nothing stands in the world, a step of the inverse without contacts is the weight
  m = load_with(robot, &(cav_load_options){.floating = 1}, &error);
  CHECK(m == NULL);
}

#define BAR(ixx, iyy, izz)                                                                                             \
  "<robot name='bar'>some text<link name='a'/><link name='b'><inertial><mass value='1'/><inertia ixx='" ixx            \
  "' iyy='" iyy "' izz='" izz                                                                                          \
  "'/></inertial><collision><geometry><mesh filename='package:///x/shape.dae'/>"                                       \
  "</geometry></collision><collision><geometry/></collision></link><joint name='j' type='revolute'><parent link='a'/>" \
  "<child link='b'/><limit lower='-1' upper='1' effort='3' velocity='1' acceleration='9'/></joint></robot>"

// inertias as robots have them: mended where rounding explains it, told where not, refused where they are none
static void test_inertias(void) {
  cav_error error = {0};
  cav_model *m = load(BAR("2", "2", "4.02"), &error);
  if (CHECK(m != NULL)) {
    // 0.02 too much, a third of it to each: the nearest moments that a flat body has
    const double *I = m->body[2].inertia;
    CHECK_NEAR(fmax(I[0], fmax(I[1], I[2])), 4.02 - .02 / 3, 1e-12);
    CHECK_NEAR(fmin(I[0], fmin(I[1], I[2])), 2 + .02 / 3, 1e-12);
    CHECK(warns(m, "by rounding: mended") == 1 && warns(m, "text between tags") == 1);
    CHECK(warns(m, "the file is not found") == 1 && warns(m, "no shape inside") == 1);
    CHECK(warns(m, "attribute 'acceleration'") == 1 && m->nwarning == 6);
    CHECK(m->nactuator == 1 && m->actuator[0].ctrlrange[1] == 3);
  }
  cav_model_free(m);
  m = load(BAR("1", "1", "4"), &error);
  if (CHECK(m != NULL)) CHECK(warns(m, "which no solid has; taken as it stands") == 1 && m->link[1].inertia[2] == 4);
  cav_model_free(m);
  m = load(BAR("2", "2", "-1e-6"), &error);
  if (CHECK(m != NULL)) CHECK(warns(m, "below 0 by rounding") == 1);
  cav_model_free(m);
  m = load(BAR("2", "2", "-1"), &error);
  CHECK(!m && strstr(error.text, "expected numbers >= 0"));
  cav_model_free(m);
  // a point mass, as iCub's ankles, whose zeros were turned by a program
  m = load("<robot><link name='a'/><link name='b'><inertial><mass value='.27'/><inertia ixx='0' iyy='0' izz='0' "
           "ixz='1.35525e-20'/></inertial></link><link name='c'>" MASS("1")
           "</link><joint name='j' type='revolute'><parent link='a'/><child link='b'/></joint>"
           "<joint name='k' type='fixed'><parent link='b'/><child link='c'/></joint></robot>",
           &error);
  if (CHECK(m != NULL)) CHECK(m->body[2].inertia[0] == 0 && m->body[2].inertia[1] == 0 && m->body[2].inertia[2] == 0);
  cav_model_free(m);
  // a link without mass may carry one that has it
  m = load("<robot><link name='a'/><link name='b'/><link name='c'>" MASS("1")
           "</link><joint name='j' type='revolute'><parent link='a'/><child link='b'/></joint>"
           "<joint name='k' type='revolute'><parent link='b'/><child link='c'/><axis xyz='0 1 0'/></joint></robot>",
           &error);
  CHECK(m && m->nv == 2);
  cav_model_free(m);
}

static void write_file(const char *folder, const char *name, const char *text) {
  char path[200];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  FILE *file = fopen(path, "w");
  if (!CHECK(file != NULL)) return;
  fputs(text, file);
  fclose(file);
}

// pairs that do not touch and postures, from the file that planners write
static void test_srdf(void) {
  static const char balls[] =
      "<robot name='balls'><link name='a'>" MASS("1") "<collision><geometry><sphere radius='1'/></geometry></collision>"
      "</link><link name='b'>" MASS("1") "</link><link name='c'>" MASS("1")
      "<collision><geometry><sphere radius='1'/></geometry></collision></link>"
      "<joint name='j' type='revolute'><parent link='a'/><child link='b'/></joint>"
      "<joint name='k' type='prismatic'><parent link='b'/><child link='c'/></joint></robot>";
  char folder[] = "/tmp/cavort-srdf-XXXXXX", path[200];
  if (!CHECK(mkdtemp(folder) != NULL)) return;
  write_file(folder, "model.urdf", balls);
  snprintf(path, sizeof path, "%s/model.urdf", folder);
  cav_load_options options = {.floating = 1};
  cav_error error = {0};
  cav_model *m = cav_model_load_with(path, &options, &error);
  CHECK(m && m->npair == 1 && m->nkey == 0);
  cav_model_free(m);
  write_file(folder, "balls.srdf",
             "<robot name='balls'><group name='all'/><disable_collisions link1='c' link2='a' reason='Never'/>"
             "<disable_collisions link1='c' link2='absent'/><group_state name='half_sitting' group='all'>"
             "<joint name='root_joint' value='1 2 3 0 0 1 0'/><joint name='j' value='.5'/></group_state>"
             "<group_state name='half_sitting' group='more'><joint name='k' value='-.25'/></group_state></robot>");
  m = cav_model_load_with(path, &options, &error);
  if (CHECK(m && m->npair == 0 && m->nkey == 1 && m->nq == 9)) {
    const double expected[9] = {1, 2, 3, 0, 0, 0, 1, .5, -.25};
    CHECK_TEXT(m->key[0].name, "half_sitting");
    CHECK_NEAR_ALL(m->key[0].q, expected, 9, 1e-15);
    CHECK(warns(m, "1 pairs of links that do not touch, 1 keyframes") == 1);
  }
  cav_model_free(m);
  write_file(folder, "balls.srdf", "<robot><");
  m = cav_model_load_with(path, &options, &error);
  CHECK(m && m->npair == 1 && warns(m, "the SRDF file beside it is left aside") == 1);
  cav_model_free(m);
  unlink(path);
  snprintf(path, sizeof path, "%s/balls.srdf", folder);
  unlink(path);
  rmdir(folder);
}

// joints that were made fixed and keep their <mimic>, as in Talos without fingers; who follows such a one; joints
// without an effort
static void test_reduced(void) {
  static const char text[] =
      "<robot name='r'><link name='a'>" MASS("1") "</link><link name='b'>" MASS("1") "</link><link name='c'>" MASS("1")
      "</link><link name='d'>" MASS("1") "</link><link name='e'>" MASS("1") "</link>\n"
      "<joint name='j' type='revolute'><parent link='a'/><child link='b'/><limit lower='-1' upper='1' effort='3' velocity='1'/></joint>\n"
      "<joint name='k' type='fixed'><parent link='b'/><child link='c'/><mimic joint='j' multiplier='-1'/></joint>\n"
      "<joint name='l' type='revolute'><parent link='b'/><child link='d'/><limit lower='-1' upper='1' effort='3' velocity='1'/>"
      "<mimic joint='k' multiplier='-1' offset='.1'/></joint>\n"
      "<joint name='m' type='continuous'><parent link='d'/><child link='e'/></joint></robot>";
  cav_error error = {0};
  cav_model *m = load(text, &error);
  if (!CHECK(m != NULL)) {
    fprintf(stderr, "    %s\n", error.text);
    return;
  }
  // who follows has no motor of its own: a gripper's fingers are as strong as its one
  CHECK(m->nv == 3 && m->nactuator == 1 && m->nequality == 1);
  CHECK(m->equality[0].object[1] < 0);
  CHECK_NEAR(m->equality[0].coef[0], .1, 1e-15);
  int told = 0;
  for (int i = 0; i < m->nwarning; i++)
    told += strstr(m->warning[i], "has no actuator") != NULL && strstr(m->warning[i], ":5: ");
  CHECK(told == 1);
  cav_model_free(m);
}

// joints on which nothing weighs, frames of a camera and a drawn wheel, are held and told; one that carries weight further
// out moves
static void test_weightless(void) {
  static const char text[] =
      "<robot name='r'><link name='a'>" MASS("1") "</link><link name='pan'/><link name='tilt'/><link name='lens'/>"
      "<link name='wheel'><visual><geometry><sphere radius='.1'/></geometry></visual></link>"
      "<link name='cross'/><link name='tip'>" MASS("1") "</link>"
      "<link name='skid'><inertial><mass value='0'/><inertia ixx='0' iyy='0' izz='0'/></inertial><collision><geometry>"
      "<sphere radius='.1'/></geometry></collision></link><link name='cap'><collision><geometry><mesh "
      "filename='nowhere.stl'/></geometry></collision></link>\n"
      "<joint name='s' type='prismatic'><origin xyz='0 0 -1'/><parent link='tip'/><child link='skid'/><limit lower='-1' "
      "upper='1' effort='3' velocity='1'/></joint>\n"
      "<joint name='l' type='continuous'><parent link='tip'/><child link='cap'/></joint>\n"
      "<joint name='p' type='revolute'><origin xyz='1 0 0'/><parent link='a'/><child link='pan'/>"
      "<limit lower='-1' upper='1' effort='3' velocity='1'/></joint>\n"
      "<joint name='t' type='continuous'><origin xyz='0 1 0'/><parent link='pan'/><child link='tilt'/></joint>\n"
      "<joint name='f' type='fixed'><origin xyz='0 0 1'/><parent link='tilt'/><child link='lens'/></joint>\n"
      "<joint name='w' type='continuous'><parent link='a'/><child link='wheel'/><mimic joint='c'/></joint>\n"
      "<joint name='c' type='continuous'><parent link='a'/><child link='cross'/><axis xyz='0 0 1'/></joint>\n"
      "<joint name='d' type='continuous'><parent link='cross'/><child link='tip'/><mimic joint='p' offset='.2'/></joint>"
      "</robot>";
  cav_load_options options = {.floating = 1, .visual = 1};
  cav_error error = {0};
  cav_model *m = load_with(text, &options, &error);
  if (!CHECK(m != NULL)) {
    fprintf(stderr, "    %s\n", error.text);
    return;
  }
  CHECK(m->nv == 8 && m->njoint == 3 && m->nactuator == 0 && m->nlink == 4);
  CHECK(m->nequality == 1 && m->equality[0].object[1] < 0);
  CHECK(warns(m, "nothing on it weighs: the joint is held; give its link an inertial element (and 4 more)") == 1);
  // what touches on a held joint touches
  CHECK(m->ngeom == 2 && m->geom[1].link == 3 && m->geom[1].contype == 1 && m->geom[1].pos[2] == -1);
  const double lens[3] = {1, 1, 1};
  int body = cav_object_find(m, CAV_OBJECT_BODY, "lens");
  if (CHECK(body >= 0)) CHECK_NEAR_ALL(m->body[body].pos, lens, 3, 1e-15);
  cav_model_free(m);
}

// limits that are none: infinite, turned round, of one side; a mimic of nobody; a ball
static void test_limits(void) {
  static const struct {
    const char *joint;
    int limited, driven, bounded;
    double low;
  } sets[] = {{"revolute'><limit lower='-1' upper=' 1 ' effort='3' velocity='1'/>", 1, 1, 1, -1},
              {"revolute'><limit lower='-inf' upper='inf' effort='inf' velocity='inf'/>", 0, 1, 0, 0},
              {"prismatic'><limit lower='1' upper='-1' effort='3'/>", 0, 1, 1, 1},
              {"revolute'><limit lower='-INF' upper='1' effort='3'/>", 0, 1, 1, 0},
              {"revolute'><limit lower='-1' upper='1' effort='3'/><mimic joint='nobody'/>", 1, 1, 1, -1},
              {"spherical'>", 0, 0, 0, 0}};
  for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
    char text[1000];
    cav_error error = {0};
    snprintf(text, sizeof text,
             "<robot name='r'><link name='a'/><link name='b'>" MASS("1") "</link><joint name='j' type='%s<parent "
                                                                          "link='a'/><child link='b'/></joint></robot>",
             sets[i].joint);
    cav_model *m = load(text, &error);
    if (!CHECK(m != NULL)) {
      fprintf(stderr, "    %s\n", error.text);
      continue;
    }
    CHECK(m->joint[0].limited == sets[i].limited && m->nactuator == sets[i].driven);
    CHECK(m->nv == (i == 5 ? 3 : 1) && (m->joint[0].type == CAV_JOINT_BALL) == (i == 5));
    if (sets[i].driven) CHECK(m->actuator[0].ctrllimited == sets[i].bounded && m->joint[0].speed == (i == 0));
    if (sets[i].limited) CHECK_NEAR(m->joint[0].range[0], sets[i].low, 0);
    cav_model_free(m);
  }
}

// faults: line and words
static void test_faults(void) {
  static const struct {
    const char *text, *says;
  } faults[] = {
      {"<robot/>", "no link"},
      {"<robot>\n<link name='a'/><link name='a'/></robot>", ":2: <link>: attribute 'name': 'a' is taken"},
      {"<robot><link name='a'/>\n<link name='b'/></robot>", "one link alone may be the root"},
      {"<robot><link name='a'/>\n<joint name='j' type='fixed'><parent link='a'/><child link='aa'/></joint></robot>",
       ":2: <child>: attribute 'link': no link is named 'aa'"},
      {"<robot><link name='a'/><link name='b'/>\n<joint name='j' type='fixed'><parent link='a'/><child "
       "link='b'/></joint>"
       "<joint name='k' type='fixed'><parent link='b'/><child link='a'/></joint></robot>",
       "circle"},
      {"<robot><link name='r'/><link name='a'/><link name='b'/>\n<joint name='j' type='fixed'><parent link='a'/>"
       "<child link='b'/></joint><joint name='k' type='fixed'><parent link='b'/><child link='a'/></joint></robot>",
       "circle"},
      {"<robot><link name='a'/><link name='b'/><joint name='j' type='fixed'><parent link='a'/><child "
       "link='b'/></joint>\n"
       "<joint name='k' type='fixed'><parent link='a'/><child link='b'/></joint></robot>",
       ":2: <joint>: carries link 'b', which"},
      {"<robot><link name='a'/><link name='b'/>\n<joint name='j' type='hinge'><parent link='a'/><child "
       "link='b'/></joint>"
       "</robot>",
       ":2: <joint>: attribute 'type': expected one of"},
      {"<robot><link name='a'/>\n<joint name='j' type='fixed'><parent link='a'/></joint></robot>",
       "needs at least 1 <child>"},
      {"<robot><link name='a'/><link name='b'>" MASS("1") "</link><joint name='j' type='revolute'><parent link='a'/>"
                                                          "<child link='b'/>\n<axis xyz='0 0 0'/></joint></robot>",
       ":2: <axis>: attribute 'xyz': expected a direction"},
      {"<robot><link name='a'/><link name='b'>" MASS(
           "1") "</link><joint name='j' type='revolute'><parent link='a'/>"
                "<child link='b'/>\n<limit lower='1' upper='?'/></joint></robot>",
       ":2: <limit>: attribute 'upper': expected a number"},
      {"<robot><link name='a'/><link name='b'>\n<inertial><mass value='-1'/><inertia ixx='1' iyy='1' "
       "izz='1'/></inertial>"
       "</link><joint name='j' type='fixed'><parent link='a'/><child link='b'/></joint></robot>",
       ":2: <mass>: attribute 'value': expected a mass >= 0"},
      {"<robot><link name='a'/><link name='b'><inertial><mass value='0'/><inertia ixx='0' iyy='0' izz='0'/></inertial>"
       "<collision><geometry><sphere radius='1'/></geometry></collision></link>\n"
       "<joint name='j' type='floating'><parent link='a'/><child link='b'/></joint></robot>",
       "moves but has no mass"},
  };
  for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
    cav_error error = {0};
    cav_model *m = load(faults[i].text, &error);
    CHECK(m == NULL);
    CHECK(error.status == CAV_BAD_INPUT);
    if (!CHECK(strstr(error.text, faults[i].says) != NULL)) fprintf(stderr, "    %zu: %s\n", i, error.text);
    cav_model_free(m);
  }
}

// bytes knocked out, doubled or replaced: a model or an error, nothing else
static void test_damage(void) {
  char text[sizeof robot + 64];
  int loaded = 0;
  for (int k = 0; k < 3000; k++) {
    memcpy(text, robot, sizeof robot);
    for (int edits = 0; edits < 1 + k % 4; edits++) {
      size_t length = strlen(text), at = (size_t)((scene_uniform() + 1) / 2 * (double)length);
      size_t span = 1 + (size_t)((scene_uniform() + 1) * 10);
      if (at + span >= length) continue;
      if (k % 3 == 0)
        memmove(text + at, text + at + span, length - at - span + 1);
      else
        text[at] = "<>/'=0-9e. azb"[k % 14];
    }
    cav_error error = {0};
    cav_model *m = load(text, &error);
    loaded += m != NULL;
    CHECK((m != NULL) == (error.status == CAV_OK));
    CHECK(m != NULL || *error.text);
    cav_model_free(m);
  }
  printf("damaged robots: %d of 3000 still load\n", loaded);
}

#ifdef CAVORT_HAVE_MUJOCO
// the same robot in MuJoCo, which leaves the ground's link to the world: u in states in contact and past limits
static void test_peer(void) {
  char path[] = "/tmp/cavort-urdf-XXXXXX.urdf", text[1000] = "";
  int file = mkstemps(path, 5);
  if (!CHECK(file >= 0)) return;
  // MuJoCo passes over mimic
  char plain[sizeof robot], *mimic = strstr(strcpy(plain, robot), "<mimic");
  memset(mimic, ' ', (size_t)(strchr(mimic, '>') - mimic) + 1);
  CHECK(write(file, plain, strlen(plain)) == (ssize_t)strlen(plain));
  close(file);
  cav_error error = {0};
  cav_model *m = cav_model_load(path, &error);
  mjModel *p = mj_loadXML(path, NULL, text, sizeof text);
  unlink(path);
  if (!CHECK(m && p)) {
    fprintf(stderr, "    %s %s\n", error.text, text);
    return;
  }
  CHECK(m->nq == p->nq && m->nv == p->nv);
  p->opt.cone = mjCONE_ELLIPTIC;
  mjData *d = mj_makeData(p);
  cav_state *state = cav_state_new(m);
  double v_next[20], u[20], expected[20], most = 0;
  int touching = 0, compared = 0;
  for (int k = 0; k < 2000; k++) {
    mj_resetData(p, d);
    scene_normals(d->qvel, p->nv, 2);
    scene_normals(d->qacc, p->nv, 20);
    scene_normals(d->qpos, p->nq, 0.5);
    d->qpos[2] = 0.6 + 0.5 * scene_uniform();
    mju_normalize4(d->qpos + 3);
    mj_inverse(p, d);
    // a sphere with its centre inside a box: MuJoCo bounds its depth by the radius
    int deep = 0;
    for (int i = 0; i < d->ncon; i++) deep |= d->contact[i].dist < -0.099;
    if (deep) continue;
    for (int i = 0; i < p->nv; i++) {
      v_next[i] = d->qvel[i] + p->opt.timestep * d->qacc[i];
      expected[i] = d->qfrc_inverse[i] + p->dof_damping[i] * (v_next[i] - d->qvel[i]);
    }
    CHECK(cav_inverse(m, state, d->qpos, d->qvel, v_next, u) == CAV_OK);
    compared++;
    touching += state->ncontact > 0;
    most = fmax(most, scene_error(u, expected, p->nv));
  }
  printf("robot against MuJoCo: relative error of u %.1e in %d states, %d touching\n", most, compared, touching);
  // MuJoCo diagonalises general inertia to 1e-6 only (test_model.c); with diagonal inertia test_peer.c sees 1e-14.
  // Seen: 5e-9
  CHECK_NEAR(most, 0, 1e-7);
  CHECK(compared > 300 && touching > 100);
  mj_deleteData(d);
  mj_deleteModel(p);
  cav_state_free(state);
  cav_model_free(m);
}
#endif

// prismatic joints one after another between masses m: a unit force on a joint moves its two neighbours apart
static void test_chain(void) {
  enum { LINKS = 1001, ROOM = 400 * LINKS };
  const double m = 0.25;
  char *text = malloc(ROOM);
  if (!CHECK(text != NULL)) return;
  for (int links = LINKS; links <= LINKS + 1; links++) {
    size_t used = (size_t)snprintf(text, ROOM, "<robot name='chain'>\n");
    for (int i = 0; i < links; i++)
      used += (size_t)snprintf(text + used, ROOM - used, "<link name='l%d'>" MASS(".25") "</link>\n", i);
    for (int i = 1; i < links; i++)
      used += (size_t)snprintf(text + used, ROOM - used,
                               "<joint name='j%d' type='prismatic'><parent link='l%d'/><child link='l%d'/>"
                               "<limit lower='-1' upper='1' effort='1' velocity='1'/></joint>\n",
                               i, i - 1, i);
    used += (size_t)snprintf(text + used, ROOM - used, "</robot>\n");
    CHECK(used < ROOM);
    cav_error error = {0};
    cav_model *model = load(text, &error);
    CHECK((model != NULL) == (links == LINKS));
    if (links > LINKS) CHECK(strstr(error.text, ":1003: <link>: more than 1000 links one after another"));
    double most = 0;
    for (int i = 0; model && i < model->nactuator; i++) {
      double squares = i == 0 ? 2 : i + 1 < model->nactuator ? 6 : 5;
      most = fmax(most, fabs(model->actuator[i].acceleration - sqrt(squares) / m));
      most = fmax(most, fabs(model->dof[i].inverse_weight - (i ? 2 : 1) / m));
    }
    if (model) {
      CHECK(model->nactuator == LINKS - 1 && most < 1e-9);
      printf("%d links one after another: weights to %.1e\n", links, most);
    }
    cav_model_free(model);
  }
  free(text);
}

int main(void) {
  test_robot();
  test_options();
  test_inertias();
  test_srdf();
  test_reduced();
  test_weightless();
  test_limits();
  test_faults();
  test_damage();
  test_chain();
#ifdef CAVORT_HAVE_MUJOCO
  test_peer();
#else
  printf("skipped the peer: built without MuJoCo\n");
#endif
  return check_result();
}
