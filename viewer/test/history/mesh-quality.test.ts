import { describe, expect, it } from "vitest";
import type { Json } from "../../src/connection/protocol";
import { MESH, SMALLEST, takeQuality } from "../../src/history/mesh-quality";
import { History, TIMES, firstChoice, seriesKey } from "../../src/history/series";
import { STATUS } from "../page";

const key = seriesKey(MESH, SMALLEST);
const status = (cycle: number, min?: number) => ({ ...STATUS, cycle, time: cycle / 10, ...(min === undefined ? {} : { quality: { min, mean: 0.8, inverted: 0 } }) });

describe("the quality of the mesh", () => {
  it("is in the history from the start, though no monitor measures it, and thins out like all that is", () => {
    const history = new History();
    expect([takeQuality(history, [], status(1)), takeQuality(history, [{ pipeline: "flow", name: "pressure.l2" }], status(2, 0.25))]).toEqual([false, true]);
    expect(history.table([key])).toEqual({ cycles: [2], times: [0.2], columns: [[0.25]] });
    expect(firstChoice(history.series)).toEqual([key]);
    for (let cycle = 3; cycle < 3 * TIMES; cycle++) takeQuality(history, [], status(cycle, 0.5));
    expect(history.table([key]).cycles.length).toBeLessThanOrEqual(TIMES);
    expect(history.at(key, 2)).toBe(0.25);
  });

  it("is left to the monitor that measures it", () => {
    const history = new History();
    for (const name of ["quality.min", "after.quality.min"]) expect(takeQuality(history, [{ pipeline: "health", name }], status(1, 0.25)), name).toBe(false);
    expect(history.series).toEqual([]);
    // The monitor has come while the run went on.
    takeQuality(history, [], status(1, 0.25));
    history.add("health", 2, 0.2, { "quality.min": 0.3 });
    expect(firstChoice(history.series)).toEqual([seriesKey("health", "quality.min")]);
  });

  it("is not left to a monitor of a part of the mesh", () => {
    const monitors = [{ pipeline: "warm", name: "quality.min" }];
    const stages: Json[] = [{ threshold: { field: "heat", above: 1 } }, { quality: {} }];
    const takes = (name: string, of: Json[]): boolean => takeQuality(new History(), monitors, status(1, 0.25), [{ name, stages: of }]);
    expect(takes("warm", stages)).toBe(true);
    // What comes behind it changes nothing, nor what another pipeline takes out.
    expect([takes("warm", stages.toReversed()), takes("other", stages)]).toEqual([false, false]);
    // Beside such a one there is one of the whole.
    const both = [...monitors, { pipeline: "health", name: "quality.min" }];
    expect(takeQuality(new History(), both, status(1, 0.25), [{ name: "warm", stages }, { name: "health", stages: [{ quality: {} }] }])).toBe(false);
  });

  it("takes no place from monitors that nobody knows by name", () => {
    const history = new History();
    takeQuality(history, [], status(1, 0.25));
    history.add("heat", 1, 0.1, { warmth: 1, cold: 2, other: 3 });
    expect(firstChoice(history.series)).toEqual([key, seriesKey("heat", "warmth"), seriesKey("heat", "cold")]);
  });
});
