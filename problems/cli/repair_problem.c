/// The problem that cavort ik leaves beside a fit: the motion nearest to it that obeys physics.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "file.h"
#include "result_file.h"

static const double coarse = 1 / 60.0; // s, longest step: two to a frame of most clips

// The longest step that fits the frames evenly, or frames that fit it. Where a second is no whole number of these (a clip
// whose times were scaled), the coarse one: parts of so many seconds are whole numbers of steps
static double step_of(const cav_trajectory *motion) {
  double h = motion->timestep, step = h > coarse ? h / ceil(h / coarse - 1e-9) : h * floor(coarse / h + 1e-9);
  return fabs(1 / step - round(1 / step)) < 1e-6 / step ? step : coarse;
}

cav_status cav_command_write_repair(const char *folder, const char *model_path, const cav_trajectory *motion,
                                    cav_error *error) {
  cav_file file;
  char *path = cav_result_path(folder, "repair.xml"),
       *model = path ? cav_result_seen_from(folder, model_path, 0, error) : NULL;
  if (!path) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory");
  double h = step_of(motion), steps = floor((motion->nknot - 1) * motion->timestep / h + 1e-6);
  cav_status status = model ? cav_file_begin(&file, path, error) : error->status;
  if (!status) {
    fputs(
        "<!-- The motion nearest to the fit beside this file that obeys physics: cavort solve. Parts of a long one:\n"
        "     --set horizon/@duration=2 --set guess/@offset=1 --set cost/track/@offset=1 -->\n<problem name=\"repair\" "
        "model=\"",
        file.stream);
    cav_file_write_xml(file.stream, model);
    fprintf(file.stream, "\">\n  <horizon duration=\"%.17g\" timestep=\"%.17g\" close=\"open\" order=\"momentum\"/>\n",
            steps * h, h);
    fputs(
        "  <start free=\"true\"/>\n  <guess file=\"trajectory.csv\"/>\n"
        "  <cost>\n"
        "    <track file=\"trajectory.csv\" joints=\"all\" sd=\"0.6 2\"/>\n"
        "    <slip weight=\"200000\"/>\n"
        "    <force weight=\"1\"/>\n"
        "    <self_force weight=\"1000\"/>\n"
        "    <effort weight=\"3\"/>\n"
        "    <velocity dofs=\"joints\" weight=\"0\"/>\n"
        "    <velocity dofs=\"root_angular\" weight=\"0\"/>\n"
        "    <posture dofs=\"joints\" weight=\"0\"/>\n"
        "  </cost>\n"
        "  <schedule stages=\"8\" next_gap=\"exact\" next_slip=\"exact\" optimality=\"0.01\">\n"
        "    <first softness=\"0.5\" smoothing=\"0.01\" iterations=\"60\"/>\n"
        "    <last smoothing_self=\"0.001\" iterations=\"100\"/>\n"
        "  </schedule>\n"
        "</problem>\n",
        file.stream);
    status = cav_file_end(&file, error);
  }
  free(path), free(model);
  return status;
}
