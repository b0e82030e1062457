/// Centre of pressure: the forces of the world on each body, summed, and where their line of action meets the plane z = 0.
/// With F the force and M its moment about the origin, x = -M_y/F_z and y = M_x/F_z; the free moment is what M_z has
/// beside that of F there.
#include "pressure.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "file.h"
#include "objects.h"

static const double loaded = 0.01; // of the weight

// the body that the world pushes, -1: a contact between bodies; sign of the force on it
static int pushed_body(const cav_model *m, const cav_contact_force *c, double *sign) {
  int a = m->geom[c->geom1].body, b = m->geom[c->geom2].body;
  int fixed1 = m->geom[c->geom1].link == 0, fixed2 = m->geom[c->geom2].link == 0;
  *sign = fixed1 ? 1 : -1;
  if (fixed1 == fixed2) return -1;
  return fixed1 ? b : a;
}

// force and moment about the origin of all that pushes a body at a knot
static void sum(const cav_model *m, const cav_forces *forces, const cav_contact_force *first, int knot, int body,
                double F[3], double M[3]) {
  memset(F, 0, 3 * sizeof *F), memset(M, 0, 3 * sizeof *M);
  for (int i = 0; i < forces->count[knot]; i++) {
    double sign, f[3];
    if (pushed_body(m, &first[i], &sign) != body) continue;
    const double *p = first[i].pos;
    for (int k = 0; k < 3; k++) f[k] = sign * first[i].force[k], F[k] += f[k];
    for (int k = 0; k < 3; k++) M[k] += p[(k + 1) % 3] * f[(k + 2) % 3] - p[(k + 2) % 3] * f[(k + 1) % 3];
  }
}

static void write_row(FILE *out, const cav_model *m, const double F[3], const double M[3]) {
  double least = loaded * m->mass *
                 sqrt(m->gravity[0] * m->gravity[0] + m->gravity[1] * m->gravity[1] + m->gravity[2] * m->gravity[2]);
  double x = -M[1] / F[2], y = M[0] / F[2], free = M[2] - (x * F[1] - y * F[0]);
  int stands = F[2] > least;
  const double value[6] = {F[0], F[1], F[2], stands ? free : NAN, stands ? x : NAN, stands ? y : NAN};
  for (int k = 0; k < 6; k++) {
    fputc(',', out);
    cav_table_write_number(out, value[k]);
  }
}

static void write_names(FILE *out, const cav_model *m, const char *pushed) {
  static const char *const column[] = {"fx", "fy", "fz", "mz", "x", "y"};
  fputs("time", out);
  for (int b = 1; b < m->nbody; b++)
    for (int k = 0; k < 6 && pushed[b]; k++) {
      char name[300];
      if (*m->body[b].name)
        snprintf(name, sizeof name, "%.250s_%s", m->body[b].name, column[k]);
      else
        snprintf(name, sizeof name, "#%d_%s", b, column[k]);
      fputc(',', out);
      cav_table_write_text(out, name);
    }
  fputc('\n', out);
}

cav_status cav_pressure_write(const char *path, const cav_model *m, const cav_trajectory *trajectory,
                              const cav_forces *forces, cav_error *error) {
  cav_file file;
  double F[3], M[3], sign;
  char *pushed = calloc((size_t)m->nbody, 1);
  cav_status status =
      pushed ? cav_file_begin(&file, path, error) : cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory", path);
  if (!status) {
    for (int i = 0; i < forces->nforce; i++) {
      int body = pushed_body(m, &forces->force[i], &sign);
      if (body >= 0) pushed[body] = 1;
    }
    write_names(file.stream, m, pushed);
    for (int t = 0, first = 0; t < forces->nknot; first += forces->count[t++]) {
      cav_table_write_number(file.stream, t * trajectory->timestep);
      for (int b = 1; b < m->nbody; b++) {
        if (!pushed[b]) continue;
        sum(m, forces, forces->force + first, t, b, F, M);
        // the last knot of an open motion has no forces
        if (isnan(forces->unactuated[t])) F[0] = F[1] = F[2] = NAN;
        write_row(file.stream, m, F, M);
      }
      fputc('\n', file.stream);
    }
    status = cav_file_end(&file, error);
  }
  free(pushed);
  return status;
}
