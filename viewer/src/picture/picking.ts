/** What can be told of a triangulated surface: where its features meet, and how large they are. */
import type { Vector } from "../connection/protocol";

/** Some numbers below `size` in their order; those that are equal stay as they were in `before`. */
function ordered(keys: Uint32Array, size: number, before?: Uint32Array): Uint32Array {
  const begin = new Uint32Array(size + 1);
  for (const key of keys) begin[key + 1]!++;
  for (let key = 1; key <= size; key++) begin[key]! += begin[key - 1]!;
  const result = new Uint32Array(keys.length);
  for (let i = 0; i < keys.length; i++) {
    const index = before ? before[i]! : i;
    result[begin[keys[index]!]!++] = index;
  }
  return result;
}

/**
 * The edges on which two features meet, or where the surface ends; point numbers two by two. The edges are counted into their order,
 * in which the same ones follow each other: a table of all of them took a tenth of a second and more.
 */
export function featureEdges(triangles: Uint32Array, features: Uint32Array, points: number): Uint32Array {
  const count = 3 * features.length;
  const lower = new Uint32Array(count), upper = new Uint32Array(count);
  for (let corner = 0; corner < count; corner++) {
    const a = triangles[corner]!, b = triangles[corner % 3 === 2 ? corner - 2 : corner + 1]!;
    lower[corner] = Math.min(a, b);
    upper[corner] = Math.max(a, b);
  }
  const order = ordered(lower, points, ordered(upper, points));
  const feature = (at: number): number => features[Math.floor(order[at]! / 3)]!;
  const borders: number[] = [];
  for (let at = 0, end = 0; at < count; at = end) {
    const a = lower[order[at]!]!, b = upper[order[at]!]!;
    for (end = at + 1; end < count && lower[order[end]!] === a && upper[order[end]!] === b; end++);
    if (end - at !== 2 || feature(at) !== feature(at + 1)) borders.push(a, b);
  }
  return Uint32Array.from(borders);
}

/** The box around points; all of them, or those of some triangles. Null when there are none. */
export function bounds(points: Float32Array, triangles?: Uint32Array, keep?: (triangle: number) => boolean): [Vector, Vector] | null {
  const low: Vector = [Infinity, Infinity, Infinity];
  const high: Vector = [-Infinity, -Infinity, -Infinity];
  const add = (point: number): void => {
    for (let k = 0; k < 3; k++) {
      const value = points[3 * point + k]!;
      if (value < low[k]!) low[k] = value;
      if (value > high[k]!) high[k] = value;
    }
  };
  if (triangles && keep) {
    for (let t = 0; t < triangles.length / 3; t++) {
      if (!keep(t)) continue;
      for (let k = 0; k < 3; k++) add(triangles[3 * t + k]!);
    }
  } else {
    for (let at = 0; at + 2 < points.length; at += 3) {
      const x = points[at]!, y = points[at + 1]!, z = points[at + 2]!;
      if (x < low[0]) low[0] = x;
      if (x > high[0]) high[0] = x;
      if (y < low[1]) low[1] = y;
      if (y > high[1]) high[1] = y;
      if (z < low[2]) low[2] = z;
      if (z > high[2]) high[2] = z;
    }
  }
  return low[0] <= high[0] ? [low, high] : null;
}
