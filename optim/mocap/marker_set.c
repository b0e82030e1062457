/// Which marker sits where: <markers> files, both ways.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/mocap.h"
#include "file.h"
#include "marker_set.h"
#include "problem_file.h"

// name, type, least and most values, words, required; unit, what holds where it is left out, meaning
// clang-format off
#define NOTE(unit, fallback, text) &(const cav_xml_note) { unit, fallback, text }
static const cav_xml_attribute attributes[] = {
    {"name", CAV_XML_TEXT, 1, 0, NULL, 1, NOTE("", NULL, "name of the marker in the clip")},
    {"body", CAV_XML_TEXT, 1, 0, NULL, 1, NOTE("", NULL, "body that it sits on: of the model, or a role such as \"right foot\"")},
    {"pos", CAV_XML_REAL, 3, 3, NULL, 0, NOTE("m", "(unknown: estimated)", "position on the body, in its frame")},
    {"weight", CAV_XML_REAL, 1, 1, NULL, 0, NOTE("", "(1)", "weight of its residual")},
    {0}};
static const cav_xml_element marker = {"marker", 1, 0, attributes, NULL, 0, "a marker and the place that it has on a body"};
static const char *const axes[] = {"x", "y", "z", NULL};
static const cav_xml_attribute set_attributes[] = {
    {"adjust", CAV_XML_REAL, 1, 1, NULL, 0, NOTE("m", "(0: given positions are exact)", "how far off given positions may be; they are estimated too")},
    {"floor", CAV_XML_BOOL, 0, 0, NULL, 0, NOTE("", "(false)", "feet stand on the plane z = 0 of the clip where a marker of theirs stands still, low")},
    {"scale", CAV_XML_REAL, 1, 1, NULL, 0, NOTE("", "(0: sizes are right)", "how far off sizes of segments may be, as a fraction, against that of the whole body; they are estimated too, by which the model is scaled")},
    {"symmetric", CAV_XML_BOOL, 0, 0, NULL, 0, NOTE("", "(true)", "segments of both sides have one size")},
    {"unit", CAV_XML_REAL, 1, 1, NULL, 0, NOTE("m", "(as the clip says, or as its format has it)", "unit of length of the clip")},
    {"up", CAV_XML_WORD, 0, 0, axes, 0, NOTE("", "(as the format of the clip has it)", "axis of the clip that points up")},
    {"rate", CAV_XML_REAL, 1, 1, NULL, 0, NOTE("1/s", "(as the clip says)", "frames a second")},
    {"names", CAV_XML_TEXT, 1, 0, NULL, 0, NOTE("", "(those of the clip)", "names of the markers of keyframes without bodies, separated by spaces")},
    {0}};
const cav_xml_element cav_markers_element = {
    "markers", 1, 1, set_attributes, (const cav_xml_element *const[]){&marker, NULL}, 0,
    "root of a marker set (cavort ik --markers): which marker sits where"};
// clang-format on

void cav_marker_set_free(cav_marker_set *set) {
  if (!set) return;
  for (int i = 0; i < set->nmarker && set->marker; i++) free(set->marker[i].name);
  free(set->marker);
  free((char *)set->clip.names);
  free(set);
}

static cav_status read_marker(const cav_problem_reader *reader, const cav_xml_node *node, cav_marker_set *set) {
  cav_marker *m = &set->marker[set->nmarker];
  const char *name = cav_xml_text(node, "name", "");
  cav_object_type type = CAV_OBJECT_XBODY;
  int object = cav_problem_find_frame(reader, node, "body", &type);
  if (object < 0) return reader->error ? reader->error->status : CAV_BAD_INPUT;
  *m = (cav_marker){.body = type == CAV_OBJECT_GEOM ? reader->model->geom[object].body : object, .weight = 1};
  for (int i = 0; i < set->nmarker; i++)
    if (!strcmp(set->marker[i].name, name))
      return cav_xml_fail(reader->error, node, "name", "expected one marker of that name, '%.100s' is there twice",
                          name);
  cav_status status = cav_problem_real(reader, node, "weight", 0, DBL_MAX, &m->weight);
  if (status) return status;
  m->placed = cav_xml_reals(node, "pos", m->place, 3) == 3;
  if (!m->placed) memcpy(m->place, reader->model->body[m->body].com, sizeof m->place);
  if (!(m->name = strdup(name))) return cav_problem_no_memory(reader);
  set->nmarker++;
  return CAV_OK;
}

static cav_status read_set(const cav_problem_reader *reader, const cav_xml_node *root, cav_marker_set *set) {
  const char *names = cav_xml_text(root, "names", NULL);
  cav_status status = cav_problem_real(reader, root, "adjust", 0, DBL_MAX, &set->adjust);
  if (!status) status = cav_problem_real(reader, root, "unit", DBL_MIN, DBL_MAX, &set->clip.unit);
  if (!status) status = cav_problem_real(reader, root, "rate", DBL_MIN, DBL_MAX, &set->clip.rate);
  if (!status) status = cav_problem_real(reader, root, "scale", 0, DBL_MAX, &set->scale);
  set->floor = cav_xml_bool(root, "floor", 0);
  set->symmetric = cav_xml_bool(root, "symmetric", 1);
  if (cav_xml_get(root, "up")) set->clip.up = axes[cav_xml_word(root, "up", 2)][0];
  if (!status && names && !(set->clip.names = strdup(names))) status = cav_problem_no_memory(reader);
  for (const cav_xml_node *c = root->child; c && !status; c = c->next) status = read_marker(reader, c, set);
  return status;
}

cav_marker_set *cav_marker_set_read(const char *path, const cav_model *model, cav_error *error) {
  static const cav_xml_element *const roots[] = {&cav_markers_element, NULL};
  cav_error own = {0};
  cav_problem_reader reader = {.model = model, .path = path, .error = error ? error : &own};
  cav_xml *xml = cav_xml_read(path, roots, NULL, reader.error);
  if (!xml) return NULL;
  const cav_xml_node *root = cav_xml_root(xml);
  int n = 0;
  for (const cav_xml_node *c = root->child; c; c = c->next) n++;
  cav_marker_set *set = calloc(1, sizeof *set);
  if (set) set->marker = calloc((size_t)n + 1, sizeof *set->marker);
  reader.state = cav_state_new(model);
  cav_status status = set && set->marker && reader.state ? CAV_OK : cav_problem_no_memory(&reader);
  if (!status) status = read_set(&reader, root, set);
  cav_state_free(reader.state);
  cav_xml_free(xml);
  if (!status) return set;
  cav_marker_set_free(set);
  return NULL;
}

// what clips leave out
static void write_head(FILE *out, const cav_marker_set *set) {
  fputs("<markers", out);
  if (set->floor) fputs(" floor=\"true\"", out);
  if (set->clip.unit > 0) fprintf(out, " unit=\"%.17g\"", set->clip.unit);
  if (set->clip.up) fprintf(out, " up=\"%c\"", set->clip.up);
  if (set->clip.rate > 0) fprintf(out, " rate=\"%.17g\"", set->clip.rate);
  if (set->clip.names) {
    fputs(" names=\"", out);
    cav_file_write_xml(out, set->clip.names);
    fputc('"', out);
  }
  fputs(">\n", out);
}

cav_status cav_marker_set_write(const char *path, const cav_model *model, const cav_marker_set *set, cav_error *error) {
  cav_file file;
  for (int i = 0; i < set->nmarker; i++)
    if (!*model->body[set->marker[i].body].name)
      return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: the body of marker '%s' has no name to be written", path,
                           set->marker[i].name);
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  write_head(file.stream, set);
  for (int i = 0; i < set->nmarker; i++) {
    const cav_marker *m = &set->marker[i];
    fputs("  <marker name=\"", file.stream);
    cav_file_write_xml(file.stream, m->name);
    fputs("\" body=\"", file.stream);
    cav_file_write_xml(file.stream, model->body[m->body].name);
    fprintf(file.stream, "\" pos=\"%.17g %.17g %.17g\"", m->place[0], m->place[1], m->place[2]);
    if (m->weight != 1) fprintf(file.stream, " weight=\"%.17g\"", m->weight);
    fputs("/>\n", file.stream);
  }
  fputs("</markers>\n", file.stream);
  return cav_file_end(&file, error);
}
