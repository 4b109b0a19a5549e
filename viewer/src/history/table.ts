/** The table beside a plot. What stands in it changes in place, so that text that is chosen and readers of the screen keep to it. */
import { element, write } from "../dom";

export interface Row {
  name: string;
  /** The colour of what is drawn for it. */
  colour: string;
  /** A text for each heading. */
  cells: readonly string[];
}

/** The elements of a row. */
interface Parts { row: HTMLElement; sign: HTMLElement; name: HTMLElement; cells: readonly HTMLElement[] }

export class ValueTable {
  readonly element: HTMLTableElement;
  private readonly body = element("tbody");
  private readonly rows: Parts[] = [];

  constructor(private readonly headings: readonly string[], caption: Node | null = null) {
    const titles = [element("td"), ...headings.map((text) => element("th", { scope: "col" }, text))];
    this.element = element("table", {}, caption && element("caption", {}, caption), element("thead", {}, element("tr", {}, ...titles)), this.body);
    this.show([]);
  }

  show(rows: readonly Row[]): void {
    // Headings alone say nothing.
    this.element.tHead!.hidden = rows.length === 0;
    for (const { row } of this.rows.splice(rows.length)) row.remove();
    for (const [index, { name, colour, cells }] of rows.entries()) {
      const parts = this.rows[index] ?? this.append();
      parts.sign.style.background = colour;
      write(parts.name, name);
      parts.cells.forEach((cell, i) => write(cell, cells[i] ?? ""));
    }
  }

  private append(): Parts {
    // The colour stands beside the name, which stays as readable as the rest.
    const [sign, name, cells] = [element("span", { class: "colour", "aria-hidden": "true" }), element("span"), this.headings.map(() => element("td"))];
    const row = element("tr", {}, element("th", { scope: "row" }, sign, name), ...cells);
    this.body.append(row);
    const parts = { row, sign, name, cells };
    this.rows.push(parts);
    return parts;
  }
}
