import { describe, expect, it } from "vitest";
import { History, SERIES, TIMES, compare, firstChoice, seriesKey } from "../../src/history/series";

describe("the history", () => {
  it("puts sources of different cadence side by side", () => {
    const history = new History();
    for (const cycle of [2, 4, 6]) history.add("a", cycle, cycle / 10, { p: cycle });
    for (const cycle of [3, 6]) history.add("b", cycle, cycle / 10, { q: -cycle, r: null });
    const keys = [seriesKey("a", "p"), seriesKey("b", "q"), seriesKey("b", "r")];
    expect(history.table(keys)).toEqual({
      cycles: [2, 3, 4, 6], times: [0.2, 0.3, 0.4, 0.6], columns: [[2, undefined, 4, 6], [undefined, -3, undefined, -6], [undefined, null, undefined, null]],
    });
    expect([history.at(keys[0]!, 5), history.at(keys[1]!, 5), history.at(keys[1]!, 2), history.at("none", 5)]).toEqual([4, -3, null, null]);
  });

  it("has no value where a monitor says that it is no number, however good the last one was", () => {
    const history = new History();
    const key = seriesKey("a", "p");
    history.add("a", 1, 1, { p: 1 });
    for (const [cycle, p] of [[2, null], [3, NaN]] as const) history.add("a", cycle, cycle, { p });
    history.add("a", 4, 4, { q: 5 });
    expect([1, 2, 3, 4].map((cycle) => history.at(key, cycle))).toEqual([1, null, null, null]);
    expect(history.table([key]).columns).toEqual([[1, null, null, undefined]]);
    expect(history.at(seriesKey("a", "q"), 3)).toBeNull();
    expect(compare(history, key, 3, [{ cycle: 1, label: "pinch" }])).toMatchObject({ value: null, before: 1, difference: null });
  });

  it("takes a cycle once, and begins anew where a run goes back", () => {
    const history = new History();
    for (const cycle of [1, 2, 2, 3]) history.add("a", cycle, cycle, { p: cycle });
    expect(history.table([seriesKey("a", "p")]).cycles).toEqual([1, 2, 3]);
    history.add("a", 1, 1, { p: 9 });
    expect(history.table([seriesKey("a", "p")])).toEqual({ cycles: [1], times: [1], columns: [[9]] });
  });

  it("stays within its bounds, and keeps the newest and the oldest", () => {
    const history = new History();
    for (let cycle = 0; cycle < 20 * TIMES; cycle++) history.add("a", cycle, cycle, { p: cycle });
    const { cycles, columns } = history.table([seriesKey("a", "p")]);
    expect(cycles.length).toBeLessThanOrEqual(TIMES);
    expect(cycles.length).toBeGreaterThan(TIMES / 2);
    expect([cycles[0], cycles.at(-1)]).toEqual([0, 20 * TIMES - 1]);
    expect(columns[0]).toEqual(cycles);
    for (let i = 0; i < 2 * SERIES; i++) history.add(`s${i}`, 0, 0, { p: 1 });
    expect(history.series.length).toBe(SERIES);
  });

  it("has room for new monitors where others are no more", () => {
    const history = new History();
    const keys = Array.from({ length: SERIES }, (_, i) => seriesKey(`s${i}`, "p"));
    history.keep(keys);
    for (let i = 0; i < SERIES; i++) history.add(`s${i}`, 0, 0, { p: 1 });
    history.add("new", 1, 1, { p: 2, q: 3 });
    expect(history.series.some(({ source }) => source === "new")).toBe(false);
    history.keep(keys.slice(2));
    expect(history.series.length).toBe(SERIES);
    history.add("new", 2, 2, { p: 2, q: 3, r: 4 });
    expect(history.series.length).toBe(SERIES);
    expect(history.series.slice(-2).map(({ key }) => key)).toEqual([seriesKey("new", "p"), seriesKey("new", "q")]);
    expect(history.series.some(({ source }) => source === "s0" || source === "s1")).toBe(false);
    expect(history.at(seriesKey("new", "q"), 2)).toBe(3);
    // One that has come back has its place again.
    history.keep(keys.slice(3));
    history.keep(keys.slice(2));
    history.add("new", 3, 3, { p: 2, q: 3, r: 4 });
    expect(history.series.some(({ source }) => source === "s2")).toBe(true);
  });

  it("is written as a table, with what has commas quoted", () => {
    const history = new History();
    history.add('a,"b"', 1, 0.5, { p: 2, q: NaN });
    history.setUnit('a,"b"', "p", "Pa");
    expect(history.csv()).toBe('cycle,time,"a,""b"": p [Pa]","a,""b"": q"\n1,0.5,2,\n');
  });

  it("compares with what was before the last order", () => {
    const history = new History();
    for (const [cycle, p] of [[10, 5], [20, 5], [30, 8], [40, 7]] as const) history.add("a", cycle, cycle, { p });
    const marks = [{ cycle: 25, label: "pinch" }, { cycle: 5, label: "first" }];
    const key = seriesKey("a", "p");
    expect(compare(history, key, 40, marks)).toEqual({ value: 7, order: marks[0], before: 5, difference: 2 });
    expect(compare(history, key, 20, marks)).toEqual({ value: 5, order: marks[1], before: null, difference: null });
    expect(compare(history, key, 3, marks)).toEqual({ value: null, order: null, before: null, difference: null });
  });

  it("shows pressure, flow and quality at first", () => {
    const make = (source: string, name: string) => ({ key: seriesKey(source, name), source, name, unit: null });
    const all = [make("health", "quality.max"), make("health", "quality.min"), make("health", "velocity.max"), make("duct", "pressure.mean"), make("duct", "mass.net")];
    expect(firstChoice(all)).toEqual([all[1]!.key, all[3]!.key, all[4]!.key]);
    expect(firstChoice([all[2]!])).toEqual([all[2]!.key]);
    expect(firstChoice([])).toEqual([]);
  });
});
