/// Targets of terms from tables: by order and by name, for sensors, one component of a sensor, orientations, rates and
/// postures; as costs and as constraints; between rows; in results as waypoints; and what is wrong with a table, with
/// both files' lines.
#include "cavort/cavort.h"
#include "quantity.h"
#include "scene.h"

static const char model[] =
    "<mujoco><worldbody><body name='arm' pos='0 0 1'><joint name='a' axis='0 1 0'/><geom type='capsule' size='.05' "
    "fromto='0 0 0 0 0 -.3'/><body name='hand' pos='0 0 -.3'><joint name='b' axis='0 1 0'/><geom size='.06'/>"
    "<site name='tip' pos='0 0 -.1'/></body></body></worldbody><actuator><motor joint='a'/><motor "
    "joint='b'/></actuator>"
    "</mujoco>";

static char folder[] = "/tmp/cavort-targets-XXXXXX";

static cav_problem *load(const char *terms, const char *table, cav_error *error) {
  char path[300], text[2000];
  snprintf(text, sizeof text,
           "<problem model='m.xml'>\n<horizon duration='1' timestep='.25'/><start/>\n%s\n</problem>\n", terms);
  scene_write(folder, "m.xml", model);
  scene_write(folder, "p.xml", text);
  scene_write(folder, "t.csv", table);
  snprintf(path, sizeof path, "%s/p.xml", folder);
  return cav_problem_load(path, NULL, error);
}

/// Target of the last term at a time, against that of the problem as a result holds it too.
static void check_target(const cav_problem *p, double time, int dim, const double *wanted) {
  char path[300];
  snprintf(path, sizeof path, "%s/again.xml", folder);
  cav_problem *again = NULL;
  CHECK(cav_problem_write(path, p, NULL, NULL) == CAV_OK && (again = cav_problem_load(path, NULL, NULL)));
  for (int k = 0; k < 2 && again; k++) {
    const cav_problem *of = k ? again : p;
    double target[16];
    cav_term_target(&of->term[of->nterm - 1], time, dim, target);
    for (int i = 0; i < dim; i++) CHECK_NEAR(target[i], wanted[i], 1e-15);
  }
  cav_problem_free(again);
  unlink(path);
}

static void take(const char *terms, const char *table, double time, int dim, const double *wanted) {
  cav_error error = {0};
  cav_problem *p = load(terms, table, &error);
  if (!CHECK(p != NULL)) {
    fprintf(stderr, "    %s\n", error.text);
    return;
  }
  check_target(p, time, dim, wanted);
  cav_problem_free(p);
}

static void refuse(const char *terms, const char *table, int line, const char *says) {
  cav_error error = {0};
  cav_problem *p = load(terms, table, &error);
  if (!CHECK(!p && error.status == CAV_BAD_INPUT && error.line == line && strstr(error.text, says)))
    fprintf(stderr, "    line %d, '%s' lacks '%s'\n", error.line, error.text, says);
  cav_problem_free(p);
}

#define COST(what) "<cost><" what "/></cost>"
#define TIP COST("sensor type='framepos' site='tip' file='t.csv' weight='1'")

/// Norms, and contacts of one body, there and back; they are added to the defaults of their kind.
static void check_norms(void) {
  cav_problem *p =
      load("<cost><force body='hand' weight='2' norm='absolute' scale='.3'/><slip body='hand' weight='7'/></cost>",
           "time\n0\n", NULL);
  if (!CHECK(p != NULL)) return;
  char path[300];
  snprintf(path, sizeof path, "%s/again.xml", folder);
  cav_problem *again = NULL;
  CHECK(cav_problem_write(path, p, NULL, NULL) == CAV_OK && (again = cav_problem_load(path, NULL, NULL)));
  CHECK(p->nterm == cav_problem_default_terms(NULL, 0) + 2 && again && again->nterm == p->nterm);
  for (int k = 0; k < 2 && again; k++) {
    const cav_problem *of = k ? again : p;
    const cav_term *force = &of->term[of->nterm - 2], *slip = force + 1;
    CHECK(force->quantity == CAV_QUANTITY_FORCE && force->norm == CAV_NORM_ABSOLUTE && force->scale == .3 &&
          force->body == cav_object_find(p->model, CAV_OBJECT_BODY, "hand") && force->weight == 2);
    CHECK(slip->quantity == CAV_QUANTITY_SLIP && slip->norm == CAV_NORM_SQUARE && slip->body == force->body);
  }
  cav_problem_free(again);
  cav_problem_free(p);
  unlink(path);
}

int main(void) {
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  take(TIP, "time,x,y,z\n0,1,2,3\n.5,3,2,1\n", .25, 3, (double[]){2, 2, 2});
  take(TIP, "time,x,y,z\n0,1,2,3\n.5,3,2,1\n", .9, 3, (double[]){3, 2, 1});
  take(TIP, "x,y,z,time\n1,2,3,.5\n", 0, 3, (double[]){1, 2, 3});
  take(COST("sensor type='framepos' site='tip' component='z' file='t.csv' columns='height' weight='1'"),
       "time,foot,height\n0,9,1\n1,9,2\n", .5, 3, (double[]){0, 0, 1.5});
  take(COST("sensor type='framequat' body='hand' file='t.csv' weight='1'"), "time,w,x,y,z\n0,2,0,0,0\n", 0, 4,
       (double[]){1, 0, 0, 0});
  take(COST("velocity file='t.csv' columns=' vb | va ' weight='1'"), "time,va,vb\n0,1,2\n", 0, 2, (double[]){2, 1});
  take(COST("velocity joint='b' file='t.csv' weight='1'"), "time,b\n0,1\n1,5\n", .5, 2, (double[]){0, 3});
  take(COST("posture file='t.csv' columns='qpos_a|qpos_b' weight='1'"),
       "time,qpos_a,qpos_b,qvel_a,qvel_b\n0,1,2,7,7\n1,3,4,7,7\n", 1, 2, (double[]){3, 4});
  take("<constraint><sensor type='jointpos' joint='a' file='t.csv'/></constraint>", "time,q\n0,0\n1,1\n", .75, 1,
       (double[]){.75});
  // of a table that is longer than the motion of 1 s
  take(COST("velocity joint='b' file='t.csv' offset='2' weight='1'"), "time,b\n0,9\n2,1\n3,5\n3.1,9\n", .5, 2,
       (double[]){0, 3});
  take(COST("velocity joint='b' file='t.csv' offset='2.5' weight='1'"), "time,b\n0,9\n2,1\n3,5\n3.1,9\n", .25, 2,
       (double[]){0, 5});
  refuse(COST("velocity joint='b' file='t.csv' offset='4' weight='1'"), "time,b\n0,9\n3,5\n", 3, "within the motion");
  refuse(COST("velocity joint='b' offset='4' weight='1'"), "time,b\n0,9\n", 3, "'file'");
  refuse(COST("sensor type='framepos' site='tip' file='none.csv' weight='1'"), "time\n0\n", 3, "none.csv");
  refuse(TIP, "t,x,y,z\n0,1,2,3\n", 3, "t.csv:1: expected a column 'time'");
  refuse(TIP, "time,x,y\n0,1,2\n", 3, "t.csv:1: expected time and 3 columns");
  refuse(TIP, "time,x,y,z\n0,1,2,3\n1.5,1,2,3\n", 3, "t.csv:3: expected a time within the horizon");
  refuse(TIP, "time,x,y,z\n0,1,2,3\n\n0,1,2,3\n", 3, "t.csv:4: expected a time after");
  refuse(TIP, "time,x,y,z\n0,1,2\n", 3, "t.csv:2");
  refuse(TIP, "time,x,y,z\n0,1,nan,2\n", 3, "t.csv:2");
  refuse(TIP, "time,x,y,z\n", 3, "row");
  refuse(COST("sensor type='framepos' site='tip' file='t.csv' columns='x|y|hight' weight='1'"),
         "time,x,y,height\n0,1,2,3\n", 3, "'height'");
  refuse(COST("sensor type='framepos' site='tip' file='t.csv' columns='x|y' weight='1'"), "time,x,y,z\n0,1,2,3\n", 3,
         "3 columns");
  refuse(COST("sensor type='framepos' site='tip' columns='x' weight='1'"), "time\n0\n", 3, "'file'");
  refuse(COST("sensor type='framepos' site='tip' file='t.csv' target='1 2 3' weight='1'"), "time\n0\n", 3, "'target'");
  refuse(COST("posture file='t.csv' qpos='1 2' weight='1'"), "time\n0\n", 3, "<posture>");
  refuse("<cost><velocity file='t.csv' weight='1'><waypoint time='0' target='1'/></velocity></cost>", "time\n0\n", 3,
         "<waypoint>");
  refuse(COST("sensor type='framequat' body='hand' file='t.csv' weight='1'"), "time,w,x,y,z\n0,0,0,0,0\n", 3, "zero");
  check_norms();
  refuse(COST("force body='hamd' weight='1'"), "time\n0\n", 3, "'hand'");
  refuse(COST("slip body='world' weight='1'"), "time\n0\n", 3, "moves");
  refuse(COST("effort norm='cubic' weight='1'"), "time\n0\n", 3, "norm");
  const char *files[] = {"m.xml", "p.xml", "t.csv"};
  for (int i = 0; i < 3; i++) {
    char path[300];
    snprintf(path, sizeof path, "%s/%s", folder, files[i]);
    unlink(path);
  }
  rmdir(folder);
  return check_result();
}
