/** The colours of the picture: by which field and component, on which map, over which range. */
import type { FieldInformation } from "../connection/protocol";
import { element, part } from "../dom";
import { readNumber, within, words } from "../number";
import { COLOUR_MAPS, colourMap, componentNames } from "../picture/colour";
import type { ColourMap, Colouring } from "../picture/colour";
import type { Scene } from "../picture/scene";

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
