/** What the page knows: of the run, of what is being composed, and of what became of it. */
import type { ConnectionState } from "../connection/connection";
import type { ForecastAnswer, Hello, Json, OrderStatus, Person, PinnedNote, Played, RunEnd, Status } from "../connection/protocol";
import type { OrderForm, Values } from "../form/schema";
import type { KeptForm } from "./kept-draft";
import type { Carried, Looks } from "./looks";
import { NO_PIPELINES } from "./pipeline-drafts";
import type { PipelinesState } from "./pipeline-drafts";

export type Part = "handle" | "fixed";

/** Which features move and which are held; the one under the pointer. */
export interface SelectionState { parts: Readonly<Record<string, Part>>; hovered: string | null }

/** Something in the form that cannot be sent: which field it is, such as `factors z`, and what is wrong with it. */
export interface Problem { field: string; text: string }

/** What a step back in the form brings back. */
export interface Composed extends Pick<Draft, "key" | "bodies" | "settings" | "remedy" | "updating" | "partsBefore"> { parts: Readonly<Record<string, Part>> }

/** What stands in the form. */
export interface Draft {
  /** The edit that is composed, by its name in the JSON; null before the form is there. */
  key: string | null;
  /** The fields of each edit, without its features: those are the selection. */
  bodies: Readonly<Record<string, Values>>;
  /** What the order sets beside its edits. */
  settings: Values;
  /** What a remedy for this edit alone sets beside them. */
  remedy: Values;
  problems: readonly Problem[];
  /** The edit of the stack that is being changed, counted from 0; null for a new one. */
  updating: number | null;
  /** What was chosen before an edit or an order was loaded: it is chosen again once that is given or given up. Null where none is loaded. */
  partsBefore: Readonly<Record<string, Part>> | null;
  /** The fields at their full amount, and the part of it that stands in the form, from 0 to 1. */
  amount: { whole: Values; fraction: number } | null;
  /** The step that is under way: what belongs to one gesture or one field is taken back at once. */
  step: string | null;
  past: readonly Composed[];
  future: readonly Composed[];
}

/** The states that the server tells, and the two that only this viewer knows. */
export type OrderPhase = OrderStatus["status"] | "sent" | "lost";
export interface OrderRecord extends Omit<OrderStatus, "status"> { status: OrderPhase; text: string; sentAt: number | null }

export interface PreviewState {
  state: "none" | "waiting" | "shown" | "failed";
  /** How far the edits would move any point of the surface. */
  largest: number | null;
  /** How far they would move each feature, by name; while a preview is computed, the one before it; null as long as that is not known. */
  moved: Readonly<Record<string, number>> | null;
  /** The diagonal of the box around the surface. */
  size: number | null;
  /** Milliseconds from the newest change of the form to its picture, and those of them that went into computing it. */
  milliseconds: number | null;
  computing: number | null;
  reason: string | null;
  /** What is wrong with the shape; empty where it is sound, null as long as it was not looked at. */
  faults: string | null;
  /** The features that have the faces where that is seen; empty also where one of these faces is of no feature. */
  brokenIn: readonly string[];
}

export interface ForecastState {
  state: "none" | "waiting" | "told" | "failed";
  answer: ForecastAnswer["order"] | null;
  reason: string | null;
}

/** Data frames taken since the page was opened, the cycle of the newest, and by how many cycles frames of each view were apart lately. */
export interface Frames { count: number; cycle: number | null; views: Readonly<Record<string, { cycle: number; gaps: readonly number[] }>> }

export interface State {
  connection: { state: ConnectionState; explanation: string; /** Whether there has been a connection before this one. */ known: boolean; fresh: boolean };
  hello: Hello | null;
  status: Status | null;
  /** Where in a recording the viewer is; null of a run. */
  played: Played | null;
  /** The last word of a run that has ended. */
  end: RunEnd | null;
  /** When the run was at which cycle, by this page's clock; the newest last. */
  progress: readonly { cycle: number; at: number }[];
  frames: Frames;
  /** The fields that each view carries, as its frames say. */
  carried: Carried;
  /** How each view looks, also one that is no more and may come back; and the one whose look is being changed. */
  looks: Looks;
  chosenView: string | null;
  /** By view, within how many times the error that was asked for its values are, where the connection does not carry it as it is. */
  coarser: { readonly [view: string]: number };
  selection: SelectionState;
  /** The form for an order; null before the schema has come. */
  form: OrderForm | null;
  draft: Draft;
  /** What stood in the form before the page was loaded again, until the run has told all that it can be of; null for nothing. */
  keptDraft: KeptForm | null;
  /** Orders by the time they became known. */
  orders: readonly OrderRecord[];
  /** The refused orders that were taken off the list by hand, by their ids: a recording tells its orders anew at each moment. */
  dismissed: readonly string[];
  /** Stacks that an undo has left, the newest last. */
  undone: readonly Json[][];
  preview: PreviewState;
  forecast: ForecastState;
  /** The viewer that asks for the wheel. */
  askedBy: string | null;
  /** Who is connected, this viewer among them; none where nobody has said. */
  people: readonly Person[];
  /** How many follow the camera of this viewer, which steers. */
  followedBy: number;
  /** Whether this picture is seen from where that of the one who steers is. */
  following: boolean;
  /** The notes that are pinned, the oldest first. */
  notes: readonly PinnedNote[];
  /** The note to whose cycle a recording was taken, as long as it is not told there yet; null for none. */
  soughtNote: PinnedNote | null;
  pipelines: PipelinesState;
  /** Whether the browser has taken away what draws the picture. */
  isPictureLost: boolean;
  /** What the simulation refused, in its own words; empty for nothing. */
  refusal: string;
  /** What went wrong: frames or messages that could not be read, and what has failed in the page; newest last. */
  errors: readonly string[];
}

export const NO_PREVIEW: PreviewState = { state: "none", largest: null, moved: null, size: null, milliseconds: null, computing: null, reason: null, faults: null, brokenIn: [] };
export const NO_FORECAST: ForecastState = { state: "none", answer: null, reason: null };

export const INITIAL: State = {
  connection: { state: "connecting", explanation: "", known: false, fresh: false },
  hello: null, status: null, played: null, end: null,
  progress: [],
  frames: { count: 0, cycle: null, views: {} },
  carried: {}, looks: {}, chosenView: null, coarser: {},
  selection: { parts: {}, hovered: null },
  form: null,
  draft: { key: null, bodies: {}, settings: {}, remedy: {}, problems: [], updating: null, partsBefore: null, amount: null, step: null, past: [], future: [] },
  keptDraft: null,
  orders: [], dismissed: [], undone: [],
  preview: NO_PREVIEW, forecast: NO_FORECAST,
  askedBy: null, people: [], followedBy: 0, following: false, notes: [], soughtNote: null, pipelines: NO_PIPELINES, isPictureLost: false, refusal: "", errors: [],
};
