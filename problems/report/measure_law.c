/// The contact law: the scene runs on from where it has come to with contacts by itself, under random forces, by its own
/// law and by the discrete law with softness, time constant and smoothing swept one at a time. Penetration, slip and hover
/// are those of loaded contacts where each step of the second part of the run ends, weighted by force; beside the hover
/// stands what the law foretells for contacts that slide: friction times step times slip.
#include <string.h>

#include "measure.h"
#include "random.h"

static const cav_sheet_column columns[] = {
    {"swept", "what was changed from the scene's law; none: as it is"},
    {"softness", "epsilon of the discrete law"},
    {"time_constant_s", "kappa of the discrete law, s; 0: a gap is closed within a step"},
    {"smoothing_m", "delta, m: distance at which the smoothed law is active; 0: the exact law"},
    {"penetration_max_mm", "deepest penetration, mm"},
    {"penetration_mean_mm", "mean penetration of loaded contacts, weighted by force, mm"},
    {"slip_mm_s", "mean slip, weighted by force, mm/s"},
    {"hover_mm", "mean gap of loaded contacts, weighted by force, mm"},
    {"mu_h_v_mm", "friction times step times slip, weighted by force, mm: the hover that the convex law foretells"},
    {"time_us", "a step, microseconds, median"},
    {"time_low_us", "the same, lower quartile"},
    {"time_high_us", "the same, upper quartile"},
    {"iterations", "of a step, mean"},
    {"failed", "steps that did not converge"}};

enum { STEPS = 250, QUICK_STEPS = 100 };
static const double run_seconds = 0.5, push_joint = 10, push_root = 2;

// what is summed over a run
typedef struct sums {
  double deepest, depth, slip, hover, predicted, load;
} sums;

static void add_contacts(const cav_state *state, sums *s) {
  double h = state->options.timestep;
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    double after = c->dist + h * c->velocity_next[0], load = c->impulse[0];
    s->deepest = fmax(s->deepest, -after);
    if (!(load > 0)) continue;
    double slip = c->dim >= 3 ? hypot(c->velocity_next[1], c->velocity_next[2]) : 0;
    s->load += load;
    s->depth += load * fmax(0, -after);
    s->hover += load * fmax(0, after);
    s->slip += load * slip;
    if (c->dim >= 3) s->predicted += load * c->friction[0] * h * slip;
  }
}

static cav_status run(cav_measure *m, const cav_options *options, int n, double *row, int *contacts) {
  const cav_model *model = m->model;
  double *q = m->vector[0], *v = m->vector[1], *u = m->vector[2], *next = m->vector[3], time[STEPS], iterations = 0;
  uint64_t seed = 11;
  sums s = {0};
  int failed = 0, hold = (int)fmax(1, 0.1 / options->timestep);
  cav_status status = CAV_OK;
  cav_measure_set(m, options);
  memcpy(q, m->contact_q, (size_t)model->nq * sizeof *q);
  memcpy(v, m->contact_v, (size_t)model->nv * sizeof *v);
  for (int t = 0; t < n && !status; t++) {
    if (cav_measure_late(m)) return CAV_INTERRUPTED;
    for (int d = 0; d < model->nv && t % hold == 0; d++) {
      int root = model->joint[model->dof[d].joint].type == CAV_JOINT_FREE;
      u[d] = cav_measure_push(model, d, (root ? push_root : push_joint) * cav_random_normal(&seed));
    }
    cav_forward_report report = {0};
    double begin = cav_measure_processor();
    status = cav_forward_newton(model, m->state, q, v, u, 100, 1e-12, next, &report);
    time[t] = 1e6 * (cav_measure_processor() - begin);
    failed += status == CAV_NOT_CONVERGED;
    iterations += report.iterations;
    if (status == CAV_NOT_CONVERGED) status = CAV_OK;
    // until half way the law settles
    if (!status && t >= n / 2) add_contacts(m->state, &s);
    memcpy(v, next, (size_t)model->nv * sizeof *v);
    if (!status) cav_integrate(model, q, v, options->timestep, q);
  }
  if (status == CAV_NO_MEMORY) return status;
  *contacts |= s.load > 0;
  for (int k = CAV_LAW_DEEPEST; k < CAV_LAW_NUMBERS; k++) row[k] = NAN;
  // one that fails on the way has no figures
  if (status) return CAV_OK;
  double load = s.load > 0 ? s.load : NAN;
  row[CAV_LAW_DEEPEST] = 1e3 * s.deepest;
  row[CAV_LAW_DEPTH] = s.load > 0 ? 1e3 * s.depth / load : CAV_SHEET_NONE;
  row[CAV_LAW_SLIP] = s.load > 0 ? 1e3 * s.slip / load : CAV_SHEET_NONE;
  row[CAV_LAW_HOVER] = s.load > 0 ? 1e3 * s.hover / load : CAV_SHEET_NONE;
  row[CAV_LAW_PREDICTED] = s.load > 0 ? 1e3 * s.predicted / load : CAV_SHEET_NONE;
  row[CAV_LAW_TIME] = cav_measure_quantile(time, n, 0.5);
  row[CAV_LAW_LOW] = cav_measure_quantile(time, n, 0.25);
  row[CAV_LAW_HIGH] = cav_measure_quantile(time, n, 0.75);
  row[CAV_LAW_ITERATIONS] = iterations / n;
  row[CAV_LAW_FAILED] = failed;
  return CAV_OK;
}

static cav_status add(cav_measure *m, cav_measure_law *out, const char *swept, const cav_options *options, int n) {
  double *row = cav_sheet_add(&out->sheet, swept, NULL, NULL);
  if (!row) return CAV_NO_MEMORY;
  if (options->stabilisation == CAV_STABILISATION_DISCRETE) {
    row[CAV_LAW_SOFTNESS] = options->softness;
    row[CAV_LAW_TIME_CONSTANT] = options->time_constant;
  }
  row[CAV_LAW_SMOOTHING] = options->smoothing;
  cav_status status = run(m, options, n, row, &out->contacts);
  if (status != CAV_INTERRUPTED) return status;
  // there was no time to end it
  out->sheet.nrow--;
  return CAV_OK;
}

cav_status cav_measure_laws(cav_measure *m, cav_measure_law *out) {
  static const double softness[] = {1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1, 10};
  static const double constant[] = {0, 1, 2, 5, 10, 20, 50, 100};
  static const double smoothing[] = {0, 1e-5, 1e-4, 5e-4, 1e-3, 5e-3, 1e-2, 5e-2};
  static const int count[] = {10, 8, 8};
  static const char *const name[] = {"softness", "time constant", "smoothing"};
  *out = (cav_measure_law){.sheet = {.name = "law", .ntext = 1, .nnumber = CAV_LAW_NUMBERS, .column = columns},
                           .timestep = m->options.timestep};
  if (m->contact_rows == 0) return CAV_OK;
  int n = (int)fmin(fmax(10, run_seconds / m->options.timestep), m->quick ? QUICK_STEPS : STEPS);
  out->seconds = n * m->options.timestep;
  cav_measure_section(m, 1.5, 30);
  cav_status status = add(m, out, "none", &m->options, n);
  for (int k = 0; k < 3 && !status; k++) {
    for (int i = 0; i < count[k] && !status; i += m->quick ? 3 : 1) {
      cav_options options = m->options;
      options.stabilisation = CAV_STABILISATION_DISCRETE;
      if (k == 0) options.softness = softness[i];
      if (k == 1) options.time_constant = constant[i] * options.timestep;
      if (k == 2) options.smoothing = smoothing[i];
      if (k == 2)
        options.smoothing_self = fmin(smoothing[i], options.smoothing_self > 0 ? options.smoothing_self : 1e-3);
      if (m->tell(m->context, "contact law", (k + (double)i / count[k]) / 3)) status = CAV_INTERRUPTED;
      if (!status && !cav_measure_late(m)) status = add(m, out, name[k], &options, n);
    }
  }
  return status;
}
