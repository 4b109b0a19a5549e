import { describe, expect, it } from "vitest";
import { placeNames, shortened } from "../../src/history/mark-names";
import type { MarkName, NamePlace } from "../../src/history/mark-names";

const place = (marks: MarkName[], to = 400): (NamePlace | null)[] => placeNames(marks, [0, to], 3, 4);

describe("the names of orders in a plot", () => {
  it("stand beside their lines, in rows where they would meet", () => {
    expect(place([{ x: 10, width: 100 }])).toEqual([{ left: 14, row: 0, width: 100 }]);
    expect(place([{ x: 10, width: 100 }, { x: 200, width: 100 }])).toMatchObject([{ left: 14, row: 0 }, { left: 204, row: 0 }]);
    expect(place([{ x: 10, width: 100 }, { x: 20, width: 100 }])).toMatchObject([{ left: 14, row: 1 }, { left: 24, row: 0 }]);
  });

  it("do not reach beyond the edge, nor across another line where there is another place", () => {
    expect(place([{ x: 350, width: 100 }])).toMatchObject([{ left: 246, row: 0 }]);
    expect(place([{ x: 200, width: 100 }, { x: 240, width: 100 }])).toMatchObject([{ left: 96, row: 0 }, { left: 244, row: 0 }]);
  });

  it("are cut where neither side has room for all of one", () => {
    expect(place([{ x: 100, width: 150 }], 210)).toEqual([{ left: 104, row: 0, width: 106 }]);
    expect(place([{ x: 100, width: 190 }], 210)).toEqual([null]);
    const measure = (text: string): number => 10 * text.length;
    expect([shortened("Throat: height", 140, measure), shortened("Throat: height", 100, measure), shortened("Throat: height", 90, measure)]).toEqual(["Throat: height", "Throat: h…", "Throat:…"]);
  });

  it("are those of the newest where there is no room for all, and never lie on one another", () => {
    const places = place([10, 20, 30, 40, 50, 60, 70].map((x) => ({ x, width: 180 })), 340);
    expect(places.map((found) => found !== null)).toEqual([false, false, false, false, true, true, true]);
    expect(new Set(places.flatMap((found) => found?.row ?? [])).size).toBe(3);
    expect(place([{ x: -5, width: 10 }, { x: 500, width: 10 }])).toEqual([null, null]);
  });
});
