/// What actuators can give in a time.
///
/// Actuators give power sum tau_i q'_i, and q'_i <= sqrt(2 T/m_i) with the kinetic energy T and a least inertia m_i that
/// moving one joint has whatever the others do. Contacts and limits take energy only, damping d_i q'_i² of it. So the
/// energy E above its least possible value grows by at most P(E) = sum of the largest tau_i v - d_i v² with v up to
/// sqrt(2 E/m_i): a swing-up needs the integral of dE/P, however it pumps. Without damping that is d sqrt(E)/dt <= c,
/// c = sum tau_i/sqrt(2 m_i); with gravity as one more force on all that moves, d sqrt(T)/dt <= c + g sqrt(M/2) holds
/// where no least energy is known, and bounds how far a point comes: its speed is at most sqrt(2 T/m) with a least mass
/// m of its own.
///
/// Nothing is said of models with springs, media, equality constraints, gravity compensation, or with an actuator that
/// has no limit or acts on a joint of which no least inertia is known.
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "algebra.h"
#include "feasibility.h"
#include "math3.h"
#include "objects.h"

static const double usual_rate = 0.3; // tolerance of a rate, m/s or rad/s
static const double margin = 1.1;     // of bounds on rates, for the error of a step
enum { PARTS = 200, MOST_TIMES = 1000 };

/// What is known of a model as a whole.
typedef struct supply {
  double rate;      ///< c, sqrt(W)/sqrt(s); negative: unknown
  double *force;    ///< [nv] tau_i, N or N m
  double *inertia;  ///< [nv] m_i
  double gravity;   ///< what g adds to it
  double kinetic;   ///< T at the start, J
  double potential; ///< at the start, J
  double least;     ///< least potential energy, -INFINITY: unknown
} supply;

/// Moment of inertia of a link about an axis of its frame, by the ellipsoid of its inverse: what rotation with that
/// component costs at least.
static double inertia_about(const cav_link *link, const double axis[3]) {
  double quat[4], moment[3], R[9], a[3], sum = 0;
  cav_principal_axes(link->inertia, quat, moment);
  quat_matrix(R, quat);
  rotate_back(a, R, axis);
  for (int k = 0; k < 3; k++) {
    if (fabs(a[k]) < 1e-9) continue;
    if (!(moment[k] > 0)) return 0;
    sum += a[k] * a[k] / moment[k];
  }
  return sum > 0 ? 1 / sum : 0;
}

/// Least mass of a point of a link: its speed is at most sqrt(2 T/mass).
static double point_mass(const cav_link *link, const double point[3]) {
  double arm[3], quat[4], moment[3];
  if (!(link->mass > 0)) return 0;
  sub3(arm, point, link->com);
  double r = norm3(arm);
  if (r < 1e-9) return link->mass;
  cav_principal_axes(link->inertia, quat, moment);
  return moment[2] > 0 ? 1 / (1 / link->mass + r * r / moment[2]) : 0;
}

/// Whether a link moves along slides of the world alone, and its joints are slides at right angles.
static int is_carriage(const cav_model *m, const cav_link *link) {
  if (link->parent != 0) return 0;
  for (int i = link->joint; i < link->joint + link->njoint; i++) {
    if (m->joint[i].type != CAV_JOINT_SLIDE) return 0;
    for (int k = link->joint; k < i; k++)
      if (fabs(dot3(m->joint[i].axis, m->joint[k].axis)) > 1e-9) return 0;
  }
  return 1;
}

/// Least inertia of a dof: T >= inertia/2 times its rate squared, whatever else moves.
static double least_inertia(const cav_model *m, int d) {
  const cav_dof *dof = &m->dof[d];
  const cav_link *link = &m->link[dof->link], *parent = &m->link[link->parent];
  const cav_joint *joint = &m->joint[dof->joint];
  double add = dof->armature;
  if (joint->type == CAV_JOINT_SLIDE) return add + (is_carriage(m, link) ? link->mass : 0);
  // of several joints of one link the rates can cancel
  if (joint->type != CAV_JOINT_HINGE || link->njoint != 1) return add;
  double own = inertia_about(link, joint->axis), R[9], axis[3];
  if (link->parent == 0) {
    double arm[3], along[3];
    sub3(arm, link->com, joint->pos);
    cross3(along, joint->axis, arm);
    symmetric_mul(axis, link->inertia, joint->axis);
    return add + dot3(axis, joint->axis) + link->mass * dot3(along, along);
  }
  quat_matrix(R, link->quat);
  rotate(axis, R, joint->axis);
  double other = inertia_about(parent, axis);
  return add + (own > 0 && other > 0 ? own * other / (own + other) : 0);
}

/// What the model has that this knows nothing of.
static int is_covered(const cav_model *m) {
  if (m->density > 0 || m->viscosity > 0 || m->nequality > 0) return 0;
  for (int i = 0; i < m->nbody; i++)
    if (m->body[i].buoyancy != 0) return 0;
  for (int j = 0; j < m->njoint; j++)
    if (m->joint[j].stiffness != 0) return 0;
  for (int i = 0; i < m->ntendon; i++)
    if (m->tendon[i].stiffness != 0) return 0;
  return 1;
}

/// c of the model; negative where an actuator has no limit, or a joint of its no least inertia.
static cav_status supply_rate(cav_examination *e, double *force, double *rate) {
  const cav_model *m = e->model;
  int bounded = 0;
  cav_status status = cav_effort_of_dofs(e, force, &bounded);
  double sum = bounded ? 0 : INFINITY;
  for (int d = 0; d < m->nv && !status; d++)
    if (force[d] > 0) sum += force[d] / sqrt(2 * least_inertia(m, d));
  *rate = isfinite(sum) ? sum : -1;
  return status;
}

/// Lowest and highest of what can be the height of a point above the world, -INFINITY: not known.
static double lowest(const cav_model *m, int link, const double point[3], double up) {
  static const double zero[3] = {0};
  double anchor[6];
  cav_distance_range d;
  if (!cav_distance_between(m, link, point, 0, zero, anchor, &d)) return -INFINITY;
  return (up > 0 ? anchor[2] : -anchor[5]) - d.largest;
}

static double weight_of(const cav_model *m, const cav_body *b) { return -m->gravity[2] * b->mass; }

/// Least potential energy of all bodies.
static double least_potential(const cav_model *m) {
  double sum = 0, centre[3];
  for (int i = 1; i < m->nbody; i++) {
    const cav_body *b = &m->body[i];
    if (!(b->mass > 0) || b->link == 0) continue;
    cav_body_centre(b, centre);
    sum += weight_of(m, b) * lowest(m, b->link, centre, 1);
  }
  return sum;
}

static double potential_at(const cav_model *m, const cav_state *state) {
  double sum = 0;
  for (int i = 1; i < m->nlink; i++) sum += -m->gravity[2] * m->link[i].mass * state->com[3 * i + 2];
  return sum;
}

static cav_status kinetic_at_start(cav_examination *e, double *kinetic) {
  const cav_model *m = e->model;
  const double *v = e->problem->v_start;
  double *M = malloc((size_t)m->nv * (size_t)m->nv * sizeof *M);
  cav_status status = M ? cav_inertia(m, e->scratch, e->problem->q_start, M) : CAV_NO_MEMORY;
  *kinetic = 0;
  for (int i = 0; i < m->nv && !status; i++)
    for (int j = 0; j < m->nv; j++) *kinetic += 0.5 * v[i] * M[i * m->nv + j] * v[j];
  free(M);
  return status;
}

static cav_status survey(cav_examination *e, supply *s) {
  const cav_model *m = e->model;
  int level = m->gravity[0] == 0 && m->gravity[1] == 0 && m->gravity[2] <= 0;
  double g = norm3(m->gravity);
  s->force = calloc(2 * (size_t)m->nv + 1, sizeof *s->force);
  s->inertia = s->force ? s->force + m->nv : NULL;
  for (int d = 0; s->force && d < m->nv; d++) s->inertia[d] = least_inertia(m, d);
  cav_status status = s->force ? supply_rate(e, s->force, &s->rate) : CAV_NO_MEMORY;
  if (status) return status;
  s->rate = is_covered(m) ? margin * s->rate : -1;
  s->gravity = g * sqrt(m->mass / 2);
  s->potential = potential_at(m, e->start);
  s->least = level ? least_potential(m) : -INFINITY;
  return kinetic_at_start(e, &s->kinetic);
}

// ---------------------------------------------------------------- how far

/// Least mass of what is required, and where it is at the start; 0: not known.
static double moved_mass(const cav_examination *e, const cav_requirement *r, double at[3]) {
  const cav_model *m = e->model;
  zero3(at);
  if (r->kind == CAV_REQUIRE_COORDINATE) {
    at[0] = e->problem->q_start[m->joint[r->object].q];
    return least_inertia(m, m->joint[r->object].dof);
  }
  if (r->kind == CAV_REQUIRE_POINT) {
    if (r->object == 0) return 0;
    transform(at, e->start->link[r->object].pos, e->start->link[r->object].rotation, r->point);
    return point_mass(&m->link[r->object], r->point);
  }
  double mass = 0;
  for (int i = r->object; i < m->nbody; i++)
    if (cav_body_within(m, i, r->object)) mass += m->body[i].mass;
  cav_sensor s = {
      .name = "", .type = CAV_SENSOR_SUBTREECOM, .object_type = CAV_OBJECT_BODY, .object = r->object, .dim = 3};
  cav_sensor_read(m, e->start, &s, at);
  return mass;
}

static void examine_way(cav_examination *e, const supply *s, const cav_requirement *r) {
  double at[3], mass = moved_mass(e, r, at), t = cav_requirement_time(e, r->knot), way2 = 0;
  int dim = r->kind == CAV_REQUIRE_COORDINATE ? 1 : 3;
  if (!(mass > 0)) return;
  for (int k = 0; k < dim; k++) {
    double off = fmax(fmax(r->low[k] - at[k], at[k] - r->high[k]), 0);
    way2 += off * off;
  }
  // the first step leaves with the velocity that the start has, the last acts a step longer
  double rate = s->rate + s->gravity, h = e->problem->timestep * fmax(e->longest, 1), long_t = t + h;
  // potential energy is bounded too where its least is known
  double top = s->least > -INFINITY ? s->kinetic + s->potential - s->least : INFINITY;
  double by_all = sqrt(2 / mass) * (sqrt(s->kinetic) * long_t + rate * long_t * long_t / 2);
  double by_total =
      isinf(top) ? INFINITY : sqrt(2 / mass) * (sqrt(fmax(top, 0)) * long_t + s->rate * long_t * long_t / 2);
  double can = fmin(by_all, by_total), way = sqrt(way2);
  if (way <= can + 1e-3) return;
  char what[160];
  const char *unit = dim == 1 && e->model->joint[r->object].type == CAV_JOINT_HINGE ? "rad" : "m";
  cav_requirement_words(e, r, what, sizeof what);
  cav_impossible(e, CAV_CONDITION_ENERGY, r, "More time, a nearer target, or stronger actuators.",
                 "%s, too far for the time: %.3g %s away, and actuators at full effort move it at most %.3g %s by then",
                 what, way, unit, can, unit);
  cav_impossible_fraction(e, can / way);
}

// ---------------------------------------------------------------- how fast

/// Least mass or inertia of what a sensor of a rate is of, T >= mass/2 times its square; 0: not known, or no such sensor.
static double rated_mass(const cav_examination *e, const cav_sensor *s) {
  static const double zero[3] = {0};
  const cav_model *m = e->model;
  double mass = 0;
  if (s->type == CAV_SENSOR_JOINTVEL) return least_inertia(m, m->joint[s->object].dof);
  if (s->type == CAV_SENSOR_SUBTREELINVEL)
    for (int i = s->object; i < m->nbody; i++)
      if (cav_body_within(m, i, s->object)) mass += m->body[i].mass;
  if (s->type != CAV_SENSOR_FRAMELINVEL) return mass;
  int link = cav_object_link(m, s->object_type, s->object);
  const double *point = s->object_type == CAV_OBJECT_SITE   ? m->site[s->object].pos
                        : s->object_type == CAV_OBJECT_GEOM ? m->geom[s->object].pos
                                                            : m->body[s->object].pos;
  double centre[3];
  if (s->object_type == CAV_OBJECT_BODY) cav_body_centre(&m->body[s->object], centre), point = centre;
  return link ? point_mass(&m->link[link], point ? point : zero) : 0;
}

static void examine_rate(cav_examination *e, const supply *s, int i) {
  const cav_term *term = &e->problem->term[i];
  double low[3], high[3], needs = 0, mass;
  int first, last;
  if (term->quantity != CAV_QUANTITY_SENSOR || !((mass = rated_mass(e, &term->sensor)) > 0)) return;
  cav_requirement_window(e, term, &first, &last);
  if (!cav_requirement_interval(e, term, first, usual_rate, low, high)) return;
  for (int k = 0; k < 3; k++) {
    double least = fmax(fmax(low[k], -high[k]), 0);
    if (k < term->sensor.dim) needs += least * least;
  }
  double t = cav_requirement_time(e, first) + e->problem->timestep * fmax(e->longest, 1);
  double top = s->least > -INFINITY ? s->kinetic + s->potential - s->least : INFINITY;
  double root = fmin(sqrt(s->kinetic) + (s->rate + s->gravity) * t, sqrt(fmax(top, 0)) + s->rate * t);
  double can = sqrt(2 / mass) * root;
  if (!(sqrt(needs) > can + 1e-3)) return;
  const cav_requirement r = {.term = i, .knot = first};
  char what[160];
  cav_requirement_sensor_words(e, term, first, what, sizeof what);
  int turns = term->sensor.type == CAV_SENSOR_JOINTVEL && e->model->joint[term->sensor.object].type == CAV_JOINT_HINGE;
  cav_impossible(
      e, CAV_CONDITION_ENERGY, &r, "More time, a lower speed, or stronger actuators.",
      "%s, too fast for the time: %.3g %s are asked for, and actuators at full effort bring it to %.3g at most", what,
      sqrt(needs), turns ? "rad/s" : "m/s", can);
  cav_impossible_fraction(e, can / sqrt(needs));
}

// ---------------------------------------------------------------- how high

/// Least potential energy with what is required at a knot, by all its requirements there.
static double potential_with(const cav_examination *e, int first, int last) {
  const cav_model *m = e->model;
  double sum = 0, centre[3];
  for (int i = 1; i < m->nbody; i++) {
    const cav_body *b = &m->body[i];
    if (!(b->mass > 0) || b->link == 0) continue;
    cav_body_centre(b, centre);
    double z = lowest(m, b->link, centre, 1);
    for (int k = first; k < last; k++) {
      const cav_requirement *r = &e->requirement[k];
      double anchor[6];
      cav_distance_range d;
      if (r->kind != CAV_REQUIRE_POINT || isinf(r->low[2]) || r->object == 0) continue;
      if (cav_distance_between(m, b->link, centre, r->object, r->point, anchor, &d)) z = fmax(z, r->low[2] - d.largest);
    }
    sum += weight_of(m, b) * z;
  }
  return sum;
}

/// The posture that scalar joints are required to have at a knot, if it is all of them: its least potential energy
/// within the tolerances; -INFINITY otherwise.
static cav_status potential_of_posture(cav_examination *e, int first, int last, double *potential) {
  const cav_model *m = e->model;
  double *q = malloc((size_t)m->nq * sizeof *q), *width = calloc((size_t)m->nv + 1, sizeof *width);
  cav_status status = q && width ? CAV_OK : CAV_NO_MEMORY;
  int known = 0;
  *potential = -INFINITY;
  for (int j = 0; j < m->njoint && !status; j++) {
    const cav_joint *joint = &m->joint[j];
    int found = 0;
    for (int k = first; k < last; k++) {
      const cav_requirement *r = &e->requirement[k];
      if (r->kind != CAV_REQUIRE_COORDINATE || r->object != j || isinf(r->low[0]) || isinf(r->high[0])) continue;
      q[joint->q] = (r->low[0] + r->high[0]) / 2;
      width[joint->dof] = (r->high[0] - r->low[0]) / 2;
      found = 1;
    }
    known += found;
  }
  if (!status && known == m->njoint) {
    status = cav_position(m, e->scratch, q);
    double slack = 0, anchor[6];
    // a joint that is off by w moves what hangs on it by w times its distance at most, a slide by w
    for (int i = 1; i < m->nlink && !status; i++) {
      for (int l = i; l > 0; l = m->link[l].parent) {
        for (int j = m->link[l].joint; j < m->link[l].joint + m->link[l].njoint; j++) {
          cav_distance_range d = {1, 1};
          if (m->joint[j].type != CAV_JOINT_SLIDE)
            cav_distance_between(m, i, m->link[i].com, l, m->joint[j].pos, anchor, &d);
          slack += -m->gravity[2] * m->link[i].mass * width[m->joint[j].dof] * (isinf(d.largest) ? 1e3 : d.largest);
        }
      }
    }
    if (!status) *potential = potential_at(m, e->scratch) - slack;
  }
  free(q);
  free(width);
  return status;
}

/// Largest power at an energy above the least, with so many times the forces.
static double largest_power(const cav_model *m, const supply *s, double energy, double times) {
  double sum = 0;
  for (int d = 0; d < m->nv; d++) {
    double force = times * s->force[d], damping = m->options.passive ? m->dof[d].damping : 0;
    if (force == 0) continue;
    double v = sqrt(2 * energy / s->inertia[d]);
    if (damping > 0) v = fmin(v, force / (2 * damping));
    sum += force * v - damping * v * v;
  }
  return margin * sum;
}

/// Least time in which pumping raises the energy above the least from one value to another: the integral of 1/P, P
/// taken at the upper end of each part. Ends at *reached, if not NULL, where a time is over.
static double pumping_time(const cav_model *m, const supply *s, double from, double to, double times, double most,
                           double *reached) {
  double a = sqrt(from), step = (sqrt(to) - a) / PARTS, time = 0;
  for (int i = 0; i < PARTS; i++) {
    double low = (a + i * step) * (a + i * step), high = (a + (i + 1) * step) * (a + (i + 1) * step);
    double power = largest_power(m, s, high, times);
    time += power > 0 ? (high - low) / power : INFINITY;
    if (reached && time <= most) *reached = high;
    if (reached && time > most) break;
  }
  return time;
}

/// Least multiple of the forces by which a time is enough, infinite: none up to MOST_TIMES.
static double effort_for(const cav_model *m, const supply *s, double from, double to, double time) {
  double low = 1, high = MOST_TIMES;
  if (pumping_time(m, s, from, to, high, 0, NULL) > time) return INFINITY;
  while (high - low > 1e-3 * high) {
    double middle = (low + high) / 2;
    if (pumping_time(m, s, from, to, middle, 0, NULL) > time)
      low = middle;
    else
      high = middle;
  }
  return low;
}

static cav_status examine_height(cav_examination *e, const supply *s, int first, int last) {
  const cav_requirement *r = &e->requirement[first];
  double posture, t = cav_requirement_time(e, r->knot) + e->problem->timestep;
  cav_status status = potential_of_posture(e, first, last, &posture);
  if (status || isinf(s->least)) return status;
  double needs = fmax(potential_with(e, first, last), posture) - s->least;
  double has = fmax(s->kinetic + s->potential - s->least, 0), can = has;
  if (!(needs > has + 1e-6) || pumping_time(e->model, s, has, needs, 1, t, &can) <= t) return CAV_OK;
  char what[160], time[80] = "no time is enough";
  cav_requirement_words(e, r, what, sizeof what);
  double least = pumping_time(e->model, s, has, needs, 1, 0, NULL), times = effort_for(e->model, s, has, needs, t);
  if (isfinite(least)) snprintf(time, sizeof time, "pumping takes at least %.3g s", least);
  size_t n = strlen(time);
  if (isfinite(times)) snprintf(time + n, sizeof time - n, ", or %.3g times the effort", times);
  cav_impossible(
      e, CAV_CONDITION_ENERGY, r, "More time, a lower target, or stronger actuators.",
      "%s, too high for the actuators: it needs %.3g J more than the start has, they give at most %.3g J by then; %s",
      what, needs - has, can - has, time);
  cav_impossible_fraction(e, isfinite(least) ? t / least : 1);
  return CAV_OK;
}

cav_status cav_examine_energy(cav_examination *e) {
  supply s = {0};
  if (!cav_start_is_given(e->problem)) return CAV_OK;
  cav_status status = survey(e, &s);
  int before = e->nfound;
  for (int i = 0; i < e->problem->nterm && !status && s.rate >= 0 && e->nfound == before; i++) examine_rate(e, &s, i);
  for (int i = 0, last; i < e->n && !status && s.rate >= 0 && e->nfound == before; i = last) {
    for (last = i; last < e->n && e->requirement[last].knot == e->requirement[i].knot;) last++;
    status = examine_height(e, &s, i, last);
    for (int k = i; k < last && e->nfound == before && !status; k++) examine_way(e, &s, &e->requirement[k]);
  }
  free(s.force);
  return status;
}
