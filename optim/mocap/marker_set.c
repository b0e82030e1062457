/// Which marker sits where: <markers> files, both ways.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/mocap.h"
#include "file.h"
#include "landmark.h"
#include "marker_set.h"
#include "problem_file.h"

// name, type, least and most values, words, required; unit, what holds where it is left out, meaning
// clang-format off
#define NOTE(unit, fallback, text) &(const cav_xml_note) { unit, fallback, text }
static const char *const landmarks[] = {"first", "middle", "last", "heel", "toe", NULL};
static const cav_xml_attribute attributes[] = {
    {"name", CAV_XML_TEXT, 1, 0, NULL, 1, NOTE("", NULL, "name of the marker in the clip")},
    {"body", CAV_XML_TEXT, 1, 0, NULL, 1, NOTE("", NULL, "body that it sits on: of the model, or a role such as \"right foot\"")},
    {"pos", CAV_XML_REAL, 3, 3, NULL, 0, NOTE("m", "(unknown: estimated)", "position on the body, in its frame")},
    {"at", CAV_XML_WORD, 0, 0, landmarks, 0, NOTE("", "(pos)", "instead of pos, where body is a foot or hand by its role: its limb's first joint (hip, shoulder), middle one (knee, elbow) or last one (ankle, wrist), or the heel or toe of its sole")},
    {"from", CAV_XML_TEXT, 1, 0, NULL, 0, NOTE("", "(the world, scaled as the legs are)", "with retarget: markers, separated by spaces, from whose mean it lies in the recorded direction, as far as on the model; one that names itself is of a group that moves through the world, scaled as the legs are, and keeps the model's size")},
    {"weight", CAV_XML_REAL, 1, 1, NULL, 0, NOTE("", "(1)", "weight of its residual")},
    {0}};
static const cav_xml_element marker = {"marker", 1, 0, attributes, NULL, 0, "a marker and the place that it has on a body"};
static const char *const axes[] = {"x", "y", "z", NULL};
static const char *const paces[] = {"recorded", "similar", NULL};
static const cav_xml_attribute set_attributes[] = {
    {"adjust", CAV_XML_REAL, 1, 1, NULL, 0, NOTE("m", "(0: given positions are exact)", "how far off given positions may be; they are estimated too")},
    {"floor", CAV_XML_BOOL, 0, 0, NULL, 0, NOTE("", "(false)", "feet stand on the plane z = 0 of the clip where a marker of theirs stands still, low")},
    {"scale", CAV_XML_REAL, 1, 1, NULL, 0, NOTE("", "(0: sizes are right)", "how far off sizes of segments may be, as a fraction, against that of the whole body; they are estimated too, by which the model is scaled")},
    {"symmetric", CAV_XML_BOOL, 0, 0, NULL, 0, NOTE("", "(true)", "segments of both sides have one size")},
    {"retarget", CAV_XML_BOOL, 0, 0, NULL, 0, NOTE("", "(false)", "the clip is of a body of another size: it is scaled to the model's, markers on parts that the model does not have are left out; with floor feet that stand are held where they are")},
    {"pace", CAV_XML_WORD, 0, 0, paces, 0, NOTE("", "(recorded)", "with retarget: similar scales times by the square root of what ways in the world are scaled by, so that leaps and swings take as long as gravity has them on a body of that size")},
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
  for (int i = 0; i < set->nmarker && set->marker; i++) free(set->marker[i].name), free(set->marker[i].from);
  free(set->marker);
  free((char *)set->clip.names);
  free(set);
}

// where a marker sits: pos, or a point of the limb that body names by its role
static cav_status read_place(const cav_problem_reader *reader, const cav_xml_node *node, cav_marker *m) {
  m->placed = cav_xml_reals(node, "pos", m->place, 3) == 3;
  if (!m->placed) memcpy(m->place, reader->model->body[m->body].com, sizeof m->place);
  if (!cav_xml_get(node, "at")) return CAV_OK;
  cav_role role = cav_role_named(cav_xml_text(node, "body", ""));
  cav_roles roles;
  if (m->placed) return cav_xml_fail(reader->error, node, "at", "expected pos or at, got both");
  cav_status status = cav_roles_find(reader->model, reader->state, &roles);
  if (status) return cav_problem_no_memory(reader);
  m->placed = role < CAV_ROLE_TYPES && cav_landmark_find(reader->model, reader->state, &roles, role,
                                                         (cav_landmark)cav_xml_word(node, "at", 0), &m->body, m->place);
  if (m->placed) return CAV_OK;
  return cav_xml_fail(reader->error, node, "at",
                      "expected the body to be a foot or a hand by its role ('right foot') whose limb has that point, "
                      "got '%.100s'; give pos instead",
                      cav_xml_text(node, "body", ""));
}

// whether a set that is scaled to the model leaves a marker out: it is on a part that the model does not have
static int is_left_out(const cav_problem_reader *reader, const cav_xml_node *node) {
  cav_role role = cav_role_named(cav_xml_text(node, "body", ""));
  cav_roles roles;
  return role < CAV_ROLE_TYPES && !cav_roles_find(reader->model, reader->state, &roles) && roles.body[role] < 0;
}

static cav_status read_marker(const cav_problem_reader *reader, const cav_xml_node *node, cav_marker_set *set) {
  cav_marker *m = &set->marker[set->nmarker];
  const char *name = cav_xml_text(node, "name", ""), *from = cav_xml_text(node, "from", NULL);
  cav_object_type type = CAV_OBJECT_XBODY;
  if (from && !set->retarget)
    return cav_xml_fail(reader->error, node, "from", "expected retarget=\"true\" of <markers>, which scales the clip");
  if (set->retarget && is_left_out(reader, node)) {
    set->left_out++;
    return CAV_OK;
  }
  int object = cav_problem_find_frame(reader, node, "body", &type);
  if (object < 0) return reader->error ? reader->error->status : CAV_BAD_INPUT;
  *m = (cav_marker){.body = type == CAV_OBJECT_GEOM ? reader->model->geom[object].body : object, .weight = 1};
  for (int i = 0; i < set->nmarker; i++)
    if (!strcmp(set->marker[i].name, name))
      return cav_xml_fail(reader->error, node, "name", "expected one marker of that name, '%.100s' is there twice",
                          name);
  cav_status status = cav_problem_real(reader, node, "weight", 0, DBL_MAX, &m->weight);
  if (!status) status = read_place(reader, node, m);
  if (!status && set->retarget && !m->placed)
    status = cav_xml_fail(reader->error, node, NULL,
                          "expected pos or at: places are not estimated while the clip is "
                          "scaled");
  if (status) return status;
  m->name = strdup(name), m->from = from ? strdup(from) : NULL;
  set->nmarker++;
  return m->name && (m->from || !from) ? CAV_OK : cav_problem_no_memory(reader);
}

static cav_status read_set(const cav_problem_reader *reader, const cav_xml_node *root, cav_marker_set *set) {
  const char *names = cav_xml_text(root, "names", NULL);
  cav_status status = cav_problem_real(reader, root, "adjust", 0, DBL_MAX, &set->adjust);
  if (!status) status = cav_problem_real(reader, root, "unit", DBL_MIN, DBL_MAX, &set->clip.unit);
  if (!status) status = cav_problem_real(reader, root, "rate", DBL_MIN, DBL_MAX, &set->clip.rate);
  if (!status) status = cav_problem_real(reader, root, "scale", 0, DBL_MAX, &set->scale);
  set->floor = cav_xml_bool(root, "floor", 0);
  set->symmetric = cav_xml_bool(root, "symmetric", 1);
  set->retarget = cav_xml_bool(root, "retarget", 0);
  if (!status && set->retarget && (set->adjust > 0 || set->scale > 0))
    status = cav_xml_fail(reader->error, root, set->adjust > 0 ? "adjust" : "scale",
                          "expected none with retarget=\"true\": either the clip is "
                          "scaled to the model, or places and sizes are fitted to the clip");
  set->similar = cav_xml_word(root, "pace", 0) == 1;
  if (!status && cav_xml_get(root, "pace") && !set->retarget)
    status = cav_xml_fail(reader->error, root, "pace", "expected retarget=\"true\", which scales the clip");
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
  if (set->retarget) fputs(" retarget=\"true\"", out);
  if (set->similar) fputs(" pace=\"similar\"", out);
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
    if (m->from) {
      fputs(" from=\"", file.stream);
      cav_file_write_xml(file.stream, m->from);
      fputc('"', file.stream);
    }
    if (m->weight != 1) fprintf(file.stream, " weight=\"%.17g\"", m->weight);
    fputs("/>\n", file.stream);
  }
  fputs("</markers>\n", file.stream);
  return cav_file_end(&file, error);
}
