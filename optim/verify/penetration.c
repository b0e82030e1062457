/// How deep geoms are in each other: at the knots, and between them along the steps that the motion takes, q_t + s h
/// v_{t+1}, where what is thinner than a step is long could be passed through. A step is looked at so often that no
/// point of a moving geom goes farther than fine from one look to the next, or MOST times where it is longer.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "verification.h"

enum { MOST = 64 };

static const double fine = CAV_TOLERANCE_PENETRATION / 2; // m

void cav_verification_penetration(const cav_verification *verification, int t, const char *suffix, cav_metric *metric) {
  const cav_model *model = verification->model;
  char name1[CAV_GEOM_LABEL], name2[CAV_GEOM_LABEL];
  for (int i = 0; i < verification->state->ncontact; i++) {
    const cav_contact *contact = verification->state->contact + i;
    const cav_pair *pair = model->pair + contact->pair;
    cav_metric_note(metric, -contact->dist, t, "%.60s in %.60s%s", cav_geom_label(model, pair->geom2, name2),
                    cav_geom_label(model, pair->geom1, name1), suffix);
  }
}

// marks the moving geoms that may touch something
static void mark(const cav_model *model, char *touches) {
  memset(touches, 0, (size_t)model->ngeom);
  for (int p = 0; p < model->npair; p++) {
    touches[model->pair[p].geom1] = model->geom[model->pair[p].geom1].link > 0;
    touches[model->pair[p].geom2] = model->geom[model->pair[p].geom2].link > 0;
  }
}

// centre of a geom in the world
static void centre(const cav_geom *geom, const cav_pose *pose, double out[3]) {
  for (int k = 0; k < 3; k++) {
    const double *row = pose->rotation + 3 * k;
    out[k] = pose->pos[k] + row[0] * geom->pos[0] + row[1] * geom->pos[1] + row[2] * geom->pos[2];
  }
}

// how far points of a geom are apart at most between two poses of its link
static double travel(const cav_geom *geom, const cav_pose *from, const cav_pose *to) {
  double a[3], b[3];
  centre(geom, from, a);
  centre(geom, to, b);
  double cosine = fabs(from->quat[0] * to->quat[0] + from->quat[1] * to->quat[1] + from->quat[2] * to->quat[2] +
                       from->quat[3] * to->quat[3]);
  return hypot(hypot(b[0] - a[0], b[1] - a[1]), b[2] - a[2]) + 2 * acos(fmin(cosine, 1)) * geom->bound;
}

// into how many parts the step to the configuration of the bare state is cut; pose [nlink] is at its start
static int parts(const cav_verification *verification, const char *touches, const cav_pose *pose) {
  const cav_model *model = verification->model;
  double most = 0;
  for (int g = 0; g < model->ngeom; g++) {
    const cav_geom *geom = model->geom + g;
    if (touches[g]) most = fmax(most, travel(geom, pose + geom->link, verification->bare->link + geom->link));
  }
  return most < MOST * fine ? (int)ceil(most / fine) : MOST;
}

// looks at a configuration between knot t and the next, of a cycle also one period on; image [nq]
static cav_status look(const cav_verification *verification, int t, double fraction, const double *q, double *image,
                       cav_metric *metric) {
  char suffix[64];
  snprintf(suffix, sizeof suffix, ", at %.2g of the step to the next knot", fraction);
  cav_status status = cav_position(verification->model, verification->state, q);
  if (status == CAV_OK) cav_verification_penetration(verification, t, suffix, metric);
  if (status != CAV_OK || !verification->image) return status;
  snprintf(suffix, sizeof suffix, ", at %.2g of the step to the next knot, one period on", fraction);
  cav_cycle_image_configuration(verification->image, q, image);
  status = cav_position(verification->model, verification->state, image);
  if (status == CAV_OK) cav_verification_penetration(verification, t, suffix, metric);
  return status;
}

// the step from knot t; pose [nlink] becomes those of the next knot, work [2*nq]
static cav_status look_along(const cav_verification *verification, int t, const char *touches, cav_pose *pose,
                             double *work, cav_metric *metric) {
  const cav_model *model = verification->model;
  size_t nq = (size_t)model->nq, nv = (size_t)model->nv, knot = (size_t)t;
  const double *q = verification->q + knot * nq, *v = verification->v + (knot + 1) * nv;
  cav_status status = cav_position(model, verification->bare, q + nq);
  const int n = status == CAV_OK ? parts(verification, touches, pose) : 0;
  memcpy(pose, verification->bare->link, sizeof *pose * (size_t)model->nlink);
  for (int k = 1; k < n && status == CAV_OK; k++) {
    cav_integrate(model, q, v, verification->h * k / n, work);
    status = look(verification, t, (double)k / n, work, work + nq, metric);
  }
  return status;
}

cav_status cav_verification_between(const cav_verification *verification, cav_metric *metric) {
  const cav_model *model = verification->model;
  cav_pose *pose = malloc(sizeof *pose * (size_t)model->nlink);
  double *work = malloc(sizeof(double) * 2 * ((size_t)model->nq + 1));
  char *touches = malloc((size_t)model->ngeom + 1);
  cav_status status = pose && work && touches ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK) status = cav_position(model, verification->bare, verification->q);
  if (status == CAV_OK) {
    mark(model, touches);
    memcpy(pose, verification->bare->link, sizeof *pose * (size_t)model->nlink);
  }
  for (int t = 0; t < verification->last && status == CAV_OK; t++)
    status = look_along(verification, t, touches, pose, work, metric);
  free(pose);
  free(work);
  free(touches);
  return status;
}
