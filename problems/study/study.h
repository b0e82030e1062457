/// A study: motions solved from perturbed starts by several methods, each run on its own.
#ifndef CAVORT_STUDY_H
#define CAVORT_STUDY_H

#include "cavort/solve.h"

enum {
  CAV_STUDY_STARTS = 10,
  CAV_STUDY_SECONDS = 120, ///< of processor time that a run has, unless asked otherwise
  CAV_STUDY_STRATEGY = 24  ///< room for a strategy's name
};

typedef enum cav_study_method {
  CAV_STUDY_OWN,        ///< Gauss-Newton of our own
  CAV_STUDY_STRATEGIES, ///< the same, and what cavort solve tries where that does not succeed, one after the other
  CAV_STUDY_IPOPT,      ///< Ipopt from the guess, by stages of the same schedule
  CAV_STUDY_LIMITED,    ///< the same with limited memory
  CAV_STUDY_BOTH,       ///< own, then Ipopt
  CAV_STUDY_METHODS
} cav_study_method;

extern const char *const cav_study_method_names[CAV_STUDY_METHODS];

/// What came of one run.
typedef struct cav_study_run {
  int motion; ///< index into the study's motions
  cav_study_method method;
  int start; ///< 0 ..
  int known; ///< the rest is filled
  int certified, achieved;
  double seconds;                     ///< processor time of reading, solving and certifying, of all that was tried
  int iterations;                     ///< of all that was tried
  char strategy[CAV_STUDY_STRATEGY];  ///< that led to the motion that was kept
  double cost, unactuated, end_error; ///< m at the end of the closed loop; -1: none
} cav_study_run;

/// What a run is given.
typedef struct cav_study_task {
  const char *problem, *model; ///< files; model NULL: as the problem says
  const char *folder;          ///< of its own, for as long as CAV_STUDY_STRATEGIES runs: where repairs go on from
  const char *tried;           ///< file of what CAV_STUDY_STRATEGIES tried, as strategies.csv of a result; NULL: none
  double seconds;              ///< processor time after which it is stopped; a verification under way is ended
} cav_study_task;

/// Start k of a problem, always the same, of a model that is the problem's own: joints move by up to 0.03 rad or 3 % of
/// their range within it, the root of each tree so that what stood still stands; masses of links within 5 %; friction 0.6
/// to 1. CAV_NO_MEMORY, or what the dynamics says of the start.
cav_status cav_study_perturb(cav_problem *problem, int start);

/// Reads, perturbs, solves and certifies.
/// CAV_STUDY_STRATEGIES is the race of cavort solve with one process at a time: until one is certified and achieved, and
/// where none is, the motion counts that solve would keep. reason: why it is not certified, or what it misses of what was
/// asked; "" if neither. Fails where the problem cannot be read or perturbed.
cav_status cav_study_solve(const cav_study_task *task, cav_study_run *run, char reason[480], cav_error *error);

/// Writes study.csv (every run), study.txt (table of motions and methods), and the fraction certified within a time as
/// profile.csv, profile.gp and, where gnuplot is installed, profile.svg. *drawn: 1 if it is.
cav_status cav_profile_write(const char *folder, int nmotion, const char *const *motion, int nrun,
                             const cav_study_run *run, int *drawn, cav_error *error);

#endif
