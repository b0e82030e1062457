/// Problems filled by hand, each with one thing wrong: refused with its name before anything is read through it.
#include "cavort/solve.h"
#include "scene.h"

static const char arm[] =
    "<mujoco><worldbody><body name='rod'><joint name='pivot' axis='0 1 0'/><geom type='sphere' pos='0 0 -.5' "
    "size='.05' "
    "mass='1'/><site name='tip' pos='0 0 -.5'/></body></worldbody><actuator><motor joint='pivot' gear='20' "
    "ctrlrange='-1 1' ctrllimited='true'/></actuator></mujoco>";

typedef struct trial {
  cav_problem problem;
  cav_term term[14];
  double start[1], rest[1], goal[1], target[8], time[2];
  cav_guess_pose pose[2];
  cav_swing swing;
} trial;

static cav_model *model;

enum { OWN = 12 }; // the term that cases change

static void prepare(trial *t) {
  *t = (trial){.goal = {1}, .time = {0.1, 0.4}, .target = {0.5, 0.6, 0.7, 0, 0.5, 0.6, 0.7, 0}};
  t->problem = cav_problem_default(model);
  t->problem.duration = 0.5, t->problem.timestep = 0.05, t->problem.guess_to = 0.5;
  t->problem.q_start = t->start, t->problem.v_start = t->rest, t->problem.q_goal = t->goal;
  t->problem.nterm = cav_problem_default_terms(t->term, OWN) + 2;
  t->problem.term = t->term;
  cav_error error = {0};
  t->term[OWN] = cav_term_cost(CAV_QUANTITY_SENSOR, 1);
  t->term[OWN].name = "mine";
  t->term[OWN].target = t->target;
  int tip = cav_object_find(model, CAV_OBJECT_SITE, "tip");
  CHECK(!cav_sensor_of(model, CAV_SENSOR_FRAMEPOS, CAV_OBJECT_SITE, tip, &t->term[OWN].sensor, &error));
  t->term[OWN + 1] = cav_term_range(CAV_QUANTITY_VELOCITY, -9, 9);
  t->pose[0] = (cav_guess_pose){0.1, t->goal}, t->pose[1] = (cav_guess_pose){0.4, t->start};
  t->swing = (cav_swing){0, 0.1, 1, 0};
}

// solve and guess refuse it with these words
static void refused(trial *t, cav_status status, const char *words) {
  cav_error error = {0};
  cav_solution *solution = NULL;
  CHECK(cav_solve(&t->problem, NULL, NULL, &solution, &error) == status && !solution);
  if (!CHECK(strstr(error.text, words) != NULL)) fprintf(stderr, "    '%s' in '%s'\n", words, error.text);
  error = (cav_error){0};
  CHECK(!cav_problem_guess(&t->problem, &error) && error.status == status && strstr(error.text, words));
  cav_solution_free(solution);
}

#define REFUSED(change, words)         \
  do {                                 \
    trial t;                           \
    prepare(&t);                       \
    cav_term *mine = &t.term[OWN];     \
    (void)mine;                        \
    change;                            \
    refused(&t, CAV_BAD_INPUT, words); \
  } while (0)

static void test_terms(void) {
  REFUSED(mine->scale = 0, "positive scale and a weight that is not negative, nor above 1e16: term[12], 'mine'");
  REFUSED(mine->weight = INFINITY, "positive scale");
  REFUSED(mine->weight = NAN, "positive scale");
  REFUSED(mine->weight = 1e17, "nor above 1e16");
  REFUSED(mine->within = -1, "within");
  REFUSED(mine->within = NAN, "within");
  REFUSED(mine->from = NAN, "window");
  REFUSED((mine->from = 0.4, mine->to = 0.1), "window");
  REFUSED(mine->from = 2, "window");
  REFUSED((mine->from = 0.11, mine->to = 0.14), "no knot lies");
  REFUSED(mine->component = 3, "component");
  REFUSED(mine->component = -2, "component");
  REFUSED(mine->sensor.dim = 4, "another length");
  REFUSED(mine->sensor.object = 7, "looks at nothing in the model");
  REFUSED(mine->sensor.object = -1, "looks at nothing in the model");
  REFUSED((mine->sensor.referred = 1, mine->sensor.reference = 99), "in the frame of nothing");
  REFUSED(t.target[2] = NAN, "target that is not finite: term[12], 'mine'");
  REFUSED((mine->sensor.type = CAV_SENSOR_FRAMEQUAT, mine->sensor.dim = 4, memset(t.target, 0, sizeof t.target)),
          "length zero");
  REFUSED((mine->nwaypoint = 2), "no times");
  REFUSED((mine->nwaypoint = 2, mine->waypoint_time = t.time, mine->target = NULL), "no targets");
  REFUSED((mine->nwaypoint = 2, mine->waypoint_time = t.time, t.time[1] = 0.1), "do not increase");
  REFUSED((mine->nwaypoint = 2, mine->waypoint_time = t.time, t.time[1] = 0.6), "within the horizon");
  REFUSED((t.term[1].dofs = CAV_DOFS_ONE, t.term[1].joint = 1), "joint that the model does not have: term[1]");
  REFUSED(t.term[7].body = 5, "body that the model does not have");
  REFUSED(t.term[OWN + 1].lower = 10, "lower bound above");
  REFUSED(t.term[OWN + 1].upper = NAN, "lower bound above");
  REFUSED(t.term[0].use = CAV_USE_EQUAL, "a constraint must be over");
  REFUSED(t.problem.term = NULL, "term is NULL");
}

static void test_problem(void) {
  REFUSED(t.problem.q_goal = NULL, "lacks");
  REFUSED(t.problem.duration = INFINITY, "horizon");
  REFUSED(t.problem.timestep = NAN, "horizon");
  REFUSED(t.problem.limit_margin = NAN, "limit_margin");
  REFUSED(t.problem.effort_limit = 2, "effort_limit");
  REFUSED(t.problem.strength = -1, "strength");
  REFUSED(t.problem.strength = INFINITY, "strength");
  REFUSED(t.problem.guess_height = NAN, "guess_height");
  REFUSED(t.problem.guess_bow[1] = INFINITY, "guess_bow");
  REFUSED((t.problem.nguess_pose = 2, t.problem.guess_pose = t.pose, t.pose[1].time = 0.05), "guess_pose[1]");
  REFUSED((t.problem.nguess_pose = 2, t.problem.guess_pose = t.pose, t.pose[1].q = NULL), "guess_pose[1]");
  REFUSED((t.problem.nswing = 1, t.problem.swing = &t.swing, t.swing.joint = 1), "swing[0]");
  REFUSED((t.problem.nswing = 1, t.problem.swing = &t.swing, t.swing.phase = NAN), "swing[0]");
  trial t;
  prepare(&t);
  t.goal[0] = NAN;
  refused(&t, CAV_NOT_FINITE, "q_goal[0]");
  prepare(&t);
  t.rest[0] = INFINITY;
  refused(&t, CAV_NOT_FINITE, "v_start[0]");
}

int main(void) {
  model = scene_load(arm);
  if (!CHECK(model != NULL)) return check_result();
  test_terms();
  test_problem();
  // and what is right is taken
  trial t;
  cav_error error = {0};
  cav_solution *solution = NULL;
  prepare(&t);
  t.term[OWN].nwaypoint = 2, t.term[OWN].waypoint_time = t.time;
  t.problem.nguess_pose = 2, t.problem.guess_pose = t.pose;
  t.problem.nswing = 1, t.problem.swing = &t.swing;
  CHECK(cav_solve(&t.problem, NULL, NULL, &solution, &error) == CAV_OK && solution);
  cav_solution_free(solution);
  cav_model_free(model);
  return check_result();
}
