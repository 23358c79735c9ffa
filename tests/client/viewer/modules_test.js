// What the page computes without a browser: node modules_test.js
import assert from 'node:assert/strict';
import {test} from 'node:test';
import {coarseFaces} from '../../../client/viewer/src/coarse.js';
import {grayText} from '../../../client/viewer/src/gray.js';
import {Morph} from '../../../client/viewer/src/morph.js';
import {count, decimal, fixed, percent, typeset} from '../../../client/viewer/src/numbers.js';
import {PinList} from '../../../client/viewer/src/pins.js';

/** A sphere of area 1 with bumps, `rings` from pole to pole. */
function bumpySphere(rings) {
  const around = 2 * rings;
  const positions = [];
  const faces = [];
  for (let i = 0; i <= rings; ++i) {
    for (let j = 0; j < around; ++j) {
      const [t, p] = [Math.PI * i / rings, 2 * Math.PI * j / around];
      const r = 0.28 * (1 + 0.1 * Math.sin(3 * t) * Math.cos(2 * p));
      positions.push(r * Math.sin(t) * Math.cos(p), 1.3 * r * Math.cos(t), r * Math.sin(t) * Math.sin(p));
      const [a, b] = [i * around + j, i * around + (j + 1) % around];
      if (i < rings) faces.push(a, a + around, b, b, a + around, b + around);
    }
  }
  return {positions: Float32Array.from(positions), faces: Uint32Array.from(faces)};
}

function area({positions}, faces) {
  let sum = 0;
  const at = (v, axis) => positions[3 * v + axis];
  for (let i = 0; i < faces.length; i += 3) {
    const [u, v] = [1, 2].map((k) => [0, 1, 2].map((axis) => at(faces[i + k], axis) - at(faces[i], axis)));
    sum += Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
  }
  return sum;
}

test('a coarse mesh has about so many of the vertices and covers the surface', () => {
  const mesh = bumpySphere(200);
  for (const target of [1000, 8000]) {
    const faces = coarseFaces(mesh, target);
    const used = new Set(faces);
    assert.ok(Math.abs(used.size / target - 1) < 0.25, `${used.size} of ${target}`);
    assert.ok(Math.max(...used) < mesh.positions.length / 3);
    assert.ok(Math.abs(area(mesh, faces) / area(mesh, mesh.faces) - 1) < 0.05);
    assert.ok(faces.length < mesh.faces.length);
  }
});

test('a coarse mesh of very few vertices, or of none apart, is made too', () => {
  const flat = {positions: new Float32Array(9), faces: Uint32Array.from([0, 1, 2])};
  assert.equal(coarseFaces(flat, 100).length, 0);
  const one = {positions: Float32Array.from([0, 0, 0, 1, 0, 0, 0, 1, 0]), faces: Uint32Array.from([0, 1, 2])};
  assert.deepEqual([...coarseFaces(one, 100)], [0, 1, 2]);
});

/** Row-major, about (1, 2, 2) / 3. */
function rotation(angle) {
  const [x, y, z] = [1 / 3, 2 / 3, 2 / 3];
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const d = 1 - c;
  return [c + d * x * x, d * x * y - s * z, d * x * z + s * y,
          d * x * y + s * z, c + d * y * y, d * y * z - s * x,
          d * x * z - s * y, d * y * z + s * x, c + d * z * z];
}

const moved = (positions, m, shift) => positions.map((_, i) => {
  const row = 3 * (i % 3);
  const at = i - i % 3;
  return m[row] * positions[at] + m[row + 1] * positions[at + 1] + m[row + 2] * positions[at + 2] + shift[i % 3];
});

const farthest = (a, b) => a.reduce((most, value, i) => Math.max(most, Math.abs(value - b[i])), 0);

test('a morph begins at X, ends at its places, and turns what is rigid', () => {
  const mesh = bumpySphere(12);
  const has = Array.from({length: mesh.positions.length / 3}, () => true);
  for (const degrees of [0, 40, 90, 170]) {
    const angle = degrees * Math.PI / 180;
    const goals = moved(mesh.positions, rotation(angle), [0.3, -0.2, 0.1]);
    const morph = new Morph(mesh, goals, has);
    const out = new Float32Array(mesh.positions.length);
    morph.at(0, out);
    assert.deepEqual(out, mesh.positions);
    morph.at(1, out);
    assert.ok(farthest(out, goals) < 1e-6, `${degrees} degrees`);
    // Half way it is as large as before, and turned by half: no vertex takes a short cut.
    morph.at(0.5, out);
    assert.ok(Math.abs(area({positions: out}, mesh.faces) / area(mesh, mesh.faces) - 1) < 1e-5);
    const direction = (positions) => [0, 1, 2].map((axis) => positions[axis] - positions[positions.length - 3 + axis]);
    const half = direction(moved(mesh.positions, rotation(angle / 2), [0, 0, 0]));
    assert.ok(farthest(direction(out), half) < 1e-5, `half of ${degrees} degrees`);
  }
});

test('a vertex without a place goes along with its neighbors', () => {
  const mesh = bumpySphere(12);
  const goals = mesh.positions.map((value, i) => value + (i % 3 === 0 ? 1 : 0));
  const has = Array.from({length: mesh.positions.length / 3}, (_, v) => v % 50 !== 7);
  has.forEach((yes, v) => { if (!yes) goals.fill(0, 3 * v, 3 * v + 3); });
  const out = new Float32Array(mesh.positions.length);
  new Morph(mesh, goals, has).at(1, out);
  const expected = mesh.positions.map((value, i) => value + (i % 3 === 0 ? 1 : 0));
  assert.ok(farthest(out, expected) < 1e-5);
});

test('a long way to the one vertex that has a place takes no long time', () => {
  // A strip whose vertices are numbered against the way that the place goes.
  const vertices = 300_000;
  const positions = Float32Array.from({length: 3 * vertices}, (_, i) => i % 3 === 0 ? i / 3 % 7 : 0);
  const faces = Uint32Array.from({length: 3 * (vertices - 2)}, (_, i) => Math.floor(i / 3) + i % 3);
  const has = new Array(vertices).fill(false);
  has[vertices - 1] = true;
  const goals = Float32Array.from(positions, (value) => value + 2);
  const begin = performance.now();
  const out = new Float32Array(positions.length);
  new Morph({positions, faces}, goals, has).at(1, out);
  assert.ok(performance.now() - begin < 5000, `${performance.now() - begin} ms`);
  assert.ok(out.every((value, i) => Math.abs(value - goals[i]) < 1e-5));
});

test('gray is explained, of vertices that are seen', () => {
  // A square each; vertex 4 of X is on no face.
  const faces = Uint32Array.from([0, 1, 2, 0, 2, 3]);
  const meshes = {x: {faces, vertices: 5}, y: {faces, vertices: 4}};
  const color = [1, 2, 3];
  const text = (without, gray) => grayText(
      {meshes, hasCounterpart: (side, v) => !without[side].includes(v)},
      {x: (v) => gray.x.includes(v) ? null : color, y: (v) => gray.y.includes(v) ? null : color});
  const none = {x: [], y: []};
  assert.equal(text(none, none), '');
  assert.equal(text({x: [4], y: []}, {x: [4], y: []}), '');
  assert.equal(text({x: [1, 4], y: [0, 3]}, {x: [1, 4], y: [0, 3]}),
      'no counterpart (1 vertices of X, 2 of Y)');
  assert.equal(text(none, {x: [], y: [1]}), 'no value');
  assert.equal(text({x: [1], y: []}, {x: [1, 2], y: []}),
      'no counterpart (1 vertices of X, 0 of Y); no value');
});

test('a morph of no places stays where it is', () => {
  const mesh = bumpySphere(4);
  const out = new Float32Array(mesh.positions.length);
  new Morph(mesh, new Float32Array(mesh.positions.length),
      Array.from({length: mesh.positions.length / 3}, () => false)).at(1, out);
  assert.ok(out.every(Number.isFinite));
});

const pairs = (list) => list.pins.map(({x, y}) => [x, y]);

test('clicks make pins, one end after the other, in either order', () => {
  const list = new PinList({x: 100, y: 50});
  assert.match(list.pick('x', 3), /Pin 1: now click its partner on Y/);
  assert.equal(list.pick('y', 4), 'Pin 1: X 3, Y 4.');
  list.pick('y', 5);
  list.pick('x', 6);
  assert.deepEqual(pairs(list), [[3, 4], [6, 5]]);
  // A second click on the same side begins another.
  list.pick('x', 7);
  list.pick('x', 8);
  assert.deepEqual(pairs(list), [[3, 4], [6, 5], [7, null], [8, null]]);
  assert.equal(list.complete().length, 2);
});

test('a pin may begin with the partner of the map, which the next click replaces', () => {
  const list = new PinList({x: 100, y: 50});
  assert.match(list.pick('x', 3, 30), /the map's partner is on Y/);
  assert.deepEqual(pairs(list), [[3, 30]]);
  list.pick('y', 31, 99);
  assert.deepEqual(pairs(list), [[3, 31]]);
  list.pick('x', 4, 32);
  list.pick('x', 5, 32);  // taken
  assert.deepEqual(pairs(list), [[3, 31], [4, 32], [5, null]]);
});

test('a vertex has one pin; a chosen pin can be moved, renamed and removed', () => {
  const list = new PinList({x: 100, y: 50});
  list.add(1, 2);
  list.add(3, 4);
  assert.match(list.add(9, 4), /Y 4 is in pin 2 already/);
  assert.match(list.pick('y', 2), /pinned already: pin 1/);
  list.pick('y', 7);
  list.pick('x', 8);
  assert.deepEqual(pairs(list), [[8, 7], [3, 4]]);
  list.rename(1, '  left\near ');
  assert.equal(list.pins[1].name, 'left ear');
  list.remove(0);
  assert.deepEqual(pairs(list), [[3, 4]]);
});

test('all of it can be undone, step by step', () => {
  const list = new PinList({x: 100, y: 50});
  list.pick('x', 1);
  list.pick('y', 2);
  list.rename(0, 'nose');
  list.add(3, 4);
  list.clear();
  const states = [];
  while (list.canUndo()) {
    list.undo();
    states.push(JSON.stringify([pairs(list), list.pins.map(({name}) => name)]));
  }
  assert.deepEqual(states, [
    '[[[1,2],[3,4]],["nose",""]]', '[[[1,2]],["nose"]]', '[[[1,2]],[""]]', '[[[1,null]],[""]]', '[[],[]]']);
});

test('the landmarks file reads back, names and all', () => {
  const list = new PinList({x: 100, y: 50});
  list.add(99, 49, 'tip # of the tail');
  list.add(0, 0);
  list.pick('x', 5);
  const text = list.text({x: 'a\nb.off', y: 'c.off'});
  assert.deepEqual(text.split('\n').filter((line) => !line.startsWith('#')),
      ['99 49 # tip # of the tail', '0 0', '']);
  assert.match(text, /^# X: a b\.off, 100 vertices$/m);
  const again = new PinList({x: 100, y: 50});
  again.read(text);
  assert.deepEqual(again.pins, list.complete());
});

test('a wrong landmarks file is refused with its line, and changes nothing', () => {
  const list = new PinList({x: 100, y: 50});
  list.add(1, 1);
  for (const [text, message] of [
    ['1 2\n3\n', /line 2: found '3'/],
    ['# x\n\n100 2\n', /line 3: found '100 2', expected two vertices, of X 0 to 99 and of Y 0 to 49/],
    ['1 50', /line 1/], ['-1 2', /line 1/], ['1.5 2', /line 1/], ['a b', /line 1/], ['1 2 3', /line 1/],
    ['1 2\n3 2\n', /line 2: Y 2 has a partner in line 1 already/], ['# nothing', /no line has two/],
  ]) {
    assert.throws(() => list.read(text), message, text);
  }
  assert.deepEqual(pairs(list), [[1, 1]]);
  list.read('1,2\r\n3\t4 # named\r\n');
  assert.deepEqual(pairs(list), [[1, 2], [3, 4]]);
});

test('numbers are written one way', () => {
  assert.equal(count(1234567), '1,234,567');
  assert.equal(decimal(-0.5, 3), '\u22120.5');
  assert.equal(fixed(0.8, 2), '0.80');
  assert.equal(percent(0.051), '5\u202f%');
  for (const [text, expected] of [
    ['2999 of 3000', '2,999 of 3,000'], ['-0.25', '\u22120.25'], ['99.97 %', '99.97\u202f%'],
    ['0.00503', '0.00503'], ['12345.678', '12345.678'], ['1e-05', '1e-05'],
    ['a-1 is text', 'a-1 is text'], ['orientation (-1 to 1)', 'orientation (\u22121 to 1)'],
  ]) {
    assert.equal(typeset(text), expected);
  }
});
