// Two panes on one canvas, each with a camera; both move together when linked.
import {WebGLRenderer} from 'three';
import {Pane} from './pane.js';

/** What takes longer to draw is drawn coarse while it moves. */
const SLOW_MILLISECONDS = 50;
const LOOK_MILLISECONDS = 4;
/** Fewer vertices are never so slow that it matters. */
const FEW_VERTICES = 25_000;
/** After the last move, all is drawn. */
const REST_MILLISECONDS = 250;
/** A press that moves farther is no click. */
const CLICK_PIXELS = 5;

export class Stage {
  /**
   * @param canvas for the shapes
   * @param overlay drawn over them
   * @param elements {x, y}, the panes
   * @param surfaces {x, y}
   * @param on {hover, click}: called with 'x' or 'y' and a vertex, -1 for none
   */
  constructor({canvas, overlay, elements, surfaces, on}) {
    this.ratio = Math.min(2, globalThis.devicePixelRatio);
    this.renderer = new WebGLRenderer({canvas, antialias: true, alpha: true});
    this.renderer.setPixelRatio(this.ratio);
    this.renderer.autoClear = false;
    this.setUp();
    this.canvas = canvas;
    this.overlay = overlay;
    this.linked = true;
    this.edges = false;
    this.panes = ['x', 'y'].map((side) => {
      const pane = new Pane(side, elements[side], surfaces[side], {
        move: (moved) => this.moved(moved), hold: (held) => this.hold(held)});
      this.listen(pane, on);
      return pane;
    });
    new ResizeObserver(() => this.resize()).observe(canvas);
    // Phones take the drawing away from a page that was not seen for a while.
    canvas.addEventListener('webglcontextrestored', () => {
      this.setUp();
      this.draw();
    });
    this.atStart = true;
    this.resize();
  }

  /** What the renderer forgets with its drawing. */
  setUp() {
    this.renderer.setClearAlpha(0);
    this.renderer.setScissorTest(true);
  }

  /** Draws, and finds out whether this machine needs long for all of both shapes. */
  async begin() {
    this.drawNow();
    if (this.panes.reduce((sum, {surface}) => sum + surface.vertices, 0) < FEW_VERTICES) return;
    await this.drawing();  // the shapes are copied, and all is compiled
    const begin = performance.now();
    this.drawNow();
    await this.drawing();
    this.slow = performance.now() - begin > SLOW_MILLISECONDS;
  }

  /** Resolves when what was asked for is drawn. */
  drawing() {
    const gl = this.renderer.getContext();
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    return new Promise((resolve) => {
      const look = () => {
        if (gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED && !gl.isContextLost()) {
          setTimeout(look, LOOK_MILLISECONDS);
          return;
        }
        gl.deleteSync(fence);
        resolve();
      };
      setTimeout(look);
    });
  }

  /** At most one question a frame, and none while the view is dragged. */
  listen({side, element}, on) {
    let last = null;
    const vertexAt = (event) => this.pane(side).vertexAt(event);
    element.addEventListener('pointermove', (event) => {
      if (event.buttons !== 0) return;
      if (!last) requestAnimationFrame(() => { on.hover(side, vertexAt(last)); last = null; });
      last = event;
    });
    let pressed = null;
    element.addEventListener('pointerdown', (event) => {
      element.focus({preventScroll: true});
      pressed = event.button === 0 && event.isPrimary ? event : null;
    });
    element.addEventListener('pointercancel', () => { pressed = null; });
    element.addEventListener('pointerup', (event) => {
      const clicked = pressed && Math.hypot(event.clientX - pressed.clientX,
          event.clientY - pressed.clientY) < CLICK_PIXELS;
      pressed = null;
      if (!clicked) return;
      const vertex = vertexAt(event);
      if (event.pointerType === 'touch') on.hover(side, vertex);
      on.click(side, vertex);
    });
  }

  pane(side) { return this.panes.find((pane) => pane.side === side); }

  reset() {
    const distance = Math.max(...this.panes.map((pane) => pane.fittingDistance()));
    for (const pane of this.panes) pane.reset(distance);
    clearTimeout(this.timer);
    this.moving = false;
    this.atStart = true;
    this.draw();
  }

  link(linked) {
    this.linked = linked;
    if (linked) this.moved(this.panes[0]);
  }

  turnWithOneFinger(all) {
    for (const pane of this.panes) pane.turnWithOneFinger(all);
  }

  showEdges(edges) {
    this.edges = edges;
    this.draw();
  }

  moved(pane) {
    this.atStart = false;
    if (this.linked) {
      for (const other of this.panes) if (other !== pane) other.follow(pane);
    }
    this.move();
  }

  /** While it is held, what moves is drawn coarse, even if it rests. */
  hold(held) {
    this.held = held;
    this.rest();
  }

  /** Something moves: draws in the next frame, coarse where this machine is slow. */
  move() {
    this.moving = true;
    this.rest();
    this.draw();
  }

  rest() {
    clearTimeout(this.timer);
    if (this.held || !this.moving) return;
    this.timer = setTimeout(() => { this.moving = false; this.draw(); }, REST_MILLISECONDS);
  }

  resize() {
    // Nothing fits a hidden pane, and OrbitControls never recovers from infinity.
    if (this.panes.some((pane) => pane.isHidden())) return;
    const {clientWidth, clientHeight} = this.canvas;
    if (this.width === clientWidth && this.height === clientHeight) return;
    Object.assign(this, {width: clientWidth, height: clientHeight});
    this.renderer.setSize(clientWidth, clientHeight, false);
    for (const pane of this.panes) {
      pane.camera.aspect = pane.aspect();
      pane.camera.updateProjectionMatrix();
    }
    if (this.atStart) this.reset();
    // A canvas of another size is empty; at first there are no colors yet.
    if (this.hasDrawn) this.drawNow();
  }

  /** Draws in the next frame. */
  draw() {
    this.frame ??= requestAnimationFrame(() => this.drawNow());
  }

  drawNow() {
    cancelAnimationFrame(this.frame);
    this.frame = null;
    this.hasDrawn = true;
    this.isCoarse = Boolean(this.slow && this.moving);
    document.body.dataset.drawn = this.isCoarse ? 'coarse' : 'fine';
    // Fine pixels are as dear as small faces.
    const ratio = this.isCoarse ? Math.min(1, this.ratio) : this.ratio;
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
    const all = this.canvas.getBoundingClientRect();
    for (const pane of this.panes) {
      const {element, camera, surface} = pane;
      const box = element.getBoundingClientRect();
      const area = [box.left - all.left, all.bottom - box.bottom, box.width, box.height];
      surface.setCoarse(this.isCoarse);
      surface.setEdges(this.edges, pane.pixelsOfUnit());
      this.renderer.setViewport(...area);
      this.renderer.setScissor(...area);
      this.renderer.clear();
      this.renderer.render(surface.scene, camera);
    }
    this.drawMarks();
  }

  /** Draws the marks again, over the shapes as they are. */
  drawMarks() {
    this.overlay.draw(this.panes, this.ratio, !this.isCoarse);
  }
}
