/// Linear feedback of a motion: the linear-quadratic regulator of the forward step along it. The motion is read at a
/// finer step, du/dq, du/dv, du/dv' of the inverse there give the forward step's linear map, and a Riccati recursion
/// from the last knot backwards gives du = gain_q dq + gain_v dv. Straying is penalised by its energy, dv' M dv and dq'
/// M dq, against squared fractions of the actuators' limits, so one penalty serves all limbs. Gains of a knot are the
/// mean of the finer steps up to the next knot.
///
/// When a contact comes and how hard it is is not known to a step or a millimetre. So the recursion takes several
/// contact laws, one of which holds at each step, by chance and apart from the others: the expectation of what is left
/// stands for what is left (de Koning, Automatica 18, 1982), and gains are those that serve all of them.
///
/// The step matters: gains of the plan's own step answer a touch with what undoes it within that step, and a tenth of
/// the step later they answer again. Gains from the plan's Hessian carried motions a third as far (README.md). Does not
/// know limits of actuators, and does not see contacts that the law at hand does not feel.
#include "lqr.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dense.h"
#include "rotation.h"
#include "verification.h"

/// Finer steps in a step of the motion.
enum { FINER = 20 };

/// The regulator at one step: state (dq, dv), input fractions of the actuators' limits. Matrices are column-major.
typedef struct regulator {
  int nv, nu, n;        ///< n = 2 nv
  double h;             ///< finer step, s
  double q, v;          ///< penalties on dq' M dq and dv' M dv a second
  double *force;        ///< [nv*nu] generalised force of an input
  double *A, *B;        ///< [n*n], [n*nu] the step
  double *P;            ///< [n*n] penalty of what is left
  double *PA, *PB;      ///< [n*n], [n*nu]
  double *S;            ///< [n*n] mean of A'PA over the laws
  double *H;            ///< [nu*nu] of B'PB, and the penalty on inputs
  double *G, *K;        ///< [nu*n] G of B'PA; K = H^-1 G: input -K x
  double *derivative;   ///< [nv*(n+nu)] derivatives of v' by dq, dv and inputs
  double *dq, *dv, *dn; ///< [nv*nv] of the inverse, row-major
  double *M;            ///< [nv*nv]
  double *u;            ///< [nv]
  void *memory;
} regulator;

static int regulator_make(regulator *r, const cav_model *model) {
  int nv = model->nv, nu = model->nu, n = 2 * nv;
  size_t v = (size_t)nv, u = (size_t)nu, s = (size_t)n;
  *r = (regulator){.nv = nv, .nu = nu, .n = n};
  double *m = calloc(v * u + 4 * s * s + 2 * s * u + u * u + 2 * u * s + v * (s + u) + 4 * v * v + v + 1, sizeof *m);
  r->memory = m;
  if (!m) return 0;
  r->force = m, m += v * u;
  r->A = m, m += s * s;
  r->P = m, m += s * s;
  r->PA = m, m += s * s;
  r->S = m, m += s * s;
  r->B = m, m += s * u;
  r->PB = m, m += s * u;
  r->H = m, m += u * u;
  r->G = m, m += u * s;
  r->K = m, m += u * s;
  r->derivative = m, m += v * (s + u);
  r->dq = m, m += v * v;
  r->dv = m, m += v * v;
  r->dn = m, m += v * v;
  r->M = m, m += v * v;
  r->u = m;
  return 1;
}

static void regulator_free(regulator *r) { free(r->memory); }

/// Generalised force of each actuator at its limit; moments are constant (cav_actuators_plannable).
static cav_status find_forces(regulator *r, const cav_model *model, cav_state *state, const double *q) {
  cav_status status = cav_position(model, state, q);
  for (int a = 0; a < r->nu && status == CAV_OK; a++) {
    double range[2], scale, *force = r->force + (size_t)a * r->nv;
    cav_actuator_length(model, state, a, force);
    cav_verification_actuator_range(model, a, range, &scale);
    for (int d = 0; d < r->nv; d++) force[d] *= scale;
  }
  return status;
}

/// derivative := derivatives of v' by (q, v) and the inputs, from those of the inverse.
static cav_status find_derivative(regulator *r, const cav_model *model, cav_state *state, const double *q,
                                  const double *v) {
  int nv = r->nv, columns = r->n + r->nu;
  const double *next = v + nv;
  cav_status status = cav_inverse(model, state, q, v, next, r->u);
  if (status == CAV_OK) status = cav_derivatives(model, state, r->dq, r->dv, r->dn);
  if (status == CAV_NOT_SUPPORTED) status = cav_inverse_jacobian(model, state, q, v, next, r->dq, r->dv, r->dn);
  if (status != CAV_OK) return status;
  // column-major: the matrix of the system is dn's transpose in memory
  double *system = r->PA;
  for (int i = 0; i < nv; i++)
    for (int j = 0; j < nv; j++) {
      system[j * nv + i] = r->dn[i * nv + j];
      r->derivative[j * nv + i] = -r->dq[i * nv + j];
      r->derivative[(nv + j) * nv + i] = -r->dv[i * nv + j];
    }
  memcpy(r->derivative + (size_t)r->n * nv, r->force, (size_t)nv * r->nu * sizeof(double));
  return cav_dense_solve_general(nv, system, nv, columns, r->derivative, nv) ? CAV_OK : CAV_NOT_CONVERGED;
}

/// Three rows of dq' for a rotation over phi: Exp(-phi) dq + h Jr(phi) dv'.
static void rotation_rows(const regulator *r, int dof, const double *v, const double *derivative, int columns,
                          int with_q, double *out) {
  double phi[3], right[9], inverse[9], back[9] = {0};
  for (int c = 0; c < 3; c++) phi[c] = r->h * v[dof + c];
  cav_rotation_jacobian(phi, right);
  cav_rotation_jacobian_inverse(phi, inverse);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      for (int k = 0; k < 3; k++) back[3 * i + j] += right[3 * i + k] * inverse[3 * j + k];
  for (int j = 0; j < columns; j++)
    for (int i = 0; i < 3; i++) {
      double sum = 0;
      for (int k = 0; k < 3; k++) sum += right[3 * i + k] * derivative[j * r->nv + dof + k];
      out[(size_t)j * r->n + dof + i] = r->h * sum;
      if (with_q && j >= dof && j < dof + 3) out[(size_t)j * r->n + dof + i] += back[3 * i + j - dof];
    }
}

/// Columns of the step, from derivative: dv' below, dq' = dq + h dv' above.
static void step_columns(const regulator *r, const cav_transcription *tr, const double *v_next,
                         const double *derivative, int columns, int with_q, double *out) {
  int nv = r->nv;
  for (int j = 0; j < columns; j++)
    for (int i = 0; i < nv; i++) {
      out[(size_t)j * r->n + nv + i] = derivative[j * nv + i];
      out[(size_t)j * r->n + i] = r->h * derivative[j * nv + i] + (with_q && i == j);
    }
  for (int k = 0; k < tr->nrotation; k++)
    rotation_rows(r, tr->rotation_dof[k], v_next, derivative, columns, with_q, out);
}

/// P += scale * penalty of straying.
static void add_penalty(regulator *r, double scale) {
  int nv = r->nv, n = r->n;
  for (int i = 0; i < nv; i++)
    for (int j = 0; j < nv; j++) {
      r->P[(size_t)i * n + j] += scale * r->q * r->M[i * nv + j];
      r->P[(size_t)(nv + i) * n + nv + j] += scale * r->v * r->M[i * nv + j];
    }
}

/// Adds A and B of one law, of which there are so many: S += A'PA, G += B'PA, H += B'PB.
static void add_law(regulator *r, int laws) {
  int n = r->n, nu = r->nu;
  double part = 1.0 / laws;
  memset(r->PA, 0, (size_t)n * (size_t)n * sizeof(double));
  cav_dense_product(n, n, n, part, r->P, n, r->A, n, r->PA, n);
  cav_dense_product_transposed(CAV_PART_ALL, n, n, n, 1, r->A, n, r->PA, n, r->S, n);
  if (nu == 0) return;
  cav_dense_product_transposed(CAV_PART_ALL, nu, n, n, 1, r->B, n, r->PA, n, r->G, nu);
  memset(r->PB, 0, (size_t)n * (size_t)nu * sizeof(double));
  cav_dense_product(n, nu, n, part, r->P, n, r->B, n, r->PB, n);
  cav_dense_product_transposed(CAV_PART_ALL, nu, nu, n, 1, r->B, n, r->PB, n, r->H, nu);
}

/// One step back, from S, G and H: K, and P of the step before without the penalty on its state. The penalty on inputs
/// is one a second.
static cav_status riccati(regulator *r) {
  int n = r->n, nu = r->nu;
  memcpy(r->P, r->S, (size_t)n * (size_t)n * sizeof(double));
  if (nu > 0) {
    for (int i = 0; i < nu; i++) r->H[i * nu + i] += r->h;
    memcpy(r->K, r->G, (size_t)nu * (size_t)n * sizeof(double));
    if (!cav_dense_factor(nu, nu - 1, r->H, nu)) return CAV_NOT_CONVERGED;
    cav_dense_solve_lower(nu, nu - 1, r->H, nu, n, r->K, nu);
    cav_dense_solve_upper(nu, nu - 1, r->H, nu, n, r->K, nu);
    cav_dense_product_transposed(CAV_PART_ALL, n, n, nu, -1, r->G, nu, r->K, nu, r->P, n);
  }
  for (int i = 0; i < n; i++)
    for (int j = 0; j < i; j++) {
      double mean = 0.5 * (r->P[(size_t)i * n + j] + r->P[(size_t)j * n + i]);
      r->P[(size_t)i * n + j] = r->P[(size_t)j * n + i] = mean;
    }
  return CAV_OK;
}

/// Adds the gains of this step, as generalised forces, to those of the knot.
static void add_gains(const regulator *r, double *gain_q, double *gain_v) {
  int nv = r->nv;
  for (int j = 0; j < nv; j++)
    for (int a = 0; a < r->nu; a++) {
      double q = r->K[(size_t)j * r->nu + a] / FINER, v = r->K[(size_t)(nv + j) * r->nu + a] / FINER;
      for (int i = 0; i < nv; i++) {
        gain_q[i * nv + j] -= r->force[(size_t)a * nv + i] * q;
        gain_v[i * nv + j] -= r->force[(size_t)a * nv + i] * v;
      }
    }
}

/// S, G and H at (q, v) under all laws, from P.
static cav_status add_laws(regulator *r, const cav_transcription *tr, const cav_options *law, int laws,
                           cav_state *state, const double *q, const double *v) {
  size_t n = (size_t)r->n, nu = (size_t)r->nu;
  memset(r->S, 0, n * n * sizeof(double));
  memset(r->G, 0, nu * n * sizeof(double));
  memset(r->H, 0, nu * nu * sizeof(double));
  for (int i = 0; i < laws; i++) {
    state->options = cav_options_at_step(&law[i], r->h);
    state->options.order = CAV_ORDER_EULER;
    cav_status status = find_derivative(r, tr->model, state, q, v);
    if (status != CAV_OK) return status;
    step_columns(r, tr, v + r->nv, r->derivative, r->n, 1, r->A);
    step_columns(r, tr, v + r->nv, r->derivative + n * (size_t)r->nv, r->nu, 0, r->B);
    add_law(r, laws);
  }
  return CAV_OK;
}

/// Back over a motion; gains of the first knots are kept.
static cav_status sweep(regulator *r, const cav_transcription *tr, const cav_trajectory *fine, const cav_options *law,
                        int laws, cav_state *state, cav_state *bare, int knots, double *gain_q, double *gain_v) {
  int nq = fine->nq, nv = fine->nv;
  size_t square = (size_t)nv * nv;
  cav_status status = CAV_OK;
  for (int k = fine->nknot - 2; k >= 0 && status == CAV_OK; k--) {
    const double *q = fine->q + (size_t)k * nq, *v = fine->v + (size_t)k * nv;
    status = cav_transcription_stopped(tr) ? CAV_INTERRUPTED : cav_inertia(tr->model, bare, q, r->M);
    // at the end a second's straying is penalised
    if (status == CAV_OK && k == fine->nknot - 2) add_penalty(r, 1);
    if (status == CAV_OK) status = add_laws(r, tr, law, laws, state, q, v);
    if (status == CAV_OK) status = riccati(r);
    if (status != CAV_OK) break;
    add_penalty(r, r->h);
    int t = k / FINER;
    if (t < knots) add_gains(r, gain_q + (size_t)t * square, gain_v + (size_t)t * square);
  }
  return status;
}

cav_status cav_feedback(const cav_transcription *tr, const cav_trajectory *motion, const cav_options *law, int laws,
                        const cav_feedback_penalty *penalty, double *gain_q, double *gain_v) {
  size_t n = ((size_t)motion->nknot - 1) * (size_t)motion->nv * (size_t)motion->nv;
  memset(gain_q, 0, n * sizeof *gain_q);
  memset(gain_v, 0, n * sizeof *gain_v);
  regulator r;
  int ready = regulator_make(&r, tr->model);
  // a cycle goes on: two strides are looked ahead
  int ahead = tr->problem->cycle.mirror == CAV_MIRROR_NONE ? 2 : 4;
  cav_trajectory *whole =
      tr->periodicity ? cav_periodicity_unroll(tr->periodicity, motion, ahead) : cav_trajectory_copy(motion);
  cav_trajectory *fine = whole ? cav_trajectory_resample(tr->model, whole, motion->timestep / FINER) : NULL;
  cav_state *state = cav_state_new(tr->model), *bare = cav_state_new(tr->model);
  cav_status status = ready && fine && state && bare ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK) {
    r.h = motion->timestep / FINER;
    r.v = penalty->tracking / (tr->weight * CAV_MOMENT_ARM);
    r.q = r.v * penalty->rate * penalty->rate;
    bare->options.contact = bare->options.constraint = 0;
    status = find_forces(&r, tr->model, bare, motion->q);
  }
  if (status == CAV_OK) status = sweep(&r, tr, fine, law, laws, state, bare, motion->nknot - 1, gain_q, gain_v);
  cav_state_free(state);
  cav_state_free(bare);
  cav_trajectory_free(whole);
  cav_trajectory_free(fine);
  regulator_free(&r);
  return status;
}
