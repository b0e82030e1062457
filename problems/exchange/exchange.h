/// A solved motion in the formats of other tools.
#ifndef CAVORT_EXCHANGE_H
#define CAVORT_EXCHANGE_H

#include "cavort/result.h"
#include "result.h"

/// A motion as samples at equal times. Velocities lead to a sample from the one before; controls, efforts and contacts
/// of a sample are those of the knot whose step it lies in, which a step holds; after the last step those of the last.
typedef struct cav_recording {
  const cav_result *result;
  const cav_problem *problem;
  const cav_model *model;
  int n;
  double timestep;        ///< s
  cav_trajectory *motion; ///< [n] at the rate asked; of a mirrored cycle the whole stride
  cav_forces *forces;     ///< of the knots
  int *knot;              ///< [n] index into forces
} cav_recording;

/// rate: samples a second, 0: the knots as they are. CAV_BAD_INPUT where a rate leaves fewer than two samples.
cav_status cav_recording_open(cav_recording *recording, const cav_result *result, double rate, cav_error *error);
void cav_recording_close(cav_recording *recording);

/// Poses of all links at every sample, [n*nlink]; NULL with the reason in error. Freed by free.
cav_pose *cav_recording_poses(const cav_recording *recording, cav_error *error);

enum { CAV_EXCHANGE_NOTE = 1200 };

/// Formats, X(id, word, file, text): file is the usual name in the result's folder.
// clang-format off
#define CAV_EXCHANGES(X)                                                                                           \
  X(KEYFRAMES, keyframes, "keyframes.xml", "MJCF for MuJoCo: the model and a keyframe (qpos, qvel, ctrl, time) for every sample") \
  X(NPZ, npz, "motion.npz", "NumPy: time, qpos, qvel, ctrl, efforts, poses of bodies, contacts, names")            \
  X(GLB, glb, "motion.glb", "glTF 2.0, binary: a node a link, shapes of geoms, the motion as an animation")        \
  X(BVH, bvh, "motion.bvh", "Biovision hierarchy: a joint a link, angles in degrees, metres, y up")                \
  X(CSV, csv, "motion.csv", "a table: time, qpos, qvel, u, ctrl and force of actuators")                           \
  X(MP4, mp4, "motion.mp4", "a video of the result's page; needs chromium and ffmpeg, 30 pictures a second where no rate is asked")
// clang-format on

typedef enum cav_exchange {
#define CAV_EXCHANGE_MEMBER(id, ...) CAV_EXCHANGE_##id,
  CAV_EXCHANGES(CAV_EXCHANGE_MEMBER)
#undef CAV_EXCHANGE_MEMBER
      CAV_EXCHANGE_FORMATS
} cav_exchange;

/// A format: its word, the usual file, what it is, and its writer, which says in note what of the motion it cannot hold
/// ("" where it holds all that it is for).
typedef struct cav_exchange_rule {
  const char *name, *file, *text;
  cav_status (*write)(const cav_recording *recording, const char *path, char note[CAV_EXCHANGE_NOTE], cav_error *error);
} cav_exchange_rule;

const cav_exchange_rule *cav_exchange_rule_of(cav_exchange format);

/// Name of a body or actuator; where it has none "body 3" and the like.
const char *cav_recording_body_name(const cav_model *model, int body, char label[96]);

// the writers, one file each
cav_status cav_exchange_write_keyframes(const cav_recording *recording, const char *path, char note[CAV_EXCHANGE_NOTE],
                                        cav_error *error);
cav_status cav_exchange_write_npz(const cav_recording *recording, const char *path, char note[CAV_EXCHANGE_NOTE],
                                  cav_error *error);
cav_status cav_exchange_write_glb(const cav_recording *recording, const char *path, char note[CAV_EXCHANGE_NOTE],
                                  cav_error *error);
cav_status cav_exchange_write_bvh(const cav_recording *recording, const char *path, char note[CAV_EXCHANGE_NOTE],
                                  cav_error *error);
cav_status cav_exchange_write_csv(const cav_recording *recording, const char *path, char note[CAV_EXCHANGE_NOTE],
                                  cav_error *error);
cav_status cav_exchange_write_mp4(const cav_recording *recording, const char *path, char note[CAV_EXCHANGE_NOTE],
                                  cav_error *error);

#endif
