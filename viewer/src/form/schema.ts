/**
 * Reads a JSON Schema as a form: what to ask for, with which bounds and which value to begin with.
 *
 * The schemas are those that the server's own types make (serde and schemars); whatever is not understood becomes a field
 * for JSON, so that nothing the server can do is out of reach.
 */
import type { Json } from "../connection/protocol";
import { words } from "../number";
import type { Part } from "../store/state";

export type Field =
  | { kind: "number"; integer: boolean; minimum: number; maximum: number; exclusiveMinimum: boolean; exclusiveMaximum: boolean }
  | { kind: "text" }
  | { kind: "boolean" }
  | { kind: "choice"; options: { value: Json; title: string }[] }
  | { kind: "vector"; item: Field & { kind: "number" }; length: number }
  | { kind: "matrix"; row: Field & { kind: "vector" }; rows: number }
  | { kind: "numbers" }
  | { kind: "names" }
  | { kind: "object"; properties: Property[]; oneOf?: string[] }
  | { kind: "variants"; options: Variant[] }
  | { kind: "list"; item: Field & { kind: "object" } }
  | { kind: "optional"; field: Field }
  | { kind: "json" };

export interface Variant { key: string; label: string; unit: string; field: Field; description: string }

/** The fields of an edit that the selection stands for. */
export const ROLES: Readonly<Record<string, Part>> = { features: "handle", fixed: "fixed" };

/** What the annotations of the schema say of how a property is shown. */
export interface Presentation {
  label: string;
  /** Behind the number, such as "°"; empty for none. */
  unit: string;
  /** Under which heading it stands; empty for none. */
  group: string;
  /** Rarely needed: it is folded away. */
  advanced: boolean;
  /** Shown elsewhere or nowhere; what is written into it is kept. */
  hidden: boolean;
  /** What is said in place of a list that is empty. */
  hint: string;
  /** The value with which it begins. */
  start: Json | undefined;
  /** Of an amount: its value where nothing is asked for. */
  neutral: Json | undefined;
}

export interface Property extends Presentation { name: string; required: boolean; field: Field; description: string; initial: Json | undefined }

/** An edit that there is: its name in the JSON, how it is asked for, and what stands in its form before anything is asked. */
export interface EditKind { key: string; label: string; field: Field; description: string; neutral: Values }

/** The fields of an edit, as JSON. */
export type Values = { [key: string]: Json };

type Schema = { [key: string]: Json };
const isObject = (value: unknown): value is Schema => typeof value === "object" && value !== null && !Array.isArray(value);
const list = (value: Json | undefined): Json[] => (Array.isArray(value) ? value : []);
const MAXIMUM_DEPTH = 24;

/** The schema that a `$ref` of the same document points at, with what stands beside it. */
function resolve(root: Schema, schema: Json | undefined, depth = 0): Schema {
  if (!isObject(schema) || depth > MAXIMUM_DEPTH) return {};
  if (typeof schema.$ref === "string" && schema.$ref.startsWith("#/")) {
    let target: Json | undefined = root;
    for (const step of schema.$ref.slice(2).split("/")) {
      target = isObject(target) ? target[decodeURIComponent(step).replaceAll("~1", "/").replaceAll("~0", "~")] : undefined;
    }
    const { $ref: _, ...beside } = schema;
    return { ...resolve(root, target, depth + 1), ...beside };
  }
  const [only, ...more] = list(schema.allOf);
  if (only !== undefined && more.length === 0) return { ...resolve(root, only, depth + 1), ...schema };
  return schema;
}

const hasType = (schema: Schema, type: string): boolean =>
  schema.type === type || (Array.isArray(schema.type) && schema.type.includes(type));

/** How a schema is asked for. */
export function fieldOf(root: Schema, unresolved: Json | undefined, depth = 0): Field {
  const schema = resolve(root, unresolved);
  if (depth > MAXIMUM_DEPTH) return { kind: "json" };
  if (Array.isArray(schema.type) && schema.type.includes("null")) {
    const rest = schema.type.filter((type) => type !== "null");
    return { kind: "optional", field: fieldOf(root, { ...schema, type: rest.length === 1 ? rest[0]! : rest }, depth + 1) };
  }
  const alternatives = [...list(schema.anyOf), ...list(schema.oneOf)].filter((entry) => requiredAlone(entry) === null);
  const solid = alternatives.filter((entry) => resolve(root, entry).type !== "null");
  if (alternatives.length > solid.length && solid.length === 1) {
    return { kind: "optional", field: fieldOf(root, solid[0], depth + 1) };
  }
  if (Array.isArray(schema.enum)) return { kind: "choice", options: schema.enum.map((value) => ({ value, title: title(value) })) };
  if (solid.length > 0) return alternativesOf(root, solid, depth);
  if (hasType(schema, "number") || hasType(schema, "integer")) return numberOf(schema);
  if (hasType(schema, "boolean")) return { kind: "boolean" };
  if (hasType(schema, "string")) return { kind: "text" };
  if (hasType(schema, "array")) return arrayOf(root, schema, depth);
  if (isObject(schema.properties) || hasType(schema, "object")) return objectOf(root, schema, depth);
  return { kind: "json" };
}

/** The keys that an alternative asks for where it says nothing else: "at least one of these must be there". */
function requiredAlone(entry: Json): string[] | null {
  if (!isObject(entry) || Object.keys(entry).length !== 1 || !Array.isArray(entry.required)) return null;
  return entry.required.filter((name): name is string => typeof name === "string");
}

function objectOf(root: Schema, schema: Schema, depth: number): Field {
  const oneOf = list(schema.anyOf).flatMap((entry) => requiredAlone(entry) ?? []);
  const properties = propertiesOf(root, schema, depth);
  return oneOf.length > 0 ? { kind: "object", properties, oneOf } : { kind: "object", properties };
}

function alternativesOf(root: Schema, entries: Json[], depth: number): Field {
  const options: Variant[] = [];
  const values: { value: Json; title: string }[] = [];
  for (const entry of entries) {
    const schema = resolve(root, entry);
    const described = plain(schema.description);
    const constants = schema.const !== undefined ? [schema.const] : list(schema.enum);
    if (constants.length > 0) {
      for (const value of constants) values.push({ value, title: title(value) });
      continue;
    }
    const keys = isObject(schema.properties) ? Object.keys(schema.properties) : [];
    if (keys.length !== 1) return { kind: "json" };
    const inner = (schema.properties as Schema)[keys[0]!];
    const { label, unit } = presentation(keys[0]!, resolve(root, inner));
    options.push({ key: keys[0]!, label, unit, field: fieldOf(root, inner, depth + 1), description: described });
  }
  if (options.length === 0) return { kind: "choice", options: values };
  return values.length === 0 ? { kind: "variants", options } : { kind: "json" };
}

function numberOf(schema: Schema): Field {
  const bound = (key: string, otherwise: number): number => (typeof schema[key] === "number" ? schema[key] : otherwise);
  const integer = hasType(schema, "integer");
  const low = bound("minimum", -Infinity);
  const high = bound("maximum", Infinity);
  if (integer && high - low >= 0 && high - low < 6) {
    const titles = list(schema["x-titles"]);
    return { kind: "choice", options: Array.from({ length: high - low + 1 }, (_, i) => ({ value: low + i, title: typeof titles[i] === "string" ? titles[i] : String(low + i) })) };
  }
  const above = bound("exclusiveMinimum", -Infinity);
  const below = bound("exclusiveMaximum", Infinity);
  return {
    kind: "number", integer, minimum: Math.max(low, above), maximum: Math.min(high, below),
    exclusiveMinimum: above > -Infinity && above >= low, exclusiveMaximum: below < Infinity && below <= high,
  };
}

function arrayOf(root: Schema, schema: Schema, depth: number): Field {
  const prefix = list(schema.prefixItems);
  const item = fieldOf(root, prefix[0] ?? schema.items, depth + 1);
  const length = prefix.length || (typeof schema.minItems === "number" && schema.minItems === schema.maxItems ? schema.minItems : 0);
  if (item.kind === "number" && length > 0 && length <= 9) return { kind: "vector", item, length };
  if (item.kind === "vector" && length > 0 && length <= 4) return { kind: "matrix", row: item, rows: length };
  if (item.kind === "number" && item.integer && length === 0) return { kind: "numbers" };
  if (item.kind === "object" && length === 0) return { kind: "list", item };
  return item.kind === "text" ? { kind: "names" } : { kind: "json" };
}

function propertiesOf(root: Schema, schema: Schema, depth: number): Property[] {
  const required = list(schema.required);
  const properties = Object.entries(isObject(schema.properties) ? schema.properties : {}).map(([name, entry]): Property => {
    const resolved = resolve(root, entry);
    return {
      name, required: required.includes(name), field: fieldOf(root, entry, depth + 1),
      description: plain(resolved.description), initial: resolved.default, ...presentation(name, resolved),
    };
  });
  // JSON does not keep an order: what must be given comes first, what is rarely given last.
  const rank = ({ required, field }: Property): number =>
    required ? 0 : ["optional", "json"].includes(field.kind) ? 3 : ["object", "variants"].includes(field.kind) ? 2 : 1;
  return properties.sort((a, b) => rank(a) - rank(b));
}

/** The annotations that the library's types carry for a form. */
function presentation(name: string, schema: Schema): Presentation {
  const text = (key: string, otherwise: string): string => (typeof schema[key] === "string" ? schema[key] : otherwise);
  return {
    label: text("x-label", words(name)), unit: text("x-unit", ""), group: text("x-group", ""),
    advanced: schema["x-advanced"] === true, hidden: schema["x-hidden"] === true, hint: text("x-hint", ""), start: schema["x-start"], neutral: schema["x-neutral"],
  };
}

/** The first paragraph of a description, without the marks of rustdoc. */
const plain = (description: Json | undefined): string =>
  typeof description !== "string" ? "" : (description.split(/\n\s*\n/)[0] ?? "").replaceAll("\n", " ").replace(/\[?`([^`]*)`\]?/g, "$1");

const title = (value: Json): string => (typeof value === "string" ? value.replaceAll("_", " ") : JSON.stringify(value));

/** The value with which a field begins: what the schema says, or what asks for nothing. Undefined where there is none to send. */
export function startOf(field: Field, property?: Pick<Property, "initial" | "start" | "neutral">): Json | undefined {
  if (property?.start !== undefined) return property.start;
  if (property?.initial !== undefined && property.initial !== null) return property.initial;
  if (property?.neutral !== undefined) return property.neutral;
  switch (field.kind) {
    case "number": return Number.isFinite(field.minimum) && field.minimum > 0 ? field.minimum : 0;
    case "vector": return Array.from({ length: field.length }, () => 0);
    case "matrix": return Array.from({ length: field.rows }, (_, i) => Array.from({ length: field.row.length }, (_, k) => (k === i ? 1 : 0)));
    case "choice": return field.options[0]?.value;
    case "boolean": return false;
    case "text": return "";
    case "names": case "list": return [];
    case "object": return startOfObject(field.properties);
    case "variants": {
      const first = field.options[0];
      const value = first && startOf(first.field);
      return value === undefined ? undefined : { [first!.key]: value };
    }
    case "optional": case "numbers": case "json": return undefined;
  }
}

export function startOfObject(properties: readonly Property[]): Values {
  return Object.fromEntries(properties.flatMap((property) => {
    const value = startOf(property.field, property);
    return value === undefined ? [] : [[property.name, value]];
  }));
}

/** What an order can hold beside its edits, and the edits that there are. */
export interface OrderForm { edits: EditKind[]; settings: Property[] }

/** Finds the edits and the settings in the schema of an order, however its variants are laid out. */
export function orderForm(schema: Json | undefined): OrderForm | null {
  if (!isObject(schema)) return null;
  let edits: EditKind[] | null = null;
  const settings = new Map<string, Property>();
  const visit = (entry: Json, depth: number): void => {
    const resolved = resolve(schema, entry);
    if (depth > 6) return;
    if (isObject(resolved.properties)) {
      const items = resolve(schema, resolved.properties.edits);
      if (edits === null && items.items !== undefined) {
        const field = fieldOf(schema, items.items);
        if (field.kind === "variants") {
          edits = field.options.map((option) => ({
            ...option, neutral: option.field.kind === "object" ? startOfObject(option.field.properties.filter(({ name }) => !ROLES[name])) : {},
          }));
        }
      }
      for (const property of propertiesOf(schema, resolved, 0)) {
        // Changes of the shape, and the order whose turn this one takes: neither says how it is carried out.
        if (["edits", "stack", "undo", "replaces", "deadline"].includes(property.name)) continue;
        if (!settings.has(property.name)) settings.set(property.name, property);
      }
    }
    for (const key of ["oneOf", "anyOf", "allOf"]) for (const part of list(resolved[key])) visit(part, depth + 1);
  };
  visit(schema, 0);
  return edits ? { edits, settings: [...settings.values()] } : null;
}
