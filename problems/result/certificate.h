/// A verdict as people and programs read it.
#ifndef CAVORT_CERTIFICATE_H
#define CAVORT_CERTIFICATE_H

#include <stdio.h>

#include "cavort/solve.h"
#include "verdict_file.h"

enum { CAV_CERTIFICATE_LINES = 32 };

/// One line: what, its value and limit as they are to be read; passed: 1 held, 0 missed, -1 only told.
typedef struct cav_certificate_line {
  const char *label;
  char value[64], limit[64];
  int passed;
} cav_certificate_line;

/// The lines of a verdict; returns their number.
int cav_certificate_lines(const cav_verdict *verdict, cav_certificate_line line[CAV_CERTIFICATE_LINES]);

/// Prints the table, what was asked and what the motion does (report [problem->nterm], NULL: left out), and the verdict
/// in words.
void cav_certificate_print(FILE *out, const cav_problem *problem, const cav_verdict *verdict,
                           const cav_term_report *report);

/// What of the targets is missed by most: the verdict's words, of a vector with what its worst component alone is off by.
/// report [problem->nterm], NULL: not known.
void cav_certificate_missed(const cav_problem *problem, const cav_verdict *verdict, const cav_term_report *report,
                            char *text, size_t size);

#endif
