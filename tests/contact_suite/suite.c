/// The contact suite by name: contact_suite [quick] [SCENE...]; all scenes by default. standing and dragging take seconds of
/// simulated time behind a colon: standing:3600. Rows of the table of results/contact_suite.md.
#include "suite.h"

typedef struct entry {
  const char *name;
  void (*run)(int quick);
} entry;

static const entry entries[] = {
    {"rolling", suite_rolling}, {"balls", suite_balls},   {"robot", suite_robot},       {"bodies", suite_bodies},
    {"hand", suite_hand},       {"chains", suite_chains}, {"humanoid", suite_humanoid}, {"laws", suite_laws},
};

// whether an argument names it; seconds behind a colon
static int chosen(int argc, char **argv, int first, const char *name, double *seconds) {
  for (int i = first; i < argc; i++) {
    const size_t n = strlen(name);
    if (strncmp(argv[i], name, n) || (argv[i][n] && argv[i][n] != ':')) continue;
    if (argv[i][n]) *seconds = atof(argv[i] + n + 1);
    return 1;
  }
  return first == argc;
}

int main(int argc, char **argv) {
  const int quick = argc > 1 && !strcmp(argv[1], "quick"), first = 1 + quick;
  double standing = 120, dragging = 120, none = 0;
  for (size_t k = 0; k < sizeof entries / sizeof *entries; k++)
    if (chosen(argc, argv, first, entries[k].name, &none)) entries[k].run(quick);
  if (chosen(argc, argv, first, "standing", &standing)) suite_standing(standing);
  if (chosen(argc, argv, first, "dragging", &dragging)) suite_dragging(dragging);
  return suite_result();
}
