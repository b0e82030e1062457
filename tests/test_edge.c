/// Forces at edges of boxes of the world: how near a contact is, against its closed form on a face, at an edge and at a
/// corner; its gradient against differences; edges where the next box, the ground or another box begin are none, at the
/// same height and below; how the place of a contact moves with the posture, against differences. And a scene without
/// boxes has no rows of them, while a foot across an edge has.
#include "edge.h"
#include "transcription.h"

#include "quantity.h"
#include "scene.h"

/// Two steps of 0.2 m, the second beside the first and twice as high; a beam of 4 cm and 4 cm height, away from both and turned.
static const char scene[] =
    "<mujoco><worldbody><geom type='plane' size='1 1 1'/>"
    "<geom name='one' type='box' pos='0 0 .1' size='.3 .5 .1'/><geom name='two' type='box' pos='.6 0 .2' size='.3 .5 "
    ".2'/>"
    "<geom name='beam' type='box' pos='5 1 .02' euler='0 0 90' size='.5 .02 .02'/>"
    "<body name='foot' pos='0 0 .25'><freejoint/><geom name='sole' type='capsule' size='.03' fromto='-.1 0 0 .1 .02 "
    "0'/>"
    "</body></worldbody></mujoco>";

static int pair_with(const cav_model *m, const char *box) {
  for (int i = 0; i < m->npair; i++)
    if (!strcmp(m->geom[m->pair[i].geom1].name, box) || !strcmp(m->geom[m->pair[i].geom2].name, box)) return i;
  return -1;
}

static double nearness(const cav_model *m, const cav_edges *edges, const char *box, double x, double y, double z) {
  cav_contact c = {.pair = pair_with(m, box), .pos = {x, y, z}};
  double gradient[3];
  if (!CHECK(c.pair >= 0)) return NAN;
  double value = cav_edge_nearness(m, edges, &c, gradient);
  for (int k = 0; k < 3; k++) {
    const double e = 1e-6, at = c.pos[k];
    c.pos[k] = at + e;
    double up = cav_edge_nearness(m, edges, &c, NULL);
    c.pos[k] = at - e;
    double down = cav_edge_nearness(m, edges, &c, NULL);
    c.pos[k] = at;
    CHECK_NEAR(gradient[k], (up - down) / (2 * e), 1e-3);
  }
  return value;
}

// half way between 5 and 30 mm a cubic from one to zero is a half
static void test_nearness(const cav_model *m) {
  cav_edges *edges = cav_edges_new(m);
  if (!CHECK(edges && cav_edges_any(edges, m))) return;
  CHECK_NEAR(nearness(m, edges, "one", 0, 0, 0.2), 0, 0);
  CHECK_NEAR(nearness(m, edges, "one", -0.296, 0, 0.2), 1, 1e-12);
  CHECK_NEAR(nearness(m, edges, "one", -0.2825, 0, 0.2), 0.5, 1e-12);
  CHECK_NEAR(nearness(m, edges, "one", -0.269, 0, 0.2), 0, 1e-12);
  CHECK_NEAR(nearness(m, edges, "one", 0, 0.4825, 0.2), 0.5, 1e-12);
  CHECK_NEAR(nearness(m, edges, "one", -0.31, 0, 0.205), 1, 1e-12);
  CHECK_NEAR(nearness(m, edges, "one", -0.3, 0.5, 0.2), 3, 1e-12);
  // the second step begins at the end of the first, whose top is no edge there; its own is one, and its front is open above
  CHECK_NEAR(nearness(m, edges, "one", 0.29, 0, 0.2), 0, 1e-12);
  CHECK_NEAR(nearness(m, edges, "two", 0.31, 0, 0.4), 0.896, 1e-12);
  // on the ground
  CHECK_NEAR(nearness(m, edges, "one", -0.3, 0, 0.001), 0, 1e-12);
  // a beam 4 cm wide is no edge in the middle of its top, and its own axes count
  CHECK_NEAR(nearness(m, edges, "beam", 5, 1, 0.04), 0, 1e-12);
  CHECK_NEAR(nearness(m, edges, "beam", 5.016, 1, 0.04), 1, 1e-12);
  CHECK_NEAR(nearness(m, edges, "beam", 5, 1.3, 0.04), 0, 1e-12);
  cav_edges_free(edges);
}

// the place of every contact, by every dof
static void test_place(const cav_model *m) {
  cav_state *s = cav_state_new(m), *other = cav_state_new(m);
  int nv = m->nv, seen = 0;
  double q[7] = {-0.25, 0.03, 0.227, 1, 0.02, 0.01, 0.1}, v[6] = {0}, u[6], *du = scene_vector(3 * nv * nv), place[18];
  cav_integrate(m, q, v, 0, q);
  CHECK(cav_inverse(m, s, q, v, v, u) == CAV_OK);
  CHECK(cav_derivatives(m, s, du, du + nv * nv, du + 2 * nv * nv) == CAV_OK);
  for (int i = 0; i < s->ncontact; i++) {
    cav_contact c = s->contact[i];
    CHECK(cav_contact_derivatives(m, s, i, &(cav_contact_derivative){.pos_dq = place}) == CAV_OK);
    for (int d = 0; d < nv; d++) {
      double step[6] = {0}, moved[7], pos[2][3];
      int found = 0;
      for (int side = 0; side < 2; side++) {
        step[d] = side ? 1e-6 : -1e-6;
        cav_integrate(m, q, step, 1, moved);
        CHECK(cav_inverse(m, other, moved, v, v, u) == CAV_OK);
        for (int k = 0; k < other->ncontact; k++)
          if (other->contact[k].pair == c.pair && other->contact[k].feature == c.feature)
            memcpy(pos[side], other->contact[k].pos, sizeof pos[side]), found++;
      }
      for (int k = 0; k < 3 && found == 2; k++) CHECK_NEAR(place[k * nv + d], (pos[1][k] - pos[0][k]) / 2e-6, 1e-5);
      seen += found == 2;
    }
  }
  CHECK(seen >= nv);
  cav_state_free(s), cav_state_free(other);
  free(du);
}

// rows of a knot that are of forces at edges, and their sum; the file's default costs
static int rows_of(const char *text, double x, double *sum) {
  cav_model *m = scene_load(text);
  if (!CHECK(m != NULL)) return -1;
  cav_term term[16];
  cav_problem p = cav_problem_default(m);
  p.duration = 2 * p.timestep;
  p.nterm = cav_problem_default_terms(term, 16);
  p.term = term;
  double q[7] = {x, 0, 0.229, 1, 0, 0, 0}, v[6] = {0};
  p.q_start = p.q_goal = q, p.v_start = v;
  cav_transcription *tr = cav_transcription_new(&p, 1, NULL);
  if (!CHECK(tr != NULL)) return -1;
  cav_trajectory *at = cav_trajectory_new(m, tr->nknot, p.timestep);
  for (int t = 0; t < tr->nknot; t++) memcpy(at->q + 7 * t, q, sizeof q);
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  int rows = 0;
  *sum = 0;
  for (int k = 0; k < tr->knot[0].ncontact; k++) {
    rows += tr->knot[0].moving[k] & CAV_AT_EDGE ? 1 : 0;
    *sum += tr->knot[0].y[CAV_CONTACT_READINGS * k + 5];
  }
  cav_trajectory_free(at);
  cav_transcription_free(tr);
  cav_model_free(m);
  return rows;
}

int main(void) {
  cav_model *m = scene_load(scene);
  if (!CHECK(m != NULL)) return check_result();
  test_nearness(m);
  test_place(m);
  double sum;
  CHECK(rows_of(scene, 0, &sum) == 0 && sum == 0);
  CHECK(rows_of(scene, -0.25, &sum) > 0 && sum > 0.1);
  CHECK(rows_of("<mujoco><worldbody><geom type='plane' pos='0 0 .2' size='1 1 1'/><body><freejoint/>"
                "<geom type='capsule' size='.03' fromto='-.1 0 0 .1 .02 0'/></body></worldbody></mujoco>",
                -0.25, &sum) == 0);
  cav_model_free(m);
  return check_result();
}
