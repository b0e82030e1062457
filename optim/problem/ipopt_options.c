/// Options of Ipopt by name and text: which there are, what they take, and what is wrong with one that does not fit.
/// Known here so that files and command lines are checked where they are read, in builds without Ipopt too, and so that
/// Ipopt, which prints its complaints, never has one.
#include "ipopt_options.h"

#include <math.h>
#include <string.h>

#include "file.h"
#include "xml.h"

#define RULE(name, type, least, most, strict, words, text) {#name, type, least, most, strict, words, text},
static const cav_ipopt_rule rule[] = {CAV_IPOPT_OPTIONS(RULE)};
enum { RULES = sizeof rule / sizeof *rule };

const cav_ipopt_rule *cav_ipopt_rules(int *n) {
  *n = RULES;
  return rule;
}

static int is_word(const char *words, const char *value) {
  size_t n = strlen(value);
  for (const char *w = words; n && *w; w += strcspn(w, " "), w += *w == ' ')
    if (!strncmp(w, value, n) && (w[n] == ' ' || !w[n])) return 1;
  return 0;
}

const cav_ipopt_rule *cav_ipopt_check(const cav_ipopt_option *option, double *number, cav_error *error) {
  const cav_ipopt_rule *r = NULL;
  for (int i = 0; i < RULES && !r; i++)
    if (!strcmp(rule[i].name, option->name)) r = &rule[i];
  if (!r) {
    const char *near = cav_xml_nearest(option->name, &rule[0].name, RULES, sizeof *rule);
    cav_file_fail(error, CAV_BAD_INPUT, 0, "'%.60s' is not an option of Ipopt that can be set here%s%s%s", option->name,
                  near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
    return NULL;
  }
  if (r->type == CAV_IPOPT_WORD) {
    if (is_word(r->words, option->value)) return r;
    cav_file_fail(error, CAV_BAD_INPUT, 0, "Ipopt's option '%s': expected one of: %s; got '%.60s'", r->name, r->words,
                  option->value);
    return NULL;
  }
  char *end;
  double x = cav_file_number(option->value, &end);
  int fits = end != option->value && !*end && isfinite(x) && (r->strict ? x > r->least : x >= r->least) && x <= r->most;
  if (fits && (r->type == CAV_IPOPT_REAL || x == floor(x))) {
    *number = x;
    return r;
  }
  const char *kind = r->type == CAV_IPOPT_WHOLE ? "whole number" : "number";
  if (r->most < 1e9) {
    cav_file_fail(error, CAV_BAD_INPUT, 0, "Ipopt's option '%s': expected a %s %s %g up to %g, got '%.60s'", r->name,
                  kind, r->strict ? "above" : "from", r->least, r->most, option->value);
  } else {
    cav_file_fail(error, CAV_BAD_INPUT, 0, "Ipopt's option '%s': expected a %s %s %g, got '%.60s'", r->name, kind,
                  r->strict ? "above" : "of at least", r->least, option->value);
  }
  return NULL;
}

cav_status cav_ipopt_option_check(const cav_ipopt_option *option, cav_error *error) {
  double number;
  return cav_ipopt_check(option, &number, error) ? CAV_OK : CAV_BAD_INPUT;
}
