/// Actuators of an MJCF file, read and compiled. MJCF has one kind, general; motor, position, velocity, intvelocity,
/// damper, cylinder and muscle are short ways to write it, and they share one set of defaults: each sets what it
/// implies and starts from what the class has for the rest. Not offered: adhesion, user-defined functions.

#include "math3.h"
#include "spec.h"

static int is(const cav_xml_node *node, const char *name) { return !strcmp(node->rule->name, name); }

static void read_real(const cav_xml_node *node, const char *name, double *out) {
  *out = cav_xml_real(node, name, *out);
}

// only the values that are given replace those there
static void imply(cav_spec_actuator *a, int activation, int gain, int bias) {
  a->activation = activation;
  a->gain = gain;
  a->bias = bias;
  memset(a->biasprm, 0, sizeof a->biasprm);
}

static void read_general(const cav_xml_node *node, cav_spec_actuator *a) {
  a->activation = cav_xml_word(node, "dyntype", a->activation);
  a->gain = cav_xml_word(node, "gaintype", a->gain);
  a->bias = cav_xml_word(node, "biastype", a->bias);
  cav_xml_reals(node, "dynprm", a->dynprm, CAV_SPEC_ACTUATOR_PARAMETERS);
  cav_xml_reals(node, "gainprm", a->gainprm, CAV_SPEC_ACTUATOR_PARAMETERS);
  cav_xml_reals(node, "biasprm", a->biasprm, CAV_SPEC_ACTUATOR_PARAMETERS);
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
  if (is(node, "general")) {
    read_general(node, a);
  } else if (is(node, "motor")) {
    imply(a, CAV_ACTIVATION_NONE, CAV_GAIN_FIXED, CAV_BIAS_NONE);
    a->gainprm[0] = 1;
  } else if (is(node, "position") || is(node, "intvelocity")) {
    imply(a, is(node, "position") ? CAV_ACTIVATION_NONE : CAV_ACTIVATION_INTEGRATOR, CAV_GAIN_FIXED, CAV_BIAS_AFFINE);
    read_real(node, "kp", &a->gainprm[0]);
    a->biasprm[1] = -a->gainprm[0];
    if (is(node, "intvelocity")) a->actlimited = CAV_LIMITED_YES;
  } else if (is(node, "velocity")) {
    imply(a, CAV_ACTIVATION_NONE, CAV_GAIN_FIXED, CAV_BIAS_AFFINE);
    read_real(node, "kv", &a->gainprm[0]);
    a->biasprm[2] = -a->gainprm[0];
  } else if (is(node, "damper")) {
    imply(a, CAV_ACTIVATION_NONE, CAV_GAIN_AFFINE, CAV_BIAS_NONE);
    memset(a->gainprm, 0, sizeof a->gainprm);
    a->gainprm[2] = -cav_xml_real(node, "kv", 0);
  } else if (is(node, "cylinder")) {
    read_cylinder(node, a);
  } else if (is(node, "muscle")) {
    read_muscle(node, a);
  }
}

void cav_actuator_read(cav_spec *spec, const cav_xml_node *node, cav_spec_actuator *a) {
  if (is(node, "adhesion") || cav_xml_get(node, "body")) {
    cav_spec_fail(spec, node, NULL, "adhesion of bodies is not supported; give the contacts friction instead");
    return;
  }
  cav_actuator_read_values(node, a);
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
  if (s->activation > CAV_ACTIVATION_MUSCLE || s->gain > CAV_GAIN_MUSCLE || s->bias > CAV_BIAS_MUSCLE)
    cav_spec_fail(spec, s->node, NULL, "user-defined functions are not supported; use one of the other types");
  a->activation = (cav_activation)s->activation;
  a->gain = (cav_gain)s->gain;
  a->bias = (cav_bias)s->bias;
  memcpy(a->activation_parameter, s->dynprm, sizeof a->activation_parameter);
  memcpy(a->gain_parameter, s->gainprm, sizeof a->gain_parameter);
  memcpy(a->bias_parameter, s->biasprm, sizeof a->bias_parameter);
  if (a->gain == CAV_GAIN_FIXED && s->gainprm[0] == 0)
    cav_spec_fail(spec, s->node, NULL, "a gain of 0 gives no force; write another or remove the actuator");
  if (s->lengthrange[0] > s->lengthrange[1])
    cav_spec_fail(spec, s->node, "lengthrange", "expected lower <= upper, got %g %g", s->lengthrange[0],
                  s->lengthrange[1]);
  memcpy(a->lengthrange, s->lengthrange, sizeof a->lengthrange);
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
  double sum = 0;
  for (int k = 0; k < gears(spec, a); k++) sum += fabs(a->gear[k]);
  if (sum == 0) cav_spec_fail(spec, s->node, "gear", "expected a gear that is not 0; this actuator gives no force");
  // effort of a motor counts in controls, and so do the limits of its force
  a->unit = a->gain == CAV_GAIN_FIXED && a->bias == CAV_BIAS_NONE ? s->gainprm[0] : 1;
  a->forcerange[a->unit < 0] = s->forcerange[0] / a->unit;
  a->forcerange[a->unit > 0] = s->forcerange[1] / a->unit;
}
