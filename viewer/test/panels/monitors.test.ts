// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { MonitorPanel } from "../../src/panels/monitors";
import { openDocument } from "./document";

describe("the newest values of monitors", () => {
  let panel: MonitorPanel;
  const told = (pipeline: string, ...names: string[]): void => panel.update({ pipeline, cycle: 1, values: Object.fromEntries(names.map((name, i) => [name, i])) });
  const shown = (): string[] => [...document.querySelectorAll("#monitors .monitor")].map(({ textContent }) => textContent);
  beforeEach(() => {
    openDocument();
    panel = new MonitorPanel(document.getElementById("monitors")!);
  });

  it("go with their monitors", () => {
    told("health", "quality.min", "mass");
    expect([shown(), document.getElementById("monitors-panel")!.hidden]).toEqual([["Quality, minimum0", "Mass1"], false]);
    panel.keep([{ pipeline: "health", name: "mass" }]);
    expect(shown()).toEqual(["Mass1"]);
    panel.keep([]);
    expect([shown(), document.getElementById("monitors-panel")!.hidden]).toEqual([[], true]);
  });

  it("have the name that conditions call them by under the pointer", () => {
    told("health", "pressure.l2");
    expect([shown(), document.querySelector<HTMLElement>("#monitors .monitor")!.title]).toEqual([["Pressure, RMS0"], "pressure.l2, of the pipeline health"]);
  });

  it("have their units where they are known, also once that is said later", () => {
    panel.keep([{ pipeline: "flow", name: "drop", unit: "Pa" }, { pipeline: "flow", name: "mass" }]);
    told("flow", "mass", "drop");
    expect(shown()).toEqual(["Mass0", "Drop1\u00a0Pa"]);
    panel.keep([{ pipeline: "flow", name: "drop", unit: null }, { pipeline: "flow", name: "mass", unit: "kg/s" }]);
    expect(shown()).toEqual(["Mass0\u00a0kg/s", "Drop1"]);
    panel.update({ pipeline: "flow", cycle: 2, values: { mass: null } });
    expect(shown()[0]).toBe("Mass–");
  });

  it("are a hundred at most, and those stay up to date", () => {
    const names = Array.from({ length: 100 }, (_, i) => `n${i}`);
    told("a", ...names);
    panel.update({ pipeline: "b", cycle: 2, values: { more: 1 } });
    panel.update({ pipeline: "a", cycle: 2, values: { more: 1, n99: 5 } });
    expect([shown().length, shown().at(-1)]).toEqual([100, "N995"]);
    panel.keep(names.slice(1).map((name) => ({ pipeline: "a", name })));
    told("b", "more");
    expect(shown().at(-1)).toBe("More0");
  });
});
