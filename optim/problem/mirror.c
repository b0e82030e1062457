/// A model as its own mirror image: which joint takes whose place when the world is reflected along one horizontal
/// axis. Counterparts are pairs that the problem declares, or joints whose names differ in the word for the side (left
/// and right, l and r, FL and FR); all others stand for themselves. With M the reflection, at the configuration of the
/// file q0: anchors go to M p, axes of slides to M a, axes of hinges, which are pseudovectors, to -M a; the signs that
/// are left over are those of the coordinates. A rotation away from q0 is conjugated by N = R0' M R0_image, which is
/// improper; -N is what is kept. Checked here: geometry and masses, each with a name in the complaint; real robots are
/// symmetric to some millimetres, so what is off by little is passed and measured. What no one can
/// list (contacts, springs, tendons) periodicity.c checks by the forces themselves; ranges may differ, and what both
/// allow holds.
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/dynamics.h"
#include "file.h"
#include "math3.h"
#include "periodicity.h"

// how far a robot may be from its image: lengths by its extent, axes (1 degree), masses, moments of inertia
static const double least = 0.01, axis_least = 1.5e-4, mass_least = 0.02, moment_least = 0.1;
static const double near = 1e-6; // m or relative: files carry few digits

/// A model beside its image.
typedef struct comparison {
  const cav_model *model;
  const cav_state *state;
  int axis;
  double length;    ///< m, the most that may be between a point and its image
  double asymmetry; ///< the largest so far, as a length
  cav_error *error;
} comparison;

// ---------------------------------------------------------------- names

/// Sides as words, and as what a short capital token ends in.
static const char *const sides[][2] = {{"left", "right"}, {"Left", "Right"}, {"LEFT", "RIGHT"}};

/// Replaces length characters at place by a text; out has room for name and 8 more.
static void splice(const char *name, size_t place, size_t length, const char *by, char *out) {
  memcpy(out, name, place);
  strcpy(out + place, by);
  strcat(out, name + place + length);
}

/// A token's last letter, if it stands for a side: l, r, L, R alone, or after one capital.
static int is_side(const char *token, size_t n) {
  char last = token[n - 1];
  if (n == 1) return strchr("lrLR", last) != NULL;
  return n == 2 && isupper((unsigned char)token[0]) && (last == 'L' || last == 'R');
}

int cav_joint_other_side(const cav_model *m, int j) {
  const char *name = m->joint[j].name;
  char other[256];
  if (strlen(name) > 240) return -1;
  for (size_t i = 0; i < sizeof sides / sizeof *sides; i++) {
    for (int k = 0; k < 2; k++) {
      const char *at = strstr(name, sides[i][k]);
      if (!at) continue;
      splice(name, (size_t)(at - name), strlen(sides[i][k]), sides[i][1 - k], other);
      int found = cav_object_find(m, CAV_OBJECT_JOINT, other);
      return found < 0 ? -2 : found;
    }
  }
  // short tokens say too little to miss a counterpart
  for (const char *token = name; *token;) {
    size_t n = strcspn(token, "_-. ");
    if (n && is_side(token, n)) {
      static const char from[] = "lrLR", to[] = "rlRL";
      const char by[2] = {to[strchr(from, token[n - 1]) - from], 0};
      splice(name, (size_t)(token - name) + n - 1, 1, by, other);
      int found = cav_object_find(m, CAV_OBJECT_JOINT, other);
      if (found >= 0) return found;
    }
    token += n + (token[n] != 0);
  }
  return -1;
}

static cav_status pair_joints(const cav_problem *problem, cav_image *image, cav_error *error) {
  const cav_model *m = problem->model;
  for (int j = 0; j < m->njoint; j++) image[j] = (cav_image){.joint = -1, .sign = 1, .rotation = {1, 0, 0, 0}};
  for (int i = 0; i < problem->cycle.npair; i++) {
    int a = problem->cycle.pair[i][0], b = problem->cycle.pair[i][1];
    if (a < 0 || b < 0 || a >= m->njoint || b >= m->njoint || image[a].joint >= 0 || image[b].joint >= 0)
      return cav_file_fail(error, CAV_BAD_INPUT, 0,
                           "a pair of the cycle names a joint twice, or one that is not there");
    image[a].joint = b;
    image[b].joint = a;
  }
  for (int j = 0; j < m->njoint; j++) {
    if (image[j].joint >= 0) continue;
    int other = cav_joint_other_side(m, j);
    if (other == -2)
      return cav_file_fail(error, CAV_BAD_INPUT, 0,
                           "joint '%.80s' has a side in its name but the model has no joint of that name for the other "
                           "side: declare the pair",
                           m->joint[j].name);
    image[j].joint = other < 0 ? j : other;
  }
  for (int j = 0; j < m->njoint; j++) {
    if (image[image[j].joint].joint == j) continue;
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "joint '%.80s' stands for '%.80s', but not the other way round",
                         m->joint[j].name, m->joint[image[j].joint].name);
  }
  return CAV_OK;
}

// ---------------------------------------------------------------- geometry

static void reflect(int axis, const double *p, double *out) {
  for (int k = 0; k < 3; k++) out[k] = k == axis ? -p[k] : p[k];
}

static double apart(const double *a, const double *b) {
  double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  return sqrt(dot3(d, d));
}

// a length between a thing and its image counts as asymmetry
static int is_near(comparison *c, double length) {
  c->asymmetry = fmax(c->asymmetry, length);
  return length <= c->length;
}

/// Unit quaternion of a proper rotation matrix, row-major.
static void to_quaternion(const double *R, double *q) {
  double trace = R[0] + R[4] + R[8];
  int i = R[4] > R[0] ? 1 : 0;
  if (R[8] > R[4 * i]) i = 2;
  if (trace > 0) {
    double s = 2 * sqrt(1 + trace);
    q[0] = s / 4, q[1] = (R[7] - R[5]) / s, q[2] = (R[2] - R[6]) / s, q[3] = (R[3] - R[1]) / s;
    return;
  }
  int j = (i + 1) % 3, k = (i + 2) % 3;
  double s = 2 * sqrt(fmax(1 + R[4 * i] - R[4 * j] - R[4 * k], 0));
  q[0] = (R[3 * k + j] - R[3 * j + k]) / s;
  q[1 + i] = s / 4;
  q[1 + j] = (R[3 * j + i] + R[3 * i + j]) / s;
  q[1 + k] = (R[3 * k + i] + R[3 * i + k]) / s;
}

static cav_status unlike(const cav_model *m, int j, int other, const char *what, cav_error *error) {
  return cav_file_fail(
      error, CAV_BAD_INPUT, 0,
      "the model is not its own mirror image: %s of joint '%.60s' and of its counterpart '%.60s' differ", what,
      m->joint[j].name, m->joint[other].name);
}

/// Fills the image of one joint and checks that it is one.
static cav_status fit_joint(comparison *c, int j, cav_image *image) {
  const cav_model *m = c->model;
  const cav_state *state = c->state;
  cav_error *error = c->error;
  int axis = c->axis;
  int other = image->joint;
  const cav_joint *a = &m->joint[j], *b = &m->joint[other];
  const cav_pose *A = &state->link[a->link], *B = &state->link[b->link];
  int scalar = a->type == CAV_JOINT_HINGE || a->type == CAV_JOINT_SLIDE;
  if (a->type != b->type) return unlike(m, j, other, "the types", error);
  if (j - m->link[a->link].joint != other - m->link[b->link].joint)
    return unlike(m, j, other, "the places on their bodies", error);

  // anchors, and what is left of axes
  double at[3], at_b[3], mirrored[3], along[3], along_b[3];
  rotate(at, A->rotation, a->pos), rotate(at_b, B->rotation, b->pos);
  for (int k = 0; k < 3; k++) at[k] += A->pos[k], at_b[k] += B->pos[k];
  reflect(axis, at, mirrored);
  if (scalar) {
    double image_axis[3];
    rotate(along, A->rotation, a->axis), rotate(along_b, B->rotation, b->axis);
    reflect(axis, along, image_axis);
    double s = dot3(image_axis, along_b) * (a->type == CAV_JOINT_HINGE ? -1 : 1);
    if (fabs(fabs(s) - 1) > axis_least) return unlike(m, j, other, "the axes", error);
    image->sign = s > 0 ? 1 : -1;
    // a hinge may sit anywhere on its axis, a slide anywhere
    double off = dot3(mirrored, along_b) - dot3(at_b, along_b);
    for (int k = 0; k < 3; k++) mirrored[k] -= off * along_b[k];
  } else {
    // -N = -R_a' M R_b
    double N[9];
    for (int r = 0; r < 3; r++)
      for (int i = 0; i < 3; i++) {
        double sum = 0;
        for (int k = 0; k < 3; k++) sum += A->rotation[3 * k + r] * (k == axis ? -1 : 1) * B->rotation[3 * k + i];
        N[3 * r + i] = -sum;
      }
    to_quaternion(N, image->rotation);
  }
  if (a->type != CAV_JOINT_SLIDE && !is_near(c, apart(mirrored, at_b)))
    return unlike(m, j, other, "the anchors", error);
  if (a->limited != b->limited) return unlike(m, j, other, "the ranges", error);
  return CAV_OK;
}

static const char *body_of(const cav_model *m, int link) { return m->body[m->link[link].body].name; }

/// Masses of a link and its image, and where they are.
static cav_status fit_link(comparison *c, int l, int other) {
  const cav_model *m = c->model;
  const cav_state *state = c->state;
  int axis = c->axis;
  const double *I = state->inertia + 6 * l, *J = state->inertia + 6 * other;
  static const int first[] = {0, 1, 2, 0, 0, 1}, second[] = {0, 1, 2, 1, 2, 2};
  double com[3], scale = I[0] + I[1] + I[2];
  reflect(axis, state->com + 3 * l, com);
  double heavier = fabs(m->link[l].mass - m->link[other].mass) / (m->link[l].mass + near), turned = 0;
  int same = m->link[l].mass == 0 || is_near(c, apart(com, state->com + 3 * other));
  for (int k = 0; k < 6; k++) {
    int flips = (first[k] == axis) != (second[k] == axis);
    turned = fmax(turned, fabs((flips ? -I[k] : I[k]) - J[k]) / (scale + near));
  }
  // masses that differ are a point that is off by that fraction of the extent, say
  same = same && heavier <= mass_least && turned <= moment_least;
  c->asymmetry = fmax(c->asymmetry, fmax(heavier, turned) * c->length);
  if (same) return CAV_OK;
  return cav_file_fail(c->error, CAV_BAD_INPUT, 0,
                       "the model is not its own mirror image: the masses of body '%.60s' and of its counterpart "
                       "'%.60s' differ",
                       body_of(m, l), body_of(m, other));
}

static int touches(const cav_model *m, int g) {
  for (int p = 0; p < m->npair; p++)
    if (m->pair[p].geom1 == g || m->pair[p].geom2 == g) return 1;
  return 0;
}

/// Every geom that may touch has one like it on the image of its link.
static cav_status fit_geoms(comparison *c, const int *link) {
  const cav_model *m = c->model;
  const cav_state *state = c->state;
  for (int g = 0; g < m->ngeom; g++) {
    const cav_geom *a = &m->geom[g];
    if (a->link == 0 || !touches(m, g)) continue;
    cav_pose at, there;
    double mirrored[3];
    cav_object_pose(m, state, CAV_OBJECT_GEOM, g, &at);
    reflect(c->axis, at.pos, mirrored);
    double best = INFINITY;
    for (int i = 0; i < m->ngeom; i++) {
      const cav_geom *b = &m->geom[i];
      if (b->link != link[a->link] || b->type != a->type || !touches(m, i)) continue;
      cav_object_pose(m, state, CAV_OBJECT_GEOM, i, &there);
      double off = apart(mirrored, there.pos);
      for (int k = 0; k < 3; k++) off = fmax(off, fabs(a->size[k] - b->size[k]));
      best = fmin(best, off);
    }
    if (!(best <= c->length))
      return cav_file_fail(
          c->error, CAV_BAD_INPUT, 0,
          "the model is not its own mirror image: geom %d ('%.60s') of body '%.60s' has no counterpart on "
          "'%.60s'",
          g, a->name, body_of(m, a->link), body_of(m, link[a->link]));
    is_near(c, best);
  }
  return CAV_OK;
}

// the largest distance between centres of mass of what moves
static double extent(const cav_model *m, const cav_state *state) {
  double most = 0;
  for (int i = 1; i < m->nlink; i++)
    for (int k = 1; k < i; k++) most = fmax(most, apart(state->com + 3 * i, state->com + 3 * k));
  return most;
}

cav_status cav_mirror_find(const cav_problem *problem, int axis, cav_image *image, int *link, double *asymmetry,
                           cav_error *error) {
  const cav_model *m = problem->model;
  cav_status status = pair_joints(problem, image, error);
  if (status != CAV_OK) return status;
  cav_state *state = cav_state_new(m);
  if (!state) return cav_file_fail(error, CAV_NO_MEMORY, 0, "not enough memory for the mirror image of this model");
  status = cav_position(m, state, m->q0);
  if (status != CAV_OK) cav_file_fail(error, status, 0, "the model's own configuration cannot be evaluated");
  comparison c = {.model = m, .state = state, .axis = axis, .error = error};
  if (status == CAV_OK) c.length = least * extent(m, state) + near;
  for (int j = 0; j < m->njoint && status == CAV_OK; j++) status = fit_joint(&c, j, &image[j]);
  for (int l = 0; l < m->nlink; l++) link[l] = l == 0 ? 0 : m->joint[image[m->link[l].joint].joint].link;
  for (int l = 1; l < m->nlink && status == CAV_OK; l++) status = fit_link(&c, l, link[l]);
  if (status == CAV_OK) status = fit_geoms(&c, link);
  *asymmetry = c.asymmetry > near ? c.asymmetry : 0;
  cav_state_free(state);
  return status;
}
