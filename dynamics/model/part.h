/// Some trees of a model as a model of its own. Seen by optim/ too.
#ifndef CAVORT_PART_H
#define CAVORT_PART_H

#include "cavort/model.h"

/// Kinds whose indices change, X(name, number).
#define CAV_PART_KINDS(X) \
  X(body, nbody)          \
  X(link, nlink)          \
  X(joint, njoint)        \
  X(dof, nv)              \
  X(q, nq)                \
  X(geom, ngeom)          \
  X(site, nsite)          \
  X(pair, npair)          \
  X(tendon, ntendon)      \
  X(equality, nequality)  \
  X(actuator, nactuator)  \
  X(sensor, nsensor)

typedef struct cav_part {
  cav_model *model;                          ///< borrows names and assets of the whole
#define CAV_PART_MAP(name, count) int *name; ///< [whole's number] index in the part, -1: not of it
  CAV_PART_KINDS(CAV_PART_MAP)
#undef CAV_PART_MAP
} cav_part;

/// The world and the trees whose root links are marked, keep [nlink], with all that refers to nothing else. The same numbers
/// as if the rest were not in the file. CAV_NO_MEMORY. The whole must outlive it. Freed by cav_part_clear. part.c.
cav_status cav_part_take(const cav_model *whole, const char *keep, cav_part *part);
void cav_part_clear(cav_part *part);

/// The part's entries of a vector over the whole, by one of its maps [n]; and back, which leaves the others as they are.
void cav_part_gather(int n, const int *map, const double *whole, double *part);
void cav_part_scatter(int n, const int *map, const double *part, double *whole);

/// Index of an object in the part, -1: none. CAV_OBJECT_KEY keeps its own.
int cav_part_object(const cav_part *part, cav_object_type type, int object);

/// What a sensor of the whole looks at, by the part's indices; all of it has to be there.
void cav_part_sensor(const cav_part *part, cav_sensor *sensor);

#endif
