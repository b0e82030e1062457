/// Words that people know from elsewhere and that name nothing here: the command that does what one says, and what stands for
/// another in problem files. What is spelt wrong is not looked for here (cav_xml_nearest).
#include <string.h>
#include <strings.h>

#include "manual.h"
#include "posture.h"
#include "role.h"

// words separated by |, the command line that does it, what that does
static const cav_manual_use uses[] = {
    {"check|validate|lint|info|describe|list|test|parse|dump|print", "inspect PROBLEM",
     "checks a problem file and says what it asks for, without solving it"},
    {"run|plan|optimise|optimize|optimisation|optimization|go|compute|generate|synthesise|synthesize|motion",
     "solve PROBLEM", "finds the motion that a problem file asks for"},
    {"play|show|plot|open|animate|render|display|watch|draw|gui|visualise|visualize|viewer|page", "view DIR",
     "writes the page that plays the motion of a result folder, and says where it is"},
    {"init|create|scaffold|template|begin|start|make|add|example", "new MODEL",
     "writes a problem file to begin with, for a model"},
    {"simulate|sim|step|control|controller|push", "mpc PROBLEM",
     "simulates a body that plans control; every certified motion of cavort solve was simulated, too"},
    {"replay|certify", "verify DIR", "certifies and simulates the motion of a result folder again"},
    {"why|debug|diagnose|analyse|analyze", "explain DIR", "says why the motion of a result folder is as it is"},
    {"convert|save|write", "export DIR", "writes the motion of a result folder in a format of other tools"},
    {"compare|diff", "view DIR DIR", "writes one page of two motions"},
    {"results|status|ls|summary", "table DIR...", "prints a line for each result folder"},
    {"bench|benchmark|measure|accuracy|profile", "report MODEL", "measures error against run time"},
    {"fit|retarget|mocap|clip", "ik CLIP", "fits a model to a recorded clip"},
    {"estimate|observe|filter|smooth", "mhe PROBLEM", "estimates a motion from its records"},
    {"sweep|scan|grid|batch", "solve PROBLEM --set PATH=VALUE,VALUE", "solves a problem for several values"},
    {"resume|continue", "solve PROBLEM --resume", "goes on where a solve was stopped"},
    {"version", "--version", "prints the version"},
};

// words separated by |, what stands for them, and of what cavort help tells more; NULL: of nothing
static const struct {
  const char *words, *text, *see;
} words[] = {
    {"achieved|achieve|success|missed|tolerance|tolerances|met",
     "a motion is achieved if every target is met to within its tolerance; exit status 0 needs that, and cavort "
     "inspect\n  PROBLEM marks the terms that count",
     "within"},
    {"expect|expects|expected|require|required|requirement|must|assert",
     "what a motion has to do is a target, met to within its tolerance (achieved); what every solution has to hold is "
     "a\n"
     "  term of <constraint>, with lower=, upper= or within=",
     "within"},
    {"certified|certificate|certification|verdict|valid",
     "a motion is certified if it obeys physics and limits, by a verifier apart from the solver; what that requires:\n"
     "  problems/README.md, Result folders. Whether it does what was asked is another matter (achieved)",
     "verify"},
    {"optimal|optimality|optimum",
     "a motion is optimal if no small step along its constraints saves more than 1e-4 of the cost: a local optimum,\n"
     "  another guess may lead to a better one. Neither certified nor achieved needs it",
     NULL},
    {"impossible|infeasible|feasible|proof",
     "a problem that is proven impossible is not solved; cavort inspect PROBLEM tells the proof", "inspect"},
    {"stand|standing|lying|crouch|sitting|kneeling|squatting",
     "key=\"stand\" of <start>, <goal>, <pose> and <waypoint> is a posture on the feet, found for any model that has "
     "feet;\n  others are found for any humanoid. height=\"floor\" beside it puts it on the floor",
     "postures"},
    {"robust|robustness|disturbance|disturbances|perturbation|perturbations|feedback|gains",
     "solve chooses feedback gains that follow a motion in simulations; verify DIR --starts N tells from how many "
     "starts a\n"
     "  little off they do, a verdict's push_survived_n_s what push; mpc --push pushes a controller",
     "verify"},
    {"steady|wobble|wobbly|sway|swaying",
     "a trunk is kept still by a heavier cost on its turning, <velocity dofs=\"root_angular\" weight=\"2\"/>, or, "
     "before the "
     "last\n  stage alone, by <schedule calm=\"true\">, which solve tries by itself",
     "calm"},
    {"bridge|crook|supine|prone",
     "of <start>, <goal>, <pose> and <waypoint> key=\"lie-back\" lies face up, key=\"hook-lying\" too, with knees bent "
     "and "
     "soles\n  down, key=\"lie-front\" face down",
     "postures"},
    {"keyframe|keyframes|qpos0", "a posture that the model's file names: key=\"NAME\" of <start>, <goal> and others",
     "key"},
    {"feet|hands|paw|paws|knee|elbow|hip|shoulder|ankle|wrist|leg|legs|arm|arms|thigh|shin|toe|finger|neck|waist|back|"
     "chest|limb|link|"
     "links|"
     "bodies|joints|sites|geoms",
     "bodies, joints, sites and geoms go by the names of the model's file; cavort inspect MODEL lists them, with what "
     "a\n"
     "  positive change of each joint moves where. Names of some parts serve any model (roles)",
     "roles"},
    {"axis|axes|direction|upright|vertical|orientation|tilt|facing|heading",
     "sensors framexaxis, frameyaxis and framezaxis read where an axis of a body points, framequat a whole "
     "orientation:\n"
     "  <sensor type=\"framezaxis\" xbody=\"torso\" target=\"0 0 1\" at=\"end\" weight=\"900\"/> is upright.\n"
     "  <root turn=\"90\"/> of <start> and <goal> turns a posture to the left as it is",
     "sensors"},
    {"x|y|z|world|coordinates|left|right|forwards|forward|up|down",
     "z is up; x and y are those of the model's file, of most robots x forwards and y left. One of them counts by\n"
     "  component=\"z\"",
     "component"},
    {"principal|inertial|ximat|iquat",
     "body= of a sensor is the frame at a body's centre of mass along its principal axes of inertia, which may be "
     "turned\n"
     "  from the body's own by any angle; xbody= is the body's frame in the model's file. cavort inspect PROBLEM notes "
     "where\n"
     "  that matters",
     "xbody"},
    {"root_angular|root_linear",
     "of <posture>, <velocity> and <acceleration> dofs=\"root_linear\" and \"root_angular\" are the translations and\n"
     "  rotations of all free joints, of loose things of the scene, too; of one body <sensor type=\"framequat\" "
     "xbody=\"torso\"\n"
     "  relative=\"goal\" .../>, framepos, framelinvel, frameangvel",
     "dofs"},
    {"unit|units|metre|metres|meter|meters|radian|radians",
     "m, s, kg, N and rad; degrees in the attributes degrees, euler and rotation alone", NULL},
    {"floor|ground|plane|table|box|wall|object|objects|ball|terrain|environment",
     "what the model's file does not have stands in <scene>, as MJCF writes it:\n"
     "  <scene><geom name=\"floor\" type=\"plane\" size=\"0 0 1\"/></scene>; height=\"floor\" of a posture puts it "
     "down "
     "there",
     "height"},
    {"mjcf|urdf|mujoco|robot|humanoid",
     "models are MJCF or URDF files: <problem model=\"FILE\">, its path from the problem file's folder or from /, or "
     "--model "
     "FILE",
     "model"},
    {"objective|reward|loss|goals|wish", "what is wanted is a term of <cost>, what has to hold one of <constraint>",
     "terms"},
    {"bound|bounds|inequality|equality|hard",
     "a term of <constraint> has to hold: equal to its target, or between lower and upper", "constraint"},
    {"position|place|location|reach",
     "where a body is: <sensor type=\"framepos\" body=\"right hand\" target=\"0.4 -0.2 1\" at=\"end\" "
     "weight=\"900\"/>; a "
     "joint's\n  angle is type=\"jointpos\", all joints at once are <posture>",
     "framepos"},
    {"angle|angles|bend",
     "of a posture <joint name=\"NAME\" degrees=\"30\"/>; as a wish <posture joint=\"NAME\" degrees=\"30\"/> or\n"
     "  type=\"jointpos\" (rad)",
     "joint"},
    {"torques|motor|motors|muscle|muscles|strength",
     "forces of actuators are planned within their limits: <effort> is their cost, <limits effort> how much of them is "
     "used",
     "effort"},
    {"friction|priority|slippery|footstep|footsteps|contacts",
     "contacts are found, no file says when; friction is that of geoms, in the model's file or the <scene>: of two "
     "that touch the\n"
     "  larger counts, or that of the one with the higher priority= (MJCF)",
     "contact"},
    {"dt|knot|step|steps|fps|length", "knots are timestep apart, duration is a whole number of steps", "horizon"},
    {"touching|press|pressure|lean|support|bear",
     "a force on a body: <sensor type=\"touch\" body=\"right hand\" target=\"20\" scale=\"20\" within=\"5\" "
     "from=\"0.8\" "
     "to=\"1.2\"\n  weight=\"30\"/>, its scale about its target; none on it: help avoid",
     "touch"},
    {"avoid|avoided|untouched|collision|collisions|obstacle|obstacles",
     "what must not be touched is a body of its own in <scene>, without joints. A cost on its forces keeps off it, "
     "and\n"
     "  is often easier to find: <force body=\"bar\" weight=\"100\"/>. That it was not touched, by more than 5 N, is\n"
     "  asked by <sensor type=\"touch\" body=\"bar\" within=\"5\" weight=\"0.01\"/> beside it, or of every solution "
     "by\n"
     "  <constraint><sensor type=\"touch\" body=\"bar\" upper=\"0\"/></constraint>",
     "force"},
    {"grasp|grip|grab|pinch|gripper|attach|weld|rope|cable|string",
     "nothing closes a hand by itself: a thing is held by force and friction, between two hands (carry) or by fingers\n"
     "  that actuators of the model move. What is fixed or hangs on a rope for good is an <equality> or a <tendon> of\n"
     "  the model's file",
     "contact"},
    {"handle|knob|hook",
     "a handle is a geom of the door, the drawer or the lid; a hand is brought to it by <sensor type=\"framepos\"\n"
     "  body=\"right hand\" reftype=\"xbody\" refname=\"door\" target=\"0.6 0 0.1\" .../>, from=, to=. Nothing closes "
     "about it:\n"
     "  to pull, the hand has to press it from behind (help grasp)",
     "jointpos"},
    {"lock|locked|fix|fixed|rigid|stiff",
     "a joint stays as the start has it by <constraint><posture joint=\"NAME\" qpos=\"0.3\"/></constraint>, without\n"
     "  from= and to=, its number that of the start; for good, by a model without that joint. Two bodies are fixed to "
     "each\n"
     "  other by <equality> of the model's file",
     "constraint"},
    {"catch|catching|caught|intercept",
     "what is caught comes by itself: <root joint=\"ball\" linvel=\"-1 0 0\"/> of <start>; <root joint=\"ball\" .../> "
     "of\n"
     "  <goal> or <sensor type=\"framepos\" body=\"ball\" .../> says where it is in the end. A hand is brought to it "
     "by\n"
     "  framepos with refname=\"ball\" at that time; contacts do not bounce by themselves, and nothing closes a hand\n"
     "  (help grasp)",
     "linvel"},
    {"rolling|rolls|spin|spinning",
     "a ball rolls by the friction of its contact, and rolling is no slip. One that rolls to -x has, in <start>,\n"
     "  <root joint=\"ball\" linvel=\"-1 0 0\" angvel=\"0 -W 0\"/>, W = speed over radius. It rolls on without end, "
     "but\n"
     "  for friction=\"1 0.005 0.01\" condim=\"6\" of its geom (MJCF); what still rolls at the end asks for <horizon\n"
     "  close=\"open\"/>",
     "linvel"},
    {"hold|held|keep|stay|still|freeze|rest|pause",
     "a posture, place or angle is held by a term over a while: from=\"1\" to=\"2\" in place of at=; a whole motion\n"
     "  ends at rest unless <horizon close=\"open\"/> says that it need not; <guess type=\"hold\"/> begins with the\n"
     "  start held",
     "within"},
    {"mass|weight|heavy|inertia|payload|gear|damping|frictionloss|armature",
     "mass, gear, damping and friction are of the model's file, or of a body of <scene>, as MJCF writes them; weight= "
     "of\n"
     "  a term is what missing it costs. cavort inspect MODEL says what bodies weigh and what actuators give",
     "terms"},
    {"cup|can|bottle|tool|block|crate|carton|payloads|load",
     "a thing is a <body> with a <freejoint> in <scene>: help move", NULL},
    {"fast|faster|fastest|quick|slow|speed|minimum|minimal|shortest|least|soon",
     "in the least time: <horizon duration=\"1.5\" range=\"0.8 2\" weight=\"1\"/>, where the solver finds the "
     "duration. How fast a\n"
     "  body or a joint is: framelinvel, jointvel. With the least force or motion: higher weights of <effort>, "
     "<velocity>",
     "horizon"},
    {"stop|stopped|stopping|brake",
     "a joint stops at the ends of its range, in the model's file; a motion is at rest at its end unless <horizon\n"
     "  close=\"open\"/> says that it need not; Ctrl-C stops a solve, --seconds ends it with what it has, --resume "
     "goes on",
     "horizon"},
    {"limit|saturation|maximum|max",
     "limits of joints and actuators are those of the model's file, and plans keep inside them by <limits>; a limit "
     "of\n"
     "  anything else is a constraint with lower= or upper=, as <velocity joint=\"NAME\" lower=\"-2\" upper=\"2\"/> "
     "in\n"
     "  <constraint>",
     "limits"},
    {"end|final|last|finish",
     "at=\"end\" of a term; <horizon duration=\"2\"/> says when that is, and close=\"open\" that nothing need rest "
     "then",
     "horizon"},
    {"flight|fly|land|landing|airborne",
     "of a way through the air <guess apex=\"0.3\" from=\"0.8\" to=\"1.3\"/> says how high and when: by gravity an "
     "apex\n"
     "  is 1.2 m times the square of the seconds between",
     "guess"},
    {"door|doors|drawer|lid|lever|hinge|gate|push|pull|carry|lift|throw|move",
     "what no actuator moves stands in <scene> as a <body> with a <freejoint>, or with a <joint> of type hinge or "
     "slide;\n"
     "  it is wanted by its place, <sensor type=\"framepos\" body=\"box\" .../>, or its joint,\n"
     "  <sensor type=\"jointpos\" joint=\"door\" .../>, and hands are brought to it, unless a term\n"
     "  brings something else, as a foot to a ball. They lead the guess: where another part moves it after all solve "
     "says so.\n  What nothing stops at the end: <horizon close=\"open\"/>",
     "jointpos"},
    {"stairs|stair|ladder|beam|ledge|podium|hurdle|over|vault",
     "what is stepped on or over stands in <scene>; the goal's posture stands on it with height=\"floor\" and rise= "
     "the height "
     "of\n"
     "  its top. A file without a <guess> is begun with limbs that swing over it; where it fails others are tried. "
     "Motions\n"
     "  to copy: problems/motions/stairs, step-up",
     "rise"},
    {"gait|stride|trot|pace|gallop|periodic|cyclic",
     "a gait is <cycle translation=\"0.5 0 0\" mirror=\"y\"/>: with a mirror the horizon and the translation are those "
     "of half a\n"
     "  stride, and the other half is the same with left and right exchanged. Limbs swing in the guess by <swing> of "
     "<guess>;\n"
     "  a walk from start to goal needs neither, its gait is found",
     "cycle"},
    {"turn|yaw|pirouette",
     "how a body is turned at the end: <root turn=\"90\"/> of <goal>, degrees to the left, whatever its posture, and a "
     "posture that\n"
     "  asks for it (dofs=\"all\"); of a cycle rotation=. Which way a turn by 180 degrees and more goes is said by "
     "rotation=\n  of <guess>",
     "rotation"},
    {"wheel|wheels|flywheel|reaction|pendulum|balance|balancing|unstable|swingup",
     "what turns without end is no posture: <posture joint=\"wheel\" weight=\"0\"/>, and <velocity joint=\"wheel\" "
     "weight=\"0\"/>\n"
     "  where it turns fast, take the usual costs off it. A balance that is held, or found by swinging up, is <goal> "
     "and\n"
     "  <posture ... at=\"end\">; energy is pumped in by a guess of its own where motors are weak",
     "weight"},
    {"pickup|pick|bring|fetch|deliver|stack",
     "a thing that is brought somewhere is asked for by its place: help move. Two hands are led to its sides by "
     "themselves;\n"
     "  one hand or a gripper is not: help grasp",
     "framepos"},
    {"strategy|strategies|near-1|repair-1|soft|fine|solids|midpoint|resample|detour",
     "where the stated guess leads to no certificate, or beside what was asked, solve tries others: guesses and "
     "schedules\n"
     "  by names, in an order that cavort inspect FILE lists, each in words. near-1, near-2 ... mend what is nearly "
     "there and\n"
     "  repair-1 ... the best one at last, by the usual cure of what it misses. strategies.csv of a result says what "
     "became\n  of each; --strategies 1 tries none, --strategies 2 two at once",
     "solve"},
    {"jump|jumping|hop|walk|kick|climb|crawl|roll|pushup|push-up|backflip|cartwheel|handstand|dance|motions|examples",
     "motions of the project stand in problems/motions; cavort new MODEL --like jump writes one for a model", "new"},
    {"output|folder|csv|trajectory|json|files",
     "cavort solve writes a folder, NAME.result; its files: problems/README.md, Result folders", "solve"},
    {"seed|random", "nothing is random: one build and one input give the same motion, at any number of threads", NULL},
    {"python|c|api|library", "README.md, From C and From Python", NULL},
};

// whether a list of words, separated by |, has that one
static int has_word(const char *list, const char *word) {
  const size_t n = strcspn(word, "|");
  if (word[n]) return 0;
  while (strncasecmp(list, word, n) || (list[n] != '|' && list[n])) {
    list = strchr(list, '|');
    if (!list) return 0;
    list++;
  }
  return n > 0;
}

const cav_manual_use *cav_manual_use_of(const char *word) {
  for (size_t i = 0; i < sizeof uses / sizeof *uses; i++)
    if (has_word(uses[i].words, word)) return &uses[i];
  return NULL;
}

static int print_topic(FILE *out, const cav_manual *manual, const char *name) {
  int told = 0;
  for (int i = 0; i < manual->ntopic; i++) {
    if (strcmp(manual->topic[i].name, name)) continue;
    manual->topic[i].print(out, manual);
    told++;
  }
  return told;
}

// the role of that name, or else one whose last word it is: foot of "right foot"; CAV_ROLE_TYPES: none
static cav_role role_of(const char *name) {
  const size_t n = strlen(name);
  cav_role role = cav_role_named(name);
  for (cav_role r = 0; r < CAV_ROLE_TYPES && role == CAV_ROLE_TYPES; r++) {
    const char *text = cav_role_name(r), *last = strrchr(text, ' ');
    if (last && strlen(last + 1) == n && !strcasecmp(last + 1, name)) role = r;
  }
  return role;
}

static int print_role(FILE *out, const cav_manual *manual, const char *name) {
  const cav_role role = role_of(name);
  if (role == CAV_ROLE_TYPES) return 0;
  fprintf(out, "%s: a role, which stands for a body of any model, as in <sensor type=\"framepos\" body=\"%s\">\n", name,
          cav_role_name(role));
  return print_topic(out, manual, "roles");
}

// a posture that is found by its name
static int print_posture(FILE *out, const cav_manual *manual, const char *name) {
  for (int i = 0; cav_posture_names[i]; i++) {
    if (strcmp(cav_posture_names[i], name)) continue;
    fprintf(out, "%s: a posture of any humanoid, as in <start key=\"%s\" height=\"floor\"/>\n", name, name);
    return print_topic(out, manual, "postures");
  }
  return 0;
}

static int print_word(FILE *out, const char *name) {
  int told = 0;
  for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
    if (!has_word(words[i].words, name)) continue;
    fprintf(out, "%s: %s\n", name, words[i].text);
    if (words[i].see && strcmp(words[i].see, name)) fprintf(out, "  more: cavort help %s\n", words[i].see);
    told++;
  }
  return told;
}

int cav_manual_answer(FILE *out, const cav_manual *manual, const char *name) {
  int told = print_word(out, name);
  told += print_topic(out, manual, name);
  told += cav_manual_explain(out, name);
  told += print_role(out, manual, name);
  told += print_posture(out, manual, name);
  const cav_manual_use *use = told ? NULL : cav_manual_use_of(name);
  if (use) fprintf(out, "%s: cavort %s %s\n", name, use->line, use->text);
  return told + (use != NULL);
}
