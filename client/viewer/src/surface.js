// One shape: its geometry, also coarse for while it moves, its colors and edges.
import {
  BufferAttribute, BufferGeometry, DoubleSide, DynamicDrawUsage, Matrix4, Mesh,
  Ray, Scene, Vector3,
} from 'three';
import {MeshBVH} from 'three-mesh-bvh';
import {coarseFaces} from './coarse.js';
import {edgeMaterial, setPattern, surfaceMaterial} from './shaders.js';

/** Of a vertex without an image or a value. */
const GRAY = [158, 158, 158];
/** Vertices that are drawn while the shape moves, where all take too long. */
const COARSE_VERTICES = 8_000;
/** A ray that ends at a place on the surface may stop so far before it. */
const NEAR = 0.004;

/** Writes unit normals of vertices: means over faces, weighted by area. */
function computeNormals(positions, faces, normals) {
  normals.fill(0);
  for (let i = 0; i < faces.length; i += 3) {
    const [a, b, c] = [3 * faces[i], 3 * faces[i + 1], 3 * faces[i + 2]];
    const ux = positions[b] - positions[a], vx = positions[c] - positions[a];
    const uy = positions[b + 1] - positions[a + 1], vy = positions[c + 1] - positions[a + 1];
    const uz = positions[b + 2] - positions[a + 2], vz = positions[c + 2] - positions[a + 2];
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    for (const v of [a, b, c]) {
      normals[v] += nx;
      normals[v + 1] += ny;
      normals[v + 2] += nz;
    }
  }
  for (let v = 0; v < normals.length; v += 3) {
    const length = Math.hypot(normals[v], normals[v + 1], normals[v + 2]) || 1;
    normals[v] /= length;
    normals[v + 1] /= length;
    normals[v + 2] /= length;
  }
}

export class Surface {
  /**
   * @param mesh positions and faces in the file's order
   * @param rotation row-major 3 x 3, from the file's axes to right, up, viewer
   * @param places where the pattern puts each vertex, 3 numbers each
   */
  constructor(mesh, rotation, places) {
    this.positions = mesh.positions;
    this.faces = mesh.faces;
    const normals = new Float32Array(mesh.positions.length);
    computeNormals(this.positions, this.faces, normals);
    this.attributes = {
      position: new BufferAttribute(mesh.positions, 3),
      normal: new BufferAttribute(normals, 3),
      place: new BufferAttribute(places, 3),
      tint: new BufferAttribute(new Uint8Array(mesh.positions.length), 3, true),
    };
    for (const name of ['position', 'normal', 'tint']) {
      this.attributes[name].setUsage(DynamicDrawUsage);
    }
    this.fine = this.geometryOf(mesh.faces);
    this.material = surfaceMaterial();
    this.mesh = new Mesh(this.fine, this.material);
    this.edges = new Mesh(this.fine, edgeMaterial());
    this.edges.visible = false;
    this.edges.renderOrder = 1;
    this.scene = new Scene();
    for (const drawn of [this.mesh, this.edges]) {
      drawn.frustumCulled = false;  // a morph leaves the box it began in
      this.scene.add(drawn);
    }
    this.turn(rotation);
  }

  /** All that is drawn has the same vertices. */
  geometryOf(faces) {
    const geometry = new BufferGeometry();
    for (const [name, attribute] of Object.entries(this.attributes)) {
      geometry.setAttribute(name, attribute);
    }
    geometry.setIndex(new BufferAttribute(faces, 1));
    return geometry;
  }

  turn(r) {
    const matrix = new Matrix4().set(
        r[0], r[1], r[2], 0, r[3], r[4], r[5], 0, r[6], r[7], r[8], 0, 0, 0, 0, 1);
    this.scene.matrixAutoUpdate = false;
    this.scene.matrix.copy(matrix);
    this.scene.updateMatrixWorld(true);
  }

  get vertices() { return this.positions.length / 3; }

  /** Draws few of the faces, or all. */
  setCoarse(coarse) {
    if (coarse && this.vertices > 2 * COARSE_VERTICES) {
      this.coarse ??= this.geometryOf(coarseFaces(this, COARSE_VERTICES));
    }
    const geometry = coarse && this.coarse ? this.coarse : this.fine;
    this.mesh.geometry = geometry;
    this.edges.geometry = geometry;
  }

  /** @param pixels of a unit of length on the screen: dense edges are fainter */
  setEdges(visible, pixels) {
    this.edges.visible = visible;
    // The area is 1, so an edge has about this length.
    const length = pixels * Math.sqrt(2.3 / (this.edges.geometry.index.count / 3));
    this.edges.material.uniforms.opacity.value = Math.min(0.65, 0.12 + 0.07 * length);
  }

  setPattern(pattern) { setPattern(this.material, pattern); }

  /** `colorOf(v)` returns three numbers to 255, or null for none. */
  paint(colorOf) {
    const {tint} = this.attributes;
    for (let v = 0; 3 * v < tint.array.length; ++v) tint.array.set(colorOf(v) ?? GRAY, 3 * v);
    tint.needsUpdate = true;
  }

  /** `write(positions)` puts the vertices elsewhere. */
  move(write) {
    write(this.positions);
    computeNormals(this.positions, this.faces, this.attributes.normal.array);
    this.attributes.position.needsUpdate = true;
    this.attributes.normal.needsUpdate = true;
    this.hasMoved = true;
  }

  placeOf(vertex) { return this.positions.subarray(3 * vertex, 3 * vertex + 3); }

  /** For rays; made when it is first asked for. */
  get tree() {
    // `indirect` leaves the geometry's index as it is.
    this.madeTree ??= new MeshBVH(this.fine, {indirect: true});
    if (this.hasMoved) this.madeTree.refit();
    this.hasMoved = false;
    return this.madeTree;
  }

  inOwnAxes(point) {
    return point.clone().applyMatrix4(this.mesh.matrixWorld.clone().invert());
  }

  /** The vertex next to where the ray meets the surface; -1 for none. */
  vertexAt(raycaster) {
    const ray = raycaster.ray.clone().applyMatrix4(this.mesh.matrixWorld.clone().invert());
    const hit = this.tree.raycastFirst(ray, DoubleSide);
    if (!hit) return -1;
    const corner = new Vector3();
    let nearest = -1;
    let least = Infinity;
    for (const v of [hit.face.a, hit.face.b, hit.face.c]) {
      const distance = corner.fromArray(this.positions, 3 * v).distanceTo(hit.point);
      if (distance < least) [nearest, least] = [v, distance];
    }
    return nearest;
  }

  /** Whether the surface hides a place on it, in its own axes, from the eye. */
  hides(place, eye) {
    const from = this.inOwnAxes(eye);
    const direction = place.clone().sub(from);
    const distance = direction.length();
    const hit = this.tree.raycastFirst(new Ray(from, direction.normalize()), DoubleSide);
    return hit !== null && hit.distance < distance - NEAR;
  }
}
