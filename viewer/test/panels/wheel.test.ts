// @vitest-environment jsdom
import { beforeEach, describe, expect, it, vi } from "vitest";
import { WheelPanel } from "../../src/panels/wheel";
import { STATUS, page } from "../page";
import { openDocument } from "./document";

describe("the wheel", () => {
  let made: ReturnType<typeof page>;
  let panel: WheelPanel;
  const at = (id: string): HTMLButtonElement => document.getElementById(id) as HTMLButtonElement;
  const last = (): unknown => made.sent.at(-1);
  /** The page of one who watches while another steers, or of that one. */
  const open = (role: "driver" | "watcher"): void => {
    openDocument();
    made = page({ role });
    made.store.dispatch({ type: "status", status: { ...STATUS, driver: role === "driver" ? "c1" : "c4" }, at: 0 });
    panel = new WheelPanel(made.store, made.commands);
  };
  beforeEach(() => {
    vi.useFakeTimers();
    return () => vi.useRealTimers();
  });

  describe("of one who watches", () => {
    beforeEach(() => open("watcher"));

    it("is asked for", () => {
      expect(at("wheel").hidden).toBe(false);
      at("wheel").click();
      expect(last()).toMatchObject({ drive: {} });
    });

    it("is offered to nobody who steers, may not, or has no run to steer", () => {
      made.greet({ role: "driver" });
      expect(at("wheel").hidden).toBe(true);
      made.greet({ role: "watcher", may_drive: false });
      expect(at("wheel").hidden).toBe(true);
      made.greet({ role: "watcher", may_drive: true });
      expect(at("wheel").hidden).toBe(false);
      made.store.dispatch({ type: "connection", state: "reconnecting", explanation: "" });
      expect(at("wheel").hidden).toBe(true);
      made.store.dispatch({ type: "connection", state: "connected", explanation: "" });
      made.store.dispatch({ type: "end", end: { how: "finished", cycle: 9, time: 0.9 } });
      expect(at("wheel").hidden).toBe(true);
    });

    it("is waited for in quiet words: of this question alone, for a minute, and until somebody else has it", () => {
      const now = (driver: string): void => made.store.dispatch({ type: "status", status: { ...STATUS, driver }, at: 0 });
      const waiting = (): string | null => (at("waiting").hidden ? null : at("waiting").textContent);
      const asked = (): string => {
        at("wheel").click();
        return String(made.sent.at(-1)!.id);
      };
      asked();
      expect([panel.told("another", "c4 steers"), waiting()]).toEqual([false, null]);
      expect([panel.told(asked(), "c4 steers, and was asked"), waiting(), made.store.state.refusal]).toEqual([true, "c4 steers, and was asked.", ""]);
      vi.advanceTimersByTime(59_000);
      now("c4");
      expect(waiting()).not.toBeNull();
      vi.advanceTimersByTime(1_000);
      expect(waiting()).toBeNull();
      panel.told(asked(), "c4 steers, and was asked");
      now("c5");
      expect(waiting()).toBeNull();
      panel.told(asked(), "c5 steers, and was asked");
      made.greet({ role: "driver" });
      expect(waiting()).toBeNull();
    });

    it("is kept, and it says so in the place of waiting", () => {
      panel.kept({ by: "c4" });
      expect(at("waiting").hidden).toBe(true);
      at("wheel").click();
      panel.told(String(made.sent.at(-1)!.id), "c4 steers, and was asked");
      made.store.dispatch({ type: "people", viewers: [{ client: "c4", name: "Anna", role: "driver", may_drive: true }] });
      panel.kept({ by: "c4", name: "Anna" });
      expect([at("waiting").hidden, at("waiting").textContent]).toEqual([false, "Anna (c4) keeps the wheel."]);
      made.greet({ role: "driver" });
      panel.kept({ by: "c4" });
      expect(at("waiting").hidden).toBe(true);
    });

    it("is kept, or waited for, in words over the picture, which no drawer of a narrow page hides", () => {
      at("wheel").click();
      panel.kept({ by: "c4" });
      const words = at("waiting");
      expect([words.textContent, words.getAttribute("role")]).toEqual(["Viewer c4 keeps the wheel.", "status"]);
      expect([words.closest("aside"), words.closest("#stage")]).toEqual([null, at("stage")]);
    });

    it("is not told that somebody is there", () => {
      window.dispatchEvent(new Event("pointermove"));
      expect(made.sent).toEqual([]);
    });
  });

  describe("of the one who steers", () => {
    beforeEach(() => {
      open("driver");
      made.store.dispatch({ type: "people", viewers: [{ client: "c4", name: "Anna", role: "watcher", may_drive: true }] });
      made.store.dispatch({ type: "wheel asked", by: "c4" });
    });

    it("is handed over or kept, or the one who asks is sent away: each answers", () => {
      expect([at("asked").hidden, at("asked-text").textContent]).toEqual([false, "Anna (c4) asks to steer."]);
      for (const [button, message] of [["hand-over", { hand_over: { to: "c4" } }], ["keep", { keep: {} }], ["dismiss", { kick: { client: "c4" } }]] as const) {
        made.store.dispatch({ type: "wheel asked", by: "c4" });
        expect(at("asked").hidden, button).toBe(false);
        at(button).click();
        expect(last(), button).toMatchObject(message);
        expect(at("asked").hidden, button).toBe(true);
      }
    });

    it("is asked for by those without a name under their number", () => {
      made.store.dispatch({ type: "wheel asked", by: "c5" });
      expect(at("asked-text").textContent).toBe("Viewer c5 asks to steer.");
    });

    it("is no question any more once another has it", () => {
      made.greet({ role: "watcher" });
      expect(at("asked").hidden).toBe(true);
      const { length } = made.sent;
      at("hand-over").click();
      expect(made.sent).toHaveLength(length);
    });

    it("has the simulation told that somebody is there, every ten seconds at most", () => {
      const signs = (): number => made.sent.filter((message) => "here" in message).length;
      const before = signs();
      for (const kind of ["pointermove", "pointerdown", "wheel", "keydown"]) window.dispatchEvent(new Event(kind));
      expect(signs()).toBe(before + 1);
      vi.advanceTimersByTime(9_000);
      window.dispatchEvent(new Event("keydown"));
      expect(signs()).toBe(before + 1);
      vi.advanceTimersByTime(1_500);
      window.dispatchEvent(new Event("keydown"));
      expect(signs()).toBe(before + 2);
    });
  });
});
