/// Every kind of broken problem file, each with the line and the word that its error names.
#include "cavort/problem.h"
#include "problem_folder.h"

// expects a file to be refused with this line and these words
static void refuse(const char *text, int line, const char *words) {
  cav_error error = {0};
  write_in("problem.xml", text);
  cav_problem *problem = cav_problem_load(path, NULL, &error);
  CHECK(problem == NULL);
  char place[160];
  snprintf(place, sizeof place, "%s:%d: ", path, line);
  int said = error.status == CAV_BAD_INPUT && error.line == line && !strncmp(error.text, place, strlen(place)) &&
             strstr(error.text, words);
  CHECK(said);
  if (!said) fprintf(stderr, "    expected %s...%s, got %s\n", place, words, error.text);
  cav_problem_free(problem);
  // the same without a place for the error
  problem = cav_problem_load(path, NULL, NULL);
  CHECK(problem == NULL);
}

// a fault on line 5 of an otherwise good file, inside <cost> or <constraint>
static void refuse_cost(const char *element, const char *words) {
  char text[2000];
  snprintf(text, sizeof text, HEAD "<cost>\n%s\n</cost>\n" TAIL, element);
  refuse(text, 5, words);
}

static void refuse_constraint(const char *element, const char *words) {
  char text[2000];
  snprintf(text, sizeof text, HEAD "<constraint>\n%s\n</constraint>\n" TAIL, element);
  refuse(text, 5, words);
}

// a fault on line 3, in the start
static void refuse_start(const char *element, const char *words) {
  char text[2000];
  snprintf(text, sizeof text, "<problem model='leg.xml'>\n<horizon duration='1'/>\n%s\n</problem>", element);
  refuse(text, 3, words);
}

// names of earlier versions: the error says what they are called now
static void check_former_names(void) {
  refuse(HEAD "<scene><remove body='shin'/>\n<leave body='shin'/></scene>\n" TAIL, 5,
         "<leave>: is called <remove> now");
  refuse_cost("<overlap weight='1'/>", "<overlap>: is called <self_penetration> now");
  refuse(HEAD "<cycle\nturn='30'/>" TAIL, 4, "attribute 'turn': is called 'rotation' now");
  refuse(HEAD "<guess turn='0 1 0'/>" TAIL, 4, "attribute 'turn': is called 'rotation' now");
  refuse(HEAD "<schedule><first\nself_share='.5'/></schedule>" TAIL, 4, "'self_share': is called 'self_stiffness' now");
  refuse(HEAD "<schedule>\n<last self_share='1'/></schedule>" TAIL, 5, "'self_share': is called 'self_stiffness' now");
  refuse(HEAD "<contact guard='true'/>" TAIL, 4, "'guard': is called 'refsafe' now");
  refuse(HEAD "<contact self_share='1'/>" TAIL, 4, "'self_share': is called 'self_stiffness' now");
  // elsewhere the same words are no former names
  refuse(HEAD "<overlap/>" TAIL, 4, "not known inside problem");
  refuse(HEAD "<schedule turn='1'/>" TAIL, 4, "not known here");
  refuse_cost("<gap weight='1' overlap='1'/>", "not known here");
}

static void check_broken_files(void) {
  refuse("<problem model='leg.xml'>\n<horizon duration='1'/>\n<start>\n</problem>", 4, "");
  refuse("<mujoco/>", 1, "mujoco");
  refuse("<problem>\n<horizon duration='1'/>\n<start/></problem>", 1, "model");
  refuse("<problem model='none.xml'>\n<horizon duration='1'/>\n<start/></problem>", 1, "none.xml");
  refuse("<problem model='leg.xml'>\n<start/></problem>", 1, "horizon");
  refuse("<problem model='leg.xml'>\n<horizon duration='1'/></problem>", 1, "start");
  refuse("<problem model='leg.xml'>\n<horizon/>\n<start/></problem>", 2, "duration");
  refuse("<problem model='leg.xml'>\n<horizon duration='nan'/>\n<start/></problem>", 2, "duration");
  refuse("<problem model='leg.xml'>\n<horizon duration='-1'/>\n<start/></problem>", 2, "above 0");
  refuse("<problem model='leg.xml'>\n<horizon duration='1' timestep='.3'/>\n<start/></problem>", 2, "whole number");
  refuse("<problem model='leg.xml'>\n<horizon duration='1' timestep='1e-9'/>\n<start/></problem>", 2,
         "'timestep': expected 2 to 1e+06 steps");
  refuse("<problem model='leg.xml'>\n<horizon duration='1' timestep='.7'/>\n<start/></problem>", 2,
         "'timestep': expected 2 to 1e+06 steps of 0.7 s in a duration of 1 s, got 1.42857; shorten the step");
  refuse("<problem model='leg.xml'>\n<horizon duration='1' order='middle'/>\n<start/></problem>", 2, "midpoint");
  refuse(HEAD "<cast/>\n" TAIL, 4, "did you mean <cost>");
  refuse(HEAD "<guess type='interpolated'/>\n" TAIL, 4, "did you mean 'interpolate'");
  refuse(HEAD "<guess from='.1'/>\n" TAIL, 4, "apex");
  refuse(HEAD "<guess apex='-1'/>\n" TAIL, 4, "apex");
  refuse(HEAD "<limits effort='1.5'/>\n" TAIL, 4, "'effort': expected a number above 0, at most 1, got '1.5'");
  refuse(HEAD "<schedule stages='0'/>\n" TAIL, 4, "stages");
  refuse(HEAD "<ipopt max_itr='3'/>\n" TAIL, 4, "did you mean 'max_iter'");
  refuse(HEAD "<ipopt max_iter='3.5'/>\n" TAIL, 4, "expected a whole number of at least 0, got '3.5'");
  refuse(HEAD "<ipopt mu_init='0'/>\n" TAIL, 4, "expected a number above 0, got '0'");
  refuse(HEAD "<ipopt mumps_pivtol='2'/>\n" TAIL, 4, "from 0 up to 1");
  refuse(HEAD "<ipopt hessian_approximation='limited'/>\n" TAIL, 4, "exact limited-memory");
  refuse(HEAD "<schedule>\n<first softness='0'/></schedule>\n" TAIL, 5, "softness");
  refuse(HEAD "<schedule>\n<last iterations='0'/></schedule>\n" TAIL, 5, "iterations");
  refuse(HEAD
         "<contact timestep='.1' softness='1' time_constant='0' smoothing='0' smoothing_self='0' impratio='1'/>\n" TAIL,
         4, "horizon");
}

static void refuse_scene(const char *element, const char *words) {
  char text[2000];
  snprintf(text, sizeof text,
           "<problem model='leg.xml'>\n<scene>\n%s\n</scene>\n<horizon duration='1'/>\n<start/></problem>", element);
  refuse(text, 3, words);
}

static void check_broken_scenes(void) {
  refuse_scene("<gem/>", "did you mean <geom>");
  refuse_scene("<geom type='box' size='.1'/>", "size");
  refuse_scene("<geom name='shin' size='.1'/>", "; choose another");
  refuse_scene("<geom name='floor' type='plane' size='1 1 1'/>",
               "; the model has this floor, so remove the plane of the <scene>");
  refuse_scene("<geom name='floor' type='box' size='1 1 1'/>", "; choose another");
  refuse_scene("<geom class='hard' size='.1'/>", "no default class 'hard'");
  refuse_scene("<geom material='wood' size='.1'/>", "no material 'wood'");
  refuse_scene("<geom type='mesh' mesh='rock'/>", "rock");
  refuse_scene("<body><freejoint/></body>", "mass");
  refuse(HEAD "<goal><root pos='0 0 0'/></goal>\n" TAIL, 4, "no free joint");
  refuse(SCENE_HEAD "<goal><root joint='crte'/></goal>\n" TAIL, 8, "did you mean 'crate'");
  refuse(SCENE_HEAD "<goal><root joint='door'/></goal>\n" TAIL, 8, "is not free; use <joint>");
  refuse(SCENE_HEAD "<goal rise='.2'/>\n" TAIL, 8, "add height='floor'");
}

// a tolerance of what has no target: what to ask in its place
static void check_untouched(void) {
  static const char *const force[] = {"force", "edge_force"}, *const others[] = {"gap", "impact", "clearance",
                                                                                 "self_penetration", "self_force"};
  char text[200];
  for (int i = 0; i < 7; i++) {
    snprintf(text, sizeof text, "<%s weight='1' within='.1'/>", i < 2 ? force[i] : others[i - 2]);
    refuse_cost(text, i < 2 ? "<constraint><sensor type=\"touch\" body=\"NAME\" upper=\"0\"/></constraint>"
                            : "no tolerance; a higher weight");
  }
  refuse_cost("<slip weight='1' within='fast'/>", "or 'any', got 'fast'");
}

// words of other files: what stands for them here, where the element has it
static void check_synonyms(void) {
  refuse_cost("<sensor weight='1' type='framepos' body='trunk' tolerance='.1'/>",
              "'tolerance': not known here; did you mean 'within'?");
  refuse_cost("<sensor weight='1' type='framepos' body='trunk' position='0 0 1'/>", "did you mean 'target'?");
  refuse_cost("<sensor weight='1' type='framepos' body='trunk' target='0 0 1' time='.5'/>", "did you mean 'at'?");
  refuse_cost("<posture cost='1'/>", "did you mean 'weight'?");
  refuse_cost("<sensor weight='1' type='framepos' link='trunk' target='0 0 1'/>", "did you mean 'body'?");
  refuse_cost("<framepos weight='1'/>", "not known inside cost");
  refuse_start("<start><joint name='knee' position='1'/></start>", "did you mean 'pos'?");
  refuse_start("<start><joint name='knee' angle='1'/></start>", "did you mean 'degrees'?");
  refuse_start("<start pose='bent'/>", "did you mean 'key'?");
  refuse("<problem model='leg.xml'>\n<horizon duration='1' dt='.1'/>\n<start/></problem>", 2,
         "did you mean 'timestep'?");
  refuse("<problem model='leg.xml'>\n<horizon time='1'/>\n<start/></problem>", 2, "did you mean 'duration'?");
  refuse("<problem robot='leg.xml'>\n<horizon duration='1'/>\n<start/></problem>", 1, "did you mean 'model'?");
  refuse(HEAD "<objective/>\n" TAIL, 4, "did you mean <cost>?");
  refuse(HEAD "<world/>\n" TAIL, 4, "did you mean <scene>?");
  refuse_scene("<geom type='box' size='.1 .1 .1' position='1 0 0'/>", "did you mean 'pos'?");
  // where the element has no such attribute spelling counts
  refuse(HEAD "<limits tolerance='1'/>\n" TAIL, 4, "'tolerance': not known here; remove it");
}

static void check_broken_starts(void) {
  refuse_start("<start key='bend'/>", "did you mean 'bent'");
  refuse_start("<start key='satnd'/>", "did you mean 'stand'");
  refuse_start("<start qpos='1 2 3'/>", "expected 4 numbers");
  refuse_start("<start qpos='0 0 0 0' key='bent'/>", "contradicts");
  refuse_start("<start qvel='1'/>", "expected 4 numbers");
  refuse_start("<start knot='last'/>", "file");
  refuse_start("<start velocity='file'/>", "attribute 'file', which is missing");
  refuse_start("<start file='absent.csv'/>", "absent.csv");
  refuse_start("<start><joint name='ankle' pos='1'/></start>",
               "no joint of that name, got 'ankle'; it has x, z, pitch, knee");
  refuse_start("<start><joint name='kne' pos='1'/></start>", "did you mean 'knee'");
  refuse_start("<start><joint name='NE' pos='1'/></start>", "has no joint of that name, got 'NE'; it has knee");
  refuse_start("<start><joint name='knee'/></start>", "one of the attributes");
  refuse_start("<start><root vel='1 0 0'/></start>", "attribute 'vel': not known here");
  refuse("<problem name='p' model='leg.xml'>\n" SCENE
         "<horizon duration='1'/>\n<start><joint name='crate' vel='1'/></start>\n</problem>",
         7, "joint 'crate' has more than one velocity; use <root linvel='' angvel=''>");
  refuse(HEAD "<goal><joint name='knee' pos='1' vel='1'/></goal>\n" TAIL, 4, "attribute 'vel': not known here");
  refuse_start("<start><joint name='knee' pos='0' degrees='0'/></start>", "one of the attributes");
  refuse_start("<start><joint name='x' degrees='10'/></start>", "slides");
  refuse_start("<start><joint name='knee' quat='1 0 0 0'/></start>", "pos");
  refuse_start("<start><joint name='knee' degrees='45'/></start>", "outside its range");
  refuse_start("<start><root pos='0 0 1'/></start>", "no free joint");
  refuse_start("<start key='a'/><pose name='a' key='b'/><pose name='b' key='a'/>", "circle");
  refuse_start("<start key='a'/><pose name='a' key='a'/>", "neither");
}

static void check_broken_terms(void) {
  refuse_cost("<posture joint='knee' qpos='1 2' weight='1'/>",
              "expected 4 numbers for the model 'leg', or one for the joint");
  refuse_cost("<posture qpos='1' weight='1'/>", "expected 4 numbers for the model 'leg', got 1");
  refuse_cost("<posture degrees='30' weight='1'/>", "is the angle of one hinge; name it by 'joint' of <posture>");
  refuse_cost("<posture dofs='all' weight='1'><waypoint time='0' degrees='3'/></posture>", "name it by 'joint'");
  refuse_cost("<posture joint='x' degrees='30' weight='1'/>", "joint 'x' slides; give its metres in 'qpos'");
  refuse_cost("<posture joint='knee' degrees='-30 1' weight='1'/>", "degrees");
  refuse_cost("<posture joint='knee' degrees='-30' qpos='1' weight='1'/>", "contradicts attribute 'qpos'");
  refuse_constraint("<posture joint='knee' degrees='-30' key='bent'/>", "contradicts attribute 'key'");
  refuse_constraint("<posture joint='knee' degrees='-30'><waypoint time='0' degrees='3'/></posture>", "contradicts");
  refuse("<problem name='p' model='leg.xml'>\n" SCENE
         "<horizon duration='1'/>\n<start/><cost><posture joint='crate' degrees='1' weight='1'/></cost>\n</problem>",
         7, "joint 'crate' is no hinge; give a posture by 'key' or 'qpos'");
  refuse_cost("<style name='brave'/>", "careful");
  refuse_cost("<style/>", "name");
  refuse_cost("<effort/>", "weight");
  refuse_cost("<effort weight='-1'/>", "weight");
  refuse_cost("<effort weight='1e300'/>", "expected a number from 0 to 1e+16, got 1e+300");
  refuse_cost("<effort weight='1' scale='0'/>", "scale");
  refuse_cost("<effort weight='1' lower='0'/>", "not known here; remove it");
  refuse_cost("<velocity weight='1' lower='0'/>",
              "'lower': not known here; it belongs to <velocity> inside <constraint>");
  refuse_constraint("<velocity upper='1' weight='1'/>",
                    "'weight': not known here; it belongs to <velocity> inside <cost>");
  refuse_cost("<slip weight='1' at='2'/>", "within the horizon");
  refuse_cost("<slip weight='1' at='later'/>", "'end'");
  refuse_cost("<slip weight='1' at='.5' from='.1'/>", "contradicts");
  refuse_cost("<slip weight='1' from='.5' to='.2'/>", "before it starts");
  refuse_cost("<slip weight='1' from='.51' to='.54'/>", "no knot");
  refuse_cost("<velocity weight='1' dofs='joints' joint='knee'/>", "contradicts");
  refuse_cost("<velocity weight='1' joint='elbow'/>", "no joint of that name");
  refuse_cost("<velocity weight='1' dofs='all' target='1 2'/>", "one number, or 4");
  refuse_cost("<posture weight='1' key='bent' qpos='0 0 0 0'/>", "contradicts");
  refuse_cost("<posture weight='1' qpos='0'/>", "expected 4 numbers");
  refuse_cost("<posture weight='1' key='bent'><waypoint time='0' key='bent'/></posture>", "contradicts");
  refuse_cost("<posture weight='1'><waypoint time='0'/></posture>", "key");
  refuse_cost("<posture weight='1'><waypoint time='.5' key='bent'/><waypoint time='.5' key='bent'/></posture>",
              "after the one before");
  refuse_cost("<posture weight='1'><waypoint time='5' key='bent'/></posture>", "within the horizon");
  refuse_cost("<sensor weight='1'/>", "type");
  refuse_cost("<sensor weight='1' name='eyes'/>", "did you mean 'eye'");
  refuse_cost("<sensor weight='1' type='framepos'/>", "needs one of");
  refuse_cost("<sensor weight='1' type='framepoz' body='trunk'/>", "did you mean 'framepos'");
  refuse_cost("<sensor weight='1' type='framepos' body='turnk' target='0 0 1'/>", "did you mean 'trunk'");
  refuse_cost("<sensor weight='1' type='framepos' body='trunk' site='eye'/>", "contradicts");
  refuse_cost("<sensor weight='1' type='framepos' joint='knee'/>", "looks at");
  refuse_cost("<sensor weight='1' type='subtreecom' site='eye'/>", "looks at");
  refuse_cost("<sensor weight='1' type='gyro' body='trunk'/>", "looks at a site");
  refuse_cost("<sensor weight='1' type='touch' joint='knee'/>", "a touch looks at a body, geom or site");
  refuse_cost("<sensor weight='1' type='touch' body='trunk' target='-5'/>", "a touch is never negative");
  refuse_cost("<sensor weight='1' type='touch'/>",
              "attribute 'body': is missing; a touch needs one of: body, geom or site");
  refuse_cost("<sensor weight='1' type='clock'/>", "nothing of the motion");
  refuse_cost("<sensor weight='1' name='time'/>", "nothing of the motion");
  refuse_cost("<sensor weight='1' type='ballquat' joint='knee'/>", "needs a ball joint");
  refuse_cost("<sensor weight='1' type='jointlimitpos' joint='pitch'/>", "needs a joint with a limit");
  refuse_cost("<sensor weight='1' type='actuatorfrc' actuator='knees'/>", "did you mean 'knee'");
  refuse_cost("<sensor weight='1' type='framepos' body='trunk' refname='eye'/>", "needs both");
  refuse_cost("<sensor weight='1' type='framelinacc' body='trunk' reftype='site' refname='eye'/>", "no other frame");
  refuse_cost("<sensor weight='1' type='accelerometer' site='eye' relative='start'/>", "at rest");
  refuse_cost("<sensor weight='1' type='framepos' body='trunc'/>", "did you mean 'trunk'");
  refuse_cost("<sensor weight='1' type='framepos' body='trunk' target='1 2'/>", "expected 3 numbers");
  refuse_cost("<sensor weight='1' type='framepos' body='trunk' component='x'/>",
              "give a place in the world, or relative=");
  refuse_cost("<sensor weight='1' type='subtreecom' body='trunk'/>", "give a place in the world, or relative=");
  refuse_cost("<sensor weight='1' type='framexaxis' body='trunk' reftype='body' refname='shin'/>", "give a direction");
  refuse_cost("<sensor weight='1' type='framepos' body='trunk' component='z' target='1 2 3'/>", "expected 1 number");
  refuse_cost("<sensor weight='1' type='framepos' body='trunk' component='w'/>", "x, y or z");
  refuse_cost("<sensor weight='1' type='jointpos' joint='knee' component='x'/>", "one value");
  refuse_cost("<sensor weight='1' type='framequat' body='trunk' target='0 0 0 0'/>", "not zero");
  refuse_cost("<sensor weight='1' type='framelinvel' body='trunk' relative='goal'/>", "at rest");
  refuse_constraint("<sensor type='framepos' body='trunk' component='z' lower='2' upper='1'/>", "above 'upper'");
  refuse_constraint("<force body='trunk'/>", "what must not touch is <sensor type=\"touch\"");
  refuse_constraint("<sensor type='framepos' body='trunk' component='z' target='1' within='0'/>", "above 0");
  refuse_constraint("<effort upper='1'/>", "effort");
  refuse_constraint("<velocity weight='1'/>", "weight");
}

static void check_other_model(void) {
  char model[160];
  cav_error error = {0};
  snprintf(model, sizeof model, "%s/flyer.xml", folder);
  write_in("problem.xml",
           "<problem model='leg.xml'>\n<horizon duration='1'/>\n<start/>\n<cost>\n<velocity joint='knee' "
           "weight='1'/></cost></problem>");
  cav_problem *p = cav_problem_load(path, model, &error);
  CHECK(!p && error.line == 5 && strstr(error.text, "flyer") && strstr(error.text, "no joint of that name"));
  cav_problem_free(p);
  p = cav_problem_load(path, "/nowhere/model.xml", &error);
  CHECK(!p && error.status == CAV_BAD_INPUT && strstr(error.text, "/nowhere/model.xml"));
  p = cav_problem_load("/nowhere/problem.xml", NULL, &error);
  CHECK(!p && error.status == CAV_BAD_INPUT && strstr(error.text, "/nowhere/problem.xml"));
}

int main(void) {
  begin_folder();
  refuse_cost("<sensor type='framepos' body='floor' weight='1'/>",
              "no body 'floor', but a geom of that name: give it as attribute 'geom'");
  refuse_cost("<force body='floor' weight='1'/>",
              "a geom of that name in the world itself: put it into a <body name=\"floor\">");
  check_broken_files();
  check_former_names();
  check_broken_scenes();
  check_untouched();
  check_synonyms();
  check_broken_starts();
  check_broken_terms();
  check_other_model();
  end_folder(NULL, 0);
  return check_result();
}
