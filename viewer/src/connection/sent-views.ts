/** Which views the run sends to this page: those at which somebody looks here. Where nobody anywhere looks at a view, its pipeline rests. */
import { own } from "../own";
import type { ClientMessage } from "./protocol";
import type { Action } from "../store/actions";
import { LINE, WORST } from "../store/pipelines";
import type { State } from "../store/state";
import { sameJson, sameParts } from "../store/store";
import type { Store } from "../store/store";

/** The most names in one message, and the most bytes of it, as the server takes them. */
const MOST_NAMES = 256;
const MOST_BYTES = 16384;

/** Views that panels need also where the picture hides them; this page has them made, and they are small. */
const PANELS: ReadonlySet<string> = new Set([LINE, WORST]);

type Source = Pick<State, "hello" | "looks" | "chosenView">;

/**
 * The names of the views that are wanted; null for all. Those that are seen, the one that panels are about, those with a pin, and
 * surfaces, on which features are found. `only` is the one view of a page that shows no other.
 */
export function wantedViews({ hello, looks, chosenView }: Source, pinned: ReadonlySet<string>, only: string | null): readonly string[] | null {
  if (only !== null) return [only];
  const views = hello?.views ?? [];
  const wanted = views.filter(({ name, kind }) => own(looks, name)?.visible !== false || name === chosenView || PANELS.has(name) || kind === "surface" || pinned.has(name));
  const names = wanted.map(({ name }) => name);
  return names.length === views.length || !fits(names) ? null : names;
}

/** Whether the server takes as many names in one message; its number has some room. */
const fits = (names: readonly string[]): boolean =>
  names.length <= MOST_NAMES && new TextEncoder().encode(JSON.stringify(names)).length <= MOST_BYTES - 256;

export class SentViews {
  /** What the run was told on this connection; of a new one it sends all. */
  private told: readonly string[] | null = null;

  constructor(
    private readonly store: Store<State, Action>, private readonly pinned: () => ReadonlySet<string>, private readonly only: string | null,
    private readonly send: (message: ClientMessage) => string | null,
  ) {
    store.watch((state) => state.connection.state, (state) => { if (state !== "connected") this.told = null; });
    store.watch((state) => [state.connection, state.hello?.views, state.looks, state.chosenView], () => this.update(), sameParts);
  }

  /** Whether the run sends this view. */
  has(view: string): boolean {
    return this.told === null || this.told.includes(view);
  }

  /** Tells the run what is wanted, where that is something else than before. */
  update(): void {
    const { connection, hello } = this.store.state;
    // A recording sends all that it has.
    if (connection.state !== "connected" || connection.fresh || !hello || hello.recording) return;
    const wanted = wantedViews(this.store.state, this.pinned(), this.only);
    if (sameJson(wanted, this.told)) return;
    if (this.send({ views: wanted === null ? {} : { names: [...wanted] } }) !== null) this.told = wanted;
  }
}
