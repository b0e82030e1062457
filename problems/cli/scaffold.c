/// A model's own names, and a wish that suits how it is built: who stands goes down and up again, an arm moves its hand, other
/// mechanisms turn a joint, and what cannot stays where it is.
#include "scaffold.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/problem.h"
#include "file.h"
#include "stand.h"

static const double degrees = 57.295779513082320877;

// ---------------------------------------------------------------- what there is

// a foot that is less than its body, a ball at the end of a shank, is where that is
static void pose_of_role(const cav_model *m, const cav_state *state, const cav_roles *roles, cav_role role,
                         cav_pose *pose) {
  if (roles->geom[role] >= 0)
    cav_object_pose(m, state, CAV_OBJECT_GEOM, roles->geom[role], pose);
  else
    cav_object_pose(m, state, CAV_OBJECT_XBODY, roles->body[role], pose);
}

// tolerance of a wish: the usual one, or of a small one a third of it, so that who stays where it is misses it
static double tolerance_of(double wish, double usual) { return fmin(usual, fabs(wish) / 3); }

// height of the trunk above the lowest foot
static double height_of(const cav_model *m, const cav_state *state, const cav_roles *roles) {
  double foot = INFINITY;
  cav_pose pose;
  for (cav_role r = 0; r < CAV_ROLE_TYPES; r++) {
    if (roles->body[r] < 0 || !strstr(cav_role_name(r), "foot")) continue;
    pose_of_role(m, state, roles, r, &pose);
    foot = fmin(foot, pose.pos[2]);
  }
  cav_role trunk = roles->body[CAV_ROLE_PELVIS] >= 0 ? CAV_ROLE_PELVIS : CAV_ROLE_TORSO;
  if (roles->body[trunk] < 0 || !isfinite(foot)) return 0;
  pose_of_role(m, state, roles, trunk, &pose);
  return pose.pos[2] - foot;
}

cav_status cav_scaffold_open(cav_scaffold *s, const cav_model *model, cav_error *error) {
  cav_state *state = cav_state_new(model);
  cav_stand stand;
  *s = (cav_scaffold){.model = model,
                      .q = malloc(((size_t)model->nq + 1) * sizeof *s->q),
                      .sense = calloc((size_t)model->njoint + 1, sizeof *s->sense)};
  cav_status status = state && s->q && s->sense ? cav_roles_find(model, state, &s->roles) : CAV_NO_MEMORY;
  if (!status) {
    s->stands = cav_stand_find(model, state, s->q, &stand) == CAV_OK;
    if (!s->stands) cav_configuration_reset(model, s->q);
    status = cav_position(model, state, s->q);
  }
  int hand = status ? -1 : s->roles.body[CAV_ROLE_HAND];
  if (!status) s->height = height_of(model, state, &s->roles);
  for (int j = 0; j < model->njoint && !status; j++) cav_sense_of(model, state, &s->roles, j, s->sense[j]);
  if (hand > 0) {
    cav_pose pose, base;
    int link = model->link[model->body[hand].link].root;
    cav_object_pose(model, state, CAV_OBJECT_BODY, hand, &pose);
    cav_object_pose(model, state, CAV_OBJECT_XBODY, model->link[link].body, &base);
    for (int k = 0; k < 3; k++) s->hand[k] = pose.pos[k] - base.pos[k];
  }
  cav_state_free(state);
  if (status) cav_file_fail(error, status, 0, "the model cannot be evaluated: %s", cav_status_name(status));
  return status;
}

void cav_scaffold_close(cav_scaffold *s) {
  free(s->q);
  free(s->sense);
}

// ---------------------------------------------------------------- the comment

// a name as it may stand in a comment: without "--"
static int put_name(FILE *out, const char *name) {
  for (const char *c = name; *c; c++) fputc(*c == '-' && c[1] == '-' ? '~' : *c, out);
  return (int)strlen(name);
}

// "Label: a, b, c", broken into lines
typedef struct lines {
  FILE *out;
  int n, column;
} lines;

static void add(lines *l, const char *label, const char *name) {
  int length = (int)strlen(name);
  if (!*name) return;
  if (l->n == 0) l->column = fprintf(l->out, "     %s: ", label);
  if (l->n) l->column += fprintf(l->out, ", ");
  if (l->n && l->column + length > 110) l->column = fprintf(l->out, "\n       ") - 1;
  l->column += put_name(l->out, name);
  l->n++;
}

static void end(lines *l) {
  if (l->n) fputc('\n', l->out);
  l->n = 0;
}

static void list_joints(FILE *out, const cav_scaffold *s) {
  static const char *const types[] = {"free", "ball", "slide", "hinge"};
  fputs(
      "     Joints: type, range, where it is at the start, and what a positive change moves there, seen from the "
      "root\n",
      out);
  for (int j = 0; j < s->model->njoint; j++) {
    const cav_joint *joint = &s->model->joint[j];
    int turns = joint->type == CAV_JOINT_HINGE;
    fputs("       ", out);
    int used = *joint->name ? put_name(out, joint->name) : fprintf(out, "(no name: give it one to speak of it)");
    fprintf(out, "%*s %-6s", used < 28 ? 28 - used : 0, "", types[joint->type]);
    if (joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE) {
      double unit = turns ? degrees : 1;
      if (joint->limited) fprintf(out, " %.4g to %.4g,", unit * joint->range[0], unit * joint->range[1]);
      // what a search left of nothing is nothing
      const double at = fabs(s->q[joint->q]) < 1e-4 ? 0 : s->q[joint->q];
      fprintf(out, " at %.4g %s; + ", unit * at, turns ? "degrees" : "m");
      put_name(out, s->sense[j]);
    }
    fputc('\n', out);
  }
}

static void list_roles(FILE *out, const cav_scaffold *s) {
  lines l = {.out = out};
  char text[300];
  for (cav_role r = 0; r < CAV_ROLE_TYPES; r++) {
    if (s->roles.body[r] < 0) continue;
    snprintf(text, sizeof text, "%s (%.200s)", cav_role_name(r), s->model->body[s->roles.body[r]].name);
    add(&l, "Parts that any problem may name, whatever the model calls them", text);
  }
  end(&l);
}

void cav_scaffold_list(FILE *out, const cav_scaffold *s) {
  const cav_model *m = s->model;
  lines l = {.out = out};
  list_joints(out, s);
  for (int i = 1; i < m->nbody; i++) add(&l, "Bodies", m->body[i].name);
  end(&l);
  list_roles(out, s);
  for (int i = 0; i < m->nsite; i++) add(&l, "Sites", m->site[i].name);
  end(&l);
  for (int i = 0; i < m->nactuator; i++) add(&l, "Actuators", m->actuator[i].name);
  end(&l);
  for (int i = 0; i < m->nsensor; i++) add(&l, "Sensors", m->sensor[i].name);
  end(&l);
  for (int i = 0; i < m->nkey; i++) add(&l, "Keyframes", m->key[i].name);
  end(&l);
  if (s->stands) fputs("     Postures: key=\"stand\" is found for this model\n", out);
}

// ---------------------------------------------------------------- the wish

static void begin(FILE *out, cav_scaffold *s, const char *task) {
  s->task = task;
  fprintf(out, "<!-- %s, for ", task);
  put_name(out, *s->model->name ? s->model->name : "this model");
  fputs(
      ", as cavort new wrote it: a beginning to be changed.\n     Terms and what else may stand here: cavort help "
      "terms, "
      "problems/README.md.\n\n",
      out);
  cav_scaffold_list(out, s);
  fputs("-->\n<problem name=\"", out);
  cav_file_write_xml(out, s->name);
  fputs("\" model=\"", out);
  cav_file_write_xml(out, s->path);
  fprintf(out, "\"%s>\n", s->floating ? " floating=\"true\"" : "");
}

int cav_scaffold_has_floor(const cav_model *m) {
  for (int i = 0; i < m->ngeom; i++)
    if (m->geom[i].type == CAV_GEOM_PLANE && m->geom[i].link == 0) return 1;
  return 0;
}

// the posture that it starts from: one that stands, the first keyframe, or the model's own; on the floor, or as it is
static void write_start(FILE *out, const cav_scaffold *s) {
  int stands = s->start == CAV_SCAFFOLD_FLOOR && s->roles.base != CAV_BASE_FIXED,
      floor = cav_scaffold_has_floor(s->model);
  int lowered = stands && (floor || s->stands);
  int key = s->start != CAV_SCAFFOLD_PLAIN && s->model->nkey && *s->model->key[0].name;
  if (lowered && !floor)
    fputs(
        "\n  <!-- what the model's file does not have: a floor. Boxes, bars and things to carry may stand here, too "
        "-->\n"
        "  <scene>\n    " CAV_SCAFFOLD_PLANE "\n  </scene>\n",
        out);
  fputs(
      "\n  <!-- where it starts; a goal of its own would be <goal>, else it ends as it began. Single joints are set "
      "by\n"
      "       <joint name=\"...\" degrees=\"...\"/> inside -->\n  <start",
      out);
  if (s->stands)
    fputs(" key=\"stand\"", out);
  else if (key)
    fputs(" key=\"", out), cav_file_write_xml(out, s->model->key[0].name), fputc('"', out);
  else if (s->start != CAV_SCAFFOLD_PLAIN)
    fputs(" ranges=\"clip\"", out);
  fputs(lowered ? " height=\"floor\"/>\n" : "/>\n", out);
}

static void write_horizon(FILE *out, double duration, double step) {
  fprintf(out,
          "  <!-- how long, and the time between knots, s. The motion comes to rest at its end; close=\"open\": it "
          "does not -->\n"
          "  <horizon duration=\"%g\" timestep=\"%g\"/>\n",
          duration, step);
}

static void write_rest(FILE *out) {
  fputs(
      "    <!-- and end at rest where it started, or at the goal. A term costs weight/2 times the square of how far "
      "off it is,\n"
      "         in m and rad -->\n"
      "    <posture name=\"final posture\" dofs=\"all\" at=\"end\" weight=\"900\"/>\n"
      "    <velocity name=\"final rest\" dofs=\"all\" at=\"end\" weight=\"100\"/>\n",
      out);
}

static int write_crouch(FILE *out, cav_scaffold *s) {
  const char *trunk = cav_role_name(s->roles.body[CAV_ROLE_PELVIS] >= 0 ? CAV_ROLE_PELVIS : CAV_ROLE_TORSO);
  if (!s->stands || s->roles.base != CAV_BASE_FREE || !(s->height > 0)) return 0;
  if (s->roles.build != CAV_BUILD_BIPED && s->roles.build != CAV_BUILD_QUADRUPED) return 0;
  begin(out, s, "It goes down and up again");
  write_horizon(out, 2, 0.04);
  write_start(out, s);
  fprintf(out,
          "\n  <cost>\n    <!-- half way, the %s is lower than at the start, m; off by at most within= it counts as "
          "achieved -->\n"
          "    <sensor name=\"down\" type=\"framepos\" xbody=\"%s\" component=\"z\" relative=\"start\" target=\"%.3g\" "
          "at=\"1\" within=\"%.2g\" weight=\"3000\"/>\n",
          trunk, trunk, -0.12 * s->height, tolerance_of(0.12 * s->height, CAV_WITHIN_LENGTH));
  write_rest(out);
  fputs("  </cost>\n</problem>\n", out);
  return 1;
}

static int write_reach(FILE *out, cav_scaffold *s) {
  const double *h = s->hand;
  if (s->roles.base != CAV_BASE_FIXED || s->roles.body[CAV_ROLE_HAND] < 0 || hypot(hypot(h[0], h[1]), h[2]) < 0.05)
    return 0;
  begin(out, s, "It moves its hand");
  write_horizon(out, 1, 0.02);
  write_start(out, s);
  // towards its base, where every arm reaches
  double way = 0.15 * hypot(hypot(h[0], h[1]), h[2]);
  fprintf(
      out,
      "\n  <cost>\n    <!-- at the end the hand is so far from where it was, m; off by at most within= it counts as "
      "achieved -->\n"
      "    <sensor name=\"target\" type=\"framepos\" body=\"hand\" relative=\"start\" target=\"%.3g %.3g %.3g\" "
      "at=\"end\" within=\"%.2g\" weight=\"3000\"/>\n    <velocity name=\"final rest\" dofs=\"all\" at=\"end\" "
      "weight=\"100\"/>\n  "
      "</cost>\n</problem>\n",
      -0.15 * h[0], -0.15 * h[1], -0.15 * h[2], tolerance_of(way, CAV_WITHIN_LENGTH));
  return 1;
}

// the first scalar joint with a name that an actuator turns on its own; -1: none
static int driven_joint(const cav_model *m) {
  for (int a = 0; a < m->nu; a++) {
    const cav_actuator *it = &m->actuator[a];
    if (it->transmission != CAV_TRANSMISSION_JOINT || cav_actuator_unplannable(m, a)) continue;
    const cav_joint *joint = &m->joint[it->target];
    if (*joint->name && (joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE)) return it->target;
  }
  return -1;
}

static int write_turn(FILE *out, cav_scaffold *s) {
  int j = driven_joint(s->model);
  if (j < 0) return 0;
  const cav_joint *joint = &s->model->joint[j];
  int turns = joint->type == CAV_JOINT_HINGE;
  double q = s->q[joint->q], by = turns ? 0.2 : 0.05;
  if (joint->limited) {
    by = fmin(by, 0.2 * (joint->range[1] - joint->range[0]));
    if (q > 0.5 * (joint->range[0] + joint->range[1])) by = -by;
  }
  begin(out, s, turns ? "It turns a joint" : "It moves a joint");
  write_horizon(out, 1, 0.02);
  write_start(out, s);
  fprintf(out, "  <goal%s>\n", s->start == CAV_SCAFFOLD_PLAIN ? "" : " ranges=\"clip\"");
  fputs("    <joint name=\"", out);
  cav_file_write_xml(out, joint->name);
  fprintf(out, "\" %s=\"%.4g\"/>\n  </goal>\n\n  <cost>\n", turns ? "degrees" : "pos",
          (turns ? degrees : 1) * (q + by));
  fputs(
      "    <!-- at the end that joint is at the goal (off by at most within= it counts so), and at rest -->\n    "
      "<posture name=\"goal\" joint=\"",
      out);
  cav_file_write_xml(out, joint->name);
  fprintf(out, "\" at=\"end\" within=\"%.2g\" weight=\"900\"/>\n    <velocity name",
          tolerance_of(by, turns ? CAV_WITHIN_ANGLE : CAV_WITHIN_LENGTH));
  fputs("=\"final rest\" joint=\"", out);
  cav_file_write_xml(out, joint->name);
  fputs("\" at=\"end\" weight=\"100\"/>\n  </cost>\n</problem>\n", out);
  return 1;
}

static int write_hold(FILE *out, cav_scaffold *s) {
  begin(out, s, "It stays where it is, as well as it can");
  write_horizon(out, 0.5, 0.025);
  write_start(out, s);
  fputs(
      "\n  <cost>\n    <!-- for how far off it is told, not asked: within=\"any\" -->\n"
      "    <posture name=\"posture\" dofs=\"all\" at=\"end\" weight=\"900\" within=\"any\"/>\n  </cost>\n</problem>\n",
      out);
  return 1;
}

int cav_scaffold_write(FILE *out, cav_scaffold *s, int choice) {
  static int (*const wishes[])(FILE *, cav_scaffold *) = {write_crouch, write_reach, write_turn, write_hold};
  if (choice >= (int)(sizeof wishes / sizeof *wishes) * CAV_SCAFFOLD_STARTS) return -1;
  s->start = (cav_scaffold_start)(choice % CAV_SCAFFOLD_STARTS);
  return wishes[choice / CAV_SCAFFOLD_STARTS](out, s);
}
