/// All of cavort.
#ifndef CAVORT_CAVORT_H
#define CAVORT_CAVORT_H

#include "cavort/dynamics.h"
#include "cavort/estimate.h"
#include "cavort/mhe.h"
#include "cavort/mocap.h"
#include "cavort/model.h"
#include "cavort/mpc.h"
#include "cavort/problem.h"
#include "cavort/result.h"
#include "cavort/solve.h"
#include "cavort/status.h"
#include "cavort/trajectory.h"

#endif
