/// The folder of a solved motion: what is written into it and read back. Its files are listed in README.md.
#ifndef CAVORT_RESULT_H
#define CAVORT_RESULT_H

#include "cavort/solve.h"
#include "forces.h"
#include "provenance.h"

/// A result folder as read: enough to certify and to show the motion again.
typedef struct cav_result {
  cav_problem *problem; ///< with the contact law of the motion
  cav_trajectory *trajectory;
  double *gain_q, *gain_v; ///< [(nknot-1)*nv*nv]; NULL: there is no gains.csv
  int nrow;
  cav_binding *row;     ///< [nrow] constraint rows of rows.csv, with their multipliers
  double solve_seconds; ///< as the solver left it in verdict.json; NaN: not recorded
  int iterations;
} cav_result;

/// "folder/name" in fresh memory; NULL if there is none.
char *cav_result_path(const char *folder, const char *name);

/// Makes a folder and those above it that are missing.
cav_status cav_result_folder(const char *folder, cav_error *error);

/// Writes trajectory.csv, gains.csv, log.csv, stages.csv, rows.csv and problem.xml, each atomically. The model's path
/// is written relative to the folder where the two share a folder other than the root, absolute otherwise.
cav_status cav_result_write(const char *folder, const cav_problem *problem, const cav_solution *solution,
                            cav_error *error);

/// Writes what can be read as a result before there is one: trajectory.csv, and if it is the first time problem.xml
/// with the law at the end of the schedule, and rows.csv without rows.
cav_status cav_result_write_unfinished(const char *folder, const cav_problem *problem, const cav_trajectory *trajectory,
                                       int first, cav_error *error);

/// Writes, with the report of its terms (may be NULL), terms.csv; and, after all other files of a motion, verdict.json.
/// provenance may be NULL.
cav_status cav_result_write_verdict(const char *folder, const cav_problem *problem, const cav_verdict *verdict,
                                    const cav_term_report *report, const cav_provenance *provenance, cav_error *error);

/// Writes forces.csv and view.html from the motion; verdict may be NULL.
cav_status cav_result_write_page(const char *folder, const cav_problem *problem, const cav_trajectory *trajectory,
                                 const cav_options *contact, const cav_verdict *verdict, cav_error *error);

/// Writes one page of two motions, their labels and verdicts beside each other.
cav_status cav_result_compare(const char *page, const char *const label[2], const cav_result *const result[2],
                              const cav_verdict verdict[2], cav_error *error);

/// Reads a folder; model_path replaces the model that problem.xml names, NULL: as it says. NULL on failure with the
/// reason in error. Freed with cav_result_free.
cav_result *cav_result_read(const char *folder, const char *model_path, cav_error *error);
void cav_result_free(cav_result *result);

#endif
