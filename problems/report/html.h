/// A page of HTML that a report is written into: complete in itself, without scripts, readable on a phone and in the
/// dark. Text is escaped; a number that is not finite is shown as failed, one that has no logarithm as 0.
///
/// Calls write in the order in which they are made, into a file that takes its place at the end. What goes wrong on the
/// way (no memory, disk full) is told by cav_html_end. One thread a page.
#ifndef CAVORT_HTML_H
#define CAVORT_HTML_H

#include "file.h"
#include "provenance.h"

/// What is open on a page and has to be closed before something else begins.
typedef enum cav_html_open { CAV_HTML_NOTHING, CAV_HTML_LIST, CAV_HTML_TABLE } cav_html_open;

/// A page on its way; fields are private.
typedef struct cav_html {
  cav_file file;
  cav_html_open open;
  int ncolumn, column; ///< of the open table; the column that the next cell goes to
  int marked;          ///< the next row is
  cav_status status;
} cav_html;

/// Opens the page: title, and a line below it that says what it is about (NULL: none). Fails as cav_file_begin does.
cav_status cav_html_begin(cav_html *page, const char *path, const char *title, const char *about, cav_error *error);

/// Ends the page and puts it in its place. On failure there is no new page, and error (may be NULL) says why.
cav_status cav_html_end(cav_html *page, cav_error *error);

/// Gives the page up.
void cav_html_abandon(cav_html *page);

/// Ends the list or table that is open: what writes to the page's stream itself begins with this.
void cav_html_close(cav_html *page);

/// Text as HTML and XML take it; what is not UTF-8 becomes a replacement character.
void cav_html_escape(FILE *out, const char *text);

/// A heading of a section.
void cav_html_heading(cav_html *page, const char *text);

/// A paragraph, as printf.
void cav_html_paragraph(cav_html *page, const char *format, ...) __attribute__((format(printf, 2, 3)));

/// An entry of a list: a term, and what is to be said of it. Entries that follow each other make one list.
void cav_html_entry(cav_html *page, const char *term, const char *format, ...) __attribute__((format(printf, 3, 4)));

/// A link to a file beside the page and what it holds; name is of letters, digits, '-', '_' and '.'.
void cav_html_link(cav_html *page, const char *name, const char *text);

/// Where the page comes from: command, program, machine, date, files.
void cav_html_provenance(cav_html *page, const cav_provenance *provenance);

/// A number in few letters: so many digits, "failed" if it is not finite.
enum { CAV_HTML_NUMBER = 32 };
void cav_html_number_text(double value, int digits, char text[CAV_HTML_NUMBER]);

/// Opens a table: its caption (NULL: none) and the headings of its columns [ncolumn]. Cells follow row by row; what is
/// written next that is no cell closes it, and the last row must then be full.
void cav_html_table(cav_html *page, const char *caption, int ncolumn, const char *const *heading);

/// Marks the row whose first cell comes next, as of the Pareto set.
void cav_html_mark(cav_html *page);

/// A cell of text, as printf.
void cav_html_cell(cav_html *page, const char *format, ...) __attribute__((format(printf, 2, 3)));

/// A cell with a number of so many digits.
void cav_html_number(cav_html *page, double value, int digits);

/// One series of a plot.
typedef struct cav_html_series {
  const char *name;
  int n;
  const double *x, *y;      ///< [n]; where y is not finite, a cross at the plot's top says so
  const int *marked;        ///< [n] 1: filled, as of the Pareto set; NULL: none
  const char *const *label; ///< [n] what a point is, shown when pointed at; NULL: none
  /// Joined points; points; a dashed line; a line without points.
  enum { CAV_HTML_LINE, CAV_HTML_POINTS, CAV_HTML_GUIDE, CAV_HTML_CURVE } kind;
} cav_html_series;

/// A plot. On a logarithmic axis what is not positive is drawn in a strip of its own, labelled 0.
typedef struct cav_html_plot {
  const char *title, *x, *y; ///< y is told above the axis
  int log_x, log_y;
  int nseries;
  const cav_html_series *series;
} cav_html_plot;

/// Draws plots side by side where there is room.
void cav_html_plots(cav_html *page, int n, const cav_html_plot *plot);

/// A map of colours over a table, from good (green) to bad (red), on a logarithmic scale between the two. One row makes
/// a strip. A value below 0 was not measured; one that is not finite has failed.
typedef struct cav_html_map {
  const char *title, *corner; ///< corner: what rows and columns are
  int nrow, ncolumn;
  const char *const *row;    ///< [nrow]
  const char *const *column; ///< [ncolumn]
  const double *value;       ///< [nrow*ncolumn]
  const char *const *text;   ///< [nrow*ncolumn] what is shown instead of the value where not NULL; NULL: values
  double good, bad;          ///< both > 0, good < bad
} cav_html_map;

void cav_html_colours(cav_html *page, const cav_html_map *map);

/// Marks the Pareto set of n points [n]: those that none is better or as good in both and better in one, both to be
/// small. What is not finite is not of it.
void cav_html_pareto(int n, const double *x, const double *y, int *marked);

#endif
