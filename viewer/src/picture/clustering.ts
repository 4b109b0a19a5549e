/**
 * Fewer triangles over the points that are there, for a picture that moves: what is drawn of a surface while it is turned. Points that
 * lie in one cell of a grid and hang together there become one of them (vertex clustering, Rossignac and Borrel 1993), so that values,
 * colours and displacements are those of the points, and only the corners of triangles are others.
 *
 * What hangs together is told by the triangles: the two sides of a thin plate stay two, and so do slices that lie close to each other. No
 * hole is larger than a cell; what is smaller than a cell vanishes.
 */
import { featureEdges } from "./picking";

/** Views of more triangles than these have fewer of them while they move, and about so many. */
export const MOST_TRIANGLES = 40_000;
const GOAL = 25_000;
/** How often another size of the cells is tried, and how near to the goal is near enough. */
const TRIALS = 6, NEAR = 0.15;
/** What loses more of its area than this is drawn whole: a cloud of small parts would vanish. */
const LOST_AREA = 0.25;
/** Sharpness is told in so many steps: below one of them lies what a round surface has by itself. */
const STEPS = 8;

/** For each point the one that stands for it, and the triangles between those. */
export interface Clusters { representatives: Uint32Array; triangles: Uint32Array }

/** Clusters the points of triangles. Null where that makes them not much fewer, or would lose too much of the surface. */
export function cluster(points: Float32Array, triangles: Uint32Array, features: Uint32Array | null, goal: number = GOAL): Clusters | null {
  const sound = soundTriangles(points, triangles, features);
  const { area, extent, low } = measured(points, sound.triangles);
  if (!(area > 0)) return null;
  const welded = weld(points, sound.triangles);
  const corners = sound.triangles.map((point) => welded[point]!);

  // A grid has about so many cells on a flat surface that it gives two triangles each.
  let size = Math.sqrt((2 * area) / goal);
  let roots: Uint32Array | null = null;
  for (let trial = 0; trial < TRIALS; trial++) {
    // The numbers of cells must be exact.
    size = Math.max(size, extent / 65_536);
    roots = joined(corners, cells(points, low, size));
    const count = survivors(corners, roots);
    if (Math.abs(count - goal) <= NEAR * goal) break;
    size *= Math.min(2, Math.max(0.5, Math.sqrt(count / goal)));
  }
  if (!roots) return null;
  const representatives = chosen(points, corners, roots, importance(points, corners, sound.features));
  for (let point = 0; point < representatives.length; point++) representatives[point] = representatives[welded[point]!]!;
  const coarse = coarsened(sound.triangles, 3, representatives);
  const isFewer = coarse.length > 0 && 2 * coarse.length <= triangles.length;
  return isFewer && measured(points, coarse).area >= (1 - LOST_AREA) * area ? { representatives, triangles: coarse } : null;
}

/** Cells of two or three points between their representatives: each once, without those that have lost a corner. */
export function coarsened(cells: Uint32Array, size: 2 | 3, representatives: Uint32Array): Uint32Array {
  const kept: number[] = [];
  for (let cell = 0; cell + size <= cells.length; cell += size) {
    const a = representatives[cells[cell]!]!, b = representatives[cells[cell + 1]!]!;
    const c = size === 3 ? representatives[cells[cell + 2]!]! : NaN;
    if (a === b || b === c || c === a) continue;
    if (size === 3) kept.push(a, b, c);
    else kept.push(a, b);
  }
  let slots = 4;
  while (slots < kept.length) slots *= 2;
  const table = new Int32Array(slots).fill(-1);
  const sorted = (at: number): [number, number, number] => {
    const a = kept[at]!, b = kept[at + 1]!;
    if (size === 2) return [Math.min(a, b), Math.max(a, b), 0];
    const c = kept[at + 2]!, low = Math.min(a, b, c), high = Math.max(a, b, c);
    return [low, a + b + c - low - high, high];
  };
  let length = 0;
  for (let at = 0; at < kept.length; at += size) {
    const [a, b, c] = sorted(at);
    let slot = (Math.imul(a, 0x9e3779b1) ^ Math.imul(b, 0x85ebca6b) ^ Math.imul(c, 0xc2b2ae35)) >>> 0;
    for (slot = (slot ^ (slot >>> 15)) & (slots - 1); ; slot = (slot + 1) & (slots - 1)) {
      const there = table[slot]!;
      if (there < 0) {
        table[slot] = length;
        for (let k = 0; k < size; k++) kept[length++] = kept[at + k]!;
        break;
      }
      const [x, y, z] = sorted(there);
      if (x === a && y === b && z === c) break;
    }
  }
  return Uint32Array.from(kept.slice(0, length));
}

/** The triangles whose corners are there and have a place, with their features. */
function soundTriangles(points: Float32Array, triangles: Uint32Array, features: Uint32Array | null): { triangles: Uint32Array; features: Uint32Array } {
  const isSound = (corner: number): boolean => {
    const point = 3 * triangles[corner]!;
    return point + 2 < points.length && Number.isFinite(points[point]! + points[point + 1]! + points[point + 2]!);
  };
  const count = Math.floor(triangles.length / 3);
  const keptTriangles = new Uint32Array(3 * count), keptFeatures = new Uint32Array(count);
  let kept = 0;
  for (let triangle = 0; triangle < count; triangle++) {
    if (!isSound(3 * triangle) || !isSound(3 * triangle + 1) || !isSound(3 * triangle + 2)) continue;
    keptTriangles.set(triangles.subarray(3 * triangle, 3 * triangle + 3), 3 * kept);
    keptFeatures[kept++] = features?.[triangle] ?? 0;
  }
  return { triangles: keptTriangles.subarray(0, 3 * kept), features: keptFeatures.subarray(0, kept) };
}

/** Twice the area of a triangle as a vector across it. */
function normal(points: Float32Array, triangles: Uint32Array, at: number, into: Float64Array): void {
  const a = 3 * triangles[at]!, b = 3 * triangles[at + 1]!, c = 3 * triangles[at + 2]!;
  const ux = points[b]! - points[a]!, uy = points[b + 1]! - points[a + 1]!, uz = points[b + 2]! - points[a + 2]!;
  const vx = points[c]! - points[a]!, vy = points[c + 1]! - points[a + 1]!, vz = points[c + 2]! - points[a + 2]!;
  into[0] = uy * vz - uz * vy;
  into[1] = uz * vx - ux * vz;
  into[2] = ux * vy - uy * vx;
}

/** The area of triangles, the lowest corner of the box around them and its longest side. */
function measured(points: Float32Array, triangles: Uint32Array): { area: number; extent: number; low: Float64Array } {
  const low = new Float64Array(3).fill(Infinity), high = new Float64Array(3).fill(-Infinity), across = new Float64Array(3);
  let area = 0;
  for (let at = 0; at < triangles.length; at++) {
    for (let k = 0; k < 3; k++) {
      const value = points[3 * triangles[at]! + k]!;
      if (value < low[k]!) low[k] = value;
      if (value > high[k]!) high[k] = value;
    }
    if (at % 3 !== 0) continue;
    normal(points, triangles, at, across);
    area += Math.hypot(across[0]!, across[1]!, across[2]!) / 2;
  }
  return { area, low, extent: Math.max(high[0]! - low[0]!, high[1]! - low[1]!, high[2]! - low[2]!) };
}

/** For each point of triangles the first of them at the same place: parts that were put together have the points between them twice. */
function weld(points: Float32Array, triangles: Uint32Array): Uint32Array {
  const count = Math.floor(points.length / 3);
  const result = new Uint32Array(count);
  for (let point = 0; point < count; point++) result[point] = point;
  const isUsed = new Uint8Array(count);
  for (const point of triangles) isUsed[point] = 1;
  let slots = 4;
  while (slots < 2 * count) slots *= 2;
  const table = new Int32Array(slots).fill(-1);
  const bits = new Uint32Array(points.buffer, points.byteOffset, points.length);
  for (let point = 0; point < count; point++) {
    if (!isUsed[point]) continue;
    const at = 3 * point;
    // Zero has two signs, and is one place.
    const part = (k: number): number => (points[at + k] === 0 ? 0 : bits[at + k]!);
    let slot = Math.imul(part(0), 0x9e3779b1) ^ Math.imul(part(1), 0x85ebca6b) ^ Math.imul(part(2), 0xc2b2ae35);
    for (slot = (slot ^ (slot >>> 15)) & (slots - 1); ; slot = (slot + 1) & (slots - 1)) {
      const there = table[slot]!;
      if (there < 0) {
        table[slot] = point;
        break;
      }
      if (points[3 * there] === points[at] && points[3 * there + 1] === points[at + 1] && points[3 * there + 2] === points[at + 2]) {
        result[point] = there;
        break;
      }
    }
  }
  return result;
}

/** The number of each point's cell. The grid begins a little before the points, so that no side of a box lies between two of its layers. */
function cells(points: Float32Array, low: Float64Array, size: number): Float64Array {
  const result = new Float64Array(Math.floor(points.length / 3));
  const along = (at: number, k: number): number => Math.floor((points[at + k]! - low[k]!) / size + 0.37);
  for (let point = 0, at = 0; point < result.length; point++, at += 3) result[point] = along(at, 0) + 131_072 * (along(at, 1) + 131_072 * along(at, 2));
  return result;
}

/** For each point the lowest one of those that hang together with it inside its cell. */
function joined(corners: Uint32Array, cell: Float64Array): Uint32Array {
  const parent = new Uint32Array(cell.length);
  for (let point = 0; point < parent.length; point++) parent[point] = point;
  const root = (point: number): number => {
    while (parent[point] !== point) point = parent[point] = parent[parent[point]!]!;
    return point;
  };
  const join = (a: number, b: number): void => {
    if (cell[a] !== cell[b]) return;
    const [x, y] = [root(a), root(b)];
    if (x < y) parent[y] = x;
    else parent[x] = y;
  };
  for (let at = 0; at < corners.length; at += 3) {
    const a = corners[at]!, b = corners[at + 1]!, c = corners[at + 2]!;
    join(a, b);
    join(b, c);
    join(c, a);
  }
  for (let point = 0; point < parent.length; point++) parent[point] = root(point);
  return parent;
}

/** How many triangles keep three corners. */
function survivors(corners: Uint32Array, roots: Uint32Array): number {
  let count = 0;
  for (let at = 0; at < corners.length; at += 3) {
    const a = roots[corners[at]!], b = roots[corners[at + 1]!], c = roots[corners[at + 2]!];
    if (a !== b && b !== c && c !== a) count++;
  }
  return count;
}

/**
 * How much would be seen if a point were lost, in steps: little where the surface is flat, more on an edge and at a corner; and above all of
 * these on the border of the surface or of a feature, most where the border turns.
 */
function importance(points: Float32Array, corners: Uint32Array, features: Uint32Array): Uint8Array {
  const count = Math.floor(points.length / 3);
  const sum = new Float64Array(3 * count), length = new Float64Array(count), across = new Float64Array(3);
  const add = (point: number, x: number, y: number, z: number, size: number): void => {
    sum[3 * point]! += x;
    sum[3 * point + 1]! += y;
    sum[3 * point + 2]! += z;
    length[point]! += size;
  };
  const sharpness = (point: number): number => {
    const total = Math.hypot(sum[3 * point]!, sum[3 * point + 1]!, sum[3 * point + 2]!);
    return length[point]! > 0 ? total / length[point]! : 0;
  };
  for (let at = 0; at < corners.length; at += 3) {
    normal(points, corners, at, across);
    const [x, y, z] = across as unknown as [number, number, number];
    const size = Math.hypot(x, y, z);
    for (let k = 0; k < 3; k++) add(corners[at + k]!, x, y, z, size);
  }
  const result = new Uint8Array(count);
  for (let point = 0; point < count; point++) if (length[point]! > 0) result[point] = Math.round(STEPS * (1 - sharpness(point)));
  sum.fill(0);
  length.fill(0);
  const borders = featureEdges(corners, features, count);
  for (let at = 0; at < borders.length; at += 2) {
    const a = borders[at]!, b = borders[at + 1]!;
    const [x, y, z] = [0, 1, 2].map((k) => points[3 * b + k]! - points[3 * a + k]!) as [number, number, number];
    const size = Math.hypot(x, y, z);
    if (size === 0) continue;
    add(a, x / size, y / size, z / size, 1);
    add(b, -x / size, -y / size, -z / size, 1);
  }
  for (let point = 0; point < count; point++) if (length[point]! > 0) result[point] = STEPS + 1 + Math.round(STEPS * sharpness(point));
  return result;
}

/** For each point the most important one of those with the same root; of several, the one nearest to the middle of them all. */
function chosen(points: Float32Array, corners: Uint32Array, roots: Uint32Array, important: Uint8Array): Uint32Array {
  const isUsed = new Uint8Array(roots.length);
  for (const point of corners) isUsed[point] = 1;
  const middle = new Float64Array(3 * roots.length), members = new Uint32Array(roots.length);
  for (let point = 0; point < roots.length; point++) {
    if (!isUsed[point]) continue;
    const root = roots[point]!;
    members[root]!++;
    for (let k = 0; k < 3; k++) middle[3 * root + k]! += points[3 * point + k]!;
  }
  const best = new Int32Array(roots.length).fill(-1), nearest = new Float64Array(roots.length);
  for (let point = 0; point < roots.length; point++) {
    if (!isUsed[point]) continue;
    const root = roots[point]!;
    let distance = 0;
    for (let k = 0; k < 3; k++) distance += (points[3 * point + k]! - middle[3 * root + k]! / members[root]!) ** 2;
    const rival = best[root]!;
    const isBetter = rival < 0 || important[point]! > important[rival]! || (important[point] === important[rival] && distance < nearest[root]!);
    if (isBetter) [best[root], nearest[root]] = [point, distance];
  }
  const result = new Uint32Array(roots.length);
  for (let point = 0; point < roots.length; point++) result[point] = isUsed[point] ? best[roots[point]!]! : point;
  return result;
}
