// What acts and what was asked, drawn into the scene: forces of every link that bears at its centre of pressure, of every
// contact, friction cones, targets, the path of the centre of mass.

const pressed = id => by(id).getAttribute('aria-pressed') === 'true';
const upright = new THREE.Vector3(0, 0, 1), along = new THREE.Vector3();

// a force of one weight is as long as half the model is large; without weight, the largest force is
const strongest = Math.max(0, ...motions.flatMap(shown => (shown.forces || []).map(row => {
  let most = 0;
  for (let i = 0; i < row.length; i += FORCE) most = Math.max(most, Math.hypot(row[i + 3], row[i + 4], row[i + 5]));
  return most;
})));
const metres = motion.weight > 0 ? extent.size / 2 / motion.weight : strongest > 0 ? extent.size / strongest : 0;

// drawn over the bodies they run through
const over = (colour, opacity) => new THREE.MeshBasicMaterial({color: paint_hex(colour), depthTest: false, transparent: true, opacity});
const ink = {link: over('#f26a0f', 0.95), contact: over('#f5b60a', 0.9), cone: over('#1fa463', 0.16), target: over('#d3541a', 0.95)};
ink.cone.side = THREE.DoubleSide;

const on_top = mesh => { mesh.renderOrder = 2; return mesh; };

function new_arrow(kind) {
  const wide = (kind === 'link' ? 0.014 : 0.008) * extent.size, arrow = new THREE.Group();
  const shaft = new THREE.CylinderGeometry(wide, wide, 1, 12).rotateX(Math.PI / 2).translate(0, 0, 0.5);
  const cone = new THREE.ConeGeometry(2.4 * wide, 6 * wide, 16).rotateX(Math.PI / 2).translate(0, 0, 3 * wide);
  arrow.shaft = on_top(new THREE.Mesh(shaft, ink[kind]));
  arrow.tip = on_top(new THREE.Mesh(cone, ink[kind]));
  arrow.head = 6 * wide;
  arrow.add(arrow.shaft, arrow.tip);
  return arrow;
}

const new_shape = {
  link: () => new_arrow('link'),
  contact: () => new_arrow('contact'),
  // about the centre of pressure
  ring: () => on_top(new THREE.Mesh(new THREE.TorusGeometry(0.034 * extent.size, 0.006 * extent.size, 8, 28), ink.link)),
  // one high, one wide, its point at the contact
  cone: () => on_top(new THREE.Mesh(new THREE.ConeGeometry(1, 1, 24, 1, true).rotateX(-Math.PI / 2).translate(0, 0, 0.5), ink.cone)),
};

// shapes of each kind that an actor has, used again at every time
function begin(actor) {
  actor.used = {};
  if (!actor.pool) actor.pool = {link: [], contact: [], ring: [], cone: []};
}
function take(actor, kind, at) {
  const pool = actor.pool[kind], i = actor.used[kind] = (actor.used[kind] || 0) + 1;
  if (!pool[i - 1]) {
    pool.push(new_shape[kind]());
    actor.root.add(pool[i - 1]);
  }
  pool[i - 1].visible = true;
  pool[i - 1].position.set(...at);
  return pool[i - 1];
}
function finish(actor) {
  for (const kind in actor.pool)
    actor.pool[kind].forEach((shape, i) => { if (i >= (actor.used[kind] || 0)) shape.visible = false; });
}

function draw_arrow(actor, kind, at, force) {
  along.set(...force);
  const length = along.length() * metres;
  if (!(length > 0.004 * extent.size)) return;
  const arrow = take(actor, kind, at), head = Math.min(arrow.head, 0.6 * length);
  arrow.quaternion.setFromUnitVectors(upright, along.normalize());
  arrow.shaft.scale.set(1, 1, Math.max(length - head, 1e-6));
  arrow.tip.scale.setScalar(head / arrow.head);
  arrow.tip.position.z = length - head;
}

function draw_contacts(actor, row, cones, arrows) {
  for (let i = 0; i < row.length; i += FORCE) {
    const sign = row[i + 11] === 0 ? -1 : 1, at = row.slice(i, i + 3), mu = row[i + 9];
    const force = [0, 1, 2].map(k => sign * row[i + 3 + k]), normal = [0, 1, 2].map(k => sign * row[i + 6 + k]);
    if (arrows) draw_arrow(actor, 'contact', at, force);
    // as high as the normal force is long: the force ends on its rim where the contact is about to slide
    const high = metres * force.reduce((sum, x, k) => sum + x * normal[k], 0);
    if (!cones || !(mu > 0) || !(high > 0.004 * extent.size)) continue;
    const cone = take(actor, 'cone', at);
    cone.quaternion.setFromUnitVectors(upright, along.set(...normal).normalize());
    cone.scale.set(mu * high, mu * high, high);
  }
}

function draw_forces() {
  for (const actor of actors) {
    const {shown} = actor, {knot, part, next} = clock.place(shown), now = part >= 1 ? next : knot;
    begin(actor);
    if (shown.forces) {
      draw_contacts(actor, shown.forces[now], pressed('cones'), pressed('contacts'));
      for (const pair of pressed('forces') ? shown.bearing[now].values() : []) {
        if (!(Math.hypot(...pair.force) * metres > 0.004 * extent.size)) continue;
        draw_arrow(actor, 'link', pair.centre, pair.force);
        take(actor, 'ring', pair.centre).quaternion.setFromUnitVectors(upright, along.set(...pair.normal).normalize());
      }
    }
    finish(actor);
  }
}

// --- targets: a ball where a place was asked, a ring at the height or beside the way of what was asked of it ---

function make_targets() {
  const group = new THREE.Group();
  const ball = new THREE.SphereGeometry(0.026 * extent.size, 16, 12), ring = new THREE.TorusGeometry(0.07 * extent.size, 0.006 * extent.size, 8, 40);
  for (const asked of motion.targets) {
    const mesh = new THREE.Mesh(asked.pos.includes(null) ? ring : ball, ink.target.clone());
    mesh.position.set(...asked.pos.map((x, k) => x === null ? asked.got[k] : x));
    // a ring lies across the one direction that is asked
    const only = [0, 1, 2].filter(k => asked.pos[k] !== null);
    if (only.length === 1 && only[0] < 2) mesh.rotation.set(only[0] === 1 ? Math.PI / 2 : 0, only[0] === 0 ? Math.PI / 2 : 0, 0);
    const when = asked.from === asked.to ? `at ${(asked.from * motion.timestep).toFixed(2)} s` :
      `from ${(asked.from * motion.timestep).toFixed(2)} to ${(asked.to * motion.timestep).toFixed(2)} s`;
    mesh.userData = {name: `target: ${asked.name}, ${when}`, asked};
    group.add(on_top(mesh));
  }
  actors[0].root.add(group);
  return group;
}
const targets = make_targets();

// bold at its time
function draw_targets() {
  for (const mesh of targets.children) {
    const {from, to} = mesh.userData.asked, h = motion.timestep;
    const away = Math.max(from * h - clock.time, clock.time - to * h, 0);
    mesh.material.opacity = 0.25 + 0.7 * Math.exp(-((away / 0.08) ** 2));
  }
}

// --- the whole path of the centre of mass as a line, and a ball where the motion is ---

const trails = actors.map(actor => {
  const colour = actor.index ? '#9a4ddb' : '#2f7bff', group = new THREE.Group(), {shown} = actor;
  const points = new Float32Array(3 * shown.nknot), point = new THREE.Vector3();
  const ball = new THREE.Mesh(new THREE.SphereGeometry(0.022 * extent.size, 20, 14), over(colour, 1));
  for (let knot = 0; knot < shown.nknot; knot++) {
    pose(actor, {knot, part: 0, next: knot});
    centre(actor, point).sub(actor.root.position).toArray(points, 3 * knot);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(points, 3));
  const pen = new THREE.LineBasicMaterial({color: paint_hex(colour), depthTest: false, transparent: true});
  group.add(new THREE.Line(geometry, pen), on_top(ball));
  group.renderOrder = 1;
  group.visible = false;
  actor.root.add(group);
  return {group, ball, actor};
});
