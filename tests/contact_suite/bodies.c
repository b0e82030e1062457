/// Single bodies and stacks: both limits of restitution, stacks of extreme mass ratio, a cube on more contacts than it needs,
/// a cube that slides (which the convex law holds off), and a wall of bricks.
#include "suite.h"

static suite_setting own(const char *text, double h, double softness, cav_sliding sliding) {
  return (suite_setting){.text = text,
                         .h = h,
                         .stabilisation = CAV_STABILISATION_DISCRETE,
                         .softness = softness,
                         .time_constant = 0.02,
                         .sliding = sliding};
}

static const char HEAD[] =
    "<mujoco><size nconmax='2000' njmax='4000'/><option cone='elliptic'/><worldbody>"
    "<geom type='plane' size='50 50 1' friction='.5'/>",
                  TAIL[] = "</worldbody></mujoco>";

static void steps(suite_run *run, double seconds) {
  for (long t = lround(seconds / run->setting->h); t > 0; t--) suite_step(run);
}

// height of the first rebound of a ball dropped from 1 m, and what was wanted of it
static void bounce(const suite_setting *setting, const char *contact, double wanted, const char *scene) {
  char text[600];
  snprintf(text, sizeof text,
           "<mujoco><worldbody><geom type='plane' size='9 9 1' condim='1' %s/><body pos='0 0 1.1'><freejoint/>"
           "<geom type='sphere' size='.1' mass='1' condim='1' %s/></body></worldbody></mujoco>",
           contact, contact);
  suite_run run;
  if (!suite_open(&run, text, setting)) return;
  double top = 0;
  int touched = 0, rising = 0;
  for (long t = lround(1.2 / setting->h); t > 0 && !(touched && rising && run.v[2] < 0); t--) {
    suite_step(&run);
    touched |= run.q[2] < 0.1 + 1e-3;
    rising |= touched && run.v[2] > 0.01;
    if (touched && rising) top = fmax(top, run.q[2] - 0.1);
  }
  suite_row(scene, &run, fabs(top - wanted));
  if (!setting->mujoco && wanted == 0) CHECK(top < 1e-6);
  suite_close(&run);
}

static void test_limits(void) {
  const suite_setting dead = {.text = "discrete, κ 0",
                              .h = 0.001,
                              .stabilisation = CAV_STABILISATION_DISCRETE,
                              .softness = 1e-4},
                      spring = {.text = "solref: spring 1e5 N/(m kg), no damper", .h = 0.001},
                      peer = {.text = "solref 0.02 1", .h = 0.001, .mujoco = 1},
                      peer_spring = {.text = "solref: spring 1e5 N/(m kg), no damper", .h = 0.001, .mujoco = 1};
  const char hard[] = "solref='-100000 0' solimp='.9999 .9999 .001'";
  bounce(&dead, "", 0, "inelastic drop from 1 m, height regained, m");
  if (suite_available(&peer)) bounce(&peer, "", 0, "inelastic drop from 1 m, height regained, m");
  bounce(&spring, hard, 1, "elastic drop from 1 m, height lost, m");
  if (suite_available(&peer_spring)) bounce(&peer_spring, hard, 1, "elastic drop from 1 m, height lost, m");
}

// two cubes of 0.2 m, masses below and above: how far the upper is from where it should be after 3 s
static void stack(const suite_setting *setting, double below, double above) {
  char text[900], scene[90];
  snprintf(text, sizeof text,
           "%s<body pos='0 0 .1'><freejoint/><geom type='box' size='.1 .1 .1' mass='%g'/></body>"
           "<body pos='0 0 .3'><freejoint/><geom type='box' size='.1 .1 .1' mass='%g'/></body>%s",
           HEAD, below, above, TAIL);
  suite_run run;
  if (!suite_open(&run, text, setting)) return;
  steps(&run, 3);
  const double off = fmax(fabs(run.q[9] - 0.3), fmax(fabs(run.q[7]), fabs(run.q[8])));
  snprintf(scene, sizeof scene, "stack, %g kg on %g kg, displacement, m", above, below);
  suite_row(scene, &run, off);
  if (!setting->mujoco) CHECK(off < 1e-3);
  suite_close(&run);
}

// a cube at rest on four corners: largest departure of a corner's force from a quarter of the weight, relative to it
static void test_hyperstatic(const suite_setting *setting) {
  char text[600];
  snprintf(text, sizeof text, "%s<body pos='0 0 .1'><freejoint/><geom type='box' size='.1 .1 .1' mass='1'/></body>%s",
           HEAD, TAIL);
  suite_run run;
  if (!suite_open(&run, text, setting)) return;
  steps(&run, 3);
  double most = 0;
  if (run.model) {
    CHECK(run.state->ncontact == 4);
    for (int i = 0; i < run.state->ncontact; i++)
      most = fmax(most, fabs(run.state->contact[i].impulse[0] / setting->h / (9.81 / 4) - 1));
    CHECK(most < 1e-6);
  }
#ifdef CAVORT_HAVE_MUJOCO
  for (int i = 0; run.d && i < run.d->ncon; i++) {
    double force[6];
    mj_contactForce(run.m, run.d, i, force);
    most = fmax(most, fabs(force[0] / (9.81 / 4) - 1));
  }
#endif
  suite_row("hyperstatic cube, force of a corner, relative", &run, most);
  suite_close(&run);
}

// a cube thrown along the floor at 3 m/s, friction 0.5: v²/(2 mu g) is its way; and how high it is held off
static void slide(const suite_setting *setting) {
  char text[600];
  snprintf(text, sizeof text,
           "%s<body pos='0 0 .1'><freejoint/><geom type='box' size='.1 .1 .1' mass='1' friction='.5'/></body>%s", HEAD,
           TAIL);
  suite_run run;
  if (!suite_open(&run, text, setting)) return;
  run.v[0] = 3;
  double lift = 0;
  for (long t = lround(1.5 / setting->h); t > 0; t--) {
    suite_step(&run);
    lift = fmax(lift, run.q[2] - 0.1);
  }
  const double off = fabs(run.q[0] - 9 / (2 * 0.5 * 9.81));
  suite_row("sliding cube, error of its way of 0.917 m, m", &run, off);
  suite_row("sliding cube, held off the floor, m", &run, lift);
  // the step of semi-implicit Euler stops within h v/2 of it
  if (!setting->mujoco && setting->sliding == CAV_SLIDING_COULOMB) CHECK(off < setting->h * 3 && lift < 1e-6);
  suite_close(&run);
}

// six courses 1 m long, of five bricks or of four between two half ones, 2 mm apart: largest displacement after so many seconds
static void wall(const suite_setting *setting, double seconds) {
  enum { BRICKS = 33 };
  static char text[8000];
  char *to = text + sprintf(text, "%s", HEAD);
  for (int course = 0; course < 6; course++)
    for (int i = 0; i < 5 + course % 2; i++) {
      const int is_half = course % 2 && (i == 0 || i == 5);
      const double x = course % 2 ? (is_half ? (i ? 0.859 : -0.051) : 0.202 * i - 0.101) : 0.202 * i;
      to += sprintf(
          to, "<body pos='%g 0 %g'><freejoint/><geom type='box' size='%g .05 .05' mass='%d' friction='.6'/></body>", x,
          0.05 + 0.1 * course, is_half ? 0.05 : 0.1, 2 - is_half);
    }
  sprintf(to, "%s", TAIL);
  suite_run run;
  if (!suite_open(&run, text, setting)) return;
  double start[7 * BRICKS], most = 0;
  memcpy(start, run.q, sizeof start);
  steps(&run, seconds);
  for (int i = 0; i < 7 * BRICKS; i++)
    if (i % 7 < 3) most = fmax(most, fabs(run.q[i] - start[i]));
  suite_row("wall of 33 bricks, displacement, m", &run, most);
  // penetration of six courses
  if (!setting->mujoco) CHECK(most < 1e-3);
  suite_close(&run);
}

void suite_bodies(int quick) {
  const suite_setting convex = own("discrete, κ 20 ms, ε 1e-4, convex", 0.005, 1e-4, CAV_SLIDING_CONVEX),
                      coulomb = own("discrete, κ 20 ms, ε 1e-4, Coulomb", 0.005, 1e-4, CAV_SLIDING_COULOMB),
                      peer = {.text = "Newton, elliptic", .h = 0.005, .mujoco = 1},
                      stiff = {.text = "Newton, elliptic, solref 0.02 1, solimp 0.9999",
                               .h = 0.005,
                               .mujoco = 1,
                               .softness = 1e-4,
                               .time_constant = 0.02};
  const int peers = suite_available(&peer);
  test_limits();
  for (int heavy = 0; heavy < 2; heavy++) {
    stack(&convex, heavy ? 1 : 1000, heavy ? 1000 : 1);
    if (peers) stack(&peer, heavy ? 1 : 1000, heavy ? 1000 : 1), stack(&stiff, heavy ? 1 : 1000, heavy ? 1000 : 1);
  }
  test_hyperstatic(&convex);
  if (peers) test_hyperstatic(&peer);
  slide(&coulomb), slide(&convex);
  if (peers) slide(&peer);
  wall(&convex, quick ? 0.5 : 5);
  if (peers) wall(&peer, quick ? 0.5 : 5), wall(&stiff, quick ? 0.5 : 5);
}
