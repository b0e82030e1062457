/// optim/feasibility/float.c: what nothing can hold up for so long is refused, and nothing that flies, stands, hangs or is
/// loosely meant.
#include "impossible.h"

// a problem of a model's file, or of text; what it asks for is proven impossible, by its float, or by nothing
static void check_float(const char *name, const char *model, const char *horizon, const char *body, int wanted) {
  char path[160], text[3000];
  cav_error error = {0};
  cav_impossibility found[4];
  int file = *model != '<', n = 0;
  if (!file) scene_write(folder, "model.xml", model);
  snprintf(text, sizeof text, "<problem name='p' model='model.xml'><horizon %s/>%s</problem>", horizon, body);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *p = cav_problem_load(path, file ? model : NULL, &error);
  CHECK(p != NULL);
  if (!p) fprintf(stderr, "    %s: %s\n", name, error.text);
  if (!p) return;
  n = proofs(name, p, found, 4, wanted);
  CHECK((n > 0) == wanted);
  int told = n > 0 && found[0].condition == CAV_CONDITION_MOMENTUM && strstr(found[0].what, "nothing can hold it up") &&
             strstr(found[0].what, "allowed") && strstr(found[0].cure, "to hang from");
  CHECK(told == wanted);
  if (told != wanted) fprintf(stderr, "    %s: %s\n", name, n > 0 ? found[0].what : "no proof");
  cav_problem_free(p);
}

// a humanoid in the air: what is too long is refused, and nothing that is short, low, loosely meant or has something to
// hang from
static void check_hovers(void) {
#define HOVER(Z, FROM, TO, MORE)                                                                                       \
  "<start key='stand' height='floor'/><cost><sensor name='up' type='subtreecom' body='torso' component='z' target='" Z \
  "' from='" FROM "' to='" TO "' weight='900'" MORE                                                                    \
  "/><posture name='final posture' dofs='all' at='end' weight='900'/>"                                                 \
  "</cost>"
#define HEAD(Z, TO)                                                                                                 \
  "<start key='stand' height='floor'/><cost><sensor name='up' type='framepos' body='head' component='z' target='" Z \
  "' from='.9' to='" TO "' weight='900'/></cost>"
  static const char *const human = CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml";
  static const char *const horizon = "duration='2.4' timestep='.03'";
  check_float("hover", human, horizon, HOVER("1.4", ".9", "1.9", ""), 1);
  check_float("hover by its head", human, "duration='3' timestep='.03'", HEAD("2.6", "2.5"), 1);
  check_float("hover above a free end", human, "duration='2.4' timestep='.03' close='open'",
              "<start key='stand' height='floor'/>" CONSTRAINT(
                  "<sensor name='up' type='subtreecom' body='torso' component='z' target='1.5' from='1.2'/>"),
              1);
  // 900 knots, of which every fourth is collected
  check_float("hover in short steps", human, "duration='2.7' timestep='.003'", HOVER("1.4", ".9", "1.9", ""), 1);
  // a cost over the whole motion, which is no goal
  check_float("a wish", human, horizon,
              "<start key='stand' height='floor'/><cost><sensor type='subtreecom' body='torso' component='z' "
              "target='1.4' weight='9'/></cost>",
              0);
  check_float("a jump", human, horizon, HOVER("1.4", ".9", "1.1", " within='.05'"), 0);
  check_float("a wide tolerance", human, horizon, HOVER("1.7", ".9", "1.9", " within='.35'"), 0);
  check_float("a stand", human, horizon, HOVER(".95", ".9", "1.9", ""), 0);
  check_float("a head up", human, horizon, HEAD("1.9", "1.9"), 0);
  check_float("two targets in the air", human, horizon,
              "<start key='stand' height='floor'/><cost><sensor name='one' type='subtreecom' body='torso' "
              "component='z' target='1.4' at='.6' weight='900'/><sensor name='two' type='subtreecom' body='torso' "
              "component='z' target='1.4' at='1.8' weight='900'/></cost>",
              0);
  check_float("a bar to hang from", human, horizon,
              "<scene><geom name='bar' type='capsule' pos='0 0 2.2' euler='90 0 0' size='.02 1'/></scene>" HOVER(
                  "1.4", ".9", "1.9", ""),
              0);
  check_float(
      "a box to stand on", human, horizon,
      "<scene><geom name='box' type='box' pos='1 0 .25' size='.4 .4 .25'/></scene>" HOVER("1.4", ".9", "1.9", ""), 0);
  // at the shortest it lasts 0.2 s
  check_float("a duration that is free", human, "duration='2.4' range='.5 2.5' timestep='.03'",
              HOVER("1.4", ".9", "1.9", " within='.05'"), 0);
  check_float("a duration that is free but long", human, "duration='2.4' range='2 2.5' timestep='.03'",
              HOVER("1.4", ".9", "1.9", " within='.05'"), 1);
}

#define BALL(GRAVITY, MORE)                                                  \
  "<mujoco><option gravity='0 0 " GRAVITY                                    \
  "'/><worldbody><geom type='plane' size='9 9 1'/><body name='ball' pos='0 " \
  "0 .1'><freejoint/><geom name='ball' type='sphere' size='.1' mass='1'/></body>" MORE "</worldbody></mujoco>"

// g (m h)² of second differences less what certificates leave of momentum, and, near the ground, of contacts that bear
// across gaps: a ball thrown up, within 2 w for 2 m steps of h, is refused where 4 w + 1 mm is less than that
static void check_flights(void) {
  double g = 9.81, h = 0.01, n = 202;
  for (int low = 0; low < 2; low++) {
    for (int m = low ? 14 : 5; m <= 40; m += 13) {
      double momentum = 0.005 * sqrt(6 * n * m * (2. * m * m + 1) / 3), lift = low ? 0.03 * 2 * n * m : 0;
      double w = (g * h * h * (m * m - momentum - lift) - 1e-3) / 4;
      for (int beyond = 0; beyond < 2; beyond++) {
        char body[700];
        double within = w * (beyond ? 0.999 : 1.001), z = low ? within + .12 : 5 - within;
        snprintf(body, sizeof body,
                 "<start %s/><cost><sensor name='apex' type='subtreecom' body='ball' component='z' target='%.9f' "
                 "within='%.9f' from='%g' to='%g' weight='9'/></cost>",
                 low ? "" : "qvel='0 0 9.81 0 0 0'", z, within, 1 - m * h, 1 + m * h);
        check_float("flight", BALL("-9.81", ""), "duration='2' timestep='.01' close='open'", body, beyond);
        if (!beyond) continue;
        check_float("flight past a box", BALL("-9.81", "<geom type='box' pos='3 0 1' size='1 1 1'/>"),
                    "duration='2' timestep='.01' close='open'", body, 0);
      }
      if (!low)
        printf("flight of %.2f s: proven from %.4g m on, g T^2/8 %.4g m\n", 2 * m * h, 2 * w, g * m * m * h * h / 2);
    }
  }
  check_float("no gravity", BALL("0", ""), "duration='2' timestep='.01' close='open'",
              "<start qpos='0 0 5 1 0 0 0'/><cost><sensor name='up' type='subtreecom' body='ball' component='z' "
              "target='5' from='.5' to='1.5' within='.01' weight='9'/></cost>",
              0);
  // the throw itself, within a tenth more than its curve takes
  char path[160];
  cav_error error = {0};
  check_float("throw", BALL("-9.81", ""), "duration='1' timestep='.01' close='open'",
              "<start qpos='0 0 3 1 0 0 0' qvel='0 0 4.905 0 0 0'/><guess apex='1.22' from='0' to='1'/><cost><sensor "
              "name='apex' type='subtreecom' body='ball' component='z' target='3.98' from='.2' to='.8' within='.245' "
              "weight='9'/></cost>",
              0);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *p = cav_problem_load(path, NULL, &error);
  CHECK(p != NULL);
  if (p) check_possible("throw", p);
  cav_problem_free(p);
}

enum { STEPS = 60, ROLLOUTS = 12 };

// a step under full effort of all actuators, this way and that
static int flail(const cav_model *m, cav_state *state, int rollout, double *q, double *v) {
  double *u = scene_vector(3 * m->nv), *next = u + m->nv, *moment = next + m->nv;
  for (int i = 0; i < m->nu; i++) {
    double range[2];
    cav_actuator_effort_range(m, i, range);
    cav_actuator_length(m, state, i, moment);
    for (int d = 0; d < m->nv; d++) u[d] += range[(i + rollout) % 2] * m->actuator[i].unit * moment[d];
  }
  int ok = cav_forward(m, state, q, v, u, next) == CAV_OK;
  if (ok) memcpy(v, next, sizeof(double) * (size_t)m->nv);
  if (ok) cav_integrate(m, q, v, state->options.timestep, q);
  free(u);
  return ok;
}

// a humanoid that flails at full effort as it is thrown, at 3 m/s and rad/s: its centre of mass where it came to
// at every knot, within a millimetre, is possible
static void check_flails(void) {
  cav_error error = {0};
  cav_model *m = cav_model_load(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", &error);
  cav_state *state = m ? cav_state_new(m) : NULL;
  CHECK(state != NULL);
  int done = 0;
  for (int i = 0; state && i < ROLLOUTS; i++) {
    double *q = scene_vector(2 * m->nq), *v = scene_vector(2 * m->nv), *target = scene_vector(3 * (STEPS + 1));
    double *start = q + m->nq, *v_start = v + m->nv, time[STEPS + 1], h = i % 2 ? 0.02 : 0.01;
    cav_sensor centre = {
        .name = "", .type = CAV_SENSOR_SUBTREECOM, .object_type = CAV_OBJECT_BODY, .object = 1, .dim = 3};
    state->options.timestep = h, state->options.order = CAV_ORDER_MOMENTUM;
    scene_normals(v_start, m->nv, 3);
    memcpy(start, m->q0, sizeof(double) * (size_t)m->nq);
    start[2] += 3, v_start[2] += 4;
    memcpy(q, start, sizeof(double) * (size_t)m->nq), memcpy(v, v_start, sizeof(double) * (size_t)m->nv);
    int n = 0, proofs = 0, floats = 0;
    for (int ok = 1; ok && n <= STEPS; n++) {
      ok = cav_position(m, state, q) == CAV_OK;
      cav_sensor_read(m, state, &centre, target + 3 * (size_t)n);
      time[n] = n * h;
      if (ok && n < STEPS) ok = flail(m, state, i, q, v);
      if (!ok) break;
    }
    if (n > STEPS) {
      cav_problem p = cav_problem_default(m);
      cav_impossibility found[8];
      cav_term term = {.name = "",
                       .quantity = CAV_QUANTITY_SENSOR,
                       .use = CAV_USE_COST,
                       .sensor = centre,
                       .component = 2,
                       .to = -1,
                       .scale = 1,
                       .weight = 1,
                       .within = 1e-3,
                       .nwaypoint = n,
                       .waypoint_time = time,
                       .target = target};
      p.timestep = h, p.duration = STEPS * h, p.close_at_rest = 0;
      p.q_start = start, p.v_start = v_start, p.q_goal = start, p.term = &term, p.nterm = 1;
      CHECK(cav_problem_impossible(&p, found, 8, &proofs, &error) == CAV_OK);
      for (int k = 0; k < proofs; k++) floats += strstr(found[k].what, "nothing can hold it up") != NULL;
      if (floats) fprintf(stderr, "    flail %d: %s\n", i, found[0].what);
    }
    CHECK(floats == 0);
    done += n > STEPS;
    free(q), free(v), free(target);
  }
  CHECK(done >= ROLLOUTS - 2); // a step may have no solution
  cav_state_free(state);
  cav_model_free(m);
}

int main(void) {
  if (!mkdtemp(folder)) return EXIT_FAILURE;
  check_hovers();
  check_flights();
  check_flails();
  scene_remove(folder);
  return check_result();
}
