/// Symmetric matrices stored by rows, each from its first entry that is not zero to the diagonal, and their Cholesky
/// factors, which fill no more than that. Private to optim/verify.
#ifndef CAVORT_ENVELOPE_H
#define CAVORT_ENVELOPE_H

typedef struct cav_envelope cav_envelope;

/// n rows, row i from column first[i] <= i on; zero. NULL if memory runs out.
cav_envelope *cav_envelope_new(int n, const int *first);
void cav_envelope_free(cav_envelope *envelope);

/// Adds x to entry (i, j) and its mirror image, which must be stored.
void cav_envelope_add(cav_envelope *envelope, int i, int j, double x);
/// Adds factor times another of the same rows.
void cav_envelope_combine(cav_envelope *envelope, double factor, const cav_envelope *other);
double cav_envelope_diagonal(const cav_envelope *envelope, int i);

/// Factors the matrix plus a diagonal [n]; 0 if that is not positive definite.
int cav_envelope_factor(cav_envelope *envelope, const double *diagonal);

/// Solves with the factor, in place.
void cav_envelope_solve(const cav_envelope *envelope, double *x);

#endif
