// The marked vertex and its partners: found by the pointer, or typed.
import {byId} from './element.js';
import {count} from './numbers.js';
import {short} from './panels.js';

/** More vertices than these are counted, not named. */
const NAMED = 8;

export class Chooser {
  /** @param onChoose called after another vertex was marked */
  constructor(pair, surfaces, overlay, onChoose) {
    Object.assign(this, {pair, surfaces, overlay, onChoose});
    for (const side of ['x', 'y']) {
      byId(`vertex-${side}`).addEventListener('input', () => this.typed(side));
    }
  }

  typed(side) {
    const field = byId(`vertex-${side}`);
    const {value, validity} = field;
    const last = this.pair[side].vertices - 1;
    const vertex = Number(value);
    const wrong = validity.badInput ||
        (value !== '' && !(Number.isInteger(vertex) && vertex >= 0 && vertex <= last));
    field.setAttribute('aria-invalid', wrong);
    const found = validity.badInput ? 'no number was found' : `there is no vertex ${value}`;
    byId('picker-error').textContent = wrong ?
        `${side.toUpperCase()}: ${found}. Its vertices are 0 to ${last}.` : '';
    this.choose(side, wrong || value === '' ? -1 : vertex);
  }

  /** Marks a vertex and what corresponds to it, and says so; -1 for none. */
  choose(side, vertex) {
    const {yFromX, xsOf} = this.pair;
    let marks = {x: [], y: []};
    if (vertex >= 0 && side === 'x') {
      marks = {x: [vertex], y: yFromX[vertex] < 0 ? [] : [yFromX[vertex]]};
    } else if (vertex >= 0) {
      marks = {x: Array.from(xsOf(vertex)), y: [vertex]};
    }
    this.marks = marks;
    // What X goes to may lie between vertices.
    const placeOnY = (y) => side === 'x' ?
        this.pair.places.of(this.pair.meshes.y.positions, vertex) : this.surfaces.y.placeOf(y);
    this.overlay.setFound({
      x: marks.x.map((x) => this.surfaces.x.placeOf(x)), y: marks.y.map(placeOnY)});
    this.showNumbers();
    byId('found').textContent = vertex < 0 ? 'Point at a vertex, or type its number.' :
        side === 'x' ? this.textOfX(vertex) : this.textOfY(vertex, marks.x);
    this.onChoose();
  }

  /** The fields have the marked vertices, when there is one; not while one types. */
  showNumbers() {
    for (const side of ['x', 'y']) {
      const field = byId(`vertex-${side}`);
      if (field === document.activeElement) continue;
      const of = this.marks[side];
      field.value = of.length === 1 ? of[0] : '';
      field.setAttribute('aria-invalid', false);
    }
    if (document.activeElement?.closest('#picker') === null) byId('picker-error').textContent = '';
  }

  textOfX(x) {
    const y = this.pair.yFromX[x];
    const values = this.pair.layers.map((layer) => [layer, layer.of('x', x)])
        .filter(([, value]) => value !== null)
        .map(([layer, value]) => ` \u00b7 ${layer.id} ${short(value, layer)}`);
    const around = y < 0 ? [] : this.pair.places.around?.(x) ?? [];
    const image = around.length < 2 ? `Y ${y}` : `between Y ${around
        .map((corner) => `${corner.y} (${corner.weight.toFixed(2)})`).join(', ')}`;
    return `X ${x} \u2192 ${y < 0 ? 'no counterpart' : image}${values.join('')}`;
  }

  textOfY(y, xs) {
    if (xs.length === 0) {
      const none = this.pair.hasCounterpart('y', y) ? 'no vertex of X' : 'no counterpart';
      return `Y ${y} \u2190 ${none}`;
    }
    const named = xs.slice(0, NAMED).join(', ');
    const more = xs.length > NAMED ? ` and ${count(xs.length - NAMED)} more` : '';
    return `Y ${y} \u2190 X ${named}${more}`;
  }
}
