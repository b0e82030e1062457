/// From what a file says (spec.h) to the model. Private to dynamics/.
#ifndef CAVORT_COMPILE_H
#define CAVORT_COMPILE_H

#include "spec.h"

/// Fills the length ranges of muscles that the file leaves open, of a model under construction. Returns the first
/// actuator whose length has no end within the ranges of the joints, nactuator if memory runs out, -1 if all is well.
/// length_range.c.
int cav_length_range_fill(cav_model *model);

/// Fills inverse_weight of dofs, bodies, tendons and weight of pairs of a model under construction at q0. reference.c.
cav_status cav_reference_weights(cav_model *model);

/// Springs and dampers of joints by time constant and damping ratio, and velocity gains of servos by damping ratio, from
/// the inertia at q0, of a model whose reference weights are known. 0: no memory. gains.c.
int cav_settle_gains(const cav_spec *spec, cav_model *model);

/// Masses, centres and principal moments of geoms and bodies. mass.c.
void cav_spec_masses(cav_spec *spec);

/// Finds the sites and geoms of all paths and checks that they can be followed. tendon_path.c.
void cav_spec_tendon_paths(cav_spec *spec);

/// Marks the joints that move two bodies relative to each other, mark [joint.n]. tendon_path.c.
void cav_spec_mark_between(const cav_spec *spec, int body1, int body2, char *mark);

/// Marks the joints that can change a tendon's length, mark [joint.n], and returns their dofs. tendon_path.c.
int cav_spec_tendon_joints(const cav_spec *spec, int tendon, char *mark);

/// Pairs of geoms that may touch, explicit ones first, then in the order of body pairs; their parameters mixed. For
/// each body [nbody] weld is the body at the top of the group that moves with it, link_of its link. Returns a list of
/// malloc, *npair long, or NULL for an empty one. filter.c.
cav_pair *cav_filter_pairs(cav_spec *spec, const int *weld, const int *link_of, int *npair);

/// Takes pairs that overlap at rest out of a model under construction, and writes what was left out. Returns how many, -1
/// if memory runs out. overlap.c.
int cav_overlaps_leave(cav_model *model, char *text, size_t room);

/// Takes pairs out that no posture brings together: planes of the world and what keeps its distance from
/// them, moved by no actuator. CAV_NO_MEMORY. overlap.c.
cav_status cav_pairs_leave(cav_model *model);

/// Model of a complete spec; NULL on failure, noted in spec. compile.c.
cav_model *cav_compile(cav_spec *spec);

#endif
