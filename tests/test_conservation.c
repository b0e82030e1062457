/// Energy and momentum of systems that keep them: free fall, a body that tumbles about its middle axis in flight
/// (Dzhanibekov), a chain of pendulums. The forward step runs without applied force. The drift of a quantity is its
/// largest departure from its first value, relative to a scale of the motion; it falls with the step as the order of
/// the step says: with the first power for `euler`, the second for `midpoint` and `momentum`; `momentum` keeps momenta
/// to rounding, half way between knots, where it takes them (half_step.c). v_t = (q_t - q_{t-1})/h belongs half a step
/// before its knot (optim/METHOD.md, 1), so quantities at a knot take the mean of the velocities that reach and leave
/// it. Usage: test_conservation prints the table that is kept in results/conservation.txt.
#include "scene.h"

enum { STEPS = 5 };
static const double step[STEPS] = {0.008, 0.004, 0.002, 0.001, 0.0005};
static const char *const order_name[] = {"euler", "midpoint", "momentum"};

/// A system, how it starts, and the scales of its energy (J) and angular momentum (kg m^2/s).
typedef struct scene {
  const char *name, *text;
  double v[8], seconds, energy, spin;
  int flies; ///< nothing holds it: angular momentum is kept too, linear momentum but for gravity
} scene;

static const scene scenes[] = {
    {"free fall",
     "<mujoco><worldbody><body><freejoint/><geom type='box' size='.1 .2 .3' mass='2'/></body></worldbody></mujoco>",
     {1, 2, 3, 0, 0, 0},
     1,
     14,
     1,
     1},
    {"tumbling body",
     "<mujoco><worldbody><body><freejoint/><inertial pos='0 0 0' mass='1' diaginertia='1 2 2.8'/></body></worldbody>"
     "</mujoco>",
     {0, 0, 5, 0.02, 4, 0.01},
     2,
     16,
     8,
     1},
    {"pendulum chain",
     "<mujoco><worldbody><body><joint axis='0 1 0'/><geom type='capsule' size='.03' fromto='0 0 0 .3 0 0' mass='1'/>"
     "<body pos='.3 0 0'><joint axis='0 1 0'/><geom type='capsule' size='.03' fromto='0 0 0 .3 0 0' mass='1'/>"
     "<body pos='.3 0 0'><joint axis='1 1 0'/><geom type='capsule' size='.03' fromto='0 0 0 .3 0 0' mass='1'/>"
     "<body pos='.3 0 0'><joint axis='0 1 0' armature='.01'/><geom type='capsule' size='.03' fromto='0 0 0 .3 0 0' "
     "mass='1'/></body></body></body></body></worldbody></mujoco>",
     {0},
     1,
     20,
     1,
     0},
};

/// Drift of energy, of linear momentum beyond gravity's, and of angular momentum about the centre of mass.
typedef struct drift {
  double energy, linear, angular;
} drift;

/// Energy and momenta at one knot.
typedef struct account {
  double energy, speed[3], spin[3];
} account;

static account take(const cav_model *m, cav_state *state, const double *q, const double *v, double *M) {
  account a = {0};
  double com[3];
  CHECK(cav_inertia(m, state, q, M) == CAV_OK);
  for (int i = 0; i < m->nv; i++) {
    for (int j = 0; j < m->nv; j++) a.energy += 0.5 * v[i] * M[i * m->nv + j] * v[j];
  }
  CHECK(cav_position(m, state, q) == CAV_OK);
  cav_momentum(m, state, v, com, a.speed, a.spin);
  for (int k = 0; k < 3; k++) a.energy -= m->mass * m->gravity[k] * com[k];
  return a;
}

static double apart(const double a[3], const double b[3]) {
  return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

static drift run(const cav_model *m, const scene *s, cav_order order, double h) {
  cav_state *state = cav_state_new(m);
  double *M = scene_vector(m->nv * m->nv), *q = scene_vector(m->nq), *mean = scene_vector(m->nv);
  double *v = scene_vector(m->nv), *next = scene_vector(m->nv), *u = scene_vector(m->nv), *middle = scene_vector(m->nq);
  state->options.timestep = h;
  state->options.order = order;
  memcpy(q, m->q0, (size_t)m->nq * sizeof *q);
  memcpy(v, s->v, (size_t)m->nv * sizeof *v);
  account first = {0}, half = {0};
  drift d = {0};
  int n = (int)lround(s->seconds / h);
  for (int t = 0; t < n; t++) {
    CHECK(cav_forward_newton(m, state, q, v, u, 100, 1e-11, next, NULL) == CAV_OK);
    for (int i = 0; i < m->nv; i++) mean[i] = 0.5 * (v[i] + next[i]);
    account now = take(m, state, q, mean, M);
    if (order == CAV_ORDER_MOMENTUM) {
      cav_integrate(m, q, next, 0.5 * h, middle);
      half = take(m, state, middle, next, M);
      memcpy(now.speed, half.speed, sizeof now.speed);
      memcpy(now.spin, half.spin, sizeof now.spin);
    }
    if (t == 0) first = now;
    double speed[3];
    for (int k = 0; k < 3; k++) speed[k] = first.speed[k] + m->gravity[k] * t * h;
    d.energy = fmax(d.energy, fabs(now.energy - first.energy) / s->energy);
    d.linear = fmax(d.linear, apart(now.speed, speed) / 10);
    d.angular = fmax(d.angular, apart(now.spin, first.spin) / s->spin);
    memcpy(v, next, (size_t)m->nv * sizeof *v);
    cav_integrate(m, q, v, h, q);
  }
  cav_state_free(state);
  free(M), free(q), free(mean), free(v), free(next), free(u), free(middle);
  return d;
}

// power of the step by which a drift falls, over the whole table
static double derivative(double coarse, double fine) { return log(coarse / fine) / log(step[0] / step[STEPS - 1]); }

static void check_order(const char *what, const double *d, cav_order order, int kept) {
  // rounding alone: seen 4e-14
  if (kept) CHECK(d[0] < 1e-11 && d[STEPS - 1] < 1e-11);
  if (d[0] < 1e-11) {
    printf("| %s | kept to rounding |\n", what);
    return;
  }
  double power = derivative(d[0], d[STEPS - 1]);
  printf("| %s | %.2f |\n", what, power);
  // bound: the next power of the step spoils a derivative by some percent; seen 0.96 to 1.03 and 1.99 to 2.02. The
  // bounds of one order refuse the other
  CHECK_NEAR(power, order == CAV_ORDER_EULER ? 1 : 2, 0.1);
}

static void run_scene(const scene *s) {
  cav_model *m = scene_load(s->text);
  if (!CHECK(m != NULL)) return;
  for (int order = 0; order < 3; order++) {
    double energy[STEPS], linear[STEPS], angular[STEPS];
    printf("\n%s, %s, %g s\n\n| step, ms | energy | momentum | angular momentum |\n|---|---|---|---|\n", s->name,
           order_name[order], s->seconds);
    for (int i = 0; i < STEPS; i++) {
      drift d = run(m, s, (cav_order)order, step[i]);
      energy[i] = d.energy, linear[i] = d.linear, angular[i] = d.angular;
      printf("| %g | %.2e |", 1e3 * step[i], d.energy);
      if (s->flies)
        printf(" %.1e | %.2e |\n", d.linear, d.angular);
      else
        printf(" | |\n");
    }
    printf("\n| quantity | order |\n|---|---|\n");
    check_order("energy", energy, (cav_order)order, 0);
    if (!s->flies) continue;
    check_order("angular momentum", angular, (cav_order)order, order == CAV_ORDER_MOMENTUM);
    // bound: rounding over 4,000 steps; seen 1e-13
    for (int i = 0; i < STEPS; i++) CHECK_NEAR(linear[i], 0, 1e-12);
  }
  cav_model_free(m);
}

int main(void) {
  for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) run_scene(&scenes[i]);
  return check_result();
}
