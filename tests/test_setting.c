/// Attributes set from outside: in odd but lawful XML all else stays as written, what the file lacks and the grammar knows is
/// added where it belongs, paths of files become absolute, and a path that is not there is told with what there is.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "check.h"
#include "setting.h"

static char folder[] = "/tmp/cavort setting & XXXXXX";
static char source[400], target[400];

static void write_source(const char *text) {
  FILE *file = fopen(source, "w");
  if (!CHECK(file != NULL)) return;
  fputs(text, file);
  fclose(file);
}

static const char *read_target(void) {
  static char text[4000];
  FILE *file = fopen(target, "r");
  size_t n = file ? fread(text, 1, sizeof text - 1, file) : 0;
  if (file) fclose(file);
  text[n] = 0;
  return text;
}

// a file with one setting is the text wanted; %s in it: the folder, as it stands in an attribute
static void check_one(const char *text, const char *path, const char *value, const char *wanted) {
  cav_setting setting = {path, value};
  cav_error error = {0};
  char full[4000];
  const char *at = strstr(wanted, "%s");
  snprintf(full, sizeof full, "%.*s", at ? (int)(at - wanted) : (int)strlen(wanted), wanted);
  if (at) {
    size_t n = strlen(full);
    for (const char *c = folder; *c; c++)
      n += (size_t)snprintf(full + n, sizeof full - n, *c == '&' ? "&amp;" : "%c", *c);
    snprintf(full + n, sizeof full - n, "%s", at + 2);
  }
  write_source(text);
  if (!CHECK(!cav_setting_write(source, 1, &setting, target, &error))) fprintf(stderr, "    %s\n", error.text);
  CHECK_TEXT(read_target(), full);
  unlink(target);
}

static void check_refused(const char *text, const char *path, const char *says) {
  cav_setting setting = {path, "1"};
  cav_error error = {0};
  write_source(text);
  CHECK(cav_setting_write(source, 1, &setting, target, &error) == CAV_BAD_INPUT);
  if (!CHECK(strstr(error.text, says) != NULL)) fprintf(stderr, "    %s: %s\n", path, error.text);
  CHECK(access(target, F_OK) != 0);
}

// what every problem has
#define BASE "<horizon duration='1'/><start/>"
#define SENSOR "type='framepos' body='b' weight='1'"

static void test_values(void) {
  // comments, both quotes, an end of a tag within a value, spaces about the sign
  check_one("<?xml version='1.0'?>\n<!-- <cost><effort weight=\"7\"/></cost> -->\n<problem name='a > b'>\n  " BASE
            "<cost>\n    <effort  weight = '1' name=\"x\"/>\n  </cost>\n</problem>\n",
            "cost/effort/@weight", "2",
            "<?xml version='1.0'?>\n<!-- <cost><effort weight=\"7\"/></cost> -->\n<problem name='a > b'>\n  " BASE
            "<cost>\n    <effort  weight = '2' name=\"x\"/>\n  </cost>\n</problem>\n");
  // by what its name says; the root may be named, and has attributes too
  check_one("<problem>" BASE "<cost><effort weight='1'/><sensor " SENSOR " name='effort of all'/></cost></problem>",
            "problem/cost/effort of all/@scale", "3",
            "<problem>" BASE "<cost><effort weight='1'/><sensor scale=\"3\" " SENSOR
            " name='effort of all'/></cost></problem>");
  check_one("<problem name=\"old\">" BASE "</problem>", "@name", "a<b & \"c\"",
            "<problem name=\"a&lt;b &amp; &quot;c&quot;\">" BASE "</problem>");
  // by its number among those of its tag
  check_one("<problem>" BASE "<cost><velocity weight='1'/><velocity weight='1'/></cost></problem>",
            "cost/velocity[2]/@weight", "5",
            "<problem>" BASE "<cost><velocity weight='1'/><velocity weight='5'/></cost></problem>");
}

static void test_added(void) {
  check_one("<problem>" BASE "</problem>", "horizon/@timestep", "2",
            "<problem><horizon timestep=\"2\" duration='1'/><start/></problem>");
  check_one("<problem>" BASE "\n</problem>", "limits/@effort", "0.5",
            "<problem>" BASE "\n<limits effort=\"0.5\"/></problem>");
  check_one("<problem>" BASE "</problem>", "schedule/last/@softness", "0.01",
            "<problem>" BASE "<schedule><last softness=\"0.01\"/></schedule></problem>");
  check_one("<problem>" BASE "<cost/></problem>", "cost/effort/@weight", "0",
            "<problem>" BASE "<cost><effort weight=\"0\"/></cost></problem>");
}

static void test_files(void) {
  check_one("<problem model=\"m.xml\">" BASE "</problem>", "@name", "n",
            "<problem name=\"n\" model=\"%s/m.xml\">" BASE "</problem>");
  check_one("<problem model='/m.xml'><horizon duration='1'/><start file=\"a/b.csv\"/></problem>", "@name", "n",
            "<problem name=\"n\" model='/m.xml'><horizon duration='1'/><start file=\"%s/a/b.csv\"/></problem>");
  write_source("<problem model=\"m.xml\" name='x'>" BASE "</problem>");
  char *model = cav_setting_root(source, "model"), *none = cav_setting_root(source, "floating");
  CHECK_TEXT(model, "m.xml");
  CHECK_TEXT(none, "");
  free(model);
  free(none);
}

static void test_refused(void) {
  const char *text =
      "<problem>" BASE "<cost><sensor " SENSOR " name='apex'/><sensor " SENSOR " name='foot'/></cost></problem>";
  check_refused(text, "cost/apx/@target", "<cost> of ");
  check_refused(text, "cost/apx/@target", "has no 'apx'; did you mean 'apex'?; it has or may have: apex, sensor, foot");
  check_refused(text, "cost/sensor/@target", "several 'sensor'");
  check_refused(text, "cost/sensor[3]/@target", "has no 'sensor[3]'");
  check_refused(text, "cost/apex/@targt", "did you mean 'target'?");
  check_refused(text, "horizn/@duration", "did you mean 'horizon'?");
  check_refused(text, "cost/apex", "expected names of elements and an attribute");
  check_refused(text, "cost/@", "expected names of elements and an attribute");
  check_refused("<problem><cost></problem>", "@name", "source.xml");
  check_refused("<mujoco/>", "@name", "source.xml");
}

int main(void) {
  if (!CHECK(mkdtemp(folder) != NULL)) return check_result();
  snprintf(source, sizeof source, "%s/source.xml", folder);
  snprintf(target, sizeof target, "%s/target.xml", folder);
  test_values();
  test_added();
  test_files();
  test_refused();
  unlink(source);
  rmdir(folder);
  return check_result();
}
