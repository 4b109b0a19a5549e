/**
 * Fields and features that a pipeline names and nobody has: neither the run nor one of its stages. They are warnings, for the run has the
 * last word. Monitors and parameters are looked up by the checker, as errors.
 */
import type { Json } from "../connection/protocol";
import { isFormula, namesIn, written } from "./formula";
import { warningMark } from "./marks";
import type { Mark } from "./marks";
import { namesAt } from "./names";
import type { RunNames } from "./names";
import { listed, nearest } from "./nearest";
import { rangeOf, readSoFar } from "./place";
import type { Path } from "./place";
import { isBody, madeFields } from "./stages";
import { nameKind } from "./suggestions";

/** The names that formulas have without any field. */
const GIVEN: ReadonlySet<string> = new Set(["x", "y", "z", "time", "cycle", "pi"]);

interface Text { path: Path; text: string }

/** All texts within a value. */
function textsIn(value: Json | undefined, path: Path): Text[] {
  if (typeof value === "string") return [{ path, text: value }];
  if (Array.isArray(value)) return value.flatMap((item, index) => textsIn(item, [...path, index]));
  return typeof value === "object" && value !== null ? Object.entries(value).flatMap(([key, item]) => textsIn(item, [...path, key])) : [];
}

/** A name that nobody has, and what was likely meant. */
interface Unknown { message: string; near: string | null }

/** The warnings for the text of a pipeline without errors. Of a kind of which the run has no names nothing is known, and nothing is said. */
export function unknownNames(source: string, run: RunNames): Mark[] {
  const pipeline = readSoFar(source);
  const parts = isBody(pipeline) ? ["stages", "then"].flatMap((part) => textsIn(pipeline[part], [part])) : [];
  return parts.flatMap(({ path, text }) => {
    const kind = nameKind(path);
    if (kind !== "feature" && kind !== "field") return [];
    const known = kind === "feature" ? run.features : namesAt(run, pipeline, null, path).fields.map(({ name }) => name);
    if ((kind === "feature" ? run.features : run.fields).length === 0) return [];
    if (kind === "field" && isFormula(path)) return inFormula(source, path, text, known, run.parameters);
    // Of a field that is there, but not for this stage, the run says more.
    if (known.includes(text) || (kind === "field" && madeFields(pipeline, path).some(({ name }) => name === text))) return [];
    const { message, near } = unknown(kind, text, known);
    return [warningMark(source, rangeOf(source, path)!, path, message, near, near && JSON.stringify(near))];
  });
}

function unknown(kind: "feature" | "field", name: string, known: readonly string[]): Unknown {
  const near = nearest(name, known);
  const message = kind === "feature" ? `the run has no feature \`${name}\`` : `neither the run nor a stage before has a field \`${name}\``;
  return { message: near === null ? `${message}; the ${kind}s are ${listed(known)}` : message, near };
}

function inFormula(source: string, path: Path, formula: string, fields: readonly string[], parameters: readonly string[]): Mark[] {
  const token = rangeOf(source, path)!;
  // Where something is escaped the places in the text are not those in the formula.
  const isPlain = source.slice(token.from + 1, token.to - 1) === formula;
  return namesIn(formula).flatMap(({ name, from, to }) => {
    const [field, component] = [name.replace(/\.[^.]*$/, ""), /\.[^.]*$/.exec(name)?.[0] ?? ""];
    if (GIVEN.has(name) || name.startsWith("parameter.") || fields.includes(name) || fields.includes(field)) return [];
    const { message, near } = unknown("field", field, fields);
    const meant = parameters.includes(name) ? `parameter.${name}` : near && `${near}${component}`;
    const range = isPlain ? { from: token.from + 1 + from, to: token.from + 1 + to } : token;
    return [warningMark(source, range, path, message, meant, isPlain ? meant && written(meant) : null)];
  });
}
