/// Problems of kinds that the other files have not: a terminal cost, motors that share their work, minimum time with
/// damping and with friction, bounds that are touched at a point or hold the speed, a free duration against gravity,
/// least fuel, a pendulum left to itself.
#include "optimum.h"

#define SLIDE(JOINT, MOTOR)                                                                                    \
  "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='x' type='slide' axis='1 0 0' " JOINT         \
  "/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></worldbody><actuator><motor joint='x' " MOTOR \
  "/></actuator></mujoco>"
#define UNIT "ctrllimited='true' ctrlrange='-1 1'"

static const char point[] = SLIDE("", ""), unit[] = SLIDE("", UNIT), damped[] = SLIDE("damping='1'", UNIT),
                  rubbed[] = SLIDE("frictionloss='.3'", UNIT);

// where an increasing function is zero
static double root_of(double (*f)(double), double low, double high) {
  for (int i = 0; i < 200; i++) {
    double middle = (low + high) / 2;
    if (f(middle) < 0) {
      low = middle;
    } else {
      high = middle;
    }
  }
  return low;
}

// ---------------------------------------------------------------- half of u^2, and 4/2 (x(T) - 1)^2: u = p (T - t)

static const double terminal_weight = 4;

static void build_terminal(optimum_problem *p, int n) {
  (void)n;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  cav_term *end = optimum_cost(p, CAV_QUANTITY_CONFIGURATION, terminal_weight);
  end->from = end->to = p->problem.duration;
  end->target = optimum_values(p, 1, (double[]){1});
}

static void truth_terminal(int n, optimum_truth *truth) {
  double T = 1.5, k = terminal_weight, p = k / (1 + k * T * T * T / 3), end = p * T * T * T / 3;
  truth->duration = T;
  truth->cost = p * p * T * T * T / 6 + k * (1 - end) * (1 - end) / 2;
  for (int i = 0; i <= n; i++) {
    double t = T * i / n;
    truth->q[i] = p * (T * t * t / 2 - t * t * t / 6);
    truth->u[i] = p * (T - t);
  }
}

// ---------------------------------------------------------------- two masses, driven by their sum and their difference

static const char shared[] =
    "<mujoco><option gravity='0 0 0'/><worldbody>"
    "<body><joint name='a' type='slide' axis='1 0 0'/><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body>"
    "<body><joint name='b' type='slide' axis='1 0 0'/><inertial pos='0 0 0' mass='2' diaginertia='1 1 1'/></body>"
    "</worldbody><tendon><fixed name='sum'><joint joint='a' coef='1'/><joint joint='b' coef='1'/></fixed>"
    "<fixed name='difference'><joint joint='a' coef='1'/><joint joint='b' coef='-1'/></fixed></tendon>"
    "<actuator><motor tendon='sum'/><motor tendon='difference'/></actuator></mujoco>";
static const double shared_way[2] = {1, -.5};

static void build_shared(optimum_problem *p, int n) {
  (void)n;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_end(p, shared_way, (double[]){0, 0});
}

// f_1 = (u_1 + u_2)/2, f_2 = (u_1 - u_2)/2: half of the effort of motors on the joints
static void truth_shared(int n, optimum_truth *truth) {
  double T = 1.5;
  truth->duration = T;
  truth->cost = 0;
  for (int j = 0; j < 2; j++) {
    double mass = j + 1, way = shared_way[j];
    truth->cost += 3 * mass * mass * way * way / (T * T * T);
    for (int i = 0; i <= n; i++) {
      double s = (double)i / n;
      truth->q[2 * i + j] = way * s * s * (3 - 2 * s);
      truth->u[2 * i + j] = mass * way * 6 * (1 - 2 * s) / (T * T);
    }
  }
}

// ---------------------------------------------------------------- minimum time over 1 m with a damper, and with
// friction

static void build_fast(optimum_problem *p, int n) {
  (void)n;
  p->problem.duration_least = .5;
  p->problem.duration_most = 8;
  p->problem.duration_weight = 1;
  optimum_end(p, (double[]){1}, (double[]){0});
}

// way of full force until t, then back to rest: v = 1 - e^-t, then (1 + v) e^-s - 1
static double damped_way(double t) { return t - log(2 - exp(-t)) - 1; }

static void truth_damped(int n, optimum_truth *truth) {
  double t1 = root_of(damped_way, 0, 10), v1 = 1 - exp(-t1), x1 = t1 - v1, T = t1 + log(1 + v1);
  truth->duration = T;
  truth->cost = T * T / 2;
  for (int i = 0; i <= n; i++) {
    double t = T * i / n, s = t - t1;
    truth->q[i] = s < 0 ? t - 1 + exp(-t) : x1 + (1 + v1) * (1 - exp(-s)) - s;
    truth->u[i] = s < 0 ? 1 : -1;
  }
}

static void truth_rubbed(int n, optimum_truth *truth) {
  double go = .7, stop = 1.3, v = sqrt(2 / (1 / go + 1 / stop)), t1 = v / go, T = t1 + v / stop;
  truth->duration = T;
  truth->cost = T * T / 2;
  for (int i = 0; i <= n; i++) {
    double t = T * i / n;
    truth->q[i] = t < t1 ? go * t * t / 2 : 1 - stop * (T - t) * (T - t) / 2;
    truth->u[i] = t < t1 ? 1 : -1;
  }
}

// ---------------------------------------------------------------- x <= 0.2 from (0, 1) to (0, -1) in 1 s, touched once

static const double touched = .2;

static void build_touch(optimum_problem *p, int n) {
  (void)n;
  p->problem.v_start[0] = 1;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_range(p, CAV_QUANTITY_CONFIGURATION, -INFINITY, touched);
  optimum_end(p, (double[]){0}, (double[]){-1});
}

// two cubics that meet at the bound: J = 2 + 6 (1 - 4 l)^2 for l between 1/6 and 1/4
static void truth_touch(int n, optimum_truth *truth) {
  double l = touched, first = 24 * l - 8, middle = 4 - 24 * l;
  truth->duration = 1;
  truth->cost = 2 + 6 * (1 - 4 * l) * (1 - 4 * l);
  for (int i = 0; i <= n; i++) {
    double t = fmin(i, n - i) / n;
    truth->q[i] = t + first * t * t / 2 + (middle - first) * t * t * t / 3;
    truth->u[i] = first + (middle - first) * 2 * t;
  }
}

// ---------------------------------------------------------------- 1 m in 1 s from rest to rest at no more than 1.2 m/s

static const double fastest = 1.2;

static void build_speed(optimum_problem *p, int n) {
  (void)n;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  cav_term *bound = optimum_range(p, CAV_QUANTITY_VELOCITY, -fastest, fastest);
  bound->target = NULL;
  optimum_end(p, (double[]){1}, (double[]){0});
}

static void truth_speed(int n, optimum_truth *truth) {
  double v = fastest, t1 = 1.5 * (1 - 1 / v), a = 2 * v / t1;
  truth->duration = 1;
  truth->cost = a * a * t1 / 3;
  for (int i = 0; i <= n; i++) {
    double t = (double)i / n, s = fmin(t, 1 - t), r = fmin(s, t1), x;
    x = a * (r * r / 2 - r * r * r / (6 * t1)) + v * fmax(s - t1, 0);
    truth->q[i] = t <= .5 ? x : 1 - x;
    truth->u[i] = (t <= .5 ? 1 : -1) * a * (1 - r / t1);
  }
}

// ---------------------------------------------------------------- 1 m upwards against gravity, the duration free

static const char lifted[] =
    "<mujoco><worldbody><body><joint name='z' type='slide' axis='0 0 1'/><inertial pos='0 0 0' mass='1' diaginertia='1 "
    "1 1'/></body></worldbody><actuator><motor joint='z'/></actuator></mujoco>";

static void build_upwards(optimum_problem *p, int n) {
  (void)n;
  p->problem.duration_least = .2;
  p->problem.duration_most = 5;
  p->problem.duration_weight = 1;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_end(p, (double[]){1}, (double[]){0});
}

// g^2 T/2 + 6/T^3 + T^2/2
static double upwards_slope(double T) { return 9.81 * 9.81 / 2 - 18 / (T * T * T * T) + T; }

static void truth_upwards(int n, optimum_truth *truth) {
  double T = root_of(upwards_slope, .1, 5);
  truth->duration = T;
  truth->cost = 9.81 * 9.81 * T / 2 + 6 / (T * T * T) + T * T / 2;
  for (int i = 0; i <= n; i++) {
    double s = (double)i / n;
    truth->q[i] = s * s * (3 - 2 * s);
    truth->u[i] = 9.81 + 6 * (1 - 2 * s) / (T * T);
  }
}

// ---------------------------------------------------------------- least fuel: integral of |u| over 3 s, |u| <= 1

static const double fuel_scale = 1e-3;

static void build_fuel(optimum_problem *p, int n) {
  (void)n;
  cav_term *fuel = optimum_cost(p, CAV_QUANTITY_EFFORT, fuel_scale);
  fuel->norm = CAV_NORM_ABSOLUTE;
  fuel->scale = fuel_scale;
  optimum_end(p, (double[]){1}, (double[]){0});
}

// full force for t1 with t1 (T - t1) = 1, nothing, full force back
static void truth_fuel(int n, optimum_truth *truth) {
  double T = 3, t1 = (T - sqrt(T * T - 4)) / 2;
  truth->duration = T;
  truth->cost = 2 * t1;
  for (int i = 0; i <= n; i++) {
    double t = T * i / n, s = fmin(t, T - t), r = fmin(s, t1), x = r * r / 2 + t1 * fmax(s - t1, 0);
    truth->q[i] = t <= T / 2 ? x : 1 - x;
    truth->u[i] = s >= t1 ? 0 : t <= T / 2 ? 1 : -1;
  }
}

// ---------------------------------------------------------------- the same with a damper

static double damped_fuel_duration(void) { return 3.5; }

// v' = u - v, so the way is the integral of u: 1 = t1 - t2, and the second push ends the speed that is left: t2 = log(1 +
// v)
static double damped_fuel(double t1) {
  double T = damped_fuel_duration(), t2 = t1 - 1;
  return t2 - log(1 + (1 - exp(-t1)) * exp(-(T - t1 - t2)));
}

static void truth_damped_fuel(int n, optimum_truth *truth) {
  double T = damped_fuel_duration(), t1 = root_of(damped_fuel, 1, (T + 1) / 2), t2 = t1 - 1, v1 = 1 - exp(-t1);
  double v2 = v1 * exp(-(T - t1 - t2));
  truth->duration = T;
  truth->cost = t1 + t2;
  for (int i = 0; i <= n; i++) {
    double t = T * i / n, s = fmin(fmax(t - t1, 0), T - t1 - t2), r = fmax(t - (T - t2), 0), push = fmin(t, t1);
    truth->q[i] = push - 1 + exp(-push) + v1 * (1 - exp(-s)) + (1 + v2) * (1 - exp(-r)) - r;
    truth->u[i] = t < t1 ? 1 : t < T - t2 ? 0 : -1;
  }
}

// ---------------------------------------------------------------- fuel and duration: 3 times the integral of |u|, and
// T^2/2

static const double fuel_price = 3;

static void build_fuel_time(optimum_problem *p, int n) {
  build_fuel(p, n);
  p->term[0].weight *= fuel_price;
  p->problem.duration_least = 2;
  p->problem.duration_most = 8;
  p->problem.duration_weight = 1;
}

// T = t1 + 1/t1: the derivative of 2 price t1 + T^2/2
static double fuel_time_slope(double t1) { return 2 * fuel_price + (t1 + 1 / t1) * (1 - 1 / (t1 * t1)); }

static void truth_fuel_time(int n, optimum_truth *truth) {
  double t1 = root_of(fuel_time_slope, .1, 1), T = t1 + 1 / t1;
  truth->duration = T;
  truth->cost = 2 * fuel_price * t1 + T * T / 2;
  for (int i = 0; i <= n; i++) {
    double t = T * i / n, s = fmin(t, T - t), r = fmin(s, t1), x = r * r / 2 + t1 * fmax(s - t1, 0);
    truth->q[i] = t <= T / 2 ? x : 1 - x;
    truth->u[i] = s >= t1 ? 0 : t <= T / 2 ? 1 : -1;
  }
}

// ---------------------------------------------------------------- fuel and effort without a bound: u is the costate,
// shortened by 1

static void build_sparse(optimum_problem *p, int n) {
  build_fuel(p, n);
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
}

// u = a (1 - t/t1) until t1 = T a/(2 (a + 1)), nothing, and back: the way minus 1
static double sparse_way(double a) {
  double T = 3, t1 = T * a / (2 * (a + 1));
  return 2 * a * t1 * t1 / 3 + a * t1 / 2 * (T - 2 * t1) - 1;
}

static void truth_sparse(int n, optimum_truth *truth) {
  double T = 3, a = root_of(sparse_way, .1, 10), t1 = T * a / (2 * (a + 1));
  truth->duration = T;
  truth->cost = a * a * t1 / 3 + a * t1;
  for (int i = 0; i <= n; i++) {
    double t = T * i / n, s = fmin(t, T - t), r = fmin(s, t1);
    double x = a * (r * r / 2 - r * r * r / (6 * t1)) + a * t1 / 2 * fmax(s - t1, 0);
    truth->q[i] = t <= T / 2 ? x : 1 - x;
    truth->u[i] = (t <= T / 2 ? 1 : -1) * a * (1 - r / t1);
  }
}

// ---------------------------------------------------------------- a pendulum of 0.5 m swings to 1.5 rad: no effort, at
// its own period

static const char pendulum[] =
    "<mujoco><worldbody><body><joint name='pivot' axis='0 -1 0'/><inertial pos='0 0 -.5' mass='1' diaginertia='1e-6 "
    "1e-6 1e-6'/></body></worldbody><actuator><motor joint='pivot'/></actuator></mujoco>";
static const double swing = 1.5;

static void build_swing(optimum_problem *p, int n) {
  (void)n;
  p->problem.cycle.on = 1;
  p->problem.q_start[0] = p->problem.q_goal[0] = swing;
  p->problem.duration_least = .8;
  p->problem.duration_most = 4;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_fix(p, CAV_QUANTITY_CONFIGURATION, 0, &swing);
  optimum_fix(p, CAV_QUANTITY_CONFIGURATION, p->problem.duration / 2, (double[]){-swing});
}

// 2 pi/w over the mean of 1 and cos(A/2) of arithmetic and geometry
static void truth_swing(int n, optimum_truth *truth) {
  double a = 1, b = cos(swing / 2), w = sqrt(9.81 * .5 / (.25 + 1e-6));
  for (int i = 0; i < 20; i++) {
    double mean = (a + b) / 2;
    b = sqrt(a * b);
    a = mean;
  }
  truth->duration = 2 * M_PI / w / a;
  truth->cost = 0;
  for (int i = 0; i <= n; i++) truth->q[i] = NAN, truth->u[i] = 0;
}

const optimum optimum_further[] = {
    {.name = "terminal",
     .text = "a cost at the end",
     .model = point,
     .duration = 1.5,
     .coarsest = 10,
     .build = build_terminal,
     .truth = truth_terminal,
     .cost = {.02, 1},
     .state = {.02, 1},
     .force = {.02, 1},
     .quadratic = 1},
    {.name = "shared",
     .text = "two masses, driven by their sum and their difference",
     .model = shared,
     .duration = 1.5,
     .coarsest = 10,
     .build = build_shared,
     .truth = truth_shared,
     .cost = {2e-4, 2},
     .state = {.01, 1},
     .force = {.02, 1},
     .quadratic = 1},
    {.name = "time-damped",
     .text = "minimum time with a damper",
     .model = damped,
     .duration = 4,
     .coarsest = 10,
     .build = build_fast,
     .truth = truth_damped,
     .cost = {.05, 1},
     .time = {.02, 1},
     .state = {.02, 1},
     .force = {.05, 1},
     .force_in_mean = 1},
    {.name = "time-friction",
     .text = "minimum time with friction of the joint",
     .model = rubbed,
     .duration = 4,
     .coarsest = 10,
     .build = build_fast,
     .truth = truth_rubbed,
     // the law of friction is a soft one: what it misses does not fall with the step
     .cost = {.02, 0},
     .time = {.01, 0},
     .state = {.05, 0},
     .force = {.05, 1},
     .force_in_mean = 1},
    {.name = "touch",
     .text = "a bound on the position that is touched at a point",
     .model = point,
     .duration = 1,
     .coarsest = 10,
     .build = build_touch,
     .truth = truth_touch,
     .cost = {.05, 1},
     .state = {.05, 1},
     .force = {.05, 1}},
    {.name = "speed",
     .text = "a bound on the velocity",
     .model = point,
     .duration = 1,
     .coarsest = 12,
     .build = build_speed,
     .truth = truth_speed,
     .cost = {.05, 1},
     .state = {.05, 1},
     .force = {.05, 1}},
    {.name = "upwards",
     .text = "least effort and duration against gravity",
     .model = lifted,
     .duration = 2,
     .coarsest = 10,
     .build = build_upwards,
     .truth = truth_upwards,
     .cost = {2e-4, 2},
     .time = {2e-3, 2},
     .state = {.01, 1},
     .force = {.02, 1}},
    {.name = "fuel",
     .text = "least fuel: force, nothing, force back",
     .model = unit,
     .duration = 3,
     .coarsest = 12,
     .build = build_fuel,
     .truth = truth_fuel,
     .cost = {.05, 1},
     .state = {.05, 1},
     .force = {.05, 1},
     .force_in_mean = 1},
    {.name = "fuel-damped",
     .text = "least fuel with a damper: two pushes of unequal length",
     .model = damped,
     .duration = 3.5,
     .coarsest = 14,
     .build = build_fuel,
     .truth = truth_damped_fuel,
     .cost = {.05, 1},
     .state = {.05, 1},
     .force = {.05, 1},
     .force_in_mean = 1},
    {.name = "fuel-time",
     .text = "least fuel and duration",
     .model = unit,
     .duration = 3,
     .coarsest = 12,
     .build = build_fuel_time,
     .truth = truth_fuel_time,
     // the norm is a thousandth less than |u|, which does not fall with the step
     .cost = {5e-3, 0},
     .time = {.05, 1},
     .state = {.05, 1},
     .force = {.05, 1},
     .force_in_mean = 1},
    {.name = "sparse",
     .text = "least fuel and effort: nothing is done for a while",
     .model = point,
     .duration = 3,
     .coarsest = 12,
     .build = build_sparse,
     .truth = truth_sparse,
     .cost = {5e-3, 0},
     .state = {.05, 1},
     .force = {.05, 1}},
    {.name = "swing",
     .text = "cycle: a pendulum that swings by itself, its period free",
     .model = pendulum,
     .duration = 1.6,
     .coarsest = 12,
     .build = build_swing,
     .truth = truth_swing,
     .cost = {1e-6, 0},
     .time = {1e-3, 2}},
};
const int optimum_nfurther = sizeof optimum_further / sizeof *optimum_further;
