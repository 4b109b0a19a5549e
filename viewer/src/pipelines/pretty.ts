/** JSON as a person would lay it out: what is short stays on its line. */
import type { Json } from "../connection/protocol";

/** The most characters of an object or a list that is not broken up. */
const SHORT = 44;

/** The keys of a pipeline in the order in which people read them. */
const READ = ["name", "description", "channel", "every", "at", "on", "budget", "stages", "when", "for", "again_after", "then"];

/** The text of a pipeline. */
export function textOf(pipeline: { [key: string]: Json }): string {
  const rank = (key: string): number => (READ.includes(key) ? READ.indexOf(key) : READ.length);
  return pretty(Object.fromEntries(Object.entries(pipeline).sort(([a], [b]) => rank(a) - rank(b))));
}

export function pretty(value: Json, indent = ""): string {
  const flat = flatten(value);
  if (typeof value !== "object" || value === null || (indent !== "" && flat.length <= SHORT)) return flat;
  const inner = `${indent}  `;
  if (Array.isArray(value)) {
    return value.length === 0 ? "[]" : `[\n${value.map((item) => inner + pretty(item, inner)).join(",\n")}\n${indent}]`;
  }
  const members = Object.entries(value);
  // An object of one key, such as a stage, is one thing with its value.
  const [only] = members;
  if (members.length === 1 && indent !== "" && typeof only![1] === "object" && only![1] !== null) return `{ ${JSON.stringify(only![0])}: ${pretty(only![1], indent)} }`;
  return members.length === 0 ? "{}" : `{\n${members.map(([key, item]) => `${inner}${JSON.stringify(key)}: ${pretty(item, inner)}`).join(",\n")}\n${indent}}`;
}

function flatten(value: Json): string {
  if (Array.isArray(value)) return `[${value.map(flatten).join(", ")}]`;
  if (typeof value !== "object" || value === null) return JSON.stringify(value);
  const members = Object.entries(value);
  return members.length === 0 ? "{}" : `{ ${members.map(([key, item]) => `${JSON.stringify(key)}: ${flatten(item)}`).join(", ")} }`;
}
