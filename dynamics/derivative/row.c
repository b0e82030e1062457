/// Scalar rows in the derivatives, added entry by entry: limits of joints and tendons, friction losses. Equality
/// constraints are equality.c's.
#include "analytic.h"
#include "rotation.h"

/// Derivatives of a scalar row's impulse.
typedef struct row_derivative {
  double by_dist, by_velocity, hessian;
} row_derivative;

static row_derivative differentiate_row(const cav_derivative_task *t, const cav_row *row,
                                        const cav_softness *softness) {
  int friction = row->type == CAV_ROW_FRICTION_DOF || row->type == CAV_ROW_FRICTION_TENDON;
  double z = (1 - row->damping) * row->velocity - row->velocity_next, f, H, regulariser, stiffness;
  if (friction) {
    cav_law_bilateral(row->regulariser, row->sigma, row->bound, z / row->regulariser, &f, &H, NULL);
    return (row_derivative){0, (1 - row->damping) * H, H};
  }
  double gap = row->dist - row->margin;
  z -= row->stiffness * gap;
  cav_law_unilateral(row->regulariser, row->sigma, 0, z / row->regulariser, &f, &H, NULL);
  cav_law_rates(t->state, softness, gap, row->regulariser, &regulariser, &stiffness);
  double by_dist = -H * row->stiffness * (1 + stiffness * gap) - regulariser * f + stiffness * (f - H * z);
  return (row_derivative){by_dist, (1 - row->damping) * H, H};
}

// angle limit of a ball joint: its axis turns with the joint
static void add_ball_limit(const cav_derivative_task *t, const cav_row *row, const cav_joint *joint,
                           const row_derivative *s) {
  const cav_workspace *w = t->state->work;
  double turn[3], J[9], scale = -t->inverse_h;
  quat_log(turn, w->q + joint->q);
  double angle = norm3(turn);
  cav_rotation_jacobian_inverse(turn, J);
  for (int j = 0; j < 3; j++) {
    // axis = -turn/angle, and turn changes by a column of J
    double turned[3], axis[3], along;
    column3(turned, J, j);
    along = dot3(row->axis, turned);
    axpy3(axis, turned, -along, row->axis);
    scale3(axis, angle > 0 ? -1 / angle : 0, axis);
    double now = dot3(axis, w->v + joint->dof), next = dot3(axis, w->v_next + joint->dof);
    double force = s->by_dist * row->axis[j] + s->by_velocity * now - s->hessian * next;
    for (int i = 0; i < 3; i++) {
      int at = (joint->dof + i) * t->nv + joint->dof + j;
      t->dq[at] += scale * (row->axis[i] * force + axis[i] * row->impulse);
      t->dv[at] += scale * row->axis[i] * row->axis[j] * s->by_velocity;
      t->dn[at] -= scale * row->axis[i] * row->axis[j] * s->hessian;
    }
  }
}

cav_status cav_derivative_rows(const cav_derivative_task *t) {
  double scale = -t->inverse_h, one = 1;
  for (int i = 0; i < t->state->nrow; i++) {
    const cav_row *row = &t->state->row[i];
    row_derivative s;
    switch (row->type) {
      case CAV_ROW_FRICTION_DOF:
        s = differentiate_row(t, row, NULL);
        add_scalar(t, 1, &row->object, &one, 0, scale * s.by_velocity, -scale * s.hessian);
        break;
      case CAV_ROW_FRICTION_TENDON:
        s = differentiate_row(t, row, NULL);
        add_along_tendon(t, row->object, 0, scale * s.by_velocity, -scale * s.hessian);
        break;
      case CAV_ROW_LIMIT_JOINT: {
        const cav_joint *joint = &t->model->joint[row->object];
        s = differentiate_row(t, row, &joint->limit);
        if (joint->type == CAV_JOINT_BALL) {
          add_ball_limit(t, row, joint, &s);
        } else {
          // both ends alike: the sign of the gradient cancels
          add_scalar(t, 1, &joint->dof, &one, scale * s.by_dist, scale * s.by_velocity, -scale * s.hessian);
        }
        break;
      }
      case CAV_ROW_LIMIT_TENDON:
        s = differentiate_row(t, row, &t->model->tendon[row->object].limit);
        add_along_tendon(t, row->object, scale * s.by_dist, scale * s.by_velocity, -scale * s.hessian);
        break;
      default:
        return CAV_NOT_SUPPORTED;
    }
  }
  return CAV_OK;
}
