// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { StatusBar } from "../../src/panels/status";
import { WheelPanel } from "../../src/panels/wheel";
import { STATUS, page } from "../page";
import { openDocument } from "./document";

describe("the bar", () => {
  let made: ReturnType<typeof page>;
  const at = (id: string): HTMLButtonElement => document.getElementById(id) as HTMLButtonElement;
  beforeEach(() => {
    openDocument();
    made = page();
    new StatusBar(made.store, made.commands);
    new WheelPanel(made.store, made.commands);
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
});
