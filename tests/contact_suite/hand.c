/// A hand of 29 dofs (a wrist of three slides and a hinge, five fingers of five hinges) closes on a capsule in the air by
/// constant torques and holds it against gravity: 35 dofs with the capsule, after the grasp of Erez, Tassa and Todorov (ICRA
/// 2015). The largest step at which the capsule is still in the hand after 3 s; the error is the step, larger is better.
#include "suite.h"

static const char *hand_text(void) {
  static char text[12000];
  char *to =
      text +
      sprintf(text,
              "<mujoco><compiler angle='degree'/><size nconmax='400' njmax='900'/><option cone='elliptic'/><default>"
              "<geom friction='1' condim='4' density='2000'/><joint damping='.01' armature='.0005'/></default>"
              "<worldbody><body pos='0 0 .4'>");
  for (int k = 0; k < 3; k++)
    to += sprintf(to, "<joint type='slide' axis='%d %d %d' stiffness='300' damping='20'/>", k == 0, k == 1, k == 2);
  to += sprintf(to, "<joint axis='0 0 1' stiffness='3' damping='.2'/><geom type='cylinder' size='.06 .01' mass='.5'/>");
  for (int f = 0; f < 5; f++) {
    to += sprintf(to, "<body euler='0 0 %d'><body pos='.055 0 -.01'>", 72 * f);
    for (int j = 0; j < 5; j++) {
      // the first turns aside, the rest close inwards
      to += sprintf(to, "%s<joint axis='%d %d 0' limited='true' range='%s'/>%s", j > 1 ? "<body pos='0 0 -.03'>" : "",
                    j == 0, j > 0, j ? "-30 70" : "-10 10",
                    j ? "<geom type='capsule' size='.009' fromto='0 0 0 0 0 -.03'/>" : "");
    }
    to += sprintf(to, "</body></body></body></body></body>");
  }
  sprintf(to,
          "</body><body pos='0 0 .33'><freejoint/><geom type='capsule' size='.025 .05' mass='.3'/></body></worldbody>"
          "</mujoco>");
  return text;
}

static int holds(const suite_setting *setting, suite_run *run) {
  if (!suite_open(run, hand_text(), setting)) return 0;
  const int base = 29;
  for (long t = 0, n = lround(3 / setting->h); t < n; t++) {
    // closing torques, N m; the capsule is borne until the hand has closed
    for (int f = 0; f < 5; f++)
      for (int j = 1; j < 5; j++) run->u[4 + 5 * f + j] = 0.25 / j;
    run->u[base + 2] = (double)t * setting->h < 0.4 ? 0.3 * 9.81 : 0;
    suite_step(run);
  }
  // where it was between the fingers
  const double *q = run->q + base, *wrist = run->q;
  return isfinite(q[2]) && fabs(q[2] - wrist[2] - 0.33) < 0.04 && hypot(q[0] - wrist[0], q[1] - wrist[1]) < 0.03;
}

static double largest(suite_setting setting) {
  static const double step[] = {0.256, 0.192, 0.128, 0.096, 0.064, 0.032, 0.016, 0.008, 0.004, 0.002, 0.001};
  for (int k = 0; k < 11; k++) {
    suite_run run;
    setting.h = step[k];
    const int held = holds(&setting, &run);
    if (held) suite_row("hand of 29 dofs holds a capsule, largest step, s", &run, step[k]);
    suite_close(&run);
    if (held) return step[k];
  }
  return 0;
}

void suite_hand(int quick) {
  (void)quick;
  const suite_setting discrete = {.text = "discrete, κ 20 ms, ε 1e-3",
                                  .stabilisation = CAV_STABILISATION_DISCRETE,
                                  .softness = 1e-3,
                                  .time_constant = 0.02},
                      solref = {.text = "solref 0.02 1"}, peer = {.text = "solref 0.02 1", .mujoco = 1};
  CHECK(largest(discrete) >= 0.064);
  if (quick) return;
  largest(solref);
  if (suite_available(&peer)) largest(peer);
}
