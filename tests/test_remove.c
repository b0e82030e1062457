/// What a problem leaves out of a model's file: the bodies and geoms that it names, all that refers to them, all that
/// refers to that, and nothing else, also where names of other kinds are the same; a name that is not there is told
/// with its line.
#include "cavort/cavort.h"
#include "scene.h"

static const char model[] =
    "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/><geom name='wall' type='box' size='1 .1 1' "
    "pos='0 3 0'/>"
    "<body name='cart' pos='0 0 1'><joint name='rail' type='slide' axis='1 0 0'/><geom name='cart' size='.1'/><geom "
    "size='.05'/>"
    "<body name='arm' pos='0 0 .2'><joint name='elbow' axis='0 1 0'/><geom name='fist' size='.05' pos='0 0 .3'/>"
    "<site name='ball' pos='0 0 .3'/></body></body>"
    "<body name='ball' pos='1 0 1'><freejoint name='fly'/><geom name='skin' size='.1'/><site name='mark'/>"
    "<body name='tail' pos='-.2 0 0'><joint name='wag' axis='0 0 1'/><geom size='.03'/></body></body></worldbody>"
    "<tendon><fixed name='both'><joint joint='rail' coef='1'/><joint joint='wag' coef='1'/></fixed>"
    "<fixed name='lone'><joint joint='elbow' coef='2'/></fixed></tendon>"
    "<actuator><motor name='drive' joint='rail'/><motor name='pull' tendon='both'/><motor name='bend' tendon='lone'/>"
    "<motor name='wagger' joint='wag'/></actuator>"
    "<sensor><framepos name='a' objtype='body' objname='ball'/><framepos name='b' objtype='site' objname='ball'/>"
    "<framepos name='c' objtype='xbody' objname='cart' reftype='site' refname='mark'/><jointpos name='d' joint='rail'/>"
    "<actuatorfrc name='e' actuator='pull'/></sensor>"
    "<contact><exclude body1='cart' body2='tail'/><exclude body1='cart' body2='arm'/></contact>"
    "<equality><weld body1='tail' body2='cart'/></equality></mujoco>";

static cav_problem *load(const char *scene, cav_error *error) {
  char folder[] = "/tmp/cavort-omit-XXXXXX", path[300], text[1000];
  if (!CHECK(mkdtemp(folder) != NULL)) return NULL;
  snprintf(text, sizeof text,
           "<problem model='m.xml'>\n<scene>\n%s\n</scene>\n<horizon duration='1'/><start/></problem>\n", scene);
  scene_write(folder, "m.xml", model);
  scene_write(folder, "p.xml", text);
  snprintf(path, sizeof path, "%s/p.xml", folder);
  cav_problem *p = cav_problem_load(path, NULL, error);
  // results say it too
  if (p) {
    cav_problem *again = NULL;
    snprintf(path, sizeof path, "%s/again.xml", folder);
    CHECK(cav_problem_write(path, p, NULL, NULL) == CAV_OK && (again = cav_problem_load(path, NULL, NULL)));
    CHECK(again && again->model->nv == p->model->nv && again->model->ngeom == p->model->ngeom);
    cav_problem_free(again);
    unlink(path);
  }
  snprintf(path, sizeof path, "%s/p.xml", folder), unlink(path);
  snprintf(path, sizeof path, "%s/m.xml", folder), unlink(path);
  rmdir(folder);
  return p;
}

static void check_left(void) {
  cav_problem *p =
      load("<remove body='ball'/><remove geom='wall'/><geom name='step' type='box' size='.1 .1 .1'/>", NULL);
  if (!CHECK(p != NULL)) return;
  const cav_model *m = p->model;
  CHECK(m->nv == 2 && m->nq == 2 && m->nlink == 3 && m->nequality == 0);
  CHECK(cav_object_find(m, CAV_OBJECT_GEOM, "wall") < 0 && cav_object_find(m, CAV_OBJECT_GEOM, "floor") >= 0);
  CHECK(cav_object_find(m, CAV_OBJECT_GEOM, "step") >= 0);
  CHECK(cav_object_find(m, CAV_OBJECT_BODY, "ball") < 0 && cav_object_find(m, CAV_OBJECT_SITE, "ball") >= 0);
  CHECK(m->ntendon == 1 && cav_object_find(m, CAV_OBJECT_TENDON, "lone") == 0);
  CHECK(m->nu == 2 && cav_object_find(m, CAV_OBJECT_ACTUATOR, "drive") == 0 &&
        cav_object_find(m, CAV_OBJECT_ACTUATOR, "bend") == 1);
  CHECK(m->nsensor == 2 && cav_object_find(m, CAV_OBJECT_SENSOR, "b") == 0 &&
        cav_object_find(m, CAV_OBJECT_SENSOR, "d") == 1);
  cav_problem_free(p);
}

// geoms without names by their number in a body, of the file: the world's first and the cart's both; and their labels
static void check_numbered(void) {
  cav_error error = {0};
  char label[CAV_GEOM_LABEL];
  cav_problem *p = load("<remove body='cart' geom='1'/>", &error);
  if (CHECK(p != NULL)) {
    const cav_model *m = p->model;
    CHECK(m->ngeom == 6 && cav_object_find(m, CAV_OBJECT_GEOM, "cart") < 0);
    CHECK_TEXT(cav_geom_label(m, 2, label), "geom 2 of cart");
    CHECK(m->geom[2].size[0] == 0.05);
    CHECK_TEXT(cav_geom_label(m, 1, label), "wall");
  }
  cav_problem_free(p);
  p = load(
      "<remove body='cart' geom='1'/><remove body='cart' geom='2'/><remove body='world' geom='1'/>"
      "<remove body='cart' geom='2'/>",
      &error);
  CHECK(p && p->model->ngeom == 4 && cav_object_find(p->model, CAV_OBJECT_GEOM, "floor") < 0);
  CHECK(p && p->model->nu == 4);
  cav_problem_free(p);
}

static void refuse(const char *scene, int line, const char *says) {
  cav_error error = {0};
  cav_problem *p = load(scene, &error);
  if (!CHECK(!p && error.status == CAV_BAD_INPUT && error.line == line && strstr(error.text, says)))
    fprintf(stderr, "    line %d, '%s' lacks '%s'\n", error.line, error.text, says);
  cav_problem_free(p);
}

// a turret on a box, an arm of three links on it: geoms of the first and third link overlap by 20 mm where the arm is
// straight, a ball of another tree by 10 mm with the first link
#define ROBOT(GAP, KEYS, MORE)                                                                                   \
  "<mujoco><worldbody><body name='base'><geom type='box' size='.1 .1 .1'/><body name='turret' pos='0 0 .1'>"     \
  "<joint axis='0 0 1'/><geom type='cylinder' size='.05 .05'/><body name='a' pos='0 0 .1'><joint axis='0 1 0'/>" \
  "<geom name='low' size='.03'/><body name='b' pos='0 0 .02'><joint axis='0 1 0'/><geom size='.01'/><body "      \
  "name='c' pos='0 0 " GAP                                                                                       \
  "'><joint axis='0 1 0'/><geom name='high' size='.03'/></body></body></body></body>"                            \
  "</body><body pos='.05 0 .2'><freejoint/><geom name='ball' size='.03'/></body></worldbody>" MORE               \
  "<keyframe>"                                                                                                   \
  "<key qpos='0 .1 0 0 .05 0 .2 1 0 0 0'/>" KEYS "</keyframe></mujoco>"

#define BEARING(HEIGHT)                                                                           \
  "<mujoco><worldbody><body name='base'><geom type='box' size='.1 .1 .1'/><body pos='0 0 " HEIGHT \
  "'><joint axis='0 0 1'/><geom type='cylinder' size='.05 .05'/></body></body></worldbody></mujoco>"

// pairs of a plane and of what keeps its distance from it: a door, what slides along it; not of one that leans, sinks or touches
static void test_apart(void) {
  static const struct {
    const char *body;
    int pairs;
  } scene[] = {
      {"<body pos='0 0 1.02'><joint axis='0 0 1'/><geom type='box' size='.45 .02 1'/></body>", 0},
      {"<body pos='0 0 1.02'><joint axis='0 .01 1'/><geom type='box' size='.45 .02 1'/></body>", 1},
      {"<body pos='0 0 .999'><joint axis='0 0 1'/><geom type='box' size='.45 .02 1'/></body>", 1},
      {"<body pos='0 0 1.02'><joint axis='0 0 1'/><geom type='box' size='.45 .02 1' margin='.03'/></body>", 1},
      {"<body pos='0 0 .2'><joint type='slide' axis='1 0 0'/><joint type='slide' axis='0 1 0'/><joint axis='0 0 1'/>"
       "<geom size='.1'/><body pos='.1 0 0'><joint axis='0 0 -1'/><geom size='.05'/></body></body>",
       0},
      {"<body pos='0 0 .2'><joint type='slide' axis='0 0 1'/><geom size='.1'/></body>", 1},
      {"<body pos='0 0 .2'><joint axis='0 0 1'/><geom size='.1'/><body pos='.3 0 0'><joint axis='0 1 0'/><geom "
       "size='.05'/></body></body>",
       1},
      {"<body pos='0 0 .2'><freejoint/><geom size='.1'/></body>", 1},
  };
  for (size_t i = 0; i < sizeof scene / sizeof *scene; i++) {
    char path[] = "/tmp/cavort-apart-XXXXXX";
    const int file = mkstemp(path);
    if (!CHECK(file >= 0)) return;
    dprintf(file, "<mujoco><worldbody><geom type='plane' size='1 1 1'/>%s</worldbody></mujoco>", scene[i].body);
    close(file);
    cav_model *m = cav_model_load(path, NULL);
    if (!CHECK(m && m->npair == scene[i].pairs)) fprintf(stderr, "    %s\n", scene[i].body);
    cav_model_free(m);
    unlink(path);
  }
}

static void test_overlaps(void) {
  static const struct {
    const char *text, *says;
    int left;
  } robot[] = {
      {ROBOT(".02", "", ""), "2 pairs of geoms that overlap at rest, 'geom 1 of turret' and 'geom 1 of base' by 50 mm",
       2},
      // a pair of the file, one that a keyframe shows apart (b turned round), fingers that just touch
      {ROBOT(".02", "", "<contact><pair geom1='low' geom2='high'/></contact>"), "1 pair of geoms", 1},
      {ROBOT("-.05", "<key qpos='0 0 3.1416 0 .05 0 .2 1 0 0 0'/>", ""), "1 pair of geoms", 1},
      {ROBOT("-.05", "", ""), "3 pairs of geoms", 3},
      {ROBOT(".0395", "", ""), "1 pair of geoms", 1},
      // the two sides of a bearing, as xArm7's, 0.2 mm apart; 2 mm apart
      {BEARING(".1502"), "1 pair of geoms that overlap at rest or meet in the bearing of a base", 1},
      {BEARING(".152"), NULL, 0},
      {"<mujoco><worldbody><geom type='plane' size='1 1 1'/><body pos='0 0 .05'><freejoint/><geom size='.1'/></body>"
       "</worldbody></mujoco>",
       NULL, 0}};
  for (size_t i = 0; i < sizeof robot / sizeof *robot; i++) {
    char path[] = "/tmp/cavort-overlap-XXXXXX";
    int file = mkstemp(path);
    if (!CHECK(file >= 0 && write(file, robot[i].text, strlen(robot[i].text)) > 0)) return;
    close(file);
    cav_load_options options = cav_load_options_default();
    cav_model *whole = cav_model_load_with(path, &options, NULL);
    options.overlaps = 1;
    cav_model *m = cav_model_load_with(path, &options, NULL);
    if (CHECK(whole && m)) {
      CHECK(whole->npair - m->npair == robot[i].left && m->nwarning - whole->nwarning == (robot[i].says != NULL));
      if (robot[i].says && !CHECK(strstr(m->warning[m->nwarning - 1], robot[i].says)))
        fprintf(stderr, "    %s\n", m->warning[m->nwarning - 1]);
    }
    cav_model_free(whole);
    cav_model_free(m);
    unlink(path);
  }
}

int main(void) {
  test_overlaps();
  test_apart();
  check_left();
  // a geom alone takes no body, joint or actuator with it
  cav_error error = {0};
  cav_problem *p = load("<remove geom='cart'/>", &error);
  if (!p) fprintf(stderr, "    %s\n", error.text);
  CHECK(p && p->model->nv == 9 && p->model->nu == 4 && p->model->nsensor == 5 && p->model->nequality == 1);
  cav_problem_free(p);
  refuse("<remove body='bal'/>", 3, "no body of that name");
  refuse("\n<remove geom='ball'/>", 4, "no geom of that name");
  refuse("<remove/>", 3, "body and geom");
  refuse("<remove body='ball' geom='wall'/>", 3, "body and geom");
  refuse("<remove body='ball' geom='0'/>", 3, "from 1");
  refuse("\n<remove body='cart' geom='3'/>", 4, "no geom number 3");
  check_numbered();
  refuse("<remove body='ball'/><remove geom='skin'/>", 3, "no geom of that name");
  return check_result();
}
