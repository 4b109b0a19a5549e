/** The tab History: monitors over time, with orders as marks and what they have changed. */
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { download, element, write } from "../dom";
import { digits } from "../number";
import { placeNames, shortened } from "./mark-names";
import { MESH } from "./mesh-quality";
import { monitorHint, monitorText } from "./monitor-names";
import { SERIES_COLOURS, axesOf, calm, labelled, roomy, seriesColour, seriesStyle } from "./plotting";
import { containing, pinched, watchPlot, within, zoomed } from "./plot-control";
import type { Span } from "./plot-control";
import type { Tab } from "./dock";
import type { Comparison, History, Mark, Series } from "./series";
import { areTold, compare, firstChoice, interpolated, lastAt } from "./series";
import { ValueTable } from "./table";

/** The most series that are drawn at once: one for each colour. */
const DRAWN = SERIES_COLOURS;
/** The most axes that stand beside the plot. */
const AXES = 4;
/** The lines in which the names of orders stand. */
const MARK_LINES = 3;
/** The shortest time between two drawings of new values, in milliseconds. */
const REST = 250;
/** The most characters of the name of an order. */
const LONGEST_NAME = 28;
/** The sources of the series of pins (`picture/pins.ts`): the place has a name of its own, and the field is that of the picture. */
const PIN = /^(probe \d+), /;

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
  private times: number[] = [];
  /** The cycle at which keys or a finger have put the cursor; null where it goes with the mouse. */
  private held: number | null = null;
  /** What the axis goes over, where the run tells its times. */
  private isOverTime = false;
  /** The part of the axis that is shown; null for the whole. */
  private zoom: Span | null = null;
  /** What was shown when a pinch began. */
  private pinchedFrom: Span = [0, 1];
  private readonly canvas = element("div", { class: "plot", tabindex: 0, role: "slider", "aria-label": "cursor of the history", "aria-valuemin": 0, "aria-valuemax": 0, "aria-valuenow": 0, "aria-valuetext": "no values yet", title: "+ and − zoom, arrows move the cursor, Esc takes it away, 0 shows the whole" });
  private readonly axes = element("div", { class: "axes", role: "group", "aria-label": "Plotted over" },
    ...["cycle", "time"].map((name, i) => element("button", { type: "button", class: "small", "aria-pressed": String(i === 0), onclick: () => this.plotOver(i === 1) }, name)));
  private readonly choices = element("div", { class: "choices", role: "group", "aria-label": "Monitors in the plot" });
  private readonly heading = element("p", { class: "hint table-title" });
  private readonly table = new ValueTable(["value", "before", "difference"], this.heading);
  /** The pins that are drawn, which the run does not know; the oldest first. */
  private pinned: string[] = [];
  private readonly whole: HTMLButtonElement;

  /**
   * `picked` are the series that were chosen before; null for those that a person who asks for nothing wants to see. `changed` is told what
   * to keep of another choice.
   */
  constructor(private readonly history: History, private picked: readonly string[] | null, private readonly changed: (picked: readonly string[] | null) => void) {
    this.whole = element("button", { type: "button", class: "small", title: "Show the whole history again", disabled: true, onclick: () => this.zoomTo(null) }, "Whole");
    const csv = element("button", { type: "button", class: "small", title: "All that is kept of all monitors, as comma-separated values", onclick: () => this.download() }, "CSV");
    this.body = element("div", { class: "dock-body" }, this.canvas,
      element("div", { class: "values" }, this.heading, this.table.element,
        element("details", {}, element("summary", {}, "Monitors in the plot"), this.choices)));
    this.tools = [element("span", { class: "hint", title: "A double click shows the whole again" }, "drag or pinch to zoom"), this.axes, this.whole, csv];
    this.axes.hidden = true;
    // The mouse takes the cursor along, wherever it was put.
    this.canvas.addEventListener("mousemove", () => { this.held = null; }, true);
    watchPlot(this.canvas, () => this.canvas.querySelector(".u-over")?.getBoundingClientRect() ?? null, {
      zoomBy: (factor) => this.zoomBy(factor), whole: () => this.zoomTo(null), step: (by) => this.step(by),
      cursor: () => this.heldPlace, release: () => this.release(),
      point: (at) => {
        const along = this.shown[0] + at * (this.shown[1] - this.shown[0]);
        this.hold(this.isOverTime ? interpolated(this.times, this.cycles, along) : along);
      },
      pinchBegun: () => { this.pinchedFrom = this.shown; },
      pinch: (from, to) => this.zoomTo(within(pinched(this.pinchedFrom, from, to), this.ends)),
    });
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

  /** Draws a series of a pin, which was not there before: somebody has asked for it. The monitors stay those that were chosen. */
  choose(key: string): void {
    this.change(key, true);
    // A run that rests says nothing more that would have it drawn.
    this.update();
  }

  private change(key: string, isDrawn: boolean): void {
    if (PIN.test(key)) {
      this.pinned = [...this.pinned.filter((other) => other !== key), ...(isDrawn ? [key] : [])];
      return;
    }
    const monitors = this.chosen().filter((other) => other !== key && !PIN.test(other));
    this.picked = isDrawn ? [...monitors, key] : monitors;
    this.changed(this.picked);
  }

  /** What is drawn. Where nothing is there of what was chosen, in another run, it is what one sees at first. */
  private chosen(): string[] {
    const { series } = this.history;
    const there = (keys: readonly string[]): string[] => keys.filter((key) => series.some((one) => one.key === key));
    const known = this.picked && there(this.picked);
    const monitors = known && (known.length > 0 || this.picked?.length === 0) ? known : firstChoice(series.filter(({ source }) => !PIN.test(source)));
    const pinned = there(this.pinned).slice(-DRAWN);
    return [...monitors.slice(0, DRAWN - pinned.length), ...pinned];
  }

  private draw(): void {
    this.list();
    const chosen = this.chosen();
    const series = chosen.flatMap((key) => this.history.series.find((one) => one.key === key) ?? []);
    const { cycles, times, columns } = this.history.table(chosen);
    [this.cycles, this.times] = [cycles, times];
    const isTold = areTold(cycles, times);
    this.axes.hidden = !isTold;
    if (!isTold) this.turn(false);
    const shape = JSON.stringify([this.isOverTime, series.map(({ key, unit }) => [key, unit])]);
    const data: uPlot.AlignedData = [this.along, ...columns];
    if (this.plot && shape === this.drawn) {
      this.plot.setData(data, false);
      this.range();
    } else {
      this.drawn = shape;
      this.plot?.destroy();
      this.plot = series.length > 0 ? this.make(series, data) : null;
      if (this.zoom) this.range();
    }
    this.place();
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
          this.change(one.key, box.checked);
          this.draw();
        },
      });
      box.checked = position >= 0;
      if (position >= 0) box.style.accentColor = seriesStyle(position);
      return element("label", { title: hintOf(one) }, box, label(one));
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
      scales: { x: { time: false }, ...Object.fromEntries(scales.map((scale) => [scale, { auto: true, range: calm }])) },
      // A line goes on where only another source has spoken, and breaks where its own has said what is no number.
      series: [{}, ...series.map((one, i) => ({ label: one.name, scale: scaleOf(one), stroke: colour(i), width: 1.5, points: { show: false } }))],
      axes: [
        { ...axis, size: 30, values: this.isOverTime ? labelled : (_, ticks) => ticks.map((tick) => (Number.isInteger(tick) ? String(tick) : "")) },
        ...scales.slice(0, AXES).map((scale, i) => ({
          ...axis, scale, side: i % 2 === 0 ? 3 as const : 1 as const, size: roomy(58), grid: i === 0 ? grid : { show: false },
          // In the colour of its series, where it has but one.
          stroke: scales.length === 1 || series.filter((one) => scaleOf(one) === scale).length > 1 ? axis.stroke : colour(series.findIndex((one) => scaleOf(one) === scale)),
          values: labelled,
        })),
      ],
      hooks: {
        draw: [(plot) => this.drawMarks(plot)],
        setCursor: [(plot) => {
          if (this.held !== null) return;
          this.row = plot.cursor.idx ?? null;
          this.values();
        }],
        setSelect: [(plot) => {
          const { left, width: wide } = plot.select;
          if (wide > 3) this.zoomTo([plot.posToVal(left, "x"), plot.posToVal(left + wide, "x")]);
          plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
        }],
        setSize: [() => this.place()],
        ready: [(plot) => {
          this.place();
          plot.over.addEventListener("dblclick", () => this.zoomTo(null));
          plot.over.addEventListener("mouseleave", () => {
            if (this.held !== null) return;
            this.row = null;
            this.values();
          });
        }],
      },
    }, data, this.canvas);
  }

  private zoomTo(zoom: Span | null): void {
    this.zoom = zoom;
    this.whole.disabled = zoom === null;
    this.range();
    this.place();
  }

  /** What the axis goes over. */
  private get along(): number[] {
    return this.isOverTime ? this.times : this.cycles;
  }

  /** Where on the axis a cycle is, of which nothing may have been said. */
  private placeOf(cycle: number): number {
    return this.isOverTime ? interpolated(this.cycles, this.times, cycle) : cycle;
  }

  private get ends(): Span {
    const [min, max] = [this.along[0] ?? 0, this.along.at(-1) ?? 1];
    return [min, max > min ? max : min + 1];
  }

  private get shown(): Span {
    return this.zoom ?? this.ends;
  }

  private range(): void {
    const [min, max] = this.shown;
    this.plot?.setScale("x", { min, max });
  }

  private plotOver(isOverTime: boolean): void {
    this.turn(isOverTime);
    this.draw();
  }

  /** Lets the axis go over time or over cycles; what is shown stays. */
  private turn(isOverTime: boolean): void {
    if (isOverTime === this.isOverTime) return;
    const before = this.along;
    this.isOverTime = isOverTime;
    this.zoom = this.zoom && this.zoom.map((end) => interpolated(before, this.along, end)) as unknown as Span;
    [...this.axes.children].forEach((button, i) => button.setAttribute("aria-pressed", String((i === 1) === isOverTime)));
  }

  /** Zooms around the cursor, or around the middle where there is none. */
  private zoomBy(factor: number): void {
    const [low, high] = this.shown;
    const at = this.row === null ? NaN : this.along[this.row]!;
    this.zoomTo(within(zoomed(this.shown, at >= low && at <= high ? at : (low + high) / 2, factor), this.ends));
  }

  /** Moves the cursor by so many values; where there is none it begins at the last. */
  private step(by: number): void {
    const last = this.cycles.length - 1;
    const row = Math.min(last, Math.max(0, (this.row ?? last) + by));
    const at = this.along[row];
    if (at === undefined) return;
    this.hold(this.cycles[row]!);
    if (this.zoom) this.zoomTo(within(containing(this.zoom, at), this.ends));
  }

  /** The newest values are shown again. */
  private release(): void {
    this.held = this.row = null;
    this.plot?.setCursor({ left: -1, top: -1 }, false);
    this.values();
  }

  private hold(cycle: number): void {
    this.held = cycle;
    this.place();
    this.values();
  }

  /** Draws the cursor where it was put: the values are other ones, or the axis. */
  private place(): void {
    if (this.held === null) return;
    const after = lastAt(this.cycles, this.held) + 1;
    // The nearest of those that are kept.
    const [before, behind] = [this.cycles[after - 1] ?? -Infinity, this.cycles[after] ?? Infinity];
    this.row = this.cycles.length === 0 ? null : this.held - before <= behind - this.held ? after - 1 : after;
    const { plot, heldPlace } = this;
    if (plot && heldPlace !== null) plot.setCursor({ left: heldPlace * plot.over.clientWidth, top: plot.over.clientHeight / 2 }, false);
  }

  /** Where the cursor was put, from 0 to 1 across what is shown; null where it was not. */
  private get heldPlace(): number | null {
    if (this.held === null || this.row === null) return null;
    // The plot takes another part of its axis at the end of the task: until then it knows only the old places.
    const [low, high] = this.shown;
    return (this.along[this.row]! - low) / (high - low);
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
    const measure = (text: string): number => ctx.measureText(text).width;
    const marks = this.marks.map(({ cycle, label }) => {
      const text = label.length > LONGEST_NAME ? `${label.slice(0, LONGEST_NAME - 1)}…` : label;
      return { text, x: Math.round(plot.valToPos(this.placeOf(cycle), "x", true)) + 0.5, width: measure(text) };
    });
    for (const { x } of marks) {
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
    }
    const places = placeNames(marks, [bbox.left, bbox.left + bbox.width], MARK_LINES, 4 * devicePixelRatio);
    const [ink, ground] = ["--pressed", "--panel"].map((name) => style.getPropertyValue(name)) as [string, string];
    marks.forEach(({ text }, i) => {
      const place = places[i];
      if (!place) return;
      const top = bbox.top + 13 * place.row * devicePixelRatio;
      // Where it crosses the line of another, or a curve, it is still read.
      ctx.globalAlpha = 0.8;
      ctx.fillStyle = ground;
      ctx.fillRect(place.left - 2 * devicePixelRatio, top, place.width + 4 * devicePixelRatio, 13 * devicePixelRatio);
      ctx.globalAlpha = 1;
      ctx.fillStyle = ink;
      ctx.fillText(shortened(text, place.width, measure), place.left, top + 11 * devicePixelRatio);
    });
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
      const { shown, hint } = differenceText(found);
      return { name: one ? label(one) : "", title: one ? hintOf(one) : "", colour: seriesStyle(i), cells: [digits(found.value), digits(found.before), shown], hint };
    });
    const { label: text } = (order ?? { label: "" }) as Mark;
    const at = this.isOverTime ? ` · time ${digits(this.times[this.row ?? this.times.length - 1])}` : "";
    write(this.heading, `cycle ${cycle}${at}${text === "" ? "" : ` · before: ${text}`}`);
    this.heading.title = this.heading.textContent;
    this.table.show(rows);
    // Whoever listens is told of what they went to, and not of each value that comes.
    const said = { valuemin: this.cycles[0], valuemax: last, valuenow: cycle, valuetext: this.row === null ? "the newest values" : [`cycle ${cycle}`, ...rows.map(({ name, cells: [value, before, difference] }) => `${name} ${value}${before === "–" ? "" : `, before ${before}, ${difference}`}`)].join("; ") };
    for (const [name, value] of Object.entries(said)) this.canvas.setAttribute(`aria-${name}`, String(value));
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

/** Series of one unit share an axis, and of those without a unit the ones of one name: the same field at two pins. */
const scaleOf = ({ unit, name }: Series): string => (unit ? `unit ${unit}` : `name ${name}`);

/** A series in words: what it is of and its unit, before which stands at which pin it is read. */
function label({ source, name, unit }: Series): string {
  const [, pin] = PIN.exec(source) ?? [];
  return `${pin === undefined ? monitorText(name) : `${pin}: ${name}`}${unit ? ` [${unit}]` : ""}`;
}

/** A series in words, with the name by which conditions and files call it where it is a monitor. */
function hintOf(series: Series): string {
  if (series.source === MESH) return "The smallest scaled Jacobian of all cells, as the run tells it";
  return PIN.test(series.source) ? label(series) : `${label(series)}: ${monitorHint(series.source, series.name)}`;
}

/** A difference beyond which a part in the hundred says less than the difference itself. */
const LARGE = 1000;

/** By how much a value is another one than before: in percent where that says something, else as it is; the hint has both. */
function differenceText({ before, difference }: Comparison): { shown: string; hint: string } {
  if (difference === null) return { shown: "–", hint: "" };
  const signed = (value: number, unit: string): string => `${value > 0 ? "+" : ""}${digits(value, 3)}${unit}`;
  const percent = before ? (100 * difference) / Math.abs(before) : null;
  const [plain, part] = [signed(difference, ""), percent === null ? "" : signed(percent, "\u00a0%")];
  if (difference === 0) return { shown: "0", hint: "unchanged" };
  return { shown: percent !== null && Math.abs(percent) < LARGE ? part : plain, hint: part === "" ? plain : `${plain} (${part})` };
}
