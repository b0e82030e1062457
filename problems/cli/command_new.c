/// cavort new: a problem file for a model, with the model's own joints, bodies and postures in a comment. Of what suits the
/// model the first is taken that is read back without a complaint and is not proven impossible; with --like a motion of the
/// project, or any problem file, with the model in its place.
#include <ctype.h>
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "command.h"
#include "file.h"
#include "result.h"
#include "scaffold.h"
#include "setting.h"
#include "xml.h"

enum { NPLACE = 3, MOTIONS = 256 };

// where motions are: in the source, seen from it or from a build folder in it that holds this program, or where they are
// installed
static const char *place_of(int i) {
  static const char *const from[] = {"problems/motions", CAVORT_DATA "/motions"};
  static char beside[600];
  if (i < 2) return from[i];
  const ssize_t n = readlink("/proc/self/exe", beside, sizeof beside - 64);
  beside[n > 0 ? n : 0] = 0;
  for (int up = 0; up < 3 && strchr(beside, '/'); up++) *strrchr(beside, '/') = 0;
  strcat(beside, "/problems/motions");
  return beside;
}

// NAME of a model's path, without its ending
static void base_of(const char *path, char out[128]) {
  const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path, *dot = strrchr(name, '.');
  snprintf(out, 128, "%.*s", dot && dot > name ? (int)(dot - name) : (int)strlen(name), name);
}

// the name of a model as that of a file, without "scene" at its end; as it was where none is left. For files that are called
// scene*.xml, as those of many models are
static void name_of(const cav_model *model, char base[128]) {
  static const char usual[] = "scene";
  char name[128];
  int n = 0;
  if (strncmp(base, usual, sizeof usual - 1)) return;
  for (const char *c = model->name; *c && n < 127; c++) {
    const int fits = isalnum((unsigned char)*c) || strchr("_-.", *c);
    if (fits || (n && name[n - 1] != '-')) name[n++] = fits ? *c : '-';
  }
  name[n] = 0;
  const int scene = n - (int)(sizeof usual - 1);
  if (scene >= 0 && !strcasecmp(name + scene, usual)) n = scene;
  while (n && strchr("_-.", name[n - 1])) n--;
  if (n) snprintf(base, 128, "%.*s", n, name);
}

// whether a problem file can be read (loads) and is not proven impossible
static cav_status try_file(const char *path, int *loads, cav_error *error) {
  cav_impossibility cause;
  int n = 0;
  cav_problem *problem = cav_problem_load(path, NULL, error);
  *loads = problem != NULL;
  if (!problem) return error->status;
  cav_status status = cav_problem_impossible(problem, &cause, 1, &n, error);
  if (!status && n) status = cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: impossible: %s", path, cause.what);
  cav_problem_free(problem);
  return status;
}

// writes one; *wrote 0: it does not suit the model, -1: there are no more
static cav_status write_choice(cav_scaffold *s, int choice, const char *path, int *wrote, cav_error *error) {
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  *wrote = cav_scaffold_write(file.stream, s, choice);
  if (*wrote > 0) return cav_file_end(&file, error);
  cav_file_abandon(&file);
  return CAV_OK;
}

// the first that is good; where none is, the first that can be read at all, told why it is not; else one that cannot be read, and
// an error that tells why
static cav_status write_own(cav_scaffold *s, const char *path, cav_error *error) {
  for (int strict = 1; strict >= 0; strict--) {
    for (int choice = 0, wrote = 1; wrote >= 0; choice++) {
      cav_status status = write_choice(s, choice, path, &wrote, error);
      if (status) return status;
      if (wrote <= 0) continue;
      cav_error why = {0};
      int loads;
      status = try_file(path, &loads, &why);
      if (status && !strict && loads) fprintf(stderr, "cavort: %s\n", why.text);
      if (!status || (!strict && loads)) return CAV_OK;
      *error = why;
      unlink(path);
    }
  }
  const cav_error why = *error;
  // what asks for least is left to be changed: its lines are those that the error names
  for (int choice = 0, wrote = 1; wrote >= 0; choice++)
    if (write_choice(s, choice, path, &wrote, error)) return error->status;
  return cav_file_fail(error, why.status, 0,
                       "%.700s\n  (%.100s is there all the same, for this to be changed; cavort inspect tells whether "
                       "it can be read then)",
                       why.text, path);
}

// ---------------------------------------------------------------- like another problem

// the file that --like names: a file, or a motion of the project; NULL: there is none
static char *find_like(const char *like) {
  char path[1200];
  if (access(like, R_OK) == 0 && strchr(like, '.')) return strdup(like);
  for (int i = 0; i < NPLACE; i++) {
    snprintf(path, sizeof path, "%.600s/%.400s/problem.xml", place_of(i), like);
    if (access(path, R_OK) == 0) return strdup(path);
  }
  return NULL;
}

// motions that read with a model, or all; how many
static int list_motions(const char *model, char name[MOTIONS][64]) {
  int n = 0;
  for (int i = 0; i < NPLACE && n == 0; i++) {
    struct dirent **entry;
    int found = scandir(place_of(i), &entry, NULL, alphasort);
    for (int k = 0; k < found; k++) {
      char path[1200];
      cav_error ignored = {0};
      snprintf(path, sizeof path, "%.600s/%.400s/problem.xml", place_of(i), entry[k]->d_name);
      int is = *entry[k]->d_name != '.' && n < MOTIONS && access(path, R_OK) == 0;
      cav_problem *problem = is && model ? cav_problem_load(path, model, &ignored) : NULL;
      if (is && (!model || problem)) snprintf(name[n++], 64, "%.63s", entry[k]->d_name);
      cav_problem_free(problem);
      free(entry[k]);
    }
    if (found >= 0) free(entry);
  }
  return n;
}

static void join_names(int n, char name[MOTIONS][64], char *out, size_t room) {
  size_t used = 0;
  *out = 0;
  for (int i = 0; i < n && used + 70 < room; i++)
    used += (size_t)snprintf(out + used, room - used, "%s%s", i ? ", " : "", name[i]);
}

static cav_status refuse_like(const char *like, cav_error *error) {
  static char name[MOTIONS][64];
  const char *pointer[MOTIONS];
  char list[300];
  int n = list_motions(NULL, name);
  for (int i = 0; i < n; i++) pointer[i] = name[i];
  const char *near = cav_xml_nearest(like, pointer, n, sizeof *pointer);
  join_names(n, name, list, sizeof list);
  return cav_file_fail(error, CAV_BAD_INPUT, 0, "--like: there is no motion '%.60s'%s%s%s; %s%s, or a problem file",
                       like, near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "",
                       n ? "there are " : "motions are sought in problems/motions and " CAVORT_DATA "/motions", list);
}

// the text of a file, in fresh memory; NULL: it cannot be read
static char *read_text(const char *path) {
  char *text = NULL;
  size_t length = 0;
  FILE *in = fopen(path, "r"), *copy = in ? open_memstream(&text, &length) : NULL;
  for (int c; copy && (c = fgetc(in)) != EOF;) fputc(c, copy);
  if (in) fclose(in);
  if (copy && fclose(copy) == 0) return text;
  free(text);
  return NULL;
}

// behind the start tag of the first element of that name, comments aside; NULL: there is none that holds something
static char *behind_tag(char *text, const char *name) {
  const size_t n = strlen(name);
  for (char *at = text; (at = strchr(at, '<')); at++) {
    if (!strncmp(at, "<!--", 4)) {
      at = strstr(at, "-->");
      if (!at) return NULL;
    }
    if (strncmp(at + 1, name, n) || !strchr(" \t\r\n/>", at[1 + n])) continue;
    char quote = 0;
    for (at++; *at && (quote || *at != '>'); at++)
      if (*at == quote || (!quote && (*at == '"' || *at == '\''))) quote = quote ? 0 : *at;
    return *at && at[-1] != '/' ? at + 1 : NULL;
  }
  return NULL;
}

static int has_either(const char *text, const char *attribute, const char *value) {
  char quoted[64];
  for (int i = 0; i < 2; i++) {
    snprintf(quoted, sizeof quoted, "%s=%c%s%c", attribute, "\"'"[i], value, "\"'"[i]);
    if (strstr(text, quoted)) return 1;
  }
  return 0;
}

// a floor in the <scene> of a file that puts postures on one which neither the model nor the file has
static cav_status add_floor(const cav_model *model, const char *path, cav_error *error) {
  char *text = read_text(path);
  if (!text) return cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: cannot be read again", path);
  char *scene = behind_tag(text, "scene"), *at = scene ? scene : behind_tag(text, "problem");
  cav_status status = CAV_OK;
  if (at && !cav_scaffold_has_floor(model) && has_either(text, "height", "floor") &&
      !has_either(text, "type", "plane")) {
    cav_file file;
    status = cav_file_begin(&file, path, error);
    if (!status) {
      fwrite(text, 1, (size_t)(at - text), file.stream);
      fputs(scene ? "\n    " CAV_SCAFFOLD_PLANE : "\n  <scene>\n    " CAV_SCAFFOLD_PLANE "\n  </scene>", file.stream);
      fputs(at, file.stream);
      status = cav_file_end(&file, error);
    }
  }
  free(text);
  return status;
}

// the text of a file with the comment before its root, and the model's path as it is seen from there
static cav_status add_comment(const cav_scaffold *s, const char *path, const char *model, const char *like,
                              cav_error *error) {
  char *text = read_text(path);
  if (!text) return cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: cannot be read again", path);
  char *root = strstr(text, "<problem"), *at = root ? strstr(root, model) : NULL;
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (!status) {
    fwrite(text, 1, (size_t)(root ? root - text : 0), file.stream);
    fprintf(file.stream, "<!-- as %.200s, with this model:\n\n", like);
    cav_scaffold_list(file.stream, s);
    fputs("-->\n", file.stream);
    if (root && at) {
      fwrite(root, 1, (size_t)(at - root), file.stream);
      fputs(s->path, file.stream);
      fputs(at + strlen(model), file.stream);
    } else if (root) {
      fputs(root, file.stream);
    }
    status = cav_file_end(&file, error);
  }
  free(text);
  return status;
}

static cav_status write_like(const cav_scaffold *s, const char *like, const char *model, const char *path,
                             cav_error *error) {
  static char name[MOTIONS][64];
  char list[300], why[sizeof error->text], *source = find_like(like), *full = realpath(model, NULL);
  if (!source || !full) {
    free(source), free(full);
    return refuse_like(like, error);
  }
  const cav_setting setting[] = {{"@model", full}, {"@name", s->name}, {"@floating", "true"}};
  cav_status status = cav_setting_write(source, s->floating ? 3 : 2, setting, path, error);
  int loads;
  if (!status) status = add_floor(s->model, path, error);
  if (!status && (status = try_file(path, &loads, error))) {
    unlink(path);
    snprintf(why, sizeof why, "%s", error->text);
    join_names(list_motions(model, name), name, list, sizeof list);
    cav_file_fail(error, status, 0, "%.400s\n  --like %.60s does not suit this model, nothing was written%s%s", why,
                  like, *list ? "; these can be read with it: " : "", list);
  }
  if (!status) status = add_comment(s, path, full, source, error);
  free(source);
  free(full);
  return status;
}

// ---------------------------------------------------------------- the command

// what no problem for the model can do away with
static void warn_actuators(const cav_model *m) {
  for (int a = 0; a < m->nu; a++) {
    const char *why = cav_actuator_unplannable(m, a);
    if (!why) continue;
    fprintf(
        stderr,
        "cavort: WARNING: no problem can be solved with this model: actuator '%s' (%d) cannot be planned with: %s\n",
        m->actuator[a].name, a, why);
    return;
  }
}

static cav_status write_new(const cav_command_line *line, const cav_model *model, const char *name, const char *path,
                            cav_error *error) {
  cav_scaffold s;
  if (model->nv == 0)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: has no joint: nothing of it can move%s", line->operand,
                         line->floating ? "" : " (a URDF may float: --floating)");
  cav_status status = cav_scaffold_open(&s, model, error);
  char *folder = cav_result_folder_of(path), *seen = NULL;
  if (!status && !(folder && (seen = cav_result_seen_from(folder, line->operand, 0, error))))
    status = error->status ? error->status : CAV_NO_MEMORY;
  s.path = seen;
  s.name = name;
  s.floating = line->floating;
  if (!status)
    status = line->like ? write_like(&s, line->like, line->operand, path, error) : write_own(&s, path, error);
  if (!status && !line->quiet) {
    printf("%s: %s\n", path, line->like ? line->like : s.task);
    printf("  cavort solve %s\n", path);
  }
  if (!status) warn_actuators(model);
  cav_scaffold_close(&s);
  free(folder);
  free(seen);
  return status;
}

int cav_command_new(const cav_command_line *line) {
  cav_error error = {0};
  char base[128], name[200], path[220];
  cav_load_options options = cav_load_options_default();
  options.floating = line->floating;
  cav_model *model = cav_model_load_with(line->operand, &options, &error);
  if (!model) return cav_command_fail(&error);
  base_of(line->operand, base);
  name_of(model, base);
  snprintf(name, sizeof name, "%s-%.60s", base, line->like && !strchr(line->like, '/') ? line->like : "first");
  snprintf(path, sizeof path, "%s.xml", name);
  const char *to = line->output ? line->output : path;
  if (access(to, F_OK) == 0) {
    cav_model_free(model);
    cav_file_fail(&error, CAV_BAD_INPUT, 0, "%s: is there already; choose another name: -o FILE", to);
    return cav_command_fail(&error);
  }
  cav_status status = write_new(line, model, name, to, &error);
  cav_model_free(model);
  return status ? cav_command_fail(&error) : CAV_EXIT_CERTIFIED;
}
