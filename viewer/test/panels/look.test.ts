// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import type { RangeChoice } from "../../src/picture/ranges";
import { LookPanel } from "../../src/panels/look";
import { fieldNamed, fieldsOf, sameFields } from "../../src/store/fields";
import { page } from "../page";

const VELOCITY = { name: "velocity", association: "vertex" as const, components: 3, unit: "m/s" };
const array = (name: string, components: number) => ({ name, association: "vertex" as const, components, values: new Float64Array(0) });

describe("the look of a view", () => {
  let made: ReturnType<typeof page>;
  let panel: LookPanel;
  const root = (): HTMLElement => document.getElementById("look")!;
  const select = (label: string): HTMLSelectElement => document.getElementById([...root().querySelectorAll("label")].find(({ textContent }) => textContent === label)!.htmlFor) as HTMLSelectElement;
  const options = (of: HTMLSelectElement): string[] => [...of.options].map(({ textContent, disabled }) => `${textContent}${disabled ? " -" : ""}`);
  beforeEach(() => {
    document.body.innerHTML = '<div id="look"></div>';
    made = page({ views: [{ name: "cut", kind: "slice" }], fields: [VELOCITY] });
    panel = new LookPanel(root(), made.store, () => undefined);
  });

  it("is by any field that the view carries, with its components", () => {
    expect(options(select("field"))).toEqual(["velocity", "none"]);
    made.store.dispatch({ type: "carries", view: "cut", fields: fieldsOf({ fields: [array("vorticity", 3), array("vorticity", 1), array("q", 1)] }) });
    expect(options(select("field"))).toEqual(["velocity (not in this view) -", "vorticity", "q", "none"]);
    expect([select("field").value, made.store.state.looks.cut!.field]).toEqual(["vorticity", "vorticity"]);
    const components = root().querySelectorAll("select")[1]!;
    expect([components.hidden, options(components)]).toEqual([false, ["magnitude", "x", "y", "z"]]);
    select("field").value = "q";
    select("field").dispatchEvent(new Event("change"));
    expect([made.store.state.looks.cut!.field, components.hidden]).toEqual(["q", true]);
  });

  it("names the colour maps by what they are for, with no more beside a name than there is room for", () => {
    const groups = [...select("colours").querySelectorAll("optgroup")].map(({ label, children }) => [label, children.length > 0]);
    expect(groups).toEqual([["sequential", true], ["diverging", true], ["cyclic", true]]);
    for (const label of ["colours", "range", "edges"]) for (const text of options(select(label))) expect(text.length).toBeLessThan(14);
    const map = select("colours");
    map.value = "cividis";
    map.dispatchEvent(new Event("change"));
    expect(made.store.state.looks.cut!.map).toBe("cividis");
  });

  it("names a field that was asked for and has not come yet", () => {
    made.store.dispatch({ type: "look", view: "cut", look: { field: "scaled_jacobian" } });
    expect(options(select("field"))).toEqual(["velocity", "mesh quality (not in this view) -", "none"]);
    expect(select("field").value).toBe("scaled_jacobian");
  });

  it("tells a field as the view carries it, with the unit of the run", () => {
    const { store } = made;
    store.dispatch({ type: "carries", view: "cut", fields: [{ ...VELOCITY, components: 2, unit: null }] });
    store.dispatch({ type: "carries", view: "other", fields: [{ name: "q", association: "element", components: 1 }] });
    expect(fieldNamed(store.state, "velocity", "cut")).toMatchObject({ components: 2, unit: "m/s" });
    expect(fieldNamed(store.state, "velocity")).toMatchObject({ components: 3, unit: "m/s" });
    expect(fieldNamed(store.state, "q", "cut")).toMatchObject({ association: "element", unit: null });
    expect(fieldNamed(store.state, "constructor", "toString")).toBeNull();
  });

  it("has a range of which one end is typed, and the other stays as it is to the last bit", () => {
    const bar = (range: [number, number]): void => panel.setBars([{ key: "", look: made.store.state.looks.cut!, range, views: ["cut"], hasGaps: false }]);
    const type = (label: string, text: string): unknown => {
      const input = root().querySelector<HTMLInputElement>(`[aria-label="${label}"]`)!;
      input.value = text;
      input.dispatchEvent(new Event("change"));
      return made.store.state.looks.cut!.range;
    };
    const texts = (): string[] => [...root().querySelectorAll<HTMLInputElement>('input[type="text"]')].map(({ value }) => value);
    bar([101325.01, 101325.09]);
    expect(texts()).toEqual(["101325.01", "101325.09"]);
    expect(type("highest value", "101326")).toMatchObject({ kind: "fixed", low: 101325.01, high: 101326 });
    made.store.dispatch({ type: "look", view: "cut", look: { range: { ...made.store.state.looks.cut!.range, kind: "auto" } } });
    bar([1 / 3, 2e5 / 3]);
    expect(type("highest value", "70000")).toMatchObject({ low: 1 / 3, high: 70000 });
    expect(type("lowest value", "1")).toMatchObject({ low: 1, high: 70000 });
    made.store.dispatch({ type: "look", view: "cut", look: { range: { kind: "fixed", low: 1.234e-5, high: 1, logarithmic: true, symmetric: false } } });
    expect(texts()).toEqual(["1.23e−5", "1"]);
  });

  it("keeps an end as it was typed: not about 0 any more, and no number at or below 0 where it is logarithmic", () => {
    const { store } = made;
    const range = (): RangeChoice => store.state.looks.cut!.range;
    const input = (label: string): HTMLInputElement => root().querySelector(`[aria-label="${label} value"]`)!;
    const type = (label: string, text: string): void => {
      input(label).value = text;
      input(label).dispatchEvent(new Event("change"));
    };
    const box = (text: string): HTMLInputElement => [...root().querySelectorAll("label")].find(({ textContent }) => textContent === text)!.querySelector("input")!;
    const problem = (): string => { const shown = root().querySelector<HTMLElement>(".wrong")!; return shown.hidden ? "" : shown.textContent; };
    const bar = (...ends: [number, number]): void => panel.setBars([{ key: "", look: store.state.looks.cut!, range: ends, views: ["cut"], hasGaps: false }]);
    bar(-4, 4);
    box("about 0").click();
    expect(range()).toMatchObject({ kind: "auto", symmetric: true });
    type("highest", "3");
    expect(range()).toEqual({ kind: "fixed", low: -4, high: 3, symmetric: false, logarithmic: false });
    expect([box("about 0").checked, input("highest").value]).toEqual([false, "3"]);
    // The ends say what a fixed range about 0 is.
    box("about 0").click();
    expect([range(), input("highest").value]).toEqual([{ kind: "fixed", low: -4, high: 4, symmetric: true, logarithmic: false }, "4"]);
    box("logarithmic").click();
    expect([problem(), input("lowest").getAttribute("aria-invalid")]).toEqual(["Lowest value: a logarithmic range holds only numbers above 0.", "true"]);
    type("lowest", "-1");
    bar(1, 2);
    expect([range().low, input("lowest").value, input("lowest").getAttribute("aria-invalid")]).toEqual([-4, "-1", "true"]);
    type("lowest", "1e-9");
    expect([range(), problem(), input("lowest").getAttribute("aria-invalid")]).toEqual([{ kind: "fixed", low: 1e-9, high: 4, symmetric: false, logarithmic: true }, "", "false"]);
    type("lowest", "");
    expect([range().low, problem()]).toEqual([1e-9, ""]);
  });

  it("is told only where a frame carries something else", () => {
    const known = fieldsOf({ fields: [array("p", 1), array("p", 3)] });
    const of = (...fields: ReturnType<typeof array>[]): boolean => sameFields(known, fieldsOf({ fields }));
    expect([of(array("p", 1), array("p", 3)), of(array("p", 1)), of(array("p", 3)), of(), sameFields(undefined, [])]).toEqual([true, true, false, false, false]);
  });
});
