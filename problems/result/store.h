/// A result folder as a place that a solve writes into: one solve at a time, no result lost, readable at any moment.
#ifndef CAVORT_STORE_H
#define CAVORT_STORE_H

#include "cavort/solve.h"

typedef struct cav_store {
  const char *folder;
  int lock[2]; ///< descriptors that hold the folder's lock, -1: none; the second of the folder that was moved aside
  char *aside; ///< where an earlier result went, NULL: there was none, or this goes on from it
} cav_store;

/// Makes a folder that holds none of an earlier result's files, and locks it. What it held goes to FOLDER.1, FOLDER.2,
/// ..., unless keep: then only what would not fit to a motion to come is removed. CAV_BAD_INPUT: another solve holds
/// the lock; the folder holds an earlier result and other files beside it; it cannot be made, moved or locked.
cav_status cav_store_open(cav_store *store, const char *folder, int keep, cav_error *error);

/// Gives up the lock.
void cav_store_close(cav_store *store);

/// "checkpoint.csv" in the folder, for other strategies than the stated one "checkpoint-NAME.csv"; NULL if memory runs
/// out.
char *cav_store_checkpoint(const char *folder, const char *strategy);

/// Removes checkpoints and what was left half written, and the folder if it holds nothing else; fine where there is none.
void cav_store_remove(const char *folder);

#endif
