/// What of a state grows after it was made: contacts and scalar rows, one more at a time; and the release of what its
/// derivatives took.
#include <stdint.h>
#include <stdlib.h>

#include "derivative_store.h"
#include "workspace.h"

// an array of items with room for count + 1, doubled when full; NULL if memory runs out, the old one is kept
static void *grown(void *items, int count, int *room, size_t size) {
  if (count < *room) { return items; }
  if (*room > INT32_MAX / 2) { return NULL; }
  int more = *room > 0 ? 2 * *room : CAV_FIRST_ROOM;
  void *larger = realloc(items, (size_t)more * size);
  if (larger) { *room = more; }
  return larger;
}

cav_contact *cav_contact_push(cav_state *state) {
  cav_contact *contact = grown(state->contact, state->ncontact, &state->work->contact_room, sizeof *contact);
  if (!contact) { return NULL; }
  state->contact = contact;
  return &contact[state->ncontact++];
}

cav_row *cav_row_push(cav_state *state) {
  cav_row *row = grown(state->row, state->nrow, &state->work->row_room, sizeof *row);
  if (!row) { return NULL; }
  state->row = row;
  return &row[state->nrow++];
}

void cav_derivative_store_free(cav_derivative_store *derivatives) {
  if (!derivatives) return;
  free(derivatives->contact);
  free(derivatives->drift);
  free(derivatives->touched);
  free(derivatives);
}

size_t cav_derivative_store_bytes(const cav_derivative_store *store) {
  return store ? store->bytes + (size_t)store->room * sizeof *store->contact : 0;
}
