/** Which features are handles and which are held fixed, as the picture asks for it; the state of it is in the store. */
import { own } from "../own";
import type { Action } from "./actions";
import { chosen } from "./draft";
import type { Part, State } from "./state";
import type { Store } from "./store";

export class Selection {
  constructor(private readonly store: Store<State, Action>) {}

  /** Calls `listener` whenever another feature is chosen or under the pointer. */
  onChange(listener: () => void): void {
    let first = true;
    this.store.watch((state) => state.selection, () => {
      if (!first) listener();
    });
    first = false;
  }

  get(feature: string): Part | null {
    return own(this.store.state.selection.parts, feature) ?? null;
  }

  /** The features that play a part, in the order of `names`, or of the mesh. */
  chosen(part: Part, names?: readonly string[]): string[] {
    return names ? names.filter((name) => this.get(name) === part) : chosen(this.store.state, part);
  }

  set(feature: string, part: Part | null): void {
    this.store.dispatch({ type: "part", feature, part });
  }

  toggle(feature: string, part: Part): void {
    this.set(feature, this.get(feature) === part ? null : part);
  }

  /** The feature under the pointer, wherever the pointer is. */
  get hovered(): string | null {
    return this.store.state.selection.hovered;
  }

  set hovered(feature: string | null) {
    this.store.dispatch({ type: "hover", feature });
  }
}
