/** Projections for tests, made the textbook way. */
import { Projection } from "../../src/handles/projection";
import type { Vector } from "../../src/connection/protocol";
import { cross, dot, normalised, subtract } from "../../src/handles/vector";

export const WIDTH = 800, HEIGHT = 600;

/** Rows of the matrix of a camera at `eye` that looks at `target`; `halfHeight` makes it a parallel one. */
export function camera(eye: Vector, target: Vector, up: Vector, halfHeight?: number): Projection {
  const z = normalised(subtract(eye, target));
  const x = normalised(cross(up, z));
  const y = cross(z, x);
  const view = [[...x, -dot(x, eye)], [...y, -dot(y, eye)], [...z, -dot(z, eye)], [0, 0, 0, 1]];
  const aspect = WIDTH / HEIGHT, near = 0.1, far = 100, f = 1 / Math.tan(Math.PI / 12);
  const seen = halfHeight === undefined
    ? [[f / aspect, 0, 0, 0], [0, f, 0, 0], [0, 0, (far + near) / (near - far), (2 * far * near) / (near - far)], [0, 0, -1, 0]]
    : [[1 / (halfHeight * aspect), 0, 0, 0], [0, 1 / halfHeight, 0, 0], [0, 0, 2 / (near - far), (far + near) / (near - far)], [0, 0, 0, 1]];
  return new Projection(seen.flatMap((row) => [0, 1, 2, 3].map((k) => row.reduce((sum, value, i) => sum + value * view[i]![k]!, 0))), WIDTH, HEIGHT);
}

export const OBLIQUE = camera([6, -7, 4], [0.2, 0.1, 0], [0, 0, 1]);
export const ALONG_X = camera([10, 0, 0], [0, 0, 0], [0, 0, 1]);
export const PARALLEL = camera([6, -7, 4], [0, 0, 0], [0, 0, 1], 2);
