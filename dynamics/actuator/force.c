/// Force of an actuator from its length, velocity and input: gain * input + bias, clamped to the limits of the force.
/// Gain and bias are constants, affine in length and velocity, or those of a muscle: MJCF's curves, unit force times
/// active force over length and over velocity, and passive force over length. The input is the control, or the
/// activation where the actuator has one; how activation follows control is not computed.
#include "actuator.h"
#include "math3.h"

/// A muscle at one length and velocity, in its own units.
typedef struct fibre {
  double force;            ///< peak active force, N
  double length, velocity; ///< over the resting length; over resting lengths per second at which it cannot pull
} fibre;

// parameters: range (2), force, scale, lmin, lmax, vmax, fpmax, fvmax
static fibre fibre_of(const cav_actuator *a, const double *p, double length, double velocity) {
  double span = (a->lengthrange[1] - a->lengthrange[0]) / fmax(1e-15, p[1] - p[0]), rest = fmax(1e-15, span);
  fibre f = {.force = p[2] < 0 ? p[3] / fmax(1e-15, a->acceleration) : p[2]};
  f.length = p[0] + (length - a->lengthrange[0]) / rest;
  f.velocity = velocity / (rest * fmax(1e-15, p[6]));
  return f;
}

// 0 at low and high, 1 at peak, made of four parabolas
static double bump(double x, double low, double peak, double high) {
  double left = 0.5 * (low + peak), right = 0.5 * (peak + high), t;
  if (x <= low || x >= high) { return 0; }
  if (x < left) {
    t = (x - low) / (left - low);
    return 0.5 * t * t;
  }
  if (x < peak) {
    t = (peak - x) / (peak - left);
    return 1 - 0.5 * t * t;
  }
  if (x < right) {
    t = (x - peak) / (right - peak);
    return 1 - 0.5 * t * t;
  }
  t = (high - x) / (high - right);
  return 0.5 * t * t;
}

// active force over velocity: zero from -1 on, 1 at rest, fvmax when lengthening fast
static double over_velocity(double v, double most) {
  double y = most - 1;
  if (v <= -1) { return 0; }
  if (v <= 0) { return (v + 1) * (v + 1); }
  return v <= y ? most - (y - v) * (y - v) / fmax(1e-15, y) : most;
}

static double muscle_gain(const cav_actuator *a, double length, double velocity) {
  const double *p = a->gain_parameter;
  fibre f = fibre_of(a, p, length, velocity);
  return -f.force * bump(f.length, p[4], 1, p[5]) * over_velocity(f.velocity, p[8]);
}

static double muscle_bias(const cav_actuator *a, double length) {
  const double *p = a->bias_parameter;
  fibre f = fibre_of(a, p, length, 0);
  double b = 0.5 * (1 + p[5]), x = (f.length - 1) / fmax(1e-15, b - 1);
  if (f.length <= 1) { return 0; }
  return -f.force * p[7] * (f.length <= b ? 0.5 * x * x : x - 0.5);
}

static double affine(const double *p, double length, double velocity) { return p[0] + p[1] * length + p[2] * velocity; }

static double gain_of(const cav_actuator *a, double length, double velocity) {
  switch (a->gain) {
    case CAV_GAIN_FIXED:
      break;
    case CAV_GAIN_AFFINE:
      return affine(a->gain_parameter, length, velocity);
    case CAV_GAIN_MUSCLE:
      return muscle_gain(a, length, velocity);
  }
  return a->gain_parameter[0];
}

static double bias_of(const cav_actuator *a, double length, double velocity) {
  switch (a->bias) {
    case CAV_BIAS_NONE:
      break;
    case CAV_BIAS_AFFINE:
      return affine(a->bias_parameter, length, velocity);
    case CAV_BIAS_MUSCLE:
      return muscle_bias(a, length);
  }
  return 0;
}

static void gain_and_bias(const cav_actuator *a, double length, double velocity, double *gain, double *bias) {
  *gain = gain_of(a, length, velocity);
  *bias = bias_of(a, length, velocity);
}

static double clamp_to(double x, const double range[2]) { return fmin(fmax(x, range[0]), range[1]); }

// limits of the force; those of the model are in units of effort
static void force_limits(const cav_actuator *a, double range[2]) {
  range[0] = -INFINITY;
  range[1] = INFINITY;
  if (!a->forcelimited) { return; }
  double x = a->unit * a->forcerange[0], y = a->unit * a->forcerange[1];
  range[0] = fmin(x, y);
  range[1] = fmax(x, y);
}

// limits of the input: of the control, whose activation never leaves them, or of an integrated activation
static void input_limits(const cav_actuator *a, double range[2]) {
  range[0] = -INFINITY;
  range[1] = INFINITY;
  if (a->activation == CAV_ACTIVATION_INTEGRATOR) {
    if (a->actlimited) { memcpy(range, a->actrange, sizeof a->actrange); }
  } else if (a->ctrllimited) {
    memcpy(range, a->ctrlrange, sizeof a->ctrlrange);
  }
}

double cav_actuator_force(const cav_model *model, int actuator, double length, double velocity, double input) {
  const cav_actuator *a = &model->actuator[actuator];
  double gain, bias, most[2], inputs[2];
  gain_and_bias(a, length, velocity, &gain, &bias);
  force_limits(a, most);
  input_limits(a, inputs);
  return clamp_to(gain * clamp_to(input, inputs) + bias, most);
}

int cav_actuator_input(const cav_model *model, int actuator, double length, double velocity, double force,
                       double *input) {
  const cav_actuator *a = &model->actuator[actuator];
  double gain, bias, most[2], inputs[2];
  gain_and_bias(a, length, velocity, &gain, &bias);
  force_limits(a, most);
  input_limits(a, inputs);
  // an actuator that cannot push at all is best left alone
  double wanted = gain != 0 ? (clamp_to(force, most) - bias) / gain : 0;
  *input = clamp_to(wanted, inputs);
  double reached = clamp_to(gain * *input + bias, most), scale = fabs(force) + fabs(bias);
  return fabs(reached - force) <= 1e-9 * scale;
}

void cav_actuator_effort_range(const cav_model *model, int actuator, double range[2]) {
  const cav_actuator *a = &model->actuator[actuator];
  range[0] = -INFINITY;
  range[1] = INFINITY;
  if (a->gain == CAV_GAIN_FIXED && a->bias == CAV_BIAS_NONE) { input_limits(a, range); }
  if (a->forcelimited) {
    range[0] = fmax(range[0], a->forcerange[0]);
    range[1] = fmin(range[1], a->forcerange[1]);
  }
}
