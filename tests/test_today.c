/// MJCF of today, feature by feature: small models and the numbers that follow from them by hand. Where node and the
/// package @mujoco/mujoco are (CAVORT_MUJOCO_JS names its mujoco.js), MuJoCo 3's compiled models and its mj_inverse of
/// random states are compared too (peer_mujoco3.mjs).
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cavort/dynamics.h"
#include "check.h"

#ifndef CAVORT_SOURCE_ROOT
#define CAVORT_SOURCE_ROOT "."
#endif

// a body of 2 kg whose centre is 1 m from its hinge, with moments of 1: the inertia about the hinge is 3
#define ARM(joint) "<body name='arm'><joint name='j' " joint "/>" MASS
#define MASS "<inertial mass='2' pos='1 0 0' diaginertia='1 1 1'/>"
#define ARM_ONLY(joint) "<worldbody>" ARM(joint) "</body></worldbody>"
// an L of area 1.92, perimeter 7.6 and height 0.4, whose hull has an area of 2.76
#define L_MESH(kind)                                                                                               \
  "<asset><mesh name='l' " kind                                                                                    \
  " scale='1 1.2 1' vertex='0 0 0 2 0 0 2 .5 0 .6 .5 0 .6 1.5 0 0 1.5 0 0 0 .4 2 0 .4 2 .5 .4 .6 .5 .4 .6 1.5 .4 " \
  "0 1.5 .4' face='0 2 1 6 7 8 0 3 2 6 8 9 0 4 3 6 9 10 0 5 4 6 10 11 0 1 7 0 7 6 1 2 8 1 8 7 2 3 9 2 9 8 3 4 10 " \
  "3 10 9 4 5 11 4 11 10 5 0 6 5 6 11'/></asset><worldbody><body><freejoint/><geom type='mesh' mesh='l'/></body>"  \
  "</worldbody>"
// a brick with half lengths 1, 2 and 3
#define BRICK(compiler, type)                                                                                \
  compiler                                                                                                   \
      "<asset><mesh name='b' vertex='-1 -2 -3 1 -2 -3 -1 2 -3 1 2 -3 -1 -2 3 1 -2 3 -1 2 3 1 2 3'/></asset>" \
      "<worldbody><body><freejoint/><geom mesh='b' type=" type "/></body></worldbody>"
// four corners of a volume of 5, and a fifth point a little outside of it
#define TETRAHEDRON "<asset><mesh name='t' vertex='-3 0 0 3 0 0 0 2.5 0 0 0 2 0 -.1 -.1'/></asset>"
#define SHELL(shape) "<worldbody><body><freejoint/><geom shellinertia='true' " shape "/></body></worldbody>"

typedef struct expected {
  const char *what;
  int index;
  double value;
} expected;

typedef struct feature {
  const char *name, *text;
  expected number[8];
  int states;  ///< random states in which the inverse is compared with MuJoCo's
  int differs; ///< the compiled numbers differ from MuJoCo's, which leaves out later
} feature;

static const feature features[] = {
    // Aloha's fingers; seen: MuJoCo mixes the two as they stand and cuts what comes out to [0.0001, 0.9999]
    {"impedances beyond 1, mixed and then cut",
     "<worldbody><geom type='plane' size='9 9 1' solimp='.2 .3 .5'/><body pos='0 0 .3'><freejoint/><geom size='.6' "
     "solimp='2 1 .01 3 .2'/></body></worldbody>",
     {{"warnings", 0, 1}},
     20,
     0},
    {"springdamper", ARM_ONLY("springdamper='.5 .7'"), {{"stiffness", 0, 3 / .1225}, {"damping", 0, 12}}, 20, 0},
    {"effort limit of a joint",
     ARM_ONLY("actuatorfrcrange='-20 30'") "<actuator><motor joint='j' gear='2' ctrlrange='-99 99'/></actuator>",
     {{"force low", 0, -10}, {"force high", 0, 15}, {"effort low", 0, -10}, {"effort high", 0, 15}},
     0,
     0},
    {"effort limit, gear turned round",
     ARM_ONLY(
         "actuatorfrcrange='-20 30' actuatorfrclimited='true'") "<actuator><motor joint='j' gear='-2'/></actuator>",
     {{"force low", 0, -15}, {"force high", 0, 10}},
     0,
     0},
    {"effort limit of a class and a force range",
     "<default><joint actuatorfrcrange='-20 30'/></default>" ARM_ONLY("") "<actuator><position joint='j' kp='5' "
                                                                          "forcerange='-25 12'/></actuator>",
     {{"force low", 0, -20}, {"force high", 0, 12}, {"gain", 0, 5}, {"bias 1", 0, -5}},
     0,
     0},
    {"effort limit switched off",
     ARM_ONLY("actuatorfrcrange='-20 30' actuatorfrclimited='false'") "<actuator><motor joint='j'/></actuator>",
     {{"force limited", 0, 0}},
     0,
     0},
    {"effort limit of two motors: even fractions",
     ARM_ONLY("actuatorfrcrange='-20 30'") "<actuator><motor joint='j'/><motor joint='j' gear='5'/></actuator>",
     {{"force low", 0, -10}, {"force high", 0, 15}, {"force low", 1, -2}, {"force high", 1, 3}, {"warnings", 0, 1}},
     0,
     0},
    {"effort limit through a tendon",
     ARM_ONLY("actuatorfrcrange='-20 30'") "<tendon><fixed name='t'><joint joint='j' coef='4'/></fixed></tendon>"
                                           "<actuator><motor tendon='t' gear='.5'/></actuator>",
     {{"force low", 0, -10}, {"force high", 0, 15}},
     0,
     0},
    {"effort limit of a tendon",
     ARM_ONLY("") "<tendon><fixed name='t' actuatorfrcrange='-6 8'><joint joint='j' coef='4'/></fixed></tendon>"
                  "<actuator><motor tendon='t' gear='2'/></actuator>",
     {{"force low", 0, -3}, {"force high", 0, 4}},
     0,
     0},
    {"kv", ARM_ONLY("") "<actuator><position joint='j' kp='12' kv='3'/></actuator>", {{"bias 2", 0, -3}}, 0, 0},
    {"dampratio",
     ARM_ONLY("") "<actuator><position joint='j' kp='12' dampratio='.5'/></actuator>",
     {{"bias 2", 0, -6}},
     0,
     0},
    {"dampratio of a class, in general's words",
     "<default><general biastype='affine' gainprm='12' biasprm='0 -12 1'/></default>" ARM_ONLY(
         "armature='9'") "<actuator><general joint='j'/><position joint='j' kp='3'/><position joint='j' "
                         "kv='7'/></actuator>",
     {{"bias 2", 0, -24}, {"bias 2", 1, -12}, {"bias 2", 2, -7}},
     0,
     0},
    {"dampratio through a gear",
     ARM_ONLY("") "<actuator><position joint='j' kp='12' gear='2' dampratio='1'/></actuator>",
     {{"bias 2", 0, -6}},
     0,
     0},
    {"inheritrange",
     "<compiler angle='radian'/>" ARM_ONLY("range='-1 2'") "<actuator><position joint='j' inheritrange='.8'/>"
                                                           "<intvelocity joint='j' inheritrange='1'/></actuator>",
     {{"ctrl low", 0, -.7}, {"ctrl high", 0, 1.7}, {"act low", 1, -1}, {"act high", 1, 2}},
     0,
     0},
    {"timeconst",
     ARM_ONLY("") "<actuator><position joint='j' timeconst='.1'/><general joint='j' dyntype='filterexact'/></actuator>",
     {{"activation", 0, CAV_ACTIVATION_FILTER}, {"time constant", 0, .1}, {"activation", 1, CAV_ACTIVATION_FILTER}},
     0,
     0},
    {"armature and damping of an actuator",
     ARM_ONLY("armature='.5' damping='.25'") "<actuator><motor joint='j' gear='2' armature='.3' damping='.1'/>"
                                             "</actuator>",
     {{"armature", 0, 1.7}, {"damping", 0, .65}},
     20,
     0},
    {"armature of tendons of one joint",
     ARM_ONLY("armature='.5' frictionloss='2'") "<tendon><fixed armature='.3'><joint joint='j' coef='2'/></fixed>"
                                                "<fixed armature='.1'><joint joint='j' coef='-3'/></fixed></tendon>",
     {{"armature", 0, .5 + .3 * 4 + .1 * 9}},
     20,
     0},
    {"lists of one number",
     ARM_ONLY("stiffness='3 0 0' damping='2 0'") "<tendon><fixed stiffness='4 0' damping='1 0 0'><joint joint='j' "
                                                 "coef='2'/></fixed></tendon>",
     {{"stiffness", 0, 3}, {"damping", 0, 2}},
     20,
     0},
    {"a group of actuators switched off",
     "<option actuatorgroupdisable='2 5'/>" ARM_ONLY("") "<actuator><motor joint='j' group='2' name='a'/>"
                                                         "<motor joint='j' name='b'/></actuator>"
                                                         "<sensor><actuatorfrc actuator='a'/></sensor>",
     {{"actuators", 0, 1}, {"sensors", 0, 0}, {"warnings", 0, 2}},
     0,
     1},
    {"gravity compensation",
     "<worldbody><body gravcomp='.5'><joint name='j' axis='0 1 0'/>" MASS "</body></worldbody>",
     {{"hold", 0, -9.81}},
     20,
     0},
    {"gravity compensation by actuators",
     "<worldbody><body gravcomp='.5'><joint name='j' axis='0 1 0' actuatorgravcomp='true'/>" MASS "</body></worldbody>",
     {{"hold", 0, -19.62}},
     20,
     0},
    {"gravity compensation, of some joints by actuators",
     "<default><default class='lifts'><joint actuatorgravcomp='true'/></default></default><worldbody><body "
     "gravcomp='.3'>"
     "<freejoint/>" MASS "<body gravcomp='1' pos='0 0 .5' childclass='lifts'><joint axis='0 1 0' pos='.1 0 0'/>" MASS
     "<body gravcomp='.5' pos='.3 0 .5'><joint type='ball' actuatorgravcomp='true'/>" MASS
     "<body gravcomp='2' pos='0 1 0'>"
     "<joint type='slide' axis='1 0 1' actuatorgravcomp='false'/>" MASS "</body></body></body></body></worldbody>",
     {{"bodies", 0, 5}},
     20,
     0},
    {"a spring that is slack between two lengths",
     "<option gravity='0 0 0'/><worldbody><body><joint name='j' type='slide'/>" MASS "</body></worldbody>"
     "<tendon><fixed springlength='0 1' stiffness='5'><joint joint='j' coef='2'/></fixed></tendon>",
     {{"spring low", 0, 0}, {"spring high", 0, 1}, {"pull at .25", 0, 0}, {"pull at 1", 0, 10}, {"pull at -1", 0, -20}},
     20,
     0},
    {"springs off",
     "<option><flag spring='disable'/></option>" ARM_ONLY("stiffness='3' damping='2'"),
     {{"stiffness", 0, 0}, {"damping", 0, 2}},
     20,
     1},
    {"dampers off",
     "<option><flag damper='disable'/></option>" ARM_ONLY("stiffness='3' damping='2'"),
     {{"stiffness", 0, 3}, {"damping", 0, 0}},
     20,
     1},
    {"exact mesh", L_MESH("inertia='exact'"), {{"mass", 1, 768}}, 0, 0},
    {"mesh by its hull", L_MESH("inertia='convex'"), {{"mass", 1, 1104}}, 0, 0},
    {"mesh as a shell", L_MESH("inertia='shell'"), {{"mass", 1, 6880}}, 0, 0},
    {"mesh of a class",
     "<default><mesh inertia='exact' maxhullvert='20'/></default>" L_MESH(""),
     {{"mass", 1, 768}},
     0,
     0},
    {"hull of four vertices",
     "<default><mesh maxhullvert='4'/></default>" TETRAHEDRON
     "<worldbody><body><freejoint/><geom type='mesh' mesh='t'/>"
     "</body></worldbody>",
     {{"mass", 1, 5000}},
     20,
     0},
    {"mesh that only a pair lets touch",
     TETRAHEDRON
     "<default><geom contype='0' conaffinity='0'/></default><worldbody><geom name='floor' type='plane' "
     "size='1 1 1'/><body><freejoint/>" MASS "<geom name='t' type='mesh' mesh='t' mass='0'/><geom type='mesh' "
     "mesh='t' mass='0'/></body></worldbody><contact><pair geom1='floor' geom2='t' margin='.07'/></contact>",
     {{"pair margin", 0, .07}, {"warnings", 0, 1}},
     0,
     0},
    {"box fitted",
     BRICK("", "'box'"),
     {{"size 0", 0, 1}, {"size 1", 0, 2}, {"size 2", 0, 3}, {"mass", 1, 48000}},
     0,
     0},
    {"box fitted, half as large", BRICK("", "'box' fitscale='.5'"), {{"size 0", 0, .5}, {"size 2", 0, 1.5}}, 0, 0},
    {"sphere fitted", BRICK("", "'sphere'"), {{"size 0", 0, 2}}, 0, 0},
    {"capsule fitted", BRICK("", "'capsule'"), {{"size 0", 0, 1.5}, {"size 1", 0, 2.25}}, 0, 0},
    {"cylinder fitted", BRICK("", "'cylinder'"), {{"size 0", 0, 1.5}, {"size 1", 0, 3}}, 0, 0},
    {"sphere about a box", BRICK("<compiler fitaabb='true'/>", "'sphere'"), {{"size 0", 0, 3}}, 0, 0},
    {"capsule in a box", BRICK("<compiler fitaabb='true'/>", "'capsule'"), {{"size 0", 0, 2}, {"size 1", 0, 1}}, 0, 0},
    {"shell of a sphere",
     SHELL("size='.1' mass='3'"),
     {{"mass", 1, 3}, {"moment", 0, .02}, {"moment", 1, .02}, {"moment", 2, .02}},
     0,
     0},
    {"shell of a box",
     SHELL("type='box' size='.1 .2 .3'"),
     // faces of 0.24, 0.12 and 0.08 m^2, two of each, at 0.1, 0.2 and 0.3 m
     {{"mass", 1, 880}, {"moment", 0, 54.1333333333}, {"moment", 1, 42.1333333333}, {"moment", 2, 24.2666666667}},
     0,
     0},
    {"shell of a cylinder",
     SHELL("type='cylinder' size='.1 .2' density='100'"),
     {{"mass", 1, 10 * M_PI}, {"moment", 2, .09 * M_PI}},
     0,
     0},
    {"shell of a capsule",
     SHELL("type='capsule' size='.1 .2' density='100'"),
     {{"mass", 1, 12 * M_PI}, {"moment", 2, (.08 + .04 * 2 / 3) * M_PI}},
     0,
     0},
    {"frame in frame",
     "<worldbody><frame pos='1 0 0' euler='0 0 90'><frame pos='1 0 0'><body name='b' pos='0 0 1'><freejoint/>" MASS
     "</body></frame></frame></worldbody>",
     {{"x", 0, 1}, {"y", 0, 1}, {"z", 0, 1}},
     0,
     0},
    {"replicate",
     "<worldbody><replicate count='12' offset='1 0 0' euler='0 0 90' sep='-'><body name='b' pos='1 0 0'>"
     "<joint name='j'/>" MASS "</body></replicate></worldbody><actuator><motor name='m' joint='j'/></actuator>"
     "<sensor><jointpos joint='j-03'/></sensor>",
     {{"bodies", 0, 13}, {"actuators", 0, 12}, {"sensors", 0, 1}, {"body b-11", 0, 12}, {"motor m-05", 0, 5}},
     0,
     0},
    {"replicate in replicate",
     "<worldbody><replicate count='2' offset='1 0 0'><replicate count='3' offset='0 1 0'><body name='b'><joint/>" MASS
     "</body></replicate></replicate></worldbody>",
     {{"bodies", 0, 7}, {"body b21", 0, 6}},
     0,
     0},
    {"sites that are one point",
     "<worldbody><site name='w' pos='1 2 3'/><body name='arm'><joint/>" MASS "<site name='s' pos='0 1 0'/></body>"
     "</worldbody><equality><connect site1='s' site2='w'/></equality>",
     {{"equality y", 0, 1}, {"equality z", 1, 3}},
     0,
     0},
    {"sites that are one frame",
     "<worldbody><site name='w' pos='1 .2 .3'/><body name='arm'><joint/>" MASS
     "<site name='s' pos='0 1 0' euler='0 0 90'/></body></worldbody><equality><weld site1='s' site2='w'/></equality>",
     {{"equality y", 0, 1}, {"equality z", 1, .3}},
     0,
     0},
    {"connect and weld between bodies that turn",
     "<worldbody><body name='a'><freejoint/>" MASS "</body><body name='b' pos='0 1 0'><joint/>" MASS
     "</body></worldbody><equality><connect body1='a' body2='b' anchor='.3 .2 .1'/><weld body1='a' body2='b' "
     "torquescale='1'/></equality>",
     {{"equality y", 0, .2}},
     20,
     0},
    {"contacts all alike",
     "<option o_margin='.05' o_friction='.3 .4 .05' o_solref='.04 1'><flag override='enable'/></option>"
     "<worldbody><geom type='plane' size='1 1 1'/><body><freejoint/><geom size='.1' friction='2'/></body></worldbody>",
     {{"pair margin", 0, .05}, {"pair friction 0", 0, .3}, {"pair friction 1", 0, .4}, {"pair solref", 0, .04}},
     0,
     0},
    {"heights in the file",
     "<asset><hfield name='h' nrow='2' ncol='3' size='1 1 2 1' elevation='0 1 2  3 4 5'/></asset><worldbody>"
     "<geom type='hfield' hfield='h'/><body><freejoint/>" MASS "</body></worldbody>",
     {{"height", 0, 1.2}, {"height", 2, 2}, {"height", 3, 0}},
     0,
     0},
    {"a file without a world",
     "<asset><material name='m'/></asset>",
     {{"bodies", 0, 1}, {"links", 0, 1}, {"warnings", 0, 1}},
     0,
     0},
    {"effort limit beside an actuator at a site",
     ARM_ONLY("actuatorfrcrange='-20 30'/><site name='s'") "<actuator><motor joint='j'/><motor site='s'/></actuator>",
     {{"force low", 0, -20}, {"force high", 0, 30}, {"force limited", 1, 0}, {"warnings", 0, 1}},
     0,
     0},
    {"nothing moves",
     "<worldbody><geom type='box' size='1 1 1'/></worldbody>",
     {{"bodies", 0, 1}, {"links", 0, 1}},
     0,
     0},
    {"text between tags",
     "eins<worldbody>zwei" ARM("") "</body></worldbody>drei",
     {{"bodies", 0, 2}, {"warnings", 0, 1}},
     0,
     0},
    {"hyphens in a comment", "<!-- a -- b -->" ARM_ONLY(""), {{"bodies", 0, 2}, {"warnings", 0, 0}}, 0, 0},
    {"what is seen, sensed or tunes a solver",
     "<extension/><option iterations='3' ls_iterations='5' ccd_iterations='9'>"
     "<flag multiccd='enable' nativeccd='disable' autoreset='disable' invdiscrete='enable'/></option>"
     "<asset><texture name='t' builtin='flat' width='8' height='8'/><material name='m' metallic='1' roughness='0'>"
     "<layer role='rgb' texture='t'/></material></asset>" ARM_ONLY(
         "") "<sensor><contact body1='arm' reduce='mindist'/><e_kinetic/><clock delay='.1' nsample='3'/></sensor>",
     {{"sensors", 0, 1}, {"warnings", 0, 1}},
     0,
     0},
};

// --- numbers of a model by their names ---

static double held(const cav_model *m, double q0, double v_next) {
  cav_state *state = cav_state_new(m);
  double q[1] = {q0}, v[1] = {v_next}, u[1] = {NAN};
  if (CHECK(state && m->nq == 1)) CHECK(cav_inverse(m, state, q, v, v, u) == CAV_OK);
  cav_state_free(state);
  return u[0];
}

// of joints, actuators, bodies: what a name says of index i; 0: no such name
static int number_of(const cav_model *m, const char *what, int i, double *x) {
  double low = 0, high = 0, range[2] = {0, 0};
  const cav_actuator *a = i < m->nactuator ? &m->actuator[i] : NULL;
  if (a) low = a->unit * a->forcerange[0], high = a->unit * a->forcerange[1];
  if (a) cav_actuator_effort_range(m, i, range);
  const cav_joint *j = i < m->njoint ? &m->joint[i] : NULL;
  const cav_geom *g = i < m->ngeom ? &m->geom[i] : NULL;
  const struct {
    const char *what;
    int known;
    double x;
  } numbers[] = {{"stiffness", j != NULL, j ? j->stiffness : 0},
                 {"damping", j != NULL, j ? m->dof[j->dof].damping : 0},
                 {"armature", j != NULL, j ? m->dof[j->dof].armature : 0},
                 {"force limited", a != NULL, a ? a->forcelimited : 0},
                 {"force low", a && a->forcelimited, low},
                 {"force high", a && a->forcelimited, high},
                 {"effort low", a != NULL, range[0]},
                 {"effort high", a != NULL, range[1]},
                 {"gain", a != NULL, a ? a->gain_parameter[0] : 0},
                 {"bias 1", a != NULL, a ? a->bias_parameter[1] : 0},
                 {"bias 2", a != NULL, a ? a->bias_parameter[2] : 0},
                 {"ctrl low", a && a->ctrllimited, a ? a->ctrlrange[0] : 0},
                 {"ctrl high", a && a->ctrllimited, a ? a->ctrlrange[1] : 0},
                 {"act low", a && a->actlimited, a ? a->actrange[0] : 0},
                 {"act high", a && a->actlimited, a ? a->actrange[1] : 0},
                 {"activation", a != NULL, a ? (double)a->activation : 0},
                 {"time constant", a != NULL, a ? a->activation_parameter[0] : 0},
                 {"mass", i < m->nbody, i < m->nbody ? m->body[i].mass : 0},
                 {"moment", m->nbody > 1 && i<3, m->nbody> 1 && i < 3 ? m->body[1].inertia[i] : 0},
                 {"size 0", g != NULL, g ? g->size[0] : 0},
                 {"size 1", g != NULL, g ? g->size[1] : 0},
                 {"size 2", g != NULL, g ? g->size[2] : 0},
                 {"x", m->nq >= 7, m->nq >= 7 ? m->q0[0] : 0},
                 {"y", m->nq >= 7, m->nq >= 7 ? m->q0[1] : 0},
                 {"z", m->nq >= 7, m->nq >= 7 ? m->q0[2] : 0},
                 {"spring low", i < m->ntendon, i < m->ntendon ? m->tendon[i].springlength[0] : 0},
                 {"spring high", i < m->ntendon, i < m->ntendon ? m->tendon[i].springlength[1] : 0},
                 {"equality y", m->nequality && i < 2, m->nequality ? m->equality[0].pos[i & 1][1] : 0},
                 {"equality z", m->nequality && i < 2, m->nequality ? m->equality[0].pos[i & 1][2] : 0},
                 {"pair margin", i < m->npair, i < m->npair ? m->pair[i].margin : 0},
                 {"pair friction 0", i < m->npair, i < m->npair ? m->pair[i].friction[0] : 0},
                 {"pair friction 1", i < m->npair, i < m->npair ? m->pair[i].friction[1] : 0},
                 {"pair solref", i < m->npair, i < m->npair ? m->pair[i].softness.solref[0] : 0},
                 {"height", m->nhfield > 0, m->nhfield ? m->hfield[0].height[i] : 0},
                 {"bodies", 1, m->nbody},
                 {"links", 1, m->nlink},
                 {"actuators", 1, m->nactuator},
                 {"sensors", 1, m->nsensor},
                 {"warnings", 1, m->nwarning}};
  for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++) {
    if (strcmp(numbers[k].what, what) || !numbers[k].known) continue;
    *x = numbers[k].x;
    return 1;
  }
  return 0;
}

// those that need an evaluation or a search
static double look_up(const cav_model *m, const char *what, int i) {
  double x = NAN;
  if (number_of(m, what, i, &x)) return x;
  if (!strcmp(what, "hold")) return held(m, 0, 0);
  if (!strncmp(what, "pull at ", 8)) return held(m, atof(what + 8), 0);
  if (!strncmp(what, "body ", 5)) return cav_object_find(m, CAV_OBJECT_BODY, what + 5);
  if (!strncmp(what, "motor ", 6)) return cav_object_find(m, CAV_OBJECT_ACTUATOR, what + 6);
  return x;
}

// --- MuJoCo 3 ---

static const char *peer(void) {
  const char *path = getenv("CAVORT_MUJOCO_JS");
  return path && *path && !access(path, R_OK) ? path : NULL;
}

// numbers of a line behind its name
static int read_numbers(char *line, double *x, int room) {
  int n = 0;
  char *at = strchr(line, ' '), *end;
  while (at && n < room) {
    x[n] = strtod(at, &end);
    if (end == at) break;
    n++;
    at = end;
  }
  return n;
}

// an array of theirs against a number of ours, i to at(i)
static void compare(const cav_model *m, const char *feature_name, const char *name, const double *x, int n) {
  static const struct {
    const char *theirs, *ours;
    int stride, from;
  } same[] = {{"body_mass", "mass", 1, 0},
              {"jnt_stiffness", "stiffness", 1, 0},
              {"actuator_gainprm", "gain", 10, 0},
              {"actuator_biasprm", "bias 2", 10, 2},
              {"tendon_lengthspring", "spring low", 2, 0},
              {"tendon_lengthspring", "spring high", 2, 1}};
  for (size_t k = 0; k < sizeof same / sizeof *same; k++) {
    if (strcmp(same[k].theirs, name)) continue;
    for (int i = 0; same[k].stride * i + same[k].from < n; i++) {
      double theirs = x[same[k].stride * i + same[k].from], ours = look_up(m, same[k].ours, i);
      // bound: meshes are single precision there; seen 6e-8
      if (!CHECK(fabs(ours - theirs) <= 1e-6 * (1 + fabs(theirs))))
        fprintf(stderr, "    %s: %s %d: %.12g, MuJoCo says %.12g\n", feature_name, same[k].ours, i, ours, theirs);
    }
  }
}

/// How our inverses compare with MuJoCo 3's.
typedef struct verdict {
  int states, agree; ///< within 1e-9
  double worst;      ///< over 1 + their size
} verdict;

static double difference(const cav_model *m, const double *u, const double *a, const double *theirs) {
  // MuJoCo's inverse leaves implicit damping out
  double error = 0, size = 1;
  for (int i = 0; i < m->nv; i++) {
    error = fmax(error, fabs(u[i] - theirs[i] - m->timestep * m->dof[i].damping * a[i]));
    size = fmax(size, fabs(theirs[i]));
  }
  return error / size;
}

// the script's lines of one model; whether it was loaded there
static int follow_peer(const cav_model *m, cav_state *state, const feature *f, FILE *from, verdict *seen) {
  enum { ROOM = 64 };
  static char line[20000];
  double q[ROOM], v[ROOM], a[ROOM], x[ROOM], v_next[ROOM], u[ROOM];
  int fits = state && m->nq <= ROOM;
  while (fgets(line, sizeof line, from)) {
    int n = read_numbers(line, x, ROOM);
    line[strcspn(line, " \n")] = 0;
    if (!strcmp(line, "error")) return 0;
    if (!strcmp(line, "end")) return 1;
    if (!strcmp(line, "state_q")) memcpy(q, x, sizeof q);
    if (!strcmp(line, "state_v")) memcpy(v, x, sizeof v);
    if (!strcmp(line, "state_a")) memcpy(a, x, sizeof a);
    if (m && !f->differs) compare(m, f->name, line, x, n);
    if (strcmp(line, "state_u") == 0 && fits) {
      for (int i = 0; i < m->nv; i++) v_next[i] = v[i] + m->timestep * a[i];
      CHECK(cav_inverse(m, state, q, v, v_next, u) == CAV_OK);
      double error = difference(m, u, a, x);
      seen->states++;
      seen->agree += error <= 1e-9;
      seen->worst = fmax(seen->worst, error);
    }
  }
  return 0;
}

static void compare_with_peer(const cav_model *m, const feature *f, const char *path) {
  if (!peer()) return;
  char command[700];
  verdict seen = {0};
  snprintf(command, sizeof command, "node '%s/tests/peer_mujoco3.mjs' '%s' %d 2>&1", CAVORT_SOURCE_ROOT, path,
           f->states);
  FILE *from = popen(command, "r");
  if (!CHECK(from != NULL)) return;
  cav_state *state = cav_state_new(m);
  if (!CHECK(state && follow_peer(m, state, f, from, &seen))) fprintf(stderr, "    MuJoCo does not read %s\n", f->name);
  cav_state_free(state);
  CHECK(seen.states == f->states);
  if (f->states)
    printf("%-45s %d of %d inverses as MuJoCo's, the rest up to %.1e off\n", f->name, seen.agree, seen.states,
           seen.worst);
  // bound: rounding of forces of about 100; seen 1e-13. Files given by name may have contacts that MuJoCo makes otherwise
  if (f->states && *f->text) CHECK_NEAR(seen.worst, 0, 1e-11);
  pclose(from);
}

// --- files ---

static char folder[] = "/tmp/cavort-today-XXXXXX";

static const char *write_file(const char *name, const char *text) {
  static char path[200];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  FILE *file = fopen(path, "w");
  if (!CHECK(file != NULL)) return path;
  if (strstr(name, ".xml")) fprintf(file, "<mujoco>%s</mujoco>\n", text);
  fclose(file);
  return path;
}

static void test_feature(const feature *f) {
  const char *path = write_file("feature.xml", f->text);
  cav_error error = {0};
  cav_model *m = cav_model_load(path, &error);
  if (!CHECK(m != NULL)) {
    fprintf(stderr, "    %s: %s\n", f->name, error.text);
    return;
  }
  for (const expected *e = f->number; e < f->number + 8 && e->what; e++) {
    double x = look_up(m, e->what, e->index);
    // bound: rounding; seen 1e-15, and the ellipses of masses 1e-11
    if (!CHECK(fabs(x - e->value) <= 1e-9 * (1 + fabs(e->value))))
      fprintf(stderr, "    %s: %s %d: %.12g, expected %.12g\n", f->name, e->what, e->index, x, e->value);
  }
  compare_with_peer(m, f, path);
  cav_model_free(m);
}

// a body of another file, twice, with its own settings and classes
static void test_attach(void) {
  write_file("kid.xml",
             "<compiler angle='radian'/><default><joint damping='2'/><default class='c'><joint damping='3'/></default>"
             "</default><worldbody><geom name='floor' type='plane' size='1 1 1'/><body name='root' pos='0 0 1'>"
             "<joint name='a' range='-1 1'/>" MASS "<body name='arm'><joint name='b' class='c'/>" MASS
             "</body></body><body name='other'><joint name='o'/>" MASS
             "</body></worldbody>"
             "<actuator><motor name='m' joint='a'/><motor name='n' joint='o'/></actuator>"
             "<contact><exclude body1='root' body2='arm'/></contact>");
  static const feature hosts = {
      "attach",
      "<default><joint damping='7'/><default class='c'><joint damping='9'/></default></default>"
      "<asset><model name='kid' file='kid.xml'/></asset><worldbody><body name='host' childclass='c'><joint "
      "name='h'/>" MASS
      "<attach model='kid' body='root' prefix='L_'/><frame pos='1 0 0'><attach model='kid' body='root' prefix='R_'/>"
      "</frame></body></worldbody><actuator><motor name='hm' joint='L_b'/></actuator>",
      {{"damping", 0, 9},
       {"damping", 1, 2},
       {"damping", 4, 3},
       {"bodies", 0, 6},
       {"actuators", 0, 3},
       {"body R_arm", 0, 5},
       {"motor R_m", 0, 2},
       {"warnings", 0, 0}},
      10,
      0};
  test_feature(&hosts);
  static const feature whole = {"attach a whole world",
                                "<asset><model name='kid' file='kid.xml'/></asset><worldbody>"
                                "<attach model='kid' prefix='W_'/></worldbody>",
                                {{"bodies", 0, 4}, {"actuators", 0, 2}, {"damping", 2, 2}, {"body W_other", 0, 3}},
                                10,
                                0};
  test_feature(&whole);
}

/// A body of m = 2 kg that turns at w = 3 rad/s about a point 1 m from its centre, which a connect holds to the world:
/// the centripetal force m w^2 r = 18 N, in any coordinates of the body, and whatever the order of the step.
static void test_turning_connect(void) {
  static const char *const text[] = {
      "<inertial mass='2' pos='1 0 0' diaginertia='1 1 1'/></body></worldbody><equality><connect body1='b' anchor='0 0 "
      "0'",
      "<inertial mass='2' pos='0 0 0' diaginertia='1 1 1'/></body></worldbody><equality><connect body1='b' anchor='-1 "
      "0 0'"};
  for (int i = 0; i < 2; i++) {
    char all[600];
    snprintf(all, sizeof all,
             "<option gravity='0 0 0'/><worldbody><body name='b'><freejoint/>%s solimp='.9 .9'/></equality>", text[i]);
    cav_model *m = cav_model_load(write_file("turning.xml", all), NULL);
    cav_state *state = m ? cav_state_new(m) : NULL;
    if (!CHECK(state != NULL)) return;
    double v[6] = {0, 3.0 * i, 0, 0, 0, 3}, v_next[6] = {-9 * i * m->timestep, 3.0 * i, 0, 0, 0, 3}, u[6];
    CHECK(cav_inverse(m, state, m->q0, v, v_next, u) == CAV_OK);
    // bound: rounding; seen 4e-15
    CHECK_NEAR(u[0], -18, 1e-12);
    cav_state_free(state);
    cav_model_free(m);
  }
}

// all that is lacking in one text, each once, with the first one's line
static void test_lacking(void) {
  const char *path = write_file(
      "lacking.xml",
      "\n<worldbody>\n<flexcomp type='grid' name='f'/>\n<flexcomp type='grid' name='g'/>" ARM("stiffness='1 2'")
      "</body></worldbody>\n<actuator><plugin plugin='a'/><adhesion body='arm' ctrlrange='0 1'/></actuator>"
      "<tendon><spatial armature='1'/><fixed armature='1'><joint joint='j' coef='1'/><joint joint='k' coef='1'/></fixed>"
      "</tendon>");
  cav_error error = {0};
  cav_model *m = cav_model_load(path, &error);
  CHECK(!m && error.line == 3);
  CHECK(strstr(error.text, "flexible bodies are not supported; remove them (2 times)") != NULL);
  CHECK(strstr(error.text, "Also <joint> in line 4: stiffness and damping that vary") != NULL);
  CHECK(strstr(error.text, "Also <plugin> in line 5: actuators that are plugins") != NULL);
  CHECK(strstr(error.text,
               "inertia of a tendon is supported along a fixed one of one joint; give its joints armature "
               "instead (2 times)") != NULL);
  if (m) fprintf(stderr, "    loaded\n");
  cav_model_free(m);
  // hints: a name of two letters is near to every other
  m = cav_model_load(write_file("hint.xml", ARM_ONLY("") "<actuator><position joint='j' kd='1'/></actuator>"), &error);
  CHECK(!m && !strstr(error.text, "did you mean"));
  cav_model_free(m);
  m = cav_model_load(write_file("hint.xml", ARM_ONLY("actuatorfrcrang='0 1'")), &error);
  CHECK(!m && strstr(error.text, "did you mean 'actuatorfrcrange'"));
  cav_model_free(m);
}

// whether MuJoCo 3 reads a file; -1: it is not here
static int peer_reads(const char *path) {
  if (!peer()) return -1;
  char command[700];
  snprintf(command, sizeof command, "node '%s/tests/peer_mujoco3.mjs' '%s' >/dev/null 2>&1", CAVORT_SOURCE_ROOT, path);
  return system(command) == 0;
}

// what moves weighs: armature does not stand in for it, bounds do, and what is fixed to it counts as its own
static void test_massless(void) {
  static const struct {
    const char *body;
    int loads;
  } sets[] = {{"<joint/>", 0},
              {"<joint armature='1'/><site/>", 0},
              {"<joint armature='1'/><geom size='.1' mass='0'/>", 0},
              {"<joint armature='1'/><inertial mass='1' pos='0 0 0' diaginertia='0 0 0'/>", 0},
              {"<joint/><body><body>" MASS "</body></body>", 1},
              {"<joint/><body/>" MASS, 1},
              {"<joint/></body></worldbody><compiler boundmass='.1' boundinertia='.1'/><worldbody><body>", 1}};
  for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
    char text[400];
    snprintf(text, sizeof text, "<worldbody><body>%s</body></worldbody>", sets[i].body);
    const char *path = write_file("massless.xml", text);
    cav_error error = {0};
    cav_model *m = cav_model_load(path, &error);
    int theirs = peer_reads(path);
    if (!CHECK((m != NULL) == sets[i].loads && (theirs < 0 || theirs == sets[i].loads)))
      fprintf(stderr, "    %s: %d %d %s\n", sets[i].body, m != NULL, theirs, error.text);
    CHECK(m != NULL || strstr(error.text, "moves but has no") != NULL);
    cav_model_free(m);
  }
}

// a scene in which nothing moves can be evaluated
static void test_static(void) {
  cav_model *m = cav_model_load(write_file("static.xml", "<worldbody><geom size='1'/></worldbody>"), NULL);
  if (!CHECK(m && m->nv == 0)) return;
  cav_state *state = cav_state_new(m);
  double none[1] = {0};
  CHECK(state && cav_inverse(m, state, none, none, none, none) == CAV_OK);
  CHECK(state && cav_forward(m, state, none, none, none, none) == CAV_OK);
  cav_state_free(state);
  cav_model_free(m);
}

// a file of anyone's against MuJoCo 3
static void test_file(const char *path) {
  const feature f = {.name = path, .text = "", .states = 100};
  cav_error error = {0};
  cav_model *m = cav_model_load(path, &error);
  if (CHECK(m != NULL))
    compare_with_peer(m, &f, path);
  else
    fprintf(stderr, "    %s\n", error.text);
  cav_model_free(m);
}

// a table of all models in a folder, each as long as no file is needed beside it: whether we and MuJoCo 3 load it, and of
// how many states the inverses agree; sweep.py judges it
static void table_of(const char *models) {
  enum { STATES = 10 };
  char command[700], line[20000], at[21000];
  snprintf(command, sizeof command, "node '%s/tests/peer_mujoco3.mjs' '%s' %d 2>/dev/null", CAVORT_SOURCE_ROOT, models,
           STATES);
  FILE *from = popen(command, "r");
  if (!CHECK(from != NULL)) return;
  while (fgets(line, sizeof line, from)) {
    if (strncmp(line, "file", 4)) continue;
    line[strcspn(line, "\n")] = 0;
    const char *name = line + 5;
    snprintf(at, sizeof at, "%s/%s", models, name);
    cav_model *m = cav_model_load(at, NULL);
    cav_state *state = m ? cav_state_new(m) : NULL;
    verdict seen = {0};
    int theirs = follow_peer(m, state, &(feature){.differs = 1}, from, &seen);
    printf("%s %d %d %d %d %.1e\n", name, m != NULL, theirs, seen.states, seen.agree, seen.worst);
    cav_state_free(state);
    cav_model_free(m);
  }
  pclose(from);
}

// test_today [FILE...]: those files are compared with MuJoCo 3, and nothing else done; --table FOLDER: table_of
int main(int argc, char **argv) {
  if (argc == 3 && !strcmp(argv[1], "--table")) {
    table_of(argv[2]);
    return 0;
  }
  for (int i = 1; i < argc; i++) test_file(argv[i]);
  if (argc > 1) return check_result();
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  if (!peer()) printf("SKIPPED: MuJoCo 3, set CAVORT_MUJOCO_JS to the mujoco.js of @mujoco/mujoco to compare\n");
  for (size_t i = 0; i < sizeof features / sizeof *features; i++) test_feature(&features[i]);
  test_attach();
  test_lacking();
  test_massless();
  test_static();
  test_turning_connect();
  static const char *const left[] = {"feature.xml", "kid.xml",     "lacking.xml", "hint.xml",
                                     "static.xml",  "turning.xml", "massless.xml"};
  for (size_t i = 0; i < sizeof left / sizeof *left; i++) unlink(write_file(left[i], ""));
  rmdir(folder);
  return check_result();
}
