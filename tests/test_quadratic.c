/// optim/solver/quadratic.c on programmes whose Hessians are convex nowhere in particular: what is said to be solved is not above
/// where it began, and knots that are convex each by itself make a programme that is, which is solved.
#include <unistd.h>

#include "quadratic.h"
#include "scene.h"

static const char model_text[] =
    "<mujoco><worldbody><body name='trunk' pos='0 0 1'><joint name='z' type='slide' axis='0 0 1'/>"
    "<geom type='sphere' size='.1' mass='4'/><body name='arm'><joint name='hip' axis='0 1 0' range='-40 40' "
    "limited='true'/><geom type='capsule' fromto='0 0 0 0 0 -.25' size='.03' mass='1'/></body></body></worldbody>"
    "<actuator><motor joint='hip' gear='4' ctrlrange='-1 1' ctrllimited='true'/>"
    "<motor joint='z' gear='60' ctrlrange='-1 1' ctrllimited='true'/></actuator></mujoco>";

// of one dof, whose columns are shorter than what is multiplied at once
static const char small_text[] =
    "<mujoco><worldbody><body name='trunk' pos='0 0 1'><joint name='z' type='slide' axis='0 0 1'/>"
    "<geom type='sphere' size='.1' mass='4'/></body></worldbody>"
    "<actuator><motor joint='z' gear='60' ctrlrange='-1 1' ctrllimited='true'/></actuator></mujoco>";

enum { KNOTS = 8, TRIALS = 1500 };

typedef struct bench {
  cav_problem *problem;
  cav_trajectory *at;
  cav_transcription *tr;
  cav_normal *normal;
  cav_quadratic *qp;
  double radius[KNOTS];
} bench;

// costs are the usual ones of effort, velocity and acceleration
static int make(bench *b, const char *model) {
  static const char problem[] =
      "<problem name='p' model='model.xml'><horizon duration='.35' timestep='.05'/>"
      "<start/></problem>";
  char folder[] = "/tmp/cavort-quadratic-XXXXXX", path[80];
  cav_error error = {0};
  if (!CHECK(mkdtemp(folder) != NULL)) return 0;
  scene_write(folder, "model.xml", model);
  scene_write(folder, "problem.xml", problem);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  b->problem = cav_problem_load(path, NULL, &error);
  unlink(path);
  snprintf(path, sizeof path, "%s/model.xml", folder);
  unlink(path);
  rmdir(folder);
  if (!CHECK(b->problem != NULL)) return 0;
  b->tr = cav_transcription_new(b->problem, 1, &error);
  b->at = cav_trajectory_new(b->problem->model, KNOTS, b->problem->timestep);
  b->normal = b->tr ? cav_normal_new(b->tr) : NULL;
  b->qp = b->normal ? cav_quadratic_new(b->tr, b->normal) : NULL;
  return CHECK(b->qp && b->at && b->tr->nknot == KNOTS && cav_transcription_keep_rows(b->tr));
}

static double centred(void) { return 2 * scene_uniform() - 1; }

// a programme at random: costs that bend anyhow, so much, and rows at random distances from their bounds
static void draw(bench *b, double bend) {
  int width = 3 * b->tr->nv;
  memset(b->at->q, 0, (size_t)(KNOTS * b->at->nq) * sizeof(double));
  for (int i = b->at->nq; i < KNOTS * b->at->nq; i++) b->at->q[i] = 0.02 * centred();
  cav_trajectory_velocities(b->problem->model, b->at);
  CHECK(cav_transcription_linearise(b->tr, b->at) == CAV_OK);
  double *value = cav_quadratic_value(b->qp), *penalty = cav_quadratic_penalty(b->qp);
  for (int t = 0, k = 0; t < KNOTS; t++) {
    b->radius[t] = pow(10, -2 * scene_uniform());
    for (int i = 0; i < b->tr->knot[t].layout.count; i++, k++) {
      value[k] = b->tr->knot[t].slot[i].value + 0.3 * centred();
      penalty[k] = pow(10, 4 * scene_uniform());
    }
    for (int i = 0; i < width; i++) {
      // columns of what is no unknown are empty
      if (b->tr->knot[t].hessian[i * width + i] == 0) continue;
      b->tr->knot[t].gradient[i] += bend * centred();
      for (int j = 0; j <= i; j++)
        if (b->tr->knot[t].hessian[j * width + j] != 0) b->tr->knot[t].hessian[i * width + j] += bend * centred();
    }
  }
}

// how far below its start the objective is at a multiple of the solution; a NaN where that leaves its box
static double decrease_at(const bench *b, double multiple) {
  const int nv = b->tr->nv, width = 3 * nv;
  const double *x = cav_quadratic_step(b->qp), *value = cav_quadratic_value(b->qp),
               *penalty = cav_quadratic_penalty(b->qp);
  double sum = 0;
  for (int t = 0, k = 0; t < KNOTS; t++) {
    const cav_knot *knot = &b->tr->knot[t];
    double local[9] = {0};
    for (int i = 0; i < width; i++) {
      int block = cav_transcription_block(b->tr, t, i / nv);
      if (block >= 0) local[i] = multiple * x[block * nv + i % nv];
      if (block >= 0 && fabs(local[i]) > b->radius[block]) return NAN;
    }
    for (int i = 0; i < width; i++) {
      sum += local[i] * (knot->gradient[i] + 0.5 * knot->hessian[i * width + i] * local[i]);
      for (int j = 0; j < i; j++) sum += local[i] * knot->hessian[i * width + j] * local[j];
    }
    for (int i = 0; i < knot->layout.count; i++, k++) {
      const cav_slot *slot = &knot->slot[i];
      double after = value[k];
      for (int j = 0; j < width; j++) after += knot->slot_row[i * width + j] * local[j];
      sum += penalty[k] * (fmax(fmax(slot->lower - after, after - slot->upper), 0) -
                           fmax(fmax(slot->lower - value[k], value[k] - slot->upper), 0));
    }
  }
  return -sum;
}

// what is said to be a minimum is not above where the programme began, and a step further along gains next to nothing
static void test_solved(bench *b) {
  const double change[2] = {-INFINITY, INFINITY};
  int solved = 0, short_of = 0;
  double worst = 0;
  for (int i = 0; i < TRIALS; i++) {
    draw(b, pow(10, 6 * scene_uniform() - 1));
    double scale = cav_transcription_cost(b->tr), gap = 1e-11 * scale;
    if (cav_quadratic_solve(b->qp, b->radius, change, gap) != CAV_OK) continue;
    solved++;
    double least = fmax(cav_quadratic_gap(b->qp), gap);
    worst = fmin(worst, cav_quadratic_decrease(b->qp) / least);
    double here = decrease_at(b, 1), further = decrease_at(b, 1.01);
    CHECK(isnan(here) || fabs(here - cav_quadratic_decrease(b->qp)) <= 1e-6 * fabs(here) + 1e3 * least);
    short_of += here > 1e4 * gap && further - here > 0.002 * here;
  }
  printf("%d of %d programmes at random said to be solved; the worst ends %.3g gaps above its start\n", solved, TRIALS,
         -worst);
  printf("%d of them end where a hundredth of the step more gains a five hundredth more\n", short_of);
  CHECK(solved > TRIALS / 100 && worst >= -10 && short_of == 0);
}

// a direction that bends down by less than what the factors need beside one that bends steeply up: steps along it are
// held back, which is told
static void test_steep(bench *b) {
  const double change[2] = {-INFINITY, INFINITY}, steep = 1e9, down = 2e-3, slope = 1e-4;
  const int nv = b->tr->nv, width = 3 * nv, t = KNOTS / 2;
  draw(b, 0);
  for (int k = 0, row = 0; k < KNOTS; k++) {
    cav_knot *knot = &b->tr->knot[k];
    for (int i = 0; i < knot->layout.count; i++, row++)
      cav_quadratic_value(b->qp)[row] = 0.5 * (knot->slot[i].lower + knot->slot[i].upper);
    memset(knot->gradient, 0, (size_t)width * sizeof(double));
    memset(knot->hessian, 0, (size_t)(width * width) * sizeof(double));
    b->radius[k] = 0.1;
  }
  cav_knot *knot = &b->tr->knot[t];
  double *H = knot->hessian;
  H[nv * width + nv] = H[(nv + 1) * width + nv + 1] = steep - down;
  H[(nv + 1) * width + nv] = steep + down;
  knot->gradient[nv] = slope, knot->gradient[nv + 1] = -slope;
  double gap = 1e-11 * cav_transcription_cost(b->tr);
  CHECK(cav_quadratic_solve(b->qp, b->radius, change, gap) == CAV_OK);
  double here = decrease_at(b, 1), further = decrease_at(b, 1.01), steepness = (further - here) / (0.01 * here);
  double unfinished = cav_quadratic_unfinished(b->qp);
  printf("beside a steep way up: a step of %.3g, unfinished by %.3g, by differences %.3g\n",
         cav_quadratic_length(b->qp), unfinished, steepness);
  CHECK(unfinished > 0.5 && fabs(unfinished - steepness) < 0.05 * unfinished);
}

// a row so stiff that its weight leaves nothing of a Hessian of 1 along it: q1 + q2 = 0, and down along q1 - q2, by slope^2
// in all. Where rows give that is found, and the row holds; else the factors hold the step back
static void test_stiff(bench *b) {
  const double change[2] = {-INFINITY, INFINITY}, stiff = 1e5, slope = 0.02;
  const int nv = b->tr->nv, width = 3 * nv, t = KNOTS / 2;
  draw(b, 0);
  int first = 0;
  for (int k = 0, row = 0; k < KNOTS; k++) {
    cav_knot *knot = &b->tr->knot[k];
    if (k == t) first = row;
    for (int i = 0; i < knot->layout.count; i++, row++)
      cav_quadratic_value(b->qp)[row] = 0.5 * (knot->slot[i].lower + knot->slot[i].upper);
    memset(knot->gradient, 0, (size_t)width * sizeof(double));
    memset(knot->hessian, 0, (size_t)(width * width) * sizeof(double));
    for (int c = 0; c < 3; c++)
      for (int i = 0; i < nv && cav_transcription_block(b->tr, k, c) >= 0; i++)
        knot->hessian[(c * nv + i) * (width + 1)] = k == t && c == 1;
    b->radius[k] = 0.1;
  }
  cav_knot *knot = &b->tr->knot[t];
  const cav_slot before = knot->slot[0];
  for (int i = 0; i < width; i++) knot->slot_row[i] = i == nv || i == nv + 1 ? stiff : 0;
  knot->slot[0].lower = knot->slot[0].upper = cav_quadratic_value(b->qp)[first] = 0;
  cav_quadratic_penalty(b->qp)[first] = 1e3;
  knot->gradient[nv] = slope, knot->gradient[nv + 1] = -slope;
  const double expected = slope * slope, gap = 1e-11 * expected;
  for (int gives = 0; gives < 2; gives++) {
    cav_quadratic_let_give(b->qp, gives * expected);
    CHECK(cav_quadratic_solve(b->qp, b->radius, change, gap) == CAV_OK);
    const double decrease = cav_quadratic_decrease(b->qp), off = cav_quadratic_prediction(b->qp)[first];
    const double unfinished = cav_quadratic_unfinished(b->qp);
    printf("beside a stiff row that gives %s: %.10g of the decrease, unfinished by %.2g, the row off by %.2g\n",
           gives ? "a little" : "nothing", decrease / expected, unfinished, off);
    if (gives) CHECK(fabs(decrease / expected - 1) < 1e-5 && fabs(unfinished) < 1e-3 && fabs(off) < 1e-9);
    if (!gives) CHECK(fabs(unfinished) > 1e-3 || fabs(decrease / expected - 1) > 1e-3);
  }
  cav_quadratic_let_give(b->qp, 0);
  knot->slot[0] = before;
}

static void test_knots(bench *b) {
  const double change[2] = {-INFINITY, INFINITY};
  int width = 3 * b->tr->nv, bent = 0;
  for (int i = 0; i < 100; i++) {
    draw(b, pow(10, 4 * scene_uniform()));
    bent += !cav_quadratic_convex(b->qp);
    for (int t = 0; t < KNOTS; t++) {
      double need = 0;
      while (need < 1e9 && !cav_quadratic_knot_convex(b->qp, t, need)) need = need > 0 ? 10 * need : 1;
      for (int j = 0; j < width; j++) b->tr->knot[t].hessian[j * width + j] += need;
    }
    CHECK(cav_quadratic_convex(b->qp));
    double gap = 1e-11 * cav_transcription_cost(b->tr);
    CHECK(cav_quadratic_solve(b->qp, b->radius, change, gap) == CAV_OK);
    CHECK(cav_quadratic_decrease(b->qp) >= -cav_quadratic_gap(b->qp) - gap);
  }
  CHECK(bent > 50);
}

// under other penalties, from the solution before or from the start: the same solution
static void test_again(bench *b) {
  const double change[2] = {-INFINITY, INFINITY};
  double worst = 0, moved = 0;
  for (int i = 0; i < 100; i++) {
    draw(b, 0);
    double gap = 1e-11 * cav_transcription_cost(b->tr), *penalty = cav_quadratic_penalty(b->qp);
    CHECK(cav_quadratic_solve(b->qp, b->radius, change, gap) == CAV_OK);
    const double before = cav_quadratic_length(b->qp);
    for (int r = 0; r < cav_quadratic_rows(b->qp); r++)
      if (scene_uniform() < 0.3) penalty[r] *= pow(10, 2 * scene_uniform() - 0.5);
    CHECK(cav_quadratic_solve_again(b->qp, gap) == CAV_OK);
    double again = cav_quadratic_decrease(b->qp), left = cav_quadratic_gap(b->qp) + gap;
    moved += fabs(cav_quadratic_length(b->qp) - before) > 1e-6;
    CHECK(cav_quadratic_solve(b->qp, b->radius, change, gap) == CAV_OK);
    worst = fmax(worst, fabs(again - cav_quadratic_decrease(b->qp)) / (left + cav_quadratic_gap(b->qp)));
  }
  printf("solved again under other penalties: decreases apart by %.2g gaps at most, %g of 100 moved\n", worst, moved);
  CHECK(worst < 2 && moved > 20);
}

// adds each knot's own part once more, as rows add theirs
static void add_knot(void *context, int t) {
  bench *b = context;
  const cav_knot *knot = &b->tr->knot[t];
  cav_normal_add_block(b->normal, b->tr, t, knot->hessian, knot->step_row, knot->step_square);
}

// what is gathered and factored in one pass has the bits of one after the other, and fails where that does
static void test_sum(bench *b) {
  enum { ROOM = 64 };
  double x[ROOM], diagonal[ROOM], product[2][ROOM], solution[2][ROOM];
  double *kept = malloc(cav_normal_room(b->normal) * sizeof *kept);
  int n = b->normal->size, factored = 0, trials = 200;
  if (!CHECK(kept && n <= ROOM)) return;
  for (int i = 0; i < trials; i++) {
    draw(b, i % 2 ? 3 : 0);
    for (int j = 0; j < n; j++) x[j] = centred(), diagonal[j] = scene_uniform();
    cav_normal_clear(b->normal);
    for (int t = 0; t < KNOTS; t++) add_knot(b, t);
    cav_normal_save(b->normal, kept);
    cav_normal_multiply(b->normal, x, product[0]);
    for (int t = 0; t < KNOTS; t++) add_knot(b, t);
    cav_normal_add_diagonal(b->normal, diagonal);
    cav_status status = cav_normal_factor(b->normal, 1e-3);
    if (status == CAV_OK) cav_normal_solve(b->normal, x, solution[0]);
    cav_normal_sum sum = {kept, diagonal, x, product[1], NULL, add_knot, b};
    CHECK(cav_normal_factor_sum(b->normal, b->tr, &sum, 1e-3) == status);
    if (status != CAV_OK) continue;
    cav_normal_solve(b->normal, x, solution[1]);
    CHECK(!memcmp(product[0], product[1], (size_t)n * sizeof(double)));
    CHECK(!memcmp(solution[0], solution[1], (size_t)n * sizeof(double)));
    factored++;
  }
  free(kept);
  printf("%d of %d sums have a factor, the same in one pass\n", factored, trials);
  CHECK(factored > trials / 4 && factored < trials);
}

// a programme solved by three threads has the bits of one's
static void test_threads(bench *b) {
  const double change[2] = {-INFINITY, INFINITY};
  cav_transcription *tr = cav_transcription_new(b->problem, 3, NULL);
  cav_normal *normal = tr ? cav_normal_new(tr) : NULL;
  cav_quadratic *qp = normal ? cav_quadratic_new(tr, normal) : NULL;
  const int rows = cav_quadratic_rows(b->qp), nv = b->tr->nv;
  int solved = 0, trials = 100;
  if (CHECK(qp && cav_transcription_keep_rows(tr)))
    for (int i = 0; i < trials; i++) {
      draw(b, i % 2 ? 1 : 0);
      CHECK(cav_transcription_linearise(tr, b->at) == CAV_OK);
      for (int t = 0; t < KNOTS; t++) {
        memcpy(tr->knot[t].hessian, b->tr->knot[t].hessian, (size_t)(9 * nv * nv) * sizeof(double));
        memcpy(tr->knot[t].gradient, b->tr->knot[t].gradient, (size_t)(3 * nv) * sizeof(double));
      }
      memcpy(cav_quadratic_value(qp), cav_quadratic_value(b->qp), (size_t)rows * sizeof(double));
      memcpy(cav_quadratic_penalty(qp), cav_quadratic_penalty(b->qp), (size_t)rows * sizeof(double));
      const cav_status status = cav_quadratic_solve(b->qp, b->radius, change, 1e-10);
      CHECK(cav_quadratic_solve(qp, b->radius, change, 1e-10) == status);
      CHECK(!memcmp(cav_quadratic_step(b->qp), cav_quadratic_step(qp), (size_t)normal->size * sizeof(double)));
      CHECK(!memcmp(cav_quadratic_multiplier(b->qp), cav_quadratic_multiplier(qp), (size_t)rows * sizeof(double)));
      solved += status == CAV_OK;
    }
  printf("%d of %d programmes are solved by three threads, with the bits of one\n", solved, trials);
  CHECK(solved > trials / 2);
  cav_quadratic_free(qp), cav_normal_free(normal), cav_transcription_free(tr);
}

static void release(bench *b) {
  cav_quadratic_free(b->qp);
  cav_normal_free(b->normal);
  cav_trajectory_free(b->at);
  cav_transcription_free(b->tr);
  cav_problem_free(b->problem);
}

int main(void) {
  bench b = {0}, small = {0};
  if (make(&b, model_text)) {
    test_solved(&b);
    test_knots(&b);
    test_again(&b);
    test_steep(&b);
    test_stiff(&b);
    test_sum(&b);
    test_threads(&b);
  }
  if (make(&small, small_text)) {
    test_sum(&small);
    test_threads(&small);
  }
  release(&b), release(&small);
  return check_result();
}
