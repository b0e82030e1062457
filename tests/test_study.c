/// problems/study/study.c, profile.c, command_study.c, race/race.c, dynamics/model/perturb.c: a varied model against one
/// loaded from a file that says the same; one start always the same, another one different; what the race of solve mends,
/// and its limit of time; a study that is counted, drawn, resumed and not done twice.
#include "study.h"

#include <sys/stat.h>
#include <unistd.h>

#include "command.h"
#include "result.h"
#include "scene.h"

static char top[] = "/tmp/cavort-study-XXXXXX";

// a pendulum on a cart over a floor that its foot can touch; masses and friction are parameters
static const char cart[] =
    "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1' friction='%g'/><body name='cart' pos='0 0 .3'>"
    "<joint name='x' type='slide' axis='1 0 0'/><geom type='box' size='.1 .1 .05' mass='%.17g' friction='%g'/>"
    "<body name='pole'><joint name='turn' axis='0 1 0' armature='.01'/><geom type='capsule' fromto='0 0 0 0 0 .5' "
    "size='.03' "
    "mass='%.17g' friction='%g'/></body></body></worldbody><actuator><motor joint='x' gear='50'/><motor joint='turn' "
    "gear='20'/>"
    "</actuator></mujoco>";
static const char swing[] =
    "<problem name='swing' model='cart.xml'>\n<horizon duration='.5' timestep='.05'/>\n<start/>\n<goal><joint "
    "name='turn' "
    "pos='.5'/></goal>\n<cost><posture at='end' weight='100'/></cost></problem>";

// a leg that hops over a floor; of the problem %s: how high its centre of mass comes, and how near
static const char monopod[] =
    "<mujoco><default><geom friction='.8'/></default><worldbody><geom type='plane' size='5 5 .1'/>"
    "<body name='trunk' pos='0 0 .85'>"
    "<joint name='x' type='slide' axis='1 0 0'/><joint name='z' type='slide' axis='0 0 1'/>"
    "<joint name='pitch' axis='0 1 0'/><geom type='box' size='.15 .1 .1' mass='8'/><body name='thigh' pos='0 0 -.1'>"
    "<joint name='hip' axis='0 1 0' limited='true' range='-100 100'/>"
    "<geom type='capsule' fromto='0 0 0 0 0 -.35' size='.03' mass='1.2'/><body name='shin' pos='0 0 -.35'>"
    "<joint name='knee' axis='0 1 0' limited='true' range='0 150'/>"
    "<geom type='capsule' fromto='0 0 0 0 0 -.35' size='.025' mass='.6'/>"
    "<geom name='foot' type='sphere' pos='0 0 -.36' size='.04' mass='.1'/></body></body></body></worldbody><actuator>"
    "<motor name='hip' joint='hip' gear='80' ctrllimited='true' ctrlrange='-1 1'/>"
    "<motor name='knee' joint='knee' gear='120' ctrllimited='true' ctrlrange='-1 1'/></actuator></mujoco>";
static const char hop[] =
    "<problem name='hop' model='monopod.xml'><horizon duration='1' timestep='.02'/><pose name='stand'>"
    "<joint name='hip' degrees='-30'/><joint name='knee' degrees='60'/></pose><start key='stand' height='floor'/>"
    "<goal key='stand' height='floor'/><cost><sensor name='apex' type='subtreecom' body='trunk' component='z' "
    "relative='goal' target='%s' at='.5' weight='900' within='%s'/><sensor name='foot' type='framepos' geom='foot' "
    "component='z' relative='goal' target='.2' at='.5' weight='900'/><posture dofs='all' at='end' weight='900'/></cost>"
    "</problem>";

static cav_model *load_cart(double friction, double cart_mass, double pole_mass) {
  char text[2000], path[160];
  cav_error error = {0};
  snprintf(text, sizeof text, cart, friction, cart_mass, friction, pole_mass, friction);
  scene_write(top, "cart.xml", text);
  snprintf(path, sizeof path, "%s/cart.xml", top);
  cav_model *model = cav_model_load(path, &error);
  CHECK(model != NULL);
  if (!model) fprintf(stderr, "    %s\n", error.text);
  return model;
}

// all that follows from masses and friction, against the compiler's own way; bound 1e-12 relative: the same sums in
// other orders
static void check_perturb(void) {
  cav_model *expected = load_cart(0.7, 2 * 1.04, 0.5 * 0.97), *model = load_cart(1, 2, 0.5);
  const double scale[3] = {1, 1.04, 0.97}, wrong[3] = {1, 0, 1};
  if (expected && model) {
    CHECK(cav_model_perturb(model, wrong, 0.7) == CAV_BAD_INPUT &&
          cav_model_perturb(model, scale, -1) == CAV_BAD_INPUT);
    CHECK_NEAR(model->mass, 2.5, 1e-12); // refused: nothing changed
    CHECK(cav_model_perturb(model, scale, 0.7) == CAV_OK);
    CHECK_NEAR(model->mass, expected->mass, 1e-12);
    for (int i = 1; i < model->nlink; i++) {
      CHECK_NEAR(model->link[i].mass, expected->link[i].mass, 1e-12);
      CHECK_NEAR_ALL(model->link[i].com, expected->link[i].com, 3, 1e-12);
      CHECK_NEAR_ALL(model->link[i].inertia, expected->link[i].inertia, 6, 1e-12);
    }
    for (int i = 1; i < model->nbody; i++) {
      CHECK_NEAR_ALL(model->body[i].inertia, expected->body[i].inertia, 3, 1e-12);
      CHECK_NEAR_ALL(model->body[i].inverse_weight, expected->body[i].inverse_weight, 2,
                     1e-12 * expected->body[i].inverse_weight[1]);
    }
    for (int i = 0; i < model->nv; i++)
      CHECK_NEAR(model->dof[i].inverse_weight, expected->dof[i].inverse_weight, 1e-11);
    CHECK(model->npair > 0 && model->npair == expected->npair);
    for (int i = 0; i < model->npair; i++) {
      CHECK_NEAR_ALL(model->pair[i].friction, expected->pair[i].friction, 5, 1e-15);
      CHECK_NEAR_ALL(model->pair[i].weight, expected->pair[i].weight, 2, 1e-11 * expected->pair[i].weight[1]);
    }
  }
  cav_model_free(expected);
  cav_model_free(model);
}

/// How far from the floor a tree of a problem's start is, m.
static double gap_of(const cav_problem *p, int root) {
  cav_state *state = cav_state_new(p->model);
  double gap = INFINITY;
  if (!CHECK(state != NULL)) return NAN;
  state->options.smoothing = 1;
  CHECK(cav_position(p->model, state, p->q_start) == CAV_OK);
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    if (c->link1 > 0 && c->link2 > 0) continue;
    if (p->model->link[c->link1 + c->link2].root == root) gap = fmin(gap, c->dist);
  }
  cav_state_free(state);
  return gap;
}

// what stands beside what moves stays where it is: a box was lifted with the feet, and fell
static void check_stands(const char *problem) {
  for (int start = 0; start < 10; start++) {
    cav_error error = {0};
    cav_problem *stated = cav_problem_load(problem, NULL, &error), *moved = cav_problem_load(problem, NULL, &error);
    if (!CHECK(stated && moved)) return;
    CHECK(cav_study_perturb(moved, start) == CAV_OK);
    const cav_model *m = stated->model;
    int roots = 0, differ = 0;
    for (int i = 1; i < m->nlink; i++) {
      if (m->link[i].parent != 0) continue;
      roots++;
      CHECK_NEAR(gap_of(moved, i), gap_of(stated, i), 1e-9);
    }
    for (int i = 0; i < m->nq; i++) differ += moved->q_start[i] != stated->q_start[i];
    const cav_joint *box = &m->joint[m->njoint - 1];
    CHECK(roots == 2 && differ > 20 && box->type == CAV_JOINT_FREE);
    CHECK(!memcmp(moved->q_start + box->q, stated->q_start + box->q, 7 * sizeof(double)));
    // what the file lets slide slides: the box has 0.3, all else more
    const double factor = moved->model->geom[m->ngeom - 1].friction[0] / m->geom[m->ngeom - 1].friction[0];
    CHECK(m->geom[m->ngeom - 1].friction[0] == 0.3 && factor >= 0.75 && factor <= 1.25 && factor != 1);
    for (int i = 0; i < m->ngeom; i++)
      CHECK_NEAR(moved->model->geom[i].friction[0], factor * m->geom[i].friction[0], 1e-15);
    cav_problem_free(stated), cav_problem_free(moved);
  }
}

static void check_starts(const char *problem) {
  cav_study_run run[3] = {{.start = 3}, {.start = 3}, {.start = 4}};
  const cav_study_task task = {.problem = problem, .seconds = CAV_STUDY_SECONDS}, nowhere = {.problem = "/nowhere.xml"};
  char reason[480];
  cav_error error = {0};
  for (int i = 0; i < 3; i++) {
    CHECK(cav_study_solve(&task, &run[i], reason, &error) == CAV_OK && run[i].known);
    CHECK_TEXT(reason, "");
    CHECK(run[i].certified);
  }
  CHECK(run[0].cost == run[1].cost && run[0].iterations == run[1].iterations);
  CHECK(run[0].cost != run[2].cost);
  CHECK(cav_study_solve(&nowhere, &run[0], reason, &error) == CAV_BAD_INPUT);
}

// a cycle that mirrors needs a model that is its own image, masses and all
static void check_mirrored(const char *problem) {
  const cav_study_task task = {.problem = problem, .seconds = CAV_STUDY_SECONDS};
  cav_study_run run = {.start = 1};
  char reason[480];
  cav_error error = {0};
  CHECK(cav_study_solve(&task, &run, reason, &error) == CAV_OK && run.known);
  CHECK(run.certified);
}

static const char *read_file(const char *folder, const char *name) {
  static char text[20000];
  char *path = cav_result_path(folder, name);
  FILE *file = path ? fopen(path, "r") : NULL;
  size_t n = file ? fread(text, 1, sizeof text - 1, file) : 0;
  if (file) fclose(file);
  free(path);
  text[n] = 0;
  return text;
}

// what cavort solve mends counts as certified, by the strategy that did it; the stated guess alone is not. Nothing is left
// of what repairs went on from
static void check_race(void) {
  char problem[160], folder[160], tried[160], text[2000], reason[480];
  snprintf(problem, sizeof problem, "%s/hop.xml", top);
  snprintf(folder, sizeof folder, "%s/hop.checkpoints", top);
  snprintf(tried, sizeof tried, "%s/hop.tried.csv", top);
  snprintf(text, sizeof text, hop, ".3", "any");
  scene_write(top, "monopod.xml", monopod);
  scene_write(top, "hop.xml", text);
  const cav_study_task task = {problem, NULL, folder, tried, CAV_STUDY_SECONDS};
  cav_study_run stated = {.start = 2}, mended = {.start = 2, .method = CAV_STUDY_STRATEGIES};
  cav_error error = {0};
  CHECK(cav_study_solve(&task, &stated, reason, &error) == CAV_OK && stated.known);
  CHECK(!stated.certified && strstr(reason, "closed loop"));
  CHECK(access(tried, F_OK) != 0);
  CHECK(cav_study_solve(&task, &mended, reason, &error) == CAV_OK && mended.known);
  CHECK(mended.certified && mended.achieved);
  CHECK_TEXT(reason, "");
  CHECK(!strncmp(mended.strategy, "near-", 5));
  CHECK(mended.iterations > stated.iterations && mended.seconds > 0);
  const char *table = read_file(top, "hop.tried.csv");
  CHECK(strstr(table, "\nstated,0,not certified,") && strstr(table, mended.strategy));
  CHECK(access(folder, F_OK) != 0);
}

// of a height that no leg comes to, within a centimetre: the race has many more strategies than time, which is that of three
// solves. The time of its processes is counted; what is stopped needs an iteration, or a verification, until it ends
static void check_limit(void) {
  char problem[160], folder[160], tried[160], text[2000], reason[480];
  snprintf(problem, sizeof problem, "%s/high.xml", top);
  snprintf(folder, sizeof folder, "%s/high.checkpoints", top);
  snprintf(tried, sizeof tried, "%s/high.tried.csv", top);
  snprintf(text, sizeof text, hop, "1.5", ".01");
  scene_write(top, "high.xml", text);
  cav_study_task task = {problem, NULL, folder, tried, CAV_STUDY_SECONDS};
  cav_study_run one = {.start = 0}, all = {.start = 0, .method = CAV_STUDY_STRATEGIES};
  cav_error error = {0};
  CHECK(cav_study_solve(&task, &one, reason, &error) == CAV_OK && one.known && !one.achieved);
  task.seconds = 3 * one.seconds;
  CHECK(cav_study_solve(&task, &all, reason, &error) == CAV_OK && all.known && !all.achieved);
  CHECK(all.seconds >= task.seconds && all.seconds < task.seconds + 2 * one.seconds);
  CHECK(strstr(reason, "then its time was over"));
  CHECK(strstr(read_file(top, "high.tried.csv"), "\nlonger,0,not tried,"));
  CHECK(access(folder, F_OK) != 0);
}

// ten runs by two processes; a record that is there is taken as it is, one that is gone is made again
static void check_command(char *problem) {
  char folder[160], record[200];
  snprintf(folder, sizeof folder, "%s/study", top);
  snprintf(record, sizeof record, "%s/runs/swing.own.4.csv", folder);
  cav_command_line line = {
      .noperand = 1, .operands = &problem, .output = folder, .threads = 2, .quiet = 1, .methods = "own"};
  CHECK(cav_command_study(&line) == CAV_EXIT_CERTIFIED);
  CHECK(strstr(read_file(folder, "study.txt"), "10 of  10") != NULL);
  CHECK(strstr(read_file(folder, "study.csv"), "swing,own,9,stated,1,1,") != NULL);
  struct stat before, after;
  CHECK(stat(record, &before) == 0);
  scene_write(top, "study/runs/swing.own.5.csv",
              "strategy,certified,achieved,seconds,iterations,cost,unactuated,end_error\nstated,0,0,1,2,3,4,5\n");
  unlink(record);
  CHECK(cav_command_study(&line) == CAV_EXIT_NOT_CERTIFIED);
  CHECK(stat(record, &after) == 0);
  CHECK(strstr(read_file(folder, "study.txt"), " 9 of  10") != NULL);
  // the last point of the profile: nine tenths
  const char *profile = read_file(folder, "profile.csv");
  CHECK(!strncmp(profile, "seconds,own_absolute,ratio,own_relative\n", 40));
  CHECK(strstr(profile, "\n120,0.9,100,0.9\n") != NULL);
  line.methods = "own,newton";
  CHECK(cav_command_study(&line) == CAV_EXIT_BAD_INPUT);
}

int main(void) {
  if (!mkdtemp(top)) return EXIT_FAILURE;
  char problem[160], command[200];
  check_perturb();
  cav_model_free(load_cart(1, 2, 0.5));
  scene_write(top, "swing.xml", swing);
  snprintf(problem, sizeof problem, "%s/swing.xml", top);
  check_starts(problem);
  check_stands(CAVORT_SOURCE_ROOT "/problems/motions/push-box/problem.xml");
  check_mirrored(CAVORT_SOURCE_ROOT "/problems/motions/walker-walk/problem.xml");
  check_race();
  check_limit();
  check_command(problem);
  snprintf(command, sizeof command, "rm -r '%s'", top);
  CHECK(system(command) == 0);
  return check_result();
}
