/** Marks over the picture that go with places of it: pinned probes, the ruler, the worst cells, notes. */
import type { Vector } from "../connection/protocol";
import { svg } from "../dom";
import { sameJson } from "../store/store";

/** A mark: a point, or a line through several, and what is written beside the last; with `edges` lines that outline what is marked. */
export interface Mark { points: readonly Vector[]; label: string; kind: "probe" | "ruler" | "cell" | "note"; edges?: readonly (readonly [Vector, Vector])[] }

const RADII: Record<Mark["kind"], number> = { probe: 4, ruler: 4, cell: 9, note: 6 };

export class Marks {
  private readonly groups = new Map<string, readonly Mark[]>();

  /** `place` says where on the page a point of the picture is drawn. */
  constructor(private readonly root: SVGElement, private readonly place: (point: Vector) => [number, number]) {}

  /** Replaces the marks of one origin. Most are told again with each picture. */
  set(origin: string, marks: readonly Mark[]): void {
    if (sameJson(this.groups.get(origin) ?? [], marks)) return;
    if (marks.length === 0) this.groups.delete(origin);
    else this.groups.set(origin, marks);
    this.draw();
  }

  /** The camera has moved, or the shape. */
  draw(): void {
    if (this.groups.size === 0 && !this.root.hasChildNodes()) return;
    const box = this.root.getBoundingClientRect();
    const made: SVGElement[] = [];
    const make = (tag: keyof SVGElementTagNameMap, attributes: Record<string, string | number>, text = ""): void => {
      const element = svg(tag, attributes);
      element.textContent = text;
      made.push(element);
    };
    const at = (point: Vector): [number, number] => {
      const [x, y] = this.place(point);
      return [x - box.left, y - box.top];
    };
    for (const { points, label, kind, edges = [] } of [...this.groups.values()].flat()) {
      const places = points.map(at);
      if (places.some((at) => !at.every(Number.isFinite))) continue;
      const ends = edges.map((edge) => edge.map(at)).filter((edge) => edge.flat().every(Number.isFinite));
      const outline = ends.map(([from, to]) => `M${from!.join()}L${to!.join()}`).join("");
      // On a ground of its own it is seen over every colour.
      if (outline !== "") for (const name of ["ground", kind]) make("path", { class: name, d: outline });
      if (places.length > 1) make("polyline", { class: kind, points: places.map((at) => at.join(",")).join(" ") });
      for (const [x, y] of places) make("circle", { class: kind, cx: x, cy: y, r: RADII[kind] });
      const last = places.at(-1);
      if (last && label !== "") make("text", { class: kind, x: last[0] + 12, y: last[1] + 4 }, label);
    }
    this.root.replaceChildren(...made);
  }
}
