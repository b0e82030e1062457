/// Strategies to a motion, solved by processes, and the one that is kept.
#ifndef CAVORT_RACE_H
#define CAVORT_RACE_H

#include <signal.h>
#include <sys/types.h>

#include "cavort/solve.h"

/// What a solve by a strategy came to; goes through a pipe as it is.
typedef struct cav_race_report {
  int status;   ///< of cav_solve
  int solution; ///< 1: there is one, and verdict, cost and iterations are about it
  int stopped;  ///< 1, where it is saved: the race was interrupted, before or after this one ended
  cav_verdict verdict;
  double cost;
  double seconds;                     ///< of the processor, of a process of its own
  char text[400];                     ///< what the solver said
  char where[80];                     ///< where it was stopped, of one that was verified all the same
  char changed[CAV_STRATEGY_CHANGES]; ///< in the problem, by a repair
} cav_race_report;

typedef enum cav_race_state {
  CAV_RACE_WAITING,
  CAV_RACE_RUNNING,
  CAV_RACE_DONE,      ///< there is a report
  CAV_RACE_CANCELLED, ///< a better one is certified
  CAV_RACE_LOST       ///< its process ended without a report
} cav_race_state;

typedef struct cav_race_entry {
  cav_strategy strategy;
  cav_race_state state;
  cav_race_report report;
  cav_solution *solution; ///< if solved in this process
  int from;               ///< what is nearly there: entry whose motion it begins with; -1: with its guess
  int goes_on;            ///< 1: with the first strategy's motion, by some stages
  int mends, cure;        ///< of a repair: the entry whose motion it mends, and by which of its cures; -1: none
  pid_t child;
  int answer, order; ///< pipes: from the child, to the child
} cav_race_entry;

/// A race over the strategies of a problem. The caller fills the first part.
typedef struct cav_race {
  const cav_problem *problem;
  const cav_trajectory *start;        ///< for the first strategy, may be NULL
  cav_solve_options options;          ///< of a solve in this process; children use one thread and no observer
  const char *folder;                 ///< where checkpoints go; NULL: nowhere
  const char *key;                    ///< that they get
  int resume;                         ///< 1: strategies go on from those that are there
  pid_t parent;                       ///< in a child: whose it is; 0: no child
  volatile sig_atomic_t *interrupted; ///< nonzero: start nothing more; CAV_STOP_NOW, CAV_STOP_SOON: what runs ends so
  int processes;                      ///< at most
  double most_seconds; ///< that all processes may take together, by their own clocks, one at a time; 0: any
  int tell;            ///< 1: lines on standard error about what starts and ends
  /// Saves a solution; called in the process that has it. Returns an exit status.
  int (*save)(void *context, const cav_problem *problem, const cav_solution *solution, const cav_race_report *report);
  /// Called in this process at every checkpoint of the first strategy, whose problem it is; first: the first time.
  void (*snapshot)(void *context, const cav_problem *problem, const cav_checkpoint *checkpoint, int first);
  void *context;
  double begin; ///< on the clock of cav_race_seconds
  int n;
  cav_race_entry entry[CAV_STRATEGIES];
} cav_race;

/// Whether a diagnosis found what a problem asks for: of stronger actuators also what is all but certified.
int cav_race_would_do(const cav_race_entry *entry);

/// Whether a strategy ended with what is wanted: certified, and every target with a tolerance met.
int cav_race_success(const cav_race_report *report);

/// Whether a checkpoint's multipliers are of as many rows as the problem has, at the same knots.
int cav_race_fits(const cav_problem *problem, const cav_checkpoint *checkpoint);

/// The strategies of the problem, at most as many.
cav_status cav_race_open(cav_race *race, int most, cav_error *error);

/// Solves by the first strategy in this process. CAV_NO_MEMORY, CAV_BAD_INPUT and the like with the reason in error.
cav_status cav_race_first(cav_race *race, cav_error *error);

/// Solves by all that wait, in processes. cheapest 0: ends as soon as one is certified and all before it are not; 1:
/// when all have ended.
cav_status cav_race_finish(cav_race *race, int cheapest, cav_error *error);

/// Processor seconds since it was opened, of this process and of those that have reported or ended.
double cav_race_seconds(const cav_race *race);

/// The entry to keep: the first certified one, or the cheapest; without any, the one that keeps most of what a
/// certificate requires. -1: none has a solution. The same whichever ended first.
int cav_race_best(const cav_race *race, int cheapest);

/// Certifies a solution of a problem, into the report.
cav_status cav_race_verify(const cav_problem *problem, const cav_solution *solution, cav_race_report *report,
                           cav_error *error);

/// Has the entry saved by the process that solved it; its exit status.
int cav_race_save(cav_race *race, int best);

/// Ends all processes, and frees.
void cav_race_close(cav_race *race);

/// Writes strategies.csv: what became of each.
cav_status cav_race_write(const cav_race *race, int kept, const char *path, cav_error *error);

#endif
