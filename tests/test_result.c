/// optim/result and problems/result: a folder written from a made-up solution and read back bit for
/// bit, forces that carry the weight of what rests, a verdict as JSON and as a table, and folders that are broken.
#include "result.h"

#include <unistd.h>

#include "certificate.h"
#include "check.h"
#include "csv.h"
#include "digest.h"
#include "forces.h"

static char top[] = "/tmp/cavort-result-XXXXXX";
static char folder[128], model_path[128], problem_path[128];

// a box that rests on the floor
static const char model_text[] =
    "<mujoco model='box \"1\"'><worldbody><geom name='floor' type='plane' size='1 1 1'/><body name='box' pos='0 0 .1'>"
    "<freejoint name='root'/><geom name='box, big' type='box' size='.1 .1 .1' mass='2'/></body></worldbody></mujoco>";
static const char problem_text[] =
    "<problem name='rest' model='box.xml'><horizon duration='.1' timestep='.02'/><start height='floor'/></problem>";

static void write_file(const char *path, const char *text) {
  FILE *file = fopen(path, "w");
  CHECK(file != NULL);
  if (!file) return;
  fputs(text, file);
  fclose(file);
}

static const char *read_file(const char *name) {
  static char text[200000];
  char *path = cav_result_path(folder, name);
  FILE *file = path ? fopen(path, "r") : NULL;
  size_t n = file ? fread(text, 1, sizeof text - 1, file) : 0;
  if (file) fclose(file);
  free(path);
  text[n] = 0;
  return text;
}

static void replace(const char *name, const char *text) {
  char *path = cav_result_path(folder, name);
  if (path) write_file(path, text);
  free(path);
}

// gains and a log with awkward numbers
static int fill(cav_solution *solution, const cav_problem *problem) {
  int nv = problem->model->nv, n = 5 * nv * nv;
  solution->trajectory = cav_trajectory_new(problem->model, 6, .02);
  solution->gain_q = malloc((size_t)n * sizeof(double));
  solution->gain_v = malloc((size_t)n * sizeof(double));
  solution->progress = calloc(2, sizeof *solution->progress);
  solution->stage = calloc(1, sizeof *solution->stage);
  if (!solution->trajectory || !solution->gain_q || !solution->gain_v || !solution->progress || !solution->stage)
    return 0;
  for (int t = 0; t < 6; t++) memcpy(solution->trajectory->q + 7 * t, problem->q_start, 7 * sizeof(double));
  for (int i = 0; i < n; i++) solution->gain_q[i] = sin(i) / 3, solution->gain_v[i] = 1e-200 * cos(i);
  solution->nprogress = 2;
  solution->progress[0] = (cav_progress){.phase = "continuation", .stage = 1, .stages = 1, .iteration = 1, .cost = 0.1};
  solution->progress[1] = (cav_progress){.phase = "multipliers", .stage = 1, .stages = 1, .iteration = 2, .cost = NAN};
  solution->nstage = 1;
  solution->stage[0] = (cav_stage_record){.phase = "multipliers",
                                          .stage = 1,
                                          .fraction = 0.5,
                                          .iterations = 7,
                                          .cost = 2,
                                          .unactuated = NAN,
                                          .outcome = CAV_OUTCOME_AGAIN,
                                          .seconds = 1.5};
  solution->nrow = 2;
  solution->row = calloc(2, sizeof *solution->row);
  if (!solution->row) return 0;
  for (int i = 0; i < 2; i++)
    solution->row[i] =
        (cav_binding){.knot = 2 + i, .kind = CAV_BINDING_EFFORT, .upper = 0.7, .multiplier = 1 / 3.0 - i};
  solution->row[0].lower = -INFINITY;
  solution->contact = problem->model->options;
  solution->contact.timestep = .02;
  solution->contact.stabilisation = CAV_STABILISATION_DISCRETE;
  solution->contact.softness = 0.1;
  solution->contact.time_constant = 0.03;
  solution->contact.smoothing = 1e-3;
  return 1;
}

static void check_read_back(const cav_solution *solution) {
  cav_error error = {0};
  cav_result *result = cav_result_read(folder, NULL, &error);
  CHECK(result != NULL);
  if (!result) {
    fprintf(stderr, "    %s\n", error.text);
    return;
  }
  int nv = result->problem->model->nv;
  CHECK(result->trajectory->nknot == 6);
  CHECK_NEAR_ALL(result->trajectory->q, solution->trajectory->q, 6 * 7, 0);
  CHECK_NEAR_ALL(result->gain_q, solution->gain_q, 5 * nv * nv, 0);
  CHECK_NEAR_ALL(result->gain_v, solution->gain_v, 5 * nv * nv, 0);
  CHECK(result->problem->solved && result->problem->contact.softness == 0.1 &&
        result->problem->contact.smoothing == 1e-3);
  CHECK(result->nrow == 2 && !memcmp(result->row, solution->row, 2 * sizeof *result->row));
  CHECK(result->problem->contact.stabilisation == CAV_STABILISATION_DISCRETE);
  cav_result_free(result);
  cav_result_free(NULL);
}

// the whole weight through four corners, at their places
static void check_forces(const cav_problem *problem, const cav_solution *solution) {
  cav_error error = {0};
  cav_options contact = solution->contact;
  cav_forces *forces = cav_forces_new(problem->model, solution->trajectory, &contact, 1, &error);
  CHECK(forces != NULL);
  if (!forces) return;
  CHECK(forces->nknot == 6 && forces->nforce == 24);
  double up = 0;
  for (int t = 0; t < 6; t++) CHECK(forces->count[t] == 4);
  for (int i = 0; i < 4; i++) {
    const cav_contact_force *f = &forces->force[i];
    CHECK(f->knot == 0 && !strcmp(problem->model->geom[f->geom2].name, "box, big"));
    CHECK_NEAR(fabs(f->pos[0]), 0.1, 1e-12);
    up += f->force[2];
  }
  // the vertical row of the inverse: u = weight - sum of forces, rounding of numbers near 20
  CHECK_NEAR(up + forces->u[2], 2 * 9.81, 1e-12);
  CHECK_NEAR(forces->com[2], 0.1, 1e-12);
  cav_forces_free(forces);
  // without rest after the end the last knot has no forces, and says so
  forces = cav_forces_new(problem->model, solution->trajectory, &contact, 0, &error);
  CHECK(forces && forces->nforce == 20 && isnan(forces->unactuated[5]) && isnan(forces->u[5 * 6]));
  cav_forces_free(forces);
  cav_forces_free(NULL);
}

// a servo and a motor without a name that hold 2 kg, 1 m from their hinges, by the closed form
static void test_controls(void) {
  static const char text[] =
      "<mujoco><worldbody><body><joint name='a' axis='0 1 0'/><inertial mass='2' pos='1 0 0' "
      "diaginertia='1 1 1'/></body><body><joint name='b' axis='0 1 0'/><inertial mass='2' "
      "pos='1 0 0' diaginertia='1 1 1'/></body></worldbody><actuator><position name='servo' "
      "joint='a' kp='100' gear='2'/><motor joint='b' gear='-4'/></actuator></mujoco>";
  char path[160];
  snprintf(path, sizeof path, "%s/controls.csv", top);
  write_file(model_path, text);
  cav_model *model = cav_model_load(model_path, NULL);
  cav_trajectory *motion = model ? cav_trajectory_new(model, 3, .02) : NULL;
  if (!CHECK(motion != NULL)) return;
  for (int t = 0; t < 3; t++) motion->q[2 * t] = 0.5;
  cav_options contact = model->options;
  cav_forces *forces = cav_forces_new(model, motion, &contact, 0, NULL);
  CHECK(forces && cav_controls_write(path, model, motion, forces, NULL) == CAV_OK);
  cav_table *table = cav_table_read(path, NULL);
  if (CHECK(table && table->nrow == 2 && table->ncol == 5)) {
    CHECK_TEXT(table->name[1], "ctrl_servo");
    CHECK_TEXT(table->name[4], "force_#1");
    double hold = -2 * 9.81 * cos(0.5) / 2;
    const double expected[5] = {0.02, hold / 100 + 2 * 0.5, 2 * 9.81 / 4, hold, 2 * 9.81 / 4};
    CHECK_NEAR_ALL(table->value + 5, expected, 5, 1e-12);
  }
  cav_table_free(table);
  cav_forces_free(forces);
  cav_trajectory_free(motion);
  cav_model_free(model);
  remove(path);
}

static void check_verdict(const cav_problem *problem) {
  cav_error error = {0};
  cav_verdict verdict = {.certified = 0,
                         .penetration_max_m = 0.02,
                         .optimality = NAN,
                         .push_survived_n_s = 12.5,
                         .duration = 0.1,
                         .closed_loop_seconds = 0.1,
                         .replay_same_step_seconds = 0.1,
                         .solve_seconds = 0.25,
                         .iterations = 9};
  snprintf(verdict.reason, sizeof verdict.reason, "too \"deep\"\n");
  CHECK(cav_result_write_verdict(folder, problem, &verdict, NULL, NULL, &error) == CAV_OK);
  const char *text = read_file("verdict.json");
  const char *field[] = {"\"feasible\": true",
                         "\"optimal\": false",
                         "\"certified\": false",
                         "\"model\": \"box \\\"1\\\"\"",
                         "\"reason\": \"too \\\"deep\\\"\\u000a\"",
                         "\"optimality\": null",
                         "\"penetration_max_m\": 0.02",
                         "\"iterations\": 9",
                         "\"unactuated_force_max\": ",
                         "\"momentum_defect_rms\": ",
                         "\"limit_violation_max\": ",
                         "\"constraint_violation_max\": ",
                         "\"slip_mean_m_s\": ",
                         "\"replay_same_step_max_error\": ",
                         "\"closed_loop_seconds\": ",
                         "\"closed_loop_end_error_m\": ",
                         "\"push_survived_n_s\": 12.5",
                         "\"solve_seconds\": 0.25"};
  for (size_t i = 0; i < sizeof field / sizeof *field; i++) {
    CHECK(strstr(text, field[i]) != NULL);
    if (!strstr(text, field[i])) fprintf(stderr, "    %s\n", field[i]);
  }
  // the marks follow the conditions: only the penetration is missed; not a number is missed too
  cav_certificate_line line[CAV_CERTIFICATE_LINES];
  int n = cav_certificate_lines(&verdict, line), missed = 0;
  for (int i = 0; i < n; i++) missed += line[i].passed == 0;
  CHECK(n <= CAV_CERTIFICATE_LINES && missed == 1);
  verdict.unactuated_force_max = NAN;
  n = cav_certificate_lines(&verdict, line);
  CHECK(line[0].passed == 0);
  // optimal: feasible, and known to be within a ten-thousandth of the cost
  CHECK(!cav_verdict_feasible(&verdict) && !cav_verdict_optimal(&verdict));
  verdict.unactuated_force_max = 1e-7;
  CHECK(cav_verdict_feasible(&verdict) && !cav_verdict_optimal(&verdict));
  verdict.optimality = 1.1e-4;
  CHECK(!cav_verdict_optimal(&verdict));
  verdict.optimality = 0.9e-4;
  CHECK(cav_verdict_optimal(&verdict));
  // a motion that the model's own contact parameters lose carries a mark, one that they keep none
  for (int lost = 0; lost < 2; lost++) {
    char table[8000];
    verdict.periods = 2, verdict.duration = 1.5, verdict.model_contacts_seconds = lost ? 2.25 : 3;
    verdict.optimality = lost ? 1.04e-4 : 0.9e-4;
    // a certificate that is narrow says so
    verdict.certified = !lost, verdict.closed_loop_end_error_m = 0.1, verdict.feedback_effort_max = 2;
    verdict.model_contacts_end_error_m = 0.46;
    FILE *out = fopen(problem_path, "w+");
    CHECK(out != NULL);
    if (!out) return;
    cav_certificate_print(out, problem, &verdict, NULL);
    rewind(out);
    table[fread(table, 1, sizeof table - 1, out)] = 0;
    fclose(out);
    CHECK((strstr(table, "is lost at 2.25 of 3 s") != NULL) == lost);
    CHECK((strstr(table, "certified at the edge: its closed loop ends up to 0.46 m off") != NULL) == !lost);
    // and one that is not optimal says what to do
    CHECK((strstr(table, "--solver both") != NULL) == lost);
    // in so many digits that it is seen on which side of its limit it is
    CHECK((strstr(table, "a step may still save 0.0104 % of the cost (locally optimal: no more than 0.01 %)") !=
           NULL) == lost);
    CHECK((strstr(table, "locally optimal: a step saves no more than 0.009 % of the cost") != NULL) == !lost);
  }
  write_file(problem_path, problem_text);
  verdict.limit_violation_max = 1e-3;
  CHECK(!cav_verdict_feasible(&verdict) && !cav_verdict_optimal(&verdict));
  // what only the solver knew comes back from the file
  cav_result *result = cav_result_read(folder, NULL, &error);
  CHECK(result && result->solve_seconds == 0.25 && result->iterations == 9);
  cav_result_free(result);
}

// a folder with one file changed is refused, with this in the error
static void refuse(const char *name, const char *text, const char *words) {
  char *kept = strdup(read_file(name));
  cav_error error = {0};
  replace(name, text);
  cav_result *result = cav_result_read(folder, NULL, &error);
  CHECK(!result && error.status == CAV_BAD_INPUT && strstr(error.text, name) && strstr(error.text, words));
  if (!strstr(error.text, words)) fprintf(stderr, "    expected %s, got %s\n", words, error.text);
  cav_result_free(result);
  if (kept) replace(name, kept);
  free(kept);
}

static void check_refusals(void) {
  refuse("gains.csv", "knot,time,dof\n0,0,0\n", "expected 30 rows");
  refuse("gains.csv", "", "empty");
  refuse("rows.csv", "knot,time\n0,0\n", "expected the columns");
  refuse("trajectory.csv", "time\n0\n1\n", "missing");
  refuse("problem.xml", problem_text, "model");
  cav_error error = {0};
  CHECK(cav_result_read("/nowhere", NULL, &error) == NULL && error.status == CAV_BAD_INPUT);
  // a file where a folder should be
  char under[160];
  snprintf(under, sizeof under, "%s/result", model_path);
  CHECK(cav_result_folder(under, &error) == CAV_BAD_INPUT && strstr(error.text, model_path));
}

static void remove_all(void) {
  const char *made[] = {"trajectory.csv", "gains.csv", "log.csv",     "stages.csv",
                        "problem.xml",    "rows.csv",  "verdict.json"};
  char upper[128];
  snprintf(upper, sizeof upper, "%s/some", top);
  for (size_t i = 0; i < sizeof made / sizeof *made; i++) {
    char *path = cav_result_path(folder, made[i]);
    if (path) remove(path);
    free(path);
  }
  remove(model_path);
  remove(problem_path);
  // nothing else was left there
  CHECK(rmdir(folder) == 0 && rmdir(upper) == 0 && rmdir(top) == 0);
}

// the vectors of FIPS 180-4, and a million letters
static void test_digest(void) {
  static const struct {
    const char *text;
    int times;
    const char *hash;
  } vector[] = {{"", 1, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"},
                {"abc", 1, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"},
                {"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", 1,
                 "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1"},
                {"aaaaaaaaaa", 100000, "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0"}};
  for (size_t i = 0; i < sizeof vector / sizeof *vector; i++) {
    char text[CAV_DIGEST_TEXT];
    FILE *file = tmpfile();
    if (!CHECK(file != NULL)) return;
    for (int k = 0; k < vector[i].times; k++) fputs(vector[i].text, file);
    rewind(file);
    cav_digest(file, text);
    CHECK_TEXT(text, vector[i].hash);
    fclose(file);
  }
}

int main(void) {
  test_digest();
  CHECK(mkdtemp(top) != NULL);
  snprintf(folder, sizeof folder, "%s/some/where", top);
  snprintf(model_path, sizeof model_path, "%s/box.xml", top);
  snprintf(problem_path, sizeof problem_path, "%s/rest.xml", top);
  test_controls();
  write_file(model_path, model_text);
  write_file(problem_path, problem_text);
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(problem_path, NULL, &error);
  cav_solution solution = {0};
  CHECK(problem != NULL);
  if (problem && fill(&solution, problem)) {
    CHECK(cav_result_folder(folder, &error) == CAV_OK && cav_result_folder(folder, &error) == CAV_OK);
    CHECK(cav_result_write(folder, problem, &solution, &error) == CAV_OK);
    // the model is two folders up: the folder and the model may move together
    CHECK(strstr(read_file("problem.xml"), "model=\"../../box.xml\"") != NULL);
    CHECK(strstr(read_file("log.csv"), "2,multipliers,1,,0,") != NULL);
    CHECK(strstr(read_file("stages.csv"), "multipliers,1,0.5,7,2,,0,again,1.5\n") != NULL);
    check_read_back(&solution);
    check_forces(problem, &solution);
    check_verdict(problem);
    check_refusals();
  } else {
    fprintf(stderr, "%s\n", error.text);
  }
  cav_trajectory_free(solution.trajectory);
  free(solution.gain_q);
  free(solution.gain_v);
  free(solution.progress);
  free(solution.stage);
  free(solution.row);
  cav_problem_free(problem);
  remove_all();
  return check_result();
}
