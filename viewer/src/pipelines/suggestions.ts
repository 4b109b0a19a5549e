/** What may be written at a place of a pipeline: the keys and values of the schema, and names that the run knows. */
import type { Json } from "../connection/protocol";
import { own } from "../own";
import { written } from "./formula";
import type { Path, Place } from "./place";

export interface Suggestion {
  /** The name that is seen and typed. */
  label: string;
  /** The JSON that is put in place of the token; `#` is where the cursor is then, at its end where there is none. */
  insert: string;
  /** A word or two beside it, such as "required". */
  detail: string;
  description: string;
}

/** The names that may be written at a place. */
export interface KnownNames {
  fields: readonly { name: string; description: string }[];
  features: readonly string[];
  monitors: readonly string[];
  channels: readonly string[];
  parameters: readonly string[];
}

type Schema = { [key: string]: Json };
type NameKind = "field" | "feature" | "monitor" | "channel" | "parameter";
const isObject = (value: unknown): value is Schema => typeof value === "object" && value !== null && !Array.isArray(value);
const list = (value: Json | undefined): Json[] => (Array.isArray(value) ? value : []);
const MAXIMUM_DEPTH = 24;

/** The kinds of names that the values of keys are. */
const NAMES: Readonly<Record<string, NameKind>> = {
  field: "field", fields: "field", vector: "field", velocity: "field", pressure: "field", viscosity: "field",
  features: "feature", fixed: "feature", free: "feature", sliding: "feature",
  formula: "field", components: "field",
  of: "monitor", minus: "monitor", monitor: "monitor", monitors: "monitor", when: "monitor", condition: "monitor", message: "monitor",
  channel: "channel",
};
/** The kind of names that stands at a path; null for none. */
export function nameKind(path: Path): NameKind | null {
  const keys = path.filter((step) => typeof step === "string");
  const [above, key] = [keys.at(-2), keys.at(-1)];
  if (key === "name" && above === "set") return "parameter";
  if (key === "name" && above === "field") return "field";
  if (key === "names" && above === "features") return "feature";
  return key === undefined ? null : own(NAMES, key) ?? null;
}

/** All schemas that a value may keep to: references followed, alternatives taken apart. */
function alternatives(root: Schema, given: Json | undefined, depth = 0): Schema[] {
  if (!isObject(given) || depth > MAXIMUM_DEPTH) return [];
  if (typeof given.$ref === "string") {
    const { $ref, ...beside } = given;
    const target = $ref.split("/").slice(1).reduce<Json | undefined>((at, step) => (isObject(at) ? at[decodeURIComponent(step)] : undefined), root);
    return alternatives(root, target, depth + 1).map((schema) => ({ ...schema, ...(typeof beside.description === "string" ? { description: beside.description } : {}) }));
  }
  const several = [...list(given.oneOf), ...list(given.anyOf), ...list(given.allOf)].filter((one) => !(isObject(one) && Object.keys(one).every((key) => key === "required" || key === "not")));
  const { oneOf: _, anyOf: __, allOf: ___, ...own } = given;
  const solid = several.flatMap((one) => alternatives(root, one, depth + 1));
  return isObject(own.properties) || several.length === 0 ? [own, ...solid] : solid;
}

/** The schemas of the value at a path. */
function schemasAt(root: Schema, path: Path): Schema[] {
  let schemas = alternatives(root, root);
  for (const step of path) {
    schemas = schemas.flatMap((schema) => {
      if (typeof step === "number") return alternatives(root, list(schema.prefixItems)[step] ?? schema.items);
      const own = isObject(schema.properties) ? schema.properties[step] : undefined;
      return alternatives(root, own ?? (isObject(schema.additionalProperties) ? schema.additionalProperties : undefined));
    });
  }
  return schemas;
}

const has = (schema: Schema, type: string): boolean => schema.type === type || list(schema.type).includes(type);

/** A description in one paragraph, as people read it. */
export const plain = (text: Json | undefined): string =>
  typeof text === "string" ? text.replace(/```[\s\S]*?```/g, "").replace(/\[`([^`\]]+)`\](\([^)]*\))?/g, "$1").replaceAll("`", "").replace(/\s+/g, " ").trim() : "";

/** The value with which something begins that has just been chosen. */
function start(root: Schema, given: Json | undefined, depth = 0): string {
  const schemas = alternatives(root, given).filter((schema) => !has(schema, "null") || list(schema.type).length > 1);
  const schema = schemas[0];
  if (!schema || depth > 3) return "#";
  if (schemas.length > 1) return schemas.every((one) => has(one, "object")) ? "{#}" : schemas.every((one) => one.const !== undefined || has(one, "string")) ? '"#"' : "#";
  if (has(schema, "object") || isObject(schema.properties)) {
    const properties = isObject(schema.properties) ? schema.properties : {};
    const required = list(schema.required).filter((name): name is string => typeof name === "string" && name in properties);
    if (required.length === 0) return Object.keys(properties).length === 0 ? "{}#" : "{#}";
    let isFirst = true;
    const members = required.map((name) => {
      const value = start(root, properties[name], depth + 1);
      const shown = isFirst && value.includes("#") ? value : value.replaceAll("#", "") || "null";
      if (value.includes("#")) isFirst = false;
      return `${JSON.stringify(name)}: ${shown}`;
    });
    return `{ ${members.join(", ")} }`;
  }
  if (has(schema, "array")) {
    const count = schema.minItems === schema.maxItems && typeof schema.minItems === "number" && schema.minItems <= 4 ? schema.minItems : 0;
    const number = isObject(schema.items) && (has(schema.items, "number") || has(schema.items, "integer"));
    return count > 0 && number ? `[${Array.from({ length: count }, () => "0").join(", ")}]#` : "[#]";
  }
  if (has(schema, "boolean")) return schema.default === false ? "true#" : schema.default === true ? "false#" : "#";
  if (has(schema, "string") || typeof schema.const === "string" || list(schema.enum).every((one) => typeof one === "string") && list(schema.enum).length > 0) return '"#"';
  if (has(schema, "number") || has(schema, "integer")) return typeof schema.default === "number" ? `${schema.default}#` : typeof schema.minimum === "number" && schema.minimum > 0 ? `${schema.minimum}#` : "0#";
  return "#";
}

/** What may be written at a place, the likely first; what is there already is left out. */
export function suggestionsAt(root: Json, place: Place, names: KnownNames): Suggestion[] {
  if (!isObject(root)) return [];
  return place.part === "key" ? keysAt(root, place) : valuesAt(root, place, names);
}

function keysAt(root: Schema, { path, keys, hasColon }: Place): Suggestion[] {
  const found = new Map<string, Suggestion>();
  for (const schema of schemasAt(root, path)) {
    if (!isObject(schema.properties)) continue;
    const properties = schema.properties;
    // An alternative that does not allow what is there is none any more.
    if (schema.additionalProperties === false && keys.some((key) => !(key in properties))) continue;
    const required = list(schema.required);
    const isOnly = Object.keys(properties).length === 1 && required.length === 1;
    for (const [name, given] of Object.entries(properties)) {
      if (keys.includes(name) || found.has(name)) continue;
      const schemas = alternatives(root, given);
      const described = plain(isOnly && typeof schema.description === "string" ? schema.description : (isObject(given) ? given.description : undefined) ?? schemas[0]?.description);
      const value = start(root, given);
      const key = JSON.stringify(name);
      found.set(name, {
        label: name, insert: hasColon ? `${key}#` : `${key}: ${value}`,
        detail: !isOnly && required.includes(name) ? "required" : "", description: described,
      });
    }
  }
  return [...found.values()].sort((a, b) => Number(b.detail !== "") - Number(a.detail !== ""));
}

function valuesAt(root: Schema, { path }: Place, names: KnownNames): Suggestion[] {
  const found = new Map<string, Suggestion>();
  const add = (label: string, insert: string, detail = "", description = ""): void => {
    if (!found.has(label)) found.set(label, { label, insert, detail, description });
  };
  const schemas = schemasAt(root, path);
  const takesText = schemas.some((schema) => has(schema, "string"));
  const kind = takesText ? nameKind(path) : null;
  if (kind === "field") for (const { name, description } of names.fields) add(name, JSON.stringify(name), kind, description);
  else if (kind !== null) {
    const all = { feature: names.features, monitor: names.monitors, channel: names.channels, parameter: names.parameters }[kind];
    for (const name of all) add(name, JSON.stringify(name), kind);
  }
  for (const schema of schemas) {
    for (const value of [...(schema.const === undefined ? [] : [schema.const]), ...list(schema.enum)]) {
      if (value !== null) add(typeof value === "string" ? value : JSON.stringify(value), JSON.stringify(value), value === schema.default ? "default" : "", plain(schema.description));
    }
    if (has(schema, "boolean")) for (const value of ["true", "false"]) add(value, value, String(schema.default) === value ? "default" : "", plain(schema.description));
    if (isObject(schema.properties)) {
      const required = list(schema.required);
      const [only, ...more] = Object.keys(schema.properties);
      // An object of one key, such as a stage: by the name of that key.
      if (only !== undefined && more.length === 0 && required.length === 1) add(only, `{ ${JSON.stringify(only)}: ${start(root, schema.properties[only])} }`, "", plain(schema.description));
      else add("{ }", start(root, schema), "", plain(schema.description));
    }
  }
  return [...found.values()];
}

/** The names that a formula or a line of the log at a path may hold, as they are written there. */
export function formulaNames(path: Path, names: KnownNames): Suggestion[] {
  const suggestion = (label: string, detail: NameKind, description = ""): Suggestion =>
    ({ label, insert: written(label), detail, description });
  if (nameKind(path) === "field") return names.fields.map(({ name, description }) => suggestion(name, "field", description));
  const given = [["cycle", "The number of the step."], ["time", "The simulated time."]].map(([name, text]) => suggestion(name!, "monitor", text));
  return [...names.monitors.map((name) => suggestion(name, "monitor")), ...names.parameters.map((name) => suggestion(`parameter.${name}`, "parameter")), ...given];
}

/** What the schema says of the key or the value at a place; empty for nothing. */
export function descriptionAt(root: Json, path: Path): string {
  if (!isObject(root) || path.length === 0) return "";
  const [above, last] = [path.slice(0, -1), path.at(-1)!];
  if (typeof last === "string") {
    for (const schema of schemasAt(root, above)) {
      if (!isObject(schema.properties) || !(last in schema.properties)) continue;
      const isOnly = Object.keys(schema.properties).length === 1;
      const given = schema.properties[last];
      const own = isObject(given) ? given.description : undefined;
      return plain((isOnly ? schema.description : undefined) ?? own ?? alternatives(root, given)[0]?.description);
    }
  }
  return "";
}
