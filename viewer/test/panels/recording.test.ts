// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { parseServerMessage } from "../../src/connection/protocol";
import type { OrderStatus, PinnedNote, Played } from "../../src/connection/protocol";
import { RecordingPanel } from "../../src/panels/recording";
import { appliedOrders, isShapeUnderWay } from "../../src/store/orders";
import { whyNotSteering } from "../../src/store/run";
import { page } from "../page";
import { openDocument } from "./document";

const recording = { first: { seconds: 0, cycle: 0, time: 0 }, last: { seconds: 60, cycle: 600, time: 6 } };
const played = (more: Partial<Played>): Played => ({ seconds: 12, cycle: 120, time: 1.2, speed: 1, paused: false, at_end: false, ...more });

describe("the slider of a recording", () => {
  let made: ReturnType<typeof page>;
  const panel = (): HTMLElement => document.getElementById("recording")!;
  const slider = (): HTMLInputElement => document.querySelector<HTMLInputElement>("#moment")!;
  const button = (): HTMLButtonElement => document.querySelector<HTMLButtonElement>("#play")!;
  beforeEach(() => {
    openDocument();
    made = page();
    new RecordingPanel(made.store, made.commands);
  });

  it("is there for a recording alone", () => {
    expect(panel().hidden).toBe(true);
    made.greet({ recording });
    expect([panel().hidden, slider().min, slider().max]).toEqual([false, "0", "60"]);
    expect(whyNotSteering(made.store.state)).toContain("recording");
  });

  it("shows the moment, and does not move in somebody's hand", () => {
    made.greet({ recording });
    made.store.dispatch({ type: "played", played: played({}) });
    expect([slider().value, document.getElementById("moment-text")!.textContent]).toEqual(["12", "cycle 120, time 1.2"]);
    slider().value = "30";
    slider().dispatchEvent(new Event("input"));
    made.store.dispatch({ type: "played", played: played({ seconds: 13 }) });
    expect(slider().value).toBe("30");
    slider().dispatchEvent(new Event("change"));
    expect(made.sent.at(-1)).toMatchObject({ play: { seek: { seconds: 30 } } });
    made.store.dispatch({ type: "played", played: played({ seconds: 31 }) });
    expect(slider().value).toBe("31");
  });

  it("stays as wide as it is, whatever moment it shows", () => {
    made.greet({ recording });
    const room = Number.parseInt(document.getElementById("moment-text")!.style.minWidth);
    for (const moment of [{ cycle: 0, time: 0 }, { cycle: 7, time: 0.0012345678 }, { cycle: 600, time: 12345.6 }, { cycle: 600, time: 0.000123456 }]) {
      made.store.dispatch({ type: "played", played: played(moment) });
      expect(document.getElementById("moment-text")!.textContent.length).toBeLessThanOrEqual(room);
    }
  });

  it("is let go of with the pointer, also where a drag ends as it began", () => {
    made.greet({ recording });
    for (const [end, bubbles] of [["pointerup", true], ["pointercancel", true], ["blur", false]] as const) {
      made.store.dispatch({ type: "played", played: played({}) });
      const sent = made.sent.length;
      for (const value of ["30", "12"]) {
        slider().value = value;
        slider().dispatchEvent(new Event("input"));
      }
      made.store.dispatch({ type: "played", played: played({ seconds: 30 }) });
      expect(slider().value, end).toBe("12");
      slider().dispatchEvent(new Event(end, { bubbles }));
      // The place where it was let go of is asked for, and once.
      expect(made.sent.at(-1), end).toMatchObject({ play: { seek: { seconds: 12 } } });
      slider().dispatchEvent(new Event("change"));
      expect(made.sent.length - sent, end).toBeLessThanOrEqual(2);
      made.store.dispatch({ type: "played", played: played({ seconds: 13 }) });
      expect(slider().value, end).toBe("13");
    }
  });

  it("pauses, goes on, and begins again at the end", () => {
    made.greet({ recording });
    made.store.dispatch({ type: "played", played: played({}) });
    button().click();
    expect(made.sent.at(-1)).toMatchObject({ play: { paused: true } });
    made.store.dispatch({ type: "played", played: played({ paused: true }) });
    expect(button().textContent).toBe("Play");
    button().click();
    expect(made.sent.at(-1)).toMatchObject({ play: { paused: false } });
    made.store.dispatch({ type: "played", played: played({ seconds: 60, at_end: true }) });
    expect(button().textContent).toBe("Again");
    button().click();
    expect(made.sent.at(-1)).toMatchObject({ play: { seek: { seconds: 0 }, paused: false } });
    const speed = document.querySelector<HTMLSelectElement>("#speed")!;
    speed.value = "16";
    speed.dispatchEvent(new Event("change"));
    expect(made.sent.at(-1)).toMatchObject({ play: { speed: 16 } });
  });

  it("goes where no note is looked for any more", () => {
    const gap: PinnedNote = { number: 2, text: "the gap", at: [0, 0, 0], cycle: 80, by: "Anna" };
    const numbers = (): number[] => made.store.state.notes.map(({ number }) => number);
    made.greet({ recording, notes: [] });
    const goOn = (): void => {
      made.store.dispatch({ type: "played", played: played({ at_end: true }) });
      button().click();
    };
    const drag = (): void => {
      slider().dispatchEvent(new Event("input"));
      slider().dispatchEvent(new Event("change"));
    };
    for (const go of [drag, goOn]) {
      made.store.dispatch({ type: "note sought", note: gap });
      made.greet({ recording, notes: [] });
      expect(numbers()).toEqual([2]);
      go();
      made.greet({ recording, notes: [] });
      expect(numbers(), go.name).toEqual([]);
    }
  });

  it("shows the speed at which it goes on, also after the connection came back", () => {
    const speed = document.querySelector<HTMLSelectElement>("#speed")!;
    made.greet({ recording });
    speed.value = "4";
    speed.dispatchEvent(new Event("change"));
    made.store.dispatch({ type: "played", played: played({ speed: 4 }) });
    expect(speed.value).toBe("4");
    made.store.dispatch({ type: "played", played: played({ speed: 1 }) });
    expect(speed.value).toBe("1");
  });

  it("leaves nothing of the future where it goes back", () => {
    const order = (id: string, status: "applied" | "applying", cycle: number): OrderStatus => ({ id, status, cycle_applied: cycle, order: { undo: 1 } });
    const done = order("o1", "applied", 5);
    made.greet({ recording, orders: [done] });
    for (const view of ["a", "b"]) made.store.dispatch({ type: "frame", view, cycle: 500 });
    made.store.dispatch({ type: "order", status: order("o2", "applying", 490) });
    expect([isShapeUnderWay(made.store.state.orders), appliedOrders(made.store.state).map(({ cycle }) => cycle)]).toEqual([true, [5, 490]]);
    made.greet({ recording, orders: [done] });
    expect([isShapeUnderWay(made.store.state.orders), appliedOrders(made.store.state).map(({ cycle }) => cycle)]).toEqual([false, [5]]);
    made.store.dispatch({ type: "frame", view: "a", cycle: 10 });
    expect(made.store.state.frames).toMatchObject({ count: 3, cycle: 10 });
    made.store.dispatch({ type: "frame", view: "b", cycle: 8 });
    expect(made.store.state.frames.cycle).toBe(10);
  });

  it("is told by a message of its own", () => {
    expect(parseServerMessage(JSON.stringify({ play: played({}) }))).toEqual({ kind: "play", body: played({}) });
  });
});
