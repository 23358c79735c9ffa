// Pairs of vertices that a person pins, and the landmarks file about them.

const MOST_UNDONE = 200;
const SIDES = ['x', 'y'];

const oneLine = (text) => text.replace(/\s+/g, ' ').trim();

/** The names that a person gives stand behind the numbers, as comments. */
const lineOf = ({x, y, name}) => `${x} ${y}${name ? ` # ${name}` : ''}`;

/** Returns [x, y, name]; null for a line that says nothing. Throws what is wrong. */
function parseLine(line, number, counts) {
  const hash = line.indexOf('#');
  const name = hash < 0 ? '' : oneLine(line.slice(hash + 1));
  const words = (hash < 0 ? line : line.slice(0, hash)).trim();
  if (words === '') return null;
  const fields = words.split(/[\s,]+/).filter((word) => word !== '');
  const fits = (word, side) => /^\d+$/.test(word) && Number(word) < counts[side];
  if (fields.length !== 2 || !fits(fields[0], 'x') || !fits(fields[1], 'y')) {
    throw new Error(`line ${number}: found '${words.slice(0, 40)}', expected two vertices, ` +
        `of X 0 to ${counts.x - 1} and of Y 0 to ${counts.y - 1}`);
  }
  return {x: Number(fields[0]), y: Number(fields[1]), name};
}

export class PinList {
  /** @param counts how many vertices `x` and `y` have */
  constructor(counts) {
    this.counts = counts;
    /** Each has `x` and `y`, null where there is none yet, `name`, and `suggested`: the
     * side that the map filled in, '' once a person has chosen. */
    this.pins = [];
    /** Which pin the next click goes to; -1 for a new one. */
    this.current = -1;
    /** Whether the current pin was chosen to be moved. */
    this.moves = false;
    this.past = [];
  }

  remember() {
    this.past.push(JSON.stringify({pins: this.pins, current: this.current}));
    if (this.past.length > MOST_UNDONE) this.past.shift();
  }

  canUndo() { return this.past.length > 0; }

  undo() {
    if (!this.canUndo()) return;
    Object.assign(this, JSON.parse(this.past.pop()), {moves: false});
  }

  /** The number of the pin that has this vertex; -1 for none. */
  find(side, vertex) { return this.pins.findIndex((pin) => pin[side] === vertex); }

  /**
   * Takes a click on a vertex: it completes or moves the current pin, or begins one,
   * whose other side is `partner` unless that is null or pinned already. Returns what
   * is to be told.
   */
  pick(side, vertex, partner = null) {
    const other = side === 'x' ? 'y' : 'x';
    const there = this.find(side, vertex);
    if (there >= 0 && there !== this.current) {
      this.choose(there);
      return `${side.toUpperCase()} ${vertex} is pinned already: pin ${there + 1} is chosen.`;
    }
    this.remember();
    const pin = this.pins[this.current];
    if (pin && (this.moves || pin[side] === null || pin.suggested === side)) {
      pin[side] = vertex;
      if (pin.suggested === side) pin.suggested = '';
      const number = this.current + 1;
      if (!this.moves && pin[other] !== null) this.current = -1;
      return pin[other] === null ? this.wants(number, other) : `Pin ${number}: X ${pin.x}, Y ${pin.y}.`;
    }
    const free = partner !== null && this.find(other, partner) < 0;
    this.pins.push({x: null, y: null, name: '', suggested: free ? other : '',
      [side]: vertex, [other]: free ? partner : null});
    this.current = this.pins.length - 1;
    this.moves = false;
    return this.wants(this.pins.length, other);
  }

  wants(number, side) {
    return this.pins[number - 1][side] === null ?
        `Pin ${number}: now click its partner on ${side.toUpperCase()}.` :
        `Pin ${number}: the map's partner is on ${side.toUpperCase()}; click there for another.`;
  }

  /** Adds a pair. Returns why not; '' when it was added. */
  add(x, y, name = '') {
    for (const [side, vertex] of [['x', x], ['y', y]]) {
      const there = this.find(side, vertex);
      if (there >= 0) return `${side.toUpperCase()} ${vertex} is in pin ${there + 1} already.`;
    }
    this.remember();
    this.pins.push({x, y, name: oneLine(name), suggested: ''});
    this.current = -1;
    return '';
  }

  /** The next clicks move the ends of this pin; -1 for no more. */
  choose(index) {
    this.current = index;
    this.moves = index >= 0;
  }

  rename(index, name) {
    if (this.pins[index].name === oneLine(name)) return;
    this.remember();
    this.pins[index].name = oneLine(name);
  }

  remove(index) {
    this.remember();
    this.pins.splice(index, 1);
    this.choose(-1);
  }

  clear() {
    this.remember();
    this.pins = [];
    this.choose(-1);
  }

  complete() { return this.pins.filter((pin) => SIDES.every((side) => pin[side] !== null)); }

  /** The landmarks file, as `isomatch match --landmarks` reads it. */
  text(names) {
    const about = SIDES.map((side) =>
        `# ${side.toUpperCase()}: ${oneLine(names[side])}, ${this.counts[side]} vertices\n`);
    return '# Landmarks for isomatch --landmarks: vertex of X, vertex of Y, counted from 0\n' +
        `${about.join('')}${this.complete().map((pin) => `${lineOf(pin)}\n`).join('')}`;
  }

  /** Puts the pairs of a landmarks file in the place of all. Throws, naming the line. */
  read(text) {
    const pins = [];
    const seen = {x: new Map(), y: new Map()};
    text.split(/\r\n|\r|\n/).forEach((line, i) => {
      const pin = parseLine(line, i + 1, this.counts);
      if (!pin) return;
      for (const side of SIDES) {
        const before = seen[side].get(pin[side]);
        if (before) {
          throw new Error(`line ${i + 1}: ${side.toUpperCase()} ${pin[side]} has a partner ` +
              `in line ${before} already, expected one`);
        }
        seen[side].set(pin[side], i + 1);
      }
      pins.push({...pin, suggested: ''});
    });
    if (pins.length === 0) throw new Error('no line has two vertices, expected lines `x y`');
    this.remember();
    this.pins = pins;
    this.choose(-1);
  }
}
