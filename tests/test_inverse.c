/// The inverse by identities: Newton-Euler is linear in the acceleration with M as its matrix; power balance; stages
/// give the same bits as one call; the midpoint order; springs as gradients of their energy; limits, friction loss and
/// contacts at rest, at saturation and between free bodies; discrete stabilisation; smoothing towards the exact law,
/// which fades without a jump; bad numbers.
#include <malloc.h>

#include "scene.h"
#include "step.h"

/// One model with a state and vectors for it.
typedef struct bench {
  cav_model *model;
  cav_state *state;
  double *q, *v, *v_next, *u;
} bench;

static bench open_bench(const char *text) {
  bench b = {.model = scene_load(text)};
  CHECK(b.model != NULL);
  if (!b.model) exit(check_result());
  b.state = cav_state_new(b.model);
  b.q = scene_vector(b.model->nq), b.v = scene_vector(b.model->nv);
  b.v_next = scene_vector(b.model->nv), b.u = scene_vector(b.model->nv);
  cav_configuration_reset(b.model, b.q);
  return b;
}

static void close_bench(bench *b) {
  cav_state_free(b->state);
  cav_model_free(b->model);
  free(b->q), free(b->v), free(b->v_next), free(b->u);
}

static void random_state(bench *b) {
  scene_posture(b->model, b->q, b->u, 0.7);
  scene_normals(b->v, b->model->nv, 1);
  for (int i = 0; i < b->model->nv; i++) b->v_next[i] = b->v[i] + b->model->timestep * 5 * scene_normal();
}

static cav_status run(bench *b) { return cav_inverse(b->model, b->state, b->q, b->v, b->v_next, b->u); }

// u(v_next) - u(v) = M a, and u(v) does not depend on how it is reached
static void linear_in_acceleration(bench *b) {
  int nv = b->model->nv;
  double *M = scene_vector(nv * nv), *rest = scene_vector(nv), *x = scene_vector(nv);
  b->state->options.constraint = 0;
  for (int k = 0; k < 50; k++) {
    random_state(b);
    CHECK(cav_inverse(b->model, b->state, b->q, b->v, b->v, rest) == CAV_OK);
    CHECK(run(b) == CAV_OK);
    memcpy(x, b->u, (size_t)nv * sizeof *x);
    CHECK(cav_inertia(b->model, b->state, b->q, M) == CAV_OK);
    for (int i = 0; i < nv; i++) {
      double sum = rest[i];
      for (int j = 0; j < nv; j++) sum += M[i * nv + j] * (b->v_next[j] - b->v[j]) / b->model->timestep;
      // bound: rounding against forces of about 1e3; seen 7e-13
      CHECK_NEAR(x[i], sum, 1e-10);
    }
  }
  b->state->options.constraint = 1;
  free(M), free(rest), free(x);
}

// kinetic and gravity energy of all links
static double energy(bench *b, const double *q, const double *v) {
  double sum = 0;
  cav_inverse(b->model, b->state, q, v, v, b->u);
  for (int i = 1; i < b->model->nlink; i++) {
    const double *V = b->state->velocity + 6 * i, *I = b->state->inertia + 6 * i, *c = b->state->com + 3 * i;
    const double *r = b->state->reference + 3 * i, *g = b->model->gravity;
    double d[3] = {c[0] - r[0], c[1] - r[1], c[2] - r[2]}, m = b->model->link[i].mass;
    double s[3] = {V[3] + V[1] * d[2] - V[2] * d[1], V[4] + V[2] * d[0] - V[0] * d[2],
                   V[5] + V[0] * d[1] - V[1] * d[0]};
    sum += 0.5 * m * (s[0] * s[0] + s[1] * s[1] + s[2] * s[2]) - m * (g[0] * c[0] + g[1] * c[1] + g[2] * c[2]);
    sum += 0.5 * (I[0] * V[0] * V[0] + I[1] * V[1] * V[1] + I[2] * V[2] * V[2]) + I[3] * V[0] * V[1] +
           I[4] * V[0] * V[2] + I[5] * V[1] * V[2];
  }
  for (int i = 0; i < b->model->nv; i++) sum += 0.5 * b->model->dof[i].armature * v[i] * v[i];
  return sum;
}

// v . u = dE/dt along q' = v, v' = a, without springs, dampers and constraints
static void power_balance(bench *b) {
  int nv = b->model->nv;
  const double t = 1e-5;
  double *q1 = scene_vector(b->model->nq), *move = scene_vector(nv), *v1 = scene_vector(nv), worst = 0;
  b->state->options.constraint = b->state->options.passive = 0;
  for (int k = 0; k < 20; k++) {
    random_state(b);
    double power = 0, change = 0;
    CHECK(run(b) == CAV_OK);
    for (int i = 0; i < nv; i++) power += b->u[i] * b->v[i];
    for (int side = -1; side <= 1; side += 2) {
      for (int i = 0; i < nv; i++) {
        double a = (b->v_next[i] - b->v[i]) / b->model->timestep;
        v1[i] = b->v[i] + side * t * a;
        move[i] = b->v[i] + 0.5 * side * t * a;
      }
      cav_integrate(b->model, b->q, move, side * t, q1);
      change += side * energy(b, q1, v1) / (2 * t);
    }
    // bound: t^2 times third derivatives, rounding 1e3 * 1e-16 / t; seen 1e-6 of powers up to 2,500
    CHECK_NEAR(change, power, 1e-6 * (1 + fabs(power)));
    worst = fmax(worst, fabs(change - power));
  }
  printf("power balance: largest difference %.2g W\n", worst);
  b->state->options.constraint = b->state->options.passive = 1;
  free(q1), free(move), free(v1);
}

// linear and angular momentum about the origin of the links of one tree
static void tree_momentum(bench *b, int root, const double *q, const double *v, double out[6]) {
  memset(out, 0, 6 * sizeof *out);
  cav_inverse(b->model, b->state, q, v, v, b->u);
  for (int i = root; i < b->model->nlink; i++) {
    if (b->model->link[i].root != root) continue;
    const double *V = b->state->velocity + 6 * i, *I = b->state->inertia + 6 * i, *c = b->state->com + 3 * i;
    const double *r = b->state->reference + 3 * i;
    double d[3] = {c[0] - r[0], c[1] - r[1], c[2] - r[2]}, m = b->model->link[i].mass;
    double p[3] = {m * (V[3] + V[1] * d[2] - V[2] * d[1]), m * (V[4] + V[2] * d[0] - V[0] * d[2]),
                   m * (V[5] + V[0] * d[1] - V[1] * d[0])};
    for (int k = 0; k < 3; k++) out[k] += p[k];
    out[3] += I[0] * V[0] + I[3] * V[1] + I[4] * V[2] + c[1] * p[2] - c[2] * p[1];
    out[4] += I[3] * V[0] + I[1] * V[1] + I[5] * V[2] + c[2] * p[0] - c[0] * p[2];
    out[5] += I[4] * V[0] + I[5] * V[1] + I[2] * V[2] + c[0] * p[1] - c[1] * p[0];
  }
}

// force and moment on a free root = rate of momentum of its tree: sees the forces that do no work, too
static void momentum_balance(bench *b) {
  int nv = b->model->nv, root = 1;
  const double t = 1e-5;
  double *q1 = scene_vector(b->model->nq), *move = scene_vector(nv), *v1 = scene_vector(nv), u[6], p[6];
  CHECK(b->model->joint[b->model->link[root].joint].type == CAV_JOINT_FREE);
  b->state->options.constraint = b->state->options.passive = b->state->options.gravity = 0;
  for (int k = 0; k < 20; k++) {
    double rate[6] = {0};
    random_state(b);
    CHECK(run(b) == CAV_OK);
    memcpy(u, b->u, sizeof u);
    const double *R = b->state->link[root].rotation, *x = b->q;
    double moment[3];
    for (int i = 0; i < 3; i++) {
      int j = (i + 1) % 3, l = (i + 2) % 3;
      moment[i] = R[3 * i] * u[3] + R[3 * i + 1] * u[4] + R[3 * i + 2] * u[5] + x[j] * u[l] - x[l] * u[j];
    }
    for (int side = -1; side <= 1; side += 2) {
      for (int i = 0; i < nv; i++) {
        double a = (b->v_next[i] - b->v[i]) / b->model->timestep;
        v1[i] = b->v[i] + side * t * a;
        move[i] = b->v[i] + 0.5 * side * t * a;
      }
      cav_integrate(b->model, b->q, move, side * t, q1);
      tree_momentum(b, root, q1, v1, p);
      for (int i = 0; i < 6; i++) rate[i] += side * p[i] / (2 * t);
    }
    for (int i = 0; i < 3; i++) {
      // bound: t^2 times third derivatives, rounding 1e2 * 1e-16 / t; seen 8e-7 of forces about 1e3
      CHECK_NEAR(rate[i], u[i], 1e-6 * (1 + scene_norm(u, 3)));
      CHECK_NEAR(rate[3 + i], moment[i], 1e-6 * (1 + scene_norm(moment, 3)));
    }
  }
  b->state->options.constraint = b->state->options.passive = b->state->options.gravity = 1;
  free(q1), free(move), free(v1);
}

// cav_inverse_from reuses, and its bits are those of one full call
static void stages(bench *b) {
  int nv = b->model->nv;
  double *whole = scene_vector(nv);
  for (int k = 0; k < 40; k++) {
    b->state->options.order = (cav_order)(k % 3);
    random_state(b);
    CHECK(run(b) == CAV_OK);
    scene_normals(b->v_next, nv, 1);
    CHECK(cav_inverse_from(b->model, b->state, CAV_STAGE_VELOCITY, b->q, b->v, b->v_next, b->u) == CAV_OK);
    CHECK(run(b) == CAV_OK);
    memcpy(whole, b->u, (size_t)nv * sizeof *whole);
    cav_inverse_from(b->model, b->state, CAV_STAGE_VELOCITY, b->q, b->v, b->v_next, b->u);
    CHECK(!memcmp(whole, b->u, (size_t)nv * sizeof *whole));
    scene_normals(b->v, nv, 1);
    CHECK(cav_inverse_from(b->model, b->state, CAV_STAGE_POSITION, b->q, b->v, b->v_next, b->u) == CAV_OK);
    memcpy(whole, b->u, (size_t)nv * sizeof *whole);
    CHECK(run(b) == CAV_OK);
    CHECK(!memcmp(whole, b->u, (size_t)nv * sizeof *whole));
  }
  // a change of options is noticed
  b->state->options.order = CAV_ORDER_EULER;
  CHECK(run(b) == CAV_OK);
  b->state->options.timestep *= 2;
  b->state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  b->state->options.softness = 0.1;
  CHECK(cav_inverse_from(b->model, b->state, CAV_STAGE_VELOCITY, b->q, b->v, b->v_next, b->u) == CAV_OK);
  memcpy(whole, b->u, (size_t)nv * sizeof *whole);
  CHECK(run(b) == CAV_OK);
  CHECK(!memcmp(whole, b->u, (size_t)nv * sizeof *whole));
  b->state->options = b->model->options;
  b->state->options.timestep = b->model->timestep;
  free(whole);
}

// midpoint = euler with the bias taken at the mean velocity, but for what damping h a / 2 more or less does
static void midpoint(bench *b) {
  int nv = b->model->nv;
  double *mean = scene_vector(nv), *next = scene_vector(nv), *by_mean = scene_vector(nv), h = b->model->timestep;
  b->state->options.constraint = 0;
  for (int k = 0; k < 20; k++) {
    random_state(b);
    for (int i = 0; i < nv; i++) {
      mean[i] = 0.5 * (b->v[i] + b->v_next[i]);
      next[i] = mean[i] + b->v_next[i] - b->v[i];
    }
    b->state->options.order = CAV_ORDER_EULER;
    cav_inverse(b->model, b->state, b->q, mean, next, by_mean);
    b->state->options.order = CAV_ORDER_MIDPOINT;
    CHECK(run(b) == CAV_OK);
    for (int i = 0; i < nv; i++) {
      by_mean[i] -= b->model->dof[i].damping * (next[i] - mean[i]);
      // bound: rounding of forces about 1e3 with a = dv/h; seen 7e-12
      CHECK_NEAR(b->u[i], by_mean[i], 1e-10);
    }
  }
  (void)h;
  b->state->options.order = CAV_ORDER_EULER;
  b->state->options.constraint = 1;
  free(mean), free(next), free(by_mean);
}

// energy of all springs, from the model alone
static double spring_energy(const cav_model *model, const double *q) {
  double sum = 0, *turn = scene_vector(model->nv);
  cav_difference(model, model->q0, q, 1, turn);
  for (int i = 0; i < model->njoint; i++) {
    const cav_joint *joint = &model->joint[i];
    int n = joint->type == CAV_JOINT_FREE ? 6 : 3;
    double x = q[joint->q] - joint->springref, square = x * x;
    if (joint->type == CAV_JOINT_FREE || joint->type == CAV_JOINT_BALL) {
      square = scene_norm(turn + joint->dof, n) * scene_norm(turn + joint->dof, n);
    }
    sum += 0.5 * joint->stiffness * square;
  }
  for (int i = 0; i < model->ntendon; i++) {
    const cav_tendon *tendon = &model->tendon[i];
    double length = 0;
    for (int k = 0; k < tendon->npart; k++) {
      const cav_tendon_part *part = &model->tendon_part[tendon->part + k];
      length += part->coef * q[model->joint[part->joint].q];
    }
    double stretch = length - tendon->springlength[0];
    CHECK(tendon->springlength[0] == tendon->springlength[1]);
    sum += 0.5 * tendon->stiffness * stretch * stretch;
  }
  free(turn);
  return sum;
}

static void springs(bench *b) {
  int nv = b->model->nv;
  double *q1 = scene_vector(b->model->nq), *without = scene_vector(nv);
  b->state->options.constraint = 0;
  memset(b->v, 0, (size_t)nv * sizeof *b->v);
  for (int k = 0; k < 20; k++) {
    scene_posture(b->model, b->q, b->u, 0.4);
    b->state->options.passive = 0;
    cav_inverse(b->model, b->state, b->q, b->v, b->v, without);
    b->state->options.passive = 1;
    cav_inverse(b->model, b->state, b->q, b->v, b->v, b->u);
    for (int i = 0; i < nv; i++) {
      double change = 0;
      for (int side = -1; side <= 1; side += 2) {
        memcpy(q1, b->q, (size_t)b->model->nq * sizeof *q1);
        cav_configuration_perturb(b->model, i, side * 1e-5, q1);
        change += side * spring_energy(b->model, q1) / 2e-5;
      }
      // bound: 1e-10 times third derivatives and rounding of energies about 10; seen 1.1e-10
      CHECK_NEAR(b->u[i] - without[i], change, 1e-8);
    }
  }
  b->state->options.constraint = 1;
  free(q1), free(without);
}

// dist of a limit decreases along its axis; a limit well violated pushes inwards
static void limits(bench *b) {
  double *q1 = scene_vector(b->model->nq), before[64];
  int seen = 0;
  for (int k = 0; k < 30; k++) {
    random_state(b);
    CHECK(run(b) == CAV_OK);
    int nrow = b->state->nrow;
    CHECK(nrow <= 64);
    for (int i = 0; i < nrow; i++) before[i] = b->state->row[i].velocity_next;
    double *dist = scene_vector(nrow);
    for (int side = -1; side <= 1; side += 2) {
      cav_integrate(b->model, b->q, b->v_next, side * 1e-6, q1);
      CHECK(cav_position(b->model, b->state, q1) == CAV_OK);
      if (b->state->nrow != nrow) break;
      for (int i = 0; i < nrow; i++) dist[i] += side * b->state->row[i].dist / 2e-6;
      if (side < 0) continue;
      for (int i = 0; i < nrow; i++) {
        if (b->state->row[i].type > CAV_ROW_LIMIT_TENDON) continue;
        // bound: rounding 1e-16/1e-6 and curvature of the ball's angle; seen 3e-10
        CHECK_NEAR(dist[i], before[i], 1e-8);
        seen++;
      }
    }
    free(dist);
  }
  CHECK(seen > 30);
  free(q1);
}

// friction loss saturates at the loss, both ways
static void friction_loss(bench *b) {
  int nv = b->model->nv, k = 0;
  while (k < nv && !(b->model->dof[k].frictionloss > 0)) k++;
  CHECK(k < nv);
  for (int sign = -1; sign <= 1 && k < nv; sign += 2) {
    cav_configuration_reset(b->model, b->q);
    memset(b->v, 0, (size_t)nv * sizeof *b->v);
    memset(b->v_next, 0, (size_t)nv * sizeof *b->v);
    b->v[k] = b->v_next[k] = sign * 3;
    CHECK(run(b) == CAV_OK);
    int found = 0;
    for (int i = 0; i < b->state->nrow; i++) {
      const cav_row *row = &b->state->row[i];
      if (row->type != CAV_ROW_FRICTION_DOF || row->object != k) continue;
      found = 1;
      CHECK_NEAR(row->impulse, -sign * b->model->timestep * b->model->dof[k].frictionloss, 0);
    }
    CHECK(found);
  }
}

static const char ball_on_floor[] =
    "<mujoco><option timestep='0.002'/><worldbody><geom type='plane' size='1 1 1' solref='.02 1' solimp='.9 .9 .001'/>"
    "<body pos='0 0 .1'><freejoint/><geom type='sphere' size='.1' mass='%g' solref='.02 1' solimp='.9 .9 .001'/></body>"
    "</worldbody></mujoco>";

// at rest the depth is eps kappa^2 g/(1 + eps), whatever the mass; the impulse is m g h
static void rest_depth(void) {
  static const double masses[] = {0.01, 1, 100};
  for (int k = 0; k < 6; k++) {
    char text[600];
    double mass = masses[k % 3], h = 0.002, kappa = 0.02;
    snprintf(text, sizeof text, ball_on_floor, mass);
    bench b = open_bench(text);
    // impedance 0.9 everywhere: eps = 1/9
    double eps = 1.0 / 0.9 - 1, depth = eps * kappa * kappa * 9.81 / (1 + eps);
    if (k >= 3) {
      // discrete: eps A f = -h K x with f = m g h and hhK = (1 + eps)(1 - z)^2
      double z = exp(-h / kappa);
      b.state->options.stabilisation = CAV_STABILISATION_DISCRETE;
      b.state->options.softness = eps;
      b.state->options.time_constant = kappa;
      depth = eps * 9.81 * h * h / ((1 + eps) * (1 - z) * (1 - z));
    }
    b.q[2] = 0.1 - depth;
    CHECK(run(&b) == CAV_OK);
    CHECK(b.state->ncontact == 1);
    if (b.state->ncontact == 1) {
      // bound: rounding of 0.1 - depth - 0.1 relative to a depth of 4e-4; seen 3e-14 of m g
      CHECK_NEAR(b.state->contact[0].impulse[0], mass * 9.81 * h, 1e-13 * mass);
      CHECK_NEAR(b.u[2], 0, 1e-11 * mass);
    }
    // control: half of that depth does not carry the weight
    b.q[2] = 0.1 - depth / 2;
    CHECK(run(&b) == CAV_OK);
    CHECK(fabs(b.u[2]) > 4 * mass);
    close_bench(&b);
  }
}

// the discrete law's free row, v' = v*, x' = x + h v': both eigenvalues are exp(-h/kappa) as eps -> 0
static void double_pole(void) {
  static const double kappas[] = {0, 1e-4, 0.002, 0.02, 0.5};
  char text[600];
  snprintf(text, sizeof text, ball_on_floor, 1.0);
  bench b = open_bench(text);
  double h = b.model->timestep;
  b.q[2] = 0.099;
  b.state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  b.state->options.softness = 1e-12;
  for (int k = 0; k < 5; k++) {
    b.state->options.time_constant = kappas[k];
    CHECK(run(&b) == CAV_OK && b.state->ncontact == 1);
    const cav_contact *c = &b.state->contact[0];
    // (x, v) -> (x + h v', v'), v' = (1 - hB) v - hK x
    double trace = 1 - h * c->stiffness + 1 - c->damping[0], det = 1 - c->damping[0];
    double z = kappas[k] > 0 ? exp(-h / kappas[k]) : 0;
    // bound: eps and rounding; seen 2e-12
    CHECK_NEAR(trace, 2 * z, 1e-11);
    CHECK_NEAR(det, z * z, 1e-11);
  }
  close_bench(&b);
}

static const char two_balls[] =
    "<mujoco><option timestep='0.002' gravity='0 0 0'/><worldbody>"
    "<body pos='0 0 1'><freejoint/><geom type='sphere' size='.1' condim='6' friction='.8 .02 .01'/></body>"
    "<body pos='.19 .02 1.03'><freejoint/><geom type='sphere' size='.12' pos='.01 0 0' condim='6' friction='.8 .02 "
    ".01'/>"
    "</body></worldbody></mujoco>";

// contact between free bodies leaves their joint momentum alone: forces and moments about the origin cancel
static void action_and_reaction(void) {
  bench b = open_bench(two_balls);
  double force[3] = {0}, moment[3] = {0};
  scene_normals(b.v, b.model->nv, 1);
  scene_normals(b.v_next, b.model->nv, 1);
  double size = 0;
  for (int with = 0; with < 2; with++) {
    b.state->options.contact = with;
    CHECK(run(&b) == CAV_OK);
    CHECK(b.state->ncontact == with);
    for (int k = 0; k < 2; k++) {
      const double *p = b.state->link[1 + k].pos, *R = b.state->link[1 + k].rotation, *f = b.u + 6 * k, *t = f + 3;
      double s = with ? 1 : -1;
      for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, l = (i + 2) % 3;
        force[i] += s * f[i];
        moment[i] += s * (R[3 * i] * t[0] + R[3 * i + 1] * t[1] + R[3 * i + 2] * t[2] + p[j] * f[l] - p[l] * f[j]);
        size += fabs(s * f[i]);
      }
    }
  }
  CHECK(size > 1);
  for (int i = 0; i < 3; i++) {
    // bound: rounding of forces about 1e4 N; seen 5e-17 relative
    CHECK_NEAR(force[i], 0, 1e-14 * size);
    CHECK_NEAR(moment[i], 0, 1e-14 * size);
  }
  close_bench(&b);
}

// the smoothed law: off the kink it is the exact one but for exp(-lambda/sigma); on it, sigma log 2; active at a
// distance
static void smoothing(void) {
  bench b = open_bench(two_balls);
  cav_options *o = &b.state->options;
  double *exact = scene_vector(b.model->nv), last = INFINITY;
  scene_normals(b.v, b.model->nv, 0.1);
  scene_normals(b.v_next, b.model->nv, 0.1);
  CHECK(run(&b) == CAV_OK);
  memcpy(exact, b.u, (size_t)b.model->nv * sizeof *exact);
  for (double delta = 1e-2; delta > 1e-4; delta /= 2) {
    o->smoothing = o->smoothing_self = delta;
    CHECK(run(&b) == CAV_OK);
    double error = scene_error(b.u, exact, b.model->nv);
    CHECK(error <= last / 2 || error < 1e-14);
    last = error;
  }
  // 2 to 3 cm deep, so nothing is left at a tenth of a millimetre; seen 1.1e-3 at 1 cm, 0 here
  CHECK(last < 1e-14);

  // just touching, at rest: the impulse is sigma log 2 in the scale of the law, proportional to delta
  b.q[7] = 0.21, b.q[8] = 0, b.q[9] = 1;
  memset(b.v, 0, 12 * sizeof *b.v);
  for (double delta = 1e-2; delta > 1e-7; delta /= 10) {
    o->smoothing = o->smoothing_self = delta;
    CHECK(cav_inverse(b.model, b.state, b.q, b.v, b.v, b.u) == CAV_OK && b.state->ncontact == 1);
    const cav_contact *c = &b.state->contact[0];
    double expected = c->stiffness * delta / c->regulariser[0] * log(2);
    // bound: a gap that is zero to 3e-17 m, relative to delta; seen 2e-16
    CHECK_NEAR(c->impulse[0] / expected, 1, 1e-10);
  }

  // apart by less than the smoothing, the smoothed law is active and the exact one is not
  b.q[7] = 0.22;
  o->smoothing = o->smoothing_self = 0.01;
  CHECK(cav_inverse(b.model, b.state, b.q, b.v, b.v, b.u) == CAV_OK);
  CHECK(scene_norm(b.u, b.model->nv) > 0);
  o->smoothing = 0;
  CHECK(cav_inverse(b.model, b.state, b.q, b.v, b.v, b.u) == CAV_OK);
  CHECK(scene_norm(b.u, b.model->nv) == 0);
  free(exact);
  close_bench(&b);
}

// moving everything along with the free root changes nothing
static void far_away(bench *b) {
  double *here = scene_vector(b->model->nv);
  for (int k = 0; k < 10; k++) {
    random_state(b);
    b->state->options.passive = 0;
    CHECK(run(b) == CAV_OK);
    memcpy(here, b->u, (size_t)b->model->nv * sizeof *here);
    b->q[0] += 1000;
    CHECK(run(b) == CAV_OK);
    // bound: positions lose 1e-13 at a kilometre, times 1e3 m of lever cancelled; seen 3e-14 relative
    CHECK(scene_error(b->u, here, b->model->nv) < 1e-12);
  }
  b->state->options.passive = 1;
  free(here);
}

static void bad_numbers(bench *b) {
  static const double bad[] = {NAN, INFINITY, -INFINITY};
  int nv = b->model->nv;
  double *good = scene_vector(nv);
  random_state(b);
  CHECK(run(b) == CAV_OK);
  memcpy(good, b->u, (size_t)nv * sizeof *good);
  for (int k = 0; k < 3; k++) {
    for (int i = 0; i < nv; i++) {
      double *x[] = {&b->v[i], &b->v_next[i], &b->q[i]};
      for (int j = 0; j < 3; j++) {
        double kept = *x[j];
        *x[j] = bad[k];
        CHECK(run(b) == CAV_NOT_FINITE);
        CHECK(!memcmp(b->u, good, (size_t)nv * sizeof *good));
        *x[j] = kept;
      }
    }
  }
  // the state is as good as before
  CHECK(run(b) == CAV_OK);
  CHECK(!memcmp(b->u, good, (size_t)nv * sizeof *good));
  // stages that do not hold any more are recomputed, not believed
  cav_inertia(b->model, b->state, b->model->q0, (double[64 * 64]){0});
  CHECK(cav_inverse_from(b->model, b->state, CAV_STAGE_VELOCITY, b->q, b->v, b->v_next, b->u) == CAV_OK);
  CHECK(!memcmp(b->u, good, (size_t)nv * sizeof *good));
  free(good);
}

// after the first call nothing is allocated (the C library's own count; a sanitizer's is always zero)
static void no_allocation(bench *b) {
  random_state(b);
  run(b);
  struct mallinfo2 before = mallinfo2();
  for (int k = 0; k < 100; k++) { CHECK(run(b) == CAV_OK); }
  struct mallinfo2 after = mallinfo2();
  CHECK(before.uordblks == after.uordblks);
}

// f += T control, from the model alone
static void transmit(const cav_model *model, const double *control, double *f) {
  for (int i = 0; i < model->nactuator; i++) {
    const cav_actuator *a = &model->actuator[i];
    if (a->transmission == CAV_TRANSMISSION_JOINT) {
      f[model->joint[a->target].dof] += a->unit * a->gear[0] * control[i];
      continue;
    }
    const cav_tendon *tendon = &model->tendon[a->target];
    for (int k = 0; k < tendon->npart; k++) {
      const cav_tendon_part *part = &model->tendon_part[tendon->part + k];
      f[model->joint[part->joint].dof] += a->unit * a->gear[0] * part->coef * control[i];
    }
  }
}

// projection on what actuators can give: overlapping columns, least-norm controls
static void actuation(bench *b) {
  int nv = b->model->nv, nu = b->model->nactuator;
  double *residual = scene_vector(nv), *again = scene_vector(nv), *control = scene_vector(nu);
  scene_normals(b->u, nv, 1);
  cav_actuation(b->model, b->state, b->u, residual, control);
  memcpy(again, residual, (size_t)nv * sizeof *again);
  transmit(b->model, control, again);
  // bounds here and below: rounding of numbers about 1 through a 4 x 4 pseudo-inverse; seen 2e-15
  CHECK_NEAR_ALL(again, b->u, nv, 1e-13);
  // what is left has no actuated part, and is orthogonal to every column
  cav_actuation(b->model, b->state, residual, again, control);
  CHECK_NEAR_ALL(again, residual, nv, 1e-13);
  for (int i = 0; i < nu; i++) CHECK_NEAR(control[i], 0, 1e-13);
  double dot = 0;
  for (int i = 0; i < nv; i++) dot += residual[i] * (b->u[i] - residual[i]);
  CHECK_NEAR(dot, 0, 1e-12);
  cav_actuation(b->model, b->state, b->u, NULL, NULL);

  // two motors on one joint share the work: less than either alone
  int joint = cav_object_find(b->model, CAV_OBJECT_JOINT, "s");
  CHECK(joint >= 0);
  if (joint >= 0) {
    memset(b->u, 0, (size_t)nv * sizeof *b->u);
    b->u[b->model->joint[joint].dof] = 1;
    cav_actuation(b->model, b->state, b->u, residual, control);
    CHECK_NEAR(scene_norm(residual, nv), 0, 1e-13);
    // gears 2 and 4 alone would give sqrt(1/20); the tendon's motor and its opponents cannot make it larger
    CHECK(scene_norm(control, nu) <= sqrt(0.05) + 1e-13 && scene_norm(control, nu) > 0.1);
  }
  free(residual), free(again), free(control);
}

// largest change of u between neighbours of a sweep of one coordinate, over the largest u; derivatives on the way
static double largest_jump(bench *b, double from, double to, double speed) {
  enum { STEPS = 4000 };
  double step = (to - from) / STEPS, before = 0, jump = 0, most = 0, derivative[3] = {0};
  for (int k = 0; k <= STEPS; k++) {
    b->q[0] = from + k * step;
    b->v_next[0] = b->v[0] = speed;
    CHECK(run(b) == CAV_OK);
    double now = b->u[0];
    if (k > 0) jump = fmax(jump, fabs(now - before));
    most = fmax(most, fabs(now));
    before = now;
    if (k % 200) continue;
    double dq[9], dv[9], dn[9];
    CHECK(cav_derivatives(b->model, b->state, dq, dv, dn) == CAV_OK);
    for (int side = 0; side < 2; side++) {
      b->q[0] = from + k * step + (side ? 1e-6 : -1e-6);
      CHECK(run(b) == CAV_OK);
      derivative[side] = b->u[0];
    }
    // bound: truncation of the difference against the curvature of what fades; seen 2e-8, and 1e-4 where all is small
    CHECK_NEAR(dq[0], (derivative[1] - derivative[0]) / 2e-6, 1e-6 * fabs(dq[0]) + 1e-3);
  }
  return jump / most;
}

// the smoothed law does not jump where a contact enters the list faster than its activation distance foresees, nor
// where axes cross
static void fading(void) {
  bench fast = open_bench(
      "<mujoco><option gravity='0 0 0' timestep='.02'/><worldbody><geom type='plane' size='1 1 1'/>"
      "<body><joint type='slide' axis='0 0 1'/><geom type='sphere' size='.1'/></body>"
      "</worldbody></mujoco>");
  cav_options *o = &fast.state->options;
  o->stabilisation = CAV_STABILISATION_DISCRETE;
  o->smoothing = o->smoothing_self = 0.001;
  o->softness = 0.02;
  // reach 0.112 m, and 0.2 m covered in a step: seen 0.0013, a step of the sweep; 0.9 without fading
  CHECK(largest_jump(&fast, 0.1, 0.3, -10) < 0.002);
  // slower than 5 m/s over 0.7 of the activation distance nothing fades: the law in closed form, R = 0.02/m
  fast.q[0] = 0.1 + 0.07, fast.v[0] = fast.v_next[0] = -3.3;
  CHECK(run(&fast) == CAV_OK);
  double fraction = fast.state->contact[0].regulariser[0];
  o->smoothing = 0;
  CHECK(run(&fast) == CAV_OK);
  CHECK_NEAR(fraction, fast.state->contact[0].regulariser[0], 0);
  close_bench(&fast);

  bench crossing = open_bench(
      "<mujoco><option gravity='0 0 0' timestep='.02'/><worldbody>"
      "<body pos='0 0 1'><joint type='slide' axis='0 1 0'/>"
      "<geom type='capsule' size='.05 .2' mass='1'/></body>"
      "<body pos='0 0 1'><joint type='slide' axis='1 0 0'/>"
      "<geom type='capsule' size='.05 .2' euler='0 90 0' mass='1'/></body>"
      "</worldbody></mujoco>");
  o = &crossing.state->options;
  o->stabilisation = CAV_STABILISATION_DISCRETE;
  o->smoothing = o->smoothing_self = 0.001;
  o->softness = 0.02;
  // seen 0.0024; 2, its sign changing, without fading
  CHECK(largest_jump(&crossing, -0.13, 0.131, 0) < 0.003);
  close_bench(&crossing);

  // a ball that goes along a box, its centre a centimetre under the top: the way out flips from the front to the top
  bench corner = open_bench(
      "<mujoco><option gravity='0 0 0' timestep='.02'/><worldbody><geom type='box' size='.3 .3 .3'/>"
      "<body pos='0 0 .29'><joint type='slide' axis='1 0 0'/><geom type='sphere' size='.05' mass='1'/></body>"
      "</worldbody></mujoco>");
  o = &corner.state->options;
  o->stabilisation = CAV_STABILISATION_DISCRETE;
  o->smoothing = o->smoothing_self = 0.001;
  o->softness = 0.02;
  double jump = largest_jump(&corner, -0.40031, -0.2, 0);
  CHECK(jump > 0.3);
  o->saturation = 0.02;
  // seen 0.0018, a step of the sweep
  // seen 0.0032, a step of the sweep
  jump = largest_jump(&corner, -0.40031, -0.2, 0);
  CHECK(jump < 0.004);
  // deep in the ground force is all but that at the depth of saturation: of a spring k it is k x/sqrt(1 + (x/0.02)^2)
  close_bench(&corner);
  bench deep = open_bench(
      "<mujoco><option gravity='0 0 0' timestep='.02'/><worldbody><geom type='plane' size='1 1 1'/>"
      "<body><joint type='slide' axis='0 0 1'/><geom type='sphere' size='.1' mass='1'/></body></worldbody></mujoco>");
  o = &deep.state->options;
  o->stabilisation = CAV_STABILISATION_DISCRETE;
  o->smoothing = o->smoothing_self = 1e-5;
  o->softness = 0.02;
  for (int k = 0; k < 2; k++) {
    double force[2];
    deep.q[0] = 0.1 - (k ? 0.5 : 0.02);
    for (int i = 0; i < 2; i++) {
      o->saturation = i ? 0.02 : 0;
      CHECK(run(&deep) == CAV_OK);
      force[i] = deep.u[0];
    }
    double x = k ? 25 : 1;
    CHECK_NEAR(force[1] / force[0], 1 / sqrt(1 + x * x), 1e-9);
  }
  close_bench(&deep);
}

int main(void) {
  bench b = open_bench(scene_joints);
  linear_in_acceleration(&b);
  power_balance(&b);
  momentum_balance(&b);
  stages(&b);
  midpoint(&b);
  springs(&b);
  limits(&b);
  friction_loss(&b);
  far_away(&b);
  bad_numbers(&b);
  no_allocation(&b);
  actuation(&b);
  close_bench(&b);
  rest_depth();
  double_pole();
  action_and_reaction();
  smoothing();
  fading();
  return check_result();
}
