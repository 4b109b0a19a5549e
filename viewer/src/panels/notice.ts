/** What went wrong last, told for a while over the picture. */
import { part, write } from "../dom";
import type { Action } from "../store/actions";
import type { State } from "../store/state";
import type { Store } from "../store/store";

/** Milliseconds for which it stands there. */
const SHOWN_FOR = 10_000;

export class Notice {
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(store: Store<State, Action>) {
    store.watch((state) => state.errors, (errors) => this.show(errors.at(-1)));
  }

  private show(newest: string | undefined): void {
    if (newest === undefined) return;
    const notice = part("notice");
    write(notice, `Something went wrong: ${newest}.`);
    notice.hidden = false;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => { notice.hidden = true; }, SHOWN_FOR);
  }
}
