/// Contacts in the derivatives: their matrices at their links, carried to one point of the tree and summed over
/// subtrees; those between two moving links; derivatives of one contact by the dofs. Those of a contact by its
/// links' twists are contact.c's; the products of the sums with axes of dofs are smooth.c's.
#include "analytic.h"

// X with X b = b about the reference carried to a point d away: adds scale X' M X, M about the point
static void shift_add(double *sum, const double *M, const double d[3], double scale) {
  double right[6][6], skew[3][3] = {{0, d[2], -d[1]}, {-d[2], 0, d[0]}, {d[1], -d[0], 0}};
  // linear at the point = linear + angular x d
  for (int r = 0; r < 6; r++) {
    for (int c = 0; c < 6; c++) {
      right[r][c] = M[6 * r + c];
      for (int k = 0; c < 3 && k < 3; k++) right[r][c] += M[6 * r + 3 + k] * skew[k][c];
    }
  }
  for (int c = 0; c < 6; c++) {
    for (int r = 0; r < 6; r++) {
      double x = right[r][c];
      for (int k = 0; r < 3 && k < 3; k++) x += right[3 + k][c] * skew[k][r];
      sum[6 * r + c] += scale * x;
    }
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
  shift_add(t->s->by_motion + CAV_TWIST_BLOCK * link, own, d, 1);
  shift_add(t->s->by_now + CAV_TWIST_BLOCK * link, &derivative->by_velocity[0][0], d, 1 - c->damping[0]);
  shift_add(t->s->by_next + CAV_TWIST_BLOCK * link, &derivative->by_velocity[0][0], d, 1);
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

static double dot_n(const double *a, const double *b, int n) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

// rows of a contact's derivatives in one dof
static void contact_column(const cav_derivative_task *t, const cav_contact *c, const cav_contact_jacobian *derivative,
                           int side, int j, cav_contact_derivative *out) {
  int nv = t->nv;
  double sign = side ? 1 : -1, keep = 1 - c->damping[0], x[6], now[6], next[6];
  column col;
  column_at(t, c, j, &col);
  for (int i = 0; i < c->dim; i++) {
    const double *e = c->frame + 3 * (i % 3);
    int at = i < 3 ? 3 : 0;
    x[i] = sign * dot3(e, col.axis + at);
    now[i] = sign * dot3(e, col.now + at);
    next[i] = sign * dot3(e, col.next + at);
  }
  if (out->dist_dq) out->dist_dq[j] += dot6(derivative->dist[side], col.axis);
  for (int i = 0; i < c->dim; i++) {
    int at = i * nv + j;
    const double *H = derivative->hessian[i];
    double by_drift = keep * dot_n(H, now, c->dim) - dot_n(H, next, c->dim), by_axis = dot_n(H, x, c->dim);
    if (out->velocity_dq) out->velocity_dq[at] += dot6(derivative->velocity[side][i], col.axis) + next[i];
    if (out->velocity_dv_next) out->velocity_dv_next[at] += x[i];
    if (out->impulse_dq) out->impulse_dq[at] += dot6(derivative->impulse[side][i], col.axis) + by_drift;
    if (out->impulse_dv) out->impulse_dv[at] += keep * by_axis;
    if (out->impulse_dv_next) out->impulse_dv_next[at] -= by_axis;
  }
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
  for (int side = 0; side < 2; side++) {
    for (int j = last_dof(model, side ? c->link2 : c->link1); j >= 0; j = model->dof[j].parent) {
      contact_column(&t, c, &s->contact[contact], side, j, out);
    }
  }
  if (state->options.next_gap == CAV_NEXT_GAP_EXACT) cav_contact_next_gap(&t, contact, out);
  return CAV_OK;
}
