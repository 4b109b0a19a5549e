/** The edits that the shape has, the orders that brought them, and what can be done with them: pure functions of the state. */
import type { Json } from "../connection/protocol";
import type { Values } from "../form/schema";
import { isObject, partsOf } from "./draft";
import { whyNotSteering } from "./run";
import type { OrderRecord, State } from "./state";
import { sameJson } from "./store";

/** The stack with the edit at `index` muted or heard again. */
export function toggleMute(stack: readonly Json[], index: number): Json[] {
  return stack.map((edit, i) => {
    const parts = i === index ? partsOf(edit) : null;
    if (!parts) return edit;
    const { muted, ...rest } = parts.body;
    return { [parts.key]: muted === true ? rest : { ...rest, muted: true } };
  });
}

/** The stack with another name for the edit at `index`; none where it is empty. */
export function rename(stack: readonly Json[], index: number, name: string): Json[] {
  return stack.map((edit, i) => {
    const parts = i === index ? partsOf(edit) : null;
    if (!parts) return edit;
    const { name: _, ...rest } = parts.body;
    const wanted = name.trim();
    return { [parts.key]: wanted === "" ? rest : { ...rest, name: wanted } };
  });
}

/** The stack with the edit at `from` at `to`. */
export function move(stack: readonly Json[], from: number, to: number): Json[] {
  const rest = stack.filter((_, i) => i !== from);
  return [...rest.slice(0, to), stack[from]!, ...rest.slice(to)];
}

export const remove = (stack: readonly Json[], index: number): Json[] => stack.filter((_, other) => other !== index);

export const isPending = ({ status }: OrderRecord): boolean => status === "sent" || status === "accepted" || status === "computing" || status === "applying";
export const isRefused = ({ status }: OrderRecord): boolean => status === "rejected" || status === "lost";

/** Whether an order can still be taken back before it moves the mesh. */
export const isCancellable = ({ status }: OrderRecord): boolean => status === "accepted" || status === "computing";

/** Why the edits of the stack cannot be changed now, in words; empty where they can. */
export function whyNotEditable(state: State): string {
  const why = whyNotSteering(state);
  if (why !== "") return why;
  // The new stack is made of the one that is known: an edit that is on its way is not in it. What a connection that has just come back
  // has to tell is not known yet.
  if (state.connection.fresh || state.hello?.isAwaitingEdits) return "The edits are being loaded.";
  return state.orders.some((order) => isPending(order) && order.status !== "applying") ? "An order is under way: wait for it, or cancel it." : "";
}

/** How many orders can be taken back. */
export function undoable(state: State): number {
  return state.hello?.undoable ?? state.hello?.stack.length ?? 0;
}

/** Whether there is a stack that an undo left and that could come back. */
export function isRedoable(state: State): boolean {
  const left = state.undone.at(-1);
  return left !== undefined && !sameJson(left, state.hello?.stack);
}

/** What an order sets beside its edits. What else it says, such as until when it may wait, was of its own time. */
const SETTINGS = ["schedule", "deform", "guard"] as const;

/**
 * An order as the form composes it: its edit, which edit of the stack that replaces, and what is set beside. `isBetween` is whether it asked
 * for a new edit before others: the form adds it behind them.
 */
export interface FormOrder { edit: Json; updating: number | null; isBetween: boolean; settings: Values }

/**
 * An order as the form composes it for the stack that there is now; null where it asks for something else, such as several edits or another
 * sequence. One that replaced an edit still does where others have been added behind.
 */
export function asFormOrder(order: Json | undefined, now: readonly Json[]): FormOrder | null {
  if (!isObject(order)) return null;
  const { edits, stack, undo } = order;
  const settings: Values = Object.fromEntries(SETTINGS.flatMap((name) => (order[name] === undefined ? [] : [[name, order[name]]])));
  if (undo !== undefined) return null;
  if (Array.isArray(edits) && stack === undefined) return edits.length === 1 ? { edit: edits[0]!, updating: null, isBetween: false, settings } : null;
  if (!Array.isArray(stack)) return null;
  if (stack.length === now.length + 1) {
    const added = stack.findIndex((edit, index) => !sameJson(edit, now[index]));
    const isAll = now.slice(added).every((edit, index) => sameJson(edit, stack[added + 1 + index]));
    return isAll ? { edit: stack[added]!, updating: null, isBetween: added < now.length, settings } : null;
  }
  const others = stack.flatMap((edit, index) => (sameJson(edit, now[index]) ? [] : [{ edit, index }]));
  const [other] = others;
  if (!other || others.length > 1) return null;
  const { edit, index } = other;
  // What was taken out of the stack, or stands elsewhere in it, is no edit that was changed.
  const isMoved = now.some((known) => sameJson(known, edit));
  return isMoved || partsOf(edit)?.key !== partsOf(now[index])?.key ? null : { edit, updating: index, isBetween: false, settings };
}

/** The order by which each edit of the stack came or was last changed; null where that is not known. */
export function provenance(orders: readonly OrderRecord[], stack: readonly Json[]): (OrderRecord | null)[] {
  type Known = { edit: Json; order: OrderRecord | null };
  const shapes: Known[][] = [[]];
  for (const order of orders) {
    if (order.status !== "applied" && order.status !== "applying") continue;
    const asked = isObject(order.order) ? order.order : {};
    const now = shapes.at(-1)!;
    if (Array.isArray(asked.edits)) shapes.push([...now, ...asked.edits.map((edit) => ({ edit, order }))]);
    else if (Array.isArray(asked.stack)) shapes.push(asked.stack.map((edit) => now.find((known) => sameJson(known.edit, edit)) ?? { edit, order }));
    else if (asked.undo !== undefined) for (let i = 0; i < Number(asked.undo ?? 1) && shapes.length > 1; i++) shapes.pop();
  }
  const known = shapes.at(-1)!;
  const isSame = known.length === stack.length && known.every(({ edit }, i) => partsOf(edit)?.key === partsOf(stack[i])?.key);
  return stack.map((_, i) => (isSame ? known[i]!.order : null));
}
