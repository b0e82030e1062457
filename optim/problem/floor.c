/// A posture down to the floor: each tree of a model along its root until its lowest geom touches a plane of the world, or,
/// going down, something else that stands in the world: a box on a table stays on the table, and one over a robot's back
/// comes to rest there. What begins inside a solid, its centre of mass over that, is raised onto it. With a rise the planes
/// alone count. The distance of a geom from a plane is by its support point, exact for every type here. And a posture within
/// the ranges of its joints. Postures of files go the same way (pose.c).
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "extent.h"
#include "posture.h"
#include "problem_file.h"
#include "stand.h"

// first joint that raises a tree: free, or a slide along the vertical. Its coordinate of height and how much that
// raises
static int lifting(const cav_model *m, const cav_state *state, int root, double *gain) {
  const cav_link *link = &m->link[root];
  for (int j = link->joint; j < link->joint + link->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    *gain = 1;
    if (joint->type == CAV_JOINT_FREE) return joint->q + 2;
    if (joint->type != CAV_JOINT_SLIDE) continue;
    const double *axis = state->axis + 6 * joint->dof;
    *gain = axis[5];
    if (fabs(axis[5]) > 0.999) return joint->q;
  }
  return -1;
}

// way up that brings a tree to where the lowest of its geoms that can touch a plane of the world touches it; infinite:
// there is no such geom
static double way_to_plane(const cav_model *m, const cav_state *state, int root) {
  double up = -INFINITY;
  for (int p = 0; p < m->npair; p++) {
    const cav_geom *plane = &m->geom[m->pair[p].geom1], *geom = &m->geom[m->pair[p].geom2];
    if (plane->type != CAV_GEOM_PLANE || plane->link != 0 || m->link[geom->link].root != root) continue;
    cav_pose floor, at;
    cav_object_pose(m, state, CAV_OBJECT_GEOM, m->pair[p].geom1, &floor);
    cav_object_pose(m, state, CAV_OBJECT_GEOM, m->pair[p].geom2, &at);
    double n[3] = {floor.rotation[2], floor.rotation[5], floor.rotation[8]};
    if (n[2] < 0.1) continue;
    double distance = -cav_geom_reach(m, m->pair[p].geom2, &at, (const double[3]){-n[0], -n[1], -n[2]});
    for (int i = 0; i < 3; i++) distance += n[i] * (at.pos[i] - floor.pos[i]);
    up = fmax(up, -distance / n[2]);
  }
  return up;
}

// m: what lies on something may be so deep in it
static const double rounding = 1e-6;

// whether a geom stands where a tree comes down: in the world, and for what no actuator moves on who is driven
static int stands_under(const cav_model *m, int geom, int root) {
  const int other = m->link[m->geom[geom].link].root;
  return other == 0 || (other != root && !m->link[root].driven && m->link[other].driven);
}

// the geom that stands there, is no plane and has a tree deepest and deeper than that inside it; -1: there is none
static cav_status solid_around(const cav_model *m, cav_state *state, int root, const double *q, double depth,
                               int *solid) {
  cav_status status = cav_position(m, state, q);
  double most = depth;
  *solid = -1;
  for (int i = 0; i < state->ncontact && !status; i++) {
    const cav_pair *pair = &m->pair[state->contact[i].pair];
    const int moves = m->link[m->geom[pair->geom1].link].root == root ? pair->geom1 : pair->geom2,
              stands = moves == pair->geom1 ? pair->geom2 : pair->geom1;
    if (m->link[m->geom[moves].link].root != root || m->geom[stands].type == CAV_GEOM_PLANE) continue;
    if (!stands_under(m, stands, root)) continue;
    // beside who is driven it slips by
    const double depth_here = -state->contact[i].dist - (m->geom[stands].link == 0 ? 0 : rounding);
    if (!(depth_here > most)) continue;
    most = -state->contact[i].dist;
    *solid = stands;
  }
  return status;
}

// half way between where a tree is in nothing and where it is in something, 40 times; ways from where the coordinate is from
static cav_status bisect(const cav_model *m, cav_state *state, int root, int height, double from, double gain,
                         double *q, double *free, double *blocked) {
  cav_status status = CAV_OK;
  for (int i = 0; i < 40 && !status; i++) {
    const double middle = (*free + *blocked) / 2;
    int solid;
    q[height] = from + middle / gain;
    status = solid_around(m, state, root, q, 0, &solid);
    *(solid >= 0 ? blocked : free) = middle;
  }
  return status;
}

static const double search_step = 0.005; // m: thinner things are passed
static const double highest_step = 1;    // m: onto what is higher nothing is raised

// how far a tree can go down, at most that far, before it touches something: step by step, then by bisection
static cav_status way_down(const cav_model *m, cav_state *state, int root, int height, double gain, double most,
                           double *q, double *way) {
  double from = q[height], free = 0, blocked = 0;
  int solid;
  cav_status status = solid_around(m, state, root, q, rounding, &solid);
  *way = most;
  // what starts inside of something is not stopped by it
  if (status || solid >= 0) return status;
  while (!status && solid < 0 && blocked > -most) {
    free = blocked;
    blocked = fmax(blocked - fmax(search_step, most / 4000), -most);
    q[height] = from + blocked / gain;
    status = solid_around(m, state, root, q, 0, &solid);
  }
  const int stopped = !status && solid >= 0;
  if (stopped) status = bisect(m, state, root, height, from, gain, q, &free, &blocked);
  q[height] = from;
  if (stopped) *way = -free;
  return status;
}

cav_status cav_tree_buried(const cav_model *m, cav_state *state, int root, double *q, int *solid, double *up) {
  static const double highest = 20; // m
  double gain = 1, free = 0, blocked = 0;
  cav_status status = solid_around(m, state, root, q, rounding, solid);
  *up = 0;
  const int height = status ? -1 : lifting(m, state, root, &gain);
  if (status || *solid < 0 || height < 0) return status;
  const double from = q[height];
  int in = *solid;
  while (!status && in >= 0 && free < highest) {
    blocked = free;
    free += search_step;
    q[height] = from + free / gain;
    status = solid_around(m, state, root, q, 0, &in);
  }
  if (!status && in < 0) status = bisect(m, state, root, height, from, gain, q, &free, &blocked);
  q[height] = from;
  *up = in < 0 ? free : 0;
  return status;
}

// whether a tree's centre of mass is over a geom, between the ends that this has along x and y
static int is_over(const cav_model *m, const cav_state *state, int root, int geom) {
  double centre[3] = {0}, mass = 0;
  cav_pose pose;
  for (int l = root; l < m->nlink; l++) {
    if (m->link[l].root != root) continue;
    for (int k = 0; k < 3; k++) centre[k] += m->link[l].mass * state->com[3 * l + k];
    mass += m->link[l].mass;
  }
  cav_object_pose(m, state, CAV_OBJECT_GEOM, geom, &pose);
  for (int k = 0; k < 4; k++) {
    const double sign = k % 2 ? 1 : -1, n[3] = {k < 2 ? sign : 0, k < 2 ? 0 : sign, 0};
    if (sign * (centre[k / 2] / mass - pose.pos[k / 2]) > cav_geom_reach(m, geom, &pose, n)) return 0;
  }
  return mass > 0;
}

// raises a tree that begins inside a solid of the world and is over it onto that; *raised 0 where it is not so
static cav_status raise_onto(const cav_model *m, cav_state *state, int root, int height, double gain, double *q,
                             int *raised) {
  double up = 0;
  int solid;
  cav_status status = cav_tree_buried(m, state, root, q, &solid, &up);
  *raised = 0;
  if (status || solid < 0 || !(up > 0 && up <= highest_step)) return status;
  status = cav_position(m, state, q);
  if (status || !is_over(m, state, root, solid)) return status;
  q[height] += up / gain;
  *raised = 1;
  return CAV_OK;
}

// moves one tree along its root to what it stands on, and higher by rise; *moved 0 where there is nothing
static cav_status drop_tree(const cav_model *m, cav_state *state, int root, int planes_alone, double rise, double *q,
                            int *moved) {
  double gain = 1, up = way_to_plane(m, state, root), down;
  int height = lifting(m, state, root, &gain);
  int raised = 0;
  *moved = height >= 0 && !isinf(up);
  if (!*moved) return CAV_OK;
  if (!planes_alone) {
    cav_status status = raise_onto(m, state, root, height, gain, q, &raised);
    if (status || raised) return status;
  }
  if (up < 0 && !planes_alone) {
    cav_status status = way_down(m, state, root, height, gain, -up, q, &down);
    if (status) return status;
    up = -down;
  }
  q[height] += (up + rise) / gain;
  return CAV_OK;
}

static cav_status refuse(cav_error *error, cav_status status, const char *format, const char *word) {
  if (error) {
    *error = (cav_error){.status = status};
    snprintf(error->text, sizeof error->text, format, word);
  }
  return status;
}

cav_status cav_configuration_to_floor(const cav_model *m, cav_state *state, const double *rise, double *q,
                                      cav_error *error) {
  cav_status status = cav_position(m, state, q);
  int dropped = 0, moved;
  for (int i = 1; i < m->nlink && !status; i++) {
    if (m->link[i].parent != 0) continue;
    status = drop_tree(m, state, i, rise != NULL, rise ? *rise : 0, q, &moved);
    dropped += moved;
    // where the others are is read off the posture as it stands
    if (!status) status = cav_position(m, state, q);
  }
  if (status) return refuse(error, status, "the posture cannot be evaluated: %s", cav_status_name(status));
  if (dropped) return CAV_OK;
  int planes = 0;
  for (int g = 0; g < m->ngeom; g++) planes += m->geom[g].type == CAV_GEOM_PLANE && m->geom[g].link == 0;
  if (!planes)
    return refuse(error, CAV_BAD_INPUT,
                  "the model '%.200s' has no floor: add one, <scene><geom type=\"plane\" size=\"0 0 1\"/></scene>, or "
                  "name the file of the model that has one (often scene.xml)",
                  m->name);
  return refuse(
      error, CAV_BAD_INPUT,
      "nothing of the model '%.200s' can be lowered to a plane: it needs a geom that may touch the plane, and a "
      "root that is free or slides along the vertical",
      m->name);
}

cav_status cav_configuration_stand(const cav_model *m, cav_state *state, double *q, cav_error *error) {
  cav_stand stand = {0};
  cav_status status = cav_stand_find(m, state, q, &stand);
  if (!status) return CAV_OK;
  const char *why = status == CAV_BAD_INPUT ? stand.why : cav_status_name(status);
  return refuse(error, status, "a posture that stands cannot be found: %s", why);
}

cav_status cav_configuration_posture(const cav_model *m, cav_state *state, const char *name, double *q,
                                     cav_error *error) {
  if (!strcmp(name, "stand")) return cav_configuration_stand(m, state, q, error);
  int i = 0;
  while (cav_posture_names[i] && strcmp(cav_posture_names[i], name)) i++;
  if (!cav_posture_names[i])
    return refuse(error, CAV_BAD_INPUT,
                  "there is no posture of that name, got '%.40s'; cavort help postures lists them", name);
  char why[200];
  cav_status status = cav_posture_named(m, state, name, q, why);
  if (!status) return CAV_OK;
  return refuse(error, status, "the posture cannot be found: %s",
                status == CAV_BAD_INPUT ? why : cav_status_name(status));
}

int cav_configuration_clip(const cav_model *m, double *q) {
  int n = 0;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    int scalar = joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE;
    if (!joint->limited || !scalar) continue;
    double *x = &q[joint->q], within = fmin(fmax(*x, joint->range[0]), joint->range[1]);
    n += within != *x;
    *x = within;
  }
  return n;
}
