/// Whether a motion ends while it still moves, where nothing makes it end at rest: of the trees that no actuator moves, or
/// else of all, the fastest. What comes after the last knot (a fall, a box that tips over) no certificate looks at, so this
/// is told and not required.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "verification.h"

static const double still_speed = 0.1, still_rate = 0.3; // m/s and rad/s

// velocities of all links at the last knot, without forces
static cav_status stand_at_end(const cav_verification *verification) {
  const cav_model *model = verification->model;
  int last = verification->last;
  const double *v = verification->v + last * model->nv;
  return cav_inverse(model, verification->bare, verification->q + last * model->nq, v, v, verification->bare->u);
}

cav_status cav_verification_ending(const cav_verification *verification, cav_verdict *verdict) {
  const cav_model *model = verification->model;
  verdict->end_speed_m_s = verdict->end_rate_rad_s = NAN;
  verdict->end_body[0] = 0;
  if (verification->problem->close_at_rest || verification->problem->cycle.on) return CAV_OK;
  cav_status status = stand_at_end(verification);
  double fastest = 1;
  for (int driven = 0; driven < 2 && !status && !verdict->end_body[0]; driven++) {
    for (int l = 1; l < model->nlink; l++) {
      const cav_link *link = &model->link[l];
      if (link->parent != 0 || link->driven != driven) continue;
      double along[3], turning[3];
      cav_sensor sensor = {.name = "", .object_type = CAV_OBJECT_BODY, .object = link->body, .dim = 3};
      sensor.type = CAV_SENSOR_SUBTREELINVEL;
      cav_sensor_read(model, verification->bare, &sensor, along);
      sensor.type = CAV_SENSOR_FRAMEANGVEL;
      cav_sensor_read(model, verification->bare, &sensor, turning);
      double speed = hypot(hypot(along[0], along[1]), along[2]);
      double rate = hypot(hypot(turning[0], turning[1]), turning[2]);
      double size = fmax(speed / still_speed, rate / still_rate);
      if (size <= fastest) continue;
      fastest = size;
      verdict->end_speed_m_s = speed, verdict->end_rate_rad_s = rate;
      snprintf(verdict->end_body, sizeof verdict->end_body, "%s", model->body[link->body].name);
      if (!verdict->end_body[0]) snprintf(verdict->end_body, sizeof verdict->end_body, "body %d", link->body);
    }
  }
  return status;
}
