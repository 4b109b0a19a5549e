import { describe, expect, it } from "vitest";
import type { Json, Vector } from "../../src/connection/protocol";
import { Language } from "../../src/kernel/language";
import { markOf, refusalMark } from "../../src/pipelines/marks";
import { pretty } from "../../src/pipelines/pretty";
import { TEMPLATES, freeName } from "../../src/pipelines/templates";
import { cadence, costText, purpose } from "../../src/pipelines/words";
import { feature } from "../page";
import { languageWasm } from "../wasm";

const field = (name: string, components: number) => ({ name, association: "vertex" as const, components });
const run = { fields: [field("velocity", 3), field("pressure", 1)], features: [feature("inlet", "inflow"), feature("throat", "wall")], box: [[0, -0.5, 0], [0.05, 0.55, 0.1]] as [Vector, Vector] };
const language = new Language(languageWasm);
const check = (text: string, pipelines: Json[] = [], replaced: string | null = null) => language.checkPipeline({ text, replaced, pipelines, parameters: [] });

describe("pipelines in words", () => {
  it("say what is done, when, and what it costs", () => {
    expect(purpose({ name: "m", stages: [{ slice: { origin: [0.3, 0, 0], normal: [2, 0, 0] } }, { select: { fields: ["p", "u"] } }, { stream: {} }] })).toBe("slice across x at 0.3 → p, u → streamed");
    expect(purpose({ name: "h", stages: [{ quality: {} }], when: "quality.min < 0", then: [{ stop: {} }] })).toBe("quality of the cells · when quality.min < 0: stop");
    expect(purpose({ name: "d", description: "In my words", stages: [] })).toBe("In my words");
    expect(purpose({ name: "r", stages: [5, null, [], { q_criterion: 3 }] as Json[] })).toContain("q criterion");
    expect([{ every: { steps: 5 } }, { every: { seconds: 2 } }, { every: { time: 0.5 } }, {}, { at: { cycle: 3 } }, { on: "order" }].map((due) => cadence({ name: "a", stages: [], ...due })))
      .toEqual(["every 5 steps", "every 2 s", "every 0.5 of time", "every step", "once, at cycle 3", "settings of orders"]);
    expect(costText({ name: "a", runs: 4, seconds: 0.02, bytes: 8000, memory: 0, every: 2 })).toBe("5\u00a0ms, 2\u00a0kB a run, at one in 2 of its times");
    expect(costText({ name: "a", runs: 0, seconds: 0, bytes: 0, memory: 0, every: 1 })).toBe("");
  });

  it("are laid out so that they are read, and stay the same", () => {
    for (const { make } of TEMPLATES) expect(JSON.parse(pretty(make(run) as Json))).toEqual(make(run));
    expect(pretty({ name: "a", every: { steps: 5 }, stages: [{ stream: {} }] })).toBe('{\n  "name": "a",\n  "every": { "steps": 5 },\n  "stages": [{ "stream": {} }]\n}');
  });

  it("are there to begin with, as the run takes them", () => {
    for (const { key, make } of TEMPLATES) {
      const text = pretty(make(run));
      expect(check(text).errors.length, `${key}: ${text}`).toBe(key === "empty" ? 1 : 0);
    }
    const made = Object.fromEntries(TEMPLATES.map(({ key, make }) => [key, JSON.stringify(make(run).stages)]));
    expect(made.slice).toContain('"origin":[0.025,0.025,0.05],"normal":[0,1,0]');
    expect(made.force).toContain('"features":["throat"],"pressure":"pressure"');
    expect(made.statistics).toContain('"velocity"');
    expect(freeName("slice", [{ name: "slice" }, { name: "slice 2" }])).toBe("slice 3");
  });
});

describe("marks", () => {
  it("stand under the token, with what would put it right", () => {
    const text = '{"name": "cut", "stages": [\n  {"slice": {"origin": [0, 0, 0], "nromal": [1, 0, 0]}}],\n "when": "inlt.mean > 1", "then": [{"pause": {}}]}';
    const others = [{ name: "inlet", stages: [{ statistics: { field: "p", name: "inlet" } }] }];
    const { errors } = check(text, others);
    const marks = errors.map((error) => markOf(text, error));
    expect(marks.map(({ from, to, line }) => [text.slice(from, to), line])).toEqual([['"nromal"', 2], ['"inlt.mean > 1"', 3]].slice(0, marks.length));
    expect(marks[0]!.fix).toEqual({ name: "normal", insert: '"normal"' });
    expect(marks[0]!.text).toMatch(/^stages\[0\]\.slice\.nromal: found the unknown key “nromal”, .*; did you mean normal\?$/);
    const mended = text.replace("nromal", "normal");
    const formula = check(mended, others).errors.map((error) => markOf(mended, error));
    expect(formula.map(({ fix }) => fix)).toEqual([{ name: "inlet.mean", insert: '"inlet.mean > 1"' }]);
    expect(check(text.replace("nromal", "normal").replace("inlt", "inlet"), others).errors).toEqual([]);
  });

  it("stand under what the run has refused", () => {
    const text = '{"name": "lift", "stages": [{"surface": {}}, {"integrate": {"name": "a", "features": ["z_max"]}}]}';
    const mark = refusalMark(text, "pipeline `lift`: there is no feature 'z_max'; did you mean 'z-max'?")!;
    expect([text.slice(mark.from, mark.to), mark.fix]).toEqual(['"z_max"', { name: "z-max", insert: '"z-max"' }]);
    const by = refusalMark(text, "message:1:57: pipelines.set[0].stages[1].integrate.name: found `a`")!;
    expect(text.slice(by.from, by.to)).toBe('"a"');
    expect(refusalMark(text, "the journal is full")).toBeNull();
  });
});
