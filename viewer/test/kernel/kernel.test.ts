import { beforeAll, describe, expect, it } from "vitest";
import { Kernel } from "../../src/kernel/kernel";
import { KernelError } from "../../src/kernel/module";
import type { SurfaceParts } from "../../src/kernel/kernel";
import { wasm } from "../wasm";

const COLUMNS = 12, ROWS = 6;

/** A bent sheet of quadrilaterals: "left" is fixed in the tests, "right" moved. */
function sheet(): SurfaceParts {
  const points: number[] = [], facePoints: number[] = [], faceFeatures: number[] = [];
  for (let j = 0; j <= ROWS; j++) for (let i = 0; i <= COLUMNS; i++) points.push(i / 4, j / 4, 0.2 * Math.sin(i / 3));
  for (let j = 0; j < ROWS; j++) for (let i = 0; i < COLUMNS; i++) {
    const a = j * (COLUMNS + 1) + i;
    facePoints.push(a, a + 1, a + COLUMNS + 2, a + COLUMNS + 1);
    faceFeatures.push(i < 2 ? 0 : i < COLUMNS - 2 ? 1 : 2);
  }
  return {
    points: Float64Array.from(points), vertices: Uint32Array.from({ length: points.length / 3 }, (_, i) => 10 + 2 * i),
    faceSizes: new Uint32Array(faceFeatures.length).fill(4), facePoints: Uint32Array.from(facePoints),
    faceFeatures: Uint32Array.from(faceFeatures), features: ["left", "middle", "right"],
  };
}
const move = (by: number[], features = ["right"], fixed = ["left"]) => [{ translate: { features, fixed, by } }];
const failure = (action: () => unknown): KernelError => {
  try {
    action();
  } catch (error) {
    expect(error).toBeInstanceOf(KernelError);
    return error as KernelError;
  }
  throw new Error("nothing failed");
};

describe("the geometry kernel as a module", () => {
  let kernel: Kernel;
  beforeAll(() => { kernel = new Kernel(wasm); });

  it("moves the handle as it is told, holds what is fixed, and lets the rest follow", () => {
    const parts = sheet();
    const surface = kernel.createSurface(parts);
    const { points, triangles, triangleFeatures, vertices, features } = surface.describe();
    expect(points).toEqual(parts.points);
    expect(vertices).toEqual(parts.vertices);
    expect(features).toEqual(parts.features);
    expect(triangles.length).toBe(3 * 2 * COLUMNS * ROWS);
    expect(new Set(triangleFeatures)).toEqual(new Set([0, 1, 2]));
    const displacement = surface.displacement(move([0.1, 0, 0.5]));
    for (let i = 0; i < points.length; i += 3) {
      const [x, , , dx, dy, dz] = [points[i]!, 0, 0, displacement[i]!, displacement[i + 1]!, displacement[i + 2]!];
      expect(dy).toBe(0);
      if (x >= (COLUMNS - 2) / 4) expect([dx, dz]).toEqual([0.1, 0.5]);
      else if (x <= 0.5) expect([dx, dz]).toEqual([0, 0]);
      else expect(dz > 0 && dz < 0.5 && Math.abs(dz - 5 * dx) < 1e-12).toBe(true);
    }
    expect(surface.displacement([]).every((value) => value === 0)).toBe(true);
    surface.close();
  });

  it("says what is wrong, and of what kind it is", () => {
    const surface = kernel.createSurface(sheet());
    const wrong = failure(() => surface.displacement(move([1, 0, 0], ["rigth"])));
    expect(wrong.kind).toBe("edit");
    expect(wrong.message).toMatch(/'rigth'.*'right'/);
    expect(failure(() => surface.displacement([{ translate: {} }])).kind).toBe("json");
    expect(failure(() => surface.displacement("not a stack")).kind).toBe("json");
    expect(failure(() => kernel.openSurface(Uint8Array.from([1, 2, 3]))).kind).toBe("frame");
    expect(failure(() => kernel.openSurface(Uint8Array.of(0x54, 0x4d, 0x42, 0x4c, 2, 1, 0, 0))).message).toMatch(/holds a frame, expected a surface/);
    expect(failure(() => kernel.createSurface({ ...sheet(), points: new Float64Array(3).fill(NaN) })).kind).toBe("input");
    const nowhere = sheet();
    nowhere.facePoints[3] = 4000;
    expect(failure(() => kernel.createSurface(nowhere)).message).toMatch(/vertex 4000/);
    const nan = sheet();
    nan.points[4] = NaN;
    expect(failure(() => kernel.createSurface(nan)).message).toMatch(/vertex 1: coordinate y is NaN/);
    expect(surface.displacement(move([1, 0, 0])).some((value) => value === 1)).toBe(true);
  });

  it("finds the skeleton of a tube, and says that a sheet has none", () => {
    const RINGS = 30, AROUND = 16;
    const points: number[] = [], facePoints: number[] = [];
    for (let ring = 0; ring < RINGS; ring++) for (let k = 0; k < AROUND; k++) {
      const turn = (2 * Math.PI * k) / AROUND;
      points.push(0.2 * ring, 0.5 * Math.cos(turn), 0.5 * Math.sin(turn));
      const next = (k + 1) % AROUND;
      if (ring > 0) facePoints.push((ring - 1) * AROUND + k, ring * AROUND + k, ring * AROUND + next, (ring - 1) * AROUND + next);
    }
    const faces = facePoints.length / 4;
    const surface = kernel.createSurface({
      points: Float64Array.from(points), vertices: Uint32Array.from({ length: points.length / 3 }, (_, i) => i),
      faceSizes: new Uint32Array(faces).fill(4), facePoints: Uint32Array.from(facePoints),
      faceFeatures: new Uint32Array(faces), features: ["wall"],
    });
    const { nodes, curves, nodeOfVertex } = surface.skeleton();
    expect(curves.length).toBe(1);
    expect([...curves[0]!].sort((a, b) => a - b)).toEqual(Array.from({ length: nodes.length / 3 }, (_, i) => i));
    expect(nodeOfVertex.length).toBe(points.length / 3);
    expect(Math.max(...nodeOfVertex)).toBeLessThan(nodes.length / 3);
    for (let i = 0; i < nodes.length; i += 3) expect(Math.hypot(nodes[i + 1]!, nodes[i + 2]!)).toBeLessThan(0.1);
    const middle = nodes.findIndex((x, i) => i % 3 === 0 && Math.abs(x - 2.9) < 0.3);
    const bent = surface.displacement([{ skeleton: { at: [...nodes.subarray(middle, middle + 3)], by: [0, 0.5, 0] } }]);
    expect(Math.max(...bent.filter((_, i) => i % 3 === 1))).toBeGreaterThan(0.45);
    expect(surface.check()).toBeNull();
    surface.displacement([{ skeleton: { at: [...nodes.subarray(middle, middle + 3)], by: [0, 0, 0] } }, { scale_direction: {
      features: ["wall"], region: { sphere: { center: [2.9, 0.5, 0], radius: 0.4 } }, fixed_region: { half_space: { origin: [1, 0, 0], normal: [-1, 0, 0] } }, factors: [-1, 1, 1] } }]);
    expect(surface.check()?.triangles.length).toBeGreaterThan(0);
    const plate = { ...sheet(), points: sheet().points.map((value, i) => (i % 3 === 2 ? 0 : value)) };
    const none = failure(() => kernel.createSurface(plate).skeleton());
    expect([none.kind, none.message]).toEqual(["skeleton", expect.stringMatching(/encloses no volume/)]);
    surface.close();
  });

  it("survives its own failure", () => {
    const surface = kernel.createSurface(sheet());
    const before = surface.displacement(move([0, 0, 0.25]));
    const { memory } = (kernel as unknown as { exports: { memory: WebAssembly.Memory } }).exports;
    new Uint8Array(memory.buffer).fill(0xff);
    const broken = failure(() => surface.displacement(move([0, 0, 0.25])));
    expect(broken.kind).toBe("trap");
    expect(broken.message).toMatch(/the geometry kernel failed/);
    expect(surface.displacement(move([0, 0, 0.25]))).toEqual(before);
  });
});
