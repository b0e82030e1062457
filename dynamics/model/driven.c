/// Trees that actuators move, by transmissions, and those that tendons and equality constraints join to them: a shoe that is
/// welded to a foot goes where the foot does. What is left (a box, a ball, a door) moves as contacts and gravity have it.
/// Trees that equality constraints close to a loop are one mechanism (a gripper's fingers): its links touch each other as
/// those of one tree do.
#include "driven.h"

#include <stdlib.h>

static int mark_link(const cav_model *m, int link, char *mark) {
  if (link <= 0 || mark[m->link[link].root]) return 0;
  mark[m->link[link].root] = 1;
  return 1;
}

static void mark_actuator(const cav_model *m, const cav_actuator *actuator, char *mark) {
  const cav_tendon *tendon;
  switch (actuator->transmission) {
    case CAV_TRANSMISSION_JOINT:
    case CAV_TRANSMISSION_JOINT_IN_PARENT:
      mark_link(m, m->joint[actuator->target].link, mark);
      break;
    case CAV_TRANSMISSION_TENDON:
      tendon = &m->tendon[actuator->target];
      for (int k = 0; k < tendon->ndof; k++) mark_link(m, m->dof[m->tendon_dof[tendon->dof + k]].link, mark);
      break;
    case CAV_TRANSMISSION_SITE:
    case CAV_TRANSMISSION_CRANK:
      mark_link(m, m->site[actuator->target].link, mark);
      if (actuator->reference >= 0) mark_link(m, m->site[actuator->reference].link, mark);
      break;
  }
}

void cav_roots_actuated(const cav_model *model, char *mark) {
  for (int i = 0; i < model->nactuator; i++) mark_actuator(model, &model->actuator[i], mark);
}

// of two links: if one is marked both are
static int mark_both(const cav_model *m, int one, int other, char *mark) {
  int any = (one > 0 && mark[m->link[one].root]) || (other > 0 && mark[m->link[other].root]);
  return any ? mark_link(m, one, mark) | mark_link(m, other, mark) : 0;
}

int cav_roots_join(const cav_model *model, char *mark) {
  const cav_model *m = model;
  int changed = 0;
  for (int i = 0; i < m->ntendon; i++) {
    const int *dof = m->tendon_dof + m->tendon[i].dof;
    for (int k = 1; k < m->tendon[i].ndof; k++) changed |= mark_both(m, m->dof[dof[0]].link, m->dof[dof[k]].link, mark);
  }
  for (int i = 0; i < m->nequality; i++) {
    const cav_equality *e = &m->equality[i];
    int tendon = e->type == CAV_EQUALITY_TENDON, link[2] = {e->link[0], e->link[1]};
    for (int k = 0; k < 2 && (tendon || e->type == CAV_EQUALITY_JOINT); k++) {
      int dof = e->object[k] < 0 ? -1
                : tendon         ? m->tendon_dof[m->tendon[e->object[k]].dof]
                                 : m->joint[e->object[k]].dof;
      link[k] = dof < 0 ? 0 : m->dof[dof].link;
    }
    changed |= mark_both(m, link[0], link[1], mark);
  }
  return changed;
}

// a joint by its dof; a site's transmission works on all joints between it and the world
static void drive_dof(const cav_model *m, int dof) { ((cav_joint *)m->joint)[m->dof[dof].joint].driven = 1; }

static void drive_chain(const cav_model *m, int link) {
  for (int d = link > 0 ? m->link[link].dof + m->link[link].ndof - 1 : -1; d >= 0; d = m->dof[d].parent)
    drive_dof(m, d);
}

static void drive_joints(const cav_model *m, const cav_actuator *actuator) {
  const cav_tendon *tendon;
  switch (actuator->transmission) {
    case CAV_TRANSMISSION_JOINT:
    case CAV_TRANSMISSION_JOINT_IN_PARENT:
      drive_dof(m, m->joint[actuator->target].dof);
      break;
    case CAV_TRANSMISSION_TENDON:
      tendon = &m->tendon[actuator->target];
      for (int k = 0; k < tendon->ndof; k++) drive_dof(m, m->tendon_dof[tendon->dof + k]);
      break;
    case CAV_TRANSMISSION_SITE:
    case CAV_TRANSMISSION_CRANK:
      drive_chain(m, m->site[actuator->target].link);
      if (actuator->reference >= 0) drive_chain(m, m->site[actuator->reference].link);
      break;
  }
}

// the links that an equality constraint holds together; of tendons and distances: none
static void held_together(const cav_model *m, const cav_equality *e, int link[2]) {
  link[0] = link[1] = 0;
  for (int k = 0; k < 2; k++) {
    if (e->type == CAV_EQUALITY_CONNECT || e->type == CAV_EQUALITY_WELD) link[k] = e->link[k];
    if (e->type == CAV_EQUALITY_JOINT && e->object[k] >= 0) link[k] = m->joint[e->object[k]].link;
  }
}

// lowest root of the mechanism of each link; of trees that one constraint after the other joins
static void find_mechanisms(const cav_model *m, int *mechanism) {
  for (int l = 0; l < m->nlink; l++) mechanism[l] = m->link[l].root;
  for (int i = 0; i < m->nequality; i++) {
    int link[2];
    held_together(m, &m->equality[i], link);
    if (link[0] <= 0 || link[1] <= 0) continue;
    const int one = mechanism[link[0]], other = mechanism[link[1]], low = one < other ? one : other;
    for (int l = 0; l < m->nlink; l++)
      if (mechanism[l] == one || mechanism[l] == other) mechanism[l] = low;
  }
}

// whether a geom of the world is part of what carries the tree of a link: of a body that it hangs on, and no ground
static int carries(const cav_model *m, const cav_geom *geom, int link) {
  int at = m->link[m->link[link].root].body;
  if (geom->type == CAV_GEOM_PLANE || geom->type == CAV_GEOM_HFIELD) return 0;
  while (at > 0 && at != geom->body) at = m->body[at].parent;
  return geom->body > 0 && at == geom->body;
}

cav_status cav_pairs_sort(cav_model *model) {
  cav_pair *pair = (cav_pair *)model->pair;
  int *mechanism = malloc((size_t)model->nlink * sizeof *mechanism);
  if (!mechanism) return CAV_NO_MEMORY;
  find_mechanisms(model, mechanism);
  for (int i = 0; i < model->npair; i++) {
    const cav_geom *one = &model->geom[pair[i].geom1], *other = &model->geom[pair[i].geom2];
    if (one->link > 0 && other->link > 0)
      pair[i].external = mechanism[one->link] != mechanism[other->link];
    else
      pair[i].external = one->link == 0 ? !carries(model, one, other->link) : !carries(model, other, one->link);
  }
  free(mechanism);
  return CAV_OK;
}

cav_status cav_links_drive(cav_model *model) {
  cav_link *link = (cav_link *)model->link;
  char *mark = calloc((size_t)model->nlink, 1);
  if (!mark) return CAV_NO_MEMORY;
  for (int i = 0; i < model->nactuator; i++) drive_joints(model, &model->actuator[i]);
  cav_roots_actuated(model, mark);
  while (cav_roots_join(model, mark)) continue;
  for (int l = 1; l < model->nlink; l++) link[l].driven = mark[link[l].root];
  free(mark);
  return CAV_OK;
}
