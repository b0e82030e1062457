/// Chains of hinges in the air: time of a step of 50 dofs by turns, and energy of ten links that swing from the horizontal.
#include "suite.h"

static const char *chain_text(int n) {
  static char text[1 << 14];
  char *to = text + sprintf(text, "<mujoco><worldbody>");
  for (int i = 0; i < n; i++)
    to += sprintf(to,
                  "<body pos='%g 0 0'><joint axis='%d %d 0'/><geom type='capsule' fromto='0 0 0 .1 0 0' size='.02' "
                  "contype='0' conaffinity='0'/>",
                  i ? 0.1 : 0.0, i % 2, !(i % 2));
  for (int i = 0; i < n; i++) to += sprintf(to, "</body>");
  sprintf(to, "</worldbody></mujoco>");
  return text;
}

// least of nine turns of 200 steps from rest each, s a step
static void race(void) {
  const suite_setting by[] = {{.text = "order euler", .h = 0.002}, {.text = "Euler", .h = 0.002, .mujoco = 1}};
  double best[2] = {INFINITY, INFINITY};
  suite_run run[2];
  for (int turn = 0; turn < 9; turn++)
    for (int k = 0; k < 2 && suite_available(&by[k]); k++) {
      if (!suite_open(&run[k], chain_text(50), &by[k])) return;
      for (int t = 0; t < 200; t++) suite_step(&run[k]);
      best[k] = fmin(best[k], run[k].seconds / 200);
      CHECK(run[k].failed == 0);
      suite_close(&run[k]);
    }
  for (int k = 0; k < 2 && suite_available(&by[k]); k++) {
    suite_run row = {.setting = &by[k], .seconds = best[k]};
    suite_row("chain of 50 dofs, time of a step over ours", &row, best[k] / best[0]);
  }
#ifndef SANITIZED
  CHECK(!suite_available(&by[1]) || best[0] <= 1.5 * best[1]);
#endif
}

static void swing(const suite_setting *setting) {
  suite_run run;
  if (!suite_open(&run, chain_text(10), setting)) return;
  const double first = suite_energy(&run), scale = 10 * 0.1 * 9.81 * 0.5;
  double most = 0;
  for (long t = lround(2 / setting->h); t > 0; t--) {
    suite_step(&run);
    most = fmax(most, fabs(suite_energy(&run) - first));
  }
  suite_row("swinging chain, drift of energy over 5 J, 2 s", &run, most / scale);
  suite_close(&run);
}

void suite_chains(int quick) {
  race();
  const suite_setting by[] = {{.text = "order euler", .h = 0.002},
                              {.text = "order midpoint", .h = 0.002, .order = CAV_ORDER_MIDPOINT},
                              {.text = "Euler", .h = 0.002, .mujoco = 1},
                              {.text = "RK4", .h = 0.002, .mujoco = 1, .order = 1}};
  for (int k = 0; k < 4 && !quick; k++)
    if (suite_available(&by[k])) swing(&by[k]);
}
