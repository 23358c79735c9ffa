// Drives headless Chromium by its DevTools protocol over a pipe.
import {spawn} from 'node:child_process';
import {accessSync, constants} from 'node:fs';
import {delimiter, join} from 'node:path';

const FLAGS = [
  '--headless=new', '--no-sandbox', '--remote-debugging-pipe', '--no-first-run',
  '--disable-dev-shm-usage', '--disable-gpu-sandbox', '--hide-scrollbars',
  '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
  '--disable-background-networking', '--disable-component-update', '--disable-sync',
];
const ANSWER_MILLISECONDS = 60_000;

/** The browser's program; null when there is none. */
export function findChromium() {
  for (const folder of process.env.PATH.split(delimiter)) {
    try {
      accessSync(join(folder, 'chromium'), constants.X_OK);
      return join(folder, 'chromium');
    } catch { /* not in this folder */ }
  }
  return null;
}

/** The protocol: commands get answers, events go to listeners. */
class Connection {
  constructor(output, input) {
    this.output = output;
    this.answers = new Map();
    this.listeners = new Map();
    this.next = 1;
    let pending = Buffer.alloc(0);
    input.on('data', (bytes) => {
      pending = Buffer.concat([pending, bytes]);
      for (let end; (end = pending.indexOf(0)) >= 0; pending = pending.subarray(end + 1)) {
        this.receive(JSON.parse(pending.subarray(0, end).toString()));
      }
    });
  }

  receive({id, method, params, result, error}) {
    if (method) return this.listeners.get(method)?.(params);
    const {resolve, reject} = this.answers.get(id);
    this.answers.delete(id);
    return error ? reject(new Error(error.message)) : resolve(result);
  }

  send(method, params = {}, sessionId = undefined) {
    const id = this.next++;
    this.output.write(`${JSON.stringify({id, method, params, sessionId})}\0`);
    return new Promise((resolve, reject) => {
      const timer = setTimeout(() => reject(new Error(`${method}: no answer`)), ANSWER_MILLISECONDS);
      const settle = (f) => (value) => { clearTimeout(timer); f(value); };
      this.answers.set(id, {resolve: settle(resolve), reject: settle(reject)});
    });
  }
}

/** One page in a browser of its own. `problems` and `requests` fill as they come. */
export class Page {
  static async open(program, profile, {width, height}) {
    const browser = spawn(program, [...FLAGS, `--user-data-dir=${profile}`, 'about:blank'],
        {stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe']});
    const connection = new Connection(browser.stdio[3], browser.stdio[4]);
    const page = new Page(browser, connection);
    const {targetInfos} = await connection.send('Target.getTargets');
    const {targetId} = targetInfos.find(({type}) => type === 'page');
    ({sessionId: page.session} = await connection.send(
        'Target.attachToTarget', {targetId, flatten: true}));
    page.listen();
    for (const domain of ['Page', 'Runtime', 'Log', 'Network']) await page.send(`${domain}.enable`);
    await page.send('Emulation.setDeviceMetricsOverride',
        {width, height, deviceScaleFactor: 1, mobile: false});
    return page;
  }

  constructor(browser, connection) {
    this.browser = browser;
    this.connection = connection;
    this.problems = [];
    this.requests = [];
  }

  listen() {
    const on = (event, act) => this.connection.listeners.set(event, act);
    on('Runtime.exceptionThrown', ({exceptionDetails}) => this.problems.push(exceptionDetails.text));
    on('Runtime.consoleAPICalled', ({type, args}) => {
      if (['error', 'warning', 'assert'].includes(type)) {
        this.problems.push(args.map(({value, description}) => value ?? description).join(' '));
      }
    });
    on('Log.entryAdded', ({entry}) => {
      if (entry.level !== 'info' && entry.level !== 'verbose') this.problems.push(entry.text);
    });
    on('Network.requestWillBeSent', ({request}) => this.requests.push(request.url));
  }

  send(method, params) { return this.connection.send(method, params, this.session); }

  async evaluate(expression) {
    const {result, exceptionDetails} = await this.send(
        'Runtime.evaluate', {expression, awaitPromise: true, returnByValue: true});
    if (exceptionDetails) throw new Error(exceptionDetails.exception.description);
    return result.value;
  }

  /** Waits until an expression is true. */
  async until(expression, milliseconds = 60_000) {
    const end = Date.now() + milliseconds;
    while (!await this.evaluate(expression)) {
      if (Date.now() > end) throw new Error(`never true: ${expression}`);
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
  }

  /** Resolves when what is due now has been drawn. */
  async drawn() {
    await this.evaluate('new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))');
  }

  async box(selector) {
    return this.evaluate(`(({x, y, width, height}) => ({x, y, width, height}))(
        document.querySelector('${selector}').getBoundingClientRect())`);
  }

  async mouse(type, x, y, more = {}) {
    await this.send('Input.dispatchMouseEvent', {type, x, y, ...more});
  }

  async hover(x, y) {
    await this.mouse('mouseMoved', x, y);
    await this.drawn();
  }

  async click(selector) {
    const {x, y, width, height} = await this.box(selector);
    const button = {button: 'left', clickCount: 1};
    await this.mouse('mousePressed', x + width / 2, y + height / 2, button);
    await this.mouse('mouseReleased', x + width / 2, y + height / 2, button);
    await this.drawn();
  }

  async press(key) {
    const text = key.length === 1 ? key : key === 'Enter' ? '\r' : undefined;
    await this.send('Input.dispatchKeyEvent', {type: 'keyDown', key, code: key, text});
    await this.send('Input.dispatchKeyEvent', {type: 'keyUp', key, code: key});
    await this.drawn();
  }

  /** Fingers on the way from one place to another: [[from, to], ...], places {x, y}. */
  async swipe(fingers, steps = 10) {
    const at = (part) => fingers.map(([from, to], id) => ({id,
      x: from.x + part * (to.x - from.x), y: from.y + part * (to.y - from.y)}));
    await this.send('Input.dispatchTouchEvent', {type: 'touchStart', touchPoints: at(0)});
    for (let i = 1; i <= steps; ++i) {
      await this.send('Input.dispatchTouchEvent', {type: 'touchMove', touchPoints: at(i / steps)});
      await this.drawn();
    }
    await this.send('Input.dispatchTouchEvent', {type: 'touchEnd', touchPoints: []});
    await this.drawn();
  }

  /** A PNG as base64, of the whole page or of a box. */
  async screenshot(box) {
    const clip = box && {...box, scale: 1};
    const {data} = await this.send('Page.captureScreenshot',
        {format: 'png', clip, captureBeyondViewport: !box});
    return data;
  }

  /** The red, green and blue of a box's pixels, row by row, and its width. */
  async pixels(box) {
    const whole = Object.fromEntries(Object.entries(box).map(([k, v]) => [k, Math.round(v)]));
    const png = await this.screenshot(whole);
    const text = await this.evaluate(`(async () => {
      const bytes = Uint8Array.from(atob('${png}'), (c) => c.charCodeAt(0));
      const image = await createImageBitmap(new Blob([bytes], {type: 'image/png'}));
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
      context.drawImage(image, 0, 0);
      const {data} = context.getImageData(0, 0, image.width, image.height);
      let text = '';
      for (let i = 0; i < data.length; i += 4) {
        text += String.fromCharCode(data[i], data[i + 1], data[i + 2]);
      }
      return btoa(text);
    })()`);
    return {width: whole.width, rgb: Buffer.from(text, 'base64')};
  }

  async close() {
    const gone = new Promise((resolve) => this.browser.once('exit', resolve));
    this.connection.send('Browser.close').catch(() => {});
    await gone;
  }
}
