/// optim/explain/contradiction.c: rows that depend on each other by construction, found with the weights and the mismatch that
/// follow on paper; random rows of known rank; hard terms of a problem that say two things of one joint, or ask of a thing that
/// falls what gravity does not give.
#include "contradiction.h"

#include "cavort/cavort.h"
#include "continuation.h"
#include "scene.h"

static char folder[] = "/tmp/cavort-contradiction-XXXXXX";

// sum of the group's rows, scaled to length 1, by their weights: largest entry
static double sum_of(const cav_linear_rows *rows, const cav_row_group *group, int skip, double *sum) {
  double worst = 0;
  memset(sum, 0, (size_t)rows->ncolumn * sizeof *sum);
  for (int g = 0; g < group->n; g++) {
    double length = 0;
    for (int k = rows->start[group->row[g]]; k < rows->start[group->row[g] + 1]; k++)
      length += rows->value[k] * rows->value[k];
    for (int k = rows->start[group->row[g]]; g != skip && length > 0 && k < rows->start[group->row[g] + 1]; k++)
      sum[rows->column[k]] += group->weight[g] * rows->value[k] / sqrt(length);
  }
  for (int j = 0; j < rows->ncolumn; j++) worst = fmax(worst, fabs(sum[j]));
  return worst;
}

static void check_by_hand(void) {
  // x0 = 1; 2 x0 = 6; x1 = 2; x0 + x1 + x2 = 0; x1 - x2 = 4; 3 x1 = 6; 0 = 5; x3 = 1
  const int start[] = {0, 1, 2, 3, 6, 8, 9, 9, 10}, column[] = {0, 0, 1, 0, 1, 2, 1, 2, 1, 3};
  const double value[] = {1, 2, 1, 1, 1, 1, 1, -1, 3, 1}, right[] = {1, 6, 2, 0, 4, 6, 5, 1};
  cav_linear_rows rows = {8, 4, start, column, value, right};
  cav_row_groups groups;
  double sum[4];
  CHECK(cav_contradictions_find(&rows, 1e-8, 1e-6, &groups) == CAV_OK);
  CHECK(groups.rank == 4 && groups.n == 4);
  int one = 0, twice = 0, nothing = 0, three = 0;
  for (int g = 0; g < groups.n; g++) {
    const cav_row_group *group = &groups.group[g];
    // each row of a group follows from the others: they sum up to nothing, and no longer without one
    CHECK(sum_of(&rows, group, -1, sum) < 1e-12); // seen: 1e-16
    CHECK(g == 0 || fabs(group->mismatch) <= fabs(groups.group[g - 1].mismatch));
    if (group->n == 1 && group->row[0] == 6) nothing = group->contradicts && group->mismatch == 5;
    if (group->n == 2 && group->row[0] == 0)
      one = group->row[1] == 1 && group->contradicts && fabs(fabs(group->mismatch) - 2) < 1e-12;
    if (group->n == 2 && group->row[0] == 2) twice = group->row[1] == 5 && !group->contradicts;
    if (group->n >= 4) three = group->contradicts;
  }
  // 0 + 1, 2 + 5, 6 alone, and x0 + x1 + x2 with x1 - x2 by way of x0 and x1
  CHECK(one && twice && nothing && three);
  cav_row_groups_clear(&groups);
  CHECK(groups.n == 0 && groups.group == NULL);
  // control: without the rows that depend there is nothing to tell
  const int alone_start[] = {0, 1, 2, 5}, alone_column[] = {0, 1, 0, 1, 2};
  const double alone_value[] = {1, 1, 1, 1, 1};
  rows = (cav_linear_rows){3, 4, alone_start, alone_column, alone_value, right};
  CHECK(cav_contradictions_find(&rows, 1e-8, 1e-6, &groups) == CAV_OK);
  CHECK(groups.rank == 3 && groups.n == 0);
  cav_row_groups_clear(&groups);
}

enum { FREE = 30, MADE = 12, COLUMNS = 45 };

static void check_random(void) {
  static int start[FREE + MADE + 1], column[(FREE + MADE) * COLUMNS];
  static double value[(FREE + MADE) * COLUMNS], right[FREE + MADE], x[COLUMNS], sum[COLUMNS];
  int entries = 0;
  scene_normals(x, COLUMNS, 1);
  for (int i = 0; i < FREE + MADE; i++) {
    start[i] = entries;
    double row[COLUMNS] = {0};
    // some random rows, then combinations of three of them each
    for (int k = 0; i < FREE && k < COLUMNS; k++) row[k] = scene_uniform() < -0.4 ? scene_normal() : 0;
    if (i < FREE) row[i] += 3;
    for (int c = 0; i >= FREE && c < 3; c++) {
      int of = (7 * i + 11 * c) % FREE;
      double weight = 1 + scene_uniform() / 2;
      for (int k = start[of]; k < start[of + 1]; k++) row[column[k]] += weight * value[k];
    }
    right[i] = 0;
    for (int k = 0; k < COLUMNS; k++) {
      if (row[k] == 0) continue;
      column[entries] = k, value[entries++] = row[k];
      right[i] += row[k] * x[k];
    }
  }
  start[FREE + MADE] = entries;
  right[FREE + 4] += 1e-3;
  cav_linear_rows rows = {FREE + MADE, COLUMNS, start, column, value, right};
  cav_row_groups groups;
  CHECK(cav_contradictions_find(&rows, 1e-8, 1e-6, &groups) == CAV_OK);
  CHECK(groups.rank == FREE && groups.n == MADE);
  int wrong = 0, named = 0;
  for (int g = 0; g < groups.n; g++) {
    const cav_row_group *group = &groups.group[g];
    int has = 0;
    CHECK(sum_of(&rows, group, -1, sum) < 1e-12); // seen: 1e-15
    CHECK(group->n >= 2 && sum_of(&rows, group, 0, sum) > 1e-3);
    for (int k = 0; k < group->n; k++) has |= group->row[k] == FREE + 4;
    wrong += group->contradicts, named += group->contradicts && has;
  }
  // whatever contradicts has the row that was bent
  CHECK(wrong >= 1 && named == wrong);
  cav_row_groups_clear(&groups);
}

static const char fall[] =
    "<mujoco><worldbody><body name='stone' pos='0 0 5'><joint name='down' type='slide' axis='0 0 1'/>"
    "<geom size='.1' mass='2'/></body><body name='arm' pos='3 0 5'><joint name='turn' axis='0 1 0'/>"
    "<geom type='capsule' fromto='0 0 0 .5 0 0' size='.03' mass='1'/></body></worldbody>"
    "<actuator><motor joint='turn' gear='20'/></actuator></mujoco>";

// equality rows of a problem at its guess: how many contradict, and whether each names only what it may
static int contradictions(const char *closing, const char *terms, const char *what, double *mismatch,
                          int kinds[CAV_BINDING_KINDS]) {
  char path[160], text[2000];
  cav_error error = {0};
  scene_write(folder, "model.xml", fall);
  snprintf(text, sizeof text,
           "<problem name='p' model='model.xml'><horizon duration='1' timestep='.05' order='euler' "
           "close='%s'/><start/>%s</problem>",
           closing, terms);
  scene_write(folder, "problem.xml", text);
  snprintf(path, sizeof path, "%s/problem.xml", folder);
  cav_problem *problem = cav_problem_load(path, NULL, &error);
  if (!CHECK(problem != NULL)) return fprintf(stderr, "%s\n", error.text), -1;
  cav_transcription *tr = cav_transcription_new(problem, 1, &error);
  cav_trajectory *at = cav_trajectory_new(problem->model, tr->nknot, problem->timestep);
  cav_guess_fill(problem, problem->q_goal, at);
  cav_stage_set(problem, 1, tr);
  CHECK(cav_transcription_keep_rows(tr) && cav_transcription_linearise(tr, at) == CAV_OK);
  cav_row_groups groups;
  cav_binding *row;
  CHECK(cav_transcription_contradictions(tr, 1e-6, &groups, &row) == CAV_OK);
  int found = 0;
  memset(kinds, 0, CAV_BINDING_KINDS * sizeof *kinds);
  for (int g = 0; g < groups.n; g++) {
    const cav_row_group *group = &groups.group[g];
    if (!group->contradicts) continue;
    if (found++ == 0) *mismatch = fabs(group->mismatch);
    for (int k = 0; k < group->n; k++) kinds[row[group->row[k]].kind]++;
  }
  if (found) fprintf(stderr, "    %s: rank %d, %d of %d groups contradict\n", what, groups.rank, found, groups.n);
  cav_row_groups_clear(&groups);
  free(row);
  cav_trajectory_free(at), cav_transcription_free(tr), cav_problem_free(problem);
  return found;
}

static void check_problems(void) {
  double mismatch = 0;
  int kinds[CAV_BINDING_KINDS];
  CHECK(contradictions("open", "<constraint><sensor type='jointpos' joint='turn' at='.5' target='.3'/></constraint>",
                       "one", &mismatch, kinds) == 0);
  // the same angle twice at one time, .2 rad apart: scaled to length 1 the rows sum up to that
  CHECK(contradictions("open",
                       "<constraint><sensor type='jointpos' joint='turn' at='.5' target='.3'/><sensor type='jointpos' "
                       "joint='turn' at='.5' "
                       "target='.5'/></constraint>",
                       "two", &mismatch, kinds) == 1);
  CHECK(kinds[CAV_BINDING_TERM] == 2 && kinds[CAV_BINDING_UNACTUATED] == 0);
  CHECK(fabs(mismatch - 0.2) < 1e-9); // seen: 1e-16
  // a stone at rest falls; where it is after half a second follows from its ten steps before
  CHECK(contradictions("open", "<constraint><sensor type='jointpos' joint='down' at='.5' target='0'/></constraint>",
                       "stone", &mismatch, kinds) == 1);
  CHECK(kinds[CAV_BINDING_TERM] == 1 && kinds[CAV_BINDING_UNACTUATED] == 10);
  // nor can it stand still at the end: all its steps, and the one after the last knot
  CHECK(contradictions("rest", "", "rest", &mismatch, kinds) == 1);
  CHECK(kinds[CAV_BINDING_UNACTUATED] == 21);
  // where Euler's steps lead it: 10 * 9 / 2 + 10 of them
  CHECK(contradictions("open",
                       "<constraint><sensor type='jointpos' joint='down' at='.5' target='-1.348875'/></constraint>",
                       "fallen", &mismatch, kinds) == 0);
}

int main(void) {
  if (!cav_contradictions_available()) return printf("skipped: built without SPQR\n"), CHECK_SKIPPED;
  CHECK(mkdtemp(folder) != NULL);
  check_by_hand();
  check_random();
  check_problems();
  char command[200];
  snprintf(command, sizeof command, "rm -r %s", folder);
  CHECK(system(command) == 0);
  return check_result();
}
