/// Triangles of a mesh file and what they weigh. Private to dynamics/.
#ifndef CAVORT_MESH_H
#define CAVORT_MESH_H

#include <stddef.h>

#include "cavort/status.h"

/// Triangles as read; lists of malloc, let go by cav_triangles_clear.
typedef struct cav_triangles {
  int nvertex, ntriangle;
  double *vertex; ///< [nvertex*3]
  int *triangle;  ///< [ntriangle*3] counterclockwise from outside
} cav_triangles;

/// Volume, its centre, and second moments of volume about the centre: xx yy zz xy xz yz of the inertia of density 1.
typedef struct cav_bulk {
  double volume, centre[3], inertia[6];
} cav_bulk;

/// Reads a file of triangles by its ending: .stl (binary or text), .obj, or .dae where the build has assimp. On failure
/// a reason, without the path, and CAV_BAD_INPUT, CAV_NO_MEMORY or CAV_NOT_SUPPORTED. mesh.c.
cav_status cav_mesh_read(const char *path, cav_triangles *mesh, char *reason, size_t room);

/// The same of bytes in memory: STL, OBJ. line: of the fault in a text, 0 otherwise. mesh.c.
cav_status cav_mesh_read_stl(const char *bytes, size_t size, cav_triangles *mesh, char *reason, size_t room);
cav_status cav_mesh_read_obj(const char *bytes, size_t size, cav_triangles *mesh, char *reason, size_t room);
/// COLLADA; CAV_NOT_SUPPORTED in a build without assimp, or where it is gone since. collada.c.
cav_status cav_mesh_read_dae(const char *path, cav_triangles *mesh, char *reason, size_t room);
void cav_triangles_clear(cav_triangles *mesh);

/// What of a mesh weighs. MJCF's words.
typedef enum cav_mesh_inertia {
  CAV_MESH_LEGACY, ///< sum of pyramids from their centre to each triangle, none negative: too large where the surface
                   ///< is not convex
  CAV_MESH_EXACT,  ///< the same signed: right for any closed surface
  CAV_MESH_CONVEX, ///< the solid of its hull
  CAV_MESH_SHELL   ///< the surface, by area
} cav_mesh_inertia;

/// Bulk of what the triangles enclose, or of their surface (a volume in m^2); CAV_MESH_CONVEX is for the hull's
/// triangles and counts as exact. mesh.c.
cav_bulk cav_mesh_bulk(const cav_triangles *mesh, cav_mesh_inertia what);

#endif
