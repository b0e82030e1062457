/// Runs of the contact suite: one scene in this library or in MuJoCo, and the rows of the table.
#include "suite.h"

int suite_check(int holds, const char *file, int line, const char *text) { return check_note(holds, file, line, text); }

int suite_result(void) { return check_result(); }

int suite_available(const suite_setting *setting) {
#ifdef CAVORT_HAVE_MUJOCO
  (void)setting;
  return 1;
#else
  return !setting->mujoco;
#endif
}

static double processor(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int open_ours(suite_run *run, const char *text) {
  const suite_setting *s = run->setting;
  run->model = scene_load(text);
  run->state = run->model ? cav_state_new(run->model) : NULL;
  if (!run->state) return 0;
  cav_options *o = &run->state->options;
  o->timestep = s->h;
  o->stabilisation = s->stabilisation;
  o->sliding = s->sliding;
  o->order = (cav_order)s->order;
  if (s->softness > 0) {
    o->softness = s->softness;
    o->time_constant = s->time_constant;
  }
  const int nv = run->model->nv;
  run->q = scene_vector(run->model->nq);
  run->v = scene_vector(nv), run->u = scene_vector(nv), run->next = scene_vector(nv);
  cav_configuration_reset(run->model, run->q);
  return 1;
}

static int open_peer(suite_run *run, const char *text) {
#ifdef CAVORT_HAVE_MUJOCO
  char path[] = "/tmp/cavort-suite-XXXXXX", why[1000] = "";
  const int file = mkstemp(path);
  if (file < 0) return 0;
  const int written = write(file, text, strlen(text)) == (ssize_t)strlen(text);
  close(file);
  run->m = written ? mj_loadXML(path, NULL, why, sizeof why) : NULL;
  unlink(path);
  if (!run->m) fprintf(stderr, "MuJoCo: %s\n", why);
  run->d = run->m ? mj_makeData(run->m) : NULL;
  if (!run->d) return 0;
  run->m->opt.timestep = run->setting->h;
  run->m->opt.integrator = run->setting->order ? mjINT_RK4 : mjINT_EULER;
  if (run->setting->softness > 0) {
    const double impedance = 1 / (1 + run->setting->softness);
    run->m->opt.enableflags |= mjENBL_OVERRIDE;
    run->m->opt.o_solref[0] = run->setting->time_constant, run->m->opt.o_solref[1] = 1;
    run->m->opt.o_solimp[0] = run->m->opt.o_solimp[1] = impedance;
  }
  run->q = run->d->qpos, run->v = run->d->qvel, run->u = run->d->qfrc_applied;
  return 1;
#else
  (void)run, (void)text;
  return 0;
#endif
}

int suite_open(suite_run *run, const char *text, const suite_setting *setting) {
  *run = (suite_run){.setting = setting};
  return CHECK(setting->mujoco ? open_peer(run, text) : open_ours(run, text));
}

void suite_close(suite_run *run) {
#ifdef CAVORT_HAVE_MUJOCO
  if (run->d) mj_deleteData(run->d);
  if (run->m) mj_deleteModel(run->m);
#endif
  if (run->model) free(run->q), free(run->v), free(run->u), free(run->next);
  cav_state_free(run->state);
  cav_model_free(run->model);
}

static void step_ours(suite_run *run) {
  cav_forward_report report = {0};
  const cav_status status =
      cav_forward_newton(run->model, run->state, run->q, run->v, run->u, 300, 1e-10, run->next, &report);
  run->failed += status != CAV_OK;
  run->iterations += report.iterations;
  if (status != CAV_OK && status != CAV_NOT_CONVERGED) return;
  double *v = run->v;
  run->v = run->next;
  run->next = v;
  cav_integrate(run->model, run->q, run->v, run->setting->h, run->q);
}

void suite_step(suite_run *run) {
  const double start = processor();
  if (run->model) step_ours(run);
#ifdef CAVORT_HAVE_MUJOCO
  if (run->d) {
    const int warned = run->d->warning[mjWARN_BADQACC].number + run->d->warning[mjWARN_BADQPOS].number;
    mj_step(run->m, run->d);
    run->failed += run->d->warning[mjWARN_BADQACC].number + run->d->warning[mjWARN_BADQPOS].number > warned;
  }
#endif
  run->seconds += processor() - start;
  run->steps++;
}

static double energy_ours(suite_run *run) {
  const cav_model *m = run->model;
  double *M = scene_vector(m->nv * m->nv), com[3], sum = 0;
  CHECK(cav_inertia(m, run->state, run->q, M) == CAV_OK);
  for (int i = 0; i < m->nv; i++)
    for (int j = 0; j < m->nv; j++) sum += 0.5 * run->v[i] * M[i * m->nv + j] * run->v[j];
  CHECK(cav_position(m, run->state, run->q) == CAV_OK);
  cav_momentum(m, run->state, run->v, com, NULL, NULL);
  for (int k = 0; k < 3; k++) sum -= m->mass * m->gravity[k] * com[k];
  free(M);
  return sum;
}

double suite_energy(suite_run *run) {
  if (run->model) return energy_ours(run);
#ifdef CAVORT_HAVE_MUJOCO
  mj_kinematics(run->m, run->d), mj_comPos(run->m, run->d), mj_crb(run->m, run->d), mj_comVel(run->m, run->d);
  double sum = 0, *M = scene_vector(run->m->nv * run->m->nv);
  mj_fullM(run->m, M, run->d->qM);
  for (int i = 0; i < run->m->nv; i++)
    for (int j = 0; j < run->m->nv; j++) sum += 0.5 * run->v[i] * M[i * run->m->nv + j] * run->v[j];
  for (int b = 1; b < run->m->nbody; b++)
    for (int k = 0; k < 3; k++) sum -= run->m->body_mass[b] * run->m->opt.gravity[k] * run->d->xipos[3 * b + k];
  free(M);
  return sum;
#else
  return NAN;
#endif
}

void suite_row(const char *scene, const suite_run *run, double error) {
  char lost[60] = "";
  if (run->failed) snprintf(lost, sizeof lost, ", %d of %ld steps failed", run->failed, run->steps);
  printf("| %s | %s | %s%s | %g | %.2e | %.3g | here |\n", scene, run->setting->mujoco ? "MuJoCo 2.2.2" : "cavort",
         run->setting->text, lost, 1e3 * run->setting->h, error, run->seconds);
  fflush(stdout);
}

void suite_published_row(const char *scene, const char *engine, double h, double error, double seconds) {
  printf("| %s | %s | published | %g | %.2e | %.3g | i7-7700HQ, 2018 |\n", scene, engine, 1e3 * h, error, seconds);
}

// whether a is at least as good as b in error and time, and better in one
static int dominates(const suite_point *a, const suite_point *b) {
  return a->error <= b->error && a->seconds <= b->seconds && (a->error < b->error || a->seconds < b->seconds);
}

// how many of b no point of a is as good as
static int undominated(const suite_point *a, int na, const suite_point *b, int nb) {
  int free_of = 0;
  for (int k = 0; k < nb; k++) {
    int any = 0;
    for (int i = 0; i < na; i++) any |= dominates(&a[i], &b[k]);
    free_of += !any;
  }
  return free_of;
}

void suite_compare(const char *scene, const suite_point *published, int n, const suite_point *peer, int npeer,
                   const suite_point *ours, int nours) {
  for (int i = 0; i < n; i++) {
    int near = 0;
    for (int k = 0; k < nours; k++) near |= fabs(published[i].h - ours[k].h) < 1e-9;
    if (near) suite_published_row(scene, published[i].engine, published[i].h, published[i].error, published[i].seconds);
  }
  const int free_of = undominated(published, n, ours, nours), here = undominated(peer, npeer, ours, nours);
  printf(
      "- %s: of our %d points %d have no published point at least as good in both error and time, %d none of MuJoCo's "
      "here; one of ours is at least as good in both as %d of the %d published points and %d of the %d of MuJoCo "
      "here.\n",
      scene, nours, free_of, here, n - undominated(ours, nours, published, n), n,
      npeer - undominated(ours, nours, peer, npeer), npeer);
  CHECK(free_of == nours);
  CHECK(here == nours);
}
