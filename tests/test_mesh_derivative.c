/// Derivatives of contacts of meshes in closed form: nearest corners, edges and faces of two meshes, of a mesh and a
/// ball, a capsule, a box, a cylinder or an ellipsoid, and corners on a plane, within one tree and between two, against
/// centred differences of the whole inverse. And that contacts do not depend on what was evaluated before.
#include "scene.h"

// a chain that folds onto itself, and a free body beside it
static const char text[] =
    "<mujoco><option timestep='0.01'/><asset>"
    "<mesh name='rock' vertex='%s'/>"
    "<mesh name='wedge' vertex='-.1 -.08 -.05 .1 -.08 -.05 .1 .08 -.05 -.1 .08 -.05 -.1 -.08 .06 .1 -.08 .06'/></asset>"
    "<worldbody><geom type='plane' size='2 2 1'/>"
    "<body pos='0 0 .3'><freejoint/><geom type='mesh' mesh='rock'/>"
    "<body pos='.25 0 0'><joint type='ball'/><geom type='%s' %s/>"
    "<body pos='.25 0 .05'><joint axis='0 1 1'/><joint axis='1 0 0'/><geom type='mesh' "
    "mesh='wedge'/></body></body></body>"
    "<body pos='.2 .2 .35'><freejoint/><geom type='mesh' mesh='wedge'/></body></worldbody></mujoco>";

enum { POSES = 150, POINTS = 60, TEXT = 6000 };

static const char rock[] =
    ".1 0 0 -.1 .02 .01 0 .12 -.01 .01 -.11 0 0 .01 .09 .02 0 -.1 .07 .06 .05 -.06 -.05 .06 "
    ".05 -.06 -.05";

// a rock worn round: more corners about a direction than are tried one by one
static const char *round_rock(void) {
  static char points[60 * POINTS];
  size_t length = 0;
  for (int k = 0; k < POINTS; k++) {
    double z = 1 - (2 * k + 1.0) / POINTS, r = sqrt(1 - z * z), turn = 2.399963229728653 * k;
    length += (size_t)snprintf(points + length, sizeof points - length, "%.6f %.6f %.6f ", 0.1 * r * cos(turn),
                               0.12 * r * sin(turn), 0.09 * z);
  }
  return points;
}

static void test_model(cav_next_gap next_gap, const char *model_text, const char *type, double height) {
  cav_model *m = scene_load(model_text);
  cav_state *state = m ? cav_state_new(m) : NULL;
  if (!CHECK(state != NULL)) return;
  state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  state->options.smoothing = 0.02;
  state->options.smoothing_self = 0.01;
  state->options.next_gap = next_gap;
  int nv = m->nv, contacts = 0, kinks = 0, columns = 0;
  size_t block = (size_t)nv * (size_t)nv;
  double *q = scene_vector(m->nq), *v = scene_vector(nv), *next = scene_vector(nv), *J = scene_vector(6 * (int)block);
  double worst = 0;
  for (int k = 0; k < POSES; k++) {
    scene_posture(m, q, v, 0.4);
    if (height > 0) q[0] = 0.2 * scene_uniform(), q[1] = 0.2 * scene_uniform(), q[2] = height + 0.03 * scene_uniform();
    scene_normals(v, nv, 0.5);
    scene_normals(next, nv, 0.5);
    for (int i = 0; i < 2; i++) {
      cav_derivative method = i ? CAV_DERIVATIVE_CENTRED : CAV_DERIVATIVE_ANALYTIC;
      double *to = J + 3 * block * (size_t)i;
      CHECK(cav_inverse_jacobian_by(m, state, method, q, v, next, to, to + block, to + 2 * block) == CAV_OK);
    }
    contacts += state->ncontact;
    for (int part = 0; part < 3; part++) {
      const double *ours = J + (size_t)part * block, *theirs = ours + 3 * block;
      double scale = scene_norm(theirs, (int)block) / sqrt(nv);
      for (int j = 0; j < nv; j++, columns++) {
        double off = 0;
        for (int i = 0; i < nv; i++) off = fmax(off, fabs(ours[i * nv + j] - theirs[i * nv + j]));
        if (off > 1e-5 * scale)
          kinks++;
        else
          worst = fmax(worst, off / scale);
      }
    }
  }
  printf("%-8s %5d contacts, %5d columns, %3d at kinks, the rest within %.1e\n", type, contacts, columns, kinks, worst);
  CHECK(contacts > (height > 0 ? 1 : 3) * POSES);
  // columns where a nearest part changes within the step of a difference: seen none, and over hills 57 and 21 of a box and an
  // ellipsoid that are deep in one, where points come and go
  CHECK(kinks < columns / (height > 0 ? 40 : 1000));
  free(q), free(v), free(next), free(J);
  cav_state_free(state);
  cav_model_free(m);
}

static void test_shape(cav_next_gap next_gap, const char *points, const char *type, const char *attributes) {
  char model_text[TEXT];
  snprintf(model_text, sizeof model_text, text, points, type, attributes);
  test_model(next_gap, model_text, type, 0);
}

// over hills of a height field
static void test_relief(const char *type, const char *attributes) {
  enum { SIDE = 12 };
  char heights[TEXT] = "", model_text[3 * TEXT];
  for (int i = 0; i < SIDE * SIDE; i++)
    snprintf(heights + strlen(heights), sizeof heights - strlen(heights), "%.3f ", 0.5 + 0.5 * scene_uniform());
  snprintf(model_text, sizeof model_text,
           "<mujoco><option timestep='0.025'/><asset><hfield name='hills' nrow='12' ncol='12' size='.6 .6 .03 .1' "
           "elevation='%s'/><mesh name='rock' vertex='%s'/></asset><worldbody><geom type='hfield' hfield='hills'/>"
           "<body pos='0 0 .1'><freejoint/><geom type='%s' %s/></body></worldbody></mujoco>",
           heights, rock, type, attributes);
  printf("hills:   ");
  test_model(CAV_NEXT_GAP_LINEAR, model_text, type, 0.1);
}

// contacts do not depend, to the bit, on what was evaluated before: along a walk whose searches begin where the last ones
// ended, and by a new state at each pose
static void test_history(const char *points, const char *type, const char *attributes) {
  char model_text[TEXT];
  snprintf(model_text, sizeof model_text, text, points, type, attributes);
  cav_model *m = scene_load(model_text);
  cav_state *state = m ? cav_state_new(m) : NULL;
  if (!CHECK(state != NULL)) return;
  double *q = scene_vector(m->nq), *v = scene_vector(m->nv);
  int unlike = 0, contacts = 0;
  for (int k = 0; k < 4 * POSES; k++) {
    // steps from none to what moves the nearest parts on, and now and then elsewhere
    if (k % 50 == 0) scene_posture(m, q, v, 0.4);
    scene_normals(v, m->nv, k % 5 == 0 ? 0 : k % 5 == 1 ? 1e-6 : 0.03);
    cav_integrate(m, q, v, 1, q);
    cav_state *fresh = cav_state_new(m);
    if (!CHECK(fresh != NULL)) break;
    state->options.smoothing = fresh->options.smoothing = 0.02;
    state->options.smoothing_self = fresh->options.smoothing_self = 0.01;
    CHECK(cav_position(m, state, q) == CAV_OK && cav_position(m, fresh, q) == CAV_OK);
    contacts += state->ncontact;
    unlike += state->ncontact != fresh->ncontact;
    for (int i = 0; i < state->ncontact && i < fresh->ncontact; i++) {
      const cav_contact *a = &state->contact[i], *b = &fresh->contact[i];
      unlike += memcmp(a->pos, b->pos, sizeof a->pos) || memcmp(a->frame, b->frame, sizeof a->frame) ||
                a->dist != b->dist || a->feature != b->feature;
    }
    cav_state_free(fresh);
  }
  printf("%-8s %5d contacts along a walk, %d unlike those of a new state\n", type, contacts, unlike);
  CHECK(contacts > 1000);
  CHECK(unlike == 0);
  free(q), free(v);
  cav_state_free(state);
  cav_model_free(m);
}

// the inverse at (q, v, v_next) with the contacts that bear something there, and with all of them
static void compare_sought(const cav_model *m, cav_state *state, const double *q, const double *v, const double *next,
                           double *J, int contacts[2], double *worst) {
  int nv = m->nv;
  size_t block = (size_t)nv * (size_t)nv;
  double *u = J + 6 * block;
  for (int all = 0; all < 2; all++) {
    double *to = J + 3 * block * (size_t)all;
    cav_status status = all ? cav_position(m, state, q) : CAV_OK;
    CHECK(!status &&
          cav_inverse_from(m, state, all ? CAV_STAGE_POSITION : CAV_STAGE_NONE, q, v, next, u + all * nv) == CAV_OK);
    contacts[all] += state->ncontact;
    CHECK(cav_derivatives(m, state, to, to + block, to + 2 * block) == CAV_OK);
  }
  *worst = fmax(*worst, scene_error(u, u + nv, nv));
  for (int part = 0; part < 3; part++)
    *worst = fmax(*worst, scene_error(J + part * block, J + (3 + part) * block, (int)block));
  // far velocities from the same q: nothing is missed
  for (int i = 0; i < nv; i++) J[i] = next[i] - 3;
  CHECK(cav_inverse(m, state, q, v, next, u) == CAV_OK);
  CHECK(cav_inverse_from(m, state, CAV_STAGE_POSITION, q, v, J, u) == CAV_OK);
  CHECK(cav_position(m, state, q) == CAV_OK &&
        cav_inverse_from(m, state, CAV_STAGE_POSITION, q, v, J, u + nv) == CAV_OK);
  *worst = fmax(*worst, scene_error(u, u + nv, nv));
}

// links of a robot, each with solids without a mesh, that fold onto each other
static const char housings[] =
    "<mujoco><option timestep='0.01'/><worldbody><geom type='plane' size='2 2 1'/>"
    "<body pos='0 0 .3'><freejoint/><geom type='cylinder' size='.09 .05' condim='6'/><geom type='box' size='.02 .12 "
    ".05'/>"
    "<body pos='.2 0 0'><joint type='ball'/><geom type='capsule' size='.03 .08'/><geom type='ellipsoid' size='.1 .05 "
    ".04'/>"
    "<body pos='.2 0 .05'><joint axis='0 1 1'/><joint axis='1 0 0'/><geom type='box' size='.08 .05 .03'/>"
    "<geom type='cylinder' size='.03 .12'/><geom type='sphere' size='.05' pos='0 .1 0'/></body></body></body>"
    "</worldbody></mujoco>";

// what contacts are not sought, since they bear nothing at both velocities, changes no force
static void test_narrowed(const char *model_text, cav_next_gap next_gap, cav_next_slip next_slip) {
  cav_model *m = scene_load(model_text);
  cav_state *state = m ? cav_state_new(m) : NULL;
  if (!CHECK(state != NULL)) return;
  int nv = m->nv, contacts[2] = {0};
  double *q = scene_vector(m->nq), *v = scene_vector(nv), *next = scene_vector(nv), worst = 0;
  double *J = scene_vector(6 * nv * nv + 2 * nv);
  state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  state->options.next_gap = next_gap;
  state->options.next_slip = next_slip;
  for (int k = 0; k < 300; k++) {
    // smoothings, laws, orders, time constants, and speeds up to 5 m/s by turns
    state->options.smoothing = k % 3 ? 0.004 * (k % 3) : 0;
    state->options.smoothing_self = state->options.smoothing / 4;
    state->options.sliding = k % 2 ? CAV_SLIDING_COULOMB : CAV_SLIDING_CONVEX;
    state->options.order = k / 2 % 2 ? CAV_ORDER_MIDPOINT : CAV_ORDER_EULER;
    state->options.timestep = 0.04;
    state->options.time_constant = k / 4 % 2 ? 0.03 : 0;
    double speed = k / 8 % 3 == 0 ? 0.03 : k / 8 % 3 == 1 ? 0.3 : 2;
    scene_posture(m, q, v, 0.4);
    scene_normals(v, nv, speed);
    scene_normals(next, nv, speed);
    compare_sought(m, state, q, v, next, J, contacts, &worst);
  }
  printf("%s, gap after the step %d, slip %d: %d of %d contacts sought, forces and derivatives within %.1e\n",
         model_text == housings ? "housings" : "meshes", (int)next_gap, (int)next_slip, contacts[0], contacts[1],
         worst);
  CHECK(contacts[0] < contacts[1]);
  // what is not sought is beyond where the law ends
  CHECK(worst == 0);
  cav_state_free(state);
  cav_model_free(m);
  free(q), free(v), free(next), free(J);
}

// A stretched arm of three parallel hinges whose rates 1, -2, 1 leave its last link without velocity: within the step it comes
// 2 L (1 - cos(h rate)) inwards all the same, 25 mm here, onto a block that is 17 mm away. Only the gap after the step sees that
static void test_folding(void) {
  static const char arm[] =
      "<mujoco><option timestep='0.04' gravity='0 0 0'/><asset><mesh name='block' vertex='-.05 -.05 -.05 .05 -.05 -.05 "
      "-.05 .05 -.05 .05 .05 -.05 -.05 -.05 .05 .05 -.05 .05 -.05 .05 .05 .05 .05 .05'/></asset><worldbody>"
      "<geom type='mesh' mesh='block' pos='.383 0 0'/><body><joint axis='0 0 1'/><inertial mass='1' pos='0 0 0' "
      "diaginertia='.01 .01 .01'/><body pos='.25 0 0'><joint axis='0 0 1'/><inertial mass='1' pos='0 0 0' "
      "diaginertia='.01 .01 .01'/><body pos='.25 0 0'><joint axis='0 0 1'/><geom type='mesh' "
      "mesh='block'/></body></body>"
      "</body></worldbody></mujoco>";
  cav_model *m = scene_load(arm);
  cav_state *state = m ? cav_state_new(m) : NULL;
  if (!CHECK(state != NULL && m->nv == 3)) return;
  state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  state->options.next_gap = CAV_NEXT_GAP_EXACT;
  state->options.smoothing = 1e-3;
  const double q[3] = {0, 0, 0}, v[3] = {8, -16, 8}, none[3] = {0, 0, 0};
  double J[6 * 9 + 6], worst = 0, u[3];
  int contacts[2] = {0};
  compare_sought(m, state, q, v, v, J, contacts, &worst);
  CHECK(worst == 0 && contacts[1] > 0);
  CHECK(cav_inverse(m, state, q, none, v, u) == CAV_OK && state->ncontact > 0 && state->contact[0].impulse[0] > 1e-3);
  cav_state_free(state);
  cav_model_free(m);
}

// A flange of 16 corners that presses on a block, tilted a little, and on a relief of a height field: more points than a pair may
// give. Which of them are taken does not depend on how far points are sought
static void test_flange(const char *under) {
  char corners[TEXT] = "", flange[TEXT];
  for (int k = 0; k < 32; k++)
    snprintf(corners + strlen(corners), sizeof corners - strlen(corners), "%.5f %.5f %g ", 0.04 * cos(k / 2 * M_PI / 8),
             0.04 * sin(k / 2 * M_PI / 8), k % 2 ? 0.01 : -0.01);
  snprintf(
      flange, sizeof flange,
      "<mujoco><option timestep='0.025'/><asset><mesh name='flange' vertex='%s'/><hfield name='relief' nrow='9' "
      "ncol='9' size='.1 .1 .005 .1' elevation='0 1 0 1 0 1 0 1 0  1 0 1 0 1 0 1 0 1  0 1 0 1 0 1 0 1 0  1 0 1 0 1 0 1 "
      "0 1  0 1 0 1 0 1 0 1 0  1 0 1 0 1 0 1 0 1  0 1 0 1 0 1 0 1 0  1 0 1 0 1 0 1 0 1  0 1 0 1 0 1 0 1 0'/></asset>"
      "<worldbody><geom %s/><body pos='0 0 .01'><freejoint/><geom type='mesh' mesh='flange'/></body></worldbody>"
      "</mujoco>",
      corners, under);
  cav_model *m = scene_load(flange);
  cav_state *state = m ? cav_state_new(m) : NULL;
  if (!CHECK(state != NULL && m->nv == 6)) return;
  state->options.stabilisation = CAV_STABILISATION_DISCRETE;
  double q[7], v[6], next[6], J[6 * 36 + 12], worst = 0;
  int contacts[2] = {0};
  for (int k = 0; k < 300; k++) {
    state->options.smoothing = k % 3 ? 0.004 * (k % 3) : 0;
    scene_posture(m, q, v, 0);
    q[2] = 0.01 + 0.004 * scene_uniform();
    for (int d = 4; d < 7; d++) q[d] = 0.1 * scene_uniform();
    cav_configuration_normalise(m, q);
    scene_normals(v, 6, 0.2);
    scene_normals(next, 6, k % 2 ? 0.02 : 0.2);
    compare_sought(m, state, q, v, next, J, contacts, &worst);
  }
  printf("flange on %s: %d of %d contacts sought, within %.1e\n", under, contacts[0], contacts[1], worst);
  CHECK(contacts[1] > 1000 && worst == 0);
  cav_state_free(state);
  cav_model_free(m);
}

// on a level part of a height field the inverse and its derivatives are those on a plane
static void test_level(const char *type, const char *attributes, double most) {
  static const char *const under[] = {"type='plane' size='1 1 1'", "type='hfield' hfield='level'"};
  char body[TEXT];
  cav_model *m[2];
  cav_state *state[2];
  for (int i = 0; i < 2; i++) {
    snprintf(
        body, sizeof body,
        "<mujoco><compiler angle='degree'/><option timestep='0.025'/><asset><hfield name='level' nrow='40' ncol='50' "
        "size='4 3 1 .2'/><mesh name='rock' vertex='%s'/></asset><worldbody><geom %s pos='.1 .2 -.1' euler='7 -12 20'/>"
        "<body pos='0 0 .1'><freejoint/><geom type='%s' %s/></body></worldbody></mujoco>",
        rock, under[i], type, attributes);
    m[i] = scene_load(body);
    state[i] = m[i] ? cav_state_new(m[i]) : NULL;
    if (!CHECK(state[i] != NULL && m[i]->nv == 6)) return;
    state[i]->options.stabilisation = CAV_STABILISATION_DISCRETE;
    state[i]->options.smoothing = 0.02;
  }
  double q[7], v[6], next[6], u[2][6], J[2][108], worst = 0;
  int contacts[2] = {0};
  for (int k = 0; k < POSES; k++) {
    scene_posture(m[0], q, v, 0);
    for (int d = 0; d < 2; d++) q[d] = 0.5 * scene_uniform();
    q[2] = 0.05 * scene_uniform();
    scene_normals(v, 6, 0.5);
    scene_normals(next, 6, 0.5);
    for (int i = 0; i < 2; i++) {
      CHECK(cav_inverse(m[i], state[i], q, v, next, u[i]) == CAV_OK);
      CHECK(cav_inverse_jacobian_by(m[i], state[i], CAV_DERIVATIVE_ANALYTIC, q, v, next, J[i], J[i] + 36, J[i] + 72) ==
            CAV_OK);
      contacts[i] += state[i]->ncontact;
    }
    worst = fmax(worst, fmax(scene_error(u[0], u[1], 6), scene_error(J[0], J[1], 108)));
  }
  printf("%-8s on a level field: %d contacts, %d on a plane, within %.1e\n", type, contacts[1], contacts[0], worst);
  CHECK(contacts[0] > 100 && contacts[0] == contacts[1] && worst < most);
  for (int i = 0; i < 2; i++) cav_state_free(state[i]), cav_model_free(m[i]);
}

int main(void) {
  test_folding();
  char meshes[TEXT];
  snprintf(meshes, sizeof meshes, text, rock, "mesh", "mesh='rock' condim='6'");
  for (int k = 0; k < 4; k++) {
    test_narrowed(meshes, (cav_next_gap)(k % 2), (cav_next_slip)(k / 2));
    test_narrowed(housings, (cav_next_gap)(k % 2), (cav_next_slip)(k / 2));
  }
  static const char *const shapes[][2] = {
      {"sphere", "size='.08'"},       {"capsule", "size='.05 .08'"},       {"box", "size='.09 .06 .07'"},
      {"cylinder", "size='.06 .08'"}, {"ellipsoid", "size='.06 .09 .12'"}, {"mesh", "mesh='rock'"},
  };
  for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
    test_shape(CAV_NEXT_GAP_LINEAR, rock, shapes[i][0], shapes[i][1]);
    test_shape(CAV_NEXT_GAP_LINEAR, round_rock(), shapes[i][0], shapes[i][1]);
    test_shape(CAV_NEXT_GAP_EXACT, rock, shapes[i][0], shapes[i][1]);
    test_history(rock, shapes[i][0], shapes[i][1]);
    test_history(round_rock(), shapes[i][0], shapes[i][1]);
  }
  test_flange("type='box' size='.1 .1 .05' pos='0 0 -.05'");
  test_flange("type='cylinder' size='.1 .05' pos='0 0 -.05'");
  test_flange("type='hfield' hfield='relief'");
  test_flange("type='plane' size='1 1 1'");
  test_flange("type='mesh' mesh='flange' pos='.02 .01 -.01'");
  // those of curved shapes are by differences
  for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++)
    test_level(shapes[i][0], shapes[i][1], i == 3 || i == 4 ? 1e-5 : 1e-11);
  for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) test_relief(shapes[i][0], shapes[i][1]);
  return check_result();
}
