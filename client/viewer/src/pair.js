// What the page's JSON says, as typed arrays.

/** Entry of a quantized layer that stands for "no value". */
const NO_VALUE = 65535;

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

function attributeOf(draco, decoder, mesh, attribute, type, ArrayType) {
  const count = mesh.num_points() * attribute.num_components();
  const size = count * ArrayType.BYTES_PER_ELEMENT;
  const pointer = draco._malloc(size);
  decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, type, size, pointer);
  const values = new ArrayType(draco.HEAPU8.buffer, pointer, count).slice();
  draco._free(pointer);
  return values;
}

function pointsOfFaces(draco, decoder, mesh) {
  const count = 3 * mesh.num_faces();
  const pointer = draco._malloc(4 * count);
  decoder.GetTrianglesUInt32Array(mesh, 4 * count, pointer);
  const points = new Uint32Array(draco.HEAPU8.buffer, pointer, count).slice();
  draco._free(pointer);
  return points;
}

/**
 * Gives vertices their numbers in the file back, which Draco reorders.
 * @param ids vertex of each decoded point, or null when the order was kept
 */
function inFileOrder({points, faces}, ids, vertices) {
  if (!ids) return {positions: points, faces};
  const positions = new Float32Array(3 * vertices);
  ids.forEach((id, p) => positions.set(points.subarray(3 * p, 3 * p + 3), 3 * id));
  return {positions, faces: faces.map((point) => ids[point])};
}

function decodeMesh(draco, {draco: base64, order, vertices}) {
  const decoder = new draco.Decoder();
  const mesh = new draco.Mesh();
  const bytes = bytesOf(base64);
  const status = decoder.DecodeArrayToMesh(bytes, bytes.length, mesh);
  if (!status.ok()) throw new Error(`a mesh cannot be decoded: ${status.error_msg()}`);
  const position = decoder.GetAttribute(
      mesh, decoder.GetAttributeId(mesh, draco.POSITION));
  const decoded = {
    points: attributeOf(draco, decoder, mesh, position, draco.DT_FLOAT32, Float32Array),
    faces: pointsOfFaces(draco, decoder, mesh),
  };
  let ids = null;
  if (order === 'id') {
    const attribute = decoder.GetAttribute(
        mesh, decoder.GetAttributeIdByMetadataEntry(mesh, 'name', 'vertex_id'));
    ids = attributeOf(draco, decoder, mesh, attribute, draco.DT_UINT32, Uint32Array);
  }
  draco.destroy(mesh);
  draco.destroy(decoder);
  return inFileOrder(decoded, ids, vertices);
}

/** Vertices of X by their image: those of y are xs[first[y]] to xs[first[y + 1]]. */
function invert(yFromX, verticesY) {
  const first = new Uint32Array(verticesY + 1);
  for (const y of yFromX) if (y >= 0) ++first[y + 1];
  for (let y = 0; y < verticesY; ++y) first[y + 1] += first[y];
  const xs = new Uint32Array(first[verticesY]);
  const next = first.slice();
  yFromX.forEach((y, x) => { if (y >= 0) xs[next[y]++] = x; });
  return (y) => xs.subarray(first[y], first[y + 1]);
}

/** A layer's values as numbers; `of(side, v)` is null where there is none. */
function layerOf(layer) {
  const steps = {x: new Uint16Array(bytesOf(layer.x).buffer),
                 y: new Uint16Array(bytesOf(layer.y).buffer)};
  const [least, greatest] = layer.range;
  const value = (step) => step === NO_VALUE ? null :
      least + (greatest - least) * step / (NO_VALUE - 1);
  const palette = bytesOf(layer.palette);
  return {
    ...layer, palette, count: steps.x.length,
    of: (side, v) => value(steps[side][v]),
    /** Index in the palette of a value, clamped to the scale. */
    shade: (number) => Math.round(255 * Math.min(1, Math.max(0,
        (number - layer.low) / (layer.high - layer.low)))),
  };
}

/**
 * Where X's vertices lie on Y: `of(values, x)` is what the three numbers that
 * each vertex of Y has in `values` are there.
 */
function placesOf(yFromX, precise) {
  if (!precise) {
    return {of: (values, x) => values.subarray(3 * yFromX[x], 3 * yFromX[x] + 3)};
  }
  const corners = new Int32Array(bytesOf(precise.corners).buffer);
  const weights = new Uint16Array(bytesOf(precise.weights).buffer);
  const corner = (x, i) => ({y: corners[3 * x + i], weight: weights[3 * x + i] / 65535});
  return {
    of: (values, x) => [0, 1, 2].map((axis) => [0, 1, 2].reduce((sum, i) => {
      const {y, weight} = corner(x, i);
      return sum + weight * values[3 * y + axis];
    }, 0)),
    /** The vertices of Y around it, with their weights. */
    around: (x) => [0, 1, 2].map((i) => corner(x, i)).filter(({weight}) => weight > 0),
  };
}

/** Reads the page's data. `wasm` is Draco's decoder. */
export async function readPair(json, wasm) {
  const draco = await globalThis.DracoDecoderModule({wasmBinary: wasm});
  const yFromX = new Int32Array(bytesOf(json.map).buffer);
  const matchedY = json.matched_y && bytesOf(json.matched_y);
  const meshes = {x: {...json.x, ...decodeMesh(draco, json.x)},
                  y: {...json.y, ...decodeMesh(draco, json.y)}};
  return {
    ...json, meshes, yFromX,
    places: placesOf(yFromX, json.precise),
    xsOf: invert(yFromX, json.y.vertices),
    hasCounterpart: (side, v) => side === 'x' ? yFromX[v] >= 0 : !matchedY || matchedY[v] !== 0,
    colors: bytesOf(json.colors),
    layers: json.layers.map(layerOf),
  };
}
