// The verdict, tables of figures and warnings, with what they mean.
import {element} from './element.js';
import {typeset} from './numbers.js';

const SIGNS = {good: '\u2713', doubtful: '?', bad: '\u2715'};

/** What it means of a label, shown on hover, tap and focus. */
function explained(label, text, id) {
  if (!text) return [typeset(label)];
  return [
    element('button', {type: 'button', class: 'explained', 'aria-describedby': id},
        typeset(label)),
    element('span', {role: 'tooltip', class: 'tip', id}, text),
  ];
}

/** A level of verdicts by color and sign, with what it is called. */
export function badge(level, ...called) {
  return element('span', {class: `badge ${level.replace(/\W+/g, '-')}`},
      element('span', {'aria-hidden': 'true'}, SIGNS[level] ?? '\u2022'), ' ',
      ...called.length > 0 ? called : [level]);
}

/** Whether the map is good, as the report says, why, and what to do. */
export function verdict({level, reason, advice}, explanations) {
  const why = element('span', {class: 'why'}, typeset(reason));
  const made = element('p', {class: 'verdict'},
      badge(level, ...explained(`${level} map`, explanations.verdict, 'tip-verdict')), why);
  if (advice) made.append(element('span', {class: 'advice'}, typeset(advice)));
  return made;
}

/** One table, its rows of label and value. */
export function table({title, rows}, explanations) {
  const made = element('table', {}, element('caption', {}, title));
  rows.forEach(([label, value], i) => {
    const id = `tip-${title}-${i}`.replace(/\W+/g, '-');
    made.append(element('tr', {},
        element('th', {scope: 'row'}, ...explained(label, explanations[label], id)),
        element('td', {}, typeset(value))));
  });
  return element('div', {}, made);
}

export function list(title, items) {
  return element('div', {}, element('h2', {}, title),
      element('ul', {}, ...items.map((item) => element('li', {}, item))));
}

/** Escape puts a tip away, as readers of screens and keyboards expect. */
export function letEscapeHideTips() {
  document.addEventListener('keydown', ({key}) => {
    const {activeElement} = document;
    if (key === 'Escape' && activeElement?.classList.contains('explained')) activeElement.blur();
  });
}
