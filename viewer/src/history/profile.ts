/** What a line of points and a set of faces say of a field: its profile along the line, and how its values are spread. Pure functions. */
import type { DataFrame, TopologyFrame, Vector } from "../connection/protocol";
import { scalars } from "../picture/colour";

/** Values at distances from the first end, in order; a null between two of them where the line leaves the domain. */
export interface Profile { distances: number[]; values: (number | null)[] }

/** The field along a line of points from one end on; null where the frame does not carry it. */
export function profile({ points, fields }: Pick<DataFrame, "points" | "fields">, from: Vector, name: string, component: number, spacing: number): Profile | null {
  const field = fields.find((candidate) => candidate.name === name && candidate.association === "vertex");
  if (!field) return null;
  const values = scalars(field, component);
  const at = Array.from(values, (value, i) => ({ distance: Math.hypot(...from.map((part, k) => points[3 * i + k]! - part)), value })).sort((a, b) => a.distance - b.distance);
  const result: Profile = { distances: [], values: [] };
  let last = -Infinity;
  for (const { distance, value } of at) {
    // Points outside of every cell are left out of what is streamed.
    if (distance - last > 1.5 * spacing && Number.isFinite(last)) {
      result.distances.push((distance + last) / 2);
      result.values.push(null);
    }
    result.distances.push(distance);
    result.values.push(Number.isFinite(value) ? value : null);
    last = distance;
  }
  return result;
}

/** Several profiles in one table, as a plot needs them: all distances, and each profile at those that are its own. */
export function together(profiles: readonly (Profile | null)[]): { distances: number[]; columns: (number | null | undefined)[][] } {
  const distances = [...new Set(profiles.flatMap((one) => one?.distances ?? []))].sort((a, b) => a - b);
  const rows = new Map(distances.map((distance, row) => [distance, row]));
  const columns = profiles.map((one) => {
    // Where another profile has a point and this one none, nothing is said: the line goes on.
    const column = new Array<number | null | undefined>(distances.length).fill(undefined);
    one?.distances.forEach((distance, i) => { column[rows.get(distance)!] = one.values[i]!; });
    return column;
  });
  return { distances, columns };
}

/** How much of a view has a value: by area, or by number where there are no faces. */
export interface Weighted { values: Float64Array; weights: Float64Array; least: number; largest: number; mean: number }

/** The values of a field on the faces of a view, each with its area; null where the frame does not carry it. */
export function weighted(topology: Pick<TopologyFrame, "triangles">, { points, fields }: Pick<DataFrame, "points" | "fields">, name: string, component: number): Weighted | null {
  const field = fields.find((candidate) => candidate.name === name);
  if (!field) return null;
  const all = scalars(field, component);
  const { triangles } = topology;
  const count = triangles.length / 3;
  const values = new Float64Array(count), weights = new Float64Array(count);
  let least = Infinity, largest = -Infinity, sum = 0, total = 0;
  for (let t = 0; t < count; t++) {
    const [a, b, c] = [triangles[3 * t]!, triangles[3 * t + 1]!, triangles[3 * t + 2]!];
    const value = field.association === "element" ? all[t]! : (all[a]! + all[b]! + all[c]!) / 3;
    const weight = area(points, a, b, c);
    if (!Number.isFinite(value) || !Number.isFinite(weight)) continue;
    values[t] = value;
    weights[t] = weight;
    least = Math.min(least, value);
    largest = Math.max(largest, value);
    sum += weight * value;
    total += weight;
  }
  return total > 0 ? { values, weights, least, largest, mean: sum / total } : null;
}

function area(points: Float32Array, a: number, b: number, c: number): number {
  const [ux, uy, uz] = [0, 1, 2].map((k) => points[3 * b + k]! - points[3 * a + k]!) as Vector;
  const [vx, vy, vz] = [0, 1, 2].map((k) => points[3 * c + k]! - points[3 * a + k]!) as Vector;
  return Math.hypot(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx) / 2;
}

/** The part of the whole in each of equal bins from one end to the other. */
export function histogram({ values, weights }: Pick<Weighted, "values" | "weights">, [low, high]: readonly [number, number], bins: number): number[] {
  const parts = new Array<number>(bins).fill(0);
  let total = 0;
  values.forEach((value, i) => {
    const weight = weights[i]!;
    if (weight === 0) return;
    total += weight;
    const bin = high > low ? Math.floor((bins * (value - low)) / (high - low)) : 0;
    parts[Math.max(0, Math.min(bins - 1, bin))]! += weight;
  });
  return total > 0 ? parts.map((part) => part / total) : parts;
}
