/// verdict.json and terms.csv of a result folder. Private to optim/ and the tool.
#ifndef CAVORT_VERDICT_FILE_H
#define CAVORT_VERDICT_FILE_H

#include <stdio.h>

#include "cavort/solve.h"

/// Writes the verdict as one JSON object with a line end; numbers that are not known are null. report, starts and provenance,
/// a JSON value as text, may be NULL: left out.
void cav_certificate_json(FILE *out, const cav_problem *problem, const cav_verdict *verdict,
                          const cav_term_report *report, const cav_starts_report *starts, const char *provenance);

/// terms.csv: one line a term.
void cav_certificate_terms(FILE *out, const cav_problem *problem, const cav_term_report *report);

/// Writes text as a JSON string.
void cav_certificate_json_text(FILE *out, const char *text);

#endif
