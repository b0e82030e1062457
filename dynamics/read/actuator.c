/// Actuators of an MJCF file, read and compiled. MJCF has one kind, general; motor, position, velocity, intvelocity,
/// damper, cylinder and muscle are short ways to write it, and they share one set of defaults: each sets what it
/// implies and starts from what the class has for the rest. As in MuJoCo, a positive velocity term of a servo stands for
/// a damping ratio until the model is compiled. Once all are read they take from their joints and tendons: ranges, and
/// limits of effort, which become limits of the force of each. Not offered: adhesion, user-defined functions.

#include "math3.h"
#include "mjcf.h"

// only the values that are given replace those there
static void imply(cav_spec_actuator *a, int activation, int gain, int bias) {
  a->activation = activation;
  a->gain = gain;
  a->bias = bias;
  memset(a->biasprm, 0, sizeof a->biasprm);
}

enum { EXACT_FILTER = CAV_ACTIVATION_MUSCLE + 1 }; // dyntype filterexact: another way to integrate a filter

static void read_general(const cav_xml_node *node, cav_spec_actuator *a) {
  a->activation = cav_xml_word(node, "dyntype", a->activation);
  if (a->activation == EXACT_FILTER) a->activation = CAV_ACTIVATION_FILTER;
  a->gain = cav_xml_word(node, "gaintype", a->gain);
  a->bias = cav_xml_word(node, "biastype", a->bias);
  cav_xml_reals(node, "dynprm", a->dynprm, CAV_SPEC_ACTUATOR_PARAMETERS);
  cav_xml_reals(node, "gainprm", a->gainprm, CAV_SPEC_ACTUATOR_PARAMETERS);
  cav_xml_reals(node, "biasprm", a->biasprm, CAV_SPEC_ACTUATOR_PARAMETERS);
}

// pull towards a position: kp, and kv or the ratio of damping it should have, which is kept with the other sign
static void read_servo(const cav_xml_node *node, cav_spec_actuator *a) {
  int integrates = cav_xml_is(node, "intvelocity"), filters = a->activation == CAV_ACTIVATION_FILTER;
  double damping = a->biasprm[2];
  imply(a, integrates ? CAV_ACTIVATION_INTEGRATOR : CAV_ACTIVATION_NONE, CAV_GAIN_FIXED, CAV_BIAS_AFFINE);
  read_real(node, "kp", &a->gainprm[0]);
  a->biasprm[1] = -a->gainprm[0];
  a->biasprm[2] = damping;
  if (cav_xml_get(node, "dampratio")) a->biasprm[2] = cav_xml_real(node, "dampratio", 0);
  if (cav_xml_get(node, "kv")) a->biasprm[2] = -cav_xml_real(node, "kv", 0);
  read_real(node, "inheritrange", &a->inherit);
  a->integrates = integrates;
  if (integrates) {
    if (a->actlimited != CAV_LIMITED_NO) a->actlimited = CAV_LIMITED_AUTO;
    return;
  }
  read_real(node, "timeconst", &a->dynprm[0]);
  if (cav_xml_get(node, "timeconst")) filters = a->dynprm[0] > 0;
  if (filters) a->activation = CAV_ACTIVATION_FILTER;
}

static void read_cylinder(const cav_xml_node *node, cav_spec_actuator *a) {
  imply(a, CAV_ACTIVATION_FILTER, CAV_GAIN_FIXED, CAV_BIAS_AFFINE);
  read_real(node, "timeconst", &a->dynprm[0]);
  read_real(node, "area", &a->gainprm[0]);
  double diameter = cav_xml_real(node, "diameter", -1);
  if (diameter >= 0) a->gainprm[0] = M_PI / 4 * diameter * diameter;
  cav_xml_reals(node, "bias", a->biasprm, 3);
}

// a muscle's own defaults stand where the class has those of a general actuator
static void read_muscle(const cav_xml_node *node, cav_spec_actuator *a) {
  static const double plain[] = {1, 0, 0, 0, 0, 0, 0, 0, 0};
  static const double usual[] = {0.75, 1.05, -1, 200, 0.5, 1.6, 1.5, 1.3, 1.2}, constants[] = {0.01, 0.04};
  static const char *const names[] = {"force", "scale", "lmin", "lmax", "vmax", "fpmax", "fvmax"};
  imply(a, CAV_ACTIVATION_MUSCLE, CAV_GAIN_MUSCLE, CAV_BIAS_MUSCLE);
  for (int k = 0; k < 9; k++) {
    if (a->gainprm[k] == plain[k]) a->gainprm[k] = usual[k];
  }
  for (int k = 0; k < 2; k++) {
    if (a->dynprm[k] == plain[k]) a->dynprm[k] = constants[k];
  }
  cav_xml_reals(node, "timeconst", a->dynprm, 2);
  cav_xml_reals(node, "range", a->gainprm, 2);
  for (int k = 0; k < 7; k++) read_real(node, names[k], &a->gainprm[2 + k]);
  memcpy(a->biasprm, a->gainprm, sizeof a->biasprm);
}

void cav_actuator_read_values(const cav_xml_node *node, cav_spec_actuator *a) {
  static const char *const flags[] = {"ctrllimited", "forcelimited", "actlimited"};
  cav_limited *limited[] = {&a->ctrllimited, &a->forcelimited, &a->actlimited};
  for (int k = 0; k < 3; k++) *limited[k] = (cav_limited)cav_xml_word(node, flags[k], (int)*limited[k]);
  cav_xml_reals(node, "ctrlrange", a->ctrlrange, 2);
  cav_xml_reals(node, "forcerange", a->forcerange, 2);
  cav_xml_reals(node, "actrange", a->actrange, 2);
  cav_xml_reals(node, "lengthrange", a->lengthrange, 2);
  cav_xml_reals(node, "gear", a->gear, 6);
  read_real(node, "cranklength", &a->cranklength);
  read_real(node, "armature", &a->armature);
  cav_xml_reals(node, "damping", a->damping, 3);
  a->group = cav_xml_int(node, "group", a->group);
  if (cav_xml_is(node, "general")) {
    read_general(node, a);
  } else if (cav_xml_is(node, "motor")) {
    imply(a, CAV_ACTIVATION_NONE, CAV_GAIN_FIXED, CAV_BIAS_NONE);
    a->gainprm[0] = 1;
  } else if (cav_xml_is(node, "position") || cav_xml_is(node, "intvelocity")) {
    read_servo(node, a);
  } else if (cav_xml_is(node, "velocity")) {
    imply(a, CAV_ACTIVATION_NONE, CAV_GAIN_FIXED, CAV_BIAS_AFFINE);
    read_real(node, "kv", &a->gainprm[0]);
    a->biasprm[2] = -a->gainprm[0];
  } else if (cav_xml_is(node, "damper")) {
    imply(a, CAV_ACTIVATION_NONE, CAV_GAIN_AFFINE, CAV_BIAS_NONE);
    memset(a->gainprm, 0, sizeof a->gainprm);
    a->gainprm[2] = -cav_xml_real(node, "kv", 0);
  } else if (cav_xml_is(node, "cylinder")) {
    read_cylinder(node, a);
  } else if (cav_xml_is(node, "muscle")) {
    read_muscle(node, a);
  }
}

void cav_actuator_read(cav_spec *spec, const cav_xml_node *node, cav_spec_actuator *a) {
  cav_actuator_read_values(node, a);
  if (!cav_xml_is(node, "position") && !cav_xml_is(node, "intvelocity")) a->inherit = 0;
  if (a->activation > CAV_ACTIVATION_MUSCLE || a->gain > CAV_GAIN_MUSCLE || a->bias > CAV_BIAS_MUSCLE)
    cav_spec_lack(spec, node, NULL, "user-defined functions are not supported; use one of the other types");
  if (cav_xml_accepts(node, "kv") && cav_xml_accepts(node, "dampratio") && cav_xml_get(node, "kv") &&
      cav_xml_get(node, "dampratio"))
    cav_spec_fail(spec, node, "dampratio", "kv says the damping already; remove one of them");
  if (cav_xml_accepts(node, "actdim") && cav_xml_int(node, "actdim", 1) > 1)
    cav_spec_lack(spec, node, "actdim", "actuators with several states are not supported; remove the attribute");
  if (cav_xml_real(node, "delay", 0) > 0) cav_spec_leave(spec, node, "delay", "left aside: controls act at once");
  a->name = cav_xml_text(node, "name", "");
  a->node = node;
  static const char *const names[] = {"joint", "jointinparent", "tendon", "site", "cranksite"};
  static const cav_transmission kinds[] = {CAV_TRANSMISSION_JOINT, CAV_TRANSMISSION_JOINT_IN_PARENT,
                                           CAV_TRANSMISSION_TENDON, CAV_TRANSMISSION_SITE, CAV_TRANSMISSION_CRANK};
  int targets = 0;
  for (int k = 0; k < 5; k++) {
    const char *target = cav_xml_text(node, names[k], NULL);
    if (!target) continue;
    a->target_kind = names[k];
    a->target = target;
    a->transmission = kinds[k];
    targets++;
  }
  a->reference_kind = a->transmission == CAV_TRANSMISSION_CRANK ? "slidersite" : "refsite";
  a->reference = cav_xml_text(node, a->reference_kind, NULL);
  if (targets != 1)
    cav_spec_fail(spec, node, NULL, "expected one of joint, tendon, site and cranksite; name what it acts on");
  else if (a->transmission == CAV_TRANSMISSION_CRANK && !a->reference)
    cav_spec_fail(spec, node, "slidersite", "is missing; name the site whose z axis the slider follows");
  else if (a->transmission != CAV_TRANSMISSION_SITE && cav_xml_get(node, "refsite"))
    cav_spec_fail(spec, node, "refsite", "is for the transmission by a site; name that too");
  else if (a->transmission != CAV_TRANSMISSION_CRANK && cav_xml_get(node, "slidersite"))
    cav_spec_fail(spec, node, "slidersite", "needs a cranksite; name that too");
}

// --- what actuators take from their joints and tendons ---

// whether a range holds, as its flag says; given is whether there is one
static int holds(const cav_spec *spec, cav_limited limited, const double range[2]) {
  int given = range[0] != 0 || range[1] != 0;
  return limited == CAV_LIMITED_YES || (limited == CAV_LIMITED_AUTO && given && spec->compiler.autolimits != 0);
}

static int is_on_joint(const cav_spec_actuator *a) {
  return a->transmission == CAV_TRANSMISSION_JOINT || a->transmission == CAV_TRANSMISSION_JOINT_IN_PARENT;
}

// range of the joint or tendon, about its middle
static void inherit_range(cav_spec *spec, cav_spec_actuator *a) {
  double *to = a->integrates ? a->actrange : a->ctrlrange;
  const char *own = a->integrates ? "actrange" : "ctrlrange";
  const double *range = NULL;
  if (is_on_joint(a)) {
    int i = cav_name_find(spec->joint.at, spec->joint.n, sizeof *spec->joint.at, a->target);
    // a name that there is none of is told when names are resolved
    if (i < 0) return;
    range = spec->joint.at[i].range;
  } else if (a->transmission == CAV_TRANSMISSION_TENDON) {
    int i = cav_name_find(spec->tendon.at, spec->tendon.n, sizeof *spec->tendon.at, a->target);
    if (i < 0) return;
    range = spec->tendon.at[i].range;
  }
  if (!range || !(range[0] < range[1])) {
    cav_spec_fail(spec, a->node, "inheritrange", "'%.60s' has no range to take; give that one, or %s here", a->target,
                  own);
    return;
  }
  double middle = (range[0] + range[1]) / 2, half = (range[1] - range[0]) / 2 * a->inherit;
  to[0] = middle - half;
  to[1] = middle + half;
}

// rotor and friction, seen through the gear
static void move_to_joint(cav_spec *spec, const cav_spec_actuator *a) {
  if (a->armature == 0 && a->damping[0] == 0 && a->damping[1] == 0 && a->damping[2] == 0) return;
  int i = is_on_joint(a) ? cav_name_find(spec->joint.at, spec->joint.n, sizeof *spec->joint.at, a->target) : -1;
  if (i < 0 || spec->joint.at[i].type < CAV_JOINT_SLIDE || a->damping[1] != 0 || a->damping[2] != 0) {
    cav_spec_lack(spec, a->node, NULL,
                  "armature and damping of an actuator are supported along a hinge or slide, as one number each");
    return;
  }
  cav_spec_joint *j = &spec->joint.at[i];
  j->armature += a->gear[0] * a->gear[0] * a->armature;
  j->damping += a->gear[0] * a->gear[0] * a->damping[0];
}

// what a unit force of an actuator does to a joint or along a tendon; 0: nothing, or what varies with the posture
static double moment_on(const cav_spec *spec, const cav_spec_actuator *a, const char *joint, const char *tendon) {
  if (tendon) return a->transmission == CAV_TRANSMISSION_TENDON && !strcmp(a->target, tendon) ? a->gear[0] : 0;
  if (is_on_joint(a)) return !strcmp(a->target, joint) ? a->gear[0] : 0;
  if (a->transmission != CAV_TRANSMISSION_TENDON) return 0;
  int i = cav_name_find(spec->tendon.at, spec->tendon.n, sizeof *spec->tendon.at, a->target);
  double sum = 0;
  for (int k = 0; i >= 0 && k < spec->tendon.at[i].npart; k++) {
    const cav_spec_part *p = &spec->part.at[spec->tendon.at[i].part + k];
    if (!strcmp(p->joint, joint)) sum += a->gear[0] * p->coef;
  }
  return sum;
}

// one whose moments vary with the posture
static int acts_along_paths(const cav_spec *spec, const cav_spec_actuator *a) {
  if (a->transmission != CAV_TRANSMISSION_TENDON) return !is_on_joint(a);
  int i = cav_name_find(spec->tendon.at, spec->tendon.n, sizeof *spec->tendon.at, a->target);
  return i >= 0 && spec->tendon.at[i].spatial;
}

// force of an actuator kept within a range times 1 / moment, and within what it has
static void narrow_force(cav_spec *spec, cav_spec_actuator *a, const double range[2], double moment) {
  double low = fmin(range[0] / moment, range[1] / moment), high = fmax(range[0] / moment, range[1] / moment);
  if (holds(spec, a->forcelimited, a->forcerange)) {
    low = fmax(low, a->forcerange[0]);
    high = fmin(high, a->forcerange[1]);
  }
  a->forcelimited = CAV_LIMITED_YES;
  a->forcerange[0] = low;
  a->forcerange[1] = high;
  if (!(low < high))
    cav_spec_fail(spec, a->node, "forcerange", "no force is within it and the actuatorfrcrange of what it acts on");
}

// limit on what all actuators together do to a joint or tendon: exact for one; several get even fractions
static void limit_effort(cav_spec *spec, const cav_xml_node *node, const char *joint, const char *tendon,
                         const double range[2]) {
  int n = 0;
  if (!(range[0] < range[1]))
    cav_spec_fail(spec, node, "actuatorfrcrange", "expected lower < upper, got %g %g", range[0], range[1]);
  if (!*(tendon ? tendon : joint)) return;
  for (int i = 0; i < spec->actuator.n; i++) n += moment_on(spec, &spec->actuator.at[i], joint, tendon) != 0;
  for (int i = 0; i < spec->actuator.n && spec->status == CAV_OK; i++) {
    cav_spec_actuator *a = &spec->actuator.at[i];
    double moment = moment_on(spec, a, joint, tendon);
    if (moment != 0) narrow_force(spec, a, range, n * moment);
  }
  for (int i = 0; i < spec->actuator.n && !tendon; i++) {
    if (acts_along_paths(spec, &spec->actuator.at[i]))
      cav_spec_leave(spec, node, "actuatorfrcrange",
                     "held for actuators at joints and fixed tendons, not for those at sites, cranks and strings along "
                     "paths, with which no motion is planned");
  }
  if (n > 1)
    cav_spec_leave(
        spec, node, "actuatorfrcrange",
        "several actuators act here: each keeps within an even fraction of the limit, less than MuJoCo lets");
}

void cav_actuators_settle(cav_spec *spec) {
  for (int i = 0; i < spec->actuator.n && spec->status == CAV_OK; i++) {
    if (spec->actuator.at[i].inherit > 0) inherit_range(spec, &spec->actuator.at[i]);
    move_to_joint(spec, &spec->actuator.at[i]);
  }
  for (int i = 0; i < spec->joint.n && spec->status == CAV_OK; i++) {
    const cav_spec_joint *j = &spec->joint.at[i];
    if (j->type >= CAV_JOINT_SLIDE && holds(spec, j->effort, j->effort_range))
      limit_effort(spec, j->node, j->name, NULL, j->effort_range);
  }
  for (int i = 0; i < spec->tendon.n && spec->status == CAV_OK; i++) {
    const cav_spec_tendon *t = &spec->tendon.at[i];
    if (holds(spec, t->effort, t->effort_range)) limit_effort(spec, t->node, NULL, t->name, t->effort_range);
  }
}

// --- compiling ---

static int find_site(cav_spec *spec, const cav_spec_actuator *s, const char *attribute, const char *name) {
  int i = cav_name_find(spec->site.at, spec->site.n, sizeof *spec->site.at, name);
  if (i < 0)
    cav_spec_unknown(spec, s->node, attribute, "site", name, spec->site.at, spec->site.n, sizeof *spec->site.at);
  return i;
}

static int find_target(cav_spec *spec, const cav_spec_actuator *s) {
  const void *first = spec->joint.at;
  int n = spec->joint.n, i;
  size_t stride = sizeof *spec->joint.at;
  if (s->transmission == CAV_TRANSMISSION_SITE || s->transmission == CAV_TRANSMISSION_CRANK)
    return find_site(spec, s, s->target_kind, s->target);
  int tendon = s->transmission == CAV_TRANSMISSION_TENDON;
  if (tendon) first = spec->tendon.at, n = spec->tendon.n, stride = sizeof *spec->tendon.at;
  i = cav_name_find(first, n, stride, s->target);
  if (i < 0) cav_spec_unknown(spec, s->node, s->target_kind, tendon ? "tendon" : "joint", s->target, first, n, stride);
  return i;
}

// gears that count: one, three of a ball, six of a free joint or a site
static int gears(const cav_spec *spec, const cav_actuator *a) {
  if (a->transmission == CAV_TRANSMISSION_SITE) return 6;
  if (a->transmission != CAV_TRANSMISSION_JOINT && a->transmission != CAV_TRANSMISSION_JOINT_IN_PARENT) return 1;
  cav_joint_type type = spec->joint.at[a->target].type;
  return type == CAV_JOINT_FREE ? 6 : type == CAV_JOINT_BALL ? 3 : 1;
}

// moments are constant along joints in their own axes, and along fixed tendons
static int is_constant(const cav_spec *spec, const cav_actuator *a) {
  if (a->transmission == CAV_TRANSMISSION_TENDON) return !spec->tendon.at[a->target].spatial;
  return a->transmission == CAV_TRANSMISSION_JOINT;
}

static void compile_gain(cav_spec *spec, const cav_spec_actuator *s, cav_actuator *a) {
  a->activation = (cav_activation)s->activation;
  a->gain = (cav_gain)s->gain;
  a->bias = (cav_bias)s->bias;
  memcpy(a->activation_parameter, s->dynprm, sizeof a->activation_parameter);
  memcpy(a->gain_parameter, s->gainprm, sizeof a->gain_parameter);
  memcpy(a->bias_parameter, s->biasprm, sizeof a->bias_parameter);
  if (s->lengthrange[0] > s->lengthrange[1])
    cav_spec_fail(spec, s->node, "lengthrange", "expected lower <= upper, got %g %g", s->lengthrange[0],
                  s->lengthrange[1]);
  memcpy(a->lengthrange, s->lengthrange, sizeof a->lengthrange);
}

// an actuator that gives no force keeps its place among the controls: a motor with a gear of 0
static void compile_idle(cav_spec *spec, const cav_spec_actuator *s, cav_actuator *a) {
  double sum = 0;
  for (int k = 0; k < gears(spec, a); k++) sum += fabs(s->gear[k]);
  int gains = a->gain != CAV_GAIN_FIXED || s->gainprm[0] != 0, biased = a->bias == CAV_BIAS_MUSCLE;
  for (int k = 0; k < 3; k++) biased |= a->bias == CAV_BIAS_AFFINE && s->biasprm[k] != 0;
  if (!gains && biased && sum != 0)
    cav_spec_fail(spec, s->node, NULL,
                  "a gain of 0 leaves a force that no control moves; give the joint a spring or damping");
  if (gains && sum != 0) return;
  cav_spec_leave(spec, s->node, NULL, "gives no force: its gain or gear is 0");
  memset(a->gear, 0, sizeof a->gear);
  a->gain = CAV_GAIN_FIXED;
  a->bias = CAV_BIAS_NONE;
  a->gain_parameter[0] = 1;
}

void cav_actuator_compile(cav_spec *spec, const cav_spec_actuator *s, cav_actuator *a) {
  a->transmission = s->transmission;
  a->target = find_target(spec, s);
  a->reference = s->reference ? find_site(spec, s, s->reference_kind, s->reference) : -1;
  if (spec->status != CAV_OK) return;
  compile_gain(spec, s, a);
  if (a->transmission == CAV_TRANSMISSION_JOINT_IN_PARENT && gears(spec, a) == 1)
    a->transmission = CAV_TRANSMISSION_JOINT;
  a->constant = is_constant(spec, a);
  a->cranklength = s->cranklength;
  if (a->transmission == CAV_TRANSMISSION_CRANK && !(s->cranklength > 0))
    cav_spec_fail(spec, s->node, "cranklength", "expected a length > 0, got %g", s->cranklength);
  memcpy(a->gear, s->gear, sizeof a->gear);
  compile_idle(spec, s, a);
  // effort of a motor counts in controls, and so do the limits of its force
  a->unit = a->gain == CAV_GAIN_FIXED && a->bias == CAV_BIAS_NONE ? a->gain_parameter[0] : 1;
  a->forcerange[a->unit < 0] = s->forcerange[0] / a->unit;
  a->forcerange[a->unit > 0] = s->forcerange[1] / a->unit;
}
