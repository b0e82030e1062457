/// What the fuzzers of model files share: bytes as a file in memory, loaded as a model and, where that works, evaluated
/// once.
#ifndef CAVORT_TESTS_FUZZ_FILE_H
#define CAVORT_TESTS_FUZZ_FILE_H

// memfd_create
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "cavort/dynamics.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

// stops the fuzzer where a tolerance does not hold
static inline void fuzz_require(int holds) {
  if (!holds) abort();
}

// one evaluation of the inverse at rest in the posture of the file
static inline void fuzz_evaluate(const cav_model *model) {
  enum { DOFS_MAX = 200, PAIRS_MAX = 2000 };
  if (model->nv > DOFS_MAX || model->npair > PAIRS_MAX) return;
  cav_state *state = cav_state_new(model);
  double *zero = calloc((size_t)model->nv + 1, sizeof *zero), *u = calloc((size_t)model->nv + 1, sizeof *u);
  if (state && zero && u) cav_inverse(model, state, model->q0, zero, zero, u);
  free(zero);
  free(u);
  cav_state_free(state);
}

static inline void fuzz_model(const uint8_t *data, size_t size) {
  char path[64];
  int file = memfd_create("model", 0);
  if (file < 0) return;
  if (write(file, data, size) == (ssize_t)size) {
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    cav_error error;
    cav_model *model = cav_model_load(path, &error);
    // a model, or a reason
    fuzz_require((model != NULL) == (error.status == CAV_OK));
    fuzz_require(model != NULL || error.text[0] != 0);
    if (model) fuzz_evaluate(model);
    cav_model_free(model);
  }
  close(file);
}

#endif
