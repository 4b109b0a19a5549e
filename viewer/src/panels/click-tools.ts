/**
 * The tools that take the next click or tap in the picture in place of features: at most one is on, and its button says so. By the keyboard
 * Enter takes the middle of the picture, to which the camera brings what one likes; Escape leaves the tool.
 */
import { isSheetOpen, part, textField, write } from "../dom";
import { showTip } from "../picture/overlay";

const NOTHING_THERE = "Nothing lies in the middle of the picture: turn or move it there.";

/** The middle of an element, as a place of the page. */
export function middleOf(element: HTMLElement): [number, number] {
  const { left, top, width, height } = element.getBoundingClientRect();
  return [left + width / 2, top + height / 2];
}

/** Does something at the next that the person does: that turns the picture, takes another tool, or leaves it. */
function untilNext(action: () => void): void {
  const heard = new AbortController();
  for (const kind of ["keydown", "pointerdown", "wheel"]) window.addEventListener(kind, () => {
    heard.abort();
    action();
  }, { capture: true, passive: true, signal: heard.signal });
}

/** Takes the place in the middle of the picture, and says so where nothing is there. */
export function takeMiddle(picture: HTMLElement, take: (clientX: number, clientY: number) => boolean): void {
  const [x, y] = middleOf(picture);
  const hasMet = take(x, y);
  showTip(hasMet ? null : NOTHING_THERE, x, y);
  if (!hasMet) untilNext(() => { if (part("tip").textContent === NOTHING_THERE) showTip(null, 0, 0); });
  // Said anew each time.
  write(part("announcer"), "");
  if (!hasMet) write(part("announcer"), NOTHING_THERE);
}

export interface ClickTool {
  /** The button that switches it on and off. */
  button: string;
  isOn(): boolean;
  toggle(): void;
  /** Takes a place of the page; returns whether that met the model. */
  take(clientX: number, clientY: number): boolean;
}

export class ClickTools {
  constructor(picture: HTMLElement, private readonly tools: readonly ClickTool[]) {
    for (const tool of tools) part(tool.button).addEventListener("click", () => this.use(tool.button));
    picture.addEventListener("keydown", (event) => {
      const take = this.taking();
      if (event.key !== "Enter" || event.defaultPrevented || event.ctrlKey || event.metaKey || !take) return;
      event.preventDefault();
      takeMiddle(picture, take);
    });
    window.addEventListener("keydown", (event) => {
      const { current } = this;
      if (event.key !== "Escape" || event.defaultPrevented || !current || textField(event.target) || isSheetOpen()) return;
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
    const wanted = this.tools.find((tool) => tool.button === button);
    // A key asks also for what its button does not offer now.
    if ((part(button) as HTMLButtonElement).disabled && !wanted?.isOn()) return;
    for (const tool of this.tools) if (tool !== wanted && tool.isOn()) tool.toggle();
    wanted?.toggle();
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
