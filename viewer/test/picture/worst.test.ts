import { describe, expect, it } from "vitest";
import { worstOf } from "../../src/picture/worst";
import { QUALITY, WORST } from "../../src/store/pipelines";

/** The edges of the worst cells of a view in which all are alike, by the numbers of their ends. */
function edges(triangles: number[], points: number[]): string[][] {
  const cells = worstOf(
    { kind: "topology", view: WORST, topology: "1", points: points.length / 3, triangles: Uint32Array.from(triangles), triangleFeatures: null, lines: new Uint32Array(0) },
    { kind: "data", view: WORST, topology: "1", cycle: 1, time: 1, points: Float32Array.from(points),
      fields: [{ name: QUALITY, association: "element", components: 1, values: new Float64Array(triangles.length / 3).fill(0.5) }] },
  );
  const number = (place: readonly number[]): number => [...Array(points.length / 3).keys()].find((i) => place.every((part, k) => Math.fround(points[3 * i + k]!) === part))!;
  return cells.map((cell) => cell.edges.map((ends) => ends.map(number).sort((a, b) => a - b).join(" ")).sort());
}

describe("the outline of a poor cell", () => {
  const TETRAHEDRON = [0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3];
  it("has all edges of a tetrahedron, also of one so flat that its faces lie in one plane", () => {
    const all = [["0 1", "0 2", "0 3", "1 2", "1 3", "2 3"]];
    expect(edges(TETRAHEDRON, [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1])).toEqual(all);
    expect(edges(TETRAHEDRON, [0, 0, 0, 1, 1, 0, 1, 0, 0, 0, 1, 1e-4])).toEqual(all);
  });

  it("has the twelve edges of a hexahedron, and not what divides its faces into triangles", () => {
    const cube = Array.from({ length: 8 }, (_, i) => [i & 1, (i >> 1) & 1, i >> 2]).flat();
    const quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    const triangles = quads.flatMap(([a, b, c, d]) => [a!, b!, c!, a!, c!, d!]);
    const [found] = edges(triangles, cube);
    expect(found).toHaveLength(12);
    for (const ends of found!) {
      const [a, b] = ends.split(" ").map(Number) as [number, number];
      expect([1, 2, 4]).toContain(a ^ b);
    }
    // One corner pushed in: no face is quite flat.
    const pushed = cube.map((part, i) => (i < 3 ? 0.08 : part));
    expect(edges(triangles, pushed)[0]).toEqual(found);
  });

  it("has what is seen of a cell, where others hide the rest", () => {
    expect(edges([0, 2, 1], [0, 0, 0, 1, 0, 0, 0, 1, 0])).toEqual([["0 1", "0 2", "1 2"]]);
  });
});
