// Hands on the page: pointer and keys on the scene, switches, the list of bodies, the address.

const hidden = new Set();  // names of bodies
let pointed = null;  // body under the pointer

// --- bodies ---

function show_bodies() {
  for (const actor of actors)
    for (const mesh of actor.solids)
      mesh.visible = !hidden.has(mesh.userData.body) && !(actor.index && mesh.parent === actor.links[0] && !pressed('beside'));
  for (const box of document.querySelectorAll('#bodies input')) box.checked = !hidden.has(box.value);
  const all = by('show');
  if (all) all.hidden = hidden.size === 0;
  stale = true;
}

function hide_body(name, on = true) {
  if (on) hidden.add(name);
  else hidden.delete(name);
  show_bodies();
}

// the body's paint glows
function point_at(body) {
  if (body === pointed) return;
  pointed = body;
  for (const actor of actors)
    for (const mesh of actor.solids) mesh.material.emissive.setHex(body !== null && mesh.userData.body === body ? 0x2a3a55 : 0);
  stale = true;
}

function list_bodies() {
  const names = [...new Set(actors.flatMap(actor => actor.solids.map(mesh => mesh.userData.body)))].filter(Boolean);
  if (names.length < 2) return;
  const group = node('details'), title = node('summary', 'Bodies'), list = node('ul');
  group.id = 'bodies';
  title.append(node('small', ` ${names.length}`));
  for (const name of names) {
    const item = node('li'), label = node('label'), box = node('input');
    box.type = 'checkbox';
    box.checked = true;
    box.value = name;
    box.onchange = () => hide_body(name, !box.checked);
    label.append(box, name);
    item.append(label);
    item.onpointerenter = () => point_at(name);
    item.onpointerleave = () => point_at(null);
    list.append(item);
  }
  const all = node('button', 'Show all', 'chip');
  all.id = 'show';
  all.hidden = true;
  all.onclick = () => { hidden.clear(); show_bodies(); };
  group.append(title, list, all);
  by('side').append(group);
}
list_bodies();
if (!by('side').firstElementChild) document.body.classList.add('bare');

// --- the pointer ---

function listen(canvas) {
  const pointers = new Map();
  const ray = new THREE.Raycaster(), at = new THREE.Vector2();
  const hit = event => {
    const box = canvas.getBoundingClientRect();
    at.set(2 * (event.clientX - box.left) / box.width - 1, 1 - 2 * (event.clientY - box.top) / box.height);
    ray.setFromCamera(at, camera);
    const seen = actors.flatMap(actor => actor.solids).filter(mesh => mesh.visible);
    return ray.intersectObjects(targets.visible ? targets.children : [])[0] || ray.intersectObjects(seen)[0];
  };
  canvas.addEventListener('pointerdown', event => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, {x: event.clientX, y: event.clientY, far: 0});
    by('tip').hidden = true;
  });
  canvas.addEventListener('pointermove', event => {
    const old = pointers.get(event.pointerId);
    if (!old) { if (event.pointerType === 'mouse') name_at(event, hit(event)); return; }
    const dx = event.clientX - old.x, dy = event.clientY - old.y;
    old.far += Math.abs(dx) + Math.abs(dy);
    if (pointers.size === 2) {
      // two fingers: apart is nearer, together is a shift
      const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
      const before = Math.hypot(old.x - other.x, old.y - other.y);
      const after = Math.hypot(event.clientX - other.x, event.clientY - other.y);
      if (before > 0 && after > 0) zoom(before / after);
      shift(dx / 2, dy / 2);
    } else if (event.shiftKey || event.buttons & 6) {
      shift(dx, dy);
    } else {
      turn(dx, dy);
    }
    old.x = event.clientX;
    old.y = event.clientY;
    stale = true;
  });
  canvas.addEventListener('pointerup', event => {
    const old = pointers.get(event.pointerId);
    // a tap names what it is on
    if (old && old.far < 6) name_at(event, hit(event));
  });
  for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, event => pointers.delete(event.pointerId));
  canvas.addEventListener('pointerleave', () => { by('tip').hidden = true; point_at(null); });
  canvas.addEventListener('contextmenu', event => event.preventDefault());
  canvas.addEventListener('wheel', event => {
    event.preventDefault();
    zoom(Math.exp(clamp(event.deltaY * (event.deltaMode === 1 ? 20 : 1), -200, 200) * 0.0015));
    stale = true;
  }, {passive: false});
  // on a body: look there; beside it: back to where it began
  canvas.addEventListener('dblclick', event => {
    const found = hit(event);
    anchor();
    orbit.aside.set(0, 0, 0);
    if (found) orbit.aside.copy(found.point).sub(orbit.anchor);
    else orbit.distance = fit;
    stale = true;
  });
}

function name_at(event, found) {
  const told = found && found.object.userData, box = by('stage').getBoundingClientRect();
  const whose = told && told.actor && both ? `${told.actor.shown.label}: ` : '';
  by('tip').hidden = !(told && told.name);
  point_at(told && told.body || null);
  if (by('tip').hidden) return;
  by('tip').textContent = whose + told.name;
  by('tip').style.left = `${Math.min(event.clientX - box.left + 14, box.width - by('tip').offsetWidth - 6)}px`;
  by('tip').style.top = `${Math.max(event.clientY - box.top - 30, 4)}px`;
}

// --- switches ---

const toggle = (id, act) => by(id).addEventListener('click', () => {
  const on = !pressed(id);
  by(id).setAttribute('aria-pressed', on);
  if (act) act(on);
  stale = true;
});
toggle('follow', on => { if (on) orbit.aside.set(0, 0, 0); });
for (const id of ['forces', 'contacts', 'cones']) {
  toggle(id);
  by(id).hidden = !motions.some(shown => shown.forces && shown.forces.some(row => row.length));
}
toggle('path', on => { for (const {group} of trails) group.visible = on; });
toggle('goal', on => { ghost.visible = on; });
toggle('targets', on => { targets.visible = on; });
toggle('beside', on => { set_beside(on); show_bodies(); });
by('beside').hidden = !both;
by('goal').hidden = !motion.goal || both;
by('targets').hidden = !motion.targets.length;
for (const name in presets) by(name).onclick = () => see_from(name);
by('help').onclick = () => by('keyboard').showModal();
if (!(duration > 0) || !film.format()) by('film').hidden = true;

// --- keys ---

const press = id => () => { if (!by(id).hidden) by(id).click(); };
const keys = {
  ' ': () => clock.play(!clock.playing), ArrowLeft: () => clock.step(-1), ArrowRight: () => clock.step(1),
  Home: () => clock.set(0), End: () => clock.set(duration),
  1: press('oblique'), 2: press('front'), 3: press('side-view'), 4: press('top'), f: press('follow'), c: press('forces'),
  x: press('contacts'), k: press('cones'), t: press('targets'), p: press('path'), g: press('goal'), b: press('beside'),
  s: press('picture'), v: press('film'), '?': press('help'),
  h: () => { if (pointed) hide_body(pointed); }, a: () => { hidden.clear(); show_bodies(); },
  '+': () => { zoom(1 / 1.15); stale = true; }, '-': () => { zoom(1.15); stale = true; },
};
const turns = {ArrowLeft: [-30, 0], ArrowRight: [30, 0], ArrowUp: [0, 20], ArrowDown: [0, -20]};
addEventListener('keydown', event => {
  if (event.ctrlKey || event.metaKey || event.altKey || by('keyboard').open) return;
  const tag = event.target.tagName, arrow = event.shiftKey && turns[event.key];
  const act = arrow ? () => { turn(...arrow); stale = true; } : keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!act) return;
  if (event.key === ' ' && (/^(BUTTON|SUMMARY)$/.test(tag) || event.target.type === 'checkbox')) return;
  if (tag === 'INPUT' && event.key.length > 1 && event.target.id !== 'time') return;
  event.preventDefault();
  act();
});

// --- the address: a time, a place to look from, the scene alone ---

function read_address() {
  const asked = new URLSearchParams(location.hash.slice(1)), time = parseFloat(asked.get('t'));
  const seen = (asked.get('view') || '').split(',').map(Number);
  if (seen.length === 3 && seen.every(Number.isFinite)) {
    orbit.azimuth = seen[0];
    orbit.elevation = clamp(seen[1], -89, 89);
    orbit.distance = clamp(seen[2], 0.2 * extent.size, 14 * fit);
    mark_preset();
    stale = true;
  }
  const bare = asked.has('bare');
  if (bare !== document.body.classList.contains('picture')) {
    document.body.classList.toggle('picture', bare);
    if (renderer) quality.apply();
  }
  if (Number.isFinite(time)) {
    clock.play(false);
    clock.set(time);
  }
}

watchers.push(() => { stale = true; });
start_renderer();
if (renderer) renderer.domElement.setAttribute('aria-label', `3D view of ${motions.map(named).join(' and ')}`);
apply_theme();
dark.addEventListener('change', () => { apply_theme(); stale = true; });
new ResizeObserver(resize).observe(by('stage'));
for (const actor of actors) pose(actor, {knot: 0, part: 0, next: 0});
middle_of_motions();
anchor();
clock.set(0);
clock.play(clock.playing);
mark_preset();
read_address();
addEventListener('hashchange', read_address);
requestAnimationFrame(now => { then = now; frame(now); });
