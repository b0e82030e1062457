/// The broad phase over numbers CAV_REAL (spatial.h): what it keeps, where centres are and which bounds are near. collide.c takes
/// it one state at a time, broad_four.c four at once.
#ifndef CAVORT_BROAD_H
#define CAVORT_BROAD_H

#include "constraint.h"
#include "fixed.h"
#include "spatial.h"
#include "sweep.h"

/// A pair as the broad phase wants it: all it reads, in order.
typedef struct candidate {
  int first, second; ///< slots
  int pair;          ///< its number
  signed char plane; ///< 1 if the first geom is a plane
  signed char four;  ///< 1 if it and the three that follow can be looked at together: of one plane or of none
  signed char external, sought, hinted; ///< as in the pair; 1 if cav_pair_is_sought; 1 if cav_pair_keeps_hint
  double margin;                        ///< of the pair
  double bound;                         ///< sum of bounding radii; of the second geom alone if the first is a plane
} candidate;

/// A geom in some pair.
typedef struct slot {
  const cav_geom *geom;
  int turned; ///< shape.rotation is valid; of planes always
  int fixed;  ///< moves with the world: placed once
  cav_shape shape;
} slot;

struct cav_geom_cache {
  size_t bytes;
  int nslot;
  slot *slot;
  int nmoving, *moving; ///< slots that are not fixed
  double (*centre)[3];  ///< [nslot] world
  candidate *candidate; ///< [npair], and behind them once more those that fixed never leaves out
  int ncandidate;
  double *limit; ///< [ncandidate] below which they are near, by activation: what is added to margins within trees and
                 ///< with the world
  double activation[2];
  int *near;         ///< [ncandidate] scratch
  int ntree, *tree;  ///< [ntree] root links of the trees with slots that move
  double (*root)[3]; ///< [ntree] where these are
  cav_fixed *fixed;  ///< NULL: there is little to leave out
  cav_sweep *sweep;  ///< NULL: all pairs that are left are looked at
  int sweep_from;
  cav_hint *hint;     ///< [npair] where the last searches ended; NULL: no pair keeps one
  double margin;      ///< largest of all pairs
  int sought, meshes; ///< some pair is; has a mesh
};

// centre of a geom that moves
CAV_INLINE void find_centre(const cav_geom *geom, const CAV_REAL pos[3], const CAV_REAL rotation[9],
                            CAV_REAL centre[3]) {
  CAV_REAL local[3];
  take_numbers(local, geom->pos, 3);
  transform(centre, pos, rotation, local);
}

// two bounds are near if this is less than limit_between: the square of the distance of their centres, or the height above a
// plane of that normal
CAV_INLINE CAV_REAL separation(const candidate *c, const CAV_REAL *first, const CAV_REAL *second,
                               const CAV_REAL normal[3]) {
  CAV_REAL d[3];
  sub3(d, second, first);
  return c->plane ? dot3(d, normal) : dot3(d, d);
}

static inline double limit_between(const candidate *c, double margin) {
  double activation = c->bound + margin;
  return c->plane ? activation : activation > 0 ? activation * activation : 0;
}

/// Limits by what is added to margins, which few calls change. broad_four.c.
void cav_limits_prepare(struct cav_geom_cache *cache, const double activation[2]);

/// Those of consecutive candidates whose bounds are near, into found [end - first], in their order; how many. Where
/// vectors have four numbers (cav_dense_lanes). broad_four.c.
int cav_near_run(const struct cav_geom_cache *cache, int first, int end, int *found);

#endif
