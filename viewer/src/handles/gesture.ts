/** One gesture on a handle: from what the pointer, the keys and typed text say to the amount that they ask for. */
import { readNumber } from "../number";
import type { Values } from "../form/schema";
import type { Vector } from "../connection/protocol";
import { axesOf, locked, measure } from "./motion";
import type { Amount, Grip, Lock } from "./motion";
import type { Place, Projection } from "./projection";
import { FINE, rounded, stepOf } from "./rounding";
import type { Precision } from "./rounding";
import { add, length, subtract, times } from "./vector";
import type { Axis } from "./vector";

/** What a gesture is a gesture on, as it was when the gesture began. */
export interface Composer {
  /** The point about which it turns and scales. */
  readonly pivot: Vector;
  /** What is asked for already, to which the gesture adds. */
  start(lock: Lock): Amount;
  /** The edit that asks for an amount. */
  compose(lock: Lock, amount: Amount): { key: string; values: Values };
}

export class Gesture {
  /** What is asked for now. */
  amount: Amount;
  /** Whether it was typed: the pointer says nothing any more. */
  get isTyped(): boolean {
    return this.text !== null;
  }
  /** Whether anything was asked for. */
  hasMoved = false;
  private readonly grip: Grip;
  /** Where the pointer would be, had it always moved as fast as with no key held; and where it is. */
  private virtual: Place;
  private last: Place;
  private degrees = 0;
  private text: string | null = null;
  private precision: Precision = { fine: false, snap: false };

  /** `step` names the gesture; `point` is the point of the handle that was gripped, drawn at `place`. */
  constructor(readonly step: string, readonly composer: Composer, public lock: Lock, point: Vector, place: Place) {
    this.grip = { center: composer.pivot, point, place };
    this.virtual = this.last = place;
    this.amount = composer.start(lock);
  }

  /** The pointer has moved, or a key says how exactly it is meant. */
  moveTo(projection: Projection, place: Place, precision: Precision): void {
    if (this.isTyped) return;
    const pace = precision.fine ? FINE : 1;
    this.virtual = [this.virtual[0] + pace * (place[0] - this.last[0]), this.virtual[1] + pace * (place[1] - this.last[1])];
    this.last = place;
    this.precision = precision;
    this.update(projection);
  }

  /** Locks it to an axis, or with `isAcross` to the plane across one. */
  lockTo(projection: Projection, axis: Axis, isAcross: boolean): void {
    this.lock = locked(this.lock, axis, isAcross);
    this.degrees = 0;
    this.amount = this.composer.start(this.lock);
    if (this.text === null || !this.type(this.text)) this.update(projection);
  }

  private update(projection: Projection): void {
    const drag = measure(projection, this.lock, this.grip, this.virtual, this.degrees);
    if (!drag) return;
    if (drag.kind === "turn") this.degrees = drag.degrees;
    const pixel = projection.pixel(this.grip.center);
    this.hasMoved ||= this.virtual[0] !== this.grip.place[0] || this.virtual[1] !== this.grip.place[1];
    this.amount = rounded(sum(this.composer.start(this.lock), drag), this.lock, stepOf(drag.kind, pixel, this.precision));
  }

  /** Takes typed text; returns whether it says an amount. */
  type(text: string): boolean {
    const amount = typedAmount(this.composer.start(this.lock), this.amount, this.lock, text);
    if (!amount) return false;
    this.text = text;
    this.hasMoved = true;
    this.amount = amount;
    return true;
  }

  edit(): { key: string; values: Values } {
    return this.composer.compose(this.lock, this.amount);
  }
}

/** An amount after another: translations and angles add up, factors multiply. */
export function sum(start: Amount, drag: Amount): Amount {
  if (start.kind === "move" && drag.kind === "move") return { kind: "move", by: add(start.by, drag.by) };
  if (start.kind === "turn" && drag.kind === "turn") return { kind: "turn", degrees: start.degrees + drag.degrees };
  if (start.kind === "scale" && drag.kind === "scale") return { kind: "scale", factor: start.factor * drag.factor };
  return drag;
}

/**
 * The amount that typed text asks for; null where it asks for none. One number is the value along the axis or, without a single
 * axis, the length of the present translation; several are those along the axes.
 */
export function typedAmount(start: Amount, now: Amount, lock: Lock, text: string): Amount | null {
  const numbers = text.trim().split(/[\s;]+/).map(readNumber);
  if (numbers.length === 0 || numbers.some((number) => number === null)) return null;
  const [first] = numbers as number[];
  if (first === undefined) return null;
  if (start.kind === "turn") return numbers.length === 1 ? { kind: "turn", degrees: first } : null;
  if (start.kind === "scale") return numbers.length === 1 ? { kind: "scale", factor: first } : null;
  const axes = axesOf(lock);
  const by: Vector = [...start.by];
  if (numbers.length === axes.length) axes.forEach((axis, i) => { by[axis] = numbers[i]!; });
  else if (numbers.length === 1) {
    const way = now.kind === "move" ? subtract(now.by, start.by) : [0, 0, 0] as Vector;
    const far = length(way);
    const along = far > 0 ? times(way, first / far) : ([0, 1, 2].map((axis) => (axis === axes[0] ? first : 0)) as Vector);
    for (const axis of axes) by[axis] = start.by[axis] + Number(along[axis].toPrecision(12));
  } else return null;
  return { kind: "move", by };
}

/** An amount as it is shown and typed: one number, or those along the axes. */
export function amountText(amount: Amount, lock: Lock): string {
  const text = (value: number): string => String(Number(value.toPrecision(10)));
  if (amount.kind === "turn") return text(amount.degrees);
  if (amount.kind === "scale") return text(amount.factor);
  return axesOf(lock).map((axis) => text(amount.by[axis])).join("  ");
}
