/** The next state, of the present one and what happened. */
import type { FieldInformation, Hello, Json } from "../connection/protocol";
import { describeOrder } from "../form/describe";
import { ROLES } from "../form/schema";
import type { Values } from "../form/schema";
import { own } from "../own";
import type { Action } from "./actions";
import { bodyOf, fieldsBefore, isObject, kindOf, openBoundaries, partsOf, scaled, wishedOrder, withoutShorthand } from "./draft";
import { asFormOrder } from "./edits";
import { TOO_LONG, canTakeUp, draftOf, saysSomething, whyNotFitting } from "./kept-draft";
import { ordersDismissed, orderRefused, orderSent, orderTold, ordersReconciled } from "./orders";
import { looksOf, withLook } from "./looks";
import { pipelinesAfter } from "./pipeline-drafts";
import { NO_FORECAST } from "./state";
import type { Composed, Draft, Frames, Part, SelectionState, State } from "./state";
import { sameJson } from "./store";

/** Steps of the form that can be taken back. */
const LONGEST_PAST = 100;
const LONGEST_UNDONE = 50;
const LONGEST_ERRORS = 50;
/** Enough to know the time of a picture that is half a minute old, at ten words a second. */
const LONGEST_PROGRESS = 300;
const LONGEST_GAPS = 20;
const LONGEST_CARRIED = 200;
/** Without a connection nobody is known to be there. */
const NOBODY: Pick<State, "people" | "followedBy" | "following"> = { people: [], followedBy: 0, following: false };

export function reduce(state: State, action: Action): State {
  const before = wishedOrder(state);
  const next = withKeptDraft(after(state, action));
  if (next.forecast === NO_FORECAST) return next;
  // What was told of one order says nothing of another, nor of the same one on another stack.
  const isSame = sameJson(wishedOrder(next), before) && sameJson(next.hello?.stack, state.hello?.stack);
  return isSame ? next : { ...next, forecast: NO_FORECAST };
}

function after(state: State, action: Action): State {
  switch (action.type) {
    case "connection": {
      const connected = action.state === "connected";
      return {
        ...state, ...(connected ? {} : NOBODY), askedBy: connected ? state.askedBy : null, coarser: connected ? {} : state.coarser,
        connection: { ...state.connection, state: action.state, explanation: action.explanation, fresh: connected },
        pipelines: pipelinesAfter(state.pipelines, action),
      };
    }
    case "hello": return withHello(state, action.hello);
    case "parameters": return withParameters(state, action.values);
    case "stack": return withStack(state, action.edits, action.undoable);
    case "stack awaited": return state.hello ? { ...state, hello: { ...state.hello, isAwaitingEdits: true, undoable: action.undoable } } : state;
    case "precision": return { ...state, coarser: { ...state.coarser, [action.view]: action.coarser } };
    case "status": {
      const { status, at } = action;
      const isSame = state.progress.at(-1)?.cycle === status.cycle;
      return { ...state, status, progress: isSame ? state.progress : [...state.progress, { cycle: status.cycle, at }].slice(-LONGEST_PROGRESS) };
    }
    case "frame": return { ...state, frames: withFrame(state.frames, action.view, action.cycle) };
    case "carries": return withCarried(state, action.view, action.fields);
    case "order": {
      // What another orders leaves nothing that an undo of ours could bring back.
      const isOurs = state.orders.some((order) => order.id === action.status.id);
      return { ...state, orders: orderTold(state.orders, action.status), undone: isOurs ? state.undone : [] };
    }
    case "order dismissed": return { ...state, dismissed: ordersDismissed(state.dismissed, [action.id]) };
    case "played": return { ...state, played: action.played };
    case "end": return { ...state, ...NOBODY, end: action.end, askedBy: null };
    case "wheel asked": return { ...state, askedBy: action.by };
    case "people": {
      const isThere = action.viewers.some(({ client }) => client === state.askedBy);
      return { ...state, people: action.viewers, askedBy: isThere ? state.askedBy : null };
    }
    case "followed": return { ...state, followedBy: action.by };
    case "following": return { ...state, following: action.on };
    case "note pinned": return { ...state, notes: [...state.notes.filter(({ number }) => number !== action.note.number), action.note] };
    case "note removed": return { ...state, notes: state.notes.filter(({ number }) => number !== action.number) };
    case "pipelines known": case "pipelines outcome": case "pipelines refused": case "pipelines asked":
    case "pipeline opened": case "pipeline written": case "pipeline checked": case "pipeline left": case "pipeline discarded":
      return { ...state, pipelines: pipelinesAfter(state.pipelines, action) };
    case "note sought": return { ...state, soughtNote: action.note };
    case "wheel answered": return { ...state, askedBy: null };
    case "refused": {
      const orders = orderRefused(state.orders, action.id, action.text);
      return orders === state.orders ? { ...state, refusal: action.text } : { ...state, orders };
    }
    case "picture lost": return { ...state, isPictureLost: action.isLost };
    case "unreadable": return { ...state, errors: [...state.errors, action.text].slice(-LONGEST_ERRORS) };
    case "schema": return withSchema(state, action.form, action.settings);
    case "order sent": return withOrderSent(state, action.id, action.order, action.at);
    case "look": {
      const views = action.view === null ? (state.hello?.views ?? []).map(({ name }) => name) : [action.view];
      return { ...state, looks: withLook(state.looks, views, action.look) };
    }
    case "remembered": {
      const isThere = state.hello?.views.some(({ name }) => name === action.chosenView);
      return { ...state, keptDraft: action.draft, dismissed: ordersDismissed(state.dismissed, action.dismissed), chosenView: isThere ? action.chosenView : state.chosenView };
    }
    case "view chosen": return { ...state, chosenView: action.view };
    case "part": {
      const parts = withPart(state.selection.parts, action.feature, action.part);
      return parts === state.selection.parts ? state : { ...state, selection: { ...state.selection, parts } };
    }
    case "hover": return action.feature === state.selection.hovered ? state : { ...state, selection: { ...state.selection, hovered: action.feature } };
    case "form read": {
      const { key, body, settings, problems, step } = action;
      const draft = { ...state.draft, key, settings, problems, bodies: { ...state.draft.bodies, [key]: body } };
      return sameJson(draft, state.draft) ? state : stepped({ ...state, refusal: "" }, { ...draft, amount: null }, step);
    }
    case "action chosen": return stepped(state, { ...state.draft, key: action.key, problems: [], amount: null }, `action ${action.key}`);
    case "composed": {
      const kind = kindOf(state, action.key);
      if (!kind) return state;
      const body = { ...kind.neutral, ...state.draft.bodies[action.key], ...action.values };
      const draft = { ...state.draft, key: action.key, bodies: { ...state.draft.bodies, [action.key]: body }, problems: [], amount: null };
      return stepped({ ...state, refusal: "" }, draft, action.step);
    }
    case "aborted": return state.draft.step === action.step ? steppedBack(state, false) : state;
    case "amount": return withAmount(state, action.fraction);
    case "remedy": return { ...state, draft: { ...state.draft, remedy: action.settings } };
    case "cleared": return cleared(state);
    case "edit loaded": return withEditLoaded(state, action.index);
    case "order taken up": return withOrderTakenUp(state, action.id, action.fraction);
    case "step back": return steppedBack(state, true);
    case "step forward": return steppedForward(state);
    case "preview": return { ...state, preview: action.preview };
    case "forecast asked": return { ...state, forecast: { ...NO_FORECAST, state: "waiting" } };
    case "forecast told": return { ...state, forecast: { state: "told", answer: action.answer, reason: action.answer.reason ?? null } };
    case "forecast failed": return { ...state, forecast: { state: "failed", answer: null, reason: action.reason } };
    case "forecast cleared": return state.forecast.state === "none" ? state : { ...state, forecast: NO_FORECAST };
  }
}

function withFrame({ count, views: known }: Frames, view: string, cycle: number): Frames {
  const before = own(known, view);
  // A view that goes back does so with all others: what these have shown is of the future.
  const views = before && cycle < before.cycle ? {} : known;
  const gap = before && cycle > before.cycle ? cycle - before.cycle : null;
  const gaps = gap === null ? before?.gaps ?? [] : [...before!.gaps, gap].slice(-LONGEST_GAPS);
  const next = { ...views, [view]: { cycle, gaps } };
  return { count: count + 1, cycle: Math.max(...Object.values(next).map((shown) => shown.cycle)), views: next };
}

function withHello(state: State, hello: Hello): State {
  const names = new Set(hello.features.map((feature) => feature.name));
  const before = new Set(state.hello?.features.map((feature) => feature.name));
  const known = Object.fromEntries(Object.entries(state.selection.parts).filter(([name]) => names.has(name)));
  // What flows in and out stays where it is, unless somebody wants otherwise.
  const open = openBoundaries({ hello }).filter((name) => !before.has(name) && !Object.hasOwn(known, name));
  const parts: State["selection"]["parts"] = { ...known, ...Object.fromEntries(open.map((name) => [name, "fixed" as const])) };
  const { hovered } = state.selection;
  const next: State = {
    ...state, hello, ...viewsOf(state, hello),
    connection: { ...state.connection, known: true, fresh: false },
    selection: { parts: sameJson(parts, state.selection.parts) ? state.selection.parts : parts, hovered: hovered !== null && names.has(hovered) ? hovered : null },
    // Each hello of a recording has all orders of its moment: what is known beside them is of another one.
    orders: hello.recording ? ordersReconciled([], hello.orders, false) : ordersReconciled(state.orders, hello.orders, state.connection.fresh && state.connection.known),
    askedBy: hello.role === "driver" ? state.askedBy : null,
    following: hello.role !== "driver" && state.following,
    followedBy: hello.role === "driver" ? state.followedBy : 0,
    ...notesOf(state, hello),
    // Whoever has the wheel now need not know that it was refused before.
    refusal: hello.role !== state.hello?.role ? "" : state.refusal,
  };
  return withoutLostEdit(state, next);
}

/** The notes that a hello tells. One that was looked for is of the cycle that was seen then; it was written down later, and is not told there yet. */
function notesOf({ notes: known, soughtNote }: State, { notes, recording }: Hello): Pick<State, "notes" | "soughtNote"> {
  if (!notes) return { notes: known, soughtNote };
  const isUntold = recording && soughtNote && !notes.some(({ number }) => number === soughtNote.number);
  return isUntold ? { notes: [...notes, soughtNote], soughtNote } : { notes, soughtNote: null };
}

function withParameters(state: State, values: Readonly<Record<string, number>>): State {
  if (!state.hello) return state;
  const parameters = state.hello.parameters.map((parameter) => ({ ...parameter, value: own(values, parameter.name) ?? parameter.value }));
  return { ...state, hello: { ...state.hello, parameters } };
}

function withStack(state: State, edits: Json[], undoable: number | undefined): State {
  return state.hello ? withoutLostEdit(state, { ...state, hello: { ...state.hello, stack: edits, isAwaitingEdits: false, undoable } }) : state;
}

/** The next state, in which an edit that is not there any more is not changed any more, nor by a step back or forward. */
function withoutLostEdit(state: State, next: State): State {
  const isThere = ({ updating }: Pick<Draft, "updating">): boolean => updating === null || sameJson(next.hello?.stack[updating], state.hello?.stack[updating]);
  if (!isThere(state.draft)) return cleared(next);
  const { past, future } = next.draft;
  return [...past, ...future].every(isThere) ? next : { ...next, draft: { ...next.draft, past: past.filter(isThere), future: future.filter(isThere) } };
}

function viewsOf(state: State, { views, fields }: Hello): Pick<State, "looks" | "chosenView"> {
  const looks = looksOf(views, fields, state.looks, state.carried);
  const isColoured = (name: string): boolean => own(looks, name)?.field != null;
  const known = views.some(({ name }) => name === state.chosenView);
  // Before there were fields no view was worth more than another.
  const isFirstChoice = fields.length > 0 && state.hello?.fields.length === 0 && !isColoured(state.chosenView ?? "");
  const coloured = views.find(({ name }) => isColoured(name)) ?? views[0];
  return { looks: sameJson(looks, state.looks) ? state.looks : looks, chosenView: known && !isFirstChoice ? state.chosenView : coloured?.name ?? null };
}

function withCarried(state: State, view: string, fields: readonly FieldInformation[]): State {
  // A view whose pipeline is gone may come back; not as many as there may be in a long run.
  const others = Object.entries(state.carried).filter(([name]) => name !== view).slice(-LONGEST_CARRIED);
  const next = { ...state, carried: { ...Object.fromEntries(others), [view]: fields } };
  return next.hello ? { ...next, ...viewsOf(next, next.hello) } : next;
}

function withSchema(state: State, form: State["form"], settings: Values): State {
  if (!form) return { ...state, form };
  const bodies = Object.fromEntries(form.edits.map((edit) => [edit.key, state.draft.bodies[edit.key] ?? edit.neutral]));
  const known = form.edits.some((edit) => edit.key === state.draft.key);
  const key = known ? state.draft.key : form.edits.find((edit) => edit.key === "scale_direction")?.key ?? form.edits[0]?.key ?? null;
  return { ...state, form, draft: { ...state.draft, key, bodies, settings: known ? state.draft.settings : settings } };
}

function withOrderSent(state: State, id: string, order: Json, at: number): State {
  const undoes = isObject(order) && order.undo !== undefined;
  const stack = state.hello?.stack ?? [];
  const redoes = isObject(order) && sameJson(order.stack, state.undone.at(-1));
  return {
    ...state, refusal: "", orders: orderSent(state.orders, id, order, describeOrder(order, state.form), at),
    undone: undoes ? [...state.undone, stack].slice(-LONGEST_UNDONE) : redoes ? state.undone.slice(0, -1) : [],
  };
}

function withPart(parts: State["selection"]["parts"], feature: string, part: Part | null): State["selection"]["parts"] {
  if ((own(parts, feature) ?? null) === part) return parts;
  const { [feature]: _, ...rest } = parts;
  return part === null ? rest : { ...rest, [feature]: part };
}

function composed({ draft: { key, bodies, settings, remedy, updating, partsBefore }, selection: { parts } }: State): Composed {
  return { key, bodies, settings, remedy, parts, updating, partsBefore };
}

/** The state with another draft, as a step that can be taken back; all of one step together. */
function stepped(state: State, draft: Draft, step: string): State {
  const past = state.draft.step === step ? state.draft.past : [...state.draft.past, composed(state)].slice(-LONGEST_PAST);
  return { ...state, draft: { ...draft, step, past, future: [] } };
}

function brought(state: State, to: Composed, past: readonly Composed[], future: readonly Composed[]): State {
  const { parts, ...held } = to;
  const draft = { ...state.draft, ...held, problems: [], amount: null, step: null, past, future };
  return { ...state, draft, selection: { ...state.selection, parts } };
}

function steppedBack(state: State, canReturn: boolean): State {
  const { past, future } = state.draft;
  const to = past.at(-1);
  return to ? brought(state, to, past.slice(0, -1), canReturn ? [...future, composed(state)] : future) : state;
}

function steppedForward(state: State): State {
  const { past, future } = state.draft;
  const to = future.at(-1);
  return to ? brought(state, to, [...past, composed(state)], future.slice(0, -1)) : state;
}

/** The form asks for nothing; a handle stays chosen, so that it can be worked on. What was loaded takes its own with it: what flows in and out is held again. */
function cleared(state: State): State {
  const bodies = Object.fromEntries((state.form?.edits ?? []).map((edit) => [edit.key, edit.neutral]));
  const draft = { ...state.draft, bodies, remedy: {}, problems: [], updating: null, partsBefore: null, amount: null, step: null, past: [], future: [] };
  const selection = { ...state.selection, parts: state.draft.partsBefore ?? state.selection.parts };
  return { ...state, refusal: "", draft, selection, forecast: NO_FORECAST };
}

/** What the form is to hold of an edit; null where it has no form for it. */
function inForm(state: State, edit: Json | undefined): { key: string; body: Values; parts: SelectionState["parts"] } | null {
  const loaded = partsOf(edit);
  const kind = kindOf(state, loaded?.key ?? null);
  if (!loaded || !kind) return null;
  const fields = Object.fromEntries(Object.entries(withoutShorthand(kind, loaded.body)).filter(([name, value]) => ROLES[name] === undefined && value !== null));
  const parts = new Map<string, Part>();
  for (const [name, part] of Object.entries(ROLES)) {
    const names = loaded.body[name];
    if (Array.isArray(names)) for (const feature of names) if (typeof feature === "string" && !parts.has(feature)) parts.set(feature, part);
  }
  return { key: kind.key, body: { ...kind.neutral, ...fields }, parts: Object.fromEntries(parts) };
}

/** The state with something in the form that is no more of what stood there, as a step that can be taken back. */
function withLoaded(state: State, { key, body, parts }: NonNullable<ReturnType<typeof inForm>>, more: Partial<Draft>, step: string): State {
  const { draft } = cleared(state);
  const { past, step: before, partsBefore } = state.draft;
  const next = { ...draft, key, bodies: { ...draft.bodies, [key]: body }, ...more, partsBefore: partsBefore ?? state.selection.parts, past, step: before };
  return { ...stepped({ ...state, refusal: "" }, next, step), selection: { ...state.selection, parts } };
}

/** An edit of the stack in the form, to be changed. */
function withEditLoaded(state: State, index: number): State {
  const held = inForm(state, state.hello?.stack[index]);
  return held ? withLoaded(state, held, { updating: index }, `load ${index}`) : state;
}

/** What an order has asked for in the form again, as a step that can be taken back. */
function withOrderTakenUp(state: State, id: string, fraction: number): State {
  const order = asFormOrder(state.orders.find((known) => known.id === id)?.order, state.hello?.stack ?? []);
  const held = order && inForm(state, order.edit);
  if (!held) return state;
  const { guard, ...settings } = order.settings;
  // The guard that is set in the form stays for the orders that follow; another one was for this edit alone.
  const { guard: guardOfForm } = state.draft.settings;
  const taken = withLoaded(state, held, {
    updating: order.updating, settings: guardOfForm === undefined ? settings : { ...settings, guard: guardOfForm },
    remedy: guard === undefined || sameJson(guard, guardOfForm) ? {} : { guard },
  }, `order ${id}`);
  return fraction < 1 ? withAmount(taken, fraction) : taken;
}

/** What was kept of the form, once it can be taken up; what has been composed meanwhile counts more. */
function withKeptDraft(state: State): State {
  const kept = state.keptDraft;
  if (!kept || !canTakeUp(state)) return state;
  const without = { ...state, keptDraft: null };
  const gone = (why: string): State => ({ ...without, refusal: `What stood in the form before the page was loaded again is gone: ${why}.` });
  if (saysSomething(state)) return without;
  if (kept === TOO_LONG) return gone("it was too long to be kept");
  if (kept.key !== null && kindOf(state, kept.key) === null) return without;
  const why = whyNotFitting(state, kept);
  const draft = draftOf(without, kept);
  const next = { ...without, draft, selection: { ...state.selection, parts: kept.parts } };
  if (!saysSomething(next)) return why === "" ? next : without;
  if (why !== "") return gone(why);
  return { ...stepped(without, draft, "kept"), selection: next.selection };
}

function withAmount(state: State, fraction: number): State {
  const kind = kindOf(state, state.draft.key);
  if (!kind) return state;
  const whole = state.draft.amount?.whole ?? bodyOf(state.draft);
  const draft = { ...state.draft, bodies: { ...state.draft.bodies, [kind.key]: scaled(kind.field, whole, fraction, fieldsBefore(state)) } };
  return stepped(state, { ...draft, amount: { whole, fraction } }, "amount");
}
