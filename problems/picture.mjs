// Pictures of pages of results, still or moving, one beside the other, by headless Chromium: no package, node and chromium alone.
// Usage: node problems/picture.mjs OUT.png|OUT.webp PAGE... [--size 800x380] [--time S] [--rate 20] [--columns N] [--view A,E,D] [--quality 0.6]
// A .png is of one moment, --time; a .webp plays once through the longest of the motions, for ever, shorter ones waiting at
// their end. --size is that of one page's scene.
import {readFileSync, realpathSync, writeFileSync} from 'node:fs';
import {start} from './chromium.mjs';

const usage = readFileSync(new URL(import.meta.url), 'utf8').match(/Usage: (.*)/)[1];
const given = {size: '800x380', time: '0', rate: '20', columns: '', view: '', quality: '0.6'}, names = [];
for (let i = 2; i < process.argv.length; i++) {
  const name = process.argv[i].replace(/^--/, '');
  if (process.argv[i] === name) names.push(name);
  else if (name in given && i + 1 < process.argv.length) given[name] = process.argv[++i];
  else { console.error(`usage: ${usage}`); process.exit(2); }
}
const [out, ...pages] = names, [width, height] = given.size.split('x').map(Number);
if (!pages.length || !/\.(png|webp)$/.test(out) || !(width > 0 && height > 0)) { console.error(`usage: ${usage}`); process.exit(2); }
const moving = out.endsWith('.webp'), columns = +given.columns || pages.length;

// one picture of a page's scene, drawn twice as fine: data URL
const shoot = time => `(() => {
  clock.play(false);
  clock.set(${time});
  renderer.setPixelRatio(2);
  draw();
  return renderer.domElement.toDataURL('image/webp', 0.95);
})()`;

// pictures of one moment beside each other, to the size that is asked; base64
const compose = (tiles, type, quality) => `(async () => {
  const tiles = ${JSON.stringify(tiles)}, columns = ${columns}, rows = Math.ceil(tiles.length / columns);
  const canvas = document.createElement('canvas'), pen = canvas.getContext('2d');
  canvas.width = columns * ${width};
  canvas.height = rows * ${height};
  pen.imageSmoothingQuality = 'high';
  for (const [i, tile] of tiles.entries()) {
    const image = new Image();
    image.src = tile;
    await image.decode();
    pen.drawImage(image, i % columns * ${width}, Math.floor(i / columns) * ${height}, ${width}, ${height});
  }
  return canvas.toDataURL('image/${type}', ${quality}).split(',')[1];
})()`;

// --- a moving picture: WebP's container about pictures that Chromium has compressed ---

const chunk = (name, data) => {
  const head = Buffer.alloc(8);
  head.write(name, 0, 'latin1');
  head.writeUInt32LE(data.length, 4);
  return Buffer.concat([head, data, Buffer.alloc(data.length % 2)]);
};
const little = (...pairs) => Buffer.concat(pairs.map(([value, bytes]) => {
  const buffer = Buffer.alloc(bytes);
  buffer.writeUIntLE(value, 0, bytes);
  return buffer;
}));

// the compressed picture in a file of one
function body_of(file) {
  for (let at = 12; at < file.length;) {
    const name = file.toString('latin1', at, at + 4), size = file.readUInt32LE(at + 4);
    if (name === 'VP8 ' || name === 'VP8L') return file.subarray(at, at + 8 + size + size % 2);
    at += 8 + size + size % 2;
  }
  throw new Error('no picture in what Chromium wrote');
}

function animate(files, times, wide, high) {
  const body = [chunk('VP8X', little([2, 1], [0, 3], [wide - 1, 3], [high - 1, 3])), chunk('ANIM', little([0xffffffff, 4], [0, 2]))];
  files.forEach((file, i) =>
    body.push(chunk('ANMF', Buffer.concat([little([0, 3], [0, 3], [wide - 1, 3], [high - 1, 3], [times[i], 3], [2, 1]), body_of(file)]))));
  return chunk('RIFF', Buffer.concat([Buffer.from('WEBP'), ...body]));
}

// --- all of it ---

const browser = await start();
const scenes = [];
for (const page of pages) {
  const scene = await browser.open(`file://${realpathSync(page)}#bare&t=0${given.view ? `&view=${given.view}` : ''}`, {width, height});
  if (scene.problems.length) throw new Error(`${page}: ${scene.problems.join('; ')}`);
  // the motion and its forces; what was asked is on the page
  await scene.value('ghost.visible = targets.visible = false');
  scenes.push(scene);
}
const durations = await Promise.all(scenes.map(scene => scene.value('duration')));
const desk = await browser.open('about:blank');
const rate = +given.rate, last = Math.max(...durations), count = moving ? Math.max(1, Math.round(last * rate)) + 1 : 1;
const files = [], times = [];
for (let i = 0; i < count; i++) {
  const tiles = [], time = moving ? i / rate : +given.time;
  // a motion that fits in again begins anew
  for (const [k, scene] of scenes.entries())
    tiles.push(await scene.value(shoot(moving && 2 * durations[k] <= last + 1e-6 ? time % durations[k] : Math.min(time, durations[k]))));
  files.push(Buffer.from(await desk.value(compose(tiles, moving ? 'webp' : 'png', +given.quality)), 'base64'));
  times.push(i + 1 < count ? Math.round(1000 / rate) : 700);
}
const rows = Math.ceil(pages.length / columns);
writeFileSync(out, moving ? animate(files, times, columns * width, rows * height) : files[0]);
await browser.close();
console.log(`${out}: ${count} pictures`);
