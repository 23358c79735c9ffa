// Histograms and the scale of a layer.
import {element} from './element.js';
import {count, decimal, percent} from './numbers.js';

const BINS = 48;

function svg(name, attributes, ...children) {
  const made = document.createElementNS('http://www.w3.org/2000/svg', name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

/** A layer's number, to a thousandth of its scale. */
export function short(number, {low, high}) {
  return decimal(number, Math.max(0, 3 - Math.ceil(Math.log10(high - low))));
}

function valuesOf(layer) {
  const values = [];
  for (let v = 0; v < layer.count; ++v) {
    const value = layer.of('x', v);
    if (value !== null) values.push(value);
  }
  return Float64Array.from(values).sort();
}

function quantile(sorted, fraction) {
  return sorted[Math.min(sorted.length - 1, Math.floor(fraction * sorted.length))];
}

function countsOf(layer, values) {
  const counts = new Array(BINS).fill(0);
  for (const value of values) {
    const bin = Math.floor(BINS * (value - layer.low) / (layer.high - layer.low));
    ++counts[Math.min(BINS - 1, Math.max(0, bin))];
  }
  return counts;
}

function bars(layer, counts, {width, height}) {
  const most = Math.max(...counts);
  return counts.map((count, bin) => {
    const tall = height * count / most;
    const shade = layer.palette.subarray(3 * Math.round(255 * (bin + 0.5) / BINS)).slice(0, 3);
    return svg('rect', {
      x: bin * width / BINS + 0.5, y: height - tall, width: width / BINS - 1, height: tall,
      fill: `rgb(${shade.join()})`,
    });
  });
}

/** A layer's distribution over the vertices of X. */
export function histogram(layer) {
  const title = element('h2', {}, layer.label);
  const values = valuesOf(layer);
  if (values.length === 0) return element('figure', {}, title, 'No vertex has a value.');
  const box = {width: 360, height: 110};
  const number = (value) => short(value, layer);
  const drawing = svg('svg',
      {viewBox: `0 0 ${box.width} ${box.height}`, preserveAspectRatio: 'none', role: 'img'},
      ...bars(layer, countsOf(layer, values), box),
      svg('line', {class: 'axis', x1: 0, x2: box.width, y1: box.height, y2: box.height}));
  const ends = element('div', {class: 'ends'},
      element('span', {}, `${values[0] < layer.low ? '\u2264 ' : ''}${number(layer.low)}`),
      element('span', {}, `${values.at(-1) > layer.high ? '\u2265 ' : ''}${number(layer.high)}`));
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  const text = `${count(values.length)} vertices of X: mean ${number(mean)}, ` +
      `${percent(0.05)} below ${number(quantile(values, 0.05))}, ` +
      `half below ${number(quantile(values, 0.5))}, ` +
      `${percent(0.95)} below ${number(quantile(values, 0.95))}`;
  drawing.setAttribute('aria-label', `Histogram of ${layer.label}: ${text}`);
  return element('figure', {id: `histogram-${layer.id}`}, title, drawing, ends,
      element('figcaption', {}, `${text}. ${layer.description}`));
}

/** The legend of a layer; without one, of none. */
export function showScale(layer) {
  document.getElementById('scale').hidden = !layer;
  if (!layer) return;
  document.getElementById('scale-low').textContent = short(layer.low, layer);
  document.getElementById('scale-high').textContent = short(layer.high, layer);
  const context = document.getElementById('scale-bar').getContext('2d');
  const image = context.createImageData(256, 1);
  for (let i = 0; i < 256; ++i) image.data.set([...layer.palette.subarray(3 * i, 3 * i + 3), 255], 4 * i);
  context.putImageData(image, 0, 0);
}
