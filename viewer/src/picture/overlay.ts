/** What lies over the picture: axes, the name under the pointer, and the empty state. */
import { part, svg, write } from "../dom";
import type { Covered } from "./camera";

const AXIS_COLOURS = ["#ff6b6b", "#6fdc7f", "#6ea8ff"];
const AXIS_NAMES = ["x", "y", "z"];

/** The directions of the axes on the screen, drawn in a corner. */
export class Triad {
  private readonly lines: SVGLineElement[] = [];
  private readonly names: SVGTextElement[] = [];

  constructor() {
    AXIS_NAMES.forEach((name, i) => {
      const line = svg("line", { stroke: AXIS_COLOURS[i]!, "stroke-width": 2 });
      const label = svg("text", { fill: AXIS_COLOURS[i]! });
      label.textContent = name;
      this.lines.push(line);
      this.names.push(label);
      part("triad").append(line, label);
    });
  }

  turn(axes: readonly [number, number][]): void {
    axes.forEach(([x, y], i) => {
      this.lines[i]?.setAttribute("x2", (x * 24).toFixed(1));
      this.lines[i]?.setAttribute("y2", (-y * 24).toFixed(1));
      this.names[i]?.setAttribute("x", (x * 32).toFixed(1));
      this.names[i]?.setAttribute("y", (-y * 32).toFixed(1));
    });
  }
}

export function showTip(text: string | null, x: number, y: number): void {
  const tip = part("tip");
  tip.hidden = text === null;
  if (text === null) return;
  write(tip, text);
  const stage = part("stage").getBoundingClientRect();
  tip.style.left = `${Math.min(x - stage.left + 14, stage.width - tip.offsetWidth - 8)}px`;
  tip.style.top = `${Math.min(y - stage.top + 14, stage.height - tip.offsetHeight - 8)}px`;
}

export function showEmpty(title: string, text: string): void {
  part("empty").hidden = title === "";
  write(part("empty-title"), title);
  write(part("empty-text"), text);
}

/** The pixels that part the bars from the edge of the page and from the picture beside them. */
const AROUND_BARS = 24;

/** Tells the page's style how wide the bars are: where two pictures stand side by side, they leave that free. */
export function leaveRoomFor(bars: HTMLElement, pictures: HTMLElement): void {
  pictures.style.setProperty("--bars-width", `${bars.offsetWidth > 0 ? bars.offsetWidth + AROUND_BARS : 0}px`);
}

/** The most of the picture that is left free for what lies over it, across and down. */
const MOST = 0.4;
/** A picture that is narrower has nothing to spare beside it. */
const NARROW = 480;

/** How much of the picture the tools at its top and the bars at its right lie over. */
export function coveredBy(picture: HTMLElement, tools: HTMLElement, bars: HTMLElement): Covered {
  const [box, above, beside] = [picture, tools, bars].map((element) => element.getBoundingClientRect()) as [DOMRect, DOMRect, DOMRect];
  const part = (size: number, of: number): number => (of > 0 ? Math.min(MOST, Math.max(0, size / of)) : 0);
  return {
    left: 0, bottom: 0,
    top: above.height > 0 ? part(above.bottom - box.top, box.height) : 0,
    right: beside.width > 0 && box.width >= NARROW ? part(box.right - beside.left, box.width) : 0,
  };
}
