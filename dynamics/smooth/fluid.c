/// Forces of a medium of some density and viscosity, which may blow: drag and lift on whatever moves in it. Two models,
/// those of MuJoCo's documentation (chapter "Fluid forces"), whose names the terms have here. A body is a box of the
/// same inertia: quadratic drag of its faces and Stokes' linear drag of a sphere. A geom that asks for it (fluidshape)
/// is an ellipsoid instead: added mass without its acceleration part, drag blunt and slender, Magnus and Kutta lift,
/// Stokes' drag; its body is then no box. The medium's flow is the same everywhere and is not disturbed.
#include <stdlib.h>

#include "math3.h"
#include "smooth.h"

/// What the medium acts on: a box or an ellipsoid fixed in a link.
typedef struct cav_float {
  int link, ellipsoid;
  double pos[3], quat[4];
  double half[3];                         ///< half lengths or semi-axes, m
  double coef[5];                         ///< blunt, slender, angular drag; Kutta, Magnus lift
  double added_mass[3], added_inertia[3]; ///< of a medium of density 1
} cav_float;

// Carlson's integral 3/2 int dt / (sqrt(t+x) sqrt(t+y) (t+z)^(3/2)) by duplication
static double carlson(double x, double y, double z) {
  double sum = 0, power = 1, mean = 0;
  for (int k = 0; k < 100; k++) {
    mean = (x + y + 3 * z) / 5;
    double most = fmax(fabs(mean - x), fmax(fabs(mean - y), fabs(mean - z)));
    if (most < 1e-3 * mean) { break; }
    double a = sqrt(x), b = sqrt(y), c = sqrt(z), step = a * b + b * c + c * a;
    sum += power / (c * (z + step));
    power /= 4;
    x = (x + step) / 4;
    y = (y + step) / 4;
    z = (z + step) / 4;
  }
  // series in what is left, to the fifth order
  double X = 1 - x / mean, Y = 1 - y / mean, Z = -(X + Y) / 3;
  double e2 = X * Y - 6 * Z * Z, e3 = (3 * X * Y - 8 * Z * Z) * Z, e4 = 3 * (X * Y - Z * Z) * Z * Z,
         e5 = X * Y * Z * Z * Z;
  double series = 1 - 3.0 / 14 * e2 + e3 / 6 + 9.0 / 88 * e2 * e2 - 3.0 / 22 * e4 - 9.0 / 52 * e2 * e3 + 3.0 / 26 * e5;
  return 3 * sum + power * series / (mean * sqrt(mean));
}

// inertia of the fluid that an ellipsoid carries along (Tuckerman 1925)
static void add_inertia(cav_float *f) {
  const double *r = f->half;
  double volume = 4.0 / 3 * M_PI * r[0] * r[1] * r[2], kappa[3];
  for (int i = 0; i < 3; i++) {
    double j = r[(i + 1) % 3], k = r[(i + 2) % 3];
    kappa[i] = 2.0 / 3 * r[0] * r[1] * r[2] * carlson(j * j, k * k, r[i] * r[i]);
  }
  for (int i = 0; i < 3; i++) {
    int j = (i + 1) % 3, k = (i + 2) % 3;
    double apart = r[j] * r[j] - r[k] * r[k], both = r[j] * r[j] + r[k] * r[k], turn = kappa[k] - kappa[j];
    double below = 2 * apart - both * turn;
    f->added_mass[i] = volume * kappa[i] / (2 - kappa[i]);
    f->added_inertia[i] = below != 0 ? volume / 5 * apart * apart * turn / below : 0;
  }
}

static void semi_axes(const cav_geom *geom, double half[3]) {
  const double *s = geom->size;
  switch (geom->type) {
    case CAV_GEOM_SPHERE:
      set3(half, s[0], s[0], s[0]);
      break;
    case CAV_GEOM_CAPSULE:
      set3(half, s[0], s[0], s[1] + s[0]);
      break;
    case CAV_GEOM_CYLINDER:
      set3(half, s[0], s[0], s[1]);
      break;
    default:
      copy3(half, s);
  }
}

static cav_float float_of_geom(const cav_geom *geom) {
  cav_float f = {.link = geom->link, .ellipsoid = 1};
  copy3(f.pos, geom->pos);
  memcpy(f.quat, geom->quat, sizeof f.quat);
  memcpy(f.coef, geom->fluidcoef, sizeof f.coef);
  semi_axes(geom, f.half);
  add_inertia(&f);
  return f;
}

static cav_float float_of_body(const cav_body *body) {
  cav_float f = {.link = body->link};
  const double *I = body->inertia;
  quat_rotate(f.pos, body->quat, body->com);
  add3(f.pos, f.pos, body->pos);
  quat_mul(f.quat, body->quat, body->iquat);
  for (int k = 0; k < 3; k++) { f.half[k] = sqrt(1.5 / body->mass * fmax(0, I[(k + 1) % 3] + I[(k + 2) % 3] - I[k])); }
  return f;
}

// writes the floats of a model, or with out NULL only counts them
static int list_floats(const cav_model *model, cav_float *out) {
  int n = 0;
  if (model->density == 0 && model->viscosity == 0) { return 0; }
  for (int i = 1; i < model->nbody; i++) {
    const cav_body *body = &model->body[i];
    int before = n;
    if (body->link == 0) { continue; }
    for (int k = body->geom; k < body->geom + body->ngeom; k++) {
      if (!model->geom[k].fluid) { continue; }
      if (out) { out[n] = float_of_geom(&model->geom[k]); }
      n++;
    }
    if (n > before || !(body->mass > 1e-15)) { continue; }
    if (out) { out[n] = float_of_body(body); }
    n++;
  }
  return n;
}

cav_status cav_fluid_compile(const cav_model *model, cav_workspace *w) {
  int n = list_floats(model, NULL);
  if (n == 0) { return CAV_OK; }
  w->floats = malloc((size_t)n * sizeof *w->floats);
  if (!w->floats) { return CAV_NO_MEMORY; }
  w->nfloat = list_floats(model, w->floats);
  return CAV_OK;
}

size_t cav_fluid_bytes(const cav_workspace *w) { return (size_t)w->nfloat * sizeof *w->floats; }

/// Motion of the middle of a float against the medium, and what it does, in its own axes.
typedef struct flow {
  double density, viscosity, v[3], w[3], force[3], torque[3];
} flow;

// linear drag of a sphere of the mean radius
static void add_stokes(const cav_float *f, flow *x) {
  double r = (f->half[0] + f->half[1] + f->half[2]) / 3;
  axpy3(x->force, x->force, -6 * M_PI * x->viscosity * r, x->v);
  axpy3(x->torque, x->torque, -8 * M_PI * x->viscosity * r * r * r, x->w);
}

// quadratic drag of a box, face by face
static void add_box(const cav_float *f, flow *x) {
  for (int i = 0; i < 3; i++) {
    double a = f->half[i], b = f->half[(i + 1) % 3], c = f->half[(i + 2) % 3];
    x->force[i] -= 2 * x->density * b * c * fabs(x->v[i]) * x->v[i];
    x->torque[i] -= 0.5 * x->density * a * (b * b * b * b + c * c * c * c) * fabs(x->w[i]) * x->w[i];
  }
}

// momentum of the fluid carried along turns with the body
static void add_carried(const cav_float *f, flow *x) {
  double momentum[3], spin[3];
  for (int k = 0; k < 3; k++) {
    momentum[k] = x->density * f->added_mass[k] * x->v[k];
    spin[k] = x->density * f->added_inertia[k] * x->w[k];
  }
  cross_add3(x->force, momentum, x->w);
  cross_add3(x->torque, momentum, x->v);
  cross_add3(x->torque, spin, x->w);
}

static void add_magnus(const cav_float *f, flow *x) {
  double volume = 4.0 / 3 * M_PI * f->half[0] * f->half[1] * f->half[2], lift[3];
  cross3(lift, x->w, x->v);
  axpy3(x->force, x->force, f->coef[4] * x->density * volume, lift);
}

// drag by the area seen along the velocity, and Kutta's lift square to it
static void add_drag_and_lift(const cav_float *f, flow *x) {
  const double *r = f->half;
  double speed = norm3(x->v), a = r[1] * r[2], b = r[2] * r[0], c = r[0] * r[1];
  if (!(speed > 0)) { return; }
  double A = a * x->v[0], B = b * x->v[1], C = c * x->v[2], square = A * A + B * B + C * C;
  double fourth = a * a * A * A + b * b * B * B + c * c * C * C;
  if (!(square > 0)) { return; }
  double area = M_PI * sqrt(fourth / square);

  // blunt over the area seen, slender over the rest
  double most = fmax(r[0], fmax(r[1], r[2])), least = fmin(r[0], fmin(r[1], r[2])),
         middle = r[0] + r[1] + r[2] - most - least;
  double drag = f->coef[0] * area + f->coef[1] * (M_PI * most * middle - area);
  axpy3(x->force, x->force, -x->density * drag * speed, x->v);

  // normal of the section that makes the outline
  double normal[3] = {a * A, b * B, c * C}, circulation[3], lift[3], norm = sqrt(fourth);
  double cosine = (A * A + B * B + C * C) / (norm * speed);
  scale3(normal, 1 / norm, normal);
  cross3(circulation, normal, x->v);
  cross3(lift, circulation, x->v);
  axpy3(x->force, x->force, f->coef[3] * x->density * area * cosine, lift);
}

// drag against turning, by the ellipsoid swept about each axis
static void add_turning_drag(const cav_float *f, flow *x) {
  double swept[3], most = 0, weighed[3];
  for (int i = 0; i < 3; i++) {
    double wide = fmax(f->half[(i + 1) % 3], f->half[(i + 2) % 3]);
    swept[i] = 8.0 / 15 * M_PI * f->half[i] * wide * wide * wide * wide;
    most = fmax(most, swept[i]);
  }
  for (int i = 0; i < 3; i++) { weighed[i] = x->w[i] * (f->coef[2] * swept[i] + f->coef[1] * (most - swept[i])); }
  axpy3(x->torque, x->torque, -x->density * norm3(weighed), x->w);
}

static void act(const cav_model *model, cav_state *state, const cav_float *f) {
  const cav_pose *link = &state->link[f->link];
  const double *V = state->velocity + 6 * f->link, *reference = state->reference + 3 * f->link;
  double point[3], quat[4], R[9], velocity[3], force[3], torque[3];
  transform(point, link->pos, link->rotation, f->pos);
  quat_mul(quat, link->quat, f->quat);
  quat_matrix(R, quat);
  velocity_at(velocity, V, reference, point);
  sub3(velocity, velocity, model->wind);
  flow x = {.density = model->density, .viscosity = model->viscosity};
  rotate_back(x.v, R, velocity);
  rotate_back(x.w, R, V);
  if (f->ellipsoid) {
    add_carried(f, &x);
    add_magnus(f, &x);
    add_drag_and_lift(f, &x);
    add_turning_drag(f, &x);
  } else {
    add_box(f, &x);
  }
  add_stokes(f, &x);

  // what pushes the link need not come from elsewhere
  rotate(force, R, x.force);
  rotate(torque, R, x.torque);
  scale3(force, -1, force);
  double *F = state->force + 6 * f->link;
  push_at(F, reference, point, force);
  sub3(F, F, torque);
}

void cav_add_fluid_forces(const cav_model *model, cav_state *state) {
  const cav_workspace *w = state->work;
  for (int i = 0; i < w->nfloat && state->options.passive; i++) { act(model, state, &w->floats[i]); }
}
