import { describe, expect, it } from "vitest";
import { Ranges, valueAt } from "../../src/picture/ranges";
import type { RangeChoice } from "../../src/picture/ranges";

const AUTO: RangeChoice = { kind: "auto", low: 0, high: 0, symmetric: false, logarithmic: false };

describe("the range of a colour map", () => {
  it("follows the values, and stays while an order is under way", () => {
    const ranges = new Ranges();
    expect(ranges.range("p", AUTO, [0, 1], false)).toEqual([0, 1]);
    expect(ranges.range("p", AUTO, [0, 9], true)).toEqual([0, 1]);
    expect(ranges.range("q", AUTO, [0, 9], true)).toEqual([0, 9]);
    expect(ranges.range("p", AUTO, [0, 9], false)).toEqual([0, 9]);
    expect(ranges.range("none", AUTO, null, false)).toBeNull();
  });

  it("holds all that was over time", () => {
    const ranges = new Ranges();
    const choice: RangeChoice = { ...AUTO, kind: "over time" };
    for (const now of [[0, 1], [-2, 0.5]] as const) ranges.range("p", choice, [...now], false);
    expect(ranges.range("p", choice, [0, 0.1], false)).toEqual([-2, 1]);
    ranges.keep(new Set());
    expect(ranges.range("p", choice, [0, 0.1], false)).toEqual([0, 0.1]);
  });

  it("is what was typed, where that is a range", () => {
    const ranges = new Ranges();
    expect(ranges.range("p", { ...AUTO, kind: "fixed", low: 2, high: 3 }, [0, 1], false)).toEqual([2, 3]);
    expect(ranges.range("p", { ...AUTO, kind: "fixed", low: 3, high: 2 }, [0, 1], false)).toEqual([0, 1]);
  });

  it("lies about 0, or holds positive values only, and is never empty", () => {
    const ranges = new Ranges();
    const of = (choice: Partial<RangeChoice>, now: [number, number]) => ranges.range("p", { ...AUTO, ...choice }, now, false)!;
    expect(of({ symmetric: true }, [-1, 3])).toEqual([-3, 3]);
    expect(of({ logarithmic: true }, [-1, 100])[0]).toBeCloseTo(1e-4, 12);
    expect(of({ logarithmic: true }, [5, 100])).toEqual([5, 100]);
    for (const choice of [{}, { symmetric: true }, { logarithmic: true }]) {
      for (const now of [[0, 0], [7, 7], [-7, -7]] as [number, number][]) {
        const [low, high] = of(choice, now);
        expect(low).toBeLessThan(high);
      }
    }
    expect(valueAt([1, 100], 0.5, true)).toBeCloseTo(10, 12);
    expect(valueAt([1, 3], 0.5, false)).toBe(2);
  });
});
