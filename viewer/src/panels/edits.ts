/**
 * The list of what was done to the shape: its edits, what is on its way, and what was refused. A click on an edit loads it into
 * the form; every change here is an order of the whole new stack.
 */
import type { Json } from "../connection/protocol";
import { arrange, element, part, textField, write } from "../dom";
import { isMuted, titleOf } from "../form/describe";
import { digits, seconds } from "../number";
import type { Action } from "../store/actions";
import type { Commands } from "../store/commands";
import { kindOf, partsOf } from "../store/draft";
import { asFormOrder, isCancellable, isPending, isRedoable, isRefused, move, provenance, remove, rename, toggleMute, undoable, whyNotEditable } from "../store/edits";
import { withdrawalOf } from "../store/orders";
import type { Withdrawal } from "../store/orders";
import { nameOf, whyNotSteering } from "../store/run";
import type { OrderPhase, OrderRecord, State } from "../store/state";
import { sameJson, sameParts } from "../store/store";
import type { Store } from "../store/store";
import { floored, passingPart, percent } from "../store/verdict";

const REFUSED_SHOWN = 3;
const PHASES: Record<OrderPhase | Withdrawal["how"], string> = {
  sent: "sent", accepted: "waiting", computing: "computing", applying: "applying", applied: "applied", rejected: "refused", lost: "lost",
  cancelled: "cancelled", replaced: "replaced",
};

/** A row of a list, what it is of, and what writes into it all that changes while it is of the same. */
interface Row { of: readonly unknown[]; node: HTMLElement; show(order: OrderRecord | null): void }
type Rows = ReadonlyMap<string, Row>;
interface WantedRow { key: string; of: readonly unknown[]; order: OrderRecord | null; make(): Omit<Row, "of"> }

export class EditsPanel {
  private readonly list = part("stack");
  private readonly pending = part("pending");
  private readonly history = part("orders");
  /** The row that is being dragged, the one that it would be put to, and what ends the drag. */
  private drag: { from: number; over: number | null; end: (to: number | null) => void } | null = null;
  /** The edit that was moved last, from where and to where: the focus goes with it. */
  private moved: { edit: Json; from: number; to: number } | null = null;
  /** The edit whose name is being typed. */
  private renaming: number | null = null;
  private announced = new Map<string, OrderPhase>();
  private readonly rows: { list: Rows; pending: Rows; history: Rows } = { list: new Map(), pending: new Map(), history: new Map() };

  constructor(private readonly store: Store<State, Action>, private readonly commands: Commands) {
    const seen = (state: State): unknown => [state.hello?.stack, state.orders, state.dismissed, state.draft.updating, whyNotEditable(state), state.form, state.people];
    store.watch(seen, () => this.show(), (a, b) => (a as unknown[]).every((value, i) => Object.is(value, (b as unknown[])[i])));
    store.watch((state) => state.orders, (orders) => this.announce(orders));
    store.watch(undoState, (now) => this.showUndo(now), sameJson);
    part("undo").addEventListener("click", () => this.commands.undo());
    part("redo").addEventListener("click", () => this.commands.redo());
    // How long an order has been waited for.
    setInterval(() => this.tick(), 500);
  }

  private get stack(): readonly Json[] {
    return this.store.state.hello?.stack ?? [];
  }

  private show(): void {
    // A row that is not there as it was is dragged no more.
    if (this.drag && whyNotEditable(this.store.state) !== "") this.drag.end(null);
    const focus = this.focused();
    const { state } = this.store;
    const by = provenance(state.orders, this.stack);
    // While a name is being typed the list stays: a field that is taken away would end the typing half-way.
    const isTyping = this.renaming !== null && this.list.contains(textField(document.activeElement));
    if (!isTyping) {
      this.rows.list = put(this.list, this.rows.list, this.stack.map((edit, i) => {
        const title = titleOf(edit, state.form);
        return { key: String(i), of: [edit, title, this.renaming === i], order: by[i] ?? null, make: () => this.row(edit, i, title) };
      }), (now, before) => now.every((part, k) => sameJson(part, before[k])));
    }
    this.markDrag();
    part("stack-empty").hidden = this.stack.length > 0 || state.orders.some(isPending);
    this.rows.pending = put(this.pending, this.rows.pending, [
      ...state.orders.filter(isPending).map((order) => ({ key: order.id, of: ["pending"], order, make: () => this.pendingRow(order) })),
      ...state.orders.filter((order) => isRefused(order) && !state.dismissed.includes(order.id)).slice(-REFUSED_SHOWN)
        .map((order) => ({ key: order.id, of: ["refused", order, this.stack, state.form, state.people], order, make: () => unchanging(this.refusedRow(order)) })),
    ]);
    part("history").hidden = state.orders.length === 0;
    write(part("history-title"), `Everything that happened (${state.orders.length})`);
    this.rows.history = put(this.history, this.rows.history, [...state.orders].reverse()
      .map((order) => ({ key: order.id, of: [order, state.people], order, make: () => unchanging(historyRow(order, state)) })));
    if (focus && !isTyping) (focus() ?? part("undo")).focus();
  }

  /** Where the focus is in the lists, so that it can be put there again once they are made anew; null where it is elsewhere. */
  private focused(): (() => HTMLElement | null) | null {
    const active = document.activeElement as HTMLElement | null;
    if (!active) return null;
    return this.list.contains(active) ? this.focusedEdit(active) : this.pending.contains(active) ? this.focusedOrder(active) : null;
  }

  /** The same button of the same order, or another of its own; the same of the row that has taken its place where it is gone. */
  private focusedOrder(active: HTMLElement): (() => HTMLElement | null) | null {
    const row = active.closest<HTMLElement>("[data-order]");
    if (!row) return null;
    const at = [...this.pending.children].indexOf(row);
    const wanted = `[data-act="${active.dataset.act ?? ""}"]`;
    return () => {
      const rows = [...this.pending.children] as HTMLElement[];
      const same = rows.find(({ dataset }) => dataset.order === row.dataset.order);
      const near = same ?? rows[Math.min(at, rows.length - 1)];
      return near?.querySelector<HTMLElement>(wanted) ?? same?.querySelector("button") ?? null;
    };
  }

  private focusedEdit(active: HTMLElement): (() => HTMLElement | null) | null {
    const row = active.closest<HTMLElement>("[data-edit]");
    if (!row) return null;
    const act = active.dataset.act ?? "load";
    const { moved } = this;
    const index = moved?.from === Number(row.dataset.edit) && sameJson(this.stack[moved.to], moved.edit) ? moved.to : Number(row.dataset.edit);
    if (index === moved?.to) this.moved = null;
    const last = Math.max(0, Math.min(index, this.stack.length - 1));
    const find = (at: number): HTMLElement | null => this.list.querySelector<HTMLElement>(`[data-edit="${at}"] [data-act="${act}"]`);
    return () => find(index) ?? find(last);
  }

  private row(edit: Json, index: number, title: string): Omit<Row, "of"> {
    const muted = isMuted(edit);
    const button = (name: string, kind: string, label: string, spoken: string, sign: string): HTMLElement =>
      element("button", { type: "button", class: kind, "data-act": name, "data-label": label, "aria-label": `${spoken}: ${title}` }, sign);
    const act = (name: string, sign: string, label: string, act: () => void): HTMLElement => {
      const made = button(name, "icon", label, label, sign);
      made.addEventListener("click", () => { if (whyNotEditable(this.store.state) === "") act(); });
      return made;
    };
    const detail = element("span", { class: "detail" });
    const text = this.renaming === index ? this.nameInput(edit, index) : element("button", {
      type: "button", class: "load", "data-act": "load", title: "Load its values into the form, to change it",
      onclick: () => this.store.dispatch({ type: "edit loaded", index }),
      onkeydown: (event) => this.key(event as KeyboardEvent, index),
    }, element("span", { class: "title" }, title), detail);
    const grip = button("move", "grip", "Drag to reorder; with the focus on the row, Alt with the arrow keys does the same", "Move", "⠿");
    grip.tabIndex = -1;
    grip.addEventListener("pointerdown", (event) => this.take(event, index));
    grip.addEventListener("keydown", (event) => this.key(event, index));
    const changing = [
      grip, act("mute", muted ? "○" : "●", muted ? "Unmute" : "Mute", () => this.commands.setStack(toggleMute(this.stack, index))),
      act("rename", "✎", "Rename", () => {
        this.renaming = index;
        this.show();
        const input = this.list.querySelector<HTMLInputElement>("input");
        input?.focus();
        input?.select();
      }),
      act("remove", "×", "Delete", () => this.commands.setStack(remove(this.stack, index))),
    ];
    const node = element("li", { "data-edit": index, "data-muted": String(muted) },
      grip, element("span", { class: "number", "aria-hidden": "true" }, String(index + 1)), text, ...changing.slice(1));
    return {
      node, show: (order) => {
        const { state } = this.store;
        const why = whyNotEditable(state);
        const isUpdating = String(state.draft.updating === index);
        for (const button of changing) {
          button.title = why || button.dataset.label!;
          button.setAttribute("aria-disabled", String(why !== ""));
        }
        if (text.tagName === "BUTTON") text.setAttribute("aria-pressed", isUpdating);
        node.dataset.updating = isUpdating;
        node.dataset.status = order?.not_followed ? "rejected" : "applied";
        write(detail, muted ? "muted" : order ? outcomeOf(order) : "");
      },
    };
  }

  private nameInput(edit: Json, index: number): HTMLElement {
    const before = partsName(edit);
    let isOver = false;
    const end = (name: string | null): void => {
      if (isOver) return;
      isOver = true;
      this.renaming = null;
      if (name !== null && name.trim() !== before) this.rename(edit, index, name);
      this.show();
      this.list.querySelector<HTMLElement>(`[data-edit="${index}"] [data-act="rename"]`)?.focus();
    };
    const input = element("input", {
      type: "text", class: "name", value: before, maxlength: 80, "data-act": "load", "aria-label": "name of the edit", placeholder: titleOf(edit),
      onkeydown: (event) => {
        const { key } = event as KeyboardEvent;
        if (key === "Enter" || key === "Escape") {
          event.preventDefault();
          event.stopPropagation();
          end(key === "Enter" ? input.value : null);
        }
      },
      onblur: () => end(input.value),
    });
    return input;
  }

  /** Gives an edit a name, if it still is the one in this place and the stack may be changed. */
  private rename(edit: Json, index: number, name: string): void {
    const why = whyNotEditable(this.store.state) || (sameJson(this.stack[index], edit) ? "" : "The edits have changed meanwhile.");
    if (why === "") this.commands.setStack(rename(this.stack, index, name));
    else this.store.dispatch({ type: "refused", id: null, text: `The edit was not renamed. ${why}` });
  }

  private key(event: KeyboardEvent, index: number): void {
    const isMeant = event.altKey || (event.currentTarget as HTMLElement).dataset.act === "move";
    const to = isMeant && event.key === "ArrowUp" ? index - 1 : isMeant && event.key === "ArrowDown" ? index + 1 : null;
    if (to === null) return;
    event.preventDefault();
    this.reorder(index, to);
  }

  private reorder(from: number, to: number): void {
    if (from === to || to < 0 || to >= this.stack.length || whyNotEditable(this.store.state) !== "") return;
    this.moved = { edit: this.stack[from]!, from, to };
    this.commands.setStack(move(this.stack, from, to));
  }

  /** Begins to drag a row by its grip: with a mouse, a finger or a pen alike. */
  private take(event: PointerEvent, from: number): void {
    if (event.button !== 0 || this.drag || whyNotEditable(this.store.state) !== "") return;
    // So that no text is marked on the way; and the focus goes with the row.
    event.preventDefault();
    (event.currentTarget as HTMLElement).focus();
    const { pointerId } = event;
    // What changes meanwhile makes the rows anew: it is the page that follows the pointer.
    const heard = new AbortController();
    const { signal } = heard;
    const end = (to: number | null): void => {
      heard.abort();
      this.drag = null;
      this.markDrag();
      if (to !== null) this.reorder(from, to);
    };
    this.drag = { from, over: null, end };
    window.addEventListener("pointermove", (moved) => {
      if (moved.pointerId !== pointerId || !this.drag) return;
      const row = document.elementFromPoint(moved.clientX, moved.clientY)?.closest<HTMLElement>("#stack [data-edit]");
      this.drag.over = row ? Number(row.dataset.edit) : null;
      this.markDrag();
    }, { signal });
    window.addEventListener("pointerup", (up) => { if (up.pointerId === pointerId) end(this.drag?.over ?? null); }, { signal });
    window.addEventListener("pointercancel", (gone) => { if (gone.pointerId === pointerId) end(null); }, { signal });
    window.addEventListener("keydown", (key) => {
      if (key.key !== "Escape") return;
      key.preventDefault();
      key.stopPropagation();
      end(null);
    }, { signal, capture: true });
    this.markDrag();
  }

  private markDrag(): void {
    for (const row of this.list.querySelectorAll<HTMLElement>("[data-edit]")) {
      const index = Number(row.dataset.edit);
      row.classList.toggle("dragged", index === this.drag?.from);
      row.classList.toggle("over", index === this.drag?.over && index !== this.drag.from);
    }
  }

  private pendingRow({ id }: OrderRecord): Omit<Row, "of"> {
    const [title, chip, detail, done] = [element("span", { class: "title" }), element("span", { class: "chip" }), element("div", { class: "detail" }), element("div")];
    const [line, bar] = [element("div", { class: "line" }, title, chip), element("div", {}, done)];
    const cancel = element("button", { type: "button", class: "cancel", "data-act": "cancel", onclick: () => this.commands.cancel(id) }, "Cancel");
    const node = element("li", { "data-order": id }, line, bar, detail);
    return {
      node, show: (order) => {
        if (!order) return;
        const isApplying = order.status === "applying";
        node.dataset.status = order.status;
        write(title, order.text);
        write(chip, phaseOf(order));
        arrange(line, whyNotSteering(this.store.state) === "" && isCancellable(order) ? [title, chip, cancel] : [title, chip]);
        bar.className = isApplying ? "bar" : "bar indefinite";
        done.style.width = isApplying ? `${order.shapes ? (100 * (order.shape ?? 0)) / order.shapes : 0}%` : "";
        write(detail, detailOf(order, this.store.state));
      },
    };
  }

  private refusedRow(order: OrderRecord): HTMLElement {
    return element("li", { "data-order": order.id, "data-status": outcomeStatus(order) },
      element("div", { class: "line" }, element("span", { class: "title" }, order.text), element("span", { class: "chip" }, phaseOf(order)),
        element("button", { type: "button", class: "icon", "data-act": "dismiss", title: "Take it off the list", "aria-label": `Dismiss: ${order.text}`, onclick: () => this.store.dispatch({ type: "order dismissed", id: order.id }) }, "×")),
      element("div", { class: "detail" }, detailOf(order, this.store.state)), element("div", { class: "ways" }, ...this.waysBack(order)));
  }

  /** The ways from a refused order back into the form, where the form can hold it: as it was, or as much of it as would pass. */
  private waysBack(order: OrderRecord): HTMLElement[] {
    const { state } = this.store;
    const asked = asFormOrder(order.order, this.stack);
    if (!asked || kindOf(state, partsOf(asked.edit)?.key ?? null) === null) return [];
    const way = (act: string, text: string, title: string, fraction: number, focus: string): HTMLElement => element("button", {
      type: "button", class: "small", "data-act": act, title, "aria-label": `${text}: ${order.text}`, onclick: () => {
        this.store.dispatch({ type: "order taken up", id: order.id, fraction });
        part(focus).focus();
      },
    }, text);
    const loads = asked.isBetween ? "Loads the edit that it would have added into the form, to change it; it then comes behind the others" : "Loads what it asked for into the form, to change it";
    const again = way("again", "Edit again", loads, 1, "foot");
    // What would pass was found for the place that the edit had among the others.
    const passing = order.status === "rejected" && !asked.isBetween ? passingPart(order.fraction) : null;
    if (passing === null) return [again];
    return [way("part", `Apply ${percent(passing)}`, "Loads it into the form with as much of the amount as would pass", floored(passing), "apply"), again];
  }

  private showUndo({ undo, redo, why, composing }: ReturnType<typeof undoState>): void {
    const [undoButton, redoButton] = [part("undo"), part("redo")] as [HTMLButtonElement, HTMLButtonElement];
    undoButton.disabled = why !== "" || !undo;
    redoButton.disabled = why !== "" || !redo;
    undoButton.title = why || (undo ? "Take the last order back; the earlier shape returns exactly (Ctrl+Z)" : "There is nothing to take back.");
    redoButton.title = why || (redo ? "Bring back what the last undo took away (Ctrl+Shift+Z)" : "There is nothing to bring back.");
    if (composing && undo) undoButton.title += ". Ctrl+Z first takes back what stands in the form.";
  }

  private tick(): void {
    for (const order of this.store.state.orders) {
      if (!isPending(order) || order.status === "applying") continue;
      const shown = [...this.pending.children].find((row) => (row as HTMLElement).dataset.order === order.id)?.querySelector(".detail");
      if (shown) write(shown, detailOf(order, this.store.state));
    }
  }

  private announce(orders: readonly OrderRecord[]): void {
    for (const order of orders) {
      const { id, status, text, reason } = order;
      if (this.announced.get(id) === status) continue;
      const isNew = this.announced.size > 0 || status === "sent";
      this.announced.set(id, status);
      if (isNew && (status === "applied" || status === "rejected")) {
        const why = withdrawalOf(order) ? ` ${detailOf(order, this.store.state)}` : reason ? `, ${reason}` : "";
        write(part("announcer"), `${text}: ${phaseOf(order)}${why}`);
      }
    }
    if (this.announced.size > 1000) this.announced = new Map(orders.map(({ id, status }) => [id, status]));
  }
}

/** Puts rows into a list. One that is of the same as before stays, so that a press on it is not lost while orders go on. */
function put(list: HTMLElement, before: Rows, wanted: readonly WantedRow[], same: (a: readonly unknown[], b: readonly unknown[]) => boolean = sameParts): Rows {
  const rows = new Map(wanted.map(({ key, of, order, make }): [string, Row] => {
    const known = before.get(key);
    const row = { ...(known && same(of, known.of) ? known : make()), of };
    row.show(order);
    return [key, row];
  }));
  arrange(list, [...rows.values()].map(({ node }) => node));
  return rows;
}

/** A row into which nothing is written later. */
const unchanging = (node: HTMLElement): Omit<Row, "of"> => ({ node, show: () => undefined });

function undoState(state: State): { undo: boolean; redo: boolean; why: string; composing: boolean } {
  return { undo: undoable(state) > 0, redo: isRedoable(state), why: whyNotEditable(state), composing: state.draft.past.length > 0 };
}

function partsName(edit: Json): string {
  const [body] = Object.values(typeof edit === "object" && edit !== null && !Array.isArray(edit) ? edit : {});
  const name = typeof body === "object" && body !== null && !Array.isArray(body) ? body.name : null;
  return typeof name === "string" ? name : "";
}

function historyRow(order: OrderRecord, state: State): HTMLElement {
  return element("li", { "data-status": outcomeStatus(order) },
    element("div", { class: "line" }, element("span", { class: "title" }, order.text), element("span", { class: "chip" }, phaseOf(order))),
    element("div", { class: "detail" }, detailOf(order, state)));
}

/** An order that somebody took back was not refused. */
const outcomeStatus = (order: OrderRecord): OrderPhase | Withdrawal["how"] => withdrawalOf(order)?.how ?? order.status;

function phaseOf(order: OrderRecord): string {
  const status = outcomeStatus(order);
  return (PHASES[status] ?? String(status)) + (order.not_followed ? ", not followed" : "");
}

/** What became of an applied order, in a few words. */
function outcomeOf(order: OrderRecord): string {
  if (order.status === "applying") return `shape ${order.shape ?? "?"} of ${order.shapes ?? "?"}`;
  const parts = [`cycle ${order.cycle_applied ?? "?"}`];
  if (order.not_followed) parts.unshift("not followed");
  if (typeof order.min_scaled_jacobian === "number") parts.push(`quality ${digits(order.min_scaled_jacobian, 3)}`);
  return parts.join(" · ");
}

function withdrawnBy({ how, by }: Withdrawal, state: State): string {
  const person = by === null ? null : nameOf(state, by);
  if (how === "cancelled") return person === null ? "" : `by ${person}`;
  return `by another order${person === null ? "" : `, given by ${person}`}`;
}

export function detailOf(order: OrderRecord, state: State): string {
  const waited = order.sentAt === null ? "" : ` · ${Math.round((performance.now() - order.sentAt) / 1000)} s`;
  switch (order.status) {
    case "sent": return `waiting for the simulation${waited}`;
    case "accepted": return `waiting for its turn${waited}`;
    case "computing": return `moving the mesh and checking every shape on the way${waited}`;
    case "applying": return `shape ${order.shape ?? "?"} of ${order.shapes ?? "?"}`;
    case "lost": return order.reason ?? "";
    case "rejected": {
      const withdrawal = withdrawalOf(order);
      return withdrawal ? withdrawnBy(withdrawal, state) : order.reason ?? "no reason was given";
    }
    case "applied": {
      const parts = [`at cycle ${order.cycle_applied ?? "?"}`];
      const not = order.not_followed;
      if (not) parts.push(`not followed: the mesh was ${digits(not.distance, 3)} from shape ${not.shape} of cycle ${not.cycle}`);
      if (order.judged === "surface") parts.push("only the surface was judged");
      if (typeof order.min_scaled_jacobian === "number") parts.push(`quality ${digits(order.min_scaled_jacobian, 3)}`);
      const spent = order.seconds;
      if (spent) parts.push(`computed in ${seconds((spent.surface ?? 0) + (spent.volume ?? 0) + (spent.guard ?? 0))}`);
      if (order.added_steps && order.added_steps >= 0.05) parts.push(`cost ${digits(order.added_steps, 2)} steps`);
      return parts.join(" · ");
    }
  }
}
