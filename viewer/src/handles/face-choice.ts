/** Choosing faces of the surface for a handle: what a stroke adds or takes away, and what the choice is as a region of an edit. */
import type { Json, Vector } from "../connection/protocol";
import type { Values } from "../form/schema";
import { isObject } from "../store/draft";
import { boxOf } from "./handle-box";
import { vectorOf } from "./shape-composer";
import { cross, dot, length, subtract } from "./vector";

export type Mode = "replace" | "add" | "take";

/** A choice after a stroke. */
export function combined(before: ReadonlySet<number>, stroke: ReadonlySet<number>, mode: Mode): Set<number> {
  if (mode === "replace") return new Set(stroke);
  const result = new Set(before);
  for (const face of stroke) {
    if (mode === "add") result.add(face);
    else result.delete(face);
  }
  return result;
}

/** The triangles of a surface that share an edge, three for each, -1 where it ends or more than two meet. */
export function neighboursOf(triangles: Uint32Array): Int32Array {
  const count = triangles.reduce((most, point) => Math.max(most, point + 1), 0);
  const result = new Int32Array(triangles.length).fill(-1);
  const open = new Map<number, number>();
  for (let corner = 0; corner < triangles.length; corner++) {
    const next = corner % 3 === 2 ? corner - 2 : corner + 1;
    const [a, b] = [triangles[corner]!, triangles[next]!];
    const edge = Math.min(a, b) * count + Math.max(a, b);
    const other = open.get(edge);
    if (other === undefined) open.set(edge, corner);
    else if (other >= 0) {
      result[corner] = Math.floor(other / 3);
      result[other] = Math.floor(corner / 3);
      open.set(edge, -1);
    }
  }
  return result;
}

/** The faces that are reached from one without crossing an edge at which the surface turns by more than an angle in degrees. */
export function grown(points: ArrayLike<number>, triangles: Uint32Array, neighbours: Int32Array, from: number, degrees: number): Set<number> {
  const at = (point: number): Vector => [points[3 * point]!, points[3 * point + 1]!, points[3 * point + 2]!];
  const normal = (face: number): Vector => {
    const [a, b, c] = [at(triangles[3 * face]!), at(triangles[3 * face + 1]!), at(triangles[3 * face + 2]!)];
    return cross(subtract(b, a), subtract(c, a));
  };
  const found = new Set([from]);
  const waiting = [from];
  const least = Math.cos((degrees * Math.PI) / 180) - 1e-9;
  for (let face = waiting.pop(); face !== undefined; face = waiting.pop()) {
    const own = normal(face);
    for (let k = 3 * face; k < 3 * face + 3; k++) {
      const next = neighbours[k]!;
      if (next < 0 || found.has(next)) continue;
      const other = normal(next);
      if (dot(own, other) < least * length(own) * length(other)) continue;
      found.add(next);
      waiting.push(next);
    }
  }
  return found;
}

/** The points of some triangles. */
export function pointsOf(triangles: Uint32Array, faces: Iterable<number>): Set<number> {
  const found = new Set<number>();
  for (const face of faces) for (let k = 3 * face; k < 3 * face + 3; k++) if (triangles[k] !== undefined) found.add(triangles[k]!);
  return found;
}

/** The faces as a region, numbered as the surface numbers them; null for none. */
export function regionOf(faces: ReadonlySet<number>): Values | null {
  return faces.size === 0 ? null : { faces: [...faces].sort((a, b) => a - b) };
}

/** The box along the axes around the points of the faces in the reference, as a region; null for none. */
export function boxRegionOf(faces: ReadonlySet<number>, triangles: Uint32Array, reference: ArrayLike<number>): Values | null {
  const box = boxOf(reference, pointsOf(triangles, faces));
  return box && { box: { lower: box[0], upper: box[1] } };
}

/**
 * The triangles of which all points lie in a region, in the reference, and its points: what a region means is told by the points.
 * Null where it is no region.
 */
export function meantBy(region: Json | undefined, triangles: Uint32Array, reference: ArrayLike<number>): { faces: Set<number>; points: Set<number> } | null {
  if (!isObject(region)) return null;
  if (Array.isArray(region.faces)) {
    const faces = new Set(region.faces.filter((face): face is number => typeof face === "number" && face >= 0 && 3 * face < triangles.length));
    return { faces, points: pointsOf(triangles, faces) };
  }
  const isInside = inside(region);
  if (!isInside) return null;
  const points = new Set<number>();
  for (let i = 0; 3 * i < reference.length; i++) if (isInside([reference[3 * i]!, reference[3 * i + 1]!, reference[3 * i + 2]!])) points.add(i);
  const faces = new Set<number>();
  for (let face = 0; 3 * face < triangles.length; face++) if ([0, 1, 2].every((k) => points.has(triangles[3 * face + k]!))) faces.add(face);
  return { faces, points };
}

function inside({ box, sphere, half_space: half }: Values): ((point: Vector) => boolean) | null {
  if (isObject(box)) {
    const [lower, upper] = [vectorOf(box.lower), vectorOf(box.upper)];
    return lower && upper && ((point) => [0, 1, 2].every((k) => point[k]! >= lower[k]! && point[k]! <= upper[k]!));
  }
  if (isObject(sphere)) {
    const center = vectorOf(sphere.center), { radius } = sphere;
    return center && typeof radius === "number" ? (point) => length(subtract(point, center)) <= radius : null;
  }
  if (isObject(half)) {
    const [origin, normal] = [vectorOf(half.origin), vectorOf(half.normal)];
    return origin && normal && ((point) => dot(subtract(point, origin), normal) >= 0);
  }
  return null;
}
