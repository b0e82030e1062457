/// What is read off the dynamics at one knot, with derivatives: u, CAV_CONTACT_READINGS numbers a contact, sensors
/// and quantities of one's own, in the order of the terms.
/// Private to optim/.
#ifndef CAVORT_READINGS_H
#define CAVORT_READINGS_H

#include "transcription.h"

/// Rows of nv that the derivatives of one contact or sensor take at most.
enum { CAV_DERIVATIVE_ROWS = 34 };

/// What one thread works with.
typedef struct cav_scratch {
  cav_state *state;
  int room; ///< readings
  double *value, *dq, *dv, *dn;
  int *key; ///< [2*contacts] pair and feature of the contacts with rows
  int key_room;
  unsigned char *used;  ///< [contacts] by bits, readings that a row is of
  double *dense, *rest; ///< [dense_room*3nv], [dense_room] rows over all columns, likewise
  int dense_room;
  double *force_weight, *force_derivative; ///< [nv] of rows along single dofs
  double *row, *reading;                   ///< [3nv]
  double *hessian;                         ///< [3nv*3nv] of a knot, where it is not to keep it
  int *column;                             ///< [nv]
  double *tangent;                         ///< [nv]
  double *posture;                         ///< [nq]
  double *force_step;                      ///< [nv] what the step does to rows along single dofs
  double *rate;                            ///< [2nv]
  double *trace[2]; ///< [trace_room] residuals of all rows of a knot at a shorter and a longer step
  int trace_room;
  double *slot[2]; ///< [slot_room] values of its constraint rows there
  int slot_room;
  double *derivative; ///< [CAV_DERIVATIVE_ROWS*nv] derivatives of one contact or sensor
  char *missing;      ///< [nterm] 1: readings without analytic derivatives at this knot
  cav_user_room user; ///< derivatives of a quantity of one's own
  int differenced;    ///< calls in which differences stood in for analytic derivatives
  double seconds;
  double *join; ///< room of join.c
  size_t join_room;
} cav_scratch;

/// Makes an array longer, to n numbers; 0 if memory runs out, and it is as it was.
int cav_readings_grow(double **array, size_t n);

/// Lists the contacts that carry load at the state and makes room for all readings of knot t; 0 if memory runs out.
int cav_readings_list(cav_transcription *transcription, cav_scratch *scratch, int t);

/// Readings at the state's last evaluation: scratch->value [nv + nread].
void cav_readings_values(const cav_transcription *transcription, cav_scratch *scratch, int t);

/// Their derivatives by the transcription's method, scratch->dq, dv, dn [(nv + nread)*nv]. The state holds the point
/// (q, v, v_next) and is left there.
cav_status cav_readings_derivatives(const cav_transcription *transcription, cav_scratch *scratch, int t,
                                    const double *q, const double *v, const double *v_next);

/// Turns rows [n*3nv] whose columns are of the knots beside into rows over the unknowns, across the seam of a cycle.
/// transcription.c.
void cav_transcription_wrap(const cav_transcription *transcription, cav_scratch *scratch, int t, int n, double *row);

/// Derivative of the rotation vector from a target to a quaternion by that of the quaternion [4*nv]; out [3*nv].
void cav_rotation_rows(int nv, const double target[4], const double quat[4], const double *d_quat, double *out);

/// g [3nv] := sum of weight[i] times the derivative of reading i by (q, v, v_next), at the state's last evaluation;
/// weight [nv + nread]. A contact that has gone and a sensor without analytic derivatives add nothing.
cav_status cav_readings_adjoint(const cav_transcription *transcription, cav_scratch *scratch, int t,
                                const double *weight, double *g);

#endif
