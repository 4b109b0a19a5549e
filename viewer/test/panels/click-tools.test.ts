// @vitest-environment jsdom
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { ClickTools, OnePlace } from "../../src/panels/click-tools";
import { openDocument } from "./document";

describe("the tools that take clicks", () => {
  let tools: ClickTools;
  let taken: number[];
  let heard: ReturnType<typeof vi.spyOn>;
  const pressed = (): string[] => ["ruler", "pin"].filter((id) => document.getElementById(id)!.getAttribute("aria-pressed") === "true");
  const escape = (from: EventTarget = window): KeyboardEvent => {
    const event = new KeyboardEvent("keydown", { key: "Escape", bubbles: true, cancelable: true });
    from.dispatchEvent(event);
    return event;
  };
  beforeEach(() => {
    openDocument();
    taken = [];
    let isMeasuring = false;
    heard = vi.spyOn(window, "addEventListener");
    tools = new ClickTools(document.getElementById("scene")!, [
      { button: "ruler", isOn: () => isMeasuring, toggle: () => { isMeasuring = !isMeasuring; }, take: () => true },
      new OnePlace("pin", (x) => x > 100 && taken.push(x) > 0),
    ]);
  });
  afterEach(() => {
    for (const [name, listener] of heard.mock.calls as [string, EventListener][]) window.removeEventListener(name, listener);
    heard.mockRestore();
  });

  it("are one at a time, by their buttons, and one for a single place waits until it has met one", () => {
    expect(tools.taking()).toBeNull();
    document.getElementById("ruler")!.click();
    expect(pressed()).toEqual(["ruler"]);
    document.getElementById("pin")!.click();
    expect(pressed()).toEqual(["pin"]);
    expect([tools.taking()!(10, 0), pressed()]).toEqual([false, ["pin"]]);
    expect([tools.taking()!(110, 0), pressed(), taken]).toEqual([true, [], [110]]);
    expect(tools.taking()).toBeNull();
  });

  it("stay as they are where a key asks for one that is not offered", () => {
    tools.use("ruler");
    const button = document.getElementById("pin") as HTMLButtonElement;
    button.disabled = true;
    tools.use("pin");
    expect(pressed()).toEqual(["ruler"]);
    // One that is on can be left all the same.
    button.disabled = false;
    tools.use("pin");
    button.disabled = true;
    tools.use("pin");
    expect(pressed()).toEqual([]);
  });

  it("take the middle of the picture with Enter, where the focus is there", () => {
    const scene = document.getElementById("scene")!;
    const enter = (): KeyboardEvent => {
      const event = new KeyboardEvent("keydown", { key: "Enter", bubbles: true, cancelable: true });
      scene.dispatchEvent(event);
      return event;
    };
    scene.getBoundingClientRect = () => new DOMRect(0, 50, 100, 400);
    expect(enter().defaultPrevented).toBe(false);
    tools.use("pin");
    expect([enter().defaultPrevented, taken, pressed()]).toEqual([true, [], ["pin"]]);
    const tip = document.getElementById("tip")!;
    expect([tip.textContent, tip.hidden]).toEqual(["Nothing lies in the middle of the picture: turn or move it there.", false]);
    // Whatever is done next, it is not said any more.
    for (const next of [new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true }), new PointerEvent("pointerdown", { bubbles: true }), new WheelEvent("wheel", { bubbles: true })]) {
      enter();
      expect(tip.hidden).toBe(false);
      scene.dispatchEvent(next);
      expect(tip.hidden, next.type).toBe(true);
    }
    enter();
    tip.textContent = "wall";
    scene.dispatchEvent(new PointerEvent("pointerdown", { bubbles: true }));
    expect(tip.hidden).toBe(false);
    scene.getBoundingClientRect = () => new DOMRect(100, 50, 600, 400);
    enter();
    expect([taken, pressed(), document.getElementById("tip")!.hidden]).toEqual([[400], [], true]);
  });

  it("are left with Escape, which is then for nothing else; one that somebody types is not for them", () => {
    expect(escape().defaultPrevented).toBe(false);
    document.getElementById("pin")!.click();
    escape(document.getElementById("note-text")!);
    expect(pressed()).toEqual(["pin"]);
    document.getElementById("keys")!.setAttribute("open", "");
    expect([escape(document.body).defaultPrevented, pressed()]).toEqual([false, ["pin"]]);
    document.getElementById("keys")!.removeAttribute("open");
    expect([escape().defaultPrevented, pressed(), tools.current]).toEqual([true, [], null]);
  });
});
