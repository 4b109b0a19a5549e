import { describe, expect, test } from "vitest";
import { cluster, coarsened } from "../../src/picture/clustering";
import type { Vector } from "../../src/connection/protocol";

interface Surface { points: Float32Array; triangles: Uint32Array }

/** A sheet of squares, each two triangles; `place` says where a point between 0 and 1 lies. */
function sheet(across: number, along: number, place: (u: number, v: number) => Vector): Surface {
  const points: number[] = [], triangles: number[] = [];
  for (let j = 0; j <= along; j++) for (let i = 0; i <= across; i++) points.push(...place(i / across, j / along));
  for (let j = 0; j < along; j++) for (let i = 0; i < across; i++) {
    const a = j * (across + 1) + i, b = a + across + 1;
    triangles.push(a, a + 1, b + 1, a, b + 1, b);
  }
  return { points: Float32Array.from(points), triangles: Uint32Array.from(triangles) };
}

/** Several surfaces as one, none of whose points are shared. */
function together(...parts: Surface[]): Surface {
  const points: number[] = [], triangles: number[] = [];
  for (const part of parts) {
    const before = points.length / 3;
    for (const value of part.points) points.push(value);
    for (const point of part.triangles) triangles.push(point + before);
  }
  return { points: Float32Array.from(points), triangles: Uint32Array.from(triangles) };
}

const sphere = sheet(300, 150, (u, v) => {
  // Where it closes its points lie at one place, to the last digit.
  const around = 2 * Math.PI * (u % 1), radius = v === 1 ? 0 : Math.sin(Math.PI * v);
  return [Math.cos(around) * radius, Math.sin(around) * radius, Math.cos(Math.PI * v)];
});
const box = together(...[0, 1].flatMap((end) => [0, 1, 2].map((axis) => sheet(90, 90, (u, v) => {
  const place: Vector = [0, 0, 0];
  place[axis] = end;
  place[(axis + 1) % 3] = u;
  place[(axis + 2) % 3] = v;
  return place;
}))));
const plane = sheet(300, 200, (u, v) => [3 * u, 2 * v, 0.1]);

function area({ points, triangles }: Surface): number {
  let sum = 0;
  for (let at = 0; at < triangles.length; at += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => [0, 1, 2].map((axis) => points[3 * triangles[at + k]! + axis]!)) as [Vector, Vector, Vector];
    const u = b.map((x, k) => x - a[k]!) as Vector, v = c.map((x, k) => x - a[k]!) as Vector;
    sum += Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
  }
  return sum;
}

/** Points at the same place as one: how often each edge occurs, by its ends. */
function edges({ points, triangles }: Surface): Map<string, number> {
  const found = new Map<string, number>();
  const place = (point: number): string => [0, 1, 2].map((k) => points[3 * point + k]! + 0).join();
  for (let at = 0; at < triangles.length; at += 3) for (let k = 0; k < 3; k++) {
    const key = [place(triangles[at + k]!), place(triangles[at + (k + 1) % 3]!)].sort().join(" ");
    found.set(key, (found.get(key) ?? 0) + 1);
  }
  return found;
}

const distinct = (triangles: Uint32Array): number => {
  const found = new Set<string>();
  for (let at = 0; at < triangles.length; at += 3) found.add([...triangles.subarray(at, at + 3)].sort((a, b) => a - b).join());
  return found.size;
};

describe.each([["a sphere", sphere, 0.01], ["a box", box, 0.01], ["a plane", plane, 0.01]] as const)("%s", (_, surface, tolerance) => {
  const coarse = cluster(surface.points, surface.triangles, null, 12_000)!;

  test("has about as many triangles as are wanted, none twice and none without area", () => {
    expect(coarse.triangles.length / 3).toBeGreaterThan(8_000);
    expect(coarse.triangles.length / 3).toBeLessThan(15_000);
    expect(distinct(coarse.triangles)).toBe(coarse.triangles.length / 3);
    for (let at = 0; at < coarse.triangles.length; at += 3) expect(new Set(coarse.triangles.subarray(at, at + 3)).size).toBe(3);
  });

  test("has its own points, and its area", () => {
    expect(coarse.representatives.length).toBe(surface.points.length / 3);
    for (const point of coarse.triangles) {
      expect(point).toBeLessThan(surface.points.length / 3);
      // Who stands for others stands for itself.
      expect(coarse.representatives[point]).toBe(point);
    }
    expect(Math.abs(area({ points: surface.points, triangles: coarse.triangles }) / area(surface) - 1)).toBeLessThan(tolerance);
  });

  test("is the same each time", () => {
    expect(cluster(surface.points, surface.triangles, null, 12_000)).toEqual(coarse);
  });
});

test.each([["a sphere", sphere], ["a box", box]] as const)("%s stays closed", (_, surface) => {
  const { triangles } = cluster(surface.points, surface.triangles, null, 12_000)!;
  const open = [...edges({ points: surface.points, triangles }).values()].filter((times) => times === 1);
  expect(open.length).toBe(0);
});

test("the corners of a box, and the border of a plane, stay where they are", () => {
  for (const surface of [box, plane]) {
    const { triangles } = cluster(surface.points, surface.triangles, null, 12_000)!;
    const high = [0, 1, 2].map((k) => surface.points.filter((_, i) => i % 3 === k).reduce((a, b) => Math.max(a, b)));
    const low = [0, 1, 2].map((k) => surface.points.filter((_, i) => i % 3 === k).reduce((a, b) => Math.min(a, b)));
    const places = new Set([...triangles].map((point) => [0, 1, 2].map((k) => surface.points[3 * point + k]!).join()));
    for (let corner = 0; corner < 8; corner++) expect(places).toContain([0, 1, 2].map((k) => ((corner >> k) & 1 ? high : low)[k]).join());
  }
});

test("the border between two features is followed", () => {
  const features = Uint32Array.from({ length: plane.triangles.length / 3 }, (_, triangle) => (plane.points[3 * plane.triangles[3 * triangle]!]! < 1.495 ? 0 : 1));
  const { representatives } = cluster(plane.points, plane.triangles, features, 6_000)!;
  // Points on the border, at 1.5, are represented by points on it.
  for (let point = 0; point < representatives.length; point++) {
    if (Math.abs(plane.points[3 * point]! - 1.5) < 1e-6) expect(plane.points[3 * representatives[point]!]).toBeCloseTo(1.5, 6);
  }
});

test("slices that lie closer to each other than a cell is large stay apart", () => {
  const surface = together(...Array.from({ length: 20 }, (_, i) => sheet(50, 50, (u, v) => [u, v, 0.001 * i])));
  const { representatives, triangles } = cluster(surface.points, surface.triangles, null, 20_000)!;
  expect(triangles.length / 3).toBeLessThan(24_000);
  representatives.forEach((point, i) => expect(surface.points[3 * point + 2]).toBe(surface.points[3 * i + 2]));
});

test("triangles that share no points have no holes between them", () => {
  const loose = {
    points: Float32Array.from([...plane.triangles].flatMap((point) => [...plane.points.subarray(3 * point, 3 * point + 3)])),
    triangles: Uint32Array.from(plane.triangles, (_, i) => i),
  };
  const { triangles } = cluster(loose.points, loose.triangles, null, 12_000)!;
  expect(area({ points: loose.points, triangles })).toBeCloseTo(6, 1);
});

test("points without a place are in no triangle", () => {
  const points = plane.points.slice();
  for (let point = 0; point < points.length / 3; point += 997) points[3 * point + 1] = point % 2 ? NaN : Infinity;
  const { triangles } = cluster(points, plane.triangles, null, 12_000)!;
  for (const point of triangles) expect(Number.isFinite(points[3 * point + 1])).toBe(true);
  expect(area({ points, triangles })).toBeGreaterThan(5);
});

test("where there is nothing to be made fewer there is nothing else", () => {
  expect(cluster(new Float32Array(0), new Uint32Array(0), null)).toBeNull();
  expect(cluster(new Float32Array(plane.points.length), plane.triangles, null)).toBeNull();
  expect(cluster(new Float32Array(plane.points.length).fill(NaN), plane.triangles, null)).toBeNull();
  expect(cluster(plane.points, Uint32Array.from([0, 1, 1_000_000]), null)).toBeNull();
  const small = sheet(4, 4, (u, v) => [u, v, 0]);
  expect(cluster(small.points, small.triangles, null)).toBeNull();
  // On a line.
  expect(cluster(plane.points.map((value, i) => (i % 3 === 0 ? value : 0)), plane.triangles, null)).toBeNull();
});

test("a cloud of small parts would vanish, and is left whole", () => {
  const parts = Array.from({ length: 2_000 }, (_, i) => sheet(4, 4, (u, v) => [i % 50 + 0.1 * u, Math.floor(i / 50) + 0.1 * v, 0]));
  const cloud = together(...parts);
  expect(cluster(cloud.points, cloud.triangles, null, 2_000)).toBeNull();
});

test("places far from the middle and of any size make no difference", () => {
  for (const [size, away] of [[1e-9, 0], [1e12, 0], [1000, 5e5]] as const) {
    const { points, triangles } = sheet(300, 200, (u, v) => [away + 3 * size * u, away + 2 * size * v, 0]);
    const coarse = cluster(points, triangles, null, 12_000)!;
    expect(coarse.triangles.length / 3).toBeGreaterThan(6_000);
    expect(coarse.triangles.length / 3).toBeLessThan(15_000);
  }
});

test("lines between features are made fewer by the same points", () => {
  const representatives = Uint32Array.from([0, 0, 2, 2, 4]);
  expect([...coarsened(Uint32Array.from([0, 1, 1, 2, 2, 3, 3, 4, 3, 0]), 2, representatives)]).toEqual([0, 2, 2, 4]);
  expect([...coarsened(Uint32Array.from([0, 2, 4, 4, 1, 3, 0, 1, 2]), 3, representatives)]).toEqual([0, 2, 4]);
});
