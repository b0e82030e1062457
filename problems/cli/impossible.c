/// What the commands say of a problem that cannot have a solution.
#include <stdio.h>

#include "certificate.h"
#include "command.h"

enum { MOST = 3 };

int cav_command_impossible(FILE *out, const char *before, const cav_problem *problem, int most, cav_error *error) {
  cav_impossibility found[MOST];
  int n = 0;
  cav_status status = cav_problem_impossible(problem, found, most < MOST ? most : MOST, &n, error);
  if (status) return -1;
  for (int i = 0; i < n; i++) fprintf(out, "%simpossible: %s\n  %s\n", before, found[i].what, found[i].cure);
  return n;
}

int cav_command_refuse(const cav_command_line *line, const cav_problem *problem) {
  cav_error error = {0};
  cav_impossibility cause;
  int n = 0;
  if (cav_problem_impossible(problem, &cause, 1, &n, &error)) return cav_command_fail(&error);
  if (n == 0) return 0;
  fprintf(stderr, "cavort: impossible: %s\n  %s\n", cause.what, cause.cure);
  if (line->force) return 0;
  fprintf(stderr, "  (nothing was solved; --force solves all the same)\n");
  if (line->json) {
    printf("{\n  \"certified\": false,\n  \"achieved\": false,\n  \"impossible\": ");
    cav_certificate_json_text(stdout, cause.what);
    printf(",\n  \"cure\": ");
    cav_certificate_json_text(stdout, cause.cure);
    printf("\n}\n");
  }
  return CAV_EXIT_NOT_CERTIFIED;
}
