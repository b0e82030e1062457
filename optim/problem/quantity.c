/// Quantities, as CAV_QUANTITIES declares them, and the costs of them that serve all motions.
#include <assert.h>
#include <math.h>
#include <string.h>

#include "quantity.h"

#include "cavort/solve.h"
#include "schedule.h"

#define RULE(quantity, element, of, reads, hard, unit, words, text) \
  [CAV_QUANTITY_##quantity] = {#element, CAV_OF_##of, CAV_READS_##reads, hard, unit, words, text},
static const cav_quantity_rule rules[CAV_QUANTITY_TYPES] = {
    CAV_QUANTITIES(RULE)[CAV_QUANTITY_USER] = {"user", CAV_OF_USER, CAV_READS_ACCELERATION, 1, "its own",
                                               "quantity of one's own", "what a function of the caller's measures"}};

const cav_quantity_rule *cav_quantity_rule_of(cav_quantity quantity) {
  assert(quantity < CAV_QUANTITY_TYPES);
  return &rules[quantity];
}

cav_sensor_stage cav_term_stage(const cav_term *term) {
  int sensor = term->quantity == CAV_QUANTITY_SENSOR;
  if (term->quantity == CAV_QUANTITY_USER) return term->user->reads;
  if (term->quantity == CAV_QUANTITY_TRACK && term->track) return cav_channel_stage(term->track->channel);
  return sensor ? cav_sensor_rule_of(term->sensor.type)->stage : cav_quantity_rule_of(term->quantity)->reads;
}

cav_sensor_stage cav_channel_stage(const cav_channel *channel) {
  return channel->kind == CAV_CHANNEL_SENSOR ? cav_sensor_rule_of(channel->sensor.type)->stage : CAV_READS_POSITION;
}

int cav_channel_rotates(const cav_channel *channel) {
  return channel->kind == CAV_CHANNEL_ROTATION || (channel->kind == CAV_CHANNEL_SENSOR && channel->sensor.dim == 4);
}

int cav_channel_dim(const cav_channel *channel) { return cav_channel_rotates(channel) ? 3 : channel->ncolumn; }

int cav_term_has_dofs(const cav_term *term) {
  cav_values_of of = cav_quantity_rule_of(term->quantity)->of;
  return of == CAV_OF_POSTURE || of == CAV_OF_RATE;
}

cav_term cav_term_cost(cav_quantity quantity, double weight) {
  cav_term term = {.name = cav_quantity_rule_of(quantity)->name, .quantity = quantity, .use = CAV_USE_COST};
  term.weight = weight;
  term.component = term.joint = -1;
  term.to = -1;
  term.scale = 1;
  term.lower = -INFINITY;
  term.upper = INFINITY;
  if (cav_term_has_dofs(&term)) term.dofs = CAV_DOFS_JOINTS;
  return term;
}

cav_term cav_term_equal(cav_quantity quantity, const double *target) {
  cav_term term = cav_term_cost(quantity, 0);
  term.use = CAV_USE_EQUAL;
  term.target = target;
  return term;
}

cav_term cav_term_range(cav_quantity quantity, double lower, double upper) {
  cav_term term = cav_term_cost(quantity, 0);
  term.use = CAV_USE_RANGE;
  term.lower = lower;
  term.upper = upper;
  return term;
}

static const cav_term default_term[] = {
    {.name = "effort", .quantity = CAV_QUANTITY_EFFORT, .weight = 1},
    {.name = "joint velocity", .quantity = CAV_QUANTITY_VELOCITY, .dofs = CAV_DOFS_JOINTS, .weight = 0.05},
    {.name = "root turning", .quantity = CAV_QUANTITY_VELOCITY, .dofs = CAV_DOFS_ROOT_ANGULAR, .weight = 0.05},
    {.name = "acceleration", .quantity = CAV_QUANTITY_ACCELERATION, .dofs = CAV_DOFS_ALL, .weight = 1e-4},
    {.name = "root acceleration", .quantity = CAV_QUANTITY_ACCELERATION, .dofs = CAV_DOFS_ROOT_LINEAR, .weight = 0.02},
    {.name = "posture", .quantity = CAV_QUANTITY_CONFIGURATION, .dofs = CAV_DOFS_JOINTS, .weight = 0.1},
    {.name = "gap", .quantity = CAV_QUANTITY_GAP, .weight = 1000},
    {.name = "slip", .quantity = CAV_QUANTITY_SLIP, .weight = 200},
    {.name = "impact", .quantity = CAV_QUANTITY_IMPACT, .weight = 10},
    {.name = "edge_force", .quantity = CAV_QUANTITY_EDGE_FORCE, .weight = 10},
    {.name = "clearance", .quantity = CAV_QUANTITY_CLEARANCE, .weight = 10},
    {.name = "self_penetration", .quantity = CAV_QUANTITY_SELF_PENETRATION, .weight = 1e6},
};

_Static_assert(sizeof default_term / sizeof *default_term == CAV_DEFAULT_TERMS, "default costs are counted");

int cav_problem_default_terms(cav_term *term, int most) {
  int n = CAV_DEFAULT_TERMS;
  for (int i = 0; i < n && i < most; i++) {
    term[i] = cav_term_cost(default_term[i].quantity, default_term[i].weight);
    term[i].name = default_term[i].name;
    term[i].dofs = default_term[i].dofs;
  }
  return n;
}

/// Weight of a cost by its name: of a default, or of one that the style adds.
typedef struct style_weight {
  const char *name;
  double weight;
} style_weight;

// chosen by an ablation over seven motions (optim/METHOD.md, 4)
static const style_weight style_weights[CAV_STYLE_TYPES][4] = {
    [CAV_STYLE_CAREFUL] = {{"acceleration", 4e-4}, {"root acceleration", 0.08}, {"impact", 40}, {"force", 0.3}},
    [CAV_STYLE_ATHLETIC] = {{"joint velocity", 0.0125}, {"root turning", 0.0125}, {"posture", 0.02}},
};

int cav_style_terms(cav_style style, cav_term *term, int n) {
  int before = n;
  for (const style_weight *w = style_weights[style]; w < style_weights[style] + 4 && w->name; w++) {
    int i = 0;
    while (i < before && strcmp(term[i].name, w->name)) i++;
    if (i < before) term[i].weight = w->weight;
    if (i == before) term[n++] = cav_term_cost(CAV_QUANTITY_FORCE, w->weight);
  }
  assert(n - before <= CAV_STYLE_TERMS);
  return n;
}

/// Whether a cost is a goal: at one time, or held over a window of its own at one value. What is tracked, costs over the whole
/// motion, and what is known of a free start beside a record are none.
static int is_goal(const cav_problem *problem, const cav_term *term) {
  int whole = term->from == 0 && term->to < 0, posture = term->quantity == CAV_QUANTITY_CONFIGURATION;
  if (problem->free_start && term->from == 0 && term->to == 0 && cav_problem_has_record(problem)) return 0;
  return term->from == term->to || (!whole && term->nwaypoint == 0 && (term->target || posture));
}

int cav_term_is_band(const cav_term *term) {
  const int targeted = term->quantity != CAV_QUANTITY_SENSOR || term->target;
  return term->use == CAV_USE_RANGE && targeted && isfinite(term->upper) && term->lower == -term->upper;
}

double cav_term_tolerance(const cav_problem *problem, const cav_term *term, double usual) {
  if (term->within > 0) return term->within;
  if (term->use != CAV_USE_COST) return CAV_TOLERANCE_CONSTRAINT * term->scale;
  return usual > 0 && is_goal(problem, term) ? usual : INFINITY;
}

int cav_term_target_length(const cav_model *model, const cav_term *term) {
  switch (cav_quantity_rule_of(term->quantity)->of) {
    case CAV_OF_SENSOR:
      return term->sensor.dim;
    case CAV_OF_POSTURE:
      return model->nq;
    case CAV_OF_RATE:
      return model->nv;
    case CAV_OF_USER:
      return term->user && term->user->dim > 0 && term->user->dim <= CAV_USER_DIM_MAX ? term->user->dim : 0;
    case CAV_OF_ACTUATORS:
    case CAV_OF_CONTACTS:
    case CAV_OF_TRACK:
      break;
  }
  return 0;
}

void cav_term_target(const cav_term *term, double time, int dim, double *target) {
  if (!term->target) {
    memset(target, 0, (size_t)dim * sizeof(double));
  } else if (term->nwaypoint == 0) {
    memcpy(target, term->target, (size_t)dim * sizeof(double));
  } else {
    int n = term->nwaypoint, i = 0;
    while (i < n - 2 && time > term->waypoint_time[i + 1]) i++;
    int j = i + 1 < n ? i + 1 : i;
    double span = term->waypoint_time[j] - term->waypoint_time[i];
    double s = span > 0 ? fmin(fmax((time - term->waypoint_time[i]) / span, 0), 1) : 0;
    for (int k = 0; k < dim; k++) target[k] = (1 - s) * term->target[i * dim + k] + s * term->target[j * dim + k];
  }
}

int cav_term_asks(const cav_term *term) { return term->use != CAV_USE_COST || term->weight > 0; }

int cav_term_avoids(const cav_model *m, const cav_term *term) {
  return term->quantity == CAV_QUANTITY_FORCE && term->use == CAV_USE_COST && term->body > 0 &&
         m->body[term->body].link == 0;
}

int cav_term_calms(const cav_term *term) {
  return term->quantity == CAV_QUANTITY_VELOCITY && term->dofs == CAV_DOFS_ROOT_ANGULAR && term->use == CAV_USE_COST &&
         term->weight > 0 && term->from <= 0 && term->to < 0;
}

int cav_term_placed(const cav_model *model, const cav_term *term) {
  const cav_sensor *s = &term->sensor;
  const int is = term->quantity == CAV_QUANTITY_SENSOR && s->type == CAV_SENSOR_FRAMEPOS && !s->referred;
  return is ? cav_object_link(model, s->object_type, s->object) : -1;
}
