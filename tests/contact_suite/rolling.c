/// Rolling test of the SimBenchmark: a box of 10 kg (20 x 20 x 1 m) on the ground (friction 0.4) carries 25 balls of 1 kg and
/// radius 0.5 m (friction 0.8) and is dragged by 150 N for 4 s along (cos 60, sin 60). It slides, the balls roll; both
/// accelerations are known: with f1 = 0.4 (M + 25 m) g, a ball is pulled by f2 = (F - f1)/M/(3.5/m + 25/M). Error: mean over
/// the steps of the squared errors of velocity of the box and of the first ball, (m/s)^2.
#include "published.h"

static const double FORCE = 150, SECONDS = 4, G = 9.81, MASS = 10, BALL = 1, BALLS = 25;

static const char *rolling_text(void) {
  static char text[8000];
  // penetration at the start as published: 20 um under the box, 40 um under each ball
  char *to = text + sprintf(text,
                            "<mujoco><size njmax='600' nconmax='200'/><option cone='elliptic'/>"
                            "<worldbody>"
                            "<geom type='plane' size='100 100 5' friction='.4 0 0'/><body pos='0 0 .49998'><freejoint/>"
                            "<geom type='box' size='10 10 .5' mass='10' friction='.4 0 0'/></body>");
  for (int i = 0; i < 25; i++)
    to += sprintf(to,
                  "<body pos='%d %d 1.49994'><freejoint/><geom type='sphere' size='.5' mass='1' friction='.8 0 0'/>"
                  "</body>",
                  2 * (i / 5) - 4, 2 * (i % 5) - 4);
  sprintf(to, "</worldbody></mujoco>");
  return text;
}

static suite_point measure(const suite_setting *setting) {
  const double along[3] = {0.5, 0.866025403784438647, 0}, h = setting->h;
  const double ground = 0.4 * (MASS + BALLS * BALL) * G, pull = (FORCE - ground) / MASS / (3.5 / BALL + BALLS / MASS);
  const double box = (FORCE - ground - BALLS * pull) / MASS, ball = pull / BALL;
  suite_run run;
  suite_point point = {"cavort", h, INFINITY, INFINITY};
  if (!suite_open(&run, rolling_text(), setting)) return point;
  const int n = (int)(SECONDS / h + 0.5);
  double sum = 0;
  for (int t = 0; t < n; t++) {
    for (int k = 0; k < 3; k++) {
      sum += pow(run.v[k] - along[k] * box * h * t, 2) + pow(run.v[6 + k] - along[k] * ball * h * t, 2);
      run.u[k] = along[k] * FORCE;
    }
    suite_step(&run);
  }
  point.error = sum / n, point.seconds = run.seconds;
  suite_row("rolling balls, (m/s)²", &run, point.error);
  suite_close(&run);
  return point;
}

void suite_rolling(int quick) {
  static const double step[] = {0.04, 0.01, 0.001};
  suite_point ours[3], peers[6];
  int npeer = 0;
  const int n = quick ? 2 : 3;
  for (int k = 0; k < n; k++) {
    const suite_setting peer = {.text = "Newton, elliptic", .h = step[k], .mujoco = 1};
    const suite_setting tuned = {.text = "Newton, elliptic, solref 0.1 1, solimp 0.9",
                                 .h = step[k],
                                 .mujoco = 1,
                                 .softness = 1 / 9.0,
                                 .time_constant = 0.1};
    const suite_setting own = {.text = "discrete, κ 0.1 s, ε 1e-4, Coulomb",
                               .h = step[k],
                               .stabilisation = CAV_STABILISATION_DISCRETE,
                               .softness = 1e-4,
                               .time_constant = 0.1,
                               .sliding = CAV_SLIDING_COULOMB};
    ours[k] = measure(&own);
    if (!suite_available(&peer)) continue;
    // as published, and the best of those tried (results/contact_suite.md)
    peers[npeer++] = measure(&peer);
    peers[npeer++] = measure(&tuned);
  }
  // the paper's law, which holds off what slides
  const suite_setting convex = {.text = "discrete, κ 0.1 s, ε 1e-4, convex",
                                .h = 0.01,
                                .stabilisation = CAV_STABILISATION_DISCRETE,
                                .softness = 1e-4,
                                .time_constant = 0.1};
  measure(&convex);
  suite_compare("rolling balls, (m/s)²", published_rolling, sizeof published_rolling / sizeof *published_rolling, peers,
                npeer, ours, n);
}
