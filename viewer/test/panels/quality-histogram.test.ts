// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import type { ForecastAnswer, QualitySummary } from "../../src/connection/protocol";
import { QualityHistogram, barHeight, qualityClasses } from "../../src/panels/quality-histogram";
import { page } from "../page";
import { openDocument } from "./document";

const BEFORE: QualitySummary = { min: 0.3, histogram: [0, 0, 0, 2, 8] };
const AFTER: QualitySummary = { min: -0.1, histogram: [0, 0, 1, 3, 6] };
const PASSES: ForecastAnswer["order"] = { outcome: "applied", quality: AFTER, quality_before: BEFORE };

describe("cells by quality", () => {
  it("begins with the worst class that has a cell", () => {
    const classes = qualityClasses(BEFORE, AFTER);
    expect(classes.map(({ before, after }) => [before, after])).toEqual([[0, 1], [2, 3], [8, 6]]);
    expect(classes[0]!.from).toBeCloseTo(-0.2);
    expect(classes.at(-1)!.to).toBeCloseTo(1);
  });

  it("is empty where one is not told, has no cell or other classes", () => {
    expect(qualityClasses(BEFORE, { min: 0.1 })).toEqual([]);
    expect(qualityClasses(null, AFTER)).toEqual([]);
    expect(qualityClasses(BEFORE, { min: 0.1, histogram: [1, 2] })).toEqual([]);
    expect(qualityClasses({ min: 1, histogram: [0, 0] }, { min: 1, histogram: [0, 0] })).toEqual([]);
  });

  it("shows one cell beside a million", () => {
    expect(barHeight(0, 1e6)).toBe(0);
    expect(barHeight(1, 1e6)).toBeGreaterThan(0.04);
    expect(barHeight(1e6, 1e6)).toBe(1);
  });
});

describe("the chart in the details of a forecast", () => {
  let made: ReturnType<typeof page>;
  const chart = (): HTMLElement => document.getElementById("quality-histogram")!;
  beforeEach(() => {
    openDocument();
    made = page();
    new QualityHistogram(made.store);
  });

  it("has a bar for each class before and after, and says what it shows", () => {
    expect(chart().hidden).toBe(true);
    made.store.dispatch({ type: "forecast told", answer: PASSES });
    expect(chart().hidden).toBe(false);
    const bars = [...chart().querySelectorAll("rect")];
    expect(bars.map((bar) => bar.getAttribute("class"))).toEqual(["before", "after", "before", "after", "before", "after"]);
    expect(bars[1]!.textContent).toBe("scaled Jacobian −0.2 to 0.2: 0 cells before, 1 after");
    expect(Number(bars[0]!.getAttribute("height"))).toBe(0);
    expect(Number(bars[4]!.getAttribute("height"))).toBe(60);
    expect(chart().querySelector("svg")!.getAttribute("aria-label")).toContain("0.2 to 0.6, 2 and 3");
  });

  it("stays while the next forecast is computed, and goes with the order", () => {
    made.store.dispatch({ type: "forecast told", answer: PASSES });
    made.store.dispatch({ type: "forecast asked" });
    expect(chart().hidden).toBe(false);
    made.store.dispatch({ type: "forecast told", answer: { outcome: "rejected", reason: "cell 1" } });
    expect(chart().hidden).toBe(true);
    made.store.dispatch({ type: "forecast told", answer: PASSES });
    made.store.dispatch({ type: "forecast cleared" });
    expect(chart().hidden).toBe(true);
  });
});
