/// Equality constraints by the soft Gauss principle, Todorov 2014, eqs. (5)-(7): the impulse of each row is
/// f = R^-1 (v* - J v_next), whatever the others do, so the inverse has it in closed form. v* as for all constraints
/// (METHOD.md, 4) from the error x of
///
///   connect   p1 - p2, two points
///   weld      the same, and torquescale Im(conj(q2) q1): sines of half the angles between two frames
///   joint     q1 - r1 - polynomial(q2 - r2); of one joint alone q1 - r1 - constant. r is the value at q0
///   tendon    the same of lengths
///   distance  the gap between two geoms, less the distance asked for
///
/// Points and frames that turn accelerate without any force: v* of connects and welds has -h J'v besides, so that they
/// are held alike in any coordinates. J' and J are at v and q whatever the order of the step, so v* hangs on these
/// alone and the forward step stays convex.
///
/// Errors, weights and the impedance (by the length of x over all rows) are MuJoCo 3's; 2.2.2 has neither J'v nor the
/// weight of rotations, and both scale only the rate of a weld's rotation by torquescale and not the error, where all
/// agree at 1. It has no distance. Where the nearest points of a distance are not unique, the deepest point that the
/// pair's routine gives first counts; its J'v, which the shapes' curvatures are in, is left out.
#include "constraint.h"
#include "math3.h"

// whether it acts between links, else between joints or tendons
static int between_links(const cav_equality *e) {
  return e->type == CAV_EQUALITY_CONNECT || e->type == CAV_EQUALITY_WELD || e->type == CAV_EQUALITY_DISTANCE;
}

// --- errors ---

static void points(const cav_state *state, const cav_equality *e, cav_equality_rows *eq) {
  for (int k = 0; k < 2; k++) {
    const cav_pose *link = &state->link[e->link[k]];
    transform(eq->point[k], link->pos, link->rotation, e->pos[k]);
  }
  sub3(eq->error, eq->point[0], eq->point[1]);
}

void cav_weld_turn(double s, const double q2[4], const double y[4], const double q1[4], double r[3]) {
  double product[4];
  quat_mul(product, y, q1);
  quat_mul(product, q2, product);
  scale3(r, 0.5 * s, product + 1);
}

// x = s Im(conj(q2) q1), its rate s/2 Im(conj(q2) w q1) with w = w1 - w2 in world axes
static void weld_rotation(const cav_state *state, const cav_equality *e, cav_equality_rows *eq) {
  double frame[2][4], between[4];
  for (int k = 0; k < 2; k++) quat_mul(frame[k], state->link[e->link[k]].quat, e->quat[k]);
  quat_conjugate(frame[1], frame[1]);
  quat_mul(between, frame[1], frame[0]);
  scale3(eq->error + 3, e->torquescale, between + 1);
  for (int k = 0; k < 3; k++) {
    double spin[4] = {0, k == 0, k == 1, k == 2}, column[3];
    cav_weld_turn(e->torquescale, frame[1], spin, frame[0], column);
    for (int i = 0; i < 3; i++) eq->rotation[3 * i + k] = column[i];
  }
}

static cav_shape shape_of(const cav_model *model, const cav_state *state, int index) {
  const cav_geom *geom = &model->geom[index];
  const cav_pose *link = &state->link[geom->link];
  cav_shape shape = cav_shape_of(model, geom);
  transform(shape.pos, link->pos, link->rotation, geom->pos);
  matmul3(shape.rotation, link->rotation, geom->rotation);
  return shape;
}

// nearest points of two geoms, however far apart; both at the middle, which moves the same along the normal
static void distance(const cav_model *model, const cav_state *state, const cav_equality *e, cav_equality_rows *eq) {
  int swap = model->geom[e->object[0]].type > model->geom[e->object[1]].type, nearest = 0;
  cav_shape a = shape_of(model, state, e->object[swap]), b = shape_of(model, state, e->object[!swap]);
  double between[3];
  sub3(between, b.pos, a.pos);
  cav_touch touch[CAV_TOUCH_MAX];
  // a degenerate pair may have no point: then nothing is asked of it
  touch[0] = (cav_touch){.dist = e->distance};
  int n = cav_collide_shapes(&a, &b, 2 * norm3(between) + 1, touch);
  for (int k = 1; k < n; k++) {
    if (touch[k].dist < touch[nearest].dist) nearest = k;
  }
  eq->error[0] = touch[nearest].dist - e->distance;
  scale3(eq->normal, swap ? 1 : -1, touch[nearest].normal);
  copy3(eq->point[0], touch[nearest].pos);
  copy3(eq->point[1], touch[nearest].pos);
}

// x1 - r1 - polynomial(x2 - r2) and the polynomial's derivative
static void couple(const cav_equality *e, double x1, double x2, cav_equality_rows *eq) {
  double value = e->coef[0], derivative = 0, s = e->object[1] >= 0 ? x2 - e->reference[1] : 0, power = 1;
  for (int k = 1; k < 5 && e->object[1] >= 0; k++) {
    derivative += k * e->coef[k] * power;
    power *= s;
    value += e->coef[k] * power;
  }
  eq->error[0] = x1 - e->reference[0] - value;
  eq->derivative = derivative;
}

// value of a joint or a tendon; of none 0
static double value_of(const cav_model *model, const cav_state *state, const cav_equality *e, int side) {
  int object = e->object[side];
  if (object < 0) return 0;
  return e->type == CAV_EQUALITY_JOINT ? state->work->q[model->joint[object].q] : state->tendon_length[object];
}

void cav_equality_evaluate(const cav_model *model, cav_state *state) {
  if (!state->options.constraint) return;
  state->nequality = model->nequality;
  for (int i = 0; i < model->nequality; i++) {
    const cav_equality *e = &model->equality[i];
    cav_equality_rows *eq = &state->equality[i];
    eq->equality = i;
    eq->dim = e->dim;
    switch (e->type) {
      case CAV_EQUALITY_WELD:
        weld_rotation(state, e, eq);
        points(state, e, eq);
        break;
      case CAV_EQUALITY_CONNECT:
        points(state, e, eq);
        break;
      case CAV_EQUALITY_DISTANCE:
        distance(model, state, e, eq);
        break;
      default:
        couple(e, value_of(model, state, e, 0), value_of(model, state, e, 1), eq);
    }
    double square = 0;
    for (int k = 0; k < e->dim; k++) square += eq->error[k] * eq->error[k];
    cav_law law = cav_law_at(state, &e->softness, sqrt(square), e->weight[0]);
    double turned = e->dim == 6 ? cav_law_at(state, &e->softness, sqrt(square), e->weight[1]).regulariser : 0;
    for (int k = 0; k < e->dim; k++) eq->regulariser[k] = k < 3 ? law.regulariser : turned;
    eq->damping = law.damping;
    eq->stiffness = law.stiffness;
  }
}

// --- rates and impulses ---

static double rate_of(const cav_model *model, const cav_state *state, const cav_equality *e, int side,
                      const double *v) {
  int object = e->object[side];
  if (object < 0) return 0;
  return e->type == CAV_EQUALITY_JOINT ? v[model->joint[object].dof] : cav_tendon_velocity(state, object, v);
}

void cav_equality_velocity(const cav_model *model, const cav_state *state, const cav_equality_rows *eq, const double *v,
                           const double *velocity, double *out) {
  const cav_equality *e = &model->equality[eq->equality];
  if (!between_links(e)) {
    out[0] = rate_of(model, state, e, 0, v) - eq->derivative * rate_of(model, state, e, 1, v);
    return;
  }
  double linear[3] = {0, 0, 0}, angular[3] = {0, 0, 0};
  for (int k = 0; k < 2; k++) {
    if (e->link[k] == 0) continue;
    const double *V = velocity + 6 * e->link[k];
    double at[3];
    velocity_at(at, V, state->reference + 3 * e->link[k], eq->point[k]);
    axpy3(linear, linear, k ? -1 : 1, at);
    axpy3(angular, angular, k ? -1 : 1, V);
  }
  if (eq->dim == 1) {
    out[0] = dot3(eq->normal, linear);
    return;
  }
  copy3(out, linear);
  if (eq->dim == 6) { rotate(out + 3, eq->rotation, angular); }
}

void cav_point_motion(const double V[6], const double A[6], const double reference[3], const double point[3],
                      double velocity[6], double acceleration[6]) {
  copy3(velocity, V);
  velocity_at(velocity + 3, V, reference, point);
  copy3(acceleration, A);
  velocity_at(acceleration + 3, A, reference, point);
  cross_add3(acceleration + 3, velocity, velocity + 3);
}

// d/dt s/2 Im(conj(q2) w q1), w = w1 - w2: the frames turn too
static void weld_bias(const cav_state *state, const cav_equality *e, const double velocity[2][6],
                      const double acceleration[2][6], cav_equality_rows *eq) {
  double frame[2][4], w[3], sum[3], y[4];
  for (int k = 0; k < 2; k++) quat_mul(frame[k], state->link[e->link[k]].quat, e->quat[k]);
  quat_conjugate(frame[1], frame[1]);
  sub3(w, velocity[0], velocity[1]);
  add3(sum, velocity[0], velocity[1]);
  y[0] = -0.5 * dot3(w, w);
  cross3(y + 1, w, sum);
  scale3(y + 1, 0.5, y + 1);
  add3(y + 1, y + 1, acceleration[0]);
  sub3(y + 1, y + 1, acceleration[1]);
  cav_weld_turn(e->torquescale, frame[1], y, frame[0], eq->bias + 3);
}

void cav_equality_biases(const cav_model *model, cav_state *state, const double *v, const double *velocity) {
  double *bias = state->work->bias;
  if (!bias) return;
  cav_link_biases(model, state, v, velocity, bias);
  for (int i = 0; i < state->nequality; i++) {
    cav_equality_rows *eq = &state->equality[i];
    const cav_equality *e = &model->equality[eq->equality];
    if (!cav_equality_turns(e)) continue;
    double V[2][6], A[2][6];
    for (int k = 0; k < 2; k++) {
      int link = e->link[k];
      cav_point_motion(velocity + 6 * link, bias + 6 * link, state->reference + 3 * link, eq->point[k], V[k], A[k]);
    }
    sub3(eq->bias, A[0] + 3, A[1] + 3);
    if (eq->dim == 6) weld_bias(state, e, (const double(*)[6])V, (const double(*)[6])A, eq);
  }
}

// wrenches of an impulse on both links
static void push(cav_state *state, const cav_equality *e, const cav_equality_rows *eq, double scale) {
  double force[3], moment[3] = {0, 0, 0};
  if (eq->dim == 1) {
    scale3(force, eq->impulse[0], eq->normal);
  } else {
    copy3(force, eq->impulse);
  }
  if (eq->dim == 6) { rotate_back(moment, eq->rotation, eq->impulse + 3); }
  for (int k = 0; k < 2; k++) {
    if (e->link[k] == 0) continue;
    double *F = state->force + 6 * e->link[k], signed_force[3];
    scale3(signed_force, k ? -scale : scale, force);
    push_at(F, state->reference + 3 * e->link[k], eq->point[k], signed_force);
    axpy3(F, F, k ? -scale : scale, moment);
  }
}

void cav_equality_impulses(const cav_model *model, cav_state *state, const double *v, const double *velocity_now,
                           const double *v_next, double scale) {
  const double *coupled = state->options.coupled ? state->work->target + state->work->first_equality : NULL;
  for (int i = 0; i < state->nequality; i++) {
    cav_equality_rows *eq = &state->equality[i];
    const cav_equality *e = &model->equality[eq->equality];
    if (velocity_now) { cav_equality_velocity(model, state, eq, v, velocity_now, eq->velocity); }
    cav_equality_velocity(model, state, eq, v_next, state->velocity_next, eq->velocity_next);
    for (int k = 0; k < eq->dim; k++) {
      double target = coupled ? *coupled++ : cav_equality_target(state, eq, k);
      eq->impulse[k] = (target - eq->velocity_next[k]) / eq->regulariser[k];
    }
    if (between_links(e)) { push(state, e, eq, scale); }
  }
}

void cav_equality_apply(const cav_model *model, const cav_state *state, double scale, double *u) {
  for (int i = 0; i < state->nequality; i++) {
    const cav_equality_rows *eq = &state->equality[i];
    const cav_equality *e = &model->equality[eq->equality];
    if (between_links(e)) continue;
    for (int side = 0; side < 2 && e->object[side] >= 0; side++) {
      double force = scale * eq->impulse[0] * (side ? -eq->derivative : 1);
      if (e->type == CAV_EQUALITY_JOINT) {
        u[model->joint[e->object[side]].dof] += force;
      } else {
        cav_tendon_pull(state, e->object[side], force, u);
      }
    }
  }
}

// --- at q0 ---

// a point of one link in the frame of the other
static void move_point(const cav_state *state, cav_equality *e, int from, int to) {
  double point[3];
  const cav_pose *a = &state->link[e->link[from]], *b = &state->link[e->link[to]];
  transform(point, a->pos, a->rotation, e->pos[from]);
  sub3(point, point, b->pos);
  rotate_back(e->pos[to], b->rotation, point);
}

// frame 1 where frame 2 is at q0
static void align(const cav_state *state, cav_equality *e) {
  double back[4], world[4];
  quat_conjugate(back, state->link[e->link[0]].quat);
  quat_mul(world, state->link[e->link[1]].quat, e->quat[1]);
  quat_mul(e->quat[0], back, world);
}

// reference diagonals of A, translations first; of a weld's rotation the second
static void weigh(const cav_model *model, cav_equality *e) {
  e->weight[0] = e->weight[1] = 0;
  for (int side = 0; side < 2 && e->object[side] >= 0; side++) {
    int object = e->object[side];
    switch (e->type) {
      case CAV_EQUALITY_JOINT:
        e->weight[0] += model->dof[model->joint[object].dof].inverse_weight;
        break;
      case CAV_EQUALITY_TENDON:
        e->weight[0] += model->tendon[object].inverse_weight;
        break;
      case CAV_EQUALITY_DISTANCE:
        e->weight[0] += model->body[model->geom[object].body].inverse_weight[0];
        break;
      default:
        e->weight[0] += model->body[object].inverse_weight[0];
        e->weight[1] += model->body[object].inverse_weight[1];
    }
  }
}

void cav_equality_settle(const cav_model *model, const cav_state *state, cav_equality *e) {
  const double *frame = e->quat[0];
  int given = frame[0] != 0 || frame[1] != 0 || frame[2] != 0 || frame[3] != 0;
  if (e->type == CAV_EQUALITY_CONNECT && !e->placed) { move_point(state, e, 0, 1); }
  if (e->type == CAV_EQUALITY_WELD && !given) {
    move_point(state, e, 1, 0);
    align(state, e);
  }
  for (int side = 0; side < 2; side++) {
    int object = e->object[side];
    if (object < 0) continue;
    if (e->type == CAV_EQUALITY_JOINT) e->reference[side] = model->q0[model->joint[object].q];
    if (e->type == CAV_EQUALITY_TENDON) e->reference[side] = state->tendon_length[object];
  }
  weigh(model, e);
}
