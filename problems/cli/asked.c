/// What the terms of a problem ask for beside what its start and goal have: a line a term, with units. Readings of places and
/// orientations at both postures, of velocities at the start; forces are not known of a posture. And of single terms what
/// their words hide: that a posture of joints leaves a free base open, that a force at an open end is never measured, that
/// numbers are likely to be of another unit, that a thing may have to slide or roll.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/dynamics.h"
#include "cavort/solve.h"
#include "command.h"
#include "math3.h"
#include "objects.h"
#include "problem_file.h"
#include "quantity.h"
#include "rotation.h"
#include "thing.h"

enum { CELL = 80, NAME = 112 };

/// The postures that are compared, and the columns of the table.
typedef struct comparison {
  const cav_problem *p;
  cav_state *start, *goal;
  double *work; ///< [nq + 2 nv]
} comparison;

int cav_command_base(const cav_problem *p, const cav_term *term) {
  const cav_model *m = p->model;
  if (term->quantity != CAV_QUANTITY_CONFIGURATION || (term->dofs != CAV_DOFS_JOINTS && term->dofs != CAV_DOFS_DRIVEN))
    return -1;
  for (int j = 0; j < m->njoint; j++)
    if (m->joint[j].type == CAV_JOINT_FREE && cav_command_is_loose(m, m->joint[j].link)) return j;
  return -1;
}

int cav_command_unmeasured(const cav_problem *p, const cav_term *term) {
  const double end = term->to < 0 ? p->duration : term->to;
  const int last = (int)lround(p->duration / p->timestep);
  if (term->quantity != CAV_QUANTITY_ACCELERATION && term->quantity != CAV_QUANTITY_EFFORT &&
      term->quantity != CAV_QUANTITY_POWER && cav_term_stage(term) != CAV_READS_ACCELERATION)
    return 0;
  // only a motion that closes at rest has forces at its last knot
  if (p->close_at_rest && !p->cycle.on) return 0;
  return end - term->from < 1e-9 ? lround(term->from / p->timestep) >= last
                                 : ceil(term->from / p->timestep - 1e-6) >= last;
}

/// Unit of a value of a term: that of its tolerance, if it had one.
static void unit_of(const cav_problem *p, const cav_term *term, char unit[16]) {
  cav_term asked = *term;
  cav_tolerance tolerance[4];
  asked.within = 1;
  const int n = cav_term_tolerances(p, &asked, 4, tolerance, NULL);
  snprintf(unit, 16, "%s", n == 1 ? tolerance[0].unit : "");
}

double cav_command_plain(double x) { return fabs(x) < 5e-7 ? 0 : x; }

/// The reading of a sensor at a posture, as it is compared; "-": it has none.
static void write_reading(const comparison *c, const cav_term *term, cav_state *state, double time, char *out) {
  const cav_sensor *s = &term->sensor;
  const cav_sensor_stage stage = cav_sensor_rule_of(s->type)->stage;
  double x[CAV_SENSOR_DIM_MAX], target[CAV_SENSOR_DIM_MAX] = {1}, phi[3];
  snprintf(out, CELL, "-");
  if (stage == CAV_READS_ACCELERATION || (stage == CAV_READS_VELOCITY && (state != c->start || c->p->free_start)))
    return;
  cav_sensor_read(c->p->model, state, s, x);
  if (s->dim == 4) {
    if (term->target) cav_term_target(term, time, 4, target);
    quat_normalise(target);
    cav_rotation_between(target, x, phi);
    snprintf(out, CELL, "%.4g off", cav_command_plain(term->component < 0 ? norm3(phi) : phi[term->component]));
  } else if (s->dim == 1 || term->component >= 0) {
    snprintf(out, CELL, "%.4g", cav_command_plain(x[s->dim == 1 ? 0 : term->component]));
  } else {
    snprintf(out, CELL, "%.4g %.4g %.4g", cav_command_plain(x[0]), cav_command_plain(x[1]), cav_command_plain(x[2]));
  }
}

/// The target of a sensor at a time.
static void write_target(const cav_term *term, double time, char *out) {
  const cav_sensor *s = &term->sensor;
  double target[CAV_SENSOR_DIM_MAX];
  const int one = s->dim == 1 || term->component >= 0, k = s->dim == 1 ? 0 : term->component;
  cav_term_target(term, time, s->dim, target);
  if (one)
    snprintf(out, CELL, "%.4g", cav_command_plain(target[k]));
  else
    snprintf(out, CELL, "%.4g %.4g %.4g", cav_command_plain(target[0]), cav_command_plain(target[1]),
             cav_command_plain(target[2]));
}

/// Targets at the begin and the end of a window, as one where they are the same.
static void write_both(const char *begin, const char *end, char *out) {
  if (strcmp(begin, end))
    snprintf(out, CELL, "from %.35s to %.35s", begin, end);
  else
    snprintf(out, CELL, "%s", end);
}

/// What is wanted of a sensor up to a time.
static void write_wanted(const cav_term *term, double time, char *out) {
  char begin[CELL], end[CELL];
  const int bounds = term->use == CAV_USE_RANGE && !term->target;
  if (bounds && isinf(term->upper))
    snprintf(out, CELL, ">= %.4g", term->lower);
  else if (bounds && isinf(term->lower))
    snprintf(out, CELL, "<= %.4g", term->upper);
  else if (bounds)
    snprintf(out, CELL, "%.4g .. %.4g", term->lower, term->upper);
  else if (term->sensor.dim == 4)
    snprintf(out, CELL, "0 off");
  else {
    write_target(term, term->from, begin);
    write_target(term, time, end);
    write_both(begin, end, out);
  }
}

/// The end of a term's window, at which its target is compared.
static double time_of(const cav_problem *p, const cav_term *term) {
  return term->to < 0 || term->to > p->duration ? p->duration : term->to;
}

/// Of the dofs that a posture term selects, how far q is from it at each, over the usual tolerance: d [nv]; the farthest.
static int farthest(const cav_problem *p, const cav_term *term, const double *wanted, const double *q, double *d) {
  const cav_model *m = p->model;
  int most = -1;
  cav_difference(m, wanted, q, 1, d);
  for (int i = 0; i < m->nv; i++) {
    const cav_joint *joint = &m->joint[m->dof[i].joint];
    const int free = joint->type == CAV_JOINT_FREE,
              line = joint->type == CAV_JOINT_SLIDE || (free && i < joint->dof + 3);
    const int selected = cav_problem_selects(m, term, i);
    d[i] = selected ? fabs(d[i]) / (line ? CAV_WITHIN_LENGTH : CAV_WITHIN_ANGLE) : -1;
    if (selected && (most < 0 || d[i] > d[most])) most = i;
  }
  return most;
}

/// A dof of a configuration: of what turns in three ways how far it is turned from what is wanted.
static void write_dof(const cav_model *m, const double *wanted, const double *q, int d, double *work, char *out) {
  const cav_joint *joint = &m->joint[m->dof[d].joint];
  const int place = d - joint->dof;
  if (joint->type == CAV_JOINT_BALL || (joint->type == CAV_JOINT_FREE && place >= 3)) {
    cav_difference(m, wanted, q, 1, work);
    snprintf(out, CELL, "%.4g off", cav_command_plain(work[d]));
  } else {
    snprintf(out, CELL, "%.4g", cav_command_plain(q[joint->q + place]));
  }
}

/// The posture that a term wants at a time.
static void find_wanted(const cav_problem *p, const cav_term *term, double time, double *wanted) {
  memcpy(wanted, p->q_goal, (size_t)p->model->nq * sizeof *wanted);
  if (!term->target) return;
  cav_term_target(term, time, p->model->nq, wanted);
  cav_configuration_normalise(p->model, wanted);
}

/// The row of a posture term: of the dof that is farthest off, at the start or at the goal. 0: the term selects none.
static int write_posture(const comparison *c, const cav_term *term, char name[NAME], char cell[3][CELL],
                         char unit[16]) {
  static const char *const axis[] = {" x", " y", " z", " turn x", " turn y", " turn z"};
  const cav_problem *p = c->p;
  const cav_model *m = p->model;
  double *wanted = c->work, *d = wanted + m->nq, *other = d + m->nv;
  char begin[CELL], end[CELL];
  find_wanted(p, term, time_of(p, term), wanted);
  const int a = farthest(p, term, wanted, p->q_start, d), b = farthest(p, term, wanted, p->q_goal, other);
  if (a < 0) return 0;
  const int at = other[b] > d[a] ? b : a;
  const cav_joint *joint = &m->joint[m->dof[at].joint];
  const int place = at - joint->dof, free = joint->type == CAV_JOINT_FREE, ball = joint->type == CAV_JOINT_BALL;
  const size_t used = strlen(name);
  if (term->dofs != CAV_DOFS_ONE || free || ball)
    snprintf(name + used, NAME - used, ", farthest %.40s%s", *joint->name ? joint->name : m->body[joint->body].name,
             free   ? axis[place]
             : ball ? axis[3 + place]
                    : "");
  write_dof(m, wanted, p->q_start, at, d, cell[0]);
  write_dof(m, wanted, p->q_goal, at, d, cell[1]);
  write_dof(m, wanted, wanted, at, d, end);
  find_wanted(p, term, term->from, wanted);
  write_dof(m, wanted, wanted, at, d, begin);
  write_both(begin, end, cell[2]);
  snprintf(unit, 16, "%s", joint->type == CAV_JOINT_SLIDE || (free && place < 3) ? "m" : "rad");
  if (term->use == CAV_USE_RANGE) snprintf(cell[2], CELL, "its bounds");
  return 1;
}

/// Name of a term, or what it is of.
static void write_name(const cav_problem *p, const cav_term *term, char name[NAME]) {
  const int sensor = term->quantity == CAV_QUANTITY_SENSOR;
  if (*term->name && strcmp(term->name, cav_quantity_rule_of(term->quantity)->name)) {
    snprintf(name, NAME, "'%.48s'", term->name);
  } else if (sensor) {
    snprintf(name, NAME, "%s of %.40s", cav_sensor_rule_of(term->sensor.type)->name,
             cav_object_name(p->model, term->sensor.object_type, term->sensor.object));
  } else {
    const char *quantity = cav_quantity_rule_of(term->quantity)->name;
    snprintf(name, NAME, "%s", quantity);
    if (term->dofs == CAV_DOFS_ONE) snprintf(name, NAME, "%s of %.40s", quantity, p->model->joint[term->joint].name);
  }
  const size_t used = strlen(name);
  if (sensor && term->component >= 0 && term->sensor.dim > 1)
    snprintf(name + used, NAME - used, " %c", "xyz"[term->component]);
}

/// The row of a term; 0: it has none.
static int write_row(const comparison *c, const cav_term *term, char name[NAME], char cell[3][CELL]) {
  const cav_problem *p = c->p;
  int reported, sensor = term->quantity == CAV_QUANTITY_SENSOR;
  char unit[16];
  if (!sensor && term->quantity != CAV_QUANTITY_CONFIGURATION) return 0;
  cav_term_tolerances(p, term, 0, NULL, &reported);
  if (!reported && !(sensor && term->target)) return 0;
  write_name(p, term, name);
  if (sensor) {
    const double time = time_of(p, term);
    unit_of(p, term, unit);
    write_reading(c, term, c->start, time, cell[0]);
    write_reading(c, term, c->goal, time, cell[1]);
    write_wanted(term, time, cell[2]);
  } else if (!write_posture(c, term, name, cell, unit)) {
    return 0;
  }
  const size_t used = strlen(name);
  if (*unit) snprintf(name + used, NAME - used, ", %s", unit);
  return 1;
}

/// Prints the rows, or notes how wide their cells are. Returns whether a posture has no reading of one.
static int go_through(const comparison *c, int width[4], int print) {
  char name[NAME], cell[3][CELL];
  int unread = 0;
  for (int i = 0; i < c->p->nterm; i++) {
    if (!write_row(c, &c->p->term[i], name, cell)) continue;
    const char *text[4] = {name, cell[0], cell[1], cell[2]};
    unread |= !strcmp(cell[0], "-") || !strcmp(cell[1], "-");
    for (int k = 0; k < 4 && !print; k++) width[k] = (int)fmax(width[k], (double)strlen(text[k]));
    if (print)
      printf("  %-*s  %*s  %*s  %*s\n", width[0], name, width[1], cell[0], width[2], cell[1], width[3], cell[2]);
  }
  return unread;
}

cav_status cav_command_print_asked(const cav_problem *p, cav_error *error) {
  const cav_model *m = p->model;
  comparison c = {p, cav_state_new(m), cav_state_new(m), calloc((size_t)(m->nq + 3 * m->nv) + 1, sizeof(double))};
  cav_status status = c.start && c.goal && c.work ? CAV_OK : CAV_NO_MEMORY;
  int width[4] = {0, (int)strlen("start"), (int)strlen("goal"), (int)strlen("wanted")}, before = width[0];
  if (!status) status = cav_position(m, c.goal, p->q_goal);
  // velocities are those after a step
  if (!status) status = cav_inverse(m, c.start, p->q_start, p->v_start, p->v_start, c.work);
  if (status) {
    *error = (cav_error){.status = status};
    snprintf(error->text, sizeof error->text, "start and goal cannot be compared with what is asked: %s",
             cav_status_name(status));
  } else {
    go_through(&c, width, 0);
    if (width[0] > before) {
      width[0] = (int)fmax(width[0], 22); // so wide is the heading
      printf("%-*s  %*s  %*s  %*s\n", width[0] + 2, "what start and goal have", width[1], "start", width[2], "goal",
             width[3], "wanted");
      if (go_through(&c, width, 1))
        printf("  -: not known of a posture: forces, and velocities but those of <start>\n");
    }
  }
  cav_state_free(c.start);
  cav_state_free(c.goal);
  free(c.work);
  return status;
}

/// Rotations of a hinge, and metres, from which on another unit is likely.
static const double many_turns = 4 * M_PI, far_away = 50;

/// "'knee'", or what the term is of, for a note.
static const char *called(const cav_problem *p, const cav_term *term, char name[NAME]) {
  cav_term whole = *term;
  if (*term->name) whole.component = -1;
  write_name(p, &whole, name);
  return name;
}

/// Of a hinge that is wanted at an angle of many turns.
static int tell_degrees(FILE *out, const cav_problem *p, const cav_term *term) {
  const cav_model *m = p->model;
  const int sensor = term->quantity == CAV_QUANTITY_SENSOR && term->sensor.type == CAV_SENSOR_JOINTPOS;
  const int posture = term->quantity == CAV_QUANTITY_CONFIGURATION && term->dofs == CAV_DOFS_ONE;
  char name[NAME];
  if ((!sensor && !posture) || !term->target || term->nwaypoint) return 0;
  const cav_joint *joint = &m->joint[sensor ? term->sensor.object : term->joint];
  const double wanted = joint->type == CAV_JOINT_HINGE ? term->target[sensor ? 0 : joint->q] : 0;
  if (!(fabs(wanted) > many_turns)) return 0;
  fprintf(out, "note: %s wants joint '%.60s' at %g rad, %.3g turns: %s; %g degrees are %.4g\n", called(p, term, name),
          joint->name, wanted, fabs(wanted) / (2 * M_PI),
          posture ? "qpos is in radians, degrees= is not" : "targets are in radians", wanted, wanted * M_PI / 180);
  return 1;
}

/// Of a place that is farther than motions go, and would not be if it was in millimetres.
static int tell_millimetres(FILE *out, const cav_problem *p, const cav_term *term) {
  const cav_sensor *s = &term->sensor;
  char name[NAME];
  double most = 0;
  if (term->quantity != CAV_QUANTITY_SENSOR || !term->target || term->nwaypoint) return 0;
  if (s->type != CAV_SENSOR_FRAMEPOS && s->type != CAV_SENSOR_SUBTREECOM) return 0;
  for (int k = 0; k < s->dim; k++)
    if ((term->component < 0 || term->component == k) && fabs(term->target[k]) > fabs(most)) most = term->target[k];
  if (!(fabs(most) > far_away)) return 0;
  fprintf(out, "note: %s wants a place at %g m: lengths are in m; %g mm are %g\n", called(p, term, name), most, most,
          most / 1000);
  return 1;
}

/// Of a touch that is asked for without a number: of none.
static int tell_touch(FILE *out, const cav_problem *p, const cav_term *term) {
  char name[NAME];
  if (term->quantity != CAV_QUANTITY_SENSOR || term->sensor.type != CAV_SENSOR_TOUCH || term->target) return 0;
  if (term->use == CAV_USE_RANGE || term->within > 0) return 0;
  fprintf(out,
          "note: %s has no target, which is 0 N: it is kept from touching. target=\"50\", in N, asks for a touch; "
          "within=\"5\" or a constraint upper=\"0\" has it untouched\n",
          called(p, term, name));
  return 1;
}

/// Of a term of free roots that has to be met and counts those of things beside those of bodies.
static int tell_things(FILE *out, const cav_problem *p, const cav_term *term) {
  const cav_model *m = p->model;
  const int angular = term->dofs == CAV_DOFS_ROOT_ANGULAR, velocity = term->quantity == CAV_QUANTITY_VELOCITY;
  int body = 0, thing = 0, things = 0;
  char name[NAME];
  if ((!velocity && term->quantity != CAV_QUANTITY_CONFIGURATION) || (!angular && term->dofs != CAV_DOFS_ROOT_LINEAR))
    return 0;
  for (int j = m->njoint - 1; j >= 0; j--) {
    if (m->joint[j].type != CAV_JOINT_FREE) continue;
    const int loose = !m->link[m->joint[j].link].driven;
    *(loose ? &thing : &body) = m->joint[j].body;
    things += loose;
  }
  if (!body || !things || !cav_term_tolerances(p, term, 0, NULL, NULL)) return 0;
  fprintf(out, "note: %s counts '%.48s'", called(p, term, name), m->body[thing].name);
  if (things > 1) fprintf(out, " and %d more", things - 1);
  fprintf(out, ", too, which no actuator moves: <sensor type=\"%s\" xbody=\"%.48s\"%s .../> is of '%.48s' alone\n",
          velocity  ? angular ? "frameangvel" : "framelinvel"
          : angular ? "framequat"
                    : "framepos",
          m->body[body].name, velocity || term->target ? "" : " relative=\"goal\"", m->body[body].name);
  return 1;
}

/// Whether all that a link can touch with rolls: balls, and what stands on a round side.
static int is_round(const cav_model *m, int link) {
  int n = 0;
  for (int g = 0; g < m->ngeom; g++) {
    const cav_geom *geom = &m->geom[g];
    if (geom->link != link || (!geom->contype && !geom->conaffinity)) continue;
    if (geom->type != CAV_GEOM_SPHERE && geom->type != CAV_GEOM_CAPSULE && geom->type != CAV_GEOM_ELLIPSOID) return 0;
    n++;
  }
  return n > 0;
}

/// Of a free thing that no actuator moves and that is asked for along the ground: that it may slide or roll has to be said.
static int tell_moved(FILE *out, const cav_problem *p) {
  const cav_model *m = p->model;
  cav_state *state = cav_state_new(m);
  cav_thing thing;
  const cav_status status = state ? cav_thing_find(p, 1, state, &thing) : CAV_NO_MEMORY;
  cav_state_free(state);
  if (status || thing.link == 0 || thing.joint >= 0 || thing.rise >= CAV_THING_WAY) return 0;
  const char *name = m->body[m->link[thing.link].body].name;
  const double far = hypot(thing.way[0], thing.way[1]);
  if (is_round(m, thing.link)) {
    if (!p->close_at_rest || p->cycle.on) return 0;
    fprintf(out,
            "note: '%.60s' is asked for %.2g m on, and all is at rest after the last knot: <horizon close=\"open\"/> "
            "where it "
            "may still roll then\n",
            name, far);
    return 1;
  }
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    const int whole = term->quantity == CAV_QUANTITY_SLIP && term->within > 0;
    if (whole && (!term->body || m->body[term->body].link == thing.link)) return 0;
  }
  fprintf(
      out,
      "note: '%.60s' is asked for %.2g m on: <slip body=\"%.60s\" weight=\"0\" within=\"any\"/> where it is to slide "
      "there; without it what touches it has to hold still, as when it is carried\n",
      name, far, name);
  return 1;
}

/// m, how far apart what rests on something may be from it; times its own friction from which on another one is told.
static const double resting = 2e-3, larger = 1.2;

/// Of a thing that slides where it rests with a larger friction than that of its own geom: of two that touch the larger counts.
static int tell_friction(FILE *out, const cav_problem *p) {
  const cav_model *m = p->model;
  cav_state *state = cav_state_new(m);
  cav_thing thing;
  cav_status status = state ? cav_thing_find(p, 1, state, &thing) : CAV_NO_MEMORY;
  // contacts are listed that are so far apart
  if (state) state->options.smoothing = resting;
  if (!status && thing.link) status = cav_position(m, state, p->q_start);
  int told = 0;
  for (int i = 0; !status && thing.link && i < state->ncontact && !told; i++) {
    const cav_contact *c = &state->contact[i];
    const cav_pair *pair = &m->pair[c->pair];
    const int first = c->link1 == thing.link && c->link2 == 0, second = c->link2 == thing.link && c->link1 == 0;
    if ((!first && !second) || c->dist > resting) continue;
    const cav_geom *own = &m->geom[first ? pair->geom1 : pair->geom2],
                   *other = &m->geom[first ? pair->geom2 : pair->geom1];
    if (!(pair->friction[0] > larger * own->friction[0])) continue;
    told = 1;
    fprintf(out,
            "note: '%.60s' slides on '%.60s' with a friction of %.3g: of two geoms that touch the larger counts, not "
            "its own "
            "%.3g, unless it has priority=\"1\"\n",
            m->body[m->link[thing.link].body].name, other->name && *other->name ? other->name : "the world",
            pair->friction[0], own->friction[0]);
  }
  cav_state_free(state);
  return told;
}

/// m or rad from the end of a joint's range in which its stop presses under a planned law.
static const double near_stop = 5e-3;

/// Of a constraint on the posture of a joint with an actuator that is at the end of its range: the stop presses there.
static int tell_stop(FILE *out, const cav_problem *p, const cav_term *term) {
  const cav_model *m = p->model;
  if (term->quantity != CAV_QUANTITY_CONFIGURATION || term->use != CAV_USE_EQUAL || term->nwaypoint) return 0;
  const double *q = term->target ? term->target : p->q_goal;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    const int scalar = joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE;
    const int meant =
        term->dofs == CAV_DOFS_ALL || term->dofs == CAV_DOFS_JOINTS || (term->dofs == CAV_DOFS_ONE && term->joint == j);
    if (!scalar || !meant || !joint->limited || !joint->driven) continue;
    const double at = q[joint->q], off = fmin(at - joint->range[0], joint->range[1] - at);
    if (!(off >= 0 && off < near_stop)) continue;
    const char *unit = joint->type == CAV_JOINT_SLIDE ? "m" : "rad";
    fprintf(out,
            "note: a <constraint> has joint '%.60s' at %.4g %s, %.2g from the end of its range, where its stop presses "
            "and plans "
            "keep %g clear: ask for it %g %s off the end, or by a cost\n",
            joint->name ? joint->name : "", at, unit, off, p->limit_margin, near_stop, unit);
    return 1;
  }
  return 0;
}

/// Parts of a step that a time may be off its knot untold.
static const double at_knot = 0.05;

/// Of one time that lies between knots.
static int tell_between(FILE *out, const cav_problem *p, const cav_term *term) {
  const double h = p->timestep, knot = round(term->from / h) * h;
  char name[NAME];
  if (term->from != term->to || term->to < 0 || p->duration_most > 0) return 0;
  if (fabs(knot - term->from) <= at_knot * h) return 0;
  fprintf(out, "note: %s is asked for at %g s, and knots are %g s apart: it counts at %g s, the nearest\n",
          called(p, term, name), term->from, h, knot);
  return 1;
}

/// Of a posture that puts a free body farther than motions go.
static int tell_far_root(FILE *out, const cav_problem *p, const double *q, const char *which) {
  for (int j = 0; j < p->model->njoint; j++) {
    const cav_joint *joint = &p->model->joint[j];
    if (joint->type != CAV_JOINT_FREE) continue;
    for (int k = 0; k < 3; k++) {
      if (!(fabs(q[joint->q + k]) > far_away)) continue;
      fprintf(out, "note: the %s has '%.60s' at %c %g m: lengths are in m; %g mm are %g\n", which,
              p->model->body[joint->body].name, "xyz"[k], q[joint->q + k], q[joint->q + k], q[joint->q + k] / 1000);
      return 1;
    }
  }
  return 0;
}

int cav_command_tell_units(FILE *out, const cav_problem *p) {
  int n = tell_far_root(out, p, p->q_start, "start");
  if (memcmp(p->q_start, p->q_goal, (size_t)p->model->nq * sizeof *p->q_goal))
    n += tell_far_root(out, p, p->q_goal, "goal");
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    n += tell_degrees(out, p, term) + tell_millimetres(out, p, term) + tell_touch(out, p, term) +
         tell_between(out, p, term) + tell_things(out, p, term) + tell_stop(out, p, term);
  }
  return n + tell_moved(out, p) + tell_friction(out, p);
}
