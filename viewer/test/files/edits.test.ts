import { describe, expect, it } from "vitest";
import { readEdits, writeEdits } from "../../src/files/edits";

const STACK = [{ translate: { features: ["throat"], by: [0, 0, 0.01] } }, { rotate: { features: ["throat"], axis: [0, 0, 1], degrees: 20, muted: true } }];

describe("edits in a file", () => {
  it("come back as they were", () => expect(readEdits(writeEdits(STACK))).toEqual({ stack: STACK }));

  it("are read from orders and from lists, too", () => {
    for (const file of [STACK, { edits: STACK }, { order: { stack: STACK } }, { order: { edits: STACK, schedule: { steps: 2 } } }]) expect(readEdits(JSON.stringify(file))).toEqual({ stack: STACK });
    expect(readEdits("[]")).toEqual({ stack: [] });
  });

  it("are not made of anything else: what is wrong is said", () => {
    expect(readEdits("{")).toEqual({ wrong: expect.stringMatching(/not JSON/) });
    expect(readEdits("3")).toEqual({ wrong: expect.stringMatching(/no list of edits/) });
    expect(readEdits('{"stack": [{"translate": {}}, {"a": {}, "b": {}}]}')).toEqual({ wrong: expect.stringMatching(/entry 2/) });
    expect(readEdits("[null]")).toEqual({ wrong: expect.stringMatching(/entry 1/) });
  });
});
