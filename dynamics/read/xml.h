/// Reads XML files against a table that says what may stand where. Private: not installed.
///
/// A grammar is a set of constant tables: cav_xml_element (name, how often, attributes, children) and cav_xml_attribute
/// (name, type, how many values). cav_xml_read checks the whole file against it while reading, so code that walks the
/// tree afterwards meets only what the table allows, already converted. Every complaint reads "FILE:LINE: <element>:
/// attribute 'x': expected ..., got '...'; do ...". Not offered: document types and entities (refused), namespaces,
/// text between tags (refused, but see CAV_XML_ANYTHING and CAV_XML_PROSE).
#ifndef CAVORT_XML_H
#define CAVORT_XML_H

#include <stddef.h>

#include "cavort/status.h"

/// Elements inside each other, at most: readers recurse over a tree. libxml2 itself stops at 2048.
enum { CAV_XML_DEPTH_LIMIT = 2000 };

typedef enum cav_xml_type {
  CAV_XML_TEXT, ///< any text; min 1: not empty
  CAV_XML_INT,  ///< min to max whole numbers
  CAV_XML_REAL, ///< min to max finite numbers; max 0: any number of them
  CAV_XML_WORD, ///< one of words
  CAV_XML_BOOL, ///< true or false
  CAV_XML_SKIP  ///< accepted, unread
} cav_xml_type;

/// What people are told of an attribute (cavort help), in the table that declares it.
typedef struct cav_xml_note {
  const char *unit;     ///< "": none
  const char *fallback; ///< value that leaving it out stands for, or in words what then holds
  const char *text;     ///< what it means
} cav_xml_note;

typedef struct cav_xml_attribute {
  const char *name; ///< NULL ends a table
  cav_xml_type type;
  int min, max;             ///< count of values, both 0 for types without
  const char *const *words; ///< CAV_XML_WORD: ends with NULL; the value is the index
  int required;
  const cav_xml_note *note; ///< NULL: of another format, which has a manual of its own
} cav_xml_attribute;

/// How an element is checked.
enum {
  CAV_XML_ANYTHING = 1, ///< attributes, children and text of it are accepted unread, children are not kept
  CAV_XML_INCLUDE = 2,  ///< replaced by the children of the root of the file that its attribute 'file' names
  CAV_XML_OPEN = 4,     ///< may hold what the table does not know: kept by name, unread, with CAV_XML_STRANGE
  CAV_XML_STRANGE = 8,  ///< an element or (as min of its rule) an attribute that no table knows
  CAV_XML_PROSE = 16    ///< of a root: text between tags is passed over and counted; included files may have any root
};

typedef struct cav_xml_element {
  const char *name;
  int min, max;                               ///< how often under one parent (includes counted in); max 0: no bound
  const cav_xml_attribute *attribute;         ///< ends with name NULL; NULL: none
  const struct cav_xml_element *const *child; ///< ends with NULL; NULL: none
  int flags;
  const char *text; ///< what it means; NULL: of another format
} cav_xml_element;

/// A name that files of earlier versions have, or that is expected where it has no meaning: an error that meets it says what it
/// is called now, or what to do instead.
typedef struct cav_xml_former {
  const char *inside;    ///< element that holds the child or the attribute; NULL ends a table
  const char *was, *now; ///< names, then and now; now NULL: it has none
  int attribute;         ///< 1: of an attribute, 0: of a child
  const char *instead;   ///< where now is NULL: why it is refused, and what to do
} cav_xml_former;

/// One attribute as found, converted.
typedef struct cav_xml_value {
  const cav_xml_attribute *rule;
  const char *text;
  int count;            ///< numbers; 1 for a word or a bool
  const double *number; ///< CAV_XML_INT, CAV_XML_REAL
  int word;             ///< index of the word; 0 or 1 for a bool
} cav_xml_value;

/// One element as found. Nodes live until cav_xml_free.
typedef struct cav_xml_node {
  const cav_xml_element *rule;
  const char *file;
  int line; ///< where the tag starts
  struct cav_xml_node *parent, *child, *next;
  int nvalue;
  const cav_xml_value *value;
  struct cav_xml_node *last; ///< child, while reading
  int part;                  ///< number of the file that it was attached from, 0: the file itself (expand.c)
  int number;                ///< of a geom in its body, from 1, where some are removed; 0 elsewhere
} cav_xml_node;

typedef struct cav_xml cav_xml;

/// Reads a file whose root is one of roots (ends with NULL). Included files are sought relative to the folder of path,
/// and may be included once. former: names that have changed, NULL: none. NULL on failure with the reason in error (may
/// be NULL): CAV_BAD_INPUT or CAV_NO_MEMORY. Bounds: 32 MB a file, 128 MB in all, 200 elements deep; files must be
/// regular ones.
cav_xml *cav_xml_read(const char *path, const cav_xml_element *const *roots, const cav_xml_former *former,
                      cav_error *error);

/// The same of a text in the place of the main file, which path stands for: in complaints, and its folder where other
/// files are sought. text NULL: the file is read.
cav_xml *cav_xml_parse(const char *path, const char *text, const cav_xml_element *const *roots,
                       const cav_xml_former *former, cav_error *error);

/// Frees a tree; NULL is fine.
void cav_xml_free(cav_xml *xml);

const cav_xml_node *cav_xml_root(const cav_xml *xml);

/// Path of the file read.
const char *cav_xml_path(const cav_xml *xml);

/// Pieces of text between tags that were passed over; the first is in *line of *file.
int cav_xml_prose(const cav_xml *xml, const char **file, int *line);

/// Next sibling of the same rule, or first child with that rule; NULL if none. For looping over one kind.
const cav_xml_node *cav_xml_child(const cav_xml_node *node, const cav_xml_element *rule);
const cav_xml_node *cav_xml_next(const cav_xml_node *node);

/// Whether an element has that name.
int cav_xml_is(const cav_xml_node *node, const char *name);

/// The element of that kind and name among what is in a node, at any depth; NULL if none.
cav_xml_node *cav_xml_find(const cav_xml_node *node, const char *kind, const char *name);

/// The attribute of that name, NULL if the file does not give it.
const cav_xml_value *cav_xml_get(const cav_xml_node *node, const char *name);

/// 1 if the table lets the element have that attribute, given or not.
int cav_xml_accepts(const cav_xml_node *node, const char *name);

/// Value of an attribute, or fallback where the file gives none. The table fixes the type.
const char *cav_xml_text(const cav_xml_node *node, const char *name, const char *fallback);
double cav_xml_real(const cav_xml_node *node, const char *name, double fallback);
int cav_xml_int(const cav_xml_node *node, const char *name, int fallback);
int cav_xml_bool(const cav_xml_node *node, const char *name, int fallback);
int cav_xml_word(const cav_xml_node *node, const char *name, int fallback);

/// Copies the numbers of an attribute to out (at most most) and returns how many the file gives; 0 if none: out
/// untouched.
int cav_xml_reals(const cav_xml_node *node, const char *name, double *out, int most);

/// Fills error with "FILE:LINE: <element>: attribute 'x': " and the formatted text; attribute may be NULL, error too.
/// Returns CAV_BAD_INPUT, or what cav_xml_fail_as is told.
cav_status cav_xml_fail(cav_error *error, const cav_xml_node *node, const char *attribute, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
cav_status cav_xml_fail_as(cav_error *error, cav_status status, const cav_xml_node *node, const char *attribute,
                           const char *format, ...) __attribute__((format(printf, 5, 6)));

/// The name of names [n] (a stride of bytes apart) nearest to word in edits, NULL if none is near. For "did you mean".
const char *cav_xml_nearest(const char *word, const void *names, int n, size_t stride);

/// Names that hold every part of word, whatever the case, into text, with commas: "knee" of "knee_left", "right_knee" of
/// "knee_right"; parts are what stands between signs that are neither letters nor digits. Where none does, the first of all. "": none
/// has a name.
void cav_xml_alike(const char *word, const void *names, int n, size_t stride, char *text, size_t room);

#endif
