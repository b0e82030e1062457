/// cavort inspect: what a model holds, what an evaluation of it runs and leaves out and why. Counts come from the compiled model,
/// times from running it. Solves nothing.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "file.h"
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
int cav_command_count_planned(const cav_model *m) {
  int planned = 0;
  for (int i = 0; i < m->nu; i++) planned += cav_actuator_unplannable(m, i) == NULL;
  return planned;
}

static void print_actuators(const cav_model *m) {
  const int planned = cav_command_count_planned(m);
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

// of a problem in brief its size alone, of a model what it holds, with all what an evaluation runs
static cav_status print_model(const cav_model *m, const cav_problem *p, int all, cav_error *error) {
  print_sizes(m);
  if (!p || all) {
    printf("\n");
    print_bodies(m);
    cav_status status = print_joints(m, p, error);
    if (!status) status = print_places(m, p, error);
    if (!status) status = cav_command_print_extents(m, p, error);
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
    if (!status) status = cav_command_print_problem(scene.problem, line->all, &error);
  }
  if (!status) status = print_model(scene.model, scene.problem, line->all, &error);
  if (!status && scene.problem && asks_nothing(scene.problem))
    printf(
        "\nnote: no term has to be met: <goal> is where the guess ends; <posture dofs=\"all\" at=\"end\" "
        "weight=\"900\"/> in <cost> "
        "asks for it\n");
  if (!status && !line->all)
    printf(scene.problem ? "\n--all: joints, places of bodies, where surfaces end, roles, equations, schedule, and "
                           "what an evaluation runs\n"
                         : "\n--all: what an evaluation runs and leaves out, its time and memory\n");
  // the verdict once more, where nothing buries it
  const int refused = scene.problem && cav_command_count_planned(scene.model) < scene.model->nu;
  if (!status && scene.problem)
    printf(proofs    ? "\nit cannot be solved, as the first lines say: %s\n"
           : refused ? "\nsolve refuses its model, some of whose actuators cannot be planned with (above): %s\n"
                     : "\nnothing proves it impossible: cavort solve %s\n",
           line->stated ? line->stated : line->operand);
  cav_command_free(&scene);
  if (status) return cav_command_fail(&error);
  return proofs || refused ? CAV_EXIT_NOT_CERTIFIED : CAV_EXIT_CERTIFIED;
}
