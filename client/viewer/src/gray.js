// What is gray on the shapes, and why.
import {count} from './numbers.js';

/** Which vertices are on a face, which alone are seen. */
function onFaces({faces, vertices}) {
  const seen = new Uint8Array(vertices);
  for (const v of faces) seen[v] = 1;
  return seen;
}

/**
 * What gray stands for, in words; '' when nothing is gray.
 * @param pair meshes, and which vertices have a counterpart
 * @param colorOf {x, y}: of a vertex, null for gray
 */
export function grayText(pair, colorOf) {
  const without = {x: 0, y: 0};
  let valueless = 0;
  for (const side of ['x', 'y']) {
    onFaces(pair.meshes[side]).forEach((seen, v) => {
      if (!seen || colorOf[side](v)) return;
      if (pair.hasCounterpart(side, v)) ++valueless; else ++without[side];
    });
  }
  const reasons = [];
  if (without.x + without.y > 0) {
    reasons.push(`no counterpart (${count(without.x)} vertices of X, ${count(without.y)} of Y)`);
  }
  if (valueless > 0) reasons.push('no value');
  return reasons.join('; ');
}
