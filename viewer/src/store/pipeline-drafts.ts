/** The pipelines of the run, those whose text is being written, and what became of the change that was asked for last. Pure functions. */
import type { Json, PipelineChange } from "../connection/protocol";
import type { LanguageError } from "../kernel/language";
import { textOf } from "../pipelines/pretty";
import type { Action } from "./actions";
import type { Pipeline } from "./pipelines";

export interface PipelineDraft {
  /** The name of the pipeline that it takes the place of; null for one that is added. */
  replaced: string | null;
  text: string;
  /** The text with which it began. */
  began: string;
  /** What is wrong with this very text, and how many errors there are more; null as long as nobody has looked. */
  checked: { errors: readonly LanguageError[]; more: number } | null;
}

/** A change that was asked for. */
export interface AskedChange {
  id: string;
  /** The draft that it is of; null for a removal. */
  key: string | null;
  /** The name that the pipeline has then. */
  name: string;
  text: string;
  state: "sent" | "accepted" | "applied" | "refused" | "lost";
  /** What the run said: why not, or at which cycle. */
  reason: string;
  cycle: number | null;
}

export interface PipelinesState {
  known: readonly Pipeline[];
  drafts: Readonly<Record<string, PipelineDraft>>;
  /** The draft that is in the editor; null where that is closed. */
  open: string | null;
  asked: AskedChange | null;
}

export const NO_PIPELINES: PipelinesState = { known: [], drafts: {}, open: null, asked: null };
/** The most drafts that are kept. */
const MOST = 50;

/** The key of a draft of a pipeline of the run. */
export const keyOf = (name: string): string => `of ${name}`;

/** A key that no draft has, for one of a pipeline that is added. */
export function newKey(drafts: PipelinesState["drafts"]): string {
  let number = 1;
  while (drafts[`new ${number}`]) number++;
  return `new ${number}`;
}

export const isChanged = (draft: PipelineDraft): boolean => draft.text !== draft.began;

export const openDraft = ({ open, drafts }: PipelinesState): PipelineDraft | null => (open === null ? null : drafts[open] ?? null);

export function pipelinesAfter(state: PipelinesState, action: Action): PipelinesState {
  switch (action.type) {
    case "pipelines known": return withKnown(state, action.pipelines);
    case "pipeline opened": {
      const before = left(state);
      if (before.drafts[action.key]) return { ...before, open: action.key };
      if (Object.keys(before.drafts).length >= MOST) return state;
      const draft = { replaced: action.replaced, text: action.text, began: action.began ?? action.text, checked: null };
      return { ...before, drafts: { ...before.drafts, [action.key]: draft }, open: action.key, asked: settled(before.asked) };
    }
    case "pipeline written": {
      const draft = openDraft(state);
      if (!draft || draft.text === action.text) return state;
      return { ...withDraft(state, state.open!, { ...draft, text: action.text, checked: null }), asked: settled(state.asked) };
    }
    case "pipeline checked": {
      const draft = state.drafts[action.key];
      // What was said of another text says nothing of this one.
      return draft?.text === action.text ? withDraft(state, action.key, { ...draft, checked: { errors: action.errors, more: action.more } }) : state;
    }
    case "pipeline left": return left(state);
    case "pipeline discarded": {
      const { [action.key]: _, ...drafts } = state.drafts;
      return { ...state, drafts, open: state.open === action.key ? null : state.open };
    }
    case "pipelines asked": return { ...state, asked: { ...action.asked, state: "sent", reason: "", cycle: null } };
    case "pipelines outcome": return withOutcome(state, action.change);
    case "pipelines refused": return state.asked?.id === action.id ? { ...state, asked: { ...state.asked, state: "refused", reason: action.text } } : state;
    case "connection": {
      const isOpen = state.asked?.state === "sent" || state.asked?.state === "accepted";
      return action.state !== "connected" && isOpen ? { ...state, asked: { ...state.asked!, state: "lost" } } : state;
    }
    default: return state;
  }
}

/** The outcome of a change is shown until something else is done. */
const settled = (asked: AskedChange | null): AskedChange | null => (asked?.state === "sent" || asked?.state === "accepted" ? asked : null);

const withDraft = (state: PipelinesState, key: string, draft: PipelineDraft): PipelinesState => ({ ...state, drafts: { ...state.drafts, [key]: draft } });

/** The editor is closed; a draft in which nothing was written is none. */
function left(state: PipelinesState): PipelinesState {
  const draft = openDraft(state);
  if (!draft || isChanged(draft)) return state.open === null ? state : { ...state, open: null };
  const { [state.open!]: _, ...drafts } = state.drafts;
  return { ...state, drafts, open: null };
}

/** Drafts in which nothing was written follow the run. */
function withKnown(state: PipelinesState, known: readonly Pipeline[]): PipelinesState {
  const drafts = Object.fromEntries(Object.entries(state.drafts).map(([key, draft]) => {
    const own = known.find(({ name }) => name === draft.replaced);
    if (!own) return [key, draft];
    const text = textOf(own);
    return [key, !isChanged(draft) && text !== draft.text ? { ...draft, text, began: text, checked: null } : draft];
  }));
  return { ...state, known, drafts };
}

function withOutcome(state: PipelinesState, { id, status, cycle }: PipelineChange): PipelinesState {
  const { asked } = state;
  if (asked?.id !== id) return state;
  const next = { ...state, asked: { ...asked, state: status, cycle: cycle ?? null } };
  const draft = asked.key === null ? undefined : state.drafts[asked.key];
  if (status !== "applied" || asked.key === null || !draft) return next;
  // It is a pipeline of the run now, of which one may go on writing.
  const { [asked.key]: _, ...drafts } = state.drafts;
  const key = keyOf(asked.name);
  const isOpen = state.open === asked.key;
  const isWritten = draft.text !== asked.text;
  if (!isOpen && !isWritten) return { ...next, drafts };
  return { ...next, drafts: { ...drafts, [key]: { ...draft, replaced: asked.name, began: asked.text } }, open: isOpen ? key : state.open, asked: { ...next.asked, key } };
}

/** Longer than what is kept of drafts over a reload. */
const LONGEST = 1_000_000;

/** Drafts as `JSON.stringify` has written them; rubbish counts as none. */
export function readDrafts(written: string | null): PipelinesState["drafts"] {
  let found: unknown;
  try {
    found = written === null || written.length > LONGEST ? null : JSON.parse(written);
  } catch {
    return {};
  }
  if (typeof found !== "object" || found === null) return {};
  const isDraft = (draft: unknown): draft is PipelineDraft => {
    const { replaced, text, began } = (draft ?? {}) as Partial<PipelineDraft>;
    return (replaced === null || typeof replaced === "string") && typeof text === "string" && typeof began === "string";
  };
  const drafts = Object.entries(found).filter((entry): entry is [string, PipelineDraft] => isDraft(entry[1])).slice(0, MOST);
  return Object.fromEntries(drafts.map(([key, { replaced, text, began }]) => [key, { replaced, text, began, checked: null }]));
}

/** The message that sets what a draft says; null where that is no pipeline. */
export function changeOf(draft: PipelineDraft, known: readonly Pipeline[]): { name: string; change: Json } | null {
  let written: Json;
  try {
    written = JSON.parse(draft.text) as Json;
  } catch {
    return null;
  }
  if (typeof written !== "object" || written === null || Array.isArray(written) || typeof written.name !== "string") return null;
  const { name } = written;
  const isRenamed = draft.replaced !== null && draft.replaced !== name && known.some((pipeline) => pipeline.name === draft.replaced);
  const change: Json = isRenamed
    ? { all: known.map((pipeline) => (pipeline.name === draft.replaced ? written : pipeline as Json)) } : { set: [written] };
  return { name, change };
}

/** An error of the run as one of the text: its path from the pipeline, the message without the place of the message that was sent, and the name that was likely meant. */
export function readRefusal(reason: string): { path: string; message: string; suggestion: string | null } {
  const [, path = "", rest = reason] = /^message:\d+:\d+: pipelines\.(?:set|all)\[\d+\]\.?([^\s:]*): ([\s\S]*)$/.exec(reason) ?? [];
  const [, message = rest, suggestion = null] = /^([\s\S]*); did you mean [`']([^`']+)[`']\?$/.exec(rest) ?? [];
  return { path, message, suggestion };
}
