import { describe, expect, it } from "vitest";
import { Pipelines } from "../../src/connection/pipelines";
import type { ClientMessage, Json, TopologyFrame } from "../../src/connection/protocol";
import { worstOf } from "../../src/picture/worst";
import { QUALITY, WORST, atOffset, extent, lineOf, offsetOf, planeOf, readPipelines, withLine, withPlane, withQuality, worstCells } from "../../src/store/pipelines";
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

  it("adds the quality of cells where a view selects, and where it takes all", () => {
    expect(withQuality(cut).stages[1]).toEqual({ select: { fields: ["p", QUALITY] } });
    expect(withQuality(withQuality(cut))).toEqual(withQuality(cut));
    const all: Pipeline = { name: "all", stages: [{ gradient: { field: "p" } }, { surface: {} }, { stream: {} }] };
    expect(withQuality(all).stages).toEqual([{ gradient: { field: "p" } }, { surface: {} }, { quality: {} }, { stream: {} }]);
    expect(worstCells({ min: 0.2, mean: 0.7 })).toMatchObject({ name: WORST, stages: [{ threshold: { field: QUALITY, max: 0.215 } }, {}, {}] });
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
    expect(worstOf(topology, frame([0.25, 0.25, 0.125]))).toEqual([{ quality: 0.125, centroid: [2, 2, 4 / 3] }, { quality: 0.25, centroid: [0.5, 0.5, 0.5] }]);
    expect(worstOf(topology, { ...frame([]), fields: [] })).toEqual([]);
  });
});
