// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import type { Vector } from "../../src/connection/protocol";
import { BendTool } from "../../src/handles/bend-tool";
import { bodyOf } from "../../src/store/draft";
import { page } from "../page";

describe("bending by numbers", () => {
  let made: ReturnType<typeof page>;
  let root: HTMLElement;
  let tool: BendTool;
  let asked: [number, Vector, number][];
  let nodes: { choices: { index: number; name: string }[]; alone: number | null };
  const bar = (): HTMLElement => root.querySelector<HTMLElement>('[role="toolbar"]')!;
  const button = (): HTMLButtonElement => root.querySelector<HTMLButtonElement>("button.bend")!;
  const degrees = (): HTMLInputElement => root.querySelector("input")!;
  const [node, plane] = [0, 1].map((at) => (): HTMLSelectElement => root.querySelectorAll("select")[at]!) as [() => HTMLSelectElement, () => HTMLSelectElement];
  const choose = (select: HTMLSelectElement, value: string): void => {
    select.value = value;
    select.dispatchEvent(new Event("change"));
  };

  beforeEach(() => {
    made = page();
    [root, asked, nodes] = [document.createElement("div"), [], { choices: [], alone: null }];
    tool = new BendTool(root, {
      get choices() { return nodes.choices; },
      get alone() { return nodes.alone; },
      choose: (index) => { nodes.alone = index < 0 ? null : index; },
      bend: (...how) => {
        asked.push(how);
        return { key: "skeleton", values: { moves: [], name: "Bend" } };
      },
    }, () => [0.1234567891, 0, 1], made.store, () => tool.show());
    tool.show();
  });
  const open = (): void => {
    nodes.choices = [{ index: 2, name: "wall · node 3" }, { index: 5, name: "wall · node 6" }];
    tool.show();
  };

  it("is there while there is a skeleton, and bends only where one node is meant", () => {
    expect(bar().hidden).toBe(true);
    open();
    expect([bar().hidden, button().disabled, [...node().options].map(({ text }) => text)]).toEqual([false, true, ["click a node", "wall · node 3", "wall · node 6"]]);
    choose(node(), "5");
    expect([nodes.alone, button().disabled]).toEqual([5, false]);
    // One that is met in the picture is meant here too, and several are none.
    nodes.alone = 2;
    tool.show();
    expect(node().value).toBe("2");
    nodes.alone = null;
    tool.show();
    expect([node().value, button().disabled]).toEqual(["", true]);
    choose(node(), "");
    expect(nodes.alone).toBeNull();
  });

  it("makes one edit of the node, the angle and the plane, each a step of its own", () => {
    open();
    choose(node(), "2");
    button().click();
    degrees().value = "-35,5";
    choose(plane(), "yz");
    degrees().dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", cancelable: true }));
    choose(plane(), "picture");
    button().click();
    expect(asked).toEqual([[2, [0, 0, 1], 20], [2, [1, 0, 0], -35.5], [2, [0.123457, 0, 1], -35.5]]);
    expect([made.store.state.draft.key, bodyOf(made.store.state.draft).name, made.store.state.draft.past.length]).toEqual(["skeleton", "Bend", 3]);
  });

  it("marks what is no angle, and asks for nothing then", () => {
    open();
    choose(node(), "2");
    for (const text of ["", "much", "181"]) {
      degrees().value = text;
      button().click();
      expect(degrees().getAttribute("aria-invalid"), text).toBe("true");
    }
    expect(asked).toEqual([]);
    degrees().value = "180";
    button().click();
    expect([degrees().getAttribute("aria-invalid"), asked.length]).toEqual(["false", 1]);
  });
});
