// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { ParameterPanel } from "../../src/panels/parameters";
import { page } from "../page";
import { openDocument } from "./document";

const inflow = (value: number) => ({ name: "inflow_speed", value, minimum: 0, maximum: 20 });

describe("the parameters", () => {
  let made: ReturnType<typeof page>;
  let panel: ParameterPanel;
  const input = (): HTMLInputElement => document.querySelector<HTMLInputElement>('[data-parameter="inflow_speed"]')!;
  const wrong = (): HTMLElement => document.querySelector<HTMLElement>("#parameters .wrong")!;
  const set = (text: string): void => {
    input().value = text;
    input().dispatchEvent(new Event("change"));
  };
  beforeEach(() => {
    openDocument();
    made = page({ parameters: [inflow(10)] });
    panel = new ParameterPanel(document.getElementById("parameters")!, made.store, made.commands);
  });

  it("say beside them what is wrong, and send nothing then", () => {
    set("fast");
    expect([wrong().hidden, wrong().textContent]).toEqual([false, "inflow speed “fast” is not a number"]);
    set("30");
    expect(wrong().textContent).toBe("inflow speed must be at most 20");
    expect(made.sent).toEqual([]);
    set("12");
    expect(wrong().hidden).toBe(true);
    expect(made.sent[0]).toMatchObject({ parameter: { name: "inflow_speed", value: 12 } });
  });

  it("say beside them what the simulation refuses, and leave other errors alone", () => {
    set("12");
    expect(panel.refused("other", "no")).toBe(false);
    expect(panel.refused(String(made.sent[0]!.id), "the journal cannot be written")).toBe(true);
    expect(wrong().textContent).toBe("the journal cannot be written");
  });

  it("follow the simulation, but not under a hand", () => {
    made.greet({ parameters: [inflow(11)] });
    expect(input().value).toBe("11");
    input().focus();
    input().value = "1";
    made.greet({ parameters: [inflow(14)] });
    expect(input().value).toBe("1");
  });

  const reconnect = (value: number): void => {
    made.store.dispatch({ type: "connection", state: "reconnecting", explanation: "" });
    made.store.dispatch({ type: "connection", state: "connected", explanation: "" });
    made.greet({ parameters: [inflow(value)] });
  };

  it("show what the run has where an answer was lost with the connection, and say so", () => {
    set("12");
    reconnect(10);
    expect([input().value, wrong().textContent]).toEqual(["10", "The connection was lost before 12 was confirmed; the run has 10."]);
    expect(panel.refused(String(made.sent[0]!.id), "no")).toBe(false);
    // The run had it all the same.
    made.greet({ parameters: [inflow(12)] });
    expect([input().value, wrong().hidden]).toEqual(["12", true]);
    set("13");
    reconnect(13);
    expect([input().value, wrong().hidden]).toEqual(["13", true]);
  });

  it("say nothing of a connection that was lost after the answer", () => {
    set("12");
    made.greet({ parameters: [inflow(12)] });
    panel.done(String(made.sent[0]!.id));
    reconnect(10);
    expect([input().value, wrong().hidden]).toEqual(["10", true]);
    set("10");
    panel.done(String(made.sent[1]!.id));
    reconnect(11);
    expect([input().value, wrong().hidden]).toEqual(["11", true]);
  });

  it("show what the run has once the focus has left them", () => {
    input().focus();
    made.greet({ parameters: [inflow(14)] });
    expect(input().value).toBe("10");
    input().blur();
    expect(input().value).toBe("14");
    // What is on its way stays, and so does what is wrong, beside the reason.
    input().focus();
    set("15");
    input().blur();
    expect(input().value).toBe("15");
    input().focus();
    set("30");
    input().blur();
    expect([input().value, wrong().hidden]).toEqual(["30", false]);
  });

  it("show what another viewer has set while one's own message was on its way", () => {
    input().focus();
    set("12");
    made.greet({ parameters: [inflow(14)] });
    input().blur();
    expect(input().value).toBe("12");
    panel.done(String(made.sent[0]!.id));
    expect(input().value).toBe("14");
  });

  it("leave one alone that is on its way, where another is changed", () => {
    const other = (value: number) => ({ name: "other", value });
    made.greet({ parameters: [inflow(10), other(1)] });
    set("12");
    made.greet({ parameters: [inflow(10), other(2)] });
    expect(input().value).toBe("12");
  });

  const slider = (): HTMLInputElement => document.querySelector<HTMLInputElement>('#parameters input[type="range"]')!;
  const slideTo = (part: number, ...events: string[]): void => {
    slider().value = String(Math.round(part * Number(slider().max)));
    for (const event of events) slider().dispatchEvent(new Event(event));
  };

  it("have a slider between their bounds, which sends once it is let go", () => {
    expect(slider().getAttribute("aria-label")).toBe("inflow speed, slider");
    expect(Number(slider().value) / Number(slider().max)).toBe(0.5);
    slideTo(0.3, "input");
    expect([input().value, slider().getAttribute("aria-valuetext"), made.sent]).toEqual(["6", "6", []]);
    // Nothing is written under the hand.
    made.greet({ parameters: [inflow(14)] });
    expect([input().value, slider().value]).toEqual(["6", "60"]);
    slideTo(0.25, "input", "change");
    expect(made.sent).toMatchObject([{ parameter: { name: "inflow_speed", value: 5 } }]);
    panel.refused(String(made.sent[0]!.id), "the journal cannot be written");
    expect(wrong().textContent).toBe("the journal cannot be written");
    // It goes where the number goes.
    set("20");
    expect(slider().value).toBe(slider().max);
    made.greet({ parameters: [inflow(0)] });
    expect([input().value, slider().value]).toEqual(["0", "0"]);
  });

  it("have a slider by powers of ten where the bounds are far apart, and none without bounds", () => {
    made.greet({ parameters: [{ name: "viscosity", value: 0.01, minimum: 1e-4, maximum: 1 }] });
    expect(Number(slider().value) / Number(slider().max)).toBe(0.5);
    slideTo(0.25, "change");
    slideTo(1, "change");
    expect(made.sent.map(({ parameter }) => (parameter as { value: number }).value)).toEqual([0.001, 1]);
    made.greet({ parameters: [{ name: "viscosity", value: 0.01, minimum: 0 }] });
    expect(document.querySelectorAll("#parameters input").length).toBe(1);
  });

  it("have none where the way from one bound to the other is no number", () => {
    made.greet({ parameters: [{ name: "source", value: 1, minimum: -1e308, maximum: 1e308 }] });
    expect([document.querySelectorAll('#parameters input[type="range"]').length, document.querySelectorAll("#parameters input").length]).toEqual([0, 1]);
  });

  it("follow the simulation again once the slider is let go where it began, by pointer or key, or left", () => {
    let value = 10;
    for (const end of ["pointerup", "keyup", "pointercancel", "blur"]) {
      const began = Number(slider().value) / Number(slider().max);
      slideTo(0.75, "input");
      slideTo(end === "blur" || end === "pointercancel" ? 0.75 : began, "input", end);
      expect(input().value, end).toBe(String(value));
      made.greet({ parameters: [inflow(++value)] });
      expect([input().value, slider().value], end).toEqual([String(value), String(10 * value)]);
    }
    // Let go elsewhere it sends where it is, also where it hears of the pointer first.
    slideTo(0.25, "input", "pointerup", "change");
    expect(made.sent).toMatchObject([{ parameter: { name: "inflow_speed", value: 5 } }]);
    // Back where it was sent from: what is on its way stays.
    slideTo(0.5, "input");
    slideTo(0.25, "input", "pointerup");
    expect([input().value, made.sent.length]).toEqual(["5", 1]);
  });

  it("show what the run has where the wheel is lost under the hand", () => {
    slideTo(0.75, "input");
    made.greet({ role: "watcher", may_drive: false, parameters: [inflow(10)] });
    expect([input().value, slider().value]).toEqual(["10", "100"]);
    made.greet({ parameters: [inflow(12)] });
    expect([input().value, slider().value]).toEqual(["12", "120"]);
  });

  it("are off for a watcher, with the reason", () => {
    made.greet({ role: "watcher", may_drive: false });
    for (const control of [input(), slider()]) expect([control.disabled, control.title]).toEqual([true, "This link is for watching only."]);
  });
});
