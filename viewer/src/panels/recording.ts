/** The slider of a recording, below the picture: where it is, how fast it goes on, and whether it rests. */
import { part, write } from "../dom";
import { digits } from "../number";
import type { Action } from "../store/actions";
import type { Commands } from "../store/commands";
import type { State } from "../store/state";
import type { Store } from "../store/store";

/** Milliseconds between two messages while the slider is dragged. */
const DRAG_PERIOD = 150;

/** The most characters that a time has: `0.001234`. */
const LONGEST_TIME = 8;

const momentText = (cycle: number, time: number): string => `cycle ${cycle}, time ${digits(time)}`;

export class RecordingPanel {
  private readonly slider = part("moment") as HTMLInputElement;
  private readonly button = part("play") as HTMLButtonElement;
  private readonly speed = part("speed") as HTMLSelectElement;
  private sentAt = -Infinity;
  /** The slider is in somebody's hand: what is told of the moment does not move it. */
  private held = false;
  /** The slider stands where the recording was not asked to go yet. */
  private unsent = false;

  constructor(private readonly store: Store<State, Action>, private readonly commands: Commands) {
    store.watch((state) => state.hello?.recording ?? null, (recording) => {
      part("recording").hidden = recording === null;
      if (!recording) return;
      this.slider.min = String(recording.first.seconds);
      this.slider.max = String(recording.last.seconds);
      // The longest text has room: the slider would else become shorter and longer under the hand that drags it.
      part("moment-text").style.minWidth = `${momentText(recording.last.cycle, 0).length + LONGEST_TIME}ch`;
      this.show();
    });
    store.watch((state) => state.played, () => this.show());
    this.slider.addEventListener("input", () => {
      this.held = this.unsent = true;
      if (performance.now() - this.sentAt >= DRAG_PERIOD) this.seek();
    });
    // A drag that ends where it began tells no change, and may end beside the slider.
    for (const end of ["change", "blur"]) this.slider.addEventListener(end, () => this.letGo());
    for (const end of ["pointerup", "pointercancel"]) window.addEventListener(end, () => this.letGo());
    this.button.addEventListener("click", () => {
      const { played, hello } = this.store.state;
      // From its end a recording begins again.
      if (played?.at_end) this.goTo(hello?.recording?.first.seconds ?? 0, { paused: false });
      else this.commands.ask({ play: { paused: !played?.paused } });
    });
    this.speed.addEventListener("change", () => this.commands.ask({ play: { speed: Number(this.speed.value) } }));
  }

  private letGo(): void {
    this.held = false;
    if (this.unsent) this.seek();
  }

  private seek(): void {
    this.unsent = false;
    this.sentAt = performance.now();
    this.goTo(Number(this.slider.value));
  }

  private goTo(seconds: number, more: { paused?: boolean } = {}): void {
    if (this.commands.ask({ play: { seek: { seconds }, ...more } }) === null) return;
    // The note that was looked for is of another moment.
    this.store.dispatch({ type: "note sought", note: null });
  }

  private show(): void {
    const { played } = this.store.state;
    if (!played) return;
    if (!this.held) this.slider.value = String(played.seconds);
    const text = momentText(played.cycle, played.time);
    write(part("moment-text"), text);
    this.slider.setAttribute("aria-valuetext", text);
    // A connection that is made anew begins with another speed than was chosen before. Written where it differs: the list may be open.
    const speed = String(played.speed);
    if (this.speed.value !== speed) this.speed.value = speed;
    write(this.button, played.at_end ? "Again" : played.paused ? "Play" : "Pause");
  }
}
