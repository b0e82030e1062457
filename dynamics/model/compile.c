/// Compiles a spec into the immutable model: one block of memory, carved once.
///
/// Phases: masses; names and references; which bodies move as one (links) and their coordinates; sizes; carving (the
/// same walk twice, first to measure, then to place); filling (bodies.c, attachments.c); pairs; reference weights.
/// Checks that need the whole model are here, with the line of the element at fault.

#include <assert.h>
#include <stdint.h>
#include <stdlib.h>

#include "builder.h"
#include "driven.h"
#include "math3.h"
#include "step.h"

// what a file names, and what to call too many of them: sizes, names and limits of the model follow
#define NAMED_OBJECTS(X)              \
  X(body, "bodies")                   \
  X(joint, "joints")                  \
  X(geom, "geoms")                    \
  X(site, "sites")                    \
  X(tendon, "tendons")                \
  X(equality, "equality constraints") \
  X(actuator, "actuators")            \
  X(sensor, "sensors")                \
  X(key, "keyframes")

// --- names ---

// what all named objects of a spec start with
typedef struct named {
  const char *name;
  const cav_xml_node *node;
} named;

static int compare_named(const void *a, const void *b) {
  const named *x = a, *y = b;
  int order = strcmp(x->name, y->name);
  if (order) return order;
  return (x->node->line > y->node->line) - (x->node->line < y->node->line);
}

static int in_scene(const cav_spec *spec, const cav_xml_node *node) {
  return spec->scene && !strcmp(node->file, spec->scene->file);
}

static int is_plane(const cav_spec *spec, const cav_xml_node *node) {
  int plane = 0;
  for (int i = 0; i < spec->geom.n; i++)
    plane |= spec->geom.at[i].node == node && spec->geom.at[i].type == CAV_GEOM_PLANE;
  return plane;
}

// two objects of one name: the one that the problem adds is at fault, whose file can be changed; else the later one
static void refuse_twice(cav_spec *spec, const named *first, const named *second) {
  const int swap = in_scene(spec, first->node) && !in_scene(spec, second->node);
  const cav_xml_node *one = (swap ? second : first)->node, *fault = (swap ? first : second)->node;
  const int floors = in_scene(spec, fault) && !in_scene(spec, one) && is_plane(spec, one) && is_plane(spec, fault);
  cav_spec_fail(spec, fault, "name", "'%.60s' is taken already at %.200s:%d; %s", first->name, one->file, one->line,
                floors ? "the model has this floor, so remove the plane of the <scene>" : "choose another");
}

static void check_unique(cav_spec *spec, const void *first, int n, size_t stride) {
  named *sorted = malloc((size_t)(n + 1) * sizeof *sorted);
  if (!sorted) {
    cav_spec_no_memory(spec);
    return;
  }
  for (int i = 0; i < n; i++) memcpy(&sorted[i], (const char *)first + (size_t)i * stride, sizeof *sorted);
  qsort(sorted, (size_t)n, sizeof *sorted, compare_named);
  for (int i = 1; i < n; i++) {
    if (!*sorted[i].name || strcmp(sorted[i].name, sorted[i - 1].name)) continue;
    refuse_twice(spec, &sorted[i - 1], &sorted[i]);
  }
  free(sorted);
}

static void check_names(cav_spec *spec) {
#define UNIQUE(list, ...) check_unique(spec, CAV_BUILDER_TABLE(spec->list));
  NAMED_OBJECTS(UNIQUE)
#undef UNIQUE
  check_unique(spec, CAV_BUILDER_TABLE(spec->mesh));
  check_unique(spec, CAV_BUILDER_TABLE(spec->hfield));
}
// --- one block ---

// position in a block; base NULL: only measures
typedef struct carver {
  char *base;
  size_t used;
} carver;

static void *carve_array(carver *c, int n, size_t size) {
  size_t at = (c->used + 15) & ~(size_t)15;
  assert(n >= 0 && size <= SIZE_MAX / 4 / ((size_t)n + 1));
  c->used = at + (size_t)n * size;
  return c->base ? c->base + at : NULL;
}

static size_t text_bytes(const cav_spec *spec) {
  size_t bytes = strlen(spec->name) + 1;
#define ADD(list, ...) \
  for (int i = 0; i < spec->list.n; i++) bytes += strlen(spec->list.at[i].name) + 1;
  NAMED_OBJECTS(ADD)
#undef ADD
  for (int i = 0; i < spec->warning.n; i++) bytes += strlen(spec->warning.at[i]) + 1;
  return bytes;
}

static void carve_model(cav_builder *b, carver *c) {
  const cav_model *m = b->model;
  size_t text = text_bytes(b->spec);
  cav_model *at = carve_array(c, 1, sizeof *at);
  if (at) *at = *m;
  b->model = at ? at : b->model;
#define TAKE(type, name, count) b->name = carve_array(c, m->count, sizeof *b->name);
  CAV_MODEL_ARRAYS(TAKE)
#undef TAKE
  b->assets = carve_array(c, 1, cav_put_assets(b->spec, NULL, b->model));
  b->keys = carve_array(c, m->nkey, (size_t)(m->nq + m->nv) * sizeof *b->keys);
  b->warning = carve_array(c, m->nwarning, sizeof *b->warning);
  b->text = carve_array(c, 1, text);
  b->text_end = b->text ? b->text + text : NULL;
}

static void publish_arrays(cav_builder *b) {
  cav_model *m = b->model;
  cav_put_assets(b->spec, b->assets, m);
#define PUBLISH(type, name, count) m->name = b->name;
  CAV_MODEL_ARRAYS(PUBLISH)
#undef PUBLISH
  m->warning = (const char *const *)b->warning;
}

char *cav_builder_text(cav_builder *b, const char *text) {
  size_t length = strlen(text) + 1;
  char *at = b->text;
  b->text += length;
  memcpy(at, text, length);
  return at;
}

void cav_builder_finite(cav_spec *spec, const cav_xml_node *node, const double *x, int n) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += fabs(x[i]);
  if (!isfinite(sum)) cav_spec_fail(spec, node, NULL, "numbers are too large: what follows from them is not finite");
}

// --- the whole ---

static void set_options(cav_builder *b) {
  const cav_spec_option *o = &b->spec->option;
  cav_model *m = b->model;
  m->timestep = o->timestep;
  m->fused = b->spec->compiler.fuse;
  copy3(m->gravity, o->gravity);
  m->density = o->density;
  m->viscosity = o->viscosity;
  copy3(m->wind, o->wind);
  copy3(m->magnetic, o->magnetic);
  m->options = (cav_options){.timestep = o->timestep,
                             .order = CAV_ORDER_EULER,
                             .stabilisation = CAV_STABILISATION_SOLREF,
                             .regulariser = CAV_REGULARISER_REFERENCE,
                             .softness = 1e-3,
                             .impratio = o->impratio,
                             .self_stiffness = 1,
                             .refsafe = o->refsafe,
                             .contact = o->contact,
                             .constraint = o->constraint,
                             .gravity = o->weight,
                             .passive = o->spring || o->damper};
}

static void count(cav_builder *b) {
  const cav_spec *spec = b->spec;
  cav_model *m = b->model;
#define COUNT(list, ...) m->n##list = spec->list.n;
  NAMED_OBJECTS(COUNT)
#undef COUNT
  m->nu = m->nactuator;
  m->ntendon_part = spec->part.n;
  m->ntendon_path = spec->path.n;
  const struct {
    int n;
    const char *what;
  } counts[] = {
#define AT_MOST(list, what) {spec->list.n, what},
      NAMED_OBJECTS(AT_MOST)
#undef AT_MOST
          {spec->part.n, "tendon parts"},
      {spec->path.n, "elements of tendon paths"},
      {spec->pair.n, "pairs"},
      {spec->exclude.n, "excludes"}};
  for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
    if (counts[i].n > CAV_SPEC_OBJECTS)
      cav_spec_fail(b->spec, spec->body.at[0].node, NULL, "%d %s; at most %d are read", counts[i].n, counts[i].what,
                    CAV_SPEC_OBJECTS);
  }
}

static void fill(cav_builder *b) {
  b->model->name = cav_builder_text(b, b->spec->name);
  cav_builder_bodies(b);
  cav_builder_attachments(b);
  set_options(b);
  for (int i = 0; i < b->model->npair; i++) b->pair[i] = b->pairs[i];
  for (int i = 0; i < b->model->nwarning; i++) b->warning[i] = cav_builder_text(b, b->spec->warning.at[i]);
}

// numbers that are finite in the file may not be so together
static void check_results(cav_builder *b) {
  cav_spec *spec = b->spec;
  const cav_model *m = b->model;
  for (int i = 0; i < m->nbody; i++) cav_builder_finite(spec, spec->body.at[i].node, m->body[i].inverse_weight, 2);
  for (int i = 0; i < m->nv; i++)
    cav_builder_finite(spec, spec->joint.at[m->dof[i].joint].node, &m->dof[i].inverse_weight, 1);
  for (int i = 0; i < m->ntendon; i++) {
    cav_builder_finite(spec, spec->tendon.at[i].node, &m->tendon[i].inverse_weight, 1);
    cav_builder_finite(spec, spec->tendon.at[i].node, m->tendon[i].springlength, 2);
  }
}

// a time constant that the refsafe guard raises to two time steps
static int is_guarded(const cav_builder *b, const double solref[2]) {
  return solref[0] > 0 && solref[0] < 2 * b->spec->option.timestep;
}

// the refsafe guard acts visibly: one warning for each kind of constraint, naming the first
static void warn_guarded(cav_builder *b) {
  cav_spec *spec = b->spec;
  const double least = 2 * spec->option.timestep;
  const cav_spec_joint *joint = NULL;
  const cav_spec_tendon *tendon = NULL;
  const cav_spec_equality *eq = NULL;
  const cav_pair *pair = NULL;
  if (!spec->option.refsafe || !spec->option.constraint) return;
  for (int i = spec->joint.n - 1; i >= 0; i--) {
    const cav_spec_joint *s = &spec->joint.at[i];
    int rubs = s->frictionloss > 0 && spec->option.frictionloss && is_guarded(b, s->friction.solref);
    int turns = s->type == CAV_JOINT_BALL && spec->option.limit && (s->has_twist || s->has_swing);
    if (rubs || (is_guarded(b, s->limit.solref) && (turns || cav_builder_joint_limits(spec, s)))) joint = s;
  }
  for (int i = spec->tendon.n - 1; i >= 0; i--) {
    const cav_spec_tendon *s = &spec->tendon.at[i];
    int rubs = s->frictionloss > 0 && spec->option.frictionloss && is_guarded(b, s->friction.solref);
    if (rubs || (is_guarded(b, s->limit.solref) && spec->option.limit &&
                 cav_builder_limits(spec, s->node, "limited", "range", s->limited, s->range)))
      tendon = s;
  }
  for (int i = spec->equality.n - 1; i >= 0; i--) {
    if (is_guarded(b, spec->equality.at[i].softness.solref)) eq = &spec->equality.at[i];
  }
  for (int i = b->model->npair - 1; i >= 0; i--) {
    if (is_guarded(b, b->pairs[i].softness.solref)) pair = &b->pairs[i];
  }
  static const char text[] =
      "solref asks for less than two time steps (%s%.60s): raised to %g s here and elsewhere; take a smaller timestep, "
      "or set the flag refsafe to disable";
  if (joint) cav_spec_warn(spec, joint->node, NULL, text, "joint ", joint->name, least);
  if (tendon) cav_spec_warn(spec, tendon->node, NULL, text, "tendon ", tendon->name, least);
  if (eq) cav_spec_warn(spec, eq->node, NULL, text, "equality constraint ", eq->name, least);
  if (pair)
    cav_spec_warn(spec, spec->geom.at[pair->geom2].node, NULL, text, "contacts of ", spec->geom.at[pair->geom2].name,
                  least);
}

// lengths between which muscles work
static void find_strokes(cav_builder *b) {
  int i = cav_length_range_fill(b->model);
  if (i == b->model->nactuator && i > 0) cav_spec_no_memory(b->spec);
  if (i >= 0 && i < b->model->nactuator)
    cav_spec_fail(b->spec, b->spec->actuator.at[i].node, "lengthrange",
                  "is missing, and the joints let this muscle become as long or as short as it likes; give it");
}

// what is left out is known once there is a model: its warning has room before
enum { OVERLAP_TEXT = 300 };

static void reserve_overlaps(cav_spec *spec) {
  if (!spec->load.overlaps) return;
  char blank[OVERLAP_TEXT];
  memset(blank, ' ', sizeof blank);
  blank[sizeof blank - 1] = 0;
  cav_spec_warn(spec, spec->body.at[0].node, NULL, "%s", blank);
}

static void leave_overlaps(cav_builder *b) {
  cav_spec *spec = b->spec;
  if (!spec->load.overlaps) return;
  cav_model *m = b->model;
  char *place = strchr(b->warning[m->nwarning - 1], 0) - (OVERLAP_TEXT - 1);
  int n = cav_overlaps_leave(m, place, OVERLAP_TEXT);
  if (n < 0) cav_spec_no_memory(spec);
  if (n == 0) m->nwarning--;
}

static cav_model *build(cav_builder *b) {
  cav_spec *spec = b->spec;
  count(b);
  if (cav_builder_running(b)) check_names(spec);
  if (cav_builder_running(b)) cav_builder_links(b);
  if (cav_builder_running(b)) cav_spec_tendon_paths(spec);
  if (cav_builder_running(b)) b->model->ntendon_dof = cav_builder_tendon_dofs(b, NULL);
  if (cav_builder_running(b)) b->pairs = cav_filter_pairs(spec, b->weld, b->link_of, &b->model->npair);
  if (cav_builder_running(b)) warn_guarded(b);
  if (cav_builder_running(b)) reserve_overlaps(spec);
  if (!cav_builder_running(b)) return NULL;
  b->model->nwarning = spec->warning.n;
  carver c = {NULL, 0};
  carve_model(b, &c);
  b->model->bytes = c.used;
  c = (carver){calloc(1, c.used), 0};
  if (!c.base) {
    cav_spec_no_memory(spec);
    return NULL;
  }
  carve_model(b, &c);
  assert(c.used == b->model->bytes);
  fill(b);
  publish_arrays(b);
  assert(!cav_builder_running(b) || b->text == b->text_end);
  if (cav_builder_running(b)) {
    cav_status status = cav_links_drive(b->model);
    if (status == CAV_OK) status = cav_pairs_sort(b->model);
    if (status == CAV_OK) status = cav_reference_weights(b->model);
    if (status == CAV_NO_MEMORY)
      cav_spec_no_memory(spec);
    else if (status != CAV_OK)
      cav_spec_fail(spec, spec->body.at[0].node, NULL,
                    "the inertia matrix is singular in the posture of the file; check masses, axes and armature");
    else
      check_results(b);
    if (cav_builder_running(b)) find_strokes(b);
    if (cav_builder_running(b) && !cav_settle_gains(spec, b->model)) cav_spec_no_memory(spec);
    if (cav_builder_running(b)) leave_overlaps(b);
    if (cav_builder_running(b) && cav_pairs_leave(b->model)) cav_spec_no_memory(spec);
  }
  if (cav_builder_running(b)) return b->model;
  free(b->model);
  return NULL;
}

cav_model *cav_compile(cav_spec *spec) {
  cav_model measured = {0};
  cav_builder b = {.spec = spec, .model = &measured};
  cav_model *model = NULL;
  if (spec->status == CAV_OK) cav_spec_assets(spec);
  if (spec->status == CAV_OK) cav_spec_masses(spec);
  b.weld = calloc((size_t)spec->body.n + 1, sizeof *b.weld);
  b.link_of = calloc((size_t)spec->body.n + 1, sizeof *b.link_of);
  if (!b.weld || !b.link_of)
    cav_spec_no_memory(spec);
  else if (spec->status == CAV_OK)
    model = build(&b);
  free(b.weld);
  free(b.link_of);
  free(b.pairs);
  return model;
}
