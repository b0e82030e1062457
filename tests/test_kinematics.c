/// Kinematics, inertia and momentum by identities: frames are rotations, velocities are the derivatives of poses, M
/// from composite bodies is the M that Newton-Euler shows column by column, the sparse factorisation solves, kinetic
/// energy and momentum agree between their two definitions.
#include "scene.h"
#include "step.h"

static const cav_model *model;
static cav_state *state;
static double *q, *v, *v_next, *u;

static void random_state(void) {
  scene_posture(model, q, v, 0.7);
  scene_normals(v, model->nv, 1);
  scene_normals(v_next, model->nv, 1);
}

static void frames(void) {
  random_state();
  CHECK(cav_position(model, state, q) == CAV_OK);
  for (int i = 0; i < model->nlink; i++) {
    const double *R = state->link[i].rotation;
    for (int a = 0; a < 3; a++)
      for (int b = 0; b < 3; b++) {
        double dot = R[3 * a] * R[3 * b] + R[3 * a + 1] * R[3 * b + 1] + R[3 * a + 2] * R[3 * b + 2];
        // bound: rounding of unit rows through a chain of six joints; seen 7e-16
        CHECK_NEAR(dot, a == b, 1e-14);
      }
    double det =
        R[0] * (R[4] * R[8] - R[5] * R[7]) - R[1] * (R[3] * R[8] - R[5] * R[6]) + R[2] * (R[3] * R[7] - R[4] * R[6]);
    CHECK_NEAR(det, 1, 1e-14);
  }
}

// reading of a frame sensor of a body at (q, v_next)
static void sense(cav_sensor_type type, cav_object_type kind, int object, double *out) {
  cav_sensor sensor = {.name = "", .type = type, .object_type = kind, .object = object, .dim = 3};
  cav_sensor_read(model, state, &sensor, out);
}

// velocity sensors against centred differences of position sensors along v_next
static void velocities(void) {
  const double step = 1e-5;
  double *q1 = scene_vector(model->nq), before[3], after[3], rate[3], rates[3];
  static const cav_sensor_type pairs[][2] = {{CAV_SENSOR_FRAMEPOS, CAV_SENSOR_FRAMELINVEL},
                                             {CAV_SENSOR_SUBTREECOM, CAV_SENSOR_SUBTREELINVEL}};
  static const cav_object_type kinds[] = {CAV_OBJECT_BODY, CAV_OBJECT_XBODY};
  random_state();
  for (int body = 1; body < model->nbody; body++) {
    for (int k = 0; k < 4; k++) {
      cav_integrate(model, q, v_next, -step, q1);
      CHECK(cav_inverse(model, state, q1, v, v_next, u) == CAV_OK);
      sense(pairs[k / 2][0], kinds[k % 2], body, before);
      cav_integrate(model, q, v_next, step, q1);
      CHECK(cav_inverse(model, state, q1, v, v_next, u) == CAV_OK);
      sense(pairs[k / 2][0], kinds[k % 2], body, after);
      CHECK(cav_inverse(model, state, q, v, v_next, u) == CAV_OK);
      sense(pairs[k / 2][1], kinds[k % 2], body, rate);
      for (int i = 0; i < 3; i++) rates[i] = (after[i] - before[i]) / (2 * step);
      // bound: step^2 times third derivatives about 100, and rounding 1e-15/step; seen 1.3e-9
      CHECK_NEAR_ALL(rates, rate, 3, 2e-8);
    }
  }

  // angular velocity turns the axes of the frame
  for (int body = 1; body < model->nbody; body++) {
    double w[3], axis[3];
    for (int k = 0; k < 3; k++) {
      cav_sensor_type type = (cav_sensor_type)(CAV_SENSOR_FRAMEXAXIS + k);
      cav_integrate(model, q, v_next, -step, q1);
      cav_inverse(model, state, q1, v, v_next, u);
      sense(type, CAV_OBJECT_XBODY, body, before);
      cav_integrate(model, q, v_next, step, q1);
      cav_inverse(model, state, q1, v, v_next, u);
      sense(type, CAV_OBJECT_XBODY, body, after);
      cav_inverse(model, state, q, v, v_next, u);
      sense(type, CAV_OBJECT_XBODY, body, axis);
      sense(CAV_SENSOR_FRAMEANGVEL, CAV_OBJECT_XBODY, body, w);
      rate[0] = w[1] * axis[2] - w[2] * axis[1];
      rate[1] = w[2] * axis[0] - w[0] * axis[2];
      rate[2] = w[0] * axis[1] - w[1] * axis[0];
      for (int i = 0; i < 3; i++) rates[i] = (after[i] - before[i]) / (2 * step);
      CHECK_NEAR_ALL(rates, rate, 3, 2e-8);
    }
  }
  free(q1);
}

// columns of M by Newton-Euler: no constraints, gravity, springs or velocity, v_next = h e_j
static void inertia(void) {
  int nv = model->nv;
  double *M = scene_vector(nv * nv), *x = scene_vector(nv), *y = scene_vector(nv), worst = 0;
  cav_options all = state->options;
  random_state();
  for (int passive = 0; passive < 2; passive++) {
    state->options.constraint = state->options.gravity = 0;
    state->options.passive = passive;
    CHECK(cav_inertia(model, state, q, M) == CAV_OK);
    memset(v, 0, (size_t)nv * sizeof *v);
    memset(v_next, 0, (size_t)nv * sizeof *v);
    double *rest = scene_vector(nv);
    CHECK(cav_inverse(model, state, q, v, v, rest) == CAV_OK);
    for (int j = 0; j < nv; j++) {
      v_next[j] = model->timestep;
      CHECK(cav_inverse(model, state, q, v, v_next, u) == CAV_OK);
      v_next[j] = 0;
      for (int i = 0; i < nv; i++) {
        // bound: rounding against the largest entries, about 200; seen 2e-15
        CHECK_NEAR(u[i] - rest[i], M[i * nv + j], 1e-13);
        CHECK(M[i * nv + j] == M[j * nv + i]);
        worst = fmax(worst, fabs(u[i] - rest[i] - M[i * nv + j]));
      }
    }
    free(rest);
  }
  printf("M by columns: largest difference %.2g\n", worst);

  // positive definite, and the sparse factors solve
  cav_workspace *w = state->work;
  cav_inertia(model, state, q, M);
  for (int i = 0; i < nv; i++) w->M[w->row[i]] += cav_added_inertia(model, state, i);
  CHECK(cav_ldl_factor(model, w, w->M, w->L));
  for (int k = 0; k < 20; k++) {
    double energy = 0;
    scene_normals(x, nv, 1);
    for (int i = 0; i < nv; i++) {
      y[i] = 0;
      for (int j = 0; j < nv; j++) y[i] += M[i * nv + j] * x[j];
      energy += x[i] * y[i];
    }
    CHECK(energy > 0);
    cav_ldl_solve(model, w, w->L, y);
    // bound: condition number about 1e4; seen 5e-15
    CHECK(scene_error(y, x, nv) < 1e-12);
  }
  // control: a matrix that is not positive definite is refused
  w->M[w->row[nv - 1]] = -1;
  CHECK(!cav_ldl_factor(model, w, w->M, w->L));
  state->options = all;
  free(M), free(x), free(y);
}

// v'Mv/2 without armature against the sum over links; momentum against its differences and sensors
static void energy_and_momentum(void) {
  int nv = model->nv;
  double *M = scene_vector(nv * nv), *q1 = scene_vector(model->nq);
  cav_options all = state->options;
  state->options.passive = 0;
  random_state();
  CHECK(cav_inertia(model, state, q, M) == CAV_OK);
  double by_matrix = 0, by_links = 0;
  for (int i = 0; i < nv; i++) {
    for (int j = 0; j < nv; j++) by_matrix += 0.5 * v[i] * M[i * nv + j] * v[j];
    by_matrix -= 0.5 * model->dof[i].armature * v[i] * v[i];
  }
  cav_inverse(model, state, q, v, v, u);
  for (int i = 1; i < model->nlink; i++) {
    const double *V = state->velocity + 6 * i, *I = state->inertia + 6 * i, *c = state->com + 3 * i;
    const double *r = state->reference + 3 * i;
    double d[3] = {c[0] - r[0], c[1] - r[1], c[2] - r[2]};
    double s[3] = {V[3] + V[1] * d[2] - V[2] * d[1], V[4] + V[2] * d[0] - V[0] * d[2],
                   V[5] + V[0] * d[1] - V[1] * d[0]};
    by_links += 0.5 * model->link[i].mass * (s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
    by_links += 0.5 * (I[0] * V[0] * V[0] + I[1] * V[1] * V[1] + I[2] * V[2] * V[2]) + I[3] * V[0] * V[1] +
                I[4] * V[0] * V[2] + I[5] * V[1] * V[2];
  }
  // bound: rounding of sums about 100; seen 2e-16 relative
  CHECK_NEAR(by_links, by_matrix, 1e-12 * by_matrix);

  double com[3], rate[3], spin[3], sensed[3], before[3], after[3];
  cav_momentum(model, state, v, com, rate, spin);
  sense(CAV_SENSOR_SUBTREECOM, CAV_OBJECT_BODY, 0, sensed);
  CHECK_NEAR_ALL(sensed, com, 3, 1e-14);
  sense(CAV_SENSOR_SUBTREELINVEL, CAV_OBJECT_BODY, 0, sensed);
  CHECK_NEAR_ALL(sensed, rate, 3, 1e-14);
  sense(CAV_SENSOR_SUBTREEANGMOM, CAV_OBJECT_BODY, 0, sensed);
  // bound: rounding of sums about 100; seen 1.3e-14
  CHECK_NEAR_ALL(sensed, spin, 3, 1e-12);
  cav_integrate(model, q, v, -1e-5, q1);
  cav_position(model, state, q1);
  cav_momentum(model, state, v, before, NULL, NULL);
  cav_integrate(model, q, v, 1e-5, q1);
  cav_position(model, state, q1);
  cav_momentum(model, state, v, after, NULL, NULL);
  // bound: 1e-10 times third derivatives, rounding 1e-16/1e-5; seen 3e-11
  for (int i = 0; i < 3; i++) CHECK_NEAR((after[i] - before[i]) / 2e-5, rate[i], 1e-9);
  state->options = all;
  free(M), free(q1);
}

static void bad_input(void) {
  random_state();
  double kept = q[7];
  q[7] = NAN;
  CHECK(cav_position(model, state, q) == CAV_NOT_FINITE);
  CHECK(cav_inverse(model, state, q, v, v_next, u) == CAV_NOT_FINITE);
  q[7] = INFINITY;
  CHECK(cav_inertia(model, state, q, u) == CAV_NOT_FINITE);
  q[7] = kept;
  CHECK(cav_position(model, state, q) == CAV_OK);
  cav_state_free(NULL);
}

int main(void) {
  cav_model *loaded = scene_load(scene_joints);
  CHECK(loaded != NULL);
  if (!loaded) return check_result();
  model = loaded;
  state = cav_state_new(model);
  q = scene_vector(model->nq), v = scene_vector(model->nv), v_next = scene_vector(model->nv);
  u = scene_vector(model->nv);
  frames();
  velocities();
  inertia();
  energy_and_momentum();
  bad_input();
  cav_state_free(state);
  cav_model_free(loaded);
  free(q), free(v), free(v_next), free(u);
  return check_result();
}
