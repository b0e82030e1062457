/// Items are tasks of a pool. Each has its record, written by this process when a solve begins and ends, so that one that
/// was killed is known, tasks of several machines may share a folder, and what came to its end is not solved again.
#include "batch.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "digest.h"
#include "file.h"
#include "pool.h"
#include "result.h"

enum { SWEEP = 1000, ITEMS = 100000 };

static cav_status no_memory(cav_error *error) {
  return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the batch");
}

// ---------------------------------------------------------------- items

// a setting as it was given: its values
typedef struct sweep {
  const char *path;
  int n;
  const char **value;
} sweep;

// the '=' between path and value: after the attribute's '@', as names may have one
static const char *equals(const char *setting) {
  const char *attribute = strchr(setting, '@');
  return strchr(attribute ? attribute : setting, '=');
}

int cav_batch_sweeps(int n, char *const *setting) {
  for (int i = 0; i < n; i++) {
    const char *value = equals(setting[i]);
    if (value && strchr(value, ',')) return 1;
  }
  return 0;
}

static char *keep(cav_batch *b, char *text) {
  char **more = text ? realloc(b->text, ((size_t)b->ntext + 1) * sizeof *more) : NULL;
  if (!more) {
    free(text);
    return NULL;
  }
  b->text = more;
  return b->text[b->ntext++] = text;
}

static cav_status split(cav_batch *b, const char *setting, sweep *s, cav_error *error) {
  const char *value = equals(setting);
  if (!value || value == setting)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "--set: expected PATH=VALUE, as cost/apex/@target=0.4, got '%.200s'",
                         setting);
  char *path = keep(b, strndup(setting, (size_t)(value - setting))), *rest = keep(b, strdup(value + 1)), *word;
  const char **list = malloc((SWEEP + 1) * sizeof *list);
  *s = (sweep){path, 0, list};
  if (!path || !rest || !list) return no_memory(error);
  while ((word = strsep(&rest, ","))) {
    if (s->n == SWEEP) return cav_file_fail(error, CAV_BAD_INPUT, 0, "--set %.100s: more than %d values", path, SWEEP);
    s->value[s->n++] = word;
  }
  return CAV_OK;
}

// MOTION/problem.xml is called by its folder, another file by its own name
static void name_of(const char *path, char *out, size_t room) {
  const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
  size_t length = strlen(name);
  if (length > 4 && !strcmp(name + length - 4, ".xml")) length -= 4;
  if (!strcmp(name, "problem.xml") && slash) {
    const char *start = slash;
    while (start > path && start[-1] != '/') start--;
    if (slash > start && *start != '.') name = start, length = (size_t)(slash - start);
  }
  snprintf(out, room, "%.*s", (int)length, name);
}

// ",apex.target=0.4": the element, the attribute and the value, as they may stand in the name of a file
static void add_value(cav_batch_item *item, const cav_setting *s) {
  char text[160];
  const char *at = strrchr(s->path, '@'), *end = at && at > s->path ? at - 1 : s->path, *start = end;
  while (start > s->path && start[-1] != '/') start--;
  size_t n = strlen(item->name);
  snprintf(text, sizeof text, ",%.*s%s%.60s=%.60s", (int)(end - start), start, end > start ? "." : "", at ? at + 1 : "",
           s->value);
  for (char *c = text; *c; c++)
    if (strchr("/ \t\n\\:*?\"<>|'", *c)) *c = '_';
  snprintf(item->name + n, sizeof item->name - n, "%s", text);
}

// two of one name are told apart by numbers
static void make_unique(cav_batch *b, int k) {
  char name[sizeof b->item->name];
  memcpy(name, b->item[k].name, sizeof name);
  for (int number = 2, i = 0; i < k; i++) {
    if (strcmp(b->item[i].name, b->item[k].name)) continue;
    snprintf(b->item[k].name, sizeof b->item[k].name, "%.240s-%d", name, number++);
    i = -1;
  }
}

static cav_status add_items(cav_batch *b, const char *problem, const sweep *s, cav_error *error) {
  double all = 1;
  for (int k = 0; k < b->nsetting; k++) all *= s[k].n;
  if (b->n + all > ITEMS) return cav_file_fail(error, CAV_BAD_INPUT, 0, "more than %d problems", ITEMS);
  cav_batch_item *more = realloc(b->item, ((size_t)b->n + (size_t)all) * sizeof *more);
  if (!more) return no_memory(error);
  b->item = more;
  for (int i = 0; i < (int)all; i++) {
    cav_batch_item *item = &b->item[b->n];
    *item = (cav_batch_item){.source = problem};
    name_of(problem, item->name, sizeof item->name - 170);
    // the last setting runs fastest
    int rest = i, which[CAV_BATCH_SETTINGS];
    for (int k = b->nsetting - 1; k >= 0; k--) which[k] = rest % s[k].n, rest /= s[k].n;
    for (int k = 0; k < b->nsetting; k++) {
      item->setting[k] = (cav_setting){s[k].path, s[k].value[which[k]]};
      if (s[k].n > 1 && strlen(item->name) < sizeof item->name - 170) add_value(item, &item->setting[k]);
    }
    make_unique(b, b->n++);
  }
  return CAV_OK;
}

cav_status cav_batch_open(cav_batch *b, int nproblem, char *const *problem, int nsetting, char *const *setting,
                          cav_error *error) {
  sweep s[CAV_BATCH_SETTINGS] = {{0}};
  cav_status status = CAV_OK;
  b->nsetting = nsetting;
  for (int k = 0; k < nsetting && !status; k++) status = split(b, setting[k], &s[k], error);
  for (int i = 0; i < nproblem && !status; i++) status = add_items(b, problem[i], s, error);
  for (int k = 0; k < nsetting; k++) free(s[k].value);
  return status;
}

void cav_batch_close(cav_batch *b) {
  for (int i = 0; i < b->n; i++) free(b->item[i].problem);
  for (int i = 0; i < b->ntext; i++) free(b->text[i]);
  free(b->item);
  free(b->text);
}

// ---------------------------------------------------------------- what is there already

static char *beside(const cav_batch *b, const cav_batch_item *item, const char *ending) {
  char name[300];
  snprintf(name, sizeof name, "%.255s%s", item->name, ending);
  return cav_result_path(b->folder, name);
}

static void digest_of(const char *path, char text[CAV_DIGEST_TEXT]) {
  FILE *file = path ? fopen(path, "rb") : NULL;
  text[0] = 0;
  if (file) cav_digest(file, text), fclose(file);
}

// digests of problem and model, and what else the solve depends on
static void make_key(const cav_batch *b, cav_batch_item *item) {
  char problem[CAV_DIGEST_TEXT], model[CAV_DIGEST_TEXT];
  char *named = b->model ? NULL : cav_setting_root(item->problem, "model");
  char *path = named ? cav_file_beside(item->problem, named) : NULL;
  digest_of(item->problem, problem);
  digest_of(b->model ? b->model : path, model);
  snprintf(item->key, sizeof item->key, "%s %s %.220s", *problem ? problem : "-", *model ? model : "-", b->options);
  free(named);
  free(path);
}

static int has_checkpoint(const cav_batch *b, const cav_batch_item *item) {
  char *folder = cav_result_path(b->folder, item->name),
       *path = folder ? cav_result_path(folder, "checkpoint.csv") : NULL;
  int has = path && access(path, R_OK) == 0;
  free(folder);
  free(path);
  return has;
}

// a complaint that is known before a process is begun
static void fail_item(cav_batch *b, cav_batch_item *item, const cav_error *error) {
  cav_batch_record r = {.status = 2 << 8};
  cav_error ignored;
  memcpy(r.key, item->key, sizeof r.key);
  snprintf(r.cause, sizeof r.cause, "%.*s", CAV_SUMMARY_TEXT - 1, error->text);
  r.cause[strcspn(r.cause, "\n")] = 0;
  memcpy(item->cause, r.cause, sizeof r.cause);
  cav_batch_record_write(b->folder, item->name, &r, &ignored);
  if (b->tell) fprintf(stderr, "%s: %s\n", item->name, r.cause);
}

// 0: it is not to be solved
static int prepare(void *context, int k) {
  cav_batch *b = context;
  cav_batch_item *item = &b->item[k];
  cav_batch_record r;
  cav_error error = {0};
  item->problem = b->nsetting ? beside(b, item, ".xml") : strdup(item->source);
  if (!item->problem) return 0;
  if (b->nsetting && cav_setting_write(item->source, b->nsetting, item->setting, item->problem, &error)) {
    fail_item(b, item, &error);
    return 0;
  }
  make_key(b, item);
  int same = cav_batch_record_read(b->folder, item->name, &r) && !strcmp(r.key, item->key);
  item->done = same && cav_batch_record_done(&r);
  if (item->done) return 0;
  item->resume = same && has_checkpoint(b, item);
  r = (cav_batch_record){.begun = 1};
  memcpy(r.key, item->key, sizeof r.key);
  if (cav_batch_record_write(b->folder, item->name, &r, &error) && b->tell) fprintf(stderr, "cavort: %s\n", error.text);
  return 1;
}

// ---------------------------------------------------------------- solving

// in the process of the item: what it says goes into its log
static int work(void *context, int k) {
  cav_batch *b = context;
  const cav_batch_item *item = &b->item[k];
  char *log = beside(b, item, ".log"), *folder = cav_result_path(b->folder, item->name);
  if (!log || !folder) return 3;
  int to = open(log, O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (to < 0) to = open("/dev/null", O_WRONLY);
  if (to >= 0) dup2(to, STDOUT_FILENO), dup2(to, STDERR_FILENO), close(to);
  int status = b->solve(b->context, item, folder);
  free(log);
  free(folder);
  return status;
}

static void tell(const cav_batch *b, const cav_batch_item *item, const char *cause) {
  int done = 0;
  cav_summary s;
  for (int i = 0; i < b->n; i++) done += b->item[i].done;
  cav_summary_read_item(b->folder, item->name, &s);
  fprintf(stderr, "%3d of %d  %s  %s", done, b->n, item->name,
          !s.known                    ? "no result"
          : s.certified && s.achieved ? "certified"
          : s.certified               ? "certified, not achieved"
                                      : "not certified");
  if (s.known) fprintf(stderr, "  %.1f s  %.0f iterations", s.seconds, s.iterations);
  // a verdict knows better than the last complaint
  const char *why = s.known ? s.cause : cause;
  fprintf(stderr, "%s%s\n", *why ? ": " : "", why);
}

static void end(void *context, int k, int how) {
  cav_batch *b = context;
  cav_batch_item *item = &b->item[k];
  cav_batch_record r = {.status = how};
  cav_error error = {0};
  char *log = beside(b, item, ".log");
  memcpy(r.key, item->key, sizeof r.key);
  cav_batch_record_explain(log, how, r.cause);
  memcpy(item->cause, r.cause, sizeof r.cause);
  item->done = cav_batch_record_done(&r);
  if (cav_batch_record_write(b->folder, item->name, &r, &error)) fprintf(stderr, "cavort: %s\n", error.text);
  if (b->tell) tell(b, item, r.cause);
  free(log);
}

cav_status cav_batch_run(cav_batch *b, cav_error *error) {
  const cav_pool pool = {b->n, b->processes, b->interrupted, prepare, work, end, b};
  cav_status status = cav_result_folder(b->folder, error);
  return status ? status : cav_pool_run(&pool, error);
}

void cav_batch_summary(const cav_batch *b, cav_summary *summary) {
  for (int i = 0; i < b->n; i++) {
    cav_summary_read_item(b->folder, b->item[i].name, &summary[i]);
    // what could not be written was seen all the same
    if (*b->item[i].cause && !b->item[i].done) summary[i].known = summary[i].certified = summary[i].achieved = 0;
    if (*b->item[i].cause && !summary[i].known)
      snprintf(summary[i].cause, sizeof summary[i].cause, "%s", b->item[i].cause);
  }
}
