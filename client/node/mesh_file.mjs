// Reads triangle meshes; vertices keep the file's number and order.

import {readFileSync} from 'node:fs';
import {extname} from 'node:path';

const PLY_SIZES = {
  char: 1, uchar: 1, int8: 1, uint8: 1, short: 2, ushort: 2, int16: 2, uint16: 2,
  int: 4, uint: 4, int32: 4, uint32: 4, float: 4, float32: 4, double: 8, float64: 8,
};

const wordsOf = (line) => line.replace(/#.*/, '').split(/\s+/).filter(Boolean);
const linesOf = (text) => text.split('\n').map(wordsOf).filter((words) => words.length > 0);

function readOff(bytes) {
  const [header, ...rest] = linesOf(bytes.toString());
  if (header?.[0] !== 'OFF') throw new Error('it does not begin with OFF');
  const [n, m] = (header.length > 1 ? header.slice(1) : rest.shift()).map(Number);
  return {vertices: rest.slice(0, n), faces: rest.slice(n, n + m).map(cornersAfterCount)};
}

const cornersAfterCount = (row) => row.slice(1, 1 + Number(row[0])).map(Number);

function readObj(bytes) {
  const vertices = [];
  const faces = [];
  for (const [keyword, ...words] of linesOf(bytes.toString())) {
    if (keyword === 'v') vertices.push(words);
    if (keyword !== 'f') continue;
    const numbers = words.map((word) => parseInt(word, 10));
    faces.push(numbers.map((i) => i > 0 ? i - 1 : vertices.length + i));
  }
  return {vertices, faces};
}

/** The elements of a PLY header: [{name, count, properties}, ...]. */
function plyElements(lines) {
  const elements = [];
  for (const [keyword, ...words] of lines) {
    if (keyword === 'element') {
      elements.push({name: words[0], count: Number(words[1]), properties: []});
    } else if (keyword === 'property') {
      const list = words[0] === 'list';
      elements.at(-1).properties.push(
          list ? {name: words[3], type: words[2], length: words[1]}
               : {name: words[1], type: words[0]});
    }
  }
  return elements;
}

/** Returns a function that gives the next number of a type. */
function plyNumbers(body, format) {
  if (format === 'ascii') {
    const words = body.toString().split(/\s+/).filter(Boolean).values();
    return () => Number(words.next().value);
  }
  const little = format === 'binary_little_endian';
  const view = new DataView(body.buffer, body.byteOffset, body.byteLength);
  let at = 0;
  return (type) => {
    const bits = 8 * PLY_SIZES[type];
    const kind = /^(float|double)/.test(type) ? 'Float' : /^u/.test(type) ? 'Uint' : 'Int';
    const value = view[`get${kind}${bits}`](at, little);
    at += PLY_SIZES[type];
    return value;
  };
}

function readPly(bytes) {
  const end = bytes.indexOf('\n', bytes.indexOf('end_header'));
  const header = bytes.subarray(0, end).toString().split('\n').map(wordsOf);
  if (header[0]?.[0] !== 'ply') throw new Error('it does not begin with ply');
  const format = header.find(([keyword]) => keyword === 'format')[1];
  const next = plyNumbers(bytes.subarray(end + 1), format);
  const rows = {vertex: [], face: []};
  for (const {name, count, properties} of plyElements(header)) {
    for (let i = 0; i < count; ++i) {
      const row = {};
      for (const property of properties) {
        row[property.name] = property.length
            ? Array.from({length: next(property.length)}, () => next(property.type))
            : next(property.type);
      }
      rows[name]?.push(row);
    }
  }
  return {
    vertices: rows.vertex.map(({x, y, z}) => [x, y, z]),
    faces: rows.face.map((row) => row.vertex_indices ?? row.vertex_index),
  };
}

const READERS = {'.off': readOff, '.obj': readObj, '.ply': readPly};

/**
 * Returns {vertices, faces} of an OFF, OBJ or PLY file with triangles:
 * a Float32Array of 3n and a Uint32Array of 3m numbers.
 */
export function readMesh(path) {
  const reader = READERS[extname(path).toLowerCase()];
  if (!reader) throw new Error(`${path}: expected an .off, .obj or .ply file`);
  try {
    const {vertices, faces} = reader(readFileSync(path));
    const wrong = faces.findIndex(
        (face) => face.length !== 3 || face.some((i) => !(i >= 0 && i < vertices.length)));
    if (wrong >= 0) {
      throw new Error(`face ${wrong} is [${faces[wrong]}], expected three of the vertices ` +
                      `0 to ${vertices.length - 1}`);
    }
    const positions = Float32Array.from(vertices.flatMap((row) => row.slice(0, 3).map(Number)));
    if (positions.length !== 3 * vertices.length || !positions.every(Number.isFinite)) {
      throw new Error('a vertex is not three numbers');
    }
    return {vertices: positions, faces: Uint32Array.from(faces.flat())};
  } catch (error) {
    throw new Error(`${path}: ${error.message}`);
  }
}
