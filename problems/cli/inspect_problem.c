/// What a problem asks for, in words: its horizon, start and goal, terms and schedule, for cavort inspect.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "command.h"
#include "plannable.h"
#include "problem_file.h"
#include "quantity.h"
#include "stand.h"

// "at 1.2 s", "from 0.5 to 1 s", or nothing for the whole horizon
static void print_window(const cav_problem *p, const cav_term *term) {
  double from = term->from, to = term->to < 0 ? p->duration : term->to;
  if (to - from < 1e-9)
    printf(" at %g s", from);
  else if (from > 0 || to < p->duration)
    printf(" from %g to %g s", from, to);
}

static void print_quantity(const cav_problem *p, const cav_term *term) {
  static const char *const dofs[] = {"all dofs",           "translation of free roots", "rotation of free roots",
                                     "all but free roots", "joints of what is driven",  "joint"};
  const cav_model *m = p->model;
  if (term->quantity != CAV_QUANTITY_SENSOR) printf("%s", cav_quantity_rule_of(term->quantity)->words);
  if (cav_term_has_dofs(term)) {
    printf(" of %s%s%s", dofs[term->dofs], term->dofs == CAV_DOFS_ONE ? " " : "",
           term->dofs == CAV_DOFS_ONE ? m->joint[term->joint].name : "");
  }
  if (term->body > 0) printf(" of body %s", m->body[term->body].name);
  if (term->norm == CAV_NORM_ABSOLUTE) printf(", absolute beyond %g", term->scale);
  if (term->quantity != CAV_QUANTITY_SENSOR) return;
  const char *object = cav_object_name(m, term->sensor.object_type, term->sensor.object);
  printf("%s of %s", cav_sensor_rule_of(term->sensor.type)->name, object);
  if (term->component >= 0 && term->sensor.dim > 1) printf(", %c", "xyz"[term->component]);
  if (term->sensor.referred)
    printf(", in the frame of %s", cav_object_name(m, term->sensor.reference_type, term->sensor.reference));
}

// from what bounds of a posture are counted, and where a single joint may be
static void print_posture_bounds(const cav_problem *p, const cav_term *term) {
  const cav_joint *joint = term->dofs == CAV_DOFS_ONE ? &p->model->joint[term->joint] : NULL;
  const char *whose = term->target ? "its own posture" : "the goal";
  printf(", counted from %s", whose);
  if (!joint || joint->type > CAV_JOINT_HINGE || joint->type < CAV_JOINT_SLIDE || term->nwaypoint > 1) return;
  const double from = cav_command_plain((term->target ? term->target : p->q_goal)[joint->q]);
  printf(" (%.4g): %.4g to %.4g %s", from, from + term->lower, from + term->upper,
         joint->type == CAV_JOINT_SLIDE ? "m" : "rad");
}

enum { VALUE = 120 };

// one target of a term; nothing of a posture of many joints, and of rates that differ
static void write_target(const cav_problem *p, const cav_term *term, const double *target, char text[VALUE]) {
  const cav_model *m = p->model;
  const cav_joint *joint = term->dofs == CAV_DOFS_ONE ? &m->joint[term->joint] : NULL;
  const int one = term->component >= 0 && term->sensor.dim != 4;
  const double *rate = NULL;
  int n = 0, alike = 1;
  *text = 0;
  if (term->quantity == CAV_QUANTITY_SENSOR) {
    for (int i = one ? term->component : 0; i < (one ? term->component + 1 : term->sensor.dim); i++)
      n += snprintf(text + n, (size_t)(VALUE - n), "%s%.4g", n ? " " : "", cav_command_plain(target[i]));
  } else if (term->quantity == CAV_QUANTITY_CONFIGURATION && joint) {
    const double q = cav_command_plain(target[joint->q]);
    if (joint->type == CAV_JOINT_HINGE) snprintf(text, VALUE, "%.4g rad (%.4g degrees)", q, q * 180 / M_PI);
    if (joint->type == CAV_JOINT_SLIDE) snprintf(text, VALUE, "%.4g m", q);
  } else if (cav_quantity_rule_of(term->quantity)->of == CAV_OF_RATE) {
    for (int d = 0; d < m->nv; d++) {
      if (!cav_problem_selects(m, term, d)) continue;
      if (!rate) rate = &target[d];
      alike &= target[d] == *rate;
    }
    if (rate && alike) snprintf(text, VALUE, "%.4g", cav_command_plain(*rate));
  }
}

// targets along waypoints by the first and the last
static void print_waypoints(const cav_problem *p, const cav_term *term) {
  const int length = cav_term_target_length(p->model, term);
  char first[VALUE], last[VALUE];
  write_target(p, term, term->target, first);
  write_target(p, term, term->target + (size_t)(term->nwaypoint - 1) * (size_t)length, last);
  if (*first && *last) printf(" to %s .. %s", first, last);
  printf(" along %d waypoints", term->nwaypoint);
}

// what a term is held against
static void print_target(const cav_problem *p, const cav_term *term) {
  const int about = term->quantity == CAV_QUANTITY_SENSOR && term->target;
  char value[VALUE] = "";
  if (term->use == CAV_USE_RANGE && !about) {
    if (isfinite(term->lower)) printf(" at least %g", term->lower);
    if (isfinite(term->upper)) printf("%s at most %g", isfinite(term->lower) ? " and" : "", term->upper);
    if (term->quantity == CAV_QUANTITY_CONFIGURATION) print_posture_bounds(p, term);
    return;
  }
  if (term->target) write_target(p, term, term->target, value);
  if (term->nwaypoint > 1) {
    print_waypoints(p, term);
  } else if (term->track) {
    const cav_track *track = term->track;
    printf(": %d channels, %d frames", track->nchannel, track->nframe);
    if (track->unused) printf(", %d columns of the file not asked for", track->unused);
    if (track->absent) printf(", %d markers of the set not in the file", track->absent);
  } else if (*value) {
    printf(" to %s", value);
  } else if (term->quantity == CAV_QUANTITY_CONFIGURATION) {
    printf(" to %s", term->target ? "its own posture" : "the goal");
  } else if (term->quantity == CAV_QUANTITY_SENSOR) {
    printf(term->sensor.dim == 4 ? " to no rotation" : " to 0");
  }
  if (term->use == CAV_USE_RANGE && term->lower == -term->upper)
    printf(", each component at most %.4g off", term->upper);
  if (term->use == CAV_USE_RANGE && term->lower != -term->upper)
    printf(", each component %.4g to %.4g off", term->lower, term->upper);
}

// whether achieved needs a term, and to what tolerance
static void print_standing(const cav_problem *p, const cav_term *term) {
  cav_tolerance tolerance[4];
  int reported, n = cav_term_tolerances(p, term, 4, tolerance, &reported);
  if (n && cav_command_unmeasured(p, term)) {
    printf("; never measured: a motion with close=\"open\" has no forces at its last knot; ask at %g s, or before",
           p->duration - p->timestep);
    return;
  }
  for (int i = 0; i < n && i < 4 && !cav_term_is_band(term); i++)
    printf("%s %g%s%s", i ? "," : "; to be met within", tolerance[i].within, *tolerance[i].unit ? " " : "",
           tolerance[i].unit);
  if (n && term->use == CAV_USE_COST && !(term->within > 0)) printf(" (usual)");
  if (n && term->use == CAV_USE_COST && cav_command_base(p, term) >= 0)
    printf("; leaves height, place and tilt of the base open");
  if (!n && reported) printf("; reported only, %s", term->within > 0 ? "within=\"any\"" : "no within=");
  if (term->quantity == CAV_QUANTITY_SLIP && term->within > 0) {
    if (isinf(term->within))
      printf("; these may slide");
    else
      printf("; these may slide by %g m/s", term->within);
  }
}

// by what name logs and tables tell of a term, where it has another than its element's
static void print_name(const cav_term *term) {
  if (term->name && *term->name && strcmp(term->name, cav_quantity_rule_of(term->quantity)->name))
    printf("'%s': ", term->name);
}

// a cost over the motion, of which nothing is asked
static int runs(const cav_problem *p, const cav_term *term) {
  int reported;
  cav_term_tolerances(p, term, 0, NULL, &reported);
  const int slides = term->quantity == CAV_QUANTITY_SLIP && term->within > 0;
  return term->use == CAV_USE_COST && !reported && term->quantity != CAV_QUANTITY_SENSOR &&
         term->quantity != CAV_QUANTITY_TRACK && !slides;
}

enum { RUNNING = 160 };

// "force of bar 100": such a cost by its name, or else by what it is of and whom it is for, and its weight
static void write_running(const cav_problem *p, const cav_term *term, char text[RUNNING]) {
  const char *quantity = cav_quantity_rule_of(term->quantity)->name, *whose = NULL;
  const int named = *term->name && strcmp(term->name, quantity);
  if (!named && term->body > 0) whose = p->model->body[term->body].name;
  if (!named && cav_term_has_dofs(term))
    whose = term->dofs == CAV_DOFS_ONE ? p->model->joint[term->joint].name : cav_problem_dof_sets[term->dofs];
  if (!whose) whose = "";
  snprintf(text, RUNNING, "%.60s%s%.60s %.4g", named ? term->name : quantity, *whose ? " of " : "", whose,
           term->weight);
}

// costs over the motion by their weights, in one paragraph
static void print_running(const cav_problem *p) {
  enum { WIDTH = 110 };
  int n = 0, used = 0;
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    char text[RUNNING];
    if (!runs(p, term)) continue;
    write_running(p, term, text);
    if (!n++)
      used = printf("  running costs by weight: ");
    else
      used += printf(",");
    if (used + (int)strlen(text) > WIDTH) used = printf("\n    ") - 1;
    used += printf("%s%s", n > 1 && used > 4 ? " " : "", text);
  }
  if (n) printf("\n");
}

static void print_terms(const cav_problem *p, int hard, int all) {
  int n = 0;
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    if ((term->use != CAV_USE_COST) != hard || (!all && runs(p, term))) continue;
    if (!n++)
      printf("%s; achieved needs those that are to be met, the rest is not asked for\n",
             hard ? "constraints" : "costs");
    if (hard)
      printf("  must be           ");
    else
      printf("  weight %-10.4g ", term->weight);
    print_name(term);
    print_quantity(p, term);
    print_target(p, term);
    print_window(p, term);
    print_standing(p, term);
    printf("\n");
  }
}

// what goes from where to where
static void print_stage_ends(const cav_stage_options *first, const cav_stage_options *last) {
  int n;
  const cav_field *field = cav_stage_fields(&n);
  for (int i = 0; i < n; i++, field++) {
    const char *a = (const char *)first + field->offset, *b = (const char *)last + field->offset;
    int whole = field->type == CAV_FIELD_WHOLE;
    printf("%s%s %g to %g%s%s", i ? ", " : "  ", field->name,
           whole ? *(const int *)(const void *)a : *(const double *)(const void *)a,
           whole ? *(const int *)(const void *)b : *(const double *)(const void *)b, *field->unit ? " " : "",
           field->unit);
  }
  printf("\n\n");
}

/// What the derivatives and normal equations of all knots take at least, bytes.
static double bytes_of(const cav_problem *p) { return cav_knots_bytes(p->duration / p->timestep + 1, p->model->nv); }

// bytes from which on a problem is not evaluated to tell what that takes, and knots of which few motions have more
static const double vast = 1e9;
enum { MANY_KNOTS = 4000 };

// how the solver will factor, and what an iteration takes
static cav_status print_equations(const cav_problem *p, cav_error *error) {
  cav_equations e;
  if (bytes_of(p) > vast) {
    printf("  normal equations: %.3g GB at least; not evaluated here\n", bytes_of(p) / 1e9);
    return CAV_OK;
  }
  cav_status status = cav_problem_equations(p, &e, error);
  if (status) return status;
  if (!e.left_out)
    printf("  left out: no tree; each is moved or asked for, or something comes near it\n");
  else
    printf("  left out: %d tree%s of %d dofs that nothing moves or asks for and nothing comes near\n", e.left_out,
           e.left_out > 1 ? "s" : "", e.left_out_dofs);
  printf("  normal equations: %d unknowns in %d blocks from %d rows, %d of them constraints; %.3g MB with factors\n",
         e.unknowns, e.blocks, e.rows, e.constraints, e.bytes / 1e6);
  printf("  factored as ");
  if (e.groups > 1)
    printf("%d bands, one for each group of trees that nothing joins at the guess, the largest ", e.groups);
  printf("%s of %d, as knots see their neighbours", e.groups > 1 ? "one" : "a band", e.width);
  if (e.border > 0)
    printf("; a border of %d, %s", e.border,
           !p->cycle.on   ? "of the free duration"
           : e.border % 2 ? "of a cycle's last two knots, which meet the first, and of the free duration"
                          : "of a cycle's last two knots, which meet the first");
  if (e.arrow) printf("; the free duration beside them as an arrow");
  printf("\n  once, by one thread, at the guess: rows and derivatives %.0f us, normal equations %.0f us, ",
         1e6 * e.rows_time, 1e6 * e.sums_time);
  if (e.factor_time < 0)
    printf("no factors: not positive definite there\n");
  else
    printf("factors %.0f us\n", 1e6 * e.factor_time);
  return CAV_OK;
}

void cav_command_tell_step(FILE *out, const cav_problem *p) {
  static const double deep = 10; // m
  const double *g = p->model->gravity,
               fall = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) * p->timestep * p->timestep / 2;
  int floats = 0;
  for (int j = 0; j < p->model->njoint; j++) floats |= p->model->joint[j].type == CAV_JOINT_FREE;
  if (floats && fall > deep)
    fprintf(out, "note: a free body falls by %.3g m in one step of %g s: durations and steps are in s\n", fall,
            p->timestep);
  if (p->duration / p->timestep > MANY_KNOTS)
    fprintf(
        out,
        "note: %g s in steps of %g s are %.0f knots, %.3g GB at least: durations and steps are in s; %g ms are %g\n",
        p->duration, p->timestep, p->duration / p->timestep + 1, bytes_of(p) / 1e9, p->duration, p->duration / 1000);
}

// what moves at the start, each joint in a line
static void print_start_speeds(const cav_problem *p) {
  const cav_model *m = p->model;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    const double *v = p->v_start + joint->dof;
    const char *name = *joint->name ? joint->name : m->body[joint->body].name;
    const int n = joint->type == CAV_JOINT_FREE ? 6 : joint->type == CAV_JOINT_BALL ? 3 : 1;
    double most = 0;
    for (int k = 0; k < n; k++) most = fmax(most, fabs(v[k]));
    if (most == 0) continue;
    printf("         '%.60s' moves at ", name);
    if (n == 6) printf("%.3g %.3g %.3g m/s, ", v[0], v[1], v[2]);
    if (n > 1) printf("%.3g %.3g %.3g rad/s about its own axes\n", v[n - 3], v[n - 2], v[n - 1]);
    if (n == 1) printf("%.3g %s\n", v[0], joint->type == CAV_JOINT_SLIDE ? "m/s" : "rad/s");
  }
}

// how a solve begins where that is not the guess above, and all that it may try; what cannot be planned has none
static cav_status print_strategies(const cav_problem *p, int all) {
  if (cav_command_count_planned(p->model) != p->model->nu) return CAV_OK;
  cav_strategy *strategy = calloc(CAV_STRATEGIES, sizeof *strategy);
  int n = 0;
  cav_status status = strategy ? cav_strategy_list(p, strategy, &n) : CAV_NO_MEMORY;
  if (!status && n > 0) cav_command_tell_begin(stdout, "  ", strategy);
  int near = 0, mended = 0;
  if (!status && all) printf("strategies in the order in which solve tries them, until one does all that is asked\n");
  for (int i = 0; i < n && !status && all; i++) {
    near += strategy[i].use == CAV_STRATEGY_NEAR, mended += strategy[i].use == CAV_STRATEGY_REPAIR;
    if (strategy[i].use == CAV_STRATEGY_NEAR || strategy[i].use == CAV_STRATEGY_REPAIR) continue;
    printf("  %-12s %s\n", strategy[i].name, strategy[i].text);
  }
  if (near) printf("  near-1..%d   between these, what is nearly there with the usual cure of what it misses\n", near);
  if (mended)
    printf("  repair-1..%d  at last, the best one so far with the usual cure of what it misses first\n", mended);
  cav_strategies_clear(strategy, n);
  free(strategy);
  return status;
}

cav_status cav_command_print_problem(const cav_problem *p, int all, cav_error *error) {
  static const char *const order[] = {"euler", "midpoint", "momentum"};
  int knots = (int)lround(p->duration / p->timestep) + 1;
  printf("problem %s\n", p->name[0] ? p->name : "without a name");
  printf("  %g s in %d knots of %g s, order %s, %s\n", p->duration, knots, p->timestep, order[p->order],
         p->cycle.on        ? "a cycle"
         : p->close_at_rest ? "at rest after the last knot"
                            : "open after the last knot");
  cav_command_tell_step(stdout, p);
  cav_command_tell_units(stdout, p);
  cav_command_tell_equalities(stdout, p);
  cav_command_tell_postures(stdout, p);
  cav_command_tell_demands(stdout, p);
  cav_command_tell_goal(stdout, p);
  cav_command_tell_axes(stdout, p);
  cav_command_tell_guess(stdout, p, 1);
  if (p->duration_most > 0)
    printf("  duration free from %g to %g s, weight %g\n", p->duration_least, p->duration_most, p->duration_weight);
  if (p->cycle.on)
    printf("  a %s moves by %g %g %g m, %.3g m/s on average, and turns by %g degrees%s\n",
           p->cycle.mirror == CAV_MIRROR_NONE ? "period" : "half stride", p->cycle.translation[0],
           p->cycle.translation[1], p->cycle.translation[2],
           hypot(p->cycle.translation[0], p->cycle.translation[1]) / p->duration, p->cycle.rotation * 180 / M_PI,
           p->cycle.mirror == CAV_MIRROR_X   ? ", mirrored along x"
           : p->cycle.mirror == CAV_MIRROR_Y ? ", mirrored along y"
                                             : "");
  cav_command_tell_asymmetry(p, stdout);
  cav_status status = cav_command_print_stance(p, "start", p->q_start, 0, all, error);
  if (!status && !p->cycle.on) print_start_speeds(p);
  if (!status && cav_problem_has_goal(p))
    status = cav_command_print_stance(p, "goal", p->q_goal, p->close_at_rest, all, error);
  if (status) return status;
  if (!cav_problem_has_goal(p)) printf("  goal   no <goal>: the goal posture is the start\n");
  if (*cav_problem_lowered(p))
    printf("  note: height=\"floor\" of %s; <root joint=\"...\" height=\"keep\"/> in it leaves a body in the air\n",
           cav_problem_lowered(p));
  if (*cav_problem_buried(p))
    printf("  note: height=\"floor\" of %s. Change Z of its <root pos=\"X Y Z\">\n", cav_problem_buried(p));
  printf("  %d unknowns%s; the guess %s",
         (knots - 1 + 2 * (p->free_start != 0)) * p->model->nv + (p->duration_most > 0),
         p->free_start ? ", with posture and velocity at the start" : "",
         p->guess == CAV_GUESS_HOLD   ? "holds the start"
         : p->guess == CAV_GUESS_PUMP ? "is simulated, pumping energy"
         : cav_problem_has_goal(p)    ? "goes from start to goal"
                                      : "stays at the start, as there is no goal");
  if (p->nguess_pose > 0) printf(" by %d postures", p->nguess_pose);
  if (p->guess_height > 0) printf(", with an arc of %g m from %g to %g s", p->guess_height, p->guess_from, p->guess_to);
  if (p->guess_bow[0] != 0 || p->guess_bow[1] != 0)
    printf(", with a bow of %g %g m from %g to %g s", p->guess_bow[0], p->guess_bow[1], p->guess_from, p->guess_to);
  printf("\n");
  if ((status = print_strategies(p, all))) return status;
  // of a model that solve refuses there are none
  if (all && cav_command_count_planned(p->model) == p->model->nu && (status = print_equations(p, error))) return status;
  printf("  actuators up to %g of their limits, joints and tendons %g rad or m inside theirs\n", p->effort_limit,
         p->limit_margin);
  print_terms(p, 0, all);
  if (!all) print_running(p);
  if (*cav_problem_replaced(p)) printf("  note: %s: state that again where it is wanted\n", cav_problem_replaced(p));
  print_terms(p, 1, all);
  status = cav_command_print_asked(p, error);
  if (!status && !all) printf("\n");
  if (status || !all) return status;
  const cav_stage_options *a = &p->schedule.first, *b = &p->schedule.last;
  printf("schedule: %d stages, geometric; contacts that slide by %s law, %s gap and %s slip after the step\n",
         p->schedule.stages, p->schedule.sliding == CAV_SLIDING_CONVEX ? "the convex" : "Coulomb's",
         p->schedule.next_gap == CAV_NEXT_GAP_EXACT ? "exact" : "linear",
         p->schedule.next_slip == CAV_NEXT_SLIP_EXACT ? "exact" : "linear");
  print_stage_ends(a, b);
  return CAV_OK;
}
