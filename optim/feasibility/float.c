/// Where nothing can be touched: what is asked to stay up there floats.
///
/// While something of a tree touches level planes, and nothing else can hold it up, its centre of mass is at most so
/// high (takeoff.c). Where it has to be higher at every knot of a window, it is in free flight there, and the second
/// difference of its heights is that of a parabola:
///   z(k + m) - 2 z(k) + z(k - m) = -g (m h)^2 (1 + d),   which is no less than   low(k + m) + low(k - m) - 2 high(k),
/// for z within [low, high] of what is required. So over T = 2 m h it curves by g T^2/8, whatever joints do. d is what
/// a certificate leaves open, each counted at its worst:
/// - momentum: of all knots and components (6 at most) CAV_TOLERANCE_MOMENTUM of the weight of the whole model, root
///   mean square. With the weights m - |j| of a second difference, by Cauchy and Schwarz,
///   CAV_TOLERANCE_MOMENTUM sqrt(6 N sum (m - |j|)^2) h^2 g, the sum m (2 m^2 + 1)/3;
/// - contacts that bear across gaps: the law knows none beyond its activation distance (dynamics/METHOD.md, 3). Below
///   that CAV_TOLERANCE_HOVER of all contact force over the motion, which counts as twice the weight on average (what
///   links press each other with beyond that is left out), all of it at the knot where it lifts most, m h v;
/// - a step is h times the velocity in its middle but for h^3/24 of the third derivative of the centre of mass on the
///   way of a step: a root's own point goes straight, the centre turns about it at a distance r at 20 rad/s at most.
/// The duration may be any of those allowed. What is required of a point is so of the centre of mass within their
/// largest distance.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/solve.h"
#include "feasibility.h"

static const double clear = 1e-3;      // m: rounding, what limits give way, as of distances
static const double turn = 20;         // rad/s
static const double presses = 2;       // weights, all contacts on average
static const double approach = 5;      // m/s: a law looks at contacts that an approach as fast closes in a step
static const double tail = 12;         // smoothing distances that a law looks beyond that
enum { COMPONENTS = 6, MOST_M = 512 }; // MOST_M: steps to either side

/// What is required of the height of the centre of mass at each knot.
typedef struct heights {
  int root;
  double *low, *high;             ///< [nknot] m
  const cav_requirement **reason; ///< [nknot] of low, NULL: none
  double support;                 ///< highest of the centre while something touches, m; -infinite: it never does
  double arm;                     ///< of the centre about the point of the root that goes straight, m
  double part;                    ///< mass of all that moves over that of the tree
} heights;

/// Three knots m steps apart, what flight curves between them at least and what is required leaves it at most.
typedef struct gap {
  int middle, m;
  double curve, allowed; ///< m, of second differences
} gap;

/// Takes a requirement into the knots that it holds for: of long windows every few knots are collected, and a constant
/// target is the same between them.
static void require(const cav_examination *e, heights *z, const cav_requirement *r, double below) {
  const cav_term *term = &e->problem->term[r->term];
  int first, last, stride = term->nwaypoint == 0 ? cav_requirement_stride(e) : 1;
  cav_requirement_window(e, term, &first, &last);
  for (int k = r->knot; k < r->knot + stride && k <= last && k < e->nknot; k++) {
    if (r->low[2] - below > z->low[k]) z->low[k] = r->low[2] - below, z->reason[k] = r;
    z->high[k] = fmin(z->high[k], r->high[2] + below);
  }
}

static void collect(const cav_examination *e, heights *z) {
  const cav_model *m = e->model;
  const cav_requirement *of = NULL; // that below is of
  double below = 0;
  for (int k = 0; k < e->nknot; k++) z->low[k] = -INFINITY, z->high[k] = INFINITY, z->reason[k] = NULL;
  for (int i = 0; i < e->n; i++) {
    const cav_requirement *r = &e->requirement[i];
    if (r->kind == CAV_REQUIRE_COORDINATE) continue;
    int link = r->kind == CAV_REQUIRE_CENTRE ? m->body[r->object].link : r->object;
    if (link == 0 || m->link[link].root != z->root) continue;
    // of a whole tree alone the centre is the one that flies
    if (r->kind == CAV_REQUIRE_CENTRE && m->link[z->root].body != r->object) continue;
    if (isinf(r->low[2]) && isinf(r->high[2])) continue;
    // a window asks for one point over and over
    int same = of && of->kind == r->kind && of->object == r->object && !memcmp(of->point, r->point, sizeof r->point);
    if (!same) below = r->kind == CAV_REQUIRE_POINT ? cav_distance_to_centre(m, 0, r->object, r->point) : 0;
    of = r;
    if (isfinite(below)) require(e, z, r, below);
  }
}

/// Largest distance of the centre of mass from the point of the root that goes straight: the origin of a free joint, or
/// the anchor of its hinges.
static double arm_of(const cav_model *m, int root) {
  static const double origin[3] = {0};
  double arm = -1;
  for (int j = m->link[root].joint; j < m->link[root].joint + m->link[root].njoint; j++)
    if (m->joint[j].type == CAV_JOINT_HINGE || m->joint[j].type == CAV_JOINT_BALL)
      arm = fmax(arm, cav_distance_to_centre(m, 0, root, m->joint[j].pos));
  return arm < 0 ? cav_distance_to_centre(m, 0, root, origin) : arm;
}

/// Least curve of m steps of h to either side, m; lowest: least height required over the window.
static double curve_at(const cav_examination *e, const heights *z, int m, double h, double lowest) {
  double g = -e->model->gravity[2], n = e->nknot + 1, steps = m;
  double momentum = CAV_TOLERANCE_MOMENTUM * z->part * sqrt(COMPONENTS * n * steps * (2 * steps * steps + 1) / 3);
  double looks = tail * e->problem->schedule.last.smoothing + approach * h;
  double lift = lowest > z->support + looks ? 0 : CAV_TOLERANCE_HOVER * presses * z->part * n * steps;
  double straight = 2 * steps * h * h * h * turn * turn * turn * z->arm / 24;
  return g * h * h * (steps * steps - momentum - lift) - straight;
}

/// The same of the shortest and the longest step: a h^2 - b h^3 is least at an end.
static double least_curve(const cav_examination *e, const heights *z, int m, double lowest) {
  const cav_problem *p = e->problem;
  double shorter = p->duration_least > 0 ? fmin(p->duration_least / p->duration, 1) : 1, h = p->timestep;
  return fmin(curve_at(e, z, m, h * shorter, lowest), curve_at(e, z, m, h * fmax(e->longest, 1), lowest));
}

/// Three knots of a window [first, last] of flight between which what is required curves least for what it has to.
static void look(const cav_examination *e, const heights *z, int first, int last, gap *worst) {
  double lowest = INFINITY;
  for (int k = first; k <= last; k++) lowest = fmin(lowest, z->low[k]);
  int most = (last - first) / 2;
  for (int m = 1; m <= most && m <= MOST_M; m++) {
    double curve = least_curve(e, z, m, lowest);
    for (int k = first + m; k + m <= last && curve > 0; k++) {
      double allowed = fmax(2 * z->high[k] - z->low[k - m] - z->low[k + m], 0);
      if (curve - allowed > fmax(worst->curve - worst->allowed, clear)) *worst = (gap){k, m, curve, allowed};
    }
  }
}

static void tell(cav_examination *e, const heights *z, const gap *w) {
  char what[160], touch[100] = "there is nothing that it may touch";
  cav_requirement r = *z->reason[w->middle - w->m];
  double h = e->problem->timestep, time = 2 * w->m * h;
  r.knot = w->middle - w->m;
  cav_requirement_words(e, &r, what, sizeof what);
  if (isfinite(z->support))
    snprintf(touch, sizeof touch, "its centre of mass is at most at z %.3g while anything of it touches the ground",
             z->support);
  cav_impossible(
      e, CAV_CONDITION_MOMENTUM, &r, "A shorter window, a lower target, or something to stand on or to hang from.",
      "%s, and on to %.4g s, but nothing can hold it up there: %s. In flight its way curves by %.3g m in %.3g s (by "
      "%.3g m with all that certificates overlook), and %.3g m is allowed",
      what, (w->middle + w->m) * h, touch, -e->model->gravity[2] * time * time / 8, time, w->curve / 2, w->allowed / 2);
}

static void examine_one(cav_examination *e, heights *z) {
  const cav_model *m = e->model;
  double mass = 0;
  if (!cav_tree_is_open(e, z->root, 2) || !cav_ground_survey(e, z->root, &z->support, NULL)) return;
  for (int i = 1; i < m->nlink; i++) mass += m->link[i].root == z->root ? m->link[i].mass : 0;
  z->arm = arm_of(m, z->root);
  z->part = m->mass / mass;
  if (!(mass > 0) || !isfinite(z->arm)) return;
  gap worst = {0};
  collect(e, z);
  for (int k = 0, from = -1; k <= e->nknot; k++) {
    int flies = k < e->nknot && z->low[k] > z->support + CAV_HOVER_GAP + clear;
    if (flies && from < 0) from = k;
    if (flies || from < 0) continue;
    look(e, z, from, k - 1, &worst);
    from = -1;
  }
  if (worst.m > 0) tell(e, z, &worst);
}

cav_status cav_examine_floats(cav_examination *e) {
  const cav_model *m = e->model;
  if (e->n == 0 || !cav_weight_is_all(m)) return CAV_OK;
  size_t n = (size_t)e->nknot;
  double *height = malloc(2 * n * sizeof *height);
  const cav_requirement **reason = malloc(n * sizeof *reason);
  cav_status status = height && reason ? CAV_OK : CAV_NO_MEMORY;
  int before = e->nfound;
  for (int i = 1; i < m->nlink && !status && e->nfound == before; i++) {
    heights z = {.root = i, .low = height, .high = height + n, .reason = reason};
    if (m->link[i].parent == 0) examine_one(e, &z);
  }
  free(height);
  free(reason);
  return status;
}
