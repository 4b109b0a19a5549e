import { describe, expect, it } from "vitest";
import { TriangleTree } from "../../src/picture/triangle-tree";
import type { Vector } from "../../src/connection/protocol";

/** Numbers from 0 to 1, the same each time (Park and Miller). */
function random(seed: number): () => number {
  let state = seed;
  return () => (state = (state * 48271) % 2147483647) / 2147483647;
}

// Two parallel unit squares, at z = 0 and z = 1, of two triangles each.
const squares = Float32Array.from([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1]);
const corners = Uint32Array.from([0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7]);

describe("a tree of triangles", () => {
  it("meets the nearest triangle, from either side", () => {
    const tree = new TriangleTree(corners, squares);
    expect(tree.firstHit([0.8, 0.2, 5], [0, 0, -1])).toEqual({ triangle: 2, distance: 4 });
    expect(tree.firstHit([0.2, 0.8, -5], [0, 0, 1])).toEqual({ triangle: 1, distance: 5 });
    expect(tree.firstHit([0.2, 0.8, 0.5], [0, 0, 1])?.triangle).toBe(3);
    expect(tree.firstHit([1.2, 0.8, 5], [0, 0, -1])).toBeNull();
    expect(tree.firstHit([0.2, 0.8, 5], [0, 0, 1])).toBeNull();
    expect(tree.firstHit([NaN, 0, 0], [0, 0, 1])).toBeNull();
    expect(new TriangleTree(new Uint32Array(0), new Float32Array(0)).firstHit([0, 0, 0], [0, 0, 1])).toBeNull();
  });

  it("finds what one triangle at a time finds, also after the points have moved", () => {
    const next = random(7);
    const count = 3000;
    const triangles = Uint32Array.from({ length: 3 * count }, (_, i) => i);
    const place = (): Float32Array => {
      const points = new Float32Array(9 * count);
      for (let t = 0; t < count; t++) {
        const middle = [next(), next(), next()];
        for (let i = 0; i < 9; i++) points[9 * t + i] = middle[i % 3]! + 0.05 * next();
      }
      return points;
    };
    let points = place();
    const tree = new TriangleTree(triangles, points);
    let hits = 0;
    for (let ray = 0; ray < 300; ray++) {
      if (ray === 150) {
        points = place();
        tree.refit(points);
      }
      const origin: Vector = [3 * next() - 1, 3 * next() - 1, 3 * next() - 1];
      const direction: Vector = [0, 1, 2].map((k) => next() - origin[k]!) as Vector;
      let nearest: { triangle: number; distance: number } | null = null;
      for (let t = 0; t < count; t++) {
        const alone = new TriangleTree(Uint32Array.of(0, 1, 2), points.subarray(9 * t, 9 * t + 9)).firstHit(origin, direction);
        if (alone && (!nearest || alone.distance < nearest.distance)) nearest = { triangle: t, distance: alone.distance };
      }
      expect(tree.firstHit(origin, direction)).toEqual(nearest);
      if (nearest) hits++;
    }
    expect(hits).toBeGreaterThan(100);
  });

  it("bears triangles that all lie at one place, and points that are not finite", () => {
    const many = new TriangleTree(new Uint32Array(300), Float32Array.from([0, 0, 0, 1, 0, 0, 0, 1, 0]));
    expect(many.firstHit([0, 0, 1], [0, 0, -1])).toBeNull();
    const wild = squares.slice();
    wild[0] = NaN;
    expect(new TriangleTree(corners, wild).firstHit([0.8, 0.2, 5], [0, 0, -1])?.triangle).toBe(2);
  });

  it("looks at few of many triangles: the points that it reads", () => {
    const side = 200;
    const points = new Float32Array(3 * (side + 1) ** 2);
    const triangles: number[] = [];
    for (let i = 0; i <= side; i++) for (let j = 0; j <= side; j++) points.set([i, j, 0], 3 * (i * (side + 1) + j));
    for (let i = 0; i < side; i++) for (let j = 0; j < side; j++) {
      const a = i * (side + 1) + j;
      triangles.push(a, a + 1, a + side + 1, a + 1, a + side + 2, a + side + 1);
    }
    const tree = new TriangleTree(Uint32Array.from(triangles), points);
    let read = 0;
    tree.refit(points);
    (tree as unknown as { points: Float32Array }).points = new Proxy(points, { get: (target, key) => (read++, Reflect.get(target, key) as number) });
    expect(tree.firstHit([100.3, 50.2, 9], [0.01, 0.02, -1])).not.toBeNull();
    expect(read).toBeLessThan(9 * 40);
  });
});
