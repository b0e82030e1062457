/// Trees that a plan leaves out. Private to optim/.
#ifndef CAVORT_IDLE_H
#define CAVORT_IDLE_H

#include "cavort/solve.h"
#include "part.h"

/// A problem without its idle trees, and these. All borrow from the whole.
typedef struct cav_idle {
  const cav_problem *whole;
  int ntree, ndof;       ///< left out; ntree 0: none, and the rest of this is empty
  cav_part plan, idle;   ///< of the model
  cav_problem problem;   ///< over plan.model
  cav_trajectory *alone; ///< the idle trees by themselves, at the problem's step
  void *owner;
} cav_idle;

/// Finds the trees that no actuator moves, no term asks for, nothing joins to others, and nothing comes near: what they
/// do follows from the dynamics alone. CAV_NO_MEMORY.
cav_status cav_idle_find(const cav_problem *problem, cav_idle *idle);
void cav_idle_clear(cav_idle *idle);

/// A trajectory of the whole without the idle trees; NULL if memory runs out.
cav_trajectory *cav_idle_reduce(const cav_idle *idle, const cav_trajectory *whole);

/// Makes a solution of idle->problem one of the whole: the idle trees move as its law has it. *alone 0: something meets
/// them, or they are not at rest where the motion closes so; then the problem has to be solved as a whole. CAV_NO_MEMORY;
/// the solution stays as it was if this fails.
cav_status cav_idle_expand(const cav_idle *idle, double tolerance, cav_solution *solution, int *alone);

#endif
