/// Pages of reports (problems/report/html.c, plot.c): well-formed whatever text and numbers they are given, complete in
/// themselves, failures shown as such, ticks and points at places computed here anew. What a page looks like is checked
/// by eye.
#include "html.h"

#include <ctype.h>
#include <float.h>
#include <unistd.h>

#include "check.h"

static char path[] = "/tmp/cavort-html-XXXXXX";

// the page as text, to be freed
static char *read_page(void) {
  FILE *file = fopen(path, "rb");
  char *text = NULL;
  size_t size = 0;
  if (!CHECK(file != NULL)) return calloc(1, 1);
  if (getdelim(&text, &size, 0, file) < 0 || !text) text = calloc(1, 1);
  fclose(file);
  return text;
}

static int count(const char *text, const char *word) {
  int n = 0;
  for (const char *s = strstr(text, word); s; s = strstr(s + 1, word)) n++;
  return n;
}

// 1 if tags close in the order in which they open, attributes are quoted and & begins a number
static int well_formed(const char *s) {
  char open[64][32];
  int depth = 0;
  if (!strncmp(s, "<!DOCTYPE html>", 15)) s += 15;
  for (; *s; s++) {
    if (*s == '&' && (s[1] != '#' || s[2 + strspn(s + 2, "x0123456789ABCDEF")] != ';')) return 0;
    if (*s == '>') return 0;
    if (*s != '<') continue;
    int closing = s[1] == '/';
    size_t n = strspn(s + 1 + closing, "abcdefghijklmnopqrstuvwxyz123456");
    const char *name = s + 1 + closing;
    if (n == 0 || n > 31) return 0;
    s = name + n;
    if (closing && (depth == 0 || strlen(open[--depth]) != n || strncmp(open[depth], name, n) || *s != '>')) return 0;
    if (closing) continue;
    for (; *s != '>' && strncmp(s, "/>", 2); s++) {
      if (!*s || *s == '<') return 0;
      if (*s != '"') continue;
      s = strchr(s + 1, '"');
      if (!s) return 0;
    }
    if (*s == '/') {
      s++;
      continue;
    }
    if (depth == 64) return 0;
    snprintf(open[depth++], sizeof *open, "%.*s", (int)n, name);
  }
  return depth == 0;
}

// the control of the reader itself
static void test_reader(void) {
  CHECK(well_formed("<!DOCTYPE html>\n<p a=\"b>\">x&#38;y<br/></p>"));
  CHECK(!well_formed("<p>"));
  CHECK(!well_formed("<p><b></p></b>"));
  CHECK(!well_formed("<p>a & b</p>"));
  CHECK(!well_formed("<p>a > b</p>"));
  CHECK(!well_formed("<p a=\"b></p>"));
}

static const char *const hostile = "</title><script>alert(1)</script>&amp;\"'\xff\xc0\x80\x01]]>--><!-- %s %n";

static void test_text(void) {
  cav_html page;
  cav_error error = {0};
  cav_provenance provenance;
  const char *heading[] = {hostile, "b"};
  cav_provenance_take(&provenance, hostile, NULL, NULL);
  if (!CHECK(!cav_html_begin(&page, path, hostile, hostile, &error))) return;
  cav_html_heading(&page, hostile);
  cav_html_paragraph(&page, "%s", hostile);
  cav_html_entry(&page, hostile, "%s", hostile);
  cav_html_entry(&page, "second", "%d", 42);
  cav_html_link(&page, "forward.csv", hostile);
  cav_html_table(&page, hostile, 2, heading);
  cav_html_cell(&page, "%s", hostile);
  cav_html_number(&page, NAN, 3);
  cav_html_mark(&page);
  cav_html_cell(&page, "x");
  cav_html_number(&page, 1.5e-7, 3);
  cav_html_provenance(&page, &provenance);
  CHECK(!cav_html_end(&page, &error));
  char *text = read_page();
  CHECK(well_formed(text));
  CHECK(strstr(text, "<script") == NULL);
  CHECK(strstr(text, "http://") == NULL && strstr(text, "https://") == NULL && strstr(text, "url(") == NULL);
  CHECK(strstr(text, "default-src 'none'") != NULL);
  CHECK(count(text, "&#60;/title&#62;&#60;script&#62;alert(1)") == 12);
  CHECK(count(text, "%s %n") == 12);
  CHECK(count(text, "<dl>") == 2 && count(text, "</dl>") == 2);
  CHECK(strstr(text,
               "<td class=\"n bad\">failed</td></tr>\n<tr class=\"mark\"><td>x</td><td class=\"n\">1.5e-7</td></tr>") !=
        NULL);
  free(text);
}

static void check_number(double value, int digits, const char *expected) {
  char text[CAV_HTML_NUMBER];
  cav_html_number_text(value, digits, text);
  CHECK_TEXT(text, expected);
}

static void test_numbers(void) {
  check_number(NAN, 3, "failed");
  check_number(-INFINITY, 3, "failed");
  check_number(-0.0, 3, "0");
  check_number(1234.5, 3, "1.23e3");
  check_number(1e-7, 3, "1e-7");
  check_number(-2.5e-12, 2, "-2.5e-12");
  check_number(DBL_MIN * DBL_EPSILON, 17, "4.9406564584124654e-324");
  check_number(-DBL_MAX, 17, "-1.7976931348623157e308");
}

static char *draw(const cav_html_plot *plot) {
  cav_html page;
  cav_error error = {0};
  if (!CHECK(!cav_html_begin(&page, path, "plot", NULL, &error))) return calloc(1, 1);
  cav_html_plots(&page, 1, plot);
  CHECK(!cav_html_end(&page, &error));
  char *text = read_page();
  CHECK(well_formed(text));
  CHECK(strstr(text, "nan") == NULL && strstr(text, "inf") == NULL);
  return text;
}

// decades at equal distances, and a line of order 2 as the straight line that it is
static void test_logarithmic(void) {
  double x[] = {1e-3, 1e-2, 1e-1, 1}, y[] = {1e-8, 1e-6, 1e-4, 1e-2};
  int marked[] = {1, 0, 0, 0};
  cav_html_series series = {.name = "order 2", .n = 4, .x = x, .y = y, .marked = marked};
  cav_html_plot plot = {"title", "step, s", "error", 1, 1, 1, &series};
  char *text = draw(&plot);
  double px[4], py[4];
  int n = 0;
  for (const char *s = strstr(text, "</svg>"); s && n < 4; n++) {
    s = strstr(s, "<circle cx=\"");
    if (!s || sscanf(s, "<circle cx=\"%lf\" cy=\"%lf\"", &px[n], &py[n]) != 2) break;
    s++;
  }
  if (CHECK(n == 4)) {
    for (int i = 1; i < 4; i++) {
      CHECK_NEAR(px[i] - px[i - 1], (px[3] - px[0]) / 3, 0.11);
      CHECK_NEAR(py[i] - py[i - 1], (py[3] - py[0]) / 3, 0.11);
    }
    CHECK(px[3] - px[0] > 300 && py[0] - py[3] > 200);
  }
  CHECK(count(text, "fill=\"currentColor\"") == 1);
  CHECK(strstr(text, ">10⁻⁸</text>") != NULL && strstr(text, ">0.1</text>") != NULL);
  CHECK(strstr(text, "<title>order 2: 0.001, 1e-8</title>") != NULL);
  free(text);
}

// numbers that no axis holds: nothing breaks, each is still there
static void test_extremes(void) {
  double x[] = {0, -1, 1, 2, NAN, DBL_MAX, 5e-324}, y[] = {1, 0, NAN, INFINITY, 1, DBL_MAX, -DBL_MAX};
  const char *label[] = {"a", NULL, hostile, "d", "e", "f", "g"};
  for (int kind = CAV_HTML_LINE; kind <= CAV_HTML_GUIDE; kind++) {
    for (int logs = 0; logs < 4; logs++) {
      for (int n = 0; n <= 7; n++) {
        cav_html_series series[2] = {{.name = hostile, .n = n, .x = x, .y = y, .label = label, .kind = kind},
                                     {.name = "none", .n = 0}};
        cav_html_plot plot = {hostile, hostile, hostile, logs & 1, logs >> 1, 2, series};
        char *text = draw(&plot);
        // the one without x is not drawn; a guide has no points
        int seen = n > 4 ? n - 1 : n, failed = n > 3 ? 2 : n > 2 ? 1 : 0;
        if (kind != CAV_HTML_GUIDE) CHECK(count(text, "l8 8m0 -8l-8 8") == failed);
        if (kind != CAV_HTML_GUIDE && n) CHECK(count(text, "<circle") == 1 + seen - failed);
        CHECK((strstr(text, ">failed</text>") != NULL) == (failed > 0));
        CHECK((strstr(text, "Nothing could be measured") != NULL) == (n == 0));
        free(text);
      }
    }
  }
}

static void test_map(void) {
  const char *row[] = {"<step>", "mass"}, *column[] = {"1e-3", "1"}, *texts[] = {NULL, "<b>", NULL, NULL};
  double value[] = {1e-12, NAN, -1, 1};
  cav_html page;
  cav_error error = {0};
  cav_html_map map = {"t", "c", 2, 2, row, column, value, texts, 1e-10, 1e-2};
  if (!CHECK(!cav_html_begin(&page, path, "map", NULL, &error))) return;
  cav_html_colours(&page, &map);
  CHECK(!cav_html_end(&page, &error));
  char *text = read_page();
  CHECK(well_formed(text));
  CHECK(strstr(text, "<td style=\"background:hsl(130,70%,68%)\">1e-12</td><td class=\"failed\">&#60;b&#62;</td>") !=
        NULL);
  CHECK(strstr(text, "<td class=\"none\"></td><td style=\"background:hsl(0,70%,68%)\">1</td>") != NULL);
  free(text);
}

static void test_pareto(void) {
  double x[] = {1, 2, 3, 4, 1, NAN, 0.5}, y[] = {10, 5, 5, 1, 10, 0, INFINITY};
  int marked[7], expected[] = {1, 1, 0, 1, 1, 0, 0};
  cav_html_pareto(7, x, y, marked);
  for (int i = 0; i < 7; i++) CHECK(marked[i] == expected[i]);
}

// a page that is given up, or cannot be made, leaves what was there
static void test_failures(void) {
  cav_html page;
  cav_error error = {0};
  CHECK(cav_html_begin(&page, "/nowhere/at/all.html", "x", NULL, &error) == CAV_BAD_INPUT && *error.text);
  char *before = read_page();
  CHECK(*before);
  if (CHECK(!cav_html_begin(&page, path, "given up", NULL, &error))) cav_html_abandon(&page);
  char *after = read_page();
  CHECK_TEXT(after, before);
  free(before);
  free(after);
}

int main(void) {
  int file = mkstemp(path);
  if (file < 0) return EXIT_FAILURE;
  close(file);
  test_reader();
  test_numbers();
  test_text();
  test_logarithmic();
  test_extremes();
  test_map();
  test_pareto();
  test_failures();
  unlink(path);
  return check_result();
}
