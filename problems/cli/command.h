/// What the commands of the tool share: the command line as read, and how errors are told.
#ifndef CAVORT_COMMAND_H
#define CAVORT_COMMAND_H

#include <stdio.h>
#include <time.h>

#include "cavort/mocap.h"
#include "cavort/result.h"
#include "cavort/solve.h"
#include "exit_status.h"
#include "objects.h"

enum { CAV_COMMAND_IPOPT = 32, CAV_COMMAND_SETTINGS = 32, CAV_COMMAND_PUSHES = 16 };

/// A command line as read by main.c.
typedef struct cav_command_line {
  const char *arguments; ///< the command line as it was given
  const char *operand;   ///< MODEL, PROBLEM, DIR or TOPIC; NULL: none
  const char *stated;    ///< the file whose settings made the operand; NULL: the operand itself
  int noperand;          ///< of commands that take several
  char **operands;       ///< [noperand]
  const char *model;     ///< --model, NULL: as the problem says
  int floating;          ///< --floating
  const char *output;    ///< -o, NULL: named after the problem
  cav_solver solver;
  int threads;
  int strategies; ///< --strategies: 0 auto, else how many at once
  int resume, quiet, json;
  int quick;           ///< --quick: less, in seconds
  int all;             ///< --all: explain everything
  int force;           ///< --force: solve what is proven impossible
  const char *methods; ///< --methods, NULL: own
  double seconds;      ///< --seconds: processor time of a run, 0: as usual
  const char *markers; ///< --markers
  int scale;           ///< --scale
  int from_given;      ///< 1: --from is given
  double from, until;  ///< --from, --until, s; until 0: to the end
  double mass;         ///< --mass, kg; 0: as it is
  const char *like;    ///< --like, NULL: as the model is built
  const char *format;  ///< --to, NULL: none
  double rate;         ///< --rate, 0: as the knots are
  int threads_given;   ///< 1: threads are asked for
  int jobs;            ///< -j: problems at once, 0: as many as processors
  int csv;             ///< --csv
  int errors;          ///< --errors
  int starts;          ///< --starts, 0: none
  int nset;            ///< --set, any number of times
  char *set[CAV_COMMAND_SETTINGS];
  double duration;            ///< --duration, s; 0: by the pushes
  double deadline, stiffness; ///< --deadline, s, --stiffness, rad/s; -1: not given
  int knots, iterations;      ///< --knots, --iterations; 0: not given
  int npush;                  ///< --push, any number of times
  const char *push[CAV_COMMAND_PUSHES];
  int nipopt; ///< --ipopt, any number of times
  cav_ipopt_option ipopt[CAV_COMMAND_IPOPT];
} cav_command_line;

/// What MODEL|PROBLEM names.
typedef struct cav_command_scene {
  cav_problem *problem;   ///< NULL: the file is a model
  const cav_model *model; ///< the problem's, or the file's own
} cav_command_scene;

/// Reads the operand, a model or a problem, told apart by the first element, with --model and --floating. command.c.
cav_status cav_command_load(const cav_command_line *line, cav_command_scene *scene, cav_error *error);
void cav_command_free(cav_command_scene *scene);

/// Writes stderr.csv of a motion into its folder; says why where it cannot. command.c.
void cav_command_write_errors(const char *folder, const cav_problem *problem, const cav_trajectory *trajectory,
                              const cav_options *contact, int nrow, const cav_binding *row);

/// Writes records.csv of a motion into its folder and prints how far it is from its records; folder NULL: prints alone. Does
/// nothing where there are none. command.c.
cav_status cav_command_tell_records(const char *folder, int print, const cav_problem *problem,
                                    const cav_trajectory *trajectory, const cav_options *contact, cav_error *error);

/// Name of the first element of a file, "" if there is none in its first part. command.c.
void cav_command_first_element(const char *path, char name[32]);

/// Writes the problem of the command line with one value of each --set to a file. CAV_BAD_INPUT: several values, the file is no
/// problem, or a path that it has not. command_set.c.
cav_status cav_command_write_set(const cav_command_line *line, const char *path, cav_error *error);

/// Runs a command on the problem with its settings, a file that is there for as long as it runs. Its exit status. command_set.c.
int cav_command_set(const cav_command_line *line, int (*run)(const cav_command_line *line));

/// Whether an operand can be what a command wants, in the words of its usage (DIR, PROBLEM, MODEL); if not, what it is and
/// what was meant. operand.c.
cav_status cav_command_expect(const char *command, const char *wanted, const char *path, cav_error *error);

int cav_command_inspect(const cav_command_line *line);
int cav_command_explain(const cav_command_line *line);
int cav_command_ik(const cav_command_line *line);
int cav_command_export(const cav_command_line *line);
int cav_command_mhe(const cav_command_line *line);
int cav_command_mpc(const cav_command_line *line);
int cav_command_new(const cav_command_line *line);
int cav_command_quality(const cav_command_line *line);
int cav_command_report(const cav_command_line *line);
int cav_command_solve(const cav_command_line *line);
int cav_command_stress(const cav_command_line *line);
int cav_command_study(const cav_command_line *line);
int cav_command_table(const cav_command_line *line);
int cav_command_track(const cav_command_line *line);
int cav_command_verify(const cav_command_line *line);
int cav_command_view(const cav_command_line *line);

/// Table of the measures of n motions: aligned, or as CSV. command_quality.c.
void cav_command_print_quality(FILE *out, int n, char *const *name, const cav_quality *quality, int csv);

/// Writes repair.xml beside a fit's trajectory.csv: the problem whose solution is the motion nearest to it that obeys
/// physics. repair_problem.c.
cav_status cav_command_write_repair(const char *folder, const char *model_path, const cav_trajectory *motion,
                                    cav_error *error);

/// cavort solve of several problems or values. command_batch.c.
int cav_command_batch(const cav_command_line *line);

/// cavort view of a problem file. preview.c.
int cav_command_preview(const cav_command_line *line);

/// Prints the formats of cavort export, after the text of --to. command_export.c.
void cav_command_print_formats(FILE *out);

/// Prints version, commit, compiler and features.
void cav_command_version(void);

/// Errors that begin with a path tell of another from now on: of the file that the one of the moment was made from.
void cav_command_tell_as(const char *path, const char *as);

/// Prints "cavort: text" on standard error; returns the exit status that goes with the error's status.
int cav_command_fail(const cav_error *error);

/// The folder of a result, to be freed: -o, or NAME followed by a suffix (".mpc"): what the problem is called, or else its file
/// without its ending. NULL without memory. command.c.
char *cav_command_folder(const cav_command_line *line, const char *name, const char *suffix);

struct cav_race;

/// A problem with <parameter>: finds them with the motion, saves both, writes parameters.csv and model.xml; race: its
/// problem, folder, options and how to save. The exit status. estimate.c.
int cav_command_estimate(const cav_command_line *line, const struct cav_race *race);

/// Prints why a problem cannot have a solution, most proofs at most, each after a text; how many, -1 with an error.
/// impossible.c.
int cav_command_impossible(FILE *out, const char *before, const cav_problem *problem, int most, cav_error *error);

enum { CAV_PUMPING_TEXT = 600 };

/// What it takes to swing up, in words, where a problem needs that; nonzero: it does not, or that cannot be told.
/// impossible.c.
int cav_command_pumping(const cav_problem *problem, char text[CAV_PUMPING_TEXT]);

/// Why a certified motion misses what was asked: how much of the way it goes, what would lead elsewhere, and what of that the
/// solve of its folder tried in vain. saving: what a step may still save, a fraction of the cost, or a NaN. Zero: nothing is
/// missed, or nothing is known. missed.c.
enum { CAV_MISSED_TEXT = 1400 };
int cav_command_missed(const cav_result *result, const cav_explanation *explanation, double saving, const char *folder,
                       char text[CAV_MISSED_TEXT]);

/// Tells how many strategies a folder's solve tried, and in how many seconds, where they are more than one. tried.c.
void cav_command_tell_tried(FILE *out, const char *folder);

/// What a diagnosis changes in a problem.
typedef enum cav_would_do {
  CAV_WOULD_DO_DURATION, ///< value, s
  CAV_WOULD_DO_STRENGTH, ///< value, times that of the actuators
  CAV_WOULD_DO_OPEN_END  ///< none
} cav_would_do;

/// Says that it would do what a problem asks for, after a text. tried.c.
void cav_command_tell_would_do(FILE *out, const char *before, const cav_problem *problem, cav_would_do what,
                               double value);

/// The same of what the solve of a folder found for a problem that it did not solve. tried.c.
void cav_command_tell_diagnoses(FILE *out, const char *folder, const cav_problem *problem);

/// Time of a clock, s: CLOCK_MONOTONIC, CLOCK_PROCESS_CPUTIME_ID.
double cav_command_clock(clockid_t clock);

/// Whether the solve of a folder was stopped, in its motion or, without success until then, in other strategies; tells where,
/// unless out is NULL. tried.c.
int cav_command_tell_stopped(FILE *out, const char *folder);

/// Says which waypoint of a guess is deepest inside something, if that is deep; whole: or else where all of it is
/// deepest in a solid. preview.c.
void cav_command_tell_guess(FILE *out, const cav_problem *problem, int whole);

/// How a solve begins where that is not the guess of the file: what its first strategy does. preview.c.
void cav_command_tell_begin(FILE *out, const char *indent, const cav_strategy *first);

/// Tells of a step in which bodies fall far: milliseconds, perhaps, where seconds are meant. inspect.c.
void cav_command_tell_step(FILE *out, const cav_problem *problem);

/// How many of a model's actuators a motion can be planned with. inspect.c.
int cav_command_count_planned(const cav_model *model);

/// Prints what a problem asks for; all: with its equations and schedule. inspect_problem.c.
cav_status cav_command_print_problem(const cav_problem *problem, int all, cav_error *error);

/// Tells which equality constraints of the model a start that is given, or a goal, breaks by more than their softness
/// explains, a line each; their number. equalities.c.
int cav_command_tell_equalities(FILE *out, const cav_problem *problem);

/// Prints where a posture of a problem has its centre of mass, which bodies touch the world and what is deepest in what: a line
/// that begins with a name, and, of what rests there, where nothing bears its centre of mass. all: every body that touches is
/// named. stance.c.
cav_status cav_command_print_stance(const cav_problem *problem, const char *name, const double *q, int rests, int all,
                                    cav_error *error);

/// The names of the geoms of a pair, of the one that moves and of the one that it is in: where one is of the world, that. Returns
/// the latter. stance.c.
int cav_command_pair(const cav_model *model, int pair, char moves[CAV_WORDS], char stands[CAV_WORDS]);

/// The contact with the least distance, NULL: there is none. stance.c.
const cav_contact *cav_command_deepest(const cav_state *state);

/// Tells of a start that is given in the air, at rest and held by nothing, and of a goal, or a start that is found, deep inside
/// something, a line each; their number. postures.c.
int cav_command_tell_postures(FILE *out, const cav_problem *problem);

/// Says of a body that floats and has to be farther in a time than pushing off the ground brings it, and of a thing to slide that
/// is too heavy for what stands there; their number. demands.c.
int cav_command_tell_demands(FILE *out, const cav_problem *problem);

/// Says of a <goal> that no term asks for where a term wants another reading at the end; their number. postures.c.
int cav_command_tell_goal(FILE *out, const cav_problem *problem);

/// A number without the sign of a zero, and not in digits that are rounding. asked.c.
double cav_command_plain(double x);

/// Says of numbers that are likely to be of another unit (degrees, millimetres), of a touch without a target, of a time that
/// lies between knots, of roots of things that a term of roots counts, and of a thing that may have to slide or roll; their
/// number. asked.c.
int cav_command_tell_units(FILE *out, const cav_problem *problem);

/// Prints where surfaces of roles and things end, at the posture of the file or, of a problem, at its start. extents.c.
cav_status cav_command_print_extents(const cav_model *model, const cav_problem *problem, cav_error *error);

/// Prints what terms with a target read at the start and at the goal, and what they want: a line each. asked.c.
cav_status cav_command_print_asked(const cav_problem *problem, cav_error *error);

/// The free joint of a tree with actuators whose place and tilt a posture term of joints leaves open; -1: none. asked.c.
int cav_command_base(const cav_problem *problem, const cav_term *term);

/// Whether a term is of forces at the last knot of a motion that does not close at rest, where there are none: nothing
/// measures it. asked.c.
int cav_command_unmeasured(const cav_problem *problem, const cav_term *term);

/// Mass of a tree, by its root link, kg. postures.c.
double cav_command_tree_mass(const cav_model *model, int root);

/// Whether gravity and contacts alone act on a tree of links that floats, none of it lifted by buoyancy. postures.c.
int cav_command_floats(const cav_model *model, int root);

/// The same, where an actuator moves its root, too, so that a motion of it is meant. postures.c.
int cav_command_is_loose(const cav_model *model, int root);

/// Says of terms that ask for a component, a direction or an orientation in a body's principal axes that these are turned
/// from its own; their number. axes.c.
int cav_command_tell_axes(FILE *out, const cav_problem *problem);

/// Tells which solids of the world a motion leans on that neither its first nor its last knot touches, and that it never
/// leaves the ground where the problem's guess does. leaned_on.c.
void cav_command_tell_leaning(FILE *out, const cav_problem *problem, const cav_trajectory *motion,
                              const cav_options *contact);

/// Before a solve: tells the one cause why a problem cannot have a solution, if there is one. 0: solve it; otherwise the
/// exit status.
int cav_command_refuse(const cav_command_line *line, const cav_problem *problem);

/// Where actuators have no limit of effort, so that a plan may use any force of them: tells it. command.c.
void cav_command_warn_efforts(const cav_model *model, FILE *out);

/// Tells how far the model of a mirrored cycle is from its mirror image, where it is not that.
void cav_command_tell_asymmetry(const cav_problem *problem, FILE *out);

#endif
