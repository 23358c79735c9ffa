// Where stripes and checks put the vertices of both shapes.

/** Stripes along the longest side of Y's box. */
const STRIPES = 10;

/** Y's own positions in stripes, the longest side of its box being x. */
export function placesOfY({positions}) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  positions.forEach((value, i) => {
    low[i % 3] = Math.min(low[i % 3], value);
    high[i % 3] = Math.max(high[i % 3], value);
  });
  const extents = low.map((value, axis) => high[axis] - value);
  const longest = extents.indexOf(Math.max(...extents));
  const places = new Float32Array(positions.length);
  for (let i = 0; i < places.length; i += 3) {
    for (let axis = 0; axis < 3; ++axis) {
      const from = (longest + axis) % 3;
      places[i + axis] = STRIPES * (positions[i + from] - low[from]) / extents[longest];
    }
  }
  return places;
}

/** The same places, 0 without a counterpart, where both shapes are plain. */
export function plainWithoutCounterpart(places, {hasCounterpart}) {
  return places.map((value, i) => hasCounterpart('y', Math.floor(i / 3)) ? value : 0);
}

/** What each vertex of X has where it lies on Y, of `valuesY`; 0 without a place. */
export function carriedToX({yFromX, places: onY}, valuesY) {
  const values = new Float32Array(3 * yFromX.length);
  yFromX.forEach((y, x) => {
    if (y >= 0) values.set(onY.of(valuesY, x), 3 * x);
  });
  return values;
}
