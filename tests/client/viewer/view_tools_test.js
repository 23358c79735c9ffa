// What one does with a page of `isomatch view`: pins, morph, wireframe, pictures, and
// what phones and frames do with it.
//
//   node view_tools_test.js ISOMATCH FOLDER
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {existsSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {pathToFileURL} from 'node:url';
import {away, difference, found, overPane, run, shapeBox, withPage} from './page_support.js';

const WINDOW = {width: 1400, height: 1000};
const [isomatch, folder] = process.argv.slice(2);
const file = (name) => join(folder, name);
const isomatchRuns = (...args) => execFileSync(isomatch, args, {stdio: ['ignore', 'ignore', 'inherit']});

function makePage() {
  isomatchRuns('sample', '--pose', 'A', '--vertices', '3000', '-o', file('a.off'));
  isomatchRuns('sample', '--pose', 'C', '--vertices', '2000', '-o', file('b.off'));
  isomatchRuns('match', file('a.off'), file('b.off'), '-o', file('map.txt'), '--no-progress',
      '--report', file('report.json'), '--precise', file('places.txt'));
  isomatchRuns('view', file('a.off'), file('b.off'), file('places.txt'), '-o', file('page.html'),
      '--report', file('report.json'));
  return readFileSync(file('map.txt'), 'utf8').trim().split('\n').map(Number);
}

const keep = async (page, name) =>
    writeFileSync(file(name), Buffer.from(await page.screenshot(), 'base64'));
const text = (page, selector) => page.evaluate(`document.querySelector('${selector}').innerText`);
const set = (page, id, value, event) => page.evaluate(`{ const field = document.getElementById('${id}');
  field.value = ${JSON.stringify(value)}; field.dispatchEvent(new Event('${event}', {bubbles: true})); }`);

async function open(page, address) {
  await page.send('Page.navigate', {url: pathToFileURL(address).href});
  await page.until("document.body?.dataset.ready === 'true'");
  await page.drawn();
}

/** Clicks what lies at a point of the window. */
async function clickAt(page, x, y) {
  const button = {button: 'left', clickCount: 1};
  await page.mouse('mouseMoved', x, y);
  await page.mouse('mousePressed', x, y, button);
  await page.mouse('mouseReleased', x, y, button);
  await page.drawn();
}

/** Points of a pane where a vertex is, and which: [{x, y, vertex}]. */
async function vertices(page, side, wanted) {
  const points = [];
  await overPane(page, side, async (x, y) => {
    await page.hover(x, y);
    const match = new RegExp(`^${side.toUpperCase()} (\\d+) `).exec(await found(page));
    if (match && points.every(({vertex}) => vertex !== Number(match[1]))) {
      points.push({x, y, vertex: Number(match[1])});
    }
    return points.length === wanted;
  });
  assert.equal(points.length, wanted);
  return points;
}

/** Waits for a file that the page saves, and takes it. */
async function saved(name) {
  for (let tries = 0; !existsSync(file(name)); ++tries) {
    assert.ok(tries < 200, `${name} was never saved`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
  const bytes = readFileSync(file(name));
  rmSync(file(name));
  return bytes;
}

const pinned = (page) => page.evaluate(`Array.from(document.querySelectorAll('.pin-pair'),
    (pair) => /X (\\S+) . Y (\\S+)/.exec(pair.innerText).slice(1).map(Number))`);
const landmarkLines = (bytes) => bytes.toString().split('\n').filter((line) => /^\d/.test(line));

/** Which pixels are not of the first one's color, and the share of those that differ. */
const covers = ({rgb}) => Array.from({length: rgb.length / 3}, (_, i) => rgb.compare(rgb, 0, 3, 3 * i, 3 * i + 3) !== 0);
function mismatch(a, b) {
  const [one, other] = [covers(a), covers(b)];
  const either = one.filter((yes, i) => yes || other[i]).length;
  return one.filter((yes, i) => yes !== other[i]).length / either;
}

/** Of a PNG: as Page.pixels returns it. */
async function decoded(page, png) {
  return page.evaluate(`(async () => {
    const bytes = Uint8Array.from(atob('${png.toString('base64')}'), (c) => c.charCodeAt(0));
    const image = await createImageBitmap(new Blob([bytes], {type: 'image/png'}));
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
    context.drawImage(image, 0, 0);
    const colors = new Set();
    const {data} = context.getImageData(0, 0, image.width, image.height);
    for (let i = 0; i < data.length; i += 4) colors.add(data[i] << 16 | data[i + 1] << 8 | data[i + 2]);
    return {width: image.width, height: image.height, colors: colors.size};
  })()`);
}

const checks = {
  async 'pins are made by clicks, shown on both sides, and exported'({page}) {
    await page.click('#pin');
    const onX = await vertices(page, 'x', 2);
    const onY = await vertices(page, 'y', 2);
    await away(page);
    const before = {x: await page.pixels(await shapeBox(page, 'x')), y: await page.pixels(await shapeBox(page, 'y'))};
    await clickAt(page, onX[0].x, onX[0].y);
    assert.match(await text(page, '#pin-status'), /Pin 1: now click its partner on Y/);
    await clickAt(page, onY[1].x, onY[1].y);
    await clickAt(page, onY[0].x, onY[0].y);
    await clickAt(page, onX[1].x, onX[1].y);
    const expected = [[onX[0].vertex, onY[1].vertex], [onX[1].vertex, onY[0].vertex]];
    assert.deepEqual(await pinned(page), expected);
    await away(page);
    for (const [side, points] of [['x', onX], ['y', onY]]) {
      const box = await shapeBox(page, side);
      const now = await page.pixels(box);
      assert.ok(difference(before[side], now).changed > 300, `pins are drawn on ${side}`);
      // White rings and numbers where the clicks were.
      for (const {x, y} of points) {
        const [column, row] = [Math.round(x - box.x), Math.round(y - box.y)];
        let white = 0;
        for (let i = -16; i <= 16; ++i) {
          for (let j = -16; j <= 16; ++j) {
            const at = 3 * ((row + i) * now.width + column + j);
            if (now.rgb[at] > 240 && now.rgb[at + 1] > 240 && now.rgb[at + 2] > 240) ++white;
          }
        }
        assert.ok(white > 20, `${white} white pixels of a pin`);
      }
    }
    await page.evaluate("document.querySelector('.pin-name').focus()");
    for (const key of 'nose') await page.press(key);
    await page.click('#pin-export');
    const bytes = await saved('landmarks.txt');
    assert.deepEqual(landmarkLines(bytes),
        [`${expected[0].join(' ')} # nose`, expected[1].join(' ')]);
    await keep(page, 'tools_pins.png');
    // The method takes the file.
    writeFileSync(file('pins.txt'), bytes);
    isomatchRuns('match', file('a.off'), file('b.off'), '-o', file('map2.txt'), '--no-progress',
        '--landmarks', file('pins.txt'), '--report', file('report2.json'));
    const {landmarks} = JSON.parse(readFileSync(file('report2.json'), 'utf8'));
    assert.deepEqual(landmarks.map(({x, y}) => [x, y]), expected);
  },

  async 'pins are undone, removed, and read from a file'({page}) {
    const before = await pinned(page);
    await page.click('.pin-remove');
    assert.deepEqual(await pinned(page), before.slice(1));
    await page.evaluate("document.activeElement.blur()");
    await page.send('Input.dispatchKeyEvent', {type: 'keyDown', key: 'z', code: 'KeyZ', modifiers: 2});
    assert.deepEqual(await pinned(page), before);
    const {root} = await page.send('DOM.getDocument');
    const {nodeId} = await page.send('DOM.querySelector', {nodeId: root.nodeId, selector: '#pin-file'});
    const read = async (name, content) => {
      writeFileSync(file(name), content);
      await page.send('DOM.setFileInputFiles', {files: [file(name)], nodeId});
      await page.until(`document.getElementById('pin-status').innerText.includes('${name}')`);
      return text(page, '#pin-status');
    };
    assert.match(await read('wrong.txt', '1 2\n3000 1\n'), /wrong\.txt, line 2: found '3000 1', expected/);
    assert.deepEqual(await pinned(page), before);
    assert.match(await read('right.txt', '# mine\n5 6 # knee\n7 8\n'), /2 pins of right\.txt/);
    assert.deepEqual(await pinned(page), [[5, 6], [7, 8]]);
    assert.equal(await page.evaluate("document.querySelector('.pin-name').value"), 'knee');
    await page.click('#pin-clear');
    assert.deepEqual(await pinned(page), []);
  },

  async 'what is pressed in the list of pins is there still'({page}) {
    for (const [x, y] of [[1, 2], [3, 4], [5, 6]]) {
      await set(page, 'pin-x', x, 'input');
      await set(page, 'pin-y', y, 'input');
      await page.click('#pin-add');
    }
    // A name that was just typed takes no click away from what is beside it.
    await page.evaluate("document.querySelector('#pin-list li:nth-child(2) .pin-name').focus()");
    for (const key of 'ear') await page.press(key);
    await page.click('#pin-list li:nth-child(2) .pin-number');
    assert.match(await text(page, '#pin-status'), /^Pin 2: click where an end shall be/);
    assert.equal(await page.evaluate("document.querySelector('#pin-list li:nth-child(2) .pin-name').value"), 'ear');
    const focused = () => page.evaluate(`(({activeElement}) => [activeElement.className,
        Array.from(document.querySelectorAll('#pin-list li')).findIndex((row) => row.contains(activeElement))])(document)`);
    assert.deepEqual(await focused(), ['pin-number', 1]);
    await page.evaluate("document.querySelector('#pin-list li:nth-child(2) .pin-remove').focus()");
    const remove = async () => page.evaluate('document.activeElement.click()');
    await remove();
    assert.deepEqual(await focused(), ['pin-remove', 1]);
    await remove();
    assert.deepEqual(await focused(), ['pin-remove', 0]);
    await remove();
    assert.equal(await page.evaluate('document.activeElement.id'), 'pin-undo');
  },

  async 'pins begin with the map, and can be made by keys alone'({page, map}) {
    await page.click('#pin-suggest');
    const [point] = await vertices(page, 'x', 1);
    await clickAt(page, point.x, point.y);
    assert.deepEqual(await pinned(page), [[point.vertex, map[point.vertex]]]);
    assert.match(await text(page, '.pin-pair'), /by the map/);
    const type = async (x, y) => {
      for (const [side, number] of [['x', x], ['y', y]]) {
        await page.evaluate(`document.getElementById('pin-${side}').select()`);
        for (const key of number) await page.press(key);
      }
      await page.press('Enter');
    };
    await type('11', '2000');
    assert.match(await text(page, '#pin-status'), /Y: there is no vertex 2000\. Its vertices are 0 to 1999\./);
    await type('11', '12');
    assert.deepEqual((await pinned(page))[1], [11, 12]);
    await type('11', '13');
    assert.match(await text(page, '#pin-status'), /X 11 is in pin 2 already/);
    await page.click('#pin-clear');
    await page.click('#pin');
    assert.equal(await page.evaluate("document.getElementById('pins').hidden"), true);
  },

  async 'a wireframe is drawn over the surface'({page}) {
    await away(page);
    const plain = await page.pixels(await shapeBox(page, 'x'));
    await page.click('#wireframe');
    const lines = await page.pixels(await shapeBox(page, 'x'));
    assert.ok(difference(plain, lines).changed > 3000);
    assert.ok(mismatch(plain, lines) < 0.03, 'the silhouette stays');
    await keep(page, 'tools_wireframe.png');
    await page.click('#wireframe');
    assert.equal(difference(plain, await page.pixels(await shapeBox(page, 'x'))).changed, 0);
  },

  async 'the morph ends where Y is'({page}) {
    await away(page);
    const shots = async () => [await page.pixels(await shapeBox(page, 'x')), await page.pixels(await shapeBox(page, 'y'))];
    const [start, goal] = await shots();
    assert.ok(mismatch(start, goal) > 0.1, `the poses differ: ${mismatch(start, goal)}`);
    const parts = [];
    for (const part of ['0.5', '1']) {
      await set(page, 'morph', part, 'input');
      await page.drawn();
      const [x, y] = await shots();
      assert.equal(difference(goal, y).changed, 0);
      parts.push(mismatch(x, goal));
      await keep(page, `tools_morph_${part}.png`);
    }
    assert.ok(parts[1] < 0.03, `X lies on Y up to ${parts[1]}`);
    assert.ok(parts[0] > parts[1] && parts[0] < mismatch(start, goal), `half way ${parts[0]}`);
    assert.equal(await text(page, '#morph-text'), '100\u202f%');
    // A vertex is found where it is now.
    const [point] = await vertices(page, 'x', 1);
    await page.hover(point.x, point.y);
    await page.click('#reset');
    await page.until("document.body.dataset.drawn === 'fine'");
    await page.drawn();
    await away(page);
    assert.equal(difference(start, (await shots())[0]).changed, 0);
  },

  async 'a picture of both shapes is saved'({page}) {
    await page.click('label:has([value=distortion])');
    await page.click('#screenshot');
    const png = await saved('isomatch.png');
    writeFileSync(file('tools_saved.png'), png);
    const picture = await decoded(page, png);
    const {width, height} = await page.box('#views');
    assert.ok(Math.abs(picture.width - width) <= 2 && picture.height > height, JSON.stringify(picture));
    assert.ok(picture.colors > 1000);
    await page.click('label:has([value=colors])');
  },

  async 'a number that is no vertex is said to be wrong'({page}) {
    for (const [typed, message] of [
      ['99999999', /X: there is no vertex 99999999\. Its vertices are 0 to 2999\./],
      ['1.5', /there is no vertex 1\.5/], ['-1', /there is no vertex -1/], ['3000', /0 to 2999/],
    ]) {
      await page.evaluate("document.getElementById('vertex-x').select()");
      for (const key of typed) await page.press(key);
      assert.match(await text(page, '#picker-error'), message);
      assert.equal(await page.evaluate("document.getElementById('vertex-x').getAttribute('aria-invalid')"), 'true');
      assert.match(await found(page), /^Point at a vertex/);
    }
    await keep(page, 'tools_wrong_number.png');
    await set(page, 'vertex-x', '2999', 'input');
    assert.equal(await text(page, '#picker-error'), '');
    assert.match(await found(page), /^X 2999 /);
  },

  async 'the verdict stands above, and figures say what they mean'({page}) {
    const {verdict} = JSON.parse(readFileSync(file('report.json'), 'utf8'));
    assert.match(await text(page, '.verdict'), new RegExp(`${verdict.level} map`));
    const shown = (id) => page.evaluate(`getComputedStyle(document.getElementById('${id}')).visibility`);
    const id = await page.evaluate(`(() => { const label = Array.from(document.querySelectorAll('th .explained'))
        .find(({innerText}) => innerText.startsWith('coverage')); label.id = 'label';
        label.scrollIntoView({block: 'center'}); return label.getAttribute('aria-describedby'); })()`);
    assert.equal(await shown(id), 'hidden');
    const box = await page.box('#label');
    await page.hover(box.x + 5, box.y + 5);
    assert.equal(await shown(id), 'visible');
    await keep(page, 'tools_tip.png');
    await page.evaluate('scrollTo(0, 0)');
    await away(page);
    await page.evaluate("document.getElementById('label').focus({preventScroll: true})");
    assert.equal(await shown(id), 'visible');
    await page.press('Escape');
    assert.equal(await shown(id), 'hidden');
    // All but the stages, which are names.
    const bare = await page.evaluate(`Array.from(document.querySelectorAll('th'), (th) => th)
        .filter((th) => !th.querySelector('.explained')).map((th) => th.innerText)`);
    const {seconds} = JSON.parse(readFileSync(file('report.json'), 'utf8'));
    assert.deepEqual(bare.filter((label) => !(label in seconds)), []);
  },

  async 'fingers scroll the page past the shapes, and turn them'({page}) {
    await page.send('Emulation.setDeviceMetricsOverride',
        {width: 400, height: 850, deviceScaleFactor: 1, mobile: true});
    await page.send('Emulation.setTouchEmulationEnabled', {enabled: true, maxTouchPoints: 2});
    await open(page, file('page.html'));
    await keep(page, 'tools_phone.png');
    const {x, y, width, height} = await page.box('#pane-x');
    const middle = {x: x + width / 2, y: y + height / 2};
    const from = (dx, dy) => ({x: middle.x + dx, y: middle.y + dy});
    const swipe = async (...fingers) => {
      await page.swipe(fingers);
      const scrolled = await page.evaluate('scrollY');
      await page.evaluate('scrollTo(0, 0)');
      await page.drawn();
      return scrolled;
    };
    const shot = async () => page.pixels(await shapeBox(page, 'y'));
    const first = await shot();
    assert.ok(await swipe([middle, from(0, -150)]) > 100, 'one finger scrolls the page');
    assert.ok(difference(first, await shot()).changed < 500, 'and turns nothing');
    assert.equal(await swipe([middle, from(-120, 0)]), 0);
    const turned = await shot();
    assert.ok(difference(first, turned).changed > 500, 'sideways it turns');
    await page.click('#one-finger');
    assert.equal(await swipe([middle, from(0, -100)]), 0);
    const tilted = await shot();
    assert.ok(difference(turned, tilted).changed > 500, 'when asked to, one finger turns up and down');
    await page.click('#one-finger');
    assert.equal(await swipe([from(-20, 0), from(-20, 80)], [from(20, 0), from(20, 80)]), 0);
    const both = await shot();
    assert.ok(difference(tilted, both).changed > 500, 'two fingers turn up and down');
    assert.equal(await swipe([from(-20, -20), from(-60, -60)], [from(20, 20), from(60, 60)]), 0);
    assert.ok(difference(both, await shot()).changed > 500, 'two fingers zoom the shape');
    assert.equal(await page.evaluate('visualViewport.scale'), 1);
    await page.send('Emulation.setTouchEmulationEnabled', {enabled: false});
    await page.send('Emulation.setDeviceMetricsOverride', {...WINDOW, deviceScaleFactor: 1, mobile: false});
  },

  async 'it lives in the frame of a notebook'({page}) {
    const escaped = readFileSync(file('page.html'), 'utf8').replaceAll('&', '&amp;').replaceAll('"', '&quot;');
    for (const [sandbox, saves] of [['', true], ['sandbox="allow-scripts allow-same-origin"', false]]) {
      writeFileSync(file('notebook.html'), `<!doctype html><meta charset="utf-8"><p>In [1]:</p>
          <iframe ${sandbox} srcdoc="${escaped}" width="100%" height="520"></iframe><div style="height: 900px"></div>`);
      await page.send('Page.navigate', {url: pathToFileURL(file('notebook.html')).href});
      await page.until("frames[0]?.document.body?.dataset.ready === 'true'");
      await page.drawn();
      const inside = (expression) => page.evaluate(`((document) => ${expression})(frames[0].document)`);
      assert.ok(await inside("document.documentElement.scrollWidth <= document.documentElement.clientWidth"));
      // Both shapes, and what is found, are seen without scrolling.
      assert.ok(await inside("document.getElementById('found').getBoundingClientRect().bottom") <= 520);
      await keep(page, `tools_notebook_${saves ? 'free' : 'sandboxed'}.png`);
      const at = await inside(`(({x, y, width, height}) => ({x: x + width / 2, y: y + height / 2}))(
          document.getElementById('pane-x').getBoundingClientRect())`);
      const frame = await page.box('iframe');
      const wheel = async () => {
        await page.mouse('mouseWheel', frame.x + at.x, frame.y + at.y, {deltaX: 0, deltaY: 120});
        await page.drawn();
        await new Promise((resolve) => setTimeout(resolve, 300));
        const scrolled = await page.evaluate('scrollY') + await inside('document.documentElement.scrollTop');
        await page.evaluate('scrollTo(0, 0)');
        await inside('document.documentElement.scrollTo(0, 0)');
        return scrolled;
      };
      assert.ok(await wheel() > 0, 'the wheel scrolls the notebook');
      await page.drawn();
      await clickAt(page, frame.x + at.x, frame.y + at.y);
      assert.equal(await wheel(), 0, 'and zooms a shape that was clicked');
      await inside("document.getElementById('pin').click()");
      await inside("document.getElementById('pin-x').value = 1");
      await inside("document.getElementById('pin-y').value = 2");
      await inside("document.getElementById('pin-add').click()");
      await inside("document.getElementById('pin-export').click()");
      if (saves) {
        assert.deepEqual(landmarkLines(await saved('landmarks.txt')), ['1 2']);
      } else {
        await page.until("frames[0].document.querySelector('#shown[open] textarea')");
        assert.deepEqual(landmarkLines(await inside("document.querySelector('#shown textarea').value")), ['1 2']);
        await keep(page, 'tools_notebook_shown.png');
      }
    }
  },

  async 'a drawing that the browser took away comes back'({page}) {
    await open(page, file('page.html'));
    await away(page);
    const before = await page.pixels(await shapeBox(page, 'x'));
    const gl = (act) => page.evaluate(`(window.taken ??= document.getElementById('canvas')
        .getContext('webgl2').getExtension('WEBGL_lose_context')).${act}()`);
    await gl('loseContext');
    await page.drawn();
    assert.ok(difference(before, await page.pixels(await shapeBox(page, 'x'))).changed > 3000);
    await gl('restoreContext');
    await new Promise((resolve) => setTimeout(resolve, 500));
    await page.drawn();
    assert.equal(difference(before, await page.pixels(await shapeBox(page, 'x'))).changed, 0);
  },

  async 'a long name stays above its shape'({page}) {
    const name = `${'long'.repeat(50)}.off`;
    writeFileSync(file(name), readFileSync(file('a.off')));
    isomatchRuns('view', file(name), file('b.off'), file('map.txt'), '-o', file('long.html'));
    await open(page, file('long.html'));
    const [above, pane] = [await page.box('#pane-x .name'), await page.box('#pane-x')];
    assert.ok(above.x + above.width <= pane.x + pane.width, JSON.stringify([above, pane]));
    assert.ok(await page.evaluate('document.documentElement.scrollWidth <= document.documentElement.clientWidth'));
    await page.click('#screenshot');
    const png = await saved('isomatch.png');
    writeFileSync(file('tools_long.png'), png);
    // Y's name, and no letter of X's, stands at the top of Y's half.
    const dark = await page.evaluate(`(async () => {
      const bytes = Uint8Array.from(atob('${png.toString('base64')}'), (c) => c.charCodeAt(0));
      const image = await createImageBitmap(new Blob([bytes], {type: 'image/png'}));
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
      context.drawImage(image, 0, 0);
      const {data} = context.getImageData(image.width / 2 + 200, 0, image.width / 2 - 200, 40);
      return data.filter((value, i) => i % 4 === 0 && value < 128).length;
    })()`);
    assert.equal(dark, 0);
  },

  async 'parts far from each other, and beside a vertex on no face, are seen'({page}) {
    // Two squares 300 sides apart, and the vertex.
    const square = (x) => [[0, 0], [1, 0], [1, 1], [0, 1]].map(([u, v]) => `${x + u} ${v} 0`);
    writeFileSync(file('apart.off'), ['OFF', '9 4 0', ...square(0), ...square(300), '1e5 1e5 0',
      ...[0, 4].flatMap((v) => [`3 ${v} ${v + 1} ${v + 2}`, `3 ${v} ${v + 2} ${v + 3}`]), ''].join('\n'));
    writeFileSync(file('apart.txt'), '0 1 2 3 4 5 6 7 -1'.replaceAll(' ', '\n'));
    isomatchRuns('view', file('apart.off'), file('apart.off'), file('apart.txt'), '-o', file('apart.html'));
    await open(page, file('apart.html'));
    await away(page);
    assert.ok(covers(await page.pixels(await shapeBox(page, 'x'))).filter(Boolean).length >= 4);
    assert.match(await text(page, '#pane-x .name'), /9 vertices, 4 faces/);
  },

  async 'nothing went wrong'({page}) {
    // What Chromium says about the frame that this test makes.
    assert.deepEqual(page.problems.filter((problem) => !problem.includes('can escape its sandboxing')), []);
  },
};

process.exit(await withPage(folder, WINDOW, async (page) => {
  const map = makePage();
  await page.send('Browser.setDownloadBehavior', {behavior: 'allow', downloadPath: folder});
  await open(page, file('page.html'));
  return run(checks, {page, map});
}));
