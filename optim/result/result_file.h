/// Files of a result folder that the tool writes too. Private to optim/ and the tool.
#ifndef CAVORT_RESULT_FILE_H
#define CAVORT_RESULT_FILE_H

#include "cavort/result.h"

/// "folder/name" in fresh memory; NULL if there is none.
char *cav_result_path(const char *folder, const char *name);

/// Path of a file as seen from a folder, in fresh memory; where they share the root alone absolute, unless relative is 1.
/// NULL with the reason in error: one of them is not there.
char *cav_result_seen_from(const char *folder, const char *file, int relative, cav_error *error);

/// The folder of a path, in fresh memory: "." where it names none.
char *cav_result_folder_of(const char *path);

/// Makes a folder and those above it that are missing.
cav_status cav_result_folder(const char *folder, cav_error *error);

/// trajectory.csv of a motion of the problem: of one that ends open without u in the last row.
cav_status cav_result_write_motion(const char *path, const cav_problem *problem, const cav_trajectory *trajectory,
                                   cav_error *error);

/// problem.xml with the law contact. The model's path is written relative to the folder where the two share a folder other
/// than the root, absolute otherwise.
cav_status cav_result_write_problem(const char *folder, const cav_problem *problem, const cav_options *contact,
                                    cav_error *error);

#endif
