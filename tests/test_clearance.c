/// What passes over the world: how near it is, against its closed form and differences; what the verifier and the planner
/// make of a ball that flies over the ground at a known height and speed; whom it is not asked of; and that a ball which goes
/// from place to place over the ground is carried higher for it.
#include "clearance.h"
#include "transcription.h"

#include "quantity.h"
#include "scene.h"

static const double height = CAV_CLEARANCE;

/// A hull that goes along a rail by itself, under it a ball on a slide with a motor; a ball that nothing moves, one whose
/// motor carries it, and the ground.
static const char scene[] =
    "<mujoco><option gravity='0 0 0'/><worldbody><geom type='plane' size='5 5 1'/>"
    "<body name='hull' pos='0 0 1'><joint name='x' type='slide' axis='1 0 0'/><geom type='sphere' size='.1' mass='5' "
    "contype='0' "
    "conaffinity='0'/>"
    "<body name='ball' pos='0 0 -.95'><joint name='z' type='slide' axis='0 0 1'/><geom type='sphere' size='.05' "
    "mass='1'/></body>"
    "</body>"
    "<body name='free' pos='0 2 .05'><joint name='along' type='slide' axis='1 0 0'/><geom type='sphere' size='.05' "
    "mass='1'/>"
    "</body>"
    "<body name='cart' pos='0 4 .06'><joint name='rail' type='slide' axis='1 0 0'/><geom type='sphere' size='.05' "
    "mass='1'/>"
    "</body></worldbody>"
    "<actuator><motor joint='z' gear='50' ctrllimited='true' ctrlrange='-1 1'/>"
    "<motor joint='rail' gear='50' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";

enum { DOFS = 4 };

static void test_nearness(void) {
  const double gap[] = {-0.0015, 0, 0.006, 0.015, 0.024, 0.05}, value[] = {1.1025, 1, 0.64, 0.25, 0.04, 0};
  for (int i = 0; i < 6; i++) {
    double derivative, e = 1e-7;
    CHECK_NEAR(cav_clearance_nearness(height, gap[i], &derivative), value[i], 1e-12);
    const double up = cav_clearance_nearness(height, gap[i] + e, NULL),
                 low = cav_clearance_nearness(height, gap[i] - e, NULL);
    CHECK_NEAR(derivative, (up - low) / (2 * e), 1e-4);
  }
  // what is deep in the world counts no more than what is 3 mm deep
  CHECK_NEAR(cav_clearance_nearness(height, -0.2, NULL), 1.21, 1e-12);
  CHECK_NEAR(cav_clearance_height(0.02), height, 0);
  CHECK_NEAR(cav_clearance_height(0.002), 0.01, 1e-15);
}

/// A problem of the scene with the default costs and some more, and a motion along x at a height.
typedef struct flight {
  cav_problem problem;
  cav_term term[CAV_DEFAULT_TERMS + 4];
  double q_start[DOFS], v_start[DOFS], q_goal[DOFS];
  cav_trajectory *motion;
  int clearance, slip;
} flight;

static int begin(flight *f, const cav_model *m, double gap, double speed) {
  enum { KNOTS = 11 };
  const double h = 0.02;
  *f = (flight){.problem = cav_problem_default(m)};
  cav_problem *p = &f->problem;
  const int n = cav_problem_default_terms(f->term, CAV_DEFAULT_TERMS);
  for (int i = 0; i < n; i++) {
    if (f->term[i].quantity == CAV_QUANTITY_CLEARANCE) f->clearance = i;
    if (f->term[i].quantity == CAV_QUANTITY_SLIP) f->slip = i;
  }
  p->name = "flight", p->term = f->term, p->nterm = n;
  p->timestep = h, p->duration = h * (KNOTS - 1), p->close_at_rest = 0;
  p->q_start = f->q_start, p->v_start = f->v_start, p->q_goal = f->q_goal;
  f->motion = cav_trajectory_new(m, KNOTS, h);
  if (!CHECK(f->motion != NULL)) return 0;
  for (int t = 0; t < KNOTS; t++)
    for (int k = 0; k < DOFS; k++) f->motion->q[DOFS * t + k] = k == 1 ? gap : speed * h * t;
  for (int k = 0; k < DOFS; k++) f->v_start[k] = f->motion->v[k] = k == 1 ? 0 : speed;
  f->q_start[1] = gap;
  memcpy(f->q_goal, f->motion->q + DOFS * (KNOTS - 1), sizeof f->q_goal);
  cav_trajectory_velocities(m, f->motion);
  return 1;
}

/// Largest value of the term as the verifier reads it, and the cost of all its values.
static double measured(flight *f, double *cost) {
  cav_term_value value[400];
  cav_error error = {0};
  int n = 0;
  double most = 0;
  cav_options law = f->problem.model->options;
  law.timestep = f->problem.timestep, law.order = f->problem.order;
  law.stabilisation = CAV_STABILISATION_DISCRETE, law.softness = 0.01;
  if (!CHECK(!cav_term_values(&f->problem, f->motion, &law, f->clearance, 400, value, &n, &error) && n <= 400))
    fprintf(stderr, "    %s\n", error.text);
  *cost = 0;
  for (int i = 0; i < n; i++) most = fmax(most, fabs(value[i].value)), *cost += value[i].cost;
  return most;
}

/// What the planner makes of it, with no other cost but next to nothing for slip.
static double planned(flight *f) {
  cav_problem p = f->problem;
  cav_term term[2] = {f->term[f->clearance], f->term[f->slip]};
  cav_error error = {0};
  term[1].weight = 1e-30;
  p.term = term, p.nterm = 2;
  cav_transcription *tr = cav_transcription_new(&p, 1, &error);
  if (!CHECK(tr != NULL)) return NAN;
  tr->options.stabilisation = CAV_STABILISATION_DISCRETE, tr->options.softness = 0.01;
  CHECK(cav_transcription_values(tr, f->motion) == CAV_OK);
  const double cost = cav_transcription_cost(tr);
  cav_transcription_free(tr);
  return cost;
}

static void test_measure(const cav_model *m) {
  const double gap[] = {0.006, 0.015, 0.04}, near[] = {0.64, 0.25, 0}, speed = 2;
  for (int i = 0; i < 3; i++) {
    flight f;
    double cost;
    if (!begin(&f, m, gap[i], speed)) return;
    // of the three balls the one that hangs on what floats; weight 10, half of the square over the ten steps that have forces
    CHECK_NEAR(measured(&f, &cost), near[i] * speed, 1e-9);
    CHECK_NEAR(cost, 0.5 * 10 * near[i] * speed * near[i] * speed * 0.02 * 10, 1e-9);
    CHECK_NEAR(planned(&f), cost, 1e-9);
    // what a term of slip lets slide, and nothing where slip costs nothing
    cav_term *let = &f.term[f.problem.nterm];
    *let = cav_term_cost(CAV_QUANTITY_SLIP, 0);
    let->body = cav_object_find(m, CAV_OBJECT_BODY, "ball"), let->within = 5;
    f.problem.nterm++;
    CHECK_NEAR(measured(&f, &cost), 0, 0);
    f.problem.nterm--;
    f.term[f.slip].weight = 0;
    CHECK_NEAR(measured(&f, &cost), 0, 0);
    cav_trajectory_free(f.motion);
  }
}

/// A metre along the rail by itself, the ball 5 mm over the ground at both ends: how high it is half way.
static double lifted(const cav_model *m, double weight, double *of_verifier, double *of_solver) {
  flight f;
  double middle = NAN;
  if (!begin(&f, m, 0.005, 1.25)) return NAN;
  cav_problem *p = &f.problem;
  p->duration = 0.8;
  f.term[f.clearance].weight = weight;
  f.term[p->nterm] = cav_term_cost(CAV_QUANTITY_CONFIGURATION, 1000);
  f.term[p->nterm].name = "there", f.term[p->nterm].from = f.term[p->nterm].to = p->duration;
  p->nterm++;
  memset(f.q_goal, 0, sizeof f.q_goal);
  f.q_goal[0] = 1, f.q_goal[1] = 0.005, f.v_start[2] = f.v_start[3] = 0;
  cav_solution *s = NULL;
  cav_verdict v;
  cav_error error = {0};
  if (CHECK(!cav_solve(p, NULL, NULL, &s, &error)) && CHECK(!cav_verify_solution(p, s, &v, &error))) {
    middle = s->trajectory->q[DOFS * (s->trajectory->nknot / 2) + 1];
    if (!CHECK(v.certified && v.achieved)) fprintf(stderr, "    %s%s\n", v.reason, v.missed);
    *of_verifier = v.cost, *of_solver = s->cost;
  } else {
    fprintf(stderr, "    %s\n", error.text);
  }
  cav_solution_free(s);
  cav_trajectory_free(f.motion);
  return middle;
}

int main(void) {
  cav_error error = {0};
  cav_model *m = cav_model_parse(scene, NULL, NULL, &error);
  test_nearness();
  if (CHECK(m != NULL)) {
    test_measure(m);
    double verifier[2], solver[2];
    const double low = lifted(m, 0, &verifier[0], &solver[0]), high = lifted(m, 10, &verifier[1], &solver[1]);
    for (int i = 0; i < 2; i++) CHECK_NEAR(verifier[i], solver[i], 0.02 * verifier[i]);
    CHECK(low < 0.6 * CAV_CLEARANCE && high > CAV_CLEARANCE);
    printf("a ball that goes a metre in 0.8 s is carried %.1f mm over the ground, %.1f where that costs nothing\n",
           1e3 * high, 1e3 * low);
  }
  cav_model_free(m);
  return check_result();
}
