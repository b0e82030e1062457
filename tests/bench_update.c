/// Whether the forward step's factors should be updated between Newton's iterations instead of made anew: heaps of boxes
/// that settle in a tray, islands of 60 dofs and more. For each refactoring after the first of a step and island: how
/// many blocks changed their curvature since the one before, the rank of these changes, what CHOLMOD takes for a numeric
/// factorisation, and what it would for updates of that rank (cholmod_updown on rows of the same blocks, put back
/// afterwards; splitting the changes into such rows is not counted). Usage: bench_update [BOXES...]
#include "bench.h"
#include "hessian.h"
#include "workspace.h"

#ifndef CAVORT_HAVE_CHOLMOD
int main(void) {
  printf("skipped: built without CHOLMOD\n");
  return CHECK_SKIPPED;
}
#else
#include <suitesparse/cholmod.h>

enum { TRIED = 8, MOST = 4096 };
static const int smallest = 60; // dofs of an island that counts

cav_status __real_cav_hessian_begin(cav_hessian *, const cav_impulse *, int, const int *, const int *);
cav_status __real_cav_hessian_factor(cav_hessian *, const double *);
cav_status __wrap_cav_hessian_begin(cav_hessian *, const cav_impulse *, int, const int *, const int *);
cav_status __wrap_cav_hessian_factor(cav_hessian *, const double *);

static struct {
  const cav_impulse *part;
  int ndof;
  const int *dof, *local;
  int factors; // of this island in this step
  double *before;
  size_t room;
} now;

// what was found at each refactoring
static struct {
  int on, n;
  double changed[MOST], rank[MOST], blocks[MOST], dofs[MOST], factor[MOST], update[MOST], ratio[MOST];
} found;

static double factoring, stepping; // time in factors, and in steps not looked into, s

static double seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// rank of the difference of two symmetric matrices, by elimination with full pivoting
static int rank_of(const double *a, const double *b, int n) {
  double d[CAV_CURVATURE], scale = 0;
  int rank = 0;
  for (int i = 0; i < n * n; i++) d[i] = a[i] - b[i], scale = fmax(scale, fmax(fabs(a[i]), fabs(b[i])));
  for (; rank < n; rank++) {
    int row = rank, column = rank;
    for (int i = rank; i < n; i++)
      for (int j = rank; j < n; j++)
        if (fabs(d[i * n + j]) > fabs(d[row * n + column])) row = i, column = j;
    if (!(fabs(d[row * n + column]) > 1e-9 * scale)) break;
    for (int j = 0; j < n; j++) {
      double swap = d[row * n + j];
      d[row * n + j] = d[rank * n + j], d[rank * n + j] = swap;
    }
    for (int i = 0; i < n; i++) {
      double swap = d[i * n + column];
      d[i * n + column] = d[i * n + rank], d[i * n + rank] = swap;
    }
    for (int i = rank + 1; i < n; i++) {
      double ratio = d[i * n + rank] / d[rank * n + rank];
      for (int j = rank; j < n; j++) d[i * n + j] -= ratio * d[rank * n + j];
    }
  }
  return rank;
}

// the island's matrix with curvature, its lower triangle, zeros of its structure left out
static cholmod_sparse *matrix_of(const double *curvature, cholmod_common *common) {
  const cav_impulse *p = now.part;
  const cav_workspace *work = p->state->work;
  const int n = now.ndof;
  double *A = calloc((size_t)n * (size_t)n, sizeof *A);
  char *in = calloc((size_t)n * (size_t)n, 1);
  for (int e = 0; e < n; e++)
    for (int j = now.dof[e], k = 0; j >= 0; j = work->parent[j], k++) {
      A[e * n + now.local[j]] = p->M[work->row[now.dof[e]] + k];
      in[e * n + now.local[j]] = 1;
    }
  for (int b = 0; b < p->nblock; b++) {
    const cav_block *block = &p->block[b];
    const double *H = curvature + CAV_CURVATURE * b;
    for (int i = 0; i < block->ndof; i++)
      for (int j = 0; j < block->ndof; j++) {
        const int r = now.local[block->dof[i]], c = now.local[block->dof[j]];
        double sum = 0;
        for (int k = 0; k < block->dim; k++)
          for (int l = 0; l < block->dim; l++)
            sum += block->J[k * block->ndof + i] * H[k * block->dim + l] * block->J[l * block->ndof + j];
        if (r < c) continue;
        A[r * n + c] += sum;
        in[r * n + c] = 1;
      }
  }
  size_t entries = 0;
  for (size_t i = 0; i < (size_t)n * (size_t)n; i++) entries += (size_t)in[i];
  cholmod_sparse *m = cholmod_allocate_sparse((size_t)n, (size_t)n, entries, 1, 1, -1, CHOLMOD_REAL, common);
  int *start = m->p, *row = m->i, at = 0;
  for (int j = 0; j < n; j++) {
    start[j] = at;
    for (int i = j; i < n; i++)
      if (in[i * n + j]) row[at] = i, ((double *)m->x)[at++] = A[i * n + j];
  }
  start[n] = at;
  free(A), free(in);
  return m;
}

// rows of a block as columns, small, in the factor's order
static cholmod_sparse *rows_of(const cav_block *block, const cholmod_factor *L, cholmod_common *common) {
  const size_t n = L->n;
  cholmod_sparse *C =
      cholmod_allocate_sparse(n, (size_t)block->dim, (size_t)(block->dim * block->ndof), 1, 1, 0, CHOLMOD_REAL, common);
  int *place = malloc(n * sizeof *place), *start = C->p, *row = C->i, at = 0;
  for (size_t i = 0; i < n; i++) place[((int *)L->Perm)[i]] = (int)i;
  for (int k = 0; k < block->dim; k++) {
    start[k] = at;
    for (int d = 0; d < block->ndof; d++, at++) {
      int i = place[now.local[block->dof[d]]], slot = at;
      for (; slot > start[k] && row[slot - 1] > i; slot--)
        row[slot] = row[slot - 1], ((double *)C->x)[slot] = ((double *)C->x)[slot - 1];
      row[slot] = i;
      ((double *)C->x)[slot] = 0.1 * block->J[k * block->ndof + d];
    }
  }
  start[block->dim] = at;
  free(place);
  return C;
}

// time of a factor, and of an update of rank 1 as part of one block's, s
static void measure(const double *curvature, const int *changed, int n, double *factor, double *update) {
  cholmod_common common;
  cholmod_start(&common);
  common.supernodal = CHOLMOD_SIMPLICIAL;
  common.nmethods = 1;
  common.method[0].ordering = CHOLMOD_AMD;
  cholmod_sparse *A = matrix_of(curvature, &common);
  cholmod_factor *L = cholmod_analyze(A, &common);
  double begin = seconds();
  CHECK(cholmod_factorize(A, L, &common));
  *factor = seconds() - begin;
  double spent = 0;
  int rank = 0;
  for (int k = 0; k < n && k < TRIED; k++) {
    const cav_block *block = &now.part->block[changed[k * n / (n < TRIED ? n : TRIED)]];
    cholmod_sparse *C = rows_of(block, L, &common);
    begin = seconds();
    CHECK(cholmod_updown(1, C, L, &common));
    spent += seconds() - begin;
    rank += block->dim;
    CHECK(cholmod_updown(0, C, L, &common));
    cholmod_free_sparse(&C, &common);
  }
  *update = spent / rank;
  cholmod_free_factor(&L, &common);
  cholmod_free_sparse(&A, &common);
  cholmod_finish(&common);
}

cav_status __wrap_cav_hessian_begin(cav_hessian *h, const cav_impulse *part, int ndof, const int *dof,
                                    const int *local) {
  now.part = part, now.ndof = ndof, now.dof = dof, now.local = local, now.factors = 0;
  return __real_cav_hessian_begin(h, part, ndof, dof, local);
}

cav_status __wrap_cav_hessian_factor(cav_hessian *h, const double *curvature) {
  const size_t size = (size_t)now.part->nblock * CAV_CURVATURE;
  if (found.on && now.ndof >= smallest) {
    int *changed = malloc(((size_t)now.part->nblock + 1) * sizeof *changed), n = 0, rank = 0;
    for (int b = 0; now.factors > 0 && b < now.part->nblock; b++) {
      const double *a = curvature + CAV_CURVATURE * b, *before = now.before + CAV_CURVATURE * b;
      const int r = rank_of(a, before, now.part->block[b].dim);
      if (r > 0) changed[n++] = b;
      rank += r;
    }
    if (now.factors++ > 0 && n > 0 && found.n < MOST) {
      const int k = found.n++;
      double update;
      measure(curvature, changed, n, &found.factor[k], &update);
      found.changed[k] = (double)n / now.part->nblock, found.rank[k] = rank, found.blocks[k] = now.part->nblock;
      found.dofs[k] = now.ndof, found.update[k] = update, found.ratio[k] = rank * update / found.factor[k];
    }
    if (size > now.room) now.before = realloc(now.before, (now.room = 2 * size) * sizeof *now.before);
    memcpy(now.before, curvature, size * sizeof *curvature);
    free(changed);
  }
  const double begin = seconds();
  const cav_status status = __real_cav_hessian_factor(h, curvature);
  factoring += seconds() - begin;
  return status;
}

// what choosing the better of the two each time would take of all refactorings
static double best_of_both(void) {
  double best = 0, all = 0;
  for (int i = 0; i < found.n; i++) best += fmin(found.ratio[i], 1) * found.factor[i], all += found.factor[i];
  return best / all;
}

static double quantile(double *x, int n, double fraction) {
  qsort(x, (size_t)n, sizeof *x, bench_ascending);
  return x[(int)(fraction * (n - 1) + 0.5)];
}

// boxes above a tray
static cav_model *drop(int n) {
  char *text = malloc(2000 + 200 * (size_t)n), *to = text;
  const int side = (int)ceil(cbrt(n));
  const double half = 0.13 * side + 0.15, middle = 0.5 * (side - 1);
  to += sprintf(to, "<mujoco><option timestep='0.002'/><worldbody><geom type='plane' size='50 50 1'/>");
  for (int k = 0; k < 4; k++)
    to += sprintf(to, "<geom type='box' size='%g %g 2' pos='%g %g 2'/>", k < 2 ? 0.1 : half, k < 2 ? half : 0.1,
                  k < 2 ? half * (2 * k - 1) : 0.0, k < 2 ? 0.0 : half * (2 * k - 5));
  for (int i = 0; i < n; i++) {
    const double tilt = 40 * scene_uniform();
    to += sprintf(to, "<body pos='%g %g %g' euler='%g %g %g'><freejoint/><geom type='box' size='.1 .1 .1'/></body>",
                  0.26 * (i % side - middle) + 0.02 * scene_uniform(), 0.26 * (i / side % side - middle),
                  0.3 + 0.27 * (i / (side * side)), tilt, tilt, 3 * tilt);
  }
  sprintf(to, "</worldbody></mujoco>");
  cav_model *model = scene_load(text);
  free(text);
  return model;
}

static void follow(int n) {
  cav_model *model = drop(n);
  cav_state *state = model ? cav_state_new(model) : NULL;
  if (!CHECK(state != NULL)) return;
  double *q = scene_vector(model->nq), *v = scene_vector(3 * model->nv), *u = v + model->nv, *next = u + model->nv;
  memcpy(q, model->q0, (size_t)model->nq * sizeof *q);
  found.n = 0;
  factoring = stepping = 0;
  for (int step = 0; step < 300; step++) {
    found.on = step % 25 == 24;
    const double begin = seconds(), before = factoring;
    cav_status status = cav_forward(model, state, q, v, u, next);
    if (found.on) factoring = before;
    if (!found.on) stepping += seconds() - begin;
    if (!CHECK(status == CAV_OK || status == CAV_NOT_CONVERGED)) break;
    memcpy(v, next, (size_t)model->nv * sizeof *v);
    cav_integrate(model, q, v, model->timestep, q);
  }
  if (found.n > 0) {
    const double best = best_of_both(), share = factoring / stepping;
    int paid = 0;
    for (int i = 0; i < found.n; i++) paid += found.ratio[i] < 1;
    printf(
        "%4d boxes: %4d refactorings, median of %4.0f dofs and %5.0f blocks; changed %3.0f %% of blocks "
        "(quartiles "
        "%.0f, %.0f), rank %4.0f\n",
        n, found.n, quantile(found.dofs, found.n, 0.5), quantile(found.blocks, found.n, 0.5),
        100 * quantile(found.changed, found.n, 0.5), 100 * quantile(found.changed, found.n, 0.25),
        100 * quantile(found.changed, found.n, 0.75), quantile(found.rank, found.n, 0.5));
    printf(
        "    factor %.3f ms, update %.4f ms a rank: updating takes %.1f (%.1f, %.1f) of refactoring; less in %d of "
        "%d;\n"
        "    the better each time %.2f; all factoring is %.2f of a step\n",
        1e3 * quantile(found.factor, found.n, 0.5), 1e3 * quantile(found.update, found.n, 0.5),
        quantile(found.ratio, found.n, 0.5), quantile(found.ratio, found.n, 0.25), quantile(found.ratio, found.n, 0.75),
        paid, found.n, best, share);
  } else {
    printf("%4d boxes: no island of %d dofs was factored twice in a step\n", n, smallest);
  }
  fflush(stdout);
  cav_state_free(state), cav_model_free(model);
  free(q), free(v);
}

int main(int argc, char **argv) {
  const int usual[] = {30, 100, 200};
  for (int i = 0; i < (argc > 1 ? argc - 1 : 3); i++) {
    const int n = argc > 1 ? atoi(argv[i + 1]) : usual[i];
    follow(n);
  }
  return check_result();
}
#endif
