import { describe, expect, it } from "vitest";
import { closestAlong, meetPlane } from "../../src/handles/projection";
import { add, dot, length, subtract, times } from "../../src/handles/vector";
import { ALONG_X, HEIGHT, OBLIQUE, PARALLEL, WIDTH } from "./cameras";
import type { Vector } from "../../src/connection/protocol";

describe("the projection of the picture", () => {
  it("draws what the viewer looks at in the middle, and up is up", () => {
    expect(OBLIQUE.toPicture([0.2, 0.1, 0])!.map((value) => Number(value.toFixed(6)))).toEqual([WIDTH / 2, HEIGHT / 2]);
    expect(ALONG_X.toPicture([0, 0, 1])![1]).toBeLessThan(HEIGHT / 2);
    expect(ALONG_X.toPicture([0, 1, 0])![0]).toBeGreaterThan(WIDTH / 2);
    expect(ALONG_X.toPicture([11, 0, 0]), "behind the viewer").toBeNull();
  });

  it("is undone exactly", () => {
    for (const projection of [OBLIQUE, PARALLEL, ALONG_X]) {
      for (const point of [[0, 0, 0], [1, -2, 0.5], [-0.3, 0.4, 1.1]] as Vector[]) {
        const back = projection.toSpace(projection.toPicture(point)!, projection.depth(point));
        expect(length(subtract(back, point))).toBeLessThan(1e-9);
        const { origin, direction } = projection.ray(projection.toPicture(point)!);
        const way = subtract(point, origin);
        expect(length(subtract(way, times(direction, dot(way, direction)))), "the ray meets the point").toBeLessThan(1e-6);
        expect(dot(direction, projection.direction)).toBeGreaterThan(0.8);
      }
    }
  });

  it("says how long a pixel is", () => {
    for (const projection of [OBLIQUE, PARALLEL]) {
      const pixel = projection.pixel([0, 0, 0]);
      // A step across the line of sight.
      const [x, y] = projection.toPicture([0, 0, 0])!;
      const step = subtract(projection.toSpace([x, y + 10], projection.depth([0, 0, 0])), [0, 0, 0]);
      expect(length(step) / pixel).toBeCloseTo(10, 1);
    }
    expect(PARALLEL.pixel([0, 0, 0])).toBeCloseTo(4 / HEIGHT, 9);
  });

  it("meets planes and lines", () => {
    const ray = { origin: [0, 0, 5] as Vector, direction: [0, 0.6, -0.8] as Vector };
    expect(meetPlane(ray, [9, 9, 1], [0, 0, 2])).toEqual([0, 3, 1]);
    expect(meetPlane(ray, [0, 0, 0], [1, 0, 0]), "along the plane").toBeNull();
    const along = closestAlong({ origin: [3, 1, 7], direction: [0, 0, -1] }, [0, 0, 0], [1, 0, 0]);
    expect(along).toBeCloseTo(3, 12);
    expect(closestAlong({ origin: [3, 1, 7], direction: [1, 0, 0] }, [0, 0, 0], [1, 0, 0])).toBeNull();
    expect(add([1, 2, 3], [1, 1, 1])).toEqual([2, 3, 4]);
  });
});
