// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { watchPointer } from "../../src/picture/pointer";
import { Selection } from "../../src/store/selection";
import { page } from "../page";
import { openDocument } from "../panels/document";

describe("a click in the picture", () => {
  let scene: HTMLElement;
  let made: ReturnType<typeof page>;
  let isWaiting: boolean;
  let taken: number[];
  const tip = (): string | null => { const found = document.getElementById("tip")!; return found.hidden ? null : found.textContent; };
  const point = (kind: string, x: number, pointerType = "mouse"): void => void scene.dispatchEvent(new PointerEvent(kind, { bubbles: true, button: 0, clientX: x, clientY: 5, pointerType }));
  const click = (x: number): void => { for (const kind of ["pointerdown", "pointerup"]) point(kind, x); };
  const drawn = (): Promise<unknown> => new Promise((resolve) => { requestAnimationFrame(resolve); });
  /** The model is right of 100, and all of it is the wall. */
  beforeEach(() => {
    openDocument();
    made = page();
    scene = document.getElementById("scene")!;
    isWaiting = true;
    taken = [];
    watchPointer(scene, { featureAt: (x: number) => (x > 100 ? "wall" : null) }, new Selection(made.store), {
      reading: () => "",
      tool: () => (isWaiting ? (x) => x > 100 && taken.push(x) > 0 : null),
    });
  });

  it("says beside the pointer that it has met nothing where a tool waits for a place, until the next", async () => {
    click(10);
    expect(tip()).toBe("That click met nothing: click on the model.");
    point("pointermove", 110);
    await drawn();
    expect(tip()).toBe("That click met nothing: click on the model.\nwall");
    click(110);
    await drawn();
    expect([tip(), taken]).toEqual(["wall", [110]]);
    click(10);
    expect(tip()).toContain("met nothing");
    point("pointerdown", 10);
    expect(tip()).toBeNull();
  });

  it("says so no more once the tool waits for nothing, and never without one", async () => {
    click(10);
    isWaiting = false;
    point("pointermove", 12);
    await drawn();
    expect(tip()).toBeNull();
    click(10);
    await drawn();
    expect(tip()).toBeNull();
    click(110);
    expect([made.store.state.selection.parts.wall, taken]).toEqual(["handle", []]);
  });

  it("tells readers of the screen of each miss, and not of what the pointer passes over", async () => {
    const told: (string | null)[] = [];
    const announcer = document.getElementById("announcer")!;
    new MutationObserver(() => told.push(announcer.textContent)).observe(announcer, { childList: true });
    for (const click of [1, 2]) {
      point("pointerdown", 10);
      await drawn();
      point("pointerup", 10);
      await drawn();
      expect(told.filter((text) => text !== "")).toEqual(Array.from({ length: click }, () => "That click met nothing: click on the model."));
    }
    point("pointermove", 110);
    await drawn();
    expect(told).toHaveLength(3);
  });

  it("says so to a finger too, which leaves the picture with each click", () => {
    click(10);
    point("pointerleave", 10, "touch");
    expect(tip()).toContain("met nothing");
    point("pointerleave", 10);
    expect(tip()).toBeNull();
  });
});
