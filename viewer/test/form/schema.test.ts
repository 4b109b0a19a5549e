// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { InputError, makeControl } from "../../src/form/controls";
import { EditForm, describeOrder } from "../../src/form/form";
import type { Json } from "../../src/connection/protocol";
import { fieldOf, orderForm } from "../../src/form/schema";
import { Selection } from "../../src/store/selection";
// As the server sends it; `tombolo schema` and the crate tombolo-pipelines make it.
import orderSchema from "../order-schema.json";

const schema = orderSchema as unknown as Json;
const features = ["inlet", "outlet", "wall", "throat"].map((name) => ({ name, faces: 4, vertices: 4, bounds: [[0, 0, 0], [1, 1, 1]] as [[number, number, number], [number, number, number]] }));
const defaults = { schedule: { steps: 10, every: { steps: 5 } }, guard: { min_scaled_jacobian: 0.03, otherwise: "reject" } };

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
      control.write(value);
      try {
        return control.read();
      } catch (error) {
        return (error as InputError).message;
      }
    };
    expect(attempt("0.25")).toBe(0.25);
    expect(attempt("1e-1")).toBe(0.1);
    expect(attempt("-1")).toBe("ratio must be at least 0");
    expect(attempt("0.5")).toBe("ratio must be less than 0.5");
    for (const text of ["NaN", "Infinity", "0x10", "1e999", "one", "1 2"]) expect(attempt(text)).toBe(`ratio “${text}” is not a number`);
    expect(attempt("")).toBe("ratio is empty");
  });
});

describe("the form", () => {
  let root: HTMLElement;
  let selection: Selection;
  let form: EditForm;
  beforeEach(() => {
    root = document.createElement("div");
    document.body.replaceChildren(root);
    selection = new Selection();
    form = new EditForm(root, selection);
    form.setSchema(schema, defaults);
    form.setFeatures(features);
  });
  const input = (label: string): HTMLInputElement => root.querySelector<HTMLInputElement>(`.object:not([hidden]) input[aria-label="${label}"]`)!;
  const tick = (label: string): void => {
    const box = root.querySelector<HTMLInputElement>(`input[aria-label="${label}"]`)!;
    box.checked = !box.checked;
    box.dispatchEvent(new Event("change"));
  };

  it("makes the order that the protocol asks for", () => {
    tick("throat: handle");
    tick("outlet: fixed");
    tick("inlet: fixed");
    input("factors z").value = "0.5";
    expect(form.read()).toEqual({
      edits: [{ scale_direction: { features: ["throat"], fixed: ["inlet", "outlet"], factors: [1, 1, 0.5], harmonic_order: 2, muted: false } }],
      schedule: { steps: 10, every: { steps: 5 }, ease: "linear", motion: "spread" },
    });
  });

  it("needs a handle, and numbers", () => {
    expect(() => form.read()).toThrow(/at least one feature/);
    tick("throat: handle");
    input("factors x").value = "wide";
    expect(() => form.read()).toThrow("factors x “wide” is not a number");
    expect(input("factors x").getAttribute("aria-invalid")).toBe("true");
  });

  const label = (text: string): HTMLInputElement => {
    const found = [...root.querySelectorAll<HTMLLabelElement>(".object:not([hidden]) label")].find((entry) => entry.textContent === text && !entry.closest("[hidden]"))!;
    return document.getElementById(found.htmlFor) as HTMLInputElement;
  };
  const choose = (action: string): void => {
    const select = root.querySelector<HTMLSelectElement>("#action")!;
    select.value = [...select.options].find((option) => option.textContent === action)!.value;
    select.dispatchEvent(new Event("change"));
  };
  const check = (box: HTMLInputElement): void => {
    box.checked = !box.checked;
    box.dispatchEvent(new Event("change"));
  };

  it("takes a region for a handle, mutes, and names", () => {
    choose("rotate");
    label("degrees").value = "15";
    check(label("muted"));
    check(label("set name"));
    label("name").value = "tilt";
    check(label("set region"));
    const kind = root.querySelector<HTMLSelectElement>('.object:not([hidden]) select[aria-label="region: kind"]')!;
    kind.value = [...kind.options].find((option) => option.textContent === "sphere")!.value;
    kind.dispatchEvent(new Event("change"));
    label("radius").value = "0.2";
    expect(form.read().edits).toEqual([{ rotate: {
      axis: [0, 0, 1], degrees: 15, fixed: [], harmonic_order: 2, muted: true, name: "tilt",
      region: { sphere: { center: [0, 0, 0], radius: 0.2 } },
    } }]);
    kind.value = [...kind.options].find((option) => option.textContent === "faces")!.value;
    kind.dispatchEvent(new Event("change"));
    expect(() => form.read()).toThrow("region is empty");
    label("faces").value = "1, 2 30";
    expect((form.read().edits as { rotate: Json }[])[0]!.rotate).toMatchObject({ region: { faces: [1, 2, 30] } });
    label("faces").value = "1, -2";
    expect(() => form.read()).toThrow("faces must be whole numbers");
  });

  it("asks for a matrix row by row, and never for a file", () => {
    choose("affine");
    tick("throat: handle");
    input("matrix row 2 x").value = "0.5";
    expect((form.read().edits as { affine: Json }[])[0]!.affine).toMatchObject({ matrix: [[1, 0, 0], [0.5, 1, 0], [0, 0, 1]], translation: [0, 0, 0] });
    choose("displacement");
    expect([...root.querySelectorAll(".object:not([hidden]) label")].some((entry) => entry.textContent?.includes("file"))).toBe(false);
  });

  it("keeps list and picture in step", () => {
    selection.toggle("throat", "handle");
    expect(root.querySelector<HTMLInputElement>('input[aria-label="throat: handle"]')!.checked).toBe(true);
    selection.toggle("throat", "fixed");
    expect(root.querySelector<HTMLInputElement>('input[aria-label="throat: handle"]')!.checked).toBe(false);
    tick("throat: fixed");
    expect(selection.get("throat")).toBeNull();
    selection.set("wall", "fixed");
    selection.keep(["inlet"]);
    expect(selection.get("wall")).toBeNull();
  });

  it("sends the settings of the folded part only where they are set", () => {
    tick("throat: handle");
    const details = root.querySelector("details")!;
    const guard = [...details.querySelectorAll("label")].find((label) => label.textContent === "set guard")!;
    const box = document.getElementById(guard.htmlFor) as HTMLInputElement;
    box.checked = true;
    expect(form.read().guard).toEqual({ min_scaled_jacobian: 0.03, otherwise: "reject", surface: "reject" });
    expect(form.read().deform).toBeUndefined();
  });

  it("keeps what was typed when the same schema comes again", () => {
    input("factors z").value = "0.7";
    form.setSchema(structuredClone(schema), structuredClone(defaults));
    expect(input("factors z").value).toBe("0.7");
  });

  it("says so when the server describes no edits", () => {
    form.setSchema({}, {});
    expect(root.textContent).toMatch(/does not say which edits/);
    expect(() => form.read()).toThrow(InputError);
  });
});

describe("an order in words", () => {
  it("names what is done", () => {
    expect(describeOrder({ undo: 1 })).toBe("undo");
    expect(describeOrder({ edits: [{ scale_direction: { features: ["throat"], factors: [1, 1, 0.5] } }] })).toBe("scale direction throat × (1, 1, 0.5)");
    expect(describeOrder({ edits: [{ translate: { features: ["a", "b"], by: [0, -2e-4, 0] } }] })).toBe("translate a, b by (0, −2e−4, 0)");
    expect(describeOrder({ stack: [{ rotate: { region: { half_space: {} }, axis: [0, 0, 1], degrees: -15, name: "tilt", muted: true } }] })).toBe("tilt: rotate in a half space by −15° (muted)");
    expect(describeOrder({ stack: [] })).toBe("back to the reference shape");
    for (const odd of [null, 3, [], {}, { edits: [null, 3, {}] }] as Json[]) expect(describeOrder(odd)).toBeTypeOf("string");
  });
});
