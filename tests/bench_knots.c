/// Time and memory of a solve against the number of knots: a chain of our own, fixed to the world, that swings to a
/// goal, over 50, 500 and 5,000 knots of the same step. Each size is a process of its own, so that the largest resident
/// memory is its own; iterations are fixed, so that time is of equal work. Linear growth shows as equal numbers in the
/// columns per knot.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "check.h"
#include "continuation.h"

enum { SIZES = 4, ITERATIONS = 10 };
static const int size_of[SIZES] = {50, 500, 2000, 5000};

static const char chain[] =
    "<mujoco><worldbody><geom name='floor' type='plane' size='1 1 1'/><body pos='0 0 1'><joint name='a' axis='0 1 0'/>"
    "<geom type='capsule' fromto='0 0 0 .3 0 0' size='.03'/><body pos='.3 0 0'><joint name='b' axis='0 1 0'/>"
    "<geom type='capsule' fromto='0 0 0 .3 0 0' size='.03'/><body pos='.3 0 0'><joint name='c' axis='0 1 0'/>"
    "<geom type='capsule' fromto='0 0 0 .3 0 0' size='.03'/><body pos='.3 0 0'><joint name='d' axis='1 0 0'/>"
    "<joint name='e' axis='0 0 1'/><joint name='f' axis='0 1 0'/><geom name='tip' type='capsule' fromto='0 0 0 .3 0 0' "
    "size='.03'/></body></body></body></body></worldbody><actuator><motor joint='a'/><motor joint='b'/><motor "
    "joint='c'/>"
    "<motor joint='d'/><motor joint='e'/><motor joint='f'/></actuator></mujoco>";

typedef struct measure {
  double seconds_new, seconds, cost;
  long kilobytes, floor_kilobytes;
} measure;

static long resident(void) {
  struct rusage use;
  getrusage(RUSAGE_SELF, &use);
  return use.ru_maxrss;
}

// a fixed number of iterations over so many steps
static int work(const char *model_path, int steps, measure *out) {
  cav_error error = {0};
  cav_model *model = cav_model_load(model_path, &error);
  if (!model) return 0;
  cav_problem problem = cav_problem_default(model);
  cav_term term[16];
  double q_start[6] = {0.3, 0.2, 0.1, 0, 0, 0}, v_start[6] = {0}, q_goal[6] = {-0.5, 0.4, 0.5, 0.3, 0.2, -0.1};
  problem.nterm = cav_problem_default_terms(term, 16);
  problem.term = term;
  problem.duration = steps * problem.timestep;
  problem.q_start = q_start, problem.v_start = v_start, problem.q_goal = q_goal;
  out->floor_kilobytes = resident();
  double start = cav_clock();
  cav_transcription *tr = cav_transcription_new(&problem, 1, &error);
  cav_normal *normal = tr ? cav_normal_new(tr) : NULL;
  cav_trajectory *at = tr ? cav_trajectory_new(model, tr->nknot, problem.timestep) : NULL;
  cav_trajectory *spare = at ? cav_trajectory_copy(at) : NULL;
  if (!normal || !spare) return 0;
  memcpy(at->q, q_start, sizeof q_start);
  cav_guess_fill(&problem, problem.q_goal, at);
  cav_trajectory_velocities(model, at);
  cav_stage_set(&problem, 0, tr);
  out->seconds_new = cav_clock() - start;
  start = cav_clock();
  cav_region region = {.iterations = ITERATIONS};
  if (cav_region_minimise(&region, normal, tr, &at, &spare) != CAV_OK || region.done != ITERATIONS) return 0;
  out->seconds = cav_clock() - start;
  out->cost = cav_transcription_cost(tr);
  out->kilobytes = resident();
  cav_trajectory_free(at), cav_trajectory_free(spare);
  cav_normal_free(normal), cav_transcription_free(tr), cav_model_free(model);
  return 1;
}

// the same in a process of its own
static int apart(const char *model_path, int steps, measure *out) {
  int pipe_end[2], status = 0;
  if (pipe(pipe_end) != 0) return 0;
  fflush(stdout);
  pid_t child = fork();
  if (child == 0) {
    int ok = work(model_path, steps, out) && write(pipe_end[1], out, sizeof *out) == (ssize_t)sizeof *out;
    _exit(ok ? 0 : 1);
  }
  close(pipe_end[1]);
  int ok = child > 0 && read(pipe_end[0], out, sizeof *out) == (ssize_t)sizeof *out;
  close(pipe_end[0]);
  if (child > 0) waitpid(child, &status, 0);
  return ok && status == 0;
}

int main(void) {
  char path[] = "/tmp/cavort-chain-XXXXXX";
  int file = mkstemp(path), ok = file >= 0 && write(file, chain, sizeof chain - 1) == (ssize_t)sizeof chain - 1;
  if (file >= 0) close(file);
  printf("chain of 6 dof, %d iterations, one thread\n%8s %10s %14s %10s %14s %12s\n", ITERATIONS, "knots", "s",
         "us/knot/iter", "MB", "kB/knot", "set-up, s");
  for (int i = 0; i < SIZES && ok; i++) {
    measure m = {0};
    ok = apart(path, size_of[i], &m);
    double kilobytes = (double)(m.kilobytes - m.floor_kilobytes);
    printf("%8d %10.4f %14.2f %10.1f %14.2f %12.4f\n", size_of[i], m.seconds,
           1e6 * m.seconds / (size_of[i] * ITERATIONS), kilobytes / 1024, kilobytes / size_of[i], m.seconds_new);
  }
  unlink(path);
  return ok ? EXIT_SUCCESS : EXIT_FAILURE;
}
