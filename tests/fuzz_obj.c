/// Fuzzer of the OBJ reader: fuzz_triangles.h.
#include "fuzz_triangles.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  fuzz_triangles(cav_mesh_read_obj, data, size);
  return 0;
}
