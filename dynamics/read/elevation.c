/// Reads heights of a field: a binary file of two 32-bit integers, rows and columns, and that many 32-bit floats, all
/// little endian, or a PNG image, whose brightness is the height.
///
/// An image's rows go from high to low y, those of a binary file from low to high, as in MJCF. Grey images of 1 to 16
/// bits are taken as they are, without gamma; colours are weighed to grey by libpng (Rec. 709), transparency is
/// dropped. Without libpng an image is refused with what to do. Not done: other image formats.
#include "elevation.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#ifdef CAVORT_LOADS_PNG
#include <png.h>

#include "library.h"
#endif

static const unsigned char PNG_MARK[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};

static unsigned word_at(const unsigned char *p) {
  return p[0] | (unsigned)p[1] << 8 | (unsigned)p[2] << 16 | (unsigned)p[3] << 24;
}

// room for the heights of a grid
static cav_status allocate(cav_elevation *e, unsigned rows, unsigned columns, char *reason, size_t room) {
  e->height = malloc(sizeof *e->height * rows * columns);
  if (!e->height) {
    snprintf(reason, room, "no memory for %u by %u heights", rows, columns);
    return CAV_NO_MEMORY;
  }
  e->nrow = (int)rows;
  e->ncol = (int)columns;
  return CAV_OK;
}

static int is_sane(unsigned rows, unsigned columns, int limit) {
  return rows >= 2 && columns >= 2 && rows <= (unsigned)limit && columns <= (unsigned)limit;
}

static cav_status read_binary(FILE *file, int limit, cav_elevation *e, char *reason, size_t room) {
  unsigned char head[8], four[4];
  unsigned rows = 0, columns = 0;
  if (fread(head, 1, sizeof head, file) == sizeof head) rows = word_at(head), columns = word_at(head + 4);
  int whole = is_sane(rows, columns, limit);
  cav_status status = whole ? allocate(e, rows, columns, reason, room) : CAV_OK;
  for (size_t i = 0; i < (size_t)rows * columns && whole && status == CAV_OK; i++) {
    float x;
    whole = fread(four, 1, sizeof four, file) == sizeof four;
    unsigned bits = whole ? word_at(four) : 0;
    memcpy(&x, &bits, sizeof x);
    e->height[i] = (double)x;
    if (isfinite(e->height[i])) continue;
    snprintf(reason, room, "the height of row %zu, column %zu is not finite", i / columns + 1, i % columns + 1);
    return CAV_BAD_INPUT;
  }
  if (status != CAV_OK || (whole && getc(file) == EOF)) return status;
  snprintf(reason, room,
           "expected a PNG image, or two 32-bit integers, rows and columns (2 to %d each), and that many 32-bit floats",
           limit);
  return CAV_BAD_INPUT;
}

#ifdef CAVORT_LOADS_PNG

// clang-format off
#define FUNCTIONS(X) \
  X(png_create_read_struct) X(png_create_info_struct) X(png_destroy_read_struct) X(png_get_error_ptr) \
  X(png_set_longjmp_fn) X(png_longjmp) X(png_init_io) X(png_read_info) X(png_read_update_info) X(png_read_row) \
  X(png_get_image_width) X(png_get_image_height) X(png_get_rowbytes) X(png_get_bit_depth) X(png_get_color_type) \
  X(png_get_interlace_type) X(png_set_palette_to_rgb) X(png_set_expand_gray_1_2_4_to_8) \
  X(png_set_rgb_to_gray_fixed) X(png_set_strip_alpha)
// clang-format on

typedef struct functions {
  FUNCTIONS(CAV_LIBRARY_POINTER)
} functions;

static const cav_library library = {"libpng", CAVORT_LOADS_PNG, "libpng-dev", {FUNCTIONS(CAV_LIBRARY_NAME) NULL}};

/// A PNG being read: where libpng jumps on failure, and what it said.
typedef struct image {
  functions call;
  png_structp png;
  png_infop info;
  unsigned char *row;
  char *reason;
  size_t room;
} image;

static void image_failed(png_structp png, png_const_charp message) {
  functions call;
  char reason[200];
  // libpng gives nothing but png, so the functions are asked for anew; they were there when the image was begun
  cav_status status = cav_library_load(&library, &call, sizeof call, reason, sizeof reason);
  assert(status == CAV_OK);
  (void)status;
  image *i = call.png_get_error_ptr(png);
  snprintf(i->reason, i->room, "is not a PNG image that can be read: %s", message);
  call.png_longjmp(png, 1);
}

static void image_warns(png_structp png, png_const_charp message) { (void)png, (void)message; }

// asks libpng for rows of grey, 8 or 16 bits a pixel
static void ask_for_grey(image *i) {
  int colour = i->call.png_get_color_type(i->png, i->info);
  if (colour == PNG_COLOR_TYPE_PALETTE) i->call.png_set_palette_to_rgb(i->png);
  if (colour == PNG_COLOR_TYPE_GRAY && i->call.png_get_bit_depth(i->png, i->info) < 8)
    i->call.png_set_expand_gray_1_2_4_to_8(i->png);
  if (colour & PNG_COLOR_MASK_COLOR) i->call.png_set_rgb_to_gray_fixed(i->png, PNG_ERROR_ACTION_NONE, -1, -1);
  i->call.png_set_strip_alpha(i->png);
  i->call.png_read_update_info(i->png, i->info);
}

// the whole of an image; what it allocates is in i and e, as libpng leaves by a jump
static cav_status read_image(FILE *file, int limit, image *i, cav_elevation *e) {
  if (setjmp(*i->call.png_set_longjmp_fn(i->png, longjmp, sizeof(jmp_buf)))) return CAV_BAD_INPUT;
  i->call.png_init_io(i->png, file);
  i->call.png_read_info(i->png, i->info);
  unsigned rows = i->call.png_get_image_height(i->png, i->info), columns = i->call.png_get_image_width(i->png, i->info);
  if (!is_sane(rows, columns, limit)) {
    snprintf(i->reason, i->room, "%u by %u pixels; 2 to %d along each side are read", columns, rows, limit);
    return CAV_BAD_INPUT;
  }
  if (i->call.png_get_interlace_type(i->png, i->info) != PNG_INTERLACE_NONE) {
    snprintf(i->reason, i->room, "is interlaced; save the image without interlacing");
    return CAV_BAD_INPUT;
  }
  ask_for_grey(i);
  int wide = i->call.png_get_bit_depth(i->png, i->info) == 16;
  i->row = malloc(i->call.png_get_rowbytes(i->png, i->info));
  if (!i->row) {
    snprintf(i->reason, i->room, "no memory for %u pixels", columns);
    return CAV_NO_MEMORY;
  }
  cav_status status = allocate(e, rows, columns, i->reason, i->room);
  for (unsigned r = 0; r < rows && status == CAV_OK; r++) {
    i->call.png_read_row(i->png, i->row, NULL);
    double *height = e->height + (size_t)(rows - 1 - r) * columns;
    for (unsigned c = 0; c < columns; c++) height[c] = wide ? i->row[2 * c] << 8 | i->row[2 * c + 1] : i->row[c];
  }
  return status;
}

static cav_status read_png(FILE *file, int limit, cav_elevation *e, char *reason, size_t room) {
  image i = {.reason = reason, .room = room};
  cav_status status = cav_library_load(&library, &i.call, sizeof i.call, reason, room);
  if (status != CAV_OK) return CAV_BAD_INPUT;
  i.png = i.call.png_create_read_struct(PNG_LIBPNG_VER_STRING, &i, image_failed, image_warns);
  i.info = i.png ? i.call.png_create_info_struct(i.png) : NULL;
  status = CAV_NO_MEMORY;
  if (i.info)
    status = read_image(file, limit, &i, e);
  else
    snprintf(reason, room, "no memory for an image");
  i.call.png_destroy_read_struct(&i.png, &i.info, NULL);
  free(i.row);
  return status;
}

#else

static cav_status read_png(FILE *file, int limit, cav_elevation *e, char *reason, size_t room) {
  (void)file, (void)limit, (void)e;
  snprintf(reason, room,
           "is a PNG image, which this build is without libpng to read; build with -Dpng=enabled, or convert it to two "
           "32-bit integers, rows and columns, and that many 32-bit floats");
  return CAV_BAD_INPUT;
}

#endif

cav_status cav_elevation_read(const char *path, int limit, cav_elevation *e, char *reason, size_t room) {
  unsigned char mark[sizeof PNG_MARK];
  struct stat info;
  *e = (cav_elevation){0};
  // what is not a file, a pipe say, would be waited for
  FILE *file = stat(path, &info) || !S_ISREG(info.st_mode) ? NULL : fopen(path, "rb");
  if (!file) {
    snprintf(reason, room, "cannot be opened; check the path");
    return CAV_BAD_INPUT;
  }
  int is_png = fread(mark, 1, sizeof mark, file) == sizeof mark && !memcmp(mark, PNG_MARK, sizeof mark);
  rewind(file);
  cav_status status = (is_png ? read_png : read_binary)(file, limit, e, reason, room);
  fclose(file);
  if (status != CAV_OK) {
    free(e->height);
    e->height = NULL;
  }
  return status;
}
