/// Checkpoints: what a solve was about to do, its trajectory and its multipliers, told between two parts and taken up
/// again. Between parts nothing else is carried on: models of the cost and of its curvature are found anew in each.
///
/// The file has one record a line, commas between its fields: "cavort_checkpoint,3", one line for each scalar, its
/// name first; q and v of every knot, "q,KNOT,..."; the same of the motion to go back to, where there is one; multipliers of
/// every knot; "end". Numbers have 17 digits, which
/// bring every bit back.
#include <assert.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "continuation.h"
#include "file.h"

/// Bytes of a file that are read, at most.
static const double most_bytes = 1e9;

#define PLACE(place, word, text) [CAV_PLACE_##place] = #word,
static const char *const place_words[CAV_PLACE_TYPES] = {CAV_PLACES(PLACE)};
#define ORDER(enumerator, word, text) word,
static const char *const order_words[] = {CAV_ORDERS(ORDER)};
enum { ORDERS = sizeof order_words / sizeof *order_words };

// ---------------------------------------------------------------- in a run

static int count_rows(const cav_transcription *tr) {
  int n = 0;
  for (int t = 0; t < tr->nknot; t++) n += tr->knot[t].layout.count;
  return n;
}

double *cav_run_multipliers(const cav_solve_run *run, int final, int *n) {
  *n = count_rows(run->tr);
  double *multiplier = malloc(((size_t)*n + 1) * sizeof *multiplier);
  for (int t = 0, k = 0; multiplier && t < run->tr->nknot; t++) {
    const cav_knot *knot = &run->tr->knot[t];
    for (int i = 0; i < knot->layout.count; i++)
      multiplier[k++] = final ? knot->slot[i].final_multiplier : knot->slot[i].multiplier;
  }
  return multiplier;
}

static void give_multipliers(cav_transcription *tr, const double *multiplier, const double *final_multiplier) {
  for (int t = 0, k = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++, k++) {
      tr->knot[t].slot[i].multiplier = multiplier[k];
      tr->knot[t].slot[i].final_multiplier = final_multiplier[k];
    }
}

// tells the keeper; CAV_INTERRUPTED if it asks for the end
static cav_status tell(cav_solve_run *run) {
  cav_checkpoint *c = &run->checkpoint;
  if (!run->options->keeper) return CAV_OK;
  c->order = run->problem->order;
  c->stage = run->stage;
  c->stages = run->stages;
  c->begin = run->begin_with;
  c->radius = run->region.radius;
  c->law_step = run->tr->options.timestep;
  c->time_constant = run->tr->options.time_constant;
  c->seconds = cav_clock() - run->start;
  c->optimality = run->measured ? run->optimality : NAN;
  c->trajectory = run->at;
  c->stood = run->stood;
  c->multiplier = cav_run_multipliers(run, 0, &c->nmultiplier);
  c->final_multiplier = cav_run_multipliers(run, 1, &c->nmultiplier);
  cav_status status = c->multiplier && c->final_multiplier ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK && run->options->keeper(run->options->keeper_context, c)) status = CAV_INTERRUPTED;
  free(c->multiplier), free(c->final_multiplier);
  c->multiplier = c->final_multiplier = NULL;
  c->trajectory = c->stood = NULL;
  return status;
}

int cav_run_reaches(cav_solve_run *run, cav_place place, cav_status *status) {
  if (run->nested) return 1;
  // what is behind a checkpoint has been done before
  if (run->resume && place < run->resume->place) return 0;
  run->resume = NULL;
  run->checkpoint.place = place;
  run->checkpoint.iterations = run->solution->iterations;
  cav_status told = tell(run);
  if (told != CAV_OK) *status = told;
  return told == CAV_OK;
}

static cav_status refuse(cav_error *error, const char *text) {
  return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s", text);
}

// whether a number of multipliers is that of the rows
static cav_status check_rows(const cav_solve_run *run, int n, cav_error *error) {
  int rows = count_rows(run->tr);
  if (n == rows) return CAV_OK;
  return cav_file_fail(error, CAV_BAD_INPUT, 0,
                       "%d multipliers are given and the problem has %d constraint rows: they are of another problem",
                       n, rows);
}

cav_status cav_run_resume(cav_solve_run *run, cav_error *error) {
  const cav_checkpoint *c = run->options->resume;
  const cav_solve_options *o = run->options;
  if (!c && o->nmultiplier == 0) return CAV_OK;
  cav_status status = check_rows(run, c ? c->nmultiplier : o->nmultiplier, error);
  if (status != CAV_OK) return status;
  if (!c) {
    for (int i = 0; i < o->nmultiplier; i++)
      if (!isfinite(o->multiplier[i])) return refuse(error, "a multiplier that is given is not finite");
    give_multipliers(run->tr, o->multiplier, o->multiplier);
    return CAV_OK;
  }
  const cav_trajectory *at = c->trajectory;
  if (at->nq != run->at->nq || at->nv != run->at->nv || at->nknot != run->at->nknot)
    return refuse(error, "the checkpoint is of a problem with other knots or another model");
  if (c->order != run->problem->order) return refuse(error, "the checkpoint is of a problem with another order");
  memcpy(run->at->q, at->q, (size_t)at->nknot * (size_t)at->nq * sizeof(double));
  memcpy(run->at->v, at->v, (size_t)at->nknot * (size_t)at->nv * sizeof(double));
  run->at->timestep = at->timestep;
  run->stood = c->stood ? cav_trajectory_copy(c->stood) : NULL;
  if (c->stood && !run->stood) return CAV_NO_MEMORY;
  give_multipliers(run->tr, c->multiplier, c->final_multiplier);
  run->resume = c;
  run->region.radius = c->radius;
  run->solution->iterations = run->begin = c->iterations;
  run->start -= c->seconds;
  run->measured = !isnan(c->optimality);
  run->optimality = c->optimality;
  run->stage = c->stage;
  run->stages = c->stages;
  run->begin_with = c->begin;
  // parts after continuation are under the last stage's law, and ask whether rows hold
  run->tr->options.timestep = c->law_step;
  cav_stage_set(run->problem, 1, run->tr);
  run->tr->options.time_constant = c->time_constant;
  return CAV_OK;
}

// ---------------------------------------------------------------- files

// numbers after a name and a knot; NaN and infinities as C writes them
static void write_row(FILE *out, const char *name, int knot, size_t n, const double *value) {
  fprintf(out, "%s,%d", name, knot);
  for (size_t i = 0; i < n; i++) fprintf(out, ",%.17g", value[i]);
  fputc('\n', out);
}

static void write_motion(FILE *out, const cav_trajectory *at) {
  for (int t = 0; t < at->nknot; t++) {
    write_row(out, "q", t, (size_t)at->nq, at->q + (size_t)t * (size_t)at->nq);
    write_row(out, "v", t, (size_t)at->nv, at->v + (size_t)t * (size_t)at->nv);
  }
}

/// Scalars in the order in which they stand.
#define SCALARS(X) \
  X(stage)         \
  X(stages)        \
  X(fraction)      \
  X(settled) X(retries) X(begin) X(radius) X(law_step) X(time_constant) X(iterations) X(seconds) X(status) X(optimality)

cav_status cav_checkpoint_write(const char *path, const cav_checkpoint *c, cav_error *error) {
  cav_file file;
  const cav_trajectory *at = c->trajectory;
  cav_status status = cav_file_begin(&file, path, error);
  if (status != CAV_OK) return status;
  FILE *out = file.stream;
  assert(!strpbrk(c->key, ",\n"));
  assert(c->place < CAV_PLACE_TYPES && (unsigned)c->order < ORDERS);
  fprintf(out, "cavort_checkpoint,3\nkey,%s\nplace,%s\norder,%s\n", c->key, place_words[c->place],
          order_words[c->order]);
#define WRITE(field) fprintf(out, #field ",%.17g\n", (double)c->field);
  SCALARS(WRITE)
#undef WRITE
  fprintf(out, "nq,%d\nnv,%d\nknots,%d\ntimestep,%.17g\nmultipliers,%d\n", at->nq, at->nv, at->nknot, at->timestep,
          c->nmultiplier);
  write_motion(out, at);
  fprintf(out, "stood,%.17g\n", c->stood ? c->stood->timestep : 0);
  if (c->stood) write_motion(out, c->stood);
  write_row(out, "multiplier", 0, (size_t)c->nmultiplier, c->multiplier);
  write_row(out, "final_multiplier", 0, (size_t)c->nmultiplier, c->final_multiplier);
  fputs("end\n", out);
  return cav_file_end(&file, error);
}

/// A file being read: text that is cut at commas and line ends.
typedef struct reader {
  const char *path;
  char *text, *at;
  int line, ended; ///< ended: the last field was the last of its line
  cav_error *error;
  cav_status status;
} reader;

static void fail(reader *r, const char *expected) {
  if (r->status != CAV_OK) return;
  r->status = cav_file_fail(r->error, CAV_BAD_INPUT, r->line,
                            "%s:%d: expected %s; the file is no checkpoint, or was changed: remove it and solve anew",
                            r->path, r->line, expected);
}

// the next field, ended by 0: the first of a line, or another one
static const char *field(reader *r, int first) {
  if (r->status != CAV_OK) return "";
  if (first) r->line++;
  if (first != r->ended) fail(r, first ? "the end of the line" : "more fields");
  char *from = r->at, *end = from + strcspn(from, ",\n");
  if (!*end) fail(r, "more lines");
  if (r->status != CAV_OK) return "";
  r->ended = *end == '\n';
  r->at = end + 1;
  *end = 0;
  return from;
}

static void name(reader *r, const char *expected) {
  const char *is = field(r, 1);
  if (r->status == CAV_OK && strcmp(is, expected)) fail(r, expected);
}

static double number(reader *r) {
  const char *text = field(r, 0);
  if (r->status != CAV_OK) return 0;
  char *end;
  double value = strtod(text, &end);
  if (end == text || *end) fail(r, "a number");
  return value;
}

static int whole(reader *r, double least, double most) {
  double value = number(r);
  if (r->status == CAV_OK && !(value >= least && value <= most && value == floor(value))) fail(r, "a number in range");
  return r->status == CAV_OK ? (int)value : 0;
}

static int word(reader *r, int n, const char *const *words) {
  const char *is = field(r, 0);
  for (int i = 0; i < n && r->status == CAV_OK; i++)
    if (!strcmp(is, words[i])) return i;
  fail(r, "a word that this version knows");
  return 0;
}

static void row(reader *r, const char *expected, int knot, size_t n, double *value) {
  name(r, expected);
  if (whole(r, knot, knot) != knot) return;
  for (size_t i = 0; i < n && r->status == CAV_OK; i++) {
    value[i] = number(r);
    if (!isfinite(value[i])) fail(r, "a finite number");
  }
}

static void scalars(reader *r, cav_checkpoint *c) {
  name(r, "cavort_checkpoint");
  if (whole(r, 3, 3) != 3) return;
  name(r, "key");
  snprintf(c->key, sizeof c->key, "%s", field(r, 0));
  name(r, "place");
  c->place = (cav_place)word(r, CAV_PLACE_TYPES, place_words);
  name(r, "order");
  c->order = (cav_order)word(r, ORDERS, order_words);
  name(r, "stage"), c->stage = whole(r, 0, INT_MAX);
  name(r, "stages"), c->stages = whole(r, 0, INT_MAX);
  name(r, "fraction"), c->fraction = number(r);
  name(r, "settled"), c->settled = number(r);
  name(r, "retries"), c->retries = whole(r, 0, INT_MAX);
  name(r, "begin"), c->begin = (cav_begin)whole(r, CAV_BEGIN_GIVEN, CAV_BEGIN_KINEMATICS);
  name(r, "radius"), c->radius = number(r);
  name(r, "law_step"), c->law_step = number(r);
  name(r, "time_constant"), c->time_constant = number(r);
  name(r, "iterations"), c->iterations = whole(r, 0, INT_MAX);
  name(r, "seconds"), c->seconds = number(r);
  name(r, "status"), c->status = (cav_status)whole(r, CAV_OK, CAV_INTERNAL);
  name(r, "optimality"), c->optimality = number(r);
  if (!(c->fraction >= 0 && c->fraction <= 1 && c->settled >= 0 && c->settled <= c->fraction && c->radius >= 0 &&
        c->seconds >= 0 && isfinite(c->seconds) && c->law_step > 0 && isfinite(c->law_step) && c->time_constant >= 0 &&
        isfinite(c->time_constant)))
    fail(r, "fractions from 0 to 1, a radius, steps and seconds");
}

// q and v of every knot of a new trajectory; of a plan that leaves out trees there are fewer than the model's
static cav_trajectory *motion(reader *r, const cav_model *model, const int size[3], double timestep) {
  cav_trajectory *at = cav_trajectory_new(model, size[2], timestep);
  if (at) at->nq = size[0], at->nv = size[1];
  if (!at) r->status = cav_file_fail(r->error, CAV_NO_MEMORY, r->line, "%s: no memory", r->path);
  for (int t = 0; at && t < size[2]; t++) {
    row(r, "q", t, (size_t)size[0], at->q + (size_t)t * (size_t)size[0]);
    row(r, "v", t, (size_t)size[1], at->v + (size_t)t * (size_t)size[1]);
  }
  return at;
}

static void arrays(reader *r, const cav_model *model, cav_checkpoint *c) {
  name(r, "nq");
  int nq = whole(r, 0, INT_MAX);
  name(r, "nv");
  int nv = whole(r, 0, INT_MAX);
  name(r, "knots");
  int knots = whole(r, 2, 1e7);
  name(r, "timestep");
  double timestep = number(r);
  name(r, "multipliers");
  c->nmultiplier = whole(r, 0, INT_MAX / 16);
  if (r->status == CAV_OK && !(timestep > 0 && isfinite(timestep))) fail(r, "a timestep");
  if (r->status == CAV_OK && (nq > model->nq || nv > model->nv)) fail(r, "no more coordinates than the model has");
  // no more memory than the file could fill
  size_t numbers = strlen(r->at) / 2;
  if (r->status == CAV_OK && ((size_t)knots * (size_t)(nq + nv) > numbers || 2 * (size_t)c->nmultiplier > numbers))
    fail(r, "all of its numbers");
  if (r->status != CAV_OK) return;
  const int size[3] = {nq, nv, knots};
  c->trajectory = motion(r, model, size, timestep);
  name(r, "stood");
  const double stood = number(r);
  if (r->status == CAV_OK && !(stood >= 0 && isfinite(stood))) fail(r, "a timestep, or 0");
  if (r->status == CAV_OK && stood > 0 && (size_t)knots * (size_t)(nq + nv) > strlen(r->at) / 2)
    fail(r, "all of its numbers");
  if (r->status == CAV_OK && stood > 0) c->stood = motion(r, model, size, stood);
  c->multiplier = malloc(((size_t)c->nmultiplier + 1) * sizeof(double));
  c->final_multiplier = malloc(((size_t)c->nmultiplier + 1) * sizeof(double));
  if (r->status == CAV_OK && (!c->multiplier || !c->final_multiplier))
    r->status = cav_file_fail(r->error, CAV_NO_MEMORY, r->line, "%s: no memory", r->path);
  if (r->status != CAV_OK) return;
  row(r, "multiplier", 0, (size_t)c->nmultiplier, c->multiplier);
  row(r, "final_multiplier", 0, (size_t)c->nmultiplier, c->final_multiplier);
  name(r, "end");
}

// the file's text, which ends with 0; NULL with the reason in error
static char *load(const char *path, cav_error *error) {
  struct stat about;
  FILE *file = stat(path, &about) || !S_ISREG(about.st_mode) ? NULL : fopen(path, "rb");
  if (!file || !((double)about.st_size < most_bytes)) {
    if (file) fclose(file);
    cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: cannot be opened, or is no checkpoint", path);
    return NULL;
  }
  char *text = malloc((size_t)about.st_size + 1);
  size_t n = text ? fread(text, 1, (size_t)about.st_size, file) : 0;
  fclose(file);
  if (!text) cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory", path);
  if (text) text[n] = 0;
  return text;
}

cav_checkpoint *cav_checkpoint_read(const char *path, const cav_model *model, cav_error *error) {
  reader r = {.path = path, .ended = 1, .error = error};
  if (!(r.text = load(path, error))) return NULL;
  cav_checkpoint *c = calloc(1, sizeof *c);
  locale_t plain = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  r.at = r.text;
  if (!c || !plain) r.status = cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory", path);
  if (r.status == CAV_OK) {
    locale_t users = uselocale(plain);
    scalars(&r, c);
    arrays(&r, model, c);
    uselocale(users);
  }
  if (plain) freelocale(plain);
  free(r.text);
  if (r.status == CAV_OK) return c;
  cav_checkpoint_free(c);
  return NULL;
}

void cav_checkpoint_free(cav_checkpoint *c) {
  if (!c) return;
  cav_trajectory_free(c->trajectory);
  cav_trajectory_free(c->stood);
  free(c->multiplier), free(c->final_multiplier);
  free(c);
}
