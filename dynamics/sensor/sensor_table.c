/// The table of sensors, as CAV_SENSORS declares them.
#include <assert.h>

#include "cavort/model.h"

#define RULE(type, name, dim, target, stage, text) \
  [CAV_SENSOR_##type] = {name, dim, CAV_TARGET_##target, CAV_READS_##stage, text},
static const cav_sensor_rule rules[CAV_SENSOR_TYPES] = {CAV_SENSORS(RULE)};

#define FITS(type, name, dim, ...) _Static_assert(dim >= 1 && dim <= CAV_SENSOR_DIM_MAX, "a reading has room: " name);
CAV_SENSORS(FITS)

const cav_sensor_rule *cav_sensor_rule_of(cav_sensor_type type) {
  assert(type < CAV_SENSOR_TYPES);
  return &rules[type];
}
