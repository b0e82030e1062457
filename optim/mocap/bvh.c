/// Clips of skeletons, BVH: a marker at the origin of every joint and at every end, by the skeleton's own forward kinematics.
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "clip.h"
#include "math3.h"

enum { MOST_JOINTS = 2000, WORD = 128 };

typedef struct skeleton_joint {
  int parent;
  double offset[3];
  int nchannel, channel[6]; // 0 .. 2: translations, 3 .. 5: rotations about x, y, z
} skeleton_joint;

typedef struct skeleton {
  cav_clip_text *text;
  char *at; // in the text
  int n, nchannel;
  skeleton_joint *joint; // [MOST_JOINTS]
  char (*name)[WORD];
} skeleton;

// the next word, 0 where the text ends; lines are counted on the way
static int next_word(skeleton *s, char word[WORD]) {
  int n = 0;
  while (*s->at && strchr(" \t\r\n", *s->at)) s->text->line += *s->at++ == '\n';
  while (*s->at && !strchr(" \t\r\n", *s->at) && n < WORD - 1) word[n++] = *s->at++;
  word[n] = 0;
  return n > 0;
}

static cav_status expect(skeleton *s, const char *wanted) {
  char word[WORD];
  if (next_word(s, word) && !strcasecmp(word, wanted)) return CAV_OK;
  return cav_clip_fail(s->text, "expected '%s', got '%.40s'", wanted, word);
}

static cav_status read_number(skeleton *s, double *value) {
  char word[WORD];
  next_word(s, word);
  *value = cav_clip_number(word);
  return isfinite(*value) ? CAV_OK : cav_clip_fail(s->text, "expected a number, got '%.40s'", word);
}

// the rest of a line as a name
static void read_name(skeleton *s, char name[WORD]) {
  int n = 0;
  while (*s->at == ' ' || *s->at == '\t') s->at++;
  for (; *s->at && !strchr("\r\n", *s->at); s->at++)
    if (n < WORD - 8) name[n++] = *s->at;
  while (n && (name[n - 1] == ' ' || name[n - 1] == '\t')) n--;
  name[n] = 0;
}

static cav_status read_channels(skeleton *s, skeleton_joint *joint) {
  static const char *const names[] = {"Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation"};
  char word[WORD];
  double n;
  cav_status status = read_number(s, &n);
  if (status) return status;
  if (!(n >= 0 && n <= 6 && n == floor(n))) return cav_clip_fail(s->text, "expected at most 6 channels, got %g", n);
  joint->nchannel = (int)n;
  for (int i = 0; i < joint->nchannel; i++) {
    int k = 0;
    next_word(s, word);
    while (k < 6 && strcasecmp(word, names[k])) k++;
    if (k == 6) return cav_clip_fail(s->text, "expected a channel such as 'Zrotation', got '%.40s'", word);
    joint->channel[i] = k;
  }
  s->nchannel += joint->nchannel;
  return CAV_OK;
}

// a joint or an end, after its keyword; its braces hold offset, channels, and the next ones
static cav_status read_joint(skeleton *s, int parent, int is_end) {
  if (s->n == MOST_JOINTS) return cav_clip_fail(s->text, "expected at most %d joints", MOST_JOINTS);
  int i = s->n++;
  s->joint[i] = (skeleton_joint){.parent = parent};
  read_name(s, s->name[i]);
  if (is_end) {
    memcpy(s->name[i], s->name[parent], WORD);
    memcpy(s->name[i] + strnlen(s->name[i], WORD - 8), "_end", 5);
  }
  return expect(s, "{");
}

static cav_status read_hierarchy(skeleton *s) {
  char word[WORD];
  int at = -1;
  cav_status status = expect(s, "HIERARCHY");
  while (!status) {
    if (!next_word(s, word)) return cav_clip_fail(s->text, "expected 'MOTION' behind the skeleton, the file ends");
    if (!strcasecmp(word, "MOTION") && at < 0) break;
    if (!strcasecmp(word, "ROOT") || (at >= 0 && !strcasecmp(word, "JOINT")) || (at >= 0 && !strcasecmp(word, "End"))) {
      status = read_joint(s, at, !strcasecmp(word, "End"));
      at = s->n - 1;
    } else if (at >= 0 && !strcasecmp(word, "OFFSET")) {
      for (int k = 0; k < 3 && !status; k++) status = read_number(s, &s->joint[at].offset[k]);
    } else if (at >= 0 && !strcasecmp(word, "CHANNELS")) {
      status = read_channels(s, &s->joint[at]);
    } else if (at >= 0 && !strcmp(word, "}")) {
      at = s->joint[at].parent;
    } else {
      return cav_clip_fail(s->text, "expected JOINT, End Site, OFFSET, CHANNELS, '}' or MOTION, got '%.40s'", word);
    }
  }
  if (!status && s->n == 0) return cav_clip_fail(s->text, "expected a skeleton, 'ROOT', got none");
  return status;
}

// places of all joints of one frame; work: rotations [n*9]
static void place(const skeleton *s, const double *channel, double *rotation, double *frame) {
  for (int i = 0; i < s->n; i++) {
    const skeleton_joint *joint = &s->joint[i];
    double at[3], turn[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, next[9];
    copy3(at, joint->offset);
    int moved = 0;
    for (int c = 0; c < joint->nchannel; c++, channel++) {
      int k = joint->channel[c];
      if (k < 3) {
        // positions are of the joint, in the place of its offset
        if (!moved++) zero3(at);
        at[k] = *channel;
        continue;
      }
      double angle[3] = {0, 0, 0}, quat[4], one[9];
      angle[k - 3] = *channel * M_PI / 180;
      quat_exp(quat, angle);
      quat_matrix(one, quat);
      matmul3(next, turn, one);
      memcpy(turn, next, sizeof turn);
    }
    double *R = rotation + 9 * i;
    if (joint->parent < 0) {
      memcpy(R, turn, sizeof turn);
      copy3(frame + 3 * i, at);
    } else {
      matmul3(R, rotation + 9 * joint->parent, turn);
      transform(frame + 3 * i, frame + 3 * joint->parent, rotation + 9 * joint->parent, at);
    }
  }
}

static cav_status read_motion(skeleton *s, const cav_record_options *options, cav_clip *clip) {
  double frames, step;
  cav_status status = expect(s, "Frames:");
  if (!status) status = read_number(s, &frames);
  if (!status) status = expect(s, "Frame");
  if (!status) status = expect(s, "Time:");
  if (!status) status = read_number(s, &step);
  if (!status && options->rate > 0) step = 1 / options->rate;
  if (!status && !(frames >= 1 && frames == floor(frames) && step > 0))
    return cav_clip_fail(s->text, "expected a number of frames and a time above 0, got %g and %g", frames, step);
  if (!status && s->nchannel == 0) return cav_clip_fail(s->text, "expected CHANNELS of a joint, no joint has any");
  if (status) return status;
  if (!cav_clip_new(clip, s->n)) return cav_clip_no_memory(s->text);
  for (int i = 0; i < s->n; i++)
    if (!(clip->record->name[i] = strdup(s->name[i]))) return cav_clip_no_memory(s->text);
  double *channel = calloc((size_t)s->nchannel + 1 + 9 * (size_t)s->n, sizeof *channel);
  if (!channel) return cav_clip_no_memory(s->text);
  for (int t = 0; t < frames && !status; t++) {
    for (int i = 0; i < s->nchannel && !status; i++) status = read_number(s, &channel[i]);
    double *frame = status ? NULL : cav_clip_frame(clip, t * step);
    if (frame) place(s, channel, channel + s->nchannel, frame);
    if (!status && !frame) status = cav_clip_no_memory(s->text);
  }
  free(channel);
  return status;
}

cav_status cav_clip_bvh(cav_clip_text *text, const cav_record_options *options, cav_clip *clip, double *unit) {
  (void)unit;
  skeleton s = {.text = text, .at = text->data};
  text->line = 1;
  s.joint = calloc(MOST_JOINTS, sizeof *s.joint);
  s.name = calloc(MOST_JOINTS, sizeof *s.name);
  cav_status status = s.joint && s.name ? read_hierarchy(&s) : cav_clip_no_memory(text);
  if (!status) status = read_motion(&s, options, clip);
  free(s.joint);
  free(s.name);
  return status;
}
