/** The table beside a plot. What stands in it changes in place, so that text that is chosen and readers of the screen keep to it. */
import { element, identifier, write } from "../dom";

export interface Row {
  name: string;
  /** What stands under the pointer at the name; left out, the name. */
  title?: string;
  /** The colour of what is drawn for it. */
  colour: string;
  /** A text for each heading. */
  cells: readonly string[];
  /** What the last cell says more of under the pointer. */
  hint?: string;
}

/** The elements of a row. */
interface Parts { row: HTMLElement; head: HTMLElement; sign: HTMLElement; name: HTMLElement; cells: readonly HTMLElement[] }

export class ValueTable {
  readonly element: HTMLTableElement;
  private readonly body = element("tbody");
  private readonly rows: Parts[] = [];

  /** `title` is what stands above it, in an element of the caller's own. */
  constructor(private readonly headings: readonly string[], title: HTMLElement | null = null) {
    const titles = [element("td"), ...headings.map((text) => element("th", { scope: "col" }, text))];
    if (title) title.id ||= identifier("table-title");
    this.element = element("table", { "aria-labelledby": title?.id }, element("thead", {}, element("tr", {}, ...titles)), this.body);
    this.show([]);
  }

  show(rows: readonly Row[]): void {
    // Headings alone say nothing.
    this.element.tHead!.hidden = rows.length === 0;
    for (const { row } of this.rows.splice(rows.length)) row.remove();
    for (const [index, { name, title = name, colour, cells, hint = "" }] of rows.entries()) {
      const parts = this.rows[index] ?? this.append();
      parts.sign.style.background = colour;
      write(parts.name, name);
      // A long word is cut off where the numbers leave it too little room.
      parts.head.title = title;
      parts.cells.forEach((cell, i) => write(cell, cells[i] ?? ""));
      const last = parts.cells.at(-1);
      if (last) last.title = hint;
    }
  }

  private append(): Parts {
    // The colour stands beside the name, which stays as readable as the rest.
    const [sign, name, cells] = [element("span", { class: "colour", "aria-hidden": "true" }), element("span"), this.headings.map(() => element("td"))];
    const head = element("th", { scope: "row" }, sign, name);
    const row = element("tr", {}, head, ...cells);
    this.body.append(row);
    const parts = { row, head, sign, name, cells };
    this.rows.push(parts);
    return parts;
  }
}
