// What bears: contact forces by pair of links, as one force at its centre of pressure, and when it touches. A row of
// motion.forces holds for each contact its position, force and normal, friction, and the links that it presses from and on.

const FORCE = 12;  // numbers of one contact

// contacts of one knot by pair: what moves bears on what stands
function gather(row) {
  const pairs = new Map();
  for (let i = 0; i < row.length; i += FORCE) {
    const [from, on] = [row[i + 10], row[i + 11]], sign = on === 0 ? -1 : 1;
    const key = on === 0 ? `${from}|0` : `${on}|${from}`;
    let pair = pairs.get(key);
    if (!pair) pairs.set(key, pair = {key, force: [0, 0, 0], centre: [0, 0, 0], normal: [0, 0, 0], press: 0});
    let press = 0;
    for (let k = 0; k < 3; k++) {
      pair.force[k] += sign * row[i + 3 + k];
      press += row[i + 3 + k] * row[i + 6 + k];
    }
    for (let k = 0; k < 3; k++) {
      pair.centre[k] += press * row[i + k];
      pair.normal[k] += sign * press * row[i + 6 + k];
    }
    pair.press += press;
  }
  for (const pair of pairs.values())
    for (let k = 0; k < 3; k++) pair.centre[k] /= pair.press || 1;
  return pairs;
}

const pair_name = (shown, key) => {
  const [on, from] = key.split('|').map(link => shown.links[link].name || `link ${link}`);
  return key.endsWith('|0') ? on : `${on} \u2013 ${from}`;
};

// of each motion: pairs at every knot, and those that bear most, named
for (const shown of motions) {
  shown.bearing = (shown.forces || []).map(gather);
  const sum = new Map();
  for (const pairs of shown.bearing)
    for (const {key, press} of pairs.values()) sum.set(key, (sum.get(key) || 0) + press);
  const most = Math.max(0, ...sum.values());
  const least = Math.max(0.01 * (shown.weight || 0), 1e-9);  // a hundredth of the weight touches
  shown.bears = [...sum].filter(([, all]) => all > 0.005 * most).sort((a, b) => b[1] - a[1]).slice(0, 12).map(([key]) => {
    const value = shown.bearing.map(pairs => pairs.has(key) ? pairs.get(key) : null);
    return {key, name: pair_name(shown, key), value, touches: value.map(pair => pair !== null && pair.press > least)};
  }).filter(row => row.touches.includes(true)).sort((a, b) => a.name < b.name ? -1 : 1);
  shown.strongest = Math.max(0, ...shown.bears.map(row => Math.max(...row.value.map(pair => pair ? pair.press : 0))));

  // its charts: force, and centre of pressure where it presses on what stands
  const chart = (name, unit, value) => shown.series.push({group: 'Contacts', name, unit, lower: null, upper: null, wanted: null, value});
  for (const row of shown.bears) {
    chart(`${row.name}, force`, 'N', row.value.map(pair => pair ? Math.hypot(...pair.force) : 0));
    if (!row.key.endsWith('|0')) continue;
    for (const [k, axis] of ['x', 'y'].entries())
      chart(`${row.name}, centre of pressure`, `m, ${axis}`, row.value.map((pair, i) => row.touches[i] ? pair.centre[k] : null));
  }
}

// --- the bars of contact below the time ---

const bars = [];

function draw_bar({canvas, shown, row, ink}) {
  const width = canvas.clientWidth, height = canvas.clientHeight, scale = devicePixelRatio || 1;
  if (!width) return;
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  const pen = canvas.getContext('2d'), css = getComputedStyle(document.body), x = knot => knot * shown.timestep / duration * width;
  pen.scale(scale, scale);
  pen.fillStyle = css.getPropertyValue('--soft').trim();
  pen.fillRect(0, 0, width, height);
  pen.fillStyle = css.getPropertyValue(ink).trim();
  row.touches.forEach((touches, knot) => {
    if (!touches) return;
    const edge = half => Math.round(clamp(x(knot + half), 0, width) * scale) / scale, from = edge(-0.5), to = edge(0.5);
    pen.globalAlpha = 0.3 + 0.7 * Math.min(row.value[knot].press / shown.strongest, 1);
    pen.fillRect(from, 0, to - from, height);
  });
}

// when it touches, in words
function spans(shown, row) {
  const said = [];
  for (let knot = 0; knot < row.touches.length; knot++) {
    if (!row.touches[knot]) continue;
    const from = knot;
    while (knot + 1 < row.touches.length && row.touches[knot + 1]) knot++;
    said.push(`${(from * shown.timestep).toFixed(2)} to ${(knot * shown.timestep).toFixed(2)} s`);
  }
  return said.join(', ');
}

function make_bars() {
  const names = [...new Set(motions.flatMap(shown => shown.bears.map(row => row.name)))];
  for (const name of names) {
    let first = true;
    for (const [i, shown] of motions.entries()) {
      const row = shown.bears.find(other => other.name === name);
      if (!row) continue;
      const label = node('label', first ? name : ''), canvas = node('canvas');
      label.title = name;
      first = false;
      canvas.setAttribute('role', 'img');
      canvas.setAttribute('aria-label', `${name}${both ? ` of ${shown.label}` : ''} bears from ${spans(shown, row)}`);
      canvas.title = `${name}${both ? ` of ${shown.label}` : ''}: ${spans(shown, row)}`;
      canvas.onpointerdown = canvas.onpointermove = event => {
        if (!event.buttons) return;
        const box = canvas.getBoundingClientRect();
        clock.play(false);
        clock.set(duration * (event.clientX - box.left) / box.width);
      };
      by('track').append(label, canvas);
      bars.push({canvas, shown, row, ink: i ? '--second' : '--accent'});
    }
  }
}
if (duration > 0) make_bars();
