/// How near contacts are to edges of boxes of the world. Along each axis of a box the depth of a point under the nearer of two
/// faces gives a number from 1 at the face to 0 inside; near an edge two of them are not zero, and their product is the
/// nearness. Depths at which it begins and ends are those that a certificate allows and the width of a narrow foot.
#include "edge.h"

#include <stdlib.h>

#include "math3.h"

struct cav_edges {
  unsigned char (*open)[6]; ///< [ngeom] faces of boxes of the world: 2 of an axis, of its lower and upper end
};

// m: depths between which the nearness of an edge falls; distance at which what stands beside a face is looked for
static const double WHOLE = 0.005, FADES = 0.03, BESIDE = 0.01;
// parts of a face's half sizes at which is looked, both ways
static const double SAMPLE[] = {-0.9, -0.3, 0.3, 0.9};

// whether a point of the world is inside a box of it or under a plane
static int is_inside(const cav_geom *geom, const double x[3]) {
  double d[3], local[3];
  sub3(d, x, geom->pos);
  rotate_back(local, geom->rotation, d);
  if (geom->type == CAV_GEOM_PLANE) return local[2] <= 0;
  for (int k = 0; k < 3; k++)
    if (fabs(local[k]) > geom->size[k]) return 0;
  return 1;
}

static int stands(const cav_geom *geom) {
  return geom->link == 0 && (geom->contype || geom->conaffinity) &&
         (geom->type == CAV_GEOM_BOX || geom->type == CAV_GEOM_PLANE);
}

static int is_covered(const cav_model *m, const cav_geom *box, const double local[3]) {
  double x[3];
  transform(x, box->pos, box->rotation, local);
  for (int i = 0; i < m->ngeom; i++)
    if (&m->geom[i] != box && stands(&m->geom[i]) && is_inside(&m->geom[i], x)) return 1;
  return 0;
}

// whether something of the face is not covered
static int is_open(const cav_model *m, const cav_geom *box, int axis, int upper) {
  const int n = sizeof SAMPLE / sizeof *SAMPLE, a = (axis + 1) % 3, b = (axis + 2) % 3;
  for (int i = 0; i < n * n; i++) {
    double local[3];
    local[axis] = (upper ? 1 : -1) * (box->size[axis] + BESIDE);
    local[a] = SAMPLE[i % n] * box->size[a];
    local[b] = SAMPLE[i / n] * box->size[b];
    if (!is_covered(m, box, local)) return 1;
  }
  return 0;
}

cav_edges *cav_edges_new(const cav_model *model) {
  cav_edges *edges = calloc(1, sizeof *edges);
  if (edges) edges->open = calloc((size_t)model->ngeom + 1, sizeof *edges->open);
  if (!edges || !edges->open) {
    cav_edges_free(edges);
    return NULL;
  }
  for (int i = 0; i < model->ngeom; i++) {
    const cav_geom *box = &model->geom[i];
    for (int k = 0; k < 6 && stands(box) && box->type == CAV_GEOM_BOX; k++)
      edges->open[i][k] = (unsigned char)is_open(model, box, k / 2, k % 2);
  }
  return edges;
}

int cav_edges_any(const cav_edges *edges, const cav_model *model) {
  int any = 0;
  for (int i = 0; i < 6 * model->ngeom; i++) any |= edges->open[i / 6][i % 6];
  return any;
}

void cav_edges_free(cav_edges *edges) {
  if (edges) free(edges->open);
  free(edges);
}

// the geom of a pair that is of the world
static int world_geom(const cav_model *model, const cav_pair *pair) {
  return model->geom[pair->geom1].link == 0 ? pair->geom1 : pair->geom2;
}

int cav_edges_of_pair(const cav_model *model, const cav_edges *edges, const cav_pair *pair) {
  const int index = world_geom(model, pair);
  int any = 0;
  for (int k = 0; edges && k < 6; k++) any |= edges->open[index][k];
  return any && model->geom[index].link == 0 && model->geom[index].type == CAV_GEOM_BOX;
}

double cav_edge_nearness(const cav_model *model, const cav_edges *edges, const cav_contact *contact,
                         double gradient[3]) {
  const int index = world_geom(model, &model->pair[contact->pair]);
  const cav_geom *box = &model->geom[index];
  if (gradient) set3(gradient, 0, 0, 0);
  if (box->link != 0 || box->type != CAV_GEOM_BOX) return 0;
  double d[3], local[3], part[3], rate[3];
  sub3(d, contact->pos, box->pos);
  rotate_back(local, box->rotation, d);
  for (int k = 0; k < 3; k++) {
    const int upper = local[k] > 0;
    const double fades = fmin(FADES, box->size[k]), whole = fmin(WHOLE, fades / 4);
    const double t = (box->size[k] - fabs(local[k]) - whole) / (fades - whole), s = fmin(fmax(t, 0), 1);
    const int open = edges->open[index][2 * k + upper];
    part[k] = open ? 1 - s * s * (3 - 2 * s) : 0;
    rate[k] = open ? (upper ? 6 : -6) * s * (1 - s) / (fades - whole) : 0;
  }
  if (gradient) {
    const double by[3] = {rate[0] * (part[1] + part[2]), rate[1] * (part[0] + part[2]), rate[2] * (part[0] + part[1])};
    rotate(gradient, box->rotation, by);
  }
  return part[0] * part[1] + part[0] * part[2] + part[1] * part[2];
}
