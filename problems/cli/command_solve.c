/// cavort solve: reads a problem, solves it, certifies the result, writes its folder. What the stated guess does not
/// lead to is tried by other strategies, in processes (race/race.c). The first Ctrl-C (SIGINT, SIGTERM, SIGHUP) ends the solve
/// with the best iterate saved; another one, a second later, ends the program at once. What is in the folder at any
/// moment can be read and gone on from (store.c).
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include "batch.h"
#include "certificate.h"
#include "command.h"
#include "file.h"
#include "provenance.h"
#include "race.h"
#include "result.h"
#include "store.h"

static volatile sig_atomic_t interrupted, first_second;

// asks for the end; again after a second has passed: ends at once. Some parents deliver one interrupt twice
static void interrupt(int signal_number) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  if (interrupted != CAV_STOP_NOW) {
    interrupted = CAV_STOP_NOW;
    first_second = (sig_atomic_t)now.tv_sec;
  } else if (now.tv_sec > first_second + 1) {
    signal(signal_number, SIG_DFL);
    raise(signal_number);
  }
}

// asks for the end soon, and never for more than that
static void time_is_up(int signal_number) {
  (void)signal_number;
  if (!interrupted) interrupted = CAV_STOP_SOON;
}

// seconds: after which it is as if someone had asked for the end, 0: never
static void catch_interrupts(double seconds) {
  struct sigaction action = {.sa_handler = interrupt}, alarm = {.sa_handler = time_is_up, .sa_flags = SA_RESTART};
  const struct itimerval once = {
      .it_value = {(time_t)seconds, (suseconds_t)fmin(ceil(1e6 * fmod(seconds, 1)), 999999)}};
  sigemptyset(&alarm.sa_mask);
  sigaction(SIGALRM, &alarm, NULL);
  setitimer(ITIMER_REAL, &once, NULL);
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, NULL);
  sigaction(SIGTERM, &action, NULL);
  // nohup has asked for another answer
  struct sigaction before;
  if (sigaction(SIGHUP, NULL, &before) == 0 && before.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, NULL);
}

// what the progress line remembers
typedef struct ticker {
  int quiet, terminal;
  int shown, stage;
  const char *phase;
  double last, begun; // s; when the phase began
} ticker;

static void show_progress(ticker *tick, const cav_progress *p) {
  int news = !tick->phase || strcmp(p->phase, tick->phase) || p->stage != tick->stage;
  if (!news && p->seconds - tick->last < (tick->terminal ? 0.1 : 1.0)) return;
  if (tick->terminal && tick->shown && news && p->seconds - tick->last < 0.05) return;
  if (tick->phase && !strcmp(tick->phase, "continuation") && !strcmp(p->phase, "kinematics"))
    fprintf(stderr,
            "%sforces from the guess come no nearer: begun again, by the places and postures that are asked for alone "
            "first\n",
            tick->terminal ? "\n" : "");
  if (!tick->phase || strcmp(p->phase, tick->phase)) tick->begun = p->seconds;
  tick->phase = p->phase;
  tick->stage = p->stage;
  tick->last = p->seconds;
  tick->shown = 1;
  char left[32] = "";
  // what goes on until nothing is gained any more has no length that is known
  int staged = !strcmp(p->phase, "continuation") || !strcmp(p->phase, "verification");
  // sets of gains are tried until one follows
  if (!strcmp(p->phase, "feedback") && p->stage > 1)
    snprintf(left, sizeof left, ", at most %.0f s left",
             (p->seconds - tick->begun) * (p->stages - p->stage + 1) / (p->stage - 1));
  if (p->fraction > 0.05 && staged) snprintf(left, sizeof left, ", %.0f s left", p->seconds * (1 / p->fraction - 1));
  fprintf(stderr,
          "%s%-12s %2d/%-2d  iteration %4d  cost %9.4g  unactuated %8.2e at knot %3d  violation %8.2e  %6.1f s  %2.0f "
          "%%%s%s",
          tick->terminal ? "\r" : "", p->phase, p->stage, p->stages, p->iteration, p->cost, p->unactuated, p->knot,
          p->violation, p->seconds, 100 * p->fraction, left, tick->terminal ? "\033[K" : "\n");
  fflush(stderr);
}

static int observe(void *context, const cav_progress *progress) {
  ticker *tick = context;
  if (!tick->quiet) show_progress(tick, progress);
  return interrupted == CAV_STOP_NOW;
}

// refuses a folder whose problem.xml is the problem file itself, which would be overwritten
static cav_status check_folder(const char *folder, const cav_command_line *line, cav_error *error) {
  cav_status status = CAV_OK;
  char *copy = cav_result_path(folder, "problem.xml");
  char *there = copy ? realpath(copy, NULL) : NULL, *here = realpath(line->operand, NULL);
  if (there && here && !strcmp(there, here)) {
    status = cav_file_fail(error, CAV_BAD_INPUT, 0,
                           "%s: holds the problem file itself, which the result would overwrite; choose another folder",
                           folder);
  }
  free(copy);
  free(there);
  free(here);
  return status;
}

// trajectory to start from: that of another problem's solve, on this problem's knots
static cav_trajectory *start_from(const char *folder, const cav_problem *problem, cav_error *error) {
  char *path = cav_result_path(folder, "trajectory.csv");
  cav_trajectory *start = path ? cav_trajectory_read(path, problem->model, error) : NULL;
  double h = problem->timestep, duration = start ? (start->nknot - 1) * start->timestep : 0;
  if (problem->duration_most > 0) h = duration / round(problem->duration / h);
  if (start && problem->duration_most == 0 && fabs(duration - problem->duration) > 0.5 * h) {
    cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: lasts %g s, the problem %g s; remove --resume to start anew", path,
                  duration, problem->duration);
    cav_trajectory_free(start);
    start = NULL;
  }
  if (start && fabs(start->timestep - h) > 1e-9 * h) {
    cav_trajectory *other = cav_trajectory_resample(problem->model, start, h);
    if (!other) cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory", path);
    cav_trajectory_free(start);
    start = other;
  }
  if (!path) cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  free(path);
  return start;
}

// where a solve starts, by what its folder holds: from the guess, on from checkpoints, or from a motion
typedef struct beginning {
  int resume;
  cav_trajectory *start;
  cav_checkpoint *motion; ///< of the motion, with multipliers that fit; NULL: none
} beginning;

// the mark of checkpoints: problem, model and solver
static void mark(const cav_command_line *line, const cav_provenance *p, char key[96]) {
  snprintf(key, 96, "%.24s-%.24s-%s", p->problem, p->model, cav_solver_rule_of(line->solver)->name);
}

// reads what --resume goes on from
static cav_status find_beginning(const char *folder, const cav_problem *problem, const char *key, beginning *b,
                                 cav_error *error) {
  char *path = cav_store_checkpoint(folder, "stated");
  if (!path) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  cav_checkpoint *c = NULL;
  if (access(path, F_OK) == 0 && !(c = cav_checkpoint_read(path, problem->model, error))) {
    free(path);
    return error->status;
  }
  free(path);
  b->resume = c && !strcmp(c->key, key);
  if (!b->resume && c && cav_race_fits(problem, c)) {
    b->motion = c;
    b->start = cav_trajectory_copy(c->trajectory);
    return b->start ? CAV_OK : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  }
  cav_checkpoint_free(c);
  if (!b->resume && !(b->start = start_from(folder, problem, error))) return error->status;
  return CAV_OK;
}

// what saving needs to know
typedef struct destination {
  const cav_command_line *line;
  const char *folder;
  const cav_provenance *provenance;
} destination;

// while the stated strategy is solved the folder can be read as a result
static void snapshot(void *context, const cav_problem *problem, const cav_checkpoint *checkpoint, int first) {
  const destination *to = context;
  cav_error error = {0};
  // of a plan that leaves out trees there is no whole motion yet
  if (checkpoint->trajectory->nv != problem->model->nv) return;
  if (cav_result_write_unfinished(to->folder, problem, checkpoint->trajectory, first, &error))
    fprintf(stderr, "cavort: %s\n", error.text);
}

static const char *why_stopped(int status) {
  if (status == CAV_NOT_FINITE) return "a number that is not finite came up; the last finite iterate is saved";
  return "the solver did not reach its tolerance; the best iterate is saved";
}

// writes a result and tells its verdict; the exit status
static int save(void *context, const cav_problem *problem, const cav_solution *solution,
                const cav_race_report *report) {
  const destination *to = context;
  const cav_command_line *line = to->line;
  const cav_verdict *verdict = &report->verdict;
  cav_error error = {0};
  // it may also have been stopped while other strategies were tried, and this one was verified before
  int stopped = report->status == CAV_INTERRUPTED, ended = stopped || (report->stopped && !cav_race_success(report));
  if (ended || *report->where)
    fprintf(stderr, "cavort: %s; the best iterate is %s, the same command with --resume goes on\n",
            stopped          ? verdict->reason
            : *report->where ? report->where
                             : "stopped while other strategies were tried",
            stopped || !*report->where ? "saved" : "verified as it is");
  else if (report->status)
    fprintf(stderr, "cavort: %s\n", report->text[0] ? report->text : why_stopped(report->status));
  cav_provenance provenance = *to->provenance;
  if (*report->changed) provenance.repaired = report->changed;
  cav_term_report *terms = calloc((size_t)problem->nterm + 1, sizeof *terms);
  char *origin = cav_provenance_json(&provenance);
  cav_status status = terms && origin ? cav_result_write(to->folder, problem, solution, &error) : CAV_NO_MEMORY;
  if (!status) status = cav_terms_report(problem, solution->trajectory, &solution->contact, terms, NULL, &error);
  if (!status) status = cav_result_write_verdict(to->folder, problem, verdict, terms, origin, &error);
  if (!status && line->errors && !stopped)
    cav_command_write_errors(to->folder, problem, solution->trajectory, &solution->contact, solution->nrow,
                             solution->row);
  if (!status && line->json) cav_certificate_json(stdout, problem, verdict, terms, NULL, origin);
  int told = !line->quiet && !line->json && !stopped;
  if (!status)
    status = cav_command_tell_records(to->folder, told, problem, solution->trajectory, &solution->contact, &error);
  if (!status && told) cav_certificate_print(stdout, problem, verdict, terms);
  if (!status && told && verdict->certified)
    cav_command_tell_leaning(stdout, problem, solution->trajectory, &solution->contact);
  free(terms), free(origin);
  if (status) return cav_command_fail(&error);
  // the page is a convenience: without three.js everything else stands
  if (!stopped &&
      cav_result_write_page(to->folder, problem, solution->trajectory, &solution->contact, verdict, &error)) {
    fprintf(stderr, "cavort: no page: %s\n", error.text);
  }
  if (!line->quiet && !line->json && *report->changed)
    printf("strategy repaired: not as the problem states it, but with %s (the folder's problem.xml has it)\n",
           report->changed);
  if (!line->quiet && !line->json) printf("result: %s\n", to->folder);
  if (ended) return CAV_EXIT_INTERRUPTED;
  return verdict->certified && verdict->achieved ? CAV_EXIT_CERTIFIED : CAV_EXIT_NOT_CERTIFIED;
}

static void tell_more(const cav_race *race) {
  const cav_verdict *v = &race->entry[0].report.verdict;
  if (!v->certified) fprintf(stderr, "not certified: %s\n", v->reason);
  if (!v->achieved) fprintf(stderr, "not achieved: misses %s\n", v->missed);
  fprintf(stderr, "trying by other strategies:");
  for (int i = 1; i < race->n; i++)
    if (race->entry[i].strategy.use == CAV_STRATEGY_TRY) fprintf(stderr, " %s", race->entry[i].strategy.name);
  fprintf(stderr, " (%d at a time; --strategies 1 for none)\n", race->processes);
}

// as the command line says: the first alone and the others where it does not do, or so many at once
static cav_status run_race(cav_race *race, const cav_command_line *line, ticker *tick, cav_error *error) {
  int at_once = line->strategies > 1;
  cav_status status = CAV_OK;
  if (!at_once) {
    status = cav_race_first(race, error);
    if (tick->terminal && tick->shown) fputs("\r\033[K", stderr);
    if (status || cav_race_success(&race->entry[0].report) || race->n == 1 || interrupted) return status;
    if (race->tell) tell_more(race);
  }
  return cav_race_finish(race, at_once, error);
}

// what would help where nothing did: found, and not kept
static void tell_cause(const cav_race *race) {
  const cav_problem *p = race->problem;
  char text[CAV_PUMPING_TEXT];
  if (!cav_command_pumping(p, text)) fprintf(stderr, "cavort: %s\n", text);
  for (int i = 0; i < race->n; i++) {
    const cav_race_entry *e = &race->entry[i];
    if (!cav_race_would_do(e)) continue;
    const int stronger = e->strategy.strength > 0;
    const cav_would_do what = e->strategy.open ? CAV_WOULD_DO_OPEN_END
                              : stronger       ? CAV_WOULD_DO_STRENGTH
                                               : CAV_WOULD_DO_DURATION;
    cav_command_tell_would_do(stderr, "cavort: ", p, what,
                              stronger ? e->strategy.strength : e->report.verdict.duration);
  }
}

// parameters that are not found yet are worth nothing: whatever was asked for ends them at once
static int ends(void *context) {
  (void)context;
  return interrupted != 0;
}

static int solve_from(const cav_command_line *line, const cav_problem *problem, const char *folder,
                      const cav_provenance *provenance, const char *key, const beginning *b) {
  cav_error error = {0};
  const double begun = cav_command_clock(CLOCK_MONOTONIC);
  ticker tick = {.quiet = line->quiet, .terminal = isatty(STDERR_FILENO)};
  destination to = {line, folder, provenance};
  cav_race race = {.problem = problem,
                   .start = b->start,
                   .folder = folder,
                   .key = key,
                   .resume = b->resume,
                   .snapshot = snapshot,
                   .options = cav_solve_options_default(),
                   .interrupted = &interrupted,
                   .processes = line->threads,
                   .tell = !line->quiet,
                   .save = save,
                   .context = &to};
  race.options.solver = line->solver;
  race.options.threads = line->threads;
  race.options.nipopt = line->nipopt;
  race.options.ipopt = line->ipopt;
  race.options.observer = observe;
  race.options.observer_context = &tick;
  if (b->motion) {
    race.options.first_stage = problem->schedule.stages + 1;
    race.options.nmultiplier = b->motion->nmultiplier;
    race.options.multiplier = b->motion->final_multiplier;
  }
  race.options.stop = ends;
  if (problem->nparameter) return cav_command_estimate(line, &race);
  // a start that is given is the only one
  int most = b->start ? 1 : line->strategies ? line->strategies : CAV_STRATEGIES;
  cav_status status = cav_race_open(&race, most, &error);
  if (!status && race.tell) cav_command_tell_step(stderr, problem);
  if (!status && race.tell) cav_command_tell_units(stderr, problem);
  if (!status && race.tell) cav_command_tell_equalities(stderr, problem);
  if (!status && race.tell) cav_command_tell_postures(stderr, problem);
  if (!status && race.tell) cav_command_tell_demands(stderr, problem);
  if (!status && race.tell) cav_command_tell_axes(stderr, problem);
  if (!status && race.tell) cav_command_tell_guess(stderr, problem, 0);
  if (!status && race.tell) cav_command_tell_begin(stderr, "", &race.entry[0].strategy);
  if (!status) status = run_race(&race, line, &tick, &error);
  int best = status ? -1 : cav_race_best(&race, line->strategies > 1), done = CAV_EXIT_INTERNAL;
  if (best >= 0 && race.tell && !interrupted && !cav_race_success(&race.entry[best].report)) tell_cause(&race);
  if (best >= 0) {
    done = cav_race_save(&race, best);
    char *path = cav_result_path(folder, "strategies.csv");
    status = path ? cav_race_write(&race, best, path, &error) : cav_file_fail(&error, CAV_NO_MEMORY, 0, "no memory");
    free(path);
  } else if (!status) {
    status = cav_file_fail(&error, CAV_NOT_CONVERGED, 0, "no strategy led to a motion");
  }
  int tried = 0;
  for (int i = 0; i < race.n; i++) tried += race.entry[i].state == CAV_RACE_DONE;
  if (race.tell && best >= 0 && tried > 1 && !status && !line->json && !interrupted)
    cav_command_tell_tried(stdout, folder);
  if (race.tell && best >= 0 && tried > 1)
    fprintf(stderr, "kept: strategy %s, of %d tried in %.1f s\n", race.entry[best].strategy.name, tried,
            cav_command_clock(CLOCK_MONOTONIC) - begun);
  if (status) done = cav_command_fail(&error);
  cav_race_close(&race);
  return done;
}

static int solve_into(const cav_command_line *line, const cav_problem *problem, const char *folder) {
  cav_error error = {0};
  cav_provenance provenance;
  cav_store store;
  beginning b = {0};
  char key[96];
  cav_provenance_take(&provenance, line->arguments, line->operand, problem->model_path);
  mark(line, &provenance, key);
  cav_status status = problem->solved ? CAV_OK : check_folder(folder, line, &error);
  if (!status && line->resume) status = find_beginning(folder, problem, key, &b, &error);
  int done = 0;
  if (!status) {
    status = cav_store_open(&store, folder, b.resume, &error);
    if (!status && store.aside && !line->quiet) fprintf(stderr, "the earlier result is in %s now\n", store.aside);
    if (!status) done = solve_from(line, problem, folder, &provenance, key, &b);
    cav_store_close(&store);
  }
  cav_checkpoint_free(b.motion);
  cav_trajectory_free(b.start);
  return status ? cav_command_fail(&error) : done;
}

static int solve_one(const cav_command_line *line) {
  cav_error error = {0};
  if (line->nipopt && !*cav_solver_rule_of(line->solver)->library) {
    cav_file_fail(&error, CAV_BAD_INPUT, 0, "--ipopt needs --solver ipopt or both: the own solver has no such options");
    return cav_command_fail(&error);
  }
  // from here on: proofs and the first stage of a long horizon take a while, too
  catch_interrupts(line->seconds);
  cav_problem *problem = cav_problem_load(line->operand, line->model, &error);
  if (!problem) return cav_command_fail(&error);
  int refused = cav_command_refuse(line, problem);
  if (!refused && line->resume && problem->nparameter) {
    cav_file_fail(
        &error, CAV_BAD_INPUT, 0,
        "--resume goes on with a motion, and <parameter> are found with it; the folder's problem.xml has those "
        "that were found so far, and is solved like any other: cavort solve DIR/problem.xml -o OTHER");
    refused = cav_command_fail(&error);
  }
  if (refused) {
    cav_problem_free(problem);
    return refused;
  }
  for (int i = 0; i < problem->model->nwarning && !line->quiet; i++)
    fprintf(stderr, "cavort: %s\n", problem->model->warning[i]);
  cav_command_warn_efforts(problem->model, stderr);
  cav_command_tell_asymmetry(problem, stderr);
  char *folder = cav_command_folder(line, problem->name, ".result");
  int done;
  if (folder) {
    done = solve_into(line, problem, folder);
  } else {
    error = (cav_error){.status = CAV_NO_MEMORY};
    done = cav_command_fail(&error);
  }
  free(folder);
  cav_problem_free(problem);
  return done;
}

// the problem with its settings as a file of its own: FOLDER.xml, or NAME.set.xml after the file
static int solve_set(const cav_command_line *line) {
  cav_error error = {0};
  cav_command_line set = *line;
  const char *slash = strrchr(line->operand, '/'), *name = line->output ? line->output
                                                           : slash      ? slash + 1
                                                                        : line->operand;
  size_t length = strlen(name);
  if (!line->output && length > 4 && !strcmp(name + length - 4, ".xml")) length -= 4;
  char *path = malloc(length + 9);
  if (path) sprintf(path, "%.*s%s", (int)length, name, line->output ? ".xml" : ".set.xml");
  cav_status status = path ? cav_command_write_set(line, path, &error) : CAV_NO_MEMORY;
  set.operand = path;
  int done = status ? cav_command_fail(&error) : solve_one(&set);
  free(path);
  return done;
}

int cav_command_solve(const cav_command_line *line) {
  if (line->noperand > 1 || line->jobs || cav_batch_sweeps(line->nset, line->set)) return cav_command_batch(line);
  return line->nset ? solve_set(line) : solve_one(line);
}
