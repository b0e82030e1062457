/// The inverse against MuJoCo's mj_inverse on models no one here wrote, through its library: 1,000 random states each,
/// joints past their limits, bodies in the floor and in each other. MuJoCo's inverse leaves implicit damping out, so
/// B h a is added to it. A state may differ only if the contact geometry does; each that does is explained by the
/// contacts that differ. Where the axes of two capsules cross, as planar models let them all the time, nothing leads from
/// one nearest point to the other: both libraries take the direction square to both axes there, but MuJoCo only where
/// the difference of the points is zero to rounding of its own; now and then it normalises that rounding instead. Such
/// states are counted apart ("crossed"), and each has to differ in nothing but the normal of such contacts. Skipped
/// without MuJoCo or without the models.
#include "scene.h"

#ifndef CAVORT_HAVE_MUJOCO
int main(void) {
  printf("skipped: built without MuJoCo\n");
  return CHECK_SKIPPED;
}
#else
#include <mujoco/mujoco.h>

enum { STATES = 1000, SHOWN = 3 };
static const double SAME = 1e-9;      ///< relative error of u that counts as equal
static const double GEOMETRY = 1e-10; ///< m or 1: difference of a contact that explains one of u
static const double CROSSING = 1e-9;  ///< m: axes of capsules closer than this cross
/// A model and the share of states that must agree; less than 0.99 where MuJoCo's contacts are made by iteration or by
/// routines that differ in kind: box against box (double_pendulum), capsule on cylinder (slider_crank), ellipsoid and
/// height field (quadruped). Every state that differs is explained by its contacts all the same.
typedef struct subject {
  const char *name;
  double share;
} subject;
static const char *const kinds[] = {"plane",    "sphere", "capsule", "ellipsoid",
                                    "cylinder", "box",    "mesh",    "height field"};

/// One model in both libraries.
typedef struct pair_of_models {
  mjModel *theirs;
  mjData *data;
  cav_model *ours;
  cav_state *state;
} pair_of_models;

// coordinate that lifts the root: of a free joint, or a slide along z of a top body; -1 if there is none
static int height_of(const mjModel *m) {
  for (int i = 0; i < m->njnt; i++) {
    if (m->body_parentid[m->jnt_bodyid[i]] != 0) continue;
    if (m->jnt_type[i] == mjJNT_FREE) return m->jnt_qposadr[i] + 2;
    if (m->jnt_type[i] == mjJNT_SLIDE && fabs(m->jnt_axis[3 * i + 2]) > 0.99) return m->jnt_qposadr[i];
  }
  return -1;
}

// joints over their ranges and a tenth beyond either end, free roots any way up, lowest geom about the floor
static void draw_state(const mjModel *m, mjData *d) {
  mj_resetData(m, d);
  for (int i = 0; i < m->njnt; i++) {
    double *q = d->qpos + m->jnt_qposadr[i];
    const double *range = m->jnt_range + 2 * i;
    if (m->jnt_type[i] == mjJNT_FREE || m->jnt_type[i] == mjJNT_BALL) {
      double *quat = m->jnt_type[i] == mjJNT_FREE ? q + 3 : q;
      for (int k = 0; k < 4; k++) quat[k] = scene_normal();
      mju_normalize4(quat);
    } else if (m->jnt_limited[i]) {
      *q = 0.5 * (range[0] + range[1]) + 0.6 * (range[1] - range[0]) * scene_uniform();
    } else {
      *q = (m->jnt_type[i] == mjJNT_HINGE ? 3 : 0.3) * scene_uniform();
    }
  }
  int height = height_of(m);
  if (height >= 0) {
    mj_kinematics(m, d);
    double lowest = INFINITY;
    for (int i = 0; i < m->ngeom; i++) {
      if (m->geom_bodyid[i] > 0) lowest = fmin(lowest, d->geom_xpos[3 * i + 2] - m->geom_size[3 * i]);
    }
    d->qpos[height] -= lowest + 0.1 * scene_uniform();
  }
  for (int i = 0; i < m->nv; i++) {
    d->qvel[i] = 2 * scene_normal();
    d->qacc[i] = 20 * scene_normal();
  }
}

// whether the axes of two capsules cross at this contact of MuJoCo's: as deep as both radii, and so without a normal
static int is_crossing(const mjModel *m, const mjContact *c) {
  if (m->geom_type[c->geom1] != mjGEOM_CAPSULE || m->geom_type[c->geom2] != mjGEOM_CAPSULE) return 0;
  return c->dist < CROSSING - m->geom_size[3 * c->geom1] - m->geom_size[3 * c->geom2];
}

// largest difference of n numbers
static double apart(const double *a, const double *b, int n) {
  double worst = 0;
  for (int i = 0; i < n; i++) worst = fmax(worst, fabs(a[i] - b[i]));
  return worst;
}

/// How a contact of ours differs from the nearest of MuJoCo's for the same geoms.
typedef struct contrast {
  double place, normal; ///< distance and position (m); normal
  int crossing;         ///< axes of capsules cross there: place is that of the point on the first axis
} contrast;

// point of the first geom's axis that a contact of capsules stands for
static void axis_point(const mjModel *m, const mjContact *t, const double pos[3], const double normal[3],
                       double point[3]) {
  double back = m->geom_size[3 * t->geom1] + t->dist / 2;
  for (int k = 0; k < 3; k++) point[k] = pos[k] - back * normal[k];
}

static contrast nearest(const pair_of_models *p, const cav_contact *c) {
  const cav_pair *pair = &p->ours->pair[c->pair];
  contrast best = {INFINITY, INFINITY, 0};
  for (int i = 0; i < p->data->ncon; i++) {
    const mjContact *t = &p->data->contact[i];
    int straight = t->geom1 == pair->geom1 && t->geom2 == pair->geom2;
    if (!straight && !(t->geom1 == pair->geom2 && t->geom2 == pair->geom1)) continue;
    contrast is = {0, 0, is_crossing(p->theirs, t)};
    double normal[3], theirs[3], ours[3];
    for (int k = 0; k < 3; k++) {
      normal[k] = (straight ? 1 : -1) * c->frame[k];
      theirs[k] = t->pos[k];
      ours[k] = c->pos[k];
    }
    if (is.crossing) {
      axis_point(p->theirs, t, t->pos, t->frame, theirs);
      axis_point(p->theirs, t, c->pos, normal, ours);
    }
    is.place = fmax(fabs(t->dist - c->dist), apart(theirs, ours, 3));
    is.normal = apart(t->frame, normal, 3);
    if (fmax(is.place, is.normal) < fmax(best.place, best.normal)) best = is;
  }
  return best;
}

typedef enum reason { UNEXPLAINED, GEOMETRY_DIFFERS, AXES_CROSS } reason;

// what explains a different u: contacts of which some lie elsewhere, or normals of crossing axes and nothing else
static reason explain(const pair_of_models *p, double error, int show) {
  int active = 0, crossing = 0;
  for (int i = 0; i < p->data->ncon; i++) active += p->data->contact[i].exclude == 0;
  int elsewhere = active != p->state->ncontact;
  if (show && elsewhere) printf("    error %.1e: %d contacts, MuJoCo %d\n", error, p->state->ncontact, active);
  for (int i = 0; i < p->state->ncontact; i++) {
    const cav_contact *c = &p->state->contact[i];
    const cav_pair *pair = &p->ours->pair[c->pair];
    contrast is = nearest(p, c);
    if (is.place < GEOMETRY && (is.normal < GEOMETRY || is.crossing)) {
      crossing += is.normal >= GEOMETRY;
      continue;
    }
    elsewhere = 1;
    if (show) {
      printf("    error %.1e: %s-%s contact at %.2g m differs by %.1e\n", error, kinds[p->ours->geom[pair->geom1].type],
             kinds[p->ours->geom[pair->geom2].type], c->dist, fmax(is.place, is.normal));
    }
  }
  return elsewhere ? GEOMETRY_DIFFERS : crossing ? AXES_CROSS : UNEXPLAINED;
}

// u of one state by both; relative error
static double compare(const pair_of_models *p, double *v_next, double *u, double *expected) {
  const mjModel *m = p->theirs;
  mjData *d = p->data;
  mj_inverse(m, d);
  for (int i = 0; i < m->nv; i++) {
    v_next[i] = d->qvel[i] + m->opt.timestep * d->qacc[i];
    // what v_next has left of the acceleration
    double a = (v_next[i] - d->qvel[i]) / m->opt.timestep;
    expected[i] = d->qfrc_inverse[i] + m->dof_damping[i] * m->opt.timestep * a;
  }
  CHECK(cav_inverse(p->ours, p->state, d->qpos, d->qvel, v_next, u) == CAV_OK);
  return scene_error(u, expected, m->nv);
}

static void read_sensor(const pair_of_models *p, cav_sensor_type type, cav_object_type kind, int object, double *out) {
  cav_sensor sensor = {.name = "", .type = type, .object_type = kind, .object = object};
  cav_sense(p->ours, p->state, &sensor, out);
}

// frames, their velocities and subtrees of every body at the state of the last comparison, v_next = v
static double compare_readings(const pair_of_models *p) {
  const mjModel *m = p->theirs;
  mjData *d = p->data;
  double worst = 0, out[4], motion[6], *u = scene_vector(m->nv);
  CHECK(cav_inverse(p->ours, p->state, d->qpos, d->qvel, d->qvel, u) == CAV_OK);
  mj_subtreeVel(m, d);
  for (int i = 0; i < m->nbody; i++) {
    // MuJoCo's bodies of a URDF are the links that move: centres of mass are those of what it merged
    int b = i && p->ours->fused ? cav_find(p->ours, CAV_OBJECT_XBODY, m->names + m->name_bodyadr[i]) : i;
    if (!p->ours->fused) {
      read_sensor(p, CAV_SENSOR_FRAMEPOS, CAV_OBJECT_BODY, b, out);
      worst = fmax(worst, apart(out, d->xipos + 3 * i, 3));
    }
    read_sensor(p, CAV_SENSOR_FRAMEPOS, CAV_OBJECT_XBODY, b, out);
    worst = fmax(worst, apart(out, d->xpos + 3 * i, 3));
    for (int k = 0; k < 3; k++) {
      double axis[3] = {d->xmat[9 * i + k], d->xmat[9 * i + 3 + k], d->xmat[9 * i + 6 + k]};
      read_sensor(p, (cav_sensor_type)(CAV_SENSOR_FRAMEXAXIS + k), CAV_OBJECT_XBODY, b, out);
      worst = fmax(worst, apart(out, axis, 3));
    }
    mj_objectVelocity(m, d, mjOBJ_XBODY, i, motion, 0);
    read_sensor(p, CAV_SENSOR_FRAMEANGVEL, CAV_OBJECT_XBODY, b, out);
    worst = fmax(worst, apart(out, motion, 3));
    read_sensor(p, CAV_SENSOR_FRAMELINVEL, CAV_OBJECT_XBODY, b, out);
    worst = fmax(worst, apart(out, motion + 3, 3));
    // what stands still has a mass in MuJoCo's subtree of the world and none in ours
    if (m->body_weldid[i] == 0) continue;
    read_sensor(p, CAV_SENSOR_SUBTREECOM, CAV_OBJECT_BODY, b, out);
    worst = fmax(worst, apart(out, d->subtree_com + 3 * i, 3));
    read_sensor(p, CAV_SENSOR_SUBTREELINVEL, CAV_OBJECT_BODY, b, out);
    worst = fmax(worst, apart(out, d->subtree_linvel + 3 * i, 3));
    read_sensor(p, CAV_SENSOR_SUBTREEANGMOM, CAV_OBJECT_BODY, b, out);
    worst = fmax(worst, apart(out, d->subtree_angmom + 3 * i, 3));
  }
  for (int i = 0; i < m->ngeom && !p->ours->fused; i++) {
    read_sensor(p, CAV_SENSOR_FRAMEPOS, CAV_OBJECT_GEOM, i, out);
    worst = fmax(worst, apart(out, d->geom_xpos + 3 * i, 3));
    cav_pose pose;
    cav_object_pose(p->ours, p->state, CAV_OBJECT_GEOM, i, &pose);
    worst = fmax(worst, apart(pose.rotation, d->geom_xmat + 9 * i, 9));
  }
  free(u);
  return worst;
}

static int ascending(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static void compare_states(const char *name, double share, const pair_of_models *p) {
  static double error[STATES];
  double *v_next = scene_vector(p->ours->nv), *u = scene_vector(p->ours->nv), *expected = scene_vector(p->ours->nv);
  int same = 0, crossed = 0, unexplained = 0, shown = 0, contacts = 0, rows = 0, touching = 0, limited = 0;
  double readings = 0;
  for (int k = 0; k < STATES; k++) {
    draw_state(p->theirs, p->data);
    error[k] = compare(p, v_next, u, expected);
    contacts = p->state->ncontact > contacts ? p->state->ncontact : contacts;
    rows = p->data->nefc > rows ? p->data->nefc : rows;
    touching += p->state->ncontact > 0;
    limited += p->state->nrow > 0;
    if (error[k] <= SAME) {
      same++;
      if (k % 10 == 0) readings = fmax(readings, compare_readings(p));
      continue;
    }
    reason why = explain(p, error[k], shown < SHOWN);
    shown += why == GEOMETRY_DIFFERS;
    crossed += why == AXES_CROSS;
    unexplained += why == UNEXPLAINED;
    if (why == UNEXPLAINED) printf("    unexplained: error %.2e, state %d\n", error[k], k);
  }
  CHECK(p->data->warning[mjWARN_CONTACTFULL].number == 0 && p->data->warning[mjWARN_CNSTRFULL].number == 0);
  qsort(error, STATES, sizeof *error, ascending);
  printf("%-22s %3d %9d %5d %9d %8d   %.1e  %.1e  %.1e  %.1e %7.1f%% %8d %9.1e\n", name, p->ours->nv, contacts, rows,
         touching, limited, error[STATES / 2], error[STATES * 9 / 10], error[STATES * 99 / 100], error[STATES - 1],
         100.0 * same / STATES, crossed, readings);
  CHECK(same >= STATES * share);
  CHECK(unexplained == 0);
  // bound: rounding of velocities about 20 m/s and angular momenta about 100; seen 4e-14
  CHECK(readings <= 1e-11);
  free(v_next), free(u), free(expected);
}

// copies a URDF without the collision elements whose meshes are not there: MuJoCo does not read the file with them
static int without_meshes(const char *path, char *copy) {
  static char text[200000];
  FILE *file = fopen(path, "r");
  if (!file) return 0;
  size_t length = fread(text, 1, sizeof text - 1, file);
  fclose(file);
  text[length] = 0;
  for (char *from = text, *end; (from = strstr(from, "<collision")); from++) {
    end = strstr(from, "</collision>");
    char *mesh = strstr(from, "<mesh");
    if (from[10] == '_' || !end || !mesh || mesh > end) continue;
    memmove(from, end + 12, strlen(end + 12) + 1);
    from--;
  }
  int out = mkstemps(copy, 5);
  if (out < 0) return 0;
  int whole = write(out, text, strlen(text)) == (ssize_t)strlen(text);
  close(out);
  return whole;
}

static void compare_model(const char *folder, const subject *model) {
  const char *name = model->name;
  char path[4200], text[1000], copy[] = "/tmp/cavort-peer-XXXXXX.urdf";
  snprintf(path, sizeof path, "%s/%s", folder, name);
  cav_error error = {0};
  pair_of_models p = {.ours = cav_model_load(path, &error)};
  int urdf = strstr(name, ".urdf") != NULL;
  if (urdf) CHECK(without_meshes(path, copy));
  p.theirs = mj_loadXML(urdf ? copy : path, NULL, text, sizeof text);
  if (urdf) unlink(copy);
  CHECK(p.ours != NULL);
  CHECK(p.theirs != NULL);
  if (!p.ours) fprintf(stderr, "    %s\n", error.text);
  if (p.ours && p.theirs) {
    p.theirs->opt.cone = mjCONE_ELLIPTIC;
    p.data = mj_makeData(p.theirs);
    p.state = cav_state_new(p.ours);
    CHECK(p.ours->nq == p.theirs->nq && p.ours->nv == p.theirs->nv);
    compare_states(name, model->share, &p);
    mj_deleteData(p.data);
    cav_state_free(p.state);
  }
  if (p.theirs) mj_deleteModel(p.theirs);
  cav_model_free(p.ours);
}

int main(void) {
  static const subject models[] = {
      {"mujoco/humanoid.xml", 0.99},        {"dm_control/acrobot.xml", 0.99},    {"dm_control/cartpole.xml", 0.99},
      {"dm_control/pendulum.xml", 0.99},    {"dm_control/hopper.xml", 0.99},     {"dm_control/walker.xml", 0.99},
      {"dm_control/cheetah.xml", 0.99},     {"dm_control/humanoid.xml", 0.99},   {"dm_control/reacher.xml", 0.99},
      {"urdf/double_pendulum.urdf", 0.7},   {"urdf/simple_humanoid.urdf", 0.99}, {"urdf/solo12.urdf", 0.99},
      {"dm_control/ball_in_cup.xml", 0.99}, {"dm_control/point_mass.xml", 0.99}, {"dm_control/finger.xml", 0.99},
      {"dm_control/manipulator.xml", 0.99}, {"mujoco/arm26.xml", 0.99},          {"mujoco/slider_crank.xml", 0.93},
      {"dm_control/fish.xml", 0.99},        {"dm_control/swimmer.xml", 0.99},    {"dm_control/quadruped.xml", 0.3}};
  const char *folder = check_shared_models();
  if (!folder) {
    printf("skipped: set CAVORT_SHARED_MODELS to the folder of the models\n");
    return CHECK_SKIPPED;
  }
  char kept[4096];
  snprintf(kept, sizeof kept, "%s", folder);
  printf("relative error of u in %d random states\n", STATES);
  printf("%-22s %3s %9s %5s %9s %8s   %-8s %-8s %-8s %-8s %s %s %s\n", "model", "nv", "contacts", "rows", "touching",
         "limited", "median", "90%", "99%", "most", "within 1e-9", "crossed", "readings");
  for (unsigned i = 0; i < sizeof models / sizeof *models; i++) compare_model(kept, &models[i]);
  return check_result();
}
#endif
