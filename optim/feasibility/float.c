/// What is asked to stay where nothing holds it.
///
/// A tree that nothing but level planes can hold up, and whose centre of mass is asked to be higher than it can be while
/// anything of it touches them, flies at that knot. Over a run of such knots its centre of mass is a parabola: of knots m
/// steps apart c(k + m) - 2 c(k) + c(k - m) = -g (m h)², whatever its joints do. Where the least that the targets leave of the
/// left side is more than three quarters of the right one, no motion does it. The quarter is for the force across gaps and
/// the momentum that certificates leave unexplained. A point is as high as the centre but for its largest distance from it.
#include <math.h>
#include <stdlib.h>

#include "feasibility.h"

static const double sure = 0.75, slack = 1e-3; // of the fall; m

/// Where the centre of mass of a tree has to be at a knot, and by which requirement it has to be so high.
typedef struct band {
  double low, high;
  const cav_requirement *by;
} band;

/// Bands [nknot] of a tree's centre.
static void find_bands(const cav_examination *e, int root, band *at) {
  const cav_model *m = e->model;
  for (int t = 0; t < e->nknot; t++) at[t] = (band){-INFINITY, INFINITY, NULL};
  for (int i = 0; i < e->n; i++) {
    const cav_requirement *r = &e->requirement[i];
    if (r->kind == CAV_REQUIRE_COORDINATE) continue;
    const int link = r->kind == CAV_REQUIRE_CENTRE ? m->body[r->object].link : r->object;
    // of a whole tree alone the centre is the one that flies
    if (link == 0 || m->link[link].root != root || (r->kind == CAV_REQUIRE_CENTRE && m->link[root].body != r->object))
      continue;
    const double from = r->kind == CAV_REQUIRE_POINT ? cav_distance_to_centre(m, 0, link, r->point) : 0;
    band *b = &at[r->knot];
    if (r->low[2] - from > b->low) b->low = r->low[2] - from, b->by = r;
    b->high = fmin(b->high, r->high[2] + from);
  }
}

/// Tells of a run of knots in the air where a parabola leaves its bands most, if anywhere.
static int run_is_possible(cav_examination *e, const band *at, int first, int last, double reach) {
  const double g = -e->model->gravity[2];
  double h = e->problem->timestep, most = slack, left = 0;
  int middle = -1, arm = 0;
  if (e->problem->duration_least > 0) h *= fmin(1, e->problem->duration_least / e->problem->duration);
  for (int k = first; k <= last; k++)
    for (int m = 1; k - m >= first && k + m <= last; m++) {
      const double least = at[k + m].low + at[k - m].low - 2 * at[k].high, beyond = least + sure * g * m * h * m * h;
      if (beyond > most) most = beyond, left = least, middle = k, arm = m;
    }
  if (middle < 0) return 1;
  char what[160];
  cav_requirement_words(e, at[middle].by, what, sizeof what);
  cav_impossible(
      e, CAV_CONDITION_MOMENTUM, at[middle].by,
      "A shorter window, a lower target, or something to stand on or to hang from.",
      "%s, and so high for %.3g s, where nothing holds it up: its centre of mass is at most %.3g m up while "
      "anything of it touches the ground; in flight it falls by %.3g m from the middle of that time to its ends, "
      "where %.3g m are allowed",
      what, 2 * arm * h, reach, g * arm * h * arm * h / 2, fmax(-left / 2, 0));
  return 0;
}

static void examine_tree(cav_examination *e, int root, band *at) {
  const double reach = cav_ground_reach(e, root);
  if (reach == INFINITY) return;
  find_bands(e, root, at);
  for (int t = 0, first = 0; t <= e->nknot; t++) {
    if (t < e->nknot && at[t].low > reach + slack) continue;
    if (t > first && !run_is_possible(e, at, first, t - 1, reach)) return;
    first = t + 1;
  }
}

cav_status cav_examine_floats(cav_examination *e) {
  const cav_model *m = e->model;
  int bounded = 0;
  if (!cav_flight_is_covered(m)) return CAV_OK;
  double *force = malloc((size_t)(m->nv + 1) * sizeof *force);
  band *at = malloc((size_t)(e->nknot + 1) * sizeof *at);
  cav_status status = force && at ? cav_effort_of_dofs(e, force, &bounded) : CAV_NO_MEMORY;
  for (int i = 1; i < m->nlink && !status && bounded; i++)
    if (m->link[i].parent == 0 && cav_root_floats(e, i, force)) examine_tree(e, i, at);
  free(force), free(at);
  return status;
}
