// @vitest-environment jsdom
import { beforeEach, describe, expect, it, vi } from "vitest";
import { StatusBar } from "../../src/panels/status";
import { WheelPanel } from "../../src/panels/wheel";
import { STATUS, page } from "../page";
import { openDocument } from "./document";

describe("the bar", () => {
  let made: ReturnType<typeof page>;
  let wheel: WheelPanel;
  const at = (id: string): HTMLButtonElement => document.getElementById(id) as HTMLButtonElement;
  beforeEach(() => {
    openDocument();
    made = page();
    new StatusBar(made.store, made.commands);
    wheel = new WheelPanel(made.store, made.commands);
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

  it("hands the wheel over, or keeps it, once another asks", () => {
    expect(at("asked").hidden).toBe(true);
    made.store.dispatch({ type: "wheel asked", by: "c4" });
    expect([at("asked").hidden, at("asked-text").textContent]).toEqual([false, "Viewer c4 asks to steer."]);
    at("hand-over").click();
    expect(made.sent.at(-1)).toMatchObject({ hand_over: { to: "c4" } });
    expect(at("asked").hidden).toBe(true);
    made.store.dispatch({ type: "wheel asked", by: "c5" });
    at("keep").click();
    expect(made.sent.at(-1)).toMatchObject({ here: {} });
  });

  it("lets a watcher ask, where its link allows it", () => {
    expect(at("wheel").hidden).toBe(true);
    made.greet({ role: "watcher" });
    made.store.dispatch({ type: "status", status: { ...STATUS, driver: "c9" }, at: 0 });
    expect(at("role").textContent).toBe("watching · viewer c9 steers");
    at("wheel").click();
    expect(made.sent.at(-1)).toMatchObject({ drive: {} });
    made.greet({ role: "watcher", may_drive: false });
    expect(at("wheel").hidden).toBe(true);
  });

  it("says quietly that an answer is waited for, for a minute or until somebody else steers", () => {
    vi.useFakeTimers();
    try {
      const now = (driver: string): void => made.store.dispatch({ type: "status", status: { ...STATUS, driver }, at: 0 });
      const ask = (): boolean => {
        at("wheel").click();
        return wheel.told(String(made.sent.at(-1)!.id), "c9 has the wheel and is told that you ask for it");
      };
      const waiting = (): string | null => (at("waiting").hidden ? null : at("waiting").textContent);
      made.greet({ role: "watcher" });
      now("c9");
      expect([wheel.told("another", "no"), waiting()]).toEqual([false, null]);
      expect([ask(), waiting(), made.store.state.refusal]).toEqual([true, "c9 has the wheel and is told that you ask for it.", ""]);
      vi.advanceTimersByTime(59_000);
      now("c9");
      expect(waiting()).not.toBeNull();
      vi.advanceTimersByTime(2000);
      expect(waiting()).toBeNull();
      ask();
      now("c4");
      expect(waiting()).toBeNull();
      ask();
      made.greet({ role: "driver" });
      expect(waiting()).toBeNull();
    } finally {
      vi.useRealTimers();
    }
  });
});
