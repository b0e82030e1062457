/// Recorded motion: places of markers over time, which marker sits where on which body, and the kinematic fit of a
/// model to them.
#ifndef CAVORT_MOCAP_H
#define CAVORT_MOCAP_H

#include "cavort/trajectory.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Places of markers, frame by frame, in the world of the models: m, z up. A marker that was not seen is NaN in all
/// three.
typedef struct cav_record {
  int nframe, nmarker; ///< sizes of the clip
  double *time;        ///< [nframe] s, increasing
  char **name;         ///< [nmarker] unique
  double *position;    ///< [nframe*nmarker*3] m
  int assumed;         ///< which of the options below the file did not say and nobody gave: CAV_ASSUMED_...
} cav_record;

/// Bits of cav_record.assumed.
enum {
  CAV_ASSUMED_UNIT = 1, ///< unit of length
  CAV_ASSUMED_UP = 2,   ///< axis that is up
  CAV_ASSUMED_RATE = 4  ///< frames a second
};

/// What a file of recorded motion may leave out. Zeros: as the file says, or as its format has it.
typedef struct cav_record_options {
  double unit;       ///< m that one of the file's units is; 0: as the file says, else m, of BVH 0.01
  char up;           ///< axis of the file that points up, 'x', 'y' or 'z'; 0: of TRC and BVH 'y', else 'z'
  double rate;       ///< frames a second; 0: as the file says, of key frames without times 30
  double from, to;   ///< s: frames outside are left out; to 0: to the end
  const char *names; ///< of key frames: names of the mocap bodies in their order, by blanks; NULL: those in the file
} cav_record_options;

/// Reads a clip, by the end of its name: .trc (markers, OpenSim and motion capture systems), .c3d (points), .bvh (a
/// marker at every joint and end), .csv (columns time, NAME_x, NAME_y, NAME_z, empty where not seen), .xml (MJCF key
/// frames with mpos: a marker for each mocap body). options may be NULL. NULL on failure with the reason in error
/// (may be NULL): CAV_BAD_INPUT, CAV_NO_MEMORY, CAV_NOT_SUPPORTED. Freed by cav_record_free.
CAV_API cav_record *cav_record_read(const char *path, const cav_record_options *options, cav_error *error);

/// nframe frames of nmarker markers at a rate (frames a second, > 0), names NULL and nothing seen: to be filled by
/// the caller, names from malloc. NULL if memory runs out or a size is below 1.
CAV_API cav_record *cav_record_new(int nframe, int nmarker, double rate);
CAV_API void cav_record_free(cav_record *record);

/// Writes a clip as CSV, as cav_record_read reads it. Replaces the file atomically. CAV_BAD_INPUT: a name has a comma,
/// a quote or a line end (of clips that were read none has: there they are '_').
CAV_API cav_status cav_record_write(const char *path, const cav_record *record, cav_error *error);

/// One marker on a body.
typedef struct cav_marker {
  char *name;      ///< as the clip has it
  int body;        ///< of the model
  double place[3]; ///< m, in the body's frame
  int placed;      ///< 1: place is known; 0: it is where a search for it starts
  char *from;    ///< where the clip is scaled: names of markers, by blanks, from whose mean it is measured; NULL: none
  double weight; ///< 1/m^2 relative to other markers, >= 0
} cav_marker;

/// Which markers a subject or a robot wears, and how their clips are to be read.
typedef struct cav_marker_set {
  int nmarker;        ///< how many
  cav_marker *marker; ///< [nmarker] names are unique
  double adjust;      ///< m: how far off places that are known may be; they are fitted, too. 0: they are exact
  int floor;          ///< 1: feet that stand do so on the plane z = 0
  double scale;       ///< how far off sizes of segments may be, of the body's: for cav_ik_sizes; 0: they are right
  int symmetric;      ///< 1: segments of both sides are of one size
  int retarget;       ///< 1: clips are of a body of other size and scaled to the model's
  int similar;        ///< 1: times of such a clip go with the square root of its ways, so that gravity stays what it is
  int left_out;       ///< markers of the file on parts that the model does not have
  cav_record_options clip; ///< for cav_record_read; names is memory of the set
} cav_marker_set;

/// Reads a marker set: an XML file <markers> of elements <marker name= body= pos= weight=>. body is one of the model
/// or a part that any body has ("right foot"); without pos the place is unknown and starts at the middle of the
/// body's mass.
/// <markers> has, where needed, adjust= (m), floor=, scale=, symmetric=, and what clips leave out: unit= (m),
/// up= (x, y or z), rate= (1/s) and names= (by blanks). For clips of other bodies retarget= and pace=.
/// NULL on failure with the reason in error (may be NULL): CAV_BAD_INPUT, CAV_NO_MEMORY. Freed by cav_marker_set_free.
CAV_API cav_marker_set *cav_marker_set_read(const char *path, const cav_model *model, cav_error *error);
CAV_API void cav_marker_set_free(cav_marker_set *set);

/// Writes a marker set, every place as known. Replaces the file atomically. CAV_BAD_INPUT: a marker's body has no
/// name, or path cannot be written.
CAV_API cav_status cav_marker_set_write(const char *path, const cav_model *model, const cav_marker_set *set,
                                        cav_error *error);

/// How a model is fitted to a clip.
typedef struct cav_ik_options {
  double posture;   ///< weight of the way from the model's own configuration, m/rad: settles what no marker tells
  double roughness; ///< weight of the change from the frame before, m/rad: bridges gaps
  double floor;     ///< 1/m^2 relative to markers, of the height of feet that stand, where the set says floor
  int iterations;   ///< at most, a frame
} cav_ik_options;

/// The usual options.
CAV_API cav_ik_options cav_ik_options_default(void);

/// What a fit found. Errors are distances of markers, m.
typedef struct cav_ik_report {
  int nframe, nmarker; ///< markers of the set that the clip has, in the set's order
  int missing;         ///< markers of the clip that the set does not name
  int *marker;         ///< [nmarker] of the set
  double *rms, *worst; ///< [nmarker] over the frames that have it
  int *seen;           ///< [nmarker] frames that have it
  double *frame_rms;   ///< [nframe] over the markers seen; NaN: none was
  double total_rms;    ///< over all
  double scale;        ///< of ways in the world, where the clip was scaled; 0: it was not
  double pace;         ///< of times, where these were scaled, too; 0: they were not
  int iterations;      ///< in all
} cav_ik_report;

/// Frees what a report holds; NULL is fine.
CAV_API void cav_ik_report_free(cav_ik_report *report);

/// Fits a model to a clip: first the places of markers that are not known, together with configurations of frames
/// spread over the clip; then frame after frame, least squares of weighted distances of markers over configurations
/// within the ranges of joints, each frame from the one before. Frames keep the clip's times if they are
/// equidistant, otherwise the mean step is taken between interpolated frames. set: places that were fitted are
/// written into it. *trajectory has q and v; u is zero. report may be NULL, *report is freed by cav_ik_report_free.
/// CAV_BAD_INPUT: no marker of the set is in the clip, fewer than two frames, or no frame shows a marker;
/// CAV_NO_MEMORY, CAV_NOT_FINITE. optim/METHOD.md, 11.
CAV_API cav_status cav_ik(const cav_model *model, const cav_record *record, cav_marker_set *set,
                          const cav_ik_options *options, cav_trajectory **trajectory, cav_ik_report **report,
                          cav_error *error);

/// Fits a model's sizes to a clip: a factor for the lengths of every link (segments of both sides together where the set
/// says symmetric), with the places of markers that are not known and configurations of frames spread over the clip. A
/// factor is within about set->scale (> 0) of that of all. The model gets those sizes: what is fixed to a link goes away from
/// the anchor of its first joint by its factor, the mass of all grows with its volume and links keep their fractions of
/// it, keyframes stand as high as before; gears, ranges, springs stay. set: places on the model of its new size. factor
/// [nlink], its standard errors in deviation [nlink] (may be NULL). No state of the model may be used afterwards.
/// CAV_BAD_INPUT as cav_ik, CAV_NOT_SUPPORTED: the model has meshes that move, tendons along paths or equality
/// constraints of bodies; CAV_NO_MEMORY, CAV_NOT_FINITE: do not use the model. optim/METHOD.md, 11.
CAV_API cav_status cav_ik_sizes(cav_model *model, const cav_record *record, cav_marker_set *set,
                                const cav_ik_options *options, double *factor, double *deviation, cav_error *error);
/// Measures of a motion's quality, X(name, unit, bar, text): what is good at most, NaN: none.
#define CAV_QUALITIES(X)                                                                                         \
  X(penetration, "mm", 10, "deepest of a body in what it is not jointed to the model with (the floor)")          \
  X(penetration_fraction, "%", 0, "knots with more than 10 mm of it")                                            \
  X(self_penetration, "mm", NAN, "deepest of two bodies of one tree in each other")                              \
  X(skating, "cm/s", NAN, "fastest slide of what touches, within 5 mm, over a frame of 1/30 s; rolling is none") \
  X(skating_fraction, "%", 0, "frames in contact with a slide of more than 1 cm/s")                              \
  X(skating_step, "cm/s", NAN, "the same over a single step")                                                    \
  X(skating_step_fraction, "%", NAN, "steps in contact with one of more than 1 cm/s")                            \
  X(floating, "mm", 20, "highest above all, while the centre of mass moves as if more than g/2 were borne")      \
  X(floating_fraction, "%", 0, "knots more than 20 mm above all meanwhile")                                      \
  X(jerk, "m/s^3", NAN, "of the centres of mass of links, rms")                                                  \
  X(effort, "%", NAN, "of actuators over their limits, rms")                                                     \
  X(landing, "weight", NAN, "largest vertical force from outside, as the centre of mass moves")                  \
  X(flailing, "m/s", NAN, "speed of the hands against the trunk, rms; none: no hands")                           \
  X(asymmetry, "%", NAN, "difference of what left and right joints go through, over their sum")                  \
  X(torque_excess, "%", 0, "most that an actuator is asked for beyond its limit, over that limit")               \
  X(torque_excess_fraction, "%", 0, "knots that ask for more than a limit")                                      \
  X(residual, "%", NAN, "force that neither contacts nor actuators can give, rms, over the weight")              \
  X(residual_worst, "%", NAN, "the same, at most")

/// How good a motion is, whatever made it. Lengths of knots with data at both sides only; see CAV_QUALITIES.
typedef struct cav_quality {
#define CAV_QUALITY_MEMBER(name, ...) double name;
  CAV_QUALITIES(CAV_QUALITY_MEMBER)
#undef CAV_QUALITY_MEMBER
} cav_quality;

/// Table of cav_quality: names, units, bars and texts follow from CAV_QUALITIES.
typedef struct cav_quality_rule {
  const char *name, *unit; ///< as in CAV_QUALITIES
  double bar;              ///< NaN: none
  const char *text;        ///< what it measures
  size_t offset;           ///< of the member in cav_quality
} cav_quality_rule;
/// The measures in the order of CAV_QUALITIES, n of them.
CAV_API const cav_quality_rule *cav_quality_rules(int *n);

/// Measures a motion of at least four knots from its configurations alone. law: of the step (order, gravity, passive
/// forces), NULL: the model's. Contact forces are those within 5 mm that leave the least residual, and of these the least
/// efforts. optim/METHOD.md, 14. CAV_BAD_INPUT, CAV_NO_MEMORY, CAV_NOT_FINITE with the reason in error.
CAV_API cav_status cav_quality_measure(const cav_model *model, const cav_trajectory *motion, const cav_options *law,
                                       cav_quality *quality, cav_error *error);

#ifdef __cplusplus
}
#endif
#endif
