/** The worst cells of a view that carries the quality of its cells: where they are, the worst first. */
import type { DataFrame, TopologyFrame, Vector } from "../connection/protocol";
import { QUALITY } from "../store/pipelines";

/** How many are marked. */
const MARKED = 10;

export interface PoorCell { quality: number; centroid: Vector }

/** Faces of one cell have one value: those of the same value are one cell, at the middle of its corners. */
export function worstOf(topology: TopologyFrame, frame: DataFrame): PoorCell[] {
  const field = frame.fields.find(({ name, association }) => name === QUALITY && association === "element");
  if (!field) return [];
  const cells = new Map<number, Set<number>>();
  for (let triangle = 0; 3 * triangle < topology.triangles.length; triangle++) {
    const value = field.values[triangle];
    if (value === undefined || !Number.isFinite(value)) continue;
    const points = cells.get(value) ?? new Set<number>();
    for (let corner = 0; corner < 3; corner++) points.add(topology.triangles[3 * triangle + corner]!);
    cells.set(value, points);
  }
  return [...cells].sort(([a], [b]) => a - b).slice(0, MARKED).map(([quality, points]) => ({
    quality, centroid: [0, 1, 2].map((k) => [...points].reduce((sum, point) => sum + frame.points[3 * point + k]!, 0) / points.size) as Vector,
  }));
}
