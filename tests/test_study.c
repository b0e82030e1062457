/// problems/study/study.c, profile.c, command_study.c, dynamics/model/perturb.c: a varied model against one loaded from
/// a file that says the same; one start always the same, another one different; a study that is counted, drawn, resumed
/// and not done twice.
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

static void check_starts(const char *problem) {
  cav_study_run run[3] = {{.start = 3}, {.start = 3}, {.start = 4}};
  char reason[480];
  cav_error error = {0};
  for (int i = 0; i < 3; i++) {
    CHECK(cav_study_solve(problem, NULL, &run[i], reason, &error) == CAV_OK && run[i].known);
    CHECK_TEXT(reason, "");
    CHECK(run[i].certified);
  }
  CHECK(run[0].cost == run[1].cost && run[0].iterations == run[1].iterations);
  CHECK(run[0].cost != run[2].cost);
  CHECK(cav_study_solve("/nowhere.xml", NULL, &run[0], reason, &error) == CAV_BAD_INPUT);
}

// a cycle that mirrors needs a model that is its own image, masses and all
static void check_mirrored(const char *problem) {
  cav_study_run run = {.start = 1};
  char reason[480];
  cav_error error = {0};
  CHECK(cav_study_solve(problem, NULL, &run, reason, &error) == CAV_OK && run.known);
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

// ten runs by two processes; a record that is there is taken as it is, one that is gone is made again
static void check_command(char *problem) {
  char folder[160], record[200];
  snprintf(folder, sizeof folder, "%s/study", top);
  snprintf(record, sizeof record, "%s/runs/swing.own.4.csv", folder);
  cav_command_line line = {
      .noperand = 1, .operands = &problem, .output = folder, .threads = 2, .quiet = 1, .methods = "own"};
  CHECK(cav_command_study(&line) == CAV_EXIT_CERTIFIED);
  CHECK(strstr(read_file(folder, "study.txt"), "10 of  10") != NULL);
  CHECK(strstr(read_file(folder, "study.csv"), "swing,own,9,1,") != NULL);
  struct stat before, after;
  CHECK(stat(record, &before) == 0);
  scene_write(top, "study/runs/swing.own.5.csv",
              "certified,seconds,iterations,cost,unactuated,end_error\n0,1,2,3,4,5\n");
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
  check_mirrored(CAVORT_SOURCE_ROOT "/problems/motions/walker-walk/problem.xml");
  check_command(problem);
  snprintf(command, sizeof command, "rm -r '%s'", top);
  CHECK(system(command) == 0);
  return check_result();
}
