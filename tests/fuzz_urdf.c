/// Fuzzer of the URDF reader: any bytes give a model or a reason, within bounds of time and memory.
#include "fuzz_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  fuzz_model(data, size);
  return 0;
}
