/// 6^3 balls of the SimBenchmark: 216 balls of 10 kg and radius 0.1 m without friction, 0.21 m apart with up to 1 mm of
/// disorder (numbers of our own), lowest 1 mm above the ground, fall into each other for 10 s. Error: mean over the steps of
/// the sum of squared penetrations of all pairs and of the ground, m^2.
#include "published.h"

static const char *balls_text(void) {
  static char text[1 << 15];
  char *to = text + sprintf(text,
                            "<mujoco><size nconmax='3000' njmax='6000' nstack='40000000'/><option cone='elliptic'/>"
                            "<default><geom condim='1'/></default><worldbody><geom type='plane' size='100 100 5'/>");
  const uint64_t kept = scene_seed;
  scene_seed = 42;
  for (int i = 0; i < 216; i++) {
    const int at[] = {i / 36, i / 6 % 6, i % 6};
    double x[3];
    for (int k = 0; k < 3; k++) x[k] = 0.21 * at[k] + 0.0005 * (1 + scene_uniform());
    to += sprintf(to, "<body pos='%.6f %.6f %.6f'><freejoint/><geom type='sphere' size='.1' mass='10'/></body>", x[0],
                  x[1], x[2] + 0.101);
  }
  scene_seed = kept;
  sprintf(to, "</worldbody></mujoco>");
  return text;
}

static double penetration(const double *q) {
  double sum = 0;
  for (int i = 0; i < 216; i++) {
    const double *a = q + 7 * i;
    if (a[2] < 0.1) sum += pow(0.1 - a[2], 2);
    for (int j = i + 1; j < 216; j++) {
      const double *b = q + 7 * j, x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2], square = x * x + y * y + z * z;
      if (square < 0.04) sum += pow(0.2 - sqrt(square), 2);
    }
  }
  return sum;
}

static suite_point measure(const suite_setting *setting, double seconds) {
  suite_run run;
  suite_point point = {"cavort", setting->h, INFINITY, INFINITY};
  if (!suite_open(&run, balls_text(), setting)) return point;
  const int n = (int)(seconds / setting->h + 0.5);
  const double start = suite_energy(&run);
  double sum = 0;
  for (int t = 0; t < n; t++) {
    sum += penetration(run.q);
    suite_step(&run);
  }
  point.error = sum / n, point.seconds = run.seconds;
  suite_row("6³ balls, m²", &run, point.error);
  if (!setting->mujoco) {
    // nothing gains: the balls only lose height
    CHECK(suite_energy(&run) <= start);
    CHECK(run.failed == 0);
  }
  suite_close(&run);
  return point;
}

void suite_balls(int quick) {
  static const double step[] = {0.04, 0.01, 0.001};
  suite_point ours[3], peers[3];
  int npeer = 0;
  const int n = quick ? 1 : 3;
  for (int k = 0; k < n; k++) {
    const double seconds = quick ? 1 : 10;
    const suite_setting peer = {.text = "Newton", .h = step[k], .mujoco = 1};
    const suite_setting own = {
        .text = "discrete, κ 0, ε 1e-4", .h = step[k], .stabilisation = CAV_STABILISATION_DISCRETE, .softness = 1e-4};
    ours[k] = measure(&own, seconds);
    if (suite_available(&peer)) peers[npeer++] = measure(&peer, seconds);
  }
  suite_compare("6³ balls, m²", published_balls, sizeof published_balls / sizeof *published_balls, peers, npeer, ours,
                n);
}
