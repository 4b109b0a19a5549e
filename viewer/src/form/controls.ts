/** One control for each kind of field: it shows a value, reads it back, and says what is wrong with it. */
import { element, identifier } from "../dom";
import { readNumber, words } from "../number";
import type { Json } from "../connection/protocol";
import type { Field, Property } from "./schema";

/** Thrown by `read` when what stands in a control cannot be sent; the control is marked and `field` can take the focus. */
export class InputError extends Error {
  constructor(message: string, readonly field: HTMLElement | null) {
    super(message);
  }
}

export interface Control {
  root: HTMLElement;
  /** The value to send; undefined where nothing is to be sent. Throws `InputError`. */
  read(): Json | undefined;
  write(value: Json): void;
}

/** Makes a control of the caller's own for a property; null leaves it to the schema. */
export type Special = (property: Property) => Control | null;

const AXES = ["x", "y", "z"];
const HARMONIC = ["1 · harmonic", "2 · biharmonic", "3 · triharmonic"];

export function makeControl(field: Field, label: string, special: Special = () => null): Control {
  switch (field.kind) {
    case "number": return numberControl(field, label);
    case "vector": return vectorControl(field, label);
    case "choice": return choiceControl(field, label);
    case "boolean": return booleanControl(label);
    case "text": return textControl(label, (text) => text, String);
    case "matrix": return matrixControl(field, label);
    case "numbers": return textControl(label, parseNumbers, (value) => (Array.isArray(value) ? value.join(", ") : ""));
    case "names": return textControl(label, (text) => text.split(",").map((name) => name.trim()).filter(Boolean), (value) => (Array.isArray(value) ? value.join(", ") : ""));
    case "optional": return optionalControl(field, label, special);
    case "object": return objectControl(field.properties, special);
    case "variants": return variantsControl(field, label, special);
    case "json": return textControl(label, parseJson, (value) => JSON.stringify(value));
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
  const words = text.split(/[\s,]+/).filter(Boolean);
  if (words.some((word) => !/^\d+$/.test(word))) throw new Error("must be whole numbers, parted by commas");
  return words.length > 0 ? words.map(Number) : undefined;
}

function row(label: string, input: HTMLElement, hint = ""): HTMLElement {
  const id = identifier("field");
  input.id = id;
  return element("div", { class: "field" }, element("label", { for: id, title: hint || undefined }, label), input);
}

function numberInput(label: string): HTMLInputElement {
  return element("input", { type: "text", inputmode: "decimal", autocomplete: "off", spellcheck: "false", "aria-label": label });
}

/** Reads a number from an input within the bounds of its field, and marks the input when it cannot. */
export function readInput(input: HTMLInputElement, field: Field & { kind: "number" }, label: string): number {
  const value = readNumber(input.value);
  const fail = (message: string): never => {
    input.setAttribute("aria-invalid", "true");
    input.title = `${label} ${message}`;
    throw new InputError(`${label} ${message}`, input);
  };
  if (value === null) return fail(input.value.trim() === "" ? "is empty" : `“${input.value}” is not a number`);
  if (field.integer && !Number.isInteger(value)) return fail("must be a whole number");
  if (value < field.minimum || (field.exclusiveMinimum && value === field.minimum)) return fail(`must be ${field.exclusiveMinimum ? "more than" : "at least"} ${field.minimum}`);
  if (value > field.maximum || (field.exclusiveMaximum && value === field.maximum)) return fail(`must be ${field.exclusiveMaximum ? "less than" : "at most"} ${field.maximum}`);
  input.removeAttribute("aria-invalid");
  input.title = "";
  return value;
}

function numberControl(field: Field & { kind: "number" }, label: string): Control {
  const input = numberInput(label);
  input.value = field.minimum > 0 && Number.isFinite(field.minimum) ? String(field.minimum) : "0";
  return { root: row(label, input), read: () => readInput(input, field, label), write: (value) => { input.value = String(value); } };
}

function vectorControl(field: Field & { kind: "vector" }, label: string): Control {
  // What changes nothing, or is at least a direction.
  const start = (i: number): string => (label === "factors" || ((label === "axis" || label === "normal") && i === field.length - 1) ? "1" : "0");
  const names = field.length <= 3 ? AXES : Array.from({ length: field.length }, (_, i) => String(i + 1));
  const inputs = Array.from({ length: field.length }, (_, i) => {
    const input = numberInput(`${label} ${names[i]}`);
    input.value = start(i);
    return input;
  });
  const cells = inputs.map((input, i) => element("span", { class: "component" }, element("span", { "aria-hidden": "true" }, names[i]!), input));
  const root = element("div", { class: "field", role: "group", "aria-label": label }, element("span", { class: "label" }, label), element("div", { class: "vector" }, ...cells));
  return {
    root,
    read: () => inputs.map((input, i) => readInput(input, field.item, `${label} ${names[i]}`)),
    write: (value) => { if (Array.isArray(value)) inputs.forEach((input, i) => { input.value = String(value[i] ?? start(i)); }); },
  };
}

/** Rows of numbers; they begin as the identity. */
function matrixControl(field: Field & { kind: "matrix" }, label: string): Control {
  const rows = Array.from({ length: field.rows }, (_, i) => {
    const control = vectorControl(field.row, `${label} row ${i + 1}`);
    control.write(Array.from({ length: field.row.length }, (_, k) => (k === i ? 1 : 0)));
    return control;
  });
  return {
    root: element("div", { role: "group", "aria-label": label }, ...rows.map((control) => control.root)),
    read: () => rows.map((control) => control.read() as Json),
    write: (value) => { if (Array.isArray(value)) rows.forEach((control, i) => { if (value[i] !== undefined) control.write(value[i]!); }); },
  };
}

function choiceControl(field: Field & { kind: "choice" }, label: string): Control {
  const select = element("select", {}, ...field.options.map((option, i) => {
    const title = label === "harmonic order" && typeof option.value === "number" ? HARMONIC[option.value - 1] ?? option.title : option.title;
    return element("option", { value: i }, title);
  }));
  return {
    root: row(label, select),
    read: () => field.options[Number(select.value)]?.value,
    write: (value) => {
      const index = field.options.findIndex((option) => option.value === value);
      if (index >= 0) select.value = String(index);
    },
  };
}

function booleanControl(label: string): Control {
  const input = element("input", { type: "checkbox" });
  return { root: row(label, input), read: () => input.checked, write: (value) => { input.checked = value === true; } };
}

function textControl(label: string, parse: (text: string) => Json | undefined, format: (value: Json) => string): Control {
  const input = element("input", { type: "text", autocomplete: "off", spellcheck: "false" });
  return {
    root: row(label, input),
    read: () => {
      try {
        return parse(input.value);
      } catch (error) {
        throw new InputError(`${label} ${error instanceof Error ? error.message : String(error)}`, input);
      }
    },
    write: (value) => { input.value = format(value); },
  };
}

function optionalControl(field: Field & { kind: "optional" }, label: string, special: Special): Control {
  const inner = makeControl(field.field, label, special);
  const input = element("input", { type: "checkbox", id: identifier("field"), onchange: () => show() });
  const body = element("div", { class: "optional" }, inner.root);
  const show = (): void => { body.hidden = !input.checked; };
  show();
  return {
    root: element("div", { class: "choice" }, element("div", { class: "field" }, element("label", { for: input.id }, `set ${label}`), input), body),
    read: () => {
      const value = input.checked ? inner.read() : undefined;
      // What was ticked and left empty is no wish to leave it out.
      if (input.checked && value === undefined) throw new InputError(`${label} is empty`, inner.root.querySelector("input, select") ?? input);
      return value;
    },
    write: (value) => {
      input.checked = value !== null;
      if (value !== null) inner.write(value);
      show();
    },
  };
}

export function objectControl(properties: Property[], special: Special = () => null): Control {
  const parts = properties.map((property) => {
    const control = special(property) ?? makeControl(property.field, words(property.name), special);
    if (property.description) control.root.title = property.description;
    if (property.initial !== undefined) control.write(property.initial);
    return { property, control };
  });
  return {
    root: element("div", { class: "object" }, ...parts.map(({ control }) => control.root)),
    read: () => {
      const value: { [key: string]: Json } = {};
      for (const { property, control } of parts) {
        const read = control.read();
        if (read !== undefined) value[property.name] = read;
        else if (property.required) throw new InputError(`${words(property.name)} is empty`, control.root.querySelector("input, select"));
      }
      return value;
    },
    write: (value) => {
      if (typeof value !== "object" || value === null || Array.isArray(value)) return;
      for (const { property, control } of parts) if (value[property.name] !== undefined) control.write(value[property.name]!);
    },
  };
}

function variantsControl(field: Field & { kind: "variants" }, label: string, special: Special): Control {
  // Variants that are a single number read as one line: "every [10] steps".
  const controls = field.options.map((option) => makeControl(option.field, option.field.kind === "number" ? label : words(option.key), special));
  const inline = field.options.every((option) => option.field.kind === "number");
  const select = element("select", { "aria-label": `${label}: kind`, onchange: () => show() }, ...field.options.map((option, i) => element("option", { value: i }, words(option.key))));
  const body = element("div", { class: "variant" }, ...controls.map((control) => control.root));
  const show = (): void => controls.forEach((control, i) => { control.root.hidden = String(i) !== select.value; });
  show();
  const root = inline
    ? element("div", { class: "inline" }, body, select)
    : element("div", { class: "choice" }, element("div", { class: "field" }, element("span", { class: "label" }, label), select), body);
  return {
    root,
    read: () => {
      const index = Number(select.value);
      const value = controls[index]?.read();
      return value === undefined ? undefined : { [field.options[index]!.key]: value };
    },
    write: (value) => {
      if (typeof value !== "object" || value === null || Array.isArray(value)) return;
      const index = field.options.findIndex((option) => Object.hasOwn(value, option.key));
      if (index < 0) return;
      select.value = String(index);
      controls[index]!.write(value[field.options[index]!.key]!);
      show();
    },
  };
}
