/// cavort inspect: what a model holds, what an evaluation of it runs and leaves out and why; for a problem also its
/// terms and schedule in words. Counts come from the compiled model, times from running it. Solves nothing.
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "file.h"
#include "objects.h"
#include "plannable.h"
#include "problem_file.h"
#include "quantity.h"
#include "sense.h"
#include "stand.h"
#include "step.h"

static const char *const geom_name[] = {"plane",    "sphere", "capsule", "ellipsoid",
                                        "cylinder", "box",    "mesh",    "height field"};
static const char *const joint_name[] = {"free", "ball", "slide", "hinge"};

static void print_sizes(const cav_model *m) {
  int tree = 0, things = 0, driven = 0;
  double mass = 0;
  for (int i = 1; i < m->nlink; i++) {
    tree += m->link[i].parent == 0;
    *(m->link[i].driven ? &driven : &things) = 1;
    mass += m->link[i].driven ? m->link[i].mass : 0;
  }
  printf("model %s\n", m->name[0] ? m->name : "without a name");
  printf("  positions %d, velocities %d, controls %d, mass %.4g kg", m->nq, m->nv, m->nu, m->mass);
  if (things && driven) printf(", %.4g of it what actuators move", mass);
  printf(", step %g s, gravity %g %g %g m/s^2\n", m->timestep, m->gravity[0], m->gravity[1], m->gravity[2]);
  printf("  %d bodies in %d moving links in %d tree%s, %d geoms, %d sites, %d sensors, %d keyframes, %.1f kB\n",
         m->nbody - 1, m->nlink - 1, tree, tree == 1 ? "" : "s", m->ngeom, m->nsite, m->nsensor, m->nkey,
         (double)m->bytes / 1024);
}

// the range of a joint
static void write_range(const cav_joint *joint, char text[120]) {
  const double scale = joint->type == CAV_JOINT_SLIDE ? 1 : 180 / M_PI;
  int n = 0;
  *text = 0;
  if (joint->limited && joint->type == CAV_JOINT_BALL) n += sprintf(text, "up to %.3g deg", scale * joint->range[1]);
  if (joint->twist_limited)
    n += sprintf(text + n, "%stwist %.3g..%.3g deg", n ? " " : "", scale * joint->twist[0], scale * joint->twist[1]);
  if (joint->swing_limited) n += sprintf(text + n, "%sswing up to %.3g deg", n ? " " : "", scale * joint->swing);
  if (joint->limited && joint->type != CAV_JOINT_BALL)
    sprintf(text + n, "%.3g..%.3g %s", scale * joint->range[0], scale * joint->range[1],
            joint->type == CAV_JOINT_SLIDE ? "m" : "deg");
}

// "x y z" of an object in a posture that the state is at: what a framepos of it reads
static void print_place(const cav_model *m, cav_state *state, cav_object_type type, int object) {
  const cav_sensor place = {.name = "", .type = CAV_SENSOR_FRAMEPOS, .object_type = type, .object = object, .dim = 3};
  double at[3];
  cav_sensor_read(m, state, &place, at);
  for (int k = 0; k < 3; k++) printf(" %8.3f", fabs(at[k]) < 5e-4 ? 0 : at[k]);
}

// Where bodies and sites are at the posture of the file, or at the start and the goal of a problem: the numbers that targets of
// framepos are written beside
static cav_status print_places(const cav_model *m, const cav_problem *p, cav_error *error) {
  const double *posture[] = {p ? p->q_start : m->q0, p ? p->q_goal : NULL};
  const int n = p ? 2 : 1;
  cav_state *state[2] = {0};
  cav_status status = CAV_OK;
  for (int i = 0; i < n && !status; i++) {
    state[i] = cav_state_new(m);
    status = state[i] ? cav_position(m, state[i], posture[i]) : CAV_NO_MEMORY;
  }
  if (status) cav_file_fail(error, status, 0, "places of bodies cannot be evaluated");
  if (!status)
    printf("%-20s %s; of bodies the centre of mass\n", "places, m",
           p ? "x, y, z in the world at the start, at the goal" : "x, y, z in the world at the posture of the file");
  for (int k = 1; k < m->nbody + m->nsite && !status; k++) {
    const int site = k - m->nbody;
    const char *name = site >= 0 ? m->site[site].name : m->body[k].name;
    printf("  %-18s", *name ? name : "(no name)");
    for (int i = 0; i < n; i++) {
      print_place(m, state[i], site >= 0 ? CAV_OBJECT_SITE : CAV_OBJECT_BODY, site >= 0 ? site : k);
      if (i + 1 < n) printf("   ");
    }
    printf(site >= 0 ? "   site\n" : "\n");
  }
  printf("\n");
  for (int i = 0; i < n; i++) cav_state_free(state[i]);
  return status;
}

static void print_bodies(const cav_model *m) {
  int width = 20;
  for (int i = 1; i < m->nbody; i++) width = (int)fmax(width, fmin((double)strlen(m->body[i].name), 40));
  printf("%-*s %-*s %8s  %s\n", width, "body", width, "on", "kg", "joints");
  for (int i = 1; i < m->nbody; i++) {
    const cav_body *body = &m->body[i];
    const cav_link *link = &m->link[body->link];
    printf("%-*s %-*s %8.4g  ", width, body->name[0] ? body->name : "(no name)", width,
           body->parent > 0 ? m->body[body->parent].name : "world", body->mass);
    if (body->link == 0) printf("fixed to the world");
    if (body->link > 0 && link->body != i) printf("fixed to %s", m->body[link->body].name);
    for (int j = link->joint; body->link > 0 && link->body == i && j < link->joint + link->njoint; j++)
      printf("%s%s", j > link->joint ? ", " : "", m->joint[j].name[0] ? m->joint[j].name : "(no name)");
    printf("\n");
  }
  printf("\n");
}

// what actuators can give along a dof where the state is, N or N m; nothing where none moves it. Returns whether one of them
// moves other dofs, too
static int write_effort(const cav_model *m, cav_state *state, int dof, const char *unit, double *moment,
                        char text[60]) {
  double most[2] = {0, 0};
  int shared = 0;
  *text = 0;
  for (int i = 0; i < m->nu; i++) {
    double range[2];
    cav_actuator_length(m, state, i, moment);
    if (moment[dof] == 0) continue;
    for (int d = 0; d < m->nv; d++) shared |= d != dof && moment[d] != 0;
    cav_actuator_effort_range(m, i, range);
    most[0] += fmin(moment[dof] * range[0], moment[dof] * range[1]);
    most[1] += fmax(moment[dof] * range[0], moment[dof] * range[1]);
  }
  if (isinf(most[0]) || isinf(most[1]))
    sprintf(text, "no limit%s", shared ? " *" : "");
  else if (most[0] != 0 || most[1] != 0)
    sprintf(text, "%.3g..%.3g %s%s", most[0], most[1], unit, shared ? " *" : "");
  return shared;
}

// Type and range of every joint, what actuators give along it, where it is at the posture of the file or the start of a problem,
// and what a positive change of it moves there
static cav_status print_joints(const cav_model *m, const cav_problem *p, cav_error *error) {
  cav_state *state = cav_state_new(m);
  const double *q = p ? p->q_start : m->q0;
  cav_roles roles;
  cav_status status = state ? cav_roles_find(m, state, &roles) : CAV_NO_MEMORY;
  if (!status) status = cav_position(m, state, q);
  double *moment = calloc((size_t)m->nv + 1, sizeof *moment);
  int shared = 0;
  if (!status && !moment) status = CAV_NO_MEMORY;
  if (status) cav_file_fail(error, status, 0, "the joints cannot be evaluated");
  int width = 20;
  for (int j = 0; j < m->njoint; j++) width = (int)fmax(width, fmin((double)strlen(m->joint[j].name), 40));
  if (!status && m->njoint)
    printf("%-*s %-6s %-18s %-17s %-10s + moves, seen from the root of its tree\n", width, "joint", "type", "range",
           "actuators give", p ? "start" : "in file");
  for (int j = 0; j < m->njoint && !status; j++) {
    const cav_joint *joint = &m->joint[j];
    const int slides = joint->type == CAV_JOINT_SLIDE, scalar = slides || joint->type == CAV_JOINT_HINGE;
    char range[120], effort[60] = "", at[40] = "", sense[CAV_SENSE];
    write_range(joint, range);
    if (scalar) shared |= write_effort(m, state, joint->dof, slides ? "N" : "N m", moment, effort);
    cav_sense_of(m, state, &roles, j, sense);
    if (scalar) snprintf(at, sizeof at, "%.4g %s", (slides ? 1 : 180 / M_PI) * q[joint->q] + 0.0, slides ? "m" : "deg");
    printf("%-*s %s", width, joint->name[0] ? joint->name : "(no name)", joint_name[joint->type]);
    if (scalar)
      printf("  %-18s %-17s %-10s + %s", range, *effort ? effort : "-", at, sense);
    else if (*range)
      printf(" %s", range);
    printf("\n");
  }
  if (shared) printf("* by an actuator that moves other joints, too\n");
  if (m->njoint) printf("\n");
  free(moment);
  cav_state_free(state);
  return status;
}

// geoms that something may touch: on which body, of what kind and size
static void print_geoms(const cav_model *m) {
  int n = 0, width = 20, on = 20;
  char words[CAV_WORDS];
  for (int g = 0; g < m->ngeom; g++) width = (int)fmax(width, fmin((double)strlen(cav_geom_words(m, g, words)), 40));
  for (int b = 0; b < m->nbody; b++) on = (int)fmax(on, fmin((double)strlen(m->body[b].name), 40));
  for (int g = 0; g < m->ngeom; g++) {
    const cav_geom *geom = &m->geom[g];
    int touches = 0;
    for (int p = 0; p < m->npair; p++) touches |= m->pair[p].geom1 == g || m->pair[p].geom2 == g;
    if (!touches) continue;
    if (!n++)
      printf("%-*s %-*s %-12s size as in MJCF, of a mesh half its box, m\n", width, "geom that can touch", on, "of",
             "type");
    const char *body = geom->body > 0 ? m->body[geom->body].name : "world";
    printf("%-*s %-*s %-13s", width, cav_geom_words(m, g, words), on, *body ? body : "(no name)",
           geom_name[geom->type]);
    for (int k = 0; k < 3 && geom->size[k] != 0 && geom->type != CAV_GEOM_PLANE; k++) printf("%.4g ", geom->size[k]);
    printf("\n");
  }
  if (!n) printf("no geom can touch another, so nothing stands on the ground or on anything else\n");
  printf("\n");
}

static void print_keyframes(const cav_model *m) {
  if (!m->nkey) return;
  printf("keyframes:");
  for (int i = 0; i < m->nkey; i++) printf("%s %s", i ? "," : "", *m->key[i].name ? m->key[i].name : "(no name)");
  printf("\n\n");
}

// what key="stand" is
static void print_stand(const cav_model *m, cav_state *state) {
  cav_stand stand;
  double *q = calloc((size_t)m->nq + 1, sizeof *q);
  cav_status status = q ? cav_stand_find(m, state, q, &stand) : CAV_NO_MEMORY;
  if (status == CAV_OK && stand.key)
    printf("  %-20s keyframe '%s'\n", "stand", stand.key);
  else if (status == CAV_OK)
    printf("  %-20s found: centre of mass %.1f mm from the middle of the feet\n", "stand", 1e3 * stand.aside);
  else if (status == CAV_BAD_INPUT)
    printf("  %-20s none: %s\n", "stand", stand.why);
  free(q);
}

// which bodies have a role that problem files can name
static void print_roles(const cav_model *m) {
  cav_roles roles;
  cav_state *state = cav_state_new(m);
  cav_status status = state ? cav_roles_find(m, state, &roles) : CAV_NO_MEMORY;
  if (status) {
    cav_state_free(state);
    return;
  }
  printf("roles: %s%s%s\n", cav_build_name(roles.build), *roles.why ? ": " : "", roles.why);
  for (int r = 0; r < CAV_ROLE_TYPES; r++) {
    int body = roles.body[r], geom = roles.geom[r];
    if (body < 0) continue;
    printf("  %-20s %s%s%s\n", cav_role_name((cav_role)r), m->body[body].name, geom < 0 ? "" : ", geom ",
           geom < 0 ? "" : m->geom[geom].name);
  }
  print_stand(m, state);
  printf("\n");
  cav_state_free(state);
}

// what a model has, counted
typedef struct census {
  int buoyant, drifting, quaternion, spring, damper, armature, joint_limit, friction;
  int moving, tendon_spatial, tendon_spring, tendon_damper, tendon_limit, tendon_friction;
  int world_pair, body_pair, convex_pair, dim[7];
  int types[CAV_GEOM_TYPES][CAV_GEOM_TYPES];
} census;

static void count_joints(const cav_model *m, census *c) {
  for (int j = 0; j < m->njoint; j++) {
    c->quaternion += m->joint[j].type == CAV_JOINT_FREE || m->joint[j].type == CAV_JOINT_BALL;
    c->spring += m->joint[j].stiffness != 0;
    c->joint_limit += m->joint[j].limited || m->joint[j].twist_limited || m->joint[j].swing_limited;
  }
  for (int d = 0; d < m->nv; d++) {
    c->damper += m->dof[d].damping != 0;
    c->armature += m->dof[d].armature != 0;
    c->friction += m->dof[d].frictionloss > 0;
  }
  for (int i = 1; i < m->nbody; i++) {
    const cav_body *body = &m->body[i];
    int ellipsoids = 0;
    for (int g = body->geom; g < body->geom + body->ngeom; g++) ellipsoids += m->geom[g].fluid;
    c->buoyant += body->link > 0 && body->buoyancy != 0;
    if (body->link > 0) c->drifting += ellipsoids ? ellipsoids : body->mass > 0;
  }
  for (int i = 0; i < m->nu; i++) c->moving += !m->actuator[i].constant;
  for (int i = 0; i < m->ntendon; i++) {
    c->tendon_spatial += m->tendon[i].npath > 0;
    c->tendon_spring += m->tendon[i].stiffness != 0;
    c->tendon_damper += m->tendon[i].damping != 0;
    c->tendon_limit += m->tendon[i].limited;
    c->tendon_friction += m->tendon[i].frictionloss > 0;
  }
}

static void count_pairs(const cav_model *m, census *c) {
  for (int p = 0; p < m->npair; p++) {
    const cav_pair *pair = &m->pair[p];
    int world = !m->geom[pair->geom1].link || !m->geom[pair->geom2].link;
    c->world_pair += world;
    c->body_pair += !world;
    c->dim[pair->dim]++;
    c->types[m->geom[pair->geom1].type][m->geom[pair->geom2].type]++;
  }
}

// one stage: runs with its count, or left out with the reason
static void print_stage(const char *name, int count, const char *unit, const char *why_not) {
  if (count)
    printf("  runs      %-24s %d %s\n", name, count, unit);
  else
    printf("  left out  %-24s %s\n", name, why_not);
}

static void print_pairs(const cav_model *m, const census *c) {
  const char *why =
      m->options.contact && m->options.constraint ? "no two geoms that may touch" : "switched off by the file";
  print_stage("contacts with the world", c->world_pair, "pairs", why);
  print_stage("contacts between links", c->body_pair, "pairs", why);
  for (int a = 0; a < CAV_GEOM_TYPES; a++) {
    for (int b = a; b < CAV_GEOM_TYPES; b++) {
      if (c->types[a][b]) printf("              %s with %s: %d\n", geom_name[a], geom_name[b], c->types[a][b]);
    }
  }
  for (int d = 1; d < 7; d++) {
    static const char *const what[] = {
        "", "no friction", "", "sliding", "sliding and torsion", "", "sliding, torsion and rolling"};
    if (c->dim[d]) printf("              %d row%s each (%s): %d\n", d, d > 1 ? "s" : "", what[d], c->dim[d]);
  }
}

static void print_stages(const cav_model *m) {
  census c = {0};
  count_joints(m, &c);
  count_pairs(m, &c);
  int on = m->options.passive, held = m->options.constraint;
  const char *off = "switched off by the file";
  printf("an evaluation of the inverse\n");
  print_stage("poses and velocities", m->nlink - 1, "links", "nothing moves");
  print_stage("quaternions", c.quaternion, "joints", "no free or ball joint");
  print_stage("Newton-Euler, one pass", m->nlink - 1, "links", "nothing moves");
  print_stage("gravity", m->options.gravity ? m->nlink - 1 : 0, "links", off);
  print_stage("armature", c.armature, "dofs", "no joint has any");
  print_stage("springs", on ? c.spring : 0, "joints", on ? "no joint has stiffness" : off);
  print_stage("dampers", on ? c.damper : 0, "dofs", on ? "no joint has damping" : off);
  int medium = m->density > 0 || m->viscosity > 0;
  print_stage("gravity compensation", on ? c.buoyant : 0, "bodies", on ? "no body asks for it" : off);
  print_stage("drag of a medium", on && medium ? c.drifting : 0, "shapes", on ? "no density, no viscosity" : off);
  print_stage("joint limits", held ? c.joint_limit : 0, "joints", held ? "no joint is limited" : off);
  print_stage("friction loss", held ? c.friction : 0, "dofs", held ? "no joint has any" : off);
  print_stage("tendon lengths", m->ntendon, "tendons", "no tendon");
  print_stage("strings through sites", c.tendon_spatial, "tendons", "no tendon is spatial");
  print_stage("tendon springs", on ? c.tendon_spring : 0, "tendons", on ? "no tendon has stiffness" : off);
  print_stage("tendon dampers", on ? c.tendon_damper : 0, "tendons", on ? "no tendon has damping" : off);
  print_stage("tendon limits", held ? c.tendon_limit : 0, "tendons", held ? "no tendon is limited" : off);
  print_stage("tendon friction loss", held ? c.tendon_friction : 0, "tendons", held ? "no tendon has any" : off);
  print_pairs(m, &c);
  print_stage("equality constraints", held ? m->nequality : 0, "equality", held ? "no equality constraint" : off);
  for (int t = 0; t <= CAV_EQUALITY_DISTANCE && held; t++) {
    static const char *const what[] = {"points, 3 rows", "frames, 6 rows", "joints, 1 row", "tendons, 1 row",
                                       "distances, 1 row"};
    int n = 0;
    for (int i = 0; i < m->nequality; i++) n += m->equality[i].type == (cav_equality_type)t;
    if (n) printf("              %s each: %d\n", what[t], n);
  }
  print_stage("actuators", m->nu, "actuators", "nothing is driven");
  print_stage("moments that follow q", c.moving, "actuators", "all moments are constant");
  print_stage("sensors", m->nsensor, "sensors, each when it is read", "none in the file");
  printf("  no matrix is formed or factorised\n");
  const char *missing = cav_derivatives_missing(m);
  printf("  derivatives %s%s\n", missing ? "by differences, as there is no closed form for " : "in closed form",
         missing ? missing : "");
}

// one line of the table of costs; what takes neither time nor memory says so
static void print_cost(const char *name, double seconds, size_t bytes) {
  printf("  %-44s", name);
  if (seconds > 0)
    printf(" %8.2f us", 1e6 * seconds);
  else
    printf(" %11s", seconds < 0 ? "" : "0");
  printf(" %8.1f kB\n", (double)bytes / 1024);
}

// time of the stages at the file's posture, at rest, and the memory of a state
static void print_costs(const cav_model *m) {
  cav_state *state = cav_state_new(m);
  double *v = calloc((size_t)m->nv, sizeof *v);
  cav_profile time = {0};
  size_t bytes[CAV_MEMORY_USES], all = 0;
  cav_status status = state && v ? cav_profile_inverse(m, state, m->q0, v, v, &time) : CAV_NO_MEMORY;
  if (status == CAV_OK) {
    cav_state_bytes(state, bytes);
    for (int i = 0; i < CAV_MEMORY_USES; i++) all += bytes[i];
    printf("\nits time, at the posture of the file with %d contacts, and the memory of a state\n", state->ncontact);
    print_cost("poses and tendon lengths", time.poses, bytes[CAV_MEMORY_POSES] + bytes[CAV_MEMORY_TENDONS]);
    print_cost("limits and friction losses", time.rows, bytes[CAV_MEMORY_ROWS]);
    print_cost("search of contacts", time.contacts, bytes[CAV_MEMORY_CONTACTS]);
    print_cost("equality constraints", time.equalities, bytes[CAV_MEMORY_EQUALITY]);
    print_cost("laws of contacts", time.laws, 0);
    print_cost("Newton-Euler, forces of joints and tendons", time.motion, bytes[CAV_MEMORY_MOTION]);
    print_cost("impulses of all constraints", time.impulses, 0);
    print_cost("actuators, where they are asked for", -1, bytes[CAV_MEMORY_ACTUATION]);
    print_cost("inertia matrix, forward steps only", -1, bytes[CAV_MEMORY_INERTIA]);
    print_cost("solvers, once they are called", -1, bytes[CAV_MEMORY_SOLVERS]);
    print_cost("the whole", time.whole, all);
  } else {
    printf("\nno evaluation at the posture of the file: %s\n", cav_status_name(status));
  }
  cav_state_free(state);
  free(v);
}

// which actuators plans can use and which not, one line for each reason
/// Actuators that motions can be planned with; solve refuses a model that has others.
static int count_planned(const cav_model *m) {
  int planned = 0;
  for (int i = 0; i < m->nu; i++) planned += cav_actuator_unplannable(m, i) == NULL;
  return planned;
}

static void print_actuators(const cav_model *m) {
  const int planned = count_planned(m);
  if (!m->nu && m->nv)
    printf("\nnothing is driven: the model has no actuator, gravity, springs and contacts alone move it\n");
  if (!m->nu) return;
  printf("\nmotions can be planned with %d of %d actuators\n", planned, m->nu);
  for (int i = 0; i < m->nu; i++) {
    const char *why = cav_actuator_unplannable(m, i);
    int before = 0, after = 0;
    for (int k = 0; why && k < m->nu; k++) *(k < i ? &before : &after) += cav_actuator_unplannable(m, k) == why;
    if (!why || before) continue;
    char words[CAV_WORDS];
    printf("  not with '%.100s'", cav_actuator_words(m, i, words));
    if (after > 1) printf(" and %d more", after - 1);
    printf(": %s\n", why);
  }
  if (planned < m->nu)
    printf("  solve refuses the model; motors along joints or fixed tendons in their place are planned\n");
  cav_command_warn_efforts(m, stdout);
}

static void print_warnings(const cav_model *m) {
  if (m->nwarning) printf("\nunderstood but left aside\n");
  for (int i = 0; i < m->nwarning; i++) printf("  %s\n", m->warning[i]);
}

// "at 1.2 s", "from 0.5 to 1 s", or nothing for the whole horizon
static void print_window(const cav_problem *p, const cav_term *term) {
  double from = term->from, to = term->to < 0 ? p->duration : term->to;
  if (to - from < 1e-9)
    printf(" at %g s", from);
  else if (from > 0 || to < p->duration)
    printf(" from %g to %g s", from, to);
}

static void print_quantity(const cav_problem *p, const cav_term *term) {
  static const char *const dofs[] = {"all dofs",           "translation of free roots", "rotation of free roots",
                                     "all but free roots", "joints of what is driven",  "joint"};
  const cav_model *m = p->model;
  if (term->quantity != CAV_QUANTITY_SENSOR) printf("%s", cav_quantity_rule_of(term->quantity)->words);
  if (cav_term_has_dofs(term)) {
    printf(" of %s%s%s", dofs[term->dofs], term->dofs == CAV_DOFS_ONE ? " " : "",
           term->dofs == CAV_DOFS_ONE ? m->joint[term->joint].name : "");
  }
  if (term->body > 0) printf(" of body %s", m->body[term->body].name);
  if (term->norm == CAV_NORM_ABSOLUTE) printf(", absolute beyond %g", term->scale);
  if (term->quantity != CAV_QUANTITY_SENSOR) return;
  const char *object = cav_object_name(m, term->sensor.object_type, term->sensor.object);
  printf("%s of %s", cav_sensor_rule_of(term->sensor.type)->name, object);
  if (term->component >= 0 && term->sensor.dim > 1) printf(", %c", "xyz"[term->component]);
  if (term->sensor.referred)
    printf(", in the frame of %s", cav_object_name(m, term->sensor.reference_type, term->sensor.reference));
}

// from what bounds of a posture are counted, and where a single joint may be
static void print_posture_bounds(const cav_problem *p, const cav_term *term) {
  const cav_joint *joint = term->dofs == CAV_DOFS_ONE ? &p->model->joint[term->joint] : NULL;
  const char *whose = term->target ? "its own posture" : "the goal";
  printf(", counted from %s", whose);
  if (!joint || joint->type > CAV_JOINT_HINGE || joint->type < CAV_JOINT_SLIDE || term->nwaypoint > 1) return;
  const double from = cav_command_plain((term->target ? term->target : p->q_goal)[joint->q]);
  printf(" (%.4g): %.4g to %.4g %s", from, from + term->lower, from + term->upper,
         joint->type == CAV_JOINT_SLIDE ? "m" : "rad");
}

// what a term is held against
static void print_target(const cav_problem *p, const cav_term *term) {
  if (term->use == CAV_USE_RANGE) {
    if (isfinite(term->lower)) printf(" at least %g", term->lower);
    if (isfinite(term->upper)) printf("%s at most %g", isfinite(term->lower) ? " and" : "", term->upper);
    if (term->quantity == CAV_QUANTITY_CONFIGURATION) print_posture_bounds(p, term);
    return;
  }
  if (term->nwaypoint) {
    printf(" along %d waypoints", term->nwaypoint);
  } else if (term->track) {
    const cav_track *track = term->track;
    printf(": %d channels, %d frames", track->nchannel, track->nframe);
    if (track->unused) printf(", %d columns of the file not asked for", track->unused);
    if (track->absent) printf(", %d markers of the set not in the file", track->absent);
  } else if (term->quantity == CAV_QUANTITY_CONFIGURATION) {
    printf(" to %s", term->target ? "its own posture" : "the goal");
  } else if (term->quantity == CAV_QUANTITY_SENSOR && term->target) {
    int rotation = term->sensor.dim == 4, one = term->component >= 0 && !rotation;
    printf(" to");
    for (int i = one ? term->component : 0; i < (one ? term->component + 1 : term->sensor.dim); i++)
      printf(" %.4g", cav_command_plain(term->target[i]));
  } else if (term->quantity == CAV_QUANTITY_SENSOR) {
    printf(term->sensor.dim == 4 ? " to no rotation" : " to 0");
  }
}

// whether achieved needs a term, and to what tolerance
static void print_standing(const cav_problem *p, const cav_term *term) {
  cav_tolerance tolerance[4];
  int reported, n = cav_term_tolerances(p, term, 4, tolerance, &reported);
  if (n && cav_command_unmeasured(p, term)) {
    printf("; never measured: a motion with close=\"open\" has no forces at its last knot; ask at %g s, or before",
           p->duration - p->timestep);
    return;
  }
  for (int i = 0; i < n && i < 4; i++)
    printf("%s %g%s%s", i ? "," : "; to be met within", tolerance[i].within, *tolerance[i].unit ? " " : "",
           tolerance[i].unit);
  if (n && term->use == CAV_USE_COST && !(term->within > 0)) printf(" (usual)");
  if (n && term->use == CAV_USE_COST && cav_command_base(p, term) >= 0)
    printf("; leaves height, place and tilt of the base open");
  if (!n && reported) printf("; reported only, %s", term->within > 0 ? "within=\"any\"" : "no within=");
  if (term->quantity == CAV_QUANTITY_SLIP && term->within > 0) {
    if (isinf(term->within))
      printf("; these may slide");
    else
      printf("; these may slide by %g m/s", term->within);
  }
}

// by what name logs and tables tell of a term, where it has another than its element's
static void print_name(const cav_term *term) {
  if (term->name && *term->name && strcmp(term->name, cav_quantity_rule_of(term->quantity)->name))
    printf("'%s': ", term->name);
}

// a cost over the motion, of which nothing is asked
static int runs(const cav_problem *p, const cav_term *term) {
  int reported;
  cav_term_tolerances(p, term, 0, NULL, &reported);
  const int slides = term->quantity == CAV_QUANTITY_SLIP && term->within > 0;
  return term->use == CAV_USE_COST && !reported && term->quantity != CAV_QUANTITY_SENSOR &&
         term->quantity != CAV_QUANTITY_TRACK && !slides;
}

enum { RUNNING = 160 };

// "force of bar 100": such a cost by its name, or else by what it is of and whom it is for, and its weight
static void write_running(const cav_problem *p, const cav_term *term, char text[RUNNING]) {
  const char *quantity = cav_quantity_rule_of(term->quantity)->name, *whose = NULL;
  const int named = *term->name && strcmp(term->name, quantity);
  if (!named && term->body > 0) whose = p->model->body[term->body].name;
  if (!named && cav_term_has_dofs(term))
    whose = term->dofs == CAV_DOFS_ONE ? p->model->joint[term->joint].name : cav_problem_dof_sets[term->dofs];
  if (!whose) whose = "";
  snprintf(text, RUNNING, "%.60s%s%.60s %.4g", named ? term->name : quantity, *whose ? " of " : "", whose,
           term->weight);
}

// costs over the motion by their weights, in one paragraph
static void print_running(const cav_problem *p) {
  enum { WIDTH = 110 };
  int n = 0, used = 0;
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    char text[RUNNING];
    if (!runs(p, term)) continue;
    write_running(p, term, text);
    if (!n++)
      used = printf("  running costs by weight: ");
    else
      used += printf(",");
    if (used + (int)strlen(text) > WIDTH) used = printf("\n    ") - 1;
    used += printf("%s%s", n > 1 && used > 4 ? " " : "", text);
  }
  if (n) printf("\n");
}

static void print_terms(const cav_problem *p, int hard, int all) {
  int n = 0;
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    if ((term->use != CAV_USE_COST) != hard || (!all && runs(p, term))) continue;
    if (!n++)
      printf("%s; achieved needs those that are to be met, the rest is not asked for\n",
             hard ? "constraints" : "costs");
    if (hard)
      printf("  must be           ");
    else
      printf("  weight %-10.4g ", term->weight);
    print_name(term);
    print_quantity(p, term);
    print_target(p, term);
    print_window(p, term);
    print_standing(p, term);
    printf("\n");
  }
}

// what goes from where to where
static void print_stage_ends(const cav_stage_options *first, const cav_stage_options *last) {
  int n;
  const cav_field *field = cav_stage_fields(&n);
  for (int i = 0; i < n; i++, field++) {
    const char *a = (const char *)first + field->offset, *b = (const char *)last + field->offset;
    int whole = field->type == CAV_FIELD_WHOLE;
    printf("%s%s %g to %g%s%s", i ? ", " : "  ", field->name,
           whole ? *(const int *)(const void *)a : *(const double *)(const void *)a,
           whole ? *(const int *)(const void *)b : *(const double *)(const void *)b, *field->unit ? " " : "",
           field->unit);
  }
  printf("\n\n");
}

/// What the derivatives and normal equations of all knots take at least, bytes.
static double bytes_of(const cav_problem *p) { return cav_knots_bytes(p->duration / p->timestep + 1, p->model->nv); }

// bytes from which on a problem is not evaluated to tell what that takes, and knots of which few motions have more
static const double vast = 1e9;
enum { MANY_KNOTS = 4000 };

// how the solver will factor, and what an iteration takes
static cav_status print_equations(const cav_problem *p, cav_error *error) {
  cav_equations e;
  if (bytes_of(p) > vast) {
    printf("  normal equations: %.3g GB at least; not evaluated here\n", bytes_of(p) / 1e9);
    return CAV_OK;
  }
  cav_status status = cav_problem_equations(p, &e, error);
  if (status) return status;
  if (!e.left_out)
    printf("  left out: no tree; each is moved or asked for, or something comes near it\n");
  else
    printf("  left out: %d tree%s of %d dofs that nothing moves or asks for and nothing comes near\n", e.left_out,
           e.left_out > 1 ? "s" : "", e.left_out_dofs);
  printf("  normal equations: %d unknowns in %d blocks from %d rows, %d of them constraints; %.3g MB with factors\n",
         e.unknowns, e.blocks, e.rows, e.constraints, e.bytes / 1e6);
  printf("  factored as ");
  if (e.groups > 1)
    printf("%d bands, one for each group of trees that nothing joins at the guess, the largest ", e.groups);
  printf("%s of %d, as knots see their neighbours", e.groups > 1 ? "one" : "a band", e.width);
  if (e.border > 0)
    printf("; a border of %d, %s", e.border,
           !p->cycle.on   ? "of the free duration"
           : e.border % 2 ? "of a cycle's last two knots, which meet the first, and of the free duration"
                          : "of a cycle's last two knots, which meet the first");
  if (e.arrow) printf("; the free duration beside them as an arrow");
  printf("\n  once, by one thread, at the guess: rows and derivatives %.0f us, normal equations %.0f us, ",
         1e6 * e.rows_time, 1e6 * e.sums_time);
  if (e.factor_time < 0)
    printf("no factors: not positive definite there\n");
  else
    printf("factors %.0f us\n", 1e6 * e.factor_time);
  return CAV_OK;
}

void cav_command_tell_step(FILE *out, const cav_problem *p) {
  static const double deep = 10; // m
  const double *g = p->model->gravity,
               fall = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) * p->timestep * p->timestep / 2;
  int floats = 0;
  for (int j = 0; j < p->model->njoint; j++) floats |= p->model->joint[j].type == CAV_JOINT_FREE;
  if (floats && fall > deep)
    fprintf(out, "note: a free body falls by %.3g m in one step of %g s: durations and steps are in s\n", fall,
            p->timestep);
  if (p->duration / p->timestep > MANY_KNOTS)
    fprintf(
        out,
        "note: %g s in steps of %g s are %.0f knots, %.3g GB at least: durations and steps are in s; %g ms are %g\n",
        p->duration, p->timestep, p->duration / p->timestep + 1, bytes_of(p) / 1e9, p->duration, p->duration / 1000);
}

// what moves at the start, each joint in a line
static void print_start_speeds(const cav_problem *p) {
  const cav_model *m = p->model;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    const double *v = p->v_start + joint->dof;
    const char *name = *joint->name ? joint->name : m->body[joint->body].name;
    const int n = joint->type == CAV_JOINT_FREE ? 6 : joint->type == CAV_JOINT_BALL ? 3 : 1;
    double most = 0;
    for (int k = 0; k < n; k++) most = fmax(most, fabs(v[k]));
    if (most == 0) continue;
    printf("         '%.60s' moves at ", name);
    if (n == 6) printf("%.3g %.3g %.3g m/s, ", v[0], v[1], v[2]);
    if (n > 1) printf("%.3g %.3g %.3g rad/s about its own axes\n", v[n - 3], v[n - 2], v[n - 1]);
    if (n == 1) printf("%.3g %s\n", v[0], joint->type == CAV_JOINT_SLIDE ? "m/s" : "rad/s");
  }
}

static cav_status print_problem(const cav_problem *p, int all, cav_error *error) {
  static const char *const order[] = {"euler", "midpoint", "momentum"};
  int knots = (int)lround(p->duration / p->timestep) + 1;
  printf("problem %s\n", p->name[0] ? p->name : "without a name");
  printf("  %g s in %d knots of %g s, order %s, %s\n", p->duration, knots, p->timestep, order[p->order],
         p->cycle.on        ? "a cycle"
         : p->close_at_rest ? "at rest after the last knot"
                            : "open after the last knot");
  cav_command_tell_step(stdout, p);
  cav_command_tell_units(stdout, p);
  cav_command_tell_equalities(stdout, p);
  cav_command_tell_postures(stdout, p);
  cav_command_tell_demands(stdout, p);
  cav_command_tell_goal(stdout, p);
  cav_command_tell_axes(stdout, p);
  cav_command_tell_guess(stdout, p, 1);
  if (p->duration_most > 0)
    printf("  duration free from %g to %g s, weight %g\n", p->duration_least, p->duration_most, p->duration_weight);
  if (p->cycle.on)
    printf("  a %s moves by %g %g %g m, %.3g m/s on average, and turns by %g degrees%s\n",
           p->cycle.mirror == CAV_MIRROR_NONE ? "period" : "half stride", p->cycle.translation[0],
           p->cycle.translation[1], p->cycle.translation[2],
           hypot(p->cycle.translation[0], p->cycle.translation[1]) / p->duration, p->cycle.rotation * 180 / M_PI,
           p->cycle.mirror == CAV_MIRROR_X   ? ", mirrored along x"
           : p->cycle.mirror == CAV_MIRROR_Y ? ", mirrored along y"
                                             : "");
  cav_command_tell_asymmetry(p, stdout);
  cav_status status = cav_command_print_stance(p, "start", p->q_start, error);
  if (!status && !p->cycle.on) print_start_speeds(p);
  if (!status && cav_problem_has_goal(p)) status = cav_command_print_stance(p, "goal", p->q_goal, error);
  if (status) return status;
  if (!cav_problem_has_goal(p)) printf("  goal   no <goal>: the goal posture is the start\n");
  if (*cav_problem_lowered(p))
    printf("  note: height=\"floor\" of %s; <root joint=\"...\" height=\"keep\"/> in it leaves a body in the air\n",
           cav_problem_lowered(p));
  if (*cav_problem_buried(p))
    printf("  note: height=\"floor\" of %s. Change Z of its <root pos=\"X Y Z\">\n", cav_problem_buried(p));
  printf("  %d unknowns%s; the guess %s",
         (knots - 1 + 2 * (p->free_start != 0)) * p->model->nv + (p->duration_most > 0),
         p->free_start ? ", with posture and velocity at the start" : "",
         p->guess == CAV_GUESS_HOLD   ? "holds the start"
         : p->guess == CAV_GUESS_PUMP ? "is simulated, pumping energy"
                                      : "goes from start to goal");
  if (p->nguess_pose > 0) printf(" by %d postures", p->nguess_pose);
  if (p->guess_height > 0) printf(", with an arc of %g m from %g to %g s", p->guess_height, p->guess_from, p->guess_to);
  if (p->guess_bow[0] != 0 || p->guess_bow[1] != 0)
    printf(", with a bow of %g %g m from %g to %g s", p->guess_bow[0], p->guess_bow[1], p->guess_from, p->guess_to);
  printf("\n");
  // of a model that solve refuses there are none
  if (all && count_planned(p->model) == p->model->nu && (status = print_equations(p, error))) return status;
  printf("  actuators up to %g of their limits, joints and tendons %g rad or m inside theirs\n", p->effort_limit,
         p->limit_margin);
  print_terms(p, 0, all);
  if (!all) print_running(p);
  if (*cav_problem_replaced(p)) printf("  note: %s: state that again where it is wanted\n", cav_problem_replaced(p));
  print_terms(p, 1, all);
  status = cav_command_print_asked(p, error);
  if (!status && !all) printf("\n");
  if (status || !all) return status;
  const cav_stage_options *a = &p->schedule.first, *b = &p->schedule.last;
  printf("schedule: %d stages, geometric; contacts that slide by %s law, %s gap and %s slip after the step\n",
         p->schedule.stages, p->schedule.sliding == CAV_SLIDING_CONVEX ? "the convex" : "Coulomb's",
         p->schedule.next_gap == CAV_NEXT_GAP_EXACT ? "exact" : "linear",
         p->schedule.next_slip == CAV_NEXT_SLIP_EXACT ? "exact" : "linear");
  print_stage_ends(a, b);
  return CAV_OK;
}

// of a problem in brief its size alone, of a model what it holds, with all what an evaluation runs
static cav_status print_model(const cav_model *m, const cav_problem *p, int all, cav_error *error) {
  print_sizes(m);
  if (!p || all) {
    printf("\n");
    print_bodies(m);
    cav_status status = print_joints(m, p, error);
    if (!status) status = print_places(m, p, error);
    if (status) return status;
    print_geoms(m);
    print_keyframes(m);
    print_roles(m);
  }
  if (all) {
    print_stages(m);
    print_costs(m);
  }
  print_actuators(m);
  print_warnings(m);
  return CAV_OK;
}

// whether achieved needs nothing, and no constraint says what has to hold
static int asks_nothing(const cav_problem *p) {
  for (int i = 0; i < p->nterm; i++)
    if ((p->term[i].use != CAV_USE_COST || cav_term_tolerances(p, &p->term[i], 0, NULL, NULL)) &&
        !cav_command_unmeasured(p, &p->term[i]))
      return 0;
  return !p->cycle.on;
}

int cav_command_inspect(const cav_command_line *line) {
  cav_error error = {0};
  cav_command_scene scene;
  if (cav_command_load(line, &scene, &error)) return cav_command_fail(&error);
  cav_status status = CAV_OK;
  int proofs = 0;
  if (scene.problem) {
    if ((proofs = cav_command_impossible(stdout, "", scene.problem, 3, &error)) < 0) status = error.status;
    if (!status) status = print_problem(scene.problem, line->all, &error);
  }
  if (!status) status = print_model(scene.model, scene.problem, line->all, &error);
  if (!status && scene.problem && asks_nothing(scene.problem))
    printf(
        "\nnote: no term has to be met: <goal> is where the guess ends; <posture dofs=\"all\" at=\"end\" "
        "weight=\"900\"/> in <cost> "
        "asks for it\n");
  if (!status && !line->all)
    printf(scene.problem
               ? "\n--all: joints, places of bodies, roles, equations, schedule, and what an evaluation runs\n"
               : "\n--all: what an evaluation runs and leaves out, its time and memory\n");
  // the verdict once more, where nothing buries it
  const int refused = scene.problem && count_planned(scene.model) < scene.model->nu;
  if (!status && scene.problem)
    printf(proofs    ? "\nit cannot be solved, as the first lines say: %s\n"
           : refused ? "\nsolve refuses its model, some of whose actuators cannot be planned with (above): %s\n"
                     : "\nnothing proves it impossible: cavort solve %s\n",
           line->stated ? line->stated : line->operand);
  cav_command_free(&scene);
  if (status) return cav_command_fail(&error);
  return proofs || refused ? CAV_EXIT_NOT_CERTIFIED : CAV_EXIT_CERTIFIED;
}
