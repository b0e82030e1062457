#include <cavort/cavort.h>
#include <stdio.h>
#include <stdlib.h>

// the forces that hold a humanoid still for one step, and the step that they lead to
int main(int argc, char **argv) {
  cav_error error = {0};
  cav_model *model = cav_model_load(argc > 1 ? argv[1] : "problems/models/humanoid.xml", &error);
  if (!model) return fprintf(stderr, "%s\n", error.text), EXIT_FAILURE;
  cav_state *state = cav_state_new(model);
  double *v = calloc(3 * (size_t)model->nv, sizeof *v), *u = v + model->nv, *v_next = u + model->nv;
  if (!state || !v) return EXIT_FAILURE;

  cav_status status = cav_inverse(model, state, model->q0, v, v, u);
  if (!status) status = cav_forward(model, state, model->q0, v, u, v_next);
  printf("%s: %d contacts, %.1f N on the root's height, velocity after %g s: %.1e m/s\n", cav_status_name(status),
         state->ncontact, u[2], model->timestep, v_next[2]);
  cav_state_free(state);
  cav_model_free(model);
  free(v);
  return status;
}
