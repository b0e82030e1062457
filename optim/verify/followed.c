/// Closed loops that verification has run already, while gains were chosen by them (choose_gains.c): taken in the place of
/// running them again where everything that they read is the same to the bit. What is compared is what the verifier has
/// found of the motion by itself, so a motion, a law or gains changed since have their loops run.
#include <stdlib.h>
#include <string.h>

#include "verification.h"

enum { PARTS = 6 };

struct cav_followed {
  const cav_model *model;
  cav_options law;
  int last, rows;
  double h;
  double *numbers; ///< those of the parts, one after the other
  struct cav_follow follow[CAV_LOOP_PUSHED];
};

/// Numbers that a closed loop reads.
typedef struct part {
  const double *at;
  size_t n;
} part;

static void find_parts(const cav_verification *verification, const double *gain_q, const double *gain_v,
                       part found[PARTS]) {
  const size_t nq = (size_t)verification->model->nq, nv = (size_t)verification->model->nv;
  const size_t last = (size_t)verification->last;
  const part all[PARTS] = {{verification->q, (last + 1) * nq},
                           {verification->v, (last + 2) * nv},
                           {verification->u, (size_t)verification->rows * nv},
                           {verification->deviation, nv},
                           {gain_q, last * nv * nv},
                           {gain_v, last * nv * nv}};
  memcpy(found, all, sizeof all);
}

cav_followed *cav_followed_new(const cav_verification *verification, const double *gain_q, const double *gain_v,
                               const struct cav_follow follow[CAV_LOOP_PUSHED]) {
  part found[PARTS];
  size_t numbers = 1;
  find_parts(verification, gain_q, gain_v, found);
  for (int i = 0; i < PARTS; i++) numbers += found[i].n;
  cav_followed *f = calloc(1, sizeof *f);
  double *to = f ? malloc(numbers * sizeof *to) : NULL;
  if (!to) {
    free(f);
    return NULL;
  }
  f->model = verification->model;
  f->law = verification->law;
  f->last = verification->last, f->rows = verification->rows, f->h = verification->h;
  f->numbers = to;
  memcpy(f->follow, follow, sizeof f->follow);
  for (int i = 0; i < PARTS; to += found[i].n, i++) memcpy(to, found[i].at, found[i].n * sizeof *to);
  return f;
}

void cav_followed_free(cav_followed *followed) {
  if (followed) free(followed->numbers);
  free(followed);
}

const struct cav_follow *cav_followed_find(const cav_followed *followed, const cav_verification *verification,
                                           const double *gain_q, const double *gain_v) {
  // periods of a cycle are moved by more than is compared
  if (!followed || verification->image || !gain_q || !gain_v) return NULL;
  int same = followed->model == verification->model && followed->last == verification->last &&
             followed->rows == verification->rows && followed->h == verification->h &&
             !memcmp(&followed->law, &verification->law, sizeof followed->law);
  if (!same) return NULL;
  part found[PARTS];
  find_parts(verification, gain_q, gain_v, found);
  const double *at = followed->numbers;
  for (int i = 0; i < PARTS && same; at += found[i].n, i++) same = !memcmp(at, found[i].at, found[i].n * sizeof *at);
  return same ? followed->follow : NULL;
}
