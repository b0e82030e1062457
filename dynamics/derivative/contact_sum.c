/// Contacts in the derivatives: their matrices at their links, carried to one point of the tree and summed over
/// subtrees; those between two moving links; derivatives of one contact by the dofs. Those of a contact by its
/// links' twists are contact.c's; the products of the sums with axes of dofs are smooth.c's.
#include "analytic.h"
#include "sensor.h"
#include "vectors.h"

// X with X b = b about the reference carried to a point d away: shifted = X' M X, M about the point
CAV_VECTOR_BODY void shift(double shifted[36], const double *M, const double d[3]) {
  double right[6][6];
  // linear at the point = linear + angular x d
  for (int r = 0; r < 6; r++) {
    const double *row = M + 6 * r;
    right[r][0] = row[0] - row[4] * d[2] + row[5] * d[1];
    right[r][1] = row[1] + row[3] * d[2] - row[5] * d[0];
    right[r][2] = row[2] - row[3] * d[1] + row[4] * d[0];
    for (int c = 3; c < 6; c++) right[r][c] = row[c];
  }
  for (int c = 0; c < 6; c++) {
    shifted[c] = right[0][c] - right[4][c] * d[2] + right[5][c] * d[1];
    shifted[6 + c] = right[1][c] + right[3][c] * d[2] - right[5][c] * d[0];
    shifted[12 + c] = right[2][c] - right[3][c] * d[1] + right[4][c] * d[0];
    for (int r = 3; r < 6; r++) shifted[6 * r + c] = right[r][c];
  }
}

// the wrench of a contact on its second link, about its position
CAV_VECTOR_BODY void add_impulse(const cav_contact *c, double wrench[6]) {
  for (int i = 0; i < c->dim; i++) {
    double *part = i < 3 ? wrench + 3 : wrench;
    axpy3(part, part, c->impulse[i], c->frame + 3 * (i % 3));
  }
}

// a link whose subtree a contact pushes: its sums begin at zero
static void touch_link(cav_derivative_store *s, int link) {
  if (s->touched[link]) return;
  s->touched[link] = 1;
  memset(s->by_motion + CAV_TWIST_BLOCK * link, 0, CAV_TWIST_BLOCK * sizeof *s->by_motion);
  memset(s->by_now + CAV_TWIST_BLOCK * link, 0, CAV_TWIST_BLOCK * sizeof *s->by_now);
  memset(s->by_next + CAV_TWIST_BLOCK * link, 0, CAV_TWIST_BLOCK * sizeof *s->by_next);
}

// matrices of one contact at one of its links: own wrench by own motion, less what is carried along with the link
CAV_VECTOR_BODY void contact_at_link_body(const cav_derivative_task *t, const cav_contact *c,
                                          const cav_contact_jacobian *derivative, int side) {
  int link = side ? c->link2 : c->link1;
  double d[3], whole[6] = {0}, own[36], sign = side ? 1 : -1;
  sub3(d, c->pos, t->state->reference + 3 * link);
  add_impulse(c, whole);
  for (int k = 0; k < 6; k++) {
    double twist[6] = {0}, carried[6];
    twist[k] = 1;
    cross3(carried, twist, whole);
    cross_add3(carried, twist + 3, whole + 3);
    cross3(carried + 3, twist, whole + 3);
    for (int r = 0; r < 6; r++) own[6 * r + k] = sign * (derivative->wrench[side][k][r] - carried[r]);
  }
  touch_link(t->s, link);
  double motion[36], velocity[36], before[36], keep = 1 - c->damping[0], *to = t->s->by_motion + CAV_TWIST_BLOCK * link;
  double *now = t->s->by_now + CAV_TWIST_BLOCK * link, *next = t->s->by_next + CAV_TWIST_BLOCK * link;
  shift(motion, own, d);
  shift(velocity, &derivative->by_velocity[0][0], d);
  for (int i = 0; i < 36; i++) to[i] += motion[i];
  if (t->state->options.stops) {
    shift(before, &derivative->by_before[0][0], d);
    for (int i = 0; i < 36; i++) now[i] += before[i];
  } else {
    for (int i = 0; i < 36; i++) now[i] += keep * velocity[i];
  }
  for (int i = 0; i < 36; i++) next[i] += velocity[i];
}
CAV_BY_VECTORS(contact_at_link,
               (const cav_derivative_task *t, const cav_contact *c, const cav_contact_jacobian *derivative, int side),
               (t, c, derivative, side))

// whether some dof moves both links of a contact: then contact_between does all of it
static int is_within_tree(const cav_model *model, const cav_contact *c) {
  return c->link1 > 0 && c->link2 > 0 && common_dof(model, (int[]){c->link1, c->link2}) >= 0;
}

void cav_derivative_contacts(const cav_derivative_task *t) {
  cav_derivative_store *s = t->s;
  size_t n = (size_t)t->model->nlink;
  memset(s->touched, 0, n * sizeof *s->touched);
  if (t->state->ncontact == 0) return;
  cav_pair_manifolds manifolds;
  manifolds.pair = -1;
  for (int i = 0; i < t->state->ncontact; i++) {
    const cav_contact *c = &t->state->contact[i];
    cav_contact_differentiate(t->model, t->state, c, 0, &manifolds, &s->contact[i]);
    if (s->contact[i].idle || is_within_tree(t->model, c)) continue;
    if (c->link1 > 0) contact_at_link(t, c, &s->contact[i], 0);
    if (c->link2 > 0) contact_at_link(t, c, &s->contact[i], 1);
  }
  for (int i = t->model->nlink - 1; i > 0; i--) {
    int parent = t->model->link[i].parent;
    if (parent <= 0 || !s->touched[i]) continue;
    touch_link(s, parent);
    for (int k = 0; k < CAV_TWIST_BLOCK; k++) {
      s->by_motion[CAV_TWIST_BLOCK * parent + k] += s->by_motion[CAV_TWIST_BLOCK * i + k];
      s->by_now[CAV_TWIST_BLOCK * parent + k] += s->by_now[CAV_TWIST_BLOCK * i + k];
      s->by_next[CAV_TWIST_BLOCK * parent + k] += s->by_next[CAV_TWIST_BLOCK * i + k];
    }
  }
}

// axes about a contact of the dofs from one to another that is left out, towards the root; their number
static int axes_about(const cav_derivative_task *t, const cav_contact *c, int from, int to, double *S) {
  int n = 0;
  for (int k = from; k != to; k = t->model->dof[k].parent, n++) {
    motion_at(S + 6 * n, t->state->axis + 6 * k, t->state->reference + 3 * t->model->dof[k].link, c->pos);
  }
  return n;
}

/// A contact between two moving links: dofs that move the one, the other, and both.
typedef struct between {
  int link[2], common;
  double *axes[2], *shared;
  double whole[6];
} between;

// dots of a vector with numbers of four dofs each
#define DOT3(e, x) ((e)[0] * (x)[0] + (e)[1] * (x)[1] + (e)[2] * (x)[2])
#define DOT6(e, x) (DOT3(e, x) + DOT3((e) + 3, (x) + 3))

// axes of four dofs of a path from the k-th on, or their drifts, at an arm from the reference
static inline __attribute__((always_inline)) void motion_of_four(const double *path, size_t n, int k, const double d[3],
                                                                 cav_four motion[6]) {
  cav_four S[6];
  for (int i = 0; i < 6; i++) S[i] = *(const cav_four *)(path + (size_t)i * n + k);
  for (int i = 0; i < 3; i++) motion[i] = S[i];
  motion[3] = S[3] + S[1] * d[2] - S[2] * d[1];
  motion[4] = S[4] + S[2] * d[0] - S[0] * d[2];
  motion[5] = S[5] + S[0] * d[1] - S[1] * d[0];
}

// adds four columns of a row of the results, of the dofs of a path from the k-th on, as far as there are any
static inline __attribute__((always_inline)) void add_columns(const cav_derivative_task *t, int row, int k, int end,
                                                              const cav_four *q, const cav_four *push,
                                                              const cav_four *before) {
  for (int i = 0; i < 4 && k + i < end; i++) {
    int at = row * t->nv + t->s->path.dof[k + i];
    t->dq[at] += (*q)[i];
    t->dv[at] += (*before)[i];
    t->dn[at] -= (*push)[i];
  }
}

// columns: the wrenches on both links by the dofs of a path from `first` on, which move the one of side
CAV_VECTOR_BODY void between_columns_body(const cav_derivative_task *t, const cav_contact *c,
                                          const cav_contact_jacobian *derivative, const between *b, int side, int first,
                                          int end, const double d[3]) {
  const double *K = &derivative->by_velocity[0][0], *M = &derivative->wrench[side][0][0], *path = t->s->path.at;
  const double *L = &derivative->by_before[0][0];
  const int stops = t->state->options.stops;
  const double keep = stops ? 0 : 1 - c->damping[0], sign = side ? 1 : -1, on = sign * t->inverse_h, *w = b->whole, *S;
  const size_t n = (size_t)t->s->path.stride;
  for (int k = first; k < end; k += 4) {
    cav_four axis[6], now[6], next[6], last[6], held[6], dq[6], carried[6], own[6];
    motion_of_four(path + CAV_OF_AXIS * n, n, k, d, axis);
    motion_of_four(path + CAV_OF_NOW * n, n, k, d, now);
    motion_of_four(path + CAV_OF_NEXT * n, n, k, d, next);
    for (int i = 0; i < 6; i++) last[i] = now[i], now[i] = sign * (keep * now[i] - next[i]);
    for (int i = 0; i < 6; i++) {
      dq[i] = axis[0] * M[i];
      for (int j = 1; j < 6; j++) dq[i] = dq[i] + axis[j] * M[6 * j + i];
      dq[i] = dq[i] + DOT6(K + 6 * i, now);
      next[i] = sign * DOT6(K + 6 * i, axis);
    }
    for (int i = 0; i < 6 && stops; i++) {
      dq[i] = dq[i] + sign * DOT6(L + 6 * i, last);
      held[i] = sign * DOT6(L + 6 * i, axis);
    }
    S = b->axes[!side];
    for (int row = cav_last_dof(t->model, b->link[!side]); row != b->common; row = t->model->dof[row].parent, S += 6) {
      cav_four q = on * DOT6(S, dq), push = DOT6(S, next) * on, before = stops ? DOT6(S, held) * on : keep * push;
      add_columns(t, row, k, end, &q, &push, &before);
    }
    if (b->common < 0) continue;
    // rows of the same link: there smooth.c carries the wrench along with it; the dofs that move both links feel nothing
    for (int i = 0, j = 1, l = 2; i < 3; i++, j = (j + 1) % 3, l = (l + 1) % 3) {
      carried[i] = axis[j] * w[l] - axis[l] * w[j];
      carried[i] = carried[i] + axis[3 + j] * w[3 + l] - axis[3 + l] * w[3 + j];
      carried[3 + i] = axis[j] * w[3 + l] - axis[l] * w[3 + j];
    }
    for (int i = 0; i < 6; i++) own[i] = dq[i] - carried[i];
    S = b->axes[side];
    for (int row = cav_last_dof(t->model, b->link[side]); row != b->common; row = t->model->dof[row].parent, S += 6) {
      cav_four q = -(on * DOT6(S, own)), push = -(DOT6(S, next) * on);
      cav_four before = stops ? -(DOT6(S, held) * on) : keep * push;
      add_columns(t, row, k, end, &q, &push, &before);
    }
    S = b->shared;
    for (int row = b->common; row >= 0; row = t->model->dof[row].parent, S += 6) {
      cav_four q = on * DOT6(S, carried);
      for (int i = 0; i < 4 && k + i < end; i++) t->dq[row * t->nv + t->s->path.dof[k + i]] += q[i];
    }
  }
}
CAV_BY_VECTORS(between_columns,
               (const cav_derivative_task *t, const cav_contact *c, const cav_contact_jacobian *derivative,
                const between *b, int side, int first, int end, const double *d),
               (t, c, derivative, b, side, first, end, d))

// what a contact between two moving links gives: of two trees the wrench on the one by the motion of the other, of one
// tree all, by the dofs between the links only: the others move both, and nothing changes
static void contact_between(const cav_derivative_task *t, const cav_contact *c,
                            const cav_contact_jacobian *derivative) {
  between b = {.link = {c->link1, c->link2}};
  b.common = common_dof(t->model, b.link);
  b.axes[0] = t->s->across;
  b.axes[1] = b.axes[0] + 6 * axes_about(t, c, cav_last_dof(t->model, c->link1), b.common, b.axes[0]);
  b.shared = b.axes[1] + 6 * axes_about(t, c, cav_last_dof(t->model, c->link2), b.common, b.axes[1]);
  if (b.common >= 0) {
    axes_about(t, c, b.common, -1, b.shared);
    add_impulse(c, b.whole);
  }
  for (int side = 0; side < 2; side++) {
    int last = cav_last_dof(t->model, b.link[side]), first = b.common < 0 ? 0 : t->s->depth[b.common] + 1;
    double d[3];
    if (last == b.common) continue;
    sub3(d, c->pos, t->state->reference + 3 * b.link[side]);
    between_columns(t, c, derivative, &b, side, first, cav_derivative_path(t, last), d);
  }
}

void cav_derivative_across(const cav_derivative_task *t) {
  for (int i = 0; i < t->state->ncontact; i++) {
    const cav_contact *c = &t->state->contact[i];
    if (c->link1 > 0 && c->link2 > 0 && !t->s->contact[i].idle) contact_between(t, c, &t->s->contact[i]);
  }
}

/// Rows of a contact's derivatives, [path.stride] each: of the distance, then of each of five kinds CAV_IMPULSE_DIM.
enum { OF_VELOCITY = 1, OF_NEXT = 7, OF_IMPULSE = 13, OF_IMPULSE_NOW = 19, OF_IMPULSE_NEXT = 25 };
_Static_assert(OF_IMPULSE_NEXT + CAV_IMPULSE_DIM == CAV_PATH_ROWS, "the last of these rows is the last that is kept");

// velocities of the point along the axes of the contact
static inline __attribute__((always_inline)) void motion_along(const cav_contact *c, int dim, const double *path,
                                                               size_t n, int k, const double d[3], double sign,
                                                               cav_four motion[6], cav_four *along) {
  motion_of_four(path, n, k, d, motion);
  for (int i = 0; i < dim; i++) {
    const double *e = c->frame + 3 * (i % 3);
    along[i] = sign * DOT3(e, motion + (i < 3 ? 3 : 0));
  }
}

// rows of a contact's derivatives in the dofs of the path, of its impulse the first ones
CAV_VECTOR_BODY void fill_path(const cav_derivative_task *t, const cav_contact *c, int dim,
                               const cav_contact_jacobian *derivative, int side, int impulses, int count,
                               const double d[3], double *to) {
  const size_t n = (size_t)t->s->path.stride;
  const double *path = t->s->path.at, sign = side ? 1 : -1;
  // of the velocity before the step all rows take one part, but in a step after which nothing moves
  const int stops = t->state->options.stops;
  const double keep = stops ? 1 : 1 - c->damping[0];
  for (int k = 0; k < count; k += 4, to += 4) {
    cav_four axis[6], drift[6], x[6], now[6], next[6];
    motion_along(c, dim, path + CAV_OF_NOW * n, n, k, d, sign, drift, now);
    motion_along(c, dim, path + CAV_OF_NEXT * n, n, k, d, sign, drift, next);
    motion_along(c, dim, path + CAV_OF_AXIS * n, n, k, d, sign, axis, x);
    *(cav_four *)to = DOT6(derivative->dist[side], axis);
    for (int i = 0; i < dim; i++) {
      const double *v = derivative->velocity[side][i];
      *(cav_four *)(to + (OF_VELOCITY + i) * n) = DOT6(v, axis) + next[i];
      *(cav_four *)(to + (OF_NEXT + i) * n) = x[i];
    }
    for (int i = 0; i < impulses; i++) {
      const double *H = derivative->hessian[i], *f = derivative->impulse[side][i];
      cav_four by_now = H[0] * now[0], by_next = H[0] * next[0], by_axis = H[0] * x[0], before;
      for (int j = 1; j < dim; j++) {
        by_now += H[j] * now[j];
        by_next += H[j] * next[j];
        by_axis += H[j] * x[j];
      }
      before = by_axis;
      if (stops) by_now = before = (cav_four){0};
      for (int j = 0; j < dim && stops; j++) {
        by_now += (1 - c->damping[j]) * H[j] * now[j];
        before += (1 - c->damping[j]) * H[j] * x[j];
      }
      *(cav_four *)(to + (OF_IMPULSE + i) * n) = DOT6(f, axis) + (keep * by_now - by_next);
      *(cav_four *)(to + (OF_IMPULSE_NOW + i) * n) = keep * before;
      *(cav_four *)(to + (OF_IMPULSE_NEXT + i) * n) = -by_axis;
    }
  }
}
// most contacts have three rows, of whose impulses the first is asked for
CAV_VECTOR_BODY void path_rows_body(const cav_derivative_task *t, const cav_contact *c,
                                    const cav_contact_jacobian *derivative, int side, int impulses, int count,
                                    const double d[3], double *to) {
  if (c->dim == 3 && impulses == 1)
    fill_path(t, c, 3, derivative, side, 1, count, d, to);
  else
    fill_path(t, c, c->dim, derivative, side, impulses, count, d, to);
}
CAV_BY_VECTORS(path_rows,
               (const cav_derivative_task *t, const cav_contact *c, const cav_contact_jacobian *derivative, int side,
                int impulses, int count, const double *d, double *to),
               (t, c, derivative, side, impulses, count, d, to))

// rows of the position in the dofs of the path
CAV_VECTOR_BODY void place_rows_body(const cav_derivative_task *t, const cav_contact_jacobian *derivative, int side,
                                     int count, const double d[3], double *to) {
  const size_t n = (size_t)t->s->path.stride;
  for (int k = 0; k < count; k += 4, to += 4) {
    cav_four axis[6];
    motion_of_four(t->s->path.at + CAV_OF_AXIS * n, n, k, d, axis);
    for (int i = 0; i < 3; i++) *(cav_four *)(to + i * n) = DOT6(derivative->pos[side][i], axis);
  }
}
CAV_BY_VECTORS(place_rows,
               (const cav_derivative_task *t, const cav_contact_jacobian *derivative, int side, int count,
                const double *d, double *to),
               (t, derivative, side, count, d, to))

// adds rows over the dofs of the path to those over all dofs
static void add_path_rows(const cav_derivative_task *t, int rows, int length, const double *from, double *to) {
  for (int i = 0; to && i < rows; i++, from += t->s->path.stride, to += t->nv) {
    for (int k = 0; k < length; k++) to[t->s->path.dof[k]] += from[k];
  }
}

// what the dofs that move one link of a contact do
static void add_side(const cav_derivative_task *t, const cav_contact *c, const cav_contact_jacobian *derivative,
                     int side, cav_contact_derivative *out) {
  int link = side ? c->link2 : c->link1, last = cav_last_dof(t->model, link), n = t->s->path.stride;
  double *row = t->s->entry, d[3];
  if (last < 0) return;
  int length = cav_derivative_path(t, last);
  sub3(d, c->pos, t->state->reference + 3 * link);
  const int impulses = out->normal_only ? 1 : c->dim;
  path_rows(t, c, derivative, side, impulses, (length + 3) / 4 * 4, d, row);
  add_path_rows(t, 1, length, row, out->dist_dq);
  add_path_rows(t, c->dim, length, row + OF_VELOCITY * n, out->velocity_dq);
  add_path_rows(t, c->dim, length, row + OF_NEXT * n, out->velocity_dv_next);
  add_path_rows(t, impulses, length, row + OF_IMPULSE * n, out->impulse_dq);
  add_path_rows(t, impulses, length, row + OF_IMPULSE_NOW * n, out->impulse_dv);
  add_path_rows(t, impulses, length, row + OF_IMPULSE_NEXT * n, out->impulse_dv_next);
  if (!out->pos_dq) return;
  place_rows(t, derivative, side, (length + 3) / 4 * 4, d, row);
  add_path_rows(t, 3, length, row, out->pos_dq);
}

// adds the derivatives of a contact to what out points at
static void add_contact(const cav_derivative_task *t, int contact, cav_contact_derivative *out) {
  const cav_contact *c = &t->state->contact[contact];
  if (t->s->contact[contact].idle) {
    cav_pair_manifolds manifolds;
    manifolds.pair = -1;
    cav_contact_differentiate(t->model, t->state, c, 1, &manifolds, &t->s->contact[contact]);
  }
  for (int side = 0; side < 2; side++) add_side(t, c, &t->s->contact[contact], side, out);
  if (cav_looks_ahead(&t->state->options)) cav_contact_next_derivatives(t, contact, out);
}

// whether the state holds what derivatives are made of
static int is_derived(const cav_state *state) { return cav_state_evaluated(state) && state->work->derived; }

cav_status cav_contact_derivatives(const cav_model *model, cav_state *state, int contact, cav_contact_derivative *out) {
  if (!is_derived(state) || contact < 0 || contact >= state->ncontact) return CAV_BAD_INPUT;
  const cav_contact *c = &state->contact[contact];
  size_t row = (size_t)model->nv * sizeof(double), rows = (size_t)c->dim * row;
  if (out->dist_dq) memset(out->dist_dq, 0, row);
  if (out->pos_dq) memset(out->pos_dq, 0, 3 * row);
  double *all[] = {out->velocity_dq, out->velocity_dv_next, out->impulse_dq, out->impulse_dv, out->impulse_dv_next};
  for (int k = 0; k < 5; k++) {
    if (all[k]) memset(all[k], 0, k < 2 || !out->normal_only ? rows : row);
  }
  cav_derivative_task t = {.model = model, .state = state, .s = state->work->derivatives, .nv = model->nv};
  add_contact(&t, contact, out);
  return CAV_OK;
}

cav_status cav_touch_derivatives(const cav_model *model, cav_state *state, const cav_sensor *sensor, double *d_dq,
                                 double *d_dv, double *d_dv_next) {
  if (sensor->type != CAV_SENSOR_TOUCH || sensor->cutoff > 0) return CAV_NOT_SUPPORTED;
  if (!is_derived(state)) return CAV_BAD_INPUT;
  double *all[] = {d_dq, d_dv, d_dv_next};
  const double inverse_h = 1 / state->options.timestep;
  cav_contact_derivative out = {.impulse_dq = d_dq, .impulse_dv = d_dv, .impulse_dv_next = d_dv_next, .normal_only = 1};
  cav_derivative_task t = {.model = model, .state = state, .s = state->work->derivatives, .nv = model->nv};
  for (int k = 0; k < 3; k++) {
    if (all[k]) memset(all[k], 0, (size_t)model->nv * sizeof(double));
  }
  for (int i = cav_touch_next(model, state, sensor, 0); i < state->ncontact;
       i = cav_touch_next(model, state, sensor, i + 1)) {
    add_contact(&t, i, &out);
  }
  for (int k = 0; k < 3; k++) {
    for (int j = 0; all[k] && j < model->nv; j++) all[k][j] *= inverse_h;
  }
  return CAV_OK;
}
