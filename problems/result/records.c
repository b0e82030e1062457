/// Distances of a motion from its records: measured with the certificate's own code, written and told.
#include "records.h"

#include <math.h>
#include <stdlib.h>

#include "csv.h"
#include "file.h"

static const char *const kind_name[] = {
#define KIND_NAME(kind, name, ...) [CAV_CHANNEL_##kind] = #name,
    CAV_CHANNELS(KIND_NAME)
#undef KIND_NAME
};

cav_records *cav_records_measure(const cav_problem *problem, const cav_trajectory *trajectory,
                                 const cav_options *contact, cav_error *error) {
  cav_records *records = calloc(1, sizeof *records);
  cav_channel_residual **residual = calloc((size_t)problem->nterm + 1, sizeof *residual);
  cav_status status = records && residual ? CAV_OK : CAV_NO_MEMORY;
  if (status) cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the residuals of records");
  if (records) *records = (cav_records){.problem = problem, .residual = residual};
  for (int i = 0; i < problem->nterm && !status; i++) {
    const cav_track *track = problem->term[i].track;
    if (!track) continue;
    records->nrecord++;
    residual[i] = calloc((size_t)track->nchannel, sizeof *residual[i]);
    status = residual[i] ? cav_track_residuals(problem, trajectory, contact, i, residual[i], error)
                         : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the residuals of records");
  }
  if (!status) return records;
  if (!records) free(residual);
  cav_records_free(records);
  return NULL;
}

void cav_records_free(cav_records *records) {
  if (!records) return;
  for (int i = 0; records->residual && i < records->problem->nterm; i++) free(records->residual[i]);
  free(records->residual);
  free(records);
}

double cav_records_markers(const cav_records *records) {
  double square = 0, n = 0;
  for (int i = 0; i < records->problem->nterm; i++) {
    const cav_track *track = records->problem->term[i].track;
    for (int c = 0; track && c < track->nchannel; c++) {
      const cav_channel_residual *r = &records->residual[i][c];
      if (track->channel[c].kind != CAV_CHANNEL_MARKER || !r->seen) continue;
      square += r->rms * r->rms * r->seen, n += r->seen;
    }
  }
  return sqrt(square / n);
}

static void write_channels(FILE *out, const cav_term *term, const cav_channel_residual *residual) {
  for (int i = 0; i < term->track->nchannel; i++) {
    const cav_channel *channel = &term->track->channel[i];
    const cav_channel_residual *r = &residual[i];
    cav_table_write_text(out, term->name ? term->name : "");
    fputc(',', out);
    cav_table_write_text(out, channel->name);
    fprintf(out, ",%s,%s,%s,%d", kind_name[channel->kind], r->what, r->unit, r->seen);
    const double value[] = {r->rms, channel->sd, r->worst, r->worst_time};
    for (int k = 0; k < 4; k++) {
      fputc(',', out);
      cav_table_write_number(out, value[k]);
    }
    fputc('\n', out);
  }
}

cav_status cav_records_write(const char *path, const cav_records *records, cav_error *error) {
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (status) return status;
  fputs("record,channel,of,what,unit,knots,rms,sd,worst,worst_time\n", file.stream);
  for (int i = 0; i < records->problem->nterm; i++)
    if (records->residual[i]) write_channels(file.stream, &records->problem->term[i], records->residual[i]);
  return cav_file_end(&file, error);
}

// the channels of one kind in one record
static void print_kind(FILE *out, const cav_term *term, const cav_channel_residual *residual, cav_channel_kind kind) {
  const cav_track *track = term->track;
  double square = 0, over = 0, n = 0, most = 0;
  int channels = 0, worst = -1;
  for (int i = 0; i < track->nchannel; i++) {
    const cav_channel *channel = &track->channel[i];
    const cav_channel_residual *r = &residual[i];
    if (channel->kind != kind || !r->seen) continue;
    double part = r->rms * r->rms * r->seen;
    channels++, n += r->seen, square += part, over += part / (channel->sd * channel->sd);
    if (worst >= 0 && !(r->worst / channel->sd > most)) continue;
    worst = i, most = r->worst / channel->sd;
  }
  if (channels == 0) return;
  const char *name = term->name && *term->name ? term->name : "record";
  fprintf(out, "  %.40s, %d %s%s: rms ", name, channels, kind_name[kind], channels > 1 ? "s" : "");
  if (kind == CAV_CHANNEL_MARKER) fprintf(out, "%.2f mm, ", 1e3 * sqrt(square / n));
  fprintf(out, "%.3g sd; largest %.3g sd, '%.60s' at %.4g s\n", sqrt(over / n), most, track->channel[worst].name,
          residual[worst].worst_time);
}

void cav_records_print(FILE *out, const cav_records *records) {
  if (records->nrecord > 0) fprintf(out, "records, how far the motion is from them\n");
  for (int i = 0; i < records->problem->nterm; i++)
    for (int kind = 0; kind < CAV_CHANNEL_KINDS && records->residual[i]; kind++)
      print_kind(out, &records->problem->term[i], records->residual[i], (cav_channel_kind)kind);
}
