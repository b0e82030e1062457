/// A problem file to begin with, for a model that no one has written one for.
#ifndef CAVORT_SCAFFOLD_H
#define CAVORT_SCAFFOLD_H

#include <stdio.h>

#include "role.h"
#include "sense.h"

/// Where a problem starts, in the order in which it is tried.
typedef enum cav_scaffold_start {
  CAV_SCAFFOLD_FLOOR, ///< the posture that stands, the first keyframe or the model's own within its ranges, on the floor
  CAV_SCAFFOLD_HEIGHT, ///< the same at its own height
  CAV_SCAFFOLD_PLAIN,  ///< the posture that stands or the model's own
  CAV_SCAFFOLD_STARTS
} cav_scaffold_start;

/// What was found of a model.
typedef struct cav_scaffold {
  const cav_model *model;
  const char *path; ///< of the model, as the problem names it
  const char *name; ///< of the problem
  int floating;     ///< 1: the root link of a URDF floats
  cav_roles roles;
  int stands; ///< 1: there is a posture that stands, q [nq]
  double *q;
  char (*sense)[CAV_SENSE]; ///< [njoint] what a positive change of each joint moves there
  double hand[3];           ///< of an arm: from its first joint to its hand, m
  double height;            ///< of the trunk above the lowest foot, m
  cav_scaffold_start start; ///< of what is written
  const char *task;         ///< what the problem asks for, in words: filled by cav_scaffold_write
} cav_scaffold;

/// Looks at a model. CAV_NO_MEMORY, or what the dynamics says of it.
cav_status cav_scaffold_open(cav_scaffold *scaffold, const cav_model *model, cav_error *error);
void cav_scaffold_close(cav_scaffold *scaffold);

/// Whether a plane of the world belongs to a model, and what a <scene> adds where none does.
int cav_scaffold_has_floor(const cav_model *model);
#define CAV_SCAFFOLD_PLANE "<geom name=\"floor\" type=\"plane\" size=\"0 0 1\"/>"

/// What a problem for the model may name, as a comment.
void cav_scaffold_list(FILE *out, const cav_scaffold *scaffold);

/// Writes a problem, comment and all. Of several the first that suits the model is wanted: choice 0, 1, ... by what they
/// ask of it. 0: this one does not suit it; -1: there are no more.
int cav_scaffold_write(FILE *out, cav_scaffold *scaffold, int choice);

#endif
