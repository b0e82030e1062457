/// The text of a report's page: its frame, paragraphs, lists, tables and maps of colours. Well-formed XML as well as
/// HTML. What it looks like is in the style below; plots are drawn by plot.c.
#include "html.h"

#include <assert.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "utf8.h"

// colours of series and of maps, in the light and in the dark; everything else follows the text's colour
static const char style[] =
    ":root{color-scheme:light "
    "dark;--line:#d4d4d4;--soft:#f4f4f2;--mark:#fff3c4;--bad:#b3261e;--ink:#1b1b1b;--page:#fff}\n"
    "@media(prefers-color-scheme:dark){:root{--line:#444;--soft:#242424;--mark:#4a3f12;--bad:#ff8a80;--ink:#e6e6e6;"
    "--page:#171717}}\n"
    "body{font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--page);max-width:70rem;margin:0 auto;"
    "padding:1rem}\n"
    "h1{font-size:1.6rem;line-height:1.2;margin:.5rem 0}h2{font-size:1.25rem;margin:2.2rem 0 .5rem;"
    "border-top:1px solid var(--line);padding-top:1rem}\n"
    "p,dl{max-width:46rem}dt{font-weight:600}dd{margin:0 0 .6rem 1rem;overflow-wrap:anywhere}\n"
    ".scroll{overflow-x:auto;margin:1rem 0}table{border-collapse:collapse;font-size:.875rem}"
    "caption{text-align:left;font-weight:600;padding:.3rem 0}\n"
    ".scroll td:first-child{white-space:nowrap}th,td{padding:.2rem .6rem;border-bottom:1px solid "
    "var(--line);text-align:left;vertical-align:top}"
    "th{background:var(--soft)}.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}"
    ".mark td{background:var(--mark)}.bad{color:var(--bad);font-weight:600}\n"
    ".map td{text-align:center;border:1px solid var(--page);color:#111;font-variant-numeric:tabular-nums;"
    "white-space:nowrap}.map .none{background:var(--soft)}.map .failed{background:#7a1410;color:#fff}\n"
    ".plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,27rem),1fr));gap:1rem;margin:1rem 0}"
    "figure{margin:0}figcaption{font-weight:600}svg{display:block;width:100%;height:auto;max-width:40rem}"
    "svg text{fill:currentColor;font:12px system-ui,sans-serif}.grid{opacity:.15}\n"
    ".key{font-size:.875rem;display:flex;flex-wrap:wrap;gap:.1rem 1rem}.key span{display:inline-flex;gap:.3rem;"
    "align-items:center}.key svg{width:18px;height:14px}\n"
    ".c0{color:#0b62c4}.c1{color:#c4470b}.c2{color:#1a7f37}.c3{color:#8e3bb5}.c4{color:#8a6a00}.c5{color:#0a8a8a}"
    ".c6{color:#b5205f}.c7{color:#5c5c5c}\n"
    "@media(prefers-color-scheme:dark){.c0{color:#6cb0ff}.c1{color:#ff9a5c}.c2{color:#5fd07f}.c3{color:#cf97ee}"
    ".c4{color:#e0bb3a}.c5{color:#4fd0d0}.c6{color:#ff82b2}.c7{color:#b0b0b0}}\n";

void cav_html_escape(FILE *out, const char *text) {
  for (const unsigned char *s = (const unsigned char *)(text ? text : ""); *s;) {
    int n = cav_utf8_length(s);
    if (n == 0 || (n == 1 && ((*s < 0x20 && *s != '\n' && *s != '\t') || *s == 0x7F))) {
      fputs("&#xFFFD;", out);
      s++;
    } else if (n == 1 && strchr("&<>\"'", *s)) {
      fprintf(out, "&#%d;", *s++);
    } else {
      fwrite(s, 1, (size_t)n, out);
      s += n;
    }
  }
}

// formatted text, escaped
static void put(cav_html *page, const char *format, va_list list) {
  va_list again;
  va_copy(again, list);
  int n = vsnprintf(NULL, 0, format, again);
  va_end(again);
  char *text = n < 0 ? NULL : malloc((size_t)n + 1);
  if (!text) {
    page->status = CAV_NO_MEMORY;
    return;
  }
  vsnprintf(text, (size_t)n + 1, format, list);
  cav_html_escape(page->file.stream, text);
  free(text);
}

void cav_html_close(cav_html *page) {
  if (page->open == CAV_HTML_LIST) fputs("</dl>\n", page->file.stream);
  if (page->open == CAV_HTML_TABLE) {
    assert(page->column == 0);
    fputs("</tbody></table></div>\n", page->file.stream);
  }
  page->open = CAV_HTML_NOTHING;
}

cav_status cav_html_begin(cav_html *page, const char *path, const char *title, const char *about, cav_error *error) {
  *page = (cav_html){0};
  cav_status status = cav_file_begin(&page->file, path, error);
  if (status) return status;
  FILE *out = page->file.stream;
  fputs(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>",
      out);
  cav_html_escape(out, title);
  fprintf(out, "</title>\n<style>\n%s</style></head>\n<body>\n<h1>", style);
  cav_html_escape(out, title);
  fputs("</h1>\n", out);
  if (about) cav_html_paragraph(page, "%s", about);
  return CAV_OK;
}

cav_status cav_html_end(cav_html *page, cav_error *error) {
  cav_html_close(page);
  fputs("</body></html>\n", page->file.stream);
  if (!page->status) return cav_file_end(&page->file, error);
  cav_status status = cav_file_fail(error, page->status, 0, "%s: no memory for the page", page->file.path);
  cav_file_abandon(&page->file);
  return status;
}

void cav_html_abandon(cav_html *page) { cav_file_abandon(&page->file); }

void cav_html_heading(cav_html *page, const char *text) {
  cav_html_close(page);
  fputs("<h2>", page->file.stream);
  cav_html_escape(page->file.stream, text);
  fputs("</h2>\n", page->file.stream);
}

void cav_html_paragraph(cav_html *page, const char *format, ...) {
  va_list list;
  cav_html_close(page);
  fputs("<p>", page->file.stream);
  va_start(list, format);
  put(page, format, list);
  va_end(list);
  fputs("</p>\n", page->file.stream);
}

void cav_html_entry(cav_html *page, const char *term, const char *format, ...) {
  va_list list;
  if (page->open != CAV_HTML_LIST) {
    cav_html_close(page);
    fputs("<dl>\n", page->file.stream);
    page->open = CAV_HTML_LIST;
  }
  fputs("<dt>", page->file.stream);
  cav_html_escape(page->file.stream, term);
  fputs("</dt><dd>", page->file.stream);
  va_start(list, format);
  put(page, format, list);
  va_end(list);
  fputs("</dd>\n", page->file.stream);
}

void cav_html_link(cav_html *page, const char *name, const char *text) {
  assert(*name && name[strspn(name, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.")] == 0);
  cav_html_close(page);
  fprintf(page->file.stream, "<p><a href=\"%s\">%s</a>: ", name, name);
  cav_html_escape(page->file.stream, text);
  fputs("</p>\n", page->file.stream);
}

void cav_html_provenance(cav_html *page, const cav_provenance *provenance) {
  char *build = NULL;
  size_t size;
  FILE *text = open_memstream(&build, &size);
  if (text) {
    cav_provenance_print_build(text);
    if (fclose(text) != 0) page->status = CAV_NO_MEMORY;
  }
  if (!text || !build) page->status = CAV_NO_MEMORY;
  cav_html_entry(page, "command", "%s", provenance->arguments);
  for (char *line = build; line && *line;) {
    size_t n = strcspn(line, "\n"), word = strcspn(line, " ");
    char term[32];
    snprintf(term, sizeof term, "%.*s", (int)word, line);
    cav_html_entry(page, term, "%.*s", (int)(n - word), line + word);
    line += n + (line[n] == '\n');
  }
  free(build);
  cav_html_entry(page, "machine", "%s", provenance->machine);
  cav_html_entry(page, "date", "%s", provenance->date);
  if (*provenance->problem) cav_html_entry(page, "SHA-256 of the problem", "%s", provenance->problem);
  if (*provenance->model) cav_html_entry(page, "SHA-256 of the model", "%s", provenance->model);
}

void cav_html_number_text(double value, int digits, char text[CAV_HTML_NUMBER]) {
  if (!isfinite(value)) {
    snprintf(text, CAV_HTML_NUMBER, "failed");
    return;
  }
  assert(digits > 0 && digits < 18);
  snprintf(text, CAV_HTML_NUMBER, "%.*g", digits, value == 0 ? 0.0 : value);
  // e-07 is written e-7
  char *e = strchr(text, 'e');
  if (!e) return;
  snprintf(e + 1, CAV_HTML_NUMBER - (size_t)(e + 1 - text), "%d", atoi(e + 1));
}

// --- tables ---

void cav_html_table(cav_html *page, const char *caption, int ncolumn, const char *const *heading) {
  FILE *out = page->file.stream;
  cav_html_close(page);
  assert(ncolumn > 0);
  fputs("<div class=\"scroll\"><table>", out);
  if (caption) {
    fputs("<caption>", out);
    cav_html_escape(out, caption);
    fputs("</caption>", out);
  }
  fputs("<thead><tr>", out);
  for (int i = 0; i < ncolumn; i++) {
    fputs("<th>", out);
    cav_html_escape(out, heading[i]);
    fputs("</th>", out);
  }
  fputs("</tr></thead><tbody>\n", out);
  page->open = CAV_HTML_TABLE;
  page->ncolumn = ncolumn;
  page->column = page->marked = 0;
}

void cav_html_mark(cav_html *page) {
  assert(page->open == CAV_HTML_TABLE && page->column == 0);
  page->marked = 1;
}

static void begin_cell(cav_html *page, const char *kind) {
  assert(page->open == CAV_HTML_TABLE);
  if (page->column == 0) fputs(page->marked ? "<tr class=\"mark\">" : "<tr>", page->file.stream);
  fprintf(page->file.stream, *kind ? "<td class=\"%s\">" : "<td>", kind);
}

static void end_cell(cav_html *page) {
  fputs("</td>", page->file.stream);
  if (++page->column < page->ncolumn) return;
  fputs("</tr>\n", page->file.stream);
  page->column = page->marked = 0;
}

void cav_html_cell(cav_html *page, const char *format, ...) {
  va_list list;
  begin_cell(page, "");
  va_start(list, format);
  put(page, format, list);
  va_end(list);
  end_cell(page);
}

void cav_html_number(cav_html *page, double value, int digits) {
  char text[CAV_HTML_NUMBER];
  cav_html_number_text(value, digits, text);
  begin_cell(page, isfinite(value) ? "n" : "n bad");
  fputs(text, page->file.stream);
  end_cell(page);
}

// --- maps ---

// a cell's colour: green, yellow, red by where the value stands between good and bad
static void begin_colour(FILE *out, const cav_html_map *map, double value) {
  if (isfinite(value) && value < 0) {
    fputs("<td class=\"none\">", out);
  } else if (!isfinite(value)) {
    fputs("<td class=\"failed\">", out);
  } else {
    double s = value > 0 ? (log(value) - log(map->good)) / (log(map->bad) - log(map->good)) : 0;
    s = fmin(fmax(s, 0), 1);
    fprintf(out, "<td style=\"background:hsl(%.0f,70%%,%.0f%%)\">", 130 * (1 - s), 68 + 8 * (1 - fabs(2 * s - 1)));
  }
}

void cav_html_colours(cav_html *page, const cav_html_map *map) {
  FILE *out = page->file.stream;
  cav_html_close(page);
  assert(map->good > 0 && map->good < map->bad && isfinite(map->bad));
  fputs("<div class=\"scroll map\"><table><caption>", out);
  cav_html_escape(out, map->title);
  fputs("</caption><thead><tr><th>", out);
  cav_html_escape(out, map->corner);
  for (int k = 0; k < map->ncolumn; k++) {
    fputs("</th><th>", out);
    cav_html_escape(out, map->column[k]);
  }
  fputs("</th></tr></thead><tbody>\n", out);
  for (int i = 0; i < map->nrow; i++) {
    fputs("<tr><th>", out);
    cav_html_escape(out, map->row[i]);
    fputs("</th>", out);
    for (int k = 0; k < map->ncolumn; k++) {
      int j = i * map->ncolumn + k;
      char text[CAV_HTML_NUMBER] = "";
      if (!(map->value[j] < 0)) cav_html_number_text(map->value[j], 2, text);
      begin_colour(out, map, map->value[j]);
      cav_html_escape(out, map->text && map->text[j] ? map->text[j] : text);
      fputs("</td>", out);
    }
    fputs("</tr>\n", out);
  }
  fputs("</tbody></table></div>\n", out);
}
