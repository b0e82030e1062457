/// Checkpoints: a solve that goes on from any of them, read back from its file, ends with the bits of the one that was
/// not stopped; one that is interrupted ends soon, keeps its iterate and chooses no gains; limits, first stage,
/// multipliers in and out; and files that are no checkpoints are refused with a place.
#include <limits.h>
#include <time.h>

#include "motion.h"
#include "scene.h"

/// A pendulum that has the strength to rise, one that has not, and one that has to swing.
static const char pendulum[] =
    "<mujoco model='pendulum'><worldbody><body name='rod'><joint name='pivot' axis='0 1 0' damping='.1'/>"
    "<geom type='sphere' pos='0 0 -.5' size='.05' mass='1'/></body></worldbody>"
    "<actuator><motor name='drive' joint='pivot' gear='%s' ctrlrange='-1 1' ctrllimited='true'/></actuator></mujoco>";
static const char rise[] =
    "<problem name='rise' model='model.xml'><horizon duration='%s' timestep='.025' %s/><start/>"
    "<goal><joint name='pivot' pos='%s'/></goal>"
    "<constraint><posture dofs='all' at='end'/></constraint>"
    "<cost><posture dofs='all' at='end' weight='900'/></cost></problem>";

enum { MOST = 400 };

/// Checkpoints of one solve, as files in a folder.
typedef struct shelf {
  const char *folder;
  int n;
  cav_place place[MOST];
  int stop_at; ///< the keeper asks for the end at this one, -1: never
} shelf;

static void shelf_path(const shelf *s, int i, char path[300]) { snprintf(path, 300, "%.200s/%d.csv", s->folder, i); }

static int keep(void *context, const cav_checkpoint *c) {
  shelf *s = context;
  char path[300];
  cav_error error = {0};
  if (!CHECK(s->n < MOST)) return 1;
  shelf_path(s, s->n, path);
  CHECK(cav_checkpoint_write(path, c, &error) == CAV_OK);
  s->place[s->n] = c->place;
  return s->n++ == s->stop_at;
}

static int same(const double *a, const double *b, size_t n) {
  if (!a || !b) return a == b;
  return memcmp(a, b, n * sizeof *a) == 0;
}

// whether two solutions are the same, bit by bit
static int alike(const cav_solution *a, const cav_solution *b) {
  const cav_trajectory *x = a->trajectory, *y = b->trajectory;
  size_t knots = (size_t)x->nknot, nv = (size_t)x->nv;
  int is = CHECK(x->nknot == y->nknot && x->timestep == y->timestep);
  is &= CHECK(same(x->q, y->q, knots * (size_t)x->nq) && same(x->v, y->v, knots * nv) && same(x->u, y->u, knots * nv));
  is &= CHECK(same(a->gain_q, b->gain_q, (knots - 1) * nv * nv) && same(a->gain_v, b->gain_v, (knots - 1) * nv * nv));
  is &= CHECK(a->nmultiplier == b->nmultiplier && same(a->multiplier, b->multiplier, (size_t)a->nmultiplier));
  is &= CHECK(a->iterations == b->iterations && a->cost == b->cost && a->nrow == b->nrow);
  is &= CHECK(a->optimality == b->optimality || (isnan(a->optimality) && isnan(b->optimality)));
  return is;
}

// goes on from a checkpoint's file
static cav_status go_on(const cav_problem *p, const cav_strategy *strategy, const cav_solve_options *options,
                        const char *path, cav_solution **solution) {
  cav_error error = {0};
  cav_checkpoint *c = cav_checkpoint_read(path, p->model, &error);
  if (!CHECK(c != NULL)) return fprintf(stderr, "    %s\n", error.text), CAV_INTERNAL;
  cav_solve_options rest = *options;
  rest.resume = c;
  cav_status status = cav_strategy_solve(p, strategy, &rest, NULL, solution, &error);
  cav_checkpoint_free(c);
  return status;
}

/// Solves by a strategy, then again from every few of its checkpoints. reached [CAV_PLACE_TYPES] counts places.
static void test_goes_on(const cav_problem *p, const cav_strategy *strategy, int every, const char *folder,
                         cav_status expected, int *reached) {
  shelf s = {.folder = folder, .stop_at = -1};
  cav_error error = {0};
  cav_solution *whole = NULL;
  cav_solve_options options = cav_solve_options_default();
  options.keeper = keep;
  options.keeper_context = &s;
  CHECK(cav_strategy_solve(p, strategy, &options, NULL, &whole, &error) == expected);
  if (!CHECK(whole != NULL)) return;
  for (int i = 0; i < s.n; i++) reached[s.place[i]]++;
  options.keeper = NULL;
  for (int i = 0; i < s.n; i++) {
    // the first of each place, and every few of those that follow
    if (i % every && i > 0 && s.place[i] == s.place[i - 1]) continue;
    char path[300];
    cav_solution *rest = NULL;
    shelf_path(&s, i, path);
    CHECK(go_on(p, strategy, &options, path, &rest) == expected);
    if (!CHECK(rest != NULL) || !alike(whole, rest)) fprintf(stderr, "    from checkpoint %d of %d\n", i, s.n);
    cav_solution_free(rest);
  }
  // a keeper that asks for the end, then from there
  cav_solution *part = NULL, *rest = NULL;
  int half = s.n / 2;
  s.n = 0;
  s.stop_at = half;
  options.keeper = keep;
  CHECK(cav_strategy_solve(p, strategy, &options, NULL, &part, &error) == CAV_INTERRUPTED);
  CHECK(part && !part->gain_q && part->iterations < whole->iterations);
  char path[300];
  shelf_path(&s, half, path);
  options.keeper = NULL;
  CHECK(go_on(p, strategy, &options, path, &rest) == expected);
  if (CHECK(rest != NULL)) alike(whole, rest);
  cav_solution_free(part);
  cav_solution_free(rest);
  cav_solution_free(whole);
}

static cav_problem *load_pendulum(const char *folder, const char *gear, const char *duration, const char *horizon,
                                  const char *goal) {
  char text[2000], path[300];
  cav_error error = {0};
  snprintf(text, sizeof text, pendulum, gear);
  scene_write(folder, "model.xml", text);
  snprintf(text, sizeof text, rise, duration, horizon, goal);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%.250s/problem.xml", folder);
  cav_problem *p = cav_problem_load(path, NULL, &error);
  if (!CHECK(p != NULL)) fprintf(stderr, "    %s\n", error.text);
  return p;
}

// pendulums: easy, of free duration, impossible (to the least violation), and what has to swing
static void test_pendulums(const char *folder, int *reached) {
  static const struct {
    const char *gear, *duration, *horizon, *goal;
    cav_status expected;
  } cases[] = {{"10", "1", "", "1", CAV_OK},
               {"10", "1", "range='.3 2' weight='1'", "1", CAV_OK},
               {".05", "1", "", "1", CAV_NOT_CONVERGED},
               {"2.3", "3", "range='1 4' weight='.1'", "3", CAV_NOT_CONVERGED},
               {"2.3", "3", "", "3", CAV_NOT_CONVERGED}};
  for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
    cav_problem *p = load_pendulum(folder, cases[k].gear, cases[k].duration, cases[k].horizon, cases[k].goal);
    if (!p) continue;
    cav_strategy strategy[CAV_STRATEGIES];
    int n;
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
    test_goes_on(p, &strategy[0], k < 2 ? 1 : 8, folder, cases[k].expected, reached);
    cav_problem_free(p);
  }
}

// a strategy that solves under another order first
static void test_two_orders(const char *folder, int *reached) {
  cav_problem *p = load_pendulum(folder, "10", "1", "", "1");
  if (!p) return;
  p->order = CAV_ORDER_MOMENTUM;
  cav_strategy strategy[CAV_STRATEGIES];
  int n, i = 0;
  CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
  while (i < n && !strategy[i].first_midpoint) i++;
  if (CHECK(i < n)) test_goes_on(p, &strategy[i], 3, folder, CAV_OK, reached);
  cav_problem_free(p);
}

// --- interruption ---

static double clock_now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/// Asks for the end from a number of questions on, and measures how long the answer takes.
typedef struct asker {
  int questions, from;
  double since;
} asker;

static int ask(void *context) {
  asker *a = context;
  if (++a->questions < a->from) return 0;
  if (a->since == 0) a->since = clock_now();
  return 1;
}

static void test_stops(const cav_problem *p) {
  double worst = 0;
  asker all = {.from = INT_MAX}, before = all;
  cav_solve_options options = cav_solve_options_default();
  cav_error error = {0};
  cav_solution *s = NULL;
  options.stop = ask;
  // without gains, then with them
  for (int gains = 0; gains < 2; gains++) {
    options.gains = gains;
    options.stop_context = gains ? &all : &before;
    CHECK(cav_solve(p, &options, NULL, &s, &error) == CAV_OK);
    CHECK(s && !s->gain_q == !gains);
    cav_solution_free(s);
  }
  int chosen = all.questions - before.questions;
  for (int k = 0; k < 4; k++) {
    // twice before gains are chosen, and twice while they are
    asker a = {.from = 1 + (k < 2 ? before.questions * k / 2 : before.questions + chosen * (k - 2) / 2)};
    options.stop_context = &a;
    CHECK(cav_solve(p, &options, NULL, &s, &error) == CAV_INTERRUPTED);
    if (!CHECK(s && s->trajectory && s->nmultiplier > 0 && isfinite(s->cost))) continue;
    worst = fmax(worst, clock_now() - a.since);
    if (k < 2) CHECK(!s->gain_q && !s->gain_v);
    cav_solution_free(s);
  }
  printf("%s: asked %d times before gains are chosen, %d times there; an answer takes %.3f s at most\n", p->name,
         before.questions, chosen, worst);
#ifndef SANITIZED
  CHECK(worst < 0.5);
#endif
}

static void test_limits(const cav_problem *p, const char *folder) {
  cav_solve_options options = cav_solve_options_default();
  cav_error error = {0};
  cav_solution *s = NULL;
  options.max_iterations = 7;
  CHECK(cav_solve(p, &options, NULL, &s, &error) == CAV_INTERRUPTED);
  CHECK(s && s->iterations == 7 && !s->gain_q);
  cav_solution_free(s);
  options.max_iterations = 0;
  options.max_seconds = 1e-3;
  CHECK(cav_solve(p, &options, NULL, &s, &error) == CAV_INTERRUPTED);
  CHECK(s && s->iterations < 20);
  cav_solution_free(s);
  options.max_seconds = -1;
  CHECK(cav_solve(p, &options, NULL, &s, &error) == CAV_BAD_INPUT && !s);
  // a limit is of the call, not of what was done before a checkpoint
  options.max_seconds = 0;
  shelf kept = {.folder = folder, .stop_at = 5};
  options.keeper = keep, options.keeper_context = &kept;
  options.max_iterations = 0;
  CHECK(cav_solve(p, &options, NULL, &s, &error) == CAV_INTERRUPTED);
  int before = s ? s->iterations : 0;
  cav_solution_free(s);
  options.keeper = NULL, options.max_iterations = 3;
  char path[300];
  shelf_path(&kept, 5, path);
  cav_checkpoint *c = cav_checkpoint_read(path, p->model, &error);
  if (!CHECK(c && before >= 3)) return;
  options.resume = c;
  CHECK(cav_solve(p, &options, NULL, &s, &error) == CAV_INTERRUPTED);
  CHECK(s && s->iterations == before + 3);
  if (s) printf("stopped after %d iterations, resumed for %d more\n", before, s->iterations - before);
  cav_solution_free(s);
  cav_checkpoint_free(c);
}

// --- from near the optimum ---

static void test_warm(cav_problem *p) {
  cav_solve_options options = cav_solve_options_default();
  cav_error error = {0};
  cav_solution *cold = NULL, *warm = NULL;
  options.gains = 0;
  CHECK(cav_solve(p, &options, NULL, &cold, &error) == CAV_OK);
  if (!CHECK(cold && !cold->gain_q && cold->nmultiplier > 0)) return;
  cav_solve_options again = options;
  again.first_stage = p->schedule.stages + 1;
  again.nmultiplier = cold->nmultiplier;
  again.multiplier = cold->multiplier;
  // the same problem is at its optimum
  CHECK(cav_solve(p, &again, cold->trajectory, &warm, &error) == CAV_OK);
  if (CHECK(warm != NULL)) {
    CHECK(warm->iterations <= 2);
    CHECK_NEAR(warm->cost, cold->cost, 1e-5 * cold->cost);
  }
  cav_solution_free(warm);
  again.nmultiplier--;
  warm = NULL;
  CHECK(cav_solve(p, &again, cold->trajectory, &warm, &error) == CAV_BAD_INPUT && !warm);
  CHECK(strstr(error.text, "constraint rows") != NULL);
  cav_solution_free(cold);
}

// --- files ---

// a checkpoint's text with one piece of it replaced, or cut after so many bytes, is refused with its line
static void test_refusals(const cav_problem *p, const char *folder) {
  static const struct {
    const char *from, *to;
  } broken[] = {{"cavort_checkpoint,3", "cavort_checkpoint,2"},
                {"place,continuation", "place,nowhere"},
                {"order,", "ordre,"},
                {"nq,1", "nq,2"},
                {"q,1,", "q,2,"},
                {"\nend", ""},
                {"radius,", "radius,x"},
                {"stood,", "stood,x"},
                {"knots,", "knots,1"},
                {"multiplier,0,", "multiplier,0,nan,"},
                {"fraction,0", "fraction,2"}};
  shelf s = {.folder = folder, .stop_at = 0};
  cav_solve_options options = cav_solve_options_default();
  cav_error error = {0};
  cav_solution *solution = NULL;
  options.keeper = keep;
  options.keeper_context = &s;
  CHECK(cav_solve(p, &options, NULL, &solution, &error) == CAV_INTERRUPTED);
  cav_solution_free(solution);
  char path[300];
  shelf_path(&s, 0, path);
  FILE *file = fopen(path, "r");
  if (!CHECK(file != NULL)) return;
  static char text[100000], other[100100];
  size_t n = fread(text, 1, sizeof text - 1, file);
  fclose(file);
  text[n] = 0;
  for (size_t k = 0; k < sizeof broken / sizeof *broken; k++) {
    char *at = strstr(text, broken[k].from);
    if (!CHECK(at != NULL)) continue;
    snprintf(other, sizeof other, "%.*s%s%s", (int)(at - text), text, broken[k].to, at + strlen(broken[k].from));
    scene_write(folder, "broken.csv", other);
    snprintf(path, sizeof path, "%.250s/broken.csv", folder);
    error = (cav_error){0};
    if (!CHECK(!cav_checkpoint_read(path, p->model, &error) && error.line > 0))
      fprintf(stderr, "    %s for %s\n", broken[k].to, broken[k].from);
  }
  for (size_t cut = 0; cut < n; cut += n / 37 + 1) {
    snprintf(other, sizeof other, "%.*s", (int)cut, text);
    scene_write(folder, "broken.csv", other);
    CHECK(!cav_checkpoint_read(path, p->model, &error));
  }
  CHECK(!cav_checkpoint_read("/nowhere/checkpoint.csv", p->model, &error));
}

int main(void) {
  char folder[] = "/tmp/cavort-resume-XXXXXX";
  int reached[CAV_PLACE_TYPES] = {0};
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  test_pendulums(folder, reached);
  test_two_orders(folder, reached);
  // places that the cases above have to come to, lest this tests nothing
  CHECK(reached[CAV_PLACE_CONTINUATION] && reached[CAV_PLACE_SQP] && reached[CAV_PLACE_MULTIPLIERS] &&
        reached[CAV_PLACE_RESTORATION] && reached[CAV_PLACE_DIAGNOSIS] && reached[CAV_PLACE_FEEDBACK]);
  for (int i = 0; i < CAV_PLACE_TYPES; i++) printf("place %d: %d checkpoints\n", i, reached[i]);
  cav_problem *p = load_pendulum(folder, "10", "1", "", "1");
  if (p) {
    test_limits(p, folder);
    test_warm(p);
    test_refusals(p, folder);
    cav_problem_free(p);
  }
  static const motion_case walk = {"walker-walk", NULL};
  if ((p = motion_load(&walk))) {
#ifndef SANITIZED
    cav_strategy strategy[CAV_STRATEGIES];
    int n;
    CHECK(cav_strategy_list(p, strategy, &n) == CAV_OK);
    test_goes_on(p, &strategy[0], 60, folder, CAV_OK, reached);
#endif
    test_stops(p);
    cav_problem_free(p);
  }
  char command[300];
  snprintf(command, sizeof command, "rm -rf %s", folder);
  CHECK(system(command) == 0);
  return check_result();
}
