// @vitest-environment jsdom
import vtkRenderer from "@kitware/vtk.js/Rendering/Core/Renderer";
import type vtkOpenGLRenderWindow from "@kitware/vtk.js/Rendering/OpenGL/RenderWindow";
import { beforeEach, describe, expect, it } from "vitest";
import type { DataFrame, TopologyFrame } from "../../src/connection/protocol";
import { Layer } from "../../src/picture/layer";
import { Places } from "../../src/picture/places";
import { firstLook } from "../../src/store/looks";

/** The picture begins here on the page; its canvas has two pixels for each of the page's. */
const [LEFT, TOP, WIDTH, HEIGHT] = [40, 30, 400, 300];

/** A square of two triangles, the one right of its diagonal of feature 0 and the other of feature 1. */
const topology = (view: string, features: boolean): TopologyFrame => ({
  kind: "topology", view, topology: "1", points: 4, triangles: Uint32Array.of(0, 1, 2, 0, 2, 3), triangleFeatures: features ? Uint32Array.of(0, 1) : null, lines: new Uint32Array(0),
});
const frame = (view: string, z: number, values: number[]): DataFrame => ({
  kind: "data", view, topology: "1", cycle: 5, time: 0.5, points: Float32Array.of(0, 0, z, 1, 0, z, 1, 1, z, 0, 1, z),
  fields: values.length > 0 ? [{ name: "p", association: "vertex", components: 1, values: Float64Array.from(values) }] : [],
});

describe("a place of the page", () => {
  let layers: Map<string, Layer>;
  let places: Places;
  let names: string[];
  const renderer = vtkRenderer.newInstance();

  /** A view seen from above; one with values is coloured by them. */
  function add(name: string, z: number, features: boolean, values: number[] = []): Layer {
    const view = { name, kind: "surface" };
    const layer = new Layer(name, "surface", firstLook(view, [view], values.length > 0 ? [{ name: "p", association: "vertex", components: 1 }] : []), renderer);
    layer.setTopology(topology(name, features));
    expect(layer.setData(frame(name, z, values))).toBeNull();
    layer.takeScalars();
    layers.set(name, layer);
    return layer;
  }
  /** The place of the page at which the point is seen. */
  const seen = (x: number, y: number, z = 0): [number, number] => places.onPage([x, y, z]);

  beforeEach(() => {
    document.body.innerHTML = '<div id="scene"></div>';
    const container = document.getElementById("scene")!;
    container.getBoundingClientRect = () => new DOMRect(LEFT, TOP, WIDTH, HEIGHT);
    Object.defineProperties(container, { clientWidth: { value: WIDTH }, clientHeight: { value: HEIGHT } });
    document.elementFromPoint = () => container;
    const size = [2 * WIDTH, 2 * HEIGHT] as const;
    const canvas = {
      getSize: () => size,
      worldToDisplay: (x: number, y: number, z: number) => renderer.worldToNormalizedDisplay(x, y, z, WIDTH / HEIGHT).map((value, axis) => value * (size[axis] ?? 1)),
      displayToWorld: (x: number, y: number, z: number) => renderer.normalizedDisplayToWorld(x / size[0], y / size[1], z, WIDTH / HEIGHT),
    } as unknown as vtkOpenGLRenderWindow;
    renderer.getActiveCamera().set({ focalPoint: [0.5, 0.5, 0], position: [0.5, 0.5, 4], viewUp: [0, 1, 0], clippingRange: [1, 10] });
    layers = new Map();
    names = ["floor", "roof"];
    places = new Places(container, canvas, renderer, layers, () => names);
  });

  it("is where a point is drawn, from the upper left corner of the page", () => {
    const [x, y] = seen(0.5, 0.5);
    expect([x, y].map(Math.round)).toEqual([LEFT + WIDTH / 2, TOP + HEIGHT / 2]);
    expect(seen(1, 0.5)[0]).toBeGreaterThan(x);
    expect(seen(0.5, 1)[1]).toBeLessThan(y);
    const inPicture = places.projection().toPicture([0.2, 0.9, 0.1])!;
    const onPage = seen(0.2, 0.9, 0.1);
    for (const [axis, begin] of [LEFT, TOP].entries()) expect(inPicture[axis]! + begin).toBeCloseTo(onPage[axis]!, 3);
  });

  it("has the feature of the nearest triangle that is drawn, and where it is met", () => {
    add("low", 0, true);
    const high = add("high", 0.5, true);
    add("cut", 0.8, false);
    expect([places.featureAt(...seen(0.8, 0.2)), places.featureAt(...seen(0.2, 0.8)), places.featureAt(...seen(1.2, 0.5))]).toEqual(["floor", "roof", null]);
    const at = seen(0.7, 0.2, 0.5);
    for (const [axis, value] of [0.7, 0.2, 0.5].entries()) expect(places.pick(...at)!.point[axis]).toBeCloseTo(value, 4);
    high.look = { ...high.look, visible: false };
    expect(places.pick(...at)!.point[2]).toBeCloseTo(0, 4);
  });

  it("has no feature where the triangles are of one that has no name", () => {
    add("low", 0, true);
    names = ["floor"];
    expect([places.featureAt(...seen(0.8, 0.2)), places.pick(...seen(0.2, 0.8))]).toEqual(["floor", null]);
  });

  it("has a value of what carries colours, also behind what carries none", () => {
    add("plain", 0.5, true);
    expect(places.probe(...seen(0.8, 0.2))).toMatchObject({ view: "plain", topology: "1", triangle: 0 });
    add("coloured", 0, false, [0, 1, 1, 0]);
    const probe = places.probe(...seen(0.25, 0.75))!;
    expect(probe).toMatchObject({ view: "coloured", triangle: 1 });
    expect(places.read(probe)!.value).toBeCloseTo(0.25, 4);
    expect(places.probe(...seen(1.5, 0.5))).toBeNull();
  });

  it("has nothing of a view without values, or with other triangles than when it was found", () => {
    const layer = add("low", 0, true);
    const probe = places.near("low", [0.8, 0.2, 0.1])!;
    expect([probe.triangle, places.near("low", [9, 9, 9]), places.near("none", [0, 0, 0])]).toEqual([0, null, null]);
    expect([places.topologyOf("low"), places.topologyOf("none")]).toEqual(["1", undefined]);
    expect([places.read(probe)?.cycle, places.read({ ...probe, topology: "0" }), places.read({ ...probe, view: "none" })]).toEqual([5, null, null]);
    layer.frame = null;
    expect([places.topologyOf("low"), places.read(probe), places.near("low", [0.8, 0.2, 0.1]), places.probe(...seen(0.8, 0.2))]).toEqual([null, null, null, null]);
  });

  it("shows a feature where it would be picked, nothing lies over it, and it is free", () => {
    add("low", 0, true);
    expect(places.featurePlace("roof")!.map(Math.round)).toEqual(seen(1 / 3, 2 / 3).map(Math.round));
    expect([places.featurePlace("none"), places.featurePlace("roof", () => false)]).toEqual([null, null]);
    document.elementFromPoint = () => document.body;
    expect(places.featurePlace("roof")).toBeNull();
    document.elementFromPoint = () => document.getElementById("scene");
    const above = topology("high", true);
    const layer = add("high", 0.1, true);
    layer.setTopology({ ...above, triangleFeatures: Uint32Array.of(0, 0) });
    expect(layer.setData(frame("high", 0.1, []))).toBeNull();
    expect(places.featurePlace("roof")).toBeNull();
  });
});
