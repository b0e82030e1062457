/// Derivatives of the inverse in closed form: du/dq, du/dv, du/dv_next at the state's last evaluation (METHOD.md, 7).
/// With the pair of dofs (k, j) of which m is the deeper one, every term of the smooth part is S_k . (sum over the
/// subtree of m) of something linear in dof j: as in Carpentier and Mansard (RSS 2018) and Singh, Russell and Wensing
/// (2022), but derived and written for spatial vectors at one point of the tree:
///
///   du_k/da_j = S_k . I S_j                          I  composite inertia
///   du_k/dv_j = S_k . (I (D + D*) + B S_j)           D  = V_before x S_j,  D* = V_after x S_j
///   du_k/dq_j = S_k . (I E + B D [+ S_j x F])        E  = A_before x S_j + V_before x D,  F wrench of the subtree
///
/// [..] only where j does not move k. B is the change of a body's wrench by a twist of its motion, (V x I V with one V
/// replaced, both ways) - I (V x .): about the centre of mass it depends on the angular part alone, the moment by
/// -2 [w](tr(J)/2 - J), the force by -2 m [v]; so twelve numbers a subtree do.
///
/// Contacts with the world are three more matrices of 6 x 6 at their link, summed over subtrees like inertia: the cost
/// of a contact does not depend on the depth of the tree. Contacts between two moving links add the two blocks across.
/// Limits, friction losses, springs and dampers act on few dofs and are added entry by entry. The sums and products are
/// smooth.c's and contact_sum.c's, the entries passive.c's, row.c's and equality.c's; here is the order of them.
///
/// For the order momentum the rows of root links are those of half_step.c instead.
///
/// Not offered: models with parts listed by cav_derivatives_missing; nothing is approximated in their place.
#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "analytic.h"
#include "half_step.h"

enum { ALIGN = 8 };

/// Lists the paths, one for each dof that moves no other, and those of all dofs: of [nv]; their number, the longest's length.
static int list_paths(const cav_model *model, int *of, int *longest) {
  int n = 0;
  *longest = 0;
  for (int i = 0; i < model->nv; i++) of[i] = -1;
  for (int i = model->nv - 1; i >= 0; i--) {
    int length = 0;
    if (of[i] < 0) of[i] = n++;
    for (int k = i; k >= 0; k = model->dof[k].parent, length++) of[k] = of[i];
    if (length > *longest) *longest = length;
  }
  return n;
}

static cav_derivative_store *derivatives_new(const cav_model *model, int bias) {
  cav_derivative_store *s = calloc(1, sizeof *s);
  if (!s) return NULL;
  size_t nv = (size_t)model->nv, n = (size_t)model->nlink;
  int longest, *of = malloc((nv + 1) * sizeof *of);
  if (!of) {
    free(s);
    return NULL;
  }
  const size_t paths = (size_t)list_paths(model, of, &longest), stride = ((size_t)longest + 3) / 4 * 4;
  const size_t biases = bias ? 12 * nv : 0, ints = n + 3 * nv + paths * stride + 1;
  size_t doubles = 5 * 6 * nv + (12 + 3 * CAV_TWIST_BLOCK) * n + 12 * nv + nv * nv;
  doubles += (CAV_DOF_COMPONENTS * paths + CAV_PATH_ROWS) * stride + biases;
  s->drift = calloc(doubles + ALIGN, sizeof(double));
  s->touched = calloc(ints, sizeof(int));
  if (!s->drift || !s->touched) {
    free(of);
    cav_derivative_store_free(s);
    return NULL;
  }
  s->dof = s->touched + n + 1;
  s->depth = s->dof + nv;
  for (int i = 0; i < model->nv; i++) s->depth[i] = model->dof[i].parent < 0 ? 0 : s->depth[model->dof[i].parent] + 1;
  s->path.of = s->depth + nv;
  memcpy(s->path.of, of, nv * sizeof *of);
  free(of);
  s->path.dofs = s->path.dof = s->path.of + nv;
  s->path.stride = (int)stride;
  s->path.n = (int)paths;
  s->drift_now = s->drift + 6 * nv;
  s->drift_next = s->drift_now + 6 * nv;
  s->second = s->drift_next + 6 * nv;
  s->rate = s->second + 6 * nv;
  s->gyration = s->rate + 6 * nv;
  s->by_motion = s->gyration + 12 * n;
  s->by_now = s->by_motion + CAV_TWIST_BLOCK * n;
  s->by_next = s->by_now + CAV_TWIST_BLOCK * n;
  s->across = s->by_next + CAV_TWIST_BLOCK * n;
  s->spare = s->across + 12 * nv;
  s->path.all = s->path.at = s->spare + nv * nv;
  s->entry = s->path.all + CAV_DOF_COMPONENTS * paths * stride;
  s->bias_second = bias ? s->entry + CAV_PATH_ROWS * stride : NULL;
  s->bias_rate = bias ? s->bias_second + 6 * nv : NULL;
  assert(s->entry + CAV_PATH_ROWS * stride + biases == s->drift + doubles);
  s->bytes = sizeof *s + (doubles + ALIGN) * sizeof(double) + ints * sizeof(int);
  return s;
}

static cav_derivative_store *store_ready(const cav_model *model, cav_state *state) {
  cav_workspace *w = state->work;
  if (!w->derivatives) w->derivatives = derivatives_new(model, w->bias != NULL);
  cav_derivative_store *s = w->derivatives;
  if (s && state->ncontact > s->room) {
    cav_contact_jacobian *larger = realloc(s->contact, (size_t)w->contact_room * sizeof *larger);
    if (!larger) return NULL;
    s->contact = larger;
    s->room = w->contact_room;
  }
  return s;
}

// whatever adds to u and is not differentiated is named here
const char *cav_derivatives_missing(const cav_model *model) {
  for (int i = 0; i < model->nequality; i++) {
    const cav_equality *e = &model->equality[i];
    if (e->type == CAV_EQUALITY_DISTANCE) return "equality constraints on distances";
    for (int k = 0; k < 2 && e->type == CAV_EQUALITY_TENDON && e->object[k] >= 0; k++) {
      if (model->tendon[e->object[k]].npath > 0) return "equality constraints on spatial tendons";
    }
  }
  if (model->density > 0 || model->viscosity > 0) return "forces of a medium";
  for (int i = 0; i < model->njoint; i++) {
    if (model->joint[i].twist_limited || model->joint[i].swing_limited) return "twist and swing limits of ball joints";
  }
  for (int i = 0; i < model->ntendon; i++) {
    const cav_tendon *tendon = &model->tendon[i];
    int acts = tendon->limited || tendon->stiffness != 0 || tendon->damping != 0 || tendon->frictionloss > 0;
    if (tendon->npath > 0 && acts) return "limits, springs or friction of spatial tendons";
  }
  return NULL;
}

cav_status cav_derivatives(const cav_model *model, cav_state *state, double *du_dq, double *du_dv, double *du_dv_next) {
  if (!cav_state_evaluated(state)) return CAV_BAD_INPUT;
  if (cav_derivatives_missing(model)) return CAV_NOT_SUPPORTED;
  // laws that hang on all rows together
  if (state->options.regulariser == CAV_REGULARISER_EXACT || state->options.coupled) return CAV_NOT_SUPPORTED;
  cav_derivative_store *s = store_ready(model, state);
  if (!s) return CAV_NO_MEMORY;
  int nv = model->nv;
  cav_derivative_task t = {.model = model,
                           .state = state,
                           .s = s,
                           .nv = nv,
                           .mean = cav_takes_mean(state),
                           .momentum = state->options.order == CAV_ORDER_MOMENTUM,
                           .inverse_h = 1 / state->options.timestep};
  state->work->derived = 0;
  cav_derivative_drifts(&t);
  cav_derivative_contacts(&t);
  if (cav_looks_ahead(&state->options)) cav_next_contacts_differentiate(model, state);
  state->work->derived = 1;
  if (!du_dq && !du_dv && !du_dv_next) return CAV_OK;

  // composites, then pairs of dofs one of which moves the other
  t.dq = du_dq ? du_dq : s->spare;
  t.dv = du_dv ? du_dv : s->spare;
  t.dn = du_dv_next ? du_dv_next : s->spare;
  double *out[3] = {t.dq, t.dv, t.dn};
  for (int k = 0; k < 3; k++) memset(out[k], 0, (size_t)nv * (size_t)nv * sizeof(double));
  cav_composites(model, state);
  cav_derivative_gyrations(&t);
  if (t.momentum) cav_half_steps_derivatives(model, state);
  for (int j = 0; j < nv; j++) {
    cav_derivative_pairs(&t, j);
    if (t.momentum) cav_half_steps_column(model, state, j, t.dq, t.dv, t.dn);
  }
  cav_derivative_across(&t);
  if (cav_looks_ahead(&state->options)) cav_derivative_next_contacts(&t);

  // what acts on dofs
  cav_derivative_passive(&t);
  if (state->nequality > 0) cav_equality_derivatives(model, state, t.dq, t.dv, t.dn);
  return cav_derivative_rows(&t);
}
