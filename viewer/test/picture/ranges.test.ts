import { describe, expect, it } from "vitest";
import { Ranges, onScale, whyNoEnds, withTyped } from "../../src/picture/ranges";
import type { Coloured, Range, RangeChoice } from "../../src/picture/ranges";

const AUTO: RangeChoice = { kind: "auto", low: 0, high: 0, symmetric: false, logarithmic: false };

/** One view that is seen. */
const one = (key: string, now: Range | null): Coloured[] => [{ view: "cut", key, now, isSeen: true }];

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
    // Another field has the colours now, and this one may have them again.
    ranges.keep(new Set(), new Set(["cut"]));
    expect(ranges.range(one("p", [0, 0.1]), choice, false)).toEqual([-2, 1]);
    ranges.keep(new Set(["p"]), new Set());
    expect(ranges.range(one("p", [0, 0.1]), choice, false)).toEqual([0, 0.1]);
  });

  it("knows all so far also where another range was wanted then", () => {
    const ranges = new Ranges();
    for (const choice of [AUTO, { ...AUTO, kind: "fixed", low: 0, high: 1 }] as RangeChoice[]) {
      ranges.range(one("p", choice.kind === "auto" ? [-3, 0] : [0, 8]), choice, false);
      ranges.keep(new Set(["p"]), new Set(["cut"]));
    }
    ranges.range(one("q", [90, 99]), AUTO, true);
    ranges.keep(new Set(["q"]), new Set(["cut"]));
    expect(ranges.range(one("p", [0, 0.1]), { ...AUTO, kind: "over time" }, false)).toEqual([-3, 8]);
    // An automatic range that was shown before is no measure for what is shown anew.
    expect(ranges.range(one("p", [0, 0.1]), AUTO, true)).toEqual([0, 0.1]);
  });

  it("counts over time what is hidden, and with the values that are there only what is seen", () => {
    const ranges = new Ranges();
    const views = (isSeen: boolean): Coloured[] => [{ view: "cut", key: "a", now: [0, 1], isSeen: true }, { view: "other", key: "b", now: [0, 9], isSeen }];
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

  it("is what was typed to the last bit, also where it is logarithmic, and need not lie about 0", () => {
    const of = (choice: Partial<RangeChoice>): Range => new Ranges().range(one("p", [0, 1]), { ...AUTO, kind: "fixed", ...choice }, false)!;
    expect(of({ low: 1e-12, high: 5, logarithmic: true })).toEqual([1e-12, 5]);
    expect(of({ low: -1, high: 5, logarithmic: true })[0]).toBeCloseTo(5e-6, 12);
    expect(of(withTyped({ ...AUTO, symmetric: true }, [-1, 3]))).toEqual([-1, 3]);
    expect(withTyped({ ...AUTO, logarithmic: true }, [1, 3])).toEqual({ kind: "fixed", low: 1, high: 3, symmetric: false, logarithmic: true });
    const above = "a logarithmic range holds only numbers above 0", more = "must be more than the lowest value";
    expect([whyNoEnds([-1, 5], false), whyNoEnds([-1, 5], true), whyNoEnds([-2, -1], true), whyNoEnds([0, 5], true), whyNoEnds([3, 3], true), whyNoEnds([1, 2], true)])
      .toEqual([["", ""], [above, ""], [above, above], [above, ""], ["", more], ["", ""]]);
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
    expect(onScale([1, 100], 0.5, true)).toBeCloseTo(10, 12);
    expect(onScale([1, 3], 0.5, false)).toBe(2);
  });
});
