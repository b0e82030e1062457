/// Terms of one's own: one that measures what a built-in quantity does gives its motion, cost and report, with a Jacobian
/// and without; Jacobians through u and impulses against centred differences, and a wrong one found; hard ones hold and
/// are explained by name; the same bits at any number of threads; what a function refuses is told with term and knot, by
/// solver and certificate; files refuse them.
#include "cavort/cavort.h"
#include "scene.h"

/// An arm of two hinges, and a cart that nothing drives beside it.
static const char arm_text[] =
    "<mujoco model='arm'><worldbody><geom type='plane' size='5 5 1'/>"
    "<body name='upper' pos='0 0 1'><joint name='shoulder' axis='0 1 0' damping='.2'/><geom type='capsule' size='.04' "
    "fromto='0 0 0 0 0 -.4' mass='2'/><body name='lower' pos='0 0 -.4'><joint name='elbow' axis='0 1 0' damping='.1' "
    "limited='true' range='-100 20'/><geom type='capsule' size='.03' fromto='0 0 0 0 0 -.4' mass='1'/>"
    "<site name='tip' pos='0 0 -.4'/></body></body>"
    "<body name='cart' pos='.9 0 .6'><joint name='rail' type='slide' axis='0 1 0' damping='1'/>"
    "<geom type='sphere' size='.05' mass='1'/></body></worldbody><actuator>"
    "<motor joint='shoulder' gear='30' ctrllimited='true' ctrlrange='-1 1'/>"
    "<motor joint='elbow' gear='8' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";

/// A leg that stands on the floor.
static const char leg_text[] =
    "<mujoco><worldbody><geom type='plane' size='9 9 1'/><body name='trunk' pos='0 0 .52'>"
    "<joint name='x' type='slide' axis='1 0 0'/><joint name='z' type='slide' axis='0 0 1'/>"
    "<joint name='pitch' axis='0 1 0'/><geom type='sphere' size='.1' mass='4'/>"
    "<body name='thigh'><joint name='hip' axis='0 1 0'/>"
    "<geom type='capsule' fromto='0 0 0 0 0 -.25' size='.03' mass='1'/><body name='shank' pos='0 0 -.25'>"
    "<joint name='knee' axis='0 1 0' damping='.1'/><geom type='capsule' fromto='0 0 0 0 0 -.22' size='.03' "
    "mass='.6'/></body></body></body></worldbody><actuator><motor joint='hip' gear='60'/>"
    "<motor joint='knee' gear='40'/></actuator></mujoco>";

// ---------------------------------------------------------------- quantities

/// A sensor's reading.
static int sensor_value(void *context, const cav_knot_view *view, double *value) {
  cav_sensor_read(view->model, view->state, context, value);
  return 0;
}

static int sensor_jacobian(void *context, const cav_knot_view *view, const cav_view_jacobian *jacobian) {
  return cav_sensor_derivatives(view->model, view->state, context, jacobian->dq, jacobian->dv_next) != CAV_OK;
}

/// Power of each motor of a hinge, W: at the mean velocity of the step.
static int power_value(void *context, const cav_knot_view *view, double *value) {
  (void)context;
  for (int a = 0; a < view->model->nu; a++) {
    int d = view->model->joint[view->model->actuator[a].target].dof;
    value[a] = view->u[d] * (view->v[d] + view->v_next[d]) / 2;
  }
  return 0;
}

static int power_jacobian(void *context, const cav_knot_view *view, const cav_view_jacobian *jacobian) {
  const double *factor = context; // of a wrong one
  for (int a = 0; a < view->model->nu; a++) {
    int d = view->model->joint[view->model->actuator[a].target].dof, at = a * view->model->nv + d;
    jacobian->dv[at] = jacobian->dv_next[at] = view->u[d] / 2;
    jacobian->du[at] = (view->v[d] + view->v_next[d]) / 2 * (factor ? *factor : 1);
  }
  return 0;
}

/// Root of the weighted normal force and the work of slip of all contacts: of impulses, and of what contacts have besides.
static int load_value(void *context, const cav_knot_view *view, double *value) {
  (void)context;
  for (int i = 0; i < view->state->ncontact; i++) {
    const cav_contact *c = &view->state->contact[i];
    value[0] += c->impulse[0] / view->timestep;
    value[1] += c->impulse[1] / view->timestep * c->velocity_next[1];
  }
  return 0;
}

static int load_jacobian(void *context, const cav_knot_view *view, const cav_view_jacobian *jacobian) {
  int nv = view->model->nv, stride = 6 * view->state->ncontact;
  double *by = calloc(12 * (size_t)nv, sizeof *by);
  (void)context;
  for (int i = 0; i < view->state->ncontact && by; i++) {
    const cav_contact *c = &view->state->contact[i];
    cav_contact_derivative d = {.velocity_dq = by, .velocity_dv_next = by + 6 * nv};
    if (cav_contact_derivatives(view->model, view->state, i, &d)) return 7;
    jacobian->dimpulse[6 * i] = 1 / view->timestep;
    jacobian->dimpulse[stride + 6 * i + 1] = c->velocity_next[1] / view->timestep;
    for (int j = 0; j < nv; j++) {
      jacobian->dq[nv + j] += c->impulse[1] / view->timestep * by[nv + j];
      jacobian->dv_next[nv + j] += c->impulse[1] / view->timestep * by[7 * nv + j];
    }
  }
  free(by);
  return 0;
}

/// Refuses or gives no number at a time.
typedef struct fault {
  double time;
  int code, jacobian, calls;
} fault;

static int faulty_value(void *context, const cav_knot_view *view, double *value) {
  fault *f = context;
  value[0] = view->q[0];
  if (f->jacobian || fabs(view->time - f->time) > 1e-9) return 0;
  if (!f->code) value[0] = NAN;
  return f->code;
}

static int faulty_jacobian(void *context, const cav_knot_view *view, const cav_view_jacobian *jacobian) {
  fault *f = context;
  jacobian->dq[0] = 1;
  if (!f->jacobian || fabs(view->time - f->time) > 1e-9) return 0;
  if (!f->code) jacobian->du[1] = INFINITY;
  return f->code;
}

/// Log of how far the shoulder is from 1.3 rad, which first steps overshoot.
static int log_value(void *context, const cav_knot_view *view, double *value) {
  int *beyond = context;
  value[0] = log(1.3 + view->q[0]);
  *beyond += !isfinite(value[0]);
  return 0;
}

// ---------------------------------------------------------------- the problem

enum { TERMS = 16 };

typedef struct task {
  cav_model *model;
  cav_problem problem;
  cav_term term[TERMS];
  double *q; ///< start and goal
} task;

/// The arm from rest to a posture with a few running costs.
static int task_new(task *t) {
  *t = (task){.model = scene_load(arm_text)};
  if (!CHECK(t->model != NULL)) return 0;
  int nq = t->model->nq;
  t->q = scene_vector(3 * nq);
  t->problem = cav_problem_default(t->model);
  t->problem.name = "arm";
  t->problem.duration = 0.8, t->problem.timestep = 0.04;
  t->problem.schedule.stages = 3;
  t->problem.q_start = t->q, t->problem.v_start = t->q + 2 * nq, t->problem.q_goal = t->q + nq;
  t->q[nq] = -1, t->q[nq + 1] = -0.5;
  cav_term base[TERMS];
  cav_problem_default_terms(base, TERMS);
  t->term[0] = base[0], t->term[1] = base[1], t->term[2] = base[3];
  t->problem.term = t->term;
  t->problem.nterm = 3;
  return 1;
}

static void task_free(task *t) {
  cav_model_free(t->model);
  free(t->q);
}

static cav_term *add(task *t, const char *name, cav_quantity quantity) {
  cav_term *term = &t->term[t->problem.nterm++];
  *term = t->term[0];
  term->name = name, term->quantity = quantity, term->weight = 1;
  return term;
}

static cav_term *add_user(task *t, const char *name, const cav_user_quantity *user) {
  cav_term *term = add(t, name, CAV_QUANTITY_USER);
  term->user = user;
  return term;
}

static cav_derivative method = CAV_DERIVATIVE_ANALYTIC;

static cav_solution *solve(const task *t, cav_solver solver, int threads, cav_status expected, cav_error *error) {
  cav_solution *solution = NULL;
  cav_solve_options options = cav_solve_options_default();
  cav_error own = {0};
  options.solver = solver, options.threads = threads, options.gains = 0, options.derivative = method;
  cav_status status = cav_solve(&t->problem, &options, NULL, &solution, &own);
  if (!CHECK(status == expected)) fprintf(stderr, "    %s: %s\n", cav_status_name(status), own.text);
  if (error) *error = own;
  return solution;
}

static double distance(const cav_solution *a, const cav_solution *b) {
  double most = 0;
  for (int i = 0; i < a->trajectory->nknot * a->trajectory->nq; i++)
    most = fmax(most, fabs(a->trajectory->q[i] - b->trajectory->q[i]));
  return most;
}

static cav_sensor tip_sensor(const cav_model *m, cav_sensor_type type) {
  cav_sensor sensor = {.name = "", .type = type, .object_type = CAV_OBJECT_SITE, .dim = 3, .adr = -1};
  sensor.object = cav_object_find(m, CAV_OBJECT_SITE, "tip");
  return sensor;
}

/// The values of every term, with what they cost, against its report: the sum of the costs, and the value missed most.
static void check_values(const cav_problem *p, const cav_solution *s, const cav_term_report *report) {
  enum { MOST = 400 };
  static cav_term_value value[MOST];
  for (int i = 0; i < p->nterm; i++) {
    int n = 0, all = 0, seen = 0;
    double cost = 0, h = s->trajectory->timestep;
    CHECK(cav_term_values(p, s->trajectory, &s->contact, i, MOST, value, &n, NULL) == CAV_OK && n > 0 && n <= MOST);
    CHECK(cav_term_values(p, s->trajectory, &s->contact, i, 0, NULL, &all, NULL) == CAV_OK && all == n);
    for (int k = 0; k < n; k++) {
      cost += value[k].cost;
      CHECK(k == 0 || value[k].knot > value[k - 1].knot ||
            (value[k].knot == value[k - 1].knot && value[k].component == value[k - 1].component + 1));
      seen |= fabs(value[k].knot * h - report[i].time) < 1e-9 && value[k].value == report[i].got &&
              (value[k].target == report[i].wanted || p->term[i].use == CAV_USE_RANGE);
    }
    CHECK_NEAR(cost, report[i].cost, 1e-12 * (1 + cost));
    // postures tell coordinates, not differences
    CHECK(seen || !report[i].has_target || p->term[i].quantity == CAV_QUANTITY_CONFIGURATION);
    // a single knot has the values of one
    if (p->term[i].quantity == CAV_QUANTITY_USER) CHECK(n == (p->term[i].component < 0 ? p->term[i].user->dim : 1));
  }
  cav_error error = {0};
  int n;
  CHECK(cav_term_values(p, s->trajectory, &s->contact, p->nterm, 0, NULL, &n, &error) == CAV_BAD_INPUT && n == 0 &&
        strstr(error.text, "none of number"));
}

// ---------------------------------------------------------------- against what is built in

/// Place of the tip, hard at the end, and its speed, priced half way: by sensors (0), by functions (1), without a
/// Jacobian (2).
enum { STATED, FREE_DURATION, CYCLE };
static void test_sensors(cav_solver solver, int horizon) {
  cav_solution *found[3] = {NULL};
  cav_term_report report[3][TERMS];
  const double at[3] = {-0.5, 0, 0.7};
  for (int way = 0; way < 3; way++) {
    task t;
    if (!task_new(&t)) return;
    t.problem.cycle.on = horizon == CYCLE;
    if (horizon == FREE_DURATION)
      t.problem.duration_least = 0.5, t.problem.duration_most = 1.2, t.problem.duration_weight = 5;
    cav_sensor place = tip_sensor(t.model, CAV_SENSOR_FRAMEPOS), speed = tip_sensor(t.model, CAV_SENSOR_FRAMELINVEL);
    cav_user_quantity own[2] = {{.name = "place", .unit = "m", .dim = 3, .reads = CAV_READS_POSITION},
                                {.name = "speed", .unit = "m/s", .dim = 3, .reads = CAV_READS_VELOCITY}};
    for (int k = 0; k < 2; k++) {
      cav_term *term = add(&t, k ? "slowly" : "there", way ? CAV_QUANTITY_USER : CAV_QUANTITY_SENSOR);
      own[k].value = sensor_value, own[k].jacobian = way == 1 ? sensor_jacobian : NULL;
      own[k].context = k ? &speed : &place;
      term->sensor = k ? speed : place, term->user = &own[k];
      term->use = k ? CAV_USE_COST : CAV_USE_EQUAL;
      term->component = k ? -1 : 2;
      term->from = term->to = k ? 0.4 : 0.8;
      term->target = k ? NULL : at;
      term->weight = 30, term->scale = k ? 0.5 : 1;
    }
    found[way] = solve(&t, solver, 1, CAV_OK, NULL);
    double cost = 0;
    if (found[way])
      CHECK(cav_terms_report(&t.problem, found[way]->trajectory, &found[way]->contact, report[way], &cost, NULL) == 0);
    if (found[way]) CHECK_NEAR(cost, found[way]->cost, 1e-9 * cost);
    if (found[way]) check_values(&t.problem, found[way], report[way]);
    task_free(&t);
  }
  for (int way = 1; way < 3 && found[0] && found[1] && found[2]; way++) {
    // the same rows in the same order, so the same bits; by differences, and for Ipopt's linear solver, to their error
    int same = way == 1 || method != CAV_DERIVATIVE_ANALYTIC;
    double bound = same && solver == CAV_SOLVER_GAUSS_NEWTON ? 0 : 2e-4;
    printf("sensors, solver %d, horizon %d, way %d: %d and %d iterations, %.1e apart\n", solver, horizon, way,
           found[0]->iterations, found[way]->iterations, distance(found[0], found[way]));
    CHECK(distance(found[0], found[way]) <= bound);
    CHECK_NEAR(found[way]->cost, found[0]->cost, 1e-6 * found[0]->cost);
    for (int i = 3; i < 5; i++) {
      const cav_term_report *a = &report[0][i], *b = &report[way][i];
      CHECK(a->has_target == b->has_target && a->time == b->time && !strcmp(a->unit, b->unit));
      CHECK_NEAR(b->got, a->got, 1e-4);
      CHECK(a->wanted == b->wanted && a->met == b->met);
    }
    CHECK(!strcmp(report[way][3].what, "place 2") && report[way][3].within == report[0][3].within);
  }
  for (int way = 0; way < 3; way++) cav_solution_free(found[way]);
}

/// Power of the actuators by CAV_QUANTITY_POWER (over the weight) and by a function (W), as squares and as amounts.
static void test_power(cav_norm norm) {
  cav_solution *found[3] = {NULL};
  for (int way = 0; way < 3; way++) {
    task t;
    if (!task_new(&t)) return;
    double weight = t.model->mass * 9.81;
    cav_user_quantity own = {.name = "power", .unit = "W", .dim = t.model->nu, .reads = CAV_READS_ACCELERATION};
    own.value = power_value, own.jacobian = way == 1 ? power_jacobian : NULL;
    cav_term *term = add(&t, "work", way ? CAV_QUANTITY_USER : CAV_QUANTITY_POWER);
    term->user = &own;
    term->norm = norm, term->scale = norm == CAV_NORM_ABSOLUTE ? 0.02 : 0.1, term->weight = 0.5;
    if (way) term->scale *= weight;
    cav_term *reach = add(&t, "reach", CAV_QUANTITY_CONFIGURATION);
    reach->from = reach->to = 0.8, reach->weight = 50;
    found[way] = solve(&t, CAV_SOLVER_GAUSS_NEWTON, 1, CAV_OK, NULL);
    task_free(&t);
  }
  for (int way = 1; way < 3 && found[0] && found[1] && found[2]; way++) {
    printf("power, norm %d, way %d: cost %.9g and %.9g, %.1e apart\n", norm, way, found[0]->cost, found[way]->cost,
           distance(found[0], found[way]));
    CHECK_NEAR(found[way]->cost, found[0]->cost, 1e-6 * found[0]->cost);
    CHECK(distance(found[0], found[way]) < 2e-3);
  }
  for (int way = 0; way < 3; way++) cav_solution_free(found[way]);
}

// ---------------------------------------------------------------- Jacobians

static double check_at_random(cav_model *m, const cav_user_quantity *quantity, int states, double scale, int *touched) {
  cav_state *state = cav_state_new(m);
  double *q = scene_vector(m->nq + 3 * m->nv), *v = q + m->nq, *next = v + m->nv, *scratch = next + m->nv, worst = 0;
  state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  state->options.smoothing = 0.02, state->options.softness = 0.5, state->options.time_constant = 0.02;
  for (int k = 0; k < states; k++) {
    double off = NAN;
    int where[3];
    cav_error error = {0};
    scene_posture(m, q, scratch, scale);
    scene_normals(v, m->nv, 0.3);
    for (int d = 0; d < m->nv; d++) next[d] = v[d] + 0.05 * scene_normal();
    if (!CHECK(cav_user_quantity_check(quantity, state, q, v, next, &off, where, &error) == CAV_OK))
      fprintf(stderr, "    %s\n", error.text);
    *touched += state->ncontact > 0 && state->contact[0].impulse[0] > 0;
    worst = fmax(worst, off);
  }
  cav_state_free(state);
  free(q);
  return worst;
}

static void test_jacobians(void) {
  cav_model *arm = scene_load(arm_text), *leg = scene_load(leg_text);
  if (!CHECK(arm && leg)) return;
  int touched = 0, none = 0;
  double wrong = 1.01;
  cav_user_quantity power = {"power", "W", arm->nu, CAV_READS_ACCELERATION, power_value, power_jacobian, NULL, 0};
  cav_user_quantity load = {"load", "N", 2, CAV_READS_ACCELERATION, load_value, load_jacobian, NULL, 0};
  double of_power = check_at_random(arm, &power, 20, 0.5, &none);
  double of_load = check_at_random(leg, &load, 20, 0.01, &touched);
  power.context = &wrong;
  double of_wrong = check_at_random(arm, &power, 20, 0.5, &none);
  printf("Jacobians: power %.1e, load %.1e (%d of 20 touch), wrong by 1 %%: %.1e\n", of_power, of_load, touched,
         of_wrong);
  CHECK(of_power < 1e-6);
  CHECK(of_load < 1e-5 && touched >= 15);
  CHECK(of_wrong > 1e-3);
  cav_state *state = cav_state_new(arm);
  double *q = scene_vector(arm->nq), *v = scene_vector(arm->nv), off;
  cav_error error = {0};
  power.jacobian = NULL;
  CHECK(cav_user_quantity_check(&power, state, q, v, v, &off, NULL, &error) == CAV_BAD_INPUT &&
        strstr(error.text, "'power'"));
  // one that says less than it reads
  power.jacobian = power_jacobian, power.context = NULL, power.reads = CAV_READS_VELOCITY;
  double speed[3] = {1, 2, 0.5}, later[3] = {1.5, 1, 0.7};
  CHECK(cav_user_quantity_check(&power, state, q, speed, later, &off, NULL, &error) == CAV_BAD_INPUT &&
        strstr(error.text, "later stage"));
  power.reads = CAV_READS_ACCELERATION;
  CHECK(cav_user_quantity_check(&power, state, q, speed, later, &off, NULL, &error) == CAV_OK && off < 1e-6);
  const double *at_q, *at_v, *at_next;
  v[0] = 0.1;
  double *u = scene_vector(arm->nv), *next = scene_vector(arm->nv);
  CHECK(cav_inverse(arm, state, q, v, next, u) == CAV_OK);
  cav_state_point(state, &at_q, &at_v, &at_next);
  CHECK(!memcmp(at_q, q, sizeof(double) * arm->nq) && !memcmp(at_v, v, sizeof(double) * arm->nv) &&
        !memcmp(at_next, next, sizeof(double) * arm->nv));
  free(q), free(v), free(u), free(next);
  cav_state_free(state);
  cav_model_free(arm), cav_model_free(leg);
}

// ---------------------------------------------------------------- hard ones

/// Squared distance of two bodies' centres of mass.
static int near_value(void *context, const cav_knot_view *view, double *value) {
  const int *body = context;
  cav_pose a, b;
  cav_object_pose(view->model, view->state, CAV_OBJECT_BODY, body[0], &a);
  cav_object_pose(view->model, view->state, CAV_OBJECT_BODY, body[1], &b);
  for (int k = 0; k < 3; k++) value[0] += (a.pos[k] - b.pos[k]) * (a.pos[k] - b.pos[k]);
  value[0] = sqrt(value[0]);
  return 0;
}

/// Least of a motion.
static double nearest(const cav_model *m, const cav_trajectory *at, int *body) {
  cav_state *state = cav_state_new(m);
  cav_knot_view view = {.model = m, .state = state};
  double least = INFINITY;
  for (int t = 0; state && t < at->nknot; t++) {
    double value = 0;
    CHECK(cav_position(m, state, at->q + t * at->nq) == CAV_OK && near_value(body, &view, &value) == 0);
    least = fmin(least, value);
  }
  cav_state_free(state);
  return least;
}

/// The lower link stays away from the cart, which no actuator moves, as far as it gets on its own; threads; the
/// certificate, the report and the explanation speak of it by name.
static void test_hard(void) {
  task t;
  if (!task_new(&t)) return;
  int body[2] = {cav_object_find(t.model, CAV_OBJECT_BODY, "lower"), cav_object_find(t.model, CAV_OBJECT_BODY, "cart")};
  cav_user_quantity far = {"distance", "m", 1, CAV_READS_POSITION, near_value, NULL, body, 0};
  double goal[3] = {-2.2, 0, 0};
  cav_term *reach = add(&t, "reach", CAV_QUANTITY_CONFIGURATION);
  reach->dofs = CAV_DOFS_ONE, reach->joint = 0, reach->target = goal, reach->from = reach->to = 0.8, reach->weight = 50;
  cav_term *term = add_user(&t, "keep off", &far);
  term->use = CAV_USE_RANGE, term->lower = 0.55;
  cav_solution *one = solve(&t, CAV_SOLVER_GAUSS_NEWTON, 1, CAV_OK, NULL);
  cav_solution *three = solve(&t, CAV_SOLVER_GAUSS_NEWTON, 3, CAV_OK, NULL);
  if (!CHECK(one && three)) return;
  CHECK(distance(one, three) == 0 && one->cost == three->cost);
  cav_term_report report[TERMS];
  cav_verdict verdict = {0};
  cav_error error = {0};
  CHECK(cav_terms_report(&t.problem, one->trajectory, &one->contact, report, NULL, &error) == CAV_OK);
  const cav_term_report *r = &report[t.problem.nterm - 1];
  CHECK(r->has_target && r->met && !strcmp(r->what, "distance") && !strcmp(r->unit, "m"));
  double least = nearest(t.model, one->trajectory, body);
  CHECK(least >= 0.55 - 1e-6 && least < 0.551);
  cav_explanation why;
  CHECK(cav_explain(&t.problem, one->trajectory, &one->contact, one->nrow, one->row, &why, &error) == CAV_OK);
  int named = 0;
  for (int i = 0; i < why.nconflict; i++) named |= strstr(why.conflict[i].what, "'keep off', distance") != NULL;
  CHECK(why.met && named);
  if (!named)
    for (int i = 0; i < why.nconflict; i++) printf("    %s\n", why.conflict[i].what);
  for (int i = 0; i < why.nviolation; i++) printf("    missed %s\n", why.violation[i].what);
  CHECK(cav_verify(&t.problem, one->trajectory, &one->contact, NULL, NULL, &verdict, &error) == CAV_OK);
  CHECK(verdict.constraint_violation_max < CAV_TOLERANCE_CONSTRAINT);
  CHECK(cav_verify_optimality(&t.problem, one->trajectory, &one->contact, one->nrow, one->row, &verdict, &error) ==
        CAV_OK);
  printf("hard: nearest %.6f, optimal to %.1e (the solver's own %.1e)\n", least, verdict.optimality, one->optimality);
  CHECK(verdict.optimality < CAV_TOLERANCE_OPTIMAL);
  // without it the motion comes nearer, so it held something back
  t.problem.nterm--;
  cav_solution *free_one = solve(&t, CAV_SOLVER_GAUSS_NEWTON, 1, CAV_OK, NULL);
  t.problem.nterm++;
  if (free_one)
    CHECK(cav_terms_report(&t.problem, free_one->trajectory, &free_one->contact, report, NULL, &error) == CAV_OK &&
          !r->met && r->got < 0.5);
  // a certificate of that one says which constraint it misses
  CHECK(cav_verify(&t.problem, free_one->trajectory, &free_one->contact, NULL, NULL, &verdict, &error) == CAV_OK);
  CHECK(!verdict.certified && strstr(verdict.reason, "keep off") && strstr(verdict.missed, "keep off"));
  // files cannot say it
  char path[] = "/tmp/cavort-user-term.xml";
  CHECK(cav_problem_write(path, &t.problem, "arm.xml", &error) == CAV_BAD_INPUT && strstr(error.text, "'keep off'") &&
        strstr(error.text, "'distance'") && access(path, F_OK));
  // nor can a result folder, which then holds nothing; nor one of a model without a file
  char folder[] = "/tmp/cavort-user-term-XXXXXX", deep[64], within[96];
  if (!CHECK(mkdtemp(folder) != NULL)) return;
  snprintf(deep, sizeof deep, "%s/a/b", folder);
  CHECK(cav_result_write(deep, &t.problem, one, &error) == CAV_BAD_INPUT && strstr(error.text, "cav_draft_mjcf"));
  t.problem.model_path = CAVORT_SOURCE_ROOT "/tests/rise_model.xml";
  CHECK(cav_result_write(deep, &t.problem, one, &error) == CAV_BAD_INPUT && strstr(error.text, "'keep off'"));
  CHECK(cav_result_write(deep, &t.problem, one, NULL) == CAV_BAD_INPUT);
  static const char *const files[] = {"trajectory.csv", "problem.xml", "log.csv", "rows.csv"};
  for (int i = 0; i < 4; i++) {
    snprintf(within, sizeof within, "%s/%s", deep, files[i]);
    CHECK(access(within, F_OK));
  }
  // what needs no problem file can
  CHECK(cav_result_write_forces(deep, &t.problem, one->trajectory, &one->contact, &error) == CAV_OK);
  CHECK(cav_result_write_verdict(deep, &t.problem, &verdict, report, "{\"by\": 1}", &error) == CAV_OK);
  static const char *const others[] = {"forces.csv", "controls.csv", "verdict.json", "terms.csv"};
  for (int i = 0; i < 4; i++) {
    snprintf(within, sizeof within, "%s/%s", deep, others[i]);
    CHECK(!unlink(within));
  }
  rmdir(deep), snprintf(deep, sizeof deep, "%s/a", folder), rmdir(deep);
  CHECK(!rmdir(folder));
  cav_solution_free(one), cav_solution_free(three), cav_solution_free(free_one);
  task_free(&t);
}

// ---------------------------------------------------------------- what goes wrong

static void test_faults(cav_solver solver) {
  for (int jacobian = 0; jacobian < 2; jacobian++)
    for (int code = 0; code < 2; code++) {
      task t;
      if (!task_new(&t)) return;
      fault f = {.time = 0.2, .code = code ? -3 : 0, .jacobian = jacobian};
      cav_user_quantity own = {"bad", "", 1, CAV_READS_POSITION, faulty_value, faulty_jacobian, &f, 0};
      add_user(&t, "mine", &own);
      cav_error error;
      cav_solution *s = solve(&t, solver, 2, code ? CAV_BAD_INPUT : CAV_NOT_FINITE, &error);
      const char *what = code ? "returned -3" : "not finite";
      if (!CHECK(strstr(error.text, "'mine'") && strstr(error.text, "'bad'") && strstr(error.text, what) &&
                 strstr(error.text, "knot 5") && strstr(error.text, "0.2 s")))
        fprintf(stderr, "    solver %d: %s\n", solver, error.text);
      cav_solution_free(s);
      // the certificate evaluates by itself
      cav_trajectory *rest = cav_trajectory_new(t.model, 21, 0.04);
      cav_options law = t.model->options;
      cav_verdict verdict;
      cav_term_report report[TERMS];
      cav_status wanted = jacobian ? CAV_OK : code ? CAV_BAD_INPUT : CAV_NOT_FINITE;
      law.timestep = 0.04;
      CHECK(cav_verify(&t.problem, rest, &law, NULL, NULL, &verdict, &error) == wanted);
      if (!jacobian) CHECK(!verdict.certified && strstr(error.text, "'mine'") && strstr(error.text, "knot 5"));
      CHECK(cav_terms_report(&t.problem, rest, &law, report, NULL, &error) == wanted);
      if (!jacobian) CHECK(strstr(error.text, "'mine'") && strstr(error.text, "knot 5"));
      int n;
      CHECK(cav_term_values(&t.problem, rest, &law, 3, 0, NULL, &n, &error) == wanted);
      if (!jacobian) CHECK(strstr(error.text, "'mine'") && strstr(error.text, "knot 5"));
      cav_trajectory_free(rest);
      task_free(&t);
    }
}

/// A solver that is made once says it at the call, and goes on when the function does.
static void test_optimiser(void) {
  task t;
  if (!task_new(&t)) return;
  fault f = {.time = 0.2};
  cav_user_quantity own = {"bad", "", 1, CAV_READS_POSITION, faulty_value, NULL, &f, 0};
  add_user(&t, "mine", &own);
  f.time = -1;
  cav_error error = {0};
  cav_optimiser *o = cav_optimiser_new(&t.problem, NULL, NULL, &error);
  if (CHECK(o != NULL)) {
    CHECK(cav_optimiser_solve(o, 1, NULL, &error) == CAV_OK);
    f.time = 0.2, f.code = 5;
    CHECK(cav_optimiser_iterate(o, 1, NULL) == CAV_BAD_INPUT);
    CHECK(cav_optimiser_solve(o, 99, NULL, &error) == CAV_BAD_INPUT && strstr(error.text, "returned 5 at knot 5"));
    f.code = 0;
    CHECK(cav_optimiser_iterate(o, 1, NULL) == CAV_NOT_FINITE);
    f.time = -1;
    CHECK(cav_optimiser_iterate(o, 1, NULL) == CAV_OK);
    CHECK(cav_optimiser_solve(o, 99, NULL, &error) == CAV_OK);
  }
  cav_optimiser_free(o);
  task_free(&t);
}

/// Values that are not finite beyond where a motion should go refuse steps, and the solve arrives.
static void test_domain(void) {
  task t;
  if (!task_new(&t)) return;
  int beyond = 0;
  double aim = -0.5, goal[3] = {-3.2, 0, 0};
  cav_user_quantity own = {"log", "", 1, CAV_READS_POSITION, log_value, NULL, &beyond, 0};
  add_user(&t, "domain", &own)->weight = 0.1;
  t.term[3].target = &aim;
  cav_term *reach = add(&t, "reach", CAV_QUANTITY_CONFIGURATION);
  reach->dofs = CAV_DOFS_ONE, reach->joint = 0, reach->target = goal, reach->from = reach->to = 0.8, reach->weight = 50;
  t.problem.guess = CAV_GUESS_HOLD;
  cav_solution *s = solve(&t, CAV_SOLVER_GAUSS_NEWTON, 1, CAV_OK, NULL);
  double least = 0;
  for (int k = 0; s && k < s->trajectory->nknot; k++) least = fmin(least, s->trajectory->q[k * s->trajectory->nq]);
  printf("domain: %d evaluations beyond it, the shoulder goes to %.4f\n", beyond, least);
  CHECK(beyond > 0 && least > -1.3 && least < -1);
  cav_solution_free(s);
  task_free(&t);
}

static void refuse(task *t, const char *says) {
  cav_error error = {0};
  cav_equations equations;
  cav_solution *s = solve(t, CAV_SOLVER_GAUSS_NEWTON, 1, CAV_BAD_INPUT, &error);
  if (!CHECK(!s && strstr(error.text, "'mine'") && strstr(error.text, says))) fprintf(stderr, "    %s\n", error.text);
  CHECK(cav_problem_equations(&t->problem, &equations, &error) == CAV_BAD_INPUT);
}

static void test_refused(void) {
  task t;
  if (!task_new(&t)) return;
  cav_user_quantity own = {"own", "", 0, CAV_READS_POSITION, near_value, NULL, NULL, 0};
  cav_term *term = add_user(&t, "mine", &own);
  refuse(&t, "dim");
  own.dim = CAV_USER_DIM_MAX + 1;
  refuse(&t, "dim");
  own.dim = 2, term->component = 2;
  refuse(&t, "component");
  term->component = -1, own.value = NULL;
  refuse(&t, "function");
  own.value = near_value, own.reads = 7;
  refuse(&t, "reads");
  term->user = NULL;
  refuse(&t, "function");
  task_free(&t);
}

int main(void) {
  int ipopt = !cav_solver_rule_of(CAV_SOLVER_IPOPT)->missing;
  test_jacobians();
  test_sensors(CAV_SOLVER_GAUSS_NEWTON, STATED);
  test_sensors(CAV_SOLVER_GAUSS_NEWTON, FREE_DURATION);
  test_sensors(CAV_SOLVER_GAUSS_NEWTON, CYCLE);
  // where everything is differenced nobody is asked for a Jacobian
  method = CAV_DERIVATIVE_CENTRED;
  test_sensors(CAV_SOLVER_GAUSS_NEWTON, STATED);
  method = CAV_DERIVATIVE_ANALYTIC;
  test_power(CAV_NORM_SQUARE);
  test_power(CAV_NORM_ABSOLUTE);
  test_hard();
  test_faults(CAV_SOLVER_GAUSS_NEWTON);
  test_optimiser();
  test_domain();
  test_refused();
  if (ipopt) test_sensors(CAV_SOLVER_IPOPT, STATED);
  if (ipopt) test_faults(CAV_SOLVER_IPOPT);
  return check_result();
}
