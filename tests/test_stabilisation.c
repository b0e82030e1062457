/// Stabilisation, predicted against measured (Todorov 2014, section V): depth at rest, decay of sliding, critical damping
/// by the diagonal and by coupled rows, convergence of soft to hard equality constraints. Prints the tables of
/// results/stabilisation.md.
#include "scene.h"

typedef struct bench {
  cav_model *model;
  cav_state *state;
  double *q, *v, *u, *next;
} bench;

static int bench_open(bench *b, const char *text) {
  *b = (bench){.model = scene_load(text)};
  b->state = b->model ? cav_state_new(b->model) : NULL;
  if (!CHECK(b->state != NULL)) return 0;
  double **const all[] = {&b->q, &b->v, &b->u, &b->next};
  for (int i = 0; i < 4; i++) *all[i] = scene_vector(b->model->nq);
  cav_configuration_reset(b->model, b->q);
  return 1;
}

static void bench_close(bench *b) {
  cav_state_free(b->state);
  cav_model_free(b->model);
  free(b->q), free(b->v), free(b->u), free(b->next);
}

// one step without applied forces
static void step(bench *b) {
  CHECK(cav_forward(b->model, b->state, b->q, b->v, b->u, b->next) == CAV_OK);
  memcpy(b->v, b->next, (size_t)b->model->nv * sizeof *b->v);
  cav_integrate(b->model, b->q, b->v, b->state->options.timestep, b->q);
}

// a table's variants of the law
static const struct {
  const char *name;
  cav_regulariser regulariser;
  int coupled;
} variants[] = {{"diagonal, reference", CAV_REGULARISER_REFERENCE, 0},
                {"diagonal, exact", CAV_REGULARISER_EXACT, 0},
                {"coupled, exact", CAV_REGULARISER_EXACT, 1}};
enum { VARIANTS = 3 };

static void choose(bench *b, int variant) {
  b->state->options.regulariser = variants[variant].regulariser;
  b->state->options.coupled = variants[variant].coupled;
}

// --- depth at rest ---

static double depth_at_rest(const char *geom, double mass, double epsilon, double kappa, int variant) {
  char text[1000];
  double d = 1 / (1 + epsilon);
  snprintf(text, sizeof text,
           "<mujoco><option timestep='0.002'/><default><geom solref='%.17g 1' solimp='%.17g %.17g .001'/></default>"
           "<worldbody><geom type='plane' size='1 1 1'/><body pos='0 0 .1'><freejoint/><geom %s mass='%g'/></body>"
           "</worldbody></mujoco>",
           kappa, d, d, geom, mass);
  bench b;
  if (!bench_open(&b, text)) return NAN;
  choose(&b, variant);
  for (int i = 0; i < (int)(60 * kappa / 0.002); i++) step(&b);
  CHECK(cav_position(b.model, b.state, b.q) == CAV_OK);
  double depth = b.state->ncontact ? -b.state->contact[0].dist : NAN;
  // it rests: nothing moves
  CHECK(scene_norm(b.v, b.model->nv) < 1e-9);
  bench_close(&b);
  return depth;
}

static void test_depth(void) {
  printf(
      "## Depth at rest\n\nA sphere (one contact) and a box (four) on a plane, h = 2 ms. Predicted: epsilon kappa^2 "
      "g/(1 + "
      "epsilon), whatever the mass.\n\n| epsilon | kappa, s | mass, kg | predicted, m | sphere, relative error | box "
      "on "
      "four corners, share of it: diagonal, reference | diagonal, exact |\n|---|---|---|---|---|---|---|\n");
  const double cases[][2] = {{0.01, 0.02}, {0.1, 0.02}, {0.1, 0.1}, {1, 0.05}};
  const double masses[] = {1e-3, 1, 1e3};
  for (int c = 0; c < 4; c++) {
    double epsilon = cases[c][0], kappa = cases[c][1], predicted = epsilon * kappa * kappa * 9.81 / (1 + epsilon);
    for (int m = 0; m < 3; m++) {
      double worst = 0;
      for (int v = 0; v < VARIANTS; v++) {
        double found = depth_at_rest("size='.1'", masses[m], epsilon, kappa, v) / predicted - 1;
        // bound: rounding of a height of 0.1 m against a depth of 1e-4 m; seen 5e-13
        CHECK(fabs(found) < 1e-10);
        worst = fmax(worst, fabs(found));
      }
      double box = depth_at_rest("type='box' size='.2 .2 .1'", masses[m], epsilon, kappa, 0) / predicted;
      double exact = depth_at_rest("type='box' size='.2 .2 .1'", masses[m], epsilon, kappa, 1) / predicted;
      printf("| %g | %g | %g | %.3e | %.0e | %.4f | %.4f |\n", epsilon, kappa, masses[m], predicted, worst, box, exact);
      // four equal springs carry a quarter each; seen to 1e-10
      CHECK_NEAR(box, 0.25, 1e-8);
      CHECK(exact > 0.25 && exact < 1.5);
    }
  }
}

// --- decay in friction directions ---

static double decay(double epsilon, double kappa, double h, int free_body, int variant) {
  char text[1200];
  double d = 1 / (1 + epsilon);
  snprintf(
      text, sizeof text,
      "<mujoco><option timestep='%.17g'/><default><geom solref='%.17g 1' solimp='%.17g %.17g .001' friction='1'/>"
      "</default><worldbody><geom type='plane' size='1 1 1'/><body pos='0 0 .1'>%s<geom size='.1'/></body>"
      "</worldbody></mujoco>",
      h, kappa, d, d,
      free_body
          ? "<freejoint/>"
          : "<joint type='slide' axis='1 0 0'/><joint type='slide' axis='0 1 0'/><joint type='slide' axis='0 0 1'/>");
  bench b;
  if (!bench_open(&b, text)) return NAN;
  choose(&b, variant);
  // settle, then slide so slowly that friction stays inside its cone
  for (int i = 0; i < (int)(40 * kappa / h); i++) step(&b);
  b.v[0] = 1e-6;
  double before, after;
  CHECK(cav_inverse(b.model, b.state, b.q, b.v, b.v, b.u) == CAV_OK);
  memset(b.u, 0, (size_t)b.model->nv * sizeof *b.u);
  int tangent = fabs(b.state->contact[0].velocity[1]) > fabs(b.state->contact[0].velocity[2]) ? 1 : 2;
  before = b.state->contact[0].velocity[tangent];
  step(&b);
  CHECK(cav_inverse(b.model, b.state, b.q, b.v, b.v, b.next) == CAV_OK);
  after = b.state->contact[0].velocity[tangent];
  CHECK(b.state->ncontact == 1 && b.state->contact[0].impulse[0] > 0);
  bench_close(&b);
  return -log(after / before) / h;
}

static void test_decay(void) {
  printf(
      "\n## Decay of sliding\n\nOne contact of a sphere, slip 1e-6 m/s, inside the friction cone, h = kappa/1000. "
      "Predicted: "
      "rate 2/kappa, of the discrete step -log(1 - 2h/kappa)/h. Measured over the latter. A sphere that cannot turn "
      "has "
      "A = 1/m in all rows, a free one about 3.5/m in those of friction, where only coupled rows can know it.\n\n| "
      "epsilon | "
      "kappa, s | 2/kappa, 1/s | cannot turn: diagonal, reference | diagonal, exact | coupled | free: diagonal, "
      "reference | "
      "diagonal, exact | coupled |\n|---|---|---|---|---|---|---|---|---|\n");
  const double cases[][2] = {{0.01, 0.02}, {0.1, 0.1}, {1, 0.1}};
  for (int c = 0; c < 3; c++) {
    double epsilon = cases[c][0], kappa = cases[c][1], h = kappa / 1000, rate = -log1p(-2 * h / kappa) / h, got[6];
    for (int i = 0; i < 6; i++) got[i] = decay(epsilon, kappa, h, i / VARIANTS, i % VARIANTS) / rate;
    printf("| %g | %g | %g | %.6f | %.6f | %.6f | %.6f | %.6f | %.6f |\n", epsilon, kappa, 2 / kappa, got[0], got[1],
           got[2], got[3], got[4], got[5]);
    // bound: rounding of 1e-6 m/s over a step; seen 4e-9
    for (int i = 0; i < 3; i++) CHECK_NEAR(got[i], 1, 1e-6);
    CHECK_NEAR(got[5], 1, 1e-6);
    // a diagonal of the normal row errs by a (1 + epsilon)/(a + epsilon), a = A m = 1 + 5/2 (arm/radius)^2 in those of
    // friction, the arm half the depth short of the radius; seen 3e-6 and, of the discrete rate, 1e-3
    double arm = 0.1 - 0.5 * epsilon * kappa * kappa * 9.81 / (1 + epsilon), a = 1 + 2.5 * arm * arm / 0.01;
    for (int i = 3; i < 5; i++) CHECK_NEAR(got[i], a * (1 + epsilon) / (a + epsilon), 1e-3);
  }
}

// --- critical damping of rows that couple ---

// three masses on slides, tied by tendons that share them: A is constant, with off-diagonal entries as large as the
// diagonal; the last tendon is redundant where asked for
static const char coupled_rows[] =
    "<mujoco><option timestep='%.17g' gravity='0 0 0'/><default><equality solref='%.17g 1' solimp='%.17g %.17g .001'/>"
    "</default><worldbody>"
    "<body><joint name='x' type='slide'/><geom size='.1' mass='1'/></body>"
    "<body pos='0 1 0'><joint name='y' type='slide'/><geom size='.1' mass='3'/></body>"
    "<body pos='0 2 0'><joint name='z' type='slide'/><geom size='.1' mass='.2'/></body></worldbody><tendon>"
    "<fixed name='a'><joint joint='x' coef='1'/><joint joint='y' coef='1'/></fixed>"
    "<fixed name='b'><joint joint='y' coef='1'/><joint joint='z' coef='-.5'/></fixed>"
    "<fixed name='c'><joint joint='x' coef='1'/><joint joint='z' coef='.5'/></fixed></tendon>"
    "<equality><tendon tendon1='a'/><tendon tendon1='b'/>%s</equality></mujoco>";

// largest deviation of any row's error from (1 + t/kappa) e^(-t/kappa) times what it was
static double deviation(double epsilon, double kappa, double h, int redundant, int variant) {
  char text[2000];
  double d = 1 / (1 + epsilon), worst = 0, start[3] = {0};
  snprintf(text, sizeof text, coupled_rows, h, kappa, d, d, redundant ? "<tendon tendon1='c'/>" : "");
  bench b;
  if (!bench_open(&b, text)) return NAN;
  choose(&b, variant);
  const double away[3] = {0.02, 0.05, -0.06};
  memcpy(b.q, away, sizeof away);
  for (int i = 0; i < (int)(8 * kappa / h); i++) {
    CHECK(cav_position(b.model, b.state, b.q) == CAV_OK);
    for (int k = 0; k < b.state->ntie; k++) {
      double x = b.state->tie[k].error[0], t = i * h / kappa;
      if (i == 0) start[k] = x;
      worst = fmax(worst, fabs(x / start[k] - (1 + t) * exp(-t)));
    }
    step(&b);
  }
  bench_close(&b);
  return worst;
}

static void test_critical(void) {
  printf(
      "\n## Critical damping\n\nThree masses on slides tied by two tendons that share them (A has off-diagonal "
      "entries), or by "
      "three of which one follows from the others (A singular). Predicted: every error is (1 + t/kappa) e^(-t/kappa) "
      "of "
      "what it was. Largest deviation from that over 8 kappa; kappa = 0.1 s, h = kappa/500.\n\n| rows | epsilon | "
      "diagonal, "
      "reference | diagonal, exact | coupled, exact |\n|---|---|---|---|---|\n");
  const double epsilons[] = {0.01, 0.1, 1};
  const double kappa = 0.1, h = kappa / 500;
  for (int redundant = 0; redundant < 2; redundant++) {
    for (int e = 0; e < 3; e++) {
      double got[VARIANTS];
      for (int v = 0; v < VARIANTS; v++) got[v] = deviation(epsilons[e], kappa, h, redundant, v);
      printf("| %d | %g | %.1e | %.1e | %.1e |\n", 2 + redundant, epsilons[e], got[0], got[1], got[2]);
      // bound: first order in h/kappa = 2e-3; seen 8e-4
      CHECK(got[2] < 2e-3);
      // control: without the coupling it is not so
      if (epsilons[e] >= 0.1) CHECK(got[1] > 4 * got[2]);
    }
  }
  printf(
      "\nThe coupled deviation is that of the step: at epsilon = 0.1, two rows, h = kappa/500, /1000, /2000 it is "
      "%.2e, %.2e, "
      "%.2e.\n",
      deviation(0.1, kappa, kappa / 500, 0, 2), deviation(0.1, kappa, kappa / 1000, 0, 2),
      deviation(0.1, kappa, kappa / 2000, 0, 2));
}

// --- soft to hard ---

// a five-bar loop closed in space, although it can only move in a plane: two of the three rows of its connect repeat what
// the joints say, twice where it is closed twice. It stands on the floor with a free foot in contact
static const char loop[] =
    "<mujoco><option timestep='.002'/><default><joint axis='0 1 0' damping='.01'/><geom type='capsule' "
    "size='.03'/></default>"
    "<worldbody><geom type='plane' size='2 2 1' condim='3'/><body pos='0 0 .45'><joint name='j'/><geom fromto='0 0 0 "
    ".3 0 0' contype='0' "
    "conaffinity='0'/><body name='a' pos='.3 0 0'><joint/><geom fromto='0 0 0 .2 0 -.4'/></body></body>"
    "<body pos='.8 0 .45'><joint/><geom fromto='0 0 0 -.2 0 .05' contype='0' conaffinity='0'/><body name='b' pos='-.2 "
    "0 "
    ".05'><joint/><geom fromto='0 0 0 -.1 0 -.45'/></body></body></worldbody>"
    "<contact><exclude body1='a' body2='b'/></contact>"
    "<equality><connect body1='a' body2='b' anchor='.2 0 -.4'/>%s</equality></mujoco>";

// closed twice, and one joint held at two angles
static const char contradiction[] =
    "<connect body1='a' body2='b' anchor='.2 0 -.4'/><joint joint1='j' polycoef='.1'/><joint joint1='j' "
    "polycoef='-.05'/>";

static double gap_to_hard(bench *b, double epsilon, const double *hard, double *v_next, double *mismatch) {
  b->state->options.softness = epsilon;
  CHECK(cav_forward_newton(b->model, b->state, b->q, b->v, b->u, 100, 1e-13, v_next, NULL) == CAV_OK);
  double difference = 0;
  for (int i = 0; i < b->model->nv; i++) difference = fmax(difference, fabs(v_next[i] - hard[i]));
  cav_tie *tie = &b->state->tie[0];
  *mismatch = 0;
  for (int k = 0; k < 3; k++) {
    double target = (1 - tie->damping) * tie->velocity[k] - tie->stiffness * tie->error[k];
    *mismatch = fmax(*mismatch, fabs(tie->velocity_next[k] - target));
  }
  return difference;
}

static void test_hard(void) {
  printf(
      "\n## Soft to hard\n\nA five-bar loop closed by a connect in space (two of three rows repeat what the joints "
      "say), "
      "one foot on the floor; then closed twice and one joint held at two angles at once. 20 states, one step each. "
      "|v_next soft - hard|, largest, and |J_E v_next - v*| of the soft "
      "rows. R_E = epsilon A, contacts and targets the same in both; the hard solve only has R_E = 0.\n\n| epsilon of "
      "R_E | closed once | ratio | "
      "rows miss by | repeated and contradicting | ratio |\n|---|---|---|---|---|---|\n");
  enum { STATES = 20, EPSILONS = 6 };
  double worst[2][EPSILONS] = {{0}}, missed[EPSILONS] = {0}, residual = 0, held = 0;
  for (int twice = 0; twice < 2; twice++) {
    char text[2000];
    snprintf(text, sizeof text, loop, twice ? contradiction : "");
    bench b;
    if (!bench_open(&b, text)) return;
    double *hard = scene_vector(b.model->nv);
    for (int s = 0; s < STATES; s++) {
      cav_configuration_reset(b.model, b.q);
      for (int i = 0; i < b.model->nv; i++) {
        b.q[i] += 0.02 * scene_normal();
        b.v[i] = 0.5 * scene_normal();
        b.u[i] = 2 * scene_normal();
      }
      for (int e = 0; e < EPSILONS; e++) {
        // one softness for rows and targets; the hard solve takes the same targets
        double miss;
        b.state->options.stabilisation = CAV_STABILISATION_DISCRETE;
        b.state->options.time_constant = 0.02;
        b.state->options.softness = pow(10, -1 - e);
        cav_forward_report report;
        CHECK(cav_forward_hard(b.model, b.state, b.q, b.v, b.u, 100000, 1e-14, hard, &report) == CAV_OK);
        residual = fmax(residual, report.residual);
        if (!twice) {
          const cav_tie *tie = &b.state->tie[0];
          double rate[3];
          CHECK(cav_inverse(b.model, b.state, b.q, b.v, hard, b.next) == CAV_OK);
          for (int k = 0; k < 3; k++) {
            rate[k] = tie->velocity_next[k] - (1 - tie->damping) * tie->velocity[k] + tie->stiffness * tie->error[k];
            held = fmax(held, fabs(rate[k]));
          }
        }
        worst[twice][e] = fmax(worst[twice][e], gap_to_hard(&b, b.state->options.softness, hard, b.next, &miss));
        if (!twice) missed[e] = fmax(missed[e], miss);
      }
    }
    free(hard);
    bench_close(&b);
  }
  for (int e = 0; e < EPSILONS; e++) {
    printf("| 1e-%d | %.2e | %.3g | %.2e | %.2e | %.3g |\n", 1 + e, worst[0][e], e ? worst[0][e - 1] / worst[0][e] : 0,
           missed[e], worst[1][e], e ? worst[1][e - 1] / worst[1][e] : 0);
  }
  printf(
      "\nHard: the balance of forces is missed by %.0e, relative; its rows by %.0e m/s where they do not contradict "
      "each "
      "other.\n",
      residual, held);
  // first order in epsilon
  for (int e = 2; e < EPSILONS; e++) {
    CHECK(worst[0][e - 1] / worst[0][e] > 8 && worst[0][e - 1] / worst[0][e] < 12);
    CHECK(worst[1][e - 1] / worst[1][e] > 8 && worst[1][e - 1] / worst[1][e] < 12);
  }
  CHECK(residual < 1e-10);
  CHECK(held < 1e-10);
}

int main(void) {
  test_depth();
  test_decay();
  test_critical();
  test_hard();
  return check_result();
}
