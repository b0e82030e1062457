/// Whether a problem can have a solution at all: necessary conditions, checked in milliseconds and apart from a solve.
///
/// Each condition is a proof: where one is broken, no motion is certified and achieves what is asked, whatever the
/// solver. Bounds are on the safe side throughout, so that a possible problem is never refused; that none is broken
/// says nothing. What a proof is about: values that terms require at knots (constraints, and costs with a tolerance).
/// optim/METHOD.md, 10.
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "feasibility.h"
#include "file.h"
#include "problem_file.h"

const char *cav_name_or(const char *name, const char *kind, int i, char buffer[48]) {
  if (name && *name) return name;
  snprintf(buffer, 48, "%s %d", kind, i);
  return buffer;
}

void cav_impossible(cav_examination *e, cav_condition condition, const cav_requirement *r, const char *cure,
                    const char *format, ...) {
  if (e->nfound == e->most) return;
  cav_proof *proof = &e->found[e->nfound++];
  cav_impossibility *found = &proof->said;
  *proof = (cav_proof){.kind = r ? r->kind : 0, .object = r ? r->object : -1};
  *found = (cav_impossibility){.condition = condition, .term = r ? r->term : -1, .knot = r ? r->knot : 0};
  found->joint = -1;
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(found->what, sizeof found->what, format, arguments);
  va_end(arguments);
  snprintf(found->cure, sizeof found->cure, "%s", cure);
}

void cav_impossible_fraction(cav_examination *e, double fraction) {
  if (e->nfound) e->found[e->nfound - 1].fraction = fraction;
}

/// Whether two proofs are of one thing: of one term, by several conditions or of one object of it.
static int is_same_cause(const cav_proof *a, const cav_proof *b) {
  if (a->said.term < 0 || a->said.term != b->said.term) return 0;
  return a->said.condition != b->said.condition || (a->kind == b->kind && a->object == b->object);
}

/// Of the proofs of one thing the tightest in the place of the first; the rest go.
static void keep_tightest(cav_examination *e) {
  int n = 0;
  for (int i = 0; i < e->nfound; i++) {
    int same = 0;
    while (same < n && !is_same_cause(&e->found[same], &e->found[i])) same++;
    if (same == n)
      e->found[n++] = e->found[i];
    else if (e->found[i].fraction < e->found[same].fraction)
      e->found[same] = e->found[i];
  }
  e->nfound = n;
}

static cav_status examine(cav_examination *e) {
  static cav_status (*const condition[])(cav_examination *) = {
      cav_examine_contradictions, cav_examine_directions, cav_examine_distances,  cav_examine_speeds,
      cav_examine_touches,        cav_examine_solids,     cav_examine_enclosures, cav_examine_falls,
      cav_examine_floats,         cav_examine_momentum,   cav_examine_strength,   cav_examine_holds,
      cav_examine_hinge,          cav_examine_slides,     cav_examine_takeoff,    cav_examine_energy};
  cav_status status = cav_requirements_collect(e);
  // those after the first seven reckon with forces, which roots may have from nowhere
  const cav_residual *residual = &e->problem->residual;
  size_t n = residual->force > 0 || residual->torque > 0 ? 7 : sizeof condition / sizeof *condition;
  for (size_t i = 0; i < n && !status && e->nfound < e->most; i++) status = condition[i](e);
  return status;
}

cav_status cav_problem_impossible(const cav_problem *problem, cav_impossibility *found, int most, int *n,
                                  cav_error *error) {
  cav_examination e = {.problem = problem, .model = problem->model, .most = CAV_PROOFS, .longest = 1};
  e.found = calloc(CAV_PROOFS, sizeof *e.found);
  e.nknot = (int)(problem->duration / problem->timestep + 0.5) + 1;
  if (problem->duration_most > 0) e.longest = problem->duration_most / problem->duration;
  e.start = cav_state_new(e.model);
  e.scratch = cav_state_new(e.model);
  *n = 0;
  cav_status status = e.start && e.scratch && e.found ? CAV_OK : CAV_NO_MEMORY;
  if (!status) {
    // contacts by the exact law, of all that is closer than a certificate can mistake for touching
    e.start->options.smoothing = e.start->options.smoothing_self = 0;
    e.scratch->options = e.start->options;
    status = cav_position(e.model, e.start, problem->q_start);
  }
  if (!status) status = examine(&e);
  if (!status) keep_tightest(&e);
  for (int i = 0; i < e.nfound && i < most && !status; i++) found[(*n)++] = e.found[i].said;
  free(e.found);
  cav_state_free(e.start);
  cav_state_free(e.scratch);
  free(e.requirement);
  if (status == CAV_NO_MEMORY) cav_file_fail(error, status, 0, "no memory to examine the problem");
  if (status == CAV_NOT_FINITE) cav_file_fail(error, status, 0, "a posture of the problem cannot be evaluated");
  return status;
}
