/** The worst cells of a view that carries the quality of its cells: where they are, the worst first. */
import type { DataFrame, TopologyFrame, Vector } from "../connection/protocol";
import { cross, dot, normalised, subtract } from "../handles/vector";
import { QUALITY } from "../store/pipelines";

/** How many are marked. */
const MARKED = 10;
/** The corners of the largest cell that is drawn, a hexahedron. */
const CORNERS = 8;
/** A cell of so few corners, a tetrahedron, has no faces but triangles. */
const TRIANGULAR = 4;
/** Two triangles whose normals are as alike as this cosine are taken for the halves of a face of four corners. */
const ALIKE = 0.98;

export interface PoorCell { quality: number; centroid: Vector; /** Those of its faces that are drawn, each by its ends. */ edges: [Vector, Vector][] }

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
    for (const cell of cellsOf(faces, topology.triangles)) {
      const { points } = cell;
      const centroid = [0, 1, 2].map((k) => [...points].reduce((sum, point) => sum + frame.points[3 * point + k]!, 0) / points.size) as Vector;
      found.push({ quality, centroid, edges: edgesOf(cell, topology.triangles, frame.points) });
      if (found.length === MARKED) return found;
    }
  }
  return found;
}

interface Cell { points: Set<number>; faces: number[] }

const cornersOf = (triangles: Uint32Array, face: number): number[] => [0, 1, 2].map((k) => triangles[3 * face + k]!);
/** The edges of a triangle, each by its ends, the lower number first. */
const sidesOf = (triangles: Uint32Array, face: number): [number, number][] =>
  cornersOf(triangles, face).map((corner, k, all) => [corner, all[(k + 1) % 3]!].sort((a, b) => a - b) as [number, number]);

/** The edges of a cell. What divides a face of four corners into triangles is none. */
function edgesOf({ points, faces }: Cell, triangles: Uint32Array, coordinates: ArrayLike<number>): [Vector, Vector][] {
  const at = (point: number): Vector => [coordinates[3 * point]!, coordinates[3 * point + 1]!, coordinates[3 * point + 2]!];
  const normal = (face: number): Vector => {
    const [a, b, c] = cornersOf(triangles, face).map(at) as [Vector, Vector, Vector];
    return normalised(cross(subtract(b, a), subtract(c, a)));
  };
  const beside = new Map<string, { ends: [number, number]; faces: number[] }>();
  for (const face of faces) {
    for (const ends of sidesOf(triangles, face)) {
      const known = beside.get(ends.join());
      if (known) known.faces.push(face);
      else beside.set(ends.join(), { ends, faces: [face] });
    }
  }
  const isWithinFace = ([one, other]: readonly number[]): boolean =>
    points.size > TRIANGULAR && one !== undefined && other !== undefined && dot(normal(one), normal(other)) > ALIKE;
  return [...beside.values()].filter((side) => !isWithinFace(side.faces)).map(({ ends: [a, b] }) => [at(a), at(b)]);
}

/** The cells among triangles that are alike. */
function* cellsOf(faces: readonly number[], triangles: Uint32Array): Generator<Cell> {
  const corners = (face: number): number[] => cornersOf(triangles, face);
  const edges = (face: number): string[] => sidesOf(triangles, face).map((ends) => ends.join());
  const at = new Map<string, number[]>();
  for (const face of faces) for (const edge of edges(face)) at.set(edge, [...at.get(edge) ?? [], face]);
  const left = new Set(faces);
  for (const first of faces) {
    if (!left.delete(first)) continue;
    const points = new Set(corners(first)), own = [first];
    const queue = [first];
    for (let face = queue.pop(); face !== undefined; face = queue.pop()) {
      for (const next of edges(face).flatMap((edge) => at.get(edge)!)) {
        const added = corners(next).filter((corner) => !points.has(corner));
        if (!left.has(next) || points.size + added.length > CORNERS) continue;
        left.delete(next);
        own.push(next);
        added.forEach((corner) => points.add(corner));
        queue.push(next);
      }
    }
    yield { points, faces: own };
  }
}
