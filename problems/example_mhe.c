#include <cavort/cavort.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// where a body is, from measurements as they come in: a record is handed on frame by frame, as a robot's sensors would, and after
// each knot the estimate, its standard error and what pushes the body are told. Usage: example_mhe [PROBLEM]
int main(int argc, char **argv) {
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(argc > 1 ? argv[1] : "problems/mhe/stand.xml", NULL, &error);
  if (!problem) return fprintf(stderr, "%s\n", error.text), EXIT_FAILURE;
  cav_mhe_options options = cav_mhe_options_default();
  options.knots = 10;
  cav_mhe *mhe = cav_mhe_new(problem, &options, &error);
  int *frame = calloc((size_t)problem->nterm + 1, sizeof *frame);
  if (!mhe || !frame) return fprintf(stderr, "%s\n", error.text), EXIT_FAILURE;

  const int samples = (int)(problem->duration / problem->timestep + 1.5), nv = problem->model->nv;
  cav_status status = CAV_OK;
  for (int k = 0; k < samples && !status; k++) {
    // what has been measured by now
    for (int i = 0; i < problem->nterm; i++) {
      const cav_track *track = problem->term[i].track;
      for (int *f = &frame[i]; track && *f < track->nframe && !status; ++*f) {
        if (track->time[*f] - track->offset > k * problem->timestep + 1e-9) break;
        status = cav_mhe_measure(mhe, i, track->time[*f], track->value + *f * track->ncolumn);
      }
    }
    if (!status) status = cav_mhe_update(mhe, NULL);
    if (status || k == 0 || k % 10) continue;
    // forces are of the step before the newest knot: one knot back
    cav_knot_view view;
    if ((status = cav_mhe_view(mhe, 1, &view))) break;
    const double push = view.u[1];
    int touches = 0;
    for (int c = 0; c < view.state->ncontact; c++) touches += view.state->contact[c].impulse[0] > 20 * view.timestep;
    if ((status = cav_mhe_view(mhe, 0, &view))) break;
    const double *covariance = cav_mhe_covariance(mhe);
    printf("%.2f s: root at y %6.3f m, variance %.1e m2, %6.3f m/s; pushed by %4.0f N, touches at %d places\n",
           view.time, view.q[1], covariance[2 * nv + 1], view.v[1], push, touches);
  }
  printf("%s\n", status ? cav_status_name(status) : "followed to the end");
  cav_mhe_free(mhe);
  cav_problem_free(problem);
  free(frame);
  return status;
}
