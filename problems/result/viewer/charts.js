// Charts: a line of each motion over the time, limits, what was asked. A chart can be read and moved by keys: it is a slider
// whose text is the value.

const charts = [];
const COLOUR = ['--accent', '--second'];

// range of a chart: its values and zero when near; limits unless they would flatten the line
function chart_range(lines) {
  const finite = lines.flatMap(({series}) => series.value.concat(series.wanted || [])).filter(x => x !== null);
  let low = finite.length ? finite.reduce((a, b) => Math.min(a, b)) : 0;
  let high = finite.length ? finite.reduce((a, b) => Math.max(a, b)) : 0;
  if (low > 0 && low < high - low) low = 0;
  if (high < 0 && -high < high - low) high = 0;
  const span = Math.max(high - low, 1e-9 * Math.max(Math.abs(low), Math.abs(high)));
  const drawn = [...new Set(lines.flatMap(({series}) => [series.lower, series.upper]))].filter(
    x => x !== null && (x < low ? low - x : x > high ? x - high : 0) <= 5 * (span || Infinity));
  for (const x of drawn) { low = Math.min(low, x); high = Math.max(high, x); }
  const pad = (high - low || Math.abs(high) || 1) * 0.08;
  return {low: low - pad, high: high + pad, ends: high > low ? [high, low] : [high], drawn};
}

// the line, broken where a value is missing
function draw_line(pen, line, x_of, y_of) {
  pen.beginPath();
  line.series.value.forEach((value, knot) => {
    if (value === null) return;
    if (knot > 0 && line.series.value[knot - 1] !== null) pen.lineTo(x_of(knot), y_of(value));
    else pen.moveTo(x_of(knot), y_of(value));
  });
  pen.stroke();
}

// what was asked: a ring at a knot, a line over a window
function draw_wanted(pen, wanted, x_of, y_of, width) {
  wanted.forEach((value, knot) => {
    if (value === null) return;
    const x = x_of(knot), y = y_of(value), before = knot > 0 ? wanted[knot - 1] : null;
    const after = knot + 1 < wanted.length ? wanted[knot + 1] : null;
    pen.beginPath();
    if (before !== null) { pen.moveTo(x_of(knot - 1), y_of(before)); pen.lineTo(x, y); }
    else if (after === null) pen.arc(Math.min(Math.max(x, 5), width - 6), y, 4, 0, 2 * Math.PI);
    pen.stroke();
  });
}

function draw_chart(chart) {
  const {canvas, lines, range} = chart, scale = devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (!width) return;
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  const pen = canvas.getContext('2d'), css = getComputedStyle(document.body);
  const colour = name => css.getPropertyValue(name).trim();
  const x_of = shown => knot => duration ? knot * shown.timestep / duration * (width - 1) : width / 2;
  chart.y_of = value => height - (value - range.low) / (range.high - range.low) * height;
  pen.scale(scale, scale);

  // frame, zero, limits
  const rule = (value, ink, dash) => {
    pen.strokeStyle = ink;
    pen.setLineDash(dash);
    pen.lineWidth = 1;
    pen.beginPath();
    pen.moveTo(0, Math.round(chart.y_of(value)) + 0.5);
    pen.lineTo(width, Math.round(chart.y_of(value)) + 0.5);
    pen.stroke();
  };
  pen.fillStyle = colour('--soft');
  pen.fillRect(0, 0, width, height);
  if (range.low < 0 && range.high > 0) rule(0, colour('--line'), []);
  for (const limit of range.drawn) rule(limit, colour('--limit'), [4, 3]);

  pen.setLineDash([]);
  pen.lineWidth = 1.6;
  pen.lineJoin = 'round';
  for (const line of [...lines].reverse()) {
    pen.strokeStyle = colour(COLOUR[motions.indexOf(line.shown)]);
    draw_line(pen, line, x_of(line.shown), chart.y_of);
  }
  pen.strokeStyle = colour('--limit');
  for (const {shown, series} of lines)
    if (series.wanted) draw_wanted(pen, series.wanted, x_of(shown), chart.y_of, width);

  // ends of the scale
  pen.font = '10.5px system-ui, sans-serif';
  pen.fillStyle = colour('--muted');
  pen.strokeStyle = colour('--soft');
  pen.lineWidth = 3;
  range.ends.forEach((value, i) => {
    const place = [show_number(value), 4, chart.y_of(value) + (i === 0 ? 11 : -4)];
    pen.strokeText(...place);
    pen.fillText(...place);
  });
  move_cursor(chart, clock.time);
}

// value between two knots, null where either is missing
function value_at({shown, series}) {
  const {knot, part, next} = clock.place(shown);
  const a = series.value[knot], b = series.value[next];
  return part === 0 ? a : part === 1 ? b : a === null || b === null ? null : a + part * (b - a);
}

// "123", and of an effort its fraction of the limit: "123 N m, 64 %"
const share_of = ({series}, value) => {
  const limit = value > 0 ? series.upper : series.lower;
  return series.share && value !== null && limit ? `${Math.round(100 * value / limit)}\u00a0%` : '';
};

function move_cursor(chart, time) {
  if (!chart.y_of || !chart.group.open) return;
  const values = chart.lines.map(value_at), value = values[0];
  chart.cursor.style.transform = `translateX(${(duration ? time / duration : 0.5) * (chart.canvas.clientWidth - 1)}px)`;
  chart.cursor.classList.toggle('gap', value === null);
  if (value !== null) chart.cursor.style.setProperty('--y', `${chart.y_of(value)}px`);
  chart.outputs.forEach((output, i) => { output.textContent = show_number(values[i]); });
  chart.share.textContent = chart.lines.length === 1 && share_of(chart.lines[0], value) ? ` \u00b7 ${share_of(chart.lines[0], value)}` : '';
  chart.plot.setAttribute('aria-valuenow', time.toFixed(3));
  if (document.activeElement === chart.plot) say_value(chart, time);
}

function say_value(chart, time) {
  const said = chart.lines.map(line => {
    const value = value_at(line);
    return `${both ? line.shown.label + ' ' : ''}${show_number(value)} ${line.series.unit} ${share_of(line, value)}`.trim();
  });
  chart.plot.setAttribute('aria-valuetext', `${time.toFixed(2)} s: ${said.join(', ')}`);
}

// a chart in words: least, greatest, limits, what was asked
function describe({shown, series}) {
  const at = knot => `${(knot * shown.timestep).toFixed(2)} s`;
  let low = -1, high = -1;
  series.value.forEach((x, i) => {
    if (x === null) return;
    if (low < 0 || x < series.value[low]) low = i;
    if (high < 0 || x > series.value[high]) high = i;
  });
  if (low < 0) return 'no values';
  const said = [`least ${show_number(series.value[low])} at ${at(low)}`, `greatest ${show_number(series.value[high])} at ${at(high)}`];
  if (series.lower !== null || series.upper !== null) said.push(limits_of(series));
  const asked = (series.wanted || []).findIndex(x => x !== null);
  if (asked >= 0) said.push(`asked ${show_number(series.wanted[asked])} at ${at(asked)}`);
  return `${both ? shown.label + ': ' : ''}${said.join(', ')} ${series.unit}`;
}

const limits_of = series => 'limits ' + (series.lower === null ? `at most ${show_number(series.upper)}` :
  series.upper === null ? `at least ${show_number(series.lower)}` : `${show_number(series.lower)} to ${show_number(series.upper)}`);

function make_chart(lines, group) {
  const {series} = lines[0];
  const box = node('div', undefined, 'chart'), head = node('header'), told = node('span'), share = node('span');
  const plot = node('div', undefined, 'plot'), canvas = node('canvas'), cursor = node('i');
  const outputs = lines.map(() => node('output'));
  // values move with every frame: they are read out at the plot, when asked
  outputs.forEach(output => output.setAttribute('aria-live', 'off'));
  told.append(...outputs, series.unit ? ' ' + series.unit : '', share);
  if (series.lower !== null || series.upper !== null) plot.title = `${limits_of(series)} ${series.unit}`;
  head.append(node('b', series.name), told);
  plot.append(canvas, cursor);
  box.append(head, plot);
  group.append(box);
  const set = (name, value) => plot.setAttribute(name, value);
  const chart = {lines, canvas, cursor, outputs, share, group, plot, range: chart_range(lines)};
  plot.tabIndex = 0;
  set('role', 'slider');
  set('aria-label', `${series.name}${series.unit ? ', ' + series.unit : ''}`);
  set('aria-description', lines.map(describe).join('; '));
  set('aria-valuemin', 0);
  set('aria-valuemax', duration.toFixed(3));
  const seek = event => {
    const frame = plot.getBoundingClientRect();
    clock.play(false);
    clock.set(duration * (event.clientX - frame.left) / frame.width);
  };
  plot.onpointerdown = event => { plot.setPointerCapture(event.pointerId); seek(event); };
  plot.onpointermove = event => { if (event.buttons) seek(event); };
  plot.onfocus = () => say_value(chart, clock.time);
  charts.push(chart);
}

// lines of one chart: the same series of every motion
function make_charts() {
  const groups = new Map(), made = new Set();
  const key = series => `${series.group}\n${series.name}\n${series.unit}`;
  const count = name => new Set(motions.flatMap(shown => shown.series).filter(series => series.group === name).map(key)).size;
  const all = motions.reduce((sum, shown) => sum + shown.series.length, 0);
  for (const series of motions.flatMap(shown => shown.series)) {
    if (made.has(key(series))) continue;
    made.add(key(series));
    if (!groups.has(series.group)) {
      const group = node('details'), title = node('summary', series.group || 'Charts');
      title.append(node('small', ` ${count(series.group)}`));
      group.append(title);
      group.dataset.group = series.group;
      group.open = series.group === 'Asked' || groups.size === 0 || all <= 12;
      group.ontoggle = () => charts.filter(chart => chart.group === group).forEach(draw_chart);
      groups.set(series.group, group);
      by('side').append(group);
    }
    const lines = motions.map(shown => ({shown, series: shown.series.find(other => key(other) === key(series))}));
    make_chart(lines.filter(line => line.series), groups.get(series.group));
  }
  watchers.push(time => charts.forEach(chart => move_cursor(chart, time)));
}
make_charts();
