/// Coulomb's law of contacts: the closed form against its own conditions, against the convex law at de Saxce's lowered
/// reference and against differences; and what bodies do under it, against closed forms: a block that slides, is
/// pushed, a ball that comes to roll, a spinning ball, a foot that passes above the floor. Each also under the convex
/// law, which must not do it.
#include "constraint.h"
#include "scene.h"

enum { CASES = 2000, DIM_MAX = 6 };

/// One contact: a law and a point g.
typedef struct sample {
  int dim;
  double R[DIM_MAX], friction[DIM_MAX - 1], g[DIM_MAX];
} sample;

static double between(double low, double high) { return low * pow(high / low, 0.5 + 0.5 * scene_uniform()); }

static sample draw(int k) {
  static const int dims[] = {1, 3, 4, 6};
  sample s = {.dim = dims[k % 4]};
  s.R[0] = between(1e-4, 1e2);
  const double rho = s.R[0] * between(1e-2, 10);
  for (int j = 1; j < s.dim; j++) {
    s.friction[j - 1] = between(1e-3, 2);
    s.R[j] = rho / (s.friction[j - 1] * s.friction[j - 1]);
  }
  for (int i = 0; i < s.dim; i++) s.g[i] = scene_uniform() * (i ? s.friction[i - 1] : 1) * between(0.1, 10);
  return s;
}

// |f_j/mu_j|, |mu_j w_j| and their product for w = R (f - g)
typedef struct tangent {
  double force, slip, power;
} tangent;

static tangent measure(const sample *s, const double *f) {
  tangent t = {0, 0, 0};
  for (int j = 1; j < s->dim; j++) {
    const double w = s->R[j] * (f[j] - s->g[j]), mu = s->friction[j - 1];
    t.force += f[j] * f[j] / (mu * mu);
    t.slip += mu * mu * w * w;
    t.power += f[j] * w;
  }
  return (tangent){sqrt(t.force), sqrt(t.slip), t.power};
}

// complementarity of gap and force, friction within its ellipse and against the slip with all it has
static void test_conditions(void) {
  int kind[3] = {0, 0, 0};
  for (int k = 0; k < CASES; k++) {
    const sample s = draw(k);
    double f[DIM_MAX], again[DIM_MAX], lowered[DIM_MAX];
    cav_law_coulomb(s.dim, s.R, s.friction, 0, 0, NULL, s.g, f, NULL, NULL);
    const double w = s.R[0] * (f[0] - s.g[0]), size = fabs(s.g[0]) + fabs(f[0]);
    const tangent t = measure(&s, f);
    CHECK(f[0] >= 0 && w >= 0 && f[0] * w <= 1e-15 * s.R[0] * size * size);
    CHECK(t.force <= f[0] * (1 + 1e-14));
    CHECK_NEAR(t.power, -f[0] * t.slip, 1e-13 * (f[0] * t.slip + s.R[0] * size * size));
    kind[f[0] > 0 ? 1 + (t.force < f[0] * (1 - 1e-12)) : 0]++;
    // de Saxce: the convex law with v*_n lowered by |mu w_t|
    memcpy(lowered, s.g, sizeof lowered);
    lowered[0] -= t.slip / s.R[0];
    cav_law_cone(s.dim, s.R, s.friction, 0, 0, lowered, again, NULL, NULL);
    CHECK_NEAR_ALL(again, f, s.dim, 1e-12 * (size + t.slip / s.R[0]));
  }
  printf("conditions: %d open, %d sliding, %d sticking\n", kind[0], kind[1], kind[2]);
  for (int k = 0; k < 3; k++) CHECK(kind[k] > CASES / 20);
}

// -df/dv_next against centred differences; with the bound held also symmetric, and the gradient of its potential
static void test_derivatives(void) {
  double worst = 0, gradient = 0;
  for (int k = 0; k < CASES; k++) {
    const sample s = draw(k);
    const double sigma = sqrt(s.R[0]) * between(0.03, 30), bound = between(0.01, 10);
    for (int held = 0; held < 2; held++) {
      double f[DIM_MAX], H[DIM_MAX * DIM_MAX], psi, side[2][DIM_MAX], level[2];
      const double *given = held ? &bound : NULL;
      cav_law_coulomb(s.dim, s.R, s.friction, sigma, 0, given, s.g, f, H, held ? &psi : NULL);
      for (int j = 0; j < s.dim; j++) {
        const double step = 1e-5 * fmax(fabs(s.g[j]), sigma / sqrt(s.R[j]));
        for (int up = 0; up < 2; up++) {
          sample moved = s;
          moved.g[j] += up ? step : -step;
          cav_law_coulomb(s.dim, s.R, s.friction, sigma, 0, given, moved.g, side[up], NULL, held ? &level[up] : NULL);
        }
        // g falls by dv_next/R
        for (int i = 0; i < s.dim; i++) {
          const double derivative = (side[1][i] - side[0][i]) / (2 * step) / s.R[j];
          const double scale = sqrt(1 / (s.R[i] * s.R[j]));
          worst = fmax(worst, fabs(H[i * s.dim + j] - derivative) / scale);
          if (held) CHECK_NEAR(H[i * s.dim + j], H[j * s.dim + i], 1e-14 * scale);
        }
        if (held) {
          const double pull = (level[1] - level[0]) / (2 * step) / s.R[j];
          gradient = fmax(gradient, fabs(pull - f[j]) / (fabs(f[j]) + sigma / sqrt(s.R[j])));
        }
      }
    }
  }
  printf("derivatives: %.1e off, gradient of the potential %.1e\n", worst, gradient);
  // differences over 1e-5: rounding 1e-11 of f, third derivatives 1e-10; a potential may be 1e4 times what it changes
  // by
  CHECK(worst <= 1e-7 && gradient <= 1e-6);
}

// sigma -> 0 gives the exact law; slow sliding meets the friction that the convex law has for it; extremes
static void test_limits(void) {
  for (int k = 0; k < CASES; k++) {
    const sample s = draw(k);
    double exact[DIM_MAX], f[DIM_MAX], H[DIM_MAX * DIM_MAX], size = 0;
    for (int i = 0; i < s.dim; i++) size = fmax(size, fabs(s.g[i]) * sqrt(s.R[i]));
    cav_law_coulomb(s.dim, s.R, s.friction, 0, 0, NULL, s.g, exact, NULL, NULL);
    for (double sigma = 1; sigma > 1e-300; sigma *= 1e-3) {
      cav_law_coulomb(s.dim, s.R, s.friction, sigma, 0, NULL, s.g, f, H, NULL);
      const tangent t = measure(&s, f);
      // squares below that vanish
      CHECK(t.force <= f[0] * (1 + 1e-13) || f[0] < 1e-100);
      for (int i = 0; i < s.dim; i++) {
        // the normal impulse errs by sigma log 2, friction by what that allows it and its own rounding
        const double fraction = i ? s.friction[i - 1] * sqrt(s.R[i] / s.R[0]) : 1;
        CHECK(fabs(f[i] - exact[i]) * sqrt(s.R[i]) <= 1.4 * sigma * (1 + fraction) + 1e-14 * size * (1 + fraction));
        for (int j = 0; j < s.dim; j++) CHECK(isfinite(H[i * s.dim + j]));
      }
    }
  }
  // far below contact and slow: both laws have friction f_n w R_n/(rho K-scale), equal to first order in the slip
  const double R[3] = {0.5, 0.5, 0.5}, mu[2] = {0.7, 0.7}, g[3] = {-20, 1e-4, 0};
  double convex[3], coulomb[3];
  cav_law_cone(3, R, mu, 1.0, 0, g, convex, NULL, NULL);
  cav_law_coulomb(3, R, mu, 1.0, 0, NULL, g, coulomb, NULL, NULL);
  CHECK_NEAR(coulomb[0] / convex[0], 1, 1e-4);
  CHECK_NEAR(coulomb[1] / convex[1], 1, 1e-4);
  const double nothing[3] = {1, NAN, 0}, still[3] = {2, 0, 0}, huge[3] = {1e200, 1e200, -3e200};
  cav_law_coulomb(3, R, mu, 0, 0, NULL, nothing, coulomb, NULL, NULL);
  CHECK(isnan(coulomb[1]));
  cav_law_coulomb(3, R, mu, 0.1, 0, NULL, still, coulomb, NULL, NULL);
  CHECK(coulomb[1] == 0 && coulomb[2] == 0 && coulomb[0] > 2);
  cav_law_coulomb(3, R, mu, 0, 0, NULL, huge, coulomb, NULL, NULL);
  CHECK_NEAR(hypot(coulomb[1], coulomb[2]) / (0.7 * coulomb[0]), 1, 1e-14);
}

// --- bodies ---

static cav_model *model;
static cav_state *state;
static double q[64], v[64], u[64], next[64];

static int open_scene(const char *text) {
  model = scene_load(text);
  CHECK(model != NULL);
  if (!model) return 0;
  state = cav_state_new(model);
  CHECK(state != NULL && model->nq <= 64);
  memset(v, 0, sizeof v);
  memset(u, 0, sizeof u);
  cav_configuration_reset(model, q);
  return 1;
}

static void close_scene(void) {
  cav_state_free(state);
  cav_model_free(model);
}

// the k-th setting: law of sliding, order, stabilisation, smoothing
static void choose(cav_sliding sliding, int order, int discrete, double smoothing) {
  cav_options *o = &state->options;
  o->sliding = sliding;
  o->order = (cav_order)order;
  o->stabilisation = discrete ? CAV_STABILISATION_DISCRETE : CAV_STABILISATION_SOLREF;
  o->softness = 0.01;
  o->time_constant = 0;
  o->smoothing = o->smoothing_self = smoothing;
}

static void step(void) {
  CHECK(cav_forward(model, state, q, v, u, next) == CAV_OK);
  memcpy(v, next, sizeof v);
  cav_integrate(model, q, v, state->options.timestep, q);
}

// to rest on the floor
static void settle(void) {
  for (int k = 0; k < 2000; k++) step();
}

// of a body whose lowest point is 0.1 m below its centre; under Coulomb's law there is a contact there
static double gap(void) {
  CHECK(state->options.sliding == CAV_SLIDING_CONVEX || state->ncontact > 0);
  return q[2] - 0.1;
}

// a block that cannot turn, thrown over a floor: slows down at mu g and stays where it sank to at rest; the convex law
// lifts it
static void test_block(void) {
  if (!open_scene("<mujoco><option timestep='.01'/><worldbody><geom type='plane' size='50 5 1' friction='.4 0 0'/>"
                  "<body pos='0 0 0'><joint type='slide' axis='1 0 0'/><joint type='slide' axis='0 1 0'/>"
                  "<joint type='slide' axis='0 0 1' ref='.1'/><geom type='box' pos='0 0 .1' size='.2 .1 .1' mass='3' "
                  "friction='.4 0 0'/>"
                  "</body></worldbody></mujoco>"))
    return;
  const double slow = 0.4 * 9.81;
  for (int k = 0; k < 12; k++) {
    double lifted[2], off = 0;
    for (int law = 1; law >= 0; law--) {
      choose(law ? CAV_SLIDING_COULOMB : CAV_SLIDING_CONVEX, k % 3, k / 3 % 2, k / 6 ? 1e-4 : 0);
      cav_configuration_reset(model, q);
      memset(v, 0, sizeof v);
      settle();
      const double rest = gap(), speed = 3, direction[2] = {0.6, 0.8};
      for (int i = 0; i < 2; i++) v[i] = speed * direction[i];
      lifted[law] = 0;
      for (int t = 1; t <= 60; t++) {
        step();
        lifted[law] = fmax(lifted[law], fabs(gap() - rest));
        // smoothed friction lacks exp(-slip h/delta) of its bound
        for (int i = 0; law && i < 2; i++) off = fmax(off, fabs(v[i] - direction[i] * (speed - slow * t * 0.01)));
      }
    }
    CHECK(lifted[1] <= 1e-11);
    CHECK(off <= (k / 6 ? 1e-9 : 1e-11));
    // 0.4 h 3 m/s is 12 mm
    CHECK(lifted[0] > 5e-3);
  }

  // pushed at constant speed: what pushes is mu m g, and the floor bears the weight
  choose(CAV_SLIDING_COULOMB, 0, 1, 0);
  cav_configuration_reset(model, q);
  memset(v, 0, sizeof v);
  settle();
  v[0] = 0.7;
  CHECK(cav_inverse(model, state, q, v, v, u) == CAV_OK);
  CHECK_NEAR(u[0], 0.4 * 3 * 9.81, 1e-9);
  CHECK_NEAR(u[1], 0, 1e-12);
  CHECK_NEAR(u[2], 0, 1e-9);
  const double rest = gap();
  for (int t = 0; t < 100; t++) step();
  CHECK_NEAR(v[0], 0.7, 1e-9);
  CHECK_NEAR(gap(), rest, 1e-12);
  choose(CAV_SLIDING_CONVEX, 0, 1, 0);
  CHECK(cav_inverse(model, state, q, v, v, u) == CAV_OK);
  CHECK(fabs(u[2]) > 10);
  close_scene();
}

// a ball thrown without spin: m v r + I omega stays, so it rolls at 5/7 of the speed (less what it sank in), from 2
// v0/(7 mu g) on
static void test_ball(void) {
  if (!open_scene("<mujoco><option timestep='.002'/><worldbody><geom type='plane' size='50 5 1' friction='.3 0 0'/>"
                  "<body pos='0 0 .1'><freejoint/><geom type='sphere' size='.1' mass='2' friction='.3 0 0'/></body>"
                  "</worldbody></mujoco>"))
    return;
  for (int k = 0; k < 6; k++) {
    choose(CAV_SLIDING_COULOMB, k % 3, k / 3, 0);
    cav_configuration_reset(model, q);
    memset(v, 0, sizeof v);
    settle();
    const double rest = gap(), speed = 2, arm = 0.1 + 0.5 * rest, inertia = 0.4 * 2 * 0.1 * 0.1;
    const double rolling = speed / (1 + inertia / (2 * arm * arm)), h = state->options.timestep;
    double lifted = 0, began = 0;
    v[0] = speed;
    for (int t = 1; t <= 1000; t++) {
      step();
      lifted = fmax(lifted, fabs(gap() - rest));
      // spin about the world's y axis
      double turn[4];
      memcpy(turn, q + 3, sizeof turn);
      if (began == 0 && state->contact[0].velocity_next[0] < 1 &&
          hypot(state->contact[0].velocity_next[1], state->contact[0].velocity_next[2]) < 0.01 * speed)
        began = t * h;
    }
    CHECK_NEAR(v[0], rolling, 1e-9);
    CHECK_NEAR(rolling, 5.0 / 7.0 * speed, 1e-2);
    CHECK_NEAR(began, 2 * speed / (7 * 0.3 * 9.81), 3 * h);
    CHECK(lifted <= 1e-11);
  }
  close_scene();
}

// a ball that spins about the normal: torsional friction mu_t m g, mu_t a length; one that rolls: mu_r m g against its
// rolling
static void test_spin(void) {
  if (!open_scene(
          "<mujoco><option timestep='.005'/><default><geom friction='.5 .02 .004' condim='6'/></default>"
          "<worldbody><geom type='plane' size='50 5 1'/>"
          "<body pos='0 0 .1'><freejoint/><geom type='sphere' size='.1' mass='2'/></body></worldbody></mujoco>"))
    return;
  const double inertia = 0.4 * 2 * 0.1 * 0.1;
  for (int k = 0; k < 6; k++) {
    choose(CAV_SLIDING_COULOMB, k % 3, k / 3, 0);
    cav_configuration_reset(model, q);
    memset(v, 0, sizeof v);
    settle();
    const double rest = gap();
    v[5] = 30;
    for (int t = 1; t <= 100; t++) step();
    CHECK_NEAR(v[5], 30 - 0.5 * 0.02 * 2 * 9.81 / inertia, 1e-9);
    CHECK_NEAR(gap(), rest, 1e-12);
    choose(CAV_SLIDING_CONVEX, k % 3, k / 3, 0);
    v[5] = 30;
    for (int t = 1; t <= 100; t++) step();
    CHECK(gap() > rest + 1e-4);
  }
  close_scene();
}

// a foot that passes above the floor at 4.5 m/s at a step of 20 ms: it clears it, so it bears nothing
static void test_swing(void) {
  if (!open_scene(
          "<mujoco><option timestep='.02'/><worldbody><geom type='plane' size='50 5 1'/>"
          "<body pos='0 0 .05'><freejoint/><geom type='sphere' size='.05' mass='1'/></body></worldbody></mujoco>"))
    return;
  const double weight = 9.81 * 0.02;
  for (double clearance = 0.008; clearance < 0.026; clearance += 0.001) {
    for (int smoothed = 0; smoothed < 2; smoothed++) {
      double load[2];
      for (int law = 0; law < 2; law++) {
        choose(law ? CAV_SLIDING_COULOMB : CAV_SLIDING_CONVEX, CAV_ORDER_MIDPOINT, 1, smoothed ? 5e-4 : 0);
        cav_configuration_reset(model, q);
        memset(v, 0, sizeof v);
        q[2] += clearance;
        v[0] = 4.5;
        CHECK(cav_inverse(model, state, q, v, v, u) == CAV_OK);
        load[law] = state->ncontact > 0 ? state->contact[0].impulse[0] : 0;
      }
      CHECK(load[1] <= 1e-3 * weight);
      CHECK(load[0] > weight);
    }
  }
  // thrown level from 8 mm above: the convex law throws it up; Coulomb's lets it fall and holds it where it stays
  double top[2];
  for (int law = 0; law < 2; law++) {
    choose(law ? CAV_SLIDING_COULOMB : CAV_SLIDING_CONVEX, CAV_ORDER_MIDPOINT, 1, 5e-4);
    cav_configuration_reset(model, q);
    memset(v, 0, sizeof v);
    memset(u, 0, sizeof u);
    q[2] += 0.008;
    v[0] = 4.5;
    top[law] = 0;
    for (int t = 0; t < 10; t++) {
      step();
      top[law] = fmax(top[law], q[2] - 0.05);
    }
  }
  printf("foot at 4.5 m/s, 8 mm above the floor: rises to %.1f mm under the convex law, %.1f mm under Coulomb's\n",
         1e3 * top[0], 1e3 * top[1]);
  CHECK(top[0] > 0.03 && top[1] <= 0.0081);
  close_scene();
}

// a humanoid driven through its actuators: the inverse gives back the controls, and the forward step the velocities
static void test_controls(void) {
  double control[64], found[64], residual[64], moment[64], back = 0, forth = 0, lost = 0, slid = 0;
  model = cav_model_load(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", NULL);
  CHECK(model != NULL);
  if (!model) return;
  state = cav_state_new(model);
  for (int k = 0; k < 6; k++) {
    cav_configuration_reset(model, q);
    memset(v, 0, sizeof v);
    for (int t = 0; t < 100; t++) {
      choose(CAV_SLIDING_COULOMB, k % 3, 1, k / 3 ? 5e-4 : 0);
      state->options.timestep = 0.01;
      CHECK(cav_position(model, state, q) == CAV_OK);
      memset(u, 0, sizeof u);
      double largest = 0;
      for (int a = 0; a < model->nu; a++) {
        cav_actuator_length(model, state, a, moment);
        double arm = 0;
        for (int d = 0; d < model->nv; d++) arm = fmax(arm, fabs(moment[d]));
        control[a] = 5 / arm * scene_uniform();
        for (int d = 0; d < model->nv; d++) u[d] += control[a] * moment[d];
        largest = fmax(largest, fabs(control[a]));
      }
      const cav_status status = cav_forward(model, state, q, v, u, next);
      CHECK(status == CAV_OK);
      CHECK(cav_inverse(model, state, q, v, next, found) == CAV_OK);
      for (int i = 0; i < state->ncontact; i++)
        if (state->contact[i].dim >= 3) // those without friction have no velocity along the ground
          slid = fmax(slid, hypot(state->contact[i].velocity_next[1], state->contact[i].velocity_next[2]));
      cav_actuation(model, state, found, residual, moment);
      for (int a = 0; a < model->nu; a++) back = fmax(back, fabs(moment[a] - control[a]) / largest);
      for (int d = 0; d < model->nv; d++) lost = fmax(lost, fabs(residual[d]) / (model->mass * 9.81));
      // and forward from what the inverse found
      CHECK(cav_forward(model, state, q, v, found, residual) == CAV_OK);
      for (int d = 0; d < model->nv; d++) forth = fmax(forth, fabs(residual[d] - next[d]));
      memcpy(v, next, sizeof v);
      cav_integrate(model, q, v, state->options.timestep, q);
    }
  }
  printf(
      "humanoid driven for 6 times 1 s: controls %.1e off, unactuated %.1e, forward(inverse) %.1e; slips at up to %.2g "
      "m/s\n",
      back, lost, forth, slid);
  CHECK(back <= 1e-10 && lost <= 1e-10 && forth <= 1e-10 && slid > 0.1 && slid < 100);
  close_scene();
}

// so many piles of boxes that slide: friction of all is solved at once, and takes more iterations than of one pile
static void test_piles(void) {
  enum { PILES = 28, HIGH = 3 };
  static char text[1 << 15];
  char *at = text + sprintf(text, "<mujoco><option timestep='.005'/><worldbody><geom type='plane' size='9 9 1'/>");
  for (int i = 0; i < PILES * HIGH; i++)
    at += sprintf(at, "<body pos='%g %g %g'><freejoint/><geom type='box' size='.1 .1 .1' mass='1'/></body>",
                  0.5 * (i / HIGH % 9), 0.5 * (i / HIGH / 9), 0.1 + 0.1999 * (i % HIGH) - 1e-4);
  sprintf(at, "</worldbody></mujoco>");
  cav_model *m = scene_load(text);
  cav_state *s = m ? cav_state_new(m) : NULL;
  if (!CHECK(s != NULL)) return;
  double *before = scene_vector(m->nv), *push = scene_vector(m->nv), *after = scene_vector(m->nv),
         *back = scene_vector(m->nv), worst = 0;
  s->options.stabilisation = CAV_STABILISATION_DISCRETE;
  s->options.softness = 1e-2;
  s->options.sliding = CAV_SLIDING_COULOMB;
  int most = 0;
  for (int k = 0; k < 5; k++) {
    cav_forward_report report;
    for (int i = 0; i < m->nv; i++) before[i] = 0.2 * scene_uniform(), push[i] = scene_uniform();
    CHECK(cav_forward(m, s, m->q0, before, push, after) == CAV_OK && s->ncontact == 4 * PILES * HIGH);
    CHECK(cav_inverse(m, s, m->q0, before, after, back) == CAV_OK);
    for (int i = 0; i < m->nv; i++) worst = fmax(worst, fabs(back[i] - push[i]));
    CHECK(cav_forward_newton(m, s, m->q0, before, push, 500, 1e-13, after, &report) == CAV_OK);
    most = report.iterations > most ? report.iterations : most;
  }
  printf("%d piles that slide: at most %d iterations, forces %.1e off\n", PILES, most, worst);
  CHECK(most > 100 && worst < 1e-8);
  free(before), free(push), free(after), free(back);
  cav_state_free(s);
  cav_model_free(m);
}

// steps in a row of boxes that slide and come to rest, from v and from what the last step did, under both laws: the same
// motion, in fewer iterations
static void test_guess(void) {
  enum { HIGH = 3, STEPS = 200 };
  cav_model *m = scene_load(
      "<mujoco><option timestep='.002'/><worldbody><geom type='plane' size='9 9 1'/>"
      "<body pos='0 0 .1'><freejoint/><geom type='box' size='.1 .1 .1' mass='1'/></body>"
      "<body pos='0 0 .2999'><freejoint/><geom type='box' size='.1 .1 .1' mass='1'/></body>"
      "<body pos='0 0 .4998'><freejoint/><geom type='box' size='.1 .1 .1' mass='1'/></body>"
      "</worldbody></mujoco>");
  cav_state *s = m ? cav_state_new(m) : NULL;
  if (!CHECK(s != NULL)) return;
  const int nv = m->nv;
  double *at = scene_vector(m->nq), *speed = scene_vector(nv), *found = scene_vector(nv), *a = scene_vector(nv),
         *alone = scene_vector(nv), *none = scene_vector(nv);
  s->options.stabilisation = CAV_STABILISATION_DISCRETE;
  s->options.softness = 1e-2;
  for (int coulomb = 0; coulomb < 2; coulomb++) {
    s->options.sliding = coulomb ? CAV_SLIDING_COULOMB : CAV_SLIDING_CONVEX;
    double worst = 0;
    int guessed = 0, cold = 0;
    memcpy(at, m->q0, (size_t)m->nq * sizeof *at);
    for (int d = 0; d < nv; d++) speed[d] = a[d] = none[d] = 0;
    for (int box = 0; box < HIGH; box++) speed[6 * box] = 0.3 * (box + 1), speed[6 * box + 1] = 0.1;
    for (int k = 0; k < STEPS; k++) {
      cav_forward_report report = {0};
      CHECK(cav_forward_newton(m, s, at, speed, none, 500, 1e-11, alone, &report) == CAV_OK);
      cold += report.iterations;
      for (int d = 0; d < nv; d++) found[d] = speed[d] + a[d];
      CHECK(cav_forward_newton_from(m, s, at, speed, none, found, 500, 1e-11, found, &report) == CAV_OK);
      guessed += report.iterations;
      for (int d = 0; d < nv; d++) worst = fmax(worst, fabs(found[d] - alone[d])), a[d] = found[d] - speed[d];
      // no guess is the same call
      CHECK(cav_forward_newton_from(m, s, at, speed, none, NULL, 500, 1e-11, found, NULL) == CAV_OK);
      CHECK(!memcmp(found, alone, (size_t)nv * sizeof *found));
      // one that is far off leads to the same step
      if (k % 50 == 0) {
        for (int d = 0; d < nv; d++) found[d] = 20 * scene_uniform();
        CHECK(cav_forward_newton_from(m, s, at, speed, none, found, 500, 1e-11, found, NULL) == CAV_OK);
        for (int d = 0; d < nv; d++) worst = fmax(worst, fabs(found[d] - alone[d]));
      }
      cav_integrate(m, at, alone, m->timestep, at);
      memcpy(speed, alone, (size_t)nv * sizeof *speed);
    }
    printf("%s boxes, step after step: %d iterations from v, %d from the last step's change, %.1e m/s apart\n",
           coulomb ? "Coulomb's" : "convex", cold, guessed, worst);
    CHECK(worst <= 1e-10 && 3 * guessed < 2 * cold);
  }
  free(at), free(speed), free(found), free(a), free(alone), free(none);
  cav_state_free(s);
  cav_model_free(m);
}

int main(void) {
  test_conditions();
  test_derivatives();
  test_limits();
  test_block();
  test_ball();
  test_spin();
  test_swing();
  test_controls();
  test_piles();
  test_guess();
  return check_result();
}
