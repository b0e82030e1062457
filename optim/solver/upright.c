/// What is pushed or carried tips over an edge while laws are soft, where helper forces and contacts that act at a distance
/// turn it as they like, and later stages do not bring it down again (METHOD.md, 7). A cost on its turn over the whole
/// motion keeps it as it stands.
#include "upright.h"

#include <math.h>
#include <stdio.h>

#include "quantity.h"

/// Weight of the terms; rad between start and goal up to which it is turned the same; m from which a goal has it elsewhere.
static const double weight = 100, same = 0.02, least_way = 0.02;

static int link_of(const cav_problem *p, const cav_term *term) {
  const cav_sensor *s = &term->sensor;
  return term->quantity == CAV_QUANTITY_SENSOR ? cav_object_link(p->model, s->object_type, s->object) : -1;
}

/// Whether terms or the goal want a free body elsewhere.
static int is_wanted(const cav_problem *p, const cav_joint *joint) {
  double way = 0;
  for (int k = 0; k < 3; k++) way += pow(p->q_goal[joint->q + k] - p->q_start[joint->q + k], 2);
  int wanted = sqrt(way) > least_way;
  for (int i = 0; i < p->nterm && !wanted; i++)
    wanted = cav_term_asks(&p->term[i]) && cav_term_placed(p->model, &p->term[i]) == joint->link;
  return wanted;
}

/// Whether a term tells how it is turned on the way.
static int is_told(const cav_problem *p, int link) {
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    const cav_sensor_type type = term->sensor.type;
    const int turn = type == CAV_SENSOR_FRAMEQUAT || type == CAV_SENSOR_FRAMEXAXIS || type == CAV_SENSOR_FRAMEYAXIS ||
                     type == CAV_SENSOR_FRAMEZAXIS;
    if (cav_term_asks(term) && turn && term->from != term->to && link_of(p, term) == link) return 1;
  }
  return 0;
}

/// Whether it is turned at the goal as at the start.
static int is_level(const cav_problem *p, const cav_joint *joint) {
  const double *a = p->q_start + joint->q + 3, *b = p->q_goal + joint->q + 3;
  const double w = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  return fabs(w) > cos(same / 2);
}

/// Whether it has a geom that does not roll whichever way it lies.
static int has_side(const cav_model *m, int link) {
  for (int g = 0; g < m->ngeom; g++)
    if (m->geom[g].link == link && m->geom[g].type != CAV_GEOM_SPHERE) return 1;
  return 0;
}

/// Whether a joint's body is one to keep upright.
static int is_kept(const cav_problem *p, const cav_joint *joint) {
  return !p->cycle.on && p->model->nu > 0 && joint->type == CAV_JOINT_FREE && !p->model->link[joint->link].driven &&
         is_level(p, joint) && has_side(p->model, joint->link) && is_wanted(p, joint) && !is_told(p, joint->link);
}

int cav_upright_terms(const cav_problem *p, cav_term *term) {
  const cav_model *m = p->model;
  int n = 0;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    if (!is_kept(p, joint)) continue;
    cav_term t = {.name = "upright", .quantity = CAV_QUANTITY_SENSOR, .use = CAV_USE_COST, .component = -1, .to = -1};
    t.sensor = (cav_sensor){.name = "", .type = CAV_SENSOR_FRAMEQUAT, .dim = 4, .object_type = CAV_OBJECT_XBODY};
    t.sensor.object = m->link[joint->link].body;
    t.target = p->q_start + joint->q + 3;
    t.scale = 1, t.weight = weight, t.within = INFINITY;
    if (term) term[n] = t;
    n++;
  }
  return n;
}

int cav_upright_held(const cav_problem *p) {
  const cav_model *m = p->model;
  int held = 0;
  for (int j = 0; j < m->njoint && !held; j++)
    for (int i = 0; i < p->nterm && !held && is_kept(p, &m->joint[j]); i++) {
      const cav_sensor *s = &p->term[i].sensor;
      held = p->term[i].quantity == CAV_QUANTITY_SENSOR && cav_term_asks(&p->term[i]) && s->referred &&
             cav_object_link(m, s->reference_type, s->reference) == m->joint[j].link;
    }
  return held;
}

void cav_upright_describe(const cav_problem *p, const cav_term *term, char *text, size_t size) {
  const double *q = term->target;
  const char *name = p->model->body[term->sensor.object].name;
  char target[80] = "";
  if (fabs(q[0]) < cos(same / 2))
    snprintf(target, sizeof target, " target=\"%.3g %.3g %.3g %.3g\"", q[0], q[1], q[2], q[3]);
  snprintf(text, size, ", <sensor type=\"framequat\" xbody=\"%.40s\"%s weight=\"%g\"/>", name ? name : "", target,
           term->weight);
}
