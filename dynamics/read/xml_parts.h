/// What the files share that read XML: the file being read, its reader, memory of the tree and complaints. Private to
/// dynamics/read, to its files named xml alone.
#ifndef CAVORT_XML_PARTS_H
#define CAVORT_XML_PARTS_H

#include <sys/types.h>

#include "xml.h"

enum { CAV_XML_TOTAL_LIMIT = 128 << 20 }; ///< bytes in all files of a tree

struct cav_xml {
  struct cav_xml_block *memory;
  const char *path;
  cav_xml_node *root;
  int prose, prose_line; ///< pieces of text passed over, and where the first is
  const char *prose_file;
};

typedef struct cav_xml_block cav_xml_block;
typedef struct cav_xml_seen cav_xml_seen;

/// A file being read, and the file that includes it.
typedef struct cav_xml_source {
  struct cav_xml_reader *reader;
  struct cav_xml_source *from;
  const char *path;
  char *text;
  size_t size;
  struct _xmlParserCtxt *parser; ///< libxml2's, which xml.c alone looks into
  int depth;                     ///< open elements of this file
  int include;                   ///< depth at which an include element is open, 0: none
  int ended;                     ///< libxml2 came to the end of the document
  int lenient;                   ///< it met a fault that is let pass
  dev_t device;
  ino_t inode;
} cav_xml_source;

typedef struct cav_xml_reader {
  cav_xml *xml;
  const cav_xml_element *const *roots;
  const cav_xml_former *former;
  cav_error *error;
  const char *text;  ///< in the place of the main file; NULL: that is read
  cav_status status; ///< of the first failure
  cav_xml_node *at;  ///< innermost open element that is kept
  int unread;        ///< open elements from the outermost CAV_XML_ANYTHING inwards
  int depth;
  size_t total;
  cav_xml_seen *seen;
} cav_xml_reader;

static inline int is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

/// Stops every parser that is open, from the innermost file outwards. xml.c.
void cav_xml_stop(cav_xml_source *s);

/// The file into memory, checked and scanned; 0 on failure. asked: the include element that names it, NULL: none.
/// xml_source.c.
int cav_xml_load(cav_xml_source *s, const cav_xml_node *asked);

/// Place of a failure to open: the include element that asks for the file, or the file itself. xml_source.c.
void cav_xml_fail_open(cav_xml_source *s, const cav_xml_node *asked, cav_status status, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/// Zeroed memory that lives as long as the tree, and a copy of a text in it; NULL on failure. xml_tree.c.
void *cav_xml_carve(cav_xml *xml, size_t size);
char *cav_xml_carve_text(cav_xml *xml, const char *text, size_t length);

/// Attributes of a node from libxml2's list of n times five: local name, prefix, namespace, start and end of the value.
/// 0 on failure. xml_value.c.
int cav_xml_read_attributes(cav_xml_source *s, cav_xml_node *node, int n, const unsigned char *const *given);

/// First failure of a reader: keeps it and stops every parser that is open. xml_complaint.c.
void cav_xml_source_fail(cav_xml_source *s, cav_status status, int line, const char *element, const char *attribute,
                         const char *format, ...) __attribute__((format(printf, 6, 7)));

/// The same for a name that the table does not know, with what it is called now or what it may have meant: an attribute
/// of rule, a child of parent (NULL: the root) where allowed are known, one of n words. xml_complaint.c.
void cav_xml_unknown_attribute(cav_xml_source *s, int line, const cav_xml_element *rule, const char *name);
void cav_xml_unknown_element(cav_xml_source *s, int line, const cav_xml_element *parent,
                             const cav_xml_element *const *allowed, const char *name);
void cav_xml_unknown_word(cav_xml_source *s, int line, const char *element, const cav_xml_value *value,
                          const char *const *words, int n);

#endif
