/// <guess> of a problem file: the way between start and goal, postures on it, stated or of a motion on file, sines over
/// joints, an arc. What a solver makes of it is solver/guess.c.
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "problem_file.h"

// <swing> of a guess
static cav_status read_swings(const cav_problem_reader *reader, const cav_xml_node *node) {
  cav_problem *p = reader->problem;
  const cav_xml_node *first = cav_problem_child(node, "swing");
  int n = 0;
  for (const cav_xml_node *swing = first; swing; swing = cav_xml_next(swing)) n++;
  if (n == 0) return CAV_OK;
  cav_swing *list = cav_problem_alloc(reader->owner, (size_t)n * sizeof *list);
  if (!list) return cav_problem_no_memory(reader);
  p->swing = list;
  for (const cav_xml_node *swing = first; swing; swing = cav_xml_next(swing)) {
    cav_swing *s = &list[p->nswing];
    s->joint = cav_problem_find(reader, swing, "joint", CAV_OBJECT_JOINT);
    if (s->joint < 0) return CAV_BAD_INPUT;
    cav_joint_type type = reader->model->joint[s->joint].type;
    if (type != CAV_JOINT_HINGE && type != CAV_JOINT_SLIDE) {
      return cav_xml_fail(reader->error, swing, "joint", "expected a hinge or a slide");
    }
    s->amplitude = cav_xml_real(swing, "amplitude", 0);
    s->frequency = cav_xml_real(swing, "frequency", 0);
    s->phase = cav_xml_real(swing, "phase", 0) * M_PI / 180;
    p->nswing++;
  }
  return CAV_OK;
}

// the same postures with joints that clipping moved in any of them as at the start; nothing where it moved none
static cav_status read_guess_left(const cav_problem_reader *reader, const cav_xml_node *waypoint) {
  cav_problem *p = reader->problem;
  size_t n = (size_t)p->nguess_pose, nq = (size_t)reader->model->nq;
  if (!memchr(reader->moved, 1, (size_t)reader->model->njoint)) return CAV_OK;
  cav_guess_pose *list = cav_problem_alloc(reader->owner, n * sizeof *list);
  double *q = cav_problem_alloc(reader->owner, n * nq * sizeof *q);
  if (!list || !q) return cav_problem_no_memory(reader);
  cav_problem_reader again = *reader;
  again.leave = 1;
  cav_status status = CAV_OK;
  for (size_t i = 0; i < n && !status; i++, waypoint = cav_xml_next(waypoint), q += nq) {
    list[i] = (cav_guess_pose){p->guess_pose[i].time, q};
    status = cav_problem_pose(&again, waypoint, q);
  }
  p->guess_left = list;
  return status;
}

// <waypoint> of a guess
static cav_status read_guess_poses(const cav_problem_reader *reader, const cav_xml_node *node) {
  cav_problem *p = reader->problem;
  const cav_model *m = reader->model;
  const cav_xml_node *first = cav_problem_child(node, "waypoint");
  int n = 0;
  for (const cav_xml_node *w = first; w; w = cav_xml_next(w)) n++;
  if (n == 0) return CAV_OK;
  if (p->guess != CAV_GUESS_INTERPOLATE)
    return cav_xml_fail(reader->error, first, NULL, "contradicts type='%s'; remove one of the two",
                        cav_problem_guesses[p->guess]);
  cav_guess_pose *list = cav_problem_alloc(reader->owner, (size_t)n * sizeof *list);
  double *q = cav_problem_alloc(reader->owner, (size_t)n * (size_t)m->nq * sizeof *q), before = 0;
  cav_problem_reader noting = *reader;
  noting.moved = cav_problem_alloc(reader->owner, (size_t)m->njoint + 1);
  if (!list || !q || !noting.moved) return cav_problem_no_memory(reader);
  p->guess_pose = list;
  for (const cav_xml_node *w = first; w; w = cav_xml_next(w), q += m->nq) {
    double time = cav_xml_real(w, "time", 0);
    if (!(time > before && time <= p->duration)) {
      return cav_xml_fail(reader->error, w, "time",
                          "expected a time after the posture before, %g s, and at the end, %g s, at the latest, got %g",
                          before, p->duration, time);
    }
    cav_status status = cav_problem_pose(&noting, w, q);
    if (status) return status;
    list[p->nguess_pose++] = (cav_guess_pose){time, q};
    before = time;
  }
  return read_guess_left(&noting, first);
}

// configuration and velocity of a motion at a time that it has: between knots along the step
static void sample(const cav_model *m, const cav_trajectory *motion, double time, double *q, double *v) {
  double at = fmax(time / motion->timestep, 0);
  size_t nq = (size_t)m->nq, nv = (size_t)m->nv, knot = (size_t)fmin(floor(at + CAV_WHOLE_STEP), motion->nknot - 1);
  double rest = at - (double)knot;
  int within = rest > CAV_WHOLE_STEP && (int)knot + 1 < motion->nknot;
  const double *step = motion->v + (knot + (size_t)within) * nv;
  memcpy(q, motion->q + knot * nq, nq * sizeof *q);
  if (within) cav_integrate(m, motion->q + knot * nq, step, rest * motion->timestep, q);
  if (v) memcpy(v, step, nv * sizeof *v);
}

// a motion on file as postures on the way, from `offset` of its time on; at the ends too where no one gives them
static cav_status read_guess_file(const cav_problem_reader *reader, const cav_xml_node *node) {
  cav_problem *p = reader->problem;
  if (!cav_xml_get(node, "file"))
    return cav_xml_get(node, "offset")
               ? cav_xml_fail(reader->error, node, "offset", "is a time of attribute 'file', which is missing")
               : CAV_OK;
  if (p->nguess_pose || p->guess != CAV_GUESS_INTERPOLATE)
    return cav_xml_fail(reader->error, node, "file", "contradicts %s; remove one of the two",
                        p->nguess_pose ? "<waypoint>" : "attribute 'type'");
  cav_error inner = {0};
  char *path = cav_file_beside(reader->path, cav_xml_text(node, "file", ""));
  cav_trajectory *motion = path ? cav_trajectory_read(path, reader->model, &inner) : NULL;
  free(path);
  if (!motion && inner.status) return cav_xml_fail_as(reader->error, inner.status, node, "file", "%s", inner.text);
  if (!motion) return cav_problem_no_memory(reader);
  double offset = cav_xml_real(node, "offset", 0), length = (motion->nknot - 1) * motion->timestep;
  size_t nq = (size_t)motion->nq, size = (size_t)motion->nknot * nq;
  cav_guess_pose *list = cav_problem_alloc(reader->owner, ((size_t)motion->nknot + 1) * sizeof *list);
  double *q = cav_problem_alloc(reader->owner, (size + nq) * sizeof *q);
  cav_status status = list && q ? CAV_OK : cav_problem_no_memory(reader);
  if (!status && !(offset > -p->duration && offset < length))
    status = cav_xml_fail(reader->error, node, "offset",
                          "expected a time at which the motion of the file is under way, it lasts %g s, got %g", length,
                          offset);
  if (!status) {
    memcpy(q, motion->q, size * sizeof *q);
    p->guess_pose = list;
    for (int t = 0; t < motion->nknot; t++) {
      double time = t * motion->timestep - offset;
      if (time > 0 && time < p->duration) list[p->nguess_pose++] = (cav_guess_pose){time, q + (size_t)t * nq};
    }
    if (p->free_start && offset >= 0) sample(reader->model, motion, offset, p->q_start, p->v_start);
    if (!cav_problem_child(reader->root, "goal") && offset + p->duration <= length * (1 + CAV_WHOLE_STEP)) {
      sample(reader->model, motion, offset + p->duration, q + size, NULL);
      list[p->nguess_pose++] = (cav_guess_pose){p->duration, q + size};
    }
  }
  cav_trajectory_free(motion);
  return status;
}

cav_status cav_problem_initial_guess(const cav_problem_reader *reader) {
  cav_problem *p = reader->problem;
  const cav_xml_node *node = cav_problem_child(reader->root, "guess");
  p->guess_from = 0;
  p->guess_to = p->duration;
  if (!node) return CAV_OK;
  p->guess = (cav_guess)cav_xml_word(node, "type", p->guess);
  double rotation[3] = {0};
  cav_xml_reals(node, "rotation", rotation, 3);
  for (int i = 0; i < 3; i++) p->guess_rotation[i] = rotation[i] * M_PI / 180;
  cav_xml_reals(node, "bow", p->guess_bow, 2);
  int turned = rotation[0] != 0 || rotation[1] != 0 || rotation[2] != 0 || p->guess_bow[0] != 0 || p->guess_bow[1] != 0;
  cav_status status = read_guess_poses(reader, node);
  if (!status) status = read_guess_file(reader, node);
  if (!status) status = read_swings(reader, node);
  if (!status) status = cav_problem_real(reader, node, "apex", 0, DBL_MAX, &p->guess_height);
  p->guess_ground = cav_xml_bool(node, "ground", 0);
  if (!status) status = cav_problem_window(reader, node, &p->guess_from, &p->guess_to);
  if (status) return status;
  if (p->guess_to < 0) p->guess_to = p->duration;
  if (p->guess_height == 0 && !turned && (cav_xml_get(node, "from") || cav_xml_get(node, "to"))) {
    return cav_xml_fail(reader->error, node, "apex",
                        "expected a height above 0 for the arc, a bow or a turn, between 'from' and 'to'");
  }
  return CAV_OK;
}
