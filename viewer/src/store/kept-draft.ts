/** What stands in the form, as it is kept while the page is loaded again: read with care, and taken up once the run has told what it is for. */
import type { Json } from "../connection/protocol";
import { own } from "../own";
import { asksNothing, bodyOf, isObject } from "./draft";
import type { Draft, Part, State } from "./state";
import { sameJson } from "./store";

/** The edit that is composed with what it is composed of; `before` is the edit of the stack that it changes, as that was. */
export interface KeptDraft extends Pick<Draft, "key" | "settings" | "remedy" | "updating" | "partsBefore" | "amount"> {
  body: Draft["settings"]; before: Json; parts: Readonly<Record<string, Part>>;
}

/** Stands for a draft that was too long to be kept. */
export const TOO_LONG = "too long";
export type KeptForm = KeptDraft | typeof TOO_LONG;

/** The most characters of it: a region may hold very many faces. */
const LONGEST = 200_000;

/** What to keep; null where there is no form yet. */
export function draftToKeep(state: State): KeptForm | null {
  // Until the edits of the run have come, what was kept before is not in the form.
  if (!saysSomething(state) && state.keptDraft) return state.keptDraft;
  if (!state.form) return null;
  const { key, settings, remedy, updating, partsBefore, amount } = state.draft;
  const before = updating === null ? null : state.hello?.stack[updating] ?? null;
  const kept = { key, body: bodyOf(state.draft), settings, remedy, updating, partsBefore, amount, before, parts: state.selection.parts };
  return JSON.stringify(kept).length <= LONGEST ? kept : saysSomething(state) ? TOO_LONG : null;
}

/** What was kept, where it can be that. */
export function readDraft(kept: unknown): KeptForm | null {
  if (kept === TOO_LONG) return kept;
  if (!isObject(kept)) return null;
  const { key, body, settings, remedy, updating, partsBefore, amount, before, parts } = kept;
  const isAmount = amount === null || (isObject(amount) && isObject(amount.whole) && typeof amount.fraction === "number" && amount.fraction >= 0 && amount.fraction <= 1);
  const areParts = (some: Json | undefined): boolean => isObject(some) && Object.values(some).every((part) => part === "handle" || part === "fixed");
  const isSound = (key === null || typeof key === "string") && isObject(body) && isObject(settings) && isObject(remedy) && isAmount
    && (updating === null || (Number.isInteger(updating) && (updating as number) >= 0)) && before !== undefined
    && areParts(parts) && (partsBefore === null || areParts(partsBefore));
  return isSound ? { key, body, settings, remedy, updating, partsBefore, amount, before, parts } as unknown as KeptDraft : null;
}

/** Whether the run has told all that a draft can be of: its features, its edits and its form. */
export const canTakeUp = ({ form, hello }: State): boolean => form !== null && hello !== null && hello.isAwaitingEdits !== true;

/** Why what was kept fits the run no more, in words; empty where it does. */
export function whyNotFitting(state: State, { updating, before, parts }: KeptDraft): string {
  const names = new Set((state.hello?.features ?? []).map(({ name }) => name));
  const unknown = Object.keys(parts).find((name) => !names.has(name));
  if (unknown !== undefined) return `the mesh has no feature ${unknown} any more`;
  return updating !== null && !sameJson(state.hello?.stack[updating], before) ? "the edit that it changes is another one now" : "";
}

/** The draft that was kept. Of the other edits nothing is. */
export function draftOf(state: State, { key, body, settings, remedy, updating, partsBefore, amount }: KeptDraft): Draft {
  const known = own(state.draft.bodies, key ?? "") ?? {};
  const bodies = key === null ? state.draft.bodies : { ...state.draft.bodies, [key]: { ...known, ...body } };
  return { ...state.draft, key: key ?? state.draft.key, bodies, settings, remedy, updating, partsBefore, amount, problems: [] };
}

/** Whether a draft says something that would be lost with it. */
export const saysSomething = (state: State): boolean => !asksNothing(state) || state.draft.updating !== null;
