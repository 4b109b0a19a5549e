/** What can happen: from the simulation, or from the person at the page. */
import type { ConnectionState } from "../connection/connection";
import type { FieldInformation, ForecastAnswer, Hello, Json, OrderStatus, Person, PinnedNote, PipelineChange, Played, RunEnd, Status } from "../connection/protocol";
import type { OrderForm, Values } from "../form/schema";
import type { LanguageError } from "../kernel/language";
import type { KeptForm } from "./kept-draft";
import type { Look } from "./looks";
import type { AskedChange } from "./pipeline-drafts";
import type { Pipeline } from "./pipelines";
import type { Part, PreviewState, Problem } from "./state";

export type Action =
  // From the simulation.
  | { type: "connection"; state: ConnectionState; explanation: string }
  | { type: "hello"; hello: Hello }
  /** The values of the parameters, by name. */
  | { type: "parameters"; values: Readonly<Record<string, number>> }
  /** All edits that make the shape, and how many orders can be taken back. */
  | { type: "stack"; edits: Json[]; undoable: number | undefined }
  /** The stack is another one, whose edits are being fetched. */
  | { type: "stack awaited"; undoable: number | undefined }
  /** The values of a view are within so many times the error that was asked for. */
  | { type: "precision"; view: string; coarser: number }
  | { type: "status"; status: Status; at: number }
  | { type: "frame"; view: string; cycle: number }
  /** The fields that the frames of a view carry from now on. */
  | { type: "carries"; view: string; fields: readonly FieldInformation[] }
  | { type: "order"; status: OrderStatus }
  | { type: "played"; played: Played }
  | { type: "end"; end: RunEnd }
  | { type: "wheel asked"; by: string }
  | { type: "people"; viewers: readonly Person[] }
  | { type: "followed"; by: number }
  | { type: "note pinned"; note: PinnedNote }
  | { type: "note removed"; number: number }
  | { type: "pipelines known"; pipelines: readonly Pipeline[] }
  | { type: "pipelines outcome"; change: PipelineChange }
  | { type: "pipelines refused"; id: string; text: string }
  | { type: "refused"; id: string | null; text: string }
  | { type: "unreadable"; text: string }
  | { type: "schema"; form: OrderForm | null; settings: Values }
  // What was sent.
  | { type: "order sent"; id: string; order: Json; at: number }
  | { type: "order dismissed"; id: string }
  | { type: "wheel answered" }
  /** The recording is to go to the cycle of a note; null where it is to go elsewhere. */
  | { type: "note sought"; note: PinnedNote | null }
  | { type: "following"; on: boolean }
  | { type: "pipelines asked"; asked: Pick<AskedChange, "id" | "key" | "name" | "text"> }
  // The pipelines that are being written; `began` is what counts as nothing written, the text itself where it is left out.
  | { type: "pipeline opened"; key: string; replaced: string | null; text: string; began?: string }
  | { type: "pipeline written"; text: string }
  | { type: "pipeline checked"; key: string; text: string; errors: readonly LanguageError[]; more: number }
  | { type: "pipeline left" }
  | { type: "pipeline discarded"; key: string }
  // The views; `view` is null for all of them.
  | { type: "look"; view: string | null; look: Partial<Look> }
  | { type: "view chosen"; view: string }
  // The features.
  | { type: "part"; feature: string; part: Part | null }
  | { type: "hover"; feature: string | null }
  /** The browser has taken away what draws the picture, or given it back. */
  | { type: "picture lost"; isLost: boolean }
  /** The page was loaded again: what it showed, and what stood in the form. */
  | { type: "remembered"; chosenView: string | null; draft: KeptForm | null; dismissed: readonly string[] }
  // The form. `step` names the field or gesture: all that it does is one step to take back.
  | { type: "form read"; key: string; body: Values; settings: Values; problems: readonly Problem[]; step: string }
  | { type: "action chosen"; key: string }
  | { type: "composed"; key: string; values: Values; step: string }
  | { type: "aborted"; step: string }
  | { type: "amount"; fraction: number }
  | { type: "remedy"; settings: Values }
  | { type: "cleared" }
  | { type: "edit loaded"; index: number }
  /** What an order has asked for stands in the form again, `fraction` of it. */
  | { type: "order taken up"; id: string; fraction: number }
  | { type: "step back" }
  | { type: "step forward" }
  // What is computed of it.
  | { type: "preview"; preview: PreviewState }
  | { type: "forecast asked" }
  | { type: "forecast told"; answer: ForecastAnswer["order"] }
  | { type: "forecast failed"; reason: string }
  | { type: "forecast cleared" };
