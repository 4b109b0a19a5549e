import { describe, expect, it } from "vitest";
import type { Json } from "../../src/connection/protocol";
import { Language } from "../../src/kernel/language";
import { readsDescribed } from "../../src/pipelines/names";
import type { RunNames } from "../../src/pipelines/names";
import { nearest } from "../../src/pipelines/nearest";
import { TEMPLATES } from "../../src/pipelines/templates";
import { unknownNames } from "../../src/pipelines/unknown-names";
import type { Pipeline } from "../../src/store/pipelines";
import { HELLO, feature } from "../page";
import { languageWasm } from "../wasm";

const RUN: RunNames = {
  fields: ["velocity", "pressure", "wall distance"].map((name) => ({ name, description: "" })),
  features: ["inlet", "outlet", "throat"], channels: [], parameters: ["inflow"], monitors: [],
};
const language = new Language(languageWasm);

/** The marks of stages, each as its token, its message without the path, and the text that would take its place. */
function found(stages: Json[], run = RUN, more: { [key: string]: Json } = {}) {
  const text = JSON.stringify({ name: "a", stages, ...more });
  return unknownNames(text, run).map((mark) => {
    expect(mark.isWarning).toBe(true);
    return [text.slice(mark.from, mark.to), mark.text, mark.fix?.insert];
  });
}
const tokens = (stages: Json[], more: { [key: string]: Json } = {}): unknown[] => found(stages, RUN, more).map(([token]) => token);

describe("names that nobody has", () => {
  it("are fields and features, with the nearest name", () => {
    expect(found([{ contour: { field: "presure", values: [0] } }])).toEqual([
      ['"presure"', "stages[0].contour.field: neither the run nor a stage before has a field “presure”; did you mean pressure?", '"pressure"'],
    ]);
    expect(found([{ surface: {} }, { integrate: { name: "a", features: ["throat", "inlt"] } }])).toEqual([
      ['"inlt"', "stages[1].integrate.features[1]: the run has no feature “inlt”; did you mean inlet?", '"inlet"'],
    ]);
    expect(found([{ select: { fields: ["vorticity"] } }])).toEqual([
      ['"vorticity"', "stages[0].select.fields[0]: neither the run nor a stage before has a field “vorticity”; the fields are velocity, pressure, wall distance, scaled_jacobian", undefined],
    ]);
  });

  it("stand wherever a field or a feature is named", () => {
    const stages: Json[] = [
      { gradient: { field: "f1" } }, { clip: { field: { name: "f2", value: 0 } } }, { force: { name: "a", pressure: "f3", velocity: "f4", viscosity: "f5", features: ["g1"] } },
      { integrate: { name: "b", vector: "f6" } }, { streamlines: { field: "f7", features: { names: ["g2"], count: 1 } } }, { deform: { free: ["g3"], sliding: ["g4"] } },
      { translate: { features: ["g5"], fixed: ["g6"], vector: [1, 0, 0] } }, { render: { file: "a.png", field: "f8" } }, { time_statistics: { name: "c", field: "f9" } },
    ];
    expect(tokens(stages)).toEqual(["f1", "f2", "f3", "f4", "f5", "g1", "f6", "f7", "g2", "g3", "g4", "g5", "g6", "f8", "f9"].map((name) => `"${name}"`));
    expect(tokens([], { then: [{ render: { file: "a.png", field: "f1" } }], when: "nothing > 1", description: "f2" })).toEqual(['"f1"']);
  });

  it("are not those that stages make, where these stand before", () => {
    const derive: Json[] = [{ gradient: { field: "velocity", name: "slope" } }, { magnitude: { field: "slope" } }, { expression: { name: "head", formula: "magnitude + pressure" } }];
    expect(tokens([...derive, { surface: {} }, { select: { fields: ["slope", "head", "scaled_jacobian"] } }, { histogram: { name: "h", field: "head" } }])).toEqual([]);
    expect(tokens([...derive].reverse())).toEqual(["magnitude", '"slope"']);
    expect(tokens([{ surface: {} }, { histogram: { name: "h", field: "wall_shear_stress" } }, { wall_shear_stress: { velocity: "velocity", viscosity: 1 } }])).toEqual(['"wall_shear_stress"']);
    // A field that is there, but only on the extract.
    expect(tokens([{ surface: {} }, { wall_shear_stress: { velocity: "velocity", viscosity: 1 } }, { statistics: { field: "wall_shear_stress" } }])).toEqual([]);
  });

  it("are marked by themselves in formulas", () => {
    expect(found([{ expression: { name: "e", formula: "0.5 * velocty.x^2 + max(presure, x) + {wall distanc} + time * parameter.inflow - pi" } }])).toEqual([
      ["velocty.x", expect.stringContaining("“velocty”; did you mean velocity.x?"), "velocity.x"],
      ["presure", expect.stringContaining("did you mean pressure?"), "pressure"],
      ["{wall distanc}", expect.stringContaining("did you mean wall distance?"), "{wall distance}"],
    ]);
    expect(found([{ expression: { name: "e", components: ["velocity.y", "inflow"] } }])).toEqual([["inflow", expect.stringContaining("did you mean parameter.inflow?"), "parameter.inflow"]]);
    // With an escape in it the whole text is marked, and nothing is put in its place.
    expect(found([{ expression: { name: "e", formula: "pressure\n+ presure" } }])).toEqual([['"pressure\\n+ presure"', expect.stringContaining("did you mean pressure?"), undefined]]);
  });

  it("are not told of where the run has told nothing", () => {
    const stages: Json[] = [{ surface: {} }, { integrate: { name: "a", field: "nothing", features: ["nowhere"] } }];
    expect(found(stages, { ...RUN, fields: [], features: [] })).toEqual([]);
    expect(found(stages, { ...RUN, fields: [] }).map(([token]) => token)).toEqual(['"nowhere"']);
    expect(unknownNames("{", RUN)).toEqual([]);
  });

  it("are in none of the templates", () => {
    const fields = [{ name: "velocity", association: "vertex" as const, components: 3 }, { name: "pressure", association: "vertex" as const, components: 1 }];
    for (const { make } of TEMPLATES) expect(unknownNames(JSON.stringify(make({ fields, features: [feature("throat", "wall")], box: null })), RUN)).toEqual([]);
  });

  it("are errors where they are of monitors and parameters, which the checker looks up", () => {
    const check = (stages: Json[], more: { [key: string]: Json } = {}) => {
      const text = JSON.stringify({ name: "a", stages, ...more });
      return language.checkPipeline({ text, replaced: null, pipelines: [{ name: "other", stages: [{ quality: {} }] }], parameters: ["inflow"] }).errors.map(({ suggestion }) => suggestion);
    };
    expect(check([{ difference: { name: "d", of: "qualty.min", minus: "quality.max" } }])).toEqual(["quality.min"]);
    expect(check([{ csv: { file: "a.csv", monitors: ["qualiti.min"] } }, { log: { message: "{quality.mn}" } }])).toEqual(["quality.min", "quality.min"]);
    expect(check([], { when: "quality.mi < 0", then: [{ set: { name: "inflw", value: 1 } }] })).toEqual(["quality.min", "inflow"]);
  });
});

describe("whether the run's fields are those that a pipeline reads", () => {
  const reads = (channel: string | null, known: Pipeline[], pipeline: Json): boolean =>
    readsDescribed({ hello: { ...HELLO, channel }, pipelines: { known, drafts: {}, open: null, asked: null } }, pipeline);
  const shape = { name: "shape", on: "order", stages: [] };

  it("is so for the channel that is told of, and for the first one where that is it", () => {
    expect([reads("fluid", [shape], {}), reads("fluid", [shape], { channel: "fluid" }), reads("fluid", [shape], { channel: "solid" })]).toEqual([true, true, false]);
    // Which one is the first nobody says.
    expect(reads("solid", [{ ...shape, channel: "solid" }], {})).toBe(false);
    expect(reads("solid", [{ ...shape, channel: "solid" }], { channel: "solid" })).toBe(true);
  });
});

describe("the nearest name", () => {
  it("is the one that the run would find", () => {
    expect([nearest("presure", ["velocity", "pressure"]), nearest("zebra", ["velocity", "pressure"])]).toEqual(["pressure", null]);
    expect([nearest("Z_max", ["z-min", "z-max"]), nearest("velo", ["velocity"]), nearest("vel", ["velocity"]), nearest("ab", ["ba"])]).toEqual(["z-max", "velocity", null, "ba"]);
    expect([nearest("a".repeat(201), ["a"]), nearest("p", []), nearest("p", ["u", "t"])]).toEqual([null, null, "u"]);
  });
});
