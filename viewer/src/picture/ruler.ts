/** The ruler: two clicks in the picture, and the distance between them. */
import type { Vector } from "../connection/protocol";
import { digits } from "../number";
import type { Marks } from "./marks";

export class Ruler {
  private points: Vector[] = [];
  active = false;

  constructor(private readonly marks: Marks) {}

  toggle(): void {
    this.active = !this.active;
    this.points = [];
    this.show();
  }

  /** Takes a point; a third begins anew. */
  take(point: Vector): void {
    this.points = this.points.length >= 2 ? [point] : [...this.points, point];
    this.show();
  }

  private show(): void {
    this.marks.set("ruler", this.points.length === 0 ? [] : [{ points: this.points, kind: "ruler", label: measure(this.points) }]);
  }
}

/** The distance of two points, and its parts along the axes. */
export function measure(points: readonly Vector[]): string {
  const [a, b] = points;
  if (!a || !b) return "";
  const by = [0, 1, 2].map((k) => b[k]! - a[k]!);
  return `${digits(Math.hypot(...by), 4)}  (${by.map((part) => digits(part, 3)).join(", ")})`;
}
