/// What the files that read a problem share: the tree, the model, and the memory of the result. Private to optim/.
#ifndef CAVORT_PROBLEM_FILE_H
#define CAVORT_PROBLEM_FILE_H

#include <stdio.h>

#include "cavort/problem.h"
#include "xml.h"

/// Memory that lives as long as the problem.
typedef struct cav_problem_block {
  struct cav_problem_block *next;
  double data[];
} cav_problem_block;

typedef struct cav_problem_owner {
  cav_problem problem;
  cav_model *model;
  cav_problem_block *block;
  int goal;           ///< the file has a <goal>
  char lowered[400];  ///< what height="floor" brought far down; "": nothing
  char buried[400];   ///< what it brought out of a solid; "": nothing
  char replaced[600]; ///< default costs of all joints in whose place are costs of some; "": none
} cav_problem_owner;

/// A reading in progress.
typedef struct cav_problem_reader {
  cav_problem_owner *owner;
  cav_problem *problem;
  const cav_model *model;
  const cav_xml_node *root;
  cav_state *state; ///< for readings and heights of poses
  char *moved;      ///< [njoint] set where ranges="clip" moves a joint; NULL: not noted
  int leave;        ///< 1: joints that are noted stay as at the start
  const char *path;
  cav_error *error;
} cav_problem_reader;

/// The one root element: grammar.c.
extern const cav_xml_element cav_problem_element;

/// Elements and attributes that earlier versions called otherwise: grammar.c.
extern const cav_xml_former cav_problem_former[];

/// Words of the grammar, in the order of their enumerations; NULL at the end.
extern const char *const cav_problem_orders[];
extern const char *const cav_problem_closings[];
extern const char *const cav_problem_guesses[];
extern const char *const cav_problem_dof_sets[];
extern const char *const cav_problem_springs[];
extern const char *const cav_problem_stabilisations[];
extern const char *const cav_problem_slidings[];
extern const char *const cav_problem_next_gaps[];
extern const char *const cav_problem_next_slips[];
extern const char *const cav_problem_solids[];
extern const char *const cav_problem_regularisers[];
extern const char *const cav_problem_mirrors[];
extern const char *const cav_problem_norms[];
extern const char *const cav_problem_styles[];

/// Zeroed memory of the problem; NULL if there is none left. problem.c.
void *cav_problem_alloc(cav_problem_owner *owner, size_t size);
char *cav_problem_text(cav_problem_owner *owner, const char *text);

/// Whether the file of a problem has a <goal>; else the goal posture is the start. problem.c.
int cav_problem_has_goal(const cav_problem *problem);

/// Of a problem that cav_problem_load gave: the default costs of all joints in whose place its file has costs of some of them,
/// and which, in words; "": none. term.c.
const char *cav_problem_replaced(const cav_problem *problem);

/// First child of that name, NULL if there is none; NULL node: NULL. problem.c.
const cav_xml_node *cav_problem_child(const cav_xml_node *node, const char *name);

/// Index of the first of the names in an attribute, separated by |, that the model has; -1 and an error if it has none.
int cav_problem_find(const cav_problem_reader *reader, const cav_xml_node *node, const char *attribute,
                     cav_object_type type);

/// The same for what has a frame. The name of a role (role.h) stands for a body, after the model's own names; type
/// becomes that of a geom where the role is of a part of its body.
int cav_problem_find_frame(const cav_problem_reader *reader, const cav_xml_node *node, const char *attribute,
                           cav_object_type *type);

/// Configuration q [nq] of <start>, <goal> or <pose>, from keyframes, numbers, a trajectory and joint values. pose.c.
cav_status cav_problem_pose(const cav_problem_reader *reader, const cav_xml_node *node, double *q);

/// Whether a posture, or the <pose> that it names, states a joint by degrees=. pose.c.
int cav_problem_in_degrees(const cav_problem_reader *reader, const cav_xml_node *node, int joint);

/// Velocity v [nv] at the knot that a node takes its posture from. pose.c.
cav_status cav_problem_pose_velocity(const cav_problem_reader *reader, const cav_xml_node *node, double *v);

/// What the <root> and <joint> of <start> say of velocities, into v [nv]; q [nq]: the posture that it has. pose.c.
cav_status cav_problem_pose_moves(const cav_problem_reader *reader, const cav_xml_node *node, const double *q,
                                  double *v);

/// Configuration of the keyframe or <pose> that attribute 'key' of node names.
cav_status cav_problem_key(const cav_problem_reader *reader, const cav_xml_node *node, double *q);

/// A number from least (DBL_MIN: above 0) to most (DBL_MAX: any), left as it is where the file gives none. fields.c.
cav_status cav_problem_real(const cav_problem_reader *reader, const cav_xml_node *node, const char *name, double least,
                            double most, double *value);

/// A struct by the table of its n fields, an attribute each; what the file does not give stays, all of it if node is
/// NULL. fields.c.
cav_status cav_problem_read_fields(const cav_problem_reader *reader, const cav_xml_node *node, const cav_field *field,
                                   int n, void *values);

/// Attributes that read back to the same bits. fields.c.
void cav_problem_write_fields(FILE *out, const cav_field *field, int n, const void *values);

/// Text of the children of a <scene>, as it is written; NULL without memory. write.c.
char *cav_problem_scene(cav_problem_owner *owner, const cav_xml_node *scene);

/// Window of attributes from, to, at: seconds or "end". Left as they are where the file gives none; to < 0: the end. It
/// holds a knot. term.c.
cav_status cav_problem_window(const cav_problem_reader *reader, const cav_xml_node *node, double *from, double *to);

/// Of a step: how far the duration may be from a whole number of them.
#define CAV_WHOLE_STEP 1e-6

/// <guess>, once start and goal are known. initial_guess.c.
cav_status cav_problem_initial_guess(const cav_problem_reader *reader);

/// All <parameter>, and the values that they give the model, of which no state may be left. parameter_list.c.
cav_status cav_problem_parameters(const cav_problem_reader *reader);

/// Why a parameter cannot be one of a model; NULL: it can. parameter_list.c.
const char *cav_problem_wrong_parameter(const cav_model *model, const cav_parameter *parameter);

/// <cycle>, once the start is known. cycle.c.
cav_status cav_problem_cycle(const cav_problem_reader *reader);

/// Terms of <cost> and <constraint>, with the defaults that they leave in place. term.c.
cav_status cav_problem_terms(const cav_problem_reader *reader);

/// Whether a term has a say: a cost with a weight, a constraint, or how fast contacts may slide. term.c.
int cav_term_counts(const cav_term *term);

/// Sensor of an element, declared there or by the model's name for it, into term->sensor and component. term.c.
cav_status cav_problem_sensor(const cav_problem_reader *reader, const cav_xml_node *node, cav_term *term);

/// Whether zeros are no wish: a sensor reads a place in the world, or a direction. term.c.
int cav_problem_needs_target(const cav_term *term);

/// Terms of a <track>, copies of base with a record each: *n of them, CAV_TRACK_TERMS at most. track.c.
enum { CAV_TRACK_TERMS = 3 };
cav_status cav_problem_track(const cav_problem_reader *reader, const cav_xml_node *node, const cav_term *base,
                             cav_term *term, int *n);

/// Targets of a term as a table gives them.
typedef struct cav_problem_targets {
  int count;            ///< numbers of a target, given
  int n;                ///< rows
  double *time, *value; ///< [n], [n*count], memory of the problem
} cav_problem_targets;

/// Table of attribute 'file' of a term, its columns by attribute 'columns'. target_table.c.
cav_status cav_problem_table(const cav_problem_reader *reader, const cav_xml_node *node, cav_problem_targets *targets);

/// Whether a term over dofs selects dof d. term.c.
int cav_problem_selects(const cav_model *model, const cav_term *term, int d);

/// Whether a joint is a wheel: an unlimited hinge through the centre of mass of what it turns, that carries nothing and, where it
/// slides, too, is a ball. No angle of it is a posture. term.c.
int cav_problem_is_wheel(const cav_model *model, int joint);

/// Fills error with "no memory"; returns CAV_NO_MEMORY.
cav_status cav_problem_no_memory(const cav_problem_reader *reader);

#endif
