/// Problems without bounds: linear-quadratic ones, least effort with a fixed and with a free duration, a spline, a
/// rotation, and an oscillator that tracks a sine for ever.
#include "optimum.h"

// ---------------------------------------------------------------- linear systems: x' = A x + B u, least integral of
// u^2/2

enum { LINEAR_MOST = 8 };

typedef struct linear {
  int n, m; ///< states, inputs
  double A[LINEAR_MOST][LINEAR_MOST], B[LINEAR_MOST][LINEAR_MOST], from[LINEAR_MOST], to[LINEAR_MOST], duration;
} linear;

// x' = A x + B u, p' = -A' p, u = B' p, from x and p over dt by classical Runge-Kutta steps
static void rate(const linear *s, const double *x, double *dx) {
  const double *p = x + s->n;
  for (int i = 0; i < s->n; i++) {
    dx[i] = dx[s->n + i] = 0;
    for (int j = 0; j < s->n; j++) {
      dx[i] += s->A[i][j] * x[j];
      dx[s->n + i] -= s->A[j][i] * p[j];
      for (int k = 0; k < s->m; k++) dx[i] += s->B[i][k] * s->B[j][k] * p[j];
    }
  }
}

static void advance(const linear *s, double dt, double *x) {
  enum { STEPS = 50 };
  double k[4][2 * LINEAR_MOST], y[2 * LINEAR_MOST], h = dt / STEPS;
  for (int step = 0; step < STEPS; step++) {
    for (int stage = 0; stage < 4; stage++) {
      double fraction = stage == 0 ? 0 : stage == 3 ? h : h / 2;
      for (int i = 0; i < 2 * s->n; i++) y[i] = x[i] + (stage ? fraction * k[stage - 1][i] : 0);
      rate(s, y, k[stage]);
    }
    for (int i = 0; i < 2 * s->n; i++) x[i] += h / 6 * (k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]);
  }
}

// solves M x = b by elimination with pivots
static void eliminate(int n, double M[LINEAR_MOST][LINEAR_MOST], double *b) {
  for (int c = 0; c < n; c++) {
    int p = c;
    for (int r = c; r < n; r++)
      if (fabs(M[r][c]) > fabs(M[p][c])) p = r;
    for (int j = 0; j < n; j++) {
      double swap = M[c][j];
      M[c][j] = M[p][j], M[p][j] = swap;
    }
    double swap = b[c];
    b[c] = b[p], b[p] = swap;
    for (int r = 0; r < n; r++) {
      if (r == c) continue;
      double f = M[r][c] / M[c][c];
      for (int j = c; j < n; j++) M[r][j] -= f * M[c][j];
      b[r] -= f * b[c];
    }
  }
  for (int c = 0; c < n; c++) b[c] /= M[c][c];
}

/// The optimum: costates at the start from the end, which is linear in them.
static void solve_linear(const linear *s, int n, optimum_truth *truth) {
  double M[LINEAR_MOST][LINEAR_MOST], end[LINEAR_MOST], x[2 * LINEAR_MOST], p[LINEAR_MOST];
  int nv = s->n / 2;
  for (int c = -1; c < s->n; c++) {
    memset(x, 0, sizeof x);
    if (c < 0) memcpy(x, s->from, sizeof s->from);
    if (c >= 0) x[s->n + c] = 1;
    for (int t = 0; t < 20; t++) advance(s, s->duration / 20, x);
    for (int i = 0; i < s->n; i++) {
      if (c < 0) end[i] = x[i];
      if (c >= 0) M[i][c] = x[i];
    }
  }
  // half of p0' Gramian p0: the cost is half of (to - free end)' times what reaches it
  for (int i = 0; i < s->n; i++) p[i] = s->to[i] - end[i];
  eliminate(s->n, M, p);
  memset(x, 0, sizeof x);
  memcpy(x, s->from, (size_t)s->n * sizeof(double));
  memcpy(x + s->n, p, (size_t)s->n * sizeof(double));
  for (int t = 0; t <= n; t++) {
    for (int i = 0; i < nv; i++) {
      truth->q[t * nv + i] = x[i];
      truth->u[t * nv + i] = 0;
      for (int j = 0; j < s->n; j++)
        for (int k = 0; k < s->m; k++) truth->u[t * nv + i] += s->B[nv + i][k] * s->B[j][k] * x[s->n + j];
    }
    if (t < n) advance(s, s->duration / n, x);
  }
  // cost: dJ/dt = u^2/2 and p'(A x + B u) - u^2/2 is constant; by Simpson's rule on a grid of its own
  enum { PARTS = 400 };
  memcpy(x, s->from, (size_t)s->n * sizeof(double));
  memcpy(x + s->n, p, (size_t)s->n * sizeof(double));
  truth->cost = 0;
  for (int t = 0; t <= PARTS; t++) {
    double u2 = 0;
    for (int k = 0; k < s->m; k++) {
      double u = 0;
      for (int j = 0; j < s->n; j++) u += s->B[j][k] * x[s->n + j];
      u2 += u * u;
    }
    truth->cost += (t == 0 || t == PARTS ? 1 : t % 2 ? 4 : 2) * u2 / 2 * s->duration / PARTS / 3;
    if (t < PARTS) advance(s, s->duration / PARTS, x);
  }
  truth->duration = s->duration;
}

static const char cart[] =
    "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='x' type='slide' axis='1 0 0' damping='1'/>"
    "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></worldbody><actuator><motor "
    "joint='x'/></actuator></mujoco>";

static void build_damped(optimum_problem *p, int n) {
  (void)n;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_end(p, (double[]){5}, (double[]){2});
}

static void truth_damped(int n, optimum_truth *truth) {
  linear s = {2, 1, {{0, 1}, {0, -1}}, {{0}, {1}}, {0, 0}, {5, 2}, 2};
  solve_linear(&s, n, truth);
}

// three masses in a row between springs, of which the first and the last are driven
static const char chain[] =
    "<mujoco><option gravity='0 0 0'/><worldbody>"
    "<body><joint name='a' type='slide' axis='1 0 0' damping='.2'/><inertial pos='0 0 0' mass='1' diaginertia='1 1 "
    "1'/></body>"
    "<body><joint name='b' type='slide' axis='1 0 0' damping='.1'/><inertial pos='0 0 0' mass='2' diaginertia='1 1 "
    "1'/></body>"
    "<body><joint name='c' type='slide' axis='1 0 0' stiffness='1'/><inertial pos='0 0 0' mass='.5' diaginertia='1 1 "
    "1'/></body></worldbody>"
    "<tendon><fixed stiffness='4'><joint joint='a' coef='1'/><joint joint='b' coef='-1'/></fixed>"
    "<fixed stiffness='3'><joint joint='b' coef='1'/><joint joint='c' coef='-1'/></fixed></tendon>"
    "<actuator><motor joint='a'/><motor joint='c'/></actuator></mujoco>";

static void build_chain(optimum_problem *p, int n) {
  (void)n;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_end(p, (double[]){1, 0, -1}, (double[]){0, .5, 0});
}

static void truth_chain(int n, optimum_truth *truth) {
  linear s = {.n = 6, .m = 2, .duration = 3, .to = {1, 0, -1, 0, .5, 0}};
  for (int i = 0; i < 3; i++) s.A[i][3 + i] = 1;
  s.A[3][0] = -4, s.A[3][1] = 4, s.A[3][3] = -.2;
  s.A[4][0] = 2, s.A[4][1] = -3.5, s.A[4][2] = 1.5, s.A[4][4] = -.05;
  s.A[5][1] = 6, s.A[5][2] = -8;
  s.B[3][0] = 1, s.B[5][1] = 2;
  solve_linear(&s, n, truth);
  // u of the truth is M^-1 B times the input: back to forces
  for (int t = 0; t <= n; t++) truth->u[3 * t + 2] *= .5;
}

// ---------------------------------------------------------------- double integrator

static const char point[] =
    "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='x' type='slide' axis='1 0 0'/>"
    "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></worldbody><actuator><motor "
    "joint='x'/></actuator></mujoco>";

static void build_rest(optimum_problem *p, int n) {
  (void)n;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_end(p, (double[]){1}, (double[]){0});
}

// u = 6 (1 - 2 s)/T^2, J = 6/T^3 over 1 m
static void fill_rest(int n, double T, optimum_truth *truth) {
  truth->duration = T;
  truth->cost = 6 / (T * T * T);
  for (int t = 0; t <= n; t++) {
    double s = (double)t / n;
    truth->q[t] = s * s * (3 - 2 * s);
    truth->u[t] = 6 * (1 - 2 * s) / (T * T);
  }
}

static void truth_rest(int n, optimum_truth *truth) { fill_rest(n, 1.5, truth); }

/// dJ/dx of the end: 12/T^3 at 1 m.
static double price_rest(const cav_problem *p, const cav_solution *s) {
  (void)p;
  double sum = 0;
  for (int i = 0; i < s->nrow; i++)
    if (s->row[i].kind == CAV_BINDING_TERM && s->row[i].object == 0) sum += fabs(s->row[i].multiplier);
  return fabs(sum - 12 / (1.5 * 1.5 * 1.5)) / (12 / (1.5 * 1.5 * 1.5));
}

// the weight of the duration such that the best one is (18/w)^(1/5)
static const double time_weight = 3;

static void build_free(optimum_problem *p, int n) {
  build_rest(p, n);
  p->problem.duration_least = .3;
  p->problem.duration_most = 6;
  p->problem.duration_weight = time_weight;
}

static void truth_free(int n, optimum_truth *truth) {
  double T = pow(18 / time_weight, 0.2);
  fill_rest(n, T, truth);
  truth->cost += time_weight / 2 * T * T;
}

static void build_spline(optimum_problem *p, int n) {
  (void)n;
  optimum_cost(p, CAV_QUANTITY_ACCELERATION, 1);
  optimum_fix(p, CAV_QUANTITY_CONFIGURATION, .5 * p->problem.duration, (double[]){1});
  optimum_end(p, (double[]){0}, (double[]){0});
}

// there and back: two cubics, each from rest to rest, J = 2*6/(T/2)^3
static void truth_spline(int n, optimum_truth *truth) {
  double T = 2, half = T / 2;
  truth->duration = T;
  truth->cost = 12 / (half * half * half);
  for (int t = 0; t <= n; t++) {
    double s = 2.0 * t / n, r = s < 1 ? s : 2 - s;
    truth->q[t] = r * r * (3 - 2 * r);
    truth->u[t] = 6 * (1 - 2 * r) / (half * half);
  }
}

/// dJ/dx of the point on the way: J = 96 x^2/T^3, 192/T^3 at 1 m.
static double price_spline(const cav_problem *p, const cav_solution *s) {
  (void)p;
  double sum = 0;
  for (int i = 0; i < s->nrow; i++)
    if (s->row[i].kind == CAV_BINDING_TERM && s->row[i].object == 0) sum += fabs(s->row[i].multiplier);
  return fabs(sum - 24) / 24;
}

// ---------------------------------------------------------------- rotation: a ball of inertia 2 turned by 2 rad about
// a skew axis

static const char ball[] =
    "<mujoco><option gravity='0 0 0'/><worldbody><body name='ball'><joint name='ball' type='ball'/>"
    "<inertial pos='0 0 0' mass='1' diaginertia='2 2 2'/></body></worldbody><actuator>"
    "<motor joint='ball' gear='1 0 0'/><motor joint='ball' gear='0 1 0'/><motor joint='ball' gear='0 0 "
    "1'/></actuator></mujoco>";
static const double skew[3] = {1 / 3.0, 2 / 3.0, -2 / 3.0};

static void build_turn(optimum_problem *p, int n) {
  (void)n;
  double quat[4] = {cos(1), skew[0] * sin(1), skew[1] * sin(1), skew[2] * sin(1)};
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_end(p, quat, (double[]){0, 0, 0});
}

// by symmetry the axis stays: 6 I^2 angle^2/T^3
static void truth_turn(int n, optimum_truth *truth) {
  double T = 1.5;
  truth->duration = T;
  truth->cost = 6 * 4 * 4 / (T * T * T);
  for (int t = 0; t <= n; t++) {
    double s = (double)t / n, angle = 2 * s * s * (3 - 2 * s);
    truth->q[4 * t] = cos(angle / 2);
    for (int k = 0; k < 3; k++) {
      truth->q[4 * t + 1 + k] = skew[k] * sin(angle / 2);
      truth->u[3 * t + k] = skew[k] * 2 * 2 * 6 * (1 - 2 * s) / (T * T);
    }
  }
}

// ---------------------------------------------------------------- oscillator that tracks a sine for ever

static const char oscillator[] =
    "<mujoco><option gravity='0 0 0'/><worldbody><body><joint name='x' type='slide' axis='1 0 0' stiffness='4' "
    "damping='.3'/>"
    "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body></worldbody><actuator><motor "
    "joint='x'/></actuator></mujoco>";
enum { TRACKING = 5 };

static void build_track(optimum_problem *p, int n) {
  p->problem.cycle.on = 1;
  p->problem.close_at_rest = 0;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  cav_term *track = optimum_cost(p, CAV_QUANTITY_VELOCITY, TRACKING);
  // v of a knot is that of the step before it
  for (int t = 0; t <= n; t++) {
    p->times[t] = t * p->problem.timestep;
    p->table[t] = cos(2 * M_PI * (t - .5) / n);
  }
  track->target = p->table;
  track->nwaypoint = n + 1;
  track->waypoint_time = p->times;
}

// U = Z V for every velocity V e^{iwt}: the least of |U|^2 + k |V - 1|^2 at V = k/(k + |Z|^2)
static void truth_track(int n, optimum_truth *truth) {
  double T = 2.5, w = 2 * M_PI / T, re = .3, im = w - 4 / w, z2 = re * re + im * im, V = TRACKING / (TRACKING + z2);
  truth->duration = T;
  truth->cost = T / 4 * (z2 * V * V + TRACKING * (V - 1) * (V - 1));
  for (int t = 0; t <= n; t++) {
    double a = 2 * M_PI * t / n;
    truth->q[t] = V / w * sin(a);
    truth->u[t] = V * (re * cos(a) - im * sin(a));
  }
}

const optimum optimum_smooth[] = {
    {.name = "damped",
     .text = "linear-quadratic: x'' = -x' + u from (0, 0) to (5, 2)",
     .model = cart,
     .duration = 2,
     .coarsest = 10,
     .build = build_damped,
     .truth = truth_damped,
     .cost = {.02, 1},
     .state = {.02, 1},
     .force = {.02, 1},
     .quadratic = 2},
    {.name = "chain",
     .text = "linear-quadratic: three masses and springs, two of them driven",
     .model = chain,
     .duration = 3,
     .coarsest = 20,
     .build = build_chain,
     .truth = truth_chain,
     .cost = {.02, 1},
     .state = {.02, 1},
     .force = {.05, 1},
     .quadratic = 1},
    {.name = "effort",
     .text = "least effort from rest to rest",
     .model = point,
     .duration = 1.5,
     .coarsest = 10,
     .build = build_rest,
     .truth = truth_rest,
     .cost = {2e-4, 2},
     .state = {.01, 1},
     .force = {.02, 1},
     .multiplier = price_rest,
     .multiplier_error = {1e-3, 2},
     .quadratic = 1},
    {.name = "duration",
     .text = "least effort and duration: T* = (18/w)^(1/5)",
     .model = point,
     .duration = 3,
     .coarsest = 10,
     .build = build_free,
     .truth = truth_free,
     .cost = {2e-4, 2},
     .time = {2e-4, 2},
     .state = {.01, 1},
     .force = {.02, 1}},
    {.name = "spline",
     .text = "least acceleration through a point on the way",
     .model = point,
     .duration = 2,
     .coarsest = 10,
     .build = build_spline,
     .truth = truth_spline,
     .cost = {1e-3, 2},
     .state = {.02, 1},
     .force = {.05, 1},
     .multiplier = price_spline,
     .multiplier_error = {1e-3, 2},
     .quadratic = 1},
    {.name = "turn",
     .text = "least effort for a rotation of 2 rad about a skew axis",
     .model = ball,
     .duration = 1.5,
     .coarsest = 10,
     .build = build_turn,
     .truth = truth_turn,
     .cost = {2e-4, 2},
     .state = {.01, 1},
     .force = {.02, 1}},
    {.name = "track",
     .text = "cycle: an oscillator that tracks the velocity of a sine",
     .model = oscillator,
     .duration = 2.5,
     .coarsest = 10,
     .build = build_track,
     .truth = truth_track,
     .cost = {2e-3, 2},
     .state = {1e-3, 2},
     .force = {5e-3, 2},
     .quadratic = 1},
};
const int optimum_nsmooth = sizeof optimum_smooth / sizeof *optimum_smooth;
