/// Sizes of a model's links as unknowns of a fit: factors by which links are scaled (dynamics/model/resize.c), how points
/// move with them, and postures that stand as before.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "edit.h"
#include "extent.h"
#include "fit.h"
#include "math3.h"
#include "periodicity.h"
#include "role.h"

void cav_fit_sizes_free(cav_fit_sizes *sizes) {
  free(sizes->kept), free(sizes->group), free(sizes->factor), free(sizes->error);
  *sizes = (cav_fit_sizes){0};
}

// the link on the other side, by the names of first joints; itself: none
static int other_side(const cav_model *m, int link) {
  int joint = cav_joint_other_side(m, m->link[link].joint);
  return joint < 0 ? link : m->joint[joint].link;
}

cav_status cav_fit_sizes_new(cav_fit_sizes *sizes, cav_model *m, int symmetric, cav_error *error) {
  size_t n = (size_t)m->nlink;
  cav_status status = cav_model_resizable(m, error);
  *sizes = (cav_fit_sizes){.model = m};
  if (status) return status;
  sizes->kept = cav_model_keep(m);
  sizes->group = malloc(n * sizeof *sizes->group);
  sizes->factor = malloc(n * sizeof *sizes->factor), sizes->error = calloc(n, sizeof *sizes->error);
  if (!sizes->kept || !sizes->group || !sizes->factor || !sizes->error) return CAV_NO_MEMORY;
  sizes->group[0] = -1, sizes->factor[0] = 1;
  for (int i = 1; i < m->nlink; i++) {
    int other = symmetric ? other_side(m, i) : i;
    sizes->group[i] = other < i && other_side(m, other) == i ? sizes->group[other] : sizes->ngroup++;
    sizes->factor[i] = 1;
  }
  return CAV_OK;
}

cav_status cav_fit_sizes_set(cav_fit_sizes *sizes, const double *logarithm) {
  cav_model_return(sizes->model, sizes->kept);
  for (int i = 1; i < sizes->model->nlink; i++) sizes->factor[i] = exp(logarithm[sizes->group[i]]);
  return cav_model_resize(sizes->model, sizes->factor);
}

// where the parent holds a link: the anchor of its first joint, or the place of a free one. How far slides have taken the
// link from there does not scale
static void hold(const cav_model *m, const cav_state *state, const double *q, int i, double at[3], double slid[3]) {
  const cav_link *link = &m->link[i];
  const cav_joint *first = &m->joint[link->joint];
  double anchor[3], up[3];
  cav_pose pose;
  zero3(slid);
  if (first->type == CAV_JOINT_FREE) {
    copy3(at, q + first->q);
    return;
  }
  cav_object_pose(m, state, CAV_OBJECT_XBODY, m->link[link->parent].body, &pose);
  quat_rotate(anchor, link->quat, first->pos);
  add3(anchor, anchor, link->pos);
  transform(at, pose.pos, pose.rotation, anchor);
  for (int j = link->joint; j < link->joint + link->njoint; j++) {
    if (m->joint[j].type != CAV_JOINT_SLIDE) continue;
    velocity_at(up, state->axis + 6 * m->joint[j].dof, state->reference + 3 * i, at);
    axpy3(slid, slid, q[m->joint[j].q] - m->joint[j].ref, up);
  }
}

void cav_fit_sizes_move(const cav_fit_sizes *sizes, const cav_state *state, const double *q, int link,
                        const double point[3], double *column) {
  const cav_model *m = sizes->model;
  double next[3], at[3], slid[3];
  memset(column, 0, 3 * (size_t)sizes->ngroup * sizeof *column);
  copy3(next, point);
  for (int i = link; i > 0; i = m->link[i].parent) {
    double *c = column + 3 * sizes->group[i];
    hold(m, state, q, i, at, slid);
    for (int k = 0; k < 3; k++) c[k] += next[k] - at[k] - slid[k];
    copy3(next, at);
  }
}

// lowest point of a tree's shapes at the state's position; infinite: it has none
static double lowest(const cav_model *m, const cav_state *state, int root) {
  double least = INFINITY;
  cav_pose pose;
  for (int g = 0; g < m->ngeom; g++) {
    if (!m->geom[g].link || m->link[m->geom[g].link].root != root) continue;
    cav_object_pose(m, state, CAV_OBJECT_GEOM, g, &pose);
    least = fmin(least, cav_geom_bottom(m, g, &pose));
  }
  return least;
}

// one posture: free roots go up by what the lowest point of their tree went down
static cav_status stand(const cav_fit_sizes *sizes, cav_state *state, double *q) {
  cav_model *m = sizes->model;
  cav_status status = CAV_OK;
  for (int j = 0; j < m->njoint && !status; j++) {
    double height[2] = {0};
    if (m->joint[j].type != CAV_JOINT_FREE) continue;
    for (int after = 0; after < 2 && !status; after++) {
      if (!after) cav_model_return(m, sizes->kept);
      if (after) status = cav_model_resize(m, sizes->factor);
      if (!status) status = cav_position(m, state, q);
      height[after] = lowest(m, state, m->joint[j].link);
    }
    if (isfinite(height[0])) q[m->joint[j].q + 2] += height[0] - height[1];
  }
  return status;
}

cav_status cav_fit_sizes_stand(const cav_fit_sizes *sizes, cav_state *state) {
  cav_model *m = sizes->model;
  size_t nq = (size_t)m->nq;
  double *q = malloc(((size_t)m->nkey + 1) * nq * sizeof *q);
  cav_status status = q ? CAV_OK : CAV_NO_MEMORY;
  for (int k = 0; k <= m->nkey && !status; k++) {
    memcpy(q + (size_t)k * nq, k < m->nkey ? m->key[k].q : m->q0, nq * sizeof *q);
    status = stand(sizes, state, q + (size_t)k * nq);
  }
  for (int k = 0; k <= m->nkey && !status; k++)
    memcpy((double *)(k < m->nkey ? m->key[k].q : m->q0), q + (size_t)k * nq, nq * sizeof *q);
  for (int j = 0; j < m->njoint && !status; j++)
    if (m->joint[j].type == CAV_JOINT_FREE) ((cav_link *)m->link)[m->joint[j].link].pos[2] = m->q0[m->joint[j].q + 2];
  free(q);
  return status;
}
