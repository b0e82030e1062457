/// What became of solves, a line each: from result folders and the records of a batch.
#ifndef CAVORT_SUMMARY_H
#define CAVORT_SUMMARY_H

#include <stdio.h>

#include "cavort/status.h"

enum { CAV_SUMMARY_TEXT = 480 };

typedef struct cav_summary {
  char name[256]; ///< how the line is called: of a batch its problem, else the folder
  char motion[128], model[128];
  int known; ///< 1: there is a verdict, and the numbers are its
  int certified, achieved;
  double cost, optimality, iterations; ///< of the motion that was kept; NaN: not recorded
  double seconds;                      ///< of all strategies that were tried; NaN: not recorded
  char cause[CAV_SUMMARY_TEXT];        ///< the first one why it is not certified and achieved; "": it is
} cav_summary;

/// A line of a folder's strategies.csv: whether its motion is the one that was kept, how it ended, the seconds that it took
/// (NaN: it led to no motion), what it changed of the problem and what it missed. Opened with no line; next: whether there is
/// one more.
typedef struct cav_tried {
  FILE *in;
  char *line;
  size_t room;
  int kept;
  double seconds;
  const char *name, *outcome, *changed, *reason;
} cav_tried;
cav_tried cav_tried_open(const char *folder);
int cav_tried_next(cav_tried *tried);
void cav_tried_close(cav_tried *tried);

/// Seconds of all strategies of a folder's strategies.csv that led to a motion, one after the other; *n of them, 0: none are
/// known.
double cav_summary_tried(const char *folder, int *n);

/// What a result folder says; seconds of all strategies that were tried; where it has no verdict, known is 0 and cause says so.
void cav_summary_read(const char *folder, cav_summary *summary);

/// The same of a batch's problem NAME in a folder: its result, and what its record says where that has no verdict or is
/// older than the record.
void cav_summary_read_item(const char *folder, const char *name, cav_summary *summary);

/// Lines of folders: of a result itself, of a batch all of its problems, in the order of their names. *summary in fresh
/// memory. CAV_BAD_INPUT: a folder that holds neither.
cav_status cav_summary_list(int nfolder, char *const *folder, int *n, cav_summary **summary, cav_error *error);

/// Prints lines as a table for people, or as CSV.
void cav_summary_print(FILE *out, int n, const cav_summary *summary, int csv);

// ---- records: DIR/NAME.record, how the last solve of a problem of a batch ended

enum { CAV_RECORD_KEY = 400 };

typedef struct cav_batch_record {
  char key[CAV_RECORD_KEY]; ///< what was solved, and how: of another one nothing is known
  int begun;                ///< 1: it has begun and nobody has seen its end
  int status;               ///< of waitpid
  char cause[CAV_SUMMARY_TEXT];
} cav_batch_record;

/// 0: there is none that can be read.
int cav_batch_record_read(const char *folder, const char *name, cav_batch_record *record);
cav_status cav_batch_record_write(const char *folder, const char *name, const cav_batch_record *record,
                                  cav_error *error);

/// In words why a solve ended so, cause from what it said: "" after exit status 0.
void cav_batch_record_explain(const char *log, int status, char cause[CAV_SUMMARY_TEXT]);

/// Whether a solve came to its end: certified or not, there is nothing more to do.
int cav_batch_record_done(const cav_batch_record *record);

#endif
