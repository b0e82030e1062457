/// Which way joints move: the sign of a hinge's angle or of a slide's way, which files choose as they like.
#ifndef CAVORT_SENSE_H
#define CAVORT_SENSE_H

#include "role.h"

enum { CAV_SENSE = 120 };

/// What a positive change of a hinge or slide moves and where, at the state's last position: "foot_right backwards, up", of one
/// that turns the end of its limb about its own line "turns head to the left"; "" of other joints. Seen as from the root of its
/// tree: forwards, left and up are those of the model's own configuration (roles; else x, y, z of the world), turned with a root
/// that floats.
void cav_sense_of(const cav_model *model, const cav_state *state, const cav_roles *roles, int joint,
                  char text[CAV_SENSE]);

#endif
