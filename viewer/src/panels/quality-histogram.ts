/** The scaled Jacobian of all cells before an order and after it, as bars in the details of the forecast. */
import type { QualitySummary } from "../connection/protocol";
import { part, svg, write } from "../dom";
import { digits } from "../number";
import type { Action } from "../store/actions";
import type { State } from "../store/state";
import type { Store } from "../store/store";

const WIDTH = 260, HEIGHT = 60;

/** One class of a histogram: the values it spans, and how many cells are in it. */
export interface QualityClass { from: number; to: number; before: number; after: number }

/** The classes from the worst that has a cell up to 1; empty where the histograms are not told, or do not fit each other. */
export function qualityClasses(before: QualitySummary | null | undefined, after: QualitySummary | null | undefined): QualityClass[] {
  const [one, other] = [before?.histogram ?? [], after?.histogram ?? []];
  if (one.length === 0 || one.length !== other.length) return [];
  const width = 2 / one.length;
  const all = one.map((count, i) => ({ from: width * i - 1, to: width * (i + 1) - 1, before: count, after: other[i]! }));
  const first = all.findIndex((each) => each.before > 0 || each.after > 0);
  return first < 0 ? [] : all.slice(first);
}

/** The height of a bar, from 0 to 1. It is logarithmic: the few bad cells matter, and would not be seen beside the many good ones. */
export const barHeight = (count: number, most: number): number => Math.log1p(count) / Math.log1p(Math.max(1, most));

export class QualityHistogram {
  private readonly chart = part("quality-histogram");
  private shown: unknown = null;

  constructor(store: Store<State, Action>) {
    store.watch((state) => state.forecast, ({ state, answer }) => {
      if (state === "waiting") return;
      const told = state === "told" ? answer : null;
      if (told === this.shown) return;
      this.shown = told;
      this.draw(qualityClasses(told?.quality_before, told?.quality));
    });
  }

  private draw(classes: readonly QualityClass[]): void {
    this.chart.hidden = classes.length === 0;
    if (classes.length === 0) return;
    const most = Math.max(...classes.flatMap(({ before, after }) => [before, after]));
    const width = WIDTH / classes.length;
    const bars = classes.flatMap(({ from, to, before, after }, i) => ([["before", before], ["after", after]] as const).map(([name, count], side) => {
      const height = HEIGHT * barHeight(count, most);
      const bar = svg("rect", {
        class: name, x: (width * (i + 0.08 + 0.42 * side)).toFixed(2), y: (HEIGHT - height).toFixed(2), width: (0.42 * width).toFixed(2), height: height.toFixed(2),
      });
      const title = svg("title");
      title.textContent = `scaled Jacobian ${digits(from, 2)} to ${digits(to, 2)}: ${before} cells before, ${after} after`;
      bar.append(title);
      return bar;
    }));
    const drawing = this.chart.querySelector("svg")!;
    drawing.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
    drawing.replaceChildren(...bars);
    drawing.setAttribute("aria-label", `Cells by scaled Jacobian before and after: ${classes.map(({ from, to, before, after }) =>
      `${digits(from, 2)} to ${digits(to, 2)}, ${before} and ${after}`).join("; ")}`);
    write(part("quality-histogram-from"), digits(classes[0]!.from, 2));
  }
}
