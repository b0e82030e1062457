/// The whole way, problem file to certificate: the project's motions on its own humanoid and, where they are, on models
/// that no one here wrote. Each is certified, close to what its folder says to expect, its derivatives pass Ipopt's
/// checker at the solution, and a motion spoilt afterwards is not certified. Then what cav_solve guarantees: the same
/// bits at 1 and 2 threads, an end when the observer asks with the best iterate kept, and refusal of what makes no
/// sense.
#include "lanes.h"
#include "motion.h"

// --- expected.json: flat, one "name": number or word a line ---

static char expected[20000];

static int read_expected(const char *motion) {
  char path[4200];
  motion_file(path, motion, "expected.json");
  FILE *file = fopen(path, "r");
  size_t n = file ? fread(expected, 1, sizeof expected - 1, file) : 0;
  if (file) fclose(file);
  expected[n] = 0;
  return n > 0;
}

// where the value of a name stands; NULL if the file lacks it
static const char *find_value(const char *name) {
  char quoted[100];
  snprintf(quoted, sizeof quoted, "\"%s\":", name);
  const char *at = strstr(expected, quoted);
  return at ? at + strlen(quoted) : NULL;
}

// value within [expected / factor, expected * factor], widened by slack to either side
static void compare(const char *name, double value, double factor, double slack) {
  const char *at = find_value(name);
  double number = at ? strtod(at, NULL) : NAN;
  if (CHECK(value <= number * factor + slack && value >= number / factor - slack)) return;
  fprintf(stderr, "    %s: %g, expected %g\n", name, value, number);
}

// factors are what one more or one less correction on the way may change; a different method belongs in a new record
static void compare_expected(const cav_verdict *verdict) {
  const char *certified = find_value("certified");
  CHECK(certified && !strncmp(certified + strspn(certified, " "), "true", 4));
  compare("duration", verdict->duration, 1, 1e-9);
  compare("iterations", verdict->iterations, 2, 0);
  compare("penetration_max_m", verdict->penetration_max_m, 2, 1e-3);
  compare("momentum_defect_rms", verdict->momentum_defect_rms, 2, 1e-3);
  compare("slip_mean_m_s", verdict->slip_mean_m_s, 2, 5e-3);
  compare("closed_loop_end_error_m", verdict->closed_loop_end_error_m, 4, 0.1);
}

// --- motions ---

// one knot moved by a millimetre or a milliradian: forces that no one gives, and no certificate
static void check_spoilt(const cav_problem *problem, const cav_solution *s) {
  cav_trajectory *spoilt = cav_trajectory_copy(s->trajectory);
  cav_verdict verdict = {0};
  // the second dof of every model here is a root's translation
  int knot = spoilt->nknot / 2,
      second = problem->model->joint[0].type == CAV_JOINT_FREE ? 1 : problem->model->joint[1].q;
  spoilt->q[knot * spoilt->nq + second] += 1e-3;
  cav_trajectory_velocities(problem->model, spoilt);
  CHECK(cav_verify(problem, spoilt, &s->contact, s->gain_q, s->gain_v, &verdict, NULL) == CAV_OK);
  CHECK(!verdict.certified && verdict.unactuated_force_max > CAV_TOLERANCE_UNACTUATED && verdict.reason[0]);
  cav_trajectory_free(spoilt);
}

static void check_motion(const motion_case *c) {
  cav_problem *problem = motion_load(c);
  if (!problem) {
    printf("%-14s %-26s not tried: the shared models are absent\n", c->motion, c->model ? c->model : "");
    return;
  }
  cav_solution *s = NULL;
  cav_verdict verdict = {0};
  cav_error error = {0};
  cav_status status = cav_solve(problem, NULL, NULL, &s, &error);
  CHECK(s && status == CAV_OK);
  if (s) {
    CHECK(cav_verify(problem, s->trajectory, &s->contact, s->gain_q, s->gain_v, &verdict, &error) == CAV_OK);
    verdict.iterations = s->iterations;
    if (!verdict.certified) printf("%s on %s NOT certified: %s\n", c->motion, problem->model->name, verdict.reason);
    CHECK(verdict.certified);
    // the log is complete and ends where the solution does
    CHECK(s->nprogress == s->iterations && s->progress[s->nprogress - 1].iteration == s->iterations);
    CHECK(s->unactuated <= CAV_TOLERANCE_UNACTUATED || !verdict.certified);
    check_spoilt(problem, s);
    printf("%-14s %-26s %5.1f s %4d iterations  unactuated %.1e  momentum %.1e  penetration %.1f mm  end %.0f mm\n",
           c->motion, problem->model->name, s->seconds, s->iterations, verdict.unactuated_force_max,
           verdict.momentum_defect_rms, 1e3 * verdict.penetration_max_m, 1e3 * verdict.closed_loop_end_error_m);
#ifdef CAVORT_HAVE_IPOPT
    motion_findings found = motion_check_derivatives(problem, s->trajectory);
    CHECK(found.windows > 0 && found.silent == 0 && found.errors == 0);
    if (found.errors)
      fprintf(stderr, "    %s: %d entries differ, the worst by %g\n", c->motion, found.errors, found.worst);
#endif
    // expected.json is about the problem's own model
    if (!c->model && CHECK(read_expected(c->motion))) compare_expected(&verdict);
  }
  cav_solution_free(s);
  cav_problem_free(problem);
}

// --- requires ---

// squat-jump cut down to what takes a second: long enough to use every part of the solver
static cav_problem *load_short(void) {
  cav_problem *problem = motion_load(&motion_cases[0]);
  if (!problem) return NULL;
  problem->duration = 0.5;
  problem->schedule.stages = 3;
  // terms that lie beyond the end now
  int n = 0;
  for (int i = 0; i < problem->nterm; i++) {
    if (problem->term[i].from <= problem->duration) problem->term[n++] = problem->term[i];
  }
  problem->nterm = n;
  return problem;
}

// the same bits by one thread and two, and by the vectors of other processors
static void check_bits(const cav_problem *problem) {
  static const struct { int threads, lanes; } way[] = {{1, 8}, {2, 8}, {1, 4}, {2, 2}};
  enum { WAYS = sizeof way / sizeof *way };
  cav_solution *s[WAYS] = {NULL};
  for (int i = 0; i < WAYS; i++) {
    cav_solve_options options = cav_solve_options_default();
    options.threads = way[i].threads;
    lanes_most = way[i].lanes;
    cav_status status = cav_solve(problem, &options, NULL, &s[i], NULL);
    CHECK(s[i] && (status == CAV_OK || status == CAV_NOT_CONVERGED));
  }
  lanes_most = 8;
  for (int i = 1; i < WAYS && s[0] && s[i]; i++) {
    const cav_trajectory *a = s[0]->trajectory, *b = s[i]->trajectory;
    size_t gains = (size_t)(a->nknot - 1) * a->nv * a->nv;
    CHECK(!memcmp(a->q, b->q, (size_t)a->nknot * a->nq * sizeof *a->q));
    CHECK(!memcmp(a->u, b->u, (size_t)(a->nknot - 1) * a->nv * sizeof *a->u));
    CHECK(!memcmp(s[0]->gain_q, s[i]->gain_q, gains * sizeof(double)));
    CHECK(!memcmp(s[0]->gain_v, s[i]->gain_v, gains * sizeof(double)));
    CHECK(s[0]->iterations == s[i]->iterations && s[0]->cost == s[i]->cost);
  }
  for (int i = 0; i < WAYS; i++) cav_solution_free(s[i]);
}

/// What an observer sees, and after how many calls it asks for the end.
typedef struct watch {
  int calls, most, orderly;
  const char *last;
} watch;

static int observe(void *context, const cav_progress *progress) {
  watch *w = context;
  w->orderly &= progress->iteration == w->calls + 1 && isfinite(progress->cost) && progress->seconds >= 0;
  w->last = progress->phase;
  return ++w->calls == w->most;
}

static void check_interruption(const cav_problem *problem) {
  // at the first chance and later
  for (int most = 1; most <= 31; most += 15) {
    watch w = {.most = most, .orderly = 1};
    cav_solve_options options = cav_solve_options_default();
    options.observer = observe;
    options.observer_context = &w;
    cav_solution *s = NULL;
    CHECK(cav_solve(problem, &options, NULL, &s, NULL) == CAV_INTERRUPTED);
    CHECK(w.calls == most && w.orderly && s && s->iterations == most);
    if (s) {
      double sum = 0;
      for (int i = 0; i < s->trajectory->nknot * s->trajectory->nq; i++) sum += s->trajectory->q[i];
      // gains are not chosen for what was stopped
      CHECK(isfinite(sum) && !s->gain_q && !s->gain_v);
      CHECK(!memcmp(s->trajectory->q, problem->q_start, (size_t)problem->model->nq * sizeof(double)));
    }
    cav_solution_free(s);
  }
}

/// Asks for the end once the last phase has gone on for some iterations, and of those who ask for more, once there are gains.
typedef struct hurry {
  int how, in_phase, feedback, then;
} hurry;

static int see(void *context, const cav_progress *progress) {
  hurry *h = context;
  h->in_phase += !strcmp(progress->phase, "sqp");
  h->feedback += !strcmp(progress->phase, "feedback");
  return 0;
}

static int hurries(void *context) {
  const hurry *h = context;
  if (h->feedback > 0 && h->then) return h->then;
  return h->in_phase >= 3 ? h->how : 0;
}

// in the last phase, where rows do not hold at every iterate: who has some seconds gets a motion whose rows hold, gains and a
// certificate; who has not, the iterate; and who asks for more while gains are chosen, no more than that either
static void check_hurry(const cav_problem *problem) {
  static const hurry c[] = {
      {.how = CAV_STOP_SOON}, {.how = CAV_STOP_NOW}, {.how = CAV_STOP_SOON, .then = CAV_STOP_NOW}};
  for (int k = 0; k < 3; k++) {
    hurry h = c[k];
    cav_solve_options options = cav_solve_options_default();
    options.observer = see, options.stop = hurries;
    options.observer_context = options.stop_context = &h;
    cav_solution *s = NULL;
    CHECK(cav_solve(problem, &options, NULL, &s, NULL) == CAV_INTERRUPTED);
    if (!CHECK(s != NULL)) continue;
    CHECK(h.in_phase >= 3 && h.in_phase < 6 && (h.feedback > 0) == (k != 1) && h.feedback <= 8);
    CHECK((s->gain_q != NULL) == (k == 0));
    if (k == 0) {
      cav_verdict verdict;
      cav_error error = {0};
      CHECK(cav_verify_solution(problem, s, &verdict, &error) == CAV_OK && verdict.certified && verdict.achieved);
    }
    cav_solution_free(s);
  }
}

// a hop whose slip costs nothing slides by twice what a certificate allows: where such a motion is left its rows hold, it has no
// gains and took fewer iterations, and the reason is the same; one that is certified is the same to the bit
static void check_left(void) {
  char path[4200];
  motion_file(path, "hop", "problem.xml");
  cav_problem *problem = cav_problem_load(path, NULL, NULL);
  if (!CHECK(problem != NULL)) return;
  for (int slides = 0; slides < 2; slides++) {
    cav_solution *s[2] = {NULL, NULL};
    cav_verdict v[2];
    for (int i = 0; i < problem->nterm && slides; i++)
      if (problem->term[i].quantity == CAV_QUANTITY_SLIP) problem->term[i].weight = 0;
    for (int left = 0; left < 2; left++) {
      cav_solve_options options = cav_solve_options_default();
      options.leave_refused = left;
      CHECK(cav_solve(problem, &options, NULL, &s[left], NULL) == CAV_OK);
      if (!s[left] || !CHECK(cav_verify_solution(problem, s[left], &v[left], NULL) == CAV_OK)) continue;
      CHECK(v[left].certified == !slides && cav_verdict_feasible(&v[left]));
    }
    if (!s[0] || !s[1]) continue;
    const size_t bytes = (size_t)s[0]->trajectory->nknot * (size_t)problem->model->nq * sizeof(double);
    if (slides) {
      CHECK(v[0].slip_mean_m_s > 1.5 * CAV_TOLERANCE_SLIP && v[1].slip_mean_m_s > 1.5 * CAV_TOLERANCE_SLIP);
      CHECK(s[0]->gain_q && !s[1]->gain_q && s[1]->iterations < s[0]->iterations);
      CHECK(strstr(v[0].reason, "slip") && strstr(v[1].reason, "slip"));
    } else {
      CHECK(s[1]->gain_q && !memcmp(s[0]->trajectory->q, s[1]->trajectory->q, bytes));
    }
    for (int left = 0; left < 2; left++) cav_solution_free(s[left]);
  }
  cav_problem_free(problem);
}

static void refuse(const cav_problem *problem, const cav_solve_options *options, const cav_trajectory *start,
                   const char *word) {
  cav_solution *s = NULL;
  cav_error error = {0};
  CHECK(cav_solve(problem, options, start, &s, &error) == CAV_BAD_INPUT);
  if (!CHECK(s == NULL && strstr(error.text, word))) fprintf(stderr, "    '%s' lacks '%s'\n", error.text, word);
  cav_solution_free(s);
  CHECK(cav_solve(problem, options, start, &s, NULL) == CAV_BAD_INPUT);
}

static void check_refusals(const cav_problem *problem) {
  cav_problem bad = *problem;
  bad.model = NULL;
  refuse(&bad, NULL, NULL, "model");
  bad = *problem;
  bad.q_start = NULL;
  refuse(&bad, NULL, NULL, "start");
  bad = *problem;
  bad.timestep = 0;
  refuse(&bad, NULL, NULL, "timestep");
  bad.timestep = NAN;
  refuse(&bad, NULL, NULL, "timestep");
  bad = *problem;
  bad.duration = problem->timestep;
  refuse(&bad, NULL, NULL, "two steps");
  bad = *problem;
  bad.effort_limit = 1.5;
  refuse(&bad, NULL, NULL, "effort_limit");
  bad = *problem;
  bad.schedule.stages = 0;
  refuse(&bad, NULL, NULL, "schedule");
  cav_term term = problem->term[0];
  bad = *problem;
  bad.term = &term;
  bad.nterm = 1;
  term.scale = 0;
  refuse(&bad, NULL, NULL, "scale");
  term = (cav_term){.quantity = CAV_QUANTITY_GAP, .use = CAV_USE_EQUAL, .scale = 1, .to = -1, .component = -1};
  refuse(&bad, NULL, NULL, "constraint");

  cav_solve_options options = cav_solve_options_default();
  options.threads = 0;
  refuse(problem, &options, NULL, "threads");
  options = cav_solve_options_default();
  options.tolerance = -1;
  refuse(problem, &options, NULL, "tolerance");
  cav_trajectory *start = cav_trajectory_new(problem->model, 4, problem->timestep);
  refuse(problem, NULL, start, "does not fit");
  cav_trajectory_free(start);
}

int main(void) {
  cav_problem *problem = load_short();
  if (problem) {
    check_bits(problem);
    check_interruption(problem);
    check_hurry(problem);
    check_refusals(problem);
  }
  cav_problem_free(problem);
  check_left();
  for (int i = 0; i < MOTION_CASES; i++) check_motion(&motion_cases[i]);
  return check_result();
}
