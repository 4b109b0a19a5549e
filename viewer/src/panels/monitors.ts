/** The newest values of the monitors. */
import type { Monitor, MonitorInformation } from "../connection/protocol";
import { element, part, write } from "../dom";
import { seriesKey } from "../history/series";
import { digits } from "../number";

/** The most values that are shown. */
const ROWS = 100;

/** The newest values of each monitor. */
export class MonitorPanel {
  private readonly rows = new Map<string, { row: HTMLElement; shown: HTMLElement }>();

  constructor(private readonly root: HTMLElement) {}

  update(monitor: Monitor): void {
    for (const [name, value] of Object.entries(monitor.values ?? {})) {
      const key = seriesKey(monitor.pipeline, name);
      let known = this.rows.get(key);
      if (!known) {
        if (this.rows.size >= ROWS) continue;
        const shown = element("output", {});
        known = { shown, row: element("div", { class: "monitor", title: `pipeline ${monitor.pipeline}` }, element("span", {}, name), shown) };
        this.rows.set(key, known);
        this.root.append(known.row);
      }
      write(known.shown, digits(value, 4));
    }
    this.hide();
  }

  /** The monitors that there are now: a value of another one will never be a new one again. */
  keep(monitors: readonly MonitorInformation[]): void {
    const now = new Set(monitors.map(({ pipeline, name }) => seriesKey(pipeline, name)));
    for (const [key, { row }] of this.rows) {
      if (now.has(key)) continue;
      row.remove();
      this.rows.delete(key);
    }
    this.hide();
  }

  private hide(): void {
    part("monitors-panel").hidden = this.rows.size === 0;
  }
}
