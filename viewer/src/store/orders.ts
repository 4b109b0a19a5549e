/** The orders that are known of: what each asked for, and what became of it. */
import type { Json, OrderStatus } from "../connection/protocol";
import { describeOrder } from "../form/describe";
import type { OrderRecord, State } from "./state";
import { derived } from "./store";

/** The most orders that are known of. */
export const ORDERS = 200;

function put(orders: readonly OrderRecord[], record: OrderRecord): readonly OrderRecord[] {
  const known = orders.some((other) => other.id === record.id);
  return (known ? orders.map((other) => (other.id === record.id ? record : other)) : [...orders, record]).slice(-ORDERS);
}

/** An order of this viewer's own, just sent. */
export function orderSent(orders: readonly OrderRecord[], id: string, order: Json, text: string, at: number): readonly OrderRecord[] {
  return put(orders, { id, status: "sent", text, order, sentAt: at });
}

/** What the simulation tells of an order. */
export function orderTold(orders: readonly OrderRecord[], status: OrderStatus): readonly OrderRecord[] {
  const known = orders.find((order) => order.id === status.id);
  const text = known?.text ?? (status.order === undefined ? `order ${status.id}` : describeOrder(status.order));
  return put(orders, { ...known, ...status, text, sentAt: known?.sentAt ?? null });
}

/** A message that the simulation could not take; the same orders where it was none of them. */
export function orderRefused(orders: readonly OrderRecord[], id: string | null, reason: string): readonly OrderRecord[] {
  return orders.some((order) => order.id === id) ? orders.map((order) => (order.id === id ? { ...order, status: "rejected" as const, reason } : order)) : orders;
}

/** All orders that the simulation knows of. After a connection came back, what it does not know of never reached it. */
export function ordersReconciled(orders: readonly OrderRecord[], statuses: readonly OrderStatus[], reconnected: boolean): readonly OrderRecord[] {
  const told = statuses.reduce(orderTold, orders);
  const known = new Set(statuses.map((status) => status.id));
  if (!reconnected || told.every((order) => order.status !== "sent" || known.has(order.id))) return told;
  const reason = "The connection ended before the simulation had the order. Nothing was changed.";
  return told.map((order) => (order.status === "sent" && !known.has(order.id) ? { ...order, status: "lost" as const, reason } : order));
}

/** How somebody took an order back: alone, or by another order in its place; `by` is the viewer that did, null where it was none. */
export interface Withdrawal { how: "cancelled" | "replaced"; by: string | null }

/** Only its reason tells an order that was taken back from one that was refused; null for any other. */
export function withdrawalOf({ status, reason }: OrderRecord): Withdrawal | null {
  const [, how, by] = (status === "rejected" ? /^(cancelled|replaced)(?: by order .+?)?(?: by (c\d+))?$/.exec(reason ?? "") : null) ?? [];
  return how === "cancelled" || how === "replaced" ? { how, by: by ?? null } : null;
}

/** The orders that were taken off the list of what was refused, and those that are taken off now. */
export function ordersDismissed(dismissed: readonly string[], ids: readonly string[]): readonly string[] {
  return [...dismissed.filter((id) => !ids.includes(id)), ...ids].slice(-ORDERS);
}

/** Whether the shape is on its way to another: an order is being computed or carried out. */
export const isShapeUnderWay = (orders: readonly OrderRecord[]): boolean => orders.some(({ status }) => status === "computing" || status === "applying");

/** An order that has changed the shape: when it began to, and what it asked for. */
export interface AppliedOrder { cycle: number; label: string }

let applied: readonly AppliedOrder[] = [];
/** The orders that have changed the shape: the same list as long as there is no other in it, so that it costs nothing to watch. */
export const appliedOrders: (state: Pick<State, "orders">) => readonly AppliedOrder[] = derived(({ orders }) => [orders], ({ orders }) => {
  const found = orders.flatMap(({ cycle_applied, text }) => (typeof cycle_applied === "number" ? [{ cycle: cycle_applied, label: text }] : []));
  const isSame = found.length === applied.length && found.every(({ cycle, label }, i) => cycle === applied[i]!.cycle && label === applied[i]!.label);
  return isSame ? applied : (applied = found);
});
