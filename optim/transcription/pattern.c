/// Which unknowns a constraint row can depend on, from the structure of the model alone: the force of a dof sees the
/// dofs above and below it in its tree, those that share a tendon with it, and those across a pair of geoms that may
/// touch.
#include <stdlib.h>
#include <string.h>

#include "transcription.h"

/// Whether a dof moves a link: it stands on the link's way to the root.
static int moves(const cav_model *m, int dof, int link) {
  for (int l = link; l > 0; l = m->link[l].parent)
    if (m->dof[dof].link == l) return 1;
  return 0;
}

/// Dofs that a force along dof i depends on, [nv]. Rotations of one joint count together.
static void force_pattern(const cav_transcription *tr, int i, char *seen) {
  const cav_model *m = tr->model;
  int own = m->dof[i].link;
  for (int j = 0; j < m->nv; j++) seen[j] |= (char)(moves(m, i, m->dof[j].link) || moves(m, j, own));
  for (int k = 0; k < m->npair; k++) {
    // a contact turns about nothing that moves both its links
    int a = m->geom[m->pair[k].geom1].link, b = m->geom[m->pair[k].geom2].link;
    if (moves(m, i, a) == moves(m, i, b)) continue;
    for (int j = 0; j < m->nv; j++) seen[j] |= (char)(moves(m, j, a) != moves(m, j, b));
  }
  for (int k = 0; k < m->ntendon; k++) {
    const int *dof = m->tendon_dof + m->tendon[k].dof;
    int n = m->tendon[k].ndof, in = 0;
    int acts = m->tendon[k].limited || m->tendon[k].stiffness != 0 || m->tendon[k].damping != 0 ||
               m->tendon[k].frictionloss != 0;
    for (int c = 0; acts && c < n; c++) in |= dof[c] == i;
    for (int c = 0; in && c < n; c++) seen[dof[c]] = 1;
  }
}

static void subtree_pattern(const cav_model *m, int link, char *seen) {
  for (int j = 0; j < m->nv; j++) seen[j] |= (char)(moves(m, j, link) || link == 0);
  for (int l = link; l < m->nlink; l++) {
    int below = 0;
    for (int up = l; up > 0; up = m->link[up].parent) below |= up == link;
    for (int d = 0; below && d < m->link[l].ndof; d++) seen[m->link[l].dof + d] = 1;
  }
}

/// Dofs that move an object's frame.
static void frame_pattern(const cav_model *m, cav_object_type type, int object, char *seen) {
  int link = cav_object_link(m, type, object);
  for (int j = 0; j < m->nv; j++) seen[j] |= (char)moves(m, j, link);
}

/// Dofs that a transmission or a limit sees: of a joint, or of all joints of a tendon.
static void joint_pattern(const cav_model *m, int joint, char *seen) {
  for (int j = 0; j < m->nv; j++) seen[j] |= (char)(m->dof[j].joint == joint);
}

static void tendon_pattern(const cav_model *m, int tendon, char *seen) {
  const cav_tendon *t = &m->tendon[tendon];
  for (int k = 0; k < t->ndof; k++) seen[m->tendon_dof[t->dof + k]] = 1;
}

/// Dofs that move either geom of a pair that may touch a link.
static void touch_pattern(const cav_model *m, int link, char *seen) {
  for (int k = 0; k < m->npair; k++) {
    int a = m->geom[m->pair[k].geom1].link, b = m->geom[m->pair[k].geom2].link;
    if (a != link && b != link) continue;
    for (int j = 0; j < m->nv; j++) seen[j] |= (char)(moves(m, j, a) || moves(m, j, b));
  }
}

static void site_pattern(const cav_model *m, const cav_sensor *sensor, char *seen) {
  int link = m->site[sensor->object].link;
  switch (sensor->type) {
    case CAV_SENSOR_RANGEFINDER:
      // any geom may be the nearest
      memset(seen, 1, (size_t)m->nv);
      return;
    case CAV_SENSOR_FORCE:
    case CAV_SENSOR_TORQUE:
      // all that stands on the body, and what touches that
      subtree_pattern(m, link, seen);
      for (int l = link; l < m->nlink; l++) {
        int up = l;
        while (up > link) up = m->link[up].parent;
        if (up == link) touch_pattern(m, l, seen);
      }
      break;
    default:
      break;
  }
  frame_pattern(m, CAV_OBJECT_SITE, sensor->object, seen);
}

static void actuator_pattern(const cav_transcription *tr, const cav_sensor *sensor, char *seen) {
  const cav_model *m = tr->model;
  const cav_actuator *a = &m->actuator[sensor->object];
  if (sensor->type == CAV_SENSOR_ACTUATORFRC) {
    memset(seen, 1, (size_t)m->nv); // fractions of u among all actuators
  } else if (a->transmission == CAV_TRANSMISSION_TENDON) {
    tendon_pattern(m, a->target, seen);
  } else {
    joint_pattern(m, a->target, seen);
  }
}

/// Dofs of a sensor, and the last stage of an evaluation that it reads.
static cav_sensor_stage sensor_pattern(const cav_transcription *tr, const cav_sensor *sensor, char *seen) {
  const cav_model *m = tr->model;
  const cav_sensor_rule *rule = cav_sensor_rule_of(sensor->type);
  switch (rule->target) {
    case CAV_TARGET_NONE:
      break;
    case CAV_TARGET_SCALAR_JOINT:
    case CAV_TARGET_BALL_JOINT:
    case CAV_TARGET_LIMITED_JOINT:
      joint_pattern(m, sensor->object, seen);
      // fractions of u among all actuators
      if (sensor->type == CAV_SENSOR_JOINTACTUATORFRC) memset(seen, 1, (size_t)m->nv);
      break;
    case CAV_TARGET_TENDON:
    case CAV_TARGET_LIMITED_TENDON:
      tendon_pattern(m, sensor->object, seen);
      break;
    case CAV_TARGET_ACTUATOR:
      actuator_pattern(tr, sensor, seen);
      break;
    case CAV_TARGET_SITE:
      site_pattern(m, sensor, seen);
      break;
    case CAV_TARGET_SURFACE:
      touch_pattern(m, cav_object_link(m, sensor->object_type, sensor->object), seen);
      frame_pattern(m, sensor->object_type, sensor->object, seen);
      break;
    case CAV_TARGET_BODY:
      subtree_pattern(m, m->body[sensor->object].link, seen);
      break;
    case CAV_TARGET_FRAME:
      frame_pattern(m, sensor->object_type, sensor->object, seen);
      if (sensor->referred) frame_pattern(m, sensor->reference_type, sensor->reference, seen);
      break;
  }
  return rule->stage;
}

/// Rotations of one joint are chained by full 3x3 blocks.
static void spread_rotations(const cav_transcription *tr, char *seen) {
  for (int k = 0; k < tr->nrotation; k++) {
    char *s = seen + tr->rotation_dof[k], any = (char)(s[0] | s[1] | s[2]);
    s[0] = s[1] = s[2] = any;
  }
}

/// Block c: 0 q_{t-1}, 1 q_t, 2 q_{t+1}, where those are unknowns. seen may be block 1.
static void put(const cav_transcription *tr, int t, const char *seen, int from, int to, char *pattern) {
  char *scratch = pattern + 3 * tr->nv;
  memcpy(scratch, seen, (size_t)tr->nv);
  for (int c = from; c <= to; c++) {
    int knot = t + c - 1;
    if (cav_transcription_block(tr, t, c) < 0) continue;
    if (tr->periodicity && (knot < 1 || knot >= tr->nknot)) {
      cav_periodicity_pattern(tr->periodicity, knot < 1 ? 1 : -1, scratch, pattern + c * tr->nv);
    } else {
      memcpy(pattern + c * tr->nv, scratch, (size_t)tr->nv);
    }
  }
}

/// The hard term and component behind row i of the term rows of knot t.
static const cav_term *term_of(const cav_transcription *tr, int t, int i, int *component) {
  for (int k = 0; k < tr->problem->nterm; k++) {
    const cav_term *term = &tr->problem->term[k];
    if (term->use == CAV_USE_COST || cav_term_weight(tr, term, t) == 0) continue;
    int n = cav_term_dim(term);
    for (int d = 0; !cav_term_is_reading(term) && d < tr->nv; d++) {
      if (!cav_dof_selected(tr, term, d)) continue;
      if (n++ == i) *component = d;
    }
    if (i < n) return term;
    i -= n;
  }
  return NULL;
}

void cav_transcription_pattern(const cav_transcription *tr, int t, int i, char *pattern) {
  const cav_model *m = tr->model;
  const cav_slot_layout *at = &tr->knot[t].layout;
  char *seen = pattern + tr->nv; // block of q_t serves as the list
  memset(pattern, 0, 3 * (size_t)tr->nv);
  if (i < at->joint) {
    const cav_force_row *row = i < at->effort ? &tr->unactuated[i] : &tr->effort[i - at->effort];
    for (int k = 0; k < row->n; k++) force_pattern(tr, row->dof[k], seen);
    spread_rotations(tr, seen);
    put(tr, t, seen, 0, 2, pattern);
  } else if (i < at->tendon) {
    int joint = 0;
    for (int left = i - at->joint; left >= 0; joint++) left -= m->joint[joint].limited;
    for (int d = 0; d < m->nv; d++) seen[d] = m->dof[d].joint == joint - 1;
  } else if (i < at->term) {
    int tendon = 0;
    for (int left = i - at->tendon; left >= 0; tendon++) left -= m->tendon[tendon].limited;
    const cav_tendon *of = &m->tendon[tendon - 1];
    for (int k = 0; k < of->ndof; k++) seen[m->tendon_dof[of->dof + k]] = 1;
  } else {
    int dof = 0;
    const cav_term *term = term_of(tr, t, i - at->term, &dof);
    if (!term) return;
    if (cav_term_is_reading(term)) {
      int own = term->quantity == CAV_QUANTITY_USER;
      cav_sensor_stage stage = own ? term->user->reads : sensor_pattern(tr, &term->sensor, seen);
      if (own) memset(seen, 1, (size_t)m->nv); // what it looks at it alone knows
      spread_rotations(tr, seen);
      int open = t == tr->nknot - 1 && !tr->problem->close_at_rest && !tr->periodicity; // there v_next is v_t
      int moving = stage != CAV_READS_POSITION, before = stage == CAV_READS_ACCELERATION || (moving && open);
      put(tr, t, seen, before ? 0 : 1, moving ? 2 : 1, pattern);
    } else {
      seen[dof] = 1;
      spread_rotations(tr, seen);
      int rate = term->quantity == CAV_QUANTITY_ACCELERATION, moving = rate || term->quantity == CAV_QUANTITY_VELOCITY;
      put(tr, t, seen, moving ? 0 : 1, rate ? 2 : 1, pattern);
    }
  }
  if (cav_transcription_block(tr, t, 1) < 0) memset(pattern + tr->nv, 0, (size_t)tr->nv);
}
