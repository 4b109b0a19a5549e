/**
 * How finely the picture is drawn. A machine that draws with its processor draws half as many pixels each way while the picture moves, and
 * all of them once it rests: what is turned by hand must follow the hand first of all.
 */

/** How long the picture has not moved when it rests, in milliseconds. */
export const REST = 500;

export class Pace {
  private timer: number | null = null;
  private isHeld = false;
  /** The part of its pixels, each way, that the picture is drawn with. */
  scale: 1 | 0.5 = 1;

  /** `changed` is called when the picture is to be drawn with another part of its pixels. */
  constructor(private readonly byProcessor: boolean, private readonly changed: () => void) {}

  /** The picture moves now, and rests a moment later. */
  move(): void {
    if (!this.byProcessor) return;
    this.set(0.5);
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = this.isHeld ? null : window.setTimeout(() => this.rest(), REST);
  }

  /** The picture is moved by a hand until it is released. */
  hold(): void {
    this.isHeld = true;
    this.move();
  }

  release(): void {
    this.isHeld = false;
    if (this.scale < 1) this.move();
  }

  /** The picture is wanted in full at once. */
  rest(): void {
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
