import { describe, expect, it } from "vitest";
import type { DataFrame, TopologyFrame } from "../../src/connection/protocol";
import { probeNear, readProbe, weights } from "../../src/picture/probe";

const topology: TopologyFrame = {
  kind: "topology", view: "v", topology: "1", points: 4, triangles: Uint32Array.from([0, 1, 2, 1, 3, 2]), triangleFeatures: Uint32Array.from([4, 5]), lines: new Uint32Array(0),
};
const frame: DataFrame = {
  kind: "data", view: "v", topology: "1", cycle: 7, time: 0.7, points: Float32Array.from([0, 0, 0, 2, 0, 0, 0, 2, 0, 2, 2, 0]),
  fields: [
    { name: "x", association: "vertex", components: 1, values: Float64Array.from([0, 2, 0, 2]) },
    { name: "v", association: "vertex", components: 3, values: Float64Array.from([3, 4, 0, 3, 4, 0, 3, 4, 0, 3, 4, 0]) },
    { name: "q", association: "element", components: 1, values: Float64Array.from([0.25, NaN]) },
  ],
};
const read = (field: string | null, triangle = 0, component = -1) => readProbe({ view: "v", topology: "1", triangle, weights: [0.25, 0.25, 0.5] }, topology, frame, { field, component });

describe("a probe", () => {
  it("reads linear fields exactly, vectors by magnitude or component, cells as they are", () => {
    expect(read("x")).toEqual({ point: [0.5, 1, 0], feature: 4, field: "x", component: -1, value: 0.5, cycle: 7, time: 0.7 });
    expect(read("v")?.value).toBeCloseTo(5, 6);
    expect(read("v", 0, 1)?.value).toBeCloseTo(4, 6);
    expect(read("q")?.value).toBe(0.25);
  });
  it("says where there is nothing to read", () => {
    expect(read("q", 1)).toMatchObject({ value: null, feature: 5 });
    expect(read("missing")).toMatchObject({ value: null, field: null });
    expect(read("x", 2)).toBeNull();
    expect(readProbe({ view: "v", topology: "2", triangle: 0, weights: [1, 0, 0] }, topology, frame, { field: "x", component: -1 })).toBeNull();
  });
  it("is found in other triangles at the one that is nearest, where that is near", () => {
    const other = { ...topology, topology: "2", triangles: Uint32Array.from([1, 3, 2, 0, 1, 2]) };
    const found = probeNear("v", [0.5, 0.5, 0.1], other, frame.points)!;
    expect(found).toMatchObject({ view: "v", topology: "2", triangle: 1 });
    expect(readProbe(found, other, frame, { field: "x", component: -1 })).toMatchObject({ point: [0.5, 0.5, 0], value: 0.5 });
    const beside = probeNear("v", [-1, 1, 0], other, frame.points)!;
    expect(readProbe(beside, other, frame, { field: "x", component: -1 })!.point).toEqual([0, 1, 0]);
    expect(probeNear("v", [0.5, 0.5, 3], other, frame.points)).toBeNull();
    expect(probeNear("v", [0, 0, 0], { ...other, triangles: new Uint32Array(0) }, frame.points)).toBeNull();
  });
  it("weighs corners so that they give the point back", () => {
    const corners: [[number, number, number], [number, number, number], [number, number, number]] = [[1, 0, 2], [3, 1, 0], [0, 5, 1]];
    const at = [0.2, 0.5, 0.3];
    const point = [0, 1, 2].map((k) => corners.reduce((sum, corner, i) => sum + at[i]! * corner[k]!, 0)) as [number, number, number];
    weights(point, corners).forEach((weight, i) => expect(weight).toBeCloseTo(at[i]!, 12));
    expect(weights([0, 0, 0], [[1, 1, 1], [1, 1, 1], [1, 1, 1]])).toEqual([1, 0, 0]);
  });
});
