// A coarser mesh on some of the vertices of a fine one, to be drawn while it moves.

/** Cells of the grid along the longest side of the box that are tried first. */
const FIRST_CELLS = 96;
const TRIES = 5;

function boxOf(positions) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < positions.length; i += 3) {
    for (let axis = 0; axis < 3; ++axis) {
      const value = positions[i + axis];
      if (value < low[axis]) low[axis] = value;
      if (value > high[axis]) high[axis] = value;
    }
  }
  return {low, side: Math.max(...low.map((value, axis) => high[axis] - value))};
}

/** The number of the grid's cell that each vertex lies in, and how many there are. */
function cellsOf(positions, {low, side}, along) {
  const numbers = new Map();
  const cells = new Uint32Array(positions.length / 3);
  const scale = along / side;
  for (let v = 0; v < cells.length; ++v) {
    const at = (axis) => Math.min(along - 1, Math.floor(scale * (positions[3 * v + axis] - low[axis])));
    const key = (at(0) * along + at(1)) * along + at(2);
    let cell = numbers.get(key);
    if (cell === undefined) numbers.set(key, cell = numbers.size);
    cells[v] = cell;
  }
  return {cells, count: numbers.size};
}

/** Of each cell the vertex nearest to the mean of its vertices. */
function middlesOf(positions, {cells, count}) {
  const sums = new Float64Array(4 * count);
  cells.forEach((cell, v) => {
    for (let axis = 0; axis < 3; ++axis) sums[4 * cell + axis] += positions[3 * v + axis];
    ++sums[4 * cell + 3];
  });
  const middles = new Uint32Array(count);
  const least = new Float64Array(count).fill(Infinity);
  cells.forEach((cell, v) => {
    let distance = 0;
    for (let axis = 0; axis < 3; ++axis) {
      distance += (positions[3 * v + axis] - sums[4 * cell + axis] / sums[4 * cell + 3]) ** 2;
    }
    if (distance < least[cell]) [least[cell], middles[cell]] = [distance, v];
  });
  return middles;
}

/**
 * The faces that are left when all vertices of a cell of a grid become one of them:
 * vertex numbers of the fine mesh, three a face. The grid has about `target` cells
 * with vertices, so many vertices are left. Time O(vertices + faces).
 */
export function coarseFaces({positions, faces}, target) {
  const box = boxOf(positions);
  let along = FIRST_CELLS;
  let grid = cellsOf(positions, box, along);
  // Cells on a surface grow with the square of those along a side.
  for (let i = 0; i < TRIES && Math.abs(grid.count / target - 1) > 0.1; ++i) {
    along = Math.max(4, Math.min(1000, Math.round(along * Math.sqrt(target / grid.count))));
    grid = cellsOf(positions, box, along);
  }
  const middles = middlesOf(positions, grid);
  const kept = new Uint32Array(faces.length);
  let length = 0;
  for (let i = 0; i < faces.length; i += 3) {
    const [a, b, c] = [grid.cells[faces[i]], grid.cells[faces[i + 1]], grid.cells[faces[i + 2]]];
    if (a === b || b === c || c === a) continue;
    kept[length++] = middles[a];
    kept[length++] = middles[b];
    kept[length++] = middles[c];
  }
  return kept.slice(0, length);
}
