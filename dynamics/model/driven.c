/// Trees that actuators move, by transmissions, and those that tendons and equality constraints join to them: a shoe that is
/// welded to a foot goes where the foot does. What is left (a box, a ball, a door) moves as contacts and gravity have it.
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

cav_status cav_links_drive(cav_model *model) {
  cav_link *link = (cav_link *)model->link;
  char *mark = calloc((size_t)model->nlink, 1);
  if (!mark) return CAV_NO_MEMORY;
  cav_roots_actuated(model, mark);
  while (cav_roots_join(model, mark)) continue;
  for (int l = 1; l < model->nlink; l++) link[l].driven = mark[link[l].root];
  free(mark);
  return CAV_OK;
}
