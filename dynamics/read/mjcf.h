/// What the files share that read MJCF. Private to dynamics/read.
#ifndef CAVORT_MJCF_H
#define CAVORT_MJCF_H

#include "spec.h"

/// One class of defaults, complete: what its parents say is copied in.
typedef struct cav_mjcf_class {
  const char *name;
  cav_spec_joint joint;
  cav_spec_geom geom;
  cav_spec_site site;
  cav_spec_pair pair;
  cav_spec_tendon tendon;
  cav_spec_equality equality;
  cav_spec_actuator actuator;
  double rgba[4];  ///< of a material
  double scale[3]; ///< of a mesh
  cav_mesh_inertia inertia;
  int hull_vertices; ///< at most, of a mesh; below 4: all
} cav_mjcf_class;

typedef struct cav_mjcf_material {
  const char *name;
  double rgba[4];
} cav_mjcf_material;

typedef struct cav_mjcf_reader {
  cav_spec *spec;
  CAV_SPEC_LIST(cav_mjcf_class) classes;
  CAV_SPEC_LIST(cav_mjcf_material) materials;
} cav_mjcf_reader;

// small readers: an attribute that is absent leaves the default

static inline void read_real(const cav_xml_node *node, const char *name, double *out) {
  *out = cav_xml_real(node, name, *out);
}

static inline void read_int(const cav_xml_node *node, const char *name, int *out) {
  *out = cav_xml_int(node, name, *out);
}

static inline void read_text(const cav_xml_node *node, const char *name, const char **out) {
  *out = cav_xml_text(node, name, *out);
}

static inline void read_limited(const cav_xml_node *node, const char *name, cav_limited *out) {
  *out = (cav_limited)cav_xml_word(node, name, (int)*out);
}

// every section of that name
static inline void read_sections(cav_mjcf_reader *r, const cav_xml_node *root, const char *name,
                                 void (*read)(cav_mjcf_reader *, const cav_xml_node *)) {
  for (const cav_xml_node *c = root->child; c && r->spec->status == CAV_OK; c = c->next) {
    if (cav_xml_is(c, name)) read(r, c);
  }
}

/// Compiler, options, classes of defaults and assets, and what elements of a class start with. defaults.c.
void cav_mjcf_read_compiler(cav_mjcf_reader *r, const cav_xml_node *node);
void cav_mjcf_read_option(cav_mjcf_reader *r, const cav_xml_node *node);
void cav_mjcf_joint_values(cav_spec *spec, const cav_xml_node *node, cav_spec_joint *j);
void cav_mjcf_geom_values(cav_spec *spec, const cav_xml_node *node, cav_spec_geom *g);
void cav_mjcf_site_values(cav_spec *spec, const cav_xml_node *node, cav_spec_site *s);
void cav_mjcf_pair_values(cav_spec *spec, const cav_xml_node *node, cav_spec_pair *p);
void cav_mjcf_equality_values(cav_spec *spec, const cav_xml_node *node, cav_spec_equality *e);
void cav_mjcf_tendon_values(cav_spec *spec, const cav_xml_node *node, cav_spec_tendon *t);
cav_mjcf_class cav_mjcf_first_class(void);
void cav_mjcf_start_parts(cav_mjcf_reader *r); ///< the outermost classes of files that are attached
void cav_mjcf_read_defaults(cav_mjcf_reader *r, const cav_xml_node *node);
const cav_mjcf_class *cav_mjcf_class_of(cav_mjcf_reader *r, const cav_xml_node *node, const char *childclass);
void cav_mjcf_check_childclass(cav_mjcf_reader *r, const cav_xml_node *node);
void cav_mjcf_read_assets(cav_mjcf_reader *r, const cav_xml_node *node);

/// Contact, equality, tendon, actuator, sensor, keyframe. sections.c.
void cav_mjcf_read_sections(cav_mjcf_reader *r, const cav_xml_node *root);

#endif
