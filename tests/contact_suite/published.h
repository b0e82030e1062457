/// Error and run time that the SimBenchmark of ETH Zurich published in 2018 (leggedrobotics.github.io/SimBenchmark, its
/// data folder), without correction of penetration, on an Intel i7-7700HQ at 2.8 GHz: facts to stand beside.
#ifndef CAVORT_CONTACT_SUITE_PUBLISHED_H
#define CAVORT_CONTACT_SUITE_PUBLISHED_H

#include "suite.h"

/// Rolling balls, force along (cos 60, sin 60): (m/s)^2. At 1 ms the later record, solver to tolerance.
static const suite_point published_rolling[] = {
    {"RaiSim", 0.001, 4.13711e-07, 0.308104},
    {"Bullet, multibody", 0.001, 5.70654e-09, 0.561834},
    {"ODE, quick", 0.001, 3.14497, 0.724026},
    {"MuJoCo 1.5, PGS", 0.001, 0.00708349, 2.31035},
    {"MuJoCo 1.5, CG", 0.001, 0.00814432, 1.32841},
    {"MuJoCo 1.5, Newton", 0.001, 0.00692691, 1.67194},
    {"MuJoCo 1.5, Newton, RK4", 0.001, 0.0027148, 4.40043},
    {"DART, Dantzig", 0.001, 3.14497, 2.67552},
    {"RaiSim", 0.01, 4.21398e-07, 0.029341},
    {"Bullet, multibody", 0.01, 7.54888e-09, 0.11212},
    {"ODE, quick", 0.01, 3.13436, 0.0736959},
    {"MuJoCo 1.5, Newton", 0.01, 0.213115, 0.068249},
    {"DART, Dantzig", 0.01, 3.13436, 0.289573},
    {"RaiSim", 0.04, 4.24174e-07, 0.00683594},
    {"Bullet, multibody", 0.04, 6.05684e-09, 0.0580239},
    {"ODE, quick", 0.04, 3.09912, 0.019635},
    {"MuJoCo 1.5, Newton", 0.04, 0.640142, 0.0220659},
    {"DART, Dantzig", 0.04, 3.0991, 0.069993},
    {"RaiSim", 1e-5, 4.12085e-07, 19.8656},
    {"Bullet, multibody", 1e-5, 6.51777e-09, 36.9246},
    {"MuJoCo 1.5, Newton", 1e-5, 0.000960323, 68.9889},
    {"RaiSim", 1e-4, 4.11807e-07, 2.46626},
    {"Bullet, multibody", 1e-4, 7.36871e-09, 5.43088},
    {"MuJoCo 1.5, Newton", 1e-4, 0.00150269, 7.27899},
    {"RaiSim", 0.004, 4.20923e-07, 0.0653889},
    {"Bullet, multibody", 0.004, 6.67193e-09, 0.223315},
    {"MuJoCo 1.5, Newton", 0.004, 0.0356559, 0.228392},
};

/// 6^3 balls: mean over 10 s of the sum of squared penetrations, m^2.
static const suite_point published_balls[] = {
    {"RaiSim", 0.001, 0.00013534, 1.40545},           {"Bullet, multibody", 0.001, 0.38247, 11.9778},
    {"ODE, standard", 0.001, 0.000154633, 10.5776},   {"ODE, quick", 0.001, 0.000157122, 10.0378},
    {"MuJoCo 1.5, CG", 0.001, 0.0950094, 12.0555},    {"MuJoCo 1.5, Newton", 0.001, 0.0950124, 43.1372},
    {"RaiSim", 0.004, 0.00211391, 0.374103},          {"ODE, quick", 0.004, 0.00208149, 2.52893},
    {"MuJoCo 1.5, Newton", 0.004, 0.374245, 15.3103}, {"RaiSim", 0.01, 0.0152745, 0.162598},
    {"Bullet, multibody", 0.01, 37.4217, 2.01153},    {"ODE, standard", 0.01, 0.0161143, 1.35536},
    {"ODE, quick", 0.01, 0.0161901, 1.00332},         {"MuJoCo 1.5, CG", 0.01, 0.933764, 1.79375},
    {"MuJoCo 1.5, Newton", 0.01, 0.933766, 5.1182},   {"RaiSim", 0.04, 0.249862, 0.0509331},
    {"ODE, quick", 0.04, 0.236774, 0.286833},         {"MuJoCo 1.5, Newton", 0.04, 3.84858, 16.7819},
    {"RaiSim", 1e-4, 1.63724e-06, 13.1841},           {"Bullet, multibody", 1e-4, 0.00353091, 79.6021},
    {"ODE, standard", 1e-4, 1.54658e-06, 94.4652},    {"MuJoCo 1.5, Newton", 1e-4, 0.0112876, 291.667},
};

/// A ball of 10 kg at 5 m/s against a quadruped without weight, 10 s: mean of |p - p(0)|^2, (kg m/s)^2. Another robot than
/// ours.
static const suite_point published_momentum[] = {
    {"RaiSim", 0.001, 4.65928e-05, 0.062886},
    {"Bullet, multibody", 0.001, 0.000265836, 0.43904},
    {"ODE, standard", 0.001, 4.58962e-26, 2.70698},
    {"MuJoCo 1.5, Newton", 0.001, 0.0011404, 0.379829},
    {"MuJoCo 1.5, Newton, RK4", 0.001, 4.66112e-13, 0.790538},
    {"RaiSim", 0.01, 0.00539045, 0.0061512},
    {"Bullet, multibody", 0.01, 0.022708, 0.035419},
    {"ODE, quick", 0.01, 4.03941e-28, 0.179843},
    {"MuJoCo 1.5, Newton", 0.01, 0.0156349, 0.038142},
    {"MuJoCo 1.5, Newton, RK4", 0.01, 2.39848e-05, 0.0783849},
};

/// A quadruped thrown up by twice its weight for 1 s, then 2 s of flight: mean of (E - E(0))^2 in flight, J^2. Another robot
/// than ours.
static const suite_point published_energy[] = {
    {"RaiSim", 0.001, 0.0118404, 0.0160401},
    {"Bullet, multibody", 0.001, 3.65233, 0.082814},
    {"ODE, standard", 0.001, 3.89101, 0.734106},
    {"MuJoCo 1.5, Newton", 0.001, 3.48198, 0.063359},
    {"MuJoCo 1.5, Newton, RK4", 0.001, 1.6273e-17, 0.139079},
    {"RaiSim", 0.01, 1.39767, 0.00135994},
    {"Bullet, multibody", 0.01, 342.786, 0.010957},
    {"ODE, quick", 0.01, 379.89, 0.0516329},
    {"MuJoCo 1.5, Newton", 0.01, 343.91, 0.006392},
    {"MuJoCo 1.5, Newton, RK4", 0.01, 5.56596e-11, 0.0135331},
};

#endif
