/// The man page of the tool, in roff with the man macros.
#include <ctype.h>

#include "cavort/status.h"
#include "manual.h"

// text on lines of its own: white space collapses, what roff would take for a request or an escape does not
static void print_text(FILE *out, const char *text) {
  int start = 1;
  for (; *text; text++) {
    if (isspace((unsigned char)*text)) {
      if (!start && text[1] && !isspace((unsigned char)text[1])) fputc(' ', out);
      continue;
    }
    if (start && (*text == '.' || *text == '\'')) fputs("\\&", out);
    if (*text == '\\')
      fputs("\\e", out);
    else if (*text == '-')
      fputs("\\-", out);
    else
      fputc(*text, out);
    start = 0;
  }
  fputc('\n', out);
}

static void print_option(FILE *out, const cav_manual_option *option) {
  fprintf(out, ".TP\n.B ");
  if (option->brief) {
    fprintf(out, "\\%s", option->brief);
    fprintf(out, ", ");
  }
  fprintf(out, "\\-\\-%s%s", option->name + 2, option->value ? " " : "");
  print_text(out, option->value ? option->value : "");
  print_text(out, option->text);
}

void cav_manual_man_page(FILE *out, const cav_manual *manual) {
  fprintf(out,
          ".\\\" by cavort help man\n.TH CAVORT 1 \"\" \"cavort %s\" \"User Commands\"\n.SH NAME\n"
          "cavort \\- motions of robots and characters, with contacts, by inverse dynamics\n.SH SYNOPSIS\n",
          cav_version());
  for (int i = 0; i < manual->ncommand; i++) {
    fprintf(out, ".B cavort %s\n", manual->command[i].name);
    print_text(out, manual->command[i].operand);
    fprintf(out, "[OPTION]...\n.br\n");
  }
  fprintf(out, ".SH COMMANDS\n");
  for (int i = 0; i < manual->ncommand; i++) {
    const cav_manual_command *command = &manual->command[i];
    fprintf(out, ".SS %s ", command->name);
    print_text(out, command->operand);
    print_text(out, command->text);
    for (int k = 0; k < manual->noption; k++)
      if (command->options & manual->option[k].bit) print_option(out, &manual->option[k]);
  }
  fprintf(out, ".SH TOPICS OF HELP\n");
  for (int i = 0; i < manual->ntopic; i++) {
    fprintf(out, ".TP\n.B cavort help %s\n", manual->topic[i].name);
    print_text(out, manual->topic[i].text);
  }
  fprintf(out, ".SH EXIT STATUS\n");
  print_text(out, CAV_MANUAL_EXIT);
  fprintf(out,
          ".SH ENVIRONMENT\n.TP\n.B CAVORT_THREE_JS\n"
          "path of three.js, which is written into the pages that play motions\n"
          ".SH SEE ALSO\n.B cavort help reference\nprints all elements, attributes, terms and options.\n");
}
