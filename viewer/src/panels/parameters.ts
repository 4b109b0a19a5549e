/** The parameters that the solver declared, to be set while it runs. What is wrong with one is said beside it. */
import type { ParameterInformation } from "../connection/protocol";
import { element, identifier, part } from "../dom";
import { mark, numberFrom, numberText } from "../form/controls";
import { digits, words } from "../number";
import type { Action } from "../store/actions";
import type { Commands } from "../store/commands";
import { whyNotSteering } from "../store/run";
import type { State } from "../store/state";
import { sameJson } from "../store/store";
import type { Store } from "../store/store";

/** Steps of a slider from one end to the other. */
const STEPS = 200;
/** From this ratio of its bounds on, a slider goes by powers of ten. */
const WIDE = 100;

interface Row {
  input: HTMLInputElement;
  /** Null where the parameter has no bounds. */
  slider: HTMLInputElement | null;
  bounds: Bounds | null;
  /** Whether a hand is on the slider, so that nothing is written under it. */
  isSliding: boolean;
  /** Where the slider was before the hand came. */
  placed: string;
  wrong: HTMLElement;
  /** The value that the run has told last. */
  told: number;
  /** What was written into the input, or sent from it: with anything else in it somebody is about to set something. */
  text: string;
  /** What was typed last, as long as the run has not answered: under what name it was sent, null for not at all, and what the run had then. */
  pending: { id: string | null; value: number; told: number } | null;
}

export class ParameterPanel {
  private readonly rows = new Map<string, Row>();
  /** Messages that wait for an answer, and the parameter that each sets. */
  private readonly asked = new Map<string, string>();

  constructor(private readonly root: HTMLElement, private readonly store: Store<State, Action>, private readonly commands: Commands) {
    const shape = (state: State): unknown => state.hello?.parameters.map(({ name, minimum, maximum, unit }) => [name, minimum, maximum, unit]) ?? [];
    store.watch(shape, () => this.build(store.state.hello?.parameters ?? []), sameJson);
    store.watch((state) => state.hello?.parameters ?? [], (parameters) => this.show(parameters), sameJson);
    store.watch(whyNotSteering, (why) => this.allow(why));
    store.watch(({ connection, hello }) => hello !== null && connection.state === "connected" && !connection.fresh, (isGreeted) => { if (isGreeted) this.greeted(); });
  }

  /** What the simulation says to a message of this panel; whether it was one. */
  refused(id: string, text: string): boolean {
    const row = this.answered(id);
    if (!row) return false;
    mark(row.input, row.wrong, text);
    // It stays there, beside what is wrong with it.
    row.text = "";
    return true;
  }

  /** A message of this panel has taken effect. */
  done(id: string): void {
    const row = this.rows.get(this.asked.get(id) ?? "");
    const before = row?.pending?.told;
    this.answered(id);
    // Another viewer may have set it meanwhile. What the run has told before it had the message says nothing.
    if (row && row.pending === null && before !== undefined && before !== row.told && !isHeld(row)) this.write(row);
  }

  /** The parameter that a message was to set; the message is settled. */
  private answered(id: string): Row | undefined {
    const row = this.rows.get(this.asked.get(id) ?? "");
    this.asked.delete(id);
    if (row?.pending?.id === id) row.pending = null;
    return row;
  }

  /** A connection has begun: what was on its way over the one before may have been lost with it. */
  private greeted(): void {
    this.asked.clear();
    for (const row of this.rows.values()) {
      const { pending, told, input, wrong } = row;
      row.pending = null;
      if (!pending || pending.value === told) continue;
      if (!isHeld(row)) this.write(row);
      const lost = pending.id === null ? `${numberText(pending.value)} was not sent` : `The connection was lost before ${numberText(pending.value)} was confirmed`;
      mark(input, wrong, `${lost}; the run has ${numberText(told)}.`);
    }
  }

  private build(parameters: readonly ParameterInformation[]): void {
    part("parameters-panel").hidden = parameters.length === 0;
    this.rows.clear();
    this.root.replaceChildren(...parameters.map((parameter) => this.row(parameter)));
    this.show(parameters);
    this.allow(whyNotSteering(this.store.state));
  }

  private show(parameters: readonly ParameterInformation[]): void {
    for (const { name, value } of parameters) {
      const row = this.rows.get(name);
      // What the run has not changed stays as it is: it may be on its way there.
      if (!row || row.told === value) continue;
      row.told = value;
      if (row.pending?.value === value) row.pending = null;
      // A hand may be on it.
      if (!isHeld(row)) this.write(row);
    }
  }

  /** Shows what the run has. */
  private write(row: Row): void {
    row.input.value = row.text = numberText(row.told);
    this.slide(row, row.told);
    mark(row.input, row.wrong, "");
  }

  private allow(why: string): void {
    // What is slid now could not be sent.
    if (why !== "") for (const row of this.rows.values()) this.leave(row);
    for (const control of [...this.rows.values()].flatMap(({ input, slider }) => (slider ? [input, slider] : [input]))) {
      control.disabled = why !== "";
      control.title = why;
    }
  }

  private row(parameter: ParameterInformation): HTMLElement {
    const id = identifier("parameter");
    const { minimum, maximum } = parameter;
    const field = {
      kind: "number" as const, integer: false, minimum: minimum ?? -Infinity, maximum: maximum ?? Infinity, exclusiveMinimum: false, exclusiveMaximum: false,
    };
    const wrong = element("small", { class: "wrong", hidden: true, role: "alert", id: identifier("wrong") });
    const input = element("input", {
      type: "text", inputmode: "decimal", id, value: numberText(parameter.value), autocomplete: "off", "data-parameter": parameter.name,
      onchange: () => {
        const value = numberFrom(input.value, field);
        mark(input, wrong, typeof value === "number" ? "" : `${words(parameter.name)} ${value}`);
        if (typeof value === "number") this.ask(row, parameter.name, value);
      },
      // What the run has told while the focus was there.
      onblur: () => { if (input.value === row.text && row.pending === null && input.value !== numberText(row.told)) this.write(row); },
    });
    // Bounds so far apart that the way between them is no number leave a slider no steps.
    const bounds = typeof minimum === "number" && typeof maximum === "number" && minimum < maximum && Number.isFinite(maximum - minimum) ? [minimum, maximum] as const : null;
    const slider = bounds && element("input", {
      type: "range", min: 0, max: STEPS, step: 1, "aria-label": `${words(parameter.name)}, slider`,
      // What it would be set to stands in the input; it is sent once the slider is let go.
      oninput: () => {
        row.isSliding = true;
        input.value = numberText(valueOf(Number(slider!.value) / STEPS, bounds));
        slider!.setAttribute("aria-valuetext", `${input.value} ${parameter.unit ?? ""}`.trim());
        mark(input, wrong, "");
      },
      onchange: () => {
        row.isSliding = false;
        row.placed = slider!.value;
        const value = valueOf(Number(slider!.value) / STEPS, bounds);
        input.value = numberText(value);
        mark(input, wrong, "");
        this.ask(row, parameter.name, value);
      },
      onblur: () => this.leave(row),
      onpointercancel: () => this.leave(row),
      onpointerup: () => letGo(),
      onkeyup: () => letGo(),
    });
    // Let go where it began it has changed nothing, and the browser tells no change. Elsewhere that comes, and sends it.
    const letGo = (): void => { if (slider?.value === row.placed) this.leave(row); };
    const row: Row = { input, slider, isSliding: false, placed: slider?.value ?? "", bounds, wrong, told: parameter.value, text: input.value, pending: null };
    this.rows.set(parameter.name, row);
    this.slide(row, parameter.value);
    const range = `${bounds ? `${digits(bounds[0], 3)} to ${digits(bounds[1], 3)}` : ""} ${parameter.unit ?? ""}`.trim();
    return element("div", { class: "field" }, element("label", { for: id }, words(parameter.name),
      range === "" ? null : element("small", {}, range)), input, slider, wrong);
  }

  /** Sends a value that was typed or slid to. */
  private ask(row: Row, name: string, value: number): void {
    this.slide(row, value);
    const sent = this.commands.setParameter(name, value);
    row.pending = { id: sent, value, told: row.told };
    if (sent === null) return mark(row.input, row.wrong, "There is no connection to the simulation; nothing was sent.");
    row.text = row.input.value;
    this.asked.set(sent, name);
    if (this.asked.size > 100) this.asked.delete(this.asked.keys().next().value!);
  }

  /** No hand is on the slider any more: what was not sent gives way to what was sent before, or else to what the run has. */
  private leave(row: Row): void {
    if (!row.isSliding) return;
    row.isSliding = false;
    if (!row.pending?.id) return this.write(row);
    row.input.value = row.text;
    this.slide(row, row.pending.value);
  }

  /** Puts the slider where a value is. */
  private slide(row: Row, value: number): void {
    const { slider, bounds, isSliding } = row;
    if (!slider || !bounds || isSliding) return;
    slider.value = row.placed = String(Math.round(STEPS * partOf(value, bounds)));
    slider.setAttribute("aria-valuetext", numberText(value));
  }
}

/** Whether a hand may be on it. */
const isHeld = ({ input, isSliding }: Row): boolean => isSliding || input === document.activeElement;

type Bounds = readonly [number, number];
const isWide = ([low, high]: Bounds): boolean => low > 0 && high > WIDE * low;

/** Which part of the way from one bound to the other a value is. */
function partOf(value: number, bounds: Bounds): number {
  const [low, high] = isWide(bounds) ? bounds.map(Math.log) as [number, number] : bounds;
  const within = Math.min(bounds[1], Math.max(bounds[0], value));
  return ((isWide(bounds) ? Math.log(within) : within) - low) / (high - low);
}

/** The value at a part of the way, with no more digits than a step of the slider can mean; the bounds themselves at its ends. */
function valueOf(part: number, bounds: Bounds): number {
  const [low, high] = bounds;
  if (part <= 0 || part >= 1) return part <= 0 ? low : high;
  const value = isWide(bounds) ? low * (high / low) ** part : low + (high - low) * part;
  const power = Math.floor(Math.log10(isWide(bounds) ? value / 100 : (high - low) / STEPS));
  const rounded = power >= 0 ? Math.round(value / 10 ** power) * 10 ** power : Number(value.toFixed(Math.min(100, -power)));
  return Math.min(high, Math.max(low, rounded + 0));
}
