/// Quantities of one's own at an evaluated state. Private to optim/.
#ifndef CAVORT_USER_H
#define CAVORT_USER_H

#include "cavort/problem.h"

/// What a quantity's function did not give.
typedef struct cav_user_refusal {
  int refused;   ///< 0: nothing is wrong
  int code;      ///< that it returned; 0: what it wrote is not finite
  int component; ///< the value
  int jacobian;  ///< 1: the derivatives, 0: the values
} cav_user_refusal;

/// Memory for derivatives, grown as needed; freed by free(x).
typedef struct cav_user_room {
  double *x;
  size_t n;
} cav_user_room;

/// Values [dim] at the state's last cav_inverse; refusal is noted unless there is one.
void cav_user_read(const cav_user_quantity *user, cav_state *state, double time, double *value,
                   cav_user_refusal *refusal);

/// Derivatives by q, v and v_next, each [dim*nv], into the room. du: those of u [nv*nv], after cav_derivatives.
/// CAV_NOT_SUPPORTED: there are none, differences have to do; CAV_NO_MEMORY.
cav_status cav_user_differentiate(const cav_user_quantity *user, cav_state *state, double time,
                                  const double *const du[3], cav_user_room *room, double *out[3],
                                  cav_user_refusal *refusal);

/// CAV_OK, CAV_NOT_FINITE, or where a function refused CAV_INTERRUPTED: what passes every trial.
cav_status cav_user_refused(const cav_user_refusal *refusal);

/// The refusal in words: CAV_BAD_INPUT or CAV_NOT_FINITE; knot -1: not of one.
void cav_user_tell(const cav_term *term, const cav_user_refusal *refusal, int knot, double time, cav_error *error);

/// CAV_BAD_INPUT with the reason unless the term's quantity can be evaluated. Terms of the list pass. terms.c.
cav_status cav_user_term_check(const cav_term *term, cav_error *error);

#endif
