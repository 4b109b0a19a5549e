/** The list of orders: what each asked for, and what became of it. */
import { element, write } from "../dom";
import { describeOrder } from "../form/form";
import { digits, seconds } from "../number";
import type { Json, OrderStatus } from "../connection/protocol";

/** The states that the server tells, and the two that only this viewer knows. */
export type OrderPhase = OrderStatus["status"] | "sent" | "lost";
export interface OrderRecord extends Omit<OrderStatus, "status"> { status: OrderPhase; text: string; sentAt: number | null }

const LONGEST_LIST = 200;
const PHASES: Record<OrderPhase, string> = {
  sent: "sent", accepted: "accepted", computing: "computing", applying: "applying", applied: "applied", rejected: "rejected", lost: "lost",
};

export class Orders {
  private readonly records = new Map<string, OrderRecord>();
  private readonly shown = new Map<string, { item: HTMLElement; chip: HTMLElement; title: HTMLElement; detail: HTMLElement; bar: HTMLElement; cancel: HTMLButtonElement }>();
  private readonly empty = element("p", { class: "hint" }, "No orders yet. Each change of the shape is listed here with what became of it.");
  private readonly list = element("ol", { class: "orders" });

  private mayCancel = false;

  constructor(root: HTMLElement, private readonly announce: (text: string) => void, private readonly cancel: (id: string) => void) {
    root.replaceChildren(this.empty, this.list);
    setInterval(() => this.tick(), 500);
  }

  all(): OrderRecord[] {
    return [...this.records.values()].map((record) => structuredClone(record));
  }

  /** An order of this viewer's own, just sent. */
  sent(id: string, order: Json): void {
    this.put({ id, status: "sent", text: describeOrder(order), sentAt: performance.now() });
  }

  update(status: OrderStatus): void {
    const known = this.records.get(status.id);
    const record: OrderRecord = { ...known, ...status, text: known?.text ?? (status.order === undefined ? `order ${status.id}` : describeOrder(status.order)), sentAt: known?.sentAt ?? null };
    this.put(record);
    if (record.not_followed && !known?.not_followed) this.announce(`Order ${record.text}: applied, not followed`);
    if (known?.status !== record.status && (record.status === "applied" || record.status === "rejected")) {
      this.announce(`Order ${record.text}: ${record.status}${record.reason ? `, ${record.reason}` : ""}`);
    }
  }

  /** A message of ours that the server could not take. */
  refused(id: string, reason: string): boolean {
    const record = this.records.get(id);
    if (!record) return false;
    this.put({ ...record, status: "rejected", reason });
    return true;
  }

  /** After a connection came back: what the server does not know of never reached it. */
  reconcile(statuses: readonly OrderStatus[], reconnected: boolean): void {
    for (const status of statuses) this.update(status);
    if (!reconnected) return;
    const known = new Set(statuses.map((status) => status.id));
    for (const record of this.records.values()) {
      if (record.status === "sent" && !known.has(record.id)) {
        this.put({ ...record, status: "lost", reason: "The connection ended before the simulation had the order. Nothing was changed." });
      }
    }
  }

  /** Whether this viewer may take orders back that have not begun. */
  allowCancelling(mayCancel: boolean): void {
    if (mayCancel === this.mayCancel) return;
    this.mayCancel = mayCancel;
    for (const record of this.records.values()) {
      const parts = this.shown.get(record.id);
      if (parts) parts.cancel.hidden = !this.isCancellable(record);
    }
  }

  private isCancellable(record: OrderRecord): boolean {
    return this.mayCancel && (record.status === "accepted" || record.status === "computing");
  }

  private put(record: OrderRecord): void {
    this.records.set(record.id, record);
    for (const id of this.records.keys()) {
      if (this.records.size <= LONGEST_LIST) break;
      this.records.delete(id);
      this.shown.get(id)?.item.remove();
      this.shown.delete(id);
    }
    this.empty.hidden = true;
    let parts = this.shown.get(record.id);
    if (!parts) {
      const chip = element("span", { class: "chip" });
      const title = element("span", { class: "title" });
      const detail = element("div", { class: "detail" });
      const bar = element("div", { class: "bar", hidden: true }, element("div"));
      const cancel = element("button", { type: "button", class: "cancel", hidden: true }, "Cancel");
      cancel.addEventListener("click", () => this.cancel(record.id));
      const item = element("li", { "data-order": record.id }, element("div", { class: "line" }, title, chip, cancel), bar, detail);
      this.list.prepend(item);
      parts = { item, chip, title, detail, bar, cancel };
      this.shown.set(record.id, parts);
    }
    parts.item.dataset.status = record.status;
    write(parts.title, record.text);
    write(parts.chip, phaseOf(record));
    write(parts.detail, detailOf(record));
    parts.cancel.hidden = !this.isCancellable(record);
    parts.bar.hidden = record.status !== "applying" && record.status !== "computing";
    parts.bar.classList.toggle("indefinite", record.status === "computing");
    const fraction = record.shapes ? (record.shape ?? 0) / record.shapes : 0;
    (parts.bar.firstElementChild as HTMLElement).style.width = record.status === "computing" ? "" : `${100 * fraction}%`;
  }

  private tick(): void {
    for (const record of this.records.values()) {
      const parts = this.shown.get(record.id);
      if (parts && ["sent", "accepted", "computing"].includes(record.status)) write(parts.detail, detailOf(record));
    }
  }
}

function phaseOf(record: OrderRecord): string {
  return (PHASES[record.status] ?? String(record.status)) + (record.not_followed ? ", not followed" : "");
}

function detailOf(record: OrderRecord): string {
  const waited = record.sentAt === null ? "" : ` · ${Math.round((performance.now() - record.sentAt) / 1000)} s`;
  switch (record.status) {
    case "sent": return `waiting for the simulation${waited}`;
    case "accepted": return `waiting for its turn${waited}`;
    case "computing": return `moving the mesh and checking every shape on the way${waited}`;
    case "applying": return `shape ${record.shape ?? "?"} of ${record.shapes ?? "?"}`;
    case "lost": return record.reason ?? "";
    case "rejected": return record.reason ?? "no reason was given";
    case "applied": {
      const parts = [`at cycle ${record.cycle_applied ?? "?"}`];
      const not = record.not_followed;
      if (not) parts.push(`not followed: the mesh was ${digits(not.distance, 3)} from shape ${not.shape} of cycle ${not.cycle}`);
      if (record.judged === "surface") parts.push("only the surface was judged");
      if (typeof record.min_scaled_jacobian === "number") parts.push(`quality ${digits(record.min_scaled_jacobian, 3)}`);
      const spent = record.seconds;
      if (spent) {
        const total = (spent.surface ?? 0) + (spent.volume ?? 0) + (spent.guard ?? 0);
        parts.push(`computed in ${seconds(total)}`);
      }
      if (record.added_steps && record.added_steps >= 0.05) parts.push(`cost ${digits(record.added_steps, 2)} steps`);
      return parts.join(" · ");
    }
  }
}
