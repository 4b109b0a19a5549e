/** A tour of six steps for whoever opens the page for the first time: each names what it speaks of, and rings it. */
import { element, part, write } from "../dom";

interface Stop { at: string; title: string; text: string }

/** In the order in which a shape is changed. `at` is what is ringed. */
export const STOPS: readonly Stop[] = [
  { at: "stage", title: "The run, as it is now", text: "A drag turns the picture, the wheel zooms, Fit shows the whole. Under the pointer stand the name of the feature and the value there; P plots it." },
  { at: "left", title: "What is shown", text: "Views can be switched on and off, coloured by another field, over another range. A slice is moved here, or by its knob in the picture." },
  { at: "edit-panel", title: "What to change", text: "Click a feature in the picture: it becomes the handle. What flows in and out is held already. Drag the handle by its arrows, squares, rings and boxes, or type numbers here." },
  { at: "foot", title: "What it would come to", text: "The preview says at once how far the surface moves; the forecast says what becomes of the mesh. Only Apply changes the run." },
  { at: "edits-panel", title: "What was done", text: "Each change has a row: click it to change it, drag it to reorder, or take it back with Undo. The earlier shape returns exactly." },
  { at: "dock", title: "What it has done to the flow", text: "Monitors over time, a field along a line, how values are spread: each as it is now and as it was before the last change. Compare shows both pictures side by side." },
];

export class Tour {
  private at = -1;
  private readonly title = element("h2", { id: "tour-title" });
  private readonly text = element("p");
  private readonly count = element("span", { class: "hint" });
  private readonly back = element("button", { type: "button", onclick: () => this.go(this.at - 1) }, "Back");
  private readonly next = element("button", { type: "button", class: "primary", onclick: () => this.go(this.at + 1) });
  private readonly box: HTMLElement;
  private readonly ring = element("div", { id: "tour-ring", "aria-hidden": "true", hidden: true });
  private before: HTMLElement | null = null;

  /** `ended` is called when it was seen or left: it does not begin by itself again. `reveal` opens the drawer that something lies in. */
  constructor(private readonly ended: () => void, private readonly reveal: (target: HTMLElement) => void) {
    this.box = element("div", { id: "tour", role: "dialog", "aria-labelledby": "tour-title", tabindex: -1, hidden: true, onkeydown: (event) => this.key(event as KeyboardEvent) },
      this.title, this.text, element("div", { class: "tour-buttons" }, this.count, element("button", { type: "button", onclick: () => this.end() }, "End the tour"), this.back, this.next));
    document.body.append(this.ring, this.box);
    window.addEventListener("resize", () => this.place());
    part("tour-button").addEventListener("click", () => this.begin());
  }

  begin(): void {
    this.before = document.activeElement as HTMLElement | null;
    this.go(0);
  }

  private go(to: number): void {
    const stop = STOPS[to];
    if (!stop) return to >= STOPS.length ? this.end() : undefined;
    this.at = to;
    this.box.hidden = this.ring.hidden = false;
    write(this.title, stop.title);
    write(this.text, stop.text);
    write(this.count, `${to + 1} of ${STOPS.length}`);
    write(this.next, to + 1 < STOPS.length ? "Next" : "Done");
    this.back.disabled = to === 0;
    this.reveal(part(stop.at));
    this.place();
    this.box.focus();
  }

  private end(): void {
    this.at = -1;
    this.box.hidden = this.ring.hidden = true;
    this.before?.focus();
    this.ended();
  }

  private key(event: KeyboardEvent): void {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (event.key === "Escape") this.end();
    else if (step !== undefined) this.go(Math.max(0, this.at + step));
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /** Rings what is spoken of, and stands beside it where there is room. */
  private place(): void {
    const stop = STOPS[this.at];
    if (!stop) return;
    const { left, top, width, height, right } = part(stop.at).getBoundingClientRect();
    const isSeen = width > 0 && height > 0;
    this.ring.hidden = !isSeen;
    for (const [name, value] of [["left", left], ["top", top], ["width", width], ["height", height]] as const) this.ring.style[name] = `${value}px`;
    const { offsetWidth, offsetHeight } = this.box;
    const beside = right + 12 + offsetWidth <= innerWidth ? right + 12 : left - 12 - offsetWidth >= 0 ? left - 12 - offsetWidth : (innerWidth - offsetWidth) / 2;
    const beneath = Math.min(Math.max(8, top + 12), innerHeight - offsetHeight - 8);
    this.box.style.left = `${isSeen ? beside : (innerWidth - offsetWidth) / 2}px`;
    this.box.style.top = `${isSeen ? beneath : (innerHeight - offsetHeight) / 2}px`;
  }
}
