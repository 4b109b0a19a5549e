/** The keys that hold everywhere on the page: taking back and bringing back, before Apply and after it; Apply itself; the way to it. */
import { part, textField } from "../dom";
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
    // What has done something with a key already was meant by it, such as a note that Ctrl+Enter pins.
    if (event.defaultPrevented) return;
    const field = textField(event.target);
    // The editor of pipelines has its own.
    if (field?.closest(".cm-editor")) return;
    const apply = part("apply") as HTMLButtonElement;
    if (event.key === "Enter" && !apply.disabled) {
      event.preventDefault();
      apply.click();
    }
    if (event.key.toLowerCase() !== "z") return;
    const { state } = store;
    // The browser takes back what is typed; only what composes an edit is taken back by steps of the form.
    if (field && (field.matches("input.name, textarea") || !field.closest("#edit, .gizmo-value"))) return;
    event.preventDefault();
    if (!event.shiftKey) {
      if (state.draft.past.length > 0) store.dispatch({ type: "step back" });
      else if (whyNotEditable(state) === "" && undoable(state) > 0) commands.undo();
    } else if (state.draft.future.length > 0) store.dispatch({ type: "step forward" });
    else if (whyNotEditable(state) === "" && isRedoable(state)) commands.redo();
  });
}
