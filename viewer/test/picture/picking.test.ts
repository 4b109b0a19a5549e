import { describe, expect, it } from "vitest";
import { extremes, scalars } from "../../src/picture/colour";
import { digits, readNumber, seconds, whyNoNumber, within } from "../../src/number";
import { bounds, featureEdges } from "../../src/picture/picking";

// Two parallel unit squares, at z = 0 and z = 1, of two triangles each.
const points = Float32Array.from([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1]);
const triangles = Uint32Array.from([0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7]);

describe("picking", () => {
  it("finds the edges between features and at the border", () => {
    const edges = (features: number[]): string[] => {
      const found = featureEdges(triangles, Uint32Array.from(features), 8);
      return Array.from({ length: found.length / 2 }, (_, i) => `${found[2 * i]}-${found[2 * i + 1]}`).sort();
    };
    expect(edges([0, 0, 1, 1])).toEqual(["0-1", "0-3", "1-2", "2-3", "4-5", "4-7", "5-6", "6-7"]);
    expect(edges([0, 1, 1, 1])).toContain("0-2");
  });

  it("finds where more than two triangles meet, whatever their order", () => {
    const three = Uint32Array.from([0, 1, 2, 1, 0, 3, 0, 1, 4]);
    const found = [...featureEdges(three, new Uint32Array(3), 5)];
    const edges = Array.from({ length: found.length / 2 }, (_, i) => `${found[2 * i]}-${found[2 * i + 1]}`);
    expect(edges).toEqual(["0-1", "0-2", "0-3", "0-4", "1-2", "1-3", "1-4"]);
    expect(featureEdges(new Uint32Array(0), new Uint32Array(0), 0).length).toBe(0);
  });

  it("measures boxes", () => {
    expect(bounds(points)).toEqual([[0, 0, 0], [1, 1, 1]]);
    expect(bounds(points, triangles, (triangle) => triangle >= 2)).toEqual([[0, 0, 1], [1, 1, 1]]);
    expect(bounds(points, triangles, () => false)).toBeNull();
  });
});

describe("scalars", () => {
  const field = { name: "v", association: "vertex" as const, components: 3, values: Float64Array.from([3, 4, 0, 0, 0, -2]), range: null };
  it("are the magnitude or a component", () => {
    expect([...scalars(field, -1)]).toEqual([5, 2]);
    expect([...scalars(field, 1)]).toEqual([4, 0]);
    expect(extremes(Float64Array.from([NaN, 2, -1, Infinity]))).toEqual([-1, 2]);
    expect(extremes(new Float64Array(0))).toBeNull();
  });
});

describe("numbers", () => {
  it("have the digits that matter", () => {
    expect([0, 1, 0.061234, 12345.678, 123456, 1.5e-7, -2, NaN, Infinity, null].map((value) => digits(value))).toEqual(
      ["0", "1", "0.06123", "12346", "1.23e5", "1.5e−7", "−2", "–", "∞", "–"]);
    expect([2e-5, 0.0613, 2.5, 300].map((value) => seconds(value))).toEqual(["20\u00a0µs", "61.3\u00a0ms", "2.5\u00a0s", "5\u00a0min"]);
    expect(within(7.7e-5, [0, 18])).toBe("0");
    expect(within(101325.25, [101325, 101326])).toBe("101325.25");
  });
  it("are read back", () => {
    expect([" 1.5 ", "−2", "1,5", ".5", "1e-3", "x", "", "1e999"].map(readNumber)).toEqual([1.5, -2, 1.5, 0.5, 0.001, null, null, null]);
    expect(["1,500", "-12,345", "1,234,567", "1.234,5"].map(readNumber)).toEqual([null, null, null, null]);
    expect(["0,125", "1234,567", "12,3456", "1,50", "-0,125"].map(readNumber)).toEqual([0.125, 1234.567, 12.3456, 1.5, -0.125]);
    expect(["1,500", "−12,345", "1,234,567", "x", " ", "1,5"].map(whyNoNumber)).toEqual([
      "“1,500” can be read in two ways: write 1500 or 1.5", "“−12,345” can be read in two ways: write -12345 or -12.345",
      "“1,234,567” has commas: write 1234567", "“x” is not a number", "is empty", ""]);
    for (const value of [-2.5e-6, -5e-4, 3e-6, -1.25e7, -0.005]) expect(readNumber(digits(value)), digits(value)).toBe(value);
  });
});
