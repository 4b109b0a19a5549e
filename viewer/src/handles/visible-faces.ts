/** Which faces of a surface are seen, and where: a small picture of their depths, drawn when a stroke begins. */
import type { Place, Projection } from "./projection";

/** Pixels of the picture for one of the depths. */
const COARSENESS = 2;
const NOTHING = -1;

export class VisibleFaces {
  /** Where each point is drawn, and how deep; NaN where it is not. */
  private readonly places: Float32Array;
  private readonly depths: Float32Array;
  private readonly nearest: Float32Array;
  private readonly faces: Int32Array;
  private readonly width: number;
  private readonly height: number;
  /** The sense in which most of what is seen goes round in the picture: the other is that of a back. */
  private readonly sense: number = 0;

  /** `points` are interleaved, `triangles` their indices three by three. */
  constructor(points: Float32Array, private readonly triangles: Uint32Array, projection: Projection) {
    const count = points.length / 3;
    this.width = Math.max(1, Math.ceil(projection.width / COARSENESS));
    this.height = Math.max(1, Math.ceil(projection.height / COARSENESS));
    this.places = new Float32Array(2 * count).fill(NaN);
    this.depths = new Float32Array(count).fill(NaN);
    for (let i = 0; i < count; i++) {
      const point: [number, number, number] = [points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!];
      const place = projection.toPicture(point);
      if (!place) continue;
      this.places.set(place, 2 * i);
      this.depths[i] = projection.depth(point);
    }
    this.nearest = new Float32Array(this.width * this.height).fill(Infinity);
    this.faces = new Int32Array(this.width * this.height).fill(NOTHING);
    for (let triangle = 0; 3 * triangle < triangles.length; triangle++) this.draw(triangle);
    for (const face of new Set(this.faces)) if (face !== NOTHING) this.sense += Math.sign(this.area(face));
  }

  /** Twice the area of a face in the picture, by the sense in which it goes round. */
  private area(triangle: number): number {
    const [a, b, c] = [this.triangles[3 * triangle]!, this.triangles[3 * triangle + 1]!, this.triangles[3 * triangle + 2]!];
    const x = (k: number): number => this.places[2 * k]!, y = (k: number): number => this.places[2 * k + 1]!;
    return (x(b) - x(a)) * (y(c) - y(a)) - (y(b) - y(a)) * (x(c) - x(a));
  }

  private draw(triangle: number): void {
    const [a, b, c] = [this.triangles[3 * triangle]!, this.triangles[3 * triangle + 1]!, this.triangles[3 * triangle + 2]!];
    const [ax, ay, bx, by, cx, cy] = [a, b, c].flatMap((k) => [this.places[2 * k]! / COARSENESS - 0.5, this.places[2 * k + 1]! / COARSENESS - 0.5]) as
      [number, number, number, number, number, number];
    const area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
    if (!(Math.abs(area) > 1e-9)) return;
    const [za, zb, zc] = [this.depths[a]!, this.depths[b]!, this.depths[c]!];
    const left = Math.max(0, Math.ceil(Math.min(ax, bx, cx))), right = Math.min(this.width - 1, Math.floor(Math.max(ax, bx, cx)));
    const top = Math.max(0, Math.ceil(Math.min(ay, by, cy))), bottom = Math.min(this.height - 1, Math.floor(Math.max(ay, by, cy)));
    for (let y = top; y <= bottom; y++) {
      for (let x = left; x <= right; x++) {
        const u = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area;
        const v = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area;
        const w = 1 - u - v;
        if (u < 0 || v < 0 || w < 0) continue;
        const depth = u * za + v * zb + w * zc;
        const pixel = y * this.width + x;
        if (depth >= this.nearest[pixel]!) continue;
        this.nearest[pixel] = depth;
        this.faces[pixel] = triangle;
      }
    }
  }

  /** The face that is seen at a place; null for none. */
  at([x, y]: Place): number | null {
    const [column, row] = [Math.floor(x / COARSENESS), Math.floor(y / COARSENESS)];
    if (!(column >= 0 && column < this.width && row >= 0 && row < this.height)) return null;
    const face = this.faces[row * this.width + column]!;
    return face === NOTHING ? null : face;
  }

  /** The faces that are seen within a distance of a place. */
  around([x, y]: Place, radius: number): Set<number> {
    const found = new Set<number>();
    for (let row = -radius; row <= radius; row += COARSENESS) {
      for (let column = -radius; column <= radius; column += COARSENESS) {
        if (Math.hypot(row, column) > radius) continue;
        const face = this.at([x + column, y + row]);
        if (face !== null) found.add(face);
      }
    }
    return found;
  }

  /** The faces whose middle is drawn where `isWanted` says so; those that others hide only with `through`. */
  within(isWanted: (place: Place) => boolean, through: boolean): Set<number> {
    const found = new Set<number>();
    for (let triangle = 0; 3 * triangle < this.triangles.length; triangle++) {
      let x = 0, y = 0, depth = 0, least = Infinity, most = -Infinity;
      for (let k = 3 * triangle; k < 3 * triangle + 3; k++) {
        const point = this.triangles[k]!;
        x += this.places[2 * point]! / 3;
        y += this.places[2 * point + 1]! / 3;
        depth += this.depths[point]! / 3;
        least = Math.min(least, this.depths[point]!);
        most = Math.max(most, this.depths[point]!);
      }
      if (!Number.isFinite(x) || !isWanted([x, y])) continue;
      if (!through) {
        if (this.area(triangle) * this.sense <= 0) continue;
        const column = Math.floor(x / COARSENESS), row = Math.floor(y / COARSENESS);
        if (column < 0 || row < 0 || column >= this.width || row >= this.height) continue;
        // A face is as deep as its own corners: what is nearer than all of them hides it.
        if (this.nearest[row * this.width + column]! < depth - (most - least) - 1e-6) continue;
      }
      found.add(triangle);
    }
    return found;
  }
}
