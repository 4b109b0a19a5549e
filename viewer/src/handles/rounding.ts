/** Numbers that a person would have chosen: what a drag comes to, rounded to what a pixel can say or to round steps. */
import type { Amount, Lock } from "./motion";
import { axesOf } from "./motion";
import type { Vector } from "../connection/protocol";

/** What the keys ask for: finer motion, or round steps. */
export interface Precision { fine: boolean; snap: boolean }

/** How much slower the pointer is with shift. */
export const FINE = 0.1;
const SNAP_PIXELS = 8;

/** The nearest multiple of a step that is a power of ten times 1, 2 or 5, without the dust of binary fractions. */
export function toStep(value: number, step: number): number {
  if (!(step > 0) || !Number.isFinite(step) || !Number.isFinite(value)) return value;
  const decimals = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
  const rounded = Math.round(value / step) * step;
  // No negative zero.
  return (decimals <= 100 ? Number(rounded.toFixed(decimals)) : rounded) + 0;
}

/** The least of 1, 2 or 5 times a power of ten that is not below a size. */
export function roundStep(size: number): number {
  const power = 10 ** Math.floor(Math.log10(size));
  const factor = [1, 2, 5, 10].find((candidate) => candidate * power >= size * (1 - 1e-9)) ?? 10;
  return Number((factor * power).toPrecision(3));
}

/** The step to which an amount is rounded; `pixel` is the length of a pixel in space. */
export function stepOf(kind: Amount["kind"], pixel: number, { fine, snap }: Precision): number {
  switch (kind) {
    case "turn": return snap ? (fine ? 1 : 5) : (fine ? 0.01 : 0.1);
    case "scale": return snap ? (fine ? 0.01 : 0.1) : (fine ? 0.001 : 0.01);
    case "move": {
      const size = pixel * (fine ? FINE : 1);
      return snap ? roundStep(SNAP_PIXELS * size) : 10 ** Math.floor(Math.log10(size));
    }
  }
}

/** An amount rounded along the axes that its lock lets go; the others stay as they are. */
export function rounded(amount: Amount, lock: Lock, step: number): Amount {
  switch (amount.kind) {
    case "turn": return { kind: "turn", degrees: toStep(amount.degrees, step) };
    case "scale": return { kind: "scale", factor: Math.max(step, toStep(amount.factor, step)) };
    case "move": return { kind: "move", by: amount.by.map((value, axis) => ((axesOf(lock) as number[]).includes(axis) ? toStep(value, step) : value)) as Vector };
  }
}
