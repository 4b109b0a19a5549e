import { describe, expect, it } from "vitest";
import { histogram, profile, together, weighted } from "../../src/history/profile";

const field = (name: string, values: number[], association: "vertex" | "element" = "vertex", components = 1) => ({ name, association, components, values: Float64Array.from(values) });

describe("a profile along a line", () => {
  it("has the values in the order of their distance, and a gap where the line leaves the domain", () => {
    // At 0, 1, 2 and, behind a hole, 5 and 6; the points come in any order.
    const frame = { points: Float32Array.from([6, 0, 0, 0, 0, 0, 1, 0, 0, 2, 0, 0, 5, 0, 0]), fields: [field("p", [60, 0, 10, 20, 50])] };
    expect(profile(frame, [0, 0, 0], "p", -1, 1)).toEqual({ distances: [0, 1, 2, 3.5, 5, 6], values: [0, 10, 20, null, 50, 60] });
    expect(profile(frame, [0, 0, 0], "u", -1, 1)).toBeNull();
  });

  it("of a vector is its magnitude or one of its components", () => {
    const frame = { points: Float32Array.from([0, 0, 0, 1, 0, 0]), fields: [field("u", [3, 4, 0, 0, 0, 2], "vertex", 3)] };
    expect(profile(frame, [0, 0, 0], "u", -1, 1)!.values).toEqual([5, 2]);
    expect(profile(frame, [0, 0, 0], "u", 1, 1)!.values).toEqual([4, 0]);
  });

  it("stands beside another one: a gap is a gap, and a point of the other is none", () => {
    const { distances, columns } = together([{ distances: [0, 2], values: [1, 3] }, { distances: [0, 1, 2], values: [4, null, 6] }, null]);
    expect(distances).toEqual([0, 1, 2]);
    expect(columns).toEqual([[1, undefined, 3], [4, null, 6], [undefined, undefined, undefined]]);
  });
});

describe("a histogram", () => {
  // Two triangles in the plane: one of area 0.5, one of area 1.5.
  const topology = { triangles: Uint32Array.from([0, 1, 2, 0, 3, 2]) };
  const points = Float32Array.from([0, 0, 0, 1, 0, 0, 0, 1, 0, -3, 0, 0]);

  it("weighs faces by their area", () => {
    const found = weighted(topology, { points, fields: [field("q", [0.2, 0.8], "element")] }, "q", -1)!;
    expect(found.mean).toBeCloseTo((0.5 * 0.2 + 1.5 * 0.8) / 2, 6);
    expect([found.least, found.largest].map((value) => value.toFixed(2))).toEqual(["0.20", "0.80"]);
    expect(histogram(found, [0, 1], 4)).toEqual([0.25, 0, 0, 0.75]);
  });

  it("takes values at the corners at the middle of the face, and passes over what is not finite", () => {
    const found = weighted(topology, { points, fields: [field("p", [0, 3, 6, NaN])] }, "p", -1)!;
    expect(found.mean).toBe(3);
    expect(histogram(found, [0, 6], 2)).toEqual([0, 1]);
  });

  it("of one value alone is one bin", () => {
    const found = weighted(topology, { points, fields: [field("q", [5, 5], "element")] }, "q", -1)!;
    expect(histogram(found, [5, 5], 3)).toEqual([1, 0, 0]);
  });
});
