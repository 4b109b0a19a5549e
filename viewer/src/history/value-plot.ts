/** A plot of values now and before the last order, with a table of their least, mean and largest. */
import type uPlot from "uplot";
import { element } from "../dom";
import { digits } from "../number";
import type { Action } from "../store/actions";
import type { State } from "../store/state";
import type { Store } from "../store/store";
import type { Tab } from "./dock";
import { seriesStyle } from "./plotting";
import { ValueTable } from "./table";

/** The least, mean and largest of some values. */
export type Spread = readonly [least: number, mean: number, largest: number];

export abstract class ValuePlot implements Tab {
  abstract readonly title: string;
  abstract readonly tools: readonly HTMLElement[];
  abstract readonly isEmpty: boolean;
  readonly body: HTMLElement;
  protected readonly canvas = element("div", { class: "plot" });
  protected readonly heading = element("span", { class: "hint" });
  /** What stands beside the plot: the table. */
  protected readonly values: HTMLElement;
  protected plot: uPlot | null = null;
  private readonly table = new ValueTable(["least", "mean", "largest"]);
  private isShown = false;
  private waiting: number | null = null;

  /** `rest` is the shortest time between two drawings of new values, in milliseconds. */
  protected constructor(store: Store<State, Action>, private readonly rest: number) {
    this.values = element("div", { class: "values" }, this.table.element);
    this.body = element("div", { class: "dock-body" }, this.canvas, this.values);
    new ResizeObserver(() => { if (this.isShown && this.canvas.clientWidth > 0) this.plot?.setSize(this.size()); }).observe(this.canvas);
    store.watch((state) => [state.looks, state.chosenView], () => this.update(), (a, b) => a.every((value, i) => Object.is(value, b[i])));
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
    if (!this.isShown) return;
    this.waiting ??= window.setTimeout(() => {
      this.waiting = null;
      if (this.isShown) this.draw();
    }, this.rest);
  }

  protected abstract draw(): void;

  /** Fills the table; null where there is nothing of that moment. */
  protected fill(now: Spread | null, before: Spread | null, earlier: string): void {
    const rows = [{ name: "now", spread: now }, { name: earlier, spread: before }].map(({ name, spread }, i) =>
      (spread ? { name, colour: seriesStyle(i), cells: spread.map((value) => digits(value)) } : null));
    this.table.show(rows.filter((row) => row !== null));
  }

  protected size(): { width: number; height: number } {
    return { width: Math.max(120, this.canvas.clientWidth), height: Math.max(80, this.canvas.clientHeight) };
  }
}
