/// Springs of joints, friction losses and limits of four states side by side, where each acts on coordinates of its
/// own or along a fixed tendon and the law is exact: with the operations and the order of one state (passive.c,
/// limits.c, inverse.c). A row that some state has not leaves its forces as they are.
#include <math.h>

// first of what is written over its numbers: what is below takes four where it would take one
#include "by_four.h"

#include "lanes_law.h"
#include "options.h"
#include "step.h"

// laws of friction losses of dofs and tendons, and of limits of joints and tendons, follow one another
typedef enum kind { DOF_FRICTION, TENDON_FRICTION, JOINT_LIMIT, TENDON_LIMIT } kind;

static cav_row_law *place_of(const cav_model *model, const cav_lanes *l, kind of, int i) {
  const int first[] = {0, model->nv, model->nv + model->ntendon, model->nv + model->ntendon + model->njoint};
  return l->row_law + first[of] + i;
}

static const cav_row_law *law_of(const cav_model *model, const cav_lanes *l, const cav_state *state, kind of, int i,
                                 const cav_softness *softness, double weight) {
  cav_row_law *law = place_of(model, l, of, i);
  if (!law->known) *law = row_law_of(state, softness, weight);
  return law;
}

// whether all of that is known here
static int is_known(const cav_model *model, const cav_state *state) {
  const cav_workspace *w = state->work;
  const cav_options *o = &state->options;
  if (o->smoothing > 0 || o->spring != CAV_SPRING_EXPLICIT || w->ntendon_spring || w->nbuoy || w->nstring) return 0;
  for (int i = 0; i < w->nspring; i++) {
    const cav_joint_type type = model->joint[w->spring[i]].type;
    if (type == CAV_JOINT_FREE || type == CAV_JOINT_BALL) return 0;
  }
  for (int i = 0; i < w->nlimit; i++) {
    if (model->joint[w->limit[i]].type == CAV_JOINT_BALL) return 0;
  }
  return 1;
}

void cav_lanes_prepare(const cav_model *model, cav_lanes *l, const cav_state *state) {
  if (cav_options_same(&state->options, &l->options, CAV_STAGE_VELOCITY)) return;
  l->options = state->options;
  l->rows = is_known(model, state);
  for (int p = 0; p < model->npair; p++) l->law[p].pair = NULL;
  for (int i = 0; i < model->nv + 2 * model->ntendon + model->njoint; i++) l->row_law[i].known = 0;
}

// rate of length of a tendon
CAV_INLINE cav_four tendon_rate(const cav_model *model, const cav_state *state, const cav_tendon *t,
                                const cav_four *v) {
  cav_four sum = CAV_ALL(0);
  for (int e = t->dof; e < t->dof + t->ndof; e++) sum += state->tendon_arm[e] * v[model->tendon_dof[e]];
  return sum;
}

CAV_INLINE void pull_tendon(const cav_model *model, const cav_state *state, const cav_tendon *t, cav_four_masks here,
                            cav_four force, cav_four *u) {
  for (int e = t->dof; e < t->dof + t->ndof; e++) {
    cav_four *to = u + model->tendon_dof[e];
    *to = choose(here, *to + state->tendon_arm[e] * force, *to);
  }
}

CAV_INLINE cav_four friction_impulse(const cav_row_law *law, cav_four now, cav_four next, double bound) {
  cav_four R, stiffness;
  law_at(law, CAV_ALL(0), &R, &stiffness);
  const cav_four g = ((1 - law->damping) * now - next) / R;
  return choose(g > bound, CAV_ALL(bound), choose(g < -bound, CAV_ALL(-bound), g));
}

CAV_INLINE cav_four limit_impulse(const cav_row_law *law, cav_four distance, cav_four now, cav_four next) {
  cav_four R, stiffness;
  law_at(law, distance, &R, &stiffness);
  const cav_four g = ((1 - law->damping) * now - stiffness * distance - next) / R;
  return choose(g <= 0, CAV_ALL(0), g);
}

CAV_BY_FOUR static void add_springs(const cav_model *model, const cav_workspace *w, cav_lanes *l) {
  for (int i = 0; i < w->nspring; i++) {
    const cav_joint *joint = &model->joint[w->spring[i]];
    l->u[joint->dof] += joint->stiffness * (l->q[joint->q] - joint->springref);
  }
}

CAV_BY_FOUR static void add_friction(const cav_model *model, const cav_state *state, cav_lanes *l, double scale) {
  const cav_workspace *w = state->work;
  const double h = state->options.timestep;
  const cav_four_masks all = CAV_ALL(0) == CAV_ALL(0);
  for (int i = 0; i < w->nfriction; i++) {
    const int k = w->friction[i];
    const cav_dof *dof = &model->dof[k];
    const cav_row_law *law = law_of(model, l, state, DOF_FRICTION, i, &dof->friction, dof->inverse_weight);
    l->u[k] += scale * friction_impulse(law, l->v[k], l->v_next[k], h * dof->frictionloss);
  }
  for (int i = 0; i < w->ntendon_friction; i++) {
    const cav_tendon *t = &model->tendon[w->tendon_friction[i]];
    const cav_row_law *law = law_of(model, l, state, TENDON_FRICTION, i, &t->friction, t->inverse_weight);
    const cav_four f = friction_impulse(law, tendon_rate(model, state, t, l->v),
                                        tendon_rate(model, state, t, l->v_next), h * t->frictionloss);
    pull_tendon(model, state, t, all, scale * f, l->u);
  }
}

CAV_BY_FOUR static void add_limits(const cav_model *model, const cav_state *state, cav_lanes *l, double scale) {
  const cav_workspace *w = state->work;
  const double beyond = cav_limit_activation(state, 0);
  for (int n = 0; n < l->nbounded; n++) {
    const int i = l->bounded[n] / CAV_LANE_BITS;
    const cav_joint *joint = &model->joint[w->limit[i]];
    const cav_row_law *law =
        law_of(model, l, state, JOINT_LIMIT, i, &joint->limit, model->dof[joint->dof].inverse_weight);
    for (int side = 0; side < 2; side++) {
      const cav_four at = l->q[joint->q], dist = side ? joint->range[1] - at : at - joint->range[0];
      const cav_four_masks here = dist < joint->margin + beyond;
      if (!any(here)) continue;
      const double axis = side ? -1 : 1;
      const cav_four f =
          limit_impulse(law, dist - joint->margin, axis * l->v[joint->dof], axis * l->v_next[joint->dof]);
      cav_four *to = &l->u[joint->dof];
      *to = choose(here, *to + axis * (scale * f), *to);
    }
  }
  for (int i = 0; i < w->ntendon_limit; i++) {
    const cav_tendon *t = &model->tendon[w->tendon_limit[i]];
    cav_four length = CAV_ALL(0);
    for (int k = t->part; k < t->part + t->npart; k++)
      length += model->tendon_part[k].coef * l->q[model->joint[model->tendon_part[k].joint].q];
    for (int side = 0; side < 2; side++) {
      const cav_four dist = side ? t->range[1] - length : length - t->range[0];
      const cav_four_masks here = dist < cav_limit_activation(state, t->margin);
      if (!any(here)) continue;
      const double axis = side ? -1 : 1;
      const cav_row_law *law = law_of(model, l, state, TENDON_LIMIT, i, &t->limit, t->inverse_weight);
      const cav_four f = limit_impulse(law, dist - t->margin, axis * tendon_rate(model, state, t, l->v),
                                       axis * tendon_rate(model, state, t, l->v_next));
      pull_tendon(model, state, t, here, axis * (scale * f), l->u);
    }
  }
}

void cav_lanes_rows(const cav_model *model, cav_lanes *l, const cav_state *state) {
  const double scale = -1 / state->options.timestep;
  if (state->options.passive) add_springs(model, state->work, l);
  if (!state->options.constraint) return;
  add_friction(model, state, l, scale);
  add_limits(model, state, l, scale);
}
