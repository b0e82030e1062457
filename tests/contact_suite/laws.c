/// How near the law is to Signorini's and Coulomb's, on contacts met while 20 boxes are thrown on the floor and slide (1 s at
/// 5 ms). Over all contacts and steps the largest: penetration that the step leaves by the linear gap, force times the gap it
/// leaves (complementarity), force times the normal velocity beyond what closes the gap, friction beyond its cone, and what
/// friction dissipates less than Coulomb's would at that slip (maximum dissipation), over weight and speed of a box.
#include "suite.h"

static const char *boxes_text(void) {
  static char text[6000];
  char *to = text + sprintf(text, "<mujoco><option cone='elliptic'/><worldbody><geom type='plane' size='50 50 1'/>");
  for (int i = 0; i < 20; i++)
    to += sprintf(to,
                  "<body pos='%g %g %g' euler='%d %d 0'><freejoint/><geom type='box' size='.1 .08 .06' mass='1' "
                  "friction='.5'/></body>",
                  0.25 * (i % 5), 0.25 * (i / 5), 0.2 + 0.03 * i, 17 * i, 31 * i);
  sprintf(to, "</worldbody></mujoco>");
  return text;
}

typedef struct residuals {
  double penetration, complementarity, cone, dissipation;
} residuals;

static void look(const cav_state *state, double h, residuals *r) {
  const double weight = 9.81;
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    const double *f = c->impulse, *v = c->velocity_next, gap = c->dist - c->margin + h * v[0], mu = c->friction[0];
    const double slip = hypot(v[1], v[2]), force = f[0] / h, friction = hypot(f[1], f[2]) / h;
    r->penetration = fmax(r->penetration, -gap);
    r->complementarity = fmax(r->complementarity, force * fabs(gap) / weight);
    r->cone = fmax(r->cone, (friction - mu * force) / weight);
    r->dissipation = fmax(r->dissipation, (mu * force * slip + (f[1] * v[1] + f[2] * v[2]) / h) / weight);
    CHECK(force >= 0);
  }
}

static void measure(const suite_setting *setting) {
  suite_run run;
  residuals r = {0, 0, 0, 0};
  if (!suite_open(&run, boxes_text(), setting)) return;
  for (int i = 0; i < 20; i++) run.v[6 * i] = 2 * sin(i), run.v[6 * i + 1] = 2 * cos(i);
  for (int t = 0; t < 200; t++) {
    suite_step(&run);
    look(run.state, setting->h, &r);
  }
  suite_row("law, penetration left (Signorini), m", &run, fmax(0, r.penetration));
  suite_row("law, force times gap left, over weight, m", &run, r.complementarity);
  suite_row("law, friction beyond its cone, over weight", &run, fmax(0, r.cone));
  suite_row("law, dissipation short of the most, over weight, m/s", &run, r.dissipation);
  CHECK(run.failed == 0);
  CHECK(r.cone < 1e-9);
  suite_close(&run);
}

void suite_laws(int quick) {
  static const double softness[] = {1e-2, 1e-4};
  for (int k = 0; k < 4; k++) {
    char text[80];
    snprintf(text, sizeof text, "discrete, κ 0, ε %.0e, %s", softness[k / 2], k % 2 ? "Coulomb" : "convex");
    const suite_setting setting = {.text = text,
                                   .h = 0.005,
                                   .stabilisation = CAV_STABILISATION_DISCRETE,
                                   .softness = softness[k / 2],
                                   .sliding = k % 2 ? CAV_SLIDING_COULOMB : CAV_SLIDING_CONVEX};
    if (!quick || k == 0) measure(&setting);
  }
}
