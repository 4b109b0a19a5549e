import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Forecasts, forecastText } from "../../src/preview/forecast";
import type { ForecastAnswer, Json } from "../../src/connection/protocol";

const ORDER = { edits: [{ translate: { features: ["a"], by: [1, 0, 0] } }] };
const FURTHER = { edits: [{ translate: { features: ["a"], by: [2, 0, 0] } }] };
const TOLD: ForecastAnswer["order"] = {
  outcome: "applied", shapes: 10, quality: { min: 0.2143, mean: 0.71, inverted: 0 }, seconds: { surface: 0.1, volume: 0.2, guard: 0.05 },
};

describe("a forecast", () => {
  let sent: Json[];
  let said: string[];
  let forecasts: Forecasts;

  beforeEach(() => {
    vi.useFakeTimers();
    sent = [];
    said = [];
    forecasts = new Forecasts((order) => `f${sent.push(order)}`, (tone, text) => said.push(`${tone}: ${text}`));
  });
  afterEach(() => { vi.useRealTimers(); });

  it("is asked for once the form rests, for the newest order alone", () => {
    forecasts.changed(ORDER);
    vi.advanceTimersByTime(100);
    forecasts.changed(FURTHER);
    forecasts.changed(FURTHER);
    vi.advanceTimersByTime(1000);
    expect(sent).toEqual([FURTHER]);
    expect(forecasts.inspect().state).toBe("waiting");
    forecasts.answer({ id: "f1", order: TOLD }, { min: 0.25 });
    expect(forecasts.inspect()).toMatchObject({ state: "told", outcome: "applied", min: 0.2143, inverted: 0 });
    expect(said.at(-1)).toMatch(/applied: Forecast: least quality 0\.214 \(now 0\.25\d*\).*0 inverted.*10 shapes/);
  });

  it("that was overtaken or taken back is not shown", () => {
    forecasts.changed(ORDER);
    vi.advanceTimersByTime(1000);
    forecasts.changed(FURTHER);
    forecasts.answer({ id: "f1", order: TOLD }, null);
    expect(forecasts.inspect().state).toBe("waiting");
    forecasts.changed(null);
    vi.advanceTimersByTime(1000);
    expect(sent).toHaveLength(1);
    expect(forecasts.inspect().state).toBe("none");
  });

  it("is asked for again when the shape has changed", () => {
    forecasts.outdated(ORDER);
    vi.advanceTimersByTime(1000);
    expect(sent).toHaveLength(0);
    forecasts.changed(ORDER);
    vi.advanceTimersByTime(1000);
    forecasts.outdated(ORDER);
    vi.advanceTimersByTime(1000);
    expect(sent).toEqual([ORDER, ORDER]);
  });

  it("that the server cannot take says why, and leaves other errors alone", () => {
    forecasts.changed(ORDER);
    vi.advanceTimersByTime(1000);
    expect(forecasts.refused("other", "no")).toBe(false);
    expect(forecasts.refused("f1", "there is no mesh")).toBe(true);
    expect(forecasts.inspect()).toMatchObject({ state: "failed", reason: "there is no mesh" });
  });

  it("says what would pass of an order that would not", () => {
    expect(forecastText({ outcome: "rejected", reason: "412 elements invert", fraction: 0.831 }, null)).toMatch(/rejected: 412 elements invert\. 83\.1 % of it would pass/);
    expect(forecastText({ ...TOLD, outcome: "clamped", fraction: 0.5 }, null)).toMatch(/clamped to 50/);
  });
});
