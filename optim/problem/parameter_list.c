/// <parameter>: numbers of the model that are found with a motion, and the values that a file gives them.
#include <math.h>
#include <string.h>

#include "objects.h"
#include "problem_file.h"

static const char *const components[] = {"x", "y", "z"};

// coordinates: one of three, of any sign
static int has_components(const cav_parameter *x) { return cav_parameter_rule_of(x->kind)->components > 1; }

static int is_of_joint(cav_parameter_kind kind) { return cav_parameter_rule_of(kind)->of == CAV_OBJECT_JOINT; }

// why the model has no such number; NULL: it has
static const char *wrong_object(const cav_model *m, const cav_parameter *x) {
  if (x->kind >= CAV_PARAMETER_KINDS) return "is of no kind";
  if (!isnan(cav_model_parameter(m, x))) return NULL;
  cav_object_type of = cav_parameter_rule_of(x->kind)->of;
  if (of == CAV_OBJECT_JOINT) return "is of a joint that the model does not have";
  if (of == CAV_OBJECT_GEOM)
    return x->object >= 0 && x->object < m->ngeom ? "is the friction of a geom that may touch nothing (contype, "
                                                    "conaffinity, <exclude>), so no motion tells it"
                                                  : "is of a geom that the model does not have";
  if (of == CAV_OBJECT_SITE)
    return x->object >= 0 && x->object < m->nsite ? "is of a site that never moves, so no motion tells it, or of no "
                                                    "coordinate: the component is 0, 1 or 2"
                                                  : "is of a site that the model does not have";
  if (!(x->object > 0 && x->object < m->nbody)) return "is of a body that the model does not have";
  if (m->body[x->object].link == 0)
    return "is of a body that never moves, being fixed to the world, so no motion tells it";
  if (!(m->body[x->object].mass > 0)) return "is of a body without mass; give it a mass in the model to begin with";
  return "is of no coordinate; the component is 0, 1 or 2 of a centre of mass, else 0";
}

const char *cav_problem_wrong_parameter(const cav_model *m, const cav_parameter *x) {
  const char *wrong = wrong_object(m, x);
  if (wrong) return wrong;
  double value = cav_model_parameter(m, x), low = x->range[0], high = x->range[1];
  if (!(x->prior[1] >= 0) || isinf(x->prior[1]) || !isfinite(x->prior[0]))
    return "needs a prior of finite mean and of a deviation that is not negative";
  if (low == 0 && high == 0) return NULL;
  if (!(low < high)) return "has a lower bound that is not below the upper one";
  if (!has_components(x) && !(high > 0)) return "has no value above 0 within its bounds";
  return value >= low && value <= high ? NULL : "begins outside its bounds; give a value within them";
}

// the object of the kind that the type wants, and no other
static cav_status read_object(const cav_problem_reader *reader, const cav_xml_node *node, cav_parameter *x) {
  static const cav_object_type kinds[] = {CAV_OBJECT_BODY, CAV_OBJECT_GEOM, CAV_OBJECT_JOINT, CAV_OBJECT_SITE};
  const cav_parameter_rule *rule = cav_parameter_rule_of(x->kind);
  const char *wanted = cav_object_kind_of(rule->of)->attribute;
  for (int k = 0; k < 4; k++) {
    const char *other = cav_object_kind_of(kinds[k])->attribute;
    if (kinds[k] != rule->of && cav_xml_get(node, other))
      return cav_xml_fail(reader->error, node, other, "type=\"%s\" is of a %s: give it as attribute '%s'", rule->name,
                          cav_object_kind_of(rule->of)->text, wanted);
  }
  if (!cav_xml_get(node, wanted))
    return cav_xml_fail(reader->error, node, wanted, "is missing: the %s whose %s is not known",
                        cav_object_kind_of(rule->of)->text, rule->name);
  x->object = cav_problem_find(reader, node, wanted, rule->of);
  return x->object < 0 ? reader->error->status : CAV_OK;
}

static cav_status read_component(const cav_problem_reader *reader, const cav_xml_node *node, cav_parameter *x) {
  const char *text = cav_xml_text(node, "component", NULL);
  if (!has_components(x))
    return text ? cav_xml_fail(reader->error, node, "component", "is of type=\"com\" and \"place\" alone; remove it")
                : CAV_OK;
  for (x->component = 0; text && x->component < 3; x->component++)
    if (!strcmp(text, components[x->component])) return CAV_OK;
  return text ? cav_xml_fail(reader->error, node, "component", "expected x, y or z, got '%.40s'", text)
              : cav_xml_fail(reader->error, node, "component", "is missing: x, y or z, one coordinate a <parameter>");
}

// value: the model's, or the file's
static cav_status read_numbers(const cav_problem_reader *reader, const cav_xml_node *node, cav_parameter *x,
                               double *value) {
  const char *of = cav_parameter_rule_of(x->kind)->name;
  int signless = has_components(x), positive = !is_of_joint(x->kind) && x->kind != CAV_PARAMETER_FRICTION;
  *value = cav_xml_real(node, "value", cav_model_parameter(reader->model, x));
  if (!signless && (positive ? !(*value > 0) : !(*value >= 0)))
    return cav_xml_fail(reader->error, node, "value", "expected a %s %s, got %g", of,
                        positive ? "above 0" : "of 0 or more", *value);
  x->prior[1] = cav_xml_real(node, "sd", 0);
  x->prior[0] = cav_xml_real(node, "prior", *value);
  if (cav_xml_get(node, "sd") && !(x->prior[1] > 0))
    return cav_xml_fail(reader->error, node, "sd", "expected a number above 0, got %g; without 'sd' nothing is known",
                        x->prior[1]);
  if (cav_xml_get(node, "prior") && !cav_xml_get(node, "sd"))
    return cav_xml_fail(reader->error, node, "prior",
                        "needs 'sd': how well it is known; or give 'value', where the "
                        "search begins");
  if (cav_xml_get(node, "lower") || cav_xml_get(node, "upper")) {
    x->range[0] = cav_xml_real(node, "lower", -INFINITY);
    x->range[1] = cav_xml_real(node, "upper", INFINITY);
  }
  return CAV_OK;
}

static cav_status read_one(const cav_problem_reader *reader, const cav_xml_node *node, cav_parameter *x,
                           double *value) {
  x->kind = (cav_parameter_kind)cav_xml_word(node, "type", 0);
  x->name = cav_problem_text(reader->owner, cav_xml_text(node, "name", ""));
  if (!x->name) return cav_problem_no_memory(reader);
  cav_status status = read_object(reader, node, x);
  if (!status) status = read_component(reader, node, x);
  const char *wrong = status ? NULL : wrong_object(reader->model, x);
  if (wrong) return cav_xml_fail(reader->error, node, NULL, "%s", wrong);
  return status ? status : read_numbers(reader, node, x, value);
}

cav_status cav_problem_parameters(const cav_problem_reader *reader) {
  const cav_xml_node *first = cav_problem_child(reader->root, "parameter");
  int n = 0;
  for (const cav_xml_node *node = first; node; node = cav_xml_next(node)) n++;
  if (n == 0) return CAV_OK;
  cav_parameter *list = cav_problem_alloc(reader->owner, (size_t)n * sizeof *list);
  double *value = cav_problem_alloc(reader->owner, (size_t)n * sizeof *value);
  if (!list || !value) return cav_problem_no_memory(reader);
  int i = 0;
  for (const cav_xml_node *node = first; node; node = cav_xml_next(node), i++) {
    cav_status status = read_one(reader, node, &list[i], &value[i]);
    for (int k = 0; k < i && !status; k++)
      if (list[k].kind == list[i].kind && list[k].object == list[i].object && list[k].component == list[i].component)
        status =
            cav_xml_fail(reader->error, node, NULL, "is the same as a <parameter> before it; remove one of the two");
    if (status) return status;
  }
  cav_status status = cav_model_set_parameters(reader->owner->model, n, list, value);
  if (status == CAV_NO_MEMORY) return cav_problem_no_memory(reader);
  i = 0;
  for (const cav_xml_node *node = first; node; node = cav_xml_next(node), i++) {
    const char *wrong = cav_problem_wrong_parameter(reader->model, &list[i]);
    if (wrong || status)
      return cav_xml_fail(reader->error, node, NULL, "%s", wrong ? wrong : "has an impossible value");
  }
  reader->problem->parameter = list;
  reader->problem->nparameter = n;
  return CAV_OK;
}
