/// cavort solve of several problems, or of one with several values of its settings: each in a process, into one folder. A
/// batch that was stopped goes on where it was. cavort table: what became of solves.
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "batch.h"
#include "command.h"
#include "file.h"

static volatile sig_atomic_t interrupted;

static void interrupt(int signal_number) {
  (void)signal_number;
  interrupted = 1;
}

static void catch_interrupts(void) {
  struct sigaction action = {.sa_handler = interrupt};
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, NULL);
  sigaction(SIGTERM, &action, NULL);
  // nohup has asked for another answer
  struct sigaction before;
  if (sigaction(SIGHUP, NULL, &before) == 0 && before.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, NULL);
}

// one of them, with one thread unless more are asked for
static int solve(void *context, const cav_batch_item *item, const char *folder) {
  cav_command_line line = *(const cav_command_line *)context;
  cav_error error = {0};
  line.operand = item->problem;
  line.output = folder;
  line.noperand = 1;
  line.nset = line.jobs = 0;
  line.threads = line.threads_given ? line.threads : 1;
  line.resume = item->resume;
  if (cav_command_expect("solve", "PROBLEM", item->source, &error)) return cav_command_fail(&error);
  return cav_command_solve(&line);
}

// what a solve depends on beside its problem and model
static void describe(const cav_command_line *line, char *text, size_t room) {
  int n = snprintf(text, room, "%s strategies=%d force=%d", cav_solver_rule_of(line->solver)->name, line->strategies,
                   line->force);
  for (int i = 0; i < line->nipopt && n < (int)room; i++)
    n += snprintf(text + n, room - (size_t)n, " %s=%s", line->ipopt[i].name, line->ipopt[i].value);
}

int cav_command_batch(const cav_command_line *line) {
  cav_error error = {0};
  char options[220];
  describe(line, options, sizeof options);
  // threads of each, where they are asked for, share the processors
  int at_once = line->threads_given ? (int)sysconf(_SC_NPROCESSORS_ONLN) / line->threads : line->threads;
  cav_batch batch = {.folder = line->output ? line->output : "batch",
                     .processes = line->jobs    ? line->jobs
                                  : at_once > 1 ? at_once
                                                : 1,
                     .tell = !line->quiet,
                     .interrupted = &interrupted,
                     .model = line->model,
                     .options = options,
                     .solve = solve,
                     .context = (void *)line};
  if (line->json) {
    cav_file_fail(&error, CAV_BAD_INPUT, 0, "--json is of one problem; of several: cavort table %s --csv",
                  batch.folder);
    return cav_command_fail(&error);
  }
  // a name that is misspelt is told before the others are solved
  for (int i = 0; i < line->noperand; i++) {
    if (access(line->operands[i], R_OK) == 0) continue;
    cav_file_fail(&error, CAV_BAD_INPUT, 0, "%s: cannot be opened: %s; nothing was solved", line->operands[i],
                  strerror(errno));
    return cav_command_fail(&error);
  }
  cav_status status = cav_batch_open(&batch, line->noperand, line->operands, line->nset, line->set, &error);
  catch_interrupts();
  if (!status) status = cav_batch_run(&batch, &error);
  cav_summary *summary = status ? NULL : calloc((size_t)batch.n + 1, sizeof *summary);
  if (!status && !summary) status = cav_file_fail(&error, CAV_NO_MEMORY, 0, "no memory for the table");
  int good = 0, n = batch.n;
  if (!status) {
    cav_batch_summary(&batch, summary);
    for (int i = 0; i < n; i++) good += summary[i].certified && summary[i].achieved;
    if (!line->quiet) cav_summary_print(stdout, n, summary, 0);
    if (!line->quiet) printf("results: %s\n", batch.folder);
  }
  free(summary);
  cav_batch_close(&batch);
  if (status) return cav_command_fail(&error);
  if (interrupted) {
    fprintf(stderr, "cavort: stopped; the same command goes on\n");
    return CAV_EXIT_INTERRUPTED;
  }
  return good == n ? CAV_EXIT_CERTIFIED : CAV_EXIT_NOT_CERTIFIED;
}

int cav_command_table(const cav_command_line *line) {
  cav_error error = {0};
  cav_summary *summary;
  int n;
  if (cav_summary_list(line->noperand, line->operands, &n, &summary, &error)) return cav_command_fail(&error);
  cav_summary_print(stdout, n, summary, line->csv);
  free(summary);
  return CAV_EXIT_CERTIFIED;
}
