// @vitest-environment jsdom
import type uPlot from "uplot";
import { beforeEach, describe, expect, it, vi } from "vitest";
import { Dock } from "../../src/history/dock";
import { HistoryPlot } from "../../src/history/plot";
import { labelled, padded } from "../../src/history/plotting";
import { History, seriesKey } from "../../src/history/series";

/** Stands in for a plot, which needs a canvas. */
interface Made { options: uPlot.Options; data: uPlot.AlignedData; redraw: () => void; setScale: ReturnType<typeof vi.fn>; setCursor: ReturnType<typeof vi.fn> }
const made = vi.hoisted(() => [] as Made[]);
vi.mock("uplot", () => ({
  default: class {
    redraw = vi.fn();
    setData = vi.fn();
    setScale = vi.fn();
    setCursor = vi.fn();
    over = { clientWidth: 400, clientHeight: 100 };
    destroy = vi.fn();
    constructor(readonly options: uPlot.Options, readonly data: uPlot.AlignedData) { made.push(this); }
  },
}));

beforeEach(() => {
  made.length = 0;
  vi.stubGlobal("ResizeObserver", class { observe(): void { /* Nothing changes its size here. */ } });
  document.body.replaceChildren();
  return () => vi.unstubAllGlobals();
});

const texts = (plot: HistoryPlot, selector: string): (string | null)[] => [...plot.body.querySelectorAll(selector)].map(({ textContent }) => textContent);

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

  it("have axes as wide as their labels, which are long where the range is small", () => {
    const history = new History();
    for (const cycle of [1, 2]) history.add("health", cycle, cycle, { "quality.min": 0.5 });
    new HistoryPlot(history, null, () => undefined).show(true);
    const { size, values } = made[0]!.options.axes![1]! as unknown as { size: (...of: unknown[]) => number; values: (plot: null, ticks: number[]) => string[] };
    const plot = { ctx: { font: "", measureText: (text: string) => ({ width: 6 * text.length }) }, axes: [{}, { font: ["11px sans-serif", 11], ticks: { size: 10 }, gap: 5 }] };
    expect([size(plot, null, 1, 0), size(plot, values(null, [0, 1, 2]), 1, 1)]).toEqual([58, 58]);
    expect(plot.ctx.font).toBe("11px sans-serif");
    const labels = values(null, [101325.0001, 101325.0002, 101325.0003]);
    expect(labels).toEqual(["101325.0001", "101325.0002", "101325.0003"]);
    expect(size(plot, labels, 1, 2)).toBe(81);
  });

  it("show no smaller part of values than their labels can tell apart", () => {
    const of = (low: number, high: number): number[] => padded(null as never, low, high);
    const [low, high] = of(101325, 101325 + 1e-10) as [number, number];
    expect((high - low) / 101325).toBeCloseTo(1e-9, 12);
    const ticks = [0, 1, 2, 3, 4].map((i) => low + ((high - low) * i) / 4);
    expect(new Set(labelled(null as never, ticks)).size).toBe(5);
    expect(of(1, 2)).toEqual([0.94, 2.06]);
    expect([of(0, 0), of(-4, -4)]).toEqual([[-1, 1], [-4.4, -3.6]]);
  });

  it("break where a monitor has said what is no number, and go on where only another has spoken", () => {
    const history = new History();
    for (const [cycle, p] of [[1, 2], [2, NaN], [4, 3]] as const) history.add("a", cycle, cycle, { p });
    history.add("b", 3, 3, { q: 1 });
    const plot = new HistoryPlot(history, [seriesKey("a", "p"), seriesKey("b", "q")], () => undefined);
    document.body.append(plot.body);
    plot.show(true);
    const [{ options, data }] = made as [typeof made[0]];
    expect(options.series.map(({ spanGaps }) => spanGaps ?? false)).toEqual([false, false, false]);
    expect(data).toEqual([[1, 2, 3, 4], [2, null, undefined, 3], [undefined, undefined, 1, undefined]]);
  });

  it("show what is seen at first where nothing is there of what was chosen, and nothing where that was wished", () => {
    const history = new History();
    for (const cycle of [1, 2]) history.add("flow", cycle, cycle, { drop: 0.5, other: 1 });
    const drawn = (picked: string[]): (string | undefined)[] => {
      made.length = 0;
      new HistoryPlot(history, picked, () => undefined).show(true);
      return made.flatMap(({ options }) => options.series.slice(1).map(({ label }) => label as string));
    };
    expect(drawn([seriesKey("gone", "x")])).toEqual(["drop"]);
    expect(drawn([seriesKey("gone", "x"), seriesKey("flow", "other")])).toEqual(["other"]);
    expect(drawn([])).toEqual([]);
  });

  it("keep no pins, which are not of the run", () => {
    const history = new History();
    const pin = seriesKey("probe 1, pressure", "pressure"), drop = seriesKey("flow", "drop");
    for (const [source, name] of [["flow", "drop"], ["probe 1, pressure", "pressure"]] as const) history.add(source, 1, 1, { [name]: 1 });
    const kept: (readonly string[] | null)[] = [];
    const plot = new HistoryPlot(history, null, (chosen) => { kept.push(chosen); });
    plot.choose(pin);
    document.body.append(plot.body);
    new HistoryPlot(history, [], (chosen) => { kept.push(chosen); }).choose(pin);
    // The monitors stay those that were chosen.
    expect(kept).toEqual([]);
    plot.show(true);
    expect(made[0]!.options.series.slice(1).map(({ label }) => label)).toEqual(["drop", "pressure"]);
    const click = (key: string): void => [...plot.body.querySelectorAll<HTMLInputElement>("input")].find(({ dataset }) => dataset.series === key)!.click();
    click(pin);
    expect([kept, made.at(-1)!.options.series.length]).toEqual([[], 2]);
    click(drop);
    expect(kept).toEqual([[]]);
  });

  it("show a pin at once, also where nothing more comes", () => {
    vi.useFakeTimers();
    try {
      const history = new History();
      const plot = new HistoryPlot(history, null, () => undefined);
      plot.show(true);
      history.add("probe 1, pressure", 1, 1, { pressure: 2 });
      plot.choose(seriesKey("probe 1, pressure", "pressure"));
      vi.runAllTimers();
      expect(texts(plot, "tbody th")).toEqual(["probe 1: pressure"]);
    } finally {
      vi.useRealTimers();
    }
  });

  it("say which pin is which, and show the same field at two of them on one axis", () => {
    const history = new History();
    const keys = [1, 2].map((pin) => {
      history.add(`probe ${pin}, velocity magnitude`, 1, 1, { "velocity magnitude": pin });
      return seriesKey(`probe ${pin}, velocity magnitude`, "velocity magnitude");
    });
    history.add("health", 1, 1, { "quality.min": 0.5 });
    const plot = new HistoryPlot(history, null, () => undefined);
    for (const key of keys) plot.choose(key);
    plot.show(true);
    expect(texts(plot, "tbody th")).toEqual(["Quality, minimum", "probe 1: velocity magnitude", "probe 2: velocity magnitude"]);
    expect(plot.body.querySelector<HTMLElement>("tbody th")!.title).toBe("Quality, minimum: quality.min, of the pipeline health");
    expect(texts(plot, ".choices label").slice(0, 2)).toEqual(["probe 1: velocity magnitude", "probe 2: velocity magnitude"]);
    const [, ...scales] = made[0]!.options.series.map(({ scale }) => scale);
    expect([scales[1] === scales[2], scales[0] === scales[1], made[0]!.options.axes!.length]).toEqual([true, false, 3]);
  });

  it("say nothing of a difference that is but rounding, and all of one that is more under the pointer", () => {
    const history = new History();
    for (const [cycle, same, drop, balance] of [[1, 0.20000000000000018, 101325, 0], [2, 0.2, 101425.5, 1e-3]] as const) history.add("flow", cycle, cycle, { same, drop, balance });
    const plot = new HistoryPlot(history, ["same", "drop", "balance"].map((name) => seriesKey("flow", name)), () => undefined);
    plot.setMarks([{ cycle: 1, label: "Throat: height × 0.7" }]);
    plot.show(true);
    const last = [...plot.body.querySelectorAll<HTMLElement>("tbody td:last-child")];
    expect(last.map(({ textContent, title }) => [textContent, title])).toEqual([["0", "unchanged"], ["+0.0992\u00a0%", "+101 (+0.0992\u00a0%)"], ["+0.001", "+0.001"]]);
    expect(plot.body.querySelector<HTMLElement>(".table-title")!.title).toBe("cycle 2 · before: Throat: height × 0.7");
  });

  it("are calm where a value hardly changes over time", () => {
    const history = new History();
    for (const [cycle, drop] of [[1, 129.37729], [2, 129.37731]] as const) history.add("flow", cycle, cycle, { drop });
    new HistoryPlot(history, null, () => undefined).show(true);
    const [, { range }] = Object.values(made[0]!.options.scales!) as unknown as [unknown, { range: (plot: null, low: number, high: number) => [number, number] }];
    const [low, high] = range(null, 129.37729, 129.37731);
    expect((high - low) / 129.3773).toBeCloseTo(1e-4, 9);
    expect(range(null, 129, 131)).toEqual([128.88, 131.12]);
  });

  describe("by keys and fingers", () => {
    let plot: HistoryPlot;
    const canvas = (): HTMLElement => plot.body.querySelector<HTMLElement>(".plot")!;
    const key = (name: string, more: KeyboardEventInit = {}): boolean => canvas().dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true, cancelable: true, ...more }));
    const shown = (): unknown => made.at(-1)!.setScale.mock.lastCall?.[1];
    const heading = (): string => plot.body.querySelector(".table-title")!.textContent;
    const cells = (): (string | null)[] => texts(plot, "tbody td");
    const whole = (): HTMLButtonElement => plot.tools.find((tool): tool is HTMLButtonElement => tool.textContent === "Whole")!;
    const over = (name: string): HTMLButtonElement => [...plot.tools.flatMap((tool) => [...tool.querySelectorAll("button")])].find(({ textContent }) => textContent === name)!;
    const open = (time: (cycle: number) => number): History => {
      const history = new History();
      for (let cycle = 0; cycle <= 100; cycle += 10) history.add("flow", cycle, time(cycle), { drop: cycle === 0 ? 1 : 2 + cycle / 100 });
      plot = new HistoryPlot(history, null, () => undefined);
      document.body.append(plot.body);
      plot.setMarks([{ cycle: 30, label: "Throat" }]);
      plot.show(true);
      return history;
    };

    it("the cursor goes from value to value, and the values and those before the last order with it", () => {
      open((cycle) => cycle / 1000);
      expect([heading(), canvas().getAttribute("aria-valuetext")]).toEqual(["cycle 100 · before: Throat", "the newest values"]);
      key("ArrowLeft");
      expect([heading(), cells()]).toEqual(["cycle 90 · before: Throat", ["2.9", "2.3", "+26.1\u00a0%"]]);
      expect([canvas().getAttribute("aria-valuenow"), canvas().getAttribute("aria-valuetext")]).toEqual(["90", "cycle 90; Drop 2.9, before 2.3, +26.1\u00a0%"]);
      expect(made[0]!.setCursor.mock.lastCall![0]).toMatchObject({ left: 360 });
      key("Home");
      expect([heading(), cells()[0]]).toEqual(["cycle 0", "1"]);
      key("ArrowRight", { shiftKey: true });
      expect(heading()).toContain("cycle 100");
      key("ArrowLeft");
      key("Escape");
      expect([heading(), canvas().getAttribute("aria-valuetext"), made[0]!.setCursor.mock.lastCall![0]]).toEqual(["cycle 100 · before: Throat", "the newest values", { left: -1, top: -1 }]);
    });

    it("the cursor stays at its cycle while values come, until the mouse takes it", () => {
      const history = open((cycle) => cycle / 1000);
      key("ArrowLeft");
      history.add("flow", 110, 0.11, { drop: 5 });
      plot.show(true);
      expect(heading()).toContain("cycle 90");
      // The plot itself finds another value where its cursor was.
      const [hook] = made[0]!.options.hooks!.setCursor! as ((plot: unknown) => void)[];
      hook!({ cursor: { idx: 2 } });
      expect(heading()).toContain("cycle 90");
      canvas().dispatchEvent(new MouseEvent("mousemove"));
      hook!({ cursor: { idx: 2 } });
      expect(heading()).toBe("cycle 20");
    });

    it("+ and - zoom around the cursor, which is followed where it leaves what is shown, and 0 or Whole shows all", () => {
      open((cycle) => cycle / 1000);
      expect(whole().disabled).toBe(true);
      key("+");
      expect([shown(), whole().disabled]).toEqual([{ min: 25, max: 75 }, false]);
      key("End");
      expect(shown()).toEqual({ min: 50, max: 100 });
      key("+");
      expect(shown()).toEqual({ min: 75, max: 100 });
      key("-");
      key("0");
      expect([shown(), whole().disabled]).toEqual([{ min: 0, max: 100 }, true]);
      key("+");
      whole().click();
      expect(shown()).toEqual({ min: 0, max: 100 });
      expect(key("x")).toBe(true);
    });

    it("a tap puts the cursor at the nearest value, another on its line takes it away, and a pinch zooms", () => {
      open((cycle) => cycle / 1000);
      const area = document.createElement("div");
      area.className = "u-over";
      area.getBoundingClientRect = () => ({ left: 0, top: 0, width: 400, height: 100 }) as DOMRect;
      canvas().append(area);
      canvas().setPointerCapture = () => undefined;
      const finger = (kind: string, pointerId: number, x: number): void => void area.dispatchEvent(new PointerEvent(kind, { bubbles: true, cancelable: true, pointerId, pointerType: "touch", clientX: x }));
      finger("pointerdown", 1, 175);
      finger("pointerup", 1, 175);
      expect(heading()).toContain("cycle 40");
      finger("pointerdown", 1, 160);
      finger("pointerup", 1, 160);
      expect([heading(), canvas().getAttribute("aria-valuetext")]).toEqual(["cycle 100 · before: Throat", "the newest values"]);
      finger("pointerdown", 1, 100);
      finger("pointerdown", 2, 300);
      finger("pointermove", 1, 0);
      finger("pointermove", 2, 400);
      expect(shown()).toEqual({ min: 25, max: 75 });
    });

    it("go over time where the run tells it, with what is shown, the orders and the cursor at the same cycles", () => {
      open((cycle) => cycle / 1000);
      key("+");
      over("time").click();
      expect([made.length, made[1]!.data[0], shown()]).toEqual([2, [0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1], { min: 0.025, max: expect.closeTo(0.075, 12) }]);
      expect(["cycle", "time"].map((name) => over(name).getAttribute("aria-pressed"))).toEqual(["false", "true"]);
      key("End");
      expect(heading()).toBe("cycle 100 · time 0.1 · before: Throat");
      const placed: number[] = [];
      const nothing = (): undefined => undefined;
      const known: Record<string, unknown> = { measureText: () => ({ width: 5 }) };
      const ctx = new Proxy(known, { get: (target, name: string) => target[name] ?? nothing });
      const [draw] = made[1]!.options.hooks!.draw! as ((plot: unknown) => void)[];
      draw!({ ctx, bbox: { left: 0, top: 0, width: 400, height: 100 }, valToPos: (value: number) => { placed.push(value); return 0; } });
      expect(placed).toEqual([expect.closeTo(0.03, 12)]);
      over("cycle").click();
      expect(made[2]!.data[0].at(-1)).toBe(100);
    });

    it("go over cycles alone where no time is told, or one that does not rise with them", () => {
      for (const time of [(cycle: number) => cycle, () => 0, (cycle: number) => -cycle]) {
        open(time);
        expect(over("time").parentElement!.hidden).toBe(true);
      }
      open((cycle) => cycle / 2);
      expect(over("time").parentElement!.hidden).toBe(false);
    });
  });
});
