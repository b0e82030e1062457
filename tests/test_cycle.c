/// Cycles: the map from one period to the next on a body with every kind of joint (moved, turned, mirrored), what is
/// refused and why, the element of problem files, and a hopper of our own that hops for ever: certified by both
/// solvers, its wrap exact to rounding, with a free duration that moves to where the cost is least, or to its bound.
#include "cavort/cavort.h"
#include "motion.h"
#include "periodicity.h"
#include "scene.h"

/// Two arms of ball joints, two legs of which one's hinge is turned about, a cart on the side that turns with nothing.
#define SIDED(LEG, MORE)                                                                                           \
  "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/>"                                              \
  "<body name='trunk' pos='0 0 .5'><freejoint name='root'/><geom type='sphere' size='.1' mass='3' pos='.02 0 0'/>" \
  "<body name='left leg' pos='.1 .1 -.05'><joint name='left hip' axis='.2 1 .1' limited='true' range='-30 40'/>"   \
  "<geom type='capsule' size='.03' fromto='0 0 0 0 .02 -.2' mass='.5'/></body>"                                    \
  "<body name='right leg' pos='.1 -.1 -.05'>" LEG                                                                  \
  "<geom name='shin' type='capsule' size='.03' fromto='0 0 0 0 -.02 "                                              \
  "-.2' mass='.5'/></body>"                                                                                        \
  "<body name='arm_l' pos='-.1 .1 .1' euler='20 30 0'><joint name='shoulder_l' type='ball'/>"                      \
  "<geom type='capsule' size='.03' fromto='0 0 0 .1 0 -.25' mass='.4'/></body>"                                    \
  "<body name='arm_r' pos='-.1 -.1 .1' euler='-20 30 0'><joint name='shoulder_r' type='ball'/>"                    \
  "<geom type='capsule' size='.03' fromto='0 0 0 .1 0 -.25' mass='.4'/></body></body></worldbody>"                 \
  "<actuator><motor joint='left hip' gear='20' ctrllimited='true' ctrlrange='-1 .5'/>" MORE "</actuator></mujoco>"
#define LEG "<joint name='right hip' axis='.2 -1 .1' limited='true' range='-40 30'/>"
#define HIP "<motor joint='right hip' gear='20' ctrllimited='true' ctrlrange='-.5 1'/>"

/// Two legs half a metre apart on a trunk whose centre of mass is off the middle.
#define TILTED(Y)                                                                                                  \
  "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/><body name='trunk' pos='0 0 .5'>"              \
  "<freejoint name='root'/><inertial pos='.02 " Y                                                                  \
  " 0' mass='3' diaginertia='.2 .2 .2'/>"                                                                          \
  "<body name='left leg' pos='0 .25 0'><joint name='left hip' axis='0 1 0'/><inertial pos='0 0 -.2' mass='.5' "    \
  "diaginertia='.01 .01 .01'/></body><body name='right leg' pos='0 -.25 0'><joint name='right hip' axis='0 1 0'/>" \
  "<inertial pos='0 0 -.2' mass='.5' diaginertia='.01 .01 .01'/></body></body></worldbody></mujoco>"

/// A torso that stays upright on a leg of two links with a round foot, in the x-z plane.
static const char hopper[] =
    "<mujoco model='hopper'><compiler angle='degree'/><worldbody><geom name='floor' type='plane' size='1 1 1'/>"
    "<body name='torso' pos='0 0 1'><joint name='x' type='slide' axis='1 0 0'/><joint name='z' type='slide' axis='0 0 "
    "1'/>"
    "<joint name='pitch' axis='0 1 0'/><geom type='box' size='.2 .1 .1' mass='6'/>"
    "<body name='thigh'><joint name='hip' axis='0 1 0' limited='true' range='-90 60' armature='.01'/>"
    "<geom type='capsule' size='.04' fromto='0 0 0 0 0 -.3' mass='1' contype='0' conaffinity='0'/>"
    "<body name='shin' pos='0 0 -.3'><joint name='knee' axis='0 1 0' limited='true' range='5 150' armature='.01'/>"
    "<geom type='capsule' size='.03' fromto='0 0 0 0 0 -.3' mass='.5' contype='0' conaffinity='0'/>"
    "<geom name='foot' type='sphere' size='.05' pos='0 0 -.3' mass='.2'/></body></body></body></worldbody>"
    "<actuator><motor joint='hip' gear='150' ctrllimited='true' ctrlrange='-1 1'/>"
    "<motor joint='knee' gear='150' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";

// ---------------------------------------------------------------- the map

static cav_problem with_cycle(const cav_model *m, cav_cycle cycle) {
  cav_problem p = cav_problem_default(m);
  p.q_start = p.q_goal = (double *)m->q0;
  p.cycle = cycle;
  p.cycle.on = 1;
  return p;
}

/// There and back, tangents against differences, and bodies where the world's points go.
static void test_map(const cav_model *m, cav_cycle cycle) {
  cav_problem p = with_cycle(m, cycle);
  cav_error error = {0};
  cav_periodicity *periodicity = cav_periodicity_new(&p, &error);
  if (!CHECK(periodicity != NULL)) {
    fprintf(stderr, "    %s\n", error.text);
    return;
  }
  double *q = scene_vector(m->nq), *moved = scene_vector(m->nq), *back = scene_vector(m->nq);
  double *near = scene_vector(m->nq), *there = scene_vector(m->nq);
  double *v = scene_vector(m->nv), *pv = scene_vector(m->nv), *found = scene_vector(m->nv);
  double *com = scene_vector(3 * m->nlink), point[3];
  cav_state *state = cav_state_new(m);
  for (int k = 0; k < 20; k++) {
    scene_posture(m, q, v, 0.6);
    cav_periodicity_configuration(periodicity, 1, q, moved);
    cav_periodicity_configuration(periodicity, -1, moved, back);
    cav_difference(m, q, back, 1, found);
    CHECK(scene_norm(found, m->nv) < 1e-12);
    // G (q (+) v) = (G q) (+) P v
    scene_normals(v, m->nv, 0.3);
    cav_integrate(m, q, v, 1, near);
    cav_periodicity_configuration(periodicity, 1, near, there);
    cav_difference(m, moved, there, 1, found);
    cav_periodicity_tangent(periodicity, 1, v, pv);
    CHECK(scene_error(found, pv, m->nv) < 1e-12);
    cav_periodicity_tangent(periodicity, -1, pv, found);
    CHECK(scene_error(found, v, m->nv) < 1e-12);
    CHECK(cav_position(m, state, q) == CAV_OK);
    memcpy(com, state->com, sizeof(double) * 3 * (size_t)m->nlink);
    CHECK(cav_position(m, state, moved) == CAV_OK);
    for (int l = 1; l < m->nlink; l++) {
      cav_periodicity_point(periodicity, com + 3 * l, point);
      CHECK(scene_error(point, state->com + 3 * cav_periodicity_link(periodicity, l), 3) < 1e-9);
    }
  }
  cav_state_free(state);
  cav_periodicity_free(periodicity);
  free(q), free(moved), free(back), free(near), free(there), free(v), free(pv), free(found), free(com);
}

static void refuse(const char *scene, cav_cycle cycle, const char *says) {
  cav_model *m = scene_load(scene);
  if (!CHECK(m != NULL)) return;
  cav_problem p = with_cycle(m, cycle);
  cav_error error = {0};
  cav_periodicity *periodicity = cav_periodicity_new(&p, &error);
  if (!CHECK(!periodicity && error.status == CAV_BAD_INPUT && strstr(error.text, says)))
    fprintf(stderr, "    '%s' lacks '%s'\n", error.text, says);
  cav_periodicity_free(periodicity);
  cav_model_free(m);
}

static void test_refusals(void) {
  const cav_cycle mirror = {.mirror = CAV_MIRROR_Y}, along_y = {.translation = {0, 1, 0}},
                  up = {.translation = {0, 0, 1}};
  const cav_cycle rotation = {.rotation = 1}, both = {.rotation = 1, .mirror = CAV_MIRROR_Y};
  const cav_cycle across = {.translation = {0, 1, 0}, .mirror = CAV_MIRROR_Y};
  static const int pair[1][2] = {{0, 99}};
  const cav_cycle paired = {.mirror = CAV_MIRROR_Y, .npair = 1, .pair = pair};
  refuse(SIDED("<joint name='right hip' axis='.2 -1 .3' limited='true' range='-40 30'/>", HIP), mirror,
         "axes of joint");
  refuse(SIDED("<joint name='right hip' axis='.2 -1 .1' pos='0 .05 0' limited='true' range='-40 30'/>", HIP), mirror,
         "anchors of joint 'left hip'");
  refuse(SIDED("<joint name='right hip' axis='.2 -1 .1'/>", HIP), mirror, "ranges of joint");
  refuse(SIDED("<joint name='right hipp' axis='.2 -1 .1' limited='true' range='-40 30'/>", ""), mirror,
         "declare the pair");
  refuse(SIDED(LEG "<inertial pos='0 0 -.1' mass='.6' diaginertia='.01 .01 .01'/>", HIP), mirror,
         "masses of body 'left leg'");
  refuse(SIDED(LEG, ""), mirror, "actuator");
  refuse(SIDED(LEG, "<motor joint='right hip' gear='20' ctrllimited='true' ctrlrange='-1 .5'/>"), mirror, "actuator");
  refuse(SIDED(LEG, HIP), both, "cannot turn");
  refuse(SIDED(LEG, HIP), across, "reflected");
  refuse(SIDED(LEG, HIP), up, "ground is not the same");
  refuse(SIDED(LEG, HIP), paired, "pair of the cycle");
  refuse(hopper, along_y, "cannot follow");
  refuse(hopper, rotation, "cannot turn");
  refuse(
      "<mujoco><worldbody><geom name='step' type='box' size='1 1 .1'/><body><freejoint/><geom size='.1'/></body>"
      "</worldbody></mujoco>",
      along_y, "'step'");
  // a spring on one side is seen by the forces
  refuse(SIDED("<joint name='right hip' axis='.2 -1 .1' limited='true' range='-40 30' stiffness='2'/>", HIP), mirror,
         "own mirror image");
}

/// A trunk whose mass is off the middle by 2 mm, as robots are, is 4 mm from its image; one off by 10 mm has none.
static void test_asymmetry(void) {
  double length = -1, force = -1;
  cav_model *m = scene_load(SIDED(LEG, HIP));
  if (!CHECK(m != NULL)) return;
  cav_problem p = with_cycle(m, (cav_cycle){.mirror = CAV_MIRROR_Y});
  cav_periodicity *periodicity = cav_periodicity_new(&p, NULL);
  if (CHECK(periodicity != NULL)) cav_periodicity_asymmetry(periodicity, &length, &force);
  CHECK(length == 0 && force == 0);
  cav_periodicity_free(periodicity);
  cav_model_free(m);
  for (int k = 0; k < 2; k++) {
    m = scene_load(k ? TILTED(".01") : TILTED(".002"));
    if (!CHECK(m != NULL)) return;
    p = with_cycle(m, (cav_cycle){.mirror = CAV_MIRROR_Y});
    cav_error error = {0};
    periodicity = cav_periodicity_new(&p, &error);
    if (k) CHECK(!periodicity && strstr(error.text, "masses of body 'trunk'") != NULL);
    if (!k && CHECK(periodicity != NULL)) {
      cav_periodicity_asymmetry(periodicity, &length, &force);
      CHECK_NEAR(length, 0.004, 1e-9);
      CHECK(force > 1e-4 && force < 0.05);
    }
    cav_periodicity_free(periodicity);
    cav_model_free(m);
  }
}

/// The verifier tells the mirrored half stride of what is 4 mm from its image apart: its end is on its start, and what its masses
/// press there for is measured; of what is its own image nothing is.
static void test_uneven_verdict(void) {
  for (int k = 0; k < 2; k++) {
    cav_model *m = scene_load(k ? TILTED(".002") : TILTED("0"));
    if (!CHECK(m != NULL)) return;
    cav_problem p = with_cycle(m, (cav_cycle){.mirror = CAV_MIRROR_Y});
    p.timestep = 0.02, p.duration = 0.2;
    p.v_start = scene_vector(m->nv);
    cav_options law = m->options;
    law.timestep = p.timestep;
    cav_error error = {0};
    cav_verdict v;
    cav_trajectory *still = cav_problem_guess(&p, &error);
    if (!CHECK(still && cav_verify(&p, still, &law, NULL, NULL, &v, &error) == CAV_OK)) {
      fprintf(stderr, "    %s\n", error.text);
    } else {
      CHECK(v.periodicity_error < CAV_TOLERANCE_PERIODICITY);
      // it hangs in the air: its weight is what nothing gives
      CHECK(k ? v.mirrored_force_max > 0.9 : isnan(v.mirrored_force_max));
      CHECK(v.unactuated_force_max > 0.9);
    }
    cav_trajectory_free(still);
    free(p.v_start);
    cav_model_free(m);
  }
}

/// Where ranges differ, what both allow holds: -30 40 and the mirror of -35 20 degrees, which is -20 35.
static void test_ranges(void) {
  cav_model *m = scene_load(SIDED("<joint name='right hip' axis='.2 -1 .1' limited='true' range='-35 20'/>", HIP));
  if (!CHECK(m != NULL)) return;
  cav_problem p = with_cycle(m, (cav_cycle){.mirror = CAV_MIRROR_Y});
  cav_periodicity *periodicity = cav_periodicity_new(&p, NULL);
  double left[2] = {0}, right[2] = {0}, degree = M_PI / 180;
  if (CHECK(periodicity != NULL)) {
    cav_periodicity_range(periodicity, cav_object_find(m, CAV_OBJECT_JOINT, "left hip"), left);
    cav_periodicity_range(periodicity, cav_object_find(m, CAV_OBJECT_JOINT, "right hip"), right);
  }
  CHECK_NEAR(left[0], -20 * degree, 1e-12);
  CHECK_NEAR(left[1], 35 * degree, 1e-12);
  CHECK_NEAR(right[0], -35 * degree, 1e-12);
  CHECK_NEAR(right[1], 20 * degree, 1e-12);
  cav_periodicity_free(periodicity);
  cav_model_free(m);
}

// ---------------------------------------------------------------- files

static const char file_frame[] =
    "<problem name='hop' model='hopper.xml'>\n<horizon duration='.5' timestep='.025' %s/>\n%s\n"
    "<start height='floor'><joint name='hip' degrees='-40'/><joint name='knee' degrees='80'/></start>\n"
    "<guess apex='.1' from='.2' to='.5'/>\n"
    "<cost><posture joint='pitch' weight='10'/>"
    "<sensor type='framepos' geom='foot' component='z' target='.2' at='.35' weight='100'/></cost>\n</problem>\n";

static cav_problem *load_file(const char *horizon, const char *cycle, cav_error *error) {
  char folder[] = "/tmp/cavort-cycle-XXXXXX", path[300], text[2000];
  if (!CHECK(mkdtemp(folder) != NULL)) return NULL;
  snprintf(text, sizeof text, file_frame, horizon, cycle);
  scene_write(folder, "hopper.xml", hopper);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *p = cav_problem_load(path, NULL, error);
  // what is written says the same
  if (p) {
    cav_problem *again = NULL;
    snprintf(path, sizeof path, "%s/again.xml", folder);
    CHECK(cav_problem_write(path, p, NULL, NULL) == CAV_OK && (again = cav_problem_load(path, NULL, NULL)));
    if (again) {
      CHECK(again->cycle.on == p->cycle.on && again->cycle.mirror == p->cycle.mirror &&
            again->cycle.npair == p->cycle.npair && fabs(again->cycle.rotation - p->cycle.rotation) < 1e-15 &&
            !memcmp(again->cycle.translation, p->cycle.translation, sizeof p->cycle.translation));
      CHECK(again->duration_least == p->duration_least && again->duration_most == p->duration_most &&
            again->duration_weight == p->duration_weight);
    }
    cav_problem_free(again);
    unlink(path);
  }
  snprintf(path, sizeof path, "%s/problem.xml", folder), unlink(path);
  snprintf(path, sizeof path, "%s/hopper.xml", folder), unlink(path);
  rmdir(folder);
  return p;
}

static void refuse_file(const char *horizon, const char *cycle, int line, const char *says) {
  cav_error error = {0};
  cav_problem *p = load_file(horizon, cycle, &error);
  if (!CHECK(!p && error.status == CAV_BAD_INPUT && error.line == line && strstr(error.text, says)))
    fprintf(stderr, "    line %d, '%s' lacks '%s'\n", error.line, error.text, says);
  cav_problem_free(p);
}

static void test_files(void) {
  cav_problem *p =
      load_file("", "<cycle translation='.3 0 0' mirror='y'><pair joint='hip' other='hip'/></cycle>", NULL);
  CHECK(p && p->cycle.on && p->cycle.mirror == CAV_MIRROR_Y && p->cycle.npair == 1 && p->cycle.translation[0] == .3 &&
        p->duration_most == 0);
  cav_problem_free(p);
  refuse_file("close='rest'", "<cycle/>", 2, "contradicts <cycle>");
  refuse_file("", "<cycle translation='1 0'/>", 3, "translation");
  refuse_file("", "<cycle translation='0 1 0'/>", 3, "cannot follow");
  refuse_file("", "<cycle rotation='30'/>", 3, "cannot turn");
  refuse_file("", "<cycle mirror='z'/>", 3, "mirror");
  refuse_file("", "<cycle><pair joint='hip' other='knee'/></cycle>", 3, "mirrored");
  refuse_file("", "<cycle mirror='y'><pair joint='hip' other='kneee'/></cycle>", 3, "knee");
  refuse_file("", "<cycle mirror='y'><pair joint='hip' other='hip'/><pair joint='knee' other='hip'/></cycle>", 3,
              "counterpart already");
  refuse_file("range='.6 .9'", "", 2, "about 0.5 s");
  refuse_file("range='.5'", "", 2, "range");
  refuse_file("weight='3'", "", 2, "range");
  refuse_file("range='.4 .9' weight='-3'", "", 2, "weight");
}

// ---------------------------------------------------------------- a motion

#ifdef CAVORT_HAVE_IPOPT
/// Ipopt's checker on gradient, Jacobian and its sparsity at a solution, the seam and the step among its unknowns.
static void check_derivatives(const cav_problem *p, const cav_trajectory *at) {
  static const cav_ipopt_option no_iterations = {"max_iter", "0"};
  char log[] = "/tmp/cavort-ipopt-XXXXXX";
  int file = mkstemp(log);
  if (!CHECK(file >= 0)) return;
  close(file);
  cav_solve_options options = cav_solve_options_default();
  cav_solution *solution = NULL;
  motion_findings found = {0};
  options.solver = CAV_SOLVER_IPOPT;
  options.nipopt = 1;
  options.ipopt = &no_iterations;
  options.ipopt_derivative_test = 1;
  options.ipopt_output = log;
  options.diagnose = 0;
  cav_status status = cav_solve(p, &options, at, &solution, NULL);
  CHECK(status == CAV_OK || status == CAV_NOT_CONVERGED);
  motion_read_log(log, NULL, &found);
  CHECK(found.silent == 0 && found.errors == 0);
  if (found.errors) fprintf(stderr, "    %d entries differ, the worst by %g\n", found.errors, found.worst);
  cav_solution_free(solution);
  unlink(log);
}
#endif

/// Certified, with the periodicity exact; the duration it took, 0 if it is not.
static double hop(const cav_problem *p, cav_solver solver, cav_verdict *verdict) {
  cav_solve_options options = cav_solve_options_default();
  cav_solution *s = NULL;
  cav_error error = {0};
  options.solver = solver;
  cav_status status = cav_solve(p, &options, NULL, &s, &error);
  double duration = 0;
  CHECK(status == CAV_OK && s);
  if (status != CAV_OK) fprintf(stderr, "    %s\n", error.text);
  if (s && CHECK(cav_verify(p, s->trajectory, &s->contact, s->gain_q, s->gain_v, verdict, &error) == CAV_OK)) {
    if (!CHECK(verdict->certified)) fprintf(stderr, "    %s\n", verdict->reason);
    CHECK(verdict->periodicity_error < 1e-12 && verdict->periods == 2);
    CHECK(verdict->closed_loop_seconds > 1.999 * verdict->duration);
    duration = verdict->duration;
    printf(
        "hop: %.4f s, %d iterations, cost %.4f, unactuated %.1e, wrap %.1e, momentum %.1e, open loop %.2f s, end %.0f "
        "mm\n",
        duration, s->iterations, s->cost, verdict->unactuated_force_max, verdict->periodicity_error,
        verdict->momentum_defect_rms, verdict->replay_same_step_seconds, 1e3 * verdict->closed_loop_end_error_m);
#ifdef CAVORT_HAVE_IPOPT
    check_derivatives(p, s->trajectory);
#endif
    // a period that does not close is seen
    cav_verdict spoilt = {0};
    s->trajectory->q[0] += 1e-6;
    CHECK(cav_verify(p, s->trajectory, &s->contact, s->gain_q, s->gain_v, &spoilt, &error) == CAV_OK);
    CHECK(!spoilt.certified && spoilt.periodicity_error > 0.9e-6);
  }
  cav_solution_free(s);
  return duration;
}

static void test_hop(void) {
  cav_verdict verdict = {0};
  cav_problem *p = load_file("", "<cycle translation='.3 0 0'/>", NULL);
  if (!CHECK(p != NULL)) return;
  CHECK(fabs(hop(p, CAV_SOLVER_GAUSS_NEWTON, &verdict) - 0.5) < 1e-12);
#ifdef CAVORT_HAVE_IPOPT
  hop(p, CAV_SOLVER_BOTH, &verdict);
#endif
  // free: away from where it stood, and to its bound where time is expensive
  p->duration_least = 0.3, p->duration_most = 0.8;
  double cheap = hop(p, CAV_SOLVER_GAUSS_NEWTON, &verdict);
  CHECK(cheap > 0.3 && cheap <= 0.8 && fabs(cheap - 0.5) > 1e-3);
  p->duration_least = 0.45, p->duration_weight = 1e4;
  // the restoration of rows at the end takes no cost into account and may leave the bound a little: seen 5e-8
  CHECK(fabs(hop(p, CAV_SOLVER_GAUSS_NEWTON, &verdict) - 0.45) < 1e-6);
  cav_problem_free(p);
}

int main(void) {
  cav_model *m = scene_load(SIDED(LEG, HIP));
  if (CHECK(m != NULL)) {
    test_map(m, (cav_cycle){.translation = {1, 2, 0}});
    test_map(m, (cav_cycle){.translation = {1, 2, 0}, .rotation = 0.7});
    test_map(m, (cav_cycle){.translation = {1, 0, 0}, .mirror = CAV_MIRROR_Y});
  }
  cav_model_free(m);
  m = scene_load(hopper);
  if (CHECK(m != NULL)) test_map(m, (cav_cycle){.translation = {1, 0, 0}, .mirror = CAV_MIRROR_Y});
  cav_model_free(m);
  test_refusals();
  test_asymmetry();
  test_uneven_verdict();
  test_ranges();
  test_files();
  test_hop();
  return check_result();
}
