/** What the person at the page asks the simulation for. Each is a message; what comes of it comes back as an action. */
import type { ClientMessage, Json } from "../connection/protocol";
import type { Action } from "./actions";
import { missing, wishedOrder } from "./draft";
import { whyNotEditable } from "./edits";
import type { State } from "./state";
import { sameJson } from "./store";
import type { Store } from "./store";
import { NOTHING_ASKED } from "./verdict";

export class Commands {
  private sequence = 0;
  private readonly session = Array.from(crypto.getRandomValues(new Uint8Array(4)), (byte) => byte.toString(16).padStart(2, "0")).join("");

  /** `transmit` sends a message, and says whether there is a connection for it. */
  constructor(private readonly store: Store<State, Action>, private readonly transmit: (message: ClientMessage) => boolean) {}

  /** Sends a message, and says under what name; null where there is no connection. */
  ask(message: ClientMessage): string | null {
    const id = `${this.session}-${++this.sequence}`;
    return this.transmit({ id, ...message }) ? id : null;
  }

  /** Sends a message that somebody waits for: says so where there is no connection. */
  send(message: ClientMessage): string | null {
    const id = this.ask(message);
    if (id === null) this.store.dispatch({ type: "refused", id: null, text: "There is no connection to the simulation; nothing was sent." });
    return id;
  }

  order(order: Json): string | null {
    const id = this.send({ order });
    if (id !== null) this.store.dispatch({ type: "order sent", id, order, at: performance.now() });
    return id;
  }

  /** Gives the order that stands in the form, which then asks for nothing; says why not where there is none. */
  apply(): string {
    const { state } = this.store;
    const order = wishedOrder(state);
    if (order === null) return missing(state) || NOTHING_ASKED;
    if (this.order(order) !== null) this.store.dispatch({ type: "cleared" });
    return "";
  }

  /** Takes the last order back. What an undo leaves is remembered when it is sent: so the stack must be known, and no order on its way. */
  undo(): void {
    if (whyNotEditable(this.store.state) === "") this.order({ undo: 1 });
  }

  /** Brings back the stack that the last undo left. */
  redo(): void {
    const { state } = this.store;
    const stack = state.undone.at(-1);
    if (stack && whyNotEditable(state) === "" && !sameJson(stack, state.hello?.stack)) this.order({ stack });
  }

  /** Replaces the whole stack. */
  setStack(stack: Json[]): void {
    this.order({ stack });
  }

  cancel(order: string): void {
    this.send({ cancel: { order } });
  }

  pauseOrResume(): void {
    this.send(this.store.state.status?.paused ? { resume: {} } : { pause: {} });
  }

  setParameter(name: string, value: number): string | null {
    return this.ask({ parameter: { name, value } });
  }

  askToSteer(): string | null {
    return this.send({ drive: {} });
  }
}
