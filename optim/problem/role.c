/// Roles by structure. In the model's own configuration, upright along z, the bodies are a tree; what neither moves on a
/// joint nor has a shape is left aside. From the top of the tree on the trunk is followed: branches that are mirror images of
/// each other, left and right, in the place of their centres of mass, in mass and in joints, are a pair of limbs; all others
/// belong to the trunk. Real robots are their own image but for some millimetres, so places may differ by a hundredth
/// of a metre and 2 % of the size, masses by a fifth. A limb ends where it branches into parts of like mass (fingers) or
/// ends. Pairs whose ends are the lowest are legs: one makes a biped, two a quadruped, front before back; more are no
/// known build. The pair that hangs highest of the others is the arms; what rises from the trunk above the shoulders is the
/// head. A trunk that stands in the world and has no legs is one of arms; one without pairs and with a chain of three
/// joints or more is an arm. Forward is where feet point, else along +x, or +y where left and right lie along x.
#include "role.h"
#include "extent.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double place_tolerance = 0.01; // m
static const double size_tolerance = 0.02;  // of the size of the model
static const double mass_tolerance = 0.2;   // fraction
static const double low = 0.2;              // of the height: an end below it reaches the ground
static const double main_branch = 0.6;      // of the mass beyond a branching: the limb goes on there
enum { ARM_JOINTS = 3, LEG_JOINTS = 2, PAIRS = 32 };

/// What the subtree of a body comes to.
typedef struct subtree {
  int joints, kept;
  double mass, com[3];
} subtree;

/// Two limbs, right one first.
typedef struct limb_pair {
  int first[2], end[2];
  int trunk;                    // body that they are on
  double height, along, ground; // of where they begin; place of their ends along the front; lowest point of their ends
} limb_pair;

typedef struct search {
  const cav_model *model;
  const cav_state *state;
  subtree *tree;               // [nbody]
  double bottom, height, size; // of the lowest centre of mass, from there to the highest, largest extent; m
  double left[2], forward[2];  // unit
  double middle;               // place of the mirror along left
  int least_joints;            // of a limb

  limb_pair pair[PAIRS];
  int npair;
  int *trunk; // bodies of it
  int ntrunk;
} search;

const char *cav_role_name(cav_role role) {
  static const char *const names[] = {
#define CAV_ROLE_NAME(id, name) name,
      CAV_ROLES(CAV_ROLE_NAME)
#undef CAV_ROLE_NAME
  };
  return names[role];
}

cav_role cav_role_named(const char *name) {
  cav_role role = 0;
  while (role < CAV_ROLE_TYPES && strcmp(cav_role_name(role), name)) role++;
  return role;
}

const char *cav_build_name(cav_build build) {
  static const char *const names[] = {"nothing known", "biped", "quadruped", "arms"};
  return names[build];
}

void cav_roles_list(const cav_roles *roles, char *out, int size) {
  int at = 0;
  *out = 0;
  for (int r = 0; r < CAV_ROLE_TYPES; r++) {
    if (roles->body[r] < 0 || at >= size) continue;
    at += snprintf(out + at, (size_t)(size - at), "%s%s", at ? ", " : "", cav_role_name((cav_role)r));
  }
}

// ---------------------------------------------------------------- trees

// the body that stands on the world and carries body i
static int top_body(const cav_model *m, int i) {
  while (m->body[i].parent > 0) i = m->body[i].parent;
  return i;
}

// what subtrees hold, and how large that is which has more than one joint
static void gather(search *s) {
  const cav_model *m = s->model;
  double least[3] = {INFINITY, INFINITY, INFINITY}, most[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (int i = m->nbody - 1; i > 0; i--) {
    const cav_body *body = &m->body[i];
    subtree *t = &s->tree[i];
    cav_pose at;
    cav_object_pose(m, s->state, CAV_OBJECT_BODY, i, &at);
    int moves = body->link > 0 && m->link[body->link].body == i ? m->link[body->link].njoint : 0;
    t->joints += moves;
    t->mass += body->mass;
    t->kept |= moves > 0 || body->ngeom > 0 || body->mass > 0;
    for (int k = 0; k < 3; k++) t->com[k] += body->mass * at.pos[k];
    if (body->parent > 0) {
      subtree *up = &s->tree[body->parent];
      up->joints += t->joints, up->mass += t->mass, up->kept |= t->kept;
      for (int k = 0; k < 3; k++) up->com[k] += t->com[k];
    }
    for (int k = 0; k < 3; k++) t->com[k] = t->mass > 0 ? t->com[k] / t->mass : at.pos[k];
  }
  for (int i = 1; i < m->nbody; i++) {
    if (s->tree[top_body(m, i)].joints < 2 || !s->tree[i].kept) continue;
    cav_pose at;
    cav_object_pose(m, s->state, CAV_OBJECT_BODY, i, &at);
    for (int k = 0; k < 3; k++) least[k] = fmin(least[k], at.pos[k]), most[k] = fmax(most[k], at.pos[k]);
  }
  s->bottom = least[2], s->height = fmax(most[2] - least[2], 0);
  s->size = fmax(s->height, fmax(most[0] - least[0], most[1] - least[1]));
}

static int next_child(const search *s, int parent, int after) {
  const cav_model *m = s->model;
  for (int i = after + 1; i < m->nbody; i++) {
    if (m->body[i].parent == parent && s->tree[i].kept) return i;
  }
  return -1;
}

static double lateral(const search *s, const double *p) { return s->left[0] * p[0] + s->left[1] * p[1]; }

static double ahead(const search *s, const double *p) { return s->forward[0] * p[0] + s->forward[1] * p[1]; }

static int is_image(const search *s, int a, int b) {
  const subtree *t = &s->tree[a], *u = &s->tree[b];
  double near = place_tolerance + size_tolerance * s->size, x = lateral(s, t->com) - s->middle,
         y = lateral(s, u->com) - s->middle;
  // sides are told apart by more than the tolerance
  return t->joints >= s->least_joints && t->joints == u->joints && x * y < 0 && fabs(x - y) > near &&
         fabs(x + y) <= near && fabs(t->com[2] - u->com[2]) <= near &&
         fabs(ahead(s, t->com) - ahead(s, u->com)) <= near &&
         fabs(t->mass - u->mass) <= mass_tolerance * fmax(t->mass, u->mass);
}

// where a limb ends: it goes on along its only child, or the one that has most of the mass
static int limb_end(const search *s, int body) {
  for (;;) {
    int best = -1;
    double total = 0;
    for (int c = next_child(s, body, body); c >= 0; c = next_child(s, body, c)) {
      total += s->tree[c].mass;
      if (best < 0 || s->tree[c].mass > s->tree[best].mass) best = c;
    }
    if (best < 0 || s->tree[best].mass < main_branch * total) return body;
    body = best;
  }
}

// lowest point of a body's geoms, or its centre of mass
static double lowest(const search *s, int i) {
  const cav_model *m = s->model;
  const cav_body *body = &m->body[i];
  cav_pose at;
  cav_object_pose(m, s->state, CAV_OBJECT_BODY, i, &at);
  double least = body->ngeom ? INFINITY : at.pos[2];
  for (int g = body->geom; g < body->geom + body->ngeom; g++) {
    cav_object_pose(m, s->state, CAV_OBJECT_GEOM, g, &at);
    least = fmin(least, cav_geom_bottom(m, g, &at));
  }
  return least;
}

// follows the trunk from a body of it
static void follow(search *s, int body) {
  for (int a = next_child(s, body, body); a >= 0; a = next_child(s, body, a)) {
    int other = -1;
    for (int b = next_child(s, body, body); b >= 0 && other < 0; b = next_child(s, body, b))
      if (b != a && is_image(s, a, b)) other = b;
    if (other < 0) {
      if (body > 0 || s->tree[a].joints >= ARM_JOINTS) {
        s->trunk[s->ntrunk++] = a;
        follow(s, a);
      }
      continue;
    }
    if (other < a || s->npair == PAIRS) continue;
    limb_pair *pair = &s->pair[s->npair++];
    int swap = lateral(s, s->tree[a].com) > lateral(s, s->tree[other].com);
    *pair = (limb_pair){.first = {swap ? other : a, swap ? a : other}, .trunk = body, .ground = INFINITY};
    for (int k = 0; k < 2; k++) {
      cav_pose at;
      pair->end[k] = limb_end(s, pair->first[k]);
      pair->ground = fmin(pair->ground, lowest(s, pair->end[k]));
      cav_object_pose(s->model, s->state, CAV_OBJECT_XBODY, pair->first[k], &at);
      pair->height += at.pos[2] / 2;
      cav_object_pose(s->model, s->state, CAV_OBJECT_BODY, pair->end[k], &at);
      pair->along += ahead(s, at.pos) / 2;
    }
  }
}

// ---------------------------------------------------------------- roles

static void assign(cav_roles *roles, const limb_pair *pair, cav_role right, cav_role left) {
  const cav_role role[2] = {right, left};
  for (int k = 0; k < 2; k++) roles->body[role[k]] = pair->end[k], roles->limb[role[k]] = pair->first[k];
}

// the main body of what a limb is on
static int carrier(const search *s, int trunk) {
  const cav_model *m = s->model;
  if (trunk <= 0) return -1;
  return m->body[trunk].link > 0 ? m->link[m->body[trunk].link].body : trunk;
}

// highest body of the trunk that stands above the shoulders
static int find_head(const search *s, int torso, double shoulders) {
  int head = -1;
  for (int i = 0; i < s->ntrunk; i++) {
    int body = s->trunk[i];
    int bare = s->model->body[body].ngeom == 0 && s->tree[body].joints == 0;
    if (body == torso || bare || s->tree[body].com[2] <= shoulders) continue;
    if (head < 0 || s->tree[body].com[2] > s->tree[head].com[2]) head = body;
  }
  return head;
}

// the geom at the end of a shank that is a foot, too: its lowest, of several; -1: the body will do
static int find_tip(const search *s, int i) {
  const cav_body *body = &s->model->body[i];
  int tip = -1;
  double least = INFINITY;
  for (int g = body->geom; g < body->geom + body->ngeom && body->ngeom > 1; g++) {
    cav_pose at;
    cav_object_pose(s->model, s->state, CAV_OBJECT_GEOM, g, &at);
    double z = cav_geom_bottom(s->model, g, &at);
    if (z < least && *s->model->geom[g].name) least = z, tip = g;
  }
  return tip;
}

// where the feet of a biped point: right and left change places where it is backwards
static void face(search *s, limb_pair *legs) {
  double way = 0;
  for (int k = 0; k < 2; k++) {
    const cav_body *foot = &s->model->body[legs->end[k]];
    cav_pose ankle, at;
    cav_object_pose(s->model, s->state, CAV_OBJECT_XBODY, legs->end[k], &ankle);
    double front = -INFINITY, back = INFINITY, from = ahead(s, ankle.pos);
    for (int g = foot->geom; g < foot->geom + foot->ngeom; g++) {
      cav_object_pose(s->model, s->state, CAV_OBJECT_GEOM, g, &at);
      const double n[3] = {s->forward[0], s->forward[1], 0}, behind[3] = {-n[0], -n[1], 0};
      front = fmax(front, ahead(s, at.pos) + cav_geom_reach(s->model, g, &at, n));
      back = fmin(back, ahead(s, at.pos) - cav_geom_reach(s->model, g, &at, behind));
    }
    if (foot->ngeom) way += (front + back) / 2 - from;
  }
  if (way > -place_tolerance) return;
  for (int k = 0; k < 2; k++) s->left[k] = -s->left[k], s->forward[k] = -s->forward[k];
  for (int i = 0; i < s->npair; i++) {
    limb_pair *p = &s->pair[i];
    int first = p->first[0], end = p->end[0];
    p->first[0] = p->first[1], p->first[1] = first;
    p->end[0] = p->end[1], p->end[1] = end;
  }
}

// legs, arms and trunk out of the pairs
static void name_roles(search *s, cav_roles *roles) {
  limb_pair *legs[PAIRS] = {0}, *arms = NULL;
  int nleg = 0;
  double trunk = INFINITY;
  for (int i = 0; i < s->ntrunk; i++) trunk = fmin(trunk, lowest(s, s->trunk[i]));
  for (int i = 0; i < s->npair; i++) {
    limb_pair *p = &s->pair[i];
    if (p->trunk > 0 && p->ground < fmin(trunk, s->bottom + low * s->height))
      legs[nleg++] = p;
    else if (s->tree[p->first[0]].joints >= ARM_JOINTS && (!arms || p->height > arms->height))
      arms = p;
  }
  if (nleg > 2) {
    snprintf(roles->why, sizeof roles->why, "%d limbs reach the ground: neither a biped nor a quadruped", 2 * nleg);
    return;
  }
  if (nleg == 0 && !arms) {
    snprintf(roles->why, sizeof roles->why, "no limbs reach the ground, and none has the %d joints of an arm",
             ARM_JOINTS);
    return;
  }
  roles->build = nleg == 2 ? CAV_BUILD_QUADRUPED : nleg == 1 ? CAV_BUILD_BIPED : CAV_BUILD_ARMS;
  if (nleg == 2) {
    int front = legs[1]->along > legs[0]->along;
    assign(roles, legs[front], CAV_ROLE_FRONT_RIGHT_FOOT, CAV_ROLE_FRONT_LEFT_FOOT);
    assign(roles, legs[!front], CAV_ROLE_BACK_RIGHT_FOOT, CAV_ROLE_BACK_LEFT_FOOT);
    roles->body[CAV_ROLE_PELVIS] = carrier(s, legs[!front]->trunk);
    roles->body[CAV_ROLE_TORSO] = carrier(s, legs[front]->trunk);
  } else if (nleg == 1) {
    face(s, legs[0]);
    assign(roles, legs[0], CAV_ROLE_RIGHT_FOOT, CAV_ROLE_LEFT_FOOT);
    roles->body[CAV_ROLE_PELVIS] = carrier(s, legs[0]->trunk);
    roles->body[CAV_ROLE_TORSO] = carrier(s, arms ? arms->trunk : legs[0]->trunk);
  } else if (arms) {
    roles->body[CAV_ROLE_TORSO] = carrier(s, arms->trunk);
  }
  if (arms) assign(roles, arms, CAV_ROLE_RIGHT_HAND, CAV_ROLE_LEFT_HAND);
  for (int r = CAV_ROLE_FRONT_RIGHT_FOOT; r <= CAV_ROLE_BACK_LEFT_FOOT; r++)
    if (roles->body[r] >= 0) roles->geom[r] = find_tip(s, roles->body[r]);
  if (nleg < 2 && arms) roles->body[CAV_ROLE_HEAD] = find_head(s, roles->body[CAV_ROLE_TORSO], arms->height);
}

// a chain that stands in the world
static void name_arm(search *s, int main, cav_roles *roles) {
  if (main < 0 || roles->base != CAV_BASE_FIXED || s->tree[main].joints < ARM_JOINTS) {
    snprintf(roles->why, sizeof roles->why, "no limbs in pairs, left and right, and no arm that stands in the world");
    return;
  }
  roles->build = CAV_BUILD_ARMS;
  roles->limb[CAV_ROLE_HAND] = main;
  roles->body[CAV_ROLE_HAND] = limb_end(s, main);
}

// the body on the world whose subtree has the most joints; -1: nothing moves
static int main_tree(const search *s) {
  int best = -1;
  for (int c = next_child(s, 0, 0); c >= 0; c = next_child(s, 0, c))
    if (s->tree[c].joints > (best < 0 ? 0 : s->tree[best].joints)) best = c;
  return best;
}

// how that tree stands in the world
static cav_base base_of(const cav_model *m, int body) {
  const cav_link *link = &m->link[m->body[body].link];
  int slides = 0;
  for (int j = link->joint; m->body[body].link > 0 && j < link->joint + link->njoint; j++) {
    if (m->joint[j].type == CAV_JOINT_FREE) return CAV_BASE_FREE;
    slides += m->joint[j].type == CAV_JOINT_SLIDE;
  }
  return slides > 1 ? CAV_BASE_PLANAR : CAV_BASE_FIXED;
}

// the plane of the mirror: through the frame of the main tree; trees side by side mirror each other about the origin
static void place_mirror(search *s, int main) {
  cav_pose at;
  int twin = 0;
  for (int c = next_child(s, 0, 0); c >= 0; c = next_child(s, 0, c))
    twin |= c != main && s->tree[c].joints == s->tree[main].joints && s->tree[c].joints >= ARM_JOINTS;
  cav_object_pose(s->model, s->state, CAV_OBJECT_XBODY, main, &at);
  s->middle = twin ? 0 : lateral(s, at.pos);
}

// pairs, roles out of them
static void find(search *s, cav_roles *roles) {
  gather(s);
  int main = main_tree(s);
  cav_base base = roles->base = main < 0 ? CAV_BASE_FIXED : base_of(s->model, main);
  s->least_joints = base == CAV_BASE_FIXED ? ARM_JOINTS : LEG_JOINTS;
  // sides lie along y, or else along x; along the way of what moves in a plane there are none
  for (int axis = 0; axis < 2 && main >= 0 && s->npair == 0 && !(axis && base == CAV_BASE_PLANAR); axis++) {
    s->left[0] = -axis, s->left[1] = !axis;
    s->forward[0] = !axis, s->forward[1] = axis;
    s->ntrunk = 0;
    place_mirror(s, main);
    follow(s, 0);
  }
  if (s->npair)
    name_roles(s, roles);
  else
    name_arm(s, main, roles);
  memcpy(roles->left, s->left, sizeof roles->left);
}

cav_status cav_roles_find(const cav_model *m, cav_state *state, cav_roles *roles) {
  *roles = (cav_roles){.left = {0, 1}};
  for (int r = 0; r < CAV_ROLE_TYPES; r++) roles->body[r] = roles->limb[r] = roles->geom[r] = -1;
  search *s = calloc(1, sizeof *s);
  subtree *tree = calloc((size_t)m->nbody, sizeof *tree);
  int *trunk = calloc((size_t)m->nbody, sizeof *trunk);
  cav_status status = s && tree && trunk ? cav_position(m, state, m->q0) : CAV_NO_MEMORY;
  if (status == CAV_OK) {
    *s = (search){.model = m, .state = state, .tree = tree, .trunk = trunk};
    find(s, roles);
  }
  free(s), free(tree), free(trunk);
  return status;
}
