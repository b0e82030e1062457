#include <cavort/cavort.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// a body that is pushed and stays on its feet: simulated at 1 ms, planned anew a hundred times a second from where it has come
// to, each plan in force 10 ms after the state that it is made from. Usage: example_mpc [PROBLEM [N_S]], N s to the left
int main(int argc, char **argv) {
  const double h = 0.001, push = argc > 2 ? atof(argv[2]) : 20;
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(argc > 1 ? argv[1] : "problems/mpc/stand.xml", NULL, &error);
  if (!problem) return fprintf(stderr, "%s\n", error.text), EXIT_FAILURE;
  const cav_model *m = problem->model;
  cav_mpc_options options = cav_mpc_options_default();
  options.delay = 0.01;
  cav_mpc *mpc = cav_mpc_new(problem, &options, NULL, &error);
  if (!mpc) return fprintf(stderr, "%s\n", error.text), EXIT_FAILURE;

  cav_state *state = cav_state_new(m);
  double *q = calloc((size_t)(m->nq + 3 * m->nv), sizeof *q);
  if (!state || !q) return EXIT_FAILURE;
  double *v = q + m->nq, *u = v + m->nv, *next = u + m->nv;
  memcpy(q, problem->q_start, (size_t)m->nq * sizeof *q);
  memcpy(v, problem->v_start, (size_t)m->nv * sizeof *v);
  state->options.timestep = h;

  cav_status status = CAV_OK;
  cav_progress at = {0};
  for (int i = 0; i < 2500 && !status; i++) {
    if (i % 10 == 0) status = cav_mpc_plan(mpc, i * h, q, v, &at);
    if (i % 250 == 0)
      printf("%.2f s: root at y %6.3f m, z %.3f m, cost of the plan %.3g\n", i * h, q[1], q[2], at.cost);
    if (!status) status = cav_mpc_command(mpc, i * h, q, v, NULL, u);
    // a hundred milliseconds of force on the root, along y
    if (i >= 500 && i < 600) u[1] += push / 0.1;
    if (!status) status = cav_forward(m, state, q, v, u, next);
    memcpy(v, next, (size_t)m->nv * sizeof *v);
    cav_integrate(m, q, v, h, q);
  }
  printf("%s; it %s\n", cav_status_name(status), q[2] > 0.8 * problem->q_start[2] ? "stands" : "has fallen");
  cav_mpc_free(mpc);
  cav_state_free(state);
  cav_problem_free(problem);
  free(q);
  return status;
}
