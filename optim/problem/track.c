/// <track>: a record that a motion is compared with, from a clip of markers, a CSV table or frames in the problem file.
///
/// Channels are the markers of a set, joints and sensors by name, each with its columns and the noise that they have. The
/// record's columns that nothing asks for are counted. What reads positions, velocities, and accelerations or forces is
/// compared at different times (recording.c), so one element makes up to three terms.
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/mocap.h"
#include "csv.h"
#include "file.h"
#include "objects.h"
#include "problem_file.h"
#include "quantity.h"
#include "xml.h"

static const double usual_length = 0.01, usual_angle = 0.05; // m, rad: noise where none is given
enum { MOST_COLUMNS = CAV_SENSOR_DIM_MAX };

// a record as columns by name
typedef struct source {
  const char *label; // path, or what stands for it
  int nframe, ncolumn;
  double *time, *value; // [nframe], [nframe*ncolumn], NaN: not recorded
  char **name;          // [ncolumn]
  char *asked;          // [ncolumn] 1: a channel has it
} source;

// one <track> in the making
typedef struct maker {
  const cav_problem_reader *reader;
  const cav_xml_node *node;
  source in;
  int n, room;
  cav_channel *channel;
  int (*pick)[MOST_COLUMNS]; // columns of each channel
  int absent;                // markers of the set that the record does not have
} maker;

static void free_source(source *in) {
  for (int i = 0; i < in->ncolumn && in->name; i++) free(in->name[i]);
  free(in->name), free(in->time), free(in->value), free(in->asked);
}

static cav_status make_source(const cav_problem_reader *reader, source *in, int nframe, int ncolumn) {
  in->nframe = nframe, in->ncolumn = ncolumn;
  in->time = calloc((size_t)nframe + 1, sizeof *in->time);
  in->value = calloc((size_t)nframe * (size_t)ncolumn + 1, sizeof *in->value);
  in->name = calloc((size_t)ncolumn + 1, sizeof *in->name);
  in->asked = calloc((size_t)ncolumn + 1, 1);
  return in->time && in->value && in->name && in->asked ? CAV_OK : cav_problem_no_memory(reader);
}

// ---------------------------------------------------------------- the record

// a clip: three columns a marker
static cav_status take_clip(const maker *made, source *in, const char *path, const cav_marker_set *set) {
  cav_error inner = {0};
  cav_record *record = cav_record_read(path, set ? &set->clip : NULL, &inner);
  if (!record) return cav_xml_fail_as(made->reader->error, inner.status, made->node, "file", "%s", inner.text);
  int n = 3 * record->nmarker;
  cav_status status = make_source(made->reader, in, record->nframe, n);
  if (!status) memcpy(in->time, record->time, (size_t)record->nframe * sizeof *in->time);
  if (!status) memcpy(in->value, record->position, (size_t)record->nframe * (size_t)n * sizeof *in->value);
  for (int i = 0; i < n && !status; i++) {
    const char *name = record->name[i / 3];
    if (!(in->name[i] = malloc(strlen(name) + 3)))
      status = cav_problem_no_memory(made->reader);
    else
      sprintf(in->name[i], "%s_%c", name, "xyz"[i % 3]);
  }
  cav_record_free(record);
  return status;
}

// a table: all columns but time
static cav_status take_table(const maker *made, source *in, const char *path) {
  cav_error inner = {0};
  cav_table *table = cav_table_read_gaps(path, &inner);
  if (!table) return cav_xml_fail_as(made->reader->error, inner.status, made->node, "file", "%s", inner.text);
  int time = 0, n = table->ncol - 1;
  while (time < table->ncol && strcmp(table->name[time], "time")) time++;
  cav_status status = CAV_OK;
  if (time == table->ncol)
    status = cav_xml_fail(made->reader->error, made->node, "file", "%s:1: expected a column 'time', s", path);
  if (!status) status = make_source(made->reader, in, table->nrow, n);
  for (int i = 0, c = 0; c < table->ncol && !status; c++) {
    if (c == time) continue;
    if (!(in->name[i++] = strdup(table->name[c]))) status = cav_problem_no_memory(made->reader);
  }
  for (int f = 0; f < table->nrow && !status; f++) {
    const double *row = table->value + (size_t)f * (size_t)table->ncol;
    in->time[f] = row[time];
    for (int i = 0, c = 0; c < table->ncol; c++)
      if (c != time) in->value[(size_t)f * (size_t)n + (size_t)i++] = row[c];
  }
  for (int f = 0; f < table->nrow && !status; f++)
    if (isnan(in->time[f]) || (f && !(in->time[f] > in->time[f - 1])))
      status = cav_xml_fail(made->reader->error, made->node, "file", "%s:%d: expected a time after the one before",
                            path, table->line[f]);
  cav_table_free(table);
  return status;
}

static int frames_of(const cav_xml_node *node) {
  int n = 0;
  for (const cav_xml_node *c = cav_problem_child(node, "frame"); c; c = cav_xml_next(c)) n++;
  return n;
}

// frames written in the problem file, columns in the order of the channels
static cav_status take_frames(const maker *made, source *in) {
  cav_error *error = made->reader->error;
  const cav_xml_node *frame = cav_problem_child(made->node, "frame");
  int n = cav_xml_get(frame, "value")->count;
  cav_status status = make_source(made->reader, in, frames_of(made->node), n);
  for (int i = 0; i < n && !status; i++)
    if (!(in->name[i] = strdup("value"))) status = cav_problem_no_memory(made->reader);
  for (int f = 0; frame && !status; f++, frame = cav_xml_next(frame)) {
    const cav_xml_value *given = cav_xml_get(frame, "value"), *gap = cav_xml_get(frame, "unseen");
    double *row = in->value + (size_t)f * (size_t)n;
    in->time[f] = cav_xml_real(frame, "time", 0);
    if (f && !(in->time[f] > in->time[f - 1]))
      return cav_xml_fail(error, frame, "time", "expected a time after the one before, %g s", in->time[f - 1]);
    if (given->count != n)
      return cav_xml_fail(error, frame, "value", "expected %d numbers as in the first frame, got %d", n, given->count);
    memcpy(row, given->number, (size_t)n * sizeof *row);
    for (int k = 0; gap && k < gap->count; k++) {
      if (gap->number[k] < 0 || gap->number[k] >= n)
        return cav_xml_fail(error, frame, "unseen", "expected columns from 0 to %d, got %g", n - 1, gap->number[k]);
      row[(int)gap->number[k]] = NAN;
    }
  }
  return status;
}

// whether the element asks for columns of a table that are no markers
static int mixes(const cav_xml_node *node) {
  return cav_xml_get(node, "joints") || cav_xml_get(node, "sensors") || cav_problem_child(node, "joint") ||
         cav_problem_child(node, "sensor");
}

static cav_status take_record(maker *made, const cav_marker_set *set) {
  cav_error *error = made->reader->error;
  int frames = frames_of(made->node);
  const char *text = cav_xml_text(made->node, "file", NULL);
  if (text && frames) return cav_xml_fail(error, made->node, "file", "contradicts <frame>; remove one of the two");
  if (!text && !frames) return cav_xml_fail(error, made->node, "file", "is missing: the record, a clip or a table");
  if (!text) {
    made->in.label = "<frame>";
    return take_frames(made, &made->in);
  }
  char *path = cav_file_beside(made->reader->path, text);
  if (!path) return cav_problem_no_memory(made->reader);
  const char *dot = strrchr(path, '.');
  int table = dot && !strcmp(dot, ".csv") && (mixes(made->node) || !set);
  cav_status status;
  made->in.label = text;
  if (table && set && (set->clip.up || set->clip.unit > 0))
    status = cav_xml_fail(error, made->node, "markers",
                          "says unit or up of a clip; a table of several kinds is in m, z up: remove them there");
  else if (table)
    status = take_table(made, &made->in, path);
  else
    status = take_clip(made, &made->in, path, set);
  free(path);
  if (!status && made->in.nframe < 2)
    status = cav_xml_fail(error, made->node, "file", "%s: expected two frames at least", text);
  return status;
}

// ---------------------------------------------------------------- columns

static int column_named(const source *in, const char *name) {
  for (int i = 0; i < in->ncolumn; i++)
    if (!strcmp(in->name[i], name)) return i;
  return -1;
}

// n columns PREFIXNAME_SUFFIX, by numbers from first or by the letters of axes; 1: all are there
static int columns_named(const source *in, const char *prefix, const char *name, const char *letters, int first, int n,
                         int *pick) {
  char full[400];
  for (int k = 0; k < n; k++) {
    if (n == 1 && first == 0)
      snprintf(full, sizeof full, "%s%.300s", prefix, name);
    else if (letters)
      snprintf(full, sizeof full, "%s%.300s_%c", prefix, name, letters[k]);
    else
      snprintf(full, sizeof full, "%s%.300s_%d", prefix, name, first + k);
    if ((pick[k] = column_named(in, full)) < 0) return 0;
  }
  return 1;
}

// the columns of a channel that says none: by its name, as trajectory.csv or a clip has it
static int usual_columns(const maker *made, const cav_channel *channel, int *pick) {
  const source *in = &made->in;
  int n = channel->ncolumn, joint = channel->kind != CAV_CHANNEL_MARKER && channel->kind != CAV_CHANNEL_SENSOR;
  const cav_model *m = made->reader->model;
  int behind = channel->kind == CAV_CHANNEL_ROTATION && m->joint[channel->object].type == CAV_JOINT_FREE ? 3 : 0;
  const char *letters = n == 4 ? "wxyz" : "xyz";
  if (joint)
    return columns_named(in, "qpos_", channel->name, NULL, behind, n, pick) ||
           columns_named(in, "", channel->name, NULL, behind, n, pick);
  if (n <= 1) return columns_named(in, "", channel->name, NULL, 0, 1, pick);
  return (n >= 3 && columns_named(in, "", channel->name, letters, 0, n, pick)) ||
         columns_named(in, "", channel->name, NULL, 0, n, pick);
}

// the columns that attribute 'columns' names, from the first on
static cav_status given_columns(const maker *made, const cav_xml_node *node, int first, int n, int all, int *pick) {
  char *copy = strdup(cav_xml_text(node, "columns", "")), *rest = copy, *name;
  int k = 0;
  cav_status status = copy ? CAV_OK : cav_problem_no_memory(made->reader);
  for (; !status && (name = strsep(&rest, "|")); k++) {
    name += strspn(name, " ");
    for (size_t end = strlen(name); end && name[end - 1] == ' '; end--) name[end - 1] = 0;
    int column = column_named(&made->in, name);
    const char *near = cav_xml_nearest(name, made->in.name, made->in.ncolumn, sizeof *made->in.name);
    if (column < 0)
      status = cav_xml_fail(made->reader->error, node, "columns", "%s has no column '%.80s'%s%.80s%s", made->in.label,
                            name, near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
    if (k >= first && k < first + n) pick[k - first] = column;
  }
  if (!status && k != all)
    status = cav_xml_fail(made->reader->error, node, "columns", "expected %d columns, got %d", all, k);
  free(copy);
  return status;
}

// an error of a name without columns
static cav_status no_columns(const maker *made, const cav_xml_node *node, const char *attribute,
                             const cav_channel *channel) {
  static const char *const kind[] = {"marker", "joint", "joint", "joint", "sensor"};
  const char *near = cav_xml_nearest(channel->name, made->in.name, made->in.ncolumn, sizeof *made->in.name);
  return cav_xml_fail(made->reader->error, node, attribute, "%s has no column%s of %s '%.80s'%s%.80s%s", made->in.label,
                      channel->ncolumn > 1 ? "s" : "", kind[channel->kind], channel->name,
                      near ? "; did you mean column '" : "", near ? near : "",
                      near ? "'?"
                           : "; a joint 'knee' has column knee or qpos_knee, a marker or sensor of three values "
                             "NAME_x, NAME_y, NAME_z");
}

// ---------------------------------------------------------------- channels

// noise of a channel where nothing says it: of lengths, of angles; 0: has to be given
static int length_or_angle(const cav_model *m, const cav_channel *channel) {
  switch (channel->kind) {
    case CAV_CHANNEL_MARKER:
    case CAV_CHANNEL_TRANSLATION:
      return 1;
    case CAV_CHANNEL_ROTATION:
      return 2;
    case CAV_CHANNEL_COORDINATE:
      return m->joint[channel->object].type == CAV_JOINT_SLIDE ? 1 : 2;
    case CAV_CHANNEL_SENSOR:
      if (channel->sensor.dim == 4) return 2;
      if (channel->sensor.type == CAV_SENSOR_JOINTPOS)
        return m->joint[channel->sensor.object].type == CAV_JOINT_SLIDE ? 1 : 2;
      return channel->sensor.type == CAV_SENSOR_FRAMEPOS || channel->sensor.type == CAV_SENSOR_SUBTREECOM;
    case CAV_CHANNEL_KINDS:
      break;
  }
  return 0;
}

// numbers of attribute sd: one of all, or of lengths and of angles
static cav_status noise_of(const maker *made, const cav_xml_node *node, int *n, double sd[2]) {
  *n = cav_xml_reals(node, "sd", sd, 2);
  for (int i = 0; i < *n; i++)
    if (!(sd[i] > 0)) return cav_xml_fail(made->reader->error, node, "sd", "expected a number above 0, got %g", sd[i]);
  return CAV_OK;
}

// noise of a channel by its own element, else by the track's, else the usual one
static cav_status set_noise(const maker *made, const cav_xml_node *own, double weight, cav_channel *channel) {
  double sd[2] = {0};
  int kind = length_or_angle(made->reader->model, channel), n = 0;
  const cav_xml_node *at = own && cav_xml_get(own, "sd") ? own : made->node;
  cav_status status = noise_of(made, at, &n, sd);
  if (status) return status;
  if (n == 1)
    channel->sd = sd[0];
  else if (kind)
    channel->sd = n == 2 ? sd[kind - 1] : kind == 1 ? usual_length : usual_angle;
  else
    return cav_xml_fail(made->reader->error, at, "sd", "is missing: the noise of sensor '%.80s', in its unit",
                        channel->name);
  channel->sd /= sqrt(weight);
  return CAV_OK;
}

static const cav_xml_node *own_element(const maker *made, const char *kind, const char *name) {
  const cav_xml_node *c = cav_problem_child(made->node, kind);
  while (c && strcmp(cav_xml_text(c, "name", ""), name)) c = cav_xml_next(c);
  return c;
}

// one more channel with its columns; missing 1: passed over where the record has none of it, and told
static cav_status add_channel(maker *made, cav_channel channel, const cav_xml_node *own, const char *attribute,
                              double weight, int *missing) {
  int pick[MOST_COLUMNS] = {0}, first = 0, all = channel.ncolumn;
  cav_status status = CAV_OK;
  if (channel.kind == CAV_CHANNEL_TRANSLATION || channel.kind == CAV_CHANNEL_ROTATION) {
    int free = made->reader->model->joint[channel.object].type == CAV_JOINT_FREE;
    first = free && channel.kind == CAV_CHANNEL_ROTATION ? 3 : 0;
    all = free ? 7 : 4;
  }
  if (!strcmp(made->in.label, "<frame>")) {
    int at = made->n ? made->channel[made->n - 1].column + made->channel[made->n - 1].ncolumn : 0;
    if (at + channel.ncolumn > made->in.ncolumn)
      return cav_xml_fail(made->reader->error, made->node, NULL, "frames have %d numbers, fewer than channels take",
                          made->in.ncolumn);
    for (int k = 0; k < channel.ncolumn; k++) pick[k] = at + k;
    channel.column = at;
  } else if (own && cav_xml_accepts(own, "columns") && cav_xml_get(own, "columns")) {
    status = given_columns(made, own, first, channel.ncolumn, all, pick);
  } else if (!usual_columns(made, &channel, pick)) {
    if (missing) {
      ++*missing;
      return CAV_OK;
    }
    return no_columns(made, own ? own : made->node, attribute, &channel);
  }
  if (!status) status = set_noise(made, own, weight, &channel);
  if (status) return status;
  if (made->n == made->room) {
    int room = made->room ? 2 * made->room : 16;
    cav_channel *more = realloc(made->channel, (size_t)room * sizeof *more);
    if (more) made->channel = more;
    void *picks = realloc(made->pick, (size_t)room * sizeof *made->pick);
    if (picks) made->pick = picks;
    if (!more || !picks) return cav_problem_no_memory(made->reader);
    made->room = room;
  }
  for (int k = 0; k < channel.ncolumn; k++) made->in.asked[pick[k]] = 1;
  if (!(channel.name = cav_problem_text(made->reader->owner, channel.name))) return cav_problem_no_memory(made->reader);
  memcpy(made->pick[made->n], pick, sizeof pick);
  made->channel[made->n++] = channel;
  return CAV_OK;
}

static int has_channel(const maker *made, cav_channel_kind kind, const char *name) {
  for (int i = 0; i < made->n; i++)
    if (made->channel[i].kind == kind && !strcmp(made->channel[i].name, name)) return 1;
  return 0;
}

static cav_status set_markers(maker *made, const cav_marker_set *set) {
  cav_status status = CAV_OK;
  int absent = 0;
  for (int i = 0; set && i < set->nmarker && !status; i++) {
    const cav_marker *marker = &set->marker[i];
    const cav_xml_node *own = own_element(made, "marker", marker->name);
    if (!(marker->weight > 0) || (own && cav_xml_get(own, "body"))) continue;
    cav_channel channel = {.name = marker->name, .kind = CAV_CHANNEL_MARKER, .object = marker->body, .component = -1};
    memcpy(channel.place, marker->place, sizeof channel.place);
    channel.ncolumn = 3;
    status = add_channel(made, channel, own, "name", marker->weight, own ? NULL : &absent);
  }
  made->absent = absent;
  return status;
}

// <marker>s with a body of their own; others say the noise of one of the set
static cav_status own_markers(maker *made, const cav_marker_set *set) {
  cav_status status = CAV_OK;
  const cav_problem_reader *reader = made->reader;
  for (const cav_xml_node *c = cav_problem_child(made->node, "marker"); c && !status; c = cav_xml_next(c)) {
    cav_channel channel = {.name = cav_xml_text(c, "name", ""), .kind = CAV_CHANNEL_MARKER, .component = -1};
    cav_object_type type = CAV_OBJECT_XBODY;
    if (!cav_xml_get(c, "body")) {
      if (has_channel(made, CAV_CHANNEL_MARKER, channel.name)) continue;
      const char *near = set && set->nmarker
                             ? cav_xml_nearest(channel.name, &set->marker->name, set->nmarker, sizeof *set->marker)
                             : NULL;
      return cav_xml_fail(reader->error, c, "name", "%s has no marker '%.80s'%s%.80s%s",
                          set ? "the marker set" : "without a marker set this file", channel.name,
                          near ? "; did you mean '" : "; give its body", near ? near : "", near ? "'?" : "");
    }
    int object = cav_problem_find_frame(reader, c, "body", &type);
    if (object < 0) return CAV_BAD_INPUT;
    channel.object = type == CAV_OBJECT_GEOM ? reader->model->geom[object].body : object;
    if (cav_xml_reals(c, "pos", channel.place, 3) != 3)
      return cav_xml_fail(reader->error, c, "pos", "is missing: where on the body the marker sits");
    channel.ncolumn = 3;
    status = add_channel(made, channel, c, "name", 1, NULL);
  }
  return status;
}

// one or two channels of a joint
static cav_status add_joint(maker *made, int j, const cav_xml_node *own, const char *attribute, int *missing) {
  const cav_joint *joint = &made->reader->model->joint[j];
  cav_channel channel = {
      .name = joint->name, .object = j, .component = -1, .kind = CAV_CHANNEL_COORDINATE, .ncolumn = 1};
  if (joint->type == CAV_JOINT_FREE) {
    channel.kind = CAV_CHANNEL_TRANSLATION, channel.ncolumn = 3;
    cav_status status = add_channel(made, channel, own, attribute, 1, missing);
    if (status) return status;
  }
  if (joint->type == CAV_JOINT_FREE || joint->type == CAV_JOINT_BALL)
    channel.kind = CAV_CHANNEL_ROTATION, channel.ncolumn = 4;
  return add_channel(made, channel, own, attribute, 1, missing);
}

static cav_status add_sensor(maker *made, const cav_sensor *sensor, const char *name, int component,
                             const cav_xml_node *own, const char *attribute, int *missing) {
  cav_channel channel = {.name = name, .kind = CAV_CHANNEL_SENSOR, .sensor = *sensor, .component = component};
  channel.ncolumn = component >= 0 ? 1 : sensor->dim;
  if (sensor->dim == 4 && component >= 0)
    return cav_xml_fail(made->reader->error, own, "component", "an orientation is recorded as a whole; remove it");
  return add_channel(made, channel, own, attribute, 1, missing);
}

// "all", or names by |
static cav_status listed(maker *made, const char *attribute, cav_object_type type) {
  const cav_model *m = made->reader->model;
  const char *text = cav_xml_text(made->node, attribute, NULL);
  int all = text && !strcmp(text, "all"), joints = type == CAV_OBJECT_JOINT, missing = 0, n = 0, known;
  size_t stride;
  cav_object_names(m, type, &known, &stride);
  cav_status status = CAV_OK;
  for (int i = 0; all && i < known && !status; i++) {
    const char *name = joints ? m->joint[i].name : m->sensor[i].name;
    const cav_xml_node *own = own_element(made, joints ? "joint" : "sensor", name);
    if (!*name || own || (!joints && m->sensor[i].type == CAV_SENSOR_CLOCK)) continue;
    status = joints ? add_joint(made, i, NULL, attribute, &missing)
                    : add_sensor(made, &m->sensor[i], name, -1, NULL, attribute, &missing);
  }
  char *copy = text && !all ? strdup(text) : NULL, *rest = copy, *name;
  if (text && !all && !copy) return cav_problem_no_memory(made->reader);
  for (; !status && (name = strsep(&rest, "|")); n++) {
    name += strspn(name, " ");
    for (size_t end = strlen(name); end && name[end - 1] == ' '; end--) name[end - 1] = 0;
    int i = cav_object_find(m, type, name);
    size_t each;
    int count;
    const char *const *names = cav_object_names(m, type, &count, &each);
    const char *near = count ? cav_xml_nearest(name, names, count, each) : NULL;
    if (i < 0)
      status = cav_xml_fail(made->reader->error, made->node, attribute, "the model has no %s '%.80s'%s%.80s%s",
                            joints ? "joint" : "sensor", name, near ? "; did you mean '" : "", near ? near : "",
                            near ? "'?" : "");
    else if (!own_element(made, joints ? "joint" : "sensor", name))
      status = joints ? add_joint(made, i, NULL, attribute, NULL)
                      : add_sensor(made, &m->sensor[i], m->sensor[i].name, -1, NULL, attribute, NULL);
  }
  free(copy);
  return status;
}

static cav_status own_channels(maker *made) {
  const cav_problem_reader *reader = made->reader;
  cav_status status = CAV_OK;
  for (const cav_xml_node *c = cav_problem_child(made->node, "joint"); c && !status; c = cav_xml_next(c)) {
    int j = cav_problem_find(reader, c, "name", CAV_OBJECT_JOINT);
    status = j < 0 ? CAV_BAD_INPUT : add_joint(made, j, c, "name", NULL);
  }
  for (const cav_xml_node *c = cav_problem_child(made->node, "sensor"); c && !status; c = cav_xml_next(c)) {
    cav_term term = cav_term_cost(CAV_QUANTITY_SENSOR, 0);
    status = cav_problem_sensor(reader, c, &term);
    if (!status)
      status =
          add_sensor(made, &term.sensor, cav_xml_text(c, "name", term.sensor.name), term.component, c, "name", NULL);
  }
  return status;
}

// ---------------------------------------------------------------- terms

// frames that the motion can look at, with what bridges gaps at its ends
static void frames_within(const maker *made, const cav_track *track, int *first, int *last) {
  const cav_problem *p = made->reader->problem;
  double margin = track->gap + 2 * track->interval + 2 * p->timestep;
  *first = 0, *last = made->in.nframe - 1;
  while (*first < *last - 1 && made->in.time[*first + 1] < track->offset - margin) ++*first;
  while (*last > *first + 1 && made->in.time[*last - 1] > track->offset + p->duration + margin) --*last;
}

// quaternions that follow each other on one side
static void make_continuous(const cav_track *track, double *value) {
  for (int i = 0; i < track->nchannel; i++) {
    const double *before = NULL;
    for (int f = 0; f < track->nframe && cav_channel_rotates(&track->channel[i]); f++) {
      double *w = value + (size_t)f * (size_t)track->ncolumn + (size_t)track->channel[i].column, dot = 0;
      if (isnan(w[0] + w[1] + w[2] + w[3])) continue;
      for (int k = 0; k < 4 && before; k++) dot += w[k] * before[k];
      for (int k = 0; k < 4 && dot < 0; k++) w[k] = -w[k];
      before = w;
    }
  }
}

// the channels of one stage as a track of their own; *track NULL: there are none
static cav_status track_of(const maker *made, const cav_track *whole, cav_sensor_stage stage, cav_track **track) {
  cav_problem_owner *owner = made->reader->owner;
  int n = 0, ncolumn = 0, first, last;
  for (int i = 0; i < made->n; i++)
    if (cav_channel_stage(&made->channel[i]) == stage) n++, ncolumn += made->channel[i].ncolumn;
  *track = NULL;
  if (n == 0) return CAV_OK;
  frames_within(made, whole, &first, &last);
  int nframe = last - first + 1;
  cav_channel *channel = cav_problem_alloc(owner, (size_t)n * sizeof *channel);
  double *time = cav_problem_alloc(owner, (size_t)nframe * sizeof *time);
  double *value = cav_problem_alloc(owner, (size_t)nframe * (size_t)ncolumn * sizeof *value);
  *track = cav_problem_alloc(owner, sizeof **track);
  if (!channel || !time || !value || !*track) return cav_problem_no_memory(made->reader);
  memcpy(time, made->in.time + first, (size_t)nframe * sizeof *time);
  for (int i = 0, k = 0, at = 0; i < made->n; i++) {
    if (cav_channel_stage(&made->channel[i]) != stage) continue;
    channel[k] = made->channel[i];
    channel[k].column = at;
    for (int c = 0; c < channel[k].ncolumn; c++, at++)
      for (int f = 0; f < nframe; f++)
        value[(size_t)f * (size_t)ncolumn + (size_t)at] =
            made->in.value[(size_t)(first + f) * (size_t)made->in.ncolumn + (size_t)made->pick[i][c]];
    k++;
  }
  **track = *whole;
  (*track)->nchannel = n, (*track)->channel = channel;
  (*track)->nframe = nframe, (*track)->ncolumn = ncolumn;
  (*track)->time = time, (*track)->value = value;
  make_continuous(*track, value);
  return CAV_OK;
}

static cav_status read_times(const maker *made, cav_track *track) {
  const cav_problem *p = made->reader->problem;
  const source *in = &made->in;
  double first = in->time[0], last = in->time[in->nframe - 1];
  track->interval = (last - first) / (in->nframe - 1);
  track->offset = cav_xml_real(made->node, "offset", 0);
  cav_status status = cav_problem_real(made->reader, made->node, "interval", DBL_MIN, DBL_MAX, &track->interval);
  track->gap = fmax(p->timestep, 1.5 * track->interval);
  if (!status) status = cav_problem_real(made->reader, made->node, "gap", 0, DBL_MAX, &track->gap);
  if (!status && !(track->offset < last && track->offset + p->duration > first))
    status = cav_xml_fail(made->reader->error, made->node, "offset",
                          "the record lasts from %g to %g s, none of it within the motion, %g to %g s of it", first,
                          last, track->offset, track->offset + p->duration);
  return status;
}

static cav_status make_terms(const maker *made, const cav_term *base, cav_term *term, int *n) {
  cav_track whole = {0};
  cav_status status = read_times(made, &whole);
  for (int i = 0; i < made->in.ncolumn; i++) whole.unused += !made->in.asked[i];
  whole.absent = made->absent;
  for (int stage = CAV_READS_POSITION; stage <= CAV_READS_ACCELERATION && !status; stage++) {
    cav_track *track;
    status = track_of(made, &whole, (cav_sensor_stage)stage, &track);
    if (status || !track) continue;
    term[*n] = *base;
    term[*n].track = track;
    if (!cav_xml_get(made->node, "weight")) term[*n].weight = base->from == base->to ? 1 : 1 / whole.interval;
    ++*n;
    whole.unused = whole.absent = 0;
  }
  return status;
}

cav_status cav_problem_track(const cav_problem_reader *reader, const cav_xml_node *node, const cav_term *base,
                             cav_term *term, int *n) {
  maker made = {.reader = reader, .node = node};
  cav_error inner = {0};
  cav_marker_set *set = NULL;
  cav_status status = CAV_OK;
  *n = 0;
  if (reader->problem->duration_most > 0)
    return cav_xml_fail(reader->error, node, NULL, "a record has its own time; remove 'range' of <horizon>");
  if (cav_xml_get(node, "markers")) {
    char *path = cav_file_beside(reader->path, cav_xml_text(node, "markers", ""));
    set = path ? cav_marker_set_read(path, reader->model, &inner) : NULL;
    free(path);
    if (!set)
      status = cav_xml_fail_as(reader->error, inner.status ? inner.status : CAV_NO_MEMORY, node, "markers", "%s",
                               inner.text);
    if (set && set->retarget)
      status = cav_xml_fail(reader->error, node, "markers",
                            "a set with retarget=\"true\" scales the clip: fit it by cavort ik and track the joints of "
                            "that, as its repair.xml does");
  }
  if (!status) status = take_record(&made, set);
  if (!status) status = set_markers(&made, set);
  if (!status) status = own_markers(&made, set);
  if (!status) status = listed(&made, "joints", CAV_OBJECT_JOINT);
  if (!status) status = listed(&made, "sensors", CAV_OBJECT_SENSOR);
  if (!status) status = own_channels(&made);
  if (!status && made.n == 0)
    status = cav_xml_fail(reader->error, node, NULL,
                          "nothing of %s is compared: give markers, joints or sensors that it has columns of",
                          made.in.label);
  if (!status) status = make_terms(&made, base, term, n);
  cav_marker_set_free(set);
  free_source(&made.in);
  free(made.channel), free(made.pick);
  return status;
}
