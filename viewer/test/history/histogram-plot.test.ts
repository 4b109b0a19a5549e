// @vitest-environment jsdom
import type uPlot from "uplot";
import { beforeEach, describe, expect, it, vi } from "vitest";
import { HistogramPlot } from "../../src/history/histogram-plot";
import { Earlier } from "../../src/picture/earlier";
import type { Content } from "../../src/picture/earlier";
import { page } from "../page";

/** Stands in for a plot, which needs a canvas. */
const made = vi.hoisted(() => [] as { data: uPlot.AlignedData; setData: ReturnType<typeof vi.fn>; destroy: ReturnType<typeof vi.fn>; redraw: ReturnType<typeof vi.fn> }[]);
vi.mock("uplot", () => ({
  default: class {
    static paths = { stepped: () => undefined };
    redraw = vi.fn();
    setData = vi.fn();
    destroy = vi.fn();
    constructor(_: unknown, readonly data: uPlot.AlignedData) { made.push(this); }
  },
}));

/** Two triangles, of which the second is three times as large. */
const content = (cycle: number, ...values: number[]): Content & { name: string } => ({
  name: "cut",
  topology: { kind: "topology", view: "cut", topology: "1", points: 6, triangles: Uint32Array.of(0, 1, 2, 3, 4, 5), triangleFeatures: null, lines: new Uint32Array(0) },
  frame: {
    kind: "data", view: "cut", topology: "1", cycle, time: cycle, points: Float32Array.of(0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 3, 0, 0, 0, 1, 0),
    fields: [{ name: "p", association: "element", components: 1, values: Float64Array.from(values) }],
  },
});

describe("the histogram", () => {
  let plot: HistogramPlot;
  let opened: ReturnType<typeof page>;
  let earlier: Earlier;
  let now: (Content & { name: string }) | null;
  const rows = (): (string | null)[][] => [...plot.body.querySelectorAll("tbody tr")].map((row) => [...row.querySelectorAll("th, td")].map(({ textContent }) => textContent));
  const heading = (): string | null => plot.tools[0]!.textContent;
  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal("ResizeObserver", class { observe(): void { /* Nothing changes its size here. */ } });
    made.length = 0;
    opened = page({ views: [{ name: "cut", kind: "slice" }], fields: [{ name: "p", association: "element", components: 1 }] });
    now = content(4, 1, 5);
    earlier = new Earlier(opened.store, () => (now ? [now] : []), () => undefined);
    plot = new HistogramPlot(opened.store, { content: () => now, title: ({ field }) => `${field} [Pa]` }, earlier);
    document.body.replaceChildren(plot.body);
    opened.store.dispatch({ type: "carries", view: "cut", fields: [{ name: "p", association: "element", components: 1 }] });
    opened.store.dispatch({ type: "look", view: "cut", look: { field: "p" } });
    opened.store.dispatch({ type: "view chosen", view: "cut" });
    return () => {
      vi.useRealTimers();
      vi.unstubAllGlobals();
    };
  });

  it("is empty before a picture has come, and draws nothing while it is not seen", () => {
    expect(plot.isEmpty).toBe(true);
    opened.store.dispatch({ type: "frame", view: "cut", cycle: 4 });
    expect(plot.isEmpty).toBe(false);
    plot.update();
    vi.runAllTimers();
    expect([made.length, rows()]).toEqual([0, []]);
  });

  it("has the values by area over the range of both moments, with their least, mean and largest", () => {
    earlier.keepNow();
    now = content(8, 3, 9);
    plot.show(true);
    expect([heading(), rows()]).toEqual(["p [Pa] on cut · cycle 8", [["now", "3", "7.5", "9"], ["at cycle 4", "1", "4", "5"]]]);
    const [edges, after, before] = made[0]!.data as number[][];
    expect([edges!.length, edges![0], edges!.at(-1)]).toEqual([49, 1, 9]);
    const parts = (column: number[]): [number, number][] => column.slice(0, -1).flatMap((part, i): [number, number][] => (part > 0 ? [[edges![i]!, part]] : []));
    expect(parts(after!)).toEqual([[3, 25], [expect.closeTo(9 - 8 / 48, 9), 75]]);
    expect(parts(before!).map(([, part]) => part)).toEqual([25, 75]);
    expect(after!.at(-1)).toBe(75);
  });

  it("follows values at its own pace, and is drawn no more once another tab is seen", () => {
    plot.show(true);
    for (const cycle of [5, 6, 7]) {
      now = content(cycle, cycle, 9);
      plot.update();
    }
    expect(heading()).toContain("cycle 4");
    vi.advanceTimersByTime(600);
    expect([heading(), made[0]!.setData.mock.calls.length, made.length]).toEqual(["p [Pa] on cut · cycle 7", 1, 1]);
    now = content(8, 1, 2);
    plot.update();
    plot.show(false);
    vi.runAllTimers();
    expect(heading()).toContain("cycle 7");
    plot.recolour();
    expect(made[0]!.redraw).toHaveBeenCalledOnce();
  });

  it("says where there is nothing to be counted, and has no plot of one value alone", () => {
    plot.show(true);
    opened.store.dispatch({ type: "look", view: "cut", look: { field: null } });
    vi.runAllTimers();
    expect([heading(), rows(), made[0]!.destroy.mock.calls.length]).toEqual(["the chosen view is not coloured by a field", [], 1]);
    now = content(9, 2, 2);
    opened.store.dispatch({ type: "look", view: "cut", look: { field: "p" } });
    vi.runAllTimers();
    expect([rows(), made.length]).toEqual([[["now", "2", "2", "2"]], 1]);
  });
});
