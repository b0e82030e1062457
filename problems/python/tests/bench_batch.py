"""10,000 inverses: one batch call from Python against a loop in C over the same library and points, by turns.

Usage: bench_batch.py PACKAGE INCLUDE [MODEL [ROUNDS]]; PACKAGE: the folder that holds the package cavort. Prints the shortest and
the median time of both, and their ratios.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time

LOOP = r"""
#include <cavort/cavort.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec; }
int main(int argc, char **argv) {
  cav_error error = {0};
  cav_model *model = cav_model_load(argv[1], &error);
  int n = atoi(argv[2]), nq = model->nq, nv = model->nv;
  double *q = malloc((size_t)n * (size_t)(nq + 3 * nv) * sizeof *q), *v = q + n * nq, *next = v + n * nv, *u = next + n * nv;
  size_t points = (size_t)n * (size_t)(nq + 2 * nv);
  if (argc < 3 || fread(q, sizeof *q, points, stdin) != points) return 1;
  for (;;) {
    if (getchar() == EOF) return 0;
    double start = now();
    cav_state *state = cav_state_new(model);
    for (int i = 0; i < n; i++)
      if (cav_inverse(model, state, q + i * nq, v + i * nv, next + i * nv, u + i * nv)) return 1;
    cav_state_free(state);
    double sum = 0;
    double took = now() - start;
    for (int i = 0; i < n * nv; i++) sum += u[i];
    printf("%.9f %.17g\n", took, sum);
    fflush(stdout);
  }
}
"""


def main(package, include, model_path="problems/models/humanoid.xml", rounds=40, n=10_000):
    sys.path.insert(0, package)
    import numpy as np

    import cavort

    model = cavort.Model(model_path)
    draw = np.random.default_rng(1)
    q = np.array([model.integrate(model.q0, 0.1 * draw.standard_normal(model.nv), 1) for _ in range(n)])
    q[:, 2] -= 0.1 * draw.random(n)
    v = 0.3 * draw.standard_normal((n, model.nv))
    v_next = v + 0.02 * draw.standard_normal((n, model.nv))
    with tempfile.TemporaryDirectory() as folder:
        program = os.path.join(folder, "loop")
        with open(program + ".c", "w") as file:
            file.write(LOOP)
        library = os.path.join(package, "cavort", "libcavort.so")
        flags = ["-O2", "-std=gnu17", "-I", include, program + ".c", library, "-Wl,-rpath," + os.path.dirname(library)]
        # the loader looks for the library by its soname
        soname = cavort_soname(library)
        os.symlink(os.path.abspath(library), os.path.join(folder, soname))
        subprocess.run(["cc", *flags, "-Wl,-rpath," + folder, "-o", program], check=True)
        loop = subprocess.Popen([program, model_path, str(n)], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        loop.stdin.write(q.tobytes() + v.tobytes() + v_next.tobytes())
        ours, theirs = [], []
        for _ in range(rounds):
            start = time.perf_counter()
            u = model.inverse(q, v, v_next)
            ours.append(time.perf_counter() - start)
            loop.stdin.write(b"\n")
            loop.stdin.flush()
            took, total = loop.stdout.readline().split()
            theirs.append(float(took))
            assert abs(float(total) - u.sum()) <= 1e-9 * np.abs(u).sum()
        loop.stdin.close()
        loop.wait()
    for name, of in (("shortest", min), ("median", statistics.median)):
        a, b = 1e3 * of(ours), 1e3 * of(theirs)
        print(f"{name}: {n} inverses, Python {a:.2f} ms, C {b:.2f} ms, ratio {a / b:.3f}")


def cavort_soname(library):
    told = subprocess.run(["readelf", "-d", library], capture_output=True, text=True, check=True).stdout
    found = [line.split("[")[1].rstrip("]") for line in told.splitlines() if "SONAME" in line]
    return found[0] if found else "libcavort.so"


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    main(*sys.argv[1:4], *(int(x) for x in sys.argv[4:]))
