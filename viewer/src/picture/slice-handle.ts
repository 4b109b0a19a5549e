/** The slice of the chosen view as something to drag: along its normal, in the picture. The panel beside it does the same by number and key. */
import type { Vector } from "../connection/protocol";
import { svg } from "../dom";
import { giveToCamera } from "../handles/camera-press";
import { closestAlong } from "../handles/projection";
import type { Projection } from "../handles/projection";
import { reachOf } from "../handles/gizmo";
import { add, across, AXES, dot, length, normalised, times } from "../handles/vector";
import { toStep } from "../handles/rounding";
import { atOffset, extent, offsetOf } from "../store/pipelines";
import type { Plane } from "../store/pipelines";
import { sameParts } from "../store/store";

/** How long the arrow is, in pixels. */
const ARROW = 46;

export interface Sliced {
  /** The plane of the chosen view; null where it has none, or it cannot be moved from here. */
  readonly movable: Plane | null;
  /** Has the run cut there. */
  move(plane: Plane): void;
}

export interface SlicePicture {
  projection(): Projection;
  /** The points of the slice, interleaved; none where it is not drawn. */
  points(): Float32Array;
  bounds(): [Vector, Vector] | null;
  redraw(): void;
}

export class SliceHandle {
  private readonly outline = svg("polygon", { class: "cut" });
  private readonly shaft = svg("line", { class: "shaft" });
  private readonly knob = svg("circle", { class: "knob", r: "7" });
  /** Around the knob, for fingers: the page's style lets it be gripped where there are any. */
  private readonly halo = svg("circle", { class: "halo", r: String(reachOf("touch")) });
  private readonly grip = svg("g", { class: "grip" });
  private readonly title = svg("title");
  /** The end of the slice that is seen farthest to the left, and of what it was sought. */
  private sought: { of: readonly unknown[]; end: Vector | null } = { of: [], end: null };
  /** `down` is the event that began it. */
  private drag: { down: PointerEvent; plane: Plane; from: number; start: number; offset: number } | null = null;

  constructor(root: SVGElement, private readonly scene: HTMLElement, private readonly picture: SlicePicture, private readonly slice: Sliced) {
    this.title.textContent = "Drag the slice along its normal";
    this.grip.append(this.title, this.halo, this.knob);
    root.append(this.outline, this.shaft, this.grip);
    this.grip.addEventListener("pointerdown", (event) => this.down(event));
    this.grip.addEventListener("pointermove", (event) => this.move(event));
    for (const kind of ["pointerup", "pointercancel"] as const) this.grip.addEventListener(kind, (event) => this.up(event));
    // Before the camera sees it.
    scene.addEventListener("pointerdown", (event) => { if (this.drag && !this.handOver(event, this.drag)) event.stopPropagation(); }, true);
  }

  /** The place of the page at which it can be gripped; null where there is none. */
  get place(): [number, number] | null {
    if (this.grip.style.display === "none") return null;
    const { left, top } = this.scene.getBoundingClientRect();
    return [left + Number(this.knob.getAttribute("cx")), top + Number(this.knob.getAttribute("cy"))];
  }

  /** Draws it where the picture is now seen from. */
  drawn(): void {
    const plane = this.drag ? atOffset(this.drag.plane, this.drag.offset) : this.slice.movable;
    const box = plane && this.picture.bounds();
    const cut = plane && box ? outlineOf(box, plane) : [];
    const projection = cut.length > 2 ? this.picture.projection() : null;
    const corners = projection ? cut.map((point) => projection.toPicture(point)) : [];
    const normal = plane && normalised(plane.normal);
    // At the end of the slice itself that is seen farthest to the left, where it hides little; it goes with the drag. Other planes may be cut with it.
    const at = projection && box ? this.leftEnd(plane, box, projection) : null;
    const by = this.drag && plane && at ? this.drag.offset - dot(at, normalised(plane.normal)) : 0;
    const point = at && normal ? add(at, times(normal, by)) : null;
    const from = point && projection ? projection.toPicture(point) : null;
    const pixel = projection && point ? projection.pixel(point) : NaN;
    const tip = projection && point && normal && pixel > 0 ? projection.toPicture(add(point, times(normal, ARROW * pixel))) : null;
    const isSeen = corners.length > 2 && corners.every((corner) => corner !== null) && tip !== null && from !== null;
    for (const shape of [this.outline, this.shaft, this.grip]) shape.style.display = isSeen ? "" : "none";
    this.outline.classList.toggle("dragged", this.drag !== null);
    if (!isSeen) return;
    // Seen along its normal there is nothing to drag along.
    const isShort = Math.hypot(tip[0] - from[0], tip[1] - from[1]) < 10;
    this.grip.style.display = this.shaft.style.display = isShort && !this.drag ? "none" : "";
    this.outline.setAttribute("points", corners.map((corner) => corner.map((part) => part.toFixed(1)).join(",")).join(" "));
    for (const [name, value] of [["x1", from[0]], ["y1", from[1]], ["x2", tip[0]], ["y2", tip[1]]] as const) this.shaft.setAttribute(name, value.toFixed(1));
    for (const circle of [this.halo, this.knob]) for (const [name, value] of [["cx", tip[0]], ["cy", tip[1]]] as const) circle.setAttribute(name, value.toFixed(1));
  }

  /** The end of the slice that is seen farthest to the left. It stays where it is as long as only values come. */
  private leftEnd(plane: Plane, box: readonly [Vector, Vector], projection: Projection): Vector | null {
    const points = this.picture.points();
    const of = [points, plane, projection.key, ...box[0], ...box[1]];
    if (!sameParts(of, this.sought.of)) this.sought = { of, end: leftmost(points, projection, near(plane, box)) ?? leftmost(points, projection) };
    return this.sought.end;
  }

  /** How far along the normal the pointer is, in units of the mesh. */
  private along(event: PointerEvent, plane: Plane): number | null {
    const { left, top } = this.scene.getBoundingClientRect();
    return closestAlong(this.picture.projection().ray([event.clientX - left, event.clientY - top]), plane.origin, normalised(plane.normal));
  }

  private down(event: PointerEvent): void {
    if (this.drag) {
      if (this.handOver(event, this.drag)) giveToCamera(event, this.scene);
      return;
    }
    const plane = this.slice.movable;
    if (!plane || event.button !== 0) return;
    const start = this.along(event, plane);
    if (start === null) return;
    event.preventDefault();
    event.stopPropagation();
    this.grip.setPointerCapture(event.pointerId);
    const from = offsetOf(plane);
    this.drag = { down: event, plane, from, start, offset: from };
  }

  /** A second finger has come: as long as the first has moved nothing, both are meant for the camera, which has not seen the first. */
  private handOver(second: PointerEvent, { down, from, offset }: NonNullable<typeof this.drag>): boolean {
    if (second.pointerType !== "touch" || down.pointerType !== "touch" || offset !== from) return false;
    this.drag = null;
    giveToCamera(down, this.scene);
    this.picture.redraw();
    return true;
  }

  private move(event: PointerEvent): void {
    const { drag } = this;
    if (!drag || drag.down.pointerId !== event.pointerId) return;
    event.stopPropagation();
    const now = this.along(event, drag.plane);
    const box = this.picture.bounds();
    if (now === null || !box) return;
    const [low, high] = extent(box, drag.plane.normal);
    // The ends themselves are the surface: there is nothing to cut. No more digits than the hand can mean.
    const room = 0.002 * (high - low), step = 10 ** Math.floor(Math.log10((high - low) / 1000 || 1));
    const offset = toStep(Math.min(high - room, Math.max(low + room, drag.from + now - drag.start)), step);
    if (offset === drag.offset) return;
    drag.offset = offset;
    this.slice.move(atOffset(drag.plane, offset));
    this.picture.redraw();
  }

  private up(event: PointerEvent): void {
    if (this.drag?.down.pointerId !== event.pointerId) return;
    event.stopPropagation();
    this.drag = null;
    this.picture.redraw();
  }
}

/** Of so many points one is looked at for each of these. */
const LOOKED_AT = 400;

/** The part of the whole by which the points of a slice may lie beside its plane: they come with less than all digits. */
const BESIDE = 2e-3;

/** Whether a point lies in a plane, as far as frames tell. */
function near(plane: Plane, box: readonly [Vector, Vector]): (point: Vector) => boolean {
  const [normal, offset] = [normalised(plane.normal), offsetOf(plane)];
  const [low, high] = extent(box, plane.normal);
  return (point) => Math.abs(dot(point, normal) - offset) <= BESIDE * (high - low);
}

/** The point that is seen farthest to the left, of a part of those that are wanted; null where none is seen. */
function leftmost(points: Float32Array, projection: Projection, isWanted: (point: Vector) => boolean = () => true): Vector | null {
  const stride = 3 * Math.max(1, Math.floor(points.length / 3 / LOOKED_AT));
  let best: Vector | null = null, least = Infinity;
  for (let i = 0; i + 2 < points.length; i += stride) {
    const point: Vector = [points[i]!, points[i + 1]!, points[i + 2]!];
    const place = isWanted(point) ? projection.toPicture(point) : null;
    if (!place || place[0] >= least) continue;
    [best, least] = [point, place[0]];
  }
  return best;
}

/** The corners of the cut of a box by a plane, in order around it; fewer than three where they do not meet. */
export function outlineOf([low, high]: readonly [Vector, Vector], plane: Plane): Vector[] {
  const normal = normalised(plane.normal);
  const offset = dot(plane.origin, normal);
  const points: Vector[] = [];
  for (const axis of AXES) {
    const [u, v] = across(axis);
    for (const a of [low[u], high[u]]) {
      for (const b of [low[v], high[v]]) {
        if (Math.abs(normal[axis]) < 1e-12) continue;
        const rest = normal[u] * a + normal[v] * b;
        const at = (offset - rest) / normal[axis];
        if (at < low[axis] || at > high[axis]) continue;
        const point: Vector = [0, 0, 0];
        [point[axis], point[u], point[v]] = [at, a, b];
        if (!points.some((other) => length(add(other, times(point, -1))) < 1e-9 * length(add(high, times(low, -1))))) points.push(point);
      }
    }
  }
  const middle = times(points.reduce(add, [0, 0, 0]), 1 / Math.max(1, points.length));
  const first = points[0] ? normalised(add(points[0], times(middle, -1))) : ([0, 0, 0] as Vector);
  const second: Vector = [normal[1] * first[2] - normal[2] * first[1], normal[2] * first[0] - normal[0] * first[2], normal[0] * first[1] - normal[1] * first[0]];
  const angle = (point: Vector): number => Math.atan2(dot(add(point, times(middle, -1)), second), dot(add(point, times(middle, -1)), first));
  return points.sort((a, b) => angle(a) - angle(b));
}
