/** The tab Line: a field along a line through the domain, as the run takes it, now and before the last order. */
import uPlot from "uplot";
import type { Pipelines } from "../connection/pipelines";
import type { DataFrame, Vector } from "../connection/protocol";
import { download, element, markWrong, write } from "../dom";
import { exactCell } from "../exact";
import type { ExactCell } from "../exact";
import { readNumber, whyNoNumber } from "../number";
import type { Earlier } from "../picture/earlier";
import type { Action } from "../store/actions";
import type { Look } from "../store/looks";
import { LINE, lineBetween, lineOf, withLine } from "../store/pipelines";
import { mayDrive, whyNotSteering } from "../store/run";
import type { State } from "../store/state";
import type { Store } from "../store/store";
import { axesOf, labelled, padded, roomy, seriesColour } from "./plotting";
import { profile, together } from "./profile";
import type { Profile } from "./profile";
import { ValuePlot } from "./value-plot";
import type { Spread } from "./value-plot";

/** The shortest time between two drawings of new values, in milliseconds. */
const REST = 250;

/** The most characters of a coordinate that are seen in its input. */
const ROOM = 9;

/** What the plot needs of the picture: what the line holds now, and how the view is coloured whose field is plotted. */
export interface LineSource {
  frame(): DataFrame | null;
  look(): Look | null;
  title(look: Look): string;
}

export class LinePlot extends ValuePlot {
  readonly title = "Line";
  readonly tools: readonly HTMLElement[];
  private readonly note = element("p", { class: "hint" });
  private readonly ends: Record<"from" | "to", { input: HTMLInputElement; cell: ExactCell }[]>;
  private readonly remove: HTMLButtonElement;
  private readonly csv: HTMLButtonElement;
  private shape = "";
  private profiles: readonly (Profile | null)[] = [];
  private line: { from: Vector; to: Vector } | null = null;

  /** `changed` is called when there is a line or none. */
  constructor(
    private readonly store: Store<State, Action>, private readonly pipelines: Pipelines, private readonly source: LineSource,
    private readonly earlier: Earlier, private readonly changed: () => void,
  ) {
    super(store, REST);
    const inputs = (label: string): { input: HTMLInputElement; cell: ExactCell }[] => ["x", "y", "z"].map((axis) => {
      const input = element("input", { type: "text", inputmode: "decimal", autocomplete: "off", "aria-label": `${label} ${axis}`, placeholder: axis, onchange: () => this.typed() });
      return { input, cell: exactCell(input) };
    });
    this.ends = { from: inputs("from"), to: inputs("to") };
    const row = (label: "from" | "to"): HTMLElement => element("div", { class: "ends" }, element("span", {}, label), ...this.ends[label].map(({ input }) => input));
    this.csv = element("button", { type: "button", class: "small", title: "What is plotted, as comma-separated values", onclick: () => this.download() }, "CSV");
    this.remove = element("button", { type: "button", class: "small", title: "Takes the line away", onclick: () => pipelines.remove(LINE) }, "Remove");
    this.tools = [this.heading, this.csv, this.remove];
    this.values.prepend(row("from"), row("to"));
    this.values.append(this.note);
    pipelines.onChange(() => this.follow());
    // What it holds is in the plot: in the picture it is a plain line.
    store.watch((state) => state.hello?.views.some((view) => view.name === LINE) === true, (there) => {
      if (there) store.dispatch({ type: "look", view: LINE, look: { field: null, edges: "none", opacity: 1 } });
    });
    store.watch(whyNotSteering, () => this.say());
  }

  get isEmpty(): boolean {
    return this.line === null;
  }

  /** Asks the run for the fields between two points. */
  take(from: Vector, to: Vector): void {
    const impossible = this.whyImpossible();
    if (impossible !== "") {
      this.store.dispatch({ type: "refused", id: null, text: impossible });
      return this.follow();
    }
    const known = this.pipelines.get(LINE);
    if (known && !lineOf(known)) {
      // It is somebody's own, under the name that the plot would use.
      return this.store.dispatch({ type: "refused", id: null, text: `The run has a pipeline “${LINE}” that takes no line: under another name it would leave room for this one.` });
    }
    this.pipelines.set(known ? withLine(known, from, to) : lineBetween(from, to));
    this.follow();
  }

  /** Why the run takes no line for this page, whoever steers; empty where it may. */
  private whyImpossible(): string {
    const { state } = this.store;
    return mayDrive(state) ? "" : `A plot over a line takes a change of the pipelines. ${whyNotSteering(state)}`;
  }

  private follow(): void {
    const line = lineOf(this.pipelines.get(LINE));
    this.line = line;
    for (const end of ["from", "to"] as const) {
      this.ends[end].forEach(({ input, cell }, k) => { if (line && document.activeElement !== input) cell.write(line[end][k]!, ROOM); });
    }
    this.say();
    this.changed();
    this.update();
  }

  private say(): void {
    const why = whyNotSteering(this.store.state);
    for (const { input } of [...this.ends.from, ...this.ends.to]) input.disabled = why !== "";
    this.remove.disabled = why !== "" || this.line === null;
    this.csv.disabled = this.line === null;
    write(this.note, this.line === null ? this.whyImpossible() || "Choose Line in the toolbar and click two places of the picture; or type two points." : why === "" ? "" : `The line is where the run takes it. ${why}`);
    this.note.hidden = this.note.textContent === "";
  }

  private typed(): void {
    const read = (end: "from" | "to"): (number | null)[] => this.ends[end].map(({ input, cell }) => {
      const value = cell.untouched() ?? readNumber(input.value);
      markWrong(input, value === null && input.value !== "" ? whyNoNumber(input.value) : "", cell.whole());
      return value;
    });
    const [from, to] = [read("from"), read("to")];
    if ([...from, ...to].some((value) => value === null) || from.every((value, k) => value === to[k])) return;
    this.take(from as Vector, to as Vector);
  }

  protected draw(): void {
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
    const [now, then] = this.profiles.map((one) => one && spread(one));
    this.fill(now ?? null, then ?? null, this.earlier.label);
  }

  private make(title: string, data: uPlot.AlignedData): uPlot {
    const { axis } = axesOf(this.body);
    return new uPlot({
      ...this.size(), padding: [10, 12, 0, 0], legend: { show: false },
      scales: { x: { time: false }, y: { auto: true, range: padded } },
      series: [{}, { label: title, stroke: seriesColour(this.body, 0), width: 1.8, points: { show: false } }, { label: "before", stroke: seriesColour(this.body, 1), width: 1.4, dash: [6, 4], points: { show: false } }],
      axes: [{ ...axis, size: 30, values: labelled }, { ...axis, size: roomy(62), values: labelled }],
    }, data, this.canvas);
  }

  private download(): void {
    const { distances, columns } = together(this.profiles);
    const lines = ["distance,now,before", ...distances.map((distance, row) => [distance, ...columns.map((column) => column[row] ?? "")].join(","))];
    download(new Blob([`${lines.join("\n")}\n`], { type: "text/csv" }), "tombolo-line.csv");
  }
}

function spread({ distances, values }: Profile): Spread {
  const known = values.filter((value) => value !== null);
  return [Math.min(...known), mean(distances, values), Math.max(...known)];
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
