/// Objects of a model by their kind, as CAV_OBJECTS declares them: names and what to call them. Private: for messages
/// and for files that name objects.
#ifndef CAVORT_OBJECTS_H
#define CAVORT_OBJECTS_H

#include "cavort/model.h"

typedef struct cav_object_kind {
  const char *attribute; ///< that names one in a problem file
  const char *text;      ///< what to call one
} cav_object_kind;

/// type < CAV_OBJECT_TYPES, as in all of these.
const cav_object_kind *cav_object_kind_of(cav_object_type type);

/// Name of an object, "" if it has none.
const char *cav_object_name(const cav_model *model, cav_object_type type, int object);

/// Names of all n objects of a kind, a stride of bytes apart; NULL if there are none.
const char *const *cav_object_names(const cav_model *model, cav_object_type type, int *n, size_t *stride);

enum { CAV_WORDS = 128 }; ///< room for words about an object

/// A geom for people who look for it in its file: its name, or where it has none "geom 1 of world (box 0.4 0.4 0.05 at 1 0 0.65)",
/// the place of those of the world alone.
const char *cav_geom_words(const cav_model *model, int geom, char words[CAV_WORDS]);

/// An actuator: its name, or where it has none "actuator 2 (of joint 'knee')", counted from 1 in the order of the file.
const char *cav_actuator_words(const cav_model *model, int actuator, char words[CAV_WORDS]);

#endif
