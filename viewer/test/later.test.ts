import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Later } from "../src/later";

describe("what can wait for the first picture", () => {
  beforeEach(() => { vi.useFakeTimers(); });
  afterEach(() => { vi.useRealTimers(); });

  it("is done in its order once that is drawn, and at once from then on", () => {
    const later = new Later(1000), done: number[] = [];
    later.run(() => done.push(1));
    later.run(() => done.push(2));
    vi.advanceTimersByTime(500);
    expect(done).toEqual([]);
    later.begin();
    vi.advanceTimersByTime(1);
    expect(done).toEqual([1, 2]);
    later.run(() => done.push(3));
    expect(done).toEqual([1, 2, 3]);
    vi.advanceTimersByTime(2000);
    expect(done).toEqual([1, 2, 3]);
  });

  it("is done after a while where no picture comes", () => {
    const later = new Later(1000), done: number[] = [];
    later.run(() => done.push(1));
    vi.advanceTimersByTime(1001);
    expect(done).toEqual([1]);
  });
});
