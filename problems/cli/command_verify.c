/// cavort verify and cavort view: what a result folder holds, certified again or shown. verify writes nothing; view
/// writes forces.csv and view.html.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "certificate.h"
#include "command.h"
#include "result.h"

static cav_status certify(const cav_result *result, cav_verdict *verdict, cav_error *error) {
  memset(verdict, 0, sizeof *verdict);
  cav_status status = cav_verify(result->problem, result->trajectory, &result->problem->contact, result->gain_q,
                                 result->gain_v, verdict, error);
  if (!status)
    status = cav_verify_optimality(result->problem, result->trajectory, &result->problem->contact, result->nrow,
                                   result->row, verdict, error);
  verdict->solve_seconds = result->solve_seconds;
  verdict->iterations = result->iterations;
  return status;
}

int cav_command_verify(const cav_command_line *line) {
  cav_error error = {0};
  cav_verdict verdict;
  cav_result *result = cav_result_read(line->operand, line->model, &error);
  if (!result) return cav_command_fail(&error);
  cav_status status = certify(result, &verdict, &error);
  cav_term_report *terms = status ? NULL : calloc((size_t)result->problem->nterm + 1, sizeof *terms);
  if (terms)
    status = cav_terms_report(result->problem, result->trajectory, &result->problem->contact, terms, NULL, &error);
  if (!status && line->json) cav_certificate_json(stdout, result->problem, &verdict, terms, NULL);
  if (!status && !line->json && !line->quiet) cav_certificate_print(stdout, result->problem, &verdict, terms);
  free(terms);
  cav_result_free(result);
  if (status) return cav_command_fail(&error);
  return verdict.certified && verdict.achieved ? CAV_EXIT_CERTIFIED : CAV_EXIT_NOT_CERTIFIED;
}

int cav_command_view(const cav_command_line *line) {
  cav_error error = {0};
  struct stat info;
  // a file is a problem
  if (!stat(line->operand, &info) && S_ISREG(info.st_mode)) return cav_command_preview(line);
  cav_verdict verdict;
  cav_result *result = cav_result_read(line->operand, line->model, &error);
  if (!result) return cav_command_fail(&error);
  cav_status status = certify(result, &verdict, &error);
  if (!status) {
    status = cav_result_write_page(line->operand, result->problem, result->trajectory, &result->problem->contact,
                                   &verdict, &error);
  }
  cav_result_free(result);
  if (status) return cav_command_fail(&error);
  char *page = cav_result_path(line->operand, "view.html"), *full = page ? realpath(page, NULL) : NULL;
  if (!line->quiet)
    printf("open in a browser: %s%s\n", full ? "file://" : "", full ? full : page ? page : line->operand);
  free(page);
  free(full);
  return 0;
}
