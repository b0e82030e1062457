// The camera: an orbit about the motions, seen from the usual sides.

const tall = Math.max(1.12 * (extent.high - extent.low) / 2, 0.75 * extent.radius);
const fit = tall / Math.tan(camera.fov * Math.PI / 360) + 0.6 * extent.radius;
// where the eye is seen from the target; aside is what the user has moved the target by
const orbit = {azimuth: -55, elevation: 12, distance: fit, anchor: new THREE.Vector3(), aside: new THREE.Vector3()};
const mass_centre = new THREE.Vector3(), target = new THREE.Vector3(), look = new THREE.Vector3();
const presets = {oblique: [-55, 12], front: [0, 4], 'side-view': [-90, 4], top: [-90, 89]};

function see_from(name) {
  [orbit.azimuth, orbit.elevation] = presets[name];
  orbit.distance = fit;
  orbit.aside.set(0, 0, 0);
  anchor();
  mark_preset();
  stale = true;
}

// the button of the side that the camera is at
function mark_preset() {
  for (const name in presets)
    by(name).setAttribute('aria-pressed', presets[name][0] === orbit.azimuth && presets[name][1] === orbit.elevation);
}

// the middle of the centres of mass
function middle_of_motions() {
  mass_centre.set(0, 0, 0);
  for (const actor of actors) mass_centre.add(centre(actor, look));
  mass_centre.divideScalar(actors.length);
}

// the anchor moves with the centre of mass over the ground only: a jump should be seen to rise
function anchor() {
  orbit.anchor.set(mass_centre.x, mass_centre.y, (extent.low + extent.high) / 2);
}

function turn(dx, dy) {
  orbit.azimuth -= 0.35 * dx;
  orbit.elevation = clamp(orbit.elevation + 0.3 * dy, -89, 89);
  mark_preset();
}

function shift(dx, dy) {
  const scale = 2 * orbit.distance * Math.tan(camera.fov * Math.PI / 360) / by('stage').clientHeight;
  const right = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 0);
  const up = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 1);
  orbit.aside.addScaledVector(right, -dx * scale).addScaledVector(up, dy * scale);
}

const zoom = factor => { orbit.distance = clamp(orbit.distance * factor, 0.2 * extent.size, 14 * fit); };

function aim() {
  const az = orbit.azimuth * Math.PI / 180, el = orbit.elevation * Math.PI / 180;
  if (pressed('follow')) anchor();
  target.copy(orbit.anchor).add(orbit.aside);
  look.set(Math.cos(az) * Math.cos(el), Math.sin(az) * Math.cos(el), Math.sin(el));
  // a tall window sees less to the sides: stand back until they fit
  const wide = 1.05 * (extent.radius + Math.abs(actors[0].root.position.y)) / (Math.tan(camera.fov * Math.PI / 360) * camera.aspect);
  const distance = orbit.distance * Math.max(1, (wide + 0.6 * extent.radius) / fit);
  camera.position.copy(target).addScaledVector(look, distance);
  camera.lookAt(target);
  camera.near = distance / 200;
  camera.far = distance + 200 * cell;
  camera.updateProjectionMatrix();
  camera.updateMatrixWorld();
  scene.fog.near = distance + 4 * extent.size;
  scene.fog.far = Math.min(distance + 30 * extent.size, 95 * cell);
  lamp.target.position.copy(target);
  lamp.position.copy(target).add(arm.set(-1.6, -2.2, 5).multiplyScalar(extent.size));
  for (const plane of planes) {
    const at = plane.frame.worldToLocal(arm.copy(target));
    plane.mesh.position.set(Math.round(at.x / (2 * cell)) * 2 * cell, Math.round(at.y / (2 * cell)) * 2 * cell, 0);
  }
}
