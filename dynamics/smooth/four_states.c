/// The passes of tree.h over four states at once. An entry of a vector sees what a double would, so each state gets the bits
/// of its own single evaluation, whatever stands beside it.
#include "four_states.h"

#include <math.h>
#include <stdlib.h>

#include "four_turn.h"
#define CAV_POSE cav_lane_pose
#include "tree.h"

enum { ALIGNMENT = 64 };

// next array of a block, or only its size while base is NULL
static cav_four *carve(char *base, size_t *used, int n) {
  cav_four *piece = base ? (cav_four *)(base + *used) : NULL;
  *used += ((size_t)n * sizeof(cav_four) + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
  return piece;
}

static size_t layout(const cav_model *m, char *base, cav_lanes *l) {
  size_t used = ALIGNMENT * ((sizeof *l + ALIGNMENT - 1) / ALIGNMENT);
  int n = m->nlink;
  l->q = carve(base, &used, m->nq);
  l->half = carve(base, &used, m->njoint);
  l->sine = carve(base, &used, m->njoint);
  l->cosine = carve(base, &used, m->njoint);
  l->link = (cav_lane_pose *)carve(base, &used, n * (int)(sizeof(cav_pose) / sizeof(double)));
  l->com = carve(base, &used, 3 * n);
  l->inertia = carve(base, &used, 6 * n);
  l->reference = carve(base, &used, 3 * n);
  l->axis = carve(base, &used, 6 * m->nv);
  l->v = carve(base, &used, m->nv);
  l->v_next = carve(base, &used, m->nv);
  l->bias = carve(base, &used, m->nv);
  l->a = carve(base, &used, m->nv);
  l->velocity = carve(base, &used, 6 * n);
  l->velocity_next = carve(base, &used, 6 * n);
  l->acceleration = carve(base, &used, 6 * n);
  l->force = carve(base, &used, 6 * n);
  l->u = carve(base, &used, m->nv);
  l->centre = carve(base, &used, 3 * m->ngeom);
  l->near = (int *)carve(base, &used, m->npair / (int)(sizeof(cav_four) / sizeof(int)) + 1);
  l->law = (cav_pair_law *)carve(base, &used, m->npair * (int)(sizeof(cav_pair_law) / sizeof(cav_four) + 1));
  l->row_law = (cav_row_law *)carve(
      base, &used, (m->nv + 2 * m->ntendon + m->njoint) * (int)(sizeof(cav_row_law) / sizeof(cav_four) + 1));
  l->bounded = (int *)carve(base, &used, m->njoint / (int)(sizeof(cav_four) / sizeof(int)) + 1);
  return used;
}

cav_lanes *cav_lanes_new(const cav_model *model) {
  cav_lanes probe;
  size_t bytes = layout(model, NULL, &probe);
  char *block = aligned_alloc(ALIGNMENT, bytes);
  if (!block) return NULL;
  memset(block, 0, bytes);
  cav_lanes *lanes = (cav_lanes *)block;
  layout(model, block, lanes);
  // the world's frame; written as doubles, on whatever processor
  cav_lane_pose *world = lanes->link;
  for (int lane = 0; lane < CAV_LANES; lane++) {
    world->quat[0][lane] = 1;
    for (int k = 0; k < 3; k++) world->rotation[4 * k][lane] = 1;
  }
  return lanes;
}

void cav_lanes_free(cav_lanes *lanes) { free(lanes); }

CAV_BY_FOUR void cav_lanes_gather(cav_four *to, const double *const from[CAV_LANES], int n) {
  const double *a = from[0], *b = from[1], *c = from[2], *d = from[3];
  int i = 0;
  for (; i + 4 <= n; i += 4) turn_in((const double *const[]){a + i, b + i, c + i, d + i}, to + i);
  for (; i < n; i++) to[i] = (cav_four){a[i], b[i], c[i], d[i]};
}

CAV_BY_FOUR void cav_lanes_scatter(double *const to[CAV_LANES], const cav_four *from, int n) {
  double *a = to[0], *b = to[1], *c = to[2], *d = to[3];
  int i = 0;
  for (; i + 4 <= n; i += 4) turn_out(from + i, (double *const[]){a + i, b + i, c + i, d + i});
  for (; i < n; i++) a[i] = from[i][0], b[i] = from[i][1], c[i] = from[i][2], d[i] = from[i][3];
}

CAV_BY_FOUR int cav_lanes_finite(const cav_four *x, int n) {
  cav_four a = {0, 0, 0, 0}, b = a;
  int i = 0;
  for (; i + 1 < n; i += 2) a += 0 * x[i], b += 0 * x[i + 1];
  if (i < n) a += 0 * x[i];
  return held_bits(a + b == 0);
}

// sines and cosines of half the turns of all hinges; whether an angle is too large for those sums
CAV_BY_FOUR static int turn_hinges(const cav_workspace *w, cav_lanes *l) {
  typedef long long masks __attribute__((vector_size(sizeof(cav_four))));
  masks far = {0};
  for (int i = 0; i < w->nhinge; i++) {
    l->half[i] = 0.5 * (l->q[w->hinge[i]] - w->hinge_ref[i]);
    far |= (l->half[i] >= SINES_MOST) | (l->half[i] <= -SINES_MOST);
  }
  const double *half = (const double *)l->half;
  double *sine = (double *)l->sine, *cosine = (double *)l->cosine;
  const int n = CAV_LANES * w->nhinge, any = (far[0] | far[1] | far[2] | far[3]) != 0;
  if (!any) sines(half, sine, cosine, n);
  for (int i = 0; i < n && any; i++)
    if (fabs(half[i]) < SINES_MOST) sines(half + i, sine + i, cosine + i, 1);
  return any;
}

// a state with such an angle has all its sines from the library, as it has alone
static void turn_far(const cav_workspace *w, cav_lanes *l) {
  for (int lane = 0; lane < CAV_LANES; lane++) {
    double largest = 0;
    for (int i = 0; i < w->nhinge; i++) largest = fmax(largest, fabs(l->half[i][lane]));
    for (int i = 0; i < w->nhinge && !(largest < SINES_MOST); i++) {
      l->sine[i][lane] = sin(l->half[i][lane]);
      l->cosine[i][lane] = cos(l->half[i][lane]);
    }
  }
}

CAV_BY_FOUR static void place(const cav_model *model, const cav_workspace *w, cav_lanes *l) {
  const tree_poses at = {l->q, l->sine, l->cosine, l->link, l->com, l->inertia, l->reference, l->axis, 0};
  for (int i = 1; i < model->nlink; i++) place_link(model, w, &at, i);
}

// an array of each of four states
#define OF_EACH(array) \
  { (state[0]->array), (state[1]->array), (state[2]->array), (state[3]->array) }

void cav_lanes_kinematics(const cav_model *model, cav_lanes *l, cav_state *const state[CAV_LANES], cav_extent extent) {
  cav_workspace *w = state[0]->work;
  const int n = model->nlink;
  for (int lane = 0; lane < CAV_LANES; lane++) cav_kinematics_open(state[lane]);
  cav_lanes_gather(l->q, (const double *const[])OF_EACH(work->q), model->nq);
  if (turn_hinges(w, l)) turn_far(w, l);
  place(model, w, l);
  if (extent != CAV_EXTENT_NONE) {
    cav_lanes_scatter((double *const[])OF_EACH(link[0].pos), (const cav_four *)l->link,
                      n * (int)(sizeof(cav_pose) / sizeof(double)));
    cav_lanes_scatter((double *const[])OF_EACH(reference), l->reference, 3 * n);
  }
  if (extent == CAV_EXTENT_ALL) {
    cav_lanes_scatter((double *const[])OF_EACH(com), l->com, 3 * n);
    cav_lanes_scatter((double *const[])OF_EACH(inertia), l->inertia, 6 * n);
  }
  // velocities that contacts begin with are not those of the bias
  if (extent == CAV_EXTENT_ALL || (extent == CAV_EXTENT_CONTACTS && cav_takes_mean(state[0])))
    cav_lanes_scatter((double *const[])OF_EACH(axis), l->axis, 6 * model->nv);
  for (int lane = 0; lane < CAV_LANES && extent != CAV_EXTENT_NONE; lane++) cav_kinematics_close(model, state[lane]);
}

CAV_BY_FOUR static void move(const cav_model *model, const cav_state *state, cav_lanes *l) {
  const tree_motion m = {l->com, l->inertia,  l->reference,     l->axis,         l->bias, l->v_next,
                         l->a,   l->velocity, l->velocity_next, l->acceleration, l->force};
  find_motion(model->nv, cav_takes_mean(state), 1 / state->options.timestep, l->v, l->v_next, l->bias, l->a);
  move_tree(model, state->work, state->options.gravity ? -1 : 0, &m);
}

void cav_lanes_newton_euler(const cav_model *model, cav_lanes *l, cav_state *const state[CAV_LANES], int pushed) {
  const int n = 6 * model->nlink;
  move(model, state[0], l);
  if (!pushed) return;
  cav_lanes_scatter((double *const[])OF_EACH(velocity), l->velocity, n);
  cav_lanes_scatter((double *const[])OF_EACH(velocity_next), l->velocity_next, n);
  cav_lanes_scatter((double *const[])OF_EACH(work->acceleration), l->acceleration, n);
  cav_lanes_scatter((double *const[])OF_EACH(force), l->force, n);
}

CAV_BY_FOUR const cav_four *cav_lanes_velocities(const cav_model *model, cav_lanes *l) {
  cav_four *velocity = l->acceleration;
  memset(velocity, 0, 6 * sizeof *velocity);
  for (int i = 1; i < model->nlink; i++) {
    const cav_link *link = &model->link[i];
    cav_four V[6];
    copy6(V, velocity + 6 * link->parent);
    for (int k = link->dof; k < link->dof + link->ndof; k++) axpy6(V, V, l->v[k], l->axis + 6 * k);
    copy6(velocity + 6 * i, V);
  }
  return velocity;
}

CAV_BY_FOUR static void project(const cav_model *model, const cav_state *state, cav_lanes *l) {
  project_tree(model, l->axis, l->force, l->u);
  resist(state->work, model->nv, state->options.passive, cav_takes_mean(state) ? l->bias : l->v_next, l->a, l->u);
}

void cav_lanes_project(const cav_model *model, cav_lanes *l, cav_state *const state[CAV_LANES], int pushed,
                       double *const u[CAV_LANES]) {
  if (pushed) cav_lanes_gather(l->force, (const double *const[])OF_EACH(force), 6 * model->nlink);
  project(model, state[0], l);
  if (u) cav_lanes_scatter(u, l->u, model->nv);
}
