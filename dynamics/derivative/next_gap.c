/// Derivatives by what the normal rows of contacts see after the step (constraint/next_gap.c). The excess of a row
/// depends on q and v_next of the dofs between its two links alone, so each contact adds an outer product: its impulse's
/// generalised force by the rates of the excess.
#include "analytic.h"

// rates of the excess of a contact by a dof, side 1 if it moves the second link: by q and by v_next
static void excess_rates(const cav_derivative_task *t, int index, int dof, int side, double rate[2]) {
  const cav_contact *c = &t->state->contact[index];
  const cav_next_contact *next = &t->state->work->next->contact[index];
  const cav_contact_jacobian *derivative = &t->s->contact[index];
  const double *reference = t->state->reference + 3 * t->model->dof[dof].link;
  double h = t->state->options.timestep, sign = side ? 1 : -1, there[2], axis[6], drift[6];
  motion_at(axis, t->state->axis + 6 * dof, reference, c->pos);
  motion_at(drift, t->s->drift_next + 6 * dof, reference, c->pos);
  double here = dot6(derivative->velocity[side][0], axis) + sign * dot3(c->frame, drift + 3);
  double linear[2] = {dot6(derivative->dist[side], axis) + h * here, h * sign * dot3(c->frame, axis + 3)};
  cav_next_gap_rates(t->model, t->state, index, dof, there);
  for (int k = 0; k < 2; k++) rate[k] = (next->by_next * sign * there[k] + next->by_linear * linear[k]) / h;
}

static void add_contact(const cav_derivative_task *t, int index) {
  const cav_contact *c = &t->state->contact[index];
  const cav_contact_jacobian *derivative = &t->s->contact[index];
  double *push = t->s->across, *rate = push + t->nv;
  int *dof = t->s->dof, n = cav_contact_dofs(t->model, c, dof);
  for (int k = 0; k < n; k++) {
    int side = dof[k] >= 0;
    double axis[6];
    if (!side) dof[k] = ~dof[k];
    excess_rates(t, index, dof[k], side, rate + 2 * k);
    motion_at(axis, t->state->axis + 6 * dof[k], t->state->reference + 3 * t->model->dof[dof[k]].link, c->pos);
    push[k] = 0;
    for (int i = 0; i < c->dim; i++)
      push[k] += (side ? 1 : -1) * derivative->hessian[i][0] * dot3(c->frame + 3 * (i % 3), axis + (i < 3 ? 3 : 0));
  }
  for (int i = 0; i < n; i++) {
    for (int k = 0; k < n; k++) {
      int at = dof[i] * t->nv + dof[k];
      t->dq[at] += t->inverse_h * push[i] * rate[2 * k];
      t->dn[at] += t->inverse_h * push[i] * rate[2 * k + 1];
    }
  }
}

// whether a contact's row sees anything but J v_next
static int looks_on(const cav_state *state, int index) {
  const cav_next_contact *next = &state->work->next->contact[index];
  return next->by_next != 0 || next->by_linear != 0;
}

void cav_derivative_next_gaps(const cav_derivative_task *t) {
  for (int i = 0; i < t->state->ncontact; i++)
    if (!t->s->contact[i].idle && looks_on(t->state, i)) add_contact(t, i);
}

void cav_contact_next_gap(const cav_derivative_task *t, int index, cav_contact_derivative *out) {
  const cav_contact *c = &t->state->contact[index];
  if (!looks_on(t->state, index)) return;
  int *dof = t->s->dof, n = cav_contact_dofs(t->model, c, dof);
  for (int k = 0; k < n; k++) {
    int side = dof[k] >= 0, j = side ? dof[k] : ~dof[k];
    double rate[2];
    excess_rates(t, index, j, side, rate);
    for (int i = 0; i < c->dim; i++) {
      double by = t->s->contact[index].hessian[i][0];
      if (out->impulse_dq) out->impulse_dq[i * t->nv + j] -= by * rate[0];
      if (out->impulse_dv_next) out->impulse_dv_next[i * t->nv + j] -= by * rate[1];
    }
  }
}
