/** The newest values of the monitors. */
import type { Monitor } from "../connection/protocol";
import { element, part } from "../dom";
import { digits } from "../number";

/** The newest values of each monitor. */
export class MonitorPanel {
  private readonly rows = new Map<string, HTMLElement>();

  constructor(private readonly root: HTMLElement) {}

  update(monitor: Monitor): void {
    part("monitors-panel").hidden = false;
    for (const [name, value] of Object.entries(monitor.values ?? {})) {
      const key = `${monitor.pipeline} ${name}`;
      let shown = this.rows.get(key);
      if (!shown) {
        if (this.rows.size >= 100) return;
        shown = element("output", {});
        this.rows.set(key, shown);
        this.root.append(element("div", { class: "monitor", title: `pipeline ${monitor.pipeline}` }, element("span", {}, name), shown));
      }
      shown.textContent = digits(value, 4);
    }
  }
}
