/** What lies over the picture: axes, the name under the pointer, and the empty state. */
import { part, write } from "../dom";

const AXIS_COLOURS = ["#ff6b6b", "#6fdc7f", "#6ea8ff"];
const AXIS_NAMES = ["x", "y", "z"];

/** The directions of the axes on the screen, drawn in a corner. */
export class Triad {
  private readonly lines: SVGLineElement[] = [];
  private readonly names: SVGTextElement[] = [];

  constructor() {
    const make = <K extends "line" | "text">(tag: K): SVGElementTagNameMap[K] => document.createElementNS("http://www.w3.org/2000/svg", tag);
    AXIS_NAMES.forEach((name, i) => {
      const line = make("line");
      line.setAttribute("stroke", AXIS_COLOURS[i]!);
      line.setAttribute("stroke-width", "2");
      const label = make("text");
      label.textContent = name;
      label.setAttribute("fill", AXIS_COLOURS[i]!);
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
