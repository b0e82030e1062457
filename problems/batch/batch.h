/// Many problems, and many values of their settings, solved in processes into one folder.
#ifndef CAVORT_BATCH_H
#define CAVORT_BATCH_H

#include <signal.h>

#include "setting.h"
#include "summary.h"

enum { CAV_BATCH_SETTINGS = 32 };

/// A problem with its settings: DIR/NAME is its result, DIR/NAME.xml the problem where there are settings, DIR/NAME.log
/// what the solve said, DIR/NAME.record how it ended.
typedef struct cav_batch_item {
  char name[256];
  const char *source; ///< the problem file as given
  char *problem;      ///< the one to solve
  cav_setting setting[CAV_BATCH_SETTINGS];
  char key[CAV_RECORD_KEY];
  int resume;                   ///< 1: it has begun, and can go on from where it was
  int done;                     ///< 1: it came to its end, here or before
  char cause[CAV_SUMMARY_TEXT]; ///< why it did not succeed, as seen here; "": it did, or it did not end here
} cav_batch_item;

typedef struct cav_batch {
  const char *folder;
  int n, nsetting;
  cav_batch_item *item;
  char **text; ///< memory of the settings
  int ntext;
  int processes, tell;
  volatile sig_atomic_t *interrupted;
  const char *model;   ///< instead of those that the problems name; NULL
  const char *options; ///< what the solves depend on beside the problem
  /// Solves an item, in a process of its own; the exit status.
  int (*solve)(void *context, const cav_batch_item *item, const char *folder);
  void *context;
} cav_batch;

/// Whether one of the settings ("PATH=VALUE,VALUE,...") has several values.
int cav_batch_sweeps(int n, char *const *setting);

/// Splits settings PATH=VALUE into items, one for every problem and combination of values; names follow problems and
/// the values that differ.
cav_status cav_batch_open(cav_batch *batch, int nproblem, char *const *problem, int nsetting, char *const *setting,
                          cav_error *error);

/// Solves what is not solved already. What cannot be solved is the item's own trouble; CAV_BAD_INPUT: the folder
/// cannot be made.
cav_status cav_batch_run(cav_batch *batch, cav_error *error);

/// Lines of all items; what was not written is told all the same. [batch->n]
void cav_batch_summary(const cav_batch *batch, cav_summary *summary);
void cav_batch_close(cav_batch *batch);

#endif
