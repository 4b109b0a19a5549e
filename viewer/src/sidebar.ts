/** The left side: views, colouring, parameters and monitors. */
import { COLOUR_MAPS, colourMap, componentNames } from "./colour";
import type { ColourMap, Colouring } from "./colour";
import { InputError, readInput } from "./controls";
import { element, identifier, part } from "./dom";
import { digits, readNumber, within, words } from "./number";
import type { FieldInformation, Monitor, ParameterInformation, ViewInformation } from "./protocol";
import type { Scene } from "./scene";

export class ViewList {
  private key = "";

  constructor(private readonly root: HTMLElement, private readonly scene: Scene) {}

  set(views: readonly ViewInformation[]): void {
    const key = JSON.stringify(views);
    if (key === this.key) return;
    this.key = key;
    this.root.replaceChildren(...views.map((view) => this.row(view)));
    if (views.length === 0) this.root.replaceChildren(element("p", { class: "hint" }, "No views are streamed."));
  }

  private row(view: ViewInformation): HTMLElement {
    const layer = this.scene.layers.get(view.name);
    const id = identifier("view");
    const slider = element("input", {
      type: "range", min: 0, max: 100, step: 5, value: Math.round((layer?.opacity ?? 1) * 100), "aria-label": `opacity of ${view.name}`,
      title: "opacity", oninput: () => this.scene.setOpacity(view.name, Number(slider.value) / 100),
    });
    const box = element("input", {
      type: "checkbox", id, onchange: () => {
        this.scene.setVisible(view.name, box.checked);
        slider.disabled = !box.checked;
      },
    });
    box.checked = layer?.visible ?? true;
    const coloured = element("input", {
      type: "checkbox", "aria-label": `${view.name}: coloured by the field`,
      onchange: () => this.scene.setColoured(view.name, coloured.checked),
    });
    coloured.checked = layer?.coloured ?? true;
    return element("div", { class: "view", "data-view": view.name }, box,
      element("label", { for: id }, view.name, view.kind === view.name ? null : element("small", {}, view.kind)),
      element("label", { class: "coloured", title: "colour by the field" }, coloured, "field"), slider);
  }
}

/** The choice of field, component, colour map and range; keeps what was chosen as long as the field exists. */
export class ColourPanel {
  private fields: FieldInformation[] = [];
  private readonly field = part("colour-field") as HTMLSelectElement;
  private readonly component = part("colour-component") as HTMLSelectElement;
  private readonly map = part("colour-map") as HTMLSelectElement;
  private readonly lock = part("range-lock") as HTMLInputElement;
  private readonly low = part("range-low") as HTMLInputElement;
  private readonly high = part("range-high") as HTMLInputElement;
  private range: [number, number] | null = null;

  constructor(private readonly scene: Scene, private readonly shown: (colouring: Colouring | null, map: ColourMap) => void) {
    this.map.replaceChildren(...COLOUR_MAPS.map((map) => element("option", { value: map.name }, map.title)));
    this.field.addEventListener("change", () => {
      this.lock.checked = false;
      this.components();
      this.apply();
    });
    this.component.addEventListener("change", () => {
      this.lock.checked = false;
      this.apply();
    });
    for (const input of [this.map, this.lock, this.low, this.high]) input.addEventListener("change", () => this.apply());
  }

  set(fields: FieldInformation[]): void {
    if (JSON.stringify(fields) === JSON.stringify(this.fields)) return;
    this.fields = fields;
    const before = this.field.value;
    this.field.replaceChildren(...fields.map((field) => element("option", { value: field.name }, words(field.name))), element("option", { value: "" }, "solid colour"));
    const kept = fields.find((field) => field.name === before) ?? fields.find((field) => field.components === 3) ?? fields[0];
    this.field.value = kept?.name ?? "";
    this.components();
    this.apply();
  }

  /** The range of the values that are drawn now. */
  setRange(range: [number, number] | null): void {
    this.range = range;
    if (this.lock.checked) return;
    for (const [input, value] of [[this.low, range?.[0]], [this.high, range?.[1]]] as const) {
      if (document.activeElement !== input) input.value = value === undefined || !range ? "" : within(value, range);
    }
  }

  private components(): void {
    const count = this.fields.find((field) => field.name === this.field.value)?.components ?? 1;
    const names = count > 1 ? componentNames(count) : [];
    this.component.replaceChildren(element("option", { value: -1 }, "magnitude"), ...names.map((name, i) => element("option", { value: i }, name)));
    this.component.disabled = count <= 1;
    this.component.hidden = count <= 1;
  }

  private apply(): void {
    const colouring = this.field.value === "" ? null : { field: this.field.value, component: Number(this.component.value) };
    const map = colourMap(this.map.value);
    for (const input of [this.low, this.high]) {
      input.disabled = !this.lock.checked;
      input.removeAttribute("aria-invalid");
    }
    let locked: [number, number] | null = null;
    if (this.lock.checked) {
      const low = readNumber(this.low.value);
      const high = readNumber(this.high.value);
      if (low !== null && high !== null && low < high) locked = [low, high];
      else if (low === null) this.low.setAttribute("aria-invalid", "true");
      else this.high.setAttribute("aria-invalid", "true");
      locked ??= this.range;
    }
    this.scene.setColouring(colouring, map, locked);
    this.shown(colouring, map);
  }
}

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
