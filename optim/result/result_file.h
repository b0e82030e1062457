/// Files of a result folder that the tool writes too. Private to optim/ and the tool.
#ifndef CAVORT_RESULT_FILE_H
#define CAVORT_RESULT_FILE_H

#include "cavort/result.h"

/// "folder/name" in fresh memory; NULL if there is none.
char *cav_result_path(const char *folder, const char *name);

/// Makes a folder and those above it that are missing.
cav_status cav_result_folder(const char *folder, cav_error *error);

/// problem.xml with the law contact. The model's path is written relative to the folder where the two share a folder other
/// than the root, absolute otherwise.
cav_status cav_result_write_problem(const char *folder, const cav_problem *problem, const cav_options *contact,
                                    cav_error *error);

#endif
