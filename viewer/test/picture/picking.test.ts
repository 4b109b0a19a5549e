import { describe, expect, it } from "vitest";
import { extremes, scalars } from "../../src/picture/colour";
import { digits, fitting, pointed, readNumber, seconds, whyNoNumber, within } from "../../src/number";
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
    expect(extremes(Float64Array.from([NaN, 2, -1, Infinity]))).toEqual({ range: [-1, 2], hasGaps: true });
    expect(extremes(Float64Array.from([2, -1]))).toEqual({ range: [-1, 2], hasGaps: false });
    expect(extremes(new Float64Array(0))).toEqual({ range: null, hasGaps: false });
  });

  it("of a vector are written where there is room for them, and those of a number are its own", () => {
    const room = new Float64Array(2);
    expect(scalars(field, -1, room)).toBe(room);
    expect([...room]).toEqual([5, 2]);
    expect(scalars(field, 1, new Float64Array(3))).toHaveLength(2);
    const single = { ...field, components: 1 };
    expect(scalars(single, -1, room)).toBe(field.values);
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
  it("are seen whole in an input, with their power of ten", () => {
    expect([0.1 + 0.2, 0.00000382516, -1.409523e-19, 123456789.5, -0.000123456, 1234.56789, 42, 1e21, -1.234e-300, -99999999.6].map((value) => fitting(value, 8))).toEqual(
      ["0.3", "3.825e-6", "-1.4e-19", "1.2346e8", "-1.23e-4", "1234.568", "42", "1e+21", "-1e-300", "-1e8"]);
    for (const value of [Math.PI * 1e-7, -Math.E * 1e-8, 1e15 / 7, -Math.PI * 1e200]) {
      expect(fitting(value, 7).length, fitting(value, 7)).toBeLessThanOrEqual(7);
      expect(Math.abs(readNumber(fitting(value, 8))! / value - 1)).toBeLessThan(0.05);
    }
  });
  it("that are pointed at have no more digits than the size of the model gives them", () => {
    expect(pointed([-1.4095e-19, 0.30000001192092896, 1.25], 2.8)).toEqual([0, 0.3, 1.25]);
    expect(pointed([-1.4095e-19, 3.82516e-6, 1e-13], 4e-5)).toEqual([0, 3.82516e-6, 0]);
    expect(pointed([123456789.4, -0.2, 7e8], 2e9)).toEqual([123457000, 0, 7e8]);
    expect(pointed([1e-19, 2, 3], 0)).toEqual([1e-19, 2, 3]);
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
