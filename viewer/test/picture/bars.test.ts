// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { ScalarBars } from "../../src/picture/bars";
import type { BarText } from "../../src/picture/bars";
import type { Range } from "../../src/picture/ranges";
import { looksOf } from "../../src/store/looks";

describe("a scalar bar", () => {
  const look = looksOf([{ name: "cut", kind: "slice" }], [{ name: "p", association: "vertex", components: 1 }], {}).cut!;
  let bars: ScalarBars;
  let fixed: [readonly string[], Range][];
  let text: BarText;
  const root = (): HTMLElement => document.getElementById("bars")!;
  const show = (range: Range, hasGaps = false): void => bars.show([{ key: "k", look, range, views: ["cut"], hasGaps }]);
  beforeEach(() => {
    document.body.innerHTML = '<div id="bars"></div>';
    fixed = [];
    text = { title: "p", unit: null };
    bars = new ScalarBars(root(), () => text, (views, range) => { fixed.push([views, range]); });
  });

  it("fixes the end that is typed, and the other as it is to the last bit", () => {
    show([1 / 3, 2000 / 3]);
    const high = root().querySelector<HTMLInputElement>('[aria-label="p: highest value"]')!;
    expect(high.value).toBe("666.7");
    high.value = "700";
    high.dispatchEvent(new Event("change"));
    expect(fixed).toEqual([[["cut"], [1 / 3, 700]]]);
    high.value = "1,500";
    high.dispatchEvent(new Event("change"));
    expect([fixed.length, high.getAttribute("aria-invalid"), high.title]).toEqual([1, "true", "“1,500” can be read in two ways: write 1500 or 1.5"]);
    show([0, 1]);
    expect([high.value, high.getAttribute("aria-invalid")]).toEqual(["1", "false"]);
  });

  it("takes no end that a logarithmic range cannot have", () => {
    bars.show([{ key: "k", look: { ...look, range: { ...look.range, logarithmic: true } }, range: [1, 10], views: ["cut"], hasGaps: false }]);
    const low = root().querySelector<HTMLInputElement>('[aria-label="p: lowest value"]')!;
    const type = (text: string): void => {
      low.value = text;
      low.dispatchEvent(new Event("change"));
    };
    type("0");
    expect([fixed, low.getAttribute("aria-invalid"), low.title]).toEqual([[], "true", "a logarithmic range holds only numbers above 0"]);
    type("1e-9");
    expect([fixed, low.getAttribute("aria-invalid")]).toEqual([[[["cut"], [1e-9, 10]]], "false"]);
  });

  it("has few digits where all values are one", () => {
    show([0.2153846, 0.2153846 * (1 + 1e-6)]);
    expect([...root().querySelectorAll("input")].map(({ value }) => value)).toEqual(["0.2154", "0.2154"]);
    expect([...root().querySelectorAll("li")].map(({ textContent }) => textContent)).toEqual(["", "", "", "", "", ""]);
    // Values that differ are told apart, as near as they are.
    show([101325.01, 101325.09]);
    expect([...root().querySelectorAll("input")].map(({ value }) => value)).toEqual(["101325.09", "101325.01"]);
  });

  it("says what grey is where some values are no numbers", () => {
    const legend = (): HTMLElement => root().querySelector(".gaps")!;
    show([0, 1]);
    expect(legend().hidden).toBe(true);
    show([0, 1], true);
    expect([legend().hidden, legend().textContent]).toEqual([false, "no number"]);
  });

  it("has the title and the unit that the run has told last", () => {
    const said = (): (string | null)[] => [root().querySelector(".title")!.textContent, root().firstElementChild!.getAttribute("aria-label"), root().querySelector("input")!.getAttribute("aria-label")];
    show([0, 1]);
    expect(said()).toEqual(["p", "p", "p: highest value"]);
    text = { title: "p magnitude", unit: "Pa" };
    show([0, 1]);
    expect(said()).toEqual(["p magnitudePa", "p magnitude", "p magnitude: highest value"]);
  });
});
