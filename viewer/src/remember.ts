/** The page after a reload: what it has kept of its run is there again with the first message of that run, and is written down when the page is left. */
import { knownIdentity } from "./connection/identity";
import type { Hello } from "./connection/protocol";
import { part } from "./dom";
import type { History } from "./history/series";
import type { WorstCells } from "./panels/quality";
import type { Camera } from "./picture/camera";
import type { Compare } from "./picture/compare";
import type { Pins } from "./picture/pins";
import type { Action } from "./store/actions";
import { LONGEST_HISTORY, LONGEST_ORDER } from "./store/kept";
import type { KeptRun } from "./store/kept";
import { draftToKeep } from "./store/kept-draft";
import type { State } from "./store/state";
import type { Store } from "./store/store";

/** Buttons that stay as they were. */
const SWITCHES = ["skeleton", "compare"] as const;
const isPressed = (id: string): boolean => part(id).getAttribute("aria-pressed") === "true";

export interface Remembered {
  /** Whether the page shows one view alone: what is kept is that of the whole page, which may be open beside it. */
  isEmbedded: boolean;
  camera: Pick<Camera, "stand" | "isWhole" | "parallel" | "isPlaced">;
  compare: Pick<Compare, "restore">;
  pins: Pick<Pins, "kept" | "restore">;
  worst: Pick<WorstCells, "kept" | "restore" | "leave">;
  monitored: Pick<History, "kept" | "restore">;
  /** What was kept is there again. */
  restored(): void;
  /** Calls back once the first picture of the run is drawn. */
  whenDrawn(then: () => void): void;
}

export class Memory {
  /** Whether it is known which run this is: what was kept of it is there again, and can be kept anew. */
  private isRead = false;
  /** What is to be switched on with the first picture. */
  private waiting: readonly string[] = [];

  constructor(private readonly store: Store<State, Action>, private readonly kept: KeptRun, private readonly parts: Remembered) {
    window.addEventListener("pagehide", () => {
      parts.worst.leave();
      if (this.isRead && !parts.isEmbedded) this.keep();
    });
  }

  /** The run has said which it is. */
  greeted({ back }: Hello): void {
    if (this.isRead) return;
    this.isRead = true;
    // Only the run that this page was connected to before knows it by that.
    if (!back || knownIdentity()?.back !== back) return this.kept.forget();
    if (this.parts.isEmbedded) return;
    const { camera, pins, worst, monitored } = this.parts;
    const kept = this.kept.read();
    if (kept.history !== null) monitored.restore(kept.history);
    pins.restore(kept.pins);
    if (kept.isParallel) camera.parallel = true;
    if (kept.camera) camera.stand = kept.camera;
    worst.restore(kept.isWorstOwn);
    this.store.dispatch({ type: "remembered", chosenView: kept.chosenView, draft: kept.draft, dismissed: kept.dismissed });
    this.waiting = SWITCHES.filter((id) => (id === "skeleton" ? kept.isSkeletonShown : kept.isCompared));
    if (this.waiting.length > 0) this.parts.whenDrawn(() => this.switchOn());
    this.parts.restored();
  }

  private switchOn(): void {
    for (const id of this.waiting) {
      if (id === "compare") this.parts.compare.restore();
      else if (!isPressed(id)) part(id).click();
    }
    this.waiting = [];
  }

  private keep(): void {
    const { camera, pins, worst, monitored } = this.parts;
    const isOn = (id: (typeof SWITCHES)[number]): boolean => isPressed(id) || this.waiting.includes(id);
    this.kept.keep({
      pins: pins.kept, history: monitored.kept(LONGEST_HISTORY), isWorstOwn: worst.kept,
      camera: camera.isPlaced && !camera.isWhole ? camera.stand : null, isParallel: camera.parallel,
      isSkeletonShown: isOn("skeleton"), isCompared: isOn("compare"),
      chosenView: this.store.state.chosenView, draft: draftToKeep(this.store.state),
      dismissed: this.store.state.dismissed.filter((id) => id.length <= LONGEST_ORDER),
    });
  }
}
