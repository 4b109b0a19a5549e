/** The tools that take the next click or tap in the picture in place of features: at most one is on, and its button says so. Escape leaves it. */
import { part, textField } from "../dom";

export interface ClickTool {
  /** The button that switches it on and off. */
  button: string;
  isOn(): boolean;
  toggle(): void;
  /** Takes a place of the page; returns whether that met the model. */
  take(clientX: number, clientY: number): boolean;
}

export class ClickTools {
  constructor(private readonly tools: readonly ClickTool[]) {
    for (const tool of tools) part(tool.button).addEventListener("click", () => this.use(tool.button));
    window.addEventListener("keydown", (event) => {
      const { current } = this;
      if (event.key !== "Escape" || event.defaultPrevented || !current || textField(event.target)) return;
      event.preventDefault();
      this.use(current.button);
    });
  }

  /** The tool that waits for a place; null for none. */
  get current(): ClickTool | null {
    return this.tools.find((tool) => tool.isOn()) ?? null;
  }

  /** Switches the tool of a button on or off; the others are off. */
  use(button: string): void {
    for (const tool of this.tools) if (tool.button !== button && tool.isOn()) tool.toggle();
    this.tools.find((tool) => tool.button === button)?.toggle();
    this.show();
  }

  /** Brings the buttons in line with the tools, of which one may have ended. */
  show(): void {
    for (const tool of this.tools) part(tool.button).setAttribute("aria-pressed", String(tool.isOn()));
  }

  /** What takes the next click; null where none is on. */
  taking(): ((clientX: number, clientY: number) => boolean) | null {
    const { current } = this;
    return current && ((x, y) => {
      const hasMet = current.take(x, y);
      this.show();
      return hasMet;
    });
  }
}

/** A tool for one place. */
export class OnePlace implements ClickTool {
  private on = false;

  /** `takeAt` takes a place of the page, and says whether that met the model. */
  constructor(readonly button: string, private readonly takeAt: (clientX: number, clientY: number) => boolean) {}

  isOn(): boolean {
    return this.on;
  }

  toggle(): void {
    this.on = !this.on;
  }

  take(clientX: number, clientY: number): boolean {
    const hasMet = this.takeAt(clientX, clientY);
    if (hasMet) this.on = false;
    return hasMet;
  }
}
