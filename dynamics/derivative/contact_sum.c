/// Contacts in the derivatives: their matrices at their links, carried to one point of the tree and summed over
/// subtrees; those between two moving links; derivatives of one contact by the dofs. Those of a contact by its
/// links' twists are contact.c's; the products of the sums with axes of dofs are smooth.c's.
#include "analytic.h"
#include "vectors.h"

// X with X b = b about the reference carried to a point d away: shifted = X' M X, M about the point
static void shift(double shifted[36], const double *M, const double d[3]) {
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
static void add_impulse(const cav_contact *c, double wrench[6]) {
  for (int i = 0; i < c->dim; i++) {
    double *part = i < 3 ? wrench + 3 : wrench;
    axpy3(part, part, c->impulse[i], c->frame + 3 * (i % 3));
  }
}

// matrices of one contact at one of its links: own wrench by own motion, less what is carried along with the link
static void contact_at_link(const cav_derivative_task *t, const cav_contact *c, const cav_contact_jacobian *derivative,
                            int side) {
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
  t->s->touched[link] = 1;
  double motion[36], velocity[36], keep = 1 - c->damping[0], *to = t->s->by_motion + CAV_TWIST_BLOCK * link;
  double *now = t->s->by_now + CAV_TWIST_BLOCK * link, *next = t->s->by_next + CAV_TWIST_BLOCK * link;
  shift(motion, own, d);
  shift(velocity, &derivative->by_velocity[0][0], d);
  for (int i = 0; i < 36; i++) to[i] += motion[i];
  for (int i = 0; i < 36; i++) now[i] += keep * velocity[i];
  for (int i = 0; i < 36; i++) next[i] += velocity[i];
}

// last dof that moves both of two links, -1 if there is none
static int common_dof(const cav_model *model, const int link[2]) {
  int a = last_dof(model, link[0]), b = last_dof(model, link[1]);
  while (a != b) {
    if (a > b)
      a = model->dof[a].parent;
    else
      b = model->dof[b].parent;
  }
  return a;
}

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
  memset(s->by_motion, 0, 3 * CAV_TWIST_BLOCK * n * sizeof *s->by_motion);
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
    s->touched[parent] = 1;
    for (int k = 0; k < CAV_TWIST_BLOCK; k++) {
      s->by_motion[CAV_TWIST_BLOCK * parent + k] += s->by_motion[CAV_TWIST_BLOCK * i + k];
      s->by_now[CAV_TWIST_BLOCK * parent + k] += s->by_now[CAV_TWIST_BLOCK * i + k];
      s->by_next[CAV_TWIST_BLOCK * parent + k] += s->by_next[CAV_TWIST_BLOCK * i + k];
    }
  }
}

// a dof's axis and the drifts of it about a contact
typedef struct column {
  double axis[6], now[6], next[6];
} column;

static void column_at(const cav_derivative_task *t, const cav_contact *c, int dof, column *out) {
  const double *reference = t->state->reference + 3 * t->model->dof[dof].link;
  motion_at(out->axis, t->state->axis + 6 * dof, reference, c->pos);
  motion_at(out->now, t->s->drift_now + 6 * dof, reference, c->pos);
  motion_at(out->next, t->s->drift_next + 6 * dof, reference, c->pos);
}

// axes about a contact of the dofs from one to another that is left out, towards the root; their number
static int axes_about(const cav_derivative_task *t, const cav_contact *c, int from, int to, double *S) {
  int n = 0;
  for (int k = from; k != to; k = t->model->dof[k].parent, n++) {
    motion_at(S + 6 * n, t->state->axis + 6 * k, t->state->reference + 3 * t->model->dof[k].link, c->pos);
  }
  return n;
}

/// A contact between two moving links: dofs that move the one, the other, and both, and their axes about it.
typedef struct between {
  int link[2], common;
  double *axes[2], *shared;
} between;

// one column: the wrenches on both links by one dof that moves the one of side
static void between_column(const cav_derivative_task *t, const cav_contact *c, const cav_contact_jacobian *derivative,
                           const between *b, const double whole[6], int side, int j) {
  const double *K = &derivative->by_velocity[0][0], keep = 1 - c->damping[0];
  const double sign = side ? 1 : -1, on = sign * t->inverse_h;
  int nv = t->nv;
  column col;
  double dq[6], now[6], next[6], drift[6], carried[6], own[6];
  column_at(t, c, j, &col);
  multiply6_transposed(dq, &derivative->wrench[side][0][0], col.axis);
  for (int i = 0; i < 6; i++) drift[i] = sign * (keep * col.now[i] - col.next[i]);
  multiply6(now, K, drift);
  accumulate6(dq, now);
  multiply6(next, K, col.axis);
  scale6(next, sign, next);
  const double *S = b->axes[!side];
  for (int k = last_dof(t->model, b->link[!side]); k != b->common; k = t->model->dof[k].parent, S += 6) {
    double push = dot6(S, next) * on;
    t->dq[k * nv + j] += on * dot6(S, dq);
    t->dv[k * nv + j] += keep * push;
    t->dn[k * nv + j] -= push;
  }
  if (b->common < 0) return;
  // rows of the same link: there smooth.c carries the wrench along with it; the dofs that move both links feel nothing
  cross3(carried, col.axis, whole);
  cross_add3(carried, col.axis + 3, whole + 3);
  cross3(carried + 3, col.axis, whole + 3);
  for (int i = 0; i < 6; i++) own[i] = dq[i] - carried[i];
  S = b->axes[side];
  for (int k = last_dof(t->model, b->link[side]); k != b->common; k = t->model->dof[k].parent, S += 6) {
    double push = dot6(S, next) * on;
    t->dq[k * nv + j] -= on * dot6(S, own);
    t->dv[k * nv + j] -= keep * push;
    t->dn[k * nv + j] += push;
  }
  S = b->shared;
  for (int k = b->common; k >= 0; k = t->model->dof[k].parent, S += 6) t->dq[k * nv + j] += on * dot6(S, carried);
}

// what a contact between two moving links gives: of two trees the wrench on the one by the motion of the other, of one
// tree all, by the dofs between the links only: the others move both, and nothing changes
static void contact_between(const cav_derivative_task *t, const cav_contact *c,
                            const cav_contact_jacobian *derivative) {
  between b = {.link = {c->link1, c->link2}};
  double whole[6] = {0};
  b.common = common_dof(t->model, b.link);
  b.axes[0] = t->s->across;
  b.axes[1] = b.axes[0] + 6 * axes_about(t, c, last_dof(t->model, c->link1), b.common, b.axes[0]);
  b.shared = b.axes[1] + 6 * axes_about(t, c, last_dof(t->model, c->link2), b.common, b.axes[1]);
  if (b.common >= 0) {
    axes_about(t, c, b.common, -1, b.shared);
    add_impulse(c, whole);
  }
  for (int side = 0; side < 2; side++) {
    for (int j = last_dof(t->model, b.link[side]); j != b.common; j = t->model->dof[j].parent)
      between_column(t, c, derivative, &b, whole, side, j);
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

// a point's velocity by four dofs of a path from the k-th on, and by their drifts, along the axes of a contact
#define AT(i) (*(const cav_four *)(path + (size_t)(i)*n + k))
#define ALONG(e, x) ((e)[0] * (x)[0] + (e)[1] * (x)[1] + (e)[2] * (x)[2])
static inline __attribute__((always_inline)) void motion_along(const cav_contact *c, const double *path, size_t n,
                                                               int k, const double d[3], double sign,
                                                               cav_four motion[6], cav_four *along) {
  for (int i = 0; i < 3; i++) motion[i] = AT(i);
  motion[3] = AT(3) + motion[1] * d[2] - motion[2] * d[1];
  motion[4] = AT(4) + motion[2] * d[0] - motion[0] * d[2];
  motion[5] = AT(5) + motion[0] * d[1] - motion[1] * d[0];
  for (int i = 0; i < c->dim; i++) {
    const double *e = c->frame + 3 * (i % 3);
    along[i] = sign * ALONG(e, motion + (i < 3 ? 3 : 0));
  }
}

// rows of a contact's derivatives in the dofs of the path
CAV_VECTOR_BODY void path_rows_body(const cav_derivative_task *t, const cav_contact *c,
                                    const cav_contact_jacobian *derivative, int side, int count, const double d[3],
                                    double *to) {
  const size_t n = (size_t)t->s->path.stride;
  const double *path = t->s->path.at, sign = side ? 1 : -1, keep = 1 - c->damping[0];
  for (int k = 0; k < count; k += 4, to += 4) {
    cav_four axis[6], drift[6], x[6], now[6], next[6];
    motion_along(c, path + CAV_OF_NOW * n, n, k, d, sign, drift, now);
    motion_along(c, path + CAV_OF_NEXT * n, n, k, d, sign, drift, next);
    motion_along(c, path + CAV_OF_AXIS * n, n, k, d, sign, axis, x);
    *(cav_four *)to = ALONG(derivative->dist[side], axis) + ALONG(derivative->dist[side] + 3, axis + 3);
    for (int i = 0; i < c->dim; i++) {
      const double *H = derivative->hessian[i], *v = derivative->velocity[side][i], *f = derivative->impulse[side][i];
      cav_four by_now = H[0] * now[0], by_next = H[0] * next[0], by_axis = H[0] * x[0];
      for (int j = 1; j < c->dim; j++) {
        by_now += H[j] * now[j];
        by_next += H[j] * next[j];
        by_axis += H[j] * x[j];
      }
      *(cav_four *)(to + (OF_VELOCITY + i) * n) = ALONG(v, axis) + ALONG(v + 3, axis + 3) + next[i];
      *(cav_four *)(to + (OF_NEXT + i) * n) = x[i];
      *(cav_four *)(to + (OF_IMPULSE + i) * n) = ALONG(f, axis) + ALONG(f + 3, axis + 3) + (keep * by_now - by_next);
      *(cav_four *)(to + (OF_IMPULSE_NOW + i) * n) = keep * by_axis;
      *(cav_four *)(to + (OF_IMPULSE_NEXT + i) * n) = -by_axis;
    }
  }
}
CAV_BY_VECTORS(path_rows,
               (const cav_derivative_task *t, const cav_contact *c, const cav_contact_jacobian *derivative, int side,
                int count, const double *d, double *to),
               (t, c, derivative, side, count, d, to))

// adds rows over the dofs of the path to those over all dofs
static void add_path_rows(const cav_derivative_task *t, int rows, int length, const double *from, double *to) {
  for (int i = 0; to && i < rows; i++, from += t->s->path.stride, to += t->nv) {
    for (int k = 0; k < length; k++) to[t->s->path.dof[k]] += from[k];
  }
}

// what the dofs that move one link of a contact do
static void add_side(const cav_derivative_task *t, const cav_contact *c, const cav_contact_jacobian *derivative,
                     int side, cav_contact_derivative *out) {
  int link = side ? c->link2 : c->link1, last = last_dof(t->model, link), n = t->s->path.stride;
  double *row = t->s->entry, d[3];
  if (last < 0) return;
  int length = cav_derivative_path(t, last);
  sub3(d, c->pos, t->state->reference + 3 * link);
  path_rows(t, c, derivative, side, (length + 3) / 4 * 4, d, row);
  add_path_rows(t, 1, length, row, out->dist_dq);
  add_path_rows(t, c->dim, length, row + OF_VELOCITY * n, out->velocity_dq);
  add_path_rows(t, c->dim, length, row + OF_NEXT * n, out->velocity_dv_next);
  add_path_rows(t, c->dim, length, row + OF_IMPULSE * n, out->impulse_dq);
  add_path_rows(t, c->dim, length, row + OF_IMPULSE_NOW * n, out->impulse_dv);
  add_path_rows(t, c->dim, length, row + OF_IMPULSE_NEXT * n, out->impulse_dv_next);
}

cav_status cav_contact_derivatives(const cav_model *model, cav_state *state, int contact, cav_contact_derivative *out) {
  cav_derivative_store *s = state->work->derivatives;
  if (!cav_state_evaluated(state) || !state->work->derived || contact < 0 || contact >= state->ncontact)
    return CAV_BAD_INPUT;
  const cav_contact *c = &state->contact[contact];
  if (s->contact[contact].idle) {
    cav_pair_manifolds manifolds;
    manifolds.pair = -1;
    cav_contact_differentiate(model, state, c, 1, &manifolds, &s->contact[contact]);
  }
  size_t row = (size_t)model->nv * sizeof(double), rows = (size_t)c->dim * row;
  if (out->dist_dq) memset(out->dist_dq, 0, row);
  double *all[] = {out->velocity_dq, out->velocity_dv_next, out->impulse_dq, out->impulse_dv, out->impulse_dv_next};
  for (int k = 0; k < 5; k++) {
    if (all[k]) memset(all[k], 0, rows);
  }
  cav_derivative_task t = {.model = model, .state = state, .s = s, .nv = model->nv};
  for (int side = 0; side < 2; side++) add_side(&t, c, &s->contact[contact], side, out);
  if (state->options.next_gap == CAV_NEXT_GAP_EXACT) cav_contact_next_gap(&t, contact, out);
  return CAV_OK;
}
