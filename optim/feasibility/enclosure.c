/// Targets that solids of the world enclose.
///
/// A geom that holds a ball of radius r about a point keeps that point out of what stands in the world, thickened by r. Of
/// a grid about the target the cells that one thickened solid covers as a whole are closed: a convex set covers a cell if
/// it holds its corners. Cells that hang together with the target's, by corners too, are all that the point could come
/// from; where they end before the grid does, and the start is not among them, it cannot come. Balls that are small
/// against the enclosure, and enclosures of ellipsoids, meshes or height fields, prove nothing.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/solve.h"
#include "feasibility.h"
#include "math3.h"
#include "objects.h"

enum { SIDE = 49 };                  // cells along each axis, the target's in the middle
static const double cell_size = 0.7; // of the ball's radius: gaps between solids that touch are closed
static const double most_cell = 0.1; // m

/// The grid, and the solids that stand about it.
typedef struct grid {
  double origin[3], cell;
  int nwall, room;
  int *wall; ///< geoms
  double radius;
  char *seen; ///< [SIDE^3]
  int *queue; ///< likewise
} grid;

/// Signed distance from a geom's surface, negative inside, in its axes; infinite for types that are not looked at.
static double distance_from(const cav_geom *g, const double x[3]) {
  const double *s = g->size;
  double out[3];
  switch (g->type) {
    case CAV_GEOM_SPHERE:
      return norm3(x) - s[0];
    case CAV_GEOM_CAPSULE:
      set3(out, x[0], x[1], x[2] - fmin(fmax(x[2], -s[1]), s[1]));
      return norm3(out) - s[0];
    case CAV_GEOM_CYLINDER: {
      double a = hypot(x[0], x[1]) - s[0], b = fabs(x[2]) - s[1];
      return fmax(a, b) < 0 ? fmax(a, b) : hypot(fmax(a, 0), fmax(b, 0));
    }
    case CAV_GEOM_BOX: {
      double most = -INFINITY;
      for (int k = 0; k < 3; k++) {
        out[k] = fmax(fabs(x[k]) - s[k], 0);
        most = fmax(most, fabs(x[k]) - s[k]);
      }
      return most < 0 ? most : norm3(out);
    }
    case CAV_GEOM_PLANE:
      return x[2];
    case CAV_GEOM_ELLIPSOID:
    case CAV_GEOM_MESH:
    case CAV_GEOM_HFIELD:
    case CAV_GEOM_TYPES:
      break;
  }
  return INFINITY;
}

static double distance_to(const cav_examination *e, int geom, const double point[3]) {
  cav_pose pose;
  double x[3];
  cav_object_pose(e->model, e->start, CAV_OBJECT_GEOM, geom, &pose);
  sub3(x, point, pose.pos);
  rotate_back(x, pose.rotation, x);
  return distance_from(&e->model->geom[geom], x);
}

/// Whether one thickened solid covers a cell.
static int is_closed(const cav_examination *e, const grid *g, const int at[3]) {
  double keep = g->radius - CAV_TOLERANCE_PENETRATION - 1e-3;
  for (int w = 0; w < g->nwall; w++) {
    int covered = 1;
    for (int corner = 0; corner < 8 && covered; corner++) {
      double x[3];
      for (int k = 0; k < 3; k++) x[k] = g->origin[k] + g->cell * (at[k] + (corner >> k & 1));
      covered = distance_to(e, g->wall[w], x) < keep;
    }
    if (covered) return 1;
  }
  return 0;
}

static int index_of(const int at[3]) { return (at[2] * SIDE + at[1]) * SIDE + at[0]; }

/// Fills what hangs together with the middle; 0 if that reaches the edge of the grid.
static int fill(const cav_examination *e, grid *g) {
  int middle[3] = {SIDE / 2, SIDE / 2, SIDE / 2}, n = 0;
  g->seen[index_of(middle)] = 1;
  g->queue[n++] = index_of(middle);
  for (int i = 0; i < n; i++) {
    int at[3] = {g->queue[i] % SIDE, g->queue[i] / SIDE % SIDE, g->queue[i] / (SIDE * SIDE)};
    for (int k = 0; k < 27; k++) {
      int next[3] = {at[0] + k % 3 - 1, at[1] + k / 3 % 3 - 1, at[2] + k / 9 - 1};
      for (int axis = 0; axis < 3; axis++)
        if (next[axis] < 0 || next[axis] >= SIDE) return 0;
      if (g->seen[index_of(next)] || is_closed(e, g, next)) continue;
      g->seen[index_of(next)] = 1;
      g->queue[n++] = index_of(next);
    }
  }
  return 1;
}

/// Solids of the world that the geom may touch.
static int gather_walls(const cav_model *m, int geom, grid *g) {
  for (int p = 0; p < m->npair; p++) {
    int a = m->pair[p].geom1, b = m->pair[p].geom2, wall = a == geom ? b : a;
    if ((a != geom && b != geom) || m->geom[wall].link != 0) continue;
    if (g->nwall == g->room) {
      int room = g->room ? 2 * g->room : 16, *larger = realloc(g->wall, sizeof(int) * (size_t)room);
      if (!larger) return 0;
      g->wall = larger;
      g->room = room;
    }
    g->wall[g->nwall++] = wall;
  }
  return 1;
}

/// Whether a point of the start is in what has been filled.
static int is_among(const grid *g, const double point[3]) {
  int at[3];
  for (int k = 0; k < 3; k++) {
    double place = floor((point[k] - g->origin[k]) / g->cell);
    if (!(place >= 0 && place < SIDE)) return 0;
    at[k] = (int)place;
  }
  return g->seen[index_of(at)];
}

static cav_status examine_geom(cav_examination *e, const cav_requirement *r, int geom) {
  const cav_model *m = e->model;
  const cav_geom *one = &m->geom[geom];
  grid g = {0};
  double x[3], start[3], wide = 0;
  sub3(x, r->point, one->pos);
  rotate_back(x, one->rotation, x);
  g.radius = one->type == CAV_GEOM_PLANE ? -1 : -distance_from(one, x);
  g.cell = fmin(cell_size * g.radius, most_cell);
  for (int k = 0; k < 3; k++) {
    g.origin[k] = (r->low[k] + r->high[k]) / 2 - g.cell * SIDE / 2;
    wide = fmax(wide, r->high[k] - r->low[k]);
  }
  // the target within its cell
  if (!(g.radius > 2 * CAV_TOLERANCE_PENETRATION) || !(wide < g.cell)) return CAV_OK;
  size_t cells = (size_t)SIDE * SIDE * SIDE;
  int ok = gather_walls(m, geom, &g);
  // a box without corners: at least four solids
  if (ok && g.nwall >= 4) {
    g.seen = calloc(cells, 1);
    g.queue = malloc(cells * sizeof *g.queue);
    ok = g.seen && g.queue;
    transform(start, e->start->link[r->object].pos, e->start->link[r->object].rotation, r->point);
    if (ok && fill(e, &g) && !is_among(&g, start)) {
      char what[160], name[CAV_WORDS];
      cav_requirement_words(e, r, what, sizeof what);
      cav_impossible(e, CAV_CONDITION_SOLID, r, "Open a way to the target, or start inside.",
                     "%s, but solids of the world enclose it, and geom '%.100s' does not fit between them", what,
                     cav_geom_words(m, geom, name));
    }
  }
  free(g.wall), free(g.seen), free(g.queue);
  return ok ? CAV_OK : CAV_NO_MEMORY;
}

cav_status cav_examine_enclosures(cav_examination *e) {
  cav_status status = CAV_OK;
  int before = e->nfound, known = -1;
  if (!cav_start_is_given(e->problem)) return CAV_OK;
  for (int i = 0; i < e->n && !status; i++) {
    const cav_requirement *r = &e->requirement[i];
    // one knot of each term
    if (r->kind != CAV_REQUIRE_POINT || r->object == 0 || r->term == known || r->knot == 0) continue;
    known = r->term;
    for (int g = 0; g < e->model->ngeom && !status && e->nfound == before; g++)
      if (e->model->geom[g].link == r->object) status = examine_geom(e, r, g);
    if (e->nfound > before) break;
  }
  return status;
}
