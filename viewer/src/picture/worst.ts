/** The worst cells of a view that carries the quality of its cells: where they are, the worst first. */
import type { DataFrame, TopologyFrame, Vector } from "../connection/protocol";
import { QUALITY } from "../store/pipelines";

/** How many are marked. */
const MARKED = 10;
/** The corners of the largest cell that is drawn, a hexahedron. */
const CORNERS = 8;

export interface PoorCell { quality: number; centroid: Vector }

/**
 * No frame says which cell a face is of. Faces of one cell have one value and meet at edges: those are one cell, at the middle of its
 * corners. Where they have more corners than a cell has, neighbours are alike, and each part of so many corners counts as a cell.
 */
export function worstOf(topology: TopologyFrame, frame: DataFrame): PoorCell[] {
  const field = frame.fields.find(({ name, association }) => name === QUALITY && association === "element");
  if (!field) return [];
  const alike = new Map<number, number[]>();
  for (let triangle = 0; 3 * triangle < topology.triangles.length; triangle++) {
    const value = field.values[triangle];
    if (value === undefined || !Number.isFinite(value)) continue;
    const faces = alike.get(value);
    if (faces) faces.push(triangle);
    else alike.set(value, [triangle]);
  }
  const found: PoorCell[] = [];
  for (const [quality, faces] of [...alike].sort(([a], [b]) => a - b)) {
    for (const points of cellsOf(faces, topology.triangles)) {
      found.push({ quality, centroid: [0, 1, 2].map((k) => [...points].reduce((sum, point) => sum + frame.points[3 * point + k]!, 0) / points.size) as Vector });
      if (found.length === MARKED) return found;
    }
  }
  return found;
}

/** The corners of each cell among triangles that are alike. */
function* cellsOf(faces: readonly number[], triangles: Uint32Array): Generator<Set<number>> {
  const corners = (face: number): number[] => [0, 1, 2].map((k) => triangles[3 * face + k]!);
  const edges = (face: number): string[] => corners(face).map((corner, k, all) => [corner, all[(k + 1) % 3]!].sort((a, b) => a - b).join());
  const at = new Map<string, number[]>();
  for (const face of faces) for (const edge of edges(face)) at.set(edge, [...at.get(edge) ?? [], face]);
  const left = new Set(faces);
  for (const first of faces) {
    if (!left.delete(first)) continue;
    const points = new Set(corners(first));
    const queue = [first];
    for (let face = queue.pop(); face !== undefined; face = queue.pop()) {
      for (const next of edges(face).flatMap((edge) => at.get(edge)!)) {
        const added = corners(next).filter((corner) => !points.has(corner));
        if (!left.has(next) || points.size + added.length > CORNERS) continue;
        left.delete(next);
        added.forEach((corner) => points.add(corner));
        queue.push(next);
      }
    }
    yield points;
  }
}
