import { describe, expect, it } from "vitest";
import type { Json } from "../../src/connection/protocol";
import { placeAt } from "../../src/pipelines/place";
import { isFormula, isMessage, namesIn } from "../../src/pipelines/formula";
import { descriptionAt, formulaNames, suggestionsAt } from "../../src/pipelines/suggestions";
import type { KnownNames } from "../../src/pipelines/suggestions";
// As the server sends it; the crate tombolo-pipelines makes it.
import schema from "../pipeline-schema.json";

const root = schema as unknown as Json;
const names: KnownNames = {
  fields: [{ name: "velocity", description: "A vector at each vertex." }, { name: "pressure", description: "" }],
  features: ["inlet", "throat"], monitors: ["inlet.mean", "pressure drop"], channels: ["fluid"], parameters: ["inflow"],
};
const at = (marked: string) => {
  const offset = marked.indexOf("|");
  const place = placeAt(marked.replace("|", ""), offset);
  return place ? suggestionsAt(root, place, names) : [];
};
const labels = (marked: string): string[] => at(marked).map(({ label }) => label);

describe("what may be written", () => {
  it("are the keys of a pipeline that are not there yet, with what they mean", () => {
    const keys = at('{"name": "a", "|"}');
    expect(keys.map(({ label }) => label).sort()).toEqual(["again_after", "at", "budget", "channel", "description", "every", "for", "on", "stages", "then", "when"]);
    expect(keys[0]).toMatchObject({ label: "stages", detail: "required", insert: '"stages": [#]' });
    expect(keys.find(({ label }) => label === "every")).toMatchObject({ insert: '"every": {#}', description: expect.stringMatching(/^How often it runs\./) });
  });

  it("are stages, whole where the list is and by name where one is begun", () => {
    expect(labels('{"stages": [|]}')).toEqual(expect.arrayContaining(["surface", "slice", "contour", "stream", "statistics"]));
    const stage = at('{"stages": [{"|"}]}').find(({ label }) => label === "slice");
    expect(stage).toMatchObject({ insert: '"slice": {#}', description: expect.stringMatching(/^Cuts the mesh with a plane/) });
    // A stage has one key alone.
    expect(labels('{"stages": [{"slice": {}, "|"}]}')).toEqual([]);
    expect(at('{"stages": [|]}').find(({ label }) => label === "contour")).toMatchObject({ insert: '{ "contour": { "field": "#", "values": [] } }' });
  });

  it("are the keys of a stage, and values that are one of several", () => {
    expect(labels('{"stages": [{"slice": {"origin": [0,0,0], "|"}}]}')).toEqual(["cylinder", "normal", "planes", "sphere"]);
    expect(labels('{"every": {"|"}}')).toEqual(["steps", "time", "seconds"]);
    expect(labels('{"every": {"steps": 5, "|"}}')).toEqual([]);
    expect(labels('{"on": "|"}')).toEqual(["order", "viewer", "end"]);
    expect(labels('{"stages": [{"streamlines": {"direction": |}}]}')).toEqual(expect.arrayContaining(["both"]));
    expect(labels('{"stages": [{"clip": {"invert": |}}]}')).toEqual(["true", "false"]);
    expect(labels('{"stages": [{"render": {"color_map": "|"}}]}')).toContain("viridis");
  });

  it("are the names that the run knows, where they belong", () => {
    for (const text of ['{"stages": [{"contour": {"field": "|"}}]}', '{"stages": [{"select": {"fields": ["|"]}}]}', '{"stages": [{"clip": {"field": {"name": "|"}}}]}', '{"stages": [{"force": {"pressure": "|"}}]}']) {
      expect(labels(text), text).toEqual(["velocity", "pressure"]);
    }
    expect(labels('{"stages": [{"integrate": {"features": ["|"]}}]}')).toEqual(["inlet", "throat"]);
    expect(labels('{"stages": [{"streamlines": {"features": {"names": ["|"]}}}]}')).toEqual(["inlet", "throat"]);
    expect(labels('{"stages": [{"difference": {"of": "|"}}]}')).toEqual(["inlet.mean", "pressure drop"]);
    expect(labels('{"stages": [{"set": {"name": "|"}}]}')).toEqual(["inflow"]);
    expect(labels('{"channel": "|"}')).toEqual(["fluid"]);
    expect(labels('{"name": "|"}')).toEqual([]);
    expect([isFormula(["when"]), isFormula(["again_after", "condition"]), isFormula(["stages", 0, "expression", "components", 1]), isFormula(["name"])]).toEqual([true, true, true, false]);
    expect(formulaNames(["when"], names).map(({ insert }) => insert)).toEqual(["inlet.mean", "{pressure drop}", "parameter.inflow", "cycle", "time"]);
  });

  it("are names in formulas and in lines of the log, by themselves or in braces", () => {
    expect(namesIn("2e3 * pressure_1 + max(velocity.x, {pressure drop}) - .5 > pi").map(({ name }) => name)).toEqual(["pressure_1", "velocity.x", "pressure drop", "pi"]);
    const [, braced] = namesIn("größe + {a b}");
    expect(braced).toEqual({ name: "a b", from: 8, to: 13 });
    expect([isMessage(["then", 0, "log", "message"]), isMessage(["stages", 0, "write", "message"])]).toEqual([true, false]);
  });

  it("is described where the cursor is", () => {
    expect(descriptionAt(root, ["stages", 0, "slice", "normal"])).toMatch(/^The direction across the plane/);
    expect(descriptionAt(root, ["stages", 0, "slice"])).toMatch(/^Cuts the mesh/);
    expect(descriptionAt(root, ["every", "steps"])).toMatch(/^At each step/);
    expect(descriptionAt(root, ["nothing", "at", "all"])).toBe("");
    expect(suggestionsAt(5, placeAt("{", 1)!, names)).toEqual([]);
  });
});
