import { describe, expect, it } from "vitest";
import type { Vector } from "../../src/connection/protocol";
import { nearestPoint, nearestTriangle } from "../../src/picture/nearest";

const corners: [Vector, Vector, Vector] = [[0, 0, 0], [4, 0, 0], [0, 4, 0]];

describe("the nearest point of a triangle", () => {
  it.each<[string, Vector, Vector]>([
    ["inside of it", [1, 1, 5], [1, 1, 0]], ["at its corners", [-1, -2, 0], [0, 0, 0]], ["at its corners", [6, -1, 1], [4, 0, 0]], ["at its corners", [-1, 7, 0], [0, 4, 0]],
    ["on its sides", [2, -3, 1], [2, 0, 0]], ["on its sides", [-3, 1, 0], [0, 1, 0]], ["on its sides", [4, 4, 2], [2, 2, 0]],
  ])("lies %s", (_, point, nearest) => {
    nearestPoint(point, corners).forEach((part, k) => expect(part).toBeCloseTo(nearest[k]!, 12));
  });
});

describe("the nearest triangle", () => {
  it("is the one that a look at all of them finds", () => {
    // Park and Miller's numbers, the same each time.
    let state = 11;
    const next = (): number => (state = (state * 48271) % 2147483647) / 2147483647;
    const count = 400;
    const triangles = Uint32Array.from({ length: 3 * count }, (_, i) => i);
    const points = new Float32Array(9 * count);
    for (let t = 0; t < count; t++) {
      const middle = [next(), next(), next()];
      for (let i = 0; i < 9; i++) points[9 * t + i] = middle[i % 3]! + 0.1 * next();
    }
    const corner = (at: number): Vector => [points[3 * at]!, points[3 * at + 1]!, points[3 * at + 2]!];
    for (let i = 0; i < 50; i++) {
      const point: Vector = [2 * next() - 0.5, 2 * next() - 0.5, 2 * next() - 0.5];
      const distances = Array.from({ length: count }, (_, t) => {
        const found = nearestPoint(point, [corner(3 * t), corner(3 * t + 1), corner(3 * t + 2)]);
        return Math.hypot(...found.map((part, k) => part - point[k]!));
      });
      expect(nearestTriangle(point, triangles, points).distance).toBeCloseTo(Math.min(...distances), 12);
    }
    expect(nearestTriangle([0, 0, 0], new Uint32Array(0), points)).toEqual({ triangle: -1, distance: Infinity });
  });
});
