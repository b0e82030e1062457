/// Build tool: writes a file as a C array, so that the program carries it. Usage: embed INPUT OUTPUT NAME
/// The array is `static const unsigned char NAME[]`, its bytes are the file's and one terminating zero. A line of the file
/// that says "CAVORT_INCLUDE OTHER" is replaced by the lines of OTHER, a file in the same folder.
#include <stdio.h>
#include <string.h>

// bytes of a line as decimal numbers
static void write_line(const char *line, size_t size, FILE *out) {
  for (size_t i = 0; i < size; i++) fprintf(out, "%d,", (unsigned char)line[i]);
  putc('\n', out);
}

// the lines of a file, those of what it includes in their place; deep: whether this file is included itself
static int write_file(const char *path, FILE *out, int deep) {
  static const char include[] = "CAVORT_INCLUDE ";
  char line[2][4096], other[4096];
  FILE *in = fopen(path, "rb");
  if (!in) {
    fprintf(stderr, "embed: cannot open %s\n", path);
    return 1;
  }
  const char *slash = strrchr(path, '/');
  int failed = 0;
  while (!failed && fgets(line[deep], sizeof line[deep], in)) {
    char *name = line[deep] + sizeof include - 1;
    if (deep || strncmp(line[deep], include, sizeof include - 1)) {
      write_line(line[deep], strlen(line[deep]), out);
      continue;
    }
    name[strcspn(name, "\r\n")] = 0;
    int length = snprintf(other, sizeof other, "%.*s%s", slash ? (int)(slash - path) + 1 : 0, path, name);
    failed = length >= (int)sizeof other || write_file(other, out, 1);
  }
  failed |= ferror(in) != 0;
  fclose(in);
  return failed;
}

int main(int argc, char **argv) {
  if (argc != 4) {
    fprintf(stderr, "usage: embed INPUT OUTPUT NAME\n");
    return 2;
  }
  FILE *out = fopen(argv[2], "wb");
  if (!out) {
    fprintf(stderr, "embed: cannot open %s\n", argv[2]);
    return 1;
  }
  fprintf(out, "static const unsigned char %s[] = {\n", argv[3]);
  int failed = write_file(argv[1], out, 0);
  fprintf(out, "0};\n");
  failed |= ferror(out) != 0;
  if (fclose(out) != 0) failed = 1;
  if (failed) fprintf(stderr, "embed: cannot write %s\n", argv[2]);
  return failed;
}
