/// Strings around spheres and cylinders, in the frame of the geom. Private to dynamics/. wrap.c.
#ifndef CAVORT_WRAP_H
#define CAVORT_WRAP_H

/// Shortest way from a to b around a sphere at the origin: touch receives where it meets and leaves the surface, the
/// result is the length between, or -1 if the string is straight and touch is untouched. side (may be NULL) is a point
/// on the side to pass, or inside the sphere for a string that comes through it.
double cav_wrap_sphere(double radius, const double a[3], const double b[3], const double *side, double touch[2][3]);

/// The same around an endless cylinder along z.
double cav_wrap_cylinder(double radius, const double a[3], const double b[3], const double *side, double touch[2][3]);

#endif
