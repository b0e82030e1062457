// Drawing, when there is something new to draw, as finely as the machine keeps up with.

let renderer = null, stale = true, then = 0;

// how fine: 0 the finest. Browsers that draw without a graphics processor start at the second and without smoothing of edges,
// and draw what stands still finer once it stands
const quality = {
  level: 0,
  slow: 0,  // frames in a row that came late
  still: 0,  // s that nothing moved; -1: drawn finely since
  frugal: false,
  // a scene alone is for pictures: twice as fine as the window
  ratio: () => document.body.classList.contains('picture') ? 2 : Math.min(devicePixelRatio || 1, [2, 1, 0.7][quality.level]),
  apply() {
    renderer.setPixelRatio(this.ratio());
    const size = [2048, 1024, 512][this.level], type = this.level ? THREE.PCFShadowMap : THREE.PCFSoftShadowMap;
    if (lamp.shadow.mapSize.x !== size) {
      lamp.shadow.mapSize.set(size, size);
      if (lamp.shadow.map) lamp.shadow.map.dispose();
      lamp.shadow.map = null;
    }
    renderer.shadowMap.type = type;
    resize();
  },
  // a frame after so many seconds while playing; only worse, never back: a change is seen
  note(seconds) {
    this.slow = seconds > 0.045 ? this.slow + 1 : Math.max(this.slow - 1, 0);
    if (this.slow < 8 || this.level === 2 || document.body.classList.contains('picture')) return;
    this.slow = 0;
    this.level++;
    this.apply();
  },
};

// whether a browser draws by its processor alone
function draws_slowly() {
  const gl = document.createElement('canvas').getContext('webgl');
  const told = gl && gl.getExtension('WEBGL_debug_renderer_info');
  const name = told ? gl.getParameter(told.UNMASKED_RENDERER_WEBGL) : '';
  if (gl && gl.getExtension('WEBGL_lose_context')) gl.getExtension('WEBGL_lose_context').loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

function start_renderer() {
  quality.frugal = draws_slowly();
  quality.level = quality.frugal ? 1 : 0;
  try {
    renderer = new THREE.WebGLRenderer({antialias: !quality.frugal});
  } catch (problem) {
    by('lost').hidden = false;
    by('views').hidden = true;
    by('picture').hidden = by('film').hidden = true;
    return;
  }
  renderer.shadowMap.enabled = true;
  if ('outputEncoding' in renderer) renderer.outputEncoding = THREE.sRGBEncoding;
  else renderer.gammaOutput = true;
  if (!('outputEncoding' in renderer)) renderer.gammaFactor = 2.2;
  const canvas = renderer.domElement;
  canvas.tabIndex = 0;
  canvas.setAttribute('role', 'img');
  by('stage').prepend(canvas);
  quality.apply();
  listen(canvas);
}

function resize() {
  const width = by('stage').clientWidth, height = by('stage').clientHeight;
  if (renderer && width && height) {
    camera.aspect = width / height;
    renderer.setSize(width, height, false);
  }
  charts.forEach(draw_chart);
  bars.forEach(draw_bar);
  stale = true;
}

function draw() {
  for (const actor of actors) pose(actor, clock.place(actor.shown));
  scene.updateMatrixWorld();
  middle_of_motions();
  for (const {actor, ball} of trails) centre(actor, ball.position).sub(actor.root.position);
  draw_forces();
  draw_targets();
  aim();
  renderer.render(scene, camera);
}

// what stands still is drawn twice as fine where edges are not smoothed
function draw_still() {
  renderer.setPixelRatio(Math.max(2, devicePixelRatio || 1));
  renderer.setSize(by('stage').clientWidth, by('stage').clientHeight, false);
  draw();
  quality.still = -1;
}

function frame(now) {
  const seconds = (now - then) / 1000;
  then = now;
  if (clock.playing && renderer && seconds < 1) quality.note(seconds);
  clock.tick(Math.min(seconds, 0.1));
  if (stale && renderer) {
    stale = false;
    if (quality.still < 0) renderer.setPixelRatio(quality.ratio());
    quality.still = 0;
    draw();
  } else if (renderer && quality.frugal && !clock.playing && quality.ratio() < 2 && quality.still >= 0 && (quality.still += seconds) > 0.25) {
    draw_still();
  }
  requestAnimationFrame(frame);
}
