/// Problems at their bounds: minimum time, a singular arc, a constraint on the state that is active on an arc.
#include "optimum.h"

#define POINT(MASS, GEAR)                                                                         \
  "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='x' type='slide' axis='1 0 0'/>" \
  "<inertial pos='0 0 0' mass='" MASS                                                             \
  "' diaginertia='1 1 1'/></body></worldbody><actuator><motor joint='x' gear='" GEAR              \
  "' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>"

static const char unit[] = POINT("1", "1"), heavy[] = POINT("2", "50");
static const char unlimited[] =
    "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='x' type='slide' axis='1 0 0'/>"
    "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></worldbody><actuator><motor "
    "joint='x'/></actuator></mujoco>";

// ---------------------------------------------------------------- minimum time over 1 m, w T^2/2

static void build_fast(optimum_problem *p, double least, double most) {
  p->problem.duration_least = least;
  p->problem.duration_most = most;
  p->problem.duration_weight = 1;
  optimum_end(p, (double[]){1}, (double[]){0});
}

static void build_unit(optimum_problem *p, int n) {
  (void)n;
  build_fast(p, .5, 10);
}

static void build_heavy(optimum_problem *p, int n) {
  (void)n;
  build_fast(p, .1, 3);
}

// full force half way, then back: T = 2 sqrt(m/F)
static void fill_fast(int n, double mass, double force, optimum_truth *truth) {
  double T = 2 * sqrt(mass / force);
  truth->duration = T;
  truth->cost = T * T / 2;
  for (int t = 0; t <= n; t++) {
    double s = 2.0 * t / n;
    truth->q[t] = s < 1 ? s * s / 2 : 1 - (2 - s) * (2 - s) / 2;
    truth->u[t] = s < 1 ? force : s > 1 ? -force : 0;
  }
}

static void truth_unit(int n, optimum_truth *truth) { fill_fast(n, 1, 1, truth); }
static void truth_heavy(int n, optimum_truth *truth) { fill_fast(n, 2, 50, truth); }

// ---------------------------------------------------------------- singular arc: half of x^2 + v^2 over 5 s, |u| <= 1,
// from (0, 1)

static void build_singular(optimum_problem *p, int n) {
  (void)n;
  p->problem.v_start[0] = 1;
  optimum_cost(p, CAV_QUANTITY_CONFIGURATION, 1);
  optimum_cost(p, CAV_QUANTITY_VELOCITY, 1);
}

// u = -1 until the arc on which u = x: there x = a cosh(T-t), v = -a sinh(T-t), and the costate of v is zero
static void truth_singular(int n, optimum_truth *truth) {
  double T = 5, low = 1, high = 1.9;
  for (int i = 0; i < 200; i++) {
    double s = (low + high) / 2, x = s - s * s / 2, v = 1 - s;
    if (x * sinh(T - s) + v * cosh(T - s) > 0) {
      low = s;
    } else {
      high = s;
    }
  }
  double s = low, a = (s - s * s / 2) / cosh(T - s);
  truth->duration = T;
  // bang: integral of (t - t^2/2)^2 + (1-t)^2 over two; arc: a^2/2 times the integral of cosh(2 x)
  truth->cost = .5 * (s * s * s / 3 - s * s * s * s / 4 + s * s * s * s * s / 20) +
                (1 - (1 - s) * (1 - s) * (1 - s)) / 6 + a * a * sinh(2 * (T - s)) / 4;
  for (int i = 0; i <= n; i++) {
    double t = T * i / n;
    truth->q[i] = t < s ? t - t * t / 2 : a * cosh(T - t);
    truth->u[i] = t < s ? -1 : truth->q[i];
  }
}

// ---------------------------------------------------------------- x <= 1/9 from (0, 1) to (0, -1) in 1 s: Bryson and
// Denham

static const double ceiling = 1 / 9.0;

static void build_ceiling(optimum_problem *p, int n) {
  (void)n;
  p->problem.v_start[0] = 1;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_range(p, CAV_QUANTITY_CONFIGURATION, -INFINITY, ceiling);
  optimum_end(p, (double[]){0}, (double[]){-1});
}

// J = 4/(9 l); u = -2/(3 l) (1 - t/(3 l)) until 3 l, then 0, then the same backwards
static void truth_ceiling(int n, optimum_truth *truth) {
  double l = ceiling;
  truth->duration = 1;
  truth->cost = 4 / (9 * l);
  for (int i = 0; i <= n; i++) {
    double t = (double)i / n, r = fmin(t < .5 ? t : 1 - t, 3 * l) / (3 * l);
    truth->q[i] = l * (1 - (1 - r) * (1 - r) * (1 - r));
    truth->u[i] = -2 / (3 * l) * (1 - r);
  }
}

/// -dJ/dl = 4/(9 l^2): the sum of the bound's multipliers.
static double price_ceiling(const cav_problem *p, const cav_solution *s) {
  (void)p;
  double sum = 0, is = 4 / (9 * ceiling * ceiling);
  for (int i = 0; i < s->nrow; i++)
    if (s->row[i].kind == CAV_BINDING_TERM && s->row[i].object == 0) sum += s->row[i].multiplier;
  return fabs(sum - is) / is;
}

const optimum optimum_bounded[] = {
    {.name = "time",
     .text = "minimum time, bang-bang: 2 s",
     .model = unit,
     .duration = 4,
     .coarsest = 10,
     .build = build_unit,
     .truth = truth_unit,
     .cost = {.05, 1},
     .time = {.02, 1},
     .state = {.02, 1},
     .force = {.05, 1},
     .force_in_mean = 1},
    {.name = "time-heavy",
     .text = "minimum time, bang-bang: 2 kg, 50 N, 1 m, 0.4 s",
     .model = heavy,
     .duration = 1,
     .coarsest = 10,
     .build = build_heavy,
     .truth = truth_heavy,
     .cost = {.05, 1},
     .time = {.02, 1},
     .state = {.02, 1},
     .force = {.05, 1},
     .force_in_mean = 1},
    {.name = "singular",
     .text = "a bound, then a singular arc",
     .model = unit,
     .duration = 5,
     .coarsest = 20,
     .build = build_singular,
     .truth = truth_singular,
     .cost = {.05, 1},
     .state = {.05, 1},
     .force = {.02, 1},
     .force_in_mean = 1},
    {.name = "ceiling",
     .text = "a bound on the position that holds over an arc (Bryson and Denham)",
     .model = unlimited,
     .duration = 1,
     .coarsest = 18,
     .build = build_ceiling,
     .truth = truth_ceiling,
     .cost = {.05, 1},
     .state = {.05, 1},
     .force = {.05, 1},
     .multiplier = price_ceiling,
     .multiplier_error = {.05, 1}},
};
const int optimum_nbounded = sizeof optimum_bounded / sizeof *optimum_bounded;
