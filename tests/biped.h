/// A person of two legs without arms, whose hinges turn about y or against it, as text: for tests of strategies.
#ifndef CAVORT_TESTS_BIPED_H
#define CAVORT_TESTS_BIPED_H

#define LEG(SIDE, Y, AXIS)                                                                 \
  "<body name='thigh_" SIDE "' pos='0 " Y " -.1'><joint name='hip_" SIDE "' axis='0 " AXIS \
  " 0' range='-100 60'/>"                                                                  \
  "<geom type='capsule' size='.05' fromto='0 0 0 0 0 -.4' mass='5'/><body pos='0 0 -.4'>"  \
  "<joint name='knee_" SIDE "' axis='0 " AXIS                                              \
  " 0' range='-2 140'/>"                                                                   \
  "<geom type='capsule' size='.04' fromto='0 0 0 0 0 -.4' mass='3'/>"                      \
  "<geom type='sphere' size='.05' pos='0 0 -.4' mass='.5'/></body></body>"
#define BIPED(AXIS) \
  "<mujoco><compiler angle='degree'/><default><joint limited='true'/><motor ctrllimited='true' ctrlrange='-1 1'/>"     \
  "</default><worldbody><geom type='plane' size='9 9 1'/><body name='trunk' pos='0 0 .95'><freejoint/>"                \
  "<geom type='capsule' size='.1' fromto='0 0 0 0 0 .4' mass='20'/>" LEG("left", ".1", AXIS) LEG("right", "-.1", AXIS) \
  "</body></worldbody><actuator><motor joint='hip_left' gear='100'/><motor joint='hip_right' gear='100'/>"             \
  "<motor joint='knee_left' gear='100'/><motor joint='knee_right' gear='100'/></actuator></mujoco>"

#endif
