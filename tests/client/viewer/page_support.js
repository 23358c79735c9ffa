// What the tests of pages share: pixels, pointers, and a browser for a file of checks.
import {mkdirSync, mkdtempSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {findChromium, Page} from './chromium.js';

const SKIPPED = 77;
/** Differences of a channel that antialiasing does not make. */
const CLEARLY = 40;

/** How many pixels differ clearly, and where their middle is. */
export function difference(a, b) {
  let [changed, x, y] = [0, 0, 0];
  for (let i = 0; i < a.rgb.length; i += 3) {
    const most = Math.max(...[0, 1, 2].map((c) => Math.abs(a.rgb[i + c] - b.rgb[i + c])));
    if (most < CLEARLY) continue;
    ++changed;
    x += (i / 3) % a.width;
    y += Math.floor(i / 3 / a.width);
  }
  return {changed, x: x / changed, y: y / changed};
}

/** Pixels that are not of the first one's color, and how many colors there are. */
export function drawing({rgb}) {
  const colors = new Set();
  let covered = 0;
  for (let i = 0; i < rgb.length; i += 3) {
    colors.add(rgb.readUIntBE(i, 3));
    if (rgb.compare(rgb, 0, 3, i, i + 3) !== 0) ++covered;
  }
  return {covered: 3 * covered / rgb.length, colors: colors.size};
}

/** How many tints there are, whatever their lightness; few pixels do not count. */
export function tints({rgb}) {
  const counts = new Map();
  for (let i = 0; i < rgb.length; i += 3) {
    const [r, g, b] = rgb.subarray(i, i + 3);
    const tint = `${Math.round(24 * r / (r + g + b))} ${Math.round(24 * g / (r + g + b))}`;
    counts.set(tint, (counts.get(tint) ?? 0) + 1);
  }
  return [...counts.values()].filter((count) => count > 50).length;
}

export const found = (page) => page.evaluate("document.getElementById('found').textContent");

/** The drawing alone of a pane, without the name above and the focus around it. */
export async function shapeBox(page, side) {
  const box = await page.box(`#pane-${side}`);
  return {x: box.x + 8, y: box.y + 40, width: box.width - 16, height: box.height - 48};
}

/** Calls act(x, y) on a grid of points of a pane, until it returns true. */
export async function overPane(page, side, act) {
  const box = await page.box(`#pane-${side}`);
  for (let row = 3; row < 10; ++row) {
    for (let column = 2; column < 15; ++column) {
      if (await act(box.x + box.width * column / 16, box.y + box.height * row / 12)) return;
    }
  }
}

export async function away(page) {
  const {x, y, width} = await page.box('header');
  await page.hover(x + width - 5, y + 5);
  const pane = await page.box('#pane-x');
  await page.hover(pane.x + 3, pane.y + pane.height - 3);
}

/** Runs each check with `given`; returns how many failed. */
export async function run(checks, given) {
  let failed = 0;
  for (const [name, check] of Object.entries(checks)) {
    await check(given).then(() => console.log(`ok: ${name}`), (error) => {
      ++failed;
      console.log(`FAILED: ${name}\n${error.stack}`);
    });
  }
  if (failed > 0) console.log('Problems of the page:', given.page.problems);
  return failed;
}

/**
 * Makes `folder` and opens a browser, in which `act(page)` returns how many checks
 * failed. Returns the status to exit with: 77, which CTest calls skipped, where there
 * is no Chromium; with ISOMATCH_NEEDS_CHROMIUM set, as scripts/test does after it
 * installed one, that is a failure.
 */
export async function withPage(folder, window, act) {
  const chromium = findChromium();
  if (!chromium) {
    const needed = process.env.ISOMATCH_NEEDS_CHROMIUM;
    console.log(`${needed ? 'FAILED' : 'Skipped'}: no chromium in PATH; scripts/test installs it.`);
    return needed ? 1 : SKIPPED;
  }
  mkdirSync(folder, {recursive: true});
  const profile = mkdtempSync(join(tmpdir(), 'isomatch_page_'));
  const page = await Page.open(chromium, profile, window);
  try {
    return await act(page) > 0 ? 1 : 0;
  } finally {
    await page.close();
    rmSync(profile, {recursive: true, force: true});
  }
}
