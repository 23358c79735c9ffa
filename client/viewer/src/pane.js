// One shape in its half of the stage: its camera and what moves it.
import {
  Matrix4, PerspectiveCamera, Raycaster, Spherical, TOUCH, Vector2, Vector3,
} from 'three';
import {OrbitControls} from 'three/examples/jsm/controls/OrbitControls.js';

const FIELD_OF_VIEW = 28;
/** Where the viewer stands at first: a little to the side and above. */
const TURN = 25 * Math.PI / 180;
const RAISE = 10 * Math.PI / 180;
/** How far one sees: what is long, or in parts far apart, is looked at from far away. */
const FAR = 100;
const FAR_DISTANCES = 20;
/** The nearest that one sees is this part of the farthest. */
const DEPTHS = 10_000;
const KEY_TURN = 5 * Math.PI / 180;
const KEY_ZOOM = 1.1;
const ROOM = 1.12;

/**
 * What must scroll the page does not reach the camera's controls: in a page within
 * a page, the wheel, unless the shape was clicked before or Ctrl is held.
 */
function leaveScrolling(element) {
  if (globalThis.parent !== globalThis) {
    element.addEventListener('wheel', (event) => {
      if (document.activeElement !== element && !event.ctrlKey) event.stopImmediatePropagation();
    }, {capture: true});
  }
  // Two fingers are the shape's, whatever one may do.
  for (const name of ['touchstart', 'touchmove']) {
    element.addEventListener(name, (event) => {
      if (event.touches.length > 1) event.preventDefault();
    }, {passive: false});
  }
}

export class Pane {
  /** @param on {move, hold}: the camera has moved; a person holds it, or lets it go */
  constructor(side, element, surface, on) {
    this.side = side;
    this.element = element;
    this.surface = surface;
    this.camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, FAR / DEPTHS, FAR);
    leaveScrolling(element);
    this.controls = new OrbitControls(this.camera, element);
    this.controls.addEventListener('change', () => on.move(this));
    this.controls.addEventListener('start', () => on.hold(true));
    this.controls.addEventListener('end', () => on.hold(false));
    this.turnWithOneFinger(false);
    element.addEventListener('keydown', (event) => this.pressed(event));
    this.undoWhatScrolls();
  }

  /** A finger that turns out to scroll the page has turned nothing. */
  undoWhatScrolls() {
    let before = null;
    this.element.addEventListener('pointerdown', ({isPrimary}) => {
      if (isPrimary) before = [this.camera.position.clone(), this.controls.target.clone()];
    });
    this.element.addEventListener('pointercancel', () => {
      if (!before) return;
      this.camera.position.copy(before[0]);
      this.controls.target.copy(before[1]);
      this.controls.update();
      before = null;
    });
  }

  /**
   * One finger turns the shape, or scrolls the page up and down and turns only
   * sideways, while two fingers turn and zoom.
   */
  turnWithOneFinger(all) {
    this.controls.touches.TWO = all ? TOUCH.DOLLY_PAN : TOUCH.DOLLY_ROTATE;
    this.element.style.touchAction = all ? 'none' : 'pan-y';
  }

  /** Puts the camera where it stands at first, so far away. */
  reset(distance) {
    this.controls.target.set(0, 0, 0);
    this.camera.position.setFromSpherical(
        new Spherical(distance, Math.PI / 2 - RAISE, TURN));
    this.camera.far = Math.max(FAR, FAR_DISTANCES * distance);
    this.camera.near = this.camera.far / DEPTHS;
    this.camera.updateProjectionMatrix();
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

  /** Pixels of the screen that a unit of length has, where the camera looks. */
  pixelsOfUnit() {
    const distance = this.camera.position.distanceTo(this.controls.target);
    return this.element.clientHeight / (2 * distance * Math.tan(FIELD_OF_VIEW * Math.PI / 360));
  }

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
