/// A motion as a Biovision hierarchy. A joint stands for each link, at the point that its hinges and balls turn about; a
/// link that slides, floats, or turns about several points has channels for its position, too. All angles are zero in
/// the model's own configuration, so offsets show that. y up: (x, y, z) of the model is (x, z, -y).
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "exchange.h"
#include "file.h"
#include "math3.h"

static const double degrees = 57.295779513082320877;

// how a link stands in the file
typedef struct part {
  int moves;          ///< 1: has channels of its position
  double anchor[3];   ///< in the link's frame
  double rest[9];     ///< rotation in the model's own configuration
  double rest_pos[3]; ///< of the anchor there
} part;

static void find_parts(const cav_model *m, const cav_pose *rest, part *p) {
  for (int i = 0; i < m->nlink; i++) {
    const cav_link *link = &m->link[i];
    for (int j = link->joint, n = 0; j < link->joint + link->njoint; j++) {
      const cav_joint *joint = &m->joint[j];
      double d[3];
      if (joint->type == CAV_JOINT_FREE || joint->type == CAV_JOINT_SLIDE) {
        p[i].moves = 1;
        continue;
      }
      sub3(d, joint->pos, p[i].anchor);
      if (n++ && norm3(d) > 1e-9) p[i].moves = 1;
      copy3(p[i].anchor, joint->pos);
    }
    memcpy(p[i].rest, rest[i].rotation, sizeof p[i].rest);
    transform(p[i].rest_pos, rest[i].pos, rest[i].rotation, p[i].anchor);
  }
}

static void y_up(double out[3], const double x[3]) { set3(out, x[0], x[2], -x[1]); }

// names are words
static void write_name(FILE *out, const cav_model *m, int link) {
  char label[96];
  cav_recording_body_name(m, m->link[link].body, label);
  for (char *c = label; *c; c++) fputc(isspace((unsigned char)*c) ? '_' : *c, out);
}

static void write_offset(FILE *out, int depth, const double x[3]) {
  double y[3];
  y_up(y, x);
  fprintf(out, "%*sOFFSET %.9g %.9g %.9g\n", 2 * depth, "", y[0], y[1], y[2]);
}

static int has_child(const cav_model *m, int link) {
  for (int k = 1; k < m->nlink; k++)
    if (m->link[k].parent == link) return 1;
  return 0;
}

// a link and what hangs from it, in the order in which its channels follow
static void write_joint(FILE *out, const cav_model *m, const part *p, int link, int root, int depth, int *order,
                        int *n) {
  static const double up[3] = {0, 0, 0.05};
  double d[3], none[3] = {0};
  int moves = root || p[link].moves;
  order[(*n)++] = link;
  fprintf(out, "%*s%s ", 2 * depth, "", root ? "ROOT" : "JOINT");
  write_name(out, m, link);
  fprintf(out, "\n%*s{\n", 2 * depth, "");
  // readers differ in whether positions are counted from the offset: there is none beside them
  if (!moves) sub3(d, p[link].rest_pos, p[m->link[link].parent].rest_pos);
  write_offset(out, depth + 1, moves ? none : d);
  fprintf(out, "%*sCHANNELS %s Zrotation Xrotation Yrotation\n", 2 * depth + 2, "",
          moves ? "6 Xposition Yposition Zposition" : "3");
  for (int k = 1; k < m->nlink; k++)
    if (m->link[k].parent == link) write_joint(out, m, p, k, 0, depth + 1, order, n);
  if (!has_child(m, link)) {
    // a bone ends at the centre of mass
    sub3(d, m->link[link].com, p[link].anchor);
    rotate(d, p[link].rest, (double[3]){d[0], d[1], d[2]});
    fprintf(out, "%*sEnd Site\n%*s{\n", 2 * depth + 2, "", 2 * depth + 2, "");
    write_offset(out, depth + 2, norm3(d) > 1e-3 ? d : up);
    fprintf(out, "%*s}\n", 2 * depth + 2, "");
  }
  fprintf(out, "%*s}\n", 2 * depth, "");
}

// world rotation away from the rest, axes as there
static void turned(double B[9], const cav_pose *pose, const part *p) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) B[3 * i + j] = dot3(pose->rotation + 3 * i, p->rest + 3 * j);
}

// R = Rz(a) Rx(b) Ry(c), y up
static void angles(const double R[9], double out[3]) {
  double S[9];
  static const int from[3] = {0, 2, 1};
  static const double sign[3] = {1, 1, -1};
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) S[3 * i + j] = sign[i] * sign[j] * R[3 * from[i] + from[j]];
  double s = fmin(1, fmax(-1, S[7]));
  out[1] = degrees * asin(s);
  if (1 - fabs(s) > 1e-12) {
    out[0] = degrees * atan2(-S[1], S[4]);
    out[2] = degrees * atan2(-S[6], S[8]);
  } else {
    out[0] = degrees * atan2(S[3], S[0]);
    out[2] = 0;
  }
}

static void write_sample(FILE *out, const cav_model *m, const part *p, const cav_pose *pose, const int *order, int n,
                         int root) {
  for (int i = 0; i < n; i++) {
    int link = order[i], parent = m->link[link].parent, top = link == root;
    double own[9], above[9], R[9], a[3], at[3], base[3], d[3], y[3];
    turned(own, &pose[link], &p[link]);
    transform(at, pose[link].pos, pose[link].rotation, p[link].anchor);
    memcpy(R, own, sizeof R);
    copy3(d, at);
    if (!top) {
      turned(above, &pose[parent], &p[parent]);
      for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
          R[3 * r + c] = above[r] * own[c] + above[3 + r] * own[3 + c] + above[6 + r] * own[6 + c];
      transform(base, pose[parent].pos, pose[parent].rotation, p[parent].anchor);
      sub3(at, at, base);
      rotate_back(d, above, at);
    }
    if (top || p[link].moves) {
      y_up(y, d);
      fprintf(out, "%s%.9g %.9g %.9g", i ? " " : "", y[0], y[1], y[2]);
    }
    angles(R, a);
    fprintf(out, "%s%.9g %.9g %.9g", i || top ? " " : "", a[0], a[1], a[2]);
  }
  fputc('\n', out);
}

cav_status cav_exchange_write_bvh(const cav_recording *r, const char *path, char note[CAV_EXCHANGE_NOTE],
                                  cav_error *error) {
  const cav_model *m = r->model;
  cav_state *state = cav_state_new(m);
  cav_pose *pose = cav_recording_poses(r, error);
  part *p = calloc((size_t)m->nlink, sizeof *p);
  int *order = calloc((size_t)m->nlink, sizeof *order), n = 0, trees = 0, moving = 0, root = 0;
  cav_file file;
  cav_status status = pose ? CAV_OK : error->status;
  if (!status && (!state || !p || !order)) status = cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the motion");
  if (!status) status = cav_position(m, state, m->q0);
  if (!status) status = cav_file_begin(&file, path, error);
  if (!status) {
    find_parts(m, state->link, p);
    for (int i = 1; i < m->nlink; i++)
      if (m->link[i].parent == 0) root = i, trees++;
    // one tree that floats is the root itself; else the world is, and trees hang from it
    if (trees != 1 || m->joint[m->link[root].joint].type != CAV_JOINT_FREE) root = 0;
    fputs("HIERARCHY\n", file.stream);
    write_joint(file.stream, m, p, root, 1, 0, order, &n);
    fprintf(file.stream, "MOTION\nFrames: %d\nFrame Time: %.9g\n", r->n, r->timestep);
    for (int i = 0; i < r->n; i++) write_sample(file.stream, m, p, pose + (size_t)i * (size_t)m->nlink, order, n, root);
    status = cav_file_end(&file, error);
  }
  for (int i = 1; i < m->nlink && p; i++) moving += p[i].moves && i != root;
  int used = snprintf(note, CAV_EXCHANGE_NOTE,
                      "a skeleton alone: shapes, masses, velocities, controls and contacts are not in it");
  if (moving && !status)
    snprintf(note + used, CAV_EXCHANGE_NOTE - (size_t)used,
             "; %d joints slide, float or turn about several points and have channels of position, which some readers "
             "take of the root alone",
             moving);
  cav_state_free(state);
  free(pose), free(p), free(order);
  return status;
}
