// Opens what `isomatch view FOLDER` makes of a batch, in headless Chromium.
//
//   node view_folder_test.js ISOMATCH FOLDER
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {existsSync, mkdirSync, readFileSync, rmSync, statSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {pathToFileURL} from 'node:url';
import {drawing, run, withPage} from './page_support.js';

const WINDOW = {width: 1400, height: 900};
/** As many as a study has, of that many vertices. */
const MANY = 100;
const MANY_VERTICES = 5000;
const [isomatch, folder] = process.argv.slice(2);
const file = (name) => join(folder, name);
const isomatchRuns = (...args) => execFileSync(isomatch, args, {stdio: ['ignore', 'ignore', 'ignore']});
const isOpened = "document.querySelector('iframe')?.contentDocument?.body?.dataset.ready === 'true'";

/** A folder as a batch leaves it: maps are truths, reports as short as they may be. */
function makeBatch(name, pairs) {
  const report = (x, y, more) => JSON.stringify({...more, batch: {x: `../${x}`, y: `../${y}`}});
  rmSync(file(name), {recursive: true, force: true});
  mkdirSync(file(name), {recursive: true});
  for (const {pair, x, y, map, ...more} of pairs) {
    writeFileSync(join(file(name), `${pair}.txt`), map);
    writeFileSync(join(file(name), `${pair}.json`), report(x, y, more));
  }
}

function sample(name, pose, vertices, truth) {
  const from = truth ? ['--truth-from', `A:${vertices}`, '--truth', file(truth)] : [];
  if (!existsSync(file(name))) {
    isomatchRuns('sample', '--pose', pose, '--vertices', `${vertices}`, '-o', file(name), ...from);
  }
  return truth && readFileSync(file(truth), 'utf8').replaceAll(/^(\d+) (\d+).*$/gm, '$2');
}

function makeFolders() {
  sample('a.off', 'A', 1000);
  const map = sample('b.off', 'B', 1000, 'truth.txt');
  const shapes = {x: 'a.off', y: 'b.off', map};
  makeBatch('maps', [
    {pair: 'a__good', ...shapes, verdict: {level: 'good', reason: 'mean confidence 0.9'}, quality: {mean_confidence: 0.9}},
    {pair: 'a__bad', ...shapes, verdict: {level: 'bad', reason: 'torn', advice: 'look'}, quality: {mean_confidence: 0.1}},
    {pair: 'a__doubtful', ...shapes, verdict: {level: 'doubtful', reason: ''}, quality: {mean_confidence: 0.5}},
    {pair: 'a <&"__10', ...shapes, y: 'none.off'},
  ]);
  writeFileSync(join(file('maps'), 'summary.csv'),
      'x,y,state,message\na,good,done,\na,late,failed,"no memory, ""none"""\n');
  isomatchRuns('view', file('maps'), '-o', file('maps.html'));
}

const rows = (page) => page.evaluate(`Array.from(document.querySelectorAll('#rows tr'),
    (row) => row.querySelector('.badge').innerText.replace(/^\\W+/, ''))`);
const open = async (page, name) => {
  await page.send('Page.navigate', {url: 'about:blank'});
  await page.send('Page.navigate', {url: pathToFileURL(file(name)).href});
  await page.until("document.body?.dataset.ready === 'true'");
  await page.drawn();
};
const keep = async (page, name) =>
    writeFileSync(file(name), Buffer.from(await page.screenshot(), 'base64'));

const checks = {
  async 'pairs are listed, worst first, and sorted as one likes'({page}) {
    await open(page, 'maps.html');
    assert.deepEqual(await rows(page), ['no map', 'no map', 'bad', 'doubtful', 'good']);
    assert.equal(await page.evaluate("document.getElementById('summary').innerText"),
        '5 pairs: 1 good, 1 doubtful, 1 bad, 2 no map');
    const text = await page.evaluate("document.getElementById('rows').innerText");
    assert.match(text, /no memory, "none"/);
    assert.match(text, /none\.off': no such file/);
    await keep(page, 'folder.png');
    const sort = async (label) => {
      await page.evaluate(`Array.from(document.querySelectorAll('.sort'))
          .find((button) => button.innerText === '${label}').click()`);
      return rows(page);
    };
    assert.deepEqual((await sort('Confidence')).slice(0, 3), ['bad', 'doubtful', 'good']);
    assert.deepEqual(await sort('Confidence'), ['good', 'doubtful', 'bad', 'no map', 'no map']);
    await page.click('#verdicts label:has([value=doubtful])');
    assert.deepEqual(await rows(page), ['doubtful']);
    await page.click('#verdicts label:has([value=all])');
    await page.evaluate(`{ const field = document.getElementById('filter');
      field.value = 'LATE'; field.dispatchEvent(new Event('input')); }`);
    assert.deepEqual(await rows(page), ['no map']);
  },

  async 'a pair opens beside the list, and the next one after it'({page}) {
    await open(page, 'maps.html');
    await page.click('#rows tr:nth-child(3) a');
    await page.until(isOpened);
    assert.match(await page.evaluate("document.querySelector('iframe').contentDocument.querySelector('h1').innerText"), /a\.off/);
    assert.match(await page.evaluate("document.querySelector('iframe').contentDocument.querySelector('.verdict').innerText"), /bad map\s+torn\s+look/);
    const {x, y, width, height} = await page.box('iframe');
    const pane = await page.evaluate(`(({x, y, width, height}) => ({x, y, width, height}))(
        document.querySelector('iframe').contentDocument.getElementById('pane-x').getBoundingClientRect())`);
    const {covered} = drawing(await page.pixels(
        {x: x + pane.x + 8, y: y + pane.y + 40, width: pane.width - 16, height: pane.height - 48}));
    assert.ok(covered > 0.05 && covered < 0.8, `X covers ${covered}`);
    assert.ok(x + width <= WINDOW.width && y + height <= WINDOW.height, 'it is seen as a whole');
    await keep(page, 'folder_opened.png');
    assert.equal(await page.evaluate("document.getElementById('previous').disabled"), true);
    await page.click('#next');
    await page.until(isOpened);
    assert.match(await page.evaluate("document.getElementById('which').innerText"), /2 of 3/);
    assert.match(await page.evaluate('location.hash'), /#a__doubtful/);
    // The address leads there again.
    await page.send('Page.navigate', {url: 'about:blank'});
    await page.send('Page.navigate', {url: `${pathToFileURL(file('maps.html')).href}#a__good`});
    await page.until(`document.getElementById('which')?.innerText.includes('3 of 3') && ${isOpened}`);
    await page.click('#close');
    assert.equal(await page.evaluate("document.querySelector('iframe')"), null);
  },

  async 'names can be read on a phone, and no address is a fault'({page}) {
    const map = readFileSync(file('maps/a__good.txt'), 'utf8');
    const all = {mesh_x: {vertices: 1000}, mesh_y: {vertices: 1000}, symmetry_confidence: 1, total_seconds: 1,
      quality: {mean_confidence: 0.5, geodesic_distortion: 0.1, coverage: 1}};
    makeBatch('wide', ['good', 'excellent'].map((level) => ({pair: `a__${level}`, x: 'a.off', y: 'b.off', map, ...all,
      verdict: {level, reason: 'much of the surface is turned over'}})));
    isomatchRuns('view', file('wide'), '-o', file('wide.html'));
    for (const width of [390, 1100]) {
      await page.send('Emulation.setDeviceMetricsOverride', {width, height: 800, deviceScaleFactor: 1, mobile: width < 400});
      await open(page, 'wide.html');
      assert.ok((await page.box('#rows .pair')).width >= 150, `names have room at ${width}`);
      assert.ok(await page.evaluate('document.documentElement.scrollWidth <= document.documentElement.clientWidth'));
      await keep(page, `folder_${width}.png`);
    }
    // A word that is no verdict is listed and counted as none.
    assert.equal(await page.evaluate("document.getElementById('summary').innerText"), '2 pairs: 1 good, 1 not judged');
    await page.send('Emulation.setDeviceMetricsOverride', {...WINDOW, deviceScaleFactor: 1, mobile: false});
    await page.send('Page.navigate', {url: 'about:blank'});
    await page.send('Page.navigate', {url: `${pathToFileURL(file('wide.html')).href}#100%`});
    await page.until("document.body?.dataset.ready === 'true'");
    await open(page, 'maps.html');
  },

  async 'a page of one pair can be saved'({page}) {
    await page.send('Browser.setDownloadBehavior', {behavior: 'allow', downloadPath: folder});
    rmSync(file('a__bad.html'), {force: true});
    await page.click('#rows tr:nth-child(3) a');
    await page.until(isOpened);
    await page.click('#keep');
    for (let tries = 0; !existsSync(file('a__bad.html')) && tries < 100; ++tries) {
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
    await open(page, 'a__bad.html');
    assert.match(await page.evaluate("document.title"), /a\.off/);
  },

  async 'a hundred pairs of 5,000 vertices are usable'({page}) {
    sample('m.off', 'A', MANY_VERTICES);
    const map = sample('n.off', 'B', MANY_VERTICES, 'many_truth.txt');
    makeBatch('many', Array.from({length: MANY}, (_, i) => ({pair: `m__${i}`, x: 'm.off', y: 'n.off', map,
      verdict: {level: 'good', reason: ''}})));
    const begin = performance.now();
    isomatchRuns('view', file('many'), '-o', file('many.html'));
    const made = performance.now();
    await open(page, 'many.html');
    const listed = performance.now();
    assert.equal((await rows(page)).length, MANY);
    await page.click('#rows tr:nth-child(2) a');
    await page.until(isOpened);
    const mebibytes = statSync(file('many.html')).size / 2 ** 20;
    const seconds = [made - begin, listed - made, performance.now() - listed].map((ms) => (ms / 1000).toFixed(1));
    console.log(`a page of ${MANY} pairs, ${mebibytes.toFixed(1)} MiB, is made in ${seconds[0]} s, ` +
        `lists them after ${seconds[1]} s, shows one after ${seconds[2]} s`);
    assert.ok(mebibytes < 80);
    assert.ok(!existsSync(file('many_pairs')), 'all is in one file');
  },

  async 'pairs may have pages of their own'({page}) {
    const map = readFileSync(file('maps/a__good.txt'), 'utf8');
    makeBatch('apart', ['a__#1', 'a__2'].map((pair) => ({pair, x: 'a.off', y: 'b.off', map})));
    isomatchRuns('view', file('apart'), '-o', file('apart.html'), '--separate-pages');
    assert.ok(statSync(file('apart.html')).size < 2 ** 18);
    await open(page, 'apart.html');
    await page.click('#rows tr:nth-child(1) a');
    const address = await page.evaluate("document.querySelector('iframe').src");
    assert.match(address, /apart_pairs\/a__%231\.html$/);
    // Of another origin, as all files are: it can be seen only.
    const box = await page.box('iframe');
    const middle = {x: box.x + 40, y: box.y + 200, width: box.width / 2 - 60, height: box.height - 400};
    let covered = 0;
    for (let tries = 0; covered < 0.05 && tries < 60; ++tries) {
      await new Promise((resolve) => setTimeout(resolve, 500));
      covered = drawing(await page.pixels(middle)).covered;
    }
    assert.ok(covered > 0.05, `X covers ${covered}`);
    await keep(page, 'folder_apart.png');
  },

  async 'nothing was asked of the network and nothing went wrong'({page}) {
    assert.deepEqual(page.problems, []);
    const outside = page.requests.filter((url) => !/^(file|data|blob|about):/.test(url));
    assert.deepEqual(outside, []);
  },
};

process.exit(await withPage(folder, WINDOW, async (page) => {
  makeFolders();
  return run(checks, {page});
}));
