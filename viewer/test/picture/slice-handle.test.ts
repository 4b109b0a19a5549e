import { describe, expect, it } from "vitest";
import type { Vector } from "../../src/connection/protocol";
import { add, dot, length, normalised, times } from "../../src/handles/vector";
import { outlineOf } from "../../src/picture/slice-handle";

const BOX: [Vector, Vector] = [[0, 0, 0], [2, 1, 1]];

describe("the outline of a cut", () => {
  it("across an axis is the rectangle there", () => {
    const points = outlineOf(BOX, { origin: [0.5, 9, 9], normal: [3, 0, 0] });
    expect(points).toHaveLength(4);
    expect(points.every(([x]) => x === 0.5)).toBe(true);
    // Around it, not across: neighbours are 1 apart.
    points.forEach((point, i) => expect(length(add(points[(i + 1) % 4]!, times(point, -1)))).toBeCloseTo(1, 12));
  });

  it("of a slanted plane lies in it, with up to six corners", () => {
    const normal = normalised([1, 1, 1]);
    const points = outlineOf([[0, 0, 0], [1, 1, 1]], { origin: [0.5, 0.5, 0.5], normal });
    expect(points).toHaveLength(6);
    for (const point of points) expect(dot(point, normal)).toBeCloseTo(1.5 / Math.sqrt(3), 12);
    const steps = points.map((point, i) => length(add(points[(i + 1) % 6]!, times(point, -1))));
    for (const step of steps) expect(step).toBeCloseTo(Math.SQRT1_2, 12);
  });

  it("beside the box is none", () => {
    expect(outlineOf(BOX, { origin: [5, 0, 0], normal: [1, 0, 0] }).length).toBeLessThan(3);
  });
});
