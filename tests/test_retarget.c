/// Clips of bodies of another size: a body that is similar is recovered, ways in the world go by the length of legs, feet that
/// slide or stand too high in the clip do neither on the model, and what is wrong in a table is told.
#include <string.h>
#include <unistd.h>

#include "cavort/cavort.h"
#include "check.h"
#include "math3.h"

enum { FRAMES = 60 };
static const double rate = 30;
static char folder[] = "/tmp/cavort_retarget_XXXXXX";

static const char *put_text(const char *name, const char *text) {
  static char path[120];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  FILE *file = fopen(path, "w");
  CHECK(file && fputs(text, file) >= 0);
  if (file) fclose(file);
  return path;
}

static cav_model *load(const char *name) {
  char path[4200];
  cav_error error = {0};
  snprintf(path, sizeof path, "%.4000s/problems/models/%s.xml", CAVORT_SOURCE_ROOT, name);
  cav_model *model = cav_model_load(path, &error);
  CHECK(model != NULL);
  return model;
}

static cav_marker_set *read_set(const cav_model *model) {
  cav_error error = {0};
  cav_marker_set *set = cav_marker_set_read(CAVORT_SOURCE_ROOT "/problems/markers/robot.xml", model, &error);
  if (!CHECK(set != NULL)) printf("%s\n", error.text);
  return set;
}

// the clip that a model makes of a set's places with its configurations [FRAMES*nq], size times as large
static cav_record *record_of(const cav_model *m, const cav_marker_set *set, const double *q, double size) {
  cav_record *r = cav_record_new(FRAMES, set->nmarker, rate);
  cav_state *state = cav_state_new(m);
  for (int i = 0; i < set->nmarker; i++) r->name[i] = strdup(set->marker[i].name);
  for (int t = 0; t < FRAMES; t++) {
    CHECK(!cav_position(m, state, q + (size_t)t * (size_t)m->nq));
    for (int i = 0; i < set->nmarker; i++) {
      cav_pose pose;
      double *at = r->position + 3 * ((size_t)t * (size_t)set->nmarker + (size_t)i);
      cav_object_pose(m, state, CAV_OBJECT_XBODY, set->marker[i].body, &pose);
      transform(at, pose.pos, pose.rotation, set->marker[i].place);
      scale3(at, size, at);
    }
  }
  cav_state_free(state);
  return r;
}

// FRAMES of the model's own configuration
static double *still(const cav_model *m) {
  double *q = malloc(FRAMES * (size_t)m->nq * sizeof *q);
  for (int t = 0; t < FRAMES; t++) memcpy(q + (size_t)t * (size_t)m->nq, m->q0, (size_t)m->nq * sizeof *q);
  return q;
}

static cav_trajectory *fit(const cav_model *m, cav_marker_set *set, const cav_record *r, cav_ik_report **report) {
  cav_ik_options options = cav_ik_options_default();
  cav_trajectory *motion = NULL;
  cav_error error = {0};
  options.posture = options.roughness = 1e-6;
  if (!CHECK(!cav_ik(m, r, set, &options, &motion, report, &error))) printf("%s\n", error.text);
  return motion;
}

// a body 1.4 times as large that walks off and moves legs and arms; spine and ankles stay, so that no distance that is
// measured changes
static void test_similar(void) {
  cav_model *m = load("humanoid");
  cav_marker_set *set = read_set(m);
  double *q = still(m), worst = 0;
  cav_ik_report *report;
  set->floor = 0;
  for (int t = 0; t < FRAMES; t++)
    for (int j = 0; j < m->njoint; j++) {
      const cav_joint *joint = &m->joint[j];
      double *at = q + (size_t)t * (size_t)m->nq + joint->q;
      if (joint->type == CAV_JOINT_FREE) at[0] += 0.02 * t, at[2] += 0.05 * sin(0.2 * t);
      if (strstr(joint->name, "hip") || strstr(joint->name, "knee") || strstr(joint->name, "shoulder") ||
          strstr(joint->name, "elbow"))
        *at = (joint->range[0] + joint->range[1]) / 2 + 0.3 * (joint->range[1] - joint->range[0]) * sin(0.1 * t + j);
    }
  cav_record *r = record_of(m, set, q, 1.4);
  cav_trajectory *motion = fit(m, set, r, &report);
  CHECK_NEAR(report->scale, 1 / 1.4, 1e-12);
  // heights go by the lowest that feet come, so the whole is as much higher or lower
  for (int j = 0; j < m->njoint; j++)
    for (int t = 0; t < FRAMES && (strstr(m->joint[j].name, "knee") || strstr(m->joint[j].name, "elbow")); t++) {
      size_t at = (size_t)t * (size_t)m->nq + (size_t)m->joint[j].q;
      worst = fmax(worst, fabs(motion->q[at] - q[at]));
    }
  printf("similar body: knees and elbows off by %.1e rad, markers by %.1e m\n", worst, report->total_rms);
  CHECK(worst < 1e-3 && report->total_rms < 1e-4);
  cav_ik_report_free(report);
  cav_trajectory_free(motion);
  cav_record_free(r);
  cav_marker_set_free(set);
  free(q);
  cav_model_free(m);
}

// the robot's leg as its file says: from the mean height of the axes of pitch and roll to the knee, 0.325 m, from there to
// the middle of the sole, (0.035, -0.355)
static void test_scale(void) {
  cav_model *human = load("humanoid"), *robot = load("robot");
  cav_marker_set *worn = read_set(human), *set = read_set(robot);
  double *q = still(human), leg = 0.325 + hypot(0.035, 0.355), own = 0.4123 + hypot(0.0645, 0.4962);
  cav_ik_report *report;
  cav_record *r = record_of(human, worn, q, 1);
  cav_trajectory *motion = fit(robot, set, r, &report);
  CHECK_NEAR(report->scale, leg / own, 1e-3);
  cav_quality quality;
  CHECK(!cav_quality_measure(robot, motion, NULL, &quality, NULL));
  CHECK(quality.penetration < 0.1 && quality.skating_fraction == 0 && quality.floating_fraction == 0);
  cav_ik_report_free(report);
  cav_trajectory_free(motion);
  cav_record_free(r);
  cav_marker_set_free(worn), cav_marker_set_free(set);
  free(q);
  cav_model_free(human), cav_model_free(robot);
}

// a body that stands 5 cm too high and glides at 10 cm/s: with floor it stands on it, where it is
static void test_feet(void) {
  cav_model *m = load("humanoid");
  cav_marker_set *set = read_set(m);
  double *q = still(m);
  for (int t = 0; t < FRAMES; t++) {
    double *at = q + (size_t)t * (size_t)m->nq;
    at[0] += 0.1 * t / rate, at[2] += 0.05;
  }
  cav_record *r = record_of(m, set, q, 1);
  for (int on = 0; on < 2; on++) {
    cav_quality quality = {0};
    set->floor = on;
    cav_trajectory *motion = fit(m, set, r, NULL);
    CHECK(!cav_quality_measure(m, motion, NULL, &quality, NULL));
    printf("gliding, floor %d: slides %.3g cm/s, %.3g mm deep, %.3g mm afloat\n", on, quality.skating,
           quality.penetration, quality.floating);
    if (on)
      CHECK(quality.skating < 0.05 && quality.skating_fraction == 0);
    else
      CHECK_NEAR(quality.skating, 10, 0.1);
    CHECK(quality.penetration < 0.1 && quality.floating_fraction == 0);
    cav_trajectory_free(motion);
  }
  cav_record_free(r);
  cav_marker_set_free(set);
  free(q);
  cav_model_free(m);
}

// One leg is off the ground, and the foot of the other, which alone bears the body, slides on at 0.7 m/s for a fifth of a second:
// it is held, and stays on the floor. With the other foot beside it, which stands, it goes where it went
static void test_bearing(void) {
  cav_model *m = load("humanoid");
  cav_marker_set *set = read_set(m);
  cav_state *state = cav_state_new(m);
  int foot = cav_object_find(m, CAV_OBJECT_XBODY, "foot_left");
  for (int other = 0; other < 2; other++) {
    double *q = still(m), least = INFINITY, most = -INFINITY, highest = 0;
    for (int t = 0; t < FRAMES; t++) {
      double *at = q + (size_t)t * (size_t)m->nq;
      for (int j = 0; j < m->njoint && !other; j++) {
        if (strstr(m->joint[j].name, "hip_y_right")) at[m->joint[j].q] -= 0.6;
        if (strstr(m->joint[j].name, "knee_right")) at[m->joint[j].q] -= 1.2;
      }
      if (!other) at[0] += 0.7 * fmin(fmax(t - 30, 0), 6) / rate;
    }
    cav_record *r = record_of(m, set, q, 1);
    for (int i = 0; i < set->nmarker && other; i++)
      for (int t = 0; t < FRAMES && strstr(set->marker[i].name, "[l"); t++)
        if (set->marker[i].body == foot)
          r->position[3 * (t * set->nmarker + i)] += 0.7 * fmin(fmax(t - 30, 0), 6) / rate;
    cav_trajectory *motion = fit(m, set, r, NULL);
    for (int t = 0; t < FRAMES; t++) {
      cav_pose pose;
      CHECK(!cav_position(m, state, motion->q + (size_t)t * (size_t)m->nq));
      cav_object_pose(m, state, CAV_OBJECT_XBODY, foot, &pose);
      least = fmin(least, pose.pos[0]), most = fmax(most, pose.pos[0]), highest = fmax(highest, pose.pos[2]);
    }
    printf("a foot slides on, %s: its way is %.3g mm\n", other ? "beside another" : "alone", 1e3 * (most - least));
    CHECK(other ? most - least > 0.1 : most - least < 2e-3);
    CHECK(highest < 0.2);
    cav_trajectory_free(motion);
    cav_record_free(r);
    free(q);
  }
  cav_state_free(state);
  cav_marker_set_free(set);
  cav_model_free(m);
}

// arms that swing through the body, one of which is elsewhere for a frame: they go round it, and do not follow the jump
static void test_smooth(void) {
  cav_model *m = load("humanoid");
  cav_marker_set *set = read_set(m);
  cav_ik_options options = cav_ik_options_default();
  cav_quality quality[2];
  double *q = still(m), most[2] = {0};
  for (int t = 0; t < FRAMES; t++)
    for (int j = 0; j < m->njoint; j++) {
      const cav_joint *joint = &m->joint[j];
      double *at = q + (size_t)t * (size_t)m->nq + joint->q;
      if (strstr(joint->name, "shoulder") || strstr(joint->name, "elbow"))
        *at = (joint->range[0] + joint->range[1]) / 2 + 0.3 * (joint->range[1] - joint->range[0]) * sin(0.1 * t + j);
      if (t == FRAMES / 2 && !strcmp(joint->name, "elbow_right")) *at += *at > -0.8 ? -0.7 : 0.7;
    }
  cav_record *r = record_of(m, set, q, 1);
  cav_trajectory *motion[2] = {cav_trajectory_new(m, FRAMES, 1 / rate), NULL};
  memcpy(motion[0]->q, q, FRAMES * (size_t)m->nq * sizeof *q);
  cav_trajectory_velocities(m, motion[0]);
  CHECK(!cav_ik(m, r, set, &options, &motion[1], NULL, NULL));
  for (int k = 0; k < 2 && motion[1]; k++) {
    CHECK(!cav_quality_measure(m, motion[k], NULL, &quality[k], NULL));
    for (int t = 2; t + 2 < FRAMES; t++)
      for (int d = 6; d < m->nv; d++) {
        const double *v = motion[k]->v + (size_t)t * (size_t)m->nv + (size_t)d;
        most[k] = fmax(most[k], rate * fabs(v[m->nv] - v[0]));
      }
  }
  printf("arms through the body: %.1f mm deep and %.0f rad/s^2, fitted %.3f mm and %.0f rad/s^2\n",
         quality[0].self_penetration, most[0], quality[1].self_penetration, most[1]);
  CHECK(quality[0].self_penetration > 20 && quality[1].self_penetration < 0.1);
  CHECK(most[1] < 0.6 * most[0]);
  cav_trajectory_free(motion[0]), cav_trajectory_free(motion[1]);
  cav_record_free(r);
  cav_marker_set_free(set);
  free(q);
  cav_model_free(m);
}

// An arm that turns past the end of its first joint's range. Bent over backwards, half a turn off, it goes all the way; who
// follows it from its first frame on finds out too late
static void test_range(void) {
  cav_model *m = load("arm");
  const char *path = put_text("arm.xml",
                              "<markers retarget=\"true\">"
                              "<marker name=\"elbow\" body=\"forearm\" pos=\"0 0 0\"/>"
                              "<marker name=\"hand\" body=\"hand\" pos=\"0 0 0\"/></markers>");
  cav_error error = {0};
  cav_marker_set *set = cav_marker_set_read(path, m, &error);
  if (!CHECK(set != NULL)) printf("%s\n", error.text);
  double *q = calloc(FRAMES * (size_t)m->nq, sizeof *q);
  for (int t = 0; t < FRAMES; t++)
    q[t * m->nq] = (70 + 165.0 * t / (FRAMES - 1)) * M_PI / 180, q[t * m->nq + 1] = M_PI / 3;
  cav_record *r = record_of(m, set, q, 1);
  cav_ik_report *report = NULL;
  cav_trajectory *motion = fit(m, set, r, &report);
  printf("an arm 65 degrees past its range: %.3g mm off\n", 1e3 * report->total_rms);
  CHECK(report->total_rms < 0.002);
  cav_ik_report_free(report);
  cav_trajectory_free(motion);
  cav_record_free(r);
  cav_marker_set_free(set);
  free(q);
  cav_model_free(m);
}

// A body 1.4 times as large that leaps: what is scaled in time, too, falls as gravity has it, and takes no force from nowhere;
// in the recorded time it falls 1.4 times as slow
static void test_pace(void) {
  static const double size = 1.4, speed = 3;
  cav_model *m = load("humanoid");
  cav_marker_set *set = read_set(m);
  double *q = still(m), step = 1 / (rate * sqrt(size));
  for (int t = 0; t < FRAMES; t++) {
    double s = t * step, flight = 2 * speed / 9.81;
    q[t * m->nq + 2] += s < flight ? s * (speed - 4.905 * s) : 0;
  }
  cav_record *r = record_of(m, set, q, size);
  for (int similar = 0; similar < 2; similar++) {
    cav_ik_report *report = NULL;
    set->similar = similar;
    cav_trajectory *motion = fit(m, set, r, &report);
    const double *z = motion->q + 2, h = motion->timestep;
    int mid = 10;
    double fall = (z[(mid + 1) * m->nq] - 2 * z[mid * m->nq] + z[(mid - 1) * m->nq]) / (h * h);
    printf("a leap, %s pace: %.4f s a frame, falls with %.4f m/s^2\n", similar ? "similar" : "recorded", h, -fall);
    CHECK_NEAR(h, similar ? step : 1 / rate, 1e-12);
    CHECK_NEAR(report->pace, similar ? 1 / sqrt(size) : 0, 1e-12);
    CHECK_NEAR(-fall, similar ? 9.81 : 9.81 / size, 0.02);
    double up = motion->v[(size_t)mid * (size_t)m->nv + 2];
    CHECK_NEAR(up, (z[mid * m->nq] - z[(mid - 1) * m->nq]) / h, 1e-9);
    cav_ik_report_free(report);
    cav_trajectory_free(motion);
  }
  cav_record_free(r);
  cav_marker_set_free(set);
  free(q);
  cav_model_free(m);
}

static void test_refusals(void) {
  static const struct {
    const char *text, *expected;
  } wrong[] = {
      {"<markers><marker name='a' body='head' pos='0 0 0' from='a'/></markers>", "retarget=\"true\""},
      {"<markers retarget='true' adjust='0.1'><marker name='a' body='head' pos='0 0 0'/></markers>", "expected none"},
      {"<markers retarget='true'><marker name='a' body='head'/></markers>", "expected pos or at"},
      {"<markers pace='similar'><marker name='a' body='head' pos='0 0 0'/></markers>", "retarget=\"true\""},
      {"<markers retarget='true'><marker name='a' body='torso' at='heel'/></markers>", "a foot or a hand by its role"},
      {"<markers><marker name='a' body='foot_left' at='toe'/></markers>", "a foot or a hand by its role"},
      {"<markers><marker name='a' body='left foot' at='toe' pos='0 0 0'/></markers>", "got both"},
      {"<markers><marker name='a' body='left foot' at='middel'/></markers>", "middle"},
  };
  cav_model *m = load("humanoid");
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    cav_error error = {0};
    cav_marker_set *set = cav_marker_set_read(put_text("w.xml", wrong[i].text), m, &error);
    if (!CHECK(!set && strstr(error.text, wrong[i].expected))) printf("case %zu: %s\n", i, error.text);
    cav_marker_set_free(set);
  }
  // a loop, a stranger, nothing to scale by
  static const char *const from[][2] = {{"mocap[rhip]", "measured from it"}, {"nobody", "expected another marker"}};
  double *q = still(m);
  for (int k = 0; k < 3; k++) {
    cav_error error = {0};
    cav_trajectory *motion = NULL;
    cav_ik_options options = cav_ik_options_default();
    cav_marker_set *set = read_set(m);
    cav_record *r = record_of(m, set, q, 1);
    for (int i = 0; i < 2 && k < 2; i++) {
      free(set->marker[i].from);
      set->marker[i].from = strdup(i ? "mocap[lhip]" : from[k][0]);
    }
    if (k == 2) set->nmarker = 1;
    CHECK(cav_ik(m, r, set, &options, &motion, NULL, &error) == CAV_BAD_INPUT && !motion);
    if (!CHECK(strstr(error.text, k < 2 ? from[k][1] : "expected another marker") != NULL)) printf("%s\n", error.text);
    if (k == 2) set->nmarker = 16;
    cav_record_free(r);
    cav_marker_set_free(set);
  }
  free(q);
  cav_model_free(m);
}

// what is written reads back
static void test_written(void) {
  cav_model *m = load("robot");
  cav_marker_set *set = read_set(m);
  cav_error error = {0};
  const char *path = put_text("set.xml", "");
  CHECK(!cav_marker_set_write(path, m, set, &error));
  cav_marker_set *again = cav_marker_set_read(path, m, &error);
  CHECK(again && again->retarget && again->floor && again->nmarker == set->nmarker);
  for (int i = 0; again && i < set->nmarker; i++) {
    const cav_marker *a = &set->marker[i], *b = &again->marker[i];
    CHECK(a->body == b->body && !memcmp(a->place, b->place, sizeof a->place) && !strcmp(a->from, b->from));
  }
  cav_marker_set_free(again);
  cav_marker_set_free(set);
  cav_model_free(m);
}

int main(void) {
  CHECK(mkdtemp(folder) != NULL);
  test_similar();
  test_scale();
  test_feet();
  test_bearing();
  test_smooth();
  test_range();
  test_pace();
  test_refusals();
  test_written();
  char command[80];
  snprintf(command, sizeof command, "rm -r %s", folder);
  CHECK(system(command) == 0);
  return check_result();
}
