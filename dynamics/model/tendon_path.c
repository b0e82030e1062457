/// Compiles tendons: the path of a spatial one with its sites and geoms found, and for every tendon the dofs that can
/// change its length. For a spatial tendon these are, piece by piece, the joints between the two bodies of its ends and
/// their nearest common ancestor.

#include <string.h>

#include "compile.h"
#include "spec.h"

// whether a path can be followed: pieces start and end at sites, geoms stand between two of them, branches are whole
static void check_path(cav_spec *spec, const cav_spec_tendon *t) {
  const cav_spec_tendon_path *path = spec->path.at ? spec->path.at + t->path : NULL;
  for (int i = 0; i < t->npath; i++) {
    int before = i > 0 ? (int)path[i - 1].type : CAV_TENDON_PATH_PULLEY;
    int after = i + 1 < t->npath ? (int)path[i + 1].type : CAV_TENDON_PATH_PULLEY;
    if (path[i].type == CAV_TENDON_PATH_PULLEY) {
      if (i > 0 && before == CAV_TENDON_PATH_PULLEY)
        cav_spec_fail(spec, path[i].node, NULL, "two pulleys in a row; put sites between them");
      if (i + 1 == t->npath) cav_spec_fail(spec, path[i].node, NULL, "a path cannot end with a pulley; add two sites");
      if (!(path[i].divisor > 0))
        cav_spec_fail(spec, path[i].node, "divisor", "expected a divisor > 0, got %g", path[i].divisor);
    } else if (path[i].type == CAV_TENDON_PATH_SITE) {
      if (before == CAV_TENDON_PATH_PULLEY && after == CAV_TENDON_PATH_PULLEY)
        cav_spec_fail(spec, path[i].node, NULL, "a site alone is no path; add another next to it");
    } else if (before != CAV_TENDON_PATH_SITE || after != CAV_TENDON_PATH_SITE) {
      cav_spec_fail(spec, path[i].node, NULL, "a geom wraps between two sites; put one before and one after it");
    }
  }
  if (t->npath == 0) cav_spec_fail(spec, t->node, NULL, "a spatial tendon needs a path; add two sites");
}

static int find(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *kind, const char *name,
                const void *first, int n, size_t stride) {
  int i = cav_name_find(first, n, stride, name);
  if (i < 0) cav_spec_unknown(spec, node, attribute, kind, name, first, n, stride);
  return i;
}

static int find_site(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *name) {
  return find(spec, node, attribute, "site", name, spec->site.at, spec->site.n, sizeof *spec->site.at);
}

// geoms say by their shape how they wrap
static void resolve_geom(cav_spec *spec, cav_spec_tendon_path *p) {
  p->object = find(spec, p->node, "geom", "geom", p->name, spec->geom.at, spec->geom.n, sizeof *spec->geom.at);
  if (p->object < 0) return;
  int type = spec->geom.at[p->object].type;
  if (type == CAV_GEOM_SPHERE)
    p->type = CAV_TENDON_PATH_SPHERE;
  else if (type == CAV_GEOM_CYLINDER)
    p->type = CAV_TENDON_PATH_CYLINDER;
  else
    cav_spec_fail(spec, p->node, "geom", "'%.60s' is no sphere or cylinder; tendons wrap around these only", p->name);
}

void cav_spec_tendon_paths(cav_spec *spec) {
  for (int i = 0; i < spec->path.n && spec->status == CAV_OK; i++) {
    cav_spec_tendon_path *p = &spec->path.at[i];
    p->object = p->side = -1;
    if (p->type == CAV_TENDON_PATH_SITE) p->object = find_site(spec, p->node, "site", p->name);
    if (p->type == CAV_TENDON_PATH_SPHERE) resolve_geom(spec, p);
    if (p->sidesite) p->side = find_site(spec, p->node, "sidesite", p->sidesite);
  }
  for (int i = 0; i < spec->tendon.n && spec->status == CAV_OK; i++) {
    if (spec->tendon.at[i].spatial) check_path(spec, &spec->tendon.at[i]);
  }
}

static int body_of(const cav_spec *spec, const cav_spec_tendon_path *p) {
  return p->type == CAV_TENDON_PATH_SITE ? spec->site.at[p->object].body : spec->geom.at[p->object].body;
}

void cav_spec_mark_between(const cav_spec *spec, int a, int b, char *mark) {
  while (a != b) {
    // parents come before children, so the later of the two is not above the other
    int *later = a > b ? &a : &b;
    const cav_spec_body *body = &spec->body.at[*later];
    for (int k = body->joint; k < body->joint + body->njoint; k++) mark[k] = 1;
    *later = body->parent;
  }
}

int cav_spec_tendon_joints(const cav_spec *spec, int tendon, char *mark) {
  const cav_spec_tendon *t = &spec->tendon.at[tendon];
  memset(mark, 0, (size_t)spec->joint.n);
  for (int k = t->part; k < t->part + t->npart; k++) {
    int joint = cav_name_find(spec->joint.at, spec->joint.n, sizeof *spec->joint.at, spec->part.at[k].joint);
    if (joint >= 0) mark[joint] = 1;
  }
  for (int k = t->path; k + 1 < t->path + t->npath; k++) {
    const cav_spec_tendon_path *p = &spec->path.at[k];
    if (p[0].type == CAV_TENDON_PATH_PULLEY || p[1].type == CAV_TENDON_PATH_PULLEY) continue;
    cav_spec_mark_between(spec, body_of(spec, p), body_of(spec, p + 1), mark);
  }
  static const int dofs[] = {[CAV_JOINT_FREE] = 6, [CAV_JOINT_BALL] = 3, [CAV_JOINT_SLIDE] = 1, [CAV_JOINT_HINGE] = 1};
  int n = 0;
  for (int k = 0; k < spec->joint.n; k++) n += mark[k] ? dofs[spec->joint.at[k].type] : 0;
  return n;
}
