/// cavort verify and cavort view: what a result folder holds, certified again or shown. verify writes nothing but
/// stderr.csv where that is asked for; view writes forces.csv, controls.csv and view.html, or one page of two folders.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

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

static void tell_starts(const cav_starts_report *r, int gains) {
  printf("from %d of %d starts up to 1 mm, 1 mrad, 10 mm/s and 10 mrad/s off%s the motion is followed", r->followed,
         r->starts, gains ? ", none of which gains were chosen by," : ", without gains,");
  if (r->followed > 0) printf(", to %.3g mm at the end", 1e3 * r->end_error_m);
  if (r->followed < r->starts) printf("; lost from %.2g s on", r->soonest_lost);
  putchar('\n');
}

int cav_command_verify(const cav_command_line *line) {
  cav_error error = {0};
  cav_verdict verdict;
  cav_starts_report starts;
  cav_result *result = cav_result_read(line->operand, line->model, &error);
  if (!result) return cav_command_fail(&error);
  cav_status status = certify(result, &verdict, &error);
  if (!status && line->starts > 0)
    status = cav_verify_starts(result->problem, result->trajectory, &result->problem->contact, result->gain_q,
                               result->gain_v, line->starts, &starts, &error);
  cav_term_report *terms = status ? NULL : calloc((size_t)result->problem->nterm + 1, sizeof *terms);
  if (terms)
    status = cav_terms_report(result->problem, result->trajectory, &result->problem->contact, terms, NULL, &error);
  if (!status && line->errors)
    cav_command_write_errors(line->operand, result->problem, result->trajectory, &result->problem->contact,
                             result->nrow, result->row);
  if (!status && line->json)
    cav_certificate_json(stdout, result->problem, &verdict, terms, line->starts > 0 ? &starts : NULL, NULL);
  if (!status && !line->json && !line->quiet)
    status = cav_command_tell_records(NULL, 1, result->problem, result->trajectory, &result->problem->contact, &error);
  if (!status && !line->json && !line->quiet) {
    cav_command_tell_stopped(stdout, line->operand);
    cav_certificate_print(stdout, result->problem, &verdict, terms);
    if (line->starts > 0) tell_starts(&starts, result->gain_q != NULL);
    cav_command_tell_tried(stdout, line->operand);
    if (verdict.certified)
      cav_command_tell_leaning(stdout, result->problem, result->trajectory, &result->problem->contact);
  }
  free(terms);
  cav_result_free(result);
  if (status) return cav_command_fail(&error);
  return verdict.certified && verdict.achieved ? CAV_EXIT_CERTIFIED : CAV_EXIT_NOT_CERTIFIED;
}

// the last name of a folder's path, whatever it ends in
static void name_of(const char *folder, char name[128]) {
  char *full = realpath(folder, NULL);
  const char *slash = full ? strrchr(full, '/') : NULL;
  snprintf(name, 128, "%.100s", slash && slash[1] ? slash + 1 : folder);
  free(full);
}

static void tell_page(const cav_command_line *line, const char *page) {
  char *full = realpath(page, NULL);
  if (!line->quiet) printf("open in a browser: %s%s\n", full ? "file://" : "", full ? full : page);
  free(full);
}

// whether a folder holds a motion alone, as cavort ik writes it
static int is_fit(const char *folder) {
  char *problem = cav_result_path(folder, "problem.xml"), *motion = cav_result_path(folder, "trajectory.csv");
  int fit = problem && motion && access(problem, F_OK) && !access(motion, F_OK);
  free(problem), free(motion);
  return fit;
}

// a fit beside a result: its motion, of the result's problem, with no verdict
static cav_result *read_fit(const char *folder, const char *other, const char *model, cav_error *error) {
  cav_result *result = cav_result_read(other, model, error);
  char *path = cav_result_path(folder, "trajectory.csv");
  if (result) cav_trajectory_free(result->trajectory);
  if (result) result->trajectory = path ? cav_trajectory_read(path, result->problem->model, error) : NULL;
  free(path);
  if (!result || result->trajectory) return result;
  cav_result_free(result);
  return NULL;
}

// cavort view DIR DIR: one page of both, in the folder of the command; the first may be of a fit
static int compare(const cav_command_line *line) {
  cav_error error = {0};
  cav_result *result[2] = {NULL, NULL};
  cav_verdict verdict[2];
  const cav_verdict *told[2] = {NULL, NULL};
  char name[2][128], page[300];
  cav_status status = CAV_OK;
  for (int i = 0; i < 2 && !status; i++) {
    const char *folder = line->operands[i];
    int fit = i == 0 && is_fit(folder);
    name_of(folder, name[i]);
    if (!fit) status = cav_command_expect("view", "DIR", folder, &error);
    if (!status)
      result[i] =
          fit ? read_fit(folder, line->operands[1], line->model, &error) : cav_result_read(folder, line->model, &error);
    if (!status && !result[i]) status = error.status;
    if (status || fit) continue;
    status = certify(result[i], &verdict[i], &error);
    told[i] = &verdict[i];
  }
  snprintf(page, sizeof page, "%s-beside-%s.view.html", name[0], name[1]);
  if (!status)
    status = cav_result_compare(page, (const char *const[]){name[0], name[1]}, (const cav_result *const *)result, told,
                                &error);
  for (int i = 0; i < 2; i++) cav_result_free(result[i]);
  if (status) return cav_command_fail(&error);
  tell_page(line, page);
  return 0;
}

int cav_command_view(const cav_command_line *line) {
  cav_error error = {0};
  struct stat info;
  if (line->noperand > 2) {
    fprintf(stderr, "cavort view: expected one folder, or two to compare, got %d\n", line->noperand);
    return CAV_EXIT_BAD_INPUT;
  }
  if (line->noperand == 2) return compare(line);
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
  char *page = cav_result_path(line->operand, "view.html");
  tell_page(line, page ? page : line->operand);
  free(page);
  return 0;
}
