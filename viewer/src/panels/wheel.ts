/** The wheel: a watcher asks for it, the one who steers hands it over or keeps it, and the simulation hears that somebody is there. */
import type { ClientMessage, WheelKept } from "../connection/protocol";
import { part, write } from "../dom";
import type { Action } from "../store/actions";
import type { Commands } from "../store/commands";
import { capital, isSteering, titleOf } from "../store/run";
import type { State } from "../store/state";
import { sameJson } from "../store/store";
import type { Store } from "../store/store";

/** The least time between two signs of being there, in milliseconds. */
const SIGN_PERIOD = 10000;
/** For how long it is said that an answer is waited for, or that the wheel is kept, in milliseconds. */
const WAITING = 60000;

export class WheelPanel {
  private shown = -Infinity;
  /** The message by which the wheel was asked for last. */
  private asked: string | null = null;
  private waiting = 0;

  constructor(private readonly store: Store<State, Action>, private readonly commands: Commands) {
    part("wheel").addEventListener("click", () => { this.asked = commands.askToSteer(); });
    part("hand-over").addEventListener("click", () => this.answer((other) => ({ hand_over: { to: other } })));
    part("dismiss").addEventListener("click", () => this.answer((other) => ({ kick: { client: other } })));
    part("keep").addEventListener("click", () => this.answer(() => ({ keep: {} })));
    for (const kind of ["pointermove", "pointerdown", "wheel", "keydown"]) {
      window.addEventListener(kind, () => this.here(), { passive: true, capture: true });
    }
    store.watch((state) => (isSteering(state) && state.askedBy !== null ? capital(titleOf(state, state.askedBy)) : null), (by) => {
      part("asked").hidden = by === null;
      if (by !== null) write(part("asked-text"), `${by} asks to steer.`);
    });
    store.watch(mayAsk, (may) => { part("wheel").hidden = !may; });
    store.watch((state) => [state.hello?.role, state.status?.driver, mayAsk(state)], () => this.say(""), sameJson);
  }

  /** Whether this is the answer to the one who asks for the wheel and has to wait for it: nothing has gone wrong. */
  told(id: string, text: string): boolean {
    if (id !== this.asked) return false;
    this.say(`${text}.`);
    return true;
  }

  /** The one who steers keeps the wheel. */
  kept({ by }: WheelKept): void {
    if (this.asked === null || !mayAsk(this.store.state)) return;
    this.asked = null;
    this.say(`${capital(titleOf(this.store.state, by))} keeps the wheel.`);
  }

  private say(text: string): void {
    clearTimeout(this.waiting);
    write(part("waiting"), text);
    part("waiting").hidden = text === "";
    if (text !== "") this.waiting = window.setTimeout(() => this.say(""), WAITING);
  }

  private answer(message: (other: string) => ClientMessage): void {
    const { askedBy } = this.store.state;
    if (askedBy !== null && isSteering(this.store.state)) this.commands.send(message(askedBy));
    this.store.dispatch({ type: "wheel answered" });
  }

  /** A person does something at this viewer. */
  private here(): void {
    const now = performance.now();
    if (!isSteering(this.store.state) || now - this.shown < SIGN_PERIOD) return;
    this.shown = now;
    this.commands.ask({ here: {} });
  }
}

/** Whether this viewer could have the wheel and does not. */
function mayAsk({ connection, hello, end }: State): boolean {
  return !end && connection.state === "connected" && hello !== null && hello.role !== "driver" && hello.may_drive !== false;
}
