// The motions and the clock that all of the page follows.

const motions = JSON.parse(document.getElementById('motion').textContent);
const [motion, second] = motions;
const both = motions.length > 1;
const end_of = shown => (shown.nknot - 1) * shown.timestep;
const duration = Math.max(...motions.map(end_of));
const by = id => document.getElementById(id);
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const watchers = [];  // called with the time whenever it changes

const clock = {
  time: 0,
  playing: duration > 0 && !matchMedia('(prefers-reduced-motion: reduce)').matches,
  speed: 1,
  rest: 0,  // s left of the pause at the end before the motion starts again
  once: null,  // called at the end, in the place of the pause
  set(time) {
    this.time = clamp(time, 0, duration);
    for (const watcher of watchers) watcher(this.time);
  },
  // knot of a motion at or before the time, and how far towards the next
  place(shown) {
    const last = shown.nknot - 1, x = last > 0 ? Math.min(this.time / shown.timestep, last) : 0;
    const knot = Math.min(Math.floor(x + 1e-9), Math.max(last - 1, 0));
    return {knot, part: clamp(x - knot, 0, 1), next: Math.min(knot + 1, last)};
  },
  step(count) {
    this.play(false);
    this.set((Math.round(this.time / motion.timestep) + count) * motion.timestep);
  },
  play(on) {
    this.playing = on && duration > 0;
    this.rest = 0;
    if (this.playing && this.time >= duration) this.set(0);
    by('play').firstElementChild.firstElementChild.setAttribute('d',
      this.playing ? 'M6 5h4v14H6zM14 5h4v14h-4z' : 'M8 5v14l11-7z');
    by('play').setAttribute('aria-label', this.playing ? 'Pause' : 'Play');
  },
  tick(seconds) {
    if (!this.playing) return;
    if (this.rest > 0) {
      this.rest -= seconds;
      if (this.rest <= 0) this.set(0);
      return;
    }
    this.set(this.time + seconds * this.speed);
    if (this.time < duration) return;
    this.rest = 0.7;
    if (this.once) this.once();
  },
};

// a node with text, never markup: names come from files
function node(tag, text, kind) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  if (kind) made.className = kind;
  return made;
}

const show_number = x => x === null || x === undefined ? '\u2013' :
  (Math.abs(x) >= 1e5 || (x !== 0 && Math.abs(x) < 1e-3) ? x.toExponential(1) : String(+x.toPrecision(3))).replace('-', '\u2212');

// --- title, playback bar ---

const named = shown => shown.title || shown.model;
document.title = both ? `${motion.label} beside ${second.label}` : named(motion) || 'cavort';
by('title').querySelector('h1').textContent = both && named(motion) !== named(second) ?
  `${named(motion)} beside ${named(second)}` : named(motion);
if (both) {
  by('legend').hidden = false;
  for (const shown of motions)
    by('legend').append(node('span', `${shown.label} \u00b7 ${end_of(shown).toFixed(2)} s \u00b7 ${shown.nknot} knots`));
} else {
  by('title').querySelector('p').textContent = [!named(motion).includes(motion.model) && motion.model,
    duration > 0 && `${duration.toFixed(2)} s`, duration > 0 && `${motion.nknot} knots`].filter(Boolean).join(' \u00b7 ');
}
if (!(duration > 0)) by('bar').hidden = true;

by('play').onclick = () => clock.play(!clock.playing);
by('back').onclick = () => clock.step(-1);
by('next').onclick = () => clock.step(1);
by('time').max = duration || 1;
by('time').oninput = event => { clock.play(false); clock.set(+event.target.value); };
by('speed').oninput = event => {
  clock.speed = 2 ** +event.target.value;
  by('pace').querySelector('output').textContent = `${+clock.speed.toPrecision(2)}\u00d7`;
};
by('speed').oninput({target: by('speed')});

// the scrubber is written only when it differs, so that a finger on it is not fought
watchers.push(time => {
  if (Math.abs(+by('time').value - time) > 1e-6) by('time').value = time;
  by('time').setAttribute('aria-valuetext', `${time.toFixed(2)} s`);
  by('clock').replaceChildren(time.toFixed(2), node('span', ` / ${duration.toFixed(2)} s`));
});
