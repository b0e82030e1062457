// A page in headless Chromium, driven over the pipe of its DevTools protocol: no package is needed, node and chromium alone.
// Used by problems/picture.mjs and tests/test_page.mjs.
import {spawn} from 'node:child_process';
import {mkdtempSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';

/** Starts the browser. Returns an object that opens pages: open(url, {width, height, scale, dark, touch}), close(). */
export async function start(program = process.env.CHROMIUM || 'chromium') {
  const home = mkdtempSync(join(tmpdir(), 'cavort-chromium-'));
  const flags = ['--headless', '--no-sandbox', '--disable-gpu-sandbox', '--use-gl=angle', '--use-angle=swiftshader',
    '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist', '--hide-scrollbars', '--no-first-run', '--disable-extensions',
    '--remote-debugging-pipe', `--user-data-dir=${home}`, 'about:blank'];
  const browser = spawn(program, flags, {stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe']});
  const ended = new Promise(resolve => { browser.on('exit', resolve); browser.on('error', resolve); });
  const waiting = new Map(), listeners = [];
  let next = 1, rest = '', gone = false;
  ended.then(() => {
    gone = true;
    for (const {reject} of waiting.values()) reject(new Error(`${program} ended`));
  });
  browser.stdio[3].on('error', () => {});
  browser.stdio[4].on('data', data => {
    rest += data;
    for (let end = rest.indexOf('\0'); end >= 0; end = rest.indexOf('\0')) {
      const message = JSON.parse(rest.slice(0, end));
      rest = rest.slice(end + 1);
      const call = waiting.get(message.id);
      if (call) {
        waiting.delete(message.id);
        if (message.error) call.reject(new Error(`${call.method}: ${message.error.message}`));
        else call.resolve(message.result);
      } else {
        for (const listener of listeners) listener(message);
      }
    }
  });
  const send = (method, params = {}, sessionId = undefined) => new Promise((resolve, reject) => {
    if (gone) { reject(new Error(`${program} ended`)); return; }
    waiting.set(next, {resolve, reject, method});
    browser.stdio[3].write(JSON.stringify({id: next++, method, params, sessionId}) + '\0');
  });

  async function open(url, {width = 1200, height = 760, scale = 1, dark = false, touch = false} = {}) {
    const {targetId} = await send('Target.createTarget', {url: 'about:blank'});
    const {sessionId} = await send('Target.attachToTarget', {targetId, flatten: true});
    const call = (method, params) => send(method, params, sessionId);
    const problems = [];
    let loaded;
    const ready = new Promise(resolve => { loaded = resolve; });
    listeners.push(message => {
      if (message.sessionId !== sessionId) return;
      const {method, params} = message;
      if (method === 'Page.loadEventFired') loaded();
      if (method === 'Runtime.exceptionThrown') problems.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
      if (method === 'Log.entryAdded' && params.entry.level === 'error') problems.push(params.entry.text);
    });
    for (const domain of ['Page', 'Runtime', 'Log']) await call(`${domain}.enable`);
    await call('Emulation.setDeviceMetricsOverride', {width, height, deviceScaleFactor: scale, mobile: touch});
    await call('Emulation.setEmulatedMedia', {features: [{name: 'prefers-color-scheme', value: dark ? 'dark' : 'light'}]});
    if (touch) await call('Emulation.setTouchEmulationEnabled', {enabled: true});
    await call('Page.navigate', {url});
    await ready;

    const page = {
      problems,  // what the page threw or logged as an error
      /** Value of an expression in the page, awaited there. */
      async value(expression) {
        const answer = await call('Runtime.evaluate', {expression, awaitPromise: true, returnByValue: true, userGesture: true});
        if (answer.exceptionDetails) throw new Error(answer.exceptionDetails.exception?.description ?? answer.exceptionDetails.text);
        return answer.result.value;
      },
      async mouse(type, x, y, more = {}) {
        await call('Input.dispatchMouseEvent', {type, x, y, button: type === 'mouseMoved' ? 'none' : 'left', clickCount: 1, ...more});
      },
      /** Clicks the middle of the first element of a selector, which has to be seen there. */
      async click(selector) {
        const at = await page.value(`(() => {
          const element = document.querySelector(${JSON.stringify(selector)});
          if (!element) return null;
          element.scrollIntoView({block: 'nearest'});
          const box = element.getBoundingClientRect(), x = box.left + box.width / 2, y = box.top + box.height / 2;
          const seen = document.elementFromPoint(x, y);
          return {x, y, seen: !!seen && (element.contains(seen) || seen.contains(element))};
        })()`);
        if (!at) throw new Error(`no element ${selector}`);
        if (!at.seen) throw new Error(`${selector} is covered or outside the window`);
        await page.mouse('mousePressed', at.x, at.y);
        await page.mouse('mouseReleased', at.x, at.y);
      },
      async key(key, code = key) {
        const text = key.length === 1 ? key : undefined;
        await call('Input.dispatchKeyEvent', {type: 'keyDown', key, code, text});
        await call('Input.dispatchKeyEvent', {type: 'keyUp', key, code});
      },
      /** The window as it is, PNG. */
      async picture() {
        return Buffer.from((await call('Page.captureScreenshot', {format: 'png'})).data, 'base64');
      },
      close: () => send('Target.closeTarget', {targetId}),
      call,
    };
    return page;
  }

  return {
    open,
    async close() {
      await send('Browser.close').catch(() => {});
      await ended;
      rmSync(home, {recursive: true, force: true, maxRetries: 5});
    },
  };
}
