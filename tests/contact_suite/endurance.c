/// What must not creep: a quadruped that stands by the springs and dampers of its joints, and a box that is dragged in circles
/// over the floor, at 5 ms for as long as asked. Asserted: every number finite and every step converged; standing, no
/// height lost or gained and no foot moved after the first second and no motion left; dragging, the height of the box
/// steady and its energy never more than what the hand has put in.
#include "suite.h"

enum { NQ = 19, NV = 18 };

// the joints hold a crouch: springs of 200 N m/rad about it
static const char *standing_text(void) {
  static char text[6000];
  char *to = text + sprintf(text,
                            "<mujoco><compiler angle='radian'/><option cone='elliptic'/><worldbody>"
                            "<geom type='plane' size='9 9 1' friction='.8'/><body pos='0 0 .39'><freejoint/>"
                            "<geom type='box' size='.25 .12 .07' mass='16' contype='0' conaffinity='0'/>");
  for (int k = 0; k < 4; k++) {
    const int x = k / 2 ? -1 : 1, y = k % 2 ? -1 : 1;
    to += sprintf(to,
                  "<body pos='%g %g 0'><joint axis='1 0 0' stiffness='200' damping='5'/>"
                  "<geom type='sphere' size='.05' mass='1.5' contype='0' conaffinity='0'/>"
                  "<body pos='0 %g 0' euler='0 %g 0'><joint axis='0 1 0' stiffness='200' damping='5'/>"
                  "<geom type='capsule' size='.03' fromto='0 0 0 0 0 -.2' mass='1.75' contype='0' conaffinity='0'/>"
                  "<body pos='0 0 -.2' euler='0 %g 0'><joint axis='0 1 0' stiffness='200' damping='5'/>"
                  "<geom type='capsule' size='.02' fromto='0 0 0 0 0 -.2' mass='.5'/></body></body></body>",
                  0.27 * x, 0.14 * y, 0.08 * y, 0.4 * x, -0.8 * x);
  }
  sprintf(to, "</body></worldbody></mujoco>");
  return text;
}

static double largest(const double *x, int n) {
  double most = 0;
  for (int i = 0; i < n; i++) most = isfinite(x[i]) ? fmax(most, fabs(x[i])) : INFINITY;
  return most;
}

// with what the springs of the joints hold
static double whole_energy(suite_run *run) {
  double sum = suite_energy(run);
  for (int i = 7; i < NQ; i++) sum += 0.5 * 200 * run->q[i] * run->q[i];
  return sum;
}

// friction of a softness gives way until the feet bear no load along the floor, which takes until settled
static void stand(const suite_setting *setting, double seconds, double settling, int is_settled) {
  suite_run run;
  double settled[NQ] = {0}, off = 0, fastest = 0, least = INFINITY, gained = 0;
  char scene[90];
  if (!suite_open(&run, standing_text(), setting)) return;
  const long n = lround(seconds / setting->h), from = lround(settling / setting->h);
  for (long t = 0; t < n; t++) {
    suite_step(&run);
    if (t == from) memcpy(settled, run.q, sizeof settled);
    if (t % 200 == 0 && t >= from) {
      const double energy = whole_energy(&run);
      gained = fmax(gained, energy - least);
      least = fmin(least, energy);
    }
    if (t < from) continue;
    for (int i = 0; i < NQ; i++) off = fmax(off, fabs(run.q[i] - settled[i]));
    fastest = fmax(fastest, largest(run.v, NV));
  }
  snprintf(scene, sizeof scene, "standing for %g s, drift of q after %g s", seconds, settling);
  suite_row(scene, &run, off);
  snprintf(scene, sizeof scene, "standing for %g s, largest speed after %g s", seconds, settling);
  suite_row(scene, &run, fastest);
  snprintf(scene, sizeof scene, "standing for %g s, energy gained after %g s, J", seconds, settling);
  suite_row(scene, &run, gained);
  if (!setting->mujoco) {
    CHECK(run.failed == 0);
    CHECK(run.q[2] > 0.38 && run.q[2] < 0.39);
    // rounding of the energy of 31 kg
    CHECK(gained < 1e-11);
    // seen 1e-12
    CHECK(!is_settled || (off < 1e-10 && fastest < 1e-10));
  }
  suite_close(&run);
}

// towards a point on a circle of 1 m at 0.5 m/s, by a spring and a damper at the middle of the box
static void pull(const double *q, const double *v, double time, double *u) {
  const double angle = 0.5 * time, at[2] = {cos(angle), sin(angle)}, speed[2] = {-0.5 * sin(angle), 0.5 * cos(angle)};
  for (int k = 0; k < 2; k++) u[k] = 400 * (at[k] - q[k]) + 40 * (speed[k] - v[k]);
}

// range of a number over both parts of a time
typedef struct range {
  double low[2], high[2];
} range;

static void widen(range *r, int part, double x) {
  r->low[part] = fmin(r->low[part], x), r->high[part] = fmax(r->high[part], x);
}

// how far the second part goes beyond the first
static double beyond(const range *r) { return fmax(0, fmax(r->low[0] - r->low[1], r->high[1] - r->high[0])); }

static void drag(const suite_setting *setting, double seconds) {
  static const char text[] =
      "<mujoco><option cone='elliptic'/><worldbody><geom type='plane' size='9 9 1' friction='.5'/>"
      "<body pos='1 0 .1'><freejoint/><geom type='box' size='.2 .2 .1' mass='5' friction='.5'/></body>"
      "</worldbody></mujoco>";
  suite_run run;
  range height = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}}, radius = height, tilt = height;
  if (!suite_open(&run, text, setting)) return;
  const double start = suite_energy(&run), lap = 4 * M_PI;
  double work = 0, gained = -INFINITY;
  char scene[90];
  const long n = lround(seconds / setting->h);
  for (long t = 0; t < n; t++) {
    const double before[2] = {run.q[0], run.q[1]}, time = (double)t * setting->h;
    pull(run.q, run.v, time, run.u);
    suite_step(&run);
    for (int k = 0; k < 2; k++) work += run.u[k] * (run.q[k] - before[k]);
    if (t % 20 == 0) gained = fmax(gained, suite_energy(&run) - start - work);
    // after the first lap: the first half of the time, and the second
    if (time < lap) continue;
    const int part = time > 0.5 * seconds;
    widen(&height, part, run.q[2]);
    widen(&radius, part, hypot(run.q[0], run.q[1]));
    widen(&tilt, part, hypot(run.q[4], run.q[5]));
  }
  const double off = fmax(beyond(&height), fmax(beyond(&radius), beyond(&tilt)));
  snprintf(scene, sizeof scene, "dragging for %g s, energy beyond the work of the hand, J", seconds);
  suite_row(scene, &run, fmax(0, gained));
  snprintf(scene, sizeof scene, "dragging for %g s, second half beyond the first, m or rad", seconds);
  suite_row(scene, &run, off);
  snprintf(scene, sizeof scene, "dragging for %g s, height above rest, m", seconds);
  suite_row(scene, &run, fmax(height.high[0], height.high[1]) - 0.1);
  if (!setting->mujoco) {
    CHECK(run.failed == 0);
    CHECK(gained <= 1e-9);
    // the convex law holds the box off as it slides, by another height as it turns under the pull: 1.7 mm at most
    CHECK(setting->sliding == CAV_SLIDING_COULOMB ? off < 1e-9 : height.high[0] < 0.102 && height.high[1] < 0.102);
  }
  suite_close(&run);
}

void suite_standing(double seconds) {
  const suite_setting own = {.text = "solref", .h = 0.005},
                      discrete = {.text = "discrete, κ 20 ms, ε 1e-3, Coulomb",
                                  .h = 0.005,
                                  .stabilisation = CAV_STABILISATION_DISCRETE,
                                  .softness = 1e-3,
                                  .time_constant = 0.02,
                                  .sliding = CAV_SLIDING_COULOMB},
                      peer = {.text = "Newton, elliptic", .h = 0.005, .mujoco = 1};
  const double half = fmax(60, 0.5 * seconds);
  stand(&own, seconds, 60, 1);
  stand(&discrete, seconds, half, half >= 1800);
  if (suite_available(&peer)) stand(&peer, seconds, 60, 0);
}

void suite_dragging(double seconds) {
  const suite_setting own = {.text = "solref, convex", .h = 0.005},
                      discrete = {.text = "discrete, κ 20 ms, ε 1e-3, Coulomb",
                                  .h = 0.005,
                                  .stabilisation = CAV_STABILISATION_DISCRETE,
                                  .softness = 1e-3,
                                  .time_constant = 0.02,
                                  .sliding = CAV_SLIDING_COULOMB},
                      peer = {.text = "Newton, elliptic", .h = 0.005, .mujoco = 1};
  drag(&own, seconds);
  drag(&discrete, seconds);
  if (suite_available(&peer)) drag(&peer, seconds);
}
