/// A motion that was found from markers alone beside what force plates measured of it. Both filtered alike, 6 Hz, fourth
/// order, no lag, as plate files are; forces by weight. Beside it what kinematics alone give: m (a + g) of the fit's centre of
/// mass, filtered so, divided between the feet by the plates' own event times.
///
/// compare MODEL MARKERS CLIP FIT.csv RESULT PLATES OFFSET: OFFSET is the time of the clip at which the result begins.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/cavort.h"

enum { SIDES = 2, AXES = 3 };
static const double step = 0.002, cutoff = 6;     // s; Hz
static const double present = 0.05, loaded = 0.2; // of weight: a foot stands; its centre of pressure is compared
static const double margin = 0.1;                 // s at the ends of a motion, which a filter spoils
static const char *const side_name[SIDES] = {"right", "left"};

/// Forces of both feet on the grid of a motion.
typedef struct forces {
  double *f[SIDES][AXES]; // N: forward, left, up
  double *cop[SIDES];     // m forward
} forces;

typedef struct scene {
  cav_model *model;
  int n;         // samples
  double offset; // s
  double weight; // N
  forces ours, plates, naive;
} scene;

static void *need(void *pointer, const char *what) {
  if (pointer) return pointer;
  fprintf(stderr, "walk: %s\n", what);
  exit(2);
}

static double *line(int n) { return need(calloc((size_t)n, sizeof(double)), "no memory"); }

static void reserve(forces *f, int n) {
  for (int s = 0; s < SIDES; s++) {
    for (int k = 0; k < AXES; k++) f->f[s][k] = line(n);
    f->cop[s] = line(n);
  }
}

// one pass of a Butterworth filter of second order, begun at rest at the first value
static void pass(double *x, int n, int back) {
  double corner = cutoff / pow(sqrt(2) - 1, 0.25), K = tan(M_PI * corner * step), a0 = 1 + sqrt(2) * K + K * K;
  double b = K * K / a0, a1 = 2 * (K * K - 1) / a0, a2 = (1 - sqrt(2) * K + K * K) / a0;
  double u1 = x[back ? n - 1 : 0], u2 = u1, y1 = u1, y2 = u1;
  for (int i = 0; i < n; i++) {
    double *at = x + (back ? n - 1 - i : i), u = *at, y = b * (u + 2 * u1 + u2) - a1 * y1 - a2 * y2;
    u2 = u1, u1 = u, y2 = y1, y1 = y, *at = y;
  }
}

static void release(forces *f) {
  for (int s = 0; s < SIDES; s++) {
    for (int k = 0; k < AXES; k++) free(f->f[s][k]);
    free(f->cop[s]);
  }
}

static void smooth(double *x, int n) {
  pass(x, n, 0);
  pass(x, n, 1);
}

/// A table of numbers with times in its first column.
typedef struct table {
  int nrow, ncol;
  double *x;
} table;

// rows of numbers by blanks or commas; lines that begin otherwise are skipped
static table read_table(const char *path, int ncol) {
  FILE *file = need(fopen(path, "r"), path);
  char text[4096];
  table t = {.ncol = ncol};
  while (fgets(text, sizeof text, file)) {
    double row[64];
    char *at = text, *end;
    int k = 0;
    for (; k < ncol; k++, at = end + strspn(end, ", \t")) {
      row[k] = strtod(at, &end);
      if (end == at) break;
    }
    if (k < ncol) continue;
    t.x = need(realloc(t.x, (size_t)(t.nrow + 1) * (size_t)ncol * sizeof *t.x), "no memory");
    memcpy(t.x + (size_t)t.nrow++ * (size_t)ncol, row, (size_t)ncol * sizeof *row);
  }
  fclose(file);
  return t;
}

static double at_time(const table *t, int column, double time) {
  int low = 0, high = t->nrow - 1;
  while (high - low > 1) *(t->x[((low + high) / 2) * t->ncol] <= time ? &low : &high) = (low + high) / 2;
  const double *a = t->x + (size_t)low * (size_t)t->ncol, *b = t->x + (size_t)high * (size_t)t->ncol;
  double s = fmin(fmax((time - a[0]) / (b[0] - a[0]), 0), 1);
  return a[column] + s * (b[column] - a[column]);
}

// force plates of OpenSim's files: y up, x forward, hence ours x, -z, y; nine columns a foot, the right one first. Filtered
// here, with what is before and after
static void read_plates(scene *s, const char *path) {
  static const int column[AXES] = {0, 2, 1}, sign[AXES] = {1, -1, 1};
  table t = read_table(path, 19);
  int pad = (int)lround(0.5 / step), n = s->n + 2 * pad;
  double *x = line(n);
  for (int side = 0; side < SIDES; side++) {
    for (int k = 0; k < AXES; k++) {
      for (int i = 0; i < n; i++) x[i] = sign[k] * at_time(&t, 1 + 9 * side + column[k], s->offset + (i - pad) * step);
      smooth(x, n);
      memcpy(s->plates.f[side][k], x + pad, (size_t)s->n * sizeof *x);
    }
    for (int i = 0; i < s->n; i++) s->plates.cop[side][i] = at_time(&t, 4 + 9 * side, s->offset + i * step);
  }
  free(x), free(t.x);
}

// columns knot, time, geom1, geom2, pos[3], force[3], gap; of contacts of the ground with a geom whose name has a side
static void read_contacts(scene *s, const char *path, int nknot, double h) {
  FILE *file = need(fopen(path, "r"), path);
  double *at = line(nknot * SIDES * 4);
  char text[1024], geom[2][200];
  while (fgets(text, sizeof text, file)) {
    int knot;
    double time, p[3], f[3];
    if (sscanf(text, "%d,%lf,%199[^,],%199[^,],%lf,%lf,%lf,%lf,%lf,%lf", &knot, &time, geom[0], geom[1], p, p + 1,
               p + 2, f, f + 1, f + 2) != 10)
      continue;
    int side = strstr(geom[0], "left") || strstr(geom[1], "left");
    double *to = at + 4 * (SIDES * knot + side);
    for (int k = 0; k < 3; k++) to[k] += f[k];
    to[3] += f[2] * p[0];
  }
  fclose(file);
  for (int i = 0; i < s->n; i++) {
    double where = fmin(i * step / h, nknot - 1);
    int k = (int)fmin(where, nknot - 2);
    for (int side = 0; side < SIDES; side++) {
      double sum[4];
      for (int c = 0; c < 4; c++) {
        double a = at[4 * (SIDES * k + side) + c], b = at[4 * (SIDES * (k + 1) + side) + c];
        sum[c] = a + (where - k) * (b - a);
      }
      for (int c = 0; c < 3; c++) s->ours.f[side][c][i] = sum[c];
      s->ours.cop[side][i] = sum[2] > 1 ? sum[3] / sum[2] : 0;
    }
  }
  free(at);
}

// fraction of the load that the left foot has, by the plates: a ramp between events in double support
static void divide(const scene *s, double *left) {
  for (int i = 0; i < s->n; i++) {
    int up[SIDES];
    for (int side = 0; side < SIDES; side++) up[side] = s->plates.f[side][2][i] > present * s->weight;
    left[i] = up[0] && up[1] ? (double)NAN : up[1] ? 1 : 0;
  }
  for (int i = 0, j; i < s->n; i = j) {
    for (j = i + 1; j < s->n && isnan(left[i]) && isnan(left[j]); j++) continue;
    double from = i ? left[i - 1] : 0, to = j < s->n ? left[j] : 1;
    for (int k = i; k < j && isnan(left[i]) + (k > i); k++)
      if (isnan(left[k])) left[k] = from + (to - from) * (1 - cos(M_PI * (k - i + 1.0) / (j - i + 1))) / 2;
  }
}

// the centre of mass of the kinematic fit at its frames, on the grid, filtered, twice differenced
static void kinematics_alone(scene *s, const char *path) {
  cav_error error = {0};
  cav_trajectory *fit = need(cav_trajectory_read(path, s->model, &error), error.text);
  cav_state *state = need(cav_state_new(s->model), "no memory");
  int pad = (int)lround(0.5 / step), n = s->n + 2 * pad;
  double *com[AXES], *left = line(s->n), at[3], v[3], *rest = line(s->model->nv);
  double *knot = line(3 * fit->nknot);
  for (int t = 0; t < fit->nknot; t++) {
    if (cav_position(s->model, state, fit->q + (size_t)t * (size_t)s->model->nq)) exit(2);
    cav_momentum(s->model, state, rest, at, v, NULL);
    memcpy(knot + 3 * t, at, sizeof at);
  }
  for (int k = 0; k < AXES; k++) {
    com[k] = line(n);
    for (int i = 0; i < n; i++) {
      double where = fmin(fmax((s->offset + (i - pad) * step) / fit->timestep, 0), fit->nknot - 1);
      int a = (int)fmin(where, fit->nknot - 2);
      com[k][i] = knot[3 * a + k] + (where - a) * (knot[3 * a + 3 + k] - knot[3 * a + k]);
    }
    smooth(com[k], n);
  }
  divide(s, left);
  for (int i = 0; i < s->n; i++)
    for (int k = 0; k < AXES; k++) {
      const double *c = com[k] + i + pad;
      double mass = s->weight / -s->model->gravity[2],
             f = mass * ((c[1] - 2 * c[0] + c[-1]) / (step * step) - s->model->gravity[k]);
      s->naive.f[0][k][i] = (1 - left[i]) * f;
      s->naive.f[1][k][i] = left[i] * f;
    }
  for (int k = 0; k < AXES; k++) free(com[k]);
  free(left), free(rest), free(knot);
  cav_state_free(state);
  cav_trajectory_free(fit);
}

// samples where a foot is on a plate, away from the ends
static int stands(const scene *s, int side, int i) {
  int away = (int)(margin / step);
  return i >= away && i < s->n - away && s->plates.f[side][2][i] > present * s->weight;
}

// between these times of the clip the plates have all the load; before and after, the left foot is beside them
static int is_whole(const scene *s, int i) {
  double time = s->offset + i * step;
  return time > 0.46 && time < 1.94;
}

// kinematics alone know of no foot beside the plates
static double rms_foot(const scene *s, const forces *f, int side, int axis) {
  double sum = 0;
  int n = 0;
  for (int i = 0; i < s->n; i++)
    if (stands(s, side, i) && (f != &s->naive || is_whole(s, i)))
      sum += pow((f->f[side][axis][i] - s->plates.f[side][axis][i]) / s->weight, 2), n++;
  return n ? 100 * sqrt(sum / n) : NAN;
}

static double rms_total(const scene *s, const forces *f) {
  double sum = 0;
  int n = 0, away = (int)(margin / step);
  for (int i = away; i < s->n - away; i++) {
    double ours = 0, plates = 0;
    for (int side = 0; side < SIDES; side++) ours += f->f[side][2][i], plates += s->plates.f[side][2][i];
    if (!is_whole(s, i)) continue;
    sum += pow((ours - plates) / s->weight, 2), n++;
  }
  return n ? 100 * sqrt(sum / n) : NAN;
}

static double rms_pressure(const scene *s, int side, double *mean) {
  double sum = 0, square = 0;
  int n = 0;
  for (int i = 0; i < s->n; i++) {
    if (!stands(s, side, i) || s->plates.f[side][2][i] < loaded * s->weight ||
        s->ours.f[side][2][i] < loaded * s->weight)
      continue;
    double off = s->ours.cop[side][i] - s->plates.cop[side][i];
    sum += off, square += off * off, n++;
  }
  *mean = n ? 1e3 * sum / n : NAN;
  return n ? 1e3 * sqrt(square / n) : NAN;
}

// ms that ours is later at a crossing, up or down, of the plates; printed one after the other
static void print_events(const scene *s, int side, int down) {
  double least = present * s->weight;
  int away = (int)(margin / step);
  for (int i = away + 1; i < s->n - away; i++) {
    const double *p = s->plates.f[side][2], *o = s->ours.f[side][2];
    if ((p[i - 1] > least) == (p[i] > least) || (p[i] > least) == down) continue;
    double nearest = INFINITY;
    for (int k = 1; k < s->n; k++)
      if ((o[k - 1] > least) != (o[k] > least) && (o[k] > least) != down && abs(k - i) < fabs(nearest)) nearest = k - i;
    printf(" %s %s %+.0f ms", side_name[side], down ? "toe-off" : "strike", 1e3 * step * nearest);
  }
}

// distance of markers of a motion, m rms
static double marker_rms(const scene *s, const cav_marker_set *set, const cav_record *record,
                         const cav_trajectory *motion, double offset, double from, double to) {
  cav_state *state = need(cav_state_new(s->model), "no memory");
  double sum = 0;
  int n = 0;
  for (int f = 0; f < record->nframe; f++) {
    double time = record->time[f];
    int t = (int)lround((time - offset) / motion->timestep);
    if (time < from || time > to || t < 0 || t >= motion->nknot || fabs(time - offset - t * motion->timestep) > 1e-6)
      continue;
    if (cav_position(s->model, state, motion->q + (size_t)t * (size_t)s->model->nq)) exit(2);
    for (int i = 0; i < set->nmarker; i++)
      for (int k = 0; k < record->nmarker; k++) {
        const double *seen = record->position + 3 * ((size_t)f * (size_t)record->nmarker + (size_t)k),
                     *p = set->marker[i].place;
        if (strcmp(set->marker[i].name, record->name[k]) || !isfinite(seen[0])) continue;
        cav_pose pose;
        cav_object_pose(s->model, state, CAV_OBJECT_XBODY, set->marker[i].body, &pose);
        for (int a = 0; a < 3; a++) {
          const double *R = pose.rotation + 3 * a;
          sum += pow(pose.pos[a] + R[0] * p[0] + R[1] * p[1] + R[2] * p[2] - seen[a], 2);
        }
        n++;
      }
  }
  cav_state_free(state);
  return n ? sqrt(sum / n) : NAN;
}

static void print(const scene *s) {
  printf("%-34s %9s %9s\n", "rms, % of weight, 6 Hz", "physics", "naive");
  for (int side = 0; side < SIDES; side++)
    printf("vertical, %-24s %9.2f %9.2f\n", side_name[side], rms_foot(s, &s->ours, side, 2),
           rms_foot(s, &s->naive, side, 2));
  printf("%-34s %9.2f %9.2f\n", "vertical, total", rms_total(s, &s->ours), rms_total(s, &s->naive));
  for (int side = 0; side < SIDES; side++)
    printf("fore-aft, %-24s %9.2f %9.2f\n", side_name[side], rms_foot(s, &s->ours, side, 0),
           rms_foot(s, &s->naive, side, 0));
  for (int side = 0; side < SIDES; side++) {
    double mean, rms = rms_pressure(s, side, &mean);
    printf("centre of pressure, %-5s %17.1f mm rms, mean %+.1f mm\n", side_name[side], rms, mean);
  }
  printf("later than the plates:");
  for (int side = 0; side < SIDES; side++)
    for (int down = 0; down < 2; down++) print_events(s, side, down);
  printf("\n");
}

// for gnuplot: time, then of each side plates, ours, naive vertical, plates, ours fore-aft, plates, ours pressure
static void write_curves(const scene *s, const char *path) {
  FILE *file = need(fopen(path, "w"), path);
  for (int i = 0; i < s->n; i++) {
    fprintf(file, "%.4f", s->offset + i * step);
    for (int side = 0; side < SIDES; side++)
      fprintf(file, " %.5f %.5f %.5f %.5f %.5f %.5f %.5f", s->plates.f[side][2][i] / s->weight,
              s->ours.f[side][2][i] / s->weight, s->naive.f[side][2][i] / s->weight,
              s->plates.f[side][0][i] / s->weight, s->ours.f[side][0][i] / s->weight, s->plates.cop[side][i],
              s->ours.cop[side][i]);
    fputc('\n', file);
  }
  fclose(file);
}

int main(int argc, char **argv) {
  cav_error error = {0};
  char path[1000];
  if (argc < 8) {
    fprintf(stderr, "usage: compare MODEL MARKERS CLIP FIT.csv RESULT PLATES OFFSET [CURVES]\n");
    return 2;
  }
  scene s = {.offset = strtod(argv[7], NULL)};
  s.model = need(cav_model_load(argv[1], &error), error.text);
  s.weight = -s.model->mass * s.model->gravity[2];
  cav_marker_set *set = need(cav_marker_set_read(argv[2], s.model, &error), error.text);
  cav_record *record = need(cav_record_read(argv[3], &set->clip, &error), error.text);
  snprintf(path, sizeof path, "%s/trajectory.csv", argv[5]);
  cav_trajectory *motion = need(cav_trajectory_read(path, s.model, &error), error.text);
  cav_trajectory *fit = need(cav_trajectory_read(argv[4], s.model, &error), error.text);
  double duration = (motion->nknot - 1) * motion->timestep;
  s.n = (int)floor(duration / step) + 1;
  reserve(&s.ours, s.n), reserve(&s.plates, s.n), reserve(&s.naive, s.n);
  read_plates(&s, argv[6]);
  snprintf(path, sizeof path, "%s/forces.csv", argv[5]);
  read_contacts(&s, path, motion->nknot, motion->timestep);
  for (int side = 0; side < SIDES; side++)
    for (int k = 0; k < AXES; k++) smooth(s.ours.f[side][k], s.n);
  kinematics_alone(&s, argv[4]);
  print(&s);
  double own = marker_rms(&s, set, record, fit, 0, s.offset, s.offset + duration);
  double got = marker_rms(&s, set, record, motion, s.offset, s.offset, s.offset + duration);
  printf("markers %.2f mm rms, of the fit alone %.2f: %.2f times\n", 1e3 * got, 1e3 * own, got / own);
  if (argc > 8) write_curves(&s, argv[8]);
  release(&s.ours), release(&s.plates), release(&s.naive);
  cav_trajectory_free(fit), cav_trajectory_free(motion);
  cav_record_free(record);
  cav_marker_set_free(set);
  cav_model_free(s.model);
  return 0;
}
