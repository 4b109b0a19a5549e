/**
 * What the order that stands in the form would come to: the quality of the mesh that it would make, before Apply is pressed.
 *
 * The simulation finds it out beside its own work and changes nothing. One is asked for when the form has rested for a moment;
 * the server forgets those that were overtaken, and is told where nobody wants to know any more.
 */
import type { ForecastAnswer, Json } from "../connection/protocol";
import type { Action } from "../store/actions";
import { wishedOrder } from "../store/draft";
import { isSteering } from "../store/run";
import type { State } from "../store/state";
import { sameJson } from "../store/store";
import type { Store } from "../store/store";

/** Milliseconds without a change after which a forecast is asked for. */
const REST = 250;

interface Wish { order: Json | null; stack: Json[]; steering: boolean }

/** The way to the simulation. */
export interface Questions {
  /** Asks for the forecast of an order; under what name, or null where nobody can be asked. */
  ask(order: Json): string | null;
  /** Says that nobody wants to know any more. */
  withdraw(): void;
}

export class Forecasts {
  private asked: string | null = null;
  /** The order that the last question was about. */
  private question: Json | null = null;
  /** The names of questions that were overtaken and are not answered yet. */
  private readonly overtaken = new Set<string>();
  private resting: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly store: Store<State, Action>, private readonly questions: Questions) {
    store.watch(
      (state): Wish => ({ order: wishedOrder(state), stack: state.hello?.stack ?? [], steering: isSteering(state) }),
      (wish) => this.changed(wish),
      (a, b) => sameJson(a.order, b.order) && a.steering === b.steering && sameJson(a.stack, b.stack),
    );
  }

  /** Another order is composed, or it would start from another shape. */
  private changed({ order, steering }: Wish): void {
    clearTimeout(this.resting);
    const before = this.asked;
    if (before !== null) this.overtaken.add(before);
    this.asked = null;
    if (order === null || !steering) {
      if (this.overtaken.size > 0 && !this.isGiven()) this.questions.withdraw();
      return this.store.dispatch({ type: "forecast cleared" });
    }
    this.store.dispatch({ type: "forecast asked" });
    this.resting = setTimeout(() => {
      this.asked = this.questions.ask(order);
      this.question = order;
      if (this.asked === null) this.store.dispatch({ type: "forecast cleared" });
    }, REST);
  }

  /** Whether the order that was asked about was given just now: it takes the shapes that its forecast finds. */
  private isGiven(): boolean {
    return this.store.state.orders.some(({ status, order }) => status === "sent" && sameJson(order, this.question));
  }

  answer(answer: ForecastAnswer): void {
    if (answer.id) this.overtaken.delete(answer.id);
    if (this.asked === null || answer.id !== this.asked) return;
    this.asked = null;
    this.store.dispatch({ type: "forecast told", answer: answer.order });
  }

  /** The server could not take the question of this name; whether it was one of ours. */
  refused(id: string, reason: string): boolean {
    // Nobody wants to know any more.
    if (this.overtaken.delete(id)) return true;
    if (this.asked === null || id !== this.asked) return false;
    this.asked = null;
    this.store.dispatch({ type: "forecast failed", reason });
    return true;
  }
}
