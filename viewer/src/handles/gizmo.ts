/** What can be gripped at the middle of a handle: where each part of it is drawn, and which one lies under the pointer. */
import type { Vector } from "../connection/protocol";
import type { Place, Projection } from "./projection";
import { AXES, across, add, cross, dot, normalised, times, unit } from "./vector";
import type { Axis } from "./vector";

export type PartKind = "arrow" | "plane" | "ring" | "box";
/** An arrow moves along its axis, a plane across its axis, a ring turns about its axis, a box scales along its axis. */
export interface GizmoPart { kind: PartKind; axis: Axis }

/** All lengths in pixels. */
const ARROW = { from: 16, to: 96, head: 16 }, BOX = { at: 56, half: 5 }, PLANE = { from: 22, to: 38 }, RING = 76;
const RING_STEPS = 72;
/** What is seen so much from its end, or from its edge, is not drawn: it could not be dragged. */
const SHORTEST = 14, THINNEST = 0.12;

/** How far from a part the pointer may be to mean it: a finger is less exact than a mouse. */
export const reachOf = (pointerType: string): number => (pointerType === "touch" ? 18 : 7);

/** A part as it is drawn: lines, and what is filled. */
export interface Shape { part: GizmoPart; lines: Place[][]; fill: Place[] | null; /** The smaller is above the others under the pointer. */ order: number }

export const samePart = (a: GizmoPart | null, b: GizmoPart | null): boolean => a?.kind === b?.kind && a?.axis === b?.axis;

/** The parts of the wished kinds about a centre, those that are drawn first first. */
export function gizmoShapes(projection: Projection, center: Vector, kinds: readonly PartKind[]): Shape[] {
  const middle = projection.toPicture(center);
  const pixel = projection.pixel(center);
  if (!middle || !Number.isFinite(pixel) || !(pixel > 0)) return [];
  const at = (...offsets: [Axis, number][]): Place | null =>
    projection.toPicture(offsets.reduce((point, [axis, pixels]) => add(point, times(unit(axis), pixels * pixel)), center));
  const toViewer = times(projection.direction, -1);
  const made: { [kind in PartKind]: (axis: Axis) => Shape | null } = {
    ring: (axis) => {
      const [u, v] = across(axis).map(unit) as [Vector, Vector];
      const points = Array.from({ length: RING_STEPS + 1 }, (_, i) => {
        const angle = (2 * Math.PI * i) / RING_STEPS;
        const away = add(times(u, Math.cos(angle)), times(v, Math.sin(angle)));
        return { place: projection.toPicture(add(center, times(away, RING * pixel))), isFront: dot(away, toViewer) > -0.02 };
      });
      return { part: { kind: "ring", axis }, lines: runs(points), fill: null, order: 3 };
    },
    plane: (axis) => {
      if (Math.abs(dot(unit(axis), toViewer)) < THINNEST) return null;
      const [u, v] = across(axis);
      const corners = [[PLANE.from, PLANE.from], [PLANE.to, PLANE.from], [PLANE.to, PLANE.to], [PLANE.from, PLANE.to]]
        .map(([a, b]) => at([u, a!], [v, b!]));
      return corners.every((corner) => corner !== null) ? { part: { kind: "plane", axis }, lines: [], fill: corners, order: 1 } : null;
    },
    arrow: (axis) => {
      const [from, neck, tip] = [at([axis, ARROW.from]), at([axis, ARROW.to - ARROW.head]), at([axis, ARROW.to])];
      if (!from || !neck || !tip || distance(middle, tip) < SHORTEST) return null;
      const along: Place = [(tip[0] - middle[0]) / distance(middle, tip), (tip[1] - middle[1]) / distance(middle, tip)];
      const wing = (side: number): Place => [neck[0] - along[1] * side, neck[1] + along[0] * side];
      return { part: { kind: "arrow", axis }, lines: [[from, neck]], fill: [tip, wing(6), wing(-6)], order: 2 };
    },
    box: (axis) => {
      const place = at([axis, BOX.at]);
      if (!place || distance(middle, place) < SHORTEST) return null;
      const [x, y] = place, h = BOX.half;
      return { part: { kind: "box", axis }, lines: [], fill: [[x - h, y - h], [x + h, y - h], [x + h, y + h], [x - h, y + h]], order: 0 };
    },
  };
  return (["ring", "plane", "arrow", "box"] as const).filter((kind) => kinds.includes(kind))
    .flatMap((kind) => AXES.flatMap((axis) => made[kind](axis) ?? []));
}

/** The stretches of a line that are on the near side. */
function runs(points: readonly { place: Place | null; isFront: boolean }[]): Place[][] {
  const result: Place[][] = [];
  let current: Place[] = [];
  for (const { place, isFront } of points) {
    if (place && isFront) current.push(place);
    else if (current.length > 0) {
      result.push(current);
      current = [];
    }
  }
  if (current.length > 0) result.push(current);
  return result.filter((run) => run.length > 1);
}

/** The part under a place, within reach; null for none. */
export function partAt(shapes: readonly Shape[], place: Place, reach: number): GizmoPart | null {
  let found: Shape | null = null;
  let least = Infinity;
  for (const shape of shapes) {
    const away = shapeDistance(shape, place);
    if (away > reach) continue;
    // The small ones lie over the long ones.
    const rank = shape.order * 4 + away;
    if (rank < least) [found, least] = [shape, rank];
  }
  return found?.part ?? null;
}

function shapeDistance({ lines, fill }: Shape, place: Place): number {
  const toLines = lines.map((line) => lineDistance(line, place));
  const toFill = fill ? (contains(fill, place) ? 0 : lineDistance([...fill, fill[0]!], place)) : Infinity;
  return Math.min(toFill, ...toLines);
}

function lineDistance(line: readonly Place[], [x, y]: Place): number {
  let least = Infinity;
  for (let i = 0; i + 1 < line.length; i++) {
    const [ax, ay] = line[i]!, [bx, by] = line[i + 1]!;
    const [dx, dy] = [bx - ax, by - ay];
    const t = Math.max(0, Math.min(1, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1)));
    least = Math.min(least, Math.hypot(ax + t * dx - x, ay + t * dy - y));
  }
  return least;
}

export const distance = (a: Place, b: Place): number => Math.hypot(a[0] - b[0], a[1] - b[1]);

/** Whether a place lies in a polygon, by how often a line from it crosses the outline. */
export function contains(polygon: readonly Place[], [x, y]: Place): boolean {
  let inside = false;
  for (let i = 0, j = polygon.length - 1; i < polygon.length; j = i++) {
    const [ax, ay] = polygon[i]!, [bx, by] = polygon[j]!;
    if ((ay > y) !== (by > y) && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) inside = !inside;
  }
  return inside;
}

/** The direction on a ring in which it turns, at a place of it, and its radius: in pixels. */
export function ringTangent(projection: Projection, center: Vector, axis: Axis, at: Vector): { tangent: Place; radius: number } | null {
  const pixel = projection.pixel(center);
  const forward = normalised(cross(unit(axis), at));
  const [here, there] = [projection.toPicture(add(center, at)), projection.toPicture(add(add(center, at), times(forward, pixel)))];
  return here && there ? { tangent: [there[0] - here[0], there[1] - here[1]], radius: RING } : null;
}
