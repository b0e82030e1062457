/// What an evaluation of the inverse leaves in a state, put by so that a state of the same model can have it back in the
/// place of another evaluation at the same point. Private to dynamics/ and optim/.
#ifndef CAVORT_EVALUATION_H
#define CAVORT_EVALUATION_H

#include "cavort/dynamics.h"

typedef struct cav_evaluation cav_evaluation;
struct cav_hint;

/// Moves what the state's last evaluation, cav_inverse at (q, v, v_next) [nq, nv, nv], has left there to *evaluation,
/// made where that is NULL; the state holds none then. Nothing is kept, and the state stays as it is, under options
/// whose rows are coupled, or if memory runs out.
void cav_evaluation_keep(cav_evaluation **evaluation, cav_state *state, const double *q, const double *v,
                         const double *v_next);

/// Moves it back into a state, if it is of the point (q, v, v_next) and the state's options: then the state is as after
/// cav_inverse there, bit for bit, and this returns 1. NULL: 0.
int cav_evaluation_take(cav_evaluation *evaluation, cav_state *state, const double *q, const double *v,
                        const double *v_next);

/// Exchanges where the state's searches for contacts of meshes ended, of the last posture that it was at, for what is kept in
/// *hints, made where that is NULL: one that goes through many postures, again and again, finds each contact near to where it was
/// there. No result depends on it, to the bit; of a model without meshes, or if memory runs out, nothing changes. What is
/// kept is the caller's to free.
void cav_evaluation_swap_hints(cav_state *state, struct cav_hint **hints);

/// NULL is fine.
void cav_evaluation_free(cav_evaluation *evaluation);

#endif
