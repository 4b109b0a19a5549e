/** Vectors in space. */
import type { Vector } from "../connection/protocol";

export type Axis = 0 | 1 | 2;
export const AXES: readonly Axis[] = [0, 1, 2];
export const AXIS_NAMES = ["x", "y", "z"] as const;

/** The two axes across one. */
export const across = (axis: Axis): [Axis, Axis] => [((axis + 1) % 3) as Axis, ((axis + 2) % 3) as Axis];
export const unit = (axis: Axis): Vector => [axis === 0 ? 1 : 0, axis === 1 ? 1 : 0, axis === 2 ? 1 : 0];
export const add = (a: Vector, b: Vector): Vector => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a: Vector, b: Vector): Vector => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const times = (a: Vector, factor: number): Vector => [a[0] * factor, a[1] * factor, a[2] * factor];
export const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vector, b: Vector): Vector => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a: Vector): number => Math.hypot(...a);
export const normalised = (a: Vector): Vector => times(a, 1 / (length(a) || 1));

export type Matrix = [Vector, Vector, Vector];
export const IDENTITY: Matrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
export const transformed = (matrix: Matrix, a: Vector): Vector => [dot(matrix[0], a), dot(matrix[1], a), dot(matrix[2], a)];

export function product(a: Matrix, b: Matrix): Matrix {
  const column = (k: Axis): Vector => [b[0][k], b[1][k], b[2][k]];
  return a.map((row) => AXES.map((k) => dot(row, column(k)))) as Matrix;
}

/** The turn by an angle about a direction (Rodrigues' formula); exact for multiples of 90 degrees about an axis. */
export function turn(direction: Vector, degrees: number): Matrix {
  const [x, y, z] = normalised(direction);
  const quarter = ((degrees % 360) + 360) % 360 / 90;
  const [c, s] = Number.isInteger(quarter) ? [[1, 0, -1, 0][quarter]!, [0, 1, 0, -1][quarter]!]
    : [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180)];
  const t = 1 - c;
  return [
    [t * x * x + c, t * x * y - s * z, t * x * z + s * y],
    [t * x * y + s * z, t * y * y + c, t * y * z - s * x],
    [t * x * z - s * y, t * y * z + s * x, t * z * z + c],
  ];
}
