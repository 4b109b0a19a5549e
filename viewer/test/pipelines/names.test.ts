import { describe, expect, it } from "vitest";
import type { Json } from "../../src/connection/protocol";
import { Language } from "../../src/kernel/language";
import { namesAt } from "../../src/pipelines/names";
import type { RunNames } from "../../src/pipelines/names";
import { placeAt, readSoFar } from "../../src/pipelines/place";
import { languageWasm } from "../wasm";

const RUN: RunNames = {
  fields: [{ name: "velocity", description: "A vector at each vertex." }, { name: "pressure", description: "" }],
  features: ["inlet"], channels: [], parameters: [],
  monitors: [{ pipeline: "duct", name: "inlet.mean" }, { pipeline: "other", name: "inlet.mean" }, { pipeline: "other", name: "drop" }, { pipeline: "own", name: "old" }],
};
/** The names at the `|` of a text, which is not part of it. */
const at = (marked: string, replaced: string | null = "own") => {
  const text = marked.replace("|", "");
  return namesAt(RUN, readSoFar(text), replaced, placeAt(text, marked.indexOf("|"))!.path);
};
/** The fields at a place beyond those that are there without any stage. */
const fields = (marked: string): string[] => at(marked).fields.map(({ name }) => name).filter((name) => !["velocity", "pressure", "scaled_jacobian"].includes(name));

describe("the fields that a stage may name", () => {
  const DERIVE = `{"gradient": {"field": "pressure", "name": "slope"}}, {"vorticity": {"field": "velocity"}}, {"q_criterion": {"field": "velocity"}},
    {"expression": {"name": "head", "formula": "pressure"}}, {"time_statistics": {"name": "p", "field": "pressure", "measures": ["mean", "rms"]}}`;
  const DERIVED = ["slope", "vorticity", "q_criterion", "head", "p_mean", "p_rms"];

  it("are those that earlier stages derive, under the names that they give them", () => {
    expect(fields(`{"stages": [${DERIVE}, {"contour": {"field": "|"`)).toEqual(DERIVED);
    expect(fields(`{"stages": [${DERIVE}, {"surface": {}}, {"histogram": {"field": "|"}}], "then": []}`)).toEqual(DERIVED);
    expect(fields(`{"stages": [${DERIVE}], "then": [{"render": {"field": "|`)).toEqual(DERIVED);
    expect(at(`{"stages": [${DERIVE}, {"contour": {"field": "|`).fields.find(({ name }) => name === "slope")?.description).toBe("Derived from pressure by the stage gradient.");
  });

  it("are none of later stages, but for those that are selected", () => {
    expect(fields('{"stages": [{"magnitude": {"field": "|"}}, {"divergence": {"field": "velocity"}}]}')).toEqual([]);
    expect(fields('{"stages": [{"surface": {}}, {"select": {"fields": ["|"]}}, {"wall_shear_stress": {"velocity": "velocity", "viscosity": 1}}]}')).toEqual(["wall_shear_stress"]);
  });

  it("are those of the extract only where a stage looks at that", () => {
    const WALL = '{"surface": {}}, {"wall_shear_stress": {"velocity": "velocity", "viscosity": 1, "name": "shear"}}';
    expect(fields(`{"stages": [${WALL}, {"integrate": {"name": "a", "vector": "|`)).toEqual(["shear"]);
    expect(fields(`{"stages": [${WALL}, {"statistics": {"field": "|`)).toEqual([]);
    expect(fields('{"stages": [{"streamlines": {"field": "velocity"}}, {"render": {"field": "|')).toEqual(["integration_time"]);
    expect(fields('{"stages": [{"streamlines": {"field": "velocity"}}, {"select": {"fields": ["|')).toEqual([]);
  });

  it("are each there once", () => {
    expect(at('{"stages": [{"magnitude": {"field": "velocity", "name": "pressure"}}, {"contour": {"field": "|').fields.map(({ name }) => name)).toEqual(["velocity", "pressure", "scaled_jacobian"]);
  });
});

describe("the monitors that a pipeline may name", () => {
  const MEASURE = `{"quality": {}}, {"statistics": {"field": "pressure"}}, {"surface": {}}, {"integrate": {"name": "inlet", "vector": "velocity", "features": ["inlet"]}},
    {"force": {"name": "lift", "pressure": "pressure"}}, {"histogram": {"name": "h", "field": "pressure", "bins": 2}}, {"spectrum": {"name": "s", "monitor": "lift.x"}},
    {"time_statistics": {"name": "t", "monitor": "lift.x", "measures": ["rms"]}}, {"difference": {"name": "d", "of": "lift.x", "minus": "lift.y"}}`;

  it("are those of earlier stages, then those of other pipelines by as much of their names as it takes", () => {
    expect(at('{"stages": [{"quality": {}}, {"difference": {"name": "d", "of": "|"}}, {"statistics": {"field": "pressure"}}]}').monitors)
      .toEqual(["quality.min", "quality.mean", "quality.max", "quality.inverted", "duct/inlet.mean", "other/inlet.mean", "drop"]);
    expect(at('{"stages": [], "when": "|"}', null).monitors).toEqual(["duct/inlet.mean", "other/inlet.mean", "drop", "old"]);
    expect(at('{"stages": [{"csv": {"monitors": ["|"]}}, {"quality": {}}]}').monitors).toContain("quality.min");
  });

  it("are all such that the run takes", () => {
    const stages = MEASURE.replace('{"quality": {}}, {"statistics": {"field": "pressure"}}, {"surface": {}}', '{"surface": {}}, {"quality": {}}, {"statistics": {"field": "pressure"}}, {"decimate": {}}');
    const others: Json[] = [{ name: "duct", stages: [{ statistics: { field: "p", name: "inlet" } }] }, { name: "other", stages: [{ statistics: { field: "p", name: "inlet" } }, { difference: { name: "drop", of: "inlet.min", minus: "inlet.max" } }] }];
    const { monitors } = at(`{"name": "own", "stages": [${stages}], "when": "|"}`);
    expect(monitors).toEqual(expect.arrayContaining(["decimate.error", "pressure.l2", "inlet.integral.x", "inlet.flow_rate", "lift.moment.z", "lift.mean_pressure", "h.upper", "s.amplitude", "t.rms", "t.time", "d"]));
    const text = JSON.stringify({ name: "own", stages: [...JSON.parse(`[${stages}]`) as Json[], { csv: { file: "all.csv", monitors } }] });
    expect(new Language(languageWasm).checkPipeline({ text, replaced: "own", pipelines: others, parameters: [] }).errors).toEqual([]);
  });
});
