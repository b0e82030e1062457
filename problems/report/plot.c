/// Plots of a report's page as inline SVG, drawn for the width of a phone so that their text can be read there. Axes end
/// at round numbers: 1, 2 or 5 times a power of ten, on long logarithmic axes powers of ten alone. Points that an axis
/// cannot hold stand in strips of their own: 0 of a logarithmic axis, and failures along the top.
#include <assert.h>
#include <math.h>
#include <string.h>

#include "html.h"

enum {
  WIDTH = 460,
  HEIGHT = 320,
  LEFT = 58,
  RIGHT = 14,
  TOP = 26,
  BOTTOM = 42,
  STRIP = 30,
  SIDE_STRIP = 46,
  TICKS = 32
};

// from numbers to places: lower and upper are logarithms where the axis is logarithmic
typedef struct axis {
  int logarithmic, zero, failed; ///< whether it has strips
  double lower, upper;
  double first, last; ///< places of lower and upper
  int ntick;
  double tick[TICKS]; ///< values
} axis;

// what a plot tells apart: beyond, differences and powers of ten would overflow
static double clamp(const axis *a, double value) {
  if (a->logarithmic && value > 0) return fmin(fmax(value, 1e-300), 1e300);
  return fmin(fmax(value, -1e300), 1e300);
}

static double place(const axis *a, double value) {
  value = clamp(a, value);
  if (a->logarithmic && !(value > 0)) return a->first + (a->first < a->last ? -0.5 * SIDE_STRIP : 0.5 * STRIP);
  double s = ((a->logarithmic ? log10(value) : value) - a->lower) / (a->upper - a->lower);
  return a->first + s * (a->last - a->first);
}

// range of what an axis can show
static void find_range(axis *a, const cav_html_plot *plot, int horizontal) {
  double least = INFINITY, most = -INFINITY;
  for (int s = 0; s < plot->nseries; s++) {
    const cav_html_series *series = &plot->series[s];
    for (int i = 0; i < series->n; i++) {
      double x = series->x[i], y = series->y[i], value = horizontal ? x : y;
      if (!isfinite(x)) continue;
      a->failed |= !horizontal && !isfinite(y);
      if (!isfinite(value)) continue;
      a->zero |= a->logarithmic && !(value > 0);
      if (a->logarithmic && !(value > 0)) continue;
      least = fmin(least, clamp(a, value));
      most = fmax(most, clamp(a, value));
    }
  }
  a->lower = least;
  a->upper = most;
}

// ends and ticks at 1, 2, 5 times powers of ten
static void round_logarithmic(axis *a) {
  static const double mantissa[] = {1, 2, 5};
  int first = (int)floor(log10(a->lower) + 1e-9), last = (int)ceil(log10(a->upper) - 1e-9);
  int fine = last - first <= 2, every = 1 + (last - first) / 9;
  double lower = pow(10, first), upper = pow(10, last > first ? last : first + 1);
  for (int k = 0; fine && k < 3; k++)
    if (mantissa[k] * pow(10, first) <= a->lower * (1 + 1e-9)) lower = mantissa[k] * pow(10, first);
  for (int k = 2; fine && k >= 0; k--)
    if (mantissa[k] * pow(10, last - 1) >= a->upper * (1 - 1e-9)) upper = mantissa[k] * pow(10, last - 1);
  if (upper <= lower * (1 + 1e-9)) upper = 10 * lower;
  for (int n = first; n <= last + 1; n++) {
    for (int k = 0; k < (fine ? 3 : 1); k++) {
      double value = mantissa[k] * pow(10, n);
      if (value < lower * (1 - 1e-9) || value > upper * (1 + 1e-9) || (n - first) % every || a->ntick == TICKS)
        continue;
      a->tick[a->ntick++] = value;
    }
  }
  a->lower = log10(lower);
  a->upper = log10(upper);
}

static void round_linear(axis *a) {
  double span = a->upper - a->lower;
  if (!(span > 0)) span = a->upper != 0 ? fabs(a->upper) : 1;
  double step = pow(10, floor(log10(span / 4)));
  step *= span / 4 / step >= 5 ? 5 : span / 4 / step >= 2 ? 2 : 1;
  a->lower = step * floor(a->lower / step + 1e-9);
  a->upper = step * ceil(a->upper / step - 1e-9);
  if (a->upper <= a->lower) a->upper = a->lower + step;
  for (int i = 0; a->lower + i * step <= a->upper + 1e-6 * step && i < TICKS; i++) {
    double value = a->lower + i * step;
    a->tick[a->ntick++] = fabs(value) < 1e-9 * step ? 0 : value;
  }
}

// 1 if there is anything to show on the axis
static int axis_of(axis *a, const cav_html_plot *plot, int horizontal) {
  *a = (axis){.logarithmic = horizontal ? plot->log_x : plot->log_y};
  find_range(a, plot, horizontal);
  if (a->lower > a->upper && (a->zero || a->failed)) a->lower = a->upper = 1;
  if (a->lower > a->upper) return 0;
  if (a->logarithmic)
    round_logarithmic(a);
  else
    round_linear(a);
  if (horizontal) {
    a->first = LEFT + (a->zero ? SIDE_STRIP : 0);
    a->last = WIDTH - RIGHT;
  } else {
    a->first = HEIGHT - BOTTOM - (a->zero ? STRIP : 0);
    a->last = TOP + (a->failed ? STRIP : 0);
  }
  return 1;
}

// 10⁻⁵, 2·10⁶, 0.01
static void tick_text(FILE *out, const axis *a, double value) {
  static const char *const raised[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  int n = value != 0 ? (int)floor(log10(fabs(value)) + 1e-9) : 0;
  if (!a->logarithmic || (n >= -2 && n <= 3)) {
    char text[CAV_HTML_NUMBER];
    cav_html_number_text(value, 4, text);
    fputs(text, out);
    return;
  }
  int mantissa = (int)lround(value / pow(10, n)), digits[4], count = 0;
  if (mantissa != 1) fprintf(out, "%d·", mantissa);
  fputs(n < 0 ? "10⁻" : "10", out);
  for (int k = n < 0 ? -n : n; k > 0; k /= 10) digits[count++] = k % 10;
  while (count > 0) fputs(raised[digits[--count]], out);
}

static void draw_axes(FILE *out, const axis *x, const axis *y, const cav_html_plot *plot) {
  int left = LEFT, right = WIDTH - RIGHT, top = TOP, bottom = HEIGHT - BOTTOM;
  for (int i = 0; i < x->ntick; i++) {
    double at = place(x, x->tick[i]);
    fprintf(out, "<path class=\"grid\" stroke=\"currentColor\" d=\"M%.1f %dV%d\"/>", at, top, bottom);
    fprintf(out, "<text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">", at, bottom + 16);
    tick_text(out, x, x->tick[i]);
    fputs("</text>\n", out);
  }
  for (int i = 0; i < y->ntick; i++) {
    double at = place(y, y->tick[i]);
    fprintf(out, "<path class=\"grid\" stroke=\"currentColor\" d=\"M%d %.1fH%d\"/>", left, at, right);
    fprintf(out, "<text x=\"%d\" y=\"%.1f\" text-anchor=\"end\">", left - 5, at + 4);
    tick_text(out, y, y->tick[i]);
    fputs("</text>\n", out);
  }
  if (x->zero) fprintf(out, "<text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">0</text>\n", place(x, 0), bottom + 16);
  if (y->zero) fprintf(out, "<text x=\"%d\" y=\"%.1f\" text-anchor=\"end\">0</text>\n", left - 5, place(y, 0) + 4);
  if (y->failed) fprintf(out, "<text x=\"%d\" y=\"%d\" text-anchor=\"end\">failed</text>\n", left - 5, TOP + 19);
  fprintf(out, "<path stroke=\"currentColor\" fill=\"none\" d=\"M%d %dV%dH%d\"/>\n", left, top, bottom, right);
  fprintf(out, "<text x=\"%d\" y=\"%d\" text-anchor=\"end\">", right, HEIGHT - 6);
  cav_html_escape(out, plot->x);
  fputs("</text>\n<text x=\"2\" y=\"13\">", out);
  cav_html_escape(out, plot->y);
  fputs("</text>\n", out);
}

// a marker about (x, y), filled where it is marked; colours and shapes go with the number of the series
static void draw_marker(FILE *out, int series, double x, double y, int marked) {
  const char *fill = marked ? "currentColor" : "none";
  double r = marked ? 5 : 3.5;
  switch (series % 4) {
    case 0:
      fprintf(out,
              "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\" fill=\"%s\" stroke=\"currentColor\" stroke-width=\"1.5\">", x,
              y, r, fill);
      return;
    case 1:
      fprintf(out, "<path d=\"M%.1f %.1fh%.1fv%.1fh%.1fz\"", x - r, y - r, 2 * r, 2 * r, -2 * r);
      break;
    case 2:
      fprintf(out, "<path d=\"M%.1f %.1fl%.1f %.1fh%.1fz\"", x, y - 1.2 * r, 1.1 * r, 2 * r, -2.2 * r);
      break;
    default:
      fprintf(out, "<path d=\"M%.1f %.1fl%.1f %.1fl%.1f %.1fl%.1f %.1fz\"", x, y - 1.3 * r, 1.3 * r, 1.3 * r, -1.3 * r,
              1.3 * r, -1.3 * r, -1.3 * r);
  }
  fprintf(out, " fill=\"%s\" stroke=\"currentColor\" stroke-width=\"1.5\">", fill);
}

static void end_marker(FILE *out, int series) { fputs(series % 4 == 0 ? "</circle>\n" : "</path>\n", out); }

// what a point says when it is pointed at
static void draw_title(FILE *out, const cav_html_series *series, int i) {
  char x[CAV_HTML_NUMBER], y[CAV_HTML_NUMBER];
  cav_html_number_text(series->x[i], 3, x);
  cav_html_number_text(series->y[i], 3, y);
  fputs("<title>", out);
  cav_html_escape(out, series->name);
  if (series->label && series->label[i]) {
    fputs(", ", out);
    cav_html_escape(out, series->label[i]);
  }
  fprintf(out, ": %s, %s</title>", x, y);
}

static void draw_series(FILE *out, const axis *x, const axis *y, const cav_html_series *series, int number) {
  fprintf(out, "<g class=\"c%d\">\n", number % 8);
  // the line is broken where a point failed
  if (series->kind != CAV_HTML_POINTS) {
    int drawn = 0;
    for (int i = 0, joined = 0; i < series->n; i++) {
      int holds = isfinite(series->x[i]) && isfinite(series->y[i]);
      if (holds && !drawn) fputs("<path fill=\"none\" stroke=\"currentColor\" d=\"", out);
      if (holds) fprintf(out, "%c%.1f %.1f", joined ? 'L' : 'M', place(x, series->x[i]), place(y, series->y[i]));
      drawn |= holds;
      joined = holds;
    }
    if (drawn)
      fputs(series->kind == CAV_HTML_GUIDE ? "\" stroke-dasharray=\"5 4\"/>\n" : "\" stroke-width=\"1.3\"/>\n", out);
  }
  const int has_points = series->kind == CAV_HTML_LINE || series->kind == CAV_HTML_POINTS;
  for (int i = 0; has_points && i < series->n; i++) {
    if (!isfinite(series->x[i])) continue;
    double at = place(x, series->x[i]);
    if (isfinite(series->y[i])) {
      draw_marker(out, number, at, place(y, series->y[i]), series->marked && series->marked[i]);
      draw_title(out, series, i);
      end_marker(out, number);
    } else {
      fprintf(out, "<path d=\"M%.1f %dl8 8m0 -8l-8 8\" fill=\"none\" stroke=\"currentColor\" stroke-width=\"2\">",
              at - 4, TOP + 11);
      draw_title(out, series, i);
      fputs("</path>\n", out);
    }
  }
  fputs("</g>\n", out);
}

// names and markers of the series
static void draw_key(FILE *out, const cav_html_plot *plot) {
  int any_marked = 0;
  fputs("<div class=\"key\">", out);
  for (int s = 0; s < plot->nseries; s++) {
    const cav_html_series *series = &plot->series[s];
    fprintf(out, "<span><svg class=\"c%d\" viewBox=\"0 0 18 14\">", s % 8);
    if (series->kind == CAV_HTML_GUIDE || series->kind == CAV_HTML_CURVE) {
      fprintf(out, "<path d=\"M0 7H18\" stroke=\"currentColor\"%s/>",
              series->kind == CAV_HTML_GUIDE ? " stroke-dasharray=\"5 3\"" : "");
    } else {
      draw_marker(out, s, 9, 7, 0);
      end_marker(out, s);
    }
    fputs("</svg>", out);
    cav_html_escape(out, series->name);
    fputs("</span>\n", out);
    for (int i = 0; series->marked && i < series->n; i++) any_marked |= series->marked[i];
  }
  if (any_marked) fputs("<span>filled: of the Pareto set</span>", out);
  fputs("</div>", out);
}

static void draw(FILE *out, const cav_html_plot *plot) {
  axis x, y;
  fputs("<figure><figcaption>", out);
  cav_html_escape(out, plot->title);
  fputs("</figcaption>", out);
  if (!axis_of(&x, plot, 1) || !axis_of(&y, plot, 0)) {
    fputs("<p>Nothing could be measured.</p></figure>\n", out);
    return;
  }
  draw_key(out, plot);
  fprintf(out, "<svg viewBox=\"0 0 %d %d\" role=\"img\"><title>", WIDTH, HEIGHT);
  cav_html_escape(out, plot->title);
  fputs("</title>\n", out);
  draw_axes(out, &x, &y, plot);
  for (int s = 0; s < plot->nseries; s++) draw_series(out, &x, &y, &plot->series[s], s);
  fputs("</svg></figure>\n", out);
}

void cav_html_plots(cav_html *page, int n, const cav_html_plot *plot) {
  cav_html_close(page);
  fputs("<div class=\"plots\">\n", page->file.stream);
  for (int i = 0; i < n; i++) draw(page->file.stream, &plot[i]);
  fputs("</div>\n", page->file.stream);
}

void cav_html_pareto(int n, const double *x, const double *y, int *marked) {
  for (int i = 0; i < n; i++) {
    marked[i] = isfinite(x[i]) && isfinite(y[i]);
    for (int k = 0; k < n && marked[i]; k++)
      if (x[k] <= x[i] && y[k] <= y[i] && (x[k] < x[i] || y[k] < y[i])) marked[i] = 0;
  }
}
