/// What the tool says of itself and of problem files, printed from the tables that declare it: help, the reference, a schema
/// for editors, a man page, completion for shells. Nothing is told here that a table does not say.
#ifndef CAVORT_MANUAL_H
#define CAVORT_MANUAL_H

#include <stdio.h>

#include "cavort/model.h"
#include "xml.h"

/// An option of the tool. Commands take a sum of bits.
typedef struct cav_manual_option {
  int bit;
  const char *name;  ///< as it is spelt, with its dashes
  const char *brief; ///< short spelling, NULL: none
  const char *value; ///< what it takes: FILE, DIR, N, words separated by |; NULL: nothing
  const char *text;
} cav_manual_option;

struct cav_command_line;

/// A command of the tool.
typedef struct cav_manual_command {
  const char *name, *operand, *text;
  int (*run)(const struct cav_command_line *);
  int options; ///< bits
} cav_manual_command;

struct cav_manual;

/// A topic of help.
typedef struct cav_manual_topic {
  const char *name, *text;
  void (*print)(FILE *out, const struct cav_manual *manual);
} cav_manual_topic;

/// The tool's tables (main.c), and the topics of its help (topics.c).
typedef struct cav_manual {
  const cav_manual_command *command;
  const cav_manual_option *option;
  const cav_manual_topic *topic;
  int ncommand, noption, ntopic;
} cav_manual;

/// The topics; how many in *n. topics.c.
const cav_manual_topic *cav_manual_topics(int *n);

/// Exit statuses in words.
#define CAV_MANUAL_EXIT "0 certified and achieved or done, 1 not, 2 bad input, 3 internal error, 130 interrupted"

enum { CAV_MANUAL_PARENTS = 8, CAV_MANUAL_ELEMENTS = 96, CAV_MANUAL_VALUE = 256 };

/// An element of problem files and where it stands.
typedef struct cav_manual_place {
  const cav_xml_element *element;
  const cav_xml_element *parent[CAV_MANUAL_PARENTS];
  int nparent;
} cav_manual_place;

/// All elements of problem files and marker sets with a text, each once, parents before children; how many. elements.c.
int cav_manual_places(cav_manual_place place[CAV_MANUAL_ELEMENTS]);

/// What an attribute takes, in words: "3 numbers, m". elements.c.
void cav_manual_value(const cav_xml_attribute *attribute, char text[CAV_MANUAL_VALUE]);

/// The attribute of that name, NULL: there is none. elements.c.
const cav_xml_attribute *cav_manual_attribute(const cav_xml_element *element, const char *name);

/// The place before place i whose element is the same term, in <cost> that of one in <constraint>; NULL: none. elements.c.
const cav_manual_place *cav_manual_twin(const cav_manual_place *place, int i);

/// " in " and the names of the elements that hold one, each once. elements.c.
void cav_manual_parents(FILE *out, const cav_manual_place *place, const char *before, const char *after);

/// Whether every child of an element has that attribute, told alike: of the terms in <cost>, say. elements.c.
int cav_manual_common(const cav_xml_element *parent, const cav_xml_attribute *attribute);

/// What a sensor looks at, in the attributes that name one. topics.c.
const char *cav_manual_target(cav_sensor_target target);

/// Elements, attributes and types of sensors by a name: printed as help, how many there were. elements.c.
int cav_manual_explain(FILE *out, const char *name);

/// The name of a command, a topic, an element or an attribute nearest to a word, NULL: none is near. elements.c.
const char *cav_manual_nearest(const cav_manual *manual, const char *word);

/// A word for what a command does.
typedef struct cav_manual_use {
  const char *words; ///< separated by |
  const char *line;  ///< what follows cavort: "inspect PROBLEM"
  const char *text;  ///< what that does, after the line
} cav_manual_use;

/// The command that does what a word says which is none itself, NULL: none is known. words.c.
const cav_manual_use *cav_manual_use_of(const char *word);

/// Prints all that help has of a word: a topic, names of problem files, roles, postures, what stands for a word known from
/// elsewhere; how many there were. words.c.
int cav_manual_answer(FILE *out, const cav_manual *manual, const char *word);

/// The reference of commands and problem files, in Markdown. reference.c.
void cav_manual_reference(FILE *out, const cav_manual *manual);

/// The grammar of problem files as an XML schema (XSD 1.0). editor_schema.c.
void cav_manual_schema(FILE *out);

/// The man page, and what completes a command line in bash and in zsh. man_page.c, completion.c.
void cav_manual_man_page(FILE *out, const cav_manual *manual);
void cav_manual_bash(FILE *out, const cav_manual *manual);
void cav_manual_zsh(FILE *out, const cav_manual *manual);

#endif
