/// What the commands say of a problem that cannot have a solution, or needs more than it gives.
#include <math.h>
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

int cav_command_pumping(const cav_problem *p, char text[CAV_PUMPING_TEXT]) {
  cav_pumping pumping;
  char time[80], effort[80];
  if (cav_problem_pumping(p, &pumping) || !pumping.needed) return 1;
  double seconds = pumping.seconds, efforts = pumping.efforts, suggested = ceil(11 * seconds) / 10;
  if (isfinite(seconds))
    snprintf(time, sizeof time, "takes %s%.3g s, of %.3g s given", pumping.exact ? "at least " : "", seconds,
             p->duration);
  else
    snprintf(time, sizeof time, "does not come there in %.3g s", 8 * p->duration);
  if (efforts > 1 && isfinite(efforts))
    snprintf(effort, sizeof effort,
             pumping.exact ? "; it needs %.3g times the effort" : "; with %.3g times the effort it would do", efforts);
  else
    snprintf(effort, sizeof effort, "%s", efforts > 1 ? "; nor would 9 times the effort do" : "");
  int n =
      snprintf(text, CAV_PUMPING_TEXT,
               "actuators are too weak to go there directly, so energy has to be pumped in: %sat the efforts planned "
               "with (%.3g of the limits), that %s%s.",
               pumping.exact ? "" : "by simulated laws, ", p->effort_limit, time, effort);
  double effort_limit = ceil(102 * efforts * p->effort_limit) / 100;
  if (!isfinite(seconds) || seconds <= p->duration) return 0;
  n += snprintf(text + n, CAV_PUMPING_TEXT - (size_t)n, " Try <horizon duration=\"%.3g\"/>", suggested);
  if (effort_limit <= 1)
    snprintf(text + n, CAV_PUMPING_TEXT - (size_t)n, " or <limits effort=\"%.3g\"/>.", effort_limit);
  else
    snprintf(text + n, CAV_PUMPING_TEXT - (size_t)n, ".");
  return 0;
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
