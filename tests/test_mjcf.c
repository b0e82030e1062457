/// Broken model files: every one gives an error with file and line, never a crash and never a model. The files are in
/// tests/broken; what no one wants in a repository (100 MB of brackets, binary junk, a folder, every truncation of a
/// good file, random damage) is made here. Where no sanitizer owns malloc, the n-th allocation fails, for every n.

#include <errno.h>
#include <locale.h>
#include <pthread.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cavort/dynamics.h"
#include "cavort/model.h"
#include "check.h"

#ifndef CAVORT_SOURCE_ROOT
#define CAVORT_SOURCE_ROOT "."
#endif

static const struct {
  const char *name;
  int line;
  const char *says;
} broken[] = {
    {"unclosed", 6, "not well-formed"},
    {"mismatched", 3, "not well-formed"},
    {"two_values", 2, "redefined"},
    {"unknown_element", 4, "did you mean <joint>"},
    {"unknown_attribute", 5, "did you mean 'size'"},
    {"wrong_place", 2, "not known inside mujoco"},
    {"wrong_root", 1, "expected one of: mujoco"},
    {"doctype", 2, "document types"},
    {"entity", 1, "not well-formed"},
    {"missing_include", 3, "is_not_there.xml: cannot be opened"},
    {"include_folder", 2, "is a folder"},
    {"include_empty_name", 2, "expected a text"},
    {"cyclic", 3, "in a circle"},
    {"cyclic_part", 2, "in a circle"},
    {"twice", 3, "included twice"},
    {"part", 1, "expected one of: mujoco"},
    {"include_root", 2, "not known inside mujoco"},
    {"nan", 5, "got 'nan'"},
    {"infinite", 5, "got '1e999'"},
    {"hexadecimal", 5, "got '0x1p-3'"},
    {"word", 4, "did you mean 'hinge'"},
    {"boolean", 4, "expected one of: false, true, auto"},
    {"count", 4, "expected 3 numbers, got 2"},
    {"too_many", 5, "expected 1 to 3 numbers, got 4"},
    {"not_whole", 5, "expected 1 whole number"},
    {"zero_mass", 3, "has no mass"},
    {"negative_mass", 5, "expected a mass >= 0"},
    {"negative_density", 5, "expected a density >= 0"},
    {"zero_size", 5, "> 0 for a sphere"},
    {"missing_size", 5, "3 numbers > 0 for a box"},
    {"huge", 5, "not finite"},
    {"inertia", 3, "moments of inertia"},
    {"negative_inertia", 3, "numbers >= 0"},
    {"no_inertia", 3, "has no inertia"},
    {"two_inertias", 5, "diaginertia gives"},
    {"inertial_twice", 6, "at most 1"},
    {"free_inside", 4, "free joint"},
    {"free_and_hinge", 4, "stands alone"},
    {"too_many_dofs", 3, "at most 6"},
    {"duplicate", 5, "'a' is taken already"},
    {"unknown_joint", 9, "no joint is named 'b'"},
    {"near_joint", 9, "did you mean 'elbow'"},
    {"unknown_body", 9, "no body is named 'x'"},
    {"unknown_geom", 9, "no geom is named 'x'"},
    {"unknown_class", 5, "no default class 'thin'"},
    {"unknown_childclass", 3, "no default class 'thin'"},
    {"unknown_material", 5, "no material 'gold'"},
    {"unknown_object", 9, "no site is named 'tip'"},
    {"class_twice", 4, "taken already"},
    {"class_nameless", 3, "is missing"},
    {"range", 4, "lower < upper"},
    {"range_missing", 4, "lower < upper"},
    {"ball_range", 4, "range starts at 0"},
    {"key_qpos", 9, "expected 1 numbers"},
    {"key_qvel", 9, "expected 1 numbers"},
    {"world_inertia", 3, "not known inside worldbody"},
    {"world_joint", 3, "not known inside worldbody"},
    {"two_orientations", 5, "quat gives the orientation"},
    {"zero_quat", 5, "expected a direction"},
    {"parallel_axes", 5, "parallel"},
    {"zero_axis", 4, "expected a direction"},
    {"fromto", 5, "the same"},
    {"fromto_sphere", 5, "only for capsule"},
    {"overflow", 3, "not finite"},
    {"condim", 5, "expected 1, 3, 4 or 6"},
    {"friction", 5, "expected a number >= 0"},
    {"plane_moves", 6, "a plane cannot move"},
    {"armature", 4, "expected a number >= 0"},
    {"timestep", 2, "time step > 0"},
    {"impratio", 2, "ratio > 0"},
    {"eulerseq", 2, "three of xyzXYZ"},
    {"global", 2, "global coordinates"},
    {"fluid", 2, "expected a number >= 0"},
    {"twist_hinge", 4, "only for ball joints"},
    {"swing", 4, "expected an angle > 0"},
    {"equality", 9, "anchor"},
    {"equality_name", 9, "no body is named 'd'"},
    {"equality_free", 9, "free or ball joint"},
    {"equality_self", 9, "constrains one to itself"},
    {"equality_planes", 9, "is not computed"},
    {"mesh", 5, "no mesh is named"},
    {"hfield", 3, "no hfield is named"},
    {"composite", 3, "composite"},
    {"muscle", 9, "lengthrange"},
    {"user_drive", 9, "user-defined"},
    {"crank", 9, "slidersite"},
    {"cranklength", 9, "cranklength"},
    {"refsite", 9, "for the transmission by a site"},
    {"lengthrange", 9, "lower <= upper"},
    {"no_target", 9, "expected one of joint, tendon"},
    {"site_target", 9, "no site is named 'm'"},
    {"spatial", 9, "no site is named 's'"},
    {"path_empty", 9, "needs a path"},
    {"path_pulley", 11, "cannot end with a pulley"},
    {"path_pulleys", 11, "two pulleys in a row"},
    {"path_lone", 10, "alone"},
    {"path_geom", 10, "between two sites"},
    {"path_box", 11, "no sphere or cylinder"},
    {"path_divisor", 11, "divisor > 0"},
    {"tendon_free", 10, "free or ball"},
    {"tendon_empty", 9, "needs at least 1 <joint>"},
    {"tendon_coef", 10, "is missing"},
    {"sensor_ball", 9, "free or ball"},
    {"two_planes", 9, "two planes"},
    {"autolimits", 4, "is missing where range"},
#ifndef CAVORT_HAVE_QHULL
    {"hull_needed", 3, "needs Qhull, which this build is without"},
#endif
};

static const char good[] =
    "<mujoco model='good'>\n<compiler angle='radian'/>\n<option timestep='.01' density='2' wind='1 0 0'/>\n"
    "<default><default class='a'><geom size='.1'/></default></default>\n<asset><material name='m' rgba='1 0 0 "
    "1'/></asset>\n"
    "<worldbody>\n<geom name='floor' type='plane' size='1 1 1'/><site name='w'/><replicate count='2' offset='1 0 "
    "0'><site name='r'/></replicate><geom name='ball' size='.1' "
    "contype='0' "
    "conaffinity='0' fluidshape='ellipsoid'/>\n<body name='b' childclass='a' euler='1 2 "
    "3'>\n<freejoint/>\n"
    "<geom name='g' type='capsule' fromto='0 0 0 1 1 1' material='m'/><site name='s'/>\n"
    "<body name='c'><joint name='j' limited='true' range='-1 1'/><geom type='box' size='.1 .2 "
    ".3'/></body></body>\n</worldbody>\n"
    "<contact><exclude body1='b' body2='c'/></contact>\n<tendon><fixed name='t'><joint joint='j' "
    "coef='2'/></fixed><spatial name='x' range='0 3'><site site='s'/><geom geom='ball' sidesite='w'/><site site='w'/>"
    "<pulley divisor='2'/><site site='s'/><site site='w'/></spatial></tendon>\n"
    "<actuator><motor joint='j' name='u'/><position tendon='x' kp='2'/><motor site='s' refsite='w' gear='0 1 0 1 0 0'/>"
    "<motor cranksite='s' slidersite='w' cranklength='.3'/><muscle joint='j' range='.8 "
    "1'/></actuator>\n<sensor><framepos objtype='site' "
    "objname='s'/><user dim='1'/></sensor>\n"
    "<keyframe><key name='k' qpos='0 0 0 1 0 0 0 .5'/></keyframe>\n</mujoco>\n";

// --- the n-th allocation fails ---

#if !defined(SANITIZED) && !defined(__GLIBC__)
#define SANITIZED 1
#endif

#ifndef SANITIZED
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t n, size_t size);
void *__libc_realloc(void *at, size_t size);
void *malloc(size_t size);
void *calloc(size_t n, size_t size);
void *realloc(void *at, size_t size);

static long left = -1; // allocations before the one that fails; negative: none does

static int fails(void) {
  if (left < 0 || left-- > 0) return 0;
  errno = ENOMEM;
  return 1;
}

void *malloc(size_t size) { return fails() ? NULL : __libc_malloc(size); }
void *calloc(size_t n, size_t size) { return fails() ? NULL : __libc_calloc(n, size); }
void *realloc(void *at, size_t size) { return fails() ? NULL : __libc_realloc(at, size); }
#endif

// --- files made here ---

static char folder[200], path[400];

static const char *in_folder(const char *name) {
  snprintf(path, sizeof path, "%.190s/%.100s", folder, name);
  return path;
}

static const char *write_bytes(const char *name, const void *bytes, size_t size) {
  // a new file each time: to overwrite one waits for the disk
  remove(in_folder(name));
  FILE *file = fopen(path, "wb");
  if (!file) return path;
  fwrite(bytes, 1, size, file);
  fclose(file);
  return path;
}

// a file of count times text, between head and tail
static const char *write_repeated(const char *name, const char *head, const char *text, long count, const char *tail) {
  remove(in_folder(name));
  FILE *file = fopen(path, "wb");
  if (!file) return path;
  fputs(head, file);
  for (long i = 0; i < count; i++) fputs(text, file);
  fputs(tail, file);
  fclose(file);
  return path;
}

// the file gives an error that says so, with the path in it and the line
static void expect_error(const char *file, int line, const char *says) {
  cav_error error = {0};
  cav_model *model = cav_model_load(file, &error);
  const char *base = strrchr(file, '/') ? strrchr(file, '/') + 1 : file;
  int holds = !model && error.status == CAV_BAD_INPUT && strstr(error.text, says) && (line < 0 || error.line == line);
  if (!check_note(holds, file, line, says))
    fprintf(stderr, "    %s: status %d, line %d, \"%s\"\n", base, (int)error.status, error.line,
            model ? "(loaded)" : error.text);
  // FILE:LINE: where there is a line
  char place[40];
  snprintf(place, sizeof place, ":%d: ", error.line);
  if (error.line) check_note(strstr(error.text, place) != NULL, file, error.line, "text has the line");
  cav_model_free(model);
}

static void test_broken(void) {
  for (size_t i = 0; i < sizeof broken / sizeof *broken; i++) {
    char file[5000];
    snprintf(file, sizeof file, "%s/tests/broken/%s.xml", CAVORT_SOURCE_ROOT, broken[i].name);
    expect_error(file, broken[i].line, broken[i].says);
  }
  printf("%d broken files\n", (int)(sizeof broken / sizeof *broken));
}

static void test_no_file(void) {
  expect_error(in_folder("none.xml"), 0, "cannot be opened");
  expect_error("", 0, "cannot be opened");
  expect_error(folder, 0, "is a folder");
  expect_error("/dev/null", 0, "no regular file");
  expect_error(write_bytes("empty.xml", "", 0), 0, "is empty");
  expect_error(write_bytes("blank.xml", " \n\n", 3), 3, "not well-formed");
  // a caller that wants no reason
  CHECK(cav_model_load(in_folder("none.xml"), NULL) == NULL);
}

static void test_junk(void) {
  unsigned char junk[4096];
  unsigned seed = 1;
  for (size_t i = 0; i < sizeof junk; i++) {
    seed = seed * 1664525u + 1013904223u;
    junk[i] = (unsigned char)(seed >> 24);
  }
  expect_error(write_bytes("junk.xml", junk, sizeof junk), -1, "");
  static const char wide[] = "<\0m\0u\0j\0o\0c\0o\0/\0>\0";
  expect_error(write_bytes("wide.xml", wide, sizeof wide), 1, "zero byte");
  static const char latin[] = "<mujoco model='\xff\xfe\xe9'/>";
  expect_error(write_bytes("latin.xml", latin, sizeof latin - 1), 1, "not well-formed");
}

static void test_huge(void) {
  static char brackets[(1 << 20) + 1]; // 1 MB
  memset(brackets, '[', sizeof brackets - 1);
  expect_error(write_repeated("big.xml", "", brackets, 100, ""), 0, "more than is read");
  expect_error(write_repeated("big.xml", "", "<<<<<<<<<<", 300000, ""), 1, "not well-formed");
  expect_error(write_repeated("big.xml", "<mujoco>", brackets, 31, ""), 1, "not well-formed");
  expect_error(write_repeated("big.xml", "<mujoco>\n<worldbody>", "<body>", 400000, ""), 2, "nested more than");
  expect_error(write_repeated("big.xml", "<mujoco><visual>", "<a>", 400000, ""), 1, "nested more than");
  expect_error(write_repeated("big.xml", "<mujoco>\n<worldbody\n", "a='1' ", 400000, "/></mujoco>"), 3, "attributes");
  expect_error(write_repeated("big.xml", "<mujoco><worldbody>", "<geom size='1'/>", 70000, "</worldbody></mujoco>"), 1,
               "at most");
  expect_error(write_repeated("big.xml", "<mujoco><worldbody>", "<body><freejoint/><geom size='1'/></body>", 3000,
                              "</worldbody></mujoco>"),
               1, "degrees of freedom");
  expect_error(write_repeated("big.xml", "<mujoco><option timestep='", "1", 12000000, "'/></mujoco>"), -1, "");
  remove(path);
}

enum { CHAIN = 1000 };

// in each other so many bodies of 1/4 kg, each on a slide along z in the one before; tail: in the innermost
static const char *write_chain(const char *name, const char *head, int bodies, const char *tail) {
  remove(in_folder(name));
  FILE *file = fopen(path, "wb");
  if (!file) return path;
  fputs(head, file);
  for (int i = 0; i < bodies; i++)
    fprintf(
        file,
        "<body name='b%d'><joint type='slide' axis='0 0 1'/><inertial pos='0 0 0' mass='.25' diaginertia='1 1 1'/>\n",
        i);
  fputs(tail, file);
  for (int i = 0; i < bodies; i++) fputs("</body>\n", file);
  fputs("</worldbody></mujoco>\n", file);
  fclose(file);
  return path;
}

// moves as one in free fall; relative positions of points of mass m: M^-1 is 1/m, then 2/m; of each point 1/m along z
static void *fall(void *unused) {
  (void)unused;
  cav_error error = {0};
  cav_model *model = cav_model_load(write_chain("deep.xml", "<mujoco><worldbody>\n", CHAIN, ""), &error);
  if (!CHECK(model != NULL)) {
    fprintf(stderr, "    %s\n", error.text);
    return NULL;
  }
  CHECK(model->nv == CHAIN);
  double weight = 0, moved = 0;
  for (int i = 0; i < CHAIN; i++) {
    weight = fmax(weight, fabs(model->dof[i].inverse_weight - (i ? 8 : 4)));
    weight = fmax(weight, fabs(model->body[i + 1].inverse_weight[0] - 4. / 3));
    weight = fmax(weight, fabs(model->body[i + 1].inverse_weight[1]));
  }
  CHECK(weight < 1e-9);
  static double v[CHAIN], u[CHAIN], next[CHAIN];
  cav_state *state = cav_state_new(model);
  if (CHECK(state && cav_forward(model, state, model->q0, v, u, next) == CAV_OK)) {
    for (int i = 0; i < CHAIN; i++) moved = fmax(moved, fabs(next[i] + (i ? 0 : 9.81 * model->timestep)));
    CHECK(moved < 1e-9);
  }
  printf("%d bodies in each other: weights to %.1e, a step to %.1e\n", CHAIN, weight, moved);
  cav_state_free(state);
  cav_model_free(model);
  return NULL;
}

// bodies in each other on a stack of half a megabyte, and no more than are read, attached ones counted in
static void test_deep(void) {
  pthread_attr_t small;
  pthread_t thread;
  pthread_attr_init(&small);
#ifdef SANITIZED
  CHECK(pthread_attr_setstacksize(&small, 4 << 20) == 0);
#else
  CHECK(pthread_attr_setstacksize(&small, 512 << 10) == 0);
#endif
  if (CHECK(pthread_create(&thread, &small, fall, NULL) == 0)) pthread_join(thread, NULL);
  pthread_attr_destroy(&small);
  expect_error(write_chain("deep.xml", "<mujoco><worldbody>\n", 2000, ""), 1999, "nested more than 2000 deep");
  // attaches itself, which would go on
  expect_error(write_chain("deep.xml", "<mujoco><asset><model name='m' file='deep.xml'/></asset><worldbody>\n", 1500,
                           "<attach model='m' prefix='a'/>"),
               499, "nested more than 2000 deep, with what is attached");
}

// every beginning of a good file, and the file with one byte changed: an error or a model, no more is asked
static void test_damage(void) {
  size_t size = sizeof good - 1;
  int loaded = 0;
  for (size_t n = 1; n < size - 1; n++) {
    cav_error error = {0};
    cav_model *model = cav_model_load(write_bytes("cut.xml", good, n), &error);
    if (!check_note(!model && error.status == CAV_BAD_INPUT && error.line > 0, "cut", (int)n, error.text)) loaded++;
    cav_model_free(model);
  }
  CHECK(loaded == 0);
  unsigned seed = 5;
  char changed[sizeof good];
  static const char bytes[] = "<>/='\" 0e-.\n&;!?a";
  for (int trial = 0; trial < 3000; trial++) {
    memcpy(changed, good, sizeof good);
    for (int k = 0; k <= trial % 3; k++) {
      seed = seed * 1664525u + 1013904223u;
      changed[(seed >> 8) % size] = bytes[(seed >> 4) % (sizeof bytes - 1)];
    }
    cav_error error = {0};
    cav_model *model = cav_model_load(write_bytes("changed.xml", changed, size), &error);
    loaded += model != NULL;
    if (!model) check_note(error.status == CAV_BAD_INPUT && error.line > 0, "changed", trial, error.text);
    cav_model_free(model);
  }
  // the control: some changes are harmless
  printf("%d of 3000 damaged files load\n", loaded);
  CHECK(loaded > 30);
}

static void test_memory(void) {
  const char *file = write_bytes("good.xml", good, sizeof good - 1);
  cav_error error = {0};
  cav_model *whole = cav_model_load(file, &error);
  if (!CHECK(whole != NULL)) {
    fprintf(stderr, "    %s\n", error.text);
    return;
  }
  CHECK(whole->nwarning == 1 && strstr(whole->warning[0], "good.xml:16: <user>"));
#ifdef SANITIZED
  printf("SKIPPED: a sanitizer owns malloc\n");
#else
  long n = 0, most = 20000;
  for (; n < most; n++) {
    left = n;
    cav_model *model = cav_model_load(file, &error);
    int reached = left < 0;
    left = -1;
    if (model) {
      // an allocation that is not needed after all must leave the same model
      CHECK(model->bytes == whole->bytes && model->nsensor == whole->nsensor);
      cav_model_free(model);
      if (!reached) break;
    } else if (!check_note(error.status == CAV_NO_MEMORY, "allocation", (int)n, error.text)) {
      fprintf(stderr, "    status %d: %s\n", (int)error.status, error.text);
    }
  }
  CHECK(n > 50 && n < most);
  printf("%ld allocations, each failed once\n", n);
#endif
  cav_model_free(whole);
}

// a decimal comma in the user's locale changes nothing
static void test_locale(void) {
  static const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "de_DE", NULL};
  int i = 0;
  while (names[i] && !setlocale(LC_NUMERIC, names[i])) i++;
  if (!names[i]) printf("SKIPPED: no locale with a decimal comma\n");
  cav_error error;
  cav_model *model = cav_model_load(write_bytes("good.xml", good, sizeof good - 1), &error);
  if (CHECK(model != NULL)) CHECK_NEAR(model->timestep, 0.01, 0);
  cav_model_free(model);
  setlocale(LC_NUMERIC, "C");
}

// an included file's own includes: beside the main file, else beside itself, as in MuJoCo 3
static void test_include_folders(void) {
  static const char main_file[] = "<mujoco><include file='sub/outer.xml'/><worldbody/></mujoco>";
  static const char outer[] = "<mujoco><include file='inner.xml'/></mujoco>";
  static const char near[] = "<mujoco><option timestep='0.003'/></mujoco>";
  static const char far[] = "<mujoco><option timestep='0.005'/></mujoco>";
  if (!CHECK(!mkdir(in_folder("sub"), 0700))) return;
  write_bytes("sub/outer.xml", outer, sizeof outer - 1);
  write_bytes("sub/inner.xml", near, sizeof near - 1);
  for (int both = 0; both < 2; both++) {
    if (both) write_bytes("inner.xml", far, sizeof far - 1);
    cav_model *m = cav_model_load(write_bytes("main.xml", main_file, sizeof main_file - 1), NULL);
    if (CHECK(m != NULL)) CHECK_NEAR(m->timestep, both ? 0.005 : 0.003, 0);
    cav_model_free(m);
  }
  static const char *const made[] = {"main.xml", "inner.xml", "sub/outer.xml", "sub/inner.xml"};
  for (size_t i = 0; i < sizeof made / sizeof *made; i++) remove(in_folder(made[i]));
  rmdir(in_folder("sub"));
}

int main(void) {
  const char *named = getenv("TMPDIR");
  snprintf(folder, sizeof folder, "%.150s/cavort-mjcf-XXXXXX", named ? named : "/tmp");
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  test_broken();
  test_no_file();
  test_junk();
  test_huge();
  test_deep();
  test_damage();
  test_memory();
  test_locale();
  test_include_folders();
  static const char *const made[] = {"empty.xml", "blank.xml", "junk.xml", "wide.xml",    "latin.xml",
                                     "big.xml",   "cut.xml",   "good.xml", "changed.xml", "deep.xml"};
  for (size_t i = 0; i < sizeof made / sizeof *made; i++) remove(in_folder(made[i]));
  rmdir(folder);
  return check_result();
}
