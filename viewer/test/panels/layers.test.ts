// @vitest-environment jsdom
import { describe, expect, it } from "vitest";
import { move, showLayers, toggleMute } from "../../src/panels/layers";
import type { Json } from "../../src/connection/protocol";

const layer = (x: number, more: { [key: string]: Json } = {}): Json => ({ translate: { features: ["a"], by: [x, 0, 0], ...more } });

describe("the layers of a shape", () => {
  it("are muted, moved and removed by ordering the whole stack", () => {
    const stack = [layer(1), layer(2, { muted: true }), layer(3)];
    const root = document.createElement("ol");
    const orders: Json[][] = [];
    showLayers(root, stack, (changed) => orders.push(changed));
    const press = (row: number, label: string): void => root.children[row]!.querySelector<HTMLButtonElement>(`button[title="${label}"]`)!.click();
    press(0, "Mute");
    press(1, "Unmute");
    press(2, "Earlier");
    press(0, "Later");
    press(1, "Remove");
    press(0, "Earlier");
    expect(orders).toEqual([
      [layer(1, { muted: true }), layer(2, { muted: true }), layer(3)],
      [layer(1), layer(2), layer(3)],
      [layer(1), layer(3), layer(2, { muted: true })],
      [layer(2, { muted: true }), layer(1), layer(3)],
      [layer(1), layer(3)],
    ]);
    expect(root.querySelector<HTMLElement>("li:nth-child(2)")!.dataset.muted).toBe("true");
    expect(root.querySelector("button[title=Remove]")!.getAttribute("aria-label")).toBe("Remove: translate a by (1, 0, 0)");
  });

  it("survive stacks that make no sense", () => {
    for (const odd of [null, 3, "x", [], {}, { translate: null }] as Json[]) {
      expect(toggleMute([odd], 0)).toHaveLength(1);
      expect(move([odd, 1], 1, 0)).toEqual([1, odd]);
      showLayers(document.createElement("ol"), [odd], () => undefined);
    }
  });
});
