/// The grammar of problem files: which elements and attributes there are, and the words they take. Their meaning is in
/// problem.c, pose.c and term.c; a table for people is in problems/README.md.
#include "ipopt_options.h"
#include "problem_file.h"
#include "quantity.h"
#include "scene.h"

// by the enumerations of problem.h and model.h, NULL behind the last
#define WORD_TEXT(enumerator, word, text) [enumerator] = word,
const char *const cav_problem_orders[] = {CAV_ORDERS(WORD_TEXT) NULL};
const char *const cav_problem_closings[] = {"open", "rest", NULL};
const char *const cav_problem_guesses[] = {
    [CAV_GUESS_HOLD] = "hold", [CAV_GUESS_INTERPOLATE] = "interpolate", [CAV_GUESS_PUMP] = "pump", NULL};
const char *const cav_problem_dof_sets[] = {
    [CAV_DOFS_ALL] = "all",       [CAV_DOFS_ROOT_LINEAR] = "root_linear", [CAV_DOFS_ROOT_ANGULAR] = "root_angular",
    [CAV_DOFS_JOINTS] = "joints", [CAV_DOFS_DRIVEN] = "driven",           NULL};
#define SENSOR_NAME(type, name, ...) [CAV_SENSOR_##type] = name,
static const char *const sensors[CAV_SENSOR_TYPES + 1] = {CAV_SENSORS(SENSOR_NAME)};
const char *const cav_problem_springs[] = {CAV_SPRINGS(WORD_TEXT) NULL};
const char *const cav_problem_stabilisations[] = {CAV_STABILISATIONS(WORD_TEXT) NULL};
const char *const cav_problem_regularisers[] = {CAV_REGULARISERS(WORD_TEXT) NULL};
const char *const cav_problem_slidings[] = {CAV_SLIDINGS(WORD_TEXT) NULL};
const char *const cav_problem_next_gaps[] = {CAV_NEXT_GAPS(WORD_TEXT) NULL};
const char *const cav_problem_next_slips[] = {CAV_NEXT_SLIPS(WORD_TEXT) NULL};
const char *const cav_problem_solids[] = {CAV_SOLIDS(WORD_TEXT) NULL};
const char *const cav_problem_norms[] = {[CAV_NORM_SQUARE] = "square", [CAV_NORM_ABSOLUTE] = "absolute", NULL};
#define STYLE_WORD(style, word, text) [CAV_STYLE_##style] = word,
const char *const cav_problem_styles[] = {CAV_STYLES(STYLE_WORD) NULL};
const char *const cav_problem_mirrors[] = {
    [CAV_MIRROR_NONE] = "none", [CAV_MIRROR_X] = "x", [CAV_MIRROR_Y] = "y", NULL};
static const char *const heights[] = {"keep", "floor", NULL};
static const char *const clippings[] = {"keep", "clip", NULL};
static const char *const rates[] = {"rest", "file", NULL};
static const char *const ends[] = {"first", "last", NULL};
static const char *const frames[] = {"body", "xbody", "geom", "site", NULL};
static const char *const relations[] = {"none", "start", "goal", NULL};
#define PARAMETER_NAME(kind, name, ...) [CAV_PARAMETER_##kind] = name,
static const char *const parameters[CAV_PARAMETER_KINDS + 1] = {CAV_PARAMETERS(PARAMETER_NAME)};

// the tables below read as rows
// clang-format off
// name, type, least and most values, words, required; unit, what holds where it is left out (in parentheses: in words),
// meaning
#define NOTE(unit, fallback, text) &(const cav_xml_note) { unit, fallback, text }
#define TEXT(name, fallback, text) \
  { name, CAV_XML_TEXT, 1, 0, NULL, 0, NOTE("", fallback, text) }
#define NEEDED(name, text) \
  { name, CAV_XML_TEXT, 1, 0, NULL, 1, NOTE("", NULL, text) }
#define REAL(name, required, unit, fallback, text) \
  { name, CAV_XML_REAL, 1, 1, NULL, required, NOTE(unit, fallback, text) }
#define REALS(name, least, most, unit, fallback, text) \
  { name, CAV_XML_REAL, least, most, NULL, 0, NOTE(unit, fallback, text) }
#define WHOLE(name, fallback, text) \
  { name, CAV_XML_INT, 1, 1, NULL, 0, NOTE("", fallback, text) }
#define WORD(name, words, fallback, text) \
  { name, CAV_XML_WORD, 0, 0, words, 0, NOTE("", fallback, text) }
#define FLAG(name, fallback, text) \
  { name, CAV_XML_BOOL, 0, 0, NULL, 0, NOTE("", fallback, text) }
#define END \
  { NULL, CAV_XML_SKIP, 0, 0, NULL, 0, NULL }
#define ATTRIBUTES(...) \
  (const cav_xml_attribute[]) { __VA_ARGS__, END }
#define CHILDREN(...) \
  (const cav_xml_element *const[]) { __VA_ARGS__, NULL }

// postures
#define ROOT_PLACE                                                                                                     \
  TEXT("joint", "(the first free joint)", "free joint that is placed"),                                                \
  REALS("pos", 2, 3, "m", "(as it was)", "position in the world: z is up, of most robots +x forwards and +y to the left; x and y alone leave the height"),                                                   \
  REALS("quat", 4, 4, "", "(as it was)", "orientation as a quaternion w x y z, brought to unit length"),               \
  REALS("euler", 3, 3, "degrees", "(as it was)", "orientation by rotations about x, then the new y, then the new z, each right-handed: 0 0 90 is turned to the left"), \
  REALS("turn", 1, 1, "degrees", "0", "turned so far about the vertical through its origin, after all else, positive to the left: the posture stays as it is"), \
  WORD("height", heights, "floor", "keep: height=\"floor\" of the posture leaves it where it is, as a ball in the air")
#define JOINT_PLACE(one)                                                                                               \
  NEEDED("name", "joint that is set"), REALS("pos", 1, 1, "rad or m", one, "angle of a hinge, distance of a slide"),   \
  REALS("degrees", 1, 1, "degrees", one, "angle of a hinge"),                                                          \
  REALS("quat", 4, 4, "", one, "orientation of a ball joint, w x y z")
static const cav_xml_element pose_root = {
    "root", 0, 0, ATTRIBUTES(ROOT_PLACE), NULL, 0, "places a free joint: position and orientation of what floats"};
static const cav_xml_element pose_joint = {
    "joint", 0, 0, ATTRIBUTES(JOINT_PLACE("(give exactly one of pos, degrees, quat)")), NULL, 0, "sets one joint"};
static const cav_xml_element start_root = {
    "root", 0, 0,
    ATTRIBUTES(
        ROOT_PLACE, REALS("linvel", 3, 3, "m/s", "(0 0 0)", "velocity at the start, along the axes of the world"),
        REALS("angvel", 3, 3, "rad/s", "(0 0 0)", "angular velocity at the start, about the axes of the world")),
    NULL, 0, "places a free joint, and says how it moves: position, orientation and velocity of what floats"};
static const cav_xml_element start_joint = {
    "joint", 0, 0,
    ATTRIBUTES(
        JOINT_PLACE("(give one of pos, degrees, quat, or vel alone)"),
        REALS("vel", 1, 1, "rad/s or m/s", "(0)", "velocity of a hinge or a slide at the start")),
    NULL, 0, "sets one joint"};
#define POSE_SOURCE                                                                                                    \
  TEXT("key", "(the model's own configuration)", "keyframe of the model or else <pose> of this file to begin with; \"stand\", \"kneel\", \"sit\", \"lie-back\" and more are found of any humanoid (help postures). <joint> and <root> inside lie over it: one leg lifted, say"), \
  REALS("qpos", 1, 0, "rad or m", "(the model's own configuration)", "all nq coordinates to begin with, in MuJoCo's layout"), \
  TEXT("file", "(the model's own configuration)", "trajectory.csv to take a knot of, relative to this file"),          \
  WORD("knot", ends, "last", "knot of that file"),                                                                     \
  WORD("height", heights, "keep", "floor: each tree that is free or slides upright is raised or lowered until it stands: on a plane, on what stands in the way down, or on the solid that it begins inside with its centre over that; a thing also on a robot"), \
  REAL("rise", 0, "m", "(0; see height)", "with height=\"floor\": so far above the plane, whatever lies between"), \
  WORD("ranges", clippings, "keep", "clip: joints are brought into their ranges first, and tendons")
static const cav_xml_element start = {
    "start", 1, 1,
    ATTRIBUTES(
        POSE_SOURCE, REALS("qvel", 1, 0, "rad/s or m/s", "(zeros)", "velocity at the start (of the step that leads to it): a number a dof, in the order of the joints of the model and then of the <scene> (inspect --all lists them); a free joint has 3 in m/s along the world's axes and then 3 in rad/s about its body's own, a ball joint 3 in rad/s about its own"),
        WORD("velocity", rates, "rest", "file: the velocity at that knot of the file is the start's, too"),
        FLAG("free", "false", "posture and velocity at the start are found too: what stands here is where the guess starts")),
    CHILDREN(&start_root, &start_joint), 0, "posture and velocity that the motion begins with"};
static const cav_xml_element goal = {
    "goal", 0, 1, ATTRIBUTES(POSE_SOURCE), CHILDREN(&pose_root, &pose_joint), 0,
    "posture that the guess leads to and that <posture> terms have as their target; without it the start"};
static const cav_xml_element pose = {
    "pose", 0, 0, ATTRIBUTES(NEEDED("name", "name by which key= finds it"), POSE_SOURCE), CHILDREN(&pose_root, &pose_joint), 0,
    "a posture with a name, where the model has no keyframe of it"};

// terms: what is measured; when; and as a cost or as a constraint
#define TABLE                                                                                                          \
  TEXT("file", "(no table)", "CSV table of targets, linear between its times: column time in s, then one for each number of a target"), \
  TEXT("columns", "(all, in the order of the target)", "columns of that table to take, separated by |"), \
  REAL("offset", 0, "s", "(0: all rows are of the motion)", "time of that table at which the motion begins; rows before it and after the motion's end are passed over")
#define WINDOW                                                                                                         \
  TEXT("name", "(the element's name)", "name in logs and tables; of a <sensor> without type= the name of a sensor of the model"), \
  TEXT("from", "(0)", "begin of the window, s or \"end\""),                                                            \
  TEXT("to", "(end)", "end of the window, s or \"end\""),                                                              \
  TEXT("at", "(the window)", "one time in the place of a window, s or \"end\": the nearest knot"),                     \
  REAL("scale", 0, "of the term", "1", "residuals are divided by it: the size of an error that counts as one")
#define WITHIN                                                                                                         \
  TEXT("within", "(0.03 m, 0.1 rad, 0.3 m/s or rad/s, 0.1 of an axis for goals; none for running costs)",              \
       "tolerance of the target, in the unit of the term, over the whole horizon too: the motion has achieved it if off by at most this, of a vector by its length, of a posture or a rate at each dof; \"any\": reported only")
// what has no target has no tolerance; slip lets slide
#define WITHIN_gap
#define WITHIN_slip TEXT("within", "(0: they are not to slide)", "m/s: so fast these contacts may slide; \"any\": as fast as they like. Of a body that no actuator moves only those with others such and with the ground: a hand or a finger that may slide on it is named by its own body"),
#define WITHIN_impact
#define WITHIN_clearance
#define WITHIN_self_penetration
#define WITHIN_force
#define WITHIN_edge_force
#define WITHIN_self_force
#define DOFS                                                                                                           \
  WORD("dofs", cav_problem_dof_sets, "joints", "dofs that count, of things of the scene, too: joints are all but free joints, driven those of them in trees that an actuator moves, root_linear and root_angular the translations and rotations of all free joints"),  \
  TEXT("joint", "(dofs)", "one joint in the place of a set of dofs; a cost of it over the whole motion takes the place of the default costs of its kind, which are of all joints")
#define RATE_ATTRIBUTES                                                                                                \
  DOFS, TABLE, REALS("target", 1, 0, "of the term", "(0)", "wanted rate: one number, or one for each selected dof")
#define POSTURE_ATTRIBUTES                                                                                             \
  DOFS, TABLE, TEXT("key", "(the goal)", "wanted posture: keyframe of the model or <pose> of this file, as <pose name=\"one leg\" key=\"stand\"> with the <joint>s of the lifted leg inside"),              \
  REALS("qpos", 1, 0, "rad or m", "(the goal)", "wanted posture: all nq coordinates, or of one hinge or slide its number"), \
  REALS("degrees", 1, 1, "degrees", "(the goal)", "wanted angle of the one hinge that joint= names")
#define ONE_OBJECT "(give exactly one of body, xbody, geom, site, joint, tendon, actuator)"
#define SENSOR_SOURCE                                                                                              \
  WORD("type", sensors, "(the sensor of the model by that name)", "what is read, by MJCF's names"),                    \
  TEXT("body", ONE_OBJECT, "object: frame at the centre of mass of a body, along its principal axes of inertia, which may be turned from its own: directions and orientations are those of xbody; roles such as \"right foot\" stand for bodies"), \
  TEXT("xbody", ONE_OBJECT, "object: frame of a body as the model's file writes it; roles, too"),                          \
  TEXT("geom", ONE_OBJECT, "object: a geom"), TEXT("site", ONE_OBJECT, "object: a site"),              \
  TEXT("joint", ONE_OBJECT, "object: a joint"), TEXT("tendon", ONE_OBJECT, "object: a tendon"),        \
  TEXT("actuator", ONE_OBJECT, "object: an actuator"),                                                         \
  WORD("reftype", frames, "(the world)", "kind of the frame that a position, velocity or orientation is read in"),     \
  TEXT("refname", "(the world)", "name of that frame"),                                                                \
  TEXT("component", "(all)", "x, y or z: the one value that counts")
#define SENSOR_ATTRIBUTES                                                                                              \
  SENSOR_SOURCE, TABLE,                                                                                                \
  REALS("target", 1, 0, "of the sensor",                                                                               \
        "(0; the unit quaternion; none for places in the world and directions unless relative)",                       \
        "wanted reading: all values, or that of the component"),                                                       \
  WORD("relative", relations, "none", "the target is counted from the reading at the start or the goal posture")
#define ONE_POSTURE "(give exactly one of key, qpos, degrees)"
static const cav_xml_element posture_waypoint = {
    "waypoint", 0, 0,
    ATTRIBUTES(
        REAL("time", 1, "s", NULL, "when"), TEXT("key", ONE_POSTURE, "posture wanted then: a keyframe or a <pose>"),
        REALS("qpos", 1, 0, "rad or m", ONE_POSTURE, "posture wanted then, as numbers"),
        REALS("degrees", 1, 1, "degrees", ONE_POSTURE, "angle of the one hinge wanted then")),
    NULL, 0, "target of a <posture> at a time, linear between such times"};
static const cav_xml_element value_waypoint = {
    "waypoint", 0, 0,
    ATTRIBUTES(
        REAL("time", 1, "s", NULL, "when"),
        {"target", CAV_XML_REAL, 1, 0, NULL, 1, NOTE("of the term", NULL, "value wanted then")}),
    NULL, 0, "target of a term at a time, linear between such times"};

// records
#define CHANNEL_COLUMNS TEXT("columns", "(those of its name)", "columns of the table that it has, separated by |")
static const cav_xml_element track_marker = {
    "marker", 0, 0,
    ATTRIBUTES(
        NEEDED("name", "name of the marker in the record"),
        TEXT("body", "(as the marker set has it)", "body that it sits on: of the model, or a role such as \"right foot\""),
        REALS("pos", 3, 3, "m", "(as the marker set has it)", "position on the body, in its frame"),
        REALS("sd", 1, 1, "m", "(that of the track)", "standard deviation of its noise")),
    NULL, 0, "a marker of its own, or the noise of one of the marker set"};
static const cav_xml_element track_joint = {
    "joint", 0, 0,
    ATTRIBUTES(
        NEEDED("name", "joint of the model"), CHANNEL_COLUMNS,
        REALS("sd", 1, 2, "rad or m", "(that of the track)", "standard deviation of its noise; of a free joint of its place, m, and of its orientation, rad")),
    NULL, 0, "a joint whose coordinates are recorded; orientations as quaternions w x y z"};
static const cav_xml_element track_sensor = {
    "sensor", 0, 0,
    ATTRIBUTES(
        TEXT("name", "(none)", "name of its columns; without type= a sensor of the model"), SENSOR_SOURCE, CHANNEL_COLUMNS,
        REALS("sd", 1, 1, "of the sensor", "(that of the track)", "standard deviation of its noise")),
    NULL, 0, "a sensor whose readings are recorded"};
static const cav_xml_element track_frame = {
    "frame", 0, 0,
    ATTRIBUTES(
        REAL("time", 1, "s", NULL, "when, in the time of the record"),
        {"value", CAV_XML_REAL, 1, 0, NULL, 1, NOTE("of the channels", NULL, "numbers of all markers, then joints, then sensors of the <track>")},
        {"unseen", CAV_XML_INT, 1, 0, NULL, 0, NOTE("", "(none)", "which of these numbers, counted from 0, were not recorded")}),
    NULL, 0, "one frame of a record that stands in the problem file"};
#define TRACK_ATTRIBUTES                                                                                               \
  TEXT("file", "(<frame>)", "the record: a clip of markers (.trc, .c3d, .bvh, .csv, .xml) or a CSV table with a column time; empty cells were not recorded"), \
  TEXT("markers", "(none)", "marker set: which marker of the record sits where, as for cavort ik"),                    \
  TEXT("joints", "(none)", "joints separated by |, or \"all\" that the table has: columns NAME or qpos_NAME, with _0, _1 ... where there are several"), \
  TEXT("sensors", "(none)", "sensors of the model separated by |, or \"all\" that the table has: columns NAME, or NAME_x, NAME_y, NAME_z"), \
  REALS("sd", 1, 2, "of the channel", "(0.01 m, 0.05 rad)", "standard deviation of the noise; two numbers: of lengths in m and of angles in rad"), \
  REAL("offset", 0, "s", "0", "time of the record at which the motion begins"),                                        \
  REAL("gap", 0, "s", "(a step, or 1.5 intervals)", "longest time between frames of a column that is bridged; longer ones are compared with nothing"), \
  REAL("interval", 0, "s", "(as the record has it)", "mean time from frame to frame")
#define TRACK_COST                                                                                                     \
  REAL("weight", 0, "1/s", "(frames a second of the record, so that each counts once; 1 with at=)", "the cost is weight/2 times the squares of differences over their sd, integrated over the window in s"), \
  WORD("norm", cav_problem_norms, "square", "square: x^2/2 of each residual x; absolute: sqrt(1 + x^2) - 1, linear far beyond the noise")

// attributes and children of a term by what it has values of
#define TERM_TRACK(use, element)                                                                                       \
  ATTRIBUTES(TRACK_ATTRIBUTES, WINDOW, TRACK_COST), CHILDREN(&track_marker, &track_joint, &track_sensor, &track_frame)
#define TERM_SENSOR(use, element) ATTRIBUTES(SENSOR_ATTRIBUTES, WINDOW, WITHIN, use), CHILDREN(&value_waypoint)
#define TERM_POSTURE(use, element) ATTRIBUTES(POSTURE_ATTRIBUTES, WINDOW, WITHIN, use), CHILDREN(&posture_waypoint)
#define TERM_RATE(use, element) ATTRIBUTES(RATE_ATTRIBUTES, WINDOW, WITHIN, use), CHILDREN(&value_waypoint)
#define TERM_ACTUATORS(use, element) ATTRIBUTES(WINDOW, WITHIN, use), NULL
#define TERM_CONTACTS(use, element) ATTRIBUTES(TEXT("body", "(all contacts)", "contacts of this body's link alone; such a term is added to the default one. Of force also a body that is fixed to the world: what should not be touched"), WINDOW, WITHIN_##element use), NULL

#define COST                                                                                                           \
  REAL("weight", 1, "", NULL, "the cost is weight/2 times the squared residual, integrated over the window in s, or at one knot as it is; goals usually take 500 to 5000, costs over the motion 0.01 to 10, of contacts more; 0 removes a default; at most 1e16"), \
  WORD("norm", cav_problem_norms, "square", "square: x^2/2 of each residual x; absolute: sqrt(1 + x^2) - 1, linear far beyond the scale")
#define COST_ELEMENT(quantity, element, of, reads, hard, unit, words, text) \
  static const cav_xml_element cost_##element = {#element, 0, 0, TERM_##of(COST, element), 0, text};
#define COST_CHILD(quantity, element, ...) &cost_##element,
CAV_QUANTITIES(COST_ELEMENT)
static const cav_xml_element cost_style = {
    "style", 0, 1, ATTRIBUTES({"name", CAV_XML_WORD, 0, 0, cav_problem_styles, 1, NOTE("", NULL, "careful: slow changes of speed, soft landings, little force; athletic: free limbs and speed, less effort")}),
    NULL, 0, "a ready set of running costs in the place of defaults; what the file says of a cost comes before it"};
static const cav_xml_element cost = {
    "cost", 0, 1, NULL, (const cav_xml_element *const[]){&cost_style, CAV_QUANTITIES(COST_CHILD) NULL}, 0, "terms that are minimised"};

#define BOUNDS                                                                                                         \
  REAL("lower", 0, "of the term", "(open)", "least value, of postures and what has a target from that on; without either bound the value equals its target, or with within= each component stays so near it"), \
  REAL("upper", 0, "of the term", "(open)", "greatest value, likewise")
#define HARD_ELEMENT_0(element, of, text)
#define HARD_ELEMENT_1(element, of, text) \
  static const cav_xml_element hard_##element = {#element, 0, 0, TERM_##of(BOUNDS, element), 0, text};
#define HARD_CHILD_0(element)
#define HARD_CHILD_1(element) &hard_##element,
#define HARD_ELEMENT(quantity, element, of, reads, hard, unit, words, text) HARD_ELEMENT_##hard(element, of, text)
#define HARD_CHILD(quantity, element, of, reads, hard, ...) HARD_CHILD_##hard(element)
CAV_QUANTITIES(HARD_ELEMENT)
static const cav_xml_element constraint = {
    "constraint", 0, 1, NULL, (const cav_xml_element *const[]){CAV_QUANTITIES(HARD_CHILD) NULL}, 0, "terms that have to hold"};

// the rest
static const cav_xml_element horizon = {
    "horizon", 1, 1,
    ATTRIBUTES(
        REAL("duration", 1, "s", NULL, "length of the motion, a whole number of steps"),
        REAL("timestep", 0, "s", "0.025", "time between knots"),
        WORD("order", cav_problem_orders, "midpoint", "where in a step bias forces are taken; momentum: exact in flight"),
        WORD("close", cav_problem_closings, "rest", "rest: at rest after the last knot, with forces there; open: no forces at the last knot"),
        REALS("range", 2, 2, "s", "(fixed duration)", "shortest and longest duration: the solver finds it, times of windows scale with it"),
        REAL("window", 0, "s", "(all at once)", "a long motion is solved by windows of that length, one after the other: linear in time, with the memory of one"),
        REAL("overlap", 0, "s", "(a third of the window)", "how far a window looks ahead; the next one solves that part again"),
        REAL("weight", 0, "", "0", "cost of a free duration: weight/2 times its square in s^2")),
    NULL, 0, "duration, time step and the order of the integrator"};
static const cav_xml_element cycle_pair = {
    "pair", 0, 0, ATTRIBUTES(NEEDED("joint", "a joint"), NEEDED("other", "its counterpart on the other side")), NULL, 0,
    "counterparts under the mirror, where names (left and right, l and r) do not tell"};
static const cav_xml_element cycle = {
    "cycle", 0, 1,
    ATTRIBUTES(
        REALS("translation", 3, 3, "m", "0 0 0", "way from one period to the next"),
        REAL("rotation", 0, "degrees", "0", "rotation about the vertical from one period to the next"),
        WORD("mirror", cav_problem_mirrors, "none", "axis that is reflected: the horizon is half a stride, the other half has left and right exchanged")),
    CHILDREN(&cycle_pair), 0, "the end is the start, moved: a gait; start is where the guess begins"};
static const cav_xml_element swing = {
    "swing", 0, 0,
    ATTRIBUTES(
        NEEDED("joint", "hinge or slide that swings"), REAL("amplitude", 1, "rad or m", NULL, "half of the way back and forth"),
        REAL("frequency", 1, "Hz", NULL, "swings in a second"), REAL("phase", 0, "degrees", "0", "phase at the start")),
    NULL, 0, "sine laid over one joint of the guess, within its range, fading in and out"};
static const cav_xml_element guess_waypoint = {
    "waypoint", 0, 0, ATTRIBUTES(REAL("time", 1, "s", NULL, "when, after 0; at the end it stands in the place of the goal"), POSE_SOURCE),
    CHILDREN(&pose_root, &pose_joint), 0, "posture that the guess passes, linear in time between such postures"};
static const cav_xml_element guess = {
    "guess", 0, 1,
    ATTRIBUTES(
        WORD("type", cav_problem_guesses, "interpolate", "interpolate: from start to goal; hold: the start; pump: a swing-up found by simulation"),
        REAL("apex", 0, "m", "0", "height of a ballistic arc that is added between from and to"),
        REALS("bow", 2, 2, "m", "0 0", "how far the first free joint goes round along x and y, by a half sine between from and to: round a post"),
        REALS("rotation", 3, 3, "degrees", "0 0 0", "rotation of the first free joint between from and to, as a rotation vector"),
        TEXT("from", "0", "begin of arc, bow and rotation, s or \"end\""), TEXT("to", "end", "end of them, s or \"end\""),
        FLAG("ground", "false", "each knot between start and goal is raised or lowered onto what is below it, so high as these: over ramps, steps and terrain"),
        TEXT("file", "(none)", "motion to follow: a trajectory.csv of the same model, such as ik and solve write; its first posture where the start is free, its last where there is no <goal>"),
        REAL("offset", 0, "s", "0", "time of that motion at which the guess begins")),
    CHILDREN(&guess_waypoint, &swing), 0, "motion that the solver starts from; it obeys nothing yet"};
static const cav_xml_element limits = {
    "limits", 0, 1,
    ATTRIBUTES(
        REAL("effort", 0, "", "0.8", "fraction of the actuators' limits to plan with, the rest is for feedback; of a servo whose force is limited, of that alone"),
        REAL("margin", 0, "rad or m", "0.001", "distance kept from the limits of joints and tendons, and from the depth that stops of joints without an actuator may give")),
    NULL, 0, "reserve that a plan keeps from limits"};
static const cav_xml_element residual = {
    "residual", 0, 1,
    ATTRIBUTES(
        REAL("force", 0, "N", "(zero force)", "deviation: half of the integral of (force/deviation)^2 over time, in s, is a cost"),
        REAL("torque", 0, "N m", "(zero torque)", "deviation of torques, likewise"),
        REAL("within", 0, "of weight", "0.05", "largest residual that a certificate allows at any knot; torques count over 0.3 m times the weight")),
    NULL, 0, "forces and torques on roots that nothing in the model gives, at a cost instead of zero: for records that the model cannot follow"};
static const cav_xml_element parameter = {
    "parameter", 0, 0,
    ATTRIBUTES(
        {"type", CAV_XML_WORD, 0, 0, parameters, 1, NOTE("", NULL, "what is not known: of a body its mass, a coordinate of its centre of mass (com), its inertia; friction of a geom; stiffness, damping, armature of a joint; a coordinate of the place of a site")},
        TEXT("name", "(\"mass of BODY\" and the like)", "name in tables"),
        TEXT("body", "(give the one that the type is of)", "body of a mass, com or inertia; roles such as \"right foot\" stand for bodies"),
        TEXT("geom", "(give the one that the type is of)", "geom of a friction, of all its contacts"),
        TEXT("joint", "(give the one that the type is of)", "joint of a stiffness, damping or armature"),
        TEXT("site", "(give the one that the type is of)", "site of a place: a marker, recorded as <sensor type=\"framepos\" site=>, an IMU"),
        TEXT("component", "(of com and place alone)", "x, y or z: which coordinate, in the frame of the body"),
        REAL("value", 0, "of the parameter", "(the model's)", "where the search begins; in result folders what was found, which the model then has"),
        REAL("sd", 0, "of the parameter", "(nothing is known)", "standard deviation of what is known beforehand: a cost of half the squared difference from 'prior' over it"),
        REAL("prior", 0, "of the parameter", "(value)", "mean of what is known beforehand, with 'sd'"),
        REAL("lower", 0, "of the parameter", "(open)", "least value that it may have"),
        REAL("upper", 0, "of the parameter", "(open)", "greatest value that it may have")),
    NULL, 0, "a number of the model that is found with the motion, from its records"};
#define STAGE_REAL_first(name, first, last, least, most, course, law, unit, text) REAL(#name, 0, unit, #first, text),
#define STAGE_WHOLE_first(name, first, last, least, most, text) WHOLE(#name, #first, text),
#define STAGE_REAL_last(name, first, last, least, most, course, law, unit, text) REAL(#name, 0, unit, #last, text),
#define STAGE_WHOLE_last(name, first, last, least, most, text) WHOLE(#name, #last, text),
#define STAGE(end) (const cav_xml_attribute[]) { CAV_STAGE_OPTIONS(STAGE_REAL_##end, STAGE_WHOLE_##end) END }
static const cav_xml_element schedule_first = {"first", 0, 1, STAGE(first), NULL, 0, "values of the first stage: soft and blurred, easy to solve"};
static const cav_xml_element schedule_last = {"last", 0, 1, STAGE(last), NULL, 0, "values of the last stage: the contact law that the motion is certified under"};
static const cav_xml_element schedule = {
    "schedule", 0, 1,
    ATTRIBUTES(
        WHOLE("stages", "16", "number of stages, geometric from first to last"),
        WORD("sliding", cav_problem_slidings, "coulomb", "law of contacts that slide, from three quarters of the stages on"),
        WORD("next_gap", cav_problem_next_gaps, "linear", "gap after a step that contacts see, from half of the stages on"),
        WORD("next_slip", cav_problem_next_slips, "linear", "slip over a step that contacts see, from half of the stages on"),
        REAL("optimality", 0, "", "(8e-4)", "the solve ends where steps gain slowly and one may save no more than this fraction of the cost; 0: the default"),
        WORD("solids", cav_problem_solids, "hard", "how the world begins: grow where the guess runs into solids"),
        FLAG("kinematics", "false", "before the first stage the guess goes to where it meets its targets by inverse kinematics over all knots, whatever forces that takes"),
        FLAG("calm", "false", "costs on the turning of roots over the motion weigh 40 times as much at first, down to 4 times before the last stage: a way that is found so keeps the trunk still"),
        FLAG("light_avoided", "false", "costs on forces of bodies of the world, which are to be avoided, grow from three tenths over the stages: soft contacts press from afar")),
    CHILDREN(&schedule_first, &schedule_last), 0, "continuation from soft, blurred contacts to hard, sharp ones"};
#define IPOPT(name, type, least, most, strict, words, text) TEXT(#name, "(Ipopt's own, or what the stages set)", text),
static const cav_xml_element ipopt = {
    "ipopt", 0, 1, (const cav_xml_attribute[]){CAV_IPOPT_OPTIONS(IPOPT) END}, NULL, 0,
    "options for --solver ipopt and both; --ipopt NAME=VALUE on the command line takes precedence"};
#define OPTION_REAL(stage, name, least, most, required, unit, text) REAL(#name, required, unit, required ? NULL : "(the model's)", text),
#define OPTION_WORD(stage, name, type, words, text) WORD(#name, cav_problem_##name##s, "(the model's)", text),
#define OPTION_FLAG(stage, name, text) FLAG(#name, "(the model's)", text),
static const cav_xml_element contact = {
    "contact", 0, 1, (const cav_xml_attribute[]){CAV_OPTIONS(OPTION_REAL, OPTION_WORD, OPTION_FLAG) END}, NULL, 0,
    "in result folders alone: the contact law that the recorded motion obeys"};

const cav_xml_element cav_problem_element = {
    "problem",
    1,
    1,
    ATTRIBUTES(
        TEXT("name", "(the file's name)", "names the result folder and the page"),
        TEXT("model", "(given by --model)", "model file, MJCF or URDF, relative to this file"),
        FLAG("floating", "false", "the root link of a URDF floats")),
    CHILDREN(&cav_scene_element, &horizon, &cycle, &start, &goal, &pose, &guess, &cost, &constraint, &limits, &residual,
             &parameter, &schedule, &ipopt, &contact),
    0, "root of a problem file: one motion that is wanted of a model"};

// names of earlier versions, and tolerances of what has no target
#define FORMER_CHILD(inside, was, now) { inside, was, now, 0, NULL }
#define FORMER_ATTRIBUTE(inside, was, now) { inside, was, now, 1, NULL }
#define NO_WITHIN(inside, instead) { inside, "within", NULL, 1, instead }
#define UNTOUCHED                                                                                                      \
  "this cost has no target, so no tolerance; what must not touch is a constraint, <constraint><sensor type=\"touch\" "  \
  "body=\"NAME\" upper=\"0\"/></constraint>, or a cost in N, <sensor type=\"touch\" body=\"NAME\" within=\"5\" weight=\"1\"/>"
#define WEIGH "this cost has no target, so no tolerance; a higher weight makes it smaller. Of contacts, slip has a tolerance"
const cav_xml_former cav_problem_former[] = {
    FORMER_CHILD("scene", "leave", "remove"),
    FORMER_CHILD("cost", "overlap", "self_penetration"),
    {"constraint", "force", NULL, 0, "is a cost; what must not touch is <sensor type=\"touch\" body=\"NAME\" upper=\"0\"/>"},
    FORMER_ATTRIBUTE("cycle", "turn", "rotation"),
    FORMER_ATTRIBUTE("guess", "turn", "rotation"),
    FORMER_ATTRIBUTE("first", "self_share", "self_stiffness"),
    FORMER_ATTRIBUTE("last", "self_share", "self_stiffness"),
    FORMER_ATTRIBUTE("contact", "self_share", "self_stiffness"),
    FORMER_ATTRIBUTE("contact", "guard", "refsafe"),
    NO_WITHIN("force", UNTOUCHED),
    NO_WITHIN("edge_force", UNTOUCHED),
    NO_WITHIN("gap", WEIGH),
    NO_WITHIN("impact", WEIGH),
    NO_WITHIN("clearance", WEIGH),
    NO_WITHIN("self_penetration", WEIGH),
    NO_WITHIN("self_force", WEIGH),
    NO_WITHIN("track", "a record has noise (sd), no tolerance; remove it"),
    {NULL, NULL, NULL, 0, NULL}};
// clang-format on
