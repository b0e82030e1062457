/// Derivatives by what the rows of contacts see after the step (constraint/next_knot.c). The excess of a row depends on q
/// and v_next of the dofs between its two links alone, so each contact adds an outer product a row: its impulse's
/// generalised force by the rates of the excess.
#include "analytic.h"

// whether a row sees anything but J v_next
static int looks_on(const cav_state *state, const cav_contact *c, int row) {
  const cav_next_contact *next = cav_contact_next(state, c);
  return cav_row_looks_ahead(&state->options, c, row) && (row > 0 || next->by_next != 0 || next->by_linear != 0);
}

// rates of the excesses of a contact's first rows by a dof, side 1 if it moves the second link: by q and by v_next
static void excess_rates(const cav_derivative_task *t, int index, int dof, int side, double rate[3][2]) {
  const cav_contact *c = &t->state->contact[index];
  const cav_next_contact *next = &t->state->work->next->contact[index];
  const cav_contact_jacobian *derivative = &t->s->contact[index];
  const double *reference = t->state->reference + 3 * t->model->dof[dof].link;
  double h = t->state->options.timestep, sign = side ? 1 : -1, there[3][2], axis[6], drift[6];
  motion_at(axis, t->state->axis + 6 * dof, reference, c->pos);
  motion_at(drift, t->s->drift_next + 6 * dof, reference, c->pos);
  cav_next_contact_rates(t->model, t->state, index, dof, there);
  for (int i = 0; i < 3; i++) {
    if (!looks_on(t->state, c, i)) continue;
    const double *e = c->frame + 3 * i;
    double linear[2] = {dot6(derivative->velocity[side][i], axis) + sign * dot3(e, drift + 3),
                        sign * dot3(e, axis + 3)};
    if (i == 0) {
      double gap[2] = {dot6(derivative->dist[side], axis) + h * linear[0], h * linear[1]};
      for (int k = 0; k < 2; k++) rate[i][k] = (next->by_next * sign * there[i][k] + next->by_linear * gap[k]) / h;
    } else {
      double seen[2] = {dot6(derivative->way[side][i - 1], axis) + sign * there[i][0], sign * there[i][1]};
      for (int k = 0; k < 2; k++) rate[i][k] = seen[k] / h - linear[k];
    }
  }
}

static void add_contact(const cav_derivative_task *t, int index) {
  const cav_contact *c = &t->state->contact[index];
  const cav_contact_jacobian *derivative = &t->s->contact[index];
  double *push = t->s->across, *rate = push + 3 * t->nv;
  int *dof = t->s->dof, n = cav_contact_dofs(t->model, c, dof);
  for (int k = 0; k < n; k++) {
    int side = dof[k] >= 0;
    double axis[6], by[3][2];
    if (!side) dof[k] = ~dof[k];
    excess_rates(t, index, dof[k], side, by);
    motion_at(axis, t->state->axis + 6 * dof[k], t->state->reference + 3 * t->model->dof[dof[k]].link, c->pos);
    for (int j = 0; j < 3; j++) {
      if (!looks_on(t->state, c, j)) continue;
      double sum = 0;
      for (int i = 0; i < c->dim; i++)
        sum += (side ? 1 : -1) * derivative->hessian[i][j] * dot3(c->frame + 3 * (i % 3), axis + (i < 3 ? 3 : 0));
      push[j * t->nv + k] = sum;
      for (int l = 0; l < 2; l++) rate[(2 * j + l) * t->nv + k] = by[j][l];
    }
  }
  for (int j = 0; j < 3; j++) {
    if (!looks_on(t->state, c, j)) continue;
    const double *force = push + j * t->nv, *by_q = rate + 2 * j * t->nv, *by_next = by_q + t->nv;
    for (int i = 0; i < n; i++) {
      for (int k = 0; k < n; k++) {
        int at = dof[i] * t->nv + dof[k];
        t->dq[at] += t->inverse_h * force[i] * by_q[k];
        t->dn[at] += t->inverse_h * force[i] * by_next[k];
      }
    }
  }
}

void cav_derivative_next_contacts(const cav_derivative_task *t) {
  for (int i = 0; i < t->state->ncontact; i++)
    if (!t->s->contact[i].idle) add_contact(t, i);
}

// adds the rates of a row's excess by a dof to the derivatives of one contact
static void add_rates(const cav_derivative_task *t, int index, int row, int dof, const double rate[2],
                      cav_contact_derivative *out) {
  const cav_contact *c = &t->state->contact[index];
  for (int i = 0; i < (out->normal_only ? 1 : c->dim); i++) {
    double by = t->s->contact[index].hessian[i][row];
    if (out->impulse_dq) out->impulse_dq[i * t->nv + dof] -= by * rate[0];
    if (out->impulse_dv_next) out->impulse_dv_next[i * t->nv + dof] -= by * rate[1];
  }
  // the velocity of the normal row stays J v_next
  if (row > 0 && out->velocity_dq) out->velocity_dq[row * t->nv + dof] += rate[0];
  if (row > 0 && out->velocity_dv_next) out->velocity_dv_next[row * t->nv + dof] += rate[1];
}

void cav_contact_next_derivatives(const cav_derivative_task *t, int index, cav_contact_derivative *out) {
  const cav_contact *c = &t->state->contact[index];
  int *dof = t->s->dof, n = cav_contact_dofs(t->model, c, dof);
  for (int k = 0; k < n; k++) {
    int side = dof[k] >= 0, j = side ? dof[k] : ~dof[k];
    double rate[3][2];
    excess_rates(t, index, j, side, rate);
    for (int l = 0; l < 3; l++)
      if (looks_on(t->state, c, l)) add_rates(t, index, l, j, rate[l], out);
  }
  // dofs that move both links turn what slides with the normal, but not always the axes about it
  if (!looks_on(t->state, c, 1) || c->link1 == 0 || c->link2 == 0) return;
  for (int j = common_dof(t->model, (int[]){c->link1, c->link2}); j >= 0; j = t->model->dof[j].parent) {
    double rate[2][3][2];
    for (int side = 0; side < 2; side++) excess_rates(t, index, j, side, rate[side]);
    for (int l = 1; l < 3; l++) add_rates(t, index, l, j, (double[]){rate[0][l][0] + rate[1][l][0], 0}, out);
  }
}
