/// The file that XML is read from: into memory whole, bounded in size, none twice, and scanned once for what would make
/// the parser slow or is no text. Parsing is for xml.c.
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "xml_parts.h"

enum {
  FILE_LIMIT = 32 << 20, // bytes in one file
  ATTRIBUTE_LIMIT = 256  // attributes of one tag
};

// a file already read, so that none is read twice
struct cav_xml_seen {
  struct cav_xml_seen *next;
  dev_t device;
  ino_t inode;
};

// what libxml2 would take long over, or what is no text at all
static int scan(cav_xml_source *s) {
  int line = 1, quotes = 0;
  const char *p = s->text, *end = s->text + s->size;
  while (p < end) {
    if (end - p > 3 && !memcmp(p, "<!--", 4)) {
      for (p += 4; p < end && (end - p < 3 || memcmp(p, "-->", 3)); p++) line += *p == '\n';
      continue;
    }
    if (*p == 0) {
      cav_xml_source_fail(s, CAV_BAD_INPUT, line, NULL, NULL, "a zero byte: this is no XML text; give an XML file");
      return 0;
    }
    if (*p == '<') quotes = 0;
    if (*p == '"' || *p == '\'') quotes++;
    if (quotes > 2 * ATTRIBUTE_LIMIT) {
      cav_xml_source_fail(s, CAV_BAD_INPUT, line, NULL, NULL, "a tag with more than %d attributes; is it closed?",
                          ATTRIBUTE_LIMIT);
      return 0;
    }
    line += *p++ == '\n';
  }
  return 1;
}

void cav_xml_fail_open(cav_xml_source *s, const cav_xml_node *asked, cav_status status, const char *format, ...) {
  char text[700];
  va_list args;
  va_start(args, format);
  vsnprintf(text, sizeof text, format, args);
  va_end(args);
  if (asked)
    cav_xml_source_fail(s->from, status, asked->line, asked->rule->name, "file", "%.400s: %s", s->path, text);
  else
    cav_xml_source_fail(s, status, 0, NULL, NULL, "%s", text);
}

// a text of the caller's in the place of the main file; 0 on failure
static int take_text(cav_xml_source *s) {
  s->size = strlen(s->reader->text);
  if (s->size == 0 || s->size > FILE_LIMIT) {
    cav_xml_source_fail(s, CAV_BAD_INPUT, 0, NULL, NULL, "expected XML of 1 to %d bytes, got %zu", FILE_LIMIT, s->size);
    return 0;
  }
  s->text = malloc(s->size);
  if (!s->text) {
    cav_xml_source_fail(s, CAV_NO_MEMORY, 0, NULL, NULL, "no memory for %zu bytes", s->size);
    return 0;
  }
  memcpy(s->text, s->reader->text, s->size);
  s->reader->total += s->size;
  return 1;
}

// the file into memory; 0 on failure
static int load(cav_xml_source *s, const cav_xml_node *asked) {
  struct stat info;
  if (!s->from && s->reader->text) return take_text(s);
  if (stat(s->path, &info)) {
    cav_xml_fail_open(s, asked, CAV_BAD_INPUT, "cannot be opened (%s); check the path", strerror(errno));
    return 0;
  }
  if (!S_ISREG(info.st_mode)) {
    cav_xml_fail_open(s, asked, CAV_BAD_INPUT, "%s; give an XML file",
                      S_ISDIR(info.st_mode) ? "is a folder" : "is no regular file");
    return 0;
  }
  s->device = info.st_dev;
  s->inode = info.st_ino;
  if (info.st_size == 0) {
    cav_xml_fail_open(s, asked, CAV_BAD_INPUT, "is empty; give an XML file");
    return 0;
  }
  if (info.st_size > FILE_LIMIT || s->reader->total + (size_t)info.st_size > CAV_XML_TOTAL_LIMIT) {
    cav_xml_fail_open(s, asked, CAV_BAD_INPUT,
                      "%lld bytes are more than is read (%d MB a file, %d MB with all includes)",
                      (long long)info.st_size, FILE_LIMIT >> 20, CAV_XML_TOTAL_LIMIT >> 20);
    return 0;
  }
  s->text = malloc((size_t)info.st_size);
  if (!s->text) {
    cav_xml_fail_open(s, asked, CAV_NO_MEMORY, "no memory for %lld bytes", (long long)info.st_size);
    return 0;
  }
  FILE *file = fopen(s->path, "rb");
  if (!file) {
    cav_xml_fail_open(s, asked, errno == ENOMEM ? CAV_NO_MEMORY : CAV_BAD_INPUT,
                      "cannot be opened (%s); check the path", strerror(errno));
    return 0;
  }
  s->size = fread(s->text, 1, (size_t)info.st_size, file);
  int whole = !ferror(file) && s->size > 0;
  fclose(file);
  if (!whole) cav_xml_fail_open(s, asked, CAV_BAD_INPUT, "cannot be read; check the file");
  s->reader->total += s->size;
  return whole;
}

// no file is read twice, least of all by itself
static int is_new(cav_xml_source *s, const cav_xml_node *asked) {
  cav_xml_reader *r = s->reader;
  for (const cav_xml_source *t = s->from; t; t = t->from) {
    if (t->device != s->device || t->inode != s->inode) continue;
    cav_xml_fail_open(s, asked, CAV_BAD_INPUT, "includes itself, in a circle; remove this include");
    return 0;
  }
  for (const cav_xml_seen *f = r->seen; f; f = f->next) {
    if (f->device != s->device || f->inode != s->inode) continue;
    cav_xml_fail_open(s, asked, CAV_BAD_INPUT, "is included twice; remove this include");
    return 0;
  }
  cav_xml_seen *f = cav_xml_carve(r->xml, sizeof *f);
  if (!f) {
    cav_xml_fail_open(s, asked, CAV_NO_MEMORY, "no memory");
    return 0;
  }
  *f = (cav_xml_seen){r->seen, s->device, s->inode};
  r->seen = f;
  return 1;
}

// a declaration behind blank lines says nothing that XML allows there: it is blanked too
static void blank_late_declaration(cav_xml_source *s) {
  char *p = s->text, *end = s->text + s->size;
  while (p < end && is_space(*p)) p++;
  if (p == s->text || end - p < 6 || memcmp(p, "<?xml ", 6)) return;
  for (char last = 0; p < end && !(last == '?' && *p == '>'); p++) {
    last = *p;
    if (last != '\n') *p = ' ';
  }
  if (p < end) *p = ' ';
}

int cav_xml_load(cav_xml_source *s, const cav_xml_node *asked) {
  if (!load(s, asked) || !is_new(s, asked)) return 0;
  blank_late_declaration(s);
  return scan(s);
}
