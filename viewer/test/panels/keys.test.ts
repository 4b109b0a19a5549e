// @vitest-environment jsdom
import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { watchKeys } from "../../src/panels/keys";
import { NotesPanel } from "../../src/panels/notes";
import { Marks } from "../../src/picture/marks";
import { bodyOf } from "../../src/store/draft";
import { page } from "../page";
import { openDocument } from "./document";

describe("the keys", () => {
  let made: ReturnType<typeof page>;
  let listeners: unknown[];
  const press = (key: string, more: KeyboardEventInit = {}): void => { window.dispatchEvent(new KeyboardEvent("keydown", { key, ctrlKey: true, ...more })); };
  beforeEach(() => {
    openDocument();
    made = page({ stack: [{ translate: { features: ["wall"], by: [1, 0, 0] } }] });
    const added = vi.spyOn(window, "addEventListener");
    watchKeys(made.store, made.commands);
    listeners = added.mock.calls.map(([, listener]) => listener);
    added.mockRestore();
  });
  // The window outlives a test.
  afterEach(() => listeners.forEach((listener) => window.removeEventListener("keydown", listener as EventListener)));

  it("take back what stands in the form first, then orders", () => {
    made.store.dispatch({ type: "composed", key: "translate", values: { by: [2, 0, 0] }, step: "drag 1" });
    press("z");
    expect(bodyOf(made.store.state.draft).factors).toEqual([1, 1, 1]);
    expect(made.sent).toEqual([]);
    press("Z", { shiftKey: true });
    expect(bodyOf(made.store.state.draft).by).toEqual([2, 0, 0]);
    press("z");
    press("z");
    expect(made.orders()).toEqual([{ undo: 1 }]);
  });

  it("do nothing for whoever may not steer", () => {
    made.greet({ role: "watcher" });
    press("z");
    press("z", { shiftKey: true });
    expect(made.sent).toEqual([]);
  });

  /** Presses a key in a field of its own below `parent`. */
  const pressIn = (parent: Element, key: string, more: KeyboardEventInit = {}, tag: "input" | "select" | "textarea" = "input"): KeyboardEvent => {
    const field = parent.appendChild(document.createElement(tag));
    const event = new KeyboardEvent("keydown", { key, ctrlKey: true, bubbles: true, cancelable: true, ...more });
    field.dispatchEvent(event);
    field.remove();
    return event;
  };

  it("leave a text to the browser, except where an edit is composed", () => {
    for (const place of ["parameters", "slice", "look", "tools"]) expect(pressIn(document.getElementById(place)!, "z").defaultPrevented, place).toBe(false);
    pressIn(document.getElementById("fields")!, "z", {}, "textarea");
    expect(made.orders()).toEqual([]);
    const box = document.getElementById("stage")!.appendChild(document.createElement("label"));
    box.className = "gizmo-value";
    for (const parent of [document.getElementById("fields")!, box]) {
      made.store.dispatch({ type: "composed", key: "translate", values: { by: [2, 0, 0] }, step: "drag 1" });
      expect(pressIn(parent, "z").defaultPrevented).toBe(true);
      expect(bodyOf(made.store.state.draft).factors).toEqual([1, 1, 1]);
    }
    // A list of choices is no text.
    pressIn(document.getElementById("look")!, "z", {}, "select");
    expect(made.orders()).toEqual([{ undo: 1 }]);
  });

  it("apply nothing where the key meant something else, such as a note", () => {
    new NotesPanel(made.store, made.commands, new Marks(document.querySelector<SVGElement>("#marks")!, ([x, y]) => [x, y]), { flyTo: () => undefined, middle: () => [0, 0, 0] }, () => undefined);
    let applied = 0;
    const apply = document.getElementById("apply") as HTMLButtonElement;
    apply.disabled = false;
    apply.addEventListener("click", (event) => {
      event.preventDefault();
      applied++;
    });
    const note = document.getElementById("note-text") as HTMLTextAreaElement;
    note.value = "the eddy";
    note.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", ctrlKey: true, bubbles: true, cancelable: true }));
    expect([made.sent.length, applied]).toEqual([1, 0]);
    press("Enter");
    expect(applied).toBe(1);
  });

  it("lead from the head of the page to its foot", () => {
    document.getElementById("to-apply")!.click();
    expect(document.activeElement!.id).toBe("foot");
    (document.getElementById("apply") as HTMLButtonElement).disabled = false;
    document.getElementById("to-apply")!.click();
    expect(document.activeElement!.id).toBe("apply");
  });
});
