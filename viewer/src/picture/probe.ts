/** What a view has at a place: its value there, wherever the mesh has moved since. */
import type { DataFrame, TopologyFrame, Vector } from "../connection/protocol";
import { digits } from "../number";
import type { Look } from "../store/looks";
import { nearestPoint, nearestTriangle } from "./nearest";

/** A place in a view: a point in one of the triangles of a topology, by the weights of the corners. It goes where they go. */
export interface Probe { view: string; topology: string; triangle: number; weights: Vector }

/** `value` is that of the field that colours the view; null where none does, or its value is not finite. */
export interface ProbeReading { point: Vector; feature: number | null; field: string | null; component: number; value: number | null; cycle: number; time: number }

/** The weights of a triangle's corners at a point of its plane; of a flat one those of its first corner. */
export function weights(point: Vector, [a, b, c]: readonly [Vector, Vector, Vector]): Vector {
  const minus = (p: Vector, q: Vector): Vector => [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
  const dot = (p: Vector, q: Vector): number => p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
  const [e, f, p] = [minus(b, a), minus(c, a), minus(point, a)];
  const [ee, ef, ff, pe, pf] = [dot(e, e), dot(e, f), dot(f, f), dot(p, e), dot(p, f)];
  const determinant = ee * ff - ef * ef;
  if (!(determinant > 0)) return [1, 0, 0];
  const v = (ff * pe - ef * pf) / determinant;
  const w = (ee * pf - ef * pe) / determinant;
  return [1 - v - w, v, w];
}

/** The corners of a triangle: which points they are, and where they lie. */
export function cornersOf(triangle: number, topology: TopologyFrame, points: Float32Array): { indices: Vector; places: [Vector, Vector, Vector] } | null {
  if (!(3 * triangle + 2 < topology.triangles.length)) return null;
  const indices = [0, 1, 2].map((corner) => topology.triangles[3 * triangle + corner]!) as Vector;
  return { indices, places: indices.map((index) => [0, 1, 2].map((k) => points[3 * index + k]!) as Vector) as [Vector, Vector, Vector] };
}

/** What a view has at a place; null where its triangles are others than when the place was found. */
export function readProbe({ topology: own, triangle, weights: at }: Probe, topology: TopologyFrame, frame: DataFrame, { field: name, component }: Pick<Look, "field" | "component">): ProbeReading | null {
  if (topology.topology !== own) return null;
  const corners = cornersOf(triangle, topology, frame.points);
  if (!corners) return null;
  const point = [0, 1, 2].map((k) => corners.places.reduce((sum, place, corner) => sum + at[corner]! * place[k]!, 0)) as Vector;
  const field = frame.fields.find((candidate) => candidate.name === name);
  let value: number | null = null;
  if (field) {
    const { components, values } = field;
    const all = Array.from({ length: components }, (_, c) => (field.association === "element" ? values[triangle * components + c]!
      : corners.indices.reduce((sum, index, corner) => sum + at[corner]! * values[index * components + c]!, 0)));
    const chosen = components === 1 ? all[0]! : component >= 0 ? all[Math.min(component, components - 1)]! : Math.hypot(...all);
    value = Number.isFinite(chosen) ? chosen : null;
  }
  const feature = topology.triangleFeatures?.[triangle] ?? null;
  return { point, feature, field: field?.name ?? null, component, value, cycle: frame.cycle, time: frame.time };
}

/** The place of a view that is nearest to a point; null where it is farther away than its triangle is long. */
export function probeNear(view: string, point: Vector, topology: TopologyFrame, points: Float32Array): Probe | null {
  const { triangle, distance } = nearestTriangle(point, topology.triangles, points);
  const corners = cornersOf(triangle, topology, points);
  if (!corners) return null;
  const [a, b, c] = corners.places;
  const size = Math.max(...([[a, b], [b, c], [c, a]] as const).map(([p, q]) => Math.hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2])));
  return distance <= size ? { view, topology: topology.topology, triangle, weights: weights(nearestPoint(point, corners.places), corners.places) } : null;
}

/** A reading in two lines: the value, and the place. */
export function readingText({ field, value, point }: ProbeReading, title: string, unit: string | null = null): string {
  // What rounding has left of a zero is a zero.
  const size = Math.max(...point.map(Math.abs));
  const place = `(${point.map((part) => digits(Math.abs(part) < 1e-6 * size ? 0 : part, 4)).join(", ")})`;
  return field === null ? place : `${title} ${digits(value, 4)}${unit ? ` ${unit}` : ""}\n${place}`;
}
