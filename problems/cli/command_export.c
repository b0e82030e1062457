/// cavort export: the motion of a result folder in the formats of other tools.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "exchange.h"
#include "file.h"
#include "xml.h"

void cav_command_print_formats(FILE *out) {
  for (cav_exchange k = 0; k < CAV_EXCHANGE_FORMATS; k++) {
    const cav_exchange_rule *rule = cav_exchange_rule_of(k);
    fprintf(out, "%s %s, %s", k ? ";" : ":", rule->name, rule->text);
  }
}

// CAV_EXCHANGE_FORMATS and an error for a word that is none
static cav_exchange format_of(const char *word, cav_error *error) {
  const char *name[CAV_EXCHANGE_FORMATS];
  char list[120] = "";
  for (cav_exchange k = 0; k < CAV_EXCHANGE_FORMATS; k++) {
    name[k] = cav_exchange_rule_of(k)->name;
    if (word && !strcmp(word, name[k])) return k;
    size_t n = strlen(list);
    snprintf(list + n, sizeof list - n, "%s%s", k == 0 ? "" : k + 1 < CAV_EXCHANGE_FORMATS ? ", " : " or ", name[k]);
  }
  const char *near = word ? cav_xml_nearest(word, name, CAV_EXCHANGE_FORMATS, sizeof *name) : NULL;
  if (!word)
    cav_file_fail(error, CAV_BAD_INPUT, 0, "--to: expected %s", list);
  else
    cav_file_fail(error, CAV_BAD_INPUT, 0, "--to: expected %s, got '%.60s'%s%s%s", list, word,
                  near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
  return CAV_EXCHANGE_FORMATS;
}

int cav_command_export(const cav_command_line *line) {
  cav_error error = {0};
  cav_exchange format = format_of(line->format, &error);
  if (format == CAV_EXCHANGE_FORMATS) return cav_command_fail(&error);
  const cav_exchange_rule *rule = cav_exchange_rule_of(format);
  cav_result *result = cav_result_read(line->operand, line->model, &error);
  if (!result) return cav_command_fail(&error);
  cav_recording recording;
  char note[CAV_EXCHANGE_NOTE] = "",
       *path = line->output ? strdup(line->output) : cav_result_path(line->operand, rule->file);
  double rate = line->rate > 0 || format != CAV_EXCHANGE_MP4 ? line->rate : 30;
  cav_status status = path ? cav_recording_open(&recording, result, rate, &error) : CAV_NO_MEMORY;
  if (!status) {
    status = rule->write(&recording, path, note, &error);
    if (!status && !line->quiet) {
      printf("%s: %d samples, %g s apart\n", path, recording.n, recording.timestep);
      if (*note) printf("  %s\n", note);
    }
    cav_recording_close(&recording);
  }
  free(path);
  cav_result_free(result);
  return status ? cav_command_fail(&error) : CAV_EXIT_CERTIFIED;
}
