/// cavort explain: why the motion of a result folder is as it is, in three lines: a proof that the problem cannot be solved, what
/// the certificate and what was asked miss, and the one cause; --all lists what is missed by rows, and which constraints pull
/// against each other. Exit status as that of verify: 0 certified and achieved, 1 if not.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "certificate.h"
#include "command.h"
#include "result.h"
#include "summary.h"

static void print_when(const cav_reason *r) {
  printf("  knot %d, %.4g s", r->row.knot, r->time);
  if (r->last > r->first) printf(" (knots %d to %d)", r->first, r->last);
  printf(": %s\n    %s\n", r->what, r->cure);
}

// at most this many, unless all are asked for
enum { LINES = 3 };

static void print_cause(const cav_reason *r, const char *before) {
  printf("%s%s, at %.4g s. %s\n", before, r->what, r->time, r->cure);
}

// what is missed, and why, in a few lines
static void print_brief(const cav_explanation *e, const cav_verdict *verdict, const cav_impossibility *impossible,
                        const char *pumping, const char *missed, const char *repair) {
  int n = 0, good = verdict->certified && verdict->achieved;
  if (impossible) n += printf("impossible: %s. %s\n", impossible->what, impossible->cure) > 0;
  if (!impossible && *pumping) n += printf("cause: %s\n", pumping) > 0;
  int apart = !impossible && !*pumping && *e->contradiction;
  if (apart) n += printf("cause: %s. %s\n", e->contradiction, e->nconflict ? e->conflict[0].cure : "") > 0;
  const char *whose = repair ? " (of a repair, --all tells)" : "";
  // what the motion is of goes before what its cost hangs on
  if (good && repair) n += puts(repair) >= 0;
  if (!verdict->certified) n += printf("not certified%s: %s\n", whose, verdict->reason) > 0;
  if (!verdict->achieved && n < LINES) n += printf("not achieved: misses %s\n", verdict->missed) > 0;
  if (good)
    n += printf("nothing is missed; %s\n",
                e->nconflict ? "what the cost hangs on:" : "no limit or constraint holds the cost back") > 0;
  int known = impossible || *pumping || apart;
  if (!known && *missed) n += printf("cause: %s\n", missed) > 0, known = 1;
  if (e->met || known) {
    for (int i = 0; i < e->nconflict && n < LINES && !known; i++, n++)
      print_cause(&e->conflict[i], good ? "  " : "what the cost hangs on: ");
  } else if (n < LINES && e->nconflict) {
    print_cause(&e->conflict[0], "cause: "), n++;
  } else if (n < LINES && e->nviolation) {
    print_cause(&e->violation[0], "cause: "), n++;
  }
  if (repair && !good && n < LINES) puts(repair);
}

static void print_table(const cav_explanation *e, const cav_verdict *verdict) {
  if (!verdict->certified) printf("not certified: %s\n", verdict->reason);
  if (!verdict->achieved) printf("not achieved: misses %s\n", verdict->missed);
  if (e->nviolation)
    printf("constraints missed, by size:\n");
  else
    printf(verdict->certified && verdict->achieved ? "nothing is missed\n" : "every constraint of the solver holds\n");
  for (int i = 0; i < e->nviolation; i++) {
    printf("%2d. %.3g", i + 1, e->violation[i].violation);
    print_when(&e->violation[i]);
  }
  if (e->nconflict) printf(e->met ? "what the cost hangs on:\n" : "what pulls against each other, by fraction:\n");
  if (!e->nconflict && e->met) printf("no limit or constraint holds the cost back\n");
  for (int i = 0; i < e->nconflict; i++) {
    printf("%2d. %.0f %%", i + 1, 100 * e->conflict[i].fraction);
    print_when(&e->conflict[i]);
  }
}

static void print_reasons(const char *name, int n, const cav_reason *reason) {
  printf(",\n  \"%s\": [", name);
  for (int i = 0; i < n; i++) {
    const cav_reason *r = &reason[i];
    printf(
        "%s\n    {\"knot\": %d, \"first\": %d, \"last\": %d, \"time\": %.17g, \"violation\": %.17g, \"pull\": %.17g, "
        "\"fraction\": %.17g, \"saving\": %.17g,\n     \"what\": ",
        i ? "," : "", r->row.knot, r->first, r->last, r->time, r->violation, r->pull, r->fraction, r->saving);
    cav_certificate_json_text(stdout, r->what);
    printf(",\n     \"cure\": ");
    cav_certificate_json_text(stdout, r->cure);
    printf("}");
  }
  printf("]");
}

// whether the motion of a folder is one that a repair found: with what, and what the problem as it was stated misses; to be freed
static char *told_of_repair(const char *folder) {
  cav_tried t = cav_tried_open(folder);
  char *stated = NULL, *told = NULL;
  while (!told && cav_tried_next(&t)) {
    if (!stated) stated = strdup(t.reason);
    if (!t.kept || !*t.changed || !stated || !(told = malloc(strlen(t.changed) + strlen(stated) + 120))) continue;
    sprintf(told, "this motion is not of the problem as it was stated, but with %s; as stated it misses: %s", t.changed,
            !*stated                        ? "a target"
            : strncmp(stated, "misses ", 7) ? stated
                                            : stated + 7);
  }
  cav_tried_close(&t);
  free(stated);
  return told;
}

typedef enum trial { NOT_TRIED, TRIED, STOPPED, WITH_OTHERS } trial;

// whether a text is in a line, where " and ' are the same
static int is_among(const char *line, const char *text) {
  for (; *line; line++) {
    size_t k = 0;
    while (text[k] && (line[k] == '"' ? '\'' : line[k]) == (text[k] == '"' ? '\'' : text[k])) k++;
    if (!text[k]) return 1;
  }
  return 0;
}

// whether each of a line's changes, which commas part, is one of either list, or that solids grow
static int is_made_of(const char *line, const char *list, const char *other) {
  if (!*line) return 0;
  while (*line) {
    const size_t n = strcspn(line, ",");
    char one[CAV_STRATEGY_CHANGES];
    snprintf(one, sizeof one, "%.*s", (int)n, line);
    for (char *c = one; *c; c++)
      if (*c == '"') *c = '\'';
    if (!is_among(list, one) && !is_among(other, one) && strcmp(one, "solids='grow'")) return 0;
    line += n + strspn(line + n, ", ");
  }
  return 1;
}

// whether a strategy of the folder's solve made these changes of the folder's problem, or was stopped while it did
static trial was_tried(const char *folder, const char *changes) {
  trial what = NOT_TRIED;
  cav_tried t = cav_tried_open(folder);
  char *kept = NULL;
  while (!kept && cav_tried_next(&t))
    if (t.kept) kept = strdup(t.changed);
  cav_tried_close(&t);
  t = cav_tried_open(folder);
  // a solid's growth and what the kept motion changed are of the folder's problem already
  while (what == NOT_TRIED && cav_tried_next(&t))
    if (is_made_of(t.changed, changes, kept ? kept : "") && is_made_of(changes, t.changed, ""))
      what = strcmp(t.outcome, "stopped") ? TRIED : STOPPED;
  cav_tried_close(&t);
  t = cav_tried_open(folder);
  while (what == NOT_TRIED && cav_tried_next(&t))
    if (is_among(t.changed, changes) && !strncmp(t.outcome, "not ", 4) && strcmp(t.outcome, "not tried"))
      what = WITH_OTHERS;
  cav_tried_close(&t);
  free(kept);
  return what;
}

// times what a certificate allows from which on a defect of momentum may be that of a motion that no body can do
static const double far = 20;

// what of the file to change where a motion is possible and a certificate misses something else: no limit is the cause of that
static void tell_remedy(const cav_result *result, const cav_verdict *verdict, const char *folder, char *text,
                        size_t size) {
  cav_strategy strategy[CAV_STRATEGIES], repaired;
  int n = 0, found = 1;
  trial tried = NOT_TRIED;
  const cav_status status = cav_strategy_list(result->problem, strategy, &n);
  cav_strategies_clear(strategy + 1, n > 0 ? n - 1 : 0); // the first one has the problem's terms
  if (status || n == 0) return;
  int said = snprintf(text, size, "how it is planned, not what is asked: forces, limits and constraints hold. ");
  const double defect = verdict->momentum_defect_rms / CAV_TOLERANCE_MOMENTUM;
  if (defect > far)
    said = snprintf(
        text, size,
        "forces, limits and constraints hold at the knots, but between them momentum comes from nowhere, %.0f "
        "times what a certificate allows: fast turns need the order of momentum; where that does not help, more "
        "is asked than the body can do in that time. ",
        defect);
  for (int k = 0; found; k++) {
    if (cav_strategy_repair(result->problem, &strategy[0], verdict, k, &repaired, &found)) return;
    if (!found || (*repaired.changed && (tried = was_tried(folder, repaired.changed)) != TRIED)) break;
    cav_strategy_clear(&repaired);
  }
  if (found)
    snprintf(text + said, size - (size_t)said, "A usual remedy that %s: %s.",
             tried == STOPPED       ? "was being tried when the solve was stopped"
             : tried == WITH_OTHERS ? "was tried with others alone (strategies.csv)"
                                    : "was not tried",
             repaired.changed);
  else
    snprintf(text + said, size - (size_t)said,
             "The usual remedies were tried (strategies.csv): more time, or another way by postures (<waypoint> in "
             "<guess>).");
  if (found) cav_strategy_clear(&repaired);
}

int cav_command_explain(const cav_command_line *line) {
  cav_error error = {0};
  cav_result *result = cav_result_read(line->operand, line->model, &error);
  if (!result) return cav_command_fail(&error);
  static cav_explanation explanation; // some kilobytes
  cav_status status = cav_explain(result->problem, result->trajectory, &result->problem->contact, result->nrow,
                                  result->row, &explanation, &error);
  cav_verdict verdict = {0};
  if (!status)
    status = cav_verify(result->problem, result->trajectory, &result->problem->contact, result->gain_q, result->gain_v,
                        &verdict, &error);
  cav_impossibility impossible;
  int proofs = 0;
  char pumping[CAV_PUMPING_TEXT] = "";
  if (!status && !(verdict.certified && verdict.achieved) && cav_command_pumping(result->problem, pumping))
    *pumping = 0;
  if (!status) status = cav_problem_impossible(result->problem, &impossible, 1, &proofs, &error);
  char missed[CAV_MISSED_TEXT] = "", *repair = told_of_repair(line->operand);
  if (!status && verdict.certified && !verdict.achieved) {
    cav_error ignored = {0};
    if (cav_verify_optimality(result->problem, result->trajectory, &result->problem->contact, result->nrow, result->row,
                              &verdict, &ignored))
      verdict.optimality = NAN;
    cav_command_missed(result, &explanation, verdict.optimality, line->operand, missed);
  }
  if (!status && !verdict.certified && verdict.achieved && cav_verdict_feasible(&verdict) && !result->problem->cycle.on)
    tell_remedy(result, &verdict, line->operand, missed, sizeof missed);
  int stopped = !status && cav_command_tell_stopped(line->json ? NULL : stdout, line->operand);
  if (!status && !line->json && !verdict.certified) cav_command_tell_equalities(stdout, result->problem);
  if (!status && !line->json && !(verdict.certified && verdict.achieved))
    cav_command_tell_postures(stdout, result->problem), cav_command_tell_demands(stdout, result->problem);
  if (!status && line->json) {
    printf("{\n  \"stopped\": %s,\n", stopped ? "true" : "false");
    printf(
        "  \"met\": %s,\n  \"certified\": %s,\n  \"achieved\": %s,\n  \"reason\": ", explanation.met ? "true" : "false",
        verdict.certified ? "true" : "false", verdict.achieved ? "true" : "false");
    cav_certificate_json_text(stdout, verdict.reason);
    printf(",\n  \"missed\": ");
    cav_certificate_json_text(stdout, verdict.missed);
    printf(",\n  \"impossible\": ");
    cav_certificate_json_text(stdout, proofs ? impossible.what : "");
    printf(",\n  \"pumping\": ");
    cav_certificate_json_text(stdout, pumping);
    printf(",\n  \"contradiction\": ");
    cav_certificate_json_text(stdout, explanation.contradiction);
    printf(",\n  \"short\": ");
    cav_certificate_json_text(stdout, missed);
    printf(",\n  \"repair\": ");
    cav_certificate_json_text(stdout, repair ? repair : "");
    print_reasons("violation", explanation.nviolation, explanation.violation);
    print_reasons("conflict", explanation.nconflict, explanation.conflict);
    printf("\n}\n");
  } else if (!status && line->all) {
    if (repair) puts(repair);
    if (proofs) printf("impossible: %s\n  %s\n", impossible.what, impossible.cure);
    if (!proofs && *pumping) printf("cause: %s\n", pumping);
    if (*explanation.contradiction) printf("cause: %s\n", explanation.contradiction);
    if (!proofs && !*pumping && *missed) printf("cause: %s\n", missed);
    print_table(&explanation, &verdict);
  } else if (!status) {
    print_brief(&explanation, &verdict, proofs ? &impossible : NULL, pumping, missed, repair);
  }
  if (!status && !line->json && !(verdict.certified && verdict.achieved))
    cav_command_tell_diagnoses(stdout, line->operand, result->problem);
  cav_result_free(result);
  free(repair);
  if (status) return cav_command_fail(&error);
  return verdict.certified && verdict.achieved ? CAV_EXIT_CERTIFIED : CAV_EXIT_NOT_CERTIFIED;
}
