/**
 * Whether large views are drawn whole. One whose whole picture takes long is drawn with fewer triangles while it moves: what is turned by
 * hand must follow the hand first of all.
 */

/** A whole picture that takes longer than this is too slow to be turned, in milliseconds. */
export const SLOW = 30;
/** How long after the last movement the picture is drawn whole again, in milliseconds. */
export const STILL = 150;
/** Movements that follow each other after no longer than this are one, in milliseconds: a camera that is followed comes five times a second. */
const LONGEST_GAP = 300;
/** How many whole pictures tell what one costs. */
const MEASURED = 5;

export class Detail {
  private timer: number | null = null;
  private readonly costs: number[] = [];
  private isMeasuring = false;
  private moved = -Infinity;
  /** Whether large views are drawn with fewer triangles now. */
  isCoarse = false;

  /** `changed` is called when the picture is to be drawn whole again. */
  constructor(private readonly changed: () => void) {}

  /** A whole picture was told to a context that was begun then: sees what it costs, unless another one is being looked at. */
  measure(context: WebGL2RenderingContext, begun: number): void {
    if (this.isMeasuring) return;
    this.isMeasuring = true;
    whenDrawn(context, (isDrawn) => {
      this.isMeasuring = false;
      if (isDrawn) this.took(performance.now() - begun);
    });
  }

  /** A whole picture took so many milliseconds. */
  took(milliseconds: number): void {
    this.costs.push(milliseconds);
    if (this.costs.length > MEASURED) this.costs.shift();
  }

  /** The picture moves. */
  move(): void {
    // The quickest of them: others have made shaders, or stood behind other work.
    this.isCoarse ||= this.costs.length > 0 && Math.min(...this.costs) > SLOW;
    const now = performance.now(), gap = now - this.moved;
    this.moved = now;
    if (!this.isCoarse) return;
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      this.rest();
      this.changed();
    }, gap > STILL && gap < LONGEST_GAP ? 1.5 * gap : STILL);
  }

  /** The picture is wanted whole. */
  rest(): void {
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = null;
    this.isCoarse = false;
  }
}

/** Tells when all is drawn that a context was told to draw; or that it never is, where the context is lost before. */
function whenDrawn(context: WebGL2RenderingContext, told: (isDrawn: boolean) => void): void {
  const fence = context.fenceSync(context.SYNC_GPU_COMMANDS_COMPLETE, 0);
  if (!fence) return told(false);
  context.flush();
  const look = (): void => {
    const state = context.clientWaitSync(fence, 0, 0);
    if (state === context.TIMEOUT_EXPIRED && !context.isContextLost()) {
      setTimeout(look, 1);
      return;
    }
    context.deleteSync(fence);
    told(state === context.ALREADY_SIGNALED || state === context.CONDITION_SATISFIED);
  };
  setTimeout(look, 0);
}
