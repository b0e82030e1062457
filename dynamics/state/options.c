/// Options of an evaluation, by the table in model.h: checks and comparison. A struct with a table of its fields is
/// checked by the table alone, so texts are the same wherever it comes from.
#include "options.h"

#include <limits.h>
#include <stdio.h>

#define COUNT_WORD(...) +1
#define WORD_TEXT(enumerator, word, text) [enumerator] = word,
static const char *const order_words[] = {CAV_ORDERS(WORD_TEXT) NULL};
static const char *const spring_words[] = {CAV_SPRINGS(WORD_TEXT) NULL};
static const char *const stabilisation_words[] = {CAV_STABILISATIONS(WORD_TEXT) NULL};
static const char *const regulariser_words[] = {CAV_REGULARISERS(WORD_TEXT) NULL};
static const char *const sliding_words[] = {CAV_SLIDINGS(WORD_TEXT) NULL};
static const char *const next_gap_words[] = {CAV_NEXT_GAPS(WORD_TEXT) NULL};
static const char *const next_slip_words[] = {CAV_NEXT_SLIPS(WORD_TEXT) NULL};

#define REAL_FIELD(stage, name, least, most, required, unit, text) \
  {#name, CAV_FIELD_REAL, offsetof(cav_options, name), least, most, NULL, unit, text},
#define WORD_FIELD(stage, name, type, words, text) \
  {#name, CAV_FIELD_WORD, offsetof(cav_options, name), 0, (0 words(COUNT_WORD)) - 1, name##_words, "", text},
#define FLAG_FIELD(stage, name, text) {#name, CAV_FIELD_FLAG, offsetof(cav_options, name), 0, 1, NULL, "", text},
static const cav_field fields[] = {CAV_OPTIONS(REAL_FIELD, WORD_FIELD, FLAG_FIELD)};
enum { NFIELD = sizeof fields / sizeof *fields };

const cav_field *cav_option_fields(int *n) {
  *n = NFIELD;
  return fields;
}

// what a field may be, in words
static void describe(const cav_field *field, char *text, size_t size) {
  int n = 0;
  if (field->type == CAV_FIELD_WORD) {
    // enumerators count from 0
    n = snprintf(text, size, "0 .. %g (", field->most);
    for (int i = 0; field->words[i] && n < (int)size; i++)
      n += snprintf(text + n, size - (size_t)n, "%s%s", i ? ", " : "", field->words[i]);
    if (n < (int)size) snprintf(text + n, size - (size_t)n, ")");
  } else if (field->most == (field->type == CAV_FIELD_WHOLE ? INT_MAX : DBL_MAX)) {
    if (field->least == DBL_MIN)
      snprintf(text, size, "a finite number above 0");
    else
      snprintf(text, size, "a finite number of %g or more", field->least);
  } else if (field->least == DBL_MIN) {
    snprintf(text, size, "a number above 0, up to %g", field->most);
  } else {
    snprintf(text, size, "a number from %g to %g", field->least, field->most);
  }
}

cav_status cav_fields_check(const cav_field *field, int n, const void *values, const char *what, cav_error *error) {
  for (int i = 0; i < n; i++, field++) {
    const char *at = (const char *)values + field->offset;
    double value = field->type == CAV_FIELD_REAL ? *(const double *)(const void *)at : *(const int *)(const void *)at;
    // any int is a truth
    if (field->type == CAV_FIELD_FLAG || (value >= field->least && value <= field->most)) continue;
    if (!error) return CAV_BAD_INPUT;
    char expected[200];
    describe(field, expected, sizeof expected);
    *error = (cav_error){.status = CAV_BAD_INPUT};
    snprintf(error->text, sizeof error->text, "%s: %s: expected %s, got %g", what, field->name, expected, value);
    return CAV_BAD_INPUT;
  }
  return CAV_OK;
}

cav_status cav_options_check(const cav_options *options, cav_error *error) {
  return cav_fields_check(fields, NFIELD, options, "options of the evaluation", error);
}

int cav_options_valid(const cav_options *o) {
#define REAL_VALID(stage, name, least, most, ...) &(o->name >= least) & (o->name <= most)
#define WORD_VALID(stage, name, type, words, text) &((unsigned)o->name < (0 words(COUNT_WORD)))
#define FLAG_VALID(...)
  return 1 CAV_OPTIONS(REAL_VALID, WORD_VALID, FLAG_VALID);
}

int cav_options_same(const cav_options *a, const cav_options *b, cav_stage last) {
#define SAME(stage, name, ...) &&(CAV_STAGE_##stage > last || a->name == b->name)
  return 1 CAV_OPTIONS(SAME, SAME, SAME);
}
