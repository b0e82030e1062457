/// What is not well at a value, in words: what was seen, and what it comes from where a known bound of the method is
/// passed. A cause is told only where its own number says so; otherwise what the parameter does in general.
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/dynamics.h"
#include "dense.h"
#include "edit.h"
#include "probe.h"

enum { POWERS = 100 };
// from which on a spring taken where a step begins is unstable; how much worse than at the scene's own value is another thing
static const double SPRING_BOUND = 4, WORSE = 3;

static void add(char why[CAV_STRESS_WHY], const char *format, ...) __attribute__((format(printf, 2, 3)));
static void add(char why[CAV_STRESS_WHY], const char *format, ...) {
  const size_t used = strlen(why);
  va_list list;
  va_start(list, format);
  vsnprintf(why + used, CAV_STRESS_WHY - used, format, list);
  va_end(list);
}

static const char *name_of(const cav_model *model, int dof) {
  const char *name = model->joint[model->dof[dof].joint].name;
  return *name ? name : "without a name";
}

static void tell_failure(const cav_stress_trace *e, char *why) {
  static const char *const text[] = {
      [CAV_BAD_INPUT] = "refuses: the inertia matrix is singular to rounding or an option is out of range",
      [CAV_NOT_FINITE] = "refuses: a number is not finite",
      [CAV_NOT_SUPPORTED] = "refuses: not offered for this scene",
      [CAV_INTERNAL] = "reports a defect of its own"};
  if (e->silent)
    add(why, "%s passes a number that is not finite without a word", e->call);
  else
    add(why, "%s %s", e->call, text[e->status] ? text[e->status] : cav_status_name(e->status));
}

// what was seen
static void tell_seen(const cav_bench *b, const cav_stress_trace *e, const cav_stress_point *p, char *why) {
  static const char *const block[] = {"q", "v", "v'"};
  const double seen = p->measure[e->worst], good = cav_stress_measure_rules[e->worst].good;
  switch (e->worst) {
    case CAV_STRESS_ROUND_TRIP:
      add(why, "forward(inverse(v')) misses v' by %.1e (well up to %.0e)", seen, good);
      if (e->dof >= 0) add(why, ", most at joint %s", name_of(b->model, e->dof));
      if (e->another) add(why, "; the same forces lead to both");
      if (seen <= e->rounding_of_u) add(why, "; rounding of the forces that lead there does as much");
      break;
    case CAV_STRESS_DERIVATIVE:
      add(why, "the derivative by %s is %.1e off the difference quotient (well up to %.0e)", block[e->block], seen,
          good);
      break;
    case CAV_STRESS_UNSOLVED:
      add(why, "%d of %d forward steps miss their tolerance", e->unsolved, e->solves);
      if (e->none > 0)
        add(why, ", %d of them because there is no such step: those of shorter ones end before", e->none);
      break;
    case CAV_STRESS_ENERGY:
      if (isfinite(seen))
        add(why, "a passive run gains %.2g of its energy by step %d (well up to %g)", seen, e->step, good);
      else
        add(why, "a passive run is no longer finite by step %d", e->step);
      break;
    case CAV_STRESS_MEASURE_TYPES:
      break;
  }
}

// largest k h^2/m of any motion at the sample: k of the joints' springs, m with what dampers add to it, which is implicit, under
// the order that takes them so; 0 if it cannot be said
static double stiffest_motion(const cav_bench *b) {
  const cav_model *m = b->model;
  const int n = m->nv;
  const double h = b->pushed.timestep;
  double *M = calloc((size_t)n * (size_t)(n + 2), sizeof *M), *k = M + n * n, *x = k + n, most = 0;
  if (!M) return 0;
  int known = cav_inertia(m, b->state, b->q, M) == CAV_OK;
  for (int i = 0; i < n && known; i++) {
    k[i] = m->joint[m->dof[i].joint].stiffness;
    x[i] = 1 + 0.1 * cos(i);
    if (b->pushed.order == CAV_ORDER_EULER) M[i * n + i] += h * m->dof[i].damping;
  }
  known = known && cav_dense_factor(n, n - 1, M, n);
  // powers of L^-1 K L'^-1
  for (int t = 0; t < POWERS && known; t++) {
    double size = 0;
    for (int i = 0; i < n; i++) size += x[i] * x[i];
    if (!(size > 0) || !isfinite(size)) break;
    most = sqrt(size);
    for (int i = 0; i < n; i++) x[i] /= most;
    cav_dense_solve_upper(n, n - 1, M, n, 1, x, n);
    for (int i = 0; i < n; i++) x[i] *= k[i] * h * h;
    cav_dense_solve_lower(n, n - 1, M, n, 1, x, n);
  }
  free(M);
  return known ? most : 0;
}

static int tell_springs(const cav_bench *b, char *why) {
  const char *name = "";
  const double h = b->pushed.timestep, implicit = b->pushed.order == CAV_ORDER_EULER ? h : 0;
  const double alone = b->pushed.passive ? cav_model_stiffest(b->model, implicit, &name) * h * h : 0;
  const double number = alone > 0 ? fmax(alone, stiffest_motion(b)) : 0;
  // what swings by much is met a little before
  if (!(number > 0.95 * SPRING_BOUND)) return 0;
  add(why,
      ": springs, that of %s the stiffest, have k h^2/m = %.3g in their fastest motion; taken where a step begins they "
      "are unstable from %g on, unless constraints hold them",
      *name ? name : "a joint", number, SPRING_BOUND);
  return 1;
}

static int tell_rotation(const cav_bench *b, const cav_stress_trace *e, char *why) {
  if (!(e->rotation > 0.5) || (e->worst == CAV_STRESS_UNSOLVED && b->pushed.order == CAV_ORDER_EULER)) return 0;
  add(why, ": a link rotates by %.2g rad in one step", e->rotation);
  if (b->pushed.order != CAV_ORDER_EULER)
    add(why, "; under this order there need be no such step from about one on, nor one alone");
  return 1;
}

// what is found violated is pushed out within steps
static int tell_push(const cav_bench *b, const cav_stress_trace *e, char *why) {
  const cav_options *o = &b->pushed;
  if (e->worst != CAV_STRESS_ENERGY || e->step > 3 || o->stabilisation != CAV_STABILISATION_DISCRETE) return 0;
  if (!(o->time_constant < 3 * o->timestep)) return 0;
  add(why,
      ": a time constant of %.2g steps pushes out within them what starts violated, %.1e m deep or more at %.2g m/s",
      o->time_constant / o->timestep, b->depth, b->depth / o->timestep);
  return 1;
}

static int tell_rounding(const cav_bench *b, const cav_stress_trace *e, char *why) {
  if (!(e->rounding > 1e-10 * b->size)) return 0;
  add(why, ": so far from the origin positions are rounded to %.1e m, contacts are %.1e m deep", e->rounding, b->depth);
  return 1;
}

// what the end of each range does, where no number above tells more
static const char *const general[CAV_STRESS_SWEEPS][2] = {
    [CAV_STRESS_MASS_RATIO] = {"neighbours differ so much that what the light one needs is lost in the rounding of the "
                               "heavy one",
                               "neighbours differ so much that what the light one needs is lost in the rounding of the "
                               "heavy one"},
    [CAV_STRESS_TIMESTEP] = {"accelerations are differences of velocities over h: their rounding grows as 1/h",
                             "what happens within one step is not seen by it"},
    [CAV_STRESS_STIFFNESS] = {"", "the springs outrun the step"},
    [CAV_STRESS_DAMPING] = {"", "dampers this strong leave velocities below the rounding of forces"},
    [CAV_STRESS_SOLREF] =
        {"constraints are asked to recover faster than a step: stable for h below 0.83 time constants",
         "constraints this slow let bodies sink in"},
    [CAV_STRESS_SOFTNESS] = {"R is so small against A that redundant contacts leave the forward step's matrix nearly "
                             "singular",
                             "constraints this soft let bodies sink in"},
    [CAV_STRESS_TIME_CONSTANT] = {"constraints push out within one step what they find violated",
                                  "constraints this slow let bodies sink in"},
    [CAV_STRESS_SMOOTHING] = {"the law bends within less than differences resolve",
                              "forces act at distances of the size of the scene"},
    [CAV_STRESS_FRICTION] = {"cones this flat leave tangents without force", "cones this wide couple slip and normals"},
    [CAV_STRESS_IMPRATIO] = {"friction this soft lets contacts creep",
                             "friction this stiff leaves the forward step's "
                             "matrix nearly singular"},
    [CAV_STRESS_SIZE] = {"gravity and the file's times do not shrink with the scene: per step it falls by more of its "
                         "own size",
                         "gravity does not grow with the scene, and numbers of unlike size meet"},
    [CAV_STRESS_SPEED] = {"velocities lie below what rounding leaves of the forces that hold the scene",
                          "per step bodies move by more than their own size"},
    [CAV_STRESS_FORCE] = {"", "per step bodies move by more than their own size"},
    [CAV_STRESS_PENETRATION] = {"the law is near its kink, within less than differences resolve",
                                "bodies are pushed out of the ground with energy that was not theirs"},
    [CAV_STRESS_COORDINATES] = {"", "positions lose the digits that contacts need"},
    [CAV_STRESS_QUATERNIONS] = {"squares of their components underflow", "squares of their components overflow"},
};

// whether a value is beyond the bound that the words of a side name
static int is_passed(cav_stress_sweep sweep, int above, double value) {
  if (sweep == CAV_STRESS_SOLREF && !above) return value < 1.02 / 0.83;
  if (sweep == CAV_STRESS_SOFTNESS && !above) return value < 1e-8;
  return 1;
}

static void tell_cause(const cav_bench *b, cav_stress_sweep sweep, const cav_stress_trace *e,
                       const cav_stress_point *here, const cav_stress_point *p, char *why) {
  const int forward = e->worst != CAV_STRESS_DERIVATIVE, above = here && p->value > here->value;
  const double own = here ? here->measure[e->worst] : NAN;
  // what is hardly worse than without the parameter does not come from it
  if (!e->call && own > 0 && isfinite(own) && p->measure[e->worst] < WORSE * own) {
    add(why, "; at the scene's own value it is %.2g already", own);
    return;
  }
  if (tell_rounding(b, e, why)) return;
  if (tell_push(b, e, why)) return;
  if (forward && tell_springs(b, why)) return;
  if (forward && tell_rotation(b, e, why)) return;
  // of a derivative these say nothing
  const char *text = general[sweep][above];
  if (forward && here && *text && is_passed(sweep, above, p->value)) add(why, ": %s", text);
}

void cav_stress_rate(const cav_bench *b, cav_stress_sweep sweep, const cav_stress_point *here,
                     const cav_stress_trace *trace, cav_stress_point *p) {
  cav_stress_trace e = *trace;
  double most = 0;
  p->level = CAV_STRESS_SAFE;
  p->why[0] = 0;
  for (cav_stress_measure i = 0; i < CAV_STRESS_MEASURE_TYPES; i++) {
    const cav_stress_measure_rule *rule = &cav_stress_measure_rules[i];
    if (isnan(p->measure[i]) || p->measure[i] <= rule->good) continue;
    const cav_stress_level level = p->measure[i] >= rule->bad ? CAV_STRESS_BROKEN : CAV_STRESS_DEGRADED;
    if (level > p->level) p->level = level;
    // on the way from well to broken
    const double least = fmax(rule->good, 1e-3 * rule->bad);
    const double way = log(fmax(p->measure[i], least) / least) / log(rule->bad / least);
    if (way >= most) most = way, e.worst = i;
  }
  if (e.call) {
    // refusals are answers, silence is not
    p->level = e.silent ? CAV_STRESS_BROKEN : CAV_STRESS_REFUSED;
    tell_failure(&e, p->why);
    if (!e.silent && e.status == CAV_INTERNAL) p->level = CAV_STRESS_BROKEN;
  } else if (p->level != CAV_STRESS_SAFE) {
    tell_seen(b, &e, p, p->why);
  } else {
    return;
  }
  tell_cause(b, sweep, &e, here, p, p->why);
}
