/// cavort ik: a model fitted to a recorded clip. Writes a folder with trajectory.csv, acceleration.csv, markers.csv (residuals),
/// markers.xml (the set with the places that were found), view.html and, where sizes or a mass are asked for, model.xml,
/// the model as it was scaled. Exit status 0 if the fit was made.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "cavort/mocap.h"
#include "command.h"
#include "csv.h"
#include "edit.h"
#include "file.h"
#include "result.h"
#include "view.h"

typedef struct fit {
  const cav_command_line *line;
  cav_model *model;
  cav_marker_set *set;
  cav_record *record;
  cav_trajectory *motion;
  cav_ik_report *report;
  double *factor, *deviation; ///< [nlink] sizes that were found; NULL: not sought
  cav_quality quality;
  char *folder;
  double seconds;
} fit;

static cav_status read_all(fit *f, cav_error *error) {
  const cav_command_line *line = f->line;
  if (!line->model)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "ik: expected --model FILE, the model that is fitted to the clip");
  if (!line->markers)
    return cav_file_fail(error, CAV_BAD_INPUT, 0,
                         "ik: expected --markers FILE, which says where markers sit: <markers> <marker name=\"R.Heel\" "
                         "body=\"right foot\"/> ...");
  if ((f->model = cav_model_load(line->model, error)) && (f->set = cav_marker_set_read(line->markers, f->model, error)))
    f->record = cav_record_read(line->operand, &f->set->clip, error);
  return f->record ? CAV_OK : error->status;
}

// NAME.ik of dir/NAME.trc
static char *default_folder(const char *clip) {
  const char *slash = strrchr(clip, '/'), *name = slash ? slash + 1 : clip, *dot = strrchr(name, '.');
  int n = dot ? (int)(dot - name) : (int)strlen(name);
  char *folder = malloc((size_t)n + 4);
  if (folder) sprintf(folder, "%.*s.ik", n, name);
  return folder;
}

static cav_status write_model(const fit *f, const char *path, cav_error *error) {
  char *text = cav_model_mjcf(f->model, f->line->model, error);
  if (!text) return error->status;
  cav_file file;
  cav_status status = cav_file_begin(&file, path, error);
  if (!status) {
    fputs(text, file.stream);
    status = cav_file_end(&file, error);
  }
  free(text);
  return status;
}

static cav_status find_sizes(fit *f, const cav_ik_options *options, cav_error *error) {
  size_t n = (size_t)f->model->nlink;
  f->factor = malloc(n * sizeof *f->factor), f->deviation = malloc(n * sizeof *f->deviation);
  if (!f->factor || !f->deviation) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for sizes");
  return cav_ik_sizes(f->model, f->record, f->set, options, f->factor, f->deviation, error);
}

static cav_status set_mass(fit *f, cav_error *error) {
  size_t n = (size_t)f->model->nlink;
  double *scale = malloc(n * sizeof *scale), ratio = f->line->mass / f->model->mass;
  for (size_t i = 0; i < n && scale; i++) scale[i] = ratio;
  cav_status status = scale ? cav_model_perturb(f->model, scale, 0) : CAV_NO_MEMORY;
  free(scale);
  return status ? cav_file_fail(error, status, 0, "the mass of the subject: %s", cav_status_name(status)) : CAV_OK;
}

// sizes and masses first; the model of which all else is told is that of the file that has them
static cav_status scale(fit *f, const cav_ik_options *options, cav_error *error) {
  static const double usual = 0.03;
  cav_marker_set *set = f->set;
  if (f->line->scale && set->scale <= 0) set->scale = usual;
  if (set->scale <= 0 && f->line->mass <= 0) return CAV_OK;
  double mass = f->model->mass;
  char *path = f->folder ? cav_result_path(f->folder, "model.xml") : NULL;
  cav_status status =
      path ? cav_result_folder(f->folder, error) : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the model");
  if (!status && set->scale > 0) status = find_sizes(f, options, error);
  if (!status && f->line->mass > 0) status = set_mass(f, error);
  // torques go with mass and length, which goes with the cube root of mass
  if (!status) cav_model_strengthen(f->model, pow(f->model->mass / mass, 4.0 / 3));
  if (!status) status = write_model(f, path, error);
  if (!status) {
    // places were found with the sizes
    for (int i = 0; i < set->nmarker && f->factor; i++) set->marker[i].placed = 1;
    if (f->factor) set->adjust = set->scale = 0;
    cav_model_free(f->model);
    f->model = cav_model_load(path, error);
    if (!f->model) status = error->status;
  }
  free(path);
  return status;
}

static cav_status write_residuals(const fit *f, cav_error *error) {
  cav_file file;
  char *path = cav_result_path(f->folder, "markers.csv");
  cav_status status = path ? cav_file_begin(&file, path, error) : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  if (!status) {
    fputs("marker,body,frames,rms_m,worst_m\n", file.stream);
    for (int i = 0; i < f->report->nmarker; i++) {
      const cav_marker *marker = &f->set->marker[f->report->marker[i]];
      cav_table_write_text(file.stream, marker->name);
      fputc(',', file.stream);
      cav_table_write_text(file.stream, f->model->body[marker->body].name);
      fprintf(file.stream, ",%d,", f->report->seen[i]);
      cav_table_write_number(file.stream, f->report->rms[i]);
      fputc(',', file.stream);
      cav_table_write_number(file.stream, f->report->worst[i]);
      fputc('\n', file.stream);
    }
    status = cav_file_end(&file, error);
  }
  free(path);
  return status;
}

// what a slower motion than markers shake accelerates by: a target for a solve
static cav_status write_accelerations(const fit *f, cav_error *error) {
  static const double cutoff = 6; // Hz, as force plates of gait are filtered
  static const int nv[] = {[CAV_JOINT_FREE] = 6, [CAV_JOINT_BALL] = 3, [CAV_JOINT_SLIDE] = 1, [CAV_JOINT_HINGE] = 1};
  const cav_model *m = f->model;
  double rate = 1 / f->motion->timestep;
  double *a = malloc((size_t)f->motion->nknot * (size_t)m->nv * sizeof *a + 1);
  char *path = cav_result_path(f->folder, "acceleration.csv");
  cav_file file;
  cav_status status = a && path ? cav_trajectory_accelerations(f->motion, fmin(cutoff, rate / 5), a) : CAV_NO_MEMORY;
  if (status) cav_file_fail(error, status, 0, "accelerations of the fit: %s", cav_status_name(status));
  if (!status) status = cav_file_begin(&file, path, error);
  if (!status) {
    fputs("time", file.stream);
    for (int j = 0; j < m->njoint; j++)
      for (int k = 0; k < nv[m->joint[j].type]; k++) {
        char name[300], part[16] = "";
        if (nv[m->joint[j].type] > 1) snprintf(part, sizeof part, "_%d", k);
        snprintf(name, sizeof name, "qacc_%.250s%s", m->joint[j].name, part);
        fputc(',', file.stream);
        cav_table_write_text(file.stream, name);
      }
    for (int t = 0; t < f->motion->nknot; t++) {
      fputc('\n', file.stream);
      cav_table_write_number(file.stream, t * f->motion->timestep);
      for (int d = 0; d < m->nv; d++) {
        fputc(',', file.stream);
        cav_table_write_number(file.stream, a[(size_t)t * (size_t)m->nv + (size_t)d]);
      }
    }
    fputc('\n', file.stream);
    status = cav_file_end(&file, error);
  }
  free(a), free(path);
  return status;
}

static cav_status write_page(const fit *f, cav_error *error) {
  char title[340], markers[80], rms[80], clip[200];
  double *millimetres = malloc((size_t)f->motion->nknot * sizeof *millimetres);
  char *path = cav_result_path(f->folder, "view.html");
  if (!millimetres || !path) {
    free(millimetres), free(path);
    return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the page");
  }
  for (int t = 0; t < f->motion->nknot; t++) millimetres[t] = 1e3 * f->report->frame_rms[t];
  snprintf(title, sizeof title, "%.140s on %.140s, kinematic fit", f->line->operand, f->model->name);
  snprintf(clip, sizeof clip, "%.180s", f->line->operand);
  snprintf(markers, sizeof markers, "%d, over %d frames", f->report->nmarker, f->motion->nknot);
  snprintf(rms, sizeof rms, "%.1f mm", 1e3 * f->report->total_rms);
  const cav_view_line line[] = {{"clip", clip, -1},
                                {"markers", markers, -1},
                                {"distance of markers, rms", rms, -1},
                                {"forces", "none: a fit of kinematics alone", -1}};
  const cav_view_series series = {
      .group = "markers", .name = "distance, rms", .unit = "mm", .value = millimetres, .lower = NAN, .upper = NAN};
  cav_view_input input = {.model = f->model,
                          .title = title,
                          .nknot = f->motion->nknot,
                          .timestep = f->motion->timestep,
                          .q = f->motion->q,
                          .nseries = 1,
                          .series = &series,
                          .nline = 4,
                          .line = line};
  cav_status status = cav_view_write(path, 1, &input, error);
  free(millimetres);
  free(path);
  return status;
}

static cav_status write_quality(const fit *f, cav_error *error) {
  cav_file file;
  char *path = cav_result_path(f->folder, "quality.csv"), *name = f->folder;
  cav_status status = path ? cav_file_begin(&file, path, error) : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  if (!status) {
    cav_command_print_quality(file.stream, 1, &name, &f->quality, 1);
    status = cav_file_end(&file, error);
  }
  free(path);
  return status;
}

// of the model of the command line, or as it was scaled
static cav_status write_repair(const fit *f, cav_error *error) {
  int scaled = f->factor || f->line->mass > 0;
  char *model = scaled ? cav_result_path(f->folder, "model.xml") : strdup(f->line->model);
  cav_status status = model ? cav_command_write_repair(f->folder, model, f->motion, error)
                            : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  free(model);
  return status;
}

static cav_status write_all(const fit *f, cav_error *error) {
  cav_status status =
      f->folder ? cav_result_folder(f->folder, error) : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  char *motion = cav_result_path(f->folder, "trajectory.csv"), *set = cav_result_path(f->folder, "markers.xml");
  if (!status && !(motion && set)) status = cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  if (!status) status = cav_trajectory_write(motion, f->model, f->motion, error);
  if (!status) status = cav_marker_set_write(set, f->model, f->set, error);
  if (!status) status = write_residuals(f, error);
  if (!status) status = write_accelerations(f, error);
  if (!status && f->motion->nknot >= 4) status = write_quality(f, error);
  if (!status && f->motion->nknot >= 4) status = write_repair(f, error);
  if (!status) status = write_page(f, error);
  free(motion);
  free(set);
  return status;
}

// a line for each link, of two sides one
static void print_sizes(const fit *f) {
  const cav_model *m = f->model;
  if (f->factor) printf("%-20s %9s %9s\n", "segment", "size", "+-");
  for (int i = 1; i < m->nlink && f->factor; i++) {
    int seen = 0;
    for (int k = 1; k < i; k++) seen |= f->factor[k] == f->factor[i];
    if (!seen) printf("%-20.20s %9.4f %9.4f\n", m->body[m->link[i].body].name, f->factor[i], f->deviation[i]);
  }
  if (f->factor || f->line->mass > 0) printf("model.xml: %.1f kg\n", m->mass);
}

static void print(const fit *f) {
  static const char *const assumed[] = {"lengths in the format's usual unit (unit= of the marker set)",
                                        "the format's usual axis up (up=)", "30 frames a second (rate=)"};
  const cav_ik_report *r = f->report;
  for (int k = 0; k < 3; k++)
    if (f->record->assumed >> k & 1) printf("assumed: %s\n", assumed[k]);
  print_sizes(f);
  printf("%-20s %-20s %7s %9s %9s\n", "marker", "body", "frames", "rms mm", "worst mm");
  for (int i = 0; i < r->nmarker; i++) {
    const cav_marker *marker = &f->set->marker[r->marker[i]];
    printf("%-20.20s %-20.20s %7d %9.1f %9.1f\n", marker->name, f->model->body[marker->body].name, r->seen[i],
           1e3 * r->rms[i], 1e3 * r->worst[i]);
  }
  if (r->missing) printf("%d markers of the clip are not in the marker set\n", r->missing);
  int absent = f->set->nmarker - r->nmarker;
  if (absent) printf("%d markers of the set are not in the clip\n", absent);
  if (f->set->left_out) printf("%d markers of the set are on parts that the model does not have\n", f->set->left_out);
  if (r->scale > 0) printf("clip scaled to the model: ways in the world by %.3f", r->scale);
  if (r->pace > 0) printf(", times by %.3f", r->pace);
  if (r->scale > 0) putchar('\n');
  printf("%d frames, %d markers, rms %.2f mm, %.2f s (%.2f s a thousand frames)\n", r->nframe, r->nmarker,
         1e3 * r->total_rms, f->seconds, 1e3 * f->seconds / r->nframe);
  if (f->motion->nknot >= 4) cav_command_print_quality(stdout, 1, (char *const *)&f->folder, &f->quality, 0);
  printf("wrote %s: trajectory.csv, acceleration.csv, markers.csv, markers.xml, quality.csv, repair.xml, view.html%s\n",
         f->folder, f->factor || f->line->mass > 0 ? ", model.xml" : "");
  printf("next: cavort view %s, to see it", f->folder);
  if (f->motion->nknot >= 4)
    printf("; cavort solve %s/repair.xml, for the motion nearest to it that obeys physics, with its forces", f->folder);
  putchar('\n');
}

int cav_command_ik(const cav_command_line *line) {
  cav_error error = {0};
  fit f = {.line = line};
  cav_ik_options options = cav_ik_options_default();
  cav_status status = read_all(&f, &error);
  f.folder = line->output ? strdup(line->output) : default_folder(line->operand);
  f.seconds = cav_command_clock(CLOCK_MONOTONIC);
  if (!status) status = scale(&f, &options, &error);
  if (!status) status = cav_ik(f.model, f.record, f.set, &options, &f.motion, &f.report, &error);
  f.seconds = cav_command_clock(CLOCK_MONOTONIC) - f.seconds;
  if (!status && f.motion->nknot >= 4) status = cav_quality_measure(f.model, f.motion, NULL, &f.quality, &error);
  if (!status) status = write_all(&f, &error);
  if (!status && !line->quiet) print(&f);
  cav_ik_report_free(f.report);
  cav_trajectory_free(f.motion);
  cav_record_free(f.record);
  cav_marker_set_free(f.set);
  cav_model_free(f.model);
  free(f.folder), free(f.factor), free(f.deviation);
  return status ? cav_command_fail(&error) : 0;
}
