/// Softness in the words of the Open Dynamics Engine, whose rows obey J v_next = -(ERP/h) x - CFM F with F a force
/// (manual, "Joint error and the ERP", "Soft constraint and CFM"). In impulses f = h F that is R f = v* - J v_next with
///
///   R = CFM/h,  v* = -(ERP/h) x,  so  h B = 1,  h^2 K = ERP:
///
/// first order where (28) is second: the velocity that is there is forgotten, the error falls by the fraction ERP in
/// each step whatever its length. Every row of ODE is one of ours, exactly; CFM is absolute, so R does not grow with A
/// and light bodies are held more softly. The other way only slow motion is alike: a row of ours is a spring K/R, a
/// damper B/R and, along the row, a mass 1/R, of which ODE has the first two: ERP = h k/(h k + b), CFM = 1/(h k + b).
/// Rows are all this speaks of: what an engine does with them, a complementarity problem there, a convex one here,
/// differs beside.
#include <math.h>

#include "cavort/dynamics.h"
#include "constraint.h"

// impedances outside are not used: limits.c
static const double IMPEDANCE_MIN = 1e-4, IMPEDANCE_MAX = 0.9999;

cav_status cav_softness_from_ode(double cfm, double erp, double timestep, double weight, cav_softness *softness) {
  if (!(cfm > 0 && erp >= 0 && timestep > 0 && weight > 0)) return CAV_BAD_INPUT;
  double d = weight / (weight + cfm / timestep);
  if (!(d >= IMPEDANCE_MIN && d <= IMPEDANCE_MAX)) return CAV_BAD_INPUT;
  *softness = (cav_softness){{-erp * d / (timestep * timestep), -d / timestep}, {d, d, 0.001, 0.5, 2}};
  return CAV_OK;
}

cav_status cav_softness_to_ode(const cav_state *state, const cav_softness *softness, double weight, double *cfm,
                               double *erp) {
  double h = state->options.timestep;
  if (!(weight > 0 && h > 0)) return CAV_BAD_INPUT;
  // at a violation beyond the width, where the impedance is the last
  cav_law law = cav_law_at(state, softness, softness->solimp[2], weight);
  double stiffness = law.stiffness / (h * law.regulariser), damping = law.damping / (h * law.regulariser);
  double sum = h * stiffness + damping;
  if (!(sum > 0)) return CAV_BAD_INPUT;
  *cfm = 1 / sum;
  *erp = h * stiffness / sum;
  return CAV_OK;
}

cav_options cav_options_at_step(const cav_options *options, double timestep) {
  cav_options finer = *options;
  finer.timestep = timestep;
  if (options->stabilisation != CAV_STABILISATION_DISCRETE || timestep == options->timestep) return finer;
  // the fraction of a gap that a step leaves is z; (1 - z)/h stays
  double z = options->time_constant > 0 ? exp(-options->timestep / options->time_constant) : 0;
  double closed = (1 - z) * timestep / options->timestep;
  finer.time_constant = closed < 1 ? -timestep / log1p(-closed) : 0;
  return finer;
}
