import { describe, expect, it } from "vitest";
import { contains, distance, gizmoShapes, partAt, reachOf } from "../../src/handles/gizmo";
import type { Shape } from "../../src/handles/gizmo";
import { ALONG_X, OBLIQUE, PARALLEL, camera } from "./cameras";

const KINDS = ["arrow", "plane", "ring", "box"] as const;
const middle = ({ lines, fill }: Shape): [number, number] => {
  const points = fill ?? lines.flat();
  return [points.reduce((sum, [x]) => sum + x, 0) / points.length, points.reduce((sum, [, y]) => sum + y, 0) / points.length];
};

describe("the gizmo", () => {
  it("has the same size in pixels however far away it is", () => {
    const sizes = [camera([8, -8, 5], [0, 0, 0], [0, 0, 1]), camera([40, -40, 25], [0, 0, 0], [0, 0, 1]), PARALLEL].map((projection) => {
      const box = gizmoShapes(projection, [0, 0, 0], ["arrow"]).find(({ part }) => part.axis === 2)!;
      return distance(box.fill![0]!, projection.toPicture([0, 0, 0])!);
    });
    for (const size of sizes) {
      expect(size).toBeGreaterThan(60);
      expect(size).toBeLessThan(100);
    }
  });

  it("finds each part where it is drawn, and nothing beside it", () => {
    const shapes = gizmoShapes(OBLIQUE, [0, 0, 0], KINDS);
    expect(shapes).toHaveLength(12);
    for (const shape of shapes.filter(({ part }) => part.kind === "box" || part.kind === "plane")) expect(partAt(shapes, middle(shape), reachOf("mouse"))).toEqual(shape.part);
    for (const axis of [0, 1, 2] as const) {
      const arrow = shapes.find(({ part }) => part.kind === "arrow" && part.axis === axis)!;
      expect(partAt(shapes, middle(arrow), reachOf("mouse"))).toEqual({ kind: "arrow", axis });
    }
    const [x, y] = OBLIQUE.toPicture([0, 0, 0])!;
    expect(partAt(shapes, [x + 130, y + 130], reachOf("mouse"))).toBeNull();
    expect(partAt([], [x, y], reachOf("mouse"))).toBeNull();
  });

  it("lets a finger be less exact than a mouse", () => {
    const shapes = gizmoShapes(ALONG_X, [0, 0, 0], ["arrow"]);
    const tip = shapes.find(({ part }) => part.axis === 2)!.fill![0]!;
    expect(partAt(shapes, [tip[0] + 14, tip[1]], reachOf("mouse"))).toBeNull();
    expect(partAt(shapes, [tip[0] + 14, tip[1]], reachOf("touch"))).toEqual({ kind: "arrow", axis: 2 });
  });

  it("leaves out what is seen from its end or from its edge: it could not be dragged", () => {
    const shapes = gizmoShapes(ALONG_X, [0, 0, 0], KINDS);
    const has = (kind: string, axis: number): boolean => shapes.some(({ part }) => part.kind === kind && part.axis === axis);
    expect([has("arrow", 0), has("box", 0), has("plane", 1), has("plane", 2)]).toEqual([false, false, false, false]);
    expect([has("arrow", 1), has("box", 2), has("plane", 0), has("ring", 0), has("ring", 1)]).toEqual([true, true, true, true, true]);
    expect(gizmoShapes(ALONG_X, [12, 0, 0], KINDS), "behind the viewer").toEqual([]);
  });

  it("knows what lies in a polygon", () => {
    const horseshoe: [number, number][] = [[0, 0], [10, 0], [10, 10], [7, 10], [7, 3], [3, 3], [3, 10], [0, 10]];
    expect([[1, 9], [5, 1], [8, 9]].every((place) => contains(horseshoe, place as [number, number]))).toBe(true);
    expect([[5, 9], [-1, 5], [5, 11]].some((place) => contains(horseshoe, place as [number, number]))).toBe(false);
  });
});
