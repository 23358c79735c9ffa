// Two panes on one canvas, each with a camera; both move together when linked.
import {Matrix4, PerspectiveCamera, Raycaster, Spherical, Vector2, Vector3, WebGLRenderer} from 'three';
import {OrbitControls} from 'three/examples/jsm/controls/OrbitControls.js';

const FIELD_OF_VIEW = 28;
/** Where the viewer stands at first: a little to the side and above. */
const TURN = 25 * Math.PI / 180;
const RAISE = 10 * Math.PI / 180;
const KEY_TURN = 5 * Math.PI / 180;
const KEY_ZOOM = 1.1;
const ROOM = 1.12;

class Pane {
  constructor(element, surface, onMove) {
    this.element = element;
    this.surface = surface;
    this.camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 100);
    this.controls = new OrbitControls(this.camera, element);
    this.controls.addEventListener('change', () => onMove(this));
    element.addEventListener('keydown', (event) => this.pressed(event));
  }

  /** Puts the camera where it stands at first, so far away. */
  reset(distance) {
    this.controls.target.set(0, 0, 0);
    this.camera.position.setFromSpherical(
        new Spherical(distance, Math.PI / 2 - RAISE, TURN));
    this.controls.update();
  }

  /** From how far all of the surface is seen at first. */
  fittingDistance() {
    const high = Math.tan(FIELD_OF_VIEW * Math.PI / 360) / ROOM;
    const wide = high * this.aspect();
    const toCamera = new Matrix4().makeRotationX(RAISE)
        .multiply(new Matrix4().makeRotationY(-TURN))
        .multiply(this.surface.mesh.matrixWorld);
    const place = new Vector3();
    let distance = 0;
    for (let i = 0; i < this.surface.positions.length; i += 3) {
      place.fromArray(this.surface.positions, i).applyMatrix4(toCamera);
      distance = Math.max(distance, place.z + Math.abs(place.x) / wide,
                          place.z + Math.abs(place.y) / high);
    }
    return distance;
  }

  isHidden() { return this.element.clientWidth === 0 || this.element.clientHeight === 0; }

  aspect() { return this.element.clientWidth / this.element.clientHeight; }

  follow(other) {
    this.camera.position.copy(other.camera.position);
    this.camera.quaternion.copy(other.camera.quaternion);
    this.controls.target.copy(other.controls.target);
  }

  pressed(event) {
    const turns = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};
    const zoom = {'+': 1 / KEY_ZOOM, '=': 1 / KEY_ZOOM, '-': KEY_ZOOM}[event.key] ?? 1;
    const [sideways, down] = turns[event.key] ?? [0, 0];
    if (zoom === 1 && sideways === 0 && down === 0) return;
    event.preventDefault();
    const offset = this.camera.position.clone().sub(this.controls.target);
    const place = new Spherical().setFromVector3(offset);
    place.theta += KEY_TURN * sideways;
    place.phi += KEY_TURN * down;
    place.radius *= zoom;
    offset.setFromSpherical(place.makeSafe());
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
  }

  /** The surface's vertex under a pointer event; -1 for none. */
  vertexAt(event) {
    const box = this.element.getBoundingClientRect();
    const pointer = new Vector2(2 * (event.clientX - box.left) / box.width - 1,
                                1 - 2 * (event.clientY - box.top) / box.height);
    const raycaster = new Raycaster();
    raycaster.setFromCamera(pointer, this.camera);
    return this.surface.vertexAt(raycaster);
  }
}

export class Stage {
  /**
   * @param surfaces {x, y}
   * @param onHover called with 'x' or 'y' and a vertex, -1 for none
   */
  constructor(canvas, elements, surfaces, onHover) {
    this.renderer = new WebGLRenderer({canvas, antialias: true, alpha: true});
    this.renderer.setPixelRatio(Math.min(2, globalThis.devicePixelRatio));
    this.renderer.setScissorTest(true);
    this.renderer.autoClear = false;
    this.canvas = canvas;
    this.linked = true;
    this.panes = ['x', 'y'].map((side) => {
      const pane = new Pane(elements[side], surfaces[side], (moved) => this.moved(moved));
      this.listen(pane, side, onHover);
      return pane;
    });
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.atStart = true;
    this.resize();
  }

  /** At most one question a frame, and none while the view is dragged. */
  listen(pane, side, onHover) {
    let last = null;
    pane.element.addEventListener('pointermove', (event) => {
      if (event.buttons !== 0) return;
      if (!last) requestAnimationFrame(() => { onHover(side, pane.vertexAt(last)); last = null; });
      last = event;
    });
    pane.element.addEventListener('pointerdown', (event) => {
      pane.element.focus({preventScroll: true});
      if (event.pointerType === 'touch') onHover(side, pane.vertexAt(event));
    });
  }

  reset() {
    const distance = Math.max(...this.panes.map((pane) => pane.fittingDistance()));
    for (const pane of this.panes) pane.reset(distance);
    this.atStart = true;
    this.draw();
  }

  link(linked) {
    this.linked = linked;
    if (linked) this.moved(this.panes[0]);
  }

  moved(pane) {
    this.atStart = false;
    if (this.linked) {
      for (const other of this.panes) if (other !== pane) other.follow(pane);
    }
    this.draw();
  }

  resize() {
    // Nothing fits a hidden pane, and OrbitControls never recovers from infinity.
    if (this.panes.some((pane) => pane.isHidden())) return;
    this.renderer.setSize(this.canvas.clientWidth, this.canvas.clientHeight, false);
    for (const pane of this.panes) {
      pane.camera.aspect = pane.aspect();
      pane.camera.updateProjectionMatrix();
    }
    if (this.atStart) this.reset();
    this.drawNow();
  }

  /** Draws in the next frame. */
  draw() {
    this.frame ??= requestAnimationFrame(() => this.drawNow());
  }

  drawNow() {
    this.frame = null;
    const all = this.canvas.getBoundingClientRect();
    for (const {element, camera, surface} of this.panes) {
      const box = element.getBoundingClientRect();
      const area = [box.left - all.left, all.bottom - box.bottom, box.width, box.height];
      this.renderer.setViewport(...area);
      this.renderer.setScissor(...area);
      this.renderer.clear();
      this.renderer.render(surface.scene, camera);
    }
  }
}
