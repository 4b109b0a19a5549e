// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import type { Json } from "../../src/connection/protocol";
import { EditForm } from "../../src/form/form";
import { orderForm } from "../../src/form/schema";
import { missing, wishedOrder } from "../../src/store/draft";
import { Selection } from "../../src/store/selection";
import { defaults, page, schema } from "../page";

describe("the form", () => {
  let root: HTMLElement;
  let store: ReturnType<typeof page>["store"];
  beforeEach(() => {
    root = document.createElement("div");
    document.body.replaceChildren(root);
    store = page().store;
    new EditForm(root, store);
  });
  const input = (label: string): HTMLInputElement => root.querySelector<HTMLInputElement>(`.object:not([hidden]) input[aria-label="${label}"]`)!;
  const type = (field: HTMLInputElement, text: string): void => {
    field.value = text;
    field.dispatchEvent(new Event("input", { bubbles: true }));
  };
  const check = (box: HTMLInputElement): void => {
    box.checked = !box.checked;
    box.dispatchEvent(new Event("change", { bubbles: true }));
  };
  const tick = (label: string): void => check(root.querySelector<HTMLInputElement>(`input[aria-label="${label}"]`)!);
  const label = (text: string): HTMLInputElement => {
    const found = [...root.querySelectorAll<HTMLLabelElement>(".object:not([hidden]) label")].find((entry) => entry.textContent === text && !entry.closest("[hidden]"))!;
    return document.getElementById(found.htmlFor) as HTMLInputElement;
  };
  const choose = (select: HTMLSelectElement, option: string): void => {
    select.value = [...select.options].find((entry) => entry.textContent === option)!.value;
    select.dispatchEvent(new Event("change", { bubbles: true }));
  };
  const action = (key: string): void => {
    const select = root.querySelector<HTMLSelectElement>("#action")!;
    select.value = key;
    select.dispatchEvent(new Event("change", { bubbles: true }));
  };
  const edits = (): Json => wishedOrder(store.state)!.edits!;

  it("makes the order that the protocol asks for", () => {
    tick("throat: handle");
    tick("outlet: fixed");
    tick("inlet: fixed");
    expect(wishedOrder(store.state)).toBeNull();
    type(input("factors z"), "0.5");
    expect(wishedOrder(store.state)).toEqual({
      edits: [{ scale_direction: { features: ["throat"], fixed: ["inlet", "outlet"], factors: [1, 1, 0.5], harmonic_order: 2, muted: false } }],
      schedule: { steps: 10, every: { steps: 5 }, ease: "linear", motion: "spread" },
    });
  });

  it("keeps a setting that cannot be sent as it was, says what is wrong, and shows it again", () => {
    tick("throat: handle");
    const steps = root.querySelector<HTMLInputElement>('details.schedule input[aria-label="schedule steps"]')!;
    type(steps, "50");
    type(input("factors z"), "0.5");
    type(steps, "");
    expect([wishedOrder(store.state), missing(store.state)]).toEqual([null, "schedule steps is empty"]);
    expect([steps.value, steps.getAttribute("aria-invalid")]).toEqual(["", "true"]);
    store.dispatch({ type: "composed", key: "translate", values: { by: [0, 0, 1] }, step: "handle 1" });
    expect(wishedOrder(store.state)).toMatchObject({ schedule: { steps: 50, every: { steps: 5 } } });
    expect([steps.value, steps.getAttribute("aria-invalid")]).toEqual(["50", null]);
    expect(root.querySelector("details.schedule summary")!.textContent).toBe("50 shapes over 250 steps");
  });

  it("needs a handle, and numbers", () => {
    type(input("factors z"), "0.5");
    expect(missing(store.state)).toMatch(/at least one feature/);
    tick("throat: handle");
    type(input("factors x"), "wide");
    expect(missing(store.state)).toBe("factors x “wide” is not a number");
    expect(input("factors x").getAttribute("aria-invalid")).toBe("true");
    expect(input("factors x").value).toBe("wide");
    expect(wishedOrder(store.state)).toBeNull();
    type(input("factors x"), "1");
    expect(missing(store.state)).toBe("");
  });

  it("takes a region for a handle", () => {
    action("rotate");
    type(label("turn by"), "15");
    check(label("only in a region"));
    const kind = root.querySelector<HTMLSelectElement>('.object:not([hidden]) select[aria-label="region: kind"]')!;
    choose(kind, "sphere");
    type(label("radius"), "0.2");
    expect(edits()).toEqual([{ rotate: {
      axis: [0, 0, 1], degrees: 15, fixed: [], harmonic_order: 2, muted: false, region: { sphere: { center: [0, 0, 0], radius: 0.2 } },
    } }]);
    choose(kind, "faces");
    expect(missing(store.state)).toBe("region is empty");
    type(label("faces"), "1, 2 30");
    expect((edits() as { rotate: Json }[])[0]!.rotate).toMatchObject({ region: { faces: [1, 2, 30] } });
    type(label("faces"), "1, -2");
    expect(missing(store.state)).toBe("region faces must be whole numbers, parted by commas");
  });

  it("asks for a matrix row by row, and never for a file", () => {
    action("affine");
    tick("throat: handle");
    type(input("matrix row 2 x"), "0.5");
    expect((edits() as { affine: Json }[])[0]!.affine).toMatchObject({ matrix: [[1, 0, 0], [0.5, 1, 0], [0, 0, 1]], translation: [0, 0, 0] });
    action("displacement");
    expect([...root.querySelectorAll(".object:not([hidden]) label")].some((entry) => entry.textContent?.includes("file"))).toBe(false);
  });

  it("keeps list and picture in step", () => {
    const selection = new Selection(store);
    selection.toggle("throat", "handle");
    expect(root.querySelector<HTMLInputElement>('input[aria-label="throat: handle"]')!.checked).toBe(true);
    selection.toggle("throat", "fixed");
    expect(root.querySelector<HTMLInputElement>('input[aria-label="throat: handle"]')!.checked).toBe(false);
    tick("throat: fixed");
    expect(selection.get("throat")).toBeNull();
  });

  it("sends the settings of the folded part only where they are set", () => {
    tick("throat: handle");
    type(input("factors z"), "0.5");
    expect(wishedOrder(store.state)!.guard).toBeUndefined();
    const guard = [...root.querySelectorAll<HTMLLabelElement>(".settings label")].find((entry) => entry.textContent === "guard")!;
    check(document.getElementById(guard.htmlFor) as HTMLInputElement);
    expect(wishedOrder(store.state)!.guard).toEqual({ min_scaled_jacobian: 0.03, otherwise: "reject", surface: "reject" });
    expect(wishedOrder(store.state)!.deform).toBeUndefined();
  });

  it("keeps what was typed when the same schema comes again", () => {
    type(input("factors z"), "0.7");
    store.dispatch({ type: "schema", form: orderForm(structuredClone(schema)), settings: { schedule: defaults.schedule } });
    expect(input("factors z").value).toBe("0.7");
  });

  it("shows what is dragged in the picture, and takes a step back at a time", () => {
    const by = (x: number, step: string): void => store.dispatch({ type: "composed", key: "translate", values: { by: [x, 0, 0] }, step });
    tick("throat: handle");
    by(0.1, "drag 1");
    by(0.2, "drag 1");
    by(0.3, "drag 2");
    expect(input("by x").value).toBe("0.3");
    store.dispatch({ type: "step back" });
    expect(input("by x").value).toBe("0.2");
    store.dispatch({ type: "step back" });
    expect(root.querySelector<HTMLSelectElement>("#action")!.selectedOptions[0]!.textContent).toBe("Scale");
    store.dispatch({ type: "step forward" });
    expect(input("by x").value).toBe("0.2");
    by(0.9, "drag 3");
    store.dispatch({ type: "aborted", step: "drag 3" });
    expect(input("by x").value).toBe("0.2");
  });

  it("speaks to people: labels, units, what is rarely needed folded away, and nothing of JSON", () => {
    for (const { key } of store.state.form!.edits) {
      action(key);
      const shown = [...root.querySelectorAll<HTMLElement>(".object:not([hidden]) label, .object:not([hidden]) .label")].filter((entry) => !entry.closest("[hidden]"));
      const texts = shown.map((entry) => entry.firstChild?.textContent ?? "");
      for (const private_ of ["set fixed region", "fixed region", "set at", "moves", "muted", "name", "file", "harmonic order"]) expect(texts, key).not.toContain(private_);
      expect(texts.every((text) => !text.includes("_"))).toBe(true);
    }
    action("rotate");
    const degrees = label("turn by");
    expect(degrees.parentElement!.textContent).toBe("°");
    expect(label("smoothness").closest("details")!.querySelector("summary")!.textContent).toBe("Advanced");
  });

  it("says the schedule in one sentence, with a curve beside it", () => {
    expect(root.querySelector(".schedule summary")!.textContent).toBe("10 shapes over 50 steps");
    expect(root.querySelector(".schedule summary svg")!.getAttribute("aria-label")).toBe("The shape goes evenly");
  });

  it("waits for the schema", () => {
    store.dispatch({ type: "schema", form: null, settings: {} });
    expect(root.textContent).toMatch(/appears once/);
  });
});
