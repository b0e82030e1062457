/// Loading, freeing and searching models; names of statuses; the version.

#include <stdlib.h>
#include <string.h>

#include "cavort/model.h"
#include "compile.h"
#include "remove.h"
#include "scene.h"
#include "spec.h"

cav_load_options cav_load_options_default(void) { return (cav_load_options){0}; }

static cav_model *load(const char *path, const cav_load_options *options, const cav_xml_node *scene, cav_error *error) {
  static const cav_xml_element *const roots[] = {&cav_mjcf_root, &cav_urdf_root, NULL};
  if (error) *error = (cav_error){.status = CAV_OK};
  cav_xml *xml = cav_xml_read(path, roots, NULL, error);
  if (!xml) return NULL;
  if (scene && cav_xml_remove(xml, scene, error) != CAV_OK) {
    cav_xml_free(xml);
    return NULL;
  }
  cav_spec spec = {.xml = xml, .error = error, .load = *options, .scene = scene};
  if (cav_xml_root(xml)->rule == &cav_urdf_root)
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
  return load(path, &options, NULL, error);
}

cav_model *cav_model_load_with(const char *path, const cav_load_options *options, cav_error *error) {
  return load(path, options, NULL, error);
}

cav_model *cav_model_load_scene(const char *path, const cav_xml_node *scene, cav_error *error) {
  cav_load_options options = cav_load_options_default();
  return load(path, &options, scene, error);
}

void cav_model_free(cav_model *model) { free(model); }

int cav_object_find(const cav_model *model, cav_object_type type, const char *name) {
  switch (type) {
    case CAV_OBJECT_BODY:
    case CAV_OBJECT_XBODY:
      return cav_name_find(model->body, model->nbody, sizeof *model->body, name);
    case CAV_OBJECT_JOINT:
      return cav_name_find(model->joint, model->njoint, sizeof *model->joint, name);
    case CAV_OBJECT_GEOM:
      return cav_name_find(model->geom, model->ngeom, sizeof *model->geom, name);
    case CAV_OBJECT_SITE:
      return cav_name_find(model->site, model->nsite, sizeof *model->site, name);
    case CAV_OBJECT_TENDON:
      return cav_name_find(model->tendon, model->ntendon, sizeof *model->tendon, name);
    case CAV_OBJECT_ACTUATOR:
      return cav_name_find(model->actuator, model->nactuator, sizeof *model->actuator, name);
    case CAV_OBJECT_KEY:
      return cav_name_find(model->key, model->nkey, sizeof *model->key, name);
    case CAV_OBJECT_SENSOR:
      return cav_name_find(model->sensor, model->nsensor, sizeof *model->sensor, name);
    case CAV_OBJECT_EQUALITY:
      return cav_name_find(model->equality, model->nequality, sizeof *model->equality, name);
    case CAV_OBJECT_TYPES:
      break;
  }
  return -1;
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
