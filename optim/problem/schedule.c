/// The schedule as data: the stage, and the contact law of it, at any fraction of the way from the first to the last.
#include "schedule.h"

#include <float.h>
#include <limits.h>
#include <math.h>

#include "math3.h"

#define REAL_FIELD(name, first, last, least, most, course, law, unit, text) \
  {#name, CAV_FIELD_REAL, offsetof(cav_stage_options, name), least, most, NULL, unit, text},
#define WHOLE_FIELD(name, first, last, least, most, text) \
  {#name, CAV_FIELD_WHOLE, offsetof(cav_stage_options, name), least, most, NULL, "", text},
static const cav_field fields[] = {CAV_STAGE_OPTIONS(REAL_FIELD, WHOLE_FIELD)};

const cav_field *cav_stage_fields(int *n) {
  *n = sizeof fields / sizeof *fields;
  return fields;
}

/// Farthest that geoms of a moving link can be from the root of its tree, m, however its joints turn.
static double reach_of(const cav_model *m, const cav_geom *geom) {
  double reach = isfinite(geom->bound) ? norm3(geom->pos) + geom->bound : 0;
  for (int l = geom->link; l > 0 && l != m->link[l].root; l = m->link[l].parent) reach += norm3(m->link[l].pos);
  return geom->link > 0 ? reach : 0;
}

/// m: a tree that reaches so far has the usual smoothing.
static const double usual_reach = 0.5;

double cav_schedule_part(const cav_model *model) {
  int touches = 0;
  double most = 0;
  for (int i = 0; model && i < model->npair; i++) {
    const int one = model->geom[model->pair[i].geom1].link, other = model->geom[model->pair[i].geom2].link;
    touches |= !model->pair[i].external && one > 0 && other > 0 && model->link[one].root != model->link[other].root;
  }
  for (int i = 0; touches && i < model->ngeom; i++) most = fmax(most, reach_of(model, &model->geom[i]));
  return most > 0 ? fmin(most / usual_reach, 1) : 1;
}

int cav_problem_is_given(const cav_problem *problem) {
  return problem->model->nu == 0 && !problem->free_start && problem->residual.force == 0 &&
         problem->residual.torque == 0;
}

int cav_problem_has_record(const cav_problem *problem) {
  int found = 0;
  for (int i = 0; i < problem->nterm; i++) found |= problem->term[i].quantity == CAV_QUANTITY_TRACK;
  return found;
}

// whether something that no actuator moves may slide: a box that is pushed hovers under the convex law, and would have to come
// down where Coulomb's begins
static int slides(const cav_problem *problem) {
  const cav_model *m = problem->model;
  for (int i = 0; i < problem->nterm; i++) {
    const cav_term *term = &problem->term[i];
    if (term->quantity == CAV_QUANTITY_SLIP && term->body > 0 && term->within > 0 &&
        !m->link[m->body[term->body].link].driven)
      return 1;
  }
  return 0;
}

static double between(double from, double to, double s) {
  if (s >= 1) return to; // to the last digit
  return from > 0 && to > 0 ? from * pow(to / from, s) : (1 - s) * from + s * to;
}

// fraction of the way from which on contacts slide by the schedule's law: before, forces that are active at a distance
// make up for what is missing, and a convex law leads better (step-up ends in a corner without)
static const double SLIDES_FROM = 0.75;
// fraction of the way from which on contacts see gap and slip where the step ends; from three quarters on walker-jump and
// cheetah-jump are not certified
static const double LOOKS_FROM = 0.5;

// depth in m from which contacts grow no stiffer at first and from GROWN_FROM of the way on, where solids grow
static const double SATURATION = 0.02, SATURATION_END = 2, GROWN_FROM = 0.7;

cav_stage_options cav_schedule_at(const cav_schedule *schedule, double x) {
  const cav_stage_options *a = &schedule->first, *b = &schedule->last;
  cav_stage_options stage = x < 1 ? *a : *b;
#define COURSE_ALL(name) stage.name = between(a->name, b->name, x);
#define COURSE_HALF(name) stage.name = between(a->name, b->name, fmin(2 * x, 1));
#define COURSE_KEEP(name)
#define COURSE(name, first, last, least, most, course, ...) COURSE_##course(name)
#define KEEP(...)
  CAV_STAGE_OPTIONS(COURSE, KEEP)
  return stage;
}

void cav_stage_law(const cav_problem *problem, double x, double step, cav_options *law) {
  cav_stage_options stage = cav_schedule_at(&problem->schedule, x);
  law->stabilisation = CAV_STABILISATION_DISCRETE;
  law->sliding = x >= SLIDES_FROM || slides(problem) ? problem->schedule.sliding : CAV_SLIDING_CONVEX;
  law->next_gap = x >= LOOKS_FROM ? problem->schedule.next_gap : CAV_NEXT_GAP_LINEAR;
  law->next_slip = x >= LOOKS_FROM ? problem->schedule.next_slip : CAV_NEXT_SLIP_LINEAR;
  law->saturation = problem->schedule.solids == CAV_SOLIDS_GROW && x < 1
                        ? between(SATURATION, SATURATION_END, fmin(x / GROWN_FROM, 1))
                        : 0;
#define LAW_SAME(name) law->name = stage.name;
#define LAW_STEPS(name) law->name = stage.name * step;
#define LAW_NONE(name)
#define LAW(name, first, last, least, most, course, in, ...) LAW_##in(name)
  CAV_STAGE_OPTIONS(LAW, KEEP)
}
