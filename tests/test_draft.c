/// What files can do, in code: models from a text and from a draft have the bits of the same MJCF in a file; drafts tell what
/// is wrong with them; postures down to the floor, into ranges and standing, and terms by constructors, are those that a
/// problem file gives.
#include <locale.h>

#include "cavort/cavort.h"
#include "scene.h"

/// What no member of a model's structs holds: four bytes before these members, and at the end of a geom (clang -Wpadded). It is
/// whatever stood there before.
// clang-format off
#define GAPS(X)                                                                                                  \
  X(link, nlink, pos)                                                                                            \
  X(joint, njoint, pos)                                                                                          \
  X(joint, njoint, range)                                                                                        \
  X(joint, njoint, effort_range) X(dof, nv, damping) X(geom, ngeom, bound) X(geom, ngeom, fluidcoef)             \
      X(site, nsite, size) X(pair, npair, friction) X(tendon, ntendon, range) X(tendon_part, ntendon_part, coef) \
          X(tendon_path, ntendon_path, divisor) X(equality, nequality, pos)                                      \
              X(actuator, nactuator, activation_parameter) X(actuator, nactuator, ctrlrange)
// clang-format on

// the four bytes before a place in a model
static void clear(const cav_model *m, const void *place) {
  char *at = (char *)m + ((const char *)place - (const char *)m);
  memset(at - 4, 0, 4);
}

static void clear_gaps(const cav_model *m) {
#define CLEAR(array, count, member) \
  for (int i = 0; i < m->count; i++) clear(m, &m->array[i].member);
  GAPS(CLEAR)
#undef CLEAR
  for (int i = 0; i < m->ngeom; i++) clear(m, &m->geom[i + 1]);
  clear(m, &m->timestep), clear(m, &m->body);
}

/// Words of two models that differ. A model is one block; addresses within it count from its start.
static long differing(const cav_model *a, const cav_model *b) {
  if (!a || !b || a->bytes != b->bytes) return -1;
  clear_gaps(a), clear_gaps(b);
  long n = 0;
  for (size_t i = 0; i + sizeof(size_t) <= a->bytes; i += sizeof(size_t)) {
    size_t x, y;
    memcpy(&x, (const char *)a + i, sizeof x);
    memcpy(&y, (const char *)b + i, sizeof y);
    size_t from = (size_t)a, to = (size_t)b;
    int inside = x >= from && x < from + a->bytes && y >= to && y < to + b->bytes;
    n += x != y && !(inside && x - from == y - to);
  }
  return n;
}

// ---------------------------------------------------------------- models

static const char robot_text[] =
    "<mujoco model='robot'><compiler angle='radian'/><worldbody>"
    "<geom type='plane' size='5 5 1' friction='0.7 0.01 0.001'/>"
    "<body name='trunk' pos='0 0 0.30000000000000004' quat='0.9 0.1 0.2 0.3'><freejoint name='root'/>"
    "<geom name='box' type='box' size='0.1 0.2 0.05' mass='3'/>"
    "<body name='arm' pos='0.1 0 0'><joint name='hinge' axis='0 1 0.333333333333333315' range='-1.1 0.7' "
    "limited='true' "
    "damping='0.1'/><geom type='capsule' size='0.03' fromto='0 0 0 0.3 0 0' density='700'/>"
    "<site name='tip' pos='0.3 0 0'/></body></body></worldbody>"
    "<actuator><motor name='m' joint='hinge' gear='12' ctrlrange='-1 1' ctrllimited='true'/></actuator>"
    "<sensor><framepos name='where' objtype='site' objname='tip'/></sensor>"
    "<keyframe><key name='home' qpos='0 0 0.5 1 0 0 0 0.2'/></keyframe></mujoco>";

/// The same in code.
static cav_draft *robot_draft(void) {
  cav_draft *d = cav_draft_new("robot");
#define NUMBERS(element, name, ...) \
  cav_draft_numbers(d, element, name, (double[]){__VA_ARGS__}, sizeof(double[]){__VA_ARGS__} / sizeof(double))
  int floor = cav_draft_add(d, CAV_DRAFT_WORLD, "geom"), trunk = cav_draft_add(d, CAV_DRAFT_WORLD, "body");
  cav_draft_text(d, floor, "type", "plane");
  NUMBERS(floor, "size", 5, 5, 1);
  NUMBERS(floor, "friction", 0.7, 0.01, 0.001);
  cav_draft_text(d, trunk, "name", "trunk");
  NUMBERS(trunk, "pos", 0, 0, 0.1 + 0.2);
  NUMBERS(trunk, "quat", 0.9, 0.1, 0.2, 0.3);
  cav_draft_text(d, cav_draft_add(d, trunk, "freejoint"), "name", "root");
  int box = cav_draft_add(d, trunk, "geom"), arm = cav_draft_add(d, trunk, "body");
  cav_draft_text(d, box, "name", "box");
  cav_draft_text(d, box, "type", "box");
  NUMBERS(box, "size", 0.1, 0.2, 0.05);
  NUMBERS(box, "mass", 3);
  cav_draft_text(d, arm, "name", "arm");
  NUMBERS(arm, "pos", 0.1, 0, 0);
  int hinge = cav_draft_add(d, arm, "joint"), rod = cav_draft_add(d, arm, "geom"), tip = cav_draft_add(d, arm, "site");
  cav_draft_text(d, hinge, "name", "hinge");
  NUMBERS(hinge, "axis", 0, 1, 1.0 / 3);
  NUMBERS(hinge, "range", -3, 3);
  NUMBERS(hinge, "range", -1.1, 0.7); // the later one counts
  cav_draft_text(d, hinge, "limited", "true");
  NUMBERS(hinge, "damping", 0.1);
  cav_draft_text(d, rod, "type", "capsule");
  NUMBERS(rod, "size", 0.03);
  NUMBERS(rod, "fromto", 0, 0, 0, 0.3, 0, 0);
  NUMBERS(rod, "density", 700);
  cav_draft_text(d, tip, "name", "tip");
  NUMBERS(tip, "pos", 0.3, 0, 0);
  int motor = cav_draft_add(d, cav_draft_add(d, CAV_DRAFT_ROOT, "actuator"), "motor");
  cav_draft_text(d, motor, "name", "m");
  cav_draft_text(d, motor, "joint", "hinge");
  NUMBERS(motor, "gear", 12);
  NUMBERS(motor, "ctrlrange", -1, 1);
  cav_draft_text(d, motor, "ctrllimited", "true");
  int where = cav_draft_add(d, cav_draft_add(d, CAV_DRAFT_ROOT, "sensor"), "framepos");
  cav_draft_text(d, where, "name", "where");
  cav_draft_text(d, where, "objtype", "site");
  cav_draft_text(d, where, "objname", "tip");
  int key = cav_draft_add(d, cav_draft_add(d, CAV_DRAFT_ROOT, "keyframe"), "key");
  cav_draft_text(d, key, "name", "home");
  NUMBERS(key, "qpos", 0, 0, 0.5, 1, 0, 0, 0, 0.2);
#undef NUMBERS
  return d;
}

static void test_draft(void) {
  cav_error error = {0};
  cav_model *file = scene_load(robot_text), *text = cav_model_parse(robot_text, NULL, NULL, &error);
  cav_draft *draft = robot_draft();
  // a decimal comma of the program's is not one of the draft's
  int comma = setlocale(LC_NUMERIC, "de_DE.UTF-8") != NULL;
  cav_model *made = cav_draft_compile(draft, NULL, NULL, &error);
  if (!CHECK(made != NULL)) fprintf(stderr, "    %s\n", error.text);
  setlocale(LC_NUMERIC, "C");
  cav_model *written = scene_load(cav_draft_mjcf(draft));
  printf("draft: %zu bytes of model, locale with a comma %s\n", file ? file->bytes : 0, comma ? "tried" : "not here");
  CHECK(differing(file, text) == 0);
  CHECK(differing(file, made) == 0);
  CHECK(differing(file, written) == 0);
  // a control: the comparison sees a number that is one bit off, and a name
  static char off[sizeof robot_text];
  memcpy(off, robot_text, sizeof off);
  strstr(off, "00004'")[4] = '9';
  cav_model *other = cav_model_parse(off, NULL, NULL, &error);
  CHECK(differing(file, other) > 0);
  cav_model_free(other);
  // it may grow
  int world_site = cav_draft_add(draft, CAV_DRAFT_WORLD, "site");
  cav_draft_text(draft, world_site, "name", "a<b&\"c'");
  other = cav_draft_compile(draft, NULL, NULL, &error);
  CHECK(other && other->nsite == file->nsite + 1 && cav_object_find(other, CAV_OBJECT_SITE, "a<b&\"c'") >= 0);
  cav_model_free(other), cav_model_free(file), cav_model_free(text), cav_model_free(made), cav_model_free(written);
  cav_draft_free(draft);
  cav_draft_free(NULL);
}

/// The models of the repository as texts: meshes and includes from their folder.
static void test_parse(void) {
  static const char *const names[] = {"problems/models/humanoid.xml", "problems/models/robot.xml",
                                      "tests/features.xml"};
  for (int i = 0; i < 3; i++) {
    char path[4200], folder[4200];
    static char text[400000];
    snprintf(path, sizeof path, "%s/%s", CAVORT_SOURCE_ROOT, names[i]);
    snprintf(folder, sizeof folder, "%.*s", (int)(strrchr(path, '/') - path), path);
    FILE *file = fopen(path, "r");
    if (!CHECK(file != NULL)) continue;
    text[fread(text, 1, sizeof text - 1, file)] = 0;
    fclose(file);
    cav_error error = {0};
    cav_model *a = cav_model_load(path, &error), *b = cav_model_parse(text, folder, NULL, &error);
    // warnings name their file
    // the last has warnings, which name their file
    if (!CHECK(a && b && (i < 2 ? differing(a, b) == 0 : a->nwarning == b->nwarning)))
      fprintf(stderr, "    %s\n", error.text);
    cav_model_free(a), cav_model_free(b);
  }
  static const char urdf[] =
      "<robot name='r'><link name='base'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' "
      "iyz='0'/></inertial></link></robot>";
  cav_load_options options = cav_load_options_default();
  options.floating = 1;
  cav_error error = {0};
  cav_model *robot = cav_model_parse(urdf, "/nowhere", &options, &error);
  CHECK(robot && robot->nv == 6);
  cav_model_free(robot);
}

static void refuse_text(const char *text, const char *folder, const char *says) {
  cav_error error = {0};
  cav_model *model = cav_model_parse(text, folder, NULL, &error);
  if (!CHECK(!model && error.status == CAV_BAD_INPUT && strstr(error.text, says)))
    fprintf(stderr, "    '%s' lacks '%s'\n", error.text, says);
  cav_model_free(model);
}

static void refuse_draft(cav_draft *draft, const char *says) {
  cav_error error = {0};
  cav_model *model = cav_draft_compile(draft, NULL, NULL, &error);
  if (!CHECK(!model && error.status == CAV_BAD_INPUT && strstr(error.text, says)))
    fprintf(stderr, "    '%s' lacks '%s'\n", error.text, says);
  cav_model_free(model);
  cav_draft_free(draft);
}

static void test_refused(void) {
  refuse_text("", NULL, "text: expected XML");
  refuse_text("<mujoco>\n<worldbody>\n<geom sise='1'/></worldbody></mujoco>", "/there", "/there/text:3: <geom>");
  refuse_text("<mujoco><worldbody>", "/there/", "/there/text");
  refuse_text("<mujoco><include file='none.xml'/></mujoco>", "/there", "/there/none.xml");
  cav_draft *d = cav_draft_new(NULL);
  cav_draft_text(d, cav_draft_add(d, CAV_DRAFT_WORLD, "geom"), "sise", "1");
  refuse_draft(d, "'size'");
  d = cav_draft_new(NULL);
  cav_draft_numbers(d, cav_draft_add(d, CAV_DRAFT_WORLD, "geom"), "size", (double[]){NAN}, 1);
  refuse_draft(d, "size");
  d = cav_draft_new(NULL);
  CHECK(cav_draft_add(d, 17, "geom") == -1 && cav_draft_mjcf(d) == NULL);
  refuse_draft(d, "element 17");
  d = cav_draft_new(NULL);
  cav_draft_text(d, cav_draft_add(d, -1, "body"), "name", "x");
  refuse_draft(d, "element -1");
  d = cav_draft_new(NULL);
  cav_draft_text(d, 0, "model", NULL);
  refuse_draft(d, "'model'");
}

// ---------------------------------------------------------------- postures and terms

static char folder[] = "/tmp/cavort-draft-XXXXXX";

static cav_problem *problem_of(const char *model, const char *inside) {
  char path[300], text[1500];
  cav_error error = {0};
  snprintf(text, sizeof text, "<problem model='%s'><horizon duration='1' timestep='.1'/>%s</problem>", model, inside);
  scene_write(folder, "p.xml", text);
  snprintf(path, sizeof path, "%s/p.xml", folder);
  cav_problem *p = cav_problem_load(path, NULL, &error);
  if (!CHECK(p != NULL)) fprintf(stderr, "    %s\n", error.text);
  unlink(path);
  return p;
}

static const char humanoid[] = CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml";

/// The humanoid knees beyond their range, in the air: as a file brings it down.
static void test_postures(void) {
  const char *start[] = {"<start ranges='clip' height='floor'><joint name='%s' pos='-9'/></start>",
                         "<start ranges='clip' height='floor' rise='.25'><joint name='%s' pos='-9'/></start>",
                         "<start key='stand'/>"};
  cav_error error = {0};
  cav_model *m = cav_model_load(humanoid, &error);
  if (!CHECK(m != NULL)) return;
  int knee = -1;
  for (int j = 0; j < m->njoint && knee < 0; j++)
    if (m->joint[j].limited && m->joint[j].type == CAV_JOINT_HINGE) knee = j;
  cav_state *state = cav_state_new(m);
  double *q = scene_vector(m->nq), rise = 0.25;
  for (int k = 0; k < 3; k++) {
    char inside[300];
    snprintf(inside, sizeof inside, start[k], m->joint[knee].name);
    cav_problem *p = problem_of(humanoid, inside);
    cav_configuration_reset(m, q);
    if (k < 2) {
      q[m->joint[knee].q] = -9;
      CHECK(cav_configuration_clip(m, q) == 1 && q[m->joint[knee].q] == m->joint[knee].range[0]);
      CHECK(cav_configuration_clip(m, q) == 0);
      CHECK(cav_configuration_to_floor(m, state, k ? &rise : NULL, q, &error) == CAV_OK);
    } else {
      CHECK(cav_configuration_stand(m, state, q, &error) == CAV_OK);
    }
    if (p) CHECK_NEAR_ALL(q, p->q_start, m->nq, 0);
    cav_problem_free(p);
  }
  cav_model *none = scene_load("<mujoco><worldbody><body><joint/><geom size='.1'/></body></worldbody></mujoco>");
  cav_state *other = cav_state_new(none);
  CHECK(cav_configuration_to_floor(none, other, NULL, q, &error) == CAV_BAD_INPUT && strstr(error.text, "plane"));
  CHECK(cav_configuration_stand(none, other, q, &error) == CAV_BAD_INPUT && *error.text);
  q[0] = NAN;
  CHECK(cav_configuration_to_floor(none, other, NULL, q, &error) == CAV_NOT_FINITE);
  cav_state_free(state), cav_state_free(other);
  cav_model_free(m), cav_model_free(none);
  free(q);
}

static void same_term(const cav_term *a, const cav_term *b) {
  CHECK(!strcmp(a->name, b->name) && a->quantity == b->quantity && a->use == b->use && a->component == b->component);
  CHECK(a->dofs == b->dofs && a->joint == b->joint && a->from == b->from && a->to == b->to && a->weight == b->weight);
  CHECK(a->norm == b->norm && a->body == b->body && a->scale == b->scale && !a->target == !b->target);
  CHECK(a->nwaypoint == b->nwaypoint && a->within == b->within && a->lower == b->lower && a->upper == b->upper);
  CHECK(a->sensor.type == b->sensor.type && a->sensor.object_type == b->sensor.object_type &&
        a->sensor.object == b->sensor.object && a->sensor.dim == b->sensor.dim && a->sensor.adr == b->sensor.adr &&
        !a->user == !b->user);
}

/// Every quantity, as a cost and as both kinds of constraint.
static void test_terms(void) {
  cav_error error = {0};
  cav_model *m = cav_model_load(humanoid, &error);
  cav_state *state = m ? cav_state_new(m) : NULL;
  if (!CHECK(state != NULL)) return;
  cav_object_type kind = CAV_OBJECT_BODY;
  int foot = cav_object_named(m, state, "nothing | right foot", &kind, &error);
  CHECK(foot >= 0);
  cav_sensor sensor;
  CHECK(cav_sensor_of(m, CAV_SENSOR_FRAMELINVEL, kind, foot, &sensor, &error) == CAV_OK);
  for (cav_quantity k = 0; k < CAV_QUANTITY_USER; k++)
    for (int use = 0; use < 3; use++) {
      const cav_quantity_rule *rule = cav_quantity_rule_of(k);
      int sensed = k == CAV_QUANTITY_SENSOR;
      if (use && !rule->hard) continue;
      char inside[400];
      // a record is read from its frames
      if (k == CAV_QUANTITY_TRACK) continue;
      const char *what = sensed ? " type='framelinvel' body='right foot'" : "", *section = use ? "constraint" : "cost";
      const char *how[] = {" weight='3'", "", " lower='-1' upper='2'"};
      snprintf(inside, sizeof inside, "<start/><%s><%s%s%s/></%s>", section, rule->name, what, how[use], section);
      cav_problem *p = problem_of(humanoid, inside);
      cav_term made = use == 0 ? cav_term_cost(k, 3) : use == 1 ? cav_term_equal(k, NULL) : cav_term_range(k, -1, 2);
      if (sensed) made.sensor = sensor;
      if (p) same_term(&made, &p->term[p->nterm - 1]);
      cav_problem_free(p);
    }
  kind = CAV_OBJECT_JOINT;
  CHECK(cav_object_named(m, state, "right kneee", &kind, &error) == -1 && error.status == CAV_BAD_INPUT);
  CHECK(cav_sensor_of(m, CAV_SENSOR_FRAMEPOS, CAV_OBJECT_JOINT, 0, &sensor, &error) == CAV_BAD_INPUT &&
        strstr(error.text, "site"));
  CHECK(cav_sensor_of(m, CAV_SENSOR_JOINTPOS, CAV_OBJECT_JOINT, 0, &sensor, &error) == CAV_BAD_INPUT &&
        strstr(error.text, "hinge"));
  CHECK(cav_sensor_of(m, CAV_SENSOR_SUBTREECOM, CAV_OBJECT_BODY, m->nbody, &sensor, &error) == CAV_BAD_INPUT);
  CHECK(cav_sensor_of(m, CAV_SENSOR_CLOCK, CAV_OBJECT_BODY, 0, &sensor, &error) == CAV_BAD_INPUT);
  cav_state_free(state);
  cav_model_free(m);
}

int main(void) {
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  test_draft();
  test_parse();
  test_refused();
  test_postures();
  test_terms();
  rmdir(folder);
  return check_result();
}
