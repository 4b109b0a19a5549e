/** What is said in place of the picture, as long as there is none. */
import { showEmpty } from "../picture/overlay";
import { listed, nearest } from "../pipelines/nearest";
import type { Action } from "../store/actions";
import type { State } from "../store/state";
import { sameJson } from "../store/store";
import type { Store } from "../store/store";

const LOST: [string, string] = ["The picture is gone", "The browser has taken away what draws it, and may give it back. Reload the page if it does not."];

function withoutView(wanted: string, known: readonly string[]): [string, string] {
  const near = nearest(wanted, known);
  return [`The run has no view “${wanted}”`, near === null ? `Its views are ${listed(known)}.` : `Did you mean “${near}”?`];
}

/** A title and a text; empty where there is a picture. `only` is the one view that is shown; null for all. */
export function emptyText({ frames, connection: { state, explanation }, hello, end, isPictureLost }: State, only: string | null): [string, string] {
  if (isPictureLost) return LOST;
  const known = state === "connected" && hello ? hello.views.map(({ name }) => name) : [];
  // Frames of others may have come before the run was told which one is wanted.
  if (only !== null && known.length > 0 && !known.includes(only)) return withoutView(only, known);
  if (frames.count > 0) return ["", ""];
  if (end) return ["The run has ended", "No picture came before its end."];
  if (state === "refused") return ["This link does not open the simulation", "It was used already, or is of another run. Open a link that this simulation told when it started."];
  if (state === "dismissed") return ["Not connected", explanation];
  if (state !== "connected") return ["Waiting for the simulation", "Nothing answers at this address yet. The viewer connects by itself as soon as the run is there."];
  if (hello && hello.views.length === 0) return ["Nothing is streamed", "The simulation runs, but no pipeline of its configuration ends in a stream stage."];
  return ["Connected", "The first picture appears when the simulation has taken its next step."];
}

export function watchEmpty(store: Store<State, Action>, only: string | null): void {
  store.watch((state) => emptyText(state, only), (text) => showEmpty(...text), sameJson);
}
