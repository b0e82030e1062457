/// Analytic derivatives of the inverse, of contacts and of sensors against sixth-order differences, on every model at
/// hand: all joints, limits, tendons, friction losses, springs, contacts of all pairs, exact and smoothed law, all
/// orders, both stabilisations. A column is compared where two steps of the reference agree: elsewhere the law, the
/// narrow phase or a limit has a kink within the step. Also: refusals are explicit, wrong calls fail. If this test
/// fails because a new force or constraint has no derivative in dynamics/derivative/analytic.c yet, name it in
/// cav_derivatives_missing.
#include "scene.h"
#include "step.h"

/// Rolling and sliding bodies of all shapes, rough pairs of unequal friction, two trees that touch.
static const char shapes[] =
    "<mujoco><option timestep='0.01'/><default><geom condim='6' friction='.8 .05 .02'/></default><worldbody>"
    "<geom name='floor' type='plane' size='1 1 1' euler='5 0 0'/><geom type='box' size='.3 .2 .05' pos='0 0 .02'/>"
    "<body pos='0 0 .16'><freejoint/><geom name='ball' type='sphere' size='.1'/>"
    "<body pos='.1 0 .1' gravcomp='.6'><joint axis='0 1 0'/><joint axis='1 0 .2' pos='0 .02 0'/>"
    "<geom name='arm' type='capsule' size='.04' fromto='0 0 0 .2 .05 -.1'/></body></body>"
    "<body pos='.25 .05 .14'><freejoint/><geom name='egg' type='ellipsoid' size='.05 .08 .1'/></body>"
    "<body pos='-.2 0 .16'><joint type='slide' axis='0 .2 1'/><joint type='ball' damping='.1'/>"
    "<geom name='can' type='cylinder' size='.07 .09' condim='4'/></body>"
    "<body pos='.6 .1 .1'><freejoint/><geom name='brick' type='box' size='.1 .05 .08' condim='3'/></body>"
    "</worldbody><contact><pair geom1='floor' geom2='arm' condim='6' friction='.9 .3 .05 .02 .04'/>"
    "<pair geom1='ball' geom2='egg' condim='6' friction='.3 .9 .05 .02 .04'/></contact></mujoco>";

// gravity compensation by springs of nothing and by actuators, along one chain
static const char lifted[] =
    "<mujoco><default><geom type='capsule' size='.05' fromto='0 0 0 .2 .1 .3' contype='0' conaffinity='0'/><default "
    "class='lifts'><joint actuatorgravcomp='true'/></default></default><worldbody><body "
    "gravcomp='.3'><freejoint/><geom/>"
    "<body gravcomp='1' pos='0 0 .5' childclass='lifts'><joint axis='0 1 0' pos='.1 0 0'/><joint axis='1 1 0'/><geom/>"
    "<body gravcomp='.5' pos='.3 0 .5'><joint type='ball'/><geom/><body gravcomp='2' pos='0 .3 0'><joint type='slide' "
    "axis='1 0 1' actuatorgravcomp='false'/><geom/></body></body></body></body></worldbody></mujoco>";

enum { STATES = 16, POINTS = 6, SENSORS = 56, LISTED = 24, TOUCHES = 4, LAWS = 5 };

/// What is compared, of one state: u, then 13 numbers a contact (gap, velocities, impulses), then sensors.
typedef struct readings {
  int ncontact, nsensor, n;
  int *key; ///< [2*ncontact]
  cav_sensor sensor[SENSORS];
} readings;

static cav_model *model;
static cav_state *state, *other;
static double *q, *v, *v_next, *moved, *scratch;
static cav_sliding sliding;
static cav_next_gap next_gap;
static cav_next_slip next_slip;
static int compared, left_out;
static double worst[3];

// the model's sensors, and every type that has a derivative on some object
static void list_sensors(readings *r) {
  r->nsensor = 0;
  for (int i = 0; i < model->nsensor && r->nsensor < LISTED; i++) r->sensor[r->nsensor++] = model->sensor[i];
  for (int type = 0; type <= CAV_SENSOR_SUBTREEANGMOM; type++) {
    cav_sensor s = {
        .type = (cav_sensor_type)type, .dim = 3, .object_type = CAV_OBJECT_BODY, .object = model->nbody - 1};
    if (type == CAV_SENSOR_FRAMEQUAT) s.dim = 4;
    if (type >= CAV_SENSOR_SUBTREECOM) s.object = type == CAV_SENSOR_SUBTREEANGMOM ? 0 : model->nbody / 2;
    if (type % 2) s.object_type = CAV_OBJECT_XBODY;
    if (type == CAV_SENSOR_JOINTPOS || type == CAV_SENSOR_JOINTVEL) {
      s = (cav_sensor){.type = s.type, .dim = 1, .object_type = CAV_OBJECT_JOINT, .object = model->njoint - 1};
      if (model->joint[s.object].type < CAV_JOINT_SLIDE) continue;
    }
    r->sensor[r->nsensor++] = s;
  }
  // poses in the frame of another body, one up the chain of the object or apart from it
  for (int type = CAV_SENSOR_FRAMEPOS; type <= CAV_SENSOR_FRAMEZAXIS; type++) {
    r->sensor[r->nsensor++] = (cav_sensor){.type = (cav_sensor_type)type,
                                           .dim = type == CAV_SENSOR_FRAMEQUAT ? 4 : 3,
                                           .object_type = CAV_OBJECT_BODY,
                                           .object = model->nbody - 1,
                                           .referred = 1,
                                           .reference_type = CAV_OBJECT_XBODY,
                                           .reference = type % 2 ? 1 : model->nbody / 2};
  }
  for (int k = 0; k < 2 && model->nsite > 0; k++) {
    cav_sensor_type type = k ? CAV_SENSOR_GYRO : CAV_SENSOR_VELOCIMETER;
    r->sensor[r->nsensor++] =
        (cav_sensor){.type = type, .dim = 3, .object_type = CAV_OBJECT_SITE, .object = model->nsite - 1};
  }
  // what presses on bodies, and on a geom
  for (int i = 0; i < TOUCHES && (i == 0 || i < model->nbody) && model->ngeom > 0; i++) {
    r->sensor[r->nsensor++] = (cav_sensor){.type = CAV_SENSOR_TOUCH,
                                           .dim = 1,
                                           .object_type = i ? CAV_OBJECT_BODY : CAV_OBJECT_GEOM,
                                           .object = i == 1 ? model->nbody - 1 : i};
  }
  for (int i = 0; i < model->ntendon && r->nsensor < SENSORS; i++) {
    r->sensor[r->nsensor++] =
        (cav_sensor){.type = CAV_SENSOR_TENDONPOS, .dim = 1, .object_type = CAV_OBJECT_TENDON, .object = i};
  }
}

// whether sensors of a type have a derivative
static int has_derivative(const cav_sensor *s) {
  if (s->type == CAV_SENSOR_TOUCH) return s->cutoff == 0;
  int type = (int)s->type, string = s->type == CAV_SENSOR_TENDONVEL && model->tendon[s->object].npath == 0;
  if (s->cutoff > 0 || (s->referred && (type < CAV_SENSOR_FRAMEPOS || type > CAV_SENSOR_FRAMEZAXIS))) return 0;
  return type <= CAV_SENSOR_SUBTREEANGMOM || type == CAV_SENSOR_VELOCIMETER || type == CAV_SENSOR_GYRO || string ||
         type == CAV_SENSOR_TENDONPOS || type == CAV_SENSOR_BALLANGVEL || type == CAV_SENSOR_CLOCK;
}

static const cav_contact *find(const cav_state *at, int pair, int feature) {
  for (int i = 0; i < at->ncontact; i++) {
    if (at->contact[i].pair == pair && at->contact[i].feature == feature) return &at->contact[i];
  }
  return NULL;
}

// all readings of a state; those of a contact that is gone are not numbers
static void read_all(const readings *r, cav_state *at, double *value) {
  memcpy(value, at->u, (size_t)model->nv * sizeof *value);
  value += model->nv;
  for (int i = 0; i < r->ncontact; i++, value += 13) {
    const cav_contact *c = find(at, r->key[2 * i], r->key[2 * i + 1]);
    for (int k = 0; k < 13; k++) value[k] = c ? 0 : NAN;
    if (!c) continue;
    value[0] = c->dist;
    memcpy(value + 1, c->velocity_next, (size_t)c->dim * sizeof *value);
    memcpy(value + 7, c->impulse, (size_t)c->dim * sizeof *value);
  }
  for (int i = 0; i < r->nsensor; i++) {
    cav_sensor_read(model, at, &r->sensor[i], value);
    value += r->sensor[i].dim;
  }
}

// the analytic derivatives of all readings, [n*nv] each; 0 if refused
static int differentiate(const readings *r, double *dq, double *dv, double *dn) {
  int nv = model->nv;
  if (cav_derivatives(model, state, dq, dv, dn) != CAV_OK) return 0;
  int at = nv * nv;
  for (int i = 0; i < r->ncontact; i++, at += 13 * nv) {
    cav_contact_derivative d = {.dist_dq = dq + at,
                                .velocity_dq = dq + at + nv,
                                .velocity_dv_next = dn + at + nv,
                                .impulse_dq = dq + at + 7 * nv,
                                .impulse_dv = dv + at + 7 * nv,
                                .impulse_dv_next = dn + at + 7 * nv};
    CHECK(cav_contact_derivatives(model, state, i, &d) == CAV_OK);
  }
  for (int i = 0; i < r->nsensor; i++) {
    const int touch = r->sensor[i].type == CAV_SENSOR_TOUCH;
    if (touch) CHECK(cav_sensor_derivatives(model, state, &r->sensor[i], dq + at, dn + at) == CAV_NOT_SUPPORTED);
    cav_status status = touch ? cav_touch_derivatives(model, state, &r->sensor[i], dq + at, dv + at, dn + at)
                              : cav_sensor_derivatives(model, state, &r->sensor[i], dq + at, dn + at);
    CHECK(status == (has_derivative(&r->sensor[i]) ? CAV_OK : CAV_NOT_SUPPORTED));
    at += r->sensor[i].dim * nv;
  }
  return 1;
}

// sixth-order difference of all readings; which: 0 q, 1 v, 2 v_next
static void reference(const readings *r, int which, int j, double step, double *out, double *value) {
  static const double weight[] = {-1.0 / 60, 3.0 / 20, -3.0 / 4, 3.0 / 4, -3.0 / 20, 1.0 / 60};
  static const int at[] = {-3, -2, -1, 1, 2, 3};
  memset(out, 0, (size_t)r->n * sizeof *out);
  for (int k = 0; k < POINTS; k++) {
    const double *x[3] = {q, v, v_next};
    memcpy(moved, x[which], (size_t)(which ? model->nv : model->nq) * sizeof *moved);
    if (which == 0) cav_configuration_perturb(model, j, at[k] * step, moved);
    if (which > 0) moved[j] += at[k] * step;
    x[which] = moved;
    CHECK(cav_inverse(model, other, x[0], x[1], x[2], scratch) == CAV_OK);
    read_all(r, other, value);
    for (int i = 0; i < r->n; i++) out[i] += weight[k] * value[i] / step;
  }
}

// one group of rows of a column: compared where both references agree, relative to the group's column
static void compare(const double *ours, const double *fine, const double *coarse, int n, double scale, int which) {
  double norm = scale, apart = 0, error = 0;
  for (int i = 0; i < n; i++) {
    norm = fmax(norm, fabs(fine[i]));
    apart = fmax(apart, isfinite(fine[i] - coarse[i]) ? fabs(fine[i] - coarse[i]) : INFINITY);
    error = fmax(error, fabs(ours[i] - fine[i]));
  }
  if (!(apart <= 1e-7 * norm)) {
    left_out++;
    return;
  }
  compared++;
  worst[which] = fmax(worst[which], error / norm);
  // bound: a hundred times the disagreement that references are let have; seen: printed, and at most 2e-6 over seeds
  CHECK(error <= 1e-5 * norm);
}

// all columns of one of the three derivatives
static void compare_columns(const readings *r, const double *ours, int which) {
  int nv = model->nv, n = r->n;
  double *fine = scene_vector(n), *coarse = scene_vector(n), *column = scene_vector(n), *value = scene_vector(n);
  double scale = 1e-3 / (which ? 1 : state->options.timestep);
  for (int j = 0; j < nv; j++) {
    double step = which ? 1e-3 : 1e-5;
    reference(r, which, j, step, coarse, value);
    reference(r, which, j, step / 2, fine, value);
    for (int i = 0; i < n; i++) column[i] = ours[i * nv + j];
    compare(column, fine, coarse, nv, 1 / state->options.timestep * scale, which);
    int at = nv, gone = 0;
    // each force in a sum may be off by what one is let, and the sum by rounding of the whole
    double summed = scale;
    for (int i = 0; i < r->ncontact; i++, at += 13) {
      double largest = 1e-6 * state->contact[i].impulse[0];
      gone |= !isfinite(fine[at] - coarse[at]);
      for (int k = 7; k < 13; k++) largest = fmax(largest, fabs(fine[at + k]));
      summed += largest;
      compare(column + at, fine + at, coarse + at, 7, 1, which);
      compare(column + at + 7, fine + at + 7, coarse + at + 7, 6, scale, which);
    }
    for (int i = 0; i < r->nsensor; at += r->sensor[i++].dim) {
      const int touch = r->sensor[i].type == CAV_SENSOR_TOUCH;
      // a sum has no number for a point that is gone
      if (!has_derivative(&r->sensor[i]) || (touch && gone)) continue;
      const double unit = touch ? summed / state->options.timestep : 1;
      compare(column + at, fine + at, coarse + at, r->sensor[i].dim, unit, which);
    }
  }
  free(fine), free(coarse), free(column), free(value);
}

// a random state under the k-th options; 1 if its derivatives were given
static int one_state(readings *r, int k, double lift) {
  int nv = model->nv;
  cav_options *o = &state->options;
  o->order = (cav_order)(k % 3);
  o->stabilisation = k & 2 ? CAV_STABILISATION_DISCRETE : CAV_STABILISATION_SOLREF;
  o->smoothing = o->smoothing_self = k & 4 ? 0.01 : 0;
  o->sliding = sliding;
  o->next_gap = next_gap;
  o->next_slip = next_slip;
  // a step over which links turn
  o->timestep = next_gap == CAV_NEXT_GAP_EXACT || next_slip == CAV_NEXT_SLIP_EXACT ? 0.02 : model->timestep;
  o->spring = (cav_spring)(k / 3 % 2);
  o->gravity = k % 5 > 0;
  o->passive = k % 7 > 0;
  o->stops = k % 5 == 2;
  other->options = *o;
  scene_posture(model, q, scratch, k & 8 ? 0.3 : 0.1);
  if (model->njoint && model->joint[0].type == CAV_JOINT_FREE) q[2] += lift;
  scene_normals(v, nv, 0.5);
  for (int i = 0; i < nv; i++) v_next[i] = v[i] + o->timestep * scene_normal();
  CHECK(cav_inverse(model, state, q, v, v_next, scratch) == CAV_OK);

  r->ncontact = state->ncontact;
  r->key = calloc((size_t)(2 * r->ncontact + 1), sizeof *r->key);
  r->n = nv + 13 * r->ncontact;
  for (int i = 0; i < r->nsensor; i++) r->n += r->sensor[i].dim;
  for (int i = 0; i < r->ncontact; i++) {
    r->key[2 * i] = state->contact[i].pair;
    r->key[2 * i + 1] = state->contact[i].feature;
  }
  double *d[3];
  for (int i = 0; i < 3; i++) d[i] = scene_vector(r->n * nv);
  int given = differentiate(r, d[0], d[1], d[2]);
  for (int i = 0; i < 3 && given; i++) compare_columns(r, d[i], i);
  for (int i = 0; i < 3; i++) free(d[i]);
  free(r->key);
  return given;
}

static void open_model(void) {
  state = cav_state_new(model);
  other = cav_state_new(model);
  q = scene_vector(model->nq), v = scene_vector(model->nv), v_next = scene_vector(model->nv);
  moved = scene_vector(model->nq), scratch = scene_vector(model->nv);
}

static void close_model(void) {
  cav_state_free(state), cav_state_free(other);
  cav_model_free(model);
  free(q), free(v), free(v_next), free(moved), free(scratch);
}

// refusals: what is named as missing is refused, by every way in
static void refused(const char *why) {
  int nv = model->nv;
  double *d = scene_vector(nv * nv);
  cav_configuration_reset(model, q);
  CHECK(cav_inverse(model, state, q, v, v_next, scratch) == CAV_OK);
  CHECK(cav_derivatives(model, state, d, NULL, NULL) == CAV_NOT_SUPPORTED);
  CHECK(cav_inverse_jacobian_by(model, state, CAV_DERIVATIVE_ANALYTIC, q, v, v_next, d, d, d) == CAV_NOT_SUPPORTED);
  printf("%-28s refused: %s\n", model->name, why);
  free(d);
}

static void check_model(const char *name, int states) {
  CHECK(model != NULL);
  if (!model) return;
  open_model();
  const char *missing = cav_derivatives_missing(model);
  if (missing) {
    refused(missing);
  } else {
    static readings r;
    int given = 0;
    compared = left_out = 0;
    memset(worst, 0, sizeof worst);
    list_sensors(&r);
    // each law in the same states, and with what is after the step: the gap, both, the slip alone under the convex law
    for (int k = 0; k < LAWS * states; k++) {
      uint64_t before = scene_seed;
      const int law = k % LAWS;
      sliding = law && law < 4 ? CAV_SLIDING_COULOMB : CAV_SLIDING_CONVEX;
      next_gap = law == 2 || law == 3 ? CAV_NEXT_GAP_EXACT : CAV_NEXT_GAP_LINEAR;
      next_slip = law > 2 ? CAV_NEXT_SLIP_EXACT : CAV_NEXT_SLIP_LINEAR;
      given += one_state(&r, k / LAWS, 0);
      if (k % LAWS < LAWS - 1) scene_seed = before;
    }
    printf("%-28s %2d of %d states, %6d columns, %5d at kinks, error dq %.1e dv %.1e dv_next %.1e\n", name, given,
           LAWS * states, compared, left_out, worst[0], worst[1], worst[2]);
    // no state is refused, whatever points come and go in it; kinks are rare
    CHECK(given == LAWS * states);
    CHECK(left_out <= compared / 4);
  }
  close_model();
}

// a row of a kind that has no derivative is refused, and so are calls at the wrong time
static void wrong_calls(void) {
  model = scene_load(scene_joints);
  CHECK(model != NULL);
  if (!model) return;
  open_model();
  int nv = model->nv;
  double *d = scene_vector(nv * nv);
  cav_contact_derivative none = {0};
  CHECK(cav_derivatives(model, state, d, d, d) == CAV_BAD_INPUT);
  scene_posture(model, q, scratch, 0.2);
  CHECK(cav_inverse(model, state, q, v, v_next, scratch) == CAV_OK);
  CHECK(cav_sensor_derivatives(model, state, &(cav_sensor){.type = CAV_SENSOR_SUBTREECOM, .dim = 3}, d, d) ==
        CAV_BAD_INPUT);
  CHECK(cav_derivatives(model, state, d, NULL, NULL) == CAV_OK);
  CHECK(cav_contact_derivatives(model, state, state->ncontact, &none) == CAV_BAD_INPUT);
  state->options.gravity = 0;
  CHECK(cav_derivatives(model, state, d, NULL, NULL) == CAV_BAD_INPUT);
  state->options.gravity = 1;
  CHECK(state->nrow > 0);
  state->row[0].type = (cav_row_type)99;
  CHECK(cav_derivatives(model, state, d, NULL, NULL) == CAV_NOT_SUPPORTED);
  CHECK(cav_readout_differentiate(model, state, CAV_DERIVATIVE_ANALYTIC, 0, q, v, v_next, NULL, NULL, 0, NULL, d, d,
                                  d) == CAV_BAD_INPUT);
  CHECK(cav_sensor_derivatives(model, state, &(cav_sensor){.type = CAV_SENSOR_TYPES, .dim = 3}, d, d) != CAV_OK);
  free(d);
  close_model();
}

int main(void) {
  static const char *const names[] = {"dm_control/acrobot",  "dm_control/ball_in_cup", "dm_control/cartpole",
                                      "dm_control/cheetah",  "dm_control/finger",      "dm_control/fish",
                                      "dm_control/hopper",   "dm_control/humanoid",    "dm_control/manipulator",
                                      "dm_control/pendulum", "dm_control/point_mass",  "dm_control/quadruped",
                                      "dm_control/reacher",  "dm_control/swimmer",     "dm_control/walker",
                                      "mujoco/arm26",        "mujoco/humanoid",        "mujoco/slider_crank"};
  wrong_calls();
  model = scene_load(scene_joints);
  check_model("joints", STATES);
  model = cav_model_load(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", NULL);
  check_model("our humanoid", CHECK_CASES(8));
  model = scene_load(shapes);
  check_model("shapes", STATES);
  model = scene_load(lifted);
  check_model("gravity compensation", STATES);
  model = cav_model_load(CAVORT_SOURCE_ROOT "/tests/features.xml", NULL);
  check_model("features", STATES);
  model = cav_model_load(CAVORT_SOURCE_ROOT "/tests/equality.xml", NULL);
  check_model("equality", STATES);
  const char *folder = check_shared_models();
  for (size_t i = 0; folder && i < sizeof names / sizeof *names; i++) {
    char path[4300];
    cav_error error = {0};
    snprintf(path, sizeof path, "%s/%s.xml", folder, names[i]);
    model = cav_model_load(path, &error);
    // what does not load is for the tests of models to say
    if (model) check_model(names[i], CHECK_CASES(8));
    if (!model) printf("%-28s left out: %s\n", names[i], error.text);
  }
  if (!folder) printf("shared models are absent: only scenes of our own\n");
  return check_result();
}
