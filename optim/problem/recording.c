/// What a record says at a time: cav_track_sample. A column that was not recorded at a frame is bridged linearly where the
/// frames around it that have it lie no farther apart than the track's gap; else the column says nothing wherever that
/// frame counts.
#include <math.h>

#include "problem_file.h"
#include "quantity.h"

static const double near_frame = 1e-6; // of the interval: so near a frame counts alone

static double entry(const cav_track *track, int frame, int column) {
  return track->value[(size_t)frame * (size_t)track->ncolumn + (size_t)column];
}

// a column at a frame, bridged where it was not recorded
static double bridged(const cav_track *track, int frame, int column) {
  double value = entry(track, frame, column), most = track->gap * (1 + 1e-9);
  if (!isnan(value)) return value;
  int a = frame - 1, b = frame + 1;
  while (a >= 0 && track->time[frame] - track->time[a] < most && isnan(entry(track, a, column))) a--;
  while (b < track->nframe && track->time[b] - track->time[frame] < most && isnan(entry(track, b, column))) b++;
  if (a < 0 || b >= track->nframe || track->time[b] - track->time[a] > most) return NAN;
  double s = (track->time[frame] - track->time[a]) / (track->time[b] - track->time[a]);
  return (1 - s) * entry(track, a, column) + s * entry(track, b, column);
}

// the last frame at or before a time, within the record
static int frame_before(const cav_track *track, double time) {
  int low = 0, high = track->nframe - 1;
  while (high - low > 1) {
    int middle = (low + high) / 2;
    if (track->time[middle] <= time)
      low = middle;
    else
      high = middle;
  }
  return low;
}

// adds weight times a frame; what is not there stays so, as NaN
static void add_frame(const cav_track *track, const cav_channel *channel, int frame, double weight, double *value) {
  for (int c = 0; c < channel->ncolumn && weight > 0; c++)
    value[c] += weight * bridged(track, frame, channel->column + c);
}

static void linear(const cav_track *track, const cav_channel *channel, double time, double *value) {
  int i = frame_before(track, time);
  double span = track->time[i + 1] - track->time[i], s = (time - track->time[i]) / span;
  s = s < near_frame ? 0 : s > 1 - near_frame ? 1 : s;
  add_frame(track, channel, i, 1 - s, value);
  add_frame(track, channel, i + 1, s, value);
}

// weight of a frame in a mean, 0 near its ends: what is far off need not be there
static double hat(double off, double width) {
  double weight = 1 - fabs(off) / width;
  return weight > near_frame ? weight : 0;
}

static void mean(const cav_track *track, const cav_channel *channel, double time, double width, double *value) {
  double total = 0;
  int first = frame_before(track, time - width), end = first;
  for (; end < track->nframe && track->time[end] < time + width; end++) total += hat(track->time[end] - time, width);
  for (int i = first; i < end; i++) add_frame(track, channel, i, hat(track->time[i] - time, width) / total, value);
}

// a quaternion is there as a whole, of unit length
static void normalise(double w[4]) {
  double length = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2] + w[3] * w[3]);
  for (int k = 0; k < 4; k++) w[k] = length > 0 ? w[k] / length : NAN;
}

int cav_track_sample(const cav_track *track, const cav_channel *channel, double time, double timestep,
                     double value[CAV_SENSOR_DIM_MAX]) {
  double at = track->offset + time, first = track->time[0], last = track->time[track->nframe - 1];
  if (cav_channel_stage(channel) == CAV_READS_VELOCITY) at += timestep / 2;
  double slack = near_frame * track->interval, width = fmin(timestep, fmin(at - first, last - at));
  int inside = at >= first - slack && at <= last + slack, seen = 0;
  for (int c = 0; c < channel->ncolumn; c++) value[c] = inside ? 0 : NAN;
  if (!inside) return 0;
  if (width > track->interval * (1 + near_frame))
    mean(track, channel, at, width, value);
  else
    linear(track, channel, at, value);
  if (cav_channel_rotates(channel)) normalise(value);
  for (int c = 0; c < channel->ncolumn; c++) seen |= !isnan(value[c]);
  return seen;
}
