/// What the commands say where a component is asked for in axes that are not those of the file: `body` and reftype="body" are
/// places at the centre of mass along the principal axes of inertia, as in MuJoCo, which turn from the body's own by what its
/// geoms weigh; "xbody" is the frame of the file.
#include <math.h>
#include <stdio.h>

#include "cavort/problem.h"
#include "command.h"

// degrees: axes turned by less are taken for the same
static const double turned = 1;

/// The body in whose principal axes the components of a sensor are read; -1: it is none of these.
static int body_of_axes(const cav_sensor *s) {
  if (s->type != CAV_SENSOR_FRAMEPOS && s->type != CAV_SENSOR_FRAMELINVEL && s->type != CAV_SENSOR_FRAMEANGVEL)
    return -1;
  return s->referred && s->reference_type == CAV_OBJECT_BODY ? s->reference : -1;
}

int cav_command_tell_axes(FILE *out, const cav_problem *p) {
  int told = 0;
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    const int body = term->quantity == CAV_QUANTITY_SENSOR ? body_of_axes(&term->sensor) : -1;
    if (body < 0 || term->component < 0) continue;
    const double *turn = p->model->body[body].iquat;
    const double degrees = 2 * atan2(hypot(hypot(turn[1], turn[2]), turn[3]), fabs(turn[0])) * 180 / M_PI;
    if (degrees < turned) continue;
    fprintf(out,
            "note: '%.60s' asks for component %c along the principal axes of body '%.48s', which are turned by %.3g "
            "degrees "
            "from the body's own: reftype=\"xbody\" has those of the file\n",
            term->name && *term->name ? term->name : "sensor", "xyz"[term->component % 3],
            p -> model -> body[body].name, degrees);
    told++;
  }
  return told;
}
