// @vitest-environment jsdom
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { Pace, REST } from "../../src/picture/pace";

beforeEach(() => { vi.useFakeTimers(); });
afterEach(() => { vi.useRealTimers(); });

test("a picture that moves is drawn coarsely until it has rested", () => {
  const changed = vi.fn();
  const pace = new Pace(true, changed);
  for (let key = 0; key < 5; key++) {
    pace.move();
    vi.advanceTimersByTime(REST - 50);
    expect(pace.scale).toBe(0.5);
  }
  expect(changed).toHaveBeenCalledTimes(1);
  vi.advanceTimersByTime(100);
  expect(pace.scale).toBe(1);
  expect(changed).toHaveBeenCalledTimes(2);
});

/** A pointer on the picture, or let go anywhere. */
function point(target: EventTarget, type: string, pointerId: number): void {
  target.dispatchEvent(Object.assign(new Event(type, { bubbles: true }), { pointerId }));
}

test("its pixels stay as many from the first press to the last release, and are what a press finds", () => {
  const container = document.createElement("div");
  const picture = container.appendChild(document.createElement("canvas"));
  document.body.append(container);
  const pace = new Pace(true, vi.fn());
  pace.follow(container);
  const found: number[] = [];
  container.addEventListener("pointerdown", () => found.push(pace.scale));
  point(picture, "pointerdown", 1);
  point(picture, "pointerdown", 2);
  vi.advanceTimersByTime(5000);
  pace.rest();
  point(document.body, "pointerup", 1);
  vi.advanceTimersByTime(5000);
  expect(pace.scale).toBe(0.5);
  point(document.body, "pointercancel", 2);
  vi.advanceTimersByTime(REST - 50);
  expect(pace.scale).toBe(0.5);
  vi.advanceTimersByTime(100);
  expect(pace.scale).toBe(1);
  expect(found).toEqual([0.5, 0.5]);
});

test("who wants the picture has it in full, also while it is moved", () => {
  const changed = vi.fn();
  const pace = new Pace(true, changed);
  pace.move();
  pace.rest();
  expect(pace.scale).toBe(1);
  vi.advanceTimersByTime(1000);
  expect(changed).toHaveBeenCalledTimes(2);
});

test("where a graphics card draws it is always drawn in full", () => {
  const changed = vi.fn();
  const pace = new Pace(false, changed);
  pace.move();
  vi.advanceTimersByTime(1000);
  expect(changed).not.toHaveBeenCalled();
});
