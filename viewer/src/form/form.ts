/** The form for an order: made from the schema that the simulation sends, never from knowledge of its own. */
import type { FeatureInformation, Json } from "../connection/protocol";
import { element } from "../dom";
import { digits } from "../number";
import type { Action } from "../store/actions";
import { bodyOf, isObject } from "../store/draft";
import type { Part, Problem, State } from "../store/state";
import { sameJson } from "../store/store";
import type { Store } from "../store/store";
import { keepingControl, objectControl } from "./controls";
import type { Control, Special } from "./controls";
import { ScheduleSummary } from "./schedule";
import { ROLES } from "./schema";
import type { OrderForm, Property, Values } from "./schema";

/** Files lie with the solver: no order over the network may name one. */
const FILE = "file";

export class EditForm {
  private form: OrderForm | null = null;
  private action: HTMLSelectElement | null = null;
  private edits: Control[] = [];
  private settings: Control = keepingControl();
  private readonly table = element("div", { class: "features", role: "group", "aria-label": "Features" });
  /** What the controls show, as they were last read or written; null for settings that cannot be sent. */
  private shown: { key: string | null; body: Values; settings: Values | null } = { key: null, body: {}, settings: {} };

  constructor(private readonly root: HTMLElement, private readonly store: Store<State, Action>) {
    store.watch((state) => state.form, (form) => this.build(form));
    store.watch((state) => state.hello?.features ?? [], (features) => this.showFeatures(features), sameJson);
    store.watch((state) => state.selection, () => this.showParts());
    store.watch((state) => state.draft, () => this.showDraft());
    for (const event of ["input", "change"]) root.addEventListener(event, (input) => this.changed(input.target as HTMLElement));
  }

  /** The input that has something wrong in it, if there is one. */
  focusProblem(): void {
    const [wrong] = this.root.querySelectorAll<HTMLElement>('[aria-invalid="true"]');
    (wrong ?? this.table.querySelector("input"))?.focus();
  }

  private showFeatures(features: readonly FeatureInformation[]): void {
    this.table.replaceChildren(
      element("div", { class: "row head", "aria-hidden": "true" }, element("span", {}, "Feature"), element("span", {}, "Handle"), element("span", {}, "Fixed")),
      ...features.map((feature) => this.featureRow(feature)),
    );
    if (features.length === 0) this.table.replaceChildren(element("p", { class: "hint" }, "This mesh has no features."));
    this.showParts();
  }

  private featureRow({ name, faces, bounds, condition }: FeatureInformation): HTMLElement {
    const box = (part: Part): HTMLElement => element("label", { class: "box" }, element("input", {
      type: "checkbox", "data-part": part, "aria-label": `${name}: ${part}`, class: part,
      onchange: (event) => this.store.dispatch({ type: "part", feature: name, part: (event.target as HTMLInputElement).checked ? part : null }),
    }));
    const hover = (feature: string | null) => () => this.store.dispatch({ type: "hover", feature });
    const size = bounds ? `, extent ${[0, 1, 2].map((k) => digits(bounds[1][k]! - bounds[0][k]!, 3)).join(" × ")}` : "";
    return element("div", {
      class: "row", "data-feature": name, title: `${faces} faces${size}`,
      onmouseenter: hover(name), onmouseleave: hover(null), onfocusin: hover(name), onfocusout: hover(null),
    }, element("span", { class: "name" }, name, condition ? element("small", { class: "condition", "data-condition": condition }, condition) : null), box("handle"), box("fixed"));
  }

  private showParts(): void {
    const { parts, hovered } = this.store.state.selection;
    for (const row of this.table.querySelectorAll<HTMLElement>("[data-feature]")) {
      const name = row.dataset.feature ?? "";
      row.classList.toggle("hover", hovered === name);
      for (const box of row.querySelectorAll<HTMLInputElement>("input")) box.checked = box.dataset.part === parts[name];
    }
  }

  private build(form: OrderForm | null): void {
    this.form = form;
    this.edits = [];
    this.action = null;
    if (!form) {
      this.root.replaceChildren(element("p", { class: "hint" }, "The form appears once the simulation has said which edits it can make."));
      return;
    }
    const special: Special = (property) => (ROLES[property.name] ? keepingControl() : property.name === FILE ? keepingControl() : null);
    this.edits = form.edits.map((edit) => objectControl(edit.field.kind === "object" ? edit.field.properties : [], special));
    this.action = element("select", { id: "action" }, ...form.edits.map((edit) => element("option", { value: edit.key }, edit.label)));
    this.root.replaceChildren(
      element("div", { class: "field" }, element("label", { for: "action" }, "action"), this.action),
      this.table, ...this.edits.map((control) => control.root), this.settingsPart(form),
    );
    this.shown = { key: null, body: {}, settings: {} };
    this.showDraft();
  }

  /** The schedule as one sentence and a curve, which unfolds; what else an order can set is sent only where it is set. */
  private settingsPart(form: OrderForm): HTMLElement {
    const isSchedule = (property: Property): boolean => property.name === "schedule";
    const unwrapped = form.settings.map((property) => ({
      ...property, initial: undefined, advanced: false,
      field: isSchedule(property) === (property.field.kind === "optional")
        ? (property.field.kind === "optional" ? property.field.field : { kind: "optional" as const, field: property.field }) : property.field,
    }));
    const schedule = objectControl(unwrapped.filter(isSchedule));
    const others = unwrapped.filter((property) => !isSchedule(property));
    const rest = objectControl(others);
    // The values of the simulation stand ready behind the boxes that are not ticked.
    rest.write({ ...this.store.state.hello?.defaults });
    rest.write({});
    const summary = new ScheduleSummary();
    this.settings = {
      root: element("div"),
      read: (problems) => {
        const values: Values = { ...(schedule.read(problems) as Values), ...(rest.read(problems) as Values) };
        summary.show(values.schedule);
        return values;
      },
      write: (value) => {
        schedule.write(value);
        rest.write(value);
        summary.show(isObject(value) ? value.schedule : undefined);
      },
    };
    return element("div", { class: "settings" },
      form.settings.some(isSchedule) ? element("details", { class: "schedule" }, summary.root, schedule.root) : null,
      others.length > 0 ? element("details", {}, element("summary", {}, `More: ${others.map((property) => property.label).join(", ")}`), rest.root) : null);
  }

  /** Brings the controls in line with what is composed; those that show it already are left as they are. */
  private showDraft(): void {
    const { form, action } = this;
    if (!form || !action) return;
    const { draft } = this.store.state;
    const index = Math.max(0, form.edits.findIndex((edit) => edit.key === draft.key));
    const edit = form.edits[index];
    action.value = edit?.key ?? "";
    action.disabled = draft.updating !== null;
    this.edits.forEach((control, i) => { control.root.hidden = i !== index; });
    action.title = edit?.description ?? "";
    this.table.hidden = edit?.field.kind !== "object";
    const next = { key: draft.key, body: bodyOf(draft), settings: draft.settings };
    // Where something is wrong, what stands in the input is not in the body: it is not for this to wipe it out.
    if (draft.problems.length > 0 && draft.key === this.shown.key) return;
    if (next.key !== this.shown.key || !sameJson(next.body, this.shown.body)) this.edits[index]?.write(next.body);
    if (!sameJson(next.settings, this.shown.settings)) this.settings.write(next.settings);
    this.shown = next;
  }

  private changed(target: HTMLElement): void {
    const { form, action } = this;
    if (!form || !action || this.table.contains(target)) return;
    const index = form.edits.findIndex(({ key }) => key === action.value);
    const edit = form.edits[index];
    if (!edit) return;
    if (target === action) {
      this.store.dispatch({ type: "action chosen", key: edit.key });
      return;
    }
    const problems: Problem[] = [];
    const body = (this.edits[index]!.read(problems) ?? {}) as Values;
    const wrong: Problem[] = [];
    const read = (this.settings.read(wrong) ?? {}) as Values;
    // A setting that cannot be sent stays what it was: an edit that is then made in the picture goes with it, and it is shown again.
    const settings = wrong.length > 0 ? { ...this.store.state.draft.settings, ...read } : read;
    this.shown = { key: edit.key, body, settings: wrong.length > 0 ? null : settings };
    problems.push(...wrong);
    this.store.dispatch({ type: "form read", key: edit.key, body, settings, problems, step: `input ${target.id || target.getAttribute("aria-label")}` });
  }
}

/** The settings that an order begins with: of the server's own only the schedule is always sent. */
export function initialSettings(defaults: { schedule?: Json }): Values {
  return defaults.schedule === undefined || defaults.schedule === null ? {} : { schedule: defaults.schedule };
}
