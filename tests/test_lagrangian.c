/// optim/transcription/lagrangian.c: Gauss-Newton's Hessian of the costs plus the curvature that is left out of it is
/// the Hessian of the Lagrangian: its forms along directions against centred differences of the Lagrangian's gradient,
/// on a planar leg and on a free body with a ball joint that stand on a floor, with a hard sensor and multipliers at
/// random.
#include "dof_groups.h"
#include "gauss_newton.h"
#include "lagrangian.h"
#include "scene.h"
#include "schedule.h"

static const char model_text[] =
    "<mujoco><worldbody><geom type='plane' size='9 9 1'/><body name='trunk' pos='0 0 .52'>"
    "<joint name='x' type='slide' axis='1 0 0'/><joint name='z' type='slide' axis='0 0 1'/>"
    "<joint name='pitch' axis='0 1 0'/><geom type='sphere' size='.1' mass='4'/>"
    "<body name='thigh'><joint name='hip' axis='0 1 0' range='-90 90' limited='true'/>"
    "<geom type='capsule' fromto='0 0 0 0 0 -.25' size='.03' mass='1'/><body name='shank' pos='0 0 -.25'>"
    "<joint name='knee' axis='0 1 0' damping='.1'/><geom type='capsule' fromto='0 0 0 0 0 -.22' size='.03' "
    "mass='.6'/><site name='toe' pos='0 0 -.25'/></body></body></body></worldbody><actuator>"
    "<motor joint='hip' gear='60' ctrlrange='-1 1' ctrllimited='true'/>"
    "<motor joint='knee' gear='40' ctrlrange='-1 1' ctrllimited='true'/></actuator></mujoco>";
static const char body_text[] =
    "<mujoco><worldbody><geom type='plane' size='9 9 1'/><body name='trunk' pos='0 0 .32'><freejoint/>"
    "<geom type='sphere' size='.1' mass='4'/><geom type='sphere' pos='.2 .1 0' size='.05' mass='1'/>"
    "<body name='shank'><joint name='hip' type='ball' damping='.1'/><geom type='capsule' fromto='0 0 0 .1 0 -.25' "
    "size='.03' mass='1'/><site name='toe' pos='.1 0 -.28'/></body></body></worldbody><actuator>"
    "<motor joint='hip' gear='40 0 0' ctrlrange='-1 1' ctrllimited='true'/>"
    "<motor joint='hip' gear='0 40 0' ctrlrange='-1 1' ctrllimited='true'/></actuator></mujoco>";
// two legs that meet, an arm that holds a box with a leg: columns of dofs that do not meet are found at once
static const char tree_text[] =
    "<mujoco><worldbody><geom type='plane' size='9 9 1'/><body name='trunk' pos='0 0 .52'><freejoint/>"
    "<geom type='sphere' size='.1' mass='4'/>"
    "<body name='left'><joint axis='0 1 0'/><geom type='capsule' fromto='0 .02 0 .05 .04 -.25' size='.03' mass='1'/>"
    "<body name='left shank' pos='.05 .04 -.25'><joint axis='0 1 0' damping='.1'/>"
    "<geom type='capsule' fromto='0 0 0 0 0 -.22' size='.03' mass='.6'/><site name='toe' pos='0 0 -.25'/></body></body>"
    "<body name='right'><joint axis='1 0 0'/><geom type='capsule' fromto='0 -.02 0 .05 -.04 -.25' size='.03' mass='1'/>"
    "<body name='right shank' pos='.05 -.04 -.25'><joint axis='0 1 0' damping='.1'/>"
    "<geom type='capsule' fromto='0 0 0 0 .01 -.22' size='.03' mass='.6'/></body></body>"
    "<body name='arm' pos='0 0 .1'><joint type='ball'/><geom type='capsule' fromto='0 0 0 .3 0 0' size='.03' "
    "mass='.5'/>"
    "<body name='hand' pos='.3 0 0'><joint axis='0 1 0'/><geom type='sphere' size='.04' "
    "mass='.2'/></body></body></body>"
    "<body name='box' pos='.33 0 .69'><freejoint/><geom type='sphere' size='.03' mass='.3'/></body></worldbody>"
    "<actuator/></mujoco>";
static const char problem_text[] =
    "<problem name='hop' model='model.xml'><horizon duration='.2' timestep='.02'/><start/>"
    "<cost><sensor type='framepos' body='trunk' component='z' target='.6' at='.1' weight='10'/></cost>"
    "<constraint><sensor type='framepos' site='toe' component='x' target='.1' at='end'/></constraint></problem>";

static const char tree_problem_text[] =
    "<problem name='hop' model='model.xml'><horizon duration='.2' timestep='.02' order='momentum'/><start/>"
    "<cost><force weight='1'/><slip weight='10'/>"
    "<sensor type='framepos' body='hand' reftype='body' refname='box' target='.1 0 0' at='.1' weight='10'/></cost>"
    "<constraint><sensor type='framepos' site='toe' component='x' target='.1' at='end'/></constraint></problem>";

static cav_problem *load(const char *model, const char *text) {
  char folder[] = "/tmp/cavort-lagrangian-XXXXXX", path[80];
  cav_error error = {0};
  if (!mkdtemp(folder)) return NULL;
  scene_write(folder, "model.xml", model);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *problem = cav_problem_load(path, NULL, &error);
  if (!problem) fprintf(stderr, "    %s\n", error.text);
  unlink(path);
  snprintf(path, sizeof path, "%s/model.xml", folder);
  unlink(path);
  rmdir(folder);
  return problem;
}

static double uniform(void) { return 2 * (rand() / (double)RAND_MAX) - 1; }

// of factor times the costs and of the rows
static void gradient(cav_transcription *tr, cav_normal *normal, cav_trajectory *at, double factor, double *g) {
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  cav_normal_gather(normal, tr);
  for (int i = 0; i < cav_transcription_unknowns(tr); i++) g[i] = factor * cav_normal_gradient(normal)[i];
  for (int t = 0; t < tr->nknot; t++) {
    for (int i = 0; i < tr->knot[t].layout.count; i++) {
      const double *row = tr->knot[t].slot_row + (size_t)i * 3 * tr->nv;
      for (int c = 0; c < 3; c++) {
        int block = cav_transcription_block(tr, t, c);
        for (int d = 0; block >= 0 && d < tr->nv; d++)
          g[block * tr->nv + d] += tr->knot[t].slot[i].final_multiplier * row[c * tr->nv + d];
      }
    }
  }
}

// largest |d'H d - difference along d| over the largest difference, of directions at random; curved: with the curvature.
// Forms, not products: away from an optimum the gradient itself turns with rotations
static double mismatch(cav_transcription *tr, cav_normal *normal, cav_trajectory *at, cav_trajectory *beside,
                       double factor, int curved) {
  int n = cav_transcription_unknowns(tr);
  double *d = calloc(4 * (size_t)n, sizeof *d), *after = d + n, *before = d + 2 * n, *product = d + 3 * n;
  double distance = 3e-7, worst = 0, size = 0;
  for (int k = 0; k < 8; k++) {
    CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
    for (int t = 0; t < tr->nknot; t++)
      for (int i = 0; i < 9 * tr->nv * tr->nv; i++) tr->knot[t].hessian[i] *= factor;
    if (curved) CHECK(cav_lagrangian_curvature(tr, at, factor, NULL) == CAV_OK);
    cav_normal_gather(normal, tr);
    for (int i = 0; i < n; i++) d[i] = uniform();
    cav_normal_multiply(normal, d, product);
    for (int side = 0; side < 2; side++) {
      for (int i = 0; i < n; i++) d[i] *= side ? -1 : distance;
      cav_transcription_move(tr, at, d, beside);
      gradient(tr, normal, beside, factor, side ? before : after);
    }
    double form = 0, difference = 0;
    for (int i = 0; i < n; i++) {
      form -= d[i] / distance * product[i];
      difference -= d[i] / distance * (after[i] - before[i]) / (2 * distance);
    }
    worst = fmax(worst, fabs(form - difference));
    size = fmax(size, fabs(difference));
  }
  free(d);
  return worst / size;
}

static int contacts(const cav_transcription *tr) {
  int n = 0;
  for (int t = 0; t < tr->nknot; t++) n += tr->knot[t].ncontact;
  return n;
}

// costs do not jump where contacts come: of a body lifted off the floor along a dof, at each height at which one goes
static void check_jumps(cav_transcription *tr, cav_trajectory *at, cav_trajectory *beside, int up) {
  int n = cav_transcription_unknowns(tr), found = 0;
  double *x = calloc((size_t)n, sizeof *x), worst = 0;
  for (double low = 0; low < 0.2; low += 0.002) {
    double end[2] = {low, low + 0.002}, cost[2] = {0};
    int count[2] = {0};
    for (int k = 0; k < 42; k++) {
      double mean = 0.5 * (end[0] + end[1]);
      for (int side = 0; side < 3; side++) {
        for (int i = up; i < n; i += tr->nv) x[i] = side < 2 ? end[side] : mean;
        cav_transcription_move(tr, at, x, beside);
        CHECK(cav_transcription_values(tr, beside) == CAV_OK);
        if (side < 2) count[side] = contacts(tr), cost[side] = cav_transcription_cost(tr);
      }
      if (count[0] == count[1]) break;
      end[contacts(tr) == count[0] ? 0 : 1] = mean;
    }
    if (count[0] == count[1]) continue;
    found++;
    worst = fmax(worst, fabs(cost[0] - cost[1]));
  }
  // seen: 3e-12, and 1e-5 where rows begin with the root of the force
  printf("%d contacts gone, largest jump of the cost %.1e\n", found, worst);
  CHECK(found > 0);
  CHECK(worst < 1e-6);
  free(x);
}

/// Work of the last dof and weight on the floor, of which u and the impulses are pulled.
static int own_value(void *context, const cav_knot_view *view, double *value) {
  int d = view->model->nv - 1;
  (void)context;
  value[0] = view->u[d] * (view->v[d] + view->v_next[d]) / 40;
  for (int i = 0; i < view->state->ncontact; i++) value[1] += view->state->contact[i].impulse[0] / view->timestep / 50;
  return 0;
}

static int own_jacobian(void *context, const cav_knot_view *view, const cav_view_jacobian *jacobian) {
  int d = view->model->nv - 1;
  (void)context;
  jacobian->du[d] = (view->v[d] + view->v_next[d]) / 40;
  jacobian->dv[d] = jacobian->dv_next[d] = view->u[d] / 40;
  for (int i = 0; i < view->state->ncontact; i++)
    jacobian->dimpulse[6 * view->state->ncontact + 6 * i] = 1 / view->timestep / 50;
  return 0;
}

// groups of dofs: fewer than these where branches do not meet, and all that meet is told by itself
static void check_groups(cav_transcription *tr, const cav_trajectory *at, int fewer) {
  cav_dof_groups of;
  int most = 0, nv = tr->nv;
  double *pull = calloc((size_t)(nv + 400), sizeof *pull);
  cav_state *state = cav_state_new(tr->model);
  if (!CHECK(cav_dof_groups_make(&of, nv) && pull && state)) return;
  state->options = tr->options;
  for (int i = nv; i < nv + 400; i++) pull[i] = 1;
  for (int t = 1; t + 1 < tr->nknot; t++) {
    CHECK(tr->knot[t].nread < 400);
    CHECK(cav_inverse(tr->model, state, at->q + (size_t)t * at->nq, cav_velocity_at(tr, at, t),
                      cav_velocity_after(tr, at, t), tr->knot[t].u) == CAV_OK);
    cav_dof_groups_find(&of, tr, state, t, pull);
    most = of.ngroup > most ? of.ngroup : most;
    for (int r = 0; r < nv; r++)
      for (int c = 0; c < nv; c++)
        CHECK(!of.joined[r * nv + c] || cav_dof_groups_alone(&of, r, c) || cav_dof_groups_alone(&of, c, r));
  }
  printf("%d groups of %d dofs at most\n", most, nv);
  CHECK(fewer ? most < nv : most <= nv);
  free(pull);
  cav_state_free(state);
  cav_dof_groups_clear(&of);
}

// spread: how far knots lie from the start, at random; up: dof that lifts; bound of what the Hessian is off by
static void check_model(const char *model, const char *text, double spread, int up, double bound) {
  cav_problem *problem = load(model, text);
  if (!CHECK(problem != NULL)) return;
  // and two terms of one's own, one of them hard
  cav_user_quantity own = {"own", "", 2, CAV_READS_ACCELERATION, own_value, own_jacobian, NULL, 0};
  cav_term *given = problem->term, terms[40];
  int ngiven = problem->nterm;
  memcpy(terms, given, (size_t)ngiven * sizeof *terms);
  terms[ngiven] = cav_term_cost(CAV_QUANTITY_USER, 20);
  terms[ngiven + 1] = cav_term_range(CAV_QUANTITY_USER, -1, 1);
  terms[ngiven].user = terms[ngiven + 1].user = &own;
  // which may join any dofs
  if (text == problem_text) problem->term = terms, problem->nterm = ngiven + 2;
  cav_transcription *tr = cav_transcription_new(problem, 2, NULL);
  cav_normal *normal = cav_normal_new(tr);
  cav_trajectory *at = cav_trajectory_new(problem->model, tr->nknot, problem->timestep);
  cav_trajectory *held = cav_trajectory_copy(at), *beside = cav_trajectory_copy(at);
  double *x = calloc((size_t)cav_transcription_unknowns(tr), sizeof *x);
  CHECK(cav_transcription_keep_rows(tr));
  for (int t = 0; t < tr->nknot; t++)
    memcpy(held->q + (size_t)t * held->nq, problem->q_start, (size_t)held->nq * sizeof(double));
  srand(1);
  for (int i = 0; i < cav_transcription_unknowns(tr); i++) x[i] = spread * uniform();
  cav_transcription_move(tr, held, x, at);
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++) tr->knot[t].slot[i].final_multiplier = uniform();
  // at half way with either gap after the step, and with the slip over it
  static const double fraction[] = {0, 0.5, 0.5, 0.5};
  static const cav_next_gap gap[] = {CAV_NEXT_GAP_LINEAR, CAV_NEXT_GAP_LINEAR, CAV_NEXT_GAP_EXACT, CAV_NEXT_GAP_EXACT};
  for (int i = 0; i < 4; i++) {
    problem->schedule.next_gap = gap[i];
    problem->schedule.next_slip = i == 3 ? CAV_NEXT_SLIP_EXACT : CAV_NEXT_SLIP_LINEAR;
    cav_stage_law(problem, fraction[i], tr->options.timestep, &tr->options);
    for (int factor = 0; factor < 2; factor++) {
      double with = mismatch(tr, normal, at, beside, factor, 1), without = mismatch(tr, normal, at, beside, factor, 0);
      CHECK(tr->options.next_gap == gap[i] && (tr->options.next_slip == CAV_NEXT_SLIP_EXACT) == (i == 3));
      printf("%g of the way, costs times %d: %.1e off, without curvature %.1e\n", fraction[i], factor, with, without);
      CHECK(with < bound);
      CHECK(without > 100 * with);
    }
  }
  if (text == problem_text) check_jumps(tr, at, beside, up);
  check_groups(tr, at, text == tree_problem_text);
  free(x);
  cav_trajectory_free(at), cav_trajectory_free(held), cav_trajectory_free(beside);
  cav_normal_free(normal);
  cav_transcription_free(tr);
  cav_problem_free(problem);
}

int main(void) {
  check_model(model_text, problem_text, 0.03, 1, 1e-4);
  check_model(body_text, problem_text, 0.03, 2, 1e-4);
  check_model(tree_text, tree_problem_text, 0.03, 2, 1e-4);
  return check_result();
}
