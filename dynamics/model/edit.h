/// A compiled model pushed away from its file and back: sizes, places, springs, dampers, softness. For measurements of
/// where a scene's numbers break. As cav_model_perturb: before any state of the model exists, and with what the model
/// derives from what is changed derived anew. Seen by problems/ too.
#ifndef CAVORT_EDIT_H
#define CAVORT_EDIT_H

#include "cavort/model.h"

/// A copy of a model's memory, and the way back to it; NULL if memory runs out. Released by free. edit.c.
void *cav_model_keep(const cav_model *model);
void cav_model_return(cav_model *model, const void *kept);

/// All lengths times factor at the same density and the same times: masses, springs and dampers along lines by its cube,
/// forces by its fourth power, what acts on angles by its fifth, so that all goes on as before, but gravity, which stays
/// with media and controls. CAV_BAD_INPUT: not
/// a positive finite factor; CAV_NO_MEMORY, CAV_BAD_INPUT as cav_model_perturb.
cav_status cav_model_scale(cav_model *model, double factor);

/// Links of a size of their own: lengths of link i times factor[i] ([nlink], > 0, of the world 1) about the anchor of its
/// first joint; the mass of all by its volume, fractions of it kept. Before any state of the model exists, but for states
/// that evaluate positions alone.
/// CAV_BAD_INPUT: a factor that is none, nothing changed; CAV_NO_MEMORY. resize.c.
cav_status cav_model_resize(cav_model *model, const double *factor);

/// Gears of motors, and limits of what actuators do to joints, times factor, of a model that is written next and not used
/// otherwise: servos keep theirs. resize.c.
void cav_model_strengthen(cav_model *model, double factor);

/// Whether all that a model has is scaled by that; CAV_NOT_SUPPORTED with the reason. resize.c.
cav_status cav_model_resizable(const cav_model *model, cav_error *error);

/// The whole scene, what stands in the world included, moved by a vector, m.
void cav_model_move(cav_model *model, const double by[3]);

/// Largest k/m of springs, 1/s^2, or d/m of dampers, 1/s, of joints and tendons, m the inverse of the reference weight,
/// of springs of joints with what a damper adds over a time, s; 0: none. The joint or tendon that has it in *name (may be
/// NULL).
double cav_model_stiffest(const cav_model *model, double time, const char **name);
double cav_model_most_damped(const cav_model *model, const char **name);

/// Springs or dampers scaled so that their largest k/m or d/m is rate. A model without gets one on every joint but free
/// ones, each with that rate, springs at rest at q0. Returns 0 where nothing could have one.
int cav_model_set_stiffest(cav_model *model, double rate);
int cav_model_set_most_damped(cav_model *model, double rate);

/// Sliding friction of all geoms and pairs times factor, which is not negative.
void cav_model_scale_friction(cav_model *model, double factor);

/// solref of all constraints := (time constant, 1), s.
void cav_model_set_solref(cav_model *model, double time_constant);

#endif
