/// Constraint Jacobian of a state, block by block. Private to dynamics/.
#ifndef CAVORT_JACOBIAN_H
#define CAVORT_JACOBIAN_H

#include "constraint.h"

/// The rows of one constraint object, or in a step of an implicit spring, and what their Jacobian is made of: only dofs
/// that move the object are listed.
typedef struct cav_block {
  int contact;  ///< index into state->contact, or -1
  int row;      ///< index into state->row, or -1
  int equality; ///< index into state->equality constraint, or -1
  int spring;   ///< where all three are -1: the tendon
  int dim;      ///< number of rows
  int first;    ///< first of them among all rows
  int ndof;
  const int *dof;  ///< [ndof] indices into v
  const double *J; ///< [dim*ndof] row-major
} cav_block;

/// Jacobian rows of all contacts, rows and equality constraints of the state, each with the dofs that move it.
/// jacobian.c. block [n], n = ncontact+nrow+nequality, dof [n*nv], J [rows*nv]. Returns the number of rows.
int cav_jacobian(const cav_model *model, const cav_state *state, cav_block *block, int *dof, double *J);

/// Dofs of a contact, dof [nv], from the leaves to where the branches of its two links meet: those of link2 by index,
/// those of link1 by its complement. Their number. jacobian.c.
int cav_contact_dofs(const cav_model *model, const cav_contact *contact, int *dof);

/// Number of constraint rows of the state; those of equality constraints alone. jacobian.c.
int cav_jacobian_rows(const cav_state *state);
int cav_equality_row_count(const cav_state *state);

/// Row i of a block as a dense vector r [nv]. jacobian.c.
void cav_block_spread(const cav_block *block, int i, int nv, double *r);

#endif
