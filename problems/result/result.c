/// What the tool adds to a result folder: the page, and a folder that can be read before its solve is done. All other files
/// are the library's (cavort/result.h).
#include "result.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "constraint_table.h"
#include "file.h"
#include "page.h"
#include "periodicity.h"
#include "schedule.h"

static cav_status no_memory(cav_error *error) {
  return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the result");
}

cav_status cav_result_write_unfinished(const char *folder, const cav_problem *problem, const cav_trajectory *trajectory,
                                       int first, cav_error *error) {
  char *path = cav_result_path(folder, "trajectory.csv");
  char *rows = cav_result_path(folder, "rows.csv");
  cav_options contact = problem->model->options;
  contact.timestep = trajectory->timestep;
  contact.order = problem->order;
  cav_stage_law(problem, 1, contact.timestep, &contact);
  cav_status status = path && rows ? CAV_OK : no_memory(error);
  if (!status) status = cav_result_write_motion(path, problem, trajectory, error);
  if (!status && first) status = cav_rows_write(rows, trajectory->timestep, 0, NULL, error);
  if (!status && first) status = cav_result_write_problem(folder, problem, &contact, error);
  free(path);
  free(rows);
  return status;
}

// a motion as its page shows it: two strides of a cycle
typedef struct drawn {
  cav_trajectory *strides; ///< NULL: the motion itself
  cav_forces *forces;
  int periods;
} drawn;

static void free_shown(drawn *shown) {
  cav_forces_free(shown->forces);
  cav_trajectory_free(shown->strides);
}

static cav_status make_shown(drawn *shown, const cav_problem *problem, const cav_trajectory *trajectory,
                             const cav_options *contact, cav_error *error) {
  shown->periods = !problem->cycle.on ? 1 : problem->cycle.mirror == CAV_MIRROR_NONE ? 2 : 4;
  if (!problem->cycle.on) {
    shown->forces = cav_forces_new(problem->model, trajectory, contact, problem->close_at_rest, error);
    return shown->forces ? CAV_OK : error->status;
  }
  cav_periodicity *periodicity = cav_periodicity_new(problem, error);
  if (!periodicity) return error->status;
  shown->strides = cav_periodicity_unroll(periodicity, trajectory, shown->periods);
  cav_periodicity_free(periodicity);
  if (!shown->strides) return no_memory(error);
  shown->forces = cav_forces_new(problem->model, shown->strides, contact, 0, error);
  return shown->forces ? CAV_OK : error->status;
}

cav_status cav_result_write_page(const char *folder, const cav_problem *problem, const cav_trajectory *trajectory,
                                 const cav_options *contact, const cav_verdict *verdict, cav_error *error) {
  drawn shown = {0};
  char *page = cav_result_path(folder, "view.html");
  cav_status status = page ? cav_result_write_forces(folder, problem, trajectory, contact, error) : no_memory(error);
  if (!status) status = make_shown(&shown, problem, trajectory, contact, error);
  if (!status) {
    const cav_trajectory *seen = shown.strides ? shown.strides : trajectory;
    cav_page_motion motion = {problem->name, problem, seen, shown.forces, shown.periods, verdict, NULL};
    // a motion that cannot be measured has its page all the same
    cav_quality quality;
    cav_error unmeasured = {0};
    if (seen->nknot >= 4 && !cav_quality_measure(problem->model, seen, contact, &quality, &unmeasured))
      motion.quality = &quality;
    status = cav_page_write(page, 1, &motion, error);
  }
  free_shown(&shown);
  free(page);
  return status;
}

// a fit has no forces
static void take_forces_away(cav_forces *forces, const cav_model *model) {
  size_t n = (size_t)forces->nknot;
  memset(forces->count, 0, n * sizeof *forces->count);
  forces->nforce = 0;
  for (size_t i = 0; i < n * (size_t)model->nu; i++) forces->control[i] = NAN;
  for (size_t i = 0; i < n; i++) forces->unactuated[i] = NAN;
}

cav_status cav_result_compare(const char *page, const char *const label[2], const cav_result *const result[2],
                              const cav_verdict *const verdict[2], cav_error *error) {
  drawn shown[2] = {0};
  cav_page_motion motion[2];
  cav_quality quality[2];
  cav_status status = CAV_OK;
  for (int i = 0; i < 2 && !status; i++) {
    const cav_problem *problem = result[i]->problem;
    status = make_shown(&shown[i], problem, result[i]->trajectory, &problem->contact, error);
    if (status) break;
    if (!verdict[i]) take_forces_away(shown[i].forces, problem->model);
    motion[i] = (cav_page_motion){label[i],
                                  problem,
                                  shown[i].strides ? shown[i].strides : result[i]->trajectory,
                                  shown[i].forces,
                                  shown[i].periods,
                                  verdict[i],
                                  NULL};
    if (motion[i].trajectory->nknot < 4) continue;
    status = cav_quality_measure(problem->model, motion[i].trajectory, &problem->contact, &quality[i], error);
    motion[i].quality = &quality[i];
  }
  if (!status) status = cav_page_write(page, 2, motion, error);
  for (int i = 0; i < 2; i++) free_shown(&shown[i]);
  return status;
}
