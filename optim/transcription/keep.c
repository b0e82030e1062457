/// Values of all knots put by, so that a step back to where they were known takes no evaluation.
#include <stdlib.h>
#include <string.h>

#include "transcription.h"

/// What an evaluation without derivatives leaves at a knot.
struct cav_kept {
  double *u, *y; ///< [nv], [room]
  char *moving;  ///< [moving_room]
  cav_slot *slot;
  int room, moving_room, nread, ncontact, nrow, dense_most, ndense;
  double cost, merit;
  cav_evaluation *evaluation;
};

static struct cav_kept *kept_new(const cav_knot *knot, int nv) {
  struct cav_kept *kept = calloc(1, sizeof *kept);
  if (!kept) return NULL;
  kept->u = malloc((size_t)nv * sizeof(double));
  kept->slot = malloc(((size_t)knot->layout.count + 1) * sizeof *kept->slot);
  if (kept->u && kept->slot) return kept;
  cav_kept_free(kept);
  return NULL;
}

void cav_kept_free(struct cav_kept *kept) {
  if (!kept) return;
  free(kept->u), free(kept->y), free(kept->moving), free(kept->slot);
  cav_evaluation_free(kept->evaluation);
  free(kept);
}

/// Room for the readings and contacts of a knot; 0 if memory runs out.
static int make_room(struct cav_kept *kept, const cav_knot *knot) {
  if (knot->nread > kept->room) {
    double *y = realloc(kept->y, (size_t)knot->room * sizeof(double));
    if (!y) return 0;
    kept->y = y;
    kept->room = knot->room;
  }
  if (knot->ncontact > kept->moving_room) {
    char *moving = realloc(kept->moving, (size_t)knot->moving_room);
    if (!moving) return 0;
    kept->moving = moving;
    kept->moving_room = knot->moving_room;
  }
  return 1;
}

// the last evaluation for the one that is put by, or back
static void exchange_evaluations(cav_knot *knot, struct cav_kept *kept) {
  cav_evaluation *last = knot->evaluation;
  knot->evaluation = kept->evaluation;
  kept->evaluation = last;
}

static int keep_knot(cav_knot *knot, int nv) {
  if (!knot->kept) knot->kept = kept_new(knot, nv);
  struct cav_kept *kept = knot->kept;
  if (!kept || !make_room(kept, knot)) return 0;
  memcpy(kept->u, knot->u, (size_t)nv * sizeof(double));
  memcpy(kept->slot, knot->slot, (size_t)knot->layout.count * sizeof *kept->slot);
  if (knot->nread) memcpy(kept->y, knot->y, (size_t)knot->nread * sizeof(double));
  if (knot->ncontact) memcpy(kept->moving, knot->moving, (size_t)knot->ncontact);
  kept->nread = knot->nread, kept->ncontact = knot->ncontact, kept->nrow = knot->nrow;
  kept->dense_most = knot->dense_most, kept->ndense = knot->ndense;
  kept->cost = knot->cost, kept->merit = knot->merit;
  exchange_evaluations(knot, kept);
  return 1;
}

int cav_values_keep(cav_transcription *tr) {
  for (int t = 0; t < tr->nknot; t++)
    if (!keep_knot(&tr->knot[t], tr->nv)) return 0;
  return 1;
}

void cav_values_take(cav_transcription *tr, cav_trajectory *at) {
  for (int t = 0; t < tr->nknot; t++) {
    cav_knot *knot = &tr->knot[t];
    struct cav_kept *kept = knot->kept;
    memcpy(knot->u, kept->u, (size_t)tr->nv * sizeof(double));
    memcpy(at->u + (size_t)t * (size_t)tr->nv, kept->u, (size_t)tr->nv * sizeof(double));
    memcpy(knot->slot, kept->slot, (size_t)knot->layout.count * sizeof *knot->slot);
    if (kept->nread) memcpy(knot->y, kept->y, (size_t)kept->nread * sizeof(double));
    if (kept->ncontact) memcpy(knot->moving, kept->moving, (size_t)kept->ncontact);
    knot->nread = kept->nread, knot->ncontact = kept->ncontact, knot->nrow = kept->nrow;
    knot->dense_most = kept->dense_most, knot->ndense = kept->ndense;
    knot->cost = kept->cost, knot->merit = kept->merit;
    knot->refusal = (cav_user_refusal){0};
    exchange_evaluations(knot, kept);
  }
}
