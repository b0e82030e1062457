/// The humanoid of problems/models, let go 0.3 m above its stance, falls limp on the floor: largest difference of q, m or rad,
/// 0.5 s later from the same law's own answer at a step of 0.05 ms (consistency in the sense of Erez, Tassa and Todorov).
#include "suite.h"

#ifndef CAVORT_SOURCE_ROOT
#define CAVORT_SOURCE_ROOT "."
#endif

static char *humanoid_text(void) {
  FILE *file = fopen(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", "r");
  if (!CHECK(file != NULL)) return NULL;
  char *text = calloc(1, 1 << 17);
  const size_t n = fread(text, 1, (1 << 17) - 1, file);
  fclose(file);
  CHECK(n > 0);
  return text;
}

// q after half a second
static int fall(const suite_setting *setting, const char *text, double *q, suite_run *run) {
  if (!suite_open(run, text, setting)) return 0;
  run->q[2] += 0.3;
  for (long t = lround(0.5 / setting->h); t > 0; t--) suite_step(run);
  for (int i = 0; i < 28; i++) q[i] = run->q[i];
  return 1;
}

void suite_humanoid(int quick) {
  static const double step[] = {0.01, 0.005, 0.002, 0.001};
  const suite_setting by[] = {{.text = "solref, euler"},
                              {.text = "solref, midpoint", .order = CAV_ORDER_MIDPOINT},
                              {.text = "discrete, κ 20 ms, ε 1e-2, euler",
                               .stabilisation = CAV_STABILISATION_DISCRETE,
                               .softness = 1e-2,
                               .time_constant = 0.02},
                              {.text = "Euler", .mujoco = 1},
                              {.text = "RK4", .mujoco = 1, .order = 1}};
  char *text = humanoid_text();
  double truth[28], q[28];
  for (int k = 0; k < 5 && text; k++) {
    suite_setting setting = by[k];
    suite_run run;
    if (!suite_available(&setting)) continue;
    setting.h = quick ? 5e-4 : 5e-5;
    if (!fall(&setting, text, truth, &run)) break;
    suite_close(&run);
    for (int s = 0; s < (quick ? 2 : 4); s++) {
      setting.h = step[s];
      if (!fall(&setting, text, q, &run)) break;
      double most = 0;
      for (int i = 0; i < 28; i++) most = fmax(most, fabs(q[i] - truth[i]));
      suite_row("humanoid dropped, error of q after 0.5 s", &run, most);
      if (!setting.mujoco) CHECK(run.failed == 0);
      suite_close(&run);
    }
  }
  free(text);
}
