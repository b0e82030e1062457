/// A clip of one body made into one of another size. Each marker keeps its direction from the mean of those that it is
/// measured from, and lies as far from it as on the model. What is measured from the world, or from itself and others,
/// goes its way scaled as the legs are, over a floor that is as high as feet stand. Markers of feet that stand keep their
/// place, and the way between two such places takes up what that changes.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "fit.h"
#include "math3.h"
#include "role.h"

static const double firm = 1e4;     // times a marker's weight, while its foot stands
static const double touching = 0.1; // s: standing is at least as long, and a break in it that is shorter is none
static const double kept = 2;       // times the speed of what is still: what stands goes on to
static const double lasting = 1, rising = 0.02; // m/s, m above where it stood: what alone bears, still stands
static const double least_way = 1e-6;           // m between markers, below which no direction is told

enum { STANDS = 1, BEARS };

typedef struct scaling {
  cav_fit *fit;
  double scale, ground,
      rise;                  // of ways in the world; heights where feet stand, m: of the clip's markers, of the model's
  int *nfrom, *from, *order; // [n], [n*n], [n] of the fit's markers; what others are measured from comes first
  int *foot;                 // [n] the foot that a marker is on, -1
  double *size;              // [n] distance on the model over the recorded one
  double *low, *sole, *home; // [n] height while standing; on the model; [n*3] place in the model's own configuration
  double *to, *work;         // [nframe*nmarker*3]; [nframe]
} scaling;

// ---------------------------------------------------------------- lists

// index in the fit of the marker whose name is text[0..length); -1: the clip or the set lacks it
static int find_marker(const cav_fit *fit, const char *text, size_t length) {
  for (int i = 0; i < fit->n; i++) {
    const char *name = fit->set->marker[fit->marker[i]].name;
    if (strlen(name) == length && !memcmp(name, text, length)) return i;
  }
  return -1;
}

static cav_status list_from(scaling *s, cav_error *error) {
  const cav_fit *fit = s->fit;
  for (int i = 0; i < fit->n; i++) {
    const cav_marker *marker = &fit->set->marker[fit->marker[i]];
    const char *c = marker->from ? marker->from : "";
    while (*(c += strspn(c, " \t\r\n"))) {
      size_t length = strcspn(c, " \t\r\n");
      int k = find_marker(fit, c, length);
      if (k < 0 || s->nfrom[i] == fit->n)
        return cav_file_fail(
            error, CAV_BAD_INPUT, 0,
            "marker '%.80s' is measured from '%.*s': expected another marker of set and clip, each once", marker->name,
            (int)(length < 80 ? length : 80), c);
      s->from[i * fit->n + s->nfrom[i]++] = k;
      c += length;
    }
  }
  return CAV_OK;
}

static int names_itself(const scaling *s, int i) {
  int self = s->nfrom[i] == 0;
  for (int k = 0; k < s->nfrom[i]; k++) self |= s->from[i * s->fit->n + k] == i;
  return self;
}

static cav_status sort(scaling *s, cav_error *error) {
  const cav_fit *fit = s->fit;
  int n = 0;
  char *done = calloc((size_t)fit->n, 1);
  if (!done) return CAV_NO_MEMORY;
  for (int before = -1; n > before;) {
    before = n;
    for (int i = 0; i < fit->n; i++) {
      int ready = !done[i];
      for (int k = 0; k < s->nfrom[i] && !names_itself(s, i); k++) ready &= done[s->from[i * fit->n + k]];
      if (ready) done[i] = 1, s->order[n++] = i;
    }
  }
  int left = 0;
  while (left < fit->n && done[left]) left++;
  free(done);
  if (n == fit->n) return CAV_OK;
  return cav_file_fail(error, CAV_BAD_INPUT, 0, "marker '%.80s' is measured from markers that are measured from it",
                       fit->set->marker[fit->marker[left]].name);
}

// ---------------------------------------------------------------- sizes

static void mean_of(const scaling *s, int i, const double *place, double out[3]) {
  zero3(out);
  for (int k = 0; k < s->nfrom[i]; k++) axpy3(out, out, 1.0 / s->nfrom[i], place + 3 * s->from[i * s->fit->n + k]);
}

// the same of a frame; NaN where one is not seen
static void mean_seen(const scaling *s, int frame, int i, double out[3]) {
  zero3(out);
  for (int k = 0; k < s->nfrom[i]; k++) {
    const double *seen = cav_fit_seen(s->fit, frame, s->from[i * s->fit->n + k]);
    if (seen)
      axpy3(out, out, 1.0 / s->nfrom[i], seen);
    else
      set3(out, NAN, NAN, NAN);
  }
}

static int ascending(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

// of the n values of work; NaN: there are none
static double median(double *work, int n) {
  if (n == 0) return NAN;
  qsort(work, (size_t)n, sizeof *work, ascending);
  return (work[(n - 1) / 2] + work[n / 2]) / 2;
}

// how far a marker is from what it is measured from, model over clip
static void measure_sizes(scaling *s) {
  const cav_fit *fit = s->fit;
  for (int i = 0; i < fit->n; i++) {
    int n = 0;
    double mean[3], way[3];
    for (int t = 0; t < fit->nframe; t++) {
      const double *seen = cav_fit_seen(fit, t, i);
      mean_seen(s, t, i, mean);
      if (!seen || !isfinite(mean[0])) continue;
      sub3(way, seen, mean);
      s->work[n++] = norm3(way);
    }
    double recorded = median(s->work, n);
    mean_of(s, i, s->home, mean);
    sub3(way, s->home + 3 * i, mean);
    s->size[i] = recorded > least_way ? norm3(way) / recorded : 1;
  }
}

// Mean over the fit's markers on a body of their places on the model (frame below 0) or in the clip; 0: not all are
// there, or none is
static int body_mean(const scaling *s, int body, int frame, double out[3]) {
  const cav_fit *fit = s->fit;
  int n = 0;
  zero3(out);
  for (int i = 0; i < fit->n; i++) {
    if (fit->set->marker[fit->marker[i]].body != body) continue;
    const double *place = frame < 0 ? s->home + 3 * i : cav_fit_seen(fit, frame, i);
    if (!place) return 0;
    add3(out, out, place), n++;
  }
  if (n) scale3(out, 1.0 / n, out);
  return n > 0;
}

// length of a limb from marker to marker, on the model or in a frame; 0: it has none
static double limb_length(const scaling *s, int first, int end, int frame) {
  const cav_model *m = s->fit->model;
  double at[3], last[3], way[3], length = 0;
  int n = 0;
  for (int b = end; b > 0; b = m->body[b].parent) {
    if (body_mean(s, b, frame, at)) {
      sub3(way, at, last);
      if (n++) length += norm3(way);
      copy3(last, at);
    }
    if (b == first) break;
  }
  return length;
}

// by legs, or by arms where there are none
static cav_status measure_scale(scaling *s, cav_error *error) {
  static const cav_role role[] = {CAV_ROLE_RIGHT_FOOT,      CAV_ROLE_LEFT_FOOT,       CAV_ROLE_FRONT_RIGHT_FOOT,
                                  CAV_ROLE_FRONT_LEFT_FOOT, CAV_ROLE_BACK_RIGHT_FOOT, CAV_ROLE_BACK_LEFT_FOOT,
                                  CAV_ROLE_RIGHT_HAND,      CAV_ROLE_LEFT_HAND,       CAV_ROLE_HAND};
  enum { FEET = 6 };
  cav_fit *fit = s->fit;
  cav_roles roles;
  double model = 0, clip = 0;
  cav_status status = cav_roles_find(fit->model, fit->state, &roles);
  for (size_t r = 0; r < sizeof role / sizeof *role && !status; r++) {
    int end = roles.body[role[r]], first = roles.limb[role[r]], n = 0;
    if (end < 0 || first < 0 || (r >= FEET && model > 0)) continue;
    double own = limb_length(s, first, end, -1);
    for (int t = 0; t < fit->nframe; t++) {
      double length = limb_length(s, first, end, t);
      if (length > least_way) s->work[n++] = length;
    }
    if (own > 0 && n) model += own, clip += median(s->work, n);
  }
  if (status) return status;
  if (!(clip > 0))
    return cav_file_fail(error, CAV_BAD_INPUT, 0,
                         "retarget: expected markers at two places of a leg or an arm, by which the clip is scaled");
  s->scale = model / clip;
  return CAV_OK;
}

// ---------------------------------------------------------------- feet

// standing that is too short is none, and so is a break
static void settle(char *planted, int nframe, int stride, int least) {
  for (int value = 1; value >= 0; value--)
    for (int t = 0, start; t < nframe; t++) {
      if (planted[t * stride] == value) continue;
      for (start = t; t < nframe && planted[t * stride] != value;) t++;
      // breaks first: those at the ends are none
      if (t - start >= least || (value == 1 && (start == 0 || t == nframe))) continue;
      for (int k = start; k < t; k++) planted[k * stride] = (char)value;
    }
}

// frames at which a marker stands: still, and before and after that not much faster
static void mark(const cav_fit *fit, int i, double bottom) {
  char *planted = fit->planted + i;
  size_t n = (size_t)fit->n;
  for (int t = 0; t < fit->nframe; t++) planted[(size_t)t * n] = (char)cav_fit_stands(fit, t, i, bottom, 1);
  for (int t = 1; t < fit->nframe; t++)
    planted[(size_t)t * n] |= planted[(size_t)(t - 1) * n] && cav_fit_stands(fit, t, i, bottom, kept);
  for (int t = fit->nframe - 2; t >= 0; t--)
    planted[(size_t)t * n] |= planted[(size_t)(t + 1) * n] && cav_fit_stands(fit, t, i, bottom, kept);
}

// whether any marker stands at a frame
static int bears(const cav_fit *fit, int frame) {
  int any = 0;
  for (int i = 0; i < fit->n; i++) any |= fit->planted[(size_t)frame * (size_t)fit->n + (size_t)i];
  return any;
}

// What stood last (way 1), or next (-1), bears the body while nothing else stands: a foot that turns on its ball, or slides,
// as long as it is hardly higher. height: work [n]
static void bear(const cav_fit *fit, int way, double *height) {
  int n = fit->n, last = fit->nframe - 1;
  for (int i = 0; i < n; i++) height[i] = NAN;
  for (int t = way > 0 ? 1 : last - 1; t >= 0 && t <= last; t += way) {
    char *at = fit->planted + (size_t)t * (size_t)n, *before = at - way * n;
    for (int i = 0; i < n; i++) {
      const double *seen = cav_fit_seen(fit, t - way, i);
      if (before[i] == STANDS && seen) height[i] = seen[2];
      if (!before[i]) height[i] = NAN;
    }
    if (bears(fit, t)) continue;
    for (int i = 0; i < n; i++)
      if (before[i] && cav_fit_speed(fit, t, i) < lasting && cav_fit_seen(fit, t, i)[2] < height[i] + rising)
        at[i] = BEARS;
  }
}

// which markers are of feet, when they stand, how high they then are
static void find_standing(scaling *s) {
  cav_fit *fit = s->fit;
  int n = fit->n, least = (int)ceil(touching / fit->step), standing = 0;
  double point[3];
  for (int i = 0; i < n; i++) {
    int body = fit->set->marker[fit->marker[i]].body;
    s->foot[i] = -1;
    for (int f = 0; f < fit->nfoot; f++)
      if (fit->foot[f] == body && cav_fit_lowest(fit, body, point)) s->foot[i] = f;
    if (s->foot[i] < 0) continue;
    s->sole[i] = s->home[3 * i + 2] - point[2];
    mark(fit, i, cav_fit_bottom(fit, i));
  }
  for (int way = 1; way >= -1; way -= 2) bear(fit, way, s->low);
  for (size_t k = 0; k < (size_t)fit->nframe * (size_t)n; k++) fit->planted[k] = fit->planted[k] != 0;
  for (int i = 0; i < n; i++) {
    int seen = 0;
    if (s->foot[i] < 0) continue;
    settle(fit->planted + i, fit->nframe, n, least);
    s->low[i] = 0;
    for (int t = 0; t < fit->nframe; t++)
      if (fit->planted[(size_t)t * (size_t)n + (size_t)i] && cav_fit_seen(fit, t, i))
        s->low[i] += cav_fit_seen(fit, t, i)[2], seen++;
    s->low[i] = seen ? s->low[i] / seen : cav_fit_bottom(fit, i);
    s->ground += s->low[i], s->rise += s->sole[i], standing++;
  }
  if (standing) s->ground /= standing, s->rise /= standing;
  if (!fit->set->floor) memset(fit->planted, 0, (size_t)fit->nframe * (size_t)n);
}

static double *target(const scaling *s, int frame, int i) {
  return s->to + 3 * ((size_t)frame * (size_t)s->fit->nmarker + (size_t)s->fit->column[i]);
}

// a frame, feet where the scaled clip has them
static void scale_frame(const scaling *s, int t) {
  const cav_fit *fit = s->fit;
  for (int o = 0; o < fit->n; o++) {
    int i = s->order[o];
    const double *seen = cav_fit_seen(fit, t, i);
    double mean[3], base[3], way[3], *out = target(s, t, i);
    if (!seen) {
      set3(out, NAN, NAN, NAN);
      continue;
    }
    mean_seen(s, t, i, mean);
    if (s->nfrom[i] == 0) copy3(mean, seen);
    if (names_itself(s, i)) {
      scale3(base, s->scale, mean);
      base[2] = s->scale * (mean[2] - s->ground) + s->rise;
    } else {
      zero3(base);
      for (int k = 0; k < s->nfrom[i]; k++) axpy3(base, base, 1.0 / s->nfrom[i], target(s, t, s->from[i * fit->n + k]));
    }
    sub3(way, seen, mean);
    axpy3(out, base, s->size[i], way);
    if (s->foot[i] >= 0 && fit->set->floor) out[2] = fmax(s->scale * (seen[2] - s->low[i]) + s->sole[i], s->sole[i]);
  }
}

static int is_planted(const scaling *s, int frame, int i) {
  return s->fit->planted[(size_t)frame * (size_t)s->fit->n + (size_t)i];
}

// Where marker i stands from frame a to b: beside another of its foot that has its place already, as far as on the
// model; or at its mean. raw: the clip as scaled
static void find_place(const scaling *s, const double *raw, int i, int a, int b, double place[3]) {
  const cav_fit *fit = s->fit;
  int other = -1, n = 0;
  for (int k = 0; k < fit->n && other < 0; k++)
    if (k != i && s->foot[k] == s->foot[i] && is_planted(s, a, k) && (k < i || (a > 0 && is_planted(s, a - 1, k))))
      other = k;
  double sum[3] = {0, 0, 0}, way[3] = {0, 0, 0};
  for (int t = a; t < b; t++) {
    const double *frame = raw + 3 * (size_t)t * (size_t)fit->nmarker, *at = frame + 3 * (size_t)fit->column[i],
                 *from = other < 0 ? at : frame + 3 * (size_t)fit->column[other];
    if (!isfinite(at[0]) || !isfinite(from[0])) continue;
    add3(sum, sum, at), n++;
    add3(way, way, at), axpy3(way, way, -1, from);
  }
  if (n) scale3(sum, 1.0 / n, sum);
  way[2] = 0;
  copy3(place, sum);
  if (other >= 0 && norm3(way) > least_way) {
    const double *own = s->home + 3 * i, *its = s->home + 3 * other;
    axpy3(place, target(s, a, other), hypot(own[0] - its[0], own[1] - its[1]) / norm3(way), way);
  }
  place[2] = s->sole[i];
}

// between frames a and b, at which marker i stands (below 0, or nframe: it does not): what its places are off the clip
// is taken up in equal steps
static void join(const scaling *s, const double *raw, int i, int a, int b) {
  const cav_fit *fit = s->fit;
  double off[2][2] = {{0}};
  int end[2] = {a < 0 ? b : a, b == fit->nframe ? a : b};
  for (int side = 0; side < 2; side++) {
    size_t at = 3 * ((size_t)end[side] * (size_t)fit->nmarker + (size_t)fit->column[i]);
    for (int k = 0; k < 2; k++) off[side][k] = isfinite(raw[at]) ? s->to[at + (size_t)k] - raw[at + (size_t)k] : 0;
  }
  for (int t = a + 1; t < b; t++) {
    double part = end[0] == end[1] ? 0 : (double)(t - a) / (b - a);
    for (int k = 0; k < 2; k++) target(s, t, i)[k] += (1 - part) * off[0][k] + part * off[1][k];
  }
}

// one standing of a marker after the other, so that what stands earlier is in its place; then the ways between
static cav_status plant(const scaling *s) {
  const cav_fit *fit = s->fit;
  size_t all = 3 * (size_t)fit->nframe * (size_t)fit->nmarker;
  double *raw = malloc(all * sizeof *raw), place[3];
  if (!raw) return CAV_NO_MEMORY;
  memcpy(raw, s->to, all * sizeof *raw);
  for (int a = 0; a < fit->nframe; a++)
    for (int i = 0; i < fit->n; i++) {
      int b = a;
      if (s->foot[i] < 0 || !is_planted(s, a, i) || (a > 0 && is_planted(s, a - 1, i))) continue;
      while (b < fit->nframe && is_planted(s, b, i)) b++;
      find_place(s, raw, i, a, b, place);
      for (int t = a; t < b; t++) copy3(target(s, t, i), place);
    }
  for (int i = 0; i < fit->n; i++) {
    int last = -1, stands = 0;
    for (int t = 0; t < fit->nframe; t++) stands |= is_planted(s, t, i);
    for (int t = 0; t <= fit->nframe && stands; t++)
      if (t == fit->nframe || is_planted(s, t, i)) join(s, raw, i, last, t), last = t;
  }
  free(raw);
  return CAV_OK;
}

// ---------------------------------------------------------------- all

static cav_status scale_all(scaling *s, cav_error *error) {
  cav_fit *fit = s->fit;
  cav_status status = list_from(s, error);
  if (!status) status = sort(s, error);
  if (!status) status = cav_position(fit->model, fit->state, fit->model->q0);
  for (int i = 0; i < fit->n && !status; i++) cav_fit_place(fit, i, s->home + 3 * i);
  if (!status) status = measure_scale(s, error);
  if (status) return status;
  find_standing(s);
  measure_sizes(s);
  for (int t = 0; t < fit->nframe; t++) scale_frame(s, t);
  return plant(s);
}

cav_status cav_fit_retarget(cav_fit *fit, double **made, double *scale, cav_error *error) {
  size_t n = (size_t)fit->n, frames = (size_t)fit->nframe;
  scaling s = {.fit = fit};
  int *list = calloc(n * n + 3 * n, sizeof *list);
  double *number = calloc(6 * n + frames, sizeof *number);
  s.to = calloc(3 * frames * (size_t)fit->nmarker, sizeof *s.to);
  fit->planted = calloc(frames * n, 1);
  cav_status status = list && number && s.to && fit->planted ? cav_fit_feet(fit) : CAV_NO_MEMORY;
  if (!status) {
    s.nfrom = list, s.order = list + n, s.foot = list + 2 * n, s.from = list + 3 * n;
    s.size = number, s.low = number + n, s.sole = number + 2 * n, s.home = number + 3 * n, s.work = number + 6 * n;
    status = scale_all(&s, error);
  }
  free(list);
  free(number);
  if (status) {
    free(s.to);
    if (status == CAV_BAD_INPUT) return status;
    return cav_file_fail(error, status, 0, "the clip cannot be scaled: %s", cav_status_name(status));
  }
  if (!fit->set->floor) fit->nfoot = 0;
  *made = s.to;
  *scale = s.scale;
  fit->firm = firm;
  return CAV_OK;
}
