import { describe, expect, it } from "vitest";
import type { Vector } from "../../src/connection/protocol";
import { bent } from "../../src/handles/bend";
import { add, dot, length, subtract } from "../../src/handles/vector";

/** A straight branch along x, its ends held or free. */
const branch = (ends: [boolean, boolean] = [true, true]) =>
  Array.from({ length: 8 }, (_, i) => ({ place: [i, 0, 0] as Vector, isPinned: i === 0 ? ends[0] : i === 7 ? ends[1] : false }));
const after = (nodes: ReturnType<typeof branch>, ways: Vector[]): Vector[] => nodes.map(({ place }, i) => add(place, ways[i]!));
const angle = (a: Vector, b: Vector): number => (Math.acos(dot(a, b) / length(a) / length(b)) * 180) / Math.PI;

describe("a bend at a control node", () => {
  it("makes the angle between its two sides another one by exactly what is asked for, in the plane", () => {
    const nodes = branch();
    const places = after(nodes, bent(nodes, 3, [0, 0, 1], 20)!);
    expect(angle(subtract(places[2]!, places[3]!), subtract(places[4]!, places[3]!))).toBeCloseTo(160, 6);
    // Both sides rise, and the node itself stays.
    expect(places[3]).toEqual([3, 0, 0]);
    expect(places[2]![1]).toBeGreaterThan(0);
    expect(places[2]![1]).toBeCloseTo(places[4]![1], 9);
    expect(places.every((place) => place[2] === 0)).toBe(true);
  });

  it("fades out towards ends that stay, and turns a free end as a whole", () => {
    const held = branch();
    const ways = bent(held, 3, [0, 0, 1], 20)!;
    expect(ways[0]).toEqual([0, 0, 0]);
    expect(ways[7]).toEqual([0, 0, 0]);
    const free = branch([true, false]);
    const places = after(free, bent(free, 3, [0, 0, 1], 20)!);
    for (let i = 4; i < 8; i++) expect(angle(subtract(places[i]!, [3, 0, 0]), [1, 0, 0])).toBeCloseTo(10, 6);
  });

  it("turns one side by the whole angle where the other has nothing to turn", () => {
    const nodes = branch([true, false]);
    const places = after(nodes, bent(nodes, 1, [0, 0, 1], 20)!);
    expect(places[0]).toEqual([0, 0, 0]);
    expect(angle(subtract(places[2]!, places[1]!), [1, 0, 0])).toBeCloseTo(20, 6);
    expect(bent(branch().slice(0, 1), 0, [0, 0, 1], 20)).toBeNull();
  });

  it("leaves where they are the nodes that only rounding would move", () => {
    const nodes = Array.from({ length: 4 }, (_, i) => ({ place: [1e-17 * i, 0, i] as Vector, isPinned: false }));
    expect(bent(nodes, 1, [0, 0, 1], 20)).toEqual(nodes.map(() => [0, 0, 0]));
  });

  it("the other way round for an angle below 0", () => {
    const nodes = branch();
    const [up, down] = [bent(nodes, 3, [0, 1, 0], 12)!, bent(nodes, 3, [0, 1, 0], -12)!];
    up.forEach((way, i) => expect(way[2]).toBeCloseTo(-down[i]![2], 9));
  });
});
