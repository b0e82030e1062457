/// Functions that are compiled twice, for vectors of four numbers and of two. Both do the same operations in the same order for
/// every entry, as the build forbids contraction, so the processor decides about time alone.
#ifndef CAVORT_VECTORS_H
#define CAVORT_VECTORS_H

/// How many numbers a vector of this processor has: 8, 4 or 2. Results are the same. lanes.c.
int cav_dense_lanes(void);

/// Four numbers, which a processor takes at once or by two.
typedef double cav_four __attribute__((vector_size(32), aligned(8), may_alias));

/// Entries of two such by their numbers, those of the second from 4 on.
#ifdef __clang__
#define CAV_SHUFFLED(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
typedef long long cav_four_order __attribute__((vector_size(sizeof(cav_four))));
#define CAV_SHUFFLED(a, b, ...) __builtin_shuffle(a, b, (cav_four_order){__VA_ARGS__})
#endif

#define CAV_VECTOR_BODY static inline __attribute__((always_inline))

/// Defines static void name PARAMETERS, which calls name##_body ARGUMENTS (a CAV_VECTOR_BODY) for this processor.
#if defined(__x86_64__)
#define CAV_BY_VECTORS(name, PARAMETERS, ARGUMENTS)                                                \
  __attribute__((target("avx2"))) static void name##_by_four PARAMETERS { name##_body ARGUMENTS; } \
  static __attribute__((noinline)) void name##_by_two PARAMETERS { name##_body ARGUMENTS; }        \
  static void name PARAMETERS {                                                                    \
    if (cav_dense_lanes() >= 4)                                                                    \
      name##_by_four ARGUMENTS;                                                                    \
    else                                                                                           \
      name##_by_two ARGUMENTS;                                                                     \
  }
#else
#define CAV_BY_VECTORS(name, PARAMETERS, ARGUMENTS) \
  static void name PARAMETERS { name##_body ARGUMENTS; }
#endif

#endif
