/// Heights of a field from files: binary and PNG images of our own making give their numbers, damaged ones a reason,
/// what is no file is refused at once; the same image gives the same field in MuJoCo.
#include "elevation.h"

#include <signal.h>
#include <stdint.h>
#include <sys/stat.h>

#include "scene.h"

#ifdef CAVORT_HAVE_MUJOCO
#include <mujoco/mujoco.h>
#endif

enum { LIMIT = 100, ROWS = 3, COLUMNS = 4 };

/// A file under construction.
typedef struct bytes {
  unsigned char at[2000];
  size_t n;
} bytes;

static void put(bytes *b, const void *from, size_t n) {
  memcpy(b->at + b->n, from, n);
  b->n += n;
}

static void put_big(bytes *b, uint32_t x) {
  const unsigned char four[4] = {(unsigned char)(x >> 24), (unsigned char)(x >> 16), (unsigned char)(x >> 8),
                                 (unsigned char)x};
  put(b, four, 4);
}

static uint32_t crc_of(const unsigned char *p, size_t n) {
  uint32_t c = 0xFFFFFFFFu;
  for (size_t i = 0; i < n; i++) {
    c ^= p[i];
    for (int k = 0; k < 8; k++) c = c & 1 ? 0xEDB88320u ^ (c >> 1) : c >> 1;
  }
  return ~c;
}

static void put_chunk(bytes *b, const char *type, const void *data, size_t n) {
  put_big(b, (uint32_t)n);
  size_t start = b->n;
  put(b, type, 4);
  put(b, data, n);
  put_big(b, crc_of(b->at + start, n + 4));
}

// an image whose rows of pixels are stored without compression (RFC 1950, 1951; PNG specification, third edition)
static bytes make_png(int rows, int columns, int depth, int colour, int interlace, const unsigned char *pixel,
                      int stride) {
  static const unsigned char mark[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
  bytes png = {.n = 0}, head = {.n = 0}, body = {.n = 0}, raw = {.n = 0};
  put(&png, mark, sizeof mark);
  put_big(&head, (uint32_t)columns);
  put_big(&head, (uint32_t)rows);
  const unsigned char format[5] = {(unsigned char)depth, (unsigned char)colour, 0, 0, (unsigned char)interlace};
  put(&head, format, sizeof format);
  put_chunk(&png, "IHDR", head.at, head.n);
  uint32_t a = 1, c = 0;
  for (int r = 0; r < rows; r++) {
    put(&raw, "", 1);
    put(&raw, pixel + r * stride, (size_t)stride);
  }
  for (size_t i = 0; i < raw.n; i++) a = (a + raw.at[i]) % 65521, c = (c + a) % 65521;
  const unsigned char stored[7] = {0x78,
                                   1,
                                   1,
                                   (unsigned char)raw.n,
                                   (unsigned char)(raw.n >> 8),
                                   (unsigned char)~raw.n,
                                   (unsigned char)(~raw.n >> 8)};
  put(&body, stored, sizeof stored);
  put(&body, raw.at, raw.n);
  put_big(&body, c << 16 | a);
  put_chunk(&png, "IDAT", body.at, body.n);
  put_chunk(&png, "IEND", "", 0);
  return png;
}

static const unsigned char grey[ROWS * COLUMNS] = {0, 10, 20, 30, 100, 90, 80, 70, 255, 3, 2, 1};

static bytes make_binary(uint32_t rows, uint32_t columns) {
  bytes b = {.n = 0};
  put(&b, &rows, 4);
  put(&b, &columns, 4);
  for (uint32_t i = 0; i < ROWS * COLUMNS; i++) {
    float x = (float)i - 2.5f;
    put(&b, &x, sizeof x);
  }
  return b;
}

static char path[] = "/tmp/cavort-elevation-XXXXXX.png";

static void write_bytes(const bytes *b, size_t n) {
  FILE *file = fopen(path, "wb");
  if (!CHECK(file != NULL)) return;
  CHECK(fwrite(b->at, 1, n, file) == n);
  fclose(file);
}

static cav_status read_bytes(const bytes *b, cav_elevation *e, char reason[200]) {
  write_bytes(b, b->n);
  return cav_elevation_read(path, LIMIT, e, reason, 200);
}

static void test_binary(void) {
  bytes b = make_binary(ROWS, COLUMNS);
  cav_elevation e;
  char reason[200] = "";
  CHECK(read_bytes(&b, &e, reason) == CAV_OK);
  CHECK(e.nrow == ROWS && e.ncol == COLUMNS);
  for (int i = 0; i < ROWS * COLUMNS && e.height; i++) CHECK_NEAR(e.height[i], i - 2.5, 0);
  free(e.height);
  const bytes wrong[] = {make_binary(ROWS, COLUMNS + 1),
                         make_binary(ROWS, COLUMNS - 1),
                         make_binary(1, 12),
                         make_binary(LIMIT + 1, 2),
                         {.n = 3}};
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
    CHECK(read_bytes(&wrong[i], &e, reason) == CAV_BAD_INPUT && !e.height);
    CHECK(strstr(reason, "expected a PNG image, or two 32-bit integers") != NULL);
  }
  float infinite = INFINITY;
  memcpy(b.at + 8 + 4 * 6, &infinite, sizeof infinite);
  CHECK(read_bytes(&b, &e, reason) == CAV_BAD_INPUT && !e.height);
  CHECK(strstr(reason, "row 2, column 3 is not finite") != NULL);
}

// nobody writes into the pipe: whoever opens it to read waits for ever
static void test_pipe(void) {
  cav_elevation e;
  char reason[200] = "";
  unlink(path);
  CHECK(mkfifo(path, 0600) == 0);
  alarm(20);
  CHECK(cav_elevation_read(path, LIMIT, &e, reason, sizeof reason) == CAV_BAD_INPUT);
  alarm(0);
  CHECK(strstr(reason, "cannot be opened") != NULL);
  unlink(path);
}

#ifdef CAVORT_HAVE_PNG

static void check_image(const bytes *b, const double *expected) {
  cav_elevation e;
  char reason[200] = "";
  if (!CHECK(read_bytes(b, &e, reason) == CAV_OK)) fprintf(stderr, "    %s\n", reason);
  if (!e.height) return;
  CHECK(e.nrow == ROWS && e.ncol == COLUMNS);
  // the top of an image is its last row
  for (int i = 0; i < ROWS * COLUMNS; i++) {
    CHECK_NEAR(e.height[i], expected[(ROWS - 1 - i / COLUMNS) * COLUMNS + i % COLUMNS], 0);
  }
  free(e.height);
}

static void test_images(void) {
  double expected[ROWS * COLUMNS];
  unsigned char wide[2 * ROWS * COLUMNS], colour[4 * ROWS * COLUMNS], with_alpha[2 * ROWS * COLUMNS];
  for (int i = 0; i < ROWS * COLUMNS; i++) {
    expected[i] = grey[i];
    for (int k = 0; k < 4; k++) colour[4 * i + k] = k < 3 ? grey[i] : (unsigned char)(17 * i);
    with_alpha[2 * i] = grey[i];
    with_alpha[2 * i + 1] = (unsigned char)(20 * i);
  }
  bytes b = make_png(ROWS, COLUMNS, 8, 0, 0, grey, COLUMNS);
  check_image(&b, expected);
  b = make_png(ROWS, COLUMNS, 8, 4, 0, with_alpha, 2 * COLUMNS);
  check_image(&b, expected);
  b = make_png(ROWS, COLUMNS, 8, 6, 0, colour, 4 * COLUMNS);
  check_image(&b, expected);
  // four bits a pixel: 0 to 15 stand for 0 to 255
  static const unsigned char nibbles[ROWS * COLUMNS / 2] = {0x01, 0x23, 0x45, 0x67, 0x89, 0xAF};
  static const double of_nibbles[ROWS * COLUMNS] = {0, 17, 34, 51, 68, 85, 102, 119, 136, 153, 170, 255};
  b = make_png(ROWS, COLUMNS, 4, 0, 0, nibbles, COLUMNS / 2);
  check_image(&b, of_nibbles);
  // sixteen bits keep all of them
  for (int i = 0; i < ROWS * COLUMNS; i++) {
    expected[i] = 5000 * i + 7;
    wide[2 * i] = (unsigned char)((5000 * i + 7) >> 8);
    wide[2 * i + 1] = (unsigned char)(5000 * i + 7);
  }
  b = make_png(ROWS, COLUMNS, 16, 0, 0, wide, 2 * COLUMNS);
  check_image(&b, expected);
}

// bytes changed or missing: heights or a reason, and every place that can be wrong is reached
static void test_damage(void) {
  const bytes whole = make_png(ROWS, COLUMNS, 8, 0, 0, grey, COLUMNS);
  cav_elevation e;
  char reason[200] = "";
  bytes b = make_png(ROWS, COLUMNS, 8, 0, 1, grey, COLUMNS);
  CHECK(read_bytes(&b, &e, reason) == CAV_BAD_INPUT && strstr(reason, "is interlaced"));
  b = make_png(1, ROWS * COLUMNS, 8, 0, 0, grey, ROWS * COLUMNS);
  CHECK(read_bytes(&b, &e, reason) == CAV_BAD_INPUT && strstr(reason, "12 by 1 pixels; 2 to 100"));
  b = whole;
  b.n -= 40;
  CHECK(read_bytes(&b, &e, reason) == CAV_BAD_INPUT && strstr(reason, "is not a PNG image that can be read"));
  int refused = 0;
  for (size_t i = 8; i < whole.n; i++) {
    for (int change = 1; change < 256; change *= 4) {
      b = whole;
      b.at[i] = (unsigned char)(b.at[i] ^ change);
      reason[0] = 0;
      cav_status status = read_bytes(&b, &e, reason);
      CHECK((status == CAV_OK) == (e.height != NULL) && (status == CAV_OK) == (reason[0] == 0));
      refused += status != CAV_OK;
      free(e.height);
    }
  }
  printf("PNG of %zu bytes: %d of %zu single changes refused\n", whole.n, refused, 4 * (whole.n - 8));
  CHECK(refused > 0);
}

#ifdef CAVORT_HAVE_MUJOCO
// the field of an image in both: heights from 0 to 1
static void test_peer(void) {
  char model[] = "/tmp/cavort-elevation-XXXXXX.xml", text[1000] = "", error[300] = "";
  bytes b = make_png(ROWS, COLUMNS, 8, 0, 0, grey, COLUMNS);
  write_bytes(&b, b.n);
  int file = mkstemps(model, 4);
  snprintf(text, sizeof text,
           "<mujoco><asset><hfield name='h' file='%s' size='1 1 1 1'/></asset><worldbody>"
           "<geom type='hfield' hfield='h'/><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>",
           path);
  CHECK(file >= 0 && write(file, text, strlen(text)) == (ssize_t)strlen(text));
  close(file);
  cav_error reason = {0};
  cav_model *ours = cav_model_load(model, &reason);
  mjModel *theirs = mj_loadXML(model, NULL, error, sizeof error);
  if (!CHECK(ours && theirs)) fprintf(stderr, "    %s %s\n", reason.text, error);
  double most = 0;
  for (int i = 0; i < ROWS * COLUMNS && ours && theirs; i++)
    most = fmax(most, fabs(ours->hfield[0].height[i] - (double)theirs->hfield_data[i]));
  printf("PNG as a height field against MuJoCo: %.1e\n", most);
  CHECK_NEAR(most, 0, 1e-7); // it holds heights in single precision; seen: 2e-8
  if (theirs) mj_deleteModel(theirs);
  cav_model_free(ours);
  unlink(model);
}
#endif

#else

static void test_refused(void) {
  bytes b = make_png(ROWS, COLUMNS, 8, 0, 0, grey, COLUMNS);
  cav_elevation e;
  char reason[200] = "";
  CHECK(read_bytes(&b, &e, reason) == CAV_BAD_INPUT && strstr(reason, "without libpng"));
}

#endif

int main(void) {
  int file = mkstemps(path, 4);
  if (!CHECK(file >= 0)) return check_result();
  close(file);
  test_binary();
  test_pipe();
#ifdef CAVORT_HAVE_PNG
  test_images();
  test_damage();
#ifdef CAVORT_HAVE_MUJOCO
  test_peer();
#endif
#else
  test_refused();
#endif
  unlink(path);
  return check_result();
}
