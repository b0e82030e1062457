/// dynamics/model/part.c, optim/solver/idle.c: a part of a model computes what the model without the rest computes, to the bit;
/// trees are left out of a plan only where no one asks for them and nothing comes near; the plan is to the bit that of the scene
/// without them, and they move beside it as the dynamics has it; what the guess did not foresee is noticed and planned.
#include "cavort/solve.h"
#include "crowd.h"
#include "idle.h"

static char folder[] = "/tmp/cavort-idle-XXXXXX";

// a cart on a rail; after it what a test adds to the world, then actuators and sensors
static const char cart[] =
    "<mujoco><worldbody><geom type='plane' size='50 50 1'/><body name='cart' pos='0 0 .5'>"
    "<joint name='rail' type='slide' axis='1 0 0' damping='.5'/><geom name='buffer' type='box' size='.1 .1 .1' "
    "mass='2'/>"
    "<body name='mast' pos='0 0 .1'><joint name='tilt' axis='0 1 0' limited='true' range='-60 60'/>"
    "<geom type='capsule' fromto='0 0 0 0 0 .4' size='.03' mass='.3'/><site name='top' pos='0 0 .4'/></body></body>%s"
    "</worldbody>%s<actuator><motor joint='rail' gear='50' ctrllimited='true' ctrlrange='-1 1'/>"
    "<motor joint='tilt' gear='20' ctrllimited='true' ctrlrange='-1 1'/>%s</actuator></mujoco>";

static const char ball[] =
    "<body name='ball' pos='0 10 .0999'><joint name='loose' type='free'/><geom size='.1'/></body>";

static const char *closing = "rest";

static cav_problem *load(const char *world, const char *joined, const char *actuators, const char *terms) {
  char path[160], text[6000];
  cav_error error = {0};
  snprintf(text, sizeof text, cart, world, joined, actuators);
  scene_write(folder, "model.xml", text);
  snprintf(text, sizeof text,
           "<problem name='p' model='model.xml'><horizon duration='.6' timestep='.03' close='%s'/><start/>"
           "<schedule stages='4'/>%s</problem>",
           closing, terms);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *problem = cav_problem_load(path, NULL, &error);
  if (!CHECK(problem != NULL)) fprintf(stderr, "    %s\n", error.text);
  return problem;
}

static void done(cav_problem *p) { cav_problem_free(p); }

// how many trees are left out
static int left_out(const char *world, const char *joined, const char *actuators, const char *terms) {
  cav_problem *p = load(world, joined, actuators, terms);
  cav_idle idle;
  if (!p) return -1;
  CHECK(cav_idle_find(p, &idle) == CAV_OK);
  int trees = idle.ntree;
  CHECK(trees == 0 || (idle.plan.model->nv + idle.idle.model->nv == p->model->nv && idle.idle.model->nv == idle.ndof));
  cav_idle_clear(&idle);
  cav_equations equations;
  CHECK(cav_problem_equations(p, &equations, NULL) == CAV_OK && equations.left_out == trees);
  CHECK(equations.rows_time > 0 && equations.sums_time > 0 && equations.factor_time > 0);
  done(p);
  return trees;
}

static void check_asked(void) {
  const char *goal = "<constraint><sensor type='jointpos' joint='rail' target='.4' at='end'/></constraint>";
  CHECK(left_out(ball, "", "", goal) == 1);
  // controls: near the cart; asked for by a sensor, a posture, a rate, a constraint, an actuator, joined, seen
  CHECK(left_out("<body pos='.3 0 .0999'><freejoint/><geom size='.1'/></body>", "", "", goal) == 0);
  CHECK(left_out(ball, "", "",
                 "<cost><sensor type='framepos' body='ball' target='0 9 .1' at='end' weight='1'/></cost>") == 0);
  CHECK(left_out(ball, "", "",
                 "<cost><sensor type='subtreecom' body='world' target='0 9 .1' at='end' weight='1'/></cost>") == 0);
  CHECK(left_out(ball, "", "", "<cost><posture joint='loose' at='end' weight='1'/></cost>") == 0);
  CHECK(left_out(ball, "", "", "<constraint><velocity joint='loose' at='end'/></constraint>") == 0);
  CHECK(left_out(ball, "", "", "<cost><sensor type='rangefinder' site='top' at='end' weight='1'/></cost>") == 0);
  CHECK(left_out(ball, "", "<motor joint='loose' gear='0 0 1 0 0 0'/>", goal) == 0);
  CHECK(left_out(ball, "<equality><connect body1='ball' body2='mast' anchor='0 0 0'/></equality>", "", goal) == 0);
  // a cost over all postures asks nothing of what is where it shall be
  CHECK(left_out(ball, "", "", "<cost><posture at='end' weight='1'/></cost>") == 1);
  // one that still falls in the end, which a motion that closes at rest does not leave to itself
  const char *falls = "<body pos='0 10 5'><freejoint/><geom size='.1'/></body>";
  CHECK(left_out(falls, "", "", goal) == 0);
  closing = "open";
  CHECK(left_out(falls, "", "", goal) == 1);
  closing = "rest";
  // one that flies in, one on top of it
  CHECK(left_out("<body pos='0 0 2'><freejoint/><geom size='.1'/></body>", "", "", goal) == 0);
  CHECK(left_out("<body pos='0 10 .0999'><freejoint/><geom size='.1'/></body><body pos='0 10 .3'><freejoint/>"
                 "<geom size='.1'/></body><body pos='.2 0 .0999'><freejoint/><geom size='.1'/></body>",
                 "", "", goal) == 2);
  // joined to one that is near: kept with it
  CHECK(left_out("<body name='a' pos='0 10 .0999'><freejoint/><geom size='.1'/></body><body name='b' pos='.3 0 .0999'>"
                 "<freejoint/><geom size='.1'/></body>",
                 "<equality><weld body1='a' body2='b'/></equality>", "", goal) == 0);
}

// random states: the part's inverse is that of the model without the balls
static void check_part(void) {
  char path[2][40] = {"/tmp/cavort-crowd-XXXXXX", "/tmp/cavort-crowd-XXXXXX"};
  cav_model *m[2];
  for (int k = 0; k < 2; k++) {
    CHECK(crowd_write(k ? 5 : 0, 3, path[k]));
    m[k] = cav_model_load(path[k], NULL);
    unlink(path[k]);
  }
  if (!CHECK(m[0] && m[1])) return;
  char *keep = calloc((size_t)m[1]->nlink, 1);
  cav_part part;
  keep[1] = 1;
  CHECK(cav_part_take(m[1], keep, &part) == CAV_OK);
  CHECK(part.model->nv == m[0]->nv && part.model->npair == m[0]->npair && part.model->nu == m[0]->nu);
  CHECK(part.model->mass == m[0]->mass && part.model->ntendon == m[0]->ntendon && part.model->nsite == m[0]->nsite);
  cav_state *state[2] = {cav_state_new(m[0]), cav_state_new(part.model)};
  double *q = scene_vector(m[0]->nq), *v = scene_vector(4 * m[0]->nv), *u = v + m[0]->nv;
  int contacts = 0, nv = m[0]->nv;
  for (int i = 0; i < 200; i++) {
    scene_posture(m[0], q, v, 0.3);
    q[2] -= 0.6 * fabs(scene_uniform());
    scene_normals(v, nv, 1);
    CHECK(cav_inverse(m[0], state[0], q, v, v, u) == CAV_OK);
    CHECK(cav_inverse(part.model, state[1], q, v, v, u + nv) == CAV_OK);
    CHECK(!memcmp(u, u + nv, (size_t)nv * sizeof *u) && state[0]->ncontact == state[1]->ncontact);
    contacts += state[0]->ncontact;
  }
  CHECK(contacts > 200);
  cav_state_free(state[0]), cav_state_free(state[1]);
  cav_part_clear(&part);
  cav_model_free(m[0]), cav_model_free(m[1]);
  free(keep), free(q), free(v);
}

static cav_solution *solve(const cav_problem *p, cav_verdict *verdict) {
  cav_solve_options options = cav_solve_options_default();
  cav_solution *s = NULL;
  cav_error error = {0};
  cav_status status = cav_solve(p, &options, NULL, &s, &error);
  if (!CHECK(status == CAV_OK && s)) fprintf(stderr, "    %s: %s\n", cav_status_name(status), error.text);
  if (!s) return NULL;
  CHECK(s->trajectory->nq == p->model->nq && s->trajectory->nv == p->model->nv);
  CHECK(cav_verify(p, s->trajectory, &s->contact, s->gain_q, s->gain_v, verdict, &error) == CAV_OK);
  return s;
}

// a scene with spectators before and after the cart in the file, one of them falling: the cart's motion and gains to the bit
static void check_bits(void) {
  const char *goal = "<constraint><sensor type='jointpos' joint='rail' target='.4' at='end'/></constraint>";
  cav_problem *p[2] = {
      load("", "", "", goal),
      load("<body pos='0 10 .0999'><freejoint/><geom size='.1'/></body><body pos='3 10 .0999'><freejoint/>"
           "<geom size='.1'/></body>",
           "", "", goal)};
  cav_verdict verdict[2];
  if (!p[0] || !p[1]) return;
  cav_solution *s[2] = {solve(p[0], &verdict[0]), solve(p[1], &verdict[1])};
  if (!s[0] || !s[1]) return;
  CHECK(verdict[0].certified);
  if (!CHECK(verdict[1].certified)) fprintf(stderr, "    %s\n", verdict[1].reason);
  CHECK(s[0]->iterations == s[1]->iterations && s[0]->nrow == s[1]->nrow && s[0]->cost == s[1]->cost);
  int knots = s[0]->trajectory->nknot, nv = s[0]->trajectory->nv, wide = s[1]->trajectory->nv;
  double moved = 0;
  for (int t = 0; t < knots; t++) {
    const cav_trajectory *a = s[0]->trajectory, *b = s[1]->trajectory;
    CHECK(!memcmp(a->q + t * a->nq, b->q + t * b->nq, (size_t)a->nq * sizeof(double)));
    CHECK(!memcmp(a->u + t * nv, b->u + t * wide, (size_t)nv * sizeof(double)));
    for (int i = 0; i < nv && t + 1 < knots; i++)
      CHECK(
          !memcmp(s[0]->gain_q + (t * nv + i) * nv, s[1]->gain_q + (t * wide + i) * wide, (size_t)nv * sizeof(double)));
    moved = fmax(moved, fabs(b->q[t * b->nq + 4] - b->q[4]));
  }
  // the balls settle by themselves
  CHECK(moved > 1e-6 && moved < 0.01);
  for (int k = 0; k < 2; k++) cav_solution_free(s[k]), done(p[k]);
}

// a block on a rail of its own where the cart has to go, farther than the guess tells: it is left out at first, and pushed in the
// end
static void check_met(void) {
  const char *block =
      "<body name='block' pos='1.5 0 .5'><joint name='pushed' type='slide' axis='1 0 0' damping='2'/>"
      "<geom type='box' size='.1 .1 .1' mass='.5'/></body>";
  const char *goal = "<constraint><sensor type='jointpos' joint='rail' target='1.6' at='end'/></constraint>";
  closing = "open";
  CHECK(left_out(block, "", "", goal) == 1);
  cav_problem *p = load(block, "", "", goal);
  cav_verdict verdict;
  cav_solution *s = p ? solve(p, &verdict) : NULL;
  if (s) {
    const double *end = s->trajectory->q + (size_t)(s->trajectory->nknot - 1) * (size_t)s->trajectory->nq;
    printf("cart at %.3f m, block pushed by %.3f m: %s\n", end[0], end[2],
           verdict.certified ? "certified" : verdict.reason);
    // its face was at 1.4 m, the cart's goes to 1.7 m
    CHECK(fabs(end[0] - 1.6) < 1e-6 && end[2] > 0.29);
  }
  cav_solution_free(s);
  done(p);
}

int main(void) {
  CHECK(mkdtemp(folder) != NULL);
  check_part();
  check_asked();
  check_bits();
  check_met();
  char command[200];
  snprintf(command, sizeof command, "rm -r %s", folder);
  CHECK(system(command) == 0);
  return check_result();
}
