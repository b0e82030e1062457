/// What no actuator moves and is asked for elsewhere, and what it takes to bring a hand to it. Private to optim/ and the tool.
#ifndef CAVORT_THING_H
#define CAVORT_THING_H

#include "cavort/problem.h"

typedef struct cav_thing {
  int link;      ///< 0: there is none
  int joint;     ///< by which it turns or slides in the world, the way being that of its centre of mass; -1: it is free
  double angle;  ///< rad or m, of that joint, where it is asked for last
  double way[3]; ///< m, from where it is at the start to where it is asked for last
  double first;  ///< s, when it is first asked for elsewhere
  double time;   ///< s, when it is asked for last
  double rise;   ///< m, how far over where it is at the start it is asked for at any time
  double
      met; ///< s, when a term first brings something driven to where it is at the start, before it is asked for; 0: none does
} cav_thing;

/// m: a way from which a thing has to be moved.
#define CAV_THING_WAY 0.02

/// The first link that terms ask for elsewhere, or else the goal: along the ground, with lifted also up. What turns on a hinge or
/// slides, a door or a drawer, is asked for by its joint's angle or place. None is found of what something driven bears at the
/// start. CAV_NO_MEMORY, or what the dynamics says of start and goal; the state is at one of them after that.
cav_status cav_thing_find(const cav_problem *problem, int lifted, cav_state *state, cav_thing *thing);

/// The centre of a link's mass, how far its surface is from there along the unit direction n, and how low it comes.
double cav_thing_surface(const cav_model *model, const cav_state *state, int link, const double n[3], double centre[3],
                         double *lowest);

/// A cost on what a frame sensor of an object reads, which leads a guess and is no part of the problem.
cav_term cav_leading_term(cav_sensor_type type, cav_object_type object_type, int object, const double *target);

#endif
