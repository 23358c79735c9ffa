// Marks over the shapes: what the pointer found, and numbered pins. A canvas of its
// own, so that a mark costs no drawing of the shapes.
import {Vector3} from 'three';

const FOUND_RADIUS = 7;
const PIN_RADIUS = 10;
/** Of a mark behind the surface. */
const FAINT = 0.35;
/** More marks than these are not looked for behind the surface. */
const LOOKED_FOR = 100;

/** Colors of pins, in turn: dark enough for white numbers. */
const PIN_COLORS = ['#c2255c', '#1864ab', '#2b8a3e', '#b35c00', '#6741d9', '#0b7285', '#5f3dc4',
  '#a61e4d'];

export const pinColor = (index) => PIN_COLORS[index % PIN_COLORS.length];

export class Overlay {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext('2d');
    this.found = {x: [], y: []};
    this.pins = {x: [], y: []};
  }

  /** Rings at these places, three numbers each, in the shape's axes. */
  setFound(found) { this.found = found; }

  /** @param pins by side: {place: () => three numbers, number, color, chosen} */
  setPins(pins) { this.pins = pins; }

  /** @param panes {side, element, camera, surface}; `ratio` pixels of the screen each */
  draw(panes, ratio, looks) {
    const all = this.canvas.getBoundingClientRect();
    const [width, height] = [Math.round(ratio * all.width), Math.round(ratio * all.height)];
    if (this.canvas.width !== width || this.canvas.height !== height) {
      Object.assign(this.canvas, {width, height});
    }
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.context.clearRect(0, 0, all.width, all.height);
    for (const pane of panes) {
      const box = pane.element.getBoundingClientRect();
      this.context.save();
      this.context.translate(box.left - all.left, box.top - all.top);
      this.context.beginPath();
      this.context.rect(0, 0, box.width, box.height);
      this.context.clip();
      this.drawPane(pane, box, looks);
      this.context.restore();
    }
  }

  drawPane(pane, box, looks) {
    const marks = [
      ...this.pins[pane.side].map((pin) => ({pin, place: new Vector3(...pin.place())})),
      ...this.found[pane.side].map((place) => ({place: new Vector3(...place)})),
    ];
    const asks = looks && marks.length <= LOOKED_FOR;
    for (const mark of marks) {
      mark.hidden = asks && pane.surface.hides(mark.place, pane.camera.position);
    }
    // Those that are seen last, over the others.
    marks.sort((a, b) => b.hidden - a.hidden);
    for (const {place, pin, hidden} of marks) {
      const at = place.applyMatrix4(pane.surface.mesh.matrixWorld).project(pane.camera);
      if (at.z > 1) continue;
      const [x, y] = [(at.x + 1) * box.width / 2, (1 - at.y) * box.height / 2];
      this.context.globalAlpha = hidden ? FAINT : 1;
      if (pin) this.drawPin(x, y, pin); else this.drawFound(x, y);
    }
  }

  disc(x, y, radius, color) {
    this.context.beginPath();
    this.context.arc(x, y, radius, 0, 2 * Math.PI);
    this.context.fillStyle = color;
    this.context.fill();
  }

  drawFound(x, y) {
    this.disc(x, y, FOUND_RADIUS, '#000');
    this.disc(x, y, 0.72 * FOUND_RADIUS, '#fff');
    this.disc(x, y, 0.3 * FOUND_RADIUS, '#000');
  }

  drawPin(x, y, {number, color, chosen}) {
    if (chosen) this.disc(x, y, PIN_RADIUS + 5, '#ffd43b');
    this.disc(x, y, PIN_RADIUS + 2, '#fff');
    this.disc(x, y, PIN_RADIUS, color);
    this.context.fillStyle = '#fff';
    this.context.font = `600 ${number > 99 ? 9 : 11}px system-ui, sans-serif`;
    this.context.textAlign = 'center';
    this.context.textBaseline = 'middle';
    this.context.fillText(number, x, y + 0.5);
  }
}
