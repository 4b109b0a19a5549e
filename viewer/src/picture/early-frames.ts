/**
 * The newest frames of views that nobody has told of yet: the first frame of a view may come before the message that lists it. Its
 * topology is sent once, and without it the view would stay empty.
 */
import type { DataFrame, Frame, TopologyFrame } from "../connection/protocol";

/** The most views that frames are kept of. */
const MOST = 32;

interface Kept { topology: TopologyFrame; data: DataFrame | null }

export class EarlyFrames {
  private readonly kept = new Map<string, Kept>();

  keep(frame: Frame): void {
    if (frame.kind === "topology") {
      this.kept.delete(frame.view);
      this.kept.set(frame.view, { topology: frame, data: null });
      const [oldest] = this.kept.keys();
      if (this.kept.size > MOST && oldest !== undefined) this.kept.delete(oldest);
      return;
    }
    const kept = this.kept.get(frame.view);
    if (kept?.topology.topology === frame.topology) kept.data = frame;
  }

  /** Hands out what is kept of a view, in the order in which it came. */
  take(view: string): Frame[] {
    const kept = this.kept.get(view);
    this.kept.delete(view);
    return kept ? [kept.topology, ...(kept.data ? [kept.data] : [])] : [];
  }
}
