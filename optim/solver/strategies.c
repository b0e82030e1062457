/// Ways to a motion: guesses and schedules to start from where the one that a problem states does not lead to a
/// certificate. Data only: a caller solves them one after the other, or at once in processes of its own, and keeps what
/// it likes.
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bypass.h"
#include "carry.h"
#include "clear.h"
#include "continuation.h"
#include "detour.h"
#include "gait.h"
#include "hand.h"
#include "leap.h"
#include "pump.h"
#include "quantity.h"
#include "reach.h"
#include "sampling.h"
#include "thing.h"
#include "upright.h"

/// Over obstacles limbs swing as much wider and slower.
static const double wide = 1.6, leisure = 0.6;

/// How much softer and how much slower than stated, how much stronger the actuators of a diagnosis are,
/// how many repairs there are at the end, and of what is nearly there by the stated guess and by another one.
enum { SOFTER = 2, CHEAPER = 10, SLOWER = 2, STRONGER = 2, REPAIRS = 4, MEND_STATED = 4, MEND = 2, MEND_LAST = 4 };

/// s: shorter steps are not halved by a strategy of its own.
static const double coarse = 0.015;

/// What the strategy `line` is, wherever it stands in the list.
static const char straight[] = "straight from start to goal";

/// Dofs up to which sampling takes less time than another solve.
enum { TINY = 5 };

static void add(cav_strategy *strategy, int *n, const cav_strategy *from, const char *name, const char *text) {
  assert(*n < CAV_STRATEGIES);
  strategy[*n] = *from;
  strategy[*n].name = name;
  strategy[*n].text = text;
  ++*n;
}

// what is nearly there is mended before anything else is tried
static void add_near(cav_strategy *strategy, int *n, const cav_strategy *stated, int times) {
  static const char *const name[] = {
      "near-1",  "near-2",  "near-3",  "near-4",  "near-5",  "near-6",  "near-7",  "near-8",  "near-9",  "near-10",
      "near-11", "near-12", "near-13", "near-14", "near-15", "near-16", "near-17", "near-18", "near-19", "near-20",
      "near-21", "near-22", "near-23", "near-24", "near-25", "near-26", "near-27", "near-28", "near-29", "near-30"};
  cav_strategy repaired = *stated;
  repaired.use = CAV_STRATEGY_NEAR;
  size_t before = 0;
  for (int i = 0; i < *n; i++) before += strategy[i].use == CAV_STRATEGY_NEAR;
  for (int k = 0; k < times; k++) {
    assert(before < sizeof name / sizeof *name);
    add(strategy, n, &repaired, name[before++], "where it is nearly there, with the usual cure of what it misses");
  }
}

static void add_repairs(cav_strategy *strategy, int *n, const cav_strategy *stated) {
  static const char *const repair[] = {"repair-1", "repair-2", "repair-3", "repair-4"};
  cav_strategy repaired = *stated;
  repaired.use = CAV_STRATEGY_REPAIR;
  for (int k = 0; k < REPAIRS; k++)
    add(strategy, n, &repaired, repair[k], "the best one so far, with the usual cure of what it misses first");
}

/// Whether a motion is wanted near a record, which is its guess.
static int is_recorded(const cav_problem *problem) {
  for (int i = 0; i < problem->nterm; i++)
    if (problem->term[i].quantity == CAV_QUANTITY_TRACK) return problem->nguess_pose > 0;
  return 0;
}

/// Over solids by a gait with wide and slow swings; none where the model has no gait.
static cav_strategy over_solids(const cav_strategy *walk) {
  cav_strategy step = *walk;
  for (int i = 0; i < step.nswing; i++) step.swing[i].amplitude *= wide, step.swing[i].frequency *= leisure;
  step.text = "over solids, which grow from soft to hard, with the limbs that carry swinging in turn";
  return step;
}

/// Start held, an arc over what stands in between, goal held; none where height is 0.
static cav_status flight(const cav_problem *problem, cav_strategy *strategy) {
  for (int k = 0; k < 3; k++)
    if (problem->guess_rotation[k] != 0) return CAV_OK;
  cav_status status = cav_flight_find(problem, &strategy->height, &strategy->from, &strategy->to);
  cav_problem taken = *problem;
  if (!status && strategy->height > 0)
    cav_flight_apply(strategy->height, strategy->from, strategy->to, strategy->pose, &taken), strategy->flies = 1;
  return status;
}

/// Whether a strategy's guess is the problem's own, as where a file states the flight that would be found for it.
static cav_status is_own_guess(const cav_problem *problem, const cav_strategy *strategy, int *same) {
  static const double little = 1e-3; // m or rad
  cav_problem taken;
  cav_error error = {0};
  cav_strategy_apply(problem, strategy, &taken);
  cav_trajectory *own = cav_problem_guess(problem, &error), *other = own ? cav_problem_guess(&taken, &error) : NULL;
  *same = own && other && own->nknot == other->nknot;
  for (int i = 0; *same && i < own->nknot * own->nq; i++) *same = fabs(own->q[i] - other->q[i]) <= little;
  cav_trajectory_free(own);
  cav_trajectory_free(other);
  return error.status == CAV_NO_MEMORY ? CAV_NO_MEMORY : CAV_OK;
}

/// A strategy, and what mends it where that is nearly there.
static void add_mended(cav_strategy *strategy, int *n, const cav_strategy *from, const char *name) {
  add(strategy, n, from, name, from->text);
  add_near(strategy, n, from, MEND);
}

/// Puts a strategy in the place of the stated one: a file without a guess is begun so.
static void begin_with(cav_strategy *strategy, const cav_strategy *first) {
  const char *name = strategy[0].name;
  strategy[0] = *first;
  strategy[0].name = name;
}

/// As the first one, at half the step: where limbs are fast, or what is leant on is small, the stated one is too long for their
/// forces.
static void add_fine(const cav_problem *problem, cav_strategy *strategy, int *n) {
  if (problem->timestep < coarse || problem->duration_most > 0) return;
  cav_strategy fine = strategy[0];
  fine.timestep = problem->timestep / 2;
  snprintf(fine.changed, sizeof fine.changed, "timestep=\"%g\"", fine.timestep);
  add(strategy, n, &fine, "fine", "as the first one, at half the step");
  add_near(strategy, n, &strategy[0], MEND);
}

/// Where the guess runs into solids: by a flight where an arc is stated; over them, then as it is, then by a flight of its
/// own; what they miss is mended before anything else is tried. A file without a guess is begun over them: the straight
/// way through a solid is nobody's. led: it is begun with hands led.
static void add_grown(const cav_problem *problem, cav_strategy *strategy, int *n, const cav_strategy *grown,
                      const cav_strategy *walk, const cav_strategy *fly, int led) {
  cav_strategy step = over_solids(walk);
  if (fly->height > 0 && problem->guess_height > 0) add_mended(strategy, n, fly, "flight");
  if (step.nswing && !cav_guess_is_decorated(problem) && problem->guess == CAV_GUESS_INTERPOLATE && !led) {
    begin_with(strategy, &step);
  } else if (step.nswing) {
    add_mended(strategy, n, &step, "step");
  }
  cav_strategy solids = *grown;
  solids.text = "lifted out of the solids that the guess runs into, which grow from soft to hard";
  add_mended(strategy, n, &solids, "solids");
  if (fly->height > 0 && problem->guess_height <= 0) add_mended(strategy, n, fly, "flight");
  add_fine(problem, strategy, n);
  add_repairs(strategy, n, grown);
}

/// Whether the goal is the start.
static int is_back(const cav_problem *problem) {
  for (int i = 0; i < problem->model->nq; i++)
    if (problem->q_goal[i] != problem->q_start[i]) return 0;
  return 1;
}

/// A file without a guess whose straight way goes through the ground is begun with the start held: such a way is nobody's.
static cav_status hold_over_ground(const cav_problem *problem, cav_strategy *begun, int *sinks) {
  *sinks = 0;
  if (problem->cycle.on || problem->guess != CAV_GUESS_INTERPOLATE) return CAV_OK;
  cav_status status = cav_guess_sinks(problem, sinks);
  if (*sinks) begun->guess = CAV_GUESS_HOLD, begun->stated = 0, begun->text = "with the start held";
  return status;
}

/// Guesses of a problem from which strategies begin.
typedef struct guesses {
  cav_strategy stated, plain, walk, fly; ///< straight from start to goal; with limbs swinging; by a flight
  cav_strategy detour, reach;            ///< round what the straight way runs into; to what terms of the end ask for
  cav_strategy bypass;                   ///< round what it runs into, on the ground
  int collides, decorated, sinks;        ///< what the stated guess does, and is
  int pivots;                            ///< 1: it turns four feet or more on the spot, where they stand
  int met;                               ///< 1: it is begun with what is moved staying until it is met
  int led;                               ///< 1: a file without a guess is begun with hands led
} guesses;

/// With what no actuator moves kept upright. What tips is not mended by what else is missed, so this comes first where terms
/// bring hands to it; elsewhere it stands still until something is brought to it.
static cav_status add_upright(const cav_problem *problem, cav_strategy *strategy, int *n, const cav_strategy *stated) {
  const int more = cav_upright_terms(problem, NULL);
  if (more == 0) return CAV_OK;
  cav_strategy kept = *stated;
  kept.nterm = problem->nterm + more;
  kept.term = calloc((size_t)kept.nterm, sizeof *kept.term);
  if (!kept.term) return CAV_NO_MEMORY;
  memcpy(kept.term, problem->term, (size_t)problem->nterm * sizeof *kept.term);
  cav_upright_terms(problem, kept.term + problem->nterm);
  for (int i = problem->nterm; i < kept.nterm; i++) {
    const size_t used = strlen(kept.changed);
    cav_upright_describe(problem, &kept.term[i], kept.changed + used, sizeof kept.changed - used);
  }
  memmove(kept.changed, kept.changed + 2, strlen(kept.changed + 2) + 1);
  add(strategy, n, &kept, "upright", "with a cost on how far what no actuator moves is turned from how it stands");
  return CAV_OK;
}

/// Whether all that is driven hangs on the world by joints that are driven, too: arms, not what could walk.
static int hangs(const cav_model *m) {
  int driven = 0;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    if (!joint->driven) continue;
    const cav_link *root = &m->link[m->link[joint->link].root];
    for (int i = root->joint; i < root->joint + root->njoint; i++)
      if (!m->joint[i].driven) return 0;
    driven = 1;
  }
  return driven;
}

/// An arm nearer to the posture of its goal: folded up it takes less effort, and rests and scrapes on its own base.
static cav_status add_posture(const cav_problem *problem, cav_strategy *strategy, int *n, const cav_strategy *stated) {
  static const double nearer = 10;
  int found = -1;
  for (int i = 0; i < problem->nterm && found < 0; i++) {
    const cav_term *term = &problem->term[i];
    const int whole = term->from == 0 && (term->to < 0 || term->to >= problem->duration);
    if (term->quantity == CAV_QUANTITY_CONFIGURATION && term->use == CAV_USE_COST && whole && term->weight > 0)
      found = i;
  }
  if (found < 0 || problem->model->npair == 0 || !hangs(problem->model) || problem->cycle.on) return CAV_OK;
  cav_strategy kept = *stated;
  kept.nterm = problem->nterm;
  kept.term = calloc((size_t)kept.nterm, sizeof *kept.term);
  if (!kept.term) return CAV_NO_MEMORY;
  memcpy(kept.term, problem->term, (size_t)problem->nterm * sizeof *kept.term);
  kept.term[found].weight *= nearer;
  snprintf(kept.changed, sizeof kept.changed, "<posture weight=\"%g\"/>", kept.term[found].weight);
  add(strategy, n, &kept, "posture", "with ten times the cost on the way from the posture of the goal");
  return CAV_OK;
}

/// What has terms or a step of its own begins with the guess that the first one begins with after all.
static void begin_changed(cav_strategy *strategy, int n) {
  for (int i = 1; i < n; i++) {
    if (!*strategy[i].changed) continue;
    const cav_strategy kept = strategy[i];
    strategy[i] = strategy[0];
    strategy[i].name = kept.name, strategy[i].text = kept.text, strategy[i].term = kept.term,
    strategy[i].nterm = kept.nterm, strategy[i].timestep = kept.timestep;
    strategy[i].schedule.light_avoided = kept.schedule.light_avoided;
    strategy[i].schedule.calm = kept.schedule.calm;
    memcpy(strategy[i].changed, kept.changed, sizeof kept.changed);
  }
}

/// With costs on the forces of what is to be avoided that grow over the stages: soft contacts press from afar.
static void add_avoiding(const cav_problem *problem, cav_strategy *strategy, int *n, const cav_strategy *stated) {
  cav_strategy light = *stated;
  int avoids = 0;
  for (int i = 0; i < problem->nterm; i++) avoids |= cav_term_avoids(problem->model, &problem->term[i]);
  if (!avoids || problem->schedule.light_avoided) return;
  light.schedule.light_avoided = 1;
  snprintf(light.changed, sizeof light.changed, "light_avoided=\"true\"");
  add(strategy, n, &light, "avoid", "as the first one, with costs on what is to be avoided that grow over the stages");
  add_near(strategy, n, stated, MEND);
}

/// With costs on the turning of roots that are heavier before the last stage: a way over the ground or over solids on which the
/// trunk keeps still is often the better one, and easier to follow.
static void add_calm(const cav_problem *problem, cav_strategy *strategy, int *n, const cav_strategy *stated) {
  cav_strategy calm = *stated;
  int turns = 0;
  for (int i = 0; i < problem->nterm; i++) turns |= cav_term_calms(&problem->term[i]);
  const int floats = cav_first_free(problem->model) >= 0;
  if (!turns || !floats || problem->schedule.calm || problem->guess != CAV_GUESS_INTERPOLATE) return;
  calm.schedule.calm = 1;
  snprintf(calm.changed, sizeof calm.changed, "calm=\"true\"");
  add(strategy, n, &calm, "calm",
      "as the first one, with costs on the turning of roots that are heavier before the last stage");
  add_near(strategy, n, stated, MEND);
}

/// The stated guess, which is begun without the joints that its postures would have beyond the model's ranges, then with them
/// at these ranges' ends; and under another order first.
static cav_status add_stated(const cav_problem *problem, cav_strategy *strategy, int *n, const cav_strategy *stated) {
  const int left = problem->guess_left && !problem->cycle.on;
  if (left) strategy[0].left = 1, strategy[0].text = "the problem's guess without the joints that it has beyond ranges";
  const cav_status status = cav_upright_held(problem) ? add_upright(problem, strategy, n, stated) : CAV_OK;
  add_near(strategy, n, stated, MEND_STATED);
  if (left) {
    add(strategy, n, stated, "clipped", "the problem's guess, joints that it has beyond ranges at the ends of these");
    add_near(strategy, n, stated, MEND);
  }
  if (problem->order != CAV_ORDER_MOMENTUM) return status;
  cav_strategy twice = *stated;
  twice.first_midpoint = 1;
  add(strategy, n, &twice, "midpoint", "under the midpoint order first, then from there under the order of momentum");
  return status;
}

static cav_status add_pumped(const cav_problem *problem, cav_strategy *strategy, int *n, int *swings_up) {
  cav_strategy pump = {.guess = CAV_GUESS_PUMP, .order = CAV_ORDER_MOMENTUM, .schedule = problem->schedule};
  *swings_up = 0;
  cav_status status = problem->guess == CAV_GUESS_PUMP ? CAV_OK : cav_pump_needed(problem, swings_up);
  if (status == CAV_OK && *swings_up)
    add(strategy, n, &pump, "pump", "energy pumped in, too little at a time for the way from start to goal");
  return status;
}

/// From the best of many simulated motions, where a model is small enough for that. number: of their draws.
static void add_sampled(const cav_problem *problem, cav_strategy *strategy, int *n, int number) {
  cav_strategy sampled = {.samples = number, .order = problem->order, .schedule = problem->schedule};
  sampled.text = "from the best of some thousands of simulated motions";
  if (cav_sample_serves(problem)) add_mended(strategy, n, &sampled, number == 1 ? "sample" : "resample");
}

/// What is moved stays until a term brings something to it: straight to its goal it would be gone before that.
static cav_status lie_until_met(const cav_problem *problem, const cav_strategy *stated, cav_strategy *strategy,
                                guesses *g) {
  const cav_model *m = problem->model;
  if (g->decorated || g->collides || g->sinks || problem->guess != CAV_GUESS_INTERPOLATE) return CAV_OK;
  cav_state *state = cav_state_new(m);
  cav_thing thing = {.link = 0};
  const cav_status status = state ? cav_thing_find(problem, 1, state, &thing) : CAV_NO_MEMORY;
  cav_state_free(state);
  const cav_link *link = &m->link[thing.link];
  if (status || !thing.link || link->root != thing.link || link->njoint != 1 || !(thing.met > 0)) return status;
  cav_strategy lies = *stated;
  lies.stated = 0, lies.met = thing.met, lies.moved = link->joint;
  lies.text = "with what has to move staying where it is until a term brings something to it";
  begin_with(strategy, &lies);
  g->met = 1;
  return CAV_OK;
}

/// With hands brought first to what has to be pushed, carried or touched: both of what stands on a free base, or else one.
/// A file without a guess whose terms bring no hands there is begun so.
static cav_status add_pushed(const cav_problem *problem, cav_strategy *strategy, int *n, const cav_strategy *stated,
                             guesses *g) {
  cav_hand hand = {.found = 0};
  cav_carry carry;
  cav_strategy push = *stated;
  if (problem->cycle.on) return CAV_OK;
  cav_status status = lie_until_met(problem, stated, strategy, g);
  if (!status) status = cav_carry_find(problem, 1, &carry);
  if (!status && !carry.found) status = cav_hand_find(problem, 1, &hand);
  if (status || (!carry.found && !hand.found)) return status;
  push.hand = carry.found ? 2 : 1;
  // what goes over solids is led clear of them, and arms that hang are no reason to lift who carries it
  if (carry.found && carry.over > 0) push.schedule.solids = problem->schedule.solids;
  push.text =
      carry.found
          ? carry.lifts
                ? "with both hands brought first to the sides of what has to be lifted, the body going along"
                : "with both hands brought first to the side that what has to move is pushed from, the body going along"
      : hand.touches
          ? "with what is to touch brought there first, contacts sharp from there on"
          : "with a hand brought first to the side that what has to move is pushed from, contacts sharp from there on";
  // a door swings by little: what pushes it is often found by the stated guess
  const int hung = carry.hung || hand.hung;
  g->led = (carry.found || (hangs(problem->model) && !hand.touches)) && !hung && !g->decorated &&
           (!g->collides || carry.over > 0) && !g->sinks && problem->guess == CAV_GUESS_INTERPOLATE &&
           !cav_upright_held(problem) && !g->met;
  if (g->led)
    begin_with(strategy, &push);
  else
    add_mended(strategy, n, &push, carry.found && carry.lifts ? "carry" : hand.touches ? "touch" : "push");
  return status;
}

/// The walk, on what is below it. To or from a solid of the world it goes over solids: feet that swing would be caught in what
/// they are to stand on.
static cav_status find_walk(const cav_problem *problem, guesses *g) {
  g->walk.text = "from start to goal with the limbs that carry swinging in turn";
  int turns = 0;
  cav_status status = problem->nswing ? CAV_OK : cav_gait_find(problem, &g->walk, &turns);
  if (status != CAV_OK || g->collides || !g->walk.nswing) return status;
  g->walk.ground = 1;
  int over = 0;
  status = cav_stands_on_solid(problem, &over);
  if (over) g->walk.schedule.solids = CAV_SOLIDS_GROW;
  g->pivots = turns && g->walk.nswing > 2 && !g->decorated && !g->sinks && problem->guess == CAV_GUESS_INTERPOLATE;
  return status;
}

/// Finds the guesses; a file without one whose straight way sinks is begun, strategy[0], with the start held.
static cav_status find_guesses(const cav_problem *problem, const cav_strategy *stated, cav_strategy *strategy,
                               guesses *g) {
  *g = (guesses){.stated = *stated, .decorated = cav_guess_is_decorated(problem)};
  cav_status status = problem->schedule.solids == CAV_SOLIDS_GROW ? CAV_OK : cav_guess_collides(problem, &g->collides);
  if (status == CAV_OK && !g->collides && !g->decorated) status = hold_over_ground(problem, strategy, &g->sinks);
  // all others would run into them, too
  if (g->collides) g->stated.schedule.solids = CAV_SOLIDS_GROW;
  g->plain = g->stated;
  g->plain.guess = CAV_GUESS_INTERPOLATE, g->plain.stated = 0;
  g->walk = g->fly = g->plain;
  if (status == CAV_OK) status = find_walk(problem, g);
  g->detour = g->plain;
  g->detour.text = "bowed round the solids that the straight way runs into";
  g->detour.schedule.solids = problem->schedule.solids;
  if (status == CAV_OK && g->collides && !g->decorated && problem->guess == CAV_GUESS_INTERPOLATE)
    status = cav_detour_find(problem, &g->detour);
  g->bypass = g->detour;
  g->bypass.nswing = g->walk.nswing;
  memcpy(g->bypass.swing, g->walk.swing, sizeof g->walk.swing);
  g->bypass.text = "round what stands in the straight way, on the ground";
  if (status == CAV_OK && g->collides && !g->decorated && problem->guess == CAV_GUESS_INTERPOLATE)
    status = cav_bypass_find(problem, &g->bypass);
  // where the goal is the start, what is asked for at the end is where the way goes
  const int reaches =
      !problem->cycle.on && !g->decorated && problem->guess == CAV_GUESS_INTERPOLATE && is_back(problem);
  g->reach = g->plain;
  g->reach.text = "to a posture that meets what is asked for at the end, round the solids in between";
  g->reach.schedule.solids = problem->schedule.solids;
  if (status == CAV_OK && reaches) status = cav_reach_find(problem, &g->reach);
  g->fly.text = "all of the way by an arc clear of solids, start and goal held before and after it";
  g->fly.schedule.solids = problem->schedule.solids;
  if (status == CAV_OK) status = flight(problem, &g->fly);
  int stated_so = 0;
  if (status == CAV_OK && g->fly.height > 0 && problem->guess_height > 0)
    status = is_own_guess(problem, &g->fly, &stated_so);
  if (stated_so) g->fly.height = 0;
  return status;
}

/// From the straight way and from the start held, where the stated guess is neither.
static void add_plain(const cav_problem *problem, cav_strategy *strategy, int *n, const guesses *g) {
  // where the goal is the start, the way straight to it is the start held
  const int stays = !problem->cycle.on && is_back(problem), holds = problem->guess == CAV_GUESS_HOLD;
  if ((g->decorated || holds || g->sinks || g->pivots) && !g->led && !stays)
    add(strategy, n, &g->plain, "line", straight);
  cav_strategy still = g->plain;
  still.guess = CAV_GUESS_HOLD;
  const int held = !g->decorated && (holds || (stays && problem->guess == CAV_GUESS_INTERPOLATE && !g->reach.nreach));
  if (!problem->cycle.on && !g->sinks && !held) add(strategy, n, &still, "hold", "the start held");
}

/// From other guesses and by other schedules.
static cav_status add_others(const cav_problem *problem, cav_strategy *strategy, int *n, const guesses *g) {
  // a file without a guess is begun so
  if (g->detour.nswing && !g->led) begin_with(strategy, &g->detour);
  const int round = g->bypass.bow[0] != 0 || g->bypass.bow[1] != 0;
  if (g->reach.nreach) begin_with(strategy, &g->reach);
  if (g->collides) add_grown(problem, strategy, n, &g->stated, &g->walk, &g->fly, g->led);
  if (!g->collides && g->fly.height > 0 && problem->guess_height > 0) add_mended(strategy, n, &g->fly, "flight");
  if (round && !g->led) begin_with(strategy, &g->bypass);
  const int pivots = g->pivots && !g->led;
  if (pivots) begin_with(strategy, &g->walk);
  if (g->walk.nswing && !g->collides && !pivots) add_mended(strategy, n, &g->walk, "swing");
  if (!g->collides) add_fine(problem, strategy, n);
  cav_strategy soft = g->stated;
  soft.schedule.first.smoothing *= SOFTER;
  soft.schedule.first.penalty /= CHEAPER;
  add(strategy, n, &soft, "soft", "contacts active from twice as far, unactuated force ten times cheaper at first");
  cav_strategy leap = g->plain;
  leap.text = "straight from start to goal with an arc as high as is asked for";
  cav_status status = problem->guess_height != 0 ? CAV_OK : cav_leap_find(problem, &leap.height, &leap.from, &leap.to);
  if (status != CAV_OK) return status;
  if (leap.height > 0) add_mended(strategy, n, &leap, "leap");
  add_plain(problem, strategy, n, g);
  cav_strategy slow = g->stated;
  slow.schedule.stages *= SLOWER;
  add(strategy, n, &slow, "slow", "twice as many stages");
  return CAV_OK;
}

/// What waits for how all others ended.
static void add_last(const cav_problem *problem, cav_strategy *strategy, int *n, const guesses *g) {
  if (problem->order != CAV_ORDER_MOMENTUM) {
    cav_strategy exact = g->stated;
    exact.order = CAV_ORDER_MOMENTUM, exact.first_midpoint = 1, exact.use = CAV_STRATEGY_MOMENTUM;
    add(strategy, n, &exact, "momentum", "under the order of momentum, from a motion of the midpoint order");
  }
  add_near(strategy, n, &g->stated, MEND_LAST);
  if (!g->collides) add_repairs(strategy, n, &g->stated);
}

/// What tells a cause where none succeeded. fixed: a longer duration tells nothing.
static void add_diagnoses(const cav_problem *problem, cav_strategy *strategy, int *n, const cav_strategy *stated,
                          int fixed) {
  cav_strategy open = *stated, stronger = *stated, longer = *stated;
  open.use = stronger.use = longer.use = CAV_STRATEGY_DIAGNOSIS, open.open = 1;
  stronger.strength = STRONGER;
  if (!problem->cycle.on && problem->close_at_rest)
    add(strategy, n, &open, "open", "with an end that need not be at rest");
  int timed = problem->window > 0;
  for (int i = 0; i < problem->nterm; i++) timed |= problem->term[i].quantity == CAV_QUANTITY_TRACK;
  if (!problem->cycle.on && problem->duration_most == 0 && !fixed && !timed)
    add(strategy, n, &longer, "longer", "with a duration free up to twice the stated one");
  if (problem->model->nu > 0 && !fixed && !timed)
    add(strategy, n, &stronger, "stronger", "with actuators twice as strong");
}

cav_status cav_strategy_list(const cav_problem *problem, cav_strategy strategy[CAV_STRATEGIES], int *n) {
  cav_strategy stated = {.guess = problem->guess, .stated = 1, .order = problem->order, .schedule = problem->schedule};
  *n = 0;
  add(strategy, n, &stated, "stated", "the problem's guess and schedule");
  const int given = cav_problem_is_given(problem) && !problem->cycle.on;
  if (is_recorded(problem) || given) {
    add_repairs(strategy, n, &stated);
    // what is simulated is where it is at its time however long that goes on
    if (given) add_diagnoses(problem, strategy, n, &stated, 1);
    return CAV_OK;
  }
  guesses g;
  int swings_up;
  cav_status status = add_stated(problem, strategy, n, &stated);
  if (status == CAV_OK) add_avoiding(problem, strategy, n, &stated);
  if (status == CAV_OK) add_calm(problem, strategy, n, &stated);
  if (status == CAV_OK) status = find_guesses(problem, &stated, strategy, &g);
  if (status == CAV_OK) status = add_pushed(problem, strategy, n, &stated, &g);
  if (status == CAV_OK && !cav_upright_held(problem)) status = add_upright(problem, strategy, n, &stated);
  // before what else is begun with a hand
  if (status == CAV_OK && g.led) {
    g.plain.text = straight;
    add_mended(strategy, n, &g.plain, "line");
  }
  if (status == CAV_OK) status = add_posture(problem, strategy, n, &stated);
  if (status == CAV_OK) status = add_pumped(problem, strategy, n, &swings_up);
  // what simulates in no time sooner than others are solved
  const int tiny = problem->model->nv <= TINY;
  if (status == CAV_OK && tiny) add_sampled(problem, strategy, n, 1);
  if (status == CAV_OK) status = add_others(problem, strategy, n, &g);
  if (status != CAV_OK) return status;
  for (int number = tiny ? 2 : 1; number <= 2; number++) add_sampled(problem, strategy, n, number);
  begin_changed(strategy, *n);
  add_last(problem, strategy, n, &g);
  // what a swing-up takes is told by cav_problem_pumping
  add_diagnoses(problem, strategy, n, &g.stated, swings_up);
  return CAV_OK;
}
