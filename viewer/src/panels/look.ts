/** How the chosen view looks: by which field it is coloured, on which map, over which range; and its edges. */
import { element, identifier, markWrong, write } from "../dom";
import { exactCell } from "../exact";
import { readNumber, whyNoNumber, words } from "../number";
import { own } from "../own";
import { COLOUR_MAPS, componentNames, gradient, colourMap } from "../picture/colour";
import { about0, textIn, whyNoEnds, withTyped } from "../picture/ranges";
import type { Range, RangeChoice, RangeKind } from "../picture/ranges";
import type { Bar } from "../picture/scene";
import type { Action } from "../store/actions";
import { choicesOf, fieldNamed } from "../store/fields";
import { EDGES } from "../store/looks";
import type { Look } from "../store/looks";
import { QUALITY } from "../store/pipelines";
import { whyNotSteering } from "../store/run";
import type { State } from "../store/state";
import { sameParts } from "../store/store";
import type { Store } from "../store/store";

const RANGES: readonly [RangeKind, string][] = [["auto", "of each frame"], ["over time", "of all so far"], ["fixed", "fixed"]];

/** What a colour map is for stands above those of its kind: beside its name there is no room. */
const MAP_KINDS = [...new Set(COLOUR_MAPS.map(({ kind }) => kind))];
const option = (value: string | number, text: string): HTMLElement => element("option", { value }, text);

export class LookPanel {
  private readonly heading = element("h2");
  private readonly field = element("select", { onchange: () => this.change({ field: this.field.value === "" ? null : this.field.value, component: -1 }) });
  private readonly component = element("select", { onchange: () => this.change({ component: Number(this.component.value) }) });
  private readonly map = element("select", { onchange: () => this.change({ map: this.map.value }) }, ...MAP_KINDS.map((label) => element("optgroup", { label }, ...COLOUR_MAPS.filter(({ kind }) => kind === label).map(({ name, title }) => option(name, title)))));
  private readonly sample = element("div", { class: "sample", "aria-hidden": "true" });
  private readonly kind = element("select", { onchange: () => this.changeKind(this.kind.value as RangeKind) }, ...RANGES.map(([kind, text]) => option(kind, text)));
  private readonly low = this.end("lowest value");
  private readonly high = this.end("highest value");
  private readonly ends = [this.low, this.high].map((input) => [input, exactCell(input)] as const);
  private readonly unit = element("span", { class: "unit" });
  private readonly symmetric = element("input", { type: "checkbox", onchange: () => this.centre(this.symmetric.checked) });
  private readonly logarithmic = element("input", { type: "checkbox", onchange: () => this.changeRange({ logarithmic: this.logarithmic.checked, symmetric: false }) });
  private readonly edges = element("select", { onchange: () => this.change({ edges: this.edges.value as Look["edges"] }) }, ...EDGES.map((edges) => option(edges, edges === "none" ? "none" : `of ${edges === "mesh" ? "the mesh" : "features"}`)));
  private readonly rows: HTMLElement;
  private readonly quality = element("button", { type: "button", class: "small", title: "Has the quality of the cells streamed with this view", onclick: () => this.byQuality() }, "Colour by mesh quality");
  private readonly problem = element("p", { class: "wrong", role: "alert", hidden: true });
  private shown: Range | null = null;
  /** The look for which something was typed that is no range: it stays there, to be mended, until the look is another one. */
  private wrongIn: Look | null = null;

  /** `measure` has the quality of its cells streamed with a view. */
  constructor(root: HTMLElement, private readonly store: Store<State, Action>, private readonly measure: (view: string) => void) {
    const row = (text: string, control: HTMLElement): HTMLElement => {
      control.id = identifier("look");
      return element("div", { class: "field" }, element("label", { for: control.id }, text), control);
    };
    const component = row("component", this.component);
    component.id = "component-row";
    this.rows = element("div", {}, row("field", this.field), component,
      element("div", { class: "coloured" }, row("colours", this.map), this.sample, row("range", this.kind),
        element("div", { class: "range" }, this.low, element("span", { "aria-hidden": "true" }, "to"), this.high, this.unit), this.problem,
        element("div", { class: "checks" }, element("label", {}, this.symmetric, "about 0"), element("label", {}, this.logarithmic, "logarithmic"))),
      row("edges", this.edges),
      element("button", { type: "button", class: "small", title: "Colour every view like this one", onclick: () => this.spread() }, "Use for all views"), this.quality);
    root.replaceChildren(this.heading, this.rows);
    store.watch(whyNotSteering, (why) => {
      this.quality.disabled = why !== "";
      this.quality.title = why === "" ? "Has the quality of the cells streamed with this view" : why;
    });
    store.watch((state) => [state.looks, state.chosenView, state.hello?.fields, state.carried], () => this.show(), sameParts);
  }

  /** What the colours of the picture stand for now. */
  setBars(bars: readonly Bar[]): void {
    const { chosenView } = this.store.state;
    this.shown = bars.find((bar) => chosenView !== null && bar.views.includes(chosenView))?.range ?? null;
    this.showEnds();
  }

  private get look(): Look | null {
    const { looks, chosenView } = this.store.state;
    return chosenView === null ? null : own(looks, chosenView) ?? null;
  }

  private change(look: Partial<Look>): void {
    this.store.dispatch({ type: "look", view: this.store.state.chosenView ?? "", look });
  }

  private changeRange(range: Partial<RangeChoice>): void {
    if (this.look) this.change({ range: { ...this.look.range, ...range } });
  }

  private changeKind(kind: RangeKind): void {
    const [low, high] = this.shown ?? [0, 1];
    this.changeRange(kind === "fixed" ? { kind, low, high } : { kind });
  }

  private byQuality(): void {
    const { chosenView } = this.store.state;
    if (chosenView === null) return;
    this.measure(chosenView);
    this.change({ field: QUALITY, component: -1 });
  }

  private spread(): void {
    if (!this.look) return;
    const { field, component, map, range, edges } = this.look;
    this.store.dispatch({ type: "look", view: null, look: { field, component, map, range, edges } });
  }

  private end(label: string): HTMLInputElement {
    const input: HTMLInputElement = element("input", { type: "text", inputmode: "decimal", "aria-label": label, autocomplete: "off", onchange: () => this.typed() });
    return input;
  }

  /** A number typed at either end fixes the range. */
  private typed(): void {
    // An end that is left empty is as it was.
    const [low, high] = this.ends.map(([input, cell], i) => cell.untouched() ?? (input.value.trim() === "" ? this.range?.[i] ?? null : readNumber(input.value))) as [number | null, number | null];
    const { look } = this;
    const wrong = low === null || high === null
      ? [low, high].map((value, i) => (value === null ? whyNoNumber(this.ends[i]![0].value) : ""))
      : whyNoEnds([low, high], look?.range.logarithmic === true);
    this.wrongIn = wrong.some((why) => why !== "") ? look : null;
    this.say(wrong);
    if (look && low !== null && high !== null && !this.wrongIn) this.change({ range: withTyped(look.range, [low, high]) });
  }

  /** Says what is wrong with the ends of the range; empty for nothing. */
  private say(wrong: readonly string[]): void {
    this.ends.forEach(([input], i) => markWrong(input, wrong[i] ?? ""));
    const text = wrong.flatMap((why, i) => (why === "" ? [] : [`${i === 0 ? "Lowest" : "Highest"} value: ${why}.`])).join(" ");
    write(this.problem, text);
    this.problem.hidden = text === "";
  }

  /** Has the range lie about 0, or no more: a fixed one is then another, as its ends say. */
  private centre(symmetric: boolean): void {
    const { look } = this;
    if (!look) return;
    const [low, high] = symmetric && look.range.kind === "fixed" ? about0([look.range.low, look.range.high]) : [look.range.low, look.range.high];
    this.changeRange({ low, high, symmetric, logarithmic: false });
  }

  private show(): void {
    const { look } = this;
    const { state } = this.store;
    const { chosenView } = state;
    this.rows.hidden = look === null;
    write(this.heading, chosenView === null ? "Look" : `Look of ${chosenView}`);
    if (!look || chosenView === null) return;
    const choices = choicesOf(state, chosenView);
    // One that was asked for has not come yet.
    if (look.field !== null && !choices.some(({ name }) => name === look.field)) choices.push({ name: look.field, isCarried: false });
    const title = (name: string): string => own(FIELD_TITLES, name) ?? words(name);
    fill(this.field, [...choices.map(({ name, isCarried }): Choice => (isCarried ? [name, title(name)] : [name, `${title(name)} (not in this view)`, true])), ["", "none"]]);
    const field = fieldNamed(state, look.field, chosenView);
    write(this.unit, field?.unit ?? "");
    this.field.value = look.field ?? "";
    const count = field?.components ?? 1;
    fill(this.component, count > 1 ? [["-1", "magnitude"], ...componentNames(count).map((name, i): Choice => [String(i), name])] : []);
    this.component.value = String(look.component);
    this.component.hidden = count <= 1;
    this.map.value = look.map;
    this.sample.style.background = gradient(colourMap(look.map), "to right");
    this.kind.value = look.range.kind;
    this.symmetric.checked = look.range.symmetric;
    this.logarithmic.checked = look.range.logarithmic;
    this.edges.value = look.edges;
    this.rows.querySelector<HTMLElement>(".coloured")!.hidden = look.field === null;
    this.showEnds();
  }

  /** What the ends of the range are now, where that is known. */
  private get range(): Range | null {
    const { look } = this;
    return look?.range.kind === "fixed" ? [look.range.low, look.range.high] : this.shown;
  }

  private showEnds(): void {
    const { look } = this;
    if (look && look === this.wrongIn) return;
    this.wrongIn = null;
    const { range } = this;
    this.ends.forEach(([input, cell], i) => {
      if (document.activeElement === input) return;
      if (range) cell.write(range[i]!, textIn(range[i]!, range, look?.range.logarithmic === true));
      else cell.write(null, "");
    });
    // What was fixed before it was to be logarithmic may be none of that.
    this.say(look?.range.kind === "fixed" ? whyNoEnds([look.range.low, look.range.high], look.range.logarithmic) : []);
  }
}

/** What a field that has a name of the library's own is called on the page. */
export const FIELD_TITLES: Readonly<Record<string, string>> = { [QUALITY]: "mesh quality" };

/** A choice of a list: its value, its text, and whether it cannot be taken. */
type Choice = readonly [value: string, text: string, disabled?: boolean];

function fill(select: HTMLSelectElement, choices: readonly Choice[]): void {
  const key = JSON.stringify(choices);
  if (select.dataset.options === key) return;
  select.dataset.options = key;
  select.replaceChildren(...choices.map(([value, text, disabled = false]) => element("option", { value, disabled }, text)));
}
