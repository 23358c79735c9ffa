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

/** The statements of an OBJ file: a line that ends with a backslash goes on in the next. */
function objStatements(text) {
  const uncommented = text.replaceAll(/#.*/g, '');
  return linesOf(uncommented.replaceAll(/\\[ \t]*\r?\n/g, ' '));
}

/** Points and lines, which are no part of the surface, are passed over. */
function readObj(bytes) {
  const vertices = [];
  const faces = [];
  for (const [keyword, ...words] of objStatements(bytes.toString())) {
    if (keyword === 'v') vertices.push(words);
    if (keyword !== 'f') continue;
    const numbers = words.map((word) => parseInt(word, 10));
    // From 1, or from the last one back; there is no 0.
    faces.push(numbers.map((i) => i > 0 ? i - 1 : i < 0 ? vertices.length + i : NaN));
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

const STL_HEADER_BYTES = 84;
const STL_FACET_BYTES = 50;

/** The corners of the facets, [x, y, z] each. */
function binaryStlCorners(bytes, facets) {
  const corners = [];
  for (let facet = 0; facet < facets; ++facet) {
    const start = STL_HEADER_BYTES + facet * STL_FACET_BYTES + 12;  // after the normal
    for (let at = start; at < start + 36; at += 12) {
      corners.push([0, 4, 8].map((axis) => bytes.readFloatLE(at + axis)));
    }
  }
  return corners;
}

function asciiStlCorners(text) {
  const corners = [];
  let facets = 0;
  let ended = false;
  for (const [keyword, ...words] of text.split('\n').map((line) => line.trim().split(/\s+/))) {
    if (keyword === 'vertex') corners.push(words.slice(0, 3).map(Number));
    if (keyword === 'endsolid') ended = true;
    if (keyword === 'endfacet' && corners.length !== 3 * ++facets) {
      throw new Error(`facet ${facets - 1} has not three corners`);
    }
  }
  if (!ended || corners.length !== 3 * facets) throw new Error('it ends within a solid');
  return corners;
}

/**
 * STL has corners only: those at one place become a vertex, numbered in order of first
 * use, as `isomatch match` does it.
 */
function readStl(bytes) {
  // What is text has a number of facets there that no file is long enough for.
  const facets = bytes.length < STL_HEADER_BYTES ? 0 : bytes.readUInt32LE(STL_HEADER_BYTES - 4);
  const size = STL_HEADER_BYTES + facets * STL_FACET_BYTES;
  const isBinary = bytes.length >= size;
  if (!isBinary && (bytes.includes(0) || !bytes.toString().trimStart().startsWith('solid'))) {
    throw new Error(`${bytes.length} bytes, expected ${size} for ${facets} facets`);
  }
  const corners = isBinary ? binaryStlCorners(bytes, facets) : asciiStlCorners(bytes.toString());
  const vertices = [];
  const numbers = new Map();
  const corner = (place) => {
    const key = place.join();  // of 0 and -0 it is the same
    if (!numbers.has(key)) numbers.set(key, vertices.push(place) - 1);
    return numbers.get(key);
  };
  const used = corners.map(corner);
  const faces = Array.from({length: used.length / 3}, (_, f) => used.slice(3 * f, 3 * f + 3));
  return {vertices, faces};
}

const READERS = {'.off': readOff, '.obj': readObj, '.ply': readPly, '.stl': readStl};

/**
 * Returns {vertices, faces} of an OFF, OBJ, PLY or STL file with triangles:
 * a Float64Array of 3n and a Uint32Array of 3m numbers.
 */
export function readMesh(path) {
  const reader = READERS[extname(path).toLowerCase()];
  if (!reader) throw new Error(`${path}: expected an .off, .obj, .ply or .stl file`);
  try {
    const {vertices, faces} = reader(readFileSync(path));
    const wrong = faces.findIndex(
        (face) => face.length !== 3 || face.some((i) => !(i >= 0 && i < vertices.length)));
    if (wrong >= 0) {
      throw new Error(`face ${wrong} is [${faces[wrong]}], expected three of the vertices ` +
                      `0 to ${vertices.length - 1}`);
    }
    const positions = Float64Array.from(vertices.flatMap((row) => row.slice(0, 3).map(Number)));
    if (positions.length !== 3 * vertices.length || !positions.every((x) => Number.isFinite(Math.fround(x)))) {
      throw new Error('a vertex is not three numbers');
    }
    return {vertices: positions, faces: Uint32Array.from(faces.flat())};
  } catch (error) {
    throw new Error(`${path}: ${error.message}`);
  }
}
