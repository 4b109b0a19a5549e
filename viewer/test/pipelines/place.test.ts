import { describe, expect, it } from "vitest";
import { placeAt, rangeOf, readSoFar, readPath, tokenRange } from "../../src/pipelines/place";

/** The place at the `|` of a text, which is not part of it. */
const at = (marked: string) => {
  const offset = marked.indexOf("|");
  return placeAt(marked.replace("|", ""), offset);
};

const RUBBISH = ['}]}"', '{"a"::,,[}', '["\\', '{"a": "x\ny"}', ":::", '"', '{{{{[[[["', '{"a": [1] {"length": 5}}', '{"__proto__" {"polluted": 1}}', '{"constructor" {"polluted": 1}}'];

describe("where something is written", () => {
  it("is found in a text that is whole", () => {
    expect(at('{"name": "a", "stages": [{"slice": {"nor|mal": [1, 0, 0]}}]}')).toMatchObject({ path: ["stages", 0, "slice"], part: "key", keys: [], hasColon: true });
    expect(at('{"stages": [{"a": {}}, {"slice": {"origin": [0], "normal": [1, |0, 0]}}]}')).toMatchObject({ path: ["stages", 1, "slice", "normal", 1], part: "value" });
    expect(at('{"on": "or|der", "name": "a"}')).toMatchObject({ path: ["on"], part: "value", from: 7, to: 14, keys: ["name"] });
    expect(at('{"a": 1, |"b": 2, "c": {"d": 3}}')).toMatchObject({ path: [], part: "key", keys: ["a", "b", "c"], from: 9, to: 9 });
  });

  it("is found in one that is being written", () => {
    expect(at('{"name": "a", "|"}')).toMatchObject({ path: [], part: "key", keys: ["name"], from: 14, to: 16, hasColon: false });
    expect(at('{"stages": [{"select": {"fields": ["ve|')).toMatchObject({ path: ["stages", 0, "select", "fields", 0], part: "value" });
    expect(at('{"stages": [{"sl|"}, {"stream": {}}], "every": {}}')).toMatchObject({ path: ["stages", 0], part: "key", keys: [] });
    expect(at('{"stages": [|]}')).toMatchObject({ path: ["stages", 0], part: "value", from: 12, to: 12 });
    expect(at('{"every": |}')).toMatchObject({ path: ["every"], part: "value" });
    expect(at("|")).toMatchObject({ path: [], part: "value" });
    // A quote that is escaped closes nothing.
    expect(at('{"name": "a\\"|')).toMatchObject({ path: ["name"], part: "value", from: 9, to: 13 });
  });

  it("is nowhere where nothing can be", () => {
    expect(at('{"a" |')).toBeNull();
    expect(at('{"a": 1 |}')).toBeNull();
    expect(at('{"a": "b"|}')).toBeNull();
    expect(at("{} |")).not.toBeUndefined();
  });

  it("is a token by its line and column, and by its path", () => {
    const text = '{"näme": "a𝒷",\n "stages": [{"slice": {"nromal": 1}}]}';
    const cut = ({ from, to }: { from: number; to: number }) => text.slice(from, to);
    expect(cut(tokenRange(text, 2, 24))).toBe('"nromal"');
    expect(cut(tokenRange(text, 1, 10))).toBe('"a𝒷"');
    expect(cut(tokenRange(text, 1, 14))).toBe(",");
    expect(cut(tokenRange(text, 1, 1))).toBe("{");
    expect(tokenRange("", 3, 5)).toEqual({ from: 0, to: 0 });
    expect(readPath("stages[0].slice.normal")).toEqual(["stages", 0, "slice", "normal"]);
    expect(cut(rangeOf(text, ["stages", 0, "slice", "nromal"])!)).toBe("1");
    expect(cut(rangeOf(text, ["stages", 0, "slice", "other"])!)).toBe("{");
    expect(text.indexOf(cut(rangeOf(text, ["stages", 0])!))).toBe(0);
  });

  it("is told of any rubbish without a failure", () => {
    for (const text of RUBBISH) for (let offset = 0; offset <= text.length; offset++) expect(() => placeAt(text, offset)).not.toThrow();
  });
});

describe("what is written so far", () => {
  it("is all of a text that is whole", () => {
    const whole = { name: "a\"b", stages: [{ slice: { origin: [0, -1.5e3, null], on: true } }, {}], when: "" };
    expect(readSoFar(JSON.stringify(whole, null, 1))).toEqual(whole);
    expect(readSoFar('{"__proto__": {"polluted": 1}}')).toEqual(JSON.parse('{"__proto__": {"polluted": 1}}'));
  });

  it("is what has a value of one that is being written", () => {
    expect(readSoFar('{"name": "a", "stages": [{"gradient": {"field": "p"}}, {"select": {"fields": ["v')).toEqual({ name: "a", stages: [{ gradient: { field: "p" } }, { select: { fields: ["v"] } }] });
    expect(readSoFar('{"stages": [{"gradient": {"field": "p",}}, {"contour": {"field": }}, {"stream": {}}], "wh')).toEqual({ stages: [{ gradient: { field: "p" } }, { contour: {} }, { stream: {} }] });
    expect([readSoFar(""), readSoFar("nonsense")]).toEqual([null, null]);
  });

  it("is read from any rubbish without a failure", () => {
    for (const text of RUBBISH) for (let end = 0; end <= text.length; end++) expect(() => readSoFar(text.slice(0, end))).not.toThrow();
    expect("polluted" in {}).toBe(false);
  });
});
