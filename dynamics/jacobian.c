/// Constraint Jacobian of the contacts and scalar rows of a state, needed by the forward step only. Each block keeps
/// the dofs that move it: for a contact those between its two links and their nearest common ancestor, beyond which the
/// motion of both is the same. Reads poses and subspaces of the last cav_position; computes no velocity.
#include "impulse.h"
#include "math3.h"

// last dof that moves a link, -1 for the world
static int last_dof(const cav_model *model, int link) {
  while (link > 0 && model->link[link].ndof == 0) link = model->link[link].parent;
  return link > 0 ? model->link[link].dof + model->link[link].ndof - 1 : -1;
}

// column of one dof in the rows of a contact: velocity of geom2 relative to geom1 along the axes of the frame
static void contact_column(const cav_model *model, const cav_state *state, const cav_contact *contact, int dof,
                           double sign, int stride, double *J) {
  const double *axis = state->axis + 6 * dof, *reference = state->reference + 3 * model->dof[dof].link;
  double linear[3];
  velocity_at(linear, axis, reference, contact->pos);
  for (int i = 0; i < contact->dim; i++)
    J[i * stride] = sign * (i < 3 ? dot3(contact->frame + 3 * i, linear) : dot3(contact->frame + 3 * (i - 3), axis));
}

// dofs of a contact, from the leaves to where the two branches meet; returns their number
static int contact_dofs(const cav_model *model, const cav_contact *contact, int *dof) {
  int i = last_dof(model, contact->link1), j = last_dof(model, contact->link2), n = 0;
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
  const int n = contact_dofs(model, contact, dof);
  for (int k = 0; k < n; k++) {
    const double sign = dof[k] < 0 ? -1.0 : 1.0;
    if (dof[k] < 0) dof[k] = ~dof[k];
    contact_column(model, state, contact, dof[k], sign, n, J + k);
  }
  return n;
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
    case CAV_ROW_FRICTION_TENDON: {
      const cav_tendon *tendon = &model->tendon[row->object];
      const double sign = row->type == CAV_ROW_LIMIT_TENDON ? row->axis[0] : 1.0;
      for (; n < tendon->ndof; n++) {
        dof[n] = model->tendon_dof[tendon->dof + n];
        J[n] = sign * state->tendon_arm[tendon->dof + n];
      }
      break;
    }
  }
  return n;
}

int cav_jacobian_rows(const cav_state *state) {
  int rows = state->nrow;
  for (int i = 0; i < state->ncontact; i++) rows += state->contact[i].dim;
  return rows;
}

int cav_jacobian(const cav_model *model, const cav_state *state, cav_block *block, int *dof, double *J) {
  int first = 0;
  for (int i = 0; i < state->ncontact + state->nrow; i++) {
    const int contact = i < state->ncontact, dim = contact ? state->contact[i].dim : 1;
    const int n = contact ? contact_block(model, state, i, dof, J)
                          : scalar_block(model, state, &state->row[i - state->ncontact], dof, J);
    block[i] = (cav_block){contact ? i : -1, contact ? -1 : i - state->ncontact, dim, first, n, dof, J};
    first += dim;
    dof += n;
    J += dim * n;
  }
  return first;
}
