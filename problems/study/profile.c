/// What a study found: every run as a table; by motion and method the fraction certified and the middle of time and
/// iterations; and the fraction certified within a time, in seconds and as a multiple of the fastest method's on the
/// same run (the performance profile of Dolan and More, 2002), drawn by gnuplot where it is installed.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "csv.h"
#include "file.h"
#include "result.h"
#include "study.h"

enum { POINTS = 61 };
static const double least_seconds = 0.1, most_ratio = 100;

static int ascending(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static double middle(double *x, int n) {
  if (n == 0) return NAN;
  qsort(x, (size_t)n, sizeof *x, ascending);
  return n % 2 ? x[n / 2] : 0.5 * (x[n / 2 - 1] + x[n / 2]);
}

static int methods_used(int nrun, const cav_study_run *run, int used[CAV_STUDY_METHODS]) {
  int n = 0;
  memset(used, 0, CAV_STUDY_METHODS * sizeof *used);
  for (int i = 0; i < nrun; i++) used[run[i].method] |= run[i].known;
  for (int i = 0; i < CAV_STUDY_METHODS; i++) n += used[i];
  return n;
}

static void write_runs(FILE *out, const char *const *motion, int nrun, const cav_study_run *run) {
  fputs("motion,method,start,strategy,certified,achieved,seconds,iterations,cost,unactuated,end_error\n", out);
  for (int i = 0; i < nrun; i++) {
    const cav_study_run *r = &run[i];
    if (!r->known) continue;
    cav_table_write_text(out, motion[r->motion]);
    fprintf(out, ",%s,%d,%s,%d,%d,%.3f,%d", cav_study_method_names[r->method], r->start, r->strategy, r->certified,
            r->achieved, r->seconds, r->iterations);
    const double value[3] = {r->cost, r->unactuated, r->end_error};
    for (int k = 0; k < 3; k++) fputc(',', out), cav_table_write_number(out, value[k]);
    fputc('\n', out);
  }
}

// one line of the table: a motion, or all of them (motion < 0)
static void write_line(FILE *out, const char *name, int motion, int method, int nrun, const cav_study_run *run,
                       double *seconds, double *iterations) {
  int n = 0, certified = 0, achieved = 0, stated = 0;
  double longest = 0;
  for (int i = 0; i < nrun; i++) {
    const cav_study_run *r = &run[i];
    if (!r->known || (int)r->method != method || (motion >= 0 && r->motion != motion)) continue;
    seconds[n] = r->seconds;
    iterations[n++] = r->iterations;
    certified += r->certified;
    achieved += r->certified && r->achieved;
    stated += r->certified && r->achieved && !strcmp(r->strategy, "stated");
    longest = fmax(longest, r->seconds);
  }
  if (n == 0) return;
  fprintf(out, "%-20s %-10s %3d of %3d  %5.0f %%  %8d  %6d  %8.1f  %8.1f  %10.0f\n", name,
          cav_study_method_names[method], certified, n, 100.0 * certified / n, achieved, stated, middle(seconds, n),
          longest, middle(iterations, n));
}

static void write_table(FILE *out, int nmotion, const char *const *motion, int nrun, const cav_study_run *run,
                        double *work) {
  fprintf(out, "%-20s %-10s %10s  %7s  %8s  %6s  %8s  %8s  %10s\n", "motion", "method", "certified", "fraction",
          "achieved", "stated", "median s", "longest s", "iterations");
  for (int m = 0; m < nmotion; m++)
    for (int k = 0; k < CAV_STUDY_METHODS; k++) write_line(out, motion[m], m, k, nrun, run, work, work + nrun);
  for (int k = 0; k < CAV_STUDY_METHODS; k++) write_line(out, "all", -1, k, nrun, run, work, work + nrun);
}

// fastest certified run of the same motion and start, infinite if there is none
static double fastest(const cav_study_run *of, int nrun, const cav_study_run *run) {
  double best = INFINITY;
  for (int i = 0; i < nrun; i++)
    if (run[i].known && run[i].certified && run[i].motion == of->motion && run[i].start == of->start)
      best = fmin(best, run[i].seconds);
  return best;
}

// fraction of a method's runs that are certified within a time, or within a multiple of the fastest
static double fraction_within(int method, double limit, int relative, int nrun, const cav_study_run *run) {
  int n = 0, within = 0;
  for (int i = 0; i < nrun; i++) {
    const cav_study_run *r = &run[i];
    if (!r->known || (int)r->method != method) continue;
    n++;
    within += r->certified && r->seconds <= limit * (relative ? fastest(r, nrun, run) : 1);
  }
  return n ? (double)within / n : 0;
}

static void write_profile(FILE *out, int nrun, const cav_study_run *run, const int used[CAV_STUDY_METHODS]) {
  fputs("seconds", out);
  for (int relative = 0; relative < 2; relative++) {
    if (relative) fputs(",ratio", out);
    for (int k = 0; k < CAV_STUDY_METHODS; k++)
      if (used[k]) fprintf(out, ",%s_%s", cav_study_method_names[k], relative ? "relative" : "absolute");
  }
  fputc('\n', out);
  double most_seconds = CAV_STUDY_SECONDS;
  for (int i = 0; i < nrun; i++) most_seconds = run[i].known ? fmax(most_seconds, run[i].seconds) : most_seconds;
  for (int i = 0; i < POINTS; i++) {
    double s = (double)i / (POINTS - 1), limit[2];
    limit[0] = least_seconds * pow(most_seconds / least_seconds, s);
    limit[1] = pow(most_ratio, s);
    for (int relative = 0; relative < 2; relative++) {
      fprintf(out, "%s%.6g", relative ? "," : "", limit[relative]);
      for (int k = 0; k < CAV_STUDY_METHODS; k++)
        if (used[k]) fprintf(out, ",%.6g", fraction_within(k, limit[relative], relative, nrun, run));
    }
    fputc('\n', out);
  }
}

static void write_drawing(FILE *out, int nmethod, const int used[CAV_STUDY_METHODS]) {
  static const char *const label[] = {"own", "own, other strategies where needed", "Ipopt, by stages",
                                      "Ipopt, limited memory", "own, then Ipopt"};
  fputs(
      "set terminal svg size 900,400 background 'white'\nset output 'profile.svg'\nset datafile separator ','\n"
      "set multiplot layout 1,2\nset logscale x\nset yrange [0:1.02]\nset key bottom right\nset grid\n"
      "set ylabel 'fraction certified'\n",
      out);
  for (int relative = 0; relative < 2; relative++) {
    int first = relative ? nmethod + 2 : 1, column = first + 1;
    fprintf(out, "set xlabel '%s'\nplot ", relative ? "time over that of the fastest method" : "processor time, s");
    for (int k = 0, n = 0; k < CAV_STUDY_METHODS; k++) {
      if (!used[k]) continue;
      fprintf(out, "%s'profile.csv' using %d:%d skip 1 with steps lw 2 title '%s'", n++ ? ", " : "", first, column++,
              label[k]);
    }
    fputc('\n', out);
  }
}

// gnuplot in the folder; 1 if it drew
static int picture_draw(const char *folder) {
  int status = 1;
  fflush(NULL);
  pid_t child = fork();
  if (child == 0) {
    if (chdir(folder) != 0) _exit(1);
    execlp("gnuplot", "gnuplot", "profile.gp", (char *)NULL);
    _exit(1);
  }
  return child > 0 && waitpid(child, &status, 0) == child && status == 0;
}

cav_status cav_profile_write(const char *folder, int nmotion, const char *const *motion, int nrun,
                             const cav_study_run *run, int *drawn, cav_error *error) {
  static const char *const name[] = {"study.csv", "study.txt", "profile.csv", "profile.gp"};
  int used[CAV_STUDY_METHODS], nmethod = methods_used(nrun, run, used);
  double *work = malloc((2 * (size_t)nrun + 1) * sizeof *work);
  cav_status status = work ? CAV_OK : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the study");
  for (int i = 0; i < 4 && !status; i++) {
    cav_file file;
    char *path = cav_result_path(folder, name[i]);
    status = path ? cav_file_begin(&file, path, error) : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
    if (!status) {
      if (i == 0) write_runs(file.stream, motion, nrun, run);
      if (i == 1) write_table(file.stream, nmotion, motion, nrun, run, work);
      if (i == 2) write_profile(file.stream, nrun, run, used);
      if (i == 3) write_drawing(file.stream, nmethod, used);
      status = cav_file_end(&file, error);
    }
    free(path);
  }
  free(work);
  *drawn = !status && nmethod > 0 && picture_draw(folder);
  return status;
}
