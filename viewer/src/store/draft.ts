/** What stands in the form, as an order: pure functions of the state. */
import type { Json } from "../connection/protocol";
import { ROLES } from "../form/schema";
import type { EditKind, Field, Property, Values } from "../form/schema";
import { own } from "../own";
import type { Draft, Part, State } from "./state";
import { derived, sameJson } from "./store";

/** How far an open boundary may move without a word, as a part of the size of the surface. */
export const OPEN_BOUNDARY_MOTION = 0.01;

export function isObject(value: unknown): value is Values {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

/** The name and the fields of an edit. */
export function partsOf(edit: Json | undefined): { key: string; body: Values } | null {
  const [key, body] = Object.entries(isObject(edit) ? edit : {})[0] ?? [];
  return key !== undefined && isObject(body) ? { key, body } : null;
}

export function kindOf(state: Pick<State, "form">, key: string | null): EditKind | null {
  return state.form?.edits.find((edit) => edit.key === key) ?? null;
}

export const bodyOf = (draft: Draft): Values => (draft.key === null ? {} : draft.bodies[draft.key] ?? {});

const propertiesOf = (kind: EditKind): Property[] => (kind.field.kind === "object" ? kind.field.properties : []);

/** The features that play a part, in the order of the mesh. */
export function chosen(state: Pick<State, "hello" | "selection">, part: Part): string[] {
  return (state.hello?.features ?? []).map((feature) => feature.name).filter((name) => own(state.selection.parts, name) === part);
}

/** Why what stands in the form is no edit yet, in words; empty where it is one. */
export function missing(state: State): string {
  const kind = kindOf(state, state.draft.key);
  if (!kind) return "There is no edit to make yet.";
  const [problem] = state.draft.problems;
  if (problem) return problem.text;
  const needed = kind.field.kind === "object" ? kind.field.oneOf ?? [] : [];
  const body = bodyOf(state.draft);
  const has = (name: string): boolean => (name === "features" ? chosen(state, "handle").length > 0 : body[name] !== undefined);
  return needed.length > 0 && !needed.some(has)
    ? "Choose at least one feature as the handle (click it in the picture, or tick it in the list), or set a region." : "";
}

/** The edit that stands in the form; null as long as something is missing or wrong. */
export function composedEdit(state: State): Json | null {
  const kind = kindOf(state, state.draft.key);
  if (!kind || missing(state) !== "") return null;
  const body: Values = {};
  for (const { name } of propertiesOf(kind)) {
    const part = ROLES[name];
    const names = part && chosen(state, part);
    if (names && (names.length > 0 || part === "fixed")) body[name] = names;
  }
  return { [kind.key]: { ...body, ...bodyOf(state.draft) } };
}

/** Whether what stands in the form asks for nothing: every amount is neutral, and there is nothing wrong to be mended. */
export const asksNothing: (state: State) => boolean = derived(composing, (state) => {
  const { draft } = state;
  const kind = kindOf(state, draft.key);
  if (!kind) return true;
  if (draft.problems.length > 0) return false;
  if (draft.updating !== null) {
    const edit = composedEdit(state);
    const now = state.hello?.stack[draft.updating];
    return edit === null || now === undefined || sameEdit(kind, edit, now);
  }
  const body = bodyOf(draft);
  return sameJson(sorted(amountsOf(kind.field, body)), sorted(amountsOf(kind.field, kind.neutral)));
});

/** Whether two edits of a kind ask for the same, what they leave out counted as what it begins with. */
function sameEdit(kind: EditKind, a: Json, b: Json): boolean {
  const whole = (edit: Json): Json => {
    const parts = partsOf(edit);
    return parts?.key === kind.key ? sorted({ ...kind.neutral, ...withoutShorthand(kind, parts.body) }) : null;
  };
  return sameJson(whole(a), whole(b));
}

/** A value with the keys of its objects in order. */
function sorted(value: Json): Json {
  if (Array.isArray(value)) return value.map(sorted);
  if (!isObject(value)) return value;
  return Object.fromEntries(Object.entries(value).sort(([a], [b]) => (a < b ? -1 : 1)).map(([key, inner]) => [key, sorted(inner)]));
}

/** The amounts of an edit: what says how much is asked for. Without any, all of its fields. */
function amountsOf(field: Field, value: Json | undefined): Json {
  if (field.kind !== "object" || !isObject(value)) return value ?? null;
  const amounts = field.properties.filter((property) => property.neutral !== undefined || property.field.kind === "list");
  const chosen = amounts.length > 0 ? amounts : field.properties.filter((property) => !property.hidden && ROLES[property.name] === undefined);
  return Object.fromEntries(chosen.flatMap(({ name }) => (value[name] === undefined ? [] : [[name, value[name]!]])));
}

/**
 * The fields of an edit with a fraction of its amounts: 1 is all of them, 0 what stood there `before`, or nothing at all where the edit is
 * a new one.
 */
export function scaled(field: Field, values: Values, fraction: number, before: Values = {}): Values {
  if (field.kind !== "object") return values;
  const result = { ...values };
  for (const { name, neutral, field: inner } of field.properties) {
    const value = values[name];
    if (value === undefined) continue;
    const known = before[name];
    if (neutral !== undefined) result[name] = between(known ?? neutral, value, fraction);
    else if (inner.kind === "list" && Array.isArray(value)) {
      const earlier = (entry: Values): Values => {
        const same = Array.isArray(known) ? known.find((other) => isObject(other) && sameJson(fixedPart(inner.item, other), fixedPart(inner.item, entry))) : undefined;
        return isObject(same) ? same : {};
      };
      result[name] = value.map((entry) => (isObject(entry) ? scaled(inner.item, entry, fraction, earlier(entry)) : entry));
    }
  }
  return result;
}

/** Whether fields are the same. What is not another one is not looked at: a region may hold very many faces. */
export function sameFields(a: Values, b: Values): boolean {
  const names = Object.keys(a);
  return a === b || (names.length === Object.keys(b).length && names.every((name) => Object.hasOwn(b, name) && sameJson(a[name], b[name])));
}

/** What stands in the form at its full amount. */
export const wholeOf = ({ draft }: Pick<State, "draft">): Values => draft.amount?.whole ?? bodyOf(draft);

/** Whether a part of what stands in the form is something else than all of it. */
export const isDivisible: (state: State) => boolean = derived(composing, (state) => {
  const kind = kindOf(state, state.draft.key);
  const whole = wholeOf(state);
  return kind !== null && !sameFields(scaled(kind.field, whole, 0.5, fieldsBefore(state)), whole);
});

/** What of an entry is no amount: which one it is. */
function fixedPart(field: Field & { kind: "object" }, entry: Values): Values {
  return Object.fromEntries(field.properties.flatMap(({ name, neutral }) => (neutral === undefined && entry[name] !== undefined ? [[name, entry[name]]] : [])));
}

/**
 * The fields of the edit that is being changed, as they are in the stack: what a part of the change is measured from. Of a new edit there are
 * none, and of one that was not changed yet neither: a part of it is a part of the edit itself.
 */
export function fieldsBefore(state: Pick<State, "hello" | "draft" | "form">): Values {
  const { key, updating, amount } = state.draft;
  const [kind, edit] = [kindOf(state, key), updating === null ? null : partsOf(state.hello?.stack[updating])];
  if (!kind || edit?.key !== key) return {};
  const isUnchanged = sameEdit(kind, { [kind.key]: withoutRoles(amount?.whole ?? bodyOf(state.draft)) }, { [kind.key]: withoutRoles(edit.body) });
  return isUnchanged ? {} : withoutShorthand(kind, edit.body);
}

/** The fields of an edit without its features, which are the selection. */
const withoutRoles = (body: Values): Values => Object.fromEntries(Object.entries(body).filter(([name]) => ROLES[name] === undefined));

function between(neutral: Json, value: Json, fraction: number): Json {
  // What is typed has few digits, and so has a part of it.
  if (typeof value === "number") return typeof neutral === "number" ? Number((neutral + fraction * (value - neutral)).toPrecision(12)) : value;
  return Array.isArray(value) ? value.map((entry, i) => between(Array.isArray(neutral) ? neutral[i] ?? null : neutral, entry, fraction)) : value;
}

/** The fields of an edit with those that are a short way of writing a list in that list. */
export function withoutShorthand(kind: EditKind, body: Values): Values {
  const result = { ...body };
  for (const { name, field } of propertiesOf(kind)) {
    if (field.kind !== "list") continue;
    const names = field.item.properties.map((property) => property.name);
    const short = names.every((entry) => isObject(body) && body[entry] !== undefined && body[entry] !== null);
    if (short) {
      const before = result[name];
      result[name] = [Object.fromEntries(names.map((entry) => [entry, body[entry]!])), ...(Array.isArray(before) ? before : [])];
    }
    if (names.every((entry) => propertiesOf(kind).some((property) => property.name === entry))) for (const entry of names) delete result[entry];
  }
  return result;
}

/** What an order is composed of. */
function composing({ hello, form, draft, selection }: State): readonly unknown[] {
  return [hello, form, draft, selection.parts];
}

/** The stack as it would be with what stands in the form; null where it asks for nothing, or for nothing that can be done. */
export const wishedStack: (state: State) => Json[] | null = derived(composing, (state) => {
  const edit = asksNothing(state) ? null : composedEdit(state);
  const stack = state.hello?.stack;
  if (edit === null || !stack) return null;
  const { updating } = state.draft;
  return updating === null ? [...stack, edit] : stack.map((other, i) => (i === updating ? edit : other));
});

/** The order that stands in the form; null where it asks for nothing, or for nothing that can be done. */
export const wishedOrder: (state: State) => Values | null = derived(composing, (state) => {
  const stack = wishedStack(state);
  if (!stack) return null;
  const { updating, settings, remedy } = state.draft;
  return { ...(updating === null ? { edits: [stack.at(-1)!] } : { stack }), ...settings, ...remedy };
});

/** The features through which something flows in or out. */
export function openBoundaries(state: Pick<State, "hello">): string[] {
  return (state.hello?.features ?? []).filter(({ condition }) => condition === "inflow" || condition === "outflow").map(({ name }) => name);
}

/** What decides which features an edit moves, whatever its amounts. */
export function moverOf(state: State): Json {
  const { key, updating } = state.draft;
  return [key, updating, chosen(state, "handle"), chosen(state, "fixed"), bodyOf(state.draft).region ?? null];
}

/** Open boundaries that may move, while no preview has said whether they do. */
export function openBoundariesUnknown(state: State): string[] {
  const { preview, selection } = state;
  const isUnknown = preview.moved === null && (preview.state === "waiting" || preview.state === "failed");
  if (!isUnknown || wishedStack(state) === null) return [];
  return openBoundaries(state).filter((name) => own(selection.parts, name) !== "fixed");
}

/** Open boundaries that what is previewed would move by more than a hundredth of the surface's size. */
export function openBoundariesMoved(state: State): { name: string; condition: string; by: number; part: number }[] {
  const { preview: { moved, size }, hello } = state;
  if (!moved || !size) return [];
  return (hello?.features ?? []).flatMap(({ name, condition }) => {
    const by = own(moved, name) ?? 0;
    const part = by / size;
    return (condition === "inflow" || condition === "outflow") && part > OPEN_BOUNDARY_MOTION ? [{ name, condition, by, part }] : [];
  });
}

/** The drags of skeleton nodes with another one: of the node at this place, or added. */
export function withMove(moves: Json | undefined, at: Json, by: Json): Json[] {
  const known = Array.isArray(moves) ? moves : [];
  const same = known.findIndex((move) => isObject(move) && sameJson(move.at, at));
  return same < 0 ? [...known, { at, by }] : known.map((move, i) => (i === same ? { at, by } : move));
}

