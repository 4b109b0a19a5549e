// @vitest-environment jsdom
import { beforeEach, describe, expect, it, vi } from "vitest";
import { StatusBar } from "../../src/panels/status";
import { STATUS, page } from "../page";
import { openDocument } from "./document";

describe("the bar", () => {
  let made: ReturnType<typeof page>;
  const at = (id: string): HTMLButtonElement => document.getElementById(id) as HTMLButtonElement;
  beforeEach(() => {
    openDocument();
    made = page();
    new StatusBar(made.store, made.commands);
  });

  it("says that a run has ended, and how, and offers nothing more", () => {
    for (const [how, words] of [["finished", "steps reached"], ["stopped", "stopped"], ["failed", "failed"]] as const) {
      made.store.dispatch({ type: "end", end: { how, cycle: 420, time: 1 } });
      expect(at("banner-text").textContent).toBe(`The run ended at cycle 420: ${words}. The picture stays as it was.`);
      expect(at("run").textContent).toBe(`ended: ${words}`);
    }
    made.store.dispatch({ type: "connection", state: "ended", explanation: "" });
    expect(at("banner").hidden).toBe(false);
    expect(at("banner").textContent).not.toMatch(/[Tt]rying/);
    expect(at("retry").hidden).toBe(true);
    expect([at("pause").disabled, at("pause").title]).toEqual([true, "The run has ended."]);
  });

  it("says where a recording is, whatever its last status was", () => {
    const moment = { seconds: 0, cycle: 3, time: 0.5 };
    made.greet({ recording: { first: moment, last: moment } });
    made.store.dispatch({ type: "status", status: { ...STATUS, cycle: 4500 }, at: 0 });
    made.store.dispatch({ type: "played", played: { ...moment, speed: 1, paused: true, at_end: false } });
    expect([at("cycle").textContent, at("time").textContent]).toEqual(["3", "0.5"]);
    expect(at("silence").hidden).toBe(true);
  });

  it("says that a recording is one, and whether it goes on", () => {
    const moment = { seconds: 0, cycle: 3, time: 0.5 };
    made.greet({ recording: { first: moment, last: moment } });
    const told = (paused: boolean, at_end: boolean): (string | null | undefined)[] => {
      made.store.dispatch({ type: "played", played: { ...moment, speed: 1, paused, at_end } });
      return [at("run").textContent, at("run").dataset.state];
    };
    expect(told(false, false)).toEqual(["recording (playing)", "running"]);
    expect(told(true, false)).toEqual(["recording (paused)", "paused"]);
    expect(told(false, true)).toEqual(["recording (paused)", "paused"]);
    made.store.dispatch({ type: "connection", state: "reconnecting", explanation: "" });
    expect(at("run").textContent).toBe("unknown");
  });

  it("does not call a recording that rests a simulation without a word", () => {
    vi.useFakeTimers();
    try {
      const { store, commands, greet } = page();
      const moment = { seconds: 0, cycle: 3, time: 0.5 };
      greet({ recording: { first: moment, last: moment } });
      new StatusBar(store, commands);
      vi.advanceTimersByTime(20_000);
      expect(at("silence").hidden).toBe(true);
    } finally {
      vi.useRealTimers();
    }
  });

  it("does not claim that a run goes on when the connection is lost", () => {
    made.store.dispatch({ type: "connection", state: "reconnecting", explanation: "The connection was lost." });
    expect(at("run").textContent).toBe("unknown");
    expect(at("banner-text").textContent).toBe("The connection was lost. Whether the run goes on is unknown. Trying again.");
    expect(at("pause").disabled).toBe(true);
  });

  it("says that a simulation takes no step, though its server says that it is there", () => {
    vi.useFakeTimers();
    try {
      const { store, commands } = page();
      new StatusBar(store, commands);
      const told = (cycle: number): void => store.dispatch({ type: "status", status: { ...STATUS, cycle, step_seconds: 0.1 }, at: 0 });
      store.dispatch({ type: "connection", state: "connected", explanation: "" });
      told(8);
      vi.advanceTimersByTime(10_000);
      told(8);
      vi.advanceTimersByTime(2000);
      expect(at("silence").textContent).toBe("The simulation has not said a word for 12 s. The picture may be old.");
      told(9);
      expect(at("silence").hidden).toBe(true);
    } finally {
      vi.useRealTimers();
    }
  });

  it("says who steers", () => {
    made.greet({ role: "watcher" });
    made.store.dispatch({ type: "status", status: { ...STATUS, driver: "c9" }, at: 0 });
    expect(at("role").textContent).toBe("watching · viewer c9 steers");
  });
});
