/// Build tool: writes a file as a C array, so that the program carries it. Usage: embed INPUT OUTPUT NAME
/// The array is `static const unsigned char NAME[]`, its bytes are the file's and one terminating zero.
#include <stdio.h>

// bytes of in as decimal numbers, twenty-four to a line
static void write_bytes(FILE *in, FILE *out) {
  int column = 0;
  for (int c = getc(in); c != EOF; c = getc(in)) { fprintf(out, "%d,%s", c, ++column % 24 == 0 ? "\n" : ""); }
}

int main(int argc, char **argv) {
  if (argc != 4) {
    fprintf(stderr, "usage: embed INPUT OUTPUT NAME\n");
    return 2;
  }
  FILE *in = fopen(argv[1], "rb");
  FILE *out = in ? fopen(argv[2], "wb") : NULL;
  if (!in || !out) {
    fprintf(stderr, "embed: cannot open %s\n", in ? argv[2] : argv[1]);
    if (in) fclose(in);
    return 1;
  }
  fprintf(out, "static const unsigned char %s[] = {\n", argv[3]);
  write_bytes(in, out);
  fprintf(out, "0};\n");
  int failed = ferror(in) || ferror(out);
  fclose(in);
  if (fclose(out) != 0) failed = 1;
  if (failed) fprintf(stderr, "embed: cannot write %s\n", argv[2]);
  return failed;
}
