/// Drag and lift of a medium and gravity compensation: forces against MuJoCo's mj_inverse on a scene with both models
/// of fluids, drag of a known shape by hand, forward against inverse, and weightless bodies.
#include "scene.h"

#ifdef CAVORT_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

enum { STATES = 1000 };

// a box by hand: faces of half lengths a, b, c along one axis, and a sphere of the same mean radius
static void test_by_hand(void) {
  cav_model *m = scene_load(
      "<mujoco><option density='50' viscosity='2' gravity='0 0 0'/><worldbody><body><freejoint/>"
      "<geom type='box' size='.1 .2 .3'/></body></worldbody></mujoco>");
  CHECK(m != NULL);
  if (!m) return;
  cav_state *state = cav_state_new(m);
  double v[6] = {0, 2, 0, 0, 0, 0}, u[6];
  CHECK(cav_inverse(m, state, m->q0, v, v, u) == CAV_OK);
  CHECK_NEAR(u[1], 2 * 50 * 0.1 * 0.3 * 4 + 6 * M_PI * 2 * 0.2 * 2, 1e-10);
  double w[6] = {0, 0, 0, 0, 0, -3};
  CHECK(cav_inverse(m, state, m->q0, w, w, u) == CAV_OK);
  CHECK_NEAR(u[5], -0.5 * 50 * 0.3 * (pow(0.1, 4) + pow(0.2, 4)) * 9 - 8 * M_PI * 2 * pow(0.2, 3) * 3, 1e-10);
  // passive forces can be left out
  state->options.passive = 0;
  CHECK(cav_inverse(m, state, m->q0, v, v, u) == CAV_OK);
  CHECK_NEAR(u[1], 0, 1e-12);
  cav_state_free(state);
  cav_model_free(m);
}

// a body without weight needs no force to stand still, and half the weight of another is left
static void test_buoyancy(void) {
  cav_model *m = scene_load(
      "<mujoco><worldbody><body gravcomp='1'><joint axis='0 1 0'/><geom type='box' size='.1 .2 .3' pos='.5 0 0'/>"
      "<body pos='1 0 0' gravcomp='.5'><joint axis='0 1 0' pos='-.1 0 0'/><geom type='box' size='.1 .1 .1' "
      "pos='.2 0 .1'/></body></body></worldbody></mujoco>");
  CHECK(m != NULL);
  if (!m) return;
  cav_state *state = cav_state_new(m);
  double q[2] = {0, 0}, v[2] = {0, 0}, u[2], weight = m->body[2].mass * 9.81;
  CHECK(cav_inverse(m, state, q, v, v, u) == CAV_OK);
  // moments about -y of gravity
  CHECK_NEAR(u[1], -0.5 * weight * 0.3, 1e-9);
  CHECK_NEAR(u[0], -0.5 * weight * 1.2, 1e-9);
  cav_state_free(state);
  cav_model_free(m);
}

static void test_forward(const cav_model *m) {
  cav_state *state = cav_state_new(m);
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv), *next = scene_vector(m->nv), *u = scene_vector(m->nv);
  double *found = scene_vector(m->nv), worst = 0;
  for (int k = 0; k < 100; k++) {
    state->options.order = (cav_order)(k % 3);
    scene_posture(m, q, v, 0.5);
    scene_normals(v, m->nv, 1);
    scene_normals(next, m->nv, 1);
    CHECK(cav_inverse(m, state, q, v, next, u) == CAV_OK);
    CHECK(cav_forward(m, state, q, v, u, found) == CAV_OK);
    worst = fmax(worst, scene_error(found, next, m->nv));
  }
  // bound: tolerance 1e-9 of the forward step; seen 2e-12
  printf("forward against inverse: %.1e\n", worst);
  CHECK(worst < 1e-8);
  // a method that leaves out the medium says so
  double *du = scene_vector(m->nv * m->nv);
  CHECK(cav_derivatives(m, state, du, NULL, NULL) == CAV_NOT_SUPPORTED);
  cav_state_free(state);
  free(q), free(v), free(next), free(u), free(found), free(du);
}

#ifdef CAVORT_HAVE_MUJOCO
// added mass and inertia of an ellipsoid by the midpoint rule in s, lambda = (s / (1 - s))^4 times its size
static void added(const double r[3], double *mass, double *inertia) {
  double kappa[3] = {0, 0, 0}, volume = 4.0 / 3 * M_PI * r[0] * r[1] * r[2], size = r[0] * r[1] * r[2];
  int n = 200000;
  for (int k = 0; k < n; k++) {
    double s = (k + 0.5) / n, t = s / (1 - s), unit = pow(size, 2.0 / 3), x = unit * pow(t, 4);
    double width = unit * 4 * pow(t, 3) / ((1 - s) * (1 - s)) / n;
    double root = sqrt((r[0] * r[0] + x) * (r[1] * r[1] + x) * (r[2] * r[2] + x));
    for (int i = 0; i < 3; i++) kappa[i] += size * width / ((r[i] * r[i] + x) * root);
  }
  for (int i = 0; i < 3; i++) {
    double j = r[(i + 1) % 3], l = r[(i + 2) % 3], apart = j * j - l * l,
           turn = kappa[(i + 2) % 3] - kappa[(i + 1) % 3];
    mass[i] = volume * kappa[i] / (2 - kappa[i]);
    inertia[i] = j == l ? 0 : volume / 5 * apart * apart * turn / (2 * apart - (j * j + l * l) * turn);
  }
}

// MuJoCo's quadrature of the added masses is good to some 1e-6: a sphere's is half its volume. It gets exact ones
static void correct_added(mjModel *p) {
  double worst = 0;
  for (int g = 0; g < p->ngeom; g++) {
    double *coef = p->geom_fluid + mjNFLUID * g, mass[3], inertia[3], r[3];
    if (coef[0] == 0) continue;
    for (int k = 0; k < 3; k++) r[k] = p->geom_size[3 * g + k];
    if (p->geom_type[g] == mjGEOM_SPHERE) r[1] = r[2] = r[0];
    if (p->geom_type[g] == mjGEOM_CAPSULE) r[2] = r[1] + r[0], r[1] = r[0];
    if (p->geom_type[g] == mjGEOM_CYLINDER) r[2] = r[1], r[1] = r[0];
    added(r, mass, inertia);
    if (p->geom_type[g] == mjGEOM_SPHERE) CHECK_NEAR(mass[0], 2.0 / 3 * M_PI * r[0] * r[0] * r[0], 1e-12);
    for (int k = 0; k < 3; k++) {
      worst = fmax(worst, fabs(coef[6 + k] / mass[k] - 1));
      coef[6 + k] = mass[k];
      coef[9 + k] = inertia[k];
    }
  }
  printf("MuJoCo's added masses are off by %.1e\n", worst);
  CHECK(worst < 1e-3);
}

static void test_peer(const cav_model *m, const char *path) {
  char text[1000];
  mjModel *p = mj_loadXML(path, NULL, text, sizeof text);
  CHECK(p != NULL);
  if (!p) fprintf(stderr, "    %s\n", text);
  if (!p) return;
  correct_added(p);
  mjData *d = mj_makeData(p);
  cav_state *state = cav_state_new(m);
  double *scratch = scene_vector(m->nv), *next = scene_vector(m->nv), *u = scene_vector(m->nv), worst = 0;
  for (int k = 0; k < STATES; k++) {
    mj_resetData(p, d);
    scene_posture(m, d->qpos, scratch, 0.8);
    scene_normals(d->qvel, m->nv, 1);
    scene_normals(d->qacc, m->nv, 10);
    mj_inverse(p, d);
    for (int i = 0; i < m->nv; i++) next[i] = d->qvel[i] + p->opt.timestep * d->qacc[i];
    CHECK(cav_inverse(m, state, d->qpos, d->qvel, next, u) == CAV_OK);
    worst = fmax(worst, scene_error(u, d->qfrc_inverse, m->nv));
  }
  // bound: rounding; seen 3e-14. Each body has one geom: MuJoCo finds principal axes of several to 1e-8
  printf("against MuJoCo: %.1e\n", worst);
  CHECK(worst < 1e-9);
  cav_state_free(state);
  free(scratch), free(next), free(u);
  mj_deleteData(d);
  mj_deleteModel(p);
}
#endif

int main(void) {
  test_by_hand();
  test_buoyancy();
  char path[4200];
  snprintf(path, sizeof path, "%s/tests/fluid.xml", CAVORT_SOURCE_ROOT);
  cav_error error = {0};
  cav_model *m = cav_model_load(path, &error);
  CHECK(m != NULL);
  if (!m) fprintf(stderr, "    %s\n", error.text);
  if (m) {
    test_forward(m);
#ifdef CAVORT_HAVE_MUJOCO
    test_peer(m, path);
#endif
  }
  cav_model_free(m);
  return check_result();
}
