/** What is said in place of the picture, as long as there is none. */
import { showEmpty } from "../picture/overlay";
import type { Action } from "../store/actions";
import type { State } from "../store/state";
import { sameJson } from "../store/store";
import type { Store } from "../store/store";

const LOST: [string, string] = ["The picture is gone", "The browser has taken away what draws it, and may give it back. Reload the page if it does not."];

/** A title and a text; empty where there is a picture. */
export function emptyText({ frames, connection: { state, explanation }, hello, end, isPictureLost }: State): [string, string] {
  if (isPictureLost) return LOST;
  if (frames.count > 0) return ["", ""];
  if (end) return ["The run has ended", "No picture came before its end."];
  if (state === "refused") return ["This link does not open the simulation", "It was used already, or is of another run. Open a link that this simulation told when it started."];
  if (state === "dismissed") return ["Not connected", explanation];
  if (state !== "connected") return ["Waiting for the simulation", "Nothing answers at this address yet. The viewer connects by itself as soon as the run is there."];
  if (hello && hello.views.length === 0) return ["Nothing is streamed", "The simulation runs, but no pipeline of its configuration ends in a stream stage."];
  return ["Connected", "The first picture appears when the simulation has taken its next step."];
}

export function watchEmpty(store: Store<State, Action>): void {
  store.watch(emptyText, (text) => showEmpty(...text), sameJson);
}
