/// Repairs: what a strategy that is not certified, or misses what was asked, is changed by before it is solved again; by
/// verdicts that are written here, of a problem that is never solved.
#include "biped.h"
#include "continuation.h"
#include "scene.h"

// a biped with a goal and slip, and its stated strategy
typedef struct repaired {
  cav_model *model;
  double q[20], v[20];
  cav_term term[2];
  cav_problem problem;
  cav_strategy stated;
} repaired;

static void repaired_make(repaired *r) {
  *r = (repaired){
      .model = scene_load(BIPED("1")),
      .term = {{.name = "goal", .quantity = CAV_QUANTITY_CONFIGURATION, .weight = 900, .from = 1, .to = 1, .scale = 1},
               {.name = "slip", .quantity = CAV_QUANTITY_SLIP, .weight = 200, .to = -1, .scale = 1}}};
  if (!CHECK(r->model != NULL)) return;
  cav_configuration_reset(r->model, r->q);
  r->problem = cav_problem_default(r->model);
  r->problem.q_start = r->problem.q_goal = r->q, r->problem.v_start = r->v;
  r->problem.term = r->term, r->problem.nterm = 2;
  cav_strategy strategy[CAV_STRATEGIES];
  int n;
  CHECK(cav_strategy_list(&r->problem, strategy, &n) == CAV_OK);
  r->stated = strategy[0];
}

// of momentum, slip and hover what is missed by most of its tolerance is mended, whichever a certificate names first
static void check_most_missed(repaired *r) {
  const cav_verdict base = {.achieved = 1, .closed_loop_seconds = 1};
  static const double value[3][3] = {{0.011, 0.0101, 0.0301}, {0.0051, 0.03, 0.06}, {0.0051, 0.0101, 0.12}};
  static const char *const changed[3] = {"order=\"momentum\"", "<last smoothing=\"0.000125\"/>", "next_gap=\"exact\""};
  for (int k = 0; k < 3; k++) {
    cav_verdict v = base;
    v.momentum_defect_rms = value[k][0], v.slip_mean_m_s = value[k][1], v.hover_fraction = value[k][2];
    cav_strategy mended;
    int found;
    CHECK(cav_strategy_repair(&r->problem, &r->stated, &v, 0, &mended, &found) == CAV_OK && found);
    CHECK(!strcmp(mended.changed, changed[k]));
    cav_strategy_clear(&mended);
  }
}

// a target that is missed though half of the reserve was given weighs ten times as much: one at a time, and one that is held
// over a window by the usual tolerance
static void check_targets(repaired *r) {
  const cav_verdict missed = {.certified = 1, .missed_terms = 1};
  const double from = r->term[0].from;
  for (int held = 0; held < 2; held++) {
    cav_strategy mended;
    int found;
    r->term[0].from = held ? 0.5 : from;
    CHECK(cav_strategy_repair(&r->problem, &r->stated, &missed, 2, &mended, &found) == CAV_OK && found);
    CHECK(mended.nterm == 2 && mended.term[0].weight == 9000 && !strcmp(mended.changed, "weights of goals 10 times"));
    CHECK(!mended.schedule.kinematics);
    cav_strategy_clear(&mended);
    // before that from where it is met by inverse kinematics; once that is so it is no cure
    CHECK(cav_strategy_repair(&r->problem, &r->stated, &missed, 1, &mended, &found) == CAV_OK && found);
    CHECK(mended.term[0].weight == 9000 && mended.schedule.kinematics && mended.effort_limit == r->stated.effort_limit);
    CHECK_TEXT(mended.changed, "weights of goals 10 times, kinematics=\"true\"");
    cav_strategy again;
    CHECK(cav_strategy_repair(&r->problem, &mended, &missed, 1, &again, &found) == CAV_OK && found);
    CHECK_TEXT(again.changed, mended.changed);
    cav_strategy_clear(&again);
    cav_strategy_clear(&mended);
  }
  r->term[0].from = from;
  // what was left beside its targets before it had gains is mended as what is certified beside them; with gains a loop is lost
  for (int gains = 0; gains < 2; gains++) {
    const cav_verdict left = {.missed_terms = 1, .nmissed = 1, .missed_most = 1.5, .has_gains = gains};
    cav_strategy mended;
    int found;
    CHECK(cav_strategy_repair(&r->problem, &r->stated, &left, 0, &mended, &found) == CAV_OK && found);
    CHECK_TEXT(mended.changed, gains ? "<force weight=\"1\"/>" : "weights of goals 3 times");
    cav_strategy_clear(&mended);
  }
  // one that is missed by little weighs as much more as it needs, first of all; then as before
  cav_verdict close = missed;
  static const double by[] = {1.015, 1.9, 2.1};
  static const char *const changed[] = {"weights of goals 2.1 times", "weights of goals 3.8 times",
                                        "<limits effort=\"0.9\"/>"};
  for (int k = 0; k < 3; k++) {
    cav_strategy mended;
    int found;
    close.missed_most = by[k];
    CHECK(cav_strategy_repair(&r->problem, &r->stated, &close, 0, &mended, &found) == CAV_OK && found);
    CHECK(!strcmp(mended.changed, changed[k]));
    cav_strategy_clear(&mended);
    CHECK(cav_strategy_repair(&r->problem, &r->stated, &close, 1, &mended, &found) == CAV_OK && found);
    CHECK(!strcmp(mended.changed, k < 2 ? changed[2] : "weights of goals 10 times, kinematics=\"true\""));
    cav_strategy_clear(&mended);
  }
}

// what slides on its own links is to lean on them less, before smoothing changes: what slides on the ground is not
static void check_rubbing(repaired *r) {
  cav_verdict leans = {.achieved = 1, .hover_fraction = 0.04, .hover_self = 0.9, .closed_loop_seconds = 1};
  for (int self = 1; self >= 0; self--) {
    cav_strategy mended;
    int found;
    leans.hover_self = self ? 0.9 : 0.1;
    CHECK(cav_strategy_repair(&r->problem, &r->stated, &leans, 0, &mended, &found) == CAV_OK && found);
    CHECK(!strcmp(mended.changed, self ? "<last smoothing_self=\"0.0005\"/>" : "next_gap=\"exact\""));
    cav_strategy_clear(&mended);
  }
  cav_verdict slides = {.achieved = 1, .slip_mean_m_s = 0.02, .slip_self = 0.9, .closed_loop_seconds = 1};
  for (int self = 1; self >= 0; self--) {
    cav_strategy mended;
    int found;
    slides.slip_self = self ? 0.9 : 0.1;
    CHECK(cav_strategy_repair(&r->problem, &r->stated, &slides, 0, &mended, &found) == CAV_OK && found);
    if (self)
      CHECK(mended.nterm == 3 && mended.term[2].quantity == CAV_QUANTITY_SELF_FORCE &&
            !strcmp(mended.changed, "<self_force weight=\"1000\"/>"));
    if (!self) CHECK(!strcmp(mended.changed, "<last smoothing=\"0.000125\"/>"));
    cav_strategy_clear(&mended);
  }
}

// an arm that leans on things is kept off them, not one beside a box that it may have to move
static void check_leaning(void) {
  static const char pattern[] =
      "<mujoco><worldbody><geom type='box' size='.1 .1 .1' pos='.6 0 .1'/>"
      "<body pos='0 0 .5'><joint name='a' axis='0 1 0'/><geom type='capsule' fromto='0 0 0 .5 0 0' size='.03'/></body>"
      "%s</worldbody><actuator><motor joint='a' ctrllimited='true' ctrlrange='-9 9'/></actuator></mujoco>";
  static const char *const beside[] = {"", "<body pos='1 0 .1'><freejoint/><geom type='box' size='.1 .1 .1'/></body>"};
  for (int hover = 0; hover < 2; hover++) {
    for (int k = 0; k < 2; k++) {
      char text[700];
      snprintf(text, sizeof text, pattern, beside[k]);
      cav_model *m = scene_load(text);
      if (!CHECK(m != NULL)) return;
      cav_problem p = cav_problem_default(m);
      cav_verdict v = {.achieved = 1, .closed_loop_seconds = 1};
      *(hover ? &v.hover_fraction : &v.slip_mean_m_s) = 0.05;
      cav_strategy stated = {.name = "stated", .stated = 1, .order = p.order, .schedule = p.schedule}, mended;
      int found;
      CHECK(cav_strategy_repair(&p, &stated, &v, 0, &mended, &found) == CAV_OK && found);
      CHECK_TEXT(mended.changed, k == 0  ? "<force weight=\"10000\"/>"
                                 : hover ? "next_gap=\"exact\""
                                         : "<last smoothing=\"0.000125\"/>");
      cav_strategy_clear(&mended);
      cav_model_free(m);
    }
  }
}

// closed loops that are lost: contact forces cost something, then half the step
static void check_loops(repaired *r) {
  const cav_verdict lost = {.achieved = 1};
  cav_problem taken;
  cav_strategy once, twice;
  int found;
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &lost, 0, &once, &found) == CAV_OK && found);
  cav_strategy_apply(&r->problem, &once, &taken);
  CHECK(taken.nterm == 3 && taken.term[2].quantity == CAV_QUANTITY_FORCE && taken.term[2].weight == 1);
  CHECK(taken.timestep == r->problem.timestep && !strcmp(once.changed, "<force weight=\"1\"/>"));
  CHECK(cav_strategy_repair(&r->problem, &once, &lost, 1, &twice, &found) == CAV_OK && found);
  cav_strategy_apply(&r->problem, &twice, &taken);
  CHECK(taken.nterm == 3 && taken.timestep == r->problem.timestep / 2 && strstr(twice.changed, "<force") &&
        strstr(twice.changed, "timestep"));
  cav_strategy again;
  // neither twice
  for (int k = 0; k < 2; k++) {
    CHECK(cav_strategy_repair(&r->problem, &twice, &lost, k, &again, &found) == CAV_OK && found);
    CHECK(!strcmp(again.changed, twice.changed));
    cav_strategy_clear(&again);
  }
  cav_strategy_clear(&once), cav_strategy_clear(&twice);

  // where they cost something already, more of the actuators is kept for feedback first
  cav_problem with_force = r->problem;
  cav_term all[] = {r->term[0], r->term[1], cav_term_cost(CAV_QUANTITY_FORCE, 1)};
  with_force.term = all, with_force.nterm = 3;
  CHECK(cav_strategy_repair(&with_force, &r->stated, &lost, 0, &once, &found) == CAV_OK && found);
  CHECK(once.effort_limit < with_force.effort_limit && once.timestep == 0 && strstr(once.changed, "effort"));
  CHECK(cav_strategy_repair(&with_force, &r->stated, &lost, 1, &twice, &found) == CAV_OK && found);
  CHECK(strstr(twice.changed, "<force") && twice.timestep == 0);
  cav_strategy_clear(&once), cav_strategy_clear(&twice);
}

// near a record contact forces are what is looked for, and cost nothing; a residual beyond its bound has no cure
static void check_record(repaired *r) {
  cav_verdict lost = {.achieved = 1};
  cav_strategy once;
  int found;
  r->term[1].quantity = CAV_QUANTITY_TRACK;
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &lost, 0, &once, &found) == CAV_OK && found);
  CHECK(once.nterm == 0 && once.timestep == r->problem.timestep / 2);
  cav_strategy_clear(&once);
  // where forces are missing near one the step is halved, feet may slide, and contacts end softer unless they are soft
  cav_term near[] = {r->term[0], r->term[1], r->term[1]};
  near[2].quantity = CAV_QUANTITY_SLIP;
  r->problem.term = near, r->problem.nterm = 3;
  cav_verdict airy = lost;
  airy.unactuated_force_max = 0.01;
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &airy, 0, &once, &found) == CAV_OK && found);
  CHECK(once.nterm == 0 && once.timestep == r->problem.timestep / 2);
  cav_strategy_clear(&once);
  if (!CHECK(cav_strategy_repair(&r->problem, &r->stated, &airy, 1, &once, &found) == CAV_OK && found &&
             once.nterm == 3))
    return;
  CHECK(once.term[2].weight == 8 && near[2].weight == 200 && !strcmp(once.changed, "<slip weight=\"8\"/>"));
  cav_strategy_clear(&once);
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &airy, 2, &once, &found) == CAV_OK && found);
  CHECK(once.schedule.last.softness == 6 * r->problem.schedule.last.softness &&
        once.schedule.last.smoothing == 2 * r->problem.schedule.last.smoothing &&
        strstr(once.changed, "softness=\"0.03\"") && strstr(once.changed, "smoothing=\"0.001\""));
  cav_strategy_clear(&once);
  r->stated.schedule.last.softness = 0.03;
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &airy, 2, &once, &found) == CAV_OK &&
        once.schedule.last.softness == 0.03);
  r->stated.schedule.last.softness = r->problem.schedule.last.softness;
  r->problem.term = r->term, r->problem.nterm = 2;
  cav_strategy_clear(&once);
  r->term[1].quantity = CAV_QUANTITY_SLIP;
  lost.residual_fraction_max = 0.11, lost.residual_within = 0.1;
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &lost, 0, &once, &found) == CAV_OK && !found);
}

// what hangs in the air: the exact gap, then forces that fade sooner, then half the step; what slips gets them first, then ten
// times the weight
static void check_slides(repaired *r) {
  cav_verdict hovers = {.achieved = 1}, slips = hovers;
  slips.slip_mean_m_s = 0.02;
  cav_strategy once;
  int found;
  hovers.hover_fraction = 0.1;
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &hovers, 1, &once, &found) == CAV_OK && found);
  CHECK(once.schedule.last.smoothing == r->problem.schedule.last.smoothing / 4 &&
        once.schedule.last.softness == r->problem.schedule.last.softness && once.timestep == r->stated.timestep);
  CHECK(!strcmp(once.changed, "<last smoothing=\"0.000125\"/>"));
  cav_strategy_clear(&once);
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &slips, 0, &once, &found) == CAV_OK && found);
  CHECK(once.schedule.last.smoothing == r->problem.schedule.last.smoothing / 4);
  cav_strategy_clear(&once);
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &slips, 1, &once, &found) == CAV_OK && found);
  CHECK(once.nterm == 3 && once.term[1].weight + once.term[2].weight == 2000);
  cav_strategy_clear(&once);
}

// a goal that is missed gets effort, then weight; what is good needs nothing
static void check_goals(repaired *r) {
  cav_verdict hangs = {.certified = 1}, strained = {.achieved = 1};
  cav_strategy once, twice;
  int found;
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &hangs, 0, &once, &found) == CAV_OK && found &&
        once.effort_limit == 0.9);
  CHECK(cav_strategy_repair(&r->problem, &once, &hangs, 2, &twice, &found) == CAV_OK && found &&
        twice.term[0].weight == 9000);
  CHECK(twice.term[1].weight == 200 && !strcmp(twice.changed, "weights of goals 10 times, <limits effort=\"0.9\"/>"));
  cav_strategy_clear(&once), cav_strategy_clear(&twice);
  // effort is given once, unless limits are what is missed; of goals those grow that are missed, by name
  once = r->stated;
  once.effort_limit = 0.9;
  CHECK(cav_strategy_repair(&r->problem, &once, &hangs, 0, &twice, &found) == CAV_OK && found &&
        twice.effort_limit == 0.9);
  cav_strategy_clear(&twice);
  strained.limit_violation_max = 0.03;
  CHECK(cav_strategy_repair(&r->problem, &once, &strained, 0, &twice, &found) == CAV_OK && found);
  CHECK_NEAR(twice.effort_limit, 0.95, 1e-15);
  cav_strategy_clear(&twice);
  cav_term two[] = {r->term[0], r->term[0], r->term[1]};
  two[1].name = "other";
  r->problem.term = two, r->problem.nterm = 3;
  hangs.missed_terms = 2;
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &hangs, 2, &once, &found) == CAV_OK && found && once.nterm == 3);
  CHECK(once.term[0].weight == 900 && once.term[1].weight == 9000 && once.term[2].weight == 200);
  CHECK(!strcmp(once.changed, "weight of 'other' 10 times"));
  cav_strategy_clear(&once);
  // weights that grew by different factors are told one by one: what weighs one of ten times as much twice more is another one
  for (int k = 0; k < 2; k++) two[k].name = k ? "other" : "there", two[k].weight = 900;
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &hangs, 1, &once, &found) == CAV_OK && found);
  cav_verdict little = {.certified = 1, .missed_terms = 2, .missed_most = 1.2};
  CHECK(cav_strategy_repair(&r->problem, &once, &little, 0, &twice, &found) == CAV_OK && found);
  CHECK_TEXT(twice.changed, "weight of 'there' 10 times, weight of 'other' 24 times, kinematics=\"true\"");
  cav_strategy_clear(&once), cav_strategy_clear(&twice);
  r->problem.term = r->term, r->problem.nterm = 2, hangs.missed_terms = 0;
  // less effort than usual was asked for
  r->problem.effort_limit = 0.3;
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &hangs, 0, &once, &found) == CAV_OK &&
        !strstr(once.changed, "effort"));
  cav_strategy_clear(&once);
  r->problem.effort_limit = 0.8;
  hangs.achieved = 1;
  CHECK(cav_strategy_repair(&r->problem, &r->stated, &hangs, 0, &once, &found) == CAV_OK && !found);
  CHECK(r->problem.nterm == 2 && r->term[0].weight == 900 && r->term[1].weight == 200 &&
        r->problem.effort_limit == 0.8);
}

// the usual cure of what is missed first, one more at each call; the problem stays as it was
// what rests on n contacts hovers by delta ln(n delta / (epsilon g h^2)): each bears its part of the weight by the tail of a law
// whose regulariser is epsilon over the mass
static void check_hover(void) {
  for (int half = 0; half < 2; half++) {
    cav_error error = {0};
    cav_problem *p = cav_problem_load(CAVORT_SOURCE_ROOT "/tests/unseen/block-stop.xml", NULL, &error);
    cav_solution *s = NULL;
    double still[6] = {0};
    if (!CHECK(p != NULL)) return;
    p->v_start = still;
    if (half) p->timestep /= 2;
    cav_solve_options options = cav_solve_options_default();
    options.gains = 0;
    CHECK(cav_solve(p, &options, NULL, &s, &error) == CAV_OK);
    const cav_stage_options *law = &p->schedule.last;
    const double g = 9.81, h = p->timestep, delta = law->smoothing;
    const double hovers = delta * log(4 * delta / (law->softness * g * h * h));
    const double found = s ? s->trajectory->q[(s->trajectory->nknot - 1) * 7 + 2] - 0.05 : NAN;
    printf("a block at rest, %g ms: hovers by %.4f mm, %.4f by the law\n", 1e3 * h, 1e3 * found, 1e3 * hovers);
    CHECK_NEAR(found, hovers, 0.01 * hovers);
    cav_solution_free(s);
    cav_problem_free(p);
  }
}

int main(void) {
  check_leaning();
  check_hover();
  void (*const check[])(repaired *) = {check_loops, check_most_missed, check_record, check_slides,
                                       check_goals, check_targets,     check_rubbing};
  for (size_t i = 0; i < sizeof check / sizeof *check; i++) {
    repaired r;
    repaired_make(&r);
    if (r.model) check[i](&r);
    cav_model_free(r.model);
  }
  return check_result();
}
