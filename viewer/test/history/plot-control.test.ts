// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { containing, pinched, watchPlot, within, zoomed } from "../../src/history/plot-control";

describe("the part of an axis that is shown", () => {
  it("grows and shrinks around what stays where it is seen", () => {
    expect(zoomed([0, 100], 20, 0.5)).toEqual([10, 60]);
    expect(zoomed([10, 60], 20, 2)).toEqual([0, 100]);
  });

  it("has what lay under two fingers under them after a pinch", () => {
    expect(pinched([0, 100], [0.4, 0.6], [0.2, 0.8])).toEqual([expect.closeTo(100 / 3, 9), expect.closeTo(200 / 3, 9)]);
    expect(pinched([0, 100], [0.2, 0.4], [0.5, 0.7])).toEqual([expect.closeTo(-30, 9), expect.closeTo(70, 9)]);
    expect(pinched([0, 100], [0.2, 0.4], [0.5, 0.5])).toEqual([0, 100]);
    expect(pinched([0, 100], [0.2, 0.4], [0.6, 0.5])).toEqual([0, 100]);
  });

  it("lies within the whole, is not smaller than can be shown, and follows the cursor", () => {
    expect([within([-20, 30], [0, 100]), within([80, 130], [0, 100]), within([-5, 200], [0, 100])]).toEqual([[0, 50], [50, 100], null]);
    expect(within([50, 50], [0, 100])).toEqual([49.95, expect.closeTo(50.05, 9)]);
    expect([containing([10, 20], 25), containing([10, 20], 4), containing([10, 20], 12)]).toEqual([[15, 25], [4, 14], [10, 20]]);
  });
});

describe("keys and fingers on a plot", () => {
  let asked: unknown[];
  let captured: number[];
  let root: HTMLElement;
  let cursor: number | null;
  const send = (kind: string, pointerId: number, x: number, pointerType = "touch", y = 30): boolean =>
    root.dispatchEvent(new PointerEvent(kind, { bubbles: true, cancelable: true, pointerId, pointerType, clientX: x, clientY: y }));
  beforeEach(() => {
    [asked, cursor] = [[], null];
    root = document.createElement("div");
    root.setPointerCapture = (pointer) => { captured.push(pointer); };
    captured = [];
    watchPlot(root, () => ({ left: 100, top: 10, width: 200, height: 50 }), {
      zoomBy: (factor) => asked.push(factor), whole: () => asked.push("whole"), cursor: () => cursor, release: () => asked.push("release"), step: (by) => asked.push(by), point: (at) => asked.push(["point", at]),
      pinchBegun: () => asked.push("begun"), pinch: (from, to) => asked.push(["pinch", from, to]),
    });
  });

  it("move the cursor and zoom, and leave what they do not mean to others", () => {
    const press = (key: string, more: KeyboardEventInit = {}): boolean => root.dispatchEvent(new KeyboardEvent("keydown", { key, cancelable: true, ...more }));
    for (const key of ["ArrowLeft", "ArrowDown", "ArrowRight", "ArrowUp", "Home", "End", "+", "=", "-", "0"]) expect(press(key), key).toBe(false);
    expect(asked).toEqual([-1, -1, 1, 1, -Infinity, Infinity, 0.5, 0.5, 2, "whole"]);
    press("ArrowLeft", { shiftKey: true });
    expect(asked.at(-1)).toBe(-10);
    for (const [key, more] of [["x", {}], ["Tab", {}], ["0", { ctrlKey: true }], ["Escape", {}]] as const) expect(press(key, more), key).toBe(true);
    cursor = 0.5;
    expect([press("Escape"), asked.at(-1), asked.length]).toEqual([false, "release", 12]);
  });

  it("put the cursor where one taps, of which the browser makes no drag of a mouse", () => {
    expect(send("pointerdown", 1, 150)).toBe(false);
    send("pointerup", 1, 150);
    send("pointermove", 1, 170);
    expect([asked, captured]).toEqual([[["point", 0.25]], [1]]);
    expect(send("pointerdown", 2, 150, "mouse")).toBe(true);
    expect([asked.length, captured]).toEqual([1, [1]]);
  });

  it("take the cursor away by a tap on its line or beside the plot, and by nothing else", () => {
    const tap = (x: number, y = 30, slip = 0): unknown[] => {
      asked.length = 0;
      send("pointerdown", 1, x, "touch", y);
      if (slip > 0) send("pointermove", 1, x + slip, "touch", y);
      send("pointerup", 1, x + slip, "touch", y);
      return [...asked];
    };
    // Without a cursor each puts one.
    expect([tap(200), tap(90)]).toEqual([[["point", 0.5]], [["point", -0.05]]]);
    cursor = 0.5;
    expect([tap(205), tap(196, 30, 5), tap(90), tap(310), tap(150, 70), tap(150, 5)]).toEqual(Array.from({ length: 6 }, () => ["release"]));
    // A drag of its line, and a tap elsewhere, move it.
    expect([tap(200, 30, 50), tap(150)]).toEqual([[["point", 0.75]], [["point", 0.25]]]);
    asked.length = 0;
    send("pointerdown", 1, 200);
    send("pointercancel", 1, 200);
    send("pointerdown", 1, 200);
    send("pointerdown", 2, 250);
    send("pointerup", 1, 200);
    send("pointerup", 2, 250);
    expect(asked).toEqual(["begun"]);
  });

  it("zoom by a pinch, after which the one that stays longer moves nothing", () => {
    send("pointerdown", 1, 150);
    send("pointerdown", 2, 250);
    send("pointermove", 2, 300);
    send("pointerup", 2, 300);
    send("pointermove", 1, 120);
    send("pointerup", 1, 120);
    send("pointerdown", 3, 200);
    expect(asked).toEqual([["point", 0.25], "begun", ["pinch", [0.25, 0.75], [0.25, 1]], ["point", 0.5]]);
  });
});
