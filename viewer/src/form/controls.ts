/** One control for each kind of field: it shows a value, reads it back, and says beside it what is wrong. */
import type { Json } from "../connection/protocol";
import { element, identifier, write as writeText } from "../dom";
import { exactCell } from "../exact";
import { fitting, readNumber, whyNoNumber, words } from "../number";
import type { Problem } from "../store/state";
import { startOf, startOfObject } from "./schema";
import type { Field, Property } from "./schema";

export interface Control {
  root: HTMLElement;
  /** The value to send; undefined where nothing is to be sent, or where something is wrong, which then is one of `problems`. */
  read(problems: Problem[]): Json | undefined;
  /** Shows a value; undefined for that with which the field begins. */
  write(value: Json | undefined): void;
}

/** How a control is named: `path` tells it from others of its form, and a unit stands behind the number. */
interface Naming { label: string; path: string; unit: string; hint: string }

/** Makes a control of the caller's own for a property; null leaves it to the schema. */
export type Special = (property: Property) => Control | null;

const AXES = ["x", "y", "z"];
/** The most characters that are seen in an input: of a text, of a number, and of one of three that stand beside one another. */
const SEEN = 20, ROOM = 12, NARROW_ROOM = 7;

export function makeControl(field: Field, label: string, special: Special = () => null, naming: Partial<Naming> = {}): Control {
  return make(field, { label, path: label, unit: "", hint: "", ...naming }, special);
}

function make(field: Field, naming: Naming, special: Special): Control {
  switch (field.kind) {
    case "number": return numberControl(field, naming);
    case "vector": return vectorControl(field, naming);
    case "choice": return choiceControl(field, naming);
    case "boolean": return booleanControl(naming);
    case "text": return textControl(naming, (text) => text, String, "");
    case "matrix": return matrixControl(field, naming);
    case "numbers": return textControl(naming, parseNumbers, (value) => (Array.isArray(value) ? value.join(", ") : ""), undefined);
    case "names": return textControl(naming, (text) => text.split(",").map((name) => name.trim()).filter(Boolean), (value) => (Array.isArray(value) ? value.join(", ") : ""), []);
    case "list": return listControl(field, naming, special);
    case "optional": return optionalControl(field, naming, special);
    case "object": return objectControl(field.properties, special, naming.path);
    case "variants": return variantsControl(field, naming, special);
    case "json": return textControl(naming, parseJson, (value) => JSON.stringify(value), undefined);
  }
}

function parseJson(text: string): Json | undefined {
  if (text.trim() === "") return undefined;
  try {
    return JSON.parse(text) as Json;
  } catch {
    throw new Error("is not JSON");
  }
}

function parseNumbers(text: string): Json | undefined {
  const parts = text.split(/[\s,]+/).filter(Boolean);
  if (parts.some((word) => !/^\d+$/.test(word))) throw new Error("must be whole numbers, parted by commas");
  return parts.length > 0 ? parts.map(Number) : undefined;
}

/** An input with its label, and room for what is wrong with it. */
function row({ label, hint, unit }: Naming, input: HTMLElement, wrong: HTMLElement): HTMLElement {
  const id = identifier("field");
  input.id = id;
  const shown = unit === "" ? input : element("span", { class: "with-unit" }, input, element("span", { class: "unit" }, unit));
  return element("div", { class: "field" }, element("label", { for: id, title: hint || undefined }, label), shown, wrong);
}

const wrongText = (): HTMLElement => element("small", { class: "wrong", hidden: true, id: identifier("wrong") });

/** Shows what is wrong with an input beside it; empty for nothing. */
export function mark(input: HTMLElement, wrong: HTMLElement, text: string): void {
  wrong.hidden = text === "";
  writeText(wrong, text);
  if (text === "") {
    input.removeAttribute("aria-invalid");
    input.removeAttribute("aria-describedby");
  } else {
    input.setAttribute("aria-invalid", "true");
    input.setAttribute("aria-describedby", wrong.id);
  }
}

function numberInput(label: string): HTMLInputElement {
  return element("input", { type: "text", inputmode: "decimal", autocomplete: "off", spellcheck: "false", "aria-label": label });
}

/** The number that a text is, within the bounds of its field; or what is wrong with it. */
export function numberFrom(text: string, field: Field & { kind: "number" }): number | string {
  const value = readNumber(text);
  if (value === null) return whyNoNumber(text);
  if (field.integer && !Number.isInteger(value)) return "must be a whole number";
  if (value < field.minimum || (field.exclusiveMinimum && value === field.minimum)) return `must be ${field.exclusiveMinimum ? "more than" : "at least"} ${field.minimum}`;
  if (value > field.maximum || (field.exclusiveMaximum && value === field.maximum)) return `must be ${field.exclusiveMaximum ? "less than" : "at most"} ${field.maximum}`;
  return value;
}

/** How a number is written into an input; nothing for what is none. */
export const numberText = (value: Json | undefined): string => (typeof value === "number" ? fitting(value, ROOM) : "");

/** An input for a number. A value that was written into it and not touched since is read as it was, to the last bit. */
function numberCell(field: Field & { kind: "number" }, label: string, wrong: HTMLElement, room = ROOM): { input: HTMLInputElement; read(problems: Problem[]): number | undefined; write(value: Json | undefined): void } {
  const input = numberInput(label);
  const cell = exactCell(input);
  return {
    input,
    read: (problems) => {
      const value = cell.untouched() ?? numberFrom(input.value, field);
      input.title = cell.whole();
      if (typeof value === "number") {
        mark(input, wrong, "");
        return value;
      }
      mark(input, wrong, `${label} ${value}`);
      problems.push({ field: label, text: `${label} ${value}` });
      return undefined;
    },
    write: (value) => {
      cell.write(typeof value === "number" ? value : null, room);
      mark(input, wrong, "");
    },
  };
}

function numberControl(field: Field & { kind: "number" }, naming: Naming): Control {
  const wrong = wrongText();
  const cell = numberCell(field, naming.path, wrong);
  cell.write(startOf(field));
  return { root: row(naming, cell.input, wrong), read: cell.read, write: (value) => cell.write(value ?? startOf(field)) };
}

function vectorControl(field: Field & { kind: "vector" }, { label, path, unit, hint }: Naming): Control {
  const names = field.length <= 3 ? AXES : Array.from({ length: field.length }, (_, i) => String(i + 1));
  const wrongs = Array.from({ length: field.length }, wrongText);
  const cells = wrongs.map((wrong, i) => numberCell(field.item, `${path} ${names[i]}`, wrong, NARROW_ROOM));
  const shown = cells.map((cell, i) => element("span", { class: "component" }, element("span", { "aria-hidden": "true" }, names[i]!), cell.input));
  const start = startOf(field);
  const write = (value: Json | undefined): void => cells.forEach((cell, i) => cell.write(Array.isArray(value) ? value[i] : Array.isArray(start) ? start[i] : 0));
  write(undefined);
  return {
    root: element("div", { class: "field vector-field", role: "group", "aria-label": path },
      element("span", { class: "label", title: hint || undefined }, label, unit === "" ? null : element("small", {}, unit)),
      element("div", { class: "vector" }, ...shown), ...wrongs),
    read: (problems) => {
      const values = cells.map((cell) => cell.read(problems));
      return values.every((value) => value !== undefined) ? values : undefined;
    },
    write,
  };
}

/** Rows of numbers; they begin as the identity. */
function matrixControl(field: Field & { kind: "matrix" }, naming: Naming): Control {
  const rows = Array.from({ length: field.rows }, (_, i) =>
    vectorControl(field.row, { ...naming, unit: "", label: `${naming.label} row ${i + 1}`, path: `${naming.path} row ${i + 1}` }));
  const start = startOf(field) as Json[];
  const write = (value: Json | undefined): void => rows.forEach((control, i) => control.write(Array.isArray(value) ? value[i] : start[i]));
  write(undefined);
  return {
    root: element("div", { role: "group", "aria-label": naming.path }, ...rows.map((control) => control.root)),
    read: (problems) => {
      const values = rows.map((control) => control.read(problems));
      return values.every((value) => value !== undefined) ? values : undefined;
    },
    write,
  };
}

function choiceControl(field: Field & { kind: "choice" }, naming: Naming): Control {
  const select = element("select", {}, ...field.options.map((option, i) => element("option", { value: i }, option.title)));
  return {
    root: row(naming, select, wrongText()),
    read: () => field.options[Number(select.value)]?.value,
    write: (value) => { select.value = String(Math.max(0, field.options.findIndex((option) => option.value === value))); },
  };
}

function booleanControl(naming: Naming): Control {
  const input = element("input", { type: "checkbox" });
  return { root: row(naming, input, wrongText()), read: () => input.checked, write: (value) => { input.checked = value === true; } };
}

function textControl(naming: Naming, parse: (text: string) => Json | undefined, format: (value: Json) => string, start: Json | undefined): Control {
  const input = element("input", { type: "text", autocomplete: "off", spellcheck: "false" });
  const wrong = wrongText();
  // What is longer than the input is read whole under the pointer.
  const hint = (): void => { input.title = input.value.length > SEEN ? input.value : ""; };
  return {
    root: row(naming, input, wrong),
    read: (problems) => {
      hint();
      try {
        const value = parse(input.value);
        mark(input, wrong, "");
        return value;
      } catch (error) {
        const text = `${naming.path} ${error instanceof Error ? error.message : String(error)}`;
        mark(input, wrong, text);
        problems.push({ field: naming.path, text });
        return undefined;
      }
    },
    write: (value) => {
      const shown = value ?? start;
      input.value = shown === undefined ? "" : format(shown);
      hint();
      mark(input, wrong, "");
    },
  };
}

function optionalControl(field: Field & { kind: "optional" }, naming: Naming, special: Special): Control {
  const inner = make(field.field, naming, special);
  const input = element("input", { type: "checkbox", id: identifier("field"), onchange: () => show() });
  const body = element("div", { class: "optional" }, inner.root);
  const wrong = wrongText();
  const show = (): void => { body.hidden = !input.checked; };
  show();
  return {
    root: element("div", { class: "choice" }, element("div", { class: "field" }, element("label", { for: input.id, title: naming.hint || undefined }, naming.label), input, wrong), body),
    read: (problems) => {
      mark(input, wrong, "");
      if (!input.checked) return undefined;
      const before = problems.length;
      const value = inner.read(problems);
      // What was ticked and left empty is no wish to leave it out.
      if (value === undefined && problems.length === before) {
        const text = `${naming.path} is empty`;
        mark(input, wrong, text);
        problems.push({ field: naming.path, text });
      }
      return value;
    },
    write: (value) => {
      input.checked = value !== undefined && value !== null;
      if (input.checked) inner.write(value);
      mark(input, wrong, "");
      show();
    },
  };
}

/** Entries of one kind, one below the other, each of which can be taken out. They are added by hand in the picture. */
function listControl(field: Field & { kind: "list" }, naming: Naming, special: Special): Control {
  const root = element("div", { class: "list", role: "group", "aria-label": naming.path });
  const empty = element("p", { class: "hint" }, naming.hint || `No ${naming.label} yet.`);
  let entries: { control: Control; shown: HTMLElement }[] = [];
  const show = (): void => root.replaceChildren(...(entries.length > 0 ? entries.map((entry) => entry.shown) : [empty]));
  const entry = (value: Json, index: number): { control: Control; shown: HTMLElement } => {
    const label = `${naming.label.replace(/s$/, "")} ${index + 1}`;
    const control = objectControl(field.item.properties, special, label);
    control.write(value);
    const remove = element("button", {
      type: "button", class: "small", title: "Take it out", "aria-label": `Take out ${label}`,
      onclick: () => {
        entries = entries.filter((other) => other !== made);
        show();
        root.dispatchEvent(new Event("input", { bubbles: true }));
      },
    }, "×");
    const made = { control, shown: element("div", { class: "entry" }, element("div", { class: "line" }, element("span", { class: "label" }, label), remove), control.root) };
    return made;
  };
  show();
  return {
    root,
    read: (problems) => {
      const values = entries.map(({ control }) => control.read(problems));
      return values.every((value) => value !== undefined) ? values : undefined;
    },
    write: (value) => {
      const values = Array.isArray(value) ? value : [];
      // The inputs stay what they are while they are written into: a hand may be on one of them.
      if (values.length === entries.length) entries.forEach(({ control }, i) => control.write(values[i]));
      else {
        entries = values.map(entry);
        show();
      }
    },
  };
}

/** A value that is shown elsewhere or nowhere, and kept. */
export function keepingControl(): Control {
  let kept: Json | undefined;
  return { root: element("span", { hidden: true }), read: () => kept, write: (value) => { kept = value; } };
}

/** The controls of an object: by groups, and what is rarely needed folded away. `within` is what the names of its fields begin with. */
export function objectControl(properties: readonly Property[], special: Special = () => null, within = ""): Control {
  const start = startOfObject(properties);
  const parts = properties.map((property) => {
    const path = within === "" ? words(property.name) : `${within} ${words(property.name)}`;
    const control = special(property) ?? (property.hidden ? keepingControl()
      : make(property.field, { label: property.label, path, unit: property.unit, hint: property.hint || property.description }, special));
    control.write(start[property.name]);
    return { property, path, control };
  });
  const folded = parts.filter(({ property }) => property.advanced && !property.hidden);
  const open = parts.filter((part) => !folded.includes(part));
  const groups = [...new Set(open.map(({ property }) => property.group))];
  const root = element("div", { class: "object" },
    ...groups.flatMap((group) => {
      const roots = open.filter(({ property }) => property.group === group).map(({ control }) => control.root);
      return group === "" ? roots : [element("div", { class: "group", role: "group", "aria-label": group }, element("h4", {}, group), ...roots)];
    }),
    folded.length > 0 ? element("details", { class: "advanced" }, element("summary", {}, "Advanced"), ...folded.map(({ control }) => control.root)) : null);
  return {
    root,
    read: (problems) => {
      const value: { [key: string]: Json } = {};
      const before = problems.length;
      for (const { property, path, control } of parts) {
        const known = problems.length;
        const read = control.read(problems);
        if (read !== undefined) value[property.name] = read;
        else if (property.required && problems.length === known) problems.push({ field: path, text: `${path} is empty` });
      }
      return problems.length === before || within === "" ? value : undefined;
    },
    write: (value) => {
      const values = typeof value === "object" && value !== null && !Array.isArray(value) ? value : start;
      for (const { property, control } of parts) control.write(values[property.name] ?? undefined);
    },
  };
}

function variantsControl(field: Field & { kind: "variants" }, naming: Naming, special: Special): Control {
  // Variants that are a single number read as one line: "every [10] steps".
  const inline = field.options.every((option) => option.field.kind === "number");
  const controls = field.options.map((option) => make(option.field, inline
    ? { ...naming, unit: "" } : { label: option.label, path: `${naming.path} ${words(option.key)}`, unit: option.unit, hint: option.description }, special));
  const select = element("select", { "aria-label": `${naming.path}: kind`, onchange: () => show() }, ...field.options.map((option, i) => element("option", { value: i }, option.label)));
  const body = element("div", { class: "variant" }, ...controls.map((control) => control.root));
  const show = (): void => controls.forEach((control, i) => { control.root.hidden = String(i) !== select.value; });
  show();
  const root = inline
    ? element("div", { class: "inline" }, body, select)
    : element("div", { class: "choice" }, element("div", { class: "field" }, element("span", { class: "label", title: naming.hint || undefined }, naming.label), select), body);
  return {
    root,
    read: (problems) => {
      const index = Number(select.value);
      const value = controls[index]?.read(problems);
      return value === undefined ? undefined : { [field.options[index]!.key]: value };
    },
    write: (value) => {
      const values = typeof value === "object" && value !== null && !Array.isArray(value) ? value : {};
      const index = Math.max(0, field.options.findIndex((option) => Object.hasOwn(values, option.key)));
      select.value = String(index);
      controls.forEach((control, i) => control.write(i === index ? values[field.options[i]!.key] : undefined));
      show();
    },
  };
}
