/// A step of a linear model, as matrices: what filters and regulators of tests are made of.
#ifndef CAVORT_TEST_LINEAR_STEP_H
#define CAVORT_TEST_LINEAR_STEP_H

#include "scene.h"

/// Two masses on slides, one on the other, with springs and dampers: linear, and no limits anywhere.
static const char two_masses[] =
    "<mujoco model='masses'><option gravity='0 0 0' timestep='.001'/><worldbody>"
    "<body><joint name='a' type='slide' axis='1 0 0' damping='.4' stiffness='3'/><geom size='.1' mass='2' contype='0' "
    "conaffinity='0'/>"
    "<body pos='0 0 1'><joint name='b' type='slide' axis='1 0 0' damping='.1' stiffness='1'/><geom size='.1' mass='1' "
    "contype='0' conaffinity='0'/></body></body></worldbody>"
    "<actuator><motor joint='a' gear='1'/><motor joint='b' gear='1'/></actuator></mujoco>";

/// One step of h: v' and q' of a state x [2nv] under forces u [nv] into next [2nv].
static inline void linear_step(const cav_model *m, cav_state *s, double h, const double *x, const double *u,
                               double *next) {
  CHECK(cav_forward(m, s, x, x + m->nv, u, next + m->nv) == CAV_OK);
  cav_integrate(m, x, next + m->nv, h, next);
}

/// A [2nv*2nv] and B [2nv*nv] of the step, by its images of unit vectors.
static inline void linear_map(const cav_model *m, cav_state *s, double h, double *A, double *B) {
  int n = m->nv, states = 2 * n;
  for (int k = 0; k < states + n; k++) {
    double x[64] = {0}, u[32] = {0}, next[64];
    if (!CHECK(n <= 32)) return;
    if (k < states)
      x[k] = 1;
    else
      u[k - states] = 1;
    linear_step(m, s, h, x, u, next);
    for (int i = 0; i < states; i++) *(k < states ? &A[i * states + k] : &B[i * n + k - states]) = next[i];
  }
}

#endif
