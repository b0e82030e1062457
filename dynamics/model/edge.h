/// Edges of boxes of the world, on which what stands there tips. Private to optim/.
#ifndef CAVORT_EDGE_H
#define CAVORT_EDGE_H

#include "cavort/dynamics.h"

/// Which faces of boxes of the world are open: where another box of the world or a plane begins at once beyond a face, as
/// at the back of a step, its edges are none.
typedef struct cav_edges cav_edges;

/// NULL: no memory. cav_edges_any: whether there is an open face. edge.c.
cav_edges *cav_edges_new(const cav_model *model);
int cav_edges_any(const cav_edges *edges, const cav_model *model);
void cav_edges_free(cav_edges *edges);

/// Whether a pair is with a box of the world that has such a face: of contacts of others the nearness is 0. edges: NULL for none.
int cav_edges_of_pair(const cav_model *model, const cav_edges *edges, const cav_pair *pair);

/// How near a contact of the model is to an edge of a box of the world: 1 within 5 mm, 0 beyond 3 cm (of narrower boxes half
/// of their width), with a continuous derivative; at a corner the sum of its edges. 0 of other contacts. gradient [3]: by
/// the position of the contact, 1/m; may be NULL. edge.c.
double cav_edge_nearness(const cav_model *model, const cav_edges *edges, const cav_contact *contact,
                         double gradient[3]);

#endif
