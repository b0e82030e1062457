/// What the commands say where a component, a direction or an orientation is asked for in axes that are not those of the file:
/// `body` and reftype="body" are places at the centre of mass along the principal axes of inertia, as in MuJoCo, which turn from
/// the body's own by what its geoms weigh; "xbody" is the frame of the file.
#include <math.h>
#include <stdio.h>

#include "cavort/dynamics.h"
#include "cavort/problem.h"
#include "command.h"
#include "math3.h"
#include "rotation.h"

// degrees: axes turned by less are taken for the same; rad: an orientation nearer to that of a posture is that
static const double turned = 1, same = 1e-6;

/// The body in whose principal axes the components of a sensor are read; -1: it is none of these.
static int body_of_axes(const cav_sensor *s) {
  if (s->type != CAV_SENSOR_FRAMEPOS && s->type != CAV_SENSOR_FRAMELINVEL && s->type != CAV_SENSOR_FRAMEANGVEL)
    return -1;
  return s->referred && s->reference_type == CAV_OBJECT_BODY ? s->reference : -1;
}

/// The axis of its object whose direction a sensor reads, 3: all of them, -1: none.
static int axis_of(const cav_sensor *s) {
  return s->type == CAV_SENSOR_FRAMEXAXIS   ? 0
         : s->type == CAV_SENSOR_FRAMEYAXIS ? 1
         : s->type == CAV_SENSOR_FRAMEZAXIS ? 2
         : s->type == CAV_SENSOR_FRAMEQUAT  ? 3
                                            : -1;
}

/// Degrees from an axis of a body to that of its principal axes; axis 3: from all of its axes to them.
static double turn_of(const cav_body *body, int axis) {
  const double *q = body->iquat, along = axis < 3 ? q[1 + axis] : 0;
  double across = 0;
  for (int k = 0; k < 3; k++) across = hypot(across, k == axis ? 0 : q[1 + k]);
  return 2 * atan2(across, hypot(q[0], along)) * 180 / M_PI;
}

/// Whether an orientation is wanted as a posture has it: the body's own axes say the same then.
static int is_of_posture(const cav_problem *p, const cav_term *term, const double *q) {
  double at[CAV_SENSOR_DIM_MAX], phi[3] = {1};
  if (term->sensor.dim != 4 || term->component >= 0 || !term->target || term->nwaypoint) return 0;
  cav_state *state = cav_state_new(p->model);
  if (state && !cav_position(p->model, state, q)) {
    cav_sensor_read(p->model, state, &term->sensor, at);
    cav_rotation_between(term->target, at, phi);
  }
  cav_state_free(state);
  return norm3(phi) < same;
}

/// Of a component along the principal axes of a body.
static int tell_component(FILE *out, const cav_problem *p, const cav_term *term, const char *name) {
  const int at = body_of_axes(&term->sensor);
  if (at < 0 || term->component < 0) return 0;
  const cav_body *body = &p->model->body[at];
  const double degrees = turn_of(body, 3);
  if (degrees < turned) return 0;
  fprintf(out,
          "note: '%.60s' asks for component %c along the principal axes of body '%.48s', which are turned by %.3g "
          "degrees "
          "from the body's own: reftype=\"xbody\" has those of the file\n",
          name, "xyz"[term->component % 3], body -> name, degrees);
  return 1;
}

/// Of a direction, or an orientation, that is that of the principal axes of a body.
static int tell_direction(FILE *out, const cav_problem *p, const cav_term *term, const char *name) {
  const cav_sensor *s = &term->sensor;
  const int axis = axis_of(s);
  if (axis < 0 || s->object_type != CAV_OBJECT_BODY) return 0;
  const cav_body *body = &p->model->body[s->object];
  const double degrees = turn_of(body, axis);
  if (degrees < turned || is_of_posture(p, term, p->q_start) || is_of_posture(p, term, p->q_goal)) return 0;
  fprintf(out,
          "note: '%.60s' reads %s of the principal axes of inertia of body '%.48s', turned by %.3g degrees from "
          "the body's own: xbody=\"%.48s\" has %s of the file\n",
          name, (const char *[]){"axis x", "axis y", "axis z", "the orientation"}[axis], body->name, degrees,
          body->name, axis < 3 ? "that" : "those");
  return 1;
}

int cav_command_tell_axes(FILE *out, const cav_problem *p) {
  int told = 0;
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    const char *name = term->name && *term->name ? term->name : "sensor";
    if (term->quantity != CAV_QUANTITY_SENSOR) continue;
    told += tell_component(out, p, term, name) + tell_direction(out, p, term, name);
  }
  return told;
}
