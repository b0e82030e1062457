/// A force asked of a touch sensor at which nothing can press: no pair of geoms that may touch has one of its body's, as
/// where the body has shapes that are only seen and those that touch are its parent's.
#include <math.h>
#include <stdio.h>

#include "cavort/dynamics.h"
#include "feasibility.h"

/// Whether a contact of some pair counts for a sensor: of a body none with its own tree.
static int can_sense(const cav_model *m, const cav_sensor *sensor) {
  for (int i = 0; i < m->npair; i++) {
    const cav_pair *pair = &m->pair[i];
    if (!cav_touch_sees(m, sensor, pair->geom1) && !cav_touch_sees(m, sensor, pair->geom2)) continue;
    const int a = m->geom[pair->geom1].link, b = m->geom[pair->geom2].link;
    if (sensor->object_type == CAV_OBJECT_SITE || !a || !b || m->link[a].root != m->link[b].root) return 1;
  }
  return 0;
}

/// The nearest body, of those that a sensor's body hangs on, of which touches can be sensed; 0: none.
static int find_other(const cav_model *m, const cav_sensor *sensor) {
  cav_sensor other = *sensor;
  other.object_type = CAV_OBJECT_BODY;
  int body = sensor->object_type == CAV_OBJECT_SITE   ? m->site[sensor->object].body
             : sensor->object_type == CAV_OBJECT_GEOM ? m->geom[sensor->object].body
                                                      : m->body[sensor->object].parent;
  for (; body > 0; body = m->body[body].parent) {
    other.object = body;
    if (can_sense(m, &other)) return body;
  }
  return 0;
}

cav_status cav_examine_touches(cav_examination *e) {
  const cav_model *m = e->model;
  for (int i = 0; i < e->problem->nterm; i++) {
    const cav_term *term = &e->problem->term[i];
    double low[3], high[3];
    int first, last;
    if (term->quantity != CAV_QUANTITY_SENSOR || term->sensor.type != CAV_SENSOR_TOUCH) continue;
    cav_requirement_window(e, term, &first, &last);
    if (!cav_requirement_interval(e, term, last, INFINITY, low, high) || !(low[0] > 0)) continue;
    if (can_sense(m, &term->sensor)) continue;
    const cav_requirement r = {.term = i, .knot = last};
    const int other = find_other(m, &term->sensor);
    char what[160], cure[160] = "Ask it of something that can touch: inspect --all lists geoms that can.";
    cav_requirement_sensor_words(e, term, last, what, sizeof what);
    if (other) snprintf(cure, sizeof cure, "Ask it of body '%.60s', on which it hangs.", m->body[other].name);
    cav_impossible(e, CAV_CONDITION_TOUCH, &r, cure, "%s, but nothing can touch it: it has no geom of a pair that may",
                   what);
    return CAV_OK;
  }
  return CAV_OK;
}
