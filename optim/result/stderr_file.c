/// stderr.csv of a result folder.
#include <stdio.h>
#include <stdlib.h>

#include "csv.h"
#include "file.h"
#include "result_file.h"

// the columns of all dofs, by their joints
static void write_names(FILE *out, const cav_model *model, const char *prefix) {
  char name[300];
  for (int d = 0; d < model->nv; d++) {
    const cav_joint *joint = &model->joint[model->dof[d].joint];
    int n = *joint->name ? snprintf(name, sizeof name, "%s_%.256s", prefix, joint->name)
                         : snprintf(name, sizeof name, "%s_#%d", prefix, model->dof[d].joint);
    if (joint->type == CAV_JOINT_FREE || joint->type == CAV_JOINT_BALL)
      snprintf(name + n, sizeof name - (size_t)n, "_%d", d - joint->dof);
    fputc(',', out);
    cav_table_write_text(out, name);
  }
}

static void write_head(FILE *out, const cav_model *model) {
  char name[300];
  fputs("time", out);
  write_names(out, model, "q");
  write_names(out, model, "qvel");
  write_names(out, model, "u");
  for (int a = 0; a < model->nu; a++) {
    if (*model->actuator[a].name)
      snprintf(name, sizeof name, "force_%.256s", model->actuator[a].name);
    else
      snprintf(name, sizeof name, "force_#%d", a);
    fputc(',', out);
    cav_table_write_text(out, name);
  }
  fputc('\n', out);
}

static void write_row(FILE *out, int n, const double *value) {
  for (int i = 0; i < n; i++) {
    fputc(',', out);
    cav_table_write_number(out, value[i]);
  }
}

cav_status cav_result_write_errors(const char *folder, const cav_model *model, const cav_trajectory *trajectory,
                                   const cav_standard_errors *errors, cav_error *error) {
  char *path = cav_result_path(folder, "stderr.csv");
  cav_file file;
  cav_status status = path ? cav_result_folder(folder, error)
                           : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the standard errors");
  if (!status) status = cav_file_begin(&file, path, error);
  if (!status) {
    size_t nv = (size_t)errors->nv, nu = (size_t)errors->nu;
    write_head(file.stream, model);
    for (size_t t = 0; t < (size_t)errors->nknot; t++) {
      cav_table_write_number(file.stream, (double)t * trajectory->timestep);
      write_row(file.stream, errors->nv, errors->q + t * nv);
      write_row(file.stream, errors->nv, errors->v + t * nv);
      write_row(file.stream, errors->nv, errors->u + t * nv);
      write_row(file.stream, errors->nu, errors->force + t * nu);
      fputc('\n', file.stream);
    }
    status = cav_file_end(&file, error);
  }
  free(path);
  return status;
}
