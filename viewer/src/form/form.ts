/** The form for an order: made from the schema that the server sends, never from knowledge of its own. */
import type { Control, Special } from "./controls";
import { InputError, makeControl, objectControl } from "./controls";
import { element, write } from "../dom";
import { digits, words } from "../number";
import type { FeatureInformation, Json } from "../connection/protocol";
import type { OrderForm } from "./schema";
import { orderForm } from "./schema";
import type { Part, Selection } from "../store/selection";

type JsonObject = { [key: string]: Json };
const PARTS: Record<string, Part> = { features: "handle", fixed: "fixed" };
/** Files lie with the solver: no order over the network may name one. */
const FILE = "file";

export class EditForm {
  private form: OrderForm | null = null;
  private source = "";
  private features: FeatureInformation[] = [];
  private action: HTMLSelectElement | null = null;
  private edits: Control[] = [];
  private settings: Control | null = null;
  private readonly table = element("div", { class: "features", role: "group", "aria-label": "Features" });
  private readonly description = element("p", { class: "hint" });

  constructor(private readonly root: HTMLElement, private readonly selection: Selection) {
    selection.onChange(() => this.keepInStep());
  }

  /** Shows the features; the part that each plays stays as it is. */
  setFeatures(features: FeatureInformation[]): void {
    if (JSON.stringify(features.map((feature) => [feature.name, feature.faces])) === JSON.stringify(this.features.map((feature) => [feature.name, feature.faces]))) return;
    this.features = features;
    this.table.replaceChildren(
      element("div", { class: "row head", "aria-hidden": "true" }, element("span", {}, "Feature"), element("span", {}, "Handle"), element("span", {}, "Fixed")),
      ...features.map((feature) => this.featureRow(feature)),
    );
    if (features.length === 0) this.table.replaceChildren(element("p", { class: "hint" }, "This mesh has no features."));
    this.keepInStep();
  }

  private featureRow(feature: FeatureInformation): HTMLElement {
    const box = (part: Part): HTMLInputElement => element("input", {
      type: "checkbox", "data-part": part, "aria-label": `${feature.name}: ${part}`, class: part,
      onchange: (event) => this.selection.set(feature.name, (event.target as HTMLInputElement).checked ? part : null),
    });
    const low = feature.bounds?.[0];
    const high = feature.bounds?.[1];
    const size = low && high ? `, extent ${[0, 1, 2].map((k) => digits(high[k]! - low[k]!, 3)).join(" × ")}` : "";
    return element("div", {
      class: "row", "data-feature": feature.name, title: `${feature.faces} faces${size}`,
      onmouseenter: () => { this.selection.hovered = feature.name; },
      onmouseleave: () => { this.selection.hovered = null; },
      onfocusin: () => { this.selection.hovered = feature.name; },
      onfocusout: () => { this.selection.hovered = null; },
    }, element("span", { class: "name" }, feature.name), box("handle"), box("fixed"));
  }

  private keepInStep(): void {
    for (const row of this.table.querySelectorAll<HTMLElement>("[data-feature]")) {
      const name = row.dataset.feature ?? "";
      const part = this.selection.get(name);
      row.classList.toggle("hover", this.selection.hovered === name);
      for (const box of row.querySelectorAll<HTMLInputElement>("input")) box.checked = box.dataset.part === part;
    }
  }

  /** Builds the form anew when the schema changed; what stands in it is kept otherwise. */
  setSchema(schema: Json | undefined, defaults: { schedule?: Json; deform?: Json; guard?: Json }): void {
    const source = JSON.stringify([schema, defaults]);
    if (source === this.source) return;
    this.source = source;
    this.form = orderForm(schema);
    if (!this.form) {
      this.root.replaceChildren(element("p", { class: "hint" }, "The simulation does not say which edits it can make."));
      return;
    }
    const special: Special = (property) => (PARTS[property.name] && property.field.kind === "names" ? this.featureControl(PARTS[property.name]!)
      : property.name === FILE ? { root: element("span", { hidden: true }), read: () => undefined, write: () => undefined } : null);
    this.edits = this.form.edits.map((edit) => makeControl(edit.field, words(edit.key), special));
    this.action = element("select", { id: "action", onchange: () => this.showAction() }, ...this.form.edits.map((edit, i) => element("option", { value: i }, words(edit.key))));
    const preferred = this.form.edits.findIndex((edit) => edit.key === "scale_direction");
    if (preferred >= 0) this.action.value = String(preferred);
    this.root.replaceChildren(
      element("div", { class: "field" }, element("label", { for: "action" }, "action"), this.action), this.description,
      this.table, ...this.edits.map((control) => control.root), this.settingsPart(this.form, defaults),
    );
    this.showAction();
    this.keepInStep();
  }

  /** A property that the table of features stands for: it has nothing of its own to show. */
  private featureControl(part: Part): Control {
    const root = element("span", { hidden: true });
    return {
      root,
      read: () => {
        const chosen = this.selection.chosen(part, this.features.map((feature) => feature.name));
        return chosen.length > 0 || part === "fixed" ? chosen : undefined;
      },
      write: () => undefined,
    };
  }

  /** The schedule stands open; what else an order can set is folded away, and sent only where it is set. */
  private settingsPart(form: OrderForm, defaults: { [key: string]: Json | undefined }): HTMLElement {
    const unwrap = form.settings.map((property) =>
      property.name === "schedule" && property.field.kind === "optional" ? { ...property, field: property.field.field } : property);
    const open = unwrap.filter((property) => property.name === "schedule");
    const folded = unwrap.filter((property) => property.name !== "schedule").map((property) =>
      property.field.kind === "optional" ? property : { ...property, field: { kind: "optional" as const, field: property.field } });
    const schedule = objectControl(open.map((property) => ({ ...property, initial: undefined })));
    const others = objectControl(folded.map((property) => ({ ...property, initial: undefined })));
    if (defaults.schedule) schedule.write({ schedule: defaults.schedule });
    // The values of the server stand ready in the folded part, unticked.
    for (const property of folded) {
      const value = defaults[property.name];
      if (value !== undefined && value !== null) {
        others.write({ [property.name]: value });
        others.write({ [property.name]: null });
      }
    }
    this.settings = {
      root: element("div"),
      read: () => ({ ...(schedule.read() as JsonObject), ...(others.read() as JsonObject) }),
      write: () => undefined,
    };
    return element("div", {}, open.length > 0 ? element("h3", {}, "Schedule") : null, schedule.root,
      folded.length > 0 ? element("details", {}, element("summary", {}, `More: ${folded.map((property) => words(property.name)).join(", ")}`), others.root) : null);
  }

  private showAction(): void {
    const index = Number(this.action?.value ?? 0);
    this.edits.forEach((control, i) => { control.root.hidden = i !== index; });
    const text = this.form?.edits[index]?.description ?? "";
    write(this.description, text);
    this.description.hidden = text === "";
    this.table.hidden = this.form?.edits[index]?.field.kind !== "object";
  }

  /** Chooses an action and fills in some of its fields; false where there is no such action. */
  compose(key: string, values: JsonObject): boolean {
    const index = this.form?.edits.findIndex((edit) => edit.key === key) ?? -1;
    if (index < 0 || !this.action) return false;
    this.action.value = String(index);
    this.edits[index]!.write(values);
    this.showAction();
    return true;
  }

  /** The order that the form describes. Throws `InputError` when something is missing or wrong. */
  read(): JsonObject {
    if (!this.form || !this.action) throw new InputError("There is no edit to make yet.", null);
    const index = Number(this.action.value);
    const edit = this.form.edits[index]!;
    const body = (this.edits[index]!.read() ?? {}) as JsonObject;
    const needed = edit.field.kind === "object" ? edit.field.oneOf ?? [] : [];
    if (needed.length > 0 && needed.every((name) => body[name] === undefined)) {
      throw new InputError("Choose at least one feature as the handle (click it in the picture, or tick it in the list), or set a region.", this.table.querySelector("input"));
    }
    return { edits: [{ [edit.key]: body }], ...((this.settings?.read() ?? {}) as JsonObject) };
  }
}

/** An order in words, for the list of orders. */
export function describeOrder(order: Json): string {
  if (typeof order !== "object" || order === null || Array.isArray(order)) return "order";
  if (order.undo !== undefined) return order.undo === 1 || order.undo === null ? "undo" : `undo ${JSON.stringify(order.undo)} orders`;
  const edits = Array.isArray(order.edits) ? order.edits : Array.isArray(order.stack) ? order.stack : [];
  const parts = edits.map(describeEdit);
  return parts.length > 0 ? parts.join("; ") : Array.isArray(order.stack) ? "back to the reference shape" : "order";
}

export function describeEdit(edit: Json): string {
  if (typeof edit !== "object" || edit === null || Array.isArray(edit)) return "edit";
  const [key, body] = Object.entries(edit)[0] ?? ["edit", null];
  if (typeof body !== "object" || body === null || Array.isArray(body)) return words(key);
  const features = Array.isArray(body.features) ? ` ${body.features.join(", ")}` : "";
  const region = typeof body.region === "object" && body.region !== null ? ` in a ${words(Object.keys(body.region)[0] ?? "region")}` : "";
  const amount = [body.by, body.factors, body.distance].find((value) => value !== undefined);
  const numbers = Array.isArray(amount) ? amount : amount === undefined ? [] : [amount];
  const shown = numbers.map((value) => (typeof value === "number" ? digits(value, 3) : String(value)));
  const turn = typeof body.degrees === "number" ? ` by ${digits(body.degrees, 3)}°` : "";
  const joined = body.factors !== undefined ? ` × (${shown.join(", ")})` : body.by !== undefined ? ` by (${shown.join(", ")})` : shown.length ? ` by ${shown[0]}` : turn;
  const name = typeof body.name === "string" ? `${body.name}: ` : "";
  return `${name}${words(key)}${features}${region}${joined}${body.muted === true ? " (muted)" : ""}`;
}
