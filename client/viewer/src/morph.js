// X on its way to Y: every vertex goes to its place on Y.

/** Jacobi rotations are more than enough for 4 x 4 after so many sweeps. */
const SWEEPS = 12;

/** The eigenvector of the largest eigenvalue of a symmetric 4 x 4 matrix. */
function topEigenvector(m) {
  const a = m.map((row) => [...row]);
  const v = [0, 1, 2, 3].map((i) => [0, 1, 2, 3].map((j) => Number(i === j)));
  for (let sweep = 0; sweep < SWEEPS; ++sweep) {
    for (let p = 0; p < 3; ++p) {
      for (let q = p + 1; q < 4; ++q) {
        if (a[p][q] === 0) continue;
        const angle = 0.5 * Math.atan2(2 * a[p][q], a[q][q] - a[p][p]);
        const [c, s] = [Math.cos(angle), Math.sin(angle)];
        const turn = (row) => {
          [row[p], row[q]] = [c * row[p] - s * row[q], s * row[p] + c * row[q]];
        };
        a.forEach(turn);
        for (let k = 0; k < 4; ++k) {
          [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
        }
        v.forEach(turn);
      }
    }
  }
  const top = [0, 1, 2, 3].reduce((best, i) => a[i][i] > a[best][best] ? i : best, 0);
  return v.map((row) => row[top]);
}

/** The row-major rotation by a part of a unit quaternion's angle. */
function rotationOf([w, ...axis], part) {
  const sign = w < 0 ? -1 : 1;
  const length = Math.hypot(...axis);
  const angle = 2 * Math.atan2(length, sign * w) * part;
  const [x, y, z] = axis.map((value) => length > 0 ? sign * value / length : 0);
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const d = 1 - c;
  return [c + d * x * x, d * x * y - s * z, d * x * z + s * y,
          d * x * y + s * z, c + d * y * y, d * y * z - s * x,
          d * x * z - s * y, d * y * z + s * x, c + d * z * z];
}

/** Means of the rows of both that `has`. */
function meansOf(from, to, has) {
  const means = [new Float64Array(3), new Float64Array(3)];
  let number = 0;
  has.forEach((yes, v) => {
    if (!yes) return;
    ++number;
    for (let axis = 0; axis < 3; ++axis) {
      means[0][axis] += from[3 * v + axis];
      means[1][axis] += to[3 * v + axis];
    }
  });
  return means.map((mean) => mean.map((sum) => sum / Math.max(1, number)));
}

/**
 * The rotation (a unit quaternion) that brings `from` nearest to `to` after both
 * were moved to their means (Horn: Closed-form solution of absolute orientation
 * using unit quaternions, 1987).
 */
function bestRotation(from, to, has, [a, b]) {
  const s = new Float64Array(9);
  has.forEach((yes, v) => {
    if (!yes) return;
    for (let i = 0; i < 9; ++i) {
      const [row, column] = [Math.floor(i / 3), i % 3];
      s[i] += (from[3 * v + row] - a[row]) * (to[3 * v + column] - b[column]);
    }
  });
  const [xx, xy, xz, yx, yy, yz, zx, zy, zz] = s;
  return topEigenvector([
    [xx + yy + zz, yz - zy, zx - xz, xy - yx],
    [yz - zy, xx - yy - zz, xy + yx, zx + xz],
    [zx - xz, xy + yx, yy - xx - zz, yz + zy],
    [xy - yx, zx + xz, yz + zy, zz - xx - yy],
  ]);
}

/** The corners at each vertex: those of v are corners[first[v]] to corners[first[v + 1]]. */
function cornersOf(faces, vertices) {
  const first = new Uint32Array(vertices + 1);
  for (const v of faces) ++first[v + 1];
  for (let v = 0; v < vertices; ++v) first[v + 1] += first[v];
  const corners = new Uint32Array(faces.length);
  const next = first.slice();
  faces.forEach((v, corner) => { corners[next[v]++] = corner; });
  return {first, corners};
}

/**
 * Gives each vertex that has nothing what the nearest that `has` has, by edges of
 * `faces`. Time O(vertices + faces).
 */
function spread(values, has, faces) {
  const known = Uint8Array.from(has);
  const reached = new Uint32Array(known.length);
  let count = 0;
  known.forEach((yes, v) => { if (yes) reached[count++] = v; });
  if (count === known.length) return;
  const {first, corners} = cornersOf(faces, known.length);
  for (let i = 0; i < count; ++i) {
    const from = reached[i];
    for (const corner of corners.subarray(first[from], first[from + 1])) {
      for (let side = 0; side < 3; ++side) {
        const to = faces[corner - corner % 3 + side];
        if (known[to]) continue;
        values.copyWithin(3 * to, 3 * from, 3 * from + 3);
        known[to] = 1;
        reached[count++] = to;
      }
    }
  }
}

/** `m` times the row at `i` of `values`, `m` row-major or, transposed, column-major. */
function times(m, values, i, transposed) {
  const [x, y, z] = [values[i], values[i + 1], values[i + 2]];
  return transposed ?
      [m[0] * x + m[3] * y + m[6] * z, m[1] * x + m[4] * y + m[7] * z, m[2] * x + m[5] * y + m[8] * z] :
      [m[0] * x + m[1] * y + m[2] * z, m[3] * x + m[4] * y + m[5] * z, m[6] * x + m[7] * y + m[8] * z];
}

export class Morph {
  /**
   * @param mesh X: positions and faces
   * @param goals where each vertex of X lies on Y, three numbers each
   * @param has whether a vertex has such a place, one flag each; others go along
   *     with their neighbors
   */
  constructor({positions, faces}, goals, has) {
    this.start = Float32Array.from(positions);
    const means = meansOf(positions, goals, has);
    [this.middle, this.goal] = means;
    this.quaternion = bestRotation(positions, goals, has, means);
    const rotation = rotationOf(this.quaternion, 1);
    // What is left to go beside the rotation, in X's axes, from X's middle.
    this.bends = new Float32Array(positions.length);
    const offset = new Float64Array(3);
    has.forEach((yes, v) => {
      if (!yes) return;
      for (let axis = 0; axis < 3; ++axis) offset[axis] = goals[3 * v + axis] - this.goal[axis];
      const back = times(rotation, offset, 0, true);
      for (let axis = 0; axis < 3; ++axis) {
        this.bends[3 * v + axis] = back[axis] - positions[3 * v + axis] + this.middle[axis];
      }
    });
    spread(this.bends, has, faces);
  }

  /** Writes where X is at `part`, 0 (itself) to 1 (on Y), into `positions`. */
  at(part, positions) {
    if (part === 0) { positions.set(this.start); return; }
    const m = rotationOf(this.quaternion, part);
    const {start, bends, middle, goal} = this;
    const place = [0, 1, 2].map((axis) => middle[axis] + part * (goal[axis] - middle[axis]));
    for (let i = 0; i < start.length; i += 3) {
      const x = start[i] - middle[0] + part * bends[i];
      const y = start[i + 1] - middle[1] + part * bends[i + 1];
      const z = start[i + 2] - middle[2] + part * bends[i + 2];
      positions[i] = m[0] * x + m[1] * y + m[2] * z + place[0];
      positions[i + 1] = m[3] * x + m[4] * y + m[5] * z + place[1];
      positions[i + 2] = m[6] * x + m[7] * y + m[8] * z + place[2];
    }
  }
}
