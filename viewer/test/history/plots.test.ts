// @vitest-environment jsdom
import type uPlot from "uplot";
import { beforeEach, describe, expect, it, vi } from "vitest";
import { Dock } from "../../src/history/dock";
import { HistoryPlot } from "../../src/history/plot";
import { History } from "../../src/history/series";

/** Stands in for a plot, which needs a canvas. */
const made = vi.hoisted(() => [] as { options: uPlot.Options; redraw: () => void }[]);
vi.mock("uplot", () => ({
  default: class {
    redraw = vi.fn();
    setData = vi.fn();
    setScale = vi.fn();
    constructor(readonly options: uPlot.Options) { made.push(this); }
  },
}));

beforeEach(() => {
  made.length = 0;
  vi.stubGlobal("ResizeObserver", class { observe(): void { /* Nothing changes its size here. */ } });
  document.body.replaceChildren();
  return () => vi.unstubAllGlobals();
});

describe("the plots below the picture", () => {
  it("take the colours of the page at once", () => {
    const history = new History();
    for (const cycle of [1, 2]) history.add("health", cycle, cycle, { "quality.min": 0.5 });
    const root = document.createElement("div");
    document.body.append(root);
    const dock = new Dock(root, true, () => undefined, (work) => work());
    dock.add(new HistoryPlot(history, null, () => undefined));
    const [{ options, redraw }] = made as [typeof made[0]];
    const colours = (): unknown[] => (options.axes ?? []).flatMap(({ stroke, grid, ticks }) => [stroke, grid?.stroke, ticks?.stroke].map((one) => (typeof one === "function" ? (one as () => unknown)() : one)));
    for (const [theme, line, soft] of [["dark", "#333", "#aaa"], ["light", "#ddd", "#555"]] as const) {
      document.body.style.setProperty("--line", line);
      document.body.style.setProperty("--soft", soft);
      document.body.style.setProperty("--plot-1", soft);
      expect(colours(), theme).toEqual([soft, line, line, soft, line, line]);
      expect((options.series[1]!.stroke as () => unknown)()).toBe(soft);
    }
    expect(redraw).not.toHaveBeenCalled();
    dock.recolour();
    expect(redraw).toHaveBeenCalledOnce();
  });
});
