/**
 * Choosing faces as the handle: with a lasso, a rectangle, a brush, or as far as the surface turns by no more than an angle. What
 * is chosen is the `region` of the edit in the form.
 */
import type { Json, Vector } from "../connection/protocol";
import { element, identifier, isSheetOpen, svg, textField } from "../dom";
import { readNumber } from "../number";
import type { ShownPoints } from "../preview/previewer";
import type { Action } from "../store/actions";
import { bodyOf, chosen, kindOf } from "../store/draft";
import type { State } from "../store/state";
import { sameJson } from "../store/store";
import type { Store } from "../store/store";
import { giveToCamera, isForCamera } from "./camera-press";
import { boxRegionOf, combined, grown, meantBy, neighboursOf, pointsOf, regionOf } from "./face-choice";
import type { Mode } from "./face-choice";
import { contains, distance, reachOf } from "./gizmo";
import { boxOf } from "./handle-box";
import type { ShapeRegion } from "./shape-target";
import type { Place, Projection } from "./projection";
import { VisibleFaces } from "./visible-faces";

const TOOLS = { lasso: "Lasso", rectangle: "Rectangle", brush: "Brush", angle: "By angle" } as const;
type Tool = keyof typeof TOOLS;
const TITLES: Record<Tool, string> = {
  lasso: "Draw around faces", rectangle: "Draw a rectangle over faces", brush: "Paint faces", angle: "Click a face: all that the surface reaches without a sharper edge",
};
const BRUSH = 14, ANGLE = 30;

/** What choosing faces needs of the picture. */
export interface FacePicture {
  projection(): Projection;
  setChosenFaces(points: Float32Array, corners: Uint32Array): void;
}

/** `down` is the event that began it. */
interface Stroke { down: PointerEvent; mode: Mode; path: Place[]; faces: Set<number>; before: ReadonlySet<number>; seen: VisibleFaces }

let strokes = 0;

export class FaceTools implements ShapeRegion {
  private tool: Tool | null = null;
  private stroke: Stroke | null = null;
  private surface: ShownPoints | null = null;
  private neighbours: Int32Array | null = null;
  private meant: { region: Json; faces: ReadonlySet<number>; points: ReadonlySet<number> } | null = null;
  private box: { points: Float32Array; meant: object; names: readonly string[]; bounds: [Vector, Vector] | null } | null = null;
  private seen: { points: Float32Array; triangles: Uint32Array; key: string; faces: VisibleFaces } | null = null;
  private readonly bar = element("div", { class: "face-tools", role: "toolbar", "aria-label": "Choosing faces", hidden: true });
  private readonly buttons: Record<Tool, HTMLButtonElement>;
  private readonly mode = element("select", { "aria-label": "what a stroke does" },
    element("option", { value: "replace" }, "new"), element("option", { value: "add" }, "add"), element("option", { value: "take" }, "take away"));
  private readonly size = element("input", { type: "text", inputmode: "decimal" });
  private readonly sizeLabel = element("label");
  private readonly through = element("input", { type: "checkbox", id: identifier("through") });
  private readonly count = element("output");
  private readonly outline = svg("path", { class: "stroke", fill: "none" });
  private readonly sizes = { brush: BRUSH, angle: ANGLE };

  /** `toggle` is the button that shows the tools; `overlay` is drawn over the picture. `askSurface` calls a listener with its points. */
  constructor(
    private readonly stage: HTMLElement, private readonly scene: HTMLElement, overlay: SVGElement, private readonly toggle: HTMLElement,
    private readonly picture: FacePicture, private readonly store: Store<State, Action>,
    private readonly askSurface: (listener: (surface: ShownPoints) => void) => void, private readonly changed: () => void,
  ) {
    overlay.append(this.outline);
    const button = (tool: Tool): HTMLButtonElement =>
      element("button", { type: "button", title: TITLES[tool], "aria-pressed": "false", onclick: () => this.choose(this.tool === tool ? null : tool) }, TOOLS[tool]);
    this.buttons = { lasso: button("lasso"), rectangle: button("rectangle"), brush: button("brush"), angle: button("angle") };
    this.size.id = identifier("size");
    this.sizeLabel.htmlFor = this.size.id;
    this.size.addEventListener("change", () => this.readSize());
    this.bar.append(
      ...Object.values(this.buttons), this.sizeLabel, this.size, this.mode,
      element("label", { title: "Faces that others hide too" }, this.through, "through"),
      element("button", { type: "button", title: "The box around the faces in their place", onclick: () => this.asBox() }, "As box"),
      element("button", { type: "button", onclick: () => this.clear() }, "Clear"), this.count,
    );
    toggle.parentElement?.append(this.bar);
    toggle.addEventListener("click", () => this.show(this.bar.hidden));
    stage.addEventListener("pointerdown", (event) => this.down(event), true);
    stage.addEventListener("pointermove", (event) => this.move(event), true);
    for (const kind of ["pointerup", "pointercancel"] as const) stage.addEventListener(kind, (event) => this.up(event), true);
    window.addEventListener("keydown", (event) => this.key(event));
    store.watch((state) => bodyOf(state.draft).region, () => this.follow());
    this.sayTool();
  }

  get isActive(): boolean {
    return this.tool !== null;
  }

  private show(shown: boolean): void {
    this.bar.hidden = !shown;
    this.toggle.setAttribute("aria-pressed", String(shown));
    this.choose(shown ? "lasso" : null);
    if (shown) this.ask();
  }

  private ask(): void {
    if (this.surface) return;
    this.askSurface((surface) => {
      if (surface.triangles !== this.surface?.triangles) this.neighbours = null;
      this.surface = surface;
      this.meant = null;
      this.follow();
    });
  }

  private choose(tool: Tool | null): void {
    this.tool = tool;
    this.stroke = null;
    this.sayTool();
    this.draw();
    this.scene.style.cursor = tool ? "crosshair" : "";
    this.changed();
  }

  private sayTool(): void {
    for (const [name, button] of Object.entries(this.buttons)) button.setAttribute("aria-pressed", String(name === this.tool));
    const sized = this.tool === "brush" || this.tool === "angle" ? this.tool : null;
    this.size.hidden = this.sizeLabel.hidden = sized === null;
    if (!sized) return;
    this.sizeLabel.textContent = sized === "brush" ? "pixels" : "degrees";
    this.size.value = String(this.sizes[sized]);
  }

  private readSize(): void {
    const value = readNumber(this.size.value);
    const sized = this.tool === "brush" ? "brush" : "angle";
    if (value !== null && value > 0 && value <= (sized === "brush" ? 200 : 180)) this.sizes[sized] = value;
    this.size.value = String(this.sizes[sized]);
  }

  /** The faces are numbered as the surface numbers them; where it has others than triangles only boxes can be said. */
  private get isNumbered(): boolean {
    return this.surface !== null && this.store.state.hello?.surface?.faces === this.surface.triangles.length / 3;
  }

  private placeOf(event: PointerEvent): Place {
    const { left, top } = this.scene.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  }

  private down(event: PointerEvent): void {
    if (!this.tool || !this.scene.contains(event.target as Node)) return;
    // The other buttons are the camera's.
    if (event.button !== 0 || isForCamera(event)) return;
    // A finger beside another one is the camera's, as the first is.
    if (event.pointerType === "touch" && !event.isPrimary && (!this.stroke || this.handOver(this.stroke))) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    if (this.stroke || !this.surface) return;
    this.stage.setPointerCapture(event.pointerId);
    const mode = event.altKey ? "take" : event.shiftKey ? "add" : this.mode.value as Mode;
    const seen = this.visible(this.surface, this.picture.projection());
    this.stroke = { down: event, mode, path: [this.placeOf(event)], faces: new Set(), before: this.meant?.faces ?? new Set(), seen };
    this.extend(this.placeOf(event));
  }

  /** A second finger has come: as long as the first has not gone far, both are meant for the camera, which has not seen the first. */
  private handOver({ down, path }: Stroke): boolean {
    const isFar = path.some((place) => distance(place, path[0]!) > reachOf(down.pointerType));
    if (down.pointerType !== "touch" || isFar) return false;
    this.giveUp();
    giveToCamera(down);
    return true;
  }

  /** A stroke comes to nothing. */
  private giveUp(): void {
    this.stroke = null;
    this.draw();
    this.paint(this.meant?.faces ?? new Set());
  }

  private move(event: PointerEvent): void {
    if (!this.tool) return;
    if (!this.stroke) {
      if (event.buttons === 0 && this.scene.contains(event.target as Node)) event.stopImmediatePropagation();
      return;
    }
    event.stopImmediatePropagation();
    if (event.pointerId === this.stroke.down.pointerId) this.extend(this.placeOf(event));
  }

  private up(event: PointerEvent): void {
    const { stroke } = this;
    if (!stroke || event.pointerId !== stroke.down.pointerId) return;
    event.stopImmediatePropagation();
    if (event.type !== "pointerup") return this.giveUp();
    this.stroke = null;
    this.draw();
    this.take(stroke);
  }

  private key(event: KeyboardEvent): void {
    // What has done something with the key already was meant by it, such as a row that is dragged.
    if (event.key !== "Escape" || event.defaultPrevented || !this.tool || isSheetOpen()) return;
    // What somebody types elsewhere is left with the key.
    const field = textField(event.target);
    if (field && !this.stroke && !this.bar.contains(field)) return;
    event.preventDefault();
    if (this.stroke) this.giveUp();
    else this.show(false);
  }

  private extend(place: Place): void {
    const { stroke, surface } = this;
    if (!stroke || !surface) return;
    const last = stroke.path.at(-1)!;
    if (this.tool === "rectangle") stroke.path = [stroke.path[0]!, place];
    else if (distance(last, place) >= 2) stroke.path.push(place);
    if (this.tool === "brush") {
      // A quick hand leaves no gaps.
      const steps = Math.max(1, Math.ceil(distance(last, place) / this.sizes.brush));
      for (let i = 1; i <= steps; i++) {
        const at: Place = [last[0] + ((place[0] - last[0]) * i) / steps, last[1] + ((place[1] - last[1]) * i) / steps];
        const found = this.through.checked ? stroke.seen.within((other) => distance(other, at) <= this.sizes.brush, true) : stroke.seen.around(at, this.sizes.brush);
        for (const face of found) stroke.faces.add(face);
      }
      this.paint(combined(stroke.before, stroke.faces, stroke.mode));
    }
    this.draw();
  }

  /** A stroke has ended: what it means is chosen. */
  private take(stroke: Stroke): void {
    const { surface, tool } = this;
    if (!surface || !tool) return;
    let { faces } = stroke;
    if (tool === "angle") {
      const from = stroke.seen.at(stroke.path[0]!);
      if (from === null) return;
      this.neighbours ??= neighboursOf(surface.triangles);
      faces = grown(surface.points, surface.triangles, this.neighbours, from, this.sizes.angle);
    } else if (tool !== "brush") {
      const outline = this.outlineOf(stroke);
      faces = stroke.seen.within((place) => contains(outline, place), this.through.checked);
    }
    const result = combined(stroke.before, faces, stroke.mode);
    this.compose(this.isNumbered ? regionOf(result) : boxRegionOf(result, surface.triangles, surface.reference));
  }

  private outlineOf({ path }: Stroke): Place[] {
    if (this.tool !== "rectangle") return path;
    const [[ax, ay], [bx, by]] = [path[0]!, path.at(-1)!];
    return [[ax, ay], [bx, ay], [bx, by], [ax, by]];
  }

  private asBox(): void {
    const region = this.surface && this.meant ? boxRegionOf(this.meant.faces, this.surface.triangles, this.surface.reference) : null;
    if (region) this.compose(region);
  }

  private clear(): void {
    if (this.meant) this.compose(null);
  }

  /** The region stands in the form; features that were the handle make way for it. */
  private compose(region: Json): void {
    const { state } = this.store;
    const kind = kindOf(state, state.draft.key);
    const has = kind?.field.kind === "object" && kind.field.properties.some(({ name }) => name === "region");
    const whole = chosen(state, "handle");
    this.store.dispatch({ type: "composed", key: has ? kind.key : "translate", values: { region }, step: `faces ${++strokes}` });
    if (region !== null && !this.meantBefore(state)) for (const feature of whole) this.store.dispatch({ type: "part", feature, part: null });
  }

  private meantBefore({ draft }: State): boolean {
    const { region } = bodyOf(draft);
    return region !== undefined && region !== null;
  }

  /** Keeps what the region in the form means. */
  private follow(): void {
    const region = bodyOf(this.store.state.draft).region ?? null;
    if (region !== null && !this.surface) this.ask();
    if (!this.surface || this.meant?.region === region) {
      if (region !== null) return;
    }
    const found = this.surface && region !== null ? meantBy(region, this.surface.triangles, this.surface.reference) : null;
    this.meant = found && { region, ...found };
    this.paint(found?.faces ?? new Set());
    const count = found?.faces.size ?? 0;
    this.count.textContent = count === 0 ? "" : `${count} ${count === 1 ? "face" : "faces"}${this.isNumbered ? "" : ", as a box"}`;
    this.changed();
  }

  private paint(faces: ReadonlySet<number>): void {
    const { surface } = this;
    if (!surface) return;
    const corners = new Uint32Array(3 * faces.size);
    let at = 0;
    for (const face of faces) for (let k = 3 * face; k < 3 * face + 3; k++) corners[at++] = surface.triangles[k]!;
    this.picture.setChosenFaces(surface.points, corners);
  }

  private draw(): void {
    const { stroke } = this;
    if (!stroke || this.tool === "angle") return this.outline.setAttribute("d", "");
    if (this.tool === "brush") {
      const [x, y] = stroke.path.at(-1)!, r = this.sizes.brush;
      return this.outline.setAttribute("d", `M${x - r},${y}a${r},${r} 0 1 0 ${2 * r},0a${r},${r} 0 1 0 ${-2 * r},0`);
    }
    this.outline.setAttribute("d", `M${this.outlineOf(stroke).map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join("L")}Z`);
  }

  /** Whether the form says a region. */
  get hasRegion(): boolean {
    return this.meantBefore(this.store.state);
  }

  /** The box around what of the chosen features lies in the region, in the shape that is; null before that is known. */
  bounds(): [Vector, Vector] | null {
    const { surface, meant } = this;
    if (!surface || !meant) return null;
    const names = chosen(this.store.state, "handle");
    const { box } = this;
    if (box?.points === surface.points && box.meant === meant && sameJson(box.names, names)) return box.bounds;
    this.box = { points: surface.points, meant, names, bounds: boxOf(surface.points, this.pointsIn(surface, meant.points, names)) };
    return this.box.bounds;
  }

  /** Those of some points that belong to some features; all where none is named. */
  private pointsIn(surface: ShownPoints, points: Iterable<number>, names: readonly string[]): Iterable<number> {
    if (names.length === 0) return points;
    const wanted = new Set(names.map((name) => surface.features.indexOf(name)));
    const own = pointsOf(surface.triangles, [...surface.triangleFeatures.keys()].filter((face) => wanted.has(surface.triangleFeatures[face]!)));
    return [...points].filter((point) => own.has(point));
  }

  /** What is seen of a surface. It is drawn once for each shape and place to look from, for every press asks. */
  private visible({ points, triangles }: ShownPoints, projection: Projection): VisibleFaces {
    const { key } = projection;
    if (this.seen?.points !== points || this.seen.triangles !== triangles || this.seen.key !== key) {
      this.seen = { points, triangles, key, faces: new VisibleFaces(points, triangles, projection) };
    }
    return this.seen.faces;
  }

  /** The point of the chosen faces that is seen at a place; null where another face is, or none. */
  pick(place: Place): Vector | null {
    const { surface, meant } = this;
    if (!surface || !meant) return null;
    const projection = this.picture.projection();
    const face = this.visible(surface, projection).at(place);
    if (face === null || !meant.faces.has(face)) return null;
    const corner = surface.triangles[3 * face]!;
    return projection.toSpace(place, projection.depth([surface.points[3 * corner]!, surface.points[3 * corner + 1]!, surface.points[3 * corner + 2]!]));
  }
}
