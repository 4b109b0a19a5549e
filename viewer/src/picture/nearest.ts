/** The triangle that is nearest to a point, and the point of it that is. */
import type { Vector } from "../connection/protocol";

type Corners = readonly [Vector, Vector, Vector];

/** The point of a triangle that is nearest to another point: it lies inside, on a side or at a corner (Ericson, Real-Time Collision Detection, 2005). */
export function nearestPoint(point: Vector, [a, b, c]: Corners): Vector {
  const minus = (p: Vector, q: Vector): Vector => [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
  const dot = (p: Vector, q: Vector): number => p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
  const along = (p: Vector, v: number, e: Vector, w: number, f: Vector): Vector => [0, 1, 2].map((k) => p[k]! + v * e[k]! + w * f[k]!) as Vector;
  const [e, f] = [minus(b, a), minus(c, a)];
  const [pa, pb, pc] = [minus(point, a), minus(point, b), minus(point, c)];
  const [ea, fa, eb, fb, ec, fc] = [dot(e, pa), dot(f, pa), dot(e, pb), dot(f, pb), dot(e, pc), dot(f, pc)];
  if (ea <= 0 && fa <= 0) return a;
  if (eb >= 0 && fb <= eb) return b;
  if (fc >= 0 && ec <= fc) return c;
  const ab = ea * fb - eb * fa;
  if (ab <= 0 && ea >= 0 && eb <= 0) return along(a, ea / (ea - eb), e, 0, f);
  const ac = ec * fa - ea * fc;
  if (ac <= 0 && fa >= 0 && fc <= 0) return along(a, 0, e, fa / (fa - fc), f);
  const bc = eb * fc - ec * fb;
  if (bc <= 0 && fb - eb >= 0 && ec - fc >= 0) return along(b, (fb - eb) / (fb - eb + ec - fc), minus(c, b), 0, f);
  return along(a, ac / (ab + ac + bc), e, ab / (ab + ac + bc), f);
}

/** The nearest of triangles, which are indices of points three by three; -1 where there is none. */
export function nearestTriangle(point: Vector, triangles: Uint32Array, points: Float32Array): { triangle: number; distance: number } {
  const nearest = { triangle: -1, distance: Infinity };
  const corner = (at: number): Vector => [points[3 * triangles[at]!]!, points[3 * triangles[at]! + 1]!, points[3 * triangles[at]! + 2]!];
  for (let at = 0; at + 2 < triangles.length; at += 3) {
    // Most lie farther away along an axis alone.
    let isFar = false;
    for (let k = 0; k < 3 && !isFar; k++) {
      const [p, q, r] = [points[3 * triangles[at]! + k]!, points[3 * triangles[at + 1]! + k]!, points[3 * triangles[at + 2]! + k]!];
      isFar = !(Math.max(Math.min(p, q, r) - point[k]!, point[k]! - Math.max(p, q, r)) < nearest.distance);
    }
    if (isFar) continue;
    const found = nearestPoint(point, [corner(at), corner(at + 1), corner(at + 2)]);
    const distance = Math.hypot(found[0] - point[0], found[1] - point[1], found[2] - point[2]);
    if (distance < nearest.distance) Object.assign(nearest, { triangle: at / 3, distance });
  }
  return nearest;
}
