/// optim/solver/course.c on a leg in the air: what nobody moves has to fall, rows that are not linear in the joints. A
/// step with the bend of its course keeps rows to what the programme said to third order, without it to second.
#include <unistd.h>

#include "course.h"
#include "scene.h"

static const char model_text[] =
    "<mujoco><worldbody><body name='trunk' pos='0 0 .78'>"
    "<joint name='x' type='slide' axis='1 0 0'/><joint name='z' type='slide' axis='0 0 1'/>"
    "<joint name='pitch' axis='0 1 0'/><geom type='sphere' size='.1' mass='20'/><body name='thigh'>"
    "<joint name='hip' axis='0 1 0'/><geom type='capsule' fromto='0 0 0 .1 0 -.35' size='.03' mass='3'/>"
    "<body name='shank' pos='.1 0 -.35'><joint name='knee' axis='0 1 0'/>"
    "<geom type='capsule' fromto='0 0 0 -.1 0 -.35' size='.03' mass='2'/><geom type='box' size='.1 .05 .02' pos='-.1 0 "
    "-.41' "
    "mass='.5'/></body></body></body></worldbody>"
    "<actuator><motor joint='hip' gear='200' ctrlrange='-1 1' ctrllimited='true'/>"
    "<motor joint='knee' gear='200' ctrlrange='-1 1' ctrllimited='true'/></actuator></mujoco>";

/// Two arms that hang, one on each side.
static const char arms_text[] =
    "<mujoco><worldbody><body name='left arm' pos='0 .2 1'><joint name='left' axis='0 1 0'/><geom type='capsule' "
    "fromto='0 0 0 0 0 -.3' size='.03' mass='1'/></body><body name='right arm' pos='0 -.2 1'><joint name='right' "
    "axis='0 1 0'/><geom type='capsule' fromto='0 0 0 0 0 -.3' size='.03' mass='1'/></body></worldbody>"
    "<actuator><motor joint='left' gear='100' ctrlrange='-1 1' ctrllimited='true'/>"
    "<motor joint='right' gear='100' ctrlrange='-1 1' ctrllimited='true'/></actuator></mujoco>";

enum { KNOTS = 8, NV = 5 };

// largest difference of the last values of equality rows to those here, where a step is to leave them
static double off(const cav_transcription *tr, const double *here) {
  double most = 0;
  for (int t = 0, k = 0; t < KNOTS; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++, k++) {
      const cav_slot *slot = &tr->knot[t].slot[i];
      if (slot->lower < slot->upper) continue;
      most = fmax(most, fabs(slot->value - here[k]));
    }
  return most;
}

static void test_bend(cav_transcription *tr, cav_quadratic *qp, cav_trajectory *at, cav_trajectory *to) {
  const double change[2] = {-INFINITY, INFINITY};
  double radius[KNOTS], x[KNOTS * NV], last[2] = {0}, miss[2] = {0};
  cav_course course = {0};
  int n = cav_transcription_unknowns(tr), rows = cav_quadratic_rows(qp);
  if (!CHECK(n <= KNOTS * NV && cav_course_make(&course, tr, rows))) return;
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  for (int t = 0; t < KNOTS; t++) radius[t] = 3;
  // a step that stays within its box: rows hold where it begins
  for (int t = 0, k = 0; t < KNOTS; t++) {
    for (int i = 0; i < 3 * NV; i++) tr->knot[t].gradient[i] *= 10;
    for (int i = 0; i < tr->knot[t].layout.count; i++, k++) {
      const cav_slot *slot = &tr->knot[t].slot[i];
      cav_quadratic_value(qp)[k] = fmin(fmax(slot->value, slot->lower), slot->upper);
      cav_quadratic_penalty(qp)[k] = 1e4;
    }
  }
  CHECK(cav_quadratic_solve(qp, radius, change, 1e-9) == CAV_OK);
  cav_course_begin(&course, tr);
  CHECK(cav_course_find(&course, tr, qp, at, to) == CAV_OK && course.known);
  const double *step = cav_quadratic_step(qp);
  for (int i = 0; i < 5; i++) {
    double part = 0.4 / (1 << i);
    for (int bent = 0; bent < 2; bent++) {
      for (int j = 0; j < n; j++) x[j] = part * (step[j] + bent * part * course.bend[j]);
      cav_transcription_move(tr, at, x, to);
      CHECK(cav_transcription_values(tr, to) == CAV_OK);
      miss[bent] = off(tr, course.here);
    }
    printf("part %.3g of a step of %.3g: rows off by %.3g, with its bend %.3g; by its half %.3g, %.3g of it\n", part,
           cav_quadratic_length(qp), miss[0], miss[1], i ? miss[0] / last[0] : 0, i ? miss[1] / last[1] : 0);
    if (i == 4)
      CHECK(fabs(miss[0] / last[0] - 0.25) < 0.03 && fabs(miss[1] / last[1] - 0.125) < 0.02 && miss[1] < 0.1 * miss[0]);
    last[0] = miss[0], last[1] = miss[1];
  }
  cav_course_clear(&course);
}

// where efforts alone cost, a correction for all of the forces is the programme's own step; in a mirrored cycle, whose
// first and last knots see unknowns of the other side
static void test_efforts(cav_transcription *tr, cav_quadratic *qp, cav_trajectory *at) {
  const double change[2] = {-INFINITY, INFINITY};
  int n = cav_transcription_unknowns(tr), rows = cav_quadratic_rows(qp), k = 0;
  double radius[KNOTS], force[KNOTS * NV] = {0}, x[KNOTS * NV], worst = 0;
  double *offset = calloc((size_t)rows + 1, sizeof(double));
  if (!CHECK(offset && n <= KNOTS * NV && tr->nv <= NV)) {
    free(offset);
    return;
  }
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  for (int t = 0; t < KNOTS; t++) {
    radius[t] = 100;
    memcpy(force + t * tr->nv, tr->knot[t].u, (size_t)tr->nv * sizeof(double));
    for (int i = 0; i < tr->knot[t].layout.count; i++, k++)
      cav_quadratic_value(qp)[k] = tr->knot[t].slot[i].value, cav_quadratic_penalty(qp)[k] = 1;
  }
  CHECK(cav_quadratic_solve(qp, radius, change, 1e-12) == CAV_OK);
  cav_quadratic_correct(qp, offset, force, x);
  for (int i = 0; i < n; i++) worst = fmax(worst, fabs(x[i] - cav_quadratic_step(qp)[i]));
  printf("cycle: a step of %.3g, by its forces %.2g off that\n", cav_quadratic_length(qp), worst);
  CHECK(cav_quadratic_length(qp) > 1e-3 && worst < 1e-5 * cav_quadratic_length(qp));
  free(offset);
}

static void kick(const cav_model *m, cav_trajectory *at) {
  for (int t = 0; t < KNOTS; t++) {
    double *q = at->q + t * at->nq, swing = 0.002 * t * t;
    if (at->nq == NV)
      q[1] = -0.5 * 9.81 * 0.0025 * t * (t - 1), q[2] = -swing, q[3] = 3 * swing, q[4] = swing;
    else
      q[0] = 0.1 + swing, q[1] = 0.2 - 2 * swing;
  }
  cav_trajectory_velocities(m, at);
}

static cav_problem *load(const char *model, const char *more) {
  char folder[] = "/tmp/cavort-course-XXXXXX", path[80], text[400];
  cav_error error = {0};
  if (!CHECK(mkdtemp(folder) != NULL)) return NULL;
  scene_write(folder, "model.xml", model);
  snprintf(text, sizeof text,
           "<problem name='p' model='model.xml'><horizon duration='.35' timestep='.05'/>%s<start/></problem>", more);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *problem = cav_problem_load(path, NULL, &error);
  if (!CHECK(problem != NULL)) fprintf(stderr, "%s\n", error.text);
  unlink(path);
  snprintf(path, sizeof path, "%s/model.xml", folder);
  unlink(path);
  rmdir(folder);
  return problem;
}

static void test(const char *model, const char *more, int cycle) {
  cav_error error = {0};
  cav_problem *problem = load(model, more);
  if (!problem) return;
  for (int i = 0; i < problem->nterm && cycle; i++)
    if (problem->term[i].quantity != CAV_QUANTITY_EFFORT) problem->term[i].weight = 0;
  cav_transcription *tr = cav_transcription_new(problem, 1, &error);
  cav_trajectory *at = cav_trajectory_new(problem->model, KNOTS, problem->timestep), *to = cav_trajectory_copy(at);
  cav_normal *normal = tr ? cav_normal_new(tr) : NULL;
  cav_quadratic *qp = normal ? cav_quadratic_new(tr, normal) : NULL;
  if (CHECK(qp && at && to && cav_transcription_keep_rows(tr))) {
    tr->penalty = (cav_penalties){0};
    kick(problem->model, at);
    if (cycle) {
      double zero[KNOTS * NV] = {0};
      cav_transcription_move(tr, at, zero, to);
      test_efforts(tr, qp, to);
    } else {
      test_bend(tr, qp, at, to);
    }
  }
  cav_quadratic_free(qp);
  cav_normal_free(normal);
  cav_trajectory_free(at);
  cav_trajectory_free(to);
  cav_transcription_free(tr);
  cav_problem_free(problem);
}

int main(void) {
  test(model_text, "", 0);
  test(arms_text, "<cycle translation='0 0 0' mirror='y'/>", 1);
  return check_result();
}
