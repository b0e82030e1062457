/// What the fuzzers of mesh readers share: any bytes give triangles or a reason; triangles have a bulk and a hull.
#ifndef CAVORT_TESTS_FUZZ_TRIANGLES_H
#define CAVORT_TESTS_FUZZ_TRIANGLES_H

#include "fuzz_file.h"
#include "hull.h"
#include "mesh.h"

typedef cav_status (*fuzz_mesh_reader)(const char *data, size_t size, cav_triangles *mesh, char *reason, size_t room);

static inline void fuzz_triangles(fuzz_mesh_reader read, const uint8_t *data, size_t size) {
  cav_triangles mesh;
  char reason[200] = "";
  cav_status status = read((const char *)data, size, &mesh, reason, sizeof reason);
  fuzz_require(status == CAV_OK || reason[0] != 0);
  if (status == CAV_OK) {
    cav_hull hull;
    cav_mesh_bulk(&mesh, 0);
    // numbers whose differences are not finite have no hull
    status = cav_hull_build(mesh.vertex, mesh.nvertex, 0, &hull);
    fuzz_require(status == CAV_OK || status == CAV_BAD_INPUT || status == CAV_NOT_SUPPORTED);
    cav_hull_clear(&hull);
  }
  cav_triangles_clear(&mesh);
}

#endif
