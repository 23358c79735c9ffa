// A list of pairs, and the page of the chosen one in a frame. What it gets is
// written by client/viewer/folder_page.cc.
import {byId, element} from './element.js';
import {badge} from './figures.js';
import {count, fixed} from './numbers.js';
import {save} from './save.js';

const VERDICTS = ['bad', 'doubtful', 'good'];
const FAILED = 'no map';

/** Columns of figures: their name in the data, above them, decimals, and what they mean. */
const FIGURES = [
  ['confidence', 'Confidence', 2, 'How far each vertex can be trusted, on average, 0 to 1'],
  ['geodesic_distortion', 'Distortion', 3, 'How much distances along the surface change'],
  ['coverage', 'Coverage', 2, 'The part of Y that is reached, 0 to 1'],
  ['symmetry_confidence', 'Symmetry', 2, 'How clearly better than a mirrored map, 0 to 1'],
  ['direct', 'Error', 4, 'Mean geodesic error / diameter of Y, against the truth'],
  ['best', 'Best error', 4, 'The same, or against the mirrored truth if that is less'],
  ['vertices_x', 'X vertices', 0, 'Vertices of X'],
  ['vertices_y', 'Y vertices', 0, 'Vertices of Y'],
  ['seconds', 'Seconds', 2, 'From the start of the job until its result was there'],
];

const titleOf = ({name, x, y}) => x && y ? `${x} \u2192 ${y}` : name;
const verdictOf = ({failure, verdict}) =>
    failure ? FAILED : VERDICTS.includes(verdict) ? verdict : 'not judged';

/** The name that the address ends with; '' where it is none. */
function nameInAddress() {
  try {
    return decodeURIComponent(globalThis.location.hash.slice(1));
  } catch {
    return '';
  }
}

const escapeHtml = (text) => text.replace(/[&<>"]/g, (sign) => `&#${sign.charCodeAt(0)};`);

class Folder {
  constructor({pairs}) {
    this.pairs = pairs.map((pair, index) => ({...pair, index}));
    this.columns = this.columnsOf(pairs);
    this.sorting = {key: 'verdict', falling: false};
    this.verdict = 'all';
    this.listen();
    this.showHead();
    this.showRows();
    this.openNamed();
  }

  columnsOf(pairs) {
    const figures = FIGURES.filter(([name]) => pairs.some((pair) => name in pair.figures))
        .map(([name, label, decimals, title]) => ({
          key: name, label, title, class: 'figure',
          value: (pair) => pair.figures[name] ?? null,
          text: (value) => decimals === 0 ? count(value) : fixed(value, decimals)}));
    return [
      {key: 'pair', label: 'Pair', class: 'text pair', value: titleOf},
      {key: 'verdict', label: 'Verdict', class: 'text', title: 'Whether the map is good; worst first',
        value: (pair) => [FAILED, ...VERDICTS, 'not judged'].indexOf(verdictOf(pair))},
      ...figures,
    ];
  }

  listen() {
    byId('filter').addEventListener('input', () => this.showRows());
    byId('close').addEventListener('click', () => this.close());
    byId('previous').addEventListener('click', () => this.step(-1));
    byId('next').addEventListener('click', () => this.step(1));
    byId('keep').addEventListener('click', () => save(`${this.opened.name}.html`,
        new Blob([this.documentOf(this.opened)], {type: 'text/html'})));
    globalThis.addEventListener('hashchange', () => this.openNamed());
    this.showVerdicts();
  }

  showVerdicts() {
    const counts = new Map();
    for (const pair of this.pairs) {
      counts.set(verdictOf(pair), (counts.get(verdictOf(pair)) ?? 0) + 1);
    }
    const there = ['good', 'doubtful', 'bad', FAILED, 'not judged'].filter((name) => counts.has(name));
    byId('summary').textContent = `${count(this.pairs.length)} pairs: ` +
        there.map((name) => `${count(counts.get(name))} ${name}`).join(', ');
    for (const name of ['all', ...there]) {
      const input = element('input', {type: 'radio', name: 'verdict', value: name});
      input.checked = name === 'all';
      byId('verdicts').append(element('label', {}, input, name));
    }
    byId('verdicts').addEventListener('change', ({target}) => {
      this.verdict = target.value;
      this.showRows();
    });
  }

  showHead() {
    const {key, falling} = this.sorting;
    byId('columns').replaceChildren(element('th', {class: 'picture'}), ...this.columns.map((column) => {
      const sorted = column.key === key;
      const button = element('button', {type: 'button', class: 'sort', title: column.title ?? false},
          column.label);
      button.addEventListener('click', () => this.sortBy(column));
      return element('th', {scope: 'col', class: `${column.class}${sorted ? ' sorted' : ''}`,
        'aria-sort': sorted && (falling ? 'descending' : 'ascending')}, button);
    }));
  }

  sortBy({key}) {
    this.sorting = {key, falling: this.sorting.key === key && !this.sorting.falling};
    this.showHead();
    this.showRows();
    byId('columns').querySelector('[aria-sort] button').focus();
  }

  /** The pairs that are listed, in order; those without a value last. */
  listed() {
    const words = byId('filter').value.toLowerCase().split(/\s+/);
    const {key, falling} = this.sorting;
    const {value} = this.columns.find((column) => column.key === key);
    const compare = (a, b) => {
      const [u, v] = [value(a), value(b)];
      if (u === null || v === null) return (u === null) - (v === null);
      return (falling ? -1 : 1) * (typeof u === 'string' ? u.localeCompare(v, 'en', {numeric: true}) : u - v);
    };
    return this.pairs
        .filter((pair) => this.verdict === 'all' || verdictOf(pair) === this.verdict)
        .filter((pair) => words.every((word) => titleOf(pair).toLowerCase().includes(word)))
        .sort((a, b) => compare(a, b) || a.index - b.index);
  }

  showRows() {
    const pairs = this.listed();
    byId('none').hidden = pairs.length > 0;
    byId('rows').replaceChildren(...pairs.map((pair) => this.row(pair)));
    if (this.opened) this.showWhich();
  }

  row(pair) {
    const picture = element('td', {class: 'picture'});
    if (pair.png) picture.append(element('img', {src: `data:image/png;base64,${pair.png}`, alt: ''}));
    const link = pair.failure ? element('span', {}, titleOf(pair)) :
        element('a', {href: `#${encodeURIComponent(pair.name)}`}, titleOf(pair));
    const name = element('td', {class: 'text pair'}, link);
    if (pair.failure || pair.reason) name.append(element('small', {}, pair.failure || pair.reason));
    const row = element('tr', {class: pair.failure ? 'failed' : '',
      'aria-current': pair === this.opened && 'true'}, picture, name,
    element('td', {class: 'text'}, badge(verdictOf(pair))),
    ...this.columns.slice(2).map((column) => {
      const value = column.value(pair);
      const sorted = column.key === this.sorting.key ? ' sorted' : '';
      return element('td', {class: `figure${sorted}`}, value === null ? '' : column.text(value));
    }));
    // A frame's own address may be another page's, so the link is not followed.
    row.addEventListener('click', (event) => {
      event.preventDefault();
      if (!pair.failure) this.open(pair);
    });
    return row;
  }

  openNamed() {
    const name = nameInAddress();
    const pair = this.pairs.find((candidate) => candidate.name === name && !candidate.failure);
    if (pair && pair !== this.opened) this.open(pair);
  }

  /** The page of a pair whose data is here. */
  documentOf(pair) {
    this.template ??= JSON.parse(byId('template').textContent);
    return this.template.replaceAll('<!--TITLE-->', () => escapeHtml(titleOf(pair)))
        .replace('<!--PAIR-->', () => byId(`data-${pair.index}`).textContent);
  }

  open(pair) {
    this.opened = pair;
    const frame = element('iframe', {title: titleOf(pair)});
    const address = pair.page.split('/').map(encodeURIComponent).join('/');
    if (pair.here) frame.srcdoc = this.documentOf(pair); else frame.src = address;
    byId('frame').replaceChildren(frame);
    byId('keep').hidden = !pair.here;
    byId('own-tab').hidden = pair.here;
    byId('own-tab').href = address;
    byId('shown-pair').hidden = false;
    document.body.classList.add('opened');
    if (globalThis.parent === globalThis) {
      globalThis.history.replaceState(null, '', `#${encodeURIComponent(pair.name)}`);
    }
    this.showRows();
    byId('rows').querySelector('[aria-current]')?.scrollIntoView({block: 'nearest'});
  }

  shownPairs() { return this.listed().filter((pair) => !pair.failure); }

  showWhich() {
    const pairs = this.shownPairs();
    const at = pairs.indexOf(this.opened);
    byId('which').textContent = titleOf(this.opened) +
        (at < 0 ? '' : ` \u00b7 ${count(at + 1)} of ${count(pairs.length)}`);
    byId('previous').disabled = at <= 0;
    byId('next').disabled = at < 0 || at === pairs.length - 1;
  }

  step(by) {
    const pairs = this.shownPairs();
    this.open(pairs[pairs.indexOf(this.opened) + by]);
  }

  close() {
    byId('frame').replaceChildren();
    byId('shown-pair').hidden = true;
    document.body.classList.remove('opened');
    const {name} = this.opened;
    this.opened = null;
    if (globalThis.parent === globalThis) globalThis.history.replaceState(null, '', '#');
    this.showRows();
    byId('rows').querySelector(`a[href="#${CSS.escape(encodeURIComponent(name))}"]`)?.focus();
  }
}

new Folder(JSON.parse(byId('pairs').textContent));
document.body.dataset.ready = 'true';
