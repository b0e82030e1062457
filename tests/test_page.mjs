// What test_page.sh makes, opened, clicked and read. Truths from outside the page: forces.csv, controls.csv, the model's file.
// Usage: node test_page.mjs FOLDER SOURCE_ROOT
import {readdirSync, readFileSync, statSync} from 'node:fs';
import {join} from 'node:path';
import {start} from '../problems/chromium.mjs';

const [folder, root] = process.argv.slice(2);
let checks = 0, failed = 0;
function check(good, text) {
  checks++;
  if (good) return;
  failed++;
  console.log(`failed: ${text}`);
}
const near = (a, b, tolerance) => Math.abs(a - b) <= tolerance * Math.max(1, Math.abs(b));
const sleep = ms => new Promise(resolve => setTimeout(resolve, ms));
// waits for an expression to be true, some seconds on a busy machine
async function until(page, expression) {
  for (let i = 0; i < 200; i++) {
    if (await page.value(`!!(${expression})`)) return true;
    await sleep(50);
  }
  return false;
}
const url = name => `file://${join(folder, name)}`;
function table(path) {
  const [head, ...rows] = readFileSync(path, 'utf8').trim().split('\n').map(line => line.split(','));
  return rows.map(row => Object.fromEntries(head.map((name, i) => [name, isNaN(row[i]) ? row[i] : +row[i]])));
}

const browser = await start();

// what every page holds to, whatever its width
async function check_layout(page, name) {
  const told = await page.value(`(() => {
    const box = id => by(id).getBoundingClientRect(), {stage, head} = {stage: box('stage'), head: box('head')};
    return {over: head.bottom > stage.top + 0.5, wide: document.documentElement.scrollWidth - innerWidth,
      in_stage: by('stage').querySelectorAll('h1, .chip').length, height: stage.height};
  })()`);
  check(!told.over && told.in_stage === 0, `${name}: the title is over the figure`);
  check(told.wide <= 0, `${name}: ${told.wide} px wider than the window`);
  check(told.height >= 250, `${name}: the scene is ${told.height} px high`);
  // the figure is seen: many colours, not one; counted on what is drawn
  const colours = await page.value(`(() => {
    draw();
    const gl = renderer.getContext(), w = gl.drawingBufferWidth, h = gl.drawingBufferHeight, data = new Uint8Array(4 * w * h);
    gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, data);
    const seen = new Set();
    for (let i = 0; i < data.length; i += 4) seen.add(data[i] >> 4 << 8 | data[i + 1] >> 4 << 4 | data[i + 2] >> 4);
    return seen.size;
  })()`);
  check(colours > 20, `${name}: ${colours} colours in the scene`);
  check(page.problems.length === 0, `${name}: ${page.problems.join('; ')}`);
}

// --- one motion ---

async function check_forces(page) {
  // the first foot at the first knot, from forces.csv: the floor is level, so a centre of pressure is a mean by vertical force
  const rows = table(join(folder, 'far/forces.csv')).filter(row => row.knot === 0 && row.geom1 === 'floor');
  const foot = rows[0].geom2, of_foot = rows.filter(row => row.geom2 === foot);
  const sum = of_foot.reduce((all, row) => all + row.force_z, 0);
  const centre = of_foot.reduce((all, row) => all + row.force_z * row.pos_x, 0) / sum;
  const got = await page.value(`(() => {
    const geom = motion.geoms.find(geom => geom.name === ${JSON.stringify(foot)});
    return [...motion.bearing[0].values()].find(pair => pair.key === geom.link + '|0');
  })()`);
  check(got && near(got.force[2], sum, 1e-3) && near(got.centre[0], centre, 1e-4), `force of ${foot}: ${JSON.stringify(got)}, ${sum} N at ${centre}`);
  const target = await page.value(`motion.targets.find(target => target.name === 'front left foot')`);
  check(target && target.from === 10 && target.to === 10 && target.pos[2] > 0.05, `a target in space: ${JSON.stringify(target)}`);
  // the whole force carries the weight, over a stride that goes on for ever
  const mean = await page.value(`motion.bearing.reduce((sum, pairs) => sum + [...pairs.values()].reduce((all, pair) => all + pair.force[2], 0), 0) / motion.bearing.length / motion.weight`);
  check(near(mean, 1, 0.05), `mean vertical force is ${mean} of the weight`);
  // arrows and cones are as many as their switches say
  const seen = kind => page.value(`(draw(), actors[0].pool.${kind}.filter(shape => shape.visible).length)`);
  await page.value('(clock.play(false), clock.set(0), 1)');
  check(await seen('link') > 0 && await seen('contact') === 0 && await seen('cone') === 0, 'forces of links at the beginning');
  for (const [id, kind] of [['contacts', 'contact'], ['cones', 'cone']]) {
    await page.click(`#${id}`);
    check(await seen(kind) > 0, `${id} shows none`);
    await page.click(`#${id}`);
    check(await seen(kind) === 0, `${id} stays`);
  }
  await page.click('#forces');
  check(await seen('link') === 0 && await seen('ring') === 0, 'forces stay');
  await page.click('#forces');
}

async function check_playback(page) {
  await page.value('(clock.play(false), clock.set(0), 1)');
  await page.click('#play');
  check(await until(page, 'clock.time > 0.05'), 'play does not play');
  await page.key(' ', 'Space');
  check(await until(page, '!clock.playing'), 'space does not pause');
  await page.key('Home');
  await page.key('ArrowRight');
  check(near(await page.value('clock.time'), 0.0125, 1e-9), 'an arrow is not a knot');
  for (const [id, axis] of [['front', 'x'], ['top', 'z']]) {
    await page.click(`#${id}`);
    const along = await page.value(`(draw(), camera.position.clone().sub(target).normalize().${axis})`);
    check(along > 0.99, `${id} looks along ${along}`);
  }
  await page.key('3', 'Digit3');
  check(await page.value('(draw(), camera.position.clone().sub(target).normalize().y)') < -0.99, 'key 3 is no side view');
  await page.key('1', 'Digit1');
  // bars of contact: one a foot, told in words, moved by a press
  const bars = await page.value(`[...document.querySelectorAll('#track canvas')].map(bar => bar.getAttribute('aria-label'))`);
  check(bars.length === 4 && bars.every(text => /bears from \d/.test(text)), `bars: ${bars.join('; ')}`);
  await page.click('#track canvas');
  check(near(await page.value('clock.time / duration'), 0.5, 0.02), 'a press on a bar is no time');
}

async function check_charts(page) {
  await page.click('details[data-group="Efforts"] summary');
  // N m of an actuator: its force by controls.csv times its gear by the model's file
  const name = 'knee_front_left', row = table(join(folder, 'far/controls.csv'))[3];
  const gear = +readFileSync(join(root, 'problems/models/quadruped.xml'), 'utf8').match(new RegExp(`name="${name}"[^>]*gear="([^"]*)"`))[1];
  await page.value(`(clock.play(false), clock.set(3 * motion.timestep), 1)`);
  const told = await page.value(`(() => {
    const chart = charts.find(chart => chart.group.dataset.group === 'Efforts' && chart.lines[0].series.name === '${name}');
    chart.plot.focus();
    return {value: chart.lines[0].series.value[3], unit: chart.lines[0].series.unit, head: chart.outputs[0].parentNode.textContent,
      said: chart.plot.getAttribute('aria-valuetext'), words: chart.plot.getAttribute('aria-description')};
  })()`);
  const force = row[`force_${name}`] * gear, share = `${Math.round(100 * Math.abs(force) / gear)}\u00a0%`;
  check(near(told.value, force, 1e-3) && told.unit === 'N m', `effort ${told.value} ${told.unit}, ${force} N m`);
  check(told.head.includes('N m') && told.head.includes(share), `head of the chart: ${told.head}, ${share}`);
  check(told.said.startsWith('0.04 s') && /least .* greatest .* limits .* N m/.test(told.words), `in words: ${told.said}; ${told.words}`);
  // what the file asks at 0.125 s of a quarter of what is shown is marked there, and no more
  const asked = await page.value(`motion.series.find(series => series.name === 'front left foot').wanted.flatMap((x, i) => x === null ? [] : [i])`);
  check(asked.length === 1 && asked[0] === 10, `a target at knots ${asked}`);
  await page.key('ArrowRight');
  const later = await page.value(`document.activeElement.getAttribute('aria-valuetext')`);
  check(later && later.startsWith('0.05 s'), `a key on a chart: ${later}`);
  await page.value('document.activeElement.blur()');
}

async function check_bodies(page) {
  await page.key('1', 'Digit1');
  const at = await page.value(`(() => {
    clock.set(0);
    draw();
    const mesh = actors[0].solids.find(mesh => mesh.userData.body === 'trunk'), box = by('stage').getBoundingClientRect();
    const point = mesh.getWorldPosition(new THREE.Vector3()).project(camera);
    return {x: box.left + (point.x + 1) / 2 * box.width, y: box.top + (1 - point.y) / 2 * box.height};
  })()`);
  await page.mouse('mouseMoved', at.x, at.y);
  check(await until(page, `!by('tip').hidden && by('tip').textContent.includes('trunk')`), 'no name under the pointer');
  const shown = `actors[0].solids.filter(mesh => mesh.userData.body === 'trunk' && mesh.visible).length`;
  check(await page.value(shown) > 0, 'no trunk');
  await page.key('h', 'KeyH');
  check(await page.value(shown) === 0, 'H hides nothing');
  await page.click('#bodies summary');
  await page.click('#show');
  check(await page.value(shown) > 0, 'what was hidden does not come back');
  await page.click('#bodies input[value="trunk"]');
  check(await page.value(shown) === 0, 'the list hides nothing');
  await page.key('a', 'KeyA');
  check(await page.value(shown) > 0, 'A shows nothing');
}

async function saved(end) {
  for (let i = 0; i < 200; i++, await sleep(100)) {
    const name = readdirSync(folder).find(name => name.endsWith(end));
    if (name && statSync(join(folder, name)).size > 0) return readFileSync(join(folder, name));
  }
  return null;
}

async function check_saving(page) {
  await page.call('Browser.setDownloadBehavior', {behavior: 'allow', downloadPath: folder});
  await page.click('#picture');
  const picture = await saved('.png'), wide = await page.value(`by('stage').clientWidth`);
  check(picture && picture.toString('latin1', 1, 4) === 'PNG' && picture.readUInt32BE(16) >= 2 * wide && picture.length > 20000,
    `picture: ${picture && picture.length} bytes`);
  if (await page.value(`by('film').hidden`)) return;
  await page.click('#film');
  check(await page.value(`by('film').classList.contains('on')`), 'no film is recorded');
  const film = await saved('.webm');
  check(film && film.readUInt32BE(0) === 0x1a45dfa3 && film.length > 5000, `film: ${film && film.length} bytes`);
}

async function check_one() {
  const page = await browser.open(url('far/view.html'));
  await check_layout(page, 'a motion');
  check(await page.value('quality.frugal && quality.level >= 1'), 'a browser without a graphics processor draws as with one');
  await check_playback(page);
  await check_forces(page);
  await check_charts(page);
  await check_bodies(page);
  await check_saving(page);
  await page.click('#help');
  check(await page.value(`by('keyboard').open`), 'no help');
  check(page.problems.length === 0, page.problems.join('; '));
  await page.close();
}

// --- two motions ---

async function check_two() {
  const page = await browser.open(url('far-beside-near.view.html'), {dark: true});
  await check_layout(page, 'two motions');
  check(await page.value(`by('legend').textContent.includes('far') && by('legend').textContent.includes('near')`), 'legend');
  const apart = `actors[0].root.position.y - actors[1].root.position.y`;
  const tinted = `actors[1].solids.some(mesh => mesh.material === mesh.userData.tinted)`;
  check(await page.value(apart) === 0 && await page.value(tinted), 'the second is no ghost in the first');
  await page.click('#beside');
  check(await page.value(apart) > 0.3 && !await page.value(tinted), 'the second is not beside the first');
  // each at its own pace over the same time: how far each comes is what its file asks
  const way = i => page.value(`(() => {
    const place = knot => { pose(actors[${i}], {knot, part: 0, next: knot}); return centre(actors[${i}], new THREE.Vector3()).x; };
    return place(motions[${i}].nknot - 1) - place(0);
  })()`);
  check(near(await way(0), 4 * 0.15, 1e-3) && near(await way(1), 4 * 0.1, 1e-3), 'ways of both');
  check(await page.value(`charts.every(chart => chart.lines.length === 2)`), 'charts of one of them');
  check(await page.value(`document.querySelectorAll('#verdict tbody tr:first-child td').length`) === 2, 'verdicts of both');
  check(await page.value(`getComputedStyle(document.body).backgroundColor`) === 'rgb(27, 32, 39)', 'not dark');
  await page.close();
}

// --- a telephone, and the humanoid ---

async function check_humanoid() {
  const name = 'problem.view.html', size = statSync(join(folder, name)).size;
  check(size < 3e6, `the humanoid's page has ${size} bytes`);
  const page = await browser.open(url(name), {width: 420, height: 860, scale: 2, touch: true});
  await check_layout(page, 'a telephone');
  // each hinge is in something that its link draws, and in something of the link before it
  const loose = await page.value(`(() => {
    pose(actors[0], {knot: 0, part: 0, next: 0});
    scene.updateMatrixWorld();
    const holds = (link, at) => actors[0].links[link].children.some(mesh => {
      if (!mesh.geometry) return false;
      mesh.geometry.computeBoundingBox();
      return mesh.geometry.boundingBox.clone().expandByScalar(1e-6).containsPoint(mesh.worldToLocal(at.clone()));
    });
    return motion.links.flatMap((link, i) => {
      if (!link.joint || link.parent < 1) return [];
      const at = actors[0].links[i].localToWorld(new THREE.Vector3(...link.joint));
      return [i, link.parent].filter(j => !holds(j, at)).map(j => motion.links[j].name + ' at ' + link.name);
    });
  })()`);
  check(loose.length === 0, `joints in the air: ${loose.join(', ')}`);
  await page.close();
}

// --- moving pictures, and the page of many ---

async function check_pictures() {
  const page = await browser.open(url('all/index.html'));
  check(await page.value(`document.querySelectorAll('a.certified[href="near.html"] img[src="near.webp"]').length`) === 1, 'no card of the motion');
  check(await until(page, `document.querySelector('img').complete && document.querySelector('img').naturalWidth === 360`), 'its picture');
  check(page.problems.length === 0, page.problems.join('; '));
  // the stride of 1 s at 10 pictures a second, both ends; two motions beside each other; no two pictures alike
  const bytes = readFileSync(join(folder, 'moving.webp')).toString('base64');
  const got = await page.value(`(async () => {
    const data = Uint8Array.from(atob('${bytes}'), c => c.charCodeAt(0)), decoder = new ImageDecoder({data, type: 'image/webp'});
    await decoder.tracks.ready;
    const {frameCount, animated} = decoder.tracks.selectedTrack, seen = new Set(), canvas = document.createElement('canvas');
    let size = '';
    for (let i = 0; i < frameCount; i++) {
      const {image} = await decoder.decode({frameIndex: i});
      size = image.codedWidth + 'x' + image.codedHeight;
      [canvas.width, canvas.height] = [image.codedWidth, image.codedHeight];
      canvas.getContext('2d').drawImage(image, 0, 0);
      seen.add(canvas.toDataURL());
    }
    return {frameCount, animated, size, different: seen.size};
  })()`);
  check(got.frameCount === 11 && got.animated && got.size === '320x120' && got.different >= 10, `moving picture: ${JSON.stringify(got)}`);
  await page.close();
}

for (const part of [check_one, check_two, check_humanoid, check_pictures])
  await part().catch(error => check(false, `${part.name}: ${error.message}`));
await browser.close();
console.log(`${checks} checks, ${failed} failed`);
process.exit(failed ? 1 : 0);
