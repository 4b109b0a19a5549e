import { beforeEach, describe, expect, it, vi } from "vitest";
import vtkDataArray from "@kitware/vtk.js/Common/Core/DataArray";
import vtkMapper from "@kitware/vtk.js/Rendering/Core/Mapper";
import vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import type { DataFrame, TopologyFrame } from "../../src/connection/protocol";
import { mapped } from "../../src/picture/colour";
import { Layer } from "../../src/picture/layer";
import type { Piece } from "../../src/picture/layer";
import { Ranges } from "../../src/picture/ranges";
import { colour } from "../../src/picture/shared-colours";
import { insteadOf } from "../../src/picture/surface-node";
import { firstLook } from "../../src/store/looks";

const POINTS = [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0];
const topology: TopologyFrame = {
  kind: "topology", view: "cut", topology: "1", points: 4, triangles: Uint32Array.from([0, 1, 2, 0, 2, 3]), triangleFeatures: Uint32Array.from([0, 1]), lines: new Uint32Array(0),
};
const frame = (cycle: number, values: number[], points = POINTS): DataFrame => ({
  kind: "data", view: "cut", topology: "1", cycle, time: cycle, points: Float32Array.from(points),
  fields: [{ name: "p", association: values.length === 2 ? "element" : "vertex", components: 1, values: Float64Array.from(values) }],
});
const view = { name: "cut", kind: "slice" };

/** The parts of a layer, as vtk.js has them. */
interface Parts { surface: Piece; edges: Piece; points: { getMTime(): number } }
interface Mapping { mapScalars(data: unknown, alpha: number): void; getColorCoordinates(): { getData(): Float32Array; getMTime(): number } | null; getColorTextureMap(): unknown }
let layer: Layer, parts: Parts, mapping: Mapping;
beforeEach(() => {
  layer = new Layer("cut", "slice", firstLook(view, [view], [{ name: "p", association: "vertex", components: 1 }]), vtkRenderer.newInstance());
  parts = layer as unknown as Parts;
  mapping = parts.surface.mapper as unknown as Mapping;
  layer.setTopology(topology);
});
function show(next: DataFrame, range?: [number, number]): void {
  expect(layer.setData(next)).toBeNull();
  const found = layer.takeScalars();
  layer.paint(range ?? found!);
}
/** What vtk.js makes of the values when a picture is drawn. */
function drawn(): number[] {
  mapping.mapScalars(parts.surface.data, 1);
  return [...mapping.getColorCoordinates()!.getData()];
}

describe("a mesh that rests", () => {
  it("is not handed to the graphics card again", () => {
    show(frame(1, [0, 1, 2, 3]));
    const before = [parts.points.getMTime(), parts.edges.data.getMTime(), layer.coordinates, layer.bounds];
    const next = frame(2, [3, 1, 2, 3]);
    show(next);
    expect([parts.points.getMTime(), parts.edges.data.getMTime(), layer.coordinates, layer.bounds]).toEqual(before);
    expect(layer.coordinates).toBe(before[2]);
    expect(layer.bounds).toBe(before[3]);
    expect(next.points).toBe(layer.coordinates);
  });

  it("is when one point has moved", () => {
    show(frame(1, [0, 1, 2, 3]));
    const before = [parts.points.getMTime(), parts.edges.data.getMTime()] as const;
    show(frame(2, [0, 1, 2, 3], [...POINTS.slice(0, 11), 0.5]));
    expect(parts.points.getMTime()).toBeGreaterThan(before[0]);
    expect(parts.edges.data.getMTime()).toBeGreaterThan(before[1]);
    expect(layer.bounds).toEqual([[0, 0, 0], [1, 1, 0.5]]);
  });
});

describe("fewer triangles", () => {
  it("are drawn of a view that has clusters, with its edges, until it has another topology", () => {
    const asked: { answered: (clusters: unknown) => void; points: Float32Array; isGone: boolean }[] = [];
    layer = new Layer("cut", "slice", layer.look, vtkRenderer.newInstance(), { want: (_, points, answered) => {
      const wish = { answered: answered as (clusters: unknown) => void, points, isGone: false };
      asked.push(wish);
      return () => { wish.isGone = true; };
    } });
    parts = layer as unknown as Parts;
    layer.setTopology(topology);
    show(frame(1, [0, 1, 2, 3]));
    show(frame(2, [0, 1, 2, 4]));
    expect(asked.length).toBe(1);
    expect(asked[0]!.points).toBe(layer.coordinates);
    const drawn = (): unknown[] => [parts.surface, parts.edges].map(({ mapper }) => insteadOf(mapper));
    layer.show(true);
    expect(drawn()).toEqual([null, null]);
    const clusters = { representatives: Uint32Array.from([0, 0, 2, 3]), triangles: Uint32Array.from([0, 2, 3]) };
    const before = [parts.surface.data.getMTime(), parts.surface.mapper.getMTime()];
    asked[0]!.answered(clusters);
    layer.show(true);
    expect(drawn()[0]).toEqual({ triangles: clusters.triangles });
    // Side 0-1 is lost and 1-2 is the diagonal now; each is there once.
    const { lines } = drawn()[1] as { lines: Uint32Array };
    expect(Array.from({ length: lines.length / 2 }, (_, i) => [...lines.subarray(2 * i, 2 * i + 2)].sort((a, b) => a - b).join("-")).sort()).toEqual(["0-2", "0-3", "2-3"]);
    layer.show();
    expect(drawn()).toEqual([null, null]);
    // Nothing is made anew for it.
    expect([parts.surface.data.getMTime(), parts.surface.mapper.getMTime()]).toEqual(before);
    layer.setTopology({ ...topology, topology: "2" });
    expect(asked[0]!.isGone).toBe(true);
    layer.show(true);
    expect(drawn()).toEqual([null, null]);
  });
});

describe("colours", () => {
  it("of other values are those that vtk.js would make of them, in the array that is there", () => {
    show(frame(1, [0, 1, 2, 3]));
    drawn();
    const made = mapping.getColorCoordinates();
    for (const values of [[3, -1, 1e9, NaN], [0.1, 0.2, 0.3, -1e9]]) {
      const [data, time] = [parts.surface.data.getMTime(), made!.getMTime()];
      show(frame(2, values), [0.05, 2.5]);
      expect(mapping.getColorCoordinates()).toBe(made);
      expect(parts.surface.data.getMTime()).toBe(data);
      expect(made!.getMTime()).toBeGreaterThan(time);
      const other = vtkMapper.newInstance();
      other.setLookupTable(parts.surface.mapper.getLookupTable());
      other.setUseLookupTableScalarRange(true);
      other.setInterpolateScalarsBeforeMapping(true);
      const scalars = parts.surface.data.getPointData().getScalars();
      const fresh = other as unknown as Mapping;
      parts.surface.data.getPointData().setScalars(vtkDataArray.newInstance({ numberOfComponents: 1, values: Float64Array.from(scalars.getData()) }));
      fresh.mapScalars(parts.surface.data, 1);
      parts.surface.data.getPointData().setScalars(scalars);
      const expected = fresh.getColorCoordinates()!.getData();
      drawn().forEach((coordinate, i) => expect(coordinate).toBeCloseTo(expected[i]!, 6));
    }
  });

  it("are not made anew for a range, or where nothing has changed", () => {
    show(frame(1, [0, 1, 2, 3]));
    drawn();
    const table = parts.surface.mapper.getLookupTable();
    const texture = mapping.getColorTextureMap();
    const changed = vi.fn();
    table.onModified(changed);
    const values = frame(2, [0, 1, 5, 3]);
    show(values, [0, 5]);
    layer.paint([1, 4]);
    const before = mapping.getColorCoordinates()!.getMTime();
    layer.takeScalars();
    layer.paint([1, 4]);
    drawn();
    expect(mapping.getColorCoordinates()!.getMTime()).toBe(before);
    expect(mapping.getColorTextureMap()).toBe(texture);
    expect(changed).not.toHaveBeenCalled();
    layer.look = { ...layer.look, map: "plasma" };
    layer.paint([1, 4]);
    expect(changed).toHaveBeenCalled();
  });

  it("of a vector follow its values, for which no room is made anew", () => {
    const vector = (cycle: number, lengths: number[]): DataFrame => ({ ...frame(cycle, []), fields: [{ name: "p", association: "vertex", components: 2, values: Float64Array.from(lengths.flatMap((value) => [0.6 * value, -0.8 * value])) }] });
    layer.look = { ...layer.look, component: -1 };
    const { colouring } = layer as unknown as { colouring: { taken: { values: Float64Array } } };
    const told = (): number[] => [...parts.surface.data.getPointData().getScalars().getData()].map((value) => Number(value.toFixed(6)));
    show(vector(1, [0, 1, 2, 4]), [0, 4]);
    const { values } = colouring.taken;
    expect(told()).toEqual([0, 0.25, 0.5, 1]);
    show(vector(2, [4, 2, 1, 0]), [0, 4]);
    expect(told()).toEqual([1, 0.5, 0.25, 0]);
    expect(colouring.taken.values).toBe(values);
  });

  it("of elements follow their values, also between those of points", () => {
    show(frame(1, [0, 1, 2, 3]));
    drawn();
    show(frame(2, [0, 8]));
    expect([...parts.surface.data.getCellData().getScalars().getData()]).toEqual([0, 1]);
    expect(drawn().length).toBe(4);
    show(frame(3, [0, 1, 2, 4]));
    expect([...parts.surface.data.getPointData().getScalars().getData()]).toEqual([0, 0.25, 0.5, 1]);
    expect(drawn().length).toBe(8);
  });

  it("of no number are grey", () => {
    show(frame(1, [0, 1, 2, NaN]));
    expect((parts.surface.mapper.getLookupTable() as unknown as { getNanColor(): number[] }).getNanColor()).toEqual([0.5, 0.5, 0.5, 1]);
    const isGrey = (): boolean[] => [...parts.surface.data.getPointData().getScalars().getData()].map(Number.isNaN);
    expect(isGrey()).toEqual([false, false, false, true]);
    // The bar says so, as long as there are such values.
    expect(colour([layer], new Ranges(), false).map(({ hasGaps }) => hasGaps)).toEqual([true]);
    show(frame(2, [0, 1, 2, 3]));
    expect(colour([layer], new Ranges(), false).map(({ hasGaps }) => hasGaps)).toEqual([false]);
    // Where there is none at all, nothing of the frame before is left.
    expect(layer.setData(frame(3, [NaN, NaN, NaN, NaN]))).toBeNull();
    colour([layer], new Ranges(), false);
    expect(isGrey()).toEqual([true, true, true, true]);
  });

  it("show no number as such with logarithms, and what is too small as the smallest", () => {
    expect([...mapped(Float64Array.from([NaN, 0, -3, 1, 10]), [1e-6, 1], true)].map((part) => Math.round(1e4 * part) / 1e4)).toEqual([NaN, 0, 0, 1, 1.1667]);
    expect([...mapped(Float64Array.from([NaN, 2, 3, 1]), [2, 4], false)]).toEqual([NaN, 0, 0.5, -0.5]);
  });
});
