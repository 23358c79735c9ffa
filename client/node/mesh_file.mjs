// Reads triangle meshes; vertices keep the file's number and order.

import {readFileSync} from 'node:fs';
import {extname} from 'node:path';

const PLY_SIZES = {
  char: 1, uchar: 1, int8: 1, uint8: 1, short: 2, ushort: 2, int16: 2, uint16: 2,
  int: 4, uint: 4, int32: 4, uint32: 4, float: 4, float32: 4, double: 8, float64: 8,
};

// Number() and parseInt() take much that is none: '0x10', '', '2abc'.
const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;
const WHOLE = /^[+-]?\d+$/;

function coordinate(word = '') {
  if (!NUMBER.test(word)) throw new Error(`a coordinate is '${word}', expected a finite number`);
  return Number(word);
}

function whole(word = '') {
  if (!WHOLE.test(word)) throw new Error(`'${word}' where a whole number is expected`);
  return Number(word);
}

const place = (words) => [0, 1, 2].map((axis) => coordinate(words[axis]));

const wordsOf = (line) => line.replace(/#.*/, '').split(/\s+/).filter(Boolean);

/** The lines of a text; `line` is the number of the last one that was taken. */
class Lines {
  constructor(text, line = 0) {
    this.rows = text.replace(/\n$/, '').split('\n');
    this.line = line;
  }
  /** The words of the next line, without a comment; none after the last. */
  row() {
    return wordsOf(this.rows[this.line++] ?? '');
  }
  /** Of the next line that has some. */
  next() {
    while (this.line < this.rows.length) {
      const words = this.row();
      if (words.length > 0) return words;
    }
    throw new Error('the file ends');
  }
}

/** What `read` makes of the lines; what is wrong there is told with its line. */
function readLines(lines, read) {
  try {
    return read(lines);
  } catch (error) {
    throw new Error(`line ${lines.line}: ${error.message}`);
  }
}

/** As many items as a header announced; what is wrong is told with its number. */
function items(kind, count, read) {
  return Array.from({length: count}, (_, i) => {
    try {
      return read();
    } catch (error) {
      throw new Error(`${kind} ${i} (0-based) of ${count}: ${error.message}`);
    }
  });
}

function cornersAfterCount([count, ...words]) {
  const corners = words.slice(0, whole(count)).map(whole);
  if (corners.length === Number(count)) return corners;
  throw new Error(`it has ${corners.length} corners, expected ${count}`);
}

function readOffLines(lines) {
  const [magic, ...counts] = lines.next();
  if (magic !== 'OFF') throw new Error(`it begins with '${magic}', expected OFF`);
  const [n, m] = counts.length > 0 ? counts : lines.next();
  const vertices = items('vertex', whole(n), () => place(lines.next()));
  return {vertices, faces: items('face', whole(m), () => cornersAfterCount(lines.next()))};
}

/** The words of a statement: a line that ends with a backslash goes on in the next. */
function objStatement(lines) {
  const words = lines.row();
  while (words.at(-1)?.endsWith('\\')) {
    words.push(words.pop().slice(0, -1), ...lines.row());
  }
  return words.filter(Boolean);
}

/** Of V, V/VT, V//VN or V/VT/VN, from 1, or from the last vertex back; there is no 0. */
function objCorner(word, vertices) {
  const [v, ...others] = word.split('/');
  const isCorner = WHOLE.test(v) && others.length <= 2 &&
      others.every((other) => other === '' || WHOLE.test(other));
  const number = Number(v);
  if (!isCorner || number === 0 || number < -vertices) {
    throw new Error(`a face's corner is '${word}', expected V, V/VT, V//VN or V/VT/VN with ` +
                    `V from 1, or from ${-vertices} to -1 to count back`);
  }
  return number > 0 ? number - 1 : vertices + number;
}

/** Points and lines, which are no part of the surface, are passed over. */
function readObjLines(lines) {
  const vertices = [];
  const faces = [];
  while (lines.line < lines.rows.length) {
    const [keyword, ...words] = objStatement(lines);
    if (keyword === 'v') vertices.push(place(words));
    if (keyword === 'f') faces.push(words.map((word) => objCorner(word, vertices.length)));
  }
  return {vertices, faces};
}

const readOff = (bytes) => readLines(new Lines(bytes.toString()), readOffLines);
const readObj = (bytes) => readLines(new Lines(bytes.toString()), readObjLines);

/** The elements of a PLY header: [{name, count, properties}, ...]. */
function plyElements(lines) {
  const elements = [];
  for (const [keyword, ...words] of lines) {
    if (keyword === 'element') {
      elements.push({name: words[0], count: whole(words[1]), properties: []});
    } else if (keyword === 'property') {
      const list = words[0] === 'list';
      const property = list ? {name: words[3], type: words[2], length: words[1]}
                            : {name: words[1], type: words[0]};
      for (const type of [property.type, property.length ?? 'int']) {
        if (!PLY_SIZES[type]) throw new Error(`property ${property.name} is of type ${type}`);
      }
      elements.at(-1).properties.push(property);
    }
  }
  return elements;
}

/** Returns a function that gives the next number of a text. */
function plyWords(lines) {
  let words = [];
  return () => {
    if (words.length === 0) words = lines.next().reverse();
    const word = words.pop();
    return /^[+-]?(nan|inf)/i.test(word) ? NaN : coordinate(word);  // NaN: of normals
  };
}

/** Returns a function that gives the next number of a type. */
function plyNumbers(body, little) {
  const view = new DataView(body.buffer, body.byteOffset, body.byteLength);
  let at = 0;
  return (type) => {
    const size = PLY_SIZES[type];
    if (at + size > body.byteLength) throw new Error('the file ends');
    const kind = /^(float|double)/.test(type) ? 'Float' : /^u/.test(type) ? 'Uint' : 'Int';
    const value = view[`get${kind}${8 * size}`](at, little);
    at += size;
    return value;
  };
}

function plyRow(properties, next) {
  const row = {};
  for (const {name, type, length} of properties) {
    const count = length ? next(length) : 1;
    if (!(count >= 0 && Number.isInteger(count))) throw new Error(`${name} has ${count} entries`);
    const values = Array.from({length: count}, () => next(type));
    row[name] = length ? values : values[0];
  }
  return row;
}

function plyMesh(elements, next) {
  const rows = {};
  for (const {name, count, properties} of elements) {
    rows[name] = items(name, count, () => plyRow(properties, next));
  }
  const {vertex = [], face = []} = rows;
  return {
    vertices: vertex.map(({x, y, z}) => [x, y, z]),
    faces: face.map((row) => row.vertex_indices ?? row.vertex_index ?? []),
  };
}

function readPly(bytes) {
  const end = bytes.indexOf('\n', bytes.indexOf('end_header'));
  const header = bytes.subarray(0, end).toString().split('\n').map(wordsOf);
  if (header[0][0] !== 'ply' || header.at(-1)[0] !== 'end_header') {
    throw new Error('it has no PLY header, expected `ply` to `end_header`');
  }
  const elements = plyElements(header);
  const format = header.find(([keyword]) => keyword === 'format')?.[1];
  if (format === 'ascii') {
    const lines = new Lines(bytes.toString(), header.length);
    return readLines(lines, () => plyMesh(elements, plyWords(lines)));
  }
  if (!/^binary_(little|big)_endian$/.test(format)) throw new Error(`its format is ${format}`);
  return plyMesh(elements, plyNumbers(bytes.subarray(end + 1), /little/.test(format)));
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

function asciiStlCorners(lines) {
  const corners = [];
  let facets = 0;
  let ended = false;
  while (lines.line < lines.rows.length) {
    const [keyword, ...words] = lines.row();
    if (keyword === 'vertex') corners.push(place(words));
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
  const corners = isBinary ? binaryStlCorners(bytes, facets)
                           : readLines(new Lines(bytes.toString()), asciiStlCorners);
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
    if (faces.length === 0) throw new Error('it has no faces');
    const wrong = faces.findIndex((face) => face.length !== 3 || face.some((i) => !vertices[i]));
    if (wrong >= 0) {
      throw new Error(`face ${wrong} is [${faces[wrong]}], expected three of the vertices ` +
                      `0 to ${vertices.length - 1}`);
    }
    const bad = vertices.findIndex((xyz) => !xyz.every((x) => Number.isFinite(Math.fround(x))));
    if (bad >= 0) {
      throw new Error(`vertex ${bad} is [${vertices[bad]}], expected numbers of single precision`);
    }
    const positions = Float64Array.from(vertices.flat());
    return {vertices: positions, faces: Uint32Array.from(faces.flat())};
  } catch (error) {
    throw new Error(`${path}: ${error.message}`);
  }
}
