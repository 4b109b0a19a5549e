/** What can be told of a triangulated surface: where its features meet, and how large they are. */
import type { Vector } from "../connection/protocol";

/** The edges on which two features meet, or where the surface ends; point numbers two by two. */
export function featureEdges(triangles: Uint32Array, features: Uint32Array, points: number): Uint32Array {
  const seen = new Map<number, number>();
  const borders = new Set<number>();
  for (let t = 0; t < features.length; t++) {
    const feature = features[t]!;
    for (let k = 0; k < 3; k++) {
      const a = triangles[3 * t + k]!;
      const b = triangles[3 * t + ((k + 1) % 3)]!;
      const key = Math.min(a, b) * points + Math.max(a, b);
      const other = seen.get(key);
      if (other === undefined) seen.set(key, feature);
      else {
        if (other !== feature) borders.add(key);
        seen.set(key, -1);
      }
    }
  }
  for (const [key, feature] of seen) if (feature >= 0) borders.add(key);
  const result = new Uint32Array(borders.size * 2);
  let at = 0;
  for (const key of borders) {
    result[at++] = Math.floor(key / points);
    result[at++] = key % points;
  }
  return result;
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
    for (let i = 0; i < points.length / 3; i++) add(i);
  }
  return low[0] <= high[0] ? [low, high] : null;
}
