// @vitest-environment jsdom
import { beforeEach, describe, expect, it } from "vitest";
import { watchKeys } from "../../src/panels/keys";
import { bodyOf } from "../../src/store/draft";
import { page } from "../page";
import { openDocument } from "./document";

describe("the keys", () => {
  let made: ReturnType<typeof page>;
  const press = (key: string, more: KeyboardEventInit = {}): void => { window.dispatchEvent(new KeyboardEvent("keydown", { key, ctrlKey: true, ...more })); };
  beforeEach(() => {
    openDocument();
    made = page({ stack: [{ translate: { features: ["wall"], by: [1, 0, 0] } }] });
    watchKeys(made.store, made.commands);
  });

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

  it("lead from the head of the page to its foot", () => {
    document.getElementById("to-apply")!.click();
    expect(document.activeElement!.id).toBe("foot");
    (document.getElementById("apply") as HTMLButtonElement).disabled = false;
    document.getElementById("to-apply")!.click();
    expect(document.activeElement!.id).toBe("apply");
  });
});
