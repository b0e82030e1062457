/// Centre of mass, its velocity and the angular momentum about it, of all links that move, at the state's poses.
#include "math3.h"
#include "smooth.h"

// mass of all links and their mean position
static double centre(const cav_model *model, const cav_state *state, double com[3]) {
  double mass = 0;
  zero3(com);
  for (int i = 1; i < model->nlink; i++) {
    axpy3(com, com, model->link[i].mass, state->com + 3 * i);
    mass += model->link[i].mass;
  }
  if (mass > 0) { scale3(com, 1 / mass, com); }
  return mass;
}

void cav_momentum(const cav_model *model, cav_state *state, const double *v, double *com, double *com_velocity,
                  double *angular_momentum) {
  double middle[3], linear[3] = {0, 0, 0}, angular[3] = {0, 0, 0};
  double mass = centre(model, state, middle), *velocity = state->work->velocity_now;
  if (com_velocity || angular_momentum) { cav_link_velocities(model, state, v, velocity); }

  // sums over links; the angular momentum about the common centre needs no velocity of that centre
  for (int i = 1; i < model->nlink && (com_velocity || angular_momentum); i++) {
    const double *V = velocity + 6 * i, *c = state->com + 3 * i;
    double speed[3], momentum[3], spin[3], arm[3];
    velocity_at(speed, V, state->reference + 3 * i, c);
    scale3(momentum, model->link[i].mass, speed);
    add3(linear, linear, momentum);
    symmetric_mul(spin, state->inertia + 6 * i, V);
    add3(angular, angular, spin);
    sub3(arm, c, middle);
    cross_add3(angular, arm, momentum);
  }
  if (com) { copy3(com, middle); }
  if (com_velocity) { scale3(com_velocity, mass > 0 ? 1 / mass : 0, linear); }
  if (angular_momentum) { copy3(angular_momentum, angular); }
}
