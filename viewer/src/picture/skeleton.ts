/** What there is to draw of a curve skeleton, and which of its nodes is meant. */

/**
 * A skeleton to draw: where its nodes lie in the reference shape, in the shape that is now and in the one that is previewed; the ends
 * of its segments two by two, and the nodes that can be dragged; the nodes of each curve, and the feature that it mostly carries.
 */
export interface Bones {
  reference: Float64Array; now: Float32Array; preview: Float32Array | null;
  segments: Uint32Array; free: Uint32Array; curves: Uint32Array[]; features: (string | null)[];
}

/**
 * The segments of curves, and the nodes between their ends, which are pinned; all of a loop of its own, where nothing is.
 */
export function segmentsOf(curves: readonly Uint32Array[], nodes: number): { segments: Uint32Array; free: Uint32Array } {
  const segments: number[] = [];
  const met = new Uint8Array(nodes);
  for (const curve of curves) {
    for (let i = 0; i + 1 < curve.length; i++) {
      segments.push(curve[i]!, curve[i + 1]!);
      met[curve[i]!]!++;
      met[curve[i + 1]!]!++;
    }
  }
  const free: number[] = [];
  // A loop of its own begins and ends in the same node, where nothing else does.
  met.forEach((count, node) => { if (count === 2) free.push(node); });
  return { segments: Uint32Array.from(segments), free: Uint32Array.from(free) };
}

/** Of the places of some nodes on the screen, two numbers each, the nearest to a place that is within reach; -1 for none. */
export function nearestWithin(places: Float32Array, x: number, y: number, reach: number): number {
  let found = -1;
  let least = reach;
  for (let i = 0; 2 * i + 1 < places.length; i++) {
    const distance = Math.hypot(places[2 * i]! - x, places[2 * i + 1]! - y);
    if (distance <= least) [found, least] = [i, distance];
  }
  return found;
}
