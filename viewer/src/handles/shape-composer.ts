/** Gestures on a handle as edits: translate, rotate, scale_direction, and affine where one comes on top of another. */
import type { Json, Vector } from "../connection/protocol";
import type { Values } from "../form/schema";
import { asksNothing } from "../store/draft";
import type { State } from "../store/state";
import type { Composer } from "./gesture";
import type { Amount, Lock } from "./motion";
import { IDENTITY, add, cross, length, product, subtract, transformed, turn, unit } from "./vector";
import type { Matrix } from "./vector";

/** What stands in the form when a gesture begins. */
export interface Base { key: string | null; bodies: Readonly<Record<string, Values>>; isNeutral: boolean }

/** How a handle is moved about a centre: `x` goes to `matrix (x - center) + center + translation`. */
interface Pose { matrix: Matrix; translation: Vector }

const AT_REST: Pose = { matrix: IDENTITY, translation: [0, 0, 0] };
const KEYS: Record<Amount["kind"], string> = { move: "translate", turn: "rotate", scale: "scale_direction" };

const kindOf = (lock: Lock): Amount["kind"] => (lock.kind === "ring" ? "turn" : lock.kind === "box" ? "scale" : "move");

export function baseOf(state: State): Base {
  const { key, bodies } = state.draft;
  if (asksNothing(state)) return { key, bodies, isNeutral: true };
  // A region alone moves nothing.
  const pose = poseOf({ key, bodies, isNeutral: false }, [0, 0, 0]);
  const isNeutral = pose !== null && length(pose.translation) === 0 && JSON.stringify(pose.matrix) === JSON.stringify(IDENTITY);
  return { key, bodies, isNeutral };
}

export function vectorOf(value: Json | undefined): Vector | null {
  return Array.isArray(value) && value.length === 3 && value.every((entry) => typeof entry === "number") ? value as Vector : null;
}

function matrixOf(value: Json | undefined): Matrix | null {
  const rows = Array.isArray(value) ? value.map(vectorOf) : [];
  return rows.length === 3 && rows.every((row) => row !== null) ? rows as Matrix : null;
}

/** How the edit in the form moves a handle about the middle of it; null where it is none that moves it as a body. */
export function poseOf({ key, bodies, isNeutral }: Base, center: Vector): Pose | null {
  if (isNeutral || key === null) return AT_REST;
  const body = bodies[key] ?? {};
  const own = vectorOf(body.center) ?? center;
  // About the middle of the handle instead of about the edit's own centre.
  const about = (matrix: Matrix, translation: Vector): Pose =>
    ({ matrix, translation: add(translation, add(transformed(matrix, subtract(center, own)), subtract(own, center))) });
  switch (key) {
    case "translate": {
      const by = vectorOf(body.by);
      return by && { matrix: IDENTITY, translation: by };
    }
    case "rotate": {
      const axis = vectorOf(body.axis);
      return axis && typeof body.degrees === "number" ? about(turn(axis, body.degrees), [0, 0, 0]) : null;
    }
    case "scale_direction": {
      const factors = vectorOf(body.factors);
      return factors && about(scaling(factors), [0, 0, 0]);
    }
    case "affine": {
      const matrix = matrixOf(body.matrix);
      return matrix && about(matrix, vectorOf(body.translation) ?? [0, 0, 0]);
    }
    default: return null;
  }
}

const scaling = (factors: Vector): Matrix => [[factors[0], 0, 0], [0, factors[1], 0], [0, 0, factors[2]]];

/** Where the middle of a handle lies once the edit in the form is made. */
export function movedCenter(base: Base, center: Vector): Vector {
  return add(center, poseOf(base, center)?.translation ?? [0, 0, 0]);
}

export class ShapeComposer implements Composer {
  readonly pivot: Vector;
  private readonly pose: Pose;

  /** `center` is the middle of the handle as it is before the edit. */
  constructor(private readonly base: Base, private readonly center: Vector) {
    this.pose = poseOf(base, center) ?? AT_REST;
    const { key, bodies } = base;
    const own = key === "rotate" || key === "scale_direction" ? vectorOf(bodies[key]?.center) : null;
    this.pivot = (base.isNeutral ? null : own) ?? movedCenter(base, center);
  }

  private get isAtRest(): boolean {
    return this.base.isNeutral || poseOf(this.base, this.center) === null;
  }

  /** Whether the edit in the form is of the kind that the lock asks for: it is changed instead of another made. */
  private continues(lock: Lock): boolean {
    const { key, bodies } = this.base;
    if (this.isAtRest || key !== KEYS[kindOf(lock)]) return false;
    if (lock.kind !== "ring") return true;
    const axis = vectorOf(bodies.rotate?.axis);
    return axis !== null && length(cross(axis, unit(lock.axis))) === 0;
  }

  /** 1 or, where the axis in the form points the other way, -1. */
  private sense(lock: Lock): number {
    return lock.kind === "ring" && (vectorOf(this.base.bodies.rotate?.axis)?.[lock.axis] ?? 1) < 0 ? -1 : 1;
  }

  start(lock: Lock): Amount {
    const body = this.continues(lock) ? this.base.bodies[this.base.key!]! : {};
    switch (kindOf(lock)) {
      case "turn": return { kind: "turn", degrees: typeof body.degrees === "number" ? this.sense(lock) * body.degrees : 0 };
      case "scale": return { kind: "scale", factor: lock.kind === "box" ? vectorOf(body.factors)?.[lock.axis] ?? 1 : 1 };
      case "move": return { kind: "move", by: this.pose.translation };
    }
  }

  compose(lock: Lock, amount: Amount): { key: string; values: Values } {
    const edit = this.edit(lock, amount);
    const { key, bodies } = this.base;
    if (edit.key === key) return edit;
    // What is gripped stays what it is, whatever the edit.
    const region = (key === null ? null : bodies[key]?.region) ?? null;
    return region === null && !bodies[edit.key]?.region ? edit : { key: edit.key, values: { ...edit.values, region } };
  }

  private edit(lock: Lock, amount: Amount): { key: string; values: Values } {
    const { key, bodies } = this.base;
    if (this.isAtRest || this.continues(lock)) {
      const own = KEYS[amount.kind];
      // A centre that was typed for another edit of the kind is not meant.
      const center: Values = !this.continues(lock) && vectorOf(bodies[own]?.center) ? { center: null } : {};
      if (amount.kind === "move") return { key: own, values: { by: amount.by } };
      if (amount.kind === "turn" && lock.kind === "ring") return { key: own, values: { axis: unit(lock.axis), degrees: amount.degrees, ...center } };
      if (amount.kind === "scale" && lock.kind === "box") {
        const before: Vector = this.continues(lock) ? vectorOf(bodies[own]?.factors) ?? [1, 1, 1] : [1, 1, 1];
        const factors: Vector = [...before];
        factors[lock.axis] = amount.factor;
        return { key: own, values: { factors, ...center } };
      }
    }
    const { matrix, translation } = this.pose;
    const own = (step: Matrix, by: Vector): { key: string; values: Values } => ({
      key: "affine", values: { matrix: product(step, matrix), translation: by, ...(key === "affine" || bodies.affine?.center ? { center: null } : {}) },
    });
    if (amount.kind === "move") return own(IDENTITY, amount.by);
    if (amount.kind === "turn" && lock.kind === "ring") return own(turn(unit(lock.axis), amount.degrees), translation);
    const factors: Vector = [1, 1, 1];
    if (amount.kind === "scale" && lock.kind === "box") factors[lock.axis] = amount.factor;
    return own(scaling(factors), translation);
  }
}
