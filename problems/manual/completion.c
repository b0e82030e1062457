/// What completes a command line of the tool in bash and in zsh: commands, their options, what options and operands take.
#include <ctype.h>
#include <string.h>

#include "manual.h"

static int takes_folder(const char *value) { return !strcmp(value, "DIR"); }

static int takes_file(const char *value) { return !strcmp(value, "FILE"); }

// words of a value, separated by | and not all in capitals
static int takes_words(const char *value) { return strchr(value, '|') && islower((unsigned char)*value); }

static void print_words(FILE *out, const char *value) {
  for (; *value; value++) fputc(*value == '|' ? ' ' : *value, out);
}

static void print_help_words(FILE *out, const cav_manual *manual) {
  for (int i = 0; i < manual->ncommand; i++) fprintf(out, "%s%s", i ? " " : "", manual->command[i].name);
  for (int i = 0; i < manual->ntopic; i++) fprintf(out, " %s", manual->topic[i].name);
}

void cav_manual_bash(FILE *out, const cav_manual *manual) {
  fprintf(out,
          "# completion of cavort in bash, by cavort help bash\n# shellcheck disable=SC2207\n"
          "_cavort() {\n"
          "  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} options=\n"
          "  COMPREPLY=()\n"
          "  if [ \"$COMP_CWORD\" -eq 1 ]; then\n"
          "    COMPREPLY=($(compgen -W \"");
  for (int i = 0; i < manual->ncommand; i++) fprintf(out, "%s ", manual->command[i].name);
  fprintf(out, "--version\" -- \"$word\"))\n    return\n  fi\n  case $before in\n");
  for (int i = 0; i < manual->noption; i++) {
    const cav_manual_option *option = &manual->option[i];
    if (!option->value) continue;
    fprintf(out, "    %s%s%s) ", option->name, option->brief ? "|" : "", option->brief ? option->brief : "");
    if (takes_words(option->value)) {
      fprintf(out, "COMPREPLY=($(compgen -W \"");
      print_words(out, option->value);
      fprintf(out, "\" -- \"$word\"))");
    } else if (takes_folder(option->value) || takes_file(option->value)) {
      fprintf(out, "COMPREPLY=($(compgen -%s -- \"$word\"))", takes_folder(option->value) ? "d" : "f");
    } else {
      fprintf(out, ":");
    }
    fprintf(out, "; return ;;\n");
  }
  fprintf(out, "  esac\n  case ${COMP_WORDS[1]} in\n");
  for (int i = 0; i < manual->ncommand; i++) {
    fprintf(out, "    %s) options=\"--help", manual->command[i].name);
    for (int k = 0; k < manual->noption; k++)
      if (manual->command[i].options & manual->option[k].bit) fprintf(out, " %s", manual->option[k].name);
    fprintf(out, "\" ;;\n");
  }
  fprintf(out,
          "  esac\n  case $word in\n    -*) COMPREPLY=($(compgen -W \"$options\" -- \"$word\")) ;;\n    *)\n"
          "      if [ \"${COMP_WORDS[1]}\" = help ]; then\n        COMPREPLY=($(compgen -W \"");
  print_help_words(out, manual);
  fprintf(out,
          "\" -- \"$word\"))\n      else\n        COMPREPLY=($(compgen -f -- \"$word\"))\n      fi ;;\n  esac\n}\n"
          "complete -o filenames -F _cavort cavort\n");
}

// text in single quotes of _arguments and _describe: no quote, bracket or colon ends it, white space collapses
static void print_zsh(FILE *out, const char *text) {
  for (int space = 0; *text; text++) {
    if (isspace((unsigned char)*text)) {
      space = 1;
      continue;
    }
    if (space) fputc(' ', out);
    space = 0;
    if (*text == '\'')
      fputs("'\\''", out);
    else if (strchr("[]:\\", *text))
      fprintf(out, "\\%c", *text);
    else
      fputc(*text, out);
  }
}

static void print_zsh_option(FILE *out, const char *name, const cav_manual_option *option) {
  fprintf(out, " \\\n        '*%s[", name);
  print_zsh(out, option->text);
  fprintf(out, "]");
  if (option->value) fprintf(out, ":value:");
  if (option->value && takes_words(option->value)) {
    fprintf(out, "(");
    print_words(out, option->value);
    fprintf(out, ")");
  } else if (option->value) {
    fprintf(out, takes_folder(option->value) ? "_files -/" : takes_file(option->value) ? "_files" : " ");
  }
  fprintf(out, "'");
}

static void print_zsh_options(FILE *out, const cav_manual *manual, const cav_manual_command *command) {
  for (int k = 0; k < manual->noption; k++) {
    const cav_manual_option *option = &manual->option[k];
    if (!(command->options & option->bit)) continue;
    print_zsh_option(out, option->name, option);
    if (option->brief) print_zsh_option(out, option->brief, option);
  }
}

void cav_manual_zsh(FILE *out, const cav_manual *manual) {
  fprintf(out,
          "#compdef cavort\n# completion of cavort in zsh, by cavort help zsh\n_cavort() {\n  local -a commands=(\n");
  for (int i = 0; i < manual->ncommand; i++) {
    fprintf(out, "    '%s:", manual->command[i].name);
    print_zsh(out, manual->command[i].text);
    fprintf(out, "'\n");
  }
  fprintf(out,
          "  )\n  if (( CURRENT == 2 )); then\n    _describe command commands\n    return\n  fi\n"
          "  local command=$words[2]\n  shift words\n  (( CURRENT-- ))\n  case $command in\n");
  for (int i = 0; i < manual->ncommand; i++) {
    const cav_manual_command *command = &manual->command[i];
    fprintf(out, "    %s)\n      _arguments", command->name);
    print_zsh_options(out, manual, command);
    fprintf(out, " \\\n        '*:operand:");
    if (!strcmp(command->name, "help")) {
      fprintf(out, "(");
      print_help_words(out, manual);
      fprintf(out, ")");
    } else {
      fprintf(out, "_files");
    }
    fprintf(out, "' ;;\n");
  }
  fprintf(out, "  esac\n}\n_cavort \"$@\"\n");
}
