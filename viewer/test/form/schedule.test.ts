// @vitest-environment jsdom
import { describe, expect, it } from "vitest";
import { ScheduleSummary, scheduleCurve, scheduleSentence } from "../../src/form/schedule";

describe("a schedule", () => {
  it("is one sentence", () => {
    expect(scheduleSentence({ steps: 10, every: { steps: 2 } })).toBe("10 shapes over 20 steps");
    expect(scheduleSentence({ steps: 1, every: { steps: 1 } })).toBe("In 1 shape, at once");
    expect(scheduleSentence({ steps: 4, every: { time: 0.5 } })).toBe("4 shapes over 2 of simulated time");
    expect(scheduleSentence(null)).toBe("Schedule");
  });

  it("is a curve of the way that is gone: even or eased, and in jumps where the mesh rests between shapes", () => {
    expect(scheduleCurve({ steps: 2, ease: "linear" })).toEqual({ points: [[0, 0], [0.5, 0.5], [1, 1]], label: "The shape goes evenly" });
    expect(scheduleCurve({ steps: 4, ease: "smooth", motion: "spread" })).toEqual({
      points: [[0, 0], [0.25, 0.15625], [0.5, 0.5], [0.75, 0.84375], [1, 1]], label: "The shape sets off and stops gently",
    });
    expect(scheduleCurve({ steps: 2, motion: "at_once" })).toEqual({ points: [[0, 0], [0, 0.5], [0.5, 0.5], [0.5, 1], [1, 1]], label: "The shape goes evenly, in jumps" });
    expect([scheduleCurve({ steps: 1 }), scheduleCurve(null), scheduleCurve({ steps: null })]).toEqual([null, null, null]);
    const { points } = scheduleCurve({ steps: 10000 })!;
    expect([points.length, points.at(-1)]).toEqual([41, [1, 1]]);
  });

  it("has the curve beside the sentence, with what it shows for those who do not see it", () => {
    const summary = new ScheduleSummary();
    const picture = summary.root.querySelector("svg")!;
    summary.show({ steps: 2, every: { steps: 3 }, ease: "smooth" });
    expect([summary.root.textContent.trim(), picture.getAttribute("role"), picture.getAttribute("aria-label"), picture.hasAttribute("hidden")])
      .toEqual(["2 shapes over 6 steps", "img", "The shape sets off and stops gently", false]);
    expect(picture.querySelector("polyline")!.getAttribute("points")).toBe("0.0,14.0 18.0,7.0 36.0,0.0");
    summary.show({ steps: 1, every: { steps: 1 } });
    expect(picture.hasAttribute("hidden")).toBe(true);
  });
});
