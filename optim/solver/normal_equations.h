/// Normal equations of a transcription: assemble, factorise, solve. Private to optim/.
#ifndef CAVORT_NORMAL_EQUATIONS_H
#define CAVORT_NORMAL_EQUATIONS_H

#include "band.h"
#include "transcription.h"

/// Normal equations and their factor. Solvers read size, gradient and diagonal; the rest is normal_equations.c's.
typedef struct cav_normal {
  int size; ///< unknowns
  int blocks, n;
  int cyclic, free_step;
  int core, border; ///< unknowns in the band, and after it
  int band;         ///< entries kept of a column: itself and three blocks below, of which the last is never reached
  double *H;        ///< [core*band] lower triangle by columns: H[j*band + i - j] is H(i, j)
  double *B;        ///< [core*border] by columns of the core: B[i*core + j] is H(core + i, j)
  double *C;        ///< [border*border] lower triangle by columns
  double *gradient, *diagonal; ///< [size]

  // trees that nothing joined at the last gathering are factored apart
  int ntree, *tree; ///< [ntree+1] their first dofs
  int *owner;       ///< [n] group of each dof
  int ngroup;
  int *first, *dof;   ///< [ngroup+1] of each group's in the dofs [n], ascending
  int *unknown;       ///< [size] of each group's in turn, by blocks
  cav_band *group;    ///< [ngroup] factors
  double *factor, *x; ///< room of all factors; [size] right-hand side of one group
  double *arrow; ///< [2*size] row of a free step beside several groups, and their inverse times it with its pivot last
  double *room;  ///< [5*size] of a method's iteration
  int filled;    ///< columns of the only group's band that are in its factor's place
} cav_normal;

/// Of the unknowns of a transcription; NULL if memory runs out.
cav_normal *cav_normal_new(const cav_transcription *transcription);
void cav_normal_free(cav_normal *normal);

/// Sums the knots' Hessians and gradients. gradient and diagonal stay readable until the next call, [unknowns].
void cav_normal_gather(cav_normal *normal, const cav_transcription *transcription);

/// The knots linearised at a trajectory, gathered, and factored with a shift; knot by knot where there is one tree and no
/// cycle, while other threads linearise later ones, with the bits of one after the other. *factored: as cav_normal_factor.
cav_status cav_normal_linearise(cav_normal *normal, cav_transcription *transcription, cav_trajectory *trajectory,
                                double shift, cav_status *factored);
const double *cav_normal_gradient(const cav_normal *normal);
const double *cav_normal_diagonal(const cav_normal *normal);

/// Groups of trees at the last gathering, and the largest number of dofs in one.
int cav_normal_groups(const cav_normal *normal, int *most);

/// The same in parts, the gradient left out: nothing; plus a knot's Hessian [3nv*3nv] (lower triangle), with what the
/// step's logarithm meets where that is free; plus a diagonal [unknowns], which has to come last.
void cav_normal_clear(cav_normal *normal);
void cav_normal_add_block(cav_normal *normal, const cav_transcription *transcription, int t, const double *hessian,
                          const double *step_row, double step_square);
void cav_normal_add_diagonal(cav_normal *normal, const double *diagonal);

/// What has been gathered, kept [cav_normal_room] and taken back, without the diagonal.
size_t cav_normal_room(const cav_normal *normal);
void cav_normal_save(const cav_normal *normal, double *to);
void cav_normal_load(cav_normal *normal, const double *from);

/// Lower triangle of a knot's part [3nv*3nv] by columns, 3nv - 1 apart, to add to in place; NULL where it does not lie in
/// one piece.
double *cav_normal_place(const cav_normal *normal, const cav_transcription *transcription, int t);

/// Factors H + shift diag(H); CAV_NOT_CONVERGED if that is not positive definite.
cav_status cav_normal_factor(cav_normal *normal, double shift);

/// Whether all unknowns are one band, whatever is gathered; or were at the last gathering. So the next can be factored as it
/// is gathered.
int cav_normal_is_band(const cav_normal *normal);
int cav_normal_was_band(const cav_normal *normal);

/// What is factored in one pass over the knots, while its columns are at hand: what was kept, what add gives at each knot (in
/// its place, or as a block), a diagonal. And the product of what was kept with x. [unknowns]
typedef struct cav_normal_sum {
  const double *kept, *diagonal, *x;
  double *product;
  void (*find)(void *context, int t,
               int member);          ///< before add, of many knots at once, by a member of the transcription's team
  void (*add)(void *context, int t); ///< one after the other
  void *context;
} cav_normal_sum;

/// Factors a sum where cav_normal_was_band, with the bits that its parts give one after the other; H stays as it was. While knots
/// are added and factored in their order other threads find what later ones add. Results of cav_normal_factor; product is whole
/// where that is CAV_OK.
cav_status cav_normal_factor_sum(cav_normal *normal, const cav_transcription *transcription, const cav_normal_sum *sum,
                                 double shift);

/// Holds the last unknown where it is: its gradient and row become those of one that has no say.
void cav_normal_hold(cav_normal *normal);

/// x := (H + shift)^-1 b with the last factor; product := H x. [unknowns]
void cav_normal_solve(const cav_normal *normal, const double *b, double *x);
void cav_normal_multiply(const cav_normal *normal, const double *x, double *product);

/// product := H x of what was kept. [unknowns]
void cav_normal_multiply_kept(const cav_normal *normal, const double *kept, const double *x, double *product);

/// Entries of the lower triangle in a fixed order: rows, columns and values where asked for; returns their number.
int cav_normal_entries(const cav_normal *normal, int *row, int *column, double *value);

/// value := factor * value + the diagonal matrix of (absolute + share * diag(H)), in the order of cav_normal_entries.
void cav_normal_shift_entries(const cav_normal *normal, double factor, double absolute, double fraction, double *value);

#endif
