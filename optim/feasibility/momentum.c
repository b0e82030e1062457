/// Where only friction can push: how far a centre of mass can come from where it is.
///
/// In horizontal directions in which a tree is free (a free joint, or a slide that nothing holds), and whose only
/// contacts outside itself are with level planes, friction is the only force: m |a| <= mu N, and m a_z = N - m g. The way
/// at t is v t + int (t - s) a ds, so it is no farther from where the first velocity takes it than
/// mu (g t^2/2 + z(t) - z(0) - v_z t), and not at all without friction, or without a floor. Where all is at rest at T,
/// int a ds = -v, and any lambda may be taken from the weight: with |(t - s)+ - lambda| in its place, twice integrated by
/// parts, the bound is lambda v + mu (g ((t - lambda)^2 + lambda^2)/2 + g lambda (T - t) + 2 z(t - lambda) - z(0) - z(t)
/// - v_z (t - lambda)): at t = T half the way of one that need not stop. The least of sixteen lambdas counts. How high z
/// comes by then is what a push-off can give (takeoff.c), and no more than gravity takes back by t: as nothing pulls down,
/// z + g s^2/2 is convex, so z(s) is at most g s (t - s)/2 above the line from z(0) to z(t). Where nothing tells, less than a
/// kilometre.
#include <math.h>

#include "cavort/solve.h"
#include "feasibility.h"
#include "math3.h"

static const double tallest = 1000; // m: of any motion

/// A tree as it stands outside of itself.
typedef struct surroundings {
  int root;
  int open[2];     ///< whether nothing but friction acts along x, y
  double friction; ///< largest of its contacts with planes
} surroundings;

/// Whether nothing acts on a dof but contacts.
static int is_passive(const cav_model *m, int d) {
  const cav_dof *dof = &m->dof[d];
  // nor a tendon from outside
  for (int i = 0; i < m->ntendon; i++)
    for (int k = 0; k < m->tendon[i].ndof; k++)
      if (m->tendon_dof[m->tendon[i].dof + k] == d) return 0;
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

int cav_tree_is_open(cav_examination *e, int root, int axis) {
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
  if (m->density > 0 || m->viscosity > 0 || m->nequality > 0) return 0;
  for (int p = 0; p < m->npair; p++) {
    const cav_geom *a = &m->geom[m->pair[p].geom1], *b = &m->geom[m->pair[p].geom2];
    int ra = m->link[a->link].root, rb = m->link[b->link].root;
    if (ra == rb || (ra != s->root && rb != s->root)) continue;
    cav_pose pose;
    if (a->type != CAV_GEOM_PLANE || a->link != 0) return 0;
    cav_object_pose(m, e->start, CAV_OBJECT_GEOM, m->pair[p].geom1, &pose);
    if (fabs(pose.rotation[2]) > 1e-9 || fabs(pose.rotation[5]) > 1e-9 || pose.rotation[8] < 0) return 0;
    if (m->pair[p].dim >= 3) s->friction = fmax(s->friction, fmax(m->pair[p].friction[0], m->pair[p].friction[1]));
  }
  for (int axis = 0; axis < 2; axis++) s->open[axis] = cav_tree_is_open(e, s->root, axis);
  // what presses on the floor is known only of a tree that is free to rise
  if (s->friction > 0 && !cav_tree_is_open(e, s->root, 2)) return 0;
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

/// Height of the lowest place that the centre of mass of a tree can be, which nothing lets through a level plane.
static double lowest_of(const cav_examination *e, int root) {
  const cav_model *m = e->model;
  double sum = 0, mass = 0, anchor[6];
  for (int l = 1; l < m->nlink; l++) {
    double best = -INFINITY;
    if (m->link[l].root != root || !(m->link[l].mass > 0)) continue;
    for (int p = 0; p < m->npair; p++) {
      const cav_geom *floor = &m->geom[m->pair[p].geom1], *g = &m->geom[m->pair[p].geom2];
      cav_distance_range d;
      cav_pose pose;
      if (floor->link != 0 || m->link[g->link].root != root) continue;
      if (!cav_distance_between(m, l, m->link[l].com, g->link, g->pos, anchor, &d)) continue;
      cav_object_pose(m, e->start, CAV_OBJECT_GEOM, m->pair[p].geom1, &pose);
      best = fmax(best, pose.pos[2] - d.largest - 2 * CAV_TOLERANCE_PENETRATION);
    }
    sum += m->link[l].mass * best, mass += m->link[l].mass;
  }
  return mass > 0 ? sum / mass : -INFINITY;
}

/// What bounds the way of a centre of mass.
typedef struct travel {
  double g, friction;
  double time;     ///< of what is required, and a step
  double rest;     ///< when all is at rest; infinite: never has to be
  double start[3]; ///< height, horizontal speed, speed upwards
  double end;      ///< least height at the time
} travel;

/// The bound for one lambda, and what the momentum that certificates leave unexplained adds.
static double way_of(const travel *w, double delay, double highest) {
  double t = w->time - delay, after = delay > 0 ? w->rest - w->time : 0, all = w->time + after;
  double square = (t * t * t + delay * delay * delay) / 3 + delay * delay * after;
  double fall = w->g * (t * t + delay * delay) / 2 + w->g * delay * after - w->start[2] * t;
  double rise = delay > 0 ? 2 * highest - w->start[0] - w->end : highest - w->start[0];
  return w->friction * fmax(fall + rise, 0) + delay * w->start[1] +
         (1 + w->friction) * CAV_TOLERANCE_MOMENTUM * w->g * sqrt(all * square);
}

/// The greatest height at a time of one that starts where it does and is no higher than the last height by the end:
/// gravity has to take it back, with what the momentum that certificates leave unexplained lends it.
static double arc_of(const travel *w, double time, double last, double all) {
  const double left = w->time - time, part = time / w->time;
  return (1 - part) * w->start[0] + part * last + w->g * time * left / 2 +
         CAV_TOLERANCE_MOMENTUM * w->g * time * left * sqrt(all / (3 * w->time));
}

enum { DELAYS = 16 };

/// The farthest that the centre of mass can be from where its first velocity takes it, no higher than highest then;
/// infinite: off is nearer by far.
static cav_status farthest(cav_examination *e, int root, const travel *w, double off, double highest, double *way) {
  double time[DELAYS], height[DELAYS], delay[DELAYS];
  int n = isfinite(w->rest) ? DELAYS : 1, near = 0;
  for (int i = 0; i < n; i++) {
    delay[i] = 0.75 * w->time * i / DELAYS, time[i] = w->time - delay[i];
    // what is no farther without any rise is out of question
    near |= off > way_of(w, delay[i], w->start[0]) - w->friction * fabs(w->start[0] - w->end);
  }
  *way = INFINITY;
  if (!near) return CAV_OK;
  cav_status status = w->friction > 0 ? cav_takeoff_heights(e, root, n, time, height) : CAV_OK;
  for (int i = 0; i < n && !status; i++) {
    const double arc = arc_of(w, time[i], highest, isfinite(w->rest) ? w->rest : w->time);
    const double most = w->friction > 0 ? fmin(fmin(height[i], arc), tallest) : w->start[0];
    *way = fmin(*way, way_of(w, delay[i], most));
  }
  return status;
}

static cav_status examine_one(cav_examination *e, const cav_requirement *r) {
  const cav_model *m = e->model;
  int link = r->kind == CAV_REQUIRE_CENTRE ? m->body[r->object].link : r->object;
  surroundings s = {.root = m->link[link].root};
  double centre[3], velocity[3], t = cav_requirement_time(e, r->knot), wide = 0, off = 0, way;
  double step = e->problem->timestep * fmax(e->longest, 1);
  if (link == 0 || !survey(e, &s)) return CAV_OK;
  if (r->kind == CAV_REQUIRE_POINT) wide = cav_distance_to_centre(m, 0, r->object, r->point);
  // of a whole tree alone the centre is the one that is moved
  if (r->kind == CAV_REQUIRE_CENTRE && m->link[s.root].body != r->object) return CAV_OK;
  cav_status status = cav_centre_of_tree(e, s.root, centre, velocity);
  if (status) return status;
  for (int k = 0; k < 2; k++) {
    // a duration that is free gives any time up to the longest
    double middle = centre[k] + velocity[k] * t, early = fabs(velocity[k]) * (t - r->knot * e->problem->timestep);
    double beyond = fmax(r->low[k] - middle, middle - r->high[k]) - early;
    if (s.open[k] && beyond > 0) off = hypot(off, beyond);
  }
  off -= wide + 1e-3;
  if (!(off > 0)) return CAV_OK;
  double low = r->low[2] - wide, floor = s.friction > 0 ? lowest_of(e, s.root) : centre[2];
  travel w = {.g = -m->gravity[2], .friction = s.friction, .time = t + step, .rest = INFINITY};
  w.start[0] = centre[2], w.start[1] = hypot(velocity[0], velocity[1]), w.start[2] = velocity[2];
  w.end = fmax(low, floor);
  if (e->problem->close_at_rest && isfinite(w.end)) w.rest = e->nknot * step;
  status = farthest(e, s.root, &w, off, r->high[2] + wide, &way);
  if (status || !(off > way)) return status;
  char what[160];
  cav_requirement_words(e, r, what, sizeof what);
  if (s.friction > 1e-3)
    cav_impossible(
        e, CAV_CONDITION_MOMENTUM, r,
        "Give the floor friction, more time, a nearer target, or something to push against.",
        "%s, but friction (%.3g) cannot push it there in time: by its weight%s and all that joints can lift it, it "
        "takes a centre of mass at most %.3g m; %.3g m short",
        what, s.friction, isfinite(w.rest) ? ", with an end at rest," : "", way, off - way);
  else
    cav_impossible(e, CAV_CONDITION_MOMENTUM, r, "Give the floor friction, more time, or something to push against.",
                   "%s, but nothing can push it there: there is no friction (%.3g), %.3g m short", what, s.friction,
                   off - way);
  cav_impossible_fraction(e, way / off);
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
