import { describe, expect, it } from "vitest";
import { Pipelines } from "../../src/connection/pipelines";
import type { ClientMessage, Json, TopologyFrame } from "../../src/connection/protocol";
import { worstOf } from "../../src/picture/worst";
import { QUALITY, WORST, atOffset, countCells, countedIn, extent, leadingPlane, lineOf, offsetOf, planeOf, planesOf, poorRange, readPipelines, whyNotMoved, withLine, withPlane, withQuality, worstCells, worstUpTo } from "../../src/store/pipelines";
import type { Pipeline } from "../../src/store/pipelines";

const cut: Pipeline = { name: "cut", every: { steps: 5 }, stages: [{ slice: { origin: [1, 2, 3], normal: [0, 2, 0] } }, { select: { fields: ["p"] } }, { stream: {} }] };

describe("changes of pipelines", () => {
  it("reads pipelines and passes rubbish over", () => {
    expect(readPipelines([cut, 5, null, { name: 3, stages: [] }, { name: "a" }] as Json)).toEqual([cut]);
    expect(readPipelines({ a: 1 })).toEqual([]);
  });

  it("moves a slice along its normal, and keeps all else", () => {
    const plane = planeOf(cut)!;
    expect(offsetOf(plane)).toBe(2);
    const moved = withPlane(cut, atOffset(plane, 5));
    expect(moved).toEqual({ ...cut, stages: [{ slice: { origin: [1, 5, 3], normal: [0, 2, 0] } }, ...cut.stages.slice(1)] });
    expect(offsetOf(planeOf(moved)!)).toBe(5);
    expect(planeOf({ name: "s", stages: [{ slice: { sphere: { center: [0, 0, 0], radius: 1 } } }, { surface: {} }, "pause"] })).toBeNull();
    expect(extent([[0, -1, 0], [1, 3, 2]], [0, -2, 0])).toEqual([-3, 1]);
  });

  it("moves parallel planes together, also those whose normal is another length or turned, and stacks them along another direction", () => {
    const planes = [{ origin: [1, 2, 3], normal: [0, 2, 0] }, { origin: [0, 4, 0], normal: [0, -1, 0] }, { origin: [5, 1, 5], normal: [0, 1, 0] }];
    const several: Pipeline = { name: "cuts", stages: [{ slice: { planes } }, { stream: {} }] };
    const first = leadingPlane(several)!;
    expect(first).toEqual(planes[0]);
    const moved = withPlane(several, atOffset(first, 2.5));
    expect(moved.stages[1]).toEqual({ stream: {} });
    expect(planesOf(moved)).toEqual([{ origin: [1, 2.5, 3], normal: [0, 2, 0] }, { origin: [0, 4.5, 0], normal: [0, -1, 0] }, { origin: [5, 1.5, 5], normal: [0, 1, 0] }]);
    expect(planesOf(withPlane(several, { origin: [7, 8, 9], normal: [1, 0, 0] }))).toEqual([7, 9, 6].map((x) => ({ origin: [x, 8, 9], normal: [1, 0, 0] })));
    expect(whyNotMoved(several)).toBe("");
  });

  it("tells why a slice cannot be moved along a direction", () => {
    const by = (slice: Json): string => whyNotMoved({ name: "s", stages: [{ slice }, { stream: {} }] });
    expect(by({ planes: [{ origin: [0, 0, 0], normal: [0, 0, 1] }, { origin: [0, 0, 0], normal: [0, 1, 0] }] })).toBe("The planes of this slice have several directions.");
    expect(by({ sphere: { center: [0, 0, 0], radius: 1 } })).toBe("This slice is cut by a sphere, not by a plane.");
    expect(by({ cylinder: { origin: [0, 0, 0], axis: [0, 0, 1], radius: 1 } })).toBe("This slice is cut by a cylinder, not by a plane.");
    expect([whyNotMoved(cut), whyNotMoved({ name: "s", stages: [{ surface: {} }] }), whyNotMoved(undefined)]).toEqual(["", "", ""]);
  });

  it("adds the quality of cells where a view selects, and where it takes all", () => {
    expect(withQuality(cut).stages[1]).toEqual({ select: { fields: ["p", QUALITY] } });
    expect(withQuality(withQuality(cut))).toEqual(withQuality(cut));
    const all: Pipeline = { name: "all", stages: [{ gradient: { field: "p" } }, { surface: {} }, { stream: {} }] };
    expect(withQuality(all).stages).toEqual([{ gradient: { field: "p" } }, { surface: {} }, { quality: {} }, { stream: {} }]);
    expect(worstCells(0.215)).toMatchObject({ name: WORST, stages: [{ threshold: { field: QUALITY, max: 0.215 } }, {}, { stream: { error: "lossless" } }] });
  });

  it("has one change on its way at a time, and then the newest wish", async () => {
    const sent: ClientMessage[] = [];
    const pipelines = new Pipelines(() => Promise.resolve([cut]), (message) => `m${sent.push(message)}`, () => undefined);
    await pipelines.told(0);
    for (const offset of [1, 2, 3]) pipelines.set(withPlane(cut, atOffset(planeOf(cut)!, offset)));
    expect(sent.length).toBe(1);
    expect(offsetOf(planeOf(pipelines.get("cut"))!)).toBe(3);
    expect([pipelines.answered("other"), pipelines.answered("m1"), sent.length]).toEqual([false, true, 2]);
    expect(offsetOf(planeOf((sent[1] as { pipelines: { set: Pipeline[] } }).pipelines.set[0])!)).toBe(3);
    pipelines.answered("m2");
    pipelines.remove("cut");
    expect(sent[2]).toEqual({ pipelines: { remove: ["cut"] } });
  });

  it("moves a line, and keeps what somebody has written around it", () => {
    const own: Pipeline = { name: "line", every: { steps: 50 }, stages: [{ select: { fields: ["p"] } }, { probe: { line: { from: [0, 0, 0], to: [1, 0, 0], count: 1001 } } }, { csv: { file: "line.csv" } }] };
    const moved = withLine(own, [0, 1, 0], [2, 0, 0]);
    expect(moved).toEqual({ ...own, stages: [own.stages[0], { probe: { line: { from: [0, 1, 0], to: [2, 0, 0], count: 1001 } } }, own.stages[2]] });
    expect(lineOf(moved)).toEqual({ from: [0, 1, 0], to: [2, 0, 0] });
    expect([lineOf(cut), withLine(cut, [0, 0, 0], [1, 1, 1])]).toEqual([null, cut]);
  });

  it("finds the worst cells of a view", () => {
    const topology: TopologyFrame = { kind: "topology", view: WORST, topology: "1", points: 5, triangles: Uint32Array.from([0, 1, 2, 0, 1, 3, 1, 2, 4]), triangleFeatures: null, lines: new Uint32Array(0) };
    const frame = (values: number[]) => ({
      kind: "data" as const, view: WORST, topology: "1", cycle: 1, time: 1, points: Float32Array.from([0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 2, 4, 4, 4]),
      fields: [{ name: QUALITY, association: "element" as const, components: 1, values: Float64Array.from(values) }],
    });
    expect(worstOf(topology, frame([0.25, 0.25, 0.125])).map(({ quality, centroid }) => ({ quality, centroid }))).toEqual([{ quality: 0.125, centroid: [2, 2, 4 / 3] }, { quality: 0.25, centroid: [0.5, 0.5, 0.5] }]);
    expect(worstOf(topology, { ...frame([]), fields: [] })).toEqual([]);
  });

  it("tells cells apart that are alike: by where they meet, and by how many corners a cell has", () => {
    const view = (triangles: number[], points: number[]) => worstOf(
      { kind: "topology", view: WORST, topology: "1", points: points.length / 3, triangles: Uint32Array.from(triangles), triangleFeatures: null, lines: new Uint32Array(0) },
      { kind: "data", view: WORST, topology: "1", cycle: 1, time: 1, points: Float32Array.from(points),
        fields: [{ name: QUALITY, association: "element", components: 1, values: new Float64Array(triangles.length / 3).fill(0.5) }] },
    ).map(({ centroid }) => centroid);
    // The faces of two tetrahedra that share one corner.
    const faces = (a: number, b: number, c: number, d: number): number[] => [a, b, c, a, b, d, b, c, d, c, a, d];
    expect(view([...faces(0, 1, 2, 3), ...faces(0, 4, 5, 6)], [0, 0, 0, 4, 0, 0, 0, 4, 0, 0, 0, 4, -4, 0, 0, 0, -4, 0, 0, 0, -4])).toEqual([[1, 1, 1], [-1, -1, -1]]);
    // Twenty hexahedra in a row, without the faces between them: rings along it, not one in its middle.
    const row = Array.from({ length: 21 }, (_, i) => [i, 0, 0, i, 1, 0, i, 1, 1, i, 0, 1]).flat();
    const sides = Array.from({ length: 20 }, (_, i) => [0, 1, 2, 3].flatMap((k) => {
      const [a, b] = [4 * i + k, 4 * i + (k + 1) % 4];
      return [a, b, b + 4, a, b + 4, a + 4];
    })).flat();
    const middles = view(sides, row);
    expect(middles.length).toBe(10);
    expect(new Set(middles.map(String)).size).toBe(10);
  });

  describe("finds up to which quality the ten worst cells are", () => {
    /** What the run measures of a pipeline that counts. */
    const count = (pipeline: Pipeline, cells: readonly number[]) => {
      const [threshold, histogram] = pipeline.stages.map((stage) => Object.values(stage as Record<string, Json>)[0]) as [{ max: number }, { name: string; bins: number; range: [number, number] }];
      const { name, bins, range: [low, high] } = histogram;
      const taken = cells.filter((cell) => cell <= threshold.max);
      const values: Record<string, number> = { [`${name}.lower`]: low, [`${name}.upper`]: high, [`${name}.below`]: taken.filter((cell) => cell < low).length, [`${name}.above`]: 0 };
      for (let i = 0; i < bins; i++) values[`${name}.bins.${i}`] = 0;
      for (const cell of taken) if (cell >= low) values[`${name}.bins.${Math.min(bins - 1, Math.floor(((cell - low) / (high - low)) * bins))}`]! += 1;
      return values;
    };
    const search = (cells: readonly number[]): { shown: number | null; counts: number } => {
      let range = poorRange({ min: Math.min(...cells), mean: cells.reduce((sum, cell) => sum + cell, 0) / cells.length });
      for (let counts = 1; counts < 20; counts++) {
        const found = worstUpTo(countedIn(count(countCells(range), cells))!);
        if (!found) return { shown: null, counts };
        if ("max" in found) return { shown: cells.filter((cell) => cell <= found.max).length, counts };
        range = found.range;
      }
      throw new Error("it has no end");
    };
    const spread = (count: number, low: number, high: number): number[] => Array.from({ length: count }, (_, i) => low + ((high - low) * i) / (count - 1));
    const cases: [string, number[], number][] = [
      ["one far worse than all others", [0.05, ...spread(100_000, 0.6, 0.9)], 2],
      ["an even mesh", spread(100_000, 0.2, 0.9), 2],
      ["a crowd beside the worst", [0.2, ...spread(50_000, 0.2001, 0.21), ...spread(50_000, 0.8, 0.9)], 2],
      ["a crowd that is nearly alike", [...spread(50_000, 0.2, 0.2 + 1e-7), ...spread(50_000, 0.8, 0.9)], 5],
      ["a small mesh", spread(8, 0.2, 0.9), 1],
      ["inverted cells", spread(10_000, -0.5, 0.9), 1],
    ];
    it.each(cases)("of %s", (_, cells, most) => {
      const { shown, counts } = search(cells);
      expect(shown).toBeGreaterThanOrEqual(Math.min(10, cells.length / 2));
      expect(shown).toBeLessThanOrEqual(1000);
      expect(counts).toBeLessThanOrEqual(most);
    });

    it("of cells that are all alike there are none", () => {
      expect(search(new Array<number>(5000).fill(1)).shown).toBeNull();
    });

    it("and takes nothing else for a count", () => {
      expect(countedIn({ "quality.min": 0.2 })).toBeNull();
      expect(countedIn({ ...count(countCells([0, 1]), [0.5]), "cells.bins.3": null })).toBeNull();
    });
  });
});
