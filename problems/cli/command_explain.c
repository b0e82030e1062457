/// cavort explain: what the motion of a result folder misses, first of its certificate and of what was asked, then by rows; and
/// which constraints pull against each other. Exit status as that of verify: 0 certified and achieved, 1 if not.
#include <stdio.h>
#include <stdlib.h>

#include "certificate.h"
#include "command.h"
#include "result.h"

static void print_when(const cav_reason *r) {
  printf("  knot %d, %.4g s", r->row.knot, r->time);
  if (r->last > r->first) printf(" (knots %d to %d)", r->first, r->last);
  printf(": %s\n    %s\n", r->what, r->cure);
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
        "\"fraction\": %.17g,\n     \"what\": ",
        i ? "," : "", r->row.knot, r->first, r->last, r->time, r->violation, r->pull, r->fraction);
    cav_certificate_json_text(stdout, r->what);
    printf(",\n     \"cure\": ");
    cav_certificate_json_text(stdout, r->cure);
    printf("}");
  }
  printf("]");
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
  if (!status && line->json) {
    printf("{\n  \"met\": %s,\n  \"certified\": %s,\n  \"achieved\": %s,\n  \"reason\": ",
           explanation.met ? "true" : "false", verdict.certified ? "true" : "false",
           verdict.achieved ? "true" : "false");
    cav_certificate_json_text(stdout, verdict.reason);
    printf(",\n  \"missed\": ");
    cav_certificate_json_text(stdout, verdict.missed);
    print_reasons("violation", explanation.nviolation, explanation.violation);
    print_reasons("conflict", explanation.nconflict, explanation.conflict);
    printf("\n}\n");
  } else if (!status) {
    print_table(&explanation, &verdict);
  }
  cav_result_free(result);
  if (status) return cav_command_fail(&error);
  return verdict.certified && verdict.achieved ? CAV_EXIT_CERTIFIED : CAV_EXIT_NOT_CERTIFIED;
}
