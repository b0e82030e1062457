/// optim/trajectory/trajectory.c: making, differencing, resampling, and the CSV file both ways, with every kind of
/// broken file.
#include "cavort/trajectory.h"

#include <locale.h>
#include <sys/stat.h>
#include <unistd.h>

#include "check.h"

static char folder[] = "/tmp/cavort-trajectory-XXXXXX";
static char model_path[128], csv_path[128];

// one joint of each kind, one of them without a name, one whose name needs quotes
static const char model_text[] =
    "<mujoco><worldbody><body name='a'><joint name='root' type='free'/><geom size='.1'/>"
    "<body name='b' pos='0 0 1'><joint name='shoulder' type='ball'/><geom size='.1'/>"
    "<body name='c' pos='0 0 1'><joint name='slide, \"odd\"' type='slide'/><joint type='hinge' axis='0 1 0'/><geom "
    "size='.1'/>"
    "</body></body></body></worldbody></mujoco>";

static void write_file(const char *path, const char *text) {
  FILE *file = fopen(path, "w");
  CHECK(file != NULL);
  if (!file) return;
  fputs(text, file);
  fclose(file);
}

// whole file in static memory
static const char *read_file(const char *path) {
  static char text[200000];
  FILE *file = fopen(path, "r");
  size_t n = file ? fread(text, 1, sizeof text - 1, file) : 0;
  if (file) fclose(file);
  text[n] = 0;
  return text;
}

static double draw(unsigned *seed) {
  *seed = *seed * 1664525u + 1013904223u;
  return (double)(*seed >> 8) / (1 << 23) - 1;
}

// a motion that moves every joint
static cav_trajectory *wander(const cav_model *model, int n, double h) {
  cav_trajectory *trajectory = cav_trajectory_new(model, n, h);
  double v[16];
  unsigned seed = 7;
  for (int t = 0; t < n; t++) {
    if (t > 0) {
      for (int d = 0; d < model->nv; d++) v[d] = 2 * draw(&seed);
      cav_integrate(model, trajectory->q + (t - 1) * model->nq, v, h, trajectory->q + t * model->nq);
    }
    for (int d = 0; d < model->nv; d++) trajectory->v[t * model->nv + d] = t ? v[d] : 0.1 * d;
    for (int d = 0; d < model->nv; d++) trajectory->u[t * model->nv + d] = 100 * draw(&seed) / 3;
  }
  return trajectory;
}

static void check_new(const cav_model *model) {
  cav_trajectory *trajectory = cav_trajectory_new(model, 5, 0.02);
  CHECK(trajectory && trajectory->nq == model->nq && trajectory->nv == model->nv && trajectory->nknot == 5);
  for (int t = 0; t < 5; t++) CHECK_NEAR_ALL(trajectory->q + t * model->nq, model->q0, model->nq, 0);
  for (int i = 0; i < 5 * model->nv; i++) CHECK(trajectory->v[i] == 0 && trajectory->u[i] == 0);
  CHECK(cav_trajectory_new(model, 1, 0.02) == NULL);
  cav_trajectory_free(trajectory);
  cav_trajectory_free(NULL);
}

static void check_velocities(const cav_model *model) {
  cav_trajectory *trajectory = wander(model, 20, 0.03), *copy = cav_trajectory_copy(trajectory);
  // the copy is apart: clearing its velocities and taking them from q gives back those that made q
  memset(copy->v + model->nv, 0, sizeof(double) * (size_t)(19 * model->nv));
  CHECK(trajectory->v[model->nv] != 0);
  cav_trajectory_velocities(model, copy);
  // rounding of q over h: 1e-15/0.03, seen 6e-14
  CHECK_NEAR_ALL(copy->v, trajectory->v, 20 * model->nv, 1e-12);
  cav_trajectory_free(copy);
  cav_trajectory_free(trajectory);
}

static void check_resample(const cav_model *model) {
  cav_trajectory *coarse = wander(model, 11, 0.04);
  cav_trajectory *fine = cav_trajectory_resample(model, coarse, 0.01);
  CHECK(fine && fine->nknot == 41);
  for (int t = 0; t < 11 && fine; t++) {
    // at shared knots the configurations agree: rounding, seen 3e-16
    CHECK_NEAR_ALL(fine->q + 4 * t * model->nq, coarse->q + t * model->nq, model->nq, 1e-14);
    // rounding of forces of some tens: seen 6e-14
    CHECK_NEAR_ALL(fine->u + 4 * t * model->nv, coarse->u + t * model->nv, model->nv, 1e-12);
  }
  cav_trajectory *back = fine ? cav_trajectory_resample(model, fine, 0.04) : NULL;
  CHECK(back && back->nknot == 11);
  if (back) CHECK_NEAR_ALL(back->q, coarse->q, 11 * model->nq, 1e-14);
  CHECK(cav_trajectory_resample(model, coarse, 0) == NULL);
  CHECK(cav_trajectory_resample(model, coarse, 10) == NULL);
  CHECK(cav_trajectory_resample(model, coarse, NAN) == NULL);
  cav_trajectory_free(back);
  cav_trajectory_free(fine);
  cav_trajectory_free(coarse);
}

// largest distance at the middle of steps, first and last steps apart, from a motion along one tangent as sin 3t
static double misread(const cav_model *model, double h) {
  int n = (int)lround(0.8 / h) + 1;
  double *along = malloc(sizeof(double) * (size_t)(2 * model->nv + model->nq)), worst = 0;
  double *scaled = along + model->nv, *q = scaled + model->nv;
  for (int d = 0; d < model->nv; d++) along[d] = 0.3 * sin(1.3 * d + 0.4);
  cav_trajectory *coarse = cav_trajectory_new(model, n, h);
  for (int t = 0; t < n; t++) cav_integrate(model, model->q0, along, sin(3 * t * h), coarse->q + t * model->nq);
  cav_trajectory_velocities(model, coarse);
  cav_trajectory *fine = cav_trajectory_resample(model, coarse, h / 2);
  for (int t = 3; t < 2 * n - 4; t += 2) {
    cav_integrate(model, model->q0, along, sin(1.5 * t * h), q);
    cav_difference(model, q, fine->q + t * model->nq, 1, scaled);
    for (int d = 0; d < model->nv; d++) worst = fmax(worst, fabs(scaled[d]));
  }
  cav_trajectory_free(fine);
  cav_trajectory_free(coarse);
  free(along);
  return worst;
}

// cubics with central derivatives read a smooth motion to h^4 in the middle of a step: seen a factor 15.8 a halving.
// Geodesics: 4
static void check_smooth(const cav_model *model) {
  double coarse = misread(model, 0.04), fine = misread(model, 0.02);
  printf("motion read between knots: %.2g at 0.04 s, %.2g at 0.02 s\n", coarse, fine);
  CHECK(coarse < 1e-4 && coarse / fine > 12);
}

static void check_round_trip(const cav_model *model) {
  cav_error error;
  cav_trajectory *trajectory = wander(model, 17, 1.0 / 30);
  CHECK(cav_trajectory_write(csv_path, model, trajectory, &error) == CAV_OK);
  cav_trajectory *read = cav_trajectory_read(csv_path, model, &error);
  CHECK(read != NULL);
  if (read) {
    // bit for bit
    CHECK(read->nknot == 17 && read->timestep == trajectory->timestep);
    CHECK_NEAR_ALL(read->q, trajectory->q, 17 * model->nq, 0);
    CHECK_NEAR_ALL(read->v, trajectory->v, 17 * model->nv, 0);
    CHECK_NEAR_ALL(read->u, trajectory->u, 17 * model->nv, 0);
  }
  const char *header =
      "time,qpos_root_0,qpos_root_1,qpos_root_2,qpos_root_3,qpos_root_4,qpos_root_5,qpos_root_6,qpos_shoulder_0,";
  CHECK(!strncmp(read_file(csv_path), header, strlen(header)));
  CHECK(strstr(read_file(csv_path), ",\"qpos_slide, \"\"odd\"\"\",qpos_#3,qvel_root_0,") != NULL);
  cav_trajectory_free(read);

  // what is not finite is not written, and the old file stays
  char *before = strdup(read_file(csv_path));
  trajectory->u[3] = NAN;
  CHECK(cav_trajectory_write(csv_path, model, trajectory, &error) == CAV_NOT_FINITE);
  CHECK_TEXT(read_file(csv_path), before);
  trajectory->u[3] = 0;
  CHECK(cav_trajectory_write("/nowhere/at/all.csv", model, trajectory, &error) == CAV_BAD_INPUT);
  CHECK(strstr(error.text, "/nowhere/at/all.csv") != NULL);
  free(before);
  cav_trajectory_free(trajectory);
}

// a user's own file: only what is needed, columns in another order, few digits, CRLF
static void check_partial(const cav_model *model) {
  cav_error error = {0};
  write_file(csv_path,
             "qpos_#3,time,qpos_root_0,qpos_root_1,qpos_root_2,qpos_root_3,qpos_root_4,qpos_root_5,qpos_root_6,qpos_"
             "shoulder_0,"
             "qpos_shoulder_1,qpos_shoulder_2,qpos_shoulder_3,\"qpos_slide, \"\"odd\"\"\"\r\n"
             "0.0,0,0,0,1,1,0,0,0,1,0,0,0,0\r\n\r\n"
             "0.1,0.1,0,0,1.5,0.9998,0.02,0,0,1,0,0,0,0.25\r\n");
  cav_trajectory *read = cav_trajectory_read(csv_path, model, &error);
  CHECK(read != NULL);
  if (!read) {
    fprintf(stderr, "    %s\n", error.text);
    return;
  }
  CHECK_NEAR(read->timestep, 0.1, 0);
  CHECK_NEAR(read->v[model->nv + 2], 5, 1e-12);
  CHECK_NEAR(read->v[model->nv + model->nv - 1], 1, 1e-12);
  double *w = read->q + model->nq + 3;
  CHECK_NEAR(w[0] * w[0] + w[1] * w[1] + w[2] * w[2] + w[3] * w[3], 1, 1e-15);
  cav_trajectory_free(read);
}

// expects the file to be refused with this line and these words
static void refuse(const cav_model *model, const char *text, int line, const char *words) {
  cav_error error = {0};
  write_file(csv_path, text);
  cav_trajectory *read = cav_trajectory_read(csv_path, model, &error);
  CHECK(read == NULL);
  char place[160];
  snprintf(place, sizeof place, "%s:%d: ", csv_path, line);
  int said = error.status == CAV_BAD_INPUT && error.line == line && !strncmp(error.text, place, strlen(place)) &&
             strstr(error.text, words);
  CHECK(said);
  if (!said) fprintf(stderr, "    expected %s...%s, got %s\n", place, words, error.text);
  cav_trajectory_free(read);
}

static void check_refusals(void) {
  write_file(model_path,
             "<mujoco><worldbody><body><joint name='x' type='slide'/><geom size='.1'/></body></worldbody></mujoco>");
  cav_error error = {0};
  cav_model *model = cav_model_load(model_path, &error);
  CHECK(model != NULL);
  if (!model) return;
  refuse(model, "", 1, "empty");
  refuse(model, "time,qpos_x\n0,0\n", 1, "two rows");
  refuse(model, "time,qpos_y\n0,0\n.1,0\n", 1, "qpos_x");
  refuse(model, "time,elbow\n0,0\n.1,0\n", 1, "'elbow'");
  refuse(model, "qpos_x\n0\n1\n", 1, "'time' is missing");
  refuse(model, "time\n0\n1\n", 1, "'qpos_x' is missing");
  refuse(model, "time,qpos_x,qpos_x\n0,0,0\n.1,0,0\n", 1, "twice");
  refuse(model, "time,qpos_x\n0,0\n.1,0,5\n", 3, "expected 2 values");
  refuse(model, "time,qpos_x\n0,0\n.1\n", 3, "expected 2 values");
  refuse(model, "time,qpos_x\n0,zero\n.1,0\n", 2, "'zero'");
  refuse(model, "time,qpos_x\n0,0\n.1,nan\n", 3, "finite");
  refuse(model, "time,qpos_x,u_x\n0,0,\n.1,0,1\n", 2, "finite");
  refuse(model, "time,qpos_x\n0,0\n.1,1e999\n", 3, "finite");
  refuse(model, "time,qpos_x\n0,0\n.1,\n", 3, "finite");
  refuse(model, "time,qpos_x\n0,0\n.1,0\n.25,0\n", 3, "equal");
  refuse(model, "time,qpos_x\n0,0\n-.1,0\n", 2, "increasing");
  // rows 4 to 6 are gone; row 2 alone is late, of steps as the last
  refuse(model, "time,qpos_x\n0,0\n.1,0\n.2,0\n.6,0\n.7,0\n.8,0\n", 5,
         "row 4 comes 0.4 s after the one before, other rows 0.1 s");
  refuse(model, "time,qpos_x\n0,0\n.5,0\n.6,0\n.7,0\n.8,0\n", 3, "row 2 comes 0.5 s after");
  // of an open end no force is told: empty, read as 0
  cav_trajectory *open = cav_trajectory_new(model, 3, 0.1);
  open->u[0] = open->u[1] = 7;
  open->u[2] = NAN;
  CHECK(cav_trajectory_write(csv_path, model, open, &error) == CAV_OK && strstr(read_file(csv_path), ",0,\n"));
  cav_trajectory *back = cav_trajectory_read(csv_path, model, &error);
  CHECK(back && back->u[1] == 7 && back->u[2] == 0);
  open->u[1] = NAN;
  CHECK(cav_trajectory_write(csv_path, model, open, &error) == CAV_NOT_FINITE);
  cav_trajectory_free(open), cav_trajectory_free(back);
  cav_trajectory *none = cav_trajectory_read("/nowhere/at/all.csv", model, &error);
  CHECK(!none && error.status == CAV_BAD_INPUT && strstr(error.text, "/nowhere/at/all.csv"));
  none = cav_trajectory_read(folder, model, &error);
  CHECK(!none && error.status == CAV_BAD_INPUT);
  none = cav_trajectory_read(folder, model, NULL);
  CHECK(!none);
  cav_model_free(model);
}

// nobody writes into the pipe: whoever opens it to read waits for ever
static void check_pipe(const cav_model *model) {
  cav_error error = {0};
  remove(csv_path);
  CHECK(mkfifo(csv_path, 0600) == 0);
  alarm(20);
  cav_trajectory *none = cav_trajectory_read(csv_path, model, &error);
  alarm(0);
  CHECK(!none && error.status == CAV_BAD_INPUT && strstr(error.text, "not a file") != NULL);
  remove(csv_path);
}

// numbers have a point in any locale that is there
static void check_locale(const cav_model *model) {
  if (!setlocale(LC_ALL, "de_DE.UTF-8")) {
    printf("no German locale here: the comma is not tried\n");
    return;
  }
  check_round_trip(model);
  setlocale(LC_ALL, "C");
}

// waves of one frequency each: what is differenced, times the gain of both passes, 1/(1 + (tan(pi f h)/K)^4) with K =
// tan of the corner's angle; at the cutoff of slow frames a half of the power
static void check_accelerations(const cav_model *model) {
  enum { KNOTS = 2000 };
  static const double h = 0.005, cutoff = 6, frequency[] = {0.5, 2, 6, 15};
  cav_trajectory *t = cav_trajectory_new(model, KNOTS, h);
  double *a = malloc(KNOTS * (size_t)model->nv * sizeof *a), K = tan(M_PI * h * cutoff / pow(sqrt(2) - 1, 0.25));
  for (int k = 0; k < KNOTS; k++)
    for (int d = 0; d < model->nv; d++) t->v[k * model->nv + d] = sin(2 * M_PI * frequency[d % 4] * k * h + d);
  CHECK(cav_trajectory_accelerations(t, cutoff, a) == CAV_OK);
  for (int d = 0; d < 4; d++) {
    double w = M_PI * frequency[d] * h, gain = 1 / (1 + pow(tan(w) / K, 4)), worst = 0;
    for (int k = KNOTS / 4; k < 3 * KNOTS / 4; k++)
      worst = fmax(worst, fabs(a[k * model->nv + d] - gain * 2 / h * sin(w) * cos(w * (2 * k + 1) + d)));
    CHECK(worst < 1e-3 * gain * 2 / h * sin(w));
    if (d == 2) CHECK_NEAR(gain, sqrt(0.5), 0.01);
  }
  // a steady one is what it is, to the ends
  for (int k = 0; k < KNOTS; k++)
    for (int d = 0; d < model->nv; d++) t->v[k * model->nv + d] = d - 3 + 0.1 * (d - 2) * k * h;
  CHECK(cav_trajectory_accelerations(t, cutoff, a) == CAV_OK);
  for (int k = 0; k < KNOTS; k++) CHECK_NEAR(a[k * model->nv + 4], 0.2, 1e-9);
  CHECK(cav_trajectory_accelerations(t, 0, a) == CAV_BAD_INPUT &&
        cav_trajectory_accelerations(t, 81, a) == CAV_BAD_INPUT);
  free(a);
  cav_trajectory_free(t);
}

int main(void) {
  CHECK(mkdtemp(folder) != NULL);
  snprintf(model_path, sizeof model_path, "%s/model.xml", folder);
  snprintf(csv_path, sizeof csv_path, "%s/trajectory.csv", folder);
  write_file(model_path, model_text);
  cav_error error = {0};
  cav_model *model = cav_model_load(model_path, &error);
  CHECK(model != NULL);
  if (model) {
    check_new(model);
    check_velocities(model);
    check_accelerations(model);
    check_resample(model);
    check_smooth(model);
    check_round_trip(model);
    check_partial(model);
    check_pipe(model);
    check_locale(model);
  } else {
    fprintf(stderr, "%s\n", error.text);
  }
  check_refusals();
  cav_model_free(model);
  remove(csv_path);
  remove(model_path);
  // nothing is left behind, not even half a file
  CHECK(rmdir(folder) == 0);
  return check_result();
}
