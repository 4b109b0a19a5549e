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

test("a hand that holds it still does not make it rest", () => {
  const pace = new Pace(true, vi.fn());
  pace.hold();
  vi.advanceTimersByTime(5000);
  expect(pace.scale).toBe(0.5);
  pace.release();
  vi.advanceTimersByTime(REST - 50);
  expect(pace.scale).toBe(0.5);
  vi.advanceTimersByTime(100);
  expect(pace.scale).toBe(1);
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
  pace.hold();
  expect(pace.scale).toBe(1);
  pace.release();
  vi.advanceTimersByTime(1000);
  expect(changed).not.toHaveBeenCalled();
});
