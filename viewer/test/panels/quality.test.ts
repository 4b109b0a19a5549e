// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import type { DataFrame, Hello, TopologyFrame, Vector } from "../../src/connection/protocol";
import { WorstCells } from "../../src/panels/quality";
import type { Layer } from "../../src/picture/layer";
import type { Mark } from "../../src/picture/marks";
import type { Stand } from "../../src/picture/camera";
import { QUALITY, WORST } from "../../src/store/pipelines";
import type { Pipeline } from "../../src/store/pipelines";
import { STATUS, page } from "../page";

const stand = (x: number): Stand => ({ position: [x, 0, 5], focalPoint: [x, 0, 0], viewUp: [0, 1, 0], parallel: false, parallelScale: 1, viewAngle: 30 });

/** Twelve tetrahedra beside each other, of which the first is the worst. */
const TOPOLOGY = {
  kind: "topology", view: WORST, topology: "1", points: 48, triangleFeatures: null, lines: new Uint32Array(0),
  triangles: Uint32Array.from(Array.from({ length: 12 }, (_, i) => [0, 1, 2, 0, 1, 3, 1, 2, 3, 2, 0, 3].map((corner) => 4 * i + corner)).flat()),
} as TopologyFrame;
const FRAME = {
  kind: "data", view: WORST, topology: "1", cycle: 1, time: 1,
  points: Float32Array.from(Array.from({ length: 12 }, (_, i) => [9 * i, 0, 0, 9 * i + 4, 0, 0, 9 * i, 4, 0, 9 * i, 0, 4]).flat()),
  fields: [{ name: QUALITY, association: "element", components: 1, values: Float64Array.from({ length: 48 }, (_, i) => 0.2 + Math.floor(i / 4) / 100) }],
} as DataFrame;

describe("the worst cells", () => {
  let made: ReturnType<typeof page>;
  let worst: WorstCells;
  let changes: (Pipeline | string)[];
  let marks: readonly Mark[];
  let camera: { stand: Stand; flyTo(place: Vector): void };
  let button: HTMLButtonElement;
  let isOnItsWay: boolean;
  const layers = new Map<string, Layer>();
  const quality = (min: number) => made.store.dispatch({ type: "status", status: { ...STATUS, quality: { min, mean: 0.8, inverted: 0 } }, at: 0 });
  /** What the newest pipeline counts, if so many cells lie in each part. */
  const counted = (each: (part: number) => number, change = changes.at(-1)): Record<string, number> => {
    const [low, high] = ((change as Pipeline).stages[1] as { histogram: { range: [number, number] } }).histogram.range;
    return { "cells.lower": low, "cells.upper": high, "cells.below": 0, "cells.above": 0, ...Object.fromEntries(Array.from({ length: 64 }, (_, i) => [`cells.bins.${i}`, each(i)])) };
  };
  const threshold = (): unknown => ((changes.at(-1) as Pipeline).stages[0] as { threshold: unknown }).threshold;
  const isStreamed = (): boolean => (changes.at(-1) as Pipeline).stages.some((stage) => "stream" in (stage as object));
  beforeEach(() => {
    made = page();
    isOnItsWay = false;
    changes = [];
    marks = [];
    layers.clear();
    camera = { stand: stand(1), flyTo: ([x]) => { camera.stand = stand(x); } };
    button = document.createElement("button");
    worst = new WorstCells(button, made.store, { set: (pipeline) => { changes.push(pipeline); }, remove: (name) => { changes.push(name); }, isOnItsWay: () => isOnItsWay }, { layers, camera }, { set: (_, all) => { marks = all; } });
    quality(0.2);
  });

  it("are counted first, so that ten are ringed however they are spread", () => {
    button.click();
    expect(isStreamed()).toBe(false);
    // One is by far the worst, the others come in the middle of the range.
    worst.take(counted((part) => (part === 0 ? 1 : part === 31 ? 20 : 0)));
    expect(isStreamed()).toBe(true);
    expect(threshold()).toEqual({ field: QUALITY, max: expect.closeTo(0.5, 12) });
    layers.set(WORST, { topology: TOPOLOGY, frame: FRAME } as Layer);
    worst.update();
    expect([marks.length, marks[0]!.label]).toEqual([10, "quality 0.2"]);
    // What is counted later is of nobody's asking.
    const before = changes.length;
    worst.take(counted(() => 9, changes[0]));
    expect(changes.length).toBe(before);
  });

  it("are counted more finely where many are nearly as bad, and there are none where all are alike", () => {
    button.click();
    for (let times = 0; times < 9 && typeof changes.at(-1) !== "string"; times++) worst.take(counted((part) => (part === 0 ? 5000 : 0)));
    expect([changes.length > 3, changes.at(-1)]).toEqual([true, WORST]);
    expect(changes.every((change) => typeof change === "string" || !change.stages.some((stage) => "stream" in (stage as object)))).toBe(true);
    expect(made.store.state.refusal).toContain("Too many cells are alike");
  });

  it("leave the camera where it was before it flew to them", () => {
    button.click();
    button.click();
    expect(camera.stand).toEqual(stand(1));
    button.click();
    camera.stand = stand(3);
    layers.set(WORST, { topology: TOPOLOGY, frame: FRAME } as Layer);
    worst.update();
    expect(camera.stand).toEqual(stand(1));
    button.click();
    expect(camera.stand).toEqual(stand(3));
  });

  it("are looked for anew once the shape is another", () => {
    button.click();
    worst.take(counted((part) => (part === 0 ? 20 : 0)));
    changes = [];
    made.store.dispatch({ type: "order", status: { id: "o1", status: "applying", cycle_applied: 9 } });
    expect(changes).toEqual([]);
    quality(0.1);
    made.store.dispatch({ type: "order", status: { id: "o1", status: "applied", cycle_applied: 9 } });
    expect(threshold()).toEqual({ field: QUALITY, max: 0.8 });
    expect(isStreamed()).toBe(false);
  });

  const COUNT = { monitors: [{ pipeline: WORST, name: "cells.lower" }, { pipeline: WORST, name: "cells.below" }] };
  const STREAM = { views: [{ name: WORST, kind: "slice" }] } as unknown as Partial<Hello>;
  /** Has the worst cells shown: counted, then streamed. */
  const show = (): void => {
    button.click();
    worst.take(counted((part) => (part === 0 ? 20 : 0)));
    made.greet(STREAM);
  };
  const isPressed = (): boolean => button.getAttribute("aria-pressed") === "true";
  const connection = (state: "connected" | "reconnecting") => made.store.dispatch({ type: "connection", state, explanation: "" });

  it("are given up with the wheel, and what the search has left goes with its return", () => {
    button.click();
    made.greet(COUNT);
    const asked = changes.length;
    made.greet({ ...COUNT, role: "watcher" });
    expect(isPressed()).toBe(false);
    worst.take(counted((part) => (part === 0 ? 20 : 0)));
    expect(changes).toHaveLength(asked);
    made.greet(COUNT);
    expect(changes.slice(asked)).toEqual([WORST]);
    made.greet({});
    made.greet({ role: "watcher" });
    made.greet({});
    expect(changes).toHaveLength(asked + 1);
  });

  it("are given up with the connection, and what the search has left goes once the run has said that it is there", () => {
    button.click();
    made.greet(COUNT);
    const asked = changes.length;
    connection("reconnecting");
    expect(isPressed()).toBe(false);
    connection("connected");
    expect(changes).toHaveLength(asked);
    made.greet(COUNT);
    expect(changes.slice(asked)).toEqual([WORST]);
  });

  it("stay over a loss of the connection where they are streamed, and go with their release, as soon as this page steers", () => {
    show();
    const asked = changes.length;
    connection("reconnecting");
    connection("connected");
    made.greet({ ...STREAM, role: "watcher" });
    expect([isPressed(), changes.length]).toEqual([true, asked]);
    button.click();
    expect([isPressed(), changes.length]).toEqual([false, asked]);
    made.greet(STREAM);
    expect(changes.slice(asked)).toEqual([WORST]);
  });

  it("stay where another page has had them streamed meanwhile", () => {
    show();
    made.greet({ ...STREAM, role: "watcher" });
    button.click();
    made.greet({ ...COUNT, role: "watcher" });
    made.greet({ ...STREAM, role: "watcher" });
    const asked = changes.length;
    made.greet(STREAM);
    expect(changes).toHaveLength(asked);
  });

  it("are counted for nobody where the page that began it is gone: whoever steers removes that, and no pipeline of somebody's own", () => {
    made.greet({ monitors: [{ pipeline: WORST, name: "mine" }] });
    expect(changes).toEqual([]);
    made.greet({ ...COUNT, role: "watcher" });
    expect(changes).toEqual([]);
    made.greet(COUNT);
    expect(changes).toEqual([WORST]);
  });

  it("are released where the run refuses them", () => {
    button.click();
    isOnItsWay = true;
    worst.refused();
    expect(isPressed()).toBe(true);
    isOnItsWay = false;
    const asked = changes.length;
    worst.refused();
    expect([isPressed(), changes.length]).toEqual([false, asked]);
    // What it has had before is removed.
    button.click();
    made.greet(COUNT);
    worst.refused();
    expect([isPressed(), changes.at(-1)]).toEqual([false, WORST]);
  });

  it("are released where somebody else has removed them", () => {
    show();
    made.greet({});
    expect(isPressed()).toBe(false);
  });

  it("are shown again after a reload, and a count is ended before", () => {
    button.click();
    made.greet(COUNT);
    worst.leave();
    expect([changes.at(-1), worst.kept]).toEqual([WORST, false]);
    made.greet({});
    show();
    const asked = changes.length;
    worst.leave();
    expect([changes.length, worst.kept]).toEqual([asked, true]);
    const anew = document.createElement("button");
    const again = new WorstCells(anew, made.store, { set: () => undefined, remove: (name) => { changes.push(name); }, isOnItsWay: () => false }, { layers, camera }, { set: () => undefined });
    again.restore(true);
    expect([anew.getAttribute("aria-pressed"), changes.length]).toEqual(["true", asked]);
    anew.click();
    expect(changes.at(-1)).toBe(WORST);
  });
});
