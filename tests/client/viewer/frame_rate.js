// Measures how often a page of `isomatch view` is drawn while a person turns it.
//
//   node frame_rate.js ISOMATCH [VERTICES] [SECONDS]
//
// Draws two sample shapes of so many vertices (200000), mapped by their truth, in
// headless Chromium, where the processor draws, drags for so many seconds (6), and
// prints frames a second. Waits for what is drawn, not for what was only asked for.
import {execFileSync} from 'node:child_process';
import {mkdtempSync, rmSync, statSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {pathToFileURL} from 'node:url';
import {findChromium, Page} from './chromium.js';

const WINDOW = {width: 1400, height: 1000};
/** Between two moves of the pointer, which are not drawn one by one. */
const MOVE_MILLISECONDS = 16;

/** Counts frames in which anything is drawn, and can wait for the last one. */
const COUNTER = `(() => {
  const seen = {frames: 0, last: -1, context: null};
  const {prototype} = WebGL2RenderingContext;
  const {drawElements} = prototype;
  let task = 0;
  const tick = () => { ++task; requestAnimationFrame(tick); };
  requestAnimationFrame(tick);
  prototype.drawElements = function(...args) {
    if (seen.last !== task) { ++seen.frames; seen.last = task; }
    seen.context = this;
    return drawElements.apply(this, args);
  };
  globalThis.frames = {
    count: () => seen.frames,
    wait: () => seen.context.readPixels(0, 0, 1, 1, 6408, 5121, new Uint8Array(4)),
  };
})()`;

function makePage(isomatch, folder, vertices) {
  const file = (name) => join(folder, name);
  const run = (...args) => execFileSync(isomatch, args, {stdio: ['ignore', 'ignore', 'inherit']});
  run('sample', '--pose', 'A', '--vertices', vertices, '-o', file('a.ply'));
  run('sample', '--pose', 'B', '--vertices', vertices, '-o', file('b.ply'),
      '--truth-from', `A:${vertices}`, '--truth', file('map.txt'));
  run('view', file('a.ply'), file('b.ply'), file('map.txt'), '-o', file('page.html'));
  return file('page.html');
}

/** Drags in circles for so many seconds; returns frames a second. */
async function turn(page, seconds) {
  const {x, y, width, height} = await page.box('#pane-x');
  const at = (angle) => [x + width / 2 + 80 * Math.cos(angle), y + height / 2 + 40 * Math.sin(angle)];
  const held = {button: 'left', buttons: 1};
  await page.mouse('mousePressed', ...at(0), {...held, clickCount: 1});
  // What the first move makes, such as a coarser mesh, is not a frame.
  await page.mouse('mouseMoved', ...at(0.1), held);
  await page.drawn();
  await page.evaluate('frames.wait()');
  const before = await page.evaluate('frames.count()');
  const begin = performance.now();
  for (let i = 0; performance.now() - begin < 1000 * seconds; ++i) {
    await page.mouse('mouseMoved', ...at(0.1 + i / 30), held);
    await new Promise((resolve) => setTimeout(resolve, MOVE_MILLISECONDS));
  }
  await page.evaluate('frames.wait()');
  const rate = 1000 * (await page.evaluate('frames.count()') - before) / (performance.now() - begin);
  await page.mouse('mouseReleased', ...at(0), {button: 'left', clickCount: 1});
  return rate;
}

async function main() {
  const [isomatch, vertices = '200000', seconds = '6'] = process.argv.slice(2);
  const chromium = findChromium();
  if (!isomatch || !chromium) {
    console.error(chromium ? 'usage: node frame_rate.js ISOMATCH [VERTICES] [SECONDS]' :
        'no chromium in PATH; scripts/test installs it');
    return 2;
  }
  const folder = mkdtempSync(join(tmpdir(), 'isomatch_frames_'));
  const page = await Page.open(chromium, join(folder, 'profile'), WINDOW);
  try {
    const address = makePage(isomatch, folder, vertices);
    await page.send('Page.addScriptToEvaluateOnNewDocument', {source: COUNTER});
    const begin = performance.now();
    await page.send('Page.navigate', {url: pathToFileURL(address).href});
    await page.until("document.body?.dataset.ready === 'true'");
    await page.drawn();
    await page.evaluate('frames.wait()');
    const opened = (performance.now() - begin) / 1000;
    const rate = await turn(page, Number(seconds));
    const mebibytes = statSync(address).size / 2 ** 20;
    console.log(`2 x ${vertices} vertices, a page of ${mebibytes.toFixed(1)} MiB: ` +
        `open after ${opened.toFixed(1)} s, ${rate.toFixed(1)} frames a second while turned`);
  } finally {
    await page.close();
    rmSync(folder, {recursive: true, force: true});
  }
  return 0;
}

process.exit(await main());
