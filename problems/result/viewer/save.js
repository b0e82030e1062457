// Pictures and films of the scene, saved as files.

function save(blob, name) {
  const link = node('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  tell(`saved ${name}, ${blob.size > 1e6 ? `${(blob.size / 1e6).toFixed(1)} MB` : `${Math.ceil(blob.size / 1e3)} kB`}`);
}

const file_name = end => `${(both ? `${motion.label}-beside-${second.label}` : named(motion)).replace(/[^\w.-]+/g, '-').slice(0, 80)}${end}`;

let hush = 0;
function tell(text, stays = false) {
  by('saved').textContent = text;
  by('saved').hidden = false;
  clearTimeout(hush);
  if (!stays) hush = setTimeout(() => { by('saved').hidden = true; }, 4000);
}

// the scene as it is seen, twice as fine as the screen
function save_picture() {
  draw_still();
  renderer.domElement.toBlob(blob => save(blob, file_name(`-${clock.time.toFixed(2)}s.png`)));
  stale = true;
}

// one playing of the motion from its start, at the speed that is set
const film = {
  recorder: null,
  format: () => window.MediaRecorder && ['video/webm;codecs=vp9', 'video/webm', 'video/mp4'].find(type => MediaRecorder.isTypeSupported(type)),
  start() {
    const pieces = [], type = this.format(), end = type.includes('webm') ? '.webm' : '.mp4';
    this.recorder = new MediaRecorder(renderer.domElement.captureStream(30), {mimeType: type, videoBitsPerSecond: 6e6});
    this.recorder.ondataavailable = event => { if (event.data.size) pieces.push(event.data); };
    this.recorder.onstop = () => save(new Blob(pieces, {type: type.split(';')[0]}), file_name(end));
    clock.play(false);
    clock.set(0);
    this.recorder.start();
    clock.once = () => this.stop();
    clock.play(true);
    this.mark('Stop the film');
    tell('recording one playing of the motion', true);
  },
  stop() {
    clock.once = null;
    // the last picture stands for a moment
    const {recorder} = this;
    setTimeout(() => recorder.stop(), 300);
    this.recorder = null;
    this.mark('Save a film, one playing of the motion (V)');
  },
  toggle() {
    if (this.recorder) this.stop();
    else this.start();
  },
  mark(text) {
    by('film').classList.toggle('on', !!this.recorder);
    by('film').title = text;
    by('film').setAttribute('aria-label', text);
  },
};
by('picture').onclick = save_picture;
by('film').onclick = () => film.toggle();
