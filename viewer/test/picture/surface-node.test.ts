import { expect, test } from "vitest";
import { keepPacked } from "../../src/picture/surface-node";
import type { PointBuffer } from "../../src/picture/surface-node";

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
