/// Rows over (q_t, v_t, v_{t+1}) to rows over the three neighbouring knots, whose differences the velocities are; dofs of
/// rotations by the Jacobians of SO(3).
#include "knot.h"
#include "vectors.h"

cav_links cav_links_of(const cav_transcription *tr, int t) {
  int last = tr->nknot - 1, here = cav_knot_moves(tr, t), before = cav_knot_moves(tr, t - 1);
  int next = cav_knot_moves(tr, t + 1), held = !next && !tr->problem->close_at_rest; // v_{t+1} is v_t
  const double *now = tr->knot[t].rotation, *after = t < last ? tr->knot[t + 1].rotation : tr->rotation_after;
  double inverse = 1 / tr->options.timestep;
  cav_links l = {.before = now + 9, .here = now, .then = next ? after + 9 : now, .next = next ? after : now};
  l.q_here = here;
  l.v_here = here ? inverse : 0;
  l.v_before = here && before ? -inverse : 0;
  l.n_next = next ? inverse : 0;
  l.n_here = held ? inverse : next && here ? -inverse : 0;
  l.n_before = held && before ? -inverse : 0;
  return l;
}

_Static_assert(CAV_ROTATION_SIZE >= 19, "four numbers can be read from any row of either Jacobian");

// three components of a row times a rotation Jacobian; the fourth number says nothing
CAV_VECTOR_BODY void times_rotation(const double *row, const double *J, cav_four *out) {
  *out = row[0] * *(const cav_four *)J + row[1] * *(const cav_four *)(J + 3) + row[2] * *(const cav_four *)(J + 6);
}

/// Chains n rows and scales them; dofs of rotations are done again.
CAV_VECTOR_BODY void chain_rows_body(const cav_transcription *tr, const cav_links *l, int n, double scale,
                                     const double *dq, const double *dv, const double *dn, double *restrict out) {
  int nv = tr->nv;
  for (int i = 0; i < n; i++, dq += nv, dv += nv, dn += nv, out += 3 * nv) {
    for (int d = 0; d < nv; d++) out[d] = scale * (l->v_before * dv[d] + l->n_before * dn[d]);
    for (int d = 0; d < nv; d++) out[nv + d] = scale * (l->q_here * dq[d] + l->v_here * dv[d] + l->n_here * dn[d]);
    for (int d = 0; d < nv; d++) out[2 * nv + d] = scale * (l->n_next * dn[d]);
    for (int k = 0; k < tr->nrotation; k++) {
      int at = tr->rotation_dof[k], J = CAV_ROTATION_SIZE * k;
      const cav_four q = {dq[at], dq[at + 1], dq[at + 2], 0};
      cav_four v_before, n_before, v_here, n_here, n_next;
      times_rotation(dv + at, l->before + J, &v_before);
      times_rotation(dn + at, l->before + J, &n_before);
      times_rotation(dv + at, l->here + J, &v_here);
      times_rotation(dn + at, l->then + J, &n_here);
      times_rotation(dn + at, l->next + J, &n_next);
      v_before = scale * (l->v_before * v_before + l->n_before * n_before);
      v_here = scale * (l->q_here * q + l->v_here * v_here + l->n_here * n_here);
      n_next = scale * (l->n_next * n_next);
      for (int c = 0; c < 3; c++)
        out[at + c] = v_before[c], out[nv + at + c] = v_here[c], out[2 * nv + at + c] = n_next[c];
    }
  }
}

CAV_BY_VECTORS(chain_rows,
               (const cav_transcription *tr, const cav_links *l, int n, double scale, const double *dq,
                const double *dv, const double *dn, double *out),
               (tr, l, n, scale, dq, dv, dn, out))

void cav_links_chain(const cav_transcription *tr, const cav_links *links, int n, double scale, const double *dq,
                     const double *dv, const double *dn, double *out) {
  chain_rows(tr, links, n, scale, dq, dv, dn, out);
}

void cav_transcription_chain(const cav_transcription *tr, int t, int n, const double *row, double *out) {
  const cav_links links = cav_links_of(tr, t);
  for (int i = 0; i < n; i++, row += 3 * tr->nv, out += 3 * tr->nv)
    chain_rows(tr, &links, 1, 1, row, row + tr->nv, row + 2 * tr->nv, out);
}
