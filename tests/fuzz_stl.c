/// Fuzzer of the STL reader: any bytes give triangles or a reason; triangles have a bulk and a hull.
#include "fuzz_file.h"
#include "hull.h"
#include "mesh.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  cav_triangles mesh;
  char reason[200] = "";
  cav_status status = cav_mesh_read_stl((const char *)data, size, &mesh, reason, sizeof reason);
  fuzz_require(status == CAV_OK || reason[0] != 0);
  if (status == CAV_OK) {
    cav_hull hull;
    cav_mesh_bulk(&mesh, 0);
    fuzz_require(cav_hull_build(mesh.vertex, mesh.nvertex, &hull) == CAV_OK);
    cav_hull_clear(&hull);
  }
  cav_triangles_clear(&mesh);
  return 0;
}
