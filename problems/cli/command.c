/// How commands tell an error, and the exit status that goes with it; what several of them warn of.
#include "command.h"

#include <math.h>

void cav_command_warn_efforts(const cav_model *model, FILE *out) {
  int n = 0, first = -1;
  for (int i = 0; i < model->nu; i++) {
    double range[2];
    cav_actuator_effort_range(model, i, range);
    // a muscle's curves, and a servo's controls, are limits too
    const cav_actuator *a = &model->actuator[i];
    if ((isfinite(range[0]) && isfinite(range[1])) || a->gain == CAV_GAIN_MUSCLE || a->ctrllimited) continue;
    if (!n++) first = i;
  }
  if (!n) return;
  fprintf(out, "cavort: WARNING: %s (",
          n == model->nu ? "no actuator has a limit of effort" : "some actuators have no limit of effort");
  fprintf(out,
          "%d of %d, the first is '%.60s'): a plan may take any force of %s; give a forcerange, the joint an "
          "actuatorfrcrange, or a motor a ctrlrange\n",
          n, model->nu, model->actuator[first].name, n == 1 ? "it" : "them");
}

#include "provenance.h"

void cav_command_version(void) { cav_provenance_print_build(stdout); }

int cav_command_fail(const cav_error *error) {
  fprintf(stderr, "cavort: %s\n", error->text[0] ? error->text : cav_status_name(error->status));
  switch (error->status) {
    case CAV_BAD_INPUT:
    case CAV_NOT_FINITE:
    case CAV_NOT_SUPPORTED:
      return CAV_EXIT_BAD_INPUT;
    case CAV_INTERRUPTED:
      return CAV_EXIT_INTERRUPTED;
    case CAV_NOT_CONVERGED:
      return CAV_EXIT_NOT_CERTIFIED;
    default:
      return CAV_EXIT_INTERNAL;
  }
}
