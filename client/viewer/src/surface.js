// One shape: its geometry, colors and the marks on it.
import {
  BufferAttribute, BufferGeometry, DoubleSide, DynamicDrawUsage, Matrix4, Mesh,
  Points, Scene, ShaderMaterial, Vector3,
} from 'three';
import {MeshBVH} from 'three-mesh-bvh';

/** Of a vertex without an image or a value. */
const GRAY = [158, 158, 158];
const MARK_PIXELS = 15;
/** Their numbers are the shader's. */
const PATTERNS = ['plain', 'stripes', 'checker'];

const vertexShader = `
  attribute vec3 tint;
  attribute vec3 place;
  varying vec3 vTint;
  varying vec3 vPlace;
  varying vec3 vNormal;
  void main() {
    vTint = tint;
    vPlace = place;
    vNormal = normalMatrix * normal;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }`;

// Light from above the viewer's left shoulder. client/viewer/picture.cc lights and
// patterns the same way.
const fragmentShader = `
  uniform int pattern;
  varying vec3 vTint;
  varying vec3 vPlace;
  varying vec3 vNormal;
  float band(float t) {
    float wave = abs(fract(t) - 0.5) - 0.25;
    return smoothstep(-1.0, 1.0, wave / max(fwidth(t), 1e-4));
  }
  void main() {
    vec3 n = normalize(vNormal);
    if (!gl_FrontFacing) n = -n;
    float diffuse = max(dot(n, normalize(vec3(-0.35, 0.5, 1.0))), 0.0);
    float gloss = pow(max(dot(n, normalize(vec3(-0.18, 0.26, 1.0))), 0.0), 40.0);
    vec3 tint = vTint;
    if (pattern == 1) tint *= mix(0.55, 1.0, band(vPlace.x));
    if (pattern == 2) {
      vec3 b = vec3(band(vPlace.x), band(vPlace.y), band(vPlace.z)) * 2.0 - 1.0;
      tint *= mix(0.55, 1.0, 0.5 + 0.5 * b.x * b.y * b.z);
    }
    gl_FragColor = vec4(tint * (0.45 + 0.55 * diffuse) + 0.08 * gloss, 1.0);
  }`;

const markVertexShader = `
  uniform float size;
  void main() {
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
    gl_PointSize = size;
  }`;

const markFragmentShader = `
  uniform float opacity;
  void main() {
    float r = 2.0 * length(gl_PointCoord - 0.5);
    if (r > 1.0) discard;
    gl_FragColor = vec4(vec3(r > 0.72 || r < 0.3 ? 0.0 : 1.0), opacity);
  }`;

function surfaceMaterial() {
  return new ShaderMaterial({
    vertexShader, fragmentShader, side: DoubleSide,
    uniforms: {pattern: {value: 0}},
    // Marks lie on the surface and must win.
    polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2,
  });
}

/** Marks behind the surface shine through it faintly. */
function marksOf(geometry, opacity, depthTest, pixelRatio) {
  const marks = new Points(geometry, new ShaderMaterial({
    vertexShader: markVertexShader, fragmentShader: markFragmentShader,
    uniforms: {opacity: {value: opacity}, size: {value: MARK_PIXELS * pixelRatio}},
    transparent: true, depthTest, depthWrite: false,
  }));
  marks.frustumCulled = false;
  return marks;
}

export class Surface {
  /**
   * @param mesh positions and faces in the file's order
   * @param rotation row-major 3 x 3, from the file's axes to right, up, viewer
   * @param places where the pattern puts each vertex, 3 numbers each
   */
  constructor(mesh, rotation, places, pixelRatio) {
    this.positions = mesh.positions;
    this.geometry = new BufferGeometry();
    this.geometry.setAttribute('position', new BufferAttribute(mesh.positions, 3));
    this.geometry.setAttribute('place', new BufferAttribute(places, 3));
    this.tint = new BufferAttribute(new Uint8Array(mesh.positions.length), 3, true);
    this.tint.setUsage(DynamicDrawUsage);
    this.geometry.setAttribute('tint', this.tint);
    this.geometry.setIndex(new BufferAttribute(mesh.faces, 1));
    this.geometry.computeVertexNormals();
    this.geometry.computeBoundingSphere();
    this.material = surfaceMaterial();
    this.mesh = new Mesh(this.geometry, this.material);
    this.scene = new Scene();
    this.scene.add(this.mesh);
    this.markGeometry = new BufferGeometry();
    this.markPoints(new Uint32Array());
    this.scene.add(marksOf(this.markGeometry, 0.35, false, pixelRatio));
    this.scene.add(marksOf(this.markGeometry, 1, true, pixelRatio));
    this.turn(rotation);
  }

  turn(r) {
    const matrix = new Matrix4().set(
        r[0], r[1], r[2], 0, r[3], r[4], r[5], 0, r[6], r[7], r[8], 0, 0, 0, 0, 1);
    this.scene.matrixAutoUpdate = false;
    this.scene.matrix.copy(matrix);
    this.scene.updateMatrixWorld(true);
  }

  /** @param pattern one of PATTERNS */
  setPattern(pattern) {
    this.material.uniforms.pattern.value = PATTERNS.indexOf(pattern);
  }

  /** `colorOf(v)` returns three numbers to 255, or null for none. */
  paint(colorOf) {
    const array = this.tint.array;
    for (let v = 0; 3 * v < array.length; ++v) array.set(colorOf(v) ?? GRAY, 3 * v);
    this.tint.needsUpdate = true;
  }

  /** Marks these vertices and no others. */
  markPoints(vertices) {
    const places = new Float32Array(3 * vertices.length);
    vertices.forEach((v, i) =>
        places.set(this.positions.subarray(3 * v, 3 * v + 3), 3 * i));
    this.markPlaces(places);
  }

  /** Marks these places, three numbers each, and no others. */
  markPlaces(places) {
    this.markGeometry.setAttribute('position',
        new BufferAttribute(Float32Array.from(places), 3));
    this.markGeometry.setDrawRange(0, places.length / 3);
  }

  /** The vertex next to where the ray meets the surface; -1 for none. */
  vertexAt(raycaster) {
    // `indirect` leaves the geometry's index as it is.
    this.tree ??= new MeshBVH(this.geometry, {indirect: true});
    const ray = raycaster.ray.clone().applyMatrix4(
        this.mesh.matrixWorld.clone().invert());
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
}
