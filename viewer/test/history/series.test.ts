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

  it("is there again after a reload, with its gaps and units", () => {
    const history = new History();
    for (const [cycle, p] of [[1, 0.1], [2, null], [4, 3]] as const) history.add("a", cycle, cycle / 3, { p });
    history.add("a", 5, 5 / 3, { q: 1e-300 });
    history.add("b", 3, 1, { r: 7 });
    history.setUnit("a", "p", "Pa");
    const again = new History();
    again.restore(history.kept(1000)!);
    expect(again.series).toEqual(history.series);
    expect(again.csv()).toBe(history.csv());
    const keys = history.series.map(({ key }) => key);
    expect(again.table(keys)).toEqual(history.table(keys));
    again.add("a", 6, 2, { p: 8 });
    expect(again.table(keys).cycles).toEqual([1, 2, 3, 4, 5, 6]);
    for (const rubbish of ["", "null", "[1]", '[["a",[1],[1,2],[]]]', '[["a",[1],[1],[["p",null,true,["x"]]]]]', '[["a",[1],[1],[["p",5,true,[1]]]]]', '[["a",[1],[1],[["p",null,1,[1]]]]]']) {
      const empty = new History();
      empty.restore(rubbish);
      expect(empty.series, rubbish).toEqual([]);
    }
  });

  it("is kept over a reload within its bounds: of the old values fewer", () => {
    const history = new History();
    const names = Array.from({ length: 40 }, (_, i) => `monitor ${i}`);
    for (let cycle = 0; cycle < TIMES; cycle++) history.add("a", cycle, cycle, Object.fromEntries(names.map((name, i) => [name, Math.sin(cycle * i)])));
    for (let cycle = 0; cycle < 10; cycle++) history.add("b", cycle, cycle, { p: cycle });
    expect(history.kept(10_000_000)!.length).toBeGreaterThan(1_000_000);
    const text = history.kept(300_000)!;
    expect(text.length).toBeLessThanOrEqual(300_000);
    const again = new History();
    again.restore(text);
    const { cycles } = again.table([seriesKey("a", names[3]!)]);
    expect([cycles[0], cycles.at(-1), cycles.length > 200, again.series.length]).toEqual([0, TIMES - 1, true, 41]);
    expect(again.at(seriesKey("a", names[3]!), TIMES - 1)).toBe(Math.sin(3 * (TIMES - 1)));
    expect(again.table([seriesKey("b", "p")]).cycles.length).toBe(10);
    // What is shown goes on with all that it had.
    expect(history.table([seriesKey("a", names[3]!)]).cycles.length).toBe(TIMES);
    expect(history.kept(100)).toBeNull();
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

  it("makes room for new monitors after a reload too, at no pinned place's cost", () => {
    const history = new History();
    history.add("probe 1, p", 0, 0, { p: 1 });
    const keys = Array.from({ length: SERIES - 1 }, (_, i) => seriesKey(`s${i}`, "p"));
    history.keep(keys);
    for (let i = 0; i < SERIES - 1; i++) history.add(`s${i}`, 0, 0, { p: 1 });
    // The first is of a monitor that is no more by then.
    history.keep(keys.slice(1));
    const again = new History();
    again.restore(history.kept(100_000)!);
    again.keep(keys.slice(2));
    again.add("new", 1, 1, { p: 2, q: 3, r: 4 });
    expect(again.series.slice(-2).map(({ key }) => key)).toEqual([seriesKey("new", "p"), seriesKey("new", "q")]);
    expect([again.series.length, again.series[0]!.source]).toEqual([SERIES, "probe 1, p"]);
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
