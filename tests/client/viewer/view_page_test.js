// Opens a page of `isomatch view` in headless Chromium, as a person would.
//
//   node view_page_test.js ISOMATCH FOLDER
//
// FOLDER gets the sample pair, the page and its screenshots.
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {readFileSync, statSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {pathToFileURL} from 'node:url';
import {
  away, difference, drawing, found, overPane, run, shapeBox, tints, withPage,
} from './page_support.js';

const WINDOW = {width: 1400, height: 1000};
const [isomatch, folder] = process.argv.slice(2);
const file = (name) => join(folder, name);

function makePage() {
  const isomatchRuns = (...args) => execFileSync(isomatch, args, {stdio: ['ignore', 'ignore', 'inherit']});
  isomatchRuns('sample', '--pose', 'A', '--vertices', '3000', '-o', file('a.off'));
  isomatchRuns('sample', '--pose', 'B', '--vertices', '2000', '-o', file('b.off'),
      '--truth-from', 'A:3000', '--truth', file('truth.txt'));
  isomatchRuns('match', file('a.off'), file('b.off'), '-o', file('map.txt'), '--report', file('report.json'),
      '--confidence', file('confidence.txt'), '--precise', file('places.txt'), '--no-progress');
  // One vertex without an image.
  const map = readFileSync(file('map.txt'), 'utf8').trim().split('\n').map(Number);
  map[7] = -1;
  writeFileSync(file('map.txt'), `${map.join('\n')}\n`);
  isomatchRuns('view', file('a.off'), file('b.off'), file('map.txt'), '-o', file('page.html'),
      '--confidence', file('confidence.txt'), '--truth', file('truth.txt'),
      '--report', file('report.json'));
  return map;
}

const checks = {
  async 'both shapes are drawn in many colors'({page}) {
    for (const side of ['x', 'y']) {
      const {covered, colors} = drawing(await page.pixels(await shapeBox(page, side)));
      assert.ok(covered > 0.08 && covered < 0.8, `${side} covers ${covered}`);
      assert.ok(colors > 1000, `${side} has ${colors} colors`);
    }
  },

  async 'pointing at X marks the image on Y'({page, map}) {
    let hits = 0;
    await overPane(page, 'x', async (x, y) => {
      await page.hover(x, y);
      const text = await found(page);
      const match = /^X (\d+) \u2192 (?:Y (\d+)|no counterpart)/.exec(text);
      if (!match) return false;
      ++hits;
      assert.equal(Number(match[2] ?? -1), map[Number(match[1])], text);
      return hits === 12;
    });
    assert.equal(hits, 12, `${hits} points hit X`);
  },

  async 'the mark is under the pointer'({page}) {
    const box = await page.box('#pane-x');
    await away(page);
    const before = await page.pixels(await shapeBox(page, 'x'));
    let tried = 0;
    await overPane(page, 'x', async (x, y) => {
      await page.hover(x, y);
      if (!/^X/.test(await found(page))) return false;
      ++tried;
      const area = await shapeBox(page, 'x');
      const mark = difference(before, await page.pixels(area));
      assert.ok(mark.changed > 20, `${mark.changed} pixels changed`);
      const distance = Math.hypot(mark.x + Math.round(area.x) - x, mark.y + Math.round(area.y) - y);
      assert.ok(distance < 0.05 * box.width, `the mark is ${distance} pixels away`);
      return tried === 3;
    });
    assert.equal(tried, 3);
  },

  async 'pointing at Y marks all that go there'({page, map}) {
    let several = 0;
    await overPane(page, 'y', async (x, y) => {
      await page.hover(x, y);
      const text = await found(page);
      const match = /^Y (\d+) \u2190 (?:X ([\d, ]+)(?: and (\d+) more)?|no vertex of X)/.exec(text);
      if (!match) return false;
      const expected = map.flatMap((image, from) => image === Number(match[1]) ? [from] : []);
      const named = match[2] ? match[2].split(', ').map(Number) : [];
      assert.deepEqual(named, expected.slice(0, 8), text);
      assert.equal(named.length + Number(match[3] ?? 0), expected.length, text);
      if (expected.length > 1) ++several;
      return several === 3;
    });
    assert.equal(several, 3, `${several} points with more than one vertex of X`);
  },

  async 'a vertex can be chosen by number'({page, map}) {
    await away(page);
    const before = await page.pixels(await shapeBox(page, 'y'));
    await page.evaluate("document.getElementById('vertex-x').select()");
    for (const key of '123') await page.press(key);
    assert.match(await found(page), new RegExp(`^X 123 \u2192 Y ${map[123]} `));
    const mark = difference(before, await page.pixels(await shapeBox(page, 'y')));
    assert.ok(mark.changed > 20, `${mark.changed} pixels changed`);
    assert.equal(await page.evaluate("document.getElementById('vertex-y').value"), `${map[123]}`);
    writeFileSync(file('page_chosen.png'), Buffer.from(await page.screenshot(), 'base64'));
    await page.evaluate(`{ const input = document.getElementById('vertex-x');
      input.value = 7; input.dispatchEvent(new Event('input')); }`);
    assert.match(await found(page), /^X 7 \u2192 no counterpart/);
  },

  async 'layers switch'({page}) {
    await away(page);
    let last = await page.pixels(await shapeBox(page, 'x'));
    for (const layer of ['distortion', 'confidence', 'error', 'colors']) {
      await page.click(`label:has([value=${layer}])`);
      assert.equal(await page.evaluate('document.body.dataset.layer'), layer);
      const now = await page.pixels(await shapeBox(page, 'x'));
      const {changed} = difference(last, now);
      assert.ok(changed > 5000, `${layer} changes ${changed} pixels`);
      last = now;
      // The background is one, and so would be a single color of a scale.
      if (layer !== 'distortion') assert.ok(tints(now) > 3, `${layer} has ${tints(now)} tints`);
      const hidden = await page.evaluate("document.getElementById('scale').hidden");
      assert.equal(hidden, layer === 'colors');
      writeFileSync(file(`page_${layer}.png`), Buffer.from(await page.screenshot(), 'base64'));
    }
  },

  async 'patterns are drawn'({page}) {
    await away(page);
    const plain = await page.pixels(await shapeBox(page, 'x'));
    const shots = [];
    for (const pattern of ['stripes', 'checker', 'plain']) {
      await page.evaluate(`{ const select = document.getElementById('pattern');
        select.value = '${pattern}'; select.dispatchEvent(new Event('change', {bubbles: true})); }`);
      await page.drawn();
      shots.push(await page.pixels(await shapeBox(page, 'x')));
      writeFileSync(file(`page_${pattern}.png`), Buffer.from(await page.screenshot(), 'base64'));
    }
    assert.ok(difference(plain, shots[0]).changed > 3000);
    assert.ok(difference(shots[0], shots[1]).changed > 3000);
    assert.equal(difference(plain, shots[2]).changed, 0);
  },

  async 'keys turn both shapes, or one when they are not linked'({page}) {
    const shots = async () => [await page.pixels(await shapeBox(page, 'x')),
                               await page.pixels(await shapeBox(page, 'y'))];
    const changes = (a, b) => a.map((shot, i) => difference(shot, b[i]).changed > 500);
    await away(page);
    const first = await shots();
    await page.evaluate("document.getElementById('pane-x').focus()");
    for (let i = 0; i < 6; ++i) await page.press('ArrowRight');
    const turned = await shots();
    assert.deepEqual(changes(first, turned), [true, true]);
    await page.click('#linked');
    await page.evaluate("document.getElementById('pane-y').focus()");
    for (let i = 0; i < 6; ++i) await page.press('+');
    assert.deepEqual(changes(turned, await shots()), [false, true]);
    await page.click('#linked');
    await page.click('#reset');
    assert.deepEqual(changes(first, await shots()), [false, false]);
  },

  async 'dragging turns both shapes'({page}) {
    await away(page);
    const before = await page.pixels(await shapeBox(page, 'y'));
    const {x, y, width, height} = await page.box('#pane-x');
    const at = {x: x + width / 2, y: y + height / 2};
    await page.mouse('mousePressed', at.x, at.y, {button: 'left', buttons: 1, clickCount: 1});
    await page.mouse('mouseMoved', at.x + 120, at.y, {button: 'left', buttons: 1});
    await page.mouse('mouseReleased', at.x + 120, at.y, {button: 'left', clickCount: 1});
    await page.drawn();
    assert.ok(difference(before, await page.pixels(await shapeBox(page, 'y'))).changed > 500);
    await page.click('#reset');
  },

  async 'histograms and figures are there'({page}) {
    const report = JSON.parse(readFileSync(file('report.json'), 'utf8'));
    assert.equal(await page.evaluate("document.querySelectorAll('#histograms svg').length"), 3);
    assert.ok(await page.evaluate("document.querySelectorAll('#histogram-distortion rect').length") > 20);
    const text = await page.evaluate("document.getElementById('figures').innerText");
    assert.match(text, /vertices of X with an image\s+2,999 of 3,000/);
    assert.ok(text.includes(`${report.total_seconds.toFixed(2)} s`), text);
    assert.match(text, /mean \/ diameter of Y\s+0\.0\d+/);
  },

  async 'it is readable in the dark and on a narrow screen'({page}) {
    const background = () => page.evaluate('getComputedStyle(document.body).backgroundColor');
    const light = await background();
    await page.send('Emulation.setEmulatedMedia',
        {features: [{name: 'prefers-color-scheme', value: 'dark'}]});
    assert.notEqual(await background(), light);
    await page.drawn();
    writeFileSync(file('page_dark.png'), Buffer.from(await page.screenshot(), 'base64'));
    await page.send('Emulation.setDeviceMetricsOverride',
        {width: 400, height: 900, deviceScaleFactor: 1, mobile: true});
    await page.drawn();
    assert.equal(await page.evaluate('document.documentElement.scrollWidth'), 400);
    writeFileSync(file('page_narrow.png'), Buffer.from(await page.screenshot(), 'base64'));
  },

  async 'nothing was asked of the network and nothing went wrong'({page, address}) {
    assert.deepEqual(page.problems, []);
    const outside = page.requests.filter((url) => url !== address && !url.startsWith('data:'));
    assert.deepEqual(outside, []);
    assert.ok(page.requests.includes(address));
  },
};

/** A map of places between vertices: colors and marks follow them. */
async function openPrecise(page) {
  execFileSync(isomatch, ['view', file('a.off'), file('b.off'), file('places.txt'), '-o',
    file('precise.html')], {stdio: ['ignore', 'ignore', 'inherit']});
  await page.send('Page.navigate', {url: pathToFileURL(file('precise.html')).href});
  await page.until("document.body?.dataset.ready === 'true' && document.title.includes('a.off')");
  await page.drawn();
  const {colors} = drawing(await page.pixels(await shapeBox(page, 'x')));
  assert.ok(colors > 1000, `X has ${colors} colors`);
  const places = readFileSync(file('places.txt'), 'utf8').trim().split('\n')
      .map((line) => line.split(' ').map(Number));
  const between = places.findIndex(([, ...weights]) => weights.every((weight) => weight > 0.1));
  await page.evaluate(`{ const input = document.getElementById('vertex-x');
    input.value = ${between}; input.dispatchEvent(new Event('input')); }`);
  const text = await found(page);
  const match = /^X (\d+) \u2192 between Y ((?:\d+ \(0\.\d\d\)(?:, )?){3})/.exec(text);
  assert.ok(match, text);
  const weights = [...match[2].matchAll(/\((0\.\d\d)\)/g)].map(([, weight]) => Number(weight));
  assert.deepEqual(weights.sort(),
      places[between].slice(1).map((weight) => Number(weight.toFixed(2))).sort());
  assert.deepEqual(page.problems, []);
}

/** How many pixels have hardly any tint and are not of the background. */
function grays({rgb}) {
  let count = 0;
  for (let i = 0; i < rgb.length; i += 3) {
    const [r, g, b] = rgb.subarray(i, i + 3);
    if (Math.max(r, g, b) - Math.min(r, g, b) < 6 && r < 235) ++count;
  }
  return count;
}

/** Of two parts: what has no counterpart is gray, said so, and stays with the rest. */
async function openParts(page, wholeMap) {
  const positions = readFileSync(file('a.off'), 'utf8').split('\n').slice(2, 3002)
      .map((line) => line.split(' ').map(Number));
  const middle = positions.map(([x]) => x).sort((a, b) => a - b)[1500];
  const map = wholeMap.map((y, x) => positions[x][0] < middle ? -1 : y);
  const reached = new Set(map);
  const mask = Array.from({length: 2000}, (_, y) => Number(reached.has(y)));
  // The rim's and other single vertices beside those that are reached.
  const without = mask.indexOf(0);
  const confidence = map.map((y) => y < 0 ? 0 : 0.75);
  for (const [name, lines] of Object.entries({parts: map, mask, parts_confidence: confidence})) {
    writeFileSync(file(`${name}.txt`), `${lines.join('\n')}\n`);
  }
  await page.send('Emulation.setEmulatedMedia', {features: []});
  await page.send('Emulation.setDeviceMetricsOverride', {...WINDOW, deviceScaleFactor: 1, mobile: false});
  await page.drawn();
  const colored = {x: await page.pixels(await shapeBox(page, 'x')), y: await page.pixels(await shapeBox(page, 'y'))};
  execFileSync(isomatch, ['view', file('a.off'), file('b.off'), file('parts.txt'), '-o',
    file('parts.html'), '--mask-y', file('mask.txt'), '--confidence', file('parts_confidence.txt'),
    '--title', 'Two parts'], {stdio: ['ignore', 'ignore', 'inherit']});
  await page.send('Page.navigate', {url: pathToFileURL(file('parts.html')).href});
  await page.until("document.body?.dataset.ready === 'true' && document.title.includes('Two parts')");
  await page.drawn();
  writeFileSync(file('page_parts.png'), Buffer.from(await page.screenshot(), 'base64'));
  const gone = map.filter((y) => y < 0).length;
  const text = (id) => page.evaluate(`document.getElementById('${id}').innerText`);
  for (const layer of ['colors', 'confidence', 'distortion']) {
    await page.click(`label:has([value=${layer}])`);
    const legend = await text('gray');
    assert.match(legend, new RegExp(`Gray: no counterpart \\(${gone.toLocaleString('en-US')} vertices of X, ` +
        `${mask.filter((has) => !has).length.toLocaleString('en-US')} of Y\\)`));
    if (layer === 'distortion') continue;  // its middle is gray, too
    for (const side of ['x', 'y']) {
      const shot = await page.pixels(await shapeBox(page, side));
      const share = grays(shot) / (drawing(shot).covered * shot.rgb.length / 3);
      const before = grays(colored[side]) / (drawing(colored[side]).covered * colored[side].rgb.length / 3);
      assert.ok(share > 0.2 && share < 0.8 && before < 0.1,
          `${share} of ${side} is gray in ${layer}, ${before} of a whole map`);
    }
  }
  await page.click('label:has([value=colors])');
  // Statistics are of the others.
  assert.match(await text('histogram-confidence'),
      new RegExp(`${(3000 - gone).toLocaleString('en-US')} vertices of X: mean 0\\.75`));
  const choose = (side, vertex) => page.evaluate(`{ const input = document.getElementById('vertex-${side}');
    input.value = ${vertex}; input.dispatchEvent(new Event('input')); }`);
  await choose('x', map.indexOf(-1));
  assert.equal(await found(page), `X ${map.indexOf(-1)} \u2192 no counterpart`);
  await choose('y', without);
  assert.equal(await found(page), `Y ${without} \u2190 no counterpart`);
  // A pin on gray is warned of.
  await page.click('#pin');
  const warned = [];
  await overPane(page, 'x', async (x, y) => {
    await page.hover(x, y);
    const match = /^X (\d+) \u2192 no counterpart/.exec(await found(page));
    if (!match) return false;
    await page.mouse('mousePressed', x, y, {button: 'left', clickCount: 1});
    await page.mouse('mouseReleased', x, y, {button: 'left', clickCount: 1});
    warned.push(match[1]);
    return true;
  });
  assert.ok((await text('pin-status')).startsWith(`X ${warned[0]} has no counterpart by the map. Pin 1:`));
  await page.click('#pin');
  // Half way and at its end the gray part hangs on the other: nothing flies to a point.
  const shape = async () => drawing(await page.pixels(await shapeBox(page, 'x'))).covered;
  const whole = await shape();
  for (const part of [0.5, 1]) {
    await page.evaluate(`{ const slider = document.getElementById('morph');
      slider.value = ${part}; slider.dispatchEvent(new Event('input', {bubbles: true})); }`);
    await page.drawn();
    const now = await shape();
    assert.ok(Math.abs(now / whole - 1) < 0.2, `${now} is covered at ${part}, ${whole} before`);
    writeFileSync(file(`page_parts_${part}.png`), Buffer.from(await page.screenshot(), 'base64'));
  }
  assert.deepEqual(page.problems, []);
}

const LARGE = 60000;

/** While it moves, few faces are drawn, which look much as all do; then all. */
async function movesCoarse(page) {
  const drawn = () => page.evaluate('document.body.dataset.drawn');
  await page.until("document.body.dataset.drawn === 'fine'");
  const {x, y, width, height} = await page.box('#pane-y');
  const at = [x + width / 2, y + height / 2];
  const fine = await page.pixels(await shapeBox(page, 'x'));
  const held = {button: 'left', buttons: 1};
  await page.mouse('mousePressed', ...at, {...held, clickCount: 1});
  await page.mouse('mouseMoved', at[0] + 3, at[1], held);
  await page.mouse('mouseMoved', ...at, held);
  await page.drawn();
  assert.equal(await drawn(), 'coarse');
  const coarse = await page.pixels(await shapeBox(page, 'x'));
  const {changed} = difference(fine, coarse);
  const {covered} = drawing(fine);
  assert.ok(changed > 0 && changed < 0.15 * covered * fine.rgb.length / 3, `${changed} pixels differ`);
  await page.mouse('mouseReleased', ...at, {button: 'left', clickCount: 1});
  await page.until("document.body.dataset.drawn === 'fine'");
  await page.drawn();
  assert.equal(difference(fine, await page.pixels(await shapeBox(page, 'x'))).changed, 0);
}

/** Draws a page of two large shapes, mapped by their truth; prints how long it took. */
async function openLarge(page) {
  const isomatchRuns = (...args) => execFileSync(isomatch, args, {stdio: ['ignore', 'ignore', 'inherit']});
  isomatchRuns('sample', '--pose', 'A', '--vertices', `${LARGE}`, '-o', file('large_a.ply'));
  isomatchRuns('sample', '--pose', 'B', '--vertices', `${LARGE}`, '-o', file('large_b.ply'),
      '--truth-from', `A:${LARGE}`, '--truth', file('large_map.txt'));
  isomatchRuns('view', file('large_a.ply'), file('large_b.ply'), file('large_map.txt'), '-o',
      file('large.html'));
  const begin = Date.now();
  await page.send('Page.navigate', {url: pathToFileURL(file('large.html')).href});
  await page.until("document.body?.dataset.ready === 'true' && document.title.includes('large_a')");
  await page.drawn();
  const mebibytes = statSync(file('large.html')).size / 2 ** 20;
  console.log(`a page of 2 x ${LARGE} vertices, ${mebibytes.toFixed(1)} MiB, is drawn after ` +
      `${((Date.now() - begin) / 1000).toFixed(1)} s`);
  for (const side of ['x', 'y']) {
    const {covered, colors} = drawing(await page.pixels(await shapeBox(page, side)));
    assert.ok(covered > 0.08 && covered < 0.8, `${side} covers ${covered}`);
    assert.ok(colors > 1000, `${side} has ${colors} colors`);
  }
  await movesCoarse(page);
  assert.deepEqual(page.problems, []);
}

process.exit(await withPage(folder, WINDOW, async (page) => {
  const map = makePage();
  const address = pathToFileURL(file('page.html')).href;
  await page.send('Page.navigate', {url: address});
  await page.until("document.body?.dataset.ready === 'true'");
  await page.drawn();
  writeFileSync(file('page.png'), Buffer.from(await page.screenshot(), 'base64'));
  return run({
    ...checks,
    'a precise map is shown where it is': ({page}) => openPrecise(page),
    'what has no counterpart is gray': ({page, map}) => openParts(page, map),
    'a large page opens, and moves coarse': ({page}) => openLarge(page),
  }, {page, map, address});
}));
