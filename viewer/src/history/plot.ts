/** The tab History: monitors over time, with orders as marks and what they have changed. */
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { download, element, write } from "../dom";
import { digits } from "../number";
import { SERIES_COLOURS, axesOf, labelled, padded, roomy, seriesColour, seriesStyle } from "./plotting";
import type { Tab } from "./dock";
import type { History, Mark, Series } from "./series";
import { compare, firstChoice } from "./series";
import { ValueTable } from "./table";

/** The most series that are drawn at once: one for each colour. */
const DRAWN = SERIES_COLOURS;
/** The most axes that stand beside the plot. */
const AXES = 4;
/** The lines in which the names of orders stand. */
const MARK_LINES = 3;
/** The shortest time between two drawings of new values, in milliseconds. */
const REST = 250;
/** The series of pins (`picture/pins.ts`), which are gone with the page. */
const PIN = /^probe \d+, /;

export class HistoryPlot implements Tab {
  readonly title = "History";
  readonly tools: readonly HTMLElement[];
  readonly body: HTMLElement;
  private isShown = false;
  private plot: uPlot | null = null;
  private marks: readonly Mark[] = [];
  private drawn = "";
  private listed = "";
  private waiting: number | null = null;
  /** The row of the table that the cursor is at; null where it is not over the plot. */
  private row: number | null = null;
  private cycles: number[] = [];
  private zoom: [number, number] | null = null;
  private readonly canvas = element("div", { class: "plot" });
  private readonly choices = element("div", { class: "choices", role: "group", "aria-label": "Monitors in the plot" });
  private readonly heading = element("span", { class: "hint" });
  private readonly table = new ValueTable(["value", "before", "difference"], this.heading);
  private readonly whole: HTMLButtonElement;

  /**
   * `picked` are the series that were chosen before; null for those that a person who asks for nothing wants to see. `changed` is told what
   * to keep of another choice.
   */
  constructor(private readonly history: History, private picked: readonly string[] | null, private readonly changed: (picked: readonly string[] | null) => void) {
    this.whole = element("button", { type: "button", class: "small", title: "Show the whole history again", disabled: true, onclick: () => this.zoomTo(null) }, "Whole");
    const csv = element("button", { type: "button", class: "small", title: "All that is kept of all monitors, as comma-separated values", onclick: () => this.download() }, "CSV");
    this.body = element("div", { class: "dock-body" }, this.canvas,
      element("div", { class: "values" }, this.table.element,
        element("details", {}, element("summary", {}, "Monitors in the plot"), this.choices)));
    this.tools = [element("span", { class: "hint" }, "drag to zoom · double-click for the whole"), this.whole, csv];
    new ResizeObserver(() => this.resize()).observe(this.canvas);
  }

  get isEmpty(): boolean {
    return this.history.series.length === 0;
  }

  show(shown: boolean): void {
    this.isShown = shown;
    if (shown) this.draw();
  }

  recolour(): void {
    this.plot?.redraw(false);
  }

  /** There are new values. */
  update(): void {
    if (!this.isShown || this.isEmpty) return;
    this.waiting ??= window.setTimeout(() => {
      this.waiting = null;
      this.draw();
    }, REST);
  }

  /** The orders that have taken effect. */
  setMarks(marks: readonly Mark[]): void {
    if (marks === this.marks) return;
    this.marks = marks;
    this.plot?.redraw(false);
    this.values();
  }

  /** Draws a series that was not there before: somebody has asked for it. */
  choose(key: string): void {
    this.change([...this.chosen().filter((other) => other !== key), key].slice(-DRAWN));
  }

  private change(picked: readonly string[]): void {
    this.picked = picked;
    const kept = picked.filter((key) => !PIN.test(key));
    // Pins alone say nothing of the monitors: those of the beginning are shown where the pins are no more.
    this.changed(kept.length === 0 && picked.length > 0 ? null : kept);
  }

  /** What is drawn. Where nothing is there of what was chosen, in another run, it is what one sees at first. */
  private chosen(): string[] {
    const { series } = this.history;
    const known = this.picked?.filter((key) => series.some((one) => one.key === key));
    return (known && (known.length > 0 || this.picked?.length === 0) ? known : firstChoice(series)).slice(0, DRAWN);
  }

  private draw(): void {
    this.list();
    const chosen = this.chosen();
    const series = chosen.flatMap((key) => this.history.series.find((one) => one.key === key) ?? []);
    const { cycles, columns } = this.history.table(chosen);
    this.cycles = cycles;
    const shape = JSON.stringify(series.map(({ key, unit }) => [key, unit]));
    const data: uPlot.AlignedData = [cycles, ...columns];
    if (this.plot && shape === this.drawn) {
      this.plot.setData(data, false);
      this.range();
    } else {
      this.drawn = shape;
      this.plot?.destroy();
      this.plot = series.length > 0 ? this.make(series, data) : null;
    }
    this.values();
  }

  /** The boxes by which monitors are put into the plot. */
  private list(): void {
    const { series } = this.history;
    const chosen = this.chosen();
    const key = JSON.stringify([series.map((one) => [one.key, one.unit]), chosen]);
    if (key === this.listed) return;
    this.listed = key;
    const focused = document.activeElement instanceof HTMLElement ? document.activeElement.dataset.series : undefined;
    this.choices.replaceChildren(...series.map((one) => {
      const position = chosen.indexOf(one.key);
      const box = element("input", {
        type: "checkbox", "data-series": one.key, disabled: position < 0 && chosen.length >= DRAWN, onchange: () => {
          this.change(box.checked ? [...this.chosen(), one.key] : this.chosen().filter((other) => other !== one.key));
          this.draw();
        },
      });
      box.checked = position >= 0;
      if (position >= 0) box.style.accentColor = seriesStyle(position);
      return element("label", { title: `pipeline ${one.source}` }, box, label(one));
    }));
    if (focused) this.choices.querySelector<HTMLElement>(`[data-series="${CSS.escape(focused)}"]`)?.focus();
  }

  private make(series: readonly Series[], data: uPlot.AlignedData): uPlot {
    const scales = [...new Set(series.map(scaleOf))];
    const colour = (at: number): (() => string) => seriesColour(this.body, at);
    const { grid, axis } = axesOf(this.body);
    const { width, height } = this.size();
    return new uPlot({
      width, height, padding: [10, 8, 0, 0],
      legend: { show: false },
      cursor: { drag: { x: true, y: false, setScale: false }, points: { size: 5 } },
      scales: { x: { time: false }, ...Object.fromEntries(scales.map((scale) => [scale, { auto: true, range: padded }])) },
      // A line goes on where only another source has spoken, and breaks where its own has said what is no number.
      series: [{}, ...series.map((one, i) => ({ label: one.name, scale: scaleOf(one), stroke: colour(i), width: 1.5, points: { show: false } }))],
      axes: [
        { ...axis, size: 30, values: (_, ticks) => ticks.map((tick) => (Number.isInteger(tick) ? String(tick) : "")) },
        ...scales.slice(0, AXES).map((scale, i) => ({
          ...axis, scale, side: i % 2 === 0 ? 3 as const : 1 as const, size: roomy(58), grid: i === 0 ? grid : { show: false },
          stroke: scales.length === 1 ? axis.stroke : colour(series.findIndex((one) => scaleOf(one) === scale)),
          values: labelled,
        })),
      ],
      hooks: {
        draw: [(plot) => this.drawMarks(plot)],
        setCursor: [(plot) => {
          this.row = plot.cursor.idx ?? null;
          this.values();
        }],
        setSelect: [(plot) => {
          const { left, width: wide } = plot.select;
          if (wide > 3) this.zoomTo([plot.posToVal(left, "x"), plot.posToVal(left + wide, "x")]);
          plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
        }],
        ready: [(plot) => {
          plot.over.addEventListener("dblclick", () => this.zoomTo(null));
          plot.over.addEventListener("mouseleave", () => {
            this.row = null;
            this.values();
          });
        }],
      },
    }, data, this.canvas);
  }

  private zoomTo(zoom: [number, number] | null): void {
    this.zoom = zoom;
    this.whole.disabled = zoom === null;
    this.range();
  }

  private range(): void {
    const [min, max] = this.zoom ?? [this.cycles[0] ?? 0, this.cycles.at(-1) ?? 1];
    this.plot?.setScale("x", { min, max: max > min ? max : min + 1 });
  }

  private drawMarks(plot: uPlot): void {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    const style = getComputedStyle(this.body);
    ctx.strokeStyle = ctx.fillStyle = style.getPropertyValue("--pressed");
    ctx.font = `${11 * devicePixelRatio}px sans-serif`;
    ctx.setLineDash([4 * devicePixelRatio, 3 * devicePixelRatio]);
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    /** Where the names in each line end: one that finds no room stands in none. */
    const ends = new Array<number>(MARK_LINES).fill(-Infinity);
    for (const mark of this.marks) {
      const x = Math.round(plot.valToPos(mark.cycle, "x", true)) + 0.5;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      const label = mark.label.length > 28 ? `${mark.label.slice(0, 27)}…` : mark.label;
      const line = ends.findIndex((end) => end < x);
      if (line < 0) continue;
      ends[line] = x + ctx.measureText(label).width + 10 * devicePixelRatio;
      ctx.fillText(label, x + 4 * devicePixelRatio, bbox.top + (11 + 13 * line) * devicePixelRatio);
    }
    ctx.restore();
  }

  /** What stands below the cursor, and beside it how it was before the last order. */
  private values(): void {
    const last = this.cycles.at(-1);
    const cycle = this.row === null ? last : this.cycles[this.row];
    if (cycle === undefined) return;
    const chosen = this.chosen();
    const all = this.history.series;
    let order: Mark | null = null;
    const rows = chosen.map((key, i) => {
      const one = all.find((candidate) => candidate.key === key);
      const found = compare(this.history, key, cycle, this.marks);
      order = found.order ?? order;
      const part = found.difference !== null && found.before ? ` (${digits((100 * found.difference) / Math.abs(found.before), 2)} %)` : "";
      const cells = [digits(found.value), digits(found.before), found.difference === null ? "–" : `${found.difference > 0 ? "+" : ""}${digits(found.difference, 3)}${part}`];
      return { name: one ? label(one) : "", colour: seriesStyle(i), cells };
    });
    const { label: text } = (order ?? { label: "" }) as Mark;
    write(this.heading, `cycle ${cycle}${text === "" ? "" : ` · before: ${text}`}`);
    this.table.show(rows);
  }

  private size(): { width: number; height: number } {
    return { width: Math.max(120, this.canvas.clientWidth), height: Math.max(80, this.canvas.clientHeight) };
  }

  private resize(): void {
    if (!this.isShown || this.canvas.clientWidth === 0) return;
    this.plot?.setSize(this.size());
  }

  private download(): void {
    download(new Blob([this.history.csv()], { type: "text/csv" }), "tombolo-history.csv");
  }
}

/** Series of one unit share an axis; one without a unit has its own. */
const scaleOf = (series: Series): string => (series.unit ? `unit ${series.unit}` : series.key);

const label = ({ name, unit }: Series): string => (unit ? `${name} [${unit}]` : name);
