/// How optimal the verifier says that a motion is, against the fraction of its cost that the optimum saves: motions moved off
/// known optima, motions that are optimal for another cost or another duration, multipliers that are wrong, and a
/// solver that minimises another cost than it says (calls are redirected by the linker).
#include "cavort/cavort.h"
#include "scene.h"
#include "transcription.h"

static double understated = 1; // what the solver takes of the weight of costs on velocities

double __real_cav_term_weight(const cav_transcription *transcription, const cav_term *term, int t);
double __wrap_cav_term_weight(const cav_transcription *transcription, const cav_term *term, int t);

double __wrap_cav_term_weight(const cav_transcription *transcription, const cav_term *term, int t) {
  double weight = __real_cav_term_weight(transcription, term, t);
  return term->quantity == CAV_QUANTITY_VELOCITY && term->use == CAV_USE_COST ? understated * weight : weight;
}

// ---------------------------------------------------------------- problems

enum { TERMS = 6, DOFS = 4 };

/// A problem with its storage: least effort between two states, unless more is added.
typedef struct bench {
  cav_model *model;
  cav_problem problem;
  cav_term term[TERMS];
  double start[DOFS], goal[DOFS], v_start[DOFS], q_end[DOFS], v_end[DOFS], table[64], times[64];
} bench;

static cav_term *add(bench *b, cav_term_use use, cav_quantity quantity) {
  cav_term *term = &b->term[b->problem.nterm++];
  *term = (cav_term){.name = "", .quantity = quantity, .use = use, .component = -1, .joint = -1, .to = -1, .scale = 1};
  term->weight = 1;
  term->lower = -INFINITY;
  term->upper = INFINITY;
  return term;
}

static int make(bench *b, const char *text, double duration, int steps) {
  *b = (bench){.model = scene_load(text)};
  if (!CHECK(b->model && b->model->nq <= DOFS)) return 0;
  b->problem = cav_problem_default(b->model);
  b->problem.duration = duration;
  b->problem.timestep = duration / steps;
  b->problem.close_at_rest = 0;
  b->problem.effort_limit = 1;
  b->problem.limit_margin = 0;
  b->problem.q_start = b->start, b->problem.q_goal = b->goal, b->problem.v_start = b->v_start;
  b->problem.term = b->term;
  add(b, CAV_USE_COST, CAV_QUANTITY_EFFORT);
  return 1;
}

// the state at the end, by the first dof's position; at rest
static void end_at(bench *b, double q0, double q1) {
  b->q_end[0] = b->goal[0] = q0;
  b->q_end[1] = b->goal[1] = q1;
  for (int k = 0; k < 2; k++) {
    cav_term *term = add(b, CAV_USE_EQUAL, k ? CAV_QUANTITY_VELOCITY : CAV_QUANTITY_CONFIGURATION);
    term->from = term->to = b->problem.duration;
    term->target = k ? b->v_end : b->q_end;
  }
}

static cav_solution *solve(const bench *b) {
  cav_solve_options options = cav_solve_options_default();
  cav_solution *solution = NULL;
  cav_error error = {0};
  cav_status status = cav_solve(&b->problem, &options, NULL, &solution, &error);
  if (!CHECK(status == CAV_OK)) fprintf(stderr, "    %s\n", error.text);
  return solution;
}

// how optimal a trajectory is by rows of a solution, and its cost; the problem's constraints are taken to hold
static double measure(const cav_problem *p, const cav_trajectory *at, const cav_options *law, int nrow,
                      const cav_binding *row, double *cost) {
  cav_verdict verdict = {0};
  cav_term_report report[TERMS];
  cav_error error = {0};
  int fine = cav_terms_report(p, at, law, report, &verdict.cost, &error) == CAV_OK;
  fine = fine && cav_verify_optimality(p, at, law, nrow, row, &verdict, &error) == CAV_OK;
  if (!CHECK(fine)) fprintf(stderr, "    %s\n", error.text);
  *cost = verdict.cost;
  return verdict.optimality;
}

static const char point[] =
    "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='x' type='slide' axis='1 0 0'/>"
    "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></worldbody><actuator><motor "
    "joint='x'/></actuator></mujoco>";
static const char limited[] =
    "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='x' type='slide' axis='1 0 0'/>"
    "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></worldbody><actuator><motor joint='x' "
    "ctrllimited='true' ctrlrange='-10 10'/></actuator></mujoco>";
static const char rod[] =
    "<mujoco><worldbody><body><joint name='pivot' axis='0 1 0' damping='.1'/><inertial pos='0 0 -.5' mass='1' "
    "diaginertia='.01 .01 .01'/></body></worldbody><actuator><motor joint='pivot'/></actuator></mujoco>";
static const char cart[] =
    "<mujoco><worldbody><body name='cart'><joint name='x' type='slide' axis='1 0 0' damping='.2'/>"
    "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><body name='pole'><joint name='pole' axis='0 -1 0'/>"
    "<inertial pos='0 0 -.5' mass='.3' diaginertia='.001 .001 .001'/></body></body></worldbody>"
    "<actuator><motor joint='x'/></actuator></mujoco>";
static const char oscillator[] =
    "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='x' type='slide' axis='1 0 0' stiffness='4' "
    "damping='.3'/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></worldbody><actuator><motor "
    "joint='x'/></actuator></mujoco>";

// ---------------------------------------------------------------- motions moved off an optimum

/// What is said of a motion over the fraction of its cost that is too much has to lie between least and most. The
/// verifier's least is 1e-9. Where the duration is free its model is half as curved as the cost.
static void judge(const char *what, double is, double excess, double least, double most) {
  printf("%-44s excess %.3e, by the verifier %.3e, ratio %.3f\n", what, excess, is, is / excess);
  if (!CHECK(is >= least * excess && is <= most * excess)) fprintf(stderr, "    %s\n", what);
}

// moves the first dof by size times a bump that leaves both ends as they are, and the others not at all
static void bump(const cav_trajectory *from, double size, int waves, cav_trajectory *to) {
  int n = from->nknot - 2;
  memcpy(to->q, from->q, (size_t)(from->nknot * from->nq) * sizeof(double));
  for (int t = 1; t < n; t++) to->q[t * from->nq] += size * sin(waves * M_PI * t / n) * sin(M_PI * t / n);
}

// excess grows with the square of the distance, and so does what is said of it
static void check_moved(bench *b, const char *what, const double size[3], double least, double most) {
  cav_solution *s = solve(b);
  if (!s) return;
  cav_trajectory *moved = cav_trajectory_copy(s->trajectory);
  double best, cost;
  double is = measure(&b->problem, s->trajectory, &s->contact, s->nrow, s->row, &best);
  printf("%s: optimum %.9g, optimal to %.1e\n", what, best, is);
  CHECK(is < 1e-7);
  for (int i = 0; i < 6; i++) {
    bump(s->trajectory, size[i % 3], 1 + i / 3, moved);
    is = measure(&b->problem, moved, &s->contact, s->nrow, s->row, &cost);
    judge(what, is, 1 - best / cost, least, most);
  }
  cav_trajectory_free(moved);
  cav_solution_free(s);
}

static void test_moved(void) {
  bench b;
  // linear: the model is the cost itself
  if (make(&b, point, 1.5, 30)) {
    end_at(&b, 1, 0);
    check_moved(&b, "least effort", (double[]){1e-4, 1e-3, 1e-2}, 0.998, 1.01);
  }
  cav_model_free(b.model);
  if (make(&b, rod, 1.2, 40)) {
    end_at(&b, 2, 0);
    check_moved(&b, "rod against gravity", (double[]){1e-4, 1e-3, 1e-2}, 0.5, 2);
  }
  cav_model_free(b.model);
  if (make(&b, oscillator, 2.5, 25)) {
    b.problem.cycle.on = 1;
    cav_term *track = add(&b, CAV_USE_COST, CAV_QUANTITY_VELOCITY);
    for (int t = 0; t <= 25; t++) b.times[t] = 0.1 * t, b.table[t] = cos(2 * M_PI * (t - .5) / 25);
    track->weight = 5;
    track->target = b.table, track->waypoint_time = b.times, track->nwaypoint = 26;
    check_moved(&b, "oscillator, cycle", (double[]){1e-4, 1e-3, 1e-2}, 0.998, 1.01);
  }
  cav_model_free(b.model);
}

// the optimum for one weight of velocities under another one; the pole is driven by nothing
static void test_other_cost(void) {
  static const double weight[] = {1.01, 1.1, 1.5};
  bench b;
  if (!make(&b, cart, 1.5, 40)) return;
  cav_term *rate = add(&b, CAV_USE_COST, CAV_QUANTITY_VELOCITY);
  end_at(&b, 1, 0);
  cav_solution *s = solve(&b);
  for (int i = 0; i < 3 && s; i++) {
    double best, cost, is;
    rate->weight = weight[i];
    cav_solution *other = solve(&b);
    if (other) {
      is = measure(&b.problem, other->trajectory, &other->contact, other->nrow, other->row, &best);
      CHECK(is < 1e-7);
      is = measure(&b.problem, s->trajectory, &s->contact, s->nrow, s->row, &cost);
      judge("cart and pole, other weights", is, 1 - best / cost, 0.5, 2);
    }
    cav_solution_free(other);
  }
  cav_solution_free(s);
  cav_model_free(b.model);
}

// the optimum of a fixed duration where the duration is free: 6/T^3 + w/2 T^2 is least at T = (18/w)^(1/5)
static void test_other_duration(void) {
  static const double factor[] = {1.01, 1.05, 0.95, 1.2};
  double best_T = pow(18, 0.2);
  bench b;
  if (!make(&b, point, best_T, 60)) return;
  for (int i = 0; i < 4; i++) {
    double T = best_T * factor[i], cost;
    b.problem.nterm = 1;
    b.problem.duration = T;
    b.problem.timestep = T / 60;
    b.problem.duration_most = 0;
    end_at(&b, 1, 0);
    cav_solution *s = solve(&b);
    if (!s) continue;
    b.problem.duration_least = 0.5, b.problem.duration_most = 5, b.problem.duration_weight = 1;
    double is = measure(&b.problem, s->trajectory, &s->contact, s->nrow, s->row, &cost);
    double excess = 1 - (6 / pow(best_T, 3) + best_T * best_T / 2) / (6 / (T * T * T) + T * T / 2);
    judge("other duration", is, excess, 0.5, 4);
    // at the end of a range that ends here, it is optimal if it would go further, and not if it would come back
    b.problem.duration_most = T;
    is = measure(&b.problem, s->trajectory, &s->contact, s->nrow, s->row, &cost);
    if (factor[i] < 1) {
      CHECK(is < 1e-7);
    } else {
      judge("other duration, longest", is, excess, 0.5, 4);
    }
    b.problem.duration_most = 5, b.problem.duration_least = T;
    is = measure(&b.problem, s->trajectory, &s->contact, s->nrow, s->row, &cost);
    if (factor[i] > 1) {
      CHECK(is < 1e-7);
    } else {
      judge("other duration, shortest", is, excess, 0.5, 4);
    }
    cav_solution_free(s);
  }
  cav_model_free(b.model);
}

// ---------------------------------------------------------------- multipliers that are wrong

// rows with their multipliers times factor, and each further by a random part of it
static cav_binding *spoil(const cav_solution *s, double factor, double part) {
  cav_binding *row = malloc(((size_t)s->nrow + 1) * sizeof *row);
  for (int i = 0; i < s->nrow; i++) {
    row[i] = s->row[i];
    row[i].multiplier *= factor * (1 + part * (2 * scene_uniform() - 1));
  }
  return row;
}

// bounds that hold the motion: a ceiling on the position, and the actuator's own limit
static void test_multipliers(void) {
  for (int limit = 0; limit < 2; limit++) {
    bench b;
    double cost;
    if (!make(&b, limited, 1, 36)) return;
    if (limit) {
      b.problem.effort_limit = 0.5;
    } else {
      b.v_start[0] = 1;
      cav_term *ceiling = add(&b, CAV_USE_RANGE, CAV_QUANTITY_CONFIGURATION);
      ceiling->target = b.model->q0;
      ceiling->upper = 1 / 9.0;
    }
    end_at(&b, limit ? 1 : 0, 0);
    if (!limit) b.v_end[0] = -1;
    cav_solution *s = solve(&b);
    if (!s) return;
    double is = measure(&b.problem, s->trajectory, &s->contact, s->nrow, s->row, &cost);
    printf("%s: optimal to %.1e with the solver's multipliers\n", limit ? "limit" : "ceiling", is);
    CHECK(is < 1e-7);
    static const struct {
      double factor, part, least;
    } wrong[] = {{0, 0, 1e-3}, {-1, 0, 1e-2}, {1.1, 0, 1e-5}, {0.9, 0, 1e-5}, {2, 0, 1e-3}, {1, 0.1, 1e-4}};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
      cav_binding *row = spoil(s, wrong[i].factor, wrong[i].part);
      is = measure(&b.problem, s->trajectory, &s->contact, s->nrow, row, &cost);
      printf("    multipliers times %g, at random by %g: %.1e\n", wrong[i].factor, wrong[i].part, is);
      CHECK(is > wrong[i].least);
      free(row);
    }
    is = measure(&b.problem, s->trajectory, &s->contact, 0, NULL, &cost);
    CHECK(is > 1e-3);
    cav_solution_free(s);
    cav_model_free(b.model);
  }
}

/// A body of 1 kg that bounds of every kind hold.
#define SWUNG(JOINT, MORE, ACTUATOR)                                                                     \
  "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='x' type='slide' axis='1 0 0' " JOINT   \
  "/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></worldbody>" MORE "<actuator>" ACTUATOR \
  "</actuator></mujoco>"

// what a solver finds at its bounds is optimal by its multipliers, and not without them
static void judge_bounds(const bench *b, const char *what) {
  double cost;
  cav_solution *s = solve(b);
  if (!s) return;
  double is = measure(&b->problem, s->trajectory, &s->contact, s->nrow, s->row, &cost);
  double bare = measure(&b->problem, s->trajectory, &s->contact, 0, NULL, &cost);
  printf("%-30s optimal to %.1e, without multipliers %.1e\n", what, is, bare);
  CHECK(is < 1e-6 && bare > 1e-3);
  CHECK_NEAR(cost, s->cost, 1e-12 * cost);
  cav_solution_free(s);
}

static void test_bounds(void) {
  static const struct {
    const char *what, *model;
    double margin, fraction;
  } kind[] = {
      {"range of a joint", SWUNG("limited='true' range='-1 .25'", "", "<motor joint='x'/>"), 0.05, 1},
      {"range of a tendon",
       SWUNG("", "<tendon><fixed limited='true' range='-1 .45'><joint joint='x' coef='2'/></fixed></tendon>",
             "<motor joint='x'/>"),
       0.05, 1},
      {"motor behind a gear", SWUNG("", "", "<motor joint='x' gear='4' ctrllimited='true' ctrlrange='-1.1 1.1'/>"), 0,
       0.5},
      {"force of a servo", SWUNG("", "", "<position joint='x' kp='3' forcelimited='true' forcerange='-4.4 4.4'/>"), 0,
       0.5},
      {"control of a servo",
       SWUNG("", "", "<position joint='x' kp='3' gear='2' ctrllimited='true' ctrlrange='-1.74 1.74'/>"), 0, 0.9},
      {"force of a servo with limits of both",
       SWUNG("", "",
             "<position joint='x' kp='3' ctrllimited='true' ctrlrange='-9 7' forcelimited='true' forcerange='-4.4 "
             "4.4'/>"),
       0, 0.5},
      {"control of a servo with limits of both, not about 0",
       SWUNG("", "",
             "<position joint='x' kp='3' gear='2' ctrllimited='true' ctrlrange='-1.725 1.425' forcelimited='true' "
             "forcerange='-50 50'/>"),
       0, 0.9},
  };
  for (size_t i = 0; i < sizeof kind / sizeof *kind; i++) {
    bench b;
    if (!make(&b, kind[i].model, 1.5, 30)) return;
    b.problem.limit_margin = kind[i].margin;
    b.problem.effort_limit = kind[i].fraction;
    // ranges: thrown and back; actuators: from rest to rest
    b.v_start[0] = kind[i].margin > 0;
    end_at(&b, kind[i].margin == 0, 0);
    b.v_end[0] = -b.v_start[0];
    judge_bounds(&b, kind[i].what);
    cav_model_free(b.model);
  }
}

// half a stride of two bodies, of which one may not go as far as the other: so neither may
static void test_counterparts(void) {
  static const char pair[] =
      "<mujoco><option gravity='0 0 0'/><worldbody>"
      "<body pos='0 1 0'><joint name='left' type='slide' axis='1 0 0' stiffness='4' limited='true' range='-.5 .5'/>"
      "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body>"
      "<body pos='0 -1 0'><joint name='right' type='slide' axis='1 0 0' stiffness='4' limited='true' range='-.2 .3'/>"
      "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></worldbody>"
      "<actuator><motor joint='left'/><motor joint='right'/></actuator></mujoco>";
  bench b;
  if (!make(&b, pair, 1.25, 20)) return;
  b.problem.cycle = (cav_cycle){.on = 1, .mirror = CAV_MIRROR_Y};
  cav_term *track = add(&b, CAV_USE_COST, CAV_QUANTITY_VELOCITY);
  for (int t = 0; t <= 20; t++) {
    b.times[t] = 1.25 * t / 20;
    b.table[2 * t] = cos(M_PI * (t - .5) / 20);
    b.table[2 * t + 1] = -b.table[2 * t];
  }
  track->weight = 5;
  track->target = b.table, track->waypoint_time = b.times, track->nwaypoint = 21;
  judge_bounds(&b, "range of a counterpart");
  cav_model_free(b.model);
}

// no multipliers make a motion look better than it is
static void test_lies(void) {
  bench b;
  double best, cost, least = INFINITY;
  if (!make(&b, limited, 1, 36)) return;
  b.problem.effort_limit = 0.5;
  end_at(&b, 1, 0);
  cav_solution *s = solve(&b);
  if (!s) return;
  measure(&b.problem, s->trajectory, &s->contact, s->nrow, s->row, &best);
  // optimal for a lower limit: within the limits, at none of them
  b.problem.effort_limit = 0.45;
  cav_solution *other = solve(&b);
  b.problem.effort_limit = 0.5;
  for (int i = 0; i < 200 && other; i++) {
    cav_binding *row = spoil(i % 2 ? s : other, i < 2 ? 1 : pow(10, 4 * scene_uniform() - 2), i < 2 ? 0 : 1);
    double is = measure(&b.problem, other->trajectory, &other->contact, i % 2 ? s->nrow : other->nrow, row, &cost);
    least = fmin(least, is);
    free(row);
  }
  printf("200 sets of multipliers: at least %.3e, excess %.3e\n", least, 1 - best / cost);
  CHECK(least > 0.999 * (1 - best / cost));
  cav_solution_free(s);
  cav_solution_free(other);
  cav_model_free(b.model);
}

// a solver that takes a cost for less than it weighs says that it is done; the verifier says what it left
static void test_dishonest(void) {
  bench b;
  if (!make(&b, cart, 1.5, 40)) return;
  add(&b, CAV_USE_COST, CAV_QUANTITY_VELOCITY)->weight = 2;
  end_at(&b, 1, 0);
  cav_solution *honest = solve(&b);
  understated = 0.25;
  cav_solution *s = solve(&b);
  understated = 1;
  if (s && honest) {
    double best, cost;
    double is = measure(&b.problem, s->trajectory, &s->contact, s->nrow, s->row, &cost);
    double good = measure(&b.problem, honest->trajectory, &honest->contact, honest->nrow, honest->row, &best);
    printf("dishonest: the solver says %.1e, the verifier %.1e\n", s->optimality, is);
    CHECK(s->optimality < 1e-7 && good < 1e-7);
    judge("dishonest", is, 1 - best / cost, 0.5, 2);
  }
  cav_solution_free(s);
  cav_solution_free(honest);
  cav_model_free(b.model);
}

// a motion that is not feasible has no optimality; one whose cost is nothing is optimal
static void test_edges(void) {
  bench b;
  if (!make(&b, point, 1, 10)) return;
  cav_solution *s = solve(&b);
  cav_error error = {0};
  cav_verdict verdict = {.constraint_violation_max = 1};
  if (s) {
    CHECK(cav_verify_optimality(&b.problem, s->trajectory, &s->contact, 0, NULL, &verdict, &error) == CAV_OK);
    CHECK(isnan(verdict.optimality) && !cav_verdict_optimal(&verdict));
    verdict.constraint_violation_max = 0;
    CHECK(cav_verify_optimality(&b.problem, s->trajectory, &s->contact, 0, NULL, &verdict, &error) == CAV_OK);
    CHECK(verdict.optimality < 1e-7 && cav_verdict_optimal(&verdict));
    // what cannot be verified is told
    b.problem.timestep = 0.05;
    CHECK(cav_verify_optimality(&b.problem, s->trajectory, &s->contact, 0, NULL, &verdict, &error) == CAV_BAD_INPUT);
    CHECK(isnan(verdict.optimality) && *error.text);
  }
  cav_solution_free(s);
  cav_model_free(b.model);
}

// pushed about by a force over its scale that is nothing to a residual, or something, or nothing that weighs much, where rest
// costs nothing
static void test_near_nothing(void) {
  for (int k = 0; k < 3; k++) {
    bench b;
    double cost = NAN, scale = 1, push = k == 1 ? 1e-3 : 5e-6, h = 0.1;
    if (!make(&b, point, 1, 10)) return;
    b.term[0].weight = k == 2 ? 1e9 : 1000, b.term[0].scale = scale;
    cav_solution *s = solve(&b);
    for (int t = 1; s && t <= 10; t++) {
      double *q = s->trajectory->q, *v = s->trajectory->v;
      v[t] = v[t - 1] + (t & 1 ? push : -push) * h;
      q[t] = q[t - 1] + h * v[t];
    }
    double is = s ? measure(&b.problem, s->trajectory, &s->contact, 0, NULL, &cost) : NAN;
    printf("nearly no cost: %.2e, of which a step may save %.2e\n", cost, is);
    CHECK(k ? is > 0.5 : cost > 1e-9 && is < CAV_TOLERANCE_OPTIMAL);
    cav_solution_free(s);
    cav_model_free(b.model);
  }
}

// a ball that slides along the side of a slab whose middle is at a height
static int make_sliding(bench *b, double height) {
  char text[600];
  snprintf(text, sizeof text,
           "<mujoco><option gravity='0 0 0'/><worldbody><geom type='box' pos='1 0 %.17g' size='.2 .2 .03'/>"
           "<body pos='.7 0 0'><joint name='x' type='slide' axis='1 0 0'/><joint name='z' type='slide' axis='0 0 1'/>"
           "<geom type='sphere' size='.1' mass='1'/></body></worldbody>"
           "<actuator><motor joint='x'/><motor joint='z'/></actuator></mujoco>",
           height);
  if (!make(b, text, 0.4, 10)) return 0;
  add(b, CAV_USE_COST, CAV_QUANTITY_EDGE_FORCE)->weight = 10;
  add(b, CAV_USE_COST, CAV_QUANTITY_VELOCITY)->weight = 10;
  b->start[0] = b->goal[0] = 1e-4;
  b->start[1] = -0.01;
  end_at(b, b->start[0], 0.01);
  return 1;
}

// What is said of its motion is the same with the slab's middle, where the nearness of its edges begins, at a knot and a
// nanometre beside it, where a row more would be read.
static void test_edge_begins(void) {
  bench b;
  if (!make_sliding(&b, 0)) return;
  cav_solution *s = solve(&b);
  cav_model_free(b.model);
  double is[3], cost = NAN;
  for (int k = 0; s && k < 3; k++) {
    if (!make_sliding(&b, s->trajectory->q[5 * 2 + 1] + (k - 1) * 1e-9)) break;
    is[k] = measure(&b.problem, s->trajectory, &s->contact, 0, NULL, &cost);
    printf("%g nm from where an edge begins: cost %.6f, optimal to %.4e\n", k - 1.0, cost, is[k]);
    CHECK(is[k] > 0 && is[k] < 1 && fabs(is[k] - is[0]) < 1e-3 * is[0]);
    cav_model_free(b.model);
  }
  cav_solution_free(s);
}

int main(void) {
  test_edge_begins();
  test_near_nothing();
  test_moved();
  test_other_cost();
  test_other_duration();
  test_multipliers();
  test_bounds();
  test_counterparts();
  test_lies();
  test_dishonest();
  test_edges();
  return check_result();
}
