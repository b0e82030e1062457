#include <cavort/cavort.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

// terms of one's own: an arm reaches past a lamp that its hand has to stay away from (distance of two bodies, hard), once
// as it likes and once at a cost of what its motors give and take (mechanical power). Both have Jacobians, checked first

static const char arm[] =
    "<mujoco model='arm'><worldbody><geom type='plane' size='3 3 1'/>"
    "<body name='lamp' pos='.45 0 .3'><geom size='.05' contype='0' conaffinity='0'/></body>"
    "<body pos='0 0 .5'><joint name='shoulder' axis='0 1 0' damping='.1'/>"
    "<geom type='capsule' size='.03' fromto='0 0 0 .3 0 0' mass='1'/>"
    "<body pos='.3 0 0'><joint name='elbow' axis='0 1 0' damping='.1'/>"
    "<geom type='capsule' size='.025' fromto='0 0 0 .25 0 0' mass='.6'/>"
    "<body name='hand' pos='.25 0 0'><geom type='sphere' size='.03' mass='.3'/></body></body></body></worldbody>"
    "<actuator><motor joint='shoulder' gear='25' ctrllimited='true' ctrlrange='-1 1'/>"
    "<motor joint='elbow' gear='12' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";

// mechanical power of all forces, W: of the force on every dof at its mean velocity of the step
static int power(void *context, const cav_knot_view *at, double *value) {
  (void)context;
  for (int d = 0; d < at->model->nv; d++) value[d] = at->u[d] * (at->v[d] + at->v_next[d]) / 2;
  return 0;
}

static int power_jacobian(void *context, const cav_knot_view *at, const cav_view_jacobian *by) {
  (void)context;
  for (int d = 0, nv = at->model->nv; d < nv; d++) {
    by->du[d * nv + d] = (at->v[d] + at->v_next[d]) / 2;
    by->dv[d * nv + d] = by->dv_next[d * nv + d] = at->u[d] / 2;
  }
  return 0;
}

// distance of the centres of two bodies, m: context is a sensor of the place of each
static int distance(void *context, const cav_knot_view *at, double *value) {
  const cav_sensor *place = context;
  double a[3], b[3];
  cav_sensor_read(at->model, at->state, &place[0], a);
  cav_sensor_read(at->model, at->state, &place[1], b);
  value[0] = sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
  return value[0] > 0 ? 0 : 1; // no direction to part in
}

static int distance_jacobian(void *context, const cav_knot_view *at, const cav_view_jacobian *by) {
  const cav_sensor *place = context;
  int nv = at->model->nv;
  double a[3], b[3], length, *d = malloc(6 * (size_t)nv * sizeof *d);
  int code = !d || distance(context, at, &length) || cav_sensor_derivatives(at->model, at->state, &place[0], d, NULL) ||
             cav_sensor_derivatives(at->model, at->state, &place[1], d + 3 * nv, NULL);
  if (!code) {
    cav_sensor_read(at->model, at->state, &place[0], a);
    cav_sensor_read(at->model, at->state, &place[1], b);
    for (int i = 0; i < 3 * nv; i++) by->dq[i % nv] += (a[i / nv] - b[i / nv]) / length * (d[i] - d[3 * nv + i]);
  }
  free(d);
  return code;
}

static int failed(const cav_error *error) { return fprintf(stderr, "%s\n", error->text), EXIT_FAILURE; }

int main(void) {
  cav_error error = {0};
  cav_model *model = cav_model_parse(arm, NULL, NULL, &error);
  cav_state *state = model ? cav_state_new(model) : NULL;
  if (!state) return failed(&error);

  cav_sensor place[2];
  static const char *const names[] = {"hand", "lamp"};
  for (int i = 0; i < 2; i++) {
    int body = cav_object_find(model, CAV_OBJECT_BODY, names[i]);
    if (cav_sensor_of(model, CAV_SENSOR_FRAMEPOS, CAV_OBJECT_BODY, body, &place[i], &error)) return failed(&error);
  }
  cav_user_quantity quantity[] = {
      {"power", "W", model->nv, CAV_READS_ACCELERATION, power, power_jacobian, NULL, 0},
      {"distance", "m", 1, CAV_READS_POSITION, distance, distance_jacobian, place, 0},
  };
  double start[] = {0.9, 0.2}, goal[] = {-0.4, -0.3}, rest[] = {0, 0}, v[] = {1, -2}, v_next[] = {1.5, -1}, off;
  for (int i = 0; i < 2; i++) {
    if (cav_user_quantity_check(&quantity[i], state, start, v, v_next, &off, NULL, &error)) return failed(&error);
    printf("%s: its Jacobian is within %.1e of differences\n", quantity[i].name, off);
    if (!(off < 1e-6)) return EXIT_FAILURE;
  }

  cav_term term[16];
  int n = cav_problem_default_terms(term, 13);
  term[n] = cav_term_cost(CAV_QUANTITY_CONFIGURATION, 200);
  term[n].name = "there", term[n].from = term[n].to = 0.8;
  term[n + 1] = cav_term_range(CAV_QUANTITY_USER, 0.2, INFINITY);
  term[n + 1].name = "past the lamp", term[n + 1].user = &quantity[1];
  term[n + 2] = cav_term_cost(CAV_QUANTITY_USER, 0.5);
  term[n + 2].name = "work", term[n + 2].user = &quantity[0];
  term[n + 2].norm = CAV_NORM_ABSOLUTE, term[n + 2].scale = 0.5;
  cav_problem problem = cav_problem_default(model);
  problem.name = "past the lamp", problem.duration = 0.8, problem.timestep = 0.02;
  problem.q_start = start, problem.v_start = rest, problem.q_goal = goal;
  problem.term = term;

  int certified = 1;
  double work[2] = {0};
  for (int sparing = 0; sparing < 2; sparing++) {
    problem.nterm = n + 2 + sparing;
    cav_solution *solution = NULL;
    cav_verdict verdict = {0};
    cav_status status = cav_solve(&problem, NULL, NULL, &solution, &error);
    if (status) return fprintf(stderr, "%s: %s\n", cav_status_name(status), error.text), EXIT_FAILURE;
    const cav_trajectory *at = solution->trajectory;
    if (cav_verify(&problem, at, &solution->contact, solution->gain_q, solution->gain_v, &verdict, &error))
      return failed(&error);
    double nearest = INFINITY;
    for (int t = 0; t + 1 < at->nknot; t++) {
      double values[2];
      if (cav_inverse(model, state, at->q + 2 * t, at->v + 2 * t, at->v + 2 * t + 2, state->u)) return EXIT_FAILURE;
      cav_knot_view view = {
          .model = model, .state = state, .v = at->v + 2 * t, .v_next = at->v + 2 * t + 2, .u = at->u + 2 * t};
      if (distance(place, &view, values)) return EXIT_FAILURE;
      nearest = fmin(nearest, values[0]);
      if (power(NULL, &view, values)) return EXIT_FAILURE;
      work[sparing] += at->timestep * (fabs(values[0]) + fabs(values[1]));
    }
    printf("%s: %s, %s, the hand %.3f m from the lamp, %.2f J given and taken\n", sparing ? "sparing" : "as it likes",
           verdict.certified ? "certified" : verdict.reason, verdict.achieved ? "achieved" : verdict.missed, nearest,
           work[sparing]);
    certified = certified && verdict.certified && verdict.achieved && nearest > 0.2 - 1e-6;
    cav_solution_free(solution);
  }
  cav_state_free(state);
  cav_model_free(model);
  return certified && work[1] < work[0] ? EXIT_SUCCESS : EXIT_FAILURE;
}
