/**
 * Shaping by hand: the gizmo at the middle of the handle, and the gestures on it by mouse, touch, pen and keyboard. A gesture
 * composes the edit in the form; the preview and the forecast follow from there.
 */
import type { Vector } from "../connection/protocol";
import { isSheetOpen, textField } from "../dom";
import { showTip } from "../picture/overlay";
import type { Action } from "../store/actions";
import type { Bones } from "../picture/skeleton";
import type { Selection } from "../store/selection";
import type { State } from "../store/state";
import type { Store } from "../store/store";
import { BendTool } from "./bend-tool";
import { giveToCamera, isForCamera } from "./camera-press";
import { Gesture, amountText } from "./gesture";
import type { Composer } from "./gesture";
import { distance, gizmoShapes, partAt, reachOf, samePart } from "./gizmo";
import type { GizmoPart, PartKind, Shape } from "./gizmo";
import { axesOf } from "./motion";
import type { Lock } from "./motion";
import { ValueBox } from "./overlay";
import type { Overlay } from "./overlay";
import type { Place, Projection } from "./projection";
import { SkeletonTarget } from "./skeleton-target";
import type { ShapeTarget } from "./shape-target";
import { AXIS_NAMES, times } from "./vector";
import type { Axis } from "./vector";

/** What gestures need of the picture. */
export interface Picture {
  projection(): Projection;
  pick(clientX: number, clientY: number): { feature: string; point: Vector } | null;
  /** The skeleton that is drawn; null when there is none. */
  readonly shownBones: Bones | null;
}

/** Something that can be gripped: the handle, or nodes of the skeleton. */
export interface Target {
  /** The parts of its gizmo. */
  readonly kinds: readonly PartKind[];
  /** Where its gizmo is drawn; null where there is nothing to grip. */
  center(): Vector | null;
  /** What a gesture that begins now is a gesture on. */
  begin(): Composer | null;
  /** The unit of lengths; empty where it is not known. */
  unit(): string;
}

/** How far the pointer goes before a press is a drag. */
const CLICK_DISTANCE = 4;
/** How large a node is that is met exactly. */
const NODE = 6;
const STARTS: Record<string, PartKind> = { g: "arrow", t: "ring", e: "box" };

/** `down` is the event that began it, `nodes` are those of the skeleton that were meant before. */
interface Press { pointer: number; at: Place; last: Place; withControl: boolean; click: (() => void) | null; down: PointerEvent; nodes: readonly number[] }

let gestures = 0;

export class Handles {
  private readonly grippable: SkeletonTarget;
  private readonly bending: BendTool;
  private readonly box: ValueBox;
  private shapes: Shape[] = [];
  private hovered: GizmoPart | null = null;
  private gesture: Gesture | null = null;
  /** The pointer that is down; null while a gesture rests and its number can be typed. */
  private press: Press | null = null;
  private cursor: Place = [0, 0];
  private unit = "";

  /** Where a node of the skeleton is meant it has the gizmo, and the handle otherwise. */
  constructor(
    private readonly stage: HTMLElement, private readonly scene: HTMLElement, private readonly picture: Picture,
    private readonly store: Store<State, Action>, private readonly selection: Selection,
    private readonly shape: ShapeTarget, private readonly overlay: Overlay, tools: HTMLElement,
    /** Whether clicks mean something else now, such as a ruler. */
    private readonly isHeldBack: () => boolean = () => false,
  ) {
    this.grippable = new SkeletonTarget(this.overlay.root, () => store.state, picture);
    this.bending = new BendTool(tools, this.grippable, () => times(picture.projection().direction, -1), store, () => this.drawn());
    this.box = new ValueBox(stage, { typed: (text) => this.typed(text), key: (event) => this.key(event) });
    // Before the camera sees them.
    stage.addEventListener("pointerdown", (event) => this.down(event), true);
    stage.addEventListener("pointermove", (event) => this.move(event), true);
    stage.addEventListener("pointerup", (event) => this.up(event), true);
    stage.addEventListener("pointercancel", (event) => { if (this.press?.pointer === event.pointerId) this.abort(); }, true);
    window.addEventListener("keydown", (event) => { if (!this.box.isFocused) this.key(event); }, true);
    window.addEventListener("keyup", (event) => { if (event.key === "Shift" || event.key === "Control" || event.key === "Meta") this.modified(event); }, true);
    // A click elsewhere on the page keeps what was asked for.
    window.addEventListener("pointerdown", (event) => { if (!stage.contains(event.target as Node)) this.finish(); }, true);
    store.watch((state) => state.draft.step, (step) => { if (this.gesture?.hasMoved && !this.press && step !== this.gesture.step) this.close(); });
    store.watch((state) => state.selection.parts, () => this.drawn());
    store.watch((state) => state.draft, () => this.drawn());
  }

  /** Draws the gizmo where the picture is now seen from. */
  drawn(): void {
    this.grippable.drawn();
    this.bending.show();
    const grip = this.grip();
    this.shapes = grip ? gizmoShapes(this.picture.projection(), grip.center, grip.target.kinds) : [];
    this.overlay.show(this.shapes, this.gesture && this.gesture.lock.kind !== "free" ? this.gesture.lock : this.hovered);
  }

  /** Places of the page at which the parts of the gizmo can be gripped, by kind and axis, such as `arrow z`. */
  places(): Record<string, Place> {
    const { left, top } = this.scene.getBoundingClientRect();
    const result: Record<string, Place> = {};
    for (const { part, lines, fill } of this.shapes) {
      const line = lines.reduce<Place[]>((longest, other) => (other.length > longest.length ? other : longest), []);
      const points = fill ?? line;
      const middle: Place = [points.reduce((total, point) => total + point[0], 0) / points.length, points.reduce((total, point) => total + point[1], 0) / points.length];
      const own = part.kind === "ring" ? line : [middle, ...line];
      // Where another part lies over it, that one would be gripped.
      const [x, y] = own.find((place) => samePart(partAt(this.shapes, place, reachOf("mouse")), part)) ?? own[0] ?? [NaN, NaN];
      result[`${part.kind} ${AXIS_NAMES[part.axis]}`] = [left + x, top + y];
    }
    return result;
  }

  /** The places of the page of the nodes that can be dragged. */
  nodePlaces(): Place[] {
    const { left, top } = this.scene.getBoundingClientRect();
    return this.grippable.freePlaces().map(([x, y]) => [left + x, top + y]);
  }

  private target(): Target | null {
    return this.grip()?.target ?? null;
  }

  /** What can be gripped, and where its gizmo is. */
  private grip(): { target: Target; center: Vector } | null {
    // While the skeleton is shown the gizmo is its own.
    const target = this.picture.shownBones ? this.grippable : this.shape;
    const center = target.center();
    return center && { target, center };
  }

  /** Whether nothing of the gizmo lies at a place of the page. */
  isFree(clientX: number, clientY: number): boolean {
    return partAt(this.shapes, this.placeOf({ clientX, clientY }), reachOf("mouse")) === null;
  }

  private placeOf(event: { clientX: number; clientY: number }): Place {
    const { left, top } = this.scene.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  }

  private isOnPicture(event: Event): boolean {
    return this.scene.contains(event.target as Node);
  }

  private down(event: PointerEvent): void {
    if (this.box.root.contains(event.target as Node)) return;
    if (isForCamera(event)) return;
    if (this.press) {
      if (this.press.click && event.pointerType === "touch" && this.press.down.pointerType === "touch") return this.handOver(this.press);
      // Another finger has nothing to say while one drags.
      event.stopPropagation();
      return;
    }
    this.finish();
    if (event.button !== 0 || !this.isOnPicture(event) || this.isHeldBack()) return;
    // A finger beside another one is the camera's, as the first is.
    if (event.pointerType === "touch" && !event.isPrimary) return;
    const place = this.placeOf(event);
    const nodes = this.grippable.meantNodes;
    const begun = this.begun(event, place);
    if (!begun) return;
    event.stopPropagation();
    event.preventDefault();
    this.scene.focus({ preventScroll: true });
    this.stage.setPointerCapture(event.pointerId);
    this.cursor = place;
    const withControl = event.ctrlKey || event.metaKey;
    // With ctrl nothing but a drag is meant.
    this.press = { pointer: event.pointerId, at: place, last: place, withControl, click: withControl ? null : begun.click, down: event, nodes };
    this.selection.hovered = null;
    showTip(null, 0, 0);
  }

  /** A second finger has come before the first has dragged anything: both are meant for the camera, which has not seen the first. */
  private handOver(press: Press): void {
    this.press = null;
    this.close();
    this.grippable.mean(press.nodes);
    giveToCamera(press.down);
  }

  /** Begins what a press at a place is meant for; null where it is meant for the camera. */
  private begun(event: PointerEvent, place: Place): { click: (() => void) | null } | null {
    const reach = reachOf(event.pointerType);
    const control = event.ctrlKey || event.metaKey;
    // A node that is met exactly lies above the parts of another one's gizmo.
    const isOnNode = this.grippable.hover(place, NODE) !== null;
    const part = control || isOnNode ? null : partAt(this.shapes, place, reach);
    if (part) {
      const target = this.target();
      return target && this.begin(target, part, place) ? { click: () => this.rest() } : null;
    }
    const point = this.grippable.grip(place, isOnNode ? NODE : reach + 5, event.shiftKey || this.bending.several);
    if (point) return this.begin(this.grippable, { kind: "free" }, place, point) ? { click: () => this.close() } : null;
    if (event.shiftKey && !control) return null;
    const face = control ? null : this.shape.region.pick(place);
    if (face) return this.begin(this.shape, { kind: "free" }, place, face) ? { click: () => this.close() } : null;
    const picked = this.picture.pick(event.clientX, event.clientY);
    if (!picked) return null;
    const isHandle = this.selection.get(picked.feature) === "handle";
    if (!isHandle && !control) return null;
    if (!isHandle) this.selection.set(picked.feature, "handle");
    const click = (): void => {
      this.close();
      this.selection.toggle(picked.feature, "handle");
    };
    return this.begin(this.shape, { kind: "free" }, place, picked.point) ? { click } : null;
  }

  private begin(target: Target, lock: Lock, place: Place, point?: Vector): boolean {
    const composer = target.begin();
    if (!composer) return false;
    this.unit = target.unit();
    this.gesture = new Gesture(`handle ${++gestures}`, composer, lock, point ?? composer.pivot, place);
    return true;
  }

  private move(event: PointerEvent): void {
    const { press, gesture } = this;
    if (!press || press.pointer !== event.pointerId || !gesture) {
      if (press) event.stopPropagation();
      else if (event.buttons === 0) this.hover(event);
      return;
    }
    event.stopPropagation();
    const place = this.placeOf(event);
    if (press.click && distance(place, press.at) <= CLICK_DISTANCE) return;
    press.click = null;
    press.last = this.cursor = place;
    this.follow(event);
  }

  /** The keys that say how exactly a motion is meant. */
  private follow(event: { shiftKey: boolean; ctrlKey: boolean; metaKey: boolean }): void {
    const { press, gesture } = this;
    if (!press || !gesture || press.click) return;
    const control = event.ctrlKey || event.metaKey;
    // A drag that was begun with ctrl means no round steps until it is pressed anew.
    if (!control) press.withControl = false;
    gesture.moveTo(this.picture.projection(), press.last, { fine: event.shiftKey, snap: control && !press.withControl });
    this.say();
  }

  private modified(event: KeyboardEvent): void {
    this.follow(event);
  }

  private hover(event: PointerEvent): void {
    const isOnNode = this.isOnPicture(event) && this.grippable.hover(this.placeOf(event), NODE) !== null;
    const part = this.isOnPicture(event) && !isOnNode && !event.ctrlKey && !event.metaKey ? partAt(this.shapes, this.placeOf(event), reachOf(event.pointerType)) : null;
    if (!samePart(part, this.hovered)) {
      this.hovered = part;
      this.scene.style.cursor = part ? "grab" : "";
      this.overlay.show(this.shapes, part);
    }
    const place = this.isOnPicture(event) && !part ? this.placeOf(event) : null;
    const name = this.grippable.hover(place, reachOf(event.pointerType) + 5);
    if (name) {
      event.stopPropagation();
      this.selection.hovered = null;
      this.scene.style.cursor = "grab";
      showTip(name, event.clientX, event.clientY);
    }
    if (!part) return;
    // What lies behind it is not meant.
    event.stopPropagation();
    this.selection.hovered = null;
    showTip(null, 0, 0);
  }

  private up(event: PointerEvent): void {
    const { press } = this;
    if (!press) return;
    event.stopPropagation();
    if (press.pointer !== event.pointerId) return;
    this.press = null;
    if (press.click) press.click();
    else if (this.gesture?.hasMoved) this.rest();
    else this.close();
  }

  /** The pointer is up: the number stays, so that another can be typed. */
  private rest(): void {
    if (!this.gesture) return;
    this.showValue();
    this.drawn();
  }

  /** What is asked for is composed in the form. */
  private say(): void {
    const { gesture } = this;
    if (!gesture) return;
    const { key, values } = gesture.edit();
    this.store.dispatch({ type: "composed", key, values, step: gesture.step });
    this.showValue();
  }

  private showValue(): void {
    const { gesture } = this;
    if (!gesture) return;
    const { amount, lock } = gesture;
    const unit = amount.kind === "turn" ? "°" : amount.kind === "scale" ? "×" : this.unit;
    const axes = lock.kind === "ring" || lock.kind === "box" ? AXIS_NAMES[lock.axis] : axesOf(lock).map((axis) => AXIS_NAMES[axis]).join("  ");
    this.box.show(axes, amountText(amount, lock), unit, this.cursor);
  }

  private typed(text: string): void {
    const { gesture } = this;
    if (!gesture) return;
    const isAmount = gesture.type(text);
    this.box.judge(isAmount);
    if (isAmount) this.say();
  }

  private key(event: KeyboardEvent): void {
    const { gesture } = this;
    if (!gesture) return this.start(event);
    if (event.key === "Control" || event.key === "Meta" || event.key === "Shift") return this.modified(event);
    if (gesture.hasMoved && !this.press && event.key.toLowerCase() === "z" && (event.ctrlKey || event.metaKey)) return this.close();
    const target = event.target as HTMLElement | null;
    const isElsewhere = !this.box.isFocused && (textField(target) ?? target?.closest?.('input, select, button, summary, [role="slider"]'));
    if ((isElsewhere || isSheetOpen()) && !this.press) return;
    const axis = ["x", "y", "z"].indexOf(event.key.toLowerCase());
    // Applies what is seen: the key goes on to where that is done.
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) return this.close();
    if (event.key === "Escape") this.abort();
    else if (event.key === "Enter") this.finish();
    else if (event.ctrlKey || event.metaKey || event.altKey) return;
    else if (axis >= 0) {
      gesture.lockTo(this.picture.projection(), axis as Axis, event.shiftKey);
      if (gesture.hasMoved) this.say();
      else this.showValue();
      this.drawn();
    } else if (!this.box.isFocused && /^[-+.,\d]$/.test(event.key)) {
      if (this.press) this.press.click = null;
      this.showValue();
      // The key itself goes into the box.
      this.box.beginTyping();
      event.stopPropagation();
      return;
    } else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /** A gesture by the keyboard alone: its axis and its number are typed. */
  private start(event: KeyboardEvent): void {
    if (event.key === "Escape" && event.target === this.scene && this.grippable.release()) {
      event.preventDefault();
      return this.drawn();
    }
    const kind = STARTS[event.key];
    const target = this.target();
    if (!kind || !target || event.ctrlKey || event.metaKey || event.altKey || event.target !== this.scene) return;
    if (!target.kinds.includes(kind)) return;
    const center = target.center();
    const place = center && this.picture.projection().toPicture(center);
    if (!place || !this.begin(target, { kind, axis: 2 }, place)) return;
    this.cursor = place;
    this.rest();
    event.preventDefault();
    event.stopPropagation();
  }

  /** Ends a gesture and keeps what it asks for. */
  finish(): void {
    this.close();
  }

  private abort(): void {
    const step = this.gesture?.step;
    const hasMoved = this.gesture?.hasMoved ?? false;
    this.close();
    if (step !== undefined && hasMoved) this.store.dispatch({ type: "aborted", step });
  }

  private close(): void {
    if (!this.gesture) return;
    const wasTyping = this.box.isFocused;
    this.gesture = null;
    // The pointer may still be down: it moves nothing until it is pressed anew.
    if (this.press) this.press.click = null;
    this.box.hide();
    if (wasTyping) this.scene.focus({ preventScroll: true });
    this.drawn();
  }
}
