/// Clips as key frames of an MJCF file: places of its mocap bodies, a key each. The bodies' names stand in that
/// file, or in a list.
#include <stdlib.h>
#include <string.h>

#include "clip.h"
#include "xml.h"

static const cav_xml_attribute key_attributes[] = {{"name", CAV_XML_TEXT, 0, 0, NULL, 0, NULL},
                                                   {"time", CAV_XML_REAL, 1, 1, NULL, 0, NULL},
                                                   {"mpos", CAV_XML_REAL, 1, 0, NULL, 0, NULL},
                                                   {0}};
static const cav_xml_attribute body_attributes[] = {
    {"name", CAV_XML_TEXT, 0, 0, NULL, 0, NULL}, {"mocap", CAV_XML_BOOL, 0, 0, NULL, 0, NULL}, {0}};
static const cav_xml_element key = {"key", 0, 0, key_attributes, NULL, CAV_XML_OPEN, NULL};
static const cav_xml_element keyframe = {"keyframe",   0,   0, NULL, (const cav_xml_element *const[]){&key, NULL},
                                         CAV_XML_OPEN, NULL};
static const cav_xml_element body = {"body", 0, 0, body_attributes, NULL, CAV_XML_OPEN, NULL};
static const cav_xml_element world = {"worldbody",  0,   0, NULL, (const cav_xml_element *const[]){&body, NULL},
                                      CAV_XML_OPEN, NULL};
static const cav_xml_element root = {
    "mujoco", 0, 0, NULL, (const cav_xml_element *const[]){&keyframe, &world, NULL}, CAV_XML_OPEN | CAV_XML_PROSE,
    NULL};

// mocap bodies of the world, which are nowhere else; names NULL: counted alone
static int mocap_bodies(const cav_xml_node *top, char **name) {
  int n = 0;
  for (const cav_xml_node *w = cav_xml_child(top, &world); w; w = cav_xml_next(w))
    for (const cav_xml_node *b = cav_xml_child(w, &body); b; b = cav_xml_next(b)) {
      if (!cav_xml_bool(b, "mocap", 0)) continue;
      if (name && !(name[n] = strdup(cav_xml_text(b, "name", "")))) return -1;
      n++;
    }
  return n;
}

// frames of all keys; without times at the rate
static cav_status read_keys(cav_clip_text *text, const cav_xml_node *top, double rate, cav_clip *clip) {
  int n = clip->record->nmarker, t = 0;
  for (const cav_xml_node *f = cav_xml_child(top, &keyframe); f; f = cav_xml_next(f))
    for (const cav_xml_node *k = cav_xml_child(f, &key); k; k = cav_xml_next(k), t++) {
      const cav_xml_value *value = cav_xml_get(k, "mpos");
      if (!value || value->count != 3 * n)
        return cav_xml_fail(text->error, k, "mpos", "expected %d numbers, three for each of %d mocap bodies, got %d",
                            3 * n, n, value ? value->count : 0);
      double *frame = cav_clip_frame(clip, cav_xml_real(k, "time", t / rate));
      if (!frame) return cav_clip_no_memory(text);
      memcpy(frame, value->number, 3 * (size_t)n * sizeof *frame);
    }
  return t ? CAV_OK : cav_clip_fail(text, "expected key frames with mpos, <keyframe> <key mpos=...>, found none");
}

// the words of a list, by blanks; names NULL: counted alone
static int listed(const char *list, char **name) {
  int n = 0;
  for (const char *c = list + strspn(list, " "); *c; c += strspn(c, " "), n++) {
    size_t length = strcspn(c, " ");
    if (name && !(name[n] = strndup(c, length))) return -1;
    c += length;
  }
  return n;
}

cav_status cav_clip_keys(cav_clip_text *text, const cav_record_options *options, cav_clip *clip, double *unit) {
  static const cav_xml_element *const roots[] = {&root, NULL};
  cav_error error = {0};
  *unit = 1;
  cav_xml *xml = cav_xml_read(text->path, roots, NULL, &error);
  if (!xml) {
    if (text->error) *text->error = error;
    return error.status;
  }
  const cav_xml_node *top = cav_xml_root(xml);
  int n = options->names ? listed(options->names, NULL) : mocap_bodies(top, NULL);
  cav_status status = CAV_OK;
  if (n == 0)
    status =
        cav_clip_fail(text,
                      "expected the mocap bodies that the key frames place, there are none; list their names in order: "
                      "names= of the marker set");
  if (!status && !cav_clip_new(clip, n)) status = cav_clip_no_memory(text);
  if (!status &&
      (options->names ? listed(options->names, clip->record->name) : mocap_bodies(top, clip->record->name)) < 0)
    status = cav_clip_no_memory(text);
  if (!status) status = read_keys(text, top, options->rate > 0 ? options->rate : 30, clip);
  int timed = !status && cav_xml_get(cav_xml_child(cav_xml_child(top, &keyframe), &key), "time");
  if (!status && !timed && !(options->rate > 0)) clip->record->assumed |= CAV_ASSUMED_RATE;
  cav_xml_free(xml);
  return status;
}
