// @vitest-environment jsdom
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { Detail, SLOW, STILL } from "../../src/picture/detail";

let changed: ReturnType<typeof vi.fn<() => void>>, detail: Detail;
beforeEach(() => {
  vi.useFakeTimers();
  changed = vi.fn();
  detail = new Detail(changed);
});
afterEach(() => { vi.useRealTimers(); });

test("a slow picture is coarse while it moves, and whole again soon after", () => {
  detail.took(SLOW + 1);
  expect(detail.isCoarse).toBe(false);
  for (let move = 0; move < 5; move++) {
    detail.move();
    vi.advanceTimersByTime(STILL - 10);
    expect(detail.isCoarse).toBe(true);
  }
  expect(changed).not.toHaveBeenCalled();
  vi.advanceTimersByTime(10);
  expect(detail.isCoarse).toBe(false);
  expect(changed).toHaveBeenCalledTimes(1);
});

test("a quick picture is always whole, also where its first one was slow; and so is one that was never seen", () => {
  detail.move();
  expect(detail.isCoarse).toBe(false);
  detail.took(10 * SLOW);
  detail.took(SLOW - 1);
  detail.move();
  expect(detail.isCoarse).toBe(false);
  for (let picture = 0; picture < 5; picture++) detail.took(SLOW + 1);
  detail.move();
  expect(detail.isCoarse).toBe(true);
});

test("a camera that is followed, which moves five times a second, is not drawn whole in between", () => {
  detail.took(SLOW + 1);
  detail.move();
  vi.advanceTimersByTime(200);
  for (let move = 0; move < 5; move++) {
    detail.move();
    vi.advanceTimersByTime(199);
    expect(detail.isCoarse).toBe(true);
    vi.advanceTimersByTime(1);
  }
  vi.advanceTimersByTime(100);
  expect(detail.isCoarse).toBe(false);
});

/** A context that takes some time to draw, or is lost. */
function context(milliseconds: number, isLost = false): WebGL2RenderingContext {
  const end = performance.now() + milliseconds;
  return {
    SYNC_GPU_COMMANDS_COMPLETE: 1, TIMEOUT_EXPIRED: 2, ALREADY_SIGNALED: 3, CONDITION_SATISFIED: 4, WAIT_FAILED: 5, fenceSync: () => ({}), flush: () => undefined,
    deleteSync: () => undefined, isContextLost: () => isLost, clientWaitSync: () => (isLost ? 5 : performance.now() < end ? 2 : 3),
  } as unknown as WebGL2RenderingContext;
}

test.each([[SLOW - 10, false], [SLOW + 10, true]])("what a picture costs is the time until it is drawn: %d ms", (milliseconds, isCoarse) => {
  detail.measure(context(milliseconds), performance.now());
  // One at a time: this one counts for nothing.
  detail.measure(context(0), performance.now());
  vi.advanceTimersByTime(1000);
  detail.move();
  expect(detail.isCoarse).toBe(isCoarse);
});

test("a context that is lost measures nothing, and the next one does again", () => {
  detail.measure(context(0, true), performance.now() - 100);
  vi.advanceTimersByTime(100);
  detail.move();
  expect(detail.isCoarse).toBe(false);
  detail.measure(context(SLOW + 10), performance.now());
  vi.advanceTimersByTime(100);
  detail.move();
  expect(detail.isCoarse).toBe(true);
});
