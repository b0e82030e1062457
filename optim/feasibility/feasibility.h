/// Necessary conditions of a problem, in parts: what is required at which knot, and proofs that it cannot be. Private to
/// the room.
#ifndef CAVORT_FEASIBILITY_H
#define CAVORT_FEASIBILITY_H

#include "cavort/dynamics.h"
#include "cavort/problem.h"

/// What a requirement is about.
typedef enum cav_requirement_kind {
  CAV_REQUIRE_POINT,     ///< a point of a link, world coordinates
  CAV_REQUIRE_CENTRE,    ///< the centre of mass of a body's subtree, world coordinates
  CAV_REQUIRE_COORDINATE ///< q of a hinge or slide
} cav_requirement_kind;

/// A value that a motion has to have at a knot, or it is not certified or does not achieve what is asked.
typedef struct cav_requirement {
  int term, knot;
  cav_requirement_kind kind;
  int object;             ///< link, body or joint
  double point[3];        ///< POINT: in the link's frame
  double low[3], high[3]; ///< infinite where open; COORDINATE: the first alone
} cav_requirement;

/// A proof, and what tells it from others of the same thing.
typedef struct cav_proof {
  cav_impossibility said;
  cav_requirement_kind kind; ///< of the requirement that cannot be met
  int object;                ///< of it, -1: it has none
  double fraction;           ///< bound over what is asked: the less, the tighter; 0: exact, or no number bounds it
} cav_proof;

enum { CAV_PROOFS = 32 }; ///< most that are looked for

/// An examination in progress.
typedef struct cav_examination {
  const cav_problem *problem;
  const cav_model *model;
  cav_state *start;   ///< at q_start, at rest; no constraint but contacts is evaluated
  cav_state *scratch; ///< at any posture
  int nknot;
  double longest; ///< largest duration over the stated one
  int n, room;
  cav_requirement *requirement; ///< [n] by knot, then by term
  int most, nfound;
  cav_proof *found; ///< [most]
} cav_examination;

/// Whether a motion has to begin at q_start with v_start; conditions that reckon from there on hold of no other.
static inline int cav_start_is_given(const cav_problem *problem) { return !problem->cycle.on && !problem->free_start; }

/// Least and largest distance of two points over all postures within the ranges of joints.
typedef struct cav_distance_range {
  double least, largest;
} cav_distance_range;

/// Collects requirements of terms that are constraints or have a tolerance. requirement.c.
cav_status cav_requirements_collect(cav_examination *e);

/// Knots of a term's window. requirement.c.
void cav_requirement_window(const cav_examination *e, const cav_term *term, int *first, int *last);

/// Of a window every so many knots are collected, its first and its last. requirement.c.
int cav_requirement_stride(const cav_examination *e);

/// Latest time at which a knot can be, s. requirement.c.
double cav_requirement_time(const cav_examination *e, int knot);

/// What is required, in words: "'grasp' wants site 'tip' at x 1.5 at 0.8 s". requirement.c.
void cav_requirement_words(const cav_examination *e, const cav_requirement *r, char *out, size_t size);

/// The interval of each component that a term on a sensor requires at a knot, infinite where open; zero: it requires none.
/// usual: its tolerance where it gives none. requirement.c.
int cav_requirement_interval(const cav_examination *e, const cav_term *term, int knot, double usual, double low[3],
                             double high[3]);

/// Such a term in words: "'spin' wants a jointvel of joint 'hub' at 0.5 s". requirement.c.
void cav_requirement_sensor_words(const cav_examination *e, const cav_term *term, int knot, char *out, size_t size);

/// A proof more, with its text in printf's manner; those beyond the room are dropped. feasibility.c.
void cav_impossible(cav_examination *e, cav_condition condition, const cav_requirement *r, const char *cure,
                    const char *format, ...) __attribute__((format(printf, 5, 6)));

/// The bound of the last proof over what is asked, where it is a number: of several proofs of one thing the tightest is
/// told. feasibility.c.
void cav_impossible_fraction(cav_examination *e, double fraction);

/// Name of a joint, link or geom for messages. feasibility.c.
const char *cav_name_or(const char *name, const char *kind, int i, char buffer[48]);

/// Distance of two points of one tree, or of a point and the world where other is 0; CAV_BAD_INPUT: of two trees.
/// anchor: of the world, [3] least and [3] largest coordinates of the highest point that does not rotate, to which the
/// distance is. distance.c.
int cav_distance_between(const cav_model *model, int link, const double point[3], int other,
                         const double other_point[3], double anchor[6], cav_distance_range *range);

/// Largest distance of the centre of mass of a body's subtree (0: of the tree of link) from a point of a link, infinite
/// where nothing bounds it. distance.c.
double cav_distance_to_centre(const cav_model *model, int body, int link, const double point[3]);

/// Centre of mass of a body in its link's frame. distance.c.
void cav_body_centre(const cav_body *body, double centre[3]);

/// Whether a body is a descendant of another, or it. distance.c.
int cav_body_within(const cav_model *model, int body, int ancestor);

/// Fraction of the limits of actuators that a certified motion can use. effort.c.
double cav_effort_part(const cav_examination *e);

/// Largest force of actuators on each dof, force [nv]; *bounded 0: an actuator has no limit, or a moment that changes.
/// effort.c.
cav_status cav_effort_of_dofs(cav_examination *e, double *force, int *bounded);

/// Whether the first joints of a tree let it go along a world axis, held by nothing. momentum.c.
int cav_tree_is_open(cav_examination *e, int root, int axis);

/// Centre of mass of a tree and its velocity at the start; leaves the start's velocities in scratch. momentum.c.
cav_status cav_centre_of_tree(cav_examination *e, int root, double centre[3], double velocity[3]);

/// Whether gravity, straight down, is all that acts on what touches nothing: no medium, equality constraints, buoyancy and
/// springs of tendons. takeoff.c.
int cav_weight_is_all(const cav_model *model);

/// What can hold a tree up: level planes alone, 1. support: the highest that its centre of mass can be while anything of
/// it touches them, m, -infinite where it may touch nothing; friction (may be NULL): largest of these contacts where it
/// can come forward. 0: something else, or nothing bounds it. takeoff.c.
int cav_ground_survey(const cav_examination *e, int root, double *support, double *friction);

/// Highest that the centre of mass of a tree can be at times, m; infinite where nothing bounds it. takeoff.c.
cav_status cav_takeoff_heights(cav_examination *e, int root, int n, const double *time, double *highest);

/// The conditions, each with its proofs.
cav_status cav_examine_contradictions(cav_examination *e); // contradiction.c
cav_status cav_examine_distances(cav_examination *e);      // distance.c
cav_status cav_examine_directions(cav_examination *e);     // direction.c
cav_status cav_examine_solids(cav_examination *e);         // solid.c
cav_status cav_examine_touches(cav_examination *e);        // touch.c
cav_status cav_examine_enclosures(cav_examination *e);     // enclosure.c
cav_status cav_examine_falls(cav_examination *e);          // fall.c
cav_status cav_examine_floats(cav_examination *e);         // float.c
cav_status cav_examine_momentum(cav_examination *e);       // momentum.c
cav_status cav_examine_strength(cav_examination *e);       // strength.c
cav_status cav_examine_hinge(cav_examination *e);          // hinge.c
cav_status cav_examine_slides(cav_examination *e);         // slide.c
cav_status cav_examine_energy(cav_examination *e);         // energy.c
cav_status cav_examine_takeoff(cav_examination *e);        // takeoff.c
cav_status cav_examine_holds(cav_examination *e);          // hold.c
cav_status cav_examine_speeds(cav_examination *e);         // speed.c

#endif
