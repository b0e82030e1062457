/// The way from a naive guess to the true problem. Private to optim/.
#ifndef CAVORT_CONTINUATION_H
#define CAVORT_CONTINUATION_H

#include "cavort/solve.h"
#include "clock.h"
#include "gauss_newton.h"
#include "schedule.h"

/// A solve under way: what continuation, multipliers and Ipopt hand to each other.
typedef struct cav_solve_run {
  const cav_problem *problem;
  const cav_solve_options *options;
  cav_transcription *tr;
  cav_normal *normal;
  cav_trajectory *at, *spare;
  cav_region region;
  cav_solution *solution;
  const char *phase;
  int stage, stages;
  cav_trajectory *stood;        ///< where the last stage whose rows were nearly in has led; NULL: none was
  cav_begin begin_with;         ///< what the first stage began with
  int warm;                     ///< the rows' final multipliers are those to start from
  int checks_raises;            ///< penalties that grow for nothing are taken back, as near a record
  int refused;                  ///< no certificate is in sight, and the options leave such a motion: cav_run_screen
  int measured;                 ///< optimality and the rows' multipliers are those of at
  double optimality;            ///< predicted decrease of the cost over the cost
  cav_status failed;            ///< what went wrong in the report, CAV_OK: nothing
  cav_error refusal;            ///< of a quantity of one's own, which ended the solve
  double start;                 ///< s
  double noted;                 ///< s, when the last stage ended
  double deadline;              ///< s, infinite: none
  int soon, at_once;            ///< the end was asked for, or the deadline came; it was asked for at once
  int ending;                   ///< 1: it ends soon, and is asked for the end at once alone
  int begin;                    ///< iterations before this call
  const cav_checkpoint *resume; ///< where it goes on, until it has come there; NULL: it has
  int quiet;                    ///< 1: no log and no records of stages are kept
  int nested;                   ///< inside of a part that has its checkpoint before it: no others are made
  cav_progress last;            ///< line of progress
  cav_checkpoint checkpoint;    ///< the next one's, but for what is the run's
} cav_solve_run;

/// Two motions in each other's places.
static inline void cav_run_exchange(cav_trajectory **a, cav_trajectory **b) {
  cav_trajectory *kept = *a;
  *a = *b;
  *b = kept;
}

/// Whether a part is still to be done: not of a solve that is resumed after it. Tells the keeper of the place. *status:
/// CAV_INTERRUPTED if that asks for the end. checkpoint.c.
int cav_run_reaches(cav_solve_run *run, cav_place place, cav_status *status);

/// Takes up run->resume, or the options' multipliers: trajectory, multipliers, what was counted. CAV_BAD_INPUT with the
/// reason in error: they do not fit. checkpoint.c.
cav_status cav_run_resume(cav_solve_run *run, cav_error *error);

/// Multipliers of all rows, into a fresh array [number]; NULL if memory runs out. final: the programme's.
/// checkpoint.c.
double *cav_run_multipliers(const cav_solve_run *run, int final, int *n);

/// Tells the observer of a trial of gains; nonzero if it asks to stop. Report of cav_choose_gains.
int cav_run_feedback(void *run, int trial, int trials);

/// Whether somebody asks for the end; context is the run. Transcription's stop.
int cav_run_stop(void *run);

/// Status of a run that ended with this one: a refusal of a quantity of one's own goes before it, where that is why, with
/// its text in error. solution.c.
cav_status cav_run_refused(const cav_solve_run *run, cav_status status, cav_error *error);

/// Makes a run at its beginning: the guess, the start or the options' checkpoint; error says why not. Closed whatever
/// this returns. run must stay where it is. solution.c.
cav_status cav_run_open(cav_solve_run *run, const cav_problem *problem, const cav_solve_options *options,
                        const cav_trajectory *start, cav_error *error);
void cav_run_close(cav_solve_run *run);

/// By the options' solver, and where rows do not come in to the point of least violation. solution.c.
cav_status cav_run_solve(cav_solve_run *run, cav_error *error);

/// cav_solve of a problem that a solve of so many iterations and seconds came before. solution.c.
cav_status cav_solve_after(const cav_problem *problem, const cav_solve_options *options, const cav_trajectory *start,
                           const cav_solution *before, cav_solution **solution, cav_error *error);

/// Whether rows are so near to holding that feedback may make a certified motion of it.
int cav_run_certifiable(const cav_solve_run *run);

/// Whether a certificate would refuse the motion, or it misses a target by little, by more than polish mends, into run->refused:
/// where the options leave such ones, and its rows nearly hold. CAV_NO_MEMORY. solution.c.
cav_status cav_run_screen(cav_solve_run *run);

/// Whether no set of gains, of a few, follows the motion that stands: into run->refused, where the options leave such ones, and
/// the best of them into the solution. CAV_NO_MEMORY, CAV_INTERRUPTED. solution.c.
cav_status cav_run_screen_feedback(cav_solve_run *run);

/// Whether efforts and ranges are within what is planned with, as a certificate asks.
int cav_run_within_limits(const cav_solve_run *run);

/// The problem's guess: start held, or the geodesic to end [nq], with a ballistic arc if asked; cycles always go to
/// their end, at constant speed; or what cav_pump_fill simulates. q and v of at are filled. CAV_NO_MEMORY, or what the
/// dynamics says of start and goal.
cav_status cav_guess_fill(const cav_problem *problem, const double *end, cav_trajectory *at);

/// Whether a problem has postures, an arc, a bow, a turn or swings on the way of its guess.
int cav_guess_is_decorated(const cav_problem *problem);

/// Law of the last stage at the problem's step.
cav_options cav_last_law(const cav_problem *problem);

/// What a model does without forces by the law, from q and v of the first knot. CAV_NO_MEMORY, CAV_NOT_CONVERGED,
/// CAV_NOT_FINITE: what the forward step says.
cav_status cav_simulate_passive(const cav_model *model, const cav_options *law, cav_trajectory *at);

/// The motion of a problem that no actuator moves, which follows from its start, under the last law. *at NULL: something
/// moves it, the schedule asks for kinematics first, or the forward step does not find it. CAV_NO_MEMORY.
cav_status cav_guess_given(const cav_problem *problem, cav_trajectory **at);

/// The guess into run->at, moved a little off its symmetries: a straight or symmetric one can be a saddle of all costs
/// and constraints at once, which exact derivatives never leave.
cav_status cav_guess_take(cav_solve_run *run);

/// Contact law and weights at a fraction of the way from the first to the last stage.
void cav_stage_set(const cav_problem *problem, double fraction, cav_transcription *transcription);

/// One stage, at a fraction of the way; how it ended.
cav_status cav_stage_run(cav_solve_run *run, double fraction, cav_outcome *outcome);

/// Whether the first stage began, or begins, with the guess as it is.
int cav_run_from_guess(const cav_solve_run *run);

/// The guess to where it meets targets and limits at the least cost, with forces of unactuated dofs next to free: inverse
/// kinematics over all knots at once.
cav_status cav_kinematics_run(cav_solve_run *run);

/// Stages first to last: softness, activation distance and the penalty on unactuated force go geometrically to their
/// ends. One that stalls is taken back and reached by a stage half way there.
cav_status cav_continuation_run(cav_solve_run *run);

/// To an optimum at the last stage's law at which every row holds, from the end of the last stage. optimum.c.
cav_status cav_to_optimum(cav_solve_run *run);

/// Augmented Lagrangian on all constraint rows, at the last stage's law, until they nearly hold.
cav_status cav_augmented_lagrangian(cav_solve_run *run);

/// Gauss-Newton on the constraint rows alone, shortest steps first: from nearly holding to the tolerance. Costs have no
/// say, so it is for the last millimetre only. CAV_NOT_CONVERGED if the rows do not come in.
cav_status cav_restore(cav_solve_run *run);

/// The same of a motion whose rows hold but for efforts and ranges that use what solving lets go of them: to where a certificate
/// asks for them. What does not come in stays as it was, and is no failure.
cav_status cav_restore_limits(cav_solve_run *run);

/// Where constraints cannot all hold: to the point of least violation, where the violations balance and so say what
/// contradicts what (explain.c): the lower of two, from the iterate and, where that is far off, from the guess.
cav_status cav_minimise_infeasibility(cav_solve_run *run);

/// Violation that planning leaves room for, by kind of row: what is planned with headroom may use half of it.
void cav_run_allowed(const cav_solve_run *run, double allowed[CAV_BINDING_KINDS]);

/// Whether every row holds to that at the last values; the same with forces on light bodies as fractions of the whole weight;
/// whether limits hold without that headroom, too, as certificates ask.
int cav_run_met(const cav_solve_run *run);
int cav_run_weighed_met(const cav_solve_run *run);
int cav_run_exact(const cav_solve_run *run);

/// How far rows are off at the last values: the largest unactuated force or violation.
double cav_run_rows_off(const cav_solve_run *run);

/// Appends a line to the log and tells the observer; nonzero if it asks to stop. Region's report.
int cav_run_report(void *run, double step, double radius);

/// Where every row holds but costs had no say: to a minimum of the costs from there, if the rows hold there too.
cav_status cav_recover_feasible(cav_solve_run *run);

/// Notes a stage that ended, of begin iterations before it; 0 if memory runs out.
int cav_run_note(cav_solve_run *run, double fraction, int begin, cav_outcome outcome);

/// Keeps a line of the log; 0 if memory runs out. solution.c.
int cav_solution_log(cav_solution *solution, const cav_progress *line);

/// Keeps a stage that ended; 0 if memory runs out. solution.c.
int cav_solution_note(cav_solution *solution, const cav_stage_record *stage);

#endif
