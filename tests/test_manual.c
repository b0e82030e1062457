/// problems/manual and the grammar of problem files: nothing that is declared lacks a text, and a default that is told is the
/// one that reading takes: a file that says it and a file that leaves it out give the same problem to the bit.
#include "manual.h"

#include <unistd.h>

#include "cavort/solve.h"
#include "check.h"
#include "ipopt_options.h"
#include "problem_file.h"
#include "quantity.h"

static char folder[] = "/tmp/cavort-manual-XXXXXX";

static const char model[] =
    "<mujoco><worldbody><geom name='floor' type='plane' size='5 5 1'/><body name='box' pos='0 0 1'><freejoint "
    "name='root'/>"
    "<geom name='box' type='box' size='.1 .1 .1'/><body name='right leg' pos='0 -.1 -.1'><joint name='right knee' "
    "axis='0 1 0'/>"
    "<geom name='right leg' type='capsule' fromto='0 0 0 0 0 -.3' size='.04'/></body>"
    "<body name='left leg' pos='0 .1 -.1'><joint name='left knee' axis='0 1 0'/>"
    "<geom name='left leg' type='capsule' fromto='0 0 0 0 0 -.3' size='.04'/></body></body></worldbody>"
    "<actuator><motor joint='right knee' ctrlrange='-9 9'/><motor joint='left knee' ctrlrange='-9 "
    "9'/></actuator></mujoco>";

// files that hold every element; where attributes may be added stands @, the element and the one that holds it
static const char *const base[] = {
    // a motion with an end, with what contradicts a cycle or an arc
    "<problem @problem@ model='model.xml'><horizon @horizon@ duration='0.5' timestep='.05' range='.4 .6'/>"
    "<start @start@ file='motion.csv' height='floor'><root @root@ pos='0 0 1'/><joint @joint@ name='left knee' "
    "pos='.1'/></start>"
    "<goal @goal@ file='motion.csv'/><pose @pose@ name='low' file='motion.csv'/>"
    "<guess @guess@ rotation='0 0 20'><waypoint @guess/waypoint@ time='.25' file='motion.csv'/>"
    "<swing @swing@ joint='left knee' amplitude='.1' frequency='2'/></guess>"
    "<cost><sensor @cost/sensor@ type='framepos' body='box' target='0 0 1' weight='1' at='end'>"
    "</sensor><posture @cost/posture@ weight='1' at='end'/><velocity @cost/velocity@ weight='1' at='end'/>"
    "<acceleration @cost/acceleration@ weight='1' from='.1'/><effort @cost/effort@ weight='1' from='.1'/>"
    "<power @cost/power@ weight='1' from='.1'/><gap @cost/gap@ weight='1' from='.1'/><slip @cost/slip@ weight='1' "
    "from='.1'/>"
    "<impact @cost/impact@ weight='1' from='.1'/><self_penetration @cost/self_penetration@ weight='1' from='.1'/>"
    "<force @cost/force@ weight='1' from='.1'/><edge_force @cost/edge_force@ weight='1' from='.1'/><clearance "
    "@cost/clearance@ weight='1'/><self_force "
    "@cost/self_force@ weight='1' from='.1'/></cost>"
    "<constraint><sensor @constraint/sensor@ type='framepos' body='box' target='0 0 1' at='end'/>"
    "<posture @constraint/posture@ at='end'/>"
    "<velocity @constraint/velocity@ at='end'/><acceleration @constraint/acceleration@ from='.2' "
    "upper='3'/></constraint>"
    "<limits @limits@/><residual @residual@ force='20' torque='5'/><schedule @schedule@><first @first@/><last "
    "@last@/></schedule><ipopt @ipopt@/></problem>",
    // a step, an arc
    "<problem @problem@ model='model.xml'><horizon @horizon@ duration='0.5'/><start @start@/><guess @guess@ "
    "apex='.1'/><cost><track @cost/track@ file='motion.csv' joints='all'/></cost></problem>",
    // a motion on file to follow
    "<problem @problem@ model='model.xml'><horizon duration='.5'/><start/><guess @guess@ file='motion.csv'/></problem>",
    // a gait
    "<problem @problem@ model='model.xml'><horizon duration='.5'/><cycle @cycle@ translation='1 0 "
    "0'/><start/></problem>",
    "<problem @problem@ model='model.xml'><horizon duration='.5'/><cycle @cycle@ rotation='20'/><start/></problem>",
};
enum { BASES = sizeof base / sizeof *base };

static void write_in(const char *name, const char *text) {
  char path[256];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  FILE *file = fopen(path, "w");
  CHECK(file && fputs(text, file) >= 0 && !fclose(file));
}

// a base with text in the place of one mark and nothing in the place of the others; 0: there is no such mark
static int fill(const char *from, const char *mark, const char *text, char *to) {
  int found = 0;
  for (; *from; from++) {
    if (*from != '@') {
      *to++ = *from;
      continue;
    }
    size_t n = strcspn(from + 1, "@");
    if (n == strlen(mark) && !strncmp(from + 1, mark, n)) {
      to += sprintf(to, "%s", text);
      found = 1;
    }
    from += n + 1;
  }
  *to = 0;
  return found;
}

// what is written of the problem that a text says, to be freed; NULL: it cannot be read
static char *meaning(const char *text) {
  char path[256];
  write_in("problem.xml", text);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *problem = cav_problem_load(path, NULL, NULL);
  if (!problem) return NULL;
  snprintf(path, sizeof path, "%s/written.xml", folder);
  CHECK(cav_problem_write(path, problem, NULL, NULL) == CAV_OK);
  cav_problem_free(problem);
  FILE *file = fopen(path, "r");
  char *written = calloc(1, 1 << 20);
  CHECK(file && written && fread(written, 1, (1 << 20) - 1, file) > 0);
  if (file) fclose(file);
  return written;
}

static char filled[16384];

// in how many of the bases an attribute may be given a value, and in all of them to the same problem as without it
static int is_default(const char *mark, const char *attribute, const char *value) {
  char *plain, *said, given[128];
  int agree = 0, differ = 0;
  snprintf(given, sizeof given, "%s='%s'", attribute, value);
  for (int i = 0; i < BASES; i++) {
    if (!fill(base[i], mark, given, filled)) continue;
    said = meaning(filled);
    fill(base[i], "", "", filled);
    plain = meaning(filled);
    if (!CHECK(plain)) fprintf(stderr, "    base %d cannot be read\n", i);
    if (said && plain) *(strcmp(said, plain) ? &differ : &agree) += 1;
    free(said);
    free(plain);
  }
  return differ ? -1 : agree;
}

static void test_defaults(void) {
  cav_manual_place place[CAV_MANUAL_ELEMENTS];
  int n = cav_manual_places(place), tried = 0;
  for (int i = 0; i < n; i++) {
    const cav_xml_element *e = place[i].element;
    for (const cav_xml_attribute *a = e->attribute; a && a->name; a++) {
      if (!a->note->fallback || *a->note->fallback == '(') continue;
      char mark[128];
      snprintf(mark, sizeof mark, "%s/%s", place[i].nparent ? place[i].parent[0]->name : "", e->name);
      int found = is_default(mark, a->name, a->note->fallback);
      if (!found) found = is_default(e->name, a->name, a->note->fallback);
      if (!CHECK(found > 0))
        fprintf(stderr, "    <%s> %s='%s': %s\n", e->name, a->name, a->note->fallback,
                found ? "differs" : "in no base");
      tried++;
    }
  }
  CHECK(tried > 60);
  // what is no default differs
  CHECK(is_default("horizon", "order", "euler") < 0);
  CHECK(is_default("first", "softness", "5") < 0);
}

static int told(const char *text) { return text && *text; }

static void test_texts(void) {
  cav_manual_place place[CAV_MANUAL_ELEMENTS];
  int n = cav_manual_places(place), attributes = 0;
  for (int i = 0; i < n; i++) {
    const cav_xml_element *e = place[i].element;
    CHECK(told(e->text));
    for (const cav_xml_attribute *a = e->attribute; a && a->name; a++, attributes++) {
      if (!CHECK(a->note && told(a->note->text) && a->note->unit && a->required == !a->note->fallback))
        fprintf(stderr, "    <%s> %s\n", e->name, a->name);
    }
    // below a scene MJCF begins
    for (int k = 0; e->child && e->child[k] && strcmp(e->name, "scene"); k++) CHECK(told(e->child[k]->text));
  }
  CHECK(n > 30);
  CHECK(attributes > 300);
  for (cav_quantity k = 0; k < CAV_QUANTITY_TYPES; k++) CHECK(told(cav_quantity_rule_of(k)->text));
  for (cav_sensor_type k = 0; k < CAV_SENSOR_TYPES; k++) CHECK(told(cav_sensor_rule_of(k)->text));
  for (cav_solver k = 0; k < CAV_SOLVER_TYPES; k++) CHECK(told(cav_solver_rule_of(k)->text));
  int rules;
  const cav_ipopt_rule *rule = cav_ipopt_rules(&rules);
  for (int i = 0; i < rules; i++) CHECK(told(rule[i].text));
}

// whatever is declared is found by its name
static void test_names(void) {
  cav_manual_place place[CAV_MANUAL_ELEMENTS];
  int n = cav_manual_places(place);
  FILE *out = fopen("/dev/null", "w");
  CHECK(out);
  for (int i = 0; i < n && out; i++) {
    CHECK(cav_manual_explain(out, place[i].element->name) > 0);
    for (const cav_xml_attribute *a = place[i].element->attribute; a && a->name; a++)
      CHECK(cav_manual_explain(out, a->name) > 0);
  }
  CHECK(cav_manual_explain(out, "framepos") == 1);
  CHECK(cav_manual_explain(out, "nothing") == 0);
  if (out) fclose(out);
  const cav_manual_command command = {.name = "solve"};
  cav_manual manual = {.command = &command, .ncommand = 1};
  manual.topic = cav_manual_topics(&manual.ntopic);
  static const char *const meant[][2] = {{"horzon", "horizon"}, {"solv", "solve"}, {"sensrs", "sensors"}};
  for (int i = 0; i < 3; i++) {
    const char *near = cav_manual_nearest(&manual, meant[i][0]);
    CHECK(near && !strcmp(near, meant[i][1]));
  }
  CHECK(!cav_manual_use_of("") && !cav_manual_use_of("chec") && !cav_manual_use_of("check|validate"));
  CHECK(cav_manual_use_of("check") == cav_manual_use_of("Validate"));
}

static void write_files(void) {
  char path[256];
  write_in("model.xml", model);
  snprintf(path, sizeof path, "%s/model.xml", folder);
  cav_model *m = cav_model_load(path, NULL);
  CHECK(m);
  cav_trajectory *motion = m ? cav_trajectory_new(m, 3, 0.05) : NULL;
  CHECK(motion);
  if (!motion) return;
  // the last knot is none like the first
  motion->q[2 * m->nq + 2] += 0.3;
  snprintf(path, sizeof path, "%s/motion.csv", folder);
  CHECK(cav_trajectory_write(path, m, motion, NULL) == CAV_OK);
  cav_trajectory_free(motion);
  cav_model_free(m);
}

int main(void) {
  CHECK(mkdtemp(folder));
  write_files();
  test_texts();
  test_names();
  test_defaults();
  static const char *const names[] = {"model.xml", "motion.csv", "problem.xml", "written.xml"};
  for (int i = 0; i < 4; i++) {
    char path[256];
    snprintf(path, sizeof path, "%s/%s", folder, names[i]);
    unlink(path);
  }
  rmdir(folder);
  return check_result();
}
