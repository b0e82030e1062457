/// cavort track: a recorded clip to a motion that obeys physics, with its forces. The kinematic fit (cavort ik) gives places of
/// markers and the guess; the problem that is nearest to the markers is written, problem.xml, and solved (cavort solve) into
/// result/; cop.csv tells centres of pressure, records.csv of the result how far markers are. Exit status as of solve.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cavort/mocap.h"
#include "command.h"
#include "csv.h"
#include "file.h"
#include "pressure.h"
#include "records.h"
#include "result.h"

/// Noise of a frame of one marker, m: errors of a centimetre, which skin and rigid segments keep for some 25 frames.
static const double usual_sd = 0.05;

/// A foot that slides so far over a step of half a second is one that the record does not tell from one that stands, s.
static const double stance = 0.5;

static const double step = 0.01; // s

/// How much contacts yield, and the distance over which their force rises, m.
static const double softness = 0.08, sharpest = 0.0005, softest = 0.0015;

/// Weights over the record's information: what feet do against each other, and how fast they slide.
static const double effort = 2.4e-6, slip = 6e-6;

/// Longer clips are solved by windows, s: a step of a walk ahead is what a posture depends on.
static const double window = 2, overlap = 0.6;

typedef struct tracked {
  const cav_command_line *line;
  char *folder, *fit, *problem, *result, *model; // folder/ik, folder/problem.xml, folder/result, of the fit
  double first, from, to;                        // s: of the first frame, of the motion
  double information; // of the record on where the body is: markers, times rate, over noise, 1/(m^2 s)
  double smoothing;   // m, of the contacts
  double mass;        // kg
  char *columns[3];   // of ik/acceleration.csv: of free roots, linear, angular; joints; NULL: none
  double fit_rms;     // m, over the motion
} tracked;

// NAME.track of dir/NAME.trc
static char *default_folder(const char *clip) {
  const char *slash = strrchr(clip, '/'), *name = slash ? slash + 1 : clip, *dot = strrchr(name, '.');
  int n = dot ? (int)(dot - name) : (int)strlen(name);
  char *folder = malloc((size_t)n + 7);
  if (folder) sprintf(folder, "%.*s.track", n, name);
  return folder;
}

static cav_status make_paths(tracked *t, cav_error *error) {
  const cav_command_line *line = t->line;
  t->folder = line->output ? strdup(line->output) : default_folder(line->operand);
  if (t->folder) t->fit = cav_result_path(t->folder, "ik");
  if (t->folder) t->problem = cav_result_path(t->folder, "problem.xml");
  if (t->folder) t->result = cav_result_path(t->folder, "result");
  if (t->fit) t->model = cav_result_path(t->fit, "model.xml");
  if (t->model && access(t->model, F_OK) == 0) unlink(t->model);
  if (!t->model || !t->problem || !t->result) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  return cav_result_folder(t->folder, error);
}

// the kinematic fit, and the model that it is of
static int fit(tracked *t, cav_error *error) {
  cav_command_line line = *t->line;
  line.output = t->fit;
  int done = cav_command_ik(&line);
  if (done) return done;
  if (access(t->model, F_OK) == 0) return 0;
  free(t->model);
  t->model = strdup(t->line->model);
  if (t->model) return 0;
  cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  return cav_command_fail(error);
}

// names of columns, separated by |: linear (0) or angular (1) ones of free joints, or those of all others (2); NULL: there are
// none
static char *columns_of(const cav_model *m, int group) {
  static const int nv[] = {[CAV_JOINT_FREE] = 6, [CAV_JOINT_BALL] = 3, [CAV_JOINT_SLIDE] = 1, [CAV_JOINT_HINGE] = 1};
  char *text = NULL;
  size_t size;
  int n = 0;
  FILE *out = open_memstream(&text, &size);
  for (int j = 0; j < m->njoint && out; j++) {
    if ((m->joint[j].type == CAV_JOINT_FREE) != (group < 2)) continue;
    int count = group < 2 ? 3 : nv[m->joint[j].type];
    for (int k = 0; k < count; k++) {
      fprintf(out, "%sqacc_%s", n++ ? "|" : "", m->joint[j].name);
      if (nv[m->joint[j].type] > 1) fprintf(out, "_%d", group < 2 ? 3 * group + k : k);
    }
  }
  if (out) fclose(out);
  if (n) return text;
  free(text);
  return NULL;
}

// how far a body's weight on four points presses its lightest part that meets the ground into it, m: the distance over
// which a contact's force may rise without holding what is light off the ground
static double sink_of(const cav_model *m) {
  double most = 0;
  for (int i = 0; i < m->npair; i++)
    if (m->pair[i].external) most = fmax(most, m->pair[i].weight[0]);
  double weight =
      m->mass * sqrt(m->gravity[0] * m->gravity[0] + m->gravity[1] * m->gravity[1] + m->gravity[2] * m->gravity[2]);
  return weight / 4 * step * step * softness / (1 + softness) * most;
}

// the time that is asked for, whole steps of it that the clip has; the model is a file's
static cav_status take_time(tracked *t, const char *file, cav_error *error) {
  cav_model *model = cav_model_load(file, error);
  cav_marker_set *set = model ? cav_marker_set_read(t->line->markers, model, error) : NULL;
  cav_record *record = set ? cav_record_read(t->line->operand, &set->clip, error) : NULL;
  if (record) {
    double last = record->time[record->nframe - 1];
    t->first = record->time[0];
    t->from = fmax(t->line->from_given ? t->line->from : t->first, t->first);
    t->to = t->line->until > 0 ? fmin(t->line->until, last) : last;
    t->to = t->from + floor((t->to - t->from) / step + 1e-6) * step;
    t->information = record->nmarker * (record->nframe - 1) / (last - t->first) / (usual_sd * usual_sd);
    t->smoothing = fmin(fmax(sink_of(model), sharpest), softest);
    t->mass = model->mass;
    for (int group = 0; group < 3; group++) {
      free(t->columns[group]);
      t->columns[group] = columns_of(model, group);
    }
  }
  cav_status status = record ? CAV_OK : error->status;
  if (record && set->retarget)
    status =
        cav_file_fail(error, CAV_BAD_INPUT, 0,
                      "%s: a set with retarget=\"true\" scales the clip, and markers of another body say nothing of "
                      "forces here; fit it by cavort ik, then cavort solve DIR/repair.xml",
                      t->line->markers);
  else if (record && !(t->to - t->from > 2.5 * step))
    status = cav_file_fail(error, CAV_BAD_INPUT, 0,
                           "track: expected three steps of %g s at least between --from and --until; the clip lasts "
                           "from %g to %g s",
                           step, record->time[0], record->time[record->nframe - 1]);
  cav_record_free(record);
  cav_marker_set_free(set);
  cav_model_free(model);
  return status;
}

static void write_path(FILE *out, const char *name, const char *path) {
  fprintf(out, " %s=\"", name);
  cav_file_write_xml(out, path);
  fputc('"', out);
}

// markers tell where a body is; forces are accelerations, which a millimetre at 6 Hz would drown: they are held to those
// of the fit below that
static void write_accelerations(FILE *out, const tracked *t) {
  static const struct {
    const char *name, *dofs;
    double weight; // of the record's information, s^4; by the squared lever of a body of a person's size, m^2
  } group[3] = {{"root", "root_linear", 6e-5}, {"rotation", "root_angular", 2e-6}, {"joints", "joints", 6e-8}};
  fputs("    <!-- and accelerations of its fit, below 6 Hz: what decides forces -->\n", out);
  for (int k = 0; k < 3; k++) {
    if (!t->columns[k]) continue;
    fprintf(out, "    <acceleration name=\"%s\" dofs=\"%s\" file=\"ik/acceleration.csv\" offset=\"%.10g\"",
            group[k].name, group[k].dofs, t->from - t->first);
    write_path(out, "columns", t->columns[k]);
    fprintf(out, "\n      weight=\"%.3g\" within=\"any\"/>\n", group[k].weight * t->information);
  }
}

static void write_text(FILE *out, const tracked *t, const char *model, const char *clip) {
  fputs(
      "<!-- The motion nearest to a record: written by cavort track; edit it and solve it again:\n"
      "     cavort solve problem.xml -o result -->\n<problem name=\"track\"",
      out);
  write_path(out, "model", model);
  fprintf(out, ">\n  <horizon duration=\"%.10g\" timestep=\"%g\" order=\"momentum\" close=\"open\"", t->to - t->from,
          step);
  if (t->to - t->from > 1.5 * window) fprintf(out, " window=\"%g\" overlap=\"%g\"", window, overlap);
  fputs("/>\n", out);
  fputs("  <start free=\"true\"/>\n", out);
  fprintf(out, "  <guess file=\"ik/trajectory.csv\" offset=\"%.10g\"/>\n  <cost>\n    <track", t->from - t->first);
  write_path(out, "file", clip);
  fprintf(out, " markers=\"ik/markers.xml\" sd=\"%g\" offset=\"%.10g\"/>\n", usual_sd, t->from);
  write_accelerations(out, t);
  fputs(
      "    <!-- nothing else is wanted of postures and velocities, nor of contacts but that they do not slide -->\n"
      "    <posture weight=\"0\"/>\n    <velocity weight=\"0\"/>\n    <gap weight=\"0\"/>\n    <impact "
      "weight=\"0\"/>\n",
      out);
  fprintf(out, "    <effort weight=\"%.3g\"/>\n", effort * t->information);
  fprintf(out,
          "    <!-- contacts may slide as fast as the markers' noise hides over a step of %g s -->\n"
          "    <slip weight=\"%.3g\" within=\"%g\"/>\n  </cost>\n",
          stance, slip * t->information, usual_sd / stance);
  fputs("  <!-- all of the actuators' strength: nothing is kept for feedback -->\n  <limits effort=\"1\"/>\n", out);
  fprintf(out,
          "  <!-- soles and floor yield by some millimetres, as a shoe does -->\n"
          "  <schedule><last softness=\"%g\" smoothing=\"%.3g\"/></schedule>\n</problem>\n",
          softness, t->smoothing);
}

static cav_status write_problem(const tracked *t, cav_error *error) {
  char *model = cav_result_seen_from(t->folder, t->model, 0, error);
  char *clip = model ? cav_result_seen_from(t->folder, t->line->operand, 0, error) : NULL;
  cav_file file;
  cav_status status = clip ? cav_file_begin(&file, t->problem, error) : error->status;
  if (!status) {
    write_text(file.stream, t, model, clip);
    status = cav_file_end(&file, error);
  }
  free(model), free(clip);
  return status;
}

// ---------------------------------------------------------------- what became of it

// rms of the kinematic fit over the same knots, m; NaN: it cannot be told
static double fit_rms(const tracked *t, const cav_problem *p) {
  cav_error ignored = {0};
  char *path = cav_result_path(t->fit, "trajectory.csv");
  cav_trajectory *fit = path ? cav_trajectory_read(path, p->model, &ignored) : NULL, *even = NULL, *same = NULL;
  if (fit) even = cav_trajectory_resample(p->model, fit, p->timestep / 2);
  int first = (int)lround((t->from - t->first) / (p->timestep / 2));
  int knots = (int)lround(p->duration / p->timestep) + 1, fits = even && first + 2 * (knots - 1) < even->nknot;
  if (fits) same = cav_trajectory_new(p->model, knots, p->timestep);
  for (int k = 0; k < knots && same; k++)
    memcpy(same->q + (size_t)k * (size_t)same->nq, even->q + (size_t)(first + 2 * k) * (size_t)same->nq,
           (size_t)same->nq * sizeof *same->q);
  cav_records *records = same ? cav_records_measure(p, same, &p->contact, &ignored) : NULL;
  double rms = records ? cav_records_markers(records) : NAN;
  cav_records_free(records);
  cav_trajectory_free(fit), cav_trajectory_free(even), cav_trajectory_free(same);
  free(path);
  return rms;
}

// cop.csv, and what is told of the result
static cav_status tell(const tracked *t, cav_error *error) {
  cav_result *result = cav_result_read(t->result, NULL, error);
  if (!result) return error->status;
  const cav_problem *p = result->problem;
  char *pressure = cav_result_path(t->folder, "cop.csv");
  cav_forces *forces = cav_forces_new(p->model, result->trajectory, &p->contact, p->close_at_rest, error);
  cav_status status = !forces ? error->status : pressure ? CAV_OK : CAV_NO_MEMORY;
  if (!status) status = cav_pressure_write(pressure, p->model, result->trajectory, forces, error);
  cav_records *records = status ? NULL : cav_records_measure(p, result->trajectory, &p->contact, error);
  if (!status && !records) status = error->status;
  if (!status && !t->line->quiet && !isnan(cav_records_markers(records)))
    printf("markers %.2f mm rms from the record, by kinematics alone %.2f mm\n", 1e3 * cav_records_markers(records),
           1e3 * fit_rms(t, p));
  if (!status && !t->line->quiet)
    printf("forces are those of %.1f kg%s\n", t->mass,
           t->line->mass > 0 ? "" : ", the model's mass: --mass gives the subject's, which no marker shows");
  if (!status && !t->line->quiet)
    printf("wrote %s: problem.xml, result (records.csv: every marker), cop.csv, ik\n", t->folder);
  cav_forces_free(forces);
  cav_records_free(records);
  free(pressure);
  cav_result_free(result);
  return status;
}

int cav_command_track(const cav_command_line *line) {
  cav_error error = {0};
  tracked t = {.line = line};
  // before anything is fitted or written; what is left out is cav_command_ik's to tell
  cav_status status = line->model && line->markers && line->operand ? take_time(&t, line->model, &error) : CAV_OK;
  if (!status) status = make_paths(&t, &error);
  int done = status ? cav_command_fail(&error) : fit(&t, &error);
  if (!done) {
    status = take_time(&t, t.model, &error);
    if (!status) status = write_problem(&t, &error);
    if (status) done = cav_command_fail(&error);
  }
  if (!done) {
    cav_command_line solve = *line;
    solve.operand = t.problem;
    solve.operands = (char *[]){t.problem};
    solve.noperand = 1;
    solve.model = NULL;
    solve.output = t.result;
    done = cav_command_solve(&solve);
    if (done == CAV_EXIT_CERTIFIED || done == CAV_EXIT_NOT_CERTIFIED) status = tell(&t, &error);
    if (status) done = cav_command_fail(&error);
  }
  for (int k = 0; k < 3; k++) free(t.columns[k]);
  free(t.folder), free(t.fit), free(t.problem), free(t.result), free(t.model);
  return done;
}
