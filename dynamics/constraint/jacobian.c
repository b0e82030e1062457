/// Constraint Jacobian of the contacts, scalar rows and equality constraints of a state, needed by the forward step
/// and where A is. Each block keeps the dofs that move it: for a contact those between its two links and their nearest
/// common ancestor, beyond which the motion of both is the same; for an equality constraint all that move either link,
/// as its two points are apart by the error. Reads poses and subspaces of the last cav_position; computes no velocity.
#include <assert.h>

#include "jacobian.h"
#include "math3.h"

// column of one dof in the rows of a contact: velocity of geom2 relative to geom1 along the axes of the frame
static void contact_column(const cav_model *model, const cav_state *state, const cav_contact *contact, int dof,
                           double sign, int stride, double *J) {
  const double *axis = state->axis + 6 * dof, *reference = state->reference + 3 * model->dof[dof].link;
  double linear[3];
  velocity_at(linear, axis, reference, contact->pos);
  for (int i = 0; i < contact->dim; i++)
    J[i * stride] = sign * (i < 3 ? dot3(contact->frame + 3 * i, linear) : dot3(contact->frame + 3 * (i - 3), axis));
}

int cav_contact_dofs(const cav_model *model, const cav_contact *contact, int *dof) {
  int i = cav_last_dof(model, contact->link1), j = cav_last_dof(model, contact->link2), n = 0;
  while (i != j) {
    // the higher index cannot be an ancestor of the other; the complement marks dofs of link1
    const int first = i > j;
    dof[n++] = first ? ~i : j;
    if (first)
      i = model->dof[i].parent;
    else
      j = model->dof[j].parent;
  }
  return n;
}

static int contact_block(const cav_model *model, const cav_state *state, int index, int *dof, double *J) {
  const cav_contact *contact = &state->contact[index];
  const int n = cav_contact_dofs(model, contact, dof);
  for (int k = 0; k < n; k++) {
    const double sign = dof[k] < 0 ? -1.0 : 1.0;
    if (dof[k] < 0) dof[k] = ~dof[k];
    contact_column(model, state, contact, dof[k], sign, n, J + k);
  }
  return n;
}

// column of one dof in the rows of an equality constraint between links; on says which of the two it moves
static void equality_column(const cav_model *model, const cav_state *state, const cav_equality_rows *eq, int dof,
                            const int on[2], int stride, double *J) {
  const double *axis = state->axis + 6 * dof, *reference = state->reference + 3 * model->dof[dof].link;
  double linear[3] = {0, 0, 0}, angular[3] = {0, 0, 0};
  for (int k = 0; k < 2; k++) {
    if (!on[k]) continue;
    double at[3];
    velocity_at(at, axis, reference, eq->point[k]);
    axpy3(linear, linear, k ? -1 : 1, at);
    axpy3(angular, angular, k ? -1 : 1, axis);
  }
  if (eq->dim == 1) J[0] = dot3(eq->normal, linear);
  for (int i = 0; i < eq->dim && eq->dim > 1; i++)
    J[i * stride] = i < 3 ? linear[i] : dot3(eq->rotation + 3 * (i - 3), angular);
}

static int equality_links(const cav_model *model, const cav_state *state, const cav_equality_rows *eq, int *dof,
                          double *J) {
  const cav_equality *e = &model->equality[eq->equality];
  int first = cav_last_dof(model, e->link[0]), second = cav_last_dof(model, e->link[1]), n = 0;
  for (int i = first, j = second; i >= 0 || j >= 0; n++) {
    dof[n] = i > j ? i : j;
    if (i == dof[n]) i = model->dof[i].parent;
    if (j == dof[n]) j = model->dof[j].parent;
  }
  for (int k = 0, i = first, j = second; k < n; k++) {
    const int on[2] = {i == dof[k], j == dof[k]};
    equality_column(model, state, eq, dof[k], on, n, J + k);
    if (on[0]) i = model->dof[i].parent;
    if (on[1]) j = model->dof[j].parent;
  }
  return n;
}

// adds scale times the gradient of a tendon's length to a row whose first n dofs are known; returns their number
static int tendon_gradient(const cav_model *model, const cav_state *state, int tendon, double scale, int n, int *dof,
                           double *J) {
  const cav_tendon *t = &model->tendon[tendon];
  const int known = n;
  for (int e = t->dof; e < t->dof + t->ndof; e++) {
    int k = 0;
    while (k < known && dof[k] != model->tendon_dof[e]) k++;
    if (k == known) J[k = n++] = 0.0;
    dof[k] = model->tendon_dof[e];
    J[k] += scale * state->tendon_arm[e];
  }
  return n;
}

static int equality_block(const cav_model *model, const cav_state *state, const cav_equality_rows *eq, int *dof,
                          double *J) {
  const cav_equality *e = &model->equality[eq->equality];
  int n = 0;
  switch (e->type) {
    case CAV_EQUALITY_JOINT:
      for (; n < 2 && e->object[n] >= 0; n++) {
        dof[n] = model->joint[e->object[n]].dof;
        J[n] = n ? -eq->derivative : 1;
      }
      return n;
    case CAV_EQUALITY_TENDON:
      for (int side = 0; side < 2 && e->object[side] >= 0; side++)
        n = tendon_gradient(model, state, e->object[side], side ? -eq->derivative : 1, n, dof, J);
      return n;
    default:
      return equality_links(model, state, eq, dof, J);
  }
}

// dofs and row of a limit or a friction loss
static int scalar_block(const cav_model *model, const cav_state *state, const cav_row *row, int *dof, double *J) {
  int n = 0;
  switch (row->type) {
    case CAV_ROW_LIMIT_JOINT: {
      const cav_joint *joint = &model->joint[row->object];
      const int size = joint->type == CAV_JOINT_BALL ? 3 : 1;
      for (; n < size; n++) {
        dof[n] = joint->dof + n;
        J[n] = row->axis[n];
      }
      break;
    }
    case CAV_ROW_FRICTION_DOF:
      dof[n] = row->object;
      J[n++] = 1.0;
      break;
    case CAV_ROW_LIMIT_TENDON:
    case CAV_ROW_FRICTION_TENDON:
      n = tendon_gradient(model, state, row->object, row->type == CAV_ROW_LIMIT_TENDON ? row->axis[0] : 1.0, n, dof, J);
      break;
  }
  return n;
}

void cav_block_spread(const cav_block *block, int i, int nv, double *r) {
  for (int k = 0; k < nv; k++) r[k] = 0.0;
  for (int k = 0; k < block->ndof; k++) r[block->dof[k]] = block->J[i * block->ndof + k];
}

int cav_equality_row_count(const cav_state *state) {
  int rows = 0;
  for (int i = 0; i < state->nequality; i++) rows += state->equality[i].dim;
  return rows;
}

int cav_jacobian_rows(const cav_state *state) {
  int rows = state->nrow + cav_equality_row_count(state);
  for (int i = 0; i < state->ncontact; i++) rows += state->contact[i].dim;
  return rows;
}

int cav_jacobian(const cav_model *model, const cav_state *state, cav_block *block, int *dof, double *J) {
  const int rows_from = state->ncontact, equalities_from = rows_from + state->nrow;
  int first = 0;
  for (int i = 0; i < equalities_from + state->nequality; i++) {
    int dim = 1, n = 0;
    cav_block found = {.contact = -1, .row = -1, .equality = -1, .first = first, .dof = dof, .J = J};
    if (i < rows_from) {
      found.contact = i;
      dim = state->contact[i].dim;
      n = contact_block(model, state, i, dof, J);
    } else if (i < equalities_from) {
      found.row = i - rows_from;
      n = scalar_block(model, state, &state->row[found.row], dof, J);
    } else {
      found.equality = i - equalities_from;
      dim = state->equality[found.equality].dim;
      n = equality_block(model, state, &state->equality[found.equality], dof, J);
    }
    assert(n <= model->nv && dim >= 1 && dim <= CAV_IMPULSE_DIM);
    found.dim = dim;
    found.ndof = n;
    block[i] = found;
    first += dim;
    dof += n;
    J += dim * n;
  }
  return first;
}
