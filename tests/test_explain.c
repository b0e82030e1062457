/// optim/explain/explain.c, constraint_rows.c: problems made impossible on purpose, each named with the right row and
/// knot; penalties on those that can be solved against what loosening a bound saves, in closed form or by a warm solve with
/// the bound moved; rows of another problem refused; rows.csv bit for bit.
#include <unistd.h>

#include "cavort/cavort.h"
#include "constraint_table.h"
#include "contradiction.h"
#include "scene.h"

static char folder[] = "/tmp/cavort-explain-XXXXXX";

// an arm of two links in the vertical plane, reach 1 m; each link 1 kg: held level it needs 9.81 N m at the shoulder
static const char arm[] =
    "<mujoco><worldbody><body name='upper' pos='0 0 2'><joint name='shoulder' axis='0 1 0' limited='true' range='-170 "
    "170'/>"
    "<geom type='capsule' fromto='0 0 0 .5 0 0' size='.03' mass='1'/>"
    "<body name='lower' pos='.5 0 0'><joint name='elbow' axis='0 1 0' limited='true' range='-150 150'/>"
    "<geom type='capsule' fromto='0 0 0 .5 0 0' size='.03' mass='1'/><site name='tip' pos='.5 0 "
    "0'/></body></body></worldbody>"
    "<actuator><motor name='shoulder' joint='shoulder' gear='%s' ctrllimited='true' ctrlrange='-1 1'/>"
    "<motor name='elbow' joint='elbow' gear='40' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";

// a block with a foot below it that moves along the vertical, over a floor
static const char stilt[] =
    "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/><body name='trunk' pos='0 0 .5'>"
    "<joint name='height' type='slide' axis='0 0 1'/><geom type='box' size='.1 .1 .1' mass='4' contype='0' "
    "conaffinity='0'/>"
    "<body name='foot' pos='0 0 -.4'><joint name='leg' type='slide' axis='0 0 1' limited='true' range='-.3 .3'/>"
    "<geom name='sole' type='sphere' size='.1' mass='1'/></body></body></worldbody>"
    "<actuator><motor name='leg' joint='leg' gear='400' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";

typedef struct outcome {
  cav_problem *problem;
  cav_solution *solution;
  cav_status status;
  cav_explanation explanation;
} outcome;

/// Whether solves end after their first step.
static int stop_at_once;

static int at_once(void *context, const cav_progress *line) {
  (void)context, (void)line;
  return 1;
}

static outcome solve(const char *model, const char *terms) {
  char path[160], text[4000];
  cav_error error = {0};
  outcome out = {0};
  scene_write(folder, "model.xml", model);
  snprintf(text, sizeof text,
           "<problem name='p' model='model.xml'>\n<horizon duration='1' timestep='.05'/>\n<start%s/>\n%s"
           "</problem>\n",
           strstr(model, "floor") ? " height='floor'" : "", terms);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  out.problem = cav_problem_load(path, NULL, &error);
  CHECK(out.problem != NULL);
  if (!out.problem) {
    fprintf(stderr, "    %s\n", error.text);
    return out;
  }
  cav_solve_options options = cav_solve_options_default();
  if (stop_at_once) options.observer = at_once;
  out.status = cav_solve(out.problem, &options, NULL, &out.solution, &error);
  CHECK(out.solution != NULL);
  if (!out.solution) return out;
  cav_solution *s = out.solution;
  cav_status status = cav_explain(out.problem, s->trajectory, &s->contact, s->nrow, s->row, &out.explanation, &error);
  CHECK(status == CAV_OK);
  return out;
}

static void done(outcome *out) {
  cav_solution_free(out->solution);
  cav_problem_free(out->problem);
}

static int names(const char *text, const char *word) {
  if (strstr(text, word)) return 1;
  fprintf(stderr, "    no '%s' in: %s\n", word, text);
  return 0;
}

// the reason of rank i by violation (conflict 0) or conflict, held against what it must name and when
static void expect(const outcome *out, int conflict, int i, const char *word, int knot, int most) {
  const cav_explanation *e = &out->explanation;
  CHECK(i < (conflict ? e->nconflict : e->nviolation));
  const cav_reason *r = conflict ? &e->conflict[i] : &e->violation[i];
  CHECK(names(r->what, word));
  CHECK(r->row.knot >= knot && r->row.knot <= most && r->first <= r->row.knot && r->row.knot <= r->last);
  CHECK_NEAR(r->time, 0.05 * r->row.knot, 1e-12);
}

static const char *arm_of(const char *torque) {
  static char text[2000];
  snprintf(text, sizeof text, arm, torque);
  return text;
}

// 1.5 m asked of an arm of 1 m: off by 0.5 m in x at the knot of the target
static void check_out_of_reach(void) {
  outcome o =
      solve(arm_of("60"),
            "<constraint><sensor name='grasp' type='framepos' site='tip' target='1.5 0 2' at='.8'/></constraint>");
  if (o.solution) {
    CHECK(o.status == CAV_NOT_CONVERGED && !o.explanation.met);
    expect(&o, 0, 0, "'grasp', framepos of site 'tip', x: off by -0.5", 16, 16);
    expect(&o, 1, 0, "'grasp'", 16, 16);
    CHECK_NEAR(o.explanation.violation[0].violation, 0.5, 1e-6); // geometry; seen 1e-9
    CHECK(names(o.explanation.violation[0].cure, "out of reach"));
  }
  done(&o);
}

// 5 N m where holding level takes 9.81: the actuator and the posture, while the posture is asked for
static void check_too_weak(void) {
  outcome o = solve(arm_of("5"), "<constraint><posture name='level' dofs='joints' from='.5' to='1'/></constraint>");
  if (o.solution) {
    CHECK(o.status == CAV_NOT_CONVERGED && !o.explanation.met);
    // which of the two gives way more is the weights' to say
    int posture = strstr(o.explanation.violation[0].what, "'level'") != NULL;
    expect(&o, 0, posture, "actuator 'shoulder' (body 'upper')", 10, 20);
    expect(&o, 0, !posture, "'level', posture, joint 'shoulder'", 10, 20);
    // on the way up the actuator pulls too
    posture = strstr(o.explanation.conflict[0].what, "'level'") != NULL;
    expect(&o, 1, posture, "actuator 'shoulder'", 1, 20);
    expect(&o, 1, !posture, "'level', posture, joint 'shoulder'", 10, 20);
    CHECK(names(o.explanation.conflict[!posture].cure, "too weak"));
    CHECK(o.explanation.conflict[0].fraction + o.explanation.conflict[1].fraction > 0.7); // seen 0.9
  }
  done(&o);
  // the control: with 60 N m nothing is missed
  o = solve(arm_of("60"), "<constraint><posture name='level' dofs='joints' from='.5' to='1'/></constraint>");
  if (o.solution) CHECK(o.status == CAV_OK && o.explanation.met && o.explanation.nviolation == 0);
  done(&o);
}

// a foot of radius 0.1 m with its centre 0.1 m below the floor, at rest
static void check_inside_the_floor(void) {
  outcome o = solve(stilt,
                    "<constraint><sensor name='step' type='framepos' body='foot' component='z' target='-.1' "
                    "at='end'/></constraint><schedule><last softness='.05' smoothing='.002'/></schedule>");
  if (o.solution) {
    CHECK(o.status == CAV_NOT_CONVERGED && !o.explanation.met);
    expect(&o, 0, 0, "'step', framepos of body 'foot', z", 20, 20);
    expect(&o, 0, 1, "penetration of geom 'sole' into 'floor'", 1, 20);
    int found = 0;
    for (int i = 0; i < 2; i++) found |= strstr(o.explanation.conflict[i].what, "'step'") != NULL;
    CHECK(found);
    CHECK(names(o.explanation.violation[0].cure, "inside a solid"));
  }
  done(&o);
}

// a ball that slides freely through a box without an actuator: what is inside is the cause, and not what else pulls
static void check_inside_a_box(void) {
  static const char slider[] =
      "<mujoco><worldbody><geom name='box' type='box' size='.3 .3 .3'/><body name='a' pos='-1 0 0'>"
      "<joint name='x' type='slide' axis='1 0 0'/><geom name='ball' type='sphere' size='.1' mass='1'/>"
      "<body name='b'><joint name='arm' type='hinge' axis='0 1 0'/><geom type='sphere' size='.05' pos='0 0 1' "
      "mass='1'/>"
      "</body></body></worldbody><actuator><motor name='arm' joint='arm' ctrllimited='true' ctrlrange='-9 "
      "9'/></actuator>"
      "</mujoco>";
  outcome o = solve(slider,
                    "<goal><joint name='x' pos='2'/></goal><cost><posture dofs='joints' at='end' weight='1e4'/></cost>"
                    "<schedule><first iterations='1'/><last iterations='1'/></schedule>");
  if (o.solution) {
    const cav_reason *r = &o.explanation.conflict[0];
    CHECK(o.status == CAV_NOT_CONVERGED && o.explanation.nconflict > 0);
    CHECK(names(r->cure, "Geom 'ball' is") && names(r->cure, "inside 'box'") && !strstr(r->cure, "Pulls"));
    CHECK(names(r->cure, "<schedule solids=\"grow\"/>"));
    // what was done is not advised
    cav_problem grown = *o.problem;
    cav_error error = {0};
    grown.schedule.solids = CAV_SOLIDS_GROW;
    CHECK(cav_explain(&grown, o.solution->trajectory, &o.solution->contact, o.solution->nrow, o.solution->row,
                      &o.explanation, &error) == CAV_OK);
    CHECK(names(r->cure, "inside 'box'") && names(r->cure, "<waypoint>") && !strstr(r->cure, "solids="));
  }
  done(&o);
}

// two heights at once: each names the other, and the blame is shared
static void check_contradiction(void) {
  outcome o = solve(arm_of("60"),
                    "<constraint><sensor name='high' type='framepos' site='tip' component='z' target='2.2' at='.6'/>"
                    "<sensor name='low' type='framepos' site='tip' component='z' target='1.8' at='.6'/></constraint>");
  if (o.solution) {
    CHECK(o.status == CAV_NOT_CONVERGED && !o.explanation.met);
    for (int conflict = 0; conflict < 2; conflict++) {
      expect(&o, conflict, 0, "framepos of site 'tip', z", 12, 12);
      expect(&o, conflict, 1, "framepos of site 'tip', z", 12, 12);
    }
    const cav_reason *r = o.explanation.conflict;
    int high = strstr(r[0].what, "'high'") != NULL;
    CHECK(names(r[0].cure, high ? "contradicts constraint 'low'" : "contradicts constraint 'high'"));
    CHECK_NEAR(r[0].fraction, 0.5, 1e-3); // equal weights; seen 1e-5
    CHECK_NEAR(r[1].fraction, 0.5, 1e-3);
  }
  done(&o);
}

// the penalty on a bound is what the cost changes by when it gives way
static void check_penalty(void) {
  static const char terms[] =
      "<constraint><sensor name='raise' type='framepos' site='tip' component='z' lower='%g' at='end'/></constraint>";
  double cost[2], multiplier = 0;
  for (int i = 0; i < 2; i++) {
    char text[200];
    snprintf(text, sizeof text, terms, 2.3 + 0.01 * i);
    outcome o = solve(arm_of("60"), text);
    cost[i] = o.solution ? o.solution->cost : NAN;
    CHECK(o.status == CAV_OK && o.explanation.met && o.explanation.nviolation == 0);
    CHECK(o.explanation.nconflict > 0 && names(o.explanation.conflict[0].cure, "gives way"));
    if (o.explanation.nconflict && o.explanation.conflict[0].row.kind == CAV_BINDING_TERM)
      multiplier += 0.5 * o.explanation.conflict[0].row.multiplier;
    done(&o);
  }
  // mean of both ends against the derivative between; a lower bound's multiplier is negative. Bound 2 %: both solves
  // stop at relative decreases of 1e-5
  CHECK(multiplier < 0);
  CHECK_NEAR((cost[1] - cost[0]) / 0.01, -multiplier, 0.02 * fabs(multiplier));
}

// the cost of a problem from a start, and what its explanation says that all things of a kind save together
typedef struct priced {
  double cost, saving;
  int reasons, at_bounds; ///< reasons, and whether each of them is at a bound
} priced;

static priced solve_warm(const cav_problem *p, cav_binding_kind kind, cav_trajectory **warm) {
  priced out = {.cost = NAN, .at_bounds = 1};
  cav_solution *s = NULL;
  cav_error error = {0};
  static cav_explanation e;
  cav_solve_options options = cav_solve_options_default();
  CHECK(cav_solve(p, &options, *warm, &s, &error) == CAV_OK);
  if (!s) return out;
  CHECK(cav_explain(p, s->trajectory, &s->contact, s->nrow, s->row, &e, &error) == CAV_OK && e.met);
  out.cost = s->cost;
  out.reasons = e.nconflict;
  for (int i = 0; i < e.nconflict; i++) {
    const cav_binding *row = &e.conflict[i].row;
    out.at_bounds &= fmin(fabs(row->value - row->lower), fabs(row->value - row->upper)) < 2e-4;
    if (row->kind == kind) out.saving += e.conflict[i].saving;
  }
  if (!*warm) *warm = s->trajectory, s->trajectory = NULL;
  cav_solution_free(s);
  return out;
}

static cav_problem *load(const char *model, const char *horizon, const char *terms) {
  char path[160], text[4000];
  cav_error error = {0};
  scene_write(folder, "model.xml", model);
  snprintf(text, sizeof text, "<problem name='p' model='model.xml'><horizon %s/><start/>%s</problem>", horizon, terms);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *p = cav_problem_load(path, NULL, &error);
  CHECK(p != NULL);
  if (!p) fprintf(stderr, "    %s\n", error.text);
  return p;
}

#define CART(LIMIT)                                                                                   \
  "<mujoco><worldbody><body name='cart'><joint name='x' type='slide' axis='1 0 0'/><geom type='box' " \
  "size='.1 .1 .1' mass='1'/></body></worldbody><actuator><motor name='push' joint='x' " LIMIT        \
  "/></actuator></mujoco>"
#define EFFORT_ALONE "<effort weight='1'/><velocity weight='0'/><acceleration weight='0'/><posture weight='0'/>"

// 1 m in 1 s from rest to rest, half of u^2, no faster than w: speed rises by a parabola in t = 3/2 (1 - 1/w), so the
// cost is 4 w^2/(3 t) and its derivative 8 w/(3 t) - 2/t^2
static void check_speed_limit(void) {
  const double w = 1.2, t = 1.5 * (1 - 1 / w), cost = 4 * w * w / (3 * t), saving = -(8 * w / (3 * t) - 2 / (t * t));
  cav_trajectory *warm = NULL;
  cav_problem *p = load(CART(""), "duration='1' timestep='.02' close='open'",
                        "<cost>" EFFORT_ALONE
                        "</cost><constraint><velocity name='limit' joint='x' upper='1.2'/><sensor "
                        "name='there' type='jointpos' joint='x' target='1' at='end'/><velocity name='stop' joint='x' "
                        "at='end'/></constraint>");
  if (!p) return;
  cav_solution *s = NULL;
  cav_error error = {0};
  static cav_explanation e;
  cav_solve_options options = cav_solve_options_default();
  CHECK(cav_solve(p, &options, NULL, &s, &error) == CAV_OK);
  if (s) {
    CHECK(cav_explain(p, s->trajectory, &s->contact, s->nrow, s->row, &e, &error) == CAV_OK && e.met);
    CHECK_NEAR(s->cost, cost, 0.1 * cost); // 50 steps; seen 4 %
    for (int i = 0; i < e.nconflict; i++)
      if (strstr(e.conflict[i].what, "'limit'")) CHECK_NEAR(e.conflict[i].saving, saving, 0.2 * saving);
    CHECK(e.nconflict == 3);
  }
  cav_solution_free(s);
  cav_trajectory_free(warm);
  cav_problem_free(p);
}

// predicted against a warm solve with the bound moved by a step
static void compare_prices(const cav_problem *p, const cav_problem *moved, cav_binding_kind kind, double step) {
  cav_trajectory *warm = NULL;
  solve_warm(p, kind, &warm);
  // both from there, at the end of the schedule
  cav_problem last = *p, last_moved = *moved;
  last.schedule.stages = last_moved.schedule.stages = 1;
  last.schedule.first = last_moved.schedule.first = p->schedule.last;
  priced before = solve_warm(&last, kind, &warm), after = solve_warm(&last_moved, kind, &warm);
  CHECK(before.reasons > 0 && before.at_bounds && after.at_bounds);
  double saved = before.cost - after.cost, predicted = 0.5 * step * (before.saving + after.saving);
  CHECK(predicted != 0);
  CHECK_NEAR(saved, predicted, 0.2 * fabs(predicted));
  if (fabs(saved - predicted) > 0.2 * fabs(predicted))
    fprintf(stderr, "    kind %d: cost %.8g to %.8g, %d reasons, saving %g then %g\n", kind, before.cost, after.cost,
            before.reasons, before.saving, after.saving);
  cav_trajectory_free(warm);
}

// a push that is too weak for where it should come to: its limit holds over most knots
static void check_effort_limit(void) {
  cav_problem *p = load(CART("ctrllimited='true' ctrlrange='-1 1'"), "duration='1' timestep='.05' close='open'",
                        "<cost>" EFFORT_ALONE "<posture joint='x' qpos='1' at='end' weight='20'/></cost>");
  if (!p) return;
  cav_problem moved = *p;
  moved.effort_limit += 0.02;
  compare_prices(p, &moved, CAV_BINDING_EFFORT, 0.02);
  cav_problem_free(p);
}

// an arm whose elbow would bend farther
static void check_range(void) {
  cav_problem *p =
      load(arm_of("60"), "duration='1' timestep='.05'",
           "<cost><sensor type='jointpos' joint='elbow' target='3' from='.3' weight='50' within='any'/></cost>");
  if (!p) return;
  cav_problem moved = *p;
  moved.limit_margin = p->limit_margin + 0.01;
  compare_prices(p, &moved, CAV_BINDING_JOINT, -0.01);
  cav_problem_free(p);
}

// the high kick with its height as a constraint, and 3 cm lower
static void check_kick(void) {
  cav_error error = {0};
  cav_problem *p = cav_problem_load(CAVORT_SOURCE_ROOT "/problems/motions/kick/problem.xml", NULL, &error);
  CHECK(p != NULL);
  if (!p) return;
  int height = -1;
  for (int i = 0; i < p->nterm; i++)
    if (!strcmp(p->term[i].name, "height of the kick")) height = i;
  CHECK(height >= 0 && p->term[height].component == 2);
  cav_term *term = malloc(sizeof *term * (size_t)p->nterm);
  if (height >= 0 && term) {
    p->timestep = p->duration / 30; // so that it takes seconds
    cav_problem moved = *p;
    double target[3] = {0, 0, p->term[height].target[2] - 0.03};
    p->term[height].use = CAV_USE_EQUAL;
    memcpy(term, p->term, sizeof *term * (size_t)p->nterm);
    term[height].target = target;
    moved.term = term;
    compare_prices(p, &moved, CAV_BINDING_TERM, -0.03);
  }
  free(term);
  cav_problem_free(p);
}

// rows as a file, bit for bit; rows of something else, and files that are no rows, are refused
static void check_rows(void) {
  char path[160];
  cav_error error = {0};
  outcome o = solve(arm_of("60"),
                    "<constraint><sensor name='raise' type='framepos' site='tip' component='z' lower='2.3' "
                    "at='end'/></constraint>");
  if (!o.solution) return;
  cav_solution *s = o.solution;
  snprintf(path, sizeof path, "%s/rows.csv", folder);
  CHECK(s->nrow > 0 && cav_rows_write(path, 0.05, s->nrow, s->row, &error) == CAV_OK);
  cav_binding *row = NULL;
  int n = 0, same = 1;
  CHECK(cav_rows_read(path, &n, &row, &error) == CAV_OK && n == s->nrow);
  for (int i = 0; i < n; i++) {
    const cav_binding *a = &row[i], *b = &s->row[i];
    same &= a->knot == b->knot && a->kind == b->kind && a->object == b->object && a->component == b->component;
    same &= a->value == b->value && a->lower == b->lower && a->upper == b->upper && a->allowed == b->allowed;
    same &= a->multiplier == b->multiplier && a->pull == b->pull;
  }
  CHECK(same);
  static cav_explanation explanation;
  cav_binding broken[] = {row[0], row[0], row[0], row[0], row[0]};
  broken[0].knot = 21;
  broken[1].object = -1;
  broken[2].kind = CAV_BINDING_TERM, broken[2].object = 1;
  broken[3].kind = CAV_BINDING_PENETRATION;
  broken[4].multiplier = NAN;
  for (int i = 0; i < 5; i++) {
    cav_status status = cav_explain(o.problem, s->trajectory, &s->contact, 1, &broken[i], &explanation, &error);
    CHECK(status == CAV_BAD_INPUT && names(error.text, "not of this problem"));
  }
  free(row);
  scene_write(folder, "rows.csv", "knot,time\n1,2\n");
  CHECK(cav_rows_read(path, &n, &row, &error) == CAV_BAD_INPUT && n == 0 && !row && names(error.text, "rows.csv:1:"));
  scene_write(folder, "rows.csv",
              "knot,time,kind,object,component,value,lower,upper,allowed,multiplier,pull\n1,.05,9,0,0,0,0,0,0,0,0\n");
  CHECK(cav_rows_read(path, &n, &row, &error) == CAV_BAD_INPUT && !row && names(error.text, "rows.csv:2:"));
  scene_write(folder, "rows.csv",
              "knot,time,kind,object,component,value,lower,upper,allowed,multiplier,pull\n1.5,.05,1,0,0,0,0,0,0,0,0\n");
  CHECK(cav_rows_read(path, &n, &row, &error) == CAV_BAD_INPUT && !row && names(error.text, "'knot'"));
  done(&o);
}

// three targets of which any two go together: told where rows of equalities can be factored; none where nothing is missed
static void check_three(void) {
  static const char *const terms[] = {
      "<constraint><posture name='bent' joint='elbow' qpos='.5' at='.5'/><posture name='raised' joint='shoulder' "
      "qpos='.3' at='.5'/><sensor name='hand' type='framexaxis' site='tip' component='z' target='-.9' at='.5'/>"
      "</constraint>",
      "<constraint><posture name='bent' joint='elbow' qpos='.5' at='.5'/><posture name='raised' joint='shoulder' "
      "qpos='.3' at='.5'/></constraint>"};
  if (!cav_contradictions_available()) return;
  outcome three = solve(arm_of("60"), terms[0]), two = solve(arm_of("60"), terms[1]);
  const char *text = three.explanation.contradiction;
  CHECK(names(text, "cannot hold together") && names(text, "'bent'") && names(text, "'raised'") &&
        names(text, "'hand'") && names(text, "at 0.5 s"));
  printf("%s\n", text);
  CHECK(two.explanation.met && !*two.explanation.contradiction);
  done(&three), done(&two);
}

/// A ball beside a lever that its guess takes to a metre above the floor, where it is to be at rest: what is missing is its
/// weight, 19.6 N, and no brake.
static void check_unsupported(void) {
  static const char ball[] =
      "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/><body name='ball' pos='0 0 .1'>"
      "<joint name='up' type='slide' axis='0 0 1'/><joint name='along' type='slide' axis='1 0 0'/>"
      "<geom name='ball' type='sphere' size='.1' mass='2'/></body><body name='lever' pos='0 1 1'>"
      "<joint name='lever' axis='0 1 0'/><geom type='capsule' fromto='0 0 0 .3 0 0' size='.02' mass='.5'/></body>"
      "</worldbody><actuator><motor joint='lever' gear='20' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";
  stop_at_once = 1;
  outcome o = solve(ball,
                    "<goal><joint name='up' pos='1'/></goal><cost><posture name='up' joint='up' at='end' "
                    "weight='1e4'/></cost>\n");
  stop_at_once = 0;
  if (o.solution) {
    CHECK(o.status == CAV_INTERRUPTED);
    expect(&o, 0, 0, "joint 'up' (body 'ball')", 1, 20);
    CHECK(names(o.explanation.violation[0].cure, "Nothing holds it up there, and it weighs 19.6 N"));
    CHECK(!strstr(o.explanation.violation[0].cure, "brakes"));
  }
  done(&o);
}

int main(void) {
  if (!mkdtemp(folder)) return EXIT_FAILURE;
  check_out_of_reach();
  check_too_weak();
  check_inside_the_floor();
  check_inside_a_box();
  check_contradiction();
  check_three();
  check_unsupported();
  check_penalty();
  check_speed_limit();
  check_effort_limit();
  check_range();
  if (CHECK_CASES(10) == 10) check_kick(); // seconds; with sanitizers minutes
  check_rows();
  static const char *const file[] = {"model.xml", "problem.xml", "rows.csv"};
  for (int i = 0; i < 3; i++) {
    char path[160];
    snprintf(path, sizeof path, "%s/%s", folder, file[i]);
    unlink(path);
  }
  CHECK(rmdir(folder) == 0);
  return check_result();
}
