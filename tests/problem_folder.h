/// A folder with two models and a problem file, for what problem files say and for what is refused of them.
#ifndef CAVORT_TESTS_PROBLEM_FOLDER_H
#define CAVORT_TESTS_PROBLEM_FOLDER_H

#include <unistd.h>

#include "check.h"

static char folder[] = "/tmp/cavort-problem-XXXXXX";
static char path[128];

static const char hopper[] =
    "<mujoco model='leg'><compiler angle='radian' settotalmass='7'/><worldbody><geom name='floor' type='plane' size='1 "
    "1 1'/>"
    "<body name='trunk' pos='0 0 1'><joint name='x' type='slide' axis='1 0 0'/><joint name='z' type='slide' axis='0 0 "
    "-1'/>"
    "<joint name='pitch' type='hinge' axis='0 1 0'/><geom name='trunk' type='box' size='.1 .1 .2'/><site name='eye' "
    "pos='.1 0 .1'/>"
    "<body name='shin' pos='0 0 -.2'><joint name='knee' axis='0 1 0' limited='true' range='-1.57 .17'/>"
    "<geom name='shin' type='capsule' fromto='0 0 0 0 0 -.4' size='.05'/></body></body></worldbody>"
    "<actuator><motor name='knee' joint='knee' ctrllimited='true' ctrlrange='-50 50'/></actuator>"
    "<sensor><framepos name='eye' objtype='site' objname='eye'/><touch name='tap' site='eye' cutoff='5'/><clock "
    "name='time'/></sensor>"
    "<keyframe><key name='bent' qpos='0 0 0 -.5'/></keyframe></mujoco>";

static const char flyer[] =
    "<mujoco model='flyer'><worldbody><geom name='floor' type='plane' size='1 1 1' pos='0 0 .5'/>"
    "<body name='trunk' pos='0 0 3'><freejoint name='root'/><geom name='trunk' type='ellipsoid' size='.3 .2 .1'/>"
    "<body name='arm' pos='.3 0 0'><joint name='shoulder' type='ball'/><geom name='arm' type='cylinder' size='.05 .2'/>"
    "</body></body></worldbody></mujoco>";

static inline void write_in(const char *name, const char *text) {
  char full[160];
  snprintf(full, sizeof full, "%s/%s", folder, name);
  FILE *file = fopen(full, "w");
  CHECK(file != NULL);
  if (!file) return;
  fputs(text, file);
  fclose(file);
}

#define HEAD "<problem name='p' model='leg.xml'>\n<horizon duration='1' timestep='.05'/>\n<start key='bent'/>\n"
#define TAIL "</problem>\n"

#define SCENE                                                                                        \
  "<scene>\n<geom name='step' type='box' pos='2 0 .1' size='.5 .5 .1'/>\n"                           \
  "<frame pos='0 0 1'><body name='crate' pos='1 0 0' euler='0 0 90'><freejoint name='crate'/>"       \
  "<geom name='crate' type='box' size='.1 .1 .1' mass='2'/></body></frame>\n"                        \
  "<body name='door' pos='0 5 1'><joint name='door' type='hinge' range='0 90'/><geom type='sphere' " \
  "size='.1'/></body></scene>\n"
#define SCENE_HEAD \
  "<problem name='p' model='leg.xml'>\n" SCENE "<horizon duration='1' timestep='.05'/>\n<start key='bent'/>\n"

static inline void begin_folder(void) {
  CHECK(mkdtemp(folder) != NULL);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  write_in("leg.xml", hopper);
  write_in("flyer.xml", flyer);
}

/// made: other files that are in it by now.
static inline void end_folder(const char *const *made, size_t n) {
  static const char *const always[] = {"problem.xml", "leg.xml", "flyer.xml"};
  for (size_t i = 0; i < n + 3; i++) {
    char full[160];
    snprintf(full, sizeof full, "%s/%s", folder, i < n ? made[i] : always[i - n]);
    remove(full);
  }
  CHECK(rmdir(folder) == 0);
}

#endif
