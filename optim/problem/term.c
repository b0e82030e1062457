/// Terms of a problem file: <cost> and <constraint>.
///
/// A cost without a window (from, to, at) takes the place of the default costs of its quantity; one with a window is
/// added to them; weight 0 leaves a term out, so that it costs nothing. A constraint with lower or upper is a range,
/// otherwise its value equals its target. Targets are expanded to the layout of cav_term and relative ones resolved
/// here, so solvers see numbers only.
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "math3.h"
#include "objects.h"
#include "problem_file.h"
#include "quantity.h"

static const double near_knot = 1e-6; // of a step

// seconds of an attribute, or "end"
static cav_status instant(const cav_problem_reader *reader, const cav_xml_node *node, const char *name,
                          double *seconds) {
  const char *text = cav_xml_text(node, name, NULL);
  double duration = reader->problem->duration;
  if (!text) return CAV_OK;
  char *end;
  double value = strcmp(text, "end") ? cav_file_number(text, &end) : duration;
  if (strcmp(text, "end") && (end == text || end[strspn(end, " ")] || !isfinite(value))) {
    return cav_xml_fail(reader->error, node, name, "expected seconds or 'end', got '%.60s'", text);
  }
  if (value < 0 || value > duration * (1 + near_knot)) {
    return cav_xml_fail(reader->error, node, name, "expected a time within the horizon, 0 .. %g s, got %g", duration,
                        value);
  }
  *seconds = value;
  return CAV_OK;
}

cav_status cav_problem_window(const cav_problem_reader *reader, const cav_xml_node *node, double *from, double *to) {
  if (cav_xml_get(node, "at") && (cav_xml_get(node, "from") || cav_xml_get(node, "to"))) {
    return cav_xml_fail(reader->error, node, "at", "contradicts attributes 'from' and 'to'; give one or the others");
  }
  cav_status status = instant(reader, node, "from", from);
  if (!status) status = instant(reader, node, "to", to);
  if (!status && cav_xml_get(node, "at")) {
    status = instant(reader, node, "at", from);
    *to = *from;
  }
  if (status) return status;
  double end = *to < 0 ? reader->problem->duration : *to, h = reader->problem->timestep;
  if (*from > end)
    return cav_xml_fail(reader->error, node, "from", "the window ends at %g s, before it starts at %g s", end, *from);
  if (*from < end && ceil(*from / h - near_knot) > floor(end / h + near_knot)) {
    return cav_xml_fail(reader->error, node, "from", "no knot lies between %g and %g s; knots are %g s apart", *from,
                        end, h);
  }
  return CAV_OK;
}

// an attribute that picks dofs
static cav_status read_dofs(const cav_problem_reader *reader, const cav_xml_node *node, cav_term *term) {
  term->dofs = (cav_dof_set)cav_xml_word(node, "dofs", term->dofs);
  if (!cav_xml_get(node, "joint")) return CAV_OK;
  if (cav_xml_get(node, "dofs")) {
    return cav_xml_fail(reader->error, node, "joint", "contradicts attribute 'dofs'; give one of the two");
  }
  term->dofs = CAV_DOFS_ONE;
  term->joint = cav_problem_find(reader, node, "joint", CAV_OBJECT_JOINT);
  return term->joint < 0 ? CAV_BAD_INPUT : CAV_OK;
}

int cav_problem_selects(const cav_model *m, const cav_term *term, int d) {
  const cav_joint *joint = &m->joint[m->dof[d].joint];
  int free = joint->type == CAV_JOINT_FREE, place = d - joint->dof;
  switch (term->dofs) {
    case CAV_DOFS_ALL:
      return 1;
    case CAV_DOFS_ROOT_LINEAR:
      return free && place < 3;
    case CAV_DOFS_ROOT_ANGULAR:
      return free && place >= 3;
    case CAV_DOFS_JOINTS:
      return !free;
    case CAV_DOFS_DRIVEN:
      return !free && m->link[joint->link].driven;
    case CAV_DOFS_ONE:
      return m->dof[d].joint == term->joint;
  }
  return 0;
}

// one number for each selected dof, or one for all, laid out over nv
static void spread(const cav_model *m, const cav_term *term, const double *number, int count, double *target) {
  for (int d = 0, k = 0; d < m->nv; d++) {
    if (!cav_problem_selects(m, term, d)) continue;
    target[d] = number[count == 1 ? 0 : k];
    k++;
  }
}

// numbers of a target: of a posture, of a rate, of a sensor or of the one component of it that counts
static int target_count(const cav_model *m, const cav_term *term) {
  int n = 0;
  if (term->quantity == CAV_QUANTITY_CONFIGURATION) return m->nq;
  if (term->quantity == CAV_QUANTITY_SENSOR)
    return term->component >= 0 && term->sensor.dim != 4 ? 1 : term->sensor.dim;
  for (int d = 0; d < m->nv; d++) n += cav_problem_selects(m, term, d);
  return n;
}

// an axis of a frame as a whole, whose length is one
static int is_direction(const cav_term *term) {
  const cav_sensor_type type = term->sensor.type;
  return term->quantity == CAV_QUANTITY_SENSOR && term->component < 0 &&
         (type == CAV_SENSOR_FRAMEXAXIS || type == CAV_SENSOR_FRAMEYAXIS || type == CAV_SENSOR_FRAMEZAXIS);
}

// brings a target that holds orientations or a direction to unit length; 0 if one is zero
static int normalise(const cav_model *m, const cav_term *term, double *target) {
  if (term->quantity == CAV_QUANTITY_CONFIGURATION) {
    cav_configuration_normalise(m, target);
  } else if (term->quantity == CAV_QUANTITY_SENSOR && term->sensor.dim == 4) {
    double *w = target, length = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2] + w[3] * w[3]);
    for (int i = 0; i < 4; i++) w[i] /= length > 0 ? length : 1;
    return length > 1e-9;
  } else if (is_direction(term)) {
    double length = norm3(target);
    for (int i = 0; i < 3; i++) target[i] /= length > 0 ? length : 1;
    return length > 1e-9;
  }
  return 1;
}

// targets by a table, dim numbers each
static cav_status read_table(const cav_problem_reader *reader, const cav_xml_node *node, cav_term *term, int dim) {
  const cav_model *m = reader->model;
  cav_problem_targets table = {.count = target_count(m, term)};
  cav_status status = cav_problem_table(reader, node, &table);
  if (status) return status;
  double *target = cav_problem_alloc(reader->owner, sizeof(double) * (size_t)table.n * (size_t)dim);
  if (!target) return cav_problem_no_memory(reader);
  for (int i = 0; i < table.n; i++) {
    const double *in = table.value + i * table.count;
    double *out = target + i * dim;
    int rate = cav_quantity_rule_of(term->quantity)->of == CAV_OF_RATE;
    int first = term->quantity == CAV_QUANTITY_SENSOR && table.count == 1 && term->component >= 0 ? term->component : 0;
    if (rate) spread(m, term, in, table.count, out);
    if (!rate) memcpy(out + first, in, sizeof(double) * (size_t)table.count);
    if (!normalise(m, term, out))
      return cav_xml_fail(reader->error, node, "file", "the %s at %g s is zero",
                          is_direction(term) ? "direction" : "quaternion", table.time[i]);
  }
  term->target = target;
  term->nwaypoint = table.n;
  term->waypoint_time = table.time;
  return CAV_OK;
}

// a table stands alone
static cav_status check_sources(const cav_problem_reader *reader, const cav_xml_node *node, const char *own) {
  if (!cav_xml_get(node, "file") && cav_xml_get(node, "columns"))
    return cav_xml_fail(reader->error, node, "columns", "says which columns of attribute 'file', which is missing");
  if (!cav_xml_get(node, "file") && cav_xml_get(node, "offset"))
    return cav_xml_fail(reader->error, node, "offset", "is a time of attribute 'file', which is missing");
  if (cav_xml_get(node, "file") && own)
    return cav_xml_fail(reader->error, node, "file", "contradicts %s; give one of the two", own);
  return CAV_OK;
}

// room for the targets of a term and, with waypoints, their times; checks that times increase
static cav_status make_targets(const cav_problem_reader *reader, const cav_xml_node *node, int dim, cav_term *term,
                               double **target) {
  const cav_xml_node *first = cav_problem_child(node, "waypoint");
  int n = 0;
  for (const cav_xml_node *w = first; w; w = cav_xml_next(w)) n++;
  *target = cav_problem_alloc(reader->owner, sizeof(double) * (size_t)(n ? n : 1) * (size_t)(dim + 1));
  if (!*target) return cav_problem_no_memory(reader);
  double *time = *target + (size_t)(n ? n : 1) * (size_t)dim, before = -1;
  int i = 0;
  for (const cav_xml_node *w = first; w; w = cav_xml_next(w)) {
    time[i] = cav_xml_real(w, "time", 0);
    if (time[i] < 0 || time[i] > reader->problem->duration * (1 + near_knot)) {
      return cav_xml_fail(reader->error, w, "time", "expected a time within the horizon, 0 .. %g s, got %g",
                          reader->problem->duration, time[i]);
    }
    if (time[i] <= before)
      return cav_xml_fail(reader->error, w, "time", "expected a time after the one before, %g s, got %g", before,
                          time[i]);
    before = time[i++];
  }
  term->target = *target;
  term->nwaypoint = n;
  term->waypoint_time = n ? time : NULL;
  return CAV_OK;
}

static int gives_posture(const cav_xml_node *node) {
  return cav_xml_get(node, "key") || cav_xml_get(node, "qpos") || cav_xml_get(node, "degrees");
}

// the goal's posture, but for the angle of the one hinge that the term is of
static cav_status angle_of(const cav_problem_reader *reader, const cav_xml_node *node, const cav_term *term,
                           double *q) {
  const cav_model *m = reader->model;
  const cav_joint *one = term->dofs == CAV_DOFS_ONE ? &m->joint[term->joint] : NULL;
  if (!one)
    return cav_xml_fail(reader->error, node, "degrees", "is the angle of one hinge; name it by 'joint' of <posture>");
  if (one->type == CAV_JOINT_SLIDE)
    return cav_xml_fail(reader->error, node, "degrees", "joint '%s' slides; give its metres in 'qpos'", one->name);
  if (one->type != CAV_JOINT_HINGE)
    return cav_xml_fail(reader->error, node, "degrees", "joint '%s' is no hinge; give a posture by 'key' or 'qpos'",
                        one->name);
  memcpy(q, reader->problem->q_goal, (size_t)m->nq * sizeof *q);
  q[one->q] = cav_xml_real(node, "degrees", 0) * M_PI / 180;
  return CAV_OK;
}

// a posture by keyframe or numbers, or by one number where the term is of one hinge or slide
static cav_status posture_of(const cav_problem_reader *reader, const cav_xml_node *node, const cav_term *term,
                             double *q) {
  const cav_model *m = reader->model;
  const cav_xml_value *numbers = cav_xml_get(node, "qpos");
  const int key = cav_xml_get(node, "key") != NULL;
  if (numbers && key)
    return cav_xml_fail(reader->error, node, "qpos", "contradicts attribute 'key'; give one of the two");
  if ((numbers || key) && cav_xml_get(node, "degrees"))
    return cav_xml_fail(reader->error, node, "degrees", "contradicts attribute '%s'; give one of the two",
                        key ? "key" : "qpos");
  if (cav_xml_get(node, "degrees")) return angle_of(reader, node, term, q);
  if (!numbers) return cav_problem_key(reader, node, q);
  const cav_joint *one = term->dofs == CAV_DOFS_ONE ? &m->joint[term->joint] : NULL;
  if (one && numbers->count == 1 && (one->type == CAV_JOINT_HINGE || one->type == CAV_JOINT_SLIDE)) {
    memcpy(q, reader->problem->q_goal, (size_t)m->nq * sizeof *q);
    cav_xml_reals(node, "qpos", q + one->q, 1);
    return CAV_OK;
  }
  if (numbers->count != m->nq) {
    return cav_xml_fail(reader->error, node, "qpos", "expected %d numbers for the model '%s'%s, got %d", m->nq, m->name,
                        one ? ", or one for the joint" : "", numbers->count);
  }
  cav_xml_reals(node, "qpos", q, m->nq);
  cav_configuration_normalise(m, q);
  return CAV_OK;
}

static cav_status read_posture(const cav_problem_reader *reader, const cav_xml_node *node, cav_term *term) {
  cav_status status = read_dofs(reader, node, term);
  const cav_xml_node *waypoint = cav_problem_child(node, "waypoint");
  int own = gives_posture(node);
  if (!status)
    status = check_sources(reader, node, own ? "the posture that <posture> gives" : waypoint ? "<waypoint>" : NULL);
  if (!status && cav_xml_get(node, "file")) return read_table(reader, node, term, reader->model->nq);
  if (status || (!own && !waypoint)) return status;
  if (own && waypoint)
    return cav_xml_fail(reader->error, waypoint, NULL,
                        "contradicts the posture that <posture> gives; remove one of the two");
  double *target;
  int nq = reader->model->nq;
  status = make_targets(reader, node, nq, term, &target);
  if (!status && own) return posture_of(reader, node, term, target);
  for (int i = 0; waypoint && !status; i++, waypoint = cav_xml_next(waypoint)) {
    if (!gives_posture(waypoint))
      return cav_xml_fail(reader->error, waypoint, "key", "is missing; give 'key', 'qpos' or 'degrees'");
    status = posture_of(reader, waypoint, term, target + i * nq);
  }
  return status;
}

// targets of rates: one number for all selected dofs or one for each, laid out over nv
static cav_status rate_target(const cav_problem_reader *reader, const cav_xml_node *node, const cav_term *term,
                              double *target) {
  const cav_model *m = reader->model;
  const cav_xml_value *given = cav_xml_get(node, "target");
  int n = target_count(m, term);
  if (given->count != 1 && given->count != n) {
    return cav_xml_fail(reader->error, node, "target", "expected one number, or %d, one for each selected dof, got %d",
                        n, given->count);
  }
  spread(m, term, given->number, given->count, target);
  return CAV_OK;
}

// targets by the attribute of the element or by waypoints, through what reads one of them
static cav_status read_targets(const cav_problem_reader *reader, const cav_xml_node *node, cav_term *term, int dim,
                               cav_status (*read)(const cav_problem_reader *, const cav_xml_node *, const cav_term *,
                                                  double *)) {
  const cav_xml_node *waypoint = cav_problem_child(node, "waypoint");
  int own = cav_xml_get(node, "target") != NULL;
  cav_status status = check_sources(reader, node, own ? "attribute 'target'" : waypoint ? "<waypoint>" : NULL);
  if (!status && cav_xml_get(node, "file")) return read_table(reader, node, term, dim);
  if (status || (!own && !waypoint)) return status;
  if (own && waypoint)
    return cav_xml_fail(reader->error, node, "target", "contradicts <waypoint>; give one of the two");
  double *target;
  status = make_targets(reader, node, dim, term, &target);
  if (!status && own) return read(reader, node, term, target);
  for (int i = 0; waypoint && !status; i++, waypoint = cav_xml_next(waypoint)) {
    status = read(reader, waypoint, term, target + i * dim);
  }
  return status;
}

static cav_status read_rate(const cav_problem_reader *reader, const cav_xml_node *node, cav_term *term) {
  cav_status status = read_dofs(reader, node, term);
  return status ? status : read_targets(reader, node, term, reader->model->nv, rate_target);
}

// what a sensor's target is called, and its kind; FRAME stands for all that have a frame
static const struct {
  const char *name;
  cav_object_type type;
} wanted_of[] = {[CAV_TARGET_NONE] = {"nothing", CAV_OBJECT_TYPES},
                 [CAV_TARGET_FRAME] = {"body, xbody, geom or site", CAV_OBJECT_TYPES},
                 [CAV_TARGET_BODY] = {"body", CAV_OBJECT_BODY},
                 [CAV_TARGET_SITE] = {"site", CAV_OBJECT_SITE},
                 [CAV_TARGET_SURFACE] = {"body, geom or site", CAV_OBJECT_TYPES},
                 [CAV_TARGET_SCALAR_JOINT] = {"joint", CAV_OBJECT_JOINT},
                 [CAV_TARGET_BALL_JOINT] = {"joint", CAV_OBJECT_JOINT},
                 [CAV_TARGET_LIMITED_JOINT] = {"joint", CAV_OBJECT_JOINT},
                 [CAV_TARGET_TENDON] = {"tendon", CAV_OBJECT_TENDON},
                 [CAV_TARGET_LIMITED_TENDON] = {"tendon", CAV_OBJECT_TENDON},
                 [CAV_TARGET_ACTUATOR] = {"actuator", CAV_OBJECT_ACTUATOR}};

static int has_frame(cav_object_type type) {
  return type == CAV_OBJECT_BODY || type == CAV_OBJECT_XBODY || type == CAV_OBJECT_GEOM || type == CAV_OBJECT_SITE;
}

// whether a sensor looks at objects of that kind
static int looks_at(const cav_sensor *sensor) {
  cav_sensor_target target = cav_sensor_rule_of(sensor->type)->target;
  if (target == CAV_TARGET_SURFACE) return has_frame(sensor->object_type) && sensor->object_type != CAV_OBJECT_XBODY;
  return target == CAV_TARGET_FRAME ? has_frame(sensor->object_type) : sensor->object_type == wanted_of[target].type;
}

// the kind of joint or tendon that a sensor needs where its own is none, NULL: it is
static const char *lacks(const cav_model *m, const cav_sensor *sensor) {
  const char *needs = NULL;
  cav_sensor_target target = cav_sensor_rule_of(sensor->type)->target;
  if (target == CAV_TARGET_SCALAR_JOINT && m->joint[sensor->object].type < CAV_JOINT_SLIDE)
    needs = "a hinge or a slide";
  if (target == CAV_TARGET_BALL_JOINT && m->joint[sensor->object].type != CAV_JOINT_BALL) needs = "a ball joint";
  if (target == CAV_TARGET_LIMITED_JOINT && !m->joint[sensor->object].limited) needs = "a joint with a limit";
  if (target == CAV_TARGET_LIMITED_TENDON && !m->tendon[sensor->object].limited) needs = "a tendon with a limit";
  return needs;
}

// a joint or tendon of the kind that the sensor needs
static cav_status check_object(const cav_problem_reader *reader, const cav_xml_node *node, const char *given,
                               const cav_sensor *sensor) {
  const char *needs = lacks(reader->model, sensor);
  if (!needs) return CAV_OK;
  return cav_xml_fail(reader->error, node, given, "a %s needs %s; '%.60s' is none",
                      cav_sensor_rule_of(sensor->type)->name, needs, cav_xml_text(node, given, ""));
}

cav_status cav_sensor_of(const cav_model *m, cav_sensor_type type, cav_object_type object_type, int object,
                         cav_sensor *sensor, cav_error *error) {
  int n = 0;
  size_t stride;
  if ((unsigned)type >= CAV_SENSOR_TYPES) return cav_file_fail(error, CAV_BAD_INPUT, 0, "there is no such sensor");
  const cav_sensor_rule *rule = cav_sensor_rule_of(type);
  *sensor = (cav_sensor){.name = "", .type = type, .object_type = object_type, .object = object, .adr = -1};
  sensor->dim = rule->dim;
  if (rule->target == CAV_TARGET_NONE)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "a %s reads nothing of the motion; windows tell the time",
                         rule->name);
  if (!looks_at(sensor))
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "a %s looks at a %s", rule->name, wanted_of[rule->target].name);
  cav_object_names(m, object_type, &n, &stride);
  if (object < 0 || object >= n)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "a %s of object %d, of which the model '%.100s' has %d", rule->name,
                         object, m->name, n);
  const char *needs = lacks(m, sensor);
  if (!needs) return CAV_OK;
  return cav_file_fail(error, CAV_BAD_INPUT, 0, "a %s needs %s; '%.60s' is none", rule->name, needs,
                       cav_object_name(m, object_type, object));
}

// the frame in which a frame sensor declared in the file reads
static cav_status read_reference(const cav_problem_reader *reader, const cav_xml_node *node, cav_sensor *sensor) {
  static const cav_object_type types[] = {CAV_OBJECT_BODY, CAV_OBJECT_XBODY, CAV_OBJECT_GEOM, CAV_OBJECT_SITE};
  const cav_sensor_rule *rule = cav_sensor_rule_of(sensor->type);
  int named = cav_xml_get(node, "refname") != NULL, typed = cav_xml_get(node, "reftype") != NULL;
  if (!named && !typed) return CAV_OK;
  if (named != typed)
    return cav_xml_fail(reader->error, node, named ? "reftype" : "refname", "is missing; a frame needs both");
  if (rule->target != CAV_TARGET_FRAME || rule->stage == CAV_READS_ACCELERATION)
    return cav_xml_fail(reader->error, node, "refname", "a %s reads in no other frame", rule->name);
  sensor->referred = 1;
  sensor->reference_type = types[cav_xml_word(node, "reftype", 0)];
  sensor->reference = cav_problem_find_frame(reader, node, "refname", &sensor->reference_type);
  return sensor->reference < 0 ? CAV_BAD_INPUT : CAV_OK;
}

// the object that a sensor declared in the file looks at
static cav_status read_object(const cav_problem_reader *reader, const cav_xml_node *node, cav_sensor *sensor) {
  const char *given = NULL;
  for (cav_object_type type = 0; type < CAV_OBJECT_TYPES; type++) {
    const char *name = cav_object_kind_of(type)->attribute;
    if (!cav_xml_accepts(node, name) || !cav_xml_get(node, name)) continue;
    if (given) return cav_xml_fail(reader->error, node, name, "contradicts attribute '%s'; give one of the two", given);
    given = name;
    sensor->object_type = type;
  }
  const cav_sensor_rule *rule = cav_sensor_rule_of(sensor->type);
  int bodies = rule->target == CAV_TARGET_FRAME || rule->target == CAV_TARGET_SURFACE;
  const char *wanted = wanted_of[rule->target].name;
  if (rule->target == CAV_TARGET_NONE)
    return cav_xml_fail(reader->error, node, "type", "a %s reads nothing of the motion; windows tell the time",
                        rule->name);
  if (!given)
    return cav_xml_fail(reader->error, node, bodies ? "body" : wanted, "is missing; a %s needs one of: %s", rule->name,
                        wanted);
  if (!looks_at(sensor)) return cav_xml_fail(reader->error, node, given, "a %s looks at a %s", rule->name, wanted);
  sensor->object = cav_problem_find_frame(reader, node, given, &sensor->object_type);
  if (sensor->object < 0) return CAV_BAD_INPUT;
  cav_status status = check_object(reader, node, given, sensor);
  return status ? status : read_reference(reader, node, sensor);
}

// x, y, z or a number; of an orientation, of the rotation vector to its target
static cav_status read_component(const cav_problem_reader *reader, const cav_xml_node *node, cav_term *term) {
  const char *text = cav_xml_text(node, "component", NULL);
  if (!text) return CAV_OK;
  int dim = term->sensor.dim == 4 ? 3 : term->sensor.dim;
  int index = strlen(text) == 1 ? (strchr("012", *text) ? *text - '0' : strchr("xyz", *text) ? *text - 'x' : -1) : -1;
  if (index < 0 || index >= dim || dim == 1) {
    return cav_xml_fail(
        reader->error, node, "component",
        dim == 1 ? "the sensor has one value; remove it, got '%.40s'" : "expected x, y or z, got '%.40s'", text);
  }
  term->component = index;
  return CAV_OK;
}

// three angles in the place of a quaternion: what it would be
static cav_status refuse_angles(const cav_problem_reader *reader, const cav_xml_node *node, const double angle[3]) {
  const int degrees = fmax(fabs(angle[0]), fmax(fabs(angle[1]), fabs(angle[2]))) > 2 * M_PI;
  double quat[4] = {1, 0, 0, 0};
  for (int i = 0; i < 3; i++) {
    double axis[3] = {0}, rotation[4];
    axis[i] = angle[i] * (degrees ? M_PI / 180 : 1);
    quat_exp(rotation, axis);
    quat_mul(quat, quat, rotation);
  }
  return cav_xml_fail(
      reader->error, node, "target",
      "expected 4 numbers, a quaternion w x y z, got 3; as angles in %s about x, then y, then z they are "
      "%.4g %.4g %.4g %.4g",
      degrees ? "degrees" : "radians", quat[0] + 0.0, quat[1] + 0.0, quat[2] + 0.0, quat[3] + 0.0);
}

// targets of a sensor: all of its values, or the one that counts
static cav_status sensor_target(const cav_problem_reader *reader, const cav_xml_node *node, const cav_term *term,
                                double *target) {
  const cav_xml_value *given = cav_xml_get(node, "target");
  int rotation = term->sensor.dim == 4, one = term->component >= 0 && !rotation, wanted = one ? 1 : term->sensor.dim;
  if (rotation && given->count == 3) return refuse_angles(reader, node, given->number);
  if (given->count != wanted) {
    return cav_xml_fail(reader->error, node, "target", "expected %d number%s%s, got %d", wanted, wanted > 1 ? "s" : "",
                        one        ? ", of the component"
                        : rotation ? ", a quaternion w x y z"
                                   : "",
                        given->count);
  }
  cav_xml_reals(node, "target", target + (one ? term->component : 0), wanted);
  if (term->sensor.type == CAV_SENSOR_TOUCH && *target < 0)
    return cav_xml_fail(reader->error, node, "target", "a touch is never negative, got %g", *target);
  if (!rotation && (!is_direction(term) || cav_xml_word(node, "relative", 0))) return CAV_OK;
  if (normalise(reader->model, term, target)) return CAV_OK;
  return cav_xml_fail(reader->error, node, "target", "expected a %s that is not zero",
                      rotation ? "quaternion" : "direction");
}

// reading + target, or reading * target for orientations
static void add_reading(const cav_sensor *sensor, const double *reading, double *target) {
  if (sensor->dim != 4) {
    for (int i = 0; i < sensor->dim; i++) target[i] += reading[i];
    return;
  }
  const double *a = reading, b[4] = {target[0], target[1], target[2], target[3]};
  target[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  target[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  target[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
  target[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
}

// targets and bounds given from the reading at the start or the goal
static cav_status make_absolute(const cav_problem_reader *reader, const cav_xml_node *node, cav_term *term) {
  int relation = cav_xml_word(node, "relative", 0);
  if (!relation) return CAV_OK;
  const char *what = cav_sensor_rule_of(term->sensor.type)->name;
  if (cav_sensor_rule_of(term->sensor.type)->stage != CAV_READS_POSITION)
    return cav_xml_fail(reader->error, node, "relative", "a %s has no reading at a posture at rest", what);
  double reading[CAV_SENSOR_DIM_MAX] = {0};
  cav_status status =
      cav_position(reader->model, reader->state, relation == 1 ? reader->problem->q_start : reader->problem->q_goal);
  if (status)
    return cav_xml_fail_as(reader->error, status, node, "relative", "the posture cannot be evaluated: %s",
                           cav_status_name(status));
  cav_sensor_read(reader->model, reader->state, &term->sensor, reading);
  int rotation = term->sensor.dim == 4;
  if (term->use == CAV_USE_RANGE && !rotation && !term->target && (term->sensor.dim == 1 || term->component >= 0)) {
    double from = reading[term->component < 0 ? 0 : term->component];
    term->lower += from;
    term->upper += from;
    return CAV_OK;
  }
  if (!term->target) {
    double *target;
    status = make_targets(reader, node, term->sensor.dim, term, &target);
    if (status) return status;
    if (rotation) target[0] = 1;
  }
  for (int i = 0; i < (term->nwaypoint ? term->nwaypoint : 1); i++) {
    add_reading(&term->sensor, reading, (double *)term->target + i * term->sensor.dim);
  }
  return CAV_OK;
}

cav_status cav_problem_sensor(const cav_problem_reader *reader, const cav_xml_node *node, cav_term *term) {
  cav_status status = CAV_OK;
  if (cav_xml_get(node, "type")) {
    term->sensor = (cav_sensor){.name = "", .type = (cav_sensor_type)cav_xml_word(node, "type", 0), .adr = -1};
    term->sensor.dim = cav_sensor_rule_of(term->sensor.type)->dim;
    status = read_object(reader, node, &term->sensor);
  } else if (cav_xml_get(node, "name")) {
    int sensor = cav_problem_find(reader, node, "name", CAV_OBJECT_SENSOR);
    if (sensor < 0) return CAV_BAD_INPUT;
    term->sensor = reader->model->sensor[sensor];
    if (term->sensor.type == CAV_SENSOR_CLOCK)
      return cav_xml_fail(reader->error, node, "name", "a clock reads nothing of the motion; windows tell the time");
  } else {
    status = cav_xml_fail(reader->error, node, "type",
                          "is missing; give the type of a sensor, or in 'name' one of the model's");
  }
  return status ? status : read_component(reader, node, term);
}

int cav_problem_needs_target(const cav_term *term) {
  const cav_sensor *sensor = &term->sensor;
  return is_direction(term) || sensor->type == CAV_SENSOR_SUBTREECOM ||
         (sensor->type == CAV_SENSOR_FRAMEPOS && !sensor->referred);
}

static cav_status read_sensor(const cav_problem_reader *reader, const cav_xml_node *node, cav_term *term) {
  cav_status status = cav_problem_sensor(reader, node, term);
  if (!status) status = read_targets(reader, node, term, term->sensor.dim, sensor_target);
  if (!status && !term->target && term->use != CAV_USE_RANGE && !cav_xml_word(node, "relative", 0) &&
      cav_problem_needs_target(term)) {
    status = cav_xml_fail(reader->error, node, "target",
                          "is missing; give %s, or relative=\"start\" or \"goal\" to count from the reading there",
                          is_direction(term) ? "a direction" : "a place in the world");
  }
  return status ? status : make_absolute(reader, node, term);
}

static cav_status read_touch(const cav_problem_reader *reader, const cav_xml_node *node, cav_term *term) {
  if (!cav_xml_get(node, "body")) return CAV_OK;
  term->body = cav_problem_find(reader, node, "body", CAV_OBJECT_BODY);
  if (term->body < 0) return CAV_BAD_INPUT;
  if (reader->model->body[term->body].link == 0 && term->quantity != CAV_QUANTITY_FORCE &&
      term->quantity != CAV_QUANTITY_EDGE_FORCE)
    return cav_xml_fail(reader->error, node, "body",
                        "expected a body that moves (fixed ones for forces alone), got '%.80s'; <freejoint/> in its "
                        "<body> lets it move",
                        cav_xml_text(node, "body", ""));
  return CAV_OK;
}

// what its values are of
static cav_status read_values(const cav_problem_reader *reader, const cav_xml_node *node, cav_term *term) {
  switch (cav_quantity_rule_of(term->quantity)->of) {
    case CAV_OF_SENSOR:
      return read_sensor(reader, node, term);
    case CAV_OF_POSTURE:
      return read_posture(reader, node, term);
    case CAV_OF_RATE:
      return read_rate(reader, node, term);
    case CAV_OF_CONTACTS:
      return read_touch(reader, node, term);
    case CAV_OF_ACTUATORS:
    case CAV_OF_TRACK:
    case CAV_OF_USER:
      break;
  }
  return CAV_OK;
}

// tolerance of a term's target: a number above 0, or "any": told only
static cav_status read_within(const cav_problem_reader *reader, const cav_xml_node *node, cav_term *term) {
  // what has no target accepts none
  const char *text = cav_xml_accepts(node, "within") ? cav_xml_text(node, "within", NULL) : NULL;
  if (!text) return CAV_OK;
  char *end = NULL;
  term->within = strcmp(text, "any") ? cav_file_number(text, &end) : INFINITY;
  if (!end || (end > text && !*end && term->within > 0 && isfinite(term->within))) return CAV_OK;
  return cav_xml_fail(reader->error, node, "within",
                      "expected a number above 0, in the unit of the quantity, or 'any', got '%.40s'", text);
}

// what has to equal its target within a tolerance is bounded
static void bound_by_tolerance(cav_term *term) {
  if (term->use != CAV_USE_EQUAL || !(term->within > 0) || isinf(term->within)) return;
  term->use = CAV_USE_RANGE;
  term->lower = -term->within;
  term->upper = term->within;
  term->within = 0;
}

// bounds of a constraint, or the weight of a cost
static cav_status read_use(const cav_problem_reader *reader, const cav_xml_node *node, int hard, cav_term *term) {
  if (hard) term->use = cav_xml_get(node, "lower") || cav_xml_get(node, "upper") ? CAV_USE_RANGE : CAV_USE_EQUAL;
  term->lower = cav_xml_real(node, "lower", term->lower);
  term->upper = cav_xml_real(node, "upper", term->upper);
  term->weight = cav_xml_real(node, "weight", term->weight);
  term->scale = cav_xml_real(node, "scale", term->scale);
  term->norm = hard ? CAV_NORM_SQUARE : (cav_norm)cav_xml_word(node, "norm", term->norm);
  if (term->lower > term->upper)
    return cav_xml_fail(reader->error, node, "lower", "%g lies above 'upper', %g", term->lower, term->upper);
  if (!(term->weight >= 0 && term->weight <= CAV_WEIGHT_MOST))
    return cav_xml_fail(reader->error, node, "weight",
                        "expected a number from 0 to %g, got %g; what has to hold exactly is a term of <constraint>",
                        CAV_WEIGHT_MOST, term->weight);
  if (!(term->scale > 0))
    return cav_xml_fail(reader->error, node, "scale", "expected a number above 0, got %g", term->scale);
  return read_within(reader, node, term);
}

// the term of an element, or the terms of a record: *n of them
static cav_status read_term(const cav_problem_reader *reader, const cav_xml_node *node, int hard, cav_term *term,
                            int *n) {
  *n = 1;
  cav_quantity quantity = 0;
  while (strcmp(cav_quantity_rule_of(quantity)->name, node->rule->name)) quantity++;
  *term = cav_term_cost(quantity, 0);
  term->name = cav_problem_text(reader->owner, cav_xml_text(node, "name", node->rule->name));
  if (!term->name) return cav_problem_no_memory(reader);
  cav_status status = read_use(reader, node, hard, term);
  if (!status) status = cav_problem_window(reader, node, &term->from, &term->to);
  if (!status && quantity != CAV_QUANTITY_TRACK) {
    status = read_values(reader, node, term);
    bound_by_tolerance(term);
  }
  if (status || quantity != CAV_QUANTITY_TRACK) return status;
  cav_term base = *term;
  return cav_problem_track(reader, node, &base, term, n);
}

static int has_window(const cav_xml_node *node) {
  return cav_xml_get(node, "from") || cav_xml_get(node, "to") || cav_xml_get(node, "at");
}

// whether a cost is of that quantity and over the whole horizon, so that it takes the defaults' place
static int replaces(const cav_xml_node *node, cav_quantity quantity) {
  const int part = has_window(node) ||
                   (cav_xml_accepts(node, "body") && cav_xml_get(node, "body") && !cav_xml_accepts(node, "type"));
  return !part && !strcmp(node->rule->name, cav_quantity_rule_of(quantity)->name);
}

static int replaced(const cav_xml_node *cost, cav_quantity quantity) {
  for (const cav_xml_node *node = cost ? cost->child : NULL; node; node = node->next)
    if (replaces(node, quantity)) return 1;
  return 0;
}

int cav_term_counts(const cav_term *term) {
  return term->weight > 0 || term->use != CAV_USE_COST || (term->quantity == CAV_QUANTITY_SLIP && term->within > 0);
}

/// Whether all that a link touches with is one sphere.
static int is_ball(const cav_model *m, int link) {
  int spheres = 0, others = 0;
  for (int g = 0; g < m->ngeom; g++)
    if (m->geom[g].link == link && (m->geom[g].contype || m->geom[g].conaffinity))
      *(m->geom[g].type == CAV_GEOM_SPHERE ? &spheres : &others) += 1;
  return spheres == 1 && !others;
}

int cav_problem_is_wheel(const cav_model *m, int j) {
  const cav_joint *joint = &m->joint[j];
  const cav_link *link = &m->link[joint->link];
  double arm[3], off[3];
  if (joint->type != CAV_JOINT_HINGE || joint->limited || joint->stiffness != 0) return 0;
  // what slides, too, rolls if it is a ball
  if (link->njoint != 1 && (j != link->joint + link->njoint - 1 || !is_ball(m, joint->link))) return 0;
  for (int i = joint->link + 1; i < m->nlink; i++)
    if (m->link[i].parent == joint->link) return 0;
  sub3(arm, link->com, joint->pos);
  cross3(off, arm, joint->axis);
  return norm3(off) < 1e-6;
}

// adds a default: that of the posture for each joint but wheels, by itself where there are any
static void add_default(cav_problem *p, const cav_term *term) {
  const cav_model *m = p->model;
  int wheels = 0, posture = term->quantity == CAV_QUANTITY_CONFIGURATION;
  for (int j = 0; j < m->njoint && posture; j++) wheels += cav_problem_is_wheel(m, j);
  if (!wheels) p->term[p->nterm++] = *term;
  for (int j = 0; j < m->njoint && wheels; j++) {
    if (!cav_problem_selects(m, term, m->joint[j].dof) || cav_problem_is_wheel(m, j)) continue;
    cav_term *one = &p->term[p->nterm++];
    *one = *term;
    one->dofs = CAV_DOFS_ONE;
    one->joint = j;
  }
}

// notes a default of all joints whose place is taken by costs of the file that leave some of these out
static void note_replaced(const cav_problem_reader *reader, const cav_xml_node *cost, const cav_term *usual) {
  const cav_model *m = reader->model;
  const cav_xml_node *first = NULL;
  int left = 0;
  if (!cav_term_has_dofs(usual) || usual->dofs == CAV_DOFS_ROOT_ANGULAR || usual->dofs == CAV_DOFS_ROOT_LINEAR) return;
  for (int d = 0; d < m->nv; d++) {
    const int joint = m->dof[d].joint, posture = usual->quantity == CAV_QUANTITY_CONFIGURATION;
    int selected = m->joint[joint].type == CAV_JOINT_FREE || (posture && cav_problem_is_wheel(m, joint)) ||
                   !cav_problem_selects(m, usual, d);
    for (const cav_xml_node *node = cost ? cost->child : NULL; node; node = node->next) {
      cav_term term = cav_term_cost(usual->quantity, 0);
      if (!replaces(node, usual->quantity)) continue;
      if (!first) first = node;
      // read before without a fault
      if (!read_dofs(reader, node, &term)) selected |= cav_problem_selects(m, &term, d);
    }
    left |= !selected;
  }
  if (!first || !left) return;
  const char *attribute = cav_xml_get(first, "joint") ? "joint" : "dofs";
  char *text = reader->owner->replaced;
  const size_t used = strlen(text);
  snprintf(text + used, sizeof reader->owner->replaced - used,
           "%s<%s %s=\"%.60s\"> takes the place of the default '%s' %g of all joints", used ? "; " : "",
           first->rule->name, attribute, cav_xml_text(first, attribute, ""), usual->name, usual->weight);
}

const char *cav_problem_replaced(const cav_problem *problem) {
  return ((const cav_problem_owner *)(const void *)problem)->replaced;
}

cav_status cav_problem_terms(const cav_problem_reader *reader) {
  const cav_xml_node *cost = cav_problem_child(reader->root, "cost"),
                     *constraint = cav_problem_child(reader->root, "constraint");
  const cav_xml_node *style = cost ? cav_problem_child(cost, "style") : NULL;
  int ndefault = CAV_DEFAULT_TERMS, most = CAV_DEFAULT_TERMS + CAV_STYLE_TERMS;
  for (const cav_xml_node *node = cost ? cost->child : NULL; node; node = node->next) most += CAV_TRACK_TERMS;
  for (const cav_xml_node *node = constraint ? constraint->child : NULL; node; node = node->next) most++;
  cav_problem *p = reader->problem;
  cav_term defaults[CAV_DEFAULT_TERMS + CAV_STYLE_TERMS];
  p->term = cav_problem_alloc(reader->owner, (size_t)(most + p->model->njoint) * sizeof *p->term);
  if (!p->term) return cav_problem_no_memory(reader);
  // defaults that the file leaves in place, then its own
  cav_problem_default_terms(defaults, CAV_DEFAULT_TERMS);
  if (style) ndefault = cav_style_terms((cav_style)cav_xml_word(style, "name", 0), defaults, ndefault);
  for (int i = 0; i < ndefault; i++)
    if (!replaced(cost, defaults[i].quantity)) add_default(p, &defaults[i]);
  cav_status status = CAV_OK;
  for (const cav_xml_node *node = cost ? cost->child : NULL; node && !status; node = node->next) {
    int n;
    if (node == style) continue;
    status = read_term(reader, node, 0, &p->term[p->nterm], &n);
    p->nterm += cav_term_counts(&p->term[p->nterm]) ? n : 0;
  }
  for (int i = 0; i < ndefault && !status; i++) note_replaced(reader, cost, &defaults[i]);
  for (const cav_xml_node *node = constraint ? constraint->child : NULL; node && !status; node = node->next) {
    int n;
    status = read_term(reader, node, 1, &p->term[p->nterm], &n);
    p->nterm += n;
  }
  return status;
}
