/// Where nothing can hold a body up: no floor, or no shape that could touch it.
///
/// A tree that is free along the vertical and may touch nothing outside of itself is pulled by its weight alone, whatever
/// its joints do: after T the speed of its centre of mass is v - g T, but for the momentum that certificates leave
/// unexplained, at most CAV_TOLERANCE_MOMENTUM g T. Where all has to be at rest by then, it cannot.
#include <math.h>
#include <string.h>

#include "cavort/solve.h"
#include "feasibility.h"

/// Whether the root of a tree has anything to touch outside of the tree.
static int may_touch(const cav_model *m, int root) {
  for (int p = 0; p < m->npair; p++) {
    int a = m->link[m->geom[m->pair[p].geom1].link].root, b = m->link[m->geom[m->pair[p].geom2].link].root;
    if (a != b && (a == root || b == root)) return 1;
  }
  return 0;
}

/// Whether a body of a tree is lifted by its own compensation of gravity.
static int floats(const cav_model *m, int root) {
  for (int b = 1; b < m->nbody; b++)
    if (m->link[m->body[b].link].root == root && m->body[b].buoyancy != 0) return 1;
  return 0;
}

/// What has no shape that may touch anything is told apart from what has nothing to touch.
static int has_shape(const cav_model *m, int root) {
  for (int g = 0; g < m->ngeom; g++)
    if (m->link[m->geom[g].link].root == root && (m->geom[g].contype || m->geom[g].conaffinity)) return 1;
  return 0;
}

// whether shapes are missing because their files are
static int lost_meshes(const cav_model *m) {
  for (int i = 0; i < m->nwarning; i++)
    if (strstr(m->warning[i], "the file is not found")) return 1;
  return 0;
}

static void tell(cav_examination *e, int root, double speed, double time) {
  const cav_model *m = e->model;
  char buffer[48];
  const char *name = cav_name_or(m->body[m->link[root].body].name, "body", m->link[root].body, buffer);
  if (has_shape(m, root))
    cav_impossible(
        e, CAV_CONDITION_MOMENTUM, NULL,
        "Add a floor, <scene><geom type=\"plane\" size=\"0 0 1\"/></scene>, or name the file of the model that "
        "has one; of a free flight <horizon close=\"open\"> asks for no rest.",
        "nothing can hold '%s' up: there is no floor, nor anything else that it may touch, so at the end, after "
        "%.3g s, it falls at %.3g m/s, and it has to be at rest",
        name, time, speed);
  else
    cav_impossible(
        e, CAV_CONDITION_MOMENTUM, NULL,
        "Give it geoms that may touch; cavort inspect lists what was left out of the model's file, meshes that "
        "are not found among it.",
        "nothing can hold '%s' up: none of its bodies has a shape that may touch anything%s, so at the end, after "
        "%.3g s, it falls at %.3g m/s, and it has to be at rest",
        name, lost_meshes(m) ? " (the files of its meshes are not found)" : "", time, speed);
}

cav_status cav_examine_falls(cav_examination *e) {
  static const double sure = 0.1; // of the speed: more than what certificates leave unexplained
  const cav_model *m = e->model;
  double g = -m->gravity[2], time = e->problem->duration, centre[3], velocity[3];
  if (!cav_start_is_given(e->problem) || !e->problem->close_at_rest || !(g > 0)) return CAV_OK;
  if (m->density > 0 || m->viscosity > 0 || m->nequality > 0) return CAV_OK;
  if (e->problem->duration_least > 0) time = fmin(time, e->problem->duration_least);
  for (int i = 1; i < m->nlink; i++) {
    if (m->link[i].parent != 0 || !cav_tree_is_open(e, i, 2) || may_touch(m, i) || floats(m, i)) continue;
    cav_status status = cav_centre_of_tree(e, i, centre, velocity);
    if (status) return status;
    double speed = g * time - velocity[2];
    if (speed < sure * g * time) continue;
    tell(e, i, speed, time);
    return CAV_OK;
  }
  return CAV_OK;
}
