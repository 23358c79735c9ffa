// The list of pins, and the buttons around it.
import {byId, element} from './element.js';
import {count} from './numbers.js';
import {pinColor} from './overlay.js';
import {PinList} from './pins.js';
import {save} from './save.js';

const FILE = 'landmarks.txt';
const HOW = 'Click a vertex on one shape, then its partner on the other.';

export class PinPanel {
  /**
   * @param pair names and numbers of vertices, the map
   * @param surfaces {x, y}
   * @param overlay gets the marks
   * @param draw draws the marks again
   */
  constructor({pair, surfaces, overlay, draw}) {
    Object.assign(this, {pair, surfaces, overlay, draw});
    this.list = new PinList({x: pair.x.vertices, y: pair.y.vertices});
    this.listen();
    this.show(HOW);
  }

  listen() {
    const act = (id, action) => byId(id).addEventListener('click', action);
    act('pin', () => this.open(byId('pins').hidden));
    act('pin-add', () => this.addTyped());
    // Frames of notebooks may forbid forms.
    byId('pin-form').addEventListener('keydown', ({key, target}) => {
      if (key === 'Enter' && target.tagName === 'INPUT') this.addTyped();
    });
    act('pin-undo', () => this.undo());
    act('pin-clear', () => { this.list.clear(); this.show('All pins are removed; Undo brings them back.'); });
    act('pin-export', () => this.export());
    act('pin-import', () => byId('pin-file').click());
    byId('pin-file').addEventListener('change', ({target}) => this.import(target));
    document.addEventListener('keydown', (event) => this.pressed(event));
  }

  get isOpen() { return !byId('pins').hidden; }

  open(open) {
    byId('pins').hidden = !open;
    byId('pin').setAttribute('aria-pressed', open);
    document.body.dataset.pinning = open;
    this.show(HOW);
  }

  pressed(event) {
    if (!this.isOpen || event.target.closest('input, textarea, select')) return;
    if (event.key === 'Escape' && this.list.current >= 0) {
      this.list.choose(-1);
      this.show(HOW);
    }
    if (event.key.toLowerCase() === 'z' && (event.ctrlKey || event.metaKey)) {
      event.preventDefault();
      this.undo();
    }
  }

  /** A vertex was clicked; -1 for none. */
  clicked(side, vertex) {
    if (!this.isOpen || vertex < 0) return;
    const text = this.list.pick(side, vertex, byId('pin-suggest').checked ?
        this.partnerOf(side, vertex) : null);
    const warning = this.pair.hasCounterpart(side, vertex) ? '' :
        `${side.toUpperCase()} ${vertex} has no counterpart by the map. `;
    this.show(warning + text);
  }

  /** What the map says: the image, or the first of those that go there; null for none. */
  partnerOf(side, vertex) {
    const partner = side === 'x' ? this.pair.yFromX[vertex] : this.pair.xsOf(vertex)[0] ?? -1;
    return partner < 0 ? null : partner;
  }

  addTyped() {
    const pair = [];
    for (const side of ['x', 'y']) {
      const {value} = byId(`pin-${side}`);
      const last = this.list.counts[side] - 1;
      const vertex = Number(value);
      if (value === '' || !Number.isInteger(vertex) || vertex < 0 || vertex > last) {
        const found = value === '' ? 'a vertex is missing' : `there is no vertex ${value}`;
        this.show(`${side.toUpperCase()}: ${found}. Its vertices are 0 to ${last}.`, true);
        return;
      }
      pair.push(vertex);
    }
    const refusal = this.list.add(...pair);
    this.show(refusal || `Pin ${this.list.pins.length} is added.`, refusal !== '');
    if (refusal) return;
    for (const side of ['x', 'y']) byId(`pin-${side}`).value = '';
    byId('pin-x').focus();
  }

  undo() {
    this.list.undo();
    this.show('Undone.');
  }

  export() {
    const {pins} = this.list;
    const left = pins.length - this.list.complete().length;
    const text = this.list.text({x: this.pair.x.name, y: this.pair.y.name});
    save(FILE, new Blob([text], {type: 'text/plain'}));
    this.show(left === 0 ? `${FILE} goes to --landmarks of isomatch match.` :
        `${count(left)} without a partner left out of ${FILE}.`);
  }

  async import(input) {
    const [file] = input.files;
    if (!file) return;
    const text = await file.text();
    input.value = '';  // the same file may be chosen again
    try {
      this.list.read(text);
      this.show(`${count(this.list.pins.length)} pins of ${file.name}.`);
    } catch (error) {
      this.show(`${file.name}, ${error.message}`, true);
    }
  }

  tell(text, wrong = false) {
    byId('pin-status').textContent = text;
    byId('pin-status').classList.toggle('error', wrong);
    byId('pin-undo').disabled = !this.list.canUndo();
  }

  /** Makes the rows anew; what had the focus in them has it again, or its neighbor. */
  showRows() {
    const rows = byId('pin-list').children;
    const {activeElement} = document;
    const at = Array.from(rows).findIndex((row) => row.contains(activeElement));
    byId('pin-list').replaceChildren(...this.list.pins.map((pin, i) => this.row(pin, i)));
    if (at < 0) return;
    const row = rows[Math.min(at, rows.length - 1)];
    (row?.querySelector(`.${activeElement.className}`) ?? byId('pin-undo')).focus();
  }

  /** Brings the list, the marks and the buttons up to date. */
  show(text, wrong = false) {
    this.tell(text, wrong);
    this.showRows();
    const {list} = this;
    byId('pin-clear').disabled = list.pins.length === 0;
    byId('pin-export').disabled = list.complete().length === 0;
    byId('pin-count').textContent = list.pins.length > 0 ? ` ${count(list.pins.length)}` : '';
    const marksOf = (side) => list.pins.map((pin, i) => ({
      vertex: pin[side], number: i + 1, color: pinColor(i), chosen: i === list.current,
      place: () => this.surfaces[side].placeOf(pin[side]),
    })).filter(({vertex}) => vertex !== null);
    this.overlay.setPins(this.isOpen ? {x: marksOf('x'), y: marksOf('y')} : {x: [], y: []});
    this.draw();
  }

  row(pin, i) {
    const chosen = i === this.list.current;
    const badge = element('button', {type: 'button', class: 'pin-number', 'aria-pressed': chosen,
      title: 'Choose, and click another vertex to move an end',
      'aria-label': `Pin ${i + 1}: move an end`}, `${i + 1}`);
    badge.style.background = pinColor(i);
    badge.addEventListener('click', () => {
      this.list.choose(chosen ? -1 : i);
      this.show(chosen ? HOW : `Pin ${i + 1}: click where an end shall be; Escape ends this.`);
    });
    const name = element('input', {class: 'pin-name', placeholder: 'name',
      'aria-label': `Name of pin ${i + 1}`, value: pin.name});
    // The list stays: what is pressed or focused next is in it.
    name.addEventListener('change', () => {
      this.list.rename(i, name.value);
      name.value = pin.name;
      this.tell('Renamed.');
    });
    const side = (key) => `${key.toUpperCase()} ${pin[key] ?? '\u2026'}`;
    const remove = element('button', {type: 'button', class: 'pin-remove',
      'aria-label': `Remove pin ${i + 1}`, title: 'Remove'}, '\u2715');
    remove.addEventListener('click', () => {
      this.list.remove(i);
      this.show(`Pin ${i + 1} is removed.`);
    });
    return element('li', {}, badge, name,
        element('span', {class: 'pin-pair'}, `${side('x')} \u2192 ${side('y')}`,
            ...pin.suggested ? [element('small', {}, ' by the map')] : []), remove);
  }
}
