// Bodies: geoms of every link, links joined where their geoms leave a gap, poses, the goal as a ghost, the second motion.

const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(34, 1, 0.01, 1000);
camera.up.set(0, 0, 1);
const planes = [];
const dark = matchMedia('(prefers-color-scheme: dark)');

// colours of files are meant for the screen; light is added up in linear space
const paint = (r, g, b) => new THREE.Color(r, g, b).convertSRGBToLinear();
const paint_hex = hex => new THREE.Color(hex).convertSRGBToLinear();
const SECOND = paint_hex('#9a4ddb');

// a capsule along z by turning its outline, with radii of its own at both ends
function capsule(low, high, half) {
  const outline = [];
  for (let i = 0; i <= 8; i++) {
    const angle = -Math.PI / 2 + Math.PI * i / 16;
    outline.push(new THREE.Vector2(Math.max(low * Math.cos(angle), 1e-9), low * Math.sin(angle) - half));
  }
  for (let i = 0; i <= 8; i++) {
    const angle = Math.PI * i / 16;
    outline.push(new THREE.Vector2(Math.max(high * Math.cos(angle), 1e-9), high * Math.sin(angle) + half));
  }
  return new THREE.LatheGeometry(outline, 24).rotateX(Math.PI / 2);
}

// triangles with a normal each
function surface(geom) {
  const flat = new THREE.BufferGeometry();
  flat.setAttribute('position', new THREE.Float32BufferAttribute(geom.triangles.flatMap(i => geom.corners.slice(3 * i, 3 * i + 3)), 3));
  flat.computeVertexNormals();
  return flat;
}

const shapes = {
  sphere: size => new THREE.SphereGeometry(size[0], 28, 20),
  capsule: size => capsule(size[0], size[0], size[1]),
  ellipsoid: size => new THREE.SphereGeometry(1, 28, 20).scale(size[0], size[1], size[2]),
  cylinder: size => new THREE.CylinderGeometry(size[0], size[0], 2 * size[1], 32).rotateX(Math.PI / 2),
  box: size => new THREE.BoxGeometry(2 * size[0], 2 * size[1], 2 * size[2]),
  mesh: (size, geom) => surface(geom),
  hfield: (size, geom) => surface(geom),
};

// radius of a ball about a geom's centre
const reach = geom => ({sphere: geom.size[0], capsule: geom.size[0] + geom.size[1],
  cylinder: Math.hypot(geom.size[0], geom.size[1]), box: Math.hypot(...geom.size)})[geom.type] || Math.max(...geom.size);

const place = (object, pos, quat) => {
  object.position.set(pos[0], pos[1], pos[2]);
  object.quaternion.set(quat[1], quat[2], quat[3], quat[0]);
};

// groups from 3 on are what collides beside what is seen; a body that has nothing else is drawn by them
const has_shape = geom => geom.type !== 'plane' && !geom.hidden && geom.rgba[3] > 0 && Math.max(...geom.size) > 0;
for (const shown of motions) {
  const seen = new Set(shown.geoms.filter(geom => has_shape(geom) && geom.group < 3).map(geom => geom.body));
  for (const geom of shown.geoms) geom.drawn = has_shape(geom) && (geom.group < 3 || (geom.link > 0 && !seen.has(geom.body)));
}
const is_drawn = geom => geom.drawn;

// a body's own paint, and that of one that stands beside or within another motion
function dye([r, g, b, a], tinted) {
  const colour = tinted ? paint(r, g, b).lerp(SECOND, 0.75) : paint(r, g, b);
  const opacity = tinted ? 0.5 * a : a;
  return new THREE.MeshLambertMaterial({color: colour, transparent: opacity < 1, opacity, depthWrite: a >= 1});
}

// --- gaps between links ---

// the nearest point of a geom's inside to a point, both in the link's frame; null: the point is in it, or none is told
function nearest_inside(geom, point) {
  const at = new THREE.Vector3(...geom.pos), turn = new THREE.Quaternion(geom.quat[1], geom.quat[2], geom.quat[3], geom.quat[0]);
  const local = point.clone().sub(at).applyQuaternion(turn.clone().conjugate()), size = geom.size;
  let inner, radius;
  if (geom.type === 'sphere' || geom.type === 'capsule') {
    const half = geom.type === 'capsule' ? size[1] : 0;
    inner = new THREE.Vector3(0, 0, clamp(local.z, -half, half));
    radius = size[0];
  } else {
    // shrunk to half: a box, or the box about what is round; of a mesh about its corners
    const middle = [0, 0, 0], half = [...size];
    for (let k = 0; geom.corners && k < 3; k++) {
      let low = Infinity, high = -Infinity;
      for (let i = k; i < geom.corners.length; i += 3) { low = Math.min(low, geom.corners[i]); high = Math.max(high, geom.corners[i]); }
      middle[k] = (low + high) / 2;
      half[k] = (high - low) / 2;
    }
    if (geom.type === 'cylinder') [half[1], half[2]] = [half[0], size[1]];
    radius = Math.min(...half);
    inner = new THREE.Vector3(...['x', 'y', 'z'].map((axis, k) =>
      middle[k] + clamp(local[axis] - middle[k], Math.min(radius - half[k], 0), Math.max(half[k] - radius, 0))));
    if (['x', 'y', 'z'].every((axis, k) => Math.abs(local[axis] - middle[k]) <= half[k])) return null;
  }
  const distance = inner.distanceTo(local);
  return distance <= radius ? null : {point: inner.applyQuaternion(turn).add(at), radius, gap: distance - radius};
}

// a rod in a link's frame from a joint to the nearest of the link's geoms, where none holds the joint
function bone(actor, link, joint) {
  let best = null;
  for (const geom of actor.shown.geoms) {
    if (geom.link !== link || !is_drawn(geom)) continue;
    const found = nearest_inside(geom, joint);
    if (!found) return;
    if (!best || found.gap < best.gap) best = {...found, geom};
  }
  if (!best || best.gap > 4 * best.radius) return;
  const wide = 0.62 * best.radius, way = best.point.clone().sub(joint);
  const mesh = new THREE.Mesh(capsule(0.9 * wide, wide, way.length() / 2));
  mesh.position.copy(joint).addScaledVector(way, 0.5);
  mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), way.normalize());
  add_solid(actor, best.geom, mesh);
}

// joints that turn hold two links together: both reach them
function join_links(actor) {
  pose(actor, {knot: 0, part: 0, next: 0});
  const {shown, links} = actor;
  shown.links.forEach((link, i) => {
    if (!link.joint || !(link.parent > 0)) return;
    const joint = new THREE.Vector3(...link.joint), parent = links[link.parent];
    bone(actor, i, joint);
    const there = joint.clone().applyQuaternion(links[i].quaternion).add(links[i].position);
    bone(actor, link.parent, there.sub(parent.position).applyQuaternion(parent.quaternion.clone().conjugate()));
  });
}

// --- actors ---

function add_solid(actor, geom, mesh) {
  mesh.material = dye(geom.rgba, false);
  mesh.castShadow = geom.rgba[3] > 0.4;
  mesh.receiveShadow = true;
  mesh.userData = {actor, body: geom.body, name: geom.name && geom.name !== geom.body ? `${geom.body} \u00b7 ${geom.name}` : geom.body,
    plain: mesh.material, tinted: actor.index ? dye(geom.rgba, true) : mesh.material};
  actor.links[geom.link].add(mesh);
  actor.solids.push(mesh);
}

function make_actor(shown, index) {
  const actor = {shown, index, root: new THREE.Group(), links: shown.links.map(() => new THREE.Group()), solids: []};
  actor.root.add(...actor.links);
  scene.add(actor.root);
  return actor;
}

function furnish(actor) {
  for (const geom of actor.shown.geoms) {
    if (!is_drawn(geom)) continue;
    const mesh = new THREE.Mesh(shapes[geom.type](geom.size, geom));
    place(mesh, geom.pos, geom.quat);
    add_solid(actor, geom, mesh);
  }
  join_links(actor);
}

// a checker without end: a wide sheet that moves with the camera by whole cells
function add_plane(actor, geom, cell) {
  const image = node('canvas');
  image.width = image.height = 128;
  const texture = new THREE.CanvasTexture(image);
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.anisotropy = 8;
  texture.repeat.set(100, 100);
  if (THREE.sRGBEncoding) texture.encoding = THREE.sRGBEncoding;
  const mesh = new THREE.Mesh(new THREE.PlaneGeometry(200 * cell, 200 * cell), new THREE.MeshLambertMaterial({map: texture}));
  mesh.receiveShadow = true;
  const frame = new THREE.Group();
  place(frame, geom.pos, geom.quat);
  frame.add(mesh);
  actor.links[geom.link].add(frame);
  planes.push({mesh, frame, image, texture, cell});
}

// poses of all links at a knot and part of the way to the next
const here = new THREE.Quaternion(), there = new THREE.Quaternion();
function pose({shown, links}, {knot, part, next}) {
  const a = shown.poses[knot], b = shown.poses[next];
  for (let i = 1; i < links.length; i++) {
    const k = 7 * (i - 1), at = j => a[k + j] + part * (b[k + j] - a[k + j]);
    links[i].position.set(at(0), at(1), at(2));
    here.set(a[k + 4], a[k + 5], a[k + 6], a[k + 3]);
    there.set(b[k + 4], b[k + 5], b[k + 6], b[k + 3]);
    links[i].quaternion.copy(here.slerp(there, part)).normalize();
  }
}

// centre of mass of the links as they are posed
const arm = new THREE.Vector3();
function centre({shown, links, root}, out) {
  let mass = 0;
  out.set(0, 0, 0);
  for (let i = 1; i < links.length; i++) {
    const link = shown.links[i];
    arm.set(link.com[0], link.com[1], link.com[2]).applyQuaternion(links[i].quaternion).add(links[i].position);
    out.addScaledVector(arm, link.mass);
    mass += link.mass;
  }
  return (mass > 0 ? out.divideScalar(mass) : out).add(root.position);
}

// how large the model is and how high it goes: what the camera has to hold
function measure(actor) {
  const {shown, links} = actor;
  const moving = shown.geoms.some(geom => geom.link > 0 && geom.type !== 'plane');
  const seen = shown.geoms.filter(geom => geom.type !== 'plane' && (geom.link > 0 || !moving));
  const point = new THREE.Vector3(), middle = new THREE.Vector3();
  let low = Infinity, high = -Infinity, radius = 0;
  const stride = Math.max(1, Math.floor(shown.nknot / 60));
  for (let knot = 0; knot < shown.nknot; knot += stride) {
    pose(actor, {knot, part: 0, next: knot});
    centre(actor, middle);
    for (const geom of seen) {
      const far = reach(geom);
      point.set(...geom.pos).applyQuaternion(links[geom.link].quaternion).add(links[geom.link].position);
      low = Math.min(low, point.z - far);
      high = Math.max(high, point.z + far);
      radius = Math.max(radius, Math.hypot(point.x - middle.x, point.y - middle.y) + far);
    }
  }
  if (!(radius > 0)) return {low: 0, high: 1, radius: 1};
  // what stands where it moves is seen from its foot to its top: the base of an arm, a box to step on
  for (const geom of shown.geoms) {
    const [x, y, z] = geom.pos, far = reach(geom);
    if (geom.link > 0 || !has_shape(geom) || Math.hypot(x - middle.x, y - middle.y) > radius || far > 2 * radius) continue;
    const tall = geom.type === 'box' ? geom.size[2] : far;  // as if it stood upright
    low = Math.min(low, z - tall);
    high = Math.max(high, z + tall);
  }
  return {low, high, radius};
}

const actors = motions.map(make_actor);
const extent = actors.map(measure).reduce((a, b) =>
  ({low: Math.min(a.low, b.low), high: Math.max(a.high, b.high), radius: Math.max(a.radius, b.radius)}));
extent.size = Math.max(extent.radius, (extent.high - extent.low) / 2);
const cell = 0.5 * 2 ** Math.round(Math.log2(extent.size / 0.9));
actors.forEach(furnish);
for (const geom of motion.geoms) if (geom.type === 'plane') add_plane(actors[0], geom, cell);

// the goal as a ghost
const ghost = new THREE.Group();
if (motion.goal && !both) {
  const pale = new THREE.MeshBasicMaterial({color: paint_hex('#2f6fed'), transparent: true, opacity: 0.18, depthWrite: false});
  for (const mesh of actors[0].solids) {
    const link = actors[0].links.indexOf(mesh.parent), k = 7 * (link - 1);
    if (link === 0) continue;
    const frame = new THREE.Group(), copy = new THREE.Mesh(mesh.geometry, pale);
    place(frame, motion.goal.slice(k, k + 3), motion.goal.slice(k + 3, k + 7));
    copy.position.copy(mesh.position);
    copy.quaternion.copy(mesh.quaternion);
    frame.add(copy);
    ghost.add(frame);
  }
}
scene.add(ghost);

// the second motion in the place of the first, tinted, or beside it in its own colours
function set_beside(on) {
  if (!both) return;
  const [one, other] = actors;
  const apart = on ? 1.15 * Math.min(extent.radius, extent.high - extent.low) : 0;
  one.root.position.y = apart / 2;
  other.root.position.y = -apart / 2;
  for (const mesh of other.solids) {
    mesh.material = on ? mesh.userData.plain : mesh.userData.tinted;
    mesh.visible = on || mesh.parent !== other.links[0];
  }
}
set_beside(false);

// light from the sky, and one lamp whose shadow covers the model
const sky = new THREE.HemisphereLight(0xffffff, 0x888888, 0.75);
const lamp = new THREE.DirectionalLight(0xffffff, 0.75);
lamp.castShadow = true;
lamp.shadow.radius = 3;
lamp.shadow.bias = -0.0006;
Object.assign(lamp.shadow.camera, {left: -2.4 * extent.size, right: 2.4 * extent.size, bottom: -2.4 * extent.size,
  top: 2.4 * extent.size, near: 0.1 * extent.size, far: 14 * extent.size});
scene.add(sky, lamp, lamp.target);

function apply_theme() {
  // behind the scene stands the page's own ground; fog fades into it and is mixed in last, in the screen's colours
  const ground = new THREE.Color(getComputedStyle(document.body).getPropertyValue('--ground').trim());
  scene.fog = new THREE.Fog(ground, 1, 100);
  if (renderer) renderer.setClearColor(ground, 1);
  sky.intensity = dark.matches ? 0.55 : 0.6;
  lamp.intensity = dark.matches ? 0.66 : 0.6;
  sky.groundColor = paint_hex(dark.matches ? '#3a4350' : '#aab2bd');
  for (const plane of planes) {
    const pen = plane.image.getContext('2d');
    const [even, odd] = dark.matches ? ['#363e49', '#2d343e'] : ['#f0f2f5', '#dfe4ea'];
    pen.fillStyle = even;
    pen.fillRect(0, 0, 128, 128);
    pen.fillStyle = odd;
    pen.fillRect(0, 0, 64, 64);
    pen.fillRect(64, 64, 64, 64);
    plane.texture.needsUpdate = true;
  }
  charts.forEach(draw_chart);
  bars.forEach(draw_bar);
}
