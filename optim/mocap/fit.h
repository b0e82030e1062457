/// Least squares of markers at one frame: rows, and the normal equations of a configuration. Private to optim/mocap.
#ifndef CAVORT_FIT_H
#define CAVORT_FIT_H

#include "cavort/mocap.h"

enum { CAV_FIT_FEET = 12, CAV_FIT_POINTS = 8, CAV_FIT_CORNERS = 4 };

/// A model, the markers that a clip and a set share, and the work of one fit.
typedef struct cav_fit {
  const cav_model *model;
  cav_state *state;
  const cav_ik_options *options;
  const cav_marker_set *set;
  int n;                         ///< markers of both
  int *marker, *column;          ///< [n] in the set, in the clip
  int nframe, nmarker;           ///< of the clip, at equal steps
  double step;                   ///< s
  const double *position;        ///< [nframe*nmarker*3]
  int nfoot, foot[CAV_FIT_FEET]; ///< bodies
  char *stands;                  ///< [nframe*CAV_FIT_FEET] 1: that foot stands, 2: on all of its sole
  double *point;                 ///< [CAV_FIT_POINTS * geoms of a foot + CAV_FIT_CORNERS][3] of its rows
  int ncorner[CAV_FIT_FEET];     ///< of its sole, fixed in the body; 0: found anew in every posture
  double corner[CAV_FIT_FEET][CAV_FIT_CORNERS][3];
  char *planted;              ///< [nframe*n] 1: that marker of a foot is held where it is; NULL: none is
  double *apart;              ///< [npair] m that links of a pair within a tree are held apart; NULL: they are not
  double *clear;              ///< [nframe*CAV_FIT_FEET] m that a foot keeps from the floor; NULL: 0
  double firm;                ///< times the weight of markers that are planted, and of feet on the floor
  double *H, *g, *try, *move; ///< [nv*nv] lower, by columns; [nv]; [nq]; [nv]
} cav_fit;

/// Sizes of links as unknowns: one factor a group of links, by its logarithm.
typedef struct cav_fit_sizes {
  cav_model *model; ///< that has them: the fit's
  void *kept;       ///< the model as it was given
  int ngroup;
  int *group;             ///< [nlink] of each link, -1 of the world
  double *factor, *error; ///< [nlink] as the model has them; their standard errors
} cav_fit_sizes;

/// Where marker i of the fit was seen at a frame; NULL: it was not.
const double *cav_fit_seen(const cav_fit *fit, int frame, int i);

/// World place of marker i of the fit at the state's position.
void cav_fit_place(const cav_fit *fit, int i, double world[3]);

/// Last dof that moves a body, -1: none does.
int cav_fit_last_dof(const cav_model *model, int body);

/// Jacobian column of a point of a link by dof d, which is of the link or of one before it.
void cav_fit_column(const cav_fit *fit, int d, const double point[3], double column[3]);

/// Weight of marker i of the fit at a frame.
double cav_fit_weight(const cav_fit *fit, int frame, int i);

/// Finds the feet of the model, once. floor.c.
cav_status cav_fit_feet(cav_fit *fit);

/// Whether a marker of a foot stands at a frame: seen, so many times slower than what is still, and near least, the
/// lowest that it comes. floor.c.
int cav_fit_stands(const cav_fit *fit, int frame, int i, double least, double times);

/// m/s of marker i of the fit at a frame; infinite where it is not seen on both sides. floor.c.
double cav_fit_speed(const cav_fit *fit, int frame, int i);

/// Lowest height that marker i of the fit comes to. floor.c.
double cav_fit_bottom(const cav_fit *fit, int i);

/// Finds when the feet stand. floor.c.
cav_status cav_fit_floor(cav_fit *fit);

/// Lowest point of a body's geoms at the state's position; zero: it has none. floor.c.
int cav_fit_lowest(const cav_fit *fit, int body, double point[3]);

/// The clip of another body, scaled to the model's: made [nframe*nmarker*3] takes the place of fit->position. scale: of
/// ways in the world. retarget.c.
cav_status cav_fit_retarget(cav_fit *fit, double **made, double *scale, cav_error *error);

/// Rows of foot f at a frame, each the height of a point, into fit->point: four corners of a sole that stands; else every end
/// or corner that is below the floor, or the lowest point of a foot that stands above it and of which
/// no marker is held. Returns how many. floor.c.
int cav_fit_floor_rows(const cav_fit *fit, int frame, int f);

/// How far a foot keeps from the floor at a frame.
static inline double cav_fit_clear(const cav_fit *fit, int frame, int f) {
  return fit->clear ? fit->clear[frame * CAV_FIT_FEET + f] : 0;
}

/// Half the squares of what links are too near to each other at the state's position, and H and g of it. smooth.c.
double cav_fit_apart_cost(const cav_fit *fit);
void cav_fit_apart_normal(const cav_fit *fit);

/// Configurations q [nframe*nq] of all frames to the least cost of all rows and of accelerations, links apart. smooth.c.
cav_status cav_fit_smooth(cav_fit *fit, double *q, int *iterations);

/// Half the squares of all rows at q: markers seen, feet, posture, and the change from before (NULL: none). Leaves the
/// state at q.
cav_status cav_fit_cost(const cav_fit *fit, int frame, const double *q, const double *before, double *cost);

/// H and g of the same at the state's position, which is that of q.
void cav_fit_normal(const cav_fit *fit, int frame, const double *q, const double *before);

/// Dofs at an end of their range that a step would pass are taken out of H, g and B [nv*n] by columns; a step stays
/// in the ranges.
void cav_fit_pin(const cav_fit *fit, const double *q, double *B, int n);
void cav_fit_clip(const cav_model *model, double *q);

/// q [nq] to the least cost from where it is. *iterations grows.
cav_status cav_fit_frame(cav_fit *fit, int frame, const double *before, double *q, int *iterations);

/// Turns and moves q's free root so that markers lie as near as can be to where they were seen at a frame; nothing
/// where there is no free root or fewer than three markers.
cav_status cav_fit_align(const cav_fit *fit, int frame, double *q);

/// The first configuration of a frame, from several postures, the model's own among them: the nearest in the end,
/// the first of those that cost as much but for this part. The others have joints up to a quarter of their ranges, or half
/// a radian, off, by a fixed sequence. paths.c.
cav_status cav_fit_begin(cav_fit *fit, int frame, double part, double *q, int *iterations);

/// Frames of q [nframe*nq] one after the other up to a last one, or down to it, each from the one before; the first
/// from where it is. paths.c.
cav_status cav_fit_follow(cav_fit *fit, int from, int to, double *q, int *iterations);

/// Of q [nframe*nq] and of what frames lead to that are begun anew, the cheapest way from the first frame to the last.
/// paths.c.
cav_status cav_fit_choose_paths(cav_fit *fit, double *q, int *iterations);

/// Weight of the difference of two ways, from the frame before and to the next one, of a dof. smooth.c.
double cav_fit_bend_weight(const cav_fit *fit, int dof);

/// Places of markers that are to be found, with the configurations of frames spread over the clip, and with sizes (NULL:
/// they are known).
cav_status cav_fit_places(cav_fit *fit, cav_marker_set *set, cav_fit_sizes *sizes, const double *q, int *iterations);

/// Groups of links: each its own, or with its counterpart on the other side. CAV_NOT_SUPPORTED with the reason: the model
/// has parts that are not scaled; CAV_NO_MEMORY. sizes.c.
cav_status cav_fit_sizes_new(cav_fit_sizes *sizes, cav_model *model, int symmetric, cav_error *error);
void cav_fit_sizes_free(cav_fit_sizes *sizes);

/// The model at these logarithms of factors [ngroup]. sizes.c.
cav_status cav_fit_sizes_set(cav_fit_sizes *sizes, const double *logarithm);

/// How a point of a link moves with the logarithms at the state's position: column [ngroup*3]. sizes.c.
void cav_fit_sizes_move(const cav_fit_sizes *sizes, const cav_state *state, const double *q, int link,
                        const double point[3], double *column);

/// Postures of the file, moved up or down with what they stand on. sizes.c.
cav_status cav_fit_sizes_stand(const cav_fit_sizes *sizes, cav_state *state);

#endif
