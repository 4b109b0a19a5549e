/** The tab Histogram: how the values of the field that colours the chosen view are spread over it, now and before the last order. */
import uPlot from "uplot";
import { element, write } from "../dom";
import { digits, within } from "../number";
import type { Content, Earlier } from "../picture/earlier";
import type { Action } from "../store/actions";
import type { Look } from "../store/looks";
import type { State } from "../store/state";
import type { Store } from "../store/store";
import type { Tab } from "./dock";
import { COLOURS, axesOf } from "./plotting";
import { histogram, weighted } from "./profile";
import type { Weighted } from "./profile";

const BINS = 48;
/** The shortest time between two drawings of new values, in milliseconds. */
const REST = 500;

export interface HistogramSource {
  /** What a view holds now. */
  content(view: string): Content | null;
  title(look: Look): string;
}

export class HistogramPlot implements Tab {
  readonly title = "Histogram";
  readonly tools: readonly HTMLElement[];
  readonly body: HTMLElement;
  private readonly canvas = element("div", { class: "plot" });
  private readonly heading = element("span", { class: "hint" });
  private readonly table = element("tbody");
  private plot: uPlot | null = null;
  private isShown = false;
  private waiting: number | null = null;

  constructor(private readonly store: Store<State, Action>, private readonly source: HistogramSource, private readonly earlier: Earlier) {
    const headings = [element("td"), ...["least", "mean", "largest"].map((text) => element("th", { scope: "col" }, text))];
    this.tools = [this.heading];
    this.body = element("div", { class: "dock-body" }, this.canvas,
      element("div", { class: "values" }, element("table", {}, element("thead", {}, element("tr", {}, ...headings)), this.table),
        element("p", { class: "hint" }, "By area, of the field that colours the chosen view.")));
    new ResizeObserver(() => { if (this.isShown && this.canvas.clientWidth > 0) this.plot?.setSize(this.size()); }).observe(this.canvas);
    store.watch((state) => [state.looks, state.chosenView], () => this.update(), (a, b) => a.every((value, i) => Object.is(value, b[i])));
  }

  get isEmpty(): boolean {
    return this.store.state.frames.count === 0;
  }

  show(shown: boolean): void {
    this.isShown = shown;
    if (shown) this.draw();
  }

  /** There are new values. */
  update(): void {
    if (!this.isShown) return;
    this.waiting ??= window.setTimeout(() => {
      this.waiting = null;
      if (this.isShown) this.draw();
    }, REST);
  }

  private draw(): void {
    const { chosenView, looks } = this.store.state;
    const look = chosenView === null ? undefined : looks[chosenView];
    const of = (content: Content | null | undefined): Weighted | null =>
      content && look?.field != null ? weighted(content.topology, content.frame, look.field, look.component) : null;
    const content = chosenView === null ? null : this.source.content(chosenView);
    const both = [of(content), of(chosenView === null ? null : this.earlier.moment.get(chosenView))];
    const found = both.filter((one) => one !== null);
    write(this.heading, found.length === 0 ? "the chosen view is not coloured by a field" : `${this.source.title(look!)} on ${chosenView} · cycle ${content?.frame.cycle ?? ""}`);
    const names = ["now", this.earlier.label];
    this.table.replaceChildren(...both.flatMap((one, i) => (one ? [this.row(names[i]!, i, one)] : [])));
    const low = Math.min(...found.map(({ least }) => least)), high = Math.max(...found.map(({ largest }) => largest));
    const edges = Array.from({ length: BINS + 1 }, (_, i) => low + ((high - low) * i) / BINS);
    // A last point closes the last step.
    const columns = both.map((one) => {
      const parts = one ? histogram(one, [low, high], BINS).map((part) => 100 * part) : [];
      return [...parts, parts.at(-1)];
    });
    const data = [edges, ...columns] as uPlot.AlignedData;
    if (found.length === 0 || !(high > low)) {
      this.plot?.destroy();
      this.plot = null;
    } else if (this.plot) this.plot.setData(data);
    else this.plot = this.make(data);
  }

  private row(name: string, i: number, { least, mean, largest }: Weighted): HTMLElement {
    const colour = element("span", { class: "colour", "aria-hidden": "true" });
    colour.style.background = COLOURS[i] ?? "";
    return element("tr", {}, element("th", { scope: "row" }, colour, name), ...[least, mean, largest].map((value) => element("td", {}, digits(value))));
  }

  private make(data: uPlot.AlignedData): uPlot {
    const { axis } = axesOf(this.body);
    const paths = uPlot.paths.stepped!({ align: 1 });
    const values = (_: uPlot, ticks: number[]): string[] => ticks.map((tick) => within(tick, [ticks[0] ?? 0, ticks.at(-1) ?? 1]));
    return new uPlot({
      ...this.size(), padding: [10, 12, 0, 0], legend: { show: false }, scales: { x: { time: false }, y: { range: (_, __, high) => [0, 1.05 * (high ?? 1) || 1] } },
      series: [
        {}, { label: "now", stroke: COLOURS[0]!, fill: `${COLOURS[0]}44`, width: 1.5, paths, points: { show: false } },
        { label: "before", stroke: COLOURS[1]!, width: 1.5, dash: [6, 4], paths, points: { show: false } },
      ],
      axes: [{ ...axis, size: 30, values }, { ...axis, size: 50, values: (_, ticks) => ticks.map((tick) => `${digits(tick, 3)} %`) }],
    }, data, this.canvas);
  }

  private size(): { width: number; height: number } {
    return { width: Math.max(120, this.canvas.clientWidth), height: Math.max(80, this.canvas.clientHeight) };
  }
}
