/** A tree of boxes over triangles, so that a ray looks at few of them: what lies under the pointer is found at once in any mesh. */
import type { Vector } from "../connection/protocol";

export interface Hit { triangle: number; distance: number }

/** The most triangles of a leaf. */
const LEAF = 4;
/** Deeper than any tree of 2^32 triangles whose halves are halved; beyond it a node is a leaf, however many triangles lie at one place. */
const DEPTH = 64;

/**
 * Of a node: its box, the first of its two children (which are neighbours) or of its triangles in `order`, and how many
 * triangles it holds; 0 for a node that has children. Children come after their parent.
 */
export class TriangleTree {
  private readonly order: Uint32Array;
  private readonly boxes: Float32Array;
  private readonly first: Uint32Array;
  private readonly count: Uint32Array;
  private nodes = 0;

  /** `points` are interleaved coordinates, `triangles` indices of points three by three. */
  constructor(private readonly triangles: Uint32Array, private points: Float32Array) {
    const size = triangles.length / 3;
    this.order = Uint32Array.from({ length: size }, (_, i) => i);
    const most = Math.max(1, 2 * size);
    this.boxes = new Float32Array(6 * most);
    this.first = new Uint32Array(most);
    this.count = new Uint32Array(most);
    this.build(this.centroids());
    this.refit(points);
  }

  private centroids(): Float32Array {
    const { points, triangles } = this;
    const result = new Float32Array(triangles.length);
    for (let t = 0; t < triangles.length; t += 3) {
      const a = 3 * triangles[t]!, b = 3 * triangles[t + 1]!, c = 3 * triangles[t + 2]!;
      for (let k = 0; k < 3; k++) result[t + k] = points[a + k]! + points[b + k]! + points[c + k]!;
    }
    return result;
  }

  /** Halves the longest side of the box of the centroids, again and again. */
  private build(centroids: Float32Array): void {
    const { order } = this;
    const stack = [[0, 0, order.length, 0]];
    this.nodes = 1;
    for (let entry = stack.pop(); entry; entry = stack.pop()) {
      const [node, begin, end, depth] = entry as [number, number, number, number];
      const [axis, middle] = longest(centroids, order, begin, end);
      let split = begin;
      if (end - begin > LEAF && depth < DEPTH && axis >= 0) {
        for (let i = begin; i < end; i++) {
          const triangle = order[i]!;
          if (!(centroids[3 * triangle + axis]! < middle)) continue;
          order[i] = order[split]!;
          order[split++] = triangle;
        }
      }
      if (split === begin || split === end) {
        this.first[node] = begin;
        this.count[node] = end - begin;
        continue;
      }
      this.first[node] = this.nodes;
      stack.push([this.nodes, begin, split, depth + 1], [this.nodes + 1, split, end, depth + 1]);
      this.nodes += 2;
    }
  }

  /** Takes other coordinates of the same points. The tree keeps its shape, which stays good as long as the mesh moves as a whole. */
  refit(points: Float32Array): void {
    this.points = points;
    const { boxes, first, count, order, triangles } = this;
    for (let node = this.nodes - 1; node >= 0; node--) {
      const at = 6 * node;
      const begin = first[node]!;
      for (let k = 0; k < 3; k++) {
        let low = Infinity, high = -Infinity;
        if (count[node] === 0 && order.length > 0) {
          low = Math.min(boxes[6 * begin + k]!, boxes[6 * begin + 6 + k]!);
          high = Math.max(boxes[6 * begin + 3 + k]!, boxes[6 * begin + 9 + k]!);
        } else {
          for (let i = begin; i < begin + count[node]!; i++) {
            for (let corner = 0; corner < 3; corner++) {
              const value = points[3 * triangles[3 * order[i]! + corner]! + k]!;
              if (value < low) low = value;
              if (value > high) high = value;
            }
          }
        }
        boxes[at + k] = low;
        boxes[at + 3 + k] = high;
      }
    }
  }

  /** The first triangle that a ray meets, from either side; of several at the same distance the one with the lowest index. */
  firstHit(origin: Vector, direction: Vector): Hit | null {
    const inverse: Vector = [1 / direction[0], 1 / direction[1], 1 / direction[2]];
    const { first, count, order } = this;
    let nearest: Hit | null = null;
    const stack = [0];
    for (let node = stack.pop(); node !== undefined; node = stack.pop()) {
      if (!(this.entry(node, origin, inverse) <= (nearest?.distance ?? Infinity))) continue;
      const begin = first[node]!;
      if (count[node] === 0 && order.length > 0) {
        // The nearer child is looked at first, so that most of the other is passed over.
        const [a, b] = [this.entry(begin, origin, inverse), this.entry(begin + 1, origin, inverse)];
        if (a <= b) stack.push(begin + 1, begin);
        else stack.push(begin, begin + 1);
        continue;
      }
      for (let i = begin; i < begin + count[node]!; i++) {
        const triangle = order[i]!;
        const distance = this.meet(triangle, origin, direction);
        if (distance < 0) continue;
        if (!nearest || distance < nearest.distance || (distance === nearest.distance && triangle < nearest.triangle)) nearest = { triangle, distance };
      }
    }
    return nearest;
  }

  /** How far along a ray the box of a node begins; infinite where it is missed. */
  private entry(node: number, origin: Vector, inverse: Vector): number {
    let near = 0, far = Infinity;
    for (let k = 0; k < 3; k++) {
      const a = (this.boxes[6 * node + k]! - origin[k]!) * inverse[k]!;
      const b = (this.boxes[6 * node + 3 + k]! - origin[k]!) * inverse[k]!;
      // A ray in the plane of a side has NaN there, which no comparison takes.
      const [low, high] = a <= b ? [a, b] : [b, a];
      if (low > near) near = low;
      if (high < far) far = high;
    }
    // Rounding must not lose a triangle that lies in a side of its box.
    return near <= far * (1 + 1e-9) ? near * (1 - 1e-9) : Infinity;
  }

  /** How far along a ray it meets a triangle (Möller and Trumbore, 1997); negative where it does not. */
  private meet(triangle: number, [ox, oy, oz]: Vector, [dx, dy, dz]: Vector): number {
    const { points, triangles } = this;
    const a = triangles[3 * triangle]! * 3, b = triangles[3 * triangle + 1]! * 3, c = triangles[3 * triangle + 2]! * 3;
    const ax = points[a]!, ay = points[a + 1]!, az = points[a + 2]!;
    const ex = points[b]! - ax, ey = points[b + 1]! - ay, ez = points[b + 2]! - az;
    const fx = points[c]! - ax, fy = points[c + 1]! - ay, fz = points[c + 2]! - az;
    const px = dy * fz - dz * fy, py = dz * fx - dx * fz, pz = dx * fy - dy * fx;
    const determinant = ex * px + ey * py + ez * pz;
    if (determinant === 0) return -1;
    const sx = ox - ax, sy = oy - ay, sz = oz - az;
    const u = (sx * px + sy * py + sz * pz) / determinant;
    if (!(u >= 0 && u <= 1)) return -1;
    const qx = sy * ez - sz * ey, qy = sz * ex - sx * ez, qz = sx * ey - sy * ex;
    const v = (dx * qx + dy * qy + dz * qz) / determinant;
    if (!(v >= 0 && u + v <= 1)) return -1;
    const along = (fx * qx + fy * qy + fz * qz) / determinant;
    return along >= 0 ? along : -1;
  }
}

/** The axis along which centroids lie farthest apart, and the middle of them on it; -1 where all lie at one place. */
function longest(centroids: Float32Array, order: Uint32Array, begin: number, end: number): [number, number] {
  let axis = -1, middle = 0, size = 0;
  for (let k = 0; k < 3; k++) {
    let low = Infinity, high = -Infinity;
    for (let i = begin; i < end; i++) {
      const value = centroids[3 * order[i]! + k]!;
      if (value < low) low = value;
      if (value > high) high = value;
    }
    if (high - low > size) {
      axis = k;
      size = high - low;
      middle = low + size / 2;
    }
  }
  return [axis, middle];
}
