/// Elimination of M + J' H J (elimination.c): what it solves, times the matrix written out in full, is the right-hand side, for a
/// tree whose branches constraints join in every order, a body beside it, and a long chain. Blocks see dofs that stand apart
/// in their branch, several of them the same ones; some do not bend, some by a million times the inertia of a link.
#include "elimination.h"
#include "lanes.h"
#include "scene.h"

enum { STRIDE = 36, BLOCKS = 12, MOST = 100 };

// four arms on a free body, a body beside it, a chain of links
static cav_model *load(int links) {
  static char text[1 << 16];
  char *to = text + sprintf(text, "<mujoco><worldbody><body pos='0 0 1'><freejoint/><geom size='.1'/>");
  for (int arm = 0; arm < 4; arm++) {
    for (int k = 0; k < 3; k++)
      to += sprintf(to, "<body pos='.1 %g .2'><joint type='hinge' axis='%d 1 .3'/><geom size='.05' pos='0 0 .1'/>",
                    0.1 * arm, k);
    to += sprintf(to, "</body></body></body>");
  }
  to += sprintf(to, "</body><body pos='3 0 1'><freejoint/><geom type='box' size='.1 .2 .3'/></body>");
  for (int k = 0; k < links; k++)
    to += sprintf(to, "<body pos='.1 %d .2'><joint type='hinge' axis='%d 1 .3'/><geom size='.05' pos='0 0 .1'/>",
                  5 * !k, k % 3);
  for (int k = 0; k < links; k++) to += sprintf(to, "</body>");
  sprintf(to, "</worldbody></mujoco>");
  return scene_load(text);
}

static int bent, told; ///< draws whose last block bends, and those that its curvature is missed in

static double fraction(void) { return 0.5 + 0.5 * scene_uniform(); }

// dofs of a block, now and then in no order: of some links' branches, of one and another, or any
static int draw_dofs(const cav_model *model, int b, int *dof) {
  int n = 0;
  const int apart = b % 3 == 0, first = (int)(fraction() * model->nv), second = (int)(fraction() * model->nv);
  for (int i = model->nv - 1; i >= 0; i--) {
    int of_first = 0, of_second = 0;
    for (int j = first; j >= 0; j = model->dof[j].parent) of_first |= i == j;
    for (int j = second; j >= 0; j = model->dof[j].parent) of_second |= i == j;
    if (apart ? i == first || i == second : of_first || of_second) dof[n++] = i;
  }
  for (int i = 0; i < n && b % 4 == 1; i++) {
    const int other = (int)(fraction() * n), held = dof[i];
    dof[i] = dof[other], dof[other] = held;
  }
  return n;
}

// right-hand side minus the full matrix times x, over the largest term of each sum
static double residual(const cav_impulse *p, const double *H, const double *x, const double *b) {
  const int *row = p->state->work->row, *parent = p->state->work->parent;
  double most = 0, left[MOST], size[MOST];
  for (int i = 0; i < p->nv; i++) left[i] = b[i], size[i] = fabs(b[i]);
  for (int i = 0; i < p->nv; i++) {
    for (int j = i, k = 0; j >= 0; j = parent[j], k++) {
      const double M = p->M[row[i] + k];
      left[i] -= M * x[j], size[i] = fmax(size[i], fabs(M * x[j]));
      if (i != j) left[j] -= M * x[i], size[j] = fmax(size[j], fabs(M * x[i]));
    }
  }
  for (int k = 0; k < p->nblock; k++) {
    const cav_block *block = &p->block[k];
    double y[CAV_IMPULSE_DIM] = {0}, f[CAV_IMPULSE_DIM] = {0};
    for (int i = 0; i < block->dim; i++)
      for (int d = 0; d < block->ndof; d++) y[i] += block->J[i * block->ndof + d] * x[block->dof[d]];
    for (int i = 0; i < block->dim; i++)
      for (int j = 0; j < block->dim; j++) f[i] += H[STRIDE * k + i * block->dim + j] * y[j];
    for (int i = 0; i < block->dim; i++) {
      for (int d = 0; d < block->ndof; d++) {
        const double term = block->J[i * block->ndof + d] * f[i];
        left[block->dof[d]] -= term, size[block->dof[d]] = fmax(size[block->dof[d]], fabs(term));
      }
    }
  }
  for (int i = 0; i < p->nv; i++) most = fmax(most, fabs(left[i]) / size[i]);
  return most;
}

// one draw of blocks and curvatures; x [nv] their solution
static void draw(cav_elimination *e, cav_impulse *p, double *x) {
  static cav_block block[BLOCKS];
  static int dof[BLOCKS * MOST], all[MOST], clique[BLOCKS];
  static double J[BLOCKS * CAV_IMPULSE_DIM * MOST], H[BLOCKS * STRIDE];
  static const int dims[] = {3, 1, 3, 6, 4};
  double b[MOST];
  memset(H, 0, sizeof H);
  p->block = block;
  p->nblock = (int)(fraction() * (BLOCKS + 1));
  for (int k = 0, cliques = 0; k < p->nblock; k++) {
    const int same = k > 0 && fraction() < 0.3, dim = dims[(int)(fraction() * 5)];
    block[k] = (cav_block){.dim = dim, .dof = dof + k * MOST, .J = J + k * CAV_IMPULSE_DIM * MOST};
    if (same) memcpy(dof + k * MOST, dof + (k - 1) * MOST, MOST * sizeof *dof);
    block[k].ndof = same ? block[k - 1].ndof : draw_dofs(p->model, k, dof + k * MOST);
    cliques += !same;
    clique[k] = cliques - 1;
    for (int i = 0; i < dim * block[k].ndof; i++) J[k * CAV_IMPULSE_DIM * MOST + i] = scene_normal();
    // G G'
    double G[STRIDE], scale = k % 4 == 3 ? 0 : pow(10, 3 * fraction());
    for (int i = 0; i < dim * dim; i++) G[i] = scene_normal();
    for (int i = 0; i < dim * dim; i++)
      for (int j = 0; j < dim; j++) H[STRIDE * k + i] += scale * G[i / dim * dim + j] * G[i % dim * dim + j];
  }
  for (int i = 0; i < p->nv; i++) all[i] = i, x[i] = b[i] = scene_normal();
  CHECK(cav_elimination_begin(e, p, p->nv, all, all, clique) == CAV_OK);
  cav_elimination_factor(e, H, STRIDE);
  cav_elimination_solve(e, x);
  // the same bits by shorter vectors
  double shorter[MOST];
  memcpy(shorter, b, sizeof shorter);
  lanes_most = 2;
  cav_elimination_factor(e, H, STRIDE);
  cav_elimination_solve(e, shorter);
  lanes_most = 8;
  CHECK(!memcmp(x, shorter, (size_t)p->nv * sizeof *x));
  // seen 5e-10 where what is joined weighs a million times what it joins; the control: without one block
  CHECK_NEAR(residual(p, H, x, b), 0, 1e-8);
  if (p->nblock == 0 || block[p->nblock - 1].ndof == 0) return;
  double *last = H + STRIDE * (p->nblock - 1), bends = 0;
  for (int i = 0; i < STRIDE; i++) bends += fabs(last[i]), last[i] = 0;
  if (bends == 0) return;
  bent++;
  told += residual(p, H, x, b) > 1e-6;
}

static void test_links(int links) {
  cav_model *model = load(links);
  if (!CHECK(model != NULL && model->nv <= MOST)) return;
  cav_state *state = cav_state_new(model);
  cav_elimination *e = cav_elimination_new();
  const int entries = state->work->row[model->nv];
  double *M = scene_vector(entries), *L = scene_vector(entries), *x = scene_vector(model->nv);
  CHECK(cav_position(model, state, model->q0) == CAV_OK);
  cav_step_inertia(model, state, M);
  CHECK(cav_ldl_factor(model, state->work, M, L));
  cav_impulse p = {.model = model, .state = state, .nv = model->nv, .M = M, .L = L};
  for (int k = 0; k < 300; k++) draw(e, &p, x);
  CHECK(cav_elimination_bytes(e) > 0);
  free(M), free(L), free(x);
  cav_elimination_free(e);
  cav_state_free(state), cav_model_free(model);
}

int main(void) {
  test_links(0);
  test_links(3);
  test_links(70); // sets of more than a word, rows of more than four fours
  // the control: without one block it is another solution
  printf("%d of %d missed\n", told, bent);
  CHECK(bent > 300 && told > 0.9 * bent);
  return check_result();
}
