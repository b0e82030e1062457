/// Time steps: a motion of the scene by each order over a range of steps against the motion that ever smaller steps lead
/// to. One without contacts and limits, whose joints sinusoidal forces move, and one from where the scene has come to with
/// contacts by itself. References: the order midpoint at three steps finer than all others, extrapolated (Richardson) with
/// the order that the three show; where they show none, the finest itself. The first velocity is half a step old, as the
/// step reads it (optim/METHOD.md, 1). Where nothing pushes and nothing is damped, energy is conserved, and momentum beyond
/// gravity's where no tree is fixed: their drift over a motion of the same length is measured as well.
#include <string.h>

#include "measure.h"
#include "random.h"

static const cav_sheet_column columns[] = {
    {"motion", "free: without contacts, limits and friction losses; contacts: as the scene is"},
    {"order", "where the step takes bias forces: euler, midpoint or momentum"},
    {"step_s", "time step, s"},
    {"time_ms", "time of the motion, ms, median of its runs"},
    {"time_low_ms", "the same, lower quartile"},
    {"time_high_ms", "the same, upper quartile"},
    {"error", "largest error of a coordinate at the end of the motion, m or rad"},
    {"observed_order", "power of the step with which the error has fallen from the step before"},
    {"energy_drift", "free: largest change of energy without forces and dampers, over the largest kinetic energy"},
    {"linear_drift", "free: largest change of linear momentum beyond gravity's, over mass, m/s"},
    {"angular_drift", "free: largest change of angular momentum about the centre of mass, over mass, m^2/s"},
    {"failed", "steps that did not converge"}};

enum { LEVELS = 9, COARSEST = 8, LEAST_LEVELS = 3, PILOT = 8, REPEATS = 5, ORDERS = 3 };
static const char *const order_name[ORDERS] = {"euler", "midpoint", "momentum"};
static const double motion_seconds = 0.32;

// a motion to be run
typedef struct motion {
  int contacts;
  const double *q, *v; // at its start
  double push;         // accelerations of the forces
  cav_options options;
} motion;

static void forces_at(const cav_measure *m, const motion *a, double t, double *u) {
  for (int d = 0; d < m->model->nv; d++) {
    int root = m->model->joint[m->model->dof[d].joint].type == CAV_JOINT_FREE;
    u[d] = root ? 0 : cav_measure_push(m->model, d, a->push * sin(10 * t + d));
  }
}

// velocity half a step before the start, by the acceleration there without constraints
static cav_status begin_earlier(cav_measure *m, const motion *a, double h, double *before) {
  double *u = m->vector[0], *next = m->vector[1];
  const double tiny = 1e-7;
  cav_options options = a->options;
  options.constraint = 0;
  options.order = CAV_ORDER_EULER;
  options.timestep = tiny;
  cav_measure_set(m, &options);
  forces_at(m, a, 0, u);
  cav_status status = cav_forward(m->model, m->state, a->q, a->v, u, next);
  if (status == CAV_NOT_CONVERGED) status = CAV_OK;
  for (int d = 0; d < m->model->nv && !status; d++) before[d] = a->v[d] - 0.5 * h * (next[d] - a->v[d]) / tiny;
  return status;
}

// kinetic and whole energy, and momenta over mass, at q with v
typedef struct account {
  double kinetic, energy, linear[3], angular[3];
} account;

static cav_status take(cav_measure *m, const double *q, const double *v, account *a) {
  const cav_model *model = m->model;
  double com[3], *M = m->matrix[0];
  cav_status status = cav_inertia(model, m->other, q, M);
  if (!status) status = cav_position(model, m->other, q);
  if (status) return status;
  *a = (account){0};
  for (int i = 0; i < model->nv; i++)
    for (int j = 0; j < model->nv; j++) a->kinetic += 0.5 * v[i] * M[i * model->nv + j] * v[j];
  cav_momentum(model, m->other, v, com, a->linear, a->angular);
  for (int k = 0; k < 3; k++) a->angular[k] /= model->mass;
  a->energy = a->kinetic;
  for (int i = 1; i < model->nlink; i++)
    for (int k = 0; k < 3; k++) a->energy -= model->link[i].mass * model->gravity[k] * m->other->com[3 * i + k];
  return CAV_OK;
}

typedef struct run_result {
  double *q; // [nq] at the end
  double seconds;
  int failed;
  double energy, kinetic, linear, angular; // drift
} run_result;

static double apart(const double a[3], const double b[3]) {
  return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

// what has become of energy at a knot and of momentum half a step later
static cav_status watch(cav_measure *m, int t, double h, const double *q, const double *v, const double *next,
                        account first[2], run_result *out) {
  const cav_model *model = m->model;
  double *mean = m->vector[6], *middle = m->vector[7], fallen[3];
  account here, half;
  for (int d = 0; d < model->nv; d++) mean[d] = 0.5 * (v[d] + next[d]);
  cav_integrate(model, q, next, 0.5 * h, middle);
  cav_status status = take(m, q, mean, &here);
  if (!status) status = take(m, middle, next, &half);
  if (status) return status;
  if (t == 0) first[0] = here, first[1] = half;
  for (int k = 0; k < 3; k++) fallen[k] = first[1].linear[k] + model->gravity[k] * t * h;
  out->kinetic = fmax(out->kinetic, here.kinetic);
  out->energy = fmax(out->energy, fabs(here.energy - first[0].energy));
  out->linear = fmax(out->linear, apart(half.linear, fallen));
  out->angular = fmax(out->angular, apart(half.angular, first[1].angular));
  return CAV_OK;
}

static cav_status run(cav_measure *m, const motion *a, cav_order order, int n, int watched, run_result *out) {
  const cav_model *model = m->model;
  double h = motion_seconds / n, *u = m->vector[2], *v = m->vector[3], *next = m->vector[4], *q = out->q;
  account first[2] = {0};
  cav_status status = begin_earlier(m, a, h, v);
  out->seconds = out->energy = out->kinetic = out->linear = out->angular = 0;
  out->failed = 0;
  cav_options options = cav_options_at_step(&a->options, h);
  options.order = order;
  cav_measure_set(m, &options);
  memcpy(q, a->q, (size_t)model->nq * sizeof *q);
  const double begin = cav_measure_processor();
  for (int t = 0; t < n && !status; t++) {
    forces_at(m, a, t * h, u);
    status = cav_forward_newton(model, m->state, q, v, u, 100, 1e-12, next, NULL);
    out->failed += status == CAV_NOT_CONVERGED;
    if (status == CAV_NOT_CONVERGED) status = CAV_OK;
    if (!status && watched) status = watch(m, t, h, q, v, next, first, out);
    memcpy(v, next, (size_t)model->nv * sizeof *v);
    if (!status) cav_integrate(model, q, v, h, q);
  }
  out->seconds = cav_measure_processor() - begin;
  return status;
}

static double distance(const cav_measure *m, const double *a, const double *b) {
  double *d = m->vector[5], most = 0;
  cav_difference(m->model, a, b, 1, d);
  for (int i = 0; i < m->model->nv; i++) most = isfinite(d[i]) ? fmax(most, fabs(d[i])) : NAN;
  return most;
}

// a (+) s (b (-) a)
static void towards(const cav_measure *m, const double *a, const double *b, double s, double *out) {
  double *d = m->vector[5];
  cav_difference(m->model, a, b, 1, d);
  cav_integrate(m->model, a, d, s, out);
}

// reference [nq] from midpoint at n, 2n and 4n steps
static cav_status refer(cav_measure *m, const motion *a, int n, double *reference, cav_measure_motion *told) {
  double **w = m->vector + 8;
  for (int k = 0; k < 3; k++) {
    run_result r = {.q = w[k]};
    cav_status status = run(m, a, CAV_ORDER_MIDPOINT, n << k, 0, &r);
    if (status) return status;
    if (m->tell(m->context, "time steps: the reference", 0.5 * a->contacts)) return CAV_INTERRUPTED;
  }
  double coarse = distance(m, w[0], w[1]), fine = distance(m, w[1], w[2]);
  told->order = coarse > 0 && fine > 0 ? log2(coarse / fine) : NAN;
  told->steps = 4 * n;
  memcpy(reference, w[2], (size_t)m->model->nq * sizeof *reference);
  told->uncertainty = fine;
  // differences that rounding makes do not fall; those of jumps fall as they like
  if (told->order > 0.8 && told->order < 4.5) {
    double power = pow(2, told->order);
    told->extrapolated = 1;
    towards(m, w[1], w[2], 1 + 1 / (power - 1), reference);
    towards(m, w[0], w[1], 1 + 1 / (power - 1), w[3]);
    told->uncertainty = distance(m, reference, w[3]) / power;
  }
  told->size = distance(m, a->q, reference);
  told->known = isfinite(told->uncertainty) && isfinite(told->size);
  return CAV_OK;
}

// rows of one order: coarse to fine
static cav_status measure_order(cav_measure *m, const motion *a, cav_order order, int levels, const double *reference,
                                cav_measure_step *out, double done) {
  run_result r = {.q = m->vector[12]};
  double before = NAN;
  int repeats = m->quick ? 3 : REPEATS, conserves = !a->contacts && m->model->nequality == 0;
  for (int level = 0; level < levels; level++) {
    if (level >= LEAST_LEVELS && cav_measure_late(m)) break;
    double time[REPEATS], error = NAN;
    int n = COARSEST << level, failed = 0, repeat = 0;
    cav_status status = CAV_OK;
    for (; repeat < repeats && !status && (repeat == 0 || !cav_measure_late(m)); repeat++) {
      status = run(m, a, order, n, 0, &r);
      time[repeat] = 1e3 * r.seconds;
      failed = r.failed;
      if (repeat == 0 && !status) error = distance(m, reference, r.q);
    }
    if (status == CAV_NO_MEMORY) return status;
    double *row = cav_sheet_add(&out->sheet, a->contacts ? "contacts" : "free", order_name[order], NULL);
    if (!row) return CAV_NO_MEMORY;
    row[CAV_STEP_STEP] = motion_seconds / n;
    row[CAV_STEP_ERROR] = status || !out->motion[a->contacts].known ? NAN : error;
    row[CAV_STEP_TIME] = status ? NAN : cav_measure_quantile(time, repeat, 0.5);
    row[CAV_STEP_LOW] = status ? NAN : cav_measure_quantile(time, repeat, 0.25);
    row[CAV_STEP_HIGH] = status ? NAN : cav_measure_quantile(time, repeat, 0.75);
    row[CAV_STEP_FAILED] = status ? NAN : (double)failed;
    // below what is known of the reference, and of rounding, an order says nothing
    if (before > 0 && error > 10 * out->motion[a->contacts].uncertainty) row[CAV_STEP_ORDER] = log2(before / error);
    before = error;
    if (conserves && (level == 0 || !cav_measure_late(m))) {
      motion still = *a;
      still.push = 0;
      still.options.passive = 0;
      status = run(m, &still, order, n, 1, &r);
      row[CAV_STEP_ENERGY] = status ? NAN : r.kinetic > 0 ? r.energy / r.kinetic : r.energy;
      if (out->momentum) row[CAV_STEP_LINEAR] = status ? NAN : r.linear;
      if (out->momentum) row[CAV_STEP_ANGULAR] = status ? NAN : r.angular;
    }
    if (m->tell(m->context, "time steps", done + (double)level / levels / 6)) return CAV_INTERRUPTED;
  }
  return CAV_OK;
}

// levels that fit into the section's time, and in *n the steps of the first of the three references
// 0: not even three of them
static int plan_levels(const cav_measure *m, double step_seconds, int *n) {
  int levels = m->quick ? 7 : LEVELS;
  // 3 orders, repeated, with their drift, and the references: 28 times the finest motion
  for (; levels >= LEAST_LEVELS; levels--) {
    double finest = step_seconds * (COARSEST << (levels - 1));
    if (finest * (28 + 3 * (m->quick ? 3 : REPEATS)) < (levels > LEAST_LEVELS ? 1 : 3) * m->seconds) break;
  }
  *n = 2 * (COARSEST << (levels - 1));
  return levels < LEAST_LEVELS ? 0 : levels;
}

static cav_status measure_motion(cav_measure *m, const motion *a, cav_measure_step *out) {
  run_result r = {.q = m->vector[12]};
  double *reference = m->vector[13];
  int n;
  cav_status status = run(m, a, CAV_ORDER_MIDPOINT, PILOT, 0, &r);
  if (status == CAV_NO_MEMORY) return status;
  int levels = plan_levels(m, status ? 0 : r.seconds / PILOT, &n);
  out->motion[a->contacts].slow = levels == 0;
  if (levels == 0) return CAV_OK;
  status = refer(m, a, n, reference, &out->motion[a->contacts]);
  if (status == CAV_NO_MEMORY || status == CAV_INTERRUPTED) return status;
  for (int order = 0; order < ORDERS; order++) {
    status = measure_order(m, a, (cav_order)order, levels, reference, out, 0.5 * a->contacts + order / 6.0);
    if (status) return status;
  }
  return CAV_OK;
}

// error against time: those that no other order or step beats in both
static void mark(cav_sheet *sheet, const char *which) {
  for (int r = 0; r < sheet->nrow; r++) {
    double x = cav_sheet_get(sheet, r, CAV_STEP_TIME), y = cav_sheet_get(sheet, r, CAV_STEP_ERROR);
    if (strcmp(sheet->row[r].label[0], which)) continue;
    int best = isfinite(x) && isfinite(y);
    for (int k = 0; k < sheet->nrow && best; k++) {
      double a = cav_sheet_get(sheet, k, CAV_STEP_TIME), b = cav_sheet_get(sheet, k, CAV_STEP_ERROR);
      if (!strcmp(sheet->row[k].label[0], which) && a <= x && b <= y && (a < x || b < y)) best = 0;
    }
    sheet->row[r].marked = best;
  }
}

static int all_float(const cav_model *model) {
  for (int i = 1; i < model->nlink; i++)
    if (model->link[i].parent == 0 &&
        (model->link[i].ndof != 6 || model->joint[model->link[i].joint].type != CAV_JOINT_FREE))
      return 0;
  return 1;
}

cav_status cav_measure_steps(cav_measure *m, cav_measure_step *out) {
  *out = (cav_measure_step){.sheet = {.name = "step", .ntext = 2, .nnumber = CAV_STEP_NUMBERS, .column = columns},
                            .seconds = motion_seconds,
                            .momentum = all_float(m->model) && m->options.gravity};
  const cav_model *model = m->model;
  double *v = m->vector[14];
  uint64_t seed = 5;
  for (int d = 0; d < model->nv; d++) v[d] = cav_random_normal(&seed);
  motion free_motion = {.q = m->start, .v = v, .push = 8, .options = m->options};
  // closed chains stay closed
  if (model->nequality == 0)
    free_motion.options.constraint = 0;
  else
    free_motion.options.contact = 0;
  cav_measure_section(m, 1.5, 20);
  cav_status status = measure_motion(m, &free_motion, out);
  if (m->contact_rows > 0 && !status) {
    cav_measure_section(m, 1.5, 20);
    motion contacts = {.contacts = 1, .q = m->contact_q, .v = m->contact_v, .push = 5, .options = m->options};
    status = measure_motion(m, &contacts, out);
  }
  mark(&out->sheet, "free");
  mark(&out->sheet, "contacts");
  return status;
}
