/// What holds of a scene at one value of one parameter, over a few samples: the inverse and the forward step undo
/// each other, the analytic derivatives agree with differences, the forward solver converges, and a run without
/// applied force gains no energy.
///
/// Velocities are compared in m/s: angles times L. The difference quotient is centred, along one random direction
/// of q, of v and of v' each, by steps over several decades, of which the one counts that rounding and curvature
/// leave most digits of, less what these do to it; steps that rounding leaves no three digits of tell nothing. At a
/// kink a derivative is as good as any between those of both sides. Energy is kinetic, of the weight less gravity
/// compensation, and of the springs of joints and tendons; constraints, dampers and friction losses can only take
/// it, up to what a violated constraint gives back. A medium that moves gives energy too: with wind nothing is said
/// of it.
#include "probe.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/dynamics.h"
#include "smooth.h"
#include "step.h"

enum {
  ROUNDINGS = 32, // of a force, on its way through the tree
  MISSED_MOST = 3 // steps of a passive run that miss their tolerance
};
static const double least_step = 1e-10, blurred = 1e-3, bent = 0.1, most_step = 1e-5; // below the depth of contacts

// the worst so far; what is not a number has failed
static void worsen(double *worst, double value) {
  if (!isfinite(value)) value = INFINITY;
  if (isnan(*worst) || value > *worst) *worst = value;
}

static int all_finite(const double *x, int n) {
  for (int i = 0; i < n; i++)
    if (!isfinite(x[i])) return 0;
  return 1;
}

// notes how a call ended; whether its result can be used
static int usable(cav_stress_trace *e, const char *call, cav_status status, const double *out, int n) {
  if (status == CAV_OK || status == CAV_NOT_CONVERGED) {
    if (all_finite(out, n)) return 1;
    e->silent = 1;
    status = CAV_NOT_FINITE;
  }
  if (!e->call) e->call = call, e->status = status;
  return 0;
}

// largest of a velocity, angles times L
static double speed_of(const cav_bench *b, const double *v) {
  double most = 0;
  for (int i = 0; i < b->model->nv; i++) most = fmax(most, fabs(v[i]) / b->unit[i]);
  return most;
}

static double largest_rotation(const cav_bench *b, const double *v) {
  double most = 0;
  for (int i = 0; i < b->model->nv; i++)
    if (cav_bench_turns(b->model, i)) most = fmax(most, fabs(v[i]) * b->pushed.timestep);
  return most;
}

// fastest velocity that a constraint asks for, m/s; of angles at L
static double asked_for(const cav_bench *b) {
  double most = 0;
  for (int i = 0; i < b->state->ncontact; i++) {
    const cav_contact *c = &b->state->contact[i];
    most = fmax(most, fabs(c->stiffness * (c->dist - c->margin)));
  }
  for (int i = 0; i < b->state->nrow; i++) {
    const cav_row *r = &b->state->row[i];
    if (r->type != CAV_ROW_LIMIT_JOINT) continue;
    const double unit = b->unit[b->model->joint[r->object].dof];
    most = fmax(most, fabs(r->stiffness * (r->dist - r->margin)) / unit);
  }
  return most;
}

// what rounding of u itself does to v', m/s; angles at L: forces of stiff constraints are large, and what they leave of
// the motion is a difference of them. Those of one dof move others by no more than the mean of both inverse weights
static double rounding_of(const cav_bench *b, const double *u) {
  double sum = 0, most = 0;
  for (int i = 0; i < b->model->nv; i++) sum += fabs(u[i]) * sqrt(b->model->dof[i].inverse_weight);
  for (int i = 0; i < b->model->nv; i++) most = fmax(most, sum * sqrt(b->model->dof[i].inverse_weight) / b->unit[i]);
  return ROUNDINGS * DBL_EPSILON * b->pushed.timestep * most;
}

// whether the step to another v' is one by the same forces: an order that is not convex may have several
static int is_another(cav_bench *b, const double *u, const double *other) {
  const int n = b->model->nv;
  double *there = b->scratch + 2 * n, most = 0, error = 0;
  if (cav_inverse(b->model, b->state, b->q, b->v, other, there)) return 0;
  for (int i = 0; i < n; i++) {
    error = fmax(error, fabs(there[i] - u[i]) * b->unit[i]);
    most = fmax(most, fmax(fabs(u[i]), fabs(there[i])) * b->unit[i]);
  }
  return error <= 1e-9 * most;
}

static cav_status step_forward(cav_bench *b, cav_stress_trace *e, cav_stress_point *p, const double *q, const double *v,
                               const double *u, double *v_next) {
  // as cav_forward
  cav_forward_report report = {0};
  cav_status status = cav_forward_newton(b->model, b->state, q, v, u, cav_forward_limit(b->state),
                                         CAV_FORWARD_TOLERANCE, v_next, &report);
  e->solves++;
  e->none += status == CAV_NOT_CONVERGED && report.folded;
  e->unsolved += status != CAV_OK;
  if (report.iterations > p->iterations) p->iterations = report.iterations;
  return status;
}

// forward(inverse(v')) against v', and a forward step under the sample's u
static cav_status measure_round_trip(cav_bench *b, cav_stress_point *p, cav_stress_trace *e) {
  const cav_model *m = b->model;
  double *u = b->scratch, *back = b->scratch + m->nv, worst = 0;
  int most = -1;
  cav_status status = cav_inverse(m, b->state, b->q, b->v, b->v_next, u);
  if (status == CAV_NO_MEMORY) return status;
  const double asked = asked_for(b);
  if (b->state->ncontact > p->contacts) p->contacts = b->state->ncontact;
  if (!usable(e, "the inverse", status, u, m->nv)) {
    worsen(&p->measure[CAV_STRESS_ROUND_TRIP], INFINITY);
    return CAV_OK;
  }
  e->rotation = fmax(e->rotation, fmax(largest_rotation(b, b->v), largest_rotation(b, b->v_next)));
  status = step_forward(b, e, p, b->q, b->v, u, back);
  if (status == CAV_NO_MEMORY) return status;
  if (usable(e, "the forward step", status, back, m->nv)) {
    const double scale =
        fmax(fmax(speed_of(b, b->v), speed_of(b, b->v_next)), fmax(asked, b->gravity * b->pushed.timestep)) + DBL_MIN;
    for (int i = 0; i < m->nv; i++) {
      const double error = fabs(back[i] - b->v_next[i]) / b->unit[i] / scale;
      if (error > worst) worst = error, most = i;
    }
    if (!(worst <= p->measure[CAV_STRESS_ROUND_TRIP])) {
      e->dof = most;
      e->rounding_of_u = rounding_of(b, u) / scale;
      e->another = !status && worst > 1e-6 && is_another(b, u, back);
    }
    worsen(&p->measure[CAV_STRESS_ROUND_TRIP], worst);
  } else {
    worsen(&p->measure[CAV_STRESS_ROUND_TRIP], INFINITY);
  }
  status = step_forward(b, e, p, b->q, b->v, b->u, back);
  if (status == CAV_NO_MEMORY) return status;
  usable(e, "the forward step", status, back, m->nv);
  return CAV_OK;
}

// --- derivatives ---

// u at the sample moved by a step along a direction of one block: q, v or v'
static cav_status moved_inverse(cav_bench *b, int block, const double *direction, double step, double *u) {
  const cav_model *m = b->model;
  double *at = b->scratch + 4 * m->nv;
  if (block == 0) {
    cav_integrate(m, b->q, direction, step, at);
    return cav_inverse(m, b->state, at, b->v, b->v_next, u);
  }
  const double *from = block == 1 ? b->v : b->v_next;
  for (int i = 0; i < m->nv; i++) at[i] = from[i] + step * direction[i];
  return cav_inverse(m, b->state, b->q, block == 1 ? at : b->v, block == 1 ? b->v_next : at, u);
}

// what the derivatives of a block say along a direction, and the size of what they sum, forces of angles over L
static double told_by(const cav_bench *b, const double *D, const double *direction, double *told) {
  const int n = b->model->nv;
  double scale = DBL_MIN;
  for (int i = 0; i < n; i++) {
    double size = 0;
    told[i] = 0;
    for (int j = 0; j < n; j++) told[i] += D[i * n + j] * direction[j], size += fabs(D[i * n + j] * direction[j]);
    scale = fmax(scale, size * b->unit[i]);
  }
  return scale;
}

// how far the difference quotient that tells most of a block is from what the derivatives say, relative; NAN: rounding
// or kinks within all steps hide it
static double compare_block(cav_bench *b, int block, int differences, const double *D, const double *direction,
                            double noise, cav_status *status) {
  const int n = b->model->nv;
  double *told = b->scratch + n, *plus = b->scratch + 2 * n, *minus = b->scratch + 3 * n, found = NAN, least = INFINITY;
  const double scale = told_by(b, D, direction, told), *here = b->scratch;
  for (int k = 0; k < differences; k++) {
    const double step = most_step * pow(least_step / most_step, k / (differences - 1.0));
    if (!(noise / step < blurred * scale)) break;
    *status = moved_inverse(b, block, direction, step, plus);
    if (!*status) *status = moved_inverse(b, block, direction, -step, minus);
    if (*status) return NAN;
    double worst = 0, unsure = 0;
    for (int i = 0; i < n; i++) {
      // at a kink any derivative between the two sides will do
      const double middle = (plus[i] - minus[i]) / (2 * step),
                   bend = fabs(plus[i] - 2 * here[i] + minus[i]) / (2 * step);
      const double error = (fabs(middle - told[i]) - bend) * b->unit[i];
      worst = fmax(worst, isfinite(error) ? error : INFINITY);
      unsure = fmax(unsure, bend * b->unit[i]);
    }
    unsure += noise / step;
    if (unsure < least) least = unsure, found = fmax(0, worst - noise / step) / scale;
  }
  return least < bent * scale ? found : NAN;
}

// a direction of a block: of q by L and rad, of velocities by what the sample moves at
static void point_along(const cav_bench *b, int k, int block, double *direction) {
  const double fastest = fmax(speed_of(b, b->v), speed_of(b, b->v_next)),
               size = block == 0 ? b->size : fmax(fastest, b->gravity * b->pushed.timestep);
  for (int i = 0; i < b->model->nv; i++) direction[i] = cos(1 + 3 * i + 7 * k + 11 * block) * size * b->unit[i];
}

// what rounding of positions, velocities and forces leaves uncertain of u, forces of angles over L
static double noise_of(const cav_bench *b, int k, const double *matrix, double *direction) {
  const size_t n = (size_t)b->model->nv;
  const double far = 1 + hypot(b->moved[0], b->moved[1]) / b->size;
  double sum = 0;
  for (size_t i = 0; i < n; i++) sum = fmax(sum, fabs(b->state->u[i]) * b->unit[i]);
  for (int block = 0; block < 3; block++) {
    point_along(b, k, block, direction);
    sum += (block ? 1 : far) * told_by(b, matrix + (size_t)block * n * n, direction, b->scratch + n);
  }
  return ROUNDINGS * DBL_EPSILON * sum;
}

static cav_status measure_derivative(cav_bench *b, int k, int differences, cav_stress_point *p, cav_stress_trace *e,
                                     double *matrix) {
  const cav_model *m = b->model;
  const size_t n = (size_t)m->nv;
  double *direction = b->scratch + 5 * n + m->nq;
  if (cav_derivatives_missing(m)) return CAV_OK;
  cav_status status = cav_inverse(m, b->state, b->q, b->v, b->v_next, b->scratch);
  if (!status) status = cav_derivatives(m, b->state, matrix, matrix + n * n, matrix + 2 * n * n);
  if (status == CAV_NO_MEMORY) return status;
  if (status == CAV_NOT_SUPPORTED) return CAV_OK;
  if (!usable(e, "the derivatives", status, matrix, 3 * m->nv * m->nv)) {
    worsen(&p->measure[CAV_STRESS_DERIVATIVE], INFINITY);
    return CAV_OK;
  }
  const double noise = noise_of(b, k, matrix, direction);
  for (int block = 0; block < 3 && !status; block++) {
    point_along(b, k, block, direction);
    const double error =
        compare_block(b, block, differences, matrix + (size_t)block * n * n, direction, noise, &status);
    if (status) break;
    if (isnan(error)) continue;
    if (!(error <= p->measure[CAV_STRESS_DERIVATIVE])) e->block = block;
    worsen(&p->measure[CAV_STRESS_DERIVATIVE], error);
  }
  if (status == CAV_NO_MEMORY) return status;
  if (status) {
    worsen(&p->measure[CAV_STRESS_DERIVATIVE], INFINITY);
    if (!e->call) e->call = "the inverse near a sample", e->status = status;
  }
  return CAV_OK;
}

// --- energy ---

static double turning_energy(const double *q, const double *rest) {
  // angle of rest^-1 q
  double dot = 0, a = 0, c = 0;
  for (int k = 0; k < 4; k++) dot += q[k] * rest[k], a += q[k] * q[k], c += rest[k] * rest[k];
  const double cosine = fmin(1, fabs(dot) / sqrt(a * c)), angle = 2 * acos(cosine);
  return 0.5 * angle * angle;
}

static double spring_energy(const cav_model *m, const cav_state *state, const double *q) {
  double sum = 0;
  for (int i = 0; i < m->njoint; i++) {
    const cav_joint *j = &m->joint[i];
    const double *at = q + j->q, *rest = m->q0 + j->q;
    if (!(j->stiffness > 0)) continue;
    if (j->type == CAV_JOINT_FREE) {
      for (int k = 0; k < 3; k++) sum += 0.5 * j->stiffness * (at[k] - rest[k]) * (at[k] - rest[k]);
      sum += j->stiffness * turning_energy(at + 3, rest + 3);
    } else if (j->type == CAV_JOINT_BALL) {
      sum += j->stiffness * turning_energy(at, rest);
    } else {
      sum += 0.5 * j->stiffness * (at[0] - j->springref) * (at[0] - j->springref);
    }
  }
  for (int i = 0; i < m->ntendon; i++) {
    const double stretch = cav_tendon_stretch(&m->tendon[i], state->tendon_length[i]);
    sum += 0.5 * m->tendon[i].stiffness * stretch * stretch;
  }
  return sum;
}

// energy at (q, v), J; not finite where it cannot be said. matrix [nv*nv]
static double energy_of(cav_bench *b, const double *q, const double *v, double *kinetic, double *matrix) {
  const cav_model *m = b->model;
  if (cav_position(m, b->state, q) || cav_inertia(m, b->state, q, matrix)) return INFINITY;
  double sum = 0, all;
  for (int i = 0; i < m->nv; i++) {
    double row = 0;
    for (int j = 0; j < m->nv; j++) row += matrix[i * m->nv + j] * v[j];
    sum += 0.5 * v[i] * row;
  }
  all = sum;
  for (int i = 1; i < m->nbody && b->pushed.gravity; i++) {
    const cav_body *body = &m->body[i];
    cav_pose at;
    if (body->link == 0) continue;
    cav_object_pose(m, b->state, CAV_OBJECT_BODY, i, &at);
    const double mass = body->mass * (b->pushed.passive ? 1 - body->buoyancy : 1);
    // about where the scene stands, so that far away no digits are lost
    for (int k = 0; k < 3; k++) all -= mass * m->gravity[k] * (at.pos[k] - b->moved[k]);
  }
  if (b->pushed.passive) all += spring_energy(m, b->state, q);
  if (kinetic) *kinetic = sum;
  return all;
}

static cav_status measure_energy(cav_bench *b, int steps, cav_stress_point *p, cav_stress_trace *e, double *matrix) {
  const cav_model *m = b->model;
  double *q = b->scratch + 4 * m->nv, *v = b->v, *next = b->scratch, *none = b->scratch + m->nv, kinetic;
  if ((m->density > 0 || m->viscosity > 0) && (m->wind[0] != 0 || m->wind[1] != 0 || m->wind[2] != 0)) return CAV_OK;
  memcpy(q, b->q, (size_t)m->nq * sizeof *q);
  cav_configuration_normalise(m, q);
  memset(none, 0, (size_t)m->nv * sizeof *none);
  const double start = energy_of(b, q, v, &kinetic, matrix);
  double scale = kinetic + m->mass * b->gravity * b->size + DBL_MIN;
  if (b->pushed.passive) scale += spring_energy(m, b->state, q);
  double most = 0;
  int missed = 0;
  if (!isfinite(start) || !isfinite(scale)) {
    worsen(&p->measure[CAV_STRESS_ENERGY], INFINITY);
    return CAV_OK;
  }
  for (int t = 0; t < steps; t++) {
    cav_status status = step_forward(b, e, p, q, v, none, next);
    if (status == CAV_NO_MEMORY) return status;
    // a run that is refused on its way has exploded
    if (status == CAV_NOT_FINITE || !usable(e, "a step of a passive run", status, next, m->nv)) {
      worsen(&p->measure[CAV_STRESS_ENERGY], INFINITY);
      e->step = t + 1;
      return CAV_OK;
    }
    missed += status == CAV_NOT_CONVERGED;
    if (t < 3) e->rotation = fmax(e->rotation, largest_rotation(b, next));
    memcpy(v, next, (size_t)m->nv * sizeof *v);
    cav_integrate(m, q, v, b->pushed.timestep, q);
    const double gained = (energy_of(b, q, v, NULL, matrix) - start) / scale;
    if (!isfinite(gained) || gained > most) {
      most = isfinite(gained) ? gained : INFINITY;
      if (!(most <= p->measure[CAV_STRESS_ENERGY])) e->step = t + 1;
    }
    // what has exploded, or goes on from steps that are none, needs no more
    if (most > 1e6 || missed == MISSED_MOST) break;
  }
  worsen(&p->measure[CAV_STRESS_ENERGY], most);
  return CAV_OK;
}

cav_status cav_stress_measure_point(cav_bench *b, const cav_stress_effort *effort, cav_stress_point *p,
                                    cav_stress_trace *e) {
  const size_t n = (size_t)b->model->nv;
  for (int i = 0; i < CAV_STRESS_MEASURE_TYPES; i++) p->measure[i] = NAN;
  p->iterations = p->contacts = 0;
  *e = (cav_stress_trace){.dof = -1};
  double *matrix = malloc((3 * n * n + 1) * sizeof *matrix);
  cav_status status = matrix ? CAV_OK : CAV_NO_MEMORY;
  for (int k = 0; k < effort->samples && !status; k++) {
    const cav_status made = cav_bench_sample(b, k);
    if (made == CAV_NO_MEMORY) status = made;
    if (made) {
      if (!e->call) e->call = "the position stage", e->status = made;
      worsen(&p->measure[CAV_STRESS_ROUND_TRIP], INFINITY);
      continue;
    }
    e->rounding = hypot(b->moved[0], b->moved[1]) * DBL_EPSILON;
    status = measure_round_trip(b, p, e);
    if (!status) status = measure_derivative(b, k, effort->differences, p, e, matrix);
    if (!status) status = measure_energy(b, effort->steps, p, e, matrix);
    // what one sample breaks, others do not mend
    if (p->measure[CAV_STRESS_ENERGY] >= cav_stress_measure_rules[CAV_STRESS_ENERGY].bad) break;
    if (e->unsolved >= 2 * MISSED_MOST) break;
  }
  if (e->solves > 0) p->measure[CAV_STRESS_UNSOLVED] = (double)e->unsolved / e->solves;
  free(matrix);
  return status;
}
