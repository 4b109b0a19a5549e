/** Two clicks in the picture and the distance between them: the ruler, and the line of a plot. */
import type { Vector } from "../connection/protocol";
import { digits } from "../number";
import type { Marks } from "./marks";

export class Ruler {
  private points: Vector[] = [];
  active = false;

  /** `origin` names its marks; `done` is told the two points, after which a tool that is for one line only is switched off. */
  constructor(private readonly marks: Marks, private readonly origin = "ruler", private readonly done?: (from: Vector, to: Vector) => void) {}

  toggle(): void {
    this.active = !this.active;
    this.points = [];
    this.show();
  }

  /** Takes a point; a third begins anew. */
  take(point: Vector): void {
    this.points = this.points.length >= 2 ? [point] : [...this.points, point];
    const [from, to] = this.points;
    if (this.done && from && to) {
      this.toggle();
      this.done(from, to);
    } else this.show();
  }

  private show(): void {
    this.marks.set(this.origin, this.points.length === 0 ? [] : [{ points: this.points, kind: "ruler", label: measure(this.points) }]);
  }
}

/** The distance of two points, and its parts along the axes. */
export function measure(points: readonly Vector[]): string {
  const [a, b] = points;
  if (!a || !b) return "";
  const by = [0, 1, 2].map((k) => b[k]! - a[k]!);
  return `${digits(Math.hypot(...by), 4)}  (${by.map((part) => digits(part, 3)).join(", ")})`;
}
