/// Problems whose forces of contact are known: a lift-off, a fall, a slide to a stop.
#include "optimum.h"

static const double gravity = 9.81;

/// Height at which the law of the last stage holds what rests: started deeper, it would be thrown. By bisection of the
/// force that is missing on the vertical dof.
static double rest_height(const optimum_problem *p, int dof) {
  const cav_model *m = p->problem.model;
  const cav_stage_options *last = &p->problem.schedule.last;
  cav_state *state = cav_state_new(m);
  double q[2] = {0}, still[2] = {0}, u[2], low = 0, high = .05;
  state->options.order = p->problem.order;
  state->options.timestep = p->problem.timestep;
  state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  state->options.softness = last->softness;
  state->options.time_constant = last->time_constant * p->problem.timestep;
  state->options.smoothing = last->smoothing;
  state->options.smoothing_self = last->smoothing_self;
  state->options.self_stiffness = last->self_stiffness;
  for (int i = 0; i < 60; i++) {
    q[dof] = (low + high) / 2;
    CHECK(cav_inverse(m, state, q, still, still, u) == CAV_OK);
    if (u[dof] < 0) {
      low = q[dof];
    } else {
      high = q[dof];
    }
  }
  cav_state_free(state);
  return low;
}

// ---------------------------------------------------------------- a block on the floor, thrust upwards to a height at
// the end

static const char block[] =
    "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/><body name='block' pos='0 0 .1'>"
    "<joint name='z' type='slide' axis='0 0 1'/><geom type='sphere' size='.1' mass='1'/></body></worldbody>"
    "<actuator><motor joint='z'/></actuator></mujoco>";
static const double lift_height = .3, lift_duration = 1;

static void build_lift(optimum_problem *p, int n) {
  (void)n;
  p->problem.q_start[0] = rest_height(p, 0);
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_fix(p, CAV_QUANTITY_CONFIGURATION, p->problem.duration, &lift_height);
}

// it rests until tau before the end, tau^2 = 6 H/g, then u = 12 H s/tau^3, s the time to go, from 2 g to 0: J = 24
// H^2/tau^3
static void truth_lift(int n, optimum_truth *truth) {
  double H = lift_height, tau = sqrt(6 * H / gravity), c = 12 * H / (tau * tau * tau);
  truth->duration = lift_duration;
  truth->cost = 24 * H * H / (tau * tau * tau);
  for (int i = 0; i <= n; i++) {
    double s = lift_duration * (1 - (double)i / n), r = fmin(s, tau);
    // from the start of the flight: z'' = c (time to go) - g
    double t = tau - r;
    truth->q[i] = c * (tau * t * t / 2 - t * t * t / 6) - gravity * t * t / 2;
    truth->u[i] = s > tau ? 0 : c * s;
  }
}

/// What the floor gave: m g (T - tau), from the momentum of the knots.
static double impulse_lift(const cav_problem *p, const cav_solution *s) {
  double tau = sqrt(6 * lift_height / gravity), is = gravity * (lift_duration - tau);
  const cav_trajectory *at = s->trajectory;
  double given = at->v[at->nknot - 1] + gravity * p->duration;
  for (int t = 0; t < at->nknot - 1; t++) given -= at->timestep * at->u[t];
  return fabs(given - is) / is;
}

// ---------------------------------------------------------------- a fall and what catches it: nothing to do, all is
// the floor's

static void build_fall(optimum_problem *p, int n) {
  (void)n;
  p->problem.q_start[0] = .2;
  p->problem.q_goal[0] = 0;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_fix(p, CAV_QUANTITY_VELOCITY, p->problem.duration, (double[]){0});
}

static void truth_fall(int n, optimum_truth *truth) {
  truth->duration = .6;
  truth->cost = 0;
  for (int i = 0; i <= n; i++) {
    double t = .6 * i / n;
    truth->q[i] = fmax(.2 - gravity * t * t / 2, 0);
    truth->u[i] = 0;
  }
}

/// m g T.
static double impulse_fall(const cav_problem *p, const cav_solution *s) {
  const cav_trajectory *at = s->trajectory;
  double given = at->v[at->nknot - 1] + gravity * p->duration;
  for (int t = 0; t < at->nknot - 1; t++) given -= at->timestep * at->u[t];
  return fabs(given - gravity * p->duration) / (gravity * p->duration);
}

// ---------------------------------------------------------------- a box pushed along the floor, stopped by friction

static const char box[] =
    "<mujoco><worldbody><geom name='floor' type='plane' size='5 5 1' friction='.5 0 0'/><body name='box' pos='0 0 .1'>"
    "<joint name='x' type='slide' axis='1 0 0'/><joint name='z' type='slide' axis='0 0 1'/>"
    "<geom type='sphere' size='.1' mass='1' friction='.5 0 0'/></body></worldbody><actuator><motor "
    "joint='x'/></actuator></mujoco>";
static const double push_length = 1, push_duration = 1.5;

static void build_push(optimum_problem *p, int n) {
  (void)n;
  p->problem.q_start[1] = rest_height(p, 1);
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_end(p, (double[]){push_length, 0}, (double[]){0, 0});
  // how deep the floor holds it is for the law to say
  for (int i = 1; i < p->problem.nterm; i++) {
    p->term[i].dofs = CAV_DOFS_ONE;
    p->term[i].joint = 0;
  }
}

// moving for tau, tau^2 = 6 L/(mu g): u from 2 mu g to 0, J = 6 L^2/tau^3 + (mu g)^2 tau/2
static void truth_push(int n, optimum_truth *truth) {
  double a = .5 * gravity, tau = sqrt(6 * push_length / a);
  truth->duration = push_duration;
  truth->cost = 6 * push_length * push_length / (tau * tau * tau) + a * a * tau / 2;
  for (int i = 0; i <= n; i++) {
    double s = fmin(push_duration * i / n / tau, 1);
    truth->q[2 * i] = push_length * s * s * (3 - 2 * s);
    truth->q[2 * i + 1] = 0;
    truth->u[2 * i] = 2 * a * (1 - s);
    truth->u[2 * i + 1] = 0;
  }
}

// ---------------------------------------------------------------- a ball driven against a wall, which stops it at the
// end

static const char walled[] =
    "<mujoco><option gravity='0 0 0'/><worldbody>"
    "<geom name='wall' type='plane' size='1 1 1' pos='1.1 0 0' zaxis='-1 0 0'/>"
    "<body><joint name='x' type='slide' axis='1 0 0'/><geom type='sphere' size='.1' mass='1'/></body></worldbody>"
    "<actuator><motor joint='x'/></actuator></mujoco>";

static void build_wall(optimum_problem *p, int n) {
  (void)n;
  p->problem.q_goal[0] = 1;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  // how near the wall holds it is for the law to say
  cav_term *near = optimum_range(p, CAV_QUANTITY_CONFIGURATION, .95, INFINITY);
  near->from = near->to = p->problem.duration;
  optimum_fix(p, CAV_QUANTITY_VELOCITY, p->problem.duration, (double[]){0});
}

// it arrives with the speed that costs least: u = 3 (T - t) for T = 1, from rest over 1 m; J = 3/2, without the wall 6
static void truth_wall(int n, optimum_truth *truth) {
  truth->duration = 1;
  truth->cost = 1.5;
  for (int i = 0; i <= n; i++) {
    double t = (double)i / n;
    truth->q[i] = 1.5 * t * t - t * t * t / 2;
    truth->u[i] = 3 * (1 - t);
  }
}

const optimum optimum_contact[] = {
    {.name = "lift-off",
     .text = "a block rests on the floor until it is thrust to a height",
     .model = block,
     .duration = 1,
     .coarsest = 10,
     .build = build_lift,
     .truth = truth_lift,
     .cost = {.05, 1},
     .state = {.05, 1},
     .force = {.05, 1},
     .force_in_mean = 1,
     .multiplier = impulse_lift,
     .multiplier_error = {.05, 1}},
    {.name = "fall",
     .text = "a block falls and is caught by the floor",
     .model = block,
     .duration = .6,
     .coarsest = 10,
     .build = build_fall,
     .truth = truth_fall,
     .cost = {1e-3, 0},
     .state = {.05, 1},
     .force = {.01, 0},
     .multiplier = impulse_fall,
     .multiplier_error = {1e-3, 0}},
    {.name = "push",
     .text = "a box pushed along the floor is stopped by friction",
     .model = box,
     .duration = 1.5,
     .coarsest = 15,
     .build = build_push,
     .truth = truth_push,
     .cost = {.02, 0},
     .state = {.05, 1},
     .force = {.05, 1},
     .force_in_mean = 1},
    {.name = "wall",
     .text = "a ball is stopped by a wall at the end",
     .model = walled,
     .duration = 1,
     .coarsest = 10,
     .build = build_wall,
     .truth = truth_wall,
     .cost = {.05, 1},
     .state = {.05, 1},
     .force = {.05, 1},
     .force_in_mean = 1},
};
const int optimum_ncontact = sizeof optimum_contact / sizeof *optimum_contact;
