/// Derivatives of whole problems: the gradient of the merit at every unknown, first and last knots included, the rows
/// of the constraints and their sparsity, against centred differences of the values; the same bits with one and two
/// threads. The same of a free start, of penalised forces on a root, of cycles, whose ends meet, moved, turned or
/// mirrored, and with the step as an unknown; products and solutions of their bordered normal equations against dense
/// ones. Seen: gradients to 2e-8 of their norm (bound 1e-6); rows to 3e-6 (bound 1e-4: the difference that they are
/// compared with); analytic derivatives and centred differences give the same Hessians to 2e-8 (bound 1e-6); no nonzero
/// outside the pattern, and none of the pattern of forces and ranges that stays zero.
#include "gauss_newton.h"
#include "quantity.h"
#include "readings.h"

#include "rotation.h"
#include "scene.h"

/// A body that floats over and touches a floor, with a ball joint, a tendon, limits near their ends and an unactuated
/// dof.
#define WALKER(FLOOR, CORD, MORE)                                                                                  \
  "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/>" FLOOR                                        \
  "<body name='trunk' pos='0 0 .3'><freejoint name='root'/><geom type='sphere' size='.1' mass='3'/>"               \
  "<site name='eye' pos='.1 0 .05'/>"                                                                              \
  "<body name='leg' pos='.1 0 -.05'><joint name='hip' axis='0 1 0' limited='true' range='-30 30' armature='.01' "  \
  "damping='.1'/>"                                                                                                 \
  "<geom type='capsule' size='.03' fromto='0 0 0 0 0 -.15' mass='.5'/>"                                            \
  "<body name='foot' pos='0 0 -.2'><joint name='ankle' axis='0 1 0' armature='.01'/>"                              \
  "<geom name='sole' type='capsule' size='.03' fromto='-.05 0 0 .1 0 0' mass='.2'/><site name='toe' pos='.1 0 "    \
  "0'/></body></body>"                                                                                             \
  "<body name='arm' pos='-.1 0 .1'><joint name='shoulder' type='ball' limited='true' range='0 60' damping='.05'/>" \
  "<geom type='capsule' size='.03' fromto='0 0 0 .1 0 -.25' mass='.4'/><site name='hand' pos='.1 0 "               \
  "-.25'/></body></body></worldbody>"                                                                              \
  "<tendon><fixed name='string' limited='true' range='-.5 .5'><joint joint='hip' coef='.5'/><joint joint='ankle' " \
  "coef='.5'/>"                                                                                                    \
  "</fixed>" CORD                                                                                                  \
  "</tendon>"                                                                                                      \
  "<actuator><motor joint='hip' gear='20' ctrllimited='true' ctrlrange='-1 1'/>"                                   \
  "<motor tendon='string' gear='5' ctrllimited='true' ctrlrange='-.5 1'/>" MORE "</actuator></mujoco>"
static const char walker[] = WALKER("", "", "");

/// The same across the edge of a slab.
static const char slabbed[] = WALKER("<geom name='slab' type='box' size='.2 .3 .01' pos='-.04 0 .01'/>", "", "");

/// The same with servos, whose limits of control move with their lengths and velocities.
static const char served[] = WALKER("", "",
                                    "<position joint='ankle' kp='3' gear='2' ctrllimited='true' ctrlrange='-.1 .2'"
                                    " forcelimited='true' forcerange='-.3 .2'/>"
                                    "<general tendon='string' gear='-1.5' gainprm='-4' biastype='affine' biasprm='.5 "
                                    "-3 -.7' dyntype='filter' dynprm='.1' "
                                    "ctrllimited='true' ctrlrange='-.3 .1'/>");

/// The same with a string from the trunk over a foot to a hand, whose arms turn with all of them.
static const char roped[] =
    WALKER("",
           "<spatial name='cord' limited='true' range='0 .3' stiffness='20' springlength='.1'><site site='eye'/>"
           "<site site='toe'/><pulley divisor='2'/><site site='toe'/><site site='hand'/></spatial>",
           "");

/// A body with two arms of ball joints and two legs, its own mirror image but for names.
static const char sided[] =
    "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/>"
    "<body name='trunk' pos='0 0 .3'><freejoint name='root'/><geom type='sphere' size='.1' mass='3'/>"
    "<site name='eye' pos='.1 0 .05'/>"
    "<body name='left leg' pos='.1 .1 -.05'><joint name='left hip' axis='.2 1 .1' limited='true' range='-30 40' "
    "armature='.01'/><geom type='capsule' size='.03' fromto='0 0 0 0 .02 -.2' mass='.5'/></body>"
    "<body name='right leg' pos='.1 -.1 -.05'><joint name='right hip' axis='.2 -1 .1' limited='true' range='-40 30' "
    "armature='.01'/><geom type='capsule' size='.03' fromto='0 0 0 0 -.02 -.2' mass='.5'/></body>"
    "<body name='arm_l' pos='-.1 .1 .1' euler='20 30 0'><joint name='shoulder_l' type='ball' limited='true' "
    "range='0 60'/><geom type='capsule' size='.03' fromto='0 0 0 .1 0 -.25' mass='.4'/></body>"
    "<body name='arm_r' pos='-.1 -.1 .1' euler='-20 30 0'><joint name='shoulder_r' type='ball' limited='true' "
    "range='0 60'/><geom type='capsule' size='.03' fromto='0 0 0 .1 0 -.25' mass='.4'/></body></body></worldbody>"
    "<actuator><motor joint='left hip' gear='20' ctrllimited='true' ctrlrange='-1 .5'/>"
    "<motor joint='right hip' gear='20' ctrllimited='true' ctrlrange='-.5 1'/></actuator></mujoco>";

/// Records of positions, velocities and accelerations with channels of every kind and gaps, as three terms.
static int fill_tracks(const cav_model *m, cav_term *term) {
  enum { FRAMES = 9, MOST = 12, COLUMNS = 32 };
  static cav_track track[3];
  static cav_channel channel[3][MOST];
  static double time[FRAMES], value[FRAMES * COLUMNS];
  int last = m->nbody - 1, eye = cav_object_find(m, CAV_OBJECT_SITE, "eye");
  for (int f = 0; f < FRAMES; f++) {
    time[f] = 0.48 + 0.022 * f;
    for (int c = 0; c < COLUMNS; c++) value[f * COLUMNS + c] = f == 3 && c % 5 == 0 ? NAN : 0.3 * scene_uniform();
  }
  memset(channel, 0, sizeof channel);
  for (int k = 0; k < 3; k++)
    track[k] = (cav_track){0, channel[k], FRAMES, COLUMNS, time, value, 0.022, 0.49, 0.01, 0, 0};
  for (int k = 0; k < 2; k++)
    channel[0][track[0].nchannel++] =
        (cav_channel){.kind = CAV_CHANNEL_MARKER, .object = k ? last : 1, .place = {.1, -.2, .05 * k}, .ncolumn = 3};
  for (int j = 0; j < m->njoint && j < 5; j++) {
    int free = m->joint[j].type == CAV_JOINT_FREE, ball = m->joint[j].type == CAV_JOINT_BALL;
    if (free)
      channel[0][track[0].nchannel++] = (cav_channel){.kind = CAV_CHANNEL_TRANSLATION, .object = j, .ncolumn = 3};
    channel[0][track[0].nchannel++] =
        (cav_channel){.kind = free || ball ? CAV_CHANNEL_ROTATION : CAV_CHANNEL_COORDINATE,
                      .object = j,
                      .ncolumn = free || ball ? 4 : 1};
  }
  static const cav_sensor_type type[] = {CAV_SENSOR_FRAMEQUAT, CAV_SENSOR_GYRO, CAV_SENSOR_ACCELEROMETER,
                                         CAV_SENSOR_FRAMEPOS};
  for (int k = 0; k < 4; k++) {
    cav_channel *c = &channel[k % 3][track[k % 3].nchannel++];
    *c = (cav_channel){.kind = CAV_CHANNEL_SENSOR, .component = k == 3 ? 1 : -1};
    CHECK(cav_sensor_of(m, type[k], CAV_OBJECT_SITE, eye, &c->sensor, NULL) == CAV_OK);
    c->ncolumn = k == 3 ? 1 : c->sensor.dim;
  }
  for (int k = 0; k < 3; k++) {
    for (int i = 0, at = 0; i < track[k].nchannel; at += channel[k][i++].ncolumn)
      channel[k][i].name = "", channel[k][i].column = at, channel[k][i].sd = k == 2 ? 30 : 0.5 + 0.1 * i;
    term[k] = cav_term_cost(CAV_QUANTITY_TRACK, 3 + k);
    term[k].track = &track[k];
    term[k].scale = 0.8;
    term[k].norm = k == 1 ? CAV_NORM_ABSOLUTE : CAV_NORM_SQUARE;
  }
  return 3;
}

/// Costs of every quantity, hard terms of every kind, windows of both kinds.
static int fill_terms(const cav_model *m, const cav_problem *p, cav_term *term) {
  static double eye_target[3] = {0.2, 0.1, 0.5}, quat_target[4] = {0.9, 0.1, 0.3, 0.3},
                waypoints[6] = {0, 0, 0.3, 0.1, 0, 0.4};
  static double waypoint_time[2] = {0, 0.15};
  int n = cav_problem_default_terms(term, 16), trunk = cav_object_find(m, CAV_OBJECT_BODY, "trunk");
  cav_term base = term[0];
  base.quantity = CAV_QUANTITY_SENSOR;
  base.weight = 3;
  for (int kind = 0; kind < 20; kind++) {
    cav_term *t = &term[n++];
    *t = base;
    t->scale = 0.5 + 0.1 * kind;
    t->sensor = (cav_sensor){.name = "", .type = CAV_SENSOR_FRAMEPOS, .object_type = CAV_OBJECT_SITE, .dim = 3};
    t->sensor.object = cav_object_find(m, CAV_OBJECT_SITE, "eye");
    t->target = eye_target;
    if (kind == 0) t->from = t->to = p->duration;
    if (kind == 1) t->sensor.type = CAV_SENSOR_FRAMEQUAT, t->sensor.dim = 4, t->target = quat_target;
    if (kind == 2) t->sensor.type = CAV_SENSOR_FRAMELINVEL, t->use = CAV_USE_EQUAL, t->from = 0.05, t->to = 0.1;
    if (kind == 3) {
      t->sensor = (cav_sensor){
          .name = "", .type = CAV_SENSOR_SUBTREECOM, .object_type = CAV_OBJECT_BODY, .object = trunk, .dim = 3};
      t->nwaypoint = 2;
    }
    if (kind == 3) t->target = waypoints, t->waypoint_time = waypoint_time;
    if (kind == 4) t->use = CAV_USE_RANGE, t->lower = -0.01, t->upper = 0.01, t->component = 2;
    if (kind == 5)
      t->quantity = CAV_QUANTITY_CONFIGURATION, t->use = CAV_USE_EQUAL, t->from = t->to = p->duration, t->target = NULL;
    if (kind == 6)
      t->quantity = CAV_QUANTITY_VELOCITY, t->use = CAV_USE_RANGE, t->lower = -0.1, t->upper = 0.1, t->target = NULL;
    // norms, and contacts of one body
    if (kind == 11) t->norm = CAV_NORM_ABSOLUTE, t->scale = 0.1;
    if (kind == 12) t->quantity = CAV_QUANTITY_FORCE, t->target = NULL, t->norm = CAV_NORM_ABSOLUTE, t->scale = 0.2;
    if (kind == 13) t->quantity = CAV_QUANTITY_SLIP, t->target = NULL, t->body = trunk;
    if (kind == 14) t->quantity = CAV_QUANTITY_ACCELERATION, t->use = CAV_USE_EQUAL, t->target = NULL, t->scale = 50;
    if (kind == 17) t->quantity = CAV_QUANTITY_SELF_FORCE, t->target = NULL;
    if (kind == 19) t->quantity = CAV_QUANTITY_CLEARANCE, t->target = NULL, t->scale = 0.05;
    if (kind == 18) t->quantity = CAV_QUANTITY_EDGE_FORCE, t->target = NULL, t->scale = 0.05;
    if (kind == 15 || kind == 16) t->quantity = CAV_QUANTITY_POWER, t->target = NULL, t->scale = 0.3;
    if (kind == 16) t->norm = CAV_NORM_ABSOLUTE, t->scale = 0.05;
    if (kind >= 11) continue;
    // accelerations and forces, of the size of gravity and of weight
    if (kind >= 7) t->target = NULL, t->scale = 50;
    if (kind == 7) t->sensor.type = CAV_SENSOR_FRAMELINACC, t->use = CAV_USE_EQUAL;
    if (kind == 8) t->sensor.type = CAV_SENSOR_FORCE;
    if (kind == 9) t->sensor.type = CAV_SENSOR_TORQUE, t->use = CAV_USE_EQUAL;
    if (kind == 10)
      t->sensor = (cav_sensor){
          .name = "", .type = CAV_SENSOR_ACTUATORFRC, .object_type = CAV_OBJECT_ACTUATOR, .object = 1, .dim = 1};
  }
  return n + fill_tracks(m, term + n);
}

/// A way at random from the start, which is moved too where it is free.
static void shake(cav_trajectory *at, const cav_model *m, double size, int free_start) {
  double step[64];
  for (int d = 0; d < m->nv && free_start; d++) step[d] = size * scene_uniform();
  if (free_start) cav_integrate(m, m->q0, step, 1, at->q);
  for (int t = 1; t < at->nknot; t++) {
    for (int d = 0; d < m->nv; d++) step[d] = size * scene_uniform();
    cav_integrate(m, at->q + (t - 1) * at->nq, step, 1, at->q + t * at->nq);
  }
  cav_trajectory_velocities(m, at);
}

/// Brings the start of a cycle to where its end says.
static void close_cycle(cav_transcription *tr, cav_trajectory *at) {
  double *x = calloc((size_t)cav_transcription_unknowns(tr), sizeof *x);
  cav_trajectory *from = cav_trajectory_copy(at);
  if (tr->periodicity) cav_transcription_move(tr, from, x, at);
  cav_trajectory_free(from);
  free(x);
}

static double merit_at(cav_transcription *tr, const cav_trajectory *at, cav_trajectory *moved, double *x, int i,
                       double step) {
  x[i] = step;
  cav_transcription_move(tr, at, x, moved);
  x[i] = 0;
  CHECK(cav_transcription_values(tr, moved) == CAV_OK);
  return cav_transcription_merit(tr);
}

/// The summed gradient against differences of the summed merit.
static void test_gradient(cav_transcription *tr, cav_trajectory *at) {
  const cav_model *m = tr->model;
  int n = cav_transcription_unknowns(tr);
  double *gradient = calloc((size_t)n, sizeof(double)), *x = calloc((size_t)n, sizeof(double)), norm = 0, worst = 0;
  cav_trajectory *moved = cav_trajectory_copy(at);
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  for (int t = 0; t < tr->nknot; t++) {
    for (int c = 0; c < 3 * m->nv; c++) {
      int block = cav_transcription_block(tr, t, c / m->nv);
      if (block >= 0) gradient[block * m->nv + c % m->nv] += tr->knot[t].gradient[c];
      if (block < 0) CHECK(tr->knot[t].gradient[c] == 0);
    }
    if (tr->free_step) gradient[n - 1] += tr->knot[t].step_derivative;
  }
  for (int i = 0; i < n; i++) norm = fmax(norm, fabs(gradient[i]));
  for (int i = 0; i < n; i += check_every(7)) {
    double step = 1e-5,
           derivative = (merit_at(tr, at, moved, x, i, step) - merit_at(tr, at, moved, x, i, -step)) / (2 * step);
    double error = fabs(derivative - gradient[i]) / norm;
    if (error > worst) worst = error;
    if (error > 1e-6)
      printf("knot %d dof %d: %.9g against %.9g\n", i / m->nv + tr->first, i % m->nv, gradient[i], derivative);
  }
  printf("gradient: largest %.3g, worst error %.3g of it\n", norm, worst);
  CHECK(worst < 1e-6);
  // a control: one wrong component is seen
  CHECK(norm > 1e-3);
  free(gradient), free(x);
  cav_trajectory_free(moved);
}

/// What an evaluation leaves at a knot, as one number: merit, cost, forces, readings, rows.
static double print_of(const cav_transcription *tr) {
  double sum = tr->options.timestep, weight = 1;
  for (int t = 0; t < tr->nknot; t++) {
    const cav_knot *knot = &tr->knot[t];
    sum += (weight *= 1.0009) * (knot->merit + 3 * knot->cost + 5 * knot->nread + 7 * knot->ncontact + 11 * knot->nrow);
    for (int d = 0; d < tr->nv; d++) sum += (weight *= 1.0009) * knot->u[d];
    for (int i = 0; i < knot->nread; i++) sum += (weight *= 1.0009) * knot->y[i];
    for (int i = 0; i < knot->ncontact; i++) sum += (weight *= 1.0009) * knot->moving[i];
    for (int i = 0; i < knot->layout.count; i++)
      sum += (weight *= 1.0009) * (knot->slot[i].value + fmax(-9, knot->slot[i].lower) + fmin(9, knot->slot[i].upper));
  }
  return sum;
}

/// Values that were put by and taken back after others are those of an evaluation, to the bit.
static void test_return(cav_transcription *tr, cav_trajectory *at) {
  int n = cav_transcription_unknowns(tr);
  double *x = calloc((size_t)n, sizeof(double));
  cav_trajectory *moved = cav_trajectory_copy(at), *back = cav_trajectory_copy(at);
  for (int i = 0; i < n; i++) x[i] = 0.05 * sin(3 * i);
  cav_transcription_move(tr, at, x, moved);
  memset(back->u, 0, (size_t)tr->nknot * (size_t)tr->nv * sizeof(double));
  CHECK(cav_transcription_values(tr, at) == CAV_OK && cav_values_keep(tr));
  double here = print_of(tr);
  CHECK(cav_transcription_values(tr, moved) == CAV_OK);
  CHECK(print_of(tr) != here);
  CHECK(cav_transcription_return(tr, back) == CAV_OK);
  CHECK(print_of(tr) == here);
  CHECK(!memcmp(back->u, at->u, (size_t)tr->nknot * (size_t)tr->nv * sizeof(double)));
  free(x);
  cav_trajectory_free(moved), cav_trajectory_free(back);
}

/// Values within a bound: all and to the bit where the merit is within; where it is not, that, and
/// not all knots: the values of some are still those of another motion.
static void test_within(cav_transcription *tr, cav_trajectory *at) {
  cav_trajectory *moved = cav_trajectory_copy(at);
  double *x = calloc((size_t)cav_transcription_unknowns(tr), sizeof(double));
  for (int i = 0; i < cav_transcription_unknowns(tr); i++) x[i] = 0.05 * sin(3 * i);
  cav_transcription_move(tr, at, x, moved);
  CHECK(cav_transcription_values(tr, at) == CAV_OK);
  const double merit = cav_transcription_merit(tr), print = print_of(tr), bounds[] = {INFINITY, 2 * merit, merit};
  for (int k = 0; k < 3; k++) {
    int beyond = 1;
    CHECK(cav_transcription_values(tr, moved) == CAV_OK && print_of(tr) != print);
    CHECK(cav_transcription_values_within(tr, at, bounds[k], &beyond) == CAV_OK && !beyond);
    CHECK(print_of(tr) == print && cav_transcription_merit(tr) == merit);
  }
  const double short_of[] = {merit * (1 - 1e-9), 0.5 * merit, 0, -1};
  for (int k = 0; k < 4; k++) {
    int beyond = 0, left = 0;
    CHECK(cav_transcription_values(tr, moved) == CAV_OK);
    for (int t = 0; t < tr->nknot; t++) tr->knot[t].cost = -1;
    CHECK(cav_transcription_values_within(tr, at, short_of[k], &beyond) == CAV_OK && beyond);
    for (int t = 0; t < tr->nknot; t++) left += tr->knot[t].cost == -1;
    CHECK(k < 2 || left == tr->nknot || (k == 2 && left >= tr->nknot - cav_parallel_size(tr->pool)));
  }
  CHECK(cav_transcription_values(tr, at) == CAV_OK && print_of(tr) == print);
  free(x);
  cav_trajectory_free(moved);
}

/// Rows of the constraints against differences of their values, and their pattern: all that is nonzero is in it, and
/// all that is in it is nonzero somewhere (but for hard sensor terms, whose pattern is that of the whole reading).
static void test_rows(cav_transcription *tr, cav_trajectory *at, int tries) {
  const cav_model *m = tr->model;
  int width = 3 * m->nv, extra = 0, total = 0, unused = 0;
  double worst = 0;
  size_t most = 0, rows = 0;
  for (int t = 0; t < tr->nknot; t++) most += (size_t)tr->knot[t].layout.count;
  char *pattern = calloc((size_t)(width + m->nv), 1), *used = calloc(most * (size_t)width, 1);
  double *x = calloc((size_t)cav_transcription_unknowns(tr), sizeof(double)), *plus = malloc(most * sizeof(double));
  cav_trajectory *moved = cav_trajectory_copy(at);
  CHECK(cav_transcription_keep_rows(tr));
  for (int k = 0; k < tries; k++) {
    shake(at, m, k + 1 < tries ? 0.4 : 0.05, tr->first < 0);
    close_cycle(tr, at);
    CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
    rows = 0;
    for (int t = 0; t < tr->nknot; t++)
      for (int i = 0; i < tr->knot[t].layout.count; i++, rows++)
        for (int c = 0; c < width; c++)
          used[rows * (size_t)width + (size_t)c] |= tr->knot[t].slot_row[i * width + c] != 0;
  }
  // differences at the last point, for the first, a middle and the last knot, and for the step
  for (int t = tr->first; t < tr->nknot + tr->free_step; t++) {
    if (t > 1 && t != tr->nknot / 2 && t < tr->nknot - 1) continue;
    for (int d = 0; d < (t < tr->nknot ? m->nv : 1); d += check_every(5)) {
      double step = 1e-6;
      int i = (t - tr->first) * m->nv + d;
      merit_at(tr, at, moved, x, i, step);
      size_t at_row = 0;
      for (int s = 0; s < tr->nknot; s++)
        for (int r = 0; r < tr->knot[s].layout.count; r++) plus[at_row++] = tr->knot[s].slot[r].value;
      merit_at(tr, at, moved, x, i, -step);
      at_row = 0;
      for (int s = 0; s < tr->nknot; s++)
        for (int r = 0; r < tr->knot[s].layout.count; r++, at_row++) {
          double derivative = (plus[at_row] - tr->knot[s].slot[r].value) / (2 * step);
          double row = t < tr->nknot ? 0 : tr->knot[s].slot_step[r];
          for (int c = 0; c < 3; c++)
            if (cav_transcription_block(tr, s, c) == t - tr->first)
              row = tr->knot[s].slot_row[r * width + c * m->nv + d];
          worst = fmax(worst, fabs(derivative - row) / fmax(1, fabs(row)));
        }
    }
  }
  rows = 0;
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++, rows++) {
      cav_transcription_pattern(tr, t, i, pattern);
      for (int c = 0; c < width; c++) {
        int is = used[rows * (size_t)width + (size_t)c];
        extra += is && !pattern[c];
        unused += i < tr->knot[t].layout.term && pattern[c] && !is;
        total += pattern[c];
      }
    }
  printf("rows: worst error %.3g; pattern of %d entries, %d outside it, %d never used\n", worst, total, extra, unused);
  CHECK(worst < 1e-4);
  CHECK(extra == 0);
  CHECK(unused == 0);
  free(pattern), free(used), free(x), free(plus);
  cav_trajectory_free(moved);
}

/// Both ways to derivatives give the same Hessians, and differences stand in for accelerations and forces alone.
static void test_methods(cav_transcription *tr, cav_trajectory *at) {
  size_t n = 9 * (size_t)tr->nv * tr->nv;
  double *hessian = malloc((size_t)tr->nknot * n * sizeof *hessian), worst = 0;
  int accelerations = 0;
  tr->scratch->differenced = 0;
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  for (int t = 0; t < tr->nknot; t++) {
    memcpy(hessian + (size_t)t * n, tr->knot[t].hessian, n * sizeof *hessian);
    for (int i = 0; i < tr->problem->nterm; i++) {
      const cav_term *term = &tr->problem->term[i];
      if (!cav_term_is_reading(term) || cav_term_weight(tr, term, t) == 0) continue;
      accelerations += cav_term_stage(term) == CAV_READS_ACCELERATION;
    }
  }
  CHECK(tr->scratch->differenced == accelerations);
  tr->derivative = tr->difference = CAV_DERIVATIVE_CENTRED;
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  CHECK(tr->scratch->differenced == accelerations + tr->nknot);
  for (int t = 0; t < tr->nknot; t++)
    worst = fmax(worst, scene_error(hessian + (size_t)t * n, tr->knot[t].hessian, (int)n));
  printf("analytic against centred: Hessians differ by %.3g\n", worst);
  CHECK(worst < 1e-6);
  tr->derivative = CAV_DERIVATIVE_ANALYTIC;
  tr->difference = CAV_DERIVATIVE_FORWARD;
  free(hessian);
}

/// Rows of servos are their controls over the limit: effort less what the actuator does without control, over its gain;
/// those whose force is limited too have a row of that before.
static void test_controls(const cav_transcription *tr, const cav_trajectory *at) {
  const cav_model *m = tr->model;
  cav_state *state = cav_state_new(m);
  double *effort = scene_vector(m->nu), *moment = scene_vector(m->nv);
  for (int t = 1; t + 1 < tr->nknot; t++) {
    CHECK(cav_position(m, state, at->q + t * at->nq) == CAV_OK);
    cav_actuation(m, state, tr->knot[t].u, NULL, effort);
    for (int k = 0; k < tr->nlimit; k++) {
      int a = tr->limited[k];
      const cav_actuator *x = &m->actuator[a];
      double value = tr->knot[t].slot[tr->knot[t].layout.effort + k].value;
      if (k < m->nu && x->forcelimited)
        CHECK_NEAR(value, effort[a] / fmax(fabs(x->forcerange[0]), fabs(x->forcerange[1])), 1e-9 * (1 + fabs(value)));
      if (!cav_servo_bounds(m, a) || (k < m->nu && x->forcelimited)) continue;
      double length = cav_actuator_length(m, state, a, moment), velocity = 0;
      for (int d = 0; d < m->nv; d++) velocity += moment[d] * at->v[t * m->nv + d];
      const double *p = x->bias_parameter;
      double control = (effort[a] - p[0] - p[1] * length - p[2] * velocity) / x->gain_parameter[0];
      double limit = fmax(fabs(x->ctrlrange[0]), fabs(x->ctrlrange[1]));
      CHECK_NEAR(value, control / limit, 1e-9 * (1 + fabs(value)));
    }
  }
  cav_state_free(state);
  free(effort), free(moment);
}

static void test_threads(const cav_problem *p, cav_transcription *one, cav_trajectory *at) {
  cav_transcription *two = cav_transcription_new(p, 2, NULL);
  if (!CHECK(two != NULL)) return;
  two->options = one->options;
  two->penalty = one->penalty;
  two->depth_weight = one->depth_weight;
  for (int t = 0; t < one->nknot; t++)
    memcpy(two->knot[t].slot, one->knot[t].slot, (size_t)one->knot[t].layout.count * sizeof(cav_slot));
  CHECK(cav_transcription_linearise(one, at) == CAV_OK && cav_transcription_linearise(two, at) == CAV_OK);
  for (int t = 0; t < one->nknot; t++) {
    size_t n = (size_t)one->nv;
    CHECK(!memcmp(one->knot[t].hessian, two->knot[t].hessian, 9 * n * n * sizeof(double)));
    CHECK(!memcmp(one->knot[t].gradient, two->knot[t].gradient, 3 * n * sizeof(double)));
  }
  cav_transcription_free(two);
}

/// Knots that are gathered and factored on the way by 1 to 4 threads, against one after the other: the same bits.
static void test_stream(const cav_problem *p, cav_transcription *one, cav_trajectory *at) {
  size_t n = (size_t)cav_transcription_unknowns(one), bytes = n * sizeof(double);
  cav_normal *normal = cav_normal_new(one);
  double *x = malloc(bytes), *y = malloc(bytes);
  int entries = cav_normal_entries(normal, NULL, NULL, NULL);
  double *value = malloc((size_t)entries * sizeof *value), *other = malloc((size_t)entries * sizeof *other);
  CHECK(cav_transcription_linearise(one, at) == CAV_OK);
  cav_normal_gather(normal, one);
  CHECK(cav_normal_factor(normal, 1e-6) == CAV_OK);
  cav_normal_entries(normal, NULL, NULL, value);
  cav_normal_solve(normal, normal->gradient, x);
  for (int threads = 1; threads <= 4; threads++) {
    cav_transcription *tr = cav_transcription_new(p, threads, NULL);
    cav_normal *way = tr ? cav_normal_new(tr) : NULL;
    if (!CHECK(way != NULL)) return;
    tr->options = one->options;
    tr->penalty = one->penalty;
    tr->depth_weight = one->depth_weight;
    for (int t = 0; t < one->nknot; t++)
      memcpy(tr->knot[t].slot, one->knot[t].slot, (size_t)one->knot[t].layout.count * sizeof(cav_slot));
    for (int turn = 0; turn < 4; turn++) {
      cav_status factored = CAV_NOT_CONVERGED;
      CHECK(cav_normal_linearise(way, tr, at, 1e-6, &factored) == CAV_OK && factored == CAV_OK);
      cav_normal_entries(way, NULL, NULL, other);
      cav_normal_solve(way, way->gradient, y);
      CHECK(!memcmp(normal->gradient, way->gradient, bytes) && !memcmp(normal->diagonal, way->diagonal, bytes));
      CHECK(!memcmp(value, other, (size_t)entries * sizeof *value) && !memcmp(x, y, bytes));
      // nothing later than a knot that fails is taken
      tr->knot[one->nknot / 2].slot->multiplier = NAN;
      CHECK(cav_normal_linearise(way, tr, at, 1e-6, &factored) == CAV_NOT_FINITE);
      tr->knot[one->nknot / 2].slot->multiplier = one->knot[one->nknot / 2].slot->multiplier;
    }
    cav_normal_free(way);
    cav_transcription_free(tr);
  }
  cav_normal_free(normal);
  free(x), free(y), free(value), free(other);
}

/// Solutions and products of normal equations against those of the dense matrix that their entries make.
static void test_normal(cav_transcription *tr, cav_trajectory *at) {
  cav_normal *normal = cav_normal_new(tr);
  int n = cav_transcription_unknowns(tr), entries = cav_normal_entries(normal, NULL, NULL, NULL);
  size_t square = (size_t)n * n;
  double *dense = calloc(square, sizeof(double)), *summed = calloc(square, sizeof(double)), worst = 0, largest = 0;
  double *x = scene_vector(n), *b = scene_vector(n), *product = scene_vector(n), *value = scene_vector(entries);
  int *row = calloc((size_t)entries, sizeof(int)), *column = calloc((size_t)entries, sizeof(int)), nv = tr->nv;
  CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
  cav_normal_gather(normal, tr);
  cav_normal_entries(normal, row, column, value);
  for (int k = 0; k < entries; k++) {
    CHECK(row[k] >= column[k] && (k == 0 || column[k] > column[k - 1] || row[k] > row[k - 1]));
    dense[row[k] * n + column[k]] = dense[column[k] * n + row[k]] = value[k];
  }
  // the sum over knots, made here
  for (int t = 0; t < tr->nknot; t++) {
    for (int r = 0; r < 3 * nv; r++)
      for (int c = 0; c < 3 * nv; c++) {
        int i = cav_transcription_block(tr, t, r / nv), j = cav_transcription_block(tr, t, c / nv);
        int low = r > c ? c : r, high = r > c ? r : c;
        if (i < 0 || j < 0) continue;
        summed[(i * nv + r % nv) * n + j * nv + c % nv] += tr->knot[t].hessian[high * 3 * nv + low];
      }
    for (int c = 0; c < 3 * nv && tr->free_step; c++) {
      int i = cav_transcription_block(tr, t, c / nv);
      if (i < 0) continue;
      summed[(i * nv + c % nv) * n + n - 1] += tr->knot[t].step_row[c];
      summed[(n - 1) * n + i * nv + c % nv] += tr->knot[t].step_row[c];
    }
    if (tr->free_step) summed[square - 1] += tr->knot[t].step_square;
  }
  for (size_t i = 0; i < square; i++) {
    worst = fmax(worst, fabs(summed[i] - dense[i]));
    largest = fmax(largest, fabs(dense[i]));
  }
  CHECK(worst < 1e-12 * largest);
  scene_normals(x, n, 1);
  cav_normal_multiply(normal, x, product);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) b[i] += dense[(size_t)i * n + j] * x[j];
  double off = scene_error(product, b, n);
  CHECK(off < 1e-13);
  // what was multiplied is found again, with the shift that the factor has on its diagonal
  const double shift = 0.1, *diagonal = cav_normal_diagonal(normal);
  CHECK(cav_normal_factor(normal, shift) == CAV_OK);
  for (int i = 0; i < n; i++) b[i] += (diagonal[i] > 0 ? shift * diagonal[i] : 1) * x[i];
  cav_normal_solve(normal, b, product);
  double wrong = scene_error(product, x, n);
  printf("normal equations: %d unknowns, product off by %.2g, solution by %.2g\n", n, off, wrong);
  CHECK(wrong < 1e-9);
  cav_normal_free(normal);
  free(dense), free(summed), free(x), free(b), free(product), free(value), free(row), free(column);
}

/// How a scene is to be closed.
typedef struct closing {
  int at_rest, free_step, free_start, penalised;
  cav_cycle cycle;
  double depth; ///< what depth costs
} closing;

static void test_scene(const char *scene, closing close, cav_order order) {
  cav_model *m = scene_load(scene);
  if (!CHECK(m != NULL)) return;
  cav_term term[40];
  double v_start[64] = {0}, q_start[64], q_goal[64];
  cav_problem p = cav_problem_default(m);
  p.order = order;
  p.close_at_rest = close.at_rest;
  p.cycle = close.cycle;
  p.free_start = close.free_start;
  if (close.penalised) p.residual = (cav_residual){.force = 7, .torque = 0.5};
  p.duration = 0.15;
  if (close.free_step) p.duration_least = 0.1, p.duration_most = 0.3, p.duration_weight = 700;
  memcpy(q_start, m->q0, (size_t)m->nq * sizeof(double));
  memcpy(q_goal, m->q0, (size_t)m->nq * sizeof(double));
  for (int d = 0; d < m->nv; d++) v_start[d] = 0.3 * scene_uniform();
  p.q_start = q_start, p.q_goal = q_goal, p.v_start = v_start;
  p.nterm = fill_terms(m, &p, term);
  p.term = term;
  cav_error error = {0};
  cav_transcription *tr = cav_transcription_new(&p, 1, &error);
  if (!CHECK(tr != NULL)) {
    fprintf(stderr, "    %s\n", error.text);
    cav_model_free(m);
    return;
  }
  cav_trajectory *at = cav_trajectory_new(m, tr->nknot, p.timestep);
  memcpy(at->v, v_start, (size_t)m->nv * sizeof(double));
  shake(at, m, 0.05, p.free_start);
  close_cycle(tr, at);
  tr->options.stabilisation = CAV_STABILISATION_DISCRETE;
  tr->options.softness = 0.5;
  tr->options.smoothing = 0.03;
  tr->options.smoothing_self = 0.02;
  tr->penalty = (cav_penalties){1e3, 100, 1000, 200};
  tr->depth_weight = close.depth;
  tr->options.saturation = close.depth > 0 ? 0.02 : 0;
  for (int t = 0; t < tr->nknot; t++)
    for (int i = 0; i < tr->knot[t].layout.count; i++) tr->knot[t].slot[i].multiplier = scene_uniform();
  test_gradient(tr, at);
  if (!cav_derivatives_missing(m)) test_methods(tr, at);
  test_return(tr, at);
  test_within(tr, at);
  test_controls(tr, at);
  test_threads(&p, tr, at);
  test_stream(&p, tr, at);
  test_normal(tr, at);
  test_rows(tr, at, 60);
  cav_trajectory_free(at);
  cav_transcription_free(tr);
  cav_model_free(m);
}

/// Trees that nothing joins: the Hessian is the product of the rows, made here, and its solutions are those of the
/// dense matrix; a body that reaches another makes one group of the two, and a free step none.
static void test_apart(int cyclic, int touching, int free_step) {
  char text[2000];
  snprintf(text, sizeof text,
           "<mujoco><worldbody><body pos='0 0 1'><freejoint/><geom size='.1'/></body>"
           "<body pos='3 0 1'><freejoint/><geom type='box' size='.1 .2 .1'/></body>"
           "<body pos='%g 0 1'><freejoint/><geom size='.1'/></body>"
           "<body pos='9 0 1'><joint axis='0 1 0'/><geom type='capsule' size='.1' fromto='0 0 0 .5 0 0'/></body>"
           "</worldbody></mujoco>",
           touching ? 0.201 : 6.0);
  cav_model *m = scene_load(text);
  if (!CHECK(m != NULL)) return;
  double rest[64] = {0}, q[64];
  cav_problem p = cav_problem_default(m);
  p.duration = 0.15;
  if (free_step) p.duration_least = 0.1, p.duration_most = 0.3;
  p.cycle.on = cyclic;
  p.nterm = 0;
  memcpy(q, m->q0, (size_t)m->nq * sizeof *q);
  p.q_start = p.q_goal = q, p.v_start = rest;
  cav_error error = {0};
  cav_transcription *tr = cav_transcription_new(&p, 1, &error);
  if (!CHECK(tr != NULL)) fprintf(stderr, "    %s\n", error.text);
  if (tr) {
    cav_trajectory *at = cav_trajectory_new(m, tr->nknot, p.timestep);
    shake(at, m, 0.005, 0);
    close_cycle(tr, at);
    tr->options.stabilisation = CAV_STABILISATION_DISCRETE;
    tr->options.smoothing = 0.03;
    tr->penalty = (cav_penalties){1e3, 100, 1000, 200};
    // first of rows alone
    const double smoothness = tr->smoothness;
    CHECK(smoothness > 0);
    tr->smoothness = 0;
    CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
    int width = 3 * tr->nv, most = 0;
    double worst = 0, largest = 0;
    for (int t = 2; t < tr->nknot - 1; t++) // knots beside the seam of a cycle hold more than the product
      for (int i = 0; i < width; i++)
        for (int j = 0; j <= i; j++) {
          double sum = 0;
          for (int k = 0; k < tr->knot[t].ndense; k++)
            sum += tr->knot[t].dense[k * width + i] * tr->knot[t].dense[k * width + j];
          worst = fmax(worst, fabs(sum - tr->knot[t].hessian[i * width + j]));
          largest = fmax(largest, fabs(sum));
        }
    CHECK(largest > 0 && worst <= 1e-13 * largest);
    tr->smoothness = smoothness;
    CHECK(cav_transcription_linearise(tr, at) == CAV_OK);
    cav_normal *normal = cav_normal_new(tr);
    cav_normal_gather(normal, tr);
    CHECK(cav_normal_groups(normal, &most) == (touching ? 3 : 4) && most == (touching ? 12 : 6));
    cav_normal_free(normal);
    test_stream(&p, tr, at);
    test_normal(tr, at);
    cav_trajectory_free(at);
  }
  cav_transcription_free(tr);
  cav_model_free(m);
}

/// SO(3) Jacobians against differences of the exponential.
static void test_rotations(void) {
  for (int k = 0; k < 200; k++) {
    double phi[3], J[9], inverse[9], size = k < 20 ? 1e-5 : 1.2;
    for (int c = 0; c < 3; c++) phi[c] = size * scene_uniform();
    cav_rotation_jacobian(phi, J);
    cav_rotation_jacobian_inverse(phi, inverse);
    for (int r = 0; r < 3; r++)
      for (int c = 0; c < 3; c++) {
        double sum = 0;
        for (int i = 0; i < 3; i++) sum += J[3 * r + i] * inverse[3 * i + c];
        CHECK_NEAR(sum, r == c, 1e-11);
      }
  }
}

/// Power of two motors that pull one slide, alone and by a geared tendon, and of one that turns a ball joint: each
/// force times the mean velocity of its transmission over the weight, from Newton's law and least-norm forces by hand.
static void test_power(void) {
  static const char text[] =
      "<mujoco><option gravity='0 0 -10'/><worldbody><body name='cart'><joint name='x' type='slide' axis='1 0 0'/>"
      "<geom size='.1' mass='2' contype='0' conaffinity='0'/></body><body name='top' pos='0 0 1'><joint name='spin' "
      "type='ball'/><inertial pos='0 0 0' mass='1' diaginertia='.3 .3 .3'/></body></worldbody>"
      "<tendon><fixed name='rope'><joint joint='x' coef='.5'/></fixed></tendon>"
      "<actuator><motor joint='x' gear='3' ctrllimited='true' ctrlrange='-20 20'/><motor tendon='rope' gear='4'/>"
      "<motor joint='spin' gear='0 0 2'/></actuator></mujoco>";
  cav_model *m = scene_load(text);
  if (!CHECK(m != NULL)) return;
  double q_start[5], v_start[4] = {0.4, 0, 0, 0.7};
  memcpy(q_start, m->q0, sizeof q_start);
  cav_term term = {.name = "power", .quantity = CAV_QUANTITY_POWER, .weight = 1, .scale = 1, .component = -1};
  cav_problem p = cav_problem_default(m);
  p.order = CAV_ORDER_EULER;
  p.duration = 0.1;
  p.q_start = p.q_goal = q_start, p.v_start = v_start;
  p.term = &term, p.nterm = 1;
  term.from = term.to = p.timestep;
  cav_transcription *tr = cav_transcription_new(&p, 1, NULL);
  if (!CHECK(tr != NULL)) return;
  cav_trajectory *at = cav_trajectory_new(m, tr->nknot, p.timestep);
  memcpy(at->q, q_start, sizeof q_start), memcpy(at->v, v_start, sizeof v_start);
  for (int t = 1; t < at->nknot; t++) {
    double step[4] = {0.01 * t * t, 0, 0, 0.02 * t};
    cav_integrate(m, at->q + (t - 1) * 5, step, 1, at->q + t * 5);
  }
  cav_trajectory_velocities(m, at);
  CHECK(cav_transcription_values(tr, at) == CAV_OK);
  const double *v = at->v + 4, *next = at->v + 8, h = p.timestep, weight = 3 * 10;
  // moments 3 and 2 along the slide: least-norm efforts share its force as 3 to 2
  double force = 2 * (next[0] - v[0]) / h, torque = 0.3 * (next[3] - v[3]) / h;
  double slide = force * (v[0] + next[0]) / 2 / weight, spin = torque * (v[3] + next[3]) / 2 / weight;
  double power[3] = {slide * 9 / 13, slide * 4 / 13, spin}, cost = 0;
  for (int k = 0; k < 3; k++) cost += 0.5 * power[k] * power[k];
  CHECK(fabs(slide) > 0.05 && fabs(spin) > 1e-3);
  CHECK_NEAR(cav_transcription_cost(tr), cost, 1e-12 * cost);
  test_gradient(tr, at);
  // far beyond its scale the absolute norm is the power itself: over distance, the cost of transport
  term.norm = CAV_NORM_ABSOLUTE, term.scale = term.weight = 1e-9;
  CHECK(cav_transcription_values(tr, at) == CAV_OK);
  CHECK_NEAR(cav_transcription_cost(tr), fabs(power[0]) + fabs(power[1]) + fabs(power[2]), 1e-8);
  cav_trajectory_free(at);
  cav_transcription_free(tr);
  cav_model_free(m);
}

/// Their closed forms near no rotation and near half a turn, where digits are lost: against the product of series,
/// which has an error below a^8/9!, and about an axis against half the cotangent of half the angle.
static void test_rotation_digits(void) {
  for (double a = 1e-6; a < 0.05; a *= 1.3) {
    double phi[3] = {0, 0, a}, J[9], a2 = a * a;
    cav_rotation_jacobian(phi, J);
    // J x = sin a / a x - (1 - cos a) / a y in the plane
    CHECK_NEAR(J[0], 1 - a2 / 6 * (1 - a2 / 20 * (1 - a2 / 42)), 3e-16);
    CHECK_NEAR(J[3], -a / 2 * (1 - a2 / 12 * (1 - a2 / 30 * (1 - a2 / 56))), 1e-15);
  }
  for (double left = 1e-1; left > 1e-12; left *= 0.3) {
    double phi[3] = {0, 0, M_PI - left}, inverse[9];
    cav_rotation_jacobian_inverse(phi, inverse);
    // a/2 cot(a/2), with the half of what is left to half a turn
    CHECK_NEAR(inverse[0], phi[2] / 2 * tan(left / 2), 2e-15);
  }
}

/// What cannot be planned with is refused by name, before anything is solved.
static void test_refusals(void) {
  static const char frame[] =
      "<mujoco><worldbody><site name='w'/><body><joint name='j' range='-1 1' limited='true'/><geom size='.1'/>"
      "<site name='s' pos='.1 .2 0'/></body></worldbody><tendon><spatial name='cord'><site site='w'/><site site='s'/>"
      "</spatial></tendon><actuator>%s</actuator></mujoco>";
  static const struct {
    const char *actuator, *says;
  } cases[] = {
      {"<motor name='pull' tendon='cord'/>", "'pull' (0) cannot be planned with: its moments depend"},
      {"<motor joint='j'/><motor name='push' site='s' gear='1 0 0 0 0 0'/>", "'push' (1)"},
      {"<muscle name='arm' joint='j'/>", "a muscle"},
      {"<motor joint='j' gear='3' ctrllimited='true' ctrlrange='-1 1'/>", NULL},
      {"<position joint='j' kp='3' ctrllimited='true' ctrlrange='-1 1'/>", NULL},
      {"<position joint='j' ctrllimited='true' ctrlrange='-1 1' forcelimited='true' forcerange='-1 1'/>", NULL},
      {"<damper joint='j' kv='3' ctrllimited='true' ctrlrange='0 1'/>", "move"},
      {"<position joint='j' kp='3' forcelimited='true' forcerange='-1 1'/>", NULL}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    char text[1000];
    snprintf(text, sizeof text, frame, cases[i].actuator);
    cav_model *m = scene_load(text);
    if (!CHECK(m != NULL)) continue;
    cav_error error = {0};
    CHECK((cav_actuators_plannable(m, &error) == CAV_OK) == !cases[i].says);
    if (cases[i].says) CHECK(error.status == CAV_NOT_SUPPORTED && strstr(error.text, cases[i].says));
    cav_model_free(m);
  }
}

int main(void) {
  for (int k = 0; k < 4; k++) test_apart(k & 1, k >> 1, 0);
  test_rotations();
  test_rotation_digits();
  test_refusals();
  test_power();
  const closing rest = {.at_rest = 1}, open = {0}, timed = {.at_rest = 1, .free_step = 1}, adrift = {.free_step = 1};
  const closing moved = {.cycle = {.on = 1, .translation = {0.2, 0.1, 0}}};
  const closing turned = {.free_step = 1, .cycle = {.on = 1, .translation = {0.2, 0, 0}, .rotation = 0.4}};
  const closing mirrored = {.free_step = 1, .cycle = {.on = 1, .translation = {0.2, 0, 0}, .mirror = CAV_MIRROR_Y}};
  const closing begun = {.at_rest = 1, .free_start = 1, .penalised = 1};
  const closing loose = {.free_start = 1, .free_step = 1, .penalised = 1};
  test_scene(walker, rest, CAV_ORDER_MIDPOINT);
  test_scene(walker, open, CAV_ORDER_MIDPOINT);
  test_scene(slabbed, rest, CAV_ORDER_MIDPOINT);
  test_scene(walker, rest, CAV_ORDER_EULER);
  test_scene(roped, rest, CAV_ORDER_MIDPOINT);
  test_scene(served, rest, CAV_ORDER_MIDPOINT);
  test_scene(served, open, CAV_ORDER_EULER);
  test_scene(walker, timed, CAV_ORDER_MIDPOINT);
  test_scene(served, adrift, CAV_ORDER_EULER);
  test_scene(walker, moved, CAV_ORDER_MIDPOINT);
  test_scene(roped, turned, CAV_ORDER_MIDPOINT);
  test_scene(sided, mirrored, CAV_ORDER_MIDPOINT);
  test_scene(walker, rest, CAV_ORDER_MOMENTUM);
  test_scene(walker, open, CAV_ORDER_MOMENTUM);
  test_scene(roped, rest, CAV_ORDER_MOMENTUM);
  test_scene(served, timed, CAV_ORDER_MOMENTUM);
  test_scene(roped, turned, CAV_ORDER_MOMENTUM);
  for (int k = 0; k < 4; k++) test_apart(k & 1, k >> 1, 1);
  test_scene(served, loose, CAV_ORDER_MIDPOINT);
  test_scene(walker, begun, CAV_ORDER_MIDPOINT);
  test_scene(served, begun, CAV_ORDER_EULER);
  test_scene(roped, loose, CAV_ORDER_MOMENTUM);
  test_scene(walker, (closing){.at_rest = 1, .depth = 1e5}, CAV_ORDER_MIDPOINT);
  test_scene(slabbed, (closing){.at_rest = 1, .depth = 1e5}, CAV_ORDER_MOMENTUM);
  test_scene(served, (closing){.at_rest = 1, .free_step = 1, .depth = 1e5}, CAV_ORDER_MOMENTUM);
  return check_result();
}
