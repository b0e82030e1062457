/// A scene pushed to its edges: one parameter at a time swept over its decades, what holds and what breaks measured at
/// each value, and the range about the scene's own value in which all holds. Same build, scene and options: same
/// numbers, at any number of threads.
#ifndef CAVORT_STRESS_H
#define CAVORT_STRESS_H

#include "cavort/problem.h"
#include "provenance.h"

/// What is swept, X(enumerator, name, unit of values, least, most, text). L is the size of the scene, the distance from
/// its root to its furthest point; h the step; m the inverse of a dof's reference weight.
// clang-format off
#define CAV_STRESSES(X)                                                                                              \
  X(MASS_RATIO, "mass-ratio", "times the file's", 1e-12, 1e12, "mass of every other link, or body, along each tree") \
  X(TIMESTEP, "timestep", "s", 1e-6, 1, "h")                                                                         \
  X(STIFFNESS, "stiffness", "k h^2/m", 1e-6, 1e6, "stiffest spring; one on every joint where the file has none")     \
  X(DAMPING, "damping", "d h/m", 1e-6, 1e9, "strongest damper; one on every joint where the file has none")          \
  X(SOLREF, "solref", "time constant/h", 0.1, 1e4, "softness of all constraints as solref has it, refsafe off")      \
  X(SOFTNESS, "softness", "epsilon", 1e-12, 1e3, "softness of all constraints, discrete stabilisation")              \
  X(TIME_CONSTANT, "kappa", "kappa/h", 1e-3, 1e6, "time constant of all constraints, discrete stabilisation")        \
  X(SMOOTHING, "smoothing", "delta/L", 1e-12, 1, "distance at which the smoothed law acts")                          \
  X(FRICTION, "friction", "mu", 1e-9, 1e6, "sliding friction of all contacts")                                       \
  X(IMPRATIO, "impratio", "R_n/R_t", 1e-6, 1e9, "stiffness of friction against that of normals")                     \
  X(SIZE, "size", "times the file's", 1e-6, 1e6, "all lengths, at the same density")                                 \
  X(SPEED, "speed", "m/s", 1e-310, 1e12, "of all dofs; angles at so much/L")                                         \
  X(FORCE, "force", "weights", 1e-12, 1e12, "applied to all dofs")                                                   \
  X(PENETRATION, "penetration", "of L", 1e-12, 1, "of the deepest contact with the world")                           \
  X(COORDINATES, "coordinates", "L", 1, 1e16, "distance of the whole scene from the origin")                         \
  X(QUATERNIONS, "quaternions", "norm", 1e-160, 1e160, "length of the quaternions that are given")

/// What is measured at each value, X(enumerator, name, most where all is well, least where it is broken, text).
#define CAV_STRESS_MEASURES(X)                                                                                       \
  X(ROUND_TRIP, "round-trip", 1e-10, 1e-3, "forward(inverse(v')) against v', relative to the largest of v, v', g h and what constraints ask for") \
  X(DERIVATIVE, "derivative", 1e-5, 1e-1, "analytic against centred differences along a direction, at the step that tells most")   \
  X(UNSOLVED, "unsolved", 0, 0.1, "fraction of forward steps that missed their tolerance")                           \
  X(ENERGY, "energy", 0.1, 100, "energy that a passive run gains, of its own and m g L")
// clang-format on

#define CAV_STRESS_ENUMERATOR(enumerator, ...) CAV_STRESS_##enumerator,
typedef enum cav_stress_sweep { CAV_STRESSES(CAV_STRESS_ENUMERATOR) CAV_STRESS_SWEEPS } cav_stress_sweep;
typedef enum cav_stress_measure {
  CAV_STRESS_MEASURES(CAV_STRESS_ENUMERATOR) CAV_STRESS_MEASURE_TYPES
} cav_stress_measure;
#undef CAV_STRESS_ENUMERATOR

typedef struct cav_stress_sweep_rule {
  const char *name, *unit;
  double least, most;
  const char *text;
} cav_stress_sweep_rule;
extern const cav_stress_sweep_rule cav_stress_sweep_rules[CAV_STRESS_SWEEPS];

typedef struct cav_stress_measure_rule {
  const char *name;
  double good, bad;
  const char *text;
} cav_stress_measure_rule;
extern const cav_stress_measure_rule cav_stress_measure_rules[CAV_STRESS_MEASURE_TYPES];

typedef enum cav_stress_level {
  CAV_STRESS_SAFE,     ///< all measures are well
  CAV_STRESS_DEGRADED, ///< one is not, none is broken
  CAV_STRESS_BROKEN,
  CAV_STRESS_REFUSED ///< not evaluated, and said so
} cav_stress_level;
extern const char *const cav_stress_level_names[];

enum { CAV_STRESS_WHY = 400 };

/// What holds at one value: the worst of all samples.
typedef struct cav_stress_point {
  double value;
  double measure[CAV_STRESS_MEASURE_TYPES]; ///< INFINITY: failed; NAN: not measured
  int iterations;                           ///< most of one forward step
  int contacts;                             ///< most of one sample at its start
  cav_stress_level level;
  char why[CAV_STRESS_WHY]; ///< what is not well and what it comes from; "" where all is
} cav_stress_point;

/// An end of the safe range, on one side of the scene's own value.
typedef struct cav_stress_edge {
  double safe;       ///< furthest value up to which all was well
  int worse, broken; ///< first point beyond that is not safe, and that is broken or refused; -1: none
} cav_stress_edge;

/// One parameter swept.
typedef struct cav_stress_result {
  const char *absent; ///< why there is nothing to sweep in this scene; NULL: it was swept
  int other_law;      ///< 1: of the stabilisation that the scene does not use: own is what it would have
  double own;         ///< the scene's value
  int npoint, own_point;
  cav_stress_point *point; ///< [npoint] by value
  cav_stress_edge edge[2]; ///< below and above
} cav_stress_result;

/// What the sweep is run on.
typedef struct cav_stress_scene {
  const char *path, *model; ///< a model or a problem file; of a problem, the model to take instead, NULL: its own
  int problem, floating;    ///< whether path is a problem; as cav_load_options
} cav_stress_scene;

typedef struct cav_stress_options {
  int quick; ///< fewer values, samples and steps
  int threads;
  /// Called now and then with the fraction that is done, from the caller's thread; returns 1 to stop. NULL: not.
  int (*observer)(void *context, double fraction);
  void *context;
} cav_stress_options;

typedef struct cav_stress_report {
  char name[80];
  cav_options options; ///< of the scene: what is not swept
  int nv, npair;
  double size;         ///< L, m
  char underived[200]; ///< what has no analytic derivatives; "": all has
  cav_stress_result sweep[CAV_STRESS_SWEEPS];
} cav_stress_report;

/// Sweeps all parameters of a scene. Fails as loading it does, CAV_INTERRUPTED where the observer asks for it,
/// CAV_NO_MEMORY. The report is released by cav_stress_report_clear, whatever comes back.
cav_status cav_stress_run(const cav_stress_scene *scene, const cav_stress_options *options, cav_stress_report *report,
                          cav_error *error);
void cav_stress_report_clear(cav_stress_report *report);

/// Writes every point, and the range of every parameter, as tables. table.c.
cav_status cav_stress_write_points(const char *path, const cav_stress_report *report, cav_error *error);
cav_status cav_stress_write_ranges(const char *path, const cav_stress_report *report, cav_error *error);

/// Writes the page, which names ranges.csv and points.csv beside it. page.c.
cav_status cav_stress_write_page(const char *path, const cav_stress_report *report, const cav_provenance *provenance,
                                 cav_error *error);

#endif
