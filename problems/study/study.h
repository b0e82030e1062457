/// A study: motions solved from perturbed starts by several methods, each run on its own.
#ifndef CAVORT_STUDY_H
#define CAVORT_STUDY_H

#include "cavort/solve.h"

enum { CAV_STUDY_STARTS = 10 };

typedef enum cav_study_method {
  CAV_STUDY_OWN,        ///< Gauss-Newton of our own
  CAV_STUDY_STRATEGIES, ///< the same, and other strategies one after the other until one is certified
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
  int certified;
  double seconds; ///< processor time of reading, solving and certifying
  int iterations;
  double cost, unactuated, end_error; ///< m at the end of the closed loop; -1: none
} cav_study_run;

/// Reads, perturbs, solves and certifies: start k of a motion always the same. Joints move by up to 0.03 rad or 3 % of
/// their range within it, the root so that what stood still stands; masses of links within 5 %; friction 0.6 to 1.
/// Gives up after 120 s of processor time. reason: why it is not certified, "" if it is. Fails where the problem cannot
/// be read or perturbed.
cav_status cav_study_solve(const char *path, const char *model_path, cav_study_run *run, char reason[480],
                           cav_error *error);

/// Writes study.csv (every run), study.txt (table of motions and methods), and the fraction certified within a time as
/// profile.csv, profile.gp and, where gnuplot is installed, profile.svg. *drawn: 1 if it is.
cav_status cav_profile_write(const char *folder, int nmotion, const char *const *motion, int nrun,
                             const cav_study_run *run, int *drawn, cav_error *error);

#endif
