/** The newest values of the monitors. */
import type { Monitor, MonitorInformation } from "../connection/protocol";
import { element, part, write } from "../dom";
import { monitorHint, monitorText } from "../history/monitor-names";
import { seriesKey } from "../history/series";
import { digits } from "../number";

/** The most values that are shown. */
const ROWS = 100;

interface Row { row: HTMLElement; shown: HTMLElement; value: number | null }

/** The newest values of each monitor. */
export class MonitorPanel {
  private readonly rows = new Map<string, Row>();
  /** The units of those whose unit is known. */
  private units: ReadonlyMap<string, string> = new Map();

  constructor(private readonly root: HTMLElement) {}

  update(monitor: Monitor): void {
    for (const [name, value] of Object.entries(monitor.values ?? {})) {
      const key = seriesKey(monitor.pipeline, name);
      let known = this.rows.get(key);
      if (!known) {
        if (this.rows.size >= ROWS) continue;
        const shown = element("output", {});
        known = { shown, value, row: element("div", { class: "monitor", title: monitorHint(monitor.pipeline, name) }, element("span", {}, monitorText(name)), shown) };
        this.rows.set(key, known);
        this.root.append(known.row);
      }
      known.value = value;
      this.say(key, known);
    }
    this.hide();
  }

  /** The monitors that there are now: a value of another one will never be a new one again. */
  keep(monitors: readonly MonitorInformation[]): void {
    const now = new Set(monitors.map(({ pipeline, name }) => seriesKey(pipeline, name)));
    this.units = new Map(monitors.flatMap(({ pipeline, name, unit }): [string, string][] => (unit ? [[seriesKey(pipeline, name), unit]] : [])));
    for (const [key, known] of this.rows) {
      if (now.has(key)) {
        this.say(key, known);
        continue;
      }
      known.row.remove();
      this.rows.delete(key);
    }
    this.hide();
  }

  private say(key: string, { shown, value }: Row): void {
    const unit = value === null ? undefined : this.units.get(key);
    write(shown, `${digits(value, 4)}${unit === undefined ? "" : `\u00a0${unit}`}`);
  }

  private hide(): void {
    part("monitors-panel").hidden = this.rows.size === 0;
  }
}
