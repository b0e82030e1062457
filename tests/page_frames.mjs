// Frames of a playing page in headless Chromium without a graphics processor: intervals between them over four seconds. By hand, on
// a quiet machine. Usage: node tests/page_frames.mjs VIEW.html...
import {realpathSync} from 'node:fs';
import {start} from '../problems/chromium.mjs';

const browser = await start();
for (const file of process.argv.slice(2)) {
  const page = await browser.open('file://' + realpathSync(file), {width: 1200, height: 800});
  const intervals = await page.value(`new Promise(resolve => {
    const at = [];
    const frame = time => { at.push(time); if (time - at[0] < 4000) requestAnimationFrame(frame); else resolve(at); };
    setTimeout(() => requestAnimationFrame(frame), 1500);
  }).then(at => at.slice(1).map((t, i) => t - at[i]))`);
  intervals.sort((a, b) => a - b);
  const part = (x) => intervals[Math.min(intervals.length - 1, Math.floor(x * intervals.length))].toFixed(0);
  console.log(`${file}: ${(intervals.length / 4).toFixed(1)} frames/s, interval median ${part(0.5)} ms, 95 % ${part(0.95)} ms, longest ${part(1)} ms`);
}
await browser.close();
