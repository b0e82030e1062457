/// The order momentum: rows of roots against the same sums written out from poses of links, all others against
/// midpoint; momenta of a body that tumbles about its middle axis (Dzhanibekov), of a humanoid thrown while its joints
/// work, and of one that falls on the floor, over a thousand steps; that it and midpoint approach each other with the
/// square of the step; that sensors of force read what the step exerts. Derivatives: test_analytic.c. Energy:
/// test_conservation.c.
#include "scene.h"

static const char tumbler[] =
    "<mujoco><worldbody><body><freejoint/><inertial pos='0 0 0' mass='1' diaginertia='1 2 2.8'/></body></worldbody>"
    "</mujoco>";

/// Linear momentum and angular momentum about a point, of all that moves.
typedef struct momenta {
  double linear[3], angular[3];
} momenta;

static void cross(const double a[3], const double b[3], double r[3]) {
  for (int k = 0; k < 3; k++) r[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

// momentum of each link about the origin of the world, from its pose: angular, linear [6*nlink]
static void link_momenta(const cav_model *m, cav_state *state, const double *q, const double *v, double *out) {
  double *V = scene_vector(6 * m->nlink);
  CHECK(cav_position(m, state, q) == CAV_OK);
  for (int l = 1; l < m->nlink; l++) {
    const cav_link *link = &m->link[l];
    const double *c = state->com + 3 * l, *I = state->inertia + 6 * l;
    double arm[3], p[3], *at = V + 6 * l, *to = out + 6 * l;
    memcpy(at, V + 6 * link->parent, 6 * sizeof *at);
    for (int d = link->dof; d < link->dof + link->ndof; d++)
      for (int k = 0; k < 6; k++) at[k] += state->axis[6 * d + k] * v[d];
    for (int k = 0; k < 3; k++) arm[k] = c[k] - state->reference[3 * l + k];
    cross(at, arm, p);
    for (int k = 0; k < 3; k++) p[k] = link->mass * (p[k] + at[3 + k]);
    cross(c, p, to);
    for (int k = 0; k < 3; k++) to[3 + k] = p[k];
    to[0] += I[0] * at[0] + I[3] * at[1] + I[4] * at[2];
    to[1] += I[3] * at[0] + I[1] * at[1] + I[5] * at[2];
    to[2] += I[4] * at[0] + I[5] * at[1] + I[2] * at[2];
  }
  free(V);
}

// half a step from q with v
static momenta momenta_half_way(const cav_model *m, cav_state *state, const double *q, const double *v, double h) {
  double *middle = scene_vector(m->nq), *each = scene_vector(6 * m->nlink);
  momenta sum = {{0}, {0}};
  cav_integrate(m, q, v, 0.5 * h, middle);
  link_momenta(m, state, middle, v, each);
  for (int l = 1; l < m->nlink; l++)
    for (int k = 0; k < 3; k++) sum.angular[k] += each[6 * l + k], sum.linear[k] += each[6 * l + 3 + k];
  free(middle), free(each);
  return sum;
}

// rows of roots by the definition: axes at q times the change of the momenta of what they move, less its weight
static void written_out(const cav_model *m, cav_state *state, const double *q, const double *v, const double *next,
                        double h, double *u) {
  double *middle = scene_vector(m->nq), *before = scene_vector(6 * m->nlink), *after = scene_vector(6 * m->nlink);
  cav_integrate(m, q, v, -0.5 * h, middle);
  link_momenta(m, state, middle, v, before);
  cav_integrate(m, q, next, 0.5 * h, middle);
  link_momenta(m, state, middle, next, after);
  CHECK(cav_position(m, state, q) == CAV_OK);
  for (int d = 0; d < m->nv; d++) {
    const double *S = state->axis + 6 * d;
    if (m->link[m->dof[d].link].root != m->dof[d].link) continue;
    u[d] = m->dof[d].armature * (next[d] - v[d]) / h;
    for (int l = 1; l < m->nlink; l++) {
      int at = l;
      while (at > 0 && at != m->dof[d].link) at = m->link[at].parent;
      if (at == 0) continue;
      // the same wrench about the reference
      double F[6], weight[3], moment[3];
      for (int k = 0; k < 3; k++) weight[k] = m->link[l].mass * m->gravity[k];
      cross(state->com + 3 * l, weight, moment);
      for (int k = 0; k < 6; k++)
        F[k] = (after[6 * l + k] - before[6 * l + k]) / h - (k < 3 ? moment[k] : weight[k - 3]);
      cross(state->reference + 3 * l, F + 3, moment);
      for (int k = 0; k < 3; k++) u[d] += S[k] * (F[k] - moment[k]) + S[3 + k] * F[3 + k];
    }
  }
  free(middle), free(before), free(after);
}

static void test_definition(const cav_model *m) {
  cav_state *state = cav_state_new(m), *other = cav_state_new(m);
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *next = scene_vector(m->nv),
         *scratch = scene_vector(m->nv);
  double *u = scene_vector(m->nv), *expected = scene_vector(m->nv), worst = 0;
  state->options.order = CAV_ORDER_MOMENTUM;
  state->options.constraint = state->options.passive = 0;
  other->options = state->options;
  for (int k = 0; k < 50; k++) {
    scene_posture(m, q, scratch, 0.7);
    scene_normals(v, m->nv, 5);
    scene_normals(next, m->nv, 5);
    CHECK(cav_inverse(m, state, q, v, next, u) == CAV_OK);
    other->options.order = CAV_ORDER_MIDPOINT;
    CHECK(cav_inverse(m, other, q, v, next, expected) == CAV_OK);
    written_out(m, other, q, v, next, state->options.timestep, expected);
    worst = fmax(worst, scene_error(u, expected, m->nv));
  }
  // bound: rounding of momenta about the origin, 2 m away, over the step; seen 2e-14
  printf("inverse against the sums written out: %.1e\n", worst);
  CHECK(worst < 1e-13);
  cav_state_free(state), cav_state_free(other);
  free(q), free(v), free(next), free(scratch), free(u), free(expected);
}

// forces on all that moves at a knot, from outside: weight and contacts with the world, times the step
static momenta impulses(const cav_model *m, const cav_state *state, double h) {
  momenta sum = {{0}, {0}};
  double moment[3], force[3];
  for (int l = 1; l < m->nlink; l++) {
    for (int k = 0; k < 3; k++) force[k] = h * m->link[l].mass * (state->options.gravity ? m->gravity[k] : 0);
    cross(state->com + 3 * l, force, moment);
    for (int k = 0; k < 3; k++) sum.linear[k] += force[k], sum.angular[k] += moment[k];
  }
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    double sign = (c->link2 > 0) - (c->link1 > 0);
    for (int k = 0; k < 3; k++) {
      force[k] = 0;
      for (int a = 0; a < (c->dim < 3 ? 1 : 3); a++) force[k] += sign * c->impulse[a] * c->frame[3 * a + k];
      for (int a = 3; a < c->dim; a++) sum.angular[k] += sign * c->impulse[a] * c->frame[3 * (a - 3) + k];
    }
    cross(c->pos, force, moment);
    for (int k = 0; k < 3; k++) sum.linear[k] += force[k], sum.angular[k] += moment[k];
  }
  return sum;
}

// a thousand steps; returns the largest departure of the momenta from their balance, relative to their largest
static double depart(const cav_model *m, cav_order order, int gravity, int contact, double speed, double push, double h,
                     int steps, int *touched) {
  cav_state *state = cav_state_new(m), *other = cav_state_new(m);
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *next = scene_vector(m->nv), *u = scene_vector(m->nv);
  state->options.order = order;
  state->options.timestep = h;
  state->options.gravity = gravity;
  state->options.contact = contact;
  other->options.contact = 0;
  memcpy(q, m->q0, (size_t)m->nq * sizeof *q);
  if (speed > 0) scene_normals(v, m->nv, speed);
  if (m->nv == 6) v[3] = 0.02, v[4] = 4, v[5] = 0.01;
  double worst = 0, size = 1e-300;
  momenta due = momenta_half_way(m, other, q, v, -h);
  for (int t = 0; t < steps; t++) {
    // joints push and pull: forces within
    for (int d = 6; d < m->nv; d++) u[d] = push * sin(0.01 * t + d) * m->dof[d].inverse_weight;
    cav_status status = cav_forward_newton(m, state, q, v, u, 200, 1e-13, next, NULL);
    if (!CHECK(status == CAV_OK)) break;
    momenta more = impulses(m, state, h), now = momenta_half_way(m, other, q, next, h);
    for (int i = 0; contact && i < state->ncontact; i++) *touched += state->contact[i].impulse[0] > 0;
    for (int k = 0; k < 3; k++) {
      due.linear[k] += more.linear[k], due.angular[k] += more.angular[k];
      worst = fmax(worst, fmax(fabs(now.linear[k] - due.linear[k]), fabs(now.angular[k] - due.angular[k])));
      size = fmax(size, fmax(fabs(now.linear[k]), fabs(now.angular[k])));
    }
    memcpy(v, next, (size_t)m->nv * sizeof *v);
    cav_integrate(m, q, v, h, q);
  }
  cav_state_free(state), cav_state_free(other);
  free(q), free(v), free(next), free(u);
  return worst / size;
}

static void test_flight(const char *name, const cav_model *m, int gravity, double speed, double push, double h) {
  double departure[3];
  int touched = 0;
  uint64_t seed = scene_seed;
  for (int order = 0; order < 3; order++) {
    scene_seed = seed;
    departure[order] = depart(m, (cav_order)order, gravity, 0, speed, push, h, 1000, &touched);
  }
  printf("%s, 1,000 steps of %g s: momenta depart by euler %.1e, midpoint %.1e, momentum %.1e\n", name, h, departure[0],
         departure[1], departure[2]);
  // bound: a thousand residuals of the forward step, 1e-13 of the largest force each; seen 3e-13
  CHECK(departure[2] < 1e-11);
  CHECK(departure[0] > 1e-5 && departure[1] > 1e-7);
}

// the orders come together: how midpoint and momentum, euler and momentum differ at a step and at a quarter of it
static void test_limit(const cav_model *m) {
  cav_state *state = cav_state_new(m);
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *next = scene_vector(m->nv), *a = scene_vector(m->nv);
  double *u[3] = {scene_vector(m->nv), scene_vector(m->nv), scene_vector(m->nv)}, apart[2][2] = {{0}};
  state->options.constraint = 0;
  for (int k = 0; k < 20; k++) {
    scene_posture(m, q, a, 0.5);
    scene_normals(v, m->nv, 3);
    scene_normals(a, m->nv, 20);
    for (int fine = 0; fine < 2; fine++) {
      double h = fine ? 0.0025 : 0.01;
      state->options.timestep = h;
      // velocities half a step before and after, as a motion with that acceleration has them
      for (int d = 0; d < m->nv; d++) next[d] = v[d] + 0.5 * h * a[d];
      double *last = scene_vector(m->nv);
      for (int d = 0; d < m->nv; d++) last[d] = v[d] - 0.5 * h * a[d];
      for (int order = 0; order < 3; order++) {
        state->options.order = (cav_order)order;
        CHECK(cav_inverse(m, state, q, last, next, u[order]) == CAV_OK);
      }
      free(last);
      for (int order = 0; order < 2; order++) apart[order][fine] += scene_error(u[order], u[2], m->nv) / 20;
    }
  }
  printf("forces apart from those of momentum at 10 ms and 2.5 ms: euler %.1e %.1e, midpoint %.1e %.1e\n", apart[0][0],
         apart[0][1], apart[1][0], apart[1][1]);
  // bounds: powers 1 and 2 of the step within a tenth; seen 1.0 and 2.0
  CHECK_NEAR(log2(apart[0][0] / apart[0][1]) / 2, 1, 0.1);
  CHECK_NEAR(log2(apart[1][0] / apart[1][1]) / 2, 2, 0.1);
  cav_state_free(state);
  free(q), free(v), free(next), free(a), free(u[0]), free(u[1]), free(u[2]);
}

// what a joint without forces of its own bears is the wrench through its body, along its axis
static void test_sensed(const cav_model *m) {
  cav_state *state = cav_state_new(m);
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *next = scene_vector(m->nv), *u = scene_vector(m->nv);
  state->options.order = CAV_ORDER_MOMENTUM;
  state->options.constraint = state->options.passive = 0;
  for (int k = 0; k < 20; k++) {
    scene_posture(m, q, u, 0.5);
    scene_normals(v, m->nv, 3);
    scene_normals(next, m->nv, 3);
    CHECK(cav_inverse(m, state, q, v, next, u) == CAV_OK);
    for (int i = 0; i < m->nsite; i++) {
      cav_sensor force = {.type = CAV_SENSOR_FORCE, .dim = 3, .object_type = CAV_OBJECT_SITE, .object = i};
      cav_sensor torque = {.type = CAV_SENSOR_TORQUE, .dim = 3, .object_type = CAV_OBJECT_SITE, .object = i};
      double f[3], n[3], F[3] = {0}, N[3] = {0}, sum;
      cav_pose pose;
      int link = m->site[i].link;
      cav_sensor_read(m, state, &force, f);
      cav_sensor_read(m, state, &torque, n);
      cav_object_pose(m, state, CAV_OBJECT_SITE, i, &pose);
      for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) F[r] += pose.rotation[3 * r + c] * f[c], N[r] += pose.rotation[3 * r + c] * n[c];
      for (int d = m->link[link].dof; d < m->link[link].dof + m->link[link].ndof; d++) {
        const double *S = state->axis + 6 * d, *reference = state->reference + 3 * link;
        double arm[3] = {pose.pos[0] - reference[0], pose.pos[1] - reference[1], pose.pos[2] - reference[2]}, moment[3];
        cross(arm, F, moment);
        sum = m->dof[d].armature * (next[d] - v[d]) / state->options.timestep;
        for (int c = 0; c < 3; c++) sum += S[c] * (N[c] + moment[c]) + S[3 + c] * F[c];
        // bound: rounding of forces about 1e4; seen 2e-11
        CHECK_NEAR(sum, u[d], 1e-9);
      }
    }
  }
  cav_state_free(state);
  free(q), free(v), free(next), free(u);
}

static const char limbs[] =
    "<mujoco><option timestep='.004'/><worldbody><body name='a' pos='0 0 1'><freejoint/>"
    "<geom type='box' size='.1 .2 .3' pos='.1 .05 0' euler='10 20 30'/><site pos='.1 .2 .3' euler='40 0 20'/>"
    "<body name='b' pos='.3 0 .1'>"
    "<joint type='ball' pos='.1 0 .05'/><geom type='capsule' size='.05' fromto='0 0 0 .2 .3 .1'/><site pos='0 0 .1'/>"
    "<body name='c' pos='.2 0 0' euler='30 10 0'><joint type='slide' axis='1 1 0'/><joint axis='0 1 1' armature='.1'/>"
    "<geom type='cylinder' size='.1 .2'/><site pos='.1 .2 0' euler='20 0 40'/><body pos='0 0 .3'>"
    "<geom type='sphere' size='.1'/></body></body></body></body></worldbody></mujoco>";

int main(void) {
  cav_model *joints = scene_load(scene_joints), *spinner = scene_load(tumbler), *chain = scene_load(limbs);
  cav_model *person = cav_model_load(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", NULL);
  if (!CHECK(joints && spinner && chain && person)) return check_result();
  test_definition(joints);
  test_limit(chain);
  test_sensed(chain);
  test_flight("tumbling body", spinner, 0, 0, 0, 0.02);
  test_flight("limbs thrown", chain, 1, 2, 1, 0.005);
  test_flight("humanoid thrown", person, 1, 1, 5, 0.005);
  int touched = 0;
  double departure = depart(person, CAV_ORDER_MOMENTUM, 1, 1, 0.1, 1, 0.005, 1000, &touched);
  printf("humanoid falling on the floor, %d contacts: %.1e\n", touched, departure);
  // bound as in flight, with the largest force that of a landing; seen 2e-12
  CHECK(touched > 1000 && departure < 1e-9);
  cav_model_free(joints), cav_model_free(spinner), cav_model_free(chain), cav_model_free(person);
  return check_result();
}
