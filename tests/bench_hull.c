/// Our hull against Qhull's on degenerate sets of points: failures, faults of hull_sets.h, time. Usage: bench_hull [SETS]
#include <time.h>

#include "hull_sets.h"

#ifdef CAVORT_HAVE_QHULL
#include <libqhull_r/qhull_ra.h>
#endif

enum { ENGINES = 4 };
static const char *const engines[ENGINES] = {"ours", "Qhull", "Qhull Qt", "Qhull QJ"};

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec * 1e6 + (double)t.tv_nsec * 1e-3;
}

/// Sums over the sets of a kind.
typedef struct tally {
  int sets, refused, open, euler, lost, inverted;
  double outside, above, time;
} tally;

#ifdef CAVORT_HAVE_QHULL
// corners of a facet counterclockwise from outside
static int facet_corners(qhT *qh, facetT *facet, const int *index, int *corner) {
  setT *vertices = qh_facet3vertex(qh, facet);
  vertexT *vertex, **vertexp;
  int n = 0;
  // Qhull lists them clockwise
  int count = qh_setsize(qh, vertices);
  FOREACHvertex_(vertices) corner[count - ++n] = index[qh_pointid(qh, vertex->point)];
  qh_settempfree(qh, &vertices);
  return n;
}

// Qhull's facets as a hull; neighbours are the ends of edges
static int convert(qhT *qh, int n, const double *point, cav_hull *h) {
  facetT *facet;
  vertexT *vertex;
  int *index = malloc(sizeof *index * (size_t)n), room = 0;
  FORALLfacets { room += qh_setsize(qh, facet->vertices) + 8; }
  h->vertex = malloc(sizeof(double) * 3 * (size_t)(qh->num_vertices + 1));
  h->plane = malloc(sizeof(double) * 4 * (size_t)(qh->num_facets + 1));
  h->face = calloc((size_t)qh->num_facets + 1, sizeof(int));
  h->corner = malloc(sizeof(int) * (size_t)room);
  h->neighbour_start = calloc((size_t)qh->num_vertices + 2, sizeof(int));
  h->neighbour = malloc(sizeof(int) * (size_t)(2 * room + 2));
  FORALLvertices {
    int id = qh_pointid(qh, vertex->point);
    index[id] = h->nvertex;
    copy3(h->vertex + 3 * h->nvertex++, point + 3 * id);
  }
  FORALLfacets {
    h->ncorner += facet_corners(qh, facet, index, h->corner + h->ncorner);
    copy3(h->plane + 4 * h->nface, facet->normal);
    h->plane[4 * h->nface + 3] = -facet->offset;
    h->face[++h->nface] = h->ncorner;
  }
  for (int v = 0; v < h->nvertex; v++) {
    for (int f = 0; f < h->nface; f++) {
      for (int k = h->face[f], m = h->face[f + 1] - k, i = 0; i < m; i++) {
        if (h->corner[k + i] == v) h->neighbour[h->nneighbour++] = h->corner[k + (i + 1) % m];
      }
    }
    h->neighbour_start[v + 1] = h->nneighbour;
  }
  free(index);
  return 1;
}

static int build_qhull(const char *flags, const double *point, int n, cav_hull *h, double *time) {
  char command[40];
  static FILE *silent;
  if (!silent) silent = fopen("/dev/null", "w");
  double *copy = malloc(sizeof *copy * 3 * (size_t)n);
  qhT qh_, *qh = &qh_;
  memcpy(copy, point, sizeof *copy * 3 * (size_t)n);
  snprintf(command, sizeof command, "qhull %s", flags);
  double start = now();
  qh_zero(qh, silent);
  int bad = qh_new_qhull(qh, 3, n, copy, False, command, silent, silent);
  *time += now() - start;
  if (!bad) convert(qh, n, point, h);
  int left, blocks;
  qh_freeqhull(qh, !qh_ALL);
  qh_memfreeshort(qh, &left, &blocks);
  free(copy);
  return !bad;
}
#endif

static int build(int engine, const double *point, int n, cav_hull *h, double *time) {
  *h = (cav_hull){.nvertex = 0};
#ifdef CAVORT_HAVE_QHULL
  static const char *const flags[ENGINES] = {"", "", "Qt", "QJ"};
  if (engine) return build_qhull(flags[engine], point, n, h, time);
#endif
  double start = now();
  int good = !engine && cav_hull_build(point, n, h) == CAV_OK;
  *time += now() - start;
  return good;
}

static void measure(int engine, const double *point, int n, tally *t) {
  cav_hull h;
  t->sets++;
  if (!build(engine, point, n, &h, &t->time)) {
    t->refused++;
    return;
  }
  hull_faults f = hull_judge(point, n, &h);
  t->open += f.open > 0;
  t->euler += f.euler > 0;
  t->lost += f.lost > 0;
  t->inverted += f.inverted > 0;
  t->outside = fmax(t->outside, f.outside);
  t->above = fmax(t->above, f.above);
  cav_hull_clear(&h);
}

static void print(const char *kind, int engine, const tally *t) {
  printf("| %-20s | %-8s | %5d | %5d | %5d | %5d | %5d | %5d | %7.1e | %7.1e | %6.0f |\n", kind, engines[engine],
         t->sets, t->refused, t->open, t->euler, t->inverted, t->lost, t->outside, t->above, t->time / t->sets);
}

int main(int argc, char **argv) {
  int sets = argc > 1 ? atoi(argv[1]) : 2000;
  static double point[3 * HULL_POINTS_MAX];
  tally all[ENGINES] = {{0}};
#ifdef CAVORT_HAVE_QHULL
  const int count = ENGINES;
#else
  const int count = 1;
  printf("built without Qhull: ours alone\n");
#endif
  printf(
      "| sets | engine | sets | refused | open | Euler | inward | lost | outside | above | us "
      "|\n|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  for (int kind = 0; kind < HULL_KINDS; kind++) {
    tally t[ENGINES] = {{0}};
    for (int k = 0; k < sets / HULL_KINDS; k++) {
      int n = hull_set(kind, point);
      for (int e = 0; e < count; e++) measure(e, point, n, &t[e]);
    }
    for (int e = 0; e < count; e++) {
      print(hull_kinds[kind], e, &t[e]);
      all[e] = (tally){all[e].sets + t[e].sets,
                       all[e].refused + t[e].refused,
                       all[e].open + t[e].open,
                       all[e].euler + t[e].euler,
                       all[e].lost + t[e].lost,
                       all[e].inverted + t[e].inverted,
                       fmax(all[e].outside, t[e].outside),
                       fmax(all[e].above, t[e].above),
                       all[e].time + t[e].time};
    }
    fflush(stdout);
  }
  for (int e = 0; e < count; e++) print("all", e, &all[e]);
  return EXIT_SUCCESS;
}
