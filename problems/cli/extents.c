/// Where surfaces end at a posture, for cavort inspect: least and greatest x, y, z of what can touch of bodies that have a role,
/// of bodies that no actuator moves, and of geoms of the world. Planes and height fields have no end and are left out.
#include "extent.h"

#include <math.h>
#include <stdio.h>

#include "command.h"
#include "file.h"
#include "problem_file.h"
#include "role.h"

/// A box along the axes of the world around some geoms, m.
typedef struct extent {
  double low[3], high[3];
} extent;

static int can_touch(const cav_model *m, int geom) {
  int touches = 0;
  for (int p = 0; p < m->npair; p++) touches |= m->pair[p].geom1 == geom || m->pair[p].geom2 == geom;
  return touches;
}

// whether a geom is on a body or on what is fixed to it
static int is_of(const cav_model *m, int geom, int body) {
  int b = m->geom[geom].body;
  if (m->body[body].link == 0) return b == body;
  while (b > 0 && b != body && m->body[b].link == m->body[body].link) b = m->body[b].parent;
  return b == body;
}

// widens an extent by a geom; 0: it has no end or touches nothing
static int widen(const cav_model *m, const cav_state *state, int geom, extent *e) {
  const cav_geom_type type = m->geom[geom].type;
  cav_pose at;
  if (type == CAV_GEOM_PLANE || type == CAV_GEOM_HFIELD || !can_touch(m, geom)) return 0;
  cav_object_pose(m, state, CAV_OBJECT_GEOM, geom, &at);
  for (int k = 0; k < 3; k++) {
    double way[3] = {0};
    way[k] = 1;
    e->high[k] = fmax(e->high[k], at.pos[k] + cav_geom_reach(m, geom, &at, way));
    way[k] = -1;
    e->low[k] = fmin(e->low[k], at.pos[k] - cav_geom_reach(m, geom, &at, way));
  }
  return 1;
}

/// The table while it is printed.
typedef struct table {
  const cav_model *model;
  cav_state *state;
  const char *when;
  int moved; ///< 1: without what is fixed to the world
  int rows;
} table;

static double plain(double x) { return fabs(x) < 5e-4 ? 0 : x; }

// a row of one geom, or else of a body; nothing where none of it can touch
static void print_row(table *t, const char *name, int body, int geom, const char *what) {
  const cav_model *m = t->model;
  extent e = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
  int n = 0;
  for (int g = 0; g < m->ngeom; g++)
    if (geom < 0 ? is_of(m, g, body) : g == geom) n += widen(m, t->state, g, &e);
  if (!n) return;
  if (!t->rows++)
    printf("%-20s least and greatest x, y, z in the world at the %s, of what can touch\n", "surfaces, m", t->when);
  printf("  %-18s", *name ? name : "(no name)");
  for (int k = 0; k < 3; k++) printf(" %8.3f ..%7.3f", plain(e.low[k]), plain(e.high[k]));
  printf("%s%s\n", *what ? "   " : "", what);
}

static void print_roles(table *t, const cav_roles *roles) {
  for (cav_role r = 0; r < CAV_ROLE_TYPES; r++)
    if (roles->body[r] >= 0)
      print_row(t, cav_role_name(r), roles->body[r], roles->geom[r], t->model->body[roles->body[r]].name);
}

// what no actuator moves and has no role; what is fixed to it is of it
static void print_things(table *t, const cav_roles *roles) {
  const cav_model *m = t->model;
  for (int b = 1; b < m->nbody; b++) {
    const cav_link *link = &m->link[m->body[b].link];
    const int fixed = m->body[b].link == 0;
    int told = !fixed && (link->driven || link->body != b);
    for (cav_role r = 0; r < CAV_ROLE_TYPES; r++) told |= roles->body[r] == b;
    if (!told && !(fixed && t->moved)) print_row(t, m->body[b].name, b, -1, fixed ? "fixed to the world" : "");
  }
  char words[CAV_WORDS];
  for (int g = 0; g < m->ngeom && !t->moved; g++)
    if (m->geom[g].body == 0) print_row(t, cav_geom_words(m, g, words), 0, g, "geom of the world");
}

// the table at a posture; moved: of what has a role or is a thing alone, as the world stays
static cav_status print_table(const cav_model *m, const cav_roles *roles, cav_state *state, const double *q,
                              const char *when, int moved) {
  table t = {.model = m, .state = state, .when = when, .moved = moved};
  cav_status status = cav_position(m, state, q);
  if (status) return status;
  print_roles(&t, roles);
  print_things(&t, roles);
  if (t.rows) printf("\n");
  return CAV_OK;
}

cav_status cav_command_print_extents(const cav_model *m, const cav_problem *p, cav_error *error) {
  cav_state *state = cav_state_new(m);
  cav_roles roles;
  cav_status status = state ? cav_roles_find(m, state, &roles) : CAV_NO_MEMORY;
  if (!status) status = print_table(m, &roles, state, p ? p->q_start : m->q0, p ? "start" : "posture of the file", 0);
  if (!status && p && cav_problem_has_goal(p)) status = print_table(m, &roles, state, p->q_goal, "goal", 1);
  if (status) cav_file_fail(error, status, 0, "where surfaces end cannot be evaluated");
  cav_state_free(state);
  return status;
}
