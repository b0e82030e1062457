/// Fuzzer of problem files: any bytes give a problem or a reason; its first knots are evaluated with derivatives at an
/// end of the schedule, and one step of the trust region is taken; some are solved for an iteration, verified and
/// explained. Rows stay in their patterns. Models and tables lie in a folder of this process (tests/fuzz/models); no
/// other file is opened.
#include "fuzz_file.h"

#include <dirent.h>
#include <fcntl.h>
#include <math.h>
#include <string.h>
#include <sys/stat.h>

#include "cavort/solve.h"
#include "continuation.h"

enum { STEPS = 3, DOFS = 40, PAIRS = 400, TERMS = 200, PATH_ROOM = 600, SOLVED_ONE_IN = 200 };

static char folder[] = "/tmp/cavort-fuzz-XXXXXX";

// ---------------------------------------------------------------- files

FILE *__real_fopen(const char *path, const char *mode);
FILE *__wrap_fopen(const char *path, const char *mode);
FILE *__real_fopen64(const char *path, const char *mode);
FILE *__wrap_fopen64(const char *path, const char *mode);

// whether a path leads into the folder; what the fuzzer itself writes may go anywhere
static int may_open(const char *path, const char *mode) {
  if (mode[0] != 'r') return 1;
  char *real = realpath(path, NULL);
  size_t n = strlen(folder);
  int ours = real && !strncmp(real, folder, n) && real[n] == '/';
  free(real);
  return ours;
}

FILE *__wrap_fopen(const char *path, const char *mode) {
  return may_open(path, mode) ? __real_fopen(path, mode) : NULL;
}
FILE *__wrap_fopen64(const char *path, const char *mode) {
  return may_open(path, mode) ? __real_fopen64(path, mode) : NULL;
}

static void write_file(const char *path, const uint8_t *data, size_t size) {
  int file = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0600);
  fuzz_require(file >= 0 && write(file, data, size) == (ssize_t)size);
  close(file);
}

static void path_of(char path[PATH_ROOM], const char *name) { snprintf(path, PATH_ROOM, "%s/%s", folder, name); }

static void copy_models(void) {
  static uint8_t data[1 << 20];
  char path[PATH_ROOM];
  DIR *models = opendir(CAVORT_SOURCE_ROOT "/tests/fuzz/models");
  fuzz_require(models != NULL);
  for (const struct dirent *entry; (entry = readdir(models));) {
    if (entry->d_name[0] == '.') continue;
    snprintf(path, sizeof path, CAVORT_SOURCE_ROOT "/tests/fuzz/models/%.200s", entry->d_name);
    int file = open(path, O_RDONLY);
    ssize_t size = read(file, data, sizeof data);
    fuzz_require(size >= 0);
    close(file);
    path_of(path, entry->d_name);
    write_file(path, data, (size_t)size);
  }
  closedir(models);
}

static void remove_folder(void) {
  static const char *const names[] = {"motions/fuzz", "motions", ""};
  char path[PATH_ROOM], file[2 * PATH_ROOM];
  for (int i = 0; i < 3; i++) {
    path_of(path, names[i]);
    DIR *open_folder = opendir(path);
    for (const struct dirent *entry; open_folder && (entry = readdir(open_folder));) {
      snprintf(file, sizeof file, "%s/%s", path, entry->d_name);
      unlink(file);
    }
    if (open_folder) closedir(open_folder);
    rmdir(path);
  }
}

int LLVMFuzzerInitialize(int *argc, char ***argv);
int LLVMFuzzerInitialize(int *argc, char ***argv) {
  char path[PATH_ROOM];
  (void)argc, (void)argv;
  fuzz_require(mkdtemp(folder) != NULL);
  path_of(path, "motions");
  fuzz_require(mkdir(path, 0700) == 0);
  path_of(path, "motions/fuzz");
  fuzz_require(mkdir(path, 0700) == 0);
  copy_models();
  atexit(remove_folder);
  return 0;
}

// ---------------------------------------------------------------- what is done with a problem

// the problem's first few steps: what speaks later speaks at the last of them
static cav_problem shortened(const cav_problem *problem) {
  cav_problem p = *problem;
  double steps = fmin(round(p.duration / p.timestep), STEPS), fraction = steps * p.timestep / p.duration;
  p.duration = steps * p.timestep;
  p.duration_least *= fraction;
  p.duration_most *= fraction;
  p.guess_to = fmin(p.guess_to, p.duration);
  p.guess_from = fmin(p.guess_from, p.guess_to);
  p.schedule.stages = p.schedule.stages > 2 ? 2 : p.schedule.stages;
  return p;
}

static int is_small(const cav_problem *p) {
  const cav_model *m = p->model;
  return m->nv <= DOFS && m->npair <= PAIRS && p->nterm <= TERMS && m->nmesh == 0 && m->nhfield == 0;
}

// every nonzero of a constraint row is in the row's pattern
static void check_patterns(const cav_transcription *tr) {
  char pattern[4 * DOFS];
  int width = 3 * tr->nv;
  for (int t = 0; t < tr->nknot; t++) {
    for (int i = 0; i < tr->knot[t].layout.count; i++) {
      const double *row = tr->knot[t].slot_row + (size_t)i * (size_t)width;
      cav_transcription_pattern(tr, t, i, pattern);
      for (int c = 0; c < width; c++) fuzz_require(row[c] == 0 || pattern[c]);
    }
  }
}

// all knots at an end of the schedule, and one step of the trust region from there
static void evaluate(const cav_problem *p, int end) {
  cav_transcription *tr = cav_transcription_new(p, 1, NULL);
  cav_normal *normal = tr ? cav_normal_new(tr) : NULL;
  cav_trajectory *at = tr ? cav_trajectory_new(p->model, tr->nknot, p->timestep) : NULL;
  cav_trajectory *spare = at ? cav_trajectory_copy(at) : NULL;
  if (normal && spare && cav_transcription_keep_rows(tr)) {
    cav_region region = {.iterations = 1};
    cav_guess_fill(p, p->q_goal, at);
    cav_stage_set(p, end, tr);
    if (cav_region_minimise(&region, normal, tr, &at, &spare) == CAV_OK) {
      check_patterns(tr);
      cav_transcription_multipliers(tr);
      cav_transcription_estimate_multipliers(tr, NULL);
    }
  }
  cav_trajectory_free(spare);
  cav_trajectory_free(at);
  cav_normal_free(normal);
  cav_transcription_free(tr);
}

static int stop(void *context, const cav_progress *progress) {
  (void)context, (void)progress;
  return 1;
}

// one iteration, the certificate of what it leaves, and why it is none
static void solve(const cav_problem *p) {
  static cav_verdict verdict;
  static cav_explanation explanation;
  cav_solve_options options = cav_solve_options_default();
  cav_solution *s = NULL;
  cav_error error = {0};
  options.observer = stop;
  cav_impossibility proof;
  int proofs = 0;
  cav_status examined = cav_problem_impossible(p, &proof, 1, &proofs, &error);
  fuzz_require(examined ? error.text[0] : proofs == 0 || (proof.what[0] && proof.cure[0]));
  cav_status status = cav_solve(p, &options, NULL, &s, &error);
  fuzz_require(s || (status != CAV_OK && error.text[0]));
  if (!s) return;
  fuzz_require(s->trajectory != NULL);
  status = cav_verify(p, s->trajectory, &s->contact, s->gain_q, s->gain_v, &verdict, &error);
  if (status == CAV_OK) fuzz_require(verdict.certified == (verdict.reason[0] == 0));
  cav_explain(p, s->trajectory, &s->contact, s->nrow, s->row, &explanation, &error);
  cav_solution_free(s);
}

// a number that depends on every byte (FNV-1a): what is done with an input is the same each time
static uint32_t lot_of(const uint8_t *data, size_t size) {
  uint32_t lot = 2166136261u;
  for (size_t i = 0; i < size; i++) lot = (lot ^ data[i]) * 16777619u;
  return lot ^ lot >> 16;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  char path[PATH_ROOM], walker[PATH_ROOM];
  path_of(path, "motions/fuzz/problem.xml");
  path_of(walker, "walker.xml");
  write_file(path, data, size);
  int named = memmem(data, size, "model=", 6) != NULL;
  cav_error error = {0};
  cav_problem *problem = cav_problem_load(path, named ? NULL : walker, &error);
  fuzz_require(problem != NULL || (error.status != CAV_OK && error.text[0] != 0));
  if (problem && is_small(problem)) {
    cav_problem p = shortened(problem);
    uint32_t lot = lot_of(data, size);
    evaluate(&p, lot & 1);
    if ((lot >> 1) % SOLVED_ONE_IN == 0) solve(&p);
  }
  cav_problem_free(problem);
  return 0;
}
