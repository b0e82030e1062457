/// Convex hulls of points: what a mesh collides as. Private to dynamics/.
#ifndef CAVORT_HULL_H
#define CAVORT_HULL_H

#include "cavort/model.h"

/// A hull under construction or done; lists of malloc, let go by cav_hull_clear.
typedef struct cav_hull {
  int nvertex, nface, ncorner, nneighbour, nmeeting;
  double *vertex; ///< [nvertex*3]
  double *plane;  ///< [nface*4]
  int *face;      ///< [nface+1]
  int *corner;    ///< [ncorner]
  int *neighbour_start, *neighbour;
  int *meeting_start, *meeting; ///< [nmeeting] faces, one as often as it has triangles there
  int *summit;                  ///< [CAV_DIRECTION_CELLS]
} cav_hull;

/// Hull of points [n*3], finite. Points of no volume give a polygon with two faces, a segment or a single point without
/// any. Of a solid at most that many vertices, the outermost first; below 4: all. Faces that differ from a plane by less
/// than 1e-6 of the size are one. CAV_OK, CAV_NO_MEMORY, CAV_NOT_SUPPORTED in a build without Qhull, where only flat sets
/// have one, or CAV_BAD_INPUT if Qhull finds none. hull.c.
cav_status cav_hull_build(const double *point, int n, int most, cav_hull *hull);
void cav_hull_clear(cav_hull *hull);

/// A hull as a mesh of a model, which points into it.
static inline cav_mesh cav_hull_mesh(const cav_hull *h) {
  cav_mesh mesh = {.name = "", .nvertex = h->nvertex, .nface = h->nface, .vertex = h->vertex, .plane = h->plane};
  mesh.face = h->face;
  mesh.corner = h->corner;
  mesh.neighbour_start = h->neighbour_start;
  mesh.neighbour = h->neighbour;
  mesh.meeting_start = h->meeting_start;
  mesh.meeting = h->meeting;
  mesh.summit = h->summit;
  return mesh;
}

#endif
