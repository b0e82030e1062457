/// The page of problems/result/view.c: complete in itself, its data valid JSON, hostile names harmless, errors instead
/// of half pages. What it looks like is checked by eye: see README.md.
#include "view.h"

#include <ctype.h>
#include <unistd.h>

#include "check.h"

// --- a strict reader of JSON: moves past one value, NULL where it is not one ---

static const char *skip_space(const char *s) {
  while (*s == ' ' || *s == '\n' || *s == '\t' || *s == '\r') s++;
  return s;
}

static const char *skip_string(const char *s) {
  if (*s++ != '"') return NULL;
  for (; *s != '"'; s++) {
    if ((unsigned char)*s < 0x20) return NULL;
    if (*s != '\\') continue;
    s++;
    if (*s == 'u') {
      for (int i = 0; i < 4; i++) {
        if (!isxdigit((unsigned char)*++s)) return NULL;
      }
    } else if (!*s || !strchr("\"\\/bfnrt", *s)) {
      return NULL;
    }
  }
  return s + 1;
}

static const char *skip_digits(const char *s) {
  if (!isdigit((unsigned char)*s)) return NULL;
  while (isdigit((unsigned char)*s)) s++;
  return s;
}

static const char *skip_number(const char *s) {
  if (*s == '-') s++;
  s = *s == '0' ? s + 1 : skip_digits(s);
  if (s && *s == '.') s = skip_digits(s + 1);
  if (s && (*s == 'e' || *s == 'E')) {
    s++;
    if (*s == '+' || *s == '-') s++;
    s = skip_digits(s);
  }
  return s;
}

static const char *skip_value(const char *s);

// an array, or an object where each value has a name before it
static const char *skip_list(const char *s, char end) {
  s = skip_space(s + 1);
  if (*s == end) return s + 1;
  for (;;) {
    if (end == '}') {
      s = skip_string(skip_space(s));
      if (!s || *(s = skip_space(s)) != ':') return NULL;
      s++;
    }
    s = skip_value(s);
    if (!s) return NULL;
    s = skip_space(s);
    if (*s == end) return s + 1;
    if (*s++ != ',') return NULL;
  }
}

static const char *skip_value(const char *s) {
  s = skip_space(s);
  if (*s == '{') return skip_list(s, '}');
  if (*s == '[') return skip_list(s, ']');
  if (*s == '"') return skip_string(s);
  if (!strncmp(s, "null", 4)) return s + 4;
  return skip_number(s);
}

static int is_json(const char *text) {
  const char *end = skip_value(text);
  return end && !*skip_space(end);
}

// the control of the reader itself
static void test_reader(void) {
  CHECK(is_json(" {\"a\":[1,-2.5e-3,null,\"\\u003c\"],\"b\":{}} "));
  CHECK(!is_json("{\"a\":nan}"));
  CHECK(!is_json("[1,]"));
  CHECK(!is_json("[01]"));
  CHECK(!is_json("[1.]"));
  CHECK(!is_json("\"\\x\""));
  CHECK(!is_json("{\"a\" 1}"));
  CHECK(!is_json("\"a\nb\""));
}

// --- pages ---

static char folder[] = "/tmp/cavort-view-XXXXXX";

static const char *in_folder(const char *name) {
  static char path[8][200];
  static int turn;
  turn = (turn + 1) % 8;
  snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
  return path[turn];
}

static void write_file(const char *path, const char *text) {
  FILE *file = fopen(path, "wb");
  if (!CHECK(file != NULL)) return;
  fputs(text, file);
  fclose(file);
}

// whole file, to be freed; NULL if there is none
static char *read_file(const char *path) {
  FILE *file = fopen(path, "rb");
  if (!file) return NULL;
  fseek(file, 0, SEEK_END);
  size_t size = (size_t)ftell(file);
  rewind(file);
  char *text = calloc(size + 1, 1);
  if (text && fread(text, 1, size, file) != size) {
    free(text);
    text = NULL;
  }
  fclose(file);
  return text;
}

static int count(const char *text, const char *word) {
  int n = 0;
  for (const char *s = strstr(text, word); s; s = strstr(s + 1, word)) n++;
  return n;
}

// a ball over a floor, named to break a page
static cav_model *load_hostile(void) {
  const char *path = in_folder("model.xml");
  write_file(path,
             "<mujoco model=\"&lt;/script&gt;&lt;b&gt;&amp; &quot;model&quot;\">\n"
             "  <worldbody>\n"
             "    <geom name=\"floor\" type=\"plane\" size=\"1 1 1\"/>\n"
             "    <body name=\"&lt;!-- a \\ b\" pos=\"0 0 1\">\n"
             "      <freejoint/>\n"
             "      <geom name=\"&lt;/SCRIPT &gt;\" type=\"sphere\" size=\"0.1\"/>\n"
             "      <geom type=\"capsule\" fromto=\"0 0 0 0.3 0 0\" size=\"0.05\"/>\n"
             "      <geom type=\"box\" size=\"0.1 0.2 0.3\" rgba=\"1 0 0 0.5\"/>\n"
             "    </body>\n"
             "  </worldbody>\n"
             "</mujoco>\n");
  cav_error error = {0};
  cav_model *model = cav_model_load(path, &error);
  if (!CHECK(model != NULL)) fprintf(stderr, "    %s\n", error.text);
  return model;
}

// three knots of a fall, with one force, a chart with a gap and a verdict
static cav_view_input hostile_input(const cav_model *model) {
  static const double q[3 * 7] = {0, 0, 1, 1, 0, 0, 0, 0, 0, 0.9, 0.8, 0.6, 0, 0, 0.125, 0, 0.5, 0, 1, 0, 0};
  static const int nforce[3] = {0, 0, 1};
  static const cav_view_force force[1] = {{{0.125, 0, 0}, {0, 3, 400}, {0, 0, 1}, 0.75, 0, 1}};
  static const cav_view_target target[1] = {{"</script>", 1, 2, {NAN, NAN, 0.5}, {0, 0, 0.9}}};
  static const double value[3] = {1, -2.5, NAN}, wanted[3] = {NAN, 7, NAN}, goal[7] = {0, 0, 2, 1, 0, 0, 0};
  static cav_view_series series[1];
  static const cav_view_line line[2] = {{"</script><script>alert(1)</script>", "1 < 2 \"quoted\" \xE2\x9C\x93", 1},
                                        {"bad bytes \xFF\xC0\x80", "\xED\xA0\x80 \x01", 0}};
  series[0] = (cav_view_series){"<i>", "a\tb", NULL, value, -INFINITY, 2, 1, wanted};
  return (cav_view_input){.model = model,
                          .title = "</title><img src=x onerror=alert(1)>",
                          .nknot = 3,
                          .timestep = 0.025,
                          .q = q,
                          .goal = goal,
                          .nforce = nforce,
                          .force = force,
                          .ntarget = 1,
                          .target = target,
                          .nseries = 1,
                          .series = series,
                          .nline = 2,
                          .line = line};
}

// the text between two marks of the page, to be freed
static char *between(const char *page, const char *from, const char *to) {
  const char *a = strstr(page, from), *b = a ? strstr(a + strlen(from), to) : NULL;
  if (!b) return NULL;
  a += strlen(from);
  return strndup(a, (size_t)(b - a));
}

static void check_page(const char *page) {
  // all three.js of the file is in it, and the scripts are the template's: nothing in the data opened or closed one
  CHECK(strstr(page, "var THREE={}") != NULL);
  CHECK(count(page, "<script") == 3);
  CHECK(count(page, "</script") == 3);
  CHECK(count(page, "<!--") == 2);
  CHECK(count(page, "alert(1)") == 2);
  CHECK(strstr(page, "<img") == NULL);
  CHECK(strstr(page, "CAVORT_") == NULL);

  // it loads nothing: no address to fetch, and browsers are told to refuse any
  CHECK(strstr(page, " src=") == strstr(page, " src=x onerror"));
  CHECK(strstr(page, "<link") == NULL);
  CHECK(strstr(page, "@import") == NULL);
  CHECK(strstr(page, "url(") == NULL);
  CHECK(strstr(page, "http://") == NULL);
  CHECK(count(page, "https://") == count(page, "https://threejs.org, under"));
  CHECK(strstr(page, "default-src 'none'") != NULL);
}

static void check_data(const char *data) {
  CHECK(is_json(data));
  CHECK(strchr(data, '<') == NULL);
  CHECK(strchr(data, '&') == NULL);
  CHECK(strstr(data, "\"title\":\"\\u003c/title\\u003e\\u003cimg src=x onerror=alert(1)\\u003e\"") != NULL);
  CHECK(strstr(data, "\"model\":\"\\u003c/script\\u003e\\u003cb\\u003e\\u0026 \\u0022model\\u0022\"") != NULL);
  CHECK(strstr(data, "\"name\":\"\\u003c!-- a \\u005c b\"") != NULL);
  CHECK(strstr(data, "1 \\u003c 2 \\u0022quoted\\u0022 \xE2\x9C\x93") != NULL);
  CHECK(strstr(data, "bad bytes \\ufffd\\ufffd\\ufffd") != NULL);
  CHECK(strstr(data, "\\ufffd\\ufffd\\ufffd \\u0001") != NULL);
  CHECK(strstr(data, "\"lower\":null,\"upper\":2,\"share\":1,\"value\":[1,-2.5,null],\"wanted\":[null,7,null]") !=
        NULL);
  CHECK(strstr(data, "\"from\":1,\"to\":2,\"pos\":[null,null,0.5],\"got\":[0,0,0.9]") != NULL);
  CHECK(strstr(data, "\"goal\":[0,0,2,1,0,0,0]") != NULL);
  CHECK(strstr(data, "[0.125,0,0,0,3,400,0,0,1,0.75,0,1]") != NULL);
  CHECK(strstr(data, "\"rgba\":[1,0,0,0.5]") != NULL);
  // the ball's poses: where q puts it, the quaternion too
  CHECK(strstr(data, "\"poses\":[\n[0,0,1,1,0,0,0],\n[0,0,0.9,0.8,0.6,0,0],\n[0.125,0,0.5,0,1,0,0]\n]") != NULL);
}

static void test_page(const cav_model *model) {
  const char *path = in_folder("view.html");
  cav_view_input input = hostile_input(model);
  cav_error error = {0};
  if (!CHECK(cav_view_write(path, 1, &input, &error) == CAV_OK)) fprintf(stderr, "    %s\n", error.text);
  char *page = read_file(path);
  if (CHECK(page != NULL)) {
    check_page(page);
    char *data = between(page, "<script type=\"application/json\" id=\"motion\">", "</script>");
    if (CHECK(data != NULL)) check_data(data);
    free(data);
  }
  free(page);

  // the least there can be: one knot and nothing else
  cav_view_input least = {.model = model, .nknot = 1, .timestep = 0.01, .q = input.q};
  CHECK(cav_view_write(path, 1, &least, &error) == CAV_OK);
  page = read_file(path);
  char *data = page ? between(page, "<script type=\"application/json\" id=\"motion\">", "</script>") : NULL;
  if (CHECK(data != NULL)) {
    CHECK(is_json(data));
    CHECK(strstr(data, "\"forces\":null") != NULL);
  }
  free(data);
  free(page);
}

// a ball of 8,000 corners is drawn by those of a grid
static void test_fine_mesh(void) {
#ifdef CAVORT_HAVE_QHULL
  enum { POINTS = 8000 };
  FILE *file = fopen(in_folder("model.xml"), "w");
  if (!CHECK(file != NULL)) return;
  fputs("<mujoco><asset><mesh name='m' vertex='", file);
  for (int i = 0; i < POINTS; i++) {
    double z = 1 - (2.0 * i + 1) / POINTS, r = sqrt(1 - z * z), a = 2.399963229728653 * i;
    fprintf(file, "%.5f %.5f %.5f ", r * cos(a), r * sin(a), z);
  }
  fputs("'/></asset><worldbody><body><freejoint/><geom type='mesh' mesh='m'/></body></worldbody></mujoco>", file);
  fclose(file);
  cav_model *m = cav_model_load(in_folder("model.xml"), NULL);
  if (!CHECK(m && m->mesh[0].nvertex > 7000)) return;
  cav_view_input input = {.model = m, .nknot = 1, .timestep = 0.01, .q = m->q0};
  CHECK(cav_view_write(in_folder("view.html"), 1, &input, NULL) == CAV_OK);
  char *page = read_file(in_folder("view.html"));
  const char *at = page ? strstr(page, "\"corners\":[") : NULL;
  int corners = 0, triangles = 0, wrong = 0;
  double radius = 0, least = INFINITY;
  for (at = at ? at + 11 : NULL; at && *at != ']'; corners++) {
    double square = 0;
    for (int k = 0; k < 3; k++) {
      double x = strtod(at + 1, (char **)&at);
      square += x * x;
    }
    radius = fmax(radius, sqrt(square)), least = fmin(least, sqrt(square));
  }
  at = page ? strstr(page, "\"triangles\":[") : NULL;
  for (at = at ? at + 13 : NULL; at && *at != ']'; triangles++) {
    for (int k = 0; k < 3; k++) {
      long corner = strtol(at + 1, (char **)&at, 10);
      wrong += corner < 0 || corner >= corners;
    }
  }
  // a closed surface has twice as many triangles as corners; where cells fold it, some more
  CHECK(corners > 500 && corners < 3000 && triangles > 1.9 * corners && triangles < 2.1 * corners && !wrong);
  CHECK(radius < 1.001 && least > 0.999);
  free(page);
  cav_model_free(m);
#endif
}

// numbers after a name in a text, n of them at most; how many there are
static int numbers_after(const char *text, const char *name, double *x, int n) {
  const char *at = text ? strstr(text, name) : NULL;
  int i = 0;
  for (at = at ? at + strlen(name) : NULL; at && *at != ']' && i < n; i++) x[i] = strtod(at + (i > 0), (char **)&at);
  return i;
}

// a mesh that can only be seen, an L with an inner corner that no hull has: the model is without it, the page draws its own
// surface where the file puts it, in the place of what collides
static void test_seen_mesh(void) {
#ifdef CAVORT_HAVE_QHULL
  static const double corner[12][3] = {{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0},
                                       {0, 0, 1}, {2, 0, 1}, {2, 1, 1}, {1, 1, 1}, {1, 2, 1}, {0, 2, 1}};
  write_file(in_folder("model.xml"),
             "<mujoco><compiler inertiafromgeom='true'/><asset><mesh name='L' scale='0.1 0.1 0.1' "
             "vertex='0 0 0 2 0 0 2 1 0 1 1 0 1 2 0 0 2 0 0 0 1 2 0 1 2 1 1 1 1 1 1 2 1 0 2 1' "
             "face='0 3 1 1 3 2 0 5 3 3 5 4 6 7 9 7 8 9 6 9 11 9 10 11 0 1 7 0 7 6 1 2 8 1 8 7 2 3 9 2 9 8 "
             "3 4 10 3 10 9 4 5 11 4 11 10 5 0 6 5 6 11'/></asset><worldbody><body name='b'><freejoint/>"
             "<geom type='sphere' size='0.1'/><geom type='mesh' mesh='L' pos='1 2 3' quat='1 1 0 0' mass='0' "
             "contype='0' conaffinity='0'/></body></worldbody></mujoco>");
  cav_load_options options = cav_load_options_default();
  options.visual = 1;
  cav_error error = {0};
  cav_model *m = cav_model_load(in_folder("model.xml"), &error);
  cav_model *drawn = cav_model_load_with(in_folder("model.xml"), &options, &error);
  if (!CHECK(m && drawn)) {
    fprintf(stderr, "    %s\n", error.text);
    return;
  }
  CHECK(m->ngeom == 1 && m->nmesh == 0 && drawn->ngeom == 2 && drawn->mesh[0].ntriangle == 20);
  cav_view_input input = {.model = m, .drawn = drawn, .nknot = 1, .timestep = 0.01, .q = m->q0};
  CHECK(cav_view_write(in_folder("view.html"), 1, &input, NULL) == CAV_OK);
  char *page = read_file(in_folder("view.html"));
  CHECK(page && count(page, "\"hidden\":1") == 1 && count(page, "\"type\":\"mesh\"") == 1);
  const char *geom = page ? strstr(page, "\"type\":\"mesh\"") : NULL;
  double pos[3], quat[4], x[36], triangle[60], far = 0;
  CHECK(numbers_after(geom, "\"pos\":[", pos, 3) == 3 && numbers_after(geom, "\"quat\":[", quat, 4) == 4);
  CHECK(numbers_after(geom, "\"corners\":[", x, 36) == 36);
  CHECK(numbers_after(geom, "\"triangles\":[", triangle, 60) == 60);
  for (int i = 0; i < 12; i++) {
    // v + 2 w (u x v) + 2 u x (u x v) of the page against the file's quarter turn about x
    const double *u = quat + 1, *v = x + 3 * i;
    double c[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
    double d[3] = {u[1] * c[2] - u[2] * c[1], u[2] * c[0] - u[0] * c[2], u[0] * c[1] - u[1] * c[0]};
    double file[3] = {1 + 0.1 * corner[i][0], 2 - 0.1 * corner[i][2], 3 + 0.1 * corner[i][1]};
    for (int k = 0; k < 3; k++) far = fmax(far, fabs(pos[k] + v[k] + 2 * quat[0] * c[k] + 2 * d[k] - file[k]));
  }
  CHECK(far < 2e-4);
  free(page);
  cav_model_free(drawn);
  cav_model_free(m);
#endif
}

// what goes wrong says why and leaves no page
static void test_errors(const cav_model *model) {
  cav_view_input input = hostile_input(model);
  cav_error error = {0};
  const char *path = in_folder("none.html");
  double q[7] = {0, 0, NAN, 1, 0, 0, 0};

  cav_view_input broken = input;
  broken.nknot = 0;
  CHECK(cav_view_write(path, 1, &broken, &error) == CAV_BAD_INPUT);
  broken = input;
  broken.timestep = 0;
  CHECK(cav_view_write(path, 1, &broken, &error) == CAV_BAD_INPUT);
  broken = (cav_view_input){.model = model, .nknot = 1, .timestep = 0.01, .q = q};
  CHECK(cav_view_write(path, 1, &broken, &error) == CAV_NOT_FINITE);
  CHECK(strstr(error.text, "q[2] at knot 0") != NULL);
  CHECK(cav_view_write(path, 1, &broken, NULL) == CAV_NOT_FINITE);

  CHECK(cav_view_write(in_folder("no/such/folder.html"), 1, &input, &error) == CAV_BAD_INPUT);
  CHECK(strstr(error.text, "no/such/folder.html") != NULL);

  // three.js absent, and a file that would break out of its element
  setenv("CAVORT_THREE_JS", in_folder("absent.js"), 1);
  CHECK(cav_view_write(path, 1, &input, &error) == CAV_BAD_INPUT);
  CHECK(strstr(error.text, "absent.js") != NULL && strstr(error.text, "libjs-three") != NULL);
  write_file(in_folder("bad.js"), "var s='</ScRiPt>';");
  setenv("CAVORT_THREE_JS", in_folder("bad.js"), 1);
  CHECK(cav_view_write(path, 1, &input, &error) == CAV_BAD_INPUT);
  write_file(in_folder("empty.js"), "");
  setenv("CAVORT_THREE_JS", in_folder("empty.js"), 1);
  CHECK(cav_view_write(path, 1, &input, &error) == CAV_BAD_INPUT);
  CHECK(access(path, F_OK) != 0);
}

// with the three.js of the build, where it is installed
static void test_installed(const cav_model *model) {
  unsetenv("CAVORT_THREE_JS");
  const char *path = in_folder("full.html");
  cav_view_input input = hostile_input(model);
  cav_error error = {0};
  cav_status status = cav_view_write(path, 1, &input, &error);
  if (status == CAV_BAD_INPUT && strstr(error.text, "cannot read three.js")) {
    printf("three.js is not installed: the page with it is not checked\n");
    return;
  }
  CHECK(status == CAV_OK);
  char *page = read_file(path);
  if (CHECK(page != NULL)) {
    CHECK(strlen(page) > 300000);
    CHECK(strstr(page, "WebGLRenderer") != NULL);
    CHECK(count(page, "</script") == 3);
  }
  free(page);
}

int main(void) {
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  test_reader();
  // a three.js of its own, so that the page holds nothing but what is checked here
  write_file(in_folder("three.js"), "var THREE={};");
  setenv("CAVORT_THREE_JS", in_folder("three.js"), 1);
  cav_model *model = load_hostile();
  if (model) {
    test_page(model);
    test_errors(model);
    test_installed(model);
  }
  cav_model_free(model);
  test_fine_mesh();
  test_seen_mesh();
  static const char *const left[] = {"model.xml", "three.js", "bad.js", "empty.js", "view.html", "full.html"};
  for (size_t i = 0; i < sizeof left / sizeof *left; i++) remove(in_folder(left[i]));
  CHECK(rmdir(folder) == 0);
  return check_result();
}
