/// Long motions by windows of time: the same motion as all at once, up to what fades over the overlap (e-fold by e-fold), of a
/// point mass near a record and of an arm that reaches in time for waypoints, one instant and a range; forces hold across
/// seams; fewer unknowns at a time; and what is refused.
#include "cavort/cavort.h"
#include "scene.h"

static char folder[] = "/tmp/cavort-windows-XXXXXX";

static const char mass[] =
    "<mujoco><option gravity='0 0 0'/><worldbody><body name='mass'><joint name='x' type='slide' axis='1 0 0'/>"
    "<geom size='.1' mass='2' contype='0' conaffinity='0'/></body></worldbody><actuator><motor joint='x'/></actuator>"
    "</mujoco>";

static const char arm[] =
    "<mujoco><worldbody><body name='upper' pos='0 0 1'><joint name='a' axis='0 1 0' damping='.2' armature='.02'/><geom "
    "type='capsule' size='.04' fromto='0 0 0 0 0 -.3' mass='1'/><body name='lower' pos='0 0 -.3'><joint name='b' "
    "axis='0 1 0' damping='.2' armature='.02' limited='true' range='-150 150'/><geom type='capsule' size='.03' "
    "fromto='0 0 0 0 0 -.3' mass='.5'/><site name='tip' pos='0 0 -.3'/></body></body></worldbody><actuator>"
    "<motor joint='a' gear='30' ctrllimited='true' ctrlrange='-1 1'/>"
    "<motor joint='b' gear='10' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";

static cav_problem *load(const char *model, const char *horizon, const char *rest, cav_error *error) {
  char path[300], text[6000];
  snprintf(text, sizeof text, "<problem model='m.xml'><horizon %s/>%s</problem>", horizon, rest);
  scene_write(folder, "m.xml", model);
  scene_write(folder, "p.xml", text);
  snprintf(path, sizeof path, "%s/p.xml", folder);
  return cav_problem_load(path, NULL, error);
}

static cav_solution *solve(const cav_problem *p, int gains) {
  cav_solve_options options = cav_solve_options_default();
  cav_solution *solution = NULL;
  cav_error error = {0};
  options.gains = gains;
  if (!CHECK(p && cav_solve(p, &options, NULL, &solution, &error) == CAV_OK)) fprintf(stderr, "    %s\n", error.text);
  return solution;
}

static double apart(const cav_solution *a, const cav_solution *b) {
  double worst = 0;
  if (!CHECK(a && b && a->trajectory->nknot == b->trajectory->nknot)) return INFINITY;
  for (int i = 0; i < a->trajectory->nknot * a->trajectory->nq; i++)
    worst = fmax(worst, fabs(a->trajectory->q[i] - b->trajectory->q[i]));
  return worst;
}

/// What the certificate asks of the knots holds over seams; returns the cost as verified.
static double check_motion(const cav_problem *p, const cav_solution *s) {
  cav_verdict verdict = {0};
  cav_error error = {0};
  if (!CHECK(cav_verify(p, s->trajectory, &s->contact, s->gain_q, s->gain_v, &verdict, &error) == CAV_OK)) return 0;
  CHECK(verdict.unactuated_force_max < 1e-6 && verdict.limit_violation_max < 1e-6);
  CHECK(verdict.constraint_violation_max < CAV_TOLERANCE_CONSTRAINT);
  CHECK_NEAR(verdict.cost, s->cost, 1e-9 * (1 + s->cost));
  return verdict.cost;
}

/// A point mass near 8 s of a record, start unknown. The smoother forgets with a time constant of (weight/(rate/sd^2))^(1/4)
/// sqrt 2 = 0.24 s; seen: 4.8e-2, 9e-3, 4e-4 m.
static void test_smoother(void) {
  char text[30000];
  int n = snprintf(text, sizeof text, "time,x\n");
  for (int f = 0; f <= 200; f++)
    n += snprintf(text + n, sizeof text - (size_t)n, "%.17g,%.17g\n", f * .04,
                  sin(f * .11) + .3 * sin(f * .7) + (f % 3 ? .05 : -.1));
  scene_write(folder, "record.csv", text);
#define SMOOTH                                                                                                 \
  "<start free='true'/><cost><effort weight='0'/><velocity weight='0'/><acceleration dofs='all' weight='%g'/>" \
  "<posture weight='0'/><track file='record.csv' joints='x' sd='.1'/></cost>"
  char rest[600];
  double weight = 25 / .01 * pow(.24 / sqrt(2), 4), last = 1;
  snprintf(rest, sizeof rest, SMOOTH, weight);
  cav_problem *p = load(mass, "duration='8' timestep='.04' close='open'", rest, NULL);
  cav_solution *whole = solve(p, 0);
  const double overlap[] = {.4, .8, 1.6};
  for (int k = 0; k < 3 && p && whole; k++) {
    p->window = 2.4, p->overlap = overlap[k];
    cav_solution *s = solve(p, 0);
    double off = apart(whole, s);
    printf("point mass: overlap %g s, %g m off, %d stages\n", overlap[k], off, s ? s->nstage : 0);
    // it forgets a factor of e^(overlap/.24) from one overlap to twice of it
    CHECK(off < last && off < 20 * exp(-overlap[k] / .24));
    last = off;
    if (s) check_motion(p, s);
    cav_solution_free(s);
  }
  CHECK(last < 1e-3);
  cav_solution_free(whole);
  cav_problem_free(p);
}

/// An arm by waypoints, with an instant and a range inside windows and across their seams: certified as a whole.
static void test_arm(void) {
  const char *rest =
      "<start qpos='.2 -.4'/><goal qpos='-.3 .6'/><cost><posture weight='300'><waypoint time='0' qpos='.2 "
      "-.4'/><waypoint "
      "time='1.05' qpos='.9 -.2'/><waypoint time='2.3' qpos='-.5 .9'/><waypoint time='4' qpos='-.3 .6'/></posture>"
      "<sensor name='there' type='framepos' site='tip' component='x' target='.2' at='2.2' weight='200'/>"
      "<velocity name='calm' dofs='joints' from='.9' to='1.5' weight='2'/></cost>"
      "<constraint><sensor name='low' type='jointvel' joint='a' upper='.9' lower='-.9' from='.5' "
      "to='3'/></constraint>";
  cav_error error = {0};
  cav_problem *p = load(arm, "duration='4' timestep='.04' window='1.6' overlap='.8'", rest, &error);
  if (!CHECK(p != NULL)) {
    fprintf(stderr, "    %s\n", error.text);
    return;
  }
  CHECK(p->window == 1.6 && p->overlap == .8);
  char path[300];
  snprintf(path, sizeof path, "%s/p.xml", folder);
  CHECK(cav_problem_write(path, p, NULL, NULL) == CAV_OK);
  cav_problem *again = cav_problem_load(path, NULL, NULL);
  CHECK(again && again->window == p->window && again->overlap == p->overlap);
  cav_solution *s = solve(p, 1), *same = solve(again, 1);
  p->window = 0;
  cav_solution *whole = solve(p, 0);
  double off = apart(whole, s);
  printf("arm: %g rad off, cost %.6g against %.6g\n", off, s ? s->cost : 0, whole ? whole->cost : 0);
  CHECK(off < 0.01 && s && whole && s->cost > whole->cost * (1 - 1e-6) && s->cost < whole->cost * 1.01);
  CHECK(apart(s, same) == 0);
  if (s && CHECK(s->gain_q && s->gain_v)) {
    cav_verdict verdict = {0};
    check_motion(p, s);
    CHECK(cav_verify(p, s->trajectory, &s->contact, s->gain_q, s->gain_v, &verdict, &error) == CAV_OK);
    if (!CHECK(verdict.certified)) fprintf(stderr, "    %s\n", verdict.reason);
    // the range binds in one of the windows, and is told by the whole's knots
    int bound = 0;
    for (int i = 0; i < s->nrow; i++)
      if (s->row[i].kind == CAV_BINDING_TERM && s->row[i].object == 0 && fabs(s->row[i].multiplier) > 1e-3) {
        bound++;
        CHECK(s->row[i].knot * .04 > .49 && s->row[i].knot * .04 < 3.01);
        CHECK_NEAR(fabs(s->trajectory->v[2 * s->row[i].knot + 2]), .9, 1e-3);
      }
    CHECK(bound > 0);
  }
  cav_solution_free(s), cav_solution_free(same), cav_solution_free(whole);
  cav_problem_free(p), cav_problem_free(again);
}

static void test_refusals(void) {
  const struct {
    const char *horizon, *says;
  } wrong[] = {{"duration='4' timestep='.04' window='1' overlap='1'", "less than the window of 1 s"},
               {"duration='4' timestep='.04' window='-1'", "window"},
               {"duration='4' timestep='.04' range='3 5' window='1'", "contradicts 'range'"}};
  for (int i = 0; i < 3; i++) {
    cav_error error = {0};
    cav_problem *p = load(mass, wrong[i].horizon, "<start/>", &error);
    if (!CHECK(!p && strstr(error.text, wrong[i].says))) fprintf(stderr, "    %s\n", error.text);
    cav_problem_free(p);
  }
  cav_error error = {0};
  cav_problem *p = load(mass, "duration='4' timestep='.04' window='1'", "<start/>", &error);
  cav_solve_options options = cav_solve_options_default();
  cav_solution *s = NULL;
  options.first_stage = 5;
  CHECK(p && cav_solve(p, &options, NULL, &s, &error) == CAV_BAD_INPUT && !s && strstr(error.text, "windows"));
  cav_problem_free(p);
}

int main(void) {
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  test_smoother();
  test_arm();
  test_refusals();
  const char *files[] = {"m.xml", "p.xml", "record.csv"};
  for (int i = 0; i < 3; i++) {
    char path[300];
    snprintf(path, sizeof path, "%s/%s", folder, files[i]);
    unlink(path);
  }
  CHECK(rmdir(folder) == 0);
  return check_result();
}
