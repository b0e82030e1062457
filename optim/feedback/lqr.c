/// Linear feedback of a motion: the linear-quadratic regulator of the forward step along it. The motion is read at a
/// finer step, du/dq, du/dv, du/dv' of the inverse there give the forward step's linear map, and a Riccati recursion
/// from the last knot backwards gives du = gain_q dq + gain_v dv. Straying is penalised by its energy, dv' M dv and dq'
/// M dq, against squared fractions of the actuators' limits, so one penalty serves all limbs. Gains of a knot are the
/// mean of the finer steps up to the next knot. Where balance is what is lost, that of the centre of mass counts more; where
/// a motion takes an actuator near its limit, fractions are of what it leaves.
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

/// s: the longest step of a regulator. With 2 ms weak gains lose a squat-jump that they carry with this.
static const double longest = 0.00125;

/// The regulator at one step: state (dq, dv), input fractions of the actuators' limits. Matrices are column-major. The
/// step is dv' = D (dq, dv) + Du w, dq' = E dq + h J dv', where E and J are 1 but for the blocks of rotations.
typedef struct regulator {
  int nv, nu, n, all;    ///< n = 2 nv, all = n + nu
  int finer;             ///< finer steps in a step of the motion
  double h;              ///< finer step, s
  double q, v;           ///< penalties on dq' M dq and dv' M dv a second
  double *P;             ///< [n*n] penalty of what is left
  double *T;             ///< [n*nv] P (h J; 1)
  double *Q;             ///< [nv*nv] penalty of dv': (h J; 1)' T
  double *L;             ///< [nv*n] of dv' against the dq of before: (E' T above)', 0
  double *W;             ///< [nv*(n+nu)] Q D + (L, 0)
  double *S;             ///< [all*all] mean over the laws of the penalty on the state before and on inputs: S, G and H
  double *G, *H;         ///< of inputs against states and inputs, within S
  double *K, *sum;       ///< [nu*n] K = H^-1 G: input -K x; sum of K over the finer steps of a knot
  double *D;             ///< [nv*(n+nu)] derivatives of v' by dq, dv and inputs
  double *right;         ///< [nv*(n+nu)] of the inverse by dq and dv, and forces of inputs
  double *system;        ///< [nv*nv] of the inverse by v'
  double *inverse;       ///< [nv*nv] of the system
  double *unit, *factor; ///< [nu*nu] inverses of H and of its factor
  double *dq, *dv, *dn;  ///< [nv*nv] of the inverse, row-major
  double *M;             ///< [nv*nv] what straying is weighed by: inertia, and balance
  double *row;           ///< [nv]
  double *room;          ///< [nu*knots] part of its limit that an input is a fraction of
  const double *now;     ///< [nu] that of the step in hand
  double *u;             ///< [nv]
  double (*rotation)[2][9]; ///< [nrotation] blocks of E and J, row-major
  void *memory;
} regulator;

static int regulator_make(regulator *r, const cav_transcription *tr, int knots) {
  int nv = tr->model->nv, nu = tr->model->nu, n = 2 * nv;
  size_t v = (size_t)nv, u = (size_t)nu, s = (size_t)n, all = s + u;
  *r = (regulator){.nv = nv, .nu = nu, .n = n, .all = n + nu};
  double *m = calloc(s * s + all * all + 2 * v * s + 2 * u * u + 2 * u * s + 3 * v * all + 7 * v * v + 2 * v +
                         u * (size_t)knots + 18 * (size_t)tr->nrotation + 1,
                     sizeof *m);
  r->memory = m;
  if (!m) return 0;
  r->P = m, m += s * s;
  r->T = m, m += s * v;
  r->Q = m, m += v * v;
  r->L = m, m += v * s;
  r->W = m, m += v * all;
  r->S = m, m += all * all;
  r->G = r->S + s;
  r->H = r->G + s * all;
  r->K = m, m += u * s;
  r->sum = m, m += u * s;
  r->D = m, m += v * all;
  r->right = m, m += v * all;
  r->inverse = m, m += v * v;
  r->unit = m, m += u * u;
  r->factor = m, m += u * u;
  r->system = m, m += v * v;
  r->dq = m, m += v * v;
  r->dv = m, m += v * v;
  r->dn = m, m += v * v;
  r->M = m, m += v * v;
  r->u = m, m += v;
  r->row = m, m += v;
  r->room = m, m += u * (size_t)knots;
  r->rotation = (double(*)[2][9])m;
  return 1;
}

/// Generalised forces of the inputs, [nv*nu].
static double *force_of(const regulator *r) { return r->right + (size_t)r->n * r->nv; }

static void regulator_free(regulator *r) { free(r->memory); }

/// Generalised force of each actuator at its limit; moments are constant (cav_actuators_plannable).
static cav_status find_forces(regulator *r, const cav_model *model, cav_state *state, const double *q) {
  cav_status status = cav_position(model, state, q);
  for (int a = 0; a < r->nu && status == CAV_OK; a++) {
    double range[2], scale, *force = force_of(r) + (size_t)a * r->nv;
    cav_actuator_length(model, state, a, force);
    cav_verification_actuator_range(model, a, range, &scale);
    for (int d = 0; d < r->nv; d++) force[d] *= scale;
  }
  return status;
}

/// Least part of its limit that an input is a fraction of.
static const double least_room = 0.1;

/// What the motion leaves of an actuator's limits, on the side where that is less, over the limit.
static double room_of(const cav_model *model, int actuator, double effort) {
  double range[2], scale;
  cav_verification_actuator_range(model, actuator, range, &scale);
  return fmin(fmax(fmin(range[1] - effort, effort - range[0]) / scale, least_room), 1);
}

/// Room of the inputs at all knots: their limits whole, or what is left of them.
static cav_status find_room(regulator *r, const cav_model *model, cav_state *state, const cav_trajectory *motion,
                            int left) {
  const int knots = motion->nknot - 1;
  for (int i = 0; i < knots * r->nu; i++) r->room[i] = 1;
  if (!left) return CAV_OK;
  double *effort = r->K; // as yet of no use
  for (int t = 0; t < knots; t++) {
    cav_status status = cav_position(model, state, motion->q + (size_t)t * motion->nq);
    if (status != CAV_OK) return status;
    cav_actuation(model, state, motion->u + (size_t)t * motion->nv, r->row, effort);
    for (int a = 0; a < r->nu; a++) r->room[t * r->nu + a] = room_of(model, a, effort[a]);
  }
  return CAV_OK;
}

/// Whether a dof moves all of a tree that actuators move along: it is straight, and so is all between it and the world.
static int is_carrier(const cav_model *model, int dof) {
  if (!model->link[model->link[model->dof[dof].link].root].driven) return 0;
  for (int d = dof; d >= 0; d = model->dof[d].parent) {
    const cav_joint *joint = &model->joint[model->dof[d].joint];
    if (joint->type != CAV_JOINT_SLIDE && (joint->type != CAV_JOINT_FREE || d >= joint->dof + 3)) return 0;
  }
  return 1;
}

/// Adds the energy of centres of mass to that of the links, M, so many times: a carrier's row of M is its tree's momentum
/// along it, its diagonal the tree's mass.
static void weigh_balance(regulator *r, const cav_model *model, double times) {
  const int nv = r->nv;
  if (times <= 0) return;
  double *momentum = r->system; // as yet of no use
  memcpy(momentum, r->M, (size_t)nv * (size_t)nv * sizeof *momentum);
  for (int d = 0; d < nv; d++) {
    const double *row = momentum + (size_t)d * nv;
    if (!is_carrier(model, d)) continue;
    const double part = times / row[d];
    for (int i = 0; i < nv; i++)
      for (int j = 0; j < nv; j++) r->M[i * nv + j] += part * row[i] * row[j];
  }
}

/// Adds the inputs' part of D; each acts on few dofs.
static void add_inputs(regulator *r) {
  const int nv = r->nv;
  const double *force = force_of(r);
  double *D = r->D + (size_t)r->n * nv;
  for (int a = 0; a < r->nu; a++, force += nv, D += nv)
    for (int d = 0; d < nv; d++) {
      const double *column = r->inverse + (size_t)d * nv, by = r->now[a] * force[d];
      if (force[d] == 0) continue;
      for (int i = 0; i < nv; i++) D[i] += column[i] * by;
    }
}

/// D := derivatives of v' by (q, v) and the inputs, from those of the inverse.
static cav_status find_derivative(regulator *r, const cav_model *model, cav_state *state, const double *q,
                                  const double *v) {
  int nv = r->nv;
  const double *next = v + nv;
  cav_status status = cav_inverse(model, state, q, v, next, r->u);
  if (status == CAV_OK) status = cav_derivatives(model, state, r->dq, r->dv, r->dn);
  if (status == CAV_NOT_SUPPORTED) status = cav_inverse_jacobian(model, state, q, v, next, r->dq, r->dv, r->dn);
  if (status != CAV_OK) return status;
  // column-major: the matrix of the system is dn's transpose in memory
  for (int i = 0; i < nv; i++)
    for (int j = 0; j < nv; j++) {
      r->system[j * nv + i] = r->dn[i * nv + j];
      r->inverse[j * nv + i] = i == j;
      r->right[j * nv + i] = -r->dq[i * nv + j];
      r->right[(nv + j) * nv + i] = -r->dv[i * nv + j];
    }
  // a product takes less time than a solution of so many columns
  if (!cav_dense_solve_general(nv, r->system, nv, nv, r->inverse, nv)) return CAV_NOT_CONVERGED;
  memset(r->D, 0, (size_t)nv * (size_t)r->all * sizeof *r->D);
  cav_dense_product(nv, r->n, nv, 1, r->inverse, nv, r->right, nv, r->D, nv);
  add_inputs(r);
  return CAV_OK;
}

/// Blocks of E and J of the rotations over h v': Exp(-phi) and Jr(phi).
static void find_rotations(regulator *r, const cav_transcription *tr, const double *v_next) {
  for (int k = 0; k < tr->nrotation; k++) {
    double phi[3], inverse[9], *back = r->rotation[k][0], *right = r->rotation[k][1];
    for (int c = 0; c < 3; c++) phi[c] = r->h * v_next[tr->rotation_dof[k] + c];
    cav_rotation_jacobian(phi, right);
    cav_rotation_jacobian_inverse(phi, inverse);
    memset(back, 0, 9 * sizeof *back);
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++)
        for (int c = 0; c < 3; c++) back[3 * i + j] += right[3 * i + c] * inverse[3 * j + c];
  }
}

/// X [rows*nv] := X B for B that is 1 but for its blocks of rotations, those of E or J.
static void turn_columns(const regulator *r, const cav_transcription *tr, int which, int rows, double *X, int ldx) {
  for (int k = 0; k < tr->nrotation; k++) {
    const double *block = r->rotation[k][which];
    double *x = X + (size_t)tr->rotation_dof[k] * ldx;
    for (int i = 0; i < rows; i++) {
      const double a = x[i], b = x[ldx + i], c = x[2 * ldx + i];
      for (int j = 0; j < 3; j++) x[j * ldx + i] = a * block[j] + b * block[3 + j] + c * block[6 + j];
    }
  }
}

/// From P what no law has a part in: T, Q, L, and S of a step that keeps its velocity.
static void carry_back(regulator *r, const cav_transcription *tr) {
  int nv = r->nv, n = r->n, all = r->all;
  for (int j = 0; j < nv; j++) memcpy(r->T + (size_t)j * n, r->P + (size_t)j * n, (size_t)n * sizeof(double));
  turn_columns(r, tr, 1, n, r->T, n);
  for (int j = 0; j < nv; j++)
    for (int i = 0; i < n; i++) r->T[j * n + i] = r->h * r->T[j * n + i] + r->P[(size_t)(nv + j) * n + i];
  // transposed: L = (T above)' E, and Q = (T above)' h J + (T below)'
  memset(r->L, 0, (size_t)nv * n * sizeof(double));
  for (int j = 0; j < nv; j++)
    for (int i = 0; i < nv; i++) r->L[i * nv + j] = r->Q[i * nv + j] = r->T[j * n + i];
  turn_columns(r, tr, 0, nv, r->L, nv);
  turn_columns(r, tr, 1, nv, r->Q, nv);
  for (int j = 0; j < nv; j++)
    for (int i = 0; i < nv; i++) r->Q[i * nv + j] = r->h * r->Q[i * nv + j] + r->T[j * n + nv + i];
  // E' P11 E: P11 E, transposed, and E once more
  memset(r->S, 0, (size_t)all * (size_t)all * sizeof(double));
  for (int j = 0; j < nv; j++) memcpy(r->S + (size_t)j * all, r->P + (size_t)j * n, (size_t)nv * sizeof(double));
  turn_columns(r, tr, 0, nv, r->S, all);
  for (int j = 0; j < nv; j++)
    for (int i = 0; i < j; i++) {
      const double a = r->S[j * all + i];
      r->S[j * all + i] = r->S[i * all + j], r->S[i * all + j] = a;
    }
  turn_columns(r, tr, 0, nv, r->S, all);
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

/// Adds D of one law, of which there are so many: S += part (D'QD + L'D + D'L), L with zeros for inputs. Of the lower
/// triangle.
static void add_law(regulator *r, int laws) {
  int nv = r->nv, all = r->all;
  const size_t states = (size_t)nv * (size_t)r->n;
  const double part = 1.0 / laws;
  memset(r->W, 0, (size_t)nv * (size_t)all * sizeof *r->W);
  cav_dense_product(nv, all, nv, part, r->Q, nv, r->D, nv, r->W, nv);
  for (size_t i = 0; i < states; i++) r->W[i] += part * r->L[i];
  cav_dense_product_transposed(CAV_TRIANGLE_LOWER, all, all, nv, 1, r->D, nv, r->W, nv, r->S, all);
  // L'D, whose rows below are zero: of the lower triangle what is on the left
  cav_dense_product_transposed(CAV_TRIANGLE_LOWER, nv, nv, nv, part, r->L, nv, r->D, nv, r->S, all);
}

/// One step back, from S: K, and P of the step before without the penalty on its state. The penalty on inputs is one a
/// second.
static cav_status riccati(regulator *r) {
  int n = r->n, nu = r->nu, all = r->all;
  for (int j = 0; j < n; j++) memcpy(r->P + j * n + j, r->S + j * all + j, (size_t)(n - j) * sizeof(double));
  if (nu > 0) {
    for (int i = 0; i < nu; i++) r->H[i * all + i] += r->h;
    if (!cav_dense_factor(nu, nu - 1, r->H, all)) return CAV_NOT_CONVERGED;
    memset(r->factor, 0, (size_t)nu * (size_t)nu * sizeof *r->factor);
    for (int i = 0; i < nu; i++) r->factor[i * (nu + 1)] = 1;
    cav_dense_solve_lower(nu, nu - 1, r->H, all, nu, r->factor, nu);
    memset(r->unit, 0, (size_t)nu * (size_t)nu * sizeof *r->unit);
    cav_dense_product_transposed(CAV_TRIANGLE_BOTH, nu, nu, nu, 1, r->factor, nu, r->factor, nu, r->unit, nu);
    memset(r->K, 0, (size_t)nu * n * sizeof *r->K);
    cav_dense_product(nu, n, nu, 1, r->unit, nu, r->G, all, r->K, nu);
    cav_dense_product_transposed(CAV_TRIANGLE_LOWER, n, n, nu, -1, r->G, all, r->K, nu, r->P, n);
  }
  for (int j = 0; j < n; j++)
    for (int i = j + 1; i < n; i++) r->P[(size_t)i * n + j] = r->P[(size_t)j * n + i];
  return CAV_OK;
}

/// Adds the gains of the finer step k to those of its knot; at the knot their mean, as generalised forces.
static void add_gains(regulator *r, int k, double *gain_q, double *gain_v) {
  const int nv = r->nv, nu = r->nu, inputs = nu * r->n;
  for (int j = 0; j < r->n; j++)
    for (int a = 0; a < nu; a++) r->sum[j * nu + a] += r->now[a] * r->K[j * nu + a];
  if (k % r->finer > 0) return;
  for (int j = 0; j < nv; j++)
    for (int a = 0; a < nu; a++) {
      const double q = r->sum[j * nu + a] / r->finer, v = r->sum[(nv + j) * nu + a] / r->finer;
      const double *force = force_of(r) + (size_t)a * nv;
      for (int i = 0; i < nv; i++) {
        gain_q[i * nv + j] -= force[i] * q;
        gain_v[i * nv + j] -= force[i] * v;
      }
    }
  memset(r->sum, 0, (size_t)inputs * sizeof *r->sum);
}

/// S, below its diagonal, at (q, v) under all laws, from P.
static cav_status add_laws(regulator *r, const cav_transcription *tr, const cav_options *law, int laws,
                           cav_state *state, const double *q, const double *v) {
  find_rotations(r, tr, v + r->nv);
  carry_back(r, tr);
  for (int i = 0; i < laws; i++) {
    state->options = cav_options_at_step(&law[i], r->h);
    state->options.order = CAV_ORDER_EULER;
    cav_status status = find_derivative(r, tr->model, state, q, v);
    if (status != CAV_OK) return status;
    add_law(r, laws);
  }
  return CAV_OK;
}

/// Back over a motion, whose straying is weighed with balance; gains of the first knots are kept. What a cycle looks ahead to
/// has the room of its first period, mirrored or not.
static cav_status sweep(regulator *r, const cav_transcription *tr, const cav_trajectory *fine, const cav_options *law,
                        int laws, double balance, cav_state *state, cav_state *bare, int knots, double *gain_q,
                        double *gain_v) {
  int nq = fine->nq, nv = fine->nv;
  size_t square = (size_t)nv * nv;
  cav_status status = CAV_OK;
  for (int k = fine->nknot - 2; k >= 0 && status == CAV_OK; k--) {
    const double *q = fine->q + (size_t)k * nq, *v = fine->v + (size_t)k * nv;
    status = cav_transcription_stopped(tr) ? CAV_INTERRUPTED : cav_inertia(tr->model, bare, q, r->M);
    if (status == CAV_OK) weigh_balance(r, tr->model, balance);
    r->now = r->room + (size_t)(k / r->finer % knots) * r->nu;
    // at the end a second's straying is penalised
    if (status == CAV_OK && k == fine->nknot - 2) add_penalty(r, 1);
    if (status == CAV_OK) status = add_laws(r, tr, law, laws, state, q, v);
    if (status == CAV_OK) status = riccati(r);
    if (status != CAV_OK) break;
    add_penalty(r, r->h);
    int t = k / r->finer;
    if (t < knots) add_gains(r, k, gain_q + (size_t)t * square, gain_v + (size_t)t * square);
  }
  return status;
}

cav_status cav_feedback(const cav_transcription *tr, const cav_trajectory *motion, const cav_options *law, int laws,
                        const cav_feedback_penalty *penalty, double *gain_q, double *gain_v) {
  size_t n = ((size_t)motion->nknot - 1) * (size_t)motion->nv * (size_t)motion->nv;
  memset(gain_q, 0, n * sizeof *gain_q);
  memset(gain_v, 0, n * sizeof *gain_v);
  regulator r;
  int ready = regulator_make(&r, tr, motion->nknot - 1);
  // a cycle goes on: two strides are looked ahead
  int ahead = tr->problem->cycle.mirror == CAV_MIRROR_NONE ? 2 : 4;
  cav_trajectory *whole =
      tr->periodicity ? cav_periodicity_unroll(tr->periodicity, motion, ahead) : cav_trajectory_copy(motion);
  r.finer = (int)fmax(1, ceil(motion->timestep / longest - 1e-9));
  r.h = motion->timestep / r.finer;
  cav_trajectory *fine = whole ? cav_trajectory_resample(tr->model, whole, r.h) : NULL;
  cav_state *state = cav_state_new(tr->model), *bare = cav_state_new(tr->model);
  cav_status status = ready && fine && state && bare ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK) {
    r.v = penalty->tracking / (tr->weight * CAV_MOMENT_ARM);
    r.q = r.v * penalty->rate * penalty->rate;
    bare->options.contact = bare->options.constraint = 0;
    status = find_forces(&r, tr->model, bare, motion->q);
    if (status == CAV_OK) status = find_room(&r, tr->model, bare, motion, penalty->room);
  }
  if (status == CAV_OK)
    status = sweep(&r, tr, fine, law, laws, penalty->balance, state, bare, motion->nknot - 1, gain_q, gain_v);
  cav_state_free(state);
  cav_state_free(bare);
  cav_trajectory_free(whole);
  cav_trajectory_free(fine);
  regulator_free(&r);
  return status;
}
