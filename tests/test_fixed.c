/// What stands out of reach is left out, what is near never: cav_fixed_find against all pairs, and the contacts of scenes
/// against those found with nothing left out, with every shape and joint, over walks and jumps; a chain stretched as far as
/// it goes. Controls: pruning that takes links for shorter than they are, or leaves out whatever it can, is noticed.
#include "check.h"
#include "fixed.h"
#include "math3.h"
#include "scene.h"
#include "step.h"

static double uniform(double low, double high) { return low + (high - low) * (scene_uniform() + 1) / 2; }

/// What the library's calls of cav_fixed_find come to: as it is, nothing left out, or whatever it can be.
static enum { FAITHFUL, NOTHING, EVERYTHING } leaves_out;
static int asked, clear; ///< calls, and those after which only pairs were left that never go
static int all_pairs;
static double shrink = 1; ///< of the reaches that the library finds

cav_fixed *__real_cav_fixed_new(int nball, const double (*centre)[3], const double *radius, const int *tree,
                                const double *reach, int npair, const cav_sweep_pair *pair);
cav_fixed *__wrap_cav_fixed_new(int nball, const double (*centre)[3], const double *radius, const int *tree,
                                const double *reach, int npair, const cav_sweep_pair *pair);
cav_fixed *__wrap_cav_fixed_new(int nball, const double (*centre)[3], const double *radius, const int *tree,
                                const double *reach, int npair, const cav_sweep_pair *pair) {
  double shorter[16];
  int ntree = 0;
  for (int i = 0; i < nball; i++) ntree = tree[i] >= ntree ? tree[i] + 1 : ntree;
  for (int t = 0; t < ntree && t < 16; t++) shorter[t] = shrink * reach[t];
  return __real_cav_fixed_new(nball, centre, radius, tree, ntree <= 16 ? shorter : reach, npair, pair);
}

int __real_cav_fixed_find(cav_fixed *fixed, const double (*centre)[3], const double (*root)[3], double margin,
                          const cav_run **run, int *nrun);
int __wrap_cav_fixed_find(cav_fixed *fixed, const double (*centre)[3], const double (*root)[3], double margin,
                          const cav_run **run, int *nrun);
int __wrap_cav_fixed_find(cav_fixed *fixed, const double (*centre)[3], const double (*root)[3], double margin,
                          const cav_run **run, int *nrun) {
  static cav_run whole;
  int always,
      count = __real_cav_fixed_find(fixed, (const double(*)[3])centre, (const double(*)[3])root, margin, run, nrun);
  cav_fixed_always(fixed, &always);
  asked++, clear += *nrun == 1 && (*run)->first == all_pairs;
  if (leaves_out == FAITHFUL) return count;
  whole = leaves_out == NOTHING ? (cav_run){0, all_pairs} : (cav_run){all_pairs, all_pairs + always};
  *run = &whole;
  *nrun = 1;
  return whole.end - whole.first;
}

static int find(cav_fixed *fixed, const double (*centre)[3], const double (*root)[3], double margin,
                const cav_run **run, int *nrun) {
  return __real_cav_fixed_find(fixed, (const double(*)[3])centre, (const double(*)[3])root, margin, run, nrun);
}

enum { RUNS = 20000 };

// runs of pairs themselves, where they follow behind all
static int unfold(const cav_fixed *fixed, int npair, const cav_run *run, int nrun, cav_run *list) {
  int count, n = 0;
  const int *always = cav_fixed_always(fixed, &count);
  for (int r = 0; r < nrun; r++) {
    if (run[r].first < npair) {
      list[n++] = run[r];
      continue;
    }
    CHECK(nrun == 1 && run[r].first == npair && run[r].end == npair + count);
    for (int i = 0; i < count; i++) list[n++] = (cav_run){always[i], always[i] + 1};
  }
  return n;
}

enum { BALLS = 120 };

// every pair of balls that is near is in a run; far away none is, at the edge some are
static void test_blocks(void) {
  static double centre[BALLS][3], radius[BALLS];
  static int tree[BALLS];
  static const double reach[] = {1.2, INFINITY, 1.2};
  double root[3][3];
  static cav_sweep_pair pair[BALLS * BALLS];
  int npair = 0, most = 0, least = 0;
  for (int i = 0; i < BALLS; i++) {
    tree[i] = i < BALLS / 2 ? -1 : i % 3;
    radius[i] = uniform(0.05, 0.3);
    for (int k = 0; k < 3; k++) centre[i][k] = uniform(-5, 5);
  }
  for (int i = 0; i < BALLS; i++)
    for (int j = 0; j < i; j++)
      if (tree[i] != tree[j]) pair[npair++] = (cav_sweep_pair){i % 2 ? j : i, i % 2 ? i : j};
  pair[7].first = -1;
  cav_fixed *fixed = cav_fixed_new(BALLS, (const double(*)[3])centre, radius, tree, reach, npair, pair);
  if (!CHECK(fixed && cav_fixed_pays(fixed))) return;
  for (int pose = 0; pose < 400; pose++) {
    double far = pose == 0 ? 1e3 : uniform(0, 8), margin = uniform(0, 0.2);
    for (int t = 0; t < 3; t++)
      for (int k = 0; k < 3; k++) root[t][k] = far * (t - 1) * (k + 1) / 3;
    for (int i = 0; i < BALLS; i++)
      for (int k = 0; k < 3 && tree[i] >= 0; k++) centre[i][k] = root[tree[i]][k] + uniform(-0.5, 0.5);
    const cav_run *run;
    cav_run list[RUNS];
    int nrun, at = 0, missed = 0, listed = 0,
              count = find(fixed, (const double(*)[3])centre, (const double(*)[3])root, margin, &run, &nrun);
    nrun = unfold(fixed, npair, run, nrun, list);
    for (int r = 0; r < nrun; r++) {
      CHECK(list[r].first < list[r].end && list[r].end <= npair && (r == 0 || list[r].first >= list[r - 1].end));
      listed += list[r].end - list[r].first;
    }
    CHECK(listed == count);
    for (int p = 0; p < npair; p++) {
      while (at < nrun && list[at].end <= p) at++;
      int in = at < nrun && list[at].first <= p;
      double d[3], sum = radius[pair[p].second] + margin;
      if (pair[p].first < 0) missed += !in;
      if (in || pair[p].first < 0) continue;
      sub3(d, centre[pair[p].first], centre[pair[p].second]);
      sum += radius[pair[p].first];
      missed += dot3(d, d) < sum * sum;
    }
    CHECK(missed == 0);
    most = count > most ? count : most;
    if (pose == 0) least = count;
  }
  // one tree stays at the origin, two are a kilometre off
  CHECK(least < 0.51 * npair && most > least);
  cav_fixed_free(fixed);
}

// one ball beside another along each axis: listed if nearer than the margin by ten nanometres, left out if farther; by boxes, by
// the reach from a root 0.4 m behind, and by what is known from a place a little and far away
static void test_edge(void) {
  const double radius[] = {0.1, 0.2}, from[3] = {3, -20, 500};
  const int tree[] = {-1, 0};
  const cav_sweep_pair pair = {0, 1};
  double centre[2][3], root[1][3];
  memcpy(centre[0], from, sizeof from);
  for (int kind = 0; kind < 4; kind++) {
    double reach = kind == 0 ? INFINITY : 0.2 + 0.4;
    cav_fixed *fixed = cav_fixed_new(2, (const double(*)[3])centre, radius, tree, &reach, 1, &pair);
    if (!CHECK(fixed != NULL)) return;
    for (int side = 0; side < 12; side++) {
      double off = side / 6 ? 1e-8 : -1e-8, distance = 0.1 + 0.2 + 0.05 + off, sign = side / 3 % 2 ? 1 : -1;
      const cav_run *run;
      int nrun, k = side % 3;
      for (int before = kind > 1; before >= 0; before--) {
        double away = distance + before * (kind == 2 ? 1e-7 : 300);
        memcpy(centre[1], from, sizeof from);
        centre[1][k] += sign * away;
        copy3(root[0], centre[1]);
        root[0][k] += sign * 0.4;
        CHECK(find(fixed, (const double(*)[3])centre, (const double(*)[3])root, 0.05, &run, &nrun) ==
              (off < 0 && !before));
      }
    }
    cav_fixed_free(fixed);
  }
}

// a chain that is folded at rest, with the anchor of its second joint off its link: stretched it reaches 0.3 m to the anchor,
// 0.2 m to the link's frame and 1.05 m on; its root slides. A ball of 0.02 m at its end, the others out of the way
static cav_model *chain(double gap) {
  static char text[20000];
  int n = snprintf(text, sizeof text,
                   "<mujoco><worldbody><body><joint type='slide' axis='1 0 0'/><joint axis='0 1 0'/>"
                   "<geom type='sphere' size='.02' mass='1'/><body pos='0 0 .1' euler='0 180 0'>"
                   "<joint axis='0 1 0' pos='0 0 -.2'/><geom type='sphere' size='.05' pos='0 0 1' mass='1'/>"
                   "</body></body><geom type='sphere' size='.02' pos='0 0 %.12f'/>",
                   1.57 + gap);
  for (int i = 0; i < 60; i++)
    n += snprintf(text + n, sizeof text - (size_t)n, "<geom type='sphere' size='.02' pos='0 0 %d'/>", 5 + i);
  snprintf(text + n, sizeof text - (size_t)n, "</worldbody></mujoco>");
  return scene_load(text);
}

// contacts of the stretched chain as it comes from afar
static int touched(double gap) {
  int contacts = 0;
  cav_model *model = chain(gap);
  cav_state *state = model ? cav_state_new(model) : NULL;
  if (CHECK(state && model->nq == 3 && model->npair > 100)) {
    all_pairs = model->npair;
    const double from[] = {30, 1, 1e-7, 0};
    for (int i = 0; i < 4; i++) {
      CHECK(cav_position(model, state, (double[]){from[i], 0, 3.14159265358979323846}) == CAV_OK);
      CHECK(state->ncontact == 0 || i > 1);
      contacts = state->ncontact;
    }
  }
  cav_state_free(state);
  cav_model_free(model);
  return contacts;
}

static void test_stretched(void) {
  asked = clear = 0;
  CHECK(touched(-1e-8) == 1 && touched(1e-8) == 0);
  // far away, and where the box about the balls meets no block
  CHECK(asked == 8 && clear >= 4);
  shrink = 0.9;
  CHECK(touched(-1e-8) == 0);
  shrink = 1;
}

// every shape that stands, in a ring of some metres
static int write_standing(char *text, size_t room) {
  static const char *const shape[] = {"sphere' size='.3",      "capsule' size='.2 .3",      "box' size='.2 .3 .1",
                                      "cylinder' size='.2 .3", "ellipsoid' size='.2 .3 .1",
#ifdef CAVORT_HAVE_CCD
                                      "mesh' mesh='m"
#endif
  };
  const int kinds = (int)(sizeof shape / sizeof *shape);
  int n = snprintf(text, room,
                   "<mujoco><asset><mesh name='m' vertex='0 0 0 .4 0 0 0 .4 0 0 0 .4 .3 .3 .3'/>"
                   "<hfield name='h' nrow='2' ncol='3' size='1 1 .5 .2' elevation='0 1 2  3 4 5'/></asset><worldbody>"
                   "<geom type='plane' size='9 9 1' pos='0 0 -1'/><geom type='hfield' hfield='h' pos='5 0 -1'/>");
  for (int i = 0; i < 60; i++) {
    double angle = 0.1 * i, far = uniform(4, 6);
    n +=
        snprintf(text + n, room - (size_t)n, "<geom type='%s' margin='%.2f' pos='%.2f %.2f %.2f' euler='%.0f %.0f 0'/>",
                 shape[i % kinds], fmax(0, uniform(-0.1, 0.1)), far * cos(angle), far * sin(angle), uniform(-1, 3),
                 uniform(-90, 90), uniform(-90, 90));
  }
  return n;
}

// what moves there: with a free root, with one that slides and turns in a plane and slides farther down, with one that
// stands on a ball joint; and so many balls more
static cav_model *playground(int balls) {
  static char text[40000];
  int n = write_standing(text, sizeof text);
  n += snprintf(
      text + n, sizeof text - (size_t)n,
      "<body pos='0 0 2'><freejoint/><geom type='box' size='.1 .2 .1'/><body pos='.3 0 0' euler='0 90 0'>"
      "<joint axis='0 1 0' pos='-.1 .2 0'/><joint axis='1 1 0' pos='0 .1 .1'/>"
      "<geom type='capsule' size='.05 .2' pos='.3 0 0'/><body pos='.3 .3 .1'><joint type='ball' pos='-.2 0 0'/>"
      "<geom type='ellipsoid' size='.1 .2 .1' pos='0 0 .3' margin='.05'/></body></body></body>"
      "<body pos='-2 0 1'><joint type='slide' axis='1 0 0'/><joint type='slide' axis='0 0 1'/><joint axis='0 1 0'/>"
      "<geom type='cylinder' size='.1 .2'/><body pos='.3 0 0'><joint type='slide' axis='1 0 0'/>"
      "<geom type='sphere' size='.1' pos='.2 0 0'/></body></body>"
      "<body pos='1 1 0'><joint type='ball'/><geom type='capsule' size='.05' fromto='0 0 0 0 0 1'/>"
      "<body pos='0 0 1'><joint axis='1 0 0' pos='0 .2 0'/><geom type='box' size='.1 .1 .4' pos='0 0 .4'/>"
      "</body></body>");
  for (int i = 0; i < balls; i++)
    n += snprintf(text + n, sizeof text - (size_t)n,
                  "<body pos='0 .%d 3'><freejoint/><geom type='sphere' size='.2'/></body>", i);
  snprintf(text + n, sizeof text - (size_t)n, "</worldbody></mujoco>");
  return scene_load(text);
}

// whether two states have the same contacts in the same order, to the bit
static int alike(const cav_state *a, const cav_state *b) {
  int same = a->ncontact == b->ncontact;
  for (int k = 0; same && k < a->ncontact; k++) {
    const cav_contact *x = a->contact + k, *y = b->contact + k;
    same = x->pair == y->pair && x->feature == y->feature && x->dist == y->dist &&
           !memcmp(x->pos, y->pos, sizeof x->pos) && !memcmp(x->frame, y->frame, sizeof x->frame);
  }
  return same;
}

// walks of small steps, and jumps between them
static void wander(const cav_model *model, int pose, double *q, double *move) {
  scene_normals(move, model->nv, pose % 40 ? 0.03 : 1.5);
  if (pose % 200 == 0) memcpy(q, model->q0, sizeof *q * (size_t)model->nq);
  cav_integrate(model, q, move, 1, q);
}

static void test_playground(int balls) {
  cav_model *model = playground(balls);
  cav_state *state[3] = {0};
  for (int i = 0; model && i < 3; i++) state[i] = cav_state_new(model);
  if (!CHECK(state[2] != NULL)) return;
  double *q = scene_vector(model->nq), *move = scene_vector(model->nv);
  int contacts = 0, wrong = 0, lost = 0, poses = 2000;
  all_pairs = model->npair;
  asked = clear = 0;
  for (int pose = 0; pose < poses; pose++) {
    wander(model, pose, q, move);
    for (int i = 0; i < 3; i++) {
      cav_options *o = &state[i]->options;
      o->smoothing = pose % 3 == 1 ? 0.02 : 0;
      o->smoothing_self = pose % 3 == 1 ? 0.001 : 0;
      o->stabilisation = pose % 5 < 2 ? CAV_STABILISATION_DISCRETE : CAV_STABILISATION_SOLREF;
      leaves_out = i == 0 ? FAITHFUL : i == 1 ? NOTHING : EVERYTHING;
      CHECK(cav_position(model, state[i], q) == CAV_OK);
    }
    contacts += state[0]->ncontact;
    wrong += !alike(state[0], state[1]);
    lost += !alike(state[2], state[1]);
  }
  printf(
      "%d pairs, %d trees: %.1f contacts a pose, of %d poses %d touch what stands, %d are "
      "known not to\n",
      model->npair, 3 + balls, (double)contacts / poses, poses, lost, clear / 3);
  CHECK(wrong == 0);
  CHECK(lost > poses / 20 && (balls || clear > 3 * poses / 20) && contacts > poses);
  leaves_out = FAITHFUL;
  free(q), free(move);
  for (int i = 0; i < 3; i++) cav_state_free(state[i]);
  cav_model_free(model);
}

int main(void) {
  test_blocks();
  test_edge();
  test_stretched();
  test_playground(0);
  test_playground(9);
  return check_result();
}
