/// Forces inside a model, from the last evaluation of the inverse: what holds a body to its parent, and what presses on
/// a zone of its surface. The first is the balance of the body's subtree in the file, Newton-Euler for each of its
/// bodies less the contacts and equality constraints upon it, so it is there also for bodies that are fused into one
/// link. Springs, dampers, actuators, limits and friction of joints and tendons act between bodies of the tree and are
/// part of what it reports; so are, as in MuJoCo, drag of a fluid and lift against gravity, which act from outside.
#include "half_step.h"
#include "math3.h"
#include "sensor.h"

int cav_descends(const cav_model *model, int body, int from) {
  while (body > from) { body = model->body[body].parent; }
  return body == from;
}

void cav_point_acceleration(const cav_state *state, int link, const double point[3], double out[3]) {
  const double *V = state->velocity + 6 * link, *A = state->work->acceleration + 6 * link;
  double velocity[3];
  velocity_at(velocity, V, state->reference + 3 * link, point);
  velocity_at(out, A, state->reference + 3 * link, point);
  cross_add3(out, V, velocity);
}

// wrench at a point, that accelerates one body
static void add_inertial(const cav_state *state, const cav_body *body, const double point[3], double F[6]) {
  const double *V = state->velocity + 6 * body->link, *A = state->work->acceleration + 6 * body->link;
  cav_pose pose;
  double force[3], moment[3], spin[3], turn[3];
  cav_mass_pose(state, body, &pose);
  cav_point_acceleration(state, body->link, pose.pos, force);
  scale3(force, body->mass, force);
  push_at(F, point, pose.pos, force);

  // rate of the angular momentum in principal axes: I alpha + omega x I omega
  rotate_back(spin, pose.rotation, V);
  rotate_back(turn, pose.rotation, A);
  const double *I = body->inertia;
  double momentum[3] = {I[0] * spin[0], I[1] * spin[1], I[2] * spin[2]};
  set3(moment, I[0] * turn[0], I[1] * turn[1], I[2] * turn[2]);
  cross_add3(moment, spin, momentum);
  rotate(moment, pose.rotation, moment);
  add3(F, F, moment);
}

// wrench at a point of one contact on its second geom, scaled
static void add_contact(const cav_contact *c, const double point[3], double scale, double F[6]) {
  double force[3] = {0, 0, 0};
  for (int k = 0; k < c->dim && k < 3; k++) axpy3(force, force, scale * c->impulse[k], c->frame + 3 * k);
  for (int k = 3; k < c->dim; k++) axpy3(F, F, scale * c->impulse[k], c->frame + 3 * (k - 3));
  push_at(F, point, c->pos, force);
}

// wrench at a point of a connect, a weld or a distance on the body below, scaled
static void add_equality(const cav_model *model, const cav_equality_rows *eq, int body, const double point[3],
                         double scale, double F[6]) {
  const cav_equality *e = &model->equality[eq->equality];
  if (e->type == CAV_EQUALITY_JOINT || e->type == CAV_EQUALITY_TENDON) { return; }
  for (int k = 0; k < 2; k++) {
    int on = e->type == CAV_EQUALITY_DISTANCE ? model->geom[e->object[k]].body : e->object[k];
    if (!cav_descends(model, on, body)) { continue; }
    double force[3], moment[3], sign = k ? -scale : scale;
    if (eq->dim == 1) {
      scale3(force, sign * eq->impulse[0], eq->normal);
    } else {
      scale3(force, sign, eq->impulse);
    }
    push_at(F, point, eq->point[k], force);
    if (eq->dim < 6) { continue; }
    rotate_back(moment, eq->rotation, eq->impulse + 3);
    axpy3(F, F, sign, moment);
  }
}

void cav_body_wrench(const cav_model *model, const cav_state *state, int body, const double point[3], double F[6]) {
  zero3(F);
  zero3(F + 3);
  for (int i = body; i < model->nbody; i++) {
    if (cav_descends(model, i, body)) { add_inertial(state, &model->body[i], point, F); }
  }
  // what the inertial forces of whole trees lack of their change of momentum
  for (int i = 1; i < model->nlink && state->options.order == CAV_ORDER_MOMENTUM; i++) {
    const double *missing = state->work->half_steps->missing + 6 * i;
    if (model->link[i].root != i || !cav_descends(model, model->link[i].body, body)) { continue; }
    push_at(F, point, state->reference + 3 * i, missing + 3);
    add3(F, F, missing);
  }
  double inverse_h = 1 / state->options.timestep;
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    const cav_pair *pair = &model->pair[c->pair];
    int first = cav_descends(model, model->geom[pair->geom1].body, body);
    int second = cav_descends(model, model->geom[pair->geom2].body, body);
    if (first != second) { add_contact(c, point, second ? -inverse_h : inverse_h, F); }
  }
  for (int i = 0; i < state->nequality; i++) add_equality(model, &state->equality[i], body, point, -inverse_h, F);
}

int cav_touch_sees(const cav_model *model, const cav_sensor *sensor, int geom) {
  const cav_geom *g = &model->geom[geom];
  if (sensor->object_type == CAV_OBJECT_GEOM) { return geom == sensor->object; }
  if (sensor->object_type == CAV_OBJECT_SITE) { return g->body == model->site[sensor->object].body; }
  return g->link == model->body[sensor->object].link && cav_descends(model, g->body, sensor->object);
}

// the zone of a site
static cav_shape zone_of(const cav_model *model, const cav_state *state, int site) {
  const cav_site *zone = &model->site[site];
  cav_pose pose;
  cav_object_pose(model, state, CAV_OBJECT_SITE, site, &pose);
  cav_shape shape = {.type = zone->type, .size = zone->size};
  copy3(shape.pos, pose.pos);
  memcpy(shape.rotation, pose.rotation, sizeof shape.rotation);
  return shape;
}

int cav_touch_next(const cav_model *model, const cav_state *state, const cav_sensor *sensor, int first) {
  const int zoned = sensor->object_type == CAV_OBJECT_SITE;
  cav_shape zone = {0};
  if (zoned) { zone = zone_of(model, state, sensor->object); }
  for (; first < state->ncontact; first++) {
    const cav_contact *c = &state->contact[first];
    const cav_pair *pair = &model->pair[c->pair];
    const int felt1 = cav_touch_sees(model, sensor, pair->geom1), felt2 = cav_touch_sees(model, sensor, pair->geom2);
    if ((!felt1 && !felt2) || !(c->impulse[0] > 0)) { continue; }
    // a knee that presses on the other leg bears nothing; what a site feels is MuJoCo's
    const int within = c->link1 > 0 && c->link2 > 0 && model->link[c->link1].root == model->link[c->link2].root;
    if (!zoned && within) { continue; }
    // within the zone, or the normal away from the body runs into it
    double out[3];
    scale3(out, felt2 ? -1 : 1, c->frame);
    if (!zoned || cav_ray(&zone, c->pos, out) >= 0) { break; }
  }
  return first;
}

double cav_touch_force(const cav_model *model, const cav_state *state, const cav_sensor *sensor) {
  double impulse = 0;
  for (int i = cav_touch_next(model, state, sensor, 0); i < state->ncontact;
       i = cav_touch_next(model, state, sensor, i + 1)) {
    impulse += state->contact[i].impulse[0];
  }
  return impulse / state->options.timestep;
}
