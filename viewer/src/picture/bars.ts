/** The scalar bars: what the colours in the picture stand for. A number typed at the end of one fixes its range. */
import { element, markWrong, write } from "../dom";
import { exactCell } from "../exact";
import type { ExactCell } from "../exact";
import { readNumber, whyNoNumber, words } from "../number";
import { GREY, NO_NUMBER_TEXT, colourMap, componentNames, gradient } from "./colour";
import { isOfOneValue, onScale, textIn, whyNoEnds } from "./ranges";
import type { Range } from "./ranges";
import type { Bar } from "./scene";

const TICKS = 6;
const HINT = "Type a number to fix the range";

/** What a bar is called: its field, and the component of a vector. */
export interface BarText { title: string; unit: string | null }

export class ScalarBars {
  private readonly shown = new Map<string, { root: HTMLElement; ticks: HTMLElement[]; ends: [HTMLInputElement, HTMLInputElement]; gaps: HTMLElement; cells: ExactCell[]; range: Range; isLogarithmic: boolean; typed: (range: Range) => void; name: (text: BarText) => void }>();

  /** `fix` is told the range that somebody typed, and the views that it is for. */
  constructor(private readonly root: HTMLElement, private readonly describe: (bar: Bar) => BarText, private readonly fix: (views: readonly string[], range: Range) => void) {}

  /** The bars that are shown. */
  all: readonly Bar[] = [];

  show(bars: readonly Bar[]): void {
    this.all = bars;
    const keys = new Set(bars.map(({ key }) => key));
    for (const [key, { root }] of this.shown) {
      if (keys.has(key)) continue;
      root.remove();
      this.shown.delete(key);
    }
    for (const bar of bars) this.update(bar);
    this.root.hidden = bars.length === 0;
  }

  private update(bar: Bar): void {
    const shown = this.shown.get(bar.key) ?? this.make(bar);
    const { ticks, ends, cells } = shown;
    shown.range = bar.range;
    shown.isLogarithmic = bar.look.range.logarithmic;
    shown.typed = (range) => this.fix(bar.views, range);
    shown.name(this.describe(bar));
    shown.gaps.hidden = !bar.hasGaps;
    const { logarithmic } = bar.look.range;
    const at = (i: number): string => textIn(onScale(bar.range, 1 - i / (TICKS - 1), logarithmic), bar.range, logarithmic);
    ticks.forEach((tick, i) => write(tick, isOfOneValue(bar.range) ? "" : at(i + 1)));
    ends.forEach((input, i) => {
      if (document.activeElement === input) return;
      cells[i]!.write(bar.range[i]!, at(i === 0 ? TICKS - 1 : 0));
      markWrong(input, "", HINT);
    });
  }

  private make(bar: Bar): NonNullable<ReturnType<typeof this.shown.get>> {
    const end = (): HTMLInputElement => element("input", {
      type: "text", inputmode: "decimal", autocomplete: "off", title: HINT, onchange: () => {
        // An end that is left empty is as it was.
        const typed = ends.map((input, i) => cells[i]!.untouched() ?? (input.value.trim() === "" ? shown.range[i]! : readNumber(input.value)));
        ends.forEach((input, i) => markWrong(input, typed[i] === null ? whyNoNumber(input.value) : "", HINT));
        const [low, high] = typed as [number | null, number | null];
        if (low === null || high === null) return;
        const wrong = whyNoEnds([low, high], shown.isLogarithmic);
        ends.forEach((input, i) => markWrong(input, wrong[i]!, HINT));
        if (wrong.every((why) => why === "")) shown.typed([low, high]);
      },
    });
    const ends: [HTMLInputElement, HTMLInputElement] = [end(), end()];
    const cells = ends.map(exactCell);
    const ticks = Array.from({ length: TICKS - 2 }, () => element("li"));
    const colours = element("div", { class: "colours" });
    colours.style.background = gradient(colourMap(bar.look.map), "to top");
    const gap = element("span", { class: "gap" });
    gap.style.background = GREY;
    const gaps = element("div", { class: "gaps" }, gap, NO_NUMBER_TEXT);
    const [title, unit] = [element("span"), element("small")];
    const root = element("div", { class: "scalar-bar", role: "group" }, element("div", { class: "title" }, title, unit),
      element("div", { class: "body" }, colours, element("ol", {}, element("li", {}, ends[1]), ...ticks, element("li", {}, ends[0]))), gaps);
    this.root.append(root);
    // What the run says of a field may come later than its values.
    const name = (text: BarText): void => {
      root.setAttribute("aria-label", text.title);
      ["lowest value", "highest value"].forEach((label, i) => ends[i]!.setAttribute("aria-label", `${text.title}: ${label}`));
      write(title, text.title);
      write(unit, text.unit ?? "");
      unit.hidden = !text.unit;
    };
    const shown = { root, ticks, ends, gaps, cells, range: bar.range, isLogarithmic: bar.look.range.logarithmic, name, typed: (_: Range): void => undefined };
    this.shown.set(bar.key, shown);
    return shown;
  }
}

/** A title with the unit of what it names, in brackets, where there is one. */
export const withUnit = (title: string, unit: string | null): string => (unit ? `${title} [${unit}]` : title);

/** A field and its component in words. */
export function fieldText(field: string, components: number, component: number, title?: string): string {
  const suffix = components <= 1 ? "" : component < 0 ? " magnitude" : ` ${componentNames(components)[component] ?? ""}`;
  return (title ?? words(field)) + suffix;
}
