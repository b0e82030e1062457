/// What the normal equations of a problem are made of, for who wants to know before a solve: evaluates the guess once
/// and factors once.
#include "continuation.h"
#include "idle.h"

/// The structure at the trajectory.
static cav_status read_structure(cav_transcription *tr, cav_normal *normal, cav_trajectory *at, cav_equations *e) {
  double start = cav_clock();
  cav_status status = cav_transcription_linearise(tr, at);
  if (status != CAV_OK) return status;
  e->rows_time = cav_clock() - start;
  start = cav_clock();
  cav_normal_gather(normal, tr);
  e->sums_time = cav_clock() - start;
  e->unknowns = normal->size;
  e->blocks = normal->blocks;
  for (int t = 0; t < tr->nknot; t++) e->rows += tr->knot[t].nrow, e->constraints += tr->knot[t].layout.count;
  e->groups = cav_normal_groups(normal, &e->largest);
  e->width = 3 * e->largest;
  e->border = (normal->cyclic ? 2 * e->largest : 0) + (normal->free_step && e->groups == 1);
  e->arrow = normal->free_step && e->groups > 1;
  double core = normal->core, border = normal->border;
  e->bytes = 2 * sizeof(double) * (core * normal->band + core * border + border * border);
  start = cav_clock();
  status = cav_normal_factor(normal, 1);
  e->factor_time = status == CAV_OK ? cav_clock() - start : -1;
  return status == CAV_NOT_CONVERGED ? CAV_OK : status;
}

/// Of a problem of which all is planned.
static cav_status equations_of(const cav_problem *problem, cav_equations *equations, cav_error *error) {
  cav_transcription *tr = cav_transcription_new(problem, 1, error);
  if (!tr) return error ? error->status : CAV_NO_MEMORY;
  cav_normal *normal = cav_normal_new(tr);
  cav_trajectory *at = cav_trajectory_new(problem->model, tr->nknot, problem->timestep);
  cav_status status = normal && at ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK) {
    status = cav_guess_fill(problem, problem->q_goal, at);
    cav_stage_set(problem, 0, tr);
  }
  if (status == CAV_OK) { status = read_structure(tr, normal, at, equations); }
  if (status != CAV_OK && error)
    *error = tr->failure.status ? tr->failure
                                : (cav_error){status, 0, "the normal equations cannot be evaluated at the guess"};
  cav_trajectory_free(at), cav_normal_free(normal), cav_transcription_free(tr);
  return status;
}

cav_status cav_problem_equations(const cav_problem *problem, cav_equations *equations, cav_error *error) {
  cav_idle idle;
  *equations = (cav_equations){0};
  cav_status status = cav_idle_find(problem, &idle);
  if (status != CAV_OK && error) *error = (cav_error){status, 0, "not enough memory for this problem"};
  equations->left_out = idle.ntree;
  equations->left_out_dofs = idle.ndof;
  if (status == CAV_OK) status = equations_of(idle.ntree ? &idle.problem : problem, equations, error);
  cav_idle_clear(&idle);
  return status;
}
