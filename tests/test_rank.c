/// Which of two motions is kept where neither is certified, by each condition of a certificate in its order; what is near one;
/// and when mending has had its time.
#include "check.h"
#include "rank.h"

// one that keeps every condition of a certificate
static cav_race_report whole(void) {
  return (cav_race_report){
      .solution = 1, .verdict = {.has_gains = 1, .closed_loop_seconds = 2, .model_contacts_seconds = 2, .duration = 2}};
}

// what is missed later, by however much, is the better one, and of the same the lesser; what is kept is not compared
static void test_better(void) {
  enum { CONDITIONS = 9 };
  cav_race_report little[CONDITIONS], much[CONDITIONS];
  for (int k = 0; k < CONDITIONS; k++) {
    for (int far = 0; far < 2; far++) {
      cav_race_report r = whole();
      cav_verdict *v = &r.verdict;
      double *const value[CONDITIONS] = {
          &v->unactuated_force_max, &v->limit_violation_max,   &v->constraint_violation_max,
          &v->penetration_max_m,    &v->penetration_between_m, &v->momentum_defect_rms,
          &v->slip_mean_m_s,        &v->hover_fraction,        &v->replay_step_max_error};
      static const double most[CONDITIONS] = {
          CAV_TOLERANCE_UNACTUATED,  CAV_TOLERANCE_LIMIT,       CAV_TOLERANCE_CONSTRAINT,
          CAV_TOLERANCE_PENETRATION, CAV_TOLERANCE_PENETRATION, CAV_TOLERANCE_MOMENTUM,
          CAV_TOLERANCE_SLIP,        CAV_TOLERANCE_HOVER,       CAV_TOLERANCE_STEP};
      // kept conditions are worst where they are kept: none of that counts
      for (int i = 0; i < CONDITIONS; i++) *value[i] = far ? 0 : 0.9 * most[i];
      *value[k] = (far ? 5 : 2) * most[k];
      *(far ? &much[k] : &little[k]) = r;
    }
  }
  for (int k = 0; k < CONDITIONS; k++) {
    CHECK(cav_rank_better(&little[k], &much[k], 0) && !cav_rank_better(&much[k], &little[k], 0));
    for (int later = k + 1; later < CONDITIONS; later++)
      CHECK(cav_rank_better(&much[later], &little[k], 0) && !cav_rank_better(&little[k], &much[later], 0));
  }
  // then closed loops: that of the plan, then that under the model's contacts
  cav_race_report lost = whole(), sooner = whole(), other = whole();
  lost.verdict.closed_loop_seconds = 1.5, sooner.verdict.closed_loop_seconds = 1;
  other.verdict.model_contacts_seconds = 1;
  CHECK(cav_rank_better(&lost, &sooner, 0) && cav_rank_better(&other, &lost, 0) && !cav_rank_better(&lost, &other, 0));
  sooner = other, sooner.verdict.model_contacts_seconds = 0.5;
  CHECK(cav_rank_better(&other, &sooner, 0) && !cav_rank_better(&sooner, &other, 0));
}

// one that is certified and does something else comes after one that does what was asked and loses its loop, that after one
// that is certified and misses some of it; what has a force from nowhere comes last
static void test_asked(void) {
  enum { CLASSES = 5 };
  cav_race_report r[CLASSES];
  for (int k = 0; k < CLASSES; k++) r[k] = whole(), r[k].verdict.ntarget = 3, r[k].cost = CLASSES - k;
  r[0].verdict.achieved = 1, r[0].verdict.unactuated_force_max = 1;
  r[1].verdict.certified = 1, r[1].verdict.nmissed = 2;
  r[2].verdict.achieved = 1, r[2].verdict.closed_loop_seconds = 1;
  r[3].verdict.certified = 1, r[3].verdict.nmissed = 1;
  r[4].verdict.certified = r[4].verdict.achieved = 1;
  for (int i = 0; i < CLASSES; i++)
    for (int k = 0; k < i; k++) {
      CHECK(cav_rank_better(&r[i], &r[k], 0) && !cav_rank_better(&r[k], &r[i], 0));
      r[i].cost = 10 + i;
      CHECK(cav_rank_better(&r[i], &r[k], 0) && !cav_rank_better(&r[k], &r[i], 0));
    }
}

// one that hangs still is certified, and its end at rest is one of two targets: a swing-up whose forces are off by little is kept
// before it, where it costs a tenth or less; not one whose forces are far off
static void test_undone(void) {
  cav_race_report still = whole(), swings = whole();
  still.verdict.certified = 1, still.verdict.ntarget = 2, still.verdict.nmissed = 1, still.verdict.missed_most = 31;
  swings.verdict.ntarget = 2, swings.verdict.nmissed = 1, swings.verdict.unactuated_force_max = 3e-4;
  swings.verdict.constraint_violation_max = 1.4e-3;
  still.cost = 4939, swings.cost = 22.2;
  CHECK(cav_rank_better(&swings, &still, 0) && !cav_rank_better(&still, &swings, 0));
  swings.cost = 1000;
  CHECK(cav_rank_better(&still, &swings, 0) && !cav_rank_better(&swings, &still, 0));
  swings.cost = 22.2, swings.verdict.unactuated_force_max = 0.07;
  CHECK(cav_rank_better(&still, &swings, 0) && !cav_rank_better(&swings, &still, 0));
  // what misses its target by little is what was asked
  swings.verdict.unactuated_force_max = 3e-4, still.verdict.missed_most = 1.5;
  CHECK(cav_rank_better(&still, &swings, 0) && !cav_rank_better(&swings, &still, 0));
}

// one that leaves a ball where it is, far from where it was to go, has one of three targets alone missed: it is kept before one
// that sends it there and slips, unless that costs a hundredth; and a forward step that has another solution is nearer to a
// certificate than slip of a fifth beyond its tolerance, since it has a cure
static void test_far(void) {
  cav_race_report alone = whole(), sends = whole(), slides = whole();
  alone.verdict.certified = 1, alone.verdict.ntarget = 3, alone.verdict.nmissed = 1, alone.verdict.missed_most = 10;
  sends.verdict.ntarget = slides.verdict.ntarget = 3, sends.verdict.achieved = slides.verdict.achieved = 1;
  sends.verdict.slip_mean_m_s = 1.3 * CAV_TOLERANCE_SLIP, slides.verdict.slip_mean_m_s = 1.2 * CAV_TOLERANCE_SLIP;
  alone.cost = 450, sends.cost = 4.2;
  CHECK(cav_rank_far(&alone) && !cav_rank_far(&sends));
  CHECK(cav_rank_better(&sends, &alone, 0) && !cav_rank_better(&alone, &sends, 0));
  alone.verdict.missed_most = 3;
  CHECK(!cav_rank_far(&alone) && cav_rank_better(&alone, &sends, 0));
  cav_race_report folds = whole();
  folds.verdict.ntarget = 3, folds.verdict.achieved = 1, folds.verdict.replay_step_max_error = 4e-4;
  CHECK(cav_rank_nearer(&folds, &slides) && !cav_rank_nearer(&slides, &folds));
}

// what is changed of a problem has to be worth it: another class, or a hundredth of the cost; what achieves what was asked is
static void test_worth(void) {
  cav_race_report stated = whole(), changed = whole();
  stated.verdict.certified = changed.verdict.certified = 1;
  stated.verdict.ntarget = changed.verdict.ntarget = stated.verdict.nmissed = changed.verdict.nmissed = 1;
  stated.cost = 370.22, changed.cost = 369.98;
  CHECK(cav_rank_better(&changed, &stated, 0) && !cav_rank_worth(&changed, &stated));
  changed.cost = 360;
  CHECK(cav_rank_worth(&changed, &stated));
  changed.cost = 400, changed.verdict.ntarget = 3;
  CHECK(cav_rank_worth(&changed, &stated));
  changed.verdict.achieved = stated.verdict.achieved = 1, changed.verdict.nmissed = stated.verdict.nmissed = 0;
  CHECK(cav_rank_worth(&changed, &stated));
}

// mending is put off once it has taken longer than what it mends, and goes on when more was solved
// what is certified, or left before gains were chosen since it misses a target alone, and misses little is mended before anything
// is sought, however long that took so far
static void test_close(void) {
  cav_race_report r = {.solution = 1};
  r.verdict.certified = 1, r.verdict.ntarget = 3, r.verdict.nmissed = 1, r.verdict.missed_most = 1.25;
  CHECK(cav_rank_close(&r));
  r.verdict.missed_most = 1.01 * CAV_MISSED_LITTLE;
  CHECK(!cav_rank_close(&r));
  r.verdict.missed_most = 1.25, r.verdict.certified = 0;
  CHECK(cav_rank_beside(&r.verdict) && cav_rank_close(&r) && cav_rank_near(&r, 0.8));
  r.verdict.has_gains = 1;
  CHECK(!cav_rank_beside(&r.verdict) && !cav_rank_close(&r));
  r.verdict.has_gains = 0, r.verdict.slip_mean_m_s = 1.1 * CAV_TOLERANCE_SLIP;
  CHECK(!cav_rank_beside(&r.verdict) && !cav_rank_close(&r));
}

static void test_spent(void) {
  cav_problem problem = {.timestep = 0.02, .duration = 2};
  cav_race race = {.problem = &problem, .n = 6};
  for (int i = 0; i < race.n; i++) {
    race.entry[i].from = i > 0 && i < 4 ? 0 : -1;
    race.entry[i].state = CAV_RACE_DONE;
    race.entry[i].report = whole();
    race.entry[i].report.verdict.iterations = 400;
  }
  race.entry[4].report.verdict.iterations = 800;
  CHECK(!cav_rank_spent(&race, 1) && !cav_rank_spent(&race, 2) && cav_rank_spent(&race, 3));
  CHECK(cav_rank_spent(&race, 4) && !cav_rank_spent(&race, 5));
  // at half the step an iteration takes twice as long, and what was not solved none
  race.entry[1].strategy.timestep = 0.01;
  CHECK(cav_rank_spent(&race, 2));
  race.entry[1].state = CAV_RACE_WAITING;
  CHECK(!cav_rank_spent(&race, 3));
}

// what does something else than was asked is not near it, however little it misses of a certificate
static void test_near(void) {
  for (int limits = 0; limits < 2; limits++) {
    cav_race_report r = whole();
    r.verdict.ntarget = 3;
    *(limits ? &r.verdict.limit_violation_max : &r.verdict.slip_mean_m_s) =
        2 * (limits ? CAV_TOLERANCE_LIMIT : CAV_TOLERANCE_SLIP);
    for (int missed = 0; missed <= 3; missed++) {
      r.verdict.nmissed = missed;
      CHECK(cav_rank_near(&r, 0.8) == (missed < 2));
    }
  }
}

// each figure of a certificate is little missed up to eight times its tolerance
static void test_momentum(void) {
  for (int times = 3; times <= 9; times += 3) {
    cav_race_report slides = whole(), turns = whole();
    slides.verdict.slip_mean_m_s = times * CAV_TOLERANCE_SLIP;
    turns.verdict.momentum_defect_rms = times * CAV_TOLERANCE_MOMENTUM;
    cav_race_report hovers = whole();
    hovers.verdict.hover_fraction = times * CAV_TOLERANCE_HOVER;
    CHECK(cav_rank_rough(&slides.verdict) == (times < 8) && cav_rank_rough(&turns.verdict) == (times < 8));
    CHECK(cav_rank_rough(&hovers.verdict) == (times < 8));
  }
}

// harder contacts mend what is in something by a little; what is deep in itself is another motion
static void test_deep(void) {
  for (int between = 0; between < 2; between++)
    for (int times = 1; times <= 3; times++) {
      cav_race_report r = whole(), slides = whole();
      *(between ? &r.verdict.penetration_between_m : &r.verdict.penetration_max_m) =
          0.95 * times * CAV_TOLERANCE_PENETRATION;
      slides.verdict.slip_mean_m_s = 1.5 * CAV_TOLERANCE_SLIP;
      CHECK(cav_rank_near(&r, 0.8) == (times < 3));
      if (times == 2) CHECK(!cav_rank_nearer(&r, &slides) && cav_rank_nearer(&slides, &r));
      r.verdict.limit_violation_max = 0.05;
      CHECK(cav_rank_near(&r, 0.8) == (times < 2));
    }
}

// a cure that left nearly all of what was missed most did not help, nor one that did so of targets; nothing is known where
// something else is missed now, where nothing is, or where forces are missing
static void test_helped(void) {
  cav_race_report before = whole(), after = whole();
  cav_verdict *a = &after.verdict, *b = &before.verdict;
  b->slip_mean_m_s = 2 * CAV_TOLERANCE_SLIP, b->hover_fraction = 1.1 * CAV_TOLERANCE_HOVER;
  a->slip_mean_m_s = 1.96 * CAV_TOLERANCE_SLIP;
  CHECK(!cav_rank_helped(a, b));
  a->slip_mean_m_s = 1.8 * CAV_TOLERANCE_SLIP;
  CHECK(cav_rank_helped(a, b));
  a->slip_mean_m_s = 2.2 * CAV_TOLERANCE_SLIP;
  CHECK(!cav_rank_helped(a, b));
  a->hover_fraction = 2.5 * CAV_TOLERANCE_HOVER;
  CHECK(cav_rank_helped(a, b));
  a->hover_fraction = a->slip_mean_m_s = 0;
  CHECK(cav_rank_helped(a, b));
  a->slip_mean_m_s = 2.2 * CAV_TOLERANCE_SLIP, a->unactuated_force_max = 1;
  CHECK(cav_rank_helped(a, b));
  // targets alone: fewer, or by a twentieth less
  a->certified = b->certified = 1, a->nmissed = b->nmissed = 2;
  a->missed_most = 1.9, b->missed_most = 1.95;
  CHECK(!cav_rank_helped(a, b));
  a->missed_most = 1.8;
  CHECK(cav_rank_helped(a, b));
  a->missed_most = 2.5, a->nmissed = 1;
  CHECK(cav_rank_helped(a, b));
}

// a certified motion is near where it misses few targets, or none by much
static void test_off(void) {
  cav_race_report r = whole();
  r.verdict.certified = 1, r.verdict.ntarget = 3;
  static const double off[] = {1.1, 1.9, 2.1};
  for (int missed = 1; missed <= 3; missed++) {
    for (int k = 0; k < 3; k++) {
      r.verdict.nmissed = missed, r.verdict.missed_most = off[k];
      CHECK(cav_rank_near(&r, 0.8) == (missed == 1 || k < 2));
    }
  }
  r.verdict.achieved = 1, r.verdict.nmissed = 0, r.verdict.missed_most = 0;
  CHECK(!cav_rank_near(&r, 0.8));
}

// of certified motions that miss targets the one with fewer is mended, then the one that is less off, whatever they cost
static void test_nearer(void) {
  cav_race_report one = whole(), other = whole();
  one.verdict.certified = other.verdict.certified = 1;
  one.verdict.nmissed = 1, one.verdict.missed_most = 1.9, one.cost = 2;
  other.verdict.nmissed = 2, other.verdict.missed_most = 1.1, other.cost = 1;
  CHECK(cav_rank_nearer(&one, &other) && !cav_rank_nearer(&other, &one));
  other.verdict.nmissed = 1;
  CHECK(!cav_rank_nearer(&one, &other) && cav_rank_nearer(&other, &one));
  // what was left before gains were chosen is not taken for one that is lost at once
  cav_race_report left = whole(), lost = whole();
  left.verdict.certified = lost.verdict.certified = 0;
  left.verdict.slip_mean_m_s = 2 * CAV_TOLERANCE_SLIP, lost.verdict.slip_mean_m_s = 3 * CAV_TOLERANCE_SLIP;
  left.verdict.has_gains = 0, left.verdict.closed_loop_seconds = left.verdict.model_contacts_seconds = 0.1;
  CHECK(cav_rank_nearer(&left, &lost) && !cav_rank_nearer(&lost, &left));
  // what is not certified comes after them
  other.verdict.certified = 0, other.verdict.slip_mean_m_s = 2 * CAV_TOLERANCE_SLIP;
  CHECK(cav_rank_nearer(&one, &other) && !cav_rank_nearer(&other, &one));
}

int main(void) {
  test_better();
  test_asked();
  test_undone();
  test_far();
  test_worth();
  test_near();
  test_off();
  test_nearer();
  test_spent();
  test_close();
  test_momentum();
  test_deep();
  test_helped();
  return check_result();
}
