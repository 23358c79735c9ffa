// Puts the page together. What it gets is written by client/viewer/page.cc.
import wasm from 'three/examples/jsm/libs/draco/draco_decoder.wasm';
import {Chooser} from './chooser.js';
import {byId, element} from './element.js';
import {letEscapeHideTips, list, table, verdict} from './figures.js';
import {grayText} from './gray.js';
import {Morph} from './morph.js';
import {count, percent} from './numbers.js';
import {Overlay} from './overlay.js';
import {readPair} from './pair.js';
import {histogram, short, showScale} from './panels.js';
import {carriedToX, placesOfY, plainWithoutCounterpart} from './pattern_places.js';
import {PinPanel} from './pin_panel.js';
import {isEmbedded, save} from './save.js';
import {screenshot} from './screenshot.js';
import {Stage} from './stage.js';
import {Surface} from './surface.js';

class Viewer {
  constructor(pair) {
    this.pair = pair;
    const placesY = placesOfY(pair.meshes.y);
    this.surfaces = {
      x: new Surface(pair.meshes.x, pair.rotation, carriedToX(pair, placesY)),
      y: new Surface(pair.meshes.y, pair.rotation, plainWithoutCounterpart(placesY, pair)),
    };
    const overlay = new Overlay(byId('marks'));
    this.stage = new Stage({
      canvas: byId('canvas'), overlay, elements: {x: byId('pane-x'), y: byId('pane-y')},
      surfaces: this.surfaces,
      on: {
        hover: (side, vertex) => this.chooser.choose(side, vertex),
        click: (side, vertex) => this.pins.clicked(side, vertex),
      },
    });
    const drawMarks = () => this.stage.drawMarks();
    this.chooser = new Chooser(pair, this.surfaces, overlay, drawMarks);
    this.pins = new PinPanel({pair, surfaces: this.surfaces, overlay, draw: drawMarks});
    this.listen();
    this.cover(pair.pattern);
    this.show(pair.layer);
  }

  listen() {
    const onChange = (id, act) =>
        byId(id).addEventListener('change', ({target}) => act(target));
    onChange('layers', ({value}) => this.show(value));
    onChange('pattern', ({value}) => this.cover(value));
    onChange('linked', ({checked}) => this.stage.link(checked));
    onChange('wireframe', ({checked}) => this.stage.showEdges(checked));
    onChange('one-finger', ({checked}) => this.stage.turnWithOneFinger(checked));
    byId('morph').addEventListener('input', ({target}) => this.morphTo(Number(target.value)));
    byId('reset').addEventListener('click', () => this.reset());
    byId('screenshot').addEventListener('click', () => this.takePicture());
  }

  /** Colors both shapes by a layer, 'colors' being the map's own. */
  show(id) {
    this.layer = this.pair.layers.find((candidate) => candidate.id === id);
    const colorOf = this.layer ? this.colorsOfLayer(this.layer) : this.colorsOfMap();
    for (const side of ['x', 'y']) this.surfaces[side].paint(colorOf[side]);
    showScale(this.layer);
    this.gray = grayText(this.pair, colorOf);
    byId('gray').hidden = this.gray === '';
    byId('gray-text').textContent = this.gray;
    byId('layer-text').textContent = this.layer ? this.layer.description :
        'Y is colored by place; each vertex of X has the color of its image.';
    document.body.dataset.layer = id;
    this.stage.draw();
  }

  cover(pattern) {
    for (const surface of Object.values(this.surfaces)) surface.setPattern(pattern);
    this.stage.draw();
  }

  /** Colors of the vertices of both shapes, null for gray. */
  colorsOfMap() {
    const {colors, places, hasCounterpart} = this.pair;
    return {
      x: (x) => hasCounterpart('x', x) ? places.of(colors, x) : null,
      y: (y) => hasCounterpart('y', y) ? colors.subarray(3 * y, 3 * y + 3) : null,
    };
  }

  colorsOfLayer(layer) {
    const colorOf = (side) => (v) => {
      const value = this.pair.hasCounterpart(side, v) ? layer.of(side, v) : null;
      if (value === null) return null;
      const shade = layer.shade(value);
      return layer.palette.subarray(3 * shade, 3 * shade + 3);
    };
    return {x: colorOf('x'), y: colorOf('y')};
  }

  /** Shows X on its way to Y: 0 is X itself, 1 where the map puts it on Y. */
  morphTo(part) {
    const {pair} = this;
    this.morph ??= new Morph(pair.meshes.x, carriedToX(pair, pair.meshes.y.positions),
        Array.from(pair.yFromX, (y) => y >= 0));
    this.surfaces.x.move((positions) => this.morph.at(part, positions));
    byId('morph-text').textContent = percent(part);
    document.body.dataset.morph = part;
    this.stage.move();
  }

  reset() {
    if (Number(byId('morph').value) !== 0) {
      byId('morph').value = 0;
      this.morphTo(0);
    }
    this.stage.reset();
  }

  async takePicture() {
    const names = {x: `X  ${this.pair.x.name}`, y: `Y  ${this.pair.y.name}`};
    const scale = this.layer ? {
      layer: this.layer.label, low: short(this.layer.low, this.layer),
      high: short(this.layer.high, this.layer), bar: byId('scale-bar'),
    } : null;
    await save('isomatch.png', await screenshot(this.stage, names, {scale, gray: this.gray}));
  }
}

function describe(pair) {
  byId('summary').textContent = pair.summary;
  if (pair.verdict) byId('summary').after(verdict(pair.verdict, pair.explanations));
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
  byId('figures').append(...pair.figures.map((figure) => table(figure, pair.explanations)));
  if (pair.warnings.length > 0) byId('figures').append(list('Warnings', pair.warnings));
}

async function start() {
  document.body.classList.toggle('embedded', isEmbedded());
  const json = JSON.parse(byId('pair').textContent);
  describe(json);
  letEscapeHideTips();
  const pair = await readPair(json, wasm);
  byId('histograms').append(...pair.layers.map(histogram));
  await new Viewer(pair).stage.begin();
  byId('message').textContent = '';
  document.body.dataset.ready = 'true';
}

start().catch((error) => {
  const why = /WebGL/.test(error.message) ? 'this browser has no WebGL, or it is switched off. ' +
      'isomatch view --png draws a picture without it.' : error.message;
  byId('message').textContent = `The shapes cannot be drawn: ${why}`;
  console.error(error);
});
