/// A scene on the bench: its model pushed to one value of one parameter, and random states there. Private to stress/.
#ifndef CAVORT_BENCH_H
#define CAVORT_BENCH_H

#include <stdint.h>

#include "stress.h"

typedef struct cav_bench {
  cav_problem *problem; ///< NULL: of a model alone
  cav_model *model;
  void *kept;          ///< the model as its file has it
  cav_options options; ///< the scene's own
  const double *start; ///< [nq] the scene's posture
  double *space;       ///< all arrays below

  // as pushed
  cav_options pushed;
  double size, gravity;                   ///< L, m; m/s^2, 9.81 where there is none
  double speed, force, depth, quaternion; ///< m/s; weights; m, of the deepest contact with the world; norm
  int slow;                               ///< v changes by a fraction of itself, whatever the weight
  double factor, moved[3];                ///< of all lengths; m, of the whole scene
  cav_state *state;

  // a sample
  double *q, *v, *v_next, *u; ///< [nq], [nv] ...
  double *unit;               ///< [nv] what 1 m/s is of each dof: 1, or 1/L for angles
  double *scratch;            ///< [nq + 6 nv]
} cav_bench;

/// Loads a scene. cav_bench_close takes what a failed one left.
cav_status cav_bench_open(cav_bench *bench, const cav_stress_scene *scene, cav_error *error);
void cav_bench_close(cav_bench *bench);

/// The same with a model that is loaded already, and now the bench's.
cav_status cav_bench_take(cav_bench *bench, cav_model *model, cav_error *error);

/// Why a scene has nothing of a parameter; NULL: it has. Of the scene as it is.
const char *cav_bench_absent(const cav_bench *bench, cav_stress_sweep sweep);

/// The scene's own value of a parameter.
double cav_bench_own(const cav_bench *bench, cav_stress_sweep sweep);

/// Whether the sweep is of the stabilisation that the scene does not use.
int cav_bench_other_law(const cav_bench *bench, cav_stress_sweep sweep);

/// Pushes the scene to a value of a parameter, all others its own. CAV_BAD_INPUT: there is no such scene, why in error.
cav_status cav_bench_push(cav_bench *bench, cav_stress_sweep sweep, double value, cav_error *error);

/// Makes sample number k: the posture of the scene (0) or near it, with the deepest contact with the world as deep as
/// asked where trees that float or slide along the vertical can be lowered to one; v and v_next at random; u of random size.
/// Fails as cav_position.
cav_status cav_bench_sample(cav_bench *bench, int k);

/// Whether dof i is an angle.
int cav_bench_turns(const cav_model *model, int i);

#endif
