// Puts the page together. What it gets is written by client/viewer/page.cc.
import wasm from 'three/examples/jsm/libs/draco/draco_decoder.wasm';
import {element, histogram, list, short, showScale, table} from './panels.js';
import {readPair} from './pair.js';
import {Stage} from './stage.js';
import {Surface} from './surface.js';

/** Stripes along the longest side of Y's box. */
const STRIPES = 10;
/** More vertices than these are counted, not named. */
const NAMED = 8;

const byId = (id) => document.getElementById(id);
const count = (number) => number.toLocaleString('en').replaceAll(',', '\u202f');

/** Y's own positions in stripes, the longest side of its box being x. */
function placesOfY({positions}) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  positions.forEach((value, i) => {
    low[i % 3] = Math.min(low[i % 3], value);
    high[i % 3] = Math.max(high[i % 3], value);
  });
  const extents = low.map((value, axis) => high[axis] - value);
  const longest = extents.indexOf(Math.max(...extents));
  const places = new Float32Array(positions.length);
  for (let i = 0; i < places.length; i += 3) {
    for (let axis = 0; axis < 3; ++axis) {
      const from = (longest + axis) % 3;
      places[i + axis] = STRIPES * (positions[i + from] - low[from]) / extents[longest];
    }
  }
  return places;
}

/** X's vertices take the places of their images. */
function placesOfX({yFromX, places: onY}, placesY) {
  const places = new Float32Array(3 * yFromX.length);
  yFromX.forEach((y, x) => {
    if (y >= 0) places.set(onY.of(placesY, x), 3 * x);
  });
  return places;
}

class Viewer {
  constructor(pair) {
    this.pair = pair;
    const placesY = placesOfY(pair.meshes.y);
    const ratio = Math.min(2, globalThis.devicePixelRatio);
    this.surfaces = {
      x: new Surface(pair.meshes.x, pair.rotation, placesOfX(pair, placesY), ratio),
      y: new Surface(pair.meshes.y, pair.rotation, placesY, ratio),
    };
    this.stage = new Stage(byId('canvas'), {x: byId('pane-x'), y: byId('pane-y')},
        this.surfaces, (side, vertex) => this.choose(side, vertex));
    this.listen();
    this.cover(pair.pattern);
    this.show(pair.layer);
  }

  listen() {
    byId('layers').addEventListener('change', (event) => this.show(event.target.value));
    byId('pattern').addEventListener('change', (event) => this.cover(event.target.value));
    byId('linked').addEventListener('change', (event) => this.stage.link(event.target.checked));
    byId('reset').addEventListener('click', () => this.stage.reset());
    byId('picker').addEventListener('submit', (event) => event.preventDefault());
    for (const side of ['x', 'y']) {
      byId(`vertex-${side}`).addEventListener('input', ({target}) => {
        const vertex = target.value === '' ? -1 : Number(target.value);
        if (target.checkValidity()) this.choose(side, vertex);
      });
    }
  }

  /** Colors both shapes by a layer, 'colors' being the map's own. */
  show(id) {
    const layer = this.pair.layers.find((candidate) => candidate.id === id);
    if (layer) this.paintLayer(layer); else this.paintMap();
    showScale(layer);
    byId('layer-text').textContent = layer ? layer.description :
        'Y is colored by place; each vertex of X has the color of its image. Gray: no image.';
    document.body.dataset.layer = id;
    this.stage.draw();
  }

  cover(pattern) {
    for (const surface of Object.values(this.surfaces)) surface.setPattern(pattern);
    this.stage.draw();
  }

  paintMap() {
    const {colors, yFromX, places} = this.pair;
    this.surfaces.x.paint((x) => yFromX[x] < 0 ? null : places.of(colors, x));
    this.surfaces.y.paint((y) => colors.subarray(3 * y, 3 * y + 3));
  }

  paintLayer(layer) {
    for (const side of ['x', 'y']) {
      this.surfaces[side].paint((v) => {
        const value = layer.of(side, v);
        if (value === null) return null;
        const shade = layer.shade(value);
        return layer.palette.subarray(3 * shade, 3 * shade + 3);
      });
    }
  }

  /** Marks a vertex and what corresponds to it, and says so. */
  choose(side, vertex) {
    const {yFromX, xsOf} = this.pair;
    let marks = {x: [], y: []};
    if (vertex >= 0 && side === 'x') {
      marks = {x: [vertex], y: yFromX[vertex] < 0 ? [] : [yFromX[vertex]]};
    } else if (vertex >= 0) {
      marks = {x: xsOf(vertex), y: [vertex]};
    }
    this.surfaces.x.markPoints(marks.x);
    // What X goes to may lie between vertices.
    const {positions} = this.pair.meshes.y;
    this.surfaces.y.markPlaces(side === 'x' && marks.y.length > 0 ?
        this.pair.places.of(positions, vertex) :
        marks.y.flatMap((y) => [...positions.subarray(3 * y, 3 * y + 3)]));
    this.showNumbers(marks);
    byId('found').textContent = vertex < 0 ? 'Point at a vertex, or type its number.' :
        side === 'x' ? this.textOfX(vertex) : this.textOfY(vertex, marks.x);
    this.stage.draw();
  }

  /** The fields have the marked vertices, when there is one; not while one types. */
  showNumbers(marks) {
    for (const side of ['x', 'y']) {
      const field = byId(`vertex-${side}`);
      if (field === document.activeElement) continue;
      field.value = marks[side].length === 1 ? marks[side][0] : '';
    }
  }

  textOfX(x) {
    const y = this.pair.yFromX[x];
    const values = this.pair.layers.map((layer) => [layer, layer.of('x', x)])
        .filter(([, value]) => value !== null)
        .map(([layer, value]) => ` \u00b7 ${layer.id} ${short(value, layer)}`);
    const around = y < 0 ? [] : this.pair.places.around?.(x) ?? [];
    const image = around.length < 2 ? `Y ${y}` : `between Y ${around
        .map((corner) => `${corner.y} (${corner.weight.toFixed(2)})`).join(', ')}`;
    return `X ${x} \u2192 ${y < 0 ? 'no vertex of Y' : image}${values.join('')}`;
  }

  textOfY(y, xs) {
    if (xs.length === 0) return `Y ${y} \u2190 no vertex of X`;
    const named = Array.from(xs.slice(0, NAMED)).join(', ');
    const more = xs.length > NAMED ? ` and ${count(xs.length - NAMED)} more` : '';
    return `Y ${y} \u2190 X ${named}${more}`;
  }
}

function describe(pair) {
  byId('summary').textContent = pair.summary;
  for (const side of ['x', 'y']) {
    const {name, vertices, faces} = pair[side];
    const text = `${name}: ${count(vertices)} vertices, ${count(faces)} faces`;
    byId(`pane-${side}`).setAttribute('aria-label',
        `Shape ${side.toUpperCase()}, ${text}. Arrow keys turn, plus and minus zoom.`);
    byId(`pane-${side}`).querySelector('.name').append(
        element('b', {}, side.toUpperCase()), ` ${text}`);
    byId(`vertex-${side}`).max = vertices - 1;
  }
  const layers = [{id: 'colors', label: 'Map colors'}, ...pair.layers];
  for (const {id, label} of layers) {
    const input = element('input', {type: 'radio', name: 'layer', value: id});
    input.checked = id === pair.layer;
    byId('layers').append(element('label', {}, input, label));
  }
  byId('pattern').value = pair.pattern;
  byId('figures').append(...pair.figures.map(table));
  if (pair.warnings.length > 0) byId('figures').append(list('Warnings', pair.warnings));
}

async function start() {
  const json = JSON.parse(byId('pair').textContent);
  describe(json);
  const pair = await readPair(json, wasm);
  byId('histograms').append(...pair.layers.map(histogram));
  new Viewer(pair);
  byId('message').textContent = '';
  document.body.dataset.ready = 'true';
}

start().catch((error) => {
  byId('message').textContent = `The shapes cannot be drawn: ${error.message}`;
  console.error(error);
});
