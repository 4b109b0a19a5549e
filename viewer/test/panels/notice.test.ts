// @vitest-environment jsdom
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Notice } from "../../src/panels/notice";
import { page } from "../page";
import { openDocument } from "./document";

describe("what went wrong", () => {
  beforeEach(() => {
    openDocument();
    vi.useFakeTimers();
  });
  afterEach(() => { vi.useRealTimers(); });

  it("is told for ten seconds from the last time on", () => {
    const { store } = page();
    const notice = document.getElementById("notice")!;
    new Notice(store);
    expect(notice.hidden).toBe(true);
    store.dispatch({ type: "unreadable", text: "a frame was cut short" });
    expect([notice.hidden, notice.textContent]).toEqual([false, "Something went wrong: a frame was cut short."]);
    vi.advanceTimersByTime(6000);
    store.dispatch({ type: "unreadable", text: "another" });
    vi.advanceTimersByTime(6000);
    expect([notice.hidden, notice.textContent]).toEqual([false, "Something went wrong: another."]);
    vi.advanceTimersByTime(4000);
    expect(notice.hidden).toBe(true);
  });
});
