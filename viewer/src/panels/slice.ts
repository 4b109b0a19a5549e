/** Where the slice of the chosen view lies: along which axis, and how far. The run is asked to cut elsewhere. */
import type { Pipelines } from "../connection/pipelines";
import type { Vector } from "../connection/protocol";
import { element, identifier, write } from "../dom";
import { mark } from "../form/controls";
import { digits, readNumber, whyNoNumber } from "../number";
import { own } from "../own";
import { atOffset, extent, leadingPlane, offsetOf, planesOf, whyNotMoved, withPlane } from "../store/pipelines";
import type { Plane } from "../store/pipelines";
import type { Sliced } from "../picture/slice-handle";
import { whyNotSteering } from "../store/run";
import type { Action } from "../store/actions";
import type { State } from "../store/state";
import type { Store } from "../store/store";

/** Steps of the slider from one end to the other. */
const STEPS = 200;

export class SlicePanel implements Sliced {
  private readonly slider = element("input", { type: "range", min: 0, max: STEPS, step: 1, "aria-label": "place of the slice along its normal", oninput: () => this.slide() });
  private readonly offset: HTMLInputElement = element("input", { type: "text", inputmode: "decimal", autocomplete: "off", id: identifier("offset"), onchange: () => this.typed() });
  private readonly wrong = element("small", { class: "wrong", hidden: true, role: "alert", id: identifier("wrong") });
  private readonly note = element("p", { class: "hint" });
  private readonly axes: HTMLButtonElement[];
  /** What moves the slice. */
  private readonly movers: HTMLElement[];
  /** Where the slice of the chosen view lies, as far as is known. */
  private plane: Plane | null = null;
  /** The slice for which something wrong was typed: it stays there, with the reason, until there is another one. */
  private typedFor = "";
  /** Between which offsets the slider was placed. */
  private reach = "";

  /** `bounds` is the box around all that is there. */
  constructor(private readonly root: HTMLElement, private readonly store: Store<State, Action>, private readonly pipelines: Pipelines, private readonly bounds: () => [Vector, Vector] | null) {
    this.axes = ["x", "y", "z"].map((name, axis) => element("button", { type: "button", class: "small", title: `Cut across ${name}`, onclick: () => this.across(axis) }, name));
    this.movers = [
      element("div", { class: "field" }, element("span", { class: "label" }, "across"), element("div", { class: "axes", role: "group", "aria-label": "Cut across" }, ...this.axes)),
      element("div", { class: "field" }, element("label", { for: this.offset.id }, "offset"), this.offset, this.wrong), this.slider,
    ];
    root.replaceChildren(element("h2", {}, "Slice"), ...this.movers, this.note);
    pipelines.onChange(() => this.show());
    store.watch((state) => state.chosenView, () => this.show());
    store.watch(whyNotSteering, () => this.show());
  }

  private show(): void {
    const why = whyNotSteering(this.store.state);
    const pipeline = this.pipelines.get(this.store.state.chosenView);
    this.plane = leadingPlane(pipeline);
    const fixed = whyNotMoved(pipeline);
    this.root.hidden = this.plane === null && fixed === "";
    for (const mover of this.movers) mover.hidden = fixed !== "";
    for (const control of [this.slider, this.offset, ...this.axes]) control.disabled = why !== "";
    const count = planesOf(pipeline).length;
    write(this.note, [
      fixed === "" ? "" : `${fixed} It is changed under Pipelines.`,
      this.plane && count > 1 ? `${count} planes move together; the offset is that of the first.` : "",
      why === "" || !this.plane ? "" : `The slice is where the run cuts. ${why}`,
    ].filter((text) => text !== "").join(" "));
    this.note.hidden = this.note.textContent === "";
    const { plane } = this;
    if (!plane) return;
    const size = Math.max(...plane.normal.map(Math.abs));
    this.axes.forEach((button, axis) => button.setAttribute("aria-pressed", String(plane.normal.every((part, k) => k === axis || Math.abs(part) < 1e-9 * size))));
    const offset = offsetOf(plane);
    if (this.typedFor !== this.shown) mark(this.offset, this.wrong, "");
    if (document.activeElement !== this.offset && this.wrong.hidden) this.offset.value = digits(offset, 5);
    const ends = this.ends(plane);
    if (ends) this.slider.value = String(Math.round((STEPS * (offset - ends[0])) / (ends[1] - ends[0])));
  }

  /** Something else is drawn: how far the slice can go may be another distance. */
  drawn(): void {
    const ends = JSON.stringify(this.plane && this.ends(this.plane));
    if (ends === this.reach) return;
    this.reach = ends;
    this.show();
  }

  private get shown(): string {
    return JSON.stringify([this.store.state.chosenView, this.plane]);
  }

  private ends({ normal }: Plane): [number, number] | null {
    const box = this.bounds();
    const found = box && extent(box, normal);
    return found && found[1] > found[0] ? found : null;
  }

  private across(axis: number): void {
    const box = this.bounds();
    if (!box) return;
    const normal = [0, 1, 2].map((k) => (k === axis ? 1 : 0)) as Vector;
    // What a view holds is rounded: the middle of a symmetric shape is 0 all the same.
    const quantum = 1e-4 * Math.max(...[0, 1, 2].map((k) => box[1][k]! - box[0][k]!)) || 1;
    this.move({ origin: [0, 1, 2].map((k) => Math.round((box[0][k]! + box[1][k]!) / 2 / quantum) * quantum + 0) as Vector, normal });
  }

  private slide(): void {
    const ends = this.plane && this.ends(this.plane);
    // The ends themselves are the surface: there is nothing to cut.
    if (this.plane && ends) this.move(atOffset(this.plane, ends[0] + ((0.5 + Number(this.slider.value)) / (STEPS + 1)) * (ends[1] - ends[0])));
  }

  private typed(): void {
    const { plane } = this;
    const offset = readNumber(this.offset.value);
    this.typedFor = this.shown;
    mark(this.offset, this.wrong, offset === null ? `The offset ${whyNoNumber(this.offset.value)}.` : plane ? this.whyNoCut(plane, offset) : "");
    if (plane && offset !== null && this.wrong.hidden) this.move(atOffset(plane, offset));
  }

  /** Why there is nothing to cut at an offset; empty where there may be something. */
  private whyNoCut({ normal }: Plane, offset: number): string {
    const features = this.store.state.hello?.features ?? [];
    const seen = this.bounds();
    // Slices alone do not tell how far the domain goes.
    if (features.length === 0) return "";
    const reaches = [...features.map(({ bounds }) => bounds), ...(seen ? [seen] : [])].map((box) => extent(box, normal));
    const [low, high] = [Math.min(...reaches.map(([from]) => from)), Math.max(...reaches.map(([, to]) => to))];
    // The ends themselves are the surface, and rounded.
    const room = 1e-6 * (high - low);
    return offset > low + room && offset < high - room ? "" : `Nothing is cut there: the domain goes from ${digits(low)} to ${digits(high)}.`;
  }

  get movable(): Plane | null {
    return whyNotSteering(this.store.state) === "" && own(this.store.state.looks, this.store.state.chosenView ?? "")?.visible === true ? this.plane : null;
  }

  /** Has the run cut there. */
  move(plane: Plane): void {
    const pipeline = this.pipelines.get(this.store.state.chosenView);
    if (!pipeline) return;
    this.pipelines.set(withPlane(pipeline, plane));
    this.show();
  }
}
