/// Loading, freeing and searching models; names of statuses; the version.

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/model.h"
#include "compile.h"
#include "objects.h"
#include "remove.h"
#include "scene.h"
#include "spec.h"

cav_load_options cav_load_options_default(void) { return (cav_load_options){0}; }

// text: in the place of the file, NULL: none
static cav_model *load(const char *path, const char *text, const cav_load_options *options, const cav_xml_node *scene,
                       cav_error *error) {
  static const cav_xml_element *const roots[] = {&cav_mjcf_root, &cav_urdf_root, NULL};
  if (error) *error = (cav_error){.status = CAV_OK};
  cav_xml *xml = cav_xml_parse(path, text, roots, NULL, error);
  if (!xml) return NULL;
  if (scene && cav_xml_remove(xml, scene, error) != CAV_OK) {
    cav_xml_free(xml);
    return NULL;
  }
  cav_spec spec = {.xml = xml, .error = error, .load = *options, .scene = scene};
  int urdf = cav_xml_root(xml)->rule == &cav_urdf_root;
  if (options->floating && !urdf)
    cav_spec_fail(&spec, cav_xml_root(xml), NULL,
                  "floating is for URDF files, which have no other way to say it; give the body a <freejoint/>");
  if (urdf)
    cav_urdf_read(&spec, xml);
  else
    cav_mjcf_read(&spec, xml);
  cav_model *model = cav_compile(&spec);
  cav_spec_clear(&spec);
  cav_xml_free(xml);
  return model;
}

cav_model *cav_model_load(const char *path, cav_error *error) {
  cav_load_options options = cav_load_options_default();
  return load(path, NULL, &options, NULL, error);
}

cav_model *cav_model_load_with(const char *path, const cav_load_options *options, cav_error *error) {
  return load(path, NULL, options, NULL, error);
}

cav_model *cav_model_parse(const char *text, const char *folder, const cav_load_options *options, cav_error *error) {
  static const char name[] = "text";
  cav_load_options usual = cav_load_options_default();
  size_t length = folder ? strlen(folder) : 0, room = length + sizeof name + 1;
  char *path = malloc(room);
  if (!path) {
    if (error) *error = (cav_error){.status = CAV_NO_MEMORY, .text = "no memory to read a model from a text"};
    return NULL;
  }
  snprintf(path, room, "%s%s%s", length ? folder : "", length && folder[length - 1] != '/' ? "/" : "", name);
  cav_model *model = load(path, text, options ? options : &usual, NULL, error);
  free(path);
  return model;
}

cav_model *cav_model_load_scene(const char *path, const cav_load_options *options, const cav_xml_node *scene,
                                cav_error *error) {
  return load(path, NULL, options, scene, error);
}

void cav_model_free(cav_model *model) { free(model); }

const char *const *cav_object_names(const cav_model *model, cav_object_type type, int *n, size_t *stride) {
  static const struct {
    size_t array, count, size;
  } kinds[] = {
#define KIND(type, array, ...) \
  [CAV_OBJECT_##type] = {offsetof(cav_model, array), offsetof(cav_model, n##array), sizeof *((cav_model *)0)->array},
      CAV_OBJECTS(KIND)};
  // every object starts with its name
#define NAMED(type, array, ...) _Static_assert(offsetof(cav_##array, name) == 0, "an object starts with its name");
  CAV_OBJECTS(NAMED)
  const char *at = (const char *)model;
  *n = *(const int *)(const void *)(at + kinds[type].count);
  *stride = kinds[type].size;
  return *n ? *(const char *const *const *)(const void *)(at + kinds[type].array) : NULL;
}

int cav_object_find(const cav_model *model, cav_object_type type, const char *name) {
  if ((unsigned)type >= CAV_OBJECT_TYPES) return -1;
  int n;
  size_t stride;
  const char *const *names = cav_object_names(model, type, &n, &stride);
  return cav_name_find(names, n, stride, name);
}

const char *cav_geom_label(const cav_model *model, int geom, char label[CAV_GEOM_LABEL]) {
  const cav_geom *g = &model->geom[geom];
  if (*g->name) return g->name;
  const char *body = model->body[g->body].name;
  if (*body)
    snprintf(label, CAV_GEOM_LABEL, "geom %d of %.48s", g->number, body);
  else
    snprintf(label, CAV_GEOM_LABEL, "geom %d of body %d", g->number, g->body);
  return label;
}

const char *cav_geom_words(const cav_model *model, int geom, char words[CAV_WORDS]) {
  static const struct {
    const char *name;
    int sizes;
  } type[CAV_GEOM_TYPES] = {[CAV_GEOM_PLANE] = {"plane", 0},       [CAV_GEOM_SPHERE] = {"sphere", 1},
                            [CAV_GEOM_CAPSULE] = {"capsule", 2},   [CAV_GEOM_ELLIPSOID] = {"ellipsoid", 3},
                            [CAV_GEOM_CYLINDER] = {"cylinder", 2}, [CAV_GEOM_BOX] = {"box", 3},
                            [CAV_GEOM_MESH] = {"mesh", 0},         [CAV_GEOM_HFIELD] = {"hfield", 0}};
  const cav_geom *g = &model->geom[geom];
  char label[CAV_GEOM_LABEL];
  if (*g->name) return g->name;
  int n = snprintf(words, CAV_WORDS, "%.64s (%s", cav_geom_label(model, geom, label), type[g->type].name);
  for (int k = 0; k < type[g->type].sizes; k++) n += snprintf(words + n, (size_t)(CAV_WORDS - n), " %.3g", g->size[k]);
  if (g->link == 0)
    n += snprintf(words + n, (size_t)(CAV_WORDS - n), " at %.3g %.3g %.3g", g->pos[0] + 0.0, g->pos[1] + 0.0,
                  g->pos[2] + 0.0);
  snprintf(words + n, (size_t)(CAV_WORDS - n), ")");
  return words;
}

const char *cav_actuator_words(const cav_model *model, int actuator, char words[CAV_WORDS]) {
  const cav_actuator *a = &model->actuator[actuator];
  const int joint = a->transmission == CAV_TRANSMISSION_JOINT;
  if (*a->name) return a->name;
  if (joint && *model->joint[a->target].name)
    snprintf(words, CAV_WORDS, "actuator %d (of joint '%.60s')", actuator + 1, model->joint[a->target].name);
  else
    snprintf(words, CAV_WORDS, "actuator %d", actuator + 1);
  return words;
}

const char *cav_object_name(const cav_model *model, cav_object_type type, int object) {
  int n;
  size_t stride;
  const char *names = (const char *)cav_object_names(model, type, &n, &stride);
  return *(const char *const *)(const void *)(names + (size_t)object * stride);
}

const cav_object_kind *cav_object_kind_of(cav_object_type type) {
#define WORDS(type, array, attribute, text) [CAV_OBJECT_##type] = {attribute, text},
  static const cav_object_kind kinds[] = {CAV_OBJECTS(WORDS)};
  return &kinds[type];
}

const char *cav_status_name(cav_status status) {
  static const char *const names[] = {[CAV_OK] = "ok",
                                      [CAV_BAD_INPUT] = "bad input",
                                      [CAV_NOT_FINITE] = "not finite",
                                      [CAV_NOT_CONVERGED] = "not converged",
                                      [CAV_INTERRUPTED] = "interrupted",
                                      [CAV_NO_MEMORY] = "no memory",
                                      [CAV_NOT_SUPPORTED] = "not supported",
                                      [CAV_INTERNAL] = "internal error"};
  size_t i = (size_t)status;
  return i < sizeof names / sizeof *names ? names[i] : "unknown status";
}

const char *cav_version(void) { return CAVORT_VERSION; }
