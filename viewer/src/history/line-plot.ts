/** The tab Line: a field along a line through the domain, as the run takes it, now and before the last order. */
import uPlot from "uplot";
import type { Pipelines } from "../connection/pipelines";
import type { DataFrame, Vector } from "../connection/protocol";
import { download, element, write } from "../dom";
import { digits, readNumber, within } from "../number";
import type { Earlier } from "../picture/earlier";
import type { Action } from "../store/actions";
import type { Look } from "../store/looks";
import { LINE, lineBetween, lineOf } from "../store/pipelines";
import { whyNotSteering } from "../store/run";
import type { State } from "../store/state";
import type { Store } from "../store/store";
import type { Tab } from "./dock";
import { COLOURS, axesOf, padded } from "./plotting";
import { profile, together } from "./profile";
import type { Profile } from "./profile";

/** The shortest time between two drawings of new values, in milliseconds. */
const REST = 250;

/** What the plot needs of the picture: what the line holds now, and how the view is coloured whose field is plotted. */
export interface LineSource {
  frame(): DataFrame | null;
  look(): Look | null;
  title(look: Look): string;
}

export class LinePlot implements Tab {
  readonly title = "Line";
  readonly tools: readonly HTMLElement[];
  readonly body: HTMLElement;
  private readonly canvas = element("div", { class: "plot" });
  private readonly heading = element("span", { class: "hint" });
  private readonly table = element("tbody");
  private readonly note = element("p", { class: "hint" });
  private readonly ends: Record<"from" | "to", HTMLInputElement[]>;
  private readonly remove: HTMLButtonElement;
  private plot: uPlot | null = null;
  private shape = "";
  private profiles: readonly (Profile | null)[] = [];
  private isShown = false;
  private waiting: number | null = null;
  private line: { from: Vector; to: Vector } | null = null;

  /** `changed` is called when there is a line or none. */
  constructor(
    private readonly store: Store<State, Action>, private readonly pipelines: Pipelines, private readonly source: LineSource,
    private readonly earlier: Earlier, private readonly changed: () => void,
  ) {
    const inputs = (label: string): HTMLInputElement[] => ["x", "y", "z"].map((axis) =>
      element("input", { type: "text", inputmode: "decimal", autocomplete: "off", "aria-label": `${label} ${axis}`, onchange: () => this.typed() }));
    this.ends = { from: inputs("from"), to: inputs("to") };
    const row = (label: "from" | "to"): HTMLElement => element("div", { class: "ends" }, element("span", {}, label), ...this.ends[label]);
    const csv = element("button", { type: "button", class: "small", title: "What is plotted, as comma-separated values", onclick: () => this.download() }, "CSV");
    this.remove = element("button", { type: "button", class: "small", title: "Takes the line away", onclick: () => pipelines.remove(LINE) }, "Remove");
    this.tools = [this.heading, csv, this.remove];
    const headings = [element("td"), ...["least", "mean", "largest"].map((text) => element("th", { scope: "col" }, text))];
    this.body = element("div", { class: "dock-body" }, this.canvas,
      element("div", { class: "values" }, row("from"), row("to"), element("table", {}, element("thead", {}, element("tr", {}, ...headings)), this.table), this.note));
    new ResizeObserver(() => { if (this.isShown && this.canvas.clientWidth > 0) this.plot?.setSize(this.size()); }).observe(this.canvas);
    pipelines.onChange(() => this.follow());
    // What it holds is in the plot: in the picture it is a plain line.
    store.watch((state) => state.hello?.views.some((view) => view.name === LINE) === true, (there) => {
      if (there) store.dispatch({ type: "look", view: LINE, look: { field: null, edges: "none", opacity: 1 } });
    });
    store.watch(whyNotSteering, () => this.say());
    store.watch((state) => [state.looks, state.chosenView], () => this.update(), (a, b) => a.every((value, i) => Object.is(value, b[i])));
  }

  get isEmpty(): boolean {
    return this.line === null;
  }

  show(shown: boolean): void {
    this.isShown = shown;
    if (shown) this.draw();
  }

  /** Asks the run for the fields between two points. */
  take(from: Vector, to: Vector): void {
    this.pipelines.set(lineBetween(from, to));
    this.follow();
  }

  /** There are new values. */
  update(): void {
    if (!this.isShown) return;
    this.waiting ??= window.setTimeout(() => {
      this.waiting = null;
      if (this.isShown) this.draw();
    }, REST);
  }

  private follow(): void {
    const line = lineOf(this.pipelines.get(LINE));
    this.line = line;
    for (const end of ["from", "to"] as const) {
      this.ends[end].forEach((input, k) => { if (line && document.activeElement !== input) input.value = digits(line[end][k], 5); });
    }
    this.say();
    this.changed();
    this.update();
  }

  private say(): void {
    const why = whyNotSteering(this.store.state);
    for (const control of [...this.ends.from, ...this.ends.to, this.remove]) control.disabled = why !== "";
    write(this.note, this.line === null ? "Choose Line in the toolbar and click two places of the picture; or type two points." : why === "" ? "" : `The line is where the run takes it. ${why}`);
    this.note.hidden = this.note.textContent === "";
  }

  private typed(): void {
    const read = (end: "from" | "to"): (number | null)[] => this.ends[end].map((input) => {
      const value = readNumber(input.value);
      input.setAttribute("aria-invalid", String(value === null && input.value !== ""));
      return value;
    });
    const [from, to] = [read("from"), read("to")];
    if ([...from, ...to].some((value) => value === null) || from.every((value, k) => value === to[k])) return;
    this.take(from as Vector, to as Vector);
  }

  private draw(): void {
    const { line } = this;
    const look = this.source.look();
    const frame = this.source.frame();
    const before = this.earlier.moment.get(LINE)?.frame ?? null;
    const of = (one: DataFrame | null): Profile | null => {
      if (!one || !line || look?.field == null) return null;
      const spacing = Math.hypot(...line.from.map((part, k) => line.to[k]! - part)) / 200;
      return profile(one, line.from, look.field, look.component, spacing);
    };
    this.profiles = [of(frame), of(before)];
    const title = look ? this.source.title(look) : "";
    write(this.heading, !frame ? "" : this.profiles[0] ? `${title} along the line · cycle ${frame.cycle}` : `the line does not carry ${title}`);
    const { distances, columns } = together(this.profiles);
    const data = [distances, ...columns] as uPlot.AlignedData;
    const shape = `${title} ${before !== null}`;
    if (this.plot && shape === this.shape) this.plot.setData(data);
    else {
      this.shape = shape;
      this.plot?.destroy();
      this.plot = distances.length > 0 ? this.make(title, data) : null;
    }
    const names = ["now", this.earlier.label];
    this.table.replaceChildren(...this.profiles.flatMap((one, i) => (one ? [this.row(names[i]!, i, one)] : [])));
  }

  private row(name: string, i: number, { distances, values }: Profile): HTMLElement {
    const known = values.filter((value) => value !== null);
    const colour = element("span", { class: "colour", "aria-hidden": "true" });
    colour.style.background = COLOURS[i] ?? "";
    const numbers = [Math.min(...known), mean(distances, values), Math.max(...known)];
    return element("tr", {}, element("th", { scope: "row" }, colour, name), ...numbers.map((value) => element("td", {}, digits(value))));
  }

  private make(title: string, data: uPlot.AlignedData): uPlot {
    const { axis } = axesOf(this.body);
    const values = (_: uPlot, ticks: number[]): string[] => ticks.map((tick) => within(tick, [ticks[0] ?? 0, ticks.at(-1) ?? 1]));
    return new uPlot({
      ...this.size(), padding: [10, 12, 0, 0], legend: { show: false },
      scales: { x: { time: false }, y: { auto: true, range: padded } },
      series: [{}, { label: title, stroke: COLOURS[0]!, width: 1.8, points: { show: false } }, { label: "before", stroke: COLOURS[1]!, width: 1.4, dash: [6, 4], points: { show: false } }],
      axes: [{ ...axis, size: 30, values }, { ...axis, size: 62, values }],
    }, data, this.canvas);
  }

  private size(): { width: number; height: number } {
    return { width: Math.max(120, this.canvas.clientWidth), height: Math.max(80, this.canvas.clientHeight) };
  }

  private download(): void {
    const { distances, columns } = together(this.profiles);
    const lines = ["distance,now,before", ...distances.map((distance, row) => [distance, ...columns.map((column) => column[row] ?? "")].join(","))];
    download(new Blob([`${lines.join("\n")}\n`], { type: "text/csv" }), "tombolo-line.csv");
  }
}

/** The mean along the line (by trapezoids), over the parts of it that have values. */
export function mean(distances: readonly number[], values: readonly (number | null)[]): number {
  let sum = 0, length = 0;
  for (let i = 1; i < distances.length; i++) {
    const [a, b] = [values[i - 1], values[i]];
    if (typeof a !== "number" || typeof b !== "number") continue;
    const step = distances[i]! - distances[i - 1]!;
    sum += (step * (a + b)) / 2;
    length += step;
  }
  return length > 0 ? sum / length : values.find((value) => value !== null) ?? NaN;
}
