/// How fast loaded contacts slide, beyond what the problem asks: sums of load times speed over the knots, and where most of
/// it is. The speed is that of the law at the knot, J v'; beside it the way of the contact's point from the knot to the next
/// (dynamics/METHOD.md, 13), which is longer by what the links turn: half a step of the point's acceleration.
#include <math.h>

#include "verification.h"

static const double loaded = 0.01; // fraction of the weight from which on a contact is loaded

static int joins_one_tree(const cav_model *model, const cav_pair *pair) {
  const cav_geom *a = &model->geom[pair->geom1], *b = &model->geom[pair->geom2];
  return model->link[a->link].root == model->link[b->link].root;
}

static void note_most(const cav_verification *verification, int t, const cav_pair *pair, double slides, double load,
                      double speed, cav_metric *most) {
  const cav_model *model = verification->model;
  char one[32], other[32];
  if (!(slides > most->value)) return;
  cav_metric_note(most, slides, t,
                  "mean over loaded contacts, most where %.4g N between %.60s and %.60s slides at %.3g m/s",
                  load / verification->h, cav_verification_link_name(model, model->geom[pair->geom1].link, one),
                  cav_verification_link_name(model, model->geom[pair->geom2].link, other), speed);
}

// where a point of a link at one pose is at another
static void carry(const cav_pose *from, const cav_pose *to, const double point[3], double carried[3]) {
  double local[3];
  for (int k = 0; k < 3; k++) {
    local[k] = 0;
    for (int c = 0; c < 3; c++) local[k] += from->rotation[3 * c + k] * (point[c] - from->pos[c]);
  }
  for (int k = 0; k < 3; k++) {
    carried[k] = to->pos[k];
    for (int c = 0; c < 3; c++) carried[k] += to->rotation[3 * k + c] * local[c];
  }
}

// speed along the tangents by the way of the contact's point to the next knot, whose poses are in the bare state
static double speed_over_step(const cav_verification *verification, const cav_contact *contact) {
  const cav_state *now = verification->state, *then = verification->bare;
  double first[3], second[3], way[3], seen[3], speed[2];
  carry(&now->link[contact->link1], &then->link[contact->link1], contact->pos, first);
  carry(&now->link[contact->link2], &then->link[contact->link2], contact->pos, second);
  for (int k = 0; k < 3; k++) way[k] = second[k] - first[k];
  // as the first link sees it, turned back with it
  const double *R = now->link[contact->link1].rotation, *T = then->link[contact->link1].rotation;
  for (int i = 0; i < 3; i++) {
    seen[i] = 0;
    for (int k = 0; k < 3; k++)
      for (int c = 0; c < 3; c++) seen[i] += R[3 * i + c] * T[3 * k + c] * way[k];
  }
  for (int i = 0; i < 2; i++) {
    const double *tangent = contact->frame + 3 * (i + 1);
    speed[i] = (tangent[0] * seen[0] + tangent[1] * seen[1] + tangent[2] * seen[2]) / verification->h;
  }
  return hypot(speed[0], speed[1]);
}

cav_status cav_slip_add(const cav_verification *verification, int t, double *q, cav_slip *slip) {
  const cav_model *model = verification->model;
  const double *v = verification->v + (size_t)t * (size_t)model->nv;
  int placed = 0;
  for (int i = 0; i < verification->state->ncontact; i++) {
    const cav_contact *contact = verification->state->contact + i;
    const cav_pair *pair = model->pair + contact->pair;
    double load = contact->impulse[0];
    if (contact->dim < 3 || !(load > loaded * verification->weight * verification->h)) continue;
    if (!placed) {
      cav_integrate(model, verification->q + (size_t)t * (size_t)model->nq, v + model->nv, verification->h, q);
      cav_status status = cav_position(model, verification->bare, q);
      if (status != CAV_OK) return status;
      placed = 1;
    }
    double speed = hypot(contact->velocity_next[1], contact->velocity_next[2]);
    double may = cav_verification_may_slide(verification, t, contact, 0), slides = load * fmax(speed - may, 0);
    slip->load += load;
    slip->slides += slides;
    slip->carried += load * fmax(speed_over_step(verification, contact) - may, 0);
    if (joins_one_tree(model, pair)) slip->own += slides;
    note_most(verification, t, pair, slides, load, speed, &slip->most);
  }
  return CAV_OK;
}
