/// Exit statuses of the tool and of the processes that it starts.
#ifndef CAVORT_EXIT_STATUS_H
#define CAVORT_EXIT_STATUS_H

enum {
  CAV_EXIT_CERTIFIED = 0, ///< or done, where nothing is certified
  CAV_EXIT_NOT_CERTIFIED = 1,
  CAV_EXIT_BAD_INPUT = 2,
  CAV_EXIT_INTERNAL = 3,
  CAV_EXIT_INTERRUPTED = 130
};

#endif
