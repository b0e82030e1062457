/// Stabilisation, predicted against measured (Todorov 2014, section V): depth at rest, decay of sliding, critical
/// damping by the diagonal and by coupled rows, convergence of soft to hard equality constraints, ODE's parameters;
/// limits of twist, swing and distance. Prints the tables of results/stabilisation.md.
#include "constraint.h"
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
      "four corners, fraction of it: diagonal, reference | diagonal, exact |\n|---|---|---|---|---|---|---|\n");
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
    for (int k = 0; k < b.state->nequality; k++) {
      double x = b.state->equality[k].error[0], t = i * h / kappa;
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

// a five-bar loop closed in space, although it can only move in a plane: two of the three rows of its connect repeat
// what the joints say, twice where it is closed twice. It stands on the floor with a free foot in contact
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
  cav_equality_rows *eq = &b->state->equality[0];
  *mismatch = 0;
  for (int k = 0; k < 3; k++) {
    double target = cav_equality_target(b->state, eq, k);
    *mismatch = fmax(*mismatch, fabs(eq->velocity_next[k] - target));
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
        CHECK(cav_forward_hard(b.model, b.state, b.q, b.v, b.u, 100000, 1e-12, hard, &report) == CAV_OK);
        residual = fmax(residual, report.residual);
        if (!twice) {
          const cav_equality_rows *eq = &b.state->equality[0];
          double rate[3];
          CHECK(cav_inverse(b.model, b.state, b.q, b.v, hard, b.next) == CAV_OK);
          for (int k = 0; k < 3; k++) {
            rate[k] = eq->velocity_next[k] - cav_equality_target(b.state, eq, k);
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

// --- ODE's parameters ---

// one mass between a wall and a spring row: ODE's step in closed form, m (v' - v) = h F, v' = -(ERP/h) x - CFM F
static void test_ode(void) {
  static const char text[] =
      "<mujoco><option timestep='.01' gravity='0 0 0'/><worldbody><body><joint name='x' type='slide' axis='1 0 0'/>"
      "<geom size='.1' mass='2'/></body></worldbody><equality><joint joint1='x' solref='-1 -1' solimp='.9 .9 .001'/>"
      "</equality></mujoco>";
  bench b;
  if (!bench_open(&b, text)) return;
  const double mass = 2, h = 0.01, cfms[] = {1e-4, 1e-2}, erps[] = {0.1, 0.8, 1};
  cav_equality *row = (cav_equality *)b.model->equality;
  double worst = 0;
  for (int c = 0; c < 2; c++) {
    for (int e = 0; e < 3; e++) {
      double cfm = cfms[c], erp = erps[e], x = 0.1, v = 0.7;
      CHECK(cav_softness_from_ode(cfm, erp, h, row->weight[0], &row->softness) == CAV_OK);
      b.q[0] = x;
      b.v[0] = v;
      for (int i = 0; i < 20; i++) {
        double F = -(v + erp / h * x) / (cfm + h / mass);
        v += h * F / mass;
        x += h * v;
        step(&b);
        worst = fmax(worst, fmax(fabs(b.v[0] - v), fabs(b.q[0] - x) / h));
      }
    }
  }
  printf("ODE's rows: CFM and ERP converted, largest difference of v over 20 steps %.1e m/s\n", worst);
  // bound: rounding of velocities about 10 m/s; seen 2e-15
  CHECK(worst < 1e-12);

  // the other way: ODE's step with what the row amounts to follows it, where the row's own mass 1/R is 1e-4 of the
  // body's
  double cfm, erp, apart[2];
  for (int fine = 0; fine < 2; fine++) {
    double step_size = fine ? 1e-4 : 1e-3, x = 0.1, v = 0;
    row->softness = (cav_softness){{-300, -20}, {1e-4, 1e-4, 0.001, 0.5, 2}};
    b.state->options.timestep = step_size;
    CHECK(cav_softness_to_ode(b.state, &row->softness, row->weight[0], &cfm, &erp) == CAV_OK);
    b.q[0] = x;
    b.v[0] = apart[fine] = 0;
    for (double t = 0; t < 0.2; t += step_size) {
      v += step_size / mass * -(v + erp / step_size * x) / (cfm + step_size / mass);
      x += step_size * v;
      step(&b);
      apart[fine] = fmax(apart[fine], fabs(b.q[0] - x));
    }
  }
  printf("and back: largest difference of x over 0.2 s %.1e m at 1 ms, %.1e m at 0.1 ms\n", apart[0], apart[1]);
  // first order in the step; what is left is the mass
  CHECK(apart[0] < 2e-3 && apart[0] / apart[1] > 7 && apart[0] / apart[1] < 13);
  CHECK(cav_softness_from_ode(0, 0.5, h, 1, &row->softness) == CAV_BAD_INPUT);
  CHECK(cav_softness_from_ode(1e9, 0.5, h, 1, &row->softness) == CAV_BAD_INPUT);
  bench_close(&b);
}

// --- twist and swing ---

static const char shoulder[] =
    "<mujoco><compiler angle='degree'/><option timestep='.002' gravity='0 0 0'/><default><joint solreflimit='.02 "
    "1'/></default>"
    "<worldbody><body><joint name='ball' type='ball' axis='1 1 0' twistrange='-20 35' swingrange='50'/>"
    "<geom type='capsule' size='.05' fromto='0 0 0 .3 .1 .2'/></body></worldbody></mujoco>";

// rows of the cylinder: distances and their rates by differences; pushed hard, the joint stays inside
static void test_cylinder(void) {
  bench b;
  if (!bench_open(&b, shoulder)) return;
  const double reach = 1e3, degree = M_PI / 180;
  double worst = 0;
  int seen[5] = {0};
  // all rows at any posture: the activation distance of the smoothed law
  b.state->options.smoothing = b.state->options.smoothing_self = reach;
  for (int trial = 0; trial < 200; trial++) {
    double w[3], e = 1e-6, plus[5] = {0}, minus[5] = {0};
    scene_normals(w, 3, 0.6);
    memcpy(b.q, b.model->q0, 4 * sizeof *b.q);
    cav_integrate(b.model, b.q, w, 1, b.q);
    scene_normals(b.v, 3, 1);
    for (int side = 0; side < 2; side++) {
      double *out = side ? minus : plus;
      cav_integrate(b.model, b.q, b.v, side ? -e : e, b.next);
      CHECK(cav_position(b.model, b.state, b.next) == CAV_OK);
      for (int i = 0; i < b.state->nrow; i++) out[b.state->row[i].side] = b.state->row[i].dist;
    }
    CHECK(cav_inverse(b.model, b.state, b.q, b.v, b.v, b.u) == CAV_OK);
    CHECK(b.state->nrow == 3);
    for (int i = 0; i < b.state->nrow; i++) {
      const cav_row *row = &b.state->row[i];
      seen[row->side]++;
      worst = fmax(worst, fabs((plus[row->side] - minus[row->side]) / (2 * e) - row->velocity));
      // what the rotation vector says
      double length = scene_norm(w, 3), axis[3] = {sqrt(0.5), sqrt(0.5), 0};
      if (length > 3) continue;
      double twist = w[0] * axis[0] + w[1] * axis[1], swing = sqrt(fmax(0, length * length - twist * twist));
      double expected = row->side == 2   ? twist + 20 * degree
                        : row->side == 3 ? 35 * degree - twist
                                         : 50 * degree - swing;
      CHECK_NEAR(row->dist, expected, 1e-12);
    }
  }
  CHECK(seen[2] == 200 && seen[3] == 200 && seen[4] == 200);
  printf("twist and swing: rate of the distances against the rows %.1e\n", worst);
  // bound: rounding over the step; seen 3e-10
  CHECK(worst < 1e-7);

  // a constant torque of 3 N m pushes it in every direction: it ends at the limits, not far beyond
  b.state->options = b.model->options;
  b.state->options.timestep = b.model->timestep;
  double beyond = 0;
  for (int trial = 0; trial < 12; trial++) {
    cav_configuration_reset(b.model, b.q);
    memset(b.v, 0, 3 * sizeof *b.v);
    for (int k = 0; k < 3; k++) b.u[k] = 3 * cos(trial + 2 * k);
    for (int i = 0; i < 1500; i++) {
      // damped, so that it comes to rest
      for (int k = 0; k < 3; k++) b.u[k] = 3 * cos(trial + 2 * k) - 0.5 * b.v[k];
      step(&b);
    }
    CHECK(cav_position(b.model, b.state, b.q) == CAV_OK);
    CHECK(b.state->nrow > 0);
    for (int i = 0; i < b.state->nrow; i++) beyond = fmax(beyond, -b.state->row[i].dist);
  }
  printf("pushed by 3 N m: %.2g deg beyond its limits\n", beyond / degree);
  CHECK(beyond > 0 && beyond < 3 * degree);
  bench_close(&b);
}

// --- distances ---

// a frictionless pair with a margin keeps two geoms apart: the limit of a distance
static void test_distance(void) {
  static const char text[] =
      "<mujoco><option timestep='.002'/><worldbody><body pos='0 0 .6'><freejoint/><geom name='a' size='.1' contype='0' "
      "conaffinity='0' mass='1'/></body><geom name='b' type='capsule' size='.1' fromto='-1 0 0 1 0 0' contype='0' "
      "conaffinity='0'/></worldbody><contact><pair geom1='a' geom2='b' condim='1' margin='.3' solref='.02 1' "
      "solimp='.99 .99 .001'/></contact></mujoco>";
  bench b;
  if (!bench_open(&b, text)) return;
  for (int i = 0; i < 2000; i++) step(&b);
  CHECK(cav_position(b.model, b.state, b.q) == CAV_OK);
  if (CHECK(b.state->ncontact == 1)) {
    const cav_contact *c = &b.state->contact[0];
    double epsilon = 1 / 0.99 - 1, deep = epsilon * 0.02 * 0.02 * 9.81 / (1 + epsilon);
    CHECK(c->dim == 1);
    // it rests at the margin, less the depth at rest; bound: what is left of the fall after 4 s, seen 3e-16
    CHECK_NEAR(c->dist, 0.3 - deep, 1e-10);
    printf("limit of a distance: rests %.3g m from 0.3 m, predicted %.3g m\n", 0.3 - c->dist, deep);
  }
  bench_close(&b);
}

int main(void) {
  test_depth();
  test_decay();
  test_critical();
  test_hard();
  printf("\n## Other rows\n\n");
  test_ode();
  test_cylinder();
  test_distance();
  return check_result();
}
