/// The grammar of problem files: which elements and attributes there are, and the words they take. Their meaning is in
/// problem.c, pose.c and term.c; a table for people is in problems/README.md.
#include "ipopt_options.h"
#include "problem_file.h"
#include "scene.h"

// by the enumerations of problem.h and model.h, NULL behind the last
#define WORD_TEXT(enumerator, word, text) [enumerator] = word,
const char *const cav_problem_orders[] = {CAV_ORDERS(WORD_TEXT) NULL};
const char *const cav_problem_closings[] = {"open", "rest", NULL};
const char *const cav_problem_guesses[] = {
    [CAV_GUESS_HOLD] = "hold", [CAV_GUESS_INTERPOLATE] = "interpolate", [CAV_GUESS_PUMP] = "pump", NULL};
const char *const cav_problem_dof_sets[] = {[CAV_DOFS_ALL] = "all",
                                            [CAV_DOFS_ROOT_LINEAR] = "root_linear",
                                            [CAV_DOFS_ROOT_ANGULAR] = "root_angular",
                                            [CAV_DOFS_JOINTS] = "joints",
                                            NULL};
#define SENSOR_NAME(type, name, ...) [CAV_SENSOR_##type] = name,
static const char *const sensors[CAV_SENSOR_TYPES + 1] = {CAV_SENSORS(SENSOR_NAME)};
const char *const cav_problem_springs[] = {CAV_SPRINGS(WORD_TEXT) NULL};
const char *const cav_problem_stabilisations[] = {CAV_STABILISATIONS(WORD_TEXT) NULL};
const char *const cav_problem_regularisers[] = {CAV_REGULARISERS(WORD_TEXT) NULL};
const char *const cav_problem_slidings[] = {CAV_SLIDINGS(WORD_TEXT) NULL};
const char *const cav_problem_next_gaps[] = {CAV_NEXT_GAPS(WORD_TEXT) NULL};
const char *const cav_problem_norms[] = {[CAV_NORM_SQUARE] = "square", [CAV_NORM_ABSOLUTE] = "absolute", NULL};
const char *const cav_problem_mirrors[] = {
    [CAV_MIRROR_NONE] = "none", [CAV_MIRROR_X] = "x", [CAV_MIRROR_Y] = "y", NULL};
static const char *const heights[] = {"keep", "floor", NULL};
static const char *const clippings[] = {"keep", "clip", NULL};
static const char *const ends[] = {"first", "last", NULL};
static const char *const frames[] = {"body", "xbody", "geom", "site", NULL};
static const char *const relations[] = {"none", "start", "goal", NULL};

// the tables below read as rows
// clang-format off
// name, type, least and most values, words, required
#define TEXT(name, required) \
  { name, CAV_XML_TEXT, 1, 0, NULL, required }
#define REAL(name, required) \
  { name, CAV_XML_REAL, 1, 1, NULL, required }
#define REALS(name, least, most) \
  { name, CAV_XML_REAL, least, most, NULL, 0 }
#define WHOLE(name, required) \
  { name, CAV_XML_INT, 1, 1, NULL, required }
#define WORD(name, words) \
  { name, CAV_XML_WORD, 0, 0, words, 0 }
#define FLAG(name) \
  { name, CAV_XML_BOOL, 0, 0, NULL, 0 }
#define END \
  { NULL, CAV_XML_SKIP, 0, 0, NULL, 0 }
#define ATTRIBUTES(...) \
  (const cav_xml_attribute[]) { __VA_ARGS__, END }
#define CHILDREN(...) \
  (const cav_xml_element *const[]) { __VA_ARGS__, NULL }

// postures
static const cav_xml_element pose_root = {
    "root", 0, 0, ATTRIBUTES(TEXT("joint", 0), REALS("pos", 3, 3), REALS("quat", 4, 4), REALS("euler", 3, 3)), NULL, 0};
static const cav_xml_element pose_joint = {
    "joint", 0, 0, ATTRIBUTES(TEXT("name", 1), REALS("pos", 1, 1), REALS("degrees", 1, 1), REALS("quat", 4, 4)),
    NULL,    0};
#define POSE_SOURCE TEXT("key", 0), REALS("qpos", 1, 0), TEXT("file", 0), WORD("knot", ends), WORD("height", heights), REAL("rise", 0), \
  WORD("ranges", clippings)
static const cav_xml_element start = {
    "start", 1, 1, ATTRIBUTES(POSE_SOURCE, REALS("qvel", 1, 0)), CHILDREN(&pose_root, &pose_joint), 0};
static const cav_xml_element goal = {"goal", 0, 1, ATTRIBUTES(POSE_SOURCE), CHILDREN(&pose_root, &pose_joint), 0};
static const cav_xml_element pose = {
    "pose", 0, 0, ATTRIBUTES(TEXT("name", 1), POSE_SOURCE), CHILDREN(&pose_root, &pose_joint), 0};

// terms: what is measured; when; and as a cost or as a constraint
#define TABLE TEXT("file", 0), TEXT("columns", 0)
#define WINDOW TEXT("name", 0), TEXT("from", 0), TEXT("to", 0), TEXT("at", 0), REAL("scale", 0), TEXT("within", 0)
#define DOFS WORD("dofs", cav_problem_dof_sets), TEXT("joint", 0)
#define RATE_ATTRIBUTES DOFS, TABLE, REALS("target", 1, 0)
#define POSTURE_ATTRIBUTES DOFS, TABLE, TEXT("key", 0), REALS("qpos", 1, 0)
#define SENSOR_ATTRIBUTES \
  WORD("type", sensors), TEXT("body", 0), TEXT("xbody", 0), TEXT("geom", 0), TEXT("site", 0),     \
      TEXT("joint", 0), TEXT("tendon", 0), TEXT("actuator", 0), WORD("reftype", frames), TEXT("refname", 0), \
      TEXT("component", 0), TABLE, REALS("target", 1, 0), WORD("relative", relations)
static const cav_xml_element posture_waypoint = {
    "waypoint", 0, 0, ATTRIBUTES(REAL("time", 1), TEXT("key", 0), REALS("qpos", 1, 0)), NULL, 0};
static const cav_xml_element value_waypoint = {
    "waypoint", 0, 0, ATTRIBUTES(REAL("time", 1), {"target", CAV_XML_REAL, 1, 0, NULL, 1}), NULL, 0};

// attributes and children of a term by what it has values of
#define TERM_SENSOR(use) ATTRIBUTES(SENSOR_ATTRIBUTES, WINDOW, use), CHILDREN(&value_waypoint)
#define TERM_POSTURE(use) ATTRIBUTES(POSTURE_ATTRIBUTES, WINDOW, use), CHILDREN(&posture_waypoint)
#define TERM_RATE(use) ATTRIBUTES(RATE_ATTRIBUTES, WINDOW, use), CHILDREN(&value_waypoint)
#define TERM_ACTUATORS(use) ATTRIBUTES(WINDOW, use), NULL
#define TERM_CONTACTS(use) ATTRIBUTES(TEXT("body", 0), WINDOW, use), NULL

#define COST REAL("weight", 1), WORD("norm", cav_problem_norms)
#define COST_ELEMENT(quantity, element, of, ...) \
  static const cav_xml_element cost_##element = {#element, 0, 0, TERM_##of(COST), 0};
#define COST_CHILD(quantity, element, ...) &cost_##element,
CAV_QUANTITIES(COST_ELEMENT)
static const cav_xml_element cost = {
    "cost", 0, 1, NULL, (const cav_xml_element *const[]){CAV_QUANTITIES(COST_CHILD) NULL}, 0};

#define BOUNDS REAL("lower", 0), REAL("upper", 0)
#define HARD_ELEMENT_0(element, of)
#define HARD_ELEMENT_1(element, of) \
  static const cav_xml_element hard_##element = {#element, 0, 0, TERM_##of(BOUNDS), 0};
#define HARD_CHILD_0(element)
#define HARD_CHILD_1(element) &hard_##element,
#define HARD_ELEMENT(quantity, element, of, reads, hard, ...) HARD_ELEMENT_##hard(element, of)
#define HARD_CHILD(quantity, element, of, reads, hard, ...) HARD_CHILD_##hard(element)
CAV_QUANTITIES(HARD_ELEMENT)
static const cav_xml_element constraint = {
    "constraint", 0, 1, NULL, (const cav_xml_element *const[]){CAV_QUANTITIES(HARD_CHILD) NULL}, 0};

// the rest
static const cav_xml_element horizon = {
    "horizon",
    1,
    1,
    ATTRIBUTES(REAL("duration", 1), REAL("timestep", 0), WORD("order", cav_problem_orders),
               WORD("close", cav_problem_closings), REALS("range", 2, 2), REAL("weight", 0)),
    NULL,
    0};
static const cav_xml_element cycle_pair = {"pair", 0, 0, ATTRIBUTES(TEXT("joint", 1), TEXT("other", 1)), NULL, 0};
static const cav_xml_element cycle = {
    "cycle", 0, 1, ATTRIBUTES(REALS("translation", 3, 3), REAL("rotation", 0), WORD("mirror", cav_problem_mirrors)),
    CHILDREN(&cycle_pair), 0};
static const cav_xml_element swing = {
    "swing", 0, 0, ATTRIBUTES(TEXT("joint", 1), REAL("amplitude", 1), REAL("frequency", 1), REAL("phase", 0)), NULL, 0};
static const cav_xml_element guess_waypoint = {
    "waypoint", 0, 0, ATTRIBUTES(REAL("time", 1), POSE_SOURCE), CHILDREN(&pose_root, &pose_joint), 0};
static const cav_xml_element guess = {
    "guess", 0, 1, ATTRIBUTES(WORD("type", cav_problem_guesses), REAL("apex", 0), REALS("rotation", 3, 3), TEXT("from", 0), TEXT("to", 0), TEXT("file", 0), REAL("offset", 0)),
    CHILDREN(&guess_waypoint, &swing), 0};
static const cav_xml_element limits = {"limits", 0, 1, ATTRIBUTES(REAL("effort", 0), REAL("margin", 0)), NULL, 0};
#define STAGE_REAL(name, ...) REAL(#name, 0),
#define STAGE_WHOLE(name, ...) WHOLE(#name, 0),
#define STAGE (const cav_xml_attribute[]) { CAV_STAGE_OPTIONS(STAGE_REAL, STAGE_WHOLE) END }
static const cav_xml_element schedule_first = {"first", 0, 1, STAGE, NULL, 0};
static const cav_xml_element schedule_last = {"last", 0, 1, STAGE, NULL, 0};
static const cav_xml_element schedule = {
    "schedule", 0, 1, ATTRIBUTES(WHOLE("stages", 0), WORD("sliding", cav_problem_slidings), WORD("next_gap", cav_problem_next_gaps)), CHILDREN(&schedule_first, &schedule_last), 0};
#define IPOPT(name, type, least, most, strict, words) TEXT(#name, 0),
static const cav_xml_element ipopt = {
    "ipopt", 0, 1, (const cav_xml_attribute[]){CAV_IPOPT_OPTIONS(IPOPT) END}, NULL, 0};
#define OPTION_REAL(stage, name, least, most, required, ...) REAL(#name, required),
#define OPTION_WORD(stage, name, ...) WORD(#name, cav_problem_##name##s),
#define OPTION_FLAG(stage, name, ...) FLAG(#name),
static const cav_xml_element contact = {
    "contact", 0, 1, (const cav_xml_attribute[]){CAV_OPTIONS(OPTION_REAL, OPTION_WORD, OPTION_FLAG) END}, NULL, 0};

const cav_xml_element cav_problem_element = {
    "problem",
    1,
    1,
    ATTRIBUTES(TEXT("name", 0), TEXT("model", 0), FLAG("floating")),
    CHILDREN(&cav_scene_element, &horizon, &cycle, &start, &goal, &pose, &guess, &cost, &constraint, &limits, &schedule, &ipopt,
             &contact),
    0};

// names of earlier versions
#define FORMER_CHILD(inside, was, now) { inside, was, now, 0 }
#define FORMER_ATTRIBUTE(inside, was, now) { inside, was, now, 1 }
const cav_xml_former cav_problem_former[] = {
    FORMER_CHILD("scene", "leave", "remove"),
    FORMER_CHILD("cost", "overlap", "self_penetration"),
    FORMER_ATTRIBUTE("cycle", "turn", "rotation"),
    FORMER_ATTRIBUTE("guess", "turn", "rotation"),
    FORMER_ATTRIBUTE("first", "self_share", "self_stiffness"),
    FORMER_ATTRIBUTE("last", "self_share", "self_stiffness"),
    FORMER_ATTRIBUTE("contact", "self_share", "self_stiffness"),
    FORMER_ATTRIBUTE("contact", "guard", "refsafe"),
    {NULL, NULL, NULL, 0}};
// clang-format on
