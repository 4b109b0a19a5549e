/** What is drawn over the picture while a shape is shaped by hand: the parts that can be gripped, and the number at the cursor. */
import "./handles.css";
import { element, svg } from "../dom";
import type { GizmoPart, Shape } from "./gizmo";
import { samePart } from "./gizmo";
import { AXIS_NAMES } from "./vector";
import type { Place } from "./projection";

const written = (line: readonly Place[], end: string): string => line.length === 0 ? ""
  : `M${line.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join("L")}${end}`;

export class Overlay {
  readonly root = svg("svg", { class: "gizmo", "aria-hidden": "true" });
  private readonly parts = svg("g");
  private readonly paths: { lines: SVGPathElement; fill: SVGPathElement }[] = [];

  constructor(stage: HTMLElement, before: Element | null) {
    this.root.append(this.parts);
    stage.insertBefore(this.root, before);
  }

  /** Draws the parts, the one under the pointer brighter; none takes them away. */
  show(shapes: readonly Shape[], hovered: GizmoPart | null): void {
    while (this.paths.length < shapes.length) {
      const pair = { lines: svg("path", { fill: "none" }), fill: svg("path") };
      this.parts.append(pair.lines, pair.fill);
      this.paths.push(pair);
    }
    this.paths.forEach(({ lines, fill }, i) => {
      const shape = shapes[i];
      const name = shape ? `${shape.part.kind} ${AXIS_NAMES[shape.part.axis]}${samePart(shape.part, hovered) ? " hovered" : ""}` : "";
      for (const [path, way] of [[lines, shape?.lines.map((line) => written(line, "")).join("") ?? ""], [fill, shape?.fill ? written(shape.fill, "Z") : ""]] as const) {
        if (path.getAttribute("class") !== name) path.setAttribute("class", name);
        if (path.getAttribute("d") !== way) path.setAttribute("d", way);
      }
    });
  }
}

export interface ValueEvents {
  typed(text: string): void;
  /** A key of the box that is none of the number. */
  key(event: KeyboardEvent): void;
}

/** The number at the cursor, into which another can be typed. */
export class ValueBox {
  readonly root: HTMLElement;
  private readonly label = element("span");
  private readonly unit = element("span");
  private readonly input: HTMLInputElement;

  constructor(private readonly stage: HTMLElement, events: ValueEvents) {
    this.input = element("input", {
      type: "text", inputmode: "decimal", autocomplete: "off", spellcheck: "false", "aria-label": "amount of the gesture",
      oninput: () => events.typed(this.input.value), onkeydown: (event) => events.key(event as KeyboardEvent),
    });
    this.root = element("label", { class: "gizmo-value", hidden: true }, this.label, this.input, this.unit);
    stage.append(this.root);
  }

  get isFocused(): boolean {
    return document.activeElement === this.input;
  }

  get isShown(): boolean {
    return !this.root.hidden;
  }

  /** Shows an amount beside a place of the picture. */
  show(label: string, text: string, unit: string, [x, y]: Place): void {
    this.root.hidden = false;
    this.label.textContent = label;
    this.unit.textContent = unit;
    if (!this.isFocused) this.input.value = text;
    this.input.style.width = `${Math.max(5, this.input.value.length + 1)}ch`;
    const { clientWidth, clientHeight } = this.stage;
    this.root.style.left = `${Math.max(4, Math.min(x + 16, clientWidth - this.root.offsetWidth - 6))}px`;
    this.root.style.top = `${Math.max(4, Math.min(y + 18, clientHeight - this.root.offsetHeight - 6))}px`;
  }

  /** Marks what is typed as a number or as none. */
  judge(isValid: boolean): void {
    this.input.setAttribute("aria-invalid", String(!isValid));
  }

  /** Takes the key that is being pressed as the first of a number. */
  beginTyping(): void {
    this.input.value = "";
    this.input.focus({ preventScroll: true });
  }

  /** Has the whole number chosen, so that the next key replaces it. */
  choose(): void {
    this.input.focus({ preventScroll: true });
    this.input.select();
  }

  hide(): void {
    if (this.root.hidden) return;
    this.input.blur();
    this.root.hidden = true;
    this.judge(true);
  }
}
