/// What the files share that compile a model. Private to dynamics/model.
#ifndef CAVORT_BUILDER_H
#define CAVORT_BUILDER_H

#include "compile.h"
#include "objects.h"

/// The model under construction; its arrays are writable here only.
typedef struct cav_builder {
  cav_spec *spec;
  cav_model *model;
#define ARRAY(type, name, count) type *name;
  CAV_MODEL_ARRAYS(ARRAY)
#undef ARRAY
  void *assets; ///< meshes and height fields, written by asset.c
  double *keys; ///< q and v of all keyframes
  char **warning;
  char *text, *text_end;
  int *weld;       // [nbody] the body at the top of the group that moves with a body
  int *link_of;    // [nbody]
  cav_pair *pairs; ///< list of filter.c
} cav_builder;

/// First object, count and size of a list, for searching by name.
#define CAV_BUILDER_TABLE(list) (list).at, (list).n, sizeof *(list).at

/// Nothing has failed so far.
static inline int cav_builder_running(const cav_builder *b) { return b->spec->status == CAV_OK; }

/// A joint's coordinates in v.
static inline int cav_builder_dofs(cav_joint_type type) {
  static const int dofs[] = {[CAV_JOINT_FREE] = 6, [CAV_JOINT_BALL] = 3, [CAV_JOINT_SLIDE] = 1, [CAV_JOINT_HINGE] = 1};
  return dofs[type];
}

/// 1 of a joint with one coordinate.
static inline int cav_builder_is_scalar(cav_joint_type type) {
  return type == CAV_JOINT_HINGE || type == CAV_JOINT_SLIDE;
}

/// A copy of a text in the model. compile.c.
char *cav_builder_text(cav_builder *b, const char *text);

/// Notes a failure where numbers [n] of an element are not all finite. compile.c.
void cav_builder_finite(cav_spec *spec, const cav_xml_node *node, const double *x, int n);

/// Whether a range holds, by what is said of it; an inverted one cannot. bodies.c.
int cav_builder_limits(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *range_name,
                       cav_limited limited, const double range[2]);
int cav_builder_joint_limits(cav_spec *spec, const cav_spec_joint *s);

/// Which bodies move as one, and their coordinates: weld and link_of, nlink, nq and nv. bodies.c.
void cav_builder_links(cav_builder *b);

/// Fills bodies, links, joints, geoms and sites. bodies.c.
void cav_builder_bodies(cav_builder *b);

/// A frame of a body in the frame of its link. bodies.c.
void cav_builder_to_link(const cav_body *body, const double pos[3], const double quat[4], double link_pos[3],
                         double link_quat[4]);

/// Dofs of all tendons in order; out NULL: only counts. attachments.c.
int cav_builder_tendon_dofs(cav_builder *b, int *out);

/// Fills tendons, equality constraints, actuators, sensors and keyframes. attachments.c.
void cav_builder_attachments(cav_builder *b);

#endif
