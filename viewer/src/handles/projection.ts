/** How points of space are seen in the picture, and which points are seen at a place of it. */
import type { Vector } from "../connection/protocol";
import { add, cross, dot, length, normalised, subtract, times } from "./vector";

/** A place in the picture in CSS pixels, from its upper left corner. */
export type Place = [number, number];

export interface Ray { origin: Vector; /** Away from the viewer, of length 1. */ direction: Vector }

export class Projection {
  /**
   * `matrix` takes a point to clip space, row by row, with the depth from -1 to 1; `width` and `height` are those of the picture.
   */
  constructor(private readonly matrix: ArrayLike<number>, readonly width: number, readonly height: number) {}

  /** Tells projections apart: two that have the same show every point at the same place. */
  get key(): string {
    return `${this.width} ${this.height} ${Array.from(this.matrix).join(" ")}`;
  }

  private row(index: number): { normal: Vector; offset: number } {
    const at = (k: number): number => this.matrix[4 * index + k]!;
    return { normal: [at(0), at(1), at(2)], offset: at(3) };
  }

  private value(index: number, point: Vector): number {
    const { matrix } = this, at = 4 * index;
    return matrix[at]! * point[0] + matrix[at + 1]! * point[1] + matrix[at + 2]! * point[2] + matrix[at + 3]!;
  }

  /** Where a point is drawn; null where it lies behind the viewer. */
  toPicture(point: Vector): Place | null {
    const w = this.value(3, point);
    if (!(w > 0)) return null;
    return [((this.value(0, point) / w + 1) / 2) * this.width, ((1 - this.value(1, point) / w) / 2) * this.height];
  }

  /** How far from the viewer a point is drawn: -1 is the nearest, 1 the farthest. */
  depth(point: Vector): number {
    return this.value(2, point) / this.value(3, point);
  }

  /** The direction in which the viewer looks, of length 1. */
  get direction(): Vector {
    return normalised(this.row(2).normal);
  }

  /** The point of space that is drawn at a place with a depth. */
  toSpace([x, y]: Place, depth: number): Vector {
    // A point drawn there lies in three planes.
    const wanted = [(2 * x) / this.width - 1, 1 - (2 * y) / this.height, depth];
    const last = this.row(3);
    const planes = wanted.map((value, index) => {
      const { normal, offset } = this.row(index);
      return { normal: subtract(normal, times(last.normal, value)), offset: offset - value * last.offset };
    });
    const [a, b, c] = planes as [(typeof planes)[0], (typeof planes)[0], (typeof planes)[0]];
    const bc = cross(b.normal, c.normal), ca = cross(c.normal, a.normal), ab = cross(a.normal, b.normal);
    const determinant = dot(a.normal, bc);
    return times(add(add(times(bc, -a.offset), times(ca, -b.offset)), times(ab, -c.offset)), 1 / determinant);
  }

  /** All that is drawn at a place. */
  ray(place: Place): Ray {
    const origin = this.toSpace(place, -1);
    return { origin, direction: normalised(subtract(this.toSpace(place, 1), origin)) };
  }

  /** How long a pixel is in space, at a point. */
  pixel(point: Vector): number {
    const place = this.toPicture(point);
    if (!place) return NaN;
    const depth = this.depth(point);
    return length(subtract(this.toSpace([place[0] + 1, place[1]], depth), this.toSpace(place, depth)));
  }
}

/** Where a ray meets a plane; null where it runs along it. */
export function meetPlane({ origin, direction }: Ray, point: Vector, normal: Vector): Vector | null {
  const along = dot(direction, normal);
  if (Math.abs(along) < 1e-9 * length(normal)) return null;
  return add(origin, times(direction, dot(subtract(point, origin), normal) / along));
}

/** How far along a line, from a point of it and in lengths of its direction, it comes closest to a ray; null where they are parallel. */
export function closestAlong({ origin, direction }: Ray, point: Vector, line: Vector): number | null {
  const between = subtract(origin, point);
  const a = dot(line, line), b = dot(line, direction);
  const determinant = a - b * b;
  if (determinant < 1e-6 * a) return null;
  return (dot(line, between) - b * dot(direction, between)) / determinant;
}
