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

interface Row { input: HTMLInputElement; wrong: HTMLElement }

export class ParameterPanel {
  private readonly rows = new Map<string, Row>();
  /** Messages that wait for an answer, and the parameter that each sets. */
  private readonly asked = new Map<string, string>();

  constructor(private readonly root: HTMLElement, private readonly store: Store<State, Action>, private readonly commands: Commands) {
    const shape = (state: State): unknown => state.hello?.parameters.map(({ name, minimum, maximum }) => [name, minimum, maximum]) ?? [];
    store.watch(shape, () => this.build(store.state.hello?.parameters ?? []), sameJson);
    store.watch((state) => state.hello?.parameters ?? [], (parameters) => this.show(parameters), sameJson);
    store.watch(whyNotSteering, (why) => this.allow(why));
  }

  /** What the simulation says to a message of this panel; whether it was one. */
  refused(id: string, text: string): boolean {
    const row = this.rows.get(this.asked.get(id) ?? "");
    this.asked.delete(id);
    if (row) mark(row.input, row.wrong, text);
    return row !== undefined;
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
      const input = this.rows.get(name)?.input;
      // A hand may be on it.
      if (input && input !== document.activeElement) input.value = numberText(value);
    }
  }

  private allow(why: string): void {
    for (const { input } of this.rows.values()) {
      input.disabled = why !== "";
      input.title = why;
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
        if (typeof value !== "number") return;
        const sent = this.commands.setParameter(parameter.name, value);
        if (sent === null) mark(input, wrong, "There is no connection to the simulation; nothing was sent.");
        else this.asked.set(sent, parameter.name);
        if (this.asked.size > 100) this.asked.delete(this.asked.keys().next().value!);
      },
    });
    this.rows.set(parameter.name, { input, wrong });
    const bounded = typeof minimum === "number" && typeof maximum === "number";
    return element("div", { class: "field" }, element("label", { for: id }, words(parameter.name),
      bounded ? element("small", {}, `${digits(minimum, 3)} to ${digits(maximum, 3)}`) : null), input, wrong);
  }
}
