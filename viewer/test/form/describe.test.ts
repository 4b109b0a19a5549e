import { describe, expect, it } from "vitest";
import type { Json } from "../../src/connection/protocol";
import { describeEdit, describeOrder, titleOf } from "../../src/form/describe";

describe("an order in words", () => {
  it("names what is done as a person would", () => {
    expect(describeOrder({ undo: 1 })).toBe("Undo");
    expect(describeOrder({ edits: [{ scale_direction: { features: ["throat"], factors: [1, 1, 0.5] } }] })).toBe("Throat: height × 0.5");
    expect(describeEdit({ scale_direction: { features: ["throat"], factors: [1, 0.9, 0.5] } })).toBe("Throat: width × 0.9, height × 0.5");
    expect(describeEdit({ translate: { features: ["a", "b"], by: [0, -2e-4, 0] } })).toBe("A, b: moved by −2e−4 along y");
    expect(describeEdit({ translate: { features: ["a"], by: [1, -2, 0] } })).toBe("A: moved by (1, −2, 0)");
    expect(describeEdit({ rotate: { features: ["bypass"], axis: [0, 0, 3], degrees: 20 } })).toBe("Bypass: turned by 20° about z");
    expect(describeEdit({ scale_normals: { features: ["hull"], distance: -0.02 } })).toBe("Hull: inward by 0.02");
    expect(describeEdit({ skeleton: { moves: [{ at: [0, 0, 0], by: [0, 0, 1] }] } })).toBe("Skeleton dragged by 1 along z");
    expect(titleOf({ rotate: { region: { half_space: {} }, axis: [0, 0, 1], degrees: -15, name: "tilt", muted: true } })).toBe("tilt");
    expect(describeOrder({ stack: [] })).toBe("Back to the reference shape");
    for (const odd of [null, 3, [], {}, { edits: [null, 3, {}] }] as Json[]) expect(describeOrder(odd)).toBeTypeOf("string");
  });
});
