/// Evaluations put by: what a state has back is what cav_inverse leaves there, to the bit, derivatives and readings with it; and
/// only at the same point under the same options; searches from where they ended in a posture change nothing.
/// A linearisation after values at the same motion evaluates nothing.
#include "cavort/cavort.h"
#include "continuation.h"
#include "evaluation.h"
#include "scene.h"
#include "transcription.h"

static int calls; // of cav_inverse

cav_status __real_cav_inverse(const cav_model *model, cav_state *state, const double *q, const double *v,
                              const double *v_next, double *u);
cav_status __wrap_cav_inverse(const cav_model *model, cav_state *state, const double *q, const double *v,
                              const double *v_next, double *u);

cav_status __wrap_cav_inverse(const cav_model *model, cav_state *state, const double *q, const double *v,
                              const double *v_next, double *u) {
  calls++;
  return __real_cav_inverse(model, state, q, v, v_next, u);
}

/// Joints, limits, a tendon with all that it can have, a loop closed by an equality constraint, contacts of two kinds.
static const char scene_linkage[] =
    "<mujoco><option timestep='0.01'/><worldbody><geom type='plane' size='1 1 1'/>"
    "<body name='a' pos='0 0 .12'><freejoint/><geom type='box' size='.1 .1 .1' mass='2'/>"
    "<body name='b' pos='.12 0 0'><joint name='h' axis='0 1 0' limited='true' range='-1 1' damping='.1' "
    "frictionloss='.2' "
    "stiffness='1'/><geom type='capsule' size='.03' fromto='.02 0 0 .2 0 0' mass='1'/>"
    "<body name='c' pos='.2 0 0'><joint name='g' axis='0 1 0'/><geom type='sphere' size='.04' pos='.05 0 0' "
    "mass='1'/></body></body></body>"
    "<body name='d' pos='.4 0 .2'><freejoint/><geom type='sphere' size='.1' mass='1'/></body></worldbody>"
    "<tendon><fixed name='t' stiffness='3' damping='.5' frictionloss='.1' limited='true' range='-.5 .5'><joint "
    "joint='h' coef='1'/><joint joint='g' coef='.5'/></fixed></tendon>"
    "<equality><connect body1='c' body2='d' anchor='.05 0 0'/></equality>"
    "<actuator><motor joint='g' gear='2'/></actuator></mujoco>";

/// A point, and all that is asked of a state there.
typedef struct point {
  double q[32], v[32], v_next[32];
} point;

static point make_point(const cav_model *m, double size) {
  point p = {{0}, {0}, {0}};
  double step[32];
  for (int d = 0; d < m->nv; d++) {
    step[d] = size * scene_uniform();
    p.v[d] = size * scene_uniform();
    p.v_next[d] = p.v[d] + 0.1 * size * scene_uniform();
  }
  cav_integrate(m, m->q0, step, 1, p.q);
  return p;
}

/// Forces, contacts, rows and derivatives of the state as it is, one after another in out; their number.
static size_t print(const cav_model *m, cav_state *s, double *out) {
  size_t nv = (size_t)m->nv, n = 0;
  memcpy(out, s->u, nv * sizeof *out), n += nv;
  for (int i = 0; i < s->ncontact; i++)
    for (int k = 0; k < s->contact[i].dim; k++) out[n++] = s->contact[i].impulse[k] + s->contact[i].pos[k % 3];
  for (int i = 0; i < s->nrow; i++) out[n++] = s->row[i].impulse + s->row[i].dist;
  for (int i = 0; i < s->nequality; i++) out[n++] = s->equality[i].impulse[0];
  for (int l = 0; l < 6 * m->nlink; l++) out[n++] = s->force[l] + s->velocity[l] + s->velocity_next[l];
  CHECK(cav_derivatives(m, s, out + n, out + n + nv * nv, out + n + 2 * nv * nv) == CAV_OK);
  return n + 3 * nv * nv;
}

static void test_state(cav_order order, int looks_ahead, cav_evaluation **e) {
  static double fresh[4000], back[4000];
  cav_model *m = scene_load(scene_linkage);
  if (!CHECK(m != NULL)) return;
  cav_state *s = cav_state_new(m), *other = cav_state_new(m);
  int contacts = 0;
  s->options.order = order;
  s->options.next_gap = looks_ahead ? CAV_NEXT_GAP_EXACT : CAV_NEXT_GAP_LINEAR;
  s->options.next_slip = looks_ahead ? CAV_NEXT_SLIP_EXACT : CAV_NEXT_SLIP_LINEAR;
  other->options = s->options;
  for (int turn = 0; turn < 20; turn++) {
    point p = make_point(m, 0.2), far = make_point(m, 0.5);
    double u[32];
    CHECK(cav_inverse(m, s, p.q, p.v, p.v_next, u) == CAV_OK);
    contacts += s->ncontact;
    size_t n = print(m, s, fresh);
    CHECK(n < sizeof fresh / sizeof *fresh && s->nequality == 1);
    // derivatives in between leave all there is
    cav_evaluation_keep(e, s, p.q, p.v, p.v_next);
    CHECK(cav_inverse(m, s, far.q, far.v, far.v_next, u) == CAV_OK);
    CHECK(cav_inverse(m, other, far.q, far.v, far.v_next, u) == CAV_OK);
    // not at another point, nor under other options
    point near = p;
    near.v_next[turn % m->nv] += 1e-12;
    CHECK(!cav_evaluation_take(*e, other, near.q, near.v, near.v_next));
    other->options.softness *= 2;
    CHECK(!cav_evaluation_take(*e, other, p.q, p.v, p.v_next));
    other->options.softness /= 2;
    CHECK(cav_evaluation_take(*e, other, p.q, p.v, p.v_next));
    CHECK(print(m, other, back) == n && !memcmp(fresh, back, n * sizeof *fresh));
    // once
    CHECK(!cav_evaluation_take(*e, other, p.q, p.v, p.v_next));
    // the state goes on from there
    CHECK(cav_inverse_from(m, other, CAV_STAGE_POSITION, p.q, p.v, far.v_next, u) == CAV_OK);
    print(m, other, back);
    CHECK(cav_inverse(m, s, p.q, p.v, far.v_next, u) == CAV_OK);
    print(m, s, fresh);
    CHECK(!memcmp(fresh, back, n * sizeof *fresh));
  }
  CHECK(contacts > 20);
  cav_state_free(s), cav_state_free(other);
  cav_model_free(m);
}

static void test_linearise(void) {
  cav_error error = {0};
  cav_problem *p = cav_problem_load(CAVORT_SOURCE_ROOT "/problems/motions/hop/problem.xml", NULL, &error);
  if (!CHECK(p != NULL)) return;
  cav_transcription *tr = cav_transcription_new(p, 1, &error);
  cav_trajectory *at = cav_trajectory_new(p->model, tr->nknot, p->timestep), *moved;
  cav_guess_fill(p, p->q_goal, at);
  moved = cav_trajectory_copy(at);
  double *x = calloc((size_t)cav_transcription_unknowns(tr), sizeof(double));
  for (int i = 0; i < cav_transcription_unknowns(tr); i++) x[i] = 1e-3 * sin(i);
  cav_transcription_move(tr, at, x, moved);
  CHECK(cav_transcription_values(tr, moved) == CAV_OK);
  calls = 0;
  CHECK(cav_transcription_linearise(tr, moved) == CAV_OK && calls == 0);
  CHECK(cav_transcription_linearise(tr, moved) == CAV_OK && calls == tr->nknot);
  // a motion that values were put by of
  CHECK(cav_transcription_values(tr, moved) == CAV_OK && cav_values_keep(tr));
  CHECK(cav_transcription_values(tr, at) == CAV_OK && cav_transcription_return(tr, moved) == CAV_OK);
  calls = 0;
  CHECK(cav_transcription_linearise(tr, moved) == CAV_OK && calls == 0);
  free(x);
  cav_trajectory_free(at), cav_trajectory_free(moved);
  cav_transcription_free(tr);
  cav_problem_free(p);
}

/// Postures gone through three times over, with what each search for contacts of meshes ended at kept by posture and by the state
/// alone: the same bits.
static void test_hints(void) {
  static const char scene[] =
      "<mujoco><option timestep='0.01'/><asset><mesh name='m' vertex='-.1 -.1 -.1 .1 -.1 -.1 0 .1 -.1 .05 .02 .1 -.04 "
      ".03 "
      ".12 0 -.06 .11'/></asset><worldbody><geom type='box' size='1 1 .1' pos='0 0 -.1'/>"
      "<body pos='0 0 .1'><freejoint/><geom type='mesh' mesh='m' mass='1'/></body>"
      "<body pos='.15 0 .25'><freejoint/><geom type='mesh' mesh='m' mass='1'/></body>"
      "<body pos='-.2 0 .1'><freejoint/><geom type='cylinder' size='.05 .08' mass='1'/></body></worldbody></mujoco>";
  enum { POSTURES = 8 };
  static double fresh[4000], back[4000];
  cav_model *m = scene_load(scene);
  if (!CHECK(m != NULL)) return;
  cav_state *alone = cav_state_new(m), *by_turns = cav_state_new(m);
  struct cav_hint *hints[POSTURES] = {NULL};
  point p[POSTURES];
  int contacts = 0;
  for (int i = 0; i < POSTURES; i++) p[i] = make_point(m, 0.1);
  for (int turn = 0; turn < 3 * POSTURES; turn++) {
    const point *at = &p[turn % POSTURES];
    double u[32];
    CHECK(cav_inverse(m, alone, at->q, at->v, at->v_next, u) == CAV_OK);
    contacts += alone->ncontact;
    size_t n = print(m, alone, fresh);
    cav_evaluation_swap_hints(by_turns, &hints[turn % POSTURES]);
    CHECK(cav_inverse(m, by_turns, at->q, at->v, at->v_next, u) == CAV_OK);
    CHECK(print(m, by_turns, back) == n && !memcmp(fresh, back, n * sizeof *fresh));
    cav_evaluation_swap_hints(by_turns, &hints[turn % POSTURES]);
  }
  CHECK(contacts > 3 * POSTURES);
  for (int i = 0; i < POSTURES; i++) CHECK(hints[i] != NULL), free(hints[i]);
  cav_state_free(alone), cav_state_free(by_turns);
  cav_model_free(m);
  // without a mesh there is nothing to keep
  struct cav_hint *none = NULL;
  m = scene_load(scene_linkage);
  alone = m ? cav_state_new(m) : NULL;
  if (alone) cav_evaluation_swap_hints(alone, &none);
  CHECK(alone && !none);
  cav_state_free(alone);
  cav_model_free(m);
}

int main(void) {
  // one evaluation serves all options
  cav_evaluation *e = NULL;
  for (int order = 0; order < 3; order++)
    for (int looks_ahead = 0; looks_ahead < 2; looks_ahead++) test_state((cav_order)order, looks_ahead, &e);
  cav_evaluation_free(e);
  test_linearise();
  test_hints();
  return check_result();
}
