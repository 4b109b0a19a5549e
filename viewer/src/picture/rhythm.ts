/**
 * When the picture is drawn: at the browser's next chance where something asks for it, and with new values no oftener than they leave as much
 * time to messages and the person as they take.
 */

/** The longest pause between two pictures of new values, in milliseconds. */
export const LONGEST_REST = 500;
/** Milliseconds that new values wait after each shape of a drag: longer than the next shape takes. */
export const SHAPING = 150;

/** Time and the browser's chances to draw, so that a test can stand in for them. */
export interface Clock { now(): number; frame(action: () => void): void; later(action: () => void, milliseconds: number): void }

const browserClock: Clock = {
  now: () => performance.now(), frame: (action) => { requestAnimationFrame(action); }, later: (action, milliseconds) => { window.setTimeout(action, milliseconds); },
};

export class Rhythm {
  private isScheduled = false;
  private isWaiting = false;
  /** The time before which new values do not come into a picture. */
  private rested = 0;
  /** When new values came into a picture last. */
  private taken = -Infinity;
  /** When the picture was begun into which new values came; null where none did. */
  private begun: number | null = null;
  /** Who waits for the next picture, and whether somebody wants all in it that has come. */
  private readonly listeners: (() => void)[] = [];
  private allWanted = false;

  /** While an interaction draws pictures by itself, `draw` is not called. */
  constructor(private readonly picture: { isAnimating(): boolean; draw(): void }, private readonly clock: Clock = browserClock) {}

  /** Whether somebody waits for a picture of all that has come. */
  get isAllWanted(): boolean {
    return this.allWanted;
  }

  /** Asks for a picture. `drawn` is called with it, while the canvas holds it. */
  request(drawn?: () => void): void {
    if (drawn) this.listeners.push(drawn);
    if (this.isScheduled) return;
    this.isScheduled = true;
    this.clock.frame(() => {
      this.isScheduled = false;
      if (!this.picture.isAnimating()) this.picture.draw();
    });
  }

  /** Asks for a picture of all that has come. */
  requestAll(drawn: () => void): void {
    this.allWanted = true;
    this.request(drawn);
  }

  /** Asks for a picture of new values, once they are due. */
  requestGently(): void {
    const rest = this.rested - this.clock.now();
    if (rest <= 0) return this.request();
    if (this.isWaiting) return;
    this.isWaiting = true;
    this.clock.later(() => {
      this.isWaiting = false;
      this.requestGently();
    }, rest);
  }

  /** Takes note of a shape of a drag: new values wait a moment for the next one. */
  shaped(): void {
    this.rested = Math.max(this.rested, Math.min(this.clock.now() + SHAPING, this.taken + LONGEST_REST));
  }

  /**
   * Whether new values come into the picture that is about to be drawn; where they do, what it costs says when the next ones may. What
   * cannot be drawn without them does not wait.
   */
  takesValues(isUrgent = false): boolean {
    const now = this.clock.now();
    if (now < this.rested && !this.allWanted && !isUrgent) {
      this.requestGently();
      return false;
    }
    this.begun = this.taken = now;
    return true;
  }

  /** The picture was drawn. */
  drawn(): void {
    this.allWanted = false;
    const { begun } = this;
    this.begun = null;
    for (const told of this.listeners.splice(0)) told();
    // What a picture costs is known once the browser takes up its next task.
    if (begun !== null) this.clock.later(() => {
      const now = this.clock.now();
      this.rested = Math.max(this.rested, now + Math.min(LONGEST_REST, now - begun));
    }, 0);
  }
}
