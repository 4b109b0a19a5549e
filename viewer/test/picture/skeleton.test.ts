import { describe, expect, it } from "vitest";
import { nearestWithin, segmentsOf } from "../../src/picture/skeleton";

const curves = (...all: number[][]): Uint32Array[] => all.map((nodes) => Uint32Array.from(nodes));

describe("the skeleton in the picture", () => {
  it("pins ends and branch nodes, and nothing of a loop of its own", () => {
    const lollipop = segmentsOf(curves([0, 1, 2], [2, 3, 4, 5, 2]), 6);
    expect([...lollipop.segments]).toEqual([0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 2]);
    expect([...lollipop.free]).toEqual([1, 3, 4, 5]);
    expect([...segmentsOf(curves([0, 1, 2, 0]), 3).free]).toEqual([0, 1, 2]);
    expect([...segmentsOf([], 1).free]).toEqual([]);
  });

  it("means the nearest node within reach", () => {
    const places = Float32Array.from([0, 0, 30, 0, 36, 0, NaN, NaN]);
    expect(nearestWithin(places, 1, 1, 12)).toBe(0);
    expect(nearestWithin(places, 34, 2, 12)).toBe(2);
    expect(nearestWithin(places, 15, 0, 12)).toBe(-1);
    expect(nearestWithin(new Float32Array(0), 0, 0, 12)).toBe(-1);
  });
});
