/// The contact suite: scenes of the literature built anew from their published constants, run by this library and, where
/// it is installed, by MuJoCo, in turns in one process; one row of a Markdown table each, beside the published ones.
/// Both libraries lay q, v and generalised forces out alike, so every measure is written once.
#ifndef CAVORT_CONTACT_SUITE_H
#define CAVORT_CONTACT_SUITE_H

#include "bench.h"

/// Checks of all files of the suite count together.
int suite_check(int holds, const char *file, int line, const char *text);
/// What main returns.
int suite_result(void);
#undef CHECK
#define CHECK(condition) suite_check(!!(condition), __FILE__, __LINE__, #condition)

/// How a scene is stepped: by whom, at which step, by which law. Without a name of an engine: this library.
typedef struct suite_setting {
  const char *text; ///< what the table says of it
  double h;         ///< s
  int mujoco;       ///< 1: MuJoCo, else this library
  cav_stabilisation stabilisation;
  double softness,
      time_constant; ///< of the discrete stabilisation, or of all contacts of MuJoCo; 0: those of the model
  cav_sliding sliding;
  int order; ///< cav_order, or for MuJoCo 1: fourth order Runge-Kutta
} suite_setting;

/// A scene in motion.
typedef struct suite_run {
  const suite_setting *setting;
  cav_model *model;
  cav_state *state;
  double *q, *v, *u; ///< present configuration, velocity and applied force
  double *next;
  double seconds; ///< of the processor, in steps alone
  long steps, iterations;
  int failed; ///< steps that did not converge, or went wrong
#ifdef CAVORT_HAVE_MUJOCO
  mjModel *m;
  mjData *d;
#endif
} suite_run;

/// 0 if MuJoCo is asked for and not there.
int suite_available(const suite_setting *setting);

/// Loads an MJCF text at its reference configuration. A failed check and 0 if it does not load.
int suite_open(suite_run *run, const char *text, const suite_setting *setting);
void suite_close(suite_run *run);

/// One step, timed. A body that leaves the numbers is a failed step.
void suite_step(suite_run *run);

/// Kinetic and potential energy, J, of bodies and gravity alone.
double suite_energy(suite_run *run);

/// One row: scene and measure, engine and setting from the run, error and time.
void suite_row(const char *scene, const suite_run *run, double error);
/// A row that someone published.
void suite_published_row(const char *scene, const char *engine, double h, double error, double seconds);
/// A published point of the SimBenchmark of ETH Zurich (2018), on an Intel i7-7700HQ.
typedef struct suite_point {
  const char *engine;
  double h, error, seconds;
} suite_point;

/// Prints the published points at the steps of ours, and in a line of its own whether a published point or one of MuJoCo
/// here is at least as good as one of ours in both error and time: a failed check.
void suite_compare(const char *scene, const suite_point *published, int n, const suite_point *peer, int npeer,
                   const suite_point *ours, int nours);

/// Scenes, in the order of the table; quick leaves out what takes over a second.
void suite_rolling(int quick);
void suite_balls(int quick);
void suite_robot(int quick);
void suite_bodies(int quick);
void suite_hand(int quick);
void suite_chains(int quick);
void suite_humanoid(int quick);
void suite_laws(int quick);

/// Standing and dragging for so many seconds of simulated time at 5 ms, with its assertions.
void suite_standing(double seconds);
void suite_dragging(double seconds);

#endif
