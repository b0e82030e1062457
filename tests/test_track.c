/// Records in problem files: what they say between frames and over gaps, by hand; Jacobians of every kind of channel against
/// centred differences; a point mass that a marker shows against the dense least-squares smoother; a column of gaps is a
/// column that is not there; cost of the solver and of the verifier; there and back through a file; what is wrong in one.
#include "cavort/cavort.h"
#include "quantity.h"
#include "readings.h"
#include "recorded.h"
#include "scene.h"

static char folder[] = "/tmp/cavort-track-XXXXXX";

static const char mass[] =
    "<mujoco><option gravity='0 0 0'/><worldbody><body name='mass'><joint name='x' type='slide' axis='1 0 0'/>"
    "<joint name='y' type='slide' axis='0 1 0'/><joint name='z' type='slide' axis='0 0 1'/><geom size='.1' mass='2' "
    "contype='0' conaffinity='0'/><site name='imu'/></body></worldbody><actuator><motor joint='x'/><motor joint='y'/>"
    "<motor joint='z'/></actuator><sensor><gyro name='turn' site='imu'/><framepos name='place' objtype='site' "
    "objname='imu'/><accelerometer name='acc' site='imu'/></sensor></mujoco>";

// no default costs
#define QUIET                                                                                              \
  "<effort weight='0'/><velocity weight='0'/><acceleration dofs='all' weight='.02'/><posture weight='0'/>" \
  "<gap weight='0'/><slip weight='0'/><impact weight='0'/><self_penetration weight='0'/>"

static cav_problem *load(const char *cost, const char *horizon, cav_error *error) {
  char path[300], text[4000];
  snprintf(text, sizeof text,
           "<problem model='m.xml'><horizon %s/><start qvel='.3 -.2 .1'/>\n<cost>" QUIET "\n%s</cost></problem>",
           horizon, cost);
  scene_write(folder, "m.xml", mass);
  scene_write(folder, "p.xml", text);
  snprintf(path, sizeof path, "%s/p.xml", folder);
  return cav_problem_load(path, NULL, error);
}

static cav_problem *load_well(const char *cost, const char *horizon) {
  cav_error error = {0};
  cav_problem *p = load(cost, horizon, &error);
  if (!CHECK(p != NULL)) fprintf(stderr, "    %s\n", error.text);
  return p;
}

// ---------------------------------------------------------------- frames

static double sample(const cav_track *track, double time, double step) {
  double value[CAV_SENSOR_DIM_MAX];
  int seen = cav_track_sample(track, track->channel, time, step, value);
  CHECK(seen == !isnan(value[0]));
  return value[0];
}

/// One column by hand: x = 2 t but for a bump.
static void test_sample(void) {
  double time[8], value[8];
  cav_channel channel = {.name = "", .kind = CAV_CHANNEL_COORDINATE, .ncolumn = 1, .sd = 1, .component = -1};
  cav_track track = {1, &channel, 8, 1, time, value, .1, 1, .25, 0, 0};
  for (int f = 0; f < 8; f++) time[f] = 1 + .1 * f, value[f] = 2 * (.1 * f);
  // linear between frames where they are farther apart than knots, and as far
  CHECK_NEAR(sample(&track, .25, .05), .5, 1e-14);
  CHECK_NEAR(sample(&track, .25, .1), .5, 1e-14);
  CHECK_NEAR(sample(&track, .7, .1), 1.4, 1e-14);
  CHECK(isnan(sample(&track, .71, .1)) && isnan(sample(&track, -.01, .1)));
  // a mean by weights 1/2, 1, 1/2 over 2: a line stays one, a bump of 1 is half seen
  CHECK_NEAR(sample(&track, .3, .2), .6, 1e-14);
  value[3] += 1;
  CHECK_NEAR(sample(&track, .3, .2), 1.1, 1e-14);
  CHECK_NEAR(sample(&track, .2, .2), .4 + .25, 1e-14);
  CHECK_NEAR(sample(&track, .3, .1), 1.6, 1e-14);
  // narrower near the ends
  CHECK_NEAR(sample(&track, 0, .2), 0, 1e-14);
  CHECK_NEAR(sample(&track, .1, .2), .2, 1e-14);
  value[3] -= 1;
  // one frame is missing: bridged, two are not, and nothing beyond the ends
  value[4] = NAN;
  CHECK_NEAR(sample(&track, .4, .1), .8, 1e-14);
  CHECK_NEAR(sample(&track, .45, .1), .9, 1e-14);
  value[5] = NAN;
  CHECK(isnan(sample(&track, .4, .1)) && isnan(sample(&track, .35, .1)) && isnan(sample(&track, .55, .1)));
  CHECK_NEAR(sample(&track, .3, .1), .6, 1e-14);
  CHECK_NEAR(sample(&track, .6, .1), 1.2, 1e-14);
  CHECK(isnan(sample(&track, .3, .2)) && isnan(sample(&track, .35, .2)));
  track.gap = .3;
  CHECK_NEAR(sample(&track, .45, .1), .9, 1e-14);
  value[0] = NAN;
  CHECK(isnan(sample(&track, 0, .1)));
  // velocities half a step later
  channel.kind = CAV_CHANNEL_SENSOR;
  channel.sensor = (cav_sensor){.type = CAV_SENSOR_JOINTVEL, .dim = 1};
  CHECK_NEAR(sample(&track, .2, .1), .5, 1e-14);
}

// ---------------------------------------------------------------- Jacobians

static void read_off(const cav_model *m, cav_state *state, void *context, double *value) {
  const cav_transcription *tr = context;
  (void)m;
  for (int i = 0, at = 0; i < tr->problem->nterm; i++) {
    cav_recorded_read(tr, state, &tr->problem->term[i], 1, value + at);
    at += cav_recorded_dim(tr->problem->term[i].track);
  }
}

/// Markers on every body, every joint, a gyro and a velocimeter, of a scene with every kind of joint.
static void test_jacobian(void) {
  cav_model *m = scene_load(scene_joints);
  if (!CHECK(m != NULL)) return;
  enum { MOST = 64, STEPS = 4 };
  static cav_channel channel[2][MOST];
  double time[2] = {0, 1}, value[2][2 * 256];
  cav_track track[2];
  cav_term term[2];
  for (int k = 0; k < 2; k++) track[k] = (cav_track){0, channel[k], 2, 256, time, value[k], 1, 0, 0, 0, 0};
  for (int b = 1; b < m->nbody; b++)
    channel[0][track[0].nchannel++] = (cav_channel){
        .kind = CAV_CHANNEL_MARKER, .object = b, .ncolumn = 3, .place = {.3 * scene_uniform(), .2, -.1}, .sd = .01};
  for (int j = 0; j < m->njoint; j++) {
    int free = m->joint[j].type == CAV_JOINT_FREE, ball = m->joint[j].type == CAV_JOINT_BALL;
    cav_channel one = {.object = j, .kind = CAV_CHANNEL_COORDINATE, .ncolumn = 1, .sd = .05};
    if (free) one.kind = CAV_CHANNEL_TRANSLATION, one.ncolumn = 3, channel[0][track[0].nchannel++] = one;
    if (free || ball) one.kind = CAV_CHANNEL_ROTATION, one.ncolumn = 4;
    channel[0][track[0].nchannel++] = one;
  }
  int tip = cav_object_find(m, CAV_OBJECT_SITE, "tip");
  for (int k = 0; k < 3; k++) {
    cav_channel *c = &channel[k > 0][track[k > 0].nchannel++];
    *c = (cav_channel){.kind = CAV_CHANNEL_SENSOR, .component = k == 2 ? 1 : -1, .sd = .3};
    const cav_sensor_type type[] = {CAV_SENSOR_FRAMEQUAT, CAV_SENSOR_GYRO, CAV_SENSOR_VELOCIMETER};
    CHECK(cav_sensor_of(m, type[k], CAV_OBJECT_SITE, tip, &c->sensor, NULL) == CAV_OK);
    c->ncolumn = k == 2 ? 1 : c->sensor.dim;
  }
  for (int k = 0; k < 2; k++) {
    int at = 0;
    for (int i = 0; i < track[k].nchannel; at += channel[k][i++].ncolumn)
      channel[k][i].column = at, channel[k][i].name = "";
    CHECK(at <= 256);
    for (int i = 0; i < 512; i++) value[k][i] = scene_uniform();
    term[k] = cav_term_cost(CAV_QUANTITY_TRACK, 1);
    term[k].track = &track[k];
  }
  // a gap, whose rows are zero
  value[0][1] = value[0][257] = NAN;
  double *v = scene_vector(m->nv), *next = scene_vector(m->nv), *q = scene_vector(m->nq), *start = scene_vector(m->nq);
  memcpy(start, m->q0, (size_t)m->nq * sizeof *start);
  cav_problem p = cav_problem_default(m);
  p.duration = .3, p.timestep = .1, p.nterm = 2, p.term = term, p.v_start = v;
  p.q_start = p.q_goal = start;
  cav_error error = {0};
  cav_transcription *tr = cav_transcription_new(&p, 1, &error);
  if (!CHECK(tr != NULL)) return;
  cav_state *state = tr->scratch->state;
  cav_integrate(m, m->q0, v, .5, q);
  int n = cav_recorded_dim(&track[0]) + cav_recorded_dim(&track[1]), first = cav_recorded_dim(&track[0]), nv = m->nv;
  double *dq = scene_vector(n * nv), *dn = scene_vector(n * nv), *by_q = scene_vector(n * nv),
         *by_v = scene_vector(n * nv), *by_n = scene_vector(n * nv), worst = 0, largest = 0;
  CHECK(cav_inverse(m, state, q, v, next, tr->scratch->row) == CAV_OK);
  CHECK(cav_derivatives(m, state, by_q, by_v, by_n) == CAV_OK);
  CHECK(cav_recorded_derivatives(tr, tr->scratch, &term[0], 1, dq, dn) == CAV_OK);
  CHECK(cav_recorded_derivatives(tr, tr->scratch, &term[1], 1, dq + first * nv, dn + first * nv) == CAV_OK);
  CHECK(cav_readout_differentiate(m, state, CAV_DERIVATIVE_CENTRED, 0, q, v, next, read_off, tr, n, NULL, by_q, by_v,
                                  by_n) == CAV_OK);
  for (int i = 0; i < n * nv; i++) {
    worst = fmax(worst, fmax(fabs(dq[i] - by_q[i]), fmax(fabs(dn[i] - by_n[i]), fabs(by_v[i]))));
    largest = fmax(largest, fabs(dq[i]));
  }
  for (int d = 0; d < nv; d++) CHECK(dq[nv + d] == 0);
  printf("Jacobian of %d values: off by %.2g of %.3g\n", n, worst, largest);
  CHECK(worst < 1e-7 * largest && largest > 10);
  cav_transcription_free(tr);
  free(v), free(next), free(q), free(start), free(dq), free(dn), free(by_q), free(by_v), free(by_n);
  cav_model_free(m);
}

// ---------------------------------------------------------------- the smoother

enum { STEPS = 45, FRAMES = 40 };

// solves the symmetric positive definite A x = b by Gauss's elimination, in place
static void eliminate(int n, long double A[STEPS][STEPS], long double *b) {
  for (int k = 0; k < n; k++)
    for (int i = k + 1; i < n; i++) {
      long double f = A[i][k] / A[k][k];
      for (int j = k; j < n; j++) A[i][j] -= f * A[k][j];
      b[i] -= f * b[k];
    }
  for (int i = n - 1; i >= 0; i--) {
    for (int j = i + 1; j < n; j++) b[i] -= A[i][j] * b[j];
    b[i] /= A[i][i];
  }
}

// adds weight/2 (c' x - r)^2, of three unknowns from knot first on (knot 0 and the one before are given: -1 and 0)
static void add_row(long double A[STEPS][STEPS], long double *b, double weight, const double *c, double r, int first,
                    const double given[2]) {
  for (int i = 0; i < 3; i++)
    if (first + i <= 0) r -= c[i] * given[first + i + 1];
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3 && first + i > 0 && c[i] != 0; j++)
      if (first + j > 0 && c[j] != 0) A[first + i - 1][first + j - 1] += weight * c[i] * c[j];
  for (int i = 0; i < 3; i++)
    if (first + i > 0 && c[i] != 0) b[first + i - 1] += weight * c[i] * r;
}

static double record_at(int axis, double t) {
  return .3 * t * (1 - axis) + .1 * sin(9 * t + axis) * (1 + t) - .05 * axis;
}

static int is_gap(int frame, int axis) { return (frame > 11 && frame < 17) || (axis == 2 && frame == 30); }

/// The record of one marker, frames at another rate than knots, a gap; beside it columns that nothing asks for, and a
/// second marker that is never seen.
static void write_record(void) {
  char text[16000];
  int n = snprintf(text, sizeof text, "time,heel_x,heel_y,heel_z,lost_x,lost_y,lost_z,emg\n");
  for (int f = 0; f < FRAMES; f++) {
    n += snprintf(text + n, sizeof text - (size_t)n, "%.17g", 2 + f / 37.0);
    for (int a = 0; a < 3; a++)
      n += is_gap(f, a) ? snprintf(text + n, sizeof text - (size_t)n, ",")
                        : snprintf(text + n, sizeof text - (size_t)n, ",%.17g", record_at(a, f / 37.0));
    n += snprintf(text + n, sizeof text - (size_t)n, ",,nan,,%d\n", f);
  }
  scene_write(folder, "record.csv", text);
}

#define HORIZON "duration='.9' timestep='.02' close='open'"
#define HEEL "<marker name='heel' body='mass' pos='.1 .2 .3'/>"

static cav_solution *solve(const cav_problem *p) {
  cav_solve_options options = cav_solve_options_default();
  cav_solution *solution = NULL;
  cav_error error = {0};
  options.gains = 0;
  if (!CHECK(p && cav_solve(p, &options, NULL, &solution, &error) == CAV_OK)) fprintf(stderr, "    %s\n", error.text);
  return solution;
}

// the verifier's cost is the solver's
static void check_cost(const cav_problem *p, const cav_solution *s) {
  cav_verdict verdict = {0};
  cav_error error = {0};
  CHECK(s && cav_verify(p, s->trajectory, &s->contact, NULL, NULL, &verdict, &error) == CAV_OK);
  if (s) CHECK_NEAR(verdict.cost, s->cost, 1e-9 * s->cost);
}

// distances of the marker at the knots that frames see, from the record's own numbers
static void check_residual(const cav_problem *p, const cav_solution *s, const double place[3]) {
  cav_channel_residual r, none = {0};
  cav_error error = {0};
  double square = 0, worst = 0;
  int seen = 0;
  for (int t = 0; t <= STEPS; t++) {
    double at = (.05 + t * .02) * 37, off = 0;
    int f = (int)floor(at + 1e-9), axes = 0;
    for (int a = 0; a < 3; a++) {
      if (f + 1 >= FRAMES || is_gap(f, a) || is_gap(f + 1, a)) continue;
      double record = (1 - (at - f)) * record_at(a, f / 37.0) + (at - f) * record_at(a, (f + 1) / 37.0);
      off += pow(s->trajectory->q[3 * t + a] + place[a] - record, 2), axes++;
    }
    seen += axes > 0, square += off, worst = fmax(worst, sqrt(off));
  }
  CHECK(cav_track_residuals(p, s->trajectory, &s->contact, p->nterm - 1, &r, &error) == CAV_OK);
  CHECK(r.seen == seen && seen > 30);
  CHECK_NEAR(r.rms, sqrt(square / seen), 1e-12);
  CHECK_NEAR(r.worst, worst, 1e-12);
  CHECK(r.worst_time >= 0 && r.worst_time <= STEPS * .02);
  // a term without a record, and none at all
  for (int i = 0; i < 2; i++) {
    int wrong = i ? p->nterm : 0;
    CHECK(cav_track_residuals(p, s->trajectory, &s->contact, wrong, &none, &error) == CAV_BAD_INPUT);
  }
}

static void test_smoother(void) {
  static long double A[STEPS][STEPS], b[STEPS];
  const double h = .02, sd = .02, place[3] = {.1, .2, .3}, start[3] = {.3, -.2, .1};
  cav_problem *p = load_well("<track file='record.csv' offset='2.05' sd='.02' gap='.03'>" HEEL "</track>", HORIZON);
  if (!p) return;
  const cav_term *term = &p->term[p->nterm - 1];
  CHECK(term->quantity == CAV_QUANTITY_TRACK && term->track->unused == 4 && term->track->nchannel == 1);
  CHECK_NEAR(term->weight, 37, 1e-9);
  cav_solution *s = solve(p);
  double worst = 0;
  for (int axis = 0; axis < 3 && s; axis++) {
    memset(A, 0, sizeof A), memset(b, 0, sizeof b);
    const double given[2] = {-h * start[axis], 0};
    // (x[t+1] - 2 x[t] + x[t-1])/h^2 at knots 0 .. STEPS-1; only v_0 is given, so x[-1] = x_0 - h v_0
    for (int t = 0; t < STEPS; t++)
      add_row(A, b, h * .02, (double[]){1 / (h * h), -2 / (h * h), 1 / (h * h)}, 0, t - 1, given);
    for (int t = 0; t <= STEPS; t++) {
      // linear between the frames on both sides, where both are there
      double at = (.05 + t * h) * 37;
      int f = (int)floor(at + 1e-9);
      if (f + 1 >= FRAMES || is_gap(f, axis) || is_gap(f + 1, axis)) continue;
      double seen = (1 - (at - f)) * record_at(axis, f / 37.0) + (at - f) * record_at(axis, (f + 1) / 37.0);
      add_row(A, b, h * 37 / (sd * sd), (double[]){0, 1, 0}, seen - place[axis], t - 1, given);
    }
    eliminate(STEPS, A, b);
    for (int t = 1; t <= STEPS; t++) worst = fmax(worst, fabs((double)b[t - 1] - s->trajectory->q[3 * t + axis]));
  }
  printf("smoother: knots differ by %.2g m\n", worst);
  // seen 1.1e-9: where the solver ends a quadratic problem
  CHECK(worst < 1e-8);
  // the verifier's cost, and that of the problem as a folder holds it
  check_cost(p, s);
  if (s) check_residual(p, s, place);
  // other ways from start to goal are no ways to a record; a free duration is none at all
  cav_strategy strategy[CAV_STRATEGIES];
  int nstrategy;
  for (int posed = 0; posed < 2; posed++) {
    double middle[3] = {.1, 0, 0};
    const cav_guess_pose pose = {.45, middle};
    p->nguess_pose = posed, p->guess_pose = &pose;
    CHECK(cav_strategy_list(p, strategy, &nstrategy) == CAV_OK);
    for (int i = 1; i < nstrategy; i++) {
      CHECK(strategy[i].use != CAV_STRATEGY_DIAGNOSIS);
      if (posed) CHECK(strategy[i].use == CAV_STRATEGY_REPAIR);
    }
  }
  p->nguess_pose = 0;
  char path[300];
  snprintf(path, sizeof path, "%s/again.xml", folder);
  cav_problem *again = NULL;
  CHECK(cav_problem_write(path, p, NULL, NULL) == CAV_OK && (again = load_well("", HORIZON)));
  cav_problem_free(again);
  again = cav_problem_load(path, NULL, NULL);
  cav_solution *same = solve(again);
  if (CHECK(same && s)) CHECK(same->cost == s->cost);
  // a marker that is never seen, or whose columns are not asked for
  cav_problem *lost = load_well("<track file='record.csv' offset='2.05' sd='.02' gap='.03'>" HEEL
                                "<marker name='lost' body='mass' pos='0 0 1'/></track>",
                                HORIZON);
  cav_solution *blind = solve(lost);
  for (int i = 0; blind && s && i < 3 * STEPS; i++) CHECK_NEAR(blind->trajectory->q[i], s->trajectory->q[i], 1e-12);
  cav_channel_residual both[2];
  if (CHECK(blind &&
            cav_track_residuals(lost, blind->trajectory, &blind->contact, lost->nterm - 1, both, NULL) == CAV_OK))
    CHECK(both[0].seen > 30 && both[1].seen == 0 && isnan(both[1].rms) && isnan(both[1].worst));
  cav_solution_free(blind), cav_problem_free(lost);
  cav_solution_free(same), cav_problem_free(again);
  unlink(path);
  cav_solution_free(s);
  cav_problem_free(p);
}

// ---------------------------------------------------------------- files

/// Joints, sensors and markers of one table, in any mix; the noise of each; three terms by what they read.
static void test_mix(void) {
  scene_write(folder, "mix.csv",
              "x,time,qpos_y,acc_x,acc_y,acc_z,turn_x,turn_y,turn_z,ax,m_x,m_y,m_z\n1,0,2,,1,2,3,4,5,6,7,8,9\n"
              "1,1,2,0,1,2,3,4,5,6,7,8,9\n");
  cav_problem *p = load_well(
      "<track name='r' file='mix.csv' joints='all' sensors='all' sd='.1 .2' weight='3'><sensor "
      "name='acc' sd='.7'/><sensor name='turn' sd='.3'/><sensor name='odd' type='framepos' "
      "site='imu' component='z' columns='ax'/><marker name='m' body='mass' pos='0 0 0' sd='.4'/>"
      "<joint name='z' columns='ax' sd='.5'/></track>",
      "duration='1' timestep='.1'");
  if (!p) return;
  const cav_term *t = &p->term[p->nterm - 3];
  CHECK(t[0].track && t[0].track->nchannel == 5 && t[1].track->nchannel == 1 && t[2].track->nchannel == 1);
  CHECK(cav_term_stage(&t[0]) == CAV_READS_POSITION && cav_term_stage(&t[1]) == CAV_READS_VELOCITY);
  const double sd[] = {.4, .1, .1, .5, .1};
  const char *name[] = {"m", "x", "y", "z", "odd"};
  for (int i = 0; i < 5 && t[0].track->nchannel == 5; i++) {
    CHECK_NEAR(t[0].track->channel[i].sd, sd[i], 0);
    CHECK_TEXT(t[0].track->channel[i].name, name[i]);
  }
  CHECK(t[1].track->channel->sd == .3 && t[2].track->channel->sd == .7 && t[2].weight == 3 && !strcmp(t[2].name, "r"));
  CHECK(t[0].track->unused == 0 && isnan(t[2].track->value[0]) && t[2].track->value[1] == 1);
  cav_error error = {0};
  cav_solve_options options = cav_solve_options_default();
  options.gains = 0;
  cav_solution *s = NULL;
  CHECK(cav_solve(p, &options, NULL, &s, &error) == CAV_OK);
  check_cost(p, s);
  // what each compares, in which unit
  static const char *const what[] = {"position", "coordinate", "coordinate", "coordinate", "framepos"};
  cav_channel_residual r[5];
  if (CHECK(s && t[0].track->nchannel == 5 &&
            cav_track_residuals(p, s->trajectory, &s->contact, p->nterm - 3, r, &error) == CAV_OK))
    for (int i = 0; i < 5; i++) CHECK(!strcmp(r[i].what, what[i]) && !strcmp(r[i].unit, "m"));
  if (CHECK(s && cav_track_residuals(p, s->trajectory, &s->contact, p->nterm - 1, r, &error) == CAV_OK))
    CHECK(!strcmp(r->what, "accelerometer") && !strcmp(r->unit, "m/s2"));
  cav_solution_free(s);
  cav_problem_free(p);
}

static void refuse(const char *cost, const char *says) {
  cav_error error = {0};
  cav_problem *p = load(cost, "duration='.9' timestep='.03'", &error);
  if (!CHECK(!p && error.status == CAV_BAD_INPUT && error.line == 3 && strstr(error.text, says)))
    fprintf(stderr, "    line %d, '%s' lacks '%s'\n", error.line, error.text, says);
  cav_problem_free(p);
}

static void test_refusals(void) {
  refuse("<track file='none.csv' joints='all'/>", "none.csv");
  refuse("<track joints='all'/>", "'file': is missing");
  refuse("<track file='mix.csv' joints='yaw'/>", "no joint 'yaw'");
  refuse("<track file='mix.csv' joints='z'/>", "no column of joint 'z'");
  refuse("<track file='mix.csv' sensors='acc'/>", "noise of sensor 'acc'");
  refuse("<track file='mix.csv' sensors='trun' sd='1'/>", "no sensor 'trun'; did you mean 'turn'");
  refuse("<track file='mix.csv'><joint name='z' columns='acx'/></track>", "no column 'acx'; did you mean 'ax'");
  refuse("<track file='mix.csv'><joint name='z' columns='ax|x'/></track>", "expected 1 columns, got 2");
  refuse("<track file='mix.csv'><marker name='m' pos='0 0 0'/></track>", "no marker 'm'");
  refuse("<track file='mix.csv'><marker name='m' body='mass'/></track>", "'pos': is missing");
  refuse("<track file='mix.csv'><marker name='mm' body='mass' pos='0 0 0'/></track>", "no columns of marker 'mm'");
  refuse("<track file='mix.csv' joints='x' sd='0'/>", "above 0");
  refuse("<track file='mix.csv' joints='x' within='1'/>", "no tolerance");
  refuse("<track file='mix.csv' joints='x' offset='1'/>", "none of it within the motion");
  refuse("<track file='mix.csv'/>", "nothing of mix.csv is compared");
  refuse("<track><joint name='x'/><frame time='0' value='1'/><frame time='0' value='2'/></track>",
         "after the one before");
  refuse("<track><joint name='x'/><frame time='0' value='1'/><frame time='1' value='2' unseen='1'/></track>",
         "from 0 to 0");
  refuse("<track><joint name='x'/><joint name='y'/><frame time='0' value='1'/><frame time='1' value='2'/></track>",
         "fewer than channels");
  scene_write(folder, "bad.csv", "time,x\n0,1\n0,2\n");
  refuse("<track file='bad.csv' joints='x'/>", "bad.csv:3: expected a time after");
  scene_write(folder, "bad.csv", "tim,x\n0,1\n0,2\n");
  refuse("<track file='bad.csv' joints='x'/>", "column 'time'");
  cav_error error = {0};
  cav_problem *p = load("<track file='mix.csv' joints='x'/>", "duration='.9' timestep='.03' range='.5 1.5'", &error);
  CHECK(!p && strstr(error.text, "its own time"));
  cav_problem_free(p);
}

int main(void) {
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  test_sample();
  test_jacobian();
  write_record();
  test_smoother();
  test_mix();
  test_refusals();
  const char *files[] = {"m.xml", "p.xml", "record.csv", "mix.csv", "bad.csv"};
  for (int i = 0; i < 5; i++) {
    char path[300];
    snprintf(path, sizeof path, "%s/%s", folder, files[i]);
    unlink(path);
  }
  CHECK(rmdir(folder) == 0);
  return check_result();
}
