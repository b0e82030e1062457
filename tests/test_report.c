/// What cavort report measures, against closed forms and independent integration: references to rounding, observed
/// orders of the step, differences of derivatives that fall as their order says, penetration and hover of the law, and
/// what is recommended from it. Times are not checked, but that there are some.
#include "report.h"

#include <float.h>
#include <sys/stat.h>

#include "advice.h"
#include "random.h"
#include "scene.h"

// a damped pendulum of known inertia: mass 1 at 0.5 m
static const char pendulum_text[] =
    "<mujoco><worldbody><body><joint axis='0 1 0' damping='0.3'/>"
    "<inertial pos='0 0 -.5' mass='1' diaginertia='.01 .01 .01'/></body></worldbody></mujoco>";
static const double inertia = 0.26, arm = 0.5, damping = 0.3, gravity = 9.81;

// a point that slides up and down over a floor, and one that slides along it too, heavy enough to stay there
static const char drop_text[] =
    "<mujoco><worldbody><geom type='plane' size='1 1 1' condim='1'/><body pos='0 0 .1'>"
    "<joint type='slide' axis='0 0 1'/><geom type='sphere' size='.1' mass='2' condim='1'/></body></worldbody></mujoco>";
static const char slide_text[] =
    "<mujoco><option timestep='.005' gravity='0 0 -60'/><worldbody><geom type='plane' size='1 1 1' "
    "friction='.01'/><body pos='0 0 .1'>"
    "<joint type='slide' axis='0 0 1'/><joint type='slide' axis='1 0 0'/>"
    "<geom type='sphere' size='.1' mass='2' friction='.01'/></body></worldbody></mujoco>";

static int carry_on(void *context, const char *what, double fraction) {
  CHECK(*what && fraction >= 0 && fraction <= 1);
  ++*(int *)context;
  return 0;
}

static int stop(void *context, const char *what, double fraction) {
  (void)what, (void)fraction;
  return ++*(int *)context > 3;
}

static int calls;

static cav_measure begin(const char *text) {
  cav_measure m = {.model = scene_load(text), .quick = 1, .tell = carry_on, .context = &calls};
  cav_error error = {0};
  if (CHECK(m.model != NULL)) CHECK(cav_measure_begin(&m, &error) == CAV_OK);
  return m;
}

static void end(cav_measure *m) {
  cav_measure_end(m);
  cav_model_free((cav_model *)m->model);
}

// --- numbers ---

static void test_numbers(void) {
  double A[] = {0, 2, 1, 1, -1, 3, 4, 0.5, -2}, b[] = {7, 8, -1}, x[] = {1, 2, 3};
  CHECK(cav_measure_eliminate(3, A, b));
  CHECK_NEAR_ALL(b, x, 3, 1e-14);
  double singular[] = {1, 2, 2, 4}, c[] = {1, 2};
  CHECK(!cav_measure_eliminate(2, singular, c));
  double values[] = {5, NAN, 1, 3, 2};
  CHECK_NEAR(cav_measure_quantile(values, 5, 0.5), 3, 0);
  CHECK(isinf(values[4]));
  CHECK(isnan(cav_measure_quantile(values, 0, 0.5)));
  uint64_t seed = 1;
  double mean = 0, square = 0;
  for (int i = 0; i < 20000; i++) {
    double n = cav_random_normal(&seed);
    mean += n / 20000, square += n * n / 20000;
  }
  CHECK_NEAR(mean, 0, 0.03);
  CHECK_NEAR(square, 1, 0.05);
}

static void test_sheet(void) {
  static const cav_sheet_column columns[] = {{"name", "a name"}, {"x", "m"}, {"y", "s"}};
  cav_sheet sheet = {.name = "cavort-test-sheet", .ntext = 1, .nnumber = 2, .column = columns};
  cav_error error = {0};
  char text[200] = "";
  for (int i = 0; i < 40; i++) {
    double *row = cav_sheet_add(&sheet, i ? "plain" : "with \"quotes\", and a comma", NULL, NULL);
    if (!CHECK(row != NULL)) break;
    CHECK(row[0] == CAV_SHEET_NONE && row[1] == CAV_SHEET_NONE);
    row[0] = i;
    if (i == 0) row[1] = NAN;
  }
  CHECK_NEAR(cav_sheet_get(&sheet, 39, 0), 39, 0);
  CHECK(!cav_sheet_write(&sheet, "/tmp", &error));
  FILE *file = fopen("/tmp/cavort-test-sheet.csv", "r");
  if (CHECK(file != NULL)) {
    CHECK(fread(text, 1, sizeof text - 1, file) > 60);
    fclose(file);
  }
  CHECK(!strncmp(text, "name,x,y\n\"with \"\"quotes\"\", and a comma\",0,failed\n\"plain\",1,\n", 60));
  unlink("/tmp/cavort-test-sheet.csv");
  cav_sheet_free(&sheet);
}

// --- references and forward solvers ---

// a step of the drop in closed form: m (v' - v_free) = f, f = max(0, (v* - v')/R)
static double drop_step(const cav_measure *m, const cav_measure_sample *s) {
  double h = m->options.timestep, mass = m->model->mass, free_fall = s->v[0] + h * (s->u[0] / mass - gravity);
  CHECK(cav_inverse(m->model, m->state, s->q, s->v, s->v_next, m->vector[0]) == CAV_OK);
  if (m->state->ncontact == 0) return free_fall;
  const cav_contact *c = &m->state->contact[0];
  double target = (1 - c->damping[0]) * s->v[0] - c->stiffness * c->dist, R = c->regulariser[0];
  return target > free_fall ? (mass * R * free_fall + target) / (mass * R + 1) : free_fall;
}

static void test_forward(void) {
  cav_measure m = begin(drop_text);
  cav_measure_forward out;
  CHECK(cav_measure_collect(&m) == CAV_OK);
  int with = 0, without = 0;
  for (int i = 0; i < m.nsample; i++) {
    const cav_measure_sample *s = &m.sample[i];
    CHECK_NEAR(s->v_next[0], drop_step(&m, s), 1e-14 * (1 + fabs(s->v_next[0])));
    CHECK(s->uncertainty <= 1e-13);
    with += s->rows > 0, without += s->rows == 0;
  }
  CHECK(with > 3 && without > 3);
  CHECK(m.contact_rows == 1 && fabs(m.contact_v[0]) < 0.1);
  CHECK(cav_measure_forwards(&m, &out) == CAV_OK);
  CHECK(out.states == m.nsample && out.without == 0 && !out.sweeps_missing);
  int exact = 0;
  for (int r = 0; r < out.sheet.nrow; r++) {
    const char *method = out.sheet.row[r].label[0];
    CHECK(cav_sheet_get(&out.sheet, r, CAV_FORWARD_TIME) > 0);
    CHECK(cav_sheet_get(&out.sheet, r, CAV_FORWARD_LOW) <= cav_sheet_get(&out.sheet, r, CAV_FORWARD_HIGH));
    CHECK(cav_sheet_get(&out.sheet, r, CAV_FORWARD_FAILED) == 0);
    if (strcmp(method, "Newton by tolerance") || cav_sheet_get(&out.sheet, r, CAV_FORWARD_SETTING) > 1e-8) continue;
    CHECK(cav_sheet_get(&out.sheet, r, CAV_FORWARD_ERROR_MAX) <= 1e-13);
    CHECK(cav_sheet_get(&out.sheet, r, CAV_FORWARD_MISMATCH_MAX) <= 1e-13);
    exact++;
  }
  CHECK(exact > 3);
  // control: a reference that is off is seen as an error of the solvers, and as its own uncertainty
  cav_sheet_free(&out.sheet);
  for (int i = 0; i < m.nsample; i++) m.sample[i].v_next[0] += 1e-3;
  CHECK(cav_measure_forwards(&m, &out) == CAV_OK);
  for (int r = 0; r < out.sheet.nrow; r++)
    if (!strcmp(out.sheet.row[r].label[0], "Newton by tolerance"))
      CHECK_NEAR(cav_sheet_get(&out.sheet, r, CAV_FORWARD_ERROR_MAX), 1e-3, 1e-4);
  cav_sheet_free(&out.sheet);
  // what the smoothed law cannot be solved by says so
  m.options.smoothing = 1e-3;
  CHECK(cav_measure_forwards(&m, &out) == CAV_OK);
  CHECK(out.sweeps_missing != NULL);
  cav_sheet_free(&out.sheet);
  end(&m);
}

// --- steps ---

// angle of the pendulum after the motion, by Runge and Kutta's method in many steps
static double pendulum_angle(double v, double push, double drag, double seconds) {
  enum { STEPS = 20000 };
  double q = 0, h = seconds / STEPS;
  for (int t = 0; t < STEPS; t++) {
    double kq[4], kv[4];
    for (int k = 0; k < 4; k++) {
      double c = k == 0 ? 0 : k == 3 ? 1 : 0.5, time = (t + c) * h;
      double at = q + (k ? c * h * kq[k - 1] : 0), rate = v + (k ? c * h * kv[k - 1] : 0);
      kq[k] = rate;
      kv[k] = (push * sin(10 * time) - gravity * arm * sin(at) - drag * rate) / inertia;
    }
    q += h / 6 * (kq[0] + 2 * kq[1] + 2 * kq[2] + kq[3]);
    v += h / 6 * (kv[0] + 2 * kv[1] + 2 * kv[2] + kv[3]);
  }
  return q;
}

static void test_steps(void) {
  cav_measure m = begin(pendulum_text);
  cav_measure_step out;
  uint64_t seed = 5;
  double v = cav_random_normal(&seed), push = cav_measure_push(m.model, 0, 8);
  CHECK_NEAR(push, 8 * inertia, 1e-12);
  CHECK(cav_measure_collect(&m) == CAV_OK);
  CHECK(cav_measure_steps(&m, &out) == CAV_OK);
  CHECK(out.motion[0].known && !out.motion[1].known && !out.momentum);
  CHECK(out.motion[0].uncertainty < 1e-9);
  CHECK_NEAR(out.motion[0].order, 2, 0.02);
  double exact = fabs(pendulum_angle(v, push, damping, out.seconds));
  CHECK_NEAR(out.motion[0].size, exact, 3 * out.motion[0].uncertainty + 1e-11);
  // control: another pendulum is not this one
  CHECK(fabs(out.motion[0].size - fabs(pendulum_angle(v, push, 0.31, out.seconds))) > 1e-4);
  int seen[2] = {0};
  for (int r = 0; r < out.sheet.nrow; r++) {
    double order = cav_sheet_get(&out.sheet, r, CAV_STEP_ORDER);
    int euler = !strcmp(out.sheet.row[r].label[1], "euler");
    CHECK(cav_sheet_get(&out.sheet, r, CAV_STEP_TIME) > 0);
    if (order == CAV_SHEET_NONE || cav_sheet_get(&out.sheet, r, CAV_STEP_STEP) > 0.011) continue;
    // damping is implicit in euler, at the end of the step: first order
    CHECK_NEAR(order, euler ? 1 : 2, euler ? 0.1 : 0.03);
    seen[euler]++;
  }
  CHECK(seen[0] >= 4 && seen[1] >= 2);
  cav_sheet_free(&out.sheet);
  end(&m);
}

// --- derivatives ---

static double error_at(const cav_sheet *sheet, const char *block, const char *method, double step) {
  for (int r = 0; r < sheet->nrow; r++) {
    const cav_sheet_row *row = &sheet->row[r];
    double s = cav_sheet_get(sheet, r, CAV_DERIVATIVE_STEP);
    if (strcmp(row->label[0], "free") || strcmp(row->label[1], block) || strcmp(row->label[2], method)) continue;
    if (step == 0 ? s == CAV_SHEET_NONE : fabs(s - step) < 1e-3 * step)
      return cav_sheet_get(sheet, r, CAV_DERIVATIVE_ERROR_MAX);
  }
  return NAN;
}

static void test_derivatives(void) {
  cav_measure m = begin(pendulum_text);
  cav_measure_derivative out;
  CHECK(cav_measure_collect(&m) == CAV_OK);
  CHECK(cav_measure_derivatives(&m, &out) == CAV_OK);
  CHECK(out.states[0] > 0 && out.states[1] == 0);
  CHECK(error_at(&out.sheet, "q", "analytic", 0) < 1e-11);
  CHECK(error_at(&out.sheet, "v_next", "analytic", 0) < 1e-12);
  // u has m g l sin q: one-sided differences are off by half the step times its curvature, centred ones by step^2/6
  CHECK_NEAR(error_at(&out.sheet, "q", "one-sided", 1e-3) / error_at(&out.sheet, "q", "one-sided", 1e-4), 10, 0.2);
  CHECK_NEAR(error_at(&out.sheet, "q", "centred", 1e-1), 1e-2 / 6, 1e-5);
  CHECK_NEAR(error_at(&out.sheet, "q", "centred", 1e-2) / error_at(&out.sheet, "q", "centred", 1e-3), 100, 2);
  // rounding grows as the step falls
  CHECK(error_at(&out.sheet, "q", "centred", 1e-12) > 1e-6);
  cav_sheet_free(&out.sheet);
  end(&m);
}

// --- the law ---

static void test_law(void) {
  cav_measure m = begin(slide_text);
  cav_measure_law out;
  CHECK(cav_measure_collect(&m) == CAV_OK);
  CHECK(cav_measure_laws(&m, &out) == CAV_OK);
  CHECK(out.contacts && out.sheet.nrow > 5);
  double h = m.options.timestep;
  int slid = 0;
  for (int r = 0; r < out.sheet.nrow; r++) {
    double softness = cav_sheet_get(&out.sheet, r, CAV_LAW_SOFTNESS);
    CHECK(cav_sheet_get(&out.sheet, r, CAV_LAW_FAILED) == 0);
    if (strcmp(out.sheet.row[r].label[0], "softness") || softness > 1e-4) continue;
    // the convex law holds what slides off by friction, step and slip
    double hover = cav_sheet_get(&out.sheet, r, CAV_LAW_HOVER), slip = cav_sheet_get(&out.sheet, r, CAV_LAW_SLIP);
    CHECK_NEAR(cav_sheet_get(&out.sheet, r, CAV_LAW_PREDICTED), 0.01 * h * slip, 1e-9 * slip);
    CHECK_NEAR(hover, cav_sheet_get(&out.sheet, r, CAV_LAW_PREDICTED), 0.02 * hover);
    slid += hover > 1e-3;
  }
  CHECK(slid >= 2);
  cav_sheet_free(&out.sheet);
  end(&m);
}

// --- the recommendation ---

static void test_advice(void) {
  cav_measure_forward forward = {.sheet = {.name = "f", .ntext = 2, .nnumber = CAV_FORWARD_NUMBERS}};
  cav_measure_step step = {.sheet = {.name = "s", .ntext = 2, .nnumber = CAV_STEP_NUMBERS}, .seconds = 0.5};
  static const struct {
    const char *method;
    double setting, time, error;
  } solver[] = {{"Newton by tolerance", 1e-2, 20, 1e-2},  {"Newton by tolerance", 1e-4, 21, 1e-5},
                {"Newton by tolerance", 1e-8, 22, 1e-10}, {"Newton by tolerance", 1e-12, 30, 1e-15},
                {"Gauss-Seidel by sweeps", 5, 12, 1e-2},  {"Gauss-Seidel by sweeps", 50, 18, 1e-5}};
  for (int i = 0; i < 6; i++) {
    double *row = cav_sheet_add(&forward.sheet, solver[i].method, "all", NULL);
    row[CAV_FORWARD_SETTING] = solver[i].setting;
    row[CAV_FORWARD_TIME] = solver[i].time;
    row[CAV_FORWARD_ERROR_MAX] = solver[i].error;
    row[CAV_FORWARD_ROWS] = 3;
  }
  static const struct {
    const char *order;
    double step, time, error;
  } steps[] = {{"euler", 0.02, 1, 0.09},
               {"euler", 0.01, 2, 0.03},
               {"midpoint", 0.02, 3, 0.008},
               {"midpoint", 0.01, 6, NAN},
               {"euler", 0.001, 20, 0.003}};
  for (int i = 0; i < 5; i++) {
    double *row = cav_sheet_add(&step.sheet, "free", steps[i].order, NULL);
    row[CAV_STEP_STEP] = steps[i].step;
    row[CAV_STEP_TIME] = steps[i].time;
    row[CAV_STEP_ERROR] = steps[i].error;
  }
  cav_advice a;
  step.motion[0] = (cav_measure_motion){.known = 1, .size = 1, .uncertainty = 1e-6};
  cav_advice_take(&forward, &step, NULL, &a);
  CHECK(a.motion == 0 && a.step[0].row == 0 && a.step[CAV_ADVICE_TARGET].row == 2 && a.step[2].row == -1);
  // a tenth of 1 % of the way over half a second
  CHECK_NEAR(a.bound, 0.002, 1e-15);
  CHECK(a.cheapest == 1 && a.forward == 2 && a.sweeps == 5);
  // where both motions are known, both have to end well
  for (int i = 0; i < 5; i++) {
    double *row = cav_sheet_add(&step.sheet, "contacts", steps[i].order, NULL);
    row[CAV_STEP_STEP] = steps[i].step;
    row[CAV_STEP_TIME] = 2 * steps[i].time;
    row[CAV_STEP_ERROR] = i == 0 ? 1e-4 : i == 2 ? 0.009 : 0.02;
  }
  step.motion[1] = (cav_measure_motion){.known = 1, .size = 0.1, .uncertainty = 1e-6};
  cav_advice_take(&forward, &step, NULL, &a);
  CHECK(a.motion == 1 && a.both && a.step[0].row == 5 && a.step[CAV_ADVICE_TARGET].row == 7);
  CHECK_NEAR(a.step[0].error, 0.09, 1e-15);
  step.motion[1].known = 0;
  // clearly cheaper sweeps win
  forward.sheet.value[5 * CAV_FORWARD_NUMBERS + CAV_FORWARD_TIME] = 13;
  cav_advice_take(&forward, &step, NULL, &a);
  CHECK(a.forward == 5);
  // a reference that is not known decides nothing
  step.motion[0].uncertainty = 0.01;
  cav_advice_take(&forward, &step, NULL, &a);
  CHECK(a.motion == -1 && a.step[CAV_ADVICE_TARGET].row == -1 && a.forward == -1);
  // of the solvers the fastest of those that are hardly dearer than the best, of the problem itself
  static const struct {
    const char *order;
    double feasible, seconds, cost;
  } solves[] = {{"euler", 1, 5, 426}, {"euler", 1, 30, 3.4},    {"euler", 1, 20, 3.6},
                {"euler", 0, 1, 0.1}, {"momentum", 1, 2, 2.57}, {"euler", 1, 10, 4}};
  cav_measure_plan plan = {.sheet = {.name = "p", .ntext = 3, .nnumber = CAV_PLAN_NUMBERS}};
  for (int i = 0; i < 6; i++) {
    double *row = cav_sheet_add(&plan.sheet, "solver", solves[i].order, "");
    row[CAV_PLAN_STEP] = 0.02;
    row[CAV_PLAN_FEASIBLE] = solves[i].feasible;
    row[CAV_PLAN_SECONDS] = solves[i].seconds;
    row[CAV_PLAN_COST] = solves[i].cost;
  }
  cav_advice_take(&forward, &step, &plan, &a);
  CHECK(a.plan == 2);
  cav_sheet_free(&plan.sheet);
  cav_sheet_free(&forward.sheet);
  cav_sheet_free(&step.sheet);
}

// --- the whole ---

// whether a file holds a text
static int holds(const char *path, const char *text) {
  static char whole[1 << 19];
  FILE *file = fopen(path, "r");
  const size_t size = file ? fread(whole, 1, sizeof whole - 1, file) : 0;
  if (file) fclose(file);
  whole[size] = 0;
  return strstr(whole, text) != NULL;
}

static void test_write(void) {
  static const char *const names[] = {"report.html", "forward.csv", "step.csv", "derivative.csv", "law.csv"};
  char folder[] = "/tmp/cavort-report-XXXXXX", path[100];
  cav_error error = {0};
  cav_provenance provenance;
  if (!CHECK(mkdtemp(folder) != NULL)) return;
  cav_provenance_take(&provenance, "a test", NULL, NULL);
  cav_report_request request = {.model = scene_load(slide_text),
                                .name = "a </title><b> & \"slide\"",
                                .folder = folder,
                                .quick = 1,
                                .tell = stop,
                                .context = &calls,
                                .provenance = &provenance};
  if (!CHECK(request.model != NULL)) return;
  // stopped: nothing is written
  calls = 0;
  CHECK(cav_report_write(&request, &error) == CAV_INTERRUPTED);
  struct stat about;
  snprintf(path, sizeof path, "%s/report.html", folder);
  CHECK(stat(path, &about) != 0);
  request.tell = carry_on;
  double begin = cav_measure_clock();
  CHECK(cav_report_write(&request, &error) == CAV_OK);
  if (cav_measure_clock() - begin > 30) printf("a quick report took %.0f s\n", cav_measure_clock() - begin);
  for (int i = 0; i < 5; i++) {
    snprintf(path, sizeof path, "%s/%s", folder, names[i]);
    CHECK(stat(path, &about) == 0 && about.st_size > (i ? 300 : 20000) && about.st_size < 300000);
    // nothing touches a slide: its differences cross no kink
    if (i == 0) CHECK(holds(path, "takes the analytic ones") && !holds(path, "The law has a kink"));
    unlink(path);
  }
  rmdir(folder);
  cav_model_free((cav_model *)request.model);
}

int main(void) {
  test_numbers();
  test_sheet();
  test_forward();
  test_steps();
  test_derivatives();
  test_law();
  test_advice();
  test_write();
  return check_result();
}
