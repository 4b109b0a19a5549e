/** The wheel: another viewer asks for it, and the simulation hears that the one who steers is still there. */
import { part, write } from "../dom";
import type { ClientMessage } from "../connection/protocol";

/** The least time between two signs of being there, in milliseconds. */
const SIGN_PERIOD = 10000;

export class Wheel {
  private asking: string | null = null;
  private told = -Infinity;

  constructor(private readonly send: (message: ClientMessage) => unknown, private readonly drives: () => boolean) {
    part("hand-over").addEventListener("click", () => this.answer((other) => ({ hand_over: { to: other } })));
    part("dismiss").addEventListener("click", () => this.answer((other) => ({ kick: { client: other } })));
    part("keep").addEventListener("click", () => this.answer(() => ({ here: {} })));
    for (const kind of ["pointermove", "pointerdown", "wheel", "keydown"]) {
      window.addEventListener(kind, () => this.here(), { passive: true, capture: true });
    }
  }

  /** Another viewer asks for the wheel. */
  asked(by: string): void {
    this.asking = by;
    write(part("asked-text"), `Viewer ${by} asks for the wheel.`);
    this.refresh();
  }

  refresh(): void {
    if (!this.drives()) this.asking = null;
    part("asked").hidden = this.asking === null;
  }

  private answer(message: (other: string) => ClientMessage): void {
    if (this.asking !== null && this.drives()) this.send(message(this.asking));
    this.asking = null;
    this.refresh();
  }

  /** A person does something at this viewer. */
  private here(): void {
    const now = performance.now();
    if (!this.drives() || now - this.told < SIGN_PERIOD) return;
    this.told = now;
    this.send({ here: {} });
  }
}
