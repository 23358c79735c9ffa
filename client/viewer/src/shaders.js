// How surfaces are lit and patterned, and the lines of their edges.
import {Color, DoubleSide, ShaderMaterial} from 'three';

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

/** A surface with `tint` and `place` at its vertices. */
export function surfaceMaterial() {
  return new ShaderMaterial({
    vertexShader, fragmentShader, side: DoubleSide,
    uniforms: {pattern: {value: 0}},
    // Edges lie on the surface and must win.
    polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
  });
}

/** @param pattern one of PATTERNS */
export function setPattern(material, pattern) {
  material.uniforms.pattern.value = PATTERNS.indexOf(pattern);
}

/** Lines that darken what they lie on. */
export function edgeMaterial() {
  return new ShaderMaterial({
    wireframe: true, transparent: true, depthWrite: false,
    uniforms: {color: {value: new Color(0x0b1526)}, opacity: {value: 0.5}},
    vertexShader: `
      void main() { gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`,
    fragmentShader: `
      uniform vec3 color;
      uniform float opacity;
      void main() { gl_FragColor = vec4(color, opacity); }`,
  });
}
