/// What the commands say of a start or a goal that breaks equality constraints of the model. It is no proof: these are
/// soft and no certificate measures their errors, so a motion may begin off them and is drawn back. From 2 cm away it
/// may be certified, from 1 m it is thrown.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/dynamics.h"
#include "command.h"

// What is off by more than soft contacts are deep at most, and would be drawn back by more than ten times gravity: no
// load that hangs on a constraint explains it. By the softness that MJCF gives where none is stated that is 2 mm, so the
// first bound counts; a constraint as soft as a spring sags by more.
static const double apart = 0.01, turned = 0.05, load = 98.1, arm = 0.3; // m, rad, m/s^2, m of a turn's

/// How far an equality constraint is off: m, and rad; of a tendon m, of a joint as it moves. Zero where it holds.
typedef struct offset {
  double way, turn;
} offset;

static int is_turn(const cav_model *m, const cav_equality *e) {
  return e->type == CAV_EQUALITY_JOINT && m->joint[e->object[0]].type == CAV_JOINT_HINGE;
}

static offset offset_of(const cav_model *m, const cav_state *state, const cav_equality_rows *rows) {
  const cav_equality *e = &m->equality[rows->equality];
  double square[2] = {0}, pull[2] = {0};
  for (int k = 0; k < rows->dim; k++) {
    const double acceleration = rows->impulse[k] / state->options.timestep * e->weight[k >= 3];
    square[k >= 3] += rows->error[k] * rows->error[k];
    pull[k >= 3] += acceleration * acceleration;
  }
  double way = sqrt(square[0]), force = sqrt(pull[0]), turn = 0, twist = 0;
  if (rows->dim == 6 && e->torquescale > 0) {
    turn = 2 * asin(fmin(1, sqrt(square[1]) / e->torquescale));
    twist = 2 * sqrt(pull[1]) / e->torquescale;
  } else if (is_turn(m, e)) {
    turn = way, twist = force, way = 0;
  }
  offset off = {0};
  if (way > apart && force > load) off.way = way;
  if (turn > turned && twist * arm > load) off.turn = turn;
  return off;
}

static void name_object(const cav_model *m, const cav_equality *e, int side, char out[64]) {
  const int i = e->object[side];
  const char *name = NULL, *kind = "body";
  if (e->type == CAV_EQUALITY_JOINT) kind = "joint", name = i >= 0 ? m->joint[i].name : NULL;
  if (e->type == CAV_EQUALITY_TENDON) kind = "tendon", name = i >= 0 ? m->tendon[i].name : NULL;
  if (e->type == CAV_EQUALITY_DISTANCE) kind = "geom", name = m->geom[i].name;
  if (e->type == CAV_EQUALITY_CONNECT || e->type == CAV_EQUALITY_WELD) name = i > 0 ? m->body[i].name : "world";
  if (i < 0)
    snprintf(out, 64, "a number");
  else if (name && *name)
    snprintf(out, 64, "'%.48s'", name);
  else
    snprintf(out, 64, "%s %d", kind, i);
}

static void tell_offset(FILE *out, const cav_model *m, const cav_equality *e, int goal, offset off) {
  static const char *const kind[] = {"connect", "weld", "joint", "tendon", "distance"};
  char one[64], other[64], amount[2][40] = {"", ""};
  name_object(m, e, 0, one), name_object(m, e, 1, other);
  if (off.way > 0) snprintf(amount[0], sizeof amount[0], "%.3g m", off.way);
  if (off.turn > 0) snprintf(amount[1], sizeof amount[1], "%s%.3g rad", off.way > 0 ? " and " : "", off.turn);
  fprintf(out, "note: the %s breaks the equality constraint <%s", goal ? "goal" : "start", kind[e->type]);
  if (*e->name) fprintf(out, " name='%.48s'", e->name);
  fprintf(out, "> of %s and %s by %s%s: %s. Give a posture that keeps it", one, other, amount[0], amount[1],
          goal ? "a motion is drawn off it" : "the first steps are thrown by what draws them back");
  const int anchored = (e->type == CAV_EQUALITY_CONNECT || e->type == CAV_EQUALITY_WELD) && !e->placed;
  fprintf(out, "%s\n", anchored ? "; where no sites are named it is of the places in the model's file" : "");
}

static int tell_posture(FILE *out, const cav_problem *p, cav_state *state, const double *q, int goal) {
  const cav_model *m = p->model;
  double *none = calloc((size_t)(2 * m->nv + 1), sizeof *none);
  int n = 0;
  if (none && cav_inverse(m, state, q, none, none, none + m->nv) == CAV_OK) {
    for (int i = 0; i < state->nequality; i++) {
      const offset off = offset_of(m, state, &state->equality[i]);
      if (off.way == 0 && off.turn == 0) continue;
      tell_offset(out, m, &m->equality[state->equality[i].equality], goal, off);
      n++;
    }
  }
  free(none);
  return n;
}

int cav_command_tell_equalities(FILE *out, const cav_problem *p) {
  cav_state *state = p->model->nequality ? cav_state_new(p->model) : NULL;
  const int given = !p->cycle.on && !p->free_start;
  int n = 0;
  if (state && given) n = tell_posture(out, p, state, p->q_start, 0);
  // a goal that is the start's is not told twice
  const int same = given && !memcmp(p->q_goal, p->q_start, sizeof *p->q_goal * (size_t)p->model->nq);
  if (state && !same && !p->cycle.on) n += tell_posture(out, p, state, p->q_goal, 1);
  cav_state_free(state);
  return n;
}
