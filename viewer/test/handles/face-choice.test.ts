import { describe, expect, it } from "vitest";
import { boxRegionOf, combined, grown, meantBy, neighboursOf, regionOf } from "../../src/handles/face-choice";
import { contains } from "../../src/handles/gizmo";
import { VisibleFaces } from "../../src/handles/visible-faces";
import { camera, OBLIQUE } from "./cameras";
import { cube } from "./cube";

const { points, triangles, sides } = cube(6);
const seen = new VisibleFaces(points, triangles, OBLIQUE);
const sidesOf = (faces: Iterable<number>): number[] => [...new Set([...faces].map((face) => sides[face]!))].sort((a, b) => a - b);

describe("a stroke over the picture", () => {
  it("takes the faces that are seen, and with through those behind them too", () => {
    const everywhere = (): boolean => true;
    // From x > 0, y < 0, z > 0 three sides are seen: +x, -y and +z.
    expect(sidesOf(seen.within(everywhere, false))).toEqual([0, 3, 4]);
    expect(seen.within(everywhere, false).size).toBe(3 * 72);
    expect(seen.within(everywhere, true).size).toBe(6 * 72);
  });

  it("takes with a lasso what lies in it", () => {
    const [x, y] = OBLIQUE.toPicture([0, 0, 1])!;
    const lasso: [number, number][] = [[x - 30, y - 20], [x + 30, y - 20], [x + 30, y + 20], [x - 30, y + 20]];
    const faces = seen.within((place) => contains(lasso, place), false);
    expect(faces.size).toBeGreaterThan(4);
    expect(sidesOf(faces)).toEqual([4]);
    expect(sidesOf(seen.within((place) => contains(lasso, place), true)).length).toBeGreaterThan(1);
    expect(seen.within(() => false, true).size).toBe(0);
  });

  it("takes with a brush what it touches, also of large faces", () => {
    const coarse = cube(1);
    const few = new VisibleFaces(coarse.points, coarse.triangles, OBLIQUE);
    const place = OBLIQUE.toPicture([0.5, -0.6, 1])!;
    expect([...few.around(place, 4)].map((face) => coarse.sides[face])).toEqual([4]);
    expect(few.at(place)).not.toBeNull();
    expect(few.at([-5, 3])).toBeNull();
    expect(few.around([1, 1], 8).size).toBe(0);
  });

  it("sees nothing of what lies behind the viewer", () => {
    const inFront = new VisibleFaces(points, triangles, camera([5, 0, 0], [10, 0, 0], [0, 0, 1]));
    expect(inFront.within(() => true, true).size).toBe(0);
  });
});

describe("a choice of faces", () => {
  it("is added to and taken from", () => {
    const before = new Set([1, 2, 3]), stroke = new Set([3, 4]);
    expect([...combined(before, stroke, "replace")]).toEqual([3, 4]);
    expect([...combined(before, stroke, "add")]).toEqual([1, 2, 3, 4]);
    expect([...combined(before, stroke, "take")]).toEqual([1, 2]);
    expect([...before]).toEqual([1, 2, 3]);
  });

  it("grows until an edge is sharper than the angle", () => {
    const neighbours = neighboursOf(triangles);
    expect(neighbours.every((face) => face >= 0), "a closed surface").toBe(true);
    const side = grown(points, triangles, neighbours, 0, 30);
    expect(side.size).toBe(72);
    expect(sidesOf(side)).toEqual([sides[0]]);
    expect(grown(points, triangles, neighbours, 0, 90).size).toBe(6 * 72);
    expect(grown(points, triangles, neighbours, 0, 89).size).toBe(72);
    expect([...neighboursOf(Uint32Array.of(0, 1, 2))]).toEqual([-1, -1, -1]);
  });

  it("is a region as the schema has it, by faces or by the box around them", () => {
    expect(regionOf(new Set([7, 2, 30]))).toEqual({ faces: [2, 7, 30] });
    expect(regionOf(new Set())).toBeNull();
    const top = new Set([...sides.keys()].filter((face) => sides[face] === 4));
    const region = boxRegionOf(top, triangles, points);
    expect(region).toEqual({ box: { lower: [-1, -1, 1], upper: [1, 1, 1] } });
    expect(meantBy(region, triangles, points)!.faces).toEqual(top);
  });

  it("is what any region of the schema means", () => {
    expect(meantBy({ faces: [0, 1, 99999] }, triangles, points)!.faces).toEqual(new Set([0, 1]));
    expect(meantBy({ half_space: { origin: [0, 0, 0.9], normal: [0, 0, 2] } }, triangles, points)!.points.size).toBe(49);
    expect(meantBy({ sphere: { center: [0, 0, 0], radius: 1.01 } }, triangles, points)!.points.size).toBe(6);
    expect(meantBy({ box: { lower: [0] } }, triangles, points)).toBeNull();
    expect(meantBy(null, triangles, points)).toBeNull();
  });
});
