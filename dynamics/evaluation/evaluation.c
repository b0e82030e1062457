/// Evaluations of the inverse put by. A trajectory that a solver steps to has been evaluated before it is linearised,
/// and derivatives read poses, motions, contacts and rows alone, of which a state has a quarter of its memory: a state
/// for each knot would take what a thread keeps warm (geoms, lists of work, derivatives) from its cache. Numbers are
/// copied; contacts and rows, most of what there is, change hands.
#include "evaluation.h"

#include <stdlib.h>
#include <string.h>

#include "constraint.h"
#include "half_step.h"
#include "options.h"
#include "step.h"

/// Numbers of the state's block that are kept: some that follow each other there.
typedef struct stretch {
  void *at;
  size_t bytes;
} stretch;

enum { STRETCHES = 7 };

struct cav_evaluation {
  int kept; ///< 0: nothing
  cav_options options;
  int ncontact, nrow, nequality, narrowed, contact_room, row_room, law_room;
  double discrete_damping, discrete_stiffness;
  cav_contact *contact;
  cav_row *row;
  double *law;            ///< of the contacts
  double *q;              ///< [nq] as it was given: the state's has unit quaternions
  char *numbers;          ///< of the stretches
  size_t bytes;           ///< room for them
  cav_next_contact *next; ///< of the contacts, after the step
  int next_room;
};

static stretch between(void *from, const void *to) { return (stretch){from, (size_t)((char *)to - (char *)from)}; }

static int takes_half_steps(const cav_options *o) { return o->order == CAV_ORDER_MOMENTUM; }

// what follows each other in the layout of a state (state.c), and of what it has for some options, which is there; the bytes of
// all. What is scratch is left out, as are velocities that contacts were not sought for
static size_t list_stretches(const cav_model *model, cav_state *state, int narrowed, stretch s[STRETCHES]) {
  const cav_workspace *w = state->work;
  size_t bytes = 0;
  s[0] = between(state->link, w->q + model->nq);
  s[1] = between(state->velocity, w->acceleration + 6 * (size_t)model->nlink);
  s[2] = between(state->tendon_length, state->tendon_arm + model->ntendon_dof);
  s[3] = between(state->equality,
                 w->bias ? (void *)(w->bias + 6 * (size_t)model->nlink) : (void *)(state->equality + model->nequality));
  s[4] = between(w->narrow_v, w->narrow_v + (narrowed ? 2 * model->nv : 0));
  s[5] = s[6] = (stretch){0};
  if (takes_half_steps(&state->options))
    s[5] = between(w->half_steps->before.com, w->half_steps->before.com + w->half_steps->evaluated);
  if (cav_looks_ahead(&state->options)) s[6] = between(w->next->link, w->next->by_q);
  for (int i = 0; i < STRETCHES; i++) bytes += s[i].bytes;
  return bytes;
}

static cav_evaluation *evaluation_new(const cav_model *model) {
  cav_evaluation *e = calloc(1, sizeof *e);
  if (!e) return NULL;
  e->q = malloc((size_t)(model->nq + 1) * sizeof(double));
  if (e->q) return e;
  free(e);
  return NULL;
}

void cav_evaluation_free(cav_evaluation *e) {
  if (!e) return;
  free(e->contact), free(e->row), free(e->law), free(e->q), free(e->numbers), free(e->next);
  free(e);
}

// an array with room for as many items as another one, what it has may be lost; 0 if memory runs out
static int make_room(void **items, int *room, int most, size_t size) {
  if (*room >= most) return 1;
  free(*items);
  *items = malloc((size_t)most * size);
  *room = *items ? most : 0;
  return *items != NULL;
}

// room for as many numbers, contacts and rows as the state has, so that none is made again and again as they change hands
static int make_rooms(cav_evaluation *e, const cav_state *state, size_t bytes) {
  const cav_workspace *w = state->work;
  void *contact = e->contact, *row = e->row, *next = e->next;
  const int next_room = cav_looks_ahead(&state->options) ? w->next->room : 0;
  const int made = make_room(&contact, &e->contact_room, w->contact_room, sizeof *e->contact) &&
                   make_room(&row, &e->row_room, w->row_room, sizeof *e->row) &&
                   make_room(&next, &e->next_room, next_room, sizeof *e->next);
  e->contact = contact, e->row = row, e->next = next;
  if (!made || e->bytes >= bytes) return made;
  free(e->numbers);
  e->numbers = malloc(bytes);
  e->bytes = e->numbers ? bytes : 0;
  return e->numbers != NULL;
}

// contacts and rows with their rooms from the one to the other and back
static void exchange(cav_evaluation *e, cav_state *state) {
  const cav_evaluation had = *e;
  cav_workspace *w = state->work;
  e->contact = state->contact, e->contact_room = w->contact_room;
  e->row = state->row, e->row_room = w->row_room;
  e->law = w->law, e->law_room = w->law_room;
  state->contact = had.contact, w->contact_room = had.contact_room;
  state->row = had.row, w->row_room = had.row_room;
  w->law = had.law, w->law_room = had.law_room;
  if (!cav_looks_ahead(&state->options)) return;
  e->next = w->next->contact, e->next_room = w->next->room;
  w->next->contact = had.next, w->next->room = had.next_room;
}

// whether what is kept here is all that an evaluation leaves
static int is_plain(const cav_options *o) { return !o->coupled && o->regulariser != CAV_REGULARISER_EXACT; }

void cav_evaluation_swap_hints(cav_state *state, cav_hint **hints) {
  cav_hint **own = cav_contacts_hints(state), *found;
  if (!own) return;
  if (!*hints) *hints = calloc((size_t)state->model->npair, sizeof **hints);
  if (!*hints) return;
  found = *own;
  *own = *hints;
  *hints = found;
}

void cav_evaluation_keep(cav_evaluation **evaluation, cav_state *state, const double *q, const double *v,
                         const double *v_next) {
  const cav_model *model = state->model;
  cav_workspace *w = state->work;
  stretch s[STRETCHES];
  if (*evaluation) (*evaluation)->kept = 0;
  const size_t nv = (size_t)model->nv;
  if (!is_plain(&state->options) || !cav_state_evaluated(state) || memcmp(w->v, v, nv * sizeof(double)) ||
      memcmp(w->v_next, v_next, nv * sizeof(double)))
    return;
  if (!*evaluation) *evaluation = evaluation_new(model);
  cav_evaluation *e = *evaluation;
  if (!e || !make_rooms(e, state, list_stretches(model, state, 1, s))) return;
  char *to = e->numbers;
  list_stretches(model, state, w->narrowed, s);
  for (int i = 0; i < STRETCHES; to += s[i++].bytes)
    if (s[i].bytes) memcpy(to, s[i].at, s[i].bytes);
  if (model->nq) memcpy(e->q, q, (size_t)model->nq * sizeof *q);
  exchange(e, state);
  e->options = w->options;
  e->ncontact = state->ncontact, e->nrow = state->nrow, e->nequality = state->nequality, e->narrowed = w->narrowed;
  e->discrete_damping = w->discrete_damping, e->discrete_stiffness = w->discrete_stiffness;
  e->kept = 1;
  state->ncontact = state->nrow = state->nequality = 0;
  w->valid = CAV_STAGE_NONE;
}

int cav_evaluation_take(cav_evaluation *e, cav_state *state, const double *q, const double *v, const double *v_next) {
  const cav_model *model = state->model;
  cav_workspace *w = state->work;
  const size_t nq = (size_t)model->nq, nv = (size_t)model->nv;
  stretch s[STRETCHES];
  if (!e || !e->kept || !cav_options_same(&state->options, &e->options, CAV_STAGE_VELOCITY)) return 0;
  if (takes_half_steps(&state->options) && cav_half_steps_new(model, state) != CAV_OK) return 0;
  if (cav_looks_ahead(&state->options) && cav_next_knot_new(model, state) != CAV_OK) return 0;
  list_stretches(model, state, e->narrowed, s);
  // its own velocities lie where the state's do
  const char *motion = e->numbers + s[0].bytes;
  const size_t of_v = (size_t)((char *)w->v - (char *)s[1].at), of_next = (size_t)((char *)w->v_next - (char *)s[1].at);
  if (memcmp(e->q, q, nq * sizeof *q) || memcmp(motion + of_v, v, nv * sizeof *v) ||
      memcmp(motion + of_next, v_next, nv * sizeof *v_next))
    return 0;
  const char *from = e->numbers;
  for (int i = 0; i < STRETCHES; from += s[i++].bytes)
    if (s[i].bytes) memcpy(s[i].at, from, s[i].bytes);
  exchange(e, state);
  state->ncontact = e->ncontact, state->nrow = e->nrow, state->nequality = e->nequality;
  w->narrowed = e->narrowed;
  w->discrete_damping = e->discrete_damping, w->discrete_stiffness = e->discrete_stiffness;
  w->options = e->options;
  if (takes_half_steps(&state->options)) w->half_steps->fresh = 1, w->half_steps->timestep = state->options.timestep;
  w->valid = CAV_STAGE_VELOCITY;
  w->derived = 0;
  e->kept = 0;
  return 1;
}
