/** The box around a handle as it is drawn now. */
import type { TopologyFrame, Vector } from "../connection/protocol";

/** A view that may show features: its points and what connects them. */
export interface ShownSurface { topology: TopologyFrame | null; coordinates: Float32Array }

/** Keeps which points belong to the handle, so that a new frame costs no more than a look at those. */
export class HandleBox {
  private known: { topology: TopologyFrame; names: string; points: Uint32Array } | null = null;

  /** The box around some features; null where no view shows them. `features` are the names that the views number. */
  bounds(surfaces: Iterable<ShownSurface>, features: readonly string[], names: readonly string[]): [Vector, Vector] | null {
    if (names.length === 0) return null;
    for (const { topology, coordinates } of surfaces) {
      if (!topology?.triangleFeatures || coordinates.length !== 3 * topology.points) continue;
      const points = this.pointsOf(topology, features, names);
      if (points.length === 0) continue;
      return boxOf(coordinates, points);
    }
    return null;
  }

  private pointsOf(topology: TopologyFrame, features: readonly string[], names: readonly string[]): Uint32Array {
    const key = JSON.stringify([features, names]);
    if (this.known?.topology === topology && this.known.names === key) return this.known.points;
    const wanted = new Set(names.map((name) => features.indexOf(name)));
    const found = new Set<number>();
    topology.triangleFeatures?.forEach((feature, triangle) => {
      if (wanted.has(feature)) for (let k = 0; k < 3; k++) found.add(topology.triangles[3 * triangle + k]!);
    });
    this.known = { topology, names: key, points: Uint32Array.from(found) };
    return this.known.points;
  }
}

/** The box around some points, by their indices; null where there are none. */
export function boxOf(coordinates: ArrayLike<number>, points: Iterable<number>): [Vector, Vector] | null {
  const low: Vector = [Infinity, Infinity, Infinity], high: Vector = [-Infinity, -Infinity, -Infinity];
  for (const point of points) {
    for (const k of [0, 1, 2] as const) {
      const value = coordinates[3 * point + k]!;
      if (value < low[k]) low[k] = value;
      if (value > high[k]) high[k] = value;
    }
  }
  return low[0] <= high[0] ? [low, high] : null;
}

export const middleOf = ([low, high]: [Vector, Vector]): Vector => [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2];
