/// Inverse kinematics of a clip: which markers there are, places, then frame after frame; and what it came to.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "fit.h"
#include "math3.h"

cav_ik_options cav_ik_options_default(void) {
  return (cav_ik_options){.posture = 1e-5, .roughness = 1e-3, .floor = 10, .iterations = 100};
}

void cav_ik_report_free(cav_ik_report *report) {
  if (!report) return;
  free(report->marker), free(report->rms), free(report->worst), free(report->seen), free(report->frame_rms);
  free(report);
}

// the markers that clip and set share
static cav_status match(cav_fit *fit, const cav_record *record, cav_error *error) {
  fit->marker = malloc((size_t)fit->set->nmarker * sizeof *fit->marker + 1);
  fit->column = malloc((size_t)fit->set->nmarker * sizeof *fit->column + 1);
  if (!fit->marker || !fit->column) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for a fit");
  for (int i = 0; i < fit->set->nmarker; i++)
    for (int k = 0; k < record->nmarker; k++)
      if (!strcmp(fit->set->marker[i].name, record->name[k])) fit->marker[fit->n] = i, fit->column[fit->n++] = k;
  if (fit->n) return CAV_OK;
  return cav_file_fail(
      error, CAV_BAD_INPUT, 0,
      "the clip and the marker set share no marker: '%s' and others are recorded, '%s' and others placed",
      record->name[0], fit->set->nmarker ? fit->set->marker[0].name : "");
}

// frames at equal steps: the clip's own, or between them
static cav_status equal_steps(cav_fit *fit, const cav_record *r, double **made, cav_error *error) {
  static const double even = 1e-3; // of a step
  fit->nframe = r->nframe, fit->nmarker = r->nmarker, fit->position = r->position;
  if (r->nframe < 2) return cav_file_fail(error, CAV_BAD_INPUT, 0, "expected two frames or more, got %d", r->nframe);
  fit->step = (r->time[r->nframe - 1] - r->time[0]) / (r->nframe - 1);
  double uneven = 0;
  for (int t = 0; t < r->nframe; t++) uneven = fmax(uneven, fabs(r->time[t] - r->time[0] - t * fit->step));
  if (uneven <= even * fit->step) return CAV_OK;
  size_t n = 3 * (size_t)r->nmarker;
  double *to = *made = malloc((size_t)r->nframe * n * sizeof *to);
  if (!to) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the clip at equal steps");
  for (int t = 0, k = 0; t < r->nframe; t++) {
    double time = r->time[0] + t * fit->step;
    while (k < r->nframe - 2 && r->time[k + 1] < time) k++;
    double s = fmin(fmax((time - r->time[k]) / (r->time[k + 1] - r->time[k]), 0), 1);
    const double *a = r->position + (size_t)k * n, *b = a + n;
    for (size_t i = 0; i < n; i++) to[(size_t)t * n + i] = s <= 0 ? a[i] : s >= 1 ? b[i] : a[i] + s * (b[i] - a[i]);
  }
  fit->position = to;
  return CAV_OK;
}

// the first frame that shows the most, up to three, markers; -1: none shows any
static int first_frame(const cav_fit *fit) {
  int best = -1, most = 0;
  for (int t = 0; t < fit->nframe && most < 3; t++) {
    int seen = 0;
    for (int i = 0; i < fit->n; i++) seen += cav_fit_seen(fit, t, i) != NULL;
    if (seen > most) best = t, most = seen;
  }
  return best;
}

static cav_ik_report *report_new(const cav_fit *fit) {
  cav_ik_report *r = calloc(1, sizeof *r);
  if (!r) return NULL;
  r->nframe = fit->nframe, r->nmarker = fit->n, r->missing = fit->nmarker - fit->n;
  r->marker = calloc((size_t)fit->n, sizeof *r->marker);
  r->rms = calloc((size_t)fit->n, sizeof *r->rms), r->worst = calloc((size_t)fit->n, sizeof *r->worst);
  r->seen = calloc((size_t)fit->n, sizeof *r->seen), r->frame_rms = calloc((size_t)fit->nframe, sizeof *r->frame_rms);
  if (r->marker && r->rms && r->worst && r->seen && r->frame_rms) {
    memcpy(r->marker, fit->marker, (size_t)fit->n * sizeof *r->marker);
    return r;
  }
  cav_ik_report_free(r);
  return NULL;
}

// distances of markers at the state's position; sums of squares until conclude
static void note(const cav_fit *fit, int frame, cav_ik_report *r) {
  int seen = 0;
  double sum = 0;
  for (int i = 0; i < fit->n; i++) {
    const double *at = cav_fit_seen(fit, frame, i);
    double x[3], square;
    if (!at) continue;
    cav_fit_place(fit, i, x);
    sub3(x, x, at);
    square = dot3(x, x);
    r->rms[i] += square, r->worst[i] = fmax(r->worst[i], sqrt(square)), r->seen[i]++;
    sum += square, seen++;
  }
  r->frame_rms[frame] = seen ? sqrt(sum / seen) : NAN;
}

static void conclude(cav_ik_report *r) {
  long seen = 0;
  for (int i = 0; i < r->nmarker; i++) {
    r->total_rms += r->rms[i], seen += r->seen[i];
    r->rms[i] = r->seen[i] ? sqrt(r->rms[i] / r->seen[i]) : NAN;
  }
  r->total_rms = sqrt(r->total_rms / (double)(seen ? seen : 1));
}

// all frames, each from the one before
static cav_status follow(cav_fit *fit, const double *q, cav_trajectory *trajectory, cav_ik_report *report) {
  size_t nq = (size_t)fit->model->nq;
  memcpy(trajectory->q, q, nq * sizeof *q);
  cav_status status = cav_fit_follow(fit, 0, fit->nframe - 1, trajectory->q, &report->iterations);
  if (!status && fit->planted) status = cav_fit_choose_paths(fit, trajectory->q, &report->iterations);
  if (!status && fit->planted) status = cav_fit_smooth(fit, trajectory->q, &report->iterations);
  for (int t = 0; t < fit->nframe && !status; t++) {
    status = cav_position(fit->model, fit->state, trajectory->q + (size_t)t * nq);
    if (!status) note(fit, t, report);
  }
  if (status) return status;
  cav_trajectory_velocities(fit->model, trajectory);
  memcpy(trajectory->v, trajectory->v + fit->model->nv, (size_t)fit->model->nv * sizeof *trajectory->v);
  conclude(report);
  return CAV_OK;
}

static cav_status run(cav_fit *fit, cav_marker_set *set, cav_trajectory **trajectory, cav_ik_report *report,
                      cav_error *error) {
  int first = first_frame(fit);
  if (first < 0) return cav_file_fail(error, CAV_BAD_INPUT, 0, "no frame shows a marker of the set");
  double *q = malloc((size_t)fit->model->nq * sizeof *q);
  *trajectory = cav_trajectory_new(fit->model, fit->nframe, fit->step);
  cav_status status = q && *trajectory ? CAV_OK : CAV_NO_MEMORY;
  if (!status) status = cav_fit_begin(fit, first, 0.99, q, &report->iterations);
  if (!status) status = cav_fit_places(fit, set, NULL, q, &report->iterations);
  if (!status) status = follow(fit, q, *trajectory, report);
  free(q);
  if (status) cav_file_fail(error, status, 0, "the fit of the clip: %s", cav_status_name(status));
  return status;
}

// what every fit begins with; made, which is freed after it, holds frames at equal steps
static cav_status open_fit(cav_fit *fit, const cav_record *record, double **made, cav_error *error) {
  const cav_ik_options *o = fit->options;
  const cav_model *m = fit->model;
  size_t nv = (size_t)m->nv;
  if (!(o->posture >= 0 && o->roughness >= 0 && o->floor >= 0 && o->iterations > 0))
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "expected weights of at least 0 and one iteration or more");
  cav_status status = match(fit, record, error);
  if (!status) status = equal_steps(fit, record, made, error);
  if (status) return status;
  fit->state = cav_state_new(m);
  fit->H = malloc((nv * nv + 2 * nv + (size_t)m->nq) * sizeof *fit->H);
  if (!fit->state || !fit->H) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for a fit");
  fit->g = fit->H + nv * nv, fit->move = fit->g + nv, fit->try = fit->move + nv;
  fit->state->options.contact = 0;
  return CAV_OK;
}

static void close_fit(cav_fit *fit, double *made) {
  cav_state_free(fit->state);
  free(fit->H), free(made), free(fit->marker), free(fit->column), free(fit->stands), free(fit->planted),
      free(fit->point), free(fit->apart), free(fit->clear);
}

cav_status cav_ik(const cav_model *model, const cav_record *record, cav_marker_set *set, const cav_ik_options *options,
                  cav_trajectory **trajectory, cav_ik_report **report, cav_error *error) {
  cav_fit fit = {.model = model, .options = options, .set = set, .firm = 1};
  double *made = NULL, *scaled = NULL;
  cav_ik_options rough = *options;
  cav_ik_report *told = NULL;
  *trajectory = NULL;
  if (report) *report = NULL;
  cav_status status = open_fit(&fit, record, &made, error);
  if (!status && !(told = report_new(&fit))) status = cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for a fit");
  if (!status && set->retarget) {
    // centimetres off a posture of another body are worth less than limbs that turn about themselves for them
    rough.posture *= 100, rough.roughness *= 10;
    fit.options = &rough;
    status = cav_fit_retarget(&fit, &scaled, &told->scale, error);
    if (!status) fit.position = scaled;
  }
  if (!status && set->floor) status = cav_fit_floor(&fit);
  if (!status) status = run(&fit, set, trajectory, told, error);
  // as many frames, in the time that falls take over such ways
  if (!status && set->similar && told->scale > 0) {
    told->pace = sqrt(told->scale);
    (*trajectory)->timestep *= told->pace;
    for (int k = 0; k < (*trajectory)->nknot * model->nv; k++) (*trajectory)->v[k] /= told->pace;
  }
  if (status) {
    cav_trajectory_free(*trajectory);
    *trajectory = NULL;
  }
  if (report && !status)
    *report = told;
  else
    cav_ik_report_free(told);
  close_fit(&fit, made);
  free(scaled);
  return status;
}

cav_status cav_ik_sizes(cav_model *model, const cav_record *record, cav_marker_set *set, const cav_ik_options *options,
                        double *factor, double *deviation, cav_error *error) {
  cav_fit fit = {.model = model, .options = options, .set = set, .firm = 1};
  cav_fit_sizes sizes = {0};
  double *made = NULL, *q = malloc((size_t)model->nq * sizeof *q);
  int iterations = 0, first = -1;
  cav_error own = {0}, *why = error ? error : &own;
  *why = (cav_error){0};
  cav_status status = q ? CAV_OK : CAV_NO_MEMORY;
  if (!status && !(set->scale > 0))
    status = cav_file_fail(why, CAV_BAD_INPUT, 0, "expected scale > 0 of the marker set, got %g", set->scale);
  if (!status) status = open_fit(&fit, record, &made, why);
  if (!status && (first = first_frame(&fit)) < 0)
    status = cav_file_fail(why, CAV_BAD_INPUT, 0, "no frame shows a marker of the set");
  if (!status) status = cav_fit_sizes_new(&sizes, model, set->symmetric, why);
  if (!status && set->floor) status = cav_fit_floor(&fit);
  if (!status) status = cav_fit_begin(&fit, first, 0.99, q, &iterations);
  if (!status) status = cav_fit_places(&fit, set, &sizes, q, &iterations);
  if (!status) status = cav_fit_sizes_stand(&sizes, fit.state);
  if (!status) {
    memcpy(factor, sizes.factor, (size_t)model->nlink * sizeof *factor);
    if (deviation) memcpy(deviation, sizes.error, (size_t)model->nlink * sizeof *deviation);
  }
  if (status && !*why->text) cav_file_fail(why, status, 0, "the fit of sizes: %s", cav_status_name(status));
  cav_fit_sizes_free(&sizes);
  close_fit(&fit, made);
  free(q);
  return status;
}
