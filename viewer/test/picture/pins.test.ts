import { beforeEach, describe, expect, it } from "vitest";
import type { DataFrame, TopologyFrame } from "../../src/connection/protocol";
import { History, seriesKey } from "../../src/history/series";
import type { Said } from "../../src/history/series";
import type { Mark } from "../../src/picture/marks";
import { Pins } from "../../src/picture/pins";
import { probeNear, readProbe } from "../../src/picture/probe";

describe("a pinned place", () => {
  /** What the picture shows; null as long as there are no values. */
  let shown: { topology: TopologyFrame; frame: DataFrame } | null | undefined;
  let history: History;
  let marks: readonly Mark[];
  let pins: Pins;
  let sought: number;
  let watched: string[][];
  let plotted: [string, boolean][];

  /** A square that is cut into two triangles in one order or the other; the field is the place along x. */
  const square = (topology: string, cycle: number, isTurned: boolean, z = 0): typeof shown => ({
    topology: { kind: "topology", view: "v", topology, points: 4, triangles: Uint32Array.from(isTurned ? [1, 3, 2, 0, 1, 2] : [0, 1, 2, 1, 3, 2]), triangleFeatures: null, lines: new Uint32Array(0) },
    frame: {
      kind: "data", view: "v", topology, cycle, time: cycle, points: Float32Array.from([0, 0, z, 2, 0, z, 0, 2, z, 2, 2, z]),
      fields: [{ name: "x", association: "vertex", components: 1, values: Float64Array.from([0, 2, 0, 2]) }],
    },
  });
  const show = (next: typeof shown): void => {
    shown = next;
    pins.update();
  };
  const values = (): Said[] => history.table([seriesKey("probe 1, x", "x")]).columns[0] ?? [];

  beforeEach(() => {
    history = new History();
    marks = [];
    sought = 0;
    watched = [];
    plotted = [];
    pins = made();
    shown = square("1", 1, false);
    pins.add({ view: "v", topology: "1", triangle: 0, weights: [0.5, 0.25, 0.25] });
  });

  const made = (): Pins => new Pins(history, { set: (_, drawn) => { marks = drawn; } }, {
    read: (probe) => (shown ? readProbe(probe, shown.topology, shown.frame, { field: "x", component: -1 }) : null),
    near: (view, point) => {
      sought++;
      return shown ? probeNear(view, point, shown.topology, shown.frame.points) : null;
    },
    topologyOf: () => shown && shown.topology.topology,
  }, () => ({ name: "x", unit: null }), (...chosen) => plotted.push(chosen), () => watched.push([...pins.views]));

  it("stays where it is when its triangle is another one", () => {
    show(square("2", 2, true));
    show(square("2", 3, true, 0.5));
    expect(values()).toEqual([0.5, 0.5, 0.5]);
    expect(marks).toMatchObject([{ points: [[0.5, 0.5, 0.5]], label: "probe 1" }]);
    expect(sought).toBe(1);
  });

  it("is gone where the view is cut elsewhere, says so, and comes back with it", () => {
    for (const [topology, cycle] of [["2", 2], ["2", 3]] as const) show(square(topology, cycle, true, 9));
    expect(values()).toEqual([0.5]);
    expect(marks).toMatchObject([{ points: [[0.5, 0.5, 0]], label: "probe 1: the place is gone" }]);
    expect(sought).toBe(1);
    show(square("3", 4, true));
    expect(values()).toEqual([0.5, 0.5]);
    expect(marks).toMatchObject([{ label: "probe 1" }]);
  });

  it("is there again after a reload, where it was, and is read on", () => {
    expect(pins.kept).toEqual([{ name: "probe 1", view: "v", point: [0.5, 0.5, 0] }]);
    const { kept } = pins;
    shown = null;
    pins = made();
    pins.restore(kept);
    expect(watched.at(-1)).toEqual(["v"]);
    show(null);
    expect(marks).toMatchObject([{ points: [[0.5, 0.5, 0]], label: "probe 1" }]);
    show(square("7", 5, true));
    show(square("7", 6, true));
    expect([values(), sought]).toEqual([[0.5, 0.5, 0.5], 1]);
    // It is not put before the person's eyes again; a new one is, under a name of its own.
    expect(plotted).toEqual([[seriesKey("probe 1, x", "x"), true], [seriesKey("probe 1, x", "x"), false]]);
    pins.add({ view: "v", topology: "7", triangle: 0, weights: [1, 0, 0] });
    expect(plotted.at(-1)).toEqual([seriesKey("probe 2, x", "x"), true]);
    pins.clear();
    expect(history.series).toEqual([]);
  });

  it("waits for the values of a new topology, and is gone with its view", () => {
    show(null);
    expect(marks).toMatchObject([{ points: [[0.5, 0.5, 0]], label: "probe 1" }]);
    show(undefined);
    expect(marks).toMatchObject([{ label: "probe 1: the place is gone" }]);
    pins.clear();
    expect(marks).toEqual([]);
    // Whoever chooses what the run sends hears of both.
    expect(watched).toEqual([["v"], []]);
  });
});
