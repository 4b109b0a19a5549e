/** Which triangle lies under the pointer, and what can be told of a triangulated surface. */
import type { Vector } from "../connection/protocol";

/**
 * The first triangle that a ray meets (Möller and Trumbore, 1997); null when it meets none.
 * `points` are interleaved coordinates, `triangles` point numbers three by three.
 */
export function firstTriangle(points: Float32Array, triangles: Uint32Array, origin: Vector, direction: Vector): { triangle: number; distance: number } | null {
  const [ox, oy, oz] = origin;
  const [dx, dy, dz] = direction;
  let triangle = -1;
  let distance = Infinity;
  for (let t = 0; t + 2 < triangles.length; t += 3) {
    const a = triangles[t]! * 3, b = triangles[t + 1]! * 3, c = triangles[t + 2]! * 3;
    const ax = points[a]!, ay = points[a + 1]!, az = points[a + 2]!;
    const ex = points[b]! - ax, ey = points[b + 1]! - ay, ez = points[b + 2]! - az;
    const fx = points[c]! - ax, fy = points[c + 1]! - ay, fz = points[c + 2]! - az;
    const px = dy * fz - dz * fy, py = dz * fx - dx * fz, pz = dx * fy - dy * fx;
    const determinant = ex * px + ey * py + ez * pz;
    if (determinant === 0) continue;
    const sx = ox - ax, sy = oy - ay, sz = oz - az;
    const u = (sx * px + sy * py + sz * pz) / determinant;
    if (!(u >= 0 && u <= 1)) continue;
    const qx = sy * ez - sz * ey, qy = sz * ex - sx * ez, qz = sx * ey - sy * ex;
    const v = (dx * qx + dy * qy + dz * qz) / determinant;
    if (!(v >= 0 && u + v <= 1)) continue;
    const along = (fx * qx + fy * qy + fz * qz) / determinant;
    if (along >= 0 && along < distance) {
      distance = along;
      triangle = t / 3;
    }
  }
  return triangle < 0 ? null : { triangle, distance };
}

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
