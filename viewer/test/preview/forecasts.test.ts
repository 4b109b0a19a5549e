import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import type { ForecastAnswer, Json } from "../../src/connection/protocol";
import { Forecasts } from "../../src/preview/forecasts";
import { page } from "../page";

const TOLD: ForecastAnswer["order"] = {
  outcome: "applied", shapes: 10, quality: { min: 0.2143, mean: 0.71, inverted: 0 }, seconds: { surface: 0.1, volume: 0.2, guard: 0.05 },
};

describe("a forecast", () => {
  let sent: { edits: Json[] }[];
  let withdrawn: number;
  let made: ReturnType<typeof page>;
  let forecasts: Forecasts;
  const ask = (x: number): void => made.store.dispatch({ type: "composed", key: "translate", values: { by: [x, 0, 0] }, step: "typed" });
  const asked = (): Json[] => sent.map(({ edits }) => (edits[0] as { translate: { by: Json } }).translate.by);
  const state = (): string => made.store.state.forecast.state;

  beforeEach(() => {
    vi.useFakeTimers();
    sent = [];
    made = page();
    made.store.dispatch({ type: "part", feature: "throat", part: "handle" });
    withdrawn = 0;
    forecasts = new Forecasts(made.store, {
      ask: (order) => `f${sent.push(order as { edits: Json[] })}`,
      withdraw: () => { withdrawn += 1; },
    });
  });
  afterEach(() => { vi.useRealTimers(); });

  it("is asked for once the form rests, for the newest order alone", () => {
    ask(1);
    vi.advanceTimersByTime(100);
    ask(2);
    ask(2);
    vi.advanceTimersByTime(1000);
    expect(asked()).toEqual([[2, 0, 0]]);
    expect(state()).toBe("waiting");
    forecasts.answer({ id: "f1", order: TOLD });
    expect(made.store.state.forecast).toMatchObject({ state: "told", answer: { outcome: "applied" } });
  });

  it("that was overtaken or taken back is not shown", () => {
    ask(1);
    vi.advanceTimersByTime(1000);
    ask(2);
    forecasts.answer({ id: "f1", order: TOLD });
    expect(state()).toBe("waiting");
    made.store.dispatch({ type: "cleared" });
    vi.advanceTimersByTime(1000);
    expect(sent).toHaveLength(1);
    expect(state()).toBe("none");
  });

  it("is given up where nobody wants to know any more, and not where its order was given", () => {
    ask(1);
    made.store.dispatch({ type: "cleared" });
    vi.advanceTimersByTime(1000);
    expect([sent.length, withdrawn]).toEqual([0, 0]);
    ask(1);
    vi.advanceTimersByTime(1000);
    ask(2);
    expect(withdrawn).toBe(0);
    vi.advanceTimersByTime(1000);
    made.store.dispatch({ type: "cleared" });
    expect(withdrawn).toBe(1);
    made.store.dispatch({ type: "cleared" });
    expect(withdrawn).toBe(1);
    for (const id of ["f1", "f2"]) forecasts.refused(id, "the client has withdrawn this forecast");
    made.store.dispatch({ type: "cleared" });
    expect(withdrawn).toBe(1);
    // Also one that was overtaken, before the next is asked for.
    ask(1);
    vi.advanceTimersByTime(1000);
    ask(2);
    made.store.dispatch({ type: "cleared" });
    expect(withdrawn).toBe(2);
    forecasts.refused("f3", "the client has withdrawn this forecast");
    ask(1);
    vi.advanceTimersByTime(1000);
    made.store.dispatch({ type: "order sent", id: "o", order: sent.at(-1)!, at: 0 });
    made.store.dispatch({ type: "cleared" });
    expect(withdrawn).toBe(2);
  });

  it("is given up where another order than its own was given", () => {
    ask(1);
    vi.advanceTimersByTime(1000);
    made.store.dispatch({ type: "order sent", id: "o1", order: { undo: 1 }, at: 0 });
    made.store.dispatch({ type: "cleared" });
    expect(withdrawn).toBe(1);
    forecasts.refused("f1", "the client has withdrawn this forecast");
    // What was given before its own forecast was asked for: the one that is under way is of what was overtaken.
    ask(2);
    vi.advanceTimersByTime(1000);
    ask(3);
    const { edits, ...settings } = sent.at(-1)!;
    made.store.dispatch({ type: "order sent", id: "o2", order: { edits: [{ translate: { features: ["throat"], fixed: [], by: [3, 0, 0] } }], ...settings }, at: 0 });
    made.store.dispatch({ type: "cleared" });
    expect([edits.length, withdrawn]).toEqual([1, 2]);
  });

  it("that was overtaken before it was begun is an error of which nothing is said", () => {
    ask(1);
    vi.advanceTimersByTime(1000);
    ask(2);
    vi.advanceTimersByTime(1000);
    expect(forecasts.refused("f1", "a later forecast has taken its place")).toBe(true);
    expect(state()).toBe("waiting");
    expect(forecasts.refused("f1", "once more")).toBe(false);
    forecasts.answer({ id: "f2", order: TOLD });
    expect(state()).toBe("told");
  });

  it("is asked for again when the shape has changed", () => {
    made.greet({ stack: [{ translate: { features: ["wall"], by: [9, 0, 0] } }] });
    vi.advanceTimersByTime(1000);
    expect(sent).toHaveLength(0);
    ask(1);
    vi.advanceTimersByTime(1000);
    made.greet({ stack: [] });
    vi.advanceTimersByTime(1000);
    expect(asked()).toEqual([[1, 0, 0], [1, 0, 0]]);
  });

  it("is not asked for by a watcher", () => {
    made.greet({ role: "watcher" });
    ask(1);
    vi.advanceTimersByTime(1000);
    expect(sent).toHaveLength(0);
    made.greet({ role: "driver" });
    vi.advanceTimersByTime(1000);
    expect(sent).toHaveLength(1);
  });

  it("that the server cannot take says why, and leaves other errors alone", () => {
    ask(1);
    vi.advanceTimersByTime(1000);
    expect(forecasts.refused("other", "no")).toBe(false);
    expect(forecasts.refused("f1", "there is no mesh")).toBe(true);
    expect(made.store.state.forecast).toMatchObject({ state: "failed", reason: "there is no mesh" });
  });
});
