/// A problem with its storage, for tests that fill one by hand.
#ifndef CAVORT_TESTS_STORAGE_H
#define CAVORT_TESTS_STORAGE_H

#include "cavort/cavort.h"

typedef struct bench {
  cav_model *model;
  cav_problem problem;
  cav_term term[8];
  double q_start[8], v_start[8];
} bench;

// one more term, of all dofs; it stands in the storage
static inline cav_term *add(bench *b, cav_term term) {
  term.dofs = CAV_DOFS_ALL;
  b->term[b->problem.nterm] = term;
  return &b->term[b->problem.nterm++];
}

#endif
