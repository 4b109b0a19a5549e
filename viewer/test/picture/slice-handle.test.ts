// @vitest-environment jsdom
import { describe, expect, it, vi } from "vitest";
import type { Vector } from "../../src/connection/protocol";
import { Projection } from "../../src/handles/projection";
import { add, dot, length, normalised, times } from "../../src/handles/vector";
import { outlineOf, SliceHandle } from "../../src/picture/slice-handle";
import { offsetOf } from "../../src/store/pipelines";
import type { Plane } from "../../src/store/pipelines";
import { OBLIQUE, PARALLEL } from "../handles/cameras";

const BOX: [Vector, Vector] = [[0, 0, 0], [2, 1, 1]];

describe("the outline of a cut", () => {
  it("across an axis is the rectangle there", () => {
    const points = outlineOf(BOX, { origin: [0.5, 9, 9], normal: [3, 0, 0] });
    expect(points).toHaveLength(4);
    expect(points.every(([x]) => x === 0.5)).toBe(true);
    // Around it, not across: neighbours are 1 apart.
    points.forEach((point, i) => expect(length(add(points[(i + 1) % 4]!, times(point, -1)))).toBeCloseTo(1, 12));
  });

  it("of a slanted plane lies in it, with up to six corners", () => {
    const normal = normalised([1, 1, 1]);
    const points = outlineOf([[0, 0, 0], [1, 1, 1]], { origin: [0.5, 0.5, 0.5], normal });
    expect(points).toHaveLength(6);
    for (const point of points) expect(dot(point, normal)).toBeCloseTo(1.5 / Math.sqrt(3), 12);
    const steps = points.map((point, i) => length(add(points[(i + 1) % 6]!, times(point, -1))));
    for (const step of steps) expect(step).toBeCloseTo(Math.SQRT1_2, 12);
  });

  it("beside the box is none", () => {
    expect(outlineOf(BOX, { origin: [5, 0, 0], normal: [1, 0, 0] }).length).toBeLessThan(3);
  });
});

describe("the knob of a slice", () => {
  it("is gripped by a finger within reach of it, and has the run cut where it is dragged to", () => {
    const [root, scene] = [document.createElementNS("http://www.w3.org/2000/svg", "svg"), document.createElement("div")];
    let plane: Plane = { origin: [1, 0.5, 0.2], normal: [0, 0, 2] };
    const move = vi.fn((to: Plane) => { plane = to; });
    const handle = new SliceHandle(root, scene, { projection: () => OBLIQUE, points: () => Float32Array.of(0, 0, 0.2, 2, 1, 0.2), bounds: () => BOX, redraw: () => undefined }, { get movable() { return plane; }, move });
    handle.drawn();
    const [grip, halo] = [".grip", ".halo"].map((name) => root.querySelector<SVGElement>(name)!) as [SVGElement, SVGElement];
    expect([Number(halo.getAttribute("r")) >= 16, ["cx", "cy"].map((name) => Number(halo.getAttribute(name)))]).toEqual([true, handle.place]);
    grip.setPointerCapture = () => undefined;
    const send = (kind: string, up: number): void => {
      const [x, y] = [handle.place![0] + 12, handle.place![1] - up];
      halo.dispatchEvent(new PointerEvent(kind, { bubbles: true, button: 0, pointerId: 3, pointerType: "touch", clientX: x, clientY: y }));
    };
    send("pointerdown", 0);
    send("pointermove", 40);
    expect(move).toHaveBeenCalledOnce();
    expect(offsetOf(plane)).toBeGreaterThan(0.25);
    expect(plane.normal).toEqual([0, 0, 2]);
    send("pointerup", 40);
    send("pointermove", 80);
    expect(move).toHaveBeenCalledOnce();
  });

  it("is not sought anew where only values have come, and is where the points, the plane or the picture are other ones", () => {
    const root = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    let plane: Plane = { origin: [1, 0.5, 0.2], normal: [0, 0, 2] }, points = Float32Array.of(0, 0, 0.2, 2, 1, 0.2), projection = OBLIQUE;
    const looked = vi.spyOn(Projection.prototype, "toPicture");
    const handle = new SliceHandle(root, document.createElement("div"), { projection: () => projection, points: () => points, bounds: () => [[...BOX[0]], [...BOX[1]]], redraw: () => undefined }, { get movable() { return plane; }, move: () => undefined });
    const drawn = (): number => {
      looked.mockClear();
      handle.drawn();
      return looked.mock.calls.length;
    };
    const first = drawn(), place = handle.place;
    expect([drawn(), drawn()]).toEqual([first - 2, first - 2]);
    expect(handle.place).toEqual(place);
    points = Float32Array.of(0, 1, 0.2, 2, 1, 0.2);
    expect(drawn()).toBe(first);
    expect(handle.place).not.toEqual(place);
    plane = { ...plane };
    expect(drawn()).toBe(first);
    projection = PARALLEL;
    expect(drawn()).toBe(first);
    looked.mockRestore();
  });

  it("leaves both fingers to the camera where a second one comes before the first has moved it, wherever that is put down", () => {
    const [root, scene] = [document.createElementNS("http://www.w3.org/2000/svg", "svg"), document.createElement("div")];
    const plane: Plane = { origin: [1, 0.5, 0.2], normal: [0, 0, 2] };
    const move = vi.fn();
    const handle = new SliceHandle(root, scene, { projection: () => OBLIQUE, points: () => Float32Array.of(0, 0, 0.2, 2, 1, 0.2), bounds: () => BOX, redraw: () => undefined }, { movable: plane, move });
    handle.drawn();
    const grip = root.querySelector<SVGElement>(".grip")!;
    grip.setPointerCapture = () => undefined;
    let seen: number[] = [];
    scene.addEventListener("pointerdown", ({ pointerId }) => seen.push(pointerId));
    const send = (kind: string, pointerId: number, up = 0, target: Element = grip): void => {
      const [x, y] = handle.place!;
      target.dispatchEvent(new PointerEvent(kind, { bubbles: true, button: 0, pointerId, pointerType: "touch", clientX: x, clientY: y - up }));
    };
    for (const second of [scene, grip]) {
      seen = [];
      send("pointerdown", 1);
      send("pointerdown", 2, 0, second);
      expect(seen).toEqual([1, 2]);
      send("pointermove", 1, 40);
      send("pointerup", 1, 40);
      expect(move).not.toHaveBeenCalled();
    }
    // A slice that goes with a finger is kept from another one.
    seen = [];
    send("pointerdown", 1);
    send("pointermove", 1, 40);
    send("pointerdown", 2, 0, scene);
    send("pointermove", 1, 60);
    expect([seen, move.mock.calls.length]).toEqual([[], 2]);
  });

  it("stands at the plane that it moves, though others are cut with it", () => {
    const root = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    const plane: Plane = { origin: [1, 0.5, 0.2], normal: [0, 0, 1] };
    const at = (points: Float32Array): [number, number] | null => {
      const handle = new SliceHandle(root, document.createElement("div"), { projection: () => OBLIQUE, points: () => points, bounds: () => BOX, redraw: () => undefined }, { movable: plane, move: () => undefined });
      handle.drawn();
      return handle.place;
    };
    const alone = at(Float32Array.of(1, 0.5, 0.2001, 2, 1, 0.2001));
    // The other plane reaches farther to the left.
    expect(at(Float32Array.of(0, 0, 0.8, 1, 0.5, 0.2001, 2, 1, 0.2001, 0, 1, 0.8))).toEqual(alone);
    expect(at(Float32Array.of(0, 0, 0.8, 0, 1, 0.8))).not.toEqual(alone);
  });
});
