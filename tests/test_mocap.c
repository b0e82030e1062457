/// Recorded motion: clips of every format against numbers written by hand, what is wrong in them, and fits of clips
/// that a known motion of a known model made: recovered to rounding, with gaps, with places unknown, with noise as
/// large as the degrees of freedom let it be.
#include <math.h>
#include <stdint.h>
#include <string.h>
#include <unistd.h>

#include "cavort/cavort.h"
#include "check.h"
#include "math3.h"

static char folder[] = "/tmp/cavort_mocap_XXXXXX";

static const char *path_of(const char *name) {
  static char path[4][120];
  static int next;
  next = (next + 1) % 4;
  snprintf(path[next], sizeof path[next], "%s/%s", folder, name);
  return path[next];
}

static const char *put(const char *name, const char *text, size_t size) {
  const char *path = path_of(name);
  FILE *file = fopen(path, "wb");
  CHECK(file && fwrite(text, 1, size, file) == size);
  if (file) fclose(file);
  return path;
}

static const char *put_text(const char *name, const char *text) { return put(name, text, strlen(text)); }

// a frame's marker by name; NULL: the clip has none
static const double *at(const cav_record *r, int frame, const char *name) {
  for (int i = 0; r && i < r->nmarker; i++)
    if (!strcmp(r->name[i], name)) return r->position + 3 * ((size_t)frame * (size_t)r->nmarker + (size_t)i);
  return NULL;
}

static void check_place(const cav_record *r, int frame, const char *name, double x, double y, double z) {
  const double *p = at(r, frame, name);
  CHECK(p && fabs(p[0] - x) < 1e-9 && fabs(p[1] - y) < 1e-9 && fabs(p[2] - z) < 1e-9);
}

static void check_gap(const cav_record *r, int frame, const char *name) {
  const double *p = at(r, frame, name);
  CHECK(p && isnan(p[0]) && isnan(p[1]) && isnan(p[2]));
}

// ---------------------------------------------------------------- formats

// millimetres, y up: x stays, z becomes what was y, y what was -z
static void test_trc(void) {
  cav_error error = {0};
  cav_record *r = cav_record_read(
      put_text("a.trc",
               "PathFileType\t4\t(X/Y/Z)\ta\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n"
               " 100.0\t\t 100.0\t  2\t 2\t mm\nFrame#\tTime\tR.Heel\t\t\tTop head\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
               "1\t0.00\t100\t200\t300\t1\t2\t3\n2\t0.01\t101\t200\t300\t\t\t\r\n"),
      NULL, &error);
  CHECK(r && r->nframe == 2 && r->nmarker == 2 && fabs(r->time[1] - 0.01) < 1e-12);
  check_place(r, 0, "R.Heel", 0.1, -0.3, 0.2);
  check_place(r, 1, "R.Heel", 0.101, -0.3, 0.2);
  check_place(r, 0, "Top head", 0.001, -0.003, 0.002);
  check_gap(r, 1, "Top head");
  CHECK(r && r->assumed == CAV_ASSUMED_UP);
  cav_record_free(r);
}

static void test_csv(void) {
  cav_error error = {0};
  cav_record_options options = {.unit = 0.01, .from = 0.4, .to = 1};
  cav_record *r = cav_record_read(
      put_text("a.csv",
               "time,a_x,a_y,a_z,b.X,b.Y,b.Z\n0,9,9,9,9,9,9\n0.5,1,2,3,,,\n1,nan,2,3,4,5,6\n\n2,7,7,7,7,7,7\n"),
      &options, &error);
  CHECK(r && r->nframe == 2 && r->nmarker == 2 && r->assumed == 0);
  check_place(r, 0, "a", 0.01, 0.02, 0.03);
  check_gap(r, 0, "b");
  check_gap(r, 1, "a");
  check_place(r, 1, "b", 0.04, 0.05, 0.06);
  // written and read again
  CHECK(r && !cav_record_write(path_of("b.csv"), r, &error));
  cav_record *again = cav_record_read(path_of("b.csv"), NULL, &error);
  CHECK(again && again->nframe == 2 && again->nmarker == 2);
  check_place(again, 1, "b", 0.04, 0.05, 0.06);
  check_gap(again, 0, "b");
  cav_record_free(again);
  cav_record_free(r);
}

// a root at (1, 2, 3) cm turned by 90 degrees about y (up): its child, 10 cm along z, goes along x; the end 5 cm
// further along z of a child turned by 90 degrees about x: down along -y
static void test_bvh(void) {
  cav_error error = {0};
  cav_record *r = cav_record_read(
      put_text("a.bvh",
               "HIERARCHY\nROOT Hips\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition Yrotation Xrotation "
               "Zrotation\n"
               " JOINT Left Leg\n {\n  OFFSET 0 0 10\n  CHANNELS 3 Zrotation Xrotation Yrotation\n  End Site\n  {\n   "
               "OFFSET 0 0 5\n"
               "  }\n }\n}\nMOTION\nFrames: 2\nFrame Time: 0.02\n0 0 0 0 0 0 0 0 0\n1 2 3 90 0 0 0 90 0\n"),
      NULL, &error);
  CHECK(r && r->nframe == 2 && r->nmarker == 3 && fabs(r->time[1] - 0.02) < 1e-12 && r->assumed == CAV_ASSUMED_UNIT);
  check_place(r, 0, "Left Leg", 0, -0.1, 0);
  check_place(r, 0, "Left Leg_end", 0, -0.15, 0);
  check_place(r, 1, "Hips", 0.01, -0.03, 0.02);
  check_place(r, 1, "Left Leg", 0.11, -0.03, 0.02);
  check_place(r, 1, "Left Leg_end", 0.11, -0.03, -0.03);
  cav_record_free(r);
}

static void test_keys(void) {
  cav_error error = {0};
  const char *keys =
      "<mujoco>\n<keyframe><key mpos=\"1 2 3 4 5 6\"/><key mpos=\"1 2 3.5 4 5 6\"/></keyframe>%s</mujoco>\n";
  char text[600];
  snprintf(text, sizeof text, keys,
           "<worldbody><body name=\"head\" mocap=\"true\"/><body name=\"box\"/><body name=\"foot\" "
           "mocap=\"true\"/></worldbody>");
  cav_record *r = cav_record_read(put_text("a.xml", text), NULL, &error);
  CHECK(r && r->nframe == 2 && r->assumed == CAV_ASSUMED_RATE && fabs(r->time[1] - 1.0 / 30) < 1e-12);
  check_place(r, 1, "head", 1, 2, 3.5);
  check_place(r, 0, "foot", 4, 5, 6);
  cav_record_free(r);
  snprintf(text, sizeof text, keys, "");
  cav_record_options options = {.names = "left right", .rate = 50};
  r = cav_record_read(put_text("b.xml", text), &options, &error);
  CHECK(r && r->assumed == 0 && fabs(r->time[1] - 0.02) < 1e-12);
  check_place(r, 0, "right", 4, 5, 6);
  cav_record_free(r);
}

// ---------------------------------------------------------------- C3D, written by its user guide

enum { INTEL = 84, DEC = 85, MIPS = 86 };

static void put_short(unsigned char *b, int kind, int value) {
  b[kind == MIPS] = (unsigned char)(value & 255);
  b[kind != MIPS] = (unsigned char)(value >> 8 & 255);
}

static void put_real(unsigned char *b, int kind, double value) {
  float single = (float)(kind == DEC ? 4 * value : value);
  uint32_t bits;
  memcpy(&bits, &single, sizeof bits);
  unsigned char low[4] = {(unsigned char)bits, (unsigned char)(bits >> 8), (unsigned char)(bits >> 16),
                          (unsigned char)(bits >> 24)};
  static const int order[3][4] = {{0, 1, 2, 3}, {2, 3, 0, 1}, {3, 2, 1, 0}};
  for (int i = 0; i < 4; i++) b[order[kind - INTEL][i]] = low[i];
}

// an entry of the parameter section; returns where the next one goes
static unsigned char *put_entry(unsigned char *b, int kind, int id, const char *name, int type, int ndim,
                                const int *dim, const char *data) {
  int n = (int)strlen(name), size = type < 0 ? 1 : type;
  *b++ = (unsigned char)n, *b++ = (unsigned char)id;
  memcpy(b, name, (size_t)n), b += n;
  unsigned char *way = b;
  b += 2;
  if (id < 128) {
    *b++ = (unsigned char)type, *b++ = (unsigned char)ndim;
    for (int i = 0; i < ndim; i++) size *= dim[i], *b++ = (unsigned char)dim[i];
    memcpy(b, data, (size_t)size), b += size;
  }
  *b++ = 0; // no description
  put_short(way, kind, (int)(b - way));
  return b;
}

// 3 frames of 2 points, one analogue number a frame; the second point is missing in the second frame
static size_t make_c3d(unsigned char *file, int kind, int real) {
  memset(file, 0, 4096);
  file[0] = 2, file[1] = 0x50;
  put_short(file + 2, kind, 2), put_short(file + 4, kind, 1), put_short(file + 6, kind, 1),
      put_short(file + 8, kind, 3);
  put_real(file + 12, kind, real ? -0.5 : 0.5);
  put_short(file + 16, kind, 3), put_short(file + 18, kind, 1);
  put_real(file + 20, kind, 50);
  unsigned char *b = file + 512;
  b[2] = 1, b[3] = (unsigned char)kind, b += 4;
  b = put_entry(b, kind, 255, "POINT", 0, 0, NULL, NULL);
  b = put_entry(b, kind, 1, "LABELS", -1, 2, (const int[]){6, 2}, "LHEE  RHEE  ");
  b = put_entry(b, kind, 1, "UNITS", -1, 1, (const int[]){2}, "mm");
  *b = 0;
  b = file + 1024;
  for (int t = 0; t < 3; t++) {
    for (int i = 0; i < 2; i++)
      for (int k = 0; k < 4; k++, b += real ? 4 : 2) {
        int missing = t == 1 && i == 1;
        double value = k == 3 ? (missing ? -1 : 0) : 100 * t + 10 * i + k;
        if (real)
          put_real(b, kind, value);
        else
          put_short(b, kind, (int)(k == 3 ? value : 2 * value));
      }
    b += real ? 4 : 2;
  }
  return (size_t)(b - file);
}

// points without labels are called by their numbers; what a table cannot hold is left out of names
static void test_names(void) {
  cav_error error = {0};
  unsigned char file[4096];
  size_t size = make_c3d(file, INTEL, 1);
  for (size_t i = 0; i + 6 < size; i++) {
    if (!memcmp(file + i, "LHEE  ", 6)) memcpy(file + i, "\0x    ", 6);
    if (!memcmp(file + i, "RHEE  ", 6)) memcpy(file + i, "a,\"\nb ", 6);
  }
  cav_record *r = cav_record_read(put("a.c3d", (const char *)file, size), NULL, &error);
  CHECK(r && r->nmarker == 2 && !strcmp(r->name[0], "#1") && !strcmp(r->name[1], "a___b"));
  CHECK(r && !cav_record_write(path_of("a.csv"), r, &error));
  cav_record *again = cav_record_read(path_of("a.csv"), NULL, &error);
  CHECK(again && again->nmarker == 2 && !strcmp(again->name[1], "a___b"));
  cav_record_free(again);
  if (r) r->name[0][0] = ',';
  CHECK(r && cav_record_write(path_of("a.csv"), r, &error) == CAV_BAD_INPUT && strstr(error.text, "marker 1"));
  cav_record_free(r);
  // a marker of which no frame shows all three coordinates is not seen
  r = cav_record_read(put_text("a.csv", "time,a_x,a_y,a_z\n0,1,,2\n"), NULL, &error);
  CHECK(!r && strstr(error.text, "no frame shows a marker"));
}

static void test_c3d(void) {
  unsigned char file[4096];
  for (int kind = INTEL; kind <= MIPS; kind++)
    for (int real = 0; real < 2; real++) {
      cav_error error = {0};
      size_t size = make_c3d(file, kind, real);
      cav_record *r = cav_record_read(put("a.c3d", (const char *)file, size), NULL, &error);
      CHECK(r && r->nframe == 3 && r->nmarker == 2 && fabs(r->time[2] - 0.04) < 1e-12 && r->assumed == CAV_ASSUMED_UP);
      check_place(r, 2, "LHEE", 0.2, 0.201, 0.202);
      check_place(r, 2, "RHEE", 0.21, 0.211, 0.212);
      check_gap(r, 1, "RHEE");
      cav_record_free(r);
      // cut anywhere it is refused, or is a clip, and never more
      for (size_t cut = 0; cut < size; cut += 7) {
        r = cav_record_read(put("cut.c3d", (const char *)file, cut), NULL, &error);
        CHECK(!r && error.status == CAV_BAD_INPUT);
        cav_record_free(r);
      }
    }
}

// ---------------------------------------------------------------- what is wrong

static void test_errors(void) {
  static const struct {
    const char *name, *text, *expected;
  } wrong[] = {
      {"a.txt", "", "expected a clip whose name ends in .trc, .c3d, .bvh, .csv or .xml"},
      {"w.trc", "time,a_x\n", ":1: expected a TRC file"},
      {"w.trc", "PathFileType\nUnits\nyard\nFrame#\tTime\ta\n\n",
       ":3: expected m, cm, mm, in or ft as Units, got 'yard'"},
      {"w.trc", "PathFileType\nUnits\nmm\nFrame#\tTime\ta\t\t\n\n1\t0\t1\tx\t3\n",
       ":6: marker 1: expected a number, got 'x'"},
      {"w.trc", "PathFileType\nUnits\nmm\nFrame#\tTime\ta\t\t\n\n1\t0\t1\t2\t3\t4\n", ":6: expected 3 numbers"},
      {"w.csv", "time,a_x,a_y\n", ":1: expected the columns time"},
      {"w.csv", "time,a_x,a_y,b_z\n", ":1: column 4: expected 'a_z'"},
      {"w.csv", "time,a_x,a_y,a_z\n0,1,2,3\n0,1,2,3\n", "expected times that increase"},
      {"w.csv", "time,a_x,a_y,a_z\n0,1,2,3,4\n", ":2: expected 3 numbers"},
      {"w.csv", "time,a_x,a_y,a_z,a_x,a_y,a_z\n0,1,2,3,1,2,3\n", "marker 'a' is there twice"},
      {"w.csv", "time,a_x,a_y,a_z\n0,,,\n", "no frame shows a marker"},
      {"w.bvh", "HIERARCHY\nROOT a\n{\nOFFSET 0 0\n", ":5: expected a number"},
      {"w.bvh", "HIERARCHY\nROOT a\n{\nCHANNELS 1 Wrotation\n",
       ":4: expected a channel such as 'Zrotation', got 'Wrotation'"},
      {"w.bvh", "HIERARCHY\nMOTION\n", "expected a skeleton"},
      {"w.bvh", "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\n}\nMOTION\nFrames: 9e15\nFrame Time: 1\n", "no joint has any"},
      {"w.xml", "<mujoco><keyframe><key mpos=\"1 2 3\"/></keyframe></mujoco>", "list their names in order"},
      {"w.c3d", "no", "expected a C3D file"},
  };
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    cav_error error = {0};
    cav_record *r = cav_record_read(put_text(wrong[i].name, wrong[i].text), NULL, &error);
    CHECK(!r && error.status == CAV_BAD_INPUT);
    if (!strstr(error.text, wrong[i].expected)) printf("case %zu: %s\n", i, error.text);
    CHECK(strstr(error.text, wrong[i].expected) != NULL);
    cav_record_free(r);
  }
  cav_error error = {0};
  CHECK(!cav_record_read("/nowhere/a.csv", NULL, &error) && strstr(error.text, "cannot be opened"));
}

// ---------------------------------------------------------------- fits

enum { FRAMES = 60 };

typedef struct truth {
  cav_model *model;
  cav_marker_set *set;
  double *q; // [FRAMES*nq]
  cav_record *record;
} truth;

// a sequence that does not repeat: between -1 and 1
static double draw(unsigned *seed) {
  *seed = *seed * 1664525u + 1013904223u;
  return (double)(*seed >> 8) / 8388608.0 - 1;
}

// three markers on every body of the humanoid, which waves all its joints, turns and walks off
static void make(truth *c) {
  cav_error error = {0};
  unsigned seed = 7;
  static char text[12000];
  c->model = cav_model_load(CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml", &error);
  const cav_model *m = c->model;
  char *end = text + sprintf(text, "<markers>\n");
  for (int b = 1; b < m->nbody; b++)
    for (int k = 0; k < 3; k++)
      end += sprintf(end, "<marker name=\"%s%d\" body=\"%s\" pos=\"%g %g %g\"/>\n", m->body[b].name, k, m->body[b].name,
                     0.1 * draw(&seed), 0.1 * draw(&seed), 0.1 * draw(&seed));
  sprintf(end, "</markers>\n");
  c->set = cav_marker_set_read(put_text("set.xml", text), m, &error);
  CHECK(c->set != NULL);
  c->record = cav_record_new(FRAMES, c->set->nmarker, 100);
  c->q = malloc(FRAMES * (size_t)m->nq * sizeof *c->q);
  cav_state *state = cav_state_new(m);
  CHECK(m->nv <= 64);
  for (int i = 0; i < c->set->nmarker; i++) c->record->name[i] = strdup(c->set->marker[i].name);
  for (int t = 0; t < FRAMES; t++) {
    double *q = c->q + (size_t)t * (size_t)m->nq, move[64] = {0};
    memcpy(q, m->q0, (size_t)m->nq * sizeof *q);
    for (int j = 1; j < m->njoint; j++) {
      const double *range = m->joint[j].range;
      q[m->joint[j].q] = (range[0] + range[1]) / 2 + 0.45 * (range[1] - range[0]) * sin(0.1 * t + 1.7 * j);
    }
    move[0] = 0.02 * t, move[4] = 0.3 * sin(0.05 * t), move[5] = 2 + 0.02 * t;
    cav_integrate(m, q, move, 1, q);
    CHECK(!cav_position(m, state, q));
    for (int i = 0; i < c->set->nmarker; i++) {
      cav_pose pose;
      cav_object_pose(m, state, CAV_OBJECT_XBODY, c->set->marker[i].body, &pose);
      transform(c->record->position + 3 * ((size_t)t * (size_t)c->set->nmarker + (size_t)i), pose.pos, pose.rotation,
                c->set->marker[i].place);
    }
  }
  cav_state_free(state);
}

// largest difference of configurations, rad and m
static double off(const truth *c, const cav_trajectory *motion) {
  double worst = 0, *d = malloc((size_t)c->model->nv * sizeof *d);
  for (int t = 0; t < FRAMES; t++) {
    cav_difference(c->model, c->q + (size_t)t * (size_t)c->model->nq, motion->q + (size_t)t * (size_t)motion->nq, 1, d);
    for (int i = 0; i < c->model->nv; i++) worst = fmax(worst, fabs(d[i]));
  }
  free(d);
  return worst;
}

static cav_ik_options bare(void) {
  cav_ik_options options = cav_ik_options_default();
  options.posture = options.roughness = 1e-7;
  return options;
}

static void test_exact(const truth *c) {
  cav_ik_options options = bare();
  cav_trajectory *motion;
  cav_ik_report *report;
  cav_error error = {0};
  CHECK(!cav_ik(c->model, c->record, c->set, &options, &motion, &report, &error));
  printf("complete: off by %.1e rad, markers by %.1e m, %.1f iterations a frame\n", off(c, motion), report->total_rms,
         (double)report->iterations / FRAMES);
  CHECK(off(c, motion) < 1e-8 && report->total_rms < 1e-9);
  CHECK(fabs(motion->timestep - 0.01) < 1e-12 && motion->nknot == FRAMES);
  cav_ik_report_free(report);
  cav_trajectory_free(motion);
}

// nearly a third of all markers is not seen, one of three on a body, for six frames each: what is left tells the rest
static void test_gaps(const truth *c) {
  cav_ik_options options = bare();
  unsigned seed = 3;
  cav_trajectory *motion;
  cav_ik_report *report;
  cav_error error = {0};
  size_t n = 3 * (size_t)c->set->nmarker * FRAMES;
  double *kept = malloc(n * sizeof *kept);
  int hidden = 0;
  memcpy(kept, c->record->position, n * sizeof *kept);
  for (int body = 0; body < c->set->nmarker; body += 3)
    for (int t = 0; t < FRAMES; t += 6) {
      int which = body + (int)(1.5 * (draw(&seed) + 1)) % 3, hide = draw(&seed) < 0.9;
      for (int k = t; k < t + 6 && hide; k++, hidden++)
        c->record->position[3 * ((size_t)k * (size_t)c->set->nmarker + (size_t)which)] = NAN;
    }
  CHECK(!cav_ik(c->model, c->record, c->set, &options, &motion, &report, &error));
  printf("%.0f %% not seen: off by %.1e rad\n", 100.0 * hidden / (FRAMES * c->set->nmarker), off(c, motion));
  CHECK(hidden > FRAMES * c->set->nmarker / 4 && off(c, motion) < 1e-6);
  memcpy(c->record->position, kept, n * sizeof *kept);
  free(kept);
  cav_ik_report_free(report);
  cav_trajectory_free(motion);
}

// a forearm that no frame shows for a while stays as it was last seen, and is found again
static void test_hidden_limb(const truth *c) {
  enum { FROM = 20, TO = 30 };
  cav_ik_options options = cav_ik_options_default();
  cav_trajectory *motion;
  cav_error error = {0};
  int elbow = c->model->joint[cav_object_find(c->model, CAV_OBJECT_JOINT, "elbow_right")].q;
  size_t n = 3 * (size_t)c->set->nmarker * FRAMES;
  double *kept = malloc(n * sizeof *kept);
  memcpy(kept, c->record->position, n * sizeof *kept);
  for (int i = 0; i < c->set->nmarker; i++)
    for (int t = FROM; t < TO; t++)
      if (!strncmp(c->set->marker[i].name, "lower_arm_right", 15) || !strncmp(c->set->marker[i].name, "hand_right", 10))
        c->record->position[3 * ((size_t)t * (size_t)c->set->nmarker + (size_t)i)] = NAN;
  CHECK(!cav_ik(c->model, c->record, c->set, &options, &motion, NULL, &error));
  for (int t = FROM - 1; motion && t < TO; t++)
    CHECK_NEAR(motion->q[t * c->model->nq + elbow], motion->q[(FROM - 1) * c->model->nq + elbow], 5e-3);
  CHECK(motion && fabs(motion->q[TO * c->model->nq + elbow] - c->q[TO * c->model->nq + elbow]) < 1e-3);
  memcpy(c->record->position, kept, n * sizeof *kept);
  free(kept);
  cav_trajectory_free(motion);
}

// every third marker without a place: found where it is
static void test_places(const truth *c) {
  cav_ik_options options = bare();
  cav_trajectory *motion;
  cav_ik_report *report;
  cav_error error = {0};
  cav_marker_set *set = cav_marker_set_read(path_of("set.xml"), c->model, &error);
  double worst = 0;
  for (int i = 0; i < set->nmarker; i += 3) {
    set->marker[i].placed = 0;
    for (int k = 0; k < 3; k++) set->marker[i].place[k] = 0;
  }
  CHECK(!cav_ik(c->model, c->record, set, &options, &motion, &report, &error));
  for (int i = 0; i < set->nmarker; i++)
    for (int k = 0; k < 3; k++) worst = fmax(worst, fabs(set->marker[i].place[k] - c->set->marker[i].place[k]));
  printf("places: off by %.1e m, configurations by %.1e rad\n", worst, off(c, motion));
  CHECK(worst < 1e-4 && off(c, motion) < 1e-3);
  CHECK(!cav_marker_set_write(path_of("found.xml"), c->model, set, &error));
  cav_marker_set *again = cav_marker_set_read(path_of("found.xml"), c->model, &error);
  CHECK(again && again->nmarker == set->nmarker && again->marker[0].placed &&
        !memcmp(again->marker[0].place, set->marker[0].place, sizeof set->marker[0].place));
  cav_marker_set_free(again);
  cav_marker_set_free(set);
  cav_ik_report_free(report);
  cav_trajectory_free(motion);
}

// noise of standard deviation s in n numbers, d of which a configuration absorbs: the residual is s sqrt((n - d)/n)
// a number
static void test_noise(const truth *c) {
  cav_ik_options options = bare();
  unsigned seed = 11;
  const double s = 2e-3;
  cav_trajectory *motion;
  cav_ik_report *report;
  cav_error error = {0};
  size_t n = 3 * (size_t)c->set->nmarker;
  double *kept = malloc(n * FRAMES * sizeof *kept);
  memcpy(kept, c->record->position, n * FRAMES * sizeof *kept);
  for (size_t i = 0; i < n * FRAMES; i++) {
    double sum = 0;
    for (int k = 0; k < 12; k++) sum += draw(&seed) / 2;
    c->record->position[i] += s * sum;
  }
  CHECK(!cav_ik(c->model, c->record, c->set, &options, &motion, &report, &error));
  double expected = s * sqrt(3) * sqrt(((double)n - c->model->nv) / (double)n);
  printf("noise of %g mm: residual %.3f of %.3f mm expected, off by %.2e rad\n", 1e3 * s, 1e3 * report->total_rms,
         1e3 * expected, off(c, motion));
  CHECK(fabs(report->total_rms / expected - 1) < 0.03);
  memcpy(c->record->position, kept, n * FRAMES * sizeof *kept);
  free(kept);
  cav_ik_report_free(report);
  cav_trajectory_free(motion);
}

// lowest point of the feet by the model's own contacts with the floor: penetration counts below 0
static double lowest(const cav_model *m, cav_state *state, const double *q) {
  double least = INFINITY;
  state->options.smoothing = 0.1;
  CHECK(!cav_position(m, state, q));
  for (int i = 0; i < state->ncontact; i++) {
    const cav_pair *pair = &m->pair[state->contact[i].pair];
    int foot = !strncmp(m->geom[pair->geom1].name, "foot", 4) || !strncmp(m->geom[pair->geom2].name, "foot", 4);
    if (pair->external && foot) least = fmin(least, state->contact[i].dist);
  }
  return least;
}

// a body that stands and raises an arm, by markers that are worn 15 mm lower than the set says: it is below the floor,
// unless feet stand on it
static void test_floor(const truth *c) {
  const cav_model *m = c->model;
  cav_error error = {0};
  cav_ik_options options = cav_ik_options_default();
  cav_record *r = cav_record_new(40, c->set->nmarker, 100);
  cav_state *state = cav_state_new(m);
  double *q = malloc((size_t)m->nq * sizeof *q);
  int stand = cav_object_find(m, CAV_OBJECT_KEY, "stand"),
      bend = cav_object_find(m, CAV_OBJECT_JOINT, "shoulder2_right");
  for (int i = 0; i < c->set->nmarker; i++) r->name[i] = strdup(c->set->marker[i].name);
  for (int t = 0; t < 40; t++) {
    memcpy(q, m->key[stand].q, (size_t)m->nq * sizeof *q);
    q[m->joint[bend].q] += 0.01 * t;
    CHECK(!cav_position(m, state, q));
    for (int i = 0; i < c->set->nmarker; i++) {
      cav_pose pose;
      double *x = r->position + 3 * ((size_t)t * (size_t)c->set->nmarker + (size_t)i);
      cav_object_pose(m, state, CAV_OBJECT_XBODY, c->set->marker[i].body, &pose);
      transform(x, pose.pos, pose.rotation, c->set->marker[i].place);
      x[2] -= 0.015;
    }
  }
  for (int with = 0; with < 2; with++) {
    cav_trajectory *motion;
    options.floor = 1e4;
    c->set->floor = with;
    CHECK(!cav_ik(m, r, c->set, &options, &motion, NULL, &error));
    double worst = 0;
    for (int t = 0; motion && t < 40; t++) worst = fmax(worst, fabs(lowest(m, state, motion->q + t * m->nq)));
    printf("feet %s the floor: off by %.1e m\n", with ? "on" : "anywhere near", worst);
    CHECK(with ? worst < 3e-4 : fabs(worst - 0.0155) < 1e-3);
    cav_trajectory_free(motion);
  }
  c->set->floor = 0;
  free(q);
  cav_state_free(state);
  cav_record_free(r);
}

static void test_refusals(const truth *c) {
  cav_ik_options options = cav_ik_options_default();
  cav_trajectory *motion;
  cav_error error = {0};
  char *name = c->record->name[0];
  cav_record one = *c->record;
  one.nframe = 1;
  CHECK(cav_ik(c->model, &one, c->set, &options, &motion, NULL, &error) == CAV_BAD_INPUT &&
        strstr(error.text, "two frames"));
  one = *c->record;
  one.nmarker = 1, one.name = &name;
  name = "stranger";
  CHECK(cav_ik(c->model, &one, c->set, &options, &motion, NULL, &error) == CAV_BAD_INPUT &&
        strstr(error.text, "share no marker") && !motion);
  CHECK(!cav_marker_set_read(put_text("w.xml", "<markers>\n<marker name=\"a\" body=\"hed\"/>\n</markers>"), c->model,
                             &error));
  CHECK(strstr(error.text, ":2:") && strstr(error.text, "head"));
}

int main(void) {
  CHECK(mkdtemp(folder) != NULL);
  test_trc();
  test_csv();
  test_bvh();
  test_keys();
  test_c3d();
  test_names();
  test_errors();
  truth c = {0};
  make(&c);
  test_exact(&c);
  test_gaps(&c);
  test_hidden_limb(&c);
  test_places(&c);
  test_noise(&c);
  test_floor(&c);
  test_refusals(&c);
  cav_record_free(c.record);
  cav_marker_set_free(c.set);
  cav_model_free(c.model);
  free(c.q);
  static const char *const files[] = {"a.trc", "a.csv", "b.csv", "a.bvh", "a.xml", "b.xml", "a.c3d",   "cut.c3d",
                                      "a.txt", "w.trc", "w.csv", "w.bvh", "w.xml", "w.c3d", "set.xml", "found.xml"};
  for (size_t i = 0; i < sizeof files / sizeof *files; i++) unlink(path_of(files[i]));
  rmdir(folder);
  return check_result();
}
