/** Bending the skeleton by numbers: a node, an angle and a plane are one edit. Stands below the toolbar while the skeleton is shown. */
import type { Vector } from "../connection/protocol";
import { element, identifier } from "../dom";
import type { Values } from "../form/schema";
import { readNumber } from "../number";
import type { Action } from "../store/actions";
import type { State } from "../store/state";
import type { Store } from "../store/store";
import { PLANES } from "./bend";
import { toStep } from "./rounding";

const DEGREES = 20;
const OF_THE_PICTURE = "picture";

/** The nodes that can be bent at. */
export interface Bendable {
  readonly choices: readonly { index: number; name: string }[];
  readonly alone: number | null;
  choose(index: number): void;
  bend(index: number, axis: Vector, degrees: number): { key: string; values: Values } | null;
}

let bends = 0;

export class BendTool {
  private readonly node = element("select", { onchange: () => this.chosen() });
  private readonly degrees = element("input", { type: "text", inputmode: "decimal", autocomplete: "off", value: String(DEGREES), "aria-label": "degrees of the bend", onkeydown: (event) => this.key(event as KeyboardEvent) });
  private readonly plane = element("select", {}, ...Object.keys(PLANES).map((name) => element("option", { value: name }, name)), element("option", { value: OF_THE_PICTURE }, "of the picture"));
  private readonly button = element("button", { type: "button", class: "bend", title: "Bends the branch at this node: one edit, which can be changed before it is applied", onclick: () => this.bend() }, "Bend");
  private readonly adding = element("button", { type: "button", title: "A press on another node adds it, as with shift: they move together", "aria-pressed": "false", onclick: () => this.adding.setAttribute("aria-pressed", String(!this.several)) }, "Several");
  private readonly bar: HTMLElement;
  private listed = "";

  /** `toward` is the direction from the picture to the one who looks; `changed` is called when another node is chosen here. */
  constructor(
    tools: HTMLElement, private readonly nodes: Bendable, private readonly toward: () => Vector,
    private readonly store: Store<State, Action>, private readonly changed: () => void,
  ) {
    this.node.id = identifier("bend-node");
    this.plane.id = identifier("bend-plane");
    this.bar = element("div", { class: "face-tools", role: "toolbar", "aria-label": "Bending the skeleton", hidden: true },
      element("label", { for: this.node.id }, "bend at"), this.node, element("label", {}, "by", this.degrees, "°"),
      element("label", { for: this.plane.id }, "in the plane"), this.plane, this.button, this.adding);
    tools.append(this.bar);
  }

  /** Whether a node that is pressed is meant beside those that are already. */
  get several(): boolean {
    return this.adding.getAttribute("aria-pressed") === "true";
  }

  /** The skeleton, the node that is meant, or neither is another one. */
  show(): void {
    const { choices, alone } = this.nodes;
    this.bar.hidden = choices.length === 0;
    const key = choices.map(({ index, name }) => `${index} ${name}`).join("\n");
    if (key !== this.listed) {
      this.listed = key;
      this.node.replaceChildren(element("option", { value: "" }, "click a node"), ...choices.map(({ index, name }) => element("option", { value: index }, name)));
    }
    const value = alone === null ? "" : String(alone);
    if (this.node.value !== value) this.node.value = value;
    this.button.disabled = alone === null;
  }

  private chosen(): void {
    this.nodes.choose(this.node.value === "" ? -1 : Number(this.node.value));
    this.changed();
  }

  private key(event: KeyboardEvent): void {
    if (event.key !== "Enter") return;
    event.preventDefault();
    this.bend();
  }

  private axis(): Vector {
    return PLANES[this.plane.value] ?? (this.toward().map((part) => toStep(part, 1e-6)) as Vector);
  }

  private bend(): void {
    const degrees = readNumber(this.degrees.value);
    const isAngle = degrees !== null && Math.abs(degrees) <= 180;
    this.degrees.setAttribute("aria-invalid", String(!isAngle));
    const { alone } = this.nodes;
    if (!isAngle || alone === null) return;
    const edit = this.nodes.bend(alone, this.axis(), degrees);
    if (edit) this.store.dispatch({ type: "composed", ...edit, step: `bend ${++bends}` });
  }
}
