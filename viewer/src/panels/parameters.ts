/** The parameters that the solver declared, to be set while it runs. */
import type { ParameterInformation } from "../connection/protocol";
import { element, identifier, part } from "../dom";
import { InputError, readInput } from "../form/controls";
import { digits, words } from "../number";

/** Parameters that the solver declared: a number each, with its bounds. */
export class ParameterPanel {
  private key = "";

  constructor(private readonly root: HTMLElement, private readonly send: (name: string, value: number) => void, private readonly trouble: (text: string) => void) {}

  set(parameters: readonly ParameterInformation[], enabled: boolean): void {
    part("parameters-panel").hidden = parameters.length === 0;
    const key = JSON.stringify([parameters, enabled]);
    if (key === this.key || this.root.contains(document.activeElement)) return;
    this.key = key;
    this.root.replaceChildren(...parameters.map((parameter) => this.row(parameter, enabled)));
  }

  private row(parameter: ParameterInformation, enabled: boolean): HTMLElement {
    const id = identifier("parameter");
    const field = {
      kind: "number" as const, integer: false, minimum: parameter.minimum ?? -Infinity, maximum: parameter.maximum ?? Infinity,
      exclusiveMinimum: false, exclusiveMaximum: false,
    };
    const input = element("input", {
      type: "text", inputmode: "decimal", id, value: String(parameter.value), disabled: !enabled, autocomplete: "off", "data-parameter": parameter.name,
      onchange: () => {
        try {
          this.send(parameter.name, readInput(input, field, words(parameter.name)));
        } catch (error) {
          this.trouble(error instanceof InputError ? error.message : String(error));
        }
      },
    });
    const bounded = parameter.minimum !== null && parameter.minimum !== undefined && parameter.maximum !== null && parameter.maximum !== undefined;
    return element("div", { class: "field" }, element("label", { for: id }, words(parameter.name),
      bounded ? element("small", {}, `${digits(parameter.minimum, 3)} to ${digits(parameter.maximum, 3)}`) : null), input);
  }
}
