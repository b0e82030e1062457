/// Checks for test programs: each counts, a failed one prints where and what, check_result() is main's return value.
/// Nothing here stops the program: a test reports all that is wrong with it.
#ifndef CAVORT_TESTS_CHECK_H
#define CAVORT_TESTS_CHECK_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CHECK_SKIPPED = 77 }; ///< exit status by which meson knows a skipped test

/// A sanitizer owns malloc, and everything takes several times as long.
#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define SANITIZED 1
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SANITIZED 1
#endif

static int check_count, check_failed;

/// Of passes that are alike sanitizers, which look for other faults, see every n-th.
static inline int check_every(int n) {
#ifdef SANITIZED
  return n;
#else
  return n > 0;
#endif
}

// one more check; returns whether it held
static inline int check_note(int holds, const char *file, int line, const char *text) {
  check_count++;
  if (holds) return 1;
  check_failed++;
  fprintf(stderr, "%s:%d: failed: %s\n", file, line, text);
  return 0;
}

// |a - b| <= tol, and both finite
static inline int check_near(double a, double b, double tol, const char *file, int line, const char *text) {
  int holds = isfinite(a) && isfinite(b) && fabs(a - b) <= tol;
  if (check_note(holds, file, line, text)) return 1;
  fprintf(stderr, "    %.17g against %.17g, difference %.3g, bound %.3g\n", a, b, a - b, tol);
  return 0;
}

// largest |a_i - b_i| <= tol over n values, all finite
static inline int check_near_all(const double *a, const double *b, int n, double tol, const char *file, int line,
                                 const char *text) {
  int worst = -1;
  double most = tol;
  for (int i = 0; i < n; i++) {
    double d = fabs(a[i] - b[i]);
    if (!(d <= most)) worst = i, most = d;
    if (isnan(d)) break;
  }
  if (check_note(worst < 0, file, line, text)) return 1;
  fprintf(stderr, "    [%d] %.17g against %.17g, bound %.3g\n", worst, a[worst], b[worst], tol);
  return 0;
}

static inline int check_text(const char *a, const char *b, const char *file, int line, const char *text) {
  if (check_note(a && b && !strcmp(a, b), file, line, text)) return 1;
  fprintf(stderr, "    \"%s\" against \"%s\"\n", a ? a : "(null)", b ? b : "(null)");
  return 0;
}

// prints the count; what main returns. A build without asserts tests less than it seems to
static inline int check_result(void) {
#ifdef NDEBUG
  fprintf(stderr, "asserts are switched off in this build: set it up with -Db_ndebug=false\n");
  check_failed++;
#endif
  printf("%d checks, %d failed\n", check_count, check_failed);
  return check_failed ? EXIT_FAILURE : EXIT_SUCCESS;
}

// folder of the models no one here wrote, or NULL where it is absent
static inline const char *check_shared_models(void) {
  static char folder[4096];
  const char *named = getenv("CAVORT_SHARED_MODELS");
#ifdef CAVORT_SOURCE_ROOT
  if (!named) named = CAVORT_SOURCE_ROOT "/../shared/models";
#endif
  if (!named) return NULL;
  snprintf(folder, sizeof folder, "%.4000s/README.md", named);
  FILE *file = fopen(folder, "r");
  if (!file) return NULL;
  fclose(file);
  snprintf(folder, sizeof folder, "%.4000s", named);
  return folder;
}

/// How many of n random cases a test goes through: sanitizers take ten times as long and look for other things than rare numbers.
#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define CHECK_CASES(n) (((n) + 4) / 5)
#endif
#endif
#if !defined(CHECK_CASES) && defined(__SANITIZE_ADDRESS__)
#define CHECK_CASES(n) (((n) + 4) / 5)
#endif
#ifndef CHECK_CASES
#define CHECK_CASES(n) (n)
#endif

#define CHECK(condition) check_note(!!(condition), __FILE__, __LINE__, #condition)
#define CHECK_NEAR(a, b, tol) check_near(a, b, tol, __FILE__, __LINE__, #a " near " #b)
#define CHECK_NEAR_ALL(a, b, n, tol) check_near_all(a, b, n, tol, __FILE__, __LINE__, #a " near " #b)
#define CHECK_TEXT(a, b) check_text(a, b, __FILE__, __LINE__, #a " is " #b)

#endif
