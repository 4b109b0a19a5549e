/**
 * How finely the picture is drawn. A machine that draws with its processor draws half as many pixels each way while the picture moves, and
 * all of them once it rests: what is turned by hand must follow the hand first of all.
 */

/** How long the picture has not moved when it rests, in milliseconds. */
export const REST = 500;

export class Pace {
  private timer: number | null = null;
  /** Pointers that hold the picture. */
  private readonly holding = new Set<number>();
  /** The part of its pixels, each way, that the picture is drawn with. */
  scale: 1 | 0.5 = 1;

  /** `changed` is called when the picture is to be drawn with another part of its pixels. */
  constructor(private readonly byProcessor: boolean, private readonly changed: () => void) {}

  /**
   * Follows the pointers on the picture. From press to release its pixels stay as many: who turns it measures the way in pixels of the
   * canvas, so that this must hear of a press first.
   */
  follow(container: HTMLElement): void {
    container.addEventListener("pointerdown", ({ pointerId }) => {
      this.holding.add(pointerId);
      this.move();
    }, true);
    container.addEventListener("wheel", () => this.move(), { capture: true, passive: true });
    for (const end of ["pointerup", "pointercancel"] as const) {
      document.addEventListener(end, ({ pointerId }) => {
        if (this.holding.delete(pointerId)) this.move();
      }, true);
    }
  }

  /** The picture moves now, and rests a moment after it was let go. */
  move(): void {
    if (!this.byProcessor) return;
    this.set(0.5);
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = this.holding.size > 0 ? null : window.setTimeout(() => this.rest(), REST);
  }

  /** The picture is wanted in full at once; while a pointer holds it, it stays as it is. */
  rest(): void {
    if (this.holding.size > 0) return;
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = null;
    this.set(1);
  }

  private set(scale: 1 | 0.5): void {
    if (this.scale === scale) return;
    this.scale = scale;
    this.changed();
  }
}
