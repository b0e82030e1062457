/// Stiff constraints and springs. Forward steps where a rounding is worth a force: softness from 1e-2 to 1e-14 times
/// scenes with few, many and redundant contacts, against a step in quadruple precision (quad.h). With "table" prints
/// what tests/results/stiff.md is made of.
#include "quad.h"
#include "scene.h"

enum { SOFTNESSES = 7, SCENES_MAX = 16 };

static double largest(const double *x, int n) {
  double most = 0;
  for (int i = 0; i < n; i++) most = fmax(most, fabs(x[i]));
  return most;
}

static double apart(const double *a, const double *b, int n) {
  double most = 0;
  for (int i = 0; i < n; i++) most = fmax(most, fabs(a[i] - b[i]));
  return most;
}

// a model at (q, v, u), and what its steps came to at each softness
typedef struct scene {
  char name[80];
  cav_model *model;
  cav_state *state;
  double *q, *v, *u, *v_next, *truth;
  cav_model *part; // one of the parts that the scene is copies of; NULL: it is one part
  int contacts, iterations[SOFTNESSES];
  cav_status status[SOFTNESSES];
  double error[SOFTNESSES], mismatch[SOFTNESSES];
} scene;

static const double softness[SOFTNESSES] = {1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14};

static int scene_open(scene *s, const char *name, cav_model *model) {
  *s = (scene){.model = model};
  snprintf(s->name, sizeof s->name, "%s", name);
  if (!CHECK(model != NULL)) return 0;
  s->state = cav_state_new(model);
  const size_t n = (size_t)model->nq + 1;
  double **const all[] = {&s->q, &s->v, &s->u, &s->v_next, &s->truth};
  for (int i = 0; i < 5; i++) *all[i] = calloc(n, sizeof(double));
  cav_configuration_reset(model, s->q);
  s->state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  s->state->options.time_constant = s->state->options.smoothing = 0;
  return CHECK(s->state != NULL);
}

static void scene_close(scene *s) {
  double *const all[] = {s->q, s->v, s->u, s->v_next, s->truth};
  for (int i = 0; i < 5; i++) free(all[i]);
  cav_state_free(s->state);
  cav_model_free(s->model);
  cav_model_free(s->part);
}

static void scene_throw(scene *s, double v, double u) {
  for (int i = 0; i < s->model->nv; i++) s->v[i] = v * scene_uniform(), s->u[i] = u * scene_uniform();
}

// one body on so many spheres, all of which touch: six dofs, redundant contacts
static cav_model *bed(int n) {
  static char text[1 << 16];
  const int wide = (int)ceil(sqrt(n));
  char *at = text + sprintf(text,
                            "<mujoco><option timestep='0.005'/><worldbody><geom type='plane' size='9 9 1'/>"
                            "<body pos='0 0 .099'><freejoint/>");
  for (int i = 0; i < n; i++)
    at += sprintf(at, "<geom type='sphere' size='.1' pos='%g %g %g' mass='.1'/>", 0.3 * (i % wide), 0.3 * (i / wide),
                  2e-5 * scene_uniform());
  sprintf(at, "</body></worldbody></mujoco>");
  return scene_load(text);
}

// so many piles of boxes, each box ratio times heavier than the one that it stands on
static cav_model *piles(int n, int high, double ratio) {
  static char text[1 << 17];
  char *at = text + sprintf(text, "<mujoco><option timestep='0.005'/><worldbody><geom type='plane' size='9 9 1'/>");
  for (int i = 0; i < n; i++)
    for (int k = 0; k < high; k++)
      at += sprintf(at, "<body pos='%g %g %g'><freejoint/><geom type='box' size='.1 .1 .1' mass='%g'/></body>",
                    0.5 * (i % 8), 0.5 * (i / 8), 0.0995 + 0.1995 * k, pow(ratio, k));
  sprintf(at, "</worldbody></mujoco>");
  return scene_load(text);
}

static double deepest(const cav_state *state) {
  double most = 0;
  for (int i = 0; i < state->ncontact; i++) most = fmax(most, -state->contact[i].dist);
  return most;
}

// our humanoid lying half a centimetre in the floor
static void lay(scene *s, double bend) {
  for (int i = 7; i < s->model->nq; i++) s->q[i] += bend * scene_uniform();
  s->q[3] = s->q[5] = 1, s->q[4] = s->q[6] = 0;
  cav_configuration_normalise(s->model, s->q);
  double low = 0, high = 2;
  for (int k = 0; k < 30; k++) {
    s->q[2] = 0.5 * (low + high);
    CHECK(cav_position(s->model, s->state, s->q) == CAV_OK);
    if (deepest(s->state) > 0.005)
      low = s->q[2];
    else
      high = s->q[2];
  }
}

static int open_scenes(scene *all) {
  int n = 0;
  char name[80];
  for (int k = 0; k < 2; k++)
    for (int count = 17; count <= 170; count *= 10) {
      snprintf(name, sizeof name, "body on %d spheres, %s", count, k ? "at rest" : "thrown");
      if (!scene_open(&all[n], name, bed(count))) return n;
      if (!k) scene_throw(&all[n], 1, 5);
      n++;
    }
  static const int piles_of[] = {8, 72, 4};
  for (int k = 0; k < 3; k++) {
    snprintf(name, sizeof name, "%d piles of 3 boxes%s", piles_of[k], k == 2 ? ", masses 1, 30, 900" : "");
    if (!scene_open(&all[n], name, piles(piles_of[k], 3, k == 2 ? 30 : 1))) return n;
    all[n].part = piles(1, 3, k == 2 ? 30 : 1);
    scene_throw(&all[n], 0.2, 1);
    n++;
  }
  for (int k = 0; k < 4; k++) {
    cav_error error;
    snprintf(name, sizeof name, "humanoid, lying, %d", k + 1);
    if (!scene_open(&all[n], name, cav_model_load(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", &error)))
      return n;
    lay(&all[n], 0.06 * k);
    scene_throw(&all[n], 0.5, 20);
    n++;
  }
  return n;
}

// v_next in quadruple precision, part by part as nothing joins them
static void find_truth(scene *s, double from, double at) {
  const cav_model *part = s->part ? s->part : s->model;
  cav_state *state = cav_state_new(part);
  state->options = s->state->options;
  for (int q = 0, v = 0; v < s->model->nv; q += part->nq, v += part->nv) {
    quad_step step;
    if (!quad_open(&step, part, state, s->q + q, s->v + v, s->u + v)) break;
    // its last step; where the problem has a kink Newton may go to and fro over it by less than shows
    CHECK(quad_forward(&step, from, at, s->truth + v) < 1e-12);
    quad_free(&step);
  }
  cav_state_free(state);
}

// all softnesses of a scene against the truth
static void sweep(scene *s) {
  const int nv = s->model->nv;
  for (int k = 0; k < SOFTNESSES; k++) {
    s->state->options.softness = softness[k];
    cav_forward_report report = {0};
    s->status[k] = cav_forward_newton(s->model, s->state, s->q, s->v, s->u, 100, 1e-13, s->v_next, &report);
    s->iterations[k] = report.iterations;
    s->mismatch[k] = report.residual;
    s->contacts = s->state->ncontact;
    if (k == 0) memcpy(s->truth, s->v, (size_t)nv * sizeof *s->v);
    find_truth(s, k > 0 ? 0.1 * softness[k - 1] : softness[k], softness[k]);
    s->error[k] = apart(s->v_next, s->truth, nv) / largest(s->truth, nv);
  }
}

static void print_table(const scene *all, int n) {
  printf(
      "\n## Softness\n\nIterations, error of v_next over the largest velocity, mismatch of the inverse over the "
      "largest force"
      "\n(a rounding of v_next is worth 1.1e-16 of it over the softness, times what speeds are over those that"
      "\nimpulses change).\n\n");
  printf("| scene | contacts |");
  for (int k = 0; k < SOFTNESSES; k++) printf(" %.0e |", softness[k]);
  printf("\n|---|--:|");
  for (int k = 0; k < SOFTNESSES; k++) printf("---|");
  printf("\n");
  for (int i = 0; i < n; i++) {
    printf("| %s | %d |", all[i].name, all[i].contacts);
    for (int k = 0; k < SOFTNESSES; k++)
      printf(" %d, %.0e, %.0e%s |", all[i].iterations[k], all[i].error[k], all[i].mismatch[k],
             all[i].status[k] == CAV_OK ? "" : ", not converged");
    printf("\n");
  }
}

static void test_softness(int table) {
  scene all[SCENES_MAX];
  const int n = open_scenes(all);
  for (int i = 0; i < n; i++) {
    sweep(&all[i]);
    for (int k = 0; k < SOFTNESSES; k++) {
      const int right = all[i].status[k] == CAV_OK && all[i].error[k] <= 1e-10;
      if (!right)
        fprintf(stderr, "%s, softness %.0e: %s, error of v_next %.1e\n", all[i].name, softness[k],
                cav_status_name(all[i].status[k]), all[i].error[k]);
      CHECK(right);
      CHECK(all[i].iterations[k] <= 100);
      // a rounding of v_next is worth 1.1e-16 |v|/(h R); seen 1.2e-15
      CHECK(all[i].mismatch[k] <= 1e-12 + 1e-14 / softness[k]);
    }
  }
  if (table) print_table(all, n);
  for (int i = 0; i < n; i++) scene_close(&all[i]);
}

// ---------------------------------------------------------------- springs

enum { SPRING_STEPS = 2000, KINDS = 4 };
static const double spring_h = 0.01, stiffnesses[] = {1e2, 1e4, 1e7, 1e12};

// one coordinate x on a spring, mass one, by its closed form: v_next from x and v
static double spring_step(cav_order order, double k, double x, double v) {
  const double a = spring_h * spring_h * k;
  if (order == CAV_ORDER_EULER) return (v - spring_h * k * x) / (1 + a);
  return v - spring_h * k * x / (1 + 0.25 * a);
}

// a slide; a ball joint turning about one axis; a free body along one; two slides that a tendon joins, of which what is
// between them has half the mass
static cav_model *spring_model(int kind, double k) {
  static const char head[] = "<mujoco><option timestep='.01' gravity='0 0 0'/><worldbody>";
  static const char ball[] = "<geom type='sphere' size='.1' mass='%g' contype='0' conaffinity='0'/></body>";
  char text[2000], mass[200];
  snprintf(mass, sizeof mass, ball, kind == 1 ? 1 / (0.4 * 0.1 * 0.1) : kind == 3 ? 2.0 : 1.0);
  if (kind == 3)
    snprintf(text, sizeof text,
             "%s<body><joint name='a' type='slide' axis='1 0 0'/>%s<body><joint name='b' type='slide' axis='1 0 0'/>%s"
             "</worldbody><tendon><fixed stiffness='%g' springlength='0'><joint joint='a' coef='1'/>"
             "<joint joint='b' coef='-1'/></fixed></tendon></mujoco>",
             head, mass, mass, k);
  else
    snprintf(text, sizeof text, "%s<body><joint type='%s' axis='1 0 0' stiffness='%g'/>%s</worldbody></mujoco>", head,
             kind == 0   ? "slide"
             : kind == 1 ? "ball"
                         : "free",
             k, mass);
  return scene_load(text);
}

// springs of any stiffness step as their closed forms, and energy does what the order says
static void test_springs(void) {
  for (int kind = 0; kind < KINDS; kind++)
    for (size_t n = 0; n < sizeof stiffnesses / sizeof *stiffnesses; n++)
      for (int order = 0; order < 3; order++) {
        scene s;
        const double k = stiffnesses[n];
        if (!scene_open(&s, "spring", spring_model(kind, k))) return;
        const int nv = s.model->nv;
        s.state->options.order = (cav_order)order;
        s.state->options.spring = CAV_SPRING_IMPLICIT;
        // at its rest half way between knots, as of the other orders a stiffer spring turns by more each step
        double x = 0.01, v = order ? 2 * x / spring_h : 0.3, before = x - spring_h * v, worst = 0, size = 0;
        double *start = calloc((size_t)nv, sizeof *start);
        start[0] = kind == 3 ? 0.5 * x : x;
        if (kind == 3) start[1] = -0.5 * x;
        cav_integrate(s.model, s.model->q0, start, 1, s.q);
        s.v[0] = kind == 3 ? 0.5 * v : v;
        if (kind == 3) s.v[1] = -0.5 * v;
        const double energy = v * v + k * (order ? 0.25 * (x + before) * (x + before) : x * x);
        double drift = 0;
        for (int step = 0; step < SPRING_STEPS; step++) {
          if (!CHECK(cav_forward(s.model, s.state, s.q, s.v, s.u, s.v_next) == CAV_OK)) {
            fprintf(stderr, "kind %d, stiffness %g, order %d, step %d\n", kind, k, order, step);
            break;
          }
          v = spring_step((cav_order)order, k, x, v);
          before = x;
          x += spring_h * v;
          const double found = kind == 3 ? s.v_next[0] - s.v_next[1] : s.v_next[0];
          size = fmax(size, fabs(v));
          worst = fmax(worst, fabs(found - v));
          memcpy(s.v, s.v_next, (size_t)nv * sizeof *s.v);
          cav_integrate(s.model, s.q, s.v, spring_h, s.q);
          // of the coordinate as found: kinetic, and of the spring half way between knots
          if (kind == 0 && order) {
            const double middle = s.q[0] - 0.5 * spring_h * found;
            drift = fmax(drift, fabs((found * found + k * middle * middle) / energy - 1));
          }
        }
        // rounding adds up over the steps; seen 2e-12
        CHECK(worst <= 1e-9 * size);
        CHECK(drift <= 1e-9);
        if (worst > 1e-9 * size || drift > 1e-9)
          fprintf(stderr, "kind %d, stiffness %g, order %d: %g of %g, drift %g\n", kind, k, order, worst, size, drift);
        free(start);
        scene_close(&s);
      }
}

// the control: at q a spring explodes beyond h omega = 2
static void test_springs_at_q(void) {
  scene s;
  if (!scene_open(&s, "spring", spring_model(0, 1e5))) return;
  s.q[0] = 0.01;
  for (int step = 0; step < 20; step++) {
    CHECK(cav_forward(s.model, s.state, s.q, s.v, s.u, s.v_next) == CAV_OK);
    memcpy(s.v, s.v_next, sizeof *s.v);
    cav_integrate(s.model, s.q, s.v, spring_h, s.q);
  }
  CHECK(fabs(s.q[0]) > 1e5);
  scene_close(&s);
}

// a spring that is slack between two lengths: each piece in closed form
static void test_slack(void) {
  scene s;
  const double h = spring_h, k = 1e6;
  if (!scene_open(
          &s, "slack",
          scene_load("<mujoco><option timestep='.01' gravity='0 0 0'/><worldbody><body>"
                     "<joint name='a' type='slide' axis='1 0 0'/><geom type='sphere' size='.1' mass='1'/></body>"
                     "</worldbody><tendon><fixed stiffness='1e6' springlength='.1 .4'>"
                     "<joint joint='a' coef='2'/></fixed></tendon></mujoco>")))
    return;
  s.state->options.spring = CAV_SPRING_IMPLICIT;
  for (int i = 0; i < 200; i++) {
    const double x = 0.125 + 0.2 * scene_uniform(), v = 10 * scene_uniform();
    s.q[0] = x, s.v[0] = v;
    CHECK(cav_forward(s.model, s.state, s.q, s.v, s.u, s.v_next) == CAV_OK);
    // free flight, and where that ends beyond an end of what is slack
    double truth = v;
    if (2 * (x + h * v) > 0.4) truth = (v - h * k * 2 * (2 * x - 0.4)) / (1 + 4 * h * h * k);
    if (2 * (x + h * v) < 0.1) truth = (v - h * k * 2 * (2 * x - 0.1)) / (1 + 4 * h * h * k);
    CHECK_NEAR(s.v_next[0], truth, 1e-9);
    CHECK(cav_inverse(s.model, s.state, s.q, s.v, s.v_next, s.truth) == CAV_OK);
    CHECK_NEAR(s.truth[0], 0, 1e-6);
  }
  scene_close(&s);
}

// there and back with every kind of joint and a tendon, springs made stiff; the other solver where it can
static void test_springs_and_back(void) {
  scene s;
  static char text[sizeof scene_joints + 200];
  if (!CHECK(strstr(scene_joints, "stiffness='10'") && strstr(scene_joints, "stiffness='7'"))) return;
  // two of the springs a thousand times and more stiffer
  const char *one = strstr(scene_joints, "stiffness='10'"), *two = strstr(scene_joints, "stiffness='7'");
  snprintf(text, sizeof text, "%.*sstiffness='1e5'%.*sstiffness='1e6'%s", (int)(one - scene_joints), scene_joints,
           (int)(two - one) - (int)strlen("stiffness='10'"), one + strlen("stiffness='10'"),
           two + strlen("stiffness='7'"));
  if (!scene_open(&s, "joints", scene_load(text))) return;
  const int nv = s.model->nv;
  double worst = 0, *step = calloc((size_t)nv, sizeof *step);
  for (int i = 0; i < 120; i++) {
    s.state->options.order = (cav_order)(i % 3);
    s.state->options.spring = (cav_spring)(i / 3 % 4 > 0);
    s.state->options.softness = 0.1;
    for (int k = 0; k < nv; k++) step[k] = 0.1 * scene_uniform(), s.v[k] = 0.5 * scene_uniform();
    cav_integrate(s.model, s.model->q0, step, 1, s.q);
    for (int k = 0; k < nv; k++) s.truth[k] = s.v[k] + 0.1 * scene_uniform();
    CHECK(cav_inverse(s.model, s.state, s.q, s.v, s.truth, s.u) == CAV_OK);
    CHECK(cav_forward(s.model, s.state, s.q, s.v, s.u, s.v_next) == CAV_OK);
    worst = fmax(worst, apart(s.v_next, s.truth, nv));
    if (i / 3 % 4 > 0)
      CHECK(cav_forward_gpgs(s.model, s.state, s.q, s.v, s.u, 9, 1e-9, s.v_next, NULL) == CAV_NOT_SUPPORTED);
  }
  CHECK(worst <= 1e-9);
  printf("springs there and back: %.1e\n", worst);
  free(step);
  scene_close(&s);
}

// ---------------------------------------------------------------- large steps of the mean velocity

// a bead at r on an arm that turns, whatever its angle. With w the mean of the arm's two velocities a step
// of midpoint is a cubic in w, which always has a root, and three where the bead comes in fast; between the folds the
// cubic falls
static void test_bead(void) {
  static const double steps[] = {0.02, 0.2, 0.5};
  scene s;
  if (!scene_open(&s, "bead",
                  scene_load("<mujoco><option gravity='0 0 0'/><worldbody><body>"
                             "<joint type='hinge' axis='0 0 1'/><geom type='cylinder' size='.1 .1' mass='2'/><body>"
                             "<joint type='slide' axis='1 0 0'/><geom type='sphere' size='.1' mass='1.5' "
                             "contype='0' conaffinity='0'/></body></body></worldbody></mujoco>")))
    return;
  s.state->options.order = CAV_ORDER_MIDPOINT;
  int folded = 0, single = 0, without = 0;
  const double m = 1.5, I = 0.5 * 2 * 0.01 + 0.4 * m * 0.01;
  for (int i = 0; i < 3000; i++) {
    const double h = steps[i % 3], r = 0.2 + 0.3 * fabs(scene_uniform());
    s.state->options.timestep = h;
    s.q[0] = 3 * scene_uniform(), s.q[1] = r;
    scene_throw(&s, 5, 5);
    cav_forward_report report;
    const cav_status status = cav_forward_newton(s.model, s.state, s.q, s.v, s.u, 1000, 1e-13, s.v_next, &report);
    CHECK(status == CAV_OK || status == CAV_NOT_CONVERGED);
    without += status != CAV_OK;
    const double a = I + m * r * r, w = 0.5 * (s.v[0] + s.v_next[0]), b = s.v[1] + 0.5 * h * s.u[1] / m;
    const double terms[] = {2 * a * w / h, -2 * a * s.v[0] / h, 2 * m * r * w * b, m * r * r * h * w * w * w, -s.u[0]};
    double sum = 0, size = 0;
    for (int k = 0; k < 5; k++) sum += terms[k], size += fabs(terms[k]);
    CHECK(fabs(sum) <= 1e-10 * size || status != CAV_OK);
    const double slope = 2 * a / h + 2 * m * r * b + 3 * m * r * r * h * w * w;
    CHECK(report.folded == (slope < 0) || status != CAV_OK);
    folded += report.folded, single += slope >= 0;
  }
  CHECK(single > 1000);
  // all have a solution, and one that is not past a fold, seen for all but one; Newton from the frozen bias alone misses 136
  CHECK(without == 0 && folded <= 2);
  printf("bead on an arm: %d of 3000 steps past a fold, %d not found\n", folded, without);
  scene_close(&s);
}

// sign of the determinant of du/dv_next at v_next by centred differences
static int sign_by_differences(scene *s) {
  const int n = s->model->nv;
  double *A = calloc((size_t)(n * n), sizeof *A);
  int sign = 1;
  CHECK(cav_inverse_jacobian_by(s->model, s->state, CAV_DERIVATIVE_CENTRED, s->q, s->v, s->v_next, NULL, NULL, A) ==
        CAV_OK);
  for (int k = 0; k < n; k++) {
    int pivot = k;
    for (int i = k + 1; i < n; i++)
      if (fabs(A[i * n + k]) > fabs(A[pivot * n + k])) pivot = i;
    for (int j = 0; j < n && pivot != k; j++) {
      const double kept = A[k * n + j];
      A[k * n + j] = A[pivot * n + j], A[pivot * n + j] = kept;
    }
    if ((A[k * n + k] < 0) != (pivot != k)) sign = -sign;
    for (int i = k + 1; i < n; i++) {
      const double ratio = A[i * n + k] / A[k * n + k];
      for (int j = k; j < n; j++) A[i * n + j] -= ratio * A[k * n + j];
    }
  }
  free(A);
  return sign;
}

// a chain at steps of all sizes: what is past a fold is told, and nothing is where steps are short
static void test_folds(void) {
  static char text[1 << 14];
  char *at = text + sprintf(text, "<mujoco><worldbody>");
  for (int i = 0; i < 10; i++)
    at += sprintf(at,
                  "<body pos='%g 0 0'><joint axis='%d %d 0'/><geom type='capsule' fromto='0 0 0 .1 0 0' size='.02' "
                  "contype='0' conaffinity='0'/>",
                  i ? 0.1 : 0.0, i % 2, !(i % 2));
  for (int i = 0; i < 10; i++) at += sprintf(at, "</body>");
  sprintf(at, "</worldbody></mujoco>");
  scene s;
  if (!scene_open(&s, "chain", scene_load(text))) return;
  int told[2] = {0, 0}, without = 0, wrong = 0;
  for (int i = 0; i < 400; i++) {
    const int large = i % 4 > 1;
    s.state->options.order = i % 2 ? CAV_ORDER_MOMENTUM : CAV_ORDER_MIDPOINT;
    s.state->options.timestep = large ? 0.1 : 0.005;
    scene_throw(&s, 1, 0);
    for (int k = 0; k < s.model->nv; k++) s.q[k] = 0.2 * scene_uniform();
    cav_forward_report report;
    const cav_status status = cav_forward_newton(s.model, s.state, s.q, s.v, s.u, 1000, 1e-13, s.v_next, &report);
    CHECK(status == CAV_OK || (large && status == CAV_NOT_CONVERGED && report.folded));
    without += status != CAV_OK;
    if (status != CAV_OK) continue;
    told[large] += report.folded;
    wrong += report.folded != (sign_by_differences(&s) < 0);
  }
  printf("chain: past a fold %d of 200 short steps, %d of 200 long ones, %d without solution\n", told[0], told[1],
         without);
  CHECK(told[0] == 0 && told[1] > 5);
  CHECK(wrong == 0);
  scene_close(&s);
}

// ---------------------------------------------------------------- what smoothing adds at rest

// a box put on the floor where the smoothed law is active: how high it ends, energy at its most above the start, what
// motion is left
typedef struct rest {
  double smoothing, lift, added, kinetic;
} rest;

static rest let_lie(double smoothing, double h, double seconds) {
  rest r = {.smoothing = smoothing};
  scene s;
  if (!scene_open(&s, "box",
                  scene_load("<mujoco><worldbody><geom type='plane' size='5 5 1'/><body pos='0 0 .1'><freejoint/>"
                             "<geom type='box' size='.1 .1 .1' mass='2'/></body></worldbody></mujoco>")))
    return r;
  s.state->options.timestep = h;
  s.state->options.softness = 1e-3;
  s.state->options.time_constant = 0.02;
  s.state->options.smoothing = s.state->options.smoothing_self = smoothing;
  const double g = -s.model->gravity[2], m = s.model->mass;
  for (int i = 0; i * h < seconds; i++) {
    CHECK(cav_forward(s.model, s.state, s.q, s.v, s.u, s.v_next) == CAV_OK);
    memcpy(s.v, s.v_next, (size_t)s.model->nv * sizeof *s.v);
    cav_integrate(s.model, s.q, s.v, h, s.q);
    r.kinetic = 0.5 * m * (s.v[0] * s.v[0] + s.v[1] * s.v[1] + s.v[2] * s.v[2]);
    r.added = fmax(r.added, r.kinetic + m * g * (s.q[2] - 0.1));
  }
  r.lift = s.q[2] - 0.1;
  // at rest four corners bear h g m: each sigma/sqrt(R) log(1 + exp(-x/delta)), without slip as a limit does
  CHECK(cav_inverse(s.model, s.state, s.q, s.v, s.v, s.u) == CAV_OK);
  if (CHECK(s.state->ncontact == 4) && smoothing > 0) {
    const cav_contact *c = &s.state->contact[0];
    const double R = c->regulariser[0];
    const double load = 0.25 * h * m * g * R / (c->stiffness * smoothing);
    CHECK_NEAR(r.lift, -smoothing * log(expm1(load)), 1e-6 * smoothing);
  }
  scene_close(&s);
  return r;
}

static void test_rest(int table) {
  static const double smoothing[] = {0, 1e-4, 1e-3, 5e-3, 2e-2};
  if (table)
    printf(
        "\n## What the smoothed law adds to bodies at rest\n\nA box of 2 kg, 0.2 m, put on the floor at gap 0, "
        "softness "
        "1e-3, time constant 20 ms, 10 s. Lift at the end, energy at its\nmost above the start over m g delta, kinetic "
        "energy at the end.\n\n| smoothing, m | step, s | lift, m | lift / delta | energy added, J | over m g delta | "
        "kinetic at the end, J |\n|--:|--:|--:|--:|--:|--:|--:|\n");
  for (int i = 0; i < 5; i++)
    for (int k = 0; k < 3; k++) {
      const double h = k == 0 ? 0.002 : k == 1 ? 0.005 : 0.02;
      const rest r = let_lie(smoothing[i], h, table ? 10 : 4);
      const double unit = 2 * 9.81 * smoothing[i];
      if (table)
        printf("| %g | %g | %.2e | %.2f | %.1e | %.2f | %.0e |\n", r.smoothing, h, r.lift,
               unit > 0 ? r.lift / r.smoothing : 0, r.added, unit > 0 ? r.added / unit : 0, r.kinetic);
      // it comes to rest, seen 1e-28
      CHECK(r.kinetic <= 1e-12);
    }
}

int main(int count, char **arguments) {
  const int table = count > 1 && !strcmp(arguments[1], "table");
  test_softness(table);
  test_rest(table);
  if (table) return check_failed > 0;
  test_springs();
  test_springs_at_q();
  test_slack();
  test_springs_and_back();
  test_bead();
  test_folds();
  return check_result();
}
