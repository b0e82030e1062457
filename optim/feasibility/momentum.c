/// Where only friction can push: how far a centre of mass can come from where it is.
///
/// Along a horizontal direction n in which a tree is free (a free joint, or a slide that nothing holds), and whose only
/// contacts outside itself are with level planes, friction is the only force: m a_n <= mu N, and m a_z = N - m g. Twice
/// integrated: the centre of mass is no farther from where its first velocity takes it than
/// mu (g t^2/2 + z(t) - z(0) - v_z(0) t), and not at all without friction, or without a floor. Where z(t) is not asked
/// for it is taken to be less than a kilometre up.
#include <math.h>

#include "cavort/solve.h"
#include "feasibility.h"
#include "math3.h"

static const double highest = 1000; // m: of any motion
// of the tolerance of momentum, of g t^2: what a force of that root mean square can shift, 1/sqrt(3), and a little more
static const double unexplained = 0.6;

/// A tree as it stands outside of itself.
typedef struct surroundings {
  int root;
  int open[2];     ///< whether nothing but friction acts along x, y
  double friction; ///< largest of its contacts with planes
} surroundings;

/// Whether nothing acts on a dof but contacts.
static int is_passive(const cav_model *m, int d) {
  const cav_dof *dof = &m->dof[d];
  const cav_joint *joint = &m->joint[dof->joint];
  return dof->damping == 0 && dof->frictionloss == 0 && dof->armature == 0 && joint->stiffness == 0 && !joint->limited;
}

static int is_actuated(cav_examination *e, int d) {
  const cav_model *m = e->model;
  for (int i = 0; i < m->nu; i++) {
    double *moment = e->scratch->u; // free between evaluations
    if (!m->actuator[i].constant) return 1;
    cav_actuator_length(m, e->scratch, i, moment);
    if (moment[d] != 0) return 1;
  }
  return 0;
}

/// Whether the first joints of a tree let it go along a world axis, held by nothing.
static int is_open(cav_examination *e, int root, int axis) {
  const cav_model *m = e->model;
  const cav_link *link = &m->link[root];
  for (int j = link->joint; j < link->joint + link->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    int d = joint->dof + (joint->type == CAV_JOINT_FREE ? axis : 0);
    if (joint->type == CAV_JOINT_FREE) return is_passive(m, d) && !is_actuated(e, d);
    // a slide above any joint that turns it
    if (joint->type != CAV_JOINT_SLIDE) return 0;
    if (fabs(e->start->axis[6 * (size_t)d + 3 + (size_t)axis]) > 1 - 1e-9)
      return is_passive(m, d) && !is_actuated(e, d);
  }
  return 0;
}

/// What a tree may touch; 0: something other than level planes.
static int survey(cav_examination *e, surroundings *s) {
  const cav_model *m = e->model;
  s->friction = 0;
  if (m->gravity[0] != 0 || m->gravity[1] != 0 || !(m->gravity[2] < 0)) return 0;
  if (m->density > 0 || m->viscosity > 0 || m->nequality > 0 || m->ntendon > 0) return 0;
  for (int p = 0; p < m->npair; p++) {
    const cav_geom *a = &m->geom[m->pair[p].geom1], *b = &m->geom[m->pair[p].geom2];
    int ra = m->link[a->link].root, rb = m->link[b->link].root;
    if (ra == rb || (ra != s->root && rb != s->root)) continue;
    cav_pose pose;
    if (a->type != CAV_GEOM_PLANE || a->link != 0) return 0;
    cav_object_pose(m, e->start, CAV_OBJECT_GEOM, m->pair[p].geom1, &pose);
    if (fabs(pose.rotation[2]) > 1e-9 || fabs(pose.rotation[5]) > 1e-9 || pose.rotation[8] < 0) return 0;
    if (m->pair[p].dim >= 3) s->friction = fmax(s->friction, hypot(m->pair[p].friction[0], m->pair[p].friction[1]));
  }
  for (int axis = 0; axis < 2; axis++) s->open[axis] = is_open(e, s->root, axis);
  // what presses on the floor is known only of a tree that is free to rise
  if (s->friction > 0 && !is_open(e, s->root, 2)) return 0;
  return s->open[0] || s->open[1];
}

cav_status cav_centre_of_tree(cav_examination *e, int root, double centre[3], double velocity[3]) {
  const cav_model *m = e->model;
  cav_sensor s = {.name = "", .object_type = CAV_OBJECT_BODY, .object = m->link[root].body, .dim = 3};
  // velocities of the start, without forces
  e->scratch->options.constraint = e->scratch->options.contact = 0;
  cav_status status =
      cav_inverse(m, e->scratch, e->problem->q_start, e->problem->v_start, e->problem->v_start, e->scratch->u);
  if (status) return status;
  s.type = CAV_SENSOR_SUBTREECOM;
  cav_sensor_read(m, e->scratch, &s, centre);
  s.type = CAV_SENSOR_SUBTREELINVEL;
  cav_sensor_read(m, e->scratch, &s, velocity);
  return CAV_OK;
}

static cav_status examine_one(cav_examination *e, const cav_requirement *r) {
  static const char *const axis[] = {"x", "y"};
  const cav_model *m = e->model;
  int link = r->kind == CAV_REQUIRE_CENTRE ? m->body[r->object].link : r->object;
  surroundings s = {.root = m->link[link].root};
  double centre[3], velocity[3], t = cav_requirement_time(e, r->knot), wide = 0;
  if (link == 0 || !survey(e, &s)) return CAV_OK;
  if (r->kind == CAV_REQUIRE_POINT) wide = cav_distance_to_centre(m, 0, r->object, r->point);
  // of a whole tree alone the centre is the one that is moved
  if (r->kind == CAV_REQUIRE_CENTRE && m->link[s.root].body != r->object) return CAV_OK;
  cav_status status = cav_centre_of_tree(e, s.root, centre, velocity);
  if (status) return status;
  double rise = fmin(r->high[2] + wide - centre[2], highest);
  double fall = -m->gravity[2] * t * t / 2 + rise - velocity[2] * t;
  double push = s.friction > 0 ? s.friction * fmax(fall, 0) : 0,
         defect = unexplained * CAV_TOLERANCE_MOMENTUM * -m->gravity[2] * t * t;
  for (int k = 0; k < 2; k++) {
    double middle = centre[k] + velocity[k] * t, way = push + wide + defect + 1e-3;
    // a duration that is free gives any time up to the longest
    way += fabs(velocity[k]) * (t - r->knot * e->problem->timestep);
    double off = fmax(r->low[k] - middle, middle - r->high[k]) - way;
    if (!s.open[k] || !(off > 0)) continue;
    char what[160];
    cav_requirement_words(e, r, what, sizeof what);
    cav_impossible(e, CAV_CONDITION_MOMENTUM, r, "Give the floor friction, more time, or something to push against.",
                   s.friction > 1e-3
                       ? "%s, but friction (%.3g) cannot push it there in time: %.3g m short along %s"
                       : "%s, but nothing can push it there: there is no friction (%.3g), %.3g m short along %s",
                   what, s.friction, off, axis[k]);
    return CAV_OK;
  }
  return CAV_OK;
}

cav_status cav_examine_momentum(cav_examination *e) {
  if (!cav_start_is_given(e->problem)) return CAV_OK;
  cav_status status = CAV_OK;
  int before = e->nfound;
  for (int i = 0; i < e->n && !status && e->nfound == before; i++)
    if (e->requirement[i].kind != CAV_REQUIRE_COORDINATE) status = examine_one(e, &e->requirement[i]);
  return status;
}
