/// A legged robot in flight, after the two ANYmal tests of the SimBenchmark on a quadruped of our own (trunk of 16 kg, twelve
/// hinges, 31 kg): without gravity it is struck by a ball of 10 kg at 5 m/s (10 s; error of linear momentum, mean square);
/// thrown up by twice its weight for 1 s it flies for 2 s (error of energy, mean square). Links of the robot do not touch
/// each other. Under our order momentum velocities belong half a step before their configuration, so momentum is taken
/// there; under midpoint and momentum energy is taken with the mean of the velocities before and after the configuration.
/// Both Euler steps are taken as they are, which is what was published: their energy lacks what half a step of gravity is.
#include "published.h"

static const char *robot_text(int ball, double height) {
  static char text[6000];
  char *to = text + sprintf(text,
                            "<mujoco><option cone='elliptic' gravity='0 0 %g'/><default>"
                            "<geom friction='.8' condim='3' contype='1' conaffinity='2'/></default><worldbody><body "
                            "pos='0 0 %g'><freejoint/>"
                            "<geom type='box' size='.25 .12 .07' mass='16'/>",
                            ball ? 0.0 : -9.81, height);
  for (int k = 0; k < 4; k++) {
    const int x = k / 2 ? -1 : 1, y = k % 2 ? -1 : 1;
    to += sprintf(to,
                  "<body pos='%g %g 0'><joint axis='1 0 0'/><geom type='sphere' size='.05' mass='1.5'/>"
                  "<body pos='0 %g 0' euler='0 %g 0'><joint axis='0 1 0'/>"
                  "<geom type='capsule' size='.03' fromto='0 0 0 0 0 -.25' mass='1.75'/>"
                  "<body pos='0 0 -.25' euler='0 %g 0'><joint axis='0 1 0'/>"
                  "<geom type='capsule' size='.02' fromto='0 0 0 0 0 -.28' mass='.5'/></body></body></body>",
                  0.27 * x, 0.14 * y, 0.08 * y, 23.0 * x, -46.0 * x);
  }
  to += sprintf(to, "</body>");
  if (ball)
    to += sprintf(to,
                  "<body pos='0 -5 %g'><freejoint/><geom type='sphere' size='.2' mass='10' contype='2' "
                  "conaffinity='1'/></body>",
                  height);
  sprintf(to, "</worldbody></mujoco>");
  return text;
}

// linear momentum of all that moves, where the engine's velocities belong
static void momentum(suite_run *run, double p[3]) {
  const suite_setting *s = run->setting;
  if (run->model) {
    double *q = scene_vector(run->model->nq), com[3];
    cav_integrate(run->model, run->q, run->v, s->order == CAV_ORDER_MOMENTUM ? -0.5 * s->h : 0, q);
    CHECK(cav_position(run->model, run->state, q) == CAV_OK);
    cav_momentum(run->model, run->state, run->v, com, p, NULL);
    for (int k = 0; k < 3; k++) p[k] *= run->model->mass;
    free(q);
    return;
  }
#ifdef CAVORT_HAVE_MUJOCO
  mj_kinematics(run->m, run->d), mj_comPos(run->m, run->d), mj_comVel(run->m, run->d), mj_subtreeVel(run->m, run->d);
  for (int k = 0; k < 3; k++) p[k] = run->m->body_subtreemass[0] * run->d->subtree_linvel[k];
#endif
}

static void strike(const suite_setting *setting) {
  suite_run run;
  if (!suite_open(&run, robot_text(1, 2), setting)) return;
  run.v[19] = 5;
  const int n = (int)(10 / setting->h + 0.5);
  double sum = 0, p[3];
  for (int t = 0; t < n; t++) {
    momentum(&run, p);
    sum += p[0] * p[0] + pow(p[1] - 50, 2) + p[2] * p[2];
    suite_step(&run);
  }
  // it was struck
  CHECK(run.v[19] < 4.9);
  suite_row("robot struck, momentum, (kg m/s)²", &run, sum / n);
  if (!setting->mujoco && setting->order == CAV_ORDER_MOMENTUM) CHECK(sum / n < 1e-16);
  suite_close(&run);
}

// energy at the present configuration: by the velocity as the engine has it, or under our second-order steps by the mean of
// those before and after
static double energy(suite_run *run) {
  if (!run->model || run->setting->order == CAV_ORDER_EULER) return suite_energy(run);
  const int nv = run->model->nv;
  double *now = scene_vector(nv);
  memcpy(now, run->v, (size_t)nv * sizeof *now);
  CHECK(cav_forward(run->model, run->state, run->q, now, run->u, run->next) == CAV_OK);
  for (int i = 0; i < nv; i++) run->v[i] = 0.5 * (now[i] + run->next[i]);
  const double sum = suite_energy(run);
  memcpy(run->v, now, (size_t)nv * sizeof *now);
  free(now);
  return sum;
}

static void throw(const suite_setting *setting) {
  suite_run run;
  if (!suite_open(&run, robot_text(0, 2), setting)) return;
  const int up = (int)(1 / setting->h + 0.5), n = (int)(2 / setting->h + 0.5);
  double sum = 0, first = 0;
  for (int t = 0; t < up + n; t++) {
    run.u[2] = t < up ? 2 * 31 * 9.81 : 0;
    if (t == up) first = energy(&run);
    if (t >= up) sum += pow(energy(&run) - first, 2);
    suite_step(&run);
  }
  suite_row("robot thrown, energy, J²", &run, sum / n);
  suite_close(&run);
}

void suite_robot(int quick) {
  static const double step[] = {0.01, 0.001};
  for (int k = 0; k < (quick ? 1 : 2); k++) {
    const suite_setting by[] = {
        {.text = "order momentum", .h = step[k], .order = CAV_ORDER_MOMENTUM},
        {.text = "order midpoint", .h = step[k], .order = CAV_ORDER_MIDPOINT},
        {.text = "order euler", .h = step[k]},
        {.text = "Euler", .h = step[k], .mujoco = 1},
        {.text = "RK4", .h = step[k], .mujoco = 1, .order = 1},
    };
    for (int s = 0; s < 5; s++)
      if (suite_available(&by[s])) strike(&by[s]);
    for (int i = 0; i < 10 && !quick; i++)
      if (published_momentum[i].h == step[k])
        suite_published_row("robot struck, momentum, (kg m/s)² (ANYmal)", published_momentum[i].engine, step[k],
                            published_momentum[i].error, published_momentum[i].seconds);
    for (int s = 0; s < 5; s++)
      if (suite_available(&by[s])) throw(&by[s]);
    for (int i = 0; i < 10 && !quick; i++)
      if (published_energy[i].h == step[k])
        suite_published_row("robot thrown, energy, J² (ANYmal)", published_energy[i].engine, step[k],
                            published_energy[i].error, published_energy[i].seconds);
  }
}
