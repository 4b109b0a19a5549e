/** The tab Histogram: how the values of the field that colours the chosen view are spread over it, now and before the last order. */
import uPlot from "uplot";
import { element, write } from "../dom";
import { digits } from "../number";
import { own } from "../own";
import type { Content, Earlier } from "../picture/earlier";
import type { Action } from "../store/actions";
import type { Look } from "../store/looks";
import type { State } from "../store/state";
import type { Store } from "../store/store";
import { axesOf, labelled, seriesColour } from "./plotting";
import { histogram, weighted } from "./profile";
import type { Weighted } from "./profile";
import { ValuePlot } from "./value-plot";
import type { Spread } from "./value-plot";

const BINS = 48;
/** The shortest time between two drawings of new values, in milliseconds. */
const REST = 500;

export interface HistogramSource {
  /** What a view holds now. */
  content(view: string): Content | null;
  title(look: Look): string;
}

export class HistogramPlot extends ValuePlot {
  readonly title = "Histogram";
  readonly tools: readonly HTMLElement[] = [this.heading];

  constructor(private readonly store: Store<State, Action>, private readonly source: HistogramSource, private readonly earlier: Earlier) {
    super(store, REST);
    this.values.append(element("p", { class: "hint" }, "By area, of the field that colours the chosen view."));
  }

  get isEmpty(): boolean {
    return this.store.state.frames.count === 0;
  }

  protected draw(): void {
    const { chosenView, looks } = this.store.state;
    const look = chosenView === null ? undefined : own(looks, chosenView);
    const of = (content: Content | null | undefined): Weighted | null =>
      content && look?.field != null ? weighted(content.topology, content.frame, look.field, look.component) : null;
    const content = chosenView === null ? null : this.source.content(chosenView);
    const both = [of(content), of(chosenView === null ? null : this.earlier.moment.get(chosenView))];
    const found = both.filter((one) => one !== null);
    write(this.heading, found.length === 0 ? "the chosen view is not coloured by a field" : `${this.source.title(look!)} on ${chosenView} · cycle ${content?.frame.cycle ?? ""}`);
    const [now, before] = both.map((one): Spread | null => one && [one.least, one.mean, one.largest]);
    this.fill(now ?? null, before ?? null, this.earlier.label);
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

  private make(data: uPlot.AlignedData): uPlot {
    const { axis } = axesOf(this.body);
    const [now, before] = [seriesColour(this.body, 0), seriesColour(this.body, 1)];
    const paths = uPlot.paths.stepped!({ align: 1 });
    return new uPlot({
      ...this.size(), padding: [10, 12, 0, 0], legend: { show: false }, scales: { x: { time: false }, y: { range: (_, __, high) => [0, 1.05 * (high ?? 1) || 1] } },
      series: [
        {}, { label: "now", stroke: now, fill: () => `${now()}44`, width: 1.5, paths, points: { show: false } },
        { label: "before", stroke: before, width: 1.5, dash: [6, 4], paths, points: { show: false } },
      ],
      axes: [{ ...axis, size: 30, values: labelled }, { ...axis, size: 50, values: (_, ticks) => ticks.map((tick) => `${digits(tick, 3)} %`) }],
    }, data, this.canvas);
  }
}
