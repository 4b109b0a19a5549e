/** The keys that hold everywhere on the page: taking back and bringing back, before Apply and after it; Apply itself; the way to it. */
import { part } from "../dom";
import type { Action } from "../store/actions";
import type { Commands } from "../store/commands";
import { isRedoable, undoable, whyNotEditable } from "../store/edits";
import type { State } from "../store/state";
import type { Store } from "../store/store";

export function watchKeys(store: Store<State, Action>, commands: Commands): void {
  // From the head of the page to its foot, without all that stands between.
  part("to-apply").addEventListener("click", () => {
    const apply = part("apply") as HTMLButtonElement;
    (apply.disabled ? part("foot") : apply).focus();
  });
  window.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
    // The editor of pipelines has its own.
    if ((event.target as HTMLElement | null)?.closest?.(".cm-editor")) return;
    const apply = part("apply") as HTMLButtonElement;
    if (event.key === "Enter" && !apply.disabled) {
      event.preventDefault();
      apply.click();
    }
    if (event.key.toLowerCase() !== "z") return;
    const { state } = store;
    // A name or a note is text: the browser takes back what is typed there.
    if ((event.target as HTMLElement | null)?.closest?.("input.name, textarea")) return;
    event.preventDefault();
    if (!event.shiftKey) {
      if (state.draft.past.length > 0) store.dispatch({ type: "step back" });
      else if (whyNotEditable(state) === "" && undoable(state) > 0) commands.undo();
    } else if (state.draft.future.length > 0) store.dispatch({ type: "step forward" });
    else if (whyNotEditable(state) === "" && isRedoable(state)) commands.redo();
  });
}
