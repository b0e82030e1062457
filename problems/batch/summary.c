#include "summary.h"

#include <dirent.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "csv.h"
#include "file.h"
#include "result.h"

static char *read_text(const char *folder, const char *name) {
  char *path = cav_result_path(folder, name), *text = NULL;
  FILE *file = path ? fopen(path, "r") : NULL;
  size_t length = 0;
  FILE *copy = file ? open_memstream(&text, &length) : NULL;
  for (int c; copy && (c = fgetc(file)) != EOF;) fputc(c, copy);
  if (copy) fclose(copy);
  if (file) fclose(file);
  free(path);
  return text;
}

// ---------------------------------------------------------------- verdict.json, as certificate.c writes it

// the value of a field of the outermost object, each on a line of its own; NULL: there is none
static const char *field(const char *text, const char *name) {
  char head[80];
  snprintf(head, sizeof head, "\n  \"%s\": ", name);
  const char *at = text ? strstr(text, head) : NULL;
  return at ? at + strlen(head) : NULL;
}

static double number(const char *text, const char *name) {
  const char *at = field(text, name);
  char *end = NULL;
  double value = at ? cav_file_number(at, &end) : 0;
  return end && end != at ? value : NAN;
}

static int is_true(const char *text, const char *name) {
  const char *at = field(text, name);
  return at && !strncmp(at, "true", 4);
}

// quotes and backslashes come with a backslash, what cannot be printed as \u00xx
static void copy_text(const char *text, const char *name, char *out, size_t room) {
  const char *at = field(text, name);
  size_t n = 0;
  for (at = at && *at == '"' ? at + 1 : ""; *at && *at != '"' && n + 1 < room; at++) {
    if (*at == '\\' && at[1] == 'u' && strlen(at) > 5) {
      at += 5;
      out[n++] = ' ';
    } else {
      if (*at == '\\' && at[1]) at++;
      out[n++] = *at;
    }
  }
  out[n] = 0;
}

// ---------------------------------------------------------------- strategies.csv

cav_tried cav_tried_open(const char *folder) {
  char *path = cav_result_path(folder, "strategies.csv");
  cav_tried t = {.in = path ? fopen(path, "r") : NULL};
  free(path);
  return t;
}

int cav_tried_next(cav_tried *t) {
  while (t->in && getline(&t->line, &t->room, t->in) > 0) {
    // strategy,kept,outcome, numbers, and the two quoted texts that end a line: three commas, then four quotation marks
    char *mark[7], *c = t->line;
    int n = 0;
    while (n < 7 && (c = strchr(c, n < 3 ? ',' : '"'))) mark[n++] = c++;
    if (n < 7) continue;
    char **comma = mark, **quote = mark + 3;
    for (int k = 0; k < 3; k++) *comma[k] = 0;
    *quote[1] = *quote[3] = 0;
    t->kept = !strcmp(comma[0] + 1, "1");
    t->name = t->line, t->outcome = comma[1] + 1;
    // of cost, iterations and seconds the last
    for (c = comma[2] + 1, n = 0; n < 2 && c; n++) c = (c = strchr(c, ',')) ? c + 1 : NULL;
    char *end = NULL;
    t->seconds = c ? cav_file_number(c, &end) : NAN;
    if (end == c) t->seconds = NAN;
    t->changed = quote[0] + 1, t->reason = quote[2] + 1;
    return 1;
  }
  return 0;
}

void cav_tried_close(cav_tried *t) {
  if (t->in) fclose(t->in);
  free(t->line);
  *t = (cav_tried){0};
}

double cav_summary_tried(const char *folder, int *n) {
  cav_tried t = cav_tried_open(folder);
  double seconds = 0;
  for (*n = 0; cav_tried_next(&t);)
    if (isfinite(t.seconds)) seconds += t.seconds, ++*n;
  cav_tried_close(&t);
  return seconds;
}

void cav_summary_read(const char *folder, cav_summary *s) {
  char *text = read_text(folder, "verdict.json");
  const cav_summary none = {.cost = NAN, .optimality = NAN, .iterations = NAN, .seconds = NAN};
  *s = none;
  snprintf(s->name, sizeof s->name, "%.255s", folder);
  if (!text) {
    snprintf(s->cause, sizeof s->cause, "no verdict: the solve has not ended, or was ended from outside");
    return;
  }
  s->known = 1;
  s->certified = is_true(text, "certified");
  s->achieved = is_true(text, "achieved");
  s->cost = number(text, "cost");
  s->optimality = number(text, "optimality");
  s->iterations = number(text, "iterations");
  int tried;
  double seconds = cav_summary_tried(folder, &tried);
  s->seconds = tried > 1 ? seconds : number(text, "solve_seconds");
  copy_text(text, "problem", s->motion, sizeof s->motion);
  copy_text(text, "model", s->model, sizeof s->model);
  if (!s->certified) {
    copy_text(text, "reason", s->cause, sizeof s->cause);
  } else if (!s->achieved) {
    snprintf(s->cause, sizeof s->cause, "misses ");
    copy_text(text, "missed", s->cause + 7, sizeof s->cause - 7);
  }
  free(text);
}

// ---------------------------------------------------------------- records

// "NAME.record"
static void record_name(const char *name, char out[300]) { snprintf(out, 300, "%.255s.record", name); }

// the rest of a line that begins with a word
static void take_line(const char *text, const char *word, char *out, size_t room) {
  size_t n = strlen(word);
  out[0] = 0;
  for (const char *line = text; *line;) {
    size_t length = strcspn(line, "\n");
    if (length > n && !strncmp(line, word, n) && line[n] == ' ')
      snprintf(out, room, "%.*s", (int)(length - n - 1), line + n + 1);
    line += length + (line[length] == '\n');
  }
}

int cav_batch_record_read(const char *folder, const char *name, cav_batch_record *r) {
  char file[300], number_text[32];
  record_name(name, file);
  char *text = read_text(folder, file);
  *r = (cav_batch_record){0};
  if (!text) return 0;
  take_line(text, "key", r->key, sizeof r->key);
  take_line(text, "status", number_text, sizeof number_text);
  take_line(text, "cause", r->cause, sizeof r->cause);
  r->begun = !strcmp(number_text, "begun");
  r->status = atoi(number_text);
  free(text);
  return *r->key != 0;
}

cav_status cav_batch_record_write(const char *folder, const char *name, const cav_batch_record *r, cav_error *error) {
  char file_name[300];
  cav_file file;
  record_name(name, file_name);
  char *path = cav_result_path(folder, file_name);
  cav_status status = path ? cav_file_begin(&file, path, error) : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  if (!status) {
    fprintf(file.stream, "key %s\nstatus ", r->key);
    if (r->begun)
      fputs("begun\n", file.stream);
    else
      fprintf(file.stream, "%d\ncause %s\n", r->status, r->cause);
    status = cav_file_end(&file, error);
  }
  free(path);
  return status;
}

int cav_batch_record_done(const cav_batch_record *r) {
  return !r->begun && WIFEXITED(r->status) && WEXITSTATUS(r->status) <= 1;
}

void cav_batch_record_explain(const char *log, int status, char cause[CAV_SUMMARY_TEXT]) {
  char line[2 * CAV_SUMMARY_TEXT];
  static const char head[] = "cavort: ";
  cause[0] = 0;
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return;
  FILE *file = log ? fopen(log, "r") : NULL;
  while (file && fgets(line, sizeof line, file)) {
    line[strcspn(line, "\n")] = 0;
    // the last complaint; warnings are none
    if (strncmp(line, head, strlen(head)) || !strncmp(line, "cavort: WARNING", 15)) continue;
    snprintf(cause, CAV_SUMMARY_TEXT, "%.*s", CAV_SUMMARY_TEXT - 1, line + strlen(head));
    // of one that is not solved at all this is the cause
    if (!strncmp(line, "cavort: impossible", 18)) break;
  }
  if (file) fclose(file);
  if (WIFSIGNALED(status)) {
    int signal_number = WTERMSIG(status);
    snprintf(cause, CAV_SUMMARY_TEXT, "ended by signal %d (%s)", signal_number, strsignal(signal_number));
  } else if (!*cause && WIFEXITED(status) && WEXITSTATUS(status) > 1) {
    snprintf(cause, CAV_SUMMARY_TEXT, "exit status %d, and nothing said why%s", WEXITSTATUS(status),
             file ? "" : ": its log cannot be read");
  }
}

void cav_summary_read_item(const char *folder, const char *name, cav_summary *s) {
  cav_batch_record r;
  char *path = cav_result_path(folder, name);
  const cav_summary none = {.cost = NAN, .optimality = NAN, .iterations = NAN, .seconds = NAN};
  *s = none;
  if (path) cav_summary_read(path, s);
  free(path);
  snprintf(s->name, sizeof s->name, "%.255s", name);
  if (!cav_batch_record_read(folder, name, &r)) return;
  // one that did not come to its end has left no verdict of its own; one that was proven impossible neither
  if (cav_batch_record_done(&r) && s->known) return;
  *s = none;
  snprintf(s->name, sizeof s->name, "%.255s", name);
  snprintf(s->cause, sizeof s->cause, "%s", r.begun ? "not ended: it runs, or all was ended from outside" : r.cause);
}

// ---------------------------------------------------------------- lists

typedef struct list {
  int n;
  cav_summary *row;
} list;

static cav_summary *append(list *l) {
  cav_summary *row = realloc(l->row, ((size_t)l->n + 1) * sizeof *row);
  if (!row) return NULL;
  l->row = row;
  return &row[l->n++];
}

static int is_result(const char *folder) {
  char *verdict = cav_result_path(folder, "verdict.json"), *motion = cav_result_path(folder, "trajectory.csv");
  int is = (verdict && access(verdict, F_OK) == 0) || (motion && access(motion, F_OK) == 0);
  free(verdict);
  free(motion);
  return is;
}

static int by_name(const struct dirent **a, const struct dirent **b) { return strcmp((*a)->d_name, (*b)->d_name); }

// the problems of a batch by their records, or else the results that a folder holds; 0 without memory
static int add_all(list *l, const char *folder) {
  struct dirent **entry;
  int n = scandir(folder, &entry, NULL, by_name), good = 1, before = l->n;
  for (int pass = 0; pass < 2 && l->n == before; pass++) {
    for (int i = 0; i < n && good; i++) {
      const char *name = entry[i]->d_name;
      size_t length = strlen(name);
      char *path = cav_result_path(folder, name);
      int record = length > 7 && !strcmp(name + length - 7, ".record");
      cav_summary *row = path && (pass ? *name != '.' && is_result(path) : record) ? append(l) : NULL;
      good = path && (row || !(pass ? is_result(path) : record));
      if (row && pass) cav_summary_read(path, row);
      if (row && !pass) {
        char item[256];
        snprintf(item, sizeof item, "%.*s", (int)(length - 7 < 255 ? length - 7 : 255), name);
        cav_summary_read_item(folder, item, row);
      }
      free(path);
    }
  }
  for (int i = 0; i < n; i++) free(entry[i]);
  if (n >= 0) free(entry);
  return good;
}

cav_status cav_summary_list(int nfolder, char *const *folder, int *n, cav_summary **summary, cav_error *error) {
  list l = {0};
  cav_status status = CAV_OK;
  for (int i = 0; i < nfolder && !status; i++) {
    int before = l.n, good = 1;
    if (is_result(folder[i])) {
      cav_summary *row = append(&l);
      if (row) cav_summary_read(folder[i], row);
      good = row != NULL;
    } else {
      good = add_all(&l, folder[i]);
    }
    if (!good) status = cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the table");
    if (!status && l.n == before)
      status = cav_file_fail(error, CAV_BAD_INPUT, 0,
                             "%s: holds neither a result nor those of a batch: cavort solve PROBLEM... -j N -o %s",
                             folder[i], folder[i]);
  }
  *n = l.n;
  *summary = l.row;
  if (status) free(l.row), *summary = NULL;
  return status;
}

// ---------------------------------------------------------------- printing

static void print_number(FILE *out, const char *format, double x) {
  char text[32] = "-";
  if (isfinite(x)) snprintf(text, sizeof text, format, x);
  fprintf(out, " %10s", text);
}

static void print_csv(FILE *out, int n, const cav_summary *summary) {
  fputs("name,motion,model,certified,achieved,cost,optimality,iterations,seconds,cause\n", out);
  for (int i = 0; i < n; i++) {
    const cav_summary *s = &summary[i];
    const double value[] = {s->cost, s->optimality, s->iterations, s->seconds};
    const char *text[] = {s->name, s->motion, s->model};
    for (int k = 0; k < 3; k++) cav_table_write_text(out, text[k]), fputc(',', out);
    if (s->known) fprintf(out, "%d,%d", s->certified, s->achieved);
    if (!s->known) fputs("0,0", out);
    for (int k = 0; k < 4; k++) fputc(',', out), cav_table_write_number(out, value[k]);
    fputc(',', out);
    cav_table_write_text(out, s->cause);
    fputc('\n', out);
  }
}

static int widest(int n, const cav_summary *summary, size_t offset, int least) {
  int width = least;
  for (int i = 0; i < n; i++) {
    int length = (int)strlen((const char *)&summary[i] + offset);
    width = length > width ? length : width;
  }
  return width;
}

void cav_summary_print(FILE *out, int n, const cav_summary *summary, int csv) {
  int certified = 0, achieved = 0;
  if (csv) {
    print_csv(out, n, summary);
    return;
  }
  int name = widest(n, summary, offsetof(cav_summary, name), 4),
      motion = widest(n, summary, offsetof(cav_summary, motion), 6),
      model = widest(n, summary, offsetof(cav_summary, model), 5);
  fprintf(out, "%-*s  %-*s  %-*s  certified  achieved %10s %10s %10s %10s  first cause\n", name, "name", motion,
          "motion", model, "model", "cost", "optimality", "iterations", "seconds");
  for (int i = 0; i < n; i++) {
    const cav_summary *s = &summary[i];
    fprintf(out, "%-*s  %-*s  %-*s  %-9s  %-8s", name, s->name, motion, *s->motion ? s->motion : "-", model,
            *s->model ? s->model : "-",
            !s->known      ? "-"
            : s->certified ? "yes"
                           : "no",
            !s->known     ? "-"
            : s->achieved ? "yes"
                          : "no");
    print_number(out, "%.5g", s->cost);
    print_number(out, "%.1e", s->optimality);
    print_number(out, "%.0f", s->iterations);
    print_number(out, "%.1f", s->seconds);
    fprintf(out, "  %s\n", s->cause);
    certified += s->certified;
    achieved += s->certified && s->achieved;
  }
  fprintf(out, "%d of %d certified, %d of these achieve what was asked\n", certified, n, achieved);
}
