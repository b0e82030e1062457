/// A motion as keyframes of MJCF, in a file that includes the model's: coordinates and controls in the order of that file,
/// whatever the problem has added to it or taken out. MuJoCo seeks included files and what these name beside the file it
/// is given.
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "exchange.h"
#include "file.h"

// where the coordinates of the model's own file stand in the problem's model
typedef struct order {
  cav_model *file;       ///< NULL: the model is the file's
  int *joint, *actuator; ///< of the problem's model, -1: it has none
  int added, removed;    ///< joints
} order;

static void free_order(order *o) {
  cav_model_free(o->file);
  free(o->joint);
  free(o->actuator);
}

// the joint of a model that is joint j of another: by name, or else by its body's name and its place there
static int same_joint(const cav_model *m, const cav_model *other, int j) {
  const cav_joint *joint = &other->joint[j];
  if (*joint->name) return cav_object_find(m, CAV_OBJECT_JOINT, joint->name);
  const char *name = other->body[joint->body].name;
  int body = *name ? cav_object_find(m, CAV_OBJECT_BODY, name) : -1, place = 0;
  for (int k = j; k > 0 && other->joint[k - 1].body == joint->body; k--) place++;
  for (int k = 0; k < m->njoint && body >= 0; k++)
    if (m->joint[k].body == body && place-- == 0) return k;
  return -1;
}

static cav_status find_order(const cav_problem *p, order *o, cav_error *error) {
  const cav_model *m = p->model;
  *o = (order){0};
  if (p->scene && !(o->file = cav_model_load(p->model_path, error))) return error->status;
  const cav_model *f = o->file ? o->file : m;
  o->joint = malloc(((size_t)f->njoint + 1) * sizeof *o->joint);
  o->actuator = malloc(((size_t)f->nu + 1) * sizeof *o->actuator);
  if (!o->joint || !o->actuator) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the motion");
  int found = 0;
  for (int j = 0; j < f->njoint; j++) {
    o->joint[j] = o->file ? same_joint(m, f, j) : j;
    found += o->joint[j] >= 0;
    if (o->joint[j] < 0 && !*f->joint[j].name && !*f->body[f->joint[j].body].name)
      return cav_file_fail(error, CAV_BAD_INPUT, 0,
                           "%s: joint %d and its body have no names, by which they would be found in the problem's "
                           "model; name one",
                           p->model_path, j);
  }
  for (int a = 0; a < f->nu; a++) {
    const char *name = f->actuator[a].name;
    o->actuator[a] = !o->file ? a : *name ? cav_object_find(m, CAV_OBJECT_ACTUATOR, name) : -1;
    if (o->actuator[a] < 0 && !*name && m->nu == f->nu) o->actuator[a] = a;
  }
  o->removed = f->njoint - found;
  o->added = m->njoint - found;
  return CAV_OK;
}

// whether a file has a text at the beginning of a word
static int has_text(const char *path, const char *text) {
  char line[4096];
  int found = 0;
  FILE *file = fopen(path, "r");
  while (file && !found && fgets(line, sizeof line, file)) {
    for (const char *at = strstr(line, text); at && !found; at = strstr(at + 1, text))
      found = at == line || strchr(" \t\n<", at[-1]) != NULL;
  }
  if (file) fclose(file);
  return found;
}

// the model's path as the file names it; NULL with the reason in error
static char *find_model(const cav_problem *p, const char *path, cav_error *error) {
  if (!p->model_path) {
    cav_file_fail(error, CAV_BAD_INPUT, 0, "the model has no file that keyframes could stand beside");
    return NULL;
  }
  if (has_text(p->model_path, "<robot")) {
    cav_file_fail(error, CAV_BAD_INPUT, 0,
                  "%s: is not MJCF, and MuJoCo includes nothing else; --to npz or csv hold the same numbers",
                  p->model_path);
    return NULL;
  }
  char *folder = cav_result_folder_of(path), *own = cav_result_folder_of(p->model_path), *seen = NULL;
  char *here = folder ? realpath(folder, NULL) : NULL, *there = own ? realpath(own, NULL) : NULL;
  if (!here || !there)
    cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: %s", here ? p->model_path : path, strerror(errno));
  else if (strcmp(here, there) && has_text(p->model_path, "file="))
    cav_file_fail(error, CAV_BAD_INPUT, 0,
                  "%s names files of its own, which MuJoCo seeks beside the file that it is given: write the keyframes "
                  "there, -o %s/NAME.xml",
                  p->model_path, own);
  else // MuJoCo takes every path for a relative one
    seen = cav_result_seen_from(here, p->model_path, 1, error);
  free(folder), free(own), free(here), free(there);
  return seen;
}

// an attribute of numbers, written once it has one
typedef struct list {
  FILE *out;
  const char *name;
  int n;
} list;

static void put(list *l, const double *x, int n) {
  for (int i = 0; i < n; i++) {
    if (!l->n++) fprintf(l->out, " %s=\"", l->name);
    fprintf(l->out, "%s%.17g", l->n > 1 ? " " : "", x[i]);
  }
}

static void finish(list *l) {
  if (l->n) fputc('"', l->out);
}

static int size_of(const cav_joint *j, int position) {
  if (j->type == CAV_JOINT_FREE) return position ? 7 : 6;
  if (j->type == CAV_JOINT_BALL) return position ? 4 : 3;
  return 1;
}

// what a sample holds, in the file's order; what the problem's model lacks stays as the file has it
static void write_key(FILE *out, const cav_recording *r, const order *o, int i) {
  const cav_model *m = r->model, *f = o->file ? o->file : m;
  const double *q = r->motion->q + (size_t)i * (size_t)m->nq, *v = r->motion->v + (size_t)i * (size_t)m->nv;
  const double *input = r->forces->input + r->knot[i] * m->nu, none[6] = {0};
  list qpos = {out, "qpos", 0}, qvel = {out, "qvel", 0}, act = {out, "act", 0}, ctrl = {out, "ctrl", 0};
  fprintf(out, "    <key name=\"motion %d\" time=\"%.17g\"", i, i * r->timestep);
  for (int j = 0; j < f->njoint; j++)
    put(&qpos, o->joint[j] < 0 ? f->q0 + f->joint[j].q : q + m->joint[o->joint[j]].q, size_of(&f->joint[j], 1));
  finish(&qpos);
  for (int j = 0; j < f->njoint; j++)
    put(&qvel, o->joint[j] < 0 ? none : v + m->joint[o->joint[j]].dof, size_of(&f->joint[j], 0));
  finish(&qvel);
  for (int a = 0; a < f->nu; a++)
    if (f->actuator[a].activation != CAV_ACTIVATION_NONE)
      put(&act, o->actuator[a] < 0 ? none : input + o->actuator[a], 1);
  finish(&act);
  for (int a = 0; a < f->nu; a++) {
    // of what integrates its control the control is a rate
    int zero = o->actuator[a] < 0 || f->actuator[a].activation == CAV_ACTIVATION_INTEGRATOR;
    put(&ctrl, zero ? none : input + o->actuator[a], 1);
  }
  finish(&ctrl);
  fputs("/>\n", out);
}

static void tell(const cav_recording *r, const order *o, char note[CAV_EXCHANGE_NOTE]) {
  int stateful = 0, n = 0;
  for (int a = 0; a < r->model->nu; a++) stateful += r->model->actuator[a].activation != CAV_ACTIVATION_NONE;
  *note = 0;
  if (r->problem->scene)
    n = snprintf(note, CAV_EXCHANGE_NOTE,
                 "for the model's own file: what the problem's <scene> adds is not in it (%d joints), what it removes "
                 "stands there as the file says (%d joints)",
                 o->added, o->removed);
  if (stateful)
    snprintf(note + n, CAV_EXCHANGE_NOTE - (size_t)n,
             "%sctrl of the %d actuators that have an activation is that activation (of integrators 0), as if it had "
             "settled",
             n ? "; " : "", stateful);
}

cav_status cav_exchange_write_keyframes(const cav_recording *r, const char *path, char note[CAV_EXCHANGE_NOTE],
                                        cav_error *error) {
  order o = {0};
  cav_file file;
  char *model = find_model(r->problem, path, error);
  cav_status status = model ? find_order(r->problem, &o, error) : error->status;
  if (!status) status = cav_file_begin(&file, path, error);
  if (!status) {
    fprintf(
        file.stream,
        "<!-- A motion of cavort as keyframes 'motion 0' to 'motion %d', %.6g s apart. qvel leads to a keyframe from\n"
        "     the one before; ctrl holds until the next one. -->\n<mujoco>\n  <include file=\"",
        r->n - 1, r->timestep);
    cav_file_write_xml(file.stream, model);
    fputs("\"/>\n  <keyframe>\n", file.stream);
    for (int i = 0; i < r->n; i++) write_key(file.stream, r, &o, i);
    fputs("  </keyframe>\n</mujoco>\n", file.stream);
    status = cav_file_end(&file, error);
    tell(r, &o, note);
  }
  free_order(&o);
  free(model);
  return status;
}
