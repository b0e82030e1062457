/// One period on, by the verifier's own arithmetic: from what problem.h says of a cycle, poses of links and motion
/// subspaces at the model's configuration, with nothing of the optimiser's map (periodicity.c, mirror.c). The world
/// moves by x -> A (x - c) + c + d, where A is the rotation about the vertical or the reflection. A frame R of a link
/// goes to A R S on the link's counterpart; S makes a left-handed frame right-handed again and is what the two frames
/// at the model's configuration say, S = R' A R_image. Hence, with det the determinant of A and at q0 both images of
/// each other:
///   free   x -> A (x - c) + c + d, R -> A R S;   linear velocity A v, angular velocity det S' w (body axes)
///   ball   Q -> Q0_image S' Q0' Q S;             angular velocity det S' w
///   slide, hinge   x -> x0_image + s (x - x0) + shift of a root's slide, with s the sign by which the images of their
///   axes agree
/// Counterparts are the pairs that the problem declares, or joints whose names differ in the word or letter of the
/// side; all others are their own. Whether the model is blind to the map is not asked here: verification measures the
/// knots one period on as it does the knots (verify.c), and cav_cycle_image_error compares poses of links.
#include "cycle_image.h"

#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/dynamics.h"

static const double near = 1e-6; // m, or of a cosine: what files leave open

typedef struct joint_image {
  int joint;       // counterpart
  double frame[9]; // S, free and ball
  double sign;     // s, slide and hinge
  double shift;    // m, added to the slide of a root
} joint_image;

struct cav_cycle_image {
  const cav_model *model;
  double map[9], determinant, centre[3], translation[3];
  joint_image *joint; // [njoint]
  double *frame;      // [nlink*9] S of links
  double *offset; // [nlink*3] centre of mass of the counterpart, in its frame, from where the image of the link's is
  int uneven;     // 1: masses are not images of each other
};

// ---------------------------------------------------------------- matrices, row-major

static void product(const double *a, const double *b, double *out) {
  for (int i = 0; i < 9; i++)
    out[i] = a[i - i % 3] * b[i % 3] + a[i - i % 3 + 1] * b[3 + i % 3] + a[i - i % 3 + 2] * b[6 + i % 3];
}

static void transpose(const double *a, double *out) {
  for (int i = 0; i < 9; i++) out[i] = a[3 * (i % 3) + i / 3];
}

static void map_vector(const double *a, const double *x, double *out) {
  for (int i = 0; i < 3; i++) out[i] = a[3 * i] * x[0] + a[3 * i + 1] * x[1] + a[3 * i + 2] * x[2];
}

// columns are images of the axes: e -> e + 2 w (u x e) + 2 u x (u x e)
static void matrix_of_quat(const double *quat, double *out) {
  double n = sqrt(quat[0] * quat[0] + quat[1] * quat[1] + quat[2] * quat[2] + quat[3] * quat[3]);
  double w = quat[0] / n, u[3] = {quat[1] / n, quat[2] / n, quat[3] / n};
  for (int k = 0; k < 3; k++) {
    int i = (k + 1) % 3, j = (k + 2) % 3;
    out[3 * k + k] = 1 - 2 * (u[i] * u[i] + u[j] * u[j]);
    out[3 * i + k] = 2 * (u[k] * u[i] + w * u[j]);
    out[3 * j + k] = 2 * (u[k] * u[j] - w * u[i]);
  }
}

// the largest of the four components first: none is lost in a difference
static void quat_of_matrix(const double *a, double *quat) {
  double square[4] = {1 + a[0] + a[4] + a[8], 1 + a[0] - a[4] - a[8], 1 - a[0] + a[4] - a[8], 1 - a[0] - a[4] + a[8]};
  int largest = 0;
  for (int k = 1; k < 4; k++) {
    if (square[k] > square[largest]) largest = k;
  }
  double twist[3] = {a[7] - a[5], a[2] - a[6], a[3] - a[1]}, size = sqrt(square[largest]);
  if (largest == 0) {
    quat[0] = size / 2;
    for (int k = 0; k < 3; k++) quat[1 + k] = twist[k] / (2 * size);
    return;
  }
  int i = largest - 1;
  quat[0] = twist[i] / (2 * size);
  for (int k = 0; k < 3; k++) quat[1 + k] = k == i ? size / 2 : (a[3 * i + k] + a[3 * k + i]) / (2 * size);
}

static void map_point(const cav_cycle_image *image, const double *p, double *out) {
  double arm[3] = {p[0] - image->centre[0], p[1] - image->centre[1], p[2] - image->centre[2]};
  map_vector(image->map, arm, out);
  for (int k = 0; k < 3; k++) out[k] += image->centre[k] + image->translation[k];
}

// ---------------------------------------------------------------- applying

void cav_cycle_image_configuration(const cav_cycle_image *image, const double *q, double *out) {
  const cav_model *model = image->model;
  for (int j = 0; j < model->njoint; j++) {
    const joint_image *to = &image->joint[j];
    const cav_joint *joint = &model->joint[j], *other = &model->joint[to->joint];
    double a[9], b[9], c[9];
    if (joint->type == CAV_JOINT_FREE) {
      map_point(image, q + joint->q, out + other->q);
      matrix_of_quat(q + joint->q + 3, a);
      product(image->map, a, b);
      product(b, to->frame, a);
      quat_of_matrix(a, out + other->q + 3);
    } else if (joint->type == CAV_JOINT_BALL) {
      // from the right: S, Q, Q0', S', Q0_image
      matrix_of_quat(q + joint->q, a);
      product(a, to->frame, b);
      matrix_of_quat(model->q0 + joint->q, a);
      transpose(a, c);
      product(c, b, a);
      transpose(to->frame, c);
      product(c, a, b);
      matrix_of_quat(model->q0 + other->q, a);
      product(a, b, c);
      quat_of_matrix(c, out + other->q);
    } else {
      out[other->q] =
          model->q0[other->q] + to->sign * (q[joint->q] - model->q0[joint->q]) + image->joint[to->joint].shift;
    }
  }
}

// out = map x or map' x
static void map_way(const double *map, int way, double scale, const double *x, double *out) {
  double back[9], y[3];
  transpose(map, back);
  map_vector(way > 0 ? map : back, x, y);
  for (int k = 0; k < 3; k++) out[k] = scale * y[k];
}

void cav_cycle_image_tangent(const cav_cycle_image *image, int way, const double *v, double *out) {
  const cav_model *model = image->model;
  for (int j = 0; j < model->njoint; j++) {
    const joint_image *to = &image->joint[j];
    const cav_joint *joint = &model->joint[j], *other = &model->joint[to->joint];
    const double *from = v + (way > 0 ? joint->dof : other->dof);
    double *at = out + (way > 0 ? other->dof : joint->dof);
    if (joint->type == CAV_JOINT_FREE) {
      map_way(image->map, way, 1, from, at);
      map_way(to->frame, -way, image->determinant, from + 3, at + 3);
    } else if (joint->type == CAV_JOINT_BALL) {
      map_way(to->frame, -way, image->determinant, from, at);
    } else {
      *at = to->sign * *from;
    }
  }
}

double cav_cycle_image_error(const cav_cycle_image *image, int link, const cav_pose *pose, const double *com,
                             const cav_state *state) {
  const cav_model *model = image->model;
  int other = model->joint[image->joint[model->link[link].joint].joint].link;
  double at[3], a[9], b[9], distance = 0, chord = 0;
  map_point(image, com + 3 * link, at);
  map_vector(state->link[other].rotation, image->offset + 3 * link, a);
  for (int k = 0; k < 3; k++) at[k] += a[k];
  for (int k = 0; k < 3; k++) distance += pow(at[k] - state->com[3 * other + k], 2);
  product(image->map, pose[link].rotation, a);
  product(a, image->frame + 9 * link, b);
  // of two rotations by an angle apart: |A - B|^2 = 8 sin^2(angle/2)
  for (int k = 0; k < 9; k++) chord += pow(b[k] - state->link[other].rotation[k], 2);
  return fmax(sqrt(distance), 2 * asin(fmin(sqrt(chord / 8), 1)));
}

int cav_cycle_image_is_uneven(const cav_cycle_image *image) { return image->uneven; }

// ---------------------------------------------------------------- counterparts

__attribute__((format(printf, 3, 4))) static cav_status refuse(cav_error *error, cav_status status, const char *format,
                                                               ...) {
  if (!error) return status;
  va_list list;
  va_start(list, format);
  *error = (cav_error){.status = status};
  vsnprintf(error->text, sizeof error->text, format, list);
  va_end(list);
  return status;
}

static int is_gap(char c) { return !c || strchr("_-. ", c); }

// b is a with one word for a side in the place of the other
static int differ_in_word(const char *a, const char *b) {
  static const char *const word[][2] = {{"left", "right"}, {"Left", "Right"}, {"LEFT", "RIGHT"}};
  for (int i = 0; i < 6; i++) {
    const char *mine = word[i / 2][i % 2], *yours = word[i / 2][1 - i % 2];
    const char *at = strstr(a, mine);
    if (!at) continue;
    size_t before = (size_t)(at - a);
    if (!strncmp(a, b, before) && !strncmp(b + before, yours, strlen(yours)))
      return !strcmp(at + strlen(mine), b + before + strlen(yours));
  }
  return 0;
}

// a and b differ in one letter, l and r, which ends a token of one letter or of a capital and it
static int differ_in_letter(const char *a, const char *b) {
  size_t n = strlen(a), i = 0;
  if (n != strlen(b)) return 0;
  while (i < n && a[i] == b[i]) i++;
  if (i == n || strcmp(a + i + 1, b + i + 1) || !is_gap(a[i + 1])) return 0;
  static const char *const letter[] = {"lr", "rl", "LR", "RL"};
  int side = 0;
  for (int k = 0; k < 4; k++) side |= a[i] == letter[k][0] && b[i] == letter[k][1];
  return side && (i == 0 || is_gap(a[i - 1]) || (isupper((unsigned char)a[i - 1]) && (i == 1 || is_gap(a[i - 2]))));
}

static cav_status pair_joints(cav_cycle_image *image, const cav_cycle *cycle, cav_error *error) {
  const cav_model *model = image->model;
  for (int j = 0; j < model->njoint; j++) {
    const char *name = model->joint[j].name;
    int other = -1;
    for (int k = 0; k < cycle->npair; k++) {
      for (int side = 0; side < 2; side++) {
        if (cycle->pair[k][side] == j) other = cycle->pair[k][1 - side];
      }
    }
    for (int word = 1; word >= 0 && other < 0 && *name; word--) {
      for (int k = 0; k < model->njoint && other < 0; k++) {
        const char *candidate = model->joint[k].name;
        if (word ? differ_in_word(name, candidate) : differ_in_letter(name, candidate)) other = k;
      }
    }
    image->joint[j].joint = other < 0 ? j : other;
    if (other >= model->njoint) return refuse(error, CAV_BAD_INPUT, "the cycle pairs a joint that is not there");
  }
  for (int j = 0; j < model->njoint; j++) {
    int other = image->joint[j].joint;
    if (image->joint[other].joint != j || model->joint[other].type != model->joint[j].type)
      return refuse(error, CAV_BAD_INPUT, "joint '%.80s' and its counterpart in the cycle are not each other's",
                    model->joint[j].name);
  }
  return CAV_OK;
}

// ---------------------------------------------------------------- making

// S of links and joints, signs of scalar joints, from the poses at the model's configuration
static cav_status read_frames(cav_cycle_image *image, const cav_state *state, cav_error *error) {
  const cav_model *model = image->model;
  for (int j = 0; j < model->njoint; j++) {
    joint_image *to = &image->joint[j];
    const cav_joint *joint = &model->joint[j], *other = &model->joint[to->joint];
    double back[9], mapped[9], axis[3];
    transpose(state->link[joint->link].rotation, back);
    product(back, image->map, mapped);
    product(mapped, state->link[other->link].rotation, to->frame);
    memcpy(image->frame + 9 * joint->link, to->frame, sizeof to->frame);
    if (joint->type == CAV_JOINT_FREE || joint->type == CAV_JOINT_BALL) continue;
    // angular or linear part of the motion subspace
    int part = joint->type == CAV_JOINT_HINGE ? 0 : 3;
    const double *mine = state->axis + 6 * joint->dof + part, *yours = state->axis + 6 * other->dof + part;
    map_vector(image->map, mine, axis);
    double cosine = (part ? 1 : image->determinant) * (axis[0] * yours[0] + axis[1] * yours[1] + axis[2] * yours[2]);
    if (fabs(fabs(cosine) - 1) > near)
      return refuse(error, CAV_BAD_INPUT, "joint '%.80s' does not move as its counterpart in the cycle", joint->name);
    to->sign = cosine > 0 ? 1 : -1;
  }
  return CAV_OK;
}

// inertia of a link about its centre of mass, world axes
static void turn_inertia(const cav_link *link, const double *rotation, double *out) {
  const double *i = link->inertia, own[9] = {i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2]};
  double back[9], half[9];
  transpose(rotation, back);
  product(own, back, half);
  product(rotation, half, out);
}

// whether masses and inertia of a link and its counterpart are images of each other, but for what files leave open
static int is_image(const cav_cycle_image *image, const cav_state *state, int link, int other) {
  const cav_link *mine = &image->model->link[link], *yours = &image->model->link[other];
  double inertia[9], half[9], back[9], mapped[9], there[9], most = 0,
                                                            off = fabs(mine->mass - yours->mass) / yours->mass;
  turn_inertia(mine, state->link[link].rotation, inertia);
  turn_inertia(yours, state->link[other].rotation, there);
  transpose(image->map, back);
  product(inertia, back, half);
  product(image->map, half, mapped);
  for (int k = 0; k < 9; k++) most = fmax(most, fabs(there[k]));
  for (int k = 0; k < 9; k++) off = fmax(off, fabs(mapped[k] - there[k]) / most);
  return !(off > near);
}

// what masses are off by, and centres of mass of trees that float
static void read_masses(cav_cycle_image *image, const cav_state *state) {
  const cav_model *model = image->model;
  for (int l = 1; l < model->nlink; l++) {
    const int root = model->link[l].root, other = model->joint[image->joint[model->link[l].joint].joint].link;
    image->uneven |= !is_image(image, state, l, other);
    if (model->joint[model->link[root].joint].type != CAV_JOINT_FREE) continue;
    const double *from = state->link[root].pos, *to = state->link[model->link[other].root].pos;
    double arm[3], at[3], back[9];
    for (int k = 0; k < 3; k++) arm[k] = state->com[3 * l + k] - from[k];
    map_vector(image->map, arm, at);
    for (int k = 0; k < 3; k++) arm[k] = state->com[3 * other + k] - to[k] - at[k];
    if (arm[0] * arm[0] + arm[1] * arm[1] + arm[2] * arm[2] < near * near) continue;
    transpose(state->link[other].rotation, back);
    map_vector(back, arm, image->offset + 3 * l);
    image->uneven = 1;
  }
}

// without a reflection joints are their own counterparts, and nothing but the place of the roots changes
static void read_identity(cav_cycle_image *image) {
  static const double unit[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  for (int j = 0; j < image->model->njoint; j++) {
    image->joint[j] = (joint_image){.joint = j, .sign = 1};
    memcpy(image->joint[j].frame, unit, sizeof unit);
  }
  for (int l = 0; l < image->model->nlink; l++) memcpy(image->frame + 9 * l, unit, sizeof unit);
}

// the slides of a root take up the translation, by sweeps over them; what floats takes it as it is
static cav_status read_shifts(cav_cycle_image *image, const cav_cycle *cycle, const cav_state *state,
                              cav_error *error) {
  enum { SWEEPS = 100 };
  const cav_model *model = image->model;
  for (int l = 1; l < model->nlink; l++) {
    const cav_link *link = &model->link[l];
    if (link->parent != 0 || model->joint[link->joint].type == CAV_JOINT_FREE) continue;
    double left[3] = {image->translation[0], image->translation[1], image->translation[2]};
    for (int k = 0; k < SWEEPS * link->njoint; k++) {
      int j = link->joint + k % link->njoint;
      if (model->joint[j].type != CAV_JOINT_SLIDE) continue;
      const double *axis = state->axis + 6 * model->joint[j].dof + 3;
      double more = axis[0] * left[0] + axis[1] * left[1] + axis[2] * left[2];
      image->joint[j].shift += more;
      for (int i = 0; i < 3; i++) left[i] -= more * axis[i];
    }
    if (fabs(left[0]) + fabs(left[1]) + fabs(left[2]) > near || cycle->rotation != 0)
      return refuse(error, CAV_BAD_INPUT, "body '%.80s' cannot follow the cycle", model->body[link->body].name);
  }
  return CAV_OK;
}

static void read_world(cav_cycle_image *image, const cav_problem *problem) {
  const cav_cycle *cycle = &problem->cycle;
  const cav_model *model = image->model;
  double c = cos(cycle->rotation), s = sin(cycle->rotation);
  const double map[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
  memcpy(image->map, map, sizeof map);
  memcpy(image->translation, cycle->translation, sizeof image->translation);
  image->determinant = 1;
  if (cycle->mirror != CAV_MIRROR_NONE) {
    image->map[cycle->mirror == CAV_MIRROR_X ? 0 : 4] *= -1;
    image->determinant = -1;
    return;
  }
  int root = 0;
  while (root < model->njoint && model->joint[root].type != CAV_JOINT_FREE) root++;
  if (root < model->njoint) memcpy(image->centre, problem->q_start + model->joint[root].q, 2 * sizeof(double));
}

cav_cycle_image *cav_cycle_image_new(const cav_problem *problem, cav_error *error) {
  const cav_model *model = problem->model;
  cav_cycle_image *image = calloc(1, sizeof *image);
  cav_state *state = cav_state_new(model);
  if (image) {
    image->model = model;
    image->joint = calloc((size_t)model->njoint + 1, sizeof *image->joint);
    image->frame = calloc((size_t)model->nlink, 9 * sizeof *image->frame);
    image->offset = calloc((size_t)model->nlink, 3 * sizeof *image->offset);
  }
  cav_status status = CAV_OK;
  if (!image || !state || !image->joint || !image->frame || !image->offset)
    status = refuse(error, CAV_NO_MEMORY, "not enough memory for the cycle");
  if (status == CAV_OK && problem->cycle.mirror != CAV_MIRROR_NONE && problem->cycle.rotation != 0)
    status = refuse(error, CAV_BAD_INPUT, "a mirrored cycle cannot turn");
  if (status == CAV_OK && cav_position(model, state, model->q0) != CAV_OK)
    status = refuse(error, CAV_NOT_FINITE, "the model's own configuration cannot be evaluated");
  if (status == CAV_OK) {
    read_world(image, problem);
    if (problem->cycle.mirror == CAV_MIRROR_NONE) {
      read_identity(image);
    } else {
      status = pair_joints(image, &problem->cycle, error);
      if (status == CAV_OK) status = read_frames(image, state, error);
      if (status == CAV_OK) read_masses(image, state);
    }
  }
  if (status == CAV_OK) status = read_shifts(image, &problem->cycle, state, error);
  cav_state_free(state);
  if (status == CAV_OK) return image;
  cav_cycle_image_free(image);
  return NULL;
}

void cav_cycle_image_free(cav_cycle_image *image) {
  if (!image) return;
  free(image->joint);
  free(image->frame);
  free(image->offset);
  free(image);
}
