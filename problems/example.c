#include <cavort/cavort.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// a model lowered until something barely touches: what holds it still for one step, little of it contacts and the rest u, that of
// the root too, and the step that they lead to
int main(int argc, char **argv) {
  cav_error error = {0};
  cav_model *model = cav_model_load(argc > 1 ? argv[1] : "problems/models/humanoid.xml", &error);
  if (!model) return fprintf(stderr, "%s\n", error.text), EXIT_FAILURE;
  cav_state *state = cav_state_new(model);
  double *q = calloc((size_t)(model->nq + 3 * model->nv), sizeof *q);
  if (!state || !q) return EXIT_FAILURE;
  double *v = q + model->nq, *u = v + model->nv, *v_next = u + model->nv;
  memcpy(q, model->q0, (size_t)model->nq * sizeof *q);

  cav_status status = cav_position(model, state, q);
  int floats = model->njoint > 0 && model->joint[0].type == CAV_JOINT_FREE;
  for (int i = 0; floats && !status && state->ncontact == 0 && i < 5000; i++) {
    q[2] -= 0.0005;
    status = cav_position(model, state, q);
  }
  if (!status) status = cav_inverse(model, state, q, v, v, u);
  for (int i = 0; !status && i < state->ncontact; i++)
    printf("contact %d: %.1f N along its normal\n", i, state->contact[i].impulse[0] / model->timestep);
  if (!status) status = cav_forward(model, state, q, v, u, v_next);
  double fastest = 0;
  for (int i = 0; i < model->nv; i++)
    fastest = v_next[i] > fastest ? v_next[i] : -v_next[i] > fastest ? -v_next[i] : fastest;
  printf("%s: %d contacts, fastest dof after %g s: %.1e\n", cav_status_name(status), state->ncontact, model->timestep,
         fastest);
  cav_state_free(state);
  cav_model_free(model);
  free(q);
  return status;
}
