/** The names in formulas and in lines of the log, as `pipelines/src/expression` reads them. */
import type { Path } from "./place";

/** Keys whose values are formulas, in which names stand beside others. */
const FORMULAS: ReadonlySet<string> = new Set(["when", "condition", "formula", "components"]);

const keyOf = (path: Path): string => String(path.findLast((step) => typeof step === "string") ?? "");

/** Whether the value at a path is a formula. */
export const isFormula = (path: Path): boolean => FORMULAS.has(keyOf(path));

/** Whether the value at a path is a line of the log, in which names stand in braces. */
export const isMessage = (path: Path): boolean => path.includes("log") && keyOf(path) === "message";

/** A name as it is written in a formula: one that is no plain word stands in braces. */
export const written = (name: string): string => (/^[A-Za-z_][\w.]*$/.test(name) ? name : `{${name}}`);

export interface NameInFormula {
  name: string;
  /** From its first character to the one behind its last, braces among them. */
  from: number;
  to: number;
}

/** A name in braces, a number, or a word, which with a parenthesis behind it is a function. */
const TOKEN = /\{([^}]*)\}|\.?\d[\d.]*(?:[eE][+-]?\d+)?|([\p{Alphabetic}_][\p{Alphabetic}\p{N}_.]*)(\s*\()?/gu;

/** The names that a formula uses. */
export function namesIn(formula: string): NameInFormula[] {
  return [...formula.matchAll(TOKEN)].flatMap(({ 0: whole, 1: inBraces, 2: word, 3: parenthesis, index }) => {
    const name = inBraces ?? (parenthesis === undefined ? word : undefined);
    return name === undefined ? [] : [{ name, from: index, to: index + whole.length }];
  });
}
