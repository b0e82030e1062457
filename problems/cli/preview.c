/// cavort view PROBLEM: what a solve would start from, before anything is solved: start, guess and goal, how deep each is in
/// what, a proof that the problem cannot be solved if there is one, and a page that plays the guess and ends with the goal.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "file.h"
#include "page.h"
#include "view.h"

/// The deepest contact of some postures.
typedef struct penetration {
  double depth; ///< m, 0: none
  int knot, pair;
} penetration;

/// What a contact is with: a plane, another solid of the world, another tree, or a link of the same tree or mechanism.
enum { PLANE, SOLID, TREE, LINK, KINDS };

static int kind_of(const cav_model *m, const cav_contact *c) {
  const cav_pair *pair = &m->pair[c->pair];
  if (m->geom[pair->geom1].type == CAV_GEOM_PLANE || m->geom[pair->geom2].type == CAV_GEOM_PLANE) return PLANE;
  return c->link1 == 0 || c->link2 == 0 ? SOLID : pair->external ? TREE : LINK;
}

// the deepest contact of each kind
static cav_status note_depths(const cav_model *m, cav_state *state, const double *q, int knot, penetration p[KINDS]) {
  cav_status status = cav_position(m, state, q);
  for (int i = 0; i < state->ncontact && !status; i++) {
    const cav_contact *c = &state->contact[i];
    penetration *of = &p[kind_of(m, c)];
    if (-c->dist > of->depth) *of = (penetration){-c->dist, knot, c->pair};
  }
  return status;
}

static cav_status note_depth(const cav_model *m, cav_state *state, const double *q, int knot, penetration *p) {
  penetration of[KINDS] = {{0}};
  cav_status status = note_depths(m, state, q, knot, of);
  for (int k = 0; k < KINDS; k++)
    if (of[k].depth > p->depth) *p = of[k];
  return status;
}

// "2.1 mm: 'a' in 'b'"
static void tell(const cav_model *m, const penetration *p, double timestep, int when, char *out, size_t size) {
  char a[CAV_WORDS], b[CAV_WORDS], time[40] = "";
  if (p->depth < 1e-6) {
    snprintf(out, size, "inside nothing");
    return;
  }
  if (when) snprintf(time, sizeof time, " at %.4g s", p->knot * timestep);
  cav_command_pair(m, p->pair, a, b);
  snprintf(out, size, "deepest %.3g mm%s: '%.60s' in '%.60s'", 1e3 * p->depth, time, a, b);
}

void cav_command_tell_guess(FILE *out, const cav_problem *p, int whole) {
  // m; that of solids is where solve begins over them
  static const double deep[KINDS] = {[PLANE] = 0.02, [SOLID] = 0.01, [TREE] = 0.02, [LINK] = 0.02};
  // and what solve does there
  static const char *const told[KINDS][2] = {
      [SOLID] = {"the guess runs into a solid",
                 "solve begins over or round it or, where this fails, looks for such a way,"},
      [TREE] = {"bodies of the guess run into each other",
                "solve begins so, and contacts that are soft at first part them;"},
      [LINK] = {"links of the guess run into each other",
                "solve begins so, and its first stages let links of one body through each other (self_stiffness);"}};
  cav_error ignored = {0};
  penetration ends = {0}, waypoints = {0}, way[KINDS] = {{0}};
  char text[200];
  if (!p->nguess_pose && !whole) return;
  cav_state *state = cav_state_new(p->model);
  cav_trajectory *guess = cav_problem_guess(p, &ignored);
  cav_status status = state && guess ? CAV_OK : CAV_NO_MEMORY;
  if (!status) status = note_depth(p->model, state, p->q_start, 0, &ends);
  if (!status) status = note_depth(p->model, state, p->q_goal, 0, &ends);
  for (int k = 0; !status && k < p->nguess_pose; k++) {
    const int t = (int)lround(p->guess_pose[k].time / p->timestep);
    if (t < guess->nknot) status = note_depth(p->model, state, guess->q + (size_t)t * (size_t)guess->nq, t, &waypoints);
  }
  for (int t = 0; !status && t < guess->nknot && whole; t++)
    status = note_depths(p->model, state, guess->q + (size_t)t * (size_t)guess->nq, t, way);
  int kind = SOLID;
  while (kind < KINDS && !(way[kind].depth > fmax(deep[kind], ends.depth))) kind++;
  if (!status && waypoints.depth > fmax(deep[PLANE], ends.depth)) {
    tell(p->model, &waypoints, p->timestep, 1, text, sizeof text);
    fprintf(out, "note: a waypoint of the guess is inside something, %s; cavort view PROBLEM shows it\n", text);
  } else if (!status && kind < KINDS) {
    tell(p->model, &way[kind], p->timestep, 1, text, sizeof text);
    fprintf(out, "note: %s, %s (cavort view PROBLEM shows it): %s or give <waypoint>s\n", told[kind][0], text,
            told[kind][1]);
  }
  cav_trajectory_free(guess);
  cav_state_free(state);
}

void cav_command_tell_begin(FILE *out, const char *indent, const cav_strategy *first) {
  if (!first->hand && first->stated) return;
  fprintf(out, "%s%s: begun %s\n", indent,
          first->hand      ? "the file has no <guess>, and no term of it brings a hand to what has to be moved"
          : first->met > 0 ? "the file has no <guess>, and the straight way of what has to move leads off at once"
          : first->nreach
              ? "the file has no <goal>, and the straight way to what is asked for at the end runs into something"
              : "the straight way from start to goal runs into a solid or the ground, or turns feet where "
                "they stand, and no "
                "waypoint of a <guess> leads otherwise",
          first->text);
}

// FILE.view.html, in the folder of the command
static char *page_path(const char *operand) {
  const char *slash = strrchr(operand, '/'), *name = slash ? slash + 1 : operand;
  size_t length = strlen(name);
  if (length > 4 && !strcmp(name + length - 4, ".xml")) length -= 4;
  char *path = malloc(length + 11);
  if (path) sprintf(path, "%.*s.view.html", (int)length, name);
  return path;
}

static cav_status write_page(const char *path, const cav_problem *p, const cav_trajectory *guess, char text[3][200],
                             const cav_impossibility *cause, cav_error *error) {
  const cav_model *m = p->model;
  size_t size = (size_t)guess->nknot * (size_t)m->nq, nq = (size_t)m->nq;
  double *q = malloc((size + nq) * sizeof *q);
  if (!q) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the page");
  char undrawn[CAV_PAGE_UNDRAWN];
  cav_model *drawn = cav_page_drawn(p, undrawn);
  memcpy(q, guess->q, size * sizeof *q);
  memcpy(q + size, p->q_goal, nq * sizeof *q);
  int nline = 4;
  cav_view_line line[6] = {{"before solving", "the guess; the last picture is the goal", -1},
                           {"start", text[0], -1},
                           {"guess", text[1], -1},
                           {"goal", text[2], -1}};
  if (cause) line[nline++] = (cav_view_line){"impossible", cause->what, 0};
  if (*undrawn) line[nline++] = (cav_view_line){"drawn", undrawn, -1};
  char title[340];
  snprintf(title, sizeof title, "%.140s on %.140s, before solving", p->name, m->name);
  cav_view_input input = {.model = m,
                          .drawn = drawn,
                          .title = title,
                          .label = p->name,
                          .nknot = guess->nknot + 1,
                          .timestep = guess->timestep,
                          .q = q,
                          .nline = nline,
                          .line = line};
  cav_status status = cav_view_write(path, 1, &input, error);
  cav_model_free(drawn);
  free(q);
  return status;
}

int cav_command_preview(const cav_command_line *line) {
  cav_error error = {0};
  cav_problem *p = cav_problem_load(line->operand, line->model, &error);
  if (!p) return cav_command_fail(&error);
  penetration deepest[3] = {0};
  char text[3][200];
  cav_impossibility cause;
  int proofs = 0;
  cav_state *state = cav_state_new(p->model);
  cav_trajectory *guess = cav_problem_guess(p, &error);
  char *path = page_path(line->operand);
  cav_status status = guess ? CAV_OK : error.status;
  if (!status && !(state && path)) status = cav_file_fail(&error, CAV_NO_MEMORY, 0, "no memory for the page");
  if (!status) status = note_depth(p->model, state, p->q_start, 0, &deepest[0]);
  for (int t = 0; !status && t < guess->nknot; t++)
    status = note_depth(p->model, state, guess->q + (size_t)t * (size_t)guess->nq, t, &deepest[1]);
  if (!status) status = note_depth(p->model, state, p->q_goal, 0, &deepest[2]);
  if (status && !*error.text) cav_file_fail(&error, status, 0, "a posture of the problem cannot be evaluated");
  if (!status) status = cav_problem_impossible(p, &cause, 1, &proofs, &error);
  for (int i = 0; i < 3 && !status; i++) tell(p->model, &deepest[i], p->timestep, i == 1, text[i], sizeof text[i]);
  if (!status && !line->quiet) {
    if (proofs) printf("impossible: %s\n  %s\n", cause.what, cause.cure);
    printf("start: %s\nguess: %s\ngoal:  %s\n", text[0], text[1], text[2]);
  }
  if (!status) status = write_page(path, p, guess, text, proofs ? &cause : NULL, &error);
  char *full = status ? NULL : realpath(path, NULL);
  if (full && !line->quiet) printf("open in a browser: file://%s\n", full);
  free(full);
  free(path);
  cav_trajectory_free(guess);
  cav_state_free(state);
  cav_problem_free(p);
  return status ? cav_command_fail(&error) : 0;
}
