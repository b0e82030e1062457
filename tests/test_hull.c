/// Hulls of degenerate sets of points (hull_sets.h): every set has one, closed, of the right topology, no point
/// outside, and walking along neighbours ends at the top. Usage: test_hull [SETS]; tests/results/hull.md is of
/// 10,000.
#include "check.h"
#include "hull_sets.h"

int main(int argc, char **argv) {
  int sets = argc > 1 ? atoi(argv[1]) : 1000;
  static double point[3 * HULL_POINTS_MAX];
  for (int kind = 0; kind < HULL_KINDS; kind++) {
    hull_faults worst = {0};
    int count = sets / HULL_KINDS, volumes = 0, refused = 0;
    for (int k = 0; k < count; k++) {
      int n = hull_set(kind, point);
      cav_hull h;
      cav_status status = cav_hull_build(point, n, 0, &h);
      refused += status == CAV_NOT_SUPPORTED;
#ifdef CAVORT_HAVE_QHULL
      CHECK(status == CAV_OK);
#else
      CHECK(status == CAV_OK || status == CAV_NOT_SUPPORTED);
#endif
      if (status != CAV_OK) continue;
      hull_faults f = hull_judge(point, n, &h);
      CHECK(h.nvertex > 0 && h.nvertex <= n);
      CHECK(!f.open && !f.euler && !f.inverted && !f.lost);
      volumes += h.nface > 2;
      worst.outside = fmax(worst.outside, f.outside);
      worst.above = fmax(worst.above, f.above);
      cav_hull_clear(&h);
    }
    printf("%-20s %4d sets, %4d of volume, %d refused: outside %.1e, above planes %.1e\n", hull_kinds[kind], count,
           volumes, refused, worst.outside, worst.above);
    // what is flat to 1e-9 is taken as flat; seen of others: 5e-16
    static const double flat[HULL_KINDS] = {[3] = 1e-11, 0, 1e-9, 1e-9, 1e-9, 1e-11, 1e-13, [18] = 1e-9};
    double bound = fmax(flat[kind], 1e-13);
    CHECK_NEAR(worst.outside, 0, bound);
    CHECK_NEAR(worst.above, 0, bound);
  }
  return check_result();
}
