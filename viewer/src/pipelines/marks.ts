/** Where errors and warnings stand in the text of a pipeline, and how they can be put right. */
import type { LanguageError } from "../kernel/language";
import { readRefusal } from "../store/pipeline-drafts";
import { content, rangeOf, readPath, tokenRange, writePath } from "./place";
import type { Path, Range } from "./place";

export interface Mark {
  from: number;
  to: number;
  /** The line, from 1. */
  line: number;
  /** What is wrong, in words. */
  text: string;
  /** What would put it right: a name, and the text in place of the mark's. */
  fix: { name: string; insert: string } | null;
  /** Whether the pipeline can be applied all the same. */
  isWarning: boolean;
}

const lineOf = (text: string, offset: number): number => text.slice(0, offset).split("\n").length;

/** The token with the name that was likely meant in place of that which the message says was found. */
function fixOf(token: string, message: string, name: string | null): Mark["fix"] {
  if (name === null) return null;
  const wrong = [...message.matchAll(/[`']([^`']+)[`']/g)].map(([, found]) => found!).find((found) => token.includes(found));
  if (wrong !== undefined && content(token) !== wrong) return { name, insert: token.replace(wrong, name) };
  return token.startsWith('"') ? { name, insert: JSON.stringify(name) } : null;
}

const marked = (text: string, { from, to }: Range, path: string, message: string, suggestion: string | null): Mark => ({
  from, to, line: lineOf(text, from), fix: fixOf(text.slice(from, to), message, suggestion), isWarning: false,
  text: `${path === "" ? "" : `${path}: `}${message.replace(/`([^`]*)`/g, "“$1”")}${suggestion === null ? "" : `; did you mean ${suggestion}?`}`,
});

export const markOf = (text: string, { line, column, path, message, suggestion }: LanguageError): Mark =>
  marked(text, tokenRange(text, line, column), path, message, suggestion);

/** A warning of what stands at a path; `insert` is what would put the name that was likely meant in place of the range. */
export const warningMark = (text: string, range: Range, path: Path, message: string, meant: string | null, insert: string | null): Mark =>
  ({ ...marked(text, range, writePath(path), message, meant), fix: meant === null || insert === null ? null : { name: meant, insert }, isWarning: true });

/** Where what the run has refused stands: by its path, or at the first value that it names; null where neither is there. */
export function refusalMark(text: string, reason: string): Mark | null {
  const { path, message, suggestion } = readRefusal(reason);
  const steps = readPath(path);
  let range = steps.length > 0 ? rangeOf(text, steps) : null;
  for (const [, name] of range ? [] : message.matchAll(/[`'"]([^`'"]+)[`'"]/g)) {
    const from = text.indexOf(JSON.stringify(name));
    // The pipeline's own name is no fault.
    if (from < 0 || /"name"\s*:\s*$/.test(text.slice(0, from))) continue;
    range = { from, to: from + JSON.stringify(name).length };
    break;
  }
  return range && marked(text, range, path, message, suggestion);
}
