/// Structs with a table of their fields, as attributes of an element of a problem file: read and written field by
/// field, so that what is written reads back the same.
#include <float.h>
#include <limits.h>

#include "problem_file.h"

cav_status cav_problem_real(const cav_problem_reader *reader, const cav_xml_node *node, const char *name, double least,
                            double most, double *value) {
  if (!cav_xml_get(node, name)) return CAV_OK;
  double given = cav_xml_real(node, name, 0);
  if (given < least || given > most) {
    if (most < DBL_MAX && least == DBL_MIN) {
      return cav_xml_fail(reader->error, node, name, "expected a number above 0, at most %g, got '%s'", most,
                          cav_xml_text(node, name, ""));
    }
    if (most < DBL_MAX) {
      return cav_xml_fail(reader->error, node, name, "expected a number from %g to %g, got '%s'", least, most,
                          cav_xml_text(node, name, ""));
    }
    return cav_xml_fail(reader->error, node, name, "expected a number %s, got '%s'",
                        least > 0 ? "above 0" : "of 0 or more", cav_xml_text(node, name, ""));
  }
  *value = given;
  return CAV_OK;
}

static cav_status read_whole(const cav_problem_reader *reader, const cav_xml_node *node, const cav_field *field,
                             int *value) {
  *value = cav_xml_int(node, field->name, *value);
  if (*value >= field->least && *value <= field->most) return CAV_OK;
  if (field->most == INT_MAX)
    return cav_xml_fail(reader->error, node, field->name, "expected at least %g, got %d", field->least, *value);
  return cav_xml_fail(reader->error, node, field->name, "expected %g to %g, got %d", field->least, field->most, *value);
}

cav_status cav_problem_read_fields(const cav_problem_reader *reader, const cav_xml_node *node, const cav_field *field,
                                   int n, void *values) {
  cav_status status = CAV_OK;
  for (int i = 0; i < n && node && !status; i++, field++) {
    void *at = (char *)values + field->offset;
    int *whole = at;
    switch (field->type) {
      case CAV_FIELD_REAL:
        status = cav_problem_real(reader, node, field->name, field->least, field->most, at);
        break;
      case CAV_FIELD_WHOLE:
        status = read_whole(reader, node, field, whole);
        break;
      case CAV_FIELD_WORD:
        *whole = cav_xml_word(node, field->name, *whole);
        break;
      case CAV_FIELD_FLAG:
        *whole = cav_xml_bool(node, field->name, *whole);
        break;
    }
  }
  return status;
}

void cav_problem_write_fields(FILE *out, const cav_field *field, int n, const void *values) {
  for (int i = 0; i < n; i++, field++) {
    const void *at = (const char *)values + field->offset;
    const int *whole = at;
    const double *real = at;
    switch (field->type) {
      case CAV_FIELD_REAL:
        fprintf(out, " %s=\"%.17g\"", field->name, *real);
        break;
      case CAV_FIELD_WHOLE:
        fprintf(out, " %s=\"%d\"", field->name, *whole);
        break;
      case CAV_FIELD_WORD:
        fprintf(out, " %s=\"%s\"", field->name, field->words[*whole]);
        break;
      case CAV_FIELD_FLAG:
        fprintf(out, " %s=\"%s\"", field->name, *whole ? "true" : "false");
        break;
    }
  }
}
