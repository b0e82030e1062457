/// Swing-ups whose optima have no closed form: the values are those of Pontryagin's conditions, solved by multiple
/// shooting (20 and 40 arcs of 100 Runge-Kutta steps, residual 1e-9) with equations of motion of their own.
#include "optimum.h"

static const char cartpole[] =
    "<mujoco><worldbody><body name='cart'><joint name='x' type='slide' axis='1 0 0'/>"
    "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><body name='pole'><joint name='pole' axis='0 -1 0'/>"
    "<inertial pos='0 0 -.5' mass='.3' diaginertia='.001 .001 .001'/></body></body></worldbody>"
    "<actuator><motor joint='x'/></actuator></mujoco>";

static void build_cartpole(optimum_problem *p, int n) {
  (void)n;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_end(p, (double[]){1, M_PI}, (double[]){0, 0});
}

static void unknown(int n, int nv, optimum_truth *truth) {
  for (int i = 0; i < (n + 1) * nv; i++) truth->q[i] = truth->u[i] = NAN;
}

static void truth_cartpole(int n, optimum_truth *truth) {
  unknown(n, 2, truth);
  truth->duration = 2;
  truth->cost = 29.7075033;
}

// two links of 1 m and 1 kg, driven at the elbow
static const char acrobot[] =
    "<mujoco><worldbody><body name='upper'><joint name='shoulder' axis='0 -1 0'/>"
    "<inertial pos='0 0 -.5' mass='1' diaginertia='.083 .083 .083'/><body name='lower' pos='0 0 -1'><joint "
    "name='elbow' axis='0 -1 0'/><inertial pos='0 0 -.5' mass='1' diaginertia='.083 .083 .083'/></body></body>"
    "</worldbody><actuator><motor joint='elbow'/></actuator></mujoco>";

static void build_acrobot(optimum_problem *p, int n) {
  (void)n;
  optimum_cost(p, CAV_QUANTITY_EFFORT, 1);
  optimum_end(p, (double[]){M_PI, 0}, (double[]){0, 0});
}

static void truth_acrobot(int n, optimum_truth *truth) {
  unknown(n, 2, truth);
  truth->duration = 4;
  truth->cost = 36.9127713;
}

const optimum optimum_pendulum[] = {
    {.name = "cart-pole",
     .text = "a pole on a cart swung up",
     .model = cartpole,
     .duration = 2,
     .coarsest = 40,
     .build = build_cartpole,
     .truth = truth_cartpole,
     .cost = {.02, 1}},
    {.name = "acrobot",
     .text = "two links swung up by the elbow",
     .model = acrobot,
     .duration = 4,
     .coarsest = 100,
     .build = build_acrobot,
     .truth = truth_acrobot,
     // its end at the finest grid is where three programmes in a row gain little: 5e-3 short of the optimum
     .optimal = 1e-2,
     .cost = {.02, 1}},
};
const int optimum_npendulum = sizeof optimum_pendulum / sizeof *optimum_pendulum;
