/// Tables of measurements, as files and on pages.
#include "sheet.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "result.h"

void cav_sheet_free(cav_sheet *sheet) {
  free(sheet->row);
  free(sheet->value);
  sheet->row = NULL;
  sheet->value = NULL;
  sheet->nrow = sheet->room = 0;
}

double *cav_sheet_add(cav_sheet *sheet, const char *a, const char *b, const char *c) {
  const char *const text[CAV_SHEET_TEXTS] = {a, b, c};
  size_t width = (size_t)sheet->nnumber;
  if (sheet->nrow == sheet->room) {
    size_t room = 2 * (size_t)sheet->room + 16;
    cav_sheet_row *row = realloc(sheet->row, room * sizeof *row);
    if (row) sheet->row = row;
    double *value = realloc(sheet->value, room * width * sizeof *value);
    if (value) sheet->value = value;
    if (!row || !value) {
      sheet->lost++;
      return NULL;
    }
    sheet->room = (int)room;
  }
  cav_sheet_row *row = &sheet->row[sheet->nrow];
  *row = (cav_sheet_row){0};
  for (int i = 0; i < CAV_SHEET_TEXTS; i++) snprintf(row->label[i], sizeof row->label[i], "%s", text[i] ? text[i] : "");
  double *value = sheet->value + (size_t)sheet->nrow++ * width;
  for (size_t i = 0; i < width; i++) value[i] = CAV_SHEET_NONE;
  return value;
}

static void write_text(FILE *out, const char *text) {
  fputc('"', out);
  for (; *text; text++) {
    if (*text == '"') fputc('"', out);
    fputc(*text, out);
  }
  fputc('"', out);
}

cav_status cav_sheet_write(const cav_sheet *sheet, const char *folder, cav_error *error) {
  char name[64];
  cav_file file;
  snprintf(name, sizeof name, "%s.csv", sheet->name);
  if (sheet->lost > 0) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the rows of %s", name);
  char *path = cav_result_path(folder, name);
  cav_status status =
      path ? cav_file_begin(&file, path, error) : cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for %s", name);
  free(path);
  if (status) return status;
  for (int i = 0; i < sheet->ntext + sheet->nnumber; i++)
    fprintf(file.stream, "%s%s", i ? "," : "", sheet->column[i].name);
  fputc('\n', file.stream);
  for (int r = 0; r < sheet->nrow; r++) {
    for (int i = 0; i < sheet->ntext; i++) {
      if (i) fputc(',', file.stream);
      write_text(file.stream, sheet->row[r].label[i]);
    }
    for (int i = 0; i < sheet->nnumber; i++) {
      double x = cav_sheet_get(sheet, r, i);
      if (sheet->ntext + i > 0) fputc(',', file.stream);
      if (isfinite(x)) fprintf(file.stream, "%.9g", x);
      if (!isfinite(x) && x != CAV_SHEET_NONE) fputs("failed", file.stream);
    }
    fputc('\n', file.stream);
  }
  return cav_file_end(&file, error);
}

void cav_sheet_show(const cav_sheet *sheet, cav_html *page, const char *caption, const int *column,
                    const char *const *heading, int (*keep)(const cav_sheet *sheet, int row)) {
  int n = 0;
  while (column[n] >= 0) assert(column[n] < sheet->ntext + sheet->nnumber), n++;
  cav_html_table(page, caption, n, heading);
  for (int r = 0; r < sheet->nrow; r++) {
    if (keep && !keep(sheet, r)) continue;
    if (sheet->row[r].marked) cav_html_mark(page);
    for (int i = 0; i < n; i++) {
      double x = column[i] < sheet->ntext ? 0 : cav_sheet_get(sheet, r, column[i] - sheet->ntext);
      if (column[i] < sheet->ntext)
        cav_html_cell(page, "%s", sheet->row[r].label[column[i]]);
      else if (x == CAV_SHEET_NONE)
        cav_html_cell(page, " ");
      else
        cav_html_number(page, x, 3);
    }
  }
}

void cav_sheet_link(const cav_sheet *sheet, cav_html *page, const char *text) {
  char name[64];
  snprintf(name, sizeof name, "%s.csv", sheet->name);
  cav_html_link(page, name, text);
  for (int i = 0; i < sheet->ntext + sheet->nnumber; i++)
    cav_html_entry(page, sheet->column[i].name, "%s", sheet->column[i].text);
}
