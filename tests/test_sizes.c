/// Models of another size: written as MJCF and read again, by our reader and by MuJoCo; and sizes found from clips that
/// models of known sizes made: to rounding, and with markers hidden and noise within their own standard errors.
#include <math.h>
#include <string.h>
#include <unistd.h>

#include "cavort/cavort.h"
#include "check.h"
#include "edit.h"
#include "math3.h"
#ifdef CAVORT_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

enum { FRAMES = 80, LINKS = 32, JOINTS = 64 };

static char folder[] = "/tmp/cavort_sizes_XXXXXX";

static const char *path_of(const char *name) {
  static char path[4][200];
  static int next;
  next = (next + 1) % 4;
  snprintf(path[next], sizeof path[next], "%s/%s", folder, name);
  return path[next];
}

static const char *put_text(const char *name, const char *text) {
  const char *path = path_of(name);
  FILE *file = fopen(path, "wb");
  CHECK(file && fputs(text, file) >= 0);
  if (file) fclose(file);
  return path;
}

// a sequence that does not repeat: between -1 and 1
static double draw(unsigned *seed) {
  *seed = *seed * 1664525u + 1013904223u;
  return (double)(*seed >> 8) / 8388608.0 - 1;
}

static double gauss(unsigned *seed) {
  double sum = 0;
  for (int k = 0; k < 12; k++) sum += draw(seed) / 2;
  return sum;
}

// a root that slides and turns, anchors away from frames, a slide and a ball within the tree, bodies fixed at an angle
static const char *const odd =
    "<mujoco model=\"odd\"><compiler angle=\"degree\" autolimits=\"true\"/><option timestep=\"0.003\"/>\n"
    "<default><geom type=\"capsule\" size=\"0.05\" friction=\"0.7\"/><joint damping=\"0.3\" pos=\"0 0 0.1\"/>\n"
    "<default class=\"far\"><geom fromto=\"0 0 0 0.2 0.1 0\"/><joint armature=\"0.02\" range=\"-60 80\"/></default>\n"
    "<motor gear=\"20\"/></default>\n"
    "<worldbody><geom type=\"plane\" size=\"1 1 1\" pos=\"0 0 -1\"/>\n"
    "<body name=\"trunk\" pos=\"0.1 0 1\" euler=\"0 0 30\"><joint name=\"x\" type=\"slide\" axis=\"1 0 0\"/>\n"
    "<joint name=\"y\" type=\"slide\" axis=\"0 1 0\"/><joint name=\"turn\" axis=\"0 0 1\"/>"
    "<geom name=\"trunk\" fromto=\"0 0 0 0 0 0.5\"/><site name=\"s\" pos=\"0 0.1 0.2\" size=\"0.01\"/>\n"
    "<body name=\"fixed\" pos=\"0 0.2 0.5\" euler=\"40 10 0\"><geom type=\"box\" size=\"0.1 0.05 0.08\"/>\n"
    "<frame pos=\"0.1 0 0\" euler=\"0 90 0\"><body name=\"arm_left\" pos=\"0 0 0.1\" childclass=\"far\">\n"
    "<joint name=\"out_left\" type=\"slide\" axis=\"0 1 1\" range=\"-0.2 0.3\"/>"
    "<joint name=\"lift_left\" axis=\"0 1 0\" pos=\"0.03 0 0\"/>\n"
    "<joint name=\"roll_left\" axis=\"1 0 0\" pos=\"0 0.02 0\"/><geom name=\"arm_left\"/>\n"
    "<body name=\"hand_left\" pos=\"0.3 0.1 0\"><joint name=\"wrist_left\" type=\"ball\" range=\"0 80\"/><geom/>"
    "</body></body></frame></body>\n"
    "<body name=\"leg\" pos=\"0 -0.1 0\"><inertial pos=\"0 0 -0.2\" mass=\"3\" diaginertia=\"0.1 0.12 0.03\" "
    "quat=\"1 0.1 0 0.2\"/>\n"
    "<joint name=\"hip\" axis=\"0 1 0\" range=\"-50 50\" stiffness=\"3\" springref=\"10\"/><geom class=\"far\"/></body>"
    "</body></worldbody>\n"
    "<contact><exclude body1=\"trunk\" body2=\"leg\"/></contact>\n"
    "<actuator><motor name=\"hip\" joint=\"hip\" ctrlrange=\"-1 1\"/><motor joint=\"lift_left\"/></actuator>\n"
    "<sensor><framepos name=\"at\" objtype=\"site\" objname=\"s\"/></sensor>\n"
    "<keyframe><key name=\"bent\" qpos=\"0.1 0.2 0.3 0 0.1 0.2 1 0 0 0 0.3\"/></keyframe></mujoco>\n";

static void free_all(cav_model *m, char *text) {
  cav_model_free(m);
  free(text);
}

#define SAME(a, b, n) CHECK_NEAR_ALL(a, b, n, 1e-12 * (1 + fabs((a)[0])))

static void compare(const cav_model *a, const cav_model *b) {
  CHECK(a->nq == b->nq && a->nv == b->nv && a->nu == b->nu && a->nbody == b->nbody && a->nlink == b->nlink &&
        a->ngeom == b->ngeom && a->nsite == b->nsite && a->npair == b->npair && a->nkey == b->nkey &&
        a->nsensor == b->nsensor && a->ntendon == b->ntendon && a->nequality == b->nequality);
  if (check_failed) return;
  CHECK_NEAR(a->mass, b->mass, 1e-9);
  for (int i = 1; i < a->nlink; i++) {
    SAME(a->link[i].pos, b->link[i].pos, 3);
    SAME(a->link[i].quat, b->link[i].quat, 4);
    SAME(a->link[i].com, b->link[i].com, 3);
    SAME(&a->link[i].mass, &b->link[i].mass, 1);
    SAME(a->link[i].inertia, b->link[i].inertia, 6);
  }
  for (int i = 0; i < a->njoint; i++) {
    const cav_joint *x = &a->joint[i], *y = &b->joint[i];
    CHECK(x->type == y->type && x->limited == y->limited && !strcmp(x->name, y->name));
    SAME(x->pos, y->pos, 3);
    SAME(x->axis, y->axis, 3);
    if (x->limited) SAME(x->range, y->range, 2);
    CHECK(x->stiffness == y->stiffness && x->springref == y->springref);
  }
  for (int i = 0; i < a->nv; i++)
    CHECK(a->dof[i].damping == b->dof[i].damping && fabs(a->dof[i].armature - b->dof[i].armature) < 1e-15);
  for (int i = 0; i < a->ngeom; i++) {
    const cav_geom *x = &a->geom[i], *y = &b->geom[i];
    CHECK(x->type == y->type && x->condim == y->condim && !strcmp(x->name, y->name));
    SAME(x->pos, y->pos, 3);
    SAME(x->quat, y->quat, 4);
    SAME(x->friction, y->friction, 3);
    SAME(x->softness.solref, y->softness.solref, 2);
    SAME(x->softness.solimp, y->softness.solimp, 5);
    SAME(x->size, y->size, x->type == CAV_GEOM_CAPSULE ? 2 : x->type == CAV_GEOM_SPHERE ? 1 : 3);
  }
  for (int i = 0; i < a->npair; i++)
    CHECK(a->pair[i].geom1 == b->pair[i].geom1 && a->pair[i].geom2 == b->pair[i].geom2);
  for (int i = 0; i < a->nactuator; i++) {
    SAME(a->actuator[i].gear, b->actuator[i].gear, 6);
    CHECK(!strcmp(a->actuator[i].name, b->actuator[i].name) && a->actuator[i].unit == b->actuator[i].unit);
  }
  for (int i = 0; i < a->nkey; i++) SAME(a->key[i].q, b->key[i].q, a->nq);
}

// MuJoCo's bodies of the same file, where it reads what that was made of
static void compare_mujoco(const cav_model *m, const char *path, const char *source) {
#ifdef CAVORT_HAVE_MUJOCO
  char why[500] = "";
  mjModel *reads = mj_loadXML(source, NULL, why, sizeof why);
  if (!reads) return;
  mj_deleteModel(reads);
  mjModel *peer = mj_loadXML(path, NULL, why, sizeof why);
  if (!CHECK(peer && peer->nq == m->nq && peer->nv == m->nv && peer->nbody == m->nbody)) {
    printf("%s\n", why);
    mj_deleteModel(peer);
    return;
  }
  mjData *data = mj_makeData(peer);
  cav_state *state = cav_state_new(m);
  mj_kinematics(peer, data);
  CHECK(!cav_position(m, state, m->q0));
  for (int b = 1; b < m->nbody; b++) {
    cav_pose pose;
    cav_object_pose(m, state, CAV_OBJECT_XBODY, b, &pose);
    CHECK_NEAR_ALL(pose.pos, data->xpos + 3 * b, 3, 1e-9);
    if (m->body[b].link) CHECK_NEAR(m->body[b].mass, peer->body_mass[b], 1e-9);
    if (m->body[b].link && m->body[b].mass > 0) CHECK_NEAR_ALL(m->body[b].inertia, peer->body_inertia + 3 * b, 3, 1e-9);
  }
  for (int g = 0; g < m->ngeom; g++) CHECK_NEAR(m->geom[g].size[0], peer->geom_size[3 * g], 1e-12);
  cav_state_free(state);
  mj_deleteData(data);
  mj_deleteModel(peer);
#else
  (void)m, (void)path, (void)source;
#endif
}

static void random_factors(const cav_model *m, unsigned seed, int symmetric, double *factor) {
  factor[0] = 1;
  for (int i = 1; i < m->nlink; i++) factor[i] = 1.05 + 0.2 * draw(&seed);
  for (int i = 1; i < m->nlink && symmetric; i++) {
    const char *name = m->body[m->link[i].body].name, *side = strstr(name, "left");
    char other[100];
    if (!side) continue;
    snprintf(other, sizeof other, "%.*sright", (int)(side - name), name);
    int body = cav_object_find(m, CAV_OBJECT_BODY, other);
    if (body >= 0) factor[m->body[body].link] = factor[i];
  }
}

// a model is written as it is, then with other sizes
static void test_write(const char *path) {
  cav_error error = {0};
  double factor[LINKS];
  cav_model *m = cav_model_load(path, &error);
  if (!CHECK(m && m->nlink <= LINKS)) {
    printf("%s\n", error.text);
    return;
  }
  for (int sized = 0; sized < 2; sized++) {
    random_factors(m, 5, 0, factor);
    double before = m->mass;
    if (sized) CHECK(!cav_model_resize(m, factor));
    if (sized) cav_model_strengthen(m, 1.5);
    CHECK(sized == (fabs(m->mass - before) > 1e-3));
    char *text = cav_model_mjcf(m, path, &error);
    if (!CHECK(text != NULL)) printf("%s: %s\n", path, error.text);
    const char *written = text ? put_text("written.xml", text) : path;
    cav_model *again = cav_model_load(written, &error);
    if (CHECK(again != NULL))
      compare(m, again), compare_mujoco(again, written, path);
    else
      printf("%s\n", error.text);
    free_all(again, text);
  }
  cav_model_free(m);
}

typedef struct truth {
  cav_model *model; // of the file
  double factor[LINKS];
  double *q; // [FRAMES*nq]
  cav_marker_set *set;
  cav_record *record;
} truth;

// three markers on every body with joints or without
static void wear(truth *c, unsigned seed) {
  static char text[16000];
  cav_error error = {0};
  char *end = text + sprintf(text, "<markers scale=\"10\">\n");
  for (int b = 1; b < c->model->nbody; b++)
    for (int k = 0; k < 3; k++) {
      double x = 0.1 * draw(&seed), y = 0.1 * draw(&seed), z = 0.1 * draw(&seed);
      end += sprintf(end, "<marker name=\"%s%d\" body=\"%s\" pos=\"%g %g %g\"/>\n", c->model->body[b].name, k,
                     c->model->body[b].name, x, y, z);
    }
  sprintf(end, "</markers>\n");
  c->set = cav_marker_set_read(put_text("set.xml", text), c->model, &error);
  if (!CHECK(c->set != NULL)) printf("%s\n", error.text);
}

// the clip that the model of other sizes makes, its joints waving through their ranges
static void make(truth *c, const char *path, int symmetric, unsigned seed) {
  cav_error error = {0};
  c->model = cav_model_load(path, &error);
  cav_model *m = cav_model_load(path, &error);
  random_factors(m, seed, symmetric, c->factor);
  CHECK(m && m->nlink <= LINKS && m->nv <= JOINTS && !cav_model_resize(m, c->factor));
  wear(c, seed);
  c->set->symmetric = symmetric;
  c->record = cav_record_new(FRAMES, c->set->nmarker, 100);
  c->q = malloc(FRAMES * (size_t)m->nq * sizeof *c->q);
  cav_state *state = cav_state_new(m);
  for (int i = 0; i < c->set->nmarker; i++) c->record->name[i] = strdup(c->set->marker[i].name);
  for (int t = 0; t < FRAMES; t++) {
    double *q = c->q + (size_t)t * (size_t)m->nq, move[JOINTS] = {0};
    memcpy(q, m->q0, (size_t)m->nq * sizeof *q);
    for (int j = 0; j < m->njoint; j++) {
      const cav_joint *joint = &m->joint[j];
      double wave = sin(0.1 * t + 1.7 * j), middle = (joint->range[0] + joint->range[1]) / 2;
      if (joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE)
        q[joint->q] = joint->limited ? middle + 0.45 * (joint->range[1] - joint->range[0]) * wave : 0.4 * wave;
      if (joint->type == CAV_JOINT_BALL)
        for (int k = 0; k < 3; k++) move[joint->dof + k] = 0.4 * sin(0.1 * t + k);
      if (joint->type == CAV_JOINT_FREE) move[joint->dof] = 0.02 * t, move[joint->dof + 5] = 2 + 0.02 * t;
    }
    cav_integrate(m, q, move, 1, q);
    CHECK(!cav_position(m, state, q));
    for (int i = 0; i < c->set->nmarker; i++) {
      const cav_marker *marker = &c->set->marker[i];
      double place[3];
      cav_pose pose;
      cav_object_pose(m, state, CAV_OBJECT_XBODY, marker->body, &pose);
      scale3(place, c->factor[m->body[marker->body].link], marker->place);
      transform(c->record->position + 3 * ((size_t)t * (size_t)c->set->nmarker + (size_t)i), pose.pos, pose.rotation,
                place);
    }
  }
  cav_state_free(state);
  cav_model_free(m);
}

static void discard(truth *c) {
  cav_record_free(c->record);
  cav_marker_set_free(c->set);
  cav_model_free(c->model);
  free(c->q);
}

static cav_ik_options bare(void) {
  cav_ik_options options = cav_ik_options_default();
  options.posture = options.roughness = 1e-7;
  return options;
}

static void test_exact(const char *path, int symmetric) {
  truth c = {0};
  cav_error error = {0};
  cav_ik_options options = bare();
  double factor[LINKS], deviation[LINKS], worst = 0, off = 0;
  make(&c, path, symmetric, 21);
  double *given = malloc(3 * (size_t)c.set->nmarker * sizeof *given);
  for (int i = 0; i < c.set->nmarker; i++) copy3(given + 3 * i, c.set->marker[i].place);
  if (!CHECK(!cav_ik_sizes(c.model, c.record, c.set, &options, factor, deviation, &error))) printf("%s\n", error.text);
  for (int i = 1; i < c.model->nlink; i++) worst = fmax(worst, fabs(factor[i] - c.factor[i]));
  // places are told on the scaled model
  for (int i = 0; i < c.set->nmarker; i++)
    for (int k = 0; k < 3; k++)
      off = fmax(off, fabs(c.set->marker[i].place[k] -
                           c.factor[c.model->body[c.set->marker[i].body].link] * given[3 * i + k]));
  printf("sizes of %s: off by %.1e, places by %.1e m\n", c.model->name, worst, off);
  CHECK(worst < 1e-6 && off < 1e-6);
  // and the scaled model fits as the true one does
  cav_trajectory *motion;
  cav_ik_report *report;
  CHECK(!cav_ik(c.model, c.record, c.set, &options, &motion, &report, &error));
  CHECK(report && report->total_rms < 1e-6);
  cav_ik_report_free(report);
  cav_trajectory_free(motion);
  free(given);
  discard(&c);
}

// 30 % of markers hidden, 5 mm of noise: within four standard errors, which are as large as errors are
static void test_noise(const char *path) {
  truth c = {0};
  cav_error error = {0};
  cav_ik_options options = bare();
  unsigned seed = 9;
  double factor[LINKS], deviation[LINKS], sum = 0, worst = 0;
  make(&c, path, 1, 33);
  size_t n = (size_t)c.set->nmarker * FRAMES;
  int hidden = 0, count = 0;
  for (size_t i = 0; i < n; i++) {
    for (int k = 0; k < 3; k++) c.record->position[3 * i + (size_t)k] += 5e-3 * gauss(&seed);
    if (draw(&seed) < -0.4) c.record->position[3 * i] = NAN, hidden++;
  }
  CHECK(!cav_ik_sizes(c.model, c.record, c.set, &options, factor, deviation, &error));
  for (int i = 1; i < c.model->nlink; i++) {
    double ratio = (factor[i] - c.factor[i]) / deviation[i];
    CHECK(deviation[i] > 0 && fabs(ratio) < 4);
    sum += ratio * ratio, count++, worst = fmax(worst, fabs(factor[i] - c.factor[i]));
  }
  printf("%.0f %% hidden, 5 mm: sizes off by %.1e at most, %.2f standard errors rms\n", 100.0 * hidden / (double)n,
         worst, sqrt(sum / count));
  CHECK(hidden > 0.28 * (double)n && worst < 0.03 && sqrt(sum / count) > 0.4 && sqrt(sum / count) < 1.7);
  discard(&c);
}

// what stands goes on standing: the lowest shape of each keyframe is as high as before
static void test_stand(const char *path) {
  truth c = {0};
  cav_error error = {0};
  cav_ik_options options = cav_ik_options_default();
  double factor[LINKS], height[2];
  make(&c, path, 1, 44);
  int stand = cav_object_find(c.model, CAV_OBJECT_KEY, "stand");
  for (int after = 0; after < 2; after++) {
    if (after) CHECK(!cav_ik_sizes(c.model, c.record, c.set, &options, factor, NULL, &error));
    cav_state *state = cav_state_new(c.model);
    CHECK(!cav_position(c.model, state, c.model->key[stand].q));
    height[after] = INFINITY;
    for (int g = 0; g < c.model->ngeom; g++) {
      cav_pose pose;
      const cav_geom *geom = &c.model->geom[g];
      cav_object_pose(c.model, state, CAV_OBJECT_GEOM, g, &pose);
      double along = geom->type == CAV_GEOM_CAPSULE ? fabs(pose.rotation[8]) * geom->size[1] : 0;
      if (geom->link) height[after] = fmin(height[after], pose.pos[2] - along - geom->size[0]);
    }
    cav_state_free(state);
  }
  CHECK_NEAR(height[0], height[1], 1e-9);
  discard(&c);
}

static void test_refusals(const char *path) {
  truth c = {0};
  cav_error error = {0};
  cav_ik_options options = cav_ik_options_default();
  double factor[LINKS];
  make(&c, path, 1, 3);
  c.set->scale = 0;
  CHECK(cav_ik_sizes(c.model, c.record, c.set, &options, factor, NULL, &error) == CAV_BAD_INPUT &&
        strstr(error.text, "scale > 0"));
  factor[0] = 2;
  CHECK(cav_model_resize(c.model, factor) == CAV_BAD_INPUT);
  discard(&c);
  static const char *const welded =
      "<mujoco><worldbody><body name=\"a\"><freejoint/><geom size=\"0.1\"/></body><body name=\"b\" pos=\"1 0 0\">"
      "<freejoint/><geom size=\"0.1\"/></body></worldbody>\n<equality><weld body1=\"a\" "
      "body2=\"b\"/></equality></mujoco>";
  cav_model *m = cav_model_load(put_text("welded.xml", welded), &error);
  CHECK(m && cav_model_resizable(m, &error) == CAV_NOT_SUPPORTED && strstr(error.text, "equality"));
  cav_model_free(m);
  static const char *const copied =
      "<mujoco>\n<worldbody>\n<replicate count=\"2\" offset=\"1 0 0\"><body><freejoint/><geom size=\"0.1\"/></body>"
      "</replicate></worldbody></mujoco>";
  m = cav_model_load(put_text("copied.xml", copied), &error);
  CHECK(m && !cav_model_mjcf(m, path_of("copied.xml"), &error) && error.status == CAV_NOT_SUPPORTED &&
        strstr(error.text, ":3:"));
  cav_model_free(m);
}

int main(void) {
  static const char *const models[] = {"humanoid", "gait", "arm", "cheetah", "hopper", "quadruped", "robot", "walker"};
  char path[300];
  CHECK(mkdtemp(folder) != NULL);
  for (size_t i = 0; i < sizeof models / sizeof *models; i++) {
    snprintf(path, sizeof path, CAVORT_SOURCE_ROOT "/problems/models/%s.xml", models[i]);
    test_write(path);
  }
  test_write(put_text("odd.xml", odd));
  snprintf(path, sizeof path, CAVORT_SOURCE_ROOT "/problems/models/humanoid.xml");
  test_exact(path, 1);
  test_exact(path, 0);
  test_exact(path_of("odd.xml"), 0);
  test_noise(path);
  test_stand(path);
  test_refusals(path);
  static const char *const files[] = {"written.xml", "odd.xml", "set.xml", "welded.xml", "copied.xml"};
  for (size_t i = 0; i < sizeof files / sizeof *files; i++) unlink(path_of(files[i]));
  rmdir(folder);
  return check_result();
}
