/// Samples of a motion as a table: the columns of trajectory.csv, then controls and forces as in controls.csv.
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "exchange.h"
#include "file.h"

// one column a component, by the joint's name or number
static void write_joints(FILE *out, const cav_model *model, const char *what, int positions) {
  static const int nq[] = {[CAV_JOINT_FREE] = 7, [CAV_JOINT_BALL] = 4, [CAV_JOINT_SLIDE] = 1, [CAV_JOINT_HINGE] = 1};
  static const int nv[] = {[CAV_JOINT_FREE] = 6, [CAV_JOINT_BALL] = 3, [CAV_JOINT_SLIDE] = 1, [CAV_JOINT_HINGE] = 1};
  for (int j = 0; j < model->njoint; j++) {
    const cav_joint *joint = &model->joint[j];
    int n = positions ? nq[joint->type] : nv[joint->type];
    for (int k = 0; k < n; k++) {
      char name[300], number[24];
      snprintf(number, sizeof number, "#%d", j);
      int length = snprintf(name, sizeof name, "%s_%.240s", what, *joint->name ? joint->name : number);
      if (n > 1) snprintf(name + length, sizeof name - (size_t)length, "_%d", k);
      fputc(',', out);
      cav_table_write_text(out, name);
    }
  }
}

static void write_actuators(FILE *out, const cav_model *model, int force) {
  for (int a = 0; a < model->nu; a++) {
    char name[300], number[24];
    const char *what = force ? "force" : model->actuator[a].activation == CAV_ACTIVATION_NONE ? "ctrl" : "act";
    snprintf(number, sizeof number, "#%d", a);
    snprintf(name, sizeof name, "%s_%.240s", what, *model->actuator[a].name ? model->actuator[a].name : number);
    fputc(',', out);
    cav_table_write_text(out, name);
  }
}

static void write_values(FILE *out, const double *value, int n) {
  for (int i = 0; i < n; i++) fputc(',', out), cav_table_write_number(out, value[i]);
}

cav_status cav_exchange_write_csv(const cav_recording *r, const char *path, char note[CAV_EXCHANGE_NOTE],
                                  cav_error *error) {
  const cav_model *m = r->model;
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  FILE *out = file.stream;
  fputs("time", out);
  write_joints(out, m, "qpos", 1);
  write_joints(out, m, "qvel", 0);
  write_joints(out, m, "u", 0);
  write_actuators(out, m, 0);
  write_actuators(out, m, 1);
  fputc('\n', out);
  for (int i = 0; i < r->n; i++) {
    cav_table_write_number(out, i * r->timestep);
    write_values(out, r->motion->q + (size_t)i * (size_t)m->nq, m->nq);
    write_values(out, r->motion->v + (size_t)i * (size_t)m->nv, m->nv);
    write_values(out, r->motion->u + (size_t)i * (size_t)m->nv, m->nv);
    write_values(out, r->forces->input + r->knot[i] * m->nu, m->nu);
    for (int a = 0; a < m->nu; a++) {
      double force = m->actuator[a].unit * r->forces->control[r->knot[i] * m->nu + a];
      write_values(out, &force, 1);
    }
    fputc('\n', out);
  }
  *note = 0;
  return cav_file_end(&file, error);
}
