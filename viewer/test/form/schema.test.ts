// @vitest-environment jsdom
import { describe, expect, it } from "vitest";
import type { Json } from "../../src/connection/protocol";
import { makeControl, objectControl } from "../../src/form/controls";
import { ROLES, fieldOf, orderForm } from "../../src/form/schema";
import type { Problem } from "../../src/store/state";
import { schema } from "../page";


describe("the schema of an order", () => {
  it("holds the edits and what an order can set", () => {
    const form = orderForm(schema)!;
    expect(form.edits.map((edit) => edit.key)).toEqual(["translate", "rotate", "scale_direction", "scale_normals", "affine", "displacement", "skeleton"]);
    expect(form.settings.map((property) => property.name)).toEqual(["deform", "guard", "schedule"]);
    const scale = form.edits[2]!.field;
    expect(scale.kind === "object" && scale.properties.map((property) => [property.name, property.field.kind])).toEqual([
      ["factors", "vector"], ["features", "names"], ["fixed", "names"], ["harmonic_order", "choice"], ["muted", "boolean"],
      ["center", "optional"], ["fixed_region", "optional"], ["name", "optional"], ["region", "optional"],
    ]);
    const region = scale.kind === "object" && scale.properties.find((property) => property.name === "region")!.field;
    const choices = region && region.kind === "optional" && region.field.kind === "variants" ? region.field.options : [];
    expect(choices.map((option) => [option.key, option.field.kind])).toEqual([
      ["box", "object"], ["sphere", "object"], ["half_space", "object"], ["faces", "numbers"],
    ]);
    const kinds = (key: string): unknown => {
      const field = form.edits.find((edit) => edit.key === key)!.field;
      return field.kind === "object" && Object.fromEntries(field.properties.map((property) => [property.name, property.field.kind]));
    };
    expect(kinds("rotate")).toMatchObject({ axis: "vector", degrees: "number" });
    expect(kinds("affine")).toMatchObject({ matrix: "matrix", translation: "vector" });
    expect(kinds("displacement")).toMatchObject({ vertices: "numbers", values: "json", scale: "number" });
    expect(kinds("skeleton")).toMatchObject({ at: "optional", by: "optional", skinning: "choice" });
    const schedule = form.settings[2]!.field;
    expect(schedule.kind === "optional" && schedule.field.kind === "object" && schedule.field.properties.map((property) => [property.name, property.field.kind])).toEqual([
      ["ease", "choice"], ["motion", "choice"], ["steps", "number"], ["every", "variants"],
    ]);
  });

  it("survives schemas that make no sense", () => {
    for (const broken of [null, 3, [], {}, { properties: { edits: 1 } }, { $ref: "#" }, { $ref: "#/$defs/A", $defs: { A: { $ref: "#/$defs/A" } } }, { anyOf: [{ anyOf: [] }] }] as Json[]) {
      expect(orderForm(broken)).toBeNull();
      expect(fieldOf({}, broken).kind).toBeTypeOf("string");
    }
    const endless = { properties: { edits: { items: { oneOf: [{ properties: { a: { $ref: "#/$defs/A" } } }] } } }, $defs: { A: { type: "object", properties: { again: { $ref: "#/$defs/A" } } } } };
    expect(orderForm(endless as unknown as Json)).not.toBeNull();
  });

  it("refuses numbers out of bounds, saying which and why", () => {
    const field = fieldOf({}, { type: "number", minimum: 0, exclusiveMaximum: 0.5 });
    const control = makeControl(field, "ratio");
    const attempt = (value: string): unknown => {
      control.root.querySelector("input")!.value = value;
      const problems: Problem[] = [];
      const read = control.read(problems);
      const said = control.root.querySelector<HTMLElement>(".wrong")!;
      expect(said.textContent).toBe(problems[0]?.text ?? "");
      expect(said.hidden).toBe(problems.length === 0);
      return problems[0]?.text ?? read;
    };
    expect(attempt("0.25")).toBe(0.25);
    expect(attempt("1e-1")).toBe(0.1);
    expect(attempt("-1")).toBe("ratio must be at least 0");
    expect(attempt("0.5")).toBe("ratio must be less than 0.5");
    for (const text of ["NaN", "Infinity", "0x10", "1e999", "one", "1 2"]) expect(attempt(text)).toBe(`ratio “${text}” is not a number`);
    expect(attempt("")).toBe("ratio is empty");
  });

  it("begins every edit with values that its controls read back as they are", () => {
    for (const { key, field, neutral } of orderForm(schema)!.edits) {
      expect(field.kind, key).toBe("object");
      const control = objectControl(field.kind === "object" ? field.properties.filter(({ name }) => !ROLES[name]) : []);
      const problems: Problem[] = [];
      const read = control.read(problems);
      expect(problems, key).toEqual([]);
      expect(read, key).toEqual(neutral);
      control.write(read);
      expect(control.read([]), key).toEqual(neutral);
    }
  });

  it("keeps every bit of a number that is shown short", () => {
    const exact = 0.000023655170326576326;
    const control = makeControl(fieldOf({}, { type: "array", items: { type: "number" }, minItems: 3, maxItems: 3 }), "at");
    control.write([exact, 1, -0.25]);
    const [first] = control.root.querySelectorAll("input");
    // Its power of ten is seen, and all of it is under the pointer.
    expect([first!.value, first!.title]).toEqual(["2.37e-5", String(exact)]);
    expect(control.read([])).toEqual([exact, 1, -0.25]);
    first!.value = "0.02";
    expect(control.read([])).toEqual([0.02, 1, -0.25]);
    expect(first!.title).toBe("");
  });
});
