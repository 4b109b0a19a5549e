import { expect, it } from "vitest";
import { translation } from "../../src/picture/drag";

it("writes a drag as a person would: three digits, no dust, no negative zero", () => {
  expect(translation([1, 2, 3], [1.0123456, 2, 2.9999999])).toEqual([0.0123, 0, 0]);
  expect(translation([0, 0, 0], [12345.6, -51.2, 0.4])).toEqual([12300, -100, 0]);
  expect(translation([0, 0, 0], [1e-9, 0, 1.23456e-7])).toEqual([1e-9, 0, 1.23e-7]);
  expect(translation([1, 1, 1], [1, 1, 1])).toEqual([0, 0, 0]);
  expect(translation([0, 0, 0], [NaN, 0, 0])).toEqual([0, 0, 0]);
});
