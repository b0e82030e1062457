/// Centre of pressure of what stands on the world.
#ifndef CAVORT_PRESSURE_H
#define CAVORT_PRESSURE_H

#include "cavort/result.h"

/// Writes a table over time: of each body that the world ever pushes force and free moment (NAME_fx, _fy, _fz, N; _mz,
/// N m) and the point of the plane z = 0 about which that force has no moment but _mz (NAME_x, _y, m), empty where it is
/// not loaded upwards by a hundredth of the weight. CAV_NO_MEMORY, CAV_BAD_INPUT.
cav_status cav_pressure_write(const char *path, const cav_model *model, const cav_trajectory *trajectory,
                              const cav_forces *forces, cav_error *error);

#endif
