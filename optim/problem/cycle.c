/// <cycle> of a problem file: a motion that goes on where it began, moved, turned or mirrored. Whether model and ground
/// allow that is checked by periodicity.c, here with file and line.
#include <math.h>
#include <stdlib.h>

#include "periodicity.h"
#include "problem_file.h"

// declared counterparts; those without a name in the model are told
static cav_status read_pairs(const cav_problem_reader *reader, const cav_xml_node *node) {
  cav_cycle *cycle = &reader->problem->cycle;
  const cav_xml_node *first = cav_problem_child(node, "pair");
  int n = 0;
  for (const cav_xml_node *pair = first; pair; pair = cav_xml_next(pair)) n++;
  if (n == 0) return CAV_OK;
  if (cycle->mirror == CAV_MIRROR_NONE)
    return cav_xml_fail(reader->error, first, NULL,
                        "counterparts are for a mirrored cycle; give 'mirror' or remove it");
  int(*list)[2] = cav_problem_alloc(reader->owner, (size_t)n * sizeof *list);
  if (!list) return cav_problem_no_memory(reader);
  cycle->pair = (const int(*)[2])list;
  for (const cav_xml_node *pair = first; pair; pair = cav_xml_next(pair)) {
    int joint = cav_problem_find(reader, pair, "joint", CAV_OBJECT_JOINT);
    int other = joint < 0 ? -1 : cav_problem_find(reader, pair, "other", CAV_OBJECT_JOINT);
    if (other < 0) return CAV_BAD_INPUT;
    for (int i = 0; i < 2 * cycle->npair; i++) {
      int named = list[i / 2][i % 2];
      if (named == joint || named == other)
        return cav_xml_fail(reader->error, pair, NULL, "joint '%s' has a counterpart already",
                            reader->model->joint[named].name);
    }
    list[cycle->npair][0] = joint;
    list[cycle->npair++][1] = other;
  }
  return CAV_OK;
}

cav_status cav_problem_cycle(const cav_problem_reader *reader) {
  const cav_xml_node *node = cav_problem_child(reader->root, "cycle");
  const cav_xml_node *horizon = cav_problem_child(reader->root, "horizon");
  cav_problem *p = reader->problem;
  if (!node) return CAV_OK;
  if (cav_xml_get(horizon, "close"))
    return cav_xml_fail(reader->error, horizon, "close", "contradicts <cycle>, which closes the motion on its start");
  if (p->free_start)
    return cav_xml_fail(reader->error, cav_problem_child(reader->root, "start"), "free",
                        "is for a motion with a start; that of a <cycle> is free as it is: leave it out");
  if (lround(p->duration / p->timestep) < 3)
    return cav_xml_fail(reader->error, horizon, "duration", "a cycle needs at least three steps");
  p->cycle.on = 1;
  p->cycle.mirror = (cav_mirror)cav_xml_word(node, "mirror", CAV_MIRROR_NONE);
  p->cycle.rotation = cav_xml_real(node, "rotation", 0) * M_PI / 180;
  cav_xml_reals(node, "translation", p->cycle.translation, 3);
  cav_status status = read_pairs(reader, node);
  if (status) return status;
  cav_error inner = {0};
  cav_periodicity *periodicity = cav_periodicity_new(p, &inner);
  if (!periodicity) return cav_xml_fail_as(reader->error, inner.status, node, NULL, "%s", inner.text);
  cav_periodicity_free(periodicity);
  return CAV_OK;
}
