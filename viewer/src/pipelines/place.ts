/** Where in a JSON text something stands, and what it says; also in one that is being written and has no end yet. */
import type { Json } from "../connection/protocol";

/** The way from the outermost value: keys and indices. */
export type Path = readonly (string | number)[];

/** A part of a text, from its first character to the one behind its last. */
export interface Range { from: number; to: number }

export interface Place {
  /** The way to the value that is written here, or of a key to the object that it is in. */
  path: Path;
  /** What is written here: a key of an object, or a value. */
  part: "key" | "value";
  /** The token that it is, from its first character to the one behind its last, quotes among them; both are the offset where there is none yet. */
  from: number;
  to: number;
  /** The other keys of the object that it is in. */
  keys: readonly string[];
  /** Whether a colon follows. */
  hasColon: boolean;
}

interface Level { kind: "object" | "array"; keys: { name: string; from: number }[]; index: number; key: string | null; expects: "key" | "colon" | "value" | "comma" }
interface Token { kind: "text" | "plain" | "sign"; from: number; to: number }

const TOKEN = /"(?:[^"\\\n]|\\.)*("|(?=\n)|$)|[{}[\]:,]|[^\s{}[\]:,"]+/y;

/** The token that begins at an offset or behind the space there; null at the end. */
function tokenAt(text: string, offset: number): Token | null {
  let from = offset;
  while (from < text.length && /\s/.test(text[from]!)) from++;
  TOKEN.lastIndex = from;
  const found = TOKEN.exec(text);
  if (!found) return null;
  return { kind: found[0].startsWith('"') ? "text" : /^[{}[\]:,]$/.test(found[0]) ? "sign" : "plain", from, to: from + found[0].length };
}

/** What a token of text says, without its quotes. */
export function content(token: string): string {
  try {
    return JSON.parse(token) as string;
  } catch {
    return token.replace(/^"|"$/g, "");
  }
}

/** Goes through a text, and calls `seen` at each token with the levels around it, before it counts. */
function walk(text: string, seen: (token: Token, levels: readonly Level[]) => boolean): Level[] {
  const levels: Level[] = [];
  for (let token = tokenAt(text, 0); token; token = tokenAt(text, token.to)) {
    if (seen(token, levels)) break;
    const level = levels.at(-1);
    const sign = token.kind === "sign" ? text[token.from]! : "";
    if (sign === "{" || sign === "[") {
      if (level) level.expects = "comma";
      levels.push({ kind: sign === "{" ? "object" : "array", keys: [], index: 0, key: null, expects: sign === "{" ? "key" : "value" });
    } else if (sign === "}" || sign === "]") levels.pop();
    else if (!level) continue;
    else if (sign === ":") level.expects = "value";
    else if (sign === ",") {
      level.index++;
      level.key = null;
      level.expects = level.kind === "object" ? "key" : "value";
    } else if (level.expects === "key") {
      level.key = content(text.slice(token.from, token.to));
      level.keys.push({ name: level.key, from: token.from });
      level.expects = "colon";
    } else level.expects = "comma";
  }
  return levels;
}

const pathOf = (levels: readonly Level[]): (string | number)[] =>
  levels.flatMap<string | number>(({ kind, key, index }) => (kind === "array" ? [index] : key === null ? [] : [key]));

/** A token of text with both its quotes. */
const CLOSED = /^"(?:[^"\\]|\\.)*"$/;

/** Whether what is typed at an offset belongs to a token: behind its first character, and behind its last where no quote has closed it. */
function isInside(text: string, { kind, from, to }: Token, offset: number): boolean {
  if (kind === "sign" || offset <= from || offset > to) return false;
  return offset < to || !CLOSED.test(text.slice(from, to));
}

/** What is written at an offset of a text; null where nothing can be, such as behind a value. */
export function placeAt(text: string, offset: number): Place | null {
  let found: Omit<Place, "keys"> | null = null;
  let depth = 0;
  const others: string[] = [];
  let isOver = false;
  const note = (levels: readonly Level[], { from, to }: Range): void => {
    isOver = true;
    const level = levels.at(-1);
    const hasColon = text[tokenAt(text, to)?.from ?? -1] === ":";
    depth = levels.length;
    if (!level) {
      found = levels.length === 0 ? { path: [], part: "value", from, to, hasColon } : null;
      return;
    }
    if (level.expects === "key" || level.expects === "value") {
      const part = level.expects;
      const own = level.kind === "array" ? [level.index] : part === "value" && level.key !== null ? [level.key] : [];
      found = { path: [...pathOf(levels.slice(0, -1)), ...own], part, from, to, hasColon };
      others.push(...level.keys.filter((key) => key.from !== from && (part === "key" || key.name !== level.key)).map(({ name }) => name));
    }
  };
  // On from there the rest of the object is looked at, for its other keys.
  const levels = walk(text, (token, levels) => {
    if (!isOver) {
      const isIn = isInside(text, token, offset);
      if (!isIn && token.from < offset) return false;
      note(levels, isIn ? token : { from: offset, to: offset });
      if (found === null) return true;
      // It is none of the other keys itself.
      if (isIn) return false;
    }
    if (levels.length < depth) return true;
    const level = levels.at(-1);
    if (levels.length === depth && level?.kind === "object" && level.expects === "key" && token.kind === "text") {
      others.push(content(text.slice(token.from, token.to)));
    }
    return false;
  });
  if (!isOver) note(levels, { from: offset, to: offset });
  return found === null ? null : { ...(found as Omit<Place, "keys">), keys: [...new Set(others)] };
}

/** The value of a text as far as it is written: what has no value yet is left out. */
export function readSoFar(text: string): Json {
  let root: Json = null;
  walk(text, (token, levels) => {
    const level = levels.at(-1);
    const value = valueBegunBy(text.slice(token.from, token.to));
    if (value === undefined || (level && level.expects !== "value")) return false;
    if (level) put(root, pathOf(levels), value);
    else root = value;
    return false;
  });
  return root;
}

/** The value that begins with a token; undefined for none. */
function valueBegunBy(token: string): Json | undefined {
  if (token === "{") return {};
  if (token === "[") return [];
  if (token.startsWith('"')) return content(token);
  try {
    return JSON.parse(token) as Json;
  } catch {
    return undefined;
  }
}

/** Puts a value at a path of another; nowhere, where the way there is none. */
function put(root: Json, path: Path, value: Json): void {
  let at: Json | undefined = root;
  for (const step of path.slice(0, -1)) at = typeof at === "object" && at !== null && Object.hasOwn(at, step) ? (at as { [key: string]: Json })[step] : undefined;
  const last = path.at(-1);
  if (typeof at !== "object" || at === null || last === undefined || Array.isArray(at) !== (typeof last === "number")) return;
  Object.defineProperty(at, last, { value, writable: true, enumerable: true, configurable: true });
}

/** The token at a line and column, counted from 1 in characters as the checker does. Of an object or a list it is the bracket. */
export function tokenRange(text: string, line: number, column: number): Range {
  let start = 0;
  for (let at = 1; at < line; at++) {
    const end = text.indexOf("\n", start);
    if (end < 0) break;
    start = end + 1;
  }
  const end = text.indexOf("\n", start);
  const before = [...text.slice(start, end < 0 ? text.length : end)].slice(0, Math.max(0, column - 1)).join("");
  const from = Math.min(start + before.length, text.length);
  const token = tokenAt(text, from);
  if (token && token.from === from) return { from, to: token.to };
  return { from: Math.max(0, Math.min(from, text.length - 1)), to: Math.min(text.length, from + 1) };
}

/** The token of the value, or else of the last key, that is found along a path; null where not even its beginning is there. */
export function rangeOf(text: string, path: Path): Range | null {
  let best: { from: number; to: number; depth: number } | null = null;
  walk(text, (token, levels) => {
    const level = levels.at(-1);
    const isKey = level?.kind === "object" && level.expects === "key" && token.kind === "text";
    const isValue = (!level || level.expects === "value") && !(token.kind === "sign" && /[}\],:]/.test(text[token.from]!));
    if (!isKey && !isValue) return false;
    const here = isKey ? [...pathOf(levels.slice(0, -1)), content(text.slice(token.from, token.to))] : pathOf(levels);
    if (here.length > path.length || here.some((step, i) => step !== path[i])) return false;
    // The value itself counts for more than the key before it.
    const depth = 2 * here.length + (isKey ? 0 : 1);
    if (!best || depth > best.depth) best = { from: token.from, to: token.to, depth };
    return false;
  });
  const found = best as { from: number; to: number } | null;
  return found && { from: found.from, to: found.to };
}

/** A path as errors write it: `stages[0].slice.normal`. */
export function readPath(text: string): (string | number)[] {
  return [...text.matchAll(/\[(\d+)\]|([^.[\]]+)/g)].map(([, index, key]) => (index === undefined ? key! : Number(index)));
}

/** A path as errors write it. */
export const writePath = (path: Path): string =>
  path.map((step, index) => (typeof step === "number" ? `[${step}]` : index === 0 ? step : `.${step}`)).join("");
