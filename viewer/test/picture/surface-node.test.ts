import { expect, test } from "vitest";
import { cornersOf, drawCoarsely, keepPacked, sidesOf } from "../../src/picture/surface-node";
import type { CoarseBuffer, PointBuffer } from "../../src/picture/surface-node";

test("colours are written between the points of the buffer that is there", () => {
  const uploads: number[][] = [];
  const buffer = { upload: (packed: Float32Array) => uploads.push([...packed]) > 0 } as unknown as PointBuffer;
  const model = { indexed: true, blockSize: 5, tCoordOffset: 12, tCoordComponents: 2 };
  keepPacked(buffer, model);
  buffer.recolour(Float32Array.from([1, 2]));
  expect(uploads).toEqual([]);
  buffer.upload(Float32Array.from([7, 8, 9, 0, 0, 4, 5, 6, 0, 0]), 0);
  buffer.recolour(Float32Array.from([1, 2, 3, 4]));
  expect(uploads.at(-1)).toEqual([7, 8, 9, 1, 2, 4, 5, 6, 3, 4]);
  // Another number of points, colours by triangle, or none at all: vtk.js builds those itself.
  buffer.recolour(Float32Array.from([1, 2]));
  model.indexed = false;
  buffer.recolour(Float32Array.from([5, 6, 7, 8]));
  model.tCoordOffset = 0;
  buffer.upload(Float32Array.from([1, 2, 3]), 0);
  buffer.recolour(Float32Array.from([5, 6]));
  expect(uploads.length).toBe(3);
});

test("other cells are drawn over the points of the buffer that is there, and its own again", () => {
  const uploads: number[][] = [];
  const own = { getIndexBO: () => "own", getIndexElementType: () => "short", getIndexed: () => false, getElementCount: () => 6, releaseGraphicsResources: () => undefined };
  const buffer = { ...own } as unknown as CoarseBuffer;
  const model = { elementCount: 6, context: { UNSIGNED_INT: "int" } as unknown as WebGL2RenderingContext, _openGLRenderWindow: null };
  const indices = { setOpenGLRenderWindow: () => undefined, upload: (data: Uint32Array) => uploads.push([...data]) > 0, releaseGraphicsResources: () => undefined };
  drawCoarsely(buffer, model, () => indices);
  const told = (): unknown[] => [buffer.getIndexBO(), buffer.getIndexElementType(), buffer.getIndexed(), buffer.getElementCount()];
  expect(told()).toEqual(["own", "short", false, 6]);
  const coarse = Uint32Array.from([0, 2, 3]);
  for (let picture = 0; picture < 3; picture++) {
    buffer.draw(coarse);
    expect(told()).toEqual([indices, "int", true, 3]);
    buffer.draw(null);
    expect(told()).toEqual(["own", "short", false, 6]);
  }
  expect(uploads).toEqual([[0, 2, 3]]);
  buffer.draw(Uint32Array.from([1, 2, 3]));
  expect(uploads.length).toBe(2);
  // A lost context takes the list with it, and a buffer of nothing has nothing drawn.
  buffer.releaseGraphicsResources();
  expect(told()).toEqual(["own", "short", false, 6]);
  buffer.draw(coarse);
  expect(uploads.length).toBe(3);
  model.elementCount = 0;
  buffer.draw(coarse);
  expect(told()).toEqual(["own", "short", false, 6]);
});

test("triangles have three sides, and corners of their own where each has a colour", () => {
  expect([...sidesOf(Uint32Array.from([4, 5, 6]))]).toEqual([4, 5, 5, 6, 6, 4]);
  // Two triangles: their corners are 0 to 5, and point 2 is a corner of both.
  expect([...cornersOf(Uint32Array.from([0, 2, 3]), [3, 0, 1, 2, 3, 2, 1, 3])]).toEqual([0, 2, 5]);
});
