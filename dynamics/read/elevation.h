/// Heights of a field as a file gives them. Private to dynamics/.
#ifndef CAVORT_ELEVATION_H
#define CAVORT_ELEVATION_H

#include <stddef.h>

#include "cavort/status.h"

/// Heights as read, by rows from low to high y: height[row * ncol + column]; of malloc, let go by free.
typedef struct cav_elevation {
  int nrow, ncol;
  double *height; ///< [nrow*ncol], any finite scale
} cav_elevation;

/// Reads an image (PNG) or a binary file of heights; at most limit points along each side. On failure a reason, without
/// the path, and CAV_BAD_INPUT or CAV_NO_MEMORY. elevation.c.
cav_status cav_elevation_read(const char *path, int limit, cav_elevation *e, char *reason, size_t room);

#endif
