/// Batches of points against the single calls, bit by bit, at one to five threads: a humanoid that stands, falls and lies,
/// and a scene with every kind of joint. A row that fails is told, and takes no other with it. Inverses of many more
/// scenes, by options that change what is evaluated, in random states and along paths: four at once give the bits of one, by
/// vectors and without them.
#include "four_states.h"
#include "scene.h"
#include "step.h"
#include "touch_four.h"

enum { ROWS = 203, THREADS = 5 };

// for a while: numbers of a vector, 0: as many as there are
static int width;
int __real_cav_dense_lanes(void);
int __wrap_cav_dense_lanes(void);
int __wrap_cav_dense_lanes(void) { return width ? width : __real_cav_dense_lanes(); }

typedef struct points {
  cav_model *model;
  cav_state *state;
  double *q, *v, *next, *u, *found, *alone;
  double *d_found, *d_alone;
  cav_status status[ROWS];
} points;

static double *row(double *x, int i, int n) { return x + (size_t)i * (size_t)n; }

// random states, from in the floor to above it
static points draw(cav_model *model) {
  points p = {.model = model};
  if (!CHECK(model != NULL)) exit(check_result());
  int nq = model->nq, nv = model->nv;
  p.state = cav_state_new(model);
  p.q = scene_vector(ROWS * nq);
  p.v = scene_vector(ROWS * nv), p.next = scene_vector(ROWS * nv), p.u = scene_vector(ROWS * nv);
  p.found = scene_vector(ROWS * nv), p.alone = scene_vector(ROWS * nv);
  p.d_found = scene_vector(3 * ROWS * nv * nv), p.d_alone = scene_vector(3 * nv * nv);
  for (int i = 0; i < ROWS; i++) {
    scene_posture(model, row(p.q, i, nq), p.alone, 0.3);
    row(p.q, i, nq)[2] -= 0.002 * i;
    scene_normals(row(p.v, i, nv), nv, 0.3);
    for (int j = 0; j < nv; j++) row(p.next, i, nv)[j] = row(p.v, i, nv)[j] + 0.02 * scene_normal();
  }
  return p;
}

static void release(points *p) {
  free(p->q), free(p->v), free(p->next), free(p->u), free(p->found), free(p->alone), free(p->d_found), free(p->d_alone);
  cav_state_free(p->state);
  cav_model_free(p->model);
}

static int same(const double *a, const double *b, int n) { return !memcmp(a, b, (size_t)n * sizeof *a); }

// forces of all rows; the single state goes through them backwards, so what it did before differs
static int test_inverse(points *p) {
  int nq = p->model->nq, nv = p->model->nv, touching = 0;
  for (int i = ROWS - 1; i >= 0; i--) {
    CHECK(!cav_inverse(p->model, p->state, row(p->q, i, nq), row(p->v, i, nv), row(p->next, i, nv), row(p->u, i, nv)));
    touching += p->state->ncontact > 0;
  }
  for (int threads = 1; threads <= THREADS; threads++) {
    memset(p->found, 0, (size_t)(ROWS * nv) * sizeof *p->found);
    CHECK(!cav_inverse_batch(p->model, NULL, threads, ROWS, p->q, p->v, p->next, p->found, p->status));
    CHECK(same(p->found, p->u, ROWS * nv));
  }
  return touching;
}

static void test_forward(points *p) {
  int nq = p->model->nq, nv = p->model->nv;
  for (int threads = 1; threads <= THREADS; threads += 2) {
    cav_status all =
        cav_forward_batch(p->model, NULL, threads, ROWS, p->q, p->v, p->u, p->found, threads > 1 ? p->status : NULL);
    cav_status first = CAV_OK;
    for (int i = ROWS - 1; i >= 0; i--) {
      cav_status status =
          cav_forward(p->model, p->state, row(p->q, i, nq), row(p->v, i, nv), row(p->u, i, nv), p->alone);
      if (status) first = status;
      if (threads > 1) CHECK(p->status[i] == status);
      CHECK(same(row(p->found, i, nv), p->alone, nv));
    }
    CHECK(all == first);
  }
}

static void test_jacobian(points *p, cav_derivative method) {
  int nq = p->model->nq, nv = p->model->nv, n = nv * nv;
  double *dq = p->d_found, *dv = dq + ROWS * n, *dn = dv + ROWS * n, *alone = p->d_alone;
  CHECK(!cav_inverse_jacobian_batch(p->model, NULL, method, 3, ROWS, p->q, p->v, p->next, dq, dv, dn, NULL));
  int rows = 0;
  for (int i = 0; i < ROWS; i++) {
    CHECK(!cav_inverse_jacobian_by(p->model, p->state, method, row(p->q, i, nq), row(p->v, i, nv), row(p->next, i, nv),
                                   alone, alone + n, alone + 2 * n));
    rows += same(row(dq, i, n), alone, n) && same(row(dv, i, n), alone + n, n) && same(row(dn, i, n), alone + 2 * n, n);
  }
  CHECK(rows == ROWS);
  // one of the three alone
  memset(dq, 0, (size_t)(3 * ROWS * n) * sizeof *dq);
  CHECK(!cav_inverse_jacobian_batch(p->model, NULL, method, 1, ROWS, p->q, p->v, p->next, NULL, dv, NULL, NULL));
  CHECK(same(row(dv, ROWS - 1, n), alone + n, n) && dq[0] == 0 && dn[0] == 0);
}

// rows that fail are told, and stay as they were
static void test_failures(points *p) {
  int nq = p->model->nq, nv = p->model->nv;
  double kept[2] = {row(p->q, 40, nq)[0], row(p->q, 150, nq)[0]};
  row(p->q, 150, nq)[0] = NAN, row(p->q, 40, nq)[0] = INFINITY;
  for (int i = 0; i < ROWS * nv; i++) p->found[i] = -7;
  CHECK(cav_inverse_batch(p->model, NULL, 2, ROWS, p->q, p->v, p->next, p->found, p->status) == CAV_NOT_FINITE);
  for (int i = 0; i < ROWS; i++) {
    int bad = i == 40 || i == 150;
    CHECK(p->status[i] == (bad ? CAV_NOT_FINITE : CAV_OK));
    CHECK(bad ? row(p->found, i, nv)[0] == -7 : same(row(p->found, i, nv), row(p->u, i, nv), nv));
  }
  row(p->q, 40, nq)[0] = kept[0], row(p->q, 150, nq)[0] = kept[1];

  // options of their own, refused where they are none
  cav_options options = p->model->options;
  options.gravity = 0;
  CHECK(!cav_inverse_batch(p->model, &options, 2, ROWS, p->q, p->v, p->next, p->found, NULL));
  CHECK(!same(p->found, p->u, ROWS * nv));
  options.timestep = -1;
  CHECK(cav_inverse_batch(p->model, &options, 2, ROWS, p->q, p->v, p->next, p->found, NULL) == CAV_BAD_INPUT);
  CHECK(cav_inverse_batch(p->model, NULL, 0, ROWS, p->q, p->v, p->next, p->found, NULL) == CAV_BAD_INPUT);
  CHECK(cav_inverse_batch(p->model, NULL, 1, -1, p->q, p->v, p->next, p->found, NULL) == CAV_BAD_INPUT);
  CHECK(cav_inverse_batch(p->model, NULL, 4, 0, p->q, p->v, p->next, p->found, NULL) == CAV_OK);
}

// how often four states were taken at once
static int fours;
void __real_cav_lanes_kinematics(const cav_model *model, cav_lanes *lanes, cav_state *const state[CAV_LANES],
                                 cav_extent extent);
void __wrap_cav_lanes_kinematics(const cav_model *model, cav_lanes *lanes, cav_state *const state[CAV_LANES],
                                 cav_extent extent);
void __wrap_cav_lanes_kinematics(const cav_model *model, cav_lanes *lanes, cav_state *const state[CAV_LANES],
                                 cav_extent extent) {
  fours++;
  __real_cav_lanes_kinematics(model, lanes, state, extent);
}

// pairs of geoms that were taken by four, and those of them that some state had to take by itself
static int together, rare;
int __real_cav_touches_four(const cav_geom_four *a, const cav_geom_four *b, double margin, int bits,
                            cav_touch_four touch[CAV_TOUCH_MAX]);
int __wrap_cav_touches_four(const cav_geom_four *a, const cav_geom_four *b, double margin, int bits,
                            cav_touch_four touch[CAV_TOUCH_MAX]);
int __wrap_cav_touches_four(const cav_geom_four *a, const cav_geom_four *b, double margin, int bits,
                            cav_touch_four touch[CAV_TOUCH_MAX]) {
  const int count = __real_cav_touches_four(a, b, margin, bits, touch);
  together += count > 0;
  rare += count < 0;
  return count;
}

// how often springs, friction losses and limits were
static int by_rows;
void __real_cav_lanes_rows(const cav_model *model, cav_lanes *lanes, const cav_state *state);
void __wrap_cav_lanes_rows(const cav_model *model, cav_lanes *lanes, const cav_state *state);
void __wrap_cav_lanes_rows(const cav_model *model, cav_lanes *lanes, const cav_state *state) {
  by_rows++;
  __real_cav_lanes_rows(model, lanes, state);
}

enum { MANY = 1000, PATH = 25 };

// states in blocks: of every other block the rows follow one another in small steps; some with angles beyond any
// table of sines, some, where no mesh is sought for long, that reach a speed whose square is no number
static void draw_many(const cav_model *model, double *q, double *v, double *next) {
  const int nq = model->nq, nv = model->nv;
  double *scratch = scene_vector(nv);
  for (int i = 0; i < MANY; i++) {
    double *at = row(q, i, nq);
    if (i / PATH % 2 && i % PATH) {
      cav_integrate(model, at - nq, row(v, i - 1, nv), 0.01, at);
      memcpy(row(v, i, nv), row(next, i - 1, nv), (size_t)nv * sizeof *v);
    } else {
      scene_posture(model, at, scratch, 0.4);
      if (model->joint[0].type == CAV_JOINT_FREE) at[2] -= 0.3 * (i % 10) / 10;
      scene_normals(row(v, i, nv), nv, 0.5);
    }
    const cav_joint *last = &model->joint[model->njoint - 1];
    if (i % 97 == 13 && last->type == CAV_JOINT_HINGE) at[last->q] += 3e5;
    const int fast = i % 89 == 7 && model->nmesh == 0;
    for (int j = 0; j < nv; j++) row(next, i, nv)[j] = (fast ? 1e160 : 1) * row(v, i, nv)[j] + 0.05 * scene_normal();
  }
  free(scratch);
}

// rows of a batch that have not the bits of their own evaluation
static int count_different(const cav_model *model, const cav_options *options, const double *q, const double *v,
                           const double *next, int n) {
  const size_t nq = (size_t)model->nq, nv = (size_t)model->nv;
  double *found = scene_vector(MANY * model->nv), *u = scene_vector(model->nv);
  cav_status status[MANY];
  cav_state *state = cav_state_new(model);
  state->options = *options;
  cav_inverse_batch(model, options, 1, n, q, v, next, found, status);
  int different = 0;
  for (size_t i = 0; i < (size_t)n; i++) {
    for (width = 2; width >= 0; width -= 2) {
      memset(u, 0, nv * sizeof *u);
      different += cav_inverse(model, state, q + i * nq, v + i * nv, next + i * nv, u) != status[i];
      different += !same(u, found + i * nv, model->nv);
    }
    width = 0;
  }
  cav_state_free(state);
  free(found), free(u);
  return different;
}

// one scene by its own options, and in fewer rows by others
static void test_scene(cav_model *model, const char *name) {
  if (!CHECK(model != NULL)) return;
  double *q = scene_vector(MANY * model->nq), *v = scene_vector(MANY * model->nv),
         *next = scene_vector(MANY * model->nv);
  draw_many(model, q, v, next);
  enum { OPTIONS = 11 };
  cav_options options[OPTIONS];
  for (int k = 0; k < OPTIONS; k++) options[k] = model->options;
  options[1].order = CAV_ORDER_MIDPOINT, options[1].gravity = 0;
  options[2].order = CAV_ORDER_MOMENTUM;
  options[3].stabilisation = CAV_STABILISATION_DISCRETE, options[3].smoothing = 0.01, options[3].smoothing_self = 0.002;
  options[4] = options[3], options[4].next_gap = CAV_NEXT_GAP_EXACT, options[4].next_slip = CAV_NEXT_SLIP_EXACT;
  options[5].regulariser = CAV_REGULARISER_EXACT;
  options[6].coupled = 1, options[6].stabilisation = CAV_STABILISATION_DISCRETE;
  options[7].constraint = 0, options[7].passive = 0;
  options[8].sliding = CAV_SLIDING_COULOMB, options[8].order = CAV_ORDER_MIDPOINT;
  options[9].stabilisation = CAV_STABILISATION_DISCRETE, options[9].self_stiffness = 0.3;
  options[10].impratio = 7, options[10].spring = CAV_SPRING_IMPLICIT;
  for (int k = 0; k < OPTIONS; k++) {
    int n = !k ? MANY : options[k].coupled ? 8 : 40, before = fours;
    int different = count_different(model, &options[k], q, v, next, n);
    if (!CHECK(different == 0)) printf("%s, options %d: %d of %d rows differ\n", name, k, different, n);
    CHECK(!cav_lanes_pay() || fours - before == n / 32 * 8 + n % 32 / 4);
  }
  free(q), free(v), free(next);
  cav_model_free(model);
}

// everything that a single state alone does after its poses: gravity compensation, a medium, spatial tendons, connects and welds,
// and a ball with limits
static const char scene_rest[] =
    "<mujoco><compiler angle='radian'/><option density='1.2' viscosity='0.01' wind='1 0 0'/><worldbody>"
    "<geom type='plane' size='1 1 1'/><site name='over' pos='0 0 2'/>"
    "<body name='a' pos='0 0 0.6' gravcomp='0.5'><freejoint/><geom type='capsule' size='.05 .2' mass='2'/>"
    "<site name='on' pos='0 0 .2'/>"
    "<body name='b' pos='0 0 .2'><joint type='ball' pos='.02 0 0' range='0 1' limited='true' stiffness='3' "
    "damping='.1'/>"
    "<geom type='box' size='.05 .1 .2' pos='0 0 .3' mass='1'/>"
    "<body name='c' pos='0 0 .5' quat='.8 .6 0 0'><joint type='hinge' axis='1 2 3' pos='0 0 .03' range='-1 1' "
    "limited='true'/>"
    "<geom type='sphere' size='.06' mass='1'/></body></body></body>"
    "<body name='d' pos='.5 0 .3'><joint type='slide' axis='0 0 1' frictionloss='1'/><joint type='hinge' axis='0 1 0'/>"
    "<geom type='ellipsoid' size='.1 .2 .05' mass='1'/></body>"
    "<body name='e' pos='-.5 0 .3'><freejoint/><geom type='cylinder' size='.1 .1' mass='1'/></body></worldbody>"
    "<tendon><spatial stiffness='20' springlength='.3'><site site='over'/><site site='on'/></spatial></tendon>"
    "<equality><connect body1='e' anchor='0 0 .3'/><weld body1='a' body2='d'/></equality></mujoco>";

// pairs that go by four and others, over the floor, beside what stands and against each other; of one to six rows,
// with and without friction, soft by every kind of curve; two capsules that stay parallel, two balls with one centre
// and a box that stands on an edge, so that six corners are not above its centre
static const char scene_heap[] =
    "<mujoco><worldbody><geom type='plane' size='1 1 1' friction='.8 .01 .001' solimp='.8 .95 .01 .5 2'/>"
    "<geom type='capsule' size='.1 .3' pos='.3 0 .3' euler='10 40 0'/><geom type='box' size='.2 .1 .3' pos='-.3 0 .1'/>"
    "<body name='a' pos='0 0 .2'><freejoint/><geom name='a' type='capsule' size='.1 .2' mass='1' condim='1'/></body>"
    "<body name='b' pos='.1 0 .2'><freejoint/><geom type='box' size='.1 .2 .15' mass='2' condim='4'/></body>"
    "<body name='c' pos='0 .1 .2'><freejoint/><geom name='c' type='sphere' size='.2' mass='1' condim='6'/></body>"
    "<body name='d' pos='0 .2 .1'><freejoint/><geom type='cylinder' size='.1 .2' mass='1' solimp='.7 .95 .02 .3 "
    "3.5'/></body>"
    "<body name='e' pos='.2 0 .1'><freejoint/><geom name='e' type='ellipsoid' size='.1 .2 .15' mass='1' "
    "condim='1'/></body>"
    "<body name='f' pos='.1 .1 .3'><freejoint/><geom name='f' type='capsule' size='.12 .1' mass='1' solimp='.5 .9 .1 "
    ".5 1'/>"
    "<body name='g' pos='0 0 .2'><joint type='slide' axis='0 0 1'/><geom name='g' type='capsule' size='.1 .1' "
    "mass='1'/>"
    "</body></body>"
    "<body name='k' pos='-.1 -.1 .1'><joint type='slide' axis='0 0 1'/><geom type='box' size='.1 .1 .1' mass='1' "
    "quat='.7071067811865476 .5 .5 0'/></body>"
    "<body name='h' pos='.2 .2 .2'><joint type='slide' axis='1 0 0'/><joint type='slide' axis='0 0 1'/>"
    "<geom name='h' type='sphere' size='.15' mass='1' solimp='.9 .9 .01 .5 2'/>"
    "<body name='i'><joint type='hinge' axis='1 1 0' limited='true' range='-10 10'/><geom name='i' type='sphere' "
    "size='.1' "
    "mass='1' solref='-900 -30'/><geom type='box' size='.02 .2 .02' mass='1'/></body></body></worldbody>"
    "<contact><pair geom1='a' geom2='c' condim='3' friction='0 .5 0 0 0'/><pair geom1='a' geom2='f' condim='3' "
    "friction='.5 .9 0 0 0'/><pair geom1='f' geom2='g' condim='3'/><pair geom1='h' geom2='i' "
    "condim='3'/></contact></mujoco>";

// springs, friction losses and limits of scalar joints and of tendons along them, some of both ends at once
static const char scene_rows[] =
    "<mujoco><compiler angle='radian'/><worldbody><body pos='0 0 1'><freejoint/><geom type='capsule' size='.1 .2'/>"
    "<body pos='0 0 .3'><joint name='a' type='hinge' axis='0 1 0' range='-.2 .3' limited='true' stiffness='30' "
    "springref='.2' damping='.2' frictionloss='.5' solimplimit='.6 .95 .2 .3 3.5'/><geom type='capsule' size='.05 .1'/>"
    "<body pos='0 0 .2'><joint name='b' type='hinge' axis='1 0 0' range='-.1 .1' limited='true' margin='.15' "
    "frictionloss='.01' solreflimit='-400 -20' solimpfriction='.5 .9 .1 .5 2'/><geom type='sphere' size='.05'/>"
    "<body pos='0 0 .2'><joint name='c' type='slide' axis='0 1 1' range='-.3 .1' limited='true' stiffness='90' "
    "solimplimit='.7 .9 .3 .5 1'/><geom type='box' size='.05 .04 .03'/></body></body></body></body></worldbody><tendon>"
    "<fixed range='-.1 .2' limited='true' frictionloss='.4'><joint joint='a' coef='.5'/><joint joint='b' "
    "coef='-2'/></fixed>"
    "<fixed range='-.3 -.1' limited='true' margin='.2' solimplimit='.5 .9 .4 .6 2.5'><joint joint='c' coef='1.5'/>"
    "<joint joint='b' coef='.3'/></fixed></tendon></mujoco>";

// what was worked out under other options is not taken
static void test_change(cav_model *model) {
  if (!CHECK(model != NULL)) return;
  const int nq = model->nq, nv = model->nv;
  double *q = scene_vector(MANY * nq), *v = scene_vector(MANY * nv), *next = scene_vector(MANY * nv),
         *u = scene_vector(5 * nv);
  cav_lanes *lanes = cav_lanes_new(model);
  cav_state *state[CAV_LANES + 1];
  for (int l = 0; l <= CAV_LANES; l++) state[l] = cav_state_new(model);
  draw_many(model, q, v, next);
  for (int i = 0; i < 40; i += CAV_LANES) {
    const double *at[CAV_LANES], *now[CAV_LANES], *then[CAV_LANES];
    double *found[CAV_LANES];
    cav_status status[CAV_LANES];
    for (int l = 0; l <= CAV_LANES; l++) {
      state[l]->options.impratio = i % 8 ? 5 : 1;
      state[l]->options.timestep = i % 16 > 4 ? 0.01 : 0.002;
    }
    for (int l = 0; l < CAV_LANES; l++) {
      at[l] = row(q, i + l, nq), now[l] = row(v, i + l, nv), then[l] = row(next, i + l, nv), found[l] = row(u, l, nv);
    }
    cav_inverse_four(model, lanes, state, at, now, then, found, status);
    for (int l = 0; l < CAV_LANES; l++) {
      CHECK(!status[l] && !cav_inverse(model, state[CAV_LANES], at[l], now[l], then[l], row(u, CAV_LANES, nv)));
      CHECK(same(found[l], row(u, CAV_LANES, nv), nv));
    }
  }
  for (int l = 0; l <= CAV_LANES; l++) cav_state_free(state[l]);
  cav_lanes_free(lanes);
  free(q), free(v), free(next), free(u);
  cav_model_free(model);
}

static void test_scenes(void) {
  static const char *const ours[] = {"humanoid", "robot", "quadruped", "arm", "hopper"};
  const char *shared = check_shared_models();
  char path[4200];
  cav_error error = {0};
  for (size_t i = 0; i < sizeof ours / sizeof *ours; i++) {
    snprintf(path, sizeof path, "%s/problems/models/%s.xml", CAVORT_SOURCE_ROOT, ours[i]);
    test_scene(cav_model_load(path, &error), ours[i]);
  }
  test_scene(scene_load(scene_joints), "every joint");
  test_scene(scene_load(scene_rest), "the rest");
  test_change(scene_load(scene_heap));
  test_change(scene_load(scene_rows));
  by_rows = 0;
  test_scene(scene_load(scene_rows), "rows");
  CHECK(!cav_lanes_pay() || by_rows > MANY / 4);
  together = rare = 0;
  test_scene(scene_load(scene_heap), "a heap");
  CHECK(!cav_lanes_pay() || (together > 1000 && rare > 100));
  if (!shared) return;
  snprintf(path, sizeof path, "%s/unitree/g1/scene_29dof.xml", shared);
  test_scene(cav_model_load(path, &error), "G1 with meshes");
  snprintf(path, sizeof path, "%s/mujoco/humanoid.xml", shared);
  test_scene(cav_model_load(path, &error), "MuJoCo's humanoid");
}

int main(void) {
  cav_error error = {0};
  points p = draw(cav_model_load(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", &error));
  int touching = test_inverse(&p);
  CHECK(touching > ROWS / 3);
  test_forward(&p);
  test_jacobian(&p, CAV_DERIVATIVE_ANALYTIC);
  test_failures(&p);
  release(&p);
  p = draw(scene_load(scene_joints));
  test_inverse(&p);
  test_jacobian(&p, CAV_DERIVATIVE_FORWARD);
  release(&p);
  test_scenes();
  printf("%d of %d postures touch\n", touching, ROWS);
  return check_result();
}
