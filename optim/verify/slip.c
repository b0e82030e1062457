/// How fast loaded contacts slide, beyond what the problem asks: sums of load times speed over the knots, and where most of
/// it is.
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

void cav_slip_add(const cav_verification *verification, int t, cav_slip *slip) {
  for (int i = 0; i < verification->state->ncontact; i++) {
    const cav_contact *contact = verification->state->contact + i;
    const cav_pair *pair = verification->model->pair + contact->pair;
    double load = contact->impulse[0];
    if (contact->dim < 3 || !(load > loaded * verification->weight * verification->h)) continue;
    double speed = hypot(contact->velocity_next[1], contact->velocity_next[2]);
    double slides = load * fmax(speed - cav_verification_may_slide(verification, t, contact, 0), 0);
    slip->load += load;
    slip->slides += slides;
    if (joins_one_tree(verification->model, pair)) slip->own += slides;
    note_most(verification, t, pair, slides, load, speed, &slip->most);
  }
}
