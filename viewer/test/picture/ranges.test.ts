import { describe, expect, it } from "vitest";
import { Ranges, valueAt } from "../../src/picture/ranges";
import type { Coloured, Range, RangeChoice } from "../../src/picture/ranges";

const AUTO: RangeChoice = { kind: "auto", low: 0, high: 0, symmetric: false, logarithmic: false };

/** One view that is seen. */
const one = (key: string, now: Range | null): Coloured[] => [{ key, now, isSeen: true }];

describe("the range of a colour map", () => {
  it("follows the values, and stays while an order is under way", () => {
    const ranges = new Ranges();
    expect(ranges.range(one("p", [0, 1]), AUTO, false)).toEqual([0, 1]);
    expect(ranges.range(one("p", [0, 9]), AUTO, true)).toEqual([0, 1]);
    expect(ranges.range(one("q", [0, 9]), AUTO, true)).toEqual([0, 9]);
    expect(ranges.range(one("p", [0, 9]), AUTO, false)).toEqual([0, 9]);
    expect(ranges.range(one("none", null), AUTO, false)).toBeNull();
  });

  it("holds all that was over time", () => {
    const ranges = new Ranges();
    const choice: RangeChoice = { ...AUTO, kind: "over time" };
    for (const now of [[0, 1], [-2, 0.5]] as const) ranges.range(one("p", [...now]), choice, false);
    expect(ranges.range(one("p", [0, 0.1]), choice, false)).toEqual([-2, 1]);
    expect(ranges.range(one("p", [0, 0.1]), { ...choice, symmetric: true }, false)).toEqual([-2, 2]);
    ranges.keep(new Set(["p"]));
    expect(ranges.range(one("p", [0, 0.1]), choice, false)).toEqual([-2, 1]);
    ranges.keep(new Set());
    expect(ranges.range(one("p", [0, 0.1]), choice, false)).toEqual([0, 0.1]);
  });

  it("counts over time what is hidden, and with the values that are there only what is seen", () => {
    const ranges = new Ranges();
    const views = (isSeen: boolean): Coloured[] => [{ key: "a", now: [0, 1], isSeen: true }, { key: "b", now: [0, 9], isSeen }];
    expect(ranges.range(views(false), { ...AUTO, kind: "over time" }, false)).toEqual([0, 9]);
    expect(ranges.range(views(false), AUTO, false)).toEqual([0, 1]);
    expect(ranges.range(views(true), AUTO, false)).toEqual([0, 9]);
    // Hidden while a shape is under way: the colours of the other stay.
    expect(ranges.range(views(false), AUTO, true)).toEqual([0, 9]);
    ranges.clear();
    expect(ranges.range(views(false), AUTO, true)).toEqual([0, 1]);
  });

  it("is what was typed, where that is a range", () => {
    const ranges = new Ranges();
    expect(ranges.range(one("p", [0, 1]), { ...AUTO, kind: "fixed", low: 2, high: 3 }, false)).toEqual([2, 3]);
    expect(ranges.range(one("p", [0, 1]), { ...AUTO, kind: "fixed", low: 3, high: 2 }, false)).toEqual([0, 1]);
  });

  it("lies about 0, or holds positive values only, and is never empty", () => {
    const ranges = new Ranges();
    const of = (choice: Partial<RangeChoice>, now: [number, number]) => ranges.range(one("p", now), { ...AUTO, ...choice }, false)!;
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
